"""What a package of files and pictures needs of the mechanics beside what users do: shapes, contacts, poses, words."""

from .analysis.increments import Increments
from .analysis.path_increments import check_settlement, model_of, pushover_increments, settlement_increments
from .assembly import FIXED, FREE, MOVING, ROLES, Shapes, find_contacts, unique_names
from .contact_step.minimise import minimise
from .contact_step.problem import ContactProblem
from .contact_step.stiffness import ContactRows
from .equilibrium import block_forces, wrench_matrix
from .geometry.contacts import Contacts, joined_contacts, matched_contacts
from .geometry.outlines import overlap_depths
from .geometry.polygons import Polygons, corners_and_edges
from .geometry.polyhedra import Polyhedra
from .geometry.portions import linked
from .interfaces import steep_note
from .kinematics import (
    carried,
    cross_rows,
    motion_size,
    moved,
    moved_vertices,
    point_velocities,
    rotation_matrices,
    turned,
    turned_moments,
)
from .path.controls import COULOMB, LINEAR_PROGRAM, Ending
from .path.reports import falling_blocks
from .path.state import PathState, Place
from .path.stepping import NotSolved, Stepper
from .results.certificate import worst_of
from .results.increment import Bonds, ContactState, State, StoredState
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
from .results.response import lowest, path_parameters, total_weight
from .ties import (
    ABSENT,
    BAR,
    BROKEN,
    ELASTIC,
    PROP,
    SLACK,
    TIE,
    YIELDING,
    TieForces,
    is_member,
    member_contacts,
    member_forces,
    member_states,
    present_members,
    tie_ends,
    tie_lengths,
)
from .ties import KINDS as TIE_KINDS
from .words import counted

# Type checkers take no names from a typed package but those that it lists.
__all__ = [
    "ABSENT", "BAR", "BROKEN", "CONTROL_DISPLACEMENT", "COULOMB", "ELASTIC", "FIXED", "FREE", "LINEAR_PROGRAM",
    "LOAD_MULTIPLIER", "LOAD_POSITION", "MOVING", "PROP", "REACTION", "ROLES", "SETTLEMENT", "SLACK", "TIE",
    "TIE_KINDS", "YIELDING", "Bonds", "ContactProblem", "ContactRows", "ContactState", "Contacts", "Ending",
    "Increments", "Mechanism", "NotSolved", "PathState", "Place", "Polygons", "Polyhedra", "Quantity", "Shapes",
    "State", "Stepper", "StoredState", "TieForces", "block_forces", "carried", "check_settlement", "corners_and_edges",
    "counted", "cross_rows", "falling_blocks", "find_contacts", "is_member", "joined_contacts", "linked", "lowest",
    "matched_contacts", "mechanism_of", "member_contacts", "member_forces", "member_states", "minimise", "model_of",
    "motion_size", "moved", "moved_vertices", "overlap_depths", "path_parameters", "point_velocities",
    "present_members", "pushover_increments", "reaction_to", "rigid_parts", "rotation_matrices", "settlement_in",
    "settlement_increments", "steep_note", "tie_ends", "tie_lengths", "total_weight", "turned",
    "turned_moments", "unique_names", "with_motion", "worst_of", "wrench_matrix"
]  # fmt: skip
