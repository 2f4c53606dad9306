"""
Wall under a horizontal acceleration
====================================

The acceleration, as a fraction α of gravity, at which a wall with a window fails. Associative friction, in which
sliding joints lift, gives both bounds; without lift the wall carries less.
"""

import blockvis
import solver

wall = blockvis.generators.wall(
    bricks=6, courses=12, openings=[{"x": 0.5, "y": 0.3, "width": 0.5, "height": 0.5, "head": "lintel"}]
)
structure = solver.Structure(wall, friction_coefficient=0.6)
lifting = structure.limit_load(acceleration=(1, 0))
sliding = structure.limit_load(acceleration=(1, 0), flow="non-associative")
print(lifting)
print(sliding)
assert abs(lifting.multiplier - 0.510) < 0.001
assert abs(lifting.gap) < 1e-6
assert sliding.multiplier <= lifting.multiplier + 1e-9

# %%
# How it fails.
blockvis.draw_mechanism(lifting, "wall.png")
