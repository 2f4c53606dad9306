"""
From an outline to the collapse
===============================

An elevation as architects draw it: the outline of a wall, its openings, no stones. ``[[bond]]`` fills it with a running
bond and puts rings of voussoirs around the arched tops; the ground under its right half sinks.
"""

import tempfile
from pathlib import Path

import blockvis
import solver

temporary = tempfile.TemporaryDirectory()
folder = Path(temporary.name)
(folder / "facade.svg").write_text("""
<svg xmlns="http://www.w3.org/2000/svg" width="480cm" height="460cm" viewBox="0 0 480 460">
  <g id="wall"><path d="M 0 460 L 480 460 L 480 130 L 240 0 L 0 130 Z"/></g>
  <g id="openings">
    <path d="M 180 460 L 300 460 L 300 290 A 60 60 0 0 0 180 290 Z"/>
    <path d="M 50 380 L 120 380 L 120 260 A 70 70 0 0 0 50 260 Z"/>
    <path d="M 360 380 L 430 380 L 430 260 A 70 70 0 0 0 360 260 Z"/>
  </g>
</svg>
""")

# %%
# What the drawing holds, and how to go on.
print(blockvis.inspect(folder / "facade.svg"))

# %%
# The case names the layers and the size of the bricks.
(folder / "case.toml").write_text("""
supports = [
  { name = "ground left", outline = [[-0.5, -5.0], [2.4, -5.0], [2.4, -4.6], [-0.5, -4.6]] },
  { name = "ground right", role = "moving", outline = [[2.4, -5.0], [5.3, -5.0], [5.3, -4.6], [2.4, -4.6]] },
]
[geometry]
file = "facade.svg"
thickness = 0.4
[[bond]]
walls = ["wall"]
openings = ["openings"]
bond = "running"
brick = [0.5, 0.25]
[settlement]
direction = [0.0, -1.0]
increment = 0.01
limit = 0.4
""")
response = blockvis.run_case(folder / "case.toml", folder / "out", outputs=()).response
print(response)
# The area of the drawing's wall, less its openings, is that of the stones.
assert abs(response.assembly.areas[response.assembly.free].sum() - 14.587) < 0.001
assert response.stop is solver.Status.COLLAPSED
# Where so many joints slide, rounding decides among paths: 0.2 to 0.3 m were found.
assert 0.15 < response.path[-1].parameter < 0.4

# %%
# Most of the right half turns outwards over the pier beside the window.
blockvis.draw_mechanism(response, "outline.png")
temporary.cleanup()
