"""An interior point method for programs whose rows form a narrow band: the blocks of a wall, one beside the other."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.linalg import lapack
from scipy.sparse.csgraph import reverse_cuthill_mckee

from solver.tolerances import ACCEPTED_GAP

from .threads import NotLimited, one_thread

#: Violation of rows and reduced costs, absolute, and relative difference of the objectives at which a point is optimal.
TOLERANCE = 1e-8

#: A point that has come so near, half of what our own check accepts, is taken if so many iterations find none better:
#: forces move on among those that cost the same, and what they cost is lost in rounding.
GOOD, PATIENCE = ACCEPTED_GAP / 2.0, 5

#: Iterations after which it is given up; walls of 1,500 blocks take 40, of 10,000 blocks 80.
ITERATIONS = 200

#: After this many steps in a row that are shorter than the second number it is given up.
SHORT_STEPS, SHORT = 20, 1e-3

#: Largest number of operations of one factorisation, rows times the square of the band's width; walls of 10,000 blocks
#: need 2e9, a tenth of a second. They grow with the square of the blocks: larger programs go to HiGHS.
OPERATIONS = 1e10

#: A column with more entries than the first number, such as a load on every block, would fill the band: it is cut into
#: pieces of so many rows that lie beside each other, which equations chain together.
WIDE, PIECE = 64, 12

#: Rows are put in order along the longest side, by lines that lean by this much. Upright ones come to be shuffled as
#: bricks move that stand one above the other, and the band half as wide again.
TILTS = (0.01, 0.1, 0.3)

#: A border is tried of so many rows, as long as each has this many times as many neighbours as most have.
BORDERS, MANY = (3, 6, 12, 24, 48), 1.3

#: What a factorisation takes besides the square of the width, times the width: LAPACK is slower at narrow bands, and
#: goes through the band once for each row of the border.
WORK = 100.0, 6.5

#: Half the width that a row has at least: an equation has no inside.
LEAST_WIDTH = 1e-11

#: Weight of the proximal term. Without it the multipliers that carry force weigh 1e16 at the end, and the balance of
#: the blocks is lost in rounding at 1e-6; with it the point strays from dual feasibility by this times the last step.
PROXIMAL = 1e-11

#: Where the method starts: multipliers, slack beyond what balances them, and least reduced cost.
START, START_SLACK, START_COST = 1.0, 0.1, 0.03

#: The first iterate whose products are below this on average is kept: a program much like this one may start from it.
#: Later ones are too near the boundary, and take longer than a start from nothing.
EARLY = 1e-3

#: Part of the way to the boundary that a step takes.
TO_BOUNDARY = 0.9995

#: Corrections per iteration that pull the products of a longer step back towards the central path, the length they
#: aim for beyond what is possible, the spread of products they leave alone, and the lengthening that makes one worth
#: its while.
CORRECTIONS, LONGER, SPREAD, WORTHWHILE = 2, 0.3, 0.05, 0.01

#: Weights that are tried for a correction, as fractions of the way from the least to 1.
WEIGHTS = np.linspace(1.0, 0.0, 7)

#: Refinements of a solution, until its residual is below this or this part of what it is to remove.
REFINEMENTS, RESIDUAL, RESIDUAL_PART = 2, 1e-9, 1e-2

#: Multipliers of this size that cost less than nothing by this, in units of the program, are looked at for a ray along
#: which the objective falls without limit, every ``RAY_EVERY`` iterations. ``RAY_PASSES`` passes remove its unbalanced
#: part, with either number on the diagonal: the large one leaves some of it, the small one may be singular.
RAY_SIZE, RAY_COST, RAY_EVERY, RAY_PASSES, RAY_DIAGONALS = 1e3, 1e-8, 5, 3, (1e-16, 1e-20)

#: Out of balance by less than this, a ray is shown to the caller.
PROVES = 1e-9


class Diverges(Exception):
    """The multipliers grow along what looks like a ray.

    Attributes
    ----------
    ray : (n,) array
        A x near 0, x ≥ 0, cost · x < 0, its largest entry 1; for the caller to judge.
    """

    def __init__(self, ray: np.ndarray) -> None:
        super().__init__("the multipliers grow without limit")
        self.ray = ray


class NoProgress(Exception):
    """The method does not apply, or came to no solution."""


@dataclass(frozen=True)
class Iterate:
    """Where the method is: x, then how far rows are from their lower and upper bounds; and what prices them."""

    primal: np.ndarray
    dual: np.ndarray
    row_dual: np.ndarray

    def fits(self, matrix: sp.csc_array) -> bool:
        """Whether it may be an iterate of a program with such a matrix."""
        rows, columns = matrix.shape
        return len(self.row_dual) == rows and len(self.primal) == columns + 2 * rows


class _Band:
    """A D Aᵀ for a fixed A, and its factor.

    Its rows are reordered so that what is not zero lies near the diagonal, but for those of the border, which come
    last: many others meet them, as all that lies beside a crack meets the part of the wall that moves as one.
    """

    def __init__(self, matrix: sp.csc_array, places: np.ndarray | None) -> None:
        self.rows = rows = matrix.shape[0]
        counts = np.diff(matrix.indptr)
        # Each column is as wide as it has entries, at least: a load on every block fills the matrix.
        self._refuse_wide(int(counts.max(initial=0)))
        self.order, self.border, self.width = narrowest(matrix, places)
        self._refuse_wide(self.width)
        inside = rows - self.border
        place = _places_in(self.order)
        # Where the column of a row begins: inside with its diagonal, in the border with the first row.
        begins = np.arange(rows) * self.width
        begins[inside:] = inside * self.width + rows * np.arange(self.border)
        slots, weights, columns, pairs = [], [], [], []
        for count in np.unique(counts[counts > 0]):
            members = np.flatnonzero(counts == count)
            entries = matrix.indptr[members][:, None] + np.arange(count)
            at, value = place[matrix.indices[entries]], matrix.data[entries]
            first, second = np.tril_indices(count)
            i, j = np.maximum(at[:, first], at[:, second]), np.minimum(at[:, first], at[:, second])
            slots.append(np.where(i < inside, begins[j] + i - j, begins[i] + j).ravel())
            weights.append((value[:, first] * value[:, second]).ravel())
            columns.append(members)
            pairs.append(np.full(len(members), len(first)))
        self.columns, slot = np.concatenate(columns), np.concatenate(slots)
        self.values = np.zeros(inside * self.width + rows * self.border)
        self.values[slot] = 1.0
        self.filled = np.flatnonzero(self.values)
        number = np.empty(len(self.values), dtype=np.int32)
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
        self.values[:] = 0.0
        self.values[self.filled] = self.sums @ diagonal[self.columns]
        inside = self.rows - self.border
        band, border = np.split(self.values, [inside * self.width])
        self.factor, failed = lapack.dpbtrf(band.reshape(inside, self.width).T, lower=1, overwrite_ab=1)
        if not failed and self.border:
            border = border.reshape(self.border, self.rows).T
            self.beside, _ = lapack.dtbtrs(self.factor, border[:inside], uplo="L")
            self.corner, failed = lapack.dpotrf(border[inside:] - self.beside.T @ self.beside)
        if failed:
            raise NoProgress("the normal equations are singular")

    def solve(self, right: np.ndarray) -> np.ndarray:
        solution = np.empty(self.rows)
        right, inside = right[self.order], self.rows - self.border
        if self.border:
            half, _ = lapack.dtbtrs(self.factor, right[:inside], uplo="L")
            last, _ = lapack.dpotrs(self.corner, right[inside:] - self.beside.T @ half)
            first, _ = lapack.dtbtrs(self.factor, half - self.beside @ last, uplo="L", trans="T")
            solution[self.order] = np.concatenate([first, last])
        else:
            solution[self.order] = lapack.dpbtrs(self.factor, right, lower=1)[0]
        return solution


class _Method:
    """The program with its rows as unknowns of their own: A x - w = 0, x ≥ 0, lower ≤ w ≤ upper."""

    def __init__(
        self,
        cost: np.ndarray,
        matrix: sp.csc_array,
        lower: np.ndarray,
        upper: np.ndarray,
        places: np.ndarray | None,
        start: Iterate | None = None,
    ) -> None:
        rows, columns = matrix.shape
        if not (np.isfinite(lower).all() and np.isfinite(upper).all()):
            raise NoProgress("a row has no bound")
        middle = (lower + upper) / 2.0
        self.cost = cost
        self.lower, self.upper = np.minimum(lower, middle - LEAST_WIDTH), np.maximum(upper, middle + LEAST_WIDTH)
        self.matrix, self.transposed = sp.csr_array(matrix), sp.csr_array(matrix.T)
        self.x = slice(0, columns)
        self.below, self.above = slice(columns, columns + rows), slice(columns + rows, columns + 2 * rows)
        self.band = _Band(sp.csc_array(sp.hstack([matrix, sp.eye_array(rows)])), places)
        self.point = self._start(matrix) if start is None else self._continued(start)
        self.early: Iterate | None = None
        self.tried = 0

    def _start(self, matrix: sp.csc_array) -> Iterate:
        """Start from equal multipliers, the rows balanced by their unit columns where they have any."""
        middle = (self.lower + self.upper) / 2.0
        single = np.flatnonzero(np.diff(matrix.indptr) == 1)
        row, value = matrix.indices[matrix.indptr[single]], matrix.data[matrix.indptr[single]]
        # The last one of a row where there are several.
        units = np.full((2, len(middle)), -1)
        for unit, of_sign in zip(units, (value > 0.0, value < 0.0), strict=True):
            unit[row[of_sign]] = single[of_sign]
        rows = np.flatnonzero((units >= 0).all(axis=0))
        single = single[np.isin(row, rows)]
        x = np.full(matrix.shape[1], START)
        x[single] = 0.0
        missing = (middle - matrix @ x)[rows]
        for unit, sign in zip(units[:, rows], (1.0, -1.0), strict=True):
            x[unit] = np.maximum(sign * missing, 0.0) / np.abs(matrix.data[matrix.indptr[unit]])
        x[single] += START_SLACK
        reduced = np.maximum(self.cost, START_COST)
        price = np.minimum(float(x @ reduced) / len(x) / (middle - self.lower), reduced.max())
        return Iterate(
            np.concatenate([x, middle - self.lower, self.upper - middle]),
            np.concatenate([reduced, price, price]),
            np.zeros(len(middle)),
        )

    def _continued(self, start: Iterate) -> Iterate:
        """Go on from an iterate of a program much like this one; each row lies between its bounds as it did there."""
        primal = start.primal.copy()
        wider = (self.upper - self.lower) / (primal[self.below] + primal[self.above])
        primal[self.below] *= wider
        primal[self.above] *= wider
        return Iterate(primal, start.dual, start.row_dual)

    def residuals(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Of the rows, of the reduced costs, and of the rows' prices."""
        primal, dual, row_dual = self.point.primal, self.point.dual, self.point.row_dual
        return (
            self.lower + primal[self.below] - self.matrix @ primal[self.x],
            self.cost - self.transposed @ row_dual - dual[self.x],
            dual[self.below] - dual[self.above] - row_dual,
        )

    def error(self, residuals: tuple[np.ndarray, np.ndarray, np.ndarray]) -> float:
        """Largest of the residuals and of the relative difference of the objectives."""
        primal = self.point.primal
        objective = float(self.cost @ primal[self.x])
        row_dual = self.point.row_dual
        bound = float(np.maximum(row_dual, 0.0) @ self.lower + np.minimum(row_dual, 0.0) @ self.upper)
        gap = abs(objective - bound) / (1.0 + abs(objective))
        return max(gap, *(float(np.abs(part).max(initial=0.0)) for part in residuals))

    def iterate(self, residuals: tuple[np.ndarray, np.ndarray, np.ndarray]) -> None:
        """One factorisation: predictor, corrector and what lengthens the step (Mehrotra 1992, Gondzio 1996)."""
        primal, dual = self.point.primal, self.point.dual
        self.pivot = dual[self.x] + PROXIMAL * primal[self.x]
        self.room = 1.0 / (dual[self.below] / primal[self.below] + dual[self.above] / primal[self.above])
        self.band.factorise(np.concatenate([primal[self.x] / self.pivot, self.room]))
        step = self._direction(residuals, -primal * dual)
        lengths = _longest(primal, step.primal), _longest(dual, step.dual)
        mean = float(primal @ dual) / len(primal)
        if mean < EARLY and self.early is None:
            self.early = self.point
        predicted = float((primal + lengths[0] * step.primal) @ (dual + lengths[1] * step.dual)) / len(primal)
        target = (predicted / mean) ** 3 * mean
        nothing = tuple(np.zeros_like(part) for part in residuals)
        second = self._direction(nothing, target - step.primal * step.dual)
        step, lengths = self._weighted(step, second, lengths)
        for _ in range(CORRECTIONS):
            if min(lengths) > 0.9:
                break
            aimed = [min(1.0, length + LONGER) for length in lengths]
            products = (primal + aimed[0] * step.primal) * (dual + aimed[1] * step.dual)
            off = np.where(products < SPREAD * target, SPREAD * target - products, 0.0)
            off += np.where(products > target / SPREAD, np.maximum(target / SPREAD - products, -target / SPREAD), 0.0)
            corrected, longer = self._weighted(step, self._direction(nothing, off), lengths)
            if longer[0] < lengths[0] + WORTHWHILE and longer[1] < lengths[1] + WORTHWHILE:
                break
            step, lengths = corrected, longer
        by_primal = TO_BOUNDARY * _longest(primal, step.primal, 1.0 / TO_BOUNDARY)
        by_dual = TO_BOUNDARY * _longest(dual, step.dual, 1.0 / TO_BOUNDARY)
        self.point = Iterate(
            primal + by_primal * step.primal, dual + by_dual * step.dual, self.point.row_dual + by_dual * step.row_dual
        )
        self.tried = self.tried + 1 if min(by_primal, by_dual) < SHORT else 0

    def refuse_ray(self) -> None:
        """Raise ``Diverges`` where the multipliers point along a ray, once they are corrected until they balance."""
        x = self.point.primal[self.x]
        size = float(x.max())
        if size < RAY_SIZE or self.cost @ x > -RAY_COST * size:
            return
        weight = (x / size) ** 2
        for diagonal in RAY_DIAGONALS:
            try:
                self.band.factorise(np.concatenate([weight, np.full(self.matrix.shape[0], diagonal)]))
            except NoProgress:
                # Blocks that the ray leaves alone have nothing else on their diagonal.
                return
            ray = x / size
            for _ in range(RAY_PASSES):
                ray = np.maximum(ray - weight * (self.transposed @ self.band.solve(self.matrix @ ray)), 0.0)
            if np.abs(self.matrix @ ray).max() < PROVES * ray.max() and self.cost @ ray < 0.0:
                raise Diverges(ray / ray.max())

    def _direction(self, residuals: tuple[np.ndarray, ...], products: np.ndarray) -> Iterate:
        """Newton's direction that removes the residuals and changes the products primal · dual by those given."""
        primal, dual = self.point.primal, self.point.dual
        rows, costs, prices = residuals
        below, above = products[self.below] / primal[self.below], products[self.above] / primal[self.above]
        free, moved = prices + below - above, products[self.x] / self.pivot
        weight = primal[self.x] / self.pivot
        row_dual = self.band.solve(rows - self.matrix @ (moved - weight * costs) + free * self.room)
        for attempt in range(REFINEMENTS + 1):
            reduced = costs - self.transposed @ row_dual
            x, w = moved - weight * reduced, (free - row_dual) * self.room
            residual = rows - (self.matrix @ x - w)
            enough = max(RESIDUAL, RESIDUAL_PART * float(np.abs(rows).max(initial=0.0)))
            if attempt == REFINEMENTS or np.abs(residual).max(initial=0.0) <= enough:
                break
            row_dual = row_dual + self.band.solve(residual)
        return Iterate(
            np.concatenate([x, w, -w]),
            np.concatenate(
                [
                    reduced + PROXIMAL * x,
                    below - dual[self.below] / primal[self.below] * w,
                    above + dual[self.above] / primal[self.above] * w,
                ]
            ),
            row_dual,
        )

    def _weighted(
        self, step: Iterate, correction: Iterate, lengths: tuple[float, float]
    ) -> tuple[Iterate, tuple[float, float]]:
        """Add as much of a correction to a step as makes it longest (Colombo & Gondzio 2008)."""
        primal, dual = self.point.primal, self.point.dual
        weights = max(lengths[0] * lengths[1], 0.05) * (1.0 - WEIGHTS) + WEIGHTS
        by_primal = _lengths(step.primal / primal, correction.primal / primal, weights)
        by_dual = _lengths(step.dual / dual, correction.dual / dual, weights)
        p, d = int(np.argmax(by_primal)), int(np.argmax(by_dual))
        corrected = Iterate(
            step.primal + weights[p] * correction.primal,
            step.dual + weights[d] * correction.dual,
            step.row_dual + weights[d] * correction.row_dual,
        )
        return corrected, (by_primal[p], by_dual[d])


def narrowest(matrix: sp.csc_array, places: np.ndarray | None) -> tuple[np.ndarray, int, int]:
    """Choose an order of the rows: (m,) array, how many at its end are the border, and how wide the others' band is."""
    pattern = sp.csr_array((np.ones(matrix.nnz), matrix.indices, matrix.indptr), shape=matrix.shape[::-1])
    joined = sp.csr_array(pattern.T @ pattern)
    neighbours = np.diff(joined.indptr)
    many = np.argsort(-neighbours, kind="stable")
    most = int((neighbours > MANY * np.median(neighbours)).sum())
    chosen, least = None, math.inf
    for border in (0, *(border for border in BORDERS if border <= most)):
        inside = np.sort(many[border:])
        among = joined if border == 0 else joined[inside][:, inside]
        orders = [reverse_cuthill_mckee(sp.csr_matrix(among), symmetric_mode=True)]
        if places is not None and border == 0:
            axis = int(np.argmax(np.ptp(places, axis=0)))
            across = np.delete(places, axis, axis=1).sum(axis=1)
            orders += [np.argsort(places[:, axis] + tilt * across, kind="stable") for tilt in TILTS]
        row = np.repeat(np.arange(len(inside)), np.diff(among.indptr))
        for order in orders:
            place = _places_in(order)
            width = int(np.abs(place[row] - place[among.indices]).max(initial=0)) + 1
            work = len(inside) * width * (width + WORK[0] + WORK[1] * border)
            if work < least:
                chosen, least = (np.concatenate([inside[order], many[:border]]), border, width), work
    assert chosen is not None
    return chosen


def _places_in(order: np.ndarray) -> np.ndarray:
    """(m,) int array: where in an order each row comes."""
    place = np.empty(len(order), dtype=np.int64)
    place[order] = np.arange(len(order))
    return place


def _longest(values: np.ndarray, change: np.ndarray, most: float = 1.0) -> float:
    """Largest multiple of a change, up to ``most``, that leaves no positive value negative."""
    fastest = float((change / values).min())
    return min(most, -1.0 / fastest) if fastest < 0.0 else most


def _lengths(rates: np.ndarray, corrections: np.ndarray, weights: np.ndarray) -> list[float]:
    """Longest steps, up to 1, at relative changes corrected with each of the weights."""
    # Only what is used up within the step shortens it, and lies between what the first and the last weight make of it.
    low = np.minimum(rates + weights[0] * corrections, rates + weights[-1] * corrections)
    few = np.flatnonzero(low < -1.0)
    steepest = (rates[few] + weights[:, None] * corrections[few]).min(axis=1, initial=-1.0)
    return (-1.0 / steepest).tolist()


def interior_point(
    cost: np.ndarray,
    matrix: sp.csc_array,
    lower: np.ndarray,
    upper: np.ndarray,
    places: np.ndarray | None = None,
    start: Iterate | None = None,
) -> tuple[np.ndarray, np.ndarray, int, Iterate | None]:
    """Minimise cost · x subject to lower ≤ A x ≤ upper and x ≥ 0.

    Parameters
    ----------
    cost : (n,) array
    matrix : (m, n) sparse array, by columns
    lower, upper : (m,) arrays
        Finite.
    places : (m, dim) array, optional
        Where each row's block is: for orders of the rows to try beside that of Cuthill & McKee. Along the longer side
        of a wall it makes a band two thirds as wide.
    start : Iterate, optional
        Early iterate of a program of the same size that is much like this one.

    Returns
    -------
    x : (n,) array
        In the interior of the optimal face.
    row_dual : (m,) array
    iterations : int
    early : Iterate or None
        From which a program much like this one may start.

    Raises
    ------
    Diverges
        If the multipliers grow along a ray.
    NoProgress
        If the rows do not form a narrow band, or the steps become too short.

    Notes
    -----
    A primal-dual method: every iteration factorises A D Aᵀ, whose blocks of 3 × 3 are the blocks of the structure and
    their neighbours, as a band in the order given or that of Cuthill & McKee (1969). After Mehrotra
    (1992), https://doi.org/10.1137/0802028, with Gondzio's (1996) correctors, https://doi.org/10.1007/BF00249643, their
    weights after Colombo & Gondzio (2008), https://doi.org/10.1007/s10589-007-9106-0, and a proximal term (Friedlander
    & Orban 2012, https://doi.org/10.1007/s12532-012-0035-2).
    """
    try:
        with one_thread(), np.errstate(divide="raise", over="raise", invalid="raise"):
            wide = np.flatnonzero(np.diff(matrix.indptr) > WIDE)
            if len(wide):
                return _solved_in_pieces(cost, matrix, lower, upper, places, wide)
            return _solved(_Method(cost, matrix, lower, upper, places, start))
    except (NotLimited, FloatingPointError) as error:
        raise NoProgress(str(error)) from None


def _solved_in_pieces(
    cost: np.ndarray,
    matrix: sp.csc_array,
    lower: np.ndarray,
    upper: np.ndarray,
    places: np.ndarray | None,
    wide: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, int, None]:
    """Solve with wide columns cut into pieces along the rows, and equations that all pieces of one are the same."""
    rows, columns = matrix.shape
    narrow = np.delete(np.arange(columns), wide)
    order, _, _ = narrowest(sp.csc_array(matrix[:, narrow]), places)
    place = _places_in(order)
    piece = place // PIECE
    n = int(piece.max()) + 1
    each = sp.csc_array((np.ones(rows), (np.arange(rows), piece)), shape=(rows, n))
    cut = [sp.diags_array(matrix[:, [k]].toarray()[:, 0]) @ each for k in wide]
    chain = sp.diags_array([np.ones(n - 1), -np.ones(n - 1)], offsets=[0, 1], shape=(n - 1, n))
    links = sp.block_diag([chain] * len(wide))
    unfolded = sp.csc_array(sp.block_array([[matrix[:, narrow], sp.hstack(cut)], [None, links]]))
    none = np.zeros(links.shape[0])
    # The cost of a wide column is that of its first piece.
    costs = np.zeros((len(wide), n))
    costs[:, 0] = cost[wide]
    method = _Method(
        np.concatenate([cost[narrow], costs.ravel()]),
        unfolded,
        np.concatenate([lower, none]),
        np.concatenate([upper, none]),
        np.concatenate([place, np.tile((np.arange(n - 1) + 1.0) * PIECE - 0.5, len(wide))])[:, None],
    )
    try:
        found, row_dual, iterations, _ = _solved(method)
    except Diverges as error:
        raise Diverges(_folded(error.ray, narrow, wide)) from None
    return _folded(found, narrow, wide), row_dual[:rows], iterations, None


def _folded(x: np.ndarray, narrow: np.ndarray, wide: np.ndarray) -> np.ndarray:
    """(n,) array: the multipliers of a program whose wide columns were cut into pieces."""
    whole = np.empty(len(narrow) + len(wide))
    whole[narrow] = x[: len(narrow)]
    whole[wide] = x[len(narrow) :].reshape(len(wide), -1).mean(axis=1)
    return whole


def _solved(method: _Method) -> tuple[np.ndarray, np.ndarray, int, Iterate | None]:
    least, best, at = math.inf, method.point, 0
    for iteration in range(ITERATIONS):
        residuals = method.residuals()
        error = method.error(residuals)
        if error < least:
            least, best, at = error, method.point, iteration
        if error < TOLERANCE or (least < GOOD and iteration - at >= PATIENCE):
            return best.primal[method.x], best.row_dual, iteration, method.early
        method.iterate(residuals)
        if iteration % RAY_EVERY == 0:
            method.refuse_ray()
        if method.tried >= SHORT_STEPS:
            raise NoProgress(f"the steps became too short after {iteration + 1} iterations")
    raise NoProgress(f"no solution after {ITERATIONS} iterations")
