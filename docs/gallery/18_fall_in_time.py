"""
The fall in time
================

Behind the last equilibrium statics has nothing to say; rigid-body dynamics without restitution
goes on from there.
"""

import tempfile

from PIL import Image

import solver
from blockvis import generators
from blockvis.dynamics.fall import fall_of

arch = generators.arch(thickness_ratio=0.15, voussoirs=12)
response = solver.Structure(arch, friction_coefficient=0.6).settle((1, 0))
fall = fall_of(response)
print(f"{fall.times[-1]:.2f} s until all rest")
assert 0.5 < fall.times[-1] <= 4.0
assert fall.positions[-1, arch.free, 1].max() < 0.6  # the crown stood at 1 m

# %%
# A film shows it in real time and says what it is. Two of its frames, on the way and at the end:
with tempfile.TemporaryDirectory() as folder:
    film = response.animate(f"{folder}/fall.gif", size=(800, 450), fps=10, seconds=1, fall=fall)
    frames = Image.open(film)
    for name, number in (("falling.png", frames.n_frames * 2 // 5), ("rubble.png", frames.n_frames - 1)):
        frames.seek(number)
        frames.convert("RGB").save(name)
