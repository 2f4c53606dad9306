"""
2. From a DXF drawing with mortar to a collapse
===============================================

A survey draws stones, not joints: between them is mortar. This one is made here by ezdxf, in mm: two piers and a
lintel of three stones, 10 mm apart, with an axis and a note that are no stones.
"""

import shutil
import tempfile
from pathlib import Path

import ezdxf

import blockvis
import solver

drawing = ezdxf.new("R2010", units=4)  # 4: mm
sheet = drawing.modelspace()


def stone(x, y, width, height, layer):
    corners = [(x, y), (x + width, y), (x + width, y + height), (x, y + height)]
    sheet.add_lwpolyline(corners, close=True, dxfattribs={"layer": layer})


for left in (0, 2000):
    for course in range(4):
        stone(left, course * 410, 500, 400, "stones")
stone(0, 4 * 410, 2500, 400, "stones")
stone(0, -310, 500, 300, "fixed")
stone(2000, -310, 500, 300, "moving")
sheet.add_line((1250, -500), (1250, 3000), dxfattribs={"layer": "axes"})
sheet.add_text("north side", dxfattribs={"layer": "notes"}).set_placement((2600, 0))
folder = Path(tempfile.mkdtemp())
file = folder / "survey.dxf"
drawing.saveas(file)

# %%
# What the drawing holds
# ----------------------
#
# The unit is the drawing's own; layers named ``fixed`` and ``moving`` are the supports; lines that close nothing are
# left out, and counted. The mortar is measured.
print(blockvis.inspect(file, ignore=["axes"]))

# %%
# Closing the joints
# ------------------
#
# A dry joint has no thickness: with ``joint_thickness="auto"`` both faces move to the midline of the gap. In a case
# file this is ``joint_thickness = "auto"`` under ``[geometry]``; a number in m is a limit up to which gaps are
# joints.
portal = blockvis.read(file, joint_thickness="auto", ignore=["axes", "notes"])
print(portal)
assert portal.n_blocks == 11
assert portal.moving.sum() == 1

# %%
# The collapse
# ------------
#
# The right foot moves out. The piers turn over once the lintel no longer holds them.
out = solver.Settlement(direction=(1, 0), increment=0.02, limit=1.5, tolerance=1e-3)
response = solver.settle(portal, out, friction_coefficient=0.6)
print(response)
print(response.collapse)
assert response.stop is solver.Status.COLLAPSED
assert 0.2 < response.collapse.displacement < 1.5
blockvis.draw_mechanism(response, "mechanism.png")

# %%
# ParaView
# --------
#
# ``blockvis.write`` makes the results folder; ``blocks.pvd`` in it is what ParaView opens. Blocks carry the names of
# their layers as ``material``.
results = blockvis.write(response, folder / "out")
print((results / "blocks.pvd").read_text().splitlines()[3].strip())
shutil.rmtree(folder)
