"""The equilibrium path: from one place to the next under a driver, to collapse, to its limit, or until it locks."""

from __future__ import annotations

from collections.abc import Generator, Iterator
from dataclasses import dataclass, replace
from itertools import count, islice

import numpy as np

from solver.assembly import find_contacts, measure_contacts
from solver.equilibrium import block_forces, wrench_matrix
from solver.geometry.contacts import Contacts, matched_contacts
from solver.kinematics import Pose, motion_size, moved, moved_vertices, relative_velocities
from solver.lp.problem import SolveError
from solver.program.admissible import Admissible, admissible
from solver.program.coulomb import solve_step
from solver.program.increment import Locked, solve_program
from solver.program.light_blocks import light_blocks
from solver.program.model import Model
from solver.program.step import NotSolved, Step
from solver.results.certificate import Certificate
from solver.results.increment import Increment, State, Status
from solver.results.mechanism import mechanism_of
from solver.results.response import Collapse
from solver.tolerances import (
    CLOSING_GAP,
    COMPUTED_GAP,
    DRAG,
    FARTHEST_FALL,
    GIVE,
    GIVE_ACROSS,
    IMPERFECTION,
    JUMP,
    MEMORY,
    USED_UP,
)

from .checkpoint import ProgramCheckpoint
from .controls import Ending
from .drivers import Driver

#: Largest step inside an increment: movement of the supports in block sizes. The smallest, in the same measure, ends
#: the analysis where no step is solved.
LARGEST_STEP, SMALLEST_STEP = 0.025, 1e-9

#: Change of the velocities, as a part of them, from which on a step is taken again in shorter ones, down to this part
#: of the largest.
EVENT_CHANGE, EVENT_REFINEMENT = 0.03, 8.0

#: First step, and movement by which a structure has begun to move, in elastic gives.
FIRST_STEP, ONSET = 0.1, 100.0

#: Geometries at which a step is linearised; movement from one to the next, in block sizes, at which it is exact, and
#: from which on it is not accepted: its square is what is left of gaps. What falls need not be exact.
LINEARISATIONS, EXACT, ACCEPTED = 6, 1e-6, 1e-4

#: The structure falls where a block moves so many times as fast as the drag alone would let it sink under this part of
#: its weight.
FALLING_FORCE = 1.0

#: Part of the drag that is left where a collapse is being enclosed: within so many tolerances of it.
CARE, ENCLOSED = 1e-3, 8.0

#: Part of the give of the joints that is left there, where forces grow without limit before a snap.
STIFF = 1e-2

#: Where a block moves so many times as fast as the supports, the place is proved before the path goes on; and after so
#: many steps.
FAST, STEPS_UNPROVED = 10.0, 16

#: Growth of the steps after one that was not solved.
SLOW_GROWTH = 1.25

#: A fall is followed in steps of this movement of a block, in block sizes.
FALL_STEP = 0.1
FALL_STEPS, CREEPS, FALL_FAILURES = 60, 16, 30

#: Unbalanced force, in block weights, under which what creeps may have come to rest.
CREEPING = 1e-2

#: Movement from which a mechanism is read, in block sizes: large against the give of the joints, small enough for
#: rotations to be velocities.
MECHANISM = 1e-3

#: At rest: movement of a block in a step of a fall whose drag is that of a step of a block size.
AT_REST = 1e-7

#: Penetration that a step may leave, in block sizes, where forces grow fast.
PRESSED = 1e-5

#: Force, in total loads, beyond which blocks wedged between supports count as locked.
LOCKED_FORCE = 1e3

#: Blocks that a message names.
NAMED = 4


#: A corner that carries this force, in block weights, may slip past the end of its edge, or come into another block
#: from the side, in steps of the supports, and of blocks, no larger than this, in block sizes; what falls, in steps
#: whose drag is that of the second.
SLIPPED_OFF_FORCE, SLIP_OFF, SHORTEST_FALL = 1e-3, 1e-4, 1e-6

#: Contact points of two blocks no farther apart than this, in block sizes, are one, by whichever corner and edge.
SAME_PLACE = 1e-2


class Falls(Exception):
    """Blocks move far faster than the supports: no equilibrium near."""


class Wedged(Exception):
    """Blocks are wedged between the supports: forces grow without limit."""

    def __init__(self, place: Place) -> None:
        super().__init__("wedged")
        self.place = place


class Pressed(NotSolved):
    """Blocks were pressed into each other in a step, by more than what the joints give."""


class NoStep(Exception):
    """No step, however small, is solved."""


@dataclass(frozen=True)
class Place:
    """Where a path stands: everything that the next step remembers.

    Attributes
    ----------
    s : float [m or rad]
        Parameter of the driver.
    pose : Pose
    contacts : Contacts, optional
        The contact points that carry forces; None where none are remembered.
    forces : (n_contacts, d) array
        Their normal and shear forces, in units of the program.
    multiplier : float
        Of the live load.
    velocity : (n_blocks, n_dof) array, optional
        In the steps that led here, per unit of the parameter, those within :data:`MEMORY` above all; None where nothing
        moved with it.
    """

    s: float
    pose: Pose
    contacts: Contacts | None
    forces: np.ndarray
    multiplier: float = 0.0
    velocity: np.ndarray | None = None


@dataclass(frozen=True)
class Note:
    """What happened at a place of the path: parameter s [m or rad], and words."""

    s: float
    words: str


@dataclass(frozen=True)
class Checkpoint:
    """Everything a path remembers when an increment is reported: given back, it goes on bit for bit.

    Attributes
    ----------
    phase : int
        Number of the settlement, from 0.
    start : Pose
        Where the phase began.
    place : Place
        Reported.
    step : float [m or rad]
        To try next.
    first_without : float [m or rad]
        Smallest parameter known to have no equilibrium; infinite where none is known.
    works : tuple of float
        Of loads, on supports and of friction since the start of the phase, in units of the program.
    careful_until : float [m or rad]
        Parameter up to which a collapse is being enclosed.
    ended : bool
        The phase has reached its limit.
    marks : tuple of Place
        The last two that are a notable way apart.
    program : ProgramCheckpoint, optional
        Of increments by linear program, to which nothing else here but phase and start belongs.
    """

    phase: int
    start: Pose
    place: Place
    step: float
    first_without: float
    works: tuple[float, float, float] = (0.0, 0.0, 0.0)
    careful_until: float = -np.inf
    ended: bool = False
    marks: tuple[Place, ...] = ()
    program: ProgramCheckpoint | None = None


@dataclass(frozen=True)
class Proved:
    """A place with what equilibrium says of it."""

    place: Place
    contacts: Contacts
    friction: np.ndarray
    bounds: Admissible
    forces: np.ndarray
    measured: float


def drag_of(model: Model) -> np.ndarray:
    """(n_blocks, n_dof) array: weights, and weights times a radius of gyration squared, in units of the program."""
    assembly, d = model.assembly, model.dimension
    weight = np.linalg.norm(model.load[:, :d], axis=1) / model.force
    weight = np.maximum(weight, 1e-3 * assembly.masses / max(float(assembly.masses[assembly.free].mean()), 1e-300))
    turning = weight * assembly.shapes.gyration / model.length**2
    return np.column_stack([weight] * d + [turning] * (len(model.lengths) - d))


class Path:
    """The path of one phase under a driver.

    Parameters
    ----------
    model : Model
        Units, loads, interfaces.
    driver : Driver
    number : int
        Of the phase.
    falling_frames : int
        Frames of the fall after collapse.
    """

    def __init__(self, model: Model, driver: Driver, number: int = 0, falling_frames: int = 0) -> None:
        self.model, self.driver, self.number, self.falling_frames = model, driver, number, falling_frames
        self.drag = drag_of(model)
        self.lever = driver.lever()
        self.longest = min(driver.increment, LARGEST_STEP * model.length / self.lever)
        self.finest = LARGEST_STEP / EVENT_REFINEMENT * model.length / self.lever
        self.programs, self.works, self.care = 0, (0.0, 0.0, 0.0), 1.0
        self.barrier, self.careful_until = np.inf, -np.inf
        self.marks: tuple[Place, ...] = ()
        self.notes: list[Note] = []
        self.around: tuple[Pose, Contacts] | None = None
        self.sunk: tuple[Place, list[tuple[Place, np.ndarray, float]], Iterator[tuple[Place, np.ndarray, float]]] | None
        self.sunk = None
        rate = driver.rate(0.0)
        d = model.dimension
        sideways = rate[model.assembly.moving, :d].sum(axis=0)
        size = float(np.linalg.norm(sideways))
        self.imperfection = np.zeros_like(model.load)
        if size > 0.0:
            self.imperfection[:, :d] = IMPERFECTION * self.drag[:, :1] * sideways / size

    # Steps ----------------------------------------------------------------------------------------------------------

    def at_start(self, pose: Pose) -> Place:
        """The place of a pose that remembers no forces."""
        return Place(0.0, pose, None, np.zeros((0, self.model.dimension)))

    def rested(self, pose: Pose) -> Place:
        """The place in which a pose comes to rest from no forces at all.

        Where the pose itself is in equilibrium it stays as it is, with the forces found; otherwise what the drawing has
        left open closes.

        Raises
        ------
        NotSolved
        Falls
        """
        place = self.at_start(pose)
        for _ in range(2):
            place, _ = self.step(place, self.model.length / self.lever, still=True)
        unmoved = replace(place, pose=pose)
        return unmoved if self.proved(unmoved).bounds.exists else place

    def _remembered(self, place: Place, contacts: Contacts) -> np.ndarray:
        """(n_contacts, d) array: forces of the place at these contact points; zero at new ones."""
        if place.contacts is None or len(place.contacts) == 0 or len(contacts) == 0:
            return np.zeros((len(contacts), self.model.dimension))
        number, same = matched_contacts(contacts, place.contacts)
        return np.where(same[:, None], place.forces[number], 0.0)

    def step(self, place: Place, length: float, *, still: bool = False) -> tuple[Place, np.ndarray]:
        """One step of the driver, or one with the supports at rest whose drag is that of such a step.

        Parameters
        ----------
        place : Place
        length : float [m or rad]
        still : bool
            The driver stands still: what is not in equilibrium moves.

        Returns
        -------
        place : Place
        motion : (n_blocks, n_dof) array
            In units of the program; supports included.

        Raises
        ------
        NotSolved
        Falls
        """
        model, assembly, driver = self.model, self.model.assembly, self.driver
        free, scales = assembly.free, model.lengths
        s = place.s if still else place.s + length
        supports, size = driver.supports(s), length * self.lever / model.length
        start = self._around(place.pose)
        memory = self._remembered(place, start)
        normal, shear = memory[:, 0], memory[:, 1:]
        friction = model.interfaces.friction(assembly, start.block_a, start.block_b)
        n_dof = len(scales)
        rows = np.repeat(free, n_dof)
        load = (model.scaled_load + self.imperfection)[free].ravel()
        drag = DRAG * self.care / size * self.drag[free].ravel()
        if place.velocity is not None and not still:
            # The drag resists changes of the velocity: what moves on as before is soon not held back.
            load = load + drag * (place.velocity / scales * length)[free].ravel()
        live, live_size = model.scaled_live
        gone = np.zeros(len(load))
        multiplier = place.multiplier * live_size
        pose = self._with_supports(place.pose, supports)
        way, pressed, near = 0.0, 0.0, None
        stiff = 1.0 if self.care == 1.0 else STIFF
        for _ in range(LINEARISATIONS):
            contacts = measure_contacts(assembly, moved_vertices(assembly, pose), start)
            control = driver.control(pose) if model.live is not None else None
            linear = Step(
                matrix=wrench_matrix(contacts, pose, model.length),
                free=rows,
                load=load,
                drag=drag,
                gap=contacts.gaps / model.length,
                slip=(contacts.slip - start.slip) / model.length,
                normal=normal,
                shear=shear,
                friction=friction,
                give=(GIVE_ACROSS * stiff, GIVE * stiff),
                size=size,
                live=live[free].ravel() if control is not None else None,
                control=None if control is None else (control * scales / model.length)[free].ravel(),
                wanted=0.0 if control is None else (s - driver.gone(pose)) / model.length,
            )
            self.programs += 1
            found = solve_step(linear, gone, multiplier, near)
            near, pressed = found, float((found.normal - normal).max(initial=0.0)) * linear.give[0]
            # The give is taken back: the next linearisation starts from the forces it has reached.
            normal, shear, multiplier = found.normal, found.shear, found.multiplier
            gone = gone + found.motion
            full = np.zeros((assembly.n_blocks, n_dof))
            full[free] = gone.reshape(-1, n_dof) * scales
            pose = self._with_supports(moved(place.pose, full), supports)
            way = float(np.abs(found.motion).max(initial=0.0))
            if np.abs(gone).max(initial=0.0) > FARTHEST_FALL:
                raise Falls
            if way <= (ACCEPTED if still else EXACT):
                break
        if way > ACCEPTED:
            raise NotSolved(f"the geometry still moves by {way:.1e} block sizes")
        if pressed > PRESSED:
            raise Pressed(f"blocks are pressed into each other by {pressed:.1e} block sizes")
        motion = np.where(free[:, None], full, place.pose.movement_to(pose))
        if not still and np.abs(gone).max(initial=0.0) > max(FALLING_FORCE / (DRAG * self.care) * size, 1e3 * GIVE):
            raise Falls
        if size > (SHORTEST_FALL if still else SLIP_OFF) and np.abs(gone).max(initial=0.0) > SLIP_OFF:
            self._refuse_beyond(contacts, normal, pose)
        forces = np.column_stack([normal, shear])
        velocity = None
        if not still:
            before = np.zeros_like(motion) if place.velocity is None else place.velocity
            velocity = before + (motion - length * before) / (length + MEMORY * model.length / self.lever)
        return (
            Place(s, pose, contacts, forces, multiplier / (live_size or 1.0), velocity),
            motion / scales,
        )

    def _around(self, pose: Pose) -> Contacts:
        """The contact points at a pose; those at the last one asked for are remembered."""
        if self.around is None or self.around[0] is not pose:
            model = self.model
            self.around = pose, find_contacts(model.assembly, moved_vertices(model.assembly, pose), model.reach)
        return self.around[1]

    def _refuse_beyond(self, contacts: Contacts, normal: np.ndarray, pose: Pose) -> None:
        """Refuse a step at whose end a corner stands on no edge any more, or in a block that it did not see before.

        Raises
        ------
        NotSolved
        """
        length, end = self.model.length, self._around(pose)
        _, there = matched_contacts(contacts, end) if len(end) else (None, np.zeros(len(contacts), dtype=bool))
        off = np.flatnonzero(~there & (normal > SLIPPED_OFF_FORCE))
        if (~self._near(contacts, off, end, np.flatnonzero(end.gaps < SLIP_OFF * length))).any():
            raise NotSolved("a corner slips off its edge")
        _, seen = matched_contacts(end, contacts) if len(contacts) else (None, np.zeros(len(end), dtype=bool))
        inside = np.flatnonzero(~seen & (end.gaps < -SLIP_OFF * length))
        if (~self._near(end, inside, contacts, np.arange(len(contacts)))).any():
            raise NotSolved("a corner meets a block from the side")

    def _near(self, some: Contacts, which: np.ndarray, others: Contacts, those: np.ndarray) -> np.ndarray:
        """(len(which),) bool array: whether another contact point joins the same two blocks at the same place."""
        pair, other = (
            np.sort(np.stack([c.block_a[k], c.block_b[k]], axis=1), axis=1) for c, k in ((some, which), (others, those))
        )
        same = (pair[:, None] == other[None]).all(axis=2)
        apart = np.linalg.norm(some.points[which][:, None] - others.points[those][None], axis=2)
        return np.asarray((same & (apart < SAME_PLACE * self.model.length)).any(axis=1))

    def _with_supports(self, pose: Pose, supports: Pose) -> Pose:
        free = self.model.assembly.free
        return Pose(
            np.where(free[:, None], pose.positions, supports.positions),
            np.where(free[:, None], pose.rotations, supports.rotations),
        )

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
        smallest = SMALLEST_STEP * self.model.length / self.lever
        tolerance, started = self.driver.tolerance, place.s
        grow = 2.0
        for _ in range(STEPS_UNPROVED):
            ahead = target - place.s
            if ahead <= 1e-12 * max(abs(target), smallest):
                break
            careful = place.s < self.careful_until
            length = min(step, ahead)
            if np.isfinite(self.barrier):
                # Nearer than half-way only in the end, where it is tried once more.
                rest = self.barrier - place.s
                length = min(length, rest if rest <= tolerance / 4.0 else rest / 2.0)
            elif ahead > step * 1.000001:
                # Two equal steps rather than a long one and a sliver.
                length = min(step, ahead / 2.0)
            try:
                new, motion = self._careful_step(place, length) if careful else self.step(place, length)
            except NotSolved as error:
                if isinstance(error, Pressed) and self._locks(place, length):
                    raise Wedged(place) from None
                step, grow = length / 2.0, SLOW_GROWTH
                if step < smallest:
                    raise NoStep(f"at {place.s:.6g} {self.driver.unit}: {error}") from None
                continue
            except Falls:
                # The drag may lose its hold early.
                if self._falls_within(place, length):
                    step = length / 2.0
                    if careful and length <= tolerance / 4.0:
                        break
                grow = SLOW_GROWTH
                continue
            if float(new.forces[:, 0].max(initial=0.0)) > LOCKED_FORCE * self.model.total_load:
                raise Wedged(new)
            if length > self.finest * 1.000001 and self._turns(place, new):
                step = max(length / 2.0, self.finest)
                continue
            self.works = self._works(place, new, motion)
            place = replace(new, s=target) if length == ahead else new
            if place.s >= self.barrier:
                self.barrier = np.inf
            if not self.marks or place.s - self.marks[0].s > MECHANISM * self.model.length / self.lever:
                self.marks = (place, *self.marks[:1])
            step = min(self.longest, max(step, grow * length)) if length >= 0.99 * step else step
            moved_by = float(np.abs(motion[self.model.assembly.free]).max(initial=0.0))
            if moved_by > FAST * length * self.lever / self.model.length:
                # What jumps does not go on like that.
                place = replace(place, velocity=None)
                if moved_by > 1e2 * GIVE and place.s > started:
                    break
        return place, step

    def _locks(self, place: Place, length: float) -> bool:
        """Whether no movement whatever lets the supports go on: proved by a linear program without end."""
        if self.model.live is not None:
            return False
        if self.model.dimension == 3:
            # What nothing can balance but the supports: forces that press on them without limit.
            return bool(np.isinf(self.proved(place).bounds.low))
        self.programs += 1
        try:
            solve_program(self.model, place.pose, self.driver.rate(place.s) * length)
        except Locked:
            return True
        except SolveError:
            pass
        return False

    def _careful_step(self, place: Place, length: float) -> tuple[Place, np.ndarray]:
        """Take a step with less drag and stiffer joints, or an ordinary one where that is not solved."""
        self.care = CARE
        try:
            return self.step(place, length)
        except NotSolved:
            self.care = 1.0
            return self.step(place, length)
        finally:
            self.care = 1.0

    def _turns(self, before: Place, after: Place) -> bool:
        """Whether blocks move otherwise than in the step before: a hinge has jumped, a joint slides or has closed."""
        if before.velocity is None or after.velocity is None:
            return False
        size = np.sqrt(self.drag) / self.model.lengths
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

    # Proof ----------------------------------------------------------------------------------------------------------

    def proved(self, place: Place) -> Proved:
        """What equilibrium within friction says of a place, and balanced forces near those of the path."""
        model, assembly = self.model, self.model.assembly
        contacts = self._around(place.pose)
        friction = model.interfaces.friction(assembly, contacts.block_a, contacts.block_b)
        rate = None if model.live is not None else self.driver.rate(place.s)
        bounds = admissible(
            model, place.pose, contacts, friction, rate, vertex=place.s == 0.0, gap=self._closed_gap(place)
        )
        self.programs += bounds.programs
        remembered = self._remembered(place, contacts)
        if not bounds.exists:
            return Proved(place, contacts, friction, bounds, remembered, place.multiplier)
        if place.s == 0.0 and np.isfinite(bounds.low if model.live is None else bounds.high):
            # Nothing has moved: what the first movement has to overcome, least reaction or largest multiplier.
            forces, multiplier = bounds.forces, bounds.high
        else:
            # Where none near those of the path are found, those of the bounds are in equilibrium, too.
            forces, multiplier = self._balanced(place, contacts, friction, remembered) or (bounds.forces, bounds.high)
        if model.live is None:
            multiplier = float((self._on_supports(contacts, place.pose, forces) * self.driver.rate(place.s)).sum())
        return Proved(place, contacts, friction, bounds, forces, multiplier)

    def _closed_gap(self, place: Place) -> float:
        """Largest gap of contact points that may carry in an equilibrium at a place, in block sizes."""
        if place.s == 0.0 or place.s < self.careful_until:
            return COMPUTED_GAP
        # Not wider than how closely a collapse is to be enclosed.
        return max(COMPUTED_GAP, min(CLOSING_GAP, self.driver.tolerance * self.lever / self.model.length))

    def _on_supports(self, contacts: Contacts, pose: Pose, forces: np.ndarray) -> np.ndarray:
        """(n_blocks, n_dof) array [N, N, N·m]: what the structure does to each support; zero for free blocks."""
        model = self.model
        resultant = block_forces(contacts, pose, forces) * model.force
        return np.where(model.assembly.free[:, None], 0.0, resultant)

    def _balanced(
        self, place: Place, contacts: Contacts, friction: np.ndarray, remembered: np.ndarray
    ) -> tuple[np.ndarray, float] | None:
        """Forces in equilibrium without the drag, near those remembered, or none; open points carry nothing."""
        model, free = self.model, self.model.assembly.free
        closed = np.flatnonzero(contacts.gaps <= self._closed_gap(place) * model.length)
        d = model.dimension
        columns = (d * closed[:, None] + np.arange(d)).ravel()
        live, live_size = model.scaled_live
        load = model.scaled_load[free].ravel()
        none = np.zeros(len(closed))
        # What has used up its friction goes on doing so: where it slides, forces are no matter of choice.
        mu, normal, shear = friction[closed], remembered[closed, 0], remembered[closed, 1:]
        size = np.linalg.norm(shear, axis=1)
        used_up = (normal > 0.0) & (size >= mu * normal * (1.0 - USED_UP))
        far = np.where(used_up, -1e2 * (1.0 + normal), 0.0)
        on = far[:, None] * np.divide(shear, size[:, None], out=np.zeros_like(shear), where=size[:, None] > 0.0)
        still = Step(
            matrix=wrench_matrix(contacts, place.pose, model.length)[:, columns],
            free=np.repeat(free, len(model.lengths)),
            load=load,
            drag=np.full(len(load), 1e-12),
            gap=none,
            slip=on,
            normal=normal,
            shear=shear,
            friction=mu,
            give=(1.0, 1.0),
            size=1.0,
            live=live[free].ravel() if model.live is not None else None,
            control=live[free].ravel() if model.live is not None else None,
        )
        forces = np.zeros_like(remembered)
        for step in (still, replace(still, slip=np.zeros_like(on))):
            try:
                found = solve_step(step, np.zeros(len(load)), place.multiplier * live_size)
                break
            except NotSolved:
                continue
        else:
            return None
        forces[closed] = np.column_stack([found.normal, found.shear])
        return forces, found.multiplier / (live_size or 1.0)

    # The loop -------------------------------------------------------------------------------------------------------

    def follow(self, start: Place, resume: Checkpoint | None = None) -> Generator[Increment, None, Ending]:
        """Yields the increments of the phase, returns how it ended and leaves the last place in ``self.last``."""
        driver, tolerance = self.driver, self.driver.tolerance
        self.last, self.start = start, start.pose
        step = FIRST_STEP * GIVE * self.model.length / self.lever
        if resume is not None:
            start, step, self.barrier = resume.place, resume.step, resume.first_without
            self.start, self.works, self.careful_until = resume.start, resume.works, resume.careful_until
            self.marks = resume.marks
        proved = self.proved(start)
        if resume is not None:
            self.programs = 0
            if resume.ended:
                return self._reached()
        if resume is None and not (proved.bounds.exists and self._light_blocks_stand(start.pose)):
            motion = next((motion for _, motion, _ in self._sinking(start)), self.drag)
            yield self._falling(start, motion * self.model.lengths, start.s)
            return Ending(Status.NO_INITIAL_EQUILIBRIUM, self._no_equilibrium(motion))
        if resume is None and self.model.live is not None and not 0.0 < proved.bounds.high < np.inf:
            if proved.bounds.high > 0.0:
                return Ending(
                    Status.LOCKED, "at a control displacement of 0 m no live load of this pattern moves the structure"
                )
            yield self._falling(start, np.zeros_like(self.model.load), start.s)
            return Ending(Status.NO_INITIAL_EQUILIBRIUM, "no live load of this pattern is carried")
        if resume is None and self.model.live is None and np.isinf(proved.bounds.low):
            length = GIVE * self.model.length / self.lever
            if self._locks(start, length):
                yield self._increment(proved, self.driver.rate(start.s))
                held = replace(start, contacts=proved.contacts, forces=proved.forces)
                return Ending(Status.LOCKED, self._locked(held))
        if resume is None and self.model.live is not None:
            _, onset = self._at_first(proved)
            if onset <= 0.0:
                raise ValueError(self.driver.misdirected())
        reported, without, spent = resume is not None, None, None
        self.reported = start.s
        while True:
            place = proved.place
            self.last = place
            if not reported:
                at_limit = place.s >= driver.limit * (1.0 - 1e-12)
                motion = self._next_motion(place)
                checkpoint = Checkpoint(
                    self.number,
                    self.start,
                    place,
                    step,
                    self.barrier,
                    self.works,
                    self.careful_until,
                    at_limit,
                    self.marks,
                )
                first = place.s == 0.0 and self.model.live is None
                at_rest, onset = self._at_first(proved) if first else (np.nan, np.nan)
                found = self._increment(proved, motion)
                yield replace(found, checkpoint=checkpoint, at_rest=at_rest, onset=onset)
                reported, self.reported = True, place.s
                if at_limit:
                    return self._reached()
            if self.barrier - place.s <= tolerance * (1.0 + 1e-9):
                # A hair beyond the last equilibrium: what loses its hold may come to rest nearby.
                without = without or self._beyond(place)
                settled = self._settles(without)
                if settled is not None:
                    proved, reported, self.barrier, without, spent = settled, False, np.inf, None, None
                    continue
                if place.s > self.reported:
                    yield self._increment(proved, self._motion_at_last(place))
                return (yield from self._collapse(proved, without, self.barrier, spent))
            try:
                new, step = self.advanced(place, min(self._next_stop(place.s), 0.5 * (place.s + self.barrier)), step)
            except Wedged as wedged:
                return Ending(Status.LOCKED, self._locked(wedged.place))
            except NoStep as reason:
                if place.s > self.reported:
                    yield self._increment(proved, self._motion_at_last(place))
                return Ending(Status.SOLVER_FAILED, self._no_step(str(reason)))
            if new is place:
                without, spent = None, None
                continue
            reached = self.proved(new)
            crept: Proved | None = reached
            lost = reached.measured if reached.bounds.exists else None
            if not self._holds(reached) and lost is None and new.s > self.careful_until:
                # What the drag holds back may only have to creep on.
                crept = self._settles(new, CREEPS, JUMP)
            if self._holds(crept):
                assert crept is not None
                # What has been shown of the place beyond stays true.
                proved, reported, without = crept, not self._is_stop(new.s), None
                spent = spent if np.isfinite(self.barrier) else None
            else:
                length = new.s - place.s
                step = min(step, 0.5 * length)
                if self._falls_within(place, length):
                    without, spent = new, lost

    def _falls_within(self, place: Place, length: float) -> bool:
        """Notes that no equilibrium was reached so far beyond a place; False where less drag is to be tried first."""
        near = ENCLOSED * self.driver.tolerance
        if place.s >= self.careful_until and length <= near:
            self.careful_until, self.barrier = place.s + 2.0 * near, np.inf
            return False
        self.barrier = place.s + length
        return True

    def _light_blocks_stand(self, pose: Pose) -> bool:
        """Whether blocks too light for the others' programs stand where the others do."""
        if self.model.live is not None or self.model.dimension == 3 or not light_blocks(self.model).any():
            return True
        self.programs += 1
        return not solve_program(self.model, pose).falling

    def _beyond(self, place: Place) -> Place:
        """A place just beyond one from which the structure falls: reached by the longest step that is solved."""
        length = self.driver.tolerance / 4.0
        for _ in range(20):
            try:
                return self.step(place, length)[0]
            except (NotSolved, Falls):
                length /= 4.0
        return place

    def _at_first(self, proved: Proved) -> tuple[float, float]:
        """The reaction at rest, and once the structure has begun to move: far beyond the give of the joints."""
        place, works, barrier, careful_until = proved.place, self.works, self.barrier, self.careful_until
        marks = self.marks
        rate = self.driver.rate(0.0)
        remembered = self._remembered(place, proved.contacts)
        at_rest = float((self._on_supports(proved.contacts, place.pose, remembered) * rate).sum())
        onset = np.nan
        give = GIVE * self.model.length / self.lever
        try:
            begun, _ = self.advanced(place, ONSET * give, FIRST_STEP * give)
            begun_there = self.proved(begun)
            onset = begun_there.measured if begun_there.bounds.exists else np.nan
        except (NoStep, Wedged):
            pass
        self.works, self.barrier, self.careful_until, self.marks = works, barrier, careful_until, marks
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

    def _holds(self, proved: Proved | None) -> bool:
        return proved is not None and proved.bounds.exists and (self.model.live is None or proved.measured > 0.0)

    def _next_motion(self, place: Place) -> np.ndarray:
        """(n_blocks, n_dof) array: velocity in the movement that follows, per unit of the parameter."""
        length = MECHANISM * self.model.length / self.lever
        try:
            _, motion = self.step(place, length)
        except (NotSolved, Falls):
            return self._motion_at_last(place)
        return motion * self.model.lengths / length

    def _motion_at_last(self, place: Place) -> np.ndarray:
        """(n_blocks, n_dof) array: velocity at the last equilibrium, beyond which a step would be one of the fall.

        The motion of the paper's linear program there; under a live load that a little before.
        """
        length = MECHANISM * self.model.length / self.lever
        before = next((one for one in self.marks if place.s - one.s >= length), None)
        try:
            if self.model.live is None and self.model.dimension == 2:
                found = solve_program(self.model, place.pose, self.driver.rate(place.s) * length)
                if not found.falling:
                    return found.motion / length
            if before is not None:
                return self.step(before, length)[1] * self.model.lengths / length
        except (NotSolved, Falls, Locked, SolveError):
            pass
        return self.driver.rate(place.s)

    def _settles(self, place: Place, steps: int = FALL_STEPS, farthest: float = FARTHEST_FALL) -> Proved | None:
        """The equilibrium in which a structure that falls comes to rest, where it does so soon and near."""
        model, start = self.model, place.pose
        for number, (sunk, motion, length) in enumerate(islice(self._sinking(place), steps), start=1):
            way = float(np.abs(sunk.pose.positions - start.positions).max())
            if way > farthest * model.length:
                return None
            # As slow as what creeps under a small part of its weight.
            fastest = float(np.abs(motion[model.assembly.free]).max(initial=0.0))
            speed = fastest * model.length / (length * self.lever)
            often = number & (number - 1) == 0 or number == steps or fastest < AT_REST
            if speed * DRAG > CREEPING or not often:
                continue
            found = self.proved(sunk)
            if self._holds(found):
                if way > JUMP * model.length:
                    self.notes.append(Note(sunk.s, self._jump(start, sunk.pose)))
                return found
            if fastest < AT_REST:
                return None
        return None

    def _sinking(self, place: Place) -> Iterator[tuple[Place, np.ndarray, float]]:
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
        """Work out the steps of :meth:`_sinking`; each moves blocks by a little."""
        length, largest = (part * self.model.length / self.lever for part in (MECHANISM * DRAG, 10.0))
        failures, grow = 0, 2.5
        while failures < FALL_FAILURES:
            try:
                new, motion = self.step(place, length, still=True)
            except (NotSolved, Falls):
                length, failures, grow = length / 3.0, failures + 1, SLOW_GROWTH
                continue
            moved_by = float(np.abs(motion[self.model.assembly.free]).max(initial=0.0))
            if moved_by > 2.0 * FALL_STEP:
                length, failures = length * FALL_STEP / moved_by, failures + 1
                continue
            place = new
            yield place, motion, length
            length = min(length * min(grow, max(FALL_STEP / max(moved_by, 1e-300), 0.5)), largest)

    def _collapse(
        self, last: Proved, without: Place, first_without: float, spent: float | None
    ) -> Generator[Increment, None, Ending]:
        driver, model = self.driver, self.model
        # What falls, falls under its dead load alone.
        alone = (
            self if model.live is None else Path(replace(model, live=None), driver, self.number, self.falling_frames)
        )
        frames = list(alone._fall(without))
        if not frames:
            frames = [self._falling(without, np.zeros_like(model.load), without.s)]
        # The first movement that is large against the give of the joints, and small enough to be one of velocities.
        sizes = [float(motion_size(frame.velocity, model.length).max()) for frame in frames]
        chosen = next((k for k, size in enumerate(sizes) if size > MECHANISM * model.length), int(np.argmax(sizes)))
        velocity, largest = frames[chosen].velocity, max(sizes[chosen], 1e-300)
        standing = self._reported(
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
            return Ending(Status.COLLAPSED, str(collapse), collapse)
        what = "equilibrium is lost" if spent is None else "no capacity is left"
        return Ending(Status.COLLAPSED, f"{what} at a control displacement of {collapse.displacement:.6g} m", collapse)

    def _fall(self, place: Place) -> Generator[Increment, None, None]:
        """Pseudo-time frames: what falls sinks against the drag until it rests."""
        frames, start, total = 0, place, np.zeros_like(self.model.load)
        for new, motion, length in islice(self._sinking(place), 4 * max(self.falling_frames, 4)):
            total = total + motion
            moved_by = float(np.abs(total).max())
            at_rest = length >= self.model.length and float(np.abs(motion).max()) < AT_REST
            if (frames == 0 and moved_by > MECHANISM) or moved_by > FALL_STEP or at_rest:
                yield self._falling(start, total * self.model.lengths, start.s)
                frames, start, total = frames + 1, new, np.zeros_like(total)
            if at_rest or frames >= max(self.falling_frames, 1):
                return

    # What is reported -----------------------------------------------------------------------------------------------

    def _increment(self, proved: Proved, velocity: np.ndarray) -> Increment:
        model, place, contacts = self.model, proved.place, proved.contacts
        resultant = (wrench_matrix(contacts, place.pose, model.length) @ proved.forces.ravel()).reshape(
            model.load.shape
        )
        live, live_size = model.scaled_live
        measured = proved.measured
        balance = (
            resultant + model.scaled_load + (proved.measured * live_size if model.live is not None else 0.0) * live
        )[model.assembly.free]
        gaps = contacts.gaps / model.length
        carried = np.where(gaps > COMPUTED_GAP, proved.forces[:, 0] * gaps, 0.0).sum()
        certificate = Certificate(
            equilibrium_residual=float(np.abs(balance).max(initial=0.0)) / model.total_load,
            largest_penetration=float(np.maximum(-contacts.gaps, 0.0).max(initial=0.0)),
            duality_gap=proved.bounds.gap,
            complementarity=float(carried),
            kinematic_violation=0.0,
            energy_residual=abs(self.works[0] - self.works[1] - self.works[2]) / max(sum(map(abs, self.works)), 1e-12),
        )
        on_supports = self._on_supports(contacts, place.pose, proved.forces)
        notes = tuple(f"at {note.s:.6g} {self.driver.unit}: {note.words}" for note in self.notes)
        self.notes = []
        return self._reported(
            place,
            contacts,
            proved.forces,
            proved.friction,
            velocity,
            measured,
            on_supports,
            certificate,
            Status.EQUILIBRIUM,
            notes,
            (proved.bounds.low, proved.bounds.high),
        )

    def _falling(self, place: Place, velocity: np.ndarray, s: float) -> Increment:
        model, assembly = self.model, self.model.assembly
        contacts = self._around(place.pose)
        friction = model.interfaces.friction(assembly, contacts.block_a, contacts.block_b)
        none = Certificate(0.0, float(np.maximum(-contacts.gaps, 0.0).max(initial=0.0)), 0.0, 0.0, 0.0)
        return self._reported(
            replace(place, s=s),
            contacts,
            self._remembered(place, contacts),
            friction,
            velocity,
            0.0,
            np.zeros_like(model.load),
            none,
            Status.FALLING,
            (),
        )

    def _reported(
        self,
        place: Place,
        contacts: Contacts,
        forces: np.ndarray,
        friction: np.ndarray,
        velocity: np.ndarray,
        measured: float,
        on_supports: np.ndarray,
        certificate: Certificate,
        status: Status,
        notes: tuple[str, ...],
        bounds: tuple[float, float] = (np.nan, np.nan),
    ) -> Increment:
        pushed = self.model.live is not None
        programs, self.programs = self.programs, 0
        return Increment(
            parameter=place.s,
            measured=measured,
            phase=self.number,
            load_multiplier=measured if pushed else 0.0,
            reaction=measured * self.model.live_force if pushed else measured,
            certificate=certificate,
            status=status,
            programs=programs,
            seconds=0.0,
            held=State(
                pose=place.pose,
                contacts=contacts,
                forces=forces * self.model.force,
                displacements=relative_velocities(contacts, place.pose, velocity),
                friction=friction,
                velocity=velocity,
                support_forces=on_supports,
            ),
            least=bounds[0],
            largest=bounds[1],
            notes=notes,
        )

    def _reached(self) -> Ending:
        driver = self.driver
        return Ending(Status.LIMIT_REACHED, f"the {driver.what} reached its limit of {driver.limit:g} {driver.unit}")

    def _locked(self, place: Place) -> str:
        assembly, contacts, normal = self.model.assembly, place.contacts, place.forces[:, 0]
        assert contacts is not None
        pressed = normal > 0.1 * normal.max()
        blocks = np.unique(np.concatenate([contacts.block_a[pressed], contacts.block_b[pressed]]))
        blocks = blocks[assembly.free[blocks]]
        return f"the supports cannot move on: {len(blocks)} blocks are wedged ({self._named(blocks)})"

    def _no_equilibrium(self, motion: np.ndarray) -> str:
        assembly = self.model.assembly
        size = np.abs(motion[:, : self.model.dimension]).max(axis=1)
        falling = np.flatnonzero(assembly.free & (size > 0.5 * size.max()))
        shown = ", ".join(f"'{assembly.names[i]}'" for i in falling[:8])
        more = f" and {len(falling) - 8} more" if len(falling) > 8 else ""
        return (
            f"no equilibrium before any settlement: {len(falling)} of {int(assembly.free.sum())} blocks fall "
            f"({shown}{more}); look for gaps between blocks (joint_thickness), a missing support or too little friction"
        )

    def _no_step(self, reason: str) -> str:
        return (
            f"no step of the {self.driver.what} was solved, however small, {reason}; repeat the analysis with another "
            "increment, and send the case to the developers if it stays"
        )

    def _jump(self, start: Pose, end: Pose) -> str:
        assembly = self.model.assembly
        far = np.linalg.norm(moved_vertices(assembly, end) - moved_vertices(assembly, start), axis=1)
        way = np.zeros(assembly.n_blocks)
        np.maximum.at(way, assembly.block_of_vertex, np.where(assembly.free[assembly.block_of_vertex], far, 0.0))
        fell = np.flatnonzero(way > 0.1 * way.max())
        return f"{self._named(fell)} moved by up to {way.max():.2g} m at once to the next equilibrium"

    def _named(self, blocks: np.ndarray) -> str:
        shown = ", ".join(f"'{self.model.assembly.names[i]}'" for i in blocks[:NAMED])
        more = f" and {len(blocks) - NAMED} more" if len(blocks) > NAMED else ""
        return f"block{'' if len(blocks) == 1 else 's'} {shown}{more}"
