"""The results opened with ParaView's own Python, where it is installed."""

import json
import os
import shutil
import subprocess

import numpy as np
import pytest
import structures
from structures import arch_response

import blockvis
import solver

PVPYTHON, XVFB = shutil.which("pvpython"), shutil.which("xvfb-run")

CASE = """
[geometry]
layout = "arch"
parameters = {voussoirs = 5}
[settlement]
direction = [1, 0]
increment = 0.01
limit = 0.02
"""

READ = """
import json, sys
from paraview.simple import OpenDataFile, UpdatePipeline
from paraview import servermanager
told = {}
for part in ("blocks", "contacts", "joints"):
    reader = OpenDataFile(f"{sys.argv[1]}/{part}.pvd")
    told[part] = []
    for time in reader.TimestepValues:
        UpdatePipeline(time, reader)
        data = servermanager.Fetch(reader)
        names = {}
        for kind in ("Cell", "Point", "Field"):
            arrays = getattr(data, f"Get{kind}Data")()
            found = [arrays.GetAbstractArray(i) for i in range(arrays.GetNumberOfArrays())]
            names[kind] = {a.GetName(): a.GetVariantValue(a.GetNumberOfValues() - 1).ToString() for a in found}
        told[part].append([time, data.GetNumberOfCells(), names])
print("TOLD" + json.dumps(told))
"""


DATASETS = {
    "blocks": solver.Response.mesh,
    "contacts": solver.Response.contacts,
    "joints": solver.Response.joints,
}

WARP = """
import json, sys
from paraview.simple import OpenDataFile, WarpByVector, UpdatePipeline
from paraview import servermanager
reader = OpenDataFile(f"{sys.argv[1]}/blocks.pvd")
time = reader.TimestepValues[12]
UpdatePipeline(time, reader)
warped = WarpByVector(Input=reader)
UpdatePipeline(time, warped)
data = servermanager.Fetch(warped)
print("TOLD" + json.dumps([list(warped.Vectors), [data.GetPoint(i)[:2] for i in range(data.GetNumberOfPoints())]]))
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """The results of the reference arch, and the script that a run writes beside its own."""
    path = blockvis.write(arch_response(), tmp_path_factory.mktemp("results") / "out")
    case = structures.case_from(CASE, path.parent)
    run = blockvis.run_case(case, path.parent / "run", film=False)
    shutil.copy(run.folder / "paraview_colours.py", path)
    return path


@pytest.mark.paraview
@pytest.mark.skipif(PVPYTHON is None, reason="pvpython is not installed (Debian: python3-paraview)")
def test_paraview_reads_every_increment_and_every_array(folder, tmp_path):
    script = tmp_path / "read.py"
    script.write_text(READ, encoding="utf-8")
    done = subprocess.run([PVPYTHON, script, folder], capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr[-2000:]
    told = json.loads(done.stdout.split("TOLD")[1])
    response = arch_response()
    for part, dataset in DATASETS.items():
        assert len(told[part]) == len(response.increments)
        for k, (_, cells, names) in enumerate(told[part]):
            ours = dataset(response, k)
            assert cells == ours.n_cells
            for kind, arrays in (("Cell", ours.cell_data), ("Point", ours.point_data), ("Field", ours.field_data)):
                assert set(names[kind]) == set(arrays.keys())
            assert names["Field"]["status"] == str(response.increments[k].status)
    assert told["blocks"][0][2]["Cell"]["name"] == response.assembly.names[-1]


@pytest.mark.paraview
@pytest.mark.skipif(PVPYTHON is None, reason="pvpython is not installed (Debian: python3-paraview)")
def test_warp_by_vector_as_it_comes_does_not_move_the_blocks_twice(folder, tmp_path):
    script = tmp_path / "warp.py"
    script.write_text(WARP, encoding="utf-8")
    done = subprocess.run([PVPYTHON, script, folder], capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr[-2000:]
    (_, vector), points = json.loads(done.stdout.split("TOLD")[1])
    assert vector == "to_reference"
    np.testing.assert_allclose(points, arch_response().assembly.vertices, atol=1e-6)


@pytest.mark.paraview
@pytest.mark.skipif(PVPYTHON is None or XVFB is None, reason="pvpython or xvfb-run is not installed")
def test_paraview_script_runs(folder, tmp_path):
    command = [XVFB, "-a", "-s", "-screen 0 800x600x24", PVPYTHON, folder / "paraview_colours.py"]
    environment = os.environ | {"LIBGL_ALWAYS_SOFTWARE": "1"}
    for _ in range(3):
        done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False, env=environment)
        # On a busy machine the display may not be there yet: ParaView gives up while it opens its window.
        if "vtkXOpenGLRenderWindow::CreateAWindow" not in done.stderr:
            break
    assert done.returncode == 0, done.stderr[-2000:]
    assert "ERR|" not in done.stderr, done.stderr[-2000:]
    assert "Traceback" not in done.stderr, done.stderr[-2000:]
