"""Two runs in pictures: their curves in one plot, their blocks side by side, and a film in step."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from PIL import Image, ImageDraw

from blockvis.dynamics.fall import RATE
from blockvis.pictures import palette
from blockvis.pictures.captions import (
    drops_at_start,
    force_unit,
    new_motions,
    parameter_label,
    parameter_unit,
    state_text,
    value_label,
)
from blockvis.pictures.curves import TEXT
from blockvis.pictures.drawer import Drawer, Look
from blockvis.pictures.figures import plain_plot, plain_text, saved
from blockvis.pictures.film import END, PATH_SECONDS, PAUSE
from blockvis.pictures.frame import fitting_font, framed
from blockvis.pictures.render import save_picture
from blockvis.pictures.swing import shown_increments
from blockvis.pictures.video import write_film

from .compared import Comparison, Side

#: Colours and lines of the two curves, told apart without colour, too.
COLOURS, LINES = (palette.FORCE, palette.OPEN), ("-", "--")

#: Height of the strip with the name of the run [pixels].
STRIP = 40


@plain_text
def draw_curves(comparison: Comparison, path: Path) -> Path:
    """Draw both curves in one plot, with where each collapses."""
    figure = Figure(figsize=(8.0, 5.0), layout="constrained")
    axes = figure.add_subplot()
    longest = comparison.longest
    per_length, _ = parameter_unit(longest)
    responses = [side.response for side in comparison.sides]
    largest = max(responses, key=lambda response: float(np.nan_to_num(np.abs(response.values)).max()))
    (factor, _), grey = force_unit(largest), palette.hexadecimal(palette.FAINT)
    for side, colour, line in zip(comparison.sides, COLOURS, LINES, strict=True):
        response, ink = side.response, palette.hexadecimal(colour)
        x, y = response.parameters * per_length, response.values / factor
        marker = "o" if len(x) == 1 or not comparison.is_path else ""
        # The drop from rest is no part of the path, as in the curve of one run.
        first = 1 if drops_at_start(response) else 0
        axes.plot(x[: 2 * first], y[: 2 * first], ":", color=ink, linewidth=1.5)
        axes.plot([], [], line, marker=marker, color=ink, linewidth=2.0, label=f" {side.label}")
        # One reaction is along another motion than the next.
        for start, stop in pairwise([first, *new_motions(response), len(x)]):
            alone = "o" if stop == start + 1 else marker
            axes.plot(x[start:stop], y[start:stop], line, marker=alone, color=ink, linewidth=2.0)
            if start > first:
                axes.axvline(x[start - 1], color=grey, linewidth=1.0, linestyle=(0, (1, 2)), zorder=1)
        if response.collapse is not None:
            axes.plot(x[-1:], y[-1:], "X", color=ink, markersize=9)
            axes.axvline(x[-1], color=ink, linewidth=1.0, linestyle=":")
    below = "\nfrom a dotted line on, reaction along another motion" if any(map(new_motions, responses)) else ""
    axes.set_xlabel((parameter_label(longest) or "limit load") + below, fontsize=TEXT)
    axes.set_ylabel(value_label(largest), fontsize=TEXT)
    axes.set_ylim(bottom=min(0.0, axes.get_ylim()[0]))
    plain_plot(axes, TEXT)
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, 1.12), ncols=2, fontsize=TEXT, frameon=False)
    return saved(figure, path, 200)


class Pair:
    """What draws both runs in one picture: at some parameters over all phases, or of a film, with their falls."""

    def __init__(self, comparison: Comparison, look: Look, stations: np.ndarray | None = None) -> None:
        self.sides, self._longest = comparison.sides, comparison.longest
        # Wide structures stand below each other.
        self._below = all(_aspect(side) > 2.5 for side in self.sides)
        usual, across = ((1280, 480), 1) if self._below else ((800, 620), 2)
        in_space = all(side.response.assembly.dimension == 3 for side in self.sides)
        self.drawers: list[Drawer] = []
        for side in self.sides:
            fall = side.fall if stations is None else None
            shown = side.response.path if fall is not None else shown_increments(side.response)
            if stations is not None:
                shown = tuple(map(side.state, stations.tolist()))
            self.drawers.append(Drawer(side.response, look, None, shown, fall=fall, usual=usual, across=across))
            # What is in front in one picture is so in the other.
            look = replace(look, sight=self.drawers[0].sight if in_space else None)
        # Openings and tilts can be compared by eye at one scale only.
        alike = comparison.same_layout()
        for drawer in self.drawers:
            drawer.share(self.drawers, usual, across, alike=alike)
        self._panel = self.drawers[0].sheet.size

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of a picture of both [pixels]."""
        width, height = self._panel[0], self._panel[1] + STRIP
        return (width, 2 * height) if self._below else (2 * width, height)

    def picture(self, images: list[Image.Image]) -> Image.Image:
        """Put the pictures of both beside or below each other, each under its name."""
        page = Image.new("RGB", self.size, palette.PAPER)
        draw = ImageDraw.Draw(page)
        width, height = self._panel
        for k, (side, image, colour) in enumerate(zip(self.sides, images, COLOURS, strict=True)):
            left, top = (0, k * (height + STRIP)) if self._below else (k * width, 0)
            draw.rectangle((left, top, left + width, top + STRIP - 8), fill=colour)
            font = fitting_font(side.label, STRIP // 2, width - 24, bold=True)
            draw.text((left + 12, top + STRIP // 2 - 4), side.label, font=font, fill=palette.PAPER, anchor="lm")
            page.paste(image, (left, top + STRIP))
        return page

    def path_picture(self, k: int, parameter: float, *, widths: bool = False) -> Image.Image:
        """Draw one of both at a parameter over all phases [m or rad], which has the same unit in both."""
        state = self.sides[k].state(parameter)
        title = state_text(state, self.sides[k].response, self._longest)
        return self.drawers[k].picture(state, title=title, widths=widths)

    def at(self, parameter: float) -> Image.Image:
        """Draw both at a parameter over all phases [m or rad], with the widths of the main cracks."""
        return self.picture([self.path_picture(k, parameter, widths=True) for k in (0, 1)])


def draw_stations(comparison: Comparison, path: Path) -> Path:
    """Draw both at the same settlements, one row below the other."""
    pair = Pair(comparison, Look(forces="none"), comparison.stations)
    rows = [pair.at(at) for at in comparison.stations.tolist()]
    page = Image.new("RGB", (pair.size[0], sum(row.height for row in rows)), palette.PAPER)
    for k, row in enumerate(rows):
        page.paste(row, (0, k * row.height))
    return save_picture(page, path)


def film_in_step(comparison: Comparison, path: Path, *, progress: Callable[[int, int], None] | None = None) -> Path:
    """Write a film of two paths at the same settlements; the one that collapses first falls while the other goes on.

    ``progress`` is called with the frames drawn and their number.
    """
    pair = Pair(comparison, Look(colour_by="mechanism"))
    end = max(side.end for side in comparison.sides)
    longest = max(_seconds(side, end) for side in comparison.sides)
    count = max(2, int(np.ceil((longest + PAUSE + END) * RATE)))

    def pictures() -> Iterator[Image.Image]:
        last: dict[int, tuple[object, Image.Image]] = {}
        for frame in range(count):
            for k, side in enumerate(comparison.sides):
                what, at = moment = _moment(side, frame / RATE, end)
                if k not in last or last[k][0] != moment:
                    falls = what == "fall"
                    last[k] = moment, pair.drawers[k].falling_picture(at) if falls else pair.path_picture(k, at)
            if progress is not None:
                progress(frame + 1, count)
            yield pair.picture([image for _, image in last.values()])

    return write_film(pictures(), path, size=pair.size, fps=RATE)


def _aspect(side: Side) -> float:
    width, height = framed(side.response.assembly, [side.response.path[0].pose]).size[[0, -1]]
    return float(width / height)


def _arrival(side: Side, end: float) -> float:
    """Seconds after which a run is at its last equilibrium."""
    return PATH_SECONDS * side.end / end if end > 0.0 else 0.0


def _seconds(side: Side, end: float) -> float:
    falls = 0.0 if side.fall is None else PAUSE + float(side.fall.times[-1])
    return max(_arrival(side, end) + falls, PATH_SECONDS)


def _moment(side: Side, time: float, end: float) -> tuple[str, float]:
    """Give what a run shows at a time of the film: a place on its path, or a moment of its fall."""
    arrival = _arrival(side, end)
    if time < arrival:
        return "path", end * time / PATH_SECONDS
    if side.fall is None or time < arrival + PAUSE:
        return "path", side.end
    return "fall", min(time - arrival - PAUSE, float(side.fall.times[-1]))
