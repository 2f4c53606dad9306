"""A step in the plane, followed from its start: which points open, close, slide and stick on the way, one by one.

From nothing moved and the forces remembered to the whole step, everything that is given changes in proportion to t from
0 to 1: distances, load, and the force out of balance at the start. Between two changes of a point's state the solution
is linear in t. So it is followed exactly, from change to change: parametric pivoting, as for other linear
complementarity problems (Cottle, Pang & Stone, https://doi.org/10.1137/1.9780898719000, chapter 4), or a homotopy that
is linear by pieces (Eaves, SIAM-AMS Proceedings 9, 1976, 73-143). Where the structure snaps, t turns back for a while:
the way goes on through equilibria that no movement of the supports keeps, to those behind.

A point would carry the forces P = (N, T) were it closed and stuck; what it carries is H P::

    open      H = 0                      while  N ≤ 0
    sticks    H = 1                      while  |T| ≤ μ N
    slides    H = (1, 0; ± μ, 0)         while  N ≥ 0, ± T ≥ μ N

and the movements v follow from drag · v = load + Aᵀ H P, P = P⁰ - G A v with the points' stiffness G. A change of state
changes H by a dyad u w: one solution of the factorised equations takes it in, and a small dense matrix in the w·P.
"""

from __future__ import annotations

import numpy as np

from .states import STATES
from .step import Moved, NotSolved, Pattern, Step, paired

#: Changes of state after which the equations are factorised anew.
TAKEN_IN = 32

#: A step is given up, for a shorter one, after so many changes more than half the contact points.
MOST_MORE = 128

#: What a change leaves of its own pivot: below this part, too few digits are left.
DIGITS = 1e-6

#: How far behind its start a step is followed, in parts of it, where the way turns back.
FARTHEST_BACK = 10.0

#: Forces by which a point at the limit of its friction, or one that just touches, is on one side of it at the start.
ASIDE = 1e-7


def led(step: Step, pattern: Pattern, gone: np.ndarray, start: Moved) -> Moved:
    """Follow a step in the plane from its start; gives its solution but for rounding.

    Parameters
    ----------
    step : Step
    pattern : Pattern
        Of the step.
    gone : (n_dof,) array
        Movement since the start of the step, which the drag resists, too.
    start : Moved
        Nothing moved, and the forces remembered.

    Raises
    ------
    NotSolved
    """
    way = _Way(step, pattern, gone, start)
    t, onwards = 0.0, 1.0
    for _ in range(len(step.gap) // 2 + MOST_MORE):
        value, growth = way.measured[0] + t * way.measured[1], onwards * way.measured[1]
        ahead = np.full(value.shape, np.inf)
        np.divide(np.maximum(value, 0.0), -growth, out=ahead, where=growth < 0.0)
        which, number = divmod(int(ahead.argmin()), value.shape[1])
        nearest = float(ahead[which, number])
        if onwards > 0.0 and t + nearest >= 1.0:
            return way.found()
        t += onwards * nearest
        if not -FARTHEST_BACK < t < np.inf:
            break
        grows = way.change(which, number, t)
        # On the other side of the change its point goes on from it: where the structure snaps, as t turns.
        onwards = 1.0 if way.measured[1, grows, number] > 0.0 else -1.0
    raise NotSolved(f"the start leads no further than {t:.3g} of the step")


class _Way:
    """The points' states on the way, and P, linear in t, that follows from them.

    Attributes
    ----------
    forces : (2, 2, n) array
        P at the start of the step and how it grows with t, in the present states.
    measured : (2, 2, n) array
        Likewise of each point two functions of P that are positive as long as its state lasts.
    """

    def __init__(self, step: Step, pattern: Pattern, gone: np.ndarray, start: Moved) -> None:
        self.step, self.pattern = step, pattern
        mu, self.give = step.friction, np.array(step.give)[:, None]
        normal, shear = step.normal, step.shear[:, 0]
        live = 0.0 if step.live is None else start.multiplier * step.live
        load = step.load - step.drag * gone
        unbalanced = load + live + pattern.to_blocks @ paired(normal, step.shear)
        self.loads = (load - unbalanced, unbalanced)
        self.closed = normal > STATES * float(normal.max(initial=0.0))
        limit = self.closed & (np.abs(shear) >= mu * normal * (1.0 - STATES))
        self.slides = limit | (self.closed & (mu <= 0.0))
        self.sense = np.where(shear < 0.0, -1.0, 1.0)
        # What is at the limit of its friction slides, what touches is open, until the way asks them to change.
        shear = np.where(limit, self.sense * mu * normal * (1.0 + ASIDE), shear)
        gap = start.distances[0]
        apart = np.where(self.closed, 0.0, np.maximum(gap / step.give[0], ASIDE))
        self.given = (
            np.stack([normal - apart, shear]),
            -np.stack([step.gap - gap, step.slip[:, 0]]) / self.give,
        )
        # What each function takes of a point's normal and of its shear force: open, stuck, sliding either way.
        one, none, smooth = np.ones_like(mu), np.zeros_like(mu), np.where(mu > 0.0, 1.0, 0.0)
        self.in_state = np.array(
            [
                [[-one, none], [none, none]],
                [[mu, mu], [-one, one]],
                [[one, -mu], [none, -smooth]],
                [[one, -mu], [none, smooth]],
            ]
        )
        self.functions = self.in_state[self._states(slice(None)), :, :, np.arange(len(mu))].transpose(1, 2, 0).copy()
        self._factorise()
        self._measure()

    def change(self, which: int, number: int, t: float) -> int:
        """Change the state of the point whose function has come to zero; gives that which must grow now.

        Raises
        ------
        NotSolved
        """
        friction = float(self.step.friction[number])
        if self.closed[number] and (which == 1 or not self.slides[number]):
            # From sticking to sliding, or back.
            starts = not self.slides[number]
            if starts:
                self.sense[number] = 1.0 - 2.0 * which
            limit, turned = friction * self.sense[number], 1.0 if starts else -1.0
            self.slides[number] = starts
            grows = 1 if starts or self.sense[number] < 0.0 else 0
            put, read = np.array([0.0, 1.0]), turned * np.array([limit, -1.0])
        else:
            closes = not self.closed[number]
            if closes:
                shear = self.forces[0, 1, number] + t * self.forces[1, 1, number]
                self.sense[number] = -1.0 if shear < 0.0 else 1.0
            self.closed[number] = self.slides[number] = closes
            grows = 0
            put, read = np.array([1.0, friction * self.sense[number]]), np.array([1.0 if closes else -1.0, 0.0])
        self.functions[:, :, number] = self.in_state[self._states(number), :, :, number]
        if self.taken_in == TAKEN_IN or not self._taken_in(number, put, read):
            self._factorise()
        self._measure()
        return grows

    def found(self) -> Moved:
        """The solution at the end of the step."""
        step, mu, forces = self.step, self.step.friction, self.forces.sum(axis=0)
        (across, along), slides = step.give, self.slides & self.closed
        normal = np.where(self.closed, np.maximum(forces[0], 0.0), 0.0)
        shear = np.where(slides, self.sense * mu * normal, np.where(self.closed, forces[1], 0.0))
        slipped = np.where(self.closed & ~slides, 0.0, along * (shear - forces[1]))
        gap = np.where(self.closed, 0.0, np.maximum(-across * forces[0], 0.0))
        tau = np.divide(shear, mu, out=np.zeros_like(shear), where=mu > 0.0)
        multiplier = float(self.parts[0].sum()) if self.step.live is not None else 0.0
        none = np.zeros(len(step.load))
        return Moved(
            none, normal, shear[:, None], multiplier, 0, np.stack([normal, tau]), np.stack([gap, abs(slipped), slipped])
        )

    def _states(self, numbers: slice | int) -> np.ndarray:
        """Which of the four states points are in."""
        return np.asarray(self.closed[numbers] * (1 + self.slides[numbers] * (1 + (self.sense[numbers] > 0.0))))

    def _measure(self) -> None:
        m = self.taken_in
        self.parts = self.inverse[:m, :m] @ self.right[:m]
        taken = self.parts.T @ self.taken[:m].reshape(m, self.base[0].size)
        self.forces = self.base - taken.reshape(self.base.shape)
        self.measured = self.functions[0] * self.forces[:, :1] + self.functions[1] * self.forces[:, 1:]

    def _factorise(self) -> None:
        step, n = self.step, len(self.closed)
        slides = self.closed & self.slides
        answer = np.zeros((n, 2, 2))
        answer[:, 0, 0], answer[:, 1, 1] = self.closed, self.closed & ~slides
        answer[:, 1, 0] = slides * self.sense * step.friction
        self.solve = self.pattern.factorised(answer / np.array(step.give))
        carried = [np.einsum("nij,jn->in", answer, given) for given in self.given]
        moved = [self.solve(load + self._on_blocks(force)) for load, force in zip(self.loads, carried, strict=True)]
        self.base = np.stack([given - self._on_contacts(one) for given, one in zip(self.given, moved, strict=True)])
        #: What each change takes off P, what it reads of P, and the inverse of the equations of what is read.
        self.taken_in, self.taken = 0, np.empty((TAKEN_IN, 2, n))
        self.inverse, self.right = np.zeros((TAKEN_IN, TAKEN_IN)), np.zeros((TAKEN_IN, 2))
        self.places, self.reads = np.zeros(TAKEN_IN, dtype=int), np.zeros((TAKEN_IN, 2))
        if step.live is not None and step.control is not None:
            by_live = self.solve(step.live)
            self.taken[0], self.inverse[0, 0] = self._on_contacts(by_live), 1.0 / (step.control @ by_live)
            self.right[0] = np.array([0.0, step.wanted]) - np.array([step.control @ one for one in moved])
            self.taken_in = 1

    def _taken_in(self, number: int, put: np.ndarray, read: np.ndarray) -> bool:
        """Take in that the forces put on a point change by what is read of P there; False where it costs digits."""
        step, m = self.step, self.taken_in
        moved = self.solve(self.pattern.by_one(number, put))
        self.taken[m] = taken = self._on_contacts(moved)
        self.places[m], self.reads[m] = number, read
        self.right[m] = self.base[:, :, number] @ read
        column = (self.reads[:m] * taken[:, self.places[:m]].T).sum(axis=1)
        if step.live is not None and step.control is not None:
            column[0] = step.control @ moved
        across, inverse = self.taken[:m, :, number] @ read, self.inverse[:m, :m]
        before, after = inverse @ column, across @ inverse
        own = 1.0 + taken[:, number] @ read
        left = own - across @ before
        if not abs(left) > DIGITS * (1.0 + abs(own)):
            return False
        inverse += np.outer(before, after / left)
        self.inverse[:m, m], self.inverse[m, :m], self.inverse[m, m] = -before / left, -after / left, 1.0 / left
        self.taken_in = m + 1
        return True

    def _on_blocks(self, forces: np.ndarray) -> np.ndarray:
        return np.asarray(self.pattern.to_blocks @ forces.T.ravel())

    def _on_contacts(self, motion: np.ndarray) -> np.ndarray:
        """(2, n) array: the forces that a motion takes off points that are stuck."""
        return np.asarray((self.pattern.to_contacts @ motion).reshape(-1, 2).T / self.give)
