"""
In a notebook
=============

``response.plot()`` as the last line of a cell is the player of ``report.html``: drag the bar, or play. The page of
each needs no network.
"""

import blockvis
import solver

arch = blockvis.generators.arch_on_piers(span=2.0, rise=1.0, thickness=0.25, voussoirs=13)
response = solver.Structure(arch, friction_coefficient=0.6).settle((1, 0))
print(response.collapse)
assert response.stop is solver.Status.COLLAPSED
assert 0.3 < response.collapse.displacement < 0.42
blockvis.draw_mechanism(response, "arch_on_piers.png")

# %%
response.plot()
