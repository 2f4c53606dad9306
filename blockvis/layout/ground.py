"""The ground of a drawing without supports: what stands, what settles, and where the line between them is."""

from __future__ import annotations

import math
import shlex
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any

import numpy as np
import shapely

import solver
from blockvis.text import rounded_length
from solver import mechanics

from .assemble import as_simplified
from .facing import facing_tolerance
from .inspect import Inspection
from .layout import Layout
from .outlines import ROUNDING, largest_piece, pieces_of, rectangle, ring_of, touching, uncovered, without_collinear
from .repair import repaired
from .solids import plan_beyond, size_of

#: Blocks of the lowest course have their bottom within this fraction of the median height of the lowest.
COURSE = 0.5

#: Part of a foot that no lower block covers; less is the sliver that the next voussoir, or a joint, leaves.
EXPOSED = 0.3

#: A foot that slopes more than this (24 degrees) is a springer's; ground lies under edges up to the steepest.
SLOPE, STEEPEST = 0.45, 1.0

#: Of a bed this part at either end may be left without ground, which stands off there from a lower stone beside it.
STAND_OFF = 0.05

#: A foot narrower than this fraction of its block, in space of its plan, is a point or an edge.
NARROW = 0.2

#: A block over both halves of the ground that is longer than so many others bridges what settles.
BRIDGE = 4.0

#: Why the ground has pits.
PITS = "pits keep it off the sides of stones that reach lower than the next"

#: Slope of what is level; corners within this fraction of its height above the bottom are in a bottom face in space.
LEVEL = 0.01

#: Parts of the names and layers of blocks that are supports, where the drawing says nothing of roles.
SUPPORT_WORDS = ("springer", "support", "ground", "foundation", "footing", "abutment", "bearing")


@dataclass(frozen=True)
class Ground:
    """What stands and what settles, if anything: how it was found, and what to write as [roles] and [[supports]]."""

    says: str
    roles: Mapping[str, str] = field(default_factory=dict)
    supports: tuple[Mapping[str, Any], ...] = ()
    settles: bool = True
    remark: str = ""  #: What a picture of it is to say, or "".
    doubt: str = ""  #: Of a block that may be ground itself, or "".


@dataclass(frozen=True)
class _Foot:
    """A block of the lowest course, with its box in plan and the level of its bottom [m].

    On its bed, (n, 2) [m], it lies, in the plane from left to right, in space in plan; one without becomes a support.
    """

    block: int
    low: np.ndarray
    high: np.ndarray
    bed: np.ndarray | None
    level: float


@dataclass(frozen=True)
class _Split:
    """Where the half that settles begins: along an axis in plan, in a gap or, without one, in the middle."""

    axis: int
    at: float

    def moves(self, foot: _Foot) -> bool:
        return 0.5 * float(foot.low[self.axis] + foot.high[self.axis]) > self.at


def block_size(found: Inspection) -> float:
    """Find the distance across the median free block [m]."""
    across = [size_of(found.layout.corners(i)) for i in with_role(found, mechanics.FREE)]
    return float(np.median(across)) if across else 1.0


def with_role(found: Inspection, role: str) -> list[int]:
    """List the numbers of the blocks of a role, without duplicates."""
    return [int(i) for i in found.kept if found.roles[i] == role]


def ground_of(found: Inspection) -> Ground:
    """Say what stands and what settles, of what a drawing says and shows.

    Supports are as the drawing says, or as names and layers say; otherwise blocks that touch the ground in a point, an
    edge or a slope, and below the others a ground that their bottoms lie on.
    """
    fixed = with_role(found, mechanics.FIXED)
    if with_role(found, mechanics.MOVING):
        return Ground("The drawing says which blocks are supports, and which of them move.")
    if fixed:
        return _of_fixed(found, fixed)
    if named := _named_supports(found):
        last = max(named, key=lambda label: named[label])
        roles = {label: mechanics.MOVING if label == last and len(named) > 1 else mechanics.FIXED for label in named}
        says = "The drawing says nothing of supports; these were taken by their names"
        return Ground(
            f"{says}, and the rightmost settles." if len(named) > 1 else f"{says}.", roles, settles=len(named) > 1
        )
    return _laid(found)


def _of_fixed(found: Inspection, fixed: Sequence[int]) -> Ground:
    """Let the supports of one side settle, where the drawing has supports that stand and their names tell them."""
    layout = found.layout
    feet = [_Foot(i, *_plan_box(layout, i), None, 0.0) for i in fixed]
    split = _split(feet, _opening(found))
    moving = [foot.block for foot in feet if split.moves(foot)]
    names = _names_of(layout, found.kept, moving)
    if not 0 < len(moving) < len(fixed) or not names:
        return Ground("The drawing has supports that stand, and none that moves.", settles=False)
    said = f"'{next(iter(names))}' does" if len(names) == 1 else f"the {len(moving)} of one side do"
    return Ground(
        f"The drawing says which blocks are supports, but of none that it moves: here {said}.",
        roles=dict.fromkeys(names, mechanics.MOVING),
    )


def _named_supports(found: Inspection) -> dict[str, float]:
    """Where blocks stand in the mean [m] whose layer, or else name, is that of a support; by that layer or name."""
    layout = found.layout
    places: dict[str, list[float]] = {}
    for i in found.kept.tolist():
        labels = [layout.groups[i], layout.names[i]]
        label = next((one for one in labels if any(word in one.lower() for word in SUPPORT_WORDS)), None)
        if label is not None:
            places.setdefault(label, []).append(float(layout.corners(i)[:, 0].mean()))
    # A role is no key of all blocks: something must be left that can fall.
    if sum(map(len, places.values())) == len(found.kept):
        return {}
    return {label: sum(x) / len(x) for label, x in places.items()}


def _laid(found: Inspection) -> Ground:
    """Lay a ground under the lowest course, and make supports of the blocks that no ground can lie under."""
    layout, blocks = found.layout, found.kept.tolist()
    depth = rounded_length(0.5 * block_size(found))
    outlines = [] if layout.dimension == 3 else _as_in_a_run(found)
    feet = _feet_in_the_plane(found, outlines) if outlines else _feet_in_space(found)
    if all(foot.bed is None for foot in feet) and len(feet) in (0, len(blocks)):
        # Without a block that may fall there is no structure: what touches in a point is drawn on a level.
        feet = [_on_a_level(found)]
    split = _split(feet, 1e-3 * depth + _opening(found))
    springers = [foot for foot in feet if foot.bed is None]
    beds = [foot for foot in feet if foot.bed is not None]
    roles: dict[str, str] = {}
    for role, moves in ((mechanics.FIXED, False), (mechanics.MOVING, True)):
        side = [foot.block for foot in springers if split.moves(foot) is moves]
        roles |= dict.fromkeys(_names_of(layout, blocks, side), role)
    supports: list[Mapping[str, Any]] = []
    dug = False
    if beds and layout.dimension == 3:
        is_level = np.ptp([foot.level for foot in beds]) < 1e-3 * depth
        supports = _slab(found, beds, split, depth) if is_level and not springers else _pads(found, beds, split)
    elif beds:
        supports, dug = _bedded(_drawn_and_closed(found, outlines), feet, split, depth, _opening(found))
    where = "on the right" if split.axis == 0 else "on the far side"
    said = f"stands on one side and settles {where}"
    here = f"the ground below it {said if split.axis else 'stands on the left and settles on the right'}"
    if roles:
        ground = ", and a ground below the others" if supports else ""
        here = (
            f"the lowest blocks, which end in a slope, an edge or a point, are supports{ground}; what is below {said}"
        )
    settles = mechanics.MOVING in [*roles.values(), *(support["role"] for support in supports)]
    says = f"The drawing has no supports: here {here}.{f' In the ground {PITS}.' * dug}"
    doubt = _bridging(found, beds, split) if supports and settles else ""
    return Ground(says, roles, tuple(supports), settles, f"white in the ground: {PITS}" * dug, doubt)


def _bridging(found: Inspection, beds: Sequence[_Foot], split: _Split) -> str:
    """Tell of a block over both halves, far longer than others, as ground that is drawn; "" where there is none."""
    layout = found.layout
    for foot in beds:
        low, high = (float(end[split.axis]) for end in (foot.low, foot.high))
        if low < split.at < high and high - low > BRIDGE * block_size(found):
            name, group = layout.names[foot.block], layout.groups[foot.block]
            alone = group and [layout.groups[i] for i in found.kept].count(group) == 1
            length = f"{high - low:.3g} m long"
            said = f"'{name}' is one stone, {length}, over both halves of the ground, and bridges what settles below"
            ignored = shlex.quote(group if alone else name)
            return f"{said}: if it is ground, leave it out, --ignore {ignored}; else draw its stones"
    return ""


def _drawn_and_closed(found: Inspection, outlines: Sequence[np.ndarray]) -> list[np.ndarray]:
    """(n, 2) arrays: blocks that stand, with their joints closed and as drawn: there a stone may reach lower."""
    both = zip(outlines, _as_simplified(found), _standing(found, outlines), strict=True)
    return [ring for closed, drawn, stands in both if stands for ring in (closed, drawn)]


def _on_a_level(found: Inspection) -> _Foot:
    """Put the lowest block on a level as wide as it is."""
    block = min(found.kept.tolist(), key=lambda i: float(found.layout.corners(i)[:, -1].min()))
    level = float(found.layout.corners(block)[:, -1].min())
    low, high = _plan_box(found.layout, block)
    flat = [[low[0], level], [high[0], level]]
    bed = np.array(flat) if len(low) == 1 else rectangle(*low, *high)
    return _Foot(block, low, high, bed, level)


def _feet_in_the_plane(found: Inspection, outlines: Sequence[np.ndarray]) -> list[_Foot]:
    """Find the blocks of the lowest course, from left to right, and the part of each that nothing lower covers."""
    blocks = found.kept.tolist()
    low = np.array([ring.min(axis=0) for ring in outlines])
    high = np.array([ring.max(axis=0) for ring in outlines])
    height = float(np.median(high[:, 1] - low[:, 1]))
    near = 1e-3 * height + _opening(found)
    shapes = np.array([shapely.Polygon(ring) for ring in outlines])
    beside = touching(shapes, near)
    arch = _springers_of_arch(beside, low[:, 1])
    feet: list[_Foot] = []
    springers: set[int] = set()
    standing = _standing(found, outlines)
    order = [k for k in np.argsort(low[:, 1], kind="stable").tolist() if standing[k]]
    for k in arch or order:
        if low[k, 1] > low[order[0], 1] + COURSE * height and not arch:
            break
        edges = _lower_edges(outlines[k])
        run, rise = np.abs(edges[-1] - edges[0]).tolist()
        steep = run <= NARROW * (high[k, 0] - low[k, 0]) or rise > (LEVEL if arch else SLOPE) * run
        lower = [j for j in beside[k] if low[j, 1] < low[k, 1]]
        if steep and springers.intersection(lower):
            # It rests on a springer, or on a voussoir that does.
            springers.add(k)
            continue
        if steep and not lower and _can_be_named(found, blocks[k]):
            springers.add(k)
            bed = None
        else:
            taken = _beneath(edges, np.delete(shapes, k))
            taken += [(foot.bed[0, 0], foot.bed[-1, 0]) for foot in feet if foot.bed is not None]
            bed = _widest_free(edges, taken)
            if bed is None:
                continue
        feet.append(_Foot(blocks[k], low[k, :1], high[k, :1], bed, float(low[k, 1])))
    return feet


def _standing(found: Inspection, outlines: Sequence[np.ndarray]) -> np.ndarray:
    """(n,) bool array: blocks that touch another or are half as high as the median: letters below a drawing are not."""
    tall = np.array([np.ptp(ring[:, 1]) for ring in outlines])
    height = float(np.median(tall))
    beside = touching(np.array([shapely.Polygon(ring) for ring in outlines]), 1e-3 * height + _opening(found))
    return (tall > COURSE * height) | np.array([len(others) > 0 for others in beside])


def _as_in_a_run(found: Inspection) -> list[np.ndarray]:
    """(n, 2) arrays: blocks without the corners that a run drops and, near the ground, with their joints closed."""
    outlines = _as_simplified(found)
    if not found.joint_thickness:
        return outlines
    low, high = (np.array([pick(ring[:, 1]) for ring in outlines]) for pick in (np.min, np.max))
    lowest = np.flatnonzero(low <= low.min() + 2.0 * float(np.median(high - low)))
    assembly = solver.Assembly.from_outlines([outlines[k] for k in lowest])
    anchored = np.zeros(len(lowest), dtype=bool)
    laid = np.array([found.layout.laid[found.kept[k]] for k in lowest])
    thickness = found.joint_thickness
    try:
        closed = repaired(assembly, joint_thickness=thickness, overlap_tolerance=None, anchored=anchored, laid=laid)[0]
    except ValueError:
        # What cannot be closed is told where the case is built.
        return outlines
    for k, ring in zip(lowest.tolist(), closed, strict=True):
        outlines[k] = ring
    return outlines


def _as_simplified(found: Inspection) -> list[np.ndarray]:
    return list(as_simplified(found.layout.chosen(found.kept))[0].outlines)


def _springers_of_arch(beside: Sequence[set[int]], bottoms: np.ndarray) -> list[int]:
    """Find the ends of a chain of blocks, if that is all there is and it rises from both of them."""
    ends = [k for k, others in enumerate(beside) if len(others) == 1]
    if len(ends) != 2 or len(beside) < 4 or max(map(len, beside)) > 2:
        return []
    chain = [ends[0], *beside[ends[0]]]
    while following := beside[chain[-1]].difference(chain[-2:]):
        chain += following
    if len(chain) < len(beside):
        return []
    rise = np.diff(bottoms[chain])
    top = int(bottoms[chain].argmax())
    rises = 0 < top < len(chain) - 1 and (rise[:top] >= 0.0).all() and (rise[top:] <= 0.0).all()
    return ends if rises and rise[0] > 0.0 > rise[-1] else []


def _lower_edges(points: np.ndarray) -> np.ndarray:
    """(n, 2) array [m]: from left to right, the corners between the edges of the lower hull that are not too steep."""
    hull = ring_of(shapely.MultiPoint(points).convex_hull)
    order = np.lexsort((hull[:, 1], hull[:, 0]))
    chain = np.roll(hull, -order[0], axis=0)[: (order[-1] - order[0]) % len(hull) + 1]
    run, rise = np.diff(chain, axis=0).T
    gentle = np.flatnonzero((np.abs(rise) <= STEEPEST * run) & (run > 0.0))
    return chain[gentle[0] : gentle[-1] + 2] if len(gentle) else chain[[chain[:, 1].argmin()]]


def _beneath(bed: np.ndarray, shapes: np.ndarray) -> list[tuple[float, float]]:
    """Find the intervals of x of what lies beneath a bed, as the toes of stones that themselves lie higher."""
    if len(bed) < 2:
        return []
    floor = float(shapely.bounds(shapes)[:, 1].min(initial=bed[:, 1].min())) - 1.0
    column = shapely.Polygon([*bed, [bed[-1, 0], floor], [bed[0, 0], floor]])
    found = pieces_of(shapely.intersection(shapes[shapely.intersects(shapes, column)], column))
    return [(left, right) for left, _, right, _ in (piece.bounds for piece in found)]


def _widest_free(bed: np.ndarray, taken: Iterable[tuple[float, float]]) -> np.ndarray | None:
    """Cut the widest part of a bed that no interval of x takes; None where less is left than a foot needs."""
    start, end = float(bed[0, 0]), float(bed[-1, 0])
    left, right = max(uncovered(start, end, taken), key=lambda part: part[1] - part[0], default=(start, start))
    if right - left < EXPOSED * (end - start) or right <= left:
        return None
    inner = bed[(bed[:, 0] > left) & (bed[:, 0] < right)]
    ends = [[x, float(np.interp(x, bed[:, 0], bed[:, 1]))] for x in (left, right)]
    return np.vstack([ends[:1], inner, ends[1:]])


def _bedded(
    outlines: Sequence[np.ndarray], feet: Sequence[_Foot], split: _Split, depth: float, opening: float
) -> tuple[list[Mapping[str, Any]], bool]:
    """Lay two halves whose top follows the beds, with a step half-way between two; whether there are pits, too."""
    beds = sorted((foot.bed for foot in feet if foot.bed is not None), key=lambda bed: float(bed[0, 0]))
    top = [beds[0][0] - [depth, 0.0]]
    for bed, following in zip(beds, [*beds[1:], None], strict=True):
        top += list(bed)
        if following is not None:
            middle = 0.5 * float(bed[-1, 0] + following[0, 0])
            top += [np.array([middle, bed[-1, 1]]), np.array([middle, following[0, 1]])]
    top.append(beds[-1][-1] + [depth, 0.0])
    floor = min(float(ring[:, 1].min()) for ring in outlines) - depth
    (start, _), (end, _) = top[0], top[-1]
    line = shapely.simplify(shapely.LineString(top), ROUNDING * depth)
    whole = shapely.Polygon([[start, floor], [end, floor], *shapely.get_coordinates(line)[::-1]])
    ground = _dug(whole, outlines, [np.array(top[:1]), *beds, np.array(top[-1:])], opening, ROUNDING * depth)
    halves: list[Mapping[str, Any]] = []
    for name, role, left, right in (
        ("ground left", mechanics.FIXED, start, split.at),
        ("ground right", mechanics.MOVING, split.at, end),
    ):
        half = largest_piece(ground.intersection(shapely.box(left, floor - depth, right, floor + 1e3 * depth)))
        if not half.is_empty:
            # Rounding, and the zero that is no negative one, make a file that people read.
            corners = np.round(ring_of(half), 10 - int(np.floor(np.log10(depth)))) + 0.0
            corners = without_collinear(corners)
            corners = np.roll(corners, -int(np.lexsort((corners[:, 0], corners[:, 1]))[0]), axis=0)
            halves.append({"name": name, "role": role, "outline": corners.tolist()})
    return halves, bool(ground.area < whole.area - (ROUNDING * depth) ** 2)


def _dug(
    ground: shapely.Polygon, outlines: Sequence[np.ndarray], beds: Sequence[np.ndarray], mortar: float, least: float
) -> shapely.Geometry:
    """Dig pits about what reaches into the ground, and beside a foot that is lower than the next.

    A wall of ground at the side of a stone would hold it by friction, and ground above it hold it down. So a pit is as
    wide beside a stone as it is deep; where joints are closed by up to ``mortar`` [m] it is by two of them wider and
    deeper, which no run fills, and begins below the stone as drawn. Of a bed it takes no more than an end. ``beds``
    begin and end with the ends of the ground; what reaches in by up to ``least`` [m] does not count.
    """
    (_, floor, _, top), pits = ground.bounds, []
    reach = shapely.union_all([shapely.Polygon(ring) for ring in outlines if ring[:, 1].min() < top])
    reach = reach.intersection(ground)
    for bed, following in pairwise(beds):
        (start, left), (end, right) = bed[-1].tolist(), following[0].tolist()
        low, high = sorted((left, right))
        into = []
        for one, level in ((bed, left), (following, right)):
            width = float(np.ptp(one[:, 0]))
            higher = min(STAND_OFF * width + 2.0 * mortar, width / 3.0)
            into.append(0.0 if high - low <= least else higher if level > low else 0.5 * mortar)
        near, far = start - into[0], end + into[1]
        between = shapely.box(near, floor, far, top)
        around = [part.bounds for part in pieces_of(reach.intersection(between))]
        if end - start < 2.0 * (high - low + 2.0 * mortar):
            # The step half-way is too near.
            beside = near if left == low else far
            around.append((beside, low, beside, high))
        for first, bottom, last, _ in around:
            if high - bottom > least:
                deep = high - bottom + 2.0 * mortar
                level = max(high - deep, 0.5 * (bottom + floor))
                pits.append(shapely.box(max(first - deep, near), level, min(last + deep, far), top))
        reach = reach.difference(between)
    pits += [_above(ring_of(part), top) for part in pieces_of(reach) if part.area > least**2]
    return ground.difference(shapely.union_all(pits))


def _above(ring: np.ndarray, level: float) -> shapely.Geometry:
    """Fill all that lies above an outline, up to a level [m]."""
    ends = np.hstack([ring, np.roll(ring, -1, axis=0)]).reshape(-1, 2, 2)
    raised = ends * [1.0, 0.0] + [0.0, level]
    return shapely.union_all(shapely.convex_hull(shapely.multipoints(np.concatenate([ends, raised], axis=1))))


def _feet_in_space(found: Inspection) -> list[_Foot]:
    """Find the blocks of the lowest course in space, and the bottom faces they lie on in plan."""
    blocks = found.kept.tolist()
    corners = [found.layout.corners(i) for i in blocks]
    low = np.array([points.min(axis=0) for points in corners])
    high = np.array([points.max(axis=0) for points in corners])
    height = high[:, 2] - low[:, 2]
    near = COURSE * float(np.median(height))
    course = np.flatnonzero(low[:, 2] <= low[:, 2].min() + near)
    plans = np.array([shapely.MultiPoint(points[:, :2]).convex_hull for points in corners])
    boxes = shapely.box(low[:, 0], low[:, 1], high[:, 0], high[:, 1])
    beside = touching(boxes, 1e-3 * near + _opening(found))
    feet: list[_Foot] = []
    for k in course.tolist():
        lower = [j for j in beside[k] if low[j, 2] < low[k, 2] - 1e-6 * near]
        covered = plans[k].intersection(shapely.union_all(plans[lower])).area if lower else 0.0
        if covered > (1.0 - EXPOSED) * plans[k].area:
            continue
        flat = corners[k][corners[k][:, 2] <= low[k, 2] + LEVEL * height[k]]
        face = shapely.MultiPoint(flat[:, :2]).convex_hull
        bed = shapely.get_coordinates(face)[:-1] if face.area > NARROW * plans[k].area else None
        rests = (low[lower, 2] < low[k, 2] - 0.5 * near).any()
        # Without a bed it may rest on a springer.
        if bed is not None or not (rests or not _can_be_named(found, blocks[k])):
            feet.append(_Foot(blocks[k], low[k, :2], high[k, :2], bed, float(low[k, 2])))
    if 2 * sum(foot.bed is None for foot in feet) > len(feet):
        # Corner pieces of a vault end flat by chance.
        feet = [replace(foot, bed=None) if _can_be_named(found, foot.block) else foot for foot in feet]
    return feet


def _slab(found: Inspection, beds: Sequence[_Foot], split: _Split, depth: float) -> list[Mapping[str, Any]]:
    """Lay two rectangles in plan, from below the first of the lowest blocks to below the last."""
    level = min(foot.level for foot in beds)
    low, high = found.low[:2] - depth, found.high[:2] + depth
    low[split.axis] = min(foot.low[split.axis] for foot in beds) - depth
    high[split.axis] = max(foot.high[split.axis] for foot in beds) + depth
    halves: list[Mapping[str, Any]] = []
    for name, role, side in (("ground left", mechanics.FIXED, high), ("ground right", mechanics.MOVING, low)):
        near, far = low.copy(), high.copy()
        (far if side is high else near)[split.axis] = split.at
        plan = rectangle(*near, *far).tolist()
        halves.append({"name": name, "role": role, "outline": plan, "levels": [level - depth, level]})
    return halves


def _pads(found: Inspection, beds: Sequence[_Foot], split: _Split) -> list[Mapping[str, Any]]:
    """Lay a pad under each block of the lowest course: what is level has one height only.

    It stands off from what is lower beside it, which it would hold by friction, as the ground in the plane does.
    """
    layout = found.layout
    corners = [layout.corners(i) for i in found.kept]
    low, high = (np.array([pick(points[:, 2]) for points in corners]) for pick in (np.min, np.max))
    # Faces nearer than that would be moved onto each other.
    opening = 1.01 * facing_tolerance([layout.solids[i] for i in found.kept], found.joint_thickness)
    pads: list[Mapping[str, Any]] = []
    for number, foot in enumerate(beds, 1):
        assert foot.bed is not None
        bed = shapely.Polygon(foot.bed)
        role = mechanics.MOVING if split.moves(foot) else mechanics.FIXED
        thick = rounded_length(0.5 * float(np.ptp(foot.bed, axis=0).max()))
        levels = [foot.level - thick, foot.level]
        most, plan = STAND_OFF * math.sqrt(bed.area) + opening, bed
        for j in np.flatnonzero((low < levels[1] - ROUNDING * thick) & (high > levels[0])):
            off = min(levels[1] - low[j] + opening, most)
            below = plan_beyond(corners[j], levels[1] - corners[j][:, 2])
            plan = plan.difference(below.buffer(off, join_style="mitre"))
        # Of what is all around the bed, as no hull can be, the run tells that it overlaps.
        outline = ring_of(largest_piece(plan if plan.area > EXPOSED * bed.area else bed))
        pads.append({"name": f"ground {number}", "role": role, "outline": outline.tolist(), "levels": levels})
    return pads


def _split(feet: Sequence[_Foot], opening: float) -> _Split:
    """Split feet in the gap nearest to their middle, along the axis whose gap is wider, or else the longer one."""
    found = []
    for axis in range(len(feet[0].low)):
        spans = sorted((float(foot.low[axis]), float(foot.high[axis])) for foot in feet)
        left, right = spans[0][0], max(end for _, end in spans)
        middle = 0.5 * (left + right)
        gaps = [(start, end) for start, end in uncovered(left, right, spans) if end - start > opening]
        near = min(gaps, key=lambda gap: abs(0.5 * sum(gap) - middle), default=(middle, middle))
        # Of two gaps that are as wide but for rounding, or of none, the first axis has it.
        found.append((near[1] - near[0], right - left, _Split(axis, 0.5 * sum(near))))
    best = found[0]
    for other in found[1:]:
        if other[0] > 1.01 * best[0] or (best[0] == other[0] == 0.0 and other[1] > 1.01 * best[1]):
            best = other
    return best[2]


def _opening(found: Inspection) -> float:
    """Widest gap that is mortar between two stones, and no opening [m]."""
    return 1.01 * found.joint_thickness


def _plan_box(layout: Layout, block: int) -> tuple[np.ndarray, np.ndarray]:
    points = layout.corners(block)[:, : layout.dimension - 1]
    return points.min(axis=0), points.max(axis=0)


def _can_be_named(found: Inspection, block: int) -> bool:
    return bool(_names_of(found.layout, found.kept, [block]))


def _names_of(layout: Layout, kept: Iterable[int], chosen: Sequence[int]) -> list[str]:
    """Names that as keys of roles stand for these blocks and no other; none where they cannot be told by names."""
    names = dict.fromkeys(layout.names[i] for i in chosen)
    labels = list(zip(layout.names, mechanics.unique_names(layout.names), layout.groups, layout.materials, strict=True))
    others = {label for i in kept if i not in set(chosen) for label in labels[i]}
    return [] if "" in names or others.intersection(names) else list(names)
