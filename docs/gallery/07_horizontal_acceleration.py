"""
Wall under a horizontal acceleration
====================================

The acceleration, as a fraction α of gravity, at which a wall with a window fails. Associative friction, in which
sliding joints lift, gives both bounds; without lift the wall carries less.
"""

from dataclasses import replace

import blockvis
import solver
from blockvis import generators

wall = generators.wall(
    bricks=6, courses=12, openings=[{"x": 0.5, "y": 0.3, "width": 0.5, "height": 0.5, "head": "lintel"}]
)
loads = replace(solver.self_weight(wall), live=solver.weight_fraction(wall, (1.0, 0.0)))
lifting = solver.limit_load(wall, loads=loads, friction_coefficient=0.6)
sliding = solver.limit_load(wall, loads=loads, friction_coefficient=0.6, flow="non-associative")
print(lifting)
print(sliding)
assert abs(lifting.multiplier - 0.510) < 0.001
assert abs(lifting.gap) < 1e-6
assert sliding.multiplier <= lifting.multiplier + 1e-9

# %%
# How it fails.
interfaces = solver.Interfaces(solver.InterfaceLaw(friction_coefficient=0.6))
response = solver.Response(
    wall,
    settlements=(),
    interfaces=interfaces,
    loads=loads,
    increments=(lifting.increment,),
    stop=solver.Status.LIMIT_REACHED,
    analysis="limit load",
    limits=(lifting,),
    parameter=solver.LOAD_POSITION,
    measured=solver.LOAD_MULTIPLIER,
)
blockvis.draw_mechanism(response, "wall.png")
