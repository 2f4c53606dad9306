"""The walls between the two packages, and what `solver` may do."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


HEAVY = {
    "vtkmodules",
    "pyvista",
    "matplotlib",
    "imageio_ffmpeg",
    "PIL",
    "meshio",
    "trimesh",
    "ezdxf",
    "gmsh",
}
LIBRARIES = {"numpy", "scipy", "shapely", "highspy", "clarabel", "threadpoolctl"}
STUDIES = {"dask", "distributed", "pandas", "pyarrow", "SALib", "tomli_w"}


@pytest.mark.parametrize("first", [f"from blockvis.cli import main; main(['{word}'])" for word in ("--help", "laout")])
def test_help_waits_for_no_heavy_packages(first):
    code = f"""
import sys
try:
    {first}
except SystemExit:
    pass
print(sorted({{name.partition(".")[0] for name in sys.modules}} & {HEAVY | STUDIES | LIBRARIES}))
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "[]"


def test_solver_opens_no_file_and_prints_nothing():
    for path in (ROOT / "solver").rglob("*.py"):
        assert not re.search(r"(?<![\w.])(?:open|print)\(", path.read_text(encoding="utf-8")), path.name


def test_blockvis_uses_only_public_names_of_solver():
    import solver

    for path in (ROOT / "blockvis").rglob("*.py"):
        text = path.read_text(encoding="utf-8")
        imported = re.findall(r"(?m)^\s*from solver\.mechanics import (.+)$", text)
        assert {name for names in imported for name in names.split(", ")} <= {*solver.mechanics.__all__}, path.name
        for name in set(re.findall(r"(?<![\w.])solver\.([A-Za-z_]\w*)", text)):
            assert name in {*solver.__all__, "mechanics", "views"}, (path.name, name)
        for name in set(re.findall(r"(?<![\w.])mechanics\.([A-Za-z_]\w*)", text)):
            assert name in solver.mechanics.__all__, (path.name, name)
