"""A structure: blocks with their joints and loads, and what is asked of it."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from solver.words import checked, counted, numbers_of

from .analysis.increments import Increments
from .analysis.limit_load import find_limit_load
from .analysis.path_increments import pushover_increments, settlement_increments
from .assembly import Assembly
from .interfaces import InterfaceLaw, Interfaces, steep_note
from .kinematics import Pose
from .loads import ControlDisplacement, Loads, PointForces, Settlement, checked_loads
from .path.controls import Controls
from .phases import PhaseChange
from .results.increment import Bonds, Increment
from .results.quantities import CONTROL_DISPLACEMENT, LOAD_MULTIPLIER, reaction_to, settlement_in
from .results.response import Envelope, LimitLoad, Response
from .ties import Tie, TieForces
from .views import Shown


@dataclass(frozen=True, init=False, eq=False)
class Structure(Shown):
    """Blocks with their joints and loads.

    Parameters
    ----------
    assembly : Assembly
    interfaces : Interfaces, optional
        Laws per pair of materials; give these or a friction coefficient.
    loads : Loads, optional
        Self-weight by default.
    friction_coefficient : float, optional
        Of every interface.
    ties : sequence of Tie, optional
        Ties, props and bars.

    Raises
    ------
    TypeError
        Where neither interfaces nor a friction coefficient is given, or both are.
    ValueError
        For a friction coefficient or loads that are not finite, or loads of the wrong shape.
    """

    assembly: Assembly
    interfaces: Interfaces
    loads: Loads
    ties: tuple[Tie, ...]

    def __init__(
        self,
        assembly: Assembly,
        interfaces: Interfaces | None = None,
        loads: Loads | None = None,
        *,
        friction_coefficient: float | None = None,
        ties: Sequence[Tie] = (),
    ) -> None:
        interfaces = _laws(interfaces, friction_coefficient, usual=None)
        interfaces.check(checked(assembly, Assembly, "assembly"))
        loads, ties = checked_loads(assembly, loads), tuple(checked(tie, Tie, "one of the ties") for tie in ties)
        vars(self).update(assembly=assembly, interfaces=interfaces, loads=loads, ties=ties)

    def __repr__(self) -> str:
        """Say how many blocks it has."""
        return f"<Structure of {counted(self.assembly.n_blocks, 'block')}>"

    def with_live(
        self, live: np.ndarray | PointForces | None = None, *, acceleration: Sequence[float] | None = None
    ) -> Structure:
        """Put the structure under other live loads.

        Parameters
        ----------
        live : (n_blocks, n_dof) array [N, N·m] or PointForces, optional
        acceleration : (d,) sequence, optional
            Instead: in units of gravity, of every block and the fill over it; (1, 0) pushes to the right with their
            weight. Other dead loads have no mass: a warning tells them.
        """
        if (live is None) == (acceleration is None):
            raise TypeError("with_live needs either the live loads or an acceleration; give one of them")
        none = replace(self.loads, live=np.zeros_like(self.loads.dead), live_arms=None, live_acceleration=None)
        if acceleration is not None:
            accelerated = none.with_acceleration(self.assembly, acceleration)
            if note := accelerated.note_on_mass(self.assembly):
                warnings.warn(note, stacklevel=2)
            return replace(self, loads=accelerated)
        if isinstance(live, PointForces):
            return replace(self, loads=none.with_forces(self.assembly, live, "live"))
        return replace(self, loads=replace(none, live=numbers_of(live, "live loads")))

    def settle(
        self,
        settlement: Settlement | Sequence[Settlement] | Sequence[float] | np.ndarray,
        *,
        controls: Controls | None = None,
        changes: Sequence[PhaseChange] = (),
        on_increment: Callable[[Increment], None] | None = None,
    ) -> Response:
        """Follow the structure under its dead loads from its drawing through the settlement of supports to collapse.

        Parameters
        ----------
        settlement : Settlement, sequence of Settlement or (d,) sequence of float
            One phase, or several one after another; or only the direction in which the moving supports go.
        controls : Controls, optional
        changes : sequence of PhaseChange
            What changes before a settlement begins: blocks that are taken away, dead loads.
        on_increment : callable, optional
            Called with every :class:`Increment` as it is found.

        Returns
        -------
        Response

        Raises
        ------
        ValueError
            For input that cannot be analysed: no moving support, overlapping blocks.

        Notes
        -----
        Portioli & Cascini, Engineering Structures 148 (2017) 485-496, https://doi.org/10.1016/j.engstruct.2017.06.073:
        rigid blocks, no-tension frictional contact points, gap functions, a convex program per increment, the geometry
        updated after each, until no equilibrium exists.
        """
        if self.loads.live.any():
            warnings.warn("a settlement leaves the live loads out; add what acts during it to the dead", stacklevel=2)
        phases = _phases(settlement)
        increments = settlement_increments(phases=phases, controls=controls, changes=changes, **vars(self))
        measures = {"parameter": settlement_in(phases[0].unit), "measured": reaction_to(phases[0].unit)}
        return self._response(increments, on_increment, settlements=phases, changes=tuple(changes), **measures)

    def pushover(
        self,
        control: ControlDisplacement,
        *,
        controls: Controls | None = None,
        pose: Pose | None = None,
        ties_at: TieForces | None = None,
        bonds_at: Bonds | None = None,
        fallen: np.ndarray | None = None,
        on_increment: Callable[[Increment], None] | None = None,
    ) -> Response:
        """Follow the structure under growing displacement from its limit load down to where it carries none.

        Fixed and moving supports both stand still. The path is that of a settlement, with the multiplier as one more
        unknown and the control displacement as one more equation.

        Parameters
        ----------
        control : ControlDisplacement
        controls : Controls, optional
        pose : Pose, optional
            Where to start, for instance after a settlement; the drawing by default. Displacements count from there.
        ties_at, bonds_at, fallen
            ``ties``, ``bonds`` and ``fallen`` of the increment that the pose is from, as in :meth:`limit_load`: without
            its bonds a pose with cohesion or elastic joints is refused. By default ties are new, none of a later phase.
        on_increment : callable, optional
            Called with every :class:`Increment` as it is found.

        Returns
        -------
        Response
            ``settlement`` is the control displacement [m], ``load_multiplier`` is α and ``reaction`` the resultant of
            the live loads, α times its value at 1 [N]. The first increment has the non-associative limit load of the
            undeformed structure. The collapse is where α reaches zero, ``lost`` "capacity": beyond, the structure falls
            under its dead load alone; or where no equilibrium follows along the control, ``lost`` "equilibrium".

        Raises
        ------
        ValueError
            For input that cannot be analysed: no live load, a control block that is a support, overlapping blocks.
        """
        given = vars(self) | _standing(pose, ties_at, bonds_at, fallen)
        increments = pushover_increments(control=control, controls=controls, **given)
        kind = {"analysis": "pushover", "parameter": CONTROL_DISPLACEMENT, "measured": LOAD_MULTIPLIER}
        return self._response(increments, on_increment, settlements=(), control=control, **kind)

    def limit_load(
        self,
        *,
        acceleration: Sequence[float] | None = None,
        pose: Pose | None = None,
        flow: str = "associative",
        closed_gap: float | None = None,
        displacement: float = 0.0,
        overlap_tolerance: float | None = None,
        torsion: str = "points",
        ties_at: TieForces | None = None,
        bonds_at: Bonds | None = None,
        fallen: np.ndarray | None = None,
    ) -> LimitLoad:
        """Find the largest multiplier of the live loads at which the structure can be in equilibrium.

        Fixed and moving supports both stand still.

        Parameters
        ----------
        acceleration : (d,) sequence, optional
            Instead of the live loads of the structure: of every block and the fill over it, in units of gravity; the
            multiplier is then the acceleration. Other dead loads have no mass, see :meth:`with_live`. For the other
            direction give minus this one.
        pose : Pose, optional
            The geometry: that of an increment gives the capacity left after a settlement, with its ``ties``, ``bonds``
            and ``fallen``. The drawing by default.
        flow : {"associative", "non-associative"}
            Whether sliding joints lift by friction coefficient times slip, or do not lift.
        closed_gap : float, optional [m]
            Contact points with a larger gap are open and carry nothing. By default a thousandth of the width of the
            thinnest block in the drawing, a millionth of the block size at a given pose.
        displacement : float [m]
            How far the live loads may move along themselves, on average, while joints close. 0: what is open carries
            nothing. A wall of many bricks whose joints slide has openings of hundredths of a millimetre after a
            settlement, and its strict limit load is that of the one loosest brick.
        overlap_tolerance : float, optional [m]
            Overlap of two blocks in the drawing that is accepted; a thousandth of the width of the thinnest block.
        torsion : {"points", "uniform"}
            What a face of blocks in space resists when it turns in its own plane: what friction at its contact
            points does, or no more than under a uniform pressure, which is up to 1.85 times less.
        ties_at : TieForces, optional
            ``ties`` of the increment that the pose is from, which tell what is broken, and what is slack and by how
            much: that carries as an open joint does. By default all, none of a later phase, carry up to their strength.
        bonds_at : Bonds, optional
            ``bonds`` of that increment: the strength that joints have left, by default all of it in closed ones; and
            where elastic joints have no force, without which a pose with such joints is refused.
        fallen : (n_blocks,) bool array, optional
            ``fallen`` of that increment: blocks that have left the structure, which all are a part of by default.

        Returns
        -------
        LimitLoad

        Raises
        ------
        ValueError
            For no free block, overlapping blocks, no live load on a free block, a law of torsion that is not known or
            that blocks in the plane, or faces that are not convex, do not have.
        SolveError
            If no solution of the programs passes its check.

        Notes
        -----
        The program, its dual, strength, gaps, torsion and friction without dilatancy are described with
        :func:`solver.analysis.limit_load.find_limit_load`. For associative flow the multiplier is the exact limit load
        of the model, and an upper bound for every other flow rule with the same friction.
        """
        under = self if acceleration is None else self.with_live(acceleration=acceleration)
        given = vars(under) | _standing(pose, ties_at, bonds_at, fallen) | {"flow": flow, "torsion": torsion}
        given |= {"closed_gap": closed_gap, "displacement": displacement, "overlap_tolerance": overlap_tolerance}
        found = find_limit_load(**given)
        return replace(found, analysed=(self.assembly, self.interfaces, under.loads, self.ties))

    def envelope(
        self,
        positions: Sequence[float] | np.ndarray,
        live: Callable[[float], np.ndarray | PointForces],
        *,
        pose: Pose | None = None,
        flow: str = "associative",
        torsion: str = "points",
        ties_at: TieForces | None = None,
        bonds_at: Bonds | None = None,
        fallen: np.ndarray | None = None,
    ) -> Envelope:
        """Limit loads of a live load that moves over the structure.

        Parameters
        ----------
        positions : (n,) sequence
        live : callable
            From a position to the live loads there, an (n_blocks, n_dof) array [N, N·m] or forces at points.
        pose, flow, torsion, ties_at, bonds_at, fallen
            As in :meth:`limit_load`.
        """
        positions = numbers_of(positions, "positions")
        if positions.ndim != 1 or len(positions) == 0:
            raise ValueError(f"positions have shape {positions.shape}; give at least one number")
        given: Any = {"pose": pose, "ties_at": ties_at, "bonds_at": bonds_at, "fallen": fallen, "flow": flow}
        limits = (self.with_live(live(float(x))).limit_load(torsion=torsion, **given) for x in positions)
        return Envelope(positions, tuple(limits))

    def _response(
        self, increments: Increments, on_increment: Callable[[Increment], None] | None, **analysed: Any
    ) -> Response:
        """Find all increments; a response has the fields of the structure, and those of how they ended."""
        found = increments.all(on_increment)
        return Response(increments=found, **vars(self), **vars(increments.ending), **analysed)


def _laws(
    interfaces: Interfaces | None, friction: Any, usual: float | None = InterfaceLaw.friction_coefficient
) -> Interfaces:
    """Return the laws of all interfaces, given as such or by a friction coefficient; warns of one that is an angle."""
    if (interfaces is None and friction is usual is None) or (interfaces is not None and friction != usual):
        raise TypeError("a structure needs either a friction_coefficient or interfaces; give one of them")
    if interfaces is None:
        interfaces = Interfaces(InterfaceLaw(friction))
        if note := steep_note(interfaces.default.friction_coefficient):
            warnings.warn(note, stacklevel=3)
    if not isinstance(interfaces, Interfaces):
        raise TypeError(f"interfaces are {interfaces!r}; give solver.Interfaces, or friction_coefficient by its name")
    return interfaces


def _standing(
    pose: Pose | None, ties_at: TieForces | None, bonds_at: Bonds | None, fallen: np.ndarray | None
) -> dict[str, Any]:
    """Arguments of an analysis that begins at an increment, which these tell of."""
    ties_at = ties_at if ties_at is None else checked(ties_at, TieForces, "ties_at")
    bonds_at = bonds_at if bonds_at is None else checked(bonds_at, Bonds, "bonds_at")
    return {"pose": pose, "ties_at": ties_at, "bonds_at": bonds_at, "fallen": fallen}


def _phases(settlement: Settlement | Sequence[Settlement] | Sequence[float] | np.ndarray) -> tuple[Settlement, ...]:
    parts: Any = settlement if isinstance(settlement, Sequence | np.ndarray) else (settlement,)
    if len(parts) and not any(isinstance(part, Settlement) for part in parts):
        return (Settlement(direction=parts),)
    return tuple(checked(part, Settlement, "one of the settlements") for part in parts)


def settle(
    assembly: Assembly,
    settlement: Settlement | Sequence[Settlement] | Sequence[float] | np.ndarray,
    *,
    friction_coefficient: float = InterfaceLaw.friction_coefficient,
    interfaces: Interfaces | None = None,
    loads: Loads | None = None,
    **options: Any,
) -> Response:
    """Follow blocks through a settlement to collapse: :meth:`Structure.settle`, with its options, in one call.

    The friction coefficient is of every interface; another than 0.6 beside ``interfaces`` is refused.
    """
    return Structure(assembly, _laws(interfaces, friction_coefficient), loads).settle(settlement, **options)


def pushover(
    assembly: Assembly,
    control: ControlDisplacement,
    *,
    loads: Loads | None = None,
    friction_coefficient: float = InterfaceLaw.friction_coefficient,
    interfaces: Interfaces | None = None,
    **options: Any,
) -> Response:
    """Follow blocks under growing displacement: :meth:`Structure.pushover`, with its options, in one call."""
    return Structure(assembly, _laws(interfaces, friction_coefficient), loads).pushover(control, **options)


def limit_load(
    assembly: Assembly,
    *,
    loads: Loads | None = None,
    friction_coefficient: float = InterfaceLaw.friction_coefficient,
    interfaces: Interfaces | None = None,
    **options: Any,
) -> LimitLoad:
    """Find the largest multiplier of live loads: :meth:`Structure.limit_load`, with its options, in one call."""
    return Structure(assembly, _laws(interfaces, friction_coefficient), loads).limit_load(**options)
