"""
Panel in running bond
=====================

How much of a brick panel hangs on the ground that begins to settle? The kinematics of the cracked wedge give 25/218
of its weight for this one, friction 0.3.
"""

import blockvis
import solver

panel = blockvis.generators.panel(nb=3, nc=4, x_s=3.0)
sink = solver.Settlement(direction=(0, -1), increment=0.02, limit=0.1)
response = solver.Structure(panel, friction_coefficient=0.3).settle(sink)
share = response.initial_reaction / response.total_weight
print(f"{share:.6f}, exactly {25 / 218:.6f}")
assert abs(share - 25 / 218) < 1e-6

# %%
# A staircase crack climbs from the edge of the ground that settles.
blockvis.draw_still(response, -1, "panel.png")
