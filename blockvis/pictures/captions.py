"""Captions: the parameter of an analysis and what is measured along it, in words and units."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

import solver
from blockvis.dynamics.fall import CAPTION
from blockvis.results.about import after_settlements, collapse_phase, least_reaction, loss_of, phases_of, told_reaction
from blockvis.text import PREFIXES, force_text, padded_text
from solver import mechanics

#: Warning on frames of a fall in real time.
FALL_BADGE = "FALLING · real time"

#: Warning on blocks that are drawn where a mechanism takes them.
MECHANISM_BADGE = "MECHANISM · pseudo-motion"

#: Warning on pictures of runs that the solver could not follow to their end.
FAILED_BADGE = "SOLVER FAILED"

#: Multipliers above this many times the lowest of an envelope are not shown: over a support a load may grow nearly
#: without limit.
MOST_OVER_LOWEST = 8.0

#: Drop of the reaction from that at rest, as a part of the largest, that is seen in a curve.
NOTABLE = 0.05


def left_rest(response: solver.Response, row: int = 0) -> float:
    """Find what is measured as soon as anything moves after a row of the path, which is not what the row has at rest.

    Equilibrium leaves the reaction at rest open, and a first movement takes it to the least, or near. Where joints or
    the ground give, nothing tells how it gets to the next row: that is taken, and nan for a multiplier, whose first one
    is that of rigid joints.
    """
    rest = response.path[row]
    if row == len(response.path) - 1 or not response.parameter.is_path or rest.parameter != 0.0:
        return rest.measured
    if not response.measured.is_force:
        return np.nan if response.interfaces.elastic else rest.measured
    # Increments by linear program have no reaction at rest, and no upper bound.
    if np.isnan(rest.largest):
        return rest.measured
    return response.path[row + 1].measured if response.interfaces.elastic else least_reaction(rest)


def drops_at_start(response: solver.Response) -> bool:
    """Whether the reaction, or the multiplier, leaves that at rest at once, not along a line, and by so much."""
    if not response.path or not np.isfinite(response.path[0].measured):
        return False
    left = left_rest(response)
    return bool(np.isnan(left) or abs(left - response.path[0].measured) > NOTABLE * np.abs(response.values).max())


def new_motions(response: solver.Response) -> list[int]:
    """Rows of the path from which on supports move otherwise than before: the reaction is along their motion.

    A multiplier is that of the live load, however supports move.
    """
    settlements = phases_of(response) * response.measured.is_force
    motions = [replace(given, increment=1.0, limit=1.0, tolerance=None, stops=()) for given in settlements]
    phases = [increment.phase for increment in response.path]
    return [k for k in range(1, len(phases) if motions else 0) if motions[phases[k - 1]] != motions[phases[k]]]


def losses_along(response: solver.Response) -> list[tuple[int, float, int]]:
    """List where blocks are lost along a path: the row that first lacks them, the place on the axis, and how many."""
    # What is lost stays lost, and reading all increments may take long.
    if not np.isfinite(response.increments[-1].state.fell_at).any():
        return []
    path, total, found = response.path, response.parameters, []
    per_length = parameter_unit(response)[0]
    fell = [increment.state.fell_at for increment in path]
    for k in range(1, len(path)):
        new = np.isfinite(fell[k]) & (np.isnan(fell[k - 1]) if len(fell[k - 1]) else True)
        if new.any():
            at = total[k] - path[k].parameter + float(fell[k][new].min())
            found.append((k, per_length * float(np.clip(at, total[k - 1], total[k])), int(new.sum())))
    return found


def in_one_unit(response: solver.Response, phase: int | None = None) -> solver.Response:
    """Leave out the phases that another unit parts from a given one: distances and rotations share no axis.

    That is the last phase with an increment by default.
    """
    units = [settlement.unit for settlement in phases_of(response)]
    if len(set(units)) < 2 or not response.increments:
        return response
    phase = min(response.increments[-1].phase if phase is None else phase, len(units) - 1)
    first = last = phase
    while first > 0 and units[first - 1] == units[phase]:
        first -= 1
    while last < len(units) - 1 and units[last + 1] == units[phase]:
        last += 1
    return replace(
        response,
        increments=tuple(i for i in response.increments if first <= i.phase <= last),
        parameter=mechanics.settlement_in(units[phase]),
        measured=mechanics.reaction_to(units[phase]),
    )


def parameter_unit(response: solver.Response) -> tuple[float, str]:
    """Factor and unit in which the parameter reads well."""
    parameter = response.parameter
    millimetres = parameter.unit == "m" and 0.0 < _largest_parameter(response) < 0.1 and parameter.is_path
    return (1e3, "mm") if millimetres else (1.0, parameter.unit)


def _largest_parameter(response: solver.Response) -> float:
    return max((abs(i.parameter) for i in response.increments), default=0.0)


def parameter_text(value: float, response: solver.Response) -> str:
    """Write a parameter [m or rad] with its unit, in mm where the whole response stays below a decimetre.

    All of a response have as many decimals, of which the largest has three digits at least.
    """
    factor, unit = parameter_unit(response)
    power = int(np.floor(np.log10(factor * _largest_parameter(response) or 1.0)))
    return f"{value * factor:.{max(2 if unit == 'mm' else 4, 2 - power)}f} {unit}"


def parameter_label(response: solver.Response) -> str:
    """Label of the axis of the parameter; empty for a single state, which has no path."""
    parameter = response.parameter
    if parameter.is_path:
        added = ", all phases added" if len({increment.phase for increment in response.path}) > 1 else ""
        return f"{parameter.name}{added} [{parameter_unit(response)[1]}]"
    return f"{parameter.name} {parameter.symbol} [{parameter.unit}]" if len(response.path) != 1 else ""


def force_unit(response: solver.Response) -> tuple[float, str]:
    """Divisor and unit in which the measured values read well; a multiplier has no unit."""
    unit = response.measured.unit
    if not response.measured.is_force:
        return 1.0, unit
    return unit_for(max((abs(i.measured) for i in response.path), default=0.0), unit)


def unit_for(largest: float, unit: str = "N") -> tuple[float, str]:
    """Divisor and unit in which values up to a largest one [N or N·m] read well."""
    # Axes end with mega.
    return next((factor, prefix + unit) for factor, prefix in PREFIXES[1:] if largest >= factor or factor == 1.0)


def value_label(response: solver.Response) -> str:
    """Label of the axis of the measured value."""
    unit = force_unit(response)[1]
    return f"{response.measured.name} [{unit}]" if unit else f"{response.measured.name} {response.measured.symbol}"


def shown_range(values: np.ndarray, response: solver.Response) -> tuple[float, float]:
    """Range of the axis of the measured value: 0, and the values but those far above the lowest of an envelope.

    At least half of them are shown. The values (n,) of the path are in the unit of the axis, nan or infinite where
    there are none.
    """
    known = values[np.isfinite(values)]
    low, high = min(0.0, float(known.min(initial=0.0))), max(0.0, float(known.max(initial=0.0)))
    if not response.parameter.is_path and len(known):
        most = MOST_OVER_LOWEST * max(float(known.min()), 0.0)
        high = min(high, max(most, float(np.median(known)))) if most else high
    return low, high


def collapse_places(response: solver.Response) -> np.ndarray | None:
    """(3,) array: lower end, middle and upper end of the bracket of a collapse on the axis of the parameter.

    In the unit of the axis, behind the phases before the last; None without a collapse or an equilibrium before it.
    """
    collapse, path = response.collapse, response.path
    if collapse is None or not path:
        return None
    per_length, _ = parameter_unit(response)
    begun = path[-1].parameter if collapse_phase(response) == path[-1].phase else 0.0
    start = per_length * (response.parameters[-1] - begun)
    return start + per_length * np.array([collapse.bracket[0], collapse.displacement, collapse.bracket[1]])


def matters(increment: solver.Increment, response: solver.Response) -> bool:
    """Whether an increment is in equilibrium and, of states that stand by themselves, not far above the lowest."""
    if increment.status == solver.Status.FALLING:
        return False
    lowest = response.governing
    if lowest is None or response.parameter.is_path or not lowest.measured > 0.0:
        return True
    return increment.measured <= MOST_OVER_LOWEST * lowest.measured


def state_text(increment: solver.Increment, response: solver.Response, beside: solver.Response | None = None) -> str:
    """Write the first line of a caption: the parameter, in the unit of a response beside it, and what is measured."""
    response = in_one_unit(response, increment.phase)
    place = parameter_text(increment.parameter, beside or response)
    if response.parameter.is_path:
        text = f"{response.parameter.name.capitalize()} {place}"
    else:
        text = f"Load at {response.parameter.symbol} = {place}" if len(response.path) > 1 else "Limit load"
    # Frames that swing show the state from which they start, frames of a fall none.
    if increment.status == solver.Status.FALLING and not response.swings:
        return text
    return f"{text}   ·   {_value_text(increment, response)}"


def _value_text(increment: solver.Increment, response: solver.Response) -> str:
    measured = response.measured
    name = measured.name.capitalize()
    if np.isnan(increment.measured):
        return f"{name} –"
    if measured.is_force:
        moment = measured.unit == "N·m"
        force = told_reaction(increment.measured, response, moment)
        text = f"{name} {force_text(force, moment, padded=True)}"
        return text if moment else f"{text} = {force / response.total_weight:.4f} W"
    if not np.isfinite(increment.measured):
        return f"{name} {measured.symbol} unbounded"
    text = f"{name} {measured.symbol} = {padded_text(increment.measured, 5)} {measured.unit}".rstrip()
    live = increment.reaction if measured == mechanics.LOAD_MULTIPLIER else 0.0
    return text + (f"   ·   Live load {force_text(live, padded=True)}" if live else "")


def badge_of(response: solver.Response) -> str:
    """Warning on frames that are no equilibrium."""
    return MECHANISM_BADGE if response.swings else "FALLING · pseudo-time"


def fall_text(response: solver.Response) -> str:
    """Say how a fall was followed, and without what."""
    fill = ["fill weighs on, not shown"] if response.loads.fills else []
    return "   ·   ".join([CAPTION, *fill])


def lost_text(response: solver.Response) -> str:
    """Name what a collapse is: of the structure, of a few blocks, or of what a pushover loses."""
    if response.collapse is not None and response.collapse.lost == "capacity":
        return "capacity is lost"
    if response.collapse is not None and response.control is not None:
        return "equilibrium is lost along the control"
    loss = loss_of(response)
    return "a local loss" if loss is not None and loss.local else "collapse"


def failure_text(response: solver.Response) -> str:
    """Say where the solver failed and why; empty where it did not."""
    if response.stop is not solver.Status.SOLVER_FAILED:
        return ""
    where, here = "", in_one_unit(response)
    if here.path and here.parameter.is_path:
        where = f" after {here.parameter.name} {parameter_text(here.path[-1].parameter, here)}"
    return f"The solver failed{where}: {response.message}" if response.message else f"The solver failed{where}"


def caption_of(response: solver.Response, increment: solver.Increment, magnification: float) -> tuple[str, str]:
    """First and second line of a caption: what is true of the increment, in frames between two of the one before."""
    parts = [_state(response, increment), *phase_words(response, increment)]
    if not _swings_out(response, increment):
        parts.append("true scale" if magnification == 1.0 else f"displacements × {magnification:g}")
    parts.append(f"W = {force_text(response.total_weight)}")
    return state_text(increment, response), "   ·   ".join([*parts, *loss_words(increment)])


def loss_words(increment: solver.Increment) -> list[str]:
    """Say how many blocks have been taken away, and how many the structure has lost, by an increment that stands."""
    if increment.status == solver.Status.FALLING:
        return []
    removed = int(increment.removed.sum())
    counts = ((removed, "taken away"), (int(increment.fallen.sum()) - removed, "lost"))
    return [f"{mechanics.counted(count, 'block')} {fate}" for count, fate in counts if count]


def phase_words(response: solver.Response, increment: solver.Increment) -> list[str]:
    """Say in which of several settlements an increment is, whose parameter counts from there, or after which it is."""
    number = len(phases_of(response))
    words = f"phase {increment.phase + 1} of {number}" if number > 1 else after_settlements(response)
    return [words] if words else []


def _swings_out(response: solver.Response, increment: solver.Increment) -> bool:
    """Whether a frame is one of a mechanism without scale: of a limit load, or made for want of frames of the fall."""
    made = all(increment is not one for one in response.increments)
    return increment.status == solver.Status.FALLING and (made or response.swings)


def _state(response: solver.Response, increment: solver.Increment) -> str:
    if increment.status == solver.Status.FALLING:
        if response.swings:
            return "pseudo-motion: the mechanism at the limit load, followed to first order and out of scale"
        if _swings_out(response, increment):
            return "no equilibrium: the mechanism, followed to first order and out of scale"
        return "no equilibrium: the mechanism followed step by step"
    if response.limits:
        lowest, several = response.governing, len(response.path) > 1 and not response.parameter.is_path
        decides = several and lowest is not None and lowest.parameter == increment.parameter
        state = "limit state" if np.isfinite(increment.measured) else "equilibrium under the dead load"
        words = f"{state}, {response.limits[0].flow} friction"
        return words + (f"   ·   the lowest of {len(response.path)} positions" if decides else "")
    last = response.path[-1]
    if (increment.phase, increment.parameter) == (last.phase, last.parameter):
        if response.stop == solver.Status.COLLAPSED:
            return f"last equilibrium before {lost_text(response)}"
        if response.stop == solver.Status.SOLVER_FAILED:
            return "last equilibrium found before the solver failed"
    return "equilibrium"
