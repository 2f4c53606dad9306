"""Kinematics: poses, movements and velocities of rigid blocks and of their points."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from .assembly import Assembly
from .geometry.contacts import Contacts
from .words import numbers_of


@dataclass(frozen=True, eq=False)
class Pose:
    """Positions and rotations of all blocks, in the plane or in space.

    Attributes
    ----------
    positions : (n_blocks, d) array [m]
        Current centroids.
    rotations : (n_blocks, n_rot) array [rad]
        Rotation vectors from the drawing, n_rot = d (d - 1) / 2: in the plane one column, the angle counter-clockwise.
    """

    positions: np.ndarray
    rotations: np.ndarray

    def __post_init__(self) -> None:
        """Check the shapes, and that all is finite."""
        positions, rotations = (numbers_of(getattr(self, name), name) for name in ("positions", "rotations"))
        wanted = (len(positions), rotation_count(positions.shape[1])) if positions.ndim == 2 else None
        if rotations.shape != wanted:
            what = f"positions of shape {positions.shape} and rotations of shape {rotations.shape}"
            raise ValueError(f"a pose has {what}; give d and d (d - 1) / 2 numbers per block")
        for block in np.flatnonzero(~np.isfinite(np.hstack([positions, rotations])).all(axis=1)):
            raise ValueError(f"the pose of block {block} is {positions[block]}, {rotations[block]}; not finite")
        vars(self).update(positions=positions, rotations=rotations)

    @classmethod
    def initial(cls, assembly: Assembly) -> Pose:
        """Pose of the blocks as drawn."""
        n, d = assembly.centroids.shape
        return cls(assembly.centroids.copy(), np.zeros((n, rotation_count(d))))

    def displacements(self, assembly: Assembly) -> np.ndarray:
        """(n_blocks, n_dof) array: displacement of each centroid [m] and rotation [rad] since the drawing."""
        return np.concatenate([self.positions - assembly.centroids, self.rotations], axis=1)

    def movement_to(self, other: Pose) -> np.ndarray:
        """(n_blocks, n_dof) array: displacement of each centroid [m] and rotation [rad] to another pose."""
        turn = composed_rotations(-self.rotations, other.rotations)
        return np.concatenate([other.positions - self.positions, turn], axis=1)


def rotation_count(d: int) -> int:
    """Numbers that a rotation has in d dimensions: 1 in the plane, 3 in space."""
    return d * (d - 1) // 2


def dimension_of(n_dof: int) -> int:
    """Dimensions in which a rigid block has so many degrees of freedom: 2 for 3, 3 for 6."""
    return (math.isqrt(8 * n_dof + 1) - 1) // 2


def unit_lengths(n_dof: int, length: float) -> np.ndarray:
    """(n_dof,) array: 1 for translations, ``length`` for rotations; makes movements of both kinds lengths [m]."""
    return np.where(np.arange(n_dof) < dimension_of(n_dof), 1.0, length)


def cross_rows(arms: np.ndarray) -> np.ndarray:
    """(n, n_rot, d) array of arms (n, d) [m]: ``moment = rows @ force``, and ``rows.T @ spin`` the velocity there."""
    n, d = arms.shape
    if d == 2:
        return np.stack([-arms[:, 1], arms[:, 0]], axis=1)[:, None, :]
    x, y, z = arms.T
    o = np.zeros(n)
    rows = [np.stack(row, axis=1) for row in ((o, -z, y), (z, o, -x), (-y, x, o))]
    return np.stack(rows, axis=1)


def turned_moments(arms: np.ndarray, pose: Pose) -> np.ndarray:
    """(n, n_dof) array [N·m]: change of the moments of forces whose points have turned with their blocks.

    From the sums of arm ⊗ force over the forces on each block as drawn, (n, d, d) [N·m].
    """
    d = arms.shape[1]
    change = (rotation_matrices(pose.rotations) - np.eye(d)) @ arms
    first, second = ([0], [1]) if d == 2 else ([1, 2, 0], [2, 0, 1])
    return np.hstack([np.zeros((len(arms), d)), change[:, first, second] - change[:, second, first]])


def rotation_matrices(rotations: np.ndarray) -> np.ndarray:
    """(n, d, d) array of rotations by the given vectors, (n, 1) or (n, 3) [rad], counter-clockwise seen from their tip.

    Notes
    -----
    In space Rodrigues' formula, R = I + sin θ / θ K + (1 - cos θ) / θ² K² with K v = rotation × v.
    """
    if rotations.shape[1] == 1:
        c, s = np.cos(rotations[:, 0]), np.sin(rotations[:, 0])
        return np.stack([np.stack([c, -s], axis=-1), np.stack([s, c], axis=-1)], axis=-2)
    cross = cross_rows(rotations)
    angle = np.linalg.norm(rotations, axis=1)
    # np.sinc(x) is sin πx / πx, and 1 at 0; 1 - cos θ = 2 sin² θ/2.
    first, second = np.sinc(angle / np.pi), np.sinc(angle / (2.0 * np.pi)) ** 2 / 2.0
    return np.eye(3) + first[:, None, None] * cross + second[:, None, None] * (cross @ cross)


def composed_rotations(rotations: np.ndarray, then: np.ndarray) -> np.ndarray:
    """(n, n_rot) array: the rotation vectors of one rotation after another; in the plane angles add up.

    In space through unit quaternions, which lose no digits at small angles nor near half a turn.
    """
    if rotations.shape[1] == 1:
        return rotations + then
    (first, u), (second, v) = _quaternions(rotations), _quaternions(then)
    scalar = first * second - (u * v).sum(axis=1)
    vector = first[:, None] * v + second[:, None] * u + np.cross(v, u)
    sine = np.linalg.norm(vector, axis=1)
    angle = 2.0 * np.arctan2(sine, np.abs(scalar)) * np.where(scalar < 0.0, -1.0, 1.0)
    return vector * np.divide(angle, sine, out=np.full_like(sine, 2.0), where=sine > 0.0)[:, None]


def _quaternions(rotations: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(n,) scalar and (n, 3) vector parts of the unit quaternions of rotation vectors."""
    half = np.linalg.norm(rotations, axis=1) / 2.0
    return np.cos(half), rotations * (np.sinc(half / np.pi) / 2.0)[:, None]


def moved(pose: Pose, q: np.ndarray) -> Pose:
    """Move each block by q, (n_blocks, n_dof): translation of the centroid [m], exact rotation about it [rad]."""
    d = pose.positions.shape[1]
    return Pose(pose.positions + q[:, :d], composed_rotations(pose.rotations, q[:, d:]))


def put_together(some: np.ndarray, pose: Pose, others: Pose) -> Pose:
    """Make the pose in which some blocks, (n_blocks,) bool array, are where one pose has them, the others as others."""
    chosen = some[:, None]
    positions = np.where(chosen, pose.positions, others.positions)
    return Pose(positions, np.where(chosen, pose.rotations, others.rotations))


def moved_vertices(assembly: Assembly, pose: Pose) -> np.ndarray:
    """(n_vertices, d) array [m]: corners of all blocks at a pose."""
    if (given := pose.positions.shape) != (own := assembly.centroids.shape):
        raise ValueError(f"the pose is of another structure: its positions have shape {given}, the blocks {own}")
    block = assembly.block_of_vertex
    arms = assembly.vertices - assembly.centroids[block]
    turned = np.einsum("nij,nj->ni", rotation_matrices(pose.rotations)[block], arms)
    return pose.positions[block] + turned


def turned(vectors: np.ndarray, rotations: np.ndarray) -> np.ndarray:
    """(n, d) array: vectors turned by rotation vectors, (n, d) and (n, n_rot) [rad]."""
    return np.einsum("nij,nj->ni", rotation_matrices(rotations), vectors)


def carried(points: np.ndarray, blocks: np.ndarray, before: Pose, after: Pose) -> np.ndarray:
    """(n, d) array [m]: points of the pose ``before`` that move with blocks, (n,) int, at the pose ``after``."""
    turn = composed_rotations(-before.rotations[blocks], after.rotations[blocks])
    return after.positions[blocks] + turned(points - before.positions[blocks], turn)


def point_velocities(points: np.ndarray, block: np.ndarray, pose: Pose, velocity: np.ndarray) -> np.ndarray:
    """(n, d) array: velocity of points [m] that move with blocks, (n,) int: that of the centroid, and spin × arm.

    From the velocities of the centroids, and angular ones, (n_blocks, n_dof).
    """
    d = points.shape[1]
    rows = cross_rows(points - pose.positions[block])
    spin = velocity[block, d:]
    turning = [spin[:, k, None] * rows[:, k] for k in range(spin.shape[1])]
    return velocity[block, :d] + sum(turning[1:], turning[0])


def relative_velocities(contacts: Contacts, pose: Pose, velocity: np.ndarray) -> np.ndarray:
    """(n_contacts, d) array: opening and slip of each contact point, in its own frame, by velocities in any scale."""
    a, b = (point_velocities(contacts.points, k, pose, velocity) for k in (contacts.block_a, contacts.block_b))
    return np.einsum("kij,kj->ki", contacts.frames, a - b)


def motion_size(motion: np.ndarray, length: float) -> np.ndarray:
    """(n,) array [m]: largest component of each block's movement, or of its rate, rotations times a length.

    Of translations [m] and rotations [rad], (n, n_dof); the length [m] is usually the block size.
    """
    return np.abs(motion * unit_lengths(motion.shape[1], length)).max(axis=1, initial=0.0)
