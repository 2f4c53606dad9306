"""
Arch on a sinking support
=========================

The right springer of a segmental arch sinks. Supports may go along any direction; a mechanism of four macro-blocks
ends it at 0.35255 radii.
"""

import blockvis
import solver

arch = blockvis.generators.arch(thickness_ratio=0.10, embrace=140.0, voussoirs=12)
response = solver.Structure(arch, friction_coefficient=2.0).settle((0, -1))
print(response.collapse)
assert abs(response.collapse.displacement - 0.35254631) < 1e-3

# %%
# Hinges on the way: the thrust touches the edge of the arch where a joint turns.
blockvis.draw_still(response, len(response.path) // 2, "half_way.png")
blockvis.draw_mechanism(response, "mechanism.png")
