"""Closed surfaces as drawings have them, made clean: corners that coincide are one, and faces are seen from outside."""

from __future__ import annotations

import numpy as np

from solver.mechanics import linked

from .linked import within_reach
from .outlines import ROUNDING
from .solids import Solid, outward, size_of


def cleaned(points: np.ndarray, faces: list[list[int]]) -> Solid:
    """Weld the corners of a block, and turn its faces counter-clockwise seen from outside, as the solver takes it.

    Corners of no face and faces without an area go. What is not closed stays so, for the solver to refuse.

    Examples
    --------
    >>> corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    >>> cleaned(corners, [[0, 1, 2], [0, 1, 3], [1, 3, 2], [0, 2, 3]])[1]
    [[2, 1, 0], [0, 1, 3], [2, 3, 1], [3, 2, 0]]
    """
    same = same_points(points, ROUNDING * size_of(points)).tolist()
    rings = [[same[corner] for k, corner in enumerate(face) if same[corner] != same[face[k - 1]]] for face in faces]
    rings = [ring for ring in rings if len(ring) > 2]
    used = sorted({corner for ring in rings for corner in ring})
    if not used:
        return points, faces
    if len(used) < len(points):
        place = {corner: k for k, corner in enumerate(used)}
        points, rings = points[used], [[place[corner] for corner in ring] for ring in rings]
    return outward(points, rings if is_closed(rings) else _turned_alike(rings, len(points)))


def _turned_alike(rings: list[list[int]], n_points: int) -> list[list[int]]:
    """Turn faces so that neighbours are seen from one side, where each edge is that of two."""
    edges = np.array(_edges_of(rings))
    face = np.repeat(np.arange(len(rings)), [len(ring) for ring in rings])
    low, high = np.sort(edges, axis=1).T
    edge, counts = np.unique(low * np.int64(n_points) + high, return_inverse=True, return_counts=True)[1:]
    if (counts != 2).any():
        return rings
    turned = turned_faces(edges, edge.ravel(), face)
    return [ring[::-1] if turned[k] else ring for k, ring in enumerate(rings)]


def is_closed(faces: list[list[int]]) -> bool:
    """Whether faces run through each of their edges once in each sense."""
    edges = _edges_of(faces)
    return len(set(edges)) == len(edges) and {(b, a) for a, b in edges} <= set(edges)


def _edges_of(faces: list[list[int]]) -> list[tuple[int, int]]:
    return [(ring[k - 1], ring[k]) for ring in faces for k in range(len(ring))]


def same_points(points: np.ndarray, near: float) -> np.ndarray:
    """(n,) int array: the point that stands for each, the same for those nearer to each other than ``near``."""
    # Exact copies first: a million of them would make a million squared pairs.
    unique, index, inverse = np.unique(points, axis=0, return_index=True, return_inverse=True)
    label = within_reach(unique, near)
    return np.asarray(index[np.unique(label, return_index=True)[1]][label][inverse.ravel()])


def turned_faces(edges: np.ndarray, edge: np.ndarray, face: np.ndarray) -> np.ndarray:
    """(m,) bool array: the faces to turn round so that neighbours run the opposite ways along their edge.

    ``edges`` are the first and last corners, (n, 2) ints, of the edges of all faces, one face after another; ``edge``
    says which each is, whatever its sense, and is that of two faces; ``face`` are ascending numbers of faces.

    Each face is there twice, as it is and turned round, and goes with the one of each neighbour that fits: of a surface
    that encloses something there are two sets, and the one with its first face as it is is taken.
    """
    m = int(face[-1]) + 1
    first, second = edge.argsort(kind="stable").reshape(-1, 2).T
    forward = edges[:, 0] < edges[:, 1]
    fits = forward[first] != forward[second]
    one, other = face[first], face[second]
    label = linked((np.append(one, one + m), np.append(other + m * ~fits, other + m * fits)), 2 * m)
    return np.asarray(label[:m] > label[m:])
