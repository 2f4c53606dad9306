"""Equilibrium within friction at the places of a path."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace

import numpy as np

from solver.contact_step.balance import nearest_equilibrium
from solver.contact_step.problem import NotSolved
from solver.contact_step.stiffness import ContactRows
from solver.equilibrium import block_forces, wrench_matrix
from solver.geometry.contacts import Contacts
from solver.kinematics import Pose
from solver.program.model import Model
from solver.program.static_program import EquilibriumBounds, StaticProgram
from solver.programs.problem import SolveError
from solver.tolerances import COMPUTED_GAP, SMALLEST_RATE

from .state import EquilibriumCheck, Place
from .stepping import CARRIES, Stepper


def on_supports(model: Model, contacts: Contacts, pose: Pose, forces: np.ndarray) -> np.ndarray:
    """(n_blocks, n_dof) array [N, N, N·m]: what the structure does to each support; zero for free blocks."""
    resultant = block_forces(contacts, pose, forces) * model.force
    return np.where(model.assembly.free[:, None], 0.0, resultant)


class EquilibriumChecks:
    """Equilibrium within exact Coulomb friction, without viscosity, at the places of a path."""

    def __init__(self, stepper: Stepper) -> None:
        self.stepper, self.model, self.driver = stepper, stepper.model, stepper.driver

    def in_equilibrium(self, place: Place, gap: float = COMPUTED_GAP, part: float = 0.0) -> bool:
        """Whether points with gaps up to this one [block sizes] hold a place with some, or a part, of its live load."""
        program = self._program(place, gap)
        found = program.in_equilibrium(max(part * place.multiplier * program.live_size - CARRIES, 0.0))
        self.stepper.programs += program.programs
        return found

    def is_within_friction(self, place: Place) -> bool:
        """Whether the forces of a place are within friction and cohesion, as they are where blocks only turn."""
        contacts, normal = place.contacts, place.forces[:, 0]
        assert contacts is not None
        _, least, cohesion = self.stepper.joint_limits(place, contacts)
        allowed = self.stepper.friction(contacts) * (normal - least) + cohesion
        return bool((np.linalg.norm(place.forces[:, 1:], axis=1) < allowed + CARRIES).all())

    def nearest(self, place: Place, gap: float, reaction: float | None = None, at_rest: bool = False) -> np.ndarray:
        """(n_contacts, d) array: forces in equilibrium nearest to those of a place, in units of the program.

        With a reaction [N or N·m] those that have it; ``at_rest`` those of least elastic energy. Raises ``NotSolved``.
        """
        model, free = self.model, self.stepper.free
        every, friction = self._contacts_at(place)
        closed, limits = self.stepper.force_limits(place, every, gap)
        matrix = wrench_matrix(every[closed], place.pose, model.length)
        live, live_size = model.scaled_live(place.pose)
        load = (model.scaled_load_at(place.pose) + place.multiplier * live_size * live)[free].ravel()
        forces = np.zeros_like(every.points)
        reference = (forces if at_rest else self.stepper.transferred(place, every)[0])[closed]
        # The program is that of the normal forces beyond the least ones.
        base = np.zeros_like(reference)
        base[:, 0] = limits.least[closed]
        rows = ContactRows(matrix, free, model.assembly.centroids)
        unit_reaction, beyond = None, 0.0
        if reaction is not None:
            # Of unit forces, where the fastest support moves.
            rate = np.where(free[:, None], 0.0, self.driver.rate(place.s)) / model.lengths * model.length
            unit_reaction = (matrix.T @ rate.ravel()).reshape(base.shape) / self.driver.lever
            beyond = reaction / (model.force * self.driver.lever) - float((unit_reaction * base).sum())
        self.stepper.programs += 1
        forces[closed] = base + nearest_equilibrium(
            rows,
            reference - base,
            self.stepper.compliance(every, self.stepper.mortar.points(place, every))[closed],
            friction[closed],
            (limits.most - limits.least)[closed],
            limits.cohesion[closed],
            load + rows.resultant(base),
            unit_reaction,
            beyond,
        )
        return forces

    def check(self, place: Place, reaction: float, gap: float = COMPUTED_GAP) -> EquilibriumCheck:
        """Bounds at a place, and forces in equilibrium with the path's reaction [N or N·m], or its multiplier."""
        contacts, friction = self._contacts_at(place)
        bounds = self.bounds(place, gap)
        target = reaction if not self.model.has_live else place.multiplier
        if not bounds.in_equilibrium:
            # The forces of the program that comes nearest to equilibrium.
            nearest = bounds.high if self.model.has_live else self.reaction(place, contacts, bounds.forces)
            return EquilibriumCheck(place, contacts, friction, bounds.forces, nearest, bounds)
        low, high = (value if np.isfinite(value) else target for value in (bounds.low, bounds.high))
        measured = float(np.clip(target, low, max(low, high)))
        if not self.model.has_live and self.model.interfaces.ground:
            # Ground that gives has forces by its pose; the reaction of the path has the viscosity in it.
            with suppress(NotSolved):
                forces = self.nearest(place, gap)
                measured = float(np.clip(self.reaction(place, contacts, forces), low, max(low, high)))
                return EquilibriumCheck(place, contacts, friction, forces, measured, bounds)
        determined = self.model.has_live or bounds.high - bounds.low <= 1e-6 * max(abs(low), abs(high))
        try:
            forces = self.nearest(replace(place, multiplier=measured), gap, None if determined else measured)
        except NotSolved:
            forces = self._between_bounds(contacts, place, bounds, measured)
        return EquilibriumCheck(place, contacts, friction, forces, measured, bounds)

    def _between_bounds(
        self, contacts: Contacts, place: Place, bounds: EquilibriumBounds, measured: float
    ) -> np.ndarray:
        """(n_contacts, d) array: a mean of the forces of the two bounds, which is in equilibrium, too."""
        if bounds.other_forces is None:
            return bounds.forces
        if not self.model.has_live:
            of_forces, of_other = (self.reaction(place, contacts, f) for f in (bounds.forces, bounds.other_forces))
        else:
            of_forces, of_other = bounds.high, bounds.low
        part = (
            0.0 if of_forces == of_other else float(np.clip((measured - of_forces) / (of_other - of_forces), 0.0, 1.0))
        )
        return (1.0 - part) * bounds.forces + part * bounds.other_forces

    def reaction(self, place: Place, contacts: Contacts, forces: np.ndarray) -> float:
        """Reaction of forces in units of the program [N or N·m]."""
        return float((on_supports(self.model, contacts, place.pose, forces) * self.driver.rate(place.s)).sum())

    def bounds(self, place: Place, gap: float = COMPUTED_GAP) -> EquilibriumBounds:
        """Bounds of the reaction or multiplier in equilibrium at a place."""
        rate = None if self.model.has_live else self.driver.rate(place.s)
        program = self._program(place, gap, rate)
        bounds = program.bounds()
        self.stepper.programs += program.programs
        return bounds

    def limit_multiplier(self, place: Place) -> tuple[float, bool]:
        """Multiplier of the limit load without dilatancy at a place at rest, and whether its sequence has converged.

        Infinite where no program of it was solved.
        """
        program = self._program(place, COMPUTED_GAP)
        flow, multiplier = program.non_associative, place.multiplier * program.live_size
        forces = self.stepper.transferred(place, self._contacts_at(place)[0])[0][program.closed] - program.least
        try:
            # Where friction with dilatancy has no limit the path does not begin.
            limit, converged, programs = flow.limit(forces[:, 0], (forces, multiplier), lambda: None)
        except SolveError:
            return np.inf, False
        self.stepper.programs += programs
        return limit.multiplier / program.live_size, converged

    def moves_control(self, place: Place) -> bool:
        """Whether the control displacement grows in the mechanism of the largest multiplier at a place."""
        program, control = self._program(place, COMPUTED_GAP), self.driver.control(place.pose)
        most = program.bound(-1.0, program.most_balanced()[0])
        if most is None or control is None:
            return False
        motion = -most.row_dual[: program.rows]
        grows = float(motion @ (control * self.model.lengths / self.model.length)[self.stepper.free].ravel())
        return grows > SMALLEST_RATE * float(np.abs(motion).max())

    def _program(self, place: Place, gap: float, rate: np.ndarray | None = None) -> StaticProgram:
        contacts, friction = self._contacts_at(place)
        closed, limits = self.stepper.force_limits(place, contacts, gap)
        return StaticProgram(self.model, place.pose, contacts, friction, rate, closed, limits)

    def _contacts_at(self, place: Place) -> tuple[Contacts, np.ndarray]:
        contacts = self.stepper.contacts_at(place)
        return contacts, self.stepper.friction(contacts)
