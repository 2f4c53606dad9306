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

#: Where less than this part of the entries is other than zero, the others are left out.
SPARSE = 2.0 / 3.0

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
        self.rows = n_blocks * dof
        self.dense = self.rows <= DENSE
        touching = pairs[(pairs >= 0).all(axis=1)]
        order = np.arange(n_blocks) if self.dense else least_fill(touching[:, 0], touching[:, 1], n_blocks)
        self.order = (order[:, None] * dof + np.arange(dof)).ravel()
        place = np.empty(n_blocks + 1, dtype=np.int64)
        place[order], place[-1] = np.arange(n_blocks), -1
        placed = place[pairs]
        held = (placed[:, :, None] < 0) | (placed[:, None, :] < 0)
        # Small blocks of the matrix, column by column: of each contact point, and the diagonal.
        at = np.concatenate(
            [(placed[:, None, :] * n_blocks + placed[:, :, None])[~held], np.arange(n_blocks) * (n_blocks + 1)]
        )
        filled, number = (np.arange(n_blocks**2), at) if self.dense else np.unique(at, return_inverse=True)
        column, row = filled // n_blocks, filled % n_blocks
        high = np.bincount(column, minlength=n_blocks)
        above = np.cumsum(high) - high
        # Where the entries of a small block begin, and how far its columns are apart.
        first, apart = dof**2 * above[column] + dof * (np.arange(len(filled)) - above[column]), dof * high[column]
        freedom = np.arange(dof)
        entry = first[:, None, None] + freedom[:, None] + apart[:, None, None] * freedom
        self.entries = entry.size
        indices = np.empty(self.entries, dtype=np.int32)
        indices[entry] = (row[:, None] * dof + freedom)[:, :, None]
        pointers = np.append(dof**2 * above[:, None] + dof * high[:, None] * freedom, self.entries).astype(np.int32)
        # Its numbers are put in anew for each factorisation.
        self.matrix = sp.csc_array((np.zeros(self.entries), indices, pointers), shape=(self.rows, self.rows))
        # What has no freedom goes beyond the last.
        numbers = np.full((*held.shape, dof, dof), self.entries)
        numbers[~held] = entry[number[: len(number) - n_blocks]]
        self.number = numbers.swapaxes(2, 3).ravel()
        self.diagonal = np.einsum("bii->bi", entry[number[len(number) - n_blocks :]]).ravel()

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
        if self.dense:
            columns = values.reshape(self.rows, self.rows).T
            factors, pivots, singular = sla.lapack.dgetrf(columns, overwrite_a=True)
            if singular:
                raise Singular(f"no pivot is left in row {singular}")
            return lambda right: np.asarray(sla.lapack.dgetrs(factors, pivots, right)[0])
        matrix = self.matrix
        matrix.data = values
        how = "NATURAL"
        if np.count_nonzero(values) < SPARSE * self.entries:
            # Of joints that are open nothing is left: their factors fill in less, in an order of their own.
            matrix = matrix.copy()
            matrix.eliminate_zeros()
            how = "MMD_AT_PLUS_A"
        try:
            factor = spl.splu(
                matrix, permc_spec=how, diag_pivot_thresh=PIVOT, options={"SymmetricMode": True, "Equil": False}
            )
        except RuntimeError as error:
            raise Singular(str(error)) from None

        def solve(right: np.ndarray) -> np.ndarray:
            solution = np.empty(self.rows)
            solution[self.order] = factor.solve(right[self.order])
            return solution

        return solve


@lru_cache(maxsize=2)
def _coupling(pairs: bytes, dtype: str, n_blocks: int, dof: int) -> Coupling:
    return Coupling(np.frombuffer(pairs, dtype=dtype).reshape(-1, 2), n_blocks, dof)


def coupling(pairs: np.ndarray, n_blocks: int, dof: int) -> Coupling:
    """The :class:`Coupling` of contact points; of the same pairs of blocks as of late the same one."""
    return _coupling(pairs.tobytes(), str(pairs.dtype), n_blocks, dof)
