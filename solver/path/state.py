"""The state of a path: what is stored is what is advanced."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from solver.geometry.contacts import Contacts
from solver.kinematics import Pose
from solver.program.admissible import Admissible


@dataclass(frozen=True)
class Place:
    """Where a path stands: everything that the next step remembers.

    Attributes
    ----------
    s : float [m or rad]
        Parameter of the driver.
    pose : Pose
    contacts : Contacts, optional
        The contact points whose forces are remembered; None where there are none.
    forces : (n_contacts, d) array
        Their normal and shear forces, in units of the program.
    trial : (n_contacts, d) array
        Forces of the springs before contact and friction cut them: which points push and slide, where the next program
        starts.
    followed : (n_contacts,) array
        Normal forces that the friction bounds have followed to: B = μ times these.
    multiplier : float
        Of the live load.
    velocity : (n_blocks, n_dof) array, optional
        In the steps that led here, per unit of the parameter, or of time where blocks fall; None where nothing moved.
    works : tuple of float
        Of dead and live loads, on supports and of friction since the start of the phase, in units of the program.
    """

    s: float
    pose: Pose
    contacts: Contacts | None
    forces: np.ndarray
    trial: np.ndarray
    followed: np.ndarray
    multiplier: float = 0.0
    velocity: np.ndarray | None = None
    works: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)

    @classmethod
    def unloaded(cls, pose: Pose, s: float = 0.0) -> Place:
        """Return the place of a pose that remembers no forces."""
        none = np.zeros((0, pose.positions.shape[1]))
        return cls(s, pose, None, none, none, np.zeros(0))


@dataclass(frozen=True)
class PathState:
    """Everything a path remembers: given back, it goes on bit for bit.

    Attributes
    ----------
    phase : int
        Number of the settlement, from 0.
    start : Pose
        Where the phase began.
    place : Place
    step : float [m or rad]
        To try next.
    upper_bound : float [m or rad]
        Smallest parameter known to have no equilibrium, while a collapse is being enclosed; infinite otherwise.
    refined : bool
        Whether the upper bound was found with reduced viscosity.
    refine_until : float [m or rad]
        Parameter up to which the viscosity stays reduced.
    history : tuple of Place
        Places passed of late, oldest first, to go back to from where no equilibrium exists.
    ended : bool
        The phase has reached its limit.
    fell_at : (n_blocks,) array
        As in :class:`solver.results.increment.State`.
    """

    phase: int
    start: Pose
    place: Place
    step: float
    upper_bound: float = np.inf
    refined: bool = False
    refine_until: float = -np.inf
    history: tuple[Place, ...] = ()
    ended: bool = False
    fell_at: np.ndarray = field(default_factory=lambda: np.zeros(0))


@dataclass(frozen=True)
class EquilibriumCheck:
    """What equilibrium within friction says of a place.

    Attributes
    ----------
    place : Place
    contacts : Contacts
        At its pose.
    friction : (n_contacts,) array
    forces : (n_contacts, d) array
        In equilibrium where one exists; otherwise those of the path.
    measured : float
        Reaction [N or N·m] or multiplier of the live load.
    bounds : Admissible
    """

    place: Place
    contacts: Contacts
    friction: np.ndarray
    forces: np.ndarray
    measured: float
    bounds: Admissible


@dataclass(frozen=True)
class Note:
    """What happened at a place of the path: parameter s [m or rad], and words."""

    s: float
    words: str
