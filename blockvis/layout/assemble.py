"""From a layout to an assembly: roles, supports, default density and thickness, repair."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

import solver
from blockvis.text import beginning, nearest
from solver import mechanics
from solver.mechanics import counted

from .facing import faced, facing_tolerance
from .inspect import DENSITY, inspected
from .joints.close import WAYS
from .layout import Layout
from .notes import REPORTED, kind_of
from .outlines import ring_width
from .repair import DRAWN_GAP, nothing_closed, overlaps, refuse_overlaps, repaired
from .roles import checked_role, roles_of, without_twins
from .selection import drawn_mortar
from .simplify import default_tolerance, simplified
from .solids import prism, width_of

#: Joints thicker than this multiple of the width of a typical block are a mistake.
THICKEST_JOINT = 2.0

#: Convex parts that hold more than their block, by more than this part of its volume, share some of it.
CROSSING = 2.5e-3


def assemble(
    layout: Layout,
    *,
    roles: Mapping[str, str] | None = None,
    supports: Sequence[Mapping[str, Any]] = (),
    density: float = DENSITY,
    thickness: float = 1.0,
    joint_thickness: float | str = 0.0,
    overlap_tolerance: float | None = None,
    closing: str = "auto",
    outline_tolerance: float | None = None,
) -> solver.Assembly:
    """Make an assembly of a layout, as :func:`blockvis.read_layout` or :func:`blockvis.generators.bond` give one.

    Parameters
    ----------
    layout : Layout
        ``thickness``, ``closing`` and ``outline_tolerance`` are of blocks in the plane.
    roles : mapping of str to {"free", "fixed", "moving"}, optional
        Keys are names of blocks, groups (layers) or materials, or patterns of them (``"springer *"``). A block's
        own name holds over its group, a name over a pattern, a later key over an earlier one.
    supports : sequence of mappings
        Support blocks that the file does not contain: ``name``, ``role`` and ``outline`` [m] of each, perhaps
        ``density``, ``thickness`` and ``material``. In space the outline lies in plan, and ``levels``, [bottom, top]
        [m], take the place of the thickness.
    density : float or (n_blocks,) array [kg/m³]
        Of blocks for which the layout has none; of several with ``supports`` last.
    thickness : float or (n_blocks,) array [m]
        Likewise.
    joint_thickness : float [m] or "auto"
        Gaps between facing edges, or faces, up to this width are closed to their midline.
    overlap_tolerance : float, optional [m]
        Overlaps up to this depth are resolved to their midline, deeper ones are an error; see
        :func:`blockvis.layout.repair.repaired` and :func:`blockvis.layout.facing.facing_tolerance` for the
        default.
    closing : {"auto", "faces", "voronoi"}
        How joints are closed: edges move to the midline between faces, or mortar goes to the nearest stone; "auto"
        takes the second where faces are not straight.
    outline_tolerance : float, optional [m]
        Corners within this distance of a simpler outline are dropped; by default a hundredth of the size of a block
        where outlines have more than 24 corners in the mean, else 0.

    Raises
    ------
    ValueError
        For an unknown role, a key of ``roles`` that matches no block, a support without a volume, an overlap deeper
        than the tolerance, and a length that is none.
    """
    _check_kinds(layout, roles, supports)
    _check_lengths(layout, joint_thickness, overlap_tolerance, closing, outline_tolerance)
    where = layout.source or "layout"
    for note in layout.notes:
        if kind_of(note) in REPORTED:
            warnings.warn(f"{where}: {note}", stacklevel=2)
    if isinstance(joint_thickness, str) and layout.dimension == 3:
        joint_thickness = inspected(layout).joint_thickness
    layout, note = without_twins(layout, roles or {})
    if note:
        warnings.warn(note, stacklevel=2)
    n_drawn = layout.n_blocks
    if layout.dimension == 2:
        layout, note = as_simplified(layout, outline_tolerance)
        if note:
            warnings.warn(f"{where}: {note}", stacklevel=2)
    if supports:
        layout = layout.with_more(**vars(supports_of(supports, layout.dimension)))
    anchored = np.arange(layout.n_blocks) >= n_drawn
    of_blocks: dict[str, Any] = {
        "names": layout.names,
        "roles": roles_of(layout, roles or {}),
        "density": _filled(layout.density, density),
        "materials": layout.materials,
    }
    if layout.dimension == 3:
        tolerance = facing_tolerance(layout.solids[:n_drawn], float(joint_thickness), overlap_tolerance)
        facing = faced(layout.solids, layout.names, tolerance, anchored)
        assembly = solver.Assembly.from_solids(facing.solids, **of_blocks)
        accepted = tolerance if overlap_tolerance is None else overlap_tolerance
        said = facing.note or (nothing_closed(float(joint_thickness)) if joint_thickness else "")
        for note in (said, _left_overlaps(assembly, accepted), _crossings(assembly)):
            if note:
                warnings.warn(f"{where}: {note}", stacklevel=2)
        return assembly
    of_blocks["thickness"] = _filled(layout.thickness, thickness)
    outlines, repairs = repaired(
        solver.Assembly.from_outlines(layout.outlines, **of_blocks),
        joint_thickness=joint_thickness,
        overlap_tolerance=overlap_tolerance,
        anchored=anchored,
        closing=closing,
        mortar=drawn_mortar(layout),
        laid=np.array(layout.laid),
    )
    for note in repairs:
        warnings.warn(f"{where}: {note}", stacklevel=2)
    return solver.Assembly.from_outlines(outlines, **of_blocks)


def _check_kinds(layout: Any, roles: Any, supports: Any) -> None:
    """Refuse what is of another kind than it is to be, by a TypeError."""
    if not isinstance(layout, Layout):
        raise TypeError(f"{type(layout).__name__} is no Layout, as read_layout gives; blockvis.read takes a file")
    if not isinstance(roles, Mapping | None):
        raise TypeError(f"roles are {roles!r}; give a mapping from names, groups or materials to roles")
    if isinstance(supports, Mapping):
        raise TypeError(f"supports are {supports!r}; give a list of them")


def _check_lengths(
    layout: Layout,
    joint_thickness: float | str,
    overlap_tolerance: float | None,
    closing: str,
    outline_tolerance: float | None,
) -> None:
    """Refuse what is no length of at least 0, a joint much thicker than blocks are, and an unknown way of closing."""
    if closing not in WAYS:
        raise ValueError(f"closing is '{closing}'; choose from {', '.join(WAYS)}")
    given = {"overlap_tolerance": overlap_tolerance, "outline_tolerance": outline_tolerance}
    if not isinstance(joint_thickness, str):
        given["joint_thickness"] = joint_thickness
    elif joint_thickness.strip().lower() != "auto":
        raise ValueError(f"joint_thickness is '{joint_thickness}'; give a length in m or \"auto\"")
    for name, length in given.items():
        if length is not None and not 0.0 <= float(length) < np.inf:
            raise ValueError(f"{name} is {length:g} m; it must be a length of at least 0")
    joint, in_space = given.get("joint_thickness") or 0.0, layout.dimension == 3
    if joint == 0.0 or not layout.n_blocks:
        return
    widths = [width_of(*solid) for solid in layout.solids] if in_space else list(map(ring_width, layout.outlines))
    width = float(np.median(widths))
    if joint > THICKEST_JOINT * width:
        raise ValueError(
            f"joint_thickness is {joint:g} m, more than {THICKEST_JOINT:g} times the width of a typical block "
            f"({width:.3g} m); give the width of the mortar joints in m"
        )


def _left_overlaps(assembly: solver.Assembly, accepted: float) -> str:
    """Refuse blocks in space that overlap by more than is accepted [m], and tell which overlap by less."""
    found = overlaps(assembly, min(accepted, DRAWN_GAP * float(assembly.widths.min())))
    found = [pair for pair in found if assembly.free[list(pair[:2])].any()]
    refuse_overlaps(assembly, found, accepted)
    if not found:
        return ""
    i, j, depth = found[0]
    return (
        f"{counted(len(found), 'pair of blocks overlaps', 'pairs of blocks overlap')} by up to {depth:.3g} m "
        f"('{assembly.names[i]}' and '{assembly.names[j]}'), taken as in contact; lower overlap_tolerance "
        f"({accepted:.3g} m) to have that refused"
    )


def _crossings(assembly: solver.Assembly) -> str:
    """Tell which blocks have a surface that crosses itself a little, as the volume of their convex parts shows."""
    shapes = assembly.shapes
    if not isinstance(shapes, mechanics.Polyhedra) or shapes.parts.whole:
        return ""
    excess = np.bincount(shapes.parts.block_of_part, shapes.parts.solids.volumes) / shapes.volumes - 1.0
    worst = int(np.abs(excess).argmax())
    n = int((np.abs(excess) > CROSSING).sum())
    if not n:
        return ""
    crossing = "surface of 1 block crosses itself" if n == 1 else f"surfaces of {n} blocks cross themselves"
    return (
        f"the {crossing}: the convex parts of '{assembly.names[worst]}' hold "
        f"{100.0 * excess[worst]:+.2g} % of its volume more; redraw them"
    )


def as_simplified(layout: Layout, tolerance: float | None = None) -> tuple[Layout, str]:
    """Drop the corners of outlines that a run does not need, within a tolerance [m], and say so; "" for none."""
    tolerance = default_tolerance(layout.outlines) if tolerance is None else float(tolerance)
    if not tolerance:
        return layout, ""
    # Counter-clockwise and checked, with the names of their blocks in messages.
    assembly = solver.Assembly.from_outlines(layout.outlines, names=layout.names)
    outlines, note = simplified([assembly.outline(i) for i in range(assembly.n_blocks)], tolerance)
    return replace(layout, blocks=tuple(outlines)), note


def _filled(given: np.ndarray | None, default: ArrayLike) -> ArrayLike:
    return default if given is None else np.where(np.isnan(given), default, given)


def supports_of(supports: Sequence[Mapping[str, Any]], dimension: int) -> Layout:
    """Make a layout of supports that a drawing does not contain, as :func:`assemble` takes them.

    ValueError names the support and the key.
    """
    in_space = dimension == 3
    known = {"name", "role", "outline", "density", "material", "stiffness", "levels" if in_space else "thickness"}
    names = [str(support.get("name", f"support {k}")) for k, support in enumerate(supports)]
    blocks, roles = [], []
    for name, support in zip(names, supports, strict=True):
        strange = sorted(set(support) - known)
        if strange:
            where, hint = "in space" if in_space else "in the plane", nearest(strange[0], sorted(known))
            other = ", or give [geometry] dimension = " + (
                "2 if the blocks are in the plane" if in_space else "3 if the blocks are in space"
            )
            raise ValueError(
                f"support '{name}' has the key '{strange[0]}', which no support {where} has{hint}; leave it out"
                f"{other if strange[0] in ('levels', 'thickness') else ''}"
            )
        outline = _outline_of(support, name)
        blocks.append(prism(outline, *_levels_of(support, name)) if in_space else outline)
        roles.append(checked_role(str(support.get("role", mechanics.FIXED)), f"support '{name}'"))
    return Layout(
        blocks=tuple(blocks),
        names=tuple(names),
        roles=tuple(roles),
        materials=tuple(str(support.get("material", "")) for support in supports),
        density=np.array([float(support.get("density", np.nan)) for support in supports]),
        thickness=None if in_space else np.array([float(support.get("thickness", np.nan)) for support in supports]),
    )


def _outline_of(support: Mapping[str, Any], name: str) -> np.ndarray:
    if "outline" not in support:
        raise ValueError(f"support '{name}' has no outline; give its corners [[x, y], ...] in m")
    try:
        outline = np.asarray(support["outline"], dtype=float)
    except (TypeError, ValueError) as error:
        raise ValueError(f"support '{name}': its outline must be corners [[x, y], ...] in m; {error}") from None
    if outline.ndim != 2 or outline.shape[1] != 2 or len(outline) < 3:
        raise ValueError(f"support '{name}' needs at least three corners [x, y]; its shape is {outline.shape}")
    # As a block by itself, before it is one of many whose message names no support.
    with beginning(f"support '{name}': outline:"):
        solver.Assembly.from_outlines([outline], names=[name])
    return outline


def _levels_of(support: Mapping[str, Any], name: str) -> tuple[float, float]:
    try:
        bottom, top = map(float, support["levels"])
    except (KeyError, TypeError, ValueError):
        bottom = top = np.nan
    if bottom >= top:
        raise ValueError(f"support '{name}': levels is [{bottom:g}, {top:g}]; give the lower first, in m")
    if not bottom < top:
        raise ValueError(
            f"support '{name}' stands in space: give levels = [bottom, top] in m beside its outline in plan [x, y]"
        )
    return bottom, top
