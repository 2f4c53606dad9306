"""Tolerances of the mechanics: what counts as nothing, as equal, as closed, each with its reason.

Each group is relative to one measure, named in its heading, and runs from the finest to the coarsest. Three lengths
occur: the block size, the width of the thinnest block, and the shortest edge at a corner. How long a method goes on
(iterations, steps, parts of steps) is no tolerance and stands with the method; so do the constants of the interior
method for bands, which are of the method, not of masonry.
"""

# Of the linear programs: absolute, in their own units, in which a block has size 1 and weighs about 1.

#: HiGHS' smallest feasibility tolerance; the programs are scaled so that it is small against every force.
FEASIBILITY_TOLERANCE = 1e-10

#: Penetration and drift below this are rounding: a wedge that friction locks could not give way to them.
ROUNDING = 1e-10

#: Distance from the edge of the friction cone at which a contact point is on it.
AT_LIMIT = 1e-9

#: Feasibility of interior solutions of large programs: a tenth of the iterations less than the smallest, and far below
#: what a certificate promises.
INTERIOR_TOLERANCE = 1e-8

#: Where a program has no solution, penetration and drift below this are left as they are: blocks wedged against each
#: other cannot give way, and drawings and corrections are off by as much.
LEFT_WEDGED = 1e-7

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

#: Blocks whose weight times size is below this are seen badly, or not at all, beside BALANCE_TOLERANCE: a program of
#: their own has to see to their balance.
LIGHTEST = 2e-8

# Of light blocks, whose rows are written in their own weight and size.

#: Where a light block carries more than its weight, part of what it carries that is left of double precision.
ROUNDED_OFF = 1e-5

#: Balance of a light block, of its own weight.
LIGHT_BALANCE = 1e-3

# Of forces along the path: fractions of a block's weight.

#: A load along the movement of the supports: symmetric structures leave their unstable, symmetric path by it and not by
#: what linearised geometry leaves, which is more than 1e-5: the keystone of the wall with an arch in ``examples`` would
#: slip to the left or to the right by chance. Where a collapse is enclosed, with less drag, it is a thousandth of it.
IMPERFECTION = 1e-4

#: Drag: what resists a block that moves as fast as the supports. It makes the motion of a wall unique: of several
#: mechanisms that would do, the one that moves least weight. Forces are reported without it. With a tenth of it the
#: give of the joints chooses between the hinges of the portal in ``examples``, and reactions of the walls there under
#: their own weight and a load are up to 1.3 % apart, and the wall with an arch falls at 0.248 m for 0.310; with ten
#: times as much reactions are up to 4 % apart.
DRAG = 1e-2

#: Movement of the supports, in block sizes, over which what moves on as before comes to be held back no more by the
#: drag, which resists changes of the velocity only: about as long as the steps in which events are followed. With
#: none, the drag of a step would depend on its length, and with it which of several mechanisms is taken.
MEMORY = 1e-2

# Of positions: fractions of the block size.

#: Elastic give of a contact point under the mean block weight, across the joint and along it: what makes the forces of
#: a wall unique and gives them a memory. It is taken back within each step, so that it stays out of the geometry. Where
#: many joints may slide a wall has more than one path, and the second number has a say in which is taken: with a tenth
#: of it, reactions of the walls in ``examples`` under their own weight and a load are up to 1 % apart, and the wall
#: with an arch falls at 0.248 m for 0.310; with ten times as much reactions are up to 5 % apart.
GIVE_ACROSS, GIVE = 3e-7, 1e-5

#: Coordinates, added up and taken off again.
COORDINATE_ROUNDING = 1e-12

#: A geometry is exact when contact points that carry force are closed, and those that stick have not moved along the
#: joint, to this.
GEOMETRY_TOLERANCE = 1e-8

#: Penetration that may stay where friction keeps many points on the edge of sliding and corrections converge slowly, of
#: the smallest block; ten times as much in programs too large for vertex solutions.
PENETRATION_LEFT = 5e-7

#: Largest gap of a closed contact point at a computed pose: a hundred times the accuracy of the geometry.
COMPUTED_GAP = 1e-6

#: Largest gap of a contact point that may carry in an equilibrium along the path: blocks that close a joint slowly are
#: held back by the drag until then. Where a collapse is enclosed, with less drag, it is that of a computed pose.
CLOSING_GAP = 1e-5

#: A pose is an equilibrium when a program at rest moves no block by more than this: friction leaves a little freedom at
#: the edge of its cone, a structure that has to find another equilibrium moves much further.
STILL = 1e-5

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

#: A corner this close to the end of an edge stands on the corner there. Correctors take drift along a hinge back, so
#: that it need not cover the error of an increment, only of drawings; shorter bearings are ignored.
CORNER_TOLERANCE = 1e-5

#: Drift of a hinge within an increment before it is corrected: second order in the rotation, which an increment keeps
#: below a few hundredths.
LARGEST_DRIFT = 1e-2

# Of forces: fractions of the largest normal force.

#: From here on a contact point carries force.
SMALLEST_FORCE = 1e-9

#: Contact points below this do not decide whether a geometry is exact, nor what is wedged.
CARRYING_FRACTION = 1e-6

#: Contact points hold a piece that has fallen onto them from here on.
HOLDS = 1e-3

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
