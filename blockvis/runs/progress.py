"""Progress of a run on stderr: a bar on a terminal, elsewhere a line now and then."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Sequence
from typing import Self

import numpy as np

import solver
from blockvis.results.about import Course
from solver import mechanics
from solver.mechanics import counted

#: Seconds between two redrawings of the bar.
REDRAW = 0.1

#: Seconds between two lines where stderr is no terminal: short runs write none.
LINES = 5.0

#: Seconds between two looks at whether a single step takes long.
BEAT = 1.0


class _Line:
    """One line on stderr that is written again and again; where it is no terminal, lines now and then."""

    def __init__(self) -> None:
        self.stream = sys.stderr
        self.watched = self.stream.isatty()
        self.started = time.perf_counter()
        self.last = -1.0 if self.watched else self.started

    @property
    def due(self) -> bool:
        """Whether it is time to write again."""
        return time.perf_counter() - self.last >= (REDRAW if self.watched else LINES)

    def write(self, text: str, part: float | None = None) -> None:
        """Write the line, with the seconds so far, and on a terminal a bar of the part that is done."""
        self.last = time.perf_counter()
        text = f"{text}, {self.last - self.started:.1f} s"
        bar = "" if part is None else f"[{'#' * int(24 * part):<24}] "
        self.stream.write(f"\r\x1b[K{bar}{text}" if self.watched else f"blockvis: {text}\n")
        self.stream.flush()

    def left(self, done: int, total: int) -> str:
        """Say how long the rest will take if it goes on as until now; "" where nothing is done."""
        seconds = (total - done) * (time.perf_counter() - self.started) / done if done else 0.0
        return f", about {f'{seconds:.0f} s' if seconds < 100.0 else f'{seconds / 60.0:.0f} min'} left" if done else ""

    def clear(self) -> None:
        """Clear the line."""
        if self.watched:
            self.stream.write("\r\x1b[K")
            self.stream.flush()


class DrawingProgress:
    """A bar that counts the seconds of the fall as it is worked out, then the frames of the film."""

    def __init__(self) -> None:
        self._line = _Line()

    def fall(self, time: float, longest: float) -> None:
        """Show how far the fall is worked out, and how far it is followed [s]."""
        if self._line.due:
            self._line.write(f"fall, {time:.1f} s of at most {longest:.1f} s", time / longest)

    def frame(self, done: int, total: int) -> None:
        """Show how many frames are drawn."""
        if self._line.due or (self._line.watched and done == total):
            self._line.write(f"frame {done} of {total}", done / max(total, 1))

    def __enter__(self) -> DrawingProgress:
        """Draw."""
        return self

    def __exit__(self, *_: object) -> None:
        """Clear the bar."""
        self._line.clear()


class Progress:
    """A bar that follows the parameter of an analysis towards its limit, and says what an increment is doing meanwhile.

    It begins at the ``count`` of increments found before.
    """

    def __init__(self, course: Course, assembly: solver.Assembly, count: int = 0) -> None:
        self.course, self.count, self.assembly, self._line = course, count, assembly, _Line()
        self._state: mechanics.PathState | None = None
        self._at, self._still = time.perf_counter(), 0
        self._ended, self._writing = threading.Event(), threading.Lock()

    def watch(self) -> None:
        """Write also while a single step takes long, until all is done."""
        threading.Thread(target=self._keep_telling, daemon=True).start()

    def _keep_telling(self) -> None:
        while not self._ended.wait(BEAT):
            still = time.perf_counter() - self._at
            with self._writing:
                if self._line.due and not self._ended.is_set() and still > LINES / 2.0:
                    state = self._state
                    what = f"increment {self.count + 1}" if state is None else f"{self.doing(state)}, in one step"
                    self._line.write(f"{what} for {still:.0f} s")

    def _driver(self, phase: int) -> solver.Settlement | solver.ControlDisplacement | None:
        drivers = self.course.drivers
        return drivers[min(phase, len(drivers) - 1)] if drivers else None

    def doing(self, state: mechanics.PathState) -> str:
        """Say in words where an increment is: its parameter, the next step, and what moves."""
        driver = self._driver(state.phase)
        if driver is None:
            return f"increment {self.count + 1}"
        words = f"{self.course.parameter.name} {state.place.s:.6g} of at most {driver.limit:g} {driver.unit}"
        words += f", increment {self.count + 1}"
        if self._still:
            return f"{words}, step {self._still} in time: blocks fall or come to rest while the supports stand"
        words += f" in steps of {state.step:.2g}"
        if np.isfinite(state.upper_bound):
            words += f", no equilibrium at {state.upper_bound:.6g}"
        return words + self._moving(state.place.velocity)

    def _moving(self, velocity: np.ndarray | None) -> str:
        """Count the free blocks that move at least a hundredth as fast as the fastest, and name that."""
        if velocity is None:
            return ""
        speeds = mechanics.motion_size(velocity, self.assembly.block_size)
        moving = int((self.assembly.free & (speeds > 0.01 * speeds.max(initial=0.0))).sum())
        return f", {counted(moving, 'block')} moving, '{self.assembly.names[int(speeds.argmax())]}' moves most"

    def step(self, state: mechanics.PathState) -> None:
        """Show where an increment is that takes long, at one state of the path also by how many steps in time."""
        self._still = self._still + 1 if state is self._state else 0
        self._state, self._at = state, time.perf_counter()
        driver = self._driver(state.phase)
        if self._line.due and driver is not None:
            with self._writing:
                self._line.write(self.doing(state), min(state.place.s / driver.limit, 1.0))

    def increment(self, increment: solver.Increment) -> None:
        """Show an increment."""
        self.count += 1
        self._state, self._at = None, time.perf_counter()
        if not self._line.due:
            return
        measured, driver, part, where = self.course.measured, self._driver(increment.phase), None, ""
        if driver is not None and measured.is_force:
            measured = mechanics.reaction_to(driver.unit)
        what = f"{measured.name} {increment.measured:.5g} {measured.unit}".rstrip()
        if increment.status == solver.Status.FALLING:
            what = "falls"
        if driver is not None:
            part = min(increment.parameter / driver.limit, 1.0)
            name = self.course.parameter.name
            where = f"{name} {increment.parameter:.4g} of at most {driver.limit:g} {driver.unit}, "
        with self._writing:
            self._line.write(f"{where}{what}, {counted(self.count, 'increment')}", part)

    def done(self) -> None:
        """Clear the bar."""
        self._ended.set()
        with self._writing:
            self._line.clear()


class Waiting:
    """A line that says what takes long, until it is done: nothing of it is counted."""

    def __init__(self, what: str, *, shown: bool = True) -> None:
        self.what, self._line, self._ended = what, _Line(), threading.Event()
        self._thread = threading.Thread(target=self._keep_telling, daemon=True) if shown else None

    def __enter__(self) -> Self:
        """Begin to write now and then."""
        if self._thread is not None:
            self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Write no more."""
        self._ended.set()
        if self._thread is not None:
            self._thread.join()
            self._line.clear()

    def _keep_telling(self) -> None:
        while not self._ended.wait(REDRAW):
            if self._line.due:
                self.tell()

    def tell(self) -> None:
        """Write the line."""
        self._line.write(self.what)


class RunsProgress(Waiting):
    """A line that counts runs of which each may take long, and names the one that is waited for.

    They come in rounds, of which each knows of how many runs it is once the one before has ended.
    """

    def __init__(self, rounds: int, *, shown: bool) -> None:
        super().__init__("", shown=shown)
        self.names: list[str] = []
        self.rounds, self.round, self.count = rounds, 0, 0

    def add(self, names: Sequence[str]) -> None:
        """Begin a round of runs, by what each is of."""
        self.names.extend(names)
        self.round += 1

    def finished(self) -> None:
        """Count a run."""
        self.count += 1

    def tell(self) -> None:
        """Write the line while runs are waited for."""
        number, total = self.count, len(self.names)
        if number < total:
            left = self._line.left(number, total)
            left += f" in round {self.round} of {self.rounds}" if left and self.round < self.rounds else ""
            self._line.write(f"run {number + 1} of {total}: {self.names[number]}{left}", number / total)


class StudyProgress:
    """A bar that counts the runs of a study, some of which were finished before, in a terminal or a notebook."""

    def __init__(self, total: int, before: int, *, shown: bool) -> None:
        self.total, self.before, self.count, self.failed, self._line = total, before, 0, 0, _Line()
        self._line.watched |= "ipykernel" in sys.modules
        self.shown = self._line.watched and shown

    def finished(self, *, failed: bool = False) -> None:
        """Count a run."""
        self.count += 1
        self.failed += failed
        done = self.before + self.count
        if self.shown and (self._line.due or done == self.total):
            without = f", {self.failed} without result" if self.failed else ""
            text = f"run {done} of {self.total}{without}{self._line.left(self.count, self.total - self.before)}"
            self._line.write(text, done / max(self.total, 1))

    def done(self) -> None:
        """Clear the bar."""
        if self.shown:
            self._line.clear()
