"""Facing edges: which edges of different blocks face each other across a gap, and how wide the gap is."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely

from blockvis.layout.outlines import ring_width

#: Edges face each other when their outward normals point at each other within acos(0.8) = 37 degrees.
FACING = -0.8

#: Share of the length of all joints that is no wider than the proposed thickness, wedges apart.
JOINTS = 0.98

#: Gaps wider than this part of the width of a typical block are joints where they are mortar alone.
WIDEST_JOINT = 0.2

#: Gaps are mortar where this share of the length of all joints is open, or where this share of the open length has
#: as much on the other side of its block, more than beside a single row of stones; else they are openings, cracks or
#: wedges, and stay as drawn.
MORTAR_SHARE, OPPOSITE_SHARE = 0.15, 0.6

#: Wedges between voussoirs widen by up to this factor beyond the joints.
WEDGE = 1.5

#: Faces are parallel within this angle [rad]; a face is long from this fraction of the width of its block on.
PARALLEL, LONG = math.radians(3.0), 0.5

#: Gaps below this fraction of the size of the drawing are rounding errors of drawing programs, and count as closed.
CLOSED = 1e-9


@dataclass(frozen=True)
class Facing:
    """Stretches along which an edge of one block faces an edge of another.

    The number of an edge is that of the corner at which it starts, counted over all blocks. Gaps, (n, 2) [m], are at
    both ends of the stretch, across its midline, (n, 2, 2) [m], and negative where the blocks overlap; lengths are (n,)
    [m].
    """

    edge_a: np.ndarray
    edge_b: np.ndarray
    gaps: np.ndarray
    midline: np.ndarray
    lengths: np.ndarray

    @classmethod
    def none(cls) -> Facing:
        """Make no stretch."""
        number = np.zeros(0, dtype=np.int64)
        return cls(number, number, np.zeros((0, 2)), np.zeros((0, 2, 2)), np.zeros(0))

    def __len__(self) -> int:
        """Return the number of stretches."""
        return len(self.edge_a)

    def open(self, closed: float) -> tuple[int, float]:
        """Count the stretches that are open or overlap, by more than ``closed`` [m], and give the largest gap [m]."""
        n_open = int((np.abs(self.gaps).max(axis=1) > closed).sum())
        return n_open, float(self.gaps.max(initial=0.0, where=self.gaps > closed))

    def chosen(self, keep: np.ndarray) -> Facing:
        """Take only these stretches; ``keep`` is a (n,) bool array."""
        return Facing(self.edge_a[keep], self.edge_b[keep], self.gaps[keep], self.midline[keep], self.lengths[keep])


@dataclass(frozen=True)
class Edges:
    """All edges of all outlines, counter-clockwise, block after block: (n_edges, 2) ends [m], and the block of each.

    ``offsets``, (n_blocks + 1,), are the first edges of the blocks.
    """

    start: np.ndarray
    end: np.ndarray
    block: np.ndarray
    offsets: np.ndarray

    @property
    def directions(self) -> np.ndarray:
        """(n_edges, 2) array: unit vector from start to end."""
        d = self.end - self.start
        return d / np.hypot(*d.T)[:, None]


def edges_of(outlines: Sequence[np.ndarray]) -> Edges:
    """List the edges of outlines, (n, 2) arrays [m], counter-clockwise."""
    counts = np.array([len(ring) for ring in outlines])
    offsets = np.concatenate([[0], np.cumsum(counts)])
    start = np.concatenate(outlines)
    following = np.arange(1, len(start) + 1)
    following[offsets[1:] - 1] = offsets[:-1]
    return Edges(start, start[following], np.repeat(np.arange(len(counts)), counts), offsets)


def facing_edges(
    outlines: Sequence[np.ndarray], reach: float, overlap: float = 0.0, laid: np.ndarray | None = None
) -> Facing:
    """Find where edges of different blocks face each other: stretches with gaps, and overlaps, up to so much [m].

    The gap between two edges is measured across the bisector of their lines, so that both have the same midline. Of
    stretches that lie behind one another only the nearest counts.
    """
    edges = edges_of(outlines)
    margin = max(reach, overlap) * 1.0001
    low, high = np.minimum(edges.start, edges.end) - margin / 2, np.maximum(edges.start, edges.end) + margin / 2
    tree = shapely.STRtree(shapely.box(low[:, 0], low[:, 1], high[:, 0], high[:, 1]))
    a, b = tree.query(tree.geometries)
    directions = edges.directions
    outward = np.stack([directions[:, 1], -directions[:, 0]], axis=1)
    keep = (a < b) & (edges.block[a] != edges.block[b])
    a, b = a[keep], b[keep]
    keep = (outward[a] * outward[b]).sum(axis=1) < FACING
    a, b = a[keep], b[keep]
    axis = directions[a] - directions[b]
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
        return (ha0 + (at - a0) / (a1 - a0) * (ha1 - ha0), hb0 + (at - b0) / (b1 - b0) * (hb1 - hb0))

    full = last - first
    with np.errstate(divide="ignore", invalid="ignore"):
        gap_first, gap_last = np.subtract(*heights(first)[::-1]), np.subtract(*heights(last)[::-1])
        # Cut the stretch to where the gap is within bounds.
        slope = (gap_last - gap_first) / full
        for exact, sign in ((reach, 1.0), (-overlap, -1.0)):
            bound = exact + sign * 1e-6 * max(reach, overlap)
            limit = first + (bound - gap_first) / slope
            last, first = (
                np.where((sign * gap_last > sign * bound) & np.isfinite(limit), np.minimum(last, limit), last),
                np.where((sign * gap_first > sign * bound) & np.isfinite(limit), np.maximum(first, limit), first),
            )
        keep = (full > 1e-3 * shortest) & (last - first >= 0.5 * full)
        ends = [(at, *heights(at)) for at in (first, last)]
    gaps = np.stack([hb - ha for _, ha, hb in ends], axis=1)
    keep &= (gaps <= reach * (1 + 2e-6) + 1e-12).all(axis=1) & (gaps >= -overlap * (1 + 2e-6) - 1e-12).all(axis=1)
    middle = np.stack([origin + at[:, None] * axis + ((ha + hb) / 2)[:, None] * normal for at, ha, hb in ends], axis=1)
    if laid is not None:
        scale = float(np.ptp(edges.start, axis=0).max())
        keep &= ~(laid[edges.block[a]] & laid[edges.block[b]] & (gaps.max(axis=1) > CLOSED * scale))
    found = Facing(a[keep], b[keep], gaps[keep], middle[keep], (last - first)[keep])
    return _nearest(found, edges)


def _nearest(found: Facing, edges: Edges) -> Facing:
    """Drop stretches that face each other through another block: those behind a nearer stretch of the same edge."""
    keep = np.ones(len(found), dtype=bool)
    mean = found.gaps.mean(axis=1)
    directions = edges.directions
    for side in (found.edge_a, found.edge_b):
        order = np.argsort(side, kind="stable")
        starts = np.flatnonzero(np.r_[True, side[order][1:] != side[order][:-1]])
        for first, last in zip(starts, np.r_[starts[1:], len(order)], strict=True):
            members = order[first:last]
            if len(members) < 2:
                continue
            edge = side[members[0]]
            at = np.sort((found.midline[members] - edges.start[edge]) @ directions[edge], axis=1)
            shared = np.minimum(at[:, None, 1], at[None, :, 1]) - np.maximum(at[:, None, 0], at[None, :, 0])
            size = np.minimum(at[:, 1] - at[:, 0], (at[:, 1] - at[:, 0])[:, None])
            behind = (shared > 0.5 * size) & (mean[members][:, None] > mean[members][None, :])
            keep[members[behind.any(axis=1)]] = False
    return found.chosen(keep)


def proposed_thickness(outlines: Sequence[np.ndarray], laid: np.ndarray | None = None) -> tuple[float, Facing]:
    """Propose the thickness [m] that closes the joints of a drawing, 0 without gaps; and give the stretches with gaps.

    Edges face each other across at most half the width of a typical block (twice its area over its perimeter): a
    wider gap is an opening. Joints are longer than wide; what is not, such as the way across a crossing from one
    bevelled corner to another, says nothing of them. Of the joints, the share JOINTS of their length bounds the
    thickness, and wedges up to WEDGE times wider still belong to it; gaps above WIDEST_JOINT that are no mortar, as
    beside a pilaster, are none of them. The thickness is rounded up to two digits, and 0 where nothing else is open.
    """
    found = facing_edges(outlines, search_reach(outlines), laid=laid)
    scale = float(np.ptp(np.concatenate(outlines), axis=0).max())
    widest = found.gaps.max(axis=1)
    found = found.chosen(widest > 10 * CLOSED * scale)
    if len(found) == 0:
        return 0.0, found
    widest = found.gaps.max(axis=1)
    joints = found.lengths >= widest
    joints = joints if joints.any() else np.ones(len(found), dtype=bool)
    width, length, limit = widest[joints], found.lengths[joints], 2.0 * WIDEST_JOINT * search_reach(outlines)
    if (width > limit).any() and not is_mortar(open_shares(outlines, found, limit)):
        length = np.where(width > limit, 0.0, length)
    if not length.any():
        return 0.0, found
    common = common_width(width, length, JOINTS)
    return rounded_up(float(width[width <= WEDGE * common].max())), found


def common_width(widths: np.ndarray, lengths: np.ndarray, share: float) -> float:
    """Find the width [m] that bounds those of a share of the length of joints."""
    order = np.argsort(widths)
    summed = np.cumsum(lengths[order])
    return float(widths[order][np.searchsorted(summed, share * summed[-1])])


def search_reach(outlines: Sequence[np.ndarray]) -> float:
    """Find how far from each other edges are still looked for as sides of a joint [m]."""
    return 0.5 * float(np.median([ring_width(ring) for ring in outlines]))


def rounded_up(length: float) -> float:
    """Round a length [m] up to two digits."""
    digit = 10.0 ** (math.floor(math.log10(length)) - 1)
    return float(np.round(math.ceil(length / digit - 1e-6) * digit, 12))


def straight_share(outlines: Sequence[np.ndarray], found: Facing) -> float:
    """Share of the length of joints between straight faces, parallel or long beside their blocks; 1 without joints."""
    if len(found) == 0:
        return 1.0
    edges = edges_of(outlines)
    widths = np.array([ring_width(ring) for ring in outlines])
    cosine = -(edges.directions[found.edge_a] * edges.directions[found.edge_b]).sum(axis=1)
    narrower = np.minimum(widths[edges.block[found.edge_a]], widths[edges.block[found.edge_b]])
    straight = (cosine > math.cos(PARALLEL)) | (found.lengths > LONG * narrower)
    return float(found.lengths[straight].sum() / found.lengths.sum())


def open_shares(outlines: Sequence[np.ndarray], found: Facing, rounding: float) -> tuple[float, float]:
    """Share of the length of all joints that is open, and of the open length how much has as much opposite of it.

    Both are 1 without joints. Mortar lies on both sides of a block, a crack on one of them. ``found`` are stretches
    with a gap, as of :func:`proposed_thickness`; gaps up to the rounding [m] count as closed.
    """
    wide = found.chosen(found.gaps.max(axis=1) > rounding)
    length = float(wide.lengths.sum())
    every = length + float(facing_edges(outlines, rounding, rounding).lengths.sum())
    if not length:
        return (0.0, 0.0) if every else (1.0, 1.0)
    edges = edges_of(outlines)
    sides, lengths = np.concatenate([wide.edge_a, wide.edge_b]), np.tile(wide.lengths, 2)
    along = [np.bincount(edges.block[sides], lengths * axis) for axis in edges.directions[sides].T]
    return length / every, 1.0 - float(np.hypot(*along).sum() / lengths.sum())


def is_mortar(shares: tuple[float, float]) -> bool:
    """Whether gaps of these :func:`open_shares` are mortar."""
    return shares[0] >= MORTAR_SHARE or shares[1] >= OPPOSITE_SHARE
