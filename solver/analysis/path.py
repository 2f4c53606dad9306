"""The equilibrium path: from one place to the next under a driver, to collapse, to its limit, or until it locks."""

from __future__ import annotations

from collections.abc import Generator, Iterator
from dataclasses import replace

import numpy as np

from solver.kinematics import Pose
from solver.lp.problem import SolveError
from solver.program.increment import Locked, solve_program
from solver.program.light_blocks import light_blocks
from solver.program.model import Model
from solver.program.step import NotSolved
from solver.results.increment import Increment, Status
from solver.tolerances import GIVE, JUMP

from .advancing import Advance
from .controls import Controls, Ending
from .drivers import Driver
from .falling import CREEPS, Falling
from .place import Checkpoint, Falls, NoStep, Place, Proved, Wedged
from .proofs import Proofs, on_supports
from .reports import Reports, no_equilibrium
from .stepping import MECHANISM, Steps

#: First step, and movement by which a structure has begun to move, in elastic gives.
FIRST_STEP, ONSET = 0.1, 100.0

#: What a path knows of the way behind and ahead: works, barrier, marks, and how far to be careful.
Known = tuple[tuple[float, float, float], float, tuple[Place, ...], float]


class Path:
    """The path of one phase under a driver.

    Parameters
    ----------
    model : Model
        Units, loads, interfaces.
    driver : Driver
    number : int
        Of the phase.
    controls : Controls
        Frames of the fall after collapse, and how short the steps are.
    """

    def __init__(self, model: Model, driver: Driver, number: int, controls: Controls) -> None:
        self.model, self.driver, self.number = model, driver, number
        self.steps = Steps(model, driver)
        self.proofs = Proofs(self.steps)
        self.advance = Advance(self.steps, self.proofs, controls.shorter_steps)
        self.reports = Reports(self.steps, number)
        self.falling = Falling(self.steps, self.proofs, self.reports, controls.frames(model.dimension))
        give = GIVE * model.length / self.steps.lever
        self.first_step = FIRST_STEP * give / controls.shorter_steps
        self.onset = min(ONSET * give, self._next_stop(0.0))
        self.begun: tuple[Place, float, Known, int] | None = None

    def rested(self, pose: Pose) -> Place:
        """The place in which a pose comes to rest from no forces at all.

        Where the pose itself is in equilibrium it stays as it is, with the forces found; otherwise what the drawing has
        left open closes.

        Raises
        ------
        NotSolved
        Falls
        """
        place = self.steps.at_start(pose)
        for _ in range(2):
            place, _ = self.steps.step(place, self.model.length / self.steps.lever, still=True)
        unmoved = replace(place, pose=pose)
        return unmoved if self.proofs.proved(unmoved).exists else place

    def follow(self, start: Place, resume: Checkpoint | None = None) -> Generator[Increment, None, Ending]:
        """Yields the increments of the phase, returns how it ended and leaves the last place in ``self.last``."""
        self.last, self.start = start, start.pose
        step = self.first_step
        if resume is not None:
            start, step, self.advance.barrier = resume.place, resume.step, resume.first_without
            self.start, self.advance.works, self.steps.careful_until = resume.start, resume.works, resume.careful_until
            self.advance.marks = resume.marks
        proved = self.proofs.proved(start)
        if resume is None:
            ending = yield from self._begun(proved)
            if ending is not None:
                return ending
        else:
            self.steps.programs = 0
            if resume.ended:
                return self.reports.reached()
        return (yield from self._followed(proved, step, resume is not None))

    def _begun(self, proved: Proved) -> Generator[Increment, None, Ending | None]:
        """Return how a path ends that cannot begin, with the increment that shows it; None where it can.

        Raises
        ------
        ValueError
            Where the multiplier has to turn around for the parameter to grow.
        """
        start, bounds = proved.place, self.proofs.bounds(proved)
        if not (proved.exists and self._light_blocks_stand(start.pose)):
            motion = next((motion for _, motion, _ in self.falling.sinking(start)), self.steps.drag)
            yield self.reports.falling(start, motion * self.model.lengths, start.s)
            return Ending(Status.NO_INITIAL_EQUILIBRIUM, no_equilibrium(self.model.assembly, motion))
        if self.model.live is not None and not 0.0 < bounds.high < np.inf:
            if bounds.high > 0.0:
                return Ending(
                    Status.LOCKED, "at a control displacement of 0 m no live load of this pattern moves the structure"
                )
            yield self.reports.falling(start, np.zeros_like(self.model.load), start.s)
            return Ending(Status.NO_INITIAL_EQUILIBRIUM, "no live load of this pattern is carried")
        if self.model.live is None and np.isinf(bounds.low):
            length = GIVE * self.model.length / self.steps.lever
            if self.advance.locks(start, length):
                yield self.reports.increment(proved, bounds, self.driver.rate(start.s), self.advance.works)
                held = replace(start, contacts=proved.contacts, forces=proved.forces)
                return Ending(Status.LOCKED, self.reports.locked(held))
        if self.model.live is not None:
            _, onset = self._at_first(proved)
            if onset <= 0.0:
                raise ValueError(self.driver.misdirected())
        return None

    def _followed(self, proved: Proved, step: float, reported: bool) -> Generator[Increment, None, Ending]:
        """Go on from an equilibrium, which may have been reported, to the end of the phase."""
        driver, without, spent = self.driver, None, None
        self.reported = proved.place.s
        while True:
            place = proved.place
            self.last = place
            if not reported:
                found = self._found(proved, step)
                yield found
                reported, self.reported = True, place.s
                if found.checkpoint.ended:
                    return self.reports.reached()
            if self.advance.barrier - place.s <= driver.tolerance * (1.0 + 1e-9):
                # A hair beyond the last equilibrium: what loses its hold may come to rest nearby.
                without = without or self._beyond(place)
                settled = self.falling.settles(without)
                if settled is not None:
                    proved, reported, self.advance.barrier, without, spent = settled, False, np.inf, None, None
                    continue
                yield from self._unreported(proved)
                return (yield from self.falling.collapse(proved, without, self.advance.barrier, spent))
            try:
                new, step = self._onward(place, step)
            except Wedged as wedged:
                return Ending(Status.LOCKED, self.reports.locked(wedged.place))
            except NoStep as reason:
                yield from self._unreported(proved)
                return Ending(Status.SOLVER_FAILED, self.reports.no_step(str(reason)))
            if new is place:
                without, spent = None, None
                continue
            crept, lost = self._hold(new)
            if crept is not None:
                # What has been shown of the place beyond stays true.
                proved, reported, without = crept, not self._is_stop(new.s), None
                spent = spent if np.isfinite(self.advance.barrier) else None
            else:
                length = new.s - place.s
                step = min(step, 0.5 * length)
                if self.advance.falls_within(place, length):
                    without, spent = new, lost

    def _onward(self, place: Place, step: float) -> tuple[Place, float]:
        """Where the path goes from a place, and the step to try from there.

        Raises
        ------
        NoStep
        Wedged
        """
        if place.s > 0.0 or step != self.first_step:
            return self.advance.advanced(
                place, min(self._next_stop(place.s), 0.5 * (place.s + self.advance.barrier)), step
            )
        if self.begun is None:
            return self._begin(place)
        (new, step, known, programs), self.begun = self.begun, None
        self._know(known)
        self.steps.programs += programs
        return new, step

    def _begin(self, place: Place) -> tuple[Place, float]:
        """Go on from the start until the structure has begun to move, far beyond the give of the joints.

        Raises
        ------
        NoStep
        Wedged
        """
        step = self.first_step
        while place.s < self.onset and np.isinf(self.advance.barrier):
            place, step = self.advance.advanced(place, self.onset, step)
        return place, step

    def _known(self) -> Known:
        advance = self.advance
        return advance.works, advance.barrier, advance.marks, self.steps.careful_until

    def _know(self, known: Known) -> None:
        self.advance.works, self.advance.barrier, self.advance.marks, self.steps.careful_until = known

    def _found(self, proved: Proved, step: float) -> Increment:
        """The increment at an equilibrium, with the checkpoint from which the path goes on with this step."""
        place = proved.place
        at_limit = place.s >= self.driver.limit * (1.0 - 1e-12)
        motion = self._next_motion(place)
        checkpoint = Checkpoint(
            self.number,
            self.start,
            place,
            step,
            self.advance.barrier,
            self.advance.works,
            self.steps.careful_until,
            at_limit,
            self.advance.marks,
        )
        first = place.s == 0.0 and self.model.live is None
        at_rest, onset = self._at_first(proved) if first else (np.nan, np.nan)
        found = self.reports.increment(proved, self.proofs.bounds(proved), motion, self.advance.works)
        self.advance.tried, self.advance.tried_from = 0, place.s
        return replace(found, checkpoint=checkpoint, at_rest=at_rest, onset=onset)

    def _unreported(self, proved: Proved) -> Iterator[Increment]:
        """The increment at the last equilibrium of the path, where none has been reported there."""
        if proved.place.s > self.reported:
            motion = self._motion_at_last(proved.place)
            yield self.reports.increment(proved, self.proofs.bounds(proved), motion, self.advance.works)

    def _hold(self, new: Place) -> tuple[Proved | None, float | None]:
        """The equilibrium at a new place, or near it, if any; and what was measured where one exists at all."""
        reached = self.proofs.stands(new)
        crept: Proved | None = reached
        lost = reached.measured if reached.exists else None
        if not self.proofs.holds(reached) and lost is None and new.s > self.steps.careful_until:
            # What the drag holds back may only have to creep on.
            crept = self.falling.settles(new, CREEPS, JUMP)
        return (crept if self.proofs.holds(crept) else None), lost

    def _light_blocks_stand(self, pose: Pose) -> bool:
        """Whether blocks too light for the others' programs stand where the others do."""
        if self.model.live is not None or self.model.dimension == 3 or not light_blocks(self.model).any():
            return True
        self.steps.programs += 1
        try:
            return not solve_program(self.model, pose).falling
        except Locked:
            # Forces without limit: what is wedged by the drawing does not fall.
            return True

    def _beyond(self, place: Place) -> Place:
        """A place just beyond one from which the structure falls: reached by the longest step that is solved."""
        length = self.driver.tolerance / 4.0
        for _ in range(20):
            try:
                return self.steps.step(place, length)[0]
            except (NotSolved, Falls):
                length /= 4.0
        return place

    def _at_first(self, proved: Proved) -> tuple[float, float]:
        """The reaction at rest, and once the structure has begun to move."""
        place, before = proved.place, self._known()
        remembered = self.steps.remembered(place, proved.contacts)
        rate = self.driver.rate(0.0)
        at_rest = float((on_supports(self.model, proved.contacts, place.pose, remembered) * rate).sum())
        onset, programs = np.nan, self.steps.programs
        try:
            begun, step = self._begin(place)
            self.begun = begun, step, self._known(), self.steps.programs - programs
            there = self.proofs.stands(begun)
            onset = there.measured if there.exists else np.nan
        except (NoStep, Wedged):
            pass
        self._know(before)
        # They belong to the increment that the path goes on to from there.
        self.steps.programs = programs
        return at_rest, onset

    def _is_stop(self, s: float) -> bool:
        near = 1e-9 * self.driver.increment
        return abs(s - self._next_stop(s - 2.0 * near)) <= near

    def _next_stop(self, s: float) -> float:
        """Next parameter that has an increment: a multiple of the driver's increment, a stop of its own, the limit."""
        near = 1e-9 * self.driver.increment
        number = np.floor(s / self.driver.increment + 1e-9) + 1.0
        stops = [number * self.driver.increment, self.driver.limit, *self.driver.stops()]
        return float(
            min(stop for stop in stops if stop > s + near) if s < self.driver.limit - near else self.driver.limit
        )

    def _next_motion(self, place: Place) -> np.ndarray:
        """(n_blocks, n_dof) array: velocity in the movement that follows, per unit of the parameter."""
        length = MECHANISM * self.model.length / self.steps.lever
        try:
            _, motion = self.steps.step(place, length)
        except (NotSolved, Falls):
            return self._motion_at_last(place)
        return motion * self.model.lengths / length

    def _motion_at_last(self, place: Place) -> np.ndarray:
        """(n_blocks, n_dof) array: velocity at the last equilibrium, beyond which a step would be one of the fall.

        The motion of the paper's linear program there; under a live load that a little before.
        """
        length = MECHANISM * self.model.length / self.steps.lever
        before = next((one for one in self.advance.marks if place.s - one.s >= length), None)
        try:
            if self.model.live is None and self.model.dimension == 2:
                found = solve_program(self.model, place.pose, self.driver.rate(place.s) * length)
                if not found.falling:
                    return found.motion / length
            if before is not None:
                return self.steps.step(before, length)[1] * self.model.lengths / length
        except (NotSolved, Falls, Locked, SolveError):
            pass
        return self.driver.rate(place.s)
