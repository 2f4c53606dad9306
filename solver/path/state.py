"""The state of a path, which is what a checkpoint stores."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from solver.geometry.contacts import Contacts
from solver.kinematics import Pose
from solver.program.static_program import EquilibriumBounds
from solver.results.increment import Bonds
from solver.words import counted


@dataclass(frozen=True)
class Place:
    """A place of a path: everything that the next step needs; forces and works in units of the program."""

    s: float  #: [m or rad], parameter of the driver
    pose: Pose
    contacts: Contacts | None  #: of the forces; None where there are none
    forces: np.ndarray  #: (n_contacts, d)
    trial: np.ndarray  #: (n_contacts, d): trial forces, from which the next program starts
    followed: np.ndarray  #: (n_contacts,): normal forces of the friction bounds, B = μ times these
    multiplier: float = 0.0
    velocity: np.ndarray | None = None  #: (n_blocks, n_dof) [m, rad] per parameter, or time in a fall; None at rest
    #: Of dead and live loads, on supports, and of friction and ties since the start of the phase; sum of sizes by step.
    works: tuple[float, ...] = (0.0,) * 5
    #: (n_ties, 2) [m]: when they were installed, nan where absent; and without force, nan where broken, too.
    tie_lengths: np.ndarray = field(default_factory=lambda: np.zeros((0, 2)))
    bonds: Bonds = field(default_factory=Bonds)  #: of the contact points, with those that are lost

    @classmethod
    def unloaded(cls, pose: Pose, s: float = 0.0) -> Place:
        """Return the place of a pose without forces."""
        none = np.zeros((0, pose.positions.shape[1]))
        return cls(s, pose, None, none, none, np.zeros(0))


@dataclass(frozen=True)
class PathState:
    """The state of a path between two steps: a path that is resumed from it goes on bit for bit."""

    phase: int  #: number of the settlement, from 0
    start: Pose  #: where the phase began
    place: Place
    step: float  #: [m or rad], length of the next step
    upper_bound: float = np.inf  #: [m or rad]: without equilibrium, while a collapse is enclosed; infinite otherwise
    refine_until: float = -np.inf  #: [m or rad]: up to here the viscosity stays reduced
    history: tuple[Place, ...] = ()  #: places before, oldest first, to go back to from one without equilibrium
    reported: float = -np.inf  #: [m or rad], parameter of the last increment
    peak: float = 0.0  #: multiplier above which a peak is reported, as told: that of a place has viscosity in it
    fell_at: np.ndarray = field(default_factory=lambda: np.zeros(0))  #: (n_blocks,), as in :class:`State`

    def refuse_other(self, n_blocks: int, n_phases: int) -> None:
        """Raise ``ValueError`` where an analysis has another number of blocks, or no such phase."""
        if (own := len(self.start.rotations)) != n_blocks or self.phase >= n_phases:
            found = f"is of phase {self.phase + 1} of {n_phases} and has {counted(own, 'block')}"
            raise ValueError(f"the checkpoint {found}, the assembly {n_blocks}: it belongs to another run")


@dataclass(frozen=True)
class EquilibriumCheck:
    """Equilibrium within friction at a place of the path, with the contact points at its pose."""

    place: Place
    contacts: Contacts
    forces: np.ndarray  #: (n_contacts, d): in equilibrium where one exists; otherwise those that come nearest to it
    measured: float  #: reaction [N or N·m], or multiplier of the live load
    bounds: EquilibriumBounds
