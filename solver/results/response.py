"""Response: a whole analysis, and how it ended."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from solver.assembly import Assembly
from solver.interfaces import Interfaces
from solver.loads import GRAVITY, Loads, Settlement

from .increment import Increment, Status
from .limit import LimitLoad
from .quantities import REACTION, SETTLEMENT, Quantity


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
    lost : str
        What there is at the one end of the bracket and not at the other: "equilibrium", or "capacity" where the
        multiplier of the live loads comes to zero.
    """

    displacement: float
    bracket: tuple[float, float]
    reaction: float
    mechanism: np.ndarray
    unit: str = "m"
    words: str = ""
    lost: str = "equilibrium"

    def __str__(self) -> str:
        """Say where, at which reaction, and how."""
        low, high = self.bracket
        force = "N" if self.unit == "m" else "N·m"
        return (
            f"collapse at {self.displacement:.6g} {self.unit} (equilibrium at {low:.6g}, none at {high:.6g}), "
            f"reaction {self.reaction:.6g} {force}, {self.words}"
        )


@dataclass(frozen=True)
class LocalLoss:
    """Blocks that left for good while the structure stood.

    Attributes
    ----------
    settlement : float [m or rad]
        Parameter, within its phase, at which they fell.
    blocks : tuple of str
    weight : float [N]
    share : float
        Of the weight of all free blocks.
    """

    settlement: float
    blocks: tuple[str, ...]
    weight: float
    share: float


class Control(Protocol):
    """What drives an analysis that no settlement drives: how far it goes, and in which unit."""

    @property
    def limit(self) -> float:
        """Where to stop."""

    @property
    def unit(self) -> str:
        """Of the limit."""


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
        Name of the kind of analysis: "settlement", "pushover" or "limit load".
    limits : tuple of LimitLoad
        Of increments in equilibrium that are limit states: one each, in their order.
    parameter : Quantity
        What the increments run over.
    measured : Quantity
        What is measured along them.
    control : optional
        What drives the parameter where no settlement does: the ControlDisplacement of a pushover.
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
    parameter: Quantity = SETTLEMENT
    measured: Quantity = REACTION
    control: Control | None = None

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
        """Notes of the increments, in their order."""
        return tuple(note for increment in self.increments for note in increment.notes)

    @property
    def losses(self) -> tuple[LocalLoss, ...]:
        """Blocks that left for good along the path, in the order in which they fell."""
        fell_at = self.path[-1].state.fell_at if self.path else np.zeros(0)
        weights = self.assembly.masses * GRAVITY
        losses = []
        for value in np.unique(fell_at[~np.isnan(fell_at)]):
            fallen = np.flatnonzero(fell_at == value)
            weight = float(weights[fallen].sum())
            names = tuple(self.assembly.names[k] for k in fallen)
            losses.append(LocalLoss(float(value), names, weight, weight / self.total_weight))
        return tuple(losses)

    @property
    def parameters(self) -> np.ndarray:
        """(n,) array: parameter of each increment in equilibrium, phases one after another."""
        return path_parameters(self.path)

    @property
    def values(self) -> np.ndarray:
        """(n,) array: measured value of each increment in equilibrium, nan where it is not finite."""
        values = np.array([i.measured for i in self.path])
        return np.where(np.isfinite(values), values, np.nan)

    @property
    def governing(self) -> Increment | None:
        """The increment that decides: of states that stand by themselves the lowest, else the last in equilibrium."""
        path = self.path
        if not path:
            return None
        if self.parameter.is_path:
            return path[-1]
        return path[int(np.argmin(np.nan_to_num([i.measured for i in path], nan=-np.inf, posinf=np.inf)))]

    @property
    def limit_states(self) -> list[tuple[LimitLoad, Increment]]:
        """Each limit load with the increment that reports it; one found in an interruption has none yet.

        Limit states come first, in the order of the limit loads; frames of a fall or a mechanism follow.
        """
        return list(zip(self.limits, self.increments, strict=False))

    @property
    def swings(self) -> bool:
        """Whether its frames without equilibrium show a mechanism that begins at a limit state, not a fall."""
        return bool(self.limits) and self.collapse is None and bool(self.path)

    @property
    def settlement(self) -> np.ndarray:
        """(n,) array [m or rad]: parameter of each increment in equilibrium within its phase."""
        return np.array([i.parameter for i in self.path])

    @property
    def reaction(self) -> np.ndarray:
        """(n,) array [N or N·m]: reaction of each increment in equilibrium."""
        return np.array([i.reaction for i in self.path])

    @property
    def initial_reaction(self) -> float:
        """Least reaction [N or N·m] that equilibrium allows before anything moves: what a first movement overcomes."""
        first = self.path[0]
        return first.least if np.isfinite(first.least) and self.control is None else first.reaction

    @property
    def load_multiplier(self) -> np.ndarray:
        """(n,) array: load multiplier of each increment in equilibrium."""
        return np.array([i.load_multiplier for i in self.path])

    @property
    def total_weight(self) -> float:
        """Weight of the free blocks [N]."""
        return total_weight(self.assembly)


def path_parameters(path: Sequence[Increment]) -> np.ndarray:
    """(n,) array: parameter of each increment, phases one after another."""
    total, before, last = np.zeros(len(path)), 0.0, 0.0
    for k, increment in enumerate(path):
        if k and increment.phase != path[k - 1].phase:
            before = last
        last = total[k] = before + increment.parameter
    return total


def total_weight(assembly: Assembly) -> float:
    """Weight of the free blocks [N]."""
    return float(assembly.masses[assembly.free].sum() * GRAVITY)
