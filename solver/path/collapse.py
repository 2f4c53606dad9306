"""Falling blocks: whether they come to rest nearby, and their motion after a collapse."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator
from contextlib import suppress
from dataclasses import replace

import numpy as np

from solver.contact_step.problem import NotSolved
from solver.kinematics import motion_size
from solver.results.increment import Increment, Status
from solver.results.mechanism import joint_rates, mechanism_of, with_motion
from solver.results.response import Collapse
from solver.tolerances import CLOSING_GAP, COMPUTED_GAP, FARTHEST_FALL

from .controls import Ending
from .equilibrium_check import EquilibriumChecks
from .reports import Reports
from .state import EquilibriumCheck, Place
from .stepping import STANDSTILL, Stepper

#: Steps in time, with those that are refused.
TIME_STEPS = 200

#: Movement, in block sizes, that is large against the compliance of the joints: that of the first frame of a fall.
MECHANISM = 1e-3

#: Movement in a step in time above which it is repeated, shorter, and in which nothing has moved; and of what falls by
#: which the joints of what stays have sprung back; in block sizes.
LARGEST_MOVEMENT, NO_MOVEMENT, SPRUNG_BACK = 0.03, 1e-7, 0.05

#: Acceleration, in units of g, and speed, in units of √(block size · g), of blocks that may be at rest.
SLOW = 1e-3


class Fall:
    """The motion of blocks from a place of the path that is not in equilibrium, with the supports fixed."""

    def __init__(
        self, stepper: Stepper, checks: EquilibriumChecks, reports: Reports, n_frames: int, on_step: Callable[[], None]
    ) -> None:
        self.stepper, self.checks, self.reports, self.n_frames = stepper, checks, reports, n_frames
        self.model, self.driver, self.on_step = stepper.model, stepper.driver, on_step

    def time_steps(
        self, place: Place, largest: float = LARGEST_MOVEMENT
    ) -> Iterator[tuple[Place, np.ndarray, float, float]]:
        """Steps in time from rest with the supports fixed, each repeated in a shorter time where it is too large.

        Yields places, motions in units of the program, the largest acceleration, in g, and speed, in √(block size · g).
        """
        # In units of √(block size / g).
        place, time, longest, idle = replace(place, velocity=None), 0.01, STANDSTILL, 0
        for _ in range(TIME_STEPS):
            self.on_step()
            try:
                new, motion, error = self.stepper.step(place, time, in_time=True)
                moved = error.moved
            except NotSolved as failure:
                new, moved = None, failure.moved
            if new is None or moved > largest:
                time *= min(0.5, 0.8 * np.sqrt(largest / max(moved, largest)))
                continue
            if not error.is_linearised and moved < MECHANISM:
                # What turns about points that it is pressed on swings past its rest in each linearisation.
                time = longest = time / 4.0
                continue
            place = new
            yield place, motion, error.turn / time**2, moved / time
            # Each is twice as long as the one before, so that forces out of balance would have moved the blocks, once
            # friction has followed the normal forces; steps that grow faster carry blocks past places where they come
            # to rest.
            idle = idle + 1 if moved < NO_MOVEMENT else 0
            if idle == 15:
                return
            time = min(time * (2.0 if moved < largest / 3.0 else 1.0), longest)

    def relaxed(self, place: Place, farthest: float = FARTHEST_FALL) -> Place | None:
        """The equilibrium in which blocks come to rest with the supports fixed; None where they move farther."""
        end, at_rest = self.relax(place, farthest)
        return replace(end, velocity=None) if at_rest else None

    def relax(self, place: Place, farthest: float = FARTHEST_FALL) -> tuple[Place, bool]:
        """Where blocks move with the supports fixed, and whether they come to rest in equilibrium there."""
        end, at_rest, slow = place, False, 0
        for end, _, acceleration, speed in self.time_steps(place):
            if self.movements(place, end).max() > farthest:
                return end, False
            at_rest = acceleration < SLOW and speed < SLOW
            slow += at_rest
            # Asked at the first of them, the second, the fourth: of places that creep most are in none.
            if at_rest and slow & (slow - 1) == 0 and self.checks.in_equilibrium(end):
                return end, True
        # A corner that comes to rest on the end of an edge is within rounding of contact points there.
        return end, at_rest and self.checks.in_equilibrium(end, CLOSING_GAP)

    def movements(self, one: Place, other: Place) -> np.ndarray:
        """(n_blocks,) array: largest component of the movement of free blocks from place to place, in block sizes."""
        movement = np.abs(one.pose.movement_to(other.pose) / self.model.lengths).max(axis=1)
        return np.where(self.stepper.free, movement, 0.0)

    def collapse(
        self, last: EquilibriumCheck, beyond: Place, upper_bound: float, multiplier_beyond: float | None
    ) -> Generator[Increment, None, Ending]:
        """Yield the frames of the fall from a place beyond the last equilibrium; return the collapse.

        No equilibrium is known from the upper bound of the parameter on; the multiplier there is at or below zero, or
        None where equilibrium itself is lost.
        """
        driver, model, at_once = self.driver, self.model, upper_bound <= last.place.s
        frames = list(self.frames(beyond, at_once))
        velocity = frames[0].velocity
        standing = motion_size(velocity, model.length).max() <= MECHANISM * model.length
        if model.has_live and beyond.velocity is not None and standing:
            # Where blocks stand without the live load, the mechanism is that of the path at its end.
            velocity = beyond.velocity
        velocity = velocity / max(float(motion_size(velocity, model.length).max()), 1e-300)
        # A phase that begins with the fall has no equilibrium.
        at_last, reaction = with_motion(frames[0], velocity), None
        if not at_once:
            at_last = self.reports.increment(last, velocity, last.place.works)
            reaction = at_last.reaction
        words, lost, what = str(mechanism_of(model.assembly, at_last)), "capacity", "no capacity is left"
        if multiplier_beyond is None:
            lost, what = "equilibrium", f"equilibrium is lost along the control at α = {last.measured:.6g},"
            # Statics alone may hold what falls: friction is where the motion has left it.
            with suppress(NotSolved):
                largest = float(self.checks.nearest(beyond, COMPUTED_GAP)[:, 0].max(initial=0.0)) * model.force
                words += f"; forces of up to {largest:.4g} N would be in equilibrium beyond, to which no motion leads"
                lost = "stable equilibrium"
        # A multiplier is interpolated to zero; an equilibrium is lost anywhere in the bracket.
        part = 0.5 if multiplier_beyond is None else last.measured / (last.measured - multiplier_beyond)
        collapse = Collapse(
            displacement=last.place.s + part * (upper_bound - last.place.s),
            bracket=(last.place.s, upper_bound),
            reaction=reaction,
            mechanism=velocity,
            unit=driver.unit,
            words=words,
            lost=lost,
        )
        del at_last, last, frames[max(self.n_frames, at_once) :]
        while frames:
            yield frames.pop(0)
        if not model.has_live:
            return Ending(Status.COLLAPSED, str(collapse), collapse)
        return Ending(Status.COLLAPSED, f"{what} at a control displacement of {collapse.displacement:.6g} m", collapse)

    def frames(self, place: Place, at_once: bool = False) -> Iterator[Increment]:
        """Frames of the fall without live load, each a movement of the same size, until the blocks are at rest."""
        if self.model.has_live:
            stepper = Stepper(replace(self.model, has_live=False), self.driver)
            reports = Reports(stepper, self.reports.number, self.reports.fell_at)
            fall = Fall(stepper, EquilibriumChecks(stepper), reports, self.n_frames, self.on_step)
            yield from fall.frames(place, at_once)
            return
        # Where something is taken away at once the joints of what stays spring back first.
        place = self.relax(place, SPRUNG_BACK)[0] if at_once else place
        for largest in (2.0 * MECHANISM, *[0.2] * max(self.n_frames - 1, 0)):
            start, total, ends = place, np.zeros_like(self.model.load), False
            for moved, motion, _, _ in self.time_steps(start, largest):
                place, total = moved, total + motion
                # The first one shows the mechanism once joints have moved by more than they give.
                ends = np.abs(total).max() > 0.1 or (largest < 0.1 and self._parted(start, total) > MECHANISM)
                if ends:
                    break
            yield self.reports.falling_increment(start, total * self.model.lengths)
            if not ends:
                return

    def _parted(self, start: Place, motion: np.ndarray) -> float:
        """How far a motion, (n_blocks, n_dof), parts the blocks of a joint at most, in block sizes."""
        programs = self.stepper.programs
        frame = self.reports.falling_increment(start, motion * self.model.lengths)
        # Those since the last increment belong to the one that is told.
        self.stepper.programs = programs
        return float(joint_rates(self.model.assembly, frame)[1].max(initial=0.0)) / self.model.length
