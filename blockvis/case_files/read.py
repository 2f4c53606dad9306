"""The TOML case file, read and checked."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

import solver
from blockvis import generators
from blockvis.cases.contents import Case
from blockvis.cases.explain_settings import read_explain
from blockvis.cases.imperfections import Imperfection, read_imperfection
from blockvis.cases.loads import LoadCase
from blockvis.cases.profiles import Profile, read_profile
from blockvis.cases.toml_table import Table, is_number, shortened, toml_value
from blockvis.cases.value_paths import parse_path, put
from blockvis.formats import FORMATS
from blockvis.kinds.kinds import KINDS
from blockvis.layout.joints.close import WAYS
from blockvis.layout.views import VIEWS
from blockvis.results.folder import VIDEO_SUFFIXES
from blockvis.text import files_like

from .case_keys import MOST_STEPS


def read_case(path: str | Path, changes: Sequence[str] = ()) -> Case:
    """Read and check a case file.

    Parameters
    ----------
    path : str or Path
    changes : sequence of str
        Changes for this time, as ``"material.friction_coefficient=0.5"``; see :func:`changed_text`.

    Returns
    -------
    Case

    Raises
    ------
    ValueError
        For a missing file, broken TOML, an unknown key, a value of the wrong kind; names the file, the key or line and
        the remedy.
    """
    path = Path(path)
    text = case_file_text(path)
    return parse_case(changed_text(text, path, changes) if changes else text, path)


def case_file_text(path: Path) -> str:
    """Read the text of a case file; raises ``ValueError`` where it is missing, a layout, or no text."""
    if not path.is_file():
        near = files_like(path, "*.toml", or_any=True)
        hint = f"; beside it are {', '.join(near)}" if near else ""
        raise ValueError(f"there is no case file '{path}'{hint}")
    if path.suffix.lower() in FORMATS:
        raise ValueError(
            f"'{path}' is a layout, not a case file; a case file names it, what settles and by how much: "
            f'[geometry] file = "{path.name}" (see examples/); blockvis info shows what is in it'
        )
    try:
        # Editors of Windows begin a file with a mark of its encoding.
        return path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        raise ValueError(
            f"{path}: is not a text file in UTF-8 ({error.reason} at byte {error.start}); save it in UTF-8"
        ) from None


def changed_text(text: str, source: Path, changes: Sequence[str]) -> str:
    """Change values in the text of a case file; what is not changed stays as it is, comments included.

    Parameters
    ----------
    text : str
    source : Path
        The case file.
    changes : sequence of str
        ``key=value`` each: a dotted key, with ``[n]`` for entries of a list, from 0, and a value as TOML writes it, or
        a plain word. Tables that the file does not have are made.

    Raises
    ------
    ValueError
        For broken TOML, a change without "=", and a key that leads nowhere; names the key.
    """
    import tomlkit

    parse_case(text, source)
    document: Any = tomlkit.parse(text)
    for change in changes:
        key, equals, value = change.partition("=")
        if not equals:
            raise ValueError(f"'{change}' is no change of a case; write key=value, as in material.density=1800")
        try:
            put(document, parse_path(key.strip()), toml_value(value))
        except ValueError as error:
            raise ValueError(f"{source}: cannot set '{key.strip()}': {error}") from None
    return tomlkit.dumps(document)


def parse_case(text: str, source: Path) -> Case:
    """Read a case from the text of a case file; paths in it are relative to the folder of ``source``."""
    return case_of(parsed_toml(text, source), source, text)


def parsed_toml(text: str, source: Path) -> dict[str, Any]:
    """Parse the text of a case file; raises ``ValueError`` with the place where it is no TOML."""
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise ValueError(f"{source}: nests lists or tables without end; a case file has a handful of them") from None
    except ValueError as error:
        hint = "; write paths with / or in single quotes" if "\\" in text else ""
        raise ValueError(f'{source}: {error}; a case file is TOML, for instance: file = "arch.msh"{hint}') from None


def case_of(values: Mapping[str, Any], source: Path, text: str = "") -> Case:
    """Make a case of the values of a parsed TOML text; paths in it are relative to the folder of ``source``."""
    top = Table(values, "", source)
    geometry = top.table("geometry")
    file, layout, parameters, unit = _drawn(geometry)
    view, ignore, only = _chosen(geometry, file)
    dimension = geometry.take("dimension", "auto")
    if isinstance(dimension, bool) or dimension not in (2, 3, "auto"):
        raise geometry.error("dimension", f'is {shortened(dimension)}; give 2, 3 or "auto"')
    joint = geometry.take("joint_thickness", 0.0)
    if joint != "auto":
        joint = geometry.number("joint_thickness", 0.0)
        if joint < 0.0:
            raise geometry.error("joint_thickness", f'is {joint:g}; give a thickness in m of at least 0, or "auto"')
    roles = top.table("roles").values
    for name, role in roles.items():
        if role not in solver.ROLES:
            raise ValueError(f'{source}: [roles] "{name}" is {shortened(role)}; a role is {", ".join(solver.ROLES)}')
    material = top.table("material")
    materials = top.table("materials")
    densities = {}
    for name in materials.values:
        one = materials.table(name)
        densities[name] = one.number("density", positive=True)
        one.finish()
    analysis = top.table("analysis")
    motions = [_settlement(entry) for entry in top.tables("settlement")]
    kind = KINDS[analysis.text("kind", next(iter(KINDS)), among=tuple(KINDS))]
    # Every kind reads its keys: one that is given to another kind is named, not ignored.
    settings = {name: known.read(top, analysis) for name, known in KINDS.items()}
    output = top.table("output")
    animation = output.take("animation", "collapse.mp4")
    if animation is not False:
        animation = output.text("animation", "collapse.mp4")
        if not Path(animation).name == animation or "\\" in animation or not animation.lower().endswith(VIDEO_SUFFIXES):
            raise output.error(
                "animation",
                f"is {shortened(animation)}; give a name ending in {', '.join(VIDEO_SUFFIXES)}, without a folder: "
                "it is written into the results folder",
            )
    case = Case(
        source=source,
        text=text,
        file=None if file is None else source.parent / file,
        layout=layout,
        parameters=dict(parameters),
        unit=unit,
        view=view,
        dimension=dimension,
        ignore=ignore,
        only=only,
        thickness=geometry.number("thickness", positive=True),
        joint_thickness=joint,
        outline_tolerance=_tolerance(geometry),
        closing=geometry.text("closing", "auto", among=WAYS),
        overlap_tolerance=geometry.number("overlap_tolerance", positive=True),
        roles=dict(roles),
        supports=tuple(_support(entry) for entry in top.tables("supports")),
        density=material.number("density", positive=True),
        densities=densities,
        friction_coefficient=_friction(material),
        **_strength(material),
        interfaces=dict(_interface(entry) for entry in top.tables("interfaces")),
        imperfections=_imperfections(top),
        settlements=tuple(settlement for settlement, _ in motions),
        profiles=tuple(profile for _, profile in motions),
        loads=tuple(_load(entry) for entry in top.tables("loads")),
        analysis=kind.name,
        settings=settings[kind.name],
        controls=_controls(top, analysis, geometry.number("overlap_tolerance", positive=True)),
        explain=read_explain(top.table("explain")),
        animation=animation or None,
        vtu=output.text("vtu", "moved", among=("moved", "undeformed")),
    )
    for table in (geometry, material, analysis, output, top):
        table.finish()
    return _checked(case, settings)


def _tolerance(geometry: Table) -> float | None:
    """Tolerance of outlines [m]: 0 keeps every corner; None where the case does not say."""
    value = geometry.number("outline_tolerance")
    if value is not None and value < 0.0:
        raise geometry.error("outline_tolerance", f"is {value:g}; give a length in m of at least 0")
    return None if value is None else float(value)


def _drawn(geometry: Table) -> tuple[str | None, str | None, Mapping[str, Any], str | None]:
    """File or layout, with the parameters of the one and the unit of the other."""
    file, layout, unit = (geometry.text(key) for key in ("file", "layout", "unit"))
    parameters = geometry.table("parameters").values
    if (file is None) == (layout is None):
        problem = "is missing; name the layout file" if file is None else "and layout are both given; give one of them"
        raise geometry.error("file", problem + f", or a layout: {', '.join(generators.LAYOUTS)}" * (file is None))
    if file is not None and parameters:
        raise geometry.error("parameters", "belong to a layout, not to a file")
    if layout is not None and unit not in (None, "m"):
        raise geometry.error(
            "unit", f"is {shortened(unit)}, but is of a file's lengths; a layout is in m: leave it out"
        )
    return file, layout, parameters, unit


def _chosen(geometry: Table, file: str | None) -> tuple[str | None, tuple[str, ...], tuple[str, ...]]:
    """Read what is chosen of a file: view, ignore and only."""
    view = geometry.text("view", among=tuple(VIEWS))
    ignore, only = geometry.texts("ignore"), geometry.texts("only")
    for key, value in (("view", view), ("ignore", ignore), ("only", only)):
        if file is None and value:
            raise geometry.error(key, "belongs to a file, not to a layout")
    return view, ignore, only


def _checked(case: Case, settings: Mapping[str, Any]) -> Case:
    """Check that the keys of a case fit its kind of analysis.

    Parameters
    ----------
    case : Case
    settings : mapping
        What each kind has read from its keys, by its name.
    """
    moving = [k for k, load in enumerate(case.loads, start=1) if load.positions]
    if len(moving) > 1:
        raise ValueError(
            f"{case.source}: [loads {moving[1]}] positions: only one load may move, and loads {moving[0]} does"
        )
    for name, other in KINDS.items():
        if name != case.analysis:
            other.refuse(settings[name], case)
    return KINDS[case.analysis].checked(case)


def _friction(table: Table, default: float | None = solver.InterfaceLaw.friction_coefficient) -> float:
    value = table.number("friction_coefficient", default)
    if value is None:
        raise table.error("friction_coefficient", "is missing")
    if value < 0.0:
        raise table.error("friction_coefficient", f"is {value:g}; it must be at least 0")
    return float(value)


def _support(table: Table) -> Mapping[str, Any]:
    support = {
        "name": table.text("name", "support"),
        "role": table.text("role", solver.FIXED, among=(solver.FIXED, solver.MOVING)),
        "outline": table.take("outline"),
    }
    levels = table.pair("levels", words="[bottom, top]")
    if levels is not None:
        support["levels"] = list(levels)
    if not isinstance(support["outline"], list) or len(support["outline"]) < 3:
        raise table.error("outline", f"is {shortened(support['outline'])}; give at least three corners [[x, y], ...]")
    for corner in support["outline"]:
        if not isinstance(corner, (list, tuple)) or len(corner) != 2 or not all(map(is_number, corner)):
            raise table.error("outline", f"has the corner {shortened(corner)}; give two numbers [x, y]")
    material = table.text("material")
    if material is not None:
        support["material"] = material
    table.finish()
    return support


def _strength(table: Table) -> dict[str, float]:
    """Cohesion and compressive strength [Pa]; without a key no cohesion, and infinite strength."""
    cohesion = table.number("cohesion", 0.0)
    if cohesion < 0.0:
        raise table.error("cohesion", f"is {cohesion:g}; give a stress in Pa of at least 0")
    strength = table.number("compressive_strength", positive=True)
    return {"cohesion": cohesion, "compressive_strength": math.inf if strength is None else strength}


def _interface(table: Table) -> tuple[tuple[str, str], solver.InterfaceLaw]:
    pair = table.take("materials")
    if not (isinstance(pair, list) and len(pair) == 2 and all(isinstance(name, str) for name in pair)):
        raise table.error("materials", f'is {pair!r}; name two materials ["stone", "brick"]')
    law = solver.InterfaceLaw(_friction(table, None), **_strength(table))
    table.finish()
    return (pair[0], pair[1]), law


def _imperfections(top: Table) -> tuple[Imperfection, ...]:
    found: dict[str, Imperfection] = {}
    for entry in top.tables("imperfections"):
        one = read_imperfection(entry.values, f"{top.source}: [{entry.where}]")
        if one.kind in found:
            raise ValueError(f"{top.source}: [{entry.where}] kind '{one.kind}' is there twice; give one of each kind")
        found[one.kind] = one
    return tuple(found.values())


def _settlement(table: Table) -> tuple[solver.Settlement, Profile | None]:
    """Read a settlement, and its profile along x, of which only the assembly can make motions of supports."""
    blocks = table.take("blocks")
    if blocks is not None:
        blocks = tuple([blocks] if isinstance(blocks, str) else blocks if isinstance(blocks, (list, tuple)) else [None])
        if not all(isinstance(name, str) for name in blocks):
            raise table.error("blocks", f"is {shortened(table.values['blocks'])}; give names of supports in quotes")
    keys = {
        "direction": table.vector("direction"),
        "rotation_centre": table.vector("rotation_centre"),
        "rotation_axis": table.triple("rotation_axis"),
        "rotation": table.number("rotation"),
        "radial_from": table.pair("radial_from"),
        "increment": table.number("increment", 0.01, positive=True),
        "limit": table.number("limit", 1.0, positive=True),
        "tolerance": table.number("tolerance", positive=True),
    }
    # Read with the controls.
    table.take("step_tolerance")
    table.take("local_loss")
    profile = read_profile(table)
    table.finish()
    if keys["limit"] / keys["increment"] > MOST_STEPS:
        raise table.error(
            "increment",
            f"is {keys['increment']:g}: {keys['limit'] / keys['increment']:.3g} of them make the limit of "
            f"{keys['limit']:g}; at most {MOST_STEPS} do",
        )
    if profile is not None:
        taken = ["rotation_centre", "rotation", *(("direction", "blocks") if isinstance(profile, dict) else ())]
        for key in taken:
            if table.values.get(key) is not None:
                raise table.error(key, "does not go with this profile, which says how each support moves")
    if isinstance(profile, Profile):
        keys["direction"] = keys["direction"] or (0.0, -1.0)
    if keys["rotation"] is None:
        keys["rotation"] = 1.0 if keys["rotation_centre"] is not None else 0.0
    try:
        if isinstance(profile, dict):
            return solver.Settlement(**keys, profile=profile), None
        return solver.Settlement(**keys, blocks=blocks), profile
    except ValueError as error:
        raise ValueError(f"{table.source}: [{table.where}] {error}") from None


def _pressure_direction(table: Table) -> tuple[float, float]:
    given = table.vector("direction", (0.0, -1.0))
    if len(given) != 2:
        raise table.error("direction", "has three numbers; pressure is of blocks in the plane: in space give force")
    return given[0], given[1]


def _load(table: Table) -> LoadCase:
    given = set(table.values)
    load = LoadCase(
        kind=table.text("kind", "dead", among=("dead", "live")),
        blocks=table.text("blocks", "*"),
        weight_fraction=table.vector("weight_fraction"),
        force=table.vector("force", (0.0, 0.0)),
        point=table.vector("point"),
        moment=_moment(table),
        pressure=table.number("pressure"),
        direction=_pressure_direction(table),
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
        if load.kind != "live" or not load.has_force:
            raise table.error("positions", 'are those of a live force; give kind = "live" and force = [fx, fy]')
        for key in ("blocks", "weight_fraction", "point", "moment", "pressure"):
            if key in given:
                raise table.error(key, "does not go with positions: the force acts on the topmost block at each")
    elif load.weight_fraction is None and load.pressure is None and not (load.has_force or load.has_moment):
        raise table.error("force", "is missing or zero; give force, moment, weight_fraction or pressure")
    return load


def _moment(table: Table) -> float | tuple[float, float, float]:
    """Read a moment: a number, in space three."""
    if isinstance(table.values.get("moment"), list | tuple):
        found: tuple[float, float, float] = table.triple("moment")
        return found
    moment: float = table.number("moment", 0.0)
    return moment


def _positions(table: Table) -> tuple[float, ...]:
    given = table.numbers("positions")
    if given is None:
        return ()
    if len(given) != 3 or given[2] != int(given[2]) or given[2] < 2 or given[0] >= given[1]:
        raise table.error("positions", f"is {list(given)}; give [first x, last x, number of places], at least 2 places")
    return tuple(np.linspace(given[0], given[1], int(given[2])).tolist())


def _controls(top: Table, analysis: Table, overlap_tolerance: float | None) -> solver.Controls:
    frames = analysis.number("falling_frames")
    if frames is not None and not (frames == int(frames) and 0 <= frames <= MOST_STEPS):
        raise analysis.error("falling_frames", f"is {frames:g}; give a whole number from 0 to {MOST_STEPS}")
    # What drives a path says how exact its steps are to be; a case has one path.
    tables = (*top.tables("settlement"), top.table("control"))
    tolerances = [table.fraction("step_tolerance") for table in tables]
    losses = [table.share("local_loss") for table in top.tables("settlement")]
    return solver.Controls(
        increments=analysis.text("increments", "coulomb", among=solver.INCREMENTS),
        overlap_tolerance=overlap_tolerance,
        falling_frames=None if frames is None else int(frames),
        step_tolerance=min((t for t in tolerances if t is not None), default=solver.Controls.step_tolerance),
        local_loss=min((loss for loss in losses if loss is not None), default=solver.Controls.local_loss),
    )
