"""The equilibrium path: from one place to the next under a driver, to collapse, to its limit, or until it locks."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator
from dataclasses import replace
from enum import Enum

import numpy as np

from solver.assembly import measure_contacts
from solver.contact_step.problem import NotSolved
from solver.equilibrium import wrench_matrix
from solver.kinematics import Pose, moved_vertices
from solver.loads import GRAVITY
from solver.program.model import Model
from solver.results.increment import Increment, Status
from solver.tolerances import CLOSING_GAP, COMPUTED_GAP, JUMP

from .collapse import MECHANISM, REFINED, Falling
from .controls import Controls, Ending
from .drivers import Driver
from .equilibrium_check import EquilibriumChecks
from .reports import Reports, no_equilibrium
from .state import EquilibriumCheck, Note, PathState, Place
from .stepping import StepError, Stepper

#: Steps, as movements of the supports in block sizes: the first, which is not made shorter for its error, the longest,
#: and the shortest, which ends the analysis where its program is not solved.
FIRST_STEP, LONGEST_STEP, SHORTEST_STEP = 1e-5, 0.02, 1e-11

#: What a step may change, in relative errors of the reaction that are aimed for: friction bounds, in weights of the
#: structure, and movements, in block sizes. Measured on sliding walls: reactions then come to within the error.
LAG_PER_ERROR, TURN_PER_ERROR = 20.0, 2.0

#: A step whose error is so many times that is taken again; it grows at most by the second.
REFUSED, GROWTH = 4.0, 2.0

#: A place is checked where a block moves so many times as fast as the supports, or so far in a step, in block sizes.
FAST, FAR = 3.0, 0.05

#: Steps tried for an increment before an analysis ends.
MOST_STEPS = 3000

#: Places kept to go back to.
HISTORY = 6

#: After a bound that was none the viscosity stays reduced for so many tolerances.
ENCLOSED = 8.0

#: Penetration, in block sizes, and normal force, in total loads, at which blocks may be wedged.
PRESSED, LOCKED_FORCE = 1e-5, 1e2

#: Movement, in block sizes, of what has left for good when the first block has gone as far as none comes back from.
LEAVES = 0.1

#: Part of the multiplier at the start under which one comes to zero within a bracket, and does not fall there at once.
SPENT = 0.05

#: Movement of the supports, in block sizes, in which the joints' compliance is used up.
ONSET = 1e-3


class Outcome(Enum):
    """How an advance towards a parameter ended."""

    REACHED = "reached"
    NO_EQUILIBRIUM = "no equilibrium"
    LOCKED = "locked"
    FAILED = "failed"


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
    on_step : callable, optional
        Called with the :class:`PathState` after every step that was tried.
    """

    def __init__(
        self,
        model: Model,
        driver: Driver,
        number: int,
        controls: Controls,
        on_step: Callable[[PathState], None] | None = None,
    ) -> None:
        self.on_step = on_step
        self.whole, self.driver, self.number = model, driver, number
        self.frames, self.local_loss = controls.frames(model.dimension), controls.local_loss
        self._follow_without(np.zeros(0))
        self.largest_lag = LAG_PER_ERROR * controls.step_tolerance
        self.largest_turn = TURN_PER_ERROR * controls.step_tolerance
        self.reported, self.failure, self.pressed = -np.inf, "", Place.unloaded(driver.supports(0.0))

    def _follow_without(self, fell_at: np.ndarray) -> None:
        """Follow the structure without blocks that have left; (n_blocks,) array as in ``PathState.fell_at``."""
        self.model = self.whole if not len(fell_at) else self.whole.without(~np.isnan(fell_at))
        self.stepper = Stepper(self.model, self.driver)
        self.checks = EquilibriumChecks(self.stepper)
        self.reports = Reports(self.stepper, self.number, fell_at)
        self.falling = Falling(self.stepper, self.checks, self.reports, self.frames)

    # The start ---------------------------------------------------------------------------------------------------

    def begin(self, start: Pose, before: PathState | None = None) -> PathState:
        """The state at the start of the phase: of the drawing at rest, or after the phase before."""
        fell_at = np.zeros(0)
        if before is not None:
            # Joints remember what they carried in the phase before; the way blocks moved is another.
            place, fell_at = replace(before.place, s=0.0, velocity=None, works=(0.0, 0.0, 0.0, 0.0)), before.fell_at
            self._follow_without(fell_at)
        else:
            place = Place.unloaded(start)
            rest = self._at_rest(place)
            if rest is None:
                # What the drawing has left open closes.
                closed = self.falling.at_rest(place, JUMP)
                rest = None if closed is None else self._at_rest(replace(closed, contacts=None, velocity=None))
            place = rest or place
        return PathState(self.number, start, place, FIRST_STEP * self.stepper.unit, history=(place,), fell_at=fell_at)

    def _at_rest(self, place: Place) -> Place | None:
        """The place with the forces of least elastic energy in equilibrium; None where there are none."""
        try:
            forces = self.checks.nearest(replace(place, multiplier=0.0), COMPUTED_GAP, at_rest=True)
        except NotSolved:
            bounds = self.checks.bounds(place)
            if not bounds.exists:
                return None
            forces = bounds.forces if bounds.others is None else 0.5 * (bounds.forces + bounds.others)
            if self.model.live is not None:
                # A pose that is given may stand with its live load only.
                if not np.isfinite(bounds.high):
                    return None
                forces, place = bounds.forces, replace(place, multiplier=bounds.high)
        contacts = self.stepper.contacts(place.pose)
        trial = np.where(forces[:, :1] > 0.0, forces, -np.eye(forces.shape[1])[0])
        return replace(place, contacts=contacts, forces=forces, trial=trial, followed=forces[:, 0])

    # The loop ----------------------------------------------------------------------------------------------------

    def follow(self, state: PathState, resumed: bool = False) -> Generator[Increment, None, Ending]:
        """Yield the increments of the phase, return how it ended, and leave the last state in ``self.state``.

        Parameters
        ----------
        state : PathState
        resumed : bool
            The increment at this state has been reported.
        """
        self.state = state
        if resumed:
            self._follow_without(state.fell_at)
            self.reported = state.place.s
        else:
            ending = yield from self._begun(state)
            if ending is not None:
                return ending
        while not self.state.ended:
            state, outcome = self.advance(self.state, self._next_stop(self.state.place.s))
            self.state = state
            if outcome is Outcome.REACHED:
                yield from self._reached(state)
                continue
            if outcome is Outcome.LOCKED:
                # Blocks were wedged from the last report on: forces grew, and friction followed them.
                return Ending(Status.LOCKED, self.reports.locked(self.pressed))
            if outcome is Outcome.FAILED:
                yield from self._unreported(state)
                return Ending(Status.SOLVER_FAILED, self.reports.no_step(self.failure))
            beyond = self._beyond(state)
            end, rests = self.falling.end(beyond)
            going_on = self._from(state, replace(end, velocity=None)) if rests else self._let_go(state, end)
            if going_on is None:
                yield from self._unreported(state)
                check, lost = self._checked(state.place), None
                if self.model.live is not None:
                    first, bounds = (
                        self.checks.bounds(Place.unloaded(state.start)),
                        self.checks.bounds(beyond, CLOSING_GAP),
                    )
                    spent = state.place.multiplier <= SPENT * first.high
                    lost = bounds.high if spent and bounds.exists and bounds.high <= 0.0 else None
                return (yield from self.falling.collapse(check, beyond, state.upper_bound, lost))
            self.state = going_on
        return self.reports.reached()

    def _begun(self, state: PathState) -> Generator[Increment, None, Ending | None]:
        """Report the start; return how a path ends that cannot begin, None where it can.

        Raises
        ------
        ValueError
            Where the multiplier has to turn around for the parameter to grow.
        """
        place, model = state.place, self.model
        check = self._checked(place)
        bounds = check.bounds
        if not bounds.exists:
            motion = next((motion for _, motion, *_ in self.falling.in_time(place)), self.stepper.weights)
            yield self.reports.falling(place, motion * model.lengths, place.s)
            return Ending(Status.NO_INITIAL_EQUILIBRIUM, no_equilibrium(model.assembly, motion))
        if model.live is not None and not 0.0 < bounds.high < np.inf:
            if bounds.high > 0.0:
                return Ending(
                    Status.LOCKED, "at a control displacement of 0 m no live load of this pattern moves the structure"
                )
            yield self.reports.falling(place, np.zeros_like(model.load), place.s)
            return Ending(Status.NO_INITIAL_EQUILIBRIUM, "no live load of this pattern is carried")
        if model.live is not None:
            begun, _ = self.advance(state, self._onset())
            if begun.place.multiplier <= 0.0:
                raise ValueError(self.driver.misdirected())
        yield self._report(state, check)
        return None

    def _onset(self) -> float:
        """Parameter at which the joints' compliance is used up."""
        return min(ONSET * self.stepper.unit, self._next_stop(0.0))

    def _reached(self, state: PathState) -> Iterator[Increment]:
        """Report a settlement that was reached, or go back where no equilibrium is near."""
        place = state.place
        rest = place if self._stands(place) else self.falling.at_rest(place)
        if rest is None:
            self.state = self._back(state, place.s)
            return
        ended = place.s >= self.driver.limit * (1.0 - 1e-12)
        if self.falling.ways(place, rest).max() > JUMP:
            state = self._from(state, rest)
        self.state = state = replace(state, history=(replace(rest, works=place.works),), ended=ended)
        yield self._report(state, self._checked(rest, self._reaction(place)))

    def _report(self, state: PathState, check: EquilibriumCheck) -> Increment:
        """The increment of an equilibrium, from whose state the path goes on."""
        found = self.reports.increment(check, self._next_motion(state.place), state.place.works)
        self.reported = state.place.s
        return replace(found, checkpoint=state)

    def _unreported(self, state: PathState) -> Iterator[Increment]:
        """The increment at the last equilibrium of the path, where none has been reported there."""
        if state.place.s > self.reported:
            velocity = state.place.velocity
            velocity = self.driver.rate(state.place.s) if velocity is None else velocity
            yield self.reports.increment(self._checked(state.place), velocity, state.place.works)

    # Advancing ---------------------------------------------------------------------------------------------------

    def advance(self, state: PathState, target: float) -> tuple[PathState, Outcome]:
        """Go towards a parameter in steps that their error chooses.

        Where no equilibrium exists at a place, shorter steps with reduced viscosity go on from the last place that has
        one and enclose the parameter from which on there is none, to the driver's tolerance.
        """
        for _ in range(MOST_STEPS):
            if state.place.s >= target * (1.0 - 1e-12):
                return state, Outcome.REACHED
            room = state.upper_bound - state.place.s
            if state.refined and room <= self.driver.tolerance * (1.0 + 1e-9):
                return state, Outcome.NO_EQUILIBRIUM
            state, outcome = self._step(state, target)
            if self.on_step is not None:
                self.on_step(state)
            if outcome is not None:
                return state, outcome
        self.failure = f"at {state.place.s:.6g} {self.driver.unit}: {MOST_STEPS} were tried"
        return state, Outcome.FAILED

    def _step(self, state: PathState, target: float) -> tuple[PathState, Outcome | None]:
        """One step towards a parameter, taken or refused; with an outcome where there is no other to try."""
        place, unit = state.place, self.stepper.unit
        enclosing = np.isfinite(state.upper_bound)
        refining = enclosing or place.s < state.refine_until
        length = self._length(state, target)
        try:
            new, motion, error = self.stepper.step(place, length, viscosity=REFINED if refining else 1.0)
        except NotSolved as failure:
            return self._unsolved(state, length, str(failure))
        if self._presses(new, error):
            if self._locked(place):
                self.pressed = new
                return state, Outcome.LOCKED
            if error.pressed > PRESSED and length > FIRST_STEP * unit:
                return replace(state, step=length / 3.0), None
        measure = max(error.lag / self.largest_lag, error.turn / self.largest_turn)
        if measure > REFUSED and length > FIRST_STEP * unit:
            return replace(state, step=length * max(0.25, min(0.7, 1.0 / measure))), None
        if not self._holds(new, error, length, refining):
            if not enclosing:
                return self._back(state, new.s), None
            return replace(state, upper_bound=new.s, refined=True, step=length / 3.0), None
        s = target if abs(new.s - target) <= 1e-12 * abs(target) else new.s
        new = replace(new, s=s, works=self._works(place, new, motion))
        history = (*state.history[:1], *state.history[1:][1 - HISTORY :], place)
        state = replace(state, place=new, step=self._next_step(state.step, length, measure), history=history)
        if s >= state.upper_bound:
            until = s + ENCLOSED * self.driver.tolerance
            state = replace(state, upper_bound=np.inf, refined=False, refine_until=until)
        return state, None

    def _unsolved(self, state: PathState, length: float, failure: str) -> tuple[PathState, Outcome | None]:
        """Go on with a shorter step where one was not solved, or end where none is short enough."""
        if length / 3.0 >= SHORTEST_STEP * self.stepper.unit:
            return replace(state, step=length / 3.0), None
        if self._locked(state.place):
            self.pressed = state.place
            return state, Outcome.LOCKED
        self.failure = f"at {state.place.s:.6g} {self.driver.unit}: {failure}"
        return state, Outcome.FAILED

    def _presses(self, new: Place, error: StepError) -> bool:
        """Whether blocks may be wedged: forces have grown much in a step, or beyond all loads."""
        largest = float(new.forces[:, 0].max(initial=0.0))
        return error.pressed > PRESSED or largest > LOCKED_FORCE * self.model.total_load

    def _length(self, state: PathState, target: float) -> float:
        """Length of the step to take [m or rad]."""
        ahead, step = target - state.place.s, state.step
        room = state.upper_bound - state.place.s
        if np.isfinite(room):
            # Nearer than half-way only in the end, where the bound itself is tried.
            ahead = min(ahead, room if room <= self.driver.tolerance else room / 2.0)
        # Two equal steps rather than a long one and a sliver.
        return ahead if ahead <= 1.000001 * step else min(step, ahead / 2.0)

    def _next_step(self, step: float, length: float, measure: float) -> float:
        unit = self.stepper.unit
        grow = min(GROWTH, max(0.5, 1.0 / max(measure, 1e-300)))
        if grow <= 1.0:
            return max(grow * length, min(length, FIRST_STEP * unit))
        # A step that was cut to end at the target says nothing against the one before.
        return min(LONGEST_STEP * unit, max(step if length < 0.99 * step else 0.0, grow * length))

    def _holds(self, new: Place, error: StepError, length: float, refining: bool) -> bool:
        """Whether a new place is one of the path: proved where blocks move fast, or a collapse is being enclosed."""
        if self.model.live is not None and new.multiplier <= 0.0 and new.s > self._onset():
            return False
        fast = error.moved > FAST * length / self.stepper.unit or error.moved > FAR
        if not (fast or refining):
            return True
        if self.checks.in_equilibrium(new, self._closed_gap(refining)):
            return True
        # What the viscosity holds back may only have to creep on.
        return not refining and self.falling.at_rest(new, JUMP) is not None

    def _closed_gap(self, refining: bool) -> float:
        """Largest gap of contact points that may carry, in block sizes: the viscosity holds joints open that close."""
        return max(COMPUTED_GAP, min(CLOSING_GAP, self.driver.tolerance / self.stepper.unit))

    def _back(self, state: PathState, without: float) -> PathState:
        """Go back to the last place with an equilibrium from a parameter without."""
        # The oldest place is an equilibrium that was reported, or where the path began.
        oldest, *later = state.history
        places = [oldest, *(place for place in (*later, state.place) if oldest.s < place.s < without)]
        gap = self._closed_gap(False)
        while len(places) > 1 and not self.checks.in_equilibrium(places[-1], gap):
            without = min(without, places.pop().s)
        place = places[-1]
        step = (without - place.s) / 4.0
        return replace(state, place=place, step=step, upper_bound=without, refined=False, history=tuple(places[:-1]))

    def _locked(self, place: Place) -> bool:
        """Whether no movement whatever lets the supports go on: forces that press on them have no limit."""
        return self.model.live is None and bool(np.isneginf(self.checks.bounds(place).low))

    def _works(self, before: Place, after: Place, motion: np.ndarray) -> tuple[float, float, float, float]:
        """Works of dead and live loads, on supports and of friction so far, with the forces at the end of the step."""
        model, contacts = self.model, after.contacts
        assert contacts is not None
        live, live_size = model.scaled_live
        free = model.assembly.free[:, None]
        resultant = (wrench_matrix(contacts, after.pose, model.length) @ after.forces.ravel()).reshape(motion.shape)
        started = measure_contacts(model.assembly, moved_vertices(model.assembly, before.pose), contacts)
        slipped = (contacts.slip - started.slip) / model.length
        done = (
            float((model.scaled_load * free * motion).sum()),
            after.multiplier * live_size * float((live * free * motion).sum()),
            float((np.where(free, 0.0, resultant) * motion).sum()),
            -float((after.forces[:, 1:] * slipped).sum()),
        )
        return tuple(np.add(before.works, done).tolist())

    # Places ------------------------------------------------------------------------------------------------------

    def _stands(self, place: Place) -> bool:
        return self.checks.in_equilibrium(place, COMPUTED_GAP)

    def _from(self, state: PathState, rest: Place) -> PathState:
        """Go on from where blocks came to rest."""
        if self.falling.ways(state.place, rest).max() > JUMP:
            self.reports.notes.append(Note(rest.s, self.reports.jump(state.place.pose, rest.pose)))
        place = replace(rest, velocity=None, works=state.place.works)
        return replace(
            state,
            place=place,
            step=FIRST_STEP * self.stepper.unit,
            upper_bound=np.inf,
            refined=False,
            history=(place,),
        )

    def _let_go(self, state: PathState, end: Place) -> PathState | None:
        """Go on without the blocks that left for good; None where none did, too many, or the others fall, too."""
        if self.model.live is not None:
            return None
        weights = self.model.assembly.masses * self.model.assembly.free * GRAVITY
        leaving = self.falling.ways(state.place, end) > LEAVES
        fell_at = np.where(leaving, state.place.s, state.fell_at if len(state.fell_at) else np.nan)
        if not leaving.any() or weights[~np.isnan(fell_at)].sum() > self.local_loss * weights.sum():
            return None
        before, notes, programs = state.fell_at, self.reports.notes, self.stepper.programs
        lost = float(weights[leaving].sum())
        words = self.reports.loss(leaving, lost, lost / float(weights.sum()))
        self._follow_without(fell_at)
        self.reports.notes, self.stepper.programs = [*notes, Note(state.place.s, words)], programs
        fallen = leaving[:, None]
        pose = Pose(
            np.where(fallen, end.pose.positions, state.place.pose.positions),
            np.where(fallen, end.pose.rotations, state.place.pose.rotations),
        )
        without = replace(state, place=replace(state.place, pose=pose, velocity=None), fell_at=fell_at)
        rests = self._stands(without.place)
        end = without.place
        if not rests:
            end, rests = self.falling.end(end)
        going_on = self._from(without, replace(end, velocity=None)) if rests else self._let_go(without, end)
        if going_on is None:
            self._follow_without(before)
            self.reports.notes = notes
        return going_on

    def _beyond(self, state: PathState) -> Place:
        """A place beyond the last equilibrium, at the upper bound or as near as a step is solved."""
        length = state.upper_bound - state.place.s
        for _ in range(20):
            try:
                return self.stepper.step(state.place, length, viscosity=REFINED)[0]
            except NotSolved:
                length /= 4.0
        return state.place

    def _reaction(self, place: Place) -> float:
        """Reaction of the forces of a place [N or N·m]."""
        if place.contacts is None:
            return 0.0
        return self.checks.reaction(place, place.contacts, place.forces)

    def _checked(self, place: Place, reaction: float | None = None) -> EquilibriumCheck:
        """Equilibrium and bounds at a place; at the start of a pushover those of the limit load."""
        check = self.checks.check(place, self._reaction(place) if reaction is None else reaction)
        if not check.bounds.exists:
            check = self.checks.check(place, check.measured, CLOSING_GAP)
        if self.model.live is not None and place.s == 0.0 and np.isfinite(check.bounds.high):
            check = replace(check, forces=check.bounds.forces, measured=check.bounds.high)
        return check

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
        length = MECHANISM * self.stepper.unit
        try:
            _, motion, _ = self.stepper.step(place, length)
        except NotSolved:
            return self.driver.rate(place.s) if place.velocity is None else place.velocity
        return motion * self.model.lengths / length
