"""
What a settlement leaves
========================

The same horizontal capacity before and after the right support of a block has sunk: a settlement first, then the
limit load of the pose that it leaves.
"""

from dataclasses import replace

import blockvis
import solver
from blockvis import generators

arch = generators.arch(thickness_ratio=0.15, voussoirs=12)
spread = solver.Settlement(direction=(1, 0), increment=0.01, limit=0.10)
response = solver.settle(arch, spread, friction_coefficient=2.0)
loads = replace(solver.self_weight(arch), live=solver.weight_fraction(arch, (1.0, 0.0)))
capacity = [
    solver.limit_load(arch, loads=loads, friction_coefficient=2.0, pose=increment.pose).multiplier
    for increment in response.path
]
for increment, alpha in zip(response.path[::2], capacity[::2], strict=True):
    print(f"{increment.parameter:5.2f} m   {alpha:.4f} g")
assert capacity[0] > capacity[-1] > 0.0

# %%
blockvis.draw_still(response, len(response.path) - 1, "spread.png", forces="thrust")
