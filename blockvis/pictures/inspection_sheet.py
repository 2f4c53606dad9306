"""The sheet of an inspection: blocks in the plane or in space, their names and marks, legend, title and findings."""

from __future__ import annotations

import textwrap
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.patheffects import withStroke
from matplotlib.ticker import MaxNLocator

import solver
from blockvis.layout.joints.facing_edges import Facing
from blockvis.text import bar_text, rounded_length
from solver import mechanics

from . import palette
from .figures import plain_text, saved
from .frame import Frame, place_in, room_in

if TYPE_CHECKING:
    from blockvis.layout.layout import Layout

#: Names are written where they fit into their block at this size [points]; smaller ones cannot be read.
SMALLEST_TEXT, LARGEST_TEXT = 6.0, 9.0

#: Width and smallest and largest height of the drawing on paper [in].
WIDTH, HEIGHTS = 10.0, (1.6, 14.0)

#: Most lines above the drawing.
MOST_LINES = 6

#: Pixels of the width of blocks in space: more than on paper, which smooths their edges.
PIXELS = 2000

#: Colours of gaps, from narrow to wide: all stand out from the blocks and from white.
GAPS = ("#2166ac", "#1b9e77", "#e6a100", "#d95f02", "#a50026")

#: Colour of edges of blocks.
EDGE = "#4a4032"


@dataclass(frozen=True)
class Kind:
    """Blocks that are drawn alike; in the plane with a hatch of matplotlib."""

    label: str
    colour: tuple[int, int, int]
    blocks: tuple[int, ...]
    hatch: str = ""


@dataclass(frozen=True)
class Contents:
    """What a picture of a drawing shows."""

    layout: Layout  #: All that is drawn.
    title: str
    findings: tuple[str, ...]  #: Lines below it.
    kinds: tuple[Kind, ...]
    named: tuple[int, ...] = ()  #: Blocks whose names are written into them where there is room.
    marked: tuple[int, ...] = ()  #: Blocks that are named beside them.
    #: (n, d) array [m]: places to look at, and what they are.
    rings: np.ndarray = field(default_factory=lambda: np.zeros((0, 2)))
    rings_are: str = ""
    ends: np.ndarray = field(default_factory=lambda: np.zeros((0, 2)))  #: (n, 2) array [m]: ends of open lines.
    #: (n, 2, 3) array [m]: edges of open surfaces.
    edges: np.ndarray = field(default_factory=lambda: np.zeros((0, 2, 3)))
    joints: Facing = field(default_factory=Facing.none)  #: Of blocks in the plane.
    unit: str = "m"  #: Of the coordinates.

    @property
    def drawn(self) -> list[int]:
        """Numbers of the blocks that are drawn."""
        return [k for kind in self.kinds for k in kind.blocks]


@dataclass(frozen=True)
class _Canvas:
    """Axes with the blocks drawn, and how places get there.

    The rows of ``axis`` (2, d) are to the right and up; a metre is so many inches on paper. Each name may stand at a
    place (2,), as wide and high as (2,) [m].
    """

    axes: Any
    axis: np.ndarray
    names: dict[int, np.ndarray]
    inches: float

    def at(self, points: np.ndarray) -> np.ndarray:
        """(..., 2) array [m]: places on paper of points (..., d) [m]."""
        return np.asarray(points @ self.axis.T)


@plain_text
def draw_contents(contents: Contents, path: str | Path) -> Path:
    """Draw what a drawing holds on a sheet with title, findings and legend, as .png, .svg or .pdf."""
    lines = [line.strip(" ·") for text in contents.findings for line in textwrap.wrap(text, 118)]
    if len(lines) > MOST_LINES:
        lines = [*lines[: MOST_LINES - 1], f"{lines[MOST_LINES - 1]} ..."]
    figure = Figure(layout="constrained")
    canvas = (_in_space if contents.layout.dimension == 3 else _in_the_plane)(figure, contents)
    keys = [*_keys(contents), *_add_marks(canvas, contents)]
    missing = _add_names(canvas, contents)
    if missing:
        lines.append(f"names not written: {missing}, hidden or wider than their blocks")
    if contents.layout.dimension == 2:
        keys += _add_left_out(canvas, contents)
        _add_gaps(figure, canvas.axes, contents.joints)
    figure.set_figheight(figure.get_figheight() + 0.5 + 0.19 * (len(lines) + (len(keys) + 3) // 4))
    figure.suptitle("\n".join([contents.title, *lines]), x=0.01, ha="left", fontsize=9.5)
    figure.legend(handles=keys, loc="outside lower center", ncols=4, frameon=False, fontsize=8.5)
    return saved(figure, path, 150)


def _in_the_plane(figure: Any, contents: Contents) -> _Canvas:
    """Draw the blocks as outlines, over axes with their coordinates."""
    layout = contents.layout
    low, high = _box(contents)
    width, height = np.maximum(high - low, 1e-9)
    # Scale and words beside the axes take the rest.
    across = (0.85 if len(contents.joints) else 0.93) * WIDTH
    drawn = float(np.clip(across * height / width, *HEIGHTS))
    figure.set_size_inches(WIDTH, drawn + 0.7)
    axes = figure.add_subplot()
    for kind in contents.kinds:
        rings = [layout.outlines[k] for k in kind.blocks]
        colour = palette.hexadecimal(kind.colour)
        axes.add_collection(
            PolyCollection(rings, facecolor=colour, edgecolor=EDGE, hatch=kind.hatch or None, linewidth=0.4)
        )
    axes.set_xlim(low[0] - 0.02 * width, high[0] + 0.02 * width)
    axes.set_ylim(low[1] - 0.02 * height, high[1] + 0.02 * height)
    axes.set_aspect("equal")
    axes.set_xlabel(f"x [{contents.unit}]")
    axes.set_ylabel(f"y [{contents.unit}]")
    names = {}
    for k in contents.drawn:
        ring = layout.outlines[k]
        names[k] = np.array([_inside(ring), room_in(ring)])
    return _Canvas(axes, np.eye(2), names, min(across / width, drawn / height))


def _in_space(figure: Any, contents: Contents) -> _Canvas:
    """Draw the blocks as a scene sees them, with a bar to scale."""
    from .solid_scene import SolidScene, seen_faces
    from .solid_view import ABOVE, AROUND, View

    layout, view = contents.layout, View(AROUND[0], ABOVE)
    colour_of = {k: kind.colour for kind in contents.kinds for k in kind.blocks}
    drawn = sorted(k for k in colour_of if np.isfinite(layout.corners(k)).all())
    assembly = _unchecked(layout.chosen(drawn))
    fill = np.array([colour_of[k] for k in drawn], dtype=np.uint8)
    flat = view.projected(assembly.vertices)
    margin = 0.04 * float(np.ptp(flat, axis=0).max())
    frame = Frame(flat.min(axis=0) - margin, flat.max(axis=0) + margin)
    proportion = float(np.clip(frame.size[1] / frame.size[0], HEIGHTS[0] / WIDTH, HEIGHTS[1] / WIDTH))
    scene = SolidScene(assembly, view, frame, (PIXELS, round(PIXELS * proportion)), fill)
    picture = scene.image()
    places, room = seen_faces(scene)
    (left, bottom), (right, top) = scene.frame.low, scene.frame.high
    scene.close()
    figure.set_size_inches(WIDTH, WIDTH * proportion + 0.2)
    axes = figure.add_subplot()
    axes.imshow(picture, extent=(left, right, bottom, top), interpolation="antialiased")
    axes.set_axis_off()
    length = rounded_length(0.2 * (right - left))
    scale = bar_text(length) if contents.unit == "m" else f"{length:g} [{contents.unit}]"
    x, y = left + 0.02 * (right - left), bottom + 0.02 * (top - bottom)
    axes.plot([x, x + length], [y, y], color=palette.hexadecimal(palette.INK), linewidth=2.5, solid_capstyle="butt")
    axes.text(x + length / 2.0, y, f"{scale}\n", ha="center", va="bottom", fontsize=8, linespacing=0.4)
    # At the bar, where x, y and z go: which way is outwards no other line of the picture says.
    foot, reach = np.array([x + 1.5 * length, y]), 0.04 * (right - left)
    foot += reach * np.maximum(-view.axes[:2], 0.0).max(axis=1)
    for name, along in zip("xyz", view.axes[:2].T, strict=True):
        axes.annotate("", foot + reach * along, foot, arrowprops={"arrowstyle": "-|>", "color": "black", "lw": 1.0})
        axes.text(*(foot + 1.3 * reach * along), name, ha="center", va="center", fontsize=8)
    names = {k: np.array([places[n] @ view.axes[:2].T, room[n]]) for n, k in enumerate(drawn) if room[n].all()}
    return _Canvas(axes, view.axes[:2], names, WIDTH / (right - left))


def _unchecked(layout: Layout) -> solver.Assembly:
    """Make an assembly of blocks in space to be drawn: what is no block by its shape is none the less drawn."""
    return solver.Assembly(
        shapes=mechanics.Polyhedra.of_surfaces([(points, list(faces)) for points, faces in layout.solids]),
        names=layout.names,
        drawn_names=layout.names,
        roles=np.array([role or mechanics.FREE for role in layout.roles]),
        density=np.ones(layout.n_blocks),
        materials=layout.materials,
    )


def _box(contents: Contents) -> tuple[np.ndarray, np.ndarray]:
    """Corners of the box around the blocks, and around what was left out unless that is far away."""
    layout = contents.layout
    beside = [item.points for item in layout.left_out if len(item.points)]
    corners = [layout.outlines[k] for k in contents.drawn] or beside
    every = np.concatenate(corners)
    every = every[np.isfinite(every).all(axis=1)]
    first_low, first_high = every.min(axis=0), every.max(axis=0)
    size, low, high = first_high - first_low, first_low, first_high
    for item in layout.left_out:
        if len(item.points):
            # A stray point far off would shrink the blocks to a dot; a wall is larger than its openings.
            room = (2.0 if item.kind == "background" else 0.5) * size
            low = np.minimum(low, np.maximum(item.points.min(axis=0), first_low - room))
            high = np.maximum(high, np.minimum(item.points.max(axis=0), first_high + room))
    return low, high


def _keys(contents: Contents) -> list[Any]:
    """Return the entries of the legend for the blocks."""
    hatched = contents.layout.dimension == 2
    return [
        Patch(
            facecolor=palette.hexadecimal(kind.colour),
            edgecolor=EDGE,
            linewidth=0.4,
            hatch=(hatched and kind.hatch) or None,
            label=f"{kind.label}: {len(kind.blocks)}",
        )
        for kind in contents.kinds
    ]


def _add_marks(canvas: _Canvas, contents: Contents) -> list[Any]:
    """Ring places, mark open ends and edges, name blocks at fault beside them; returns entries of the legend."""
    axes, warning, keys = canvas.axes, palette.hexadecimal(palette.WARNING), []
    if len(contents.edges):
        told = f"edges that are not of two faces: {len(contents.edges)}"
        lines = LineCollection(list(canvas.at(contents.edges)), colors=warning, linewidth=2.2, zorder=5, label=told)
        axes.add_collection(lines)
        keys.append(lines)
    if len(contents.ends):
        style = {"facecolors": warning, "edgecolors": "white", "linewidths": 0.6, "zorder": 5}
        dots = axes.scatter(*contents.ends.T, s=16.0, label=f"open ends: {len(contents.ends)}", **style)
        keys.append(dots)
    if len(contents.rings):
        style = {"facecolors": "none", "edgecolors": warning, "linewidths": 1.8, "zorder": 6}
        keys.append(axes.scatter(*canvas.at(contents.rings).T, s=170.0, label=contents.rings_are, **style))
    for k in contents.marked:
        place = canvas.at(_middle(contents.layout.corners(k)))
        if np.isfinite(place).all():
            axes.annotate(
                contents.layout.names[k],
                place,
                (14.0, 14.0),
                textcoords="offset points",
                fontsize=8,
                zorder=7,
                arrowprops={"arrowstyle": "-", "color": warning, "linewidth": 1.2},
                bbox={"boxstyle": "round,pad=0.25", "facecolor": "white", "edgecolor": warning},
            )
    return keys


def _inside(ring: np.ndarray) -> np.ndarray:
    """(2,) array [m]: the centroid of an outline, or another place in it where that lies outside."""
    shape = shapely.Polygon(ring)
    if not shape.is_valid or not shape.area:
        return _middle(ring)
    return place_in(shape)


def _middle(corners: np.ndarray) -> np.ndarray:
    return np.asarray((corners.min(axis=0) + corners.max(axis=0)) / 2.0)


def _add_left_out(canvas: _Canvas, contents: Contents) -> list[Any]:
    """Draw outlines and lines that were left out, and those that cannot be; of a drawing without blocks all lines."""
    alone, dashes = not contents.kinds, (0, (5, 3))
    keys = []
    for serious, label, colour, style in (
        (False, "lines as drawn" if alone else "left out", palette.INK if alone else palette.LEFT_OUT, dashes),
        (True, "no block", palette.WARNING, "solid"),
    ):
        items = [item for item in contents.layout.left_out if item.serious == serious and len(item.points) > 1]
        if items:
            lines = LineCollection(
                [
                    np.vstack([points, points[:1]]) if item.closed else points
                    for item in items
                    for points in (item.points, *item.holes)
                ],
                colors=palette.hexadecimal(colour),
                linewidth=1.0 + 0.8 * serious,
                linestyle="solid" if alone else style,
                label=f"{label}: {len(items)}",
                zorder=3,
            )
            canvas.axes.add_collection(lines)
            keys.append(lines)
    return keys


def _add_names(canvas: _Canvas, contents: Contents) -> int:
    """Write the name of each block into it where it can be read; returns how many could not be."""
    rim = [withStroke(linewidth=2.0, foreground="#ffffffb0")]
    marked, missing = set(contents.marked), 0
    for k in contents.named:
        name = contents.layout.names[k]
        if k in marked or k not in canvas.names:
            missing += k not in marked
            continue
        (x, y), room = canvas.names[k]
        width, height = room * canvas.inches * 72.0
        # A letter is some 0.55 of its size wide; upright where the block is tall.
        across, up = (width, height) if width >= height else (height, width)
        size = min(0.85 * across / (0.55 * max(len(name), 1)), 0.6 * up, LARGEST_TEXT)
        if size < SMALLEST_TEXT:
            missing += 1
            continue
        canvas.axes.text(
            x,
            y,
            name,
            fontsize=size,
            rotation=0.0 if width >= height else 90.0,
            ha="center",
            va="center",
            color="#2b2b2b",
            zorder=4,
            path_effects=rim,
        )
    return missing


def _add_gaps(figure: Any, axes: Any, joints: Facing) -> None:
    """Draw the joints by their widest gap [mm], in classes with round limits."""
    if not len(joints):
        return
    gaps = joints.gaps.max(axis=1) * 1e3
    limits = _round_limits(float(gaps.min()), float(gaps.max()))
    if len(limits) == 2:
        colours = [GAPS[1]]
    else:
        colours = [GAPS[round(k * (len(GAPS) - 1) / (len(limits) - 2))] for k in range(len(limits) - 1)]
    scale = ListedColormap(colours)
    norm = BoundaryNorm(limits, scale.N)
    lines = LineCollection(list(joints.midline), cmap=scale, norm=norm, linewidth=1.8, zorder=2)
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
    return [float(f"{tick:.6g}") for tick in MaxNLocator(5, steps=[1, 2, 5, 10]).tick_values(low, high)]
