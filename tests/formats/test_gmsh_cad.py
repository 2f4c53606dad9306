"""Geometry through gmsh: scripts and STEP, surfaces and volumes."""

import sys

import pytest

from blockvis.formats import gmsh_cad
from blockvis.formats.read import read, read_layout

gmsh = pytest.importorskip("gmsh", reason="gmsh is an extra", exc_type=(ImportError, OSError))
pytestmark = pytest.mark.cad


def test_script_with_arcs_becomes_chords_within_the_tolerance(tmp_path):
    (tmp_path / "a.geo").write_text(
        'SetFactory("OpenCASCADE"); Disk(1) = {0, 0, 0, 1}; Physical Surface("disc") = {1};\n'
    )
    coarse, fine = (read(tmp_path / "a.geo", chord_tolerance=t) for t in (1e-2, 1e-3))
    assert coarse.names == ("disc",)
    assert fine.areas[0] == pytest.approx(3.14159, rel=2e-3)
    assert len(fine.vertices) > 2 * len(coarse.vertices)


def test_solids_of_a_step_file(tmp_path):
    gmsh.initialize(["gmsh", "-nopopup"], interruptible=False)
    gmsh.option.setNumber("General.Terminal", 0)
    for k in range(3):
        gmsh.model.occ.addBox(1000 * k, 0, 0, 1000, 300, 250)
    gmsh.model.occ.synchronize()
    gmsh.write(str(tmp_path / "a.step"))
    gmsh.finalize()
    drawing = read_layout(tmp_path / "a.step")
    assert drawing.n_blocks == 3
    # STEP names its unit, here mm; the bodies share their planes along z and along y, and z comes first.
    assert read(tmp_path / "a.step").areas == pytest.approx([0.3] * 3)
    assert drawing.thickness == pytest.approx([0.25] * 3)


@pytest.mark.parametrize("line", ['SystemCall "touch /tmp/x";', 'Include "other.geo";', 'Printf("a") > "file";'])
def test_a_script_may_not_reach_out(tmp_path, line):
    (tmp_path / "a.geo").write_text(line)
    with pytest.raises(ValueError, match="which reaches beyond the file; run gmsh on it yourself"):
        read(tmp_path / "a.geo")


def test_a_script_without_end_is_stopped(tmp_path, monkeypatch):
    monkeypatch.setattr(gmsh_cad, "LONGEST_SECONDS", 2)
    (tmp_path / "a.geo").write_text("For i In {0 : 1e12}\n  x = i;\nEndFor\n")
    with pytest.raises(ValueError, match="gmsh did not finish within 2 s"):
        read(tmp_path / "a.geo")


def test_a_missing_library_names_the_packages(tmp_path, monkeypatch):
    (tmp_path / "gmsh.py").write_text("raise OSError('libGLU.so.1: cannot open shared object file')")
    (tmp_path / "a.geo").write_text("x = 1;")
    monkeypatch.setenv("PYTHONPATH", f"{tmp_path}:{':'.join(sys.path)}")
    with pytest.raises(ValueError, match=r"libGLU.so.1.*pip install 'blockvis\[cad\]'.*libglu1-mesa"):
        read(tmp_path / "a.geo")


def test_a_script_with_a_fault_gives_the_reason(tmp_path):
    (tmp_path / "a.geo").write_text("Plane Surface(1) = {77};")
    with pytest.raises(ValueError, match="cannot be read by gmsh"):
        read(tmp_path / "a.geo")
