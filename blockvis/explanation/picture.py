"""Observed and computed cracks side by side, for the two most probable causes."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.text import Annotation
from matplotlib.transforms import BboxBase

import solver
from blockvis.pictures import palette
from blockvis.pictures.drawer import WHOLE, magnified
from blockvis.pictures.figures import plain_text
from blockvis.pictures.frame import Frame, framed
from blockvis.pictures.solid_view import ABOVE, AROUND, View
from blockvis.results.cracks import SMALLEST_OPENING
from blockvis.results.joints import carried_faces
from blockvis.system.atomic_files import atomic_file
from blockvis.text import rounded_length
from solver import mechanics

from .forward import pose_of
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

#: Pixels of matplotlib per inch, and of the blocks in space.
DPI, FINE = 130, 260

#: Views in which the cracks are as near to the eye as in the best, within this part of the structure, are equal.
ALIKE = 0.02

#: A joint has its largest width written, too, where that is so many times the one at an observed place.
GAPES = 1.5

#: Most widths that are written in a panel.
MOST_LABELS = 24


@plain_text
def draw_explanation(found: Explanation, path: str | os.PathLike[str]) -> Path:
    """Draw what was observed, and what the two most probable causes make.

    Parameters
    ----------
    found : Explanation
    path : path
        Ending in .png, .svg or .pdf.
    """
    assembly, causes = found.assembly, found.causes[:2]
    drawn = solver.Pose.initial(assembly)
    poses = [pose_of(assembly, cause.best.moved(cause.at)) for cause in causes]
    free = assembly.free
    largest = [float(np.linalg.norm(pose.positions - assembly.centroids, axis=1).max()) for pose in poses]
    extent = float(np.ptp(assembly.vertices[free[assembly.block_of_vertex]], axis=0).max())
    # Each cause by its own: what one makes by going far, another may make by going a little.
    factors = [max(1.0, rounded_length(SHOWN * extent / most)) if most > 0.0 else 1.0 for most in largest]
    shown = [magnified(assembly, pose, factor) for pose, factor in zip(poses, factors, strict=True)]
    view = None if assembly.dimension == 2 else _view_of(found)
    if view is None:
        frame = framed(assembly, [drawn, *shown], whole=WHOLE)
    else:
        frame = framed(assembly, [drawn, *shown], margin=0.05, supports=0.3, axes=view.axes[:2], whole=WHOLE)
    count = 1 + len(causes)
    aspect = float(frame.size[0] / frame.size[1])
    rows, columns = (count, 1) if aspect > WIDE else (1, count)
    width = PANEL * (2.0 if aspect > WIDE else 1.0)
    height = min(width / aspect, 1.4 * PANEL) + HEAD
    figure = Figure(figsize=(width * columns, height * rows), layout=ConstrainedLayoutEngine(h_pad=0.1, w_pad=0.06))
    FigureCanvasAgg(figure)
    axes = np.atleast_1d(figure.subplots(rows, columns, squeeze=False).ravel())
    canvases = [_Canvas(panel, assembly, frame, view) for panel in axes]
    labels = [_observed(canvases[0], found)]
    for number, (canvas, cause, pose, there, factor) in enumerate(
        zip(canvases[1:], causes, poses, shown, factors, strict=True), start=1
    ):
        labels.append(_computed(canvas, found, cause, pose, there, number, factor))
    for panel in axes:
        panel.set_xlim(frame.low[0], frame.high[0])
        panel.set_ylim(frame.low[1], frame.high[1])
        panel.set_aspect("equal")
        panel.set_axis_off()
    # How wide a text is in the drawing, is known when the panels have their sizes.
    figure.draw_without_rendering()
    for own in labels:
        _uncover(own)
    path = Path(path)
    with atomic_file(path) as partial:
        figure.savefig(partial, dpi=DPI, facecolor="white")
    return path


def _view_of(found: Explanation) -> View:
    """Choose from where the wide cracks, and what has moved far, are in front."""
    given, middle = found.observations, found.assembly.centroids.mean(axis=0)
    places = np.concatenate([given.places, given.points]) - middle
    sizes = np.concatenate([given.widths, np.linalg.norm(given.displacements, axis=1)])
    size = float(np.ptp(found.assembly.vertices, axis=0).max())
    views = [View(around, ABOVE) for around in AROUND]
    near = [float(sizes @ view.depth(places) / (sizes.sum() * size)) for view in views]
    return next(view for view, value in zip(views, near, strict=True) if value >= max(near) - ALIKE)


@dataclass(frozen=True)
class _Canvas:
    """A panel on which blocks are drawn, in the plane or as they are seen in space.

    Attributes
    ----------
    panel : matplotlib.axes.Axes
    assembly : solver.Assembly
    frame : Frame
    view : View, optional
        Of blocks in space.
    """

    panel: Axes
    assembly: solver.Assembly
    frame: Frame
    view: View | None

    def placed(self, points: np.ndarray) -> np.ndarray:
        """(n, 2) array [m]: where points, or arrows, (n, d) [m] are drawn."""
        return points if self.view is None else self.view.projected(points)

    def blocks(self, pose: solver.Pose, lines: Sequence[np.ndarray], thick: Sequence[float], filled: Any) -> None:
        """Draw the blocks, and open joints as lines (n, 2, d) [m] so thick [points], or as polygons (n, 4, d) [m]."""
        colour, fill = (
            palette.hexadecimal(palette.OPEN),
            palette.block_colours(self.assembly.materials, self.assembly.free),
        )
        if self.view is not None:
            self._solid_blocks(pose, lines, thick, filled)
            return
        corners = mechanics.moved_vertices(self.assembly, pose)
        self.panel.add_collection(
            PolyCollection(
                np.split(corners, self.assembly.offsets[1:-1]),
                facecolors=[tuple(one) for one in (fill / 255.0).tolist()],
                edgecolors=palette.hexadecimal(palette.OUTLINE),
                linewidths=0.6,
                zorder=2,
            )
        )
        self.panel.add_collection(LineCollection(lines, colors=[colour], linewidths=thick, zorder=3))
        self.panel.add_collection(
            PolyCollection(list(filled), facecolors=[colour], edgecolors=[colour], linewidths=0.8, zorder=3)
        )

    def compass(self) -> None:
        """Show where the right and the back are, in a corner of the panel."""
        if self.view is None:
            return
        (across, high), corner = self.frame.size, self.frame.low
        arms = 0.07 * across * self.view.projected(np.eye(3)[:2])
        centre = corner + np.array([0.1 * across, 0.0]) + 0.05 * high
        for word, arm in zip(("right", "back"), arms, strict=True):
            arrow = {"arrowstyle": "-|>", "color": palette.hexadecimal(palette.FAINT)}
            self.panel.annotate("", centre + arm, xytext=centre, arrowprops=arrow)
            x, y = centre + 1.35 * arm
            self.panel.text(
                x, y, word, ha="center", va="center", fontsize=TEXT - 3, color=palette.hexadecimal(palette.FAINT)
            )

    def _solid_blocks(
        self, pose: solver.Pose, lines: Sequence[np.ndarray], thick: Sequence[float], filled: Any
    ) -> None:
        assert self.view is not None
        # VTK takes seconds to import, and pictures in the plane need none.
        from blockvis.pictures.solid_scene import SolidScene

        across, high = self.frame.size
        size = (round(PANEL * FINE), round(PANEL * FINE * float(high / across)))
        scene = SolidScene(self.assembly, self.view, self.frame, size, palette.role_colours(self.assembly))
        scene.pose(pose)
        for k, (line, points) in enumerate(zip(lines, thick, strict=True)):
            scene.lines(f"crack {k}", line[None], palette.OPEN, points * FINE / 72.0)
        scene.polygons("crack", filled, palette.OPEN)
        edges = np.asarray(filled).reshape(-1, 4, 3)
        scene.lines("crack edge", edges[:, [[0, 1], [2, 3]]].reshape(-1, 2, 3), palette.OPEN, 0.8 * FINE / 72.0)
        picture, seen = scene.image(), scene.frame
        scene.close()
        extent = (seen.low[0], seen.high[0], seen.low[1], seen.high[1])
        self.panel.imshow(np.asarray(picture), extent=extent, zorder=2)


def _observed(canvas: _Canvas, found: Explanation) -> list[Annotation]:
    """Draw what was observed; gives the labels of widths."""
    given, assembly, panel = found.observations, found.assembly, canvas.panel
    rings, opened = found.comparison.joints.rings, given.widths > 0.0
    lines, thick = [], []
    for joint, width in zip(found.comparison.own[opened], given.widths[opened], strict=True):
        corner = np.arange(*rings.offsets[joint : joint + 2])
        # In the plane both ends of the joint, in space all around it.
        around = [corner] if len(corner) == 2 else np.stack([corner, rings.following[corner]], axis=1)
        lines += [rings.points[both] for both in around]
        thick += [1.5 + 4.0 * width / max(given.largest, 1e-300)] * len(around)
    canvas.blocks(solver.Pose.initial(assembly), lines, thick, [])
    canvas.compass()
    places = canvas.placed(given.places)
    panel.plot(*places[~opened].T, "o", ms=4.5, mfc="white", mec=palette.hexadecimal(palette.FAINT), zorder=4)
    labels = _labels(panel, places, given.widths, found, sizes=given.widths)
    points = canvas.placed(given.points)
    strange = np.concatenate([places[list(found.unexplained)], points[list(found.unexplained_points)]])
    panel.plot(*strange.T, "o", ms=17, mfc="none", mec=palette.hexadecimal(palette.WARNING), mew=1.6, zorder=6)
    if len(given.points):
        _arrows(panel, points, canvas.placed(given.displacements), assembly)
    what = "Observed" + (": open joints [mm], ○ closed" if len(given.widths) else ": displaced points")
    panel.set_title(what, loc="left", fontsize=TEXT + 1, color=palette.hexadecimal(palette.INK))
    if len(strange):
        panel.annotate(
            "○ unexplained",
            (0.0, 0.0),
            xycoords="axes fraction",
            fontsize=TEXT,
            color=palette.hexadecimal(palette.WARNING),
        )
    return labels


def _computed(
    canvas: _Canvas,
    found: Explanation,
    cause: Cause,
    pose: solver.Pose,
    shown: solver.Pose,
    number: int,
    factor: float,
) -> list[Annotation]:
    """Draw what a cause makes; gives the labels, that of the next measurement first."""
    assembly, compared, given, panel = found.assembly, found.comparison, found.observations, canvas.panel
    rings = compared.joints.rings
    openings = cause.best.openings(np.array([cause.at]))
    opening = compared.largest_openings(openings)[0]
    faces = carried_faces(assembly, compared.joints, shown)
    start = np.flatnonzero((opening > SMALLEST_OPENING * assembly.block_size)[rings.ring])
    if assembly.dimension == 2:
        start = start[::2]
    stop = rings.following[start]
    filled = np.stack([faces.on_a[start], faces.on_a[stop], faces.on_b[stop], faces.on_b[start]], axis=1)
    canvas.blocks(shown, [], [], filled)
    between = rings.at((faces.on_a + faces.on_b) / 2.0)
    labels: list[Annotation] = []
    labelled = np.zeros(len(opening))
    if len(given.widths):
        pairs = cause.best.pairs[cause.at]
        corners = between.points[compared.corners[compared.joint[pairs]]]
        places = canvas.placed((corners * compared.weights[pairs][..., None]).sum(axis=1))
        labels = _labels(panel, places, cause.best.widths[cause.at], found, sizes=given.widths)
        np.maximum.at(labelled, compared.joint[pairs], cause.best.widths[cause.at])
    # Where nothing was observed at the end that gapes, the width at the other is not that of the crack.
    wider = np.flatnonzero(opening > GAPES * labelled)
    widest = compared.corners[wider, openings[0, compared.corners[wider]].argmax(axis=1)]
    labels += _labels(panel, canvas.placed(between.points[widest]), opening[wider], found, sizes=opening[wider])
    measurement = found.next_measurement
    if measurement is not None:
        x, y = canvas.placed(between.middles()[[measurement.joint]])[0]
        panel.plot(x, y, "D", ms=8, mfc="white", mec=palette.hexadecimal(palette.FORCE), mew=1.8, zorder=7)
        here = panel.annotate(
            f"measure here: {width_text(float(opening[measurement.joint]))}",
            (x, y),
            xytext=(7, 7),
            textcoords="offset points",
            fontsize=TEXT - 1,
            color=palette.hexadecimal(palette.FORCE),
            bbox={"boxstyle": "round,pad=0.15", "fc": "white", "ec": "none"},
            zorder=8,
        )
        labels.insert(0, here)
    moving = [assembly.index(name) for name in cause.best.candidate.motions]
    moved = canvas.placed((pose.positions - assembly.centroids)[moving])
    if np.hypot(*moved.T).max(initial=0.0) > 0.0 and not cause.best.candidate.turns:
        _arrows(panel, canvas.placed(_tops(assembly, moving, shown)), moved, assembly, canvas.frame)
    amount = amount_text(float(cause.best.amounts[cause.at]), cause.unit)
    panel.set_title(
        f"{number}  {cause.name}, {percent(cause.probability)}\n"
        f"best fit: {amount}; widths [mm]; displacements × {factor:g}",
        loc="left",
        fontsize=TEXT + 1,
        color=palette.hexadecimal(palette.INK),
    )
    return labels


def _tops(assembly: solver.Assembly, blocks: Sequence[int], pose: solver.Pose) -> np.ndarray:
    """(n, d) array [m]: a little below the middle of the top of each support, where the picture shows it."""
    corners = mechanics.moved_vertices(assembly, pose)
    places = []
    for block in blocks:
        height = corners[assembly.block_of_vertex == block, -1]
        depth = min(0.5 * np.ptp(height), 0.3 * assembly.block_size)
        places.append([*pose.positions[block, :-1], height.max() - depth])
    return np.array(places)


def _arrows(
    panel: Axes, tails: np.ndarray, moved: np.ndarray, assembly: solver.Assembly, within: Frame | None = None
) -> None:
    """Draw displacements as arrows, the longest as long as a block; those of supports are shifted into the frame."""
    longest = float(np.hypot(*moved.T).max(initial=0.0)) or 1.0
    for tail, vector in zip(tails, moved / longest * assembly.block_size, strict=True):
        if np.hypot(*vector) > 0.05 * assembly.block_size:
            tip = tail + vector
            if within is not None:
                tip = np.clip(tip, within.low, within.high)
            panel.annotate(
                "",
                tip,
                xytext=tip - vector,
                annotation_clip=False,
                arrowprops={"arrowstyle": "-|>", "color": palette.hexadecimal(palette.SETTLEMENT), "lw": 2.0},
                zorder=7,
            )


def _labels(
    panel: Axes,
    places: np.ndarray,
    widths: np.ndarray,
    found: Explanation,
    *,
    sizes: np.ndarray,
) -> list[Annotation]:
    """Write widths in mm at places (n, 2) of open joints, the widest first, and where one opens that was closed."""
    least = 0.05 * found.observations.largest
    order = np.argsort(-np.maximum(sizes, widths), kind="stable")
    return [
        panel.annotate(
            width_text(float(widths[k])),
            places[k],
            xytext=(0, 9),
            textcoords="offset points",
            ha="center",
            va="center",
            fontsize=TEXT - 1,
            color=palette.hexadecimal(palette.INK),
            bbox={"boxstyle": "round,pad=0.15", "fc": "white", "ec": palette.hexadecimal(palette.OPEN), "lw": 0.7},
            zorder=5,
        )
        # Each is laid out before those that cover others are removed.
        for k in order[: 4 * MOST_LABELS].tolist()
        if max(sizes[k], widths[k]) > least
    ]


def _uncover(labels: Sequence[Annotation]) -> None:
    """Remove each label that covers one written before it, and what is beyond the most."""
    written: list[BboxBase] = []
    for label in labels:
        patch = label.get_bbox_patch()
        assert patch is not None
        box = patch.get_window_extent()
        if len(written) == MOST_LABELS or box.count_overlaps(written):
            label.remove()
        else:
            written.append(box)
