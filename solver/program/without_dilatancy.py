"""The program of non-associative flow: the friction cones with the normal forces of the program before in them."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from solver.programs.problem import Solution
from solver.programs.solve import solve_between

#: Cost of unbalanced force, in multipliers, above that of any mechanism.
UNBALANCED_COST = 1e3


def solve_without_dilatancy(
    matrix: sp.csr_array,
    dead: np.ndarray,
    live: np.ndarray,
    tolerance: np.ndarray,
    bound: np.ndarray,
    crushing: np.ndarray,
    normal_cost: np.ndarray,
    normal: np.ndarray,
    change_cost: np.ndarray,
) -> tuple[np.ndarray, float, float, Solution]:
    """Maximise α with |T| ≤ B; where changes cost, take of equal α the normal forces nearest to N⁰.

    Parameters
    ----------
    matrix : (m, d n) sparse array
        Forces and moments on the free blocks from the d forces of each of n contact points.
    dead, live, tolerance : (m,) arrays
        Loads, and largest unbalanced force, in the plane.
    bound, crushing, normal_cost : (n,) arrays
        B and largest normal force of each contact point, and cost of a unit of normal force, in multipliers.
    normal : (n,) array
        N⁰.
    change_cost : (n,) array
        Cost of a change of each normal force, in multipliers.

    Returns
    -------
    forces : (n, d) array
    multiplier, unbalanced : float
        α, and the largest unbalanced force.
    solution : Solution

    Notes
    -----
    Columns: the shear forces, N, p, m, α and unbalanced forces, with N - N⁰ = p - m, and a row N for each point that
    may crush. In the plane T = (u - v) / 2 of columns u + v = 2 B; in space the disc |T| ≤ B is the cone |T| ≤ B s with
    s = 1.
    """
    n, rows = len(normal), len(dead)
    size = matrix.shape[1] // n
    brittle = np.flatnonzero(np.isfinite(crushing))
    identity, eye = sp.identity(rows, format="csr"), sp.identity(n, format="csr")
    if size == 2:
        half = sp.diags_array(np.full(n, 0.5))
        shears = sp.hstack([half, -half])
        to_shear = matrix[:, 1::2] @ shears
        level, bound_of_rows, slopes, slack = sp.hstack([eye, eye]), 2.0 * bound, np.zeros(0), tolerance
    else:
        disc = np.ones((n, size)) * bound[:, None]
        disc[:, 0] = 0.0
        shears = sp.diags_array(disc.ravel())
        to_shear = matrix @ shears
        level = sp.csr_array((np.ones(n), (np.arange(n), size * np.arange(n))), shape=(n, size * n))
        bound_of_rows, slopes, slack = np.ones(n), np.ones(n), np.zeros(rows)
    first = shears.shape[1]
    blocks = [
        [to_shear, matrix[:, 0::size], None, None, sp.csr_array(live[:, None]), identity, -identity],
        [level, None, None, None, None, None, None],
        [None, eye, -eye, eye, None, None, None],
        [None, sp.csr_array(eye)[brittle], None, None, None, None, None],
    ]
    costs = np.concatenate(
        [np.zeros(first), normal_cost, change_cost, change_cost, [-1.0], np.full(2 * rows, UNBALANCED_COST)]
    )
    solution = solve_between(
        costs,
        sp.csc_array(sp.block_array(blocks, format="csc")),
        np.concatenate([-dead - slack, bound_of_rows, normal, np.zeros(len(brittle))]),
        np.concatenate([-dead + slack, bound_of_rows, normal, crushing[brittle]]),
        slopes,
        size,
    )
    x = solution.x
    forces = (shears @ x[:first]).reshape(n, -1)
    forces = np.column_stack([x[first : first + n], forces[:, int(size > 2) :]])
    multiplier = first + 3 * n
    unbalanced = x[multiplier + 1 : multiplier + 1 + 2 * rows]
    return forces, float(x[multiplier]), float(unbalanced.max(initial=0.0)), solution
