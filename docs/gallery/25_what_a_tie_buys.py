"""
What does the tie buy me?
=========================

A semicircular arch on two piers whose right one moves out: without a tie, with ties that yield at several forces, and
both under fill.
"""

from dataclasses import replace

import matplotlib.pyplot as plt

import blockvis
import solver

arch = blockvis.generators.arch_on_piers(voussoirs=9, pier_width=0.5, pier_height=2.0, pier_blocks=2)
piers = arch.index("left pier 2"), arch.index("right pier 2")
fill = blockvis.lay_backfill(arch, "voussoir *", surface=3.5, unit_weight=16e3)
out = solver.Settlement(direction=(1, 0), increment=0.04, limit=0.6)


def spread(strength, fills=()):
    """Follow the right pier outwards, with a tie at the springing that yields at a strength [N], or without."""
    tie = solver.Tie("iron", piers, ((-1.25, 1.95), (1.25, 1.95)), stiffness=4e7, strength=strength or 1.0)
    loads = replace(solver.self_weight(arch), fills=fills)
    structure = solver.Structure(arch, loads=loads, friction_coefficient=0.6, ties=[tie] if strength else [])
    return structure.settle(out, controls=solver.Controls(falling_frames=0))


# %%
# How far the pier may move out.

strengths = [0.0, 2000.0, 4000.0]
bare = [spread(strength) for strength in strengths]
filled = [spread(strength, (fill,)) for strength in strengths]
for strength, one, other in zip(strengths, bare, filled, strict=True):
    print(f"{strength:5.0f} N   {one.collapse.displacement:.3f} m   with fill {other.collapse.displacement:.3f} m")
assert filled[-1].collapse.displacement > 1.4 * filled[0].collapse.displacement

# %%
# What the tie does along the way: ``response.members(k)`` has force, elongation and state of each.

iron = bare[-1].members(-1)
print(f"the tie carries {iron['force'][0]:.0f} N and is longer by {1e3 * iron['elongation'][0]:.1f} mm")

figure, axes = plt.subplots()
axes.plot(strengths, [r.collapse.displacement for r in bare], "o-", label="bare")
axes.plot(strengths, [r.collapse.displacement for r in filled], "s--", label="under fill")
axes.set_xlabel("strength of the tie [N]")
axes.set_ylabel("the pier may move out by [m]")
axes.set_ylim(bottom=0.0)
axes.legend()
figure.savefig("tie.png")
blockvis.draw_still(filled[-1], -1, "tied.png")
