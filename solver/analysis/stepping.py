"""One step of a path: from one place to another."""

from __future__ import annotations

import numpy as np

from solver.assembly import find_contacts, measure_contacts
from solver.equilibrium import wrench_matrix
from solver.geometry.contacts import Contacts, matched_contacts
from solver.kinematics import Pose, moved, moved_vertices
from solver.program.coulomb import solve_step
from solver.program.model import Model
from solver.program.step import NotSolved, Step
from solver.tolerances import DRAG, FARTHEST_FALL, GIVE, GIVE_ACROSS, IMPERFECTION, MEMORY

from .drivers import Driver
from .place import Falls, Place, Pressed

#: Geometries at which a step is linearised; movement from one to the next, in block sizes, at which it is exact, and
#: from which on it is not accepted: its square is what is left of gaps. What falls need not be exact.
LINEARISATIONS, EXACT, ACCEPTED = 6, 1e-6, 1e-4

#: The structure falls where a block moves so many times as fast as the drag alone would let it sink under this part of
#: its weight.
FALLING_FORCE = 1.0

#: Part of the drag, and of the imperfection, that is left where a collapse is being enclosed.
CARE = 1e-3

#: Part of the give of the joints that is left there, where forces grow without limit before a snap.
STIFF = 1e-3

#: Penetration that a step may leave, in block sizes, where forces grow fast.
PRESSED = 1e-5

#: A corner that carries this force, in block weights, may slip past the end of its edge, or come into another block
#: from the side, in steps of the supports, and of blocks, no larger than this, in block sizes, or in smaller ones where
#: less drag holds it; what falls, in steps whose drag is that of the second.
SLIPPED_OFF_FORCE, SLIP_OFF, SHORTEST_FALL = 1e-3, 1e-4, 1e-6

#: Contact points of two blocks no farther apart than this, in block sizes, are one, by whichever corner and edge.
SAME_PLACE = 1e-2

#: Growth of the steps: as a structure begins to move, forces are handed on within the give of the joints. Where steps
#: double, reactions of the cross vault in ``examples`` come out 2.5 % smaller than in these and in shorter ones.
GROWTH = 1.25

#: Movement from which a mechanism is read, in block sizes: large against the give of the joints, small enough for
#: rotations to be velocities.
MECHANISM = 1e-3


def drag_of(model: Model) -> np.ndarray:
    """(n_blocks, n_dof) array: weights, and weights times a radius of gyration squared, in units of the program."""
    assembly, d = model.assembly, model.dimension
    weight = np.linalg.norm(model.load[:, :d], axis=1) / model.force
    weight = np.maximum(weight, 1e-3 * assembly.masses / max(float(assembly.masses[assembly.free].mean()), 1e-300))
    turning = weight * assembly.shapes.gyration / model.length**2
    return np.column_stack([weight] * d + [turning] * (len(model.lengths) - d))


class Steps:
    """Steps from one place to another under a driver.

    Parameters
    ----------
    model : Model
        Units, loads, interfaces.
    driver : Driver

    Attributes
    ----------
    programs : int
        Solved since the last increment.
    careful_until : float [m or rad]
        Parameter up to which a collapse is being enclosed.
    """

    def __init__(self, model: Model, driver: Driver) -> None:
        self.model, self.driver = model, driver
        self.drag = drag_of(model)
        self.lever = driver.lever()
        self.programs, self.care, self.careful_until = 0, 1.0, -np.inf
        self.seen: tuple[Pose, Contacts] | None = None
        rate = driver.rate(0.0)
        d = model.dimension
        sideways = rate[model.assembly.moving, :d].sum(axis=0)
        size = float(np.linalg.norm(sideways))
        self.imperfection = np.zeros_like(model.load)
        if size > 0.0:
            self.imperfection[:, :d] = IMPERFECTION * self.drag[:, :1] * sideways / size

    def at_start(self, pose: Pose) -> Place:
        """The place of a pose that remembers no forces."""
        return Place(0.0, pose, None, np.zeros((0, self.model.dimension)))

    def remembered(self, place: Place, contacts: Contacts) -> np.ndarray:
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
        start = self.around(place.pose)
        memory = self.remembered(place, start)
        normal, shear = memory[:, 0], memory[:, 1:]
        friction = model.interfaces.friction(assembly, start.block_a, start.block_b)
        n_dof = len(scales)
        rows = np.repeat(free, n_dof)
        load = (model.scaled_load + self.care * self.imperfection)[free].ravel()
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
        if size > self.care * (SHORTEST_FALL if still else SLIP_OFF) and np.abs(gone).max(initial=0.0) > SLIP_OFF:
            self._refuse_beyond(contacts, normal, pose)
        forces = np.column_stack([normal, shear])
        velocity = None if still else self._velocity(place, motion, length)
        return (
            Place(s, pose, contacts, forces, multiplier / (live_size or 1.0), velocity),
            motion / scales,
        )

    def careful_step(self, place: Place, length: float) -> tuple[Place, np.ndarray]:
        """Take a step with less drag and stiffer joints, or an ordinary one where that is not solved."""
        self.care = CARE
        try:
            return self.step(place, length)
        except NotSolved:
            self.care = 1.0
            return self.step(place, length)
        finally:
            self.care = 1.0

    def _velocity(self, place: Place, motion: np.ndarray, length: float) -> np.ndarray:
        """(n_blocks, n_dof) array: velocity after a step, in it and in those before."""
        before = np.zeros_like(motion) if place.velocity is None else place.velocity
        return before + (motion - length * before) / (length + MEMORY * self.model.length / self.lever)

    def around(self, pose: Pose) -> Contacts:
        """The contact points at a pose; those at the last one asked for are remembered."""
        if self.seen is None or self.seen[0] is not pose:
            model = self.model
            self.seen = pose, find_contacts(model.assembly, moved_vertices(model.assembly, pose), model.reach)
        return self.seen[1]

    def _refuse_beyond(self, contacts: Contacts, normal: np.ndarray, pose: Pose) -> None:
        """Refuse a step at whose end a corner stands on no edge any more, or in a block that it did not see before.

        Raises
        ------
        NotSolved
        """
        length, end = self.model.length, self.around(pose)
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
