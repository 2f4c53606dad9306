"""A step whose points' states are known, and Newton's method on these, as in plasticity."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .step import Moved, NotSolved, Pattern, Step, paired

#: Part of a force that counts as none.
STATES = 1e-9

#: A solution counts when balance, in block weights, and the linear equations, in parts of a step and an elastic give,
#: are below these.
BALANCE, EQUATIONS = 1e-9, 1e-8

#: Newton's method on the points' states: iterations after which it is given up, and times that what rounding has left
#: out of balance is put on the blocks again; where points slide in space, once their turning about round cones leaves
#: no less. Where more points change their state than the time before it goes round, and the second time it is left.
STATE_CHANGES, REFINED = 16, 2


def in_states(step: Step, pattern: Pattern, gone: np.ndarray, near: Moved) -> Moved | None:
    """Newton's method on which points are open, stick or slide, and where to; None where it goes round.

    Parameters
    ----------
    step : Step
    pattern : Pattern
        Of the step.
    gone : (n_dof,) array
        Movement since the start of the step, which the drag resists, too.
    near : Moved
        Whose points' states it begins with. On a central path nothing is at its bound: there the larger of a force and
        its distance says which of them stays.
    """
    mu, (across, along) = step.friction, step.give
    n, d = near.forces.shape[1], len(near.forces)
    normal, lean = near.forces[0], near.forces[1:]
    size = np.sqrt((lean**2).sum(axis=0))
    way = lean / np.maximum(size, 1e-300)
    closed = normal * along > near.distances[0]
    short = 0.5 * (near.distances[1] - (way * near.distances[2:]).sum(axis=0))
    # What is at the limit of its friction but for rounding slides, for all that anybody knows.
    slides = (0.5 * (normal - size - STATES * normal) * along <= short) & (size > 0.0)
    # Without friction there is nothing to stick by, nor a way to be held to.
    smooth = mu <= 0.0
    way, turn = way.T, mu * normal / (mu * normal + near.distances[1] / along + 1e-300)
    no_force, no_way = STATES * max(float(near.normal.max(initial=0.0)), 1.0), EQUATIONS * (step.size + along)
    changes, out, rises = n, np.inf, 0
    for iteration in range(STATE_CHANGES):
        slides = (slides | smooth) & closed
        try:
            there = _InStates(step, pattern, gone, _States(closed, slides, way, turn), near.multiplier)
        except NotSolved:
            return None
        normal, trial, sticks = there.normal, there.trial, closed & ~slides
        distance = step.gap + there.relative[:, 0] + across * (normal - step.normal)
        size, most = np.sqrt((trial**2).sum(axis=1)), mu * np.maximum(normal, 0.0)
        opens, closes = closed & (normal < -no_force), ~closed & (distance < -no_way)
        starts = sticks & (size > most + no_force) & ~opens
        # How far a point has slid the way that it was held to slide.
        slid = (way * trial).sum(axis=1) - most
        stops = slides & ~smooth & (slid < -no_way / along)
        changed = opens | closes | starts | stops
        if not changed.any():
            stalled = there.unbalanced() > 0.5 * out
            for _ in range(REFINED if d == 2 or not slides.any() or stalled else 0):
                if there.unbalanced() >= BALANCE:
                    there.refine()
            if there.unbalanced() < BALANCE:
                return there.solution(iteration)
            if stalled:
                # Rounding: next to nothing holds what moves.
                return None
            out = there.unbalanced()
        before, changes = changes, int(changed.sum())
        rises += iteration > 0 and changes > before
        if rises > 1:
            return None
        closed = (closed | closes) & ~opens
        slides = starts | (slides & ~stops) | (closes & (size > most))
        way = np.where((slides & (size > 0.0))[:, None], trial / np.maximum(size, 1e-300)[:, None], 0.0)
        turn = np.minimum(most / np.maximum(size, 1e-300), 1.0)
    return None


@dataclass(frozen=True)
class _States:
    """Which points are closed, which of them slide, which way, and the part of their friction that is across it."""

    closed: np.ndarray
    slides: np.ndarray
    way: np.ndarray
    turn: np.ndarray


class _InStates:
    """What a step comes to where its points are in given states.

    Raises
    ------
    NotSolved
    """

    def __init__(self, step: Step, pattern: Pattern, gone: np.ndarray, states: _States, multiplier: float) -> None:
        self.step, self.pattern, self.gone, self.states, self.multiplier = step, pattern, gone, states, multiplier
        mu, (across, along), way = step.friction, step.give, states.way
        n, d = len(way), way.shape[1] + 1
        eye, sticks = np.eye(d - 1), states.closed & ~states.slides
        # Across the way that a point slides it is held by its friction, the less the farther it slides.
        held = (sticks[:, None, None] * eye) + (states.slides * states.turn)[:, None, None] * (
            eye - way[:, :, None] * way[:, None, :]
        )
        pushed = (states.slides * mu)[:, None] * way
        self.local = np.zeros((n, d, d))
        self.local[:, 0, 0] = states.closed / across
        self.local[:, 1:, 0] = pushed / across
        self.local[:, 1:, 1:] = held / along
        before = step.shear - step.slip / along
        first = np.where(states.closed, step.normal - step.gap / across, 0.0)
        second = pushed * first[:, None] + np.matmul(held, before[:, :, None])[:, :, 0]
        self.solve = pattern.factorised(self.local)
        self.by_live, self.moved = None, 1.0
        if step.live is not None and step.control is not None:
            self.by_live = self.solve(step.live)
            self.moved = float(step.control @ self.by_live)
            if self.moved == 0.0:
                raise NotSolved("the live load does not move the control point")
            self.multiplier = 0.0
        self.motion, self.relative = np.zeros(len(step.load)), np.zeros((n, d))
        #: Normal forces, and the shear forces that points would carry were they stuck.
        self.normal, self.trial = first, before
        self._move(step.load + pattern.to_blocks @ paired(first, second) - step.drag * gone)

    def _move(self, unbalanced: np.ndarray) -> None:
        step = self.step
        motion = self.solve(unbalanced)
        if self.by_live is not None and step.control is not None:
            part = (step.wanted - float(step.control @ (self.motion + motion))) / self.moved
            self.multiplier, motion = self.multiplier + part, motion + part * self.by_live
        relative = (self.pattern.to_contacts @ motion).reshape(self.relative.shape)
        self.motion, self.relative = self.motion + motion, self.relative + relative
        self.normal = self.normal - self.local[:, 0, 0] * relative[:, 0]
        self.trial = self.trial - relative[:, 1:] / step.give[1]
        self.seen: np.ndarray | None = None

    def refine(self) -> None:
        """Put on the blocks what rounding of movements, through stiff joints, has left out of balance."""
        self._move(self._out_of_balance())

    def unbalanced(self) -> float:
        """Largest force or moment out of balance."""
        return float(np.abs(self._out_of_balance()).max())

    def _carried(self) -> tuple[np.ndarray, np.ndarray]:
        """(n,) and (n, d - 1) arrays: normal and shear forces within the friction cones."""
        slides, sticks = self.states.slides, self.states.closed & ~self.states.slides
        normal = np.maximum(self.normal, 0.0)
        size, most = np.sqrt((self.trial**2).sum(axis=1)), self.step.friction * normal
        within = self.trial * (most / np.maximum(size, 1e-300))[:, None]
        limit = np.where((size > most)[:, None], within, most[:, None] * self.states.way)
        return normal, np.where(slides[:, None], limit, self.trial * sticks[:, None])

    def _out_of_balance(self) -> np.ndarray:
        if self.seen is None:
            step = self.step
            self.seen = step.load + self.pattern.to_blocks @ paired(*self._carried())
            self.seen = self.seen - step.drag * (self.gone + self.motion)
            if step.live is not None:
                self.seen = self.seen + self.multiplier * step.live
        return self.seen

    def solution(self, iterations: int) -> Moved:
        """The solution, the states being its own."""
        step, mu, (across, along) = self.step, self.step.friction, self.step.give
        normal, shear = self._carried()
        sticks = self.states.closed & ~self.states.slides
        slipped = step.slip + self.relative[:, 1:] + along * (shear - step.shear)
        slipped = np.where(sticks[:, None], 0.0, slipped)
        tau = np.divide(shear, mu[:, None], out=np.zeros_like(shear), where=mu[:, None] > 0.0)
        distance = step.gap + self.relative[:, 0] + across * (self.normal - step.normal)
        distances = [np.maximum(distance, 0.0), np.sqrt((slipped**2).sum(axis=1)), *slipped.T]
        forces = np.stack([normal, *tau.T])
        return Moved(self.motion, normal, shear, self.multiplier, iterations, forces, np.stack(distances), self.pattern)
