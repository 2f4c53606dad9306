"""
Corner of two walls
===================

The ground under one leg of an L-shaped corner sinks. Bricks that take turns in the corner hang on the other leg by
friction until the joints between them open: no section of this is plane.
"""

import blockvis
import solver

corner = blockvis.generators.l_corner(bricks=2, across=2, courses=4)
sink = solver.Settlement(direction=(0, 0, -1), increment=0.02, limit=0.06)
response = solver.Structure(corner, friction_coefficient=0.6).settle(sink)
print(response)
assert response.stop is solver.Status.LIMIT_REACHED
for increment in response.path:
    print(f"{increment.parameter:.2f} m  {increment.reaction / response.total_weight:.3f} W")
assert abs(response.initial_reaction / response.total_weight - 0.164516) < 1e-5

blockvis.draw_still(response, -1, "corner.png")
