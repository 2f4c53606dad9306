"""Factors of a stiffness that pairs of blocks make up: of a band, or by fronts where the band is wide."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

import numpy as np
import scipy.sparse as sp
from scipy.linalg import blas, lapack

from solver.ordering import dissected, narrowest

Solve = Callable[[np.ndarray], np.ndarray]

#: Rows of a band that is factorised; fronts take less time than wider ones.
WIDE = 300

#: Part of the largest diagonal entry that blocks without contact need for a stiffness.
ALONE = 1e-14


class NotSolved(Exception):
    """The minimum of a step's program was not found, or its matrix is not positive definite, by rounding."""

    #: Movement in block sizes of a step that was too long; 0 where that is not why.
    moved = 0.0


@lru_cache(maxsize=4)
def factorisation(between: bytes, at: bytes | None, n_blocks: int, dof: int) -> Band | Fronts:
    """Choose how to factorise what acts between pairs of blocks, (n, 2) int array with -1 for a support, at places."""
    pairs = np.frombuffer(between, dtype=np.int64).reshape(-1, 2)
    places = None if at is None else np.frombuffer(at).reshape(n_blocks, -1)
    touching = pairs[(pairs >= 0).all(axis=1)]
    graph = sp.csr_array((np.ones(len(touching)), touching.T), shape=(n_blocks, n_blocks))
    joined = sp.csr_array(graph + graph.T + sp.eye_array(n_blocks))
    order, width = narrowest(joined, places)
    return Fronts(pairs, joined, places, dof) if dof * width > WIDE else Band(pairs, order, dof * width, dof)


class Band:
    """A symmetric band, stored as in LAPACK's ``pbtrf``, lower, by columns; its order and width are given."""

    def __init__(self, pairs: np.ndarray, order: np.ndarray, width: int, dof: int) -> None:
        self.order = (order[:, None] * dof + np.arange(dof)).ravel()
        positions = np.append(np.argsort(order), -1)[pairs]
        self.shape = (len(order) * dof, width)
        rows = np.where(positions[:, :, None] < 0, -1, positions[:, :, None] * dof + np.arange(dof))
        rows = rows.reshape(len(pairs), 2 * dof)
        i, j = (rows[:, of] for of in np.triu_indices(2 * dof))
        first = np.minimum(i, j)
        # What acts on supports is put behind the band.
        self.entry = np.where(first < 0, len(order) * dof * width, first * width + np.abs(i - j)).ravel()

    def factorised(self, matrices: np.ndarray, diagonal: np.ndarray) -> Solve:
        """Factorise the sum of the pairs' matrices, lower triangles by columns, and a diagonal; what solves."""
        size, width = self.shape
        band = np.bincount(self.entry, matrices.ravel(), size * width + 1)[:-1].reshape(self.shape).T
        band[0] += diagonal[self.order] + ALONE * band[0].max()
        factor, bad = lapack.dpbtrf(band, lower=1, overwrite_ab=1)
        if bad:
            raise NotSolved(f"pivot {bad} of {size} is not positive")

        def solve(right: np.ndarray) -> np.ndarray:
            solution, _ = lapack.dpbtrs(factor, right[self.order], lower=1)
            out = np.empty_like(solution)
            out[self.order] = solution
            return out

        return solve


@dataclass(frozen=True)
class Front:
    """Rows that are eliminated together, and those beyond them that they act on."""

    own: slice
    beyond: np.ndarray  #: (n,) int
    #: Where its matrices begin among those of all fronts: (own, own), and (beyond, own) after it, by columns.
    start: int
    into: int  #: the front that gets what is left between the rows beyond, -1 for the last
    #: Parts of what is left, and where they go there: in the first of its matrices, the second, or what it leaves.
    parts: list[tuple[int, tuple[slice, slice], tuple[slice, slice]]]

    def matrices(self, values: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Its two matrices in an array of all, and one of zeros for what it leaves."""
        own, beyond = self.own.stop - self.own.start, len(self.beyond)
        middle, end = self.start + own * own, self.start + own * (own + beyond)
        between, across = values[self.start : middle].reshape(own, own), values[middle:end].reshape(own, beyond)
        return between.T, across.T, np.zeros((beyond, beyond)).T


class Fronts:
    """Cholesky's factorisation by dense matrices of parts of a structure, and of the cuts between them.

    Multifrontal: Duff & Reid (1983), https://doi.org/10.1145/356044.356047.
    """

    def __init__(self, pairs: np.ndarray, joined: sp.csr_array, places: np.ndarray | None, dof: int) -> None:
        parts = dissected(joined, places)
        order, sizes = np.concatenate([blocks for blocks, _ in parts]), np.array([len(blocks) for blocks, _ in parts])
        ends, axes = np.cumsum(sizes), np.arange(dof)
        first, position, beyond = ends - sizes, np.argsort(order), _beyond(parts, joined)
        n, m = sizes * dof, np.array([len(blocks) for blocks in beyond]) * dof
        starts = np.append(0, np.cumsum(n * (n + m)))
        self.order, self.size = (order[:, None] * dof + axes).ravel(), int(starts[-1])
        self.diagonal = np.concatenate([at + np.arange(k) * (k + 1) for at, k in zip(starts[:-1], n, strict=True)])
        self.fronts = [
            Front(
                own=slice(int(first[k]) * dof, int(ends[k]) * dof),
                beyond=(beyond[k][:, None] * dof + axes).ravel(),
                start=int(starts[k]),
                into=into,
                parts=_parts(beyond[k], int(first[into]), int(ends[into]), beyond[into], dof) if into >= 0 else [],
            )
            for k, (_, into) in enumerate(parts)
        ]
        # Of each pair, what acts on the two blocks themselves, and on the later one by the earlier.
        rows = np.append(position, -1)[pairs]
        front, every = np.repeat(np.arange(len(parts)), sizes), len(order)
        keys, shift = np.concatenate([k * every + blocks for k, blocks in enumerate(beyond)]), np.cumsum(m) - m
        entries, kept = [], []
        upper, number = np.triu_indices(2 * dof), np.zeros((2 * dof, 2 * dof), dtype=np.int64)
        number[upper] = number[upper[::-1]] = np.arange(len(upper[0]))
        for a, b in ((0, 0), (1, 1), (0, 1), (1, 0)):
            of = np.flatnonzero((rows.min(axis=1) >= 0) & (rows[:, a] > rows[:, b]) if a != b else rows[:, a] >= 0)
            i, j = rows[of, a], rows[of, b]
            k = front[j]
            inside = i < ends[k]
            outside = n[k] ** 2 + np.searchsorted(keys, k * every + i) * dof - shift[k]
            high = np.where(inside, n[k], m[k])[:, None, None]
            at = starts[k] + np.where(inside, (i - first[k]) * dof, outside)
            entries.append(
                at[:, None, None] + axes[:, None] + ((j - first[k]) * dof)[:, None, None] * high + axes * high
            )
            kept.append(of[:, None, None] * len(upper[0]) + number[a * dof : (a + 1) * dof, b * dof : (b + 1) * dof])
        self.entry, self.kept = (np.concatenate([of.ravel() for of in all_of]) for all_of in (entries, kept))

    def factorised(self, matrices: np.ndarray, diagonal: np.ndarray) -> Solve:
        """Factorise as a band does."""
        values = np.bincount(self.entry, matrices.ravel()[self.kept], self.size)
        values[self.diagonal] += diagonal[self.order] + ALONE * values[self.diagonal].max()
        arrived: list[list[tuple[Front, np.ndarray]]] = [[] for _ in self.fronts]
        factors = []
        for k, front in enumerate(self.fronts):
            own, across, left = into = front.matrices(values)
            for before, of_before in arrived[k]:
                for target, where, which in before.parts:
                    into[target][where] += of_before[which]
            arrived[k] = []
            if len(own):
                own, bad = lapack.dpotrf(own, lower=1, clean=0, overwrite_a=1)
                if bad:
                    raise NotSolved(f"pivot {front.own.start + bad} of {len(self.order)} is not positive")
            if across.size:
                across = blas.dtrsm(1.0, own, across, side=1, lower=1, trans_a=1, overwrite_b=1)
                left = blas.dsyrk(-1.0, across, lower=1, beta=1.0, c=left, overwrite_c=1)
            arrived[front.into].append((front, left))
            factors.append((front.own, front.beyond, own, across))

        def solve(right: np.ndarray) -> np.ndarray:
            x = right[self.order]
            for own, beyond, factor, across in factors:
                if len(factor):
                    x[own] = blas.dtrsv(factor, x[own], lower=1)
                    x[beyond] -= across @ x[own]
            for own, beyond, factor, across in reversed(factors):
                if len(factor):
                    x[own] = blas.dtrsv(factor, x[own] - x[beyond] @ across, lower=1, trans=1)
            out = np.empty_like(x)
            out[self.order] = x
            return out

        return solve


def _beyond(parts: list[tuple[np.ndarray, int]], joined: sp.csr_array) -> list[np.ndarray]:
    """Of each part the places, in the order of all, of later blocks that it acts on once those before it are gone."""
    position, end = np.argsort(np.concatenate([blocks for blocks, _ in parts])), 0
    found: list[np.ndarray] = []
    left: list[list[np.ndarray]] = [[] for _ in parts]
    for k, (blocks, into) in enumerate(parts):
        end += len(blocks)
        near = np.unique(np.concatenate([position[joined[blocks].indices], *left[k]]))
        found.append(near[near >= end])
        left[into].append(found[-1])
    return found


def _parts(
    left: np.ndarray, first: int, end: int, beyond: np.ndarray, dof: int
) -> list[tuple[int, tuple[slice, slice], tuple[slice, slice]]]:
    """Where the lower half of what is left goes in the front of the blocks from first to end, by runs of blocks."""
    own = end - first
    places = np.where(left < end, left - first, own + np.searchsorted(beyond, left))
    cuts = np.flatnonzero((np.diff(places) != 1) | (places[1:] == own)) + 1
    runs = list(pairwise([0, *cuts.tolist(), len(left)])) if len(left) else []

    def there(a: int, b: int, *, inside: bool) -> slice:
        at = int(places[a]) - (0 if inside else own)
        return slice(at * dof, (at + b - a) * dof)

    parts = []
    for k, (a, b) in enumerate(runs):
        for c, d in runs[: k + 1]:
            rows_own, columns_own = bool(places[a] < own), bool(places[c] < own)
            where = (there(a, b, inside=rows_own), there(c, d, inside=columns_own))
            which = (slice(a * dof, b * dof), slice(c * dof, d * dof))
            parts.append((2 - rows_own - columns_own, where, which))
    return parts
