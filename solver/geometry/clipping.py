"""Clipping: the polygons in which two faces cover each other, seen half-way between them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from solver.tolerances import CORNER_TOLERANCE

from .convex_parts import ENDS, PlacedParts
from .facing import SMALLEST_SINE
from .outlines import next_vertices, turn
from .portions import alike, at_largest
from .solids import cross, dot, stacked, taken, unit
from .spatial_features import ACROSS, ON_CORNER, ON_FACE, feature_rows, places_of


class ClippedCorners(NamedTuple):
    """Corners of the polygons in which faces cover each other."""

    owner: np.ndarray  #: (n,) int: the pair of faces
    features: np.ndarray  #: (n, 4) int
    areas: np.ndarray  #: (n,) [m²]: tributary area of each corner in its polygon
    widths: np.ndarray  #: (n,) [m], of the polygon; infinite at the end of a line along a cut


class _Outlines:
    """One face of each of n pairs, in the plane half-way between both: corners and edges, (n, m) int, and places."""

    def __init__(self, corner: np.ndarray, edge: np.ndarray, points: np.ndarray) -> None:
        self.corner, self.edge, self.points = corner, edge, points
        self.along = np.roll(points, -1, axis=1) - points
        self.lengths = np.maximum(np.hypot(self.along[..., 0], self.along[..., 1]), 1e-300)

    def compare(self, other: _Outlines, end: np.ndarray) -> None:
        """Find how far corners are inside each edge of the others, (n, m, m_other) [m], and which are inside of all."""
        directions = other.along / other.lengths[..., None]
        self.inside = turn(directions[:, None], self.points[:, :, None] - other.points[:, None])
        self.used = self.inside.min(axis=2) >= -end


def clipped_faces(placed: PlacedParts, face_a: np.ndarray, face_b: np.ndarray) -> ClippedCorners:
    """Corners of the polygons in which faces a and faces b, (n,) int arrays of one or more, cover each other."""
    offsets = placed.solids.face_offsets
    clipped = []
    for k, corner_a, corner_b in alike((offsets, face_a), (offsets, face_b)):
        corners = _clipped(placed, face_a[k], face_b[k], corner_a, corner_b)
        clipped.append(corners._replace(owner=k[corners.owner]))
    return ClippedCorners(*map(np.concatenate, zip(*clipped, strict=True)))


def _clipped(
    placed: PlacedParts, face_a: np.ndarray, face_b: np.ndarray, corner_a: np.ndarray, corner_b: np.ndarray
) -> ClippedCorners:
    """Corners for faces a that all have as many corners, (n, n_corners) int, and faces b likewise."""
    parts, solids, faces = placed.parts, placed.solids, placed.faces
    # Corners of a run clockwise seen along the normal of b; turned round, both run counter-clockwise. Edge k of either
    # polygon runs from its corner k to the next, which for a is the edge that starts at the latter.
    corner_a = corner_a[:, ::-1]
    normal = unit(taken(faces.normals, face_b) - taken(faces.normals, face_a))
    x = taken(faces.tangents, face_b)
    x = unit(x - dot(x, normal)[:, None] * normal)
    y = cross(normal, x)
    origin = faces.middles[face_b][:, None]
    arms_a, arms_b = placed.starts(corner_a) - origin, placed.starts(corner_b) - origin
    points_a, points_b = (stacked([dot(arms, x[:, None]), dot(arms, y[:, None])]) for arms in (arms_a, arms_b))
    a, b = _Outlines(corner_a, np.roll(corner_a, -1, axis=1), points_a), _Outlines(corner_b, corner_b, points_b)
    end = CORNER_TOLERANCE * np.minimum(solids.shortest_edges[face_a], solids.shortest_edges[face_b])[:, None]

    a.compare(b, end)
    b.compare(a, end)
    apart = np.abs(a.points[:, :, None] - b.points[:, None]).max(axis=3)
    both = (apart <= 2.0 * end[..., None]) & a.used[:, :, None] & b.used[:, None]
    pair, p, q = np.nonzero(both)
    own, other = corner_a[pair, p], corner_b[pair, q]
    # Where the face of one block alone goes on, the corner of the other is on that face.
    goes_a, goes_b = parts.goes_on[own], parts.goes_on[other]
    vertex, face = solids.corners[np.where(goes_b, own, other)], np.where(goes_b, face_b[pair], face_a[pair])
    alone = (goes_a != goes_b)[:, None]
    features = np.where(alone, feature_rows(ON_FACE, vertex, face, -1), feature_rows(ON_CORNER, own, other, -1))
    on_corner = pair, features, (a.points[pair, p] + b.points[pair, q]) / 2.0
    vertex_a = _on_face(placed, end, a, b, face_b, a.used & ~both.any(axis=2))
    vertex_b = _on_face(placed, end, b, a, face_a, b.used & ~both.any(axis=1))
    crosses, on_a, on_b = _crossings(a, b, end[..., None])
    pair, p, q = np.nonzero(crosses)
    u, v = on_a[pair, p, q], on_b[pair, p, q]
    sine = np.abs(turn(a.along[pair, p], b.along[pair, q])) / (a.lengths[pair, p] * b.lengths[pair, q])
    # The edge of a runs the other way round in its face: fractions count from the corner it starts at there.
    places = places_of(1.0 - u, v, sine < SMALLEST_SINE)
    crossings = a.points[pair, p] + u[:, None] * a.along[pair, p]
    across = pair, feature_rows(ACROSS, a.edge[pair, p], b.edge[pair, q], places), crossings
    owner, features, points = map(np.concatenate, zip(on_corner, vertex_a, vertex_b, across, strict=True))
    areas, wide = corner_areas(owner, points, len(face_a))
    kept = wide[owner] > end[owner, 0]
    return ClippedCorners(owner[kept], features[kept], areas[kept], wide[owner[kept]])


def _crossings(a: _Outlines, b: _Outlines, tight: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Which edges of two polygons cross, (n, edges of a, edges of b) bool, and how far along either."""
    # Edge k of a crosses edge l of b where the ends of each are on different sides of the other.
    next_a, next_b = np.roll(a.inside, -1, axis=1), np.roll(b.inside, -1, axis=1)
    crosses = ((a.inside > 0.0) != (next_a > 0.0)) & np.swapaxes((b.inside > 0.0) != (next_b > 0.0), 1, 2)
    crosses &= ~((np.abs(a.inside) <= tight) & (np.abs(next_a) <= tight))
    crosses &= ~np.swapaxes((np.abs(b.inside) <= tight) & (np.abs(next_b) <= tight), 1, 2)
    with np.errstate(divide="ignore", invalid="ignore"):
        on_a = np.where(crosses, a.inside / (a.inside - next_a), 0.0)
        on_b = np.where(crosses, np.swapaxes(b.inside / (b.inside - next_b), 1, 2), 0.0)
    # What crosses at a corner that counts already is that corner.
    for on, lengths, counts, axis in ((on_a, a.lengths[:, :, None], a.used, 1), (on_b, b.lengths[:, None], b.used, 2)):
        at_start, at_end = np.expand_dims(counts, 3 - axis), np.expand_dims(np.roll(counts, -1, axis=1), 3 - axis)
        crosses &= ~(at_start & (on * lengths <= 2.0 * tight)) & ~(at_end & ((1.0 - on) * lengths <= 2.0 * tight))
    return crosses, on_a, on_b


def _on_face(
    placed: PlacedParts, end: np.ndarray, a: _Outlines, b: _Outlines, face: np.ndarray, alone: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Owners, features and points of corners alone on faces, with the edges that cross where on their boundary."""
    solids = placed.solids
    pair, p = np.nonzero(alone)
    depths, corner, code = a.inside[pair, p], a.corner[pair, p], np.full(len(pair), -1)
    near = np.flatnonzero(depths.min(axis=1) <= end[pair, 0])
    own, other = corner[near], b.edge[pair[near], depths[near].argmin(axis=1)]
    along = unit(placed.along(other))
    candidates = np.stack([own, solids.previous_corner[own]], axis=1)
    crossing = cross(unit(placed.along(candidates)), along[:, None])
    (steepest, crossed), at = at_largest(np.sqrt(dot(crossing, crossing)), candidates), placed.starts(own)
    ends = (placed.kinds_at(other, at) == ENDS) & (placed.kinds_at(crossed, at) == ENDS)
    code[near] = np.where((steepest >= SMALLEST_SINE) & ends, other * len(solids.corners) + crossed, -1)
    return pair, feature_rows(ON_FACE, solids.corners[corner], face[pair], code), a.points[pair, p]


def corner_areas(owner: np.ndarray, points: np.ndarray, count: int) -> tuple[np.ndarray, ...]:
    """Tributary areas (n,) [m²] of corners (n, 2), in any order, of convex polygons; their widths."""
    number = np.bincount(owner, minlength=count)
    total = np.stack([np.bincount(owner, points[:, k], minlength=count) for k in (0, 1)], axis=1)
    middle = total / np.maximum(number, 1)[:, None]
    arms = points - middle[owner]
    order = np.lexsort((np.arctan2(arms[:, 1], arms[:, 0]), owner))
    present = number > 0
    following = next_vertices(np.append(0, np.cumsum(number[present])))
    triangle = turn(arms[order], arms[order[following]]) / 2.0
    # Half of the triangle before and half of the one behind.
    shares = sum(np.bincount(corner, triangle / 2.0, len(owner)) for corner in (order, order[following]))
    area = np.bincount(owner, shares, minlength=count)
    far = np.zeros(count)
    np.maximum.at(far, owner, np.hypot(arms[:, 0], arms[:, 1]))
    return np.maximum(shares, 0.0), area / np.maximum(2.0 * far, 1e-300)
