"""Checkpoints: where a path stands after an increment, from which it goes on to the same result."""

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
class Checkpoint:
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


@dataclass(frozen=True)
class PushoverPlace:
    """An equilibrium on a pushover's path, how it was reached, and the multiplier there once it has been read.

    Attributes
    ----------
    d : float [m]
        Control displacement.
    pose : Pose
    step : float [m]
        That led here; 0 at the start.
    velocity : (n_blocks, 3) array, optional
        Of the blocks in that step, per unit of d.
    multiplier : float
        nan until it has been read.
    proved : bool
        Whether it has settled with the live load's work held.
    """

    d: float
    pose: Pose
    step: float = 0.0
    velocity: np.ndarray | None = None
    multiplier: float = np.nan
    proved: bool = False


@dataclass(frozen=True)
class PushoverCheckpoint:
    """Everything a pushover remembers when an increment is told: given back, it goes on bit for bit.

    The program at the place that is left is solved once more; it is not counted again.

    Attributes
    ----------
    start : Pose
        From which the control displacement counts.
    here : PushoverPlace
        Told, and to be left.
    before : PushoverPlace, optional
        To go back to.
    step : float [m]
        To try next.
    first_without : float [m]
        Smallest control displacement known to have no equilibrium; infinite where none is known.
    work : float [N]
        Of the live load per control displacement, as last used; 0 where it is not known.
    """

    start: Pose
    here: PushoverPlace
    before: PushoverPlace | None
    step: float
    first_without: float
    work: float
