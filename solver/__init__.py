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

from .analysis.increments import Increments
from .analysis.pushover import pushover_increments
from .analysis.settlement import check_settlement, settlement_increments
from .assembly import FIXED, FREE, MOVING, ROLES, Assembly, find_contacts, measure_contacts
from .equilibrium import block_forces
from .geometry.contacts import Contacts
from .geometry.outlines import overlap_depths
from .geometry.planar_contacts import corners_and_edges, features_of
from .geometry.polygons import Polygons
from .geometry.polyhedra import Polyhedra
from .geometry.shapes import Shapes
from .interfaces import InterfaceLaw, Interfaces, JointScatter
from .kinematics import Pose, carried, carried_between, motion_size, moved_vertices, point_velocities, swung, turned
from .loads import GRAVITY, Loads, Settlement, point_load, self_weight, weight_fraction
from .path.controls import INCREMENTS, Controls, Ending
from .path.drivers import ControlDisplacement
from .path.state import PathState
from .programs.problem import SolveError
from .results.certificate import Certificate, worst_of
from .results.increment import ContactState, Increment, State, Status, StoredState
from .results.mechanism import Mechanism, mechanism_of, rigid_parts, with_motion
from .results.quantities import (
    CONTROL_DISPLACEMENT,
    LOAD_MULTIPLIER,
    LOAD_POSITION,
    REACTION,
    SETTLEMENT,
    Quantity,
    reaction_to,
    settlement_in,
)
from .results.response import (
    Collapse,
    Control,
    Envelope,
    LimitLoad,
    LimitStatus,
    LocalLoss,
    Response,
    path_parameters,
    total_weight,
)
from .structure import Structure, limit_load, pushover, settle
from .surface_loads import edge_pressure, load_on_top, surface_pressure

__all__ = [
    "CONTROL_DISPLACEMENT",
    "FIXED",
    "FREE",
    "GRAVITY",
    "INCREMENTS",
    "LOAD_MULTIPLIER",
    "LOAD_POSITION",
    "MOVING",
    "REACTION",
    "ROLES",
    "SETTLEMENT",
    "Assembly",
    "Certificate",
    "Collapse",
    "ContactState",
    "Contacts",
    "Control",
    "ControlDisplacement",
    "Controls",
    "Ending",
    "Envelope",
    "Increment",
    "Increments",
    "InterfaceLaw",
    "Interfaces",
    "JointScatter",
    "LimitLoad",
    "LimitStatus",
    "Loads",
    "LocalLoss",
    "Mechanism",
    "PathState",
    "Polygons",
    "Polyhedra",
    "Pose",
    "Quantity",
    "Response",
    "Settlement",
    "Shapes",
    "SolveError",
    "State",
    "Status",
    "StoredState",
    "Structure",
    "block_forces",
    "carried",
    "carried_between",
    "check_settlement",
    "corners_and_edges",
    "edge_pressure",
    "features_of",
    "find_contacts",
    "limit_load",
    "load_on_top",
    "measure_contacts",
    "mechanism_of",
    "motion_size",
    "moved_vertices",
    "overlap_depths",
    "path_parameters",
    "point_load",
    "point_velocities",
    "pushover",
    "pushover_increments",
    "reaction_to",
    "rigid_parts",
    "self_weight",
    "settle",
    "settlement_in",
    "settlement_increments",
    "surface_pressure",
    "swung",
    "total_weight",
    "turned",
    "weight_fraction",
    "with_motion",
    "worst_of",
]
