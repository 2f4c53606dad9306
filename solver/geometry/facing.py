"""Faces with which near parts face each other."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from .broad_phase import box_pairs, expand_ranges
from .convex_parts import PlacedParts
from .portions import alike
from .separations import face_separations
from .solids import dot

#: Difference of separations, in widths, up to which they are equal, and the faces that oppose each other better lead.
SAME_SEPARATION = 1e-6


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
        equal = self.apart - SAME_SEPARATION * self.width
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
    inside = np.maximum(behind_i, behind_j) > np.maximum(apart_i, apart_j) + SAME_SEPARATION * width
    opposed_j = _opposed_faces(placed, lead_i, j)
    opposed_i = _opposed_faces(placed, lead_j, i)
    normals = placed.faces.normals
    cosine_i, cosine_j = dot(normals[lead_i], normals[opposed_j]), dot(normals[lead_j], normals[opposed_i])
    equal = np.abs(apart_i - apart_j) <= SAME_SEPARATION * width
    i_leads = np.where(equal, cosine_i <= cosine_j, apart_i > apart_j)
    faces = np.where(i_leads, lead_i, opposed_i), np.where(i_leads, opposed_j, lead_j)
    cosine = np.where(i_leads, cosine_i, cosine_j)
    found = FacingParts(i, j, lead_i, lead_j, apart_i, apart_j, *faces, width, cosine)
    return found[(apart_j <= reach) & ~inside]
