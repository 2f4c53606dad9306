"""Pictures of a study: fragility, sensitivity, scatter of the runs by mechanism, and the mechanisms."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from blockvis.pictures import palette
from blockvis.pictures.curves import TEXT
from blockvis.pictures.figures import plain_frame, plain_text, saved
from blockvis.pictures.frame import Frame, frame_around
from blockvis.pictures.ties import COLOURS
from blockvis.results.about import LOCAL
from blockvis.text import rounded_text
from solver import mechanics
from solver.mechanics import counted

from .fragility import CONFIDENCE, Fragility, fragility_of
from .sensitivity import Swing, capacity, first_order, independent_rows, outcome, swings, unit_of, without_collapse
from .study_file import Study
from .study_folder import NO_RESULT, NOT_BUILT, StudyFolder
from .summary import MOST_MECHANISMS, classes_of, curve_name, ends_counted, is_sample, is_single

if TYPE_CHECKING:
    import pandas as pd

#: Empty border of a tile, and how far beyond the blocks it shows supports, in sizes of the structure.
MARGIN, SUPPORTS = 0.05, 0.25

#: Colours and marks of the classes, the most frequent first; the marks distinguish them in grey as well.
CLASSES = ("#145ca8", "#e24e1b", "#00796b", "#7e37b2", "#b08a00", "#7a4a2b")
MARKS = ("o", "s", "^", "D", "v", "P")

HEADING: dict[str, Any] = {"fontsize": 0.95 * TEXT, "loc": "left", "color": "#4a4a4a"}


def draw_study(records: StudyFolder, table: pd.DataFrame) -> list[Path]:
    """Draw the pictures of a study that its table has data for; gives the files."""
    study, folder = records.study, records.folder
    drawn = []
    if (~table["status"].isin(NO_RESULT)).any():
        # Five strengths that somebody chose are no sample: their share means nothing, and the scatter shows them.
        if is_sample(study):
            drawn.append(draw_fragility(study, table, folder / "fragility.png"))
        if swings(study, table) and not is_single(study):
            drawn.append(draw_sensitivity(study, table, folder / "sensitivity.png"))
    if classes_of(table):
        drawn.append(draw_scatter(study, table, folder / "scatter.png"))
        drawn.append(draw_mechanisms(records, table, folder / "mechanisms.png"))
    return drawn


@plain_text
def draw_fragility(study: Study, table: pd.DataFrame, path: str | Path) -> Path:
    """Draw the probability of collapse against settlement or load, with its confidence band, as PNG, SVG or PDF."""
    rows = independent_rows(study, table)
    curve = fragility_of(rows)
    factor, unit = _scale(study, table)
    figure = Figure(figsize=(8.0, 5.0), layout="constrained")
    axes = figure.add_subplot()
    colour = palette.hexadecimal(palette.FORCE)
    steps = factor * np.concatenate([[0.0], curve.settlement, [curve.furthest]])
    least, most, low, high = (
        np.pad([0.0, *of], (0, 1), mode="edge") for of in (curve.probability, curve.at_most, curve.lower, curve.upper)
    )
    if len(curve.settlement):
        axes.fill_between(
            steps, low, high, step="post", color=colour, alpha=0.18, linewidth=0,
            label=f"{100 * CONFIDENCE:g} % confidence, point by point",
        )  # fmt: skip
    never = ", if runs without result never collapse" if curve.n_broken_off else ""
    axes.step(steps, least, where="post", color=colour, linewidth=2.2, label=f"{curve_name(study)}{never}")
    if never:
        axes.step(steps, most, "--", where="post", color=colour, label="if they collapse where they were left")
    for share, words in ((0.05, "5 %"), (0.5, "half")):
        # Where both are one it is the last.
        for at, by in dict(zip(curve.quantile(share), ("not before", "by"), strict=True)).items():
            if at is None:
                continue
            x = factor * at
            axes.plot([0.0, x, x], [share, share, 0.0], color="#7a7a7a", linewidth=0.9, dashes=(4, 3))
            axes.annotate(
                f"{words} {by} {_with_unit(x, unit)}", (x, share), xytext=(6, -4), textcoords="offset points",
                va="top", fontsize=0.9 * TEXT, color="#4a4a4a",
            )  # fmt: skip
    axes.set_ylim(0.0, 1.02)
    # Where all runs collapsed nothing is to be seen beyond the last.
    all_fell = curve.n_stood == curve.n_broken_off == 0 and len(curve.settlement) > 0
    axes.set_xlim(0.0, 1.03 * factor * max(float(curve.settlement[-1]) if all_fell else curve.furthest, 1e-12))
    axes.set_xlabel(_label(study.capacity.name, unit), fontsize=TEXT)
    axes.set_ylabel(curve_name(study), fontsize=TEXT)
    _plain_frame(axes)
    axes.legend(loc="upper left", frameon=False, fontsize=0.9 * TEXT)
    axes.set_title(runs_counted(curve, rows, factor, unit), **HEADING)
    return saved(figure, path, 150)


@plain_text
def draw_sensitivity(study: Study, table: pd.DataFrame, path: str | Path) -> Path:
    """Draw the swing of where runs collapse with every parameter, and Sobol' indices beside it, if known."""
    found, indices = swings(study, table)[:12], first_order(study, table)
    factor, unit = _scale(study, table)
    names = list(dict.fromkeys([*(swing.name for swing in found), *indices]))
    figure = Figure(figsize=(10.0, 1.9 + 0.6 * len(names)), layout="constrained")
    ratios = (1.6, 1.0) if indices else (1.0,)
    left, *others = figure.subplots(1, len(ratios), sharey=True, squeeze=False, width_ratios=ratios)[0]
    centre = factor * float(np.nanmean(outcome(independent_rows(study, table))))
    for place, swing in enumerate(found):
        _draw_swing(left, place, swing, centre, factor)
    left.axvline(centre, color="#333333", linewidth=1.0)
    left.margins(x=0.22)
    left.set_yticks(range(len(names)), [textwrap.shorten(name, 40) for name in names], fontsize=0.95 * TEXT)
    left.set_ylim(len(names) - 0.4, -0.6)
    stood = int(without_collapse(table).sum())
    bound = f", at least: {counted(stood, 'run')} without collapse" if stood else ""
    left.set_xlabel(_label(f"mean {study.capacity.name} at collapse", unit) + bound, fontsize=TEXT)
    left.set_title("mean of the runs with the\nlowest and the highest values", **HEADING)
    for right in others:
        for place, name in enumerate(names):
            if name in indices:
                share, error = indices[name]
                right.barh(place, share, color=palette.hexadecimal(palette.SETTLEMENT), height=0.52, zorder=2)
                _draw_error(right, share, place, error)
        reach = [0.0, 1.0, *(share + side * error for share, error in indices.values() for side in (-1, 1))]
        right.set_xlim(min(reach), max(reach))
        right.set_xlabel("first-order Sobol’ index", fontsize=TEXT)
        remaining = max(1.0 - sum(s for s, _ in indices.values()), 0.0)
        words = "interactions" if study.design.factors or not study.n_seeded else "imperfections, interactions"
        right.set_title(f"share of the variance\n{words}: {100 * remaining:.0f} %", **HEADING)
    for axes in (left, *others):
        _plain_frame(axes)
        axes.grid(visible=False, axis="y")
    return saved(figure, path, 150)


def _draw_swing(axes: Axes, place: int, swing: Swing, centre: float, factor: float) -> None:
    """Draw the bars of a parameter from the mean of all runs, with its values at the ends, the smaller mean's left."""
    light, dark = "#9bc0e0", palette.hexadecimal(palette.FORCE)
    ends = [
        (factor * swing.low, factor * swing.low_error, swing.low_value, light),
        (factor * swing.high, factor * swing.high_error, swing.high_value, dark),
    ]
    # Of two bars to one side the shorter lies upon the longer.
    for mean, error, _, colour in sorted(ends, key=lambda end: -abs(end[0] - centre)):
        axes.barh(place, mean - centre, left=centre, color=colour, height=0.52, zorder=2)
        _draw_error(axes, mean, place, error)
    for outwards, (*_, value, _) in zip((-1, 1), sorted(ends, key=lambda end: end[0]), strict=True):
        # Beyond the errors of both ends, which lie in one line: one of them would strike the value through.
        edge = outwards * max(outwards * centre, *(outwards * mean + error for mean, error, *_ in ends))
        words = textwrap.shorten(value, 16) if isinstance(value, str) else rounded_text(value)
        axes.annotate(
            words, (edge, place), xytext=(6 * outwards, 0), textcoords="offset points", va="center",
            ha="left" if outwards > 0 else "right", fontsize=0.85 * TEXT,
        )  # fmt: skip


def _draw_error(axes: Axes, at: float, place: int, error: float) -> None:
    if error > 0.0:
        axes.errorbar(at, place, xerr=error, color="#333333", linewidth=1.0, capsize=3, zorder=3)


@plain_text
def draw_scatter(study: Study, table: pd.DataFrame, path: str | Path) -> Path:
    """Draw where every run collapses against the parameters with the largest swings, by mechanism."""
    factor, unit = _scale(study, table)
    numeric = {p.name for p in study.parameters if p.numeric}
    names = [s.name for s in swings(study, table) if s.name in numeric][:3] or ["run"]
    classes = classes_of(table)
    shown = list(classes)[:MOST_MECHANISMS]
    width = 8.0 if len(names) == 1 else 2.0 + 3.6 * len(names)
    labels = [textwrap.fill(f"{k + 1}: {one} ({classes[one]})", round(13.5 * width)) for k, one in enumerate(shown)]
    lines = len("\n".join(labels).splitlines()) + 2
    figure = Figure(figsize=(width, 4.6 + 0.2 * lines), layout="constrained")
    panels = figure.subplots(1, len(names), sharey=True, squeeze=False)[0]
    y = factor * outcome(table)
    stood = without_collapse(table)
    kind = table["mechanism_class"].to_numpy(dtype=object)
    for axes, name in zip(panels, names, strict=True):
        x = table[name].to_numpy(dtype=float)
        other = np.isfinite(y) & ~stood & ~np.isin(kind, shown)
        axes.scatter(x[other], y[other], s=18, color="#b5b5b5", linewidth=0, zorder=2)
        for k, one in enumerate(shown):
            here = (kind == one) & np.isfinite(y)
            axes.scatter(x[here], y[here], s=24, color=CLASSES[k], marker=MARKS[k], alpha=0.85, linewidth=0, zorder=3)
        if is_single(study):
            order = np.argsort(x)
            axes.plot(x[order], y[order], color="#b5b5b5", linewidth=1.2, zorder=1)
        axes.scatter(x[stood], y[stood], s=26, facecolor="none", edgecolor="#333333", marker="^", zorder=3)
        axes.set_xlabel(name, fontsize=TEXT)
        if not (x % 1.0).any():
            axes.xaxis.set_major_locator(MaxNLocator(integer=True))
        _plain_frame(axes)
    panels[0].set_ylabel(_label(f"{study.capacity.name} at collapse", unit), fontsize=TEXT)
    # Where nothing ever stands all are 0.
    largest = float(np.nanmax(y)) or 1.0
    panels[0].set_ylim(-0.02 * largest, 1.06 * largest)
    handles = [_mark(CLASSES[k], MARKS[k], label) for k, label in enumerate(labels)]
    rest = sum(classes.values()) - sum(classes[one] for one in shown)
    if rest:
        handles.append(_mark("#b5b5b5", "o", f"{counted(len(classes) - len(shown), 'other mechanism')} ({rest})"))
    if stood.any():
        handles.append(_mark("#333333", "^", f"no collapse as far as followed ({int(stood.sum())})", hollow=True))
    figure.legend(handles=handles, loc="outside lower left", frameon=False, fontsize=0.82 * TEXT)
    return saved(figure, path, 150)


@plain_text
def draw_mechanisms(records: StudyFolder, table: pd.DataFrame, path: str | Path) -> Path:
    """Draw one run of each mechanism found, the most frequent first."""
    classes = classes_of(table)
    factor, unit = _scale(records.study, table)
    shown = [one for one in classes if records.shape_file(one).is_file()][:12]
    columns = min(3, max(1, len(shown)))
    rows = -(-len(shown) // columns) if shown else 1
    shapes = []
    for one in shown:
        with np.load(records.shape_file(one)) as stored:
            shapes.append({name: stored[name] for name in stored.files})
    frame = _frame(shapes) if shapes else Frame(np.zeros(2), np.array([1.0, 0.6]))
    tall = float(frame.size[1] / frame.size[0])
    figure = Figure(figsize=(4.0 * columns, (4.0 * min(max(tall, 0.35), 1.6) + 1.0) * rows + 0.3), layout="constrained")
    panels = figure.subplots(rows, columns, squeeze=False).ravel()
    for place, (one, shape) in enumerate(zip(shown, shapes, strict=True)):
        axes = panels[place]
        _draw_shape(axes, shape, frame.low, frame.high)
        median = factor * float(capacity(table)[table["mechanism_class"] == one].median())
        number, part = classes[one], 100 * classes[one] / sum(classes.values())
        runs = counted(number, "run") + (f", {part:.3g} %" if is_sample(records.study) else "")
        share = float(table.loc[table["mechanism_class"] == one, "falling_share"].median())
        title = f"{place + 1}: {runs}; median {_with_unit(median, unit)}"
        if not np.isnan(share):
            percent = f"{100 * share:.2g}" if share < 0.095 else f"{100 * share:.0f}"
            title += f"; {percent} % of the weight fall" + ", a local loss" * (share < LOCAL)
        axes.set_title(textwrap.fill(title, 48), fontsize=0.95 * TEXT, loc="left")
        words = textwrap.wrap(one, 54)[:3]
        axes.text(
            0.0, -0.02, "\n".join(words), transform=axes.transAxes, va="top", fontsize=0.72 * TEXT, color="#4a4a4a"
        )
    for axes in panels[len(shown) :]:
        axes.axis("off")
    if len(classes) > len(shown):
        rest = sum(classes.values()) - sum(classes[one] for one in shown)
        figure.supxlabel(
            f"{counted(len(classes) - len(shown), 'more mechanism')} in {counted(rest, 'run')}", fontsize=0.9 * TEXT
        )
    return saved(figure, path, 150)


def _draw_shape(axes: Axes, shape: dict[str, np.ndarray], low: np.ndarray, high: np.ndarray) -> None:
    fills = np.tile(np.array(palette.STONES[0]), (len(shape["free"]), 1))
    fills = np.where(shape["free"][:, None], fills, palette.SUPPORT).astype(np.uint8)
    fills = palette.part_colours(fills, shape["parts"].astype(int))
    cuts = shape["offsets"][1:-1]
    ghost = [ring for ring, free in zip(np.split(shape["at_rest"], cuts), shape["free"], strict=True) if free]
    axes.add_collection(PolyCollection(ghost, facecolor="none", edgecolor="#cfcfcf", linewidth=0.5, zorder=1))
    fill, rims = (list(shape.get(name, ())) for name in ("fill", "fill_rims"))
    axes.add_collection(PolyCollection(fill, facecolor=palette.hexadecimal(palette.FILL), zorder=0.5))
    axes.add_collection(LineCollection(rims, color=palette.hexadecimal(palette.FILL_RIM), linewidth=1.2, zorder=0.6))
    # Ground that goes on beyond the picture ends before its edge, with an outline.
    inside = shapely.box(*(low + 0.25 * MARGIN * (high - low)), *(high - 0.25 * MARGIN * (high - low)))
    rings, colours = [], []
    for ring, colour, free in zip(np.split(shape["vertices"], cuts), fills, shape["free"], strict=True):
        parts = [ring]
        if not free:
            seen = shapely.get_parts(shapely.intersection(shapely.Polygon(ring), inside))
            parts = [shapely.get_coordinates(part.exterior) for part in seen if isinstance(part, shapely.Polygon)]
        rings += parts
        colours += [colour / 255.0] * len(parts)
    width = 0.7 if len(rings) < 300 else 0.25
    axes.add_collection(
        PolyCollection(
            rings, facecolor=colours, edgecolor=palette.hexadecimal(palette.OUTLINE), linewidth=width, zorder=2
        )
    )
    for ends, state in zip(shape.get("ties", ()), shape.get("tie_states", ()), strict=True):
        if state in COLOURS and state != mechanics.BROKEN:
            dashes = "--" if state == mechanics.SLACK else "-"
            axes.plot(*ends.T, dashes, color=palette.hexadecimal(COLOURS[int(state)]), linewidth=1.8, zorder=3)
    length = 0.09 * float((high - low).max())
    for place, direction in shape.get("arrows", ()):
        axes.annotate(
            "", place + 0.5 * length * direction, place - 0.5 * length * direction, zorder=4,
            arrowprops={"arrowstyle": "-|>", "color": palette.hexadecimal(palette.SETTLEMENT), "linewidth": 2.0,
                        "mutation_scale": 12, "shrinkA": 0, "shrinkB": 0},
        )  # fmt: skip
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    axes.set_aspect("equal")
    axes.axis("off")


def _frame(shapes: Sequence[dict[str, np.ndarray]]) -> Frame:
    """Frame what all tiles show: free blocks and fill, the supports as far as ``SUPPORTS`` beyond, and a margin."""
    inner, outer = [], []
    for shape in shapes:
        free = np.repeat(shape["free"], np.diff(shape["offsets"]))
        inner += [shape["vertices"][free], shape["at_rest"][free], shape.get("fill_rims", np.zeros(0)).reshape(-1, 2)]
        outer += [shape["vertices"][~free]]
    return frame_around(np.concatenate(inner), np.concatenate(outer), MARGIN, SUPPORTS)


def runs_counted(curve: Fragility, table: pd.DataFrame, factor: float, unit: str) -> str:
    """Count the runs, rows that the curve is made of, by how they ended: the title of the fragility curve."""
    collapsed, local, never = ends_counted(table).values()
    words = [counted(curve.n_runs, "run"), f"{collapsed} collapsed" + f" ({local} of a few blocks only)" * (local > 0)]
    if never:
        words.append(f"{never} never stood")
    if curve.n_stood:
        words.append(f"{curve.n_stood} stood (up to {_with_unit(factor * curve.furthest, unit)})")
    words.append(f"{curve.n_broken_off} without result")
    not_built = int((table["status"] == NOT_BUILT).sum())
    return ", ".join(words) + (f"; {not_built} not built are left out" if not_built else "")


def _label(words: str, unit: str) -> str:
    return f"{words} [{unit}]" if unit else words


def _with_unit(value: float, unit: str) -> str:
    return f"{value:.3g} {unit}".rstrip()


def _scale(study: Study, table: pd.DataFrame) -> tuple[float, str]:
    """Factor and unit of where runs collapse: mm for lengths below 1 m."""
    unit = unit_of(study, table)
    largest = float(np.nanmax(np.append(outcome(table), 0.0)))
    return (1e3, "mm") if unit == "m" and largest < 1.0 else (1.0, unit)


def _mark(colour: str, mark: str, label: str, *, hollow: bool = False) -> Line2D:
    face = "none" if hollow else colour
    return Line2D([], [], linestyle="", marker=mark, color=colour, markerfacecolor=face, label=label)


def _plain_frame(axes: Axes) -> None:
    plain_frame(axes, TEXT)
    axes.set_axisbelow(True)
