"""Broad phase: pairs of near boxes by sort and sweep."""

from __future__ import annotations

import numpy as np


def expand_ranges(counts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """For counts (3, 0, 2): owners (0, 0, 0, 2, 2) and positions within each owner (0, 1, 2, 0, 1)."""
    owner = np.repeat(np.arange(len(counts)), counts)
    first = np.cumsum(counts) - counts
    return owner, np.arange(len(owner)) - first[owner]


def box_pairs(vertices: np.ndarray, offsets: np.ndarray, reach: float | np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(n_pairs,) int arrays: pairs i < j of polygons or solids whose boxes come within reach [m] along every axis.

    A negative reach is for boxes that overlap by as much. Sort and sweep along the axis on which fewer pairs survive:
    one long block (the ground) costs n pairs, not n².
    """
    low, high = boxes(vertices, offsets)
    ranges = list(zip((low - reach / 2.0).T.copy(), (high + reach / 2.0).T.copy(), strict=True))
    sweeps = []
    for axis, (low, high) in enumerate(ranges):
        order = np.argsort(low, kind="stable")
        ends = np.searchsorted(low[order], high[order], side="right")
        sweeps.append((order, np.maximum(ends - np.arange(1, len(order) + 1), 0), axis))
    order, counts, swept = min(sweeps, key=lambda sweep: int(sweep[1].sum()))
    owner, position = expand_ranges(counts)
    i, j = order[owner], order[owner + 1 + position]
    # The axis of the sweep, along which few are left out, comes last.
    for low, high in ranges[swept + 1 :] + ranges[: swept + 1]:
        touching = (low[i] <= high[j]) & (low[j] <= high[i])
        i, j = i[touching], j[touching]
    return np.minimum(i, j), np.maximum(i, j)


def boxes(vertices: np.ndarray, offsets: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Lowest and highest coordinates of each polygon or solid, two (n, d) arrays."""
    return np.minimum.reduceat(vertices, offsets[:-1]), np.maximum.reduceat(vertices, offsets[:-1])
