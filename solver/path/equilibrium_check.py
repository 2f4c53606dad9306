"""Equilibrium within friction at the places of a path."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace

import numpy as np

from solver.contact_step.problem import NotSolved
from solver.equilibrium import block_forces
from solver.geometry.contacts import Contacts
from solver.kinematics import Pose
from solver.program.model import Model
from solver.program.non_associative import non_associative_limit
from solver.program.static_program import EquilibriumBounds, ProgramState, StaticProgram
from solver.programs.problem import SolveError, Unbounded
from solver.tolerances import COMPUTED_GAP, FALLING_FRACTION, SMALLEST_RATE

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
        standing = self.stepper.standing(place)
        if standing is None:
            return False
        program, _ = self._program(standing, gap)
        self.stepper.programs += 1
        balanced, unbalanced = program.most_balanced()
        if unbalanced > FALLING_FRACTION or not program.senses:
            return unbalanced <= FALLING_FRACTION
        self.stepper.programs += 1
        try:
            most = program.bound(-1.0, balanced).multiplier
        except Unbounded:
            return True
        return most > max(part * place.multiplier / program.unit - CARRIES, 0.0)

    def nearest(self, place: Place, gap: float, reaction: float | None = None, at_rest: bool = False) -> np.ndarray:
        """(n_contacts, d) array: forces in equilibrium nearest to those of a place, in units of the program.

        With a reaction [N or N·m] those that have it; ``at_rest`` those of least elastic energy. Raises ``NotSolved``.
        """
        every = self.stepper.contacts_at(place)
        program, closed = self._program(place, gap, None if reaction is None else self.driver.rate(place.s))
        forces = np.zeros_like(every.points)
        reference = forces if at_rest else self.stepper.transferred(place, every)[0]
        compliance = self.stepper.compliance(every, self.stepper.mortar.points(place, every))
        self.stepper.programs += 1
        given = reference[closed], compliance[closed], place.multiplier / program.unit
        forces[closed] = program.nearest(*given, reaction)
        return forces

    def check(
        self, place: Place, reaction: float, gap: float = COMPUTED_GAP, known: EquilibriumBounds | None = None
    ) -> EquilibriumCheck:
        """Bounds at a place, unless known, and forces in equilibrium with the path's reaction, or its multiplier."""
        contacts = self.stepper.contacts_at(place)
        bounds = known or self.bounds(place, gap)
        target = reaction if not self.model.has_live else place.multiplier
        if not bounds.in_equilibrium:
            # The forces of the program that comes nearest to equilibrium.
            return EquilibriumCheck(place, contacts, bounds.forces[0], bounds.high, bounds)
        low, high = (value if np.isfinite(value) else target for value in (bounds.low, bounds.high))
        measured = float(np.clip(target, low, max(low, high)))
        if not self.model.has_live and self.model.interfaces.ground:
            # Ground that gives has forces by its pose; the reaction of the path has the viscosity in it.
            with suppress(NotSolved):
                forces = self.nearest(place, gap)
                measured = float(np.clip(self.reaction(place, contacts, forces), low, max(low, high)))
                return EquilibriumCheck(place, contacts, forces, measured, bounds)
        determined = self.model.has_live or not bounds.high - bounds.low > 1e-6 * max(abs(low), abs(high))
        try:
            forces = self.nearest(replace(place, multiplier=measured), gap, None if determined else measured)
        except NotSolved:
            # A mean of the forces of both bounds is in equilibrium, too.
            part = float(np.interp(measured, (low, max(low, high)), (0.0, 1.0)))
            forces = (1.0 - part) * bounds.forces[0] + part * bounds.forces[-1]
        return EquilibriumCheck(place, contacts, forces, measured, bounds)

    def reaction(self, place: Place, contacts: Contacts, forces: np.ndarray) -> float:
        """Reaction of forces in units of the program [N or N·m]."""
        return float((on_supports(self.model, contacts, place.pose, forces) * self.driver.rate(place.s)).sum())

    def bounds(self, place: Place, gap: float = COMPUTED_GAP) -> EquilibriumBounds:
        """Bounds of the reaction or multiplier in equilibrium at a place."""
        rate = None if self.model.has_live else self.driver.rate(place.s)
        program, closed = self._program(place, gap, rate)
        bounds = program.bounds()
        self.stepper.programs += program.programs
        forces = np.zeros((len(bounds.forces), *closed.shape, self.model.dimension))
        forces[:, closed] = bounds.forces
        return replace(bounds, forces=forces)

    def limit_multiplier(self, place: Place) -> float | None:
        """Multiplier of the limit load without dilatancy at a place at rest; None where its sequence has not converged.

        Where friction with dilatancy has no limit the path does not begin.
        """
        program, closed = self._program(place, COMPUTED_GAP)
        forces = self.stepper.transferred(place, self.stepper.contacts_at(place))[0][closed] - program.least
        resting = ProgramState(forces, place.multiplier / program.unit, np.zeros_like(program.dead), 0.0)
        try:
            limit, converged = non_associative_limit(program, forces[:, 0], resting, bounded=True)
        except SolveError:
            return None
        self.stepper.programs += program.programs
        return limit.multiplier * program.unit if converged else None

    def moves_control(self, place: Place) -> bool:
        """Whether the control displacement grows in the mechanism of the largest multiplier at a place."""
        (program, _), control = self._program(place, COMPUTED_GAP), self.driver.control(place.pose)
        try:
            motion = program.bound(-1.0, program.most_balanced()[0]).velocity
        except Unbounded:
            return False
        grows = float(motion @ (control * self.model.lengths / self.model.length)[self.stepper.free].ravel())
        return grows > SMALLEST_RATE * float(np.abs(motion).max())

    def _program(self, place: Place, gap: float, rate: np.ndarray | None = None) -> tuple[StaticProgram, np.ndarray]:
        """The program over the contact points that may carry, and which these are, (n_contacts,) bool array."""
        contacts = self.stepper.contacts_at(place)
        closed, limits = self.stepper.force_limits(place, contacts, gap)
        points = contacts[closed], self.stepper.friction(contacts)[closed], limits[closed], np.zeros(closed.sum())
        senses = (1.0, -1.0) if self.model.has_live else ()
        return StaticProgram(self.model, place.pose, *points, senses=senses, rate=rate), closed
