"""The equilibrium path under a driver: in steps to collapse, to its limit, or until the supports are locked."""

from __future__ import annotations

from collections.abc import Callable, Collection, Generator, Iterator
from dataclasses import replace

import numpy as np

from solver.contact_step.problem import NotSolved
from solver.equilibrium import wrench_matrix
from solver.kinematics import Pose, put_together
from solver.loads import GRAVITY
from solver.program.model import Model
from solver.program.static_program import EquilibriumBounds
from solver.programs.problem import SolveError
from solver.results.increment import Bonds, Increment, Status
from solver.ties import TieForces
from solver.tolerances import ACCEPTED_ERROR, CLOSING_GAP, COMPUTED_GAP, FRICTION_MEMORY, JUMP

from .collapse import MECHANISM, Fall
from .controls import Controls, Ending
from .drivers import Driver
from .equilibrium_check import EquilibriumChecks
from .reports import Reports, no_equilibrium
from .state import EquilibriumCheck, PathState, Place
from .stepping import CARRIES, StepError, Stepper

#: First, longest and shortest step, as movements of the supports in block sizes; the first is accepted at any error.
FIRST_STEP, LONGEST_STEP, SHORTEST_STEP = 1e-5, 0.05, 1e-11

#: Lengths of steps that one may have between a length and its double.
LENGTHS = 4

#: Part of the movement over which friction follows, below which its error shortens no step: what slips or parts at once
#: does so however short the steps are.
AT_ONCE = 0.03

#: Change of movements in a step, in block sizes, per relative error of the reaction, as measured on sliding walls.
TURN_PER_ERROR = 2.0

#: Steps tried for an increment before an analysis ends.
MOST_STEPS = 3000

#: Error of a step, in errors aimed for, at which it is refused.
REFUSED = 4.0

#: Speed of a block, in speeds of the supports, from which on equilibrium is checked where joints that close move blocks
#: by less; in any case it is where they have moved as far as supports do in the longest step.
FAST = 3.0

#: Viscosity where a collapse is enclosed, as a part of the model's.
REFINED = 1e-3

#: Tolerances beyond a bound that has an equilibrium after all in which the viscosity stays reduced.
ENCLOSED = 8.0

#: Movement, in block sizes, of blocks that have fallen when the first one has moved farthest.
FALLEN = 0.1

#: Part by which the multiplier falls beyond a peak that is reported, and by which that exceeds what was.
DROP = 0.01

#: Part of the first multiplier under which one may vanish within a bracket.
VANISHING = 0.05


class Path:
    """The path of one phase, by its number, under a driver; ``on_step`` is called with each state that was tried."""

    def __init__(
        self,
        model: Model,
        driver: Driver,
        number: int,
        controls: Controls,
        on_step: Callable[[PathState], None] | None = None,
    ) -> None:
        self.on_step = on_step or (lambda _: None)
        self.full_model, self.driver, self.number = model, driver, number
        self.frames, self.local_loss = controls.falling_frames, controls.local_loss
        self._remove_blocks(np.zeros(0))
        # Of contact points that may carry, in block sizes: viscosity retards joints that close.
        self.closed_gap = max(COMPUTED_GAP, min(CLOSING_GAP, driver.tolerance / self.stepper.unit))
        self.tolerance = controls.step_tolerance
        # What has stood before a phase collapses where it no longer does.
        self.stood = number > 0

    def _remove_blocks(self, fell_at: np.ndarray) -> None:
        """Follow the structure without blocks that have left; (n_blocks,) array as in ``PathState.fell_at``."""
        self.model = self.full_model if not len(fell_at) else self.full_model.without(~np.isnan(fell_at))
        self.stepper = Stepper(self.model, self.driver)
        self.checks = EquilibriumChecks(self.stepper)
        self.reports = Reports(self.stepper, self.number, fell_at)
        self.fall = Fall(self.stepper, self.checks, self.reports, self.frames, lambda: self.on_step(self.tried))

    def increments(
        self, begin: Callable[[], PathState], resume: PathState | None
    ) -> Generator[Increment, None, Ending]:
        """The increments of the phase, from where it begins or a checkpoint; it ends where a program is not solved."""
        try:
            return (yield from self.follow(begin() if resume is None else resume, resume is not None))
        except SolveError as error:
            at = max(self.tried.reported, 0.0)
            message = f"beyond a {self.driver.what} of {at:.6g} {self.driver.unit}: {error}"
            return Ending(Status.SOLVER_FAILED, message)

    def begin(
        self,
        start: Pose,
        before: PathState | None = None,
        ties_at: TieForces | None = None,
        bonds_at: Bonds | None = None,
        fallen: np.ndarray | None = None,
    ) -> PathState:
        """The state at the start of the phase: of a pose at rest, without fallen blocks, or after the phase before."""
        fell_at = np.zeros(0)
        if before is not None:
            # The equilibrium that was reported at its end: joints keep their forces, blocks not their velocity.
            place, fell_at = replace(before.history[0], s=0.0, velocity=None, works=(0.0,) * 5), before.fell_at
            self._remove_blocks(fell_at)
            place = self.stepper.members.installed(place, self.number)
        else:
            if fallen is not None and np.any(fallen):
                fell_at = np.where(fallen, -np.inf, np.nan)
                self._remove_blocks(fell_at)
            place = self.stepper.unloaded(start, self.number, ties_at, bonds_at)
            self.tried = PathState(self.number, start, place, FIRST_STEP * self.stepper.unit)
            drawn = bonds_at is None
            # Joints that the drawing leaves open close.
            if not (resting := self._at_rest(place, drawn)) and (closed := self.fall.relaxed(place, JUMP)):
                if self.fall.movements(place, closed).max() > MECHANISM:
                    self.reports.notes = [(0.0, self.reports.settled(start, closed.pose))]
                # Those that have mortar are the ones that are closed then, or a settlement before has left.
                bonded = self.stepper.mortar.cast if drawn else self.stepper.mortar.renamed
                closed = bonded(closed, self.stepper.contacts(closed.pose))
                resting = self._at_rest(replace(closed, contacts=None), drawn)
            place = resting or place
        return PathState(self.number, start, place, FIRST_STEP * self.stepper.unit, history=(place,), fell_at=fell_at)

    def changed(self, begin: Callable[[], PathState], removed: np.ndarray, ties: Collection[str]) -> PathState:
        """The state once blocks, (n_blocks,) bool array, and ties are taken away and the others have come to rest.

        Where they do not, it is that from which they fall; :meth:`follow` finds that.
        """
        self.tried = state = begin()
        if removed.any():
            fell_at = np.where(removed, -np.inf, state.fell_at if len(state.fell_at) else np.nan)
            self._remove_blocks(fell_at)
            state = replace(state, fell_at=fell_at, step=FIRST_STEP * self.stepper.unit)
            self.reports.notes = [(0.0, self.reports.taken_away(removed, np.isnan(state.place.tie_lengths[:, 0])))]
        if ties:
            lengths = state.place.tie_lengths.copy()
            lengths[[tie.name in ties for tie in self.model.ties]] = np.nan
            state = replace(state, place=replace(state.place, tie_lengths=lengths))
        self.stood = True
        if self.stepper.gives(state.place) or not self.checks.in_equilibrium(state.place):
            end, at_rest = self.fall.relax(state.place)
            settled = self._continue_from(state, end) if at_rest else self._remove_fallen(state, end)
            if settled is None:
                return state
            state = settled
        place = self._at_rest(state.place, anew=False) or state.place
        place = self.stepper.standing(place) or place
        return replace(state, place=place, history=(place,))

    def _at_rest(self, place: Place, anew: bool = True, multiplier: float | None = None) -> Place | None:
        """The place with forces in equilibrium, of least elastic energy or nearest to its own; None without any."""
        # Beside the dead load with this part of the live load.
        place = replace(place, multiplier=multiplier or 0.0)
        try:
            forces = self.checks.nearest(place, COMPUTED_GAP, at_rest=anew)
        except NotSolved:
            bounds = self.checks.bounds(place)
            if not bounds.in_equilibrium:
                return None
            if self.model.has_live and multiplier is None:
                # A given pose may be in equilibrium with its live load only.
                middle = bounds.high if len(bounds.forces) == 1 else 0.5 * (bounds.low + bounds.high)
                return self._at_rest(place, anew, middle) if np.isfinite(bounds.high) else None
            forces = bounds.forces.mean(axis=0)
        contacts = self.stepper.contacts_at(place)
        beyond = forces.copy()
        beyond[:, 0] += self.stepper.mortar.points(place, contacts).tension
        trial = np.where(beyond[:, :1] > 0.0, beyond, -np.eye(forces.shape[1])[0])
        if anew:
            place = self.stepper.mortar.at_rest(place, contacts, forces)
        return replace(place, contacts=contacts, forces=forces, trial=trial, followed=forces[:, 0])

    def follow(self, state: PathState, resumed: bool = False) -> Generator[Increment, None, Ending]:
        """Yield the increments of the phase, return how it ended, and leave the last state in ``self.state``.

        Of a resumed path the increment at the given state has been reported.
        """
        self.state = self.tried = state
        if resumed:
            self._remove_blocks(state.fell_at)
        else:
            ending = yield from self._report_start(state)
            if ending is not None:
                return ending
        while self.state.reported < self.driver.limit * (1.0 - 1e-12):
            # What blocks that drop come to may be at a stop that has not been reported.
            self.state, outcome = self.advance(self.state, self.driver.next_stop(self.state.reported))
            if outcome.stop in (Status.EQUILIBRIUM, Status.FALLING):
                yield from self._report_peak(self.state)
            state = self.state
            if outcome.stop is Status.LIMIT_REACHED:
                yield from self._report_reached(state)
            if outcome.stop in (Status.EQUILIBRIUM, Status.LIMIT_REACHED):
                continue
            if outcome.stop is not Status.FALLING:
                # Towards locked supports forces grew from the last report on, and friction bounds with them.
                if outcome.stop is not Status.LOCKED:
                    yield from self._report_last(state)
                return outcome
            beyond = self._place_beyond(state)
            end, at_rest = self.fall.relax(beyond)
            continued = self._continue_from(self.state, end) if at_rest else self._remove_fallen(self.state, end)
            if continued is None:
                state, check = yield from self._report_last(state)
                multiplier = self._multiplier_beyond(state, check, beyond)
                return (yield from self.fall.collapse(check, beyond, state.upper_bound, multiplier))
            self.state = continued
        return self.reports.reached()

    def _report_start(self, state: PathState) -> Generator[Increment, None, Ending | None]:
        """Report the start; return the ending of a path that has no start, None otherwise.

        Raises ``ValueError`` where the multiplier has to change its sign for the parameter to grow.
        """
        place, model = state.place, self.model
        check = self._check(place)
        bounds = check.bounds
        if not bounds.in_equilibrium and self.stood:
            words = [text for _, text in self.reports.notes]
            ending = yield from self.fall.collapse(check, place, place.s, None)
            return replace(ending, message="; ".join([*words, ending.message]))
        if not bounds.in_equilibrium:
            yield (frame := next(self.fall.frames(place)))
            held = model.held_by(-self.reports.unbalanced(check))
            return Ending(Status.NO_INITIAL_EQUILIBRIUM, no_equilibrium(model.assembly, frame.velocity, held))
        # The control displacement would hold it.
        unloaded = Stepper(replace(model, has_live=False), self.driver) if model.has_live else self.stepper
        if place.multiplier == 0.0 and not unloaded.is_stable(place):
            yield self.reports.falling_increment(place, np.zeros_like(model.load))
            message = (
                "no stable equilibrium before any settlement: what leans a little leans on, on joints or ground of the "
                "given stiffness; check normal_stiffness and the stiffness of supports"
            )
            return Ending(Status.NO_INITIAL_EQUILIBRIUM, message)
        # Without friction a program carries what its own check lets pass.
        least = ACCEPTED_ERROR * model.total_load / max(model.scaled_live(place.pose)[1], 1e-300)
        if model.has_live and bounds.high == np.inf:
            message = "at a control displacement of 0 m no live load of this pattern moves the structure"
            return Ending(Status.LOCKED, message)
        # What hangs on its members carries nothing until these give.
        first_state, carried = state, bounds.high
        if model.has_live and bounds.high > (-least if model.ties else least):
            first_state, _ = self.advance(state, self._onset())
            carried = max(carried, first_state.place.multiplier)
            # What has lost its capacity by then moves along the control all the same.
            if first_state.place.multiplier <= 0.0 and not self.checks.moves_control(place):
                raise ValueError(self.driver.misdirected)
        if model.has_live and not carried > least:
            as_drawn = np.array_equal(state.start.positions, Pose.initial(model.assembly).positions)
            yield self.reports.falling_increment(place, np.zeros_like(model.load))
            return Ending(Status.NO_INITIAL_EQUILIBRIUM, self.reports.nothing_carried(place, as_drawn))
        if model.has_live:
            # A pushover starts from its limit load or, where that is not found, from what its path carries.
            limit, carried = self.checks.limit_multiplier(place), first_state.place.multiplier
            if limit is None:
                warning = "the limit load of friction without dilatancy has not converged: its path carries this"
                self.reports.notes.append((0.0, warning))
            check = self._check(replace(place, multiplier=carried if limit is None else limit), known=bounds)
            place = replace(place, multiplier=check.measured)
        # Until the joints' compliance is used up what rises above the first multiplier by it alone is no peak; where
        # these or ground give, it is not carried.
        peak = 0.0 if not model.has_live or model.interfaces.elastic else bounds.high
        self.state = replace(state, place=place, history=(place,), peak=peak)
        yield self._report(check)
        return None

    def _onset(self) -> float:
        """Parameter at which the joints' compliance is used up."""
        return min(MECHANISM * self.stepper.unit, self.driver.next_stop(0.0))

    def _report_reached(self, state: PathState) -> Iterator[Increment]:
        """Report the parameter that was reached, or go back where no equilibrium is near."""
        place = (standing := self.stepper.standing(state.place)) or state.place
        reaction = self._reaction(place)
        check = self.checks.check(place, reaction)
        live, off = self.model.has_live, abs(check.measured - reaction)
        carries = standing is not None and check.bounds.in_equilibrium and (not live or check.bounds.high > 0.0)
        if carries and not live and off > self.tolerance * abs(reaction):
            # Joints that close carry along the path while they are wider open than a computed pose leaves them.
            wider = self.checks.check(place, reaction, CLOSING_GAP)
            nearer = abs(wider.measured - reaction) <= self.tolerance * off
            check = wider if wider.bounds.in_equilibrium and nearer else check
        resting = place if carries else self.fall.relaxed(place)
        if resting is not None and not carries:
            resting = self.stepper.standing(resting) or resting
        is_far = resting is not None and self.fall.movements(place, resting).max() > JUMP
        # Blocks that rest far away may have left an equilibrium in a step that was too long, where none has been left.
        if resting is None or (is_far and state.refine_until < place.s and state.history[0].s <= state.reported):
            self.state = self._go_back(state, place.s)
            return
        if is_far:
            state = self._continue_from(state, resting)
        check = check if carries else self._check(resting, reaction)
        self.state = replace(state, history=(resting,), peak=max(state.peak, check.measured))
        yield self._report(check)

    def _report_peak(self, state: PathState) -> Iterator[Increment]:
        """Report the highest place, or the last in equilibrium before it; the path goes on from where it is."""
        for place in (self.highest.place, *self.highest.history[::-1]):
            if place.s <= state.reported or (1.0 - DROP) * place.multiplier <= state.peak:
                return
            standing = self.stepper.standing(place) or place
            # What breaks as the control stands still has carried until then.
            check = self._check(max(standing, place, key=lambda p: p.bonds.left.sum() - np.isnan(p.tie_lengths).sum()))
            # What viscosity has retarded comes to rest nearby.
            if not check.bounds.in_equilibrium and (resting := self.fall.relaxed(check.place, JUMP)):
                check = self._check(resting)
            if check.bounds.in_equilibrium and (1.0 - DROP) * check.measured > state.peak:
                self.state = replace(state, peak=check.measured)
                yield self._report(check, place)
                return

    def _report(self, check: EquilibriumCheck, place: Place | None = None) -> Increment:
        """The increment of an equilibrium, at the state's place or one before, with the state as its checkpoint."""
        place = place or self.state.place
        increment = self.reports.increment(check, self._next_motion(place), place.works)
        self.state = replace(self.state, reported=place.s)
        return replace(increment, checkpoint=self.state)

    def _report_last(self, state: PathState) -> Generator[Increment, None, tuple[PathState, EquilibriumCheck]]:
        """Report, unless that is done, and return the last place that no wedge holds by more than its path carries."""
        rounding = ACCEPTED_ERROR * self.model.total_load * self.model.force
        for place in (state.place, *state.history[::-1]):
            check, reaction = self._check(place), self._reaction(place)
            away = min(abs(check.measured - reaction), check.bounds.high - check.bounds.low)
            if self.model.has_live or place.s <= state.reported or not away > max(abs(reaction), rounding):
                break
        if place.s > state.reported:
            velocity = self.driver.rate(place.s) if place.velocity is None else place.velocity
            yield self.reports.increment(check, velocity, place.works)
        return replace(state, place=place), check

    def advance(self, state: PathState, target: float) -> tuple[PathState, Ending]:
        """Advance to a parameter in steps whose length follows from their error.

        Where a place has no equilibrium, shorter steps of reduced viscosity, from the last place that has one, enclose
        the parameter beyond which there is none, to the driver's tolerance.
        """
        self.highest = state
        for _ in range(MOST_STEPS):
            if state.place.s >= target * (1.0 - 1e-12):
                return state, Ending(Status.LIMIT_REACHED)
            last, (state, outcome) = state.place, self._step(state, target)
            self.tried = state
            self.on_step(state)
            new, peak = state.place, self.highest.place
            fallen = (1.0 - DROP) * peak.multiplier > max(state.peak, new.multiplier)
            if fallen and new.s > peak.s > state.reported >= 0.0:
                return state, Ending(Status.EQUILIBRIUM)
            if last.s < self._onset() <= new.s:
                # From here on a peak is one of the structure, not of its joints' compliance.
                state = self.highest = replace(state, peak=min(state.peak, state.history[0].multiplier))
            elif new.s < peak.s or new.multiplier >= peak.multiplier:
                self.highest = state
            if outcome is not None:
                return state, outcome
        return state, self.reports.no_step(state.place.s, f"{MOST_STEPS} were tried")

    def _step(self, state: PathState, target: float) -> tuple[PathState, Ending | None]:
        """Try one step towards a parameter; with an outcome where it was the last one to try."""
        place, unit = state.place, self.stepper.unit
        enclosing = np.isfinite(state.upper_bound)
        refining = enclosing or place.s < state.refine_until
        length = self._length(state, target)
        try:
            viscosity, exact = REFINED if refining else 1.0, refining or length == target - place.s
            new, motion, error = self.stepper.step(place, length, viscosity=viscosity, exact=exact)
        except NotSolved as failure:
            return self._shorten(state, length, str(failure))
        part = 1.0 / 3.0 if error.penetration > CLOSING_GAP else self.stepper.members.part_to_strength(place, new)
        if part < 1.0 and length > FIRST_STEP * unit:
            return replace(state, step=part * length), None
        locked = self._locked(place, new, error.penetration > CLOSING_GAP)
        if locked is not None:
            return state, locked
        works = (*self._works(new, motion), error.taken)
        measure = self._error(place, length, error, works)
        if measure > REFUSED and length > FIRST_STEP * unit:
            return replace(state, step=length / 4.0), None
        s = target if abs(new.s - target) <= 1e-12 * abs(target) else new.s
        # What supports took within a long step is nearer to the mean of the forces.
        works = (*works[:2], (works[2] + self._work_on_supports(place, motion)) / 2.0, works[3])
        new = replace(new, s=s, works=tuple(np.add(place.works, (*works, sum(map(abs, works)))).tolist()))
        on_path = self._on_path(state, new, error.moved, refining)
        if on_path is None and not enclosing:
            return self._go_back(state, s), None
        if on_path is None:
            # What a long step leaves open may hold, and a bound that it found, in the shorter ones that follow.
            falls = Ending(Status.FALLING) if length <= self.driver.tolerance else None
            return replace(state, upper_bound=s, step=length / 3.0), falls
        history = (*state.history[:1], *state.history[1:][-5:], place)
        if on_path is not new:
            # Where blocks have come to rest nothing is behind, and they are as fast as before they were.
            on_path = replace(on_path, velocity=place.velocity)
            history = (on_path,)
        state = replace(state, place=on_path, step=self._next_step(state.step, length, measure), history=history)
        if s >= state.upper_bound:
            # The equilibrium at the bound may be one of reduced viscosity only.
            until = max(state.refine_until, s + ENCLOSED * self.driver.tolerance)
            state = replace(state, upper_bound=np.inf, refine_until=until)
        return state, None

    def _locked(self, place: Place, new: Place, deep: bool) -> Ending | None:
        """The ending where supports are locked, or blocks that come deep into each other have no room."""
        pressed, load = new.forces[:, 0].max(initial=0.0), self.model.total_load
        if (deep or pressed > 100.0 * load) and self._supports_locked(place):
            return self.reports.locked(new)
        if deep and pressed > 10.0 * load:
            return self.reports.locked(new, "; as drawn they have no room: make their faces plane, or trim them")
        return None

    def _error(self, place: Place, length: float, error: StepError, works: tuple[float, ...]) -> float:
        """The error of a step from a place, in errors aimed for."""
        unit = self.stepper.unit
        # Beside the work of the supports or the live load, unless that is next to nothing, or so beside the others.
        driven = max(abs(works[1] + works[2]), self.tolerance * sum(map(abs, works)), CARRIES * length / unit)
        of_friction = error.work / driven / self.tolerance
        if length <= AT_ONCE * min(FRICTION_MEMORY * unit, place.s):
            of_friction = min(of_friction, 1.0)
        return max(of_friction, error.turn / TURN_PER_ERROR / self.tolerance)

    def _shorten(self, state: PathState, length: float, failure: str) -> tuple[PathState, Ending | None]:
        """Shorten a step that was not solved, or end where it is the shortest."""
        if length / 3.0 >= SHORTEST_STEP * self.stepper.unit:
            return replace(state, step=length / 3.0), None
        if self._supports_locked(state.place):
            return state, self.reports.locked(state.place)
        return state, self.reports.no_step(state.place.s, failure)

    def _length(self, state: PathState, target: float) -> float:
        """Length of the step to take [m or rad]."""
        ahead, step = target - state.place.s, state.step
        width = state.upper_bound - state.place.s
        if np.isfinite(width):
            # The bound itself is tried once the bracket is as narrow as the tolerance.
            ahead = min(ahead, width if width <= self.driver.tolerance else width / 2.0)
        # Two equal steps rather than a long one and a sliver.
        return ahead if ahead <= 1.000001 * step else min(step, ahead / 2.0)

    def _next_step(self, step: float, length: float, measure: float) -> float:
        first = FIRST_STEP * self.stepper.unit
        grow = min(2.0, max(0.5, 1.0 / max(measure, 1e-300)))
        # Errors of two descriptions differ by rounding, which lengths in proportion to them would pass on.
        grown = first * 2.0 ** (np.rint(LENGTHS * np.log2(grow * length / first)) / LENGTHS)
        if grow <= 1.0:
            return max(grown, min(length, first))
        # A step that was cut at its target does not shorten the next.
        return min(LONGEST_STEP * self.stepper.unit, max(step if length < 0.99 * step else 0.0, grown))

    def _on_path(self, state: PathState, new: Place, moved: float, refining: bool) -> Place | None:
        """The place of the path at a new one, which is in equilibrium where blocks are fast or a collapse is enclosed.

        That is where blocks that the viscosity retards come to rest nearby; None where they do not.
        """
        if self.model.has_live and new.multiplier <= 0.0 and new.s > self._onset():
            return None
        # What creeps moves little in a step that is short, and far in several.
        fast = moved > LONGEST_STEP or any(
            self.fall.movements(place, new).max() > max(FAST * (new.s - place.s) / self.stepper.unit, MECHANISM)
            for place in (state.place, *state.history)
        )
        if not (fast or refining):
            return new
        # What jumps farther than supports move is followed in time, however little viscosity there is.
        if refining and moved > max(JUMP, FAST * (new.s - state.place.s) / self.stepper.unit):
            return None
        # Of a live load that has viscosity in it more than a step may err by.
        if self.checks.in_equilibrium(new, self.closed_gap, 1.0 / (1.0 + REFUSED * self.tolerance)):
            return new
        return None if refining else self.fall.relaxed(new, JUMP)

    def _go_back(self, state: PathState, bound: float) -> PathState:
        """Go back to the last place in equilibrium; up to a parameter that has none viscosity stays reduced."""
        until = max(state.refine_until, bound)
        # The oldest place is in equilibrium: it was reported, or is the start.
        oldest, *later = state.history
        places = [oldest, *(place for place in (*later, state.place) if oldest.s < place.s < bound)]
        while len(places) > 1 and not self.checks.in_equilibrium(places[-1], self.closed_gap):
            bound = min(bound, places.pop().s)
        step = (bound - places[-1].s) / 4.0
        place, history = places[-1], tuple(places[:-1])
        return replace(state, place=place, step=step, upper_bound=bound, refine_until=until, history=history)

    def _supports_locked(self, place: Place) -> bool:
        """Whether no movement of the blocks is compatible with that of the supports: the reaction has no bound."""
        return not self.model.has_live and bool(np.isneginf(self.checks.bounds(place).low))

    def _works(self, after: Place, motion: np.ndarray) -> tuple[float, float, float]:
        """Works of dead and live loads and on supports in a step, with the forces at its end."""
        model = self.model
        live, live_size = model.scaled_live(after.pose)
        free = model.assembly.free[:, None]
        return (
            float((model.scaled_load_at(after.pose) * free * motion).sum()),
            after.multiplier * live_size * float((live * free * motion).sum()),
            self._work_on_supports(after, motion),
        )

    def _work_on_supports(self, place: Place, motion: np.ndarray) -> float:
        """Work of the forces at a place on supports in a motion."""
        contacts, free = place.contacts, self.model.assembly.free
        if contacts is None:
            return 0.0
        beside = ~(free[contacts.block_a] & free[contacts.block_b])
        resultant = wrench_matrix(contacts[beside], place.pose, self.model.length) @ place.forces[beside].ravel()
        return float((resultant.reshape(motion.shape) * motion)[~free].sum())

    def _continue_from(self, state: PathState, resting: Place) -> PathState:
        """Continue from the place where blocks came to rest."""
        if self.fall.movements(state.place, resting).max() > JUMP:
            self.reports.notes.append((resting.s, self.reports.jump(state.place.pose, resting.pose)))
        place = replace(resting, velocity=None)
        step = FIRST_STEP * self.stepper.unit
        return replace(state, place=place, step=step, upper_bound=np.inf, refine_until=-np.inf, history=(place,))

    def _remove_fallen(self, state: PathState, end: Place) -> PathState | None:
        """Continue without the blocks that have fallen; None where none have, too many, or the others fall, too."""
        if self.model.has_live:
            return None
        weights = self.model.assembly.masses * self.model.assembly.free * GRAVITY
        leaving = self.fall.movements(state.place, end) > FALLEN
        fell_at = np.where(leaving, state.place.s, state.fell_at if len(state.fell_at) else np.nan)
        # What was taken away is no part of the structure.
        weights[np.isneginf(fell_at)] = 0.0
        too_much = weights[np.isfinite(fell_at)].sum() > self.local_loss * weights.sum()
        if not leaving.any() or too_much or not weights[np.isnan(fell_at)].any():
            return None
        before, notes, programs = state.fell_at, self.reports.notes, self.stepper.programs
        weight = float(weights[leaving].sum())
        words = self.reports.loss(leaving, weight, weight / float(weights.sum()))
        self._remove_blocks(fell_at)
        self.reports.notes, self.stepper.programs = [*notes, (state.place.s, words)], programs
        pose = put_together(leaving, end.pose, state.place.pose)
        remaining = replace(state, place=replace(state.place, pose=pose, velocity=None), fell_at=fell_at)
        stands = self.checks.in_equilibrium(remaining.place)
        end, at_rest = (remaining.place, True) if stands else self.fall.relax(remaining.place)
        continued = self._continue_from(remaining, end) if at_rest else self._remove_fallen(remaining, end)
        if continued is None:
            self._remove_blocks(before)
            self.reports.notes = notes
        return continued

    def _place_beyond(self, state: PathState) -> Place:
        """A place beyond the last equilibrium, at the upper bound or as near to it as a step is solved."""
        length = state.upper_bound - state.place.s
        for _ in range(20):
            try:
                return self.stepper.step(state.place, length)[0]
            except NotSolved:
                length /= 4.0
        return state.place

    def _multiplier_beyond(self, state: PathState, check: EquilibriumCheck, beyond: Place) -> float | None:
        """Multiplier at the place beyond, at or below zero; None where equilibrium itself is lost, not the capacity."""
        if not self.model.has_live:
            return None
        # The gaps of elastic joints at the start tell with their lengths without force what carries there.
        bonds = state.place.bonds if self.model.interfaces.elastic else None
        unloaded = self.stepper.unloaded(state.start, self.number, bonds_at=bonds)
        first, bounds = self.checks.bounds(unloaded), self.checks.bounds(beyond, CLOSING_GAP)
        # The multiplier of a place may be one that viscosity carries; that of its check is not.
        vanishes = check.measured <= VANISHING * first.high
        # Of a bound a little before zero, too: viscosity carries there what equilibrium does not.
        falls = bounds.in_equilibrium and bounds.high <= max(check.measured, 0.0)
        return min(bounds.high, 0.0) if vanishes and falls else None

    def _reaction(self, place: Place) -> float:
        """Reaction of the forces of a place [N or N·m]."""
        return 0.0 if place.contacts is None else self.checks.reaction(place, place.contacts, place.forces)

    def _check(
        self, place: Place, reaction: float | None = None, known: EquilibriumBounds | None = None
    ) -> EquilibriumCheck:
        """Equilibrium and bounds at a place, unless these are known."""
        check = self.checks.check(place, self._reaction(place) if reaction is None else reaction, known=known)
        if not check.bounds.in_equilibrium:
            check = self.checks.check(place, check.measured, CLOSING_GAP)
        return check

    def _next_motion(self, place: Place) -> np.ndarray:
        """(n_blocks, n_dof) array: velocity in the movement that follows, per unit of the parameter."""
        length = MECHANISM * self.stepper.unit
        try:
            _, motion, _ = self.stepper.step(place, length)
        except NotSolved:
            return self.driver.rate(place.s) if place.velocity is None else place.velocity
        return motion * self.model.lengths / length
