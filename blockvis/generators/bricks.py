"""Bricks laid course by course, cut around openings, slivers joined to their neighbours."""

from __future__ import annotations

import heapq
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import shapely

from blockvis.layout.outlines import pieces_of, touching, without_collinear

from .patterns import SHORTEST_BRICK, coursed

#: All corners lie on a grid of this fraction of the brick height, so that cuts leave no slivers of rounding errors.
GRID = 1e-10

#: A piece lower than this fraction of a course, or smaller than this fraction of a brick, is joined to a neighbour.
LOWEST_BRICK = 0.3

#: So is a piece into which no circle of this fraction of the brick height in diameter fits, the end of a wedge; parts
#: narrower than this, and longer, are cut off.
NARROWEST = 0.25

#: Pieces are joined along at least this fraction of the brick height, not where they touch at a corner,
LEAST_SHARED = 0.01

#: or along this fraction of the sliver's own perimeter: one so small that all its edges are shorter is joined, too.
LEAST_OF_PERIMETER = 0.05


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


def without_slivers(
    shapes: Sequence[shapely.Polygon], is_sliver: Callable[[shapely.Polygon, int], bool], height: float, grid: float
) -> list[tuple[shapely.Polygon, int]]:
    """Join slivers to the neighbours with which they make the most convex blocks, the smallest first.

    ``is_sliver`` is asked of a shape and the number of the piece it is, or is mainly made of. Lengths are in m: shapes
    lie side by side, bricks have a height, and corners of joined pieces lie on a grid. What is left comes in the order
    of the pieces, with the one that is the largest part of each.
    """
    held: dict[int, shapely.Polygon] = dict(enumerate(shapes))
    main = list(range(len(shapes)))
    beside = touching(np.array(shapes), 0.0)
    small = [(shape.area, i) for i, shape in held.items() if is_sliver(shape, i)]
    heapq.heapify(small)
    while small:
        area, i = heapq.heappop(small)
        if i not in held or held[i].area != area:
            continue
        best = _best_neighbour(held, beside[i], i, height, grid)
        if best is None:
            continue
        k, whole = best
        main[k] = main[i] if area > held[k].area or (area == held[k].area and i < k) else main[k]
        held[k] = whole
        del held[i]
        for j in beside[i]:
            beside[j].discard(i)
            if j != k:
                beside[j].add(k)
                beside[k].add(j)
        if is_sliver(whole, main[k]):
            heapq.heappush(small, (whole.area, k))
    return [(shape, main[i]) for i, shape in sorted(held.items())]


def _best_neighbour(
    held: dict[int, shapely.Polygon], beside: set[int], sliver: int, height: float, grid: float
) -> tuple[int, shapely.Polygon] | None:
    """Find the neighbour with which a sliver makes the block that fills most of its convex hull, and that block."""
    shape = held[sliver]
    least = min(LEAST_SHARED * height, LEAST_OF_PERIMETER * shape.length)
    best, fullest = None, 0.0
    for i in sorted(beside):
        if shape.boundary.intersection(held[i].boundary).length < least:
            continue
        whole = shapely.union(shape, held[i], grid_size=grid)
        if whole.geom_type != "Polygon" or len(whole.interiors):
            continue
        filled = whole.area / whole.convex_hull.area
        if filled > fullest * (1.0 + 1e-9):
            best, fullest = (i, whole), filled
    return best


def in_simple_pieces(shape: shapely.Geometry, grid: float) -> list[shapely.Polygon]:
    """Split a shape into polygons without holes: one around a hole is cut in two through the middle of the hole."""
    pieces = pieces_of(shape)
    simple: list[shapely.Polygon] = []
    while pieces:
        piece = pieces.pop()
        if not len(piece.interiors):
            simple.append(piece)
            continue
        left, low, right, high = piece.bounds
        middle = float(np.mean(shapely.Polygon(piece.interiors[0]).bounds[::2]))
        for half in (shapely.box(left, low, middle, high), shapely.box(middle, low, right, high)):
            pieces += pieces_of(shapely.intersection(piece, half, grid_size=grid))
    return simple[::-1]
