"""Mechanics of dry-jointed masonry: rigid blocks, no-tension frictional contact points, settling supports.

Conventions, written once:

- SI units: m, kg, s, N, rad. Two dimensions, x to the right, y up; thickness out of plane.
- Compression is positive. A gap is positive when open. Moments and rotations are counter-clockwise.
- The frame of a contact point: row 0 is the unit normal from ``block_b`` into ``block_a``, row 1 the tangent,
  a quarter turn counter-clockwise. Contact forces act on ``block_a``; on ``block_b`` with the opposite sign.
- A reaction is the force of the structure on the moving supports along their motion.
- The parameter s of a settlement is a distance [m], or for a pure rotation an angle [rad].

This package opens no file, prints nothing and draws nothing; ``blockvis`` does.
"""

from .analysis import Controls, Ending, check_settlement, settle, settlement_increments
from .assembly import FIXED, FREE, MOVING, ROLES, Assembly
from .contact import Contacts, InterfaceLaw, Interfaces, find_contacts, measure_contacts
from .kinematics import Pose, moved_vertices
from .loads import GRAVITY, Loads, Settlement, point_load, self_weight, weight_fraction
from .lp import SolveError
from .mechanism import Mechanism, mechanism_of, rigid_parts
from .polygons import overlap_depths
from .response import Certificate, Collapse, ContactState, Increment, Response, Status, total_weight

__all__ = [
    "FIXED",
    "FREE",
    "GRAVITY",
    "MOVING",
    "ROLES",
    "Assembly",
    "Certificate",
    "Collapse",
    "ContactState",
    "Contacts",
    "Controls",
    "Ending",
    "Increment",
    "InterfaceLaw",
    "Interfaces",
    "Loads",
    "Mechanism",
    "Pose",
    "Response",
    "Settlement",
    "SolveError",
    "Status",
    "check_settlement",
    "find_contacts",
    "measure_contacts",
    "mechanism_of",
    "moved_vertices",
    "overlap_depths",
    "point_load",
    "rigid_parts",
    "self_weight",
    "settle",
    "settlement_increments",
    "total_weight",
    "weight_fraction",
]
