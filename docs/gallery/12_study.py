"""
Study: friction that nobody knows
=================================

Six runs of an arch whose friction coefficient is drawn from a normal distribution. ``blockvis sweep STUDY.toml``
makes them on all cores and writes a table, a summary and pictures.
"""

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import pandas as pd

folder = Path(tempfile.mkdtemp())
(folder / "study.toml").write_text("""
[study.case]
geometry = { layout = "arch" }
settlement = { direction = [1.0, 0.0], increment = 0.05, tolerance = 0.002, limit = 0.5 }
[study]
method = "latin hypercube"
runs = 6
seed = 1
[parameters]
"material.friction_coefficient" = { distribution = "normal", mean = 0.5, deviation = 0.1, lower = 0.38 }
""")
command = [sys.executable, "-m", "blockvis", "sweep", "study.toml", "-o", "study"]
print(subprocess.run(command, check=True, capture_output=True, text=True, cwd=folder).stdout.splitlines()[0])

# %%
# The table has a row for each run; a run is given by the study and its number alone.
table = pd.read_csv(folder / "study" / "table.csv")
print(table[["status", "collapse_displacement"]].to_string())
assert len(table) == 6
collapsed = table[table["status"] == "collapsed"]
assert len(collapsed) >= 5
assert collapsed["collapse_displacement"].between(0.0, 0.142).all()

# %%
# Probability of collapse against the spread of the springer.
shutil.copy(folder / "study" / "fragility.png", "fragility.png")
shutil.rmtree(folder)
