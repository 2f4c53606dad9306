"""Captions: what the path runs over and what is read along it, in words and units."""

from __future__ import annotations

import numpy as np

import solver
from blockvis.numbers import force_text
from blockvis.results.quantities import POSITION, governing, parameter_word, reads_multipliers

#: Multipliers above this many times the lowest of an envelope are not shown: over a support a load may grow nearly
#: without limit.
MOST_OVER_LOWEST = 8.0


def parameter_unit(response: solver.Response) -> tuple[float, str]:
    """Factor and unit in which the parameter reads well."""
    unit = response.settlements[0].unit if response.settlements else "m"
    largest = max((abs(i.settlement) for i in response.increments), default=0.0)
    millimetres = unit == "m" and 0.0 < largest < 0.1 and parameter_word(response) != POSITION
    return (1e3, "mm") if millimetres else (1.0, unit)


def parameter_text(value: float, response: solver.Response) -> str:
    """A parameter with its unit, in mm where the whole response stays below a decimetre.

    Parameters
    ----------
    value : float [m or rad]
    response : solver.Response
    """
    factor, unit = parameter_unit(response)
    return f"{value * factor:.2f} {unit}" if unit == "mm" else f"{value * factor:.4f} {unit}"


def parameter_label(response: solver.Response) -> str:
    """For the axis of a diagram; empty for a single limit load, which has none."""
    word = parameter_word(response)
    if word == POSITION and len(response.path) == 1:
        return ""
    return f"{word}{' x' if word == POSITION else ''} [{parameter_unit(response)[1]}]"


def force_unit(response: solver.Response) -> tuple[float, str]:
    """What to divide :func:`path_values` by, and the unit; a multiplier has none."""
    if reads_multipliers(response):
        return 1.0, ""
    largest = max((abs(i.reaction) for i in response.path), default=0.0)
    moment = "·m" if response.settlements and response.settlements[0].unit == "rad" else ""
    for factor, unit in ((1e6, "MN"), (1e3, "kN")):
        if largest >= factor:
            return factor, unit + moment
    return 1.0, "N" + moment


def value_label(response: solver.Response) -> str:
    """For the axis of a diagram."""
    return "load multiplier α" if reads_multipliers(response) else f"reaction [{force_unit(response)[1]}]"


def matters(increment: solver.Increment, response: solver.Response) -> bool:
    """Whether an increment is in equilibrium and, of limit loads at several positions, not far above the lowest."""
    if increment.status == solver.Status.FALLING:
        return False
    lowest = governing(response)
    if lowest is None or parameter_word(response) != POSITION or not lowest.load_multiplier > 0.0:
        return True
    return increment.load_multiplier <= MOST_OVER_LOWEST * lowest.load_multiplier


def state_text(increment: solver.Increment, response: solver.Response, at: float | None = None) -> str:
    """The first line of a caption: the parameter and what is read there.

    Parameters
    ----------
    increment : solver.Increment
    response : solver.Response
    at : float, optional [m or rad]
        The parameter, of frames in between increments.
    """
    place = parameter_text(increment.settlement if at is None else at, response)
    falling = increment.status == solver.Status.FALLING
    if not reads_multipliers(response):
        text = f"Settlement {place}"
        if falling:
            return text
        moment = response.settlements[min(increment.phase, len(response.settlements) - 1)].unit == "rad"
        text += f"   ·   Reaction {force_text(increment.reaction, moment)}"
        return text if moment else text + f" = {increment.reaction / response.total_weight:.4f} W"
    if parameter_word(response) == POSITION:
        text = f"Load at x = {place}" if len(response.path) > 1 else "Limit load"
    else:
        text = f"{parameter_word(response).capitalize()} {place}"
    if falling and response.analysis == "pushover":
        return text
    if not np.isfinite(increment.load_multiplier):
        return f"{text}   ·   Load multiplier α unbounded"
    text += f"   ·   Load multiplier α = {increment.load_multiplier:.5g}"
    return text + (f"   ·   Live load {force_text(increment.reaction)}" if increment.reaction else "")


def badge_of(response: solver.Response) -> str:
    """The warning on frames that are no equilibrium."""
    swung = response.analysis == "limit load" and response.collapse is None and bool(response.path)
    return "MECHANISM · pseudo-motion" if swung else "FALLING · pseudo-time"
