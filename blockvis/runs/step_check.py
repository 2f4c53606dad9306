"""How much the length of the steps matters: the same run once more in steps half as long."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

import solver
from blockvis.atomic_files import write_whole
from blockvis.cases.case import parse_case
from blockvis.results.record import read_record

from .plan import planned
from .reopen import open_results

#: Written beside the summary.
FILE_NAME = "step_check.json"

#: Increments at parameters no farther apart than this, as a fraction of the largest, are of the same place.
SAME = 1e-9

#: Difference that is worth a warning.
NOTABLE = 0.01


@dataclass(frozen=True)
class StepCheck:
    """How far a run and another in steps half as long are apart.

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
        parts = [f"{self.what} {100.0 * self.difference:.2g} % at {self.at:.4g} {self.unit}"]
        if np.isfinite(self.collapse):
            parts.append(f"collapse {100.0 * self.collapse:.2g} %")
        if self.stop != self.stop_of_check:
            parts.append(f"one ends as '{self.stop}', the other as '{self.stop_of_check}'")
        return f"error of the steps: {', '.join(parts)} (apart from a run in steps half as long)"


def check_steps(folder: str | Path) -> StepCheck:
    """Follow the run of a results folder again in steps half as long, compare, and write ``step_check.json``.

    Parameters
    ----------
    folder : str or Path
        That a run of a case file has written.

    Raises
    ------
    ValueError
        For a run without a case file, or that has no steps: a limit load, or increments by linear program.
    """
    folder = Path(folder)
    record, response = read_record(folder), open_results(folder)
    if not record.case:
        raise ValueError(f"'{folder}' was written from Python, without a case file; its steps cannot be checked")
    case = parse_case(record.case, Path(record.case_file or folder / "case.toml"))
    if not response.parameter.is_path or not response.path or np.isnan(response.path[0].least):
        raise ValueError(
            f"'{folder}' has no path whose steps could be checked ({response.analysis}, {len(response.path)} "
            'increments); it takes a settlement or a pushover with [analysis] increments = "coulomb"'
        )
    finer = replace(case.controls, shorter_steps=2.0 * case.controls.shorter_steps, falling_frames=1)
    run = planned(replace(case, controls=finer), response.assembly)
    found = []
    while True:
        try:
            found.append(next(run.steps))
        except StopIteration as stop:
            ending: solver.Ending = stop.value
            break
    check = compared(response, run.response(found, ending))
    numbers = {**vars(check), "collapse": None if np.isnan(check.collapse) else check.collapse}
    write_whole(folder / FILE_NAME, json.dumps(numbers, indent=2) + "\n")
    return check


def compared(response: solver.Response, other: solver.Response) -> StepCheck:
    """Compare a run with another in shorter steps.

    Parameters
    ----------
    response, other : solver.Response
        Of the same case.
    """
    ours, theirs = ([(i.phase, i.parameter, i.measured) for i in one.path] for one in (response, other))
    largest = max((abs(measured) for _, _, measured in ours), default=0.0)
    near = SAME * max((abs(s) for _, s, _ in ours), default=0.0)
    apart = [
        (abs(a - b), s) for p, s, a in ours for q, t, b in theirs if p == q and abs(s - t) <= near and largest > 0.0
    ]
    difference, at = max(apart, default=(0.0, 0.0))
    one, two = response.collapse, other.collapse
    collapse = np.nan
    if one is not None and two is not None and one.displacement > 0.0:
        collapse = abs(two.displacement - one.displacement) / one.displacement
    driver = response.settlements[-1] if response.control is None and response.settlements else None
    return StepCheck(
        what=response.measured.name,
        difference=difference / largest if largest > 0.0 else 0.0,
        at=at,
        unit=response.parameter.unit if driver is None else driver.unit,
        collapse=collapse,
        stop=str(response.stop),
        stop_of_check=str(other.stop),
    )
