"""Linear programs solved by HiGHS. The only module that imports highspy."""

from __future__ import annotations

import highspy
import numpy as np

from solver.tolerances import FEASIBILITY_TOLERANCE, INTERIOR_TOLERANCE

from .problem import LinearProgram, Solution

#: Options of HiGHS by route.
ROUTES: dict[str, dict[str, object]] = {
    "simplex": {"solver": "simplex"},
    # What presolve takes out comes back off by 1e-7 to 3e-6 at times.
    "simplex without presolve": {"solver": "simplex", "presolve": "off"},
    "hipo": {
        "solver": "hipo",
        "run_crossover": "off",
        "primal_feasibility_tolerance": INTERIOR_TOLERANCE,
        "dual_feasibility_tolerance": INTERIOR_TOLERANCE,
        "ipm_optimality_tolerance": INTERIOR_TOLERANCE,
        # The other system is never the faster one, and trying both costs a fifth of the time.
        "hipo_system": "normaleq",
    },
    "crossover": {"solver": "hipo", "run_crossover": "on"},
}


def run_highs(program: LinearProgram, route: str) -> tuple[Solution | None, str]:
    """Solve a program by one of ``ROUTES``: the solution, None where HiGHS has none, and its status.

    Its check is up to the caller. Raises ``Unbounded`` if a ray proves that the program has no minimum.
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
        # Without limits a method that stalls or cycles never ends.
        "ipm_iteration_limit": 1000,
        "simplex_iteration_limit": 200 * sum(program.matrix.shape),
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
            program.raise_if_unbounded(np.asarray(ray))
        return None, status
    solution = highs.getSolution()
    if not (solution.value_valid and solution.dual_valid):
        return None, status
    # Interior solutions are negative by up to their tolerance; the rows show what that gains.
    x = np.maximum(np.asarray(solution.col_value), 0.0)
    return program.checked(x, np.asarray(solution.row_dual), route), status
