"""Bounds of equilibrium within friction at a pose: whether there is one, and of its reaction or multiplier."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from solver.equilibrium import wrench_matrix
from solver.geometry.contacts import Contacts
from solver.kinematics import Pose
from solver.programs.problem import LinearProgram, Solution, SolveError, Unbounded
from solver.programs.solve import CONIC_ROUTES, solve_between, solve_lp
from solver.tolerances import ACCEPTED_ERROR, BALANCE_TOLERANCE, FALLING_FRACTION

from .model import Model
from .non_associative import NonAssociative
from .strength import Admissible, ForceLimits


@dataclass(frozen=True)
class EquilibriumBounds:
    """Bounds over all forces in equilibrium within friction at a pose.

    Of the reaction [N or N·m], or of the live loads' multiplier; infinite where friction bounds neither; one whose
    program was not solved is not a number. Without an equilibrium both are the value of the forces.

    Forces (n_contacts, d), in units of the program, are those of the least reaction or largest multiplier; of another
    equilibrium where that has no bound or was not found; nearest to one where none exists.
    """

    unbalanced: float  #: least sum of unbalanced forces over the total load: zero where an equilibrium exists
    low: float
    high: float
    gap: float  #: largest relative difference of the two objectives of the programs
    forces: np.ndarray
    other_forces: np.ndarray | None = None  #: of the other bound, where there is one

    @property
    def in_equilibrium(self) -> bool:
        """Whether an equilibrium within friction exists."""
        return self.unbalanced <= FALLING_FRACTION


class StaticProgram:
    """The program over the forces of closed contact points, (n_contacts,) bool array, at a pose.

    It bounds the multiplier of a live load, or the reaction along a rate of the supports, (n_blocks, n_dof) array. What
    solves it raises ``SolveError``.
    """

    def __init__(
        self,
        model: Model,
        pose: Pose,
        contacts: Contacts,
        friction: np.ndarray,
        rate: np.ndarray | None,
        closed: np.ndarray,
        limits: ForceLimits,
    ) -> None:
        d, blocks = model.dimension, model.assembly.free
        free = np.repeat(blocks, model.n_dof)
        self.closed, contacts, friction = closed, contacts[closed], friction[closed]
        least, most, cohesion = (of[closed] for of in (limits.least, limits.most, limits.cohesion))
        matrix = sp.csr_array(wrench_matrix(contacts, pose, model.length))
        on_free = matrix[free]
        carried = Admissible.of(friction, cohesion, np.full(len(contacts), np.inf), d)
        self.rays = carried.columns
        balance = sp.csc_array(on_free @ self.rays)
        self.rows, self.n = balance.shape
        self.d, self.friction, self.total, self.programs = d, carried.friction, model.total_load, 0
        # The programs are those of the normal forces beyond the least ones.
        self.least = np.zeros((len(contacts), d))
        self.least[:, 0] = least
        given = matrix @ self.least.ravel()
        self.load = model.scaled_load_at(pose).ravel()[free] + given[free]
        self.tolerance = BALANCE_TOLERANCE * model.total_load
        live, self.live_size = model.scaled_live(pose)
        loads, points = (
            (self.load, live[blocks].ravel()),
            (friction, cohesion, most - least, -least, np.zeros(len(least))),
        )
        self.non_associative = NonAssociative(contacts, pose, on_free, *loads, *points, self.total, d)
        columns, objective = [balance], np.zeros(self.n)
        if self.live_size > 0.0:
            column = sp.csc_array(live[blocks].reshape(-1, 1))
            columns += [column, -column]
            objective = np.append(objective, [1.0, -1.0])
            self.unit, self.constant = 1.0 / self.live_size, 0.0
        else:
            along = np.zeros(len(free)) if rate is None else (rate / model.lengths).ravel()
            # Relative to the speed of the supports, as the check of a solution is absolute.
            speed = float(np.abs(along).max(initial=0.0)) or 1.0
            along = np.where(free, 0.0, along / speed)
            objective = self.rays.T @ (matrix.T @ along)
            self.unit, self.constant = model.force * model.length * speed, float(along @ given)
        self.objective, self.matrix = objective, sp.hstack(columns, format="csc")
        self.places = np.repeat(pose.positions[blocks], model.n_dof, axis=0)
        limited = np.flatnonzero(np.isfinite(most))
        self.reserve = np.append((most - least)[limited], carried.most)
        if len(self.reserve):
            limits_of = sp.vstack([sp.csr_array(self.rays)[d * limited], carried.limits], format="csc")
            limits_of.resize(len(self.reserve), len(objective))
            self.matrix = sp.csc_array(sp.vstack([self.matrix, limits_of], format="csc"))
            # Places are of programs in the plane, where cohesion has a row for either sign.
            sticky = np.repeat(contacts.points[cohesion > 0.0], 2, axis=0)
            self.places = np.vstack([self.places, contacts.points[limited], sticky])

    def in_equilibrium(self, least: float = 0.0) -> bool:
        """Whether an equilibrium within friction exists, with more than so much of a live load, in block weights."""
        balanced, unbalanced = self.most_balanced()
        if unbalanced > FALLING_FRACTION or self.live_size == 0.0:
            return unbalanced <= FALLING_FRACTION
        most = self.bound(-1.0, balanced)
        return most is None or self.value(most) * self.live_size > least

    def bounds(self) -> EquilibriumBounds:
        """Bound the reaction or the multiplier of all equilibria within friction.

        Linear programs over the multipliers of the friction cones' rays, in space conic programs over the forces in
        round cones: the least sum of unbalanced forces; where that is none, the least and the largest reaction (or
        multiplier). The least is that of Portioli & Cascini (2017) at this geometry.
        """
        balanced, unbalanced = self.most_balanced()
        if unbalanced > FALLING_FRACTION:
            value = self.value(balanced)
            return EquilibriumBounds(unbalanced, value, value, balanced.gap, self.forces(balanced))
        values, found = {}, []
        for sign in (1.0, -1.0) if self.live_size == 0.0 else (-1.0, 1.0):
            values[sign] = np.nan
            try:
                solution = self.bound(sign, balanced)
            except SolveError:
                # A bound may stay unknown, except that of a pushover.
                if sign < 0.0 < self.live_size:
                    raise
                continue
            values[sign] = -sign * np.inf if solution is None else self.value(solution)
            found += [] if solution is None else [solution]
        # Where blocks are wedged neither bound is finite.
        forces = [self.forces(solution) for solution in found or [balanced]]
        gap = max(solution.gap for solution in (balanced, *found))
        return EquilibriumBounds(unbalanced, values[1.0], values[-1.0], gap, *forces)

    def bound(self, sign: float, balanced: Solution) -> Solution | None:
        """Least or, by sign, largest value in equilibrium; None without a bound.

        The rounding that leaves the balanced solution out of balance may do so here.
        """
        try:
            missing, beyond = self._imbalance(balanced)
            return self._solve(sign * self.objective, self.matrix, missing - beyond, CONIC_ROUTES)
        except Unbounded:
            return None

    def most_balanced(self) -> tuple[Solution, float]:
        """Find forces of least imbalance, and their unbalanced forces over the total load, 0 where that is rounding."""
        unit = sp.eye_array(self.matrix.shape[0], self.rows)
        matrix = sp.hstack([self.matrix, unit, -unit], format="csc")
        cost = np.append(np.zeros(self.matrix.shape[1]), np.ones(2 * self.rows))
        try:
            solution = self._solve(cost, matrix, np.zeros(self.rows), (*CONIC_ROUTES[1::-1], *CONIC_ROUTES[2:]))
        except SolveError as error:
            best = error.best
            if best is None:
                raise
            if best.violation <= ACCEPTED_ERROR and self._unbalanced(best) <= ACCEPTED_ERROR:
                return best, 0.0
            # The dual objective bounds the forces out of balance from below, but for its violation along the forces.
            doubt = best.dual_violation * (1.0 + float(np.abs(best.row_dual).max())) * float(np.abs(best.x).sum())
            if best.dual_objective <= 2.0 * best.gap + doubt:
                raise
            solution = best
        return solution, self._unbalanced(solution)

    def _solve(
        self, cost: np.ndarray, matrix: sp.csc_array, imbalance: np.ndarray, routes: tuple[str, ...]
    ) -> Solution:
        self.programs += 1
        right, none = -self.load - imbalance, np.zeros_like(self.reserve)
        if self.d == 3:
            lower, upper = np.append(right, none), np.append(right, self.reserve)
            return solve_between(cost, matrix, lower, upper, self.friction, 3, routes)
        lower, upper = np.append(right - self.tolerance, none), np.append(right + self.tolerance, self.reserve)
        return solve_lp(LinearProgram(cost=cost, matrix=matrix, lower=lower, upper=upper, places=self.places))

    def _imbalance(self, balanced: Solution) -> np.ndarray:
        """(2, n_rows) array: unbalanced forces of either sense of a solution of least imbalance."""
        return balanced.x[self.matrix.shape[1] :][: 2 * self.rows].reshape(2, -1)

    def _unbalanced(self, balanced: Solution) -> float:
        """Sum of the unbalanced forces of a solution of least imbalance, over the total load."""
        return float(self._imbalance(balanced).sum()) / self.total

    def value(self, solution: Solution) -> float:
        """Reaction [N or N·m] or multiplier of a solution."""
        return (float(self.objective @ solution.x[: len(self.objective)]) + self.constant) * self.unit

    def forces(self, solution: Solution) -> np.ndarray:
        """(n_contacts, d) array: contact forces of a solution, in units of the program."""
        forces = np.zeros((len(self.closed), self.d))
        forces[self.closed] = (self.rays @ solution.x[: self.n]).reshape(-1, self.d) + self.least
        return forces
