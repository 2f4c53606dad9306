"""How a path goes on: towards a parameter, in steps that suit it, as far as they lead."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from solver.assembly import measure_contacts
from solver.equilibrium import wrench_matrix
from solver.kinematics import moved_vertices
from solver.lp.problem import SolveError
from solver.program.increment import Locked, solve_program
from solver.program.step import NotSolved
from solver.tolerances import GIVE

from .place import Falls, NoStep, Place, Pressed, Wedged
from .proofs import Proofs
from .stepping import GROWTH, MECHANISM, Steps

#: Largest step inside an increment: movement of the supports in block sizes. The smallest, in the same measure, ends
#: the analysis where no step is solved: there the drag outweighs the give of the joints of the lightest block that is
#: no chip, and a step has one solution.
LARGEST_STEP, SMALLEST_STEP = 0.025, 1e-12

#: Change of the velocities, as a part of them, from which on a step is taken again in shorter ones, down to this part
#: of the largest.
EVENT_CHANGE, EVENT_REFINEMENT = 0.03, 8.0

#: A collapse is being enclosed, in careful steps, within so many tolerances of it.
ENCLOSED = 8.0

#: Where a block moves so many times as fast as the supports, the place is proved before the path goes on; and after so
#: many steps.
FAST, STEPS_UNPROVED = 10.0, 16

#: Steps that are tried within this part of an increment before an analysis ends: what creeps from one slip to another
#: in steps of a hundred millionth of a block would take days.
MOST_TRIED, ADVANCED = 1000, 0.02

#: Force, in total loads, beyond which blocks wedged between supports count as locked.
LOCKED_FORCE = 1e3


class Advance:
    """How far a path has come, and what is known of the way ahead.

    Parameters
    ----------
    steps : Steps
    proofs : Proofs
    shorter : float
        Steps are so many times as short.

    Attributes
    ----------
    barrier : float [m or rad]
        Smallest parameter known to have no equilibrium; infinite where none is known.
    works : tuple of float
        Of loads, on supports and of friction since the start of the phase, in units of the program.
    marks : tuple of Place
        The last two that are a notable way apart.
    tried : int
        Steps since ``tried_from``, the parameter of the last increment or a small part of one later.
    """

    def __init__(self, steps: Steps, proofs: Proofs, shorter: float = 1.0) -> None:
        self.steps, self.proofs, self.model, self.driver = steps, proofs, steps.model, steps.driver
        largest = LARGEST_STEP * self.model.length / steps.lever
        self.longest, self.finest = min(self.driver.increment, largest) / shorter, largest / EVENT_REFINEMENT / shorter
        self.growth = GROWTH ** (1.0 / shorter)
        self.smallest = SMALLEST_STEP * self.model.length / steps.lever
        self.barrier, self.works = np.inf, (0.0, 0.0, 0.0)
        self.marks: tuple[Place, ...] = ()
        self.tried, self.tried_from = 0, 0.0

    def advanced(self, place: Place, target: float, step: float) -> tuple[Place, float]:
        """Goes towards a parameter in steps that suit the path, and stops early where a place is worth a proof.

        Where blocks fall in a step, shorter ones look for the place from which they do; where they are short, with less
        drag. What has been gone is kept; ``self.barrier`` is then the nearest parameter that was not reached.

        Returns
        -------
        place : Place
        step : float
            To try next.

        Raises
        ------
        NoStep
        Wedged
        """
        tolerance, started = self.driver.tolerance, place.s
        for _ in range(STEPS_UNPROVED):
            ahead = target - place.s
            if ahead <= 1e-12 * max(abs(target), self.smallest):
                break
            careful = place.s < self.steps.careful_until
            length = self._length(place, ahead, step)
            self._count(place)
            try:
                new, motion = self.steps.careful_step(place, length) if careful else self.steps.step(place, length)
            except NotSolved as error:
                step = self._shorter(place, length, error)
                continue
            except Falls:
                # The drag may lose its hold early.
                if self.falls_within(place, length):
                    step = length / 2.0
                    if careful and length <= tolerance / 4.0:
                        break
                continue
            if float(new.forces[:, 0].max(initial=0.0)) > LOCKED_FORCE * self.model.total_load:
                raise Wedged(new)
            if length > self.finest * 1.000001 and self._turns(place, new):
                step = max(length / 2.0, self.finest)
                continue
            self.works = self._works(place, new, motion)
            place = replace(new, s=target) if length == ahead else new
            self._reach(place)
            step = min(self.longest, max(step, self.growth * length)) if length >= 0.99 * step else step
            moved_by = float(np.abs(motion[self.model.assembly.free]).max(initial=0.0))
            if moved_by > FAST * length * self.steps.lever / self.model.length:
                # What jumps does not go on like that.
                place = replace(place, velocity=None)
                if moved_by > 1e2 * GIVE and place.s > started:
                    break
        return place, step

    def _count(self, place: Place) -> None:
        """Count a step that is tried.

        Raises
        ------
        NoStep
        """
        if place.s - self.tried_from > ADVANCED * self.driver.increment:
            self.tried, self.tried_from = 0, place.s
        self.tried += 1
        if self.tried > MOST_TRIED:
            raise NoStep(f"at {place.s:.6g} {self.driver.unit}: {MOST_TRIED} were tried since {self.tried_from:.6g}")

    def _length(self, place: Place, ahead: float, step: float) -> float:
        """Of the step to take, where so much is left to go and this is to be tried."""
        length = min(step, ahead)
        if np.isfinite(self.barrier):
            # Nearer than half-way only in the end, where it is tried once more.
            rest = self.barrier - place.s
            length = min(length, rest if rest <= self.driver.tolerance / 4.0 else rest / 2.0)
        elif ahead > step * 1.000001:
            # Two equal steps rather than a long one and a sliver.
            length = min(step, ahead / 2.0)
        return length

    def _shorter(self, place: Place, length: float, error: NotSolved) -> float:
        """Half the length of a step that was not solved.

        Raises
        ------
        NoStep
        Wedged
        """
        if isinstance(error, Pressed) and self.locks(place, length):
            raise Wedged(place) from None
        step = length / 2.0
        if step < self.smallest:
            raise NoStep(f"at {place.s:.6g} {self.driver.unit}: {error}") from None
        return step

    def _reach(self, place: Place) -> None:
        """Forget a barrier that has been passed, and mark places that are a notable way apart."""
        if place.s >= self.barrier:
            self.barrier = np.inf
        if not self.marks or place.s - self.marks[0].s > MECHANISM * self.model.length / self.steps.lever:
            self.marks = (place, *self.marks[:1])

    def falls_within(self, place: Place, length: float) -> bool:
        """Notes that no equilibrium was reached so far beyond a place; False where less drag is to be tried first."""
        near = ENCLOSED * self.driver.tolerance
        if place.s >= self.steps.careful_until and length <= near:
            self.steps.careful_until, self.barrier = place.s + 2.0 * near, np.inf
            return False
        self.barrier = place.s + length
        return True

    def locks(self, place: Place, length: float) -> bool:
        """Whether no movement whatever lets the supports go on: proved by a linear program without end."""
        if self.model.live is not None:
            return False
        if self.model.dimension == 3:
            # What nothing can balance but the supports: forces that press on them without limit.
            return bool(np.isinf(self.proofs.bounds(self.proofs.proved(place)).low))
        self.steps.programs += 1
        try:
            solve_program(self.model, place.pose, self.driver.rate(place.s) * length)
        except Locked:
            return True
        except SolveError:
            pass
        return False

    def _turns(self, before: Place, after: Place) -> bool:
        """Whether blocks move otherwise than in the step before: a hinge has jumped, a joint slides or has closed."""
        if before.velocity is None or after.velocity is None:
            return False
        size = np.sqrt(self.steps.drag) / self.model.lengths
        change = np.linalg.norm((after.velocity - before.velocity) * size)
        return bool(change > EVENT_CHANGE * np.linalg.norm(before.velocity * size))

    def _works(self, before: Place, after: Place, motion: np.ndarray) -> tuple[float, float, float]:
        """Works of loads, on supports and of friction so far, with the forces at the end of the step."""
        model, contacts = self.model, after.contacts
        assert contacts is not None
        live, live_size = model.scaled_live
        free = model.assembly.free[:, None]
        load = (model.scaled_load + after.multiplier * live_size * live) * free
        resultant = (wrench_matrix(contacts, after.pose, model.length) @ after.forces.ravel()).reshape(motion.shape)
        started = measure_contacts(model.assembly, moved_vertices(model.assembly, before.pose), contacts)
        slipped = (contacts.slip - started.slip) / model.length
        done = (
            float((load * motion).sum()),
            float((np.where(free, 0.0, resultant) * motion).sum()),
            -float((after.forces[:, 1:] * slipped).sum()),
        )
        return tuple(np.add(self.works, done).tolist())
