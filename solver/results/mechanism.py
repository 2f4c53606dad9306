"""Mechanism: which blocks move together, and what happens at the joints between them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from solver.assembly import Assembly
from solver.kinematics import motion_size, moving_together, relative_velocities

from .increment import ContactState, Increment

#: Blocks belong together where their contact points move apart by less than this fraction of the fastest block.
TOGETHER = 1e-3

#: Joints that are named one by one in words; of more, their number is told.
NAMED = 8


@dataclass(frozen=True)
class Mechanism:
    """How a structure moves in the motion that follows an increment.

    Attributes
    ----------
    parts : (n_blocks,) int array
        Macro-block of each block, largest first; -1 for blocks that stand still.
    motions : (n_parts, 3) array
        Velocity of the centroid of each macro-block and its angular velocity, in the scale of the increment.
    hinges, sliding : (n, 2) int arrays
        Pairs of blocks between which macro-blocks turn about a point, or slide along a joint.
    names : tuple of str
        Of the blocks.
    """

    parts: np.ndarray
    motions: np.ndarray
    hinges: np.ndarray
    sliding: np.ndarray
    names: tuple[str, ...]

    def __str__(self) -> str:
        n = len(self.motions)
        words = [f"{n} macro-block{'' if n == 1 else 's'}"]
        for what, pairs in (("hinge", self.hinges), ("sliding", self.sliding)):
            if len(pairs) == 0:
                continue
            several = "hinges" if what == "hinge" and len(pairs) > 1 else what
            joints = ", ".join(f"{self.names[a]} | {self.names[b]}" for a, b in pairs[:NAMED])
            more = f" and {len(pairs) - NAMED} more" if len(pairs) > NAMED else ""
            words.append(f"{several} at {joints}{more}")
        return "; ".join(words)


def rigid_parts(assembly: Assembly, increment: Increment) -> np.ndarray:
    """(n_blocks,) int array: the part each block moves with in the motion that follows an increment.

    Part -1 stands still. The others are numbered from 0, the largest area first.
    """
    contacts, n = increment.contacts, assembly.n_blocks
    fastest = float(np.abs(increment.velocity[:, :2]).max(initial=0.0))
    if fastest == 0.0 or len(contacts) == 0:
        return np.full(n, -1)
    spins = increment.velocity[:, 2:] * assembly.block_size
    part = moving_together(n, contacts, np.abs(increment.displacements).max(axis=1), spins, TOGETHER * fastest)
    # Corners, not centroids: a block may turn about its own centroid.
    moves = motion_size(increment.velocity, assembly.block_size) > 10.0 * TOGETHER * fastest
    moves &= assembly.free
    area = np.bincount(part, weights=assembly.areas * moves, minlength=int(part.max()) + 1)
    rank = np.empty(len(area), dtype=int)
    rank[np.argsort(-area, kind="stable")] = np.arange(len(area))
    return np.where(moves, rank[part], -1)


def mechanism_of(assembly: Assembly, increment: Increment) -> Mechanism:
    """The mechanism in the motion that follows an increment: macro-blocks, hinges, sliding joints.

    Parameters
    ----------
    assembly : Assembly
    increment : Increment

    Returns
    -------
    Mechanism

    Notes
    -----
    In a fall the forces of the program are of no use, so that joints are told by their motion alone: a joint slides
    where a closed contact point moves along it, and hinges where one stays and another point of it opens or closes.
    """
    parts = rigid_parts(assembly, increment)
    contacts, n = increment.contacts, assembly.n_blocks
    count = int(parts.max(initial=-1)) + 1
    mass = np.bincount(parts[parts >= 0], weights=assembly.masses[parts >= 0], minlength=count)
    motions = np.zeros((count, 3))
    for axis in range(3):
        momentum = (assembly.masses * increment.velocity[:, axis])[parts >= 0]
        motions[:, axis] = np.bincount(parts[parts >= 0], weights=momentum, minlength=count) / mass
    fastest = float(np.abs(increment.velocity[:, :2]).max(initial=0.0))
    slow = 10.0 * TOGETHER * fastest
    closed = contacts.gaps < TOGETHER * assembly.block_size
    between = parts[contacts.block_a] != parts[contacts.block_b]
    opening, slip = increment.displacements[:, 0], np.abs(increment.displacements[:, 1])
    stays = closed & between & (np.abs(opening) <= slow)
    spin = np.abs(increment.velocity[contacts.block_a, 2] - increment.velocity[contacts.block_b, 2])
    turns = stays & (slip <= slow) & (spin * assembly.block_size > slow)
    slides = closed & between & (slip > slow) & (opening <= np.maximum(slow, increment.friction * slip * 1.01))
    states = increment.states
    if (states != ContactState.OPEN).any():
        slides &= states != ContactState.OPEN

    def pairs(chosen: np.ndarray) -> np.ndarray:
        low = np.minimum(contacts.block_a, contacts.block_b)[chosen]
        high = np.maximum(contacts.block_a, contacts.block_b)[chosen]
        found = np.unique(low.astype(np.int64) * n + high)
        return np.stack([found // n, found % n], axis=1)

    return Mechanism(parts=parts, motions=motions, hinges=pairs(turns), sliding=pairs(slides), names=assembly.names)


def with_motion(increment: Increment, motion: np.ndarray) -> Increment:
    """The increment with its hinges and sliding joints those of another motion.

    Parameters
    ----------
    increment : Increment
    motion : (n_blocks, 3) array
        Velocity of each centroid and angular velocity, in any scale.
    """
    rates = relative_velocities(increment.contacts, increment.pose, motion)
    return increment.with_arrays(velocity=motion, displacements=rates)
