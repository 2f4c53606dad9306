"""Pieces too small to be laid, joined to their neighbours."""

from __future__ import annotations

import heapq
from collections.abc import Callable, Sequence

import numpy as np
import shapely

from blockvis.layout.outlines import pieces_of, touching

#: Pieces are joined along at least this fraction of the brick height, not where they touch at a corner,
LEAST_SHARED = 0.01

#: or along this fraction of the sliver's own perimeter: one so small that all its edges are shorter is joined, too.
LEAST_OF_PERIMETER = 0.05


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
