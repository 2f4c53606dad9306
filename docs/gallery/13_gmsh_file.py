"""
From a gmsh file
================

A meshed surface is a block; physical groups name it. ``roles`` says which groups are supports.
"""

from pathlib import Path

import blockvis
import solver

mesh = Path("../../assets/semicircular_arch.msh")
found = blockvis.inspect(mesh)
print(found)

# %%
arch = blockvis.read(mesh, roles={"left springer": "fixed", "right springer": "moving"})
print(arch)
sink = solver.Settlement(direction=(0, -1), increment=0.02, limit=0.6, tolerance=1e-4)
response = solver.Structure(arch, friction_coefficient=2.0).settle(sink)
print(response.collapse)
assert abs(response.collapse.displacement - 0.33003942) < 1e-3
blockvis.draw_mechanism(response, "arch.png")
