"""Finite-element meshes through meshio."""

import sys

import meshio
import numpy as np
import pytest

from blockvis import read, read_layout

POINTS = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [2, 0, 0], [2, 1, 0], [0.5, 0.5, 0]], dtype=float)


@pytest.mark.parametrize("suffix", [".inp", ".bdf", ".mesh", ".su2"])
def test_quadrangles_are_blocks(tmp_path, suffix):
    path = tmp_path / f"a{suffix}"
    points = POINTS[:6, : 2 if suffix == ".su2" else 3]
    meshio.write(path, meshio.Mesh(points, [("quad", [[0, 1, 2, 3], [1, 4, 5, 2]])]))
    assembly = read(path)
    assert assembly.areas == pytest.approx([1, 1], rel=1e-6)


def test_cell_sets_name_the_blocks(tmp_path):
    triangles = [[0, 1, 6], [1, 2, 6], [2, 3, 6], [3, 0, 6], [1, 4, 5], [1, 5, 2]]
    sets = {"left": [np.arange(4)], "right": [np.array([4, 5])]}
    meshio.write(tmp_path / "a.inp", meshio.Mesh(POINTS, [("triangle", triangles)], cell_sets=sets))
    drawing = read_layout(tmp_path / "a.inp")
    assert set(drawing.names) == {"left", "right"}
    assert sorted(len(ring) for ring in drawing.outlines) == [4, 4]


def test_groups_of_flac3d_name_the_blocks_and_their_roles(tmp_path):
    points = [[x, y, z] for z in range(3) for y in range(2) for x in range(2)]
    cells = [("hexahedron", [[0, 1, 3, 2, 4, 5, 7, 6]]), ("wedge", [[4, 5, 6, 8, 9, 10], [5, 7, 6, 9, 11, 10]])]
    none = np.zeros(0, int)
    sets = {"fixed base": [np.array([0]), none], "stone: top": [none, np.array([0, 1])]}
    meshio.write(tmp_path / "a.f3grid", meshio.Mesh(points, cells, cell_sets=sets))
    drawing = read_layout(tmp_path / "a.f3grid", dimension=3)
    assert drawing.names == ("fixed base", "stone: top")
    assert drawing.roles == ("fixed", "")
    np.testing.assert_allclose(drawing.volumes, 1.0)


def test_lines_are_no_blocks(tmp_path):
    meshio.write(tmp_path / "a.inp", meshio.Mesh(POINTS, [("line", [[0, 1]])]))
    with pytest.raises(ValueError, match="has no surface cells"):
        read(tmp_path / "a.inp")


def test_a_reader_that_leaves_the_program_is_held(tmp_path, monkeypatch):
    def leave(path):
        sys.stdout.write("unknown element")
        raise SystemExit(1)

    monkeypatch.setattr(meshio, "read", leave)
    (tmp_path / "a.inp").write_text("x", encoding="utf-8")
    with pytest.raises(ValueError, match=r"cannot be read by meshio as \.inp: 1; export it again"):
        read(tmp_path / "a.inp")
