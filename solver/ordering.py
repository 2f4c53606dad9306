"""Orders of blocks, or of rows, in which those that are joined are near each other: matrices have narrow bands then."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import reverse_cuthill_mckee

#: Inclinations of the lines along which places are put in order, as bricks above each other move to either side.
TILTS = (0.01, 0.1)

#: Times that each row moves to the middle of those it is joined to; more bring little.
PASSES = 5


def narrowest(joined: sp.csr_array, places: np.ndarray | None) -> tuple[np.ndarray, int]:
    """Choose an order of rows.

    Parameters
    ----------
    joined : (m, m) sparse array, by rows
        Its pattern, which is symmetric and has its diagonal.
    places : (m, d) array, optional
        Orders along each axis are tried beside that of Cuthill & McKee: those of walls are two thirds as wide, those of
        domes half.

    Returns
    -------
    (m,) int array
        The rows in their order.
    int
        Width of the band.
    """
    row, starts = np.repeat(np.arange(joined.shape[0]), np.diff(joined.indptr)), joined.indptr[:-1]
    orders, best = [reverse_cuthill_mckee(sp.csr_matrix(joined), symmetric_mode=True)], (joined.shape[0] + 1, starts)
    places = np.empty((len(starts), 0)) if places is None else places
    for axis in range(places.shape[1]):
        across = np.delete(places, axis, axis=1).sum(axis=1)
        orders += [np.argsort(places[:, axis] + tilt * across, kind="stable") for tilt in TILTS]
    for order in orders:
        for _ in range(PASSES + 1):
            position = positions_in(order)
            of_joined = position[joined.indices]
            best = min(best, (int(np.abs(position[row] - of_joined).max(initial=0)) + 1, order), key=lambda one: one[0])
            ends = np.minimum.reduceat(of_joined, starts) + np.maximum.reduceat(of_joined, starts)
            order = np.argsort(ends, kind="stable")
    return best[1], best[0]


def positions_in(order: np.ndarray) -> np.ndarray:
    """(m,) int array: where in an order each row comes."""
    position = np.empty(len(order), dtype=np.int64)
    position[order] = np.arange(len(order))
    return position
