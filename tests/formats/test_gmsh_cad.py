"""Geometry through gmsh: scripts and STEP, surfaces and volumes."""

import gc
import math
import re
import warnings

import numpy as np
import pytest
import shapely

from blockvis import read, read_layout

gmsh = pytest.importorskip("gmsh", reason="gmsh is an extra", exc_type=(ImportError, OSError))
pytestmark = pytest.mark.cad


def test_script_with_arcs_becomes_chords_within_the_tolerance(tmp_path):
    (tmp_path / "a.geo").write_text(
        'SetFactory("OpenCASCADE"); Disk(1) = {0, 0, 0, 1}; Physical Surface("disc") = {1};\n',
        encoding="utf-8",
    )
    coarse, fine = (read(tmp_path / "a.geo", chord_tolerance=t) for t in (1e-2, 1e-3))
    assert coarse.names == ("disc",)
    assert fine.areas[0] == pytest.approx(3.14159, rel=2e-3)
    assert len(fine.vertices) > 2 * len(coarse.vertices)


def test_solids_of_a_step_file(tmp_path):
    step(tmp_path)
    drawing = read_layout(tmp_path / "a.step")
    assert drawing.n_blocks == 3
    # STEP names its unit, here mm; the bodies share their planes along z and along y, and z comes first.
    assert read(tmp_path / "a.step").areas == pytest.approx([0.3] * 3)
    assert drawing.thickness == pytest.approx([0.25] * 3)


@pytest.mark.parametrize("line", ['SystemCall "touch /tmp/x";', 'Include "other.geo";', 'Printf("a") > "file";'])
def test_a_script_may_not_reach_out(tmp_path, line):
    (tmp_path / "a.geo").write_text(line, encoding="utf-8")
    with pytest.raises(ValueError, match="which reaches beyond the file; run gmsh on it yourself"):
        read(tmp_path / "a.geo")


def test_a_script_without_end_is_stopped(tmp_path, monkeypatch):
    monkeypatch.setattr("blockvis.formats.gmsh_cad.LONGEST_SECONDS", 2)
    (tmp_path / "a.geo").write_text("For i In {0 : 1e12}\n  x = i;\nEndFor\n", encoding="utf-8")
    with pytest.raises(ValueError, match="gmsh did not finish within 2 s"):
        read(tmp_path / "a.geo")


def test_a_missing_library_names_the_packages(tmp_path, monkeypatch):
    (tmp_path / "gmsh.py").write_text("raise OSError('libGLU.so.1: cannot open shared object file')", encoding="utf-8")
    (tmp_path / "a.geo").write_text("x = 1;", encoding="utf-8")
    monkeypatch.syspath_prepend(str(tmp_path))
    with pytest.raises(ValueError, match=r"libGLU.so.1.*pip install 'blockvis\[cad\]'.*libglu1-mesa"):
        read(tmp_path / "a.geo")


def test_a_script_with_a_fault_gives_the_reason(tmp_path):
    (tmp_path / "a.geo").write_text("Plane Surface(1) = {77};", encoding="utf-8")
    with pytest.raises(ValueError, match="cannot be read by gmsh"):
        read(tmp_path / "a.geo")


def step(tmp_path, size=1000, unit=".MILLI.", draw=None):
    """Three boxes, or what else is drawn, in a STEP file that states a unit; the numbers stay as they are."""
    gmsh.initialize(["gmsh", "-nopopup"], interruptible=False)
    gmsh.option.setNumber("General.Terminal", 0)
    if draw:
        draw(gmsh.model.occ)
    else:
        for k in range(3):
            gmsh.model.occ.addBox(size * k, 0, 0, size, 0.3 * size, 0.25 * size)
    gmsh.model.occ.synchronize()
    path = tmp_path / "a.step"
    gmsh.write(str(path))
    gmsh.finalize()
    text = path.read_text(encoding="utf-8")
    assert "SI_UNIT(.MILLI.,.METRE.)" in text
    path.write_text(text.replace("SI_UNIT(.MILLI.,.METRE.)", f"SI_UNIT({unit},.METRE.)"), encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("stated", "asked", "metres"),
    [
        (".MILLI.", None, 1e-3),
        (".MILLI.", "m", 1.0),
        (".MILLI.", "cm", 1e-2),
        (".MILLI.", "mm", 1e-3),
        (".CENTI.", None, 1e-2),
        (".CENTI.", "mm", 1e-3),
        ("$", None, 1.0),
    ],
)
def test_the_unit_of_a_step_file_and_the_one_asked_for(tmp_path, stated, asked, metres):
    size = 1000 if metres < 1.0 or asked else 1
    path = step(tmp_path, size, stated)
    assert read(path, unit=asked, view="xy").areas == pytest.approx([0.3 * (size * metres) ** 2] * 3)
    assert read_layout(path, unit=asked, view="xy").thickness == pytest.approx([0.25 * size * metres] * 3)
    assert read_layout(path, unit=asked).names == ("volume 1", "volume 2", "volume 3")


def test_no_file_stays_open(tmp_path):
    path = step(tmp_path)
    gc.collect()
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always", ResourceWarning)
        read_layout(path)
        gc.collect()
    assert [str(one.message) for one in told if one.category is ResourceWarning] == []


def test_what_is_left_out_of_a_step_file_is_in_its_unit(tmp_path):
    def wall(occ):
        occ.cut([(2, occ.addRectangle(0, 0, 0, 1, 0.5))], [(2, occ.addRectangle(0.4, 0.2, 0, 0.2, 0.1))])
        occ.addRectangle(2, 0, 0, 1, 0.5)

    layout = read_layout(step(tmp_path, unit="$", draw=wall))
    (face,) = layout.left_out
    assert np.ptp(face.points, axis=0) == pytest.approx([1.0, 0.5])
    assert np.ptp(face.holes[0], axis=0) == pytest.approx([0.2, 0.1])
    assert any("an outline of 0.5 m²" in note and "1 opening, 0.48 m²" in note for note in layout.notes)


def test_faces_that_are_bent_both_ways_keep_their_bulge(tmp_path):
    """By their outlines alone a hemisphere has lost a third of its volume, and a sphere crashed gmsh."""

    def stones(occ):
        occ.addSphere(0, 0, 0, 300, angle1=0.0)
        occ.addSphere(2000, 0, 0, 300)

    path = step(tmp_path, draw=stones)
    layout = read_layout(path)
    exact = np.array([2.0, 4.0]) / 3.0 * math.pi * 0.3**3
    off = layout.volumes / exact - 1.0
    assert ((off > -0.04) & (off < 0.0)).all()
    assert read(path, only="volume 1").centroids[0] == pytest.approx([0.0, 0.0, 0.1125], abs=0.002)
    (told,) = (
        re.search(r"volume of 2 of 2 blocks is off by up to (-\S+) %", note)
        for note in layout.notes
        if "off by" in note
    )
    assert told is not None
    assert float(told[1]) == pytest.approx(100.0 * off.min(), rel=0.05)


def test_the_volume_of_a_round_stone_is_compared_with_that_of_the_file(tmp_path):
    layout = read_layout(step(tmp_path, draw=lambda occ: occ.addCylinder(0, 0, 0, 0, 0, 400, 300)), dimension=3)
    off = layout.volumes[0] / (math.pi * 0.3**2 * 0.4) - 1.0
    assert any(f"off by up to {100.0 * off:+.2g} %" in note for note in layout.notes)


def test_a_crash_of_gmsh_is_told_as_one(tmp_path, monkeypatch):
    (tmp_path / "gmsh.py").write_text("import os; os.kill(os.getpid(), 9)", encoding="utf-8")
    (tmp_path / "a.geo").write_text("x = 1;", encoding="utf-8")
    monkeypatch.syspath_prepend(str(tmp_path))
    with pytest.raises(ValueError, match=r"gmsh crashed on it without a word.*give the .msh"):
        read(tmp_path / "a.geo")


def test_a_closed_surface_without_a_volume_is_a_body(tmp_path):
    """As surface modellers export it."""

    def shell(occ):
        box = occ.addBox(0, 0, 0, 1, 0.5, 0.3)
        occ.synchronize()
        occ.remove([(3, box)])

    layout = read_layout(step(tmp_path, unit="$", draw=shell), dimension=3)
    assert layout.volumes == pytest.approx([0.15])


def test_a_step_file_in_mm_with_the_numbers_of_metres(tmp_path):
    """Gmsh writes mm whatever the numbers mean."""
    path = step(tmp_path, size=1)
    with pytest.warns(UserWarning, match=r"unit clash: the file says its unit is mm, .* m was assumed"):
        assert read(path).areas == pytest.approx([0.3] * 3)


CURVES = """
Point(1) = {0, 0, 0, 1e-3}; Point(2) = {1, 0, 0, 1e-3}; Point(3) = {0, 1, 0, 1e-3};
Line(1) = {1, 2}; Circle(2) = {2, 1, 3}; Line(3) = {3, 1};
Curve Loop(1) = {1, 2, 3}; Plane Surface(1) = {1};
Point(11) = {3, 0, 0}; Point(12) = {5, 0, 0}; Point(13) = {3, 1, 0};
Line(11) = {11, 12}; Ellipse(12) = {12, 11, 12, 13}; Line(13) = {13, 11};
Curve Loop(11) = {11, 12, 13}; Plane Surface(11) = {11};
Point(21) = {7, 0, 0}; Point(22) = {8, 0, 0}; Point(23) = {8, 1, 0}; Point(24) = {7.5, 1.5, 0}; Point(25) = {7, 1, 0};
Line(21) = {21, 22}; Line(22) = {22, 23}; Bezier(23) = {23, 24, 25}; Line(24) = {25, 21};
Curve Loop(21) = {21, 22, 23, 24}; Plane Surface(21) = {21};
Point(33) = {9, 1, 0}; Point(34) = {9.5, 1.5, 0}; Point(35) = {10, 1, 0}; Point(36) = {9.5, 0, 0};
Spline(31) = {33, 34, 35}; BSpline(32) = {35, 36, 33};
Curve Loop(31) = {31, 32}; Plane Surface(31) = {31};
Physical Surface("stone") = {1, 11, 21, 31};
"""


def test_curves_of_the_built_in_kernel(tmp_path):
    """Sizes from curvature took gmsh 40 s and 2.7 GB for one quarter circle."""
    (tmp_path / "a.geo").write_text(CURVES, encoding="utf-8")
    layout = read_layout(tmp_path / "a.geo")
    assert layout.groups == ("stone",) * 4
    areas = [shapely.Polygon(ring).area for ring in layout.outlines]
    # A quarter circle, a quarter ellipse, a square and the segment of a parabola: two thirds of 1 × 0.25.
    assert areas[:3] == pytest.approx([math.pi / 4, math.pi / 2, 1 + 2 / 3 * 0.25], rel=2e-3)
    assert all(10 < len(ring) < 200 for ring in layout.outlines)
    radii = np.hypot(*layout.outlines[0].T)
    assert sorted(np.round(radii, 9))[1:] == pytest.approx([1.0] * (len(radii) - 1))


def test_transfinite_surfaces_and_fields_of_the_script_are_not_in_the_way(tmp_path):
    (tmp_path / "a.geo").write_text(
        CURVES + "Transfinite Curve {21, 22, 23, 24} = 400; Transfinite Surface {21}; Recombine Surface {21};\n"
        "Field[1] = MathEval; Field[1].F = '0.0005'; Background Field = 1;\n",
        encoding="utf-8",
    )
    # Corners of the curve go within 0.0099 m, the tolerance for outlines that are finer than needed.
    assert read(tmp_path / "a.geo").areas[2] == pytest.approx(1 + 2 / 3 * 0.25, abs=0.0099 / 2)


def test_a_script_that_asks_for_too_much_memory_is_stopped(tmp_path, monkeypatch):
    monkeypatch.setattr("blockvis.formats.gmsh_cad.MOST_MEMORY", 150 * 2**20)
    # As on a machine of many processors: what their threads map is not the file's.
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "64")
    (tmp_path / "a.geo").write_text(CURVES, encoding="utf-8")
    assert read(tmp_path / "a.geo").n_blocks == 4
    (tmp_path / "b.geo").write_text("For i In {0 : 3e7}\n  Point(i + 1) = {i, 0, 0};\nEndFor\n", encoding="utf-8")
    with pytest.raises(ValueError, match=r"b.geo': gmsh .* 0.146 GiB of memory.*; run gmsh on it yourself"):
        read(tmp_path / "b.geo")


def test_messages_name_the_file_and_no_other(tmp_path):
    (tmp_path / "a.geo").write_text("Point(1) = {0, 0, 0}; Point(2) = {1, 0, 0}; Line(1) = {1, 2};", encoding="utf-8")
    with pytest.raises(ValueError, match=r"a.geo' has no surface cells") as problem:
        read(tmp_path / "a.geo")
    assert "found.msh" not in str(problem.value)


def test_extruded_and_recombined_volumes(tmp_path):
    (tmp_path / "a.geo").write_text(
        "Point(1) = {0, 0, 0}; Point(2) = {1, 0, 0}; Point(3) = {1, 1, 0}; Point(4) = {0, 1, 0};\n"
        "Line(1) = {1, 2}; Line(2) = {2, 3}; Line(3) = {3, 4}; Line(4) = {4, 1};\n"
        "Curve Loop(1) = {1, 2, 3, 4}; Plane Surface(1) = {1}; Transfinite Surface {1}; Recombine Surface {1};\n"
        "Extrude {0, 0, 0.5} { Surface{1}; Layers{2}; Recombine; }\n",
        encoding="utf-8",
    )
    layout = read_layout(tmp_path / "a.geo", view="xz")
    assert layout.thickness == pytest.approx([1.0])
    assert read(tmp_path / "a.geo", view="xz").areas == pytest.approx([0.5])
