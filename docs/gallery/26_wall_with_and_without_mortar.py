"""
A wall with mortar and without
==============================

The ground sinks under the right half of a small wall. Dry, the wall arches over two bricks that go down with the
ground; mortar makes one piece of it, which tips on the edge of the ground that stays and leans on the other with less.
"""

import blockvis
import solver

wall = blockvis.generators.panel(nb=3, nc=4, x_s=0.6, block_height=0.2, depth=0.25)
sink = solver.Settlement(direction=(0, -1), increment=0.002, limit=0.006)
dry = solver.InterfaceLaw(friction_coefficient=0.6)
mortar = solver.InterfaceLaw(friction_coefficient=0.6, cohesion=6e4, tensile_strength=3e4)

responses = {}
for name, law in (("dry", dry), ("with mortar", mortar)):
    structure = solver.Structure(wall, solver.Interfaces(law))
    responses[name] = structure.settle(sink)
    last = responses[name].path[-1]
    print(f"{name:12s} reaction of the sinking ground {last.reaction / responses[name].total_weight:.3f} W")
    blockvis.draw_still(responses[name], -1, f"{name.replace(' ', '_')}.png")
moved = {
    name: (abs(response.path[-1].pose.displacements(wall)[wall.free]).max(axis=1) > 1e-3).sum()
    for name, response in responses.items()
}
assert moved == {"dry": 2, "with mortar": 13}
assert responses["with mortar"].path[-1].reaction < 0.7 * responses["dry"].path[-1].reaction
