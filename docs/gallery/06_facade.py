"""
Façade on settling ground
=========================

A brick façade with one window, two dressed haunches and a key over it. The ground under its right part settles by 20
mm: the key goes down with the right haunch and slides along the left one, and the façade stands.
"""

import blockvis
import solver

facade = blockvis.generators.facade(
    bricks=8, courses=10, storeys=1, windows=1, window_bricks=3, window_courses=4, sill_courses=1, voussoirs=3,
    rise_courses=1.0, settling_from=1.0,
)  # fmt: skip
joints = solver.Interfaces(
    solver.InterfaceLaw(friction_coefficient=0.6), {("stone", "stone"): solver.InterfaceLaw(friction_coefficient=0.4)}
)
sink = solver.Settlement(direction=(0, -1), increment=0.01, limit=0.02)
response = solver.Structure(facade, joints).settle(sink)
print(response)
assert response.stop is solver.Status.LIMIT_REACHED
fallen = response.path[-1].pose.displacements(facade)[:, 1].min()
print(f"largest sinking {-fallen * 1000:.1f} mm")
assert -0.04 < fallen < -0.0199

blockvis.draw_still(response, -1, "facade.png")
