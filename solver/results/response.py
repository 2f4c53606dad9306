"""Response: a whole analysis, and how it ended; and limit loads, of which one is an analysis of its own."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import Any

import numpy as np

from solver.assembly import Assembly
from solver.interfaces import Interfaces
from solver.kinematics import Pose, moved_vertices
from solver.loads import GRAVITY, ControlDisplacement, Loads, Settlement
from solver.phases import PhaseChange, loads_in
from solver.ties import Tie
from solver.tolerances import AT_LIMIT, DRAWN_GAP
from solver.views import Shown, views
from solver.words import REMEDY, counted

from .certificate import Certificate
from .increment import HasState, Increment, State, Status, StoredState
from .quantities import LOAD_MULTIPLIER, LOAD_POSITION, REACTION, SETTLEMENT, Quantity


@dataclass(frozen=True, eq=False)
class Collapse(Shown):
    """Where the structure loses equilibrium.

    Attributes
    ----------
    displacement : float [m or rad]
        Middle of the bracket.
    bracket : (float, float) [m or rad]
        Last settlement with an equilibrium, first one without.
    reaction : float, optional [N or N·m]
        At the last equilibrium; None where its phase begins with the fall.
    mechanism : (n_blocks, n_dof) array
        Direction in which the blocks move when they fall, largest movement 1 (rotations times block size): what files
        and pictures have at the last equilibrium, whose increment has the motion in which the supports move on.
    unit : str
    words : str
        How it fails: macro-blocks, hinges and sliding joints.
    lost : str
        What there is at the one end of the bracket and not at the other: "equilibrium", "stable equilibrium" where
        forces would balance there that no motion leads to, "capacity" where the live loads' multiplier comes to zero.
    """

    displacement: float
    bracket: tuple[float, float]
    reaction: float | None
    mechanism: np.ndarray = field(repr=False)
    unit: str = "m"
    words: str = ""
    lost: str = "equilibrium"

    def __str__(self) -> str:
        """Say where, at which reaction, and how."""
        (low, high), where = self.bracket, f"collapse at {self.displacement:.6g} {self.unit}"
        if self.reaction is None:
            return f"{where}, before anything moves, {self.words}"
        between, force = f"({self.lost} at {low:.6g}, none at {high:.6g})", "N" if self.unit == "m" else "N·m"
        return f"{where} {between}, reaction {self.reaction:.6g} {force}, {self.words}"


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
    phase : int
        Number of the settlement, from 0.
    """

    settlement: float
    blocks: tuple[str, ...]
    weight: float
    share: float
    phase: int = 0


@dataclass(frozen=True, eq=False)
class Response(Shown):
    """A whole analysis.

    Attributes
    ----------
    assembly : Assembly
    settlements : tuple of Settlement
        Along which the increments run or, where they run over something else, after which they begin.
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
        What the increments run over, in the unit of the first settlement; others have their own, ``Settlement.unit``.
    measured : Quantity
        What is measured along them, with the unit that belongs to it.
    control : ControlDisplacement, optional
        What drives the parameter where no settlement does.
    ties : tuple of Tie
    changes : tuple of PhaseChange
        Of blocks and dead loads between the settlements.
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
    control: ControlDisplacement | None = None
    ties: tuple[Tie, ...] = ()
    changes: tuple[PhaseChange, ...] = ()

    def __repr__(self) -> str:
        """One line: what was analysed, and how it ended."""
        blocks, increments = counted(self.assembly.n_blocks, "block"), counted(len(self.increments), "increment")
        return f"<Response of {blocks}: {self.analysis}, {increments}, {self.stop}>"

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
        losses, weights = [], self.assembly.masses * GRAVITY
        gone = np.zeros(self.assembly.n_blocks, dtype=bool)
        for phase, end in {increment.phase: increment for increment in self.path}.items():
            fell_at = end.state.fell_at
            fell_at = np.where(gone, np.nan, fell_at if len(fell_at) else np.nan)
            gone |= ~np.isnan(fell_at)
            standing = float(weights[self.assembly.free & ~end.removed].sum())
            for value in np.unique(fell_at[np.isfinite(fell_at)]):
                fallen = np.flatnonzero(fell_at == value)
                weight = float(weights[fallen].sum())
                names = tuple(self.assembly.names[k] for k in fallen)
                losses.append(LocalLoss(float(value), names, weight, weight / standing, phase))
        return tuple(losses)

    def dead_at(self, increment: Increment, pose: Pose | None = None) -> np.ndarray:
        """(n_blocks, n_dof) array [N, N·m]: in the phase of an increment, at its pose or at another."""
        return self.loads_at(increment).dead_at(self.assembly, increment.pose if pose is None else pose)

    def loads_at(self, increment: Increment) -> Loads:
        """Return the loads in the phase of an increment."""
        return loads_in(self.loads, self.changes, increment.phase)

    @property
    def parameters(self) -> np.ndarray:
        """(n,) array: parameter of each increment in equilibrium, phases one after another.

        Where some turn and others move, a running number without unit: :attr:`settlement` has the parameters in theirs.
        """
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
        return path[-1 if self.parameter.is_path else lowest([i.measured for i in path])]

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
        """Least reaction [N or N·m] that equilibrium allows before anything moves; nan where there is none."""
        if not self.path:
            return np.nan
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

    def mesh(self, k: int = -1, *, shape: str = "moved") -> Any:
        """Make a PyVista dataset of the blocks of an increment.

        Parameters
        ----------
        k : int
            Number of the increment; -1 is the last equilibrium, and -2 the one before.
        shape : {"moved", "undeformed"}
            Where the blocks stand at the increment, or where they were drawn, their displacements in arrays.

        Returns
        -------
        pyvista.DataSet
            One cell per block; its arrays are those of ``increments/*.vtu``.

        Raises
        ------
        ImportError
            Where no package that draws is installed.
        """
        return views().dataset(self, "blocks", k, shape)

    def joints(self, k: int = -1, *, shape: str = "moved") -> Any:
        """Make a PyVista dataset of the joints of an increment: opening, slip, force; as :meth:`mesh`."""
        return views().dataset(self, "joints", k, shape)

    def contacts(self, k: int = -1, *, shape: str = "moved") -> Any:
        """Make a PyVista dataset of the contact points of an increment and their forces; as :meth:`mesh`."""
        return views().dataset(self, "contacts", k, shape)

    def members(self, k: int = -1, *, shape: str = "moved") -> Any:
        """Make a PyVista dataset of the ties, props and bars of an increment: a line each; as :meth:`mesh`.

        Cell arrays are ``force`` [N], tension positive, ``elongation`` [m], ``state``, ``name`` and ``kind``.
        """
        return views().dataset(self, "members", k, shape)

    def fall(self, time: float, *, shape: str = "moved") -> Any:
        """Make a PyVista dataset of the blocks so many seconds after the last equilibrium; as :meth:`mesh`."""
        return views().fall(self, time, shape)

    def animate(self, path: str | os.PathLike[str], **options: Any) -> Any:
        """Write the film of the collapse, its format chosen by the suffix; options of :func:`blockvis.animate`."""
        return views().animate(self, path, **options)


def path_parameters(path: Sequence[Increment]) -> np.ndarray:
    """(n,) array: parameter of each increment, phases one after another, in whichever unit each is."""
    total, before, last = np.zeros(len(path)), 0.0, 0.0
    for k, increment in enumerate(path):
        if k and increment.phase != path[k - 1].phase:
            before = last
        last = total[k] = before + increment.parameter
    return total


def total_weight(assembly: Assembly) -> float:
    """Weight of the free blocks [N]."""
    return float(assembly.masses[assembly.free].sum() * GRAVITY)


class LimitStatus(StrEnum):
    """What a limit load is.

    ``HELD``: a limit load, but without any live load the blocks would move: back onto joints that are open at this
    pose, or down. ``NO_EQUILIBRIUM``: the dead load is not carried, nor with any live load of this pattern.
    """

    FOUND = "limit load"
    HELD = "held by the live load"
    UNBOUNDED = "unbounded"
    NO_EQUILIBRIUM = "no equilibrium"
    NOT_CONVERGED = "not converged"


#: What a limit load is of.
Analysed = tuple[Assembly, Interfaces, Loads, tuple[Tie, ...]]


@dataclass(frozen=True)
class LimitLoad(HasState, Shown):
    """The capacity of a structure under live loads at one geometry.

    Attributes
    ----------
    multiplier : float
        α of the live loads at the limit; ``inf`` where no live load of this pattern causes collapse, ``nan`` where
        there is no equilibrium.
    bounds : (float, float)
        Static value, from forces in equilibrium within friction, and kinematic value, from the power balance of the
        mechanism, - dead · velocity / live · velocity (plus friction where it is not associative). For associative
        flow they enclose the limit load. Not converged: the multiplier, and that of associative flow, an upper bound.
    certificate : Certificate
    status : LimitStatus
    flow : str
        "associative" or "non-associative".
    live_force : float [N]
        Resultant of the live loads on the free blocks at a multiplier of 1.
    programs : int
        Linear or conic programs solved.
    torsion : str
        Of the faces of blocks in space: that of their contact "points", or under a "uniform" pressure.
    held : State or StoredState, optional
        The limit state: pose, closed contact points, their forces at the limit, and the mechanism as its velocity. In
        memory, or in a file; None where it is kept with the increment that reports the limit load.
    analysed : (Assembly, Interfaces, Loads, ties), optional
        Whose limit load it is.
    staying_open : float, optional
        Multiplier where joints that are open may not close for the live load; None where it has not been asked for.
    held_by : str
        Where there is no equilibrium, words of the forces with which there would be one.
    """

    multiplier: float
    bounds: tuple[float, float]
    certificate: Certificate
    status: LimitStatus
    flow: str
    live_force: float
    programs: int
    held: State | StoredState | None = field(default=None, repr=False, compare=False)
    torsion: str = "points"
    analysed: Analysed | None = field(default=None, repr=False, compare=False)
    staying_open: float | None = None
    held_by: str = field(default="", repr=False, compare=False)

    @property
    def mechanism(self) -> np.ndarray:
        """(n_blocks, n_dof) array: how the blocks begin to move, largest movement 1 (rotations times block size).

        Where there is no equilibrium, how they fall; where the multiplier is unbounded, zero.
        """
        return self.state.velocity

    @property
    def caveat(self) -> str:
        """What is to be kept in mind with this limit load; empty where there is nothing.

        Friction without dilatancy may carry less than associative friction, in space more often than in the plane: what
        is pushed along a groove of half-angle 45° with μ = 0.5 slides at 0.707 of its weight, associative at 0.816.
        """
        if self.flow != "associative" or self.mechanism.shape[1] == 3:
            return ""
        return (
            "associative friction lifts what slides: in grooves and wedges of blocks in space the multiplier may be "
            'too high; flow = "non-associative" slides without lift'
        )

    @property
    def gap(self) -> float:
        """Kinematic minus static value; what rounding leaves of it."""
        return self.bounds[1] - self.bounds[0]

    @property
    def increment(self) -> Increment:
        """The state at the limit as an increment, for pictures and tables; its velocity is the mechanism."""
        status = Status.FALLING if self.status is LimitStatus.NO_EQUILIBRIUM else Status.EQUILIBRIUM
        # A moment has no resultant, at any multiplier.
        reaction = self.multiplier * self.live_force if self.live_force else 0.0
        numbers: Any = {"parameter": 0.0, "measured": self.multiplier, "load_multiplier": self.multiplier, "phase": 0}
        beside: Any = {"certificate": self.certificate, "status": status, "programs": self.programs, "seconds": 0.0}
        return Increment(**numbers, reaction=reaction, **beside, held=self.state)

    @property
    def response(self) -> Response:
        """The limit load as an analysis of its own, as :attr:`Envelope.response`."""
        return Envelope(np.zeros(1), (self,)).response

    def __str__(self) -> str:
        """Say how large it is, or why there is none."""
        moving = np.flatnonzero(np.abs(self.mechanism).max(axis=1) > 0.01)
        if self.status is LimitStatus.NO_EQUILIBRIUM:
            falling, inside = counted(len(moving), "block falls", "blocks fall"), ""
            if self.analysed is not None:
                assembly, pose = self.analysed[0], self.state.pose
                falling += f" ({assembly.listed(moving, 4)})"
                tolerance = DRAWN_GAP * float(assembly.widths.min())
                i, j, depths = assembly.shapes.overlaps(moved_vertices(assembly, pose), tolerance)
                free, gone = assembly.free, self.fallen
                depth = depths[(free[i] | free[j]) & ~gone[i] & ~gone[j]].max(initial=0.0)
                inside = f"; blocks overlap by up to {depth:.3g} m at this pose" if depth > 0.0 else ""
            return f"no equilibrium under the dead load: {falling}{self.held_by}{inside}; {REMEDY}"
        if self.status is LimitStatus.UNBOUNDED:
            return "unbounded: no live load of this pattern brings the structure down"
        law = "" if self.torsion == "points" else f", {self.torsion} torsion"
        known = f", bounds differ by {self.gap:.1e}"
        if self.status is LimitStatus.NOT_CONVERGED:
            known = f", at most {self.bounds[1]:.6g}" if np.isfinite(self.bounds[1]) else ""
        doubt = "" if self.status is LimitStatus.FOUND else f", {self.status}"
        text = f"load multiplier {self.multiplier:.6g} ({self.flow} friction{law}{known})"
        text += f", {counted(len(moving), 'block')} moving{doubt}"
        return f"{text}; {self.caveat}" if self.caveat else text


@dataclass(frozen=True, eq=False)
class Envelope(Shown):
    """Limit loads for several positions of a live load.

    Attributes
    ----------
    positions : (n,) array
        As given, usually x [m].
    limits : tuple of LimitLoad
    """

    positions: np.ndarray
    limits: tuple[LimitLoad, ...]

    @property
    def multipliers(self) -> np.ndarray:
        """(n,) array: load multiplier at each position."""
        return np.array([limit.multiplier for limit in self.limits])

    @property
    def worst(self) -> int:
        """Number of the position with the smallest multiplier; no equilibrium counts as smaller than any."""
        return lowest(self.multipliers)

    @property
    def response(self) -> Response:
        """The limit loads as an analysis of its own, an increment each, for pictures, tables and files.

        Its loads are those of the worst position. ``ValueError`` where that one was read from a file.
        """
        worst = self.limits[self.worst]
        if worst.analysed is None:
            raise ValueError("this limit load does not know its structure; the response that reports it does")
        assembly, interfaces, loads, ties = worst.analysed
        places = zip(self.limits, self.positions.tolist(), strict=True)
        increments = tuple(replace(limit.increment, parameter=x) for limit, x in places)
        found: Any = {"stop": Status.LIMIT_REACHED, "message": str(worst), "limits": self.limits, "ties": ties}
        found |= {"analysis": "limit load", "parameter": LOAD_POSITION, "measured": LOAD_MULTIPLIER}
        return Response(assembly, (), interfaces, loads, increments, **found)


def lowest(multipliers: Sequence[float] | np.ndarray) -> int:
    """Find the number of the smallest multiplier, nan before any, and of those that rounding parts the first."""
    values = np.nan_to_num(multipliers, nan=-np.inf, posinf=np.inf)
    return int(np.argmax(np.isclose(values, values.min(), rtol=AT_LIMIT, atol=0.0)))
