"""
The fall in time
================

Behind the last equilibrium statics has nothing to say; where pymunk is installed, rigid-body dynamics without restitution goes on
from there. The film shows both; here are three frames of it.
"""

import blockvis
import solver
from blockvis import generators
from blockvis.fall import fall_of

arch = generators.arch(thickness_ratio=0.15, voussoirs=12)
spread = solver.Settlement(direction=(1, 0), increment=0.02, limit=0.5)
response = solver.settle(arch, spread, friction_coefficient=0.6)
fall = fall_of(response)
print(f"{fall.times[-1]:.2f} s until all rest")
