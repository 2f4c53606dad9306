"""What pictures and pages say about a response beside its numbers: where it comes from, and how much of it falls."""

from __future__ import annotations

import contextlib
import math
import time
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

import solver
from blockvis.dynamics.fall import with_mechanism
from blockvis.text import force_text, listed
from solver import mechanics

from .increments import folder_of
from .record import Record, read_json, read_record, versions

#: A mechanism that takes less than this share of the weight with it is the loss of a few blocks: the structure stands.
LOCAL = 0.05

#: Equilibria are exact to this: openings and slips in block sizes, forces and multipliers in the largest, motions in
#: those of the fastest block, reactions in the weight, of moments at the extent of what it acts on.
EXACT = 1e-6


@dataclass(frozen=True)
class About:
    """Where a response comes from."""

    #: Name of the case, empty for one made in Python, and of its file.
    name: str
    file: str
    finished: str  #: When it was found.
    version: str  #: Of this program, when the run began.


#: What pictures, pages and folders are made of.
Result = solver.Response | solver.LimitLoad | solver.Envelope


def response_of(result: Result) -> solver.Response:
    """Take limit loads as an analysis of their own; raises ``TypeError`` for what is no result."""
    if isinstance(result, solver.LimitLoad | solver.Envelope):
        return result.response
    if not isinstance(result, solver.Response):
        raise TypeError(f"{type(result).__name__} is no response; give what settle, pushover or limit_load returns")
    return result


def limit_states(response: solver.Response) -> list[tuple[solver.LimitLoad, solver.Increment]]:
    """Pair each limit load with the increment that reports it; one found in an interruption has none yet.

    Limit states come first, in the order of the limit loads; frames of a fall or a mechanism follow.
    """
    return list(zip(response.limits, response.increments, strict=False))


def governing_limit(response: solver.Response) -> solver.LimitLoad | None:
    """Find the limit load of the increment that decides; none where that is no limit state."""
    return next((limit for limit, state in limit_states(response) if state is response.governing), None)


def about(response: solver.Response) -> About:
    """Find where a response comes from, by the results folder that its increments are in."""
    folder = folder_of(response.increments[0]) if response.increments else None
    record, finished = Record(versions=versions()), ""
    if folder is not None:
        with contextlib.suppress(ValueError):
            record = read_record(folder)
        with contextlib.suppress(OSError, ValueError, KeyError):
            finished = str(read_json(folder / "summary.json")["finished"])
    stamp = finished or time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime())
    # Fonts have no letters for parts of a name in another encoding.
    file = Path(record.case_file.encode(errors="backslashreplace").decode())
    return About(
        name=file.stem,
        file=file.name or "no case file",
        finished=stamp.replace("T", " ").replace("Z", " UTC"),
        version=f"blockvis {record.versions.get('blockvis', '')}".strip(),
    )


def least_reaction(first: solver.Increment) -> float:
    """Find the reaction [N or N·m] that a first movement of the supports has to overcome, before anything has moved.

    It is the least that equilibrium allows there; the reaction at rest where equilibrium sets no bound.
    """
    return float(first.least if math.isfinite(first.least) else first.reaction)


def in_phase(response: solver.Response, phase: int) -> str:
    """Say in which of several settlements, by its number from 0, a place is; empty where there is but one."""
    return f" in phase {phase + 1}" if len(phases_of(response)) > 1 else ""


def unit_and_phase(response: solver.Response, phase: int) -> str:
    """Write the unit of the parameter in a phase, and which of several settlements it is."""
    return f"{unit_in(response, phase)}{in_phase(response, phase)}"


def told_reaction(value: float, response: solver.Response, moment: bool) -> float:
    """Give a reaction [N, or N·m of a moment] as it is told: 0 where it is the rounding of none."""
    return value if abs(value) > rounding_of(response, moment) else 0.0


def rounding_of(response: solver.Response, moment: bool) -> float:
    """Give the rounding of a reaction [N], or of a moment [N·m]: weight acts as far from supports as its extent."""
    assembly = response.assembly
    extent = float(np.ptp(assembly.vertices[assembly.free[assembly.block_of_vertex]], axis=0).max())
    return EXACT * response.total_weight * (extent if moment else 1.0)


@dataclass(frozen=True)
class Course:
    """What the increments of an analysis run over and what is measured along them."""

    parameter: mechanics.Quantity
    measured: mechanics.Quantity
    settlements: tuple[solver.Settlement, ...] = ()  #: Along which they run, or after which they begin.
    control: solver.ControlDisplacement | None = None  #: What drives the parameter where no settlement does.

    @property
    def drivers(self) -> tuple[solver.Settlement | solver.ControlDisplacement, ...]:
        """How far the parameter goes in each phase; empty where no limit is known."""
        return phases_of(self) if self.control is None else (self.control,)


#: What runs over a parameter and is measured, found or to come.
Measured = solver.Response | Course


def phases_of(course: Measured) -> tuple[solver.Settlement, ...]:
    """Give the settlements whose phases the parameter belongs to; none where it begins after them."""
    return course.settlements if course.parameter.name == mechanics.SETTLEMENT.name else ()


def after_settlements(response: solver.Response) -> str:
    """Say after which settlements a path over another parameter stands; empty where there are none, or no such path."""
    before = () if phases_of(response) or not response.path else response.settlements
    told = listed([f"{settlement.limit:.6g} {settlement.unit}" for settlement in before])
    return told and f"after {'settlements' if len(before) > 1 else 'a settlement'} of {told}"


def settlement_in(course: Measured, phase: int) -> solver.Settlement | None:
    """Give the settlement of a phase, by its number from 0, and of what follows the last that one's; None for none."""
    phases = phases_of(course)
    return phases[min(phase, len(phases) - 1)] if phases else None


def unit_in(course: Measured, phase: int) -> str:
    """Give the unit of the parameter in a phase, by its number from 0: "m" or "rad" of a settlement."""
    settlement = settlement_in(course, phase)
    return course.parameter.unit if settlement is None else settlement.unit


@dataclass(frozen=True)
class Quantities:
    """What the increments of a phase run over, and what their reaction is: that of live loads is a force."""

    parameter: mechanics.Quantity = mechanics.SETTLEMENT
    reaction: mechanics.Quantity = mechanics.REACTION
    motion: str = "m"  #: Unit by which the motion that follows goes: a mechanism goes by its largest movement.


STATIC = Quantities()


def quantities_in(course: Measured, phase: int) -> Quantities:
    """Give the quantities of a phase, by its number from 0."""
    unit = unit_in(course, phase)
    reaction = mechanics.reaction_to(unit) if course.measured.is_force else mechanics.REACTION
    return Quantities(replace(course.parameter, unit=unit), reaction, "rad" if reaction.unit == "N·m" else "m")


def quantities_of(course: Measured) -> tuple[Quantities, ...]:
    """Give the quantities of each phase; of what has no settlement those of the whole."""
    return tuple(quantities_in(course, phase) for phase in range(max(len(phases_of(course)), 1)))


def collapse_phase(response: solver.Response) -> int | None:
    """Find the number of the settlement, from 0, in which a structure collapses; None where it does not."""
    collapse, path = response.collapse, response.path
    if collapse is None:
        return None
    falling = next((i.phase for i in response.increments if i.status == solver.Status.FALLING), None)
    if falling is not None or not path:
        return falling or 0
    # What falls as soon as a phase begins has its last equilibrium at the end of the one before.
    return path[-1].phase + int(collapse.bracket[1] < path[-1].parameter)


def certified(response: solver.Response) -> tuple[solver.Increment, ...]:
    """Give the increments whose certificate is that of the result: of states that stand by themselves what governs."""
    governing = response.governing
    return response.path if response.parameter.is_path or governing is None else (governing,)


def collapse_mechanism(response: solver.Response) -> mechanics.Mechanism | None:
    """Find the collapse mechanism, which words, tables, curves, pictures and pages count; None where there is none."""
    begins = with_mechanism(response)
    return None if begins is None else mechanics.mechanism_of(response.assembly, begins)


def mechanism_text(response: solver.Response) -> str:
    """Say in words how a structure collapses; empty where it does not."""
    mechanism = collapse_mechanism(response)
    if mechanism is not None:
        return str(mechanism)
    return "" if response.collapse is None else response.collapse.words


def counts_text(mechanism: mechanics.Mechanism) -> str:
    """Count the moving parts, hinges, sliding and crushing joints of a mechanism."""
    parts = (
        (len(mechanism.motions), "moving part"),
        (len(mechanism.hinges), "hinge"),
        (len(mechanism.sliding), "sliding joint"),
        (len(mechanism.crushing), "crushing joint"),
    )
    return ", ".join(mechanics.counted(n, word) for n, word in parts if n)


@dataclass(frozen=True)
class Loss:
    """What a collapse mechanism takes with it."""

    weight: float  #: [N] Of the free blocks that move in the mechanism.
    share: float  #: Of the weight of the free blocks that have not been taken away.

    @property
    def local(self) -> bool:
        """Whether a few blocks are lost and the structure stands."""
        return self.share < LOCAL

    def __str__(self) -> str:
        """Say what is lost, and how much."""
        what = "local loss, the structure stands" if self.local else "collapse of the structure"
        return f"{what}: {force_text(self.weight)} fall, {100.0 * self.share:.3g} % of the weight"


def loss_in(assembly: solver.Assembly, falling: solver.Increment) -> Loss:
    """Weigh what moves in the motion that follows an increment."""
    moves = mechanics.rigid_parts(assembly, falling) >= 0
    masses = assembly.masses * (assembly.free & ~falling.removed)
    return Loss(float(masses[moves].sum() * solver.GRAVITY), float(masses[moves].sum() / masses.sum()))


def losing(response: solver.Response) -> solver.Increment | None:
    """Find the increment from which the collapse mechanism takes blocks; None where a response loses no equilibrium."""
    lost = response.collapse is not None and response.collapse.lost != "capacity"
    return with_mechanism(response) if lost else None


def loss_of(response: solver.Response) -> Loss | None:
    """Weigh what the collapse mechanism of a response takes with it; None where nothing collapses."""
    begins = losing(response)
    return None if begins is None else loss_in(response.assembly, begins)
