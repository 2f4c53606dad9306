"""The minimum of a step's program: Newton's method where few contact points change, an interior method otherwise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .interior import interior_point
from .problem import ContactProblem, NotSolved, StepSolution
from .stiffness import Singular

#: Largest force out of balance, in block weights: a hundred times that changed reactions by 0.4 %.
BALANCED = 1e-9

#: Iterations of Newton's method, after which the interior method takes over.
NEWTON_ITERATIONS = 8


def minimise(problem: ContactProblem, trial: np.ndarray | None = None, multiplier: float = 0.0) -> StepSolution:
    """Find the minimum of a step's program.

    Parameters
    ----------
    problem : ContactProblem
    trial : (n, d) array, optional
        Forces of the springs to linearise at first: those of the program before. By default those at the start.
    multiplier : float
        Of the live load, to start from.

    Raises
    ------
    NotSolved
    """
    if len(problem.gap) == 0:
        motion = problem.load / problem.viscosity - problem.motion_so_far
        return StepSolution(motion, problem.forces, problem.forces, multiplier, 0)
    trial = problem.trial(np.zeros_like(problem.load)) if trial is None else trial
    try:
        solution, iterations = newton(problem, trial, multiplier)
        if solution is None:
            solution = interior_point(problem, multiplier)
    except Singular as error:
        raise NotSolved(str(error)) from None
    return replace(solution, factorisations=iterations + solution.factorisations)


def newton(problem: ContactProblem, trial: np.ndarray, multiplier: float) -> tuple[StepSolution | None, int]:
    """Full semismooth Newton steps from trial forces: the solution, None where they do not converge, and iterations."""
    motion = np.zeros_like(problem.load)
    # The first linear problem is that of the given trial forces, at the start.
    stiffness, start = problem.stiffness(trial), problem.trial(motion)
    forces = problem.projected(trial) + np.einsum("nij,nj->ni", stiffness, (start - trial) * problem.compliance)
    unbalanced = problem.unbalanced(motion, forces, multiplier)
    status, changes = problem.status(trial), len(trial)
    for iteration in range(1, NEWTON_ITERATIONS + 1):
        change, multiplier_change = _direction(problem, stiffness, unbalanced, motion)
        motion, multiplier = motion + change, multiplier + multiplier_change
        trial = problem.trial(motion)
        forces = problem.projected(trial)
        unbalanced = problem.unbalanced(motion, forces, multiplier)
        missing = 0.0 if problem.control is None else problem.control_target - float(problem.control @ motion)
        balanced = np.abs(unbalanced).max() < BALANCED * max(1.0, abs(multiplier))
        if balanced and abs(missing) <= 1e-12 + BALANCED * problem.size:
            return StepSolution(motion, forces, trial, multiplier, 0), iteration
        before, status = status, problem.status(trial)
        changed = int((status != before).sum())
        # It converges where the contact points that change their status become fewer by half.
        if changed > 0.5 * changes or not np.isfinite(unbalanced).all():
            break
        changes, stiffness = changed, problem.stiffness(trial)
    return None, iteration


def _direction(
    problem: ContactProblem, stiffness: np.ndarray, unbalanced: np.ndarray, motion: np.ndarray
) -> tuple[np.ndarray, float]:
    """Movement and change of the multiplier that balance forces at a linearisation, the control equation met."""
    solve = problem.rows.factorised(stiffness, problem.viscosity)
    change = solve(unbalanced)
    if problem.live is None or problem.control is None:
        return change, 0.0
    by_live = solve(problem.live)
    missing = problem.control_target - float(problem.control @ (motion + change))
    multiplier_change = missing / float(problem.control @ by_live)
    return change + multiplier_change * by_live, multiplier_change
