"""Mechanism: macro-blocks, and the hinges, sliding and crushing joints between them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from solver.assembly import Assembly
from solver.geometry.contacts import Contacts
from solver.geometry.portions import linked
from solver.kinematics import motion_size, relative_velocities
from solver.tolerances import CLOSED, NOTICEABLE
from solver.words import counted

from .increment import Increment, at_rest, carries, slides

#: Joints that are named in words; the others are counted.
NAMED = 8


@dataclass(frozen=True, eq=False)
class Mechanism:
    """The mechanism in the motion that follows an increment.

    Joints are pairs of blocks, (n, 2) int arrays, that move noticeably beside the fastest block: between which
    macro-blocks turn about a point, slide along a joint, or come closer at their compressive strength. A joint that
    crushes is no hinge, as it presses where it does not turn.
    """

    parts: np.ndarray  #: (n_blocks,) int: macro-block of each block, largest first; -1 for blocks at rest
    motions: np.ndarray  #: (n_parts, n_dof): velocity of the centroid and angular one, in the scale of the increment
    hinges: np.ndarray
    sliding: np.ndarray
    crushing: np.ndarray
    hinge_points: np.ndarray  #: (n_hinges,) int: contact point about which each turns, of several what carries most
    sliding_points: np.ndarray  #: (k,) int: contact points that slide, of all joints
    crushing_points: np.ndarray  #: (k,) int: contact points that crush, of all joints
    names: tuple[str, ...]  #: of the blocks

    def __str__(self) -> str:
        """Count the macro-blocks, and name the hinges, sliding and crushing joints."""
        words = [counted(len(self.motions), "macro-block")]
        for what, pairs in (("hinge", self.hinges), ("sliding", self.sliding), ("crushing", self.crushing)):
            if len(pairs) == 0:
                continue
            several = "hinges" if what == "hinge" and len(pairs) > 1 else what
            joints = ", ".join(f"{self.names[a]} | {self.names[b]}" for a, b in pairs[:NAMED])
            more = f" and {len(pairs) - NAMED} more" if len(pairs) > NAMED else ""
            words.append(f"{several} at {joints}{more}")
        return "; ".join(words)


def rigid_parts(assembly: Assembly, increment: Increment) -> np.ndarray:
    """(n_blocks,) int array: the part each block moves with in the motion that follows an increment.

    Part -1 is at rest, as is what hangs together with a support at rest. The others are numbered from 0, the largest
    volume first. The contact points of two blocks that move together come apart, and their corners turn against each
    other, by next to nothing.
    """
    # Read once: the arrays may be in a file.
    increment = increment.with_arrays()
    pairs, apart, slow = joint_rates(assembly, increment)
    part = linked(pairs[apart <= slow].T, assembly.n_blocks)
    # Corners, not centroids: a block may turn about its own centroid.
    fast = motion_size(increment.velocity, assembly.block_size) > slow
    # A tower on a support at rest leans at its top where each joint gives next to nothing: it does not move.
    still = np.setdiff1d(part[~assembly.free & ~fast], part[~assembly.free & fast])
    moves = fast & assembly.free & ~np.isin(part, still)
    volume = np.bincount(part, weights=assembly.shapes.volumes * moves)
    rank = np.argsort(np.argsort(-volume, kind="stable"))
    return np.where(moves, rank[part], -1)


def joint_rates(assembly: Assembly, increment: Increment) -> tuple[np.ndarray, np.ndarray, float]:
    """Pairs of blocks, (n, 2), how fast they come apart or turn against each other, (n,), and what is slow for these.

    The fastest joint is the measure, not the fastest block: the top of a tower goes far where its foot opens a little.
    """
    contacts, d = increment.contacts, assembly.dimension
    spins = increment.velocity[:, d:] * assembly.block_size
    rates, gives = increment.displacements.copy(), contacts.gaps < CLOSED * assembly.block_size
    gives[np.flatnonzero(increment.state.crushing)] = False
    # What only comes closer at a closed joint is its give, which is no parting.
    rates[gives, 0] = np.maximum(rates[gives, 0], 0.0)
    pairs, joint = contacts.joints()
    apart = np.zeros(len(pairs))
    np.maximum.at(apart, joint, np.abs(rates).max(axis=1))
    apart = np.maximum(apart, np.abs(spins[pairs[:, 0]] - spins[pairs[:, 1]]).max(axis=1))
    fastest = max(apart.max(initial=0.0), 0.2 * float(np.abs(increment.velocity[:, :d]).max(initial=0.0)))
    return pairs, apart, NOTICEABLE * fastest


def mechanism_of(assembly: Assembly, increment: Increment) -> Mechanism:
    """Find the mechanism in the motion that follows an increment: macro-blocks, hinges, sliding and crushing joints.

    Notes
    -----
    The motion distinguishes joints: one slides where a closed contact point moves along it (and carries force,
    where any does), and hinges where a point stays while the blocks turn against each other. A hinge may have no other
    point that opens: of a joint that is wide open already, only the corner it turns about is near enough to touch.
    """
    increment = increment.with_arrays()
    parts = rigid_parts(assembly, increment)
    contacts, velocity, d = increment.contacts, increment.velocity, assembly.dimension
    count = int(parts.max(initial=-1)) + 1
    moves, motions = parts >= 0, np.zeros((count, velocity.shape[1]))
    np.add.at(motions, parts[moves], (assembly.masses[:, None] * velocity)[moves])
    motions /= np.bincount(parts[moves], assembly.masses[moves], count)[:, None]
    slow = joint_rates(assembly, increment)[2]
    between = parts[contacts.block_a] != parts[contacts.block_b]
    closed = between & (contacts.gaps < CLOSED * assembly.block_size)
    opening, slip = increment.displacements[:, 0], np.linalg.norm(increment.displacements[:, 1:], axis=1)
    spin = np.abs(velocity[contacts.block_a, d:] - velocity[contacts.block_b, d:]).max(axis=1, initial=0.0)
    turns = closed & at_rest(opening, slow) & at_rest(slip, slow) & ~at_rest(spin * assembly.block_size, slow)
    slips = closed & slides(increment.forces, slip, opening, increment.friction, slow)
    carrying = carries(increment.forces)
    at_strength = increment.state.crushing
    crushes = closed & carrying & (opening < -slow) & (at_strength if len(at_strength) else False)
    slips &= carrying | ~carrying.any()
    of_pair = contacts.pair_keys()
    turns &= ~np.isin(of_pair, of_pair[crushes])
    slipping, crushing = np.flatnonzero(slips), np.flatnonzero(crushes)
    (hinges, points), (sliding, _), (crushed, _) = (
        _joints(contacts, chosen, increment.forces[:, 0]) for chosen in (np.flatnonzero(turns), slipping, crushing)
    )
    return Mechanism(parts, motions, hinges, sliding, crushed, points, slipping, crushing, assembly.names)


def _joints(contacts: Contacts, chosen: np.ndarray, normal: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Pairs of blocks that chosen contact points lie between, (n, 2), and of each the point that carries most."""
    order = chosen[np.argsort(-normal[chosen], kind="stable")]
    pairs, joint = contacts[order].joints()
    return pairs, order[np.unique(joint, return_index=True)[1]]


def with_motion(increment: Increment, motion: np.ndarray) -> Increment:
    """Give an increment another motion, (n_blocks, n_dof) in any scale, and so other hinges and sliding joints."""
    rates = relative_velocities(increment.contacts, increment.pose, motion)
    return increment.with_arrays(velocity=motion, displacements=rates)
