"""Conic programs solved by Clarabel. The only module that imports clarabel."""

from __future__ import annotations

import time

import clarabel
import numpy as np
import scipy.sparse as sp

from .problem import ConicProgram, ConicSolution, checked, raise_if_proved

#: Ways through Clarabel: (tolerance of gaps and residuals, settings). Each is judged by our own check, so the order is
#: a matter of speed only. The first asks for two digits more than are needed: they cost an iteration in thirty.
ROUTES: dict[str, tuple[float, dict[str, object]]] = {
    "clarabel": (1e-11, {}),
    "clarabel at 1e-9": (1e-9, {}),
    "clarabel without presolve": (1e-7, {"presolve_enable": False, "equilibrate_enable": False}),
}

#: Iterations after which it is given up: walls of 1,000 blocks take 30.
ITERATIONS = 200


def run_clarabel(program: ConicProgram, route: str) -> tuple[ConicSolution | None, str]:
    """Solve a program by one route.

    Parameters
    ----------
    program : ConicProgram
    route : str
        One of ``ROUTES``.

    Returns
    -------
    ConicSolution or None
        None where Clarabel has none; its check is up to the caller.
    str
        What Clarabel says of it.

    Raises
    ------
    Unbounded
        If a ray proves that the program has no minimum.

    Notes
    -----
    Stated as its dual, whose unknowns are the fewer ones: minimise - right · y with c - Aᵀ y in the dual cones; the
    multipliers of these are x. Goulart & Chen (2024), https://arxiv.org/abs/2405.12762.
    """
    started = time.perf_counter()
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.max_threads = 1
    settings.max_iter = ITERATIONS
    settings.direct_solve_method = "qdldl"
    tolerance, others = ROUTES[route]
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = tolerance
    for name, value in others.items():
        setattr(settings, name, value)
    rows, columns = program.matrix.shape
    scale = program.scale
    signed = columns - program.in_cones
    cones = [clarabel.SecondOrderConeT(program.size)] * len(program.friction)
    cones += [clarabel.NonnegativeConeT(signed)] if signed else []
    # By its rows, which the columns of the program are.
    states = sp.csc_matrix((program.matrix @ sp.diags_array(scale)).T)
    nothing = sp.csc_matrix((rows, rows))
    found = clarabel.DefaultSolver(nothing, -program.right, states, scale * program.cost, cones, settings).solve()
    x, y = scale * np.asarray(found.z), np.asarray(found.x)
    status = str(found.status)
    if status.endswith("PrimalInfeasible"):
        raise_if_proved(program, x)
        return None, "the dual seems infeasible, without proof"
    if status.endswith("DualInfeasible"):
        return None, "no x balances the rows"
    if not (np.isfinite(x).all() and np.isfinite(y).all()):
        return None, status
    return checked(program, x, y, route, int(found.iterations), time.perf_counter() - started), status
