"""
From a gmsh file
================

A meshed surface is a block; physical groups name it. ``roles`` says which groups are supports.
"""

from pathlib import Path

import blockvis
import solver

mesh = Path("../../assets/semicircular_arch.msh")
print(blockvis.inspect(mesh))

# %%
arch = blockvis.read(mesh, roles={"left springer": "fixed", "right springer": "moving"})
print(arch)
response = solver.Structure(arch, friction_coefficient=2.0).settle((0, -1))
print(response.collapse)
assert abs(response.collapse.displacement - 0.33003942) < 1e-3
blockvis.draw_mechanism(response, "arch.png")
