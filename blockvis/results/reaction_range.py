"""The range of the reaction over the settlement: a table in the results folder, a band in pictures."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import solver

from .folder import RANGE
from .record import damaged
from .tables import csv_text

#: Columns of range.csv.
COLUMNS = ("phase", "settlement", "reaction_low", "reaction_high", "runs")

#: Part by which friction is taken less and more, and what compliance is multiplied with and divided by.
FRICTION, COMPLIANCE = 0.05, 3.0

#: What is varied, in words.
WORDS = (
    f"friction ± {100.0 * FRICTION:g} %, compliance × {COMPLIANCE:g} and ÷ {COMPLIANCE:g}, both together, imperfection "
    "× 0 and × 2"
)


@dataclass(frozen=True)
class ReactionRange:
    """The least and the largest reaction of several runs at n settlements."""

    phases: np.ndarray  #: (n,) array.
    settlements: np.ndarray  #: (n,) array [m or rad]: within the phase.
    #: (n,) arrays [N or N·m].
    low: np.ndarray
    high: np.ndarray
    runs: np.ndarray  #: (n,) array: how many stand there.

    def table(self) -> str:
        """Text of range.csv."""
        numbers = (self.phases, self.settlements, self.low, self.high, self.runs)
        return csv_text(COLUMNS, zip(*(values.tolist() for values in numbers), strict=True))

    def along(self, response: solver.Response) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(n,) arrays: parameter with the phases one after another, low and high, of the phases of a response."""
        path = response.path
        starts = {i.phase: float(t) - i.parameter for i, t in zip(path, response.parameters, strict=True)}
        shown = np.isin(self.phases, list(starts))
        start = np.array([starts[phase] for phase in self.phases[shown].tolist()])
        return self.settlements[shown] + start, self.low[shown], self.high[shown]


def stored_range(folder: Path) -> ReactionRange | None:
    """Read the range of a results folder, if it has one."""
    if not (folder / RANGE).is_file():
        return None
    with (folder / RANGE).open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    try:
        phases, settlements, low, high, runs = (np.array([float(row[name]) for row in rows]) for name in COLUMNS)
    except (KeyError, ValueError, TypeError) as error:
        raise damaged(folder / RANGE, f"no numbers in its columns {', '.join(COLUMNS)}: {error}") from None
    return ReactionRange(phases.astype(int), settlements, low, high, runs.astype(int))
