"""The curve of a response, reaction or load multiplier: a file of its own, or a panel beside the blocks."""

from __future__ import annotations

import os
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from PIL import Image, ImageDraw

import solver
from blockvis.results.about import about, collapse_mechanism, counts_text
from blockvis.results.reaction_range import ReactionRange
from blockvis.system.atomic_files import atomic_file
from solver import mechanics

from . import palette
from .captions import (
    collapse_places,
    drops_at_start,
    force_unit,
    in_one_unit,
    lost_text,
    parameter_label,
    parameter_text,
    parameter_unit,
    shown_range,
    value_label,
)

#: Suffixes of the files that draw_curve writes.
CURVE_SUFFIXES = (".png", ".svg", ".pdf")

#: More changes of hinges than this are not numbered one by one.
MOST_EVENTS = 12

#: Height of the text of the file [points].
TEXT = 11.0


@dataclass(frozen=True)
class Event:
    """Something that happens on the path.

    Attributes
    ----------
    parameter : float [m or rad]
        Settlement over all phases, or control displacement.
    value : float
        Reaction [N or N·m] or load multiplier.
    text : str
    """

    parameter: float
    value: float
    text: str


def draw_curve(
    response: solver.Response,
    path: str | os.PathLike[str],
    *,
    size: tuple[float, float] = (8.0, 5.0),
    band: ReactionRange | None = None,
) -> Path:
    """Draw the reaction over the settlement, absolute and divided by the weight, and mark changes of the mechanism.

    Limit loads and pushovers have the load multiplier over their parameter: settlement, position of the load or control
    displacement; a single limit load is drawn as a rigid-plastic diagram.

    Parameters
    ----------
    response : solver.Response
    path : path
        Ending in .png, .svg or .pdf.
    size : (float, float) [inch]
        Width and height; a PNG has 200 pixels per inch.
    band : ReactionRange, optional
        Of the reaction, drawn behind it.

    Returns
    -------
    pathlib.Path
    """
    path, name = Path(path), about(response).name
    if in_one_unit(response) is not response:
        response = in_one_unit(response)
        name += f"   ·   phase {response.path[-1].phase + 1} of {len(response.settlements)}" if response.path else ""
    if path.suffix.lower() not in CURVE_SUFFIXES:
        raise ValueError(f"'{path.name}' is no curve that blockvis draws; end its name in {', '.join(CURVE_SUFFIXES)}")
    figure = Figure(figsize=size, layout="constrained")
    axes = figure.add_subplot()
    _draw(axes, response, events=True, band=band)
    name += "" if band is None else f"   ·   band: range of {band.runs.max(initial=0)} runs"
    axes.set_title(name, loc="left", fontsize=TEXT, color=palette.hexadecimal(palette.INK))
    with atomic_file(path) as partial:
        figure.savefig(partial, dpi=200)
    return path


def events_of(response: solver.Response) -> list[Event]:
    """Where the set of hinges or sliding joints changes along the path; a collapse has a label and a count of its own.

    Parameters
    ----------
    response : solver.Response
    """
    path = response.path[:-1] if _counts(response) else response.path
    total, values = response.parameters, response.values
    found = []
    # One mechanism per increment: its contact points may come from a file.
    pairs = (_joints(mechanics.mechanism_of(response.assembly, increment)) for increment in path)
    for k, (earlier, later) in enumerate(pairwise(pairs), start=1):
        text = []
        for word, before, after in zip(("hinge", "sliding joint"), earlier, later, strict=True):
            if before != after:
                some = f"{len(after) or 'no'} {word}{'s' if len(after) != 1 else ''}"
                text.append(some if len(before) != len(after) else f"{word}s move")
        if text:
            found.append(Event(float(total[k]), float(values[k]), ", ".join(text)))
    return found


class CurvePanel:
    """The curve beside the blocks, drawn once, with a dot that moves.

    Parameters
    ----------
    response : solver.Response
    size : (int, int)
        Width and height in pixels.
    text : int
        Height of the text in pixels.
    """

    def __init__(self, response: solver.Response, size: tuple[int, int], text: int) -> None:
        response = in_one_unit(response)
        self._response, self._text = response, text
        figure = Figure(figsize=(size[0] / 100.0, size[1] / 100.0), dpi=100, layout="constrained")
        canvas = FigureCanvasAgg(figure)
        axes = figure.add_subplot()
        _draw(axes, response, events=False, text=text * 0.62)
        canvas.draw()
        self._picture = Image.fromarray(np.asarray(canvas.buffer_rgba())[..., :3].copy())
        per_length, _ = parameter_unit(response)
        total = response.parameters
        factor, _ = force_unit(response)
        values = np.nan_to_num(response.values / factor)
        places = (
            axes.transData.transform(np.column_stack([total * per_length, values])) if len(total) else np.zeros((0, 2))
        )
        self._total = total
        self._places = np.column_stack([places[:, 0], size[1] - places[:, 1]])
        self._offsets = {i.phase: float(t - i.parameter) for t, i in zip(total[::-1], response.path[::-1], strict=True)}

    def image(self, increment: solver.Increment) -> Image.Image:
        """Return the curve with the dot at an increment; at the end of the curve during the fall."""
        picture = self._picture.copy()
        # Phases in another unit are not on the curve.
        if len(self._total) == 0 or (self._response.settlements and increment.phase not in self._offsets):
            return picture
        falling = increment.status == solver.Status.FALLING
        at = self._offsets.get(increment.phase, 0.0) + increment.parameter
        if falling and not self._response.swings:
            at = self._total[-1]
        x, y = (float(np.interp(at, self._total, self._places[:, k])) for k in (0, 1))
        r = 0.34 * self._text
        draw = ImageDraw.Draw(picture)
        draw.ellipse((x - r, y - r, x + r, y + r), fill=palette.WARNING if falling else palette.SETTLEMENT)
        return picture


def _draw(
    axes: Axes,
    response: solver.Response,
    *,
    events: bool,
    text: float = TEXT,
    band: ReactionRange | None = None,
) -> None:
    path = response.path
    factor, _ = force_unit(response)
    moment = response.measured.unit == "N·m"
    per_length, _ = parameter_unit(response)
    total = response.parameters * per_length
    values = response.values / factor
    known = values[np.isfinite(values)]
    axes.set_ylabel(value_label(response), fontsize=text)
    axes.tick_params(labelsize=0.9 * text)
    # Numbers as they are, without a power of ten or an offset in the corner.
    axes.ticklabel_format(useOffset=False, style="plain")
    axes.grid(color="#e4e4e4", linewidth=0.8)
    axes.spines[["top", "right"]].set_visible(False)
    axes.margins(x=0.02, y=0.12)
    if len(known) == 0 and len(path) > 1:
        axes.set_xlim(float(total.min()), float(total.max()))
        axes.set_ylim(0.0, 1.0)
        axes.set_yticks([])
        axes.text(0.5, 0.5, "unbounded everywhere", transform=axes.transAxes, ha="center", fontsize=text)
    if len(known):
        low, high = shown_range(values, response)
        if band is not None:
            low, high = _draw_band(axes, response, band, factor, (low, high))
        axes.set_ylim(low - 0.02 * (high - low), high + 0.16 * (high - low) if high > low else 1.0)
    if not response.parameter.is_path and len(path) == 1:
        _draw_single(axes, known, text)
        return
    _draw_line(axes, response, total, values, text if events else None)
    axes.set_xlabel(parameter_label(response), fontsize=text)
    axes.xaxis.set_major_locator(MaxNLocator(8 if events else 5))
    if not moment and response.measured.is_force and response.total_weight > 0:
        weight = response.total_weight / factor
        over_weight = axes.secondary_yaxis(
            "right", functions=(lambda r: np.asarray(r) / weight, lambda w: np.asarray(w) * weight)
        )
        over_weight.set_ylabel("reaction / weight W", fontsize=text)
        over_weight.tick_params(labelsize=0.9 * text)
    if not response.parameter.is_path:
        _mark_lowest(axes, response, text, events)
        for place in total[~np.isfinite(values)] if events else ():
            axes.annotate(
                "unbounded", (place, 0.88), xycoords=("data", "axes fraction"), ha="center", va="top", rotation=90,
                fontsize=0.8 * text, color=palette.hexadecimal(palette.FAINT),
            )  # fmt: skip
    elif events:
        _mark_events(axes, response, factor, text)
    if response.collapse is not None and len(path):
        _mark_collapse(axes, response, total, values, text, events)
    if response.stop is solver.Status.SOLVER_FAILED:
        _mark_failure(axes, response, total, values, text, events)


def _draw_band(
    axes: Axes, response: solver.Response, band: ReactionRange, factor: float, shown: tuple[float, float]
) -> tuple[float, float]:
    """Draw the range of the reaction; returns the range of the axis, in the unit ``factor``, in which it is whole."""
    per_length, _ = parameter_unit(response)
    total, least, most = band.along(response)
    axes.fill_between(
        total * per_length, least / factor, most / factor, color=palette.hexadecimal(palette.FORCE), alpha=0.18,
        linewidth=0,
    )  # fmt: skip
    low, high = shown
    return min(low, float(least.min(initial=0.0)) / factor), max(high, float(most.max(initial=0.0)) / factor)


def _draw_line(
    axes: Axes, response: solver.Response, total: np.ndarray, values: np.ndarray, text: float | None
) -> None:
    """Draw the path, in a file of its own with a dot at each increment and words of the size of ``text``."""
    blue = palette.hexadecimal(palette.FORCE)
    first = 1 if drops_at_start(response) else 0
    axes.plot(total[first:], values[first:], "-", color=blue, linewidth=2.0, zorder=3)
    axes.plot(total[: 2 * first], values[: 2 * first], ":", color=blue, linewidth=1.2, zorder=3)
    if text is None:
        return
    axes.plot(total, values, "o", color=blue, markersize=3.0, zorder=3)
    if first:
        axes.annotate(
            "at rest", (total[0], values[0]), xytext=(8, 0), textcoords="offset points", va="center",
            fontsize=0.9 * text,
        )  # fmt: skip


def _mark_failure(
    axes: Axes, response: solver.Response, total: np.ndarray, values: np.ndarray, text: float, words: bool
) -> None:
    """Mark where the solver gave up: the curve ends there, the structure need not."""
    red = palette.hexadecimal(palette.WARNING)
    axes.plot(total[-1:], values[-1:], "X", color=red, markersize=9 if words else 6, zorder=5)
    what = (
        f"solver failed at {parameter_text(response.path[-1].parameter, response)}" if len(total) else "solver failed"
    )
    axes.annotate(
        f"{what}: the curve is not complete" if words else "solver failed",
        (0.98, 0.03), xycoords="axes fraction", ha="right", va="bottom", fontsize=0.9 * text, color=red,
    )  # fmt: skip


def _draw_single(axes: Axes, known: np.ndarray, text: float) -> None:
    """Draw one limit load: rigid up to it, then a mechanism of any size."""
    axes.set_xlim(0.0, 1.0)
    axes.set_xticks([])
    axes.set_xlabel("displacement of the mechanism (first order, any size)", fontsize=text)
    if len(known) == 0:
        axes.set_ylim(0.0, 1.0)
        axes.set_yticks([])
        axes.text(0.5, 0.5, "no finite limit load", transform=axes.transAxes, ha="center", fontsize=text)
        return
    alpha = float(known[0])
    blue = palette.hexadecimal(palette.FORCE)
    axes.plot([0.0, 0.0, 0.97], [0.0, alpha, alpha], "-", color=blue, linewidth=2.5, zorder=3, clip_on=False)
    axes.annotate("", (1.0, alpha), (0.96, alpha), arrowprops={"arrowstyle": "->", "color": blue, "linewidth": 2.0})
    axes.annotate(
        f"α = {alpha:.6g}", (0.5, alpha), xytext=(0, 7), textcoords="offset points", ha="center", fontsize=text
    )


def _mark_lowest(axes: Axes, response: solver.Response, text: float, words: bool) -> None:
    lowest = response.governing
    if lowest is None or not np.isfinite(lowest.measured):
        return
    red = palette.hexadecimal(palette.WARNING)
    place = (lowest.parameter, lowest.measured)
    axes.plot(*place, "o", color=red, markersize=8 if words else 5, zorder=4)
    if words:
        axes.annotate(
            f"lowest {response.measured.symbol} = {place[1]:.5g} at {response.parameter.symbol} = {place[0]:.4g} "
            f"{response.parameter.unit}",
            (0.5, 0.96),
            xycoords="axes fraction",
            ha="center",
            va="top",
            fontsize=text,
            color=red,
        )


def _mark_collapse(
    axes: Axes, response: solver.Response, total: np.ndarray, reactions: np.ndarray, text: float, words: bool
) -> None:
    collapse = response.collapse
    assert collapse is not None
    red = palette.hexadecimal(palette.WARNING)
    # A capacity that is lost ends at the foot of the diagram.
    above = collapse.lost == "capacity"
    lost = lost_text(response)
    what = "no capacity" if above else lost.removeprefix("a ").replace(" is", "")
    places = collapse_places(response)
    assert places is not None
    low, middle, high = places.tolist()
    axes.axvspan(low, high, color=red, alpha=0.25, linewidth=0)
    axes.axvline(middle, color=red, linewidth=1.0, linestyle=(0, (4, 3)), zorder=2)
    axes.plot(total[-1:], reactions[-1:], "X", color=red, markersize=9 if words else 6, zorder=4)
    if words:
        axes.annotate(
            f"{what} at {collapse.displacement:.5g} {collapse.unit}\n"
            f"[{collapse.bracket[0]:.6g}, {collapse.bracket[1]:.6g}]{_counts(response)}",
            (middle, 0.96 if above else 0.04),
            xycoords=("data", "axes fraction"),
            xytext=(-6, 0),
            textcoords="offset points",
            ha="right",
            va="top" if above else "bottom",
            fontsize=0.9 * text,
            color=red,
        )


def _counts(response: solver.Response) -> str:
    """Count the parts, hinges and sliding joints of the collapse mechanism, on a line of their own."""
    mechanism = collapse_mechanism(response)
    if mechanism is None or response.collapse is None or response.collapse.lost != "equilibrium":
        return ""
    return f"\n{counts_text(mechanism)}"


def _mark_events(axes: Axes, response: solver.Response, factor: float, text: float) -> None:
    found = events_of(response)
    if not found:
        return
    ink = palette.hexadecimal(palette.INK)
    per_length, _ = parameter_unit(response)
    x, y = [e.parameter * per_length for e in found], [e.value / factor for e in found]
    if len(found) > MOST_EVENTS:
        # Circles on nearly every point would hide the curve: ticks at the foot say where.
        axes.plot(
            x, [0.012] * len(x), "|", transform=axes.get_xaxis_transform(), color=ink, markersize=7,
            markeredgewidth=0.8, zorder=4, label=f"{len(found)} times hinges or sliding joints change",
        )  # fmt: skip
        axes.legend(loc="upper left", fontsize=0.8 * text, frameon=False)
        return
    axes.plot(x, y, "o", color="white", markeredgecolor=ink, markersize=7, zorder=4)
    low, high = axes.get_xlim()
    above = True
    for number in range(1, len(found) + 1):
        # Under the curve where it would run into the number before.
        close = number > 1 and abs(x[number - 1] - x[number - 2]) < 0.03 * (high - low)
        above = not (close and above)
        axes.annotate(
            str(number), (x[number - 1], y[number - 1]), xytext=(0, 8 if above else -8),
            textcoords="offset points", ha="center", va="bottom" if above else "top", fontsize=0.8 * text,
        )  # fmt: skip
    lines = [f"{n}  {e.text}" for n, e in enumerate(found, 1)]
    # On the side of the left half that the curve leaves free.
    left = (response.values / factor)[response.parameters * per_length < 0.5 * (low + high)]
    foot = len(left) == 0 or float(np.nanmean(left)) > float(np.mean(axes.get_ylim()))
    axes.text(
        0.02, 0.04 if foot else 0.96, "\n".join(lines), transform=axes.transAxes, va="bottom" if foot else "top",
        fontsize=0.8 * text, linespacing=1.4,
        bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.85},
    )  # fmt: skip


def _joints(mechanism: mechanics.Mechanism) -> list[set[tuple[int, int]]]:
    """Pairs of blocks of the hinges, and of the sliding joints."""
    return [set(map(tuple, pairs.tolist())) for pairs in (mechanism.hinges, mechanism.sliding)]
