"""Where a settlement by linear programs stands after an increment, from which it goes on to the same result."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from solver.kinematics import Pose


@dataclass(frozen=True)
class Place:
    """An equilibrium on the path, and how it was reached.

    Attributes
    ----------
    s : float [m or rad]
    pose : Pose
    step : float [m or rad]
        That led here; 0 at the start.
    velocity : (n_blocks, 3) array, optional
        Of the blocks in that step, per unit of s.
    proved : bool
        Whether a program with the supports nudged has confirmed the equilibrium.
    """

    s: float
    pose: Pose
    step: float = 0.0
    velocity: np.ndarray | None = None
    proved: bool = False


@dataclass(frozen=True)
class Note:
    """What happened at a place of the path: settlement s [m or rad], and words."""

    s: float
    words: str


@dataclass(frozen=True)
class ProgramCheckpoint:
    """Everything a settlement remembers between two increments: given back, it goes on bit for bit.

    Whoever gives the path a memory adds it here; writing and reading look at the fields' types, not at their names:
    numbers, texts, arrays, other dataclasses, tuples of these, or None.

    Attributes
    ----------
    phase : int
        Number of the settlement, from 0; behind the last increment of a phase that of the next, which may not exist.
    start : Pose
        Where the phase began.
    here : Place
        Reached, not yet told.
    left : tuple of Place
        Places to go back to, oldest first.
    step : float [m or rad]
        To try next; infinite at the start of a phase, whose increment it is then.
    first_without : float [m or rad]
        Smallest settlement known to have no equilibrium; infinite where none is known.
    told : float [m or rad]
        Settlement of the last increment.
    fallen : (n_blocks,) array [m], optional
        How far each block has fallen in snaps of this phase.
    snaps : int
        Of this phase.
    notes : tuple of Note
        For the next increment to tell.
    """

    phase: int
    start: Pose
    here: Place
    left: tuple[Place, ...]
    step: float
    first_without: float
    told: float
    fallen: np.ndarray | None = None
    snaps: int = 0
    notes: tuple[Note, ...] = ()
