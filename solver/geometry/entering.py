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

#: Edges nearer to parallel than this sine have no common normal by rounding.
PARALLEL = 1e-6

#: An edge is foremost along a normal where no corner is farther by more than this part of its length.
FOREMOST = 1e-6


class Place(NamedTuple):
    """Corners, and the planes of faces, in the plane lines of edges, at one geometry.

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
    offsets, faces_of : (n + 1,) int arrays
        Shape i owns corners and faces from entry i to entry i + 1.
    edges : (n_edges, 2) int array
        Corners at the ends of each edge, once; in the plane none.
    edge_faces : (n_edges, 2) int array
        The faces at each edge.
    edges_of : (n + 1,) int array
    """

    before: Place
    after: Place
    offsets: np.ndarray
    faces_of: np.ndarray
    edges: np.ndarray
    edge_faces: np.ndarray
    edges_of: np.ndarray


class Entered(NamedTuple):
    """What would have kept shapes apart.

    Attributes
    ----------
    corner, face : (n,) int arrays
        Corners that are to stay before faces.
    own, other : (m,) int arrays
        Numbers of edges that are to stay before each other, the first of the shape with the lower number.
    edge : (k,) int array
        The number of the two edges, among these,
    at_edge : (k,) int array
        and corners of the first shape that have come behind the plane across them, which rides on the second.
    """

    corner: np.ndarray
    face: np.ndarray
    own: np.ndarray
    other: np.ndarray
    edge: np.ndarray
    at_edge: np.ndarray


@dataclass(frozen=True)
class _Axes:
    """The best axis of one kind for each pair of shapes.

    Attributes
    ----------
    first, second : (n,) int arrays
        The face, or the two edges.
    before, after : (n,) array [m]
        Separation along it before and after the movement.
    apart : (n,) array [m]
        Largest separation after the movement along any axis of this kind.
    """

    first: np.ndarray
    second: np.ndarray
    before: np.ndarray
    after: np.ndarray
    apart: np.ndarray

    @property
    def score(self) -> np.ndarray:
        """(n,) array [m]: the better axis has more of it."""
        return _score(self.before, self.after)

    def __getitem__(self, chosen: np.ndarray) -> _Axes:
        return _Axes(*(value[chosen] for value in vars(self).values()))


def entered(movement: Movement, i: np.ndarray, j: np.ndarray, tolerance: float, deepest: np.ndarray) -> Entered:
    """Find shapes that overlap by more than a tolerance [m] after a movement, and what would keep them apart.

    Parameters
    ----------
    movement : Movement
    i, j : (n_pairs,) int arrays
        Shapes that are near each other.
    tolerance : float
    deepest : (n_pairs,) array [m]
        Overlap before the movement beyond which an axis is none of a contact.

    Notes
    -----
    Convex shapes are apart where a face of one or two edges across each other separate them. Of these axes the one is
    chosen along which they are least in each other after the movement, among those that separated them before it.
    """
    kinds: list[_Axes] = []
    for of in (_of_faces, lambda m, one, two: _of_faces(m, two, one), _of_edges):
        axes = of(movement, i, j)
        deep = axes.apart < -tolerance
        i, j, deepest = i[deep], j[deep], deepest[deep]
        kinds = [kind[deep] for kind in [*kinds, axes]]
    best = np.argmax([kind.score for kind in kinds], axis=0)
    best[np.choose(best, [kind.before for kind in kinds]) < -deepest] = len(kinds)
    corners, faces = [], []
    for number, others in ((0, j), (1, i)):
        k = np.flatnonzero(best == number)
        axes = kinds[number][k]
        owner, position = expand_ranges(np.diff(movement.offsets)[others[k]])
        corner, face = movement.offsets[others[k]][owner] + position, axes.first[owner]
        after = movement.after
        height = ((after.corners[corner] - after.points[face]) * after.normals[face]).sum(axis=1)
        # Beside the deepest those nearly as deep, about which it would turn.
        chosen = height < 0.5 * axes.after[owner]
        corners.append(corner[chosen])
        faces.append(face[chosen])
    k = np.flatnonzero(best == 2)
    own, other, depth = kinds[2].first[k], kinds[2].second[k], kinds[2].after[k]
    ridden = carried(movement, across(movement, movement.before, own, other), other)
    owner, position = expand_ranges(np.diff(movement.offsets)[i[k]])
    corner, on_plane = movement.offsets[i[k]][owner] + position, movement.edges[other[owner], 0]
    height = dot(movement.after.corners[corner] - movement.after.corners[on_plane], ridden[owner])
    chosen = height < 0.5 * depth[owner]
    return Entered(np.concatenate(corners), np.concatenate(faces), own, other, owner[chosen], corner[chosen])


def _score(before: np.ndarray, after: np.ndarray) -> np.ndarray:
    return after + BEFORE * np.minimum(before, 0.0)


def _of_faces(movement: Movement, i: np.ndarray, j: np.ndarray) -> _Axes:
    """Give the axes along the normals of faces of shapes i, of which shapes j are in front."""
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
        scores = _score(*gaps)
        best, row = scores.argmax(axis=1), np.arange(len(k))
        first[k], before[k], after[k] = face[row, best], gaps[0][row, best], gaps[1][row, best]
        apart[k] = gaps[1].max(axis=1)
    return _Axes(first, first, before, after, apart)


def _of_edges(movement: Movement, i: np.ndarray, j: np.ndarray) -> _Axes:
    """Give the axes across an edge of shapes i and an edge of shapes j, those of planes that ride on shapes j."""
    edges_of, offsets = movement.edges_of, movement.offsets
    n_own, n_other, n_i, n_j = (np.diff(of)[k] for of in (edges_of, offsets) for k in (i, j))
    before, after, apart = np.full((3, len(i)), -np.inf)
    first, second = np.zeros((2, len(i)), dtype=np.int64)
    for k in alike(n_own * n_other, n_i + n_j, n_own, n_i):
        own = edges_of[i[k]][:, None] + np.arange(n_own[k[0]])
        other = edges_of[j[k]][:, None] + np.arange(n_other[k[0]])
        own, other = np.repeat(own, n_other[k[0]], axis=1), np.tile(other, (1, n_own[k[0]]))
        corners = [offsets[of[k]][:, None] + np.arange(n[k[0]]) for of, n in ((i, n_i), (j, n_j))]
        if own.size == 0:
            continue
        normals = across(movement, movement.before, own, other)
        gaps, foremost = _gaps(movement, movement.before, normals, own, other, corners)
        apart[k] = _gaps(movement, movement.after, across(movement, movement.after, own, other), own, other, corners)[0].max(axis=1)
        ridden = carried(movement, normals, other)
        then = _gaps(movement, movement.after, ridden, own, other, corners)[0]
        scores = np.where(foremost, _score(gaps, then), -np.inf)
        best, row = scores.argmax(axis=1), np.arange(len(k))
        scored = np.isfinite(scores[row, best])
        before[k], after[k] = (np.where(scored, gap[row, best], -np.inf) for gap in (gaps, then))
        first[k], second[k] = own[row, best], other[row, best]
    return _Axes(first, second, before, after, apart)


def across(movement: Movement, place: Place, own: np.ndarray, other: np.ndarray) -> np.ndarray:
    """(..., 3) array: unit normals to two edges, out of the second shape; zero where they are parallel."""
    edges, faces = movement.edges, movement.edge_faces
    along = [place.corners[edges[of, 1]] - place.corners[edges[of, 0]] for of in (own, other)]
    normal = cross(*along)
    size = np.sqrt(dot(normal, normal))
    outward = dot(normal, place.normals[faces[other, 0]] + place.normals[faces[other, 1]])
    scale = np.where(size > PARALLEL * np.sqrt(dot(along[0], along[0]) * dot(along[1], along[1])), np.sign(outward), 0.0)
    return normal * (scale / np.maximum(size, 1e-300))[..., None]


def carried(movement: Movement, normals: np.ndarray, other: np.ndarray) -> np.ndarray:
    """(..., 3) array: directions that ride on the shapes of edges, after the movement."""
    axes = []
    for place in (movement.before, movement.after):
        along = unit(place.corners[movement.edges[other, 1]] - place.corners[movement.edges[other, 0]])
        normal = place.normals[movement.edge_faces[other, 0]]
        axes.append((along, normal, cross(along, normal)))
    return sum(dot(normals, old)[..., None] * new for old, new in zip(*axes, strict=True))


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
    starts = [place.corners[movement.edges[of, 0]] - origin for of in (own, other)]
    at_i, at_j = (dot(normals, start) for start in starts)
    low = (normals @ (place.corners[corners[0]] - origin).transpose(0, 2, 1)).min(axis=2)
    high = (normals @ (place.corners[corners[1]] - origin).transpose(0, 2, 1)).max(axis=2)
    along = place.corners[movement.edges[own, 1]] - place.corners[movement.edges[own, 0]]
    foremost = np.maximum(at_i - low, high - at_j) <= FOREMOST * np.sqrt(dot(along, along))
    return np.where(dot(normals, normals) > 0.5, low - high, -np.inf), foremost
