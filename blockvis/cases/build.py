"""From a case to its assembly, interfaces and loads."""

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

#: The weight of a block lighter than this fraction of the whole may be lost in rounding errors of the other forces.
LIGHTEST = 1e-14

#: If all blocks are smaller than this [m], the unit of the file is probably another one.
SMALLEST_BLOCKS = 2e-3

#: Defaults of blocks for which neither file nor case has a value [kg/m³, m].
DENSITY, THICKNESS = 2000.0, 1.0


def case_assembly(case: Case) -> solver.Assembly:
    """Build the assembly of a case.

    Parameters
    ----------
    case : Case

    Returns
    -------
    solver.Assembly
        Of its layout file or parametric layout, with roles, supports, materials and imperfections.

    Raises
    ------
    ValueError
        For a layout that cannot be read or built, and for settlements without a moving support.
    """
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
        closing=case.closing,
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
    """Warn of blocks too light for double precision, and of a unit that is probably wrong."""
    weight = np.where(assembly.free, assembly.masses, 0.0)
    light = np.flatnonzero(assembly.free & (weight < LIGHTEST * weight.sum()))
    if len(light):
        shown = ", ".join(f"'{assembly.names[i]}'" for i in light[:6].tolist()) + (" ..." if len(light) > 6 else "")
        warnings.warn(
            f"{source}: {len(light)} blocks weigh less than {LIGHTEST:g} of the whole ({shown}), less than rounding "
            "errors of the others: they may stay in the air; remove them or check their size and density",
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
        return read_layout(case.file, unit=case.unit, ignore=case.ignore, only=case.only)
    assert case.layout is not None
    try:
        sketch = layout.layout_of(generators.build(case.layout, case.parameters))
    except (TypeError, ValueError) as error:
        raise ValueError(f"{case.source}: [geometry] layout: {error}") from None
    # A parametric layout has its own density and thickness; those of the case replace them.
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
    """Build the interface laws of a case."""
    return solver.Interfaces(
        solver.InterfaceLaw(case.friction_coefficient, case.cohesion, case.compressive_strength),
        dict(case.interfaces),
        scatter=joint_scatter(case.imperfections),
    )


def case_loads(case: Case, assembly: solver.Assembly) -> solver.Loads:
    """Sum self-weight and the loads of a case that do not move [N, N·m]."""
    return loads_of(case.loads, assembly, case.source)
