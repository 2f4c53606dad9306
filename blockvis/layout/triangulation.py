"""Outlines cut into triangles, for files and pictures that know nothing else."""

from __future__ import annotations

import numpy as np


def cells_of_ring(ring: np.ndarray) -> list[tuple[int, ...]]:
    """Cover a counter-clockwise ring with cells: the ring itself if it has three corners or four convex ones."""
    n, u, v = len(ring), ring - np.roll(ring, 1, axis=0), np.roll(ring, -1, axis=0) - ring
    if n == 3 or (n == 4 and (u[:, 0] * v[:, 1] > u[:, 1] * v[:, 0]).all()):
        return [tuple(range(n))]
    return [tuple(triangle) for triangle in triangles_of_ring(ring).tolist()]


def triangles_of_ring(ring: np.ndarray) -> np.ndarray:
    """(n - 2, 3) int array: triangles that fill a simple (n, 2) ring, and turn as it does."""
    from manifold3d import triangulate

    about = ring - ring[0]
    x, y = about.T
    turns_left = x @ np.roll(y, -1) >= y @ np.roll(x, -1)
    # The fast way through convex outlines leaves more slivers.
    return np.asarray(triangulate([about if turns_left else about * [1.0, -1.0]], allow_convex=False))
