"""Conic programs and their solutions, with the check that every solution has to pass."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from solver.lp.problem import Unbounded
from solver.tolerances import ACCEPTED_GAP, ACCEPTED_VIOLATION, RAY_BALANCE


@dataclass(frozen=True)
class ConicProgram:
    """Minimise cost · x subject to A x = right, the first columns in round friction cones and x ≥ 0 in the others.

    Attributes
    ----------
    cost : (n,) array
    matrix : (m, n) sparse array, by columns
    right : (m,) array
    friction : (k,) array
        Of each cone: its first number times this is at least the length of its others, |T| ≤ μ N.
    size : int
        Numbers in a cone: cone i has the columns ``i * size`` to ``(i + 1) * size - 1``.

    Notes
    -----
    Its dual: maximise right · y with c - Aᵀ y in the dual cones, N ≥ μ |T|, and at least 0 in the other columns.
    """

    cost: np.ndarray
    matrix: sp.csc_array
    right: np.ndarray
    friction: np.ndarray
    size: int = 3

    @property
    def in_cones(self) -> int:
        """How many columns are in cones: those that come first."""
        return self.size * len(self.friction)

    @cached_property
    def scale(self) -> np.ndarray:
        """(n,) array: x is this times a point of cones of slope 1, a reduced cost divided by this one of their duals.

        As long for every friction coefficient, so that a large one does not unbalance the program.
        """
        scale = np.ones(len(self.cost))
        of_cone = scale[: self.in_cones].reshape(-1, self.size)
        of_cone[:, 1:] = self.friction[:, None]
        of_cone /= np.hypot(1.0, self.friction)[:, None]
        return scale

    def outside(self, x: np.ndarray) -> float:
        """How far x leaves the cones and goes below 0, at most."""
        cones = x[: self.in_cones].reshape(-1, self.size)
        beyond = np.linalg.norm(cones[:, 1:], axis=1) - self.friction * cones[:, 0]
        beyond = np.maximum(beyond / np.hypot(1.0, self.friction), -cones[:, 0])
        return max(float(beyond.max(initial=0.0)), float(-x[self.in_cones :].min(initial=0.0)))

    def outside_dual(self, reduced: np.ndarray) -> float:
        """How far reduced costs leave the dual cones and go below 0, at most."""
        cones = reduced[: self.in_cones].reshape(-1, self.size)
        beyond = self.friction * np.linalg.norm(cones[:, 1:], axis=1) - cones[:, 0]
        beyond /= np.hypot(1.0, self.friction)
        return max(float(beyond.max(initial=0.0)), float(-reduced[self.in_cones :].min(initial=0.0)))


@dataclass(frozen=True)
class ConicSolution:
    """A solution of a :class:`ConicProgram` together with the measures by which it proves itself, all relative.

    Attributes
    ----------
    x : (n,) array
    row_dual : (m,) array
        Multipliers of the rows.
    objective, dual_objective : float
    balance_violation : float
        Largest violation of a row, over 1 + the largest right-hand side.
    force_violation : float
        How far x leaves its cones at most, over 1 + its largest number.
    motion_violation : float
        How far the reduced costs leave the dual cones at most, over 1 + the largest multiplier.
    route : str
        How it was found.
    iterations : int
    seconds : float
    """

    x: np.ndarray
    row_dual: np.ndarray
    objective: float
    dual_objective: float
    balance_violation: float
    force_violation: float
    motion_violation: float
    route: str
    iterations: int
    seconds: float

    @property
    def gap(self) -> float:
        """Difference of the two objectives relative to 1 + their size."""
        return abs(self.objective - self.dual_objective) / (1.0 + abs(self.objective))

    @property
    def violation(self) -> float:
        """The largest of the three violations."""
        return max(self.balance_violation, self.force_violation, self.motion_violation)

    @property
    def accepted(self) -> bool:
        """Whether the solution passes our own check, whatever its solver says about it."""
        return self.violation <= ACCEPTED_VIOLATION and self.gap <= ACCEPTED_GAP


def raise_if_proved(program: ConicProgram, ray: np.ndarray) -> None:
    """Raise ``Unbounded`` where the ray proves it by our own check, whatever the solver that found it says."""
    size = float(np.abs(ray).max(initial=0.0))
    if not (np.isfinite(size) and size > 0.0):
        return
    x = ray / size
    left, outside = np.abs(program.matrix @ x), program.outside(x)
    if max(float(left.max(initial=0.0)), outside) > RAY_BALANCE:
        return
    # It has to gain far more than what it is off by could cost.
    off = float(left.sum()) + outside * len(program.friction)
    if program.cost @ x < -RAY_BALANCE - 10.0 * off * float(np.abs(program.cost).max(initial=0.0)):
        raise Unbounded(x)


def checked(
    program: ConicProgram, x: np.ndarray, y: np.ndarray, route: str, iterations: int, seconds: float
) -> ConicSolution:
    """Measure a solution by the program alone.

    Parameters
    ----------
    program : ConicProgram
    x : (n,) array
    y : (m,) array
        Multipliers of the rows.
    route, iterations, seconds
        As of :class:`ConicSolution`.
    """
    reduced = program.cost - program.matrix.T @ y
    off = np.abs(program.matrix @ x - program.right)
    return ConicSolution(
        x=x,
        row_dual=y,
        objective=float(program.cost @ x),
        dual_objective=float(program.right @ y),
        balance_violation=float(off.max(initial=0.0)) / (1.0 + float(np.abs(program.right).max(initial=0.0))),
        force_violation=program.outside(x) / (1.0 + float(np.abs(x).max(initial=0.0))),
        motion_violation=program.outside_dual(reduced) / (1.0 + float(np.abs(y).max(initial=0.0))),
        route=route,
        iterations=iterations,
        seconds=seconds,
    )
