"""Pictures of what a drawing holds, in the plane and in space, and of why one is refused."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from blockvis.layout.faults import crossings_left_out, faults_of, no_blocks
from blockvis.layout.unfilled import walls_to_fill
from solver import mechanics

from . import palette
from .inspection_sheet import Contents, Kind, draw_contents

if TYPE_CHECKING:
    from blockvis.layout.inspect import Inspection
    from blockvis.layout.layout import Layout
    from blockvis.layout.refusal import Refused

#: Blocks at fault that are named beside them, and overlaps that are ringed: as many as are listed.
MOST_NAMED = 8


def draw_inspection(
    inspection: Inspection,
    path: str | Path,
    *,
    ground: Layout | None = None,
    falling: Sequence[int] = (),
    remark: str = "",
) -> Path:
    """Draw what was found: blocks with their names and roles, joints by their thickness, what was left out.

    The file is .png, .svg or .pdf. ``ground`` are supports beside the blocks of the drawing, with their roles,
    ``falling`` the numbers of blocks that do not stand; a ``remark`` is written above.
    """
    layout, kept = inspection.layout, inspection.kept.tolist()
    deep = [pair for pair in inspection.overlapping if pair[2] > inspection.overlap_tolerance]
    sorted_out: dict[int, str] = dict.fromkeys((k for pair in inspection.twins for k in pair), "twice")
    sorted_out |= dict.fromkeys(falling, "falls") | dict.fromkeys((k for pair in deep for k in pair[:2]), "overlap")
    wrong = tuple(kept[k] for k in no_blocks(inspection.facing.solids)) if inspection.refused else ()
    sorted_out |= dict.fromkeys(wrong, "refused")
    walls = walls_to_fill(layout)
    own = {k: sorted_out.get(k) or inspection.roles[k] for k in kept}
    kinds = _kinds(own, "opening, or block" if walls else "free")
    # What lies in an outline without stones is an opening: no ground goes under it.
    if ground is not None and not walls:
        laid = _kinds(dict(enumerate(ground.roles, start=layout.n_blocks)), "free")
        kinds += [replace(kind, label=f"ground of blockvis new, {kind.label}") for kind in laid]
        layout = layout.with_more(ground.blocks, names=ground.names, roles=ground.roles)
    middles = [_overlap(layout, i, j) for i, j, _ in deep[:MOST_NAMED]]
    crossings = crossings_left_out(layout) if layout.dimension == 2 else np.zeros((0, 3))
    counted = (("deepest overlaps", len(middles)), ("crosses itself", len(crossings)))
    in_space = " in space" if layout.dimension == 3 else ""
    contents = Contents(
        layout=layout,
        title=f"{_name(layout)}: {mechanics.counted(len(kept), 'block')}{in_space}, read in {layout.unit}",
        findings=(*_findings(inspection, deep), *walls.values(), *((remark,) if remark and not walls else ())),
        kinds=tuple(kinds),
        named=tuple(kept),
        marked=wrong[:MOST_NAMED],
        rings=np.concatenate([np.array(middles).reshape(-1, layout.dimension), crossings]),
        rings_are=", ".join(f"{what}: {n}" for what, n in counted if n),
        joints=inspection.joints,
    )
    return draw_contents(contents, path)


def draw_refusal(refused: Refused, path: str | Path) -> Path | None:
    """Draw why a drawing was refused: its lines as they are, their open ends, crossings and blocks at fault.

    Returns None where nothing was read that could be drawn.
    """
    layout = refused.layout
    if layout is None or not (layout.n_blocks or any(len(item.points) for item in layout.left_out)):
        return None
    faults = faults_of(layout, refused.blocks)
    wrong = faults.blocks
    others = tuple(k for k in range(layout.n_blocks) if k not in wrong)
    kinds = (Kind("read", palette.DRAWN, others), Kind("refused", palette.REFUSED, wrong))
    contents = Contents(
        layout=layout,
        title=f"{_name(layout)}: refused",
        findings=(str(refused),),
        kinds=tuple(kind for kind in kinds if kind.blocks),
        named=tuple(range(layout.n_blocks)),
        marked=wrong[:MOST_NAMED],
        rings=faults.crossings,
        rings_are=f"crosses itself: {len(faults.crossings)}",
        ends=faults.ends,
        edges=faults.edges,
        unit=refused.unit,
    )
    return draw_contents(contents, path)


def _kinds(own: Mapping[int, str], free: str) -> list[Kind]:
    """List the kinds of blocks that there are, from what each block is; free ones are called so."""
    looks = {
        mechanics.FREE: (free, palette.DRAWN, ""),
        mechanics.FIXED: ("fixed", palette.SUPPORT, "////"),
        mechanics.MOVING: ("moving", palette.MOVING, "\\\\\\\\"),
        "twice": ("drawn twice", palette.TWICE, ""),
        "falls": ("does not stand", palette.FALLS, ""),
        "overlap": ("overlapping, refused", palette.REFUSED, ""),
        "refused": ("refused", palette.REFUSED, ""),
    }
    blocks = {key: tuple(k for k, what in own.items() if what == key) for key in looks}
    return [Kind(label, colour, blocks[key], hatch) for key, (label, colour, hatch) in looks.items() if blocks[key]]


def _findings(inspection: Inspection, deep: Sequence[tuple[int, int, float]]) -> tuple[str, ...]:
    """Say in lines what is not seen at a glance."""
    size = " × ".join(f"{length:.4g}" for length in inspection.high - inspection.low)
    said = [f"{size} m"]
    thickness = f"joint_thickness {inspection.joint_thickness * 1e3:g} mm"
    if len(inspection.joints) and inspection.joint_thickness:
        said.append(f"{thickness} found")
    if inspection.open_joints:
        said.append(f"open joints: {len(inspection.open_joints)}, {thickness} closes them")
    if inspection.layout.dimension == 3:
        said.append(inspection.facing.note or "faces in contact lie in one plane")
    if deep:
        i, j, depth = deep[0]
        names = inspection.layout.names
        said.append(f"pairs that overlap: {len(deep)}, '{names[i]}' and '{names[j]}' by {depth:.3g} m")
    return ("   ·   ".join(said), *([inspection.refused] if inspection.refused else []))


def _name(layout: Layout) -> str:
    return Path(layout.source).name or "layout"


def _overlap(layout: Layout, i: int, j: int) -> np.ndarray:
    """(d,) array [m]: the middle of what the boxes around two blocks have in common."""
    one, other = layout.corners(i), layout.corners(j)
    low = np.maximum(one.min(axis=0), other.min(axis=0))
    return np.asarray((low + np.minimum(one.max(axis=0), other.max(axis=0))) / 2.0)
