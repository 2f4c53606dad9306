"""How far a path depends on what nobody knows well: friction, compliance of the joints, imperfection."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

import solver
from blockvis.cases.contents import Case
from blockvis.results.about import rounding_of
from blockvis.results.folder import RANGE, add_to_summary
from blockvis.results.reaction_range import COMPLIANCE, FRICTION, WORDS, ReactionRange
from blockvis.system.atomic_files import write_atomic
from blockvis.system.processes import cores
from blockvis.system.worker import LOOK
from blockvis.text import force_text
from solver.mechanics import counted

from .once_more import OnceMore, Traced, takes_steps, traced
from .reopen import open_results
from .step_check import stored_case


@dataclass(frozen=True)
class Variation:
    """What a run has other than the case: factors of all friction coefficients, and those of solver.Controls."""

    friction_factor: float = 1.0
    compliance_factor: float = 1.0
    imperfection_factor: float = 1.0

    def of(self, case: Case) -> Case:
        """Vary a case."""
        laws = {pair: law.with_friction(self.friction_factor) for pair, law in case.interfaces.items()}
        controls = replace(
            case.controls, compliance_factor=self.compliance_factor, imperfection_factor=self.imperfection_factor
        )
        law = case.law.with_friction(self.friction_factor)
        friction, tension = law.friction_coefficient, law.tensile_strength
        return replace(
            case, friction_coefficient=friction, tensile_strength=tension, interfaces=laws, controls=controls
        )


#: One thing at a time, then less friction on softer joints and more on stiffer ones.
VARIATIONS = (
    Variation(friction_factor=1.0 - FRICTION),
    Variation(friction_factor=1.0 + FRICTION),
    Variation(compliance_factor=COMPLIANCE),
    Variation(compliance_factor=1.0 / COMPLIANCE),
    Variation(imperfection_factor=0.0),
    Variation(imperfection_factor=2.0),
    Variation(friction_factor=1.0 - FRICTION, compliance_factor=COMPLIANCE),
    Variation(friction_factor=1.0 + FRICTION, compliance_factor=1.0 / COMPLIANCE),
)


#: How runs end of which nobody knows whether they would have collapsed.
UNFINISHED = (solver.Status.SOLVER_FAILED, solver.Status.INTERRUPTED)


@dataclass(frozen=True)
class PathRange:
    """Several runs of one case, the first as it is."""

    runs: list[tuple[Variation, Traced | None]]  #: None for one that came to nothing.
    units: Sequence[str]  #: Of each settlement: "m" or "rad", whose reaction is a moment.

    @property
    def followed(self) -> list[Traced]:
        """Those that came to an end."""
        return [run for _, run in self.runs if run is not None and run.stop not in UNFINISHED]

    @property
    def falls(self) -> list[tuple[int, float]]:
        """Phases, from 0, and displacements within them [m or rad] of the runs that collapse, the first first."""
        return sorted((run.collapse_phase, run.collapse) for run in self.followed if run.collapse is not None)

    def reaction(self) -> ReactionRange:
        """Range of the reaction at all settlements that one of the runs tells, over the runs that get there."""
        rows = []
        for phase in range(1 + max(int(run.phases.max(initial=0)) for run in self.followed)):
            paths = [(run.parameters[run.phases == phase], run.measured[run.phases == phase]) for run in self.followed]
            paths = [path for path in paths if len(path[0])]
            for s in np.unique(np.concatenate([parameters for parameters, _ in paths])).tolist():
                standing = [path for path in paths if s <= path[0][-1]]
                # Between two increments a reaction is on the line between them; that at rest is left at once.
                at = [float(np.interp(s, *path)) for path in standing if not path[0][0] < s < path[0][1]]
                rows.append((phase, s, min(at), max(at), len(standing)))
        columns = [np.array(column) for column in zip(*rows, strict=True)]
        return ReactionRange(*columns)

    def numbers(self) -> dict[str, Any]:
        """Give what summary.json says of it."""
        runs = [
            {**asdict(variation), "collapse": None if run is None else run.collapse}
            | {"collapse_phase": None if run is None or run.collapse is None else run.collapse_phase + 1}
            | {"status": None if run is None else run.stop}
            for variation, run in self.runs
        ]
        falls = [displacement for _, displacement in self.falls]
        ends = [falls[0], falls[-1] if len(falls) == len(self.followed) else None] if falls else None
        return {"collapse": ends, "runs": runs}

    def __str__(self) -> str:
        """Say it in a line."""
        followed, lost, falls = self.followed, len(self.runs) - len(self.followed), self.falls
        standing = len(followed) - len(falls)
        if not falls:
            last = self.reaction()
            phase = int(last.phases[-1])
            moment = self.units[phase] == "rad"
            # Ends that are the same in all digits that are told are one.
            ends = dict.fromkeys(force_text(float(value), moment) for value in (last.low[-1], last.high[-1]))
            where = self._place(phase, float(last.settlements[-1]))
            said = f"range of reaction {' to '.join(ends)} at {where}, no collapse in {counted(len(followed), 'run')}"
        elif standing:
            without = f"{standing} of {len(followed)} runs without a collapse"
            said = f"range of collapse from {self._place(*falls[0])} on, {without}"
        else:
            alike = falls[0][0] == falls[-1][0]
            first = f"{falls[0][1]:.6g}" if alike else self._place(*falls[0])
            said = f"range of collapse {first} to {self._place(*falls[-1])}"
        down = sum(run.stop == solver.Status.NO_INITIAL_EQUILIBRIUM for run in followed)
        unstable = f"; {counted(down, 'run')} without an initial equilibrium" if down else ""
        nothing = f"; {counted(lost, 'run')} came to nothing" if lost else ""
        return f"{said} ({WORDS}{unstable}{nothing})"

    def _place(self, phase: int, settlement: float) -> str:
        within = f" in phase {phase + 1}" if len(self.units) > 1 else ""
        return f"{settlement:.6g} {self.units[phase]}{within}"


def find_range(folder: str | Path, waiting: Callable[[int, int], None]) -> PathRange:
    """Follow the settlement of a results folder again, varied, on all cores, and write what comes out.

    ``range.csv`` has the range of the reaction, ``range`` in ``summary.json`` that of the collapse. ``waiting`` is
    called before it begins with the number of runs and of those at a time. Raises ``ValueError`` for a run without a
    case file, that follows no settlement in steps, or that came to no end.
    """
    folder = Path(folder)
    case, response = stored_case(folder), open_results(folder)
    if not (takes_steps(case) and response.measured.is_force and response.path):
        raise ValueError(
            f"'{folder}' has no range ({response.analysis}, {counted(len(response.path), 'increment')}); "
            "it takes a settlement whose increments are of Coulomb friction"
        )
    if response.stop in UNFINISHED:
        raise ValueError(f"'{folder}' has no range: its run ended as '{response.stop}'; go on with it first")
    at_once = min(cores(), len(VARIATIONS))
    waiting(len(VARIATIONS), at_once)
    others = _all_followed([variation.of(case) for variation in VARIATIONS], folder, at_once)
    rounding = np.array([rounding_of(response, settlement.unit == "rad") for settlement in response.settlements])
    told = [run and run.without_rounding(rounding) for run in (traced(response), *others)]
    runs = list(zip((Variation(), *VARIATIONS), told, strict=True))
    found = PathRange(runs, [settlement.unit for settlement in response.settlements])
    write_atomic(folder / RANGE, found.reaction().table())
    add_to_summary(folder, range=found.numbers())
    return found


def _all_followed(cases: Sequence[Case], folder: Path, at_once: int) -> list[Traced | None]:
    """Follow cases of one assembly in processes of their own, so many at a time."""
    found: dict[int, Traced | None] = {}
    running: dict[int, OnceMore] = {}
    begun = 0
    try:
        while len(found) < len(cases):
            while begun < len(cases) and len(running) < at_once:
                running[begun] = OnceMore(cases[begun], folder)
                begun += 1
            for number, process in list(running.items()):
                with contextlib.suppress(TimeoutError):
                    found[number] = process.found(LOOK / at_once)
                    running.pop(number).close()
    finally:
        for process in running.values():
            process.close()
    return [found[number] for number in range(len(cases))]
