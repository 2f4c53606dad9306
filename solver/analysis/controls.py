"""How an increment loop proceeds, and how it ended."""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite

from solver.results.increment import Status
from solver.results.response import Collapse

#: How increments are found: along the path that Coulomb friction leaves, or by the paper's linear program.
COULOMB, LINEAR_PROGRAM = "coulomb", "linear program"
INCREMENTS = (COULOMB, LINEAR_PROGRAM)

#: Free blocks up to which a settlement follows the path of Coulomb friction where nothing else is asked for: on it a
#: façade of 1,500 takes minutes an increment.
LARGEST_FOLLOWED = 500


#: Frames of the fall after collapse, by dimension, where nothing else is asked for.
FALLING_FRAMES = {2: 10, 3: 40}


@dataclass(frozen=True)
class Controls:
    """How the increment loop proceeds; the defaults suit everything we have tried.

    Attributes
    ----------
    increments : {"coulomb", "linear program"}, optional
        The path of Coulomb friction, or the method of Portioli & Cascini (2017) with a linear program per increment,
        of settlements only, which depends on rounding where many joints slide. By default the former up to 500 free
        blocks and for every pushover, the latter, which takes a twentieth of the time there, for larger settlements.
    overlap_tolerance : float, optional [m]
        Overlap of two blocks in the drawing that is accepted; a thousandth of the width of the thinnest block.
    falling_frames : int, optional
        Frames of the fall after collapse: enough for the mechanism in the plane, where dynamics can show the fall, and
        to follow it in space.
    shorter_steps : float
        Of the path: its steps, and those in which events are followed, are so many times as short. A second path with 2
        tells how much the length of the steps matters.
    trust_region : float, optional [m]
        Of the linear program: largest movement of a block; the block size, or ten increments where that is more.
    event_refinement : int
        Of the linear program: where the mechanism changes, the increment is taken again in steps down to one part in so
        many.
    correctors : int
        Of the linear program: largest number of corrections within an increment.

    Raises
    ------
    ValueError
        For an unknown way to find increments, or shorter_steps below 1.
    """

    increments: str | None = None
    overlap_tolerance: float | None = None
    falling_frames: int | None = None
    shorter_steps: float = 1.0
    trust_region: float | None = None
    event_refinement: int = 8
    correctors: int = 25

    def __post_init__(self) -> None:
        """Refuse an unknown way to find increments, and longer steps than those that are known to do."""
        if self.increments not in (None, *INCREMENTS):
            raise ValueError(f"increments is '{self.increments}'; it is 'coulomb' or 'linear program'")
        if not (isfinite(self.shorter_steps) and self.shorter_steps >= 1.0):
            raise ValueError(f"shorter_steps is {self.shorter_steps:g}; it is at least 1")

    def frames(self, dimension: int) -> int:
        """Frames of the fall after collapse of a structure in the plane, 2, or in space, 3."""
        return FALLING_FRAMES[dimension] if self.falling_frames is None else self.falling_frames


@dataclass(frozen=True)
class Ending:
    """How an increment loop ended: the value its generator returns."""

    stop: Status
    message: str = ""
    collapse: Collapse | None = None
