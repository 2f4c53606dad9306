"""The curve of a response, reaction or load multiplier: a file of its own, or a panel beside the blocks."""

from __future__ import annotations

import os
from itertools import pairwise
from pathlib import Path
from textwrap import wrap
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from PIL import Image, ImageDraw

import solver
from blockvis.results.about import (
    Result,
    about,
    after_settlements,
    collapse_phase,
    counts_text,
    in_phase,
    limit_states,
    losing,
    phases_of,
    response_of,
)
from blockvis.results.mechanism_arrays import SWING
from blockvis.results.reaction_range import ReactionRange
from blockvis.results.tables import change_words
from blockvis.results.ties import TieForceCurves, tie_force_curves
from solver import mechanics

from . import palette
from .captions import (
    collapse_places,
    drops_at_start,
    force_unit,
    in_one_unit,
    losses_along,
    lost_text,
    new_motions,
    parameter_label,
    parameter_text,
    parameter_unit,
    shown_range,
    unit_for,
    value_label,
)
from .figures import plain_plot, plain_text, saved

#: Suffixes of the files that draw_curve writes.
CURVE_SUFFIXES = (".png", ".svg", ".pdf")

#: Height of the text of the file [points].
TEXT = 11.0

#: Colours of what is measured, of what fails, and of what is beside.
BLUE, RED, GREY = map(palette.hexadecimal, (palette.FORCE, palette.WARNING, palette.FAINT))

#: Coordinates along the axis of the parameter, and parts of the height.
AT = ("data", "axes fraction")

#: Behind words on a curve.
PATCH = {"facecolor": "white", "edgecolor": "none", "pad": 1.0}


@plain_text
def draw_curve(
    response: Result,
    path: str | os.PathLike[str],
    *,
    size: tuple[float, float] = (8.0, 5.0),
    band: ReactionRange | None = None,
) -> Path:
    """Draw the reaction over the settlement, absolute and divided by the weight, and mark the collapse.

    Limit loads and pushovers have the load multiplier over their parameter: settlement, position of the load or control
    displacement; a single limit load is drawn as a rigid-plastic diagram. Forces of ties along a path stand below.

    Parameters
    ----------
    response : solver.Response, solver.LimitLoad or solver.Envelope
    path : path
        Ending in .png, .svg or .pdf.
    size : (float, float) [inch]
        Width and height; a PNG has 200 pixels per inch.
    band : ReactionRange, optional
        Of the reaction, drawn behind it.
    """
    response = response_of(response)
    path, name = Path(path), "   ·   ".join(filter(None, (about(response).name, after_settlements(response))))
    if in_one_unit(response) is not response:
        response = in_one_unit(response)
        name += f"   ·   phase {response.path[-1].phase + 1} of {len(phases_of(response))}" if response.path else ""
    if path.suffix.lower() not in CURVE_SUFFIXES:
        raise ValueError(f"'{path.name}' is no curve that blockvis draws; end its name in {', '.join(CURVE_SUFFIXES)}")
    ties = tie_force_curves(response) if response.parameter.is_path else None
    if ties is None:
        figure = Figure(figsize=size, layout="constrained")
        axes = figure.add_subplot()
    else:
        figure = Figure(figsize=(size[0], 1.5 * size[1]), layout="constrained")
        axes, below = figure.subplots(2, 1, sharex=True, height_ratios=(2.0, 1.2))
    _Plot(axes, response, words=True).draw(band)
    if ties is not None:
        _draw_ties(below, response, ties)
        axes.set_xlabel("")
    name += "" if band is None else f"   ·   band: range of {mechanics.counted(band.runs.max(initial=0), 'run')}"
    # Lines of eleven letters an inch.
    above = _mark_phases(axes, response, int(11.0 * size[0])) if phases_of(response) else 0.0
    axes.set_title(name, loc="left", fontsize=TEXT, color=palette.hexadecimal(palette.INK), pad=6.0 + above)
    return saved(figure, path, 200)


class CurvePanel:
    """The curve beside the blocks, drawn once, with a dot that moves; size and height of the text are in pixels."""

    @plain_text
    def __init__(self, response: solver.Response, size: tuple[int, int], text: int) -> None:
        response = in_one_unit(response)
        self._response, self._text = response, text
        figure = Figure(figsize=(size[0] / 100.0, size[1] / 100.0), dpi=100, layout="constrained")
        canvas = FigureCanvasAgg(figure)
        axes = figure.add_subplot()
        # In points: letters at ticks, a tenth smaller, are then as high as the smallest of the sheet.
        plot = _Plot(axes, response, words=False, text=0.72 * text)
        plot.draw()
        canvas.draw()
        self._picture = Image.fromarray(np.asarray(canvas.buffer_rgba())[..., :3].copy())
        places = axes.transData.transform(np.column_stack([plot.total, plot.values]))
        self._total = total = response.parameters
        self._places = np.column_stack([places[:, 0], size[1] - places[:, 1]])
        self._offsets = {i.phase: float(t - i.parameter) for t, i in zip(total[::-1], response.path[::-1], strict=True)}

    def image(self, increment: solver.Increment) -> Image.Image:
        """Return the curve with the dot at an increment; at the end of the curve during the fall."""
        picture = self._picture.copy()
        # Phases in another unit are not on the curve.
        if increment.phase not in self._offsets:
            return picture
        falling = increment.status == solver.Status.FALLING
        at = self._offsets[increment.phase] + increment.parameter
        if falling and not self._response.swings:
            at = self._total[-1]
        x, y = (float(np.interp(at, self._total, self._places[:, k])) for k in (0, 1))
        if not np.isfinite(y):
            # Unbounded, as the title says.
            return picture
        r = 0.34 * self._text
        draw = ImageDraw.Draw(picture)
        draw.ellipse((x - r, y - r, x + r, y + r), fill=palette.WARNING if falling else palette.SETTLEMENT)
        return picture


class _Plot:
    """A curve on axes, marked larger and with words where it is a file of its own, in letters so high [points]."""

    def __init__(self, axes: Axes, response: solver.Response, words: bool, text: float = TEXT) -> None:
        self.axes, self.response, self.words, self.text = axes, response, words, text
        self.factor, _ = force_unit(response)
        self.per_length, _ = parameter_unit(response)
        #: (n,) arrays in the units of the axes: parameters and values of the path.
        self.total, self.values = response.parameters * self.per_length, response.values / self.factor
        self.known = self.values[np.isfinite(self.values)]

    def draw(self, band: ReactionRange | None = None) -> None:
        """Draw it all, over the range of the reaction where that is known."""
        axes, response, text, known = self.axes, self.response, self.text, self.known
        axes.set_ylabel(value_label(response), fontsize=text)
        plain_plot(axes, text)
        axes.margins(x=0.02, y=0.12)
        if len(known) == 0 and len(response.path) > 1:
            axes.set_ylim(0.0, 1.0)
            axes.text(0.5, 0.5, "unbounded everywhere", transform=axes.transAxes, ha="center", fontsize=text)
        if len(known):
            low, high = shown_range(self.values, response)
            if band is not None:
                low, high = self._band(band, (low, high))
            axes.set_ylim(low - 0.02 * (high - low), high + 0.16 * (high - low) if high > low else 1.0)
        if not response.parameter.is_path and len(response.path) == 1:
            self._single()
            return
        # Also of what is unbounded.
        axes.update_datalim(np.column_stack([self.total, self.total]), updatey=False)
        self._line()
        axes.set_xlabel(parameter_label(response), fontsize=text)
        axes.xaxis.set_major_locator(MaxNLocator(8 if self.words else 5, steps=[1, 2, 2.5, 5, 10]))
        if response.measured.unit != "N·m" and response.measured.is_force and response.total_weight > 0:
            self._axis_of_weight(response.total_weight / self.factor)
        if not response.parameter.is_path:
            self._unproved()
            self._lowest()
        if self.words and len(known):
            self._unbounded()
        self._losses()
        if response.collapse is not None and len(response.path):
            self._collapse(response.collapse)
        if response.stop is solver.Status.SOLVER_FAILED:
            self._failure()

    def _axis_of_weight(self, weight: float) -> None:
        """Draw an axis of the reaction over the weight, in the unit of the other."""
        over_weight = self.axes.secondary_yaxis(
            "right", functions=(lambda r: np.asarray(r) / weight, lambda w: np.asarray(w) * weight)
        )
        over_weight.set_ylabel("reaction / weight W", fontsize=self.text)
        over_weight.tick_params(labelsize=0.9 * self.text)

    def _band(self, band: ReactionRange, shown: tuple[float, float]) -> tuple[float, float]:
        """Draw the range of the reaction; returns the range of the axis in which it is whole."""
        total, least, most = band.along(self.response)
        least, most = least / self.factor, most / self.factor
        # Where it has no height its edge is seen.
        self.axes.fill_between(
            total * self.per_length, least, most, facecolor=(BLUE, 0.18), edgecolor=(BLUE, 0.5), linewidth=0.8
        )
        return min(shown[0], float(least.min(initial=0.0))), max(shown[1], float(most.max(initial=0.0)))

    def _line(self) -> None:
        """Draw the path, in a file of its own with dots at few increments."""
        axes, total, values = self.axes, self.total, self.values
        first = 1 if drops_at_start(self.response) else 0
        losses = [row for row, _, _ in losses_along(self.response)]
        for start, stop in pairwise(sorted({first, *losses, *new_motions(self.response), len(total)})):
            axes.plot(total[start:stop], values[start:stop], "-", color=BLUE, linewidth=2.0, zorder=3)
        for row in losses:
            # The reaction just before and after a loss is not known.
            axes.plot(total[row - 1 : row + 1], values[row - 1 : row + 1], ":", color=BLUE, linewidth=1.2, zorder=3)
        axes.plot(total[: 2 * first], values[: 2 * first], ":", color=BLUE, linewidth=1.2, zorder=3)
        if not self.words:
            return
        # Of more the dots would be a thick line.
        if len(total) <= 25:
            axes.plot(total, values, "o", color=BLUE, markersize=3.0, zorder=3)
        if first:
            # On the side that the curve leaves free.
            above = values[0] > values[1]
            word, up = "at rest" if self.response.measured.is_force else "rigid", "bottom" if above else "top"
            offset = -4, 6 if above else -6
            _word(axes, word, (total[0], values[0]), offset, va=up, fontsize=0.9 * self.text, zorder=4, bbox=PATCH)

    def _losses(self) -> None:
        """Mark where blocks are lost while the rest stands, and say how many where the curve leaves room."""
        losses = losses_along(self.response)
        words = sorted(losses, key=lambda loss: -loss[2])[: 3 * self.words]
        for row, place, number in losses:
            self.axes.axvline(place, color=RED, linewidth=1.0, linestyle=(0, (1, 2)), zorder=2)
            if (row, place, number) in words:
                low, high = self.axes.get_ylim()
                # They stand before the line.
                above = self.values[row - 1] < (low + high) / 2.0
                # Clear of the words of a collapse, four lines.
                places = collapse_places(self.response)
                room = 4.2 * self.text * (places is not None and self._above(places[1]) == above)
                style = {"ha": "right", "va": "top" if above else "bottom", "rotation": 90, "color": RED, "bbox": PATCH}
                told = f"{mechanics.counted(number, 'block')} lost"
                offset = -3, -room if above else room
                _word(self.axes, told, (place, 0.96 if above else 0.04), offset, AT, fontsize=0.9 * self.text, **style)

    def _above(self, middle: float) -> bool:
        """Whether the words of a collapse stand above the curve, on the side that it leaves free."""
        near = self.total >= middle - 0.35 * (self.total[-1] - self.total[0])
        beside = self.values[near & np.isfinite(self.values)]
        foot, head = self.axes.get_ylim()
        return len(beside) > 0 and bool(head - beside.max() > beside.min() - foot)

    def _failure(self) -> None:
        """Mark where the solver gave up: the curve ends there, the structure need not."""
        axes, response = self.axes, self.response
        axes.plot(self.total[-1:], self.values[-1:], "X", color=RED, markersize=9 if self.words else 6, zorder=5)
        at = f" at {parameter_text(response.path[-1].parameter, response)}" if len(self.total) else ""
        told = f"solver failed{at}: the curve is not complete" if self.words else "solver failed"
        style = {"ha": "right", "va": "bottom", "fontsize": 0.9 * self.text, "color": RED}
        _word(axes, told, (0.98, 0.03), (0, 0), "axes fraction", **style)

    def _single(self) -> None:
        """Draw one limit load: rigid up to it, then a mechanism, over displacements as small as first order allows."""
        axes, text = self.axes, self.text
        reach = SWING * float(np.ptp(self.response.assembly.vertices, axis=0).max())
        factor, unit = (1e3, "mm") if reach < 0.1 else (1.0, "m")
        reach *= factor
        axes.set_xlim(0.0, reach)
        axes.set_xlabel(f"displacement of the fastest block, first order [{unit}]", fontsize=text)
        if len(self.known) == 0:
            axes.set_ylim(0.0, 1.0)
            axes.text(0.5, 0.5, "no finite limit load", transform=axes.transAxes, ha="center", fontsize=text)
            return
        alpha = float(self.known[0])
        ends = [0.0, 0.0, 0.97 * reach], [0.0, alpha, alpha]
        axes.plot(*ends, "-", color=BLUE, linewidth=2.5, zorder=3, clip_on=False)
        arrow = {"arrowstyle": "->", "color": BLUE, "linewidth": 2.0}
        axes.annotate("", (reach, alpha), (0.96 * reach, alpha), arrowprops=arrow)
        _word(axes, f"α = {alpha:.6g}", (0.5 * reach, alpha), (0, 7), ha="center", fontsize=text)

    def _unbounded(self) -> None:
        """Shade where no load is too much, as far as the neighbours that have a limit, and say so in each."""
        total, unbounded = self.total, np.isinf([state.measured for state in self.response.path])
        edges = np.flatnonzero(np.diff(np.concatenate([[False], unbounded, [False]]).astype(int)))
        for first, stop in edges.reshape(-1, 2).tolist():
            low, high = total[max(first - 1, 0)], total[min(stop, len(total) - 1)]
            self.axes.axvspan(low, high, color=GREY, alpha=0.15, linewidth=0)
            wide = high - low > 0.2 * (total[-1] - total[0])
            style: dict[str, Any] = {"ha": "center", "va": "center", "rotation": 0 if wide else 90, "color": GREY}
            middle = (low + high) / 2.0, 0.5
            _word(self.axes, "unbounded", middle, (0, 0), AT, fontsize=0.9 * self.text, **style)

    def _unproved(self) -> None:
        """Mark positions of a load whose value is no limit load."""
        states = [s for limit, s in limit_states(self.response) if limit.status is solver.LimitStatus.NOT_CONVERGED]
        for number, state in enumerate(state for state in states if np.isfinite(state.measured)):
            place = (state.parameter, state.measured / self.factor)
            self.axes.plot(*place, "o", mfc="white", mec=GREY, mew=1.6, markersize=8 if self.words else 5, zorder=5)
            if number == 0 and self.words:
                _word(self.axes, "not converged", place, (8, 5), fontsize=0.9 * self.text, color=GREY)

    def _lowest(self) -> None:
        response, lowest = self.response, self.response.governing
        if lowest is None or not np.isfinite(lowest.measured):
            return
        place = (lowest.parameter, lowest.measured)
        self.axes.plot(*place, "o", color=RED, markersize=8 if self.words else 5, zorder=4)
        if self.words:
            symbol, unit = response.parameter.symbol, response.parameter.unit
            told = f"lowest {response.measured.symbol} = {place[1]:.5g} at {symbol} = {place[0]:.4g} {unit}"
            # Of an envelope every place below may be on the curve.
            self.axes.set_title(told, loc="right", fontsize=self.text, color=RED)
            if self.known.max() > self.axes.get_ylim()[1]:
                x = self.total[self.values == self.known.max()][0]
                above = f"above this picture: up to {self.known.max():.4g} at {symbol} = {x:.4g} {unit}"
                self.axes.set_xlabel(f"{self.axes.get_xlabel()}   ·   {above}", fontsize=self.text)

    def _collapse(self, collapse: solver.Collapse) -> None:
        axes, total = self.axes, self.total
        places, phase = collapse_places(self.response), collapse_phase(self.response)
        assert places is not None
        assert phase is not None
        low, middle, high = places.tolist()
        axes.axvspan(low, high, color=RED, alpha=0.25, linewidth=0)
        axes.axvline(middle, color=RED, linewidth=1.0, linestyle=(0, (4, 3)), zorder=2)
        axes.plot(total[-1:], self.values[-1:], "X", color=RED, markersize=9 if self.words else 6, zorder=4)
        if not self.words:
            return
        lost = lost_text(self.response)
        what = "no capacity" if collapse.lost == "capacity" else lost.removeprefix("a ").replace(" is", "")
        above = self._above(middle)
        # Other runs may go on for long.
        left = middle >= sum(axes.get_xlim()) / 2.0
        factor, unit = parameter_unit(self.response)
        first, last = (factor * end for end in collapse.bracket)
        told = (
            f"{what} at {factor * collapse.displacement:.5g} {unit}{in_phase(self.response, phase)}\n"
            f"[{first:.6g}, {last:.6g}]{_counts(self.response)}"
        )
        place, offset = (middle, 0.96 if above else 0.04), (-6 if left else 6, 0)
        style = {"ha": "right" if left else "left", "va": "top" if above else "bottom", "color": RED, "bbox": PATCH}
        _word(axes, told, place, offset, AT, fontsize=0.9 * self.text, **style)


def _draw_ties(axes: Axes, response: solver.Response, ties: TieForceCurves) -> None:
    """Draw the forces of ties, tension positive, where they yield and where they break."""
    total = response.parameters * parameter_unit(response)[0]
    factor, unit = unit_for(float(np.nanmax(np.abs(ties.forces), initial=0.0)))
    columns = min(3, len(ties.names))
    # One that is wider finds no place beside the lines.
    letters = 80 // (columns + 1)
    for name, forces, states, shade in zip(ties.names, ties.forces.T, ties.states.T, palette.TIE_SHADES, strict=False):
        colour = palette.hexadecimal(shade)
        axes.plot(
            total,
            forces / factor,
            "-",
            color=colour,
            linewidth=2.0,
            # Labels that begin with "_" matplotlib leaves out.
            label=" " + "\n ".join(wrap(f"{name}{', slack' * bool((states == mechanics.SLACK).all())}", letters)),
        )
        for state, mark, word in ((mechanics.YIELDING, "o", "yields"), (mechanics.BROKEN, "X", "broken")):
            first = np.flatnonzero(states == state)[:1]
            axes.plot(total[first], forces[first] / factor, mark, color=colour, markersize=7, zorder=4)
            for k in first.tolist():
                _word(axes, word, (total[k], forces[k] / factor), (7, 4), fontsize=0.8 * TEXT, color=colour)
    axes.axhline(0.0, color=GREY, linewidth=0.8)
    axes.set_ylabel(f"force of ties, tension + [{unit}]", fontsize=TEXT)
    axes.set_xlabel(parameter_label(response), fontsize=TEXT)
    plain_plot(axes, TEXT)
    axes.margins(x=0.02, y=0.16)
    axes.legend(loc="best", fontsize=0.9 * TEXT, edgecolor="none", ncols=columns)


def _mark_phases(axes: Axes, response: solver.Response, letters: int) -> float:
    """Mark by numbers where settlements begin, list above what changes before each; returns the height in points.

    The list leaves the plot to the curve, of whose phases the shortest may be narrower than a word.
    """
    phases, lines = [increment.phase for increment in response.path], list[str]()
    (per_length, unit), others, height = parameter_unit(response), new_motions(response), 0.85 * TEXT
    total = response.parameters * per_length
    style: dict[str, Any] = {"va": "bottom", "fontsize": height, "color": GREY}
    # What falls as a phase begins has no row in it.
    phases += [collapse_phase(response) or phase for phase in phases[-1:]]
    for k in range(1, len(phases)):
        if phases[k] == phases[k - 1]:
            continue
        words = ["reaction along another motion"] * (k in others)
        words += change_words(response, phases[k])
        axes.axvline(total[k - 1], color=GREY, linewidth=1.0, linestyle=(0, (1, 2)), zorder=1)
        _word(axes, str(phases[k] + 1), (total[k - 1], 1.0), (0, 2), AT, ha="center", **style)
        where = f"phase {phases[k] + 1} from {total[k - 1]:.4g} {unit}"
        lines += wrap(f"{where}: {', '.join(words)}" if words else where, letters, subsequent_indent="    ")
    if not lines:
        return 0.0
    _word(axes, "\n".join(lines), (0.0, 1.0), (0.0, 2.0 + 1.4 * height), "axes fraction", ha="left", **style)
    return 1.4 * height * (len(lines) + 1)


def _counts(response: solver.Response) -> str:
    """Count the parts, hinges and sliding joints of the collapse mechanism, on a line of their own."""
    begins = losing(response)
    return "" if begins is None else f"\n{counts_text(mechanics.mechanism_of(response.assembly, begins))}"


def _word(
    axes: Axes,
    words: str,
    place: tuple[float, float],
    offset: tuple[float, float],
    coordinates: str | tuple[str, str] = "data",
    **style: Any,
) -> None:
    """Write words at a place, so many points to the right and up."""
    axes.annotate(words, place, offset, coordinates, "offset points", **style)
