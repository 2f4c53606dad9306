"""Brick walls with openings on a ground of which a part settles: wall, façade, panel."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import combinations
from typing import Any

import numpy as np
import shapely
import shapely.affinity

import solver
from blockvis.layout.outlines import ROUNDING, rectangle
from solver import mechanics
from solver.mechanics import counted

from .arches import segmental_joints
from .assembled import assembled
from .bricks import LOWEST_BRICK, Bond, cut_bricks, places_in
from .dimensions import MOST_BLOCKS, above_zero, choice, finite, pair, whole
from .openings import Opening, checked_opening, head_joints_of, head_outlines, opening_ring
from .patterns import BONDS, SHORTEST_BRICK


def wall(
    *,
    bricks: int | None = None,
    courses: int | None = None,
    width: float | None = None,
    height: float | None = None,
    brick_length: float = 0.25,
    brick_height: float = 0.1,
    bond: str = "running",
    openings: Sequence[Mapping[str, Any]] = (),
    settling: Sequence[float] | None = None,
    density: float = 1800.0,
    depth: float = 0.25,
) -> solver.Assembly:
    """Build a brick wall with openings on a ground of which a part may settle.

    Parameters
    ----------
    bricks, courses : int, optional
        Brick lengths along the wall, and courses; 12 and 18 by default.
    width, height : float [m], optional
        Instead of bricks and courses; at a width that is no whole number of bricks the last ones are cut, a height must
        be a whole number of courses.
    brick_length, brick_height : float [m]
    bond : {"running", "stack", "english"}
    openings : sequence of mappings
        Each with ``x``, ``y`` (lower left corner), ``width`` and ``height`` [m] and a ``head``: "lintel", "flat
        arch", "segmental arch", "round arch" or "none"; see :class:`~blockvis.generators.openings.Opening` for the
        other keys. Arches spring at the top of the rectangle.
    settling : (float, float) [m], optional
        The ground from the first x to the second is a moving support; all of it is fixed by default.
    density : float [kg/m³]
    depth : float [m]
        Out of plane.

    Returns
    -------
    solver.Assembly
        "brick 1-1" (course from the bottom, position from the left) ..., "lintel 2" or "voussoir 2-1" ... over the
        second opening, and the ground: "ground", or "ground left", "ground middle" and "ground right". The lower
        left corner of the wall is (0, 0).

    Raises
    ------
    ValueError
        For dimensions that are no positive numbers, and for openings outside the wall or across each other.

    Examples
    --------
    >>> window = {"x": 1.0, "y": 0.6, "width": 1.0, "height": 0.6, "head": "segmental arch", "voussoirs": 9}
    >>> wall(bricks=12, courses=18, openings=[window], settling=[1.5, 3.0]).names[-1]
    'ground right'
    """
    bonded = Bond(
        choice("bond", bond, BONDS), above_zero("brick_length", brick_length), above_zero("brick_height", brick_height)
    )
    width, courses = _size(bonded, bricks, courses, width, height)
    if courses * width / bonded.brick_length > MOST_BLOCKS:
        raise ValueError(
            f"the wall has {courses:g} courses of {width / bonded.brick_length:.4g} bricks; a layout has at most "
            f"{MOST_BLOCKS} blocks"
        )
    height = courses * bonded.brick_height
    holes = _placed(bonded, openings, width, height)
    rings = [opening_ring(opening, joints) for opening, joints in holes]
    _check_room(bonded, rings, width, height)
    outlines, courses_of = cut_bricks(bonded, width, courses, rings)
    free = [(f"brick {place}", outline) for place, outline in zip(places_in(courses_of), outlines, strict=True)]
    materials = ["brick"] * len(free)
    for number, (opening, joints) in enumerate(holes, start=1):
        heads = head_outlines(opening, joints)
        free += [
            (f"voussoir {number}-{i}" if joints is not None else f"lintel {number}", outline)
            for i, outline in enumerate(heads, start=1)
        ]
        materials += ["stone"] * len(heads)
    ground = _ground(width, bonded.brick_length, settling)
    return assembled(free, ground, density=density, depth=depth, material=materials)


def facade(
    *,
    bricks: int = 40,
    courses: int = 48,
    brick_length: float = 0.25,
    brick_height: float = 0.125,
    storeys: int = 2,
    windows: int = 2,
    window_bricks: float = 8.0,
    window_courses: int = 12,
    sill_courses: int = 5,
    voussoirs: int = 15,
    rise_courses: float = 2.5,
    settling_from: float | None = None,
    density: float = 1800.0,
    depth: float = 0.25,
) -> solver.Assembly:
    """Build a façade in running bond with rows of windows under segmental arches; its right part settles.

    Parameters
    ----------
    bricks, courses : int
        Brick lengths along the façade, and courses.
    storeys, windows : int
        Rows of windows, and windows in each.
    window_bricks : float
        Width of a window in brick lengths.
    window_courses, sill_courses : int
        Height of a window to the springing of its arch, and of the wall under its sill from the floor, in courses.
    voussoirs : int
        Of each arch, which is one brick thick.
    rise_courses : float
        Rise of each arch at the intrados, in courses.
    settling_from : float [m], optional
        The ground from this x to the right is a moving support; the right third by default.
    brick_length, brick_height, density, depth
        As in :func:`wall`.

    Returns
    -------
    solver.Assembly
        As :func:`wall`; windows are numbered from the left, storey by storey.

    Examples
    --------
    >>> house = facade(bricks=20, courses=24, storeys=1, windows=1)
    >>> house.names[-2:]
    ('ground left', 'ground right')
    """
    n, rows = whole("bricks", bricks, 2), whole("courses", courses, 1)
    length, course = above_zero("brick_length", brick_length), above_zero("brick_height", brick_height)
    storeys, windows = whole("storeys", storeys, 1), whole("windows", windows, 0)
    span = above_zero("window_bricks", window_bricks, "brick lengths")
    high, sill = whole("window_courses", window_courses, 1), whole("sill_courses", sill_courses, 0)
    rise = course * above_zero("rise_courses", rise_courses, "courses")
    if rise > length * span / 2.0:
        raise ValueError(
            f"rise_courses is {rise_courses:g}, {rise:g} m over windows of {length * span:g} m; give at most "
            f"{length * span / 2.0 / course:.4g}"
        )
    pier = (n - windows * span) / (windows + 1)
    if pier < 1.0:
        raise ValueError(
            f"bricks is {n}, too few for {counted(windows, 'window')} of {span:g} bricks with a brick on either "
            f"side; give at least {int(np.ceil(windows * span + windows + 1))}"
        )
    arch, _ = segmental_joints(length * span, rise, length, whole("voussoirs", voussoirs, 2))
    # A storey up to the crown of its arches, in courses.
    storey_high = sill + high + arch[:, 1, 1].max() / course
    if windows and (storeys - 1) * (rows // storeys) + storey_high > rows * (1.0 + 1e-9):
        raise ValueError(
            f"courses is {rows}, too few for {counted(storeys, 'storey')} of {storey_high:.4g} courses to the crown "
            f"of their arches; give at least {storeys * int(np.ceil(storey_high))}"
        )
    openings = [
        {
            "x": length * round(2.0 * (pier + i * (pier + span))) / 2.0,
            "y": course * (storey * (rows // storeys) + sill),
            "width": length * span,
            "height": course * high,
            "head": "segmental arch",
            "rise": rise,
            "depth": length,
            "voussoirs": voussoirs,
        }
        for storey in range(storeys)
        for i in range(windows)
    ]
    over = rows - (storeys - 1) * (rows // storeys) - storey_high
    if windows and 1e-6 < over < LOWEST_BRICK:
        raise ValueError(
            f"rise_courses is {rise_courses:g}, so that the arches leave {over:.3g} of a course over them; give "
            f"at most {rise_courses + over - LOWEST_BRICK:.4g}, or other courses"
        )
    start = 2.0 / 3.0 * n * length if settling_from is None else finite("settling_from", settling_from)
    if start >= n * length:
        raise ValueError(f"settling_from is {start:g} m; give an x left of the end of the façade at {n * length:g} m")
    return wall(
        bricks=n,
        courses=rows,
        brick_length=length,
        brick_height=course,
        openings=openings,
        settling=(start, n * length),
        density=density,
        depth=depth,
    )


def panel(
    *,
    nb: int = 5,
    nc: int = 6,
    x_s: float | None = None,
    block_height: float = 1.0,
    density: float = 2000.0,
    depth: float = 1.0,
) -> solver.Assembly:
    """Build a running-bond panel of blocks twice as long as high, on a base that settles to the right of x_s.

    Parameters
    ----------
    nb, nc : int
        Blocks along the panel, and courses; courses of whole blocks, the first at the bottom, alternate with courses
        that start and end with a half block.
    x_s : float [m], optional
        The base is fixed under x < x_s and moves under x > x_s; the middle by default.
    block_height : float [m]
    density, depth
        As in :func:`wall`.

    Returns
    -------
    solver.Assembly
        As :func:`wall`.

    Examples
    --------
    >>> panel(nb=3, nc=4, x_s=3.0).n_blocks
    16
    """
    high, n = above_zero("block_height", block_height), whole("nb", nb, 1)
    width = 2.0 * high * n
    start = width / 2.0 if x_s is None else finite("x_s", x_s)
    if not 0.0 < start < width:
        raise ValueError(f"x_s is {start:g} m; give an x inside the panel, between 0 and {width:g} m")
    return wall(
        bricks=n,
        courses=whole("nc", nc, 1),
        brick_length=2.0 * high,
        brick_height=high,
        settling=(start, width),
        density=density,
        depth=depth,
    )


def _size(
    bond: Bond, bricks: int | None, courses: int | None, width: float | None, height: float | None
) -> tuple[float, int]:
    """Width [m] and courses of a wall."""
    for size, number, names in ((width, bricks, "width and bricks"), (height, courses, "height and courses")):
        if size is not None and number is not None:
            raise ValueError(f"{names} are both given, {size:g} m and {number}; give one of them")
    if width is None:
        width = whole("bricks", 12 if bricks is None else bricks, 1) * bond.brick_length
    width = above_zero("width", width)
    if width < 0.5 * bond.brick_length:
        raise ValueError(f"width is {width:g} m, less than half a brick; give at least {0.5 * bond.brick_length:g} m")
    if height is None:
        return width, whole("courses", 18 if courses is None else courses, 1)
    fitting = above_zero("height", height) / bond.brick_height
    if round(fitting) < 1 or abs(fitting - round(fitting)) > 1e-6:
        near = sorted({max(1, int(np.floor(fitting))), int(np.ceil(fitting))})
        raise ValueError(
            f"height is {height:g} m, {fitting:.4g} courses of {bond.brick_height:g} m; give "
            f"{' or '.join(f'{k * bond.brick_height:g}' for k in near)} m, or another brick_height"
        )
    return width, round(fitting)


def _placed(
    bond: Bond, openings: Sequence[Mapping[str, Any]], width: float, height: float
) -> list[tuple[Opening, np.ndarray | None]]:
    """Make the openings, with the joints of their voussoirs, and check them against the wall."""
    if isinstance(openings, (str, Mapping)) or not isinstance(openings, Sequence):
        raise ValueError(f"openings is {openings!r}; give a list of tables with x, y, width, height and head")
    placed = []
    for number, values in enumerate(openings, start=1):
        opening = checked_opening(
            values, number, brick_length=bond.brick_length, brick_height=bond.brick_height, wall_height=height
        )
        where, right = f"opening {number}", opening.x + opening.width
        if right > width * (1.0 + 1e-9):
            raise ValueError(
                f"{where} ends at x = {right:g} m, outside the wall of {width:g} m; move it or widen the wall"
            )
        if opening.top > height * (1.0 + 1e-9):
            raise ValueError(f"{where} ends at y = {opening.top:g} m, above the wall of {height:g} m; lower it")
        sides = (("on its left", opening.x), ("on its right", width - right))
        _refuse_rest(where, sides, 1e-9 * width, SHORTEST_BRICK * bond.brick_length)
        opening = _on_joints(bond, opening)
        placed.append((opening, head_joints_of(opening)))
    return placed


def _on_joints(bond: Bond, opening: Opening) -> Opening:
    """Move the edges of an opening onto the joints of the bond that they miss by a rounding error."""

    def moved(value: float, spacing: float) -> float:
        nearest = round(value / spacing) * spacing
        return nearest if abs(value - nearest) <= ROUNDING * spacing else value

    x, y = moved(opening.x, bond.brick_length / 4.0), moved(opening.y, bond.brick_height)
    right = moved(opening.x + opening.width, bond.brick_length / 4.0)
    top = moved(opening.top, bond.brick_height)
    rise = (right - x) / 2.0 if opening.head == "round arch" else opening.rise
    return replace(opening, x=x, y=y, width=right - x, height=top - y, rise=rise)


def _check_room(bond: Bond, rings: Sequence[np.ndarray], width: float, height: float) -> None:
    """Refuse openings that leave the wall, or less than a brick above, below or between them, or overlap by heads."""
    least, narrowest = LOWEST_BRICK * bond.brick_height, SHORTEST_BRICK * bond.brick_length
    small = 1e-9 * max(width, height)
    for number, ring in enumerate(rings, start=1):
        low, high = ring.min(axis=0), ring.max(axis=0)
        if low[0] < -small or high[0] > width + small or high[1] > height + small:
            raise ValueError(
                f"opening {number} with its head reaches from x = {low[0]:g} to {high[0]:g} m and up to "
                f"y = {high[1]:g} m, "
                f"outside the wall of {width:g} × {height:g} m; move it, or choose another head"
            )
        _refuse_rest(f"opening {number}", (("under its sill", low[1]), ("above it", height - high[1])), small, least)
    shapes = [shapely.Polygon(ring) for ring in rings]
    for i, j in combinations(range(len(shapes)), 2):
        shared = shapes[i].intersection(shapes[j]).area
        if shared > small * max(width, height):
            raise ValueError(
                f"opening {i + 1} and opening {j + 1} overlap by {shared:.3g} m², heads included; move them apart"
            )
        rest = shapes[i].distance(shapes[j])
        for way in ((-narrowest, 0.0), (narrowest, 0.0), (0.0, -least), (0.0, least)):
            met = shapely.affinity.translate(shapes[i], *way).intersection(shapes[j])
            if rest > small and met.area > small * max(width, height):
                raise ValueError(
                    f"opening {i + 1} and opening {j + 1} leave {rest:.4g} m of wall between them, heads included; "
                    f"leave at least {max(map(abs, way)):g} m, or nothing"
                )


def _refuse_rest(where: str, rests: Sequence[tuple[str, float]], small: float, least: float) -> None:
    """Refuse an opening that leaves less wall than the least [m] at some place, but for what is no wall, so small."""
    for place, rest in rests:
        if small < rest < least:
            raise ValueError(f"{where} leaves {rest:.4g} m of wall {place}; leave at least {least:g} m, or nothing")


def _ground(width: float, brick_length: float, settling: Sequence[float] | None) -> list[tuple[str, str, np.ndarray]]:
    """Name, role and outline of the parts of the ground, from left to right; it extends a brick beyond the wall."""
    ends = [-brick_length, width + brick_length]
    if settling is None:
        return [("ground", mechanics.FIXED, rectangle(ends[0], -brick_length, ends[1], 0.0))]
    first, last = pair("settling", settling)
    if first >= width or last <= 0.0:
        raise ValueError(f"settling is [{first:g}, {last:g}] m, beside the wall; choose a part of 0 to {width:g} m")
    inside = [x for x in (first, last) if 1e-9 * width < x < width * (1.0 - 1e-9)]
    stops = [ends[0], *inside, ends[1]]
    names = {1: ["ground"], 2: ["ground left", "ground right"], 3: ["ground left", "ground middle", "ground right"]}
    parts = []
    for name, left, right in zip(names[len(stops) - 1], stops[:-1], stops[1:], strict=True):
        middle = (max(left, 0.0) + min(right, width)) / 2.0
        role = mechanics.MOVING if first < middle < last else mechanics.FIXED
        parts.append((name, role, rectangle(left, -brick_length, right, 0.0)))
    return parts
