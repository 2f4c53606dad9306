"""
Your own contact law
====================

Joints may resist differently by pair of materials, and in limit loads have cohesion and a compressive strength. A
block on the ground, pushed sideways: it slides at α = μ + cA/W, unless it overturns before.
"""

import math

import blockvis
import solver
from solver import mechanics

ground = [[-1, -0.2], [3, -0.2], [3, 0], [-1, 0]]
block = [[0, 0], [2, 0], [2, 1], [0, 1]]
assembly = solver.Assembly.from_outlines(
    [ground, block], roles=["fixed", "free"], names=["ground", "block"], materials=["rock", "marble"]
)
cohesion = 0.2 * mechanics.total_weight(assembly) / 2.0  # Pa, of a joint of 2 m²
joints = solver.Interfaces(
    solver.InterfaceLaw(friction_coefficient=0.6),
    {("rock", "marble"): solver.InterfaceLaw(friction_coefficient=0.3, cohesion=cohesion)},
)
limit = solver.Structure(assembly, joints).limit_load(acceleration=(1, 0))
print(limit)
assert abs(limit.multiplier - (0.3 + 0.2)) < 1e-6

# %%
# Friction that nobody knows: a factor per joint, drawn once from a seed, that stays with its joint along the path.
scatter = solver.JointScatter(seed=1, quantile=lambda p: 0.8 + 0.4 * p)
uneven = solver.Interfaces(solver.InterfaceLaw(friction_coefficient=0.5), scatter=scatter)
limit = solver.Structure(assembly, uneven).limit_load(acceleration=(1, 0))
print(f"slides at {limit.multiplier:.4f}")
assert 0.4 <= limit.multiplier <= 0.6

# %%
# On a path, too: where the ground tilts, the block slides once the slope is its friction, arctan 0.3.
tilt = solver.Settlement(rotation_centre=(0, 0), rotation=-1.0, increment=0.02, limit=0.6, tolerance=1e-5)
response = solver.Structure(assembly.with_roles(["moving", "free"]), friction_coefficient=0.3).settle(tilt)
print(response.collapse)
assert abs(response.collapse.displacement - math.atan(0.3)) < 1e-4
blockvis.draw_mechanism(response, "block.png")
