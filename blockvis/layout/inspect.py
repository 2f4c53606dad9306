"""Inspection of a layout before any analysis: sizes, joints, overlaps, duplicates."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

import numpy as np

import solver

from .joints.close import Proposal, proposed
from .joints.facing_edges import Facing
from .layout import Layout
from .repair import DEFAULT_OVERLAP, ROUNDING, duplicates, overlaps
from .roles import dropped_twins, roles_of
from .simplify import default_tolerance, simplified

#: Classes of joint thickness in the report.
CLASSES = 8


@dataclass(frozen=True)
class Inspection:
    """Measurements of a layout.

    Attributes
    ----------
    layout : Layout
        As read, duplicates included.
    kept : (n_kept,) int array
        Numbers of the outlines that are no duplicates.
    twins : tuple of (int, int)
        Outlines drawn twice: the first and the later copy.
    overlapping : tuple of (int, int, float)
        Pairs of outlines that overlap and the depth [m], deepest first.
    overlap_tolerance : float [m]
        Deepest overlap that is resolved by default.
    areas : (n_kept,) array [m²]
    low, high : (2,) arrays [m]
        Corners of the box around all blocks.
    joints : Facing
        Stretches where edges face each other across a gap; block numbers count the kept outlines.
    proposal : Proposal
        Joint thickness, and how joints are closed.
    roles : tuple of str
        Role of each outline, as a run takes it from roles, groups and names.
    finer : str
        The note on outlines that are finer than needed, or "".
    """

    layout: Layout
    kept: np.ndarray
    twins: tuple[tuple[int, int], ...]
    overlapping: tuple[tuple[int, int, float], ...]
    overlap_tolerance: float
    areas: np.ndarray
    low: np.ndarray
    high: np.ndarray
    joints: Facing
    proposal: Proposal
    roles: tuple[str, ...]
    finer: str = ""

    @property
    def joint_thickness(self) -> float:
        """Joint thickness that closes the joints [m]; 0 if there are none."""
        return self.proposal.thickness

    @property
    def unit_clash(self) -> str:
        """The note on a unit that cannot be right, or ""."""
        return next((note for note in self.layout.notes if note.startswith("unit clash")), "")

    def __str__(self) -> str:
        """Write the measurements as lines of a table."""
        width, height = self.high - self.low
        lines = [
            f"{self.layout.source}",
            f"outlines        {self.layout.n_blocks}"
            + (f", {len(self.twins)} of them duplicates: {len(self.kept)} blocks" if self.twins else ""),
            f"size            {width:.4g} m × {height:.4g} m, from ({self.low[0]:.6g}, {self.low[1]:.6g}) m",
            f"unit            {self.layout.unit}",
            f"areas           {self.areas.min():.4g} to {self.areas.max():.4g} m², median "
            f"{np.median(self.areas):.4g}, sum {self.areas.sum():.6g} m²",
            f"corners         {sum(len(self.layout.outlines[i]) for i in self.kept)}"
            + (f"; in a run {self.finer}" if self.finer else ""),
        ]
        for title, words in (
            ("groups", self.layout.groups),
            ("materials", self.layout.materials),
            ("roles", self.roles),
        ):
            counted = Counter(words[i] for i in self.kept)
            listed = [f"'{word}' {n}" if word else f"none {n}" for word, n in counted.most_common(12)]
            more = f", {len(counted) - 12} more" if len(counted) > 12 else ""
            lines.append(f"{title:15} {', '.join(listed)}{more}")
        names = [self.layout.names[i] for i in self.kept]
        lines.append(f"{'names':15} {', '.join(names[:4])}{' ...' if len(names) > 4 else ''}")
        lines += [*self._joint_lines(), *self._overlap_lines()]
        if self.twins:
            shown = ", ".join(f"{self.layout.names[b]} = {self.layout.names[a]}" for a, b in self.twins[:8])
            lines.append(f"duplicates      {shown}{' ...' if len(self.twins) > 8 else ''}")
        lines += [f"note            {note}" for note in self.layout.notes]
        return "\n".join(lines)

    def _joint_lines(self) -> list[str]:
        if not len(self.joints):
            return ["mortar joints   none: no gaps between facing edges"]
        widest = self.joints.gaps.max(axis=1) * 1e3
        lengths = self.joints.lengths
        edges = np.linspace(0.0, max(self.joint_thickness * 1e3, widest.max()), CLASSES + 1)
        edges[-1] *= 1.0 + 1e-6
        metres = np.histogram(widest, edges, weights=lengths)[0]
        counts = np.histogram(widest, edges)[0]
        lines = [
            f"mortar joints   {len(widest)} stretches, {lengths.sum():.4g} m, gaps of {widest.min():.3g} to "
            f"{widest.max():.3g} mm, median {np.median(widest):.3g} mm"
        ]
        for k in np.flatnonzero(counts):
            lines.append(f"  {edges[k]:6.1f} to {edges[k + 1]:6.1f} mm  {counts[k]:6d} stretches  {metres[k]:9.3f} m")
        lines.append(f'proposed        joint_thickness = {self.joint_thickness:g}   (m, or "auto")')
        if self.proposal.way == "voronoi":
            lines.append(
                '                closing = "voronoi": faces are not straight, mortar goes to the nearest stone'
            )
        lines += [f"                {self.proposal.note}"] if self.proposal.note else []
        return lines

    def _overlap_lines(self) -> list[str]:
        if not self.overlapping:
            return ["overlaps        none"]
        lines = [f"overlaps        {len(self.overlapping)} pairs, up to {self.overlapping[0][2]:.3g} m deep"]
        for i, j, depth in self.overlapping[:8]:
            verdict = (
                "resolved to the midline"
                if depth <= self.overlap_tolerance
                else "refused: redraw, or raise the tolerance"
            )
            lines.append(f"  {self.layout.names[i]} and {self.layout.names[j]}: {depth:.3g} m, {verdict}")
        return lines


def inspected(layout: Layout) -> Inspection:
    """Measure a layout.

    Parameters
    ----------
    layout : Layout
        As read, duplicates included.

    Returns
    -------
    Inspection
    """
    twins = duplicates(layout.outlines)
    dropped = dropped_twins(layout, twins, {})
    kept = np.array([i for i in range(layout.n_blocks) if i not in dropped])
    assembly = solver.Assembly.from_outlines([layout.outlines[i] for i in kept], names=[layout.names[i] for i in kept])
    width = float(np.median(assembly.widths))
    found = overlaps(assembly, ROUNDING * width)
    outlines = [assembly.outline(i) for i in range(assembly.n_blocks)]
    proposal = proposed(outlines)
    return Inspection(
        layout=layout,
        kept=kept,
        twins=tuple(twins),
        overlapping=tuple((int(kept[i]), int(kept[j]), depth) for i, j, depth in found),
        overlap_tolerance=DEFAULT_OVERLAP * width,
        areas=assembly.areas,
        low=assembly.vertices.min(axis=0),
        high=assembly.vertices.max(axis=0),
        joints=proposal.stretches,
        proposal=proposal,
        roles=tuple(roles_of(layout, {})),
        finer=simplified(outlines, default_tolerance(outlines))[1],
    )
