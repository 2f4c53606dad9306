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

from .assembly import Assembly
from .backfill import Backfill
from .interfaces import InterfaceLaw, Interfaces, JointScatter
from .kinematics import Pose
from .loads import GRAVITY, Loads, Settlement, point_load, self_weight, weight_fraction
from .path.controls import Controls
from .path.drivers import ControlDisplacement
from .phases import PhaseChange
from .programs.problem import SolveError
from .results.certificate import Certificate
from .results.increment import Increment, Status
from .results.response import Collapse, Envelope, LimitLoad, LimitStatus, LocalLoss, Response
from .structure import Structure, limit_load, pushover, settle
from .surface_loads import edge_pressure, load_on_top, surface_pressure
from .ties import Tie

__all__ = [
    "GRAVITY",
    "Assembly",
    "Backfill",
    "Certificate",
    "Collapse",
    "ControlDisplacement",
    "Controls",
    "Envelope",
    "Increment",
    "InterfaceLaw",
    "Interfaces",
    "JointScatter",
    "LimitLoad",
    "LimitStatus",
    "Loads",
    "LocalLoss",
    "PhaseChange",
    "Pose",
    "Response",
    "Settlement",
    "SolveError",
    "Status",
    "Structure",
    "Tie",
    "edge_pressure",
    "limit_load",
    "load_on_top",
    "point_load",
    "pushover",
    "self_weight",
    "settle",
    "surface_pressure",
    "weight_fraction",
]
