"""An interior method for the program of a step: as many iterations for a large step as for a small one.

The program's conditions, with the opening y of each contact point, its closing w beyond the largest normal force M
where that is finite, and the slide z = (σ₀, σ) of its disc of friction::

    N y = β,  (M - N) w = β     y - w = gap + n·v + c_n (N - N⁰)                        0 < N < M,  y, w > 0
    (B, T) ∘ (σ₀, σ) = 2β (1, 0)    σ = slip + t·v + c_t (T - T⁰)                       |T| < B, |σ| < σ₀

with the product ∘ of the round cone's algebra; β to 0 by Newton's method with Mehrotra's predictor and corrector
(1992), https://doi.org/10.1137/0802028. What belongs to one contact point is eliminated there, so that the matrix is
that of springs at the contact points: symmetric and positive definite.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .cones import CONVERGED, ITERATIONS, Scaling, inner, longest_step, product, quotient
from .problem import ContactProblem, NotSolved, StepSolution

#: Residual of the geometry, as a part of the movement, and force out of balance, in block weights, at which the method
#: has converged. The last is accepted of each, and of the mean product over the movement, where it goes no further.
FITS, BALANCED, ACCEPTED = 1e-8, 1e-9, 1e-6


class _Point(NamedTuple):
    """Movement, forces N, u = (B, T), openings y, yielding w and slides z, or a change of them."""

    motion: np.ndarray
    multiplier: float
    normal: np.ndarray
    opening: np.ndarray
    yielding: np.ndarray
    shear: np.ndarray
    slide: np.ndarray

    def moved(self, change: _Point, part: float) -> _Point:
        return _Point(*(value + part * by for value, by in zip(self, change, strict=True)))  # type: ignore[operator,arg-type]


def _frames(vectors: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(k, k, n) array: rows along and across each of n vectors (k, n); and their lengths."""
    length = np.sqrt(inner(vectors, vectors))
    along = np.where(length > 0.0, vectors / np.maximum(length, 1e-300), np.eye(len(vectors))[0][:, None])
    return along[None] if len(vectors) == 1 else np.stack([along, np.stack([-along[1], along[0]])]), length


class _Iterate:
    """Forces N, u = (B, T), openings y, yielding w and slides z of a problem's contact points, inside their bounds."""

    def __init__(self, problem: ContactProblem, multiplier: float) -> None:
        self.problem = problem
        self.rough = np.flatnonzero(problem.bound > 1e-8)
        self.limited = np.flatnonzero(np.isfinite(problem.most))
        # In smaller steps the compliance of the joints decides, and where a linearisation has gone too far what blocks
        # are in each other by.
        self.size = max(problem.size, 1e-5, -float(problem.gap.min()))
        mean = 0.03 * self.size
        before, bound = problem.forces[:, 0], problem.bound[self.rough]
        # The start lies well inside the cones.
        normal = np.maximum(before, 0.3)
        opening = np.maximum(problem.gap, mean / normal)
        normal = np.where(before > 0.0, normal, np.minimum(normal, mean / opening))
        normal = np.minimum(normal, 0.5 * problem.most)
        yielding = mean / (problem.most[self.limited] - normal[self.limited])
        shear, slip = problem.forces[self.rough, 1:].T, problem.slip[self.rough].T
        length = np.sqrt((shear**2).sum(axis=0))
        shear = np.concatenate([bound[None], shear * np.minimum(1.0, 0.9 * bound / np.maximum(length, 1e-300))])
        slide = np.concatenate([(np.sqrt((slip**2).sum(axis=0)) + 2.0 * mean / bound)[None], slip])
        self.count = len(problem.gap) + len(self.limited) + 2 * len(self.rough)
        self.take(_Point(np.zeros_like(problem.load), multiplier, normal, opening, yielding, shear, slide))

    def reserve(self, point: _Point) -> np.ndarray:
        """(k,) array: what is missing from limited normal forces to their limit."""
        return np.asarray(self.problem.most[self.limited] - point.normal[self.limited])

    def take(self, at: _Point) -> None:
        """Go to a point: the residuals of the equations and the mean product there."""
        self.at, p, rough = at, self.problem, self.rough
        relative = p.rows.relative(at.motion)
        self.unbalanced = p.unbalanced(at.motion, self.forces(at.normal, at.shear), at.multiplier)
        self.imbalance = float(np.abs(self.unbalanced).max())
        self.control_error = 0.0 if p.control is None else p.control_target - float(p.control @ at.motion)
        shortening = p.compliance[:, 0] * (at.normal - p.forces[:, 0])
        self.gap_error = at.opening - (p.gap + relative[:, 0] + shortening)
        self.gap_error[self.limited] -= at.yielding
        slip = (p.slip[rough] + relative[rough, 1:] - p.compliance[rough, 1:] * p.forces[rough, 1:]).T
        self.slip_error = at.slide[1:] - slip - p.compliance[rough, 1] * at.shear[1:]
        self.mean = self.mean_of(at)
        geometry_error = max(float(np.abs(self.gap_error).max()), float(np.abs(self.slip_error).max(initial=0.0)))
        self.residual = max(geometry_error, abs(self.control_error))

    def forces(self, normal: np.ndarray, shear: np.ndarray) -> np.ndarray:
        """(n, d) array: normal and shear forces of all contact points."""
        forces = np.zeros((len(normal), len(shear)))
        forces[:, 0] = normal
        forces[self.rough, 1:] = shear[1:].T
        return forces

    def mean_of(self, point: _Point) -> float:
        products = (point.normal * point.opening).sum() + (self.reserve(point) * point.yielding).sum()
        return float(products + (point.shear * point.slide).sum()) / self.count

    def factorise(self) -> None:
        """Factorise Newton's equations at this iterate."""
        p, d = self.problem, len(self.at.shear)
        self.scaling = Scaling(self.at.shear, self.at.slide)
        yielding = np.zeros_like(self.at.normal)
        yielding[self.limited] = self.at.yielding / self.reserve(self.at)
        self.normal_stiffness = 1.0 / (p.compliance[:, 0] + self.at.opening / self.at.normal + yielding)
        # (isotropic I + 2 η² w wᵀ)⁻¹ along w and across it: what rounds across is large along it.
        self.frames, self.length = _frames(self.scaling.w[1:])
        self.shear_stiffness = 1.0 / (p.compliance[self.rough, 1:].T + self.scaling.square)
        self.shear_stiffness[0] /= 1.0 + 2.0 * self.scaling.square * self.length**2 * self.shear_stiffness[0]
        stiffness = np.zeros((len(p.gap), d, d))
        stiffness[:, 0, 0] = self.normal_stiffness
        stiffness[self.rough, 1:, 1:] = np.einsum("ijn,in,ikn->njk", self.frames, self.shear_stiffness, self.frames)
        self.solve = p.rows.factorised(stiffness, p.viscosity)
        self.by_live = None if p.live is None else self.solve(p.live)

    def direction(
        self, opening_products: np.ndarray, yielding_products: np.ndarray, slide_products: np.ndarray
    ) -> _Point:
        """Newton's direction with what the products, those of slides in the scaling, are to change by."""
        p, scaling, limited = self.problem, self.scaling, self.limited
        normal_target = opening_products / self.at.normal + self.gap_error
        normal_target[limited] -= yielding_products / self.reserve(self.at)
        target = scaling.scaled(quotient(slide_products, scaling.scaled_point))
        slip_target = np.einsum("ijn,jn->in", self.frames, target[1:] + self.slip_error)

        def shear_of(along: np.ndarray) -> np.ndarray:
            return np.concatenate([np.zeros((1, len(self.rough))), np.einsum("ijn,in->jn", self.frames, along)])

        forces = self.forces(self.normal_stiffness * normal_target, shear_of(self.shear_stiffness * slip_target))
        motion, multiplier = self.solve(self.unbalanced + p.rows.resultant(forces)), 0.0
        if self.by_live is not None and p.control is not None:
            multiplier = float((self.control_error - p.control @ motion) / (p.control @ self.by_live))
            motion = motion + multiplier * self.by_live
        relative = p.rows.relative(motion)
        normal = self.normal_stiffness * (normal_target - relative[:, 0])
        yielding = (yielding_products + self.at.yielding * normal[limited]) / self.reserve(self.at)
        opening = relative[:, 0] + p.compliance[:, 0] * normal - self.gap_error
        opening[limited] += yielding
        slip = relative[self.rough, 1:].T
        along = self.shear_stiffness * (slip_target - np.einsum("ijn,jn->in", self.frames, slip))
        shear = shear_of(along)
        first = target[0] - 2.0 * scaling.square * scaling.w[0] * self.length * along[0]
        slide = np.concatenate([first[None], slip + p.compliance[self.rough, 1] * shear[1:] - self.slip_error])
        return _Point(motion, multiplier, normal, opening, yielding, shear, slide)

    def longest(self, change: _Point) -> float:
        """Largest part of a change, at most 1, that keeps everything inside."""
        at, to_limit = self.at, change.normal[self.limited] / self.reserve(self.at)
        to_zero = -change.normal / at.normal, -change.opening / at.opening, -change.yielding / at.yielding
        steepest = max(float(rates.max(initial=1.0)) for rates in (*to_zero, to_limit))
        return min(1.0 / steepest, longest_step(at.shear, change.shear), longest_step(at.slide, change.slide))


@np.errstate(all="ignore")  # A step that overflows is seen by its result.
def interior_point(problem: ContactProblem, multiplier: float = 0.0) -> StepSolution:
    """Follow the central path to the minimum of a step's program; raises ``NotSolved`` where it does not lead there."""
    point = _Iterate(problem, multiplier)
    for _ in range(ITERATIONS):
        size = max(point.size, float(np.abs(point.at.motion).max()))
        if point.mean <= CONVERGED and point.imbalance < BALANCED and point.residual <= FITS * size:
            break
        point.factorise()
        scaled_point = point.scaling.scaled_point
        normal_products, slide_products = point.at.normal * point.at.opening, product(scaled_point, scaled_point)
        yielding_products = point.reserve(point.at) * point.at.yielding
        change = point.direction(-normal_products, -yielding_products, -slide_products)
        part = point.longest(change)
        centring = min(max((point.mean_of(point.at.moved(change, part)) / point.mean) ** 3, 1e-4), 0.5)
        # Corrections of second order are bounded by the mean product.
        limit = 30.0 * point.mean
        second = np.clip(change.normal * change.opening, -limit, limit)
        closing = np.clip(-change.normal[point.limited] * change.yielding, -limit, limit)
        third = product(point.scaling.scaled(change.shear), point.scaling.unscaled(change.slide))
        third *= np.minimum(1.0, limit / np.maximum(np.abs(third).sum(axis=0), 1e-300))
        slide_target = -slide_products - third
        slide_target[0] += 2.0 * centring * point.mean
        target = centring * point.mean
        change = point.direction(target - normal_products - second, target - yielding_products - closing, slide_target)
        part = 0.99 * point.longest(change)
        if not (part > 1e-9 and np.isfinite(change.motion).all()):
            break
        point.take(point.at.moved(change, part))
    # Numbers that are none are not accepted.
    if not (point.mean <= ACCEPTED * size and point.imbalance <= ACCEPTED and point.residual <= ACCEPTED * size):
        raise NotSolved(f"mean product {point.mean / size:.1e} of the movement, {point.imbalance:.1e} out of balance")
    forces = point.forces(point.at.normal, point.at.shear)
    return StepSolution(point.at.motion, forces, problem.trial(point.at.motion), point.at.multiplier)
