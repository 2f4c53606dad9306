"""
3. From an SVG drawing to a collapse
====================================

Any drawing program writes SVG. Closed paths, rectangles and polygons are blocks; ids become names; a layer (a group)
named ``fixed`` or ``moving`` makes supports. The flat arch here has two stones between two abutments and is held by
its thrust alone.
"""

import math
import shutil
import tempfile
from pathlib import Path

import blockvis
import solver

folder = Path(tempfile.mkdtemp())
(folder / "flat_arch.svg").write_text("""
<svg xmlns="http://www.w3.org/2000/svg" width="300" height="100" viewBox="0 0 300 100"
     xmlns:inkscape="http://www.inkscape.org/namespaces/inkscape">
  <g inkscape:groupmode="layer" inkscape:label="fixed">
    <rect id="left abutment" x="0" y="0" width="50" height="100"/>
  </g>
  <g inkscape:groupmode="layer" inkscape:label="moving">
    <rect id="right abutment" x="250" y="0" width="50" height="100"/>
  </g>
  <g inkscape:groupmode="layer" inkscape:label="stones">
    <rect id="left stone" x="50" y="25" width="100" height="50"/>
    <rect id="right stone" x="150" y="25" width="100" height="50"/>
  </g>
</svg>
""")

# %%
# Unit
# ----
#
# SVG has no millimetres of its own: ``width`` against ``viewBox`` is the scale. Without a unit in ``width``, say
# ``unit``.
print(blockvis.inspect(folder / "flat_arch.svg", unit="cm"))

# %%
# The collapse
# ------------
#
# The right abutment moves out. The two stones are struts: they touch at the top in the middle and below at the
# abutments, and snap through once the supports are apart by as much as the struts are longer than the clear span.
arch = blockvis.read(folder / "flat_arch.svg", unit="cm")
out = solver.Settlement(direction=(1, 0), increment=0.005, limit=0.5, tolerance=1e-4)
response = solver.settle(arch, out, friction_coefficient=3.0)
exact = 2 * (math.hypot(1.0, 0.5) - 1)
print(response.collapse)
print(f"exactly {exact:.6f} m")
assert abs(response.collapse.displacement - exact) < 1e-3
blockvis.draw_mechanism(response, "mechanism.png")

# %%
# ParaView
# --------
#
# ``blockvis.write(response, "out")`` makes the folder for ParaView; ``blockvis.save_layout`` writes the deformed
# shape back as SVG, or in any other format that can be written.
blockvis.save_layout(arch, folder / "deformed.svg", pose=response.path[-1].pose)
assert blockvis.read_layout(folder / "deformed.svg")
blockvis.write(response, folder / "out")
shutil.rmtree(folder)
