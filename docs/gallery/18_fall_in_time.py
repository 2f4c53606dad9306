"""
The fall in time
================

Behind the last equilibrium statics has nothing to say; where pymunk is installed, rigid-body dynamics without
restitution goes on from there. The film plays it in real time. Here are the rubble and the way to it.
"""

import blockvis
import solver
from blockvis import generators
from blockvis.fall import fall_of, falling_increment

arch = generators.arch(thickness_ratio=0.15, voussoirs=12)
spread = solver.Settlement(direction=(1, 0), increment=0.02, limit=0.5)
response = solver.settle(arch, spread, friction_coefficient=0.6)
fall = fall_of(response)
print(f"{fall.times[-1]:.2f} s until all rest")
assert 0.5 < fall.times[-1] <= 4.0
assert fall.positions[-1, arch.free, 1].max() < 0.6  # the crown stood at 1 m

for name, time in (("early.png", 0.3), ("rubble.png", fall.times[-1])):
    blockvis.draw_still(response, falling_increment(response, fall.at(time)), name)
