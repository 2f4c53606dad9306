"""From a layout in space to an assembly: roles, supports, default density, joints in one plane."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

import solver

from .faces import width_of
from .facing import DEFAULT_FACING, faced
from .roles import checked_role, dropped_twins, roles_of, twins_note
from .solid_layout import SolidLayout
from .solids import Solid, prism

#: Beginnings of the notes of a layout in space that change what is analysed.
TOLD = (
    "unit", "left out", "blocks in space", "planes were fitted", "faces were joined", "y is up",
    "the drawing in the plane",
)  # fmt: skip

#: Two blocks closer than this fraction of their size, corner by corner, are one block drawn twice.
SAME = 1e-6


def assemble_solids(
    layout: SolidLayout,
    *,
    roles: Mapping[str, str] | None = None,
    supports: Sequence[Mapping[str, Any]] = (),
    density: float = 2000.0,
    joint_thickness: float = 0.0,
    overlap_tolerance: float | None = None,
) -> solver.Assembly:
    """Make an assembly of a layout in space.

    Parameters
    ----------
    layout : SolidLayout
    roles : mapping of str to {"free", "fixed", "moving"}, optional
        As of :func:`blockvis.layout.assemble.assemble`.
    supports : sequence of mappings
        Support blocks that the file does not contain: ``name``, ``role``, ``outline`` (corners [x, y] in plan [m]), and
        ``levels`` [bottom, top] [m] of each, perhaps ``density`` and ``material``.
    density : float [kg/m³]
        Of blocks for which the layout has none.
    joint_thickness, overlap_tolerance : float [m]
        Open joints and overlaps up to this get one plane for both faces; by default 0.01 of the width of a typical
        block.

    Returns
    -------
    solver.Assembly

    Raises
    ------
    ValueError
        For an unknown role, a key of ``roles`` that matches no block, a support without a volume, and an overlap deeper
        than the tolerance.
    """
    for note in layout.notes:
        if note.startswith(TOLD):
            warnings.warn(f"{layout.source or 'layout'}: {note}", stacklevel=2)
    twins = solid_duplicates(layout.solids)
    if twins:
        dropped = dropped_twins(layout, twins, roles or {})
        warnings.warn(twins_note(layout, twins, dropped), stacklevel=2)
        layout = layout.chosen([i for i in range(layout.n_blocks) if i not in dropped])
    n_drawn = layout.n_blocks
    layout = _with_supports(layout, supports)
    width = float(np.median([width_of(*solid) for solid in layout.solids[:n_drawn]]))
    near = max(joint_thickness, DEFAULT_FACING * width if overlap_tolerance is None else overlap_tolerance)
    facing = faced(layout.solids, layout.names, near, np.arange(layout.n_blocks) >= n_drawn)
    if facing.note:
        warnings.warn(f"{layout.source or 'layout'}: {facing.note}", stacklevel=2)
    unknown = np.full(layout.n_blocks, np.nan) if layout.density is None else layout.density
    assembly = solver.Assembly.from_solids(
        facing.solids,
        names=layout.names,
        roles=roles_of(layout, roles or {}),
        density=np.where(np.isnan(unknown), float(density), unknown),
        materials=layout.materials,
    )
    _refuse_overlaps(assembly, near)
    return assembly


def _refuse_overlaps(assembly: solver.Assembly, tolerance: float) -> None:
    """Refuse blocks that overlap by more than a tolerance [m], with the place and the remedy."""
    one, other, depth = assembly.shapes.overlaps(assembly.vertices, tolerance)
    free = assembly.free[one] | assembly.free[other]
    one, other, depth = one[free], other[free], depth[free]
    if not len(depth):
        return
    k = int(depth.argmax())
    i, j = int(one[k]), int(other[k])
    boxes = [assembly.vertices[assembly.block_of_vertex == block] for block in (i, j)]
    low, high = np.max([b.min(axis=0) for b in boxes], axis=0), np.min([b.max(axis=0) for b in boxes], axis=0)
    place = ", ".join(f"{x:.6g}" for x in (low + high) / 2.0)
    others = f"; {len(depth) - 1} more pairs overlap" if len(depth) > 1 else ""
    raise ValueError(
        f"block {i} ('{assembly.names[i]}') overlaps block {j} ('{assembly.names[j]}') by {depth[k]:.3g} m near "
        f"({place}); move them apart or raise overlap_tolerance ({tolerance:.3g} m){others}"
    )


def solid_duplicates(solids: Sequence[Solid]) -> list[tuple[int, int]]:
    """Find blocks in space that are drawn twice: the first and its later copy."""
    from scipy.spatial import cKDTree

    boxes = np.array([np.concatenate([points.min(axis=0), points.max(axis=0)]) for points, _ in solids])
    size = np.linalg.norm(boxes[:, 3:] - boxes[:, :3], axis=1)
    found: dict[int, int] = {}
    for first, later in sorted(cKDTree(boxes).query_pairs(SAME * float(size.max()))):
        one, other = solids[first][0], solids[later][0]
        if first in found or later in found or len(one) != len(other):
            continue
        distance = np.abs(one[:, None] - other[None]).max(axis=2)
        if distance.min(axis=0).max() <= SAME * size[later] and distance.min(axis=1).max() <= SAME * size[later]:
            found[later] = first
    return sorted((first, later) for later, first in found.items())


def _with_supports(layout: SolidLayout, supports: Sequence[Mapping[str, Any]]) -> SolidLayout:
    if not supports:
        return layout
    known = {"name", "role", "outline", "levels", "density", "material"}
    solids: list[Solid] = []
    for k, support in enumerate(supports):
        name = str(support.get("name", f"support {k}"))
        strange = sorted(set(support) - known)
        if strange:
            raise ValueError(
                f"support '{name}' has the key '{strange[0]}'; in space its keys are {', '.join(sorted(known))}"
            )
        solids.append(_support(name, support))
        checked_role(str(support.get("role", solver.FIXED)), f"support '{name}'")
    nothing = np.full(layout.n_blocks, np.nan)
    own = [float(support.get("density", np.nan)) for support in supports]
    return replace(
        layout,
        solids=layout.solids + tuple(solids),
        names=layout.names + tuple(str(s.get("name", f"support {k}")) for k, s in enumerate(supports)),
        groups=layout.groups + ("",) * len(supports),
        roles=layout.roles + tuple(str(support.get("role", solver.FIXED)) for support in supports),
        materials=layout.materials + tuple(str(support.get("material", "")) for support in supports),
        density=np.append(nothing if layout.density is None else layout.density, own),
    )


def _support(name: str, support: Mapping[str, Any]) -> Solid:
    try:
        outline = np.asarray(support.get("outline"), dtype=float)
        levels = np.asarray(support.get("levels"), dtype=float)
    except (TypeError, ValueError) as error:
        raise ValueError(f"support '{name}': outline and levels must be numbers in m; {error}") from None
    if outline.ndim != 2 or outline.shape[1] != 2 or len(outline) < 3:
        raise ValueError(f"support '{name}' needs at least three corners [x, y] in plan; its shape is {outline.shape}")
    if levels.shape != (2,) or not levels[0] < levels[1]:
        raise ValueError(
            f"support '{name}' stands in space: give levels = [bottom, top] in m beside its outline in plan [x, y]"
        )
    return prism(outline, float(levels[0]), float(levels[1]))
