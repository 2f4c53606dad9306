"""Walls in space: corners and junctions with bonded bricks, and walls of two leaves."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import solver
from blockvis.layout.solids import Solid, box
from solver import mechanics

from .assembled import assembled
from .dimensions import above_zero, at_least_zero, whole

#: Walls of a corner and a junction stand on strips of ground this fraction of a brick wider to each side.
GROUND = 0.25


def l_corner(
    *,
    bricks: int = 4,
    across: int = 4,
    courses: int = 8,
    brick_length: float = 0.25,
    brick_height: float = 0.08,
    density: float = 1800.0,
) -> solver.Assembly:
    """Build the corner of two walls half a brick thick, whose bricks take turns in the corner.

    Parameters
    ----------
    bricks, across : int
        Lengths of the walls along x and along y in bricks, from the outer corner on.
    courses : int
        Number of courses.
    brick_length, brick_height : float [m]
        A brick is half as wide as it is long.
    density : float [kg/m³]

    Returns
    -------
    solver.Assembly
        Bricks "brick 1-1" (course, from the corner along x) and "cross brick 1-1" (along y), "ground" (fixed) under the
        wall along x and "cross ground" (moving) under the other. The outer corner is x = y = 0.

    Examples
    --------
    >>> l_corner(bricks=2, across=2, courses=2).n_blocks
    10
    """
    n, m = whole("bricks", bricks, 2), whole("across", across, 2)
    length, height, width = _brick(brick_length, brick_height)
    stones: list[tuple[str, Solid]] = []
    for course in range(whole("courses", courses, 1)):
        # In every second course the wall along y has the corner.
        along = _cuts(width if course % 2 else 0.0, n * length, length, width)
        beside = _cuts(0.0 if course % 2 else width, m * length, length, width)
        faces, levels = (0.0, width), (course * height, (course + 1) * height)
        stones += _laid(f"brick {course + 1}", along, faces, levels)
        stones += _laid(f"cross brick {course + 1}", beside, faces, levels, along_y=True)
    wide = GROUND * length
    grounds = [
        ("ground", mechanics.FIXED, box((-wide, -wide, -height), (n * length + wide, width, 0.0))),
        ("cross ground", mechanics.MOVING, box((-wide, width, -height), (width + wide, m * length + wide, 0.0))),
    ]
    return assembled(stones, grounds, density=density, material="brick")


def t_corner(
    *,
    bricks: int = 6,
    across: int = 4,
    courses: int = 8,
    brick_length: float = 0.25,
    brick_height: float = 0.08,
    density: float = 1800.0,
) -> solver.Assembly:
    """Build the junction of a wall with one across, half a brick thick, whose bricks reach through every second course.

    Parameters
    ----------
    bricks : int
        Length of the wall along x in bricks, an even number.
    across : int
        Length of the wall along y in bricks, from the face of the other on.
    courses, brick_length, brick_height, density
        As in :func:`l_corner`.

    Returns
    -------
    solver.Assembly
        Bricks "brick 1-1" (course, from the left) and "cross brick 1-1" (along y), "ground" (fixed) under the wall
        along x and "cross ground" (moving) under the other. The middle of the wall along x is x = 0.

    Examples
    --------
    >>> t_corner(bricks=2, across=2, courses=2).n_blocks
    12
    """
    n, m = whole("bricks", bricks, 2), whole("across", across, 1)
    if n % 2:
        raise ValueError(f"bricks is {n}; give an even number, with the wall across in the middle")
    length, height, width = _brick(brick_length, brick_height)
    half, far = n * length / 2.0, width + m * length
    stones: list[tuple[str, Solid]] = []
    for course in range(whole("courses", courses, 1)):
        faces, levels = (0.0, width), (course * height, (course + 1) * height)
        # In every second course the wall across reaches through to the outer face.
        right = _cuts((width if course % 2 else length) / 2.0, half, length, width)
        left = [-x for x in right[::-1]]
        name = f"brick {course + 1}"
        if course % 2:
            stones += _laid(name, left, faces, levels)
            stones += _laid(name, right, faces, levels, begun=len(left) - 1)
        else:
            stones += _laid(name, left + right, faces, levels)
        beside = _cuts(0.0 if course % 2 else width, far, length, width)
        stones += _laid(f"cross {name}", beside, (-width / 2.0, width / 2.0), levels, along_y=True)
    wide = GROUND * length
    grounds = [
        ("ground", mechanics.FIXED, box((-half - wide, -wide, -height), (half + wide, width, 0.0))),
        (
            "cross ground",
            mechanics.MOVING,
            box((-width / 2.0 - wide, width, -height), (width / 2.0 + wide, far + wide, 0.0)),
        ),
    ]
    return assembled(stones, grounds, density=density, material="brick")


def two_leaf_wall(
    *,
    bricks: int = 6,
    courses: int = 9,
    cavity: float = 0.0,
    header_courses: int = 3,
    header_spacing: int = 2,
    brick_length: float = 0.25,
    brick_height: float = 0.08,
    density: float = 1800.0,
) -> solver.Assembly:
    """Build a wall of two leaves, each half a brick thick, tied by headers through both.

    Parameters
    ----------
    bricks : int
        Length of the wall in bricks.
    courses : int
        Number of courses.
    cavity : float [m]
        Between the leaves; the headers reach across it.
    header_courses : int
        Every so many courses have headers, the first of them at that height; at most ``courses``.
    header_spacing : int
        In these courses every so many whole bricks, from the first on, are replaced by two headers side by side.
    brick_length, brick_height, density
        As in :func:`l_corner`.

    Returns
    -------
    solver.Assembly
        Bricks "front 1-1" and "back 1-1" (course, from the left), headers "header 3-1", and the supports "front ground"
        (fixed) and "back ground" (moving). The wall runs along x, its front is y = 0.

    Examples
    --------
    >>> two_leaf_wall(bricks=4, courses=3).roles[-2:].tolist()
    ['fixed', 'moving']
    """
    n, every = whole("bricks", bricks, 2), whole("header_courses", header_courses, 1)
    spacing, total = whole("header_spacing", header_spacing, 1), whole("courses", courses, 1)
    if every > total:
        raise ValueError(
            f"header_courses is {every} and courses {total}, so that none has headers; give header_courses of at most "
            f"{total}"
        )
    length, height, width = _brick(brick_length, brick_height)
    gap = at_least_zero("cavity", cavity)
    deep = 2.0 * width + gap
    stones: list[tuple[str, Solid]] = []
    for course in range(total):
        low, high = course * height, (course + 1) * height
        cuts = [0.0, *(length * (k + (0.5 if course % 2 else 1.0)) for k in range(n)), n * length]
        cuts = sorted({round(x, 12) for x in cuts if x <= n * length + 1e-12})
        pairs = list(pairwise(cuts))
        tied = (course + 1) % every == 0
        number = 0
        for k, (a, b) in enumerate(pairs):
            whole_brick = b - a > 0.75 * length
            # Every other course begins with half a brick.
            if tied and whole_brick and (k - course % 2) % spacing == 0:
                middle = (a + b) / 2.0
                for start, end in ((a, middle), (middle, b)):
                    number += 1
                    stones.append((f"header {course + 1}-{number}", box((start, 0.0, low), (end, deep, high))))
            else:
                stones.append((f"front {course + 1}-{k + 1}", box((a, 0.0, low), (b, width, high))))
                stones.append((f"back {course + 1}-{k + 1}", box((a, width + gap, low), (b, deep, high))))
    wide, middle = GROUND * length, width + gap / 2.0
    grounds = [
        ("front ground", mechanics.FIXED, box((-wide, -wide, -height), (n * length + wide, middle, 0.0))),
        ("back ground", mechanics.MOVING, box((-wide, middle, -height), (n * length + wide, deep + wide, 0.0))),
    ]
    return assembled(stones, grounds, density=density, material="brick")


def _brick(length: float, height: float) -> tuple[float, float, float]:
    length = above_zero("brick_length", length)
    return length, above_zero("brick_height", height), length / 2.0


def _cuts(start: float, end: float, length: float, least: float) -> list[float]:
    """Lay out bricks from ``start`` to ``end``; a rest shorter than half a brick belongs to the last."""
    n = max(math.ceil((end - start) / length - 1e-9), 1)
    cuts = [start + k * length for k in range(n)]
    if len(cuts) > 1 and end - cuts[-1] < least - 1e-9:
        cuts.pop()
    return [*cuts, end]


def _laid(
    name: str,
    cuts: Sequence[float],
    faces: tuple[float, float],
    levels: tuple[float, float],
    *,
    along_y: bool = False,
    begun: int = 0,
) -> list[tuple[str, Solid]]:
    """Lay the bricks of a course along x, or along y, between these joints, and number them."""
    bricks = []
    for k, (start, end) in enumerate(pairwise(cuts), start=begun + 1):
        sides = (faces, (start, end)) if along_y else ((start, end), faces)
        bricks.append((f"{name}-{k}", box(*zip(*sides, levels, strict=True))))
    return bricks
