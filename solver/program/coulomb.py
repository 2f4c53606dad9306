"""One step of the path: Coulomb friction without lift, at a linearised geometry, by an interior method.

Over the movements q of the free blocks in a step h of the supports, with the contact forces N (compression) and T::

    balance     f + Aᵀ (N, T) = (η / h) W q                      the drag W: weights, and weights times radius squared
    normal      0 ≤ N  ⊥  y = gap + c (N - N⁰) ≥ 0              the gap after the movement
    friction    T = μ (λ⁺ - λ⁻), N = λ⁺ + λ⁻, 0 ≤ λ± ⊥ σ± ≥ 0     with  σ⁺ - σ⁻ = slip + c (T - T⁰)

N⁰ and T⁰ are the forces of the step before: joints give a little, elastically, and remember what they carried. A point
that slides takes all of its friction and does not lift. Without the give the forces of a wall are not unique, without
the drag its motion is not; both are small, see :mod:`solver.tolerances`.

The complementarity problem is linear, but friction without lift makes it no convex program. An interior method follows
its central path all the same: λσ = yN = β with β to zero, Newton's method with one sparse factorisation an iteration,
predictor and corrector (Mehrotra 1992, https://doi.org/10.1137/0802028). Where long steps leave the path, a second try
takes short ones; where that fails, too, the caller takes a smaller step of the supports, for which the drag dominates.

The friction law is the linear complementarity form of Stewart & Trinkle (1996) and of Anitescu & Potra (1997),
https://doi.org/10.1023/A:1008292328909, here for quasi-static steps.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from .coulomb_in_space import solve_in_space
from .factors import factorised
from .step import (
    BALANCE,
    CAREFUL,
    CORRECTION,
    EQUATIONS,
    FIRST_DISTANCE,
    FIRST_FORCE,
    FRACTION,
    ITERATIONS,
    LOOK_BACK,
    LOST,
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

#: Newton's method on the points' states: part of a force that counts as none, and changes of states after which it is
#: given up.
STATES, STATE_CHANGES = 1e-9, 12


def solve_step(step: Step, gone: np.ndarray, multiplier: float = 0.0, near: Moved | None = None) -> Moved:
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

    Raises
    ------
    NotSolved
    """
    if len(step.gap) == 0:
        # Nothing touches anything: the drag alone holds.
        none = np.zeros((3, 0))
        return Moved(step.load / step.drag - gone, none[0], step.shear, multiplier, 0, none, none)
    pattern = Pattern(step) if near is None or near.pattern is None else near.pattern.fill(step)
    if step.shear.shape[1] > 1:
        return solve_in_space(step, pattern, gone, multiplier, near)
    flat = replace(step, slip=step.slip[:, 0], shear=step.shear[:, 0])
    found = _solve_in_plane(flat, pattern, gone, multiplier, near and replace(near, shear=near.shear[:, 0]))
    return replace(found, shear=found.shear[:, None])


def _solve_in_plane(step: Step, pattern: Pattern, gone: np.ndarray, multiplier: float, near: Moved | None) -> Moved:
    """Solve a step whose slips and shear forces are (n_contacts,) arrays."""
    scale = step.size + step.give[1]
    if near is not None:
        found = _in_states(step, pattern, gone, multiplier, near)
        if found is not None:
            return found
        rays = np.maximum(near.forces[1:], NEAR)
        distances = np.maximum(near.distances, NEAR * scale)
        try:
            return _followed(step, pattern, gone, multiplier, np.stack([rays[0] + rays[1], *rays]), distances)
        except NotSolved:
            pass
    # Rows of forces: N, λ⁺, λ⁻; of distances: y, σ⁺, σ⁻.
    steep = np.maximum(step.friction, 1e-12)
    rays = [np.maximum(0.5 * (step.normal + side * step.shear / steep), FIRST_FORCE) for side in (1.0, -1.0)]
    forces = np.stack([rays[0] + rays[1], *rays])
    distances = np.stack([np.maximum(x, 0.0) + FIRST_DISTANCE * scale for x in (step.gap, step.slip, -step.slip)])
    try:
        return _followed(step, pattern, gone, multiplier, forces, distances)
    except NotSolved:
        pass
    try:
        return _followed(step, pattern, gone, multiplier, forces, distances, careful=True)
    except NotSolved:
        # In steps so short that nothing moves all is as it was.
        remembered = np.stack([step.normal, *rays]), np.maximum(np.stack([step.gap, step.slip, -step.slip]), 0.0)
        before = Moved(np.zeros(len(gone)), step.normal, step.shear, multiplier, 0, *remembered)
        found = _in_states(step, pattern, gone, multiplier, before)
        if found is None:
            raise
        return found


def _in_states(step: Step, pattern: Pattern, gone: np.ndarray, multiplier: float, near: Moved) -> Moved | None:
    """Newton's method on which points are open, stick or slide, from a solution near; None where that goes round."""
    mu, (across, along) = step.friction, step.give
    steep = (1.0 - STATES) * mu * near.normal
    # Open, or the direction in which friction acts on what slides; 0 for what sticks.
    is_open = near.forces[0] * along <= near.distances[0]
    way = np.where(np.abs(near.shear) >= steep, np.sign(near.shear), 0.0)
    no_force, no_way = STATES * max(float(near.normal.max(initial=0.0)), 1.0), EQUATIONS * (step.size + along)
    for iteration in range(STATE_CHANGES):
        closed, sticks = ~is_open, ~is_open & (way == 0.0)
        local = np.zeros((len(mu), 2, 2))
        local[:, 0, 0] = closed / across
        local[:, 1, 0] = closed * way * mu / across
        local[:, 1, 1] = sticks / along
        first = np.where(closed, step.normal - step.gap / across, 0.0)
        second = np.where(sticks, step.shear - step.slip / along, way * mu * first)
        solve = factorised(pattern.stiffness(local))
        motion = solve(step.load + pattern.to_blocks @ paired(first, second) - step.drag * gone)
        found_multiplier = multiplier
        if step.live is not None and step.control is not None:
            by_live = solve(step.live)
            moved = float(step.control @ by_live)
            if moved == 0.0:
                return None
            found_multiplier = (step.wanted - float(step.control @ motion)) / moved
            motion = motion + found_multiplier * by_live
        gap, slip = (pattern.to_contacts @ motion).reshape(-1, 2).T
        normal = first - local[:, 0, 0] * gap
        shear = second - local[:, 1, 0] * gap - local[:, 1, 1] * slip
        distance = step.gap + gap + across * (normal - step.normal)
        slipped = step.slip + slip + along * (shear - step.shear)
        opens, closes = closed & (normal < -no_force), is_open & (distance < -no_way)
        starts = sticks & (np.abs(shear) > mu * normal + no_force) & ~opens
        stops = closed & (way * slipped > no_way)
        if not (opens | closes | starts | stops).any():
            normal = np.maximum(normal, 0.0)
            lean = np.divide(shear, mu, out=np.zeros_like(shear), where=mu > 0.0)
            forces = np.maximum(np.stack([normal, 0.5 * (normal + lean), 0.5 * (normal - lean)]), 0.0)
            distances = np.maximum(np.stack([distance, slipped, -slipped]), 0.0)
            return Moved(motion, normal, shear, found_multiplier, iteration, forces, distances, pattern)
        is_open = (is_open | opens) & ~closes
        way = np.where(starts, np.sign(shear), np.where(stops | closes, 0.0, way))
    return None


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
    scale = step.size + along
    gap, slip = step.gap, step.slip
    motion, short, recent, lost = np.zeros(len(step.load)), False, [1.0] * LOOK_BACK, 0
    for iteration in range(ITERATIONS):
        normal, shear = forces[0], mu * (forces[1] - forces[2])
        gap_error = distances[0] - (gap + across * (normal - step.normal))
        slip_error = distances[1] - distances[2] - (slip + along * (shear - step.shear))
        unbalanced = step.load + pattern.to_blocks @ paired(normal, shear) - step.drag * (gone + motion)
        behind = 0.0
        if step.live is not None and step.control is not None:
            unbalanced = unbalanced + multiplier * step.live
            behind = step.wanted - float(step.control @ motion)
        products = forces * distances
        mean = float(products.mean())
        out = float(np.abs(unbalanced).max())
        wrong = max(float(np.abs(gap_error).max()), float(np.abs(slip_error).max()), abs(behind))
        if out < BALANCE and wrong < EQUATIONS * scale and float(products.max(initial=0.0)) < PRODUCT * across:
            return Moved(motion, normal, shear, multiplier, iteration, forces, distances, pattern)
        if sum(part < SHORT for part in recent[-LOOK_BACK:]) >= LOST:
            lost, recent = lost + 1, [1.0] * LOOK_BACK
            if lost > 1:
                break
        newton = _Newton(step, pattern, forces, distances)
        errors = (gap_error, slip_error, unbalanced, behind)
        found = newton.direction(-products, *errors)
        part = _longest(forces, distances, found)
        after = float(((forces + part * found.forces) * (distances + part * found.distances)).mean())
        centring = min(max((after / mean) ** 3, 1e-3), 0.8)
        most = CORRECTION * mean
        second = np.minimum(np.maximum(found.forces * found.distances, -most), most)
        if careful or short:
            centring, second = 1.0 if short else max(centring, CAREFUL), 0.0
        found = newton.direction(centring * mean - products - second, *errors)
        part = FRACTION * _longest(forces, distances, found)
        short = part < SHORT and not short
        recent.append(part)
        motion, multiplier = motion + part * found.motion, multiplier + part * found.multiplier
        gap, slip = gap + part * found.relative[:, 0], slip + part * found.relative[:, 1]
        forces, distances = forces + part * found.forces, distances + part * found.distances
        forces[0] = forces[1] + forces[2]
    if out < BALANCE and wrong < EQUATIONS * scale and mean < PRODUCT_LEFT:
        # Points that neither carry nor are open converge slowly: by their states at once, or as they are.
        reached = Moved(motion, normal, shear, multiplier, iteration, forces, distances, pattern)
        return _in_states(step, pattern, gone, multiplier, reached) or reached
    raise NotSolved(f"balance {out:.1e}, distances {wrong:.1e}, product {mean:.1e} after {iteration} iterations")


def _longest(forces: np.ndarray, distances: np.ndarray, change: _Direction) -> float:
    """Largest part of a change that keeps all forces and distances positive, at most 1."""
    steepest = max(-float((change.forces / forces).min()), -float((change.distances / distances).min()))
    return 1.0 / max(steepest, 1.0)


@dataclass(frozen=True)
class _Direction:
    """A change of everything: (3, n_contacts) arrays of forces and distances, (n_contacts, 2) of relative movement."""

    motion: np.ndarray
    relative: np.ndarray
    multiplier: float
    forces: np.ndarray
    distances: np.ndarray


class _Newton:
    """Newton's equations at one point of the central path, factorised once for several right-hand sides."""

    def __init__(self, step: Step, pattern: Pattern, forces: np.ndarray, distances: np.ndarray) -> None:
        self.step, self.pattern, self.forces, self.distances = step, pattern, forces, distances
        mu, n = step.friction, len(step.friction)
        self.k_normal = distances[0] / forces[0] + step.give[0]
        self.k_plus, self.k_minus = distances[1:] / forces[1:] + step.give[1] * mu
        self.k_shear = self.k_plus + self.k_minus
        # What a contact point answers: normal force to gap; shear force to gap, through friction, and to slip.
        through = mu * (self.k_minus - self.k_plus) / (self.k_shear * self.k_normal)
        local = np.zeros((n, 2, 2))
        local[:, 0, 0], local[:, 1, 0], local[:, 1, 1] = 1.0 / self.k_normal, through, 2.0 * mu / self.k_shear
        self.solve = factorised(pattern.stiffness(local))
        self.by_live = None if step.live is None else self.solve(step.live)

    def direction(
        self, aims: np.ndarray, gap_error: np.ndarray, slip_error: np.ndarray, unbalanced: np.ndarray, behind: float
    ) -> _Direction:
        """The change that alters each product by its aim and takes the errors away."""
        step, (normal, plus, minus) = self.step, self.forces
        for_normal = aims[0] / normal + gap_error
        for_shear = aims[1] / plus - aims[2] / minus + slip_error
        at_once = for_normal / self.k_normal
        shear = step.friction * ((self.k_minus - self.k_plus) * at_once + 2.0 * for_shear) / self.k_shear
        motion = self.solve(unbalanced + self.pattern.to_blocks @ paired(at_once, shear))
        multiplier = 0.0
        if self.by_live is not None and step.control is not None:
            moved = float(step.control @ self.by_live)
            if moved == 0.0:
                raise NotSolved("the live load does not move the control point")
            multiplier = (behind - float(step.control @ motion)) / moved
            motion = motion + multiplier * self.by_live
        relative = (self.pattern.to_contacts @ motion).reshape(-1, 2)
        d_normal = (for_normal - relative[:, 0]) / self.k_normal
        rest = for_shear - relative[:, 1]
        forces = np.empty_like(self.forces)
        forces[0], forces[1], forces[2] = d_normal, self.k_minus * d_normal + rest, self.k_plus * d_normal - rest
        forces[1:] /= self.k_shear
        return _Direction(motion, relative, multiplier, forces, (aims - self.distances * forces) / self.forces)
