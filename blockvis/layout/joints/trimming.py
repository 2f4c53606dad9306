"""Joints that no common line fits: one side extended to the other and cut along it, close corners merged."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import shapely
from scipy.cluster.hierarchy import fcluster, linkage
from scipy.spatial import cKDTree

from blockvis.layout.linked import middles
from blockvis.layout.outlines import largest_piece, rectangle, ring_of, without_collinear
from solver import mechanics

from .facing_edges import CLOSED, Edges, Facing
from .midlines import Line, moved_outlines, normal_form

#: Corners closer than this fraction of the joint thickness are merged where blocks were cut along each other.
MERGED = 0.2

#: A corner that would move by more than this many joint thicknesses is cut off: its edges are nearly parallel.
LONGEST_MITRE = 3.0


def extended_to_lines(
    base: list[np.ndarray],
    edges: Edges,
    found: Facing,
    uncommon: list[int],
    lines: dict[int, Line],
    anchored: np.ndarray,
    thickness: float,
) -> list[np.ndarray]:
    """Extend one edge of each stretch without a common line to the other one, and cut its block along it.

    ``base`` are outlines with the common lines applied, ``uncommon`` the stretches, ``thickness`` that of joints [m].
    """
    overshoot, strips = _extended_edges(edges, found, uncommon, lines, anchored, thickness)
    if not overshoot:
        return base
    further = dict(lines)
    for edge, distance in overshoot.items():
        normal, level = _outward_form(edges, lines, edge)
        further[edge] = Line([], normal, level + distance)
    extended_rings = moved_outlines(edges, further, 2.0 * LONGEST_MITRE * thickness)
    shapes = [shapely.Polygon(ring) for ring in base]
    tree = shapely.STRtree(shapes)
    final = list(base)
    changed = sorted({int(edges.block[edge]) for edge in overshoot})
    for block in changed:
        own = [edge for edge in overshoot if edges.block[edge] == block]
        strip = shapely.union_all(
            [_strip(edges, edge, stretch, thickness, overshoot[edge]) for edge in own for stretch in strips[edge]]
        )
        wide = shapely.Polygon(extended_rings[block]).buffer(0)
        shape = shapely.union_all([shapes[block].buffer(0), shapely.intersection(wide, strip)])
        others = [shapes[j].buffer(0) for j in tree.query(shape).tolist() if j != block]
        piece = largest_piece(shapely.difference(shape, shapely.union_all(others)))
        if not piece.is_empty:
            shapes[block] = piece
            final[block] = ring_of(piece)
    involved = np.unique(edges.block[np.append(found.edge_a[uncommon], found.edge_b[uncommon])])
    return merge_close_corners(
        final, involved.tolist(), anchored, MERGED * thickness, CLOSED * float(np.ptp(edges.start, axis=0).max())
    )


def _extended_edges(
    edges: Edges, found: Facing, uncommon: list[int], lines: dict[int, Line], anchored: np.ndarray, thickness: float
) -> tuple[dict[int, float], dict[int, list[np.ndarray]]]:
    """Choose the edges that are extended: by how much [m], and to which midlines, by the edge."""
    overshoot: dict[int, float] = {}
    strips: dict[int, list[np.ndarray]] = {}
    size = np.hypot(*(edges.end - edges.start).T)
    for k in uncommon:
        a, b = int(found.edge_a[k]), int(found.edge_b[k])
        extended, straight = (
            (a, b) if (anchored[edges.block[b]], size[b]) >= (anchored[edges.block[a]], size[a]) else (b, a)
        )
        normal, level = _outward_form(edges, lines, straight)
        target = found.midline[k] + (level - found.midline[k] @ normal)[:, None] * normal
        own_normal, own_level = _outward_form(edges, lines, extended)
        needed = float((target @ own_normal - own_level).max()) + 0.1 * thickness
        overshoot[extended] = max(overshoot.get(extended, 0.0), needed)
        strips.setdefault(extended, []).append(found.midline[k])
    return overshoot, strips


def separated(rings: list[np.ndarray], anchored: np.ndarray, thickness: float, closed: float) -> list[np.ndarray]:
    """Remove the overlaps beyond ``closed`` [m] that closing joints of a thickness [m] leaves where several meet.

    Where the joints of a crossing miss each other a little, its corners are merged; where blocks still overlap
    afterwards, the smaller one is cut, or the one that may change its outline.
    """
    first, second, _ = overlapping(rings, closed)
    if len(first) == 0:
        return rings
    rings = merge_close_corners(
        rings, sorted({*map(int, first), *map(int, second)}), anchored, MERGED * thickness, closed / 10.0
    )
    result = list(rings)
    for i, j, _ in zip(*overlapping(rings, closed), strict=True):
        shapes = {int(k): shapely.Polygon(result[k]).buffer(0) for k in (i, j)}
        small, large = sorted(shapes, key=lambda k: (bool(anchored[k]), shapes[k].area))
        if anchored[small]:
            continue
        piece = largest_piece(shapely.difference(shapes[small], shapes[large]))
        if not piece.is_empty:
            result[small] = ring_of(piece)
    return result


def overlapping(rings: Sequence[np.ndarray], closed: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Find pairs of outlines that overlap by more than ``closed`` [m], and how deep."""
    offsets = np.concatenate([[0], np.cumsum([len(ring) for ring in rings])])
    return mechanics.overlap_depths(np.concatenate(rings), offsets, closed)


def _outward_form(edges: Edges, lines: dict[int, Line], edge: int) -> tuple[np.ndarray, float]:
    """Give the normal, out of the block, and the level [m] of the line of an edge."""
    normal, level = normal_form(edges, lines, edge)
    along = edges.end[edge] - edges.start[edge]
    sign = 1.0 if normal @ np.array([along[1], -along[0]]) >= 0 else -1.0
    return sign * normal, sign * level


def _strip(edges: Edges, edge: int, stretch: np.ndarray, thickness: float, distance: float) -> Any:
    """Bound the area that an extended edge may take: in front of its stretch, and up to its ends if these are near."""
    start, along = edges.start[edge], edges.end[edge] - edges.start[edge]
    size = float(np.hypot(*along))
    along = along / size
    outward = np.array([along[1], -along[0]])
    first, last = np.sort((stretch - start) @ along)
    spare = max(0.5 * size, thickness)
    first = -2.0 * LONGEST_MITRE * thickness if first <= spare else first
    last = size + 2.0 * LONGEST_MITRE * thickness if size - last <= spare else last
    strip = rectangle(first, -thickness, last, 2.0 * thickness + distance)
    return shapely.Polygon(start + strip @ np.array([along, outward]))


def merge_close_corners(
    rings: list[np.ndarray], involved: list[int], anchored: np.ndarray, reach: float, closed: float
) -> list[np.ndarray]:
    """Merge corners closer than ``reach`` [m] that cutting leaves in the blocks involved, and in all that share them.

    Steps far smaller than a block are artefacts of cutting and mislead the search for contacts. Every corner within
    ``closed`` [m] of an edge of a neighbour is added to that neighbour first, so that both sides move alike.
    """
    tree = shapely.STRtree([shapely.Polygon(ring) for ring in rings])
    near = sorted({int(j) for i in involved for j in tree.query(shapely.Polygon(rings[i]).buffer(2 * reach))})
    points = np.concatenate([rings[i] for i in near])
    index = cKDTree(points)
    shared = {i: with_corners_on_edges(rings[i], points, index, max(10 * closed, 1e-7 * reach)) for i in near}
    movable = np.concatenate([np.zeros((0, 2)), *(shared[i] for i in involved if not anchored[i] and i in shared)])
    movable = np.unique(np.round(movable, 12), axis=0)
    if len(movable) < 2:
        return rings
    group = fcluster(linkage(movable, "complete"), reach, "distance")
    centre = middles(movable, group)
    anchors = [shared[i] for i in near if anchored[i]]
    if anchors:
        distance, nearest = cKDTree(np.concatenate(anchors)).query(centre)
        centre = np.where((distance <= reach)[:, None], np.concatenate(anchors)[nearest], centre)
    lookup, result, same = cKDTree(movable), list(rings), max(10 * closed, 1e-7 * reach)
    for i in near:
        if not anchored[i]:
            distance, nearest = lookup.query(shared[i])
            moved = np.where((distance <= same)[:, None], centre[group[nearest]], shared[i])
            result[i] = _merged(moved, rings[i], closed)
    return result


def _merged(moved: np.ndarray, ring: np.ndarray, closed: float) -> np.ndarray:
    """Return an outline with its corners moved, those at one place once, or as it was where that leaves none."""
    apart = np.hypot(*(moved - np.roll(moved, 1, axis=0)).T) > closed
    extent = float(np.ptp(moved, axis=0).max())
    if extent <= closed:
        # The joints are wider than the block: it keeps its outline, and the overlap is refused later, by name.
        return ring
    merged = without_collinear(moved[apart], 10 * closed / extent)
    return merged if len(merged) >= 3 and shapely.Polygon(merged).is_valid else ring


def with_corners_on_edges(ring: np.ndarray, points: np.ndarray, index: Any, closed: float) -> np.ndarray:
    """Add every given point within ``closed`` [m] of an edge of a ring to its corners; ``index`` is their cKDTree."""
    result = []
    for start, end in zip(ring, np.roll(ring, -1, axis=0), strict=True):
        along = end - start
        size = float(np.hypot(*along))
        candidates = points[index.query_ball_point((start + end) / 2.0, 0.5 * size + closed)]
        offset = candidates - start
        position = offset @ along / size
        aside = np.abs(offset[:, 0] * along[1] - offset[:, 1] * along[0]) / size
        inside = (aside <= closed) & (position > closed) & (position < size - closed)
        order = np.argsort(position[inside])
        result.append(start)
        for point in candidates[inside][order]:
            if np.hypot(*(point - result[-1])) > closed:
                result.append(point)
    return np.array(result)
