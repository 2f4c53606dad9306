"""
From a DXF drawing with mortar
==============================

Stones that were drawn with 10 mm of mortar between them. Dry joints have no thickness: ``joint_thickness="auto"``
measures the gaps and moves the faces to their midline.
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


for course in range(6):
    y, shift = course * 210, 200 * (course % 2)
    for x, width in (
        [(0, 190)] * (course % 2)
        + [(k * 400 + shift, 390) for k in range(4 - course % 2)]
        + [(1400, 190)] * (course % 2)
    ):
        stone(x, y, width, 200, "stones")
stone(0, -210, 790, 200, "fixed")
stone(800, -210, 790, 200, "moving")
folder = Path(tempfile.mkdtemp())
drawing.saveas(folder / "wall.dxf")

# %%
# What the drawing holds: the unit comes from the file, the roles from the names of the layers.
found = blockvis.inspect(folder / "wall.dxf")
print(found)

# %%
wall = blockvis.read(folder / "wall.dxf", joint_thickness="auto")
print(wall)
assert wall.n_blocks == 29
sink = solver.Settlement(direction=(0, -1), increment=0.01, limit=0.05)
response = solver.Structure(wall, friction_coefficient=0.6).settle(sink)
print(response)
assert response.stop is solver.Status.LIMIT_REACHED
assert 0.05 < response.initial_reaction / response.total_weight < 0.5
blockvis.draw_still(response, len(response.path) - 1, "wall.png")
shutil.rmtree(folder)
