"""
From cracks to their cause
==========================

Two cracks and nine closed joints were noted on an arch. Which movement of its springers has opened them, and how far
has it gone? ``blockvis explain CASE.toml --observed cracks.csv`` does the same and writes a page.
"""

import shutil
import tempfile
from pathlib import Path

import blockvis

examples = Path("../../examples/explain")
print((examples / "cracks.csv").read_text())

# %%
# Every movement is followed once, for all of its amounts, and compared with what was seen.
with tempfile.TemporaryDirectory() as folder:
    found = blockvis.explain(examples / "arch.toml", examples / "cracks.csv", f"{folder}/out")
    shutil.copy(f"{folder}/out/explain.png", "explain.png")
print(found)

# %%
# The cracks were made by the solver, of 14 voussoirs where the case has 12, with other friction and with noise: the
# right springer had gone down by 18 mm.
best = found.causes[0]
assert best.name == "right springer moves down"
assert best.amount[0] < 0.018 < best.amount[2]
