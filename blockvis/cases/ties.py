"""Ties, props and bars of a case: their keys, and the blocks that hold their ends."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

import solver
from blockvis.layout.layout import Layout
from blockvis.layout.left_out import LeftOut, in_words, matches
from blockvis.layout.outlines import ROUNDING
from blockvis.text import listed, nearest, place_text
from solver import mechanics
from solver.mechanics import counted

from .block_at import block_at, blocks_called, distances_to, note_outside
from .key import NOT_NEGATIVE, POSITIVE, TEXT, TRUE_OR_FALSE, VECTOR, Key, Section, ValueKind, one_of, table_of, whole
from .profiles import STRAIGHT
from .toml_table import Table, shortened

#: What a tie has as its table says it.
OF_A_TIE = ("kind", "brittle", "prestress", "phase")

#: Layout files whose lines may be ties.
DRAWN_IN = (".dxf", ".svg")


@dataclass(frozen=True)
class TieEnd:
    """An end of a tie, as a case has it: a point [m], and the name of the block that holds it, or that the ground does.

    Without either it is the block that is found at the point.
    """

    point: tuple[float, ...]
    block: str = ""
    fixed: bool = False


@dataclass(frozen=True)
class TieCase:
    """One entry of ``[[ties]]``, by its keys; ``where`` are file and table, for messages.

    It has two ends, or none where it says how the lines of a layer are.
    """

    name: str
    ends: tuple[TieEnd, ...]
    layer: str
    kind: str
    stiffness: float | None
    area: float | None
    modulus: float | None
    strength: float
    brittle: bool
    prestress: float
    phase: int
    where: str


def _end(table: Table, key: Key) -> TieEnd | None:
    value = table.take(key.name)
    if not isinstance(value, Mapping):
        point = table.vector(key.name)
        return None if point is None else TieEnd(point)
    inner = Table(value, f"{table.where}.{key.name}", table.source)
    fixed = inner.vector("fixed")
    block, point = inner.text("block"), inner.vector("point")
    inner.finish()
    if fixed is not None and (block is not None or point is not None):
        raise inner.error("fixed", "and a block are both given; the ground or a block holds the end: give one of them")
    if fixed is None and (block is None or point is None):
        raise table.error(
            key.name,
            f'is {shortened(value)}; give [x, y], {{ block = "name", point = [x, y] }} or {{ fixed = [x, y] }}',
        )
    return TieEnd(fixed, fixed=True) if fixed is not None else TieEnd(point, block or "")


_BY_BLOCK = table_of({"block": TEXT.schema, "point": VECTOR.schema}, ("block", "point"))
_ON_GROUND = table_of({"fixed": VECTOR.schema}, ("fixed",))
_END = ValueKind(
    "two numbers, in space three, or table: block and point, or fixed",
    {"anyOf": [VECTOR.schema, _BY_BLOCK, _ON_GROUND]},
    _end,
)

TIES = Section(
    "ties",
    "A tie, prop or bar between two points, each held by a block or by the ground",
    (
        Key("name", TEXT, "Name, in tables and pictures", "tie at the springing",
            otherwise="required; lines of a layer are called by it and their number"),
        Key("from", _END, "Where it begins: a point of the drawing, whose block is found; a block by its name and the "
            "point that goes with it; or a point of the ground, { fixed = [x, y] }", [0.1, 2.0], "m",
            otherwise="layer is given instead"),
        Key("to", _END, "Where it ends", {"fixed": [4.0, 2.0]}, "m", otherwise="layer is given instead"),
        Key("layer", TEXT, "Layer of the drawing, one of [geometry] ties, whose lines are ties with these properties",
            "TIES", otherwise="from and to are given instead"),
        Key("kind", one_of(mechanics.TIE_KINDS),
            "Whether it carries tension only, compression only (prop) or both (bar)", mechanics.PROP,
            default=mechanics.TIE),
        Key("stiffness", POSITIVE, "Force per elongation of the whole member", 5e7, "N/m",
            otherwise="modulus times area over length"),
        Key("area", POSITIVE, "Area of its section, with a modulus", 5e-4, "m²",
            otherwise="stiffness is given instead"),
        Key("modulus", POSITIVE, "Modulus of elasticity, with an area", 2.1e11, "Pa",
            otherwise="stiffness is given instead"),
        Key("strength", POSITIVE, "Force at which it yields", 1e5, "N", otherwise="infinite"),
        Key("brittle", TRUE_OR_FALSE, "Whether it breaks at its strength instead of yielding", True, default=False),
        Key("prestress", NOT_NEGATIVE, "Force with which it is installed, of a prop compression, else tension", 5e3,
            "N", 0.0),
        Key("phase", whole(1), "Settlement, from 1, before which it is installed, at the geometry then", 2, default=1),
    ),
    several=True,
)  # fmt: skip


def read_ties(tables: Sequence[Table], layers: Sequence[str]) -> tuple[TieCase, ...]:
    """Read the tables [[ties]], whose layers are those of ``[geometry] ties``.

    ValueError for keys that do not go together, or a name used twice.
    """
    found: list[TieCase] = []
    for table in tables:
        one = _tie(table)
        if one.layer and not matches([one.layer], layers):
            raise table.error("layer", f"is '{one.layer}', which is not in [geometry] ties; add it there")
        if not one.layer and one.name in [other.name for other in found if not other.layer]:
            raise table.error("name", "is there twice; give each tie its own name")
        found.append(one)
    return tuple(found)


def check_layers(entries: Sequence[TieCase], layers: Sequence[str], source: Path) -> None:
    """Raise ValueError for a layer of ``[geometry] ties`` without properties."""
    for layer in layers:
        if not any(matches([one.layer], [layer]) for one in entries if one.layer):
            raise ValueError(
                f"{source}: [geometry] ties names the layer '{layer}', and no [[ties]] says what its lines are; add "
                f'[[ties]] with layer = "{layer}" and stiffness'
            )


def _tie(table: Table) -> TieCase:
    where = f"{table.source}: [{table.where}]"
    if isinstance(table.values.get("name"), str):
        # Messages on its values name the tie.
        table.where += f" '{table.values['name']}'"
    values = TIES.read(table)
    layer = values["layer"] or ""
    if not layer and values["name"] is None:
        raise table.error("name", 'is missing; name the tie, as name = "tie at the springing"')
    for key in ("from", "to"):
        if layer and values[key] is not None:
            raise table.error(key, "does not go with layer, whose lines say where its ties begin and end")
        if not layer and values[key] is None:
            raise table.error(key, "is missing; give a point [x, y]")
    _check_stiffness(values, table)
    strength = np.inf if values["strength"] is None else values["strength"]
    if values["prestress"] >= strength:
        raise table.error("prestress", f"is {values['prestress']:g} N, not below the strength of {strength:g} N")
    if values["brittle"] and values["strength"] is None:
        raise table.error("brittle", "is true, and no strength says at which force it breaks; add strength = ... [N]")
    ends = () if layer else (values["from"], values["to"])
    own = {key: values[key] for key in ("stiffness", "area", "modulus", *OF_A_TIE)}
    return TieCase(values["name"] or layer, ends, layer, strength=strength, where=where, **own)


def _check_stiffness(values: Mapping[str, Any], table: Table) -> None:
    """Refuse a stiffness beside area or modulus, and one of these without the other."""
    given = {key for key in ("stiffness", "area", "modulus") if values[key] is not None}
    if given in ({"stiffness"}, {"area", "modulus"}):
        return
    if "stiffness" in given:
        raise table.error("stiffness", "and area or modulus are both given; give stiffness, or area and modulus")
    lacks = {"area": "modulus", "modulus": "area"}[given.pop()] if given else "stiffness"
    raise table.error(lacks, "is missing; give stiffness [N/m], or area [m²] and modulus [Pa]")


def without_tie_lines(sketch: Layout, layers: Sequence[str], source: Path) -> tuple[Layout, tuple[LeftOut, ...]]:
    """Take the lines that are ties, by layers or patterns of them, out of what a drawing leaves out, which was ignored.

    One note on ties takes the place of those on lines left out. ValueError where a layer has no line, or something
    else.
    """
    if not layers:
        return sketch, ()
    lines = tuple(item for item in sketch.left_out if matches([item.layer], layers))
    _check_lines(lines, layers, sketch, source)
    said = in_words(lines)
    drawn = Counter(item.layer for item in lines)
    words = [f"ties: {counted(n, 'line')} on layer '{layer}'" for layer, n in drawn.items()]
    notes = (*(note for note in sketch.notes if note not in said), *words)
    others = tuple(item for item in sketch.left_out if not matches([item.layer], layers))
    return replace(sketch, left_out=others, notes=notes), lines


def _check_lines(lines: Sequence[LeftOut], layers: Sequence[str], sketch: Layout, source: Path) -> None:
    """Refuse a layer of ties without a line, and an outline on one."""
    drawn = [item.layer for item in lines]
    empty = next((layer for layer in layers if not matches(drawn, [layer])), None)
    if empty is not None:
        known = sorted(filter(None, {*sketch.groups, *(item.layer for item in sketch.left_out)}))
        names = listed([f"'{name}'" for name in known], 12)
        raise ValueError(
            f"{source}: [geometry] ties: no line lies on the layer '{empty}'{nearest(empty, known)}; the drawing has "
            f"{names or 'no layers'}"
        )
    closed = next((item for item in lines if item.closed), None)
    if closed is not None:
        at = place_text(closed.place, 6)
        raise ValueError(
            f"{source}: [geometry] ties: '{closed.name}' on layer '{closed.layer}' at {at} is an "
            "outline, no line; move it to another layer"
        )


def drawn_ties(entries: Sequence[TieCase], lines: Sequence[LeftOut]) -> list[TieCase]:
    """List the ties of a case, those of layers with the ends of their lines, as :func:`without_tie_lines` gives these.

    ValueError for a line that is bent, and a name used twice.
    """
    found: list[TieCase] = []
    for entry in entries:
        if not entry.layer:
            found.append(entry)
            continue
        for number, line in enumerate((line for line in lines if line.layer == entry.layer), start=1):
            first, last = line.points[0], line.points[-1]
            along, length = last - first, float(np.linalg.norm(last - first))
            off = np.abs((line.points - first) @ np.array([-along[1], along[0]])) / (length or 1.0)
            if off.max(initial=0.0) > STRAIGHT * length:
                raise ValueError(
                    f"{entry.where} layer '{entry.layer}': '{line.name}' from ({first[0]:.6g}, {first[1]:.6g}) to "
                    f"({last[0]:.6g}, {last[1]:.6g}) is bent; draw each tie as a straight line"
                )
            ends = tuple(TieEnd(tuple(map(float, point))) for point in (first, last))
            found.append(replace(entry, name=f"{entry.name} {number}", ends=ends))
    names = [one.name for one in found]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise ValueError(f"{found[-1].where} name: two ties are called '{twice}'; give each its own name")
    return found


def ties_of(
    entries: Sequence[TieCase], assembly: solver.Assembly, gone: Mapping[int, np.ndarray]
) -> tuple[solver.Tie, ...]:
    """Find the blocks that hold the ends of ties, by :func:`drawn_ties`, among those not ``gone`` in their phase.

    ValueError for an end in no block that is left, both in one, a tie without length; names the tie and the remedy.
    """
    return tuple(_in_blocks(entry, assembly, gone[entry.phase]) for entry in entries)


def _in_blocks(entry: TieCase, assembly: solver.Assembly, gone: np.ndarray) -> solver.Tie:
    where = f"{entry.where} '{entry.name}'"
    # A drawing in the plane stands upright in space.
    points = tuple(
        end.point if len(end.point) == assembly.dimension else (end.point[0], 0.0, end.point[1]) for end in entry.ends
    )
    along = np.subtract(points[0], points[1])
    length = float(np.linalg.norm(along))
    if not length > 0.0:
        raise ValueError(
            f"{where}: a {entry.kind} has no length: both ends are at {place_text(points[0], 6)}; give two places"
        )
    blocks = tuple(
        _holding(end, points[k], away, assembly, gone, f"{where} {('from', 'to')[k]}", entry)
        for k, (end, away) in enumerate(zip(entry.ends, (along, -along), strict=True))
    )
    if blocks[0] == blocks[1]:
        held = "the ground" if blocks[0] is None else f"the block '{assembly.names[blocks[0]]}'"
        raise ValueError(f"{where}: both ends are in {held}, where a {entry.kind} carries nothing; join two blocks")
    stiffness = entry.stiffness or (entry.area or 0.0) * (entry.modulus or 0.0) / length
    own: dict[str, Any] = {key: getattr(entry, key) for key in (*OF_A_TIE, "name", "strength")}
    return solver.Tie(blocks=(blocks[0], blocks[1]), points=(points[0], points[1]), stiffness=stiffness, **own)


def _holding(
    end: TieEnd,
    point: tuple[float, ...],
    away: np.ndarray,
    assembly: solver.Assembly,
    gone: np.ndarray,
    where: str,
    entry: TieCase,
) -> int | None:
    """Find the block that holds an end; None for the ground."""
    if end.fixed:
        return None
    if end.block:
        meant = np.array(blocks_called(end.block, assembly))
        if not len(meant):
            near = nearest(end.block, assembly.names)
            raise ValueError(
                f"{where}: no block is called '{end.block}'{near}; the layout has {listed(assembly.names, 12)}"
            )
        block = int(meant[0]) if len(meant) == 1 else block_at(assembly, point, meant, away.tolist(), where, gone)
        if gone[block]:
            raise ValueError(
                f"{where}: [[remove]] has taken '{end.block}' away before settlement {entry.phase}, before which the "
                f"{entry.kind} is installed; name a block that is left"
            )
        note_outside(assembly, point, block, where, "which holds this end")
        return block
    every = np.arange(assembly.n_blocks)
    apart = distances_to(assembly, point)
    if apart.min() > ROUNDING * assembly.block_size:
        near = assembly.names[int(apart.argmin())]
        fixed = "{ fixed = [" + ", ".join(f"{x:g}" for x in point) + "] }"
        remedy = f"move it there, or hold it by the ground, {fixed}"
        if entry.layer:
            # Lines have no words at their ends that could name the ground.
            other = "from" if where.endswith(" to") else "to"
            remedy = (
                "move it there in the drawing, or hold it by the ground: leave layer out and write "
                f"{where.rpartition(' ')[2]} = {fixed} and {other}; the line itself goes to another layer"
            )
        doubt = " (is it in m?)" if apart.min() > assembly.block_size else ""
        raise ValueError(
            f"{where} {place_text(point, 6)} m lies in no block; the nearest is '{near}', {apart.min():.3g} m away"
            f"{doubt}; {remedy}"
        )
    # Where several blocks meet, it is the one behind the anchor.
    return block_at(assembly, point, every, away.tolist(), where, gone)
