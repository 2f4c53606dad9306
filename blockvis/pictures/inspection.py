"""A picture of what a layout holds: outlines, supports, duplicates, overlaps, joints by their thickness."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from blockvis.layout.inspect import Inspection


def draw_inspection(inspection: Inspection, path: str | Path) -> Path:
    """Draw what was found: outlines, supports, duplicates, overlaps, joints by their thickness.

    Parameters
    ----------
    inspection : Inspection
    path : str or Path
        .png, .svg or .pdf.

    Returns
    -------
    pathlib.Path
    """
    from matplotlib.collections import LineCollection, PolyCollection
    from matplotlib.figure import Figure

    layout = inspection.layout
    width, height = np.maximum(inspection.high - inspection.low, 1e-9)
    figure = Figure(figsize=(10.0, float(np.clip(10.0 * height / width, 3.0, 14.0)) + 1.0), layout="constrained")
    axes = figure.add_subplot()
    later = {copy for _, copy in inspection.twins}
    deep = {i for a, b, depth in inspection.overlapping if depth > inspection.overlap_tolerance for i in (a, b)}
    classes = {
        "block": ("#efe6d4", [i for i in inspection.kept if i not in deep and layout.roles[i] in ("", "free")]),
        "fixed": ("#7a7a7a", [i for i in inspection.kept if layout.roles[i] == "fixed"]),
        "moving": ("#b0b0b0", [i for i in inspection.kept if layout.roles[i] == "moving"]),
        "drawn twice": ("#5b8fd6", sorted(later)),
        "overlapping": ("#d6605b", sorted(deep)),
    }
    for label, (colour, members) in classes.items():
        if members:
            rings = [layout.outlines[i] for i in members]
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
    axes.set_title(Path(layout.source).name or "layout")
    axes.legend(loc="upper left", bbox_to_anchor=(0.0, -0.06), ncols=5, frameon=False)
    figure.savefig(path, dpi=150)
    return Path(path)
