"""Convex parts that a movement has put into each other, and the features that would have kept them apart."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .broad_phase import expand_ranges
from .convex_parts import PlacedParts
from .portions import alike, at_largest
from .solids import ROUNDING, cross, dot, unit

#: How much an overlap before the movement, along an axis, counts against one after it.
BEFORE = 10.0

#: With the corner that is farthest behind a plane those that are so far by this part of it: about one it would turn.
AS_DEEP = 0.5


#: Convex parts before and after a movement.
Movement = tuple[PlacedParts, PlacedParts]


class _Axes(NamedTuple):
    """The best axis of one kind for each of n pairs of parts: a face, or two edges."""

    first: np.ndarray
    second: np.ndarray
    before: np.ndarray  #: [m], separation along it
    after: np.ndarray  #: [m], after the movement by its plane, which rides on one of the parts


def entered(movement: Movement, i: np.ndarray, j: np.ndarray, deepest: np.ndarray) -> tuple[np.ndarray, ...]:
    """Find what would keep apart parts i and j, (n_pairs,) int arrays, that overlap after a movement.

    Overlaps before it beyond the ``deepest``, (n_pairs,) [m], are those of axes of no contact.

    Gives corners and the faces before which they are to stay, (n,) int; edges of parts i and of parts j that are to
    stay before each other, (m,) int; numbers of such edges and corners of parts i that have come behind the plane
    across them, (k,) int.

    Convex parts are apart where a face of one, or two edges across each other, separate them. Among the planes that
    separated them before, and ride on one of them, the one is taken behind which the other has come least. A movement
    in which no corner comes behind it cannot end in an overlap.
    """
    placed, placed_after = movement
    kinds = [_of_faces(movement, i, j), _of_faces(movement, j, i), _of_edges(movement, i, j)]
    best = np.argmax([_score(kind.before, kind.after) for kind in kinds], axis=0)
    before = np.choose(best, [kind.before for kind in kinds])
    best = np.where(before < -deepest, len(kinds), best)
    corners, faces = [], []
    for number, others in ((0, j), (1, i)):
        k = np.flatnonzero(best == number)
        face, planes = kinds[number].first[k], placed_after.faces
        points, normals = planes.middles[face], planes.normals[face]
        owner, corner = _behind(placed_after, others[k], points, normals, kinds[number].after[k])
        corners.append(corner)
        faces.append(face[owner])
    k = np.flatnonzero(best == 2)
    own, other = kinds[2].first[k], kinds[2].second[k]
    normals = _ridden(movement, across(placed, own, other), other)
    at_edges, edge_corner = _behind(placed_after, i[k], placed_after.starts(other), normals, kinds[2].after[k])
    return np.concatenate(corners), np.concatenate(faces), own, other, at_edges, edge_corner


def across(placed: PlacedParts, own: np.ndarray, other: np.ndarray) -> np.ndarray:
    """(..., 3) array: unit normals to two edges, out of the part of the other; zero where they are parallel."""
    along, along_other = placed.along(own), placed.along(other)
    normal = cross(along, along_other)
    size, lengths = np.sqrt(dot(normal, normal)), np.sqrt(dot(along, along) * dot(along_other, along_other))
    sense = np.sign(dot(normal, placed.outward(other)))
    return normal * (np.where(size > ROUNDING * lengths, sense, 0.0) / np.maximum(size, 1e-300))[..., None]


def _score(before: np.ndarray, after: np.ndarray) -> np.ndarray:
    return after + BEFORE * np.minimum(before, 0.0)


def _behind(
    after: PlacedParts, part: np.ndarray, points: np.ndarray, normals: np.ndarray, depth: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Corners of parts that have come behind planes, nearly as far as the deepest, and the plane of each."""
    offsets = after.solids.offsets
    owner, position = expand_ranges(np.diff(offsets)[part])
    corner = offsets[part][owner] + position
    height = ((after.vertices[corner] - points[owner]) * normals[owner]).sum(axis=1)
    chosen = height < AS_DEEP * depth[owner]
    return owner[chosen], corner[chosen]


def _of_faces(movement: Movement, i: np.ndarray, j: np.ndarray) -> _Axes:
    """Give the axes along normals of faces of parts i, with parts j before them."""
    solids = movement[0].solids
    before, after = np.empty((2, len(i)))
    first = np.empty(len(i), dtype=np.int64)
    for k, face, corner in alike((solids.faces_of_block, i), (solids.offsets, j), filled=True):
        gaps = [placed.before_faces(face, corner) for placed in movement]
        _, first[k], before[k], after[k] = at_largest(_score(*gaps), face, *gaps)
    return _Axes(first, first, before, after)


def _of_edges(movement: Movement, i: np.ndarray, j: np.ndarray) -> _Axes:
    """Give the axes across an edge of parts i and one of parts j, on which their planes ride."""
    placed_before, placed_after = movement
    offsets, (once, edges_of) = placed_before.solids.offsets, placed_before.solids.whole_edges
    before, after = np.full((2, len(i)), -np.inf)
    first, second = np.zeros((2, len(i)), dtype=np.int64)
    for k, own, other, *corners in alike((edges_of, i), (edges_of, j), (offsets, i), (offsets, j), filled=True):
        own, other = np.repeat(once[own], other.shape[1], axis=1), np.tile(once[other], (1, own.shape[1]))
        normals = across(placed_before, own, other)
        gaps, foremost = _gaps(placed_before, normals, own, other, corners)
        ridden, _ = _gaps(placed_after, _ridden(movement, normals, other), own, other, corners)
        gaps = np.where(foremost, gaps, -np.inf)
        _, first[k], second[k], before[k], after[k] = at_largest(_score(gaps, ridden), own, other, gaps, ridden)
    return _Axes(first, second, before, after)


def _ridden(movement: Movement, normals: np.ndarray, other: np.ndarray) -> np.ndarray:
    """(..., 3) array: normals that ride on the parts of edges, after the movement."""
    after = np.zeros_like(normals)
    face = movement[0].solids.face_of_corner[other]
    axes = ((unit(placed.along(other)), placed.faces.normals[face]) for placed in movement)
    for old, new in zip(*((along, normal, cross(along, normal)) for along, normal in axes), strict=True):
        after += dot(normals, old)[..., None] * new
    return after


def _gaps(
    placed: PlacedParts, normals: np.ndarray, own: np.ndarray, other: np.ndarray, corners: list[np.ndarray]
) -> tuple[np.ndarray, np.ndarray]:
    """Separations of parts along normals to two edges, (n_pairs, n_axes) [m], and whether both would meet first."""
    origin, along = placed.vertices[corners[0][:, :1]], placed.along(own)
    at_own, at_other = (dot(normals, placed.starts(k) - origin) for k in (own, other))
    low = (normals @ (placed.vertices[corners[0]] - origin).transpose(0, 2, 1)).min(axis=2)
    high = (normals @ (placed.vertices[corners[1]] - origin).transpose(0, 2, 1)).max(axis=2)
    is_normal = dot(normals, normals) > 0.5
    foremost = is_normal & (np.maximum(at_own - low, high - at_other) <= ROUNDING * np.sqrt(dot(along, along)))
    return np.where(is_normal, low - high, -np.inf), foremost
