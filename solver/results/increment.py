"""Increment: one equilibrium of the path or one frame of the fall, and the states of its contact points."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from enum import IntEnum, StrEnum
from typing import Any, Protocol

import numpy as np

from solver.geometry.contacts import Contacts, matched_contacts
from solver.kinematics import Pose
from solver.ties import TieForces
from solver.tolerances import DILATANCY_SLACK, SMALLEST_FORCE, SMALLEST_RATE, USED_UP

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
    """State of a contact point in an increment."""

    OPEN = 0
    STICKING = 1
    SLIDING = 2
    HINGING = 3


def carries(forces: np.ndarray, fraction: float = SMALLEST_FORCE) -> np.ndarray:
    """(n,) bool array: which points, by their forces (n, d), carry more than this part of the largest one."""
    return np.asarray(forces[:, 0] > fraction * forces[:, 0].max(initial=0.0))


def used_up(forces: np.ndarray, friction: np.ndarray) -> np.ndarray:
    """(n,) bool array: where the shear force reaches its friction bound, from (n, d) forces and (n,) coefficients."""
    return np.linalg.norm(forces[:, 1:], axis=1) >= friction * forces[:, 0] * (1.0 - USED_UP)


def slides(forces: np.ndarray, slip: np.ndarray, opening: np.ndarray, friction: np.ndarray, slow: float) -> np.ndarray:
    """(n,) bool array: which points slide along their joint, and do not only open or give, by their velocities."""
    # Associative friction opens by friction times slip; and bounds follow the normal forces, so that half is enough.
    lift = np.maximum(slow, friction * np.abs(slip) * (1.0 + DILATANCY_SLACK))
    gives = 2.0 * np.linalg.norm(forces[:, 1:], axis=1) < friction * forces[:, 0]
    return ~at_rest(slip, slow) & (opening <= lift) & ~gives


def at_rest(velocity: np.ndarray, slow: float) -> np.ndarray:
    """Which velocities are at most a slow one, in the same unit."""
    return np.abs(velocity) <= slow


@dataclass(frozen=True, eq=False)
class Bonds:
    """The points of joints with mortar or stiffness that were closed at rest: a point not among them has none."""

    #: (n, 3) int: that name the contact points.
    features: np.ndarray = field(default_factory=lambda: np.zeros((0, 3), dtype=np.int64))
    #: (n,) [m²]: at rest.
    areas: np.ndarray = field(default_factory=lambda: np.zeros(0))
    #: (n,): part of the cohesion and the tensile strength that is left.
    left: np.ndarray = field(default_factory=lambda: np.zeros(0))
    #: (n,) [m]: gap without force, as drawn where mortar fills it, more where elastic joints are drawn compressed.
    rest: np.ndarray = field(default_factory=lambda: np.zeros(0))

    def __len__(self) -> int:
        """Count the points."""
        return len(self.features)

    def of(self, contacts: Contacts) -> Bonds:
        """Return the bonds of these contact points, in their order: of areas with nothing left where there is none."""
        number, bonded = matched_contacts(contacts, self)
        areas, left, rest = contacts.areas.copy(), np.zeros(len(contacts)), np.zeros(len(contacts))
        for values, of_bonds in ((areas, self.areas), (left, self.left), (rest, self.rest)):
            values[bonded] = of_bonds[number[bonded]]
        return Bonds(contacts.features[:, :3], areas, left, rest)


@dataclass(frozen=True)
class State:
    """The arrays of an increment: pose, contact points, their forces, and the motion that follows."""

    pose: Pose
    contacts: Contacts
    forces: np.ndarray  #: (n_contacts, d) [N]: normal (compression positive) and shear force on ``block_a``
    #: (n_contacts, d): rates of opening and slip in the increment that follows, per unit of the parameter: a number, or
    #: m/rad; in a fall per frame [m].
    displacements: np.ndarray
    friction: np.ndarray  #: (n_contacts,): friction coefficient of each contact point
    #: (n_blocks, n_dof): movement in the increment that follows, per unit of the parameter; in a fall, per frame.
    velocity: np.ndarray
    support_forces: np.ndarray  #: (n_blocks, n_dof) [N, N·m]: on each support about its centroid; zero for free blocks
    #: (n_blocks,): parameter at which blocks have fallen, minus infinity for those that were taken away, nan for the
    #: others; empty where none have.
    fell_at: np.ndarray = field(default_factory=lambda: np.zeros(0))
    ties: TieForces = field(default_factory=TieForces)
    #: (n_contacts,): part of its cohesion and tensile strength that each point has left; empty for dry joints.
    intact: np.ndarray = field(default_factory=lambda: np.zeros(0))
    #: (n_contacts,) [m²]: part of the joint, at rest, that its mortar or springs stand for; empty for dry rigid joints.
    bonded: np.ndarray = field(default_factory=lambda: np.zeros(0))
    #: (n_contacts,) [m]: gap at which a joint has no force, as :attr:`Bonds.rest`; empty where that is none.
    unloaded: np.ndarray = field(default_factory=lambda: np.zeros(0))
    #: (n_contacts,) bool: which points carry their compressive strength; empty where no joint has one.
    crushing: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=bool))


class StoredState(Protocol):
    """A state that is stored in a file, and read on demand."""

    def read(self) -> State:
        """Read the state."""


class HasState:
    """What has arrays, in memory or in a file."""

    held: State | StoredState | None

    @property
    def state(self) -> State:
        """The arrays, read from a file where they are stored; ``ValueError`` for a limit load kept without them."""
        if self.held is None:
            raise ValueError("this limit load has only its numbers; its arrays are with the increment that reports it")
        return self.held if isinstance(self.held, State) else self.held.read()

    @property
    def pose(self) -> Pose:
        """Where the blocks are."""
        return self.state.pose

    @property
    def ties(self) -> TieForces:
        """What ties, props and bars do."""
        return self.state.ties

    @property
    def bonds(self) -> Bonds | None:
        """The strength that joints have left, and where they have no force; None of dry rigid joints."""
        state = self.state
        n = len(state.bonded)
        if not n:
            return None
        intact, unloaded = (of if len(of) else np.zeros(n) for of in (state.intact, state.unloaded))
        return Bonds(state.contacts.features[:, :3], state.bonded, intact, unloaded)

    @property
    def contacts(self) -> Contacts:
        """The contact points; of a limit load the closed ones."""
        return self.state.contacts

    @property
    def forces(self) -> np.ndarray:
        """(n_contacts, d) array [N]: normal (compression positive) and shear force on ``block_a``."""
        return self.state.forces

    @property
    def friction(self) -> np.ndarray:
        """(n_contacts,) array: friction coefficients."""
        return self.state.friction

    @property
    def fallen(self) -> np.ndarray:
        """(n_blocks,) bool array: blocks that have fallen or were taken away, and are out of the structure."""
        # Read once: the arrays may be in a file.
        state = self.state
        return ~np.isnan(state.fell_at) if len(state.fell_at) else np.zeros(len(state.pose.positions), dtype=bool)


@dataclass(frozen=True)
class Increment(HasState):
    """One equilibrium of the path, or one frame of the fall after it: numbers, and a state.

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
        ``EQUILIBRIUM``, or ``FALLING`` for frames of the fall in pseudo-time.
    programs : int
        Programs solved for this increment: of steps, and linear or conic ones.
    seconds : float
        Time spent on this increment.
    held : State or StoredState
        The arrays, in memory or in a file; :attr:`state` has them in any case.
    least, largest : float
        Bounds of the measured value over all forces in equilibrium within friction at this pose; infinite where there
        is none, nan where they were not computed.
    notes : tuple of str
        Events since the increment before: jumps, and blocks that have fallen.
    checkpoint : optional
        The :class:`PathState` from which the loop goes on; none in a :class:`Response`.
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
    least: float = field(default=np.nan, compare=False)
    largest: float = field(default=np.nan, compare=False)
    notes: tuple[str, ...] = ()
    checkpoint: Any = field(default=None, repr=False, compare=False)

    def __repr__(self) -> str:
        """One line, without arrays."""
        loads = f"reaction {self.reaction:.6g}, load multiplier {self.load_multiplier:.6g}"
        return f"<Increment {self.status} at {self.parameter:g}, {loads}>"

    def with_arrays(self, **arrays: Any) -> Increment:
        """Replace some of the arrays, fields of :class:`State`; the others are in memory then."""
        return replace(self, held=replace(self.state, **arrays))

    @property
    def settlement(self) -> float:
        """The parameter of most analyses."""
        return self.parameter

    @property
    def displacements(self) -> np.ndarray:
        """(n_contacts, d) array: opening and slip per unit of the parameter; see :class:`State`."""
        return self.state.displacements

    @property
    def velocity(self) -> np.ndarray:
        """(n_blocks, n_dof) array: movement of each block per unit of the parameter; see :class:`State`."""
        return self.state.velocity

    @property
    def support_forces(self) -> np.ndarray:
        """(n_blocks, n_dof) array [N, N·m]: resultant of the structure on each support; see :class:`State`."""
        return self.state.support_forces

    @property
    def removed(self) -> np.ndarray:
        """(n_blocks,) bool array: blocks that were taken away before a settlement."""
        state = self.state
        return np.isneginf(state.fell_at) if len(state.fell_at) else np.zeros(len(state.pose.positions), dtype=bool)

    @property
    def states(self) -> np.ndarray:
        """(n_contacts,) uint8 array of :class:`ContactState`.

        Open where no force is carried, and no mortar is left; hinging where it is carried and the joint opens at
        another point; sliding where the point moves along the joint with the friction used up; sticking otherwise.
        """
        carrying = carries(self.forces)
        rate = SMALLEST_RATE * np.abs(self.velocity[:, : self.forces.shape[1]]).max(initial=0.0)
        slipping = ~at_rest(np.linalg.norm(self.displacements[:, 1:], axis=1), rate)
        sliding = carrying & slipping & used_up(self.forces, self.friction)
        pairs, joint = self.contacts.joints()
        opens = np.zeros(len(pairs), dtype=bool)
        opens[joint[self.displacements[:, 0] > rate]] = True
        states = np.full(len(carrying), ContactState.OPEN, dtype=np.uint8)
        intact = self.state.intact
        states[carrying | (intact > 0.0 if len(intact) else False)] = ContactState.STICKING
        states[carrying & opens[joint] & (self.displacements[:, 0] <= rate)] = ContactState.HINGING
        states[sliding] = ContactState.SLIDING
        return states
