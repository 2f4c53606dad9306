"""Patterns of masonry over a rectangle: bonds of brick, coursed ashlar with random lengths, rubble."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain, pairwise

import numpy as np
import shapely

from blockvis.layout.joints.nearest_stone import without_short_edges
from blockvis.layout.outlines import ring_of

#: Bonds of rectangular walls.
BONDS = ("running", "stack", "english")

#: Bonds of brick that fill an outline.
BRICKWORK = (*BONDS, "flemish", "header")

#: A brick cut shorter than this fraction of its length is joined to its neighbour: a mason lays no piece shorter than a
#: closer, a quarter of a brick.
SHORTEST_BRICK = 0.2

#: Patterns that fill an outline.
PATTERNS = (*BRICKWORK, "ashlar", "rubble")

#: Shortest and longest stone of ashlar, as fractions of the mean, and least distance of its head joints from those of
#: the course below, as a fraction of the shortest stone.
ASHLAR, LAP = (0.6, 1.4), 0.4

#: Rubble: how far centres are from the middle of their place, as a fraction of it; rounds in which each centre moves
#: to the middle of its stone (Lloyd's method); edges shorter than this fraction of a stone's height are closed.
JITTER, ROUNDS, SHORT_EDGE = 0.3, 3, 0.2

#: Steepest joint that reaches an upright rim: a mason does not lay a stone there that may slide out.
STEEPEST = 0.2

#: An edge is upright that leans by no more than this fraction of its height.
LEANS = 1e-3


def coursed(kind: str, width: float, height: float, brick: tuple[float, float], seed: int) -> list[shapely.Polygon]:
    """Lay the bricks of a bond over a rectangle from (0, 0), course by course; the last course may reach beyond it.

    Lengths are in m; a brick is its length and height. The seed is of the lengths of ashlar.
    """
    length, high = brick
    boxes: list[shapely.Polygon] = []
    random = np.random.default_rng(seed)
    below = np.zeros(0)
    for course in range(int(np.ceil(height / high - 1e-9))):
        if kind == "ashlar":
            joints = _random_joints(random, width, length, below)
        else:
            joints = head_joints(kind, course, width, length)
        boxes += [shapely.box(a, course * high, b, (course + 1) * high) for a, b in pairwise(joints)]
        below = joints[1:-1]
    return boxes


def head_joints(bond: str, course: int, width: float, brick_length: float) -> np.ndarray:
    """Position the head joints of one course of a wall, (n,) array [m] from 0 to its width.

    Even courses, from 0 at the bottom, are whole bricks (stretchers); odd ones are shifted by half a brick in running
    bond, and in English bond are headers with a queen closer next to each end. In Flemish bond each course is a
    stretcher and a header in turn, each header over the middle of a stretcher, with a queen closer at the left of odd
    courses; in header bond all are headers, and odd courses begin with three quarters of a brick. A brick too short at
    either end is joined to its neighbour.

    Examples
    --------
    >>> head_joints("running", 1, 3.0, 1.0).tolist()
    [0.0, 0.5, 1.5, 2.5, 3.0]
    >>> head_joints("english", 1, 2.0, 1.0).tolist()
    [0.0, 0.5, 0.75, 1.25, 1.5, 2.0]
    """
    n = int(np.ceil(2.0 * width / brick_length)) + 2
    if bond == "flemish":
        ends = np.array([1.0, 1.5]) if course % 2 == 0 else np.array([0.75, 1.75])
        inside = (ends + 1.5 * np.arange(n)[:, None]).ravel() * brick_length
        # The first header of odd courses has a queen closer at its right.
        inside = np.append(0.5 * brick_length, inside) if course % 2 else inside
    elif bond == "header":
        inside = (0.5 + 0.25 * (course % 2) + 0.5 * np.arange(n)) * brick_length
        inside = inside if course % 2 == 0 else inside[inside < width - 0.5 * brick_length]
    elif course % 2 == 0 or bond == "stack":
        inside = np.arange(1, n) * brick_length
    elif bond == "running":
        inside = (np.arange(n) + 0.5) * brick_length
    else:
        headers = (0.75 + 0.5 * np.arange(n)) * brick_length
        last = width - 0.5 * brick_length
        headers = headers[headers < last - SHORTEST_BRICK * brick_length]
        inside = np.unique(np.concatenate([[0.5 * brick_length], headers, [last]]))
    shortest = SHORTEST_BRICK * brick_length
    inside = inside[(inside > shortest) & (inside < width - shortest)]
    return np.concatenate([[0.0], inside, [width]])


def _random_joints(random: np.random.Generator, width: float, length: float, below: np.ndarray) -> np.ndarray:
    """Head joints of a course of stones of random length, off those of the course below."""
    shortest, longest = (share * length for share in ASHLAR)
    joints = [0.0]
    while width - joints[-1] > longest:
        tried = joints[-1] + random.uniform(shortest, longest, 24)
        # What is left is a stone, too.
        tried = tried[(width - tried >= shortest)] if (width - tried >= shortest).any() else tried
        off = np.abs(tried[:, None] - below).min(axis=1, initial=np.inf)
        clear = np.flatnonzero(off >= LAP * shortest)
        joints.append(float(tried[clear[0] if len(clear) else off.argmax()]))
    return np.array([*joints, width])


def rubble(width: float, height: float, stone: float, flatness: float, seed: int) -> list[shapely.Polygon]:
    """Lay stones of random outline over a rectangle from (0, 0), which they fill.

    Stones are ``stone`` [m] long in the mean, and ``flatness`` times as long as high.

    Notes
    -----
    Cells of a Voronoi diagram whose centres stand in rows, each row half a stone off the one below, shifted at random
    and moved to the middles of their cells; short edges between cells are closed.
    """
    random = np.random.default_rng(seed)
    rows = max(1, round(height * flatness / stone))
    sites = []
    for row in range(rows):
        n = max(1, round(width / stone))
        x = (np.arange(n + row % 2) + (0.0 if row % 2 else 0.5)) / n * width
        x = np.clip(x, 0.25 * width / n, width - 0.25 * width / n)
        y = np.full(len(x), (row + 0.5) / rows * height)
        sites.append(np.column_stack([x, y]) + random.uniform(-JITTER, JITTER, (len(x), 2)) * [stone, stone / flatness])
    points = np.concatenate(sites)
    # In a drawing stretched by the flatness stones are as high as they are long.
    stretched = np.array([1.0, flatness])
    frame = shapely.box(0.0, 0.0, width, height * flatness)
    for _ in range(ROUNDS):
        cells = shapely.intersection(_cells(points * stretched, frame), frame)
        points = shapely.get_coordinates(shapely.centroid(cells)) / stretched
    rings = [ring_of(cell) for cell in shapely.intersection(_cells(points * stretched, frame), frame)]
    corners = np.concatenate(rings)
    # Near the rim they stay: three stones that met there would have steep joints.
    near = shapely.dwithin(shapely.points(corners), frame.exterior, SHORT_EDGE * stone)
    rings = without_short_edges(rings, SHORT_EDGE * stone, corners[near])
    return [shapely.Polygon(ring / stretched) for ring in rings]


def _cells(points: np.ndarray, frame: shapely.Polygon) -> np.ndarray:
    cells = shapely.voronoi_polygons(shapely.MultiPoint(points), extend_to=frame.buffer(frame.length), ordered=True)
    return np.array(shapely.get_parts(cells))


def bedded(stones: list[shapely.Polygon], wall: shapely.Geometry) -> list[shapely.Polygon]:
    """Turn joints that reach an upright rim of the wall towards the level, so that no stone slides out there."""
    kept = [np.array(stone.exterior.coords)[:-1] for stone in stones]
    for key, pair in _joints_at_rim(kept, wall).items():
        moved = [found for found in (_levelled(kept[i], key) for i in pair) if found is not None]
        if len(moved) < 2 or abs(moved[0][0] - moved[1][0]) > 1e-8:
            continue
        before = [shapely.Polygon(kept[i]) for i in pair]
        after = [shapely.Polygon(ring) for _, ring in moved]
        area = shapely.area(before).sum()
        if shapely.is_valid(after).all() and abs(shapely.area(after).sum() - area) < 1e-12 * area:
            for i, (_, ring) in zip(pair, moved, strict=True):
                kept[i] = ring
    return [shapely.Polygon(ring) for ring in kept]


def _joints_at_rim(rings: Sequence[np.ndarray], wall: shapely.Geometry) -> dict[tuple[float, float], list[int]]:
    """Find where two stones alone meet on an upright rim of the wall, and which; corners of the wall are none."""
    at: dict[tuple[float, float], list[int]] = {}
    for i, ring in enumerate(rings):
        for x, y in ring.tolist():
            at.setdefault((round(x, 9), round(y, 9)), []).append(i)
    lines = (shapely.get_coordinates(part).tolist() for part in shapely.get_parts(wall.boundary))
    edges = chain.from_iterable(map(pairwise, lines))
    upright = [(a, b) for a, b in edges if abs(a[0] - b[0]) < LEANS * abs(a[1] - b[1])]
    rim = shapely.dwithin(shapely.points(np.array(list(at))), shapely.MultiLineString(upright), 1e-8)
    taken = set(map(tuple, np.round(shapely.get_coordinates(wall), 9).tolist()))
    met = zip(at.items(), rim.tolist(), strict=True)
    return {key: pair for (key, pair), on in met if on and key not in taken and len(pair) == 2}


def _levelled(ring: np.ndarray, corner: tuple[float, float]) -> tuple[float, np.ndarray] | None:
    """Move a corner at an upright rim so that its joint is not too steep; gives its new level and the outline."""
    k = int(np.abs(ring - corner).max(axis=1).argmin())
    inner = next((p for p in (ring[k - 1], ring[(k + 1) % len(ring)]) if abs(p[0] - corner[0]) > 1e-8), None)
    if inner is None:
        return None
    most = STEEPEST * abs(inner[0] - corner[0])
    moved = ring.copy()
    moved[k, 1] = inner[1] + np.clip(ring[k, 1] - inner[1], -most, most)
    return float(moved[k, 1]), moved
