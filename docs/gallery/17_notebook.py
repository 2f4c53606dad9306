"""
In a notebook
=============

``response.plot()`` as the last line of a cell is the player of ``report.html``: drag the bar, or play. The page of each needs no
network.
"""

import blockvis
import solver
from blockvis import generators

arch = generators.pointed_arch(span=2.0, rise=1.5, thickness=0.25, voussoirs=10)
spread = solver.Settlement(direction=(1, 0), increment=0.02, limit=1.0)
response = solver.settle(arch, spread, friction_coefficient=0.8)
print(response.collapse)
assert response.stop is solver.Status.COLLAPSED
assert 0.05 < response.collapse.displacement < 1.0
blockvis.draw_mechanism(response, "pointed_arch.png")

# %%
response.plot()
