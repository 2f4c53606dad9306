"""
From an SVG drawing
===================

Closed paths are blocks; a layer named ``fixed`` or ``moving`` makes its blocks supports. Width against viewBox gives
the unit: this sheet is 300 cm for 300 units.
"""

import tempfile
from pathlib import Path

import blockvis
import solver

drawn = """
<svg xmlns="http://www.w3.org/2000/svg" width="300cm" height="200cm" viewBox="0 0 300 200">
  <g id="fixed"><path d="M 20 200 L 80 200 L 80 180 L 20 180 Z"/></g>
  <g id="moving"><path d="M 220 200 L 280 200 L 280 180 L 220 180 Z"/></g>
  <g id="stones">
    <rect x="30" y="60" width="40" height="120"/>
    <rect x="230" y="60" width="40" height="120"/>
    <rect x="30" y="20" width="240" height="40"/>
  </g>
</svg>
"""
with tempfile.TemporaryDirectory() as folder:
    (svg := Path(folder, "lintel.svg")).write_text(drawn)
    portal = blockvis.read(svg)
print(portal)
assert portal.n_blocks == 5

# %%
# By symmetry the right support carries half of everything before it sinks; less once it does.
sink = solver.Settlement(direction=(0, -1), increment=0.02, limit=0.2)
response = solver.Structure(portal, friction_coefficient=0.6).settle(sink)
print(response.reaction / response.total_weight)
assert 0.3 < response.initial_reaction / response.total_weight < 0.5 + 1e-6
blockvis.draw_still(response, -1, "lintel.png")
