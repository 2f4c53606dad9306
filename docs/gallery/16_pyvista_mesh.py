"""
From a PyVista mesh
===================

Anything that PyVista builds or reads can be a wall: a cell array ``block_id`` says which cells are one block,
``role_name`` which blocks are supports.
"""

import numpy as np
import pyvista as pv

import blockvis.pyvista_plugin
import solver

#: A stack of stones on a plate: one quadrangle each.
heights = [-0.2, 0.0, 0.4, 0.8, 1.2, 1.6]
halves = [0.8, 0.3, 0.3, 0.3, 0.3]
points, faces = [], []
for k, half in enumerate(halves):
    low, high = heights[k], heights[k + 1]
    faces += [4, *range(4 * k, 4 * k + 4)]
    points += [[-half, low, 0], [half, low, 0], [half, high, 0], [-half, high, 0]]
mesh = pv.PolyData(np.array(points, dtype=float), faces)
mesh.cell_data["block_id"] = np.arange(len(halves))
mesh.cell_data["role_name"] = ["moving", "free", "free", "free", "free"]

# %%
# The plate turns until the stack falls: as a whole, at b/h = 0.6/1.6.
stack = mesh.blockvis.structure(friction_coefficient=0.9)
print(stack.assembly)
tilt = solver.Settlement(rotation_centre=(0, 0), rotation=1.0, increment=0.02, limit=1.0, tolerance=1e-5)
response = stack.settle(tilt)
print(response.collapse)
assert abs(response.collapse.displacement - np.arctan(0.6 / 1.6)) < 1e-3
blockvis.draw_mechanism(response, "stack.png")
