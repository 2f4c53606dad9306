"""Limit loads: the largest multiplier of the live loads at one geometry, and over several positions."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np

from solver.geometry.contacts import Contacts
from solver.kinematics import Pose, relative_velocities

from .certificate import Certificate
from .increment import Increment, State, Status, StoredState

#: What is said with a limit load in space whose joints lift where they slide.
CAVEAT = (
    "associative friction lifts what slides: in grooves and wedges of blocks in space the multiplier may be too high; "
    'flow = "non-associative" slides without lift'
)


class LimitStatus(StrEnum):
    """What a limit load is.

    ``HELD``: a limit load, but without any live load the blocks would move: back onto joints that are open at this
    pose, or down. ``NO_EQUILIBRIUM``: the dead load is not carried, nor with any live load of this pattern.
    """

    FOUND = "limit load"
    HELD = "held by the live load"
    UNBOUNDED = "unbounded"
    NO_EQUILIBRIUM = "no equilibrium"
    NOT_CONVERGED = "not converged"


@dataclass(frozen=True)
class LimitLoad:
    """The capacity of a structure under live loads at one geometry.

    Attributes
    ----------
    multiplier : float
        α of the live loads at the limit; ``inf`` where no live load of this pattern causes collapse, ``nan`` where
        there is no equilibrium.
    bounds : (float, float)
        Static value, from forces in equilibrium within friction, and kinematic value, from the power balance of the
        mechanism, - dead · velocity / live · velocity (plus friction where it is not associative). For associative
        flow they enclose the limit load.
    certificate : Certificate
    status : LimitStatus
    flow : str
        "associative" or "non-associative".
    live_force : float [N]
        Resultant of the live loads on the free blocks at a multiplier of 1.
    programs : int
        Linear programs solved.
    torsion : str
        Of the faces of blocks in space: that of their contact "points", or under a "uniform" pressure.
    held : State or StoredState, optional
        The limit state: pose, closed contact points, their forces at the limit, and the mechanism as its velocity. In
        memory, or in a file; None where it is kept with the increment that reports the limit load.
    """

    multiplier: float
    bounds: tuple[float, float]
    certificate: Certificate
    status: LimitStatus
    flow: str
    live_force: float
    programs: int
    held: State | StoredState | None = field(default=None, repr=False, compare=False)
    torsion: str = "points"

    @property
    def state(self) -> State:
        """The limit state, read from its file where it is kept in one."""
        if self.held is None:
            raise ValueError("this limit load has only its numbers; its arrays are with the increment that reports it")
        return self.held if isinstance(self.held, State) else self.held.read()

    @property
    def pose(self) -> Pose:
        """The geometry."""
        return self.state.pose

    @property
    def contacts(self) -> Contacts:
        """The closed contact points."""
        return self.state.contacts

    @property
    def forces(self) -> np.ndarray:
        """(n_contacts, d) array [N]: normal (compression positive) and shear force on ``block_a`` at the limit."""
        return self.state.forces

    @property
    def friction(self) -> np.ndarray:
        """(n_contacts,) array: friction coefficients."""
        return self.state.friction

    @property
    def mechanism(self) -> np.ndarray:
        """(n_blocks, n_dof) array: how the blocks begin to move, largest movement 1 (rotations times block size).

        Where there is no equilibrium, how they fall; where the multiplier is unbounded, zero.
        """
        return self.state.velocity

    @property
    def caveat(self) -> str:
        """What is to be kept in mind with this limit load; empty where there is nothing.

        Friction without dilatancy may carry less than associative friction, in space more often than in the plane: what
        is pushed along a groove of half-angle 45° with μ = 0.5 slides at 0.707 of its weight, associative at 0.816.
        """
        return CAVEAT if self.flow == "associative" and self.mechanism.shape[1] == 6 else ""

    @property
    def gap(self) -> float:
        """Kinematic minus static value; what rounding leaves of it."""
        return self.bounds[1] - self.bounds[0]

    @property
    def increment(self) -> Increment:
        """The state at the limit as an increment, for pictures and tables; its velocity is the mechanism."""
        if self.held is None:
            raise ValueError("this limit load has only its numbers; its arrays are with the increment that reports it")
        finite = self.multiplier if np.isfinite(self.multiplier) else 0.0
        return Increment(
            parameter=0.0,
            measured=self.multiplier,
            phase=0,
            load_multiplier=self.multiplier,
            reaction=finite * self.live_force,
            certificate=self.certificate,
            status=Status.FALLING if self.status is LimitStatus.NO_EQUILIBRIUM else Status.EQUILIBRIUM,
            programs=self.programs,
            seconds=0.0,
            held=self.held,
        )

    def __str__(self) -> str:
        """Say how large it is, or why there is none."""
        moving = int((np.abs(self.mechanism).max(axis=1) > 0.01).sum())
        if self.status is LimitStatus.NO_EQUILIBRIUM:
            return f"no equilibrium under the dead load: {moving} blocks fall"
        if self.status is LimitStatus.UNBOUNDED:
            return "unbounded: no live load of this pattern brings the structure down"
        law = "" if self.torsion == "points" else f", {self.torsion} torsion"
        text = f"load multiplier {self.multiplier:.6g} ({self.flow} friction{law}, bounds differ by {self.gap:.1e})"
        text += f", {moving} blocks moving" + ("" if self.status is LimitStatus.FOUND else f", {self.status}")
        return f"{text}; {self.caveat}" if self.caveat else text


def limit_state(
    pose: Pose, contacts: Contacts, forces: np.ndarray, friction: np.ndarray, mechanism: np.ndarray
) -> State:
    """Make the state of a limit load; parameters as the attributes of :class:`LimitLoad`."""
    return State(
        pose=pose,
        contacts=contacts,
        forces=forces,
        displacements=relative_velocities(contacts, pose, mechanism),
        friction=friction,
        velocity=mechanism,
        support_forces=np.zeros_like(mechanism),
    )


@dataclass(frozen=True)
class Envelope:
    """Limit loads for several positions of a live load.

    Attributes
    ----------
    positions : (n,) array
        As given, usually x [m].
    limits : tuple of LimitLoad
    """

    positions: np.ndarray
    limits: tuple[LimitLoad, ...]

    @property
    def multipliers(self) -> np.ndarray:
        """(n,) array: load multiplier at each position."""
        return np.array([limit.multiplier for limit in self.limits])

    @property
    def worst(self) -> int:
        """Number of the position with the smallest multiplier; no equilibrium counts as smaller than any."""
        return int(np.argmin(np.nan_to_num(self.multipliers, nan=-np.inf, posinf=np.inf)))
