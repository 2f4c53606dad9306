"""
4. From a PyVista mesh to a collapse
====================================

A mesh that was made in Python, by PyVista or any of the many programs that write VTK files: here an arch of
quadrangles, four per voussoir, on two springers.
"""

import shutil
import tempfile
from pathlib import Path

import numpy as np
import pyvista as pv

import blockvis
import solver

#: Twelve voussoirs in half a circle, radius 1 m to the middle, 0.15 m thick; each of two by two cells.
per_block, voussoirs = 2, 12
angles = np.linspace(0.0, np.pi, per_block * voussoirs + 1)
radii = np.linspace(1.0 - 0.075, 1.0 + 0.075, per_block + 1)
r, a = np.meshgrid(radii, angles)
points = np.column_stack([(r * np.cos(a)).ravel(), (r * np.sin(a)).ravel(), np.zeros(r.size)])
rows, columns = r.shape
corner = np.arange(rows * columns).reshape(rows, columns)
cells = np.stack([corner[:-1, :-1], corner[:-1, 1:], corner[1:, 1:], corner[1:, :-1]], axis=-1).reshape(-1, 4)
number = np.repeat(np.arange(rows - 1) // per_block, columns - 1)

# The springers, below: a quadrangle each.
for k, x in enumerate((1.0, -1.0)):
    half = 0.1
    base = len(points)
    points = np.vstack([points, [[x - half, -0.1, 0], [x + half, -0.1, 0], [x + half, 0, 0], [x - half, 0, 0]]])
    cells = np.vstack([cells, [base, base + 1, base + 2, base + 3]])
    number = np.append(number, voussoirs + k)
faces = np.column_stack([np.full(len(cells), 4), cells]).ravel()
mesh = pv.PolyData(points, faces)

# %%
# Blocks and roles
# ----------------
#
# The cell array ``block_id`` says which cells are one block, ``role_name`` which blocks are supports; without them
# connected cells are a block, and ``roles`` says what is fixed and what moves.
mesh.cell_data["block_id"] = number
mesh.cell_data["role_name"] = ["moving" if n == voussoirs else "fixed" if n > voussoirs else "free" for n in number]
folder = Path(tempfile.mkdtemp())
mesh.save(folder / "arch.vtp")
arch = blockvis.read(folder / "arch.vtp")
print(arch)
assert arch.n_blocks == 14

# %%
# The collapse
# ------------
spread = solver.Settlement(direction=(1, 0), increment=0.01, limit=0.5, tolerance=1e-4)
response = solver.settle(arch, spread, friction_coefficient=2.0)
print(response.collapse)
blockvis.draw_mechanism(response, "mechanism.png")

# %%
# Its voussoirs are as long as the chords of the mesh, so that the number is near that of exact wedges, 0.1410.
assert abs(response.collapse.displacement - 0.141) < 0.005

# %%
# ParaView, and PyVista again
# ---------------------------
#
# ParaView opens ``blocks.pvd``; PyVista reads the same file. Its times are the settlements.
results = blockvis.write(response, folder / "out")
reader = pv.get_reader(results / "blocks.pvd")
print(f"{len(reader.time_values)} times, the first {reader.time_values[:3]}")
assert len(reader.time_values) == len(response.path)
shutil.rmtree(folder)
