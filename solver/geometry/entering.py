"""Convex shapes that a movement has put into each other, and the features that would have kept them apart."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from .broad_phase import expand_ranges
from .portions import alike
from .solids import cross, dot, unit

#: How much an overlap before the movement, along an axis, counts against one after it.
BEFORE = 10.0

#: Edges nearer to parallel than this sine have no common normal, by rounding.
PARALLEL = 1e-6

#: An edge is foremost along a normal where no corner is farther by more than this part of its length.
FOREMOST = 1e-6

#: With the corner that is farthest behind a plane those that are so far by this part of it: about one it would turn.
AS_DEEP = 0.5


class Place(NamedTuple):
    """Corners, and the planes of faces, in the plane the lines of edges, at one geometry.

    Attributes
    ----------
    corners : (n_corners, d) array [m]
    normals, points : (n_faces, d) arrays
        Outward unit normals, and a point [m] of each.
    """

    corners: np.ndarray
    normals: np.ndarray
    points: np.ndarray


@dataclass(frozen=True)
class Movement:
    """Shapes before and after a movement.

    Attributes
    ----------
    before, after : Place
    offsets, faces_of, edges_of : (n + 1,) int arrays
        Shape i owns corners, faces and edges from entry i to entry i + 1.
    edges : (n_edges, 2) int array
        Corners at the ends of each edge, in space, where two of them may keep shapes apart.
    edge_faces : (n_edges, 2) int array
        The faces at each edge.
    """

    before: Place
    after: Place
    offsets: np.ndarray
    faces_of: np.ndarray
    edges_of: np.ndarray
    edges: np.ndarray
    edge_faces: np.ndarray


class Entered(NamedTuple):
    """What would have kept shapes apart.

    Attributes
    ----------
    corner, face : (n,) int arrays
        Corners that are to stay before faces.
    own, other : (m,) int arrays
        Edges that are to stay before each other, the first of the first shape.
    at_edges, edge_corner : (k,) int arrays
        Numbers of such edges, and corners of the first shape that have come behind the plane across them.
    """

    corner: np.ndarray
    face: np.ndarray
    own: np.ndarray
    other: np.ndarray
    at_edges: np.ndarray
    edge_corner: np.ndarray


@dataclass(frozen=True)
class _Axes:
    """The best axis of one kind for each pair of shapes.

    Attributes
    ----------
    first, second : (n,) int arrays
        The face, or the two edges.
    before, after : (n,) array [m]
        Separation along it; after the movement by its plane, which rides on one of the shapes.
    apart : (n,) array [m]
        Largest separation after the movement along any axis of this kind.
    """

    first: np.ndarray
    second: np.ndarray
    before: np.ndarray
    after: np.ndarray
    apart: np.ndarray

    def __getitem__(self, chosen: np.ndarray) -> _Axes:
        return _Axes(*(value[chosen] for value in vars(self).values()))


def entered(movement: Movement, i: np.ndarray, j: np.ndarray, tolerance: float, deepest: np.ndarray) -> Entered:
    """Find shapes that overlap by more than a tolerance [m] after a movement, and what would keep them apart.

    Parameters
    ----------
    movement : Movement
    i, j : (n_pairs,) int arrays
        Shapes that are near each other after it.
    tolerance : float
    deepest : (n_pairs,) array [m]
        Overlap before the movement beyond which an axis is none of a contact.

    Notes
    -----
    Convex shapes are apart where a face of one, or two edges across each other, separate them. Among the planes that
    separated them before, and ride on one of them, the one is taken behind which the other has come least. A movement
    in which no corner comes behind it cannot end in an overlap.
    """
    kinds: list[_Axes] = []
    for axes_of in (_of_faces, lambda m, one, other: _of_faces(m, other, one), _of_edges):
        axes = axes_of(movement, i, j)
        deep = axes.apart < -tolerance
        i, j, deepest = i[deep], j[deep], deepest[deep]
        kinds = [kind[deep] for kind in [*kinds, axes]]
    best = np.argmax([_score(kind.before, kind.after) for kind in kinds], axis=0)
    before = np.choose(best, [kind.before for kind in kinds])
    best = np.where(before < -deepest, len(kinds), best)
    corners, faces = [], []
    for number, others in ((0, j), (1, i)):
        k = np.flatnonzero(best == number)
        face, after = kinds[number].first[k], movement.after
        owner, corner = _behind(movement, others[k], after.points[face], after.normals[face], kinds[number].after[k])
        corners.append(corner)
        faces.append(face[owner])
    k = np.flatnonzero(best == 2)
    own, other = kinds[2].first[k], kinds[2].second[k]
    at_edges = edge_corner = k
    if len(k):
        normals = _ridden(movement, across(movement, movement.before, own, other), other)
        points = movement.after.corners[movement.edges[other, 0]]
        at_edges, edge_corner = _behind(movement, i[k], points, normals, kinds[2].after[k])
    return Entered(np.concatenate(corners), np.concatenate(faces), own, other, at_edges, edge_corner)


def across(movement: Movement, place: Place, own: np.ndarray, other: np.ndarray) -> np.ndarray:
    """(..., 3) array: unit normals to two edges, out of the shape of the other; zero where they are parallel."""
    along, along_other = (
        place.corners[movement.edges[k, 1]] - place.corners[movement.edges[k, 0]] for k in (own, other)
    )
    normal = cross(along, along_other)
    size, lengths = np.sqrt(dot(normal, normal)), np.sqrt(dot(along, along) * dot(along_other, along_other))
    faces = movement.edge_faces[other]
    sense = np.sign(dot(normal, place.normals[faces[..., 0]] + place.normals[faces[..., 1]]))
    return normal * (np.where(size > PARALLEL * lengths, sense, 0.0) / np.maximum(size, 1e-300))[..., None]


def _score(before: np.ndarray, after: np.ndarray) -> np.ndarray:
    return after + BEFORE * np.minimum(before, 0.0)


def _behind(
    movement: Movement, shape: np.ndarray, points: np.ndarray, normals: np.ndarray, depth: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Corners of shapes that have come behind planes, nearly as far as the deepest, and the plane of each."""
    owner, position = expand_ranges(np.diff(movement.offsets)[shape])
    corner = movement.offsets[shape][owner] + position
    height = ((movement.after.corners[corner] - points[owner]) * normals[owner]).sum(axis=1)
    chosen = height < AS_DEEP * depth[owner]
    return owner[chosen], corner[chosen]


def _of_faces(movement: Movement, i: np.ndarray, j: np.ndarray) -> _Axes:
    """Give the axes along normals of faces of shapes i, with shapes j before them."""
    n_faces, n_corners = np.diff(movement.faces_of)[i], np.diff(movement.offsets)[j]
    before, after, apart = np.empty((3, len(i)))
    first = np.empty(len(i), dtype=np.int64)
    for k in alike(n_faces, n_corners):
        face = movement.faces_of[i[k]][:, None] + np.arange(n_faces[k[0]])
        corner = movement.offsets[j[k]][:, None] + np.arange(n_corners[k[0]])
        gaps = []
        for place in (movement.before, movement.after):
            # From a corner near by, for the digits of coordinates far from the origin.
            origin = place.corners[corner[:, :1]]
            level = (place.normals[face] * (place.points[face] - origin)).sum(axis=2)
            heights = place.normals[face] @ (place.corners[corner] - origin).transpose(0, 2, 1)
            gaps.append(heights.min(axis=2) - level)
        best, row = _score(*gaps).argmax(axis=1), np.arange(len(k))
        first[k], before[k], after[k] = face[row, best], gaps[0][row, best], gaps[1][row, best]
        apart[k] = gaps[1].max(axis=1)
    return _Axes(first, first, before, after, apart)


def _of_edges(movement: Movement, i: np.ndarray, j: np.ndarray) -> _Axes:
    """Give the axes across an edge of shapes i and one of shapes j, on which their planes ride."""
    n_own, n_other = (np.diff(movement.edges_of)[k] for k in (i, j))
    n_i, n_j = (np.diff(movement.offsets)[k] for k in (i, j))
    before, after, apart = np.full((3, len(i)), -np.inf)
    first, second = np.zeros((2, len(i)), dtype=np.int64)
    for k in alike(n_own * n_other, n_i + n_j, n_own, n_i):
        own = movement.edges_of[i[k]][:, None] + np.arange(n_own[k[0]])
        other = movement.edges_of[j[k]][:, None] + np.arange(n_other[k[0]])
        own, other = np.repeat(own, other.shape[1], axis=1), np.tile(other, (1, own.shape[1]))
        if own.size == 0:
            continue
        corners = [movement.offsets[of[k]][:, None] + np.arange(n[k[0]]) for of, n in ((i, n_i), (j, n_j))]
        normals = across(movement, movement.before, own, other)
        gaps, foremost = _gaps(movement, movement.before, normals, own, other, corners)
        ridden, _ = _gaps(movement, movement.after, _ridden(movement, normals, other), own, other, corners)
        new, _ = _gaps(movement, movement.after, across(movement, movement.after, own, other), own, other, corners)
        best, row = np.where(foremost, _score(gaps, ridden), -np.inf).argmax(axis=1), np.arange(len(k))
        before[k] = np.where(foremost[row, best], gaps[row, best], -np.inf)
        first[k], second[k], after[k] = own[row, best], other[row, best], ridden[row, best]
        apart[k] = new.max(axis=1)
    return _Axes(first, second, before, after, apart)


def _ridden(movement: Movement, normals: np.ndarray, other: np.ndarray) -> np.ndarray:
    """(..., 3) array: normals that ride on the shapes of edges, after the movement."""
    after = np.zeros_like(normals)
    axes = [
        (unit(place.corners[movement.edges[other, 1]] - place.corners[movement.edges[other, 0]]),
         place.normals[movement.edge_faces[other, 0]])
        for place in (movement.before, movement.after)
    ]  # fmt: skip
    for old, new in zip(*((along, normal, cross(along, normal)) for along, normal in axes), strict=True):
        after += dot(normals, old)[..., None] * new
    return after


def _gaps(
    movement: Movement,
    place: Place,
    normals: np.ndarray,
    own: np.ndarray,
    other: np.ndarray,
    corners: list[np.ndarray],
) -> tuple[np.ndarray, np.ndarray]:
    """Separations of shapes along normals to two edges.

    Returns
    -------
    gaps : (n_pairs, n_axes) array [m]
        Minus infinity where there is no normal.
    foremost : (n_pairs, n_axes) bool array
        Whether both edges would be the first to meet.
    """
    origin = place.corners[corners[0][:, :1]]
    at_own, at_other = (dot(normals, place.corners[movement.edges[k, 0]] - origin) for k in (own, other))
    low = (normals @ (place.corners[corners[0]] - origin).transpose(0, 2, 1)).min(axis=2)
    high = (normals @ (place.corners[corners[1]] - origin).transpose(0, 2, 1)).max(axis=2)
    along = place.corners[movement.edges[own, 1]] - place.corners[movement.edges[own, 0]]
    is_normal = dot(normals, normals) > 0.5
    foremost = is_normal & (np.maximum(at_own - low, high - at_other) <= FOREMOST * np.sqrt(dot(along, along)))
    return np.where(is_normal, low - high, -np.inf), foremost
