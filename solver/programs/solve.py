"""The routes by which programs are solved, and their order."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial

import numpy as np
import scipy.sparse as sp

from .band import run_band
from .clarabel import ROUTES, run_clarabel
from .highs import run_highs
from .problem import ConicProgram, LinearProgram, Solution, SolveError

#: Up to this many rows the simplex method is the fastest, and gives a vertex.
SIMPLEX_ROWS = 250

#: Up to this many rows a vertex is found by crossover, which takes up to eight times as long as the interior solution.
CROSSOVER_ROWS = 1500

#: Route of our own method for programs whose rows form a band.
BAND = "band"

#: Routes that give a vertex.
VERTEX = ("simplex", "simplex without presolve")

#: Routes of large programs, of which the simplex method alone gives a ray where the band does not apply.
LADDER = (BAND, "hipo", *VERTEX)


def solve_lp(program: LinearProgram, routes: tuple[str, ...] | None = None, *, vertex: bool = False) -> Solution:
    """Solve a linear program, trying one route after another until a solution passes its check.

    Routes are ``BAND`` or names out of ``ROUTES``, chosen by size by default; with ``vertex`` those that find one, up
    to ``CROSSOVER_ROWS`` rows: it is one mechanism, while an interior point, a mean of several, lets fixed-point
    iterations drift. Raises ``Unbounded``, and ``SolveError``, which lists what each route ended with.
    """
    rows, columns = program.matrix.shape
    if routes is None:
        routes = ("crossover", *VERTEX) if vertex and rows <= CROSSOVER_ROWS else LADDER
        routes = (*VERTEX, "hipo") if rows <= SIMPLEX_ROWS else routes
    runs = {route: partial(run_highs, program, route) for route in routes}
    if BAND in runs:
        runs[BAND] = partial(run_band, program)
    return _first_accepted(runs, f"linear program with {rows} rows and {columns} columns")


def _first_accepted(runs: Mapping[str, Callable[[], tuple[Solution | None, str]]], what: str) -> Solution:
    outcomes, best = [], None
    for route, run in runs.items():
        solution, status = run()
        if solution is not None and solution.accepted:
            return solution
        if solution is not None:
            best = solution if best is None or solution.violation < best.violation else best
            status = f"{status}, violation {solution.violation:.1e}, gap {solution.gap:.1e}"
        outcomes.append(f"{route}: {status}")
    raise SolveError(f"no solution of the {what} passed its check ({'; '.join(outcomes)})", best)


def solve_between(linear: LinearProgram, friction: np.ndarray, size: int, *, vertex: bool = True) -> Solution:
    """Solve a linear program, or with friction, (k,), one whose first columns are in round cones in place of x ≥ 0.

    With cones, the first n numbers of x are those of the program, and the first multipliers those of the equations,
    where the limits are equal; the slack of the other rows follows. Raises as :func:`solve_lp` does.
    """
    if len(friction) == 0:
        return solve_lp(linear, vertex=vertex)
    matrix, lower, upper = linear.matrix, linear.lower, linear.upper
    rows_of, equal = sp.csr_array(matrix), lower == upper
    below, above = np.flatnonzero(~equal & np.isfinite(lower)), np.flatnonzero(~equal & np.isfinite(upper))
    rows = sp.vstack([rows_of[equal], rows_of[below], rows_of[above]])
    slack = np.concatenate([np.full(len(below), -1.0), np.ones(len(above))])
    slack_columns = sp.vstack([sp.csr_array((int(equal.sum()), len(slack))), sp.diags_array(slack)])
    program = ConicProgram(
        cost=np.concatenate([linear.cost, np.zeros(len(slack))]),
        matrix=sp.csc_array(sp.hstack([rows, slack_columns], format="csc")),
        right=np.concatenate([lower[equal], lower[below], upper[above]]),
        friction=friction,
        size=size,
    )
    what = f"conic program with {len(program.right)} rows and {len(friction)} cones"
    return _first_accepted({route: partial(run_clarabel, program, route) for route in ROUTES}, what)
