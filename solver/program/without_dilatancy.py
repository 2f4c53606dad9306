"""The program of non-associative flow: the friction cones with normal forces of the programs before in them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from solver.programs.problem import Solution
from solver.programs.solve import solve_between

#: Cost of unbalanced force, in multipliers: far above that of any real mechanism.
UNBALANCED_COST = 1e3


@dataclass(frozen=True)
class Found:
    """What the program found, in its units.

    Attributes
    ----------
    forces : (n, d) array
    multiplier : float
    constant : (n,) array
        The shear force that each point has whatever its normal force is.
    unbalanced : float
        Largest unbalanced force.
    solution : Solution
    """

    forces: np.ndarray
    multiplier: float
    constant: np.ndarray
    unbalanced: float
    solution: Solution


def solve_without_dilatancy(
    matrix: sp.csr_array,
    dead: np.ndarray,
    live: np.ndarray,
    left: np.ndarray,
    friction: np.ndarray,
    cohesion: np.ndarray,
    crushing: np.ndarray,
    price: np.ndarray,
    normal: np.ndarray,
    dilatancy: np.ndarray,
    change_cost: float,
) -> Found:
    """Maximise α with |T| ≤ c + μ N⁰ + ψ (N - N⁰); where changes cost, take of equal α the forces nearest to N⁰.

    Parameters
    ----------
    matrix : (m, d n) sparse array
        Forces and moments on the free blocks from the d forces of each of n contact points.
    dead, live, left : (m,) arrays
        Loads, and what may stay out of balance, in the plane.
    friction, cohesion, crushing, price : (n,) arrays
        Of each contact point; the price is that of a unit of normal force, in multipliers.
    normal : (n,) array
        N⁰.
    dilatancy : (n,) array
        ψ.
    change_cost : float
        Of a change of a normal force, in multipliers.

    Notes
    -----
    In the plane columns N, u, v, then p, m, α and unbalanced forces: T = (u - v) / 2, u + v = 2 (k + ψ N) with the
    constant k = c + (μ - ψ) N⁰, N - N⁰ = p - m, and a row N for each point that may crush. In space T is the sum of one
    in the cone |T| ≤ ψ N and of one in the disc |T| ≤ k, which is the cone |T| ≤ k s with s = 1.
    """
    n, rows = len(normal), len(dead)
    size = matrix.shape[1] // n
    constant = cohesion + (friction - dilatancy) * normal
    brittle = np.flatnonzero(np.isfinite(crushing))
    identity, eye = sp.identity(rows, format="csr"), sp.identity(n, format="csr")
    column = sp.csr_array(live[:, None])
    by_point = sp.csr_array(eye)
    if size == 2:
        a_normal, a_shear = matrix[:, 0::2], matrix[:, 1::2]
        balance = [a_normal, a_shear / 2.0, -a_shear / 2.0, None, None, column, identity, -identity]
        cone = [sp.diags_array(-2.0 * dilatancy), eye, eye, None, None, None, None, None]
        change = [eye, None, None, -eye, eye, None, None, None]
        crush = [by_point[brittle], None, None, None, None, None, None, None]
        cost, right, slopes, off = [price, np.zeros(2 * n)], 2.0 * constant, np.zeros(0), left
    else:
        first = sp.csr_array((np.ones(n), (np.arange(n), size * np.arange(n))), shape=(n, size * n))
        shear = np.ones((n, size))
        shear[:, 0] = 0.0
        in_disc = sp.diags_array((shear * constant[:, None]).ravel())
        balance = [matrix, matrix @ in_disc, None, None, column, identity, -identity]
        cone = [None, first, None, None, None, None, None]
        change = [first, None, -eye, eye, None, None, None]
        crush = [first[brittle], None, None, None, None, None, None]
        # The disc of a point is the cone of slope 1 whose first number is 1.
        cost, right, slopes = [first.T @ price, np.zeros(size * n)], np.ones(n), np.concatenate([dilatancy, np.ones(n)])
        off = np.zeros(rows)
    costs = np.concatenate([*cost, np.full(2 * n, change_cost), [-1.0], np.full(2 * rows, UNBALANCED_COST)])
    solution = solve_between(
        costs,
        sp.csc_array(sp.block_array([balance, cone, change, crush], format="csc")),
        np.concatenate([-dead - off, right, normal, np.zeros(len(brittle))]),
        np.concatenate([-dead + off, right, normal, crushing[brittle]]),
        slopes,
        size,
    )
    x = solution.x[: len(costs)]
    if size == 2:
        forces = np.stack([x[:n], (x[n : 2 * n] - x[2 * n : 3 * n]) / 2.0], axis=1)
    else:
        forces = (x[: size * n] + in_disc @ x[size * n : 2 * size * n]).reshape(n, size)
    level = len(x) - 2 * rows - 1
    return Found(forces, float(x[level]), constant, float(x[level + 1 :].max(initial=0.0)), solution)
