"""Observed and computed cracks side by side, for the two most probable causes."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine

import solver
from blockvis.pictures import palette
from blockvis.pictures.frame import framed
from blockvis.results.cracks import SMALLEST_OPENING
from blockvis.results.joints import faces_at
from blockvis.system.atomic_files import atomic_file
from blockvis.text import rounded_length
from solver import mechanics

from .words import amount_text, percent, width_text

if TYPE_CHECKING:
    from .ranking import Cause
    from .result import Explanation

#: The largest displacement is drawn as this fraction of the structure.
SHOWN = 0.07

#: Height of text [points], width of a panel and height of the words above it [inch].
TEXT, PANEL, HEAD = 12.0, 5.4, 0.7

#: Structures wider than this for their height have their panels below each other.
WIDE = 4.0

#: Most widths that are written in a panel.
MOST_LABELS = 24


def draw_explanation(found: Explanation, path: str | os.PathLike[str]) -> Path:
    """Draw what was observed, and what the two most probable causes make.

    Parameters
    ----------
    found : Explanation
    path : path
        Ending in .png, .svg or .pdf.

    Returns
    -------
    pathlib.Path
    """
    assembly, causes = found.assembly, found.causes[:2]
    drawn = solver.Pose.initial(assembly)
    poses = [_pose(assembly, cause) for cause in causes]
    free = assembly.free
    largest = [float(np.hypot(*pose.displacements(assembly)[:, :2].T).max()) for pose in poses]
    extent = float(np.ptp(assembly.vertices[free[assembly.block_of_vertex]], axis=0).max())
    # Each cause by its own: what one makes by going far, another may make by going a little.
    factors = [max(1.0, rounded_length(SHOWN * extent / most)) if most > 0.0 else 1.0 for most in largest]
    shown = [_magnified(assembly, pose, factor) for pose, factor in zip(poses, factors, strict=True)]
    frame = framed(assembly, [drawn, *shown])
    count = 1 + len(causes)
    aspect = float(frame.size[0] / frame.size[1])
    rows, columns = (count, 1) if aspect > WIDE else (1, count)
    width = PANEL * (2.0 if aspect > WIDE else 1.0)
    height = min(width / aspect, 1.4 * PANEL) + HEAD
    figure = Figure(figsize=(width * columns, height * rows), layout=ConstrainedLayoutEngine(h_pad=0.1, w_pad=0.06))
    FigureCanvasAgg(figure)
    axes = np.atleast_1d(figure.subplots(rows, columns, squeeze=False).ravel())
    _observed(axes[0], found)
    for number, (panel, cause, pose, there, factor) in enumerate(
        zip(axes[1:], causes, poses, shown, factors, strict=True), start=1
    ):
        _computed(panel, found, cause, pose, there, number, factor)
    for panel in axes:
        panel.set_xlim(frame.low[0], frame.high[0])
        panel.set_ylim(frame.low[1], frame.high[1])
        panel.set_aspect("equal")
        panel.set_axis_off()
    path = Path(path)
    with atomic_file(path) as partial:
        figure.savefig(partial, dpi=130, facecolor="white")
    return path


def _pose(assembly: solver.Assembly, cause: Cause) -> solver.Pose:
    moved = cause.best.moved(cause.at)
    return solver.Pose(assembly.centroids + moved[:, :2], moved[:, 2:])


def _magnified(assembly: solver.Assembly, pose: solver.Pose, factor: float) -> solver.Pose:
    start = assembly.centroids
    return solver.Pose(start + factor * (pose.positions - start), factor * pose.rotations)


def _blocks(panel: Axes, assembly: solver.Assembly, pose: solver.Pose) -> None:
    corners = mechanics.moved_vertices(assembly, pose)
    outlines = np.split(corners, assembly.offsets[1:-1])
    fill = palette.block_colours(assembly.materials, assembly.free) / 255.0
    colours = [tuple(colour) for colour in fill.tolist()]
    panel.add_collection(
        PolyCollection(
            outlines,
            facecolors=colours,
            edgecolors=_rgb(palette.OUTLINE),
            linewidths=0.6,
            zorder=2,
        )
    )


def _observed(panel: Axes, found: Explanation) -> None:
    given, assembly = found.observations, found.assembly
    pose = solver.Pose.initial(assembly)
    _blocks(panel, assembly, pose)
    joints = found.comparison.joints
    opened = given.widths > 0.0
    lines = joints.ends[found.comparison.own[opened]]
    thick = 1.5 + 4.0 * given.widths[opened] / max(given.largest, 1e-300)
    panel.add_collection(LineCollection(lines, colors=[_rgb(palette.OPEN)], linewidths=thick, zorder=3))
    closed = given.places[~opened]
    panel.plot(*closed.T, "o", ms=4.5, mfc="white", mec=_rgb(palette.FAINT), zorder=4)
    _labels(panel, given.places, given.widths, found, given.places, sizes=given.widths)
    strange = given.places[list(found.unexplained)]
    panel.plot(*strange.T, "o", ms=17, mfc="none", mec=_rgb(palette.WARNING), mew=1.6, zorder=6)
    if len(given.points):
        _arrows(panel, given.points, given.displacements, assembly)
    what = "Observed" + (": open joints [mm], ○ closed" if len(given.widths) else ": displaced points")
    panel.set_title(what, loc="left", fontsize=TEXT + 1, color=_rgb(palette.INK))
    if len(strange):
        panel.annotate(
            "○ unexplained", (0.0, 0.0), xycoords="axes fraction", fontsize=TEXT, color=_rgb(palette.WARNING)
        )


def _computed(
    panel: Axes,
    found: Explanation,
    cause: Cause,
    pose: solver.Pose,
    shown: solver.Pose,
    number: int,
    factor: float,
) -> None:
    assembly, joints, given = found.assembly, found.comparison.joints, found.observations
    _blocks(panel, assembly, shown)
    ends = cause.best.openings(np.array([cause.at]))[0]
    opening = ends.max(axis=1)
    on_a, on_b, _ = faces_at(assembly, joints, shown)
    is_open = opening > SMALLEST_OPENING * assembly.block_size
    filled = np.concatenate([on_a, on_b[:, ::-1]], axis=1)[is_open]
    panel.add_collection(
        PolyCollection(
            list(filled), facecolors=[_rgb(palette.OPEN)], edgecolors=[_rgb(palette.OPEN)], linewidths=0.8, zorder=3
        )
    )
    middles = (on_a + on_b).mean(axis=1) / 2.0
    if len(given.widths):
        pairs = cause.best.pairs[cause.at]
        joint = found.comparison.joint[pairs]
        share = np.nan_to_num(found.comparison.along[pairs], nan=0.5)[:, None]
        faces = (on_a + on_b)[joint] / 2.0
        places = faces[:, 0] * (1.0 - share) + faces[:, 1] * share
        _labels(panel, places, cause.best.widths[cause.at], found, given.places, sizes=given.widths)
    measurement = found.next_measurement
    if measurement is not None:
        x, y = middles[measurement.joint]
        panel.plot(x, y, "D", ms=8, mfc="white", mec=_rgb(palette.FORCE), mew=1.8, zorder=7)
        panel.annotate(
            f"measure here: {width_text(float(opening[measurement.joint]))}",
            (x, y),
            xytext=(7, 7),
            textcoords="offset points",
            fontsize=TEXT - 1,
            color=_rgb(palette.FORCE),
            zorder=8,
        )
    moving = [assembly.index(name) for name in cause.best.candidate.motions]
    moved = pose.displacements(assembly)[moving, :2]
    if np.hypot(*moved.T).max(initial=0.0) > 0.0 and not cause.best.candidate.turns:
        _arrows(panel, _tops(assembly, moving, shown), moved, assembly)
    amount = amount_text(float(cause.best.amounts[cause.at]), cause.unit)
    panel.set_title(
        f"{number}  {cause.name}, {percent(cause.probability)}\n"
        f"best fit: {amount}; widths [mm]; displacements × {factor:g}",
        loc="left",
        fontsize=TEXT + 1,
        color=_rgb(palette.INK),
    )


def _tops(assembly: solver.Assembly, blocks: Sequence[int], pose: solver.Pose) -> np.ndarray:
    """(n, 2) array [m]: a little below the middle of the top of each support, where the picture shows it."""
    corners = mechanics.moved_vertices(assembly, pose)
    places = []
    for block in blocks:
        ring = corners[assembly.offsets[block] : assembly.offsets[block + 1]]
        low, high = ring.min(axis=0), ring.max(axis=0)
        depth = min(0.5 * (high[1] - low[1]), 0.3 * assembly.block_size)
        places.append([pose.positions[block, 0], high[1] - depth])
    return np.array(places)


def _arrows(panel: Axes, tails: np.ndarray, moved: np.ndarray, assembly: solver.Assembly) -> None:
    """Draw displacements as arrows, the longest as long as a block."""
    longest = float(np.hypot(*moved.T).max(initial=0.0)) or 1.0
    for tail, vector in zip(tails, moved / longest * assembly.block_size, strict=True):
        if np.hypot(*vector) > 0.05 * assembly.block_size:
            panel.annotate(
                "",
                tail + vector,
                xytext=tail,
                arrowprops={"arrowstyle": "-|>", "color": _rgb(palette.SETTLEMENT), "lw": 2.0},
                zorder=7,
            )


def _labels(
    panel: Axes,
    places: np.ndarray,
    widths: np.ndarray,
    found: Explanation,
    observed_at: np.ndarray,
    *,
    sizes: np.ndarray,
) -> None:
    """Write widths in mm at the places of open joints, the widest first, and where one opens that was closed."""
    least = 0.05 * found.observations.largest
    order = np.argsort(-np.maximum(sizes, widths), kind="stable")
    written: list[np.ndarray] = []
    apart = 0.35 * found.assembly.block_size
    for k in order.tolist():
        if max(sizes[k], widths[k]) <= least or len(written) == MOST_LABELS:
            continue
        if any(np.hypot(*(places[k] - other)) < apart for other in written):
            continue
        written.append(places[k])
        panel.annotate(
            width_text(float(widths[k])),
            places[k],
            xytext=(0, 9),
            textcoords="offset points",
            ha="center",
            va="center",
            fontsize=TEXT - 1,
            color=_rgb(palette.INK),
            bbox={"boxstyle": "round,pad=0.15", "fc": "white", "ec": _rgb(palette.OPEN), "lw": 0.7},
            zorder=5,
        )


def _rgb(colour: tuple[int, int, int]) -> tuple[float, float, float]:
    return colour[0] / 255.0, colour[1] / 255.0, colour[2] / 255.0
