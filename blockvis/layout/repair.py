"""Repair of drawn outlines: duplicates found, overlaps resolved or refused, joints closed."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

import solver
from solver.mechanics import counted

from .joints.close import Closing, FoldedOutline, close_joints, proposed
from .joints.trimming import overlapping
from .left_out import LeftOut
from .outlines import ROUNDING
from .surfaces import same_points

#: Outlines closer than this fraction of the narrowest extent of a block, corner by corner, are one drawn twice, and
#: overlaps below this fraction of the width of the thinnest block are contacts without a word.
DRAWN_GAP = 1e-3

#: Deepest overlap that is resolved unless the caller says otherwise, as a fraction of the width of a typical block.
DEFAULT_OVERLAP = 0.04


def duplicates(blocks: Sequence[np.ndarray]) -> list[tuple[int, int]]:
    """Find blocks that are drawn twice, by their (n, d) corners [m]: the first of each, and its later copy."""
    centres = np.array([(corners.min(axis=0) + corners.max(axis=0)) / 2.0 for corners in blocks])
    sizes = np.array([float(np.ptp(corners, axis=0).max()) for corners in blocks])
    found: list[tuple[int, int]] = []
    unlike: dict[int, list[int]] = {}
    for i, place in enumerate(same_points(centres, 2.0 * DRAWN_GAP * float(np.median(sizes))).tolist()):
        earlier = unlike.setdefault(place, [])
        twin = next((k for k in earlier if _same(blocks[k], blocks[i])), None)
        if twin is None:
            earlier.append(i)
        else:
            found.append((twin, i))
    return sorted(found)


def _same(one: np.ndarray, other: np.ndarray) -> bool:
    if len(one) != len(other):
        return False
    about = one - one.mean(axis=0)
    _, _, axes = np.linalg.svd(about, full_matrices=False)
    tolerance = DRAWN_GAP * float(np.ptp(about @ axes.T, axis=0).min())
    distance = np.abs(one[:, None, :] - other[None, :, :]).max(axis=2)
    return bool((distance.min(axis=0) <= tolerance).all() and (distance.min(axis=1) <= tolerance).all())


def overlaps(assembly: solver.Assembly, tolerance: float) -> list[tuple[int, int, float]]:
    """Find pairs of blocks that overlap by more than a tolerance [m], and the depth [m], the deepest overlap first."""
    i, j, depth = assembly.shapes.overlaps(assembly.vertices, tolerance)
    return [(int(i[k]), int(j[k]), float(depth[k])) for k in np.argsort(-depth)]


class DeepOverlap(ValueError):
    """Blocks that overlap more than a run resolves."""


def refuse_overlaps(assembly: solver.Assembly, found: Sequence[tuple[int, int, float]], tolerance: float) -> None:
    """Refuse the deepest of some overlaps if it is deeper than a tolerance [m], with the place and the remedy."""
    deep = [pair for pair in found if pair[2] > tolerance]
    if not deep:
        return
    i, j, depth = deep[0]
    corners = [assembly.vertices[assembly.block_of_vertex == block] for block in (i, j)]
    low, high = np.max([c.min(axis=0) for c in corners], axis=0), np.min([c.max(axis=0) for c in corners], axis=0)
    place = ", ".join(f"{x:.6g}" for x in (low + high) / 2.0)
    others = f"; {counted(len(deep) - 1, 'more pair overlaps', 'more pairs overlap')}" if len(deep) > 1 else ""
    raise DeepOverlap(
        f"block {i} ('{assembly.names[i]}') overlaps block {j} ('{assembly.names[j]}') by {depth:.3g} m near "
        f"({place}); move them apart or raise overlap_tolerance ({tolerance:.3g} m){others}"
    )


def repaired(
    assembly: solver.Assembly,
    *,
    joint_thickness: float | str,
    overlap_tolerance: float | None,
    anchored: np.ndarray,
    closing: str = "auto",
    mortar: Sequence[LeftOut] = (),
    laid: np.ndarray,
) -> tuple[list[np.ndarray], list[str]]:
    """Resolve the overlaps of the outlines of an assembly without duplicates, close its joints, and tell the changes.

    Overlaps are resolved up to a tolerance [m], by default 0.04 of the width of a typical block (twice its area over
    its perimeter); joints are closed as by :func:`blockvis.layout.joints.close.close_joints`. ValueError for a deeper
    overlap, naming both blocks, and for an outline that cannot be closed.
    """
    outlines = [assembly.outline(i) for i in range(assembly.n_blocks)]
    free = ~anchored if not anchored.all() else anchored
    width = float(np.median(assembly.widths[free]))
    tolerance = DEFAULT_OVERLAP * width if overlap_tolerance is None else float(overlap_tolerance)
    found = [(i, j, d) for i, j, d in overlaps(assembly, ROUNDING * width) if not (anchored[i] and anchored[j])]
    refuse_overlaps(assembly, found, tolerance)
    notes, asked, thickness = list[str](), closing, joint_thickness
    if isinstance(thickness, str):
        proposal = proposed([outlines[i] for i in np.flatnonzero(free)], closing, laid[free])
        thickness, doubt = proposal.thickness, proposal.note
        notes = [f'joint_thickness "auto" found {thickness:g} m' + (f": {doubt}" if doubt else "")]
        # Faces that turn out not to close edge by edge may still be closed in the other way.
        closing = closing if proposal.method == "faces" else proposal.method
    if not found and thickness == 0:
        return outlines, notes
    depth = min(tolerance, 1.01 * found[0][2]) if found else 0.0
    try:
        closed = close_joints(
            outlines, thickness, overlap=depth, anchored=anchored, method=closing, mortar=mortar, laid=laid
        )
    except FoldedOutline as error:
        remedy = f'give closing = "voronoi", or a joint_thickness other than {thickness:g} m'
        raise ValueError(
            f"closing the joints of block {error.block} ('{assembly.names[error.block]}') face by face folds its "
            f"outline; {remedy if thickness else 'redraw what overlaps it, or give a smaller overlap_tolerance'}"
        ) from None
    pairs = zip(*overlapping(closed.outlines, ROUNDING * width), strict=True)
    left = [(int(i), int(j), float(d)) for i, j, d in pairs if not (anchored[i] and anchored[j])]
    notes += _notes(closed, thickness, found, left, assembly, bool(mortar), asked)
    return list(closed.outlines), notes


def _notes(
    closing: Closing,
    thickness: float,
    found: list[tuple[int, int, float]],
    left: list[tuple[int, int, float]],
    assembly: solver.Assembly,
    drawn: bool,
    asked: str,
) -> list[str]:
    notes = []
    still = {pair[:2] for pair in left}
    gone = [pair for pair in found if pair[:2] not in still]
    for pairs, what in ((gone, ("was cut away", "were cut away")), (left, ("could not be cut away",) * 2)):
        if pairs:
            i, j, depth = max(pairs, key=lambda pair: pair[2])
            notes.append(
                f"{counted(len(pairs), 'overlap')} of up to {depth:.3g} m {what[len(pairs) > 1]}, the deepest between "
                f"'{assembly.names[i]}' and '{assembly.names[j]}'; redraw them, or lower "
                "overlap_tolerance to have them refused"
            )
    if thickness and not closing.largest_gap and not drawn:
        notes.append(nothing_closed(thickness))
    elif thickness and closing.method == "voronoi":
        why = "" if asked == "voronoi" else ": faces are not straight, or corners blunt"
        corners = sum(map(len, closing.outlines)) / len(closing.outlines)
        notes.append(
            f"joints of up to {thickness:g} m{', and the mortar as drawn,' if drawn else ''} were closed by giving the "
            f"mortar to the nearest stone{why}; {corners:.3g} corners a block"
        )
    elif thickness:
        notes.append(
            f"{counted(closing.n_joints, 'stretch', 'stretches')} of joints of up to "
            f"{closing.largest_gap:.3g} m closed to the midline, {closing.n_cut} of them by cutting one side "
            "along the other"
        )
    return notes


def nothing_closed(thickness: float) -> str:
    """Say that a joint thickness [m] closes nothing."""
    return f"no gaps of up to joint_thickness {thickness:g} m lie between blocks: nothing was closed"
