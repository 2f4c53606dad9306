"""What falls: whether it comes to rest nearby, and how it goes down after a collapse."""

from __future__ import annotations

from collections.abc import Generator, Iterator
from dataclasses import replace
from itertools import count, islice

import numpy as np

from solver.kinematics import motion_size
from solver.program.step import NotSolved
from solver.results.increment import Increment, Status
from solver.results.mechanism import mechanism_of
from solver.results.response import Collapse
from solver.tolerances import DRAG, FARTHEST_FALL, JUMP

from .controls import Ending
from .place import Falls, Note, Place, Proved
from .proofs import Proofs
from .reports import Reports
from .stepping import GROWTH, MECHANISM, Steps

#: A fall is followed in steps of this movement of a block, in block sizes.
FALL_STEP = 0.1
FALL_STEPS, CREEPS, FALL_FAILURES = 120, 16, 60

#: Steps in which what falls is followed to where it may come to rest: after one that was not solved they grow slowly.
SETTLING_STEPS = 1000

#: Unbalanced force, in block weights, under which what creeps may have come to rest.
CREEPING = 1e-2

#: At rest: movement of a block in a step of a fall whose drag is that of a step of a block size.
AT_REST = 1e-7


class Falling:
    """What falls from a place of the path, the driver at rest.

    Parameters
    ----------
    steps : Steps
    proofs : Proofs
    reports : Reports
    falling_frames : int
        Frames of the fall after collapse.
    """

    def __init__(self, steps: Steps, proofs: Proofs, reports: Reports, falling_frames: int) -> None:
        self.steps, self.proofs, self.reports, self.falling_frames = steps, proofs, reports, falling_frames
        self.model, self.driver = steps.model, steps.driver
        self.sunk: tuple[Place, list[tuple[Place, np.ndarray, float]], Iterator[tuple[Place, np.ndarray, float]]] | None
        self.sunk = None
        self.lost_at: tuple[Place, float] | None = None

    def settles(self, place: Place, steps: int | None = None, farthest: float = FARTHEST_FALL) -> Proved | None:
        """The equilibrium in which a structure that falls comes to rest, where it does so soon and near."""
        model, start, way, steps = self.model, place.pose, 0.0, steps or SETTLING_STEPS
        self.lost_at = None
        for number, (sunk, motion, length) in enumerate(islice(self.sinking(place), steps), start=1):
            way = float(np.abs(sunk.pose.positions - start.positions).max())
            if way > farthest * model.length:
                return None
            # As slow as what creeps under a small part of its weight.
            fastest = float(np.abs(motion[model.assembly.free]).max(initial=0.0))
            speed = fastest * model.length / (length * self.steps.lever)
            at_rest = self._at_rest(motion, length)
            often = number & (number - 1) == 0 or number == steps or at_rest
            if speed * DRAG > CREEPING or not often:
                continue
            found = self.proofs.stands(sunk)
            if self.proofs.holds(found):
                if way > JUMP * model.length:
                    self.reports.notes.append(Note(sunk.s, self.reports.jump(start, sunk.pose)))
                return found
            if at_rest:
                return None
        # Neither at rest nor far away: how it goes on is not known.
        self.lost_at = place, way
        return None

    def _at_rest(self, motion: np.ndarray, length: float) -> bool:
        """Whether a step that the drag hardly held back moved nothing: a short one may not show what begins to fall."""
        return length * self.steps.lever >= self.model.length and bool(np.abs(motion).max() < AT_REST)

    def sinking(self, place: Place) -> Iterator[tuple[Place, np.ndarray, float]]:
        """Steps in which what falls sinks against the drag, the driver at rest; remembered for who asks once more."""
        if self.sunk is None or self.sunk[0] is not place:
            self.sunk = (place, [], self._sink(place))
        _, steps, more = self.sunk
        for number in count():
            if number == len(steps):
                try:
                    steps.append(next(more))
                except StopIteration:
                    return
            yield steps[number]

    def _sink(self, place: Place) -> Iterator[tuple[Place, np.ndarray, float]]:
        """Work out the steps of :meth:`sinking`; each moves blocks by a little."""
        length, largest = (part * self.model.length / self.steps.lever for part in (MECHANISM * DRAG, 10.0))
        failures, grow = 0, 2.5
        while failures < FALL_FAILURES:
            try:
                new, motion = self.steps.step(place, length, still=True)
            except (NotSolved, Falls):
                length, failures, grow = length / 3.0, failures + 1, GROWTH
                continue
            moved_by = float(np.abs(motion[self.model.assembly.free]).max(initial=0.0))
            if moved_by > 2.0 * FALL_STEP:
                length, failures = length * FALL_STEP / moved_by, failures + 1
                continue
            place = new
            yield place, motion, length
            length = min(length * min(grow, max(FALL_STEP / max(moved_by, 1e-300), 0.5)), largest)

    def collapse(
        self, last: Proved, without: Place, first_without: float, spent: float | None
    ) -> Generator[Increment, None, Ending]:
        """Yield the frames of the fall that follows the last equilibrium.

        Parameters
        ----------
        last : Proved
        without : Place
            From which the structure falls.
        first_without : float [m or rad]
            Smallest parameter known to have no equilibrium.
        spent : float, optional
            Multiplier there, at or below zero; None where equilibrium itself is lost.
        """
        driver, model = self.driver, self.model
        frames = list(self._alone()._fall(without))
        if not frames:
            frames = [self.reports.falling(without, np.zeros_like(model.load), without.s)]
        doubt = ""
        if self.lost_at is not None and self.lost_at[0] is without:
            doubt = (
                f"at {without.s:.6g} {driver.unit}: what falls could be followed by {self.lost_at[1]:.2g} m only; no "
                "equilibrium exists there, but there may be one near, in which the structure stands on"
            )
            frames[0] = replace(frames[0], notes=(doubt,))
        # The first movement that is large against the give of the joints, and small enough to be one of velocities.
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
        part = 0.5 if spent is None else last.measured / (last.measured - spent)
        reaction = last.measured
        if model.live is not None:
            reaction *= model.live_force
        collapse = Collapse(
            displacement=last.place.s + part * (first_without - last.place.s),
            bracket=(last.place.s, first_without),
            reaction=reaction,
            mechanism=velocity / largest,
            unit=driver.unit,
            words=str(mechanism_of(model.assembly, standing)),
            lost="equilibrium" if spent is None else "capacity",
        )
        del standing, last, frames[self.falling_frames :]
        while frames:
            yield frames.pop(0)
        if model.live is None:
            return Ending(Status.COLLAPSED, f"{collapse}; {doubt}" if doubt else str(collapse), collapse)
        what = "equilibrium is lost" if spent is None else "no capacity is left"
        return Ending(Status.COLLAPSED, f"{what} at a control displacement of {collapse.displacement:.6g} m", collapse)

    def _alone(self) -> Falling:
        """The same under the dead load alone: a fall knows no live load."""
        if self.model.live is None:
            return self
        steps = Steps(replace(self.model, live=None), self.driver)
        return Falling(steps, Proofs(steps), Reports(steps, self.reports.number), self.falling_frames)

    def _fall(self, place: Place) -> Generator[Increment, None, None]:
        """Pseudo-time frames: what falls sinks against the drag until it rests."""
        frames, start, total = 0, place, np.zeros_like(self.model.load)
        for new, motion, length in islice(self.sinking(place), max(4 * self.falling_frames, FALL_STEPS)):
            total = total + motion
            moved_by = float(np.abs(total).max())
            at_rest = self._at_rest(motion, length)
            if (frames == 0 and moved_by > MECHANISM) or moved_by > FALL_STEP or at_rest:
                yield self.reports.falling(start, total * self.model.lengths, start.s)
                frames, start, total = frames + 1, new, np.zeros_like(total)
            if at_rest or frames >= max(self.falling_frames, 1):
                return
