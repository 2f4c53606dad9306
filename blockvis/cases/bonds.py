"""Walls of a drawing that a case fills with the stones of a bond."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace

import shapely

from blockvis.generators.fill import Pattern, filled
from blockvis.generators.heads import HEADS
from blockvis.generators.patterns import PATTERNS
from blockvis.layout.layout import Layout
from blockvis.layout.notes import CHANGED, Note
from blockvis.layout.regions import Choice, Region, regions_of
from blockvis.layout.selection import sorted_out
from blockvis.text import beginning
from solver.mechanics import counted

from .key import NOT_NEGATIVE, POSITIVE, TEXTS, Key, Section, one_of, pair_of, whole
from .toml_table import Table

_DEFAULT = Pattern()
_SIZE = pair_of("[length, height]")

BOND = Section(
    "bond",
    "A wall that the drawing has as an outline with openings, filled with stones; several tables fill several walls",
    (
        Key("walls", TEXTS, "Layers, groups, materials and names, or patterns of them, of the closed outlines, hatches "
            "and faces to fill", ["A-WALL*"], required=True, remedy='name layers of the drawing: walls = ["A-WALL*"]'),
        Key("openings", TEXTS, "Those of the openings, which may reach the rim of the wall; what else lies in the wall "
            "stays a block then", ["A-WIN*", "A-DOOR*"], otherwise="holes, and all outlines in the walls", default=()),
        Key("bond", one_of(PATTERNS), "Pattern; the lengths of the stones of ashlar are random, and the outlines of "
            "rubble", "flemish", default=_DEFAULT.bond),
        Key("brick", _SIZE, "Length and height of a brick with its joint; of ashlar the mean length, of rubble no "
            "height", [0.25, 0.075], "m", _DEFAULT.brick),
        Key("joint", NOT_NEGATIVE, "Thickness of the mortar that blockvis bond leaves open between stones; a run "
            "closes joints to their middle, so that stones touch", 0.01, "m", _DEFAULT.joint),
        Key("heads", one_of(HEADS), 'Heads over openings: "auto" is a ring of voussoirs around a curved top and a '
            'lintel over a straight one; "arch" is a relieving arch over a straight one', "flat arch",
            default=_DEFAULT.heads),
        Key("bearing", POSITIVE, "Bearing of lintels on either side, less where there is no room", 0.125, "m",
            otherwise="half a brick"),
        Key("quoins", _SIZE, "Length and height of larger stones at the upright ends of the wall, every second one "
            "half as long", [0.5, 0.225], "m", otherwise="none"),
        Key("stone", POSITIVE, "Mean length of the stones of rubble", 0.3, "m", otherwise="the length of a brick"),
        Key("flatness", POSITIVE, "Length over height of the stones of rubble", 1.6, default=_DEFAULT.flatness),
        Key("seed", whole(0, 2**31 - 1), "Of the random lengths and outlines of ashlar and rubble", 1,
            default=_DEFAULT.seed),
        Key("thickness", POSITIVE, "Thickness out of plane of the wall", 0.25, "m", otherwise="that of [geometry]"),
    ),
    several=True,
)  # fmt: skip


@dataclass(frozen=True)
class Bonding:
    """A table [[bond]]: what of the drawing is filled, with which pattern, and how thick the wall is [m]."""

    choice: Choice
    pattern: Pattern
    thickness: float | None = None


def read_bond(table: Table) -> Bonding:
    """Read a table [[bond]]."""
    values = BOND.read(table)
    with beginning(f"{table.source}: [{table.where}]"):
        pattern = Pattern(**{field.name: values[field.name] for field in fields(Pattern)})
    if not values["walls"]:
        raise table.error("walls", 'is empty; name layers of the drawing: walls = ["A-WALL*"]')
    return Bonding(Choice(tuple(values["walls"]), tuple(values["openings"])), pattern, values["thickness"])


def bonded(
    layout: Layout, bondings: Sequence[Bonding], where: str, roles: Mapping[str, str] | None = None, *, mortar: bool
) -> Layout:
    """Fill walls of a drawing with the stones of their bonds, each on the layer of its wall, after what else is drawn.

    The layout is of all outlines, as :func:`blockvis.formats.read.read_outlines` gives it; supports, by ``roles``, are
    not filled. Joints are left open for ``mortar``; a run closes them to their middle. ValueError for an outline that
    is missing or open, an opening outside of its wall, a brick longer than its wall.
    """
    if layout.dimension == 3:
        raise ValueError(f"{where}: bond: '{layout.source}' draws blocks in space; a bond fills outlines in the plane")
    groups, rest = regions_of(layout, [one.choice for one in bondings], roles)
    several = sum(map(len, groups)) > 1
    notes, number = list(rest.notes), 0
    for bonding, regions in zip(bondings, groups, strict=True):
        for region in regions:
            number += 1
            openings = [shapely.Polygon(one.exterior) for one in shapely.get_parts(shapely.union_all(region.openings))]
            taken = shapely.union_all(region.taken) if region.taken else None
            on = f" on layer '{region.layer}'" if region.layer else ""
            with beginning(f"{where}: bond: the wall '{region.name}'{on}:"):
                stones = filled(region.wall, openings, bonding.pattern, taken, mortar=mortar)
            names = [f"wall {number} {name}" if several else name for name in stones.names]
            notes += [
                *(note for note in stones.notes if note not in notes),
                _told(region, len(openings), stones, bonding.pattern),
            ]
            every = {"groups": region.layer, "laid": True, "thickness": bonding.thickness}
            more = {key: [value] * stones.n_blocks for key, value in every.items() if value is not None}
            rest = rest.with_more(stones.blocks, names=names, materials=stones.materials, **more)
    return sorted_out(replace(rest, notes=tuple(notes)))


def _told(region: Region, openings: int, stones: Layout, pattern: Pattern) -> Note:
    """Say what was filled."""
    wall = sum(float(shapely.Polygon(ring).area) for ring in stones.outlines)
    where = f"on layer '{region.layer}'" if region.layer else f"called '{region.name}'"
    opened = f" with {counted(openings, 'opening')}" if openings else ""
    return Note(
        CHANGED,
        f"bond: an outline of {region.wall.area:.4g} m² {where}{opened} was "
        f"filled with {counted(stones.n_blocks, 'stone')} of {wall:.4g} m², {pattern.bond}",
    )
