"""Increment: one equilibrium on the path or one frame of the fall, and what its contact points do."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import IntEnum, StrEnum
from typing import Any

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
class Increment:
    """One equilibrium on the path, or one frame of the fall after it.

    Attributes
    ----------
    settlement : float [m or rad]
        Parameter s of the moving supports within its phase; see :attr:`Response.analysis` for other analyses.
    phase : int
        Which of several settlements, from 0.
    load_multiplier : float
        α of the live loads.
    pose : Pose
    contacts : Contacts
    forces : (n_contacts, 2) array [N]
        Normal (compression positive) and shear force on ``block_a`` at each contact point.
    displacements : (n_contacts, 2) array [m]
        Opening and slip of each contact point in the increment that follows, per unit of s; in a fall,
        per frame.
    friction : (n_contacts,) array
        Friction coefficient of each contact point.
    velocity : (n_blocks, 3) array
        Movement of each block in the increment that follows, per unit of s; in a fall, per frame.
    reaction : float [N]
        Force of the structure on the moving supports along their motion [N·m for a rotation].
    support_forces : (n_blocks, 3) array [N, N, N·m]
        Resultant of the structure on each support about its centroid; zero for free blocks.
    certificate : Certificate
    status : Status
        ``EQUILIBRIUM``, or ``FALLING`` for pseudo-time frames: no equilibrium, no dynamics.
    programs : int
        Linear programs solved for this increment.
    seconds : float
        Time spent on this increment.
    notes : tuple of str
        What happened on the way to it that forces and poses do not tell: blocks that fell and were caught.
    checkpoint : optional
        Where the loop that yields the increment goes on after it: :class:`Checkpoint` of a settlement,
        :class:`PushoverCheckpoint` of a pushover. A :class:`Response` keeps none.
    """

    settlement: float
    phase: int
    load_multiplier: float
    pose: Pose
    contacts: Contacts
    forces: np.ndarray
    displacements: np.ndarray
    friction: np.ndarray
    velocity: np.ndarray
    reaction: float
    support_forces: np.ndarray
    certificate: Certificate
    status: Status
    programs: int
    seconds: float
    notes: tuple[str, ...] = ()
    checkpoint: Any = field(default=None, repr=False, compare=False)

    def __repr__(self) -> str:
        """One line; the arrays of a wall fill screens."""
        return (
            f"<Increment {self.status} at {self.settlement:g}, reaction {self.reaction:.6g}, "
            f"load multiplier {self.load_multiplier:.6g}>"
        )

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
