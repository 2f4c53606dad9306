"""Contact points in space: the polygons in which convex parts face each other, with their frames and gaps."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from solver.tolerances import CORNER_TOLERANCE, PENETRATION_FRACTION

from .broad_phase import box_pairs, boxes, expand_ranges
from .contacts import Contacts
from .portions import alike
from .solids import Faces, Solids, cross, dot, unit

#: Two faces face each other where the cosine between the outward normal of one and the inward normal of the other is
#: at least this: steep ridges and tips touch a plane with flanks that hardly face it.
FACING = 0.05

#: Edges nearer to parallel than this sine are clipped against each other, but their cross product is no normal.
SMALLEST_SINE = 0.05

#: Separations that differ by less than this, in widths, are equal: then the faces that oppose each other better count.
SAME_SEPARATION = 1e-6

#: An edge on an edge is a contact of its own where it keeps the parts apart by this much more than any face does, in
#: widths.
EDGES_APART = 1e-4

#: Two faces that oppose each other better than this cosine leave no room for edges between them.
OPPOSED = 0.94

#: Kinds of contact in space, column 0 of the features. A corner on a face: the vertex (of ``block_a``), the face (of
#: ``block_b``), and -1, or where the vertex is on the boundary of the face the edge there and the edge of ``block_a``
#: that crosses it. A corner on a corner: both corners, each a vertex and a face, -1. An edge across an edge: both, each
#: named by the corner it starts at, and where along them.
ON_FACE, ON_CORNER, ACROSS = 0, 1, 2

#: Places along edges are kept as multiples of this part of them, which is far below what a geometry is exact to.
GRAIN = 2.0**-29


def _places(along_a: np.ndarray, along_b: np.ndarray, parallel: np.ndarray) -> np.ndarray:
    """(n,) int array that holds two fractions of edges and whether these are nearly parallel."""
    a, b = (np.clip(np.round(along / GRAIN), 0, 1 / GRAIN).astype(np.int64) for along in (along_a, along_b))
    return ((a << 30 | b) << 1) | parallel


def _read_places(places: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Fractions along both edges and whether they are nearly parallel, from what :func:`_places` made of them."""
    both = places >> 1
    return (both >> 30) * GRAIN, (both & ((1 << 30) - 1)) * GRAIN, (places & 1).astype(bool)


def measured_points(
    solids: Solids, block_of_part: np.ndarray, vertices: np.ndarray, features: np.ndarray, areas: np.ndarray
) -> Contacts:
    """Frames, gaps and slips of given pairs of features where the corners now are.

    Parameters
    ----------
    solids : Solids
        Convex parts.
    block_of_part : (n_parts,) int array
    vertices : (n_vertices, 3) array [m]
        Current corners of all parts.
    features : (n, 4) int array
        As in :class:`Contacts`.
    areas : (n,) array [m²]
        Carried on.

    Notes
    -----
    A corner inside a face has the normal of the face. On the boundary of a face its normal is half-way between that of
    the face and that of the edges that cross there, so that a corner that comes in from outside turns by the same
    angle twice and not at once. A corner on a corner, and edges that are nearly parallel, have the normal half-way
    between the two faces. An edge across an edge has the normal to both.

    The gap is the distance along the normal of two material points. Tangents ride on the face of ``block_b``: swung
    about the edge there where the normal is not the face's. The slip is the place of the point of ``block_a`` along
    them, so that its change is the slip between the blocks to first order.
    """
    faces = solids.faces(vertices)
    kind, first, second, rest = features.T
    corners, following, face_of = solids.corners, solids.next_corner, solids.face_of_corner
    face_b = np.where(kind == ON_FACE, second, face_of[np.where(kind == ON_FACE, 0, second)])
    x_a = vertices[np.where(kind == ON_FACE, first, corners[np.where(kind == ON_FACE, 0, first)])]
    x_b = faces.middles[face_b]
    normals, tangents = faces.normals[face_b], faces.tangents[face_b]
    face_normals, face_tangents = normals.copy(), tangents.copy()
    along = np.zeros_like(normals)

    # A corner on the boundary of a face.
    k = np.flatnonzero((kind == ON_FACE) & (rest >= 0))
    own, other = rest[k] % len(corners), rest[k] // len(corners)
    x_b[k] = vertices[corners[other]]
    along[k] = unit(vertices[corners[following[other]]] - x_b[k])
    crossing = unit(cross(vertices[corners[following[own]]] - vertices[corners[own]], along[k]))
    sense = np.sign(dot(crossing, _outward(solids, faces, other) - _outward(solids, faces, own)))
    normals[k] = unit(face_normals[k] + sense[:, None] * crossing)

    # An edge across an edge.
    k = np.flatnonzero(kind == ACROSS)
    on_a, on_b, parallel = _read_places(rest[k])
    own, other = first[k], second[k]
    from_a, from_b = vertices[corners[own]], vertices[corners[other]]
    edge_a, edge_b = vertices[corners[following[own]]] - from_a, vertices[corners[following[other]]] - from_b
    x_a[k], x_b[k] = from_a + on_a[:, None] * edge_a, from_b + on_b[:, None] * edge_b
    crossing = unit(cross(edge_a, edge_b))
    sense = np.sign(dot(crossing, _outward(solids, faces, other) - _outward(solids, faces, own)))
    halfway = unit(face_normals[k] - faces.normals[face_of[own]])
    normals[k] = np.where(parallel[:, None], halfway, sense[:, None] * crossing)
    along[k] = np.where(parallel[:, None], 0.0, unit(edge_b))

    k = np.flatnonzero(kind == ON_CORNER)
    x_b[k] = vertices[corners[second[k]]]
    normals[k] = unit(face_normals[k] - faces.normals[face_of[first[k]]])

    # Swung about the edge; where there is none, only turned onto the plane of the contact.
    swings = dot(along, along) > 0.0
    across = cross(face_normals, along)
    swung = dot(tangents, along)[:, None] * along + dot(tangents, across)[:, None] * cross(normals, along)
    turned = tangents - dot(tangents, normals)[:, None] * normals
    tangents = unit(np.where(swings[:, None], swung, turned))
    frames = np.stack([normals, tangents, cross(normals, tangents)], axis=1)

    # From the middle of the face to the point of block b, which is the same for ever, then on to that of block a.
    fixed, apart = x_b - faces.middles[face_b], x_a - x_b
    place = np.stack([dot(fixed, face_tangents), dot(fixed, cross(face_normals, face_tangents))], axis=1)
    slip = place + np.stack([dot(apart, frames[:, 1]), dot(apart, frames[:, 2])], axis=1)
    part_a = solids.block_of_vertex[np.where(kind == ON_FACE, first, corners[np.where(kind == ON_FACE, 0, first)])]
    return Contacts(
        features=features,
        block_a=block_of_part[part_a],
        block_b=block_of_part[solids.block_of_face[face_b]],
        points=np.where((kind == ON_FACE)[:, None], x_a, (x_a + x_b) / 2.0),
        frames=frames,
        gaps=dot(apart, normals),
        slip=slip,
        areas=areas,
    )


def _outward(solids: Solids, faces: Faces, edges: np.ndarray) -> np.ndarray:
    """(n, 3) array: sum of the outward normals of the two faces at each edge."""
    face = solids.face_of_corner
    return faces.normals[face[edges]] + faces.normals[face[solids.twins[edges]]]


def find_points(
    solids: Solids,
    block_of_part: np.ndarray,
    vertices: np.ndarray,
    reach: float,
    useful: np.ndarray,
    widths: np.ndarray,
) -> Contacts:
    """Find the points at which blocks touch or may touch within one increment.

    Parameters
    ----------
    solids : Solids
        Convex parts.
    block_of_part : (n_parts,) int array
        Parts of one block do not touch each other.
    vertices : (n_vertices, 3) array [m]
        Current corners of all parts.
    reach : float [m]
        Largest gap of a contact point that is kept.
    useful : (n_blocks,) bool array
        One of two blocks that touch must be of these: those that are free to move.
    widths : (n_blocks,) array [m]

    Returns
    -------
    Contacts
        Sorted by their features, so that the same geometry gives the same order.

    Notes
    -----
    Of two near parts, the face from which the other part is farthest leads, and the face of the other that opposes it
    best answers. Both are projected into the plane half-way between and clipped. A corner of the clipped polygon is a
    corner of one part in the face of the other, or an edge across an edge. Where no faces oppose each other, a tip
    stands on a face, or an edge lies across an edge.
    """
    faces = solids.faces(vertices)
    i, j = _near_parts(solids, block_of_part, vertices, reach, useful)
    deepest = PENETRATION_FRACTION * np.minimum(widths[block_of_part[i]], widths[block_of_part[j]])
    pairs = _leading_faces(solids, faces, vertices, i, j, reach, deepest)
    found = [
        *_clipped(solids, faces, vertices, pairs[pairs.shallow & (pairs.facing <= -FACING)]),
        _tips(solids, faces, vertices, pairs[pairs.shallow & (pairs.facing > -FACING)], reach),
        _crossed_edges(solids, faces, vertices, pairs[pairs.facing > -OPPOSED], reach),
    ]
    features, areas = (np.concatenate(column) for column in zip(*found, strict=True))
    contacts = measured_points(solids, block_of_part, vertices, features, areas)
    low = -PENETRATION_FRACTION * np.minimum(widths[contacts.block_a], widths[contacts.block_b])
    kept = np.flatnonzero((contacts.gaps <= reach) & (contacts.gaps >= low))
    kind, first, second, _ = features[kept].T
    return contacts[kept[np.lexsort((second, first, kind))]]


@dataclass(frozen=True)
class _Pairs:
    """Pairs of near parts, with the faces they turn to each other.

    Attributes
    ----------
    i, j : (n,) int arrays
        The parts.
    face_i, face_j : (n,) int arrays
    i_leads : (n,) bool array
        Whether the face of i keeps the parts apart.
    apart : (n,) array [m]
        Largest separation along the normal of a face; negative where the parts overlap.
    facing : (n,) array
        Cosine between the two faces; -1 where they oppose each other.
    deepest : (n,) array [m]
        Overlap up to which they touch.
    """

    i: np.ndarray
    j: np.ndarray
    face_i: np.ndarray
    face_j: np.ndarray
    i_leads: np.ndarray
    apart: np.ndarray
    facing: np.ndarray
    deepest: np.ndarray

    def __getitem__(self, chosen: np.ndarray) -> _Pairs:
        return _Pairs(*(value[chosen] for value in vars(self).values()))

    @property
    def shallow(self) -> np.ndarray:
        """(n,) bool array: whether the overlap is that of a contact."""
        return self.apart >= -self.deepest


def _near_parts(
    solids: Solids, block_of_part: np.ndarray, vertices: np.ndarray, reach: float, useful: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Pairs of parts of different blocks, one of them useful, whose boxes come within reach; lower block first."""
    low, high = boxes(vertices, solids.offsets)
    i, j = box_pairs(low - reach / 2.0, high + reach / 2.0)
    a, b = block_of_part[i], block_of_part[j]
    chosen = (a != b) & (useful[a] | useful[b])
    return i[chosen], j[chosen]


def face_separations(
    solids: Solids, faces: Faces, vertices: np.ndarray, i: np.ndarray, j: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """How far part j is in front of the face of part i from which it is farthest, (n,) [m], and that face."""
    first_face, first_vertex = solids.faces_of_block, solids.offsets
    n_faces, n_vertices = np.diff(first_face)[i], np.diff(first_vertex)[j]
    apart, leading = np.empty(len(i)), np.empty(len(i), dtype=np.int64)
    for k in alike(n_faces, n_vertices):
        face = first_face[i[k]][:, None] + np.arange(n_faces[k[0]])
        vertex = first_vertex[j[k]][:, None] + np.arange(n_vertices[k[0]])
        # From a corner near by, for the digits of coordinates far from the origin.
        origin = vertices[first_vertex[i[k]]][:, None]
        normal, corner = faces.normals[face], vertices[vertex] - origin
        level = dot(normal, faces.middles[face] - origin)
        distance = dot(normal[:, :, None], corner[:, None]).min(axis=2) - level
        best = distance.argmax(axis=1)
        row = np.arange(len(k))
        apart[k], leading[k] = distance[row, best], face[row, best]
    return apart, leading


def _opposed_faces(solids: Solids, faces: Faces, leading: np.ndarray, j: np.ndarray) -> np.ndarray:
    """(n,) int array: the face of part j that opposes the leading face best."""
    first = solids.faces_of_block
    counts = np.diff(first)[j]
    answer = np.empty(len(j), dtype=np.int64)
    for k in alike(counts):
        face = first[j[k]][:, None] + np.arange(counts[k[0]])
        answer[k] = face[np.arange(len(k)), dot(faces.normals[face], faces.normals[leading[k]][:, None]).argmin(axis=1)]
    return answer


def _leading_faces(
    solids: Solids,
    faces: Faces,
    vertices: np.ndarray,
    i: np.ndarray,
    j: np.ndarray,
    reach: float,
    deepest: np.ndarray,
) -> _Pairs:
    """Choose the faces that near parts turn to each other, where no face keeps them farther apart than ``reach``."""
    apart_i, lead_i = face_separations(solids, faces, vertices, i, j)
    near = np.flatnonzero(apart_i <= reach)
    i, j, apart_i, lead_i, deepest = i[near], j[near], apart_i[near], lead_i[near], deepest[near]
    apart_j, lead_j = face_separations(solids, faces, vertices, j, i)
    near = np.flatnonzero(apart_j <= reach)
    i, j, deepest = i[near], j[near], deepest[near]
    apart_i, lead_i, apart_j, lead_j = apart_i[near], lead_i[near], apart_j[near], lead_j[near]
    answer_j, answer_i = _opposed_faces(solids, faces, lead_i, j), _opposed_faces(solids, faces, lead_j, i)
    normals = faces.normals
    cosine_i, cosine_j = dot(normals[lead_i], normals[answer_j]), dot(normals[lead_j], normals[answer_i])
    equal = np.abs(apart_i - apart_j) <= SAME_SEPARATION / PENETRATION_FRACTION * deepest
    i_leads = np.where(equal, cosine_i <= cosine_j, apart_i > apart_j)
    return _Pairs(
        i=i,
        j=j,
        face_i=np.where(i_leads, lead_i, answer_i),
        face_j=np.where(i_leads, answer_j, lead_j),
        i_leads=i_leads,
        apart=np.maximum(apart_i, apart_j),
        facing=np.where(i_leads, cosine_i, cosine_j),
        deepest=deepest,
    )


def _clipped(
    solids: Solids, faces: Faces, vertices: np.ndarray, pairs: _Pairs
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Features and areas of the corners of the polygons in which two faces cover each other."""
    sizes = np.diff(solids.face_offsets)
    for k in alike(sizes[pairs.face_i], sizes[pairs.face_j]):
        yield _clipped_alike(solids, faces, vertices, pairs.face_i[k], pairs.face_j[k])
    yield np.zeros((0, 4), dtype=np.int64), np.zeros(0)


def _clipped_alike(
    solids: Solids, faces: Faces, vertices: np.ndarray, face_a: np.ndarray, face_b: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Features and areas for faces a that all have as many corners, and faces b likewise."""
    n_a, n_b = (int(solids.face_offsets[face[0] + 1] - solids.face_offsets[face[0]]) for face in (face_a, face_b))
    # Corners of a run clockwise seen along the normal of b; turned round, both run counter-clockwise. Edge k of either
    # polygon runs from its corner k to the next, which for a is the edge that starts at the latter.
    corner_a = solids.face_offsets[face_a][:, None] + np.arange(n_a)[::-1]
    corner_b = solids.face_offsets[face_b][:, None] + np.arange(n_b)
    edge_a, edge_b = np.roll(corner_a, -1, axis=1), corner_b
    normal = unit(faces.normals[face_b] - faces.normals[face_a])
    x = faces.tangents[face_b]
    x = unit(x - dot(x, normal)[:, None] * normal)
    y = cross(normal, x)
    origin = faces.middles[face_b][:, None]
    a, b = (
        np.stack([dot(arms, x[:, None]), dot(arms, y[:, None])], axis=-1)
        for arms in (vertices[solids.corners[corner]] - origin for corner in (corner_a, corner_b))
    )
    along_a, along_b = np.roll(a, -1, axis=1) - a, np.roll(b, -1, axis=1) - b
    long_a, long_b = (np.maximum(np.hypot(d[..., 0], d[..., 1]), 1e-300) for d in (along_a, along_b))
    end = CORNER_TOLERANCE * np.minimum(solids.shortest_edges[face_a], solids.shortest_edges[face_b])[:, None]

    # How far each corner is inside each edge of the other polygon: (n, corners, edges).
    a_in_b = _inside(a, b, along_b / long_b[..., None])
    b_in_a = _inside(b, a, along_a / long_a[..., None])
    nearest_b, nearest_a = a_in_b.argmin(axis=2), b_in_a.argmin(axis=2)
    depth_a = np.take_along_axis(a_in_b, nearest_b[..., None], axis=2)[..., 0]
    depth_b = np.take_along_axis(b_in_a, nearest_a[..., None], axis=2)[..., 0]
    used_a, used_b = depth_a >= -end, depth_b >= -end
    apart = np.abs(a[:, :, None] - b[:, None]).max(axis=3)
    both = (apart <= 2.0 * end[..., None]) & used_a[:, :, None] & used_b[:, None]

    # Edge k of a crosses edge l of b where the ends of each are on different sides of the other.
    next_a, next_b = np.roll(a_in_b, -1, axis=1), np.roll(b_in_a, -1, axis=1)
    crosses = ((a_in_b > 0.0) != (next_a > 0.0)) & np.swapaxes((b_in_a > 0.0) != (next_b > 0.0), 1, 2)
    tight = end[..., None]
    crosses &= ~((np.abs(a_in_b) <= tight) & (np.abs(next_a) <= tight))
    crosses &= ~np.swapaxes((np.abs(b_in_a) <= tight) & (np.abs(next_b) <= tight), 1, 2)
    with np.errstate(divide="ignore", invalid="ignore"):
        on_a = np.where(crosses, a_in_b / (a_in_b - next_a), 0.0)
        on_b = np.where(crosses, np.swapaxes(b_in_a / (b_in_a - next_b), 1, 2), 0.0)
    # What crosses at a corner that counts already is that corner.
    for on, long, used, axis in ((on_a, long_a[:, :, None], used_a, 1), (on_b, long_b[:, None], used_b, 2)):
        here, there = np.expand_dims(used, 3 - axis), np.expand_dims(np.roll(used, -1, axis=1), 3 - axis)
        crosses &= ~(here & (on * long <= 2.0 * tight)) & ~(there & ((1.0 - on) * long <= 2.0 * tight))

    pair, p, q = np.nonzero(both)
    on_corner = (
        pair,
        _rows(ON_CORNER, corner_a[pair, p], corner_b[pair, q], -1),
        (a[pair, p] + b[pair, q]) / 2.0,
    )
    alone_a, alone_b = used_a & ~both.any(axis=2), used_b & ~both.any(axis=1)
    pair, p = np.nonzero(alone_a)
    vertex_a = _on_face(solids, vertices, end, depth_a, nearest_b, pair, p, corner_a, face_b, edge_b), a[pair, p]
    pair_a = pair
    pair, q = np.nonzero(alone_b)
    vertex_b = _on_face(solids, vertices, end, depth_b, nearest_a, pair, q, corner_b, face_a, edge_a), b[pair, q]
    pair_b = pair
    pair, p, q = np.nonzero(crosses)
    u, v = on_a[pair, p, q], on_b[pair, p, q]
    sine = np.abs(along_a[pair, p, 0] * along_b[pair, q, 1] - along_a[pair, p, 1] * along_b[pair, q, 0]) / (
        long_a[pair, p] * long_b[pair, q]
    )
    # The edge of a runs the other way round in its face: fractions count from the corner it starts at there.
    places = _places(1.0 - u, v, sine < SMALLEST_SINE)
    across = pair, _rows(ACROSS, edge_a[pair, p], edge_b[pair, q], places), a[pair, p] + u[:, None] * along_a[pair, p]
    owner, features, points = (
        np.concatenate(column)
        for column in zip(on_corner, (pair_a, *vertex_a), (pair_b, *vertex_b), across, strict=True)
    )
    areas, wide = _shares(owner, points, len(face_a))
    kept = wide[owner] > end[owner, 0]
    return features[kept], areas[kept]


def _rows(kind: int, first: np.ndarray, second: np.ndarray, rest: np.ndarray | int) -> np.ndarray:
    """(n, 4) int array: features of one kind."""
    return np.stack(np.broadcast_arrays(kind, first, second, rest), axis=1).astype(np.int64)


def _inside(points: np.ndarray, corners: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """(n, n_points, n_edges) array [m]: how far points are to the left of edges that start at corners."""
    rest = points[:, :, None] - corners[:, None]
    way = directions[:, None]
    return way[..., 0] * rest[..., 1] - way[..., 1] * rest[..., 0]


def _on_face(
    solids: Solids,
    vertices: np.ndarray,
    end: np.ndarray,
    depth: np.ndarray,
    nearest: np.ndarray,
    pair: np.ndarray,
    p: np.ndarray,
    corner: np.ndarray,
    face: np.ndarray,
    edge: np.ndarray,
) -> np.ndarray:
    """(n, 4) int array: features of corners on faces, with the edges that cross where they are on the boundary."""
    own = corner[pair, p]
    other = edge[pair, nearest[pair, p]]
    start, following = vertices[solids.corners], solids.next_corner
    along = unit(start[following[other]] - start[other])
    candidates = np.stack([own, solids.previous_corner[own]], axis=1)
    crossing = cross(unit(start[following[candidates]] - start[candidates]), along[:, None])
    sine = np.sqrt(dot(crossing, crossing))
    best = sine.argmax(axis=1)
    row = np.arange(len(own))
    on_boundary = (depth[pair, p] <= end[pair, 0]) & (sine[row, best] >= SMALLEST_SINE)
    code = np.where(on_boundary, other * np.int64(len(solids.corners)) + candidates[row, best], -1)
    return _rows(ON_FACE, solids.corners[own], face[pair], code)


def _shares(owner: np.ndarray, points: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Part of its convex polygon that each corner stands for, (n,) [m²], and how wide the polygons are, (count,) [m].

    Parameters
    ----------
    owner : (n,) int array
        The polygon of each corner.
    points : (n, 2) array [m]
        Corners in any order.
    count : int
        Number of polygons.
    """
    if len(owner) == 0:
        return np.zeros(0), np.zeros(count)
    number = np.bincount(owner, minlength=count)
    total = np.stack([np.bincount(owner, points[:, k], minlength=count) for k in (0, 1)], axis=1)
    middle = total / np.maximum(number, 1)[:, None]
    arms = points - middle[owner]
    order = np.lexsort((np.arctan2(arms[:, 1], arms[:, 0]), owner))
    there = number > 0
    following = next_in_loops(number[there])
    ring = arms[order]
    after = ring[following]
    triangle = (ring[:, 0] * after[:, 1] - ring[:, 1] * after[:, 0]) / 2.0
    shares = np.zeros(len(owner))
    # Half of the triangle before and half of the one behind.
    np.add.at(shares, order, triangle / 2.0)
    np.add.at(shares, order[following], triangle / 2.0)
    area = np.bincount(owner, shares, minlength=count)
    far = np.zeros(count)
    np.maximum.at(far, owner, np.hypot(arms[:, 0], arms[:, 1]))
    return np.maximum(shares, 0.0), area / np.maximum(2.0 * far, 1e-300)


def next_in_loops(counts: np.ndarray) -> np.ndarray:
    """(sum of counts,) int array: the entry that follows each in its loop."""
    ends = np.cumsum(counts)
    following = np.arange(1, len(np.repeat(counts, counts)) + 1)
    following[ends - 1] = ends - counts
    return following


def _tips(
    solids: Solids, faces: Faces, vertices: np.ndarray, pairs: _Pairs, reach: float
) -> tuple[np.ndarray, np.ndarray]:
    """Corners before a leading face that no face of theirs opposes: a steep tip on a plane."""
    face = np.where(pairs.i_leads, pairs.face_i, pairs.face_j)
    part = np.where(pairs.i_leads, pairs.j, pairs.i)
    owner, position = expand_ranges(np.diff(solids.offsets)[part])
    vertex, face = solids.offsets[part][owner] + position, face[owner]
    gap = dot(vertices[vertex] - faces.middles[face], faces.normals[face])
    near = np.flatnonzero(gap <= reach)
    vertex, face = vertex[near], face[near]
    start = solids.face_offsets[face]
    owner, position = expand_ranges(np.diff(solids.face_offsets)[face])
    corner = start[owner] + position
    from_corner = vertices[solids.corners[corner]]
    along = unit(vertices[solids.corners[solids.next_corner[corner]]] - from_corner)
    inward = cross(faces.normals[face[owner]], along)
    inside = dot(vertices[vertex[owner]] - from_corner, inward)
    if len(owner):
        inside = np.minimum.reduceat(inside, np.flatnonzero(position == 0))
    over = inside >= -CORNER_TOLERANCE * solids.shortest_edges[face]
    return _rows(ON_FACE, vertex[over], face[over], -1), np.zeros(np.count_nonzero(over))


def _crossed_edges(
    solids: Solids, faces: Faces, vertices: np.ndarray, pairs: _Pairs, reach: float
) -> tuple[np.ndarray, np.ndarray]:
    """Edges that keep two parts apart better than any of their faces: one point for a pair."""
    apart, own, other = edge_separations(solids, faces, vertices, pairs.i, pairs.j)
    width = pairs.deepest / PENETRATION_FRACTION
    k = np.flatnonzero((apart > pairs.apart + EDGES_APART * width) & (apart <= reach) & (apart >= -pairs.deepest))
    own, other = own[k], other[k]
    a, b = vertices[solids.corners[own]], vertices[solids.corners[other]]
    along_a = vertices[solids.corners[solids.next_corner[own]]] - a
    along_b = vertices[solids.corners[solids.next_corner[other]]] - b
    area = cross(along_a, along_b)
    on_a, on_b = (dot(cross(b - a, along), area) / dot(area, area) for along in (along_b, along_a))
    inside = (on_a > 0.0) & (on_a < 1.0) & (on_b > 0.0) & (on_b < 1.0)
    places = _places(on_a[inside], on_b[inside], np.zeros(np.count_nonzero(inside), dtype=bool))
    return _rows(ACROSS, own[inside], other[inside], places), np.zeros(len(places))


def edge_separations(
    solids: Solids, faces: Faces, vertices: np.ndarray, i: np.ndarray, j: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """How far two edges keep two convex parts apart.

    Parameters
    ----------
    solids : Solids
    faces : Faces
    vertices : (n_vertices, 3) array [m]
    i, j : (n,) int arrays
        Parts.

    Returns
    -------
    apart : (n,) array [m]
        Largest separation along the cross product of an edge of i and an edge of j between which both parts lie on the
        two sides; minus infinity where there are none.
    own, other : (n,) int arrays
        The edges.
    """
    once = np.flatnonzero(np.arange(len(solids.corners)) < solids.twins)
    first = np.searchsorted(once, solids.face_offsets[solids.faces_of_block])
    count = np.diff(first)
    face = solids.face_of_corner
    apart = np.full(len(i), -np.inf)
    found_own, found_other = np.zeros((2, len(i)), dtype=np.int64)
    for k in alike(count[i], count[j]):
        own = once[first[i[k]][:, None] + np.arange(count[i[k[0]]])]
        other = once[first[j[k]][:, None] + np.arange(count[j[k[0]]])]
        a, b = vertices[solids.corners[own]], vertices[solids.corners[other]]
        along_a = unit(vertices[solids.corners[solids.next_corner[own]]] - a)
        along_b = unit(vertices[solids.corners[solids.next_corner[other]]] - b)
        normal = cross(along_a[:, :, None], along_b[:, None])
        holds = dot(normal, normal) > SMALLEST_SINE**2
        outward = _outward(solids, faces, other)[:, None] - _outward(solids, faces, own)[:, :, None]
        sense = np.sign(dot(normal, outward))
        normal, holds = unit(normal) * sense[..., None], holds & (sense != 0.0)
        for edges, side, axis in ((own, -1.0, 2), (other, 1.0, 1)):
            for one in (face[edges], face[solids.twins[edges]]):
                holds &= side * dot(np.expand_dims(faces.normals[one], axis), normal) >= -SAME_SEPARATION
        distance = np.where(holds, dot(a[:, :, None] - b[:, None], normal), -np.inf).reshape(len(k), -1)
        best = distance.argmax(axis=1)
        row = np.arange(len(k))
        apart[k] = distance[row, best]
        found_own[k], found_other[k] = own[row, best // other.shape[1]], other[row, best % other.shape[1]]
    return apart, found_own, found_other
