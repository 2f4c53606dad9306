"""Mortar joints: facing edges found, measured, and closed to the midline between them, so that faces meet.

A joint is a set of edges that face each other across a gap: one head joint, a whole bed joint, the wedge between two
voussoirs. Where one straight line runs midway between all of them, each moves onto that line, and the new corners
are where the moved edges meet; so facing edges coincide, T-junctions included, and outer edges keep their line.
Where no single line serves (the back of an arch under cut bricks), the less covered edge stays straight on its own
midline and the blocks that face it are extended and cut along it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from .outlines import without_collinear

__all__ = ["Closing", "Facing", "close_joints", "facing_edges", "proposed_thickness"]

#: Edges face each other when their outward normals point at each other within acos(0.8) = 37 degrees.
FACING = -0.8

#: One line serves several stretches of a joint where it leaves their midlines by no more than this fraction of the
#: gap: far enough from a half, at which an edge would have to move backwards or all the way.
SHARED_LINE = 0.3

#: A gap below this fraction of the size of the drawing is no gap: what drawing programs leave of rounding.
CLOSED = 1e-9

#: Corners closer than this fraction of the joint thickness become one where blocks were cut along each other.
WELD = 0.2

#: A moved corner farther than this many joint thicknesses from the drawn one is cut off: its edges are nearly parallel.
LONGEST_MITRE = 3.0


@dataclass(frozen=True)
class Facing:
    """Stretches along which an edge of one block faces an edge of another.

    An edge is named by the flat number of the corner it starts at.

    Attributes
    ----------
    edge_a, edge_b : (n,) int arrays
    gaps : (n, 2) array [m]
        Distance at both ends of the stretch, across its midline; negative where the blocks overlap.
    midline : (n, 2, 2) array [m]
        Both ends of the midline.
    lengths : (n,) array [m]
    """

    edge_a: np.ndarray
    edge_b: np.ndarray
    gaps: np.ndarray
    midline: np.ndarray
    lengths: np.ndarray

    def __len__(self) -> int:
        return len(self.edge_a)

    def chosen(self, keep: np.ndarray) -> Facing:
        """Only these stretches."""
        return Facing(self.edge_a[keep], self.edge_b[keep], self.gaps[keep], self.midline[keep], self.lengths[keep])


@dataclass(frozen=True)
class Closing:
    """Outlines with their joints closed.

    Attributes
    ----------
    outlines : tuple of (n, 2) arrays [m]
    n_joints : int
        Stretches that were open or overlapping.
    n_cut : int
        Stretches that no common line served; one side was cut along the other.
    largest_gap : float [m]
        Widest gap that was closed.
    residual : float [m]
        Widest gap or overlap left along them.
    """

    outlines: tuple[np.ndarray, ...]
    n_joints: int
    n_cut: int
    largest_gap: float
    residual: float


@dataclass(frozen=True)
class _Edges:
    """All edges of all outlines, counter-clockwise, flat."""

    start: np.ndarray
    end: np.ndarray
    block: np.ndarray
    offsets: np.ndarray

    @property
    def along(self) -> np.ndarray:
        d = self.end - self.start
        return d / np.hypot(*d.T)[:, None]


def _edges(outlines: Sequence[np.ndarray]) -> _Edges:
    counts = np.array([len(ring) for ring in outlines])
    offsets = np.concatenate([[0], np.cumsum(counts)])
    start = np.concatenate(outlines)
    following = np.arange(1, len(start) + 1)
    following[offsets[1:] - 1] = offsets[:-1]
    return _Edges(start, start[following], np.repeat(np.arange(len(counts)), counts), offsets)


def facing_edges(outlines: Sequence[np.ndarray], reach: float, overlap: float = 0.0) -> Facing:
    """Finds the stretches along which edges of different blocks face each other.

    Parameters
    ----------
    outlines : sequence of (n, 2) arrays [m]
        Counter-clockwise.
    reach : float [m]
        Widest gap.
    overlap : float [m]
        Deepest overlap.

    Notes
    -----
    A pair of edges is measured across the bisector of its two lines, so that both sides see the same midline. Of
    stretches that lie behind one another only the nearest counts.
    """
    import shapely

    edges = _edges(outlines)
    margin = max(reach, overlap) * 1.0001
    low, high = np.minimum(edges.start, edges.end) - margin / 2, np.maximum(edges.start, edges.end) + margin / 2
    tree = shapely.STRtree(shapely.box(low[:, 0], low[:, 1], high[:, 0], high[:, 1]))
    a, b = tree.query(tree.geometries)
    along = edges.along
    outward = np.stack([along[:, 1], -along[:, 0]], axis=1)
    keep = (a < b) & (edges.block[a] != edges.block[b])
    a, b = a[keep], b[keep]
    keep = (outward[a] * outward[b]).sum(axis=1) < FACING
    a, b = a[keep], b[keep]
    axis = along[a] - along[b]
    axis /= np.maximum(np.hypot(*axis.T), 1e-300)[:, None]
    normal = np.stack([axis[:, 1], -axis[:, 0]], axis=1)
    origin = edges.start[a]

    def measured(which: np.ndarray, index: str) -> tuple[np.ndarray, np.ndarray]:
        points = getattr(edges, index)[which] - origin
        return (points * axis).sum(axis=1), (points * normal).sum(axis=1)

    (a0, ha0), (a1, ha1) = measured(a, "start"), measured(a, "end")
    (b1, hb1), (b0, hb0) = measured(b, "start"), measured(b, "end")
    first, last = np.maximum(a0, b0), np.minimum(a1, b1)
    shortest = np.minimum(a1 - a0, b1 - b0)

    def heights(at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return (
            ha0 + (at - a0) / (a1 - a0) * (ha1 - ha0),
            hb0 + (at - b0) / (b1 - b0) * (hb1 - hb0),
        )

    full = last - first
    with np.errstate(divide="ignore", invalid="ignore"):
        gap_first, gap_last = np.subtract(*heights(first)[::-1]), np.subtract(*heights(last)[::-1])
        # Cut the stretch to where the gap is within bounds.
        slope = (gap_last - gap_first) / full
        for bound, sign in ((reach, 1.0), (-overlap, -1.0)):
            limit = first + (bound + sign * CLOSED * max(reach, overlap, 1e-300) - gap_first) / slope
            last = np.where((sign * gap_last > sign * bound) & np.isfinite(limit), np.minimum(last, limit), last)
            first = np.where((sign * gap_first > sign * bound) & np.isfinite(limit), np.maximum(first, limit), first)
        keep = (full > 1e-3 * shortest) & (last - first >= 0.5 * full)
        ends = [(at, *heights(at)) for at in (first, last)]
    gaps = np.stack([hb - ha for _, ha, hb in ends], axis=1)
    keep &= (gaps <= reach * (1 + 1e-6) + 1e-12).all(axis=1) & (gaps >= -overlap * (1 + 1e-6) - 1e-12).all(axis=1)
    middle = np.stack([origin + at[:, None] * axis + ((ha + hb) / 2)[:, None] * normal for at, ha, hb in ends], axis=1)
    found = Facing(a[keep], b[keep], gaps[keep], middle[keep], (last - first)[keep])
    return _nearest(found, edges)


def _nearest(found: Facing, edges: _Edges) -> Facing:
    """Without stretches that are seen through another block: those behind a nearer stretch of the same edge."""
    keep = np.ones(len(found), dtype=bool)
    mean = found.gaps.mean(axis=1)
    along = edges.along
    for side in (found.edge_a, found.edge_b):
        order = np.argsort(side, kind="stable")
        starts = np.flatnonzero(np.r_[True, side[order][1:] != side[order][:-1]])
        for first, last in zip(starts, np.r_[starts[1:], len(order)], strict=True):
            members = order[first:last]
            if len(members) < 2:
                continue
            at = np.sort((found.midline[members] - edges.start[side[members[0]]]) @ along[side[members[0]]], axis=1)
            shared = np.minimum(at[:, None, 1], at[None, :, 1]) - np.maximum(at[:, None, 0], at[None, :, 0])
            size = np.minimum(at[:, 1] - at[:, 0], (at[:, 1] - at[:, 0])[:, None])
            behind = (shared > 0.5 * size) & (mean[members][:, None] > mean[members][None, :])
            keep[members[behind.any(axis=1)]] = False
    return found.chosen(keep)


def proposed_thickness(outlines: Sequence[np.ndarray]) -> tuple[float, Facing]:
    """The joint thickness that closes all mortar joints of a drawing, and the stretches it was measured on.

    Parameters
    ----------
    outlines : sequence of (n, 2) arrays [m]
        Counter-clockwise.

    Returns
    -------
    thickness : float [m]
        0 where there are no gaps.
    open_stretches : Facing
        Those with a gap.

    Notes
    -----
    Looks as far as half of the width of the usual block (twice its area over its perimeter): a wider gap is an
    opening. The thickness is the widest gap found, rounded up to two digits.
    """
    edges = _edges(outlines)
    lengths = np.add.reduceat(np.hypot(*(edges.end - edges.start).T), edges.offsets[:-1])
    cross = edges.start[:, 0] * edges.end[:, 1] - edges.start[:, 1] * edges.end[:, 0]
    areas = np.add.reduceat(cross, edges.offsets[:-1]) / 2.0
    reach = 0.5 * float(np.median(2.0 * np.abs(areas) / lengths))
    found = facing_edges(outlines, reach)
    scale = float(np.ptp(edges.start, axis=0).max())
    widest = found.gaps.max(axis=1)
    found = found.chosen(widest > 10 * CLOSED * scale)
    if len(found) == 0:
        return 0.0, found
    largest = float(found.gaps.max())
    digit = 10.0 ** (math.floor(math.log10(largest)) - 1)
    return float(np.round(math.ceil(largest / digit - 1e-6) * digit, 12)), found


def close_joints(
    outlines: Sequence[np.ndarray],
    thickness: float,
    *,
    overlap: float = 0.0,
    anchored: np.ndarray | None = None,
) -> Closing:
    """Moves facing edges onto the line midway between them.

    Parameters
    ----------
    outlines : sequence of (n, 2) arrays [m]
        Counter-clockwise.
    thickness : float [m]
        Widest gap that is a joint.
    overlap : float [m]
        Deepest overlap that is resolved the same way.
    anchored : (n_blocks,) bool array, optional
        Blocks that keep their outline; what faces them comes all the way.

    Returns
    -------
    Closing
    """
    origin = np.concatenate(outlines).mean(axis=0)
    rings = [ring - origin for ring in outlines]
    still = np.zeros(len(rings), dtype=bool) if anchored is None else np.asarray(anchored, dtype=bool)
    edges = _edges(rings)
    scale = float(np.ptp(edges.start, axis=0).max())
    found = facing_edges(rings, thickness, overlap)
    found = found.chosen(~(still[edges.block[found.edge_a]] & still[edges.block[found.edge_b]]))
    closed = CLOSED * scale
    n_open = int((np.abs(found.gaps).max(axis=1) > closed).sum()) if len(found) else 0
    if n_open == 0:
        return Closing(tuple(outlines), 0, 0, 0.0, 0.0)
    lines, uncommon = _common_lines(found, edges, still, closed)
    base = _moved_outlines(edges, lines, LONGEST_MITRE * max(thickness, overlap))
    final = _cut(base, edges, found, uncommon, lines, still, max(thickness, overlap))
    left = facing_edges(final, thickness, max(overlap, closed))
    residual = float(np.abs(left.gaps).max()) if len(left) else 0.0
    return Closing(
        outlines=tuple(outlines[i] if still[i] else ring + origin for i, ring in enumerate(final)),
        n_joints=n_open,
        n_cut=len(uncommon),
        largest_gap=float(found.gaps.max()),
        residual=residual,
    )


@dataclass(frozen=True)
class _Line:
    """The line n·x = level that the edges of these stretches share."""

    stretches: list[int]
    normal: np.ndarray
    level: float
    anchored: bool = False

    def distances(self, points: np.ndarray) -> np.ndarray:
        return np.abs(points @ self.normal - self.level)


def _common_lines(found: Facing, edges: _Edges, still: np.ndarray, closed: float) -> tuple[dict[int, _Line], list[int]]:
    """A line for every edge that moves, shared by as many facing edges as one line serves.

    Returns
    -------
    lines : {edge: line}
    uncommon : list of int
        Stretches whose two edges got different lines.

    Notes
    -----
    Stretches are taken longest first; each joins the lines of its two edges into one where a straight fit through
    all their midlines stays within the fraction SHARED_LINE of every gap.
    """
    fixed = {side: still[edges.block[getattr(found, side)]] for side in ("edge_a", "edge_b")}
    middle = found.midline.copy()
    along = edges.along
    for side, chosen in fixed.items():
        edge = getattr(found, side)[chosen]
        t, p = along[edge][:, None, :], edges.start[edge][:, None, :]
        middle[chosen] = p + ((middle[chosen] - p) * t).sum(axis=2, keepdims=True) * t
    gaps = np.abs(found.gaps)
    allowed = SHARED_LINE * gaps + 0.05 * gaps.max(axis=1, keepdims=True) + closed
    allowed[fixed["edge_a"] | fixed["edge_b"]] = closed

    def fit(stretches: list[int], held: list[_Line]) -> _Line:
        for line in held:
            # A line that serves already stays what it is, to the last digit.
            if line.anchored or (line.distances(middle[stretches]) <= closed).all():
                return _Line(stretches, line.normal, line.level, line.anchored)
        points, weights = middle[stretches].reshape(-1, 2), np.repeat(found.lengths[stretches], 2)
        centre = weights @ points / weights.sum()
        normal = np.linalg.svd((points - centre) * np.sqrt(weights)[:, None], full_matrices=False)[2][-1]
        return _Line(stretches, normal, float(normal @ centre))

    owner: dict[int, _Line] = {}
    uncommon = []
    for k in np.argsort(-found.lengths, kind="stable"):
        pair = int(found.edge_a[k]), int(found.edge_b[k])
        held = [owner[edge] for edge in pair if edge in owner]
        if len(held) == 2 and held[0] is held[1]:
            continue
        for side, edge in zip(("edge_a", "edge_b"), pair, strict=True):
            if fixed[side][k] and edge not in owner:
                normal = np.array([along[edge][1], -along[edge][0]])
                held.append(_Line([], normal, float(normal @ edges.start[edge]), True))
        held.sort(key=lambda line: not line.anchored)
        line = fit([*(s for line in held for s in line.stretches), int(k)], held)
        if (line.distances(middle[line.stretches]) <= allowed[line.stretches]).all():
            for s in line.stretches:
                owner[int(found.edge_a[s])] = owner[int(found.edge_b[s])] = line
        else:
            uncommon.append(int(k))
    lonely: dict[int, list[int]] = {}
    for k in uncommon:
        for edge in (int(found.edge_a[k]), int(found.edge_b[k])):
            if edge not in owner and not still[edges.block[edge]]:
                lonely.setdefault(edge, []).append(k)
    owner.update({edge: fit(stretches, []) for edge, stretches in lonely.items()})
    lines = {
        edge: line
        for edge, line in owner.items()
        if (gaps[line.stretches] > closed).any() and not still[edges.block[edge]]
    }
    return lines, uncommon


def _moved_outlines(edges: _Edges, lines: dict[int, _Line], longest: float) -> list[np.ndarray]:
    """Outlines whose edges lie on the given lines; corners where consecutive edges meet."""
    rings = []
    for first, last in zip(edges.offsets[:-1], edges.offsets[1:], strict=True):
        members = list(range(first, last))
        if not any(edge in lines for edge in members):
            rings.append(edges.start[first:last])
            continue
        while True:
            ring, turned = _moved_ring(edges, lines, members, longest)
            if not turned or len(members) - len(turned) < 3:
                break
            # An edge shorter than what its neighbours move vanishes between them.
            members = [edge for edge in members if edge not in turned]
        rings.append(ring)
    return rings


def _moved_ring(
    edges: _Edges, lines: dict[int, _Line], members: list[int], longest: float
) -> tuple[np.ndarray, list[int]]:
    corners: list[list[np.ndarray]] = []
    for k, edge in enumerate(members):
        before = members[k - 1]
        drawn = (edges.end[before] + edges.start[edge]) / 2.0
        if before not in lines and edge not in lines and (edges.end[before] == edges.start[edge]).all():
            corners.append([drawn])
            continue
        (n0, c0), (n1, c1) = (_normal_form(edges, lines, one) for one in (before, edge))
        determinant = n0[0] * n1[1] - n0[1] * n1[0]
        if abs(determinant) > 0.05:
            meeting = np.array([c0 * n1[1] - c1 * n0[1], n0[0] * c1 - n1[0] * c0]) / determinant
            if np.hypot(*(meeting - drawn)) <= longest:
                corners.append([meeting])
                continue
        corners.append([drawn + (c0 - n0 @ drawn) * n0, drawn + (c1 - n1 @ drawn) * n1])
    turned = []
    for k, edge in enumerate(members):
        along = edges.end[edge] - edges.start[edge]
        if (corners[(k + 1) % len(members)][0] - corners[k][-1]) @ along <= 0:
            turned.append(edge)
    return np.array([corner for group in corners for corner in group]), turned


def _normal_form(edges: _Edges, lines: dict[int, _Line], edge: int) -> tuple[np.ndarray, float]:
    if edge in lines:
        return lines[edge].normal, lines[edge].level
    along = edges.end[edge] - edges.start[edge]
    normal = np.array([along[1], -along[0]]) / np.hypot(*along)
    return normal, float(normal @ edges.start[edge])


def _cut(
    base: list[np.ndarray],
    edges: _Edges,
    found: Facing,
    uncommon: list[int],
    lines: dict[int, _Line],
    still: np.ndarray,
    thickness: float,
) -> list[np.ndarray]:
    """Along stretches without a common line, extends the shorter edge and cuts it along the other one."""
    import shapely

    overshoot: dict[int, float] = {}
    strips: dict[int, list[np.ndarray]] = {}
    size = np.hypot(*(edges.end - edges.start).T)
    for k in uncommon:
        a, b = int(found.edge_a[k]), int(found.edge_b[k])
        extended, straight = (a, b) if (still[edges.block[b]], size[b]) >= (still[edges.block[a]], size[a]) else (b, a)
        if still[edges.block[extended]]:
            extended, straight = straight, extended
        normal, level = _outward_form(edges, lines, straight)
        target = found.midline[k] + (level - found.midline[k] @ normal)[:, None] * normal
        own_normal, own_level = _outward_form(edges, lines, extended)
        needed = float((target @ own_normal - own_level).max()) + 0.1 * thickness
        overshoot[extended] = max(overshoot.get(extended, 0.0), needed)
        strips.setdefault(extended, []).append(found.midline[k])
    if not overshoot:
        return base
    further = dict(lines)
    for edge, distance in overshoot.items():
        normal, level = _outward_form(edges, lines, edge)
        further[edge] = _Line([], normal, level + distance)
    extended_rings = _moved_outlines(edges, further, 2.0 * LONGEST_MITRE * thickness)
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
        near = [int(j) for j in tree.query(shape) if j != block]
        cut = shapely.difference(shape, shapely.union_all([shapes[j].buffer(0) for j in near]))
        pieces = [piece for piece in getattr(cut, "geoms", [cut]) if piece.geom_type == "Polygon"]
        if pieces:
            shapes[block] = shapely.Polygon(max(pieces, key=lambda piece: piece.area).exterior)
            final[block] = np.array(shapely.orient_polygons(shapes[block]).exterior.coords)[:-1]
    involved = {int(edges.block[edge]) for k in uncommon for edge in (found.edge_a[k], found.edge_b[k])}
    return _welded(final, sorted(involved), still, WELD * thickness, CLOSED * float(np.ptp(edges.start, axis=0).max()))


def _outward_form(edges: _Edges, lines: dict[int, _Line], edge: int) -> tuple[np.ndarray, float]:
    """The line of an edge with its normal out of the block."""
    normal, level = _normal_form(edges, lines, edge)
    along = edges.end[edge] - edges.start[edge]
    sign = 1.0 if normal @ np.array([along[1], -along[0]]) >= 0 else -1.0
    return sign * normal, sign * level


def _strip(edges: _Edges, edge: int, stretch: np.ndarray, thickness: float, distance: float) -> Any:
    """The ground that an extended edge may take: before its stretch, and on to its ends where little is left over."""
    import shapely

    start, along = edges.start[edge], edges.end[edge] - edges.start[edge]
    size = float(np.hypot(*along))
    along = along / size
    outward = np.array([along[1], -along[0]])
    first, last = np.sort((stretch - start) @ along)
    spare = max(0.5 * size, thickness)
    first = -2.0 * LONGEST_MITRE * thickness if first <= spare else first
    last = size + 2.0 * LONGEST_MITRE * thickness if size - last <= spare else last
    corners = [start + x * along + y * outward for x, y in ((first, 0.0), (last, 0.0), (last, 0.0), (first, 0.0))]
    reach = (2.0 * thickness + distance) * outward
    return shapely.Polygon(
        [corners[0] - thickness * outward, corners[1] - thickness * outward, corners[2] + reach, corners[3] + reach]
    )


def _welded(
    rings: list[np.ndarray], involved: list[int], still: np.ndarray, reach: float, closed: float
) -> list[np.ndarray]:
    """Draws corners that cutting has left close together to one point, in all blocks that share them.

    Parameters
    ----------
    rings : list of (n, 2) arrays [m]
    involved : list of int
        Blocks whose corners may move.
    still : (n_blocks,) bool array
        Blocks whose corners stay.
    reach : float [m]
        Corners closer than this become one.
    closed : float [m]
        A corner closer than this to an edge lies on it.

    Notes
    -----
    Steps far smaller than a block are no masonry and mislead the search for contacts. Every corner that lies on an
    edge of a neighbour is given to that neighbour first, so that both sides move alike.
    """
    import shapely
    from scipy.cluster.hierarchy import fcluster, linkage
    from scipy.spatial import cKDTree

    tree = shapely.STRtree([shapely.Polygon(ring) for ring in rings])
    near = sorted({int(j) for i in involved for j in tree.query(shapely.Polygon(rings[i]).buffer(2 * reach))})
    points = np.concatenate([rings[i] for i in near])
    index = cKDTree(points)
    shared = {i: _with_corners_on_edges(rings[i], points, index, max(10 * closed, 1e-7 * reach)) for i in near}
    movable = np.concatenate([shared[i] for i in involved if not still[i]])
    movable = np.unique(np.round(movable, 12), axis=0)
    if len(movable) < 2:
        return rings
    group = fcluster(linkage(movable, "complete"), reach, "distance")
    count = np.bincount(group)
    centre = np.stack([np.bincount(group, movable[:, axis]) / np.maximum(count, 1) for axis in (0, 1)], axis=1)
    anchors = [shared[i] for i in near if still[i]]
    if anchors:
        distance, nearest = cKDTree(np.concatenate(anchors)).query(centre)
        centre = np.where((distance <= reach)[:, None], np.concatenate(anchors)[nearest], centre)
    lookup = cKDTree(movable)
    result = list(rings)
    for i in near:
        if still[i]:
            continue
        distance, nearest = lookup.query(shared[i])
        moved = np.where((distance <= max(10 * closed, 1e-7 * reach))[:, None], centre[group[nearest]], shared[i])
        apart = np.hypot(*(moved - np.roll(moved, 1, axis=0)).T) > closed
        ring = without_collinear(moved[apart], 10 * closed / float(np.ptp(moved, axis=0).max()))
        if len(ring) >= 3 and shapely.Polygon(ring).is_valid:
            result[i] = ring
    return result


def _with_corners_on_edges(ring: np.ndarray, points: np.ndarray, index: Any, closed: float) -> np.ndarray:
    """The ring with every given point that lies on one of its edges as a corner."""
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
