"""
Pushover of a stack
===================

Five blocks, 0.2 m wide and 1 m high together, are pushed to the side. The capacity falls from b/h = 0.2 as the stack
rocks, α = tan(arctan 0.2 − arcsin d), and ends at d = 0.19612, all by geometry.
"""

import math

import blockvis
import solver

outlines = [[[0, 0.2 * k], [0.2, 0.2 * k], [0.2, 0.2 * k + 0.2], [0, 0.2 * k + 0.2]] for k in range(5)]
ground = [[-0.5, -0.1], [0.7, -0.1], [0.7, 0], [-0.5, 0]]
stack = solver.Assembly.from_outlines([ground, *outlines], roles=["fixed", *["free"] * 5])
structure = solver.Structure(stack, friction_coefficient=0.7).with_live(acceleration=(1, 0))
control = solver.ControlDisplacement("block 5", (1, 0), point=(0.2, 1.0), increment=0.02, limit=0.5)
response = structure.pushover(control)
print(f"α falls from {response.load_multiplier[0]:.4f} to 0 at d = {response.collapse.displacement:.5f} m")
assert abs(response.load_multiplier[0] - 0.2) < 1e-6
assert abs(response.collapse.displacement - math.sin(math.atan(0.2))) < 1e-4

# %%
blockvis.draw_curve(response, "capacity.png")
blockvis.draw_mechanism(response, "mechanism.png")
