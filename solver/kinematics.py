"""Kinematics: where the blocks are, how points ride on them, which of them move together."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from .assembly import Assembly
from .geometry.contacts import Contacts


@dataclass(frozen=True)
class Pose:
    """Positions and rotations of all blocks.

    Attributes
    ----------
    positions : (n_blocks, 2) array [m]
        Current centroids.
    rotations : (n_blocks,) array [rad]
        Counter-clockwise from the drawn outline.
    """

    positions: np.ndarray
    rotations: np.ndarray

    @classmethod
    def initial(cls, assembly: Assembly) -> Pose:
        """The blocks where the drawing has them."""
        return cls(assembly.centroids.copy(), np.zeros(assembly.n_blocks))

    def displacements(self, assembly: Assembly) -> np.ndarray:
        """(n_blocks, 3) array: displacement of each centroid [m] and rotation [rad] since the drawing."""
        return np.column_stack([self.positions - assembly.centroids, self.rotations])


def rotation_matrices(angles: np.ndarray) -> np.ndarray:
    """(n, 2, 2) array of counter-clockwise rotations by the given angles [rad]."""
    c, s = np.cos(angles), np.sin(angles)
    return np.stack([np.stack([c, -s], axis=-1), np.stack([s, c], axis=-1)], axis=-2)


def moved(pose: Pose, q: np.ndarray) -> Pose:
    """The pose after each block moved by q: translation of the centroid, exact rotation about it.

    Parameters
    ----------
    pose : Pose
    q : (n_blocks, 3) array
        Translations [m] and rotation [rad] of each block.
    """
    return Pose(pose.positions + q[:, :2], pose.rotations + q[:, 2])


def moved_vertices(assembly: Assembly, pose: Pose) -> np.ndarray:
    """(n_vertices, 2) array [m]: corners of all blocks where the pose has them."""
    block = assembly.block_of_vertex
    arms = assembly.vertices - assembly.centroids[block]
    turned = np.einsum("nij,nj->ni", rotation_matrices(pose.rotations)[block], arms)
    return pose.positions[block] + turned


def carried(points: np.ndarray, blocks: np.ndarray, before: Pose, after: Pose) -> np.ndarray:
    """(n, 2) array [m]: where points that ride on blocks get to.

    Parameters
    ----------
    points : (n, 2) array [m]
        Where they are when the blocks are at ``before``.
    blocks : (n,) int array
        The block each rides on.
    before, after : Pose
    """
    arms = points - before.positions[blocks]
    turn = after.rotations[blocks] - before.rotations[blocks]
    c, s = np.cos(turn), np.sin(turn)
    turned = np.stack([c * arms[:, 0] - s * arms[:, 1], s * arms[:, 0] + c * arms[:, 1]], axis=1)
    return after.positions[blocks] + turned


def swung(pose: Pose, motion: np.ndarray) -> Pose:
    """The pose after each block turned about its own pole, so that blocks that move together stay together.

    Parameters
    ----------
    pose : Pose
    motion : (n_blocks, 3) array
        Translation of the centroid [m] and rotation [rad], as a linear program has them.
    """
    angle = motion[:, 2]
    turns = np.abs(angle) > 1e-9
    safe = np.where(turns, angle, 1.0)
    arm = np.stack([motion[:, 1] / safe, -motion[:, 0] / safe], axis=1)
    c, s = np.cos(angle) - 1.0, np.sin(angle)
    arc = np.stack([c * arm[:, 0] - s * arm[:, 1], s * arm[:, 0] + c * arm[:, 1]], axis=1)
    return Pose(pose.positions + np.where(turns[:, None], arc, motion[:, :2]), pose.rotations + angle)


def point_velocities(points: np.ndarray, block: np.ndarray, pose: Pose, velocity: np.ndarray) -> np.ndarray:
    """Velocity of points that move with blocks.

    Parameters
    ----------
    points : (n, 2) array [m]
    block : (n,) int array
    pose : Pose
    velocity : (n_blocks, 3) array
        Of the centroids, and angular.

    Returns
    -------
    (n, 2) array
    """
    arm = points - pose.positions[block]
    return velocity[block, :2] + velocity[block, 2:] * np.stack([-arm[:, 1], arm[:, 0]], axis=1)


def moving_together(
    n_blocks: int, contacts: Contacts, apart: np.ndarray, turned: np.ndarray, together: float
) -> np.ndarray:
    """(n_blocks,) int array: number of the group of each block.

    Parameters
    ----------
    n_blocks : int
    contacts : Contacts
    apart : (n_contacts,) array [m]
        Relative movement of each contact point.
    turned : (n_blocks,) array [m]
        Rotation of each block times a length.
    together : float [m]
        Two blocks belong together where all their contact points move apart by less than this, and their rotations too:
        a single point cannot tell that blocks turn about it.
    """
    low = np.minimum(contacts.block_a, contacts.block_b)
    high = np.maximum(contacts.block_a, contacts.block_b)
    pair, which = np.unique(low.astype(np.int64) * n_blocks + high, return_inverse=True)
    most = np.zeros(len(pair))
    np.maximum.at(most, which.ravel(), apart)
    a, b = pair // n_blocks, pair % n_blocks
    stay = (most < together) & (np.abs(turned[a] - turned[b]) < together)
    links = sp.coo_array((np.ones(np.count_nonzero(stay)), (a[stay], b[stay])), shape=(n_blocks, n_blocks))
    return connected_components(links, directed=False)[1]
