"""A step in space: that of :mod:`solver.program.coulomb` with round friction cones.

For each contact point, with shear forces T = μ τ and slips σ in two directions::

    normal      0 ≤ N  ⊥  y = gap + c (N - N⁰) ≥ 0
    friction    (N, τ) and (γ, σ) in the round cone and orthogonal     with  σ = slip + c (T - T⁰)

γ, which nothing else holds, comes to |σ|: friction acts against the slip, all of it where there is one. In the plane
the cone is its two rays, and this the problem there. The interior method is the same, its directions scaled as Nesterov
& Todd (1997), https://doi.org/10.1287/moor.22.1.1, for what Andersen, Roos & Terlaky (2003),
https://doi.org/10.1007/s10107-002-0349-3, call the quadratic cone. Near a solution Newton's method takes over on what
forces answer to movements, as in plasticity: an elastic trial, taken back onto the cone along the shear force.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from .factors import factorised
from .step import (
    BALANCE,
    CAREFUL,
    EQUATIONS,
    ITERATIONS,
    LOOK_BACK,
    NEAR,
    PRODUCT,
    PRODUCT_LEFT,
    SHORT,
    Moved,
    NotSolved,
    Pattern,
    Step,
    paired,
)

#: Starts: least forces in mean block weights, least distances in parts of a step and an elastic give, and whether steps
#: are kept short.
STARTS = ((0.1, 1.0, False), (1.0, 3.0, True))

#: Joints that give so many times as much, at first by what factor they become stiffer, the least such factor, and how
#: often at most.
SOFTEST, STIFFER, LEAST_STIFFER, STIFFENINGS = 1e4, 4.0, 1.1, 40

#: Newton's iterations on the answers of the contact points, and how often a change may be halved that leads away.
TRIALS, HALVINGS = 25, 6

#: Part of the way to the nearest bound that is gone: less than in the plane, since shear forces that turn about a round
#: cone soon leave it where they are close to its edge.
SPARE = 0.9

#: A corrected step shorter than this part of the one before its correction is compared with one without.
WORSE = 0.9

#: Part of the mean product that is left after as many steps as one looks back, from which on the path leads nowhere.
STALLED = 0.5

#: Nearest that a point comes to the boundary of its cone, squared, as a part of its axis: keeps the scaling finite.
INSIDE = 1e-20


def solve_in_space(step: Step, pattern: Pattern, gone: np.ndarray, multiplier: float, near: Moved | None) -> Moved:
    """Solve a step with two shear forces a contact point; see :func:`solver.program.coulomb.solve_step`.

    Raises
    ------
    NotSolved
    """
    scale = step.size + step.give[1]
    if near is not None:
        found = _in_answers(step, pattern, gone, multiplier)
        if found is not None:
            return found
        (normal, *lean), (gap, *slip) = near.forces, near.distances
        start = _within(normal, np.array(lean), NEAR), _apart(gap, np.array(slip[1:]), NEAR * scale)
        try:
            return _followed(step, pattern, gone, multiplier, *start)
        except NotSolved:
            pass
    lean = (step.shear / np.maximum(step.friction, 1e-12)[:, None]).T
    failed = NotSolved("no start")
    for number, (force, distance, careful) in enumerate(STARTS):
        if number == 1:
            found = _from_soft_joints(step, pattern, gone, multiplier)
            if found is not None:
                return found
        start = _within(step.normal, lean, force), _apart(step.gap, step.slip.T, distance * scale)
        try:
            return _followed(step, pattern, gone, multiplier, *start, careful)
        except NotSolved as error:
            failed = error
    # In steps so short that nothing moves all is as it was.
    found = _in_answers(step, pattern, gone, multiplier)
    if found is None:
        raise failed
    return found


def _from_soft_joints(step: Step, pattern: Pattern, gone: np.ndarray, multiplier: float) -> Moved | None:
    """Solve a step with joints that give far more, and follow its solution while they become as stiff as they are."""
    soft = reached = SOFTEST
    ratio, motion = STIFFER, None
    for _ in range(STIFFENINGS):
        across, along = step.give
        found = _in_answers(replace(step, give=(across * soft, along * soft)), pattern, gone, multiplier, motion)
        if found is None:
            if motion is None or ratio < LEAST_STIFFER:
                return None
            ratio = float(np.sqrt(ratio))
        else:
            if soft == 1.0:
                return found
            reached, motion, multiplier = soft, found.motion, found.multiplier
        soft = max(reached / ratio, 1.0)
    return None


def _within(normal: np.ndarray, lean: np.ndarray, least: float) -> np.ndarray:
    """(3, n) array: N and τ of each point, inside the cone by at least so much."""
    size = np.sqrt((lean**2).sum(axis=0))
    lean = lean * np.minimum(1.0, np.maximum(normal, 0.0) / np.maximum(size, 1e-300))
    size = np.sqrt((lean**2).sum(axis=0))
    return np.stack([np.maximum(normal, size + least), *lean])


def _apart(gap: np.ndarray, slip: np.ndarray, least: float) -> np.ndarray:
    """(4, n) array: y, γ and σ of each point, positive and inside the cone by at least so much."""
    size = np.sqrt((slip**2).sum(axis=0))
    return np.stack([np.maximum(gap, 0.0) + least, size + 2.0 * least, *slip])


@np.errstate(all="ignore")  # A step that leaves the numbers is seen by what it gives.
def _followed(
    step: Step,
    pattern: Pattern,
    gone: np.ndarray,
    multiplier: float,
    forces: np.ndarray,
    distances: np.ndarray,
    careful: bool = False,
) -> Moved:
    mu, (across, along) = step.friction, step.give
    scale, no_slip = step.size + along, step.shear.T
    gap, slip = step.gap, step.slip.T
    motion, short = np.zeros(len(step.load)), False
    means: list[float] = []
    for iteration in range(ITERATIONS):
        normal, shear = forces[0], mu * forces[1:]
        gap_error = distances[0] - (gap + across * (normal - step.normal))
        slip_error = distances[2:] - (slip + along * (shear - no_slip))
        unbalanced = step.load + pattern.to_blocks @ paired(normal, shear.T) - step.drag * (gone + motion)
        behind = 0.0
        if step.live is not None and step.control is not None:
            unbalanced = unbalanced + multiplier * step.live
            behind = step.wanted - float(step.control @ motion)
        across_products, along_products = normal * distances[0], (forces * distances[1:]).sum(axis=0)
        mean = 0.5 * float(across_products.mean() + along_products.mean())
        largest = max(float(across_products.max()), float(along_products.max()))
        out = float(np.abs(unbalanced).max())
        wrong = max(float(np.abs(gap_error).max()), float(np.abs(slip_error).max()), abs(behind))
        if out < BALANCE and wrong < EQUATIONS * scale and largest < PRODUCT * across:
            return Moved(motion, normal, shear.T, multiplier, iteration, forces, distances, pattern)
        means.append(mean)
        if len(means) > LOOK_BACK and out < BALANCE and mean > STALLED * means[-1 - LOOK_BACK]:
            break
        newton = _Newton(step, pattern, forces, distances)
        errors = (gap_error, slip_error, unbalanced, behind)
        found = newton.direction(-across_products, -_product(newton.middle, newton.middle), *errors)
        part = newton.longest(found)
        after = _mean(forces + part * found.forces, distances + part * found.distances)
        centring = min(max((after / mean) ** 3, 1e-3), 0.8)
        second = found.forces[0] * found.distances[0]
        third = _product(newton.scaled(found.forces), newton.unscaled(found.distances[1:]))
        if careful or short:
            centring, second, third = (1.0 if short else max(centring, CAREFUL)), 0.0 * second, 0.0 * third
        aims = -_product(newton.middle, newton.middle)
        aims[0] += centring * mean
        ahead, found = part, newton.direction(centring * mean - across_products - second, aims - third, *errors)
        part = newton.longest(found)
        if part < WORSE * ahead and not (careful or short):
            # Far from the path the second order leads astray.
            straight = newton.direction(centring * mean - across_products, aims, *errors)
            found, part = max((found, part), (straight, newton.longest(straight)), key=lambda one: one[1])
        part *= SPARE
        if not (part > 0.0 and np.isfinite(found.motion).all()):
            break
        short = part < SHORT and not short
        motion, multiplier = motion + part * found.motion, multiplier + part * found.multiplier
        gap, slip = gap + part * found.relative[0], slip + part * found.relative[1:]
        forces, distances = forces + part * found.forces, distances + part * found.distances
    if out < BALANCE and wrong < EQUATIONS * scale and mean < PRODUCT_LEFT:
        # Points that neither carry nor are open converge slowly: by their answers at once, or as they are.
        reached = Moved(motion, normal, shear.T, multiplier, iteration, forces, distances, pattern)
        return _in_answers(step, pattern, gone, multiplier, motion) or reached
    raise NotSolved(f"balance {out:.1e}, distances {wrong:.1e}, product {mean:.1e} after {iteration} iterations")


def _mean(forces: np.ndarray, distances: np.ndarray) -> float:
    return 0.5 * float((forces[0] * distances[0]).mean() + (forces * distances[1:]).sum(axis=0).mean())


def _product(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(3, n) array: the product of the round cone's algebra, (a·b, a₀ b + b₀ a)."""
    return np.concatenate([(a * b).sum(axis=0)[None], a[0] * b[1:] + b[0] * a[1:]])


def _divided(c: np.ndarray, a: np.ndarray) -> np.ndarray:
    """(3, n) array: what a has to be multiplied by to give c."""
    inside = _inside(a)
    first = (a[0] * c[0] - (a[1:] * c[1:]).sum(axis=0)) / inside
    return np.concatenate([first[None], (c[1:] - first * a[1:]) / a[0]])


def _inside(a: np.ndarray) -> np.ndarray:
    """(n,) array: a₀² - |a|², written so that little cancels."""
    size = np.sqrt((a[1:] ** 2).sum(axis=0))
    return np.maximum((a[0] - size) * (a[0] + size), INSIDE * a[0] ** 2)


def _longest_in_cone(a: np.ndarray, change: np.ndarray) -> float:
    """Largest part of a change that stays inside the cone, infinite where nothing stops it."""
    square = change[0] ** 2 - (change[1:] ** 2).sum(axis=0)
    half = a[0] * change[0] - (a[1:] * change[1:]).sum(axis=0)
    inside = _inside(a)
    root = np.sqrt(np.maximum(half**2 - square * inside, 0.0))
    # The smallest positive root of square t² + 2 half t + inside, where there is one.
    meets = (half**2 >= square * inside) & ((square < 0.0) | (half < 0.0))
    with np.errstate(divide="ignore", invalid="ignore"):
        part = np.where(half < 0.0, inside / (root - half), (-half - root) / square)
    return float(np.where(meets & (part >= 0.0), part, np.inf).min(initial=np.inf))


@dataclass(frozen=True)
class _Direction:
    """A change: (3, n) forces N and τ, (4, n) distances y, γ and σ, (3, n) relative movements."""

    motion: np.ndarray
    relative: np.ndarray
    multiplier: float
    forces: np.ndarray
    distances: np.ndarray


class _Newton:
    """Newton's equations at one point of the central path, factorised once for several right-hand sides."""

    def __init__(self, step: Step, pattern: Pattern, forces: np.ndarray, distances: np.ndarray) -> None:
        self.step, self.pattern, self.forces, self.distances = step, pattern, forces, distances
        mu, (across, along) = step.friction, step.give
        u, v = forces, distances[1:]
        inside_u, inside_v = np.sqrt(_inside(u)), np.sqrt(_inside(v))
        a, b = u / inside_u, v / inside_v
        half = np.sqrt(0.5 * (1.0 + (a * b).sum(axis=0)))
        self.w = np.concatenate([(b[0] + a[0])[None], b[1:] - a[1:]]) / (2.0 * half)
        self.size = np.sqrt(inside_v / inside_u)
        self.middle = self.scaled(u)
        self.k_normal = distances[0] / forces[0] + across
        square = self.size**2
        self.h_normal = 2.0 * square * self.w[0] * self.w[1:]
        w1, w2 = self.w[1:]
        # Two by two: slips that τ takes, and the inverse, τ that slips take.
        first, second = square * (2.0 * w1**2 + 1.0) + along * mu, square * (2.0 * w2**2 + 1.0) + along * mu
        mixed = 2.0 * square * w1 * w2
        determinant = first * second - mixed**2
        self.answer = np.array([[second, -mixed], [-mixed, first]]) / determinant
        local = np.zeros((len(mu), 3, 3))
        local[:, 0, 0] = 1.0 / self.k_normal
        local[:, 1:, 0] = -(mu * self._lean(self.h_normal) / self.k_normal).T
        local[:, 1:, 1:] = np.moveaxis(mu * self.answer, 2, 0)
        self.solve = factorised(pattern.stiffness(local))
        self.by_live = None if step.live is None else self.solve(step.live)

    def _lean(self, slips: np.ndarray) -> np.ndarray:
        return np.einsum("ijn,jn->in", self.answer, slips)

    def scaled(self, u: np.ndarray) -> np.ndarray:
        """(3, n) array: forces in the scaling in which they and the distances are alike."""
        along = (self.w[1:] * u[1:]).sum(axis=0)
        rest = u[1:] + (u[0] + along / (1.0 + self.w[0])) * self.w[1:]
        return np.concatenate([(self.w[0] * u[0] + along)[None], rest]) * self.size

    def unscaled(self, v: np.ndarray) -> np.ndarray:
        """(3, n) array: distances in that scaling."""
        along = (self.w[1:] * v[1:]).sum(axis=0)
        rest = v[1:] + (along / (1.0 + self.w[0]) - v[0]) * self.w[1:]
        return np.concatenate([(self.w[0] * v[0] - along)[None], rest]) / self.size

    def longest(self, change: _Direction) -> float:
        """Largest part of a change that keeps everything inside its cone, at most 1."""
        part = min(
            _longest_in_cone(self.forces, change.forces), _longest_in_cone(self.distances[1:], change.distances[1:])
        )
        steepest = max(
            -float((change.forces[0] / self.forces[0]).min()), -float((change.distances[0] / self.distances[0]).min())
        )
        return min(1.0 / max(steepest, 1.0), part)

    def direction(
        self,
        across_aims: np.ndarray,
        along_aims: np.ndarray,
        gap_error: np.ndarray,
        slip_error: np.ndarray,
        unbalanced: np.ndarray,
        behind: float,
    ) -> _Direction:
        """The change that alters each product by its aim and takes the errors away."""
        step, normal = self.step, self.forces[0]
        for_normal = across_aims / normal + gap_error
        aimed = self.scaled(_divided(along_aims, self.middle))
        for_shear = aimed[1:] + slip_error
        at_once = for_normal / self.k_normal
        shear = step.friction * self._lean(for_shear - self.h_normal * at_once)
        motion = self.solve(unbalanced + self.pattern.to_blocks @ paired(at_once, shear.T))
        multiplier = 0.0
        if self.by_live is not None and step.control is not None:
            moved = float(step.control @ self.by_live)
            if moved == 0.0:
                raise NotSolved("the live load does not move the control point")
            multiplier = (behind - float(step.control @ motion)) / moved
            motion = motion + multiplier * self.by_live
        relative = (self.pattern.to_contacts @ motion).reshape(-1, 3).T
        d_normal = (for_normal - relative[0]) / self.k_normal
        lean = self._lean(for_shear - self.h_normal * d_normal - relative[1:])
        forces = np.concatenate([d_normal[None], lean])
        # Distances by the equations that they are linear in: through the scaling, which is steep at what slides, they
        # would lose their digits. γ by the product alone.
        across, along = step.give
        d_gap = relative[0] + across * d_normal - gap_error
        d_slip = relative[1:] + along * step.friction * lean - slip_error
        lean_now, apart = self.forces[1:], self.distances[1:]
        d_cone = (along_aims[0] - (apart * forces).sum(axis=0) - (lean_now * d_slip).sum(axis=0)) / normal
        return _Direction(motion, relative, multiplier, forces, np.stack([d_gap, d_cone, *d_slip]))


def _in_answers(
    step: Step, pattern: Pattern, gone: np.ndarray, multiplier: float, motion: np.ndarray | None = None
) -> Moved | None:
    """Newton's method on the forces that contact points answer a movement with; None where it leads nowhere."""
    mu, (across, along) = step.friction, step.give
    motion = np.zeros(len(step.load)) if motion is None else motion
    scale = step.size + along

    def answers(motion: np.ndarray) -> tuple[np.ndarray, ...]:
        relative = (pattern.to_contacts @ motion).reshape(-1, 3)
        normal = np.maximum(step.normal - (step.gap + relative[:, 0]) / across, 0.0)
        trial = step.shear - (step.slip + relative[:, 1:]) / along
        size, most = np.sqrt((trial**2).sum(axis=1)), mu * normal
        slides = size > most
        part = np.where(slides, most / np.maximum(size, 1e-300), 1.0)
        return relative, normal, trial * part[:, None], trial, size, slides

    def left(motion: np.ndarray, multiplier: float, normal: np.ndarray, shear: np.ndarray) -> tuple[np.ndarray, float]:
        unbalanced = step.load + pattern.to_blocks @ paired(normal, shear) - step.drag * (gone + motion)
        if step.live is None or step.control is None:
            return unbalanced, 0.0
        return unbalanced + multiplier * step.live, step.wanted - float(step.control @ motion)

    found = answers(motion)
    unbalanced, behind = left(motion, multiplier, *found[1:3])
    for iteration in range(TRIALS):
        relative, normal, shear, trial, size, slides = found
        out = float(np.abs(unbalanced).max())
        if out < BALANCE and abs(behind) < EQUATIONS * scale:
            lean = np.divide(shear, mu[:, None], out=np.zeros_like(shear), where=mu[:, None] > 0.0)
            slipped = step.slip + relative[:, 1:] + along * (shear - step.shear)
            distance = np.maximum(step.gap + relative[:, 0] + across * (normal - step.normal), 0.0)
            cone = np.sqrt((slipped**2).sum(axis=1))
            forces, distances = np.stack([normal, *lean.T]), np.stack([distance, cone, *slipped.T])
            return Moved(motion, normal, shear, multiplier, iteration, forces, distances, pattern)
        closed = normal > 0.0
        way = trial / np.maximum(size, 1e-300)[:, None]
        local = np.zeros((len(mu), 3, 3))
        local[:, 0, 0] = closed / across
        local[:, 1:, 0] = (closed & slides)[:, None] * (mu / across)[:, None] * way
        turning = np.where(slides, mu * normal / np.maximum(size, 1e-300), 1.0) * closed / along
        local[:, 1:, 1:] = turning[:, None, None] * (
            np.eye(2) - np.where(slides, 1.0, 0.0)[:, None, None] * way[:, :, None] * way[:, None, :]
        )
        try:
            solve = factorised(pattern.stiffness(local))
        except NotSolved:
            return None
        change, d_multiplier = solve(unbalanced), 0.0
        if step.live is not None and step.control is not None:
            by_live = solve(step.live)
            moved = float(step.control @ by_live)
            if moved == 0.0:
                return None
            d_multiplier = (behind - float(step.control @ change)) / moved
            change = change + d_multiplier * by_live
        part = 1.0
        for _ in range(HALVINGS):
            found = answers(motion + part * change)
            unbalanced, behind = left(motion + part * change, multiplier + part * d_multiplier, *found[1:3])
            if float(np.abs(unbalanced).max()) < out or iteration < 3:
                break
            part *= 0.5
        motion, multiplier = motion + part * change, multiplier + part * d_multiplier
        if not np.isfinite(motion).all():
            return None
    return None
