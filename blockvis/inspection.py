"""What a layout file holds, before anything is computed: as numbers and as a picture."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import solver

from .drawing import Drawing, read_drawing
from .facing import Facing, proposed_thickness
from .repair import CARELESS, ROUNDING, block_widths, duplicates, overlaps

#: Classes of joint thickness in the report.
CLASSES = 8


@dataclass(frozen=True)
class Inspection:
    """What was found in a layout file.

    Attributes
    ----------
    drawing : Drawing
        As read, duplicates included.
    kept : (n_kept,) int array
        Outlines of the drawing without duplicates.
    twins : tuple of (int, int)
        Outlines drawn twice: the first and the later copy.
    overlapping : tuple of (int, int, float)
        Pairs of outlines that overlap and the depth [m], deepest first.
    overlap_tolerance : float [m]
        Deepest overlap that reading resolves by itself.
    areas : (n_kept,) array [m²]
    low, high : (2,) arrays [m]
        Corners of the box around everything.
    joints : Facing
        Stretches where edges face each other across a gap; block numbers count the kept outlines.
    joint_thickness : float [m]
        What closes all of them; 0 where there are none.
    """

    drawing: Drawing
    kept: np.ndarray
    twins: tuple[tuple[int, int], ...]
    overlapping: tuple[tuple[int, int, float], ...]
    overlap_tolerance: float
    areas: np.ndarray
    low: np.ndarray
    high: np.ndarray
    joints: Facing
    joint_thickness: float

    @property
    def unit_clash(self) -> str:
        """The note on a unit that cannot be right, "" where there is none."""
        return next((note for note in self.drawing.notes if note.startswith("unit clash")), "")

    def __str__(self) -> str:
        width, height = self.high - self.low
        lines = [
            f"{self.drawing.source}",
            f"outlines        {self.drawing.n_blocks}"
            + (f", {len(self.twins)} of them duplicates: {len(self.kept)} blocks" if self.twins else ""),
            f"size            {width:.4g} m × {height:.4g} m, from ({self.low[0]:.6g}, {self.low[1]:.6g}) m",
            f"unit            {self.drawing.unit}",
            f"areas           {self.areas.min():.4g} to {self.areas.max():.4g} m², median "
            f"{np.median(self.areas):.4g}, sum {self.areas.sum():.6g} m²",
        ]
        for title, words in (
            ("groups", self.drawing.groups),
            ("materials", self.drawing.materials),
            ("roles", self.drawing.roles),
        ):
            counted = Counter(words[i] for i in self.kept)
            listed = [f"'{word}' {n}" if word else f"none {n}" for word, n in counted.most_common(12)]
            more = f", {len(counted) - 12} more" if len(counted) > 12 else ""
            lines.append(f"{title:15} {', '.join(listed)}{more}")
        names = [self.drawing.names[i] for i in self.kept]
        lines.append(f"{'names':15} {', '.join(names[:4])}{' ...' if len(names) > 4 else ''}")
        lines += [*self._joint_lines(), *self._overlap_lines()]
        if self.twins:
            shown = ", ".join(f"{self.drawing.names[b]} = {self.drawing.names[a]}" for a, b in self.twins[:8])
            lines.append(f"duplicates      {shown}{' ...' if len(self.twins) > 8 else ''}")
        lines += [f"note            {note}" for note in self.drawing.notes]
        return "\n".join(lines)

    def _joint_lines(self) -> list[str]:
        if not len(self.joints):
            return ["mortar joints   none: no gaps between facing edges"]
        widest = self.joints.gaps.max(axis=1) * 1e3
        lengths = self.joints.lengths
        edges = np.linspace(0.0, self.joint_thickness * 1e3, CLASSES + 1)
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
            lines.append(f"  {self.drawing.names[i]} and {self.drawing.names[j]}: {depth:.3g} m, {verdict}")
        return lines


def inspect(path: str | Path, *, unit: str | None = None) -> Inspection:
    """Reads a layout file and measures what it holds.

    Parameters
    ----------
    path : str or Path
    unit : str, optional
        Unit of the file's lengths; holds over what the file says.
    """
    drawing = read_drawing(path, unit=unit)
    twins = duplicates(drawing.outlines)
    later = {copy for _, copy in twins}
    kept = np.array([i for i in range(drawing.n_blocks) if i not in later])
    assembly = solver.Assembly.from_outlines(
        [drawing.outlines[i] for i in kept], names=[drawing.names[i] for i in kept]
    )
    width = float(np.median(block_widths(assembly)))
    found = overlaps(assembly, ROUNDING * width)
    thickness, joints = proposed_thickness([assembly.outline(i) for i in range(assembly.n_blocks)])
    return Inspection(
        drawing=drawing,
        kept=kept,
        twins=tuple(twins),
        overlapping=tuple((int(kept[i]), int(kept[j]), depth) for i, j, depth in found),
        overlap_tolerance=CARELESS * width,
        areas=assembly.areas,
        low=assembly.vertices.min(axis=0),
        high=assembly.vertices.max(axis=0),
        joints=joints,
        joint_thickness=thickness,
    )


def draw_inspection(inspection: Inspection, path: str | Path) -> Path:
    """Draws what was found: outlines, supports, duplicates, overlaps, joints by their thickness.

    Parameters
    ----------
    inspection : Inspection
    path : str or Path
        .png, .svg or .pdf.
    """
    from matplotlib.collections import LineCollection, PolyCollection
    from matplotlib.figure import Figure

    drawing = inspection.drawing
    width, height = np.maximum(inspection.high - inspection.low, 1e-9)
    figure = Figure(figsize=(10.0, float(np.clip(10.0 * height / width, 3.0, 14.0)) + 1.0), layout="constrained")
    axes = figure.add_subplot()
    later = {copy for _, copy in inspection.twins}
    deep = {i for a, b, depth in inspection.overlapping if depth > inspection.overlap_tolerance for i in (a, b)}
    classes = {
        "block": ("#efe6d4", [i for i in inspection.kept if i not in deep and drawing.roles[i] in ("", "free")]),
        "fixed": ("#7a7a7a", [i for i in inspection.kept if drawing.roles[i] == "fixed"]),
        "moving": ("#b0b0b0", [i for i in inspection.kept if drawing.roles[i] == "moving"]),
        "drawn twice": ("#5b8fd6", sorted(later)),
        "overlapping": ("#d6605b", sorted(deep)),
    }
    for label, (colour, members) in classes.items():
        if members:
            rings = [drawing.outlines[i] for i in members]
            axes.add_collection(
                PolyCollection(
                    rings, facecolor=colour, edgecolor="#4a4032", linewidth=0.3, label=f"{label}: {len(members)}"
                )
            )
    if len(inspection.joints):
        gaps = inspection.joints.gaps.max(axis=1) * 1e3
        lines = LineCollection(list(inspection.joints.midline), cmap="viridis_r", linewidth=1.2)
        lines.set_array(gaps)
        axes.add_collection(lines)
        figure.colorbar(lines, ax=axes, shrink=0.6, label="gap between facing edges [mm]")
    axes.set_xlim(inspection.low[0] - 0.02 * width, inspection.high[0] + 0.02 * width)
    axes.set_ylim(inspection.low[1] - 0.02 * height, inspection.high[1] + 0.02 * height)
    axes.set_aspect("equal")
    axes.set_xlabel("x [m]")
    axes.set_ylabel("y [m]")
    axes.set_title(Path(drawing.source).name or "drawing")
    axes.legend(loc="upper left", bbox_to_anchor=(0.0, -0.06), ncols=5, frameon=False)
    figure.savefig(path, dpi=150)
    return Path(path)
