"""What falls: whether it comes to rest nearby, and how it goes down after a collapse."""

from __future__ import annotations

from collections.abc import Generator, Iterator
from dataclasses import replace

import numpy as np

from solver.contact_step.problem import NotSolved
from solver.kinematics import motion_size
from solver.results.increment import Increment, Status
from solver.results.mechanism import mechanism_of
from solver.results.response import Collapse
from solver.tolerances import COMPUTED_GAP, FARTHEST_FALL, JUMP, VISCOSITY

from .controls import Ending
from .equilibrium_check import EquilibriumChecks
from .reports import Reports
from .state import EquilibriumCheck, Place
from .stepping import Stepper

#: Viscosity that is left where a collapse is enclosed and where blocks come to rest.
REFINED = 1e-3

#: Movement in a step, in block sizes, above which it is taken again, a third as long; steps, with those that are taken
#: again; growth of the steps while blocks move by less than a third of it.
HASTY, RELAXATIONS, GROWTH = 0.03, 200, 3.0

#: First of these steps, and the longest, as movements of the supports in block sizes.
FIRST_RELAXATION, LONGEST_RELAXATION = 1e-3, 1e2

#: Unbalanced force, in block weights, under which what creeps may have come to rest, and what has jumped.
SLOW, STOPPED = 1e-2, 1e-5

#: At rest: movement of a block, in block sizes, in a step as long as a block size.
AT_REST = 1e-7

#: A frame of the fall is a movement of this, in block sizes, the first one of that: large against the compliance of the
#: joints, small enough for rotations to be velocities.
FRAME, MECHANISM = 0.1, 1e-3


class Falling:
    """What falls from a place of the path, the driver at rest.

    Parameters
    ----------
    stepper : Stepper
    checks : EquilibriumChecks
    reports : Reports
    falling_frames : int
        Frames of the fall after collapse.
    """

    def __init__(self, stepper: Stepper, checks: EquilibriumChecks, reports: Reports, falling_frames: int) -> None:
        self.stepper, self.checks, self.reports, self.falling_frames = stepper, checks, reports, falling_frames
        self.model, self.driver = stepper.model, stepper.driver

    def relaxation(
        self, place: Place, viscosity: float = REFINED, longest: float = HASTY
    ) -> Iterator[tuple[Place, np.ndarray, float]]:
        """Steps with the supports at rest, in each of which blocks move by a little.

        Yields
        ------
        place : Place
        motion : (n_blocks, n_dof) array
            In units of the program.
        unbalanced : float
            Largest force against which blocks move, in block weights.
        """
        size, largest = FIRST_RELAXATION, LONGEST_RELAXATION
        for _ in range(RELAXATIONS):
            try:
                new, motion, error = self.stepper.step(place, size * self.stepper.unit, still=True, viscosity=viscosity)
            except NotSolved:
                new = None
            if new is None or error.moved > longest:
                size /= 3.0
                continue
            place = new
            yield place, motion, VISCOSITY * viscosity / size * error.moved
            if size >= 1.0 and error.moved < AT_REST:
                return
            size = min(size * (GROWTH if error.moved < longest / 3.0 else 1.0), largest)

    def at_rest(self, place: Place, farthest: float = FARTHEST_FALL, gap: float = COMPUTED_GAP) -> Place | None:
        """The equilibrium in which what falls comes to rest with the supports still; None where it goes farther."""
        start = place.pose
        for rest, _, unbalanced in self.relaxation(place):
            way = float(np.abs(start.movement_to(rest.pose) / self.model.lengths).max())
            if way > farthest:
                return None
            if unbalanced < (SLOW if way <= JUMP else STOPPED) and self.checks.in_equilibrium(rest, gap):
                return rest
        return None

    def movement(self, one: Place, other: Place) -> float:
        """Largest movement of a block from one place to another, in block sizes."""
        return float(np.abs(one.pose.movement_to(other.pose) / self.model.lengths)[self.stepper.free].max(initial=0.0))

    def collapse(
        self, last: EquilibriumCheck, beyond: Place, upper_bound: float, multiplier_beyond: float | None
    ) -> Generator[Increment, None, Ending]:
        """Yield the frames of the fall that follows the last equilibrium.

        Parameters
        ----------
        last : EquilibriumCheck
        beyond : Place
            From which the structure falls.
        upper_bound : float [m or rad]
            Smallest parameter known to have no equilibrium.
        multiplier_beyond : float, optional
            There, at or below zero; None where equilibrium itself is lost.
        """
        driver, model = self.driver, self.model
        frames = list(self._dead_load_alone()._fall(beyond))
        if not frames:
            frames = [self.reports.falling(beyond, np.zeros_like(model.load), beyond.s)]
        # The first movement that is large against the compliance of the joints.
        sizes = [float(motion_size(frame.velocity, model.length).max()) for frame in frames]
        chosen = next((k for k, size in enumerate(sizes) if size > MECHANISM * model.length), int(np.argmax(sizes)))
        velocity, largest = frames[chosen].velocity, max(sizes[chosen], 1e-300)
        standing = self.reports.reported(
            last.place,
            last.contacts,
            last.forces,
            last.friction,
            velocity / largest,
            last.measured,
            np.zeros_like(model.load),
            frames[chosen].certificate,
            Status.EQUILIBRIUM,
            (),
        )
        # Where a multiplier reaches zero, it does so in between; an equilibrium that is lost, somewhere.
        part = 0.5 if multiplier_beyond is None else last.measured / (last.measured - multiplier_beyond)
        reaction = last.measured
        if model.live is not None:
            reaction *= model.live_force
        collapse = Collapse(
            displacement=last.place.s + part * (upper_bound - last.place.s),
            bracket=(last.place.s, upper_bound),
            reaction=reaction,
            mechanism=velocity / largest,
            unit=driver.unit,
            words=str(mechanism_of(model.assembly, standing)),
            lost="equilibrium" if multiplier_beyond is None else "capacity",
        )
        multiplier = standing.load_multiplier
        del standing, last, frames[self.falling_frames :]
        while frames:
            yield frames.pop(0)
        if model.live is None:
            return Ending(Status.COLLAPSED, str(collapse), collapse)
        what = "no capacity is left"
        if multiplier_beyond is None:
            what = f"equilibrium is lost along the control at α = {multiplier:.6g},"
        return Ending(Status.COLLAPSED, f"{what} at a control displacement of {collapse.displacement:.6g} m", collapse)

    def _dead_load_alone(self) -> Falling:
        """The same without a live load: a fall knows none."""
        if self.model.live is None:
            return self
        stepper = Stepper(replace(self.model, live=None), self.driver)
        return Falling(stepper, EquilibriumChecks(stepper), Reports(stepper, self.reports.number), self.falling_frames)

    def _fall(self, place: Place) -> Iterator[Increment]:
        """Pseudo-time frames: what falls sinks against the viscosity until it rests."""
        for least in (MECHANISM, *[FRAME] * max(self.falling_frames - 1, 0)):
            start, total = place, np.zeros_like(self.model.load)
            for moved, motion, _ in self.relaxation(start, viscosity=1.0, longest=2.0 * least):
                place, total = moved, total + motion
                if np.abs(total).max() > least:
                    break
            yield self.reports.falling(start, total * self.model.lengths, start.s)
            if np.abs(total).max() <= least:
                return
