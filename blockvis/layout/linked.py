"""What hangs together: the groups that links between numbered things make."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from solver.mechanics import linked


def middles(points: np.ndarray, group: np.ndarray) -> np.ndarray:
    """(n_groups, d) array: the mean of the (n, d) points of each group."""
    count = np.maximum(np.bincount(group), 1)
    return np.stack([np.bincount(group, column) / count for column in points.T], axis=1)


def within_reach(points: np.ndarray, near: float) -> np.ndarray:
    """(n,) int array: the group of each of (n, d) points, of which those up to ``near`` apart are linked."""
    one, other = cKDTree(points).query_pairs(near, output_type="ndarray").reshape(-1, 2).T
    return linked((one, other), len(points))


def equal_rows(rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Numbers of rows of a table that are equal, (n,) int each: of several each with the next."""
    order = np.lexsort(rows.T[::-1])
    same = (rows[order][1:] == rows[order][:-1]).all(axis=1)
    return order[:-1][same], order[1:][same]
