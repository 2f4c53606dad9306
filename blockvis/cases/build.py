"""From a checked case to its assembly, interfaces and loads."""

from __future__ import annotations

import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np

import solver
from blockvis import generators
from blockvis.formats.read import read_layout
from blockvis.layout import layout
from blockvis.layout.assemble import assemble
from blockvis.suggestions import nearest

from .contents import Case
from .imperfections import imperfect, joint_scatter
from .loads import loads_of

#: A block lighter than this part of the whole may drown in what rounding leaves of the forces on the others.
LIGHTEST = 1e-14

#: Blocks that are all smaller than this [m] are a drawing in another unit.
SMALLEST_BLOCKS = 2e-3

#: What a file's blocks are made of where nothing else is said [kg/m³, m].
DENSITY, THICKNESS = 2000.0, 1.0


def case_assembly(case: Case) -> solver.Assembly:
    """The assembly of a case: its layout file or parametric layout with roles, supports and materials applied."""
    sketch = _case_layout(case)
    if case.densities:
        sketch = _with_densities(case, sketch)
    assembly = assemble(
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


def _case_layout(case: Case) -> layout.Layout:
    if case.file is not None:
        return read_layout(case.file, unit=case.unit)
    assert case.layout is not None
    try:
        sketch = layout.layout_of(generators.build(case.layout, case.parameters))
    except (TypeError, ValueError) as error:
        raise ValueError(f"{case.source}: [geometry] layout: {error}") from None
    # A layout brings its own density and thickness, unless the case says otherwise.
    return replace(
        sketch,
        density=sketch.density if case.density is None else None,
        thickness=sketch.thickness if case.thickness is None else None,
    )


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
    """The laws of the interfaces of a case."""
    return solver.Interfaces(
        solver.InterfaceLaw(case.friction_coefficient, case.cohesion, case.compressive_strength),
        dict(case.interfaces),
        scatter=joint_scatter(case.imperfections),
    )


def case_loads(case: Case, assembly: solver.Assembly) -> solver.Loads:
    """Self-weight and the loads of a case that stand still, in N."""
    return loads_of(case.loads, assembly, case.source)
