"""The path of a case once more, followed by a process of its own while this one does something else."""

from __future__ import annotations

import contextlib
import os
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

import solver
from blockvis.cases.build import case_assembly
from blockvis.cases.contents import Case
from blockvis.kinds.kinds import KINDS
from blockvis.results.about import collapse_phase
from blockvis.results.folder import stored_assembly
from blockvis.system.worker import Say, Worker, WorkerEnded, end_with_caller, serve
from solver import mechanics

from .plan import planned

#: Increments at parameters no farther apart than this, as a fraction of the largest, are of the same place, and layouts
#: the same where no corner is farther off, in block sizes.
SAME = 1e-9


@dataclass(frozen=True)
class Traced:
    """What is compared of a path of n increments in equilibrium."""

    phases: np.ndarray  #: (n,) array.
    parameters: np.ndarray  #: (n,) array [m or rad]: within the phase.
    measured: np.ndarray  #: (n,) array.
    positions: np.ndarray  #: (n, n_blocks, d) array [m]: of centroids.
    collapse: float | None  #: [m or rad] Parameter at collapse; 0 of what does not stand as drawn.
    stop: str
    collapse_phase: int = 0  #: Number of the phase of the collapse, from 0.

    def without_rounding(self, least: np.ndarray) -> Traced:
        """Return it with 0 for what is measured of at most so much, by phases (n,)."""
        return replace(self, measured=np.where(np.abs(self.measured) > least[self.phases], self.measured, 0.0))

    def same_places(self, other: Traced) -> tuple[np.ndarray, np.ndarray]:
        """Numbers of the increments of this path and of another that are at the same parameter."""
        near = SAME * float(np.abs(self.parameters).max(initial=0.0))
        apart = np.abs(self.parameters[:, None] - other.parameters)
        mine, others = np.nonzero((apart <= near) & (self.phases[:, None] == other.phases))
        return mine, others


class OnceMore:
    """The path of a case that :func:`takes_steps`, followed by a process of its own.

    The folder is where the assembly of a run that has begun is stored.
    """

    def __init__(self, case: Case, folder: Path | None = None) -> None:
        self._worker = Worker(__name__)
        self._worker.say("follow", (case, folder))

    def found(self, seconds: float) -> Traced | None:
        """Wait so long for the path, then raise ``TimeoutError``; None where it came to nothing."""
        try:
            path: Traced | None = self._worker.hear("path", seconds=seconds)[1]
        except WorkerEnded:
            return None
        return path

    def close(self) -> None:
        """End the process."""
        self._worker.close()


def main() -> None:
    """Follow the path of a case that comes in, and say what came out."""
    serve(_answer)


def _answer(say: Say, word: str, about: Any) -> bool:
    case, folder = about
    end_with_caller()
    # What HiGHS and warnings say is said by the first process.
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    os.dup2(nowhere, 2)
    if hasattr(os, "nice"):
        os.nice(5)  # It is not to slow the first path.
    found = None
    with contextlib.suppress(Exception):
        found = followed(case, case_assembly(case) if folder is None else stored_assembly(folder))
    say("path", found)
    return True


def takes_steps(case: Case) -> bool:
    """Whether a case follows a path in steps that choose themselves: a linear program per increment has none."""
    return case.controls.increments != mechanics.LINEAR_PROGRAM and KINDS[case.analysis].course(case).parameter.is_path


def traced(response: solver.Response) -> Traced:
    """Take from a response what is compared."""
    path, assembly = response.path, response.assembly
    without = 0.0 if response.stop == solver.Status.NO_INITIAL_EQUILIBRIUM else None
    return Traced(
        phases=np.array([i.phase for i in path], dtype=int),
        parameters=np.array([i.parameter for i in path]),
        measured=np.array([i.measured for i in path]),
        positions=np.array([i.pose.positions for i in path]).reshape(-1, *assembly.centroids.shape),
        collapse=without if response.collapse is None else response.collapse.displacement,
        stop=str(response.stop),
        collapse_phase=collapse_phase(response) or 0,
    )


def followed(case: Case, assembly: solver.Assembly) -> Traced:
    """Follow the path of a case to its end, here."""
    run = planned(replace(case, controls=replace(case.controls, falling_frames=1)), assembly)
    return traced(run.response(run.steps.all(), run.steps.ending))
