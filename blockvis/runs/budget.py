"""How long an increment may take, and what is said of one that takes longer."""

from __future__ import annotations

import time
from collections.abc import Callable

from solver import mechanics


class IncrementTooLong(Exception):
    """An increment has taken longer than it may; the message says what it was doing."""


class Budget:
    """The time that each increment of a path may take, looked at after every step.

    Parameters
    ----------
    seconds : float, optional [s]
        By default increments take as long as they take.
    doing : callable
        From the state after a step to words.
    """

    def __init__(self, seconds: float | None, doing: Callable[[mechanics.PathState], str]) -> None:
        self._seconds, self._doing = seconds, doing
        self._began = time.perf_counter()

    def next(self) -> None:
        """Begin the time of the next increment."""
        self._began = time.perf_counter()

    def step(self, state: mechanics.PathState) -> None:
        """Look at the time after a step.

        Raises
        ------
        IncrementTooLong
            Where it is used up.
        """
        if self._seconds is not None and time.perf_counter() - self._began > self._seconds:
            raise IncrementTooLong(
                f"an increment took more than {self._seconds:g} s (increment_seconds): {self._doing(state)}"
            )
