"""The motion that follows an increment: blocks swung out by it, to first order and out of scale, and what falls.

And what the datasets say of it, and of the friction that is used up.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

import solver
from blockvis.dynamics.fall import falls_from, with_mechanism
from solver import mechanics

from .about import STATIC, Quantities, losing, quantities_in
from .joint_faces import carried_between

#: How far the fastest block of a mechanism is swung to be shown, in extents of the structure.
SWING = 0.05

#: How far the fastest corner goes by the point array ``mechanism``, in extents of the free blocks: to be seen at once.
AHEAD = 0.1


def block_motion(
    assembly: solver.Assembly, increment: solver.Increment, falls: np.ndarray | None = None
) -> dict[str, np.ndarray]:
    """Make the cell arrays of blocks that describe the motion that follows.

    The collapse takes blocks (n_blocks,); by default those that have fallen, in frames of a fall those that move.
    """
    parts, d = mechanics.rigid_parts(assembly, increment), assembly.dimension
    if falls is None:
        falls = (increment.fallen & ~increment.removed) | ((increment.status == solver.Status.FALLING) & (parts >= 0))
    velocity = increment.velocity
    flat = np.zeros((assembly.n_blocks, 3 - d))
    return {
        "falls": falls.astype(np.int32),
        "macro_block": parts.astype(np.int32),
        "mechanism_velocity": np.hstack([velocity[:, :d], flat]),
        "mechanism_rotation": velocity[:, 2].copy() if d == 2 else velocity[:, 3:].copy(),
    }


def corner_speeds(assembly: solver.Assembly, pose: solver.Pose, motion: np.ndarray) -> np.ndarray:
    """(n_blocks,) array: speed of the fastest corner of each block in a motion (n_blocks, n_dof), zero for supports."""
    block = assembly.block_of_vertex
    velocity = mechanics.point_velocities(mechanics.moved_vertices(assembly, pose), block, pose, motion)
    speeds = np.zeros(assembly.n_blocks)
    np.maximum.at(speeds, block, np.hypot.reduce(velocity, axis=1))
    return np.where(assembly.free, speeds, 0.0)


def swing_factors(
    assembly: solver.Assembly, increment: solver.Increment, reach: float, shares: np.ndarray
) -> np.ndarray:
    """(n,) array: factors on the motion that follows with which the fastest corner goes shares (n,) of a reach.

    The reach is in extents of the free blocks. Zero where nothing moves.
    """
    fastest = float(corner_speeds(assembly, increment.pose, increment.velocity).max(initial=0.0))
    if fastest == 0.0:
        return np.zeros(len(shares))
    corners = mechanics.moved_vertices(assembly, increment.pose)[assembly.free[assembly.block_of_vertex]]
    return np.asarray(shares * (reach * float(np.ptp(corners, axis=0).max())) / fastest)


def swung(pose: solver.Pose, motion: np.ndarray) -> solver.Pose:
    """Move each block on the arc about its own pole, so that macro-blocks stay together.

    By the translation of its centroid [m] and rotation [rad], (n_blocks, n_dof), as a linear program has them; in space
    a screw motion.

    Notes
    -----
    In space the centroid, at velocity v and spin ω, travels on a helix: with θ = |ω|, by
    v sin θ / θ + ω × v (1 - cos θ) / θ² + ω (ω · v) (θ - sin θ) / θ³; in the plane, where ω · v = 0, on an arc about
    the pole.
    """
    d = pose.positions.shape[1]
    travel, spin = motion[:, :d], motion[:, d:]
    angle = np.linalg.norm(spin, axis=1)
    first, second = np.sinc(angle / np.pi), np.sinc(angle / (2.0 * np.pi)) ** 2 / 2.0
    paths = first[:, None] * travel + second[:, None] * np.einsum("nrd,nr->nd", mechanics.cross_rows(travel), spin)
    if d == 3:
        third = np.divide(1.0 - first, angle**2, out=np.full_like(angle, 1.0 / 6.0), where=angle > 1e-4)
        paths += (third * np.einsum("ni,ni->n", spin, travel))[:, None] * spin
    return solver.Pose(pose.positions + paths, mechanics.moved(pose, motion).rotations)


def swung_increment(increment: solver.Increment, motion: np.ndarray) -> solver.Increment:
    """Give the blocks of a state after a motion (n_blocks, n_dof), with its contact points carried along."""
    contacts, pose = increment.contacts, swung(increment.pose, motion)
    points = carried_between(contacts.points, contacts.block_a, contacts.block_b, increment.pose, pose)
    moved = increment.with_arrays(pose=pose, contacts=replace(contacts, points=points))
    return replace(moved, status=solver.Status.FALLING, programs=0, seconds=0.0, checkpoint=None)


def next_places(
    assembly: solver.Assembly, increment: solver.Increment, points: np.ndarray, *blocks: np.ndarray
) -> np.ndarray:
    """(n_points, d) array [m]: a step of points along the motion that follows, to first order, out of scale.

    Each moves with a block, (n_points,) int, or stays midway between two.
    """
    factor = swing_factors(assembly, increment, AHEAD, np.ones(1))[0]
    each = [mechanics.point_velocities(points, block, increment.pose, increment.velocity) for block in blocks]
    return np.asarray(factor * sum(each[1:], each[0]) / len(each))


def part_of_friction(forces: np.ndarray, friction: np.ndarray) -> np.ndarray:
    """(n_contacts,) array: shear of forces (n_contacts, d) over what friction allows; 0 where it allows none."""
    allowed = friction * forces[:, 0]
    shear = np.linalg.norm(forces[:, 1:], axis=1)
    return np.divide(shear, allowed, out=np.zeros(len(forces)), where=allowed > 0.0)


def falling_in(response: solver.Response) -> np.ndarray:
    """(n_blocks,) bool array: blocks that have fallen by the last equilibrium, or that the collapse takes."""
    last, begins = response.path[-1], losing(response)
    falls = last.fallen & ~last.removed
    return falls if begins is None else falls | (mechanics.rigid_parts(response.assembly, begins) >= 0)


def at_last_equilibrium(response: solver.Response) -> solver.Increment:
    """Give the last increment in equilibrium, where the collapse mechanism begins there with that as its motion."""
    last, begins = response.path[-1], with_mechanism(response)
    return last if begins is None or falls_from(response) is not last else begins


def as_shown(
    response: solver.Response, increment: solver.Increment
) -> tuple[solver.Increment, Quantities, np.ndarray | None]:
    """Give an increment as files and datasets show it, its quantities, and the blocks (n_blocks,) the collapse takes.

    At the last equilibrium before a collapse the motion that follows is the mechanism; of others nothing is known.
    """
    quantities = quantities_in(response, increment.phase)
    if not response.path or increment is not response.path[-1] or response.collapse is None:
        return increment, quantities, None
    shown = at_last_equilibrium(response)
    # Where a later phase begins with the fall, the last equilibrium keeps the motion of its own phase.
    own = quantities if shown is increment else replace(quantities, motion=STATIC.motion)
    return shown, own, falling_in(response)
