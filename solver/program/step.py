"""A step of the path: what it is made of, what it gives, and the matrix that both of its methods factorise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

#: Iterations, and part of the way to the nearest bound that is gone.
ITERATIONS, FRACTION = 60, 0.99

#: The solution counts when balance, the linear equations in parts of a step and an elastic give, and the largest
#: product in elastic gives across are below these. A point that neither carries nor is open keeps a force of the last
#: one's root.
BALANCE, EQUATIONS, PRODUCT = 1e-9, 1e-8, 1e-9

#: Mean product of force and distance, in block weights and sizes, at which a solution that converges no further counts.
PRODUCT_LEFT = 1e-9

#: Start: distances in parts of a step and an elastic give, forces in mean block weights.
FIRST_DISTANCE, FIRST_FORCE = 0.1, 0.05

#: Start near a known solution: least forces, and least distances in parts of a step and an elastic give.
NEAR = 1e-3

#: A step this short calls for centring; so many of them within the last few, twice over, and the path is lost.
SHORT, LOST, LOOK_BACK = 0.2, 4, 8

#: Corrections of second order are cut off at so many times the mean product.
CORRECTION = 10.0

#: Centring at least of the second try, which also leaves corrections of second order out.
CAREFUL = 0.5


#: Up to so many freedoms a dense factorisation is the faster.
DENSE = 150


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

    Forces and distances are those of the method, to start from again: in the plane N, λ⁺, λ⁻ and y, σ⁺, σ⁻; in space
    N, τ and y, γ, σ.
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
        n, n_dof = len(step.gap), len(step.load)
        number = np.full(len(step.free), -1)
        number[step.free] = np.arange(n_dof)
        # A column holds the rows of the two blocks, the same for a point's normal and shear forces.
        dof = number[step.matrix.indices.reshape(n, step.matrix.shape[1] // n, -1)[:, 0]]
        self.both = (dof[:, :, None] >= 0) & (dof[:, None, :] >= 0)
        row, column = (
            np.broadcast_to(dof[:, :, None], self.both.shape),
            np.broadcast_to(dof[:, None, :], self.both.shape),
        )
        diagonal = np.arange(n_dof)
        place = np.concatenate([column[self.both] * n_dof + row[self.both], diagonal * n_dof + diagonal])
        filled, self.place = np.unique(place, return_inverse=True)
        self.dense = n_dof <= DENSE
        self.raw = place
        self.indices, counts = filled % n_dof, np.bincount(filled // n_dof, minlength=n_dof)
        self.pointers = np.concatenate([[0], np.cumsum(counts)])
        self.drag = step.drag
        self.fill(step)

    def fill(self, step: Step) -> Pattern:
        """Take the numbers of a step with the same contact points; gives itself."""
        n = len(step.gap)
        self.blocks = step.matrix.data.reshape(n, step.matrix.shape[1] // n, -1)
        to_blocks = sp.csr_array(sp.csr_array(step.matrix)[step.free])
        self.to_blocks = to_blocks.toarray() if self.dense else to_blocks
        self.to_contacts = np.ascontiguousarray(self.to_blocks.T) if self.dense else sp.csr_array(to_blocks.T)
        return self

    def stiffness(self, local: np.ndarray) -> np.ndarray | sp.csc_array:
        """The matrix with the drag, for (n_contacts, d, d) answers of the contact points."""
        each = np.matmul(self.blocks.transpose(0, 2, 1), np.matmul(local, self.blocks))
        n = len(self.drag)
        if self.dense:
            return np.bincount(self.raw, np.concatenate([each[self.both], self.drag]), n * n).reshape(n, n).T
        data = np.bincount(self.place, np.concatenate([each[self.both], self.drag]), len(self.indices))
        return sp.csc_array((data, self.indices, self.pointers), shape=(n, n))


def paired(normal: np.ndarray, shear: np.ndarray) -> np.ndarray:
    """(d n_contacts,) array: normal and shear forces of each contact point, one behind the other."""
    return np.column_stack([normal, shear]).ravel()
