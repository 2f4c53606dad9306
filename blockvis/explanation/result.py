"""Explanation: ranked causes of what was observed."""

from __future__ import annotations

import html
from dataclasses import dataclass, field
from typing import Any

import solver
from blockvis.cases.contents import Case

from .forward import Run
from .likelihood import Comparison
from .observations import Observations
from .ranking import Cause, Measurement, alike


@dataclass(frozen=True)
class Explanation:
    """What may have caused what was observed.

    Attributes
    ----------
    assembly : solver.Assembly
        As it was analysed: every support fixed, the ground cut where troughs were looked at.
    causes : tuple of Cause
        The most probable first; empty where no candidate makes any of the cracks, or stands at any amount.
    unexplained : tuple of int
        Numbers of the observed widths that the best cause does not make.
    made_by_none : tuple of int
        Those of them that no candidate makes.
    unexplained_points, points_made_by_none : tuple of int
        Numbers of the observed points, likewise.
    next_measurement : Measurement or None
        The joint that would tell the first causes apart best.
    runs : dict
        Of the candidates: ``explain(..., runs=...)`` takes them instead of following them again.
    words : str
        What came out, for people.
    """

    case: Case
    assembly: solver.Assembly
    observations: Observations
    comparison: Comparison
    causes: tuple[Cause, ...]
    unexplained: tuple[int, ...]
    made_by_none: tuple[int, ...]
    unexplained_points: tuple[int, ...]
    points_made_by_none: tuple[int, ...]
    next_measurement: Measurement | None
    runs: dict[Any, Run] = field(repr=False, default_factory=dict)
    notes: tuple[str, ...] = ()
    words: str = ""

    @property
    def stands(self) -> bool:
        """Whether the structure stands as drawn."""
        return any(len(run.amounts) > 1 for run in self.runs.values())

    @property
    def alike(self) -> tuple[Cause, ...]:
        """The best cause, and those that the observations cannot tell from it."""
        return tuple(alike(self.causes)) if self.causes else ()

    def __str__(self) -> str:
        """Say in words what came out."""
        return self.words

    def _repr_html_(self) -> str:
        """Show the words in a notebook."""
        return f"<pre>{html.escape(self.words)}</pre>"
