"""Overlaps in space: pairs of blocks and their depths."""

from __future__ import annotations

import numpy as np

from .broad_phase import box_pairs
from .convex_parts import PlacedParts
from .entering import PARALLEL
from .separations import edge_separations, face_separations


def overlap_depths_in_space(placed: PlacedParts, tolerance: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Pairs of blocks that overlap by more than a tolerance, and by how much.

    Parameters
    ----------
    tolerance : float [m]

    Returns
    -------
    i, j : (n_pairs,) int arrays
        Blocks, the lower number first.
    depth : (n_pairs,) array [m]
        Smallest movement that separates their deepest two parts.

    Notes
    -----
    Convex parts are separated by a face of one of them or by two edges across each other: the largest separation of
    these, negative, is the depth.
    """
    block_of_part = placed.parts.block_of_part
    i, j = box_pairs(placed.vertices, placed.solids.offsets, -tolerance)
    other = block_of_part[i] != block_of_part[j]
    i, j = i[other], j[other]
    none = np.zeros(len(placed.solids.block_of_face), dtype=bool)
    apart, _, _ = face_separations(placed, i, j, none)
    deep = np.flatnonzero(apart < -tolerance)
    i, j, apart = i[deep], j[deep], apart[deep]
    apart = np.maximum(apart, face_separations(placed, j, i, none)[0])
    deep = np.flatnonzero(apart < -tolerance)
    i, j, apart = i[deep], j[deep], apart[deep]
    apart = np.maximum(apart, edge_separations(placed, i, j, PARALLEL)[0])
    deep = apart < -tolerance
    blocks = np.sort(np.stack([block_of_part[i[deep]], block_of_part[j[deep]]], axis=1), axis=1)
    pairs, pair_of = np.unique(blocks, axis=0, return_inverse=True)
    depth = np.zeros(len(pairs))
    np.maximum.at(depth, pair_of.ravel(), -apart[deep])
    return pairs[:, 0], pairs[:, 1], depth
