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
from solver import mechanics

PVPYTHON, XVFB = shutil.which("pvpython"), shutil.which("xvfb-run")

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


CASE = """
[geometry]
layout = "arch"
[settlement]
direction = [1, 0]
increment = 0.02
limit = 0.3
[output]
animation = false
vtu = "{shape}"
"""

DATASETS = {
    "blocks": solver.Response.mesh,
    "contacts": solver.Response.contacts,
    "joints": solver.Response.joints,
}

WARP = """
import json, sys
from paraview.simple import OpenDataFile, WarpByVector, UpdatePipeline
told = []
for part in ("blocks", "joints", "contacts"):
    reader = OpenDataFile(f"{sys.argv[1]}/{part}.pvd")
    time = reader.TimestepValues[-1]
    UpdatePipeline(time, reader)
    warped = WarpByVector(Input=reader)
    UpdatePipeline(time, warped)
    bounds = [of.GetDataInformation().GetBounds() for of in (reader, warped)]
    told.append([time, list(warped.Vectors), *bounds])
print("TOLD" + json.dumps(told))
"""


def told_by(script, folder, tmp_path):
    """What a script of ParaView tells of a results folder."""
    path = tmp_path / "script.py"
    path.write_text(script, encoding="utf-8")
    done = subprocess.run([PVPYTHON, path, folder], capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr[-2000:]
    return json.loads(done.stdout.split("TOLD")[1])


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """The results of the reference arch, and the script that a run writes beside its own."""
    path = blockvis.write(arch_response(), tmp_path_factory.mktemp("results") / "out")
    case = structures.case_from(CASE.format(shape="moved"), path.parent)
    run = blockvis.run_case(case, path.parent / "run", film=False)
    shutil.copy(run.folder / "paraview_colours.py", path)
    return path


@pytest.mark.paraview
@pytest.mark.skipif(PVPYTHON is None, reason="pvpython is not installed (Debian: python3-paraview)")
def test_paraview_reads_every_increment_and_every_array(folder, tmp_path):
    told = told_by(READ, folder, tmp_path)
    response = arch_response()
    for part, dataset in DATASETS.items():
        assert len(told[part]) == len(response.path)
        for k, (_, cells, names) in enumerate(told[part]):
            ours = dataset(response, k)
            assert cells == ours.n_cells
            for kind, arrays in (("Cell", ours.cell_data), ("Point", ours.point_data), ("Field", ours.field_data)):
                assert set(names[kind]) == set(arrays.keys())
            assert names["Field"]["status"] == str(response.increments[k].status)
    assert told["blocks"][0][2]["Cell"]["name"] == response.assembly.names[-1]


@pytest.mark.paraview
@pytest.mark.skipif(PVPYTHON is None, reason="pvpython is not installed (Debian: python3-paraview)")
@pytest.mark.parametrize("shape", ["moved", "undeformed"])
def test_apply_and_the_first_warp_show_what_their_names_say(shape, tmp_path):
    case = tmp_path / "case.toml"
    case.write_text(CASE.format(shape=shape), encoding="utf-8")
    run = blockvis.run_case(case, tmp_path / "out", outputs=())
    response = run.response
    assembly = response.assembly
    corners = {
        "undeformed": assembly.vertices,
        "moved": mechanics.moved_vertices(assembly, response.path[-1].pose),
    }
    blocks, joints, contacts = told_by(WARP, run.folder, tmp_path)
    assert blocks[0] == pytest.approx(response.settlement[-1])
    applied, warped = (np.reshape(bounds, (3, 2))[:2].T for bounds in blocks[2:])
    np.testing.assert_allclose(applied, np.stack([corners[shape].min(axis=0), corners[shape].max(axis=0)]), atol=1e-6)
    vector = "displacement" if shape == "undeformed" else "mechanism"
    assert [told[1][1] for told in (blocks, joints, contacts)] == [vector] * 3
    if shape == "undeformed":
        moved = np.stack([corners["moved"].min(axis=0), corners["moved"].max(axis=0)])
        np.testing.assert_allclose(warped, moved, atol=1e-6)
    else:
        # On, away from the drawing.
        top = corners["undeformed"][:, 1].max()
        assert warped[1, 1] < applied[1, 1] - 0.01 < top - 0.01
    for _, _, _, (x0, x1, y0, y1, *_) in (joints, contacts):
        assert warped[0, 0] <= x0 + 1e-6 < x1 <= warped[1, 0] + 1e-6
        assert warped[0, 1] <= y0 + 1e-6 < y1 <= warped[1, 1] + 1e-6


@pytest.mark.paraview
@pytest.mark.skipif(PVPYTHON is None or XVFB is None, reason="pvpython or xvfb-run is not installed")
def test_paraview_script_runs(folder):
    run_with_display(folder / "paraview_colours.py")


@pytest.mark.paraview
@pytest.mark.skipif(PVPYTHON is None or XVFB is None, reason="pvpython or xvfb-run is not installed")
def test_paraview_script_shows_the_ties_that_are_there(tmp_path):
    case = '[geometry]\nlayout = "arch on piers"\n[[settlement]]\ndirection = [1, 0]\nlimit = 0.01\n'
    case += "[[settlement]]\ndirection = [1, 0]\nlimit = 0.01\n[[remove]]\nphase = 2\nties = ['low']\n"
    for name, height in (("high", 1.95), ("low", 1.45)):
        case += f'[[ties]]\nname = "{name}"\nfrom = [-1.3, {height}]\nto = [1.3, {height}]\nstiffness = 1e7\n'
    (tmp_path / "case.toml").write_text(case, encoding="utf-8")
    script = blockvis.run_case(tmp_path / "case.toml", tmp_path / "out", film=False).folder / "paraview_colours.py"
    told = '\nprint("TIES", FindSource("ties that are there and whole").GetDataInformation().GetNumberOfCells())\n'
    script.write_text(script.read_text(encoding="utf-8") + told, encoding="utf-8")
    assert "TIES 1" in run_with_display(script)


def run_with_display(script):
    """Give what a script of ParaView prints."""
    command = [XVFB, "-a", "-s", "-screen 0 800x600x24", PVPYTHON, script]
    environment = os.environ | {"LIBGL_ALWAYS_SOFTWARE": "1"}
    for _ in range(3):
        done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False, env=environment)
        # On a busy machine the display may not be there yet: ParaView gives up while it opens its window.
        if "vtkXOpenGLRenderWindow::CreateAWindow" not in done.stderr:
            break
    assert done.returncode == 0, done.stderr[-2000:]
    assert "ERR|" not in done.stderr, done.stderr[-2000:]
    assert "Traceback" not in done.stderr, done.stderr[-2000:]
    return done.stdout
