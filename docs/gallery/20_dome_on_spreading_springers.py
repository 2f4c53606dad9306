"""
Dome on spreading springers
===========================

The springers of a dome of eight lunes move away from its axis. Cracks open along the meridians, every lune becomes an
arch that leans on the others through the cap, and the dome falls when they have gone out by 0.17213 radii, the value of
one lune in the plane.
"""

import blockvis
import solver

dome = blockvis.generators.dome(lunes=8, courses=6, thickness_ratio=0.12, cap=15.0)
spread = solver.Settlement(radial_from=(0, 0), increment=0.04, limit=0.5, tolerance=1e-4)
response = solver.Structure(dome, friction_coefficient=0.7).settle(spread)
print(response.collapse)
assert abs(response.initial_reaction / response.total_weight - 0.1661226) < 1e-6
assert abs(response.collapse.displacement - 0.1721334) < 1e-4

# %%
# The mechanism at the last equilibrium: hinges are lines, those behind other stones are dashed.
blockvis.draw_mechanism(response, "mechanism.png")
