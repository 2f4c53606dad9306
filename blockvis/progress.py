"""Progress of a run on stderr; quiet where nobody watches."""

from __future__ import annotations

import sys
import time
from typing import TextIO

import solver

__all__ = ["Progress"]

#: Seconds between two redrawings of the bar.
REDRAW = 0.1


class Progress:
    """A bar that follows the settlement of the phase towards its limit.

    Parameters
    ----------
    settlements : tuple of solver.Settlement
    stream : text stream, optional
        stderr by default; nothing is written unless it is a terminal.
    """

    def __init__(self, settlements: tuple[solver.Settlement, ...], stream: TextIO | None = None) -> None:
        self.settlements = settlements
        self.stream = sys.stderr if stream is None else stream
        self.shown = self.stream.isatty()
        self.started = time.perf_counter()
        self.last, self.count = -1.0, 0

    def increment(self, increment: solver.Increment) -> None:
        """Shows an increment."""
        self.count += 1
        if not self.shown or time.perf_counter() - self.last < REDRAW:
            return
        falls = increment.status == solver.Status.FALLING
        what = "falls" if falls else f"reaction {increment.reaction:.5g} N"
        if increment.load_multiplier and not falls:
            what = f"load multiplier {increment.load_multiplier:.5g}"
        if not self.settlements:
            self._line(f"{what}, {self.count} increments")
            return
        settlement = self.settlements[increment.phase]
        part = min(increment.settlement / settlement.limit, 1.0)
        word = "settlement" if isinstance(settlement, solver.Settlement) else "control displacement"
        self._line(
            f"[{'#' * int(24 * part):<24}] {word} {increment.settlement:.4g} of at most {settlement.limit:g} "
            f"{settlement.unit}, {what}, {self.count} increments"
        )

    def picture(self, done: int, total: int) -> None:
        """Shows how many frames of the animation are drawn."""
        if self.shown and (done == total or time.perf_counter() - self.last >= REDRAW):
            self._line(f"[{'#' * (24 * done // max(total, 1)):<24}] frame {done} of {total}")

    def done(self) -> None:
        """Clears the bar."""
        if self.shown:
            self.stream.write("\r\x1b[K")
            self.stream.flush()

    def _line(self, text: str) -> None:
        self.last = time.perf_counter()
        self.stream.write(f"\r\x1b[K{text}, {self.last - self.started:.1f} s")
        self.stream.flush()
