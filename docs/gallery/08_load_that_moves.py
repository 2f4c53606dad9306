"""
Load that moves over an arch
============================

Where is an arch weakest? A force is tried at places along the span; at each the limit load is a linear program with
both bounds.
"""

import matplotlib.pyplot as plt

import solver
from blockvis import generators

arch = generators.segmental_arch(span=4.0, rise=1.0, thickness=0.25, voussoirs=15)
structure = solver.Structure(arch, friction_coefficient=0.6)
places = [-1.85 + 0.1 * k for k in range(38)]
envelope = structure.envelope(places, lambda x: solver.load_on_top(arch, x, (0.0, -1000.0)))
worst = envelope.worst
print(f"weakest at x = {places[worst]:.2f} m: {envelope.multipliers[worst]:.3f} kN")
assert abs(envelope.multipliers[worst] - 17.164) < 0.01
assert abs(abs(places[worst]) - 1.15) < 1e-9

# %%
figure, axes = plt.subplots()
axes.semilogy(places, envelope.multipliers, "o-")
axes.set(xlabel="place of the force [m]", ylabel="limit load [kN]")
figure.savefig("envelope.png")
plt.close(figure)
