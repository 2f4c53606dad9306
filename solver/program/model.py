"""The model: blocks, joints and loads of all increments, in the units of the programs."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from solver.assembly import Assembly
from solver.backfill import Backfill
from solver.interfaces import Interfaces
from solver.kinematics import Pose, dimension_of, turned_moments, unit_lengths
from solver.ties import Tie


@dataclass(frozen=True)
class Model:
    """Blocks, joints and loads, which are the same in all increments.

    Programs are written in units of the block size and the mean load of a free block. Loads are (n_blocks, n_dof) [N,
    N·m], arms (n_blocks, d, d) [N·m] as in :class:`solver.loads.Loads`; compliance and imperfection are times those of
    :mod:`solver.tolerances`.
    """

    assembly: Assembly
    interfaces: Interfaces
    load: np.ndarray  #: with the blocks as drawn
    length: float  #: [m]
    force: float  #: [N]
    live: np.ndarray | None = None  #: whose multiplier is an unknown of every program
    fallen: np.ndarray | None = None  #: (n_blocks,) bool: blocks that have left, without loads and contact points
    ties: tuple[Tie, ...] = ()
    fills: tuple[Backfill, ...] = ()  #: whose load as drawn is a part of ``load`` and follows the blocks
    arms: np.ndarray | None = None
    live_arms: np.ndarray | None = None
    compliance: float = 1.0
    imperfection: float = 1.0

    def without(self, fallen: np.ndarray) -> Model:
        """Return the model once blocks, (n_blocks,) bool array, have left it."""
        fills = tuple(fill.without(fallen) for fill in self.fills)
        arms = None if self.arms is None else np.where(fallen[:, None, None], 0.0, self.arms)
        return replace(self, load=np.where(fallen[:, None], 0.0, self.load), fallen=fallen, fills=fills, arms=arms)

    @property
    def n_dof(self) -> int:
        """Degrees of freedom of a block: 3 in the plane, 6 in space."""
        return self.load.shape[1]

    @property
    def dimension(self) -> int:
        """2 in the plane, 3 in space."""
        return dimension_of(self.n_dof)

    @property
    def lengths(self) -> np.ndarray:
        """(n_dof,) array [m or 1]: units of movements in the program."""
        return np.where(np.arange(self.n_dof) < self.dimension, self.length, 1.0)

    @property
    def scaled_load(self) -> np.ndarray:
        """(n_blocks, n_dof) array: the load in units of the program."""
        return self.load / (self.force * unit_lengths(self.n_dof, self.length))

    def scaled_load_at(self, pose: Pose) -> np.ndarray:
        """(n_blocks, n_dof) array: the load at a pose, which it has followed, in units of the program."""
        if not self.fills and self.arms is None:
            return self.scaled_load
        drawn = Pose.initial(self.assembly)
        moved = sum(fill.load(self.assembly, pose) - fill.load(self.assembly, drawn) for fill in self.fills)
        if self.arms is not None:
            moved = moved + turned_moments(self.arms, pose)
        return self.scaled_load + moved / (self.force * unit_lengths(self.n_dof, self.length))

    def scaled_live(self, pose: Pose) -> tuple[np.ndarray, float]:
        """(n_blocks, n_dof) array: live load on the free blocks, its largest component as drawn 1; and that one."""
        free, units = self.assembly.free[:, None], self.force * unit_lengths(self.n_dof, self.length)
        if self.live is None:
            return np.zeros((len(free), self.n_dof)), 0.0
        size = float(np.abs(np.where(free, self.live / units, 0.0)).max(initial=0.0))
        live = self.live if self.live_arms is None else self.live + turned_moments(self.live_arms, pose)
        return np.where(free, live / units, 0.0) / (size or 1.0), size

    @property
    def total_load(self) -> float:
        """Sum of the loads on the free blocks in units of the program."""
        return float(np.abs(self.scaled_load[self.assembly.free, : self.dimension]).sum())

    @property
    def live_force(self) -> float:
        """Resultant of the live loads at a multiplier of 1 [N]; zero without."""
        return 0.0 if self.live is None else float(np.linalg.norm(self.live[:, : self.dimension].sum(axis=0)))
