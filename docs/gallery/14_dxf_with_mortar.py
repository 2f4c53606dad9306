"""
From a DXF drawing with mortar
==============================

Stones that were drawn with 10 mm of mortar between them. Dry joints have no thickness: ``joint_thickness="auto"``
measures the gaps and moves the faces to their midline.
"""

import tempfile

import ezdxf

import blockvis
import solver

drawing = ezdxf.new("R2010", units=4)  # 4: mm
sheet = drawing.modelspace()


def stone(x, y, width, height, layer):
    corners = [(x, y), (x + width, y), (x + width, y + height), (x, y + height)]
    sheet.add_lwpolyline(corners, close=True, dxfattribs={"layer": layer})


whole = [(400 * k, 390) for k in range(4)]
with_halves = [(0, 190), *((400 * k + 200, 390) for k in range(3)), (1400, 190)]
for course in range(6):
    for x, width in with_halves if course % 2 else whole:
        stone(x, course * 210, width, 200, "stones")
stone(0, -210, 790, 200, "fixed")
stone(800, -210, 790, 200, "moving")

# %%
# What the drawing holds: the unit comes from the file, the roles from the names of the layers.
with tempfile.TemporaryDirectory() as folder:
    drawing.saveas(f"{folder}/wall.dxf")
    print(blockvis.inspect(f"{folder}/wall.dxf"))
    wall = blockvis.read(f"{folder}/wall.dxf", joint_thickness="auto")
print(wall)
assert wall.n_blocks == 29
sink = solver.Settlement(direction=(0, -1), increment=0.01, limit=0.05)
response = solver.Structure(wall, friction_coefficient=0.6).settle(sink)
print(response)
assert response.stop is solver.Status.LIMIT_REACHED
assert 0.05 < response.initial_reaction / response.total_weight < 0.5
blockvis.draw_still(response, -1, "wall.png")
