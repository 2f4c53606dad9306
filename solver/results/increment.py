"""Increment: one equilibrium on the path or one frame of the fall, and what its contact points do."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from enum import IntEnum, StrEnum
from typing import Any, Protocol

import numpy as np

from solver.geometry.contacts import Contacts
from solver.kinematics import Pose

from .certificate import Certificate


class Status(StrEnum):
    """State of an increment, or of a whole analysis."""

    EQUILIBRIUM = "equilibrium"
    FALLING = "falling"
    COLLAPSED = "collapsed"
    LIMIT_REACHED = "limit reached"
    NO_INITIAL_EQUILIBRIUM = "no initial equilibrium"
    LOCKED = "locked"
    SOLVER_FAILED = "solver failed"
    INTERRUPTED = "interrupted"


class ContactState(IntEnum):
    """What a contact point does in an increment."""

    OPEN = 0
    STICKING = 1
    SLIDING = 2
    HINGING = 3


#: A contact point carries force from this fraction of the largest normal force on.
SMALLEST_FORCE = 1e-9

#: A contact point opens or slips where its relative velocity exceeds this fraction of the fastest block.
SMALLEST_RATE = 1e-6


@dataclass(frozen=True)
class State:
    """The arrays of an increment: where its blocks are, what their joints carry, and how they move next.

    Attributes
    ----------
    pose : Pose
    contacts : Contacts
    forces : (n_contacts, 2) array [N]
        Normal (compression positive) and shear force on ``block_a`` at each contact point.
    displacements : (n_contacts, 2) array
        Opening and slip of each contact point in the increment that follows, per unit of the parameter; in a fall,
        per frame.
    friction : (n_contacts,) array
        Friction coefficient of each contact point.
    velocity : (n_blocks, 3) array
        Movement of each block in the increment that follows, per unit of the parameter; in a fall, per frame.
    support_forces : (n_blocks, 3) array [N, N, N·m]
        Resultant of the structure on each support about its centroid; zero for free blocks.
    """

    pose: Pose
    contacts: Contacts
    forces: np.ndarray
    displacements: np.ndarray
    friction: np.ndarray
    velocity: np.ndarray
    support_forces: np.ndarray


class StoredState(Protocol):
    """A state that is kept elsewhere, in a file, and read whenever it is asked for."""

    def read(self) -> State:
        """The state."""


@dataclass(frozen=True)
class Increment:
    """One equilibrium on the path, or one frame of the fall after it: a few numbers, and a state.

    Attributes
    ----------
    parameter : float
        What the analysis runs over (:attr:`Response.parameter`): of a settlement, that of the moving supports within
        its phase [m or rad]; of a pushover the control displacement [m]; of a load that moves its position x [m].
    measured : float
        What the analysis measures there (:attr:`Response.measured`): the reaction [N or N·m] or the load multiplier.
    phase : int
        Which of several settlements, from 0.
    load_multiplier : float
        α of the live loads.
    reaction : float [N]
        Force of the structure on the moving supports along their motion [N·m for a rotation]; of live loads, their
        resultant at this multiplier.
    certificate : Certificate
    status : Status
        ``EQUILIBRIUM``, or ``FALLING`` for pseudo-time frames: no equilibrium, no dynamics.
    programs : int
        Linear programs solved for this increment.
    seconds : float
        Time spent on this increment.
    held : State or StoredState
        The arrays, in memory or in a file; :attr:`state` has them in any case.
    notes : tuple of str
        What happened on the way to it that forces and poses do not tell: blocks that fell and were caught.
    checkpoint : optional
        Where the loop that yields the increment goes on after it: :class:`Checkpoint` of a settlement,
        :class:`PushoverCheckpoint` of a pushover. A :class:`Response` keeps none.
    """

    parameter: float
    measured: float
    phase: int
    load_multiplier: float
    reaction: float
    certificate: Certificate
    status: Status
    programs: int
    seconds: float
    held: State | StoredState = field(repr=False, compare=False)
    notes: tuple[str, ...] = ()
    checkpoint: Any = field(default=None, repr=False, compare=False)

    def __repr__(self) -> str:
        """One line; the arrays of a wall fill screens."""
        return (
            f"<Increment {self.status} at {self.parameter:g}, reaction {self.reaction:.6g}, "
            f"load multiplier {self.load_multiplier:.6g}>"
        )

    @property
    def state(self) -> State:
        """The arrays, read from their file where they are kept in one."""
        return self.held if isinstance(self.held, State) else self.held.read()

    def with_arrays(self, **arrays: Any) -> Increment:
        """The increment in memory, some of its arrays replaced.

        Parameters
        ----------
        **arrays
            Fields of :class:`State`.
        """
        return replace(self, held=replace(self.state, **arrays))

    @property
    def settlement(self) -> float:
        """The parameter, by the name it has in most analyses."""
        return self.parameter

    @property
    def pose(self) -> Pose:
        """Where the blocks are."""
        return self.state.pose

    @property
    def contacts(self) -> Contacts:
        """The contact points."""
        return self.state.contacts

    @property
    def forces(self) -> np.ndarray:
        """(n_contacts, 2) array [N]: normal and shear force on ``block_a``; see :class:`State`."""
        return self.state.forces

    @property
    def displacements(self) -> np.ndarray:
        """(n_contacts, 2) array: opening and slip per unit of the parameter; see :class:`State`."""
        return self.state.displacements

    @property
    def friction(self) -> np.ndarray:
        """(n_contacts,) array: friction coefficients."""
        return self.state.friction

    @property
    def velocity(self) -> np.ndarray:
        """(n_blocks, 3) array: movement of each block per unit of the parameter; see :class:`State`."""
        return self.state.velocity

    @property
    def support_forces(self) -> np.ndarray:
        """(n_blocks, 3) array [N, N, N·m]: resultant of the structure on each support; see :class:`State`."""
        return self.state.support_forces

    @property
    def states(self) -> np.ndarray:
        """(n_contacts,) uint8 array of :class:`ContactState`.

        Open where no force is carried; hinging where it is and the joint opens at another point; sliding where
        the point moves along the joint with the friction used up; sticking otherwise.
        """
        normal, shear = self.forces[:, 0], np.abs(self.forces[:, 1])
        carrying = normal > SMALLEST_FORCE * normal.max(initial=0.0)
        rate = SMALLEST_RATE * np.abs(self.velocity[:, :2]).max(initial=0.0)
        sliding = carrying & (np.abs(self.displacements[:, 1]) > rate) & (shear >= self.friction * normal * (1 - 1e-6))
        low, high = (
            np.minimum(self.contacts.block_a, self.contacts.block_b),
            np.maximum(self.contacts.block_a, self.contacts.block_b),
        )
        joint = low.astype(np.int64) * len(self.velocity) + high
        _, joint = np.unique(joint, return_inverse=True)
        opens = np.zeros(joint.max(initial=-1) + 1, dtype=bool)
        opens[joint[self.displacements[:, 0] > rate]] = True
        states = np.full(len(normal), ContactState.OPEN, dtype=np.uint8)
        states[carrying] = ContactState.STICKING
        states[carrying & opens[joint] & (self.displacements[:, 0] <= rate)] = ContactState.HINGING
        states[sliding] = ContactState.SLIDING
        return states
