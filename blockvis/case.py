"""Case: the TOML case file, read and checked."""

from __future__ import annotations

import difflib
import math
import tomllib
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

import solver

from . import drawing, layouts
from .formats import FORMATS
from .imperfections import Imperfection, imperfect, joint_scatter, read_imperfection
from .loading import LoadCase, loads_of, nearest_name

ANALYSES = ("settlement", "limit load", "pushover")

#: How sliding joints of a limit load behave.
FLOWS = ("associative", "non-associative")

#: Endings of animations.
FILMS = (".mp4", ".gif", ".webp")

#: More increments or frames than this are a slip of the pen.
MOST_STEPS = 1_000_000

#: A block lighter than this part of the whole may drown in what rounding leaves of the forces on the others.
LIGHTEST = 1e-14

#: Blocks that are all smaller than this [m] are a drawing in another unit.
SMALLEST_BLOCKS = 2e-3

#: What a file's blocks are made of where nothing else is said [kg/m³, m].
DENSITY, THICKNESS = 2000.0, 1.0


@dataclass(frozen=True)
class Case:
    """A checked case file. The keys are those of the file; see the README.

    Attributes
    ----------
    source : Path
        The case file; paths in it are relative to its folder.
    text : str
        The case file as it was read.
    """

    source: Path
    text: str
    file: Path | None = None
    layout: str | None = None
    parameters: Mapping[str, Any] = field(default_factory=dict)
    unit: str | None = None
    thickness: float | None = None
    joint_thickness: float | str = 0.0
    overlap_tolerance: float | None = None
    roles: Mapping[str, str] = field(default_factory=dict)
    supports: tuple[Mapping[str, Any], ...] = ()
    density: float | None = None
    densities: Mapping[str, float] = field(default_factory=dict)
    friction_coefficient: float = 0.6
    cohesion: float = 0.0
    compressive_strength: float = math.inf
    interfaces: Mapping[tuple[str, str], solver.InterfaceLaw] = field(default_factory=dict)
    imperfections: tuple[Imperfection, ...] = ()
    settlements: tuple[solver.Settlement, ...] = ()
    loads: tuple[LoadCase, ...] = ()
    analysis: str = "settlement"
    flow: str = "associative"
    capacity_at: tuple[float, ...] | None = None
    displacement: float | None = None
    control: solver.ControlDisplacement | None = None
    controls: solver.Controls = field(default_factory=solver.Controls)
    animation: str | None = "collapse.mp4"


class _Table:
    """A table of the case file that knows which of its keys have been asked for."""

    def __init__(self, values: Mapping[str, Any], where: str, source: Path) -> None:
        if not isinstance(values, Mapping):
            raise ValueError(f"{source}: [{where}] must be a table of keys, not {values!r}")
        self.values, self.where, self.source = values, where, source
        self.known: list[str] = []

    def take(self, key: str, default: Any = None) -> Any:
        self.known.append(key)
        return self.values.get(key, default)

    def number(self, key: str, default: float | None = None, *, positive: bool = False) -> Any:
        value = self.take(key, default)
        if value is None:
            return None
        if not _is_number(value):
            raise self.error(key, f"is {_short(value)}; give a number")
        if positive and value <= 0.0:
            raise self.error(key, f"is {value:g}; give a positive number")
        return float(value)

    def pair(self, key: str, default: tuple[float, float] | None = None) -> Any:
        value = self.take(key, default)
        if value is None:
            return None
        if not isinstance(value, (list, tuple)) or len(value) != 2 or not all(map(_is_number, value)):
            raise self.error(key, f"is {_short(value)}; give two numbers [x, y]")
        return float(value[0]), float(value[1])

    def text(self, key: str, default: str | None = None, *, among: Sequence[str] = ()) -> Any:
        value = self.take(key, default)
        if value is None:
            return None
        if not isinstance(value, str):
            raise self.error(key, f"is {value!r}; give a text in quotes")
        if among and value not in among:
            raise self.error(key, f"is '{value}'{nearest_name(value, among)}; choose from {', '.join(among)}")
        return value

    def numbers(self, key: str) -> tuple[float, ...] | None:
        value = self.take(key)
        if value is None:
            return None
        right = isinstance(value, Sequence) and not isinstance(value, str) and len(value) > 0
        if not right or not all(type(v) in (int, float) and math.isfinite(v) for v in value):
            raise self.error(key, f"is {value!r}; give a list of numbers")
        return tuple(float(v) for v in value)

    def whole(self, key: str, least: int) -> int | None:
        value = self.number(key)
        if value is not None and (value < least or value != int(value)):
            raise self.error(key, f"is {value:g}; give a whole number of at least {least}")
        return None if value is None else int(value)

    def table(self, key: str) -> _Table:
        return _Table(self.take(key, {}), f"{self.where}.{key}" if self.where else key, self.source)

    def tables(self, key: str) -> list[_Table]:
        value = self.take(key, [])
        entries = [value] if isinstance(value, Mapping) else value
        if not isinstance(entries, list):
            raise self.error(key, f"must be [[{key}]] tables, not {value!r}")
        return [
            _Table(entry, f"{key} {i + 1}" if len(entries) > 1 else key, self.source) for i, entry in enumerate(entries)
        ]

    def error(self, key: str, problem: str) -> ValueError:
        where = f"[{self.where}] {key}" if self.where else f"[{key}]"
        return ValueError(f"{self.source}: {where} {problem}")

    def finish(self) -> None:
        """Refuses keys nobody asked for, naming the nearest one that exists."""
        for key in self.values:
            if key not in self.known:
                raise self.error(
                    key, f"is not a key here{nearest_name(key, self.known)}; keys are {', '.join(self.known)}"
                )


def _is_number(value: object) -> bool:
    """Whether it is a number that a double holds; TOML has whole numbers of any size."""
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return False
    try:
        return math.isfinite(value)
    except OverflowError:
        return False


def _short(value: object) -> str:
    """A value as an error message shows it."""
    if isinstance(value, int) and not isinstance(value, bool) and abs(value) >= 10**30:
        return "a number too large for any length or force"
    words = repr(value)
    return words if len(words) <= 120 else f"{words[:100]} ..."


def read_case(path: str | Path) -> Case:
    """Reads and checks a case file.

    Parameters
    ----------
    path : str or Path

    Raises
    ------
    ValueError
        Names the file, the key and the remedy: a missing file, broken TOML (with its line), an unknown key (with the
        nearest valid one), a value of the wrong kind.
    """
    path = Path(path)
    if not path.is_file():
        beside = sorted(p.name for p in path.parent.glob("*.toml")) if path.parent.is_dir() else []
        near = difflib.get_close_matches(path.name, beside, n=3, cutoff=0.4) or beside[:3]
        hint = f"; beside it are {', '.join(near)}" if near else ""
        raise ValueError(f"there is no case file '{path}'{hint}")
    if path.suffix.lower() in FORMATS:
        raise ValueError(
            f"'{path}' is a layout, not a case file; a case file names it, what settles and by how much: "
            f'[geometry] file = "{path.name}" (see examples/); blockvis info shows what is in it'
        )
    try:
        text = path.read_text(encoding="utf-8")
    except UnicodeDecodeError as error:
        raise ValueError(f"{path}: is not a text file ({error.reason} at byte {error.start})") from None
    return parse_case(text, path)


def parse_case(text: str, source: Path) -> Case:
    """As :func:`read_case`, from the text of a case file; paths in it are relative to the folder of ``source``."""
    try:
        values = tomllib.loads(text)
    except RecursionError:
        raise ValueError(f"{source}: nests lists or tables without end; a case file has a handful of them") from None
    except ValueError as error:
        raise ValueError(f'{source}: {error}; a case file is TOML, for instance: file = "arch.msh"') from None
    return case_of(values, source, text)


def case_of(values: Mapping[str, Any], source: Path, text: str = "") -> Case:
    """As :func:`parse_case`, from the values that TOML makes of a text."""
    top = _Table(values, "", source)
    geometry = top.table("geometry")
    file, layout = geometry.text("file"), geometry.text("layout")
    parameters = geometry.table("parameters").values
    if (file is None) == (layout is None):
        problem = "is missing; name the layout file" if file is None else "and layout are both given; give one of them"
        raise geometry.error("file", problem + f", or a layout: {', '.join(layouts.LAYOUTS)}" * (file is None))
    if file is not None and parameters:
        raise geometry.error("parameters", "belong to a layout, not to a file")
    joint = geometry.take("joint_thickness", 0.0)
    if joint != "auto":
        joint = geometry.number("joint_thickness", 0.0)
        if joint < 0.0:
            raise geometry.error("joint_thickness", f'is {joint:g}; give a thickness in m of at least 0, or "auto"')
    roles = top.table("roles").values
    for name, role in roles.items():
        if role not in solver.ROLES:
            raise ValueError(f'{source}: [roles] "{name}" is {_short(role)}; a role is {", ".join(solver.ROLES)}')
    material = top.table("material")
    materials = top.table("materials")
    densities = {}
    for name in materials.values:
        one = materials.table(name)
        densities[name] = one.number("density", positive=True)
        one.finish()
    analysis = top.table("analysis")
    output = top.table("output")
    animation = output.take("animation", "collapse.mp4")
    if animation is not False:
        animation = output.text("animation", "collapse.mp4")
        if not Path(animation).name == animation or "\\" in animation or not animation.lower().endswith(FILMS):
            raise output.error(
                "animation",
                f"is {_short(animation)}; give a name ending in {', '.join(FILMS)}, without a folder: it is written "
                "into the results folder",
            )
    case = Case(
        source=source,
        text=text,
        file=None if file is None else source.parent / file,
        layout=layout,
        parameters=dict(parameters),
        unit=geometry.text("unit"),
        thickness=geometry.number("thickness", positive=True),
        joint_thickness=joint,
        overlap_tolerance=geometry.number("overlap_tolerance", positive=True),
        roles=dict(roles),
        supports=tuple(_support(entry) for entry in top.tables("supports")),
        density=material.number("density", positive=True),
        densities=densities,
        friction_coefficient=_friction(material),
        **_strength(material),
        interfaces=dict(_interface(entry) for entry in top.tables("interfaces")),
        imperfections=_imperfections(top),
        settlements=tuple(_settlement(entry) for entry in top.tables("settlement")),
        loads=tuple(_load(entry) for entry in top.tables("loads")),
        analysis=analysis.text("kind", "settlement", among=ANALYSES),
        flow=analysis.text("flow", "associative", among=FLOWS),
        capacity_at=analysis.numbers("capacity_at"),
        displacement=_displacement(analysis),
        control=_control(top.table("control")),
        controls=_controls(analysis, geometry.number("overlap_tolerance", positive=True)),
        animation=animation or None,
    )
    for table in (geometry, material, analysis, output, top):
        table.finish()
    return _fitting(case)


def _fitting(case: Case) -> Case:
    """The case, once its keys fit the analysis that it asks for."""
    source, kind = case.source, case.analysis
    live = any(load.kind == "live" for load in case.loads)
    moving = [k + 1 for k, load in enumerate(case.loads) if load.positions]
    if kind == "settlement" and not case.settlements:
        raise ValueError(f"{source}: [settlement] is missing; say how the moving supports move, direction = [1, 0]")
    if kind == "settlement" and live:
        warnings.warn(
            f'{source}: a settlement analysis leaves the live loads out; give loads that act during it kind = "dead"',
            stacklevel=4,
        )
    if kind != "settlement" and not live:
        raise ValueError(
            f'{source}: [analysis] kind is "{kind}", but no load is live; add [[loads]] with kind = "live", for '
            "instance weight_fraction = [1.0, 0.0]"
        )
    laws = [solver.InterfaceLaw(case.friction_coefficient, case.cohesion, case.compressive_strength)]
    if not all(law.dry for law in [*laws, *case.interfaces.values()]) and (kind != "limit load" or case.settlements):
        raise ValueError(
            f"{source}: cohesion and compressive_strength are for limit loads without a settlement; what follows the "
            "geometry follows dry joints"
        )
    if kind == "pushover" and case.control is None:
        raise ValueError(
            f'{source}: [control] is missing; a pushover needs the displacement that grows, block = "..." and '
            "direction = [1, 0]"
        )
    if kind != "pushover" and case.control is not None:
        raise ValueError(f'{source}: [control] belongs to [analysis] kind = "pushover", not "{kind}"')
    if kind != "limit load" and case.flow != "associative":
        raise ValueError(
            f'{source}: [analysis] flow "{case.flow}" belongs to kind = "limit load"; a {kind} follows the geometry, '
            "in which friction never dilates"
        )
    if case.displacement is not None and (kind != "limit load" or not case.settlements):
        raise ValueError(
            f"{source}: [analysis] displacement is that of a limit load after a settlement, in which open joints may "
            "close"
        )
    if kind == "pushover" and moving:
        raise ValueError(f'{source}: [loads {moving[0]}] positions belong to [analysis] kind = "limit load"')
    if len(moving) > 1:
        raise ValueError(f"{source}: [loads {moving[1]}] positions: only one load may move, and loads {moving[0]} does")
    if case.capacity_at is None:
        return case
    if kind != "limit load" or not case.settlements or moving:
        raise ValueError(
            f'{source}: [analysis] capacity_at asks for limit loads (kind = "limit load") of loads that stand still, '
            "along a [settlement]"
        )
    last = case.settlements[-1]
    try:
        stopping = replace(last, stops=case.capacity_at)
    except ValueError as error:
        raise ValueError(f"{source}: [analysis] capacity_at: {error}") from None
    return replace(case, settlements=(*case.settlements[:-1], stopping))


def _friction(table: _Table, default: float | None = 0.6) -> float:
    value = table.number("friction_coefficient", default)
    if value is None:
        raise table.error("friction_coefficient", "is missing")
    if value < 0.0:
        raise table.error("friction_coefficient", f"is {value:g}; it must be at least 0")
    return float(value)


def _support(table: _Table) -> Mapping[str, Any]:
    support = {
        "name": table.text("name", "support"),
        "role": table.text("role", solver.FIXED, among=(solver.FIXED, solver.MOVING)),
        "outline": table.take("outline"),
    }
    if not isinstance(support["outline"], list) or len(support["outline"]) < 3:
        raise table.error("outline", f"is {_short(support['outline'])}; give at least three corners [[x, y], ...]")
    for corner in support["outline"]:
        if not isinstance(corner, (list, tuple)) or len(corner) != 2 or not all(map(_is_number, corner)):
            raise table.error("outline", f"has the corner {_short(corner)}; give two numbers [x, y]")
    material = table.text("material")
    if material is not None:
        support["material"] = material
    table.finish()
    return support


def _strength(table: _Table) -> dict[str, float]:
    """Cohesion and compressive strength [Pa], where they are given."""
    cohesion = table.number("cohesion", 0.0)
    if cohesion < 0.0:
        raise table.error("cohesion", f"is {cohesion:g}; give a stress in Pa of at least 0")
    strength = table.number("compressive_strength", positive=True)
    return {"cohesion": cohesion, "compressive_strength": math.inf if strength is None else strength}


def _interface(table: _Table) -> tuple[tuple[str, str], solver.InterfaceLaw]:
    pair = table.take("materials")
    if not (isinstance(pair, list) and len(pair) == 2 and all(isinstance(name, str) for name in pair)):
        raise table.error("materials", f'is {pair!r}; name two materials ["stone", "brick"]')
    law = solver.InterfaceLaw(_friction(table, None), **_strength(table))
    table.finish()
    return (pair[0], pair[1]), law


def _imperfections(top: _Table) -> tuple[Imperfection, ...]:
    found: dict[str, Imperfection] = {}
    for entry in top.tables("imperfections"):
        one = read_imperfection(entry.values, f"{top.source}: [{entry.where}]")
        if one.kind in found:
            raise ValueError(f"{top.source}: [{entry.where}] kind '{one.kind}' is there twice; give one of each kind")
        found[one.kind] = one
    return tuple(found.values())


def _settlement(table: _Table) -> solver.Settlement:
    blocks = table.take("blocks")
    if blocks is not None:
        blocks = tuple([blocks] if isinstance(blocks, str) else blocks if isinstance(blocks, (list, tuple)) else [None])
        if not all(isinstance(name, str) for name in blocks):
            raise table.error("blocks", f"is {_short(table.values['blocks'])}; give names of supports in quotes")
    keys = {
        "direction": table.pair("direction"),
        "rotation_centre": table.pair("rotation_centre"),
        "rotation": table.number("rotation"),
        "increment": table.number("increment", 0.01, positive=True),
        "limit": table.number("limit", 1.0, positive=True),
        "tolerance": table.number("tolerance", positive=True),
    }
    table.finish()
    if keys["limit"] / keys["increment"] > MOST_STEPS:
        raise table.error(
            "increment",
            f"is {keys['increment']:g}: {keys['limit'] / keys['increment']:.3g} of them make the limit of "
            f"{keys['limit']:g}; at most {MOST_STEPS} do",
        )
    if keys["rotation"] is None:
        keys["rotation"] = 1.0 if keys["rotation_centre"] is not None else 0.0
    try:
        return solver.Settlement(**keys, blocks=blocks)
    except ValueError as error:
        raise ValueError(f"{table.source}: [{table.where}] {error}") from None


def _displacement(table: _Table) -> float | None:
    value = table.number("displacement")
    if value is not None and value < 0.0:
        raise table.error("displacement", f"is {value:g}; give a length in m of at least 0")
    return None if value is None else float(value)


def _control(table: _Table) -> solver.ControlDisplacement | None:
    if not table.values:
        return None
    keys = {
        "direction": table.pair("direction", (1.0, 0.0)),
        "point": table.pair("point"),
        "increment": table.number("increment", 0.01, positive=True),
        "limit": table.number("limit", 1.0, positive=True),
        "tolerance": table.number("tolerance", positive=True),
    }
    block = table.text("block")
    table.finish()
    if block is None:
        raise table.error("block", "is missing; name the block whose displacement grows")
    try:
        return solver.ControlDisplacement(block, **keys)
    except ValueError as error:
        raise ValueError(f"{table.source}: [{table.where}] {error}") from None


def _load(table: _Table) -> LoadCase:
    given = set(table.values)
    load = LoadCase(
        kind=table.text("kind", "dead", among=("dead", "live")),
        blocks=table.text("blocks", "*"),
        weight_fraction=table.pair("weight_fraction"),
        force=table.pair("force", (0.0, 0.0)),
        point=table.pair("point"),
        moment=table.number("moment", 0.0),
        pressure=table.number("pressure"),
        direction=table.pair("direction", (0.0, -1.0)),
        edge=table.whole("edge", 1),
        positions=_positions(table),
    )
    table.finish()
    if load.direction == (0.0, 0.0):
        raise table.error("direction", "is [0, 0]; give the direction in which the pressure pushes")
    for key in ("direction", "edge"):
        if key in given and load.pressure is None:
            raise table.error(key, "is that of a pressure; add pressure = ... [Pa]")
    if load.edge is not None and "direction" in given:
        raise table.error("direction", "and edge are both given; pressure on an edge is perpendicular to it")
    if load.positions:
        if load.kind != "live" or load.force == (0.0, 0.0):
            raise table.error("positions", 'are those of a live force; give kind = "live" and force = [fx, fy]')
        for key in ("blocks", "weight_fraction", "point", "moment", "pressure"):
            if key in given:
                raise table.error(key, "does not go with positions: the force stands on what is topmost at each")
    elif load.weight_fraction is None and load.pressure is None and load.force == (0.0, 0.0) and not load.moment:
        raise table.error("force", "is missing or zero; give force, moment, weight_fraction or pressure")
    return load


def _positions(table: _Table) -> tuple[float, ...]:
    given = table.numbers("positions")
    if given is None:
        return ()
    if len(given) != 3 or given[2] != int(given[2]) or given[2] < 2 or given[0] >= given[1]:
        raise table.error("positions", f"is {list(given)}; give [first x, last x, number of places], at least 2 places")
    return tuple(np.linspace(given[0], given[1], int(given[2])).tolist())


def _controls(table: _Table, overlap_tolerance: float | None) -> solver.Controls:
    default = solver.Controls()
    counts = {}
    for key in ("event_refinement", "correctors", "falling_frames"):
        value = table.number(key, getattr(default, key))
        if value < (0 if key == "falling_frames" else 1) or value != int(value):
            raise table.error(key, f"is {value:g}; give a whole number")
        if value > MOST_STEPS:
            raise table.error(key, f"is {value:g}; give at most {MOST_STEPS}")
        counts[key] = int(value)
    trust_region = table.number("trust_region", positive=True)
    return solver.Controls(trust_region=trust_region, overlap_tolerance=overlap_tolerance, **counts)


def case_assembly(case: Case) -> solver.Assembly:
    """The assembly of a case: its layout file or parametric layout with roles, supports and materials applied."""
    sketch = _case_drawing(case)
    if case.densities:
        sketch = _with_densities(case, sketch)
    assembly = drawing.assemble(
        sketch,
        roles=case.roles,
        supports=case.supports,
        density=case.density or DENSITY,
        thickness=case.thickness or THICKNESS,
        joint_thickness=case.joint_thickness,
        overlap_tolerance=case.overlap_tolerance,
    )
    if case.settlements and not assembly.moving.any():
        groups = sorted({g for g in sketch.groups if g} | {s["name"] for s in case.supports}) or list(sketch.names[:12])
        raise ValueError(
            f'{case.source}: no block is a moving support; give one of these the role "moving" under [roles] or add '
            f"[[supports]]: {', '.join(groups)}"
        )
    _note_numbers(assembly, case.source)
    return imperfect(assembly, case.imperfections)


def _note_numbers(assembly: solver.Assembly, source: Path) -> None:
    """Says so where numbers are not what was meant, or beyond what double precision solves."""
    weight = np.where(assembly.free, assembly.masses, 0.0)
    light = np.flatnonzero(assembly.free & (weight < LIGHTEST * weight.sum()))
    if len(light):
        shown = ", ".join(f"'{assembly.names[i]}'" for i in light[:6].tolist()) + (" ..." if len(light) > 6 else "")
        warnings.warn(
            f"{source}: {len(light)} blocks weigh less than {LIGHTEST:g} of the whole ({shown}), less than rounding "
            "leaves: they may stay in the air; remove them or check their size and density",
            stacklevel=3,
        )
    largest = float(np.sqrt(assembly.areas[assembly.free].max(initial=0.0)))
    if 0.0 < largest < SMALLEST_BLOCKS:
        warnings.warn(
            f"{source}: the largest block is {largest:.3g} m across; if the file is not in the unit it was read in, "
            "say so under [geometry] unit",
            stacklevel=3,
        )


def _case_drawing(case: Case) -> drawing.Drawing:
    if case.file is not None:
        return drawing.read_drawing(case.file, unit=case.unit)
    assert case.layout is not None
    try:
        sketch = drawing.drawing_of(layouts.build(case.layout, case.parameters))
    except (TypeError, ValueError) as error:
        raise ValueError(f"{case.source}: [geometry] layout: {error}") from None
    # A layout brings its own density and thickness, unless the case says otherwise.
    return replace(
        sketch,
        density=sketch.density if case.density is None else None,
        thickness=sketch.thickness if case.thickness is None else None,
    )


def _with_densities(case: Case, sketch: drawing.Drawing) -> drawing.Drawing:
    unknown = set(case.densities) - set(sketch.materials)
    if unknown:
        name = sorted(unknown)[0]
        known = sorted(set(sketch.materials))
        raise ValueError(
            f"{case.source}: [materials.{name}] matches no block{nearest_name(name, known)}; the file has {known}"
        )
    density = np.full(sketch.n_blocks, np.nan) if sketch.density is None else sketch.density.copy()
    for i, material in enumerate(sketch.materials):
        density[i] = case.densities.get(material, density[i])
    return replace(sketch, density=density)


def case_interfaces(case: Case) -> solver.Interfaces:
    """The laws of the interfaces of a case."""
    return solver.Interfaces(
        solver.InterfaceLaw(case.friction_coefficient, case.cohesion, case.compressive_strength),
        dict(case.interfaces),
        scatter=joint_scatter(case.imperfections),
    )


def case_loads(case: Case, assembly: solver.Assembly) -> solver.Loads:
    """Self-weight and the loads of a case that stand still, in N."""
    return loads_of(case.loads, assembly, case.source)
