"""What an analysis gives back: increments, the checks by which they prove themselves, and how it ended."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import IntEnum, StrEnum
from typing import TYPE_CHECKING, Any

import numpy as np

from .assembly import Assembly
from .contact import Contacts, Interfaces
from .kinematics import Pose
from .loads import Loads, Settlement

if TYPE_CHECKING:
    from .limit import LimitLoad

__all__ = ["Certificate", "Collapse", "ContactState", "Increment", "Response", "Status", "total_weight"]


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
class Certificate:
    """Measures by which an increment proves itself.

    Attributes
    ----------
    equilibrium_residual : float
        Largest unbalanced force on a free block (moments over the block size), relative to the total weight.
    largest_penetration : float [m]
        Deepest overlap at a contact point after the geometry has been updated.
    duality_gap : float
        Difference between the static (lower bound) and the kinematic (upper bound) objective, relative.
    complementarity : float
        Σ force · distance from sliding or opening over all contact points, relative like the gap.
    kinematic_violation : float
        Largest violation of N + g ≥ μ|T|, relative to the block size.
    """

    equilibrium_residual: float
    largest_penetration: float
    duality_gap: float
    complementarity: float
    kinematic_violation: float


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


@dataclass(frozen=True)
class Collapse:
    """Where the structure loses equilibrium.

    Attributes
    ----------
    displacement : float [m or rad]
        Middle of the bracket.
    bracket : (float, float) [m or rad]
        Last settlement with an equilibrium, first one without.
    reaction : float [N or N·m]
        At the last equilibrium.
    mechanism : (n_blocks, 3) array
        Direction in which the blocks move when they fall, largest movement 1 (rotations times block size).
    unit : str
    words : str
        How it fails: macro-blocks, hinges and sliding joints.
    """

    displacement: float
    bracket: tuple[float, float]
    reaction: float
    mechanism: np.ndarray
    unit: str = "m"
    words: str = ""

    def __str__(self) -> str:
        low, high = self.bracket
        force = "N" if self.unit == "m" else "N·m"
        return (
            f"collapse at {self.displacement:.6g} {self.unit} (equilibrium at {low:.6g}, none at {high:.6g}), "
            f"reaction {self.reaction:.6g} {force}, {self.words}"
        )


@dataclass(frozen=True)
class Response:
    """A whole analysis.

    Attributes
    ----------
    assembly : Assembly
    settlements : tuple of Settlement
    interfaces : Interfaces
    loads : Loads
    increments : tuple of Increment
        The equilibrium path first, then the frames of the fall.
    stop : Status
        ``COLLAPSED``, ``LIMIT_REACHED``, ``NO_INITIAL_EQUILIBRIUM``, ``LOCKED`` (blocks wedged between supports that
        close in on them) or ``SOLVER_FAILED``.
    message : str
        Why it stopped, in words.
    collapse : Collapse or None
    analysis : str
        "settlement"; "pushover", whose ``settlement`` is a control displacement; or "limit load", whose increments in
        equilibrium are limit states: after settlements where there are any, else one for each position x [m] of a
        load that moves, kept in ``settlement``.
    limits : tuple of LimitLoad
        Of a limit load analysis, one per limit state, in their order.
    """

    assembly: Assembly
    settlements: tuple[Settlement, ...]
    interfaces: Interfaces
    loads: Loads
    increments: tuple[Increment, ...]
    stop: Status
    message: str = ""
    collapse: Collapse | None = field(default=None)
    analysis: str = "settlement"
    limits: tuple[LimitLoad, ...] = ()

    def __repr__(self) -> str:
        """One line: what was analysed, and how it ended."""
        blocks, increments = self.assembly.n_blocks, len(self.increments)
        return f"<Response of {blocks} blocks: {self.analysis}, {increments} increments, {self.stop}>"

    @property
    def path(self) -> tuple[Increment, ...]:
        """The increments in equilibrium."""
        return tuple(i for i in self.increments if i.status == Status.EQUILIBRIUM)

    @property
    def notes(self) -> tuple[str, ...]:
        """What the increments tell in words, in their order."""
        return tuple(note for increment in self.increments for note in increment.notes)

    @property
    def settlement(self) -> np.ndarray:
        """(n,) array [m or rad]: settlement of each increment in equilibrium."""
        return np.array([i.settlement for i in self.path])

    @property
    def reaction(self) -> np.ndarray:
        """(n,) array [N or N·m]: reaction of each increment in equilibrium."""
        return np.array([i.reaction for i in self.path])

    @property
    def load_multiplier(self) -> np.ndarray:
        """(n,) array: load multiplier of each increment in equilibrium."""
        return np.array([i.load_multiplier for i in self.path])

    @property
    def total_weight(self) -> float:
        """Weight of the free blocks [N]."""
        return total_weight(self.assembly)


def total_weight(assembly: Assembly) -> float:
    """Weight of the free blocks [N]."""
    from .loads import GRAVITY

    return float(assembly.masses[assembly.free].sum() * GRAVITY)
