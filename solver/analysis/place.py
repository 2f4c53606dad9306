"""Where a path stands, what equilibrium says of it, and what may come in the way of a step."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from solver.geometry.contacts import Contacts
from solver.kinematics import Pose
from solver.program.admissible import Admissible
from solver.program.step import NotSolved

from .checkpoint import ProgramCheckpoint


@dataclass(frozen=True)
class Place:
    """Where a path stands: everything that the next step remembers.

    Attributes
    ----------
    s : float [m or rad]
        Parameter of the driver.
    pose : Pose
    contacts : Contacts, optional
        The contact points that carry forces; None where none are remembered.
    forces : (n_contacts, d) array
        Their normal and shear forces, in units of the program.
    multiplier : float
        Of the live load.
    velocity : (n_blocks, n_dof) array, optional
        In the steps that led here, per unit of the parameter, those within :data:`MEMORY` above all; None where nothing
        moved with it.
    """

    s: float
    pose: Pose
    contacts: Contacts | None
    forces: np.ndarray
    multiplier: float = 0.0
    velocity: np.ndarray | None = None


@dataclass(frozen=True)
class Note:
    """What happened at a place of the path: parameter s [m or rad], and words."""

    s: float
    words: str


@dataclass(frozen=True)
class Checkpoint:
    """Everything a path remembers when an increment is reported: given back, it goes on bit for bit.

    Attributes
    ----------
    phase : int
        Number of the settlement, from 0.
    start : Pose
        Where the phase began.
    place : Place
        Reported.
    step : float [m or rad]
        To try next.
    first_without : float [m or rad]
        Smallest parameter known to have no equilibrium; infinite where none is known.
    works : tuple of float
        Of loads, on supports and of friction since the start of the phase, in units of the program.
    careful_until : float [m or rad]
        Parameter up to which a collapse is being enclosed.
    ended : bool
        The phase has reached its limit.
    marks : tuple of Place
        The last two that are a notable way apart.
    program : ProgramCheckpoint, optional
        Of increments by linear program, to which nothing else here but phase and start belongs.
    """

    phase: int
    start: Pose
    place: Place
    step: float
    first_without: float
    works: tuple[float, float, float] = (0.0, 0.0, 0.0)
    careful_until: float = -np.inf
    ended: bool = False
    marks: tuple[Place, ...] = ()
    program: ProgramCheckpoint | None = None


@dataclass(frozen=True)
class Proved:
    """A place with what equilibrium says of it.

    Attributes
    ----------
    place : Place
    contacts : Contacts
    friction : (n_contacts,) array
    bounds : Admissible or None
        None where balanced forces were found without them.
    forces : (n_contacts, d) array
        In equilibrium, where one exists; otherwise those of the path.
    measured : float
        Reaction [N or N·m] or multiplier of the live load.
    """

    place: Place
    contacts: Contacts
    friction: np.ndarray
    bounds: Admissible | None
    forces: np.ndarray
    measured: float

    @property
    def exists(self) -> bool:
        """Whether an equilibrium exists."""
        return self.bounds is None or self.bounds.exists


class Falls(Exception):
    """Blocks move far faster than the supports: no equilibrium near."""


class Wedged(Exception):
    """Blocks are wedged between the supports: forces grow without limit."""

    def __init__(self, place: Place) -> None:
        super().__init__("wedged")
        self.place = place


class Pressed(NotSolved):
    """Blocks were pressed into each other in a step, by more than what the joints give."""


class NoStep(Exception):
    """No step, however small, is solved."""
