"""Mechanics of dry-jointed masonry: rigid blocks, no-tension frictional contact points, settling supports.

Conventions, written once:

- SI units: m, kg, s, N, rad. In the plane x to the right, y up, thickness out of plane; in space z up.
- Compression is positive. A gap is positive when open. Moments and rotations are counter-clockwise.
- The frame of a contact point: row 0 is the unit normal from ``block_b`` into ``block_a``, row 1 the tangent,
  a quarter turn counter-clockwise. Contact forces act on ``block_a``; on ``block_b`` with the opposite sign.
- A reaction is the force of the structure on the moving supports along their motion.
- The parameter s of a settlement is a distance [m], or for a pure rotation an angle [rad].

This package opens no file, prints nothing and draws nothing; ``blockvis`` does.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .assembly import Assembly as Assembly
    from .backfill import Backfill as Backfill
    from .interfaces import InterfaceLaw as InterfaceLaw
    from .interfaces import Interfaces as Interfaces
    from .interfaces import JointScatter as JointScatter
    from .kinematics import Pose as Pose
    from .loads import GRAVITY as GRAVITY
    from .loads import ControlDisplacement as ControlDisplacement
    from .loads import Loads as Loads
    from .loads import PointForces as PointForces
    from .loads import Settlement as Settlement
    from .loads import point_load as point_load
    from .loads import self_weight as self_weight
    from .loads import weight_fraction as weight_fraction
    from .path.controls import Controls as Controls
    from .phases import PhaseChange as PhaseChange
    from .programs.problem import SolveError as SolveError
    from .results.certificate import Certificate as Certificate
    from .results.increment import Increment as Increment
    from .results.increment import Status as Status
    from .results.response import Collapse as Collapse
    from .results.response import Envelope as Envelope
    from .results.response import LimitLoad as LimitLoad
    from .results.response import LimitStatus as LimitStatus
    from .results.response import LocalLoss as LocalLoss
    from .results.response import Response as Response
    from .structure import Structure as Structure
    from .structure import limit_load as limit_load
    from .structure import pushover as pushover
    from .structure import settle as settle
    from .surface_loads import edge_force as edge_force
    from .surface_loads import edge_pressure as edge_pressure
    from .surface_loads import force_on_top as force_on_top
    from .surface_loads import load_on_top as load_on_top
    from .surface_loads import surface_forces as surface_forces
    from .surface_loads import surface_pressure as surface_pressure
    from .ties import Tie as Tie

#: Modules and their public names; loaded when first used, because scipy takes half a second to import.
_NAMES = {
    "assembly": "Assembly",
    "backfill": "Backfill",
    "interfaces": "InterfaceLaw Interfaces JointScatter",
    "kinematics": "Pose",
    "loads": "GRAVITY ControlDisplacement Loads PointForces Settlement point_load self_weight weight_fraction",
    "path.controls": "Controls",
    "phases": "PhaseChange",
    "programs.problem": "SolveError",
    "results.certificate": "Certificate",
    "results.increment": "Increment Status",
    "results.response": "Collapse Envelope LimitLoad LimitStatus LocalLoss Response",
    "structure": "Structure limit_load pushover settle",
    "surface_loads": "edge_force edge_pressure force_on_top load_on_top surface_forces surface_pressure",
    "ties": "Tie",
}
_HOMES = {name: module for module, names in _NAMES.items() for name in names.split()}

__all__ = sorted(_HOMES)


def __getattr__(name: str) -> Any:
    if name in _HOMES:
        # Kept, so that it is looked up once.
        globals()[name] = found = getattr(import_module(f".{_HOMES[name]}", __name__), name)
        return found
    raise AttributeError(f"module 'solver' has no attribute '{name}'")


def __dir__() -> list[str]:
    return [*__all__, *(name for name in globals() if name.startswith("__"))]
