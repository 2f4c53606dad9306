"""Separations of convex parts by a face or by two edges, and the faces with which near parts face each other."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from .broad_phase import box_pairs, expand_ranges
from .convex_parts import PlacedParts
from .portions import alike
from .solids import ROUNDING, cross, dot, unit

#: Edges nearer to parallel than this sine have no common normal: they are clipped against each other.
SMALLEST_SINE = 0.05


@dataclass(frozen=True)
class FacingParts:
    """Pairs of near parts i and j, (n,) int arrays, with the faces that face each other."""

    i: np.ndarray
    j: np.ndarray
    #: The face of each from which the other part is farthest, and how far [m]; negative where the parts overlap.
    lead_i: np.ndarray
    lead_j: np.ndarray
    apart_i: np.ndarray
    apart_j: np.ndarray
    #: The leading one, which separates the parts farther, and the face that opposes it best.
    face_i: np.ndarray
    face_j: np.ndarray
    width: np.ndarray  #: [m], of the thinner of their blocks
    cosine: np.ndarray  #: between the two faces; -1 where they oppose each other
    leading: np.ndarray  #: the leading face, the part before it, and the face of that which opposes it best
    part: np.ndarray
    answering: np.ndarray

    def __getitem__(self, chosen: np.ndarray) -> FacingParts:
        """Choose some of the pairs, by a mask or their numbers."""
        return FacingParts(*(value[chosen] for value in vars(self).values()))

    @property
    def apart(self) -> np.ndarray:
        """(n,) array [m]: separation of the parts by a face; negative where they overlap."""
        return np.maximum(self.apart_i, self.apart_j)

    def other_faces(self, placed: PlacedParts) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
        """Yield pairs and their other faces, round by round, (n_round,) int arrays, those that oppose better first."""
        faces_of_part, normals = placed.solids.faces_of_block, placed.faces.normals
        equal = self.apart - ROUNDING * self.width
        columns = []
        for leading, lead, part, of_i in (
            (self.apart_i >= equal, self.lead_i, self.j, True),
            (self.apart_j >= equal, self.lead_j, self.i, False),
        ):
            k = np.flatnonzero(leading)
            owner, position = expand_ranges(np.diff(faces_of_part)[part[k]])
            pair = k[owner]
            opposed, first = faces_of_part[part[pair]] + position, lead[pair]
            face_i, face_j = (first, opposed) if of_i else (opposed, first)
            new = (face_i != self.face_i[pair]) | (face_j != self.face_j[pair])
            cosine = dot(normals[face_i], normals[face_j])
            # Neighbours across a corner open by nearly a right angle, and touch along an edge alone.
            new &= (cosine <= -0.5) & ~placed.parts.inner[opposed]
            columns.append((pair[new], face_i[new], face_j[new], cosine[new]))
        pair, face_i, face_j, cosine = (np.concatenate(column) for column in zip(*columns, strict=True))
        order = np.lexsort((face_j, face_i, cosine, pair))
        pair, face_i, face_j = pair[order], face_i[order], face_j[order]
        rank = np.arange(len(pair)) - np.searchsorted(pair, pair)
        for number in range(min(6, int(rank.max(initial=-1)) + 1)):
            chosen = rank == number
            yield pair[chosen], face_i[chosen], face_j[chosen]


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
                separates &= side * dot(np.expand_dims(inward, axis), normal) >= -ROUNDING
        distance = np.where(separates, dot(a[:, :, None] - b[:, None], normal), -np.inf).reshape(len(k), -1)
        farthest = distance.argmax(axis=1)
        row = np.arange(len(k))
        apart[k] = distance[row, farthest]
        edge_i[k], edge_j[k] = own[row, farthest // other.shape[1]], other[row, farthest % other.shape[1]]
    return apart, edge_i, edge_j


def near_parts(
    placed: PlacedParts, reach: float, useful: np.ndarray, widths: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Pairs of parts of two blocks, one useful, the lower first, whose boxes are within reach; the thinner's width."""
    block_of_part = placed.parts.block_of_part
    i, j = box_pairs(placed.vertices, placed.solids.offsets, reach)
    a, b = block_of_part[i], block_of_part[j]
    chosen = (a != b) & (useful[a] | useful[b])
    return i[chosen], j[chosen], np.minimum(widths[a], widths[b])[chosen]


def _opposed_faces(placed: PlacedParts, leading: np.ndarray, j: np.ndarray) -> np.ndarray:
    """(n,) int array: the face of part j, not inside its block, that opposes the leading face best."""
    normals = placed.faces.normals
    opposed = np.empty(len(j), dtype=np.int64)
    for k, face in alike((placed.solids.faces_of_block, j)):
        cosine = dot(normals[face], normals[leading[k]][:, None])
        opposed[k] = face[np.arange(len(k)), np.where(placed.parts.inner[face], np.inf, cosine).argmin(axis=1)]
    return opposed


def facing_parts(placed: PlacedParts, reach: float, useful: np.ndarray, widths: np.ndarray) -> FacingParts:
    """Choose the faces of near parts that face each other, where no face separates them farther than ``reach`` [m].

    One of two near parts must be of the useful blocks, (n_blocks,) bool array, which have widths (n_blocks,) [m].
    """
    i, j, width = near_parts(placed, reach, useful, widths)
    inner = placed.parts.inner
    apart_i, lead_i, behind_i = face_separations(placed, i, j, inner)
    near = np.flatnonzero(np.maximum(apart_i, behind_i) <= reach)
    i, j, apart_i, lead_i, behind_i, width = (value[near] for value in (i, j, apart_i, lead_i, behind_i, width))
    apart_j, lead_j, behind_j = face_separations(placed, j, i, inner)
    inside = np.maximum(behind_i, behind_j) > np.maximum(apart_i, apart_j) + ROUNDING * width
    opposed_j = _opposed_faces(placed, lead_i, j)
    opposed_i = _opposed_faces(placed, lead_j, i)
    normals = placed.faces.normals
    cosine_i, cosine_j = dot(normals[lead_i], normals[opposed_j]), dot(normals[lead_j], normals[opposed_i])
    equal = np.abs(apart_i - apart_j) <= ROUNDING * width
    i_leads = np.where(equal, cosine_i <= cosine_j, apart_i > apart_j)
    faces = np.where(i_leads, lead_i, opposed_i), np.where(i_leads, opposed_j, lead_j)
    cosine = np.where(i_leads, cosine_i, cosine_j)
    answer = (np.where(i_leads, *choice) for choice in ((lead_i, lead_j), (j, i), (opposed_j, opposed_i)))
    found = FacingParts(i, j, lead_i, lead_j, apart_i, apart_j, *faces, width, cosine, *answer)
    return found[(apart_j <= reach) & ~inside]
