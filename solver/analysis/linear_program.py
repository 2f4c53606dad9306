"""The paper's method, for comparison and teaching: a linear program per increment, gaps closed by further programs.

Portioli & Cascini, Engineering Structures 148 (2017) 485-496, https://doi.org/10.1016/j.engstruct.2017.06.073. Right to
every digit where structures hinge; where many joints slide its path depends on rounding, see :mod:`.path`.
"""

from __future__ import annotations

from collections.abc import Generator, Iterator, Sequence
from dataclasses import replace

import numpy as np

from solver.assembly import Assembly
from solver.interfaces import Interfaces
from solver.kinematics import (
    Pose,
    motion_size,
    moved,
    moved_vertices,
    point_velocities,
    relative_velocities,
    unit_lengths,
)
from solver.loads import Loads, Settlement
from solver.lp.problem import SolveError
from solver.program.correction import Falls, NotConverged, at_rest, corrected, solve_again
from solver.program.increment import Locked, Solved, solve_program
from solver.program.model import Model
from solver.results.increment import Increment, State, Status
from solver.results.mechanism import mechanism_of
from solver.results.response import Collapse
from solver.tolerances import FARTHEST_FALL, JUMP, OVERLAP

from .checkpoint import Note, Place, ProgramCheckpoint
from .controls import Controls, Ending
from .local_fall import jump_words, snapped
from .reports import no_equilibrium

#: The mechanism has changed within an increment when the velocities before and after differ by this much of their
#: size, weighted by mass, times the root of the number of blocks (in a wall a few bricks always change their ways),
#: up to the second number. Hinges that move change it by more, the slow turning of the geometry by less.
EVENT_CHANGE, LARGEST_CHANGE = 0.015, 0.5

#: Places kept to go back to.
PLACES = 16

#: Work that contact forces do on joints which close within an increment, as a fraction of the reaction's, from which on
#: the forces are read again before any has closed; the second in large models, whose corrections leave as much open.
#: At the start of the first phase nothing is left open.
CLOSING_WORK, CLOSING_WORK_LARGE, CLOSING_WORK_AT_START = 1e-3, 1e-2, 1e-6

#: Snaps of light pieces in one phase after which the structure is said to fall apart.
SNAPS = 100

#: Step by which a reaction is read off at the last equilibrium, in block sizes.
PROBE = 1e-6


class _NotHere(Falls):
    """The place itself, reached without proof, has no equilibrium."""


def linear_program_increments(
    assembly: Assembly,
    phases: Sequence[Settlement],
    interfaces: Interfaces,
    loads: Loads,
    controls: Controls,
    resume: ProgramCheckpoint | None = None,
) -> Generator[Increment, None, Ending]:
    """The increments of :func:`solver.settle` by the paper's method; returns how they ended."""
    model = _model(assembly, phases, interfaces, loads, controls)
    pose = Pose.initial(assembly)
    try:
        # Gaps and overlaps within the accuracy of the drawing are closed before anything moves.
        pose = at_rest(model, pose, controls.correctors) if resume is None else resume.start
    except Falls as fall:
        yield _falling_frame(model, fall.solved, 0.0, 0)
        return Ending(Status.NO_INITIAL_EQUILIBRIUM, no_equilibrium(assembly, fall.solved.motion))
    except (Locked, SolveError, NotConverged) as error:
        return Ending(Status.SOLVER_FAILED, f"before any settlement: {error}")
    ending = _reached(phases[-1])
    first = 0 if resume is None else resume.phase
    for number, phase in enumerate(phases[first:], start=first):
        path = _Path(model, phase, number, pose, controls, resume if number == first else None)
        try:
            ending = yield from path.follow()
        except (Locked, SolveError) as error:
            # While forces at the last equilibrium were read: everything found so far has been told.
            return Ending(Status.SOLVER_FAILED, f"at a settlement of {path.here.s:.6g} {phase.unit}: {error}")
        if ending.stop is not Status.LIMIT_REACHED:
            return ending
        pose = path.here.pose
    return ending


def _reached(phase: Settlement) -> Ending:
    return Ending(Status.LIMIT_REACHED, f"the settlement reached its limit of {phase.limit:g} {phase.unit}")


class _Path:
    """The equilibrium path of one settlement phase.

    The path goes from place to place. It keeps the last few it has left, because whether a place really is an
    equilibrium, and whether the mechanism changed on the way to it, is only known from the program solved there.
    """

    def __init__(
        self,
        model: Model,
        phase: Settlement,
        number: int,
        start: Pose,
        controls: Controls,
        resume: ProgramCheckpoint | None = None,
    ) -> None:
        self.model, self.phase, self.number, self.controls, self.start = model, phase, number, controls, start
        self.here = Place(0.0, start)
        self.left: list[Place] = []
        self.first_without = np.inf
        self.told = -np.inf
        self.finest = phase.increment / max(controls.event_refinement, 1)
        self.tolerance = float(phase.tolerance or phase.increment / 100.0)
        self.probe = PROBE * model.length / _lever(model.assembly, phase, start)
        self.step = phase.increment
        self.fallen, self.snaps = np.zeros(model.assembly.n_blocks), 0
        self.notes: tuple[Note, ...] = ()
        if resume is not None:
            self.here, self.left, self.step = resume.here, list(resume.left), min(resume.step, phase.increment)
            self.first_without, self.told = resume.first_without, resume.told
            self.snaps, self.notes = resume.snaps, resume.notes
            self.fallen = self.fallen if resume.fallen is None else resume.fallen

    def _checkpoint(self) -> ProgramCheckpoint:
        return ProgramCheckpoint(
            phase=self.number,
            start=self.start,
            here=self.here,
            left=tuple(self.left),
            step=self.step,
            first_without=self.first_without,
            told=self.told,
            fallen=self.fallen,
            snaps=self.snaps,
            notes=self.notes,
        )

    def _next_phase(self) -> ProgramCheckpoint:
        pose = self.here.pose
        return ProgramCheckpoint(self.number + 1, pose, Place(0.0, pose), (), np.inf, np.inf, -np.inf)

    def follow(self) -> Generator[Increment, None, Ending]:
        """Yields the increments of the phase, each when it is left behind; returns how the phase ended."""
        phase, step = self.phase, self.step
        locked: tuple[float, Locked] | None = None
        while True:
            here = self.here
            # The last place is looked at like any other: as if the path went on.
            at_limit = here.s >= phase.limit * (1.0 - 1e-12)
            step = (here.step or phase.increment) if at_limit else self._shortened(step)
            predictor = None
            try:
                predictor = self._predict(here, step)
                changed = predictor.falling or self._mechanism_changed(predictor, step)
                coarse = bool(self.left) and here.step > self.finest * (1.0 + 1e-9)
                if changed and coarse and not predictor.falling:
                    step = self._go_back()
                    continue
                if changed and not here.proved:
                    self._prove()
                    continue
                if at_limit:
                    if here.s > self.told and not predictor.falling:
                        last = self._left(predictor, step)
                        self.told = here.s
                        yield replace(self._noted(last), checkpoint=self._next_phase())
                    break
                if predictor.falling:
                    if step <= self.tolerance:
                        if here.step > self.tolerance and self._read(here.s, here.pose).falling:
                            # This place holds nothing itself: the last that does is further back than the tolerance.
                            raise _NotHere(predictor)
                        if (yield from self._goes_on(here.s, predictor)):
                            step = self.step
                            continue
                        return (yield from self._collapse(here.s + step, predictor))
                    step /= 2.0
                    continue
                target = phase.displaced(self.model.assembly, self.start, here.s + step)
                proved = bool(np.isfinite(self.first_without))
                nudge = self._nudge(here.s + step) if proved else None
                pose = corrected(self.model, predictor, target, self.controls.correctors, nudge=nudge)
                self._refuse_overlap(pose)
            except _NotHere as fall:
                if not self.left:
                    yield _falling_frame(self.model, fall.solved, here.s, self.number)
                    message = no_equilibrium(self.model.assembly, fall.solved.motion)
                    return Ending(Status.NO_INITIAL_EQUILIBRIUM, message)
                self.first_without = min(self.first_without, here.s)
                step = self._go_back()
                if self.first_without - self.here.s <= self.tolerance * (1.0 + 1e-9):
                    if (yield from self._goes_on(here.s, fall.solved)):
                        step = self.step
                        continue
                    return (yield from self._collapse(self.first_without, fall.solved))
                continue
            except Falls as fall:
                self.first_without = min(self.first_without, here.s + step)
                if self.first_without - here.s <= self.tolerance * (1.0 + 1e-9):
                    if (yield from self._goes_on(here.s + step, fall.solved)):
                        step = self.step
                        continue
                    return (yield from self._collapse(self.first_without, fall.solved))
                step /= 2.0
                continue
            except (Locked, NotConverged, SolveError) as error:
                if at_limit:
                    break
                if predictor is None and isinstance(error, Locked) and step <= self.tolerance:
                    locked = here.s, error
                step /= 2.0
                if step < self.tolerance / 64.0:
                    yield from self._tell_last()
                    if locked is not None and locked[0] == here.s and isinstance(error, SolveError):
                        # Proved by a step within the tolerance; in much smaller ones the proof drowns in rounding.
                        error = locked[1]
                    stop = Status.LOCKED if isinstance(error, Locked) else Status.SOLVER_FAILED
                    return Ending(stop, f"at a settlement of {here.s:.6g} {phase.unit}: {error}")
                continue
            if here.s + step >= self.first_without:
                self.first_without = np.inf
            found = self._noted(self._left(predictor, step)) if here.s > self.told else None
            self.told = max(self.told, here.s)
            self.left = [*self.left[1 - PLACES :], here]
            self.here = Place(here.s + step, pose, step, predictor.motion / step, proved)
            self.step = step = min(2.0 * step, phase.increment)
            if found is not None:
                yield replace(found, checkpoint=self._checkpoint())
        yield from self._tell_last()
        return _reached(phase)

    def _shortened(self, step: float) -> float:
        """The step, not past the limit, and half-way to where equilibrium is known to be lost."""
        rest = self.first_without - self.here.s
        if np.isfinite(rest):
            step = rest if rest <= self.tolerance else min(step, rest / 2.0)
        return min(step, self.phase.limit - self.here.s, self.phase.step_to_stop(self.here.s))

    def _go_back(self) -> float:
        """Returns to the place before; gives the step to try from there."""
        step = self.here.step
        self.here = self.left.pop()
        self._forget_beyond()
        return step / 2.0

    def _prove(self) -> None:
        """Makes sure that this place is an equilibrium, moving on to the nearest one where a hinge has to jump."""
        here, nudge = self.here, self._nudge(self.here.s)
        try:
            pose = at_rest(self.model, here.pose, self.controls.correctors, nudge)
        except Falls as fall:
            raise _NotHere(fall.solved) from None
        motion = np.column_stack([pose.positions - here.pose.positions, pose.rotations - here.pose.rotations])
        if _largest_movement(self.model, motion) > JUMP * self.model.length:
            # A light piece has fallen, at a stride: its way is followed in small steps where it is one to be followed.
            snap = snapped(self.model, here.pose, motion, self.controls.correctors, nudge)
            if snap is not None:
                pose = snap.pose
                self._note(here.s, snap.words(self.model.assembly))
            else:
                self._note(here.s, jump_words(self.model, here.pose, pose))
        self.here = replace(here, pose=pose, proved=True)

    def _mechanism_changed(self, predictor: Solved, step: float) -> bool:
        """Whether the blocks move otherwise than in the step that led here: hinges jumped, joints opened or closed."""
        here = self.here
        if here.velocity is None:
            return False
        size = np.sqrt(self.model.assembly.masses)[:, None] * unit_lengths(3, self.model.length)
        new, old = predictor.motion / step * size, here.velocity * size
        many = np.sqrt(self.model.assembly.free.sum())
        return bool(np.linalg.norm(new - old) > min(EVENT_CHANGE * many, LARGEST_CHANGE) * np.linalg.norm(old))

    def _predict(self, place: Place, step: float) -> Solved:
        rate = self.phase.rate(self.model.assembly, self.start, place.s)
        return solve_program(self.model, place.pose, rate * step)

    def _refuse_overlap(self, pose: Pose) -> None:
        """A last look at the blocks as they are, contact points or not: none may have come into another."""
        assembly = self.model.assembly
        deepest = OVERLAP * float(assembly.widths.min())
        i, j, depth = assembly.shapes.overlaps(moved_vertices(assembly, pose), deepest)
        worst = np.where(assembly.free[i] | assembly.free[j], depth, 0.0)
        if worst.max(initial=0.0) > deepest:
            k = int(np.argmax(worst))
            raise NotConverged(
                f"block '{assembly.names[i[k]]}' came {worst[k]:.3g} m into block '{assembly.names[j[k]]}'"
            )

    def _nudge(self, s: float) -> np.ndarray:
        return self.phase.rate(self.model.assembly, self.start, s) * (0.1 * self.probe)

    def _read(self, s: float, pose: Pose) -> Solved:
        """The forces at a place, from a program with a step so small that nothing moves."""
        return solve_program(self.model, pose, self.phase.rate(self.model.assembly, self.start, s) * self.probe)

    def _left(self, predictor: Solved, step: float) -> Increment:
        """The increment at the place that is left; its forces are the predictor's unless joints close on the way."""
        increment = self._increment(predictor, step)
        at_start, least = self.number == 0 and not self.left, 1e-6 * self.model.length
        left = least if at_start else max(least, 0.2 * _largest_movement(self.model, predictor.motion))
        closing = predictor.contacts.gaps > left
        work = float(predictor.forces[closing, 0] @ predictor.contacts.gaps[closing])
        allowed = CLOSING_WORK_LARGE if self.model.large else CLOSING_WORK
        if work > (CLOSING_WORK_AT_START if at_start else allowed) * abs(increment.reaction) * step:
            # So small a step that none of them closes, not so small that it cannot close what corrections have left.
            smaller = self.probe if at_start else step / 10.0
            again = self._increment(self._predict(self.here, smaller), smaller)
            return replace(again, programs=increment.programs + again.programs)
        return increment

    def _tell_last(self) -> Iterator[Increment]:
        if self.here.s > self.told:
            self.told = self.here.s
            try:
                last = self._increment(self._read(self.here.s, self.here.pose), self.probe)
            except (Locked, SolveError):
                # No finite force belongs to this state, or none was found: its pose is told, with the forces of the
                # supports at rest.
                last = self._increment(solve_program(self.model, self.here.pose), self.probe)
            yield self._noted(last)

    def _increment(self, solved: Solved, step: float) -> Increment:
        rate = self.phase.rate(self.model.assembly, self.start, self.here.s)
        return _increment(self.model, solved, rate, step, self.here.s, self.number, Status.EQUILIBRIUM)

    def _note(self, s: float, words: str) -> None:
        self.notes = (*self.notes, Note(s, f"at a settlement of {s:.6g} {self.phase.unit} {words}"))

    def _forget_beyond(self) -> None:
        """Drops the notes on places that the path has gone back from."""
        self.notes = tuple(note for note in self.notes if note.s <= self.here.s)

    def _noted(self, increment: Increment) -> Increment:
        """The increment with what is to be told with it."""
        notes, self.notes = self.notes, ()
        return replace(increment, notes=tuple(note.words for note in notes))

    def _goes_on(self, s: float, falling: Solved) -> Generator[Increment, None, bool]:
        """Lets a light piece that falls fall, the supports at s; tells whether it was caught, and the path goes on."""
        # What falls off for good once it has tipped may yet be caught from where it was before: corrections may have
        # left it standing on nothing for several places.
        places = [*self.left, self.here]
        tries = [(s, falling.pose, places)] + [
            (places[k].s, places[k].pose, places[:k]) for k in range(len(places))[::-1]
        ]
        for at, pose, before in tries:
            snap = snapped(self.model, pose, falling.motion, self.controls.correctors, self._nudge(at))
            if snap is None:
                continue
            fallen = self.fallen.copy()
            fallen[snap.blocks] += snap.fall
            if self.snaps == SNAPS or fallen.max() > FARTHEST_FALL * self.model.length:
                continue
            if at > self.here.s > self.told:
                reading = self._read(self.here.s, self.here.pose)
                if not reading.falling:
                    self.told = self.here.s
                    yield replace(self._noted(self._increment(reading, self.probe)), checkpoint=self._checkpoint())
            self.here, self.left = Place(at, snap.pose, proved=True), before[-PLACES:]
            self._forget_beyond()
            self.first_without, self.step = np.inf, self.finest
            self.fallen, self.snaps = fallen, self.snaps + 1
            self._note(at, snap.words(self.model.assembly))
            return True
        return False

    def _collapse(self, first_without: float, falling: Solved) -> Generator[Increment, None, Ending]:
        reading = self._read(self.here.s, self.here.pose)
        if reading.falling and self.left:
            # In balance with the supports at rest, but not with the least further movement: on the verge itself.
            first_without, self.here = self.here.s, self.left.pop()
            reading = self._read(self.here.s, self.here.pose)
        last = self._increment(reading, self.probe)
        if self.here.s > self.told:
            yield self._noted(last)
        falls = _falling_frame(self.model, falling, first_without, self.number)
        collapse = Collapse(
            displacement=(self.here.s + first_without) / 2.0,
            bracket=(self.here.s, first_without),
            reaction=last.reaction,
            mechanism=falling.motion / _largest_movement(self.model, falling.motion),
            unit=self.phase.unit,
            words=str(mechanism_of(self.model.assembly, falls)),
        )
        yield from self._fall(first_without, falling)
        return Ending(Status.COLLAPSED, str(collapse), collapse)

    def _fall(self, s: float, solved: Solved) -> Iterator[Increment]:
        """Pseudo-time frames: the blocks move downhill by a trust region at a time until they rest."""
        if self.controls.frames(self.model.dimension) == 0:
            return
        yield _falling_frame(self.model, solved, s, self.number)
        model = replace(self.model, trust=self.model.length / 10.0)
        for _ in range(self.controls.frames(self.model.dimension) - 1):
            size = _largest_movement(model, solved.motion)
            part = min(1.0, model.trust / size)
            solved = replace(solved, motion=solved.motion * part, slip=solved.slip * part)
            pose = moved(solved.pose, solved.motion)
            try:
                solved = solve_again(model, pose, solved)
            except (Locked, SolveError):
                return
            yield _falling_frame(model, solved, s, self.number)
            if not solved.falling and _largest_movement(model, solved.motion) < 1e-3 * model.trust:
                return


def _largest_movement(model: Model, motion: np.ndarray) -> float:
    return max(float(motion_size(motion, model.length).max(initial=0.0)), 1e-300)


def _lever(assembly: Assembly, phase: Settlement, start: Pose) -> float:
    """Largest displacement of a moving support per unit of s: 1 for a translation, a radius for a rotation."""
    points, block = moved_vertices(assembly, start), assembly.block_of_vertex
    velocity = point_velocities(points, block, start, phase.rate(assembly, start, 0.0))
    return float(np.hypot(*velocity.T).max())


def _model(
    assembly: Assembly, phases: Sequence[Settlement], interfaces: Interfaces, loads: Loads, controls: Controls
) -> Model:
    load = loads.total()
    force = float(np.hypot(*load[assembly.free, :2].T).mean())
    if force == 0.0:
        raise ValueError("no load acts on any free block; give them a weight")
    length = assembly.block_size
    start = Pose.initial(assembly)
    movement = max(phase.increment * _lever(assembly, phase, start) for phase in phases)
    trust = max(length, 10.0 * movement) if controls.trust_region is None else controls.trust_region
    reach = max(min(4.0 * movement, length / 2.0), length / 4.0)
    return Model(assembly, interfaces, load, length, force, trust, reach)


def _falling_frame(model: Model, solved: Solved, s: float, phase: int) -> Increment:
    return _increment(model, solved, np.zeros((model.assembly.n_blocks, 3)), 1.0, s, phase, Status.FALLING)


def _increment(
    model: Model, solved: Solved, rate: np.ndarray, step: float, s: float, phase: int, status: Status
) -> Increment:
    contacts, velocity = solved.contacts, solved.motion / step
    reaction = float((solved.support_forces * rate).sum())
    return Increment(
        parameter=s,
        measured=reaction,
        phase=phase,
        load_multiplier=0.0,
        reaction=reaction,
        certificate=solved.certificate,
        status=status,
        programs=model.tally.take(),
        seconds=0.0,
        held=State(
            pose=solved.pose,
            contacts=contacts,
            forces=solved.forces,
            displacements=relative_velocities(contacts, solved.pose, velocity),
            friction=solved.friction,
            velocity=velocity,
            support_forces=solved.support_forces,
        ),
    )
