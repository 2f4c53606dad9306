"""Conic programs solved by Clarabel. The only module that imports clarabel."""

from __future__ import annotations

import clarabel
import numpy as np
import scipy.sparse as sp

from solver.tolerances import FEASIBILITY_TOLERANCE, INTERIOR_TOLERANCE

from .problem import ConicProgram, Solution

#: Tolerance of Clarabel, and what it adds to the diagonal of its equations before factors, which refinement takes back:
#: with its default of 1e-8 a quarter of the programs of a vault whose stones slide ended at gaps of 1e-6.
TOLERANCE, REGULARISATION = 1e-11, 1e-7

#: Whether rows and columns are scaled anew, by route: of weightless blocks none seemed to balance small loads so.
ROUTES = {"clarabel": True, "clarabel not equilibrated": False}


def run_clarabel(program: ConicProgram, route: str) -> tuple[Solution | None, str]:
    """Solve a conic program by one of ``ROUTES``: all that is told of :func:`solver.programs.highs.run_highs` holds.

    Stated as its dual, whose unknowns are the fewer ones: minimise - right · y with c - Aᵀ y in the dual cones; the
    multipliers of these are x. Goulart & Chen (2024), https://arxiv.org/abs/2405.12762.
    """
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.max_threads = 1
    settings.max_iter = 200
    settings.equilibrate_enable = ROUTES[route]
    settings.static_regularization_constant = REGULARISATION
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = TOLERANCE
    rows, columns = program.matrix.shape
    # Supernodes take 0.7 of the time at 4,881 stones, and 1.4 at 1,009.
    settings.direct_solve_method = "faer" if rows >= 15_000 else "qdldl"
    scale = program.scale
    signed = columns - program.in_cones
    cones = [clarabel.SecondOrderConeT(program.size)] * len(program.friction)
    cones += [clarabel.NonnegativeConeT(signed)] if signed else []
    rows_of_dual = sp.csc_matrix((program.matrix @ sp.diags_array(scale)).T)
    zero = sp.csc_matrix((rows, rows))
    solver = clarabel.DefaultSolver(zero, -program.right, rows_of_dual, scale * program.cost, cones, settings)
    # Where equilibrium determines a reaction no motion is inside the cones, and its error stays for 60 iterations.
    solver.set_termination_callback(
        lambda at: (
            at.res_dual <= FEASIBILITY_TOLERANCE
            and at.res_primal <= INTERIOR_TOLERANCE
            and min(at.gap_abs, at.gap_rel) <= TOLERANCE
        )
    )
    solution = solver.solve()
    x, y = scale * np.asarray(solution.z), np.asarray(solution.x)
    status = str(solution.status)
    if status.endswith("PrimalInfeasible"):
        program.raise_if_unbounded(x)
        return None, "the dual seems infeasible, without proof"
    if status.endswith("DualInfeasible"):
        return None, "no x balances the rows"
    if not (np.isfinite(x).all() and np.isfinite(y).all()):
        return None, status
    return program.checked(x, y, route), status
