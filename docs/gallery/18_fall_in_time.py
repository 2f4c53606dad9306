"""
The fall in time
================

Behind the last equilibrium statics has nothing to say; rigid-body dynamics without restitution, by pymunk,
goes on from there.
"""

import shutil
import tempfile
from pathlib import Path

from PIL import Image

import blockvis
import solver
from blockvis import generators
from blockvis.dynamics.fall import fall_of

arch = generators.arch(thickness_ratio=0.15, voussoirs=12)
spread = solver.Settlement(direction=(1, 0), increment=0.02, limit=0.5)
response = solver.Structure(arch, friction_coefficient=0.6).settle(spread)
fall = fall_of(response)
print(f"{fall.times[-1]:.2f} s until all rest")
assert 0.5 < fall.times[-1] <= 4.0
assert fall.positions[-1, arch.free, 1].max() < 0.6  # the crown stood at 1 m

# %%
# A film shows it in real time and says what it is. Two of its frames, on the way and at the end:
film = Path(tempfile.mkdtemp()) / "fall.gif"
blockvis.animate(response, film, size=(800, 450), fps=10, seconds=1, fall=fall)
with Image.open(film) as frames:
    for name, number in (("falling.png", frames.n_frames * 2 // 5), ("rubble.png", frames.n_frames - 1)):
        frames.seek(number)
        frames.convert("RGB").save(name)
shutil.rmtree(film.parent)
