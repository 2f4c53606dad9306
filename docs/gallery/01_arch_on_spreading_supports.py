"""
Arch on spreading supports
==========================

A semicircular arch of twelve voussoirs hinges at five joints as its right springer moves out, and falls at 0.14105
radii: exact three-hinge kinematics give 0.14104982.
"""

import blockvis
import solver

arch = blockvis.generators.arch(radius=1.0, thickness_ratio=0.15, embrace=180.0, voussoirs=12)
spread = solver.Settlement(direction=(1, 0), increment=0.01, limit=0.5, tolerance=1e-5)
response = solver.Structure(arch, friction_coefficient=2.0).settle(spread)  # no sliding: the arch hinges only
print(response.collapse)
assert abs(response.collapse.displacement - 0.14104982) < 1e-4

# %%
# The last state in equilibrium, with the hinges through which it falls.
blockvis.draw_mechanism(response, "mechanism.png")

# %%
# The thrust grows on the way, as the line of thrust gets flatter.
print(response.reaction[[0, -1]] / response.total_weight)
blockvis.draw_curve(response, "curve.png")
