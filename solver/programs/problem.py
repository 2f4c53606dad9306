"""Linear and conic programs and their solutions, with the check that every solution has to pass."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import lsqr

from solver.tolerances import ACCEPTED_ERROR, RAY_BALANCE


class SolveError(RuntimeError):
    """No route gave a solution that passes its check, not even ``best``. Not a statement about the structure."""

    def __init__(self, message: str, best: Solution | None = None) -> None:
        super().__init__(message)
        self.best = best


class Unbounded(Exception):
    """The program has no minimum, as a checked ray x, (n,), proves: A x = 0, x ≥ 0 or in the cones, cost · x < 0."""

    def __init__(self, x: np.ndarray) -> None:
        super().__init__("the program is unbounded")
        self.x = x


@dataclass(frozen=True)
class LinearProgram:
    """Minimise cost · x, (n,), subject to lower ≤ A x ≤ upper, (m,), and x ≥ 0; limits finite, equal of equations."""

    cost: np.ndarray
    matrix: sp.csc_array
    lower: np.ndarray
    upper: np.ndarray
    places: np.ndarray | None = None  #: (m, dim): where the row's block is

    def checked(self, x: np.ndarray, y: np.ndarray, route: str) -> Solution:
        """Measure a solution x with multipliers y of the rows by the program alone; violations are absolute."""
        activity = self.matrix @ x
        bound = float(np.where(y > 0, y * self.lower, y * self.upper).sum())
        violation = float(np.maximum(self.lower - activity, activity - self.upper).max(initial=0.0))
        violation = max(violation, float(-x.min(initial=0.0)))
        of_dual = float(-(self.cost - self.matrix.T @ y).min(initial=0.0))
        return Solution(x, y, float(self.cost @ x), bound, violation, of_dual, route)

    def raise_if_unbounded(self, ray: np.ndarray) -> None:
        """Raise ``Unbounded`` where the ray, (n,), passes our own check."""
        x = np.maximum(ray, 0.0)
        small = 1e-9 * float(x.max(initial=0.0))
        if np.abs(self.matrix @ x).max(initial=0.0) <= small and self.cost @ x < -small:
            raise Unbounded(x)


@dataclass(frozen=True)
class ConicProgram:
    """Minimise cost · x, (n,), subject to A x = right, (m,), with x ≥ 0 but for the first columns, in friction cones.

    Cone i has the columns ``i * size`` to ``(i + 1) * size - 1``: the first number times its friction is at least the
    length of the others, |T| ≤ μ N.
    Its dual: maximise right · y with c - Aᵀ y in the dual cones, N ≥ μ |T|, and at least 0 in the other columns.
    """

    cost: np.ndarray
    matrix: sp.csc_array
    right: np.ndarray
    friction: np.ndarray  #: (k,), of each cone
    size: int = 3

    @property
    def in_cones(self) -> int:
        """How many columns are in cones: those that come first."""
        return self.size * len(self.friction)

    @cached_property
    def scale(self) -> np.ndarray:
        """(n,) array: x is this times a point of cones of slope 1, a reduced cost divided by it one of their duals."""
        scale = np.ones(len(self.cost))
        of_cone = scale[: self.in_cones].reshape(-1, self.size)
        of_cone[:, 1:] = self.friction[:, None]
        # As long for every friction coefficient, so that a large one does not unbalance the program.
        of_cone /= np.hypot(1.0, self.friction)[:, None]
        return scale

    def outside(self, x: np.ndarray) -> float:
        """How far x, (n,), leaves the cones and goes below 0, at most."""
        cones = x[: self.in_cones].reshape(-1, self.size)
        excess = np.linalg.norm(cones[:, 1:], axis=1) - self.friction * cones[:, 0]
        excess = np.maximum(excess / np.hypot(1.0, self.friction), -cones[:, 0])
        return max(float(excess.max(initial=0.0)), float(-x[self.in_cones :].min(initial=0.0)))

    def outside_dual(self, reduced: np.ndarray) -> float:
        """How far reduced costs, (n,), leave the dual cones and go below 0, at most."""
        cones = reduced[: self.in_cones].reshape(-1, self.size)
        excess = self.friction * np.linalg.norm(cones[:, 1:], axis=1) - cones[:, 0]
        excess /= np.hypot(1.0, self.friction)
        return max(float(excess.max(initial=0.0)), float(-reduced[self.in_cones :].min(initial=0.0)))

    def checked(self, x: np.ndarray, y: np.ndarray, route: str) -> Solution:
        """Measure a solution by the program alone; violations are relative to 1 + the largest number of their kind."""
        of_right, of_x, of_y = (1.0 + float(np.abs(kind).max(initial=0.0)) for kind in (self.right, x, y))
        violation = float(np.abs(self.matrix @ x - self.right).max(initial=0.0))
        violation = max(violation / of_right, self.outside(x) / of_x)
        of_dual = self.outside_dual(self.cost - self.matrix.T @ y) / of_y
        return Solution(x, y, float(self.cost @ x), float(self.right @ y), violation, of_dual, route)

    def raise_if_unbounded(self, ray: np.ndarray) -> None:
        """Raise ``Unbounded`` where the ray, (n,), passes our own check."""
        size = float(np.abs(ray).max(initial=0.0))
        if not (np.isfinite(size) and size > 0.0):
            return
        x = ray / size
        # What it is out of balance by is taken from its larger forces.
        weight = np.abs(x)
        weight[: self.in_cones] = np.repeat(x[: self.in_cones : self.size], self.size)
        weighted = self.matrix @ sp.diags_array(weight)
        x = x - weight * lsqr(weighted, self.matrix @ x, atol=1e-6, btol=1e-6)[0]
        residual, outside = np.abs(self.matrix @ x), self.outside(x)
        if max(float(residual.max(initial=0.0)), outside) > RAY_BALANCE:
            return
        # Its gain has to exceed the cost of its violation by far.
        violation = float(residual.sum()) + outside * len(self.friction)
        if self.cost @ x < -RAY_BALANCE - 10.0 * violation * float(np.abs(self.cost).max(initial=0.0)):
            raise Unbounded(x)


@dataclass(frozen=True)
class Solution:
    """A solution of a program with the measures of its error."""

    x: np.ndarray
    row_dual: np.ndarray  #: (m,): multipliers of the rows
    objective: float
    dual_objective: float
    primal_violation: float  #: largest of a row, of a cone or of x ≥ 0
    dual_violation: float  #: how far the reduced costs leave the dual cones or go below 0 at most
    route: str

    @property
    def gap(self) -> float:
        """Difference of the two objectives relative to 1 + their size."""
        return abs(self.objective - self.dual_objective) / (1.0 + abs(self.objective))

    @property
    def violation(self) -> float:
        """The larger of the two violations."""
        return max(self.primal_violation, self.dual_violation)

    @property
    def accepted(self) -> bool:
        """Whether the solution passes our own check."""
        return self.violation <= ACCEPTED_ERROR and self.gap <= ACCEPTED_ERROR
