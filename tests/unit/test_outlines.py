"""Cells to outlines, outlines to triangles: what the rings are, and what is refused."""

import meshio
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from structures import drawn

from blockvis import read_layout, write_layout

SQUARES = np.array([[x, y, 0.0] for y in range(4) for x in range(4)])


def cell(x, y):
    return [x + 4 * y, x + 1 + 4 * y, x + 1 + 4 * (y + 1), x + 4 * (y + 1)]


def rings_of(tmp_path, cells, blocks=None):
    """Outlines of cells of a mesh, of one block or of those that are numbered."""
    numbers = np.zeros(len(cells), int) if blocks is None else np.array(blocks)
    meshio.write(tmp_path / "a.vtu", meshio.Mesh(SQUARES, {"quad": cells}, cell_data={"block_id": [numbers]}))
    return read_layout(tmp_path / "a.vtu", unit="m").outlines


def area_of(ring):
    x, y = np.asarray(ring).T
    return float(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2.0


def test_outline_is_the_edges_used_once(tmp_path):
    (ring,) = rings_of(tmp_path, [cell(0, 0), cell(1, 0)[::-1], cell(0, 1)])
    assert area_of(ring) == pytest.approx(3.0)
    assert {tuple(p) for p in ring} == {(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)}


def test_cells_of_several_blocks_are_kept_apart(tmp_path):
    rings = rings_of(tmp_path, [cell(0, 0), cell(1, 0), cell(2, 0)], [1, 1, 0])
    assert [area_of(ring) for ring in rings] == [1.0, 2.0]
    assert all(len(ring) == 4 for ring in rings)


@pytest.mark.parametrize(
    ("cells", "words"),
    [
        ([cell(0, 0), cell(1, 1)], r"meets itself at \(1, 1\), where 4 of its edges end"),
        ([cell(0, 0), cell(0, 0)], "its cells are in the file twice"),
    ],
)
def test_cells_that_are_no_one_piece_are_refused(tmp_path, cells, words):
    with pytest.raises(ValueError, match=words):
        rings_of(tmp_path, cells)


@pytest.mark.thorough
def test_a_long_row_of_collinear_points_is_one_edge(tmp_path):
    n = 50_000
    ring = np.vstack([np.column_stack([np.linspace(0, 1, n), np.zeros(n)]), [[1, 1], [0, 1]]])
    assert len(read_layout(drawn(tmp_path / "a.json", [ring])).outlines[0]) == 4


@given(st.integers(3, 40), st.integers(0, 1000))
@settings(max_examples=20, deadline=None)
def test_triangles_fill_a_star_and_turn_as_it_does(tmp_path_factory, n, seed):
    generator = np.random.default_rng(seed)
    angle = 2 * np.pi * np.arange(n) / n
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=1) * generator.uniform(0.2, 1.0, (n, 1))
    folder = tmp_path_factory.mktemp("star")
    layout = read_layout(drawn(folder / "a.json", [ring]))
    write_layout(layout, folder / "a.msh")
    mesh = meshio.read(folder / "a.msh")
    cells = [corners for part in mesh.cells for corners in part.data]
    areas = [area_of(mesh.points[corners, :2]) for corners in cells]
    assert len(areas) == len(layout.outlines[0]) - 2 or {len(corners) for corners in cells} == {4}
    assert sum(areas) == pytest.approx(area_of(layout.outlines[0]), rel=1e-9)
    assert min(areas) > 0.0


def test_convex_quadrangles_stay_whole(tmp_path):
    quadrangles = [[0, 0], [1, 0], [1, 1], [0, 1]], [[2, 0], [4, 0], [2.5, 0.5], [2, 2]]
    write_layout(read_layout(drawn(tmp_path / "a.json", quadrangles)), tmp_path / "a.msh")
    assert sorted(len(c) for part in meshio.read(tmp_path / "a.msh").cells for c in part.data) == [3, 3, 4]
