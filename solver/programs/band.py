"""An interior point method for programs whose rows form a narrow band: the blocks of a wall, one beside the other."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp
from scipy.linalg import lapack

from solver.ordering import narrowest
from solver.tolerances import ACCEPTED_ERROR, INTERIOR_TOLERANCE

from .problem import LinearProgram, Solution, Unbounded
from .threads import one_thread

#: Iterations at most: walls of 6,500 blocks take 90.
ITERATIONS = 200

#: Largest number of operations of a factorisation, rows times the square of the width: 2e9 for walls of 10,000 blocks.
OPERATIONS = 1e10

#: Columns with more entries than the first number, such as a load on every block, would fill the band: they are cut
#: into pieces of as many rows as the second.
WIDE, PIECE = 64, 12

#: Forces, in block weights, and multipliers to start from: from smaller ones walls take up to twenty iterations more.
FORCE, MULTIPLIER = 3.0, 0.1

#: Weight of the proximal term, without which rounding of the final iterates leaves blocks out of balance by 1e-6.
PROXIMAL = 1e-11


class NoProgress(Exception):
    """The method does not apply, or came to no solution."""


@dataclass(frozen=True)
class _Point:
    """An iterate, or its change: x, then the distances of rows from their lower and upper bounds; and multipliers."""

    primal: np.ndarray
    dual: np.ndarray
    row_dual: np.ndarray

    def moved(self, step: _Point, primal: float, dual: float) -> _Point:
        return _Point(
            self.primal + primal * step.primal, self.dual + dual * step.dual, self.row_dual + dual * step.row_dual
        )


class _Band:
    """A D Aᵀ for a fixed A beside an identity, in an order that keeps it near the diagonal; and its factor."""

    def __init__(self, matrix: sp.csc_array, places: np.ndarray | None) -> None:
        rows, columns = matrix.shape
        of_column = np.repeat(np.arange(columns), np.diff(matrix.indptr))
        # Rows of one column bound that column. They are eliminated, and widen no band.
        alone = np.flatnonzero(np.bincount(matrix.indices)[matrix.indices] == 1)
        alone = alone[np.unique(of_column[alone], return_index=True)[1]]
        self.bounding, self.bounded, self.slope = matrix.indices[alone], of_column[alone], matrix.data[alone]
        self.unit = columns + self.bounding
        self.kept = np.delete(np.arange(rows), self.bounding)
        if not len(self.kept):
            raise NoProgress("every row bounds one column")
        matrix = sp.csc_array(sp.csr_array(sp.hstack([matrix, sp.eye_array(rows)]))[self.kept])
        self.beside = matrix[:, self.bounded]
        places = None if places is None else places[self.kept]
        self.rows, counts = len(self.kept), np.diff(matrix.indptr)
        # Each column is as wide as it has entries, at least: a load on every block fills the matrix.
        self._refuse_wide(int(counts.max(initial=0)))
        self.order, self.width = narrowest(_joined(matrix), places)
        self._refuse_wide(self.width)
        position = np.argsort(self.order)
        slots, weights, columns, pairs = [], [], [], []
        for count in np.unique(counts[counts > 0]):
            members = np.flatnonzero(counts == count)
            entries = matrix.indptr[members][:, None] + np.arange(count)
            row, value = position[matrix.indices[entries]], matrix.data[entries]
            first, second = np.tril_indices(count)
            i, j = np.maximum(row[:, first], row[:, second]), np.minimum(row[:, first], row[:, second])
            slots.append((j * self.width + i - j).ravel())
            weights.append((value[:, first] * value[:, second]).ravel())
            columns.append(members)
            pairs.append(np.full(len(members), len(first)))
        self.columns, slot = np.concatenate(columns), np.concatenate(slots)
        number = np.zeros(self.rows * self.width, dtype=np.int32)
        number[slot] = 1
        self.filled = np.flatnonzero(number)
        number[self.filled] = np.arange(len(self.filled))
        # By columns, as they come: sorted by slots it would take as long as two factorisations.
        self.sums = sp.csc_array(
            (np.concatenate(weights), number[slot], np.concatenate([[0], np.cumsum(np.concatenate(pairs))])),
            shape=(len(self.filled), len(self.columns)),
        )

    def _refuse_wide(self, width: int) -> None:
        if self.rows * float(width) ** 2 > OPERATIONS:
            raise NoProgress(f"{self.rows} rows in a band {width} wide")

    def factorise(self, diagonal: np.ndarray) -> None:
        of_unit, of_bounded = diagonal[self.unit], diagonal[self.bounded]
        self.pivot = self.slope**2 * of_bounded + of_unit
        self.share = self.slope * of_bounded / self.pivot
        diagonal = diagonal.copy()
        diagonal[self.bounded] = of_bounded * of_unit / self.pivot
        values = np.zeros(self.rows * self.width)
        values[self.filled] = self.sums @ diagonal[self.columns]
        self.factor, failed = lapack.dpbtrf(values.reshape(self.rows, self.width).T, lower=1, overwrite_ab=1)
        if failed:
            raise NoProgress("the normal equations are singular")

    def solve(self, right: np.ndarray) -> np.ndarray:
        alone, solution = right[self.bounding], np.empty(len(right))
        kept = self.kept[self.order]
        rest = right[self.kept] - self.beside @ (self.share * alone)
        solution[kept] = lapack.dpbtrs(self.factor, rest[self.order], lower=1)[0]
        solution[self.bounding] = alone / self.pivot - self.share * (solution[self.kept] @ self.beside)
        return solution


class _Method:
    """The program with its rows as unknowns of their own: A x - w = 0, x ≥ 0, lower ≤ w ≤ upper."""

    def __init__(self, program: LinearProgram) -> None:
        rows, columns = program.matrix.shape
        # An equation has no interior.
        middle, half = (program.lower + program.upper) / 2.0, 1e-11
        self.program, self.cost = program, program.cost
        self.lower = np.minimum(program.lower, middle - half)
        self.upper = np.maximum(program.upper, middle + half)
        self.matrix, self.transposed = sp.csr_array(program.matrix), sp.csr_array(program.matrix.T)
        self.x = slice(0, columns)
        self.below, self.above = slice(columns, columns + rows), slice(columns + rows, columns + 2 * rows)
        self.band = _Band(program.matrix, program.places)
        x, reduced = np.full(columns, FORCE), np.maximum(self.cost, MULTIPLIER)
        multiplier = np.minimum(float(x @ reduced) / columns / (middle - self.lower), reduced.max())
        self.point = _Point(
            np.concatenate([x, middle - self.lower, self.upper - middle]),
            np.concatenate([reduced, multiplier, multiplier]),
            np.zeros(rows),
        )
        self.short_steps = 0

    def residuals(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Residuals of the rows, of the reduced costs, and of the multipliers of the rows."""
        primal, dual, row_dual = self.point.primal, self.point.dual, self.point.row_dual
        return (
            self.lower + primal[self.below] - self.matrix @ primal[self.x],
            self.cost - self.transposed @ row_dual - dual[self.x],
            dual[self.below] - dual[self.above] - row_dual,
        )

    def error(self, residuals: tuple[np.ndarray, np.ndarray, np.ndarray]) -> float:
        """Largest of the residuals and of the relative difference of the objectives."""
        objective, row_dual = float(self.cost @ self.point.primal[self.x]), self.point.row_dual
        bound = float(np.maximum(row_dual, 0.0) @ self.lower + np.minimum(row_dual, 0.0) @ self.upper)
        gap = abs(objective - bound) / (1.0 + abs(objective))
        return max(gap, *(float(np.abs(part).max(initial=0.0)) for part in residuals))

    def iterate(self, residuals: tuple[np.ndarray, np.ndarray, np.ndarray]) -> None:
        """One factorisation, predictor and corrector."""
        primal, dual = self.point.primal, self.point.dual
        self.pivot = dual[self.x] + PROXIMAL * primal[self.x]
        self.slack = 1.0 / (dual[self.below] / primal[self.below] + dual[self.above] / primal[self.above])
        self.band.factorise(np.concatenate([primal[self.x] / self.pivot, self.slack]))
        step = self._direction(residuals, -primal * dual)
        end = self.point.moved(step, _longest(primal, step.primal), _longest(dual, step.dual))
        mean = float(primal @ dual) / len(primal)
        target = (float(end.primal @ end.dual) / len(primal) / mean) ** 3 * mean
        step = self._direction(residuals, target - primal * dual - step.primal * step.dual)
        part = 0.9995
        lengths = [part * _longest(u, v, 1.0 / part) for u, v in ((primal, step.primal), (dual, step.dual))]
        self.point = self.point.moved(step, *lengths)
        self.short_steps = self.short_steps + 1 if min(lengths) < 1e-3 else 0

    def check_ray(self) -> None:
        """Raise ``Unbounded`` where large multipliers, once they are balanced, are a ray that proves it."""
        x = self.point.primal[self.x]
        size = float(x.max())
        if size < 1e3 or self.cost @ x >= 0.0:
            return
        weight, ray = (x / size) ** 2, x / size
        try:
            self.band.factorise(np.concatenate([weight, np.full(self.matrix.shape[0], 1e-16)]))
        except NoProgress:
            # The diagonal of blocks that take no part in the ray is too small.
            return
        for _ in range(3):
            ray = np.maximum(ray - weight * (self.transposed @ self.band.solve(self.matrix @ ray)), 0.0)
        self.program.raise_if_unbounded(ray)

    def _direction(self, residuals: tuple[np.ndarray, ...], products: np.ndarray) -> _Point:
        """Newton's direction that removes the residuals and changes the products primal · dual by those given."""
        primal, dual = self.point.primal, self.point.dual
        rows, cost_errors, row_errors = residuals
        below, above = products[self.below] / primal[self.below], products[self.above] / primal[self.above]
        free, moved = row_errors + below - above, products[self.x] / self.pivot
        weight = primal[self.x] / self.pivot
        row_dual = self.band.solve(rows - self.matrix @ (moved - weight * cost_errors) + free * self.slack)
        enough = max(1e-9, 1e-2 * float(np.abs(rows).max(initial=0.0)))
        for refine in (True, False):
            reduced = cost_errors - self.transposed @ row_dual
            x, w = moved - weight * reduced, (free - row_dual) * self.slack
            residual = rows - (self.matrix @ x - w)
            if not refine or np.abs(residual).max(initial=0.0) <= enough:
                break
            row_dual = row_dual + self.band.solve(residual)
        by_below, by_above = (dual[limit] / primal[limit] * w for limit in (self.below, self.above))
        duals = np.concatenate([reduced + PROXIMAL * x, below - by_below, above + by_above])
        return _Point(np.concatenate([x, w, -w]), duals, row_dual)


def _joined(matrix: sp.csc_array) -> sp.csr_array:
    """(m, m) sparse array: which rows have a column in common."""
    pattern = sp.csr_array((np.ones(matrix.nnz), matrix.indices, matrix.indptr), shape=matrix.shape[::-1])
    return sp.csr_array(pattern.T @ pattern + sp.eye_array(matrix.shape[0]))


def _longest(values: np.ndarray, change: np.ndarray, most: float = 1.0) -> float:
    """Largest multiple of a change, up to ``most``, that leaves no positive value negative."""
    fastest = float((change / values).min())
    return min(most, -1.0 / fastest) if fastest < 0.0 else most


def run_band(program: LinearProgram) -> tuple[Solution | None, str]:
    """Solve a program whose rows form a narrow band; what comes back is as of :func:`solver.programs.highs.run_highs`.

    A primal-dual method: every iteration factorises A D Aᵀ, whose blocks of 3 × 3 are the blocks of the structure and
    their neighbours. After Mehrotra (1992), https://doi.org/10.1137/0802028, with a proximal term (Friedlander & Orban
    2012, https://doi.org/10.1007/s12532-012-0035-2).
    """
    wide = np.flatnonzero(np.diff(program.matrix.indptr) > WIDE)
    try:
        with one_thread(), np.errstate(divide="raise", over="raise", invalid="raise"):
            x, y = _solved_in_pieces(program, wide) if len(wide) else _solved(program)
    except (NoProgress, FloatingPointError) as reason:
        return None, str(reason)
    return program.checked(x, y, "band"), "solved"


def _solved_in_pieces(program: LinearProgram, wide: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Solve with wide columns cut into pieces along the rows, and equations that all pieces of one are the same."""
    rows, columns = program.matrix.shape
    narrow = np.delete(np.arange(columns), wide)
    position = np.argsort(narrowest(_joined(sp.csc_array(program.matrix[:, narrow])), program.places)[0])
    n = int(position.max()) // PIECE + 1
    each = sp.csc_array((np.ones(rows), (np.arange(rows), position // PIECE)), shape=(rows, n))
    cut = [sp.diags_array(program.matrix[:, [k]].toarray()[:, 0]) @ each for k in wide]
    chain = sp.diags_array([np.ones(n - 1), -np.ones(n - 1)], offsets=[0, 1], shape=(n - 1, n))
    links = sp.block_diag([chain] * len(wide))
    zeros = np.zeros(links.shape[0])
    # The cost of a wide column is that of its first piece.
    costs = np.zeros((len(wide), n))
    costs[:, 0] = program.cost[wide]
    between = np.tile((np.arange(n - 1) + 1.0) * PIECE - 0.5, len(wide))
    unfolded = replace(
        program,
        cost=np.concatenate([program.cost[narrow], costs.ravel()]),
        matrix=sp.csc_array(sp.block_array([[program.matrix[:, narrow], sp.hstack(cut)], [None, links]])),
        lower=np.concatenate([program.lower, zeros]),
        upper=np.concatenate([program.upper, zeros]),
        places=np.concatenate([position, between])[:, None],
    )

    def folded(x: np.ndarray) -> np.ndarray:
        joined = np.empty(columns)
        joined[narrow] = x[: len(narrow)]
        joined[wide] = x[len(narrow) :].reshape(len(wide), -1).mean(axis=1)
        return joined

    try:
        solution, row_dual = _solved(unfolded)
    except Unbounded as ray:
        program.raise_if_unbounded(folded(ray.x))
        raise NoProgress("a ray of the pieces is none of the program") from None
    return folded(solution), row_dual[:rows]


def _solved(program: LinearProgram) -> tuple[np.ndarray, np.ndarray]:
    method = _Method(program)
    least, best, least_at = math.inf, method.point, 0
    for iteration in range(ITERATIONS):
        residuals = method.residuals()
        error = method.error(residuals)
        if error < least:
            least, best, least_at = error, method.point, iteration
        if error < INTERIOR_TOLERANCE or (least < ACCEPTED_ERROR / 2.0 and iteration - least_at >= 5):
            return best.primal[method.x], best.row_dual
        method.iterate(residuals)
        if iteration % 5 == 0:
            method.check_ray()
        if method.short_steps >= 20:
            raise NoProgress(f"the steps became too short after {iteration + 1} iterations")
    raise NoProgress(f"no solution after {ITERATIONS} iterations")
