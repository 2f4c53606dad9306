"""
Portal with a settling foot
===========================

A lintel on two columns of blocks; the right foot sinks. At rest, as drawn, each column carries half of the
lintel, by symmetry; then the lintel tilts about its bearings until it slides off.
"""

import blockvis
import solver

portal = blockvis.generators.portal(span=2.0, height=2.4, column_width=0.5, column_blocks=4, lintel_height=0.5)
sink = solver.Settlement(direction=(0, -1), increment=0.05, limit=0.6)
response = solver.Structure(portal, friction_coefficient=0.6).settle(sink)
print(response)
print(f"reaction at rest {response.reaction[0]:.0f} N of {response.total_weight:.0f} N")
assert response.stop is solver.Status.LIMIT_REACHED
assert abs(response.reaction[0] / response.total_weight - 0.5) < 1e-6

# %%
# Forces at the contact points, and what each joint does, after 0.3 m and after 0.6 m.
blockvis.draw_still(response, 6, "after_300_mm.png")
blockvis.draw_still(response, -1, "after_600_mm.png")
