"""Separations of convex parts by a face or by two edges, and the faces with which near parts face each other."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np

from .broad_phase import box_pairs, expand_ranges
from .convex_parts import PlacedParts
from .portions import alike, at_largest
from .solids import ROUNDING, cross, dot, taken, unit

#: Edges nearer to parallel than this sine have no common normal: they are clipped against each other.
SMALLEST_SINE = 0.05


@dataclass(frozen=True)
class FacingParts:
    """Pairs of near parts i and j, in rows 0 and 1 of (2, n) arrays, with the faces that face each other."""

    parts: np.ndarray
    #: The face of each from which the other part is farthest, and how far [m]; negative where the parts overlap.
    lead: np.ndarray
    before: np.ndarray
    apart: np.ndarray  #: (n,) [m]: the larger of both
    faces: np.ndarray  #: the leading one, which separates the parts farther, and the face that opposes it best
    width: np.ndarray  #: (n,) [m], of the thinner of their blocks
    leading: np.ndarray  #: (n,) int: the leading face, the part before it, and the face of that which opposes it best
    part: np.ndarray
    answering: np.ndarray

    def __getitem__(self, chosen: np.ndarray) -> FacingParts:
        """Choose some of the pairs, by a mask or their numbers."""
        return FacingParts(*(value[..., chosen] for value in vars(self).values()))

    def faces_in_turn(self, placed: PlacedParts, resolved: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Yield pairs, (n_round,) int, and their two faces, (2, n_round), those that oppose better first.

        Round by round, of pairs that are not ``resolved``, (n,) bool, when it begins.
        """
        if len(self.part):
            yield np.arange(len(self.part)), self.faces
        faces_of_part, normals = placed.solids.faces_of_block, placed.faces.normals
        columns = []
        for row in (0, 1):
            k = np.flatnonzero((self.before[row] >= self.apart - ROUNDING * self.width) & ~resolved)
            part = self.parts[1 - row, k]
            owner, position = expand_ranges(np.diff(faces_of_part)[part])
            pair, opposed = k[owner], faces_of_part[part[owner]] + position
            faces = np.roll([self.lead[row, pair], opposed], row, axis=0)
            cosine = dot(*(taken(normals, face) for face in faces))
            # Neighbours across a corner open by nearly a right angle, and touch along an edge alone.
            new = (faces != self.faces[:, pair]).any(axis=0) & (cosine <= -0.5) & ~placed.parts.inner[opposed]
            columns.append((pair[new], faces[:, new], cosine[new]))
        pair, faces, cosine = (np.concatenate(column, axis=-1) for column in zip(*columns, strict=True))
        order = np.lexsort((*faces[::-1], cosine, pair))
        pair, faces = pair[order], faces[:, order]
        rank = np.arange(len(pair)) - np.searchsorted(pair, pair)
        for number in range(6):
            chosen = (rank == number) & ~resolved[pair]
            if chosen.any():
                yield pair[chosen], faces[:, chosen]


def face_separations(placed: PlacedParts, i: np.ndarray, j: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """How far, (n,) [m], convex parts j are before a face of parts i, the farthest; and that face, (n,) int.

    And how far before one inside the block: minus infinity where there is none.
    """
    solids, inner = placed.solids, placed.parts.inner
    apart, behind, leading = np.empty(len(i)), np.empty(len(i)), np.empty(len(i), dtype=np.int64)
    for k, face, vertex in alike((solids.faces_of_block, i), (solids.offsets, j), filled=True):
        distance = placed.before_faces(face, vertex)
        behind[k] = np.where(inner[face], distance, -np.inf).max(axis=1)
        apart[k], leading[k] = at_largest(np.where(inner[face], -np.inf, distance), face)
    return apart, behind, leading


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
    for k, own, other in alike((first, i), (first, j), filled=True):
        own, other = taken(once, own), taken(once, other)
        a, b = placed.starts(own), placed.starts(other)
        along_a, along_b = unit(placed.along(own)), unit(placed.along(other))
        normal = cross(along_a[:, :, None], along_b[:, None])
        separates = dot(normal, normal) > smallest_sine**2
        sides = placed.outward(other)[:, None] - placed.outward(own)[:, :, None]
        sense = np.sign(dot(normal, sides))
        normal, separates = unit(normal) * sense[..., None], separates & (sense != 0.0)
        for edges, along, side, axis in ((own, along_a, 1.0, 2), (other, along_b, -1.0, 1)):
            for of_face, sense in ((edges, 1.0), (solids.twins[edges], -1.0)):
                inward = sense * cross(taken(normals, solids.face_of_corner[of_face]), along)
                separates &= side * dot(np.expand_dims(inward, axis), normal) >= -ROUNDING
        distance = np.where(separates, dot(a[:, :, None] - b[:, None], normal), -np.inf).reshape(len(k), -1)
        pairs = np.repeat(own, other.shape[1], axis=1), np.tile(other, (1, own.shape[1]))
        apart[k], edge_i[k], edge_j[k] = at_largest(distance, *pairs)
    return apart, edge_i, edge_j


def near_parts(placed: PlacedParts, reach: float, useful: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Pairs of parts of two blocks, one useful, the lower first, whose boxes are within reach; the thinner's width."""
    block_of_part, widths = placed.parts.block_of_part, placed.parts.widths
    i, j = box_pairs(placed.vertices, placed.solids.offsets, reach)
    a, b = block_of_part[i], block_of_part[j]
    chosen = (a != b) & (useful[a] | useful[b])
    return i[chosen], j[chosen], np.minimum(widths[a], widths[b])[chosen]


def overlapping_parts(placed: PlacedParts, tolerance: float, useful: np.ndarray) -> tuple[np.ndarray, ...]:
    """Near parts, as of :func:`near_parts`, that overlap by more than a tolerance [m], and their depths, (n,) [m].

    Convex parts are separated by a face of one of them or by two edges across each other: the largest separation of
    these, negative, is the depth.
    """
    i, j, width = near_parts(placed, -tolerance, useful)
    apart = np.full(len(i), -np.inf)
    by_edges = partial(edge_separations, smallest_sine=ROUNDING)
    for of, kinds in ((face_separations, 2), (face_separations, 2), (by_edges, 1)):
        apart = np.max([apart, *of(placed, i, j)[:kinds]], axis=0)
        deep = apart < -tolerance
        i, j, width, apart = j[deep], i[deep], width[deep], apart[deep]
    return j, i, width, -apart


def _opposed_faces(placed: PlacedParts, leading: np.ndarray, j: np.ndarray) -> np.ndarray:
    """(n,) int array: the face of part j, not inside its block, that opposes the leading face best."""
    normals = placed.faces.normals
    opposed = np.empty(len(j), dtype=np.int64)
    for k, face in alike((placed.solids.faces_of_block, j), filled=True):
        against = -dot(taken(normals, face), taken(normals, leading[k])[:, None])
        _, opposed[k] = at_largest(np.where(placed.parts.inner[face], -np.inf, against), face)
    return opposed


def facing_parts(placed: PlacedParts, reach: float, useful: np.ndarray) -> FacingParts:
    """Choose the faces of near parts that face each other, where no face separates them farther than ``reach`` [m].

    One of two near parts must be of the useful blocks, (n_blocks,) bool array.
    """
    i, j, width = near_parts(placed, reach, useful)
    of_i = list(face_separations(placed, i, j))
    near = np.flatnonzero(np.maximum(*of_i[:2]) <= reach)
    i, j, width, *of_i = (value[near] for value in (i, j, width, *of_i))
    before, behind, lead = map(np.stack, zip(of_i, face_separations(placed, j, i), strict=True))
    apart = before.max(axis=0)
    inside = behind.max(axis=0) > apart + ROUNDING * width
    opposed = np.stack([_opposed_faces(placed, lead[1], i), _opposed_faces(placed, lead[0], j)])
    cosine = dot(placed.faces.normals[lead], placed.faces.normals[opposed[::-1]])
    equal = np.abs(before[0] - before[1]) <= ROUNDING * width
    i_leads = np.where(equal, cosine[0] <= cosine[1], before[0] > before[1])
    faces = np.where([i_leads, ~i_leads], lead, opposed)
    (leading, answering), part = (np.where(i_leads, pair, pair[::-1]) for pair in (faces, np.stack([j, i])))
    found = FacingParts(np.stack([i, j]), lead, before, apart, faces, width, leading, part[0], answering)
    return found[(before[1] <= reach) & ~inside]
