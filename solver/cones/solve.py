"""Which ways to a solution are tried, and in which order."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from solver.lp.problem import LinearProgram, LPSolution, SolveError
from solver.lp.solve import solve_lp, vertex_routes

from .clarabel import run_clarabel
from .cuts import run_cuts
from .interior import run_interior
from .problem import ConicProgram, ConicSolution

#: Our own way, for programs whose rows form a band; pyramids and cuts, which need nothing but linear programs.
OWN, CUTS = "interior", "cuts"

#: The order in which they are tried.
LADDER = ("clarabel", "clarabel at 1e-9", "clarabel without presolve", CUTS)

#: From this many rows on our own method is the faster one: from 300 blocks; with 1,000 it takes half the time.
OWN_ROWS = 1800


def solve_cones(program: ConicProgram, routes: tuple[str, ...] | None = None) -> ConicSolution:
    """Solve a conic program, trying one route after another until a solution passes its check.

    Parameters
    ----------
    program : ConicProgram
    routes : tuple of str, optional
        ``OWN``, ``CUTS`` or names out of Clarabel's ``ROUTES``, in the order to try; chosen by size by default.

    Raises
    ------
    Unbounded
        If the program has no minimum, proved by a ray.
    SolveError
        If no route gives a solution that passes; the message lists what each of them ended with.
    """
    if routes is None:
        routes = (OWN, *LADDER) if program.matrix.shape[0] >= OWN_ROWS else LADDER
    outcomes = []
    for route in routes:
        solution, status = _run(program, route)
        if solution is not None and solution.accepted:
            return solution
        if solution is not None:
            status += f", violation {solution.violation:.1e}, gap {solution.gap:.1e}"
        outcomes.append(f"{route}: {status}")
    raise SolveError(
        f"no solution of the conic program with {program.matrix.shape[0]} rows and {len(program.friction)} cones "
        f"passed its check ({'; '.join(outcomes)})"
    )


def _run(program: ConicProgram, route: str) -> tuple[ConicSolution | None, str]:
    if route == OWN:
        return run_interior(program)
    return run_cuts(program) if route == CUTS else run_clarabel(program, route)


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
        # Of limit loads: a vertex is one mechanism, an interior point a mean of several: fixed points wander from it.
        program = LinearProgram(cost=cost, matrix=matrix, lower=lower, upper=upper)
        return solve_lp(program, vertex_routes(matrix.shape[0]))
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
