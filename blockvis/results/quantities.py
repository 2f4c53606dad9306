"""What the path of a response runs over and what is read along it."""

from __future__ import annotations

import numpy as np

import solver

#: The word for what the limit loads of a load that moves run over.
POSITION = "load position"


def reads_multipliers(response: solver.Response) -> bool:
    """Whether what is read along the path is a load multiplier, not the reaction of a support."""
    return response.analysis != "settlement"


def parameter_word(response: solver.Response) -> str:
    """What the path runs over: "settlement", "control displacement" or "load position"."""
    if response.analysis == "pushover":
        return "control displacement"
    if response.analysis == "limit load" and not response.settlements:
        return POSITION
    return "settlement"


def path_parameters(path: tuple[solver.Increment, ...]) -> np.ndarray:
    """(n,) array [m or rad]: the parameter, settlements of several phases one after another."""
    total, before, last = np.zeros(len(path)), 0.0, 0.0
    for k, increment in enumerate(path):
        if k and increment.phase != path[k - 1].phase:
            before = last
        last = total[k] = before + increment.settlement
    return total


def path_values(response: solver.Response) -> np.ndarray:
    """(n,) array: the load multiplier, nan where unbounded, or the reaction [N or N·m] along the path."""
    if not reads_multipliers(response):
        return response.reaction
    multipliers = response.load_multiplier
    return np.where(np.isfinite(multipliers), multipliers, np.nan)


def governing(response: solver.Response) -> solver.Increment | None:
    """The increment that decides: of limit loads at several positions the lowest, else the last in equilibrium."""
    path = response.path
    if not path:
        return None
    if parameter_word(response) != POSITION:
        return path[-1]
    return path[int(np.argmin(np.nan_to_num(response.load_multiplier, nan=-np.inf, posinf=np.inf)))]
