"""Conic programs by linear ones: pyramids within the cones, and the rays that their motion asks for."""

from __future__ import annotations

import time
from itertools import product

import numpy as np
import scipy.sparse as sp

from solver.lp.problem import LinearProgram, SolveError, Unbounded
from solver.lp.solve import solve_lp

from .problem import ConicProgram, ConicSolution, checked, raise_if_proved

#: Rounds after which it is given up; walls take 10 to 25.
ROUNDS = 40

#: Rows up to which it is tried: 40 blocks take seconds, a hundred a minute.
ROWS = 600

#: A cone is left alone where the motion leaves its dual by less than this, over 1 + the largest multiplier.
INSIDE = 1e-9


def run_cuts(program: ConicProgram) -> tuple[ConicSolution | None, str]:
    """Solve a program by a sequence of linear programs.

    Parameters
    ----------
    program : ConicProgram

    Returns
    -------
    ConicSolution or None
        None where a linear program has none; its check is up to the caller.
    str
        What came of it.

    Raises
    ------
    Unbounded
        If a ray proves that the program has no minimum.

    Notes
    -----
    The unknowns are multipliers of rays of the cones, first those of a pyramid. Where the motion y of a program leaves
    the dual cone of N ≥ μ |T|, the ray against its T joins: the one whose reduced cost is least (Dantzig & Wolfe 1960,
    https://doi.org/10.1287/opre.8.1.101). All forces on the way are in the cones, so that the objective comes down to
    the optimum.
    """
    if len(program.right) > ROWS:
        return None, f"not tried for {len(program.right)} rows"
    started = time.perf_counter()
    k, size, n = len(program.friction), program.size, program.in_cones
    directions = np.array([d for d in product((-1.0, 0.0, 1.0), repeat=size - 1) if any(d)])
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    cone = np.repeat(np.arange(k), len(directions))
    rays = _rays(program, cone, np.tile(directions, (k, 1)))
    iterations, solution = 0, None
    for number in range(ROUNDS):
        columns = sp.csc_array(sp.block_diag([rays, sp.eye_array(len(program.cost) - n)], format="csc"))
        linear = LinearProgram(
            cost=columns.T @ program.cost,
            matrix=sp.csc_array(program.matrix @ columns),
            lower=program.right,
            upper=program.right,
        )
        try:
            found = solve_lp(linear)
        except Unbounded as ray:
            raise_if_proved(program, columns @ ray.x)
            return None, "a pyramid has no minimum, without proof"
        except SolveError as error:
            return None, f"round {number + 1}: {error}"
        iterations += found.iterations
        seconds = time.perf_counter() - started
        solution = checked(program, columns @ found.x, found.row_dual, "cuts", iterations, seconds)
        reduced = (program.cost - program.matrix.T @ found.row_dual)[:n].reshape(k, size)
        slip = np.linalg.norm(reduced[:, 1:], axis=1)
        inside = INSIDE * (1.0 + float(np.abs(found.row_dual).max(initial=0.0)))
        leaves = np.flatnonzero(program.friction * slip - reduced[:, 0] > inside * np.hypot(1.0, program.friction))
        if len(leaves) == 0:
            break
        rays = sp.csc_array(sp.hstack([rays, _rays(program, leaves, -reduced[leaves, 1:] / slip[leaves, None])]))
    return solution, f"{number + 1} rounds"


def _rays(program: ConicProgram, cone: np.ndarray, directions: np.ndarray) -> sp.csc_array:
    """(in_cones, n) array: a ray of each of the cones, (n,), whose T points into a direction, (n, size - 1)."""
    slope, size = program.friction[cone], program.size
    values = (
        np.concatenate([np.ones((len(cone), 1)), slope[:, None] * directions], axis=1) / np.hypot(1.0, slope)[:, None]
    )
    rows = size * cone[:, None] + np.arange(size)
    pointers = np.arange(0, size * len(cone) + 1, size)
    return sp.csc_array((values.ravel(), rows.ravel(), pointers), shape=(program.in_cones, len(cone)))
