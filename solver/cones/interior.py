"""An interior point method for conic programs whose rows are those of blocks that touch few others."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spl

from solver.lp.band import NoProgress
from solver.lp.fill import least_fill
from solver.lp.threads import NotLimited, one_thread

from .problem import ConicProgram, ConicSolution, checked, raise_if_proved

#: Relative residual of rows and reduced costs, and relative difference of the objectives, at which a point is optimal.
TOLERANCE = 1e-9

#: Iterations after which it is given up; walls of 1,000 blocks take 60.
ITERATIONS = 120

#: After this many iterations without a better point the best one is taken.
STALLED = 20

#: Part of the way to the boundary that a step takes, and the step below which it is given up.
TO_BOUNDARY, SHORTEST = 0.99, 1e-7

#: Added to the diagonal of the normal equations; solutions are refined without it.
REGULAR = 1e-11

#: Refinements of a solution, until its residual is below this part of what it is to remove.
REFINEMENTS, RESIDUAL = 2, 1e-11

#: Where the method starts: least force, least reduced cost.
START = 1.0


@dataclass
class _Scaling:
    """The scaling of Nesterov and Todd at a point: W x = W⁻¹ s per cone, and x / s of the other columns."""

    eta: np.ndarray
    w: np.ndarray
    ratio: np.ndarray

    @classmethod
    def at(cls, x: np.ndarray, s: np.ndarray, ratio: np.ndarray) -> _Scaling:
        size_x, size_s = np.sqrt(_determinant(x)), np.sqrt(_determinant(s))
        one, other = x / size_x[:, None], s / size_s[:, None]
        other_way = one * _signs(x)
        middle = np.sqrt((1.0 + (one * other).sum(axis=1)) / 2.0)
        return cls(np.sqrt(size_s / size_x), (other + other_way) / (2.0 * middle)[:, None], ratio)

    def times(self, u: np.ndarray) -> np.ndarray:
        return self._applied(u, self.w, self.eta)

    def over(self, u: np.ndarray) -> np.ndarray:
        return self._applied(u, self.w * _signs(self.w), 1.0 / self.eta)

    @staticmethod
    def _applied(u: np.ndarray, w: np.ndarray, eta: np.ndarray) -> np.ndarray:
        across = np.einsum("ki,ki->k", w[:, 1:], u[:, 1:])
        out = np.empty_like(u)
        out[:, 0] = w[:, 0] * u[:, 0] + across
        out[:, 1:] = u[:, 1:] + (u[:, 0] + across / (1.0 + w[:, 0]))[:, None] * w[:, 1:]
        return out * eta[:, None]

    def squares(self) -> np.ndarray:
        """(k, d, d) array: W⁻² of each cone."""
        v = self.w * _signs(self.w)
        out = 2.0 * v[:, :, None] * v[:, None, :]
        out[:, 0, 0] -= 1.0
        d = np.arange(1, v.shape[1])
        out[:, d, d] += 1.0
        return out / (self.eta**2)[:, None, None]


class _Normal:
    """A H Aᵀ for a fixed A, its rows in an order that fills in little; and its factors."""

    def __init__(self, matrix: sp.csc_array, k: int, size: int) -> None:
        rows = matrix.shape[0]
        self.k, self.size = k, size
        beside = sp.csc_array(matrix[:, k * size :])
        # A load on every block fills the matrix.
        if k == 0 or (np.diff(beside.indptr) > 1).any():
            raise NoProgress("no cones, or a column beside them with several rows")
        # Cones by the number of rows that any of their columns is in.
        entries = sp.coo_array(matrix[:, : k * size])
        cone, part = entries.coords[1] // size, entries.coords[1] % size
        pairs, which = np.unique(cone * rows + entries.coords[0], return_inverse=True)
        values = np.zeros((len(pairs), size))
        np.add.at(values, (which, part), entries.data)
        of_cone, row = pairs // rows, pairs % rows
        number = np.bincount(of_cone, minlength=k)
        first = np.cumsum(number) - number
        self.groups, at = [], [np.arange(rows) * (rows + 1)]
        for count in np.unique(number[number > 0]):
            members = np.flatnonzero(number == count)
            mine = first[members][:, None] + np.arange(count)
            # Cones of the same rows, those of a joint, are summed before they go into the matrix.
            same, joint, together = np.unique(row[mine], axis=0, return_inverse=True, return_counts=True)
            in_order = np.argsort(joint.ravel(), kind="stable")
            starts = np.cumsum(together) - together
            for several in np.unique(together):
                chosen = np.flatnonzero(together == several)
                which = in_order[starts[chosen][:, None] + np.arange(several)]
                at.append((same[chosen][:, None, :] * rows + same[chosen][:, :, None]).ravel())
                self.groups.append((members[which], values[mine[which]]))
        filled = np.unique(np.concatenate(at))
        self.order = least_fill(filled // rows, filled % rows, rows)
        place = np.empty(rows, dtype=np.int64)
        place[self.order] = np.arange(rows)
        at = [place[one // rows] * rows + place[one % rows] for one in at]
        filled, self.number = np.unique(np.concatenate(at[1:] + at[:1]), return_inverse=True)
        self.indices = (filled % rows).astype(np.int32)
        self.pointers = np.searchsorted(filled, np.arange(rows + 1) * rows).astype(np.int32)
        self.single = np.flatnonzero(np.diff(beside.indptr))
        self.single_row, self.single_square = beside.indices, beside.data**2

    def factorise(self, squares: np.ndarray, ratio: np.ndarray) -> None:
        """Factorise for W⁻² of the cones, (k, d, d), and x / s of all other columns, (n - k d,)."""
        rows = len(self.order)
        sums = []
        for members, values in self.groups:
            # (joints, cones, rows, d) to (joints, rows, cones d): one product for all cones of a joint.
            joints, cones, count, _ = values.shape
            side, other = (
                part.swapaxes(1, 2).reshape(joints, count, cones * self.size)
                for part in (values @ squares[members], values)
            )
            sums.append((side @ other.swapaxes(1, 2)).ravel())
        sums.append(REGULAR + np.bincount(self.single_row, ratio[self.single] * self.single_square, rows))
        whole = np.bincount(self.number, np.concatenate(sums), len(self.indices))
        matrix = sp.csc_array((whole, self.indices, self.pointers), shape=(rows, rows))
        try:
            self.factors = spl.splu(
                matrix, permc_spec="NATURAL", diag_pivot_thresh=0.0, options={"SymmetricMode": True, "Equil": False}
            )
        except RuntimeError:
            raise NoProgress("the normal equations are singular") from None

    def solve(self, right: np.ndarray) -> np.ndarray:
        solution = np.empty(len(right))
        solution[self.order] = self.factors.solve(right[self.order])
        return solution


@dataclass
class _Point:
    """Iterate, or its change: forces in cones (k, d) and other columns, their reduced costs, multipliers."""

    cones: np.ndarray
    others: np.ndarray
    cone_costs: np.ndarray
    other_costs: np.ndarray
    row_dual: np.ndarray


class _Method:
    """The program with cones of slope 1."""

    def __init__(self, program: ConicProgram) -> None:
        self.k, self.size, self.split = len(program.friction), program.size, program.in_cones
        self.cost, self.right = program.cost * program.scale, program.right
        matrix = sp.csc_array(program.matrix @ sp.diags_array(program.scale))
        self.matrix, self.transposed = sp.csr_array(matrix), sp.csr_array(matrix.T)
        self.normal = _Normal(matrix, self.k, self.size)
        self.count = self.k + len(self.cost) - self.split
        self.point = self._start()

    def _start(self) -> _Point:
        """Start from the least forces that balance and the least reduced costs, moved well into their cones."""
        ratio = 1.0 / np.maximum(np.abs(self.cost[self.split :]), 1.0) ** 2
        self.normal.factorise(np.broadcast_to(np.eye(self.size), (self.k, self.size, self.size)), ratio)
        weights = np.concatenate([np.ones(self.split), ratio])
        row_dual = self.normal.solve(self.matrix @ (weights * self.cost))
        x = weights * (self.transposed @ self.normal.solve(self.right))
        s = self.cost - self.transposed @ row_dual
        cones, others = self._moved_inside(x)
        cone_costs, other_costs = self._moved_inside(s)
        return _Point(cones, others, cone_costs, other_costs, row_dual)

    def _moved_inside(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        cones, others = u[: self.split].reshape(-1, self.size).copy(), u[self.split :]
        lacking = float((np.linalg.norm(cones[:, 1:], axis=1) - cones[:, 0]).max(initial=0.0))
        cones[:, 0] += lacking + START
        return cones, others + max(-float(others.min(initial=0.0)), 0.0) + START

    def x(self) -> np.ndarray:
        return np.concatenate([self.point.cones.ravel(), self.point.others])

    def residuals(self) -> tuple[np.ndarray, np.ndarray, float]:
        """Of the rows and of the reduced costs; the largest of both and of the gap, relative."""
        p, x = self.point, self.x()
        s = np.concatenate([p.cone_costs.ravel(), p.other_costs])
        rows = self.right - self.matrix @ x
        costs = self.cost - self.transposed @ p.row_dual - s
        objective, bound = float(self.cost @ x), float(self.right @ p.row_dual)
        off = max(
            float(np.abs(rows).max(initial=0.0)) / (1.0 + float(np.abs(self.right).max(initial=0.0))),
            float(np.abs(costs).max(initial=0.0)) / (1.0 + float(np.abs(p.row_dual).max(initial=0.0))),
            abs(objective - bound) / (1.0 + abs(objective)),
        )
        return rows, costs, off

    def iterate(self, rows: np.ndarray, costs: np.ndarray) -> float:
        """One factorisation, predictor and corrector; gives the length of the step."""
        p = self.point
        self.scaling = _Scaling.at(p.cones, p.cone_costs, p.others / p.other_costs)
        self.squares = self.scaling.squares()
        self.normal.factorise(self.squares, self.scaling.ratio)
        scaled = self.scaling.times(p.cones)
        product, single = _product(scaled, scaled), p.others * p.other_costs
        gap = float((p.cones * p.cone_costs).sum() + single.sum())
        step = self._direction(scaled, -product, -single, rows, costs)
        length = min(1.0, self._longest(step))
        left = float(
            ((p.cones + length * step.cones) * (p.cone_costs + length * step.cone_costs)).sum()
            + (p.others + length * step.others) @ (p.other_costs + length * step.other_costs)
        )
        target = max(left / gap, 0.0) ** 3 * gap / self.count
        second = _product(self.scaling.over(step.cone_costs), self.scaling.times(step.cones))
        aimed = -product - second
        aimed[:, 0] += target
        step = self._direction(scaled, aimed, target - single - step.others * step.other_costs, rows, costs)
        length = min(1.0, TO_BOUNDARY * self._longest(step))
        self.point = _Point(
            p.cones + length * step.cones,
            p.others + length * step.others,
            p.cone_costs + length * step.cone_costs,
            p.other_costs + length * step.other_costs,
            p.row_dual + length * step.row_dual,
        )
        return length

    def _direction(
        self, scaled: np.ndarray, product: np.ndarray, single: np.ndarray, rows: np.ndarray, costs: np.ndarray
    ) -> _Point:
        """Newton's direction that removes the residuals and changes the products by those given."""
        p = self.point
        free, moved = self.scaling.over(_quotient(scaled, product)), single / p.other_costs
        in_cones = costs[: self.split].reshape(-1, self.size)
        others = moved - self.scaling.ratio * costs[self.split :]
        right = rows - self.matrix @ np.concatenate([(free - self._weighted(in_cones)).ravel(), others])
        dual = self.normal.solve(right)
        enough = RESIDUAL * (1.0 + float(np.abs(right).max(initial=0.0)))
        for _ in range(REFINEMENTS):
            reduced = self.transposed @ dual
            taken = self._weighted(reduced[: self.split].reshape(-1, self.size)).ravel()
            taken = np.concatenate([taken, self.scaling.ratio * reduced[self.split :]])
            residual = right - self.matrix @ taken
            if float(np.abs(residual).max(initial=0.0)) <= enough:
                break
            dual = dual + self.normal.solve(residual)
        change = costs - self.transposed @ dual
        cone_costs = change[: self.split].reshape(-1, self.size)
        return _Point(
            free - self._weighted(cone_costs),
            moved - self.scaling.ratio * change[self.split :],
            cone_costs,
            change[self.split :],
            dual,
        )

    def _weighted(self, u: np.ndarray) -> np.ndarray:
        return np.einsum("kij,kj->ki", self.squares, u)

    def _longest(self, step: _Point) -> float:
        p = self.point
        return min(
            _to_edge(p.cones, step.cones),
            _to_edge(p.cone_costs, step.cone_costs),
            _to_zero(p.others, step.others),
            _to_zero(p.other_costs, step.other_costs),
        )


def _signs(u: np.ndarray) -> np.ndarray:
    return np.where(np.arange(u.shape[1]) == 0, 1.0, -1.0)


def _determinant(u: np.ndarray) -> np.ndarray:
    """(k,) array: u₀² - |u₁|², positive inside the cone."""
    length = np.linalg.norm(u[:, 1:], axis=1)
    return np.maximum((u[:, 0] - length) * (u[:, 0] + length), 1e-300)


def _product(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Multiply in the cones' algebra: (u · v, u₀ v₁ + v₀ u₁)."""
    out = u[:, :1] * v + v[:, :1] * u
    out[:, 0] = (u * v).sum(axis=1)
    return out


def _quotient(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Find what gives v where u is multiplied with it."""
    first, across = u[:, 0], (u[:, 1:] * v[:, 1:]).sum(axis=1)
    out = np.empty_like(v)
    out[:, 0] = (first * v[:, 0] - across) / _determinant(u)
    out[:, 1:] = (v[:, 1:] - out[:, :1] * u[:, 1:]) / first[:, None]
    return out


def _to_edge(u: np.ndarray, change: np.ndarray) -> float:
    """Largest multiple of a change that stays in the cones."""
    a = change[:, 0] ** 2 - (change[:, 1:] ** 2).sum(axis=1)
    b = u[:, 0] * change[:, 0] - (u[:, 1:] * change[:, 1:]).sum(axis=1)
    c = _determinant(u)
    root = np.sqrt(np.maximum(b * b - a * c, 0.0))
    with np.errstate(divide="ignore", invalid="ignore"):
        # c + 2 b t + a t² = 0: the smaller positive root, without cancellation.
        hit = np.where(b < 0.0, c / (root - b), -(b + root) / a)
    hits = (b * b >= a * c) & ((b < 0.0) | (a < 0.0)) & (hit > 0.0)
    return min(float(np.where(hits, hit, np.inf).min(initial=np.inf)), _to_zero(u[:, 0], change[:, 0]))


def _to_zero(values: np.ndarray, change: np.ndarray) -> float:
    """Largest multiple of a change that leaves no positive value negative."""
    down = change < 0.0
    return float((values[down] / -change[down]).min(initial=np.inf))


def run_interior(program: ConicProgram) -> tuple[ConicSolution | None, str]:
    """Solve a program.

    Parameters
    ----------
    program : ConicProgram

    Returns
    -------
    ConicSolution or None
        None where it comes to nothing; its check is up to the caller.
    str
        What came of it.

    Raises
    ------
    Unbounded
        If a ray proves that the program has no minimum.

    Notes
    -----
    A primal-dual method with the scaling of Nesterov & Todd (1997), https://doi.org/10.1287/moor.22.1.1, predictor and
    corrector after Mehrotra (1992), https://doi.org/10.1137/0802028: every iteration factorises A W⁻² Aᵀ, whose blocks
    of 6 × 6 are the blocks of the structure and their neighbours, in an order of minimum degree.
    """
    started = time.perf_counter()
    try:
        with one_thread(), np.errstate(divide="raise", over="raise", invalid="raise"):
            x, y, iterations, status = _best(_Method(program))
    except (NoProgress, NotLimited, FloatingPointError) as reason:
        return None, str(reason)
    x = program.scale * x
    found = checked(program, x, y, "interior", iterations, time.perf_counter() - started)
    if not found.accepted:
        raise_if_proved(program, x)
    return found, status


def _best(method: _Method) -> tuple[np.ndarray, np.ndarray, int, str]:
    best = np.inf
    solution, since, status = (method.x(), method.point.row_dual), 0, f"{ITERATIONS} iterations"
    for iteration in range(ITERATIONS):
        rows, costs, off = method.residuals()
        since += 1
        if off < best:
            best, solution, since = off, (method.x(), method.point.row_dual), 0
        if off < TOLERANCE:
            return *solution, iteration, "solved"
        if since >= STALLED:
            status = "no better point"
            break
        try:
            length = method.iterate(rows, costs)
        except (NoProgress, FloatingPointError) as reason:
            status = str(reason)
            break
        if length < SHORTEST:
            status = "the steps became too short"
            break
    return *solution, iteration, status
