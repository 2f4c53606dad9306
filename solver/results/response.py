"""Response: a whole analysis, and how it ended."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from solver.assembly import Assembly
from solver.interfaces import Interfaces
from solver.loads import GRAVITY, Loads, Settlement

from .increment import Increment, Status
from .limit import LimitLoad


@dataclass(frozen=True)
class Collapse:
    """Where the structure loses equilibrium.

    Attributes
    ----------
    displacement : float [m or rad]
        Middle of the bracket.
    bracket : (float, float) [m or rad]
        Last settlement with an equilibrium, first one without.
    reaction : float [N or N·m]
        At the last equilibrium.
    mechanism : (n_blocks, 3) array
        Direction in which the blocks move when they fall, largest movement 1 (rotations times block size).
    unit : str
    words : str
        How it fails: macro-blocks, hinges and sliding joints.
    """

    displacement: float
    bracket: tuple[float, float]
    reaction: float
    mechanism: np.ndarray
    unit: str = "m"
    words: str = ""

    def __str__(self) -> str:
        low, high = self.bracket
        force = "N" if self.unit == "m" else "N·m"
        return (
            f"collapse at {self.displacement:.6g} {self.unit} (equilibrium at {low:.6g}, none at {high:.6g}), "
            f"reaction {self.reaction:.6g} {force}, {self.words}"
        )


@dataclass(frozen=True)
class Response:
    """A whole analysis.

    Attributes
    ----------
    assembly : Assembly
    settlements : tuple of Settlement
    interfaces : Interfaces
    loads : Loads
    increments : tuple of Increment
        The equilibrium path first, then the frames of the fall.
    stop : Status
        ``COLLAPSED``, ``LIMIT_REACHED``, ``NO_INITIAL_EQUILIBRIUM``, ``LOCKED`` (blocks wedged between supports that
        close in on them) or ``SOLVER_FAILED``.
    message : str
        Why it stopped, in words.
    collapse : Collapse or None
    analysis : str
        "settlement"; "pushover", whose ``settlement`` is a control displacement; or "limit load", whose increments in
        equilibrium are limit states: after settlements where there are any, else one for each position x [m] of a
        load that moves, kept in ``settlement``.
    limits : tuple of LimitLoad
        Of a limit load analysis, one per limit state, in their order.
    """

    assembly: Assembly
    settlements: tuple[Settlement, ...]
    interfaces: Interfaces
    loads: Loads
    increments: tuple[Increment, ...]
    stop: Status
    message: str = ""
    collapse: Collapse | None = field(default=None)
    analysis: str = "settlement"
    limits: tuple[LimitLoad, ...] = ()

    def __repr__(self) -> str:
        """One line: what was analysed, and how it ended."""
        blocks, increments = self.assembly.n_blocks, len(self.increments)
        return f"<Response of {blocks} blocks: {self.analysis}, {increments} increments, {self.stop}>"

    @property
    def path(self) -> tuple[Increment, ...]:
        """The increments in equilibrium."""
        return tuple(i for i in self.increments if i.status == Status.EQUILIBRIUM)

    @property
    def notes(self) -> tuple[str, ...]:
        """What the increments tell in words, in their order."""
        return tuple(note for increment in self.increments for note in increment.notes)

    @property
    def settlement(self) -> np.ndarray:
        """(n,) array [m or rad]: settlement of each increment in equilibrium."""
        return np.array([i.settlement for i in self.path])

    @property
    def reaction(self) -> np.ndarray:
        """(n,) array [N or N·m]: reaction of each increment in equilibrium."""
        return np.array([i.reaction for i in self.path])

    @property
    def load_multiplier(self) -> np.ndarray:
        """(n,) array: load multiplier of each increment in equilibrium."""
        return np.array([i.load_multiplier for i in self.path])

    @property
    def total_weight(self) -> float:
        """Weight of the free blocks [N]."""
        return total_weight(self.assembly)


def total_weight(assembly: Assembly) -> float:
    """Weight of the free blocks [N]."""
    return float(assembly.masses[assembly.free].sum() * GRAVITY)
