"""Ties, props and bars in a results folder: which there are, their table, and what the summary says of each."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

import solver
from blockvis.system.atomic_files import write_atomic
from blockvis.text import force_text
from solver import mechanics

from .about import EXACT, certified, unit_and_phase
from .npz import packed, read_stored
from .tables import removals

#: File of the ties of a results folder, which is there where it has any.
TIES = "ties.npz"

#: Words of the states, in the order of ``solver.mechanics.TieForces.states``.
STATE_WORDS = ("absent", "slack", "elastic", "yielding", "broken")

#: Part of its prestress that a tie has as it begins, below which that is told: blocks that stand leave it all.
KEPT = 0.9

#: Ties whose force is drawn over the settlement: more would not be told apart.
MOST_CURVES = 6

#: Columns of ties.csv, before those that response.csv has for a parameter of its own.
COLUMNS = ("increment", "phase", "settlement", "name", "kind", "force", "elongation", "state")


@dataclass(frozen=True)
class _Members:
    """The ties of a structure, as they are stored."""

    ties: tuple[solver.Tie, ...]


def write_ties(folder: Path, ties: Sequence[solver.Tie]) -> None:
    """Write the ties of a results folder; none takes the file away."""
    if ties:
        write_atomic(folder / TIES, packed(_Members(tuple(ties))))
    else:
        (folder / TIES).unlink(missing_ok=True)


def stored_ties(folder: Path, increments: Sequence[solver.Increment] = ()) -> tuple[solver.Tie, ...]:
    """Read the ties of a results folder, and of its ``increments``; none where it has none.

    Raises ``ValueError`` for a file that no run has written, and where increments have other ties than the file.
    """
    file = folder / TIES
    ties = read_stored(file, _Members).ties if file.is_file() else ()
    told = len(increments[-1].ties.forces) if increments else 0
    if told not in (0, len(ties)):
        what = "is missing" if not file.is_file() else f"has {len(ties)}"
        carried = mechanics.counted(told, "tie")
        raise ValueError(f"'{file}' {what}, but increments have {carried}; copy it again or run the case again")
    return ties


def ties_at(ties: Sequence[solver.Tie], assembly: solver.Assembly, increment: solver.Increment) -> mechanics.TieForces:
    """Give what ties do at an increment; where that is not known, where their ends are."""
    found = increment.ties
    if len(found.forces) == len(ties):
        return found
    n = len(ties)
    ends = mechanics.tie_ends(ties, assembly, increment.pose)
    return mechanics.TieForces(np.zeros(n), np.zeros(n), np.full(n, np.nan), np.zeros(n, dtype=np.int64), ends)


def tie_rows(ties: Sequence[solver.Tie], increment: solver.Increment) -> list[tuple[Any, ...]]:
    """Make the rows of ties.csv for an increment, in the order of :data:`COLUMNS`, but for its place."""
    found = increment.ties
    return [
        (tie.name, tie.kind, repr(float(force)), repr(float(elongation)), STATE_WORDS[state])
        for tie, force, elongation, state in zip(ties, found.forces, found.elongations, found.states, strict=True)
    ]


@dataclass(frozen=True)
class TieCourse:
    """What a tie does along a path, or at the state that governs, as summary.json has it."""

    name: str
    kind: str
    largest_force: float  #: [N] Tension positive.
    largest_force_at: float  #: [m or rad] Settlement there.
    phase: int  #: Of that settlement, from 1.
    #: [m or rad] First settlements at which it does, and their phases, from 1.
    yields_at: float | None = None
    breaks_at: float | None = None
    yields_in_phase: int | None = None
    breaks_in_phase: int | None = None
    first_force: float | None = None  #: [N] At the first equilibrium in which it is there; None where it never is.
    last_force: float = 0.0  #: [N] At the last equilibrium.
    last_state: str = STATE_WORDS[mechanics.ABSENT]  #: Of that equilibrium.


class TieCourses:
    """The courses of ties over the increments in equilibrium so far: one per tie, none before the first increment."""

    def __init__(self, ties: Sequence[solver.Tie]) -> None:
        self.ties = tuple(ties)
        self.courses: tuple[TieCourse, ...] = ()

    def add(self, increment: solver.Increment) -> None:
        """Take an increment into account."""
        if not self.ties or increment.status != solver.Status.EQUILIBRIUM:
            return
        found, at, phase = increment.ties, float(increment.parameter), increment.phase + 1
        least = EXACT * float(np.abs(increment.forces).max(initial=0.0))
        courses = self.courses or [TieCourse(tie.name, tie.kind, 0.0, at, phase) for tie in self.ties]
        self.courses = tuple(
            _after(before, tie, float(force), int(state), at, phase, least)
            for before, tie, force, state in zip(courses, self.ties, found.forces, found.states, strict=True)
        )


def _after(
    before: TieCourse, tie: solver.Tie, force: float, state: int, at: float, phase: int, least: float
) -> TieCourse:
    """Take a force [N], above the least that is no rounding, and a state of a tie at a settlement into account."""
    if state == mechanics.BROKEN and before.breaks_at is None:
        # It has carried its strength since the last increment.
        force = -tie.strength if tie.kind == mechanics.PROP else tie.strength
    elif state == mechanics.YIELDING:
        # Forces of an equilibrium may be a little below it.
        force = math.copysign(tie.strength, force)
    elif abs(force) < least:
        force = 0.0
    found: dict[str, Any] = {}
    if larger := abs(force) - abs(before.largest_force) > least:
        found["largest_force"] = float(force)
    begins = before.last_state == STATE_WORDS[mechanics.ABSENT] and state != mechanics.ABSENT
    # One that never carries is told where it begins to be there.
    if larger or begins:
        found |= {"largest_force_at": at, "phase": phase}
    if begins:
        found["first_force"] = float(force)
    for word, when in (("yields", mechanics.YIELDING), ("breaks", mechanics.BROKEN)):
        if state == when and getattr(before, f"{word}_at") is None:
            found |= {f"{word}_at": at, f"{word}_in_phase": phase}
    last = 0.0 if state == mechanics.BROKEN else float(force)
    return replace(before, **found, last_force=last, last_state=STATE_WORDS[state])


def tie_courses(response: solver.Response) -> tuple[TieCourse, ...]:
    """Work out what each tie of a response does along its path, gone through once, or at the state that governs."""
    courses = TieCourses(response.ties)
    for increment in certified(response):
        courses.add(increment)
    return courses.courses


@dataclass(frozen=True)
class TieForceCurves:
    """Forces of the ties over the increments in equilibrium."""

    names: tuple[str, ...]  #: Of at most :data:`MOST_CURVES` ties that carry, the largest force first.
    forces: np.ndarray  #: (n_increments, n_names) array [N]: tension positive; nan where a tie is not there.
    states: np.ndarray  #: (n_increments, n_names) int array: numbers of :data:`STATE_WORDS`.


def tie_force_curves(response: solver.Response) -> TieForceCurves | None:
    """Collect the forces of ties along a path; None where none carries."""
    ties, path = response.ties, response.path
    if not ties or len(path) < 2:
        return None
    found = [increment.ties for increment in path]
    forces, states = np.array([of.forces for of in found]), np.array([of.states for of in found])
    forces = np.where(np.isin(states, (mechanics.ELASTIC, mechanics.YIELDING)), forces, 0.0)
    forces[states == mechanics.ABSENT] = np.nan
    largest = np.nan_to_num(np.abs(forces)).max(axis=0)
    told = (largest > EXACT * response.total_weight) | (states == mechanics.BROKEN).any(axis=0)
    chosen = [k for k in np.argsort(-largest, kind="stable").tolist() if told[k]][:MOST_CURVES]
    if not chosen:
        return None
    return TieForceCurves(tuple(ties[k].name for k in chosen), forces[:, chosen], states[:, chosen])


def tie_texts(course: TieCourse, response: solver.Response) -> tuple[str, str, str]:
    """Say what a tie of a response is, its largest force and where, and what became of it."""

    def place(at: float, phase: int) -> str:
        return f"{at:.4g} {unit_and_phase(response, phase - 1)}"

    name = f"{course.name} ({course.kind})" if course.kind not in course.name.split() else course.name

    def carried(force: float) -> str:
        return f"{force_text(abs(force))} {'tension' if force > 0.0 else 'compression'}" if force else "no force"

    if not response.parameter.is_path:
        # States that stand by themselves have no before.
        load = f", load at x = {course.largest_force_at:.6g} m" if len(response.path) > 1 else ""
        return name, carried(course.last_force), f"{course.last_state}{load}"
    if course.first_force is None:
        return name, "never installed", ""
    # It breaks between two increments.
    at = "by" if (course.largest_force_at, course.phase) == (course.breaks_at, course.breaks_in_phase) else "at"
    where = f" {at} {place(course.largest_force_at, course.phase)}" if course.largest_force else ""
    largest = f"{carried(course.largest_force)}{where}"
    fates = (("yields", course.yields_at, course.yields_in_phase), ("breaks", course.breaks_at, course.breaks_in_phase))
    told = ((word, place(at, phase)) for word, at, phase in fates if at is not None and phase is not None)
    # A limit load is found anew at each settlement, the path goes on between two.
    when = "under the limit load" if response.limits else "or before"
    fate = [f"{word} at {where} {when}" for word, where in told]
    prestress = next(tie.prestress for tie in response.ties if tie.name == course.name)
    if not response.limits and abs(course.first_force) < KEPT * prestress:
        left = force_text(abs(course.first_force))
        fate.insert(0, f"the blocks leave {left} of its prestress of {force_text(prestress)}")
    # What yields and breaks was told.
    said = {"yielding": course.yields_at, "broken": course.breaks_at}.get(course.last_state)
    # What falls as soon as it is taken away carried it at the last equilibrium.
    if taken := [one["phase"] for one in removals(response) if course.name in one["ties"]]:
        fate.append(f"taken away before settlement {taken[0]}")
    elif said is None:
        fate.append(
            f"{course.last_state} at the end, {force_text(abs(course.last_force))}"
            if course.last_force
            else f"{course.last_state} at the end"
        )
    return name, largest, ", ".join(fate)
