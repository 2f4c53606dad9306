"""One step of the path: Coulomb friction without lift, at a linearised geometry.

Over the movements q of the free blocks in a step h of the supports, with the contact forces N (compression) and
T = μ τ, one shear force in the plane, two in space::

    balance     f + Aᵀ (N, T) = (η / h) W q                      the drag W: weights, and weights times radius squared
    normal      0 ≤ N  ⊥  y = gap + c (N - N⁰) ≥ 0              the gap after the movement
    friction    (N, τ) and (γ, σ) in the round cone and orthogonal     with  σ = slip + c (T - T⁰)

N⁰ and T⁰ are the forces of the step before: joints give a little, elastically, and remember what they carried. γ, which
nothing else holds, comes to |σ|: a point that slides takes all of its friction, against the slip, and does not lift. In
the plane the cone is its two rays. Without the give the forces of a wall are not unique, without the drag its motion is
not; both are small, see :mod:`solver.tolerances`.

The complementarity problem is that of De Saxcé's cone, and friction without lift makes it no convex program: a step of
some length may have several solutions. Newton's method on the points' states, as in plasticity, finds one where things
go on as they did. Where it does not, in the plane the step is followed from its start (:mod:`solver.program.led`): the
solution is the one that the start leads to, and shorter steps lead to the same.

Where nothing is remembered, in space, and where the start leads nowhere, an interior method follows the central path of
the problem: yN = β and the product of the cone's algebra 2β (1, 0), β to 0, Newton's method with one sparse
factorisation an iteration, scaled as Nesterov & Todd (1997), https://doi.org/10.1287/moor.22.1.1, for what Andersen,
Roos & Terlaky (2003), https://doi.org/10.1007/s10107-002-0349-3, call the quadratic cone, predictor and corrector
(Mehrotra 1992, https://doi.org/10.1137/0802028). Once the path shows which points are open, stick or slide, Newton's
method on the states takes over. Where it ends, too, the caller takes a smaller step of the supports, for which the drag
dominates.

In the plane the friction law is the linear complementarity form of Stewart & Trinkle (1996) and of Anitescu & Potra
(1997), https://doi.org/10.1023/A:1008292328909, here for quasi-static steps.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from .led import led
from .states import BALANCE, EQUATIONS, STATES, in_states
from .step import Moved, NotSolved, Pattern, Step, paired

#: Iterations, and part of the way to the nearest bound that is gone, in the plane and in space, where shear forces that
#: turn about a round cone soon leave it close to its edge.
ITERATIONS, FRACTION, FRACTION_IN_SPACE = 60, 0.99, 0.9

#: The solution counts when balance and the linear equations are met as in given states, and the largest product is
#: below this, in elastic gives across. A point that neither carries nor is open keeps a force of its root.
PRODUCT = 1e-9

#: Balance, the linear equations as above, and mean product of force and distance, in block weights and sizes, at which
#: a solution that converges no further counts: forces that are reported are balanced once more, and the geometry is
#: measured anew.
BALANCE_LEFT, EQUATIONS_LEFT, PRODUCT_LEFT = 1e-7, 1e-6, 1e-9

#: Start: least forces in mean block weights, least distances in parts of a step and an elastic give.
FIRST_FORCE, FIRST_DISTANCE = 0.1, 0.3

#: Start near a known solution: product of each force and its distance, in parts of a step and an elastic give. A
#: hundred times or a hundredth of it cost a tenth more iterations.
CENTRED = 1e-3

#: A step this short calls for centring.
SHORT = 0.2

#: Part of the mean product that is left after so many steps, from which on the path leads nowhere.
STALLED, LOOK_BACK = 0.8, 8

#: Corrections of second order are cut off at so many times the mean product.
CORRECTION = 30.0

#: Mean product, in elastic gives across, from which on the states at a point of the central path are tried as those of
#: the solution; where they are not, again after the mean product has fallen by the second number.
STATES_SEEN, AGAIN = 1e-3, 100.0

#: A step that is solved by parts, in space or from no forces: the first of them, by how much a part becomes shorter
#: where its states are not found, the least, and how many of those there may be: where a structure jumps, no part is
#: short enough, and a smaller step of the supports, for which the drag holds, costs less.
FIRST_PART, SHORTER, LEAST_PART, LEAST_PARTS = 0.25, 4.0, 0.004, 4

#: Nearest that a point comes to the boundary of its cone, squared, as a part of its axis: keeps the scaling finite.
INSIDE = 1e-20


@np.errstate(all="ignore")  # A step that leaves the numbers is seen by what it gives.
def solve_step(
    step: Step,
    gone: np.ndarray,
    multiplier: float = 0.0,
    near: Moved | None = None,
    *,
    by_way: bool = True,
    at_once: bool = False,
) -> Moved:
    """Solves a step.

    Parameters
    ----------
    step : Step
    gone : (n_dof,) array
        Movement since the start of the step, which the drag resists, too.
    multiplier : float
        Of the live load, to start from.
    near : Moved, optional
        The solution at a geometry very near, with the same contact points.
    by_way : bool
        In the plane, of several solutions that to which the start of the step leads.
    at_once : bool
        Only where Newton's method on the points' states finds one.

    Raises
    ------
    NotSolved
    """
    if len(step.gap) == 0:
        # Nothing touches anything: the drag alone holds.
        none = np.zeros((3, 0))
        return Moved(step.load / step.drag - gone, none[0], step.shear, multiplier, 0, none, none)
    pattern = Pattern(step) if near is None or near.pattern is None else near.pattern.fill(step)
    scale = step.size + step.give[1]
    remembers = bool((step.normal > 0.0).any())
    plane, unmoved, found = step.shear.shape[1] == 1, _unmoved(step, multiplier), None
    if near is not None or remembers:
        # Mostly things go on as they did, or a few points change.
        found = in_states(step, pattern, gone, near or unmoved)
    if found is None and by_way and remembers and plane:
        with suppress(NotSolved):
            found = in_states(step, pattern, gone, led(step, pattern, gone, unmoved))
    if found is not None:
        return found
    if at_once:
        raise NotSolved("the points' states are not those of the start, or a few changes away")
    if near is not None:
        start = _centred(near, scale)
    else:
        start = (
            _within(step.normal, _lean(step), FIRST_FORCE),
            _apart(step.gap, step.slip.T, FIRST_DISTANCE * scale),
        )
    try:
        return _followed(step, pattern, gone, multiplier, *start)
    except NotSolved:
        if plane and remembers:
            raise
        return _continued(step, pattern, gone, multiplier)


def _continued(step: Step, pattern: Pattern, gone: np.ndarray, multiplier: float) -> Moved:
    """Solve a step by parts, from nothing moved and the forces remembered, each part from the one before.

    Raises
    ------
    NotSolved
    """
    live = 0.0 if step.live is None else multiplier * step.live
    unbalanced = step.load + live + pattern.to_blocks @ paired(step.normal, step.shear) - step.drag * gone
    near = _unmoved(step, multiplier)
    gap, gone_by, part, least_parts = near.distances[0], 0.0, FIRST_PART, 0
    while gone_by < 1.0:
        to = min(gone_by + part, 1.0)
        now = replace(
            step,
            load=step.load - (1.0 - to) * unbalanced,
            gap=gap + to * (step.gap - gap),
            slip=to * step.slip,
            wanted=to * step.wanted,
        )
        found = in_states(now, pattern, gone, near)
        if found is None and part > LEAST_PART:
            part /= SHORTER
            continue
        if found is None:
            least_parts += 1
            if least_parts > LEAST_PARTS:
                raise NotSolved(f"no short parts lead beyond {gone_by:.3f} of the step")
            least = FIRST_DISTANCE * (step.size * (to - gone_by) + step.give[1])
            start = (
                _within(near.forces[0], near.forces[1:], FIRST_FORCE),
                _apart(near.distances[0], near.distances[2:], least),
            )
            found = _followed(now, pattern, gone, near.multiplier, *start)
        gone_by, near, part = to, found, 2.0 * part
    return near


def _within(normal: np.ndarray, lean: np.ndarray, least: float) -> np.ndarray:
    """(d, n) array: N and τ of each point, inside the cone by at least so much."""
    size = np.sqrt((lean**2).sum(axis=0))
    lean = lean * np.minimum(1.0, np.maximum(normal, 0.0) / np.maximum(size, 1e-300))
    size = np.sqrt((lean**2).sum(axis=0))
    return np.stack([np.maximum(normal, size + least), *lean])


def _apart(gap: np.ndarray, slip: np.ndarray, least: float) -> np.ndarray:
    """(d + 1, n) array: y, γ and σ of each point, positive and inside the cone by at least so much."""
    size = np.sqrt((slip**2).sum(axis=0))
    return np.stack([np.maximum(gap, 0.0) + least, size + 2.0 * least, *slip])


def _centred(near: Moved, scale: float) -> tuple[np.ndarray, np.ndarray]:
    """Forces and distances near those of a solution whose products are all the same."""
    normal, lean = near.forces[0], near.forces[1:]
    gap, cone, slip = near.distances[0], near.distances[1], near.distances[2:]
    # Along the direction of shear forces and slips the round cone is its two rays.
    size = np.sqrt((lean**2).sum(axis=0))
    slipped = np.sqrt((slip**2).sum(axis=0))
    way = np.where(size > 0.0, lean / np.maximum(size, 1e-300), -slip / np.maximum(slipped, 1e-300))
    way = np.where((size > 0.0) | (slipped > 0.0), way, 0.0)
    way[0] = np.where((way**2).sum(axis=0) > 0.0, way[0], 1.0)
    along = (way * slip).sum(axis=0)
    rays = 0.5 * np.stack([normal + size, normal - size])
    apart = np.stack([cone + along, cone - along])
    forces = _between(np.stack([normal, *rays]), np.stack([gap, *apart]), scale)
    forces[1:] *= forces[0] / (forces[1] + forces[2])
    distances = CENTRED * scale / forces
    return (
        np.stack([forces[0], *(way * (forces[1] - forces[2]))]),
        np.stack([distances[0], 0.5 * (distances[1] + distances[2]), *(way * 0.5 * (distances[1] - distances[2]))]),
    )


def _between(forces: np.ndarray, distances: np.ndarray, scale: float) -> np.ndarray:
    lean = forces - distances / scale
    found = 0.5 * (lean + np.hypot(lean, 2.0 * np.sqrt(CENTRED)))
    # Of what is wide open rounding has left nothing.
    return np.maximum(found, CENTRED * scale / (10.0 * scale + np.abs(distances)))


def _lean(step: Step) -> np.ndarray:
    """(d - 1, n) array: τ of the forces that a step remembers."""
    return (step.shear / np.maximum(step.friction, 1e-12)[:, None]).T


def _unmoved(step: Step, multiplier: float) -> Moved:
    """The start of a step as a solution: the forces remembered, what carries closed, nothing moved."""
    forces = _within(step.normal, _lean(step), 0.0)
    carries = step.normal > STATES * float(step.normal.max(initial=0.0))
    gap = np.where(carries, 0.0, np.maximum(step.gap, 0.0))
    distances = _apart(gap, np.zeros_like(step.slip.T), 0.0)
    return Moved(np.zeros(len(step.load)), step.normal, step.shear, multiplier, 0, forces, distances)


def _followed(
    step: Step,
    pattern: Pattern,
    gone: np.ndarray,
    multiplier: float,
    forces: np.ndarray,
    distances: np.ndarray,
) -> Moved:
    mu, (across, along) = step.friction, step.give
    scale, no_slip = step.size + along, step.shear.T
    gap, slip, to_try = step.gap, step.slip.T, STATES_SEEN * across
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
        mean = float(across_products.mean() + along_products.mean()) / 3.0
        largest = max(float(across_products.max()), float(along_products.max()))
        out = float(np.abs(unbalanced).max())
        wrong = max(float(np.abs(gap_error).max()), float(np.abs(slip_error).max()), abs(behind))
        here = Moved(motion, normal, shear.T, multiplier, iteration, forces, distances, pattern)
        if out < BALANCE and wrong < EQUATIONS * scale and largest < PRODUCT * across:
            return here
        if mean < to_try:
            to_try = mean / AGAIN
            found = in_states(step, pattern, gone, here)
            if found is not None:
                return replace(found, iterations=iteration + found.iterations)
        means.append(mean)
        if len(means) > LOOK_BACK and mean > STALLED * means[-1 - LOOK_BACK]:
            break
        newton = _Newton(step, pattern, forces, distances)
        errors = (gap_error, slip_error, unbalanced, behind)
        change = newton.direction(-across_products, -_product(newton.middle, newton.middle), *errors)
        part = newton.longest(change)
        after = _mean(forces + part * change.forces, distances + part * change.distances)
        centring = min(max((after / mean) ** 3, 1e-3), 0.8)
        most = CORRECTION * mean
        second = np.clip(change.forces[0] * change.distances[0], -most, most)
        third = _product(newton.scaled(change.forces), newton.unscaled(change.distances[1:]))
        third *= np.minimum(1.0, most / np.maximum(np.abs(third[0]) + np.sqrt((third[1:] ** 2).sum(axis=0)), 1e-300))
        if short:
            centring, second, third = 1.0, 0.0 * second, 0.0 * third
        aims = -_product(newton.middle, newton.middle)
        aims[0] += 2.0 * centring * mean
        change = newton.direction(centring * mean - across_products - second, aims - third, *errors)
        part = newton.longest(change)
        part *= FRACTION if len(forces) == 2 else FRACTION_IN_SPACE
        if not (part > 0.0 and np.isfinite(change.motion).all()):
            break
        short = part < SHORT and not short
        motion, multiplier = motion + part * change.motion, multiplier + part * change.multiplier
        gap, slip = gap + part * change.relative[0], slip + part * change.relative[1:]
        forces, distances = forces + part * change.forces, distances + part * change.distances
    if out < BALANCE_LEFT and wrong < EQUATIONS_LEFT * scale and mean < PRODUCT_LEFT:
        # Points that neither carry nor are open converge slowly: by their states at once, or as they are.
        return in_states(step, pattern, gone, here) or here
    raise NotSolved(f"balance {out:.1e}, distances {wrong:.1e}, product {mean:.1e} after {iteration} iterations")


def _mean(forces: np.ndarray, distances: np.ndarray) -> float:
    """Mean product: a round cone counts twice."""
    return float((forces[0] * distances[0]).mean() + (forces * distances[1:]).sum(axis=0).mean()) / 3.0


def _product(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(d, n) array: the product of the round cone's algebra, (a·b, a₀ b + b₀ a)."""
    return np.concatenate([(a * b).sum(axis=0)[None], a[0] * b[1:] + b[0] * a[1:]])


def _divided(c: np.ndarray, a: np.ndarray) -> np.ndarray:
    """(d, n) array: what a has to be multiplied by to give c."""
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
    """A change: (d, n) forces N and τ, (d + 1, n) distances y, γ and σ, (d, n) relative movements."""

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
        d = len(forces)
        # τ that slips take: the inverse of even I + steep w wᵀ, along w and across, so that nothing cancels.
        even, lean = square + along * mu, self.w[1:]
        size = np.sqrt((lean**2).sum(axis=0))
        way = np.divide(lean, size, out=np.zeros_like(lean), where=size > 0.0)
        both = way[:, None] * way[None]
        self.answer = (np.eye(d - 1)[:, :, None] - both) / even + both / (even + 2.0 * square * size**2)
        local = np.zeros((len(mu), d, d))
        local[:, 0, 0] = 1.0 / self.k_normal
        local[:, 1:, 0] = -(mu * self._lean(self.h_normal) / self.k_normal).T
        local[:, 1:, 1:] = np.moveaxis(mu * self.answer, 2, 0)
        self.solve = pattern.factorised(local)
        self.by_live = None if step.live is None else self.solve(step.live)

    def _lean(self, slips: np.ndarray) -> np.ndarray:
        return np.einsum("ijn,jn->in", self.answer, slips)

    def scaled(self, u: np.ndarray) -> np.ndarray:
        """(d, n) array: forces in the scaling in which they and the distances are alike."""
        along = (self.w[1:] * u[1:]).sum(axis=0)
        rest = u[1:] + (u[0] + along / (1.0 + self.w[0])) * self.w[1:]
        return np.concatenate([(self.w[0] * u[0] + along)[None], rest]) * self.size

    def unscaled(self, v: np.ndarray) -> np.ndarray:
        """(d, n) array: distances in that scaling."""
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
        relative = (self.pattern.to_contacts @ motion).reshape(-1, len(self.forces)).T
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
