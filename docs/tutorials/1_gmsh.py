"""
1. From a gmsh file to a collapse
=================================

The mesh in ``assets/semicircular_arch.msh`` has a physical group for its voussoirs and one for each springer. Every
meshed surface becomes one block, however many triangles it has.
"""

import shutil
import tempfile
from pathlib import Path

import pyvista as pv

import blockvis

mesh = Path("../../assets/semicircular_arch.msh").resolve()

# %%
# What the file holds
# -------------------
#
# ``blockvis info FILE`` on the command line, or in Python:
print(blockvis.inspect(mesh))

# %%
# The file says neither its unit nor which groups are supports. The case says the latter by ``[roles]``; the unit,
# where it is not m, by ``unit = "mm"`` under ``[geometry]``.
#
# The case
# --------
folder = Path(tempfile.mkdtemp())
case = folder / "arch.toml"
case.write_text(f"""
[geometry]
file = "{mesh.as_posix()}"
thickness = 1.0                  # m, out of plane

[roles]
"left springer" = "fixed"
"right springer" = "moving"

[material]
density = 2000.0                 # kg/m3
friction_coefficient = 0.6

[settlement]
direction = [1.0, 0.0]           # the right springer moves out
increment = 0.02                 # m, between what is reported
limit = 0.5                      # m, where to stop at the latest
tolerance = 1e-4                 # m, width of the collapse bracket
""")

# %%
# The run
# -------
#
# ``blockvis run arch.toml`` writes a folder with everything, pictures and film too; here without them.
run = blockvis.run_case(case, folder / "out", pictures=False)
response = run.response
print(response.collapse)
assert abs(response.collapse.displacement - 0.141) < 1e-3
print(*sorted(path.name for path in (folder / "out").iterdir()), sep="\n")

# %%
# The thrust on the springer, and the mechanism at the end.
blockvis.draw_curve(response, "curve.png")
blockvis.draw_mechanism(response, "mechanism.png")

# %%
# ParaView
# --------
#
# Open ``blocks.pvd``, ``joints.pvd`` and ``contacts.pvd``; time is the settlement. The blocks stand where they are;
# *Warp By Vector* leads on along the mechanism, with ``to_reference`` back to the drawing. Colour the blocks by
# ``macro_block``, and draw *Glyphs* of ``force`` at the contact points; ``paraview_colours.py`` in the
# folder colours them as the pictures do. The same files in PyVista:
last = pv.read(sorted((folder / "out" / "increments").glob("*blocks*.vtu"))[len(response.path) - 1])
print(sorted(last.cell_data))
assert {"rotation", "macro_block", "role_name"} <= set(last.cell_data)
shutil.rmtree(folder)
