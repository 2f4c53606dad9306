"""A kind of analysis: what it runs over, what it measures, its keys, its increments, and its words.

A new kind is an object of :class:`AnalysisKind` in a file of its own, with a row in :mod:`blockvis.kinds.kinds`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Generator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import NoneType
from typing import Any

import solver
from blockvis.cases.build import case_interfaces
from blockvis.cases.contents import Case
from blockvis.cases.key import Key, Section, read_keys
from blockvis.cases.toml_table import Table
from blockvis.formats.reading import naming
from blockvis.results.about import Course
from solver import mechanics
from solver.mechanics import counted

#: How a kind works its increments out, for :class:`solver.mechanics.Increments`.
Steps = Generator[solver.Increment, None, mechanics.Ending]


@dataclass(frozen=True)
class RunInput:
    """What an analysis starts from, and who listens to its steps."""

    case: Case
    assembly: solver.Assembly
    interfaces: solver.Interfaces
    loads: solver.Loads
    changes: tuple[solver.PhaseChange, ...] = ()
    ties: tuple[solver.Tie, ...] = ()
    listeners: list[Callable[[mechanics.PathState], None]] = field(default_factory=list)

    def step(self, state: mechanics.PathState) -> None:
        """Tell who listens where a step within an increment has led."""
        for listener in self.listeners:
            listener(state)


@dataclass
class AnalysisRun:
    """An analysis that is ready to run."""

    analysis: str  #: Name of the kind.
    given: RunInput
    course: Course
    #: None by default, for those that fill in the other fields as they go.
    steps: mechanics.Increments = field(default_factory=lambda: without_increments())
    limits: list[solver.LimitLoad] = field(default_factory=list)  #: Filled as the steps go, one per limit state.

    def recorded(self, increments: Sequence[solver.Increment]) -> None:
        """Let the last limit load share the arrays of the increment that reports it, the last that is written."""
        if len(self.limits) == len(increments):
            self.limits[-1] = replace(self.limits[-1], held=increments[-1].held)

    def response(self, increments: Sequence[solver.Increment], ending: mechanics.Ending) -> solver.Response:
        """Make a response of the increments so far and how they ended."""
        return solver.Response(
            assembly=self.given.assembly,
            settlements=self.course.settlements,
            interfaces=self.given.interfaces,
            loads=self.given.loads,
            increments=tuple(increments),
            stop=ending.stop,
            message=ending.message,
            collapse=ending.collapse,
            analysis=self.analysis,
            limits=tuple(self.limits),
            parameter=self.course.parameter,
            measured=self.course.measured,
            control=self.course.control,
            ties=self.given.ties,
            changes=self.given.changes,
        )


class AnalysisKind(ABC):
    """A kind of analysis."""

    name: str  #: As ``[analysis] kind`` has it.
    parameter: mechanics.Quantity
    measured: mechanics.Quantity
    checkpoint: type[Any] = NoneType  #: Dataclass from which its increments go on; NoneType where they start again.
    has_phases: bool = False  #: Whether blocks and dead loads may change between its settlements.
    keys: tuple[Key, ...] = ()  #: That it reads from [analysis].
    sections: tuple[Section, ...] = ()  #: Tables of the case file that it has for itself.

    @abstractmethod
    def start(self, given: RunInput, resume: Any, found: Sequence[solver.Increment]) -> AnalysisRun:
        """Prepare the analysis of a case, its input checked.

        It goes on from a ``checkpoint``, if there is one to resume, after the increments found up to there. ValueError
        for input that cannot be analysed.
        """

    def read(self, top: Table, analysis: Table) -> Any:
        """Read the keys of this kind from the whole file and its [analysis]; the same keys give equal values."""
        return read_keys(self.keys, analysis)

    def refuse(self, settings: Any, case: Case) -> None:
        """Raise ValueError where a case of another kind gives keys of this one, as :meth:`read` gives them."""
        return

    def checked(self, case: Case) -> Case:
        """Check that the keys of a case of this kind fit together; returns the case, completed."""
        return case

    @property
    def capacity(self) -> mechanics.Quantity:
        """At which value of what a structure collapses, as studies tell it."""
        return self.parameter

    def course(self, case: Case) -> Course:
        """Say what the increments of a case run over and measure."""
        return Course(self.parameter, self.measured)

    def restored(self, response: solver.Response, summary: Mapping[str, Any]) -> solver.Response:
        """Complete the response of a results folder by what this kind has put into the summary."""
        return replace(response, parameter=self.parameter, measured=self.measured)

    def summary(self, response: solver.Response) -> dict[str, Any]:
        """Keys of summary.json beside those of every analysis."""
        return {}

    def tables(self, response: solver.Response) -> dict[str, str]:
        """Tables for the results folder beside response.csv: text by file name."""
        return {}

    def headline(self, response: solver.Response) -> str:
        """How it ended, for the command line."""
        return f"{response.stop} after {counted(len(response.path), 'increment')}"

    def covers_message(self, response: solver.Response) -> bool:
        """Whether :meth:`lines` say what the message of the response says."""
        return response.collapse is not None

    @abstractmethod
    def lines(self, response: solver.Response) -> list[str]:
        """Numbers for the command line."""

    @abstractmethod
    def title(self, response: solver.Response) -> str:
        """Title of the report."""

    @abstractmethod
    def rows(self, response: solver.Response) -> list[tuple[str, str]]:
        """Numbers for the report, in words and with units."""


def without_increments() -> mechanics.Increments:
    """Make the increments of an analysis that has none: it is at its limit where it begins."""

    def steps() -> Steps:
        return mechanics.Ending(solver.Status.LIMIT_REACHED)
        yield

    return mechanics.Increments(steps())


def needs_live_load(case: Case) -> None:
    """Raise ValueError where no load of a case is live."""
    if not any(load.kind == "live" for load in case.loads):
        raise ValueError(
            f'{case.source}: [analysis] kind is "{case.analysis}", but no load is live; add [[loads]] with kind = '
            '"live", for instance weight_fraction = [1.0, 0.0]'
        )


def needs_no_crushing(case: Case, when: str = "") -> None:
    """Raise ValueError where a joint of a case has a compressive strength, which no path follows, or too much else."""
    interfaces = case_interfaces(case)
    with naming(str(case.source)):
        interfaces.refuse_crushing(f"a {case.analysis}{when}")
        if case.controls.increments == mechanics.LINEAR_PROGRAM:
            interfaces.refuse_mortar(f'[analysis] increments = "{case.controls.increments}"')
