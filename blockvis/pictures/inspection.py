"""A picture of what a layout holds: names, roles, overlaps, joints by their thickness, what was left out."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from blockvis.layout.inspect import Inspection

#: Names are written where they fit into their block at this size [points]; smaller ones cannot be read.
SMALLEST_TEXT, LARGEST_TEXT = 4.0, 9.0

#: Width and smallest and largest height of the drawing on paper [in].
WIDTH, HEIGHTS = 10.0, (3.0, 14.0)

#: Colours of gaps, from narrow to wide: all stand out from the blocks and from white.
GAPS = ("#2166ac", "#1b9e77", "#e6a100", "#d95f02", "#a50026")

#: Colour of what was left out.
LEFT_OUT = "#b05ac8"


def draw_inspection(inspection: Inspection, path: str | Path) -> Path:
    """Draw what was found: outlines with their names and roles, joints by their thickness, what was left out.

    Parameters
    ----------
    inspection : Inspection
    path : str or Path
        .png, .svg or .pdf; of blocks in space .png or .pdf.

    Returns
    -------
    pathlib.Path
    """
    if inspection.layout.dimension == 3:
        from .solid_inspection import draw_solid_inspection

        return draw_solid_inspection(inspection, path)
    from matplotlib.figure import Figure

    layout = inspection.layout
    found = f", joint_thickness {inspection.joint_thickness * 1e3:g} mm found" if len(inspection.joints) else ""
    low, high = _box(inspection)
    width, height = np.maximum(high - low, 1e-9)
    drawn = float(np.clip(WIDTH * height / width, *HEIGHTS))
    figure = Figure(figsize=(WIDTH, drawn + 1.6), layout="constrained")
    axes = figure.add_subplot()
    inches = min(0.85 * WIDTH / width, drawn / height)
    _add_blocks(axes, inspection)
    _add_left_out(axes, inspection)
    _add_names(axes, inspection, inches)
    _add_gaps(figure, axes, inspection)
    axes.set_xlim(low[0] - 0.02 * width, high[0] + 0.02 * width)
    axes.set_ylim(low[1] - 0.02 * height, high[1] + 0.02 * height)
    axes.set_aspect("equal")
    axes.set_xlabel("x [m]")
    axes.set_ylabel("y [m]")
    axes.set_title(
        f"{Path(layout.source).name or 'layout'}: {len(inspection.kept)} blocks, read in {layout.unit}{found}"
    )
    figure.legend(*axes.get_legend_handles_labels(), loc="outside lower center", ncols=4, frameon=False)
    figure.savefig(path, dpi=150)
    return Path(path)


def _box(inspection: Inspection) -> tuple[np.ndarray, np.ndarray]:
    """Corners of the box around the blocks, and around what was left out unless that is far away."""
    low, high = inspection.low, inspection.high
    size = high - low
    for item in inspection.layout.left_out:
        if len(item.points):
            # A stray point far off would shrink the blocks to a dot.
            low = np.minimum(low, np.maximum(item.points.min(axis=0), inspection.low - 0.5 * size))
            high = np.maximum(high, np.minimum(item.points.max(axis=0), inspection.high + 0.5 * size))
    return low, high


def _add_blocks(axes: Any, inspection: Inspection) -> None:
    from matplotlib.collections import PolyCollection

    layout = inspection.layout
    later = sorted({copy for _, copy in inspection.twins})
    deep = {i for a, b, depth in inspection.overlapping if depth > inspection.overlap_tolerance for i in (a, b)}
    of_role = {
        role: [int(i) for i in inspection.kept if i not in deep and inspection.roles[i] == role]
        for role in ("free", "fixed", "moving")
    }
    classes = (
        ("free", "#efe6d4", "", of_role["free"]),
        ("fixed", "#9a9a9a", "////", of_role["fixed"]),
        ("moving", "#f3c08b", "\\\\\\\\", of_role["moving"]),
        ("drawn twice", "#5b8fd6", "", later),
        ("overlapping, refused", "#d6605b", "", sorted(deep)),
    )
    for label, colour, hatch, members in classes:
        if members:
            rings = [layout.outlines[i] for i in members]
            axes.add_collection(
                PolyCollection(
                    rings,
                    facecolor=colour,
                    edgecolor="#4a4032",
                    hatch=hatch,
                    linewidth=0.4,
                    label=f"{label}: {len(members)}",
                )
            )


def _add_left_out(axes: Any, inspection: Inspection) -> None:
    from matplotlib.collections import LineCollection

    items = [item for item in inspection.layout.left_out if len(item.points) > 1]
    if items:
        lines = [np.vstack([item.points, item.points[:1]]) if item.closed else item.points for item in items]
        axes.add_collection(
            LineCollection(
                lines, colors=LEFT_OUT, linewidth=1.0, linestyle=(0, (5, 3)), label=f"left out: {len(items)}", zorder=3
            )
        )


def _add_names(axes: Any, inspection: Inspection, inches: float) -> None:
    """Write the name of each block into it where it can be read; ``inches`` are those of a metre on paper."""
    from matplotlib.patheffects import withStroke

    rim = [withStroke(linewidth=2.0, foreground="#ffffffb0")]
    for i in inspection.kept:
        ring, name = inspection.layout.outlines[i], inspection.layout.names[i]
        width, height = np.ptp(ring, axis=0) * inches * 72.0
        # A letter is some 0.55 of its size wide; upright where the block is tall.
        across, up = (width, height) if width >= height else (height, width)
        size = min(0.85 * across / (0.55 * max(len(name), 1)), 0.6 * up, LARGEST_TEXT)
        if size >= SMALLEST_TEXT:
            x, y = (ring.min(axis=0) + ring.max(axis=0)) / 2.0
            turn = 0.0 if width >= height else 90.0
            axes.text(
                x,
                y,
                name,
                fontsize=size,
                rotation=turn,
                ha="center",
                va="center",
                color="#2b2b2b",
                zorder=4,
                path_effects=rim,
            )


def _add_gaps(figure: Any, axes: Any, inspection: Inspection) -> None:
    """Draw the joints by their widest gap [mm], in classes with round limits."""
    from matplotlib.collections import LineCollection
    from matplotlib.colors import BoundaryNorm, ListedColormap

    if not len(inspection.joints):
        return
    gaps = inspection.joints.gaps.max(axis=1) * 1e3
    limits = _round_limits(float(gaps.min()), float(gaps.max()))
    if len(limits) == 2:
        colours = [GAPS[1]]
    else:
        colours = [GAPS[round(k * (len(GAPS) - 1) / (len(limits) - 2))] for k in range(len(limits) - 1)]
    scale = ListedColormap(colours)
    lines = LineCollection(
        list(inspection.joints.midline), cmap=scale, norm=BoundaryNorm(limits, scale.N), linewidth=1.8, zorder=2
    )
    lines.set_array(np.clip(gaps, limits[0], limits[-1] * (1.0 - 1e-9)))
    axes.add_collection(lines)
    alone = len(limits) == 2
    bar = figure.colorbar(lines, ax=axes, shrink=0.7, pad=0.01, ticks=[sum(limits) / 2.0] if alone else limits)
    bar.ax.set_yticklabels([f"{np.median(gaps):.3g}"] if alone else [f"{limit:g}" for limit in limits])
    bar.ax.tick_params(which="minor", length=0.0)
    bar.set_label("gap between facing edges [mm]")


def _round_limits(low: float, high: float) -> list[float]:
    """Limits of at most five classes between two gaps [mm], at round numbers."""
    if high - low < 0.02 * high:
        # All the same: one class, whose ends round the gap to two digits.
        digit = 10.0 ** (np.floor(np.log10(high)) - 1)
        low, high = np.floor(low / digit * (1 + 1e-9)) * digit, np.ceil(high / digit * (1 - 1e-9)) * digit
        return [float(f"{low:.3g}"), float(f"{high if high > low else low + digit:.3g}")]
    power = 10.0 ** np.floor(np.log10((high - low) / 5.0))
    step = next(power * k for k in (1.0, 2.0, 5.0, 10.0) if power * k * 5.0 >= (high - low) * (1 - 1e-9))
    first = np.floor(low / step * (1 + 1e-9))
    last = max(np.ceil(high / step * (1 - 1e-9)), first + 1)
    return [float(f"{k * step:.6g}") for k in range(int(first), int(last) + 1)]
