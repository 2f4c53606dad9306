"""Convex shapes that a movement has put into each other, and the features that would have kept them apart."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from .broad_phase import expand_ranges
from .portions import alike
from .solids import cross, dot

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
    edges_of : (n + 1,) int array
    """

    before: Place
    after: Place
    offsets: np.ndarray
    faces_of: np.ndarray
    edges: np.ndarray
    edges_of: np.ndarray


class Entered(NamedTuple):
    """What would have kept shapes apart.

    Attributes
    ----------
    corner, face : (n,) int arrays
        Corners that are to stay before faces.
    own, other : (m,) int arrays
        Numbers of edges that are to stay before each other, the first of the shape with the lower number.
    """

    corner: np.ndarray
    face: np.ndarray
    own: np.ndarray
    other: np.ndarray


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
    crossed = kinds[2][best == 2]
    return Entered(np.concatenate(corners), np.concatenate(faces), crossed.first, crossed.second)


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
    """Give the axes across an edge of shapes i and an edge of shapes j; those are scored whose edges are foremost."""
    edges, edges_of, offsets = movement.edges, movement.edges_of, movement.offsets
    n_own, n_other, n_i, n_j = (np.diff(of)[k] for of in (edges_of, offsets) for k in (i, j))
    start, after, apart = np.full((3, len(i)), -np.inf)
    first, second = np.zeros((2, len(i)), dtype=np.int64)
    for k in alike(n_own * n_other, n_i + n_j, n_own, n_i):
        own = edges_of[i[k]][:, None] + np.arange(n_own[k[0]])
        other = edges_of[j[k]][:, None] + np.arange(n_other[k[0]])
        own, other = np.repeat(own, n_other[k[0]], axis=1), np.tile(other, (1, n_own[k[0]]))
        corners = [offsets[of[k]][:, None] + np.arange(n[k[0]]) for of, n in ((i, n_i), (j, n_j))]
        if own.size == 0:
            continue
        gaps, foremost = _across(movement.before, edges, own, other, corners)
        gaps_after, _ = _across(movement.after, edges, own, other, corners)
        along = gaps[0] >= gaps[1]
        before, same = np.where(along, *gaps), np.where(along, *gaps_after)
        scores = np.where(np.where(along, *foremost), _score(before, same), -np.inf)
        best, row = scores.argmax(axis=1), np.arange(len(k))
        scored = np.isfinite(scores[row, best])
        start[k], after[k] = (np.where(scored, gap[row, best], -np.inf) for gap in (before, same))
        first[k], second[k], apart[k] = own[row, best], other[row, best], gaps_after.max(axis=(0, 2))
    return _Axes(first, second, start, after, apart)


def _across(
    place: Place, edges: np.ndarray, own: np.ndarray, other: np.ndarray, corners: list[np.ndarray]
) -> tuple[np.ndarray, np.ndarray]:
    """Separate shapes along normals to two edges.

    Returns
    -------
    gaps : (2, n_pairs, n_axes) array [m]
        Separation with the first shape farther along the normal, and with the second.
    foremost : (2, n_pairs, n_axes) bool array
        Whether both edges would be the first to meet.
    """
    origin = place.corners[corners[0][:, :1]]
    starts = [place.corners[edges[of, 0]] - origin for of in (own, other)]
    along = [place.corners[edges[of, 1]] - place.corners[edges[of, 0]] for of in (own, other)]
    normal = cross(*along)
    lengths = [np.sqrt(dot(a, a)) for a in along]
    size = np.sqrt(dot(normal, normal))
    normal = normal / np.maximum(size, 1e-300)[..., None]
    heights = [normal @ (place.corners[of] - origin).transpose(0, 2, 1) for of in corners]
    (low_i, low_j), (high_i, high_j) = ([h.min(axis=2) for h in heights], [h.max(axis=2) for h in heights])
    gaps = np.stack([low_i - high_j, low_j - high_i])
    at_i, at_j = (dot(normal, start) for start in starts)
    behind = np.stack([np.maximum(at_i - low_i, high_j - at_j), np.maximum(high_i - at_i, at_j - low_j)])
    gaps = np.where(size > PARALLEL * lengths[0] * lengths[1], gaps, -np.inf)
    return gaps, behind <= FOREMOST * np.minimum(*lengths)
