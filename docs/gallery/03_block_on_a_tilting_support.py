"""
Block on a tilting support
==========================

A settlement may be a rotation about any point. A block 1 m wide and 2 m high overturns when its support has turned by
arctan(1/2); the parameter of the run is an angle, and the reaction a moment.
"""

import math

import blockvis
import solver

plate, block = [[-2, -0.5], [2, -0.5], [2, 0], [-2, 0]], [[-0.5, 0], [0.5, 0], [0.5, 2], [-0.5, 2]]
assembly = solver.Assembly.from_outlines([plate, block], roles=["moving", "free"], names=["plate", "block"])
tilt = solver.Settlement(rotation_centre=(0, 0), rotation=1.0, increment=0.02, limit=1.0, tolerance=1e-5)
response = solver.Structure(assembly, friction_coefficient=0.7).settle(tilt)
print(response.collapse)
assert abs(response.collapse.displacement - math.atan(0.5)) < 1e-4

blockvis.draw_mechanism(response, "mechanism.png")
