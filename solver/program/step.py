"""A step of the path: what it is made of, what it gives, and the matrix that its method factorises."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from .factors import Singular, Solve, coupling


class NotSolved(Exception):
    """The interior method did not come to a solution: the step is to be made smaller."""


@dataclass(frozen=True)
class Step:
    """What a step is made of, in units of the program: lengths in block sizes, forces in mean block weights.

    Attributes
    ----------
    matrix : (n_blocks * dof, d n_contacts) sparse array, by columns
        Forces and moments on all blocks from normal and shear forces, as :func:`wrench_matrix` has them.
    free : (n_blocks * dof,) bool array
        Rows of free blocks; ``n_dof`` of them.
    load : (n_dof,) array
    drag : (n_dof,) array
        Resisting force per movement in this step.
    gap : (n_contacts,) array
    slip : (n_contacts, d - 1) array
        Of each contact point where the free blocks now are, with the supports at the end of the step; slip counts from
        the start of the step.
    normal : (n_contacts,) array
    shear : (n_contacts, d - 1) array
        Remembered forces N⁰, T⁰.
    friction : (n_contacts,) array
    give : (float, float)
        Elastic give of a contact point across the joint and along it: movement per force.
    size : float
        Movement of the supports in the step.
    live : (n_dof,) array, optional
        Load whose multiplier is unknown.
    control : (n_dof,) array, optional
        Weights of the movements that make up the control displacement.
    wanted : float
        Control displacement still to be gone.
    """

    matrix: sp.csc_array
    free: np.ndarray
    load: np.ndarray
    drag: np.ndarray
    gap: np.ndarray
    slip: np.ndarray
    normal: np.ndarray
    shear: np.ndarray
    friction: np.ndarray
    give: tuple[float, float]
    size: float
    live: np.ndarray | None = None
    control: np.ndarray | None = None
    wanted: float = 0.0


@dataclass(frozen=True)
class Moved:
    """The solution of a :class:`Step`: further movement of the free blocks, forces, and the live load's multiplier.

    Forces N and τ and distances y, γ and σ are those of the method, to start from again: (d, n_contacts) and
    (d + 1, n_contacts) arrays.
    """

    motion: np.ndarray
    normal: np.ndarray
    shear: np.ndarray
    multiplier: float
    iterations: int
    forces: np.ndarray
    distances: np.ndarray
    pattern: Pattern | None = None


class Pattern:
    """Where the contact points' stiffness goes in the matrix of a step: worked out once, filled at every iteration."""

    def __init__(self, step: Step) -> None:
        # A column holds the rows of the two blocks, the same for a point's normal and shear forces.
        n = len(step.gap)
        rows = step.matrix.indices.reshape(n, step.matrix.shape[1] // n, 2, -1)[:, 0]
        dof = rows.shape[2]
        number = np.where(step.free, np.cumsum(step.free) - 1, -1)
        self.coupling = coupling(number[rows[:, :, 0]] // dof, len(step.load) // dof, dof)
        self.rows = number[rows].reshape(n, -1)
        self.fill(step)

    def fill(self, step: Step) -> Pattern:
        """Take the numbers of a step with the same contact points; gives itself."""
        self.drag = step.drag
        n = len(step.gap)
        self.blocks = step.matrix.data.reshape(n, step.matrix.shape[1] // n, -1)
        to_blocks = sp.csr_array(sp.csr_array(step.matrix)[step.free])
        dense = self.coupling.dense
        self.to_blocks = to_blocks.toarray() if dense else to_blocks
        self.to_contacts = np.ascontiguousarray(self.to_blocks.T) if dense else sp.csr_array(to_blocks.T)
        return self

    def by_one(self, number: int, forces: np.ndarray) -> np.ndarray:
        """(n_dof,) array: what (d,) forces at one contact point put on the blocks."""
        # What a block without freedom takes goes beyond the last.
        on_blocks = np.zeros(len(self.drag) + 1)
        on_blocks[self.rows[number]] = forces @ self.blocks[number]
        return on_blocks[:-1]

    def factorised(self, local: np.ndarray) -> Solve:
        """What solves with the stiffness and the drag, for (n_contacts, d, d) answers of the contact points.

        Raises
        ------
        NotSolved
        """
        each = np.matmul(self.blocks.transpose(0, 2, 1), np.matmul(local, self.blocks))
        try:
            return self.coupling.factorised(each, self.drag)
        except Singular as error:
            raise NotSolved(str(error)) from None


def paired(normal: np.ndarray, shear: np.ndarray) -> np.ndarray:
    """(d n_contacts,) array: normal and shear forces of each contact point, one behind the other."""
    return np.column_stack([normal, shear]).ravel()
