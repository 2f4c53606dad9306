"""Walls drawn as outlines with openings, filled with the stones of a bond."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely

from blockvis.layout.layout import Layout
from blockvis.layout.notes import CHANGED, Note
from blockvis.layout.outlines import largest_piece, pieces_of, without_collinear
from blockvis.text import place_text
from solver.mechanics import counted

from .bricks import LOWEST_BRICK, NARROWEST, in_simple_pieces, places_in, without_slivers
from .dimensions import MOST_BLOCKS, above_zero, at_least_zero, choice, whole
from .heads import HEADS, LESS, Units, head_of, top_of
from .patterns import BRICKWORK, LEANS, PATTERNS, bedded, coursed, rubble

#: What is smaller than this fraction of a brick and has no brick beside it is joined to a head.
CRUMB = 0.1

#: Corners lie on a grid of this fraction of the size of the wall, or of the last digit of its place.
GRID = 1e-12

#: An opening has wall over it where a strip of this fraction of a course over its top is wall at all.
OVER = 0.1

#: What is left over when shapes are cut that share an edge is dropped below this fraction of a brick; the stones fill
#: the wall to this fraction of its area.
DUST = 1e-9

#: Values that only some bonds, or heads, have: the key that chooses these, and its words.
OF_KINDS = {
    "stone": ("bond", ("rubble",)), "flatness": ("bond", ("rubble",)),
    "bearing": ("heads", tuple(head for head in HEADS if head != "none")),
}  # fmt: skip


@dataclass(frozen=True)
class Pattern:
    """How a wall is laid: the parameters of :func:`bond`, checked."""

    bond: str = "running"
    brick: tuple[float, float] = (0.25, 0.075)
    joint: float = 0.0
    heads: str = "auto"
    bearing: float | None = None
    quoins: tuple[float, float] | None = None
    stone: float | None = None
    flatness: float = 1.6
    seed: int = 0

    def __post_init__(self) -> None:
        """Check every value."""
        choice("bond", self.bond, PATTERNS)
        choice("heads", self.heads, HEADS)
        for name in ("brick", "quoins"):
            pair = getattr(self, name)
            if pair is None:
                continue
            if isinstance(pair, str) or not isinstance(pair, Sequence) or len(pair) != 2:
                raise ValueError(f"{name} is {pair!r}; give its length and height [length, height] in m")
            sizes = tuple(above_zero(f"{name}: {word}", v) for word, v in zip(("length", "height"), pair, strict=True))
            object.__setattr__(self, name, sizes)
        above_zero("flatness", self.flatness, "")
        whole("seed", self.seed, 0, 2**31)
        for name in ("bearing", "stone"):
            if getattr(self, name) is not None:
                above_zero(name, getattr(self, name))
        for name, (key, kinds) in OF_KINDS.items():
            if getattr(self, name) != getattr(type(self), name) and getattr(self, key) not in kinds:
                raise ValueError(
                    f"{name} is that of {key} {' or '.join(kinds)}; {key} is '{getattr(self, key)}': leave {name} out"
                )
        if self.bond == "rubble" and self.stone is not None and self.brick != Pattern.brick:
            raise ValueError("brick and stone are both given; the size of rubble is that of its stone: leave brick out")
        if at_least_zero("joint", self.joint) > 0.5 * min(self.module):
            raise ValueError(
                f"joint is {self.joint:g} m, more than half of a course of {min(self.module):g} m; give the thickness "
                "of the mortar alone"
            )

    @property
    def module(self) -> tuple[float, float]:
        """Length and height of a stone with its joint [m]."""
        if self.bond == "rubble":
            stone = self.stone or self.brick[0]
            return stone, stone / self.flatness
        return self.brick

    @property
    def notes(self) -> tuple[str, ...]:
        """What of the values is not used."""
        if self.bond != "rubble" or self.brick == Pattern.brick:
            return ()
        length, height = self.module
        said = f"bond: stones of rubble are {length:g} m long and {height:.3g} m high in the mean, by flatness"
        remedy = f"give stone = {length:g} and flatness = {length / self.brick[1]:.3g} for this height"
        return (Note(CHANGED, f"{said}; the height of brick, {self.brick[1]:g} m, is not used: {remedy}"),)


def bond(
    outline: Any,
    openings: Sequence[Any] = (),
    *,
    bond: str = "running",
    brick: tuple[float, float] = (0.25, 0.075),
    joint: float = 0.0,
    heads: str = "auto",
    bearing: float | None = None,
    quoins: tuple[float, float] | None = None,
    stone: float | None = None,
    flatness: float = 1.6,
    seed: int = 0,
) -> Layout:
    """Fill the outline of a wall with the stones of a bond, with heads over its openings.

    Parameters
    ----------
    outline : shapely.Polygon, or (n, 2) array [m]
        The wall; holes are openings. A notch in its lower edge is a door.
    openings : sequence of shapely.Polygon, or (n, 2) arrays [m]
        They may reach the rim of the wall, as doors do.
    bond : {"running", "stack", "english", "flemish", "header", "ashlar", "rubble"}
        In ashlar the lengths of the stones of a course are random, in rubble all of their outline.
    brick : (float, float) [m]
        Length and height of a brick, joint included; of ashlar in the mean.
    joint : float [m]
        Thickness of the mortar left open between stones; 0 for stones that touch and fill the wall.
    heads : {"auto", "lintel", "flat arch", "arch", "none"}
        Over openings with wall over them. "auto" is a ring of voussoirs around a curved top and a lintel over a
        straight one; "arch" puts a relieving arch over a straight one.
    bearing : float, optional [m]
        Of lintels on either side; half a brick by default, less where there is no room.
    quoins : (float, float), optional [m]
        Length and height of larger stones at the upright ends of the wall, every second one half as long.
    stone, flatness : float
        Mean length [m] of the stones of rubble, and their length over their height; a brick long by default.
    seed : int
        Of random lengths and outlines.

    Returns
    -------
    Layout
        "brick 1-1" (course from the bottom, position from the left), "stone 1" of rubble, "voussoir 2-1", "lintel 2",
        "quoin 1"; openings are numbered as they are given, holes and notches after them. Without a ground.

    Raises
    ------
    ValueError
        For a brick longer or higher than the wall, an opening outside of it, and impossible values.

    Examples
    --------
    >>> wall = bond([[0, 0], [3, 0], [3, 1.5], [0, 1.5]], [[[1, 0], [2, 0], [2, 1], [1, 1]]], brick=(0.5, 0.25))
    >>> wall.n_blocks, wall.names[-1]
    (32, 'lintel 1')
    """
    pattern = Pattern(
        bond=bond, brick=brick, joint=joint, heads=heads, bearing=bearing, quoins=quoins, stone=stone,
        flatness=flatness, seed=seed,
    )  # fmt: skip
    return filled(_polygon(outline, "the outline"), [_polygon(one, f"opening {k}") for k, one in
                  enumerate(openings, start=1)], pattern)  # fmt: skip


def _polygon(shape: Any, what: str) -> shapely.Polygon:
    try:
        polygon = shape if isinstance(shape, shapely.Polygon) else shapely.Polygon(np.asarray(shape, dtype=float))
    except (TypeError, ValueError) as error:
        raise ValueError(f"{what} is no polygon ({error}); give its corners [[x, y], ...] in m") from None
    if not polygon.is_valid or polygon.area == 0.0:
        reason = shapely.is_valid_reason(polygon) if polygon.area else "it has no area"
        raise ValueError(f"{what} is no simple polygon: {reason}; redraw it")
    return polygon


# On a grid GEOS divides by zero inside, for parallel edges, and numpy would tell.
@np.errstate(divide="ignore", invalid="ignore")
def filled(
    wall: shapely.Polygon,
    openings: Sequence[shapely.Polygon],
    pattern: Pattern,
    taken: shapely.Geometry | None = None,
    *,
    mortar: bool = True,
) -> Layout:
    """Fill a wall with stones around what is ``taken``; see :func:`bond`. Joints may be left open for the mortar."""
    # Far from the origin, as in maps, corners have no digits left for a grid.
    corner = np.array(wall.bounds[:2])
    wall, *holes = [_shifted(shape, -corner) for shape in (wall, *openings)]
    _check_size(wall, pattern)
    _check_inside(wall, holes, corner)
    length, height = pattern.module
    grid = max(GRID * max(*wall.bounds[2:], length), float(np.spacing(np.abs(corner)).max()))
    solid = shapely.Polygon(wall.exterior)
    holes = _apart([*holes, *map(shapely.Polygon, wall.interiors), *_notches(solid, grid)])
    rest = _without(wall, holes if taken is None else [_shifted(taken, -corner), *holes], grid)
    area = rest.area
    if not area:
        raise ValueError("openings and holes leave nothing of the wall; leave them out, or draw the wall around them")
    bearing = length / 2.0 if pattern.bearing is None else pattern.bearing
    units = Units(length=length, height=height, bearing=bearing, grid=grid)
    stones, rest, lacking = _heads(holes, rest, pattern, units)
    quoins = _quoins(solid, rest, pattern, grid)
    stones += [(f"quoin {k}", shape) for k, shape in enumerate(quoins, start=1)]
    rest = _without(rest, quoins, grid)
    stones = _with_crumbs(_laid(rest, wall.bounds, pattern, grid), stones, pattern, grid)
    kept = sum(shape.area for _, shape in stones)
    if abs(kept - area) > DUST * area:
        raise ValueError(
            f"the stones fill {kept:.9g} of {area:.9g} m² of the wall; its outline may touch itself: redraw it"
        )
    if pattern.joint and mortar:
        stones = _with_mortar(stones, pattern.joint)
    notes = [_note(what, shapes, corner) for what, shapes in lacking.items()]
    if pattern.quoins and not quoins:
        at = place_text(corner + wall.centroid.coords[0], 6)
        ends = f"upright, to {1e3 * LEANS:g} mm in a metre, {2.0 * pattern.quoins[1]:g} m high and free of openings"
        said = f"bond: the wall around {at} has no quoins: no end is {ends}; give smaller ones"
        notes.append(Note(CHANGED, said))
    return Layout(
        blocks=tuple(without_collinear(np.array(shape.exterior.coords)[:-1], 1e-9) + corner for _, shape in stones),
        names=tuple(name for name, _ in stones),
        materials=tuple("brick" if name.startswith("brick") else "stone" for name, _ in stones),
        notes=(*notes, *pattern.notes),
    )


def _shifted(shape: Any, by: np.ndarray) -> Any:
    return shapely.transform(shape, lambda xy: xy + by)


def _check_size(wall: shapely.Polygon, pattern: Pattern) -> None:
    """Refuse bricks larger than the wall, and more of them than can be analysed."""
    _, _, width, high = wall.bounds
    length, height = pattern.module
    word = "stone" if pattern.bond == "rubble" else "brick"
    for size, room, long, wide in ((length, width, "long", "wide"), (height, high, "high", "high")):
        if size > room * (1.0 + 1e-9):
            raise ValueError(
                f"{word} is {size:g} m {long}, the wall {room:.4g} m {wide}; give a smaller {word}, or the unit of the "
                "drawing"
            )
    number = wall.area / (length * height)
    if number > MOST_BLOCKS:
        raise ValueError(
            f"{word} of {length:g} × {height:.3g} m makes {number:.3g} blocks of a wall of {wall.area:.4g} m²; at most "
            f"{MOST_BLOCKS} can be laid: give a larger {word}, or the unit of the drawing"
        )


def _check_inside(wall: shapely.Polygon, holes: Sequence[shapely.Polygon], corner: np.ndarray) -> None:
    """Refuse an opening outside of its wall; both are as seen from a corner."""
    for number, hole in enumerate(holes, start=1):
        if hole.intersection(wall).area <= DUST * hole.area:
            at = place_text(corner + hole.centroid.coords[0], 6)
            raise ValueError(f"opening {number} around {at} lies outside its wall; move it, or leave it out")


def _notches(solid: shapely.Polygon, grid: float) -> list[shapely.Polygon]:
    """Doors drawn as notches of the outline: what its box has beside it that reaches the box at the bottom only."""
    left, low, right, high = solid.bounds
    beside = shapely.difference(shapely.box(left, low, right, high), solid, grid_size=grid)
    near = 1e-6 * (right - left)
    found = []
    for part in pieces_of(beside):
        a, b, c, d = part.bounds
        if b < low + near and a > left + near and c < right - near and d < high - near:
            found.append(shapely.Polygon(part.exterior))
    return found


def _apart(holes: Sequence[shapely.Polygon]) -> list[shapely.Polygon]:
    """Make one opening of those that overlap or touch, in the order in which they are given."""
    without_holes = [shapely.Polygon(part.exterior) for part in pieces_of(shapely.union_all(holes))]
    parts = pieces_of(shapely.union_all(without_holes))
    return sorted(parts, key=lambda part: next(k for k, hole in enumerate(holes) if part.intersects(hole)))


def _has_wall_over(hole: shapely.Polygon, rest: shapely.Geometry, strip: float) -> bool:
    top = top_of(hole)
    middle, third = (top.left + top.right) / 2.0, top.span / 3.0
    over = shapely.box(middle - third / 2.0, top.crown, middle + third / 2.0, top.crown + strip)
    return bool(shapely.intersection(over, rest).area > 0.5 * over.area)


def _nearest(hole: shapely.Polygon, holes: Sequence[shapely.Polygon]) -> float:
    """Distance from an opening to the next one that its head could meet [m]."""
    left, low, right, high = hole.bounds
    tall = shapely.box(left, (low + high) / 2.0, right, high + (high - low) / 2.0)
    return min((tall.distance(other) for other in holes if other is not hole), default=np.inf)


def _quoins(solid: shapely.Polygon, rest: shapely.Geometry, pattern: Pattern, grid: float) -> list[shapely.Polygon]:
    """Larger stones along the upright edges of a wall, long and short in turn."""
    if pattern.quoins is None:
        return []
    length, height = pattern.quoins
    if 2.0 * length > solid.bounds[2]:
        raise ValueError(
            f"quoins are {length:g} m long, the wall {solid.bounds[2]:.4g} m wide; give at most half of that"
        )
    ring = np.array(shapely.orient_polygons(solid).exterior.coords)
    found: list[shapely.Polygon] = []
    for (x, y), (u, v) in zip(ring[:-1].tolist(), ring[1:].tolist(), strict=True):
        # Counter-clockwise, the wall lies on the left of an edge that rises and on the right of one that falls.
        if abs(x - u) >= LEANS * abs(y - v) or abs(y - v) < 2.0 * height:
            continue
        low, n = min(y, v), max(1, round(abs(y - v) / height - 0.2))
        levels = [*(low + height * np.arange(n)), max(y, v)]
        inwards = -1.0 if v > y else 1.0
        for k in range(n):
            middle = x + (u - x) * ((levels[k] + levels[k + 1]) / 2.0 - y) / (v - y)
            reach = middle + inwards * (length if k % 2 == 0 else length / 2.0)
            # The edge cuts it, as drawn.
            beyond = middle - inwards * abs(x - u)
            box = shapely.box(min(beyond, reach), levels[k], max(beyond, reach), levels[k + 1])
            clipped = pieces_of(shapely.intersection(box, rest, grid_size=grid))
            least = 0.95 * abs(reach - middle) * (levels[k + 1] - levels[k])
            if len(clipped) == 1 and clipped[0].area > least and not len(clipped[0].interiors):
                found += clipped
    return found


def _without(wall: shapely.Geometry, parts: Sequence[shapely.Geometry], grid: float) -> shapely.Geometry:
    """Take parts out of a wall; a line that is left of it, as of an edge that both share on a grid, is none of it."""
    left = shapely.difference(wall, shapely.union_all(parts, grid_size=grid), grid_size=grid) if parts else wall
    return shapely.MultiPolygon(pieces_of(left))


def _note(what: str, openings: Sequence[shapely.Polygon], corner: np.ndarray) -> str:
    """Say of which openings the head is another than was asked for, or missing: ``what`` is what they have."""
    at = place_text(np.array(openings[0].centroid.coords[0]) + corner, 6)
    said = f"bond: {counted(len(openings), 'opening has', 'openings have')} no room for "
    place = f", the first around {at}"
    if not what:
        hang = "what lies over them may hang; give a smaller bearing or brick"
        return Note(CHANGED, f"{said}a head{place}: {hang}")
    text = f"{said}the head that is asked for and got {what}{place}"
    # Heads of a smaller size are what a mason would build; a lintel carries in another way.
    return Note(CHANGED, text) if what == LESS[1] else text


def _heads(
    holes: Sequence[shapely.Polygon], rest: shapely.Geometry, pattern: Pattern, units: Units
) -> tuple[list[tuple[str, shapely.Polygon]], shapely.Geometry, dict[str, list[shapely.Polygon]]]:
    """Lay heads over openings; give their stones, what is left of the wall, and openings without room for theirs.

    These come by what they got instead, "" for nothing.
    """
    stones: list[tuple[str, shapely.Polygon]] = []
    lacking: dict[str, list[shapely.Polygon]] = {}
    for number, hole in enumerate(holes, start=1):
        if pattern.heads == "none" or not _has_wall_over(hole, rest, OVER * units.height):
            continue
        head = head_of(hole, pattern.heads, rest, _nearest(hole, holes), units)
        word, parts, less = head or ("", [], "")
        if head is None or less:
            lacking.setdefault(less, []).append(hole)
        several = len(parts) > 1
        stones += [(f"{word} {number}-{i}" if several else f"{word} {number}", part) for i, part in enumerate(parts, 1)]
        rest = _without(rest, parts, units.grid)
    return stones, rest, lacking


def _laid(
    rest: shapely.Geometry, box: tuple[float, ...], pattern: Pattern, grid: float
) -> list[tuple[str, shapely.Polygon]]:
    """Lay the pattern where there is wall, and join what is cut too small."""
    length, height = pattern.module
    random = pattern.bond == "rubble"
    if random:
        units = rubble(box[2], box[3], length, pattern.flatness, pattern.seed)
    else:
        units = coursed(pattern.bond, box[2], box[3], pattern.brick, pattern.seed)
    cut = shapely.intersection(np.array(units), rest, grid_size=grid)
    pieces, is_complete = [], []
    for unit, shape in zip(units, cut, strict=True):
        parts = in_simple_pieces(shape, grid)
        if not random and shape.area < (1.0 - 1e-6) * unit.area:
            parts = [cut for part in parts for cut in _without_tongues(part, height, grid)]
        pieces += parts
        is_complete += [part.area > (1.0 - 1e-6) * unit.area for part in parts]
    if random:
        pieces = bedded(pieces, rest)
    joined = without_slivers(
        pieces, lambda shape, piece: not is_complete[piece] and _is_sliver(shape, length, height), height, grid
    )
    return _numbered([shape for shape, _ in joined], pattern)


def _numbered(joined: Sequence[shapely.Polygon], pattern: Pattern) -> list[tuple[str, shapely.Polygon]]:
    """Name stones by their course and their place in it, those of rubble in rows."""
    height = pattern.module[1]
    middles = shapely.get_coordinates(shapely.centroid(joined))
    if pattern.bond == "rubble":
        order = np.lexsort((middles[:, 0], np.round(middles[:, 1] / height)))
        return [(f"stone {k}", joined[i]) for k, i in enumerate(order.tolist(), start=1)]
    courses = np.floor(np.array([shape.bounds[1] for shape in joined]) / height + 1e-6).astype(int)
    order = np.lexsort((middles[:, 0], courses))
    word = "brick" if pattern.bond in BRICKWORK else "stone"
    return [(f"{word} {place}", joined[i]) for place, i in zip(places_in(courses[order].tolist()), order, strict=True)]


def _without_tongues(piece: shapely.Polygon, height: float, grid: float) -> list[shapely.Polygon]:
    """Cut off strips that a head leaves of a brick, so that they join what they lie on."""
    if len(piece.exterior.coords) < 6:
        return [piece]
    half = NARROWEST * height / 2.0
    body = piece.buffer(-half, join_style="mitre").buffer(half, join_style="mitre")
    strips = [
        strip for strip in pieces_of(shapely.difference(piece, body, grid_size=grid))
        if strip.length > 2.0 * NARROWEST * height
        and strip.area > 0.98 * strip.envelope.area
    ]  # fmt: skip
    rest = in_simple_pieces(shapely.difference(piece, shapely.union_all(strips), grid_size=grid), grid)
    return [*rest, *strips] if strips and len(rest) == 1 else [piece]


def _is_sliver(shape: shapely.Polygon, length: float, height: float) -> bool:
    if shape.area < LOWEST_BRICK * (1.0 - 1e-6) * length * height:
        return True
    low, high = shape.bounds[1::2]
    return high - low < LOWEST_BRICK * height or bool(shape.buffer(-NARROWEST / 2.0 * height).is_empty)


def _with_crumbs(
    laid: list[tuple[str, shapely.Polygon]], others: list[tuple[str, shapely.Polygon]], pattern: Pattern, grid: float
) -> list[tuple[str, shapely.Polygon]]:
    """Join what is left between heads and openings, a crumb of a brick, to a head or quoin; drop dust."""
    length, height = pattern.module
    every, crumb = [*laid, *others], CRUMB * length * height
    shapes = [shape for _, shape in every]
    joined = without_slivers(shapes, lambda shape, piece: piece < len(laid) and shape.area < crumb, height, grid)
    return [(every[piece][0], shape) for shape, piece in joined if shape.area > DUST * length * height]


def _with_mortar(stones: list[tuple[str, shapely.Polygon]], joint: float) -> list[tuple[str, shapely.Polygon]]:
    """Draw stones back from each other by half a joint; where no stone lies beside them they stay."""
    shapes = [shape for _, shape in stones]
    tree = shapely.STRtree(shapes)
    reduced = []
    for i, (name, shape) in enumerate(stones):
        # Neighbours along an oblique edge are a rounding error apart.
        near = tree.query(shape, "dwithin", distance=1e-6 * joint).tolist()
        beside = shapely.union_all([shapes[j] for j in near if j != i])
        reach = shape.buffer(joint, join_style="mitre")
        free = shapely.difference(reach, beside)
        drawn = shapely.intersection(free.buffer(-joint / 2.0, join_style="mitre"), shape)
        left = largest_piece(drawn)
        # What mortar would hide stays as it is, a stone that touches.
        reduced.append((name, left if left.area > 0.2 * shape.area else shape))
    return reduced
