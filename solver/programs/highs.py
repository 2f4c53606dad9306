"""Linear programs solved by HiGHS. The only module that imports highspy."""

from __future__ import annotations

import highspy
import numpy as np

from solver.tolerances import FEASIBILITY_TOLERANCE, INTERIOR_TOLERANCE

from .problem import LinearProgram, Solution

#: Iterations after which a route is given up: twenty times what interior methods need, and simplex iterations per row
#: and column.
IPM_ITERATIONS, SIMPLEX_ITERATIONS = 1000, 200

#: Ways through HiGHS: (name, options). Each is judged by our own check, so the order is a matter of speed only.
ROUTES: dict[str, dict[str, object]] = {
    "simplex": {"solver": "simplex"},
    "hipo": {
        "solver": "hipo",
        "run_crossover": "off",
        "primal_feasibility_tolerance": INTERIOR_TOLERANCE,
        "dual_feasibility_tolerance": INTERIOR_TOLERANCE,
        "ipm_optimality_tolerance": INTERIOR_TOLERANCE,
        # Trying out the other system first takes a fifth of the time, and it is never the better one here.
        "hipo_system": "normaleq",
    },
    "crossover": {"solver": "hipo", "run_crossover": "on"},
}


def run_highs(program: LinearProgram, route: str) -> tuple[Solution | None, str]:
    """Solve a program by one route.

    Parameters
    ----------
    program : LinearProgram
    route : str
        One of ``ROUTES``.

    Returns
    -------
    Solution or None
        None where HiGHS has none; its check is up to the caller.
    str
        What HiGHS says of it.

    Raises
    ------
    Unbounded
        If a ray proves that the program has no minimum.
    """
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
        # Without limits an interior method that stalls never ends, nor does a simplex method that cycles.
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
            program.raise_if_proved(np.asarray(ray))
        return None, status
    found = highs.getSolution()
    if not (found.value_valid and found.dual_valid):
        return None, status
    info = highs.getInfo()
    iterations = max(info.simplex_iteration_count, 0) + max(info.ipm_iteration_count, 0)
    # Interior solutions stray below zero by their tolerance; what they gain from it shows up as row violation.
    x = np.maximum(np.asarray(found.col_value), 0.0)
    y = np.asarray(found.row_dual)
    return program.checked(x, y, route, int(iterations)), status
