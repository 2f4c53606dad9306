"""The state of a path, which is what a checkpoint stores."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from solver.geometry.contacts import Contacts
from solver.kinematics import Pose
from solver.program.admissible import EquilibriumBounds
from solver.results.increment import Bonds


@dataclass(frozen=True)
class Place:
    """A place of a path: everything that the next step needs of the ones before.

    Attributes
    ----------
    s : float [m or rad]
        Parameter of the driver.
    pose : Pose
    contacts : Contacts, optional
        Those of the forces; None where there are none.
    forces : (n_contacts, d) array
        Their normal and shear forces, in units of the program.
    trial : (n_contacts, d) array
        Trial forces, from which the next program starts.
    followed : (n_contacts,) array
        Normal forces of the friction bounds: B = μ times these.
    multiplier : float
        Of the live load.
    velocity : (n_blocks, n_dof) array, optional
        Per unit of the parameter, or of time where blocks fall; None at rest.
    works : tuple of float
        Of dead and live loads, on supports, and of friction and ties since the start of the phase, in units of the
        program.
    tie_lengths : (n_ties, 2) array [m]
        Of each tie when it was installed, nan where it is absent; and without force, nan where it is broken, too.
    bonds : Bonds
        Of the contact points ``contacts``, with those that are lost.
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
    tie_lengths: np.ndarray = field(default_factory=lambda: np.zeros((0, 2)))
    bonds: Bonds = field(default_factory=Bonds)

    @classmethod
    def unloaded(cls, pose: Pose, s: float = 0.0) -> Place:
        """Return the place of a pose without forces."""
        none = np.zeros((0, pose.positions.shape[1]))
        return cls(s, pose, None, none, none, np.zeros(0))


@dataclass(frozen=True)
class PathState:
    """The state of a path between two steps: a path that is resumed from it goes on bit for bit.

    Attributes
    ----------
    phase : int
        Number of the settlement, from 0.
    start : Pose
        Where the phase began.
    place : Place
    step : float [m or rad]
        Length of the next step.
    upper_bound : float [m or rad]
        Smallest parameter known to have no equilibrium, while a collapse is enclosed; infinite otherwise.
    refined : bool
        Whether the upper bound was found with reduced viscosity.
    refine_until : float [m or rad]
        Parameter up to which the viscosity stays reduced.
    history : tuple of Place
        Places before, oldest first, to go back to from one without equilibrium.
    ended : bool
        Whether the phase has reached its limit.
    peak : float
        Largest multiplier that was reported.
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
    peak: float = 0.0
    fell_at: np.ndarray = field(default_factory=lambda: np.zeros(0))


@dataclass(frozen=True)
class EquilibriumCheck:
    """Equilibrium within friction at a place of the path, with the contact points at its pose.

    Forces, (n_contacts, d), are in equilibrium where one exists; otherwise those that come nearest to it. What is
    measured is the reaction [N or N·m] or the multiplier of the live load.
    """

    place: Place
    contacts: Contacts
    friction: np.ndarray
    forces: np.ndarray
    measured: float
    bounds: EquilibriumBounds
