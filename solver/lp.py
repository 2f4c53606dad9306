"""Linear programs: stated, solved by HiGHS or our own method, and checked. The only module that imports highspy."""

from __future__ import annotations

import time
from dataclasses import dataclass

import highspy
import numpy as np
import scipy.sparse as sp

from .interior import Diverges, NoProgress, interior_point

__all__ = ["LPSolution", "LinearProgram", "SolveError", "Unbounded", "solve_lp"]

#: HiGHS' smallest feasibility tolerance; the programs are scaled so that it is small against every force.
FEASIBILITY_TOLERANCE = 1e-10

#: The same for interior solutions of large programs: a tenth of the iterations less, and far below what a certificate
#: promises.
INTERIOR_TOLERANCE = 1e-8

#: What our own check accepts: violation of rows, bounds and reduced costs, absolute in the scaled program.
ACCEPTED_VIOLATION = 1e-7

#: Relative difference of the two objectives that our own check accepts.
ACCEPTED_GAP = 1e-7

#: Iterations after which a route is given up: twenty times what interior methods need, and simplex iterations per row
#: and column.
IPM_ITERATIONS, SIMPLEX_ITERATIONS = 1000, 200

#: Up to this many rows the simplex method is the fastest; up to the second number crossover from an interior solution
#: to a vertex costs little, beyond it twenty times the program itself (measured on running-bond walls).
SIMPLEX_ROWS, CROSSOVER_ROWS = 250, 1500


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
    along : (m,) array, optional
        Where the row's block lies along the structure; rows of neighbours are to have values near each other.
    """

    cost: np.ndarray
    matrix: sp.csc_array
    lower: np.ndarray
    upper: np.ndarray
    along: np.ndarray | None = None


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

    @property
    def gap(self) -> float:
        """Difference of the two objectives relative to 1 + their size."""
        return abs(self.objective - self.dual_objective) / (1.0 + abs(self.objective))

    @property
    def accepted(self) -> bool:
        """Whether the solution passes our own check, whatever HiGHS says about it."""
        return max(self.primal_violation, self.dual_violation) <= ACCEPTED_VIOLATION and self.gap <= ACCEPTED_GAP


INTERIOR: dict[str, object] = {
    "primal_feasibility_tolerance": INTERIOR_TOLERANCE,
    "dual_feasibility_tolerance": INTERIOR_TOLERANCE,
    "ipm_optimality_tolerance": INTERIOR_TOLERANCE,
    # Trying out the other system first takes a fifth of the time, and it is never the better one here.
    "hipo_system": "normaleq",
}

#: Our own way, for programs whose rows form a band.
BAND = "band"

#: Ways through HiGHS: (name, options). Each is judged by our own check, so the order is a matter of speed only.
ROUTES: dict[str, dict[str, object]] = {
    "simplex": {"solver": "simplex"},
    "simplex without presolve": {"solver": "simplex", "presolve": "off"},
    "hipo": {"solver": "hipo", "run_crossover": "off", **INTERIOR},
    "hipo without presolve": {"solver": "hipo", "run_crossover": "off", "presolve": "off", **INTERIOR},
    "hipo with crossover": {"solver": "hipo", "run_crossover": "on"},
    "ipx": {"solver": "ipx", "run_crossover": "off"},
    "ipx with crossover": {"solver": "ipx", "run_crossover": "on"},
}

#: The order for large programs, and for small ones that need no vertex.
INTERIOR_ROUTES = (BAND, "hipo", "hipo without presolve", "ipx", "ipx with crossover", "simplex")


def solve_lp(program: LinearProgram, routes: tuple[str, ...] | None = None) -> LPSolution:
    """Solves a linear program, trying one route after another until a solution passes its check.

    Parameters
    ----------
    program : LinearProgram
    routes : tuple of str, optional
        ``BAND`` or names out of ``ROUTES``, in the order to try; chosen by size by default.

    Raises
    ------
    Unbounded
        If the program has no minimum, proved by a ray.
    SolveError
        If no route gives a solution that passes; the message lists what each of them ended with.
    """
    if routes is None:
        rows = program.matrix.shape[0]
        if rows <= SIMPLEX_ROWS:
            routes = ("simplex", "simplex without presolve", "ipx with crossover", "hipo")
        elif rows <= CROSSOVER_ROWS:
            routes = ("hipo with crossover", "ipx with crossover", "simplex", "simplex without presolve")
        else:
            routes = INTERIOR_ROUTES
    outcomes = []
    for route in routes:
        solution, status = _in_band(program) if route == BAND else _run(program, route)
        if solution is not None and solution.accepted:
            return solution
        if solution is not None:
            status += (
                f", violation {max(solution.primal_violation, solution.dual_violation):.1e}, gap {solution.gap:.1e}"
            )
        outcomes.append(f"{route}: {status}")
    raise SolveError(
        f"no solution of the linear program with {program.matrix.shape[0]} rows and {program.matrix.shape[1]} "
        f"columns passed its check ({'; '.join(outcomes)})"
    )


def _in_band(program: LinearProgram) -> tuple[LPSolution | None, str]:
    started = time.perf_counter()
    try:
        x, y, iterations = interior_point(program.cost, program.matrix, program.lower, program.upper, program.along)
    except Diverges as found:
        _raise_if_proved(program, found.ray)
        return None, str(found)
    except NoProgress as reason:
        return None, str(reason)
    return _checked(program, x, y, BAND, iterations, time.perf_counter() - started), "solved"


def _run(program: LinearProgram, route: str) -> tuple[LPSolution | None, str]:
    started = time.perf_counter()
    highs = highspy.Highs()
    options: dict[str, object] = {
        "output_flag": False,
        "threads": 1,
        "random_seed": 0,
        "primal_feasibility_tolerance": FEASIBILITY_TOLERANCE,
        "dual_feasibility_tolerance": FEASIBILITY_TOLERANCE,
        "ipm_optimality_tolerance": FEASIBILITY_TOLERANCE,
        # HiGHS drops entries below 1e-9 otherwise, and forces of hundreds of blocks at such arms are missing.
        "small_matrix_value": 1e-12,
        # An interior method that stalls goes round for ever; a simplex method that cycles, too.
        "ipm_iteration_limit": IPM_ITERATIONS,
        "simplex_iteration_limit": SIMPLEX_ITERATIONS * sum(program.matrix.shape),
        **ROUTES[route],
    }
    for name, value in options.items():
        if highs.setOptionValue(name, value) == highspy.HighsStatus.kError:
            return None, f"HiGHS refuses the option {name} = {value}"
    rows, columns = program.matrix.shape
    lp = highspy.HighsLp()
    lp.num_row_, lp.num_col_ = rows, columns
    lp.col_cost_ = program.cost
    lp.col_lower_ = np.zeros(columns)
    lp.col_upper_ = np.full(columns, highspy.kHighsInf)
    lp.row_lower_, lp.row_upper_ = program.lower, program.upper
    lp.a_matrix_.format_ = highspy.MatrixFormat.kColwise
    lp.a_matrix_.num_row_, lp.a_matrix_.num_col_ = rows, columns
    lp.a_matrix_.start_ = program.matrix.indptr
    lp.a_matrix_.index_ = program.matrix.indices
    lp.a_matrix_.value_ = program.matrix.data
    if highs.passModel(lp) == highspy.HighsStatus.kError:
        return None, "HiGHS refuses the program"
    highs.run()
    status = highs.modelStatusToString(highs.getModelStatus())
    if highs.getModelStatus() == highspy.HighsModelStatus.kUnbounded:
        _, has_ray, ray = highs.getPrimalRay()
        if has_ray:
            _raise_if_proved(program, np.asarray(ray))
        return None, status
    found = highs.getSolution()
    if not (found.value_valid and found.dual_valid):
        return None, status
    info = highs.getInfo()
    iterations = max(info.simplex_iteration_count, 0) + max(info.ipm_iteration_count, 0)
    # Interior solutions stray below zero by their tolerance; what they gain from it shows up as row violation.
    x = np.maximum(np.asarray(found.col_value), 0.0)
    y = np.asarray(found.row_dual)
    return _checked(program, x, y, route, int(iterations), time.perf_counter() - started), status


def _raise_if_proved(program: LinearProgram, ray: np.ndarray) -> None:
    """Raises ``Unbounded`` where a ray proves it; otherwise the word of whoever found it counts for nothing."""
    x = np.maximum(ray, 0.0)
    size = float(np.abs(x).max(initial=0.0))
    if size == 0.0:
        return
    x /= size
    if np.abs(program.matrix @ x).max(initial=0.0) <= 1e-9 and program.cost @ x < -1e-9:
        raise Unbounded(x)


def _checked(
    program: LinearProgram, x: np.ndarray, y: np.ndarray, route: str, iterations: int, seconds: float
) -> LPSolution:
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
