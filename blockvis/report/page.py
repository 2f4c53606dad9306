"""Report: one self-contained HTML file that plays the mechanism, with the curve, the numbers and the case."""

from __future__ import annotations

import html
import json
import math
import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from string import Template
from typing import Any

import numpy as np
from matplotlib.ticker import MaxNLocator

import solver
from blockvis.dynamics.fall import Fall, falling_increment
from blockvis.kinds.kinds import KINDS
from blockvis.pictures import palette
from blockvis.pictures.backfill import GAPING_IN_PLANE, fill_bodies
from blockvis.pictures.captions import (
    FALL_BADGE,
    badge_of,
    collapse_places,
    drops_at_start,
    failure_text,
    fall_text,
    force_unit,
    in_one_unit,
    loss_words,
    losses_along,
    new_motions,
    parameter_label,
    parameter_unit,
    phase_words,
    shown_range,
    state_text,
    unit_for,
    value_label,
)
from blockvis.pictures.drawer import FEW_BLOCKS
from blockvis.pictures.film import PATH_SECONDS
from blockvis.pictures.marks import STEEPEST, WIDEST
from blockvis.pictures.render import to_show
from blockvis.pictures.swing import MOST_PARTS, Swing, mechanism_colours, shown_increments, swing_of
from blockvis.pictures.ties import DrawnTies
from blockvis.results.about import Result, about, certified, counts_text, governing_limit, loss_of, phases_of
from blockvis.results.cracks import SMALLEST_OPENING, crack_rows, last_cracks
from blockvis.results.joints import initial_joints
from blockvis.results.reaction_range import WORDS, ReactionRange
from blockvis.results.ties import tie_courses, tie_force_curves, tie_texts
from blockvis.system.atomic_files import write_atomic
from blockvis.text import force_text
from solver import mechanics
from solver.mechanics import counted

from .frames import model_of_frames
from .packing import FINENESS, deflated, rounded
from .space import model_in_space

#: Endings of a report.
PAGE_SUFFIXES = (".html", ".htm")

#: Stands in a report for how exact it is, until that is known.
ERROR_UNKNOWN = "<!-- error not known -->"

#: Increments beyond this many are thinned out evenly; the page stays below 2 MB for a thousand blocks. Of more than
#: four thousand blocks fewer are shown, so that poses times blocks stay what a browser can hold.
MOST_FRAMES, MOST_POSES, FEWEST_FRAMES = 160, 640_000, 24

#: Seconds of each frame of a fall without time, and of the pause before a fall.
FALL_SECONDS, PAUSE = 0.06, 0.6

#: How the picture of blocks in space is turned and moved.
TURNING = "the mouse or Shift with the arrows turns the picture, the mouse with Shift moves it"


@dataclass(frozen=True)
class _Frame:
    """A frame of the page: an increment, or a moment of the fall with the time since the last equilibrium [s].

    On the curve it stands at this number of the path.
    """

    increment: solver.Increment
    curve: int
    time: float | None = None

    @property
    def falling(self) -> bool:
        return self.increment.status == solver.Status.FALLING


def write_report(
    response: Result,
    path: str | os.PathLike[str],
    case_text: str = "",
    *,
    title: str = "",
    fall: Fall | None = None,
    error: str = "",
    band: ReactionRange | None = None,
) -> Path:
    """Write the report.

    Parameters
    ----------
    response : solver.Response, solver.LimitLoad or solver.Envelope
    path : path
    case_text : str
        The case file, shown as it is.
    title : str
        Of the page; the name of the case and what happened by default.
    fall : Fall, optional
        What comes after the last equilibrium, in time, instead of the frames without it.
    error : str
        What of and how large, "error of the steps: reaction ± 0.2 %"; :func:`add_error` may say it later.
    band : ReactionRange, optional
        Of the reaction, drawn behind the curve.

    Raises
    ------
    ValueError
        For an ending that is not that of a page.
    """
    if Path(path).suffix.lower() not in PAGE_SUFFIXES:
        raise ValueError(
            f"'{path}' is no page; end its name in {' or '.join(PAGE_SUFFIXES)}, or let 'blockvis report --pdf' print "
            "that of a results folder"
        )
    return write_atomic(path, report_html(response, case_text, title=title, fall=fall, error=error, band=band))


def add_error(path: str | os.PathLike[str], error: str) -> None:
    """Say in a report that has been written how exact it is, in the words of :func:`write_report`."""
    page = Path(path).read_text(encoding="utf-8")
    write_atomic(path, page.replace(ERROR_UNKNOWN, _error(error), 1))


def _error(error: str) -> str:
    return html_rows([error.partition(": ")[::2]]) if error else ERROR_UNKNOWN


def range_rows(band: ReactionRange | None) -> list[tuple[str, str]]:
    """Say what the band behind the curve is."""
    return [] if band is None else [("band behind the curve", f"{counted(band.runs.max(initial=0), 'run')}: {WORDS}")]


def report_html(
    response: Result,
    case_text: str = "",
    *,
    title: str = "",
    fall: Fall | None = None,
    error: str = "",
    band: ReactionRange | None = None,
) -> str:
    """Make the report as HTML text; parameters as those of :func:`write_report`.

    Everything that comes from a file (names, materials, the case) is escaped or goes through ``textContent``; the page
    forbids itself any request.
    """
    response = to_show(response)
    # No "<" may survive in the data: a name with "</script>" in it would end the script.
    origin = about(response)
    model = _model(response, fall, band) | {"name": origin.name}
    data = json.dumps(model, ensure_ascii=True, separators=(",", ":")).replace("<", "\\u003c")
    cracks = _table("Cracks at the last equilibrium", "crack-lines", crack_rows(last_cracks(response), 8))
    failed, in_space = response.stop is solver.Status.SOLVER_FAILED, response.assembly.dimension == 3
    return Template(_part("player.html")).substitute(
        title=html.escape(title or " · ".join(filter(None, (origin.name, headline_of(response))))),
        about=" · ".join(html.escape(part) for part in (origin.file, origin.finished, origin.version) if part),
        failed=f'<p class="failed">{html.escape(failure_text(response))}</p>' if failed else "",
        badge=html.escape(FALL_BADGE if fall is not None else badge_of(response)),
        notes=_notes(response),
        style=_part("player.css"),
        script=_part("player.js").replace("  // SCENE\n", _part("space.js" if in_space else "plane.js")),
        turning=TURNING if in_space else "Shift with the arrows moves the picture",
        summary=html_rows(summary_rows(response, fall)),
        cracks=cracks + _table("Ties and props", "ties", tie_rows(response)),
        certificate=html_rows(certificate_rows(response)),
        error=_error(error) + html_rows(range_rows(band)),
        case=html.escape(case_text or "no case file: the analysis was called from Python"),
        case_open=" open" if case_text else "",
        model=data,
    )


def _part(name: str) -> str:
    """Read a file that the page is made of."""
    return (files("blockvis") / "report" / name).read_text(encoding="utf-8")


def headline_of(response: solver.Response) -> str:
    """Say what happened, in a few words; that the solver failed comes first."""
    words = KINDS[response.analysis].title(response)
    failed = response.stop is solver.Status.SOLVER_FAILED and "failed" not in words
    return f"Solver failed: {words} so far" if failed else words


def _notes(response: solver.Response) -> str:
    """List the notes of the run."""
    items = "".join(f"<li>{html.escape(note)}</li>" for note in dict.fromkeys(response.notes))
    return f'<h2>Notes</h2><ul id="notes">{items}</ul>' if items else ""


def _table(title: str, name: str, rows: Sequence[Sequence[str]]) -> str:
    """Write a table under a title; nothing where it has no rows."""
    return f'<h2>{title}</h2><table id="{name}">{html_rows(rows)}</table>' if rows else ""


def tie_rows(response: solver.Response) -> list[tuple[str, str, str]]:
    """List name and kind of ties, their largest forces and where, and what became of them."""
    return [tie_texts(course, response) for course in tie_courses(response)]


def _frames_of(response: solver.Response, swing: Swing, fall: Fall | None) -> list[_Frame]:
    """Choose what the page shows: the path, thinned where it is long, and the fall.

    The state at which the mechanism begins has the hinges and sliding joints of that, as pictures and films do.
    """
    most = max(FEWEST_FRAMES, min(MOST_FRAMES, MOST_POSES // response.assembly.n_blocks))
    path, governing = response.path, response.governing
    place = {id(increment): k for k, increment in enumerate(path)}

    def framed_at(increment: solver.Increment) -> _Frame:
        begins = increment is swing.begins
        return _Frame(swing.increment if begins else increment, place.get(id(increment), len(path)))

    if fall is None or not path:
        return [framed_at(increment) for increment in _thinned(shown_increments(response), most, governing)]
    n = min(len(fall) - 1, most // 2)
    chosen = np.linspace(len(fall) - 1, 1, n).round().astype(int)[::-1]
    falling = [
        _Frame(falling_increment(response, fall, float(fall.times[k])), len(path), float(fall.times[k]))
        for k in chosen.tolist()
    ]
    return [*map(framed_at, _thinned(path, most - n, governing)), *falling]


def _model(response: solver.Response, fall: Fall | None, band: ReactionRange | None) -> dict[str, Any]:
    assembly = response.assembly
    swing = swing_of(response)
    frames = _frames_of(response, swing, fall)
    shown = [frame.increment for frame in frames]
    if assembly.dimension == 3:
        own = model_in_space(response, swing, shown)
    else:
        own = _model_in_plane(response, shown, None if fall is None else fall.ground)
    n_static = sum(frame.time is None for frame in frames)
    roles = {role: number for number, role in enumerate(mechanics.ROLES)}
    if not response.settlements:
        # Supports for moving hold the others where nothing settles.
        roles[mechanics.MOVING] = roles[mechanics.FIXED]
    fills = palette.block_colours(assembly.materials, assembly.free)
    return own | {
        "space": assembly.dimension == 3,
        "turn_unit": FINENESS,
        "block_size": assembly.block_size,
        "smallest_opening": SMALLEST_OPENING * assembly.block_size,
        "widest": [WIDEST * assembly.block_size, STEEPEST],
        "names": list(assembly.names),
        "materials": list(assembly.materials),
        "roles": [roles[str(role)] for role in assembly.roles],
        "fills": list(map(palette.hexadecimal, fills)),
        "tints": list(map(palette.hexadecimal, mechanism_colours(assembly, fills, swing))) if swing.moves else [],
        "tints_words": _tints_text(response, swing),
        "moving": int(np.argmax(swing.parts >= 0)),
        "ramp": list(map(palette.hexadecimal, palette.RAMP)),
        # Dots of hinges and lines of sliding joints are off until asked for: they hide the cracks.
        "many": assembly.n_blocks > FEW_BLOCKS,
        "colours": {
            name: palette.hexadecimal(getattr(palette, name.upper()))
            for name in (
                "ink", "outline", "support", "moving", "hatch", "open", "sliding", "force", "hinge", "settlement",
                "crushing", "warning", "lost",
            )
        },
        "frames": _frames(response, frames),
        "opens": next((k for k, frame in enumerate(frames) if frame.increment is swing.increment), n_static - 1),
        "ties": list(map(DrawnTies(response).told, shown)),
        "times": _times(frames),
        # In a fall in time blocks part and meet anew: what lay between two of them is no joint any more.
        "joints_of_fall": fall is None,
        "curve": _curve(response, band),
        "tie_curves": _tie_curves(response),
    }  # fmt: skip


def _model_in_plane(response: solver.Response, shown: list[solver.Increment], ground: float | None) -> dict[str, Any]:
    """Pack what only blocks in the plane have: joints as lines, the ground of a fall."""
    assembly = response.assembly
    joints = initial_joints(assembly)
    tied = DrawnTies(response).ends([shown[0].pose, shown[-1].pose])
    heads = fill_bodies(response, solver.Pose.initial(assembly)).heads.reshape(-1, 2)
    model = model_of_frames(response, joints, shown, np.concatenate([tied, heads]))
    origin, unit = np.array(model["origin"]), model["unit"]
    extent = float(np.subtract(model["bounds"][2:], model["bounds"][:2]).max())
    own = {
        "offsets": deflated(assembly.offsets),
        "joint_ends": deflated(rounded(joints.ends - origin, unit)),
    }
    return model | {
        "ground": None if ground is None else float(ground - origin[1]),
        "fill": _fill(response, shown, origin, 0.1 * extent),
        "packed": model["packed"] | own,
    }


def _fill(
    response: solver.Response, shown: list[solver.Increment], origin: np.ndarray, longest: float
) -> dict[str, Any] | None:
    """Give the pieces of blocks under fill, which carry it as they move, with the law of its load; None without fill.

    A piece has its block, its ends, the surface and the base [m], thickness times unit weight [N/m²], the pressure
    coefficient.
    """
    fills = response.loads.fills
    if not fills:
        return None
    pieces: list[list[float]] = []
    for fill in fills:
        assert fill.thickness is not None
        ends = np.round(fill.pieces - origin, 5)
        weights = fill.unit_weight * fill.thickness
        for block, (first, last), weight in zip(fill.block.tolist(), ends.tolist(), weights.tolist(), strict=True):
            surface, base = (round(float(level - origin[1]), 5) for level in (fill.surface, max(fill.base, -1e9)))
            pieces.append([block, *first, *last, surface, base, weight, fill.pressure_coefficient])
    largest = max(float(np.abs(fill.load(response.assembly, shown[0].pose)[:, :2]).max()) for fill in fills)
    return {
        "pieces": pieces,
        "scale": longest / (largest or 1.0),
        "gaping": GAPING_IN_PLANE * float(np.ptp(np.concatenate([fill.pieces for fill in fills]), axis=(0, 1)).max()),
        "words": f"load of the fill, {force_text(largest)} on a block at most",
        "colours": [palette.hexadecimal(c) for c in (palette.FILL, palette.FILL_HATCH, palette.FILL_RIM)],
    }


def _tints_text(response: solver.Response, swing: Swing) -> str:
    """Say what the colours of the mechanism mean."""
    whose = "" if response.parameter.is_path else " of the lowest state"
    if swing.n_parts <= MOST_PARTS:
        return f"parts of the mechanism{whose}"
    return f"mechanism{whose}, darker where faster"


def _thinned(
    increments: tuple[solver.Increment, ...], most: int, governing: solver.Increment | None
) -> list[solver.Increment]:
    """All increments, or an even choice of at most so many, with the one that governs kept."""
    if len(increments) <= most:
        return list(increments)
    kept = next((k for k, increment in enumerate(increments) if increment is governing), 0)
    chosen = np.unique([*np.linspace(0, len(increments) - 1, most - 1).round().astype(int), kept])
    return [increments[k] for k in chosen]


def _frames(response: solver.Response, shown: list[_Frame]) -> list[dict[str, Any]]:
    frames = []
    for frame in shown:
        increment = frame.increment
        if frame.time is not None:
            caption = f"{fall_text(response)}   ·   {frame.time:.2f} s"
        else:
            words = *phase_words(response, increment), *loss_words(increment)
            caption = "  ·  ".join([state_text(increment, response), *words])
        phase = min(increment.phase, max(len(phases_of(response)) - 1, 0))
        caption = caption.replace("   ·   ", "  ·  ")
        told = {"caption": caption, "falling": frame.falling, "curve": frame.curve, "phase": phase}
        fell_at = increment.state.fell_at
        gone, lost = (np.flatnonzero(of).tolist() for of in (~np.isnan(fell_at), np.isfinite(fell_at)))
        frames.append({**told, "gone": gone, "lost": lost})
    return frames


def _times(shown: list[_Frame]) -> list[float]:
    """Seconds at which each frame plays: even settlement, a pause, the fall in its own time where it has one."""
    path = mechanics.path_parameters([frame.increment for frame in shown if not frame.falling])
    path = path - path[:1]
    total = float(path[-1]) if len(path) and path[-1] > 0 else 1.0
    times: list[float] = []
    for k, frame in enumerate(shown):
        if k < len(path):
            times.append(max(PATH_SECONDS * float(path[k]) / total, times[-1] + 0.02 if times else 0.0))
        elif frame.time is not None:
            times.append(times[len(path) - 1] + PAUSE + frame.time)
        else:
            step = PAUSE if k == len(path) and times else FALL_SECONDS
            times.append((times[-1] + step) if times else 0.0)
    return [round(t, 4) for t in times]


def _curve(response: solver.Response, band: ReactionRange | None) -> dict[str, Any]:
    before, response = len(response.path), in_one_unit(response)
    per_length, _ = parameter_unit(response)
    factor, _ = force_unit(response)
    x = response.parameters * per_length
    y = response.values / factor
    low, high = shown_range(y, response)
    total, least, most = (np.zeros(0),) * 3 if band is None else band.along(response)
    total, least, most = total * per_length, least / factor, most / factor
    low, high = min(low, float(least.min(initial=0.0))), max(high, float(most.max(initial=0.0)))
    high = high + 0.08 * (high - low) if high > low else 1.0
    bracket = collapse_places(response)
    collapse = None if bracket is None else float(bracket[1])
    first = min(0.0, float(x.min(initial=0.0))) * 1.02
    widest = max([float(x.max(initial=0.0)), collapse or 0.0, float(total.max(initial=0.0))]) * 1.02 or 1.0

    return {
        # Frames before this one are of phases in another unit.
        "first": before - len(response.path) if len(phases_of(response)) > 1 else 0,
        "settlement": _told(x),
        "reaction": _told(y),
        # The reaction leaves that at rest at once: the way to the next one is dotted.
        "rest": drops_at_start(response),
        # From these on it is along another motion.
        "breaks": new_motions(response),
        # Rows that blocks were lost before, and where.
        "losses": [[row, float(f"{place:.7g}")] for row, place, _ in losses_along(response)],
        "band": list(map(_told, zip(total, least, most, strict=True))),
        "collapse": collapse,
        "x_min": first,
        "x_max": widest,
        "y_min": low,
        "y_max": high,
        "x_ticks": _ticks(first, widest, 5),
        "y_ticks": _ticks(low, high, 5),
        "x_label": parameter_label(response),
        "y_label": value_label(response),
        # One limit load has no path: it is drawn as a rigid-plastic diagram.
        "single": not response.parameter.is_path and len(response.path) == 1,
    }


def _tie_curves(response: solver.Response) -> dict[str, Any] | None:
    """Give forces of ties over the settlement, in the places of the curve above; None where there are no ties."""
    response = in_one_unit(response)
    found = tie_force_curves(response) if response.parameter.is_path else None
    if found is None:
        return None
    factor, unit = unit_for(float(np.nan_to_num(np.abs(found.forces)).max(initial=0.0)))
    forces = found.forces / factor
    low, high = min(0.0, float(np.nanmin(forces))), max(0.0, float(np.nanmax(forces)))
    margin = 0.08 * (high - low) or 1.0
    return {
        "y_label": f"ties, tension + [{unit}]",
        "y_min": low - margin * (low < 0.0),
        "y_max": high + margin,
        "y_ticks": _ticks(low - margin, high + margin, 4),
        "lines": [
            {"name": name, "colour": palette.hexadecimal(shade), "force": _told(force)}
            for name, shade, force in zip(found.names, palette.TIE_SHADES, forces.T, strict=False)
        ],
    }


def _told(values: Iterable[float]) -> list[float | None]:
    """Round values (n,) to what a curve shows; None where there is none or it is infinite."""
    return [float(f"{v:.7g}") if math.isfinite(v) else None for v in values]


def _ticks(low: float, high: float, n: int) -> list[float]:
    return [float(f"{t:.6g}") for t in MaxNLocator(n).tick_values(low, high) if low <= t <= high]


def summary_rows(response: solver.Response, fall: Fall | None = None) -> list[tuple[str, str]]:
    """Sum up a response in words and numbers with their units."""
    assembly, path = response.assembly, response.path
    limit = governing_limit(response) if response.swings else None
    # That a limit load is found is no collapse that has happened.
    status = str(response.stop if limit is None else limit.status)
    if limit is not None and limit.status is solver.LimitStatus.FOUND:
        status = "limit load found"
    if path and response.parameter.is_path:
        status = ", ".join([status, *loss_words(path[-1])])
    rows = [("analysis", response.analysis), ("status", status), *KINDS[response.analysis].rows(response)]
    apart = len(response.increments) - len(path)
    loss = loss_of(response)
    if loss is not None:
        rows.append(
            ("falls", f"{force_text(loss.weight)} = {loss.share:.4f} W{', a local loss' if loss.local else ''}")
        )
    swing = swing_of(response) if path else None
    if swing is not None and swing.moves:
        fails = response.collapse is not None or response.swings
        counted = counts_text(mechanics.mechanism_of(assembly, swing.increment)) or "of supports alone"
        rows.append(("mechanism" if fails else "motion that would follow", counted))
    follows = f", {apart} {'of pseudo-motion' if response.swings else 'falling'}" if apart and fall is None else ""
    rows += [
        ("weight W", force_text(response.total_weight)),
        *((f"fill up to {fill.surface:g} m", force_text(fill.weight(assembly))) for fill in response.loads.fills),
        ("blocks", f"{assembly.n_blocks} ({int(assembly.free.sum())} free)"),
        *([("contact points", str(len(path[-1].contacts)))] if path else []),
        ("increments", f"{len(path)} in equilibrium{follows}"),
        ("solver time", f"{sum(i.seconds for i in response.increments):.1f} s"),
    ]
    if response.message and response.collapse is None:
        rows.append(("message", response.message))
    return rows


def certificate_rows(response: solver.Response) -> list[tuple[str, str]]:
    """List the largest residuals of all equilibria, or of the position that governs, in words and with their units."""
    worst = mechanics.worst_of(i.certificate for i in certified(response) or response.increments)
    if worst is None:
        return []
    rows = [
        ("largest unbalanced force / total load", worst.equilibrium_residual, ""),
        ("largest shear force beyond friction / total load", worst.friction_excess, ""),
        ("widest gap that carries", worst.carrying_gap, " m"),
        ("deepest overlap", worst.largest_penetration, " m"),
        ("lower and upper bound differ by", worst.duality_gap, ""),
        ("energy not accounted for / work", worst.energy_residual, ""),
        ("mechanism against friction / its movement", worst.kinematic_violation, ""),
    ]
    return [(name, f"{value:.1e}{unit}") for name, value, unit in rows if math.isfinite(value)]


def html_rows(rows: Iterable[Sequence[str]]) -> str:
    """Write the rows of a table as HTML."""
    return "".join(f"<tr>{''.join(f'<td>{html.escape(cell)}</td>' for cell in row)}</tr>" for row in rows)
