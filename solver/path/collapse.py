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
from solver.tolerances import COMPUTED_GAP, FARTHEST_FALL

from .controls import Ending
from .equilibrium_check import EquilibriumChecks
from .reports import Reports
from .state import EquilibriumCheck, Place
from .stepping import Stepper

#: Viscosity that is left where a collapse is enclosed.
REFINED = 1e-3

#: Movement in a step in time, in block sizes, above which it is taken again, shorter by the second more than that asks
#: for; steps, with those that are taken again; growth of the steps while blocks move by less than a third of it.
HASTY, SHORTER, STEPS_IN_TIME, GROWTH = 0.03, 0.8, 200, 2.0

#: First and longest step in time, in units of √(block size / g).
FIRST_TIME, LONGEST_TIME = 0.02, 1e3

#: Acceleration, in units of g, and speed, in units of √(block size · g), under which what has moved may be at rest.
STOPPED, SLOW = 1e-3, 1e-3

#: Movement of a block, in block sizes, below which a step in time has moved none, and such steps after which none will:
#: as each is twice as long, a force out of balance would have moved it.
AT_REST, IDLE = 1e-7, 12

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

    def in_time(self, place: Place, longest: float = HASTY) -> Iterator[tuple[Place, np.ndarray, float, float]]:
        """Steps in time from rest, the supports at rest, in each of which blocks move by a little.

        Yields
        ------
        place : Place
        motion : (n_blocks, n_dof) array
            In units of the program.
        acceleration : float
            Largest, in units of g.
        speed : float
            Of the fastest block, in units of √(block size · g).
        """
        place, time, idle = replace(place, velocity=None), FIRST_TIME, 0
        for _ in range(STEPS_IN_TIME):
            try:
                new, motion, error = self.stepper.step(place, time, in_time=True)
                moved = error.moved
            except NotSolved as failure:
                new, moved = None, getattr(failure, "moved", 0.0)
            if new is None or moved > longest:
                time *= min(0.5, SHORTER * np.sqrt(longest / max(moved, longest)))
                continue
            place = new
            yield place, motion, error.turn / time**2, moved / time
            idle = idle + 1 if moved < AT_REST else 0
            if idle == IDLE:
                return
            time = min(time * (GROWTH if moved < longest / 3.0 else 1.0), LONGEST_TIME)

    def at_rest(self, place: Place, farthest: float = FARTHEST_FALL, gap: float = COMPUTED_GAP) -> Place | None:
        """The equilibrium in which what falls comes to rest with the supports still; None where it goes farther."""
        end, rests = self.end(place, farthest, gap)
        return replace(end, velocity=None) if rests else None

    def end(self, place: Place, farthest: float = FARTHEST_FALL, gap: float = COMPUTED_GAP) -> tuple[Place, bool]:
        """Where what falls ends with the supports still, and whether it rests there or goes farther."""
        end = place
        for end, _, acceleration, speed in self.in_time(place):
            if self.ways(place, end).max() > farthest:
                return end, False
            if acceleration < STOPPED and speed < SLOW and self.checks.in_equilibrium(end, gap):
                return end, True
        return end, False

    def ways(self, one: Place, other: Place) -> np.ndarray:
        """(n_blocks,) array: largest component of the movement of free blocks from place to place, in block sizes."""
        movement = np.abs(one.pose.movement_to(other.pose) / self.model.lengths).max(axis=1)
        return np.where(self.stepper.free, movement, 0.0)

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
            # What is held by less than counts as a bearing goes on as it came.
            velocity = np.zeros_like(model.load) if beyond.velocity is None else beyond.velocity
            frames = [self.reports.falling(beyond, velocity, beyond.s)]
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
        return Falling(
            stepper,
            EquilibriumChecks(stepper),
            Reports(stepper, self.reports.number, self.reports.fell_at),
            self.falling_frames,
        )

    def _fall(self, place: Place) -> Iterator[Increment]:
        """Frames of the fall, each a movement of the same size, until what falls rests."""
        for least in (MECHANISM, *[FRAME] * max(self.falling_frames - 1, 0)):
            start, total = place, np.zeros_like(self.model.load)
            for moved, motion, _, _ in self.in_time(start, 2.0 * least):
                place, total = moved, total + motion
                if np.abs(total).max() > least:
                    break
            yield self.reports.falling(start, total * self.model.lengths, start.s)
            if np.abs(total).max() <= least:
                return
