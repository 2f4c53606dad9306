"""Light blocks: a second program in which blocks too light to be seen among the others are in balance, too."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.sparse as sp

from solver.lp.problem import LinearProgram, LPSolution, SolveError, Unbounded
from solver.lp.solve import solve_lp
from solver.tolerances import LIGHT_BALANCE, LIGHTEST, ROUNDED_OFF

from .model import Model


def light_blocks(model: Model) -> np.ndarray:
    """(n_free,) bool array: the free blocks that are too light to be seen among the others."""
    weight, size = _weights_and_sizes(model)
    return (weight > 0.0) & (weight * size < LIGHTEST * model.total_load)


def _weights_and_sizes(model: Model) -> tuple[np.ndarray, np.ndarray]:
    """(n_free,) arrays in units of the program: load of each free block, and its size, at most 1."""
    free = model.assembly.free
    weight = np.abs(model.scaled_load[free, :2]).max(axis=1, initial=0.0)
    return weight, np.minimum(np.sqrt(model.assembly.areas[free]) / model.length, 1.0)


def with_light_blocks(
    model: Model,
    program: LinearProgram,
    solution: LPSolution,
    light: np.ndarray,
    balance: sp.csc_array,
    falls: np.ndarray,
) -> tuple[LPSolution, np.ndarray]:
    """The solution in which light blocks are in balance, too, or fall; and from which unbalanced force on, per row.

    Parameters
    ----------
    model : Model
    program : LinearProgram
    solution : LPSolution
        As far as the others are concerned.
    light : (n_free,) bool array
    balance : (rows, n) sparse array
        The columns of the contact points.
    falls : (rows,) array
        Unbalanced force that counts as falling where all blocks weigh enough.

    Notes
    -----
    Rows of light blocks are divided by their weight, rows of moments by weight times size, and their unbalanced forces
    are counted in it. In double precision a block that carries far more than its weight cannot be in balance to a part
    of that weight; then what it carries is the unit. Where even that has no solution, the given one stands.
    """
    rows, n = balance.shape
    weight, size = _weights_and_sizes(model)
    carried = (abs(balance) @ solution.x[:n]).reshape(-1, 3).max(axis=1)
    unit = np.where(light, np.minimum(np.maximum(weight, ROUNDED_OFF * carried), 1.0), 1.0)
    own = np.repeat(unit, 3)
    own[2::3] *= np.where(light, size, 1.0)
    factor = np.ones(program.matrix.shape[1])
    factor[n : n + 2 * rows] = np.tile(own, 2)
    middle, half = (program.lower + program.upper) / 2.0, (program.upper - program.lower) / 2.0
    half = np.where(np.repeat(light, 3), np.minimum(half, LIGHT_BALANCE * own), half)
    scaled = LinearProgram(
        cost=program.cost * factor,
        matrix=sp.csc_array(sp.diags_array(1.0 / own) @ program.matrix @ sp.diags_array(factor)),
        lower=(middle - half) / own,
        upper=(middle + half) / own,
        places=program.places,
    )
    try:
        found = solve_lp(scaled)
    except (Unbounded, SolveError):
        return solution, falls
    falls = np.where(np.repeat(light, 3), np.minimum(falls, 5.0 * half), falls)
    return replace(found, x=found.x * factor, row_dual=found.row_dual / own), falls
