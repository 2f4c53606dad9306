"""A window of a drawing: what lies within it is read."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from solver.mechanics import counted

from .layout import Layout
from .left_out import LeftOut
from .notes import LEFT_OUT, Note
from .outlines import ROUNDING
from .units import doubt


def checked_window(window: Sequence[float] | None) -> tuple[float, ...]:
    """Return the corners x0, y0, x1, y1 of a window [m], () for none.

    ValueError for anything but two corners, the lower left one first.
    """
    if window is None or len(window) == 0:
        return ()
    corners = tuple(float(x) for x in window)
    if len(corners) != 4 or not np.isfinite(corners).all() or not (corners[0] < corners[2] and corners[1] < corners[3]):
        raise ValueError(f"window is {list(window)}; give [x0, y0, x1, y1] in m, with x0 < x1 and y0 < y1")
    return corners


def within_window(layout: Layout, window: Sequence[float]) -> Layout:
    """Keep what lies within a window; what crosses its edge is left out, and what lies beyond is counted in a note.

    The window is x0, y0, x1, y1 [m], or empty. ValueError, with from where to where the drawing goes, if no block lies
    within it.
    """
    if len(window) == 0:
        return layout
    low, high = np.array(window[:2]), np.array(window[2:])
    near = ROUNDING * float((high - low).max())

    def place(points: np.ndarray) -> str:
        if len(points) == 0 or (points.max(axis=0) <= low + near).any() or (points.min(axis=0) >= high - near).any():
            return "beyond"
        return "within" if (points >= low - near).all() and (points <= high + near).all() else "edge"

    of_blocks = [*map(place, layout.outlines)]
    if "within" not in of_blocks:
        every = np.concatenate([*layout.outlines, np.zeros((0, 2))])
        extent, remedy = "draws no block at all", "correct the window"
        if len(every):
            (x0, y0), (x1, y1) = every.min(axis=0), every.max(axis=0)
            extent = f"goes from ({x0:.6g}, {y0:.6g}) to ({x1:.6g}, {y1:.6g}) m"
            if layout.unit_by != "user":
                remedy = doubt(layout.unit, float(np.median(layout.sizes)), page=layout.unit_by == "page") or remedy
        asked = ", ".join(f"{x:.6g}" for x in window)
        raise ValueError(
            f"'{layout.source}': no block lies within the window [{asked}] m; the drawing {extent}: {remedy}"
        )
    # Mortar that is drawn as one surface reaches beyond: it says nothing of the joints within.
    beside = [(item, place(item.points)) for item in layout.left_out]
    left_out = tuple(
        item if where == "within" else LeftOut("edge", item.points, "", item.layer, item.name)
        for item, where in beside
        if where == "within" or (where == "edge" and item.closed and item.kind != "asked")
    )
    crossing = {i: LeftOut("edge", layout.outlines[i], "") for i, where in enumerate(of_blocks) if where == "edge"}
    n = of_blocks.count("beyond")
    said = f"window: {counted(n, 'outline')} beyond it {'was' if n == 1 else 'were'} left out"
    layout = replace(layout, left_out=left_out, notes=(*layout.notes, *([Note(LEFT_OUT, said)] if n else [])))
    cut = layout.leaving_out(crossing)
    kept = [k for k, where in enumerate(w for w in of_blocks if w != "edge") if where == "within"]
    return cut.chosen(kept)
