"""Heads over openings of any outline: rings of voussoirs, flat arches, lintels, relieving arches."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

import numpy as np
import shapely

from blockvis.layout.outlines import pieces_of, ring_of

from .arches import flat_joints, segmental_joints, voussoir_outlines
from .openings import odd

#: Heads that an opening may be given.
HEADS = ("auto", "lintel", "flat arch", "arch", "none")

#: A top whose level part is longer than this fraction of the span is straight, whatever its corners are.
STRAIGHT = 0.5

#: Corners of an outline on an arc lie within this fraction of its radius.
ROUND = 4e-3

#: Depth of a lintel of at least a course, as a fraction of its span; joints of a flat arch lean by so much [degrees];
#: rise of a relieving arch as a fraction of its span.
LINTEL, SKEW, RELIEF = 0.12, 20.0, 1.0 / 6.0

#: Depth of a ring of stones that are longer, as a fraction of its span.
RING = 0.25

#: Fewest voussoirs of a ring.
LEAST = 5

#: Where there is no room a head is made smaller, down to these fractions of its depth and bearing.
DEPTHS, BEARINGS = (1.0, 0.75, 0.5), (1.0, 0.75, 0.5, 0.25, 0.1)

#: What is made of a head for which there is no room.
LESS = ("a shallower one, or one with less bearing", "a lintel instead of an arch")

#: What of a head may lie outside of the wall and is cut off, as a fraction of its area: rounding errors.
OUTSIDE = 1e-7


@dataclass(frozen=True)
class Units:
    """Sizes of the stones of heads [m]: the length of a stone, as deep as a ring may be, and the bearing of lintels.

    The height of a course is the width of a voussoir along the intrados, too. Corners lie on a grid.
    """

    length: float
    height: float
    bearing: float
    grid: float

    def depth_of_ring(self, span: float) -> float:
        """Depth of a ring of voussoirs, or of wedges [m]: a stone, and less of long stones over a short span."""
        return min(self.length, max(self.height, RING * span))

    def level_above(self, y: float, least: float, share: float) -> float:
        """Find the first joint of a course that lies so far above a level, or a little less; or go a share of that."""
        return self.height * math.ceil((y + least) / self.height - 0.4) if share == 1.0 else y + share * least


@dataclass(frozen=True)
class Top:
    """Upper edge of an opening, with its measures [m]."""

    chain: np.ndarray  #: (n, 2) array: from the left springing to the right one.
    left: float
    right: float
    span: float
    springing: float  #: Level of the lower end of the jambs.
    crown: float  #: Highest level.
    is_straight: bool  #: Whether most of it is level.


def top_of(opening: shapely.Polygon) -> Top:
    """Find the upper edge of an opening: its outline between the highest points of its jambs.

    Examples
    --------
    >>> top_of(shapely.box(0, 0, 1, 2)).chain.tolist()
    [[0.0, 2.0], [1.0, 2.0]]
    """
    ring = ring_of(opening)
    near = 1e-3 * float(np.ptp(ring[:, 0]))
    ends = []
    for side in (ring[:, 0] >= ring[:, 0].max() - near, ring[:, 0] <= ring[:, 0].min() + near):
        at = np.flatnonzero(side)
        ends.append(int(at[np.argmax(ring[at, 1])]))
    first, last = ends
    chain = np.roll(ring, -first, axis=0)[: (last - first) % len(ring) + 1][::-1]
    (left, start), (right, end) = chain[[0, -1]].tolist()
    run, rise = np.abs(np.diff(chain, axis=0)).T
    longest = run.max(initial=0.0, where=rise <= 1e-3 * (right - left))
    is_straight = len(chain) == 2 or bool(longest > STRAIGHT * (right - left))
    return Top(chain, left, right, right - left, min(start, end), float(chain[:, 1].max()), is_straight)


def head_of(
    opening: shapely.Polygon, kind: str, room: shapely.Geometry, near: float, units: Units
) -> tuple[str, list[shapely.Polygon], str] | None:
    """Build the head of an opening [m], where there is room [m]: wall and no other head.

    A curved top gets a ring of voussoirs, a lintel is cut to it; a straight top a lintel ("auto", "lintel"), wedges
    ("flat arch") or a relieving arch ("arch") over a stone. ``near`` is the distance to the next opening beside it [m].

    Returns
    -------
    (str, list of shapely.Polygon [m], str) or None
        "voussoir" or "lintel", the stones from left to right, and what was made of the head that is asked for, one of
        :data:`LESS`, "" where it fits; None where no head does.
    """
    top = top_of(opening)
    shapely.prepare(room)
    asked = ""
    for word, stones in _tried(top, kind, near, units):
        less = "" if not asked else LESS[0] if word == asked else LESS[1]
        asked = asked or word
        drawn = [shapely.difference(stone, opening, grid_size=units.grid) for stone in stones]
        pieces = [pieces_of(shapely.intersection(stone, room, grid_size=units.grid)) for stone in drawn]
        if not all(len(piece) == 1 and not len(piece[0].interiors) for piece in pieces):
            continue
        parts = [piece for (piece,) in pieces]
        if shapely.union_all(parts).area > (1.0 - OUTSIDE) * sum(stone.area for stone in drawn):
            return word, parts, less
    return None


def _tried(top: Top, kind: str, near: float, units: Units) -> Iterator[tuple[str, list[shapely.Polygon]]]:
    """Yield heads in the order in which they are tried: the one that is asked for, smaller ones, a lintel."""
    if not top.is_straight and kind != "lintel":
        for depth in DEPTHS:
            yield "voussoir", _ring(top, depth * units.depth_of_ring(top.span), units)
    if top.is_straight and kind == "flat arch":
        for depth in DEPTHS:
            yield "voussoir", _wedges(top, depth, units)
    if top.is_straight and kind == "arch":
        for bearing in BEARINGS[:3]:
            for depth in DEPTHS:
                reach, deep = min(bearing * units.bearing, near / 2.0), depth * units.depth_of_ring(top.span)
                yield "voussoir", _relief(top, reach, deep, units)
    reaches = [min(bearing * units.bearing, near / 2.0) for bearing in BEARINGS]
    for depth in DEPTHS:
        for reach in reaches:
            yield "lintel", [_lintel(top, (reach, reach), depth, units)]
    for left, right in product(reaches, reaches):
        yield "lintel", [_lintel(top, (left, right), DEPTHS[-1], units)]


def _lintel(top: Top, bearings: tuple[float, float], share: float, units: Units) -> shapely.Polygon:
    least = max(units.height, LINTEL * top.span)
    level = units.level_above(top.crown, least, share)
    return shapely.box(top.left - bearings[0], top.springing, top.right + bearings[1], level)


def _wedges(top: Top, share: float, units: Units) -> list[shapely.Polygon]:
    """Wedges of a flat arch, as those of rectangular walls."""
    depth = units.level_above(top.crown, units.depth_of_ring(top.span), share) - top.springing
    joints = flat_joints(top.left, top.left + top.span, top.springing, depth, SKEW, odd(top.span / units.height))
    return [shapely.Polygon(outline) for outline in voussoir_outlines(joints)]


def _relief(top: Top, bearing: float, depth: float, units: Units) -> list[shapely.Polygon]:
    """Make a relieving arch of the stone under it and its ring."""
    span = top.span + 2.0 * bearing
    joints, _ = segmental_joints(span, RELIEF * span, depth, odd(1.05 * span / units.height))
    joints = joints + np.array([(top.left + top.right) / 2.0, top.crown])
    ring = [shapely.Polygon(outline) for outline in voussoir_outlines(joints)]
    return [*ring, shapely.Polygon(joints[:, 0])]


def _ring(top: Top, depth: float, units: Units) -> list[shapely.Polygon]:
    """Voussoirs around a curved top, their joints across it, their soffits as drawn."""
    lengths = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(top.chain, axis=0).T))])
    n = max(LEAST, odd(lengths[-1] / units.height))
    places = np.linspace(0.0, lengths[-1], n + 1)
    nearest = lengths[np.abs(lengths - places[:, None]).argmin(axis=1)]
    # A joint beside a corner of the outline goes through it: no edge is much shorter than a voussoir.
    places = np.where(np.abs(nearest - places) < 0.15 * lengths[-1] / n, nearest, places)
    inner = _along(top.chain, lengths, places)
    outer = inner + depth * _normals(top.chain, lengths, places, inner)
    stones = []
    for k in range(n):
        between = top.chain[(lengths > places[k] + 1e-12) & (lengths < places[k + 1] - 1e-12)]
        stones.append(shapely.Polygon([inner[k], *between, inner[k + 1], outer[k + 1], outer[k]]))
    return stones if all(stone.is_valid for stone in stones) else []


def _along(chain: np.ndarray, lengths: np.ndarray, places: np.ndarray) -> np.ndarray:
    return np.stack([np.interp(places, lengths, chain[:, k]) for k in (0, 1)], axis=1)


def _normals(chain: np.ndarray, lengths: np.ndarray, places: np.ndarray, inner: np.ndarray) -> np.ndarray:
    """(n, 2) array: directions outwards across a curve; radial where its corners lie on a circle."""
    centre, radius = _circle(chain)
    away = inner - centre
    distance = np.hypot(*away.T)
    if (np.abs(np.hypot(*(chain - centre).T) - radius) <= ROUND * radius).all():
        return away / distance[:, None]
    step = 0.5 * float(np.diff(places).mean())
    along = _along(chain, lengths, places + step) - _along(chain, lengths, places - step)
    return np.stack([-along[:, 1], along[:, 0]], axis=1) / np.hypot(*along.T)[:, None]


def _circle(points: np.ndarray) -> tuple[np.ndarray, float]:
    """Fit a circle to points, in the sense of least squares of their powers."""
    middle = points.mean(axis=0)
    x = points - middle
    matrix = np.column_stack([2.0 * x, np.ones(len(x))])
    u, v, c = np.linalg.lstsq(matrix, (x**2).sum(axis=1), rcond=None)[0]
    return middle + np.array([u, v]), math.sqrt(max(c + u * u + v * v, 0.0))
