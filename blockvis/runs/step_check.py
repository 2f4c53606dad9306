"""How exact a run is: the same path with half the error that its steps aim for."""

from __future__ import annotations

import contextlib
import json
import os
import pickle
import queue
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from pathlib import Path

import numpy as np

import solver
from blockvis.atomic_files import write_whole
from blockvis.cases.build import case_assembly
from blockvis.cases.case import parse_case
from blockvis.cases.contents import Case
from blockvis.processes import interpreter, unread
from blockvis.results.folder import STEP_CHECK, stored_assembly
from blockvis.results.record import read_record

from .kinds import KINDS
from .plan import planned
from .reopen import open_results

#: Increments at parameters no farther apart than this, as a fraction of the largest, are of the same place.
SAME = 1e-9

#: Difference that is worth a warning, and the smallest that is told.
NOTABLE, SMALLEST = 0.01, 1e-4

#: The way to find increments that has no steps of its own.
LINEAR_PROGRAM = solver.INCREMENTS[1]

#: Seconds between looks for Ctrl-C while waiting, and after which waiting is worth a word.
LOOK, WORTH_A_WORD = 0.2, 2.0

#: How much less urgent the second path is, where the system knows such a thing: it is not to slow the first.
LESS_URGENT = 5


@dataclass(frozen=True)
class StepCheck:
    """How far a run and another with half the step tolerance are apart.

    Attributes
    ----------
    what : str
        What the analysis measures, in words.
    difference : float
        Largest difference of what is measured at the same parameter, as a fraction of the largest that was measured.
    at : float [m or rad]
        Parameter where it is.
    unit : str
        Of the parameter.
    collapse : float
        Difference of the displacements at collapse, as a fraction; nan unless both collapse.
    stop, stop_of_check : str
        How both ended.
    """

    what: str
    difference: float
    at: float
    unit: str
    collapse: float
    stop: str
    stop_of_check: str

    @property
    def error(self) -> float:
        """The larger of the two differences."""
        return float(np.nanmax([self.difference, self.collapse]))

    def __str__(self) -> str:
        """Say it in a line."""
        parts = [f"{self.what} {_percent(self.difference)} at {self.at:.4g} {self.unit}"]
        if np.isfinite(self.collapse):
            parts.append(f"collapse {_percent(self.collapse)}")
        if self.stop != self.stop_of_check:
            parts.append(f"one ends as '{self.stop}', the other as '{self.stop_of_check}'")
        return f"error of the steps: {', '.join(parts)} (apart from a run with half the step tolerance)"

    @property
    def warning(self) -> str:
        """What there is to say where the difference matters; nothing where it does not."""
        if self.error <= NOTABLE and self.stop == self.stop_of_check:
            return ""
        return (
            f"the steps matter by more than {100.0 * NOTABLE:g} %: take a smaller step_tolerance; where that changes "
            "nothing, as where stones slip off each other, a wall may have several paths: give results with that range"
        )


@dataclass(frozen=True)
class Traced:
    """What is compared of a path.

    Attributes
    ----------
    measured : list of (int, float, float)
        Phase, parameter and what is measured at each equilibrium.
    collapse : float, optional
        Displacement at collapse.
    stop : str
    """

    measured: list[tuple[int, float, float]]
    collapse: float | None
    stop: str


class StepChecking:
    """The same path once more, followed by a process of its own while this one follows the case.

    Parameters
    ----------
    case : Case
        That :func:`takes_steps`.
    folder : Path, optional
        Where the assembly is stored, for a run that goes on.
    """

    def __init__(self, case: Case, folder: Path | None = None) -> None:
        self._process = interpreter(__name__)
        assert self._process.stdin is not None
        with unread():
            pickle.dump((case, folder), self._process.stdin)
            self._process.stdin.flush()
        self._found: queue.SimpleQueue[Traced | None] = queue.SimpleQueue()
        threading.Thread(target=self._listen, daemon=True).start()

    def compared(
        self,
        folder: str | Path,
        response: solver.Response,
        patience: float | None = None,
        waiting: Callable[[], None] = lambda: None,
    ) -> StepCheck | None:
        """Wait for the other path, compare, and write ``step_check.json``; None where there is nothing to compare with.

        Parameters
        ----------
        folder : str or Path
        response : solver.Response
            Of the case.
        patience : float, optional [s]
            How long to wait at most.
        waiting : callable, optional
            Called once where it takes long.

        Raises
        ------
        TimeoutError
        """
        began, told = time.monotonic(), False
        while True:
            with contextlib.suppress(queue.Empty):
                # Windows sees Ctrl-C between two waits only.
                other = self._found.get(timeout=LOOK)
                break
            waited = time.monotonic() - began
            if patience is not None and waited > patience:
                raise TimeoutError(f"the same path once more takes longer than {patience:.0f} s more")
            if waited > WORTH_A_WORD and not told:
                waiting()
                told = True
        return None if other is None else _written(Path(folder), compared(response, other))

    def close(self) -> None:
        """End the process."""
        self._process.kill()
        self._process.wait()
        assert self._process.stdin is not None
        with unread():
            self._process.stdin.close()

    def _listen(self) -> None:
        assert self._process.stdout is not None
        found = None
        with self._process.stdout as out, contextlib.suppress(EOFError, OSError, pickle.UnpicklingError):
            found = pickle.load(out)
        self._found.put(found)


def main() -> None:
    """Follow the path of a case that comes in, and say what came out."""
    case, folder = pickle.load(sys.stdin.buffer)
    # Where the first process ends, however that happens, nobody waits for this one.
    threading.Thread(target=lambda: (sys.stdin.buffer.read(), os._exit(0)), daemon=True).start()
    with open(os.dup(1), "wb") as out, open(os.devnull, "wb") as nowhere:
        # What HiGHS and warnings say is said by the first process.
        os.dup2(nowhere.fileno(), 1)
        os.dup2(nowhere.fileno(), 2)
        if hasattr(os, "nice"):
            os.nice(LESS_URGENT)
        found = None
        with contextlib.suppress(Exception):
            found = _followed_again(case, case_assembly(case) if folder is None else stored_assembly(folder))
        with unread():
            pickle.dump(found, out)
            out.flush()
    os._exit(0)


def takes_steps(case: Case) -> bool:
    """Whether a case follows a path in steps that choose themselves: a linear program per increment has none."""
    return case.controls.increments != LINEAR_PROGRAM and KINDS[case.analysis].course(case).parameter.is_path


def stored_case(folder: Path) -> Case:
    """Read the case of a results folder.

    Raises
    ------
    ValueError
        For a run without one.
    """
    record = read_record(folder)
    if not record.case:
        raise ValueError(f"'{folder}' was written from Python, without a case file; its steps cannot be checked")
    return parse_case(record.case, Path(record.case_file or folder / "case.toml"))


def check_steps(folder: str | Path) -> StepCheck:
    """Follow the run of a results folder again with half the step tolerance, compare, and write ``step_check.json``.

    Parameters
    ----------
    folder : str or Path
        That a run of a case file has written.

    Raises
    ------
    ValueError
        For a run without a case file, or that takes no steps: a limit load, or increments by linear program.
    """
    folder = Path(folder)
    case, response = stored_case(folder), open_results(folder)
    if not (takes_steps(case) and response.path):
        by = ", by linear program" if case.controls.increments == LINEAR_PROGRAM else ""
        raise ValueError(
            f"'{folder}' has no path whose steps could be checked ({response.analysis}, {len(response.path)} "
            f"increments{by}); it takes a settlement or a pushover"
        )
    return _written(folder, compared(response, _followed_again(case, response.assembly)))


def stored_check(folder: Path) -> StepCheck | None:
    """Read what a run was compared with, if it was."""
    if not (folder / STEP_CHECK).is_file():
        return None
    numbers = json.loads((folder / STEP_CHECK).read_text(encoding="utf-8"))
    known = {field.name: numbers[field.name] for field in fields(StepCheck)}
    return StepCheck(**{**known, "collapse": np.nan if known["collapse"] is None else known["collapse"]})


def traced(response: solver.Response) -> Traced:
    """Take from a response what is compared."""
    collapse = None if response.collapse is None else response.collapse.displacement
    return Traced([(i.phase, i.parameter, i.measured) for i in response.path], collapse, str(response.stop))


def _followed_again(case: Case, assembly: solver.Assembly) -> Traced:
    """Follow the path of a case in steps whose error is to be half of that which the case asks for."""
    finer = replace(case.controls, step_tolerance=0.5 * case.controls.step_tolerance, falling_frames=1)
    run = planned(replace(case, controls=finer), assembly)
    found: list[solver.Increment] = []
    while True:
        try:
            found.append(next(run.steps))
        except StopIteration as stop:
            ending: solver.Ending = stop.value
            return traced(run.response(found, ending))


def _percent(part: float) -> str:
    return "below 0.01 %" if part < SMALLEST else f"{100.0 * part:.2g} %"


def _written(folder: Path, check: StepCheck) -> StepCheck:
    numbers = {**vars(check), "collapse": None if np.isnan(check.collapse) else check.collapse}
    write_whole(folder / STEP_CHECK, json.dumps(numbers, indent=2) + "\n")
    return check


def compared(response: solver.Response, other: Traced) -> StepCheck:
    """Compare a run with another of shorter steps.

    Parameters
    ----------
    response : solver.Response
    other : Traced
        Of the same case.
    """
    ours = traced(response)
    largest = max((abs(measured) for _, _, measured in ours.measured), default=0.0)
    near = SAME * max((abs(s) for _, s, _ in ours.measured), default=0.0)
    apart = [
        (abs(a - b), s)
        for p, s, a in ours.measured
        for q, t, b in other.measured
        if p == q and abs(s - t) <= near and largest > 0.0
    ]
    difference, at = max(apart, default=(0.0, 0.0))
    collapse = np.nan
    if ours.collapse is not None and other.collapse is not None and ours.collapse > 0.0:
        collapse = abs(other.collapse - ours.collapse) / ours.collapse
    driver = response.settlements[-1] if response.control is None and response.settlements else None
    return StepCheck(
        what=response.measured.name,
        difference=difference / largest if largest > 0.0 else 0.0,
        at=at,
        unit=response.parameter.unit if driver is None else driver.unit,
        collapse=collapse,
        stop=ours.stop,
        stop_of_check=other.stop,
    )
