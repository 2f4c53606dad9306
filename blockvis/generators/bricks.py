"""Bricks laid course by course, cut around openings, slivers joined to their neighbours."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import shapely

from blockvis.layout.outlines import pieces_of, without_collinear

from .patterns import SHORTEST_BRICK, coursed
from .slivers import without_slivers

#: All corners lie on a grid of this fraction of the brick height, so that cuts leave no slivers of rounding errors.
GRID = 1e-10

#: A piece lower than this fraction of a course, or smaller than this fraction of a brick, is joined to a neighbour.
LOWEST_BRICK = 0.3

#: So is a piece into which no circle of this fraction of the brick height in diameter fits, the end of a wedge; parts
#: narrower than this, and longer, are cut off.
NARROWEST = 0.25


@dataclass(frozen=True)
class Bond:
    """Bond of a wall, one of :data:`BONDS`, and size of its bricks [m]."""

    kind: str
    brick_length: float
    brick_height: float


def cut_bricks(
    bond: Bond, width: float, courses: int, rings: Sequence[np.ndarray]
) -> tuple[list[np.ndarray], list[int]]:
    """Lay the bricks of a wall of a width [m] and cut them along (n, 2) rings [m], inside of which there are none.

    Outlines, (n, 2) arrays [m], come course by course from the left, with the course of each from 0 at the bottom; the
    lower left corner of the wall is (0, 0). A sliver is joined to the neighbour with which it makes the most convex
    block.
    """
    height, grid = bond.brick_height, GRID * bond.brick_height
    boxes = shapely.set_precision(coursed(bond.kind, width, courses * height, (bond.brick_length, height), 0), grid)
    holes = shapely.union_all([shapely.Polygon(ring) for ring in rings])
    met = shapely.intersects(boxes, holes)
    cut = np.where(met, shapely.set_precision(shapely.difference(boxes, holes), grid), boxes)
    kept = [
        (part, round(box.bounds[1] / height)) for box, rest in zip(boxes, cut, strict=True) for part in pieces_of(rest)
    ]
    whole = without_slivers([shape for shape, _ in kept], lambda shape, _: _is_sliver(bond, shape), height, grid)
    laid = sorted(((shape, kept[piece][1]) for shape, piece in whole), key=lambda one: (one[1], one[0].bounds[:2]))
    outlines = [without_collinear(shapely.get_coordinates(shape)[:-1], 1e-9) for shape, _ in laid]
    return outlines, [course for _, course in laid]


def places_in(courses: Iterable[int]) -> list[str]:
    """Name the places of stones that are given from the left, by course and number in it, both from 1: "1-1", "1-2"."""
    counted: Counter[int] = Counter()
    found = []
    for course in courses:
        counted[course] += 1
        found.append(f"{course + 1}-{counted[course]}")
    return found


def _is_sliver(bond: Bond, shape: shapely.Polygon) -> bool:
    left, low, right, high = shape.bounds
    if right - left < SHORTEST_BRICK * bond.brick_length * (1.0 - 1e-9):
        return True
    if high - low < LOWEST_BRICK * bond.brick_height:
        return True
    if len(shape.exterior.coords) == 5 and shape.area > 0.999 * (right - left) * (high - low):
        return False
    return bool(shape.buffer(-NARROWEST / 2.0 * bond.brick_height).is_empty)
