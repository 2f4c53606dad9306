"""The convex program of a step, and its solution.

Over the movement v of the free blocks at a linearised geometry, with the movement g of the step so far::

    minimise  1/2 (g + v - h V)ᵀ (D/h) (g + v - h V) - fᵀ v + Σ c_n/2 N(v)² + Σ c_t H(P(v); B)

    N = max(N⁰ - (gap + n·v) / c_n, 0)      normal force: a spring that pushes only, or up to its strength
    P = T⁰ - (slip + t·v) / c_t             trial shear force
    T = P min(1, B / |P|)                   shear force within the friction bound B, H Huber's function of |P|

D is the viscosity, V the velocity of the steps before (both are in ``load`` and ``viscosity``), c_n and c_t the
compliance of the contact point, N⁰ and T⁰ the forces before, so that the next program takes the elastic deformation
back. In a step B is given, so that the function is strictly convex and its minimum, forces and movement, unique. The
same form with a bound that lags by a step: Castro et al., https://arxiv.org/abs/2312.03908, and Li et al. (2020),
https://doi.org/10.1145/3386569.3392425.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .factors import NotSolved as NotSolved
from .stiffness import ContactRows


@dataclass(frozen=True)
class ContactProblem:
    """The program of a step, in its units: lengths in block sizes, forces in mean block weights."""

    rows: ContactRows  #: how forces at the contact points act on the n_dof freedoms of the free blocks
    gap: np.ndarray  #: (n,), where the free blocks now are, with the supports at the end of the step
    slip: np.ndarray  #: (n, d - 1), likewise; counts from the step's start
    forces: np.ndarray  #: (n, d): N⁰ and T⁰
    bound: np.ndarray  #: (n,): B
    compliance: np.ndarray  #: (n, d): c_n, then c_t for each tangent
    most: np.ndarray  #: (n,): largest normal forces; infinite where there is no limit
    load: np.ndarray  #: (n_dof,)
    viscosity: np.ndarray  #: (n_dof,): force per movement
    motion_so_far: np.ndarray  #: (n_dof,): g
    size: float  #: movement of the supports in the step
    live: np.ndarray | None = None  #: (n_dof,): load whose multiplier is one more unknown
    #: (n_dof,): weights of the movements that make up the control displacement, one more equation; with its change.
    control: np.ndarray | None = None
    control_target: float = 0.0
    #: (n,): friction coefficient of forces in equilibrium, whose bound grows with the normal force.
    friction: np.ndarray | None = None
    #: (n, d): parts of the forces that make up the reaction, where one is given.
    unit_reaction: np.ndarray | None = None
    reaction: float = 0.0

    def measured(self, motion: np.ndarray, forces: np.ndarray) -> float:
        """Control displacement of a movement, or reaction of forces."""
        if self.control is not None:
            return float(self.control @ motion)
        return 0.0 if self.unit_reaction is None else float((self.unit_reaction * forces).sum())

    def missing(self, motion: np.ndarray, forces: np.ndarray) -> float:
        """Tell what is missing of the control displacement or the reaction."""
        return self.control_target + self.reaction - self.measured(motion, forces)

    def trial(self, motion: np.ndarray) -> np.ndarray:
        """(n, d) array: forces of the springs after a movement, without limits of contact and friction."""
        distance = np.column_stack([self.gap, self.slip]) + self.rows.relative(motion)
        return np.asarray(self.forces - distance / self.compliance)

    def projected(self, trial: np.ndarray) -> np.ndarray:
        """(n, d) array: the forces nearest to trial forces that push and stay within the friction bound."""
        shear = trial[:, 1:]
        part = np.minimum(1.0, self.bound / np.maximum(np.linalg.norm(shear, axis=1), 1e-300))
        return np.column_stack([np.clip(trial[:, 0], 0.0, self.most), shear * part[:, None]])

    def stiffness(self, trial: np.ndarray) -> np.ndarray:
        """(n, d, d) array: derivative of the allowed forces by movements, times -1; symmetric and positive."""
        # Squares of smaller shear forces lose their digits, and their direction would be longer than 1.
        size, d = np.maximum(np.linalg.norm(trial[:, 1:], axis=1), 1e-150), trial.shape[1]
        part, along = np.minimum(1.0, self.bound / size), trial[:, 1:] / size[:, None]
        out = np.zeros((len(trial), d, d))
        out[:, 0, 0] = ((trial[:, 0] > 0.0) & (trial[:, 0] < self.most)) / self.compliance[:, 0]
        k = part / self.compliance[:, 1]
        out[:, 1:, 1:] = k[:, None, None] * np.eye(d - 1)
        out[:, 1:, 1:] -= (np.where(part < 1.0, k, 0.0)[:, None] * along)[:, :, None] * along[:, None, :]
        return out

    def status(self, trial: np.ndarray) -> np.ndarray:
        """(n,) int array: which points push, which as much as they can, and which slide."""
        pushes = 2 * (trial[:, 0] > 0.0) + 2 * (trial[:, 0] >= self.most)
        return np.asarray(pushes + (np.linalg.norm(trial[:, 1:], axis=1) > self.bound))

    def unbalanced(self, motion: np.ndarray, forces: np.ndarray, multiplier: float) -> np.ndarray:
        """(n_dof,) array: what loads, viscosity and contact forces leave out of balance."""
        out = self.load - self.viscosity * (self.motion_so_far + motion) + self.rows.resultant(forces)
        return np.asarray(out if self.live is None else out + multiplier * self.live)


@dataclass(frozen=True)
class StepSolution:
    """The minimum of a step's program."""

    motion: np.ndarray  #: (n_dof,): movement of the free blocks
    forces: np.ndarray  #: (n, d)
    trial: np.ndarray  #: (n, d): trial forces, from which the next program starts
    multiplier: float  #: of the live load, or of the reaction that is given
    imbalance: float  #: largest force out of balance, in block weights
    error: float  #: of the distances at the contact points, as a part of the movement
