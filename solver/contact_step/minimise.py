"""The minimum of a step's program: Newton's method near it, an interior method from farther away."""

from __future__ import annotations

import numpy as np

from .factors import Solve
from .interior import ACCEPTED, BALANCED, interior_point
from .problem import ContactProblem, NotSolved, StepSolution

#: Factorisations of Newton's method, and part of the contact points that begin or cease to push or to slide in one of
#: its steps, which foretells more: the interior method, which takes 8 to 14 wherever it starts, takes over.
NEWTON_FACTORISATIONS, MOST_CHANGED = 12, 0.08

#: Slopes of the program along a step of Newton's method that are computed at most.
SEARCHES = 20


def minimise(problem: ContactProblem, trial: np.ndarray | None = None, multiplier: float = 0.0) -> StepSolution:
    """Find the minimum of a step's program, from a multiplier of the live load; raises ``NotSolved``.

    Trial forces (n, d) are those of the springs to linearise at first, by default those at the start.
    """
    if len(problem.gap) == 0:
        motion = problem.load / problem.viscosity - problem.motion_so_far
        return StepSolution(motion, problem.forces, problem.forces, multiplier, 0.0, 0.0)
    if (near := newton(problem, trial, multiplier)) is not None:
        return near
    found = interior_point(problem, multiplier)
    # Numbers that are none are not accepted.
    if not max(found.imbalance, found.error) <= ACCEPTED:
        left = f"{found.error:.1e} of the movement, {found.imbalance:.1e} block weights out of balance"
        raise NotSolved(f"the program of a step is solved to {left}")
    return found


@np.errstate(all="ignore")  # A live load that no joint resists moves nothing along the control.
def newton(problem: ContactProblem, trial: np.ndarray | None, multiplier: float) -> StepSolution | None:
    """Semismooth Newton steps from trial forces: the solution, None where they lead too far."""
    motion = np.zeros_like(problem.load)
    start, from_start = problem.trial(motion), trial is None
    # The first linear problem is that of the given trial forces, at the start.
    trial = start if trial is None else trial
    stiffness = problem.stiffness(trial)
    forces = problem.projected(trial) + np.einsum("nij,nj->ni", stiffness, (start - trial) * problem.compliance)
    unbalanced = problem.unbalanced(motion, forces, multiplier)
    status, is_new, factorisations, part = problem.status(trial), True, 0, 1.0
    while factorisations < NEWTON_FACTORISATIONS:
        if is_new:
            solve = problem.rows.factorised(problem.stiffness(trial), problem.viscosity)
            factorisations += 1
        change, multiplier_change = _direction(problem, solve, unbalanced, motion)
        if factorisations > 1 or not is_new or from_start:
            part = 1.0 if problem.live is not None else _part(problem, trial, motion, change)
        motion, multiplier = motion + part * change, multiplier + part * multiplier_change
        trial = problem.trial(motion)
        forces = problem.projected(trial)
        unbalanced = problem.unbalanced(motion, forces, multiplier)
        missing = 0.0 if problem.control is None else problem.control_target - float(problem.control @ motion)
        imbalance = float(np.abs(unbalanced).max())
        if imbalance < BALANCED * max(1.0, abs(multiplier)) and abs(missing) <= 1e-12 + BALANCED * problem.size:
            return StepSolution(motion, forces, trial, multiplier, imbalance, abs(missing))
        before, status = status, problem.status(trial)
        changed = int((status != before).sum())
        # As many as there are factorisations may follow one after another, where each step is searched along.
        few = 0 if problem.live is not None else NEWTON_FACTORISATIONS
        if not imbalance < np.inf or changed > max(MOST_CHANGED * len(status), few):
            break
        # Where no point has changed, the factors serve once more.
        is_new = not is_new or changed > 0
    return None


def _part(problem: ContactProblem, trial: np.ndarray, motion: np.ndarray, change: np.ndarray) -> float:
    """Part of a change of the movement at which the program is least along it, roughly."""
    relative = problem.rows.relative(change)
    rate = relative / problem.compliance
    constant = float(change @ (problem.viscosity * (problem.motion_so_far + motion) - problem.load))
    linear = float(change @ (problem.viscosity * change))

    def slope(part: float) -> float:
        return constant + part * linear - float((relative * problem.projected(trial - part * rate)).sum())

    low, high, at_low, at_high = 0.0, 1.0, slope(0.0), slope(1.0)
    enough = 0.1 * abs(at_low)
    while at_high < -enough and high < 16.0:
        low, high, at_low, at_high = high, 2.0 * high, at_high, slope(2.0 * high)
    part, at_part = high, at_high
    for _ in range(SEARCHES):
        if abs(at_part) <= enough:
            break
        # Regula falsi, which halves the slope at an end that stays.
        part = (low * at_high - high * at_low) / (at_high - at_low)
        at_part = slope(part)
        if at_part < 0.0:
            low, at_low, at_high = part, at_part, 0.5 * at_high
        else:
            high, at_high, at_low = part, at_part, 0.5 * at_low
    return part


def _direction(
    problem: ContactProblem, solve: Solve, unbalanced: np.ndarray, motion: np.ndarray
) -> tuple[np.ndarray, float]:
    """Movement and change of the multiplier that balance forces at a linearisation, the control equation met."""
    change = solve(unbalanced)
    if problem.live is None or problem.control is None:
        return change, 0.0
    by_live = solve(problem.live)
    missing = problem.control_target - float(problem.control @ (motion + change))
    multiplier_change = float(missing / (problem.control @ by_live))
    return change + multiplier_change * by_live, multiplier_change
