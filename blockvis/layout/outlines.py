"""Outlines of blocks: from mesh cells, without collinear points, from arcs, from flat drawings in space."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
import shapely

from blockvis.text import place_text

from .left_out import LeftOut
from .linked import equal_rows
from .notes import CHANGED, UPRIGHT, Note
from .views import VIEWS, axis_across, upright_note

#: What is nearer than this fraction of the size of a block or a drawing is at one place, on one line or in one plane:
#: in files of single precision (VTK, STL) a coordinate is accurate to 6e-8 of its size.
ROUNDING = 2e-6

#: Relief of a drawing, as a fraction of its smaller extent, and sine of its lean, with which it still is a plane one.
RELIEF = 0.05

#: Blocks touch, and stand on each other, where they are apart by at most this fraction of the block size.
TOUCHING = 2e-3

#: A block that loses more of its area than this when its outline is changed has been cut or folded.
LOST = 0.3

#: Largest angle of a chord, whatever the tolerance: twelve chords make a circle.
LARGEST_CHORD = math.pi / 6.0

#: Most chords of one arc: finer than any drawing, and a tolerance far below the radius cannot fill the memory.
MOST_CHORDS = 4096


def rectangle(left: float, low: float, right: float, high: float) -> np.ndarray:
    """(4, 2) array: corners of an upright rectangle, counter-clockwise from the lower left."""
    return np.array([[left, low], [right, low], [right, high], [left, high]])


def ring_area(ring: np.ndarray) -> float:
    """Area enclosed by a (n, 2) ring, positive counter-clockwise."""
    x, y = (ring - ring[0]).T
    return float(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2.0


def ring_width(ring: np.ndarray) -> float:
    """Twice the area over the perimeter of a (n, 2) ring: near b for a long a × b."""
    perimeter = float(np.hypot(*(np.roll(ring, -1, axis=0) - ring).T).sum())
    return 2.0 * abs(ring_area(ring)) / perimeter if perimeter else 0.0


def is_flat(points: np.ndarray) -> bool:
    """Whether (n, 2) or (n, 3) points lie in a plane across an axis; also if their coordinates are not finite."""
    if points.shape[1] == 2:
        return True
    spread = np.ptp(points, axis=0)
    return not np.isfinite(spread).all() or bool((spread <= ROUNDING * spread.max()).any())


def flattened(points: np.ndarray, view: str | None = None) -> tuple[np.ndarray, str]:
    """Take the two coordinates in which a flat drawing extends, or those of a view; note whether it stands upright.

    Of (n, 2) or (n, 3) points these are (x, y), of upright ones (x, z) or (y, z). ValueError for coordinates that are
    not finite, and for points that are not in a plane, or not in that of the view.
    """
    if points.shape[1] == 2:
        points = np.column_stack([points, np.zeros(len(points))])
    spread, flat = _flat_views(points, view)
    if not flat:
        raise ValueError(
            f"it is not flat: its points spread over {spread[0]:.4g} × {spread[1]:.4g} × {spread[2]:.4g}; "
            "draw the blocks in the plane, or give closed prismatic bodies"
        )
    chosen = view or flat[0]
    note = "" if chosen == "xy" else upright_note(chosen)
    return points[:, VIEWS[chosen]], note


def drawing_plane(lines: Sequence[np.ndarray], view: str | None = None) -> tuple[np.ndarray, list[str]]:
    """Find the plane of a drawing of lines, which may have a relief: walls are traced on scans, at any angle.

    Lines are (n, 3) arrays; where each is level, they lie in x and y, one above the other. Returned are the directions
    of x, y and across the drawing, as rows of a (3, 3) array, and notes on what that changes. The view chooses the
    coordinates of a drawing in no plane, by default x and y. ValueError for coordinates that are not finite, and a view
    without area.
    """
    points = np.concatenate(lines)
    spread, flat = _flat_views(points, view)
    chosen = view or (flat[0] if flat else "xy")
    turn, notes = np.eye(3)[[*VIEWS[chosen], axis_across(chosen)]], [] if chosen == "xy" else [upright_note(chosen)]
    if flat:
        return turn, list(notes)
    level = max(float(np.ptp(line[:, 2])) for line in lines) <= ROUNDING * spread.max()
    upright = None if level or view == "xy" else _upright(points)
    if upright is None:
        seen = "from above" if chosen == "xy" else f"along {'xyz'[axis_across(chosen)]}"
        return turn, [*notes, Note(CHANGED, f"elevations were ignored: the drawing was read as seen {seen}")]
    first, relief = upright
    angle = math.degrees(math.atan2(first[1], first[0]))
    text = f"the drawing stands upright at {angle:.3g}° to x: its lengths in that direction and z were read as (x, y)"
    ignored = f"; its relief of {relief:.3g} across was ignored" if relief > ROUNDING * spread.max() else ""
    return np.array([first, [0.0, 0.0, 1.0], [first[1], -first[0], 0.0]]), [Note(UPRIGHT, text + ignored)]


def _flat_views(points: np.ndarray, view: str | None) -> tuple[np.ndarray, list[str]]:
    """(3,) array: how far points spread, and in which views they are flat; ValueError for a view in which not."""
    spread = spread_of(points)
    flat = [name for name in VIEWS if spread[axis_across(name)] <= ROUNDING * spread.max()]
    if view is not None and flat and view not in flat:
        raise ValueError(f'it lies in {flat[0]}: seen as {view} it has no area; give view = "{flat[0]}", or none')
    return spread, flat


def _upright(points: np.ndarray) -> tuple[np.ndarray, float] | None:
    """Direction of x and relief of a drawing that stands upright; None for one that does not, or lies in no plane."""
    _, _, axes = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)
    _, second, third = np.ptp(points @ axes.T, axis=0)
    across = axes[2]
    if third > RELIEF * second or abs(across[2]) > RELIEF:
        return None
    # As the views of x and z, and of y and z, mirror nothing.
    axis = np.eye(3)[int(abs(across[0]) > abs(across[1]))]
    own = np.array([-across[1], across[0], 0.0]) / np.hypot(*across[:2])
    own *= np.sign(own @ axis)
    reliefs = [float(np.ptp(points @ [first[1], -first[0], 0.0])) for first in (axis, own)]
    # A wall along an axis stays there, whichever way its relief leans.
    return (own, reliefs[1]) if reliefs[1] < 0.5 * reliefs[0] else (axis, reliefs[0])


def uncovered(start: float, end: float, taken: Iterable[tuple[float, float]]) -> list[tuple[float, float]]:
    """List the parts of an interval, from its start to its end, that none of others covers."""
    found, reached = [], start
    for low, high in [*sorted(taken), (end, end)]:
        if low > reached:
            found.append((reached, float(min(low, end))))
        reached = max(reached, float(high))
    return found


def pieces_of(shape: Any) -> list[Any]:
    """List the polygons with an area of a shape; beside lines they may lie in a collection within the collection."""
    return [piece for piece in shapely.get_parts(shapely.get_parts(shape)) if piece.area > 0.0]


def largest_piece(shape: Any) -> Any:
    """Outer border of the largest piece of a shape, a polygon without holes; an empty one of a shape without area."""
    pieces = pieces_of(shape)
    return shapely.Polygon(max(pieces, key=lambda piece: float(piece.area)).exterior) if pieces else shapely.Polygon()


def touching(shapes: np.ndarray, near: float) -> list[set[int]]:
    """List the shapes that each touches, or from which it is no farther than ``near``."""
    others: list[set[int]] = [set() for _ in shapes]
    for i, j in shapely.STRtree(shapes).query(shapes, predicate="dwithin", distance=near).T.tolist():
        if i != j:
            others[i].add(j)
    return others


def folded(drawn: Sequence[np.ndarray], changed: Sequence[np.ndarray]) -> np.ndarray:
    """(n,) int array: outlines that cross themselves, or lose much of their area, when they are changed."""
    before = shapely.area(np.array([shapely.Polygon(ring) for ring in drawn]))
    after = np.array([shapely.Polygon(ring) if len(ring) > 2 else shapely.Polygon() for ring in changed])
    return np.flatnonzero(~shapely.is_valid(after) | (shapely.area(after) < (1.0 - LOST) * before))


def ring_of(polygon: Any) -> np.ndarray:
    """(n, 2) array: the corners around a polygon, counter-clockwise."""
    return np.array(shapely.orient_polygons(polygon).exterior.coords)[:-1]


def ends_of(lines: Iterable[np.ndarray]) -> np.ndarray:
    """(2 n, d) array: the first and the last point of each of n lines, one line after another."""
    return np.concatenate([points[[0, -1]] for points in lines])


def around_hole(called: str, outline: np.ndarray, holes: Sequence[np.ndarray]) -> LeftOut:
    """Say that a block has a hole; its outline and those of its holes are (n, 2) arrays."""
    at = place_text(holes[0].mean(axis=0), 6)
    message = f"{called} has a hole around {at}; cut the block in two, or fill the hole with a block"
    return LeftOut("hole", outline, message, holes=tuple(holes))


def share_in(inner: Any, outer: Any) -> float:
    """Fraction of the area of one shape that lies in another."""
    return float(inner.intersection(outer).area / inner.area) if inner.intersects(outer) else 0.0


def filled(rings: Sequence[np.ndarray], out: float = ROUNDING) -> list[tuple[int, list[int]]]:
    """Numbers of the (n, d) outlines of one shape in a plane that are filled, each with those of its holes.

    Of outlines that lie in each other every second is filled; one that crosses itself lies in none and holds none. The
    part ``out`` of an outline may stick out of another in which it lies.
    """
    if len(rings) < 2:
        return [(k, []) for k in range(len(rings))]
    spread = np.ptp(np.concatenate(rings), axis=0)
    plane = np.sort(np.argsort(spread)[-2:])
    shapes = np.array([shapely.Polygon(ring[:, plane]) for ring in rings])
    areas = shapely.area(shapes)
    sound = np.flatnonzero(shapely.is_valid(shapes) & (areas > 0.0))
    inner, outer = sound[shapely.STRtree(shapes[sound]).query(shapes[sound])]
    smaller = areas[inner] < (1.0 - out) * areas[outer]
    inner, outer = inner[smaller], outer[smaller]
    shared = shapely.area(shapely.intersection(shapes[inner], shapes[outer]))
    within = shared >= (1.0 - out) * areas[inner]
    inner, outer = inner[within], outer[within]
    depth = np.bincount(inner, minlength=len(rings))
    holes: dict[int, list[int]] = {k: [] for k in np.flatnonzero(depth % 2 == 0).tolist()}
    for k in np.flatnonzero(depth % 2).tolist():
        around = outer[inner == k]
        holes[int(around[np.argmin(areas[around])])].append(k)
    return list(holes.items())


def spread_of(points: np.ndarray) -> np.ndarray:
    """(d,) array: how far points spread along each axis; ValueError for coordinates that are not finite."""
    if not np.isfinite(points).all():
        bad = points[~np.isfinite(points).all(axis=1)][0]
        raise ValueError(f"it has a point at {bad.tolist()}; coordinates must be finite numbers: repair the file")
    return np.asarray(np.ptp(points, axis=0))


def outlines_of_cells(
    points: np.ndarray,
    cells: Sequence[Sequence[int]] | Sequence[np.ndarray],
    owner: np.ndarray,
    names: Sequence[str],
    unusable: dict[int, LeftOut] | None = None,
) -> list[np.ndarray]:
    """Find the outline of each block, (n, 2) array counter-clockwise: the edges that belong to one of its cells only.

    A cell is given by the (n, 2) points around it, those on curved sides included, and is that of the block it has for
    its owner, which names are of. ValueError for a block that is not one piece with one outline, unless ``unusable``
    takes it up, by the number of the block; its outline is that of its largest piece then.
    """
    counts = np.array([len(cell) for cell in cells])
    flat = np.concatenate([np.asarray(cell, dtype=np.int64) for cell in cells])
    ends = np.cumsum(counts)
    following = np.arange(1, len(flat) + 1)
    following[ends - 1] = ends - counts
    start, end, block = flat, flat[following], np.repeat(np.asarray(owner), counts)
    real = start != end
    start, end, block = start[real], end[real], block[real]
    key = np.stack([block, np.minimum(start, end), np.maximum(start, end)], axis=1)
    once = np.setdiff1d(np.arange(len(key)), np.concatenate(equal_rows(key)))
    edges: list[list[tuple[int, int]]] = [[] for _ in names]
    for i in once:
        edges[block[i]].append((int(start[i]), int(end[i])))
    rings, n_cells = [], np.bincount(owner, minlength=len(names))
    for b, name in enumerate(names):
        ring, problem = _ring(points, edges[b], name, whole=n_cells[b] == 1)
        if problem is not None:
            if unusable is None:
                raise ValueError(problem.message)
            unusable[b] = problem
        rings.append(ring)
    return rings


def _ring(
    points: np.ndarray, edges: list[tuple[int, int]], name: str, whole: bool
) -> tuple[np.ndarray, LeftOut | None]:
    """Outline of a block, which may be one whole cell, and why it cannot be used if so."""
    loops, crossing = loops_of(edges)
    if crossing is not None:
        at = place_text(points[crossing], 6)
        around = points[np.unique(edges)]
        meeting = sum(crossing in edge for edge in edges)
        message = (
            f"the outline of block '{name}' meets itself at {at}, where {meeting} of its edges "
            "end; a block is one piece with one outline"
        )
        return around, LeftOut("pieces", around, message, serious=True)
    if not loops:
        message = (
            f"block '{name}' has no outline: each of its edges belongs to two cells; its cells are in the file twice"
        )
        return np.zeros((0, 2)), LeftOut("no outline", np.zeros((0, 2)), message, serious=True)
    loops.sort(key=lambda loop: -abs(ring_area(points[loop])))
    rings = [points[loop] for loop in loops]
    # The first corner stays the first, from which edges are counted; of several cells it is the first point.
    ring = np.roll(rings[0], 0 if whole else -int(np.argmin(loops[0])), axis=0)
    ring = without_collinear(ring if ring_area(ring) > 0 else np.roll(ring[::-1], 1, axis=0))
    if len(rings) == 1:
        return ring, None
    if len(filled(rings)) == 1:
        return ring, around_hole(f"block '{name}'", ring, rings[1:])
    at = place_text(rings[1].mean(axis=0), 6)
    message = f"block '{name}' is in {len(rings)} separate pieces, one around {at}; give each its own block"
    return ring, LeftOut("pieces", ring, message, serious=True)


def loops_of(edges: Sequence[Sequence[int]]) -> tuple[list[list[int]], int | None]:
    """Find the closed loops of edges; or a point in which more than two of them end."""
    neighbours: dict[int, list[int]] = {}
    for a, b in edges:
        neighbours.setdefault(a, []).append(b)
        neighbours.setdefault(b, []).append(a)
    for node, others in neighbours.items():
        if len(others) != 2:
            return [], node
    loops, seen = [], set()
    for first in neighbours:
        if first in seen:
            continue
        loop, previous, node = [first], first, neighbours[first][0]
        seen.add(first)
        while node != first:
            loop.append(node)
            seen.add(node)
            one, other = neighbours[node]
            previous, node = node, (other if one == previous else one)
        loops.append(loop)
    return loops, None


def without_collinear(ring: np.ndarray, tolerance: float = ROUNDING) -> np.ndarray:
    """Drop the points of a (n, 2) ring that are within a fraction of its extent of the edge that replaces them.

    Examples
    --------
    >>> without_collinear(np.array([[0, 0], [1, 0], [2, 0], [2, 1], [0, 1]])).tolist()
    [[0, 0], [2, 0], [2, 1], [0, 1]]
    """
    if len(ring) > 1 and (ring[0] == ring[-1]).all():
        ring = ring[:-1]
    if len(ring) < 4:
        return ring
    limit = tolerance * float(np.ptp(ring, axis=0).max())
    # Start at a true corner: the point farthest from the first one, then from that one.
    first = int(np.argmax(((ring - ring[0]) ** 2).sum(axis=1)))
    ring = np.roll(ring, -first, axis=0)
    closed = np.vstack([ring, ring[:1]])
    kept, k, n = [0], 0, len(ring)
    while k < n:
        # Find the farthest point that a straight edge reaches while all points in between lie on it. Doubling and
        # halving the step keeps a ring of a million collinear points from taking a million squared steps.
        end, step = k + 1, 1
        while end + step <= n and _fits(closed[k], closed[k + 1 : end + step], closed[end + step], limit):
            end, step = end + step, 2 * step
        while step > 1:
            step //= 2
            if end + step <= n and _fits(closed[k], closed[k + 1 : end + step], closed[end + step], limit):
                end += step
        kept.append(end)
        k = end
    corners = np.sort((np.array(kept[:-1]) + first) % n)
    return np.roll(ring, first, axis=0)[corners] if len(corners) >= 3 else ring


def _fits(a: np.ndarray, dropped: np.ndarray, b: np.ndarray, limit: float) -> bool:
    along = b - a
    length = float(np.hypot(*along))
    if length <= limit:
        return False
    offset = dropped - a
    distance = np.abs(along[0] * offset[:, 1] - along[1] * offset[:, 0]) / length
    position = offset @ along / length
    ordered = (np.diff(position) >= 0).all() and position[0] >= 0 and position[-1] <= length
    return bool((distance <= limit).all() and ordered)


def chords_of(sweep: float, radius: float, tolerance: float | None = None) -> int:
    """Count the equal chords that stay within a tolerance, by default a thousandth of the radius, of an arc.

    The sweep is in rad; the radius of an ellipse is the larger half axis.
    """
    allowed = 1e-3 if tolerance is None else min(max(tolerance / max(radius, 1e-300), 1e-12), 1.0)
    widest = min(LARGEST_CHORD, 2.0 * math.acos(1.0 - allowed))
    return min(max(1, math.ceil(abs(sweep) / widest - 1e-9)), MOST_CHORDS)
