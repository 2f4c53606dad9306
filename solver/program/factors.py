"""A matrix of small square blocks, one for each pair of the structure's blocks that touch, and what solves with it."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import numpy as np
import scipy.linalg as sla
import scipy.sparse as sp
import scipy.sparse.linalg as spl

from solver.lp.fill import least_fill

#: Up to so many rows a dense factorisation is the faster.
DENSE = 150

#: A pivot on the diagonal is kept down to this part of the largest in its column.
PIVOT = 0.01

Solve = Callable[[np.ndarray], np.ndarray]


class Singular(Exception):
    """The matrix has no inverse."""


class Coupling:
    """Where the entries of contact points between pairs of blocks go: worked out once, for many factorisations.

    Parameters
    ----------
    pairs : (n, 2) int array
        Numbers of the two blocks of each contact point; -1 for one that has no freedom.
    n_blocks : int
    dof : int
        Freedoms of a block: its rows are those from ``dof`` times its number on.

    Notes
    -----
    The pattern is symmetric, the values are not. The blocks are put in an order of minimum degree once; the pivots then
    stay near the diagonal.
    """

    def __init__(self, pairs: np.ndarray, n_blocks: int, dof: int) -> None:
        self.rows = rows = n_blocks * dof
        self.dense = rows <= DENSE
        order = np.arange(n_blocks) if self.dense else _least_fill(pairs.tobytes(), str(pairs.dtype), n_blocks)
        self.order = (order[:, None] * dof + np.arange(dof)).ravel()
        place = np.empty(n_blocks + 1, dtype=np.int64)
        # What has no freedom goes into a column beyond the last.
        place[order], place[-1] = np.arange(n_blocks), -rows * rows
        freedoms = (place[pairs][:, :, None] * dof + np.arange(dof)).reshape(len(pairs), -1)
        at = freedoms[:, None, :] * rows + freedoms[:, :, None]
        held = at < 0
        diagonal = np.arange(rows) * (rows + 1)
        filled, number = np.unique(np.concatenate([at[~held], diagonal]), return_inverse=True)
        self.entries = rows * rows if self.dense else len(filled)
        numbered = filled[number] if self.dense else number
        self.number = np.full(at.shape, self.entries)
        self.number[~held] = numbered[: -rows or None]
        self.number = self.number.ravel()
        self.diagonal = numbered[len(numbered) - rows :]
        self.indices = (filled % rows).astype(np.int32)
        self.pointers = np.searchsorted(filled, np.arange(rows + 1) * rows).astype(np.int32)

    def factorised(self, each: np.ndarray, diagonal: np.ndarray) -> Solve:
        """Factorise a sum of contact points' matrices and a diagonal; gives what solves with it.

        Parameters
        ----------
        each : (n, 2 dof, 2 dof) array
            Rows and columns of the first block, then of the second.
        diagonal : (n_blocks * dof,) array

        Raises
        ------
        Singular
        """
        values = np.bincount(self.number, each.ravel(), self.entries + 1)[:-1]
        values[self.diagonal] += diagonal[self.order]
        shape = (self.rows, self.rows)
        if self.dense:
            factors, pivots, _ = sla.lapack.dgetrf(values.reshape(shape).T, overwrite_a=True)
            return lambda right: np.asarray(sla.lapack.dgetrs(factors, pivots, right)[0])
        matrix = sp.csc_array((values, self.indices, self.pointers), shape=shape)
        try:
            factor = spl.splu(
                matrix, permc_spec="NATURAL", diag_pivot_thresh=PIVOT, options={"SymmetricMode": True, "Equil": False}
            )
        except RuntimeError as error:
            raise Singular(str(error)) from None

        def solve(right: np.ndarray) -> np.ndarray:
            solution = np.empty(self.rows)
            solution[self.order] = factor.solve(right[self.order])
            return solution

        return solve


@lru_cache(maxsize=8)
def _least_fill(pairs: bytes, dtype: str, n_blocks: int) -> np.ndarray:
    """(n_blocks,) array: order of the blocks by minimum degree of who touches whom."""
    touching = np.frombuffer(pairs, dtype=dtype).reshape(-1, 2)
    touching = touching[(touching >= 0).all(axis=1)]
    return least_fill(touching[:, 0], touching[:, 1], n_blocks)
