"""Phases: what changes before a settlement begins."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from .loads import Loads, added
from .words import numbers_of, plain


@dataclass(frozen=True, eq=False)
class PhaseChange:
    """What changes before a settlement begins; joints keep the forces that they have, and blocks come to rest first.

    Attributes
    ----------
    phase : int
        Number of the settlement, from 0.
    removed : (n_blocks,) bool array, optional
        Blocks that are taken away.
    dead : (n_blocks, n_dof) array, optional [N, N·m]
        Dead loads that are added from then on.
    dead_arms : (n_blocks, d, d) array, optional [N·m]
        Of those of them that are forces at points, as in :class:`Loads`.
    dead_acceleration : (n_blocks, d) array, optional
        That is added, of the fill over each block, likewise.
    ties : tuple of str
        Names of ties that are taken away.
    """

    phase: int
    removed: np.ndarray | None = None
    dead: np.ndarray | None = None
    ties: tuple[str, ...] = ()
    dead_arms: np.ndarray | None = None
    dead_acceleration: np.ndarray | None = None

    def __post_init__(self) -> None:
        """Make arrays of its own of what is given: the caller may fill theirs again."""
        object.__setattr__(self, "ties", plain(self.ties, "Sequence[str]", "ties of a change"))
        if self.removed is not None:
            object.__setattr__(self, "removed", np.array(self.removed))
        for name in ("dead", "dead_arms", "dead_acceleration"):
            if (given := getattr(self, name)) is not None:
                object.__setattr__(self, name, numbers_of(given, f"{name} of a change"))


def removed_before(changes: Sequence[PhaseChange], phase: int, n_blocks: int) -> np.ndarray:
    """(n_blocks,) bool array: blocks that are taken away before a settlement, and have not been before."""
    now, earlier = np.zeros((2, n_blocks), dtype=bool)
    for change in changes:
        if change.phase <= phase and change.removed is not None:
            of = now if change.phase == phase else earlier
            of |= change.removed
    return now & ~earlier


def loads_in(loads: Loads, changes: Sequence[PhaseChange], phase: int) -> Loads:
    """Return the loads during a settlement, by its number from 0."""
    for change in changes:
        if change.phase <= phase and change.dead is not None:
            names = ("dead", "dead_arms", "dead_acceleration")
            more: dict[str, Any] = {name: added(getattr(loads, name), getattr(change, name)) for name in names}
            loads = replace(loads, **more)
    return loads
