"""Tolerances of the mechanics: what counts as nothing, as equal, as closed, each with its reason.

Each group is relative to one measure, named in its heading, and runs from the finest to the coarsest. Three lengths
occur: the block size, the width of the thinnest block, and the shortest edge at a corner. How long a method goes on
(iterations, steps, parts of steps) is no tolerance and stands with the method; so do the constants of the interior
method for bands, which are of the method, not of masonry.
"""

# Of the linear programs: absolute, in their own units, in which a block has size 1 and weighs about 1.

#: HiGHS' smallest feasibility tolerance; the programs are scaled so that it is small against every force.
FEASIBILITY_TOLERANCE = 1e-10

#: Distance from the edge of the friction cone at which a contact point is on it.
AT_LIMIT = 1e-9

#: Feasibility of interior solutions of large programs: a tenth of the iterations less than the smallest, and far below
#: what a certificate promises.
INTERIOR_TOLERANCE = 1e-8

#: What our own check of a solution accepts: violation of rows, bounds and reduced costs.
ACCEPTED_VIOLATION = 1e-7

#: Relative difference of the two objectives that our own check accepts.
ACCEPTED_GAP = 1e-7

#: A ray of a conic program, its largest number 1, proves something where its rows and cones are met to this: interior
#: methods find no more.
RAY_BALANCE = 1e-8

# Of balance: fractions of the total load.

#: A free block out of balance by less than this is in balance. Without it the program may move a block without friction
#: sideways, for nothing, as far as it is allowed to.
BALANCE_TOLERANCE = 1e-9

#: Unbalanced force that counts as falling: well above BALANCE_TOLERANCE and what HiGHS leaves, and within the residual
#: that a certificate promises.
FALLING_FRACTION = 5e-9

# Of forces along the path: fractions of a block's weight.

#: A load along the movement of the supports: symmetric structures leave their unstable, symmetric path by it and not by
#: what linearised geometry leaves, which is more than 1e-5: the keystone of the wall with an arch in ``examples`` would
#: slip to the left or to the right by chance. Where a collapse is enclosed it is less by as much as the viscosity.
IMPERFECTION = 1e-4

#: Viscosity: what resists a block that moves as fast as the supports, beyond the velocity it had. It makes the motion
#: of a wall unique; forces are reported without it.
VISCOSITY = 1e-2

# Of positions: fractions of the block size.

#: Elastic compliance of a joint under the mean block weight, across it and along it: what makes forces unique and gives
#: them a memory. It is taken back in the next program, so that it stays out of the geometry.
COMPLIANCE, SHEAR_COMPLIANCE = 1.5e-7, 5e-6

#: Movement of the supports over which friction bounds follow the normal forces.
FRICTION_MEMORY = 3e-3

#: Movement of the supports over which the viscosity forgets a velocity.
VELOCITY_MEMORY = 1e-2

#: A geometry is exact when contact points that carry force are closed, and those that stick have not moved along the
#: joint, to this.
GEOMETRY_TOLERANCE = 1e-8

#: Largest gap of a closed contact point at a computed pose: a hundred times the accuracy of the geometry.
COMPUTED_GAP = 1e-6

#: Largest gap of a contact point that may carry in an equilibrium along the path: blocks that close a joint slowly are
#: held back by the viscosity until then.
CLOSING_GAP = 1e-5

#: Gap up to which a joint can be a hinge or slide in a mechanism: after a fall has begun nothing is quite closed.
CLOSED = 1e-3

#: Movement to the equilibrium of a place that looks like a fall.
JUMP = 0.02

#: Farthest that blocks may fall to an equilibrium that belongs to the same path.
FARTHEST_FALL = 0.5

# Of drawings: fractions of the width of the thinnest block, 2 A / P.

#: Gap and overlap that are accepted of a drawing.
DRAWN_GAP = 1e-3

#: Overlap of two blocks at which an increment is refused: twice what is accepted of a drawing.
OVERLAP = 2e-3

#: Penetration up to this is a contact to be corrected; beyond, the corner belongs to another face behind.
PENETRATION_FRACTION = 0.1

# Of corners: fractions of the shortest edge that meets there.

#: A corner this close to the end of an edge stands on the corner there. Steps take drift along a hinge back, so that it
#: need not cover the error of an increment, only of drawings; shorter bearings are ignored.
CORNER_TOLERANCE = 1e-5

# Of forces: fractions of the largest normal force.

#: From here on a contact point carries force.
SMALLEST_FORCE = 1e-9

#: Contact points below this do not decide whether a geometry is exact, nor what is wedged.
CARRYING_FRACTION = 1e-6

#: Shear force short of all that friction allows, as a fraction of it, that still counts as all.
USED_UP = 1e-6

# Of motions: fractions of the movement of the fastest block.

#: A contact point opens or slips where its relative velocity exceeds this.
SMALLEST_RATE = 1e-6

#: Blocks whose contact points move apart by less than this belong together.
TOGETHER = 1e-3

#: What moves slower than this is not seen moving: it counts for no hinge, no sliding joint and no moving part.
NOTICEABLE = 1e-2

#: Lift of a sliding point beyond friction times slip, as a fraction of it, that still counts as sliding.
DILATANCY_SLACK = 1e-2
