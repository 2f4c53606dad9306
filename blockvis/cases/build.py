"""From a case to its assembly, interfaces and loads."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

import solver
from blockvis import generators
from blockvis.formats.read import overlap_remedy, read_layout, read_outlines
from blockvis.layout import layout
from blockvis.layout.assemble import assemble, supports_of
from blockvis.layout.faces import OFF_PLANE
from blockvis.layout.inspect import DENSITY
from blockvis.layout.left_out import LeftOut
from blockvis.layout.repair import DeepOverlap
from blockvis.layout.units import doubt, units_instead
from blockvis.text import beginning, listed, nearest
from solver import mechanics
from solver.mechanics import counted, steep_note

from .backfill import backfills
from .bonds import bonded
from .contents import Case
from .coordinates import check_coordinates
from .imperfections import imperfect, joint_scatter
from .loads import loads_of
from .magnitudes import doubted_numbers
from .profiles import cut_ground, pieces_named
from .removals import gone_in, removed_blocks, removed_ties
from .role_places import with_roles_by_place
from .ties import check_layers, drawn_ties, ties_of, without_tie_lines

#: Fraction of the whole weight of which the forces on a block are known to a tenth: balance is exact to 5e-9 of it.
LIGHTEST = 1e-7

#: A settlement that ends further than so many times the size of the structure is probably in mm.
FARTHEST_LIMIT = 5.0

#: Likewise a centre of rotation that is farther away.
FARTHEST_CENTRE = 50.0

#: Default of blocks for which neither file nor case has a value [m]; for density that of what is inspected.
THICKNESS = 1.0


def case_assembly(case: Case) -> solver.Assembly:
    """Build the assembly of a case, with roles, supports, materials and imperfections.

    ValueError for a layout that cannot be read or built, for a file whose unit is in doubt while the case gives none,
    and for settlements without a moving support.
    """
    sketch = without_tie_lines(_drawn_layout(case), case.tie_layers, case.source)[0]
    _refuse_doubted_unit(case, sketch)
    sketch = with_roles_by_place(sketch, case.role_places)
    _check_shared_names(case, sketch)
    _note_kept(case, sketch)
    if case.densities:
        sketch = _with_densities(case, sketch)
    with beginning(f"{case.source}: [[supports]]"):
        supports_of(case.supports, sketch.dimension)
    try:
        assembly = assemble(
            sketch,
            roles=case.roles,
            supports=case.supports,
            density=case.density or DENSITY,
            thickness=case.thickness or THICKNESS,
            joint_thickness=case.joint_thickness,
            overlap_tolerance=case.overlap_tolerance,
            closing=case.closing,
            outline_tolerance=case.outline_tolerance,
        )
    except DeepOverlap as error:
        chosen = _chosen(case)
        remedy = overlap_remedy(sketch, dimension=case.dimension, **chosen) if case.file is not None else ""
        drawing = f"{case.source}: " + (f"'{case.file.name}': " if case.file is not None else "")
        raise ValueError(f"{drawing}{error}{remedy and f'; {remedy}'}") from None
    _refuse_unknown_materials(case, assembly)
    if case.settlements and not assembly.moving.any():
        groups = sorted({g for g in sketch.groups if g} | {s["name"] for s in case.supports})
        held = [name for name, free in zip(assembly.names, assembly.free, strict=True) if not free]
        raise ValueError(
            f'{case.source}: no block is a moving support; give one of these the role "moving" under [roles] or add '
            f"[[supports]]: {listed(groups or held or assembly.names, 12)}"
        )
    check_coordinates(case, assembly)
    _note_numbers(assembly, case.source)
    _note_units(case, assembly)
    assembly = cut_ground(assembly, case.profiles, case.settlements)
    _refuse_idle_settlements(case, assembly)
    return imperfect(assembly, case.imperfections)


def _check_shared_names(case: Case, sketch: layout.Layout) -> None:
    """Say which supports have a name that is taken; refuse one of given stiffness, which it has by its name."""
    names = [*sketch.names, *(support["name"] for support in case.supports)]
    for name in dict.fromkeys(support["name"] for support in case.supports):
        if names.count(name) < 2:
            continue
        said = f"{case.source}: [supports] name: '{name}' is the name of another support or block"
        if name in case.ground:
            raise ValueError(f"{said}; give each support a name of its own")
        warnings.warn(
            f"{said}: what is said of '{name}' holds for all {names.count(name)}, and results number them "
            f"('{name} #2'); give each support a name of its own",
            stacklevel=3,
        )


def _refuse_idle_settlements(case: Case, assembly: solver.Assembly) -> None:
    """Refuse a settlement whose ``blocks`` are none of the moving supports."""
    for number, phase in enumerate(case.settlements, start=1):
        if phase.blocks is None:
            continue
        named = pieces_named(phase.blocks, assembly)
        moving = [name for name, moves in zip(assembly.names, assembly.moving, strict=True) if moves]
        where = f"{case.source}: [settlement{f' {number}' if len(case.settlements) > 1 else ''}] blocks"
        unknown = [name for name in named if name not in assembly.names]
        if unknown:
            raise ValueError(
                f"{where}: no block is named '{unknown[0]}'{nearest(unknown[0], moving)}; "
                f"the moving supports are {listed(moving, 12)}"
            )
        if not set(moving) & set(named):
            raise ValueError(
                f"{where} ({listed(named) or 'none'}) are no moving supports, so that nothing would move; "
                f"those of the case are {listed(moving, 12)}"
            )


def _refuse_doubted_unit(case: Case, sketch: layout.Layout) -> None:
    """Refuse blocks far from the size of masonry where another unit would make them masonry and nobody gives theirs."""
    if case.file is None or sketch.unit_by in ("layout", "user") or case.bonds:
        return
    size = float(np.median(sketch.sizes))
    page = sketch.unit_by == "page"
    better = units_instead(sketch.unit, size, page=page)
    if better:
        remedy = (
            f'give the one it is drawn in, as [geometry] unit = "{better[0]}", or unit = "{sketch.unit}" if it is right'
        )
        raise ValueError(f"{case.source}: '{case.file.name}': {doubt(sketch.unit, size, page=page, remedy=remedy)}")


def _refuse_unknown_materials(case: Case, assembly: solver.Assembly) -> None:
    known = sorted({material for material in assembly.materials if material})
    for pair in case.interfaces:
        for material in pair:
            if material not in known:
                has = f"the blocks have {known}" if known else "no block has one"
                near = nearest(material, known)
                raise ValueError(
                    f"{case.source}: [[interfaces]] material '{material}' is that of no block{near}; {has}"
                )


def _note_numbers(assembly: solver.Assembly, source: Path) -> None:
    """Warn of blocks too light beside the others."""
    weight = np.where(assembly.free, assembly.masses, 0.0)
    light = np.flatnonzero(assembly.free & (weight < LIGHTEST * weight.sum()))
    if len(light):
        warnings.warn(
            f"{source}: {counted(len(light), 'block weighs', 'blocks weigh')} less than {LIGHTEST:g} of the whole "
            f"({assembly.listed(light, 6)}), whose forces balance to 5e-9 of it, and may stay in the air, or collapse "
            "elsewhere; check size and density, remove what is so light, or run what it is part of alone",
            stacklevel=3,
        )


def _note_kept(case: Case, sketch: layout.Layout) -> None:
    """Warn where the density or thickness of the case loses against the file's."""
    if case.file is None:
        return
    laid = np.array(sketch.laid)
    for key, given, drawn, unit, remedy in (
        ("[material] density", case.density, sketch.density, "kg/m³", "[materials.NAME] density replaces it"),
        ("[geometry] thickness", case.thickness, sketch.thickness, "m", "change it there, or leave the key out"),
    ):
        own = np.zeros(0) if given is None or drawn is None else drawn[np.isfinite(drawn) & ~laid]
        if given is not None and not np.allclose(own, given, rtol=1e-5):
            warnings.warn(
                f"{case.source}: {key} = {given:g} is that of {counted(sketch.n_blocks - len(own), 'block')}; "
                f"{len(own)} of {sketch.n_blocks} keep what '{case.file.name}' says, {own.min():g} to {own.max():g} "
                f"{unit}; {remedy}",
                stacklevel=3,
            )


def _note_units(case: Case, assembly: solver.Assembly) -> None:
    """Warn of numbers that are probably in another unit; refuse an increment of more than the whole structure."""
    sizes = np.sqrt(assembly.areas) if assembly.dimension == 2 else np.cbrt(assembly.shapes.volumes)
    sizes = sizes[assembly.free]
    notes = []
    if case.file is None and len(sizes):
        notes.append(doubt("m", float(np.median(sizes)), remedy="the parameters of layouts are in m"))
    steep = {"[material]": case.friction_coefficient}
    steep |= {f"[[interfaces]] {' and '.join(pair)}": law.friction_coefficient for pair, law in case.interfaces.items()}
    for where, friction in steep.items():
        if note := steep_note(friction):
            notes.append(f"{where} {note}")
    notes += doubted_numbers(case, assembly)
    notes += _doubted_lengths(case, assembly, float(np.median(sizes)) if len(sizes) else np.inf)
    for note in filter(None, notes):
        warnings.warn(f"{case.source}: {note}", stacklevel=3)


def _doubted_lengths(case: Case, assembly: solver.Assembly, block: float) -> list[str]:
    """Doubt increments, limits and centres of settlements that are probably in mm, by the size of a block [m]."""
    notes, whole = [], float(np.ptp(assembly.vertices, axis=0).max())
    farthest = max(FARTHEST_LIMIT * whole, solver.Settlement.limit)
    for key, most, size, what in (
        ("increment", block, block, "size of the median block"),
        ("limit", farthest, whole, "size of the structure"),
    ):
        largest = max((getattr(s, key) for s in case.settlements if s.unit == "m"), default=0.0)
        if largest > most:
            said = f"[settlement] {key} = {largest:g} m is {largest / size:.3g} times the {what}, {size:.3g} m"
            if key == "increment" and largest > whole:
                raise ValueError(
                    f"{case.source}: {said}, and the whole is {whole:.3g} m: if it is in mm, give {1e-3 * largest:g}, "
                    f"else at most {whole:.3g}"
                )
            notes.append(f"{said}: is it in mm? {1e-3 * largest:g} m")
    middle = assembly.vertices.mean(axis=0)
    turns = {(s.rotation_centre, s.rotation_axis) for s in case.settlements if s.rotation_centre is not None}
    for centre, axis in sorted(turns):
        # Along an axis its centre may be anywhere.
        across = middle - centre if axis is None else np.cross(middle - centre, axis) / np.linalg.norm(axis)
        if (away := float(np.linalg.norm(across)) / whole) > FARTHEST_CENTRE:
            notes.append(
                f"[settlement] rotation_centre = {list(centre)} m is {away:.3g} times the size of the structure, "
                f"{whole:.3g} m, away from it: is it in mm? [{', '.join(f'{1e-3 * x:g}' for x in centre)}] m"
            )
    return notes


def case_controls(case: Case, assembly: solver.Assembly) -> solver.Controls:
    """Make the controls of a case, by which overlaps that were accepted where its file was read are contacts."""
    shapes, controls = assembly.shapes, case.controls
    if not isinstance(shapes, mechanics.Polyhedra) or case.file is None or controls.overlap_tolerance is not None:
        return controls
    width = float(np.median(6.0 * shapes.volumes / shapes.surfaces))
    return replace(controls, overlap_tolerance=OFF_PLANE * width)


def _chosen(case: Case) -> dict[str, Any]:
    """Gather what of the file of a case is read, and the scale of an image."""
    ignore = (*case.ignore, *case.tie_layers)
    return {"view": case.view, "ignore": ignore, "only": case.only, "window": case.window, **case.image}


def _drawn_layout(case: Case) -> layout.Layout:
    thickness = case.thickness or THICKNESS
    if case.file is not None and case.bonds:
        outlines = read_outlines(case.file, unit=case.unit, **_chosen(case))
        walls = bonded(outlines, case.bonds, str(case.source), case.roles, mortar=False)
        return layout.standing(walls, thickness) if case.dimension == 3 else walls
    if case.file is not None:
        chosen = _chosen(case)
        return read_layout(case.file, unit=case.unit, dimension=case.dimension, thickness=thickness, **chosen)
    assert case.layout is not None
    try:
        sketch = layout.layout_of(generators.build(case.layout, case.parameters))
    except (TypeError, ValueError) as error:
        raise ValueError(f"{case.source}: [geometry] layout: {error}") from None
    # A parametric layout has its own density and thickness; those of the case replace them.
    sketch = replace(sketch, density=sketch.density if case.density is None else None)
    if sketch.dimension == 2:
        sketch = replace(sketch, thickness=sketch.thickness if case.thickness is None else None)
        return layout.standing(sketch, thickness) if case.dimension == 3 else sketch
    if case.dimension == 2:
        raise ValueError(f"{case.source}: [geometry] dimension is 2, but the layout '{case.layout}' is in space")
    return sketch


def _with_densities(case: Case, sketch: layout.Layout) -> layout.Layout:
    unknown = set(case.densities) - set(sketch.materials)
    if unknown:
        name = sorted(unknown)[0]
        known = sorted(set(sketch.materials))
        raise ValueError(
            f"{case.source}: [materials.{name}] matches no block{nearest(name, known)}; the file has {known}"
        )
    density = np.full(sketch.n_blocks, np.nan) if sketch.density is None else sketch.density.copy()
    for i, material in enumerate(sketch.materials):
        density[i] = case.densities.get(material, density[i])
    return replace(sketch, density=density)


def case_interfaces(case: Case) -> solver.Interfaces:
    """Build the interface laws of a case."""
    return solver.Interfaces(
        case.law, dict(case.interfaces), scatter=joint_scatter(case.imperfections), ground=case.ground
    )


def case_loads(case: Case, assembly: solver.Assembly) -> solver.Loads:
    """Sum self-weight and the loads of a case that do not move [N, N·m], and lay its fill over the blocks."""
    loads = loads_of(case.loads, assembly, case.source, gone_in(case.removals, assembly, 1))
    if note := loads.note_on_mass(assembly):
        warnings.warn(f"{case.source}: {note}", stacklevel=2)
    return replace(loads, fills=backfills(case.backfills, assembly))


def case_changes(case: Case, assembly: solver.Assembly, ties: Sequence[solver.Tie]) -> tuple[solver.PhaseChange, ...]:
    """Find what changes between the settlements of a case: what is taken away, and loads that begin to act.

    ValueError for a name that no block or no tie has.
    """
    changes = [
        solver.PhaseChange(one.phase - 1, removed_blocks(one, assembly), ties=removed_ties(one, ties))
        for one in case.removals
    ]
    for phase in sorted({load.phase for load in case.loads} - {1}):
        added = loads_of(case.loads, assembly, case.source, gone_in(case.removals, assembly, phase), phase)
        changes.append(
            solver.PhaseChange(
                phase - 1, dead=added.dead, dead_arms=added.dead_arms, dead_acceleration=added.dead_acceleration
            )
        )
    return tuple(changes)


def case_ties(case: Case, assembly: solver.Assembly) -> tuple[solver.Tie, ...]:
    """Find the ties of a case, those that its drawing has as lines included."""
    lines: tuple[LeftOut, ...] = ()
    if case.tie_layers:
        check_layers(case.ties, case.tie_layers, case.source)
        lines = without_tie_lines(_drawn_layout(case), case.tie_layers, case.source)[1]
    ties = drawn_ties(case.ties, lines)
    gone = {phase: gone_in(case.removals, assembly, phase) for phase in {tie.phase for tie in ties}}
    return ties_of(ties, assembly, gone)
