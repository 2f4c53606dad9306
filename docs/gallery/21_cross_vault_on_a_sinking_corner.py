"""
Cross vault on a sinking corner
===============================

One of the four supports of a cross vault sinks by 90 mm: joints open between the stones of the crown and those on the
groins, and at the springer that sinks. Stones on the groins reach into both barrels; they are not convex and are cut
for contact only.
"""

import blockvis
import solver

vault = blockvis.generators.cross_vault(span=4.0, rise=1.5, thickness=0.3, voussoirs=7, stone=1.4)
sink = solver.Settlement(direction=(0, 0, -1), increment=0.03, limit=0.09)
response = solver.Structure(vault, friction_coefficient=0.7).settle(sink)
print(response)
assert response.stop is solver.Status.LIMIT_REACHED
assert response.path[-1].certificate.equilibrium_residual < 1e-8

# %%
# At rest each corner carries a quarter. As one begins to sink it keeps what equilibrium allows at the least.
rest, last = response.reaction[[0, -1]] / response.total_weight
first = response.initial_reaction / response.total_weight
print(f"reaction {rest:.3f} W at rest, at least {first:.3f} W as it begins to sink, {last:.3f} W in the end")
assert abs(rest - 0.25) < 1e-4
assert 0.12 < first < 0.125

blockvis.draw_still(response, -1, "vault.png")
