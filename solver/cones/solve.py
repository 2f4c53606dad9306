"""Which ways to a solution are tried, and in which order."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from solver.lp.problem import LinearProgram, LPSolution, SolveError
from solver.lp.solve import solve_lp

from .clarabel import ROUTES, run_clarabel
from .problem import ConicProgram, ConicSolution


def solve_cones(program: ConicProgram, routes: tuple[str, ...] = tuple(ROUTES)) -> ConicSolution:
    """Solve a conic program, trying one route after another until a solution passes its check.

    Parameters
    ----------
    program : ConicProgram
    routes : tuple of str
        In the order to try.

    Raises
    ------
    Unbounded
        If the program has no minimum, proved by a ray.
    SolveError
        If no route gives a solution that passes; the message lists what each of them ended with.
    """
    outcomes = []
    for route in routes:
        solution, status = run_clarabel(program, route)
        if solution is not None and solution.accepted:
            return solution
        if solution is not None:
            status += f", violation {solution.violation:.1e}, gap {solution.gap:.1e}"
        outcomes.append(f"{route}: {status}")
    raise SolveError(
        f"no solution of the conic program with {program.matrix.shape[0]} rows and {len(program.friction)} cones "
        f"passed its check ({'; '.join(outcomes)})"
    )


def solve_between(
    cost: np.ndarray, matrix: sp.csc_array, lower: np.ndarray, upper: np.ndarray, friction: np.ndarray, size: int
) -> LPSolution | ConicSolution:
    """Minimise cost · x with lower ≤ A x ≤ upper, the first columns in round cones: without any, a linear program.

    Parameters
    ----------
    cost : (n,) array
    matrix : (m, n) sparse array, by columns
    lower, upper : (m,) arrays
        Equations where they are equal.
    friction : (k,) array
    size : int
        As of :class:`ConicProgram`.

    Returns
    -------
    LPSolution or ConicSolution
        Of the latter the first n numbers of x are those of the program, and the first multipliers those of the
        equations; what is left of a row to its bounds follows.

    Raises
    ------
    Unbounded, SolveError
        As of :func:`solve_lp` and :func:`solve_cones`.
    """
    if len(friction) == 0:
        return solve_lp(LinearProgram(cost=cost, matrix=matrix, lower=lower, upper=upper))
    by_row, equal = sp.csr_array(matrix), lower == upper
    below, above = np.flatnonzero(~equal & np.isfinite(lower)), np.flatnonzero(~equal & np.isfinite(upper))
    rows = sp.vstack([by_row[equal], by_row[below], by_row[above]])
    left = np.concatenate([np.full(len(below), -1.0), np.ones(len(above))])
    left_at = sp.vstack([sp.csr_array((int(equal.sum()), len(left))), sp.diags_array(left)])
    return solve_cones(
        ConicProgram(
            cost=np.concatenate([cost, np.zeros(len(left))]),
            matrix=sp.csc_array(sp.hstack([rows, left_at], format="csc")),
            right=np.concatenate([lower[equal], lower[below], upper[above]]),
            friction=friction,
            size=size,
        )
    )
