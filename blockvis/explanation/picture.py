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
from blockvis.layout.sights import BELOW, Sight
from blockvis.pictures import palette
from blockvis.pictures.cracks_in_space import PIECES
from blockvis.pictures.drawer import WHOLE, magnified
from blockvis.pictures.figures import plain_text, saved
from blockvis.pictures.frame import Frame, framed
from blockvis.pictures.sight_lines import SightLines
from blockvis.pictures.solid_view import ABOVE, IN_FRONT, View, first_alike, hiding_supports, views_from
from blockvis.results.cracks import SMALLEST_OPENING
from blockvis.results.joint_faces import Rings
from blockvis.results.joints import carried_faces
from blockvis.text import rounded_length
from solver import mechanics

from .forward import pose_of
from .words import amount_text, percent, width_text

if TYPE_CHECKING:
    from .ranking import Cause
    from .result import Explanation

#: Height of text [points] and width of a panel [inch].
TEXT, PANEL = 12.0, 5.4

#: Colours as matplotlib takes them.
INK, FAINT, OPEN, OUTLINE, FORCE, WARNING, SETTLEMENT = (
    palette.hexadecimal(getattr(palette, name))
    for name in ("INK", "FAINT", "OPEN", "OUTLINE", "FORCE", "WARNING", "SETTLEMENT")
)

#: Structures wider than this for their height have their panels below each other.
WIDE = 4.0

#: Pixels of matplotlib per inch, and of the blocks in space.
DPI = 130
FINE = 2 * DPI

#: What it costs to look from below, beside having the cracks, and what has moved far, in front by the size of the
#: structure, and seeing all of them.
FROM_BELOW = 0.3

#: A joint has its largest width written, too, where that is so many times the one at an observed place.
GAPES = 1.5

#: Frames of widths whose joints are hidden: dashed; their labels are known by this word.
DASHED, HIDDEN = (0, (2.0, 1.5)), "hidden"

#: Most widths that are written in a panel.
MOST_LABELS = 24


@plain_text
def draw_explanation(found: Explanation, path: str | os.PathLike[str]) -> Path:
    """Draw what was observed, and what the two most probable causes make, as .png, .svg or .pdf."""
    assembly, causes = found.assembly, found.causes[:2]
    drawn = solver.Pose.initial(assembly)
    poses = [pose_of(assembly, cause.best.moved(cause.at)) for cause in causes]
    # Each cause by its own: what one makes by going far, another may make by going a little.
    factors = [_magnification(assembly, pose) for pose in poses]
    shown = [magnified(assembly, pose, factor) for pose, factor in zip(poses, factors, strict=True)]
    view = None if assembly.dimension == 2 else _view_of(found)
    if view is None:
        frame = framed(assembly, [drawn, *shown], whole=WHOLE)
    else:
        frame = framed(assembly, [drawn, *shown], margin=0.05, supports=0.3, axes=view.axes[:2], whole=WHOLE)
    figure, axes = _panels(1 + len(causes), float(frame.size[0] / frame.size[1]))
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
    written = [label for own in labels for label in _uncover(own)]
    if any(label.get_gid() == HIDDEN for label in written):
        _title(axes[0], f"{axes[0].get_title(loc='left')}, dashed: hidden")
    return saved(figure, path, DPI, facecolor="white")


def _magnification(assembly: solver.Assembly, pose: solver.Pose) -> float:
    """Find a round factor with which the largest displacement is seen."""
    most = float(np.linalg.norm(pose.positions - assembly.centroids, axis=1).max())
    extent = float(np.ptp(assembly.vertices[assembly.free[assembly.block_of_vertex]], axis=0).max())
    return max(1.0, rounded_length(0.07 * extent / most)) if most > 0.0 else 1.0


def _panels(count: int, aspect: float) -> tuple[Figure, np.ndarray]:
    """Make a figure with panels beside each other, or below each other where what they show is wide for its height."""
    rows, columns = (count, 1) if aspect > WIDE else (1, count)
    width = PANEL * (2.0 if aspect > WIDE else 1.0)
    # With room for the words above.
    height = min(width / aspect, 1.4 * PANEL) + 0.7
    figure = Figure(figsize=(width * columns, height * rows), layout=ConstrainedLayoutEngine(h_pad=0.1, w_pad=0.06))
    FigureCanvasAgg(figure)
    return figure, figure.subplots(rows, columns, squeeze=False).ravel()


def _view_of(found: Explanation) -> View:
    """Choose from where the wide cracks, and what has moved far, are seen and in front; as the case asks for."""
    given, assembly, joints = found.observations, found.assembly, found.comparison.joints
    sight = found.case.sight or Sight(both=True)
    views = views_from(sight, ABOVE) + (views_from(sight, BELOW) if sight.both else [])
    if len(views) == 1:
        return views[0]
    lines = SightLines(assembly, solver.Pose.initial(assembly), np.ones(assembly.n_blocks))
    # Of many cracks the widest are looked for.
    pieces = _pieces(joints.rings)
    counts = PIECES * np.diff(joints.rings.offsets)
    chosen = np.argsort(-given.widths, kind="stable")[: np.count_nonzero(given.widths)]
    chosen = chosen[np.cumsum(counts[found.comparison.own[chosen]]) - counts.max(initial=0) < lines.most]
    own = found.comparison.own[chosen]
    around = [pieces[first:stop].reshape(-1, 3) for first, stop in joints.rings.offsets[own[:, None] + [0, 1]].tolist()]
    points = np.concatenate([given.points, *around])
    across = np.concatenate([np.zeros_like(given.points), np.repeat(joints.normals[own], counts[own], axis=0)])
    sizes = np.concatenate([np.linalg.norm(given.displacements, axis=1), given.widths[chosen]])
    owner = np.repeat(np.arange(len(sizes)), np.concatenate([np.ones(len(given.points), dtype=int), counts[own]]))
    places = np.concatenate([given.points, given.places[chosen]]) - assembly.centroids.mean(axis=0)
    size = float(np.ptp(assembly.vertices, axis=0).max())
    if not sizes.any():
        return views[0]

    def worth(view: View) -> float:
        seen = lines.sees(points, across, view.axes, hiding_supports(assembly, view))
        shares = np.bincount(owner, weights=seen, minlength=len(sizes)) / np.bincount(owner, minlength=len(sizes))
        front = IN_FRONT * view.depth(places) / size
        # Of what stands on something half is seen from everywhere.
        worths = np.minimum(2.0 * shares, 1.0) + front
        return float(sizes @ worths) / float(sizes.sum()) - (FROM_BELOW if view.above < 0.0 else 0.0)

    return first_alike(views, worth)


def _pieces(rings: Rings) -> np.ndarray:
    """(n_points, PIECES, 3) array [m]: places along the edge that begins at each corner of polygons in space."""
    at = (np.arange(PIECES) + 0.5)[:, None] / PIECES
    start, end = rings.points[:, None], rings.points[rings.following][:, None]
    return np.asarray(start + at * (end - start))


@dataclass(frozen=True)
class _Canvas:
    """A panel on which blocks are drawn, in the plane or as they are seen in space."""

    panel: Axes
    assembly: solver.Assembly
    frame: Frame
    view: View | None  #: Of blocks in space.

    def placed(self, points: np.ndarray) -> np.ndarray:
        """(n, 2) array [m]: where points, or arrows, (n, d) [m] are drawn."""
        return points if self.view is None else self.view.projected(points)

    def blocks(
        self, pose: solver.Pose, lines: Sequence[np.ndarray], thick: Sequence[float], filled: Any, joints: Rings
    ) -> _Sights:
        """Draw the blocks, and open joints as lines (n, 2, d) [m] so thick [points], or as polygons (n, 4, d) [m].

        Returns what is seen of the edges of joints.
        """
        if self.view is not None:
            return self._solid_blocks(self.view, pose, lines, thick, filled, joints)
        fill = palette.block_colours(self.assembly.materials, self.assembly.free)
        corners = mechanics.moved_vertices(self.assembly, pose)
        self.panel.add_collection(
            PolyCollection(
                np.split(corners, self.assembly.offsets[1:-1]),
                facecolors=[tuple(one) for one in (fill / 255.0).tolist()],
                edgecolors=OUTLINE,
                linewidths=0.6,
                zorder=2,
            )
        )
        self.panel.add_collection(LineCollection(lines, colors=[OPEN], linewidths=thick, zorder=3))
        self.panel.add_collection(
            PolyCollection(list(filled), facecolors=[OPEN], edgecolors=[OPEN], linewidths=0.8, zorder=3)
        )
        return _Sights(self, joints)

    def compass(self) -> None:
        """Show where the right and the back are, in a corner of the panel."""
        if self.view is None:
            return
        (across, high), corner = self.frame.size, self.frame.low
        arms = 0.07 * across * self.view.projected(np.eye(3)[:2])
        # From below the back is downwards.
        centre = corner + np.array([0.1 * across, 1.35 * max(0.0, -arms[:, 1].min())]) + 0.05 * high
        for word, arm in zip(("right", "back"), arms, strict=True):
            if np.hypot(*arm) < 0.1 * np.hypot(*arms.T).max():
                # Straight to the eye or away from it.
                continue
            arrow = {"arrowstyle": "-|>", "color": FAINT}
            self.panel.annotate("", centre + arm, xytext=centre, arrowprops=arrow)
            x, y = centre + 1.35 * arm
            self.panel.text(x, y, word, ha="center", va="center", fontsize=TEXT - 3, color=FAINT)

    def _solid_blocks(
        self,
        view: View,
        pose: solver.Pose,
        lines: Sequence[np.ndarray],
        thick: Sequence[float],
        filled: Any,
        joints: Rings,
    ) -> _Sights:
        # VTK takes seconds to import, and pictures in the plane need none.
        from blockvis.pictures.solid_scene import SolidScene

        across, high = self.frame.size
        size = (round(PANEL * FINE), round(PANEL * FINE * float(high / across)))
        outlined, colours = hiding_supports(self.assembly, view), palette.role_colours(self.assembly)
        scene = SolidScene(self.assembly, view, self.frame, size, colours, outlined=outlined)
        scene.pose(pose)
        for k, (line, points) in enumerate(zip(lines, thick, strict=True)):
            scene.lines(f"crack {k}", line[None], palette.OPEN, points * FINE / 72.0)
        scene.polygons("crack", filled, palette.OPEN)
        edges = np.asarray(filled).reshape(-1, 4, 3)
        scene.lines("crack edge", edges[:, [[0, 1], [2, 3]]].reshape(-1, 2, 3), palette.OPEN, 0.8 * FINE / 72.0)
        picture, shown, pieces = scene.image(), scene.frame, _pieces(joints)
        seen = ~scene.hides(pieces.reshape(-1, 3), FINE / 72.0).reshape(pieces.shape[:2])
        scene.close()
        extent = (shown.low[0], shown.high[0], shown.low[1], shown.high[1])
        self.panel.imshow(np.asarray(picture), extent=extent, zorder=2)
        return _Sights(self, joints, pieces, seen)


@dataclass(frozen=True)
class _Sights:
    """What a panel shows of the edges of joints: all of them in the plane."""

    canvas: _Canvas
    rings: Rings
    pieces: np.ndarray | None = None  #: (n_points, PIECES, 3) array [m]: places along the edges, of joints in space.
    seen: np.ndarray | None = None  #: (n_points, PIECES) bool array: those that nothing hides.

    def of(self, places: np.ndarray, joints: np.ndarray) -> tuple[list[np.ndarray], np.ndarray]:
        """Find what is seen of joints (n,) int, and whether anything is, (n,) bool.

        The nearest to places (n, d) [m] on them come first. They are (m, 2) of the panel, on edges of each joint; the
        one given where nothing of it is seen.
        """
        found, seen = list(np.array(places)[:, None]), np.ones(len(places), dtype=bool)
        if self.pieces is not None and self.seen is not None:
            for k, joint in enumerate(joints.tolist()):
                here = slice(*self.rings.offsets[joint : joint + 2])
                edges = self.pieces[here][self.seen[here]]
                seen[k] = len(edges) > 0
                if len(edges):
                    found[k] = edges[np.linalg.norm(edges - places[k], axis=1).argsort(kind="stable")]
        return [self.canvas.placed(each) for each in found], seen


def _observed(canvas: _Canvas, found: Explanation) -> list[_Label]:
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
    sights = canvas.blocks(solver.Pose.initial(assembly), lines, thick, [], rings)
    canvas.compass()
    spots, seen = sights.of(given.places, found.comparison.own)
    places, closed = np.array([each[0] for each in spots]).reshape(-1, 2), ~opened & seen
    panel.plot(*places[closed].T, "o", ms=4.5, mfc="white", mec=FAINT, zorder=4)
    labels = _labels(panel, spots, given.widths, found, seen, sizes=given.widths)
    points = canvas.placed(given.points)
    strange = np.concatenate([places[list(found.unexplained)], points[list(found.unexplained_points)]])
    panel.plot(*strange.T, "o", ms=17, mfc="none", mec=WARNING, mew=1.6, zorder=6)
    if len(given.points):
        _arrows(panel, points, canvas.placed(given.displacements), assembly)
    what = "Observed" + (": open joints [mm], ○ closed" if len(given.widths) else ": displaced points")
    _title(panel, what)
    if len(strange):
        panel.annotate("○ unexplained", (0.0, 0.0), xycoords="axes fraction", fontsize=TEXT, color=WARNING)
    return labels


def _computed(
    canvas: _Canvas, found: Explanation, cause: Cause, pose: solver.Pose, shown: solver.Pose, number: int, factor: float
) -> list[_Label]:
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
    between = rings.at((faces.on_a + faces.on_b) / 2.0)
    sights = canvas.blocks(shown, [], [], filled, between)
    labels: list[_Label] = []
    labelled = np.zeros(len(opening))
    if len(given.widths):
        pairs = cause.best.pairs[cause.at]
        corners = between.points[compared.corners[compared.joint[pairs]]]
        spots, seen = sights.of((corners * compared.weights[pairs][..., None]).sum(axis=1), compared.joint[pairs])
        labels = _labels(panel, spots, cause.best.widths[cause.at], found, seen, sizes=given.widths)
        np.maximum.at(labelled, compared.joint[pairs], cause.best.widths[cause.at])
    # Where nothing was observed at the end that gapes, the width at the other is not that of the crack.
    wider = np.flatnonzero(opening > GAPES * labelled)
    widest = compared.corners[wider, openings[0, compared.corners[wider]].argmax(axis=1)]
    spots, seen = sights.of(between.points[widest], wider)
    labels += _labels(panel, spots, opening[wider], found, seen, sizes=opening[wider])
    measurement = found.next_measurement
    if measurement is not None:
        spots, _ = sights.of(between.middles()[[measurement.joint]], np.array([measurement.joint]))
        x, y = spots[0][0]
        panel.plot(x, y, "D", ms=8, mfc="white", mec=FORCE, mew=1.8, zorder=7)
        words = f"measure here: {width_text(float(opening[measurement.joint]))}"
        here = _boxed(panel, words, spots[0][0], (7, 7), FORCE, {"ec": "none"}, zorder=8)
        labels.insert(0, _Label(here, np.array([[x, y]])))
    moving = [assembly.index(name) for name in cause.best.candidate.motions]
    moved = canvas.placed((pose.positions - assembly.centroids)[moving])
    if np.hypot(*moved.T).max(initial=0.0) > 0.0 and not cause.best.candidate.turns:
        _arrows(panel, canvas.placed(_tops(assembly, moving, shown)), moved, assembly, canvas.frame)
    amount = amount_text(float(cause.best.amounts[cause.at]), cause.unit)
    _title(
        panel,
        f"{number}  {cause.name}, {percent(cause.probability)}\n"
        f"best fit: {amount}; widths [mm]; displacements × {factor:g}",
    )
    return labels


def _title(panel: Axes, words: str) -> None:
    panel.set_title(words, loc="left", fontsize=TEXT + 1, color=INK)


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
            arrow = {"arrowstyle": "-|>", "color": SETTLEMENT, "lw": 2.0}
            panel.annotate("", tip, xytext=tip - vector, annotation_clip=False, arrowprops=arrow, zorder=7)


@dataclass(frozen=True)
class _Label:
    """A width that is written, and (n, 2) array [m]: the places of the panel where it may be, the best first."""

    written: Annotation
    places: np.ndarray


def _labels(
    panel: Axes,
    places: Sequence[np.ndarray],
    widths: np.ndarray,
    found: Explanation,
    seen: np.ndarray,
    *,
    sizes: np.ndarray,
) -> list[_Label]:
    """Write widths in mm at places (m, 2) of each open joint, the widest first, and where one opens that was closed.

    The frames of those that are not seen, (n,) bool, are dashed.
    """
    least = 0.05 * found.observations.largest
    order = np.argsort(-np.maximum(sizes, widths), kind="stable")
    style = {"ha": "center", "va": "center", "zorder": 5}
    labels = []
    # Each is laid out before those that cover others are removed.
    for k in order[: 4 * MOST_LABELS].tolist():
        if max(sizes[k], widths[k]) > least:
            rim = {"ec": OPEN, "lw": 0.7, "ls": "-"} if seen[k] else {"ec": OPEN, "lw": 1.1, "ls": DASHED}
            words, gid = width_text(float(widths[k])), "" if seen[k] else HIDDEN
            labels.append(_Label(_boxed(panel, words, places[k][0], (0, 9), INK, rim, gid=gid, **style), places[k]))
    return labels


def _boxed(
    panel: Axes, words: str, place: Any, offset: tuple[int, int], colour: str, rim: dict[str, Any], **style: Any
) -> Annotation:
    """Write words in a white box so many points beside a place."""
    box = {"boxstyle": "round,pad=0.15", "fc": "white", **rim}
    return panel.annotate(
        words, place, offset, textcoords="offset points", fontsize=TEXT - 1, color=colour, bbox=box, **style
    )


def _uncover(labels: Sequence[_Label]) -> list[Annotation]:
    """Move each label that covers one written before it, or else remove it, and what is beyond the most.

    Gives those that are left.
    """
    drawn: list[BboxBase] = []
    left = []
    for label in labels:
        patch, panel = label.written.get_bbox_patch(), label.written.axes
        assert patch is not None
        assert panel is not None
        box, on_page = patch.get_window_extent(), panel.transData.transform(label.places)
        boxes = (box.translated(*shift) for shift in on_page - on_page[0])
        free = ((k, one) for k, one in enumerate(boxes) if not one.count_overlaps(drawn))
        k, box = next(free, (-1, box))
        if k < 0 or len(drawn) == MOST_LABELS:
            label.written.remove()
        else:
            label.written.xy = tuple(label.places[k])
            drawn.append(box)
            left.append(label.written)
    return left
