"""The model: blocks, joints and loads of all increments, in the units of the programs."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from solver.assembly import Assembly
from solver.geometry.contacts import Contacts
from solver.interfaces import Interfaces
from solver.kinematics import Pose, unit_lengths
from solver.loads import Loads
from solver.ties import Tie


def mean_load(assembly: Assembly, loads: Loads) -> float:
    """Mean dead load of the free blocks as drawn [N]."""
    drawn = loads.dead_at(assembly, Pose.initial(assembly))
    return float(np.linalg.norm(drawn[assembly.free, : assembly.dimension], axis=1).mean())


@dataclass(frozen=True)
class Model:
    """Blocks, joints and loads, which are the same in all increments."""

    assembly: Assembly
    interfaces: Interfaces
    loads: Loads
    length: float  #: [m]: unit of the programs, the block size
    force: float  #: [N]: likewise, the mean load of a free block
    fallen: np.ndarray  #: (n_blocks,) bool: blocks that have left, without loads and contact points
    has_live: bool = False  #: whether the multiplier of the live load is an unknown of every program
    ties: tuple[Tie, ...] = ()
    compliance: float = 1.0  #: times that of :mod:`solver.tolerances`
    imperfection: float = 1.0  #: likewise

    def without(self, fallen: np.ndarray) -> Model:
        """Return the model once blocks, (n_blocks,) bool array, have left it."""
        return replace(self, loads=self.loads.without(fallen), fallen=fallen)

    def standing(self, contacts: Contacts) -> Contacts:
        """Return the contact points between blocks that have not left."""
        return contacts[~(self.fallen[contacts.block_a] | self.fallen[contacts.block_b])]

    @cached_property
    def load(self) -> np.ndarray:
        """(n_blocks, n_dof) array [N, N·m]: dead load with the blocks as drawn."""
        return self.loads.dead_at(self.assembly, Pose.initial(self.assembly))

    @cached_property
    def live(self) -> np.ndarray:
        """(n_blocks, n_dof) array [N, N·m]: live load with the blocks as drawn."""
        return self.loads.live_at(self.assembly, Pose.initial(self.assembly))

    @property
    def n_dof(self) -> int:
        """Degrees of freedom of a block: 3 in the plane, 6 in space."""
        return self.loads.dead.shape[1]

    @property
    def dimension(self) -> int:
        """2 in the plane, 3 in space."""
        return self.assembly.dimension

    @property
    def lengths(self) -> np.ndarray:
        """(n_dof,) array [m or 1]: units of movements in the program."""
        return np.where(np.arange(self.n_dof) < self.dimension, self.length, 1.0)

    def scaled_load_at(self, pose: Pose) -> np.ndarray:
        """(n_blocks, n_dof) array: the load at a pose, which it has followed, in units of the program."""
        return self.loads.dead_at(self.assembly, pose) / (self.force * unit_lengths(self.n_dof, self.length))

    def scaled_live(self, pose: Pose) -> tuple[np.ndarray, float]:
        """(n_blocks, n_dof) array: live load on the free blocks, its largest component as drawn 1; and that one."""
        free, units = self.assembly.free[:, None], self.force * unit_lengths(self.n_dof, self.length)
        if not self.has_live:
            return np.zeros((len(free), self.n_dof)), 0.0
        size = float(np.abs(np.where(free, self.live / units, 0.0)).max(initial=0.0))
        return np.where(free, self.loads.live_at(self.assembly, pose) / units, 0.0) / (size or 1.0), size

    def held_by(self, missing: np.ndarray) -> str:
        """Words that go on with the forces which balance what falls, (n_free, n_dof) in units of the program."""
        d, size, free = self.dimension, np.abs(missing), np.flatnonzero(self.assembly.free)
        newtons = missing * self.force * unit_lengths(self.n_dof, self.length)
        ways = [f"N along {x}" for x in "xyz"[:d]] + [f"N·m about {x}" for x in "xyz"[d - self.n_dof :]]
        told = np.argwhere(size > 0.1 * size.max()).tolist()
        words = [f"{newtons[k, way]:.4g} {ways[way]} at '{self.assembly.names[free[k]]}'" for k, way in told[:4]]
        return f", and would stand with {', '.join(words)}" + " and others" * (len(told) > 4)

    @cached_property
    def total_load(self) -> float:
        """Sum of the loads on the free blocks in units of the program."""
        return float(np.abs(self.load[self.assembly.free, : self.dimension]).sum()) / self.force

    @property
    def live_force(self) -> float:
        """Resultant of the live loads at a multiplier of 1 [N]; zero without."""
        return float(np.linalg.norm(self.live[:, : self.dimension].sum(axis=0))) if self.has_live else 0.0
