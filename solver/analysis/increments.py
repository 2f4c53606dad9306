"""The increments of an analysis, one by one, and then how it ended."""

from __future__ import annotations

import time
from collections.abc import Callable, Generator, Iterator
from dataclasses import replace

from solver.path.controls import Ending
from solver.programs.threads import one_thread
from solver.results.increment import Increment


class Increments(Iterator[Increment]):
    """The increments of an analysis, found one by one with the seconds that each took, and then how it ended.

    Steps yield each and return the ending; ``changed`` makes of an increment as it is found the one that is given.
    """

    def __init__(
        self, steps: Generator[Increment, None, Ending], changed: Callable[[Increment], Increment] | None = None
    ) -> None:
        self._steps, self._changed = steps, changed
        self._first: Increment | None = None
        self._ending: Ending | None = None

    def __next__(self) -> Increment:
        """Find the next increment."""
        if self._first is not None:
            first, self._first = self._first, None
            return first
        started = time.perf_counter()
        try:
            # Of several threads all but one wait by counting, on a core that another process could have.
            with one_thread():
                found = next(self._steps)
        except StopIteration as stop:
            # What it stops with again after its end is nothing.
            self._ending = self._ending or stop.value
            raise StopIteration(self._ending) from None
        increment = replace(found, seconds=time.perf_counter() - started)
        return increment if self._changed is None else self._changed(increment)

    @property
    def ending(self) -> Ending:
        """How it ended; raises ``RuntimeError`` before the last increment has been asked for."""
        if self._ending is None:
            raise RuntimeError("the analysis has not ended; ask for all of its increments first")
        return self._ending

    def begin(self) -> Increments:
        """Find the first increment at once, so that what it refuses is refused now."""
        self._first = next(self, None)
        return self

    def close(self) -> None:
        """End the analysis where it is."""
        self._steps.close()

    def all(self, on_increment: Callable[[Increment], None] | None = None) -> tuple[Increment, ...]:
        """Find all increments, without the states that a path goes on from; calls ``on_increment`` with each."""
        increments = []
        for found in self:
            increments.append(replace(found, checkpoint=None))
            if on_increment is not None:
                on_increment(increments[-1])
        return tuple(increments)
