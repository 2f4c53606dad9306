"""Outlines that cross or touch themselves: reduced to their largest piece where it is nearly all of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import shapely

from blockvis.text import place_text

from .layout import Layout
from .left_out import LeftOut
from .notes import CHANGED, Note
from .outlines import ROUNDING, around_hole, ends_of, pieces_of, ring_area, ring_of, without_collinear
from .surfaces import same_points

#: The largest piece of an outline that crosses itself is the block if it holds at least this share of its area.
WHOLE = 0.98


def uncrossed(layout: Layout) -> Layout:
    """Reduce outlines that cross or touch themselves to their largest piece, with a note, or leave them out.

    An outline without area stays: it is no crossing.
    """
    rings = [ring if len(ring) > 2 else np.zeros((3, 2)) for ring in layout.outlines]
    reasons: dict[int, LeftOut] = {}
    reduced: dict[int, np.ndarray] = {}
    places: dict[int, np.ndarray] = {}
    for i, corners in _turning_back(rings).items():
        places[i] = rings[i][corners[0]]
        while len(corners) and len(rings[i]) > 3:
            rings[i] = np.delete(rings[i], corners, axis=0)
            corners = _turning_back(rings[i : i + 1]).get(0, np.zeros(0, dtype=int))
        reduced[i] = rings[i] = without_collinear(rings[i])
    shapes = np.array([shapely.Polygon(ring) for ring in rings])
    lost = 0.0
    for i in np.flatnonzero(~shapely.is_valid(shapes)).tolist():
        pieces = pieces_of(shapely.make_valid(shapes[i]))
        area = float(sum(part.area for part in pieces))
        if not area > 0.0:
            continue
        piece = max(pieces, key=lambda part: part.area)
        largest = shapely.Polygon(piece.exterior)
        share = min(largest.area, area) / max(largest.area, area)
        if share < WHOLE:
            reasons[i] = _refusal(layout.names[i], layout.outlines[i], piece if largest.area > area else None, share)
            continue
        reduced[i] = without_collinear(ring_of(largest))
        lost = max(lost, 1.0 - share)
    if reduced:
        first = next(iter(reduced))
        at = place_text(places[first] if first in places else _crossing(layout.outlines[first]), 6)
        words, the = "1 outline crosses or touches itself, ", ""
        if len(reduced) > 1:
            words, the = f"{len(reduced)} outlines cross or touch themselves, ", "the first "
        gone = f", with up to {100.0 * lost:.2g} % of the area gone" if lost > 1e-6 else ""
        said = f"repaired: {words}{the}'{layout.names[first]}' at {at}; the largest piece was kept{gone}"
        blocks = tuple(reduced.get(i, ring) for i, ring in enumerate(layout.outlines))
        layout = replace(layout, blocks=blocks, notes=(*layout.notes, Note(CHANGED, said)))
    return layout.leaving_out(reasons)


def _turning_back(rings: Sequence[np.ndarray]) -> dict[int, np.ndarray]:
    """Numbers of the corners of each (n, 2) ring with an area at which its line comes back on itself, where it does.

    Such a spike has no width but that of rounding, so that the outline need not touch itself.
    """
    points, counts = np.concatenate([np.zeros((0, 2)), *rings]), np.array([len(ring) for ring in rings], dtype=int)
    ends = np.cumsum(counts)
    of, last, first = np.repeat(np.arange(len(rings)), counts), ends - 1, ends - counts
    following, before = np.arange(len(points)) + 1, np.arange(len(points)) - 1
    following[last], before[first] = first, last
    back, on = points[before] - points, points[following] - points
    extents = np.array([np.ptp(ring, axis=0).max() for ring in rings])
    areas = np.array([abs(ring_area(ring)) for ring in rings])
    across = np.abs(back[:, 0] * on[:, 1] - back[:, 1] * on[:, 0])
    shorter, longer = np.sort([np.hypot(*back.T), np.hypot(*on.T)], axis=0)
    near = ROUNDING * extents[of]
    turns = ((back * on).sum(axis=1) > 0.0) & (across <= near * longer) & (shorter > near)
    turns &= (areas > ROUNDING * extents**2)[of]
    return {int(i): np.flatnonzero(turns[first[i] : ends[i]]) for i in np.unique(of[turns])}


def _refusal(name: str, ring: np.ndarray, around: Any, share: float) -> LeftOut:
    """Say why an outline, (n, 2) array [m], cannot be reduced to its largest piece, which has too small a share.

    Or it goes in along a line ``around`` a hole and back: this polygon then.
    """
    if around is None:
        at = place_text(_crossing(ring), 6)
        message = (
            f"block '{name}' crosses itself at {at}, and its largest piece has only "
            f"{100.0 * share:.3g} % of its area; redraw it as one outline, or as several"
        )
        return LeftOut("crossing", ring, message)
    border, *holes = (np.array(one.coords)[:-1] for one in (around.exterior, *around.interiors))
    return around_hole(f"block '{name}'", border, holes)


def _crossing(ring: np.ndarray) -> np.ndarray:
    """(2,) array [m]: where an outline crosses itself first; its first corner where that is not known."""
    return next(iter(crossings_of(ring)), ring[0])


def crossings_of(ring: np.ndarray) -> np.ndarray:
    """(n, 2) array: where an outline meets itself."""
    if len(ring) < 3 or not np.isfinite(ring).all():
        return np.zeros((0, 2))
    lines = shapely.get_parts(shapely.node(shapely.LinearRing(ring)))
    ends = ends_of(map(shapely.get_coordinates, lines))
    same = same_points(ends, ROUNDING * float(np.ptp(ring, axis=0).max()))
    # A ring that is cut where it meets nothing has two ends there.
    places, counts = np.unique(same, return_counts=True)
    return np.asarray(ends[places[counts > 2]])
