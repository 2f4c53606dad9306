"""Walls drawn as outlines with openings: which outlines they are, and where in them there is wall."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import shapely

from blockvis.text import by_similarity, place_text
from solver import mechanics

from .layout import Layout
from .left_out import LeftOut, matches
from .notes import CHANGED, Note
from .outlines import ROUNDING, ends_of, filled, largest_piece, ring_of, share_in
from .roles import roles_of
from .selection import ANNOTATIONS, labels_of

#: An outline lies in a wall if this fraction of its area does.
INSIDE = 0.5

#: Outlines are the same if what only one of them covers is below this fraction of its area.
SAME = 1e-4

#: What of an opening lies outside of its wall is reported from this fraction of its area on.
REPORTED = 0.01

#: Kinds of what a reader leaves out that may be outlines of walls.
_OUTLINES = ("hole", "background", "across")


@dataclass(frozen=True)
class Region:
    """A wall drawn as an outline: polygons [m] of it, without holes, and of its openings.

    ``taken`` are other blocks, and walls of another bond, in it.
    """

    wall: Any
    layer: str
    name: str
    openings: list[Any] = field(default_factory=list)
    taken: list[Any] = field(default_factory=list)


@dataclass(frozen=True)
class Choice:
    """What of a drawing is filled with one bond: layers, groups, materials and names of outlines, or patterns of them.

    Without openings these are all outlines in the walls.
    """

    walls: tuple[str, ...]
    openings: tuple[str, ...] = ()


@dataclass(frozen=True)
class _Drawn:
    """A closed outline of a drawing: a block, or what was left out."""

    shape: Any
    holes: tuple[Any, ...]
    labels: tuple[str, ...]
    block: int = -1
    item: int = -1


def regions_of(
    layout: Layout, choices: Sequence[Choice], roles: Mapping[str, str] | None = None
) -> tuple[list[list[Region]], Layout]:
    """Find the walls that are to be filled, for each choice, and what else is drawn.

    Supports, by ``roles``, are neither walls nor openings. ValueError where no closed outline is on a layer, and for an
    opening outside of the walls; names the drawing, layer and place.
    """
    drawn = _drawn(layout)
    role = roles_of(layout, roles or {}, all_match=False)
    free = [k for k, one in enumerate(drawn) if one.block < 0 or role[one.block] == mechanics.FREE]
    walls = _walls_of(layout, drawn, free, choices)
    regions = [_nested([drawn[k] for k, n in walls.items() if n == number]) for number in range(len(choices))]
    every = [(region, number) for number, group in enumerate(regions) for region in group]
    _take_out(every)
    others = [k for k in free if k not in walls]
    opened = {k: _opened_by(drawn[k], every, choices, layout.source) for k in others}
    for k, around in opened.items():
        for region in around:
            region.openings.append(drawn[k].shape)
    left = [k for k in others if not opened[k] and drawn[k].block >= 0]
    notes = [*layout.notes, *_reaching_out(every), *_left_in(drawn, left, every)]
    used = [drawn[k] for k in (*walls, *filter(opened.get, others))]
    return regions, replace(_without(layout, used), notes=tuple(notes))


def _take_out(every: Sequence[tuple[Region, int]]) -> None:
    """Take walls of other choices, by their number, out of the larger ones around them."""
    for region, number in every:
        region.taken.extend(
            other.wall for other, n in every
            if n != number and other.wall.area < region.wall.area and share_in(other.wall, region.wall) > ROUNDING
        )  # fmt: skip


def _without(layout: Layout, used: Sequence[_Drawn]) -> Layout:
    blocks, items = {one.block for one in used}, {one.item for one in used}
    rest = layout.chosen([i for i in range(layout.n_blocks) if i not in blocks])
    return replace(rest, left_out=tuple(one for i, one in enumerate(layout.left_out) if i not in items))


def _walls_of(
    layout: Layout, drawn: Sequence[_Drawn], free: Sequence[int], choices: Sequence[Choice]
) -> dict[int, int]:
    """Find which outlines are walls, and the number of the choice of each; the first that names it has it."""
    source = f"'{layout.source}'"
    walls: dict[int, int] = {}
    for number, choice in enumerate(choices):
        for key, patterns in (("walls", choice.walls), ("openings", choice.openings)):
            for pattern in patterns:
                if not any(matches(drawn[k].labels, [pattern]) for k in free):
                    raise ValueError(f"{source}: {_no_outline(layout, drawn, key, pattern)}")
        mine = [k for k in free if k not in walls and matches(drawn[k].labels, choice.walls)]
        if not mine:
            listed = ", ".join(f"'{word}'" for word in choice.walls)
            raise ValueError(
                f"{source}: bond: walls = {listed} are filled by another [[bond]]; give each its own layers"
            )
        walls |= dict.fromkeys(mine, number)
    return walls


def _opened_by(
    one: _Drawn, every: Sequence[tuple[Region, int]], choices: Sequence[Choice], source: str
) -> list[Region]:
    """Find the walls of which an outline is an opening.

    One that a choice asks for may reach beyond a wall; of a choice that asks for none, those within it are openings.
    """
    asked = [number for number, choice in enumerate(choices) if matches(one.labels, choice.openings)]
    opened = [
        region for region, number in every
        if (number in asked or not choices[number].openings)
        and (asked or (one.shape.area < region.wall.area and not _is_beside(one)))
        and share_in(one.shape, region.wall) > (ROUNDING if asked else INSIDE)
    ]  # fmt: skip
    if asked and not opened:
        at = place_text(one.shape.centroid.coords[0], 6)
        raise ValueError(
            f"'{source}': the opening '{one.labels[-1]}' on layer '{one.labels[0]}' around {at} lies "
            "outside of the walls; move it into one, or leave it out (ignore)"
        )
    return opened


def _drawn(layout: Layout) -> list[_Drawn]:
    found = []
    for i, ring in enumerate(layout.outlines):
        shape = _polygon(ring)
        if shape is not None:
            found.append(_Drawn(shape, (), labels_of(layout, i), block=i))
    for i, one in enumerate(layout.left_out):
        shape = _polygon(one.points) if one.closed and one.kind in _OUTLINES else None
        if shape is not None:
            holes = tuple(hole for hole in map(_polygon, one.holes) if hole is not None)
            found.append(_Drawn(shape, holes, (one.layer, one.name), item=i))
    shapely.prepare([one.shape for one in found])
    return found


def _polygon(ring: np.ndarray) -> Any:
    """Make a polygon of an outline, of one that touches itself its largest part; None where it has no area."""
    if len(ring) < 3:
        return None
    shape = shapely.Polygon(ring)
    shape = largest_piece(shape if shape.is_valid else shapely.make_valid(shape))
    return None if shape.is_empty else shape


def _is_beside(one: _Drawn) -> bool:
    """Whether by its layer an outline explains the drawing."""
    return ANNOTATIONS.fullmatch(one.labels[0].strip()) is not None


def _nested(drawn: Sequence[_Drawn]) -> list[Region]:
    """Walls among the outlines of one choice: those in an even number of others; those in an odd one are openings."""
    unlike: list[_Drawn] = []
    for one in sorted(drawn, key=lambda one: -one.shape.area):
        alike = (
            one.shape.intersects(other.shape)
            and one.shape.symmetric_difference(other.shape).area < SAME * other.shape.area
            for other in unlike
        )
        twin = next((k for k, same in enumerate(alike) if same), None)
        if twin is None:
            unlike.append(one)
        elif one.holes:
            # An outline and the hatch in it.
            unlike[twin] = replace(unlike[twin], holes=(*unlike[twin].holes, *one.holes))
    regions: list[Region] = []
    for k, inner in filled([ring_of(one.shape) for one in unlike], SAME):
        one, openings = unlike[k], [unlike[hole].shape for hole in inner]
        regions.append(Region(one.shape, one.labels[0], one.labels[-1], openings=[*one.holes, *openings]))
    return regions


def _no_outline(layout: Layout, drawn: Sequence[_Drawn], key: str, pattern: str) -> str:
    """Say why there is no outline of a wall or opening."""
    lines = [
        one
        for one in layout.left_out
        if not one.closed and one.kind == "open" and matches((one.layer, one.name), [pattern])
    ]
    if lines:
        gap, place = _smallest_gap(lines)
        at = place_text(place, 6)
        return (
            f"bond: the outline on layer '{lines[0].layer}' is open by {gap:.3g} m at {at}; close it: "
            "join the ends of its lines"
        )
    layers = Counter(one.labels[0] or one.labels[-1] for one in drawn)
    near = by_similarity(pattern, list(layers)[:2000])[:12]
    listed = ", ".join(f"'{layer}' ({layers[layer]})" for layer in near) or "no closed outline"
    return f"bond: {key} = '{pattern}' matches no closed outline; the drawing has {listed}"


def _smallest_gap(lines: Sequence[LeftOut]) -> tuple[float, np.ndarray]:
    """Smallest distance between ends of lines that do not meet [m], and where that is."""
    ends = ends_of(one.points for one in lines)
    apart = np.hypot(*(ends[:, None] - ends).transpose(2, 0, 1))
    size = float(np.ptp(np.concatenate([one.points for one in lines]), axis=0).max())
    apart[apart <= ROUNDING * size] = np.inf
    i, j = np.unravel_index(int(np.argmin(apart)), apart.shape)
    return float(apart[i, j]), ends[i] + 0.0


def _reaching_out(every: Sequence[tuple[Region, int]]) -> list[str]:
    """Note openings that reach beyond their wall."""
    found = []
    for region, _ in every:
        for opening in region.openings:
            out = 1.0 - share_in(opening, region.wall)
            if out > REPORTED:
                at = place_text(opening.centroid.coords[0], 6)
                found.append(
                    f"bond: {out:.0%} of the opening around {at} lies outside of its wall on layer "
                    f"'{region.layer}'; what lies in it is taken out"
                )
    return [Note(CHANGED, text) for text in found]


def _left_in(drawn: Sequence[_Drawn], others: Sequence[int], every: Sequence[tuple[Region, int]]) -> list[str]:
    """Lay the bond around other blocks in a wall, and note them by their layer."""
    layers: Counter[str] = Counter()
    for k in others:
        for region, _ in every:
            if (
                drawn[k].shape.area < region.wall.area
                and share_in(drawn[k].shape, region.wall) > INSIDE
                and not _is_beside(drawn[k])
            ):
                region.taken.append(drawn[k].shape)
                layers[drawn[k].labels[0]] += 1
    return [
        Note(
            CHANGED,
            f"bond: {n} outline{'s' if n > 1 else ''} on layer '{layer}' in the walls, not among the openings, "
            "stayed as blocks; the bond is laid around them",
        )
        for layer, n in layers.items()
    ]
