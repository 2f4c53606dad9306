"""
What a settlement leaves
========================

The same horizontal capacity before and after a springer of an arch has moved outwards: a settlement first, then the
limit load of the pose that it leaves.
"""

import blockvis
import solver

arch = blockvis.generators.arch(thickness_ratio=0.15, voussoirs=12)
structure = solver.Structure(arch, friction_coefficient=2.0)
response = structure.settle(solver.Settlement(direction=(1, 0), increment=0.01, limit=0.10))
capacity = [structure.limit_load(acceleration=(1, 0), pose=i.pose).multiplier for i in response.path]
for increment, alpha in zip(response.path[::2], capacity[::2], strict=True):
    print(f"{increment.parameter:5.2f} m   {alpha:.4f} g")
assert capacity[0] > capacity[-1] > 0.0

# %%
blockvis.draw_still(response, -1, "spread.png", forces="thrust")
