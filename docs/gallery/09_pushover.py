"""
Pushover of a stack
===================

Five blocks, 0.2 m wide and 1 m high together, are pushed to the side. The capacity falls from b/h = 0.2 as the stack
rocks, α = tan(arctan 0.2 − arcsin d), and ends at d = 0.19612.
"""

import math
from dataclasses import replace

import blockvis
import solver
from blockvis import generators

stack = generators.column(blocks=5, width=0.2, block_height=0.2)
top = max((name for name, role in zip(stack.names, stack.roles, strict=True) if role == "free"), key=stack.index)
loads = replace(solver.self_weight(stack), live=solver.weight_fraction(stack, (1.0, 0.0)))
control = solver.ControlDisplacement(top, direction=(1, 0), increment=0.01, limit=0.3, tolerance=1e-5)
response = solver.pushover(stack, control, loads=loads, friction_coefficient=0.6)
print(f"α falls from {response.load_multiplier[0]:.4f} to 0 at d = {response.collapse.displacement:.5f} m")
assert abs(response.load_multiplier[0] - 0.2) < 1e-4

# %%
blockvis.draw_curve(response, "capacity.png")
blockvis.draw_mechanism(response, "mechanism.png")
print(math.sin(math.atan(0.2)))
