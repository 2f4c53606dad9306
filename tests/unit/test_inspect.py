"""What ``blockvis info`` says of a file."""

import io
import re
import threading
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from structures import drawn, rectangle

import solver
from blockvis import inspect, read, save_layout
from blockvis.cli import main

FACADE = Path(__file__).resolve().parents[3] / "shared" / "data" / "facade" / "facade.dxf"


@pytest.fixture
def layout(tmp_path):
    square = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], dtype=float)
    outlines = [
        square,
        square + np.array([1.01, 0]),
        square + np.array([1.01, 0]),
        square + np.array([3, 0]),
        square + np.array([3.9, 0]),
    ]
    path = tmp_path / "wall.dxf"
    save_layout(solver.Assembly.from_outlines(outlines, names=list("abcde"), roles=["fixed", *["free"] * 4]), path)
    return path


def test_numbers(layout):
    found = inspect(layout)
    assert found.twins == ((1, 2),)
    assert [(i, j) for i, j, _ in found.overlapping] == [(3, 4)]
    assert found.overlapping[0][2] == pytest.approx(0.1)
    assert found.joint_thickness == pytest.approx(0.01)
    text = str(found)
    assert "5, 1 of them duplicates: 4 blocks" in text
    assert "d and e: 0.1 m, refused" in text
    assert 'joint_thickness = 0.01   (m, or "auto")' in text
    assert "c = b" in text
    assert re.search(r"roles +'free' 3, 'fixed' 1", text)


def test_a_file_that_takes_long_to_read_is_named_meanwhile(layout, monkeypatch):
    monkeypatch.setattr("blockvis.runs.progress.REDRAW", 0.001)
    monkeypatch.setattr("blockvis.runs.progress.LINES", 0.0)
    told = threading.Event()

    class Stream(io.StringIO):
        def write(self, words):
            if words.startswith(f"blockvis: reading {layout}, "):
                told.set()
            return super().write(words)

    def slowly(*given, **options):
        assert told.wait(timeout=60)
        return inspect(*given, **options)

    monkeypatch.setattr("blockvis.formats.read.inspect", slowly)
    monkeypatch.setattr("sys.stderr", Stream())
    assert main(["info", str(layout)]) == 0


@pytest.mark.parametrize(("gaps", "proposed"), [((0.0, 0.0, 0.02, 0.02), 0.0), ((0.0, 0.02, 0.04, 0.06), 0.02)])
@pytest.mark.slow
def test_a_crack_in_a_wall_whose_joints_touch_is_no_mortar(tmp_path, gaps, proposed):
    brick = np.array([[0, 0], [0.4, 0], [0.4, 0.2], [0, 0.2]])
    # Straight through all courses, or all head joints open on bed joints that touch.
    rings = [brick + np.array([0.4 * i + gaps[i], 0.2 * course]) for course in range(10) for i in range(4)]
    wall = drawn(tmp_path / "wall.json", rings)
    found = inspect(wall)
    assert found.joint_thickness == pytest.approx(proposed)
    assert ("proposed        nothing: gaps are 9." in str(found)) == (proposed == 0.0)
    assert main(["new", str(wall), "-o", str(tmp_path / "wall.toml")]) == 0
    written = '\njoint_thickness = "auto"' in (tmp_path / "wall.toml").read_text(encoding="utf-8")
    assert written == (proposed > 0.0)


def _running_bond(moved):
    """Outlines [m] of a wall, turned by 0.02; ``moved`` changes the brick i of a course, by i and the course."""
    turn = np.array([[np.cos(0.02), np.sin(0.02)], [-np.sin(0.02), np.cos(0.02)]])
    brick = np.array([[0, 0], [0.4, 0], [0.4, 0.2], [0, 0.2]])
    numbers = [(i, course) for course in range(10) for i in range(6)]
    return [moved(brick, i, c) @ turn + np.array([0.4 * i + 0.2 * (c % 2), 0.2 * c]) @ turn for i, c in numbers]


@pytest.mark.parametrize("digits", [4, 3, 12])
def test_a_crack_in_rounded_coordinates_is_no_joint(tmp_path, digits):
    rings = _running_bond(lambda brick, i, _: brick + np.array([0.02 * (i > 2), 0.0]))
    found = inspect(drawn(tmp_path / "wall.json", [np.round(ring, digits) for ring in rings]))
    assert found.joint_thickness == 0.0
    assert "most on one side of blocks only, as cracks and openings are; joint_thickness = 0.02" in str(found)


@pytest.mark.parametrize("digits", [4, 12])
def test_mortar_in_a_part_of_a_dry_wall_is_proposed(tmp_path, digits):
    inwards = np.array([[0.005, 0.005], [-0.005, 0.005], [-0.005, -0.005], [0.005, -0.005]])
    rings = _running_bond(lambda brick, i, course: brick + inwards * (1 < i < 4 and 3 < course < 6))
    found = inspect(drawn(tmp_path / "wall.json", [np.round(ring, digits) for ring in rings]))
    assert found.joint_thickness == pytest.approx(0.01, abs=1e-3)


@pytest.mark.parametrize("joint", [0.0, 0.01])
def test_a_gap_beside_a_pilaster_is_no_joint(tmp_path, joint):
    """It was closed by "auto", which moved both sides by half of it: it is wide, and on one side of its stones."""
    stones = [(x + 0.5 * (y % 2), y, 1.0) for y in range(9) for x in range(5)]
    stones += [(5.0 * (1 - y % 2), y, 0.5) for y in range(9)]
    pilaster = [(5.6, y, 0.6) for y in range(9)]
    half = joint / 2.0
    rings = [rectangle(x + half, 0.4 * y + half, x + w - half, 0.4 * (y + 1) - half) for x, y, w in stones + pilaster]
    wall = drawn(tmp_path / "wall.json", rings)
    assert inspect(wall).joint_thickness == pytest.approx(joint)
    closed = read(wall, joint_thickness="auto", roles={"block 0": "fixed"})
    assert closed.vertices[closed.block_of_vertex >= len(stones), 0].min() == pytest.approx(5.6 + half)


def test_picture(layout, tmp_path):
    path = tmp_path / "found.png"
    assert main(["info", str(layout), "--picture", str(path)]) == 0

    colours = {colour for _, colour in Image.open(path).convert("RGB").getcolors(1 << 24)}
    # A support, the duplicate and the overlap are there in their colours.
    assert {(206, 209, 213), (91, 143, 214), (214, 96, 91)} <= colours


def test_a_name_is_drawn_whatever_it_holds(tmp_path):
    square = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], dtype=float)
    layout = tmp_path / "named.json"
    save_layout(solver.Assembly.from_outlines([square], names=["$\\foo$"], roles=["free"]), layout)
    assert main(["info", str(layout), "--picture", str(tmp_path / "found.png")]) == 0


@pytest.mark.skipif(not FACADE.exists(), reason="third-party drawing, not part of the project")
@pytest.mark.slow
def test_facade():
    found = inspect(FACADE)
    assert found.layout.n_blocks == 1568
    assert len(found.twins) == 6
    assert any(note.startswith("unit clash: the file says its unit is in") for note in found.layout.notes)
    assert found.high - found.low == pytest.approx([5.97, 5.615])
    assert found.overlapping == ()
    assert np.median(found.joints.gaps) == pytest.approx(0.01, abs=1e-4)
    assert found.joint_thickness == pytest.approx(0.026)
