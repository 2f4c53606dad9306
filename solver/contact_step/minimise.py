"""The minimum of a step's program: Newton's method where few contact points change, an interior method otherwise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .interior import interior_point
from .problem import ContactProblem, NotSolved, StepSolution
from .stiffness import Singular

#: Largest force that may be left out of balance, in block weights: a hundred times that moved reactions by 0.4 %.
BALANCED = 1e-9

#: Newton's method goes on for so many iterations, while no more than this part of the points that changed their status
#: in an iteration do so in the next.
NEWTON_ITERATIONS, FEWER = 8, 0.5


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
    try:
        found, used = newton(
            problem, problem.trial(np.zeros_like(problem.load)) if trial is None else trial, multiplier
        )
        if found is None:
            found = interior_point(problem, multiplier)
    except Singular as error:
        raise NotSolved(str(error)) from None
    return replace(found, factorisations=used + found.factorisations)


def newton(problem: ContactProblem, trial: np.ndarray, multiplier: float) -> tuple[StepSolution | None, int]:
    """Full semismooth Newton steps from trial forces; None where they do not converge soon. And how many there were."""
    motion = np.zeros_like(problem.load)
    # The first linear problem is that of the given trial forces, from nothing moved.
    stiffness, at = problem.stiffness(trial), problem.trial(motion)
    forces = problem.allowed(trial) + np.einsum("nij,nj->ni", stiffness, (at - trial) * problem.compliance)
    status, changes = problem.status(trial), len(trial)
    for iteration in range(1, NEWTON_ITERATIONS + 1):
        out = problem.unbalanced(motion, forces, multiplier)
        change, turned = _direction(problem, stiffness, out, motion)
        motion, multiplier = motion + change, multiplier + turned
        trial = problem.trial(motion)
        forces = problem.allowed(trial)
        out = problem.unbalanced(motion, forces, multiplier)
        missed = 0.0 if problem.control is None else abs(problem.wanted - float(problem.control @ motion))
        if np.abs(out).max() < BALANCED * max(1.0, abs(multiplier)) and missed <= 1e-12 + BALANCED * problem.size:
            return StepSolution(motion, forces, trial, multiplier, 0), iteration
        before, status = status, problem.status(trial)
        now = int((status != before).sum())
        if now > FEWER * changes or not np.isfinite(out).all():
            break
        changes, stiffness = now, problem.stiffness(trial)
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
    missing = problem.wanted - float(problem.control @ (motion + change))
    turned = missing / float(problem.control @ by_live)
    return change + turned * by_live, turned
