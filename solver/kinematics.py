"""Pose: where the blocks are; moved corners; the exact rigid update."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .assembly import Assembly

__all__ = ["Pose", "moved", "moved_vertices", "rotation_matrices"]


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
