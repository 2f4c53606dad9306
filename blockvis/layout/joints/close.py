"""Mortar joints closed to the midlines between facing edges, so that faces meet.

A joint is a set of edges that face each other across a gap: one head joint, a whole bed joint, the wedge between two
voussoirs. Where one straight line runs midway between all of them, each moves onto that line, and the new corners
are where the moved edges meet; so facing edges coincide, T-junctions included, and outer edges keep their line.
Where no single line fits all of them (the back of an arch under cut bricks), the less covered edge stays straight on
its own midline, and the blocks that face it are extended to it and cut along it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .facing_edges import CLOSED, edges_of, facing_edges
from .midlines import common_lines, moved_outlines
from .trimming import LONGEST_MITRE, extended_to_lines, separated


@dataclass(frozen=True)
class Closing:
    """Outlines with their joints closed.

    Attributes
    ----------
    outlines : tuple of (n, 2) arrays [m]
    n_joints : int
        Stretches that were open or overlapping.
    n_cut : int
        Stretches that no common line fits; one side was extended to the other and cut along it.
    largest_gap : float [m]
        Widest gap that was closed.
    residual : float [m]
        Widest remaining gap or overlap along them.
    """

    outlines: tuple[np.ndarray, ...]
    n_joints: int
    n_cut: int
    largest_gap: float
    residual: float


def close_joints(
    outlines: Sequence[np.ndarray],
    thickness: float,
    *,
    overlap: float = 0.0,
    anchored: np.ndarray | None = None,
) -> Closing:
    """Move facing edges onto the line midway between them.

    Parameters
    ----------
    outlines : sequence of (n, 2) arrays [m]
        Counter-clockwise.
    thickness : float [m]
        Widest gap that is a joint.
    overlap : float [m]
        Deepest overlap that is resolved in the same way.
    anchored : (n_blocks,) bool array, optional
        Blocks that keep their outline; edges that face them move across the whole gap.

    Returns
    -------
    Closing
    """
    origin = np.concatenate(outlines).mean(axis=0)
    rings = [ring - origin for ring in outlines]
    still = np.zeros(len(rings), dtype=bool) if anchored is None else np.asarray(anchored, dtype=bool)
    edges = edges_of(rings)
    scale = float(np.ptp(edges.start, axis=0).max())
    found = facing_edges(rings, thickness, overlap)
    found = found.chosen(~(still[edges.block[found.edge_a]] & still[edges.block[found.edge_b]]))
    closed = CLOSED * scale
    n_open = int((np.abs(found.gaps).max(axis=1) > closed).sum()) if len(found) else 0
    if n_open == 0:
        return Closing(tuple(outlines), 0, 0, 0.0, 0.0)
    lines, uncommon = common_lines(found, edges, still, closed)
    base = moved_outlines(edges, lines, LONGEST_MITRE * max(thickness, overlap))
    final = extended_to_lines(base, edges, found, uncommon, lines, still, max(thickness, overlap))
    final = separated(final, still, max(thickness, overlap), 10.0 * closed)
    remaining = facing_edges(final, thickness, max(overlap, closed))
    residual = float(np.abs(remaining.gaps).max()) if len(remaining) else 0.0
    return Closing(
        outlines=tuple(outlines[i] if still[i] else ring + origin for i, ring in enumerate(final)),
        n_joints=n_open,
        n_cut=len(uncommon),
        largest_gap=float(found.gaps.max()),
        residual=residual,
    )
