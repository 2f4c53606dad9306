"""
Arch on a sinking support
=========================

The right springer of a segmental arch sinks. Supports may go along any direction; a mechanism of four macro-blocks
ends it at 0.35255 radii.
"""

import blockvis
import solver
from blockvis import generators

arch = generators.arch(thickness_ratio=0.10, embrace=140.0, voussoirs=12)
sink = solver.Settlement(direction=(0, -1), increment=0.01, limit=1.0, tolerance=1e-4)
response = solver.Structure(arch, friction_coefficient=2.0).settle(sink)
print(response.collapse)
assert abs(response.collapse.displacement - 0.35254631) < 1e-3

# %%
# Hinges on the way: the thrust touches the edge of the arch where a joint turns.
blockvis.draw_still(response, len(response.path) // 2, "half_way.png")
blockvis.draw_mechanism(response, "mechanism.png")
