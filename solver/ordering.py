"""Orders of blocks, or of rows, in which those that are joined are near each other: matrices have narrow bands then."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import reverse_cuthill_mckee

#: Inclinations of the lines along which places are put in order, as bricks above each other move to either side.
TILTS = (0.01, 0.1)

#: Times that each row moves to the middle of those it is joined to; more bring little.
PASSES = 5

#: Rows of a part that is cut no further.
WHOLE = 20


def narrowest(joined: sp.csr_array, places: np.ndarray | None) -> tuple[np.ndarray, int]:
    """Order the rows of a symmetric pattern, (m, m) with its diagonal: (m,) int array, and the width of the band.

    With places, (m, d), orders along each axis are tried beside that of Cuthill & McKee: those of walls are two thirds
    as wide, those of domes half.
    """
    row, starts = np.repeat(np.arange(joined.shape[0]), np.diff(joined.indptr)), joined.indptr[:-1]
    orders, best = [reverse_cuthill_mckee(sp.csr_matrix(joined), symmetric_mode=True)], (joined.shape[0] + 1, starts)
    orders += [np.argsort(values, kind="stable") for values in _along(places)]
    for order in orders:
        for _ in range(PASSES + 1):
            position = np.argsort(order)
            of_joined = position[joined.indices]
            best = min(best, (int(np.abs(position[row] - of_joined).max(initial=0)) + 1, order), key=lambda one: one[0])
            ends = np.minimum.reduceat(of_joined, starts) + np.maximum.reduceat(of_joined, starts)
            order = np.argsort(ends, kind="stable")
    return best[1], best[0]


def _along(places: np.ndarray | None) -> list[np.ndarray]:
    """Values (m,) that put places in order, along each axis and a little across it."""
    if places is None:
        return []
    return [
        places[:, axis] + tilt * np.delete(places, axis, axis=1).sum(axis=1)
        for axis in range(places.shape[1])
        for tilt in TILTS
    ]


def dissected(joined: sp.csr_array, places: np.ndarray | None) -> list[tuple[np.ndarray, int]]:
    """Cut what is joined into parts, until they are small, by the fewest rows near the middle of an order.

    Gives the rows, (m,) int, of each part or cut and the cut around it, -1 for the last; parts come before what cuts
    them. Nested dissection, George (1973), https://doi.org/10.1137/0710032.
    """
    orders = [np.argsort(reverse_cuthill_mckee(sp.csr_matrix(joined), symmetric_mode=True)).astype(float)]
    return _cut(joined, np.array([*orders, *_along(places)]), np.arange(joined.shape[0]))


def _cut(joined: sp.csr_array, orders: np.ndarray, rows: np.ndarray) -> list[tuple[np.ndarray, int]]:
    """Parts of some rows, by the values (k, m) that put them in order, as those of ``dissected``."""
    if len(rows) <= WHOLE:
        return [(rows, -1)]
    between, n = joined[rows][:, rows], len(rows)
    middle = np.arange(n // 3, 2 * n // 3 + 1)
    found = []
    for values in orders[:, rows]:
        position = np.argsort(np.argsort(values, kind="stable"))
        last = np.maximum.reduceat(position[between.indices], between.indptr[:-1])
        across = np.cumsum(np.bincount(position + 1, minlength=n + 2) - np.bincount(last + 1, minlength=n + 2))
        at = middle[np.argmin(across[middle] + np.abs(middle - n / 2) / WHOLE)]
        found.append((int(across[at]), position < at, (position < at) & (last >= at)))
    _, before, cut = min(found, key=lambda one: one[0])
    # In order along the cut, where parts meet it in few runs.
    along = orders[np.argmax(np.ptp(orders[1:, rows[cut]], axis=1)) + 1] if len(orders) > 1 and cut.any() else orders[0]
    own = rows[cut][np.argsort(along[rows[cut]], kind="stable")]
    parts: list[tuple[np.ndarray, int]] = []
    for some in (before & ~cut, ~before):
        parts += [(blocks, into + len(parts) if into >= 0 else -1) for blocks, into in _cut(joined, orders, rows[some])]
    return [*((blocks, into if into >= 0 else len(parts)) for blocks, into in parts), (own, -1)]
