"""From a layout to an assembly: roles, supports, default density and thickness, repair."""

from __future__ import annotations

import re
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

import solver

from .assemble_solids import assemble_solids
from .inspect_solids import inspected_solids
from .layout import AnyLayout, Layout
from .repair import duplicates, repaired
from .roles import checked_role, dropped_twins, roles_of, twins_note
from .selection import drawn_mortar
from .simplify import default_tolerance, simplified
from .solid_layout import SolidLayout

#: How the notes of a layout begin that change what is analysed, after a number of what they are about.
TOLD = re.compile(
    r"unit|left out|ignore|cut|joined|the middle planes|elevations were ignored|skipped|a hidden <|a <use>"
    r"|\d+ (blocks are faces|faults of the file|hidden|<use>)"
)


def assemble(
    layout: AnyLayout,
    *,
    roles: Mapping[str, str] | None = None,
    supports: Sequence[Mapping[str, Any]] = (),
    density: float = 2000.0,
    thickness: float = 1.0,
    joint_thickness: float | str = 0.0,
    overlap_tolerance: float | None = None,
    closing: str = "auto",
    outline_tolerance: float | None = None,
) -> solver.Assembly:
    """Make an assembly of a layout.

    Parameters
    ----------
    layout : Layout or SolidLayout
        Of blocks in space; thickness, closing and outline_tolerance belong to the plane, see
        :func:`blockvis.layout.assemble_solids.assemble_solids` for the others.
    roles : mapping of str to {"free", "fixed", "moving"}, optional
        Keys are names of blocks, groups (layers) or materials, or patterns of them (``"springer *"``). A block's
        own name holds over its group, a name over a pattern, a later key over an earlier one.
    supports : sequence of mappings
        Support blocks that the file does not contain: ``name``, ``role`` and ``outline`` [m] of each, perhaps
        ``density``, ``thickness`` and ``material``.
    density : float [kg/m³]
        Of blocks for which the layout has none.
    thickness : float [m]
        Of blocks for which the layout has none.
    joint_thickness : float [m] or "auto"
        Gaps between facing edges up to this width are closed to their midline.
    overlap_tolerance : float, optional [m]
        Overlaps up to this depth are resolved to their midline, deeper ones are an error; see
        :func:`blockvis.layout.repair.repaired` for the default.
    closing : {"auto", "faces", "voronoi"}
        How joints are closed: edges move to the midline between faces, or mortar goes to the nearest stone; "auto"
        takes the second where faces are not straight.
    outline_tolerance : float, optional [m]
        Corners within this distance of a simpler outline are dropped; by default a hundredth of the size of a block
        where outlines have more than 24 corners in the mean, else 0.

    Returns
    -------
    solver.Assembly

    Raises
    ------
    ValueError
        For an unknown role, a key of ``roles`` that matches no block, and an overlap deeper than the tolerance.
    """
    if isinstance(layout, SolidLayout):
        if isinstance(joint_thickness, str):
            joint_thickness = inspected_solids(layout).joint_thickness
        return assemble_solids(
            layout,
            roles=roles,
            supports=supports,
            density=density,
            joint_thickness=joint_thickness,
            overlap_tolerance=overlap_tolerance,
        )
    for note in layout.notes:
        if TOLD.match(note):
            warnings.warn(f"{layout.source}: {note}", stacklevel=2)
    n_drawn = layout.n_blocks
    twins = duplicates(layout.outlines)
    if twins:
        dropped = dropped_twins(layout, twins, roles or {})
        warnings.warn(twins_note(layout, twins, dropped), stacklevel=2)
        layout = layout.chosen([i for i in range(n_drawn) if i not in dropped])
        n_drawn = layout.n_blocks
    tolerance = default_tolerance(layout.outlines) if outline_tolerance is None else float(outline_tolerance)
    if not (np.isfinite(tolerance) and tolerance >= 0):
        raise ValueError(f"outline_tolerance is {tolerance:g} m; it must be a length of at least 0")
    outlines, note = simplified(_counter_clockwise(layout), tolerance) if tolerance else (layout.outlines, "")
    if note:
        warnings.warn(f"{layout.source or 'layout'}: {note}", stacklevel=2)
    layout = _with_supports(replace(layout, outlines=tuple(outlines)), supports)
    assembly = solver.Assembly.from_outlines(
        layout.outlines,
        names=layout.names,
        roles=roles_of(layout, roles or {}),
        density=_filled(layout.density, density, layout.n_blocks),
        thickness=_filled(layout.thickness, thickness, layout.n_blocks),
        materials=layout.materials,
    )
    outlines, repairs = repaired(
        assembly,
        joint_thickness=joint_thickness,
        overlap_tolerance=overlap_tolerance,
        anchored=np.arange(layout.n_blocks) >= n_drawn,
        closing=closing,
        mortar=drawn_mortar(layout),
    )
    for note in repairs:
        warnings.warn(f"{layout.source or 'layout'}: {note}", stacklevel=2)
    return solver.Assembly.from_outlines(
        outlines,
        names=assembly.names,
        roles=list(map(str, assembly.roles)),
        density=assembly.density,
        thickness=assembly.thickness,
        materials=assembly.materials,
    )


def _counter_clockwise(layout: Layout) -> tuple[np.ndarray, ...]:
    """Outlines counter-clockwise and checked, with the names of their blocks in messages."""
    assembly = solver.Assembly.from_outlines(layout.outlines, names=layout.names)
    return tuple(assembly.outline(i) for i in range(assembly.n_blocks))


def _filled(given: np.ndarray | None, default: float, n: int) -> np.ndarray:
    if given is None:
        return np.full(n, float(default))
    return np.where(np.isnan(given), float(default), given)


def _with_supports(layout: Layout, supports: Sequence[Mapping[str, Any]]) -> Layout:
    if not supports:
        return layout
    known = {"name", "role", "outline", "density", "thickness", "material"}
    added: dict[str, list[Any]] = {key: [] for key in known}
    for k, support in enumerate(supports):
        name = str(support.get("name", f"support {k}"))
        strange = sorted(set(support) - known)
        if strange:
            raise ValueError(f"support '{name}' has the key '{strange[0]}'; its keys are {', '.join(sorted(known))}")
        if "outline" not in support:
            raise ValueError(f"support '{name}' has no outline; give its corners [[x, y], ...] in m")
        try:
            outline = np.asarray(support["outline"], dtype=float)
        except (TypeError, ValueError) as error:
            raise ValueError(f"support '{name}': its outline must be corners [[x, y], ...] in m; {error}") from None
        if outline.ndim != 2 or outline.shape[1] != 2 or len(outline) < 3:
            raise ValueError(f"support '{name}' needs at least three corners [x, y]; its shape is {outline.shape}")
        added["name"].append(name)
        added["outline"].append(outline)
        added["role"].append(checked_role(str(support.get("role", solver.FIXED)), f"support '{name}'"))
        added["material"].append(str(support.get("material", "")))
        added["density"].append(float(support.get("density", np.nan)))
        added["thickness"].append(float(support.get("thickness", np.nan)))
    nothing = np.full(layout.n_blocks, np.nan)
    return replace(
        layout,
        outlines=layout.outlines + tuple(added["outline"]),
        names=layout.names + tuple(added["name"]),
        groups=layout.groups + ("",) * len(supports),
        roles=layout.roles + tuple(added["role"]),
        materials=layout.materials + tuple(added["material"]),
        density=np.append(nothing if layout.density is None else layout.density, added["density"]),
        thickness=np.append(nothing if layout.thickness is None else layout.thickness, added["thickness"]),
    )
