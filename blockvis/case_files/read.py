"""The TOML case file, read and checked."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import solver
from blockvis import generators
from blockvis.cases.backfill import read_backfill
from blockvis.cases.bonds import Bonding, read_bond
from blockvis.cases.contents import Case
from blockvis.cases.explain_settings import read_explain
from blockvis.cases.imperfections import Imperfection, read_imperfection
from blockvis.cases.key import read_keys
from blockvis.cases.loads import LoadCase
from blockvis.cases.profiles import Profile
from blockvis.cases.removals import read_removal
from blockvis.cases.role_places import PLACES, read_places
from blockvis.cases.ties import DRAWN_IN, read_ties
from blockvis.cases.toml_table import Table, shortened, toml_value
from blockvis.cases.value_paths import parse_path, put
from blockvis.formats import FORMATS
from blockvis.kinds.kinds import KINDS
from blockvis.kinds.pushover import CONTROL
from blockvis.text import as_key, beginning, files_like
from solver import mechanics

from . import case_keys as keys

#: Line and column where a parser of TOML stopped.
STOPPED = re.compile(r"\(at line (\d+), column (\d+)\)")

#: A number with a decimal comma at the end of a line, a comment apart.
COMMA = re.compile(r"^\s*([\w.\"'-]+)\s*=\s*([+-]?\d+),(\d+(?:[eE][+-]?\d+)?)\s*(#.*)?$")


def read_case(path: str | Path, changes: str | Sequence[str] = ()) -> Case:
    """Read and check a case file.

    Parameters
    ----------
    path : str or Path
    changes : str or sequence of str
        Changes for this time, as ``"material.friction_coefficient=0.5"``; see :func:`changed_text`.

    Raises
    ------
    ValueError
        For a missing file, broken TOML, an unknown key, a value of the wrong kind; names the file, the key or line and
        the remedy.
    """
    path = Path(path)
    text = case_file_text(path)
    changes = (changes,) if isinstance(changes, str) else changes
    return parse_case(changed_text(text, path, changes) if changes else text, path)


def case_file_text(path: Path) -> str:
    """Read the text of a case file; raises ``ValueError`` where it is missing, a layout, or no text."""
    # What a program hands over, as /dev/stdin, is a pipe.
    if path.is_dir():
        inside = files_like(path / "case.toml", "*.toml", or_any=True)
        hint = f"; in it are {', '.join(inside)}" if inside else ""
        raise ValueError(f"'{path}' is a folder, not a case file (.toml){hint}")
    if not path.exists():
        near = files_like(path, "*.toml", or_any=True)
        hint = f"; beside it are {', '.join(near)}" if near else ""
        raise ValueError(f"there is no case file '{path}'{hint}")
    if path.suffix.lower() in FORMATS:
        raise ValueError(
            f"'{path}' is a layout, not a case file; a case file names it, what settles and by how much: "
            f'[geometry] file = "{path.name}" (see examples/); blockvis info shows what is in it'
        )
    return utf8_text(path)


def utf8_text(path: Path) -> str:
    """Read a text file; raises ``ValueError`` where it is no text in UTF-8."""
    try:
        # Editors of Windows begin a file with a mark of its encoding.
        return path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        raise ValueError(
            f"{path}: is not a text file in UTF-8 ({error.reason} at byte {error.start}); save it in UTF-8"
        ) from None


def changed_text(text: str, source: Path, changes: Sequence[str]) -> str:
    """Change values in the text of a case file; what is not changed stays as it is, comments included.

    Changes are ``key=value`` each: a dotted key, with ``[n]`` for entries of a list, from 0, and a value as TOML writes
    it, or a plain word. Tables that the file does not have are made. ValueError for broken TOML, a change without "=",
    and a key that leads nowhere; names the key.
    """
    import tomlkit

    parsed_toml(text, source)
    document: Any = tomlkit.parse(text)
    for change in changes:
        key, equals, value = change.partition("=")
        if not equals:
            raise ValueError(f"'{change}' is no change of a case; write key=value, as in material.density=1800")
        with beginning(f"{source}: cannot set '{key.strip()}':"):
            put(document, parse_path(key.strip()), toml_value(value))
    return tomlkit.dumps(document)


def parse_case(text: str, source: Path) -> Case:
    """Read a case from the text of a case file; paths in it are relative to the folder of ``source``."""
    return case_of(parsed_toml(text, source), source, text)


def parsed_toml(text: str, source: Path, kind: str = "case file", example: str = 'file = "arch.msh"') -> dict[str, Any]:
    """Parse the text of a case or study file; raises ``ValueError`` with the place where it is no TOML."""
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise ValueError(f"{source}: nests lists or tables without end; a {kind} has a handful of them") from None
    except ValueError as error:
        comma = _decimal_comma(text, str(error))
        if comma:
            raise ValueError(f"{source}: {comma}") from None
        hint = "; write paths with / or in single quotes" if "\\" in text else ""
        raise ValueError(f"{source}: {error}; a {kind} is TOML, for instance: {example}{hint}") from None


def _decimal_comma(text: str, error: str) -> str:
    """Write how a number is to be written where a parser of TOML stopped at its decimal comma, by its message; else "".

    Examples
    --------
    >>> _decimal_comma("limit = 0,5", "Expected newline (at line 1, column 10)")
    'line 1: limit = 0,5 has a decimal comma; numbers have a point: limit = 0.5'
    """
    place = STOPPED.search(error)
    lines = text.splitlines()
    line = lines[int(place[1]) - 1] if place and int(place[1]) <= len(lines) else ""
    found = COMMA.match(line)
    if found is None:
        return ""
    key, whole, part, _ = found.groups()
    where = f"line {place[1] if place else 1}: {key} = {whole},{part}"
    return f"{where} has a decimal comma; numbers have a point: {key} = {whole}.{part}"


def case_of(values: Mapping[str, Any], source: Path, text: str = "") -> Case:
    """Make a case of the values of a parsed TOML text; paths in it are relative to the folder of ``source``."""
    top = Table(values, "", source)
    if "study" in values:
        raise ValueError(f"{source}: [study] makes it a study; carry it out by: blockvis sweep {source}")
    geometry = _geometry(top.table("geometry"))
    phases = [keys.SETTLEMENT.read(table) for table in top.tables("settlement")]
    motions = [_settlement(table, one) for table, one in zip(top.tables("settlement"), phases, strict=True)]
    analysis = top.table("analysis")
    asked = read_keys(keys.ANALYSIS_KEYS, analysis)
    # Every kind reads its keys: one that is given to another kind is named, not ignored.
    settings = {name: kind.read(top, analysis) for name, kind in KINDS.items()}
    analysis.finish()
    output = keys.OUTPUT.read(top.table("output"))
    case = Case(
        source=source,
        text=text,
        **geometry | {"file": None if geometry["file"] is None else source.parent / geometry["file"]},
        bonds=_bonds(top, geometry["file"]),
        roles=_roles(top.table("roles")),
        role_places=read_places(top.table("roles")),
        supports=tuple(_given(keys.SUPPORTS.read(table)) for table in top.tables("supports")),
        **_material(top.table("material")),
        densities=_densities(top.table("materials")),
        interfaces=_interfaces(top),
        imperfections=_imperfections(top),
        settlements=tuple(settlement for settlement, _ in motions),
        profiles=tuple(profile for _, profile in motions),
        loads=tuple(_load(table) for table in top.tables("loads")),
        backfills=tuple(map(read_backfill, top.tables("backfill"))),
        removals=tuple(map(read_removal, top.tables("remove"))),
        ties=read_ties(top.tables("ties"), geometry["tie_layers"]),
        analysis=asked["kind"],
        settings=settings[asked["kind"]],
        increment_seconds=asked["increment_seconds"],
        controls=_controls(asked, phases, top.table("control"), geometry["overlap_tolerance"]),
        explain=read_explain(top.table("explain")),
        animation=output["animation"] or None,
        vtu=output["vtu"],
        vtu_strings=output["vtu_strings"],
        underlay=output["underlay"],
        sight=output["view"],
        cut=output["section"],
    )
    top.finish()
    return _checked(case, settings)


def _roles(table: Table) -> dict[str, str]:
    """Read the roles of [roles] that are given by name."""
    roles = {name: role for name, role in table.values.items() if name not in PLACES or isinstance(role, str)}
    for name, role in roles.items():
        if role not in mechanics.ROLES:
            one_of = ", ".join(mechanics.ROLES)
            places = f", or by place: {', '.join(PLACES)}" if isinstance(role, dict) else ""
            raise ValueError(f'{table.source}: [roles] "{name}" is {shortened(role)}; a role is {one_of}{places}')
    return roles


def _geometry(table: Table) -> dict[str, Any]:
    """Read [geometry]: a file, and what is chosen of it, or a layout and its parameters."""
    values = keys.GEOMETRY.read(table)
    file, layout = values["file"], values["layout"]
    if (file is None) == (layout is None):
        if file is not None:
            raise table.error("file", "and layout are both given; give one of them")
        layouts = f'"{next(iter(generators.LAYOUTS))}", one of {len(generators.LAYOUTS)} (blockvis layout --help)'
        raise table.error("file", f"is missing; name the file of the blocks, or give layout = {layouts}")
    if file is not None and values["parameters"]:
        raise table.error("parameters", "belong to a layout, not to a file")
    if layout is not None and values["unit"] not in (None, "m"):
        raise table.error(
            "unit", f"is {shortened(values['unit'])}, but is of a file's lengths; a layout is in m: leave it out"
        )
    for key in ("view", "ignore", "only", "ties", "window", *keys.OF_IMAGES):
        if file is None and values[key] is not None and values[key] != ():
            raise table.error(key, "belongs to a file, not to a layout")
    values["tie_layers"] = values.pop("ties")
    if values["tie_layers"] and Path(file).suffix.lower() not in DRAWN_IN:
        raise table.error(
            "ties", f"are lines of a {' or '.join(DRAWN_IN)}, and '{file}' has none; give [[ties]] from and to"
        )
    image = {key: values.pop(key) for key in keys.OF_IMAGES} | {"outline_tolerance": values["outline_tolerance"]}
    return values | {"parameters": dict(values["parameters"]), "image": image}


def _bonds(top: Table, file: str | None) -> tuple[Bonding, ...]:
    tables = top.tables("bond")
    if tables and file is None:
        raise tables[0].error("walls", 'are outlines of a drawing, and a layout has none; give [geometry] file = "..."')
    return tuple(map(read_bond, tables))


def _checked(case: Case, settings: Mapping[str, Any]) -> Case:
    """Check that the keys of a case fit its kind of analysis; ``settings`` are what each kind has read, by its name."""
    places = {k: len(load.positions) for k, load in enumerate(case.loads, start=1) if load.positions}
    for k, number in places.items():
        if number != (first := next(iter(places.values()))):
            raise ValueError(
                f"{case.source}: [loads {k}] positions: loads that move do so together, as the axles of one vehicle, "
                f"over as many places; the first of them has {first}, this one {number}"
            )
    for name, other in KINDS.items():
        if name != case.analysis:
            other.refuse(settings[name], case)
    _check_phases(case)
    case = KINDS[case.analysis].checked(case)
    refuse_increment_seconds(case, case.increment_seconds)
    return case


def _check_phases(case: Case) -> None:
    """Refuse changes before a settlement that does not exist, and phases of live loads."""
    given = [(f"{one.where} phase", one.phase) for one in case.removals]
    for number, load in enumerate(case.loads, start=1):
        where = f"{case.source}: [loads {number}] phase"
        if load.phase > 1 and load.kind == "live":
            raise ValueError(f"{where} is {load.phase}; a live load acts after all settlements: leave it out")
        given += [(where, load.phase)] * (load.phase > 1)
    for where, phase in given:
        if phase > len(case.settlements):
            raise ValueError(
                f"{where} is {phase}; the case has {len(case.settlements)} [[settlement]]: give at most that number, "
                "or add one"
            )


def refuse_increment_seconds(case: Case, seconds: float | None) -> None:
    """Raise ValueError for no time [s] above 0, and where nothing looks at it: where there are no steps."""
    if seconds is not None and not seconds > 0.0:
        raise ValueError(f"increment_seconds is {seconds:g}; give seconds above 0")
    has_steps = bool(KINDS[case.analysis].course(case).drivers)
    if seconds is not None and (not has_steps or case.controls.increments == mechanics.LINEAR_PROGRAM):
        raise ValueError(
            f"{case.source}: [analysis] increment_seconds is {seconds:g}; it is looked at after the steps of a path, "
            "which a limit load without a settlement and a linear program do not have: leave it out"
        )


def _given(values: Mapping[str, Any]) -> dict[str, Any]:
    """Leave out what is not given, and is then as a class has it."""
    return {key: value for key, value in values.items() if value is not None}


def _material(table: Table) -> dict[str, Any]:
    values = _given(keys.MATERIAL.read(table))
    _checked_law(table, {name: value for name, value in values.items() if name != "density"})
    return values


def _densities(materials: Table) -> dict[str, Any]:
    """Read the tables [materials.NAME]; the keys of [material] are easily put there."""
    for name, value in materials.values.items():
        if not isinstance(value, Mapping):
            known = name in [key.name for key in keys.MATERIAL.keys]
            remedy = f"write [material] {name}" if known else f"write [materials.{as_key(name)}] density"
            raise materials.error(name, f"is {shortened(value)}; [materials] has a table for each material: {remedy}")
    return {name: keys.MATERIALS.read(materials.table(name))["density"] for name in materials.values}


def _checked_law(table: Table, values: Mapping[str, Any]) -> solver.InterfaceLaw:
    with beginning(f"{table.source}: [{table.where}]"):
        return solver.InterfaceLaw(**values)


def _interfaces(top: Table) -> dict[tuple[str, str], solver.InterfaceLaw]:
    found: dict[tuple[str, str], solver.InterfaceLaw] = {}
    for entry in top.tables("interfaces"):
        values = _given(keys.INTERFACES.read(entry))
        one, other = values.pop("materials")
        if (one, other) in found or (other, one) in found:
            raise entry.error("materials", f"'{one}' and '{other}' are there twice; give each pair one table")
        found[one, other] = _checked_law(entry, values)
    return found


def _imperfections(top: Table) -> tuple[Imperfection, ...]:
    found: dict[str, Imperfection] = {}
    for entry in top.tables("imperfections"):
        one = read_imperfection(entry)
        if one.kind in found:
            raise entry.error("kind", f"'{one.kind}' is there twice; give one of each kind")
        found[one.kind] = one
    return tuple(found.values())


def _settlement(table: Table, values: Mapping[str, Any]) -> tuple[solver.Settlement, Profile | None]:
    """Make a settlement, and its profile along x, of which only the assembly can make motions of supports."""
    profile, motion = values["profile"], dict(values)
    # Of the controls; and what is given in one of two ways.
    for key in ("step_tolerance", "local_loss", "profile", "blocks"):
        del motion[key]
    steps = motion["limit"] / motion["increment"]
    if steps > keys.MOST_STEPS:
        raise table.error(
            "increment",
            f"is {motion['increment']:g}: {steps:.3g} of them make the limit of {motion['limit']:g}; at most "
            f"{keys.MOST_STEPS} do",
        )
    if profile is not None:
        taken = ["rotation_centre", "rotation", *(("direction", "blocks") if isinstance(profile, dict) else ())]
        for key in taken:
            if table.values.get(key) is not None:
                raise table.error(key, "does not go with this profile, which says how each support moves")
    if isinstance(profile, Profile):
        motion["direction"] = motion["direction"] or (0.0, -1.0)
    if motion["rotation"] is None:
        motion["rotation"] = 1.0 if motion["rotation_centre"] is not None else 0.0
    try:
        if isinstance(profile, dict):
            return solver.Settlement(**motion, profile=profile), None
        return solver.Settlement(**motion, blocks=values["blocks"]), profile
    except ValueError as error:
        raise ValueError(f"{table.source}: [{table.where}] {str(error).removeprefix('settlement ')}") from None


def _load(table: Table) -> LoadCase:
    given, values = set(table.values), keys.LOADS.read(table)
    load = LoadCase(**values | {"positions": values["positions"] or ()})
    if load.direction == (0.0, 0.0):
        raise table.error("direction", "is [0, 0]; give the direction in which the pressure pushes")
    for key in ("direction", "edge"):
        if key in given and load.pressure is None:
            raise table.error(key, "is that of a pressure; add pressure = ... [Pa]")
    if load.edge is not None and "direction" in given:
        raise table.error("direction", "and edge are both given; pressure on an edge is perpendicular to it")
    if load.y is not None and not load.positions:
        raise table.error("y", "is that of positions; add positions = [first x, last x, number of places]")
    if load.positions:
        if load.kind != "live" or not load.has_force:
            live = [] if load.kind == "live" else ['kind = "live"']
            missing = live + ([] if load.has_force else ["force = [fx, fy], in space [fx, fy, fz]"])
            raise table.error("positions", f"are those of a live force; give {' and '.join(missing)}")
        for key in ("blocks", "weight_fraction", "point", "moment", "pressure"):
            if key in given:
                raise table.error(key, "does not go with positions: the force acts on the topmost block at each")
    elif load.weight_fraction is None and load.pressure is None and not (load.has_force or load.has_moment):
        raise table.error("force", "is missing or zero; give force, moment, weight_fraction or pressure")
    if load.point is not None and not (load.has_force or load.has_moment):
        raise table.error(
            "point",
            "is that of a force or moment; pressure and weight_fraction act all over: leave it out, or give force",
        )
    return load


def _controls(
    asked: Mapping[str, Any], phases: Sequence[Mapping[str, Any]], control: Table, overlap_tolerance: float | None
) -> solver.Controls:
    """Make the controls; what drives a path says how exact its steps are to be, and a case has one path."""
    tolerances = [one["step_tolerance"] for one in phases] + [CONTROL.key("step_tolerance").read(control)]
    losses = [one["local_loss"] for one in phases]
    return solver.Controls(
        increments=asked["increments"],
        overlap_tolerance=overlap_tolerance,
        falling_frames=asked["falling_frames"],
        step_tolerance=min((t for t in tolerances if t is not None), default=solver.Controls.step_tolerance),
        local_loss=min((loss for loss in losses if loss is not None), default=solver.Controls.local_loss),
    )
