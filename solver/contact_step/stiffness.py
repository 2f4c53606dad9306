"""How contact points act on the free blocks, and factors of their stiffness, which is a band."""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from functools import lru_cache

import numpy as np
import scipy.sparse as sp
from scipy.linalg import lapack

from solver.ordering import narrowest, positions_in

Solve = Callable[[np.ndarray], np.ndarray]


class Singular(ArithmeticError):
    """The matrix is not positive definite, by rounding."""


class Band:
    """Where the small matrices of contact points between pairs of blocks go in a symmetric band.

    Parameters
    ----------
    pairs : (n, 2) int array
        Numbers of the two blocks of each contact point; -1 for a support.
    places : (n_blocks, d) array, optional
        For the order of the blocks.
    n_blocks, dof : int

    Notes
    -----
    The band is stored as in LAPACK's ``pbtrf``, lower, by columns.
    """

    def __init__(self, pairs: np.ndarray, places: np.ndarray | None, n_blocks: int, dof: int) -> None:
        touching = pairs[(pairs >= 0).all(axis=1)]
        graph = sp.csr_array((np.ones(len(touching)), touching.T), shape=(n_blocks, n_blocks))
        order, width = narrowest(sp.csr_array(graph + graph.T + sp.eye_array(n_blocks)), places)
        self.order = (order[:, None] * dof + np.arange(dof)).ravel()
        positions = np.append(positions_in(order), -1)[pairs]
        self.shape = (n_blocks * dof, dof * width)
        rows = (positions[:, :, None] * dof + np.arange(dof)).reshape(len(pairs), 2 * dof)
        on_support = np.repeat(positions < 0, dof, axis=1)
        i, j = rows[:, :, None], rows[:, None, :]
        lower = (~on_support[:, :, None] & ~on_support[:, None, :] & (i >= j)).ravel()
        self.kept = np.flatnonzero(lower)
        self.entry = (j * self.shape[1] + i - j).ravel()[self.kept]

    def factorised(self, matrices: np.ndarray, diagonal: np.ndarray) -> Solve:
        """Factorise the sum of the points' matrices, (n, 2 dof, 2 dof), and a diagonal; gives what solves with it.

        Raises
        ------
        Singular
        """
        size, width = self.shape
        band = np.bincount(self.entry, matrices.ravel()[self.kept], size * width).reshape(self.shape).T
        # Blocks without contact need some stiffness.
        band[0] += diagonal[self.order] + 1e-14 * band[0].max()
        factor, bad = lapack.dpbtrf(band, lower=1, overwrite_ab=1)
        if bad:
            raise Singular(f"pivot {bad} of {size} is not positive")

        def solve(right: np.ndarray) -> np.ndarray:
            solution, _ = lapack.dpbtrs(factor, right[self.order], lower=1)
            out = np.empty_like(solution)
            out[self.order] = solution
            return out

        return solve


@lru_cache(maxsize=4)
def _band(pairs: bytes, places: bytes | None, n_blocks: int, dof: int) -> Band:
    of_blocks = None if places is None else np.frombuffer(places).reshape(n_blocks, -1)
    return Band(np.frombuffer(pairs, dtype=np.int64).reshape(-1, 2), of_blocks, n_blocks, dof)


class ContactRows:
    """What contact points do to the free blocks, and movements of the blocks to the contact points.

    Parameters
    ----------
    matrix : (dof n_blocks, d n) sparse array
        Of :func:`solver.equilibrium.wrench_matrix`.
    free : (n_blocks,) bool array
    places : (n_blocks, d) array, optional
        Of the blocks as drawn, for an order in which factors take less time.
    """

    def __init__(self, matrix: sp.csc_array, free: np.ndarray, places: np.ndarray | None = None) -> None:
        self.places = None if places is None else places[free].tobytes()
        dof = matrix.shape[0] // len(free)
        d = 2 if dof == 3 else 3
        n = matrix.shape[1] // d
        rows = matrix.indices.reshape(n, d, 2 * dof)[:, 0].astype(np.int64)
        number = np.append(np.where(free, np.cumsum(free) - 1, -1), -1)
        self.pairs = number[rows[:, [0, dof]] // dof]
        self.n_dof, self.dof, self.blocks = dof * int(free.sum()), dof, matrix.data.reshape(n, d, 2 * dof)
        self._assemble()

    def _assemble(self) -> None:
        """Put what the contact points do in a sparse matrix; supports have a last column of their own."""
        (n, d, both), dofs = self.blocks.shape, np.arange(self.dof)
        columns = np.where(self.pairs[:, :, None] < 0, self.n_dof, self.pairs[:, :, None] * self.dof + dofs)
        columns = np.repeat(columns.reshape(n, both), d, axis=0).ravel()
        starts = np.arange(n * d + 1) * both
        self.matrix = sp.csr_array((self.blocks.ravel(), columns, starts), shape=(n * d, self.n_dof + 1))
        self.transposed = self.matrix.T

    def __getitem__(self, chosen: np.ndarray) -> ContactRows:
        """Choose some of the contact points, by a mask or their numbers."""
        one = copy(self)
        one.pairs, one.blocks = self.pairs[chosen], self.blocks[chosen]
        one._assemble()
        return one

    def relative(self, motion: np.ndarray) -> np.ndarray:
        """(n, d) array: opening and slip of each contact point in a movement (n_dof,) of the free blocks."""
        return np.asarray(self.matrix @ np.append(motion, 0.0)).reshape(self.blocks.shape[:2])

    def resultant(self, forces: np.ndarray) -> np.ndarray:
        """(n_dof,) array: what forces (n, d) put on the free blocks."""
        return np.asarray(self.transposed @ forces.ravel())[:-1]

    def factorised(self, stiffness: np.ndarray, diagonal: np.ndarray) -> Solve:
        """Factorise the stiffness (n, d, d) of the contact points and a diagonal (n_dof,); gives what solves with it.

        Raises
        ------
        Singular
        """
        weighted = np.matmul(stiffness, self.blocks)
        pairs = self.pairs.astype(np.int64).tobytes()
        band = _band(pairs, self.places, self.n_dof // self.dof, self.dof)
        # Small products of arrays that do not lie in order take three times as long.
        each = np.matmul(np.ascontiguousarray(self.blocks.transpose(0, 2, 1)), weighted)
        return band.factorised(each, diagonal)
