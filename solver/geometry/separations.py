"""Separations of convex parts by a face, or by two edges across each other."""

from __future__ import annotations

import numpy as np

from .convex_parts import PlacedParts
from .portions import alike
from .solids import cross, dot, unit

#: Edges nearer to parallel than this sine have no common normal: they are clipped against each other.
SMALLEST_SINE = 0.05


def face_separations(
    placed: PlacedParts, i: np.ndarray, j: np.ndarray, inner: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """How far, (n,) [m], convex parts j are before a face of parts i, the farthest; and that face, (n,) int.

    And how far before one inside the block, by ``inner``, (n_faces,) bool: minus infinity where there is none.
    """
    solids = placed.solids
    apart, behind, leading = np.empty(len(i)), np.empty(len(i)), np.empty(len(i), dtype=np.int64)
    for k, face, vertex in alike((solids.faces_of_block, i), (solids.offsets, j)):
        distance = placed.before_faces(face, vertex)
        behind[k] = np.where(inner[face], distance, -np.inf).max(axis=1)
        distance = np.where(inner[face], -np.inf, distance)
        farthest = distance.argmax(axis=1)
        row = np.arange(len(k))
        apart[k], leading[k] = distance[row, farthest], face[row, farthest]
    return apart, leading, behind


def edge_separations(
    placed: PlacedParts, i: np.ndarray, j: np.ndarray, smallest_sine: float = SMALLEST_SINE
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Largest separations of convex parts i and j, (n,) int arrays, by an edge of each, and these edges, (n,) int.

    Along the cross product, (n,) [m], of edges with at least the sine between them, on the two sides of which both
    parts lie; minus infinity where there are none.
    """
    solids, normals = placed.solids, placed.faces.normals
    once, first = solids.whole_edges
    apart = np.full(len(i), -np.inf)
    edge_i, edge_j = np.zeros((2, len(i)), dtype=np.int64)
    for k, own, other in alike((first, i), (first, j)):
        own, other = once[own], once[other]
        a, b = placed.starts(own), placed.starts(other)
        along_a, along_b = unit(placed.along(own)), unit(placed.along(other))
        normal = cross(along_a[:, :, None], along_b[:, None])
        separates = dot(normal, normal) > smallest_sine**2
        sides = placed.outward(other)[:, None] - placed.outward(own)[:, :, None]
        sense = np.sign(dot(normal, sides))
        normal, separates = unit(normal) * sense[..., None], separates & (sense != 0.0)
        for edges, along, side, axis in ((own, along_a, 1.0, 2), (other, along_b, -1.0, 1)):
            for of_face, sense in ((edges, 1.0), (solids.twins[edges], -1.0)):
                inward = sense * cross(normals[solids.face_of_corner[of_face]], along)
                separates &= side * dot(np.expand_dims(inward, axis), normal) >= -1e-6
        distance = np.where(separates, dot(a[:, :, None] - b[:, None], normal), -np.inf).reshape(len(k), -1)
        farthest = distance.argmax(axis=1)
        row = np.arange(len(k))
        apart[k] = distance[row, farthest]
        edge_i[k], edge_j[k] = own[row, farthest // other.shape[1]], other[row, farthest % other.shape[1]]
    return apart, edge_i, edge_j
