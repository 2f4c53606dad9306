"""How contact points act on the free blocks, and factors of their stiffness."""

from __future__ import annotations

from copy import copy
from functools import lru_cache

import numpy as np
import scipy.sparse as sp

from solver.contact_step.factors import Solve, factorisation


@lru_cache(maxsize=4)
def _over_pairs(pairs: bytes) -> tuple[sp.csr_array, bytes]:
    """Give what sums over the points of each pair of blocks, and the pairs."""
    of_points = np.frombuffer(pairs, dtype=np.int64).reshape(-1, 2)
    points = np.arange(len(of_points))
    # One number for each pair sorts faster than two.
    keys = of_points @ [of_points.max(initial=0) + 2, 1]
    _, first, pair = np.unique(keys, return_index=True, return_inverse=True)
    sums = sp.csr_array((np.ones(len(points)), (pair, points)), shape=(len(first), len(points)))
    return sums, of_points[first].tobytes()


class ContactRows:
    """What contact points do to the free blocks, (n_blocks,) bool, and movements of the blocks to the contact points.

    The matrix is that of :func:`solver.equilibrium.wrench_matrix`; places, (n_blocks, d), are those of the blocks as
    drawn, for an order in which factors take less time.
    """

    def __init__(self, matrix: sp.csc_array, free: np.ndarray, places: np.ndarray | None = None) -> None:
        self.places = None if places is None else places[free].tobytes()
        dof = matrix.shape[0] // len(free)
        d = 2 if dof == 3 else 3
        n = matrix.shape[1] // d
        rows = matrix.indices.reshape(n, d, 2 * dof)[:, 0].astype(np.int64)
        number = np.append(np.where(free, np.cumsum(free) - 1, -1), -1)
        pairs, blocks = number[rows[:, [0, dof]] // dof], matrix.data.reshape(n, d, 2, dof)
        # Whose corner it is does not matter here; pairs that stay the same need no new order.
        turned = pairs[:, 0] > pairs[:, 1]
        self.pairs = np.where(turned[:, None], pairs[:, ::-1], pairs)
        blocks = np.where(turned[:, None, None, None], blocks[:, :, ::-1], blocks)
        self.n_dof, self.dof, self.blocks = dof * int(free.sum()), dof, blocks.reshape(n, d, 2 * dof)
        self._assemble()

    def _assemble(self) -> None:
        """Put what the contact points do in a sparse matrix; supports have a last column of their own."""
        (n, d, both), dofs = self.blocks.shape, np.arange(self.dof)
        columns = np.where(self.pairs[:, :, None] < 0, self.n_dof, self.pairs[:, :, None] * self.dof + dofs)
        columns = np.repeat(columns.reshape(n, both), d, axis=0).ravel()
        starts = np.arange(n * d + 1) * both
        self.matrix = sp.csr_array((self.blocks.ravel(), columns, starts), shape=(n * d, self.n_dof + 1))
        self.transposed = self.matrix.T
        # Products of arrays with the points last, which lie in order, take a quarter of the time.
        self.of_points = np.ascontiguousarray(self.blocks.transpose(1, 2, 0))
        self.key = self.pairs.astype(np.int64).tobytes()

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
        """Factorise a stiffness (n, d, d) of the points and a diagonal (n_dof,): what solves; raises ``NotSolved``."""
        rows, both, n = self.of_points, 2 * self.dof, len(stiffness)
        weighted = np.einsum("ijn,jcn->icn", np.ascontiguousarray(stiffness.transpose(1, 2, 0)), rows)
        # The lower triangle of each point's matrix, by columns.
        each = np.empty((both * (both + 1) // 2, n))
        for c, at in enumerate(np.cumsum(np.arange(both, 0, -1)) - np.arange(both, 0, -1)):
            np.einsum("in,irn->rn", rows[:, c], weighted[:, c:], out=each[at : at + both - c])
        sums, pairs = _over_pairs(self.key)
        of_pairs = factorisation(pairs, self.places, self.n_dof // self.dof, self.dof)
        return of_pairs.factorised(sums @ each.T, diagonal)
