"""Bounds of equilibrium within friction at a pose: whether there is one, and of its reaction or multiplier."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from solver.equilibrium import friction_rays, with_slack, wrench_matrix
from solver.geometry.contacts import Contacts
from solver.kinematics import Pose
from solver.programs.problem import LinearProgram, Solution, SolveError, Unbounded
from solver.programs.solve import CONIC_ROUTES, solve_between, solve_lp
from solver.tolerances import ACCEPTED_ERROR, BALANCE_TOLERANCE, FALLING_FRACTION

from .model import Model
from .strength import Admissible, ForceLimits

#: Cost of unbalanced force, against that of the reaction: above the speed of any block per speed of the supports.
UNBALANCED_COST = 1e4


@dataclass(frozen=True)
class EquilibriumBounds:
    """Bounds over all forces in equilibrium within friction at a pose.

    Attributes
    ----------
    unbalanced : float
        Least sum of unbalanced forces over the total load: zero where an equilibrium exists.
    low, high : float
        Of the reaction [N or N·m], or of the live loads' multiplier; infinite where friction bounds neither; one
        whose program was not solved is not a number.
    gap : float
        Largest relative difference of the two objectives of the programs.
    programs : int
    forces : (n_contacts, d) array
        Normal and shear forces of the least reaction or largest multiplier, in units of the program; of another
        equilibrium where that has no bound or was not found.
    other_forces : (n_contacts, d) array, optional
        Those of the other bound, where there is one.
    """

    unbalanced: float
    low: float
    high: float
    gap: float
    programs: int
    forces: np.ndarray
    other_forces: np.ndarray | None = None

    @property
    def in_equilibrium(self) -> bool:
        """Whether an equilibrium within friction exists."""
        return self.unbalanced <= FALLING_FRACTION


class StaticProgram:
    """The program over all contact forces at a pose.

    Parameters
    ----------
    model : Model
        Where it has a live load, its multiplier is bounded.
    pose : Pose
    contacts : Contacts
        At the pose; open ones carry no force.
    friction : (n_contacts,) array
    rate : (n_blocks, n_dof) array, optional
        Movement of the supports along which the reaction is bounded.
    gap : float
        Largest one of a contact point that carries force, in block sizes.
    limits : ForceLimits
    """

    def __init__(
        self,
        model: Model,
        pose: Pose,
        contacts: Contacts,
        friction: np.ndarray,
        rate: np.ndarray | None,
        gap: float,
        limits: ForceLimits,
    ) -> None:
        d, blocks = model.dimension, model.assembly.free
        free = np.repeat(blocks, model.n_dof)
        least, most = limits.least, limits.most
        closed = np.flatnonzero((contacts.gaps <= gap * model.length) | limits.hold)
        matrix = sp.csr_array(wrench_matrix(contacts, pose, model.length))
        # In the plane the two rays of a cone are its forces; in space its three numbers are.
        forces_of = friction_rays(friction) if d == 2 else sp.eye_array(3 * len(contacts), format="csc")
        of_closed = np.repeat(d * closed, d) + np.tile(np.arange(d), len(closed))
        self.rays = forces_of[:, of_closed]
        bonded = limits.cohesion[closed] > 0.0
        if bonded.any():
            carried = Admissible.of(friction[closed], limits.cohesion[closed], np.full(len(closed), np.inf), d)
            everywhere = sp.eye_array(d * len(contacts), format="csc")[:, of_closed]
            self.rays = sp.csc_array(everywhere @ carried.columns)
        balance = sp.csc_array(matrix[free] @ self.rays)
        self.rows, self.n = balance.shape
        slopes = np.append(friction[closed], np.ones(int(bonded.sum())))
        self.d, self.friction, self.total, self.programs = d, slopes, model.total_load, 0
        # The programs are those of the normal forces beyond the least ones.
        self.least = np.zeros((len(contacts), d))
        self.least[closed, 0] = least[closed]
        given = matrix @ self.least.ravel()
        self.load = model.scaled_load_at(pose).ravel()[free] + given[free]
        self.tolerance = BALANCE_TOLERANCE * model.total_load
        live, self.live_size = model.scaled_live
        columns, objective = [balance], np.zeros(self.n)
        if self.live_size > 0.0:
            column = sp.csc_array(live[blocks].reshape(-1, 1))
            columns += [column, -column]
            objective = np.concatenate([objective, np.zeros(2 * self.rows), [1.0, -1.0]])
            self.unit, self.constant = 1.0 / self.live_size, 0.0
        else:
            along = np.zeros(len(free)) if rate is None else (rate / model.lengths).ravel()
            # Relative to the speed of the supports, as the cost of forces out of balance is.
            speed = float(np.abs(along).max(initial=0.0)) or 1.0
            along = np.where(free, 0.0, along / speed)
            objective = np.concatenate([self.rays.T @ (matrix.T @ along), np.zeros(2 * self.rows)])
            self.unit, self.constant = model.force * model.length * speed, float(along @ given)
        self.objective, self.matrix = objective, with_slack(*columns)
        self.places = np.repeat(pose.positions[blocks], model.n_dof, axis=0)
        limited = np.flatnonzero(np.isfinite(most))
        self.reserve = (most - least)[limited]
        if len(limited) or bonded.any():
            normal, places = sp.csc_array(sp.csr_array(self.rays)[d * limited]), contacts.points[limited]
            if bonded.any():
                normal = sp.vstack([normal, carried.limits], format="csc")
                self.reserve = np.append(self.reserve, carried.most)
                of_each = len(carried.most) // int(bonded.sum())
                places = np.vstack([places, np.repeat(contacts.points[closed[bonded]], of_each, axis=0)])
            beside = sp.csc_array((len(self.reserve), len(objective) - self.n))
            limits_of = sp.hstack([normal, beside])
            self.matrix = sp.csc_array(sp.vstack([self.matrix, limits_of], format="csc"))
            self.places = np.vstack([self.places, places])

    def in_equilibrium(self) -> bool:
        """Whether an equilibrium within friction exists, under some live load where there is one.

        One program: the least sum of unbalanced forces.

        Raises
        ------
        SolveError
        """
        return self.most_balanced()[1] <= FALLING_FRACTION

    def bounds(self) -> EquilibriumBounds:
        """Bound the reaction or the multiplier of all equilibria within friction.

        Raises
        ------
        SolveError

        Notes
        -----
        Two linear programs over the multipliers of the friction cones' rays, in space two conic programs over the
        forces in round cones: the least and the largest reaction (or multiplier). The least is that of Portioli &
        Cascini (2017) at this geometry. Forces out of balance have a cost above that of any mechanism.
        """
        # A bound may stay unknown, except that of a pushover.
        forces_sign = 1.0 if self.live_size == 0.0 else -1.0
        unknown: set[float] = set()
        solutions: dict[float, Solution | None] = {}
        for sign in (1.0, -1.0):
            try:
                solutions[sign] = self.bound(sign)
            except SolveError:
                if sign == forces_sign and self.live_size > 0.0:
                    raise
                unknown.add(sign)
                solutions[sign] = None
        arbitrary, unbalanced = None, np.inf
        if solutions[forces_sign] is None and (forces_sign in unknown or solutions[-forces_sign] is None):
            # Where blocks are wedged neither bound is finite, and others may fall.
            arbitrary, unbalanced = self.most_balanced()
        imbalance = {sign: self.unbalanced(solution) for sign, solution in solutions.items() if solution is not None}
        unbalanced = min([unbalanced, *imbalance.values()])
        values, gaps = [], [0.0]
        forces_of: dict[float, np.ndarray] = {}
        for sign, solution in solutions.items():
            slack = True
            if solution is not None and imbalance[sign] > FALLING_FRACTION >= unbalanced:
                # Forces out of balance cost less than this bound, though an equilibrium exists.
                slack = False
                try:
                    solution = self.bound(sign, slack=False)
                except SolveError:
                    unknown.add(sign)
                    solution = None
            if solution is None:
                values.append(np.nan if sign in unknown else -sign * np.inf)
                continue
            values.append(self.value(solution, slack))
            gaps.append(solution.gap)
            forces_of[sign] = self.forces(solution)
        if arbitrary is not None:
            forces_of[0.0] = self.forces(arbitrary)
        ordered = [forces_of[sign] for sign in (forces_sign, -forces_sign, 0.0) if sign in forces_of]
        other_forces = ordered[1] if len(ordered) > 1 else None
        return EquilibriumBounds(unbalanced, values[0], values[1], max(gaps), self.programs, ordered[0], other_forces)

    def bound(self, sign: float, *, slack: bool = True) -> Solution | None:
        """Least or, by sign, largest value, or 0 for any; with or without unbalanced forces; None without a bound.

        Raises
        ------
        SolveError
        """
        cost, matrix = sign * self.objective, self.matrix
        cost[self._slack] = UNBALANCED_COST if sign else 1.0
        if not slack:
            cost, matrix = np.delete(cost, self._slack), matrix[:, np.delete(np.arange(len(cost)), self._slack)]
        self.programs += 1
        try:
            none = np.zeros_like(self.reserve)
            if self.d == 3:
                lower, upper = np.append(-self.load, none), np.append(-self.load, self.reserve)
                routes = CONIC_ROUTES if sign else CONIC_ROUTES[::-1]
                return solve_between(cost, matrix, lower, upper, self.friction, 3, routes)
            lower = np.append(-self.load - self.tolerance, none)
            upper = np.append(-self.load + self.tolerance, self.reserve)
            return solve_lp(LinearProgram(cost=cost, matrix=matrix, lower=lower, upper=upper, places=self.places))
        except Unbounded:
            return None

    def most_balanced(self) -> tuple[Solution | None, float]:
        """Find forces of least imbalance, and their unbalanced forces over the total load, 0 where that is rounding.

        Raises
        ------
        SolveError
        """
        try:
            solution = self.bound(0.0)
        except SolveError as error:
            best = error.best
            if best is None:
                raise
            if best.violation <= ACCEPTED_ERROR and self.unbalanced(best) <= ACCEPTED_ERROR:
                return best, 0.0
            # The dual objective bounds the forces out of balance from below, but for its violation along the forces.
            doubt = best.dual_violation * (1.0 + float(np.abs(best.row_dual).max())) * float(np.abs(best.x).sum())
            if best.dual_objective <= 2.0 * best.gap + doubt:
                raise
            return best, self.unbalanced(best)
        return solution, np.inf if solution is None else self.unbalanced(solution)

    @property
    def _slack(self) -> slice:
        return slice(self.n, self.n + 2 * self.rows)

    def unbalanced(self, solution: Solution) -> float:
        """Sum of the unbalanced forces of a solution, over the total load."""
        return float(solution.x[self._slack].sum()) / self.total

    def value(self, solution: Solution, slack: bool) -> float:
        """Reaction [N or N·m] or multiplier of a solution."""
        objective = self.objective if slack else np.delete(self.objective, self._slack)
        return (float(objective @ solution.x[: len(objective)]) + self.constant) * self.unit

    def forces(self, solution: Solution) -> np.ndarray:
        """(n_contacts, d) array: contact forces of a solution, in units of the program."""
        return np.asarray(self.rays @ solution.x[: self.n]).reshape(-1, self.d) + self.least
