"""An interior method for forces at contact points, of a step or in equilibrium: as many iterations whatever moves.

Of the springs of a step, and of forces that are to come nearest to given ones, the conditions are the same, with
distances y of the limits of the normal force and z = (z₀, z_t) of the cone of friction::

    c_n (N - N⁰) + gap + n·v + x r_n - y + w - μ z₀ = 0        N y = β,  (M - N) w = β       0 < N < M,  y, w > 0
    c_t (T - T⁰) + slip + t·v + x r_t - z_t = 0                (μ N + B, T) ∘ z = 2β (1, 0)  |T| < μ N + B, |z_t| < z₀
    load + x live + A (N, T) - D (g + v) = 0                   control · v + r · (N, T) = target

with the product ∘ of the round cone's algebra; β to 0 by Newton's method with Mehrotra's predictor and corrector
(1992), https://doi.org/10.1137/0802028. What belongs to one contact point is eliminated there, so that the matrix is
that of springs at the contact points: symmetric and positive definite.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .cones import Scaling, inner, longest_step, product, quotient
from .factors import NotSolved
from .problem import ContactProblem, StepSolution

#: Iterations; mean product of forces, in block weights, and distances, force out of balance, in block weights, and
#: error of the distances, as a part of the movement, at which it has converged: small beside the compliance, which
#: decides forces that equilibrium leaves open.
ITERATIONS, CONVERGED, BALANCED, FITS = 60, 1e-12, 1e-9, 1e-8

#: Force out of balance, in block weights, that is accepted of an iterate that no further one improves: the programs of
#: bounds leave as much, and where one multiplier is in equilibrium the force that makes it the largest.
ACCEPTED = 5e-7

#: Sum of forces, as a multiple of the load, that no equilibrium of masonry needs.
LARGEST_FORCES = 1e6


class _Change(NamedTuple):
    """Of normal (n,) and shear forces (d - 1, k), distances of limits (l,) and cones (d, k), movement, multiplier."""

    normal: np.ndarray
    shear: np.ndarray
    yielding: np.ndarray
    slide: np.ndarray
    motion: np.ndarray
    multiplier: float


def _frames(vectors: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(k, k, n) array: rows along and across each of n vectors (k, n); and their lengths."""
    length = np.sqrt(inner(vectors, vectors))
    along = np.where(length > 0.0, vectors / np.maximum(length, 1e-300), np.eye(len(vectors))[0][:, None])
    return along[None] if len(vectors) == 1 else np.stack([along, np.stack([-along[1], along[0]])]), length


class _Iterate:
    """Forces inside their limits and cones, with their distances, and the movement."""

    def __init__(self, problem: ContactProblem, multiplier: float) -> None:
        self.problem = p = problem
        friction = np.zeros(len(p.gap)) if p.friction is None else p.friction
        self.rough = np.flatnonzero((p.bound > 1e-8) | (friction > 0.0))
        # A cone without cohesion keeps normal forces from pulling.
        upper, lower = np.flatnonzero(np.isfinite(p.most)), np.flatnonzero((p.bound > 0.0) | (friction == 0.0))
        self.limited = np.concatenate([upper, lower])
        self.sense = np.concatenate([np.ones(len(upper)), -np.ones(len(lower))])
        self.limit = np.concatenate([p.most[upper], np.zeros(len(lower))])
        self.friction, self.bound = friction[self.rough], p.bound[self.rough]
        self.count = len(self.limited) + 2 * len(self.rough)
        # In smaller steps the compliance of the joints decides, and where a linearisation has gone too far what blocks
        # are in each other by.
        self.size = max(p.size, 1e-5, -float(p.gap.min()))
        mean = 0.03 * self.size
        # The start lies well inside limits and cones; rounding of forces before says nothing of a point that is open.
        normal = np.maximum(p.forces[:, 0], mean / np.maximum(p.gap, mean / 0.3))
        self.normal = np.minimum(normal, 0.5 * p.most)
        self.yielding = mean / (self.limit - self.sense * self.normal[self.limited])
        self.yielding[len(upper) :] = np.maximum(self.yielding[len(upper) :], p.gap[lower])
        limit, slip = self.friction * self.normal[self.rough] + self.bound, p.slip[self.rough].T
        shear = p.forces[self.rough, 1:].T
        self.shear = shear * np.minimum(1.0, 0.9 * limit / np.maximum(np.sqrt(inner(shear, shear)), 1e-300))
        self.slide = np.concatenate([(np.sqrt(inner(slip, slip)) + 2.0 * mean / limit)[None], slip])
        self.motion, self.multiplier = np.zeros_like(p.load), multiplier
        self.distance = np.column_stack([p.gap, p.slip]) - p.compliance * p.forces
        self.measure()

    def of_points(self, limits: np.ndarray) -> np.ndarray:
        """(n,) array: sums of numbers of the limits over each point, which may have both."""
        return np.bincount(self.limited, limits, len(self.normal))

    def in_cones(self, normal: np.ndarray, shear: np.ndarray, bound: np.ndarray | float = 0.0) -> np.ndarray:
        """(d, k) array: friction bounds of normal forces, and shear forces."""
        return np.concatenate([(self.friction * normal[self.rough] + bound)[None], shear])

    def forces(self, normal: np.ndarray, shear: np.ndarray) -> np.ndarray:
        """(n, d) array: normal and shear forces of all contact points."""
        forces = np.zeros_like(self.distance)
        forces[:, 0] = normal
        forces[self.rough, 1:] = shear.T
        return forces

    def measure(self) -> None:
        """Compute the residuals of the equations and the mean product."""
        p, rough = self.problem, self.rough
        # What is missing from limited normal forces to their limit.
        self.reserve = self.limit - self.sense * self.normal[self.limited]
        self.u = self.in_cones(self.normal, self.shear, self.bound)
        self.all_forces = self.forces(self.normal, self.shear)
        self.unbalanced = p.unbalanced(self.motion, self.all_forces, self.multiplier)
        error = self.distance + p.compliance * self.all_forces + p.rows.relative(self.motion)
        if p.unit_reaction is not None:
            error += self.multiplier * p.unit_reaction
        self.normal_error, self.shear_error = error[:, 0], error[rough, 1:].T - self.slide[1:]
        self.normal_error = self.normal_error + self.of_points(self.sense * self.yielding)
        self.normal_error[rough] -= self.friction * self.slide[0]
        self.missing = p.missing(self.motion, self.all_forces)
        self.mean = float((self.u * self.slide).sum() + self.reserve @ self.yielding) / self.count
        self.imbalance = float(np.abs(self.unbalanced).max())
        errors = self.normal_error, self.shear_error
        self.error = max(abs(self.missing), *(float(np.abs(of).max(initial=0.0)) for of in errors))
        self.moved = max(self.size, float(np.abs(self.motion).max()))

    def found(self) -> tuple[float, float, np.ndarray, np.ndarray, float]:
        """Force out of balance, error as a part of the movement, forces, movement and multiplier."""
        return self.imbalance, max(self.error, self.mean) / self.moved, self.all_forces, self.motion, self.multiplier

    def factorise(self) -> None:
        """Factorise Newton's equations at this iterate."""
        p, d = self.problem, self.distance.shape[1]
        self.scaling = Scaling(self.u, self.slide)
        self.frames, self.length = _frames(self.scaling.w[1:])
        # In the plane of the normal and the slide the inverse of c + W² has no differences; across it is a number.
        square, doubled, friction = self.scaling.square, 1.0 + 2.0 * self.length**2, self.friction
        normal = p.compliance[:, 0] + self.of_points(self.yielding / self.reserve)
        of_rough, tangential = normal[self.rough], p.compliance[self.rough, 1]
        along = tangential + square * doubled
        coupling = 2.0 * square * friction * self.scaling.w[0] * self.length
        determinant = of_rough * along + friction**2 * square * (tangential * doubled + square)
        self.normal_stiffness = 1.0 / normal
        self.normal_stiffness[self.rough] = along / determinant
        self.mixed_stiffness = -coupling / determinant
        self.shear_stiffness = np.tile(1.0 / (tangential + square), (d - 1, 1))
        self.shear_stiffness[0] = (of_rough + square * friction**2 * doubled) / determinant
        stiffness = np.zeros((len(normal), d, d))
        stiffness[:, 0, 0] = self.normal_stiffness
        stiffness[self.rough, 1:, 0] = stiffness[self.rough, 0, 1:] = (self.mixed_stiffness * self.frames[0]).T
        stiffness[self.rough, 1:, 1:] = np.einsum("ijn,in,ikn->njk", self.frames, self.shear_stiffness, self.frames)
        self.solve = p.rows.factorised(stiffness, p.viscosity)
        self.unit = None
        if p.live is not None:
            self.unit = self._solved(np.zeros_like(normal), np.zeros_like(self.shear), p.live)
        elif p.unit_reaction is not None:
            given = -p.unit_reaction
            *unit, relative = self._solved(given[:, 0], given[self.rough, 1:].T, np.zeros_like(p.load))
            self.unit = (*unit, relative - given)

    def _forces_by(self, normal: np.ndarray, shear: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Give normal forces, and shear forces along and across slides, by distances likewise."""
        of_normal = self.normal_stiffness * normal
        of_normal[self.rough] += self.mixed_stiffness * shear[0]
        of_shear = self.shear_stiffness * shear
        of_shear[0] += self.mixed_stiffness * normal[self.rough]
        return of_normal, of_shear

    def _in_frames(self, shear: np.ndarray) -> np.ndarray:
        return np.einsum("ijn,jn->in", self.frames, shear)

    def _solved(self, normal: np.ndarray, shear: np.ndarray, unbalanced: np.ndarray) -> tuple[np.ndarray, ...]:
        """Give the change of normal and shear forces by distances and forces out of balance, the movement, and its own.

        Its own is that at the contact points, (n, d).
        """
        p, shear = self.problem, self._in_frames(shear)
        of_normal, of_shear = self._forces_by(normal, shear)
        of_shear = np.einsum("ijn,in->jn", self.frames, of_shear)
        motion = self.solve(unbalanced + p.rows.resultant(self.forces(of_normal, of_shear)))
        relative = p.rows.relative(motion)
        shear = shear - self._in_frames(relative[self.rough, 1:].T)
        of_normal, of_shear = self._forces_by(normal - relative[:, 0], shear)
        return of_normal, np.einsum("ijn,in->jn", self.frames, of_shear), motion, relative

    def direction(self, limit_products: np.ndarray, products: np.ndarray) -> _Change:
        """Newton's direction with what the products, those of cones in the scaling, are to change by."""
        p, scaling, rough = self.problem, self.scaling, self.rough
        target = scaling.scaled(quotient(products, scaling.scaled_point))
        of_normal = -self.normal_error - self.of_points(self.sense * limit_products / self.reserve)
        of_normal[rough] += self.friction * target[0]
        normal, shear, motion, relative = self._solved(of_normal, target[1:] - self.shear_error, self.unbalanced)
        multiplier = 0.0
        if self.unit is not None:
            unit_normal, unit_shear, unit_motion, unit_relative = self.unit
            by_unit = p.measured(unit_motion, self.forces(unit_normal, unit_shear))
            # A live load that moves nothing along the control leaves no number.
            multiplier = float(np.divide(self.missing - p.measured(motion, self.forces(normal, shear)), by_unit))
            normal, shear = normal + multiplier * unit_normal, shear + multiplier * unit_shear
            motion, relative = motion + multiplier * unit_motion, relative + multiplier * unit_relative
        yielding = (limit_products + self.yielding * self.sense * normal[self.limited]) / self.reserve
        slide = relative[rough, 1:].T + p.compliance[rough, 1] * shear + self.shear_error
        # Of what the cone says of its first number the form in which little cancels.
        along = 2.0 * scaling.w[0] * inner(scaling.w[1:], target[1:] - slide)
        first = target[0] - (scaling.square * self.friction * normal[rough] + along) / (1.0 + 2.0 * self.length**2)
        return _Change(normal, shear, yielding, np.concatenate([first[None], slide]), motion, multiplier)

    def longest(self, change: _Change) -> float:
        """Largest part of a change, at most 1, that keeps everything inside."""
        steepest = float((self.sense * change.normal[self.limited] / self.reserve).max(initial=1.0))
        steepest = float((-change.yielding / self.yielding).max(initial=steepest))
        in_cones = longest_step(self.u, self.in_cones(change.normal, change.shear))
        return min(1.0 / steepest, in_cones, longest_step(self.slide, change.slide))

    def mean_after(self, change: _Change, part: float) -> float:
        u = self.u + part * self.in_cones(change.normal, change.shear)
        reserve = self.reserve - part * self.sense * change.normal[self.limited]
        of_limits = float(reserve @ (self.yielding + part * change.yielding))
        return (float((u * (self.slide + part * change.slide)).sum()) + of_limits) / self.count

    def take(self, change: _Change, part: float) -> None:
        self.normal, self.shear = self.normal + part * change.normal, self.shear + part * change.shear
        self.yielding = self.yielding + part * change.yielding
        self.slide, self.motion = self.slide + part * change.slide, self.motion + part * change.motion
        self.multiplier += part * change.multiplier
        self.measure()

    def least_forces(self) -> float:
        """Sum of forces that an equilibrium has at least, as a multiple of the load; none exists where it is infinite.

        Farkas: what the load gains in a movement, points have to take at which it leaves the duals of their cones.
        """
        p = self.problem
        given = self.distance + p.compliance * self.all_forces
        outside = self.normal_error - given[:, 0], self.shear_error - given[self.rough, 1:].T
        gain = float(self.motion @ p.load) - float(self.bound @ self.slide[0] + self.limit @ self.yielding)
        if p.unit_reaction is not None:
            gain -= self.multiplier * p.reaction
        # Where there is no load nothing is gained.
        size = float(np.abs(p.load).sum()) + abs(p.reaction)
        return gain / max(max(float(np.abs(of).max(initial=0.0)) for of in outside) * size, 1e-300)


@np.errstate(all="ignore")  # A step that overflows is seen by its result.
def interior_point(problem: ContactProblem, multiplier: float = 0.0) -> StepSolution:
    """Follow the central path to the minimum, or as near as it leads.

    Raises ``NotSolved`` where nothing resists but contact points and no forces of theirs are in equilibrium.
    """
    point = _Iterate(problem, multiplier)
    rigid, best, part = not problem.viscosity.any(), point.found(), 1.0
    for _ in range(ITERATIONS):
        fits = point.error <= FITS * point.moved
        converged = point.mean <= CONVERGED and point.imbalance < BALANCED and fits
        # Of forces in equilibrium what is out of balance after a short step stays so: there are none, or a reaction has
        # too few digits. Springs have a minimum.
        if converged or (rigid and part < (1e-6 if point.imbalance <= ACCEPTED else 1e-3)):
            break
        try:
            point.factorise()
        except NotSolved:
            break
        scaled_point = point.scaling.scaled_point
        slide_products, yielding_products = product(scaled_point, scaled_point), point.reserve * point.yielding
        change = point.direction(-yielding_products, -slide_products)
        part = point.longest(change)
        centring = min(max((point.mean_after(change, part) / point.mean) ** 3, 1e-4), 0.5)
        # Corrections of second order are bounded by the mean product.
        limit, target = 30.0 * point.mean, centring * point.mean
        closing = np.clip(-point.sense * change.normal[point.limited] * change.yielding, -limit, limit)
        shear = point.in_cones(change.normal, change.shear)
        second = product(point.scaling.scaled(shear), point.scaling.unscaled(change.slide))
        second *= np.minimum(1.0, limit / np.maximum(np.abs(second).sum(axis=0), 1e-300))
        slide_target = -slide_products - second
        slide_target[0] += 2.0 * target
        change = point.direction(target - yielding_products - closing, slide_target)
        part, before = 0.99 * point.longest(change), point.imbalance
        point.take(change, part)
        if not np.isfinite(point.imbalance):
            break
        if rigid and point.least_forces() > LARGEST_FORCES:
            raise NotSolved("no forces are in equilibrium: a movement gains more than they can take")
        # Of those in balance the last one is the best; springs have one movement, rigid points any.
        best = min(point.found(), best, key=lambda found: max(found[0], BALANCED if rigid else found[1], BALANCED))
        # What a step was to take out of balance and has not is rounding.
        near = max(point.error, point.mean) <= FITS * point.moved
        if near and BALANCED < point.imbalance <= ACCEPTED and point.imbalance > (1.0 - 0.5 * part) * before:
            break
    imbalance, error, forces, motion, multiplier = best
    return StepSolution(motion, forces, problem.trial(motion), multiplier, imbalance, error)
