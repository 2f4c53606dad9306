"""Mortar joints closed, so that faces meet: edges that face each other move onto one line midway between them.

Where none fits all of them (the back of an arch under cut bricks), the less covered edge stays straight on its own
midline, and the blocks that face it are extended to it and cut along it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely

from blockvis.layout.left_out import LeftOut
from blockvis.layout.outlines import folded

from .facing_edges import (
    CLOSED,
    Facing,
    edges_of,
    facing_edges,
    proposed_thickness,
    rounded_up,
    search_reach,
    straight_share,
)
from .midlines import common_lines, moved_outlines
from .nearest_stone import proposed_gap, share_out
from .trimming import LONGEST_MITRE, extended_to_lines, separated

#: Ways of closing: edges moved to the midline between faces, mortar to the nearest stone, or whichever fits.
WAYS = ("auto", "faces", "voronoi")

#: Faces are closed edge by edge where at least this share of the length of joints runs between straight ones.
STRAIGHT = 0.85

#: More pockets than this fraction of the area of the joints that are closed between faces, and mortar is shared out.
POCKETS = 0.03

#: A proposed thickness above this fraction of how far was looked is the limit of the search.
LIMIT = 0.95


@dataclass(frozen=True)
class Proposal:
    """How the joints of a drawing can be closed: a thickness [m], 0 without gaps, and "faces" or "voronoi".

    The stretches are of edges that face each other across a gap; gaps were looked for up to a reach [m].
    """

    thickness: float
    method: str
    reach: float
    stretches: Facing

    @property
    def note(self) -> str:
        """What is uncertain about the thickness, or ""."""
        wider = self.stretches.gaps.max(axis=1) > 1.0001 * self.thickness
        if self.thickness >= LIMIT * self.reach:
            return (
                f"gaps were looked for up to {self.reach:.3g} m, and there are joints of that width: wider ones stay "
                "open; give joint_thickness in m to close them"
            )
        if self.method == "faces" and wider.any():
            return (
                f"{self.stretches.lengths[wider].sum():.3g} of {self.stretches.lengths.sum():.3g} m of gaps are wider "
                f"than joint_thickness {self.thickness:g} m, up to {self.stretches.gaps.max():.3g} m, and stay open"
            )
        return ""


def proposed(outlines: Sequence[np.ndarray], method: str = "auto", laid: np.ndarray | None = None) -> Proposal:
    """Propose how the joints of a drawing are closed; the method is one of :data:`WAYS`."""
    thickness, found = proposed_thickness(outlines, laid)
    if method == "auto":
        method = chosen_method(outlines, found)
    if method == "faces":
        return Proposal(thickness, method, search_reach(outlines), found)
    drawn = [ring for k, ring in enumerate(outlines) if laid is None or not laid[k]]
    gap, reach = proposed_gap(drawn) if drawn else (0.0, 0.0)
    return Proposal(rounded_up(gap), method, reach, found) if gap else Proposal(0.0, method, reach, Facing.none())


def chosen_method(outlines: Sequence[np.ndarray], found: Facing) -> str:
    """Choose the method of closing that fits the faces of a drawing."""
    return "faces" if straight_share(outlines, found) >= STRAIGHT else "voronoi"


@dataclass(frozen=True)
class Closing:
    """Outlines, (n, 2) arrays [m], with their joints closed by "faces" or "voronoi".

    Of ``n_joints`` stretches that were open or overlapping, up to a largest gap [m], no common line fitted ``n_cut``:
    one side was extended to the other and cut along it.
    """

    outlines: tuple[np.ndarray, ...]
    n_joints: int
    n_cut: int
    largest_gap: float
    method: str = "faces"


def close_joints(
    outlines: Sequence[np.ndarray],
    thickness: float,
    *,
    overlap: float = 0.0,
    anchored: np.ndarray | None = None,
    method: str = "faces",
    mortar: Sequence[LeftOut] = (),
    laid: np.ndarray | None = None,
) -> Closing:
    """Move facing edges onto the line midway between them, or give the mortar to the nearest stone.

    Gaps up to ``thickness`` [m] are joints, and overlaps up to ``overlap`` [m] are resolved in the same way.
    FoldedOutline if "faces" would fold an outline.

    Parameters
    ----------
    method : {"auto", "faces", "voronoi"}
        "auto" gives the mortar to the nearest stone where faces are not straight, where corners are so blunt that
        pockets would stay open between them, and where edges that move would fold an outline.
    mortar : sequence of LeftOut
        Surfaces of mortar as drawn, with the stones as their holes; the nearest stone takes all of it, however wide.
    """
    anchored = np.zeros(len(outlines), dtype=bool) if anchored is None else np.asarray(anchored, dtype=bool)
    # Without gaps there is nothing to share out.
    must = method == "faces" or (method == "auto" and not thickness)
    if method == "auto" and not must:
        # Judged as far as joints may reach: corners too blunt for this thickness count, too.
        reach = max(thickness, search_reach(outlines))
        method = chosen_method(outlines, facing_edges(outlines, reach, laid=laid))
    if must or method == "faces":
        closing = _between_faces(outlines, thickness, overlap, anchored, laid)
        blocks = folded(outlines, closing.outlines)
        if must and len(blocks):
            raise FoldedOutline(int(blocks[0]))
        if must or (not len(blocks) and _pockets(outlines, closing.outlines, thickness) <= POCKETS):
            return closing
    # Pockets between stones of a bond are none of mortar.
    shared = share_out(outlines, thickness, anchored if laid is None else anchored | laid, mortar)
    scale = float(np.ptp(np.concatenate(outlines), axis=0).max())
    n_open, largest = facing_edges(outlines, thickness, overlap).open(CLOSED * scale)
    return Closing(tuple(shared), n_open, 0, largest, "voronoi")


class FoldedOutline(ValueError):
    """Closing joints edge by edge folds an outline."""

    def __init__(self, block: int) -> None:
        super().__init__(f"moving the edges of outline {block} to the midlines of its joints folds it")
        self.block = block


def _pockets(drawn: Sequence[np.ndarray], closed: Sequence[np.ndarray], thickness: float) -> float:
    """Area of the pockets that stay open between blunt corners, as a fraction of that of the joints closed."""
    union = shapely.union_all(np.array([shapely.Polygon(ring) for ring in closed]))
    holes = [shapely.Polygon(ring) for part in shapely.get_parts(union) for ring in part.interiors]
    # An opening holds a disc of the radius of a joint and a half.
    pockets = sum(hole.area for hole in holes if hole.buffer(-1.5 * thickness).is_empty)
    joints = union.area - sum(shapely.Polygon(ring).area for ring in drawn)
    return float(pockets / joints) if joints > 0.0 else 0.0


def _between_faces(
    outlines: Sequence[np.ndarray], thickness: float, overlap: float, anchored: np.ndarray, laid: np.ndarray | None
) -> Closing:
    """Move facing edges onto the line midway between them."""
    origin = np.concatenate(outlines).mean(axis=0)
    rings = [ring - origin for ring in outlines]
    edges = edges_of(rings)
    scale = float(np.ptp(edges.start, axis=0).max())
    found = facing_edges(rings, thickness, overlap, laid)
    found = found.chosen(~(anchored[edges.block[found.edge_a]] & anchored[edges.block[found.edge_b]]))
    closed = CLOSED * scale
    n_open, largest = found.open(closed)
    if n_open == 0 and overlap == 0.0:
        return Closing(tuple(outlines), 0, 0, 0.0)
    lines, uncommon = common_lines(found, edges, anchored, closed)
    base = _without_repeats(moved_outlines(edges, lines, LONGEST_MITRE * max(thickness, overlap)), closed)
    final = extended_to_lines(base, edges, found, uncommon, lines, anchored, max(thickness, overlap))
    final = separated(_without_repeats(final, closed), anchored, max(thickness, overlap), 10.0 * closed)
    final = _without_repeats(final, closed)
    return Closing(
        outlines=tuple(outlines[i] if anchored[i] else ring + origin for i, ring in enumerate(final)),
        n_joints=n_open,
        n_cut=len(uncommon),
        largest_gap=largest,
    )


def _without_repeats(rings: Sequence[np.ndarray], closed: float) -> list[np.ndarray]:
    """Drop corners that coincide with the one before: an edge without length has no direction."""
    kept = [ring[np.hypot(*(ring - np.roll(ring, 1, axis=0)).T) > closed] for ring in rings]
    return [some if len(some) > 2 else ring for some, ring in zip(kept, rings, strict=True)]
