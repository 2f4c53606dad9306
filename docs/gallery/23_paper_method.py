"""
The paper's method, and Coulomb friction
========================================

Portioli and Cascini (2017) follow a settlement by a linear program in each increment. Its joints slide by an
associative flow rule, which lifts what slides; gap functions take the lift back, but of all forces in equilibrium the
program takes those with the least reaction. Coulomb friction has no lift, and joints remember what they carried. Where
statics leaves one reaction both methods find the same path; where joints slide they part.
"""

import matplotlib.pyplot as plt
import numpy as np

import solver
from blockvis import generators

door = {"x": 0.8, "y": 0.0, "width": 0.8, "height": 1.0, "head": "lintel", "bearing": 0.2, "depth": 0.2}
arch = generators.arch(radius=1.0, thickness_ratio=0.15, embrace=180.0, voussoirs=12)
portal = generators.portal(span=2.0, height=2.4, column_width=0.5, column_blocks=4, lintel_height=0.5)
panel = generators.wall(
    bricks=6, courses=8, brick_length=0.4, brick_height=0.2, depth=0.4, openings=[door], settling=[1.2, 2.4]
)
settlements = {
    "arch": (arch, 2.0, solver.Settlement(direction=(1, 0), increment=0.01, limit=0.5, tolerance=1e-5)),
    "portal": (portal, 0.6, solver.Settlement(direction=(0, -1), increment=0.05, limit=2.5, tolerance=1e-3)),
    "panel with a door": (panel, 0.6, solver.Settlement(direction=(0, -1), increment=0.01, limit=0.1)),
}
paths = {}
for name, (assembly, friction, settlement) in settlements.items():
    structure = solver.Structure(assembly, friction_coefficient=friction)
    for increments in ("coulomb", "linear program"):
        controls = solver.Controls(increments=increments, falling_frames=1)
        paths[name, increments] = structure.settle(settlement, controls=controls)
        print(f"{name}, {increments}: {paths[name, increments].message}")

# %%
# The arch hinges only: both fall where exact kinematics do, at 0.14104982 radii.
for increments in ("coulomb", "linear program"):
    assert abs(paths["arch", increments].collapse.displacement - 0.14104982) < 1e-4

# %%
# To 0.85 m the portal hinges, at its lintel and in the left column: statics leaves one reaction. Then the right column
# hinges too, by each method at another joint, and at 1.2 m the lintel begins to slide: there the reactions differ by up
# to 2 %. In the end they are the same again.
both = [paths["portal", increments] for increments in ("coulomb", "linear program")]
assert abs(both[0].collapse.displacement / both[1].collapse.displacement - 1.0) < 5e-3
for increments, allowed in ((18, 1e-3), (36, 0.03)):
    assert np.allclose(both[0].reaction[1:increments], both[1].reaction[1:increments], rtol=allowed)

# %%
# In the panel many joints slide. The paper's method gives the least reaction from the first increment on; the path of
# Coulomb friction begins at rest, and its reaction depends on what joints carried and which of them slide: equilibrium
# leaves a range, which it reports.
coulomb, linear = (paths["panel with a door", increments] for increments in ("coulomb", "linear program"))
assert abs(linear.initial_reaction / coulomb.initial_reaction - 1.0) < 1e-6
apart = np.abs(linear.reaction[1:] / coulomb.reaction[1:] - 1.0).max()
print(f"reactions of the panel differ by up to {100 * apart:.1f} %")
assert 1e-3 < apart < 0.1

# %%
figure, axes = plt.subplots(1, 3, figsize=(12, 3.5), layout="constrained")
for axis, name in zip(axes, settlements, strict=True):
    for increments, line in (("coulomb", "-"), ("linear program", "--")):
        response = paths[name, increments]
        axis.plot(response.settlement, response.reaction / response.total_weight, line, label=increments)
    axis.set(title=name, xlabel="settlement [m]", ylabel="reaction / weight")
axes[0].legend()
figure.savefig("both_methods.png")
plt.close(figure)
