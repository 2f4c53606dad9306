"""Linear programs and their solutions, with the check that every solution has to pass."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from solver.tolerances import ACCEPTED_GAP, ACCEPTED_VIOLATION

from .band import Iterate


class SolveError(RuntimeError):
    """No route gave a solution that passes its check. Not a statement about the structure."""


class Unbounded(Exception):
    """The objective falls without limit, and a ray that we have checked proves it.

    Attributes
    ----------
    x : (n,) array
        The ray: A x = 0, x ≥ 0, cost · x < 0.
    """

    def __init__(self, x: np.ndarray) -> None:
        super().__init__("the linear program is unbounded")
        self.x = x


@dataclass(frozen=True)
class LinearProgram:
    """Minimise cost · x subject to lower ≤ A x ≤ upper and x ≥ 0.

    Attributes
    ----------
    cost : (n,) array
    matrix : (m, n) sparse array, by columns
    lower, upper : (m,) arrays
    places : (m, dim) array, optional
        Where the row's block is.
    start : Iterate, optional
        Early iterate of a program much like this one, from which the method for bands may start.
    """

    cost: np.ndarray
    matrix: sp.csc_array
    lower: np.ndarray
    upper: np.ndarray
    places: np.ndarray | None = None
    start: Iterate | None = None


@dataclass(frozen=True)
class LPSolution:
    """A solution of a :class:`LinearProgram` together with the measures by which it proves itself.

    Attributes
    ----------
    x : (n,) array
        Primal solution.
    row_dual : (m,) array
        Multipliers of the rows.
    objective, dual_objective : float
    primal_violation : float
        Largest violation of a row or of x ≥ 0.
    dual_violation : float
        Largest negative reduced cost.
    route : str
        How it was found.
    iterations : int
    seconds : float
    early : Iterate or None
        From which a program much like this one may start.
    """

    x: np.ndarray
    row_dual: np.ndarray
    objective: float
    dual_objective: float
    primal_violation: float
    dual_violation: float
    route: str
    iterations: int
    seconds: float
    early: Iterate | None = None

    @property
    def gap(self) -> float:
        """Difference of the two objectives relative to 1 + their size."""
        return abs(self.objective - self.dual_objective) / (1.0 + abs(self.objective))

    @property
    def accepted(self) -> bool:
        """Whether the solution passes our own check, whatever HiGHS says about it."""
        return max(self.primal_violation, self.dual_violation) <= ACCEPTED_VIOLATION and self.gap <= ACCEPTED_GAP


def raise_if_proved(program: LinearProgram, ray: np.ndarray) -> None:
    """Raise ``Unbounded`` where the ray proves it by our own check, whatever the solver that found it says."""
    x = np.maximum(ray, 0.0)
    size = float(np.abs(x).max(initial=0.0))
    if size == 0.0:
        return
    x /= size
    if np.abs(program.matrix @ x).max(initial=0.0) <= 1e-9 and program.cost @ x < -1e-9:
        raise Unbounded(x)


def checked(
    program: LinearProgram, x: np.ndarray, y: np.ndarray, route: str, iterations: int, seconds: float
) -> LPSolution:
    """Measure a solution by the program alone.

    Parameters
    ----------
    program : LinearProgram
    x : (n,) array
    y : (m,) array
        Multipliers of the rows.
    route, iterations, seconds
        As of :class:`LPSolution`.
    """
    activity = program.matrix @ x
    reduced = program.cost - program.matrix.T @ y
    return LPSolution(
        x=x,
        row_dual=y,
        objective=float(program.cost @ x),
        dual_objective=float(np.where(y > 0, y * program.lower, y * program.upper).sum()),
        primal_violation=float(np.maximum(program.lower - activity, activity - program.upper).max(initial=0.0)),
        dual_violation=float(np.maximum(-reduced, 0.0).max(initial=0.0)),
        route=route,
        iterations=iterations,
        seconds=seconds,
    )
