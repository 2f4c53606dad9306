"""The path of a case once more, followed by a process of its own while this one does something else."""

from __future__ import annotations

import contextlib
import os
import pickle
import queue
import sys
import threading
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

import solver
from blockvis.cases.build import case_assembly
from blockvis.cases.contents import Case
from blockvis.kinds.kinds import KINDS
from blockvis.results.folder import stored_assembly
from blockvis.system.processes import interpreter, unread

from .plan import planned

#: Increments at parameters no farther apart than this, as a fraction of the largest, are of the same place.
SAME = 1e-9

#: The way to find increments that has no steps of its own.
LINEAR_PROGRAM = solver.INCREMENTS[1]

#: How much less urgent the other path is, where the system knows such a thing: it is not to slow the first.
LESS_URGENT = 5


@dataclass(frozen=True)
class Traced:
    """What is compared of a path of n increments in equilibrium.

    Attributes
    ----------
    phases : (n,) array
    parameters : (n,) array [m or rad]
        Within the phase.
    measured : (n,) array
    positions : (n, n_blocks, d) array [m]
        Of centroids.
    collapse : float, optional [m or rad]
        Parameter at collapse.
    stop : str
    """

    phases: np.ndarray
    parameters: np.ndarray
    measured: np.ndarray
    positions: np.ndarray
    collapse: float | None
    stop: str

    def same_places(self, other: Traced) -> tuple[np.ndarray, np.ndarray]:
        """Numbers of the increments of this path and of another that are at the same parameter."""
        near = SAME * float(np.abs(self.parameters).max(initial=0.0))
        apart = np.abs(self.parameters[:, None] - other.parameters)
        mine, others = np.nonzero((apart <= near) & (self.phases[:, None] == other.phases))
        return mine, others


class OnceMore:
    """The path of a case, followed by a process of its own.

    Parameters
    ----------
    case : Case
        That :func:`takes_steps`.
    folder : Path, optional
        Where the assembly is stored, for a run that has begun.
    """

    def __init__(self, case: Case, folder: Path | None = None) -> None:
        self._process = interpreter(__name__)
        assert self._process.stdin is not None
        with unread():
            pickle.dump((case, folder), self._process.stdin)
            self._process.stdin.flush()
        self._found: queue.SimpleQueue[Traced | None] = queue.SimpleQueue()
        threading.Thread(target=self._listen, daemon=True).start()

    def found(self, seconds: float) -> Traced | None:
        """Wait so long for the path; None where it came to nothing.

        Raises
        ------
        queue.Empty
            Where it takes longer; short waits let Windows see Ctrl-C.
        """
        return self._found.get(timeout=seconds)

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
            found = followed(case, case_assembly(case) if folder is None else stored_assembly(folder))
        with unread():
            pickle.dump(found, out)
            out.flush()
    os._exit(0)


def takes_steps(case: Case) -> bool:
    """Whether a case follows a path in steps that choose themselves: a linear program per increment has none."""
    return case.controls.increments != LINEAR_PROGRAM and KINDS[case.analysis].course(case).parameter.is_path


def traced(response: solver.Response) -> Traced:
    """Take from a response what is compared."""
    path, assembly = response.path, response.assembly
    return Traced(
        phases=np.array([i.phase for i in path], dtype=int),
        parameters=np.array([i.parameter for i in path]),
        measured=np.array([i.measured for i in path]),
        positions=np.array([i.pose.positions for i in path]).reshape(-1, *assembly.centroids.shape),
        collapse=None if response.collapse is None else response.collapse.displacement,
        stop=str(response.stop),
    )


def followed(case: Case, assembly: solver.Assembly) -> Traced:
    """Follow the path of a case to its end, here.

    Parameters
    ----------
    case : Case
    assembly : solver.Assembly
    """
    run = planned(replace(case, controls=replace(case.controls, falling_frames=1)), assembly)
    return traced(run.response(run.steps.all(), run.steps.ending))
