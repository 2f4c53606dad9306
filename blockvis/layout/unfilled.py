"""Walls drawn as outlines with openings and without stones: how a drawing shows that it holds such, in words."""

from __future__ import annotations

import shlex
from collections.abc import Iterable
from typing import Any

import numpy as np
import shapely

from .layout import Layout
from .outlines import share_in

#: Outlines within another are openings if they cover at most this fraction of it, and lie farther apart than this
#: fraction of their size: stones on a background lie closer.
COVERED, APART = 0.6, 0.1

#: How an icon draws what it shows, and the page around it.
WHITE, BLACK = "#ffffff", "#000000"

#: What a run makes of such a drawing.
COUNTED = "; as it is, what lies in it counts as blocks, and the wall as none"

#: More outlines than this in one wall are no openings.
MOST = 200


def walls_to_fill(layout: Layout, *, pages: bool = True) -> dict[str, str]:
    """Find layers, or else names, of walls that a drawing holds as outlines with openings, and say how to fill them.

    What is black, with all on it white, is no wall where such ``pages`` are not asked for: icons draw stones so.
    """
    if layout.dimension == 3 or layout.n_blocks > MOST:
        return {}
    # Of two points a hatch has an outline, too.
    blocks = [shapely.Polygon(ring if len(ring) > 2 else None) for ring in layout.outlines]
    blocks = [shape if shape.is_valid else shapely.Polygon() for shape in blocks]
    areas = shapely.area(blocks)
    found: dict[str, str] = {}
    counted, walls = np.zeros(layout.n_blocks, bool), list[Any]()
    # A letter beside stones has holes, too.
    least = float(np.median(shapely.area(blocks))) if blocks else 0.0
    for wall, label, holes, black in _possible_walls(layout, blocks):
        # Around a wall there may be a hatch of it, or the frame of the sheet.
        if not (wall.is_valid and 0.0 < wall.area >= least) or any(share_in(one, wall) > 0.99 for one in walls):
            continue
        small = np.flatnonzero(~counted & (areas > 0.0) & (areas < 0.9 * wall.area)).tolist()
        inside = [i for i in small if share_in(blocks[i], wall) > 0.99]
        is_page = black and inside and all(WHITE in layout.looks[i] for i in inside)
        if not _are_openings(wall, [blocks[i] for i in inside], holes) or (is_page and not pages):
            continue
        counted[inside] = True
        walls.append(wall)
        openings = shapely.union_all([*(blocks[i] for i in inside), *holes])
        found.setdefault(label, _words(layout.source, label, wall, openings) + COUNTED * bool(inside))
    return found


def _possible_walls(layout: Layout, blocks: list[Any]) -> list[tuple[Any, str, tuple[Any, ...], bool]]:
    """List shape, layer or name, holes, and whether it is black, of whatever may be a wall, the smallest first."""
    around: list[tuple[Any, str, tuple[Any, ...], bool]] = [
        (shapely.Polygon(item.points), item.layer or item.name, tuple(map(shapely.Polygon, item.holes)),
         BLACK in item.looks)
        for item in layout.left_out
        if item.closed and item.kind in ("background", "hole") and len(item.points) > 2
    ]  # fmt: skip
    labels = [group or name for group, name in zip(layout.groups, layout.names, strict=True)]
    around += [(blocks[i], label, (), BLACK in layout.looks[i]) for i, label in enumerate(labels)]
    return sorted(around, key=lambda one: float(one[0].area))


def _are_openings(wall: Any, shapes: list[Any], holes: Iterable[Any]) -> bool:
    """Whether outlines in a wall lie apart, as openings do and stones do not."""
    every = [*shapes, *holes]
    if not every or not all(hole.is_valid for hole in every):
        return False
    # A hole of a hatch may be drawn as an outline, too.
    unlike = list(shapely.get_parts(shapely.union_all(every)))
    if sum(shape.area for shape in unlike) > COVERED * wall.area or len(unlike) < len(shapes):
        return False
    size = float(np.median(np.sqrt(shapely.area(unlike))))
    return all(one.distance(other) > APART * size for k, one in enumerate(unlike) for other in unlike[:k])


def _words(source: str, label: str, wall: Any, openings: Any) -> str:
    number = len(shapely.get_parts(openings))
    rest = wall.difference(openings).area
    command = shlex.join(["blockvis", "bond", source or "DRAWING", "-o", "bricks.dxf", f"walls={label}"])
    return (
        f"an outline of {wall.area:.4g} m² on layer '{label}' with {number} opening{'s' if number > 1 else ''}, "
        f'{rest:.4g} m² of wall: fill it with a bond: {command}, or in a case [[bond]] walls = ["{label}"]'
    )
