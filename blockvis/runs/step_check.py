"""How exact a run is: the same path with a quarter of the error that its steps aim for."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

import solver
from blockvis.cases.contents import Case
from blockvis.results.about import phases_of, unit_in
from blockvis.results.folder import STEP_CHECK, add_to_summary
from blockvis.results.record import read_json, write_json
from blockvis.system.worker import LOOK
from solver import mechanics

from .once_more import OnceMore, Traced, followed, takes_steps, traced
from .reopen import case_of, open_results

#: Step tolerance of the other path over that of the run. Half of it is near by chance too often.
FINER = 0.25

#: Error of a run over its difference from the other path: 4/3 where steps are of the first order, and half as much
#: more for where they are not.
ERROR_OVER_DIFFERENCE = 2.0

#: Reactions below this part of the first are compared with it: where one passes through zero nothing is a part of it.
LEAST_REACTION = 0.05

#: Error that is worth a warning, and the smallest that is reported, as a fraction and of positions [m].
NOTABLE, SMALLEST, SMALLEST_PLACE = 0.01, 1e-4, 1e-5

#: What may be unknown of a check: nan, and null in files.
UNKNOWN = ("difference", "collapse", "position")

#: Seconds after which waiting is worth a word.
WORTH_A_WORD = 2.0


@dataclass(frozen=True)
class StepCheck:
    """How far a run and the same with a quarter of the step tolerance are apart."""

    what: str  #: What the analysis measures, in words.
    #: Largest difference of what is measured at the same parameter, or of the largest multipliers of pushovers, as a
    #: fraction of what is measured there, or of ``LEAST_REACTION`` times the first where that is more; nan where only
    #: the state at rest, which takes no steps, is in both.
    difference: float
    at: float  #: [m or rad] Parameter where it is.
    unit: str  #: Of the parameter.
    collapse: float  #: Difference of the displacements at collapse, as a fraction; nan unless both collapse.
    #: [m] Largest distance between the two places of a block at the same parameter; nan where the difference is.
    position: float
    #: How the run and the other ended.
    stop: str
    stop_of_check: str
    phase: int | None = None  #: Number of the settlement, from 1, within which ``at`` counts, where there are several.

    @property
    def step_error(self) -> dict[str, float | None]:
        """Error that follows of each, None of nan: ``reaction`` and ``collapse`` as fractions, ``position`` in m."""
        found = {"reaction": self.difference, "collapse": self.collapse, "position": self.position}
        return {what: None if np.isnan(apart) else ERROR_OVER_DIFFERENCE * apart for what, apart in found.items()}

    @property
    def error(self) -> float:
        """The larger of the errors of what is measured and of the collapse that are known, or 0."""
        return ERROR_OVER_DIFFERENCE * float(np.nanmax([self.difference, self.collapse, 0.0]))

    def __str__(self) -> str:
        """Say it in a line."""
        error = self.step_error
        # Where it is too small to be told rounding decides where it is largest.
        phase = "" if self.phase is None else f" in phase {self.phase}"
        told = ERROR_OVER_DIFFERENCE * self.difference >= SMALLEST
        where = f" (at {self.at:.4g} {self.unit}{phase})" if told else ""
        parts = []
        if error["reaction"] is not None:
            parts.append(f"{self.what} {_percent(error['reaction'])}{where}")
        if error["collapse"] is not None:
            parts.append(f"collapse {_percent(error['collapse'])}")
        if error["position"] is not None:
            parts.append(f"blocks {_millimetres(error['position'])}")
        else:
            parts.append(f"{self.what} and blocks not known, as no increment is in both but that at rest")
        if self.stop != self.stop_of_check:
            ends = f"it ends as '{self.stop_of_check}', not '{self.stop}'"
            parts.append(f"but with a quarter of the step tolerance {ends}")
        return f"error of the steps: {', '.join(parts)}"

    @property
    def warning(self) -> str:
        """What there is to say where the difference matters; nothing where it does not."""
        if self.error <= NOTABLE and self.stop == self.stop_of_check:
            return ""
        if self.error <= NOTABLE and self.stop_of_check == solver.Status.SOLVER_FAILED:
            return "shorter steps came to a program that is not solved: half the step_tolerance may lead past it"
        return (
            f"the steps matter by more than {100.0 * NOTABLE:g} %: take a smaller step_tolerance; where that changes "
            "nothing, as where stones slip off each other, a wall may have several paths"
            + (": give results with their range (--range)" if self.what == mechanics.REACTION.name else "")
        )


class StepChecking:
    """The same path in shorter steps, followed by a process of its own while this one follows the case.

    Case and folder are as of :class:`OnceMore`.
    """

    def __init__(self, case: Case, folder: Path | None = None) -> None:
        self._other = OnceMore(_finer(case), folder)

    def compared(
        self,
        folder: str | Path,
        response: solver.Response,
        patience: float | None = None,
        waiting: Callable[[], None] = lambda: None,
    ) -> StepCheck | None:
        """Wait for the other path and compare, as :func:`check_steps`; None where there is nothing to compare with.

        ``waiting`` is called once where it takes long. Raises ``TimeoutError`` after so much patience [s].
        """
        began, reported = time.monotonic(), False
        while True:
            with contextlib.suppress(TimeoutError):
                other = self._other.found(LOOK)
                return None if other is None else _written(Path(folder), compared(response, other))
            waited = time.monotonic() - began
            if patience is not None and waited > patience:
                raise TimeoutError(f"the same path in shorter steps takes longer than {patience:.0f} s more")
            if waited > WORTH_A_WORD and not reported:
                waiting()
                reported = True

    def close(self) -> None:
        """End the process."""
        self._other.close()


def stored_case(folder: Path) -> Case:
    """Read the case of a results folder; raises ``ValueError`` for a run without one."""
    case = case_of(folder)
    if case is None:
        raise ValueError(f"'{folder}' was written from Python, without a case file; run it again from there")
    return case


def check_steps(folder: str | Path) -> StepCheck:
    """Follow the run of a results folder again in shorter steps, compare, and write what comes out.

    ``step_check.json`` has the differences, ``step_error`` in ``summary.json`` the errors that follow of them. Raises
    ``ValueError`` for a run without a case file, or that takes no steps: a limit load, or increments by linear program.
    """
    folder = Path(folder)
    case, response = stored_case(folder), open_results(folder)
    if not (takes_steps(case) and response.path):
        by = ", by linear program" if case.controls.increments == mechanics.LINEAR_PROGRAM else ""
        raise ValueError(
            f"'{folder}' has no path whose steps could be checked ({response.analysis}, {len(response.path)} "
            f"increments{by}); it takes a settlement or a pushover"
        )
    return _written(folder, compared(response, followed(_finer(case), response.assembly)))


def stored_check(folder: Path) -> StepCheck | None:
    """Read what a run was compared with, if it was."""
    if not (folder / STEP_CHECK).is_file():
        return None
    numbers = read_json(folder / STEP_CHECK)
    return StepCheck(**numbers | {name: np.nan for name in UNKNOWN if numbers[name] is None})


def _finer(case: Case) -> Case:
    """Make the same case with a quarter of the error that its steps aim for."""
    return replace(case, controls=replace(case.controls, step_tolerance=FINER * case.controls.step_tolerance))


def _percent(part: float) -> str:
    return "below 0.01 %" if part < SMALLEST else f"± {_two_digits(100.0 * part)} %"


def _millimetres(length: float) -> str:
    return "below 0.01 mm" if length < SMALLEST_PLACE else f"± {_two_digits(1e3 * length)} mm"


def _two_digits(value: float) -> str:
    return f"{float(f'{value:.2g}'):g}"


def _written(folder: Path, check: StepCheck) -> StepCheck:
    numbers = {**vars(check), **{name: None for name in UNKNOWN if np.isnan(getattr(check, name))}}
    write_json(folder / STEP_CHECK, numbers)
    add_to_summary(folder, step_error=check.step_error)
    return check


def compared(response: solver.Response, other: Traced) -> StepCheck:
    """Compare a run with another of the same case in shorter steps."""
    ours = traced(response)
    mine, theirs = ours.same_places(other)
    stepped = (ours.phases[mine] > 0) | (ours.parameters[mine] != 0.0)
    mine, theirs = mine[stepped], theirs[stepped]
    places = mine, theirs
    if response.measured == mechanics.LOAD_MULTIPLIER and len(mine):
        # Peaks are increments of their own, which the two paths have at different places.
        places = np.append(mine, ours.measured.argmax()), np.append(theirs, other.measured.argmax())
    a, b = ours.measured[places[0]], other.measured[places[1]]
    first = LEAST_REACTION * np.abs(ours.measured[:1]).max(initial=0.0)
    apart = np.abs(a - b) / np.maximum(np.maximum(np.abs(a), first), np.finfo(float).tiny)
    moved = np.linalg.norm(ours.positions[mine] - other.positions[theirs], axis=2)
    ends = [np.nan if path.collapse is None else path.collapse for path in (ours, other)]
    stops = [ours.stop, other.stop]
    if ours.collapse_phase != other.collapse_phase and not np.isnan(ends).any():
        # Displacements of two phases are no measure of each other.
        ends = [np.nan, np.nan]
        stops = [f"{path.stop} in phase {path.collapse_phase + 1}" for path in (ours, other)]
    worst = places[0][np.argmax(apart)] if apart.any() else None
    phase = 0 if worst is None else int(ours.phases[worst])
    return StepCheck(
        what=response.measured.name,
        difference=float(apart.max(initial=0.0 if len(mine) else np.nan)),
        at=0.0 if worst is None else float(ours.parameters[worst]),
        unit=unit_in(response, phase),
        collapse=abs(ends[1] - ends[0]) / ends[0] if ends[0] > 0.0 else np.nan,
        position=float(moved.max(initial=0.0 if len(mine) else np.nan)),
        stop=stops[0],
        stop_of_check=stops[1],
        phase=phase + 1 if len(phases_of(response)) > 1 else None,
    )
