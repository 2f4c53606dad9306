"""Features of contact points in space: what names them, and what they are measured by."""

from __future__ import annotations

import numpy as np

#: Kinds of contact in space, column 0 of the features. A corner on a face: the vertex (of ``block_a``), the face (of
#: ``block_b``), and -1, or where the vertex is on the boundary of the face the edge there and the edge of ``block_a``
#: that crosses it. A corner on a corner: both corners, each a vertex and a face, -1. An edge across an edge: both, each
#: named by the corner it starts at, and where along them.
#: A corner before a plane across an edge, both named, is a contact point of one movement.
ON_FACE, ON_CORNER, ACROSS, BEFORE_EDGE = 0, 1, 2, 3

#: Places along edges are kept as multiples of this part of them, which is far below what a geometry is exact to.
GRAIN = 2.0**-29


def feature_rows(kind: int, first: np.ndarray, second: np.ndarray, rest: np.ndarray | int) -> np.ndarray:
    """(n, 4) int array: features of one kind."""
    return np.stack(np.broadcast_arrays(kind, first, second, rest), axis=1)


def places_of(along_a: np.ndarray, along_b: np.ndarray, parallel: np.ndarray | bool = False) -> np.ndarray:
    """(n,) int array that holds two fractions of edges and whether these are nearly parallel."""
    a, b = (np.clip(np.round(along / GRAIN), 0, 1 / GRAIN).astype(np.int64) for along in (along_a, along_b))
    return ((a << 30 | b) << 1) | parallel


def read_places(places: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Fractions along both edges and whether they are nearly parallel, from :func:`places_of`."""
    both = places >> 1
    return (both >> 30) * GRAIN, (both & ((1 << 30) - 1)) * GRAIN, (places & 1).astype(bool)
