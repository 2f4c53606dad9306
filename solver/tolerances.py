"""Tolerances of the mechanics, each with its reason.

Each group is relative to one measure, named in its heading, and runs from the finest to the coarsest. Three lengths
occur: the block size, the width of the thinnest block, and the shortest edge at a corner. Numbers of a numerical
method, such as its iterations, are in the module of the method.
"""

# Of the linear programs: absolute, in their own units, in which a block has size 1 and weighs about 1.

#: HiGHS' smallest feasibility tolerance, small against every force and gap of the scaled programs.
FEASIBILITY_TOLERANCE = 1e-10

#: Distance from the boundary of its friction cone at which a contact point is on it.
AT_LIMIT = 1e-9

#: Error of interior solutions of large programs; the smallest one costs a tenth more iterations.
INTERIOR_TOLERANCE = 1e-8

#: Violation of rows, bounds and reduced costs, and relative difference of the two objectives, that our own check of a
#: solution accepts.
ACCEPTED_ERROR = 1e-7

#: Violation of rows and cones by a ray of a conic program, its largest number 1, that is a proof.
RAY_BALANCE = 1e-8

# Of balance: fractions of the total load.

#: Unbalanced force of a block in balance, without which a program may move a frictionless block at no cost.
BALANCE_TOLERANCE = 1e-9

#: Unbalanced force from which on blocks fall, above BALANCE_TOLERANCE and the feasibility of programs.
FALLING_FRACTION = 5e-9

# Of forces along the path: fractions of a block's weight.

#: Load along the movement of the supports, above the errors of linearisation, by which symmetric structures leave their
#: unstable symmetric path.
IMPERFECTION = 1e-4

#: Viscous force on a block that moves as fast as the supports, beyond its earlier velocity: it makes motions unique,
#: and reported forces are without it.
VISCOSITY = 1e-2

# Of positions: fractions of the block size.

#: Elastic compliance of a joint under the mean block weight, normal and shear, which makes forces unique.
COMPLIANCE, SHEAR_COMPLIANCE = 1.5e-7, 5e-6

#: Movement of the supports over which friction bounds follow the normal forces.
FRICTION_MEMORY = 3e-3

#: Movement of the supports over which an earlier velocity decays.
VELOCITY_MEMORY = 1e-2

#: Gap and drift of contact points that carry force in an exact geometry.
GEOMETRY_TOLERANCE = 1e-8

#: Largest gap of a closed contact point at a computed pose: a hundred times the accuracy of the geometry.
COMPUTED_GAP = 1e-6

#: Largest gap of a contact point that may carry along the path, where the viscosity retards joints that close.
CLOSING_GAP = 1e-5

#: Largest gap of a hinge or a sliding joint in a mechanism, whose joints have begun to open.
CLOSED = 1e-3

#: Movement to an equilibrium that is reported as a jump.
JUMP = 0.02

#: Largest movement to an equilibrium of the same path.
FARTHEST_FALL = 0.5

# Of drawings: fractions of the width of the thinnest block, 2 A / P.

#: Gap and overlap that are accepted in a drawing.
DRAWN_GAP = 1e-3

#: Overlap of two blocks at which an increment is refused, twice that of a drawing.
OVERLAP = 2e-3

#: Largest penetration of a contact point; a deeper corner belongs to another face.
PENETRATION_FRACTION = 0.1

# Of corners: fractions of the shortest edge that meets there.

#: Distance from the end of an edge at which a corner is on the corner there: the error of drawings.
CORNER_TOLERANCE = 1e-5

# Of forces: fractions of the largest normal force.

#: Normal force from which on a contact point carries.
SMALLEST_FORCE = 1e-9

#: Normal force from which on the gap of a contact point counts.
CARRYING_FRACTION = 1e-6

#: Distance of the shear force from its friction bound, as a fraction of it, at which the bound is reached.
USED_UP = 1e-6

# Of motions: fractions of the movement of the fastest block.

#: Relative velocity from which on a contact point opens or slips.
SMALLEST_RATE = 1e-6

#: Velocity from which on blocks and joints count as moving, and blocks as parts of their own.
NOTICEABLE = 1e-2

#: Opening of a sliding point beyond friction times slip, as a fraction of it.
DILATANCY_SLACK = 1e-2
