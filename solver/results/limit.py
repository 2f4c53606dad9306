"""Limit loads: the largest multiplier of the live loads at one geometry, and over several positions."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from solver.geometry.contacts import Contacts
from solver.kinematics import Pose, relative_velocities

from .certificate import Certificate
from .increment import Increment, Status


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
        α of the live loads at the limit; ``inf`` where they are no danger, ``nan`` where there is no equilibrium.
    bounds : (float, float)
        Static value, from forces in equilibrium within friction, and kinematic value, from the power balance of the
        mechanism, - dead · velocity / live · velocity (plus friction where it is not associative). For associative
        flow they enclose the limit load.
    mechanism : (n_blocks, 3) array
        How the blocks begin to move, largest movement 1 (rotations times block size). Where there is no equilibrium,
        how they fall; where the multiplier is unbounded, zero.
    contacts : Contacts
        The closed contact points.
    forces : (n_contacts, 2) array [N]
        Normal (compression positive) and shear force on ``block_a`` at the limit.
    certificate : Certificate
    status : LimitStatus
    flow : str
        "associative" or "non-associative".
    pose : Pose
        The geometry.
    friction : (n_contacts,) array
        Friction coefficients.
    live_force : float [N]
        Resultant of the live loads on the free blocks at a multiplier of 1.
    programs : int
        Linear programs solved.
    """

    multiplier: float
    bounds: tuple[float, float]
    mechanism: np.ndarray
    contacts: Contacts
    forces: np.ndarray
    certificate: Certificate
    status: LimitStatus
    flow: str
    pose: Pose
    friction: np.ndarray
    live_force: float
    programs: int

    @property
    def gap(self) -> float:
        """Kinematic minus static value; what rounding leaves of it."""
        return self.bounds[1] - self.bounds[0]

    @property
    def increment(self) -> Increment:
        """The state at the limit as an increment, for pictures and tables; its velocity is the mechanism."""
        contacts, velocity = self.contacts, self.mechanism
        finite = self.multiplier if np.isfinite(self.multiplier) else 0.0
        return Increment(
            settlement=0.0,
            phase=0,
            load_multiplier=self.multiplier,
            pose=self.pose,
            contacts=contacts,
            forces=self.forces,
            displacements=relative_velocities(contacts, self.pose, velocity),
            friction=self.friction,
            velocity=velocity,
            reaction=finite * self.live_force,
            support_forces=np.zeros_like(velocity),
            certificate=self.certificate,
            status=Status.FALLING if self.status is LimitStatus.NO_EQUILIBRIUM else Status.EQUILIBRIUM,
            programs=self.programs,
            seconds=0.0,
        )

    def __str__(self) -> str:
        moving = int((np.abs(self.mechanism).max(axis=1) > 0.01).sum())
        if self.status is LimitStatus.NO_EQUILIBRIUM:
            return f"no equilibrium under the dead load: {moving} blocks fall"
        if self.status is LimitStatus.UNBOUNDED:
            return "unbounded: no live load of this pattern brings the structure down"
        text = f"load multiplier {self.multiplier:.6g} ({self.flow} friction, bounds differ by {self.gap:.1e})"
        return f"{text}, {moving} blocks moving" + ("" if self.status is LimitStatus.FOUND else f", {self.status}")


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
