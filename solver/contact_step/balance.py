"""Forces in exact equilibrium within exact Coulomb friction that are nearest to given ones: one convex program.

Over the forces f = (N, T) of the closed contact points, with their compliance as metric::

    minimise  1/2 Σ c (f - f⁰)²   subject to   A f + load = 0,   0 ≤ N ≤ M,   |T| ≤ μ N + C,
              and, optionally,   r · f = R

From f⁰ = 0 these are the forces of least elastic energy, which are unique: those of a structure at rest. Primal-dual
interior method in the scaling of Nesterov & Todd, see :mod:`.cones`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from .cones import CONVERGED, ITERATIONS, Scaling, longest_step, product, quotient
from .factors import NotSolved
from .stiffness import ContactRows

#: Force out of balance, in block weights, at which it has converged.
BALANCED = 1e-11

#: Force out of balance, in block weights, that is accepted of an iterate that no further one improves: the programs of
#: bounds leave as much, and where one multiplier is in equilibrium the force that makes it the largest.
ACCEPTED = 5e-7

#: Sum of forces, as a multiple of the load, that no equilibrium of masonry needs.
LARGEST_FORCES = 1e6


@dataclass(frozen=True)
class _Change:
    """A change of the forces, of their multipliers z and w, and of the movement and multiplier of the equations."""

    forces: np.ndarray
    z: np.ndarray
    yielding: np.ndarray
    motion: np.ndarray
    rho: float


@dataclass(frozen=True)
class BalanceProblem:
    """The program over n closed contact points, forces in block weights."""

    rows: ContactRows
    reference: np.ndarray  #: (n, d): f⁰
    compliance: np.ndarray  #: (n, d): c, of which only ratios matter
    friction: np.ndarray  #: (n,)
    most: np.ndarray  #: (n,): M
    cohesion: np.ndarray  #: (n,): C
    load: np.ndarray  #: (n_dof,)
    unit_reaction: np.ndarray | None  #: (n, d): r
    reaction: float  #: R

    def __getitem__(self, chosen: np.ndarray) -> BalanceProblem:
        """Choose some of the contact points, by a mask or their numbers."""
        names = "rows", "reference", "compliance", "friction", "most", "cohesion", "unit_reaction"
        given = {name: value[chosen] for name in names if (value := getattr(self, name)) is not None}
        return replace(self, **given)


class _Iterate:
    """Forces f inside their friction cones, (μ N + C, T) = u, with multipliers z inside theirs, and w of the limits."""

    def __init__(self, problem: BalanceProblem) -> None:
        p, reference = problem, problem.reference
        # Where there is cohesion the cone does not keep normal forces from pulling.
        upper, lower = np.flatnonzero(np.isfinite(p.most)), np.flatnonzero(p.cohesion > 0.0)
        self.limited = np.concatenate([upper, lower])
        self.sense = np.concatenate([np.ones(len(upper)), -np.ones(len(lower))])
        self.limit = np.concatenate([p.most[upper], np.zeros(len(lower))])
        self.rows, self.reference, self.load = p.rows, reference, p.load
        self.unit_reaction, self.reaction = p.unit_reaction, p.reaction
        n, self.d = reference.shape
        self.slope = np.ones((n, self.d))
        self.slope[:, 0] = np.maximum(p.friction, 1e-9)  # A cone without width has no interior.
        self.offset = np.zeros((n, self.d))
        self.offset[:, 0] = p.cohesion
        rigid = np.isinf(p.most) if np.isinf(p.most).any() else np.ones(n, dtype=bool)
        self.weight = p.compliance / float(p.compliance[rigid, 0].mean())
        # The start lies well inside the cones.
        self.forces = reference.copy()
        self.forces[:, 0] = np.minimum(np.maximum(reference[:, 0], 0.1), 0.5 * p.most)
        length = np.sqrt((reference[:, 1:] ** 2).sum(axis=1))
        limit = 0.9 * self.slope[:, 0] * self.forces[:, 0] + 0.9 * p.cohesion
        self.forces[:, 1:] *= np.minimum(1.0, limit / np.maximum(length, 1e-300))[:, None]
        self.z = np.zeros((self.d, n))
        self.z[0] = np.maximum(1.0, 1.0 / (self.slope * self.forces + self.offset)[:, 0])
        self.yielding = 1.0 / self.reserve
        self.motion, self.rho, self.count = np.zeros_like(p.load), 0.0, 2 * n + len(self.limited)
        self.measure()

    @property
    def reserve(self) -> np.ndarray:
        """(k,) array: what is missing from limited normal forces to their limit."""
        return np.asarray(self.limit - self.sense * self.forces[self.limited, 0])

    def of_points(self, limits: np.ndarray) -> np.ndarray:
        """(n,) array: sums of numbers of the limits over each point, which may have both."""
        return np.bincount(self.limited, limits, len(self.forces))

    def measure(self) -> None:
        """Compute the forces out of balance and the mean product."""
        self.u = (self.slope * self.forces + self.offset).T
        self.unbalanced = self.load + self.rows.resultant(self.forces)
        given = self.unit_reaction is not None
        self.reaction_error = self.reaction - self._reaction_of(self.forces) if given else 0.0
        self.mean = float((self.u * self.z).sum() + self.reserve @ self.yielding) / self.count
        self.residual = max(float(np.abs(self.unbalanced).max()), abs(self.reaction_error))

    def factorise(self) -> None:
        """Factorise Newton's equations here; raises NotSolved or LinAlgError where rounding is all that is left."""
        self.scaling = Scaling(self.u, self.z)
        self.hessian = self.scaling.hessian()
        local = self.slope[:, :, None] * self.hessian * self.slope[:, None, :]
        local[:, 0, 0] += self.of_points(self.yielding / self.reserve)
        self.stiffness = np.linalg.inv(self.weight[:, :, None] * np.eye(self.d) + local)
        self.solve = self.rows.factorised(self.stiffness, np.zeros_like(self.load))
        metric = self.weight * (self.forces - self.reference)
        self.error = metric + self.rows.relative(self.motion) - self.slope * self.z.T
        self.error[:, 0] += self.of_points(self.sense * self.yielding)
        if self.unit_reaction is not None:
            self.error = self.error + self.rho * self.unit_reaction
            self.unit_forces = self._forces_by(self.unit_reaction)
            self.unit_resultant = self.rows.resultant(self.unit_forces)
            self.unit_motion = self.solve(self.unit_resultant)
            self.compliance = self._reaction_of(self.unit_forces) - float(self.unit_resultant @ self.unit_motion)

    def _reaction_of(self, forces: np.ndarray) -> float:
        return float((self.unit_reaction * forces).sum())

    def _forces_by(self, distances: np.ndarray) -> np.ndarray:
        return np.einsum("nij,nj->ni", self.stiffness, distances)

    def direction(self, products: np.ndarray, yielding_products: np.ndarray) -> _Change:
        """Newton's direction with what the products, those of cones in the scaling, are to change by."""
        target = self.scaling.scaled(quotient(products, self.scaling.scaled_point))
        distances = self.slope * target.T - self.error
        distances[:, 0] -= self.of_points(self.sense * yielding_products / self.reserve)
        forces = self._forces_by(distances)
        motion, rho = self.solve(self.unbalanced + self.rows.resultant(forces)), 0.0
        if self.unit_reaction is not None:
            by_motion = float(self.unit_resultant @ motion)
            rho = (self._reaction_of(forces) - self.reaction_error - by_motion) / self.compliance
            motion = motion - rho * self.unit_motion
            forces = forces - rho * self.unit_forces
        forces = forces - self._forces_by(self.rows.relative(motion))
        z = target - np.einsum("nij,jn->in", self.hessian, (self.slope * forces).T)
        yielding = (yielding_products + self.yielding * self.sense * forces[self.limited, 0]) / self.reserve
        return _Change(forces, z, yielding, motion, rho)

    def longest(self, change: _Change) -> float:
        """Largest part of a change, at most 1, that keeps everything inside."""
        steepest = float((self.sense * change.forces[self.limited, 0] / self.reserve).max(initial=1.0))
        steepest = float((-change.yielding / self.yielding).max(initial=steepest))
        in_cones = min(longest_step(self.u, (self.slope * change.forces).T), longest_step(self.z, change.z))
        return min(1.0 / steepest, in_cones)

    def mean_after(self, change: _Change, part: float) -> float:
        u = self.u + part * (self.slope * change.forces).T
        reserve = self.reserve - part * self.sense * change.forces[self.limited, 0]
        of_limits = float(reserve @ (self.yielding + part * change.yielding))
        return (float((u * (self.z + part * change.z)).sum()) + of_limits) / self.count

    def least_forces(self) -> float:
        """Sum of forces that an equilibrium has at least, as a multiple of the load; none exists where it is infinite.

        Farkas: what the load gains in a movement, points have to take at which it leaves the duals of their cones.
        """
        outside = self.rows.relative(self.motion) - self.slope * self.z.T
        outside[:, 0] += self.of_points(self.sense * self.yielding)
        gain = float(self.motion @ self.load) - float((self.offset * self.z.T).sum() + self.limit @ self.yielding)
        if self.unit_reaction is not None:
            outside = outside + self.rho * self.unit_reaction
            gain -= self.rho * self.reaction
        # Where there is no load nothing is gained.
        size = float(np.abs(self.load).sum()) + abs(self.reaction)
        return gain / max(float(np.abs(outside).max()) * size, 1e-300)

    def take(self, change: _Change, part: float) -> None:
        self.forces, self.z = self.forces + part * change.forces, self.z + part * change.z
        self.yielding = self.yielding + part * change.yielding
        self.motion, self.rho = self.motion + part * change.motion, self.rho + part * change.rho
        self.measure()


@np.errstate(all="ignore")  # A step that overflows is seen by its result.
def nearest_equilibrium(problem: BalanceProblem) -> np.ndarray:
    """(n, d) array: forces in equilibrium within friction nearest to the reference f⁰; raises ``NotSolved``."""
    forces = np.zeros_like(problem.reference)
    if len(forces) == 0:
        if np.abs(problem.load).max(initial=0.0) > ACCEPTED:
            raise NotSolved("nothing touches the free blocks")
        return forces
    loaded = problem.most > BALANCED
    if not loaded.all():
        # Those that can carry nothing would leave the program without an interior.
        forces[loaded] = nearest_equilibrium(problem[loaded])
        return forces
    point = _Iterate(problem)
    best, part = (point.residual, point.forces), 1.0
    for _ in range(ITERATIONS):
        converged = point.residual < BALANCED and point.mean < CONVERGED * max(1.0, float(point.forces[:, 0].max()))
        # What is out of balance after a short step stays so: there is no equilibrium, or a reaction has too few digits.
        if converged or part < (1e-6 if point.residual <= ACCEPTED else 1e-3) or point.mean == 0.0:
            break
        try:
            point.factorise()
        except (NotSolved, np.linalg.LinAlgError):
            break
        scaled_point = point.scaling.scaled_point
        present = product(scaled_point, scaled_point)
        yielding_products = point.reserve * point.yielding
        change = point.direction(-present, -yielding_products)
        part = point.longest(change)
        centring = min(max((point.mean_after(change, part) / point.mean) ** 3, 1e-4), 0.5)
        correction = product(point.scaling.scaled((point.slope * change.forces).T), point.scaling.unscaled(change.z))
        # Corrections of second order are bounded by the mean product.
        correction *= np.minimum(1.0, 10.0 * point.mean / np.maximum(np.abs(correction).sum(axis=0), 1e-300))
        products = -present - correction
        products[0] += 2.0 * centring * point.mean
        closing = -point.sense * change.forces[point.limited, 0] * change.yielding
        closing = np.clip(closing, -10.0 * point.mean, 10.0 * point.mean)
        change = point.direction(products, centring * point.mean - yielding_products - closing)
        part = 0.995 * point.longest(change)
        point.take(change, part)
        if not np.isfinite(point.residual):
            break
        if point.least_forces() > LARGEST_FORCES:
            raise NotSolved("no forces are in equilibrium: a movement gains more than they can take")
        # Of those in balance the last one is the nearest.
        best = min((point.residual, point.forces), best, key=lambda candidate: max(candidate[0], BALANCED))
    if best[0] > ACCEPTED:
        raise NotSolved(f"forces nearest to an equilibrium leave {best[0]:.1e} block weights out of balance")
    return best[1]
