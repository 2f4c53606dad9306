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


def test_stones_of_one_set_that_touch_are_blocks_whichever_corner_comes_first(tmp_path):
    """A stone on another is no hole in it; of a set, as of one in space, each connected piece is a block."""
    corners = [(0, 0), (1, 0), (1, 0.3), (0, 0.3), (0.3, 0.7), (0.3, 0.3), (0.7, 0.3), (0.7, 0.7)]
    corners += [(0.2, 0.7), (0.8, 0.7), (0.8, 1.1), (0.2, 1.1)]
    sets = {"fixed ground": [np.array([0])], "stones": [np.array([1, 2])]}
    mesh = meshio.Mesh(np.array([(x, y, 0.0) for x, y in corners]), [("quad", np.arange(12).reshape(3, 4))])
    for cells in (mesh.cells, [("quad", np.array([[0, 1, 2, 3], [5, 6, 7, 4], [8, 9, 10, 11]]))]):
        meshio.write(tmp_path / "a.inp", meshio.Mesh(mesh.points, cells, cell_sets=sets))
        layout = read_layout(tmp_path / "a.inp")
        assert (layout.n_blocks, layout.roles, layout.left_out) == (3, ("fixed", "", ""), ())
    meshio.write(tmp_path / "a.vtu", meshio.Mesh(mesh.points, cells, cell_data={"block_id": [np.array([0, 1, 1])]}))
    with pytest.raises(ValueError, match="'block 1' is in 2 separate pieces"):
        read_layout(tmp_path / "a.vtu")
    entities = {"CellEntityIds": [np.array([1, 5, 5])]}
    meshio.write(tmp_path / "b.vtu", meshio.Mesh(mesh.points, cells, cell_data=entities))
    assert read_layout(tmp_path / "b.vtu").names == ("block 1", "block 5 1", "block 5 2")


def test_stones_of_one_set_that_touch_at_a_corner_only_are_blocks(tmp_path):
    """A stack bond of two materials, like a chess board; of cells with a node between others no stone is cut in two."""
    grid = np.arange(20).reshape(4, 5)
    points = [(x, 0.5 * y, 0.0) for y in range(4) for x in range(5)]
    quads = np.stack([grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1]], axis=-1).reshape(-1, 4)
    materials = (np.indices((3, 4)).sum(axis=0) % 2 + 1).ravel()
    triangles = quads[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3)
    for kind, cells in (("quad", quads), ("triangle", triangles)):
        values = np.repeat(materials, len(cells) // len(quads))
        meshio.write(tmp_path / "a.vtu", meshio.Mesh(points, [(kind, cells)], cell_data={"medit:ref": [values]}))
        layout = read_layout(tmp_path / "a.vtu")
        assert layout.n_blocks == 12
        assert (layout.sizes**2).tolist() == pytest.approx([0.5] * 12)
        assert layout.names[:3] == ("block 1 1", "block 1 2", "block 1 3")
    white = triangles.reshape(-1, 2, 3)[materials == 1].reshape(-1, 3)
    meshio.write(tmp_path / "b.vtu", meshio.Mesh(points, [("triangle", white)]))
    assert read_layout(tmp_path / "b.vtu").n_blocks == 6
    hanging = [(0, 0), (2, 0), (2, 1), (1, 1), (0, 1), (2, 2), (1, 2), (0, 2), (4, 0), (4, 1)]
    cells = [("quad", np.array([[0, 1, 2, 4], [4, 3, 6, 7], [3, 2, 5, 6], [1, 8, 9, 2]]))]
    points = [(x, y, 0.0) for x, y in hanging]
    meshio.write(tmp_path / "c.vtu", meshio.Mesh(points, cells, cell_data={"medit:ref": [np.array([1, 1, 1, 2])]}))
    with pytest.raises(ValueError, match="'block 1' meets itself"):
        read_layout(tmp_path / "c.vtu")


QUADS = np.array([[0, 1, 2, 3], [1, 4, 5, 2], [4, 6, 7, 5]])
CORNERS = np.array([[x, y, 0.0] for x, y in ((0, 0), (1, 0), (1, 1), (0, 1), (2, 0), (2, 1), (4, 0), (4, 1))])


def test_sets_of_flat_cells_name_roles(tmp_path):
    sets = {name: [np.array([k])] for k, name in enumerate(("fixed base", "stone", "moving.001"))}
    meshio.write(tmp_path / "a.inp", meshio.Mesh(CORNERS, [("quad", QUADS)], cell_sets=sets))
    assert read_layout(tmp_path / "a.inp").roles == ("fixed", "", "moving")


def test_groups_of_med_name_the_blocks_and_their_roles(tmp_path, monkeypatch):
    mesh = meshio.Mesh(CORNERS, [("quad", QUADS)], cell_data={"cell_tags": [np.array([-1, -2, -3])]})
    mesh.cell_tags = {-1: ["fixed base", "wall"], -2: ["stone", "wall"], -3: ["moving b"]}
    # h5py, by which meshio reads .med, is no dependency.
    monkeypatch.setattr(meshio, "read", lambda path: mesh)
    (tmp_path / "a.med").write_text("HDF", encoding="utf-8")
    layout = read_layout(tmp_path / "a.med")
    assert layout.names == ("fixed base", "stone", "moving b")
    assert layout.groups == ("wall", "wall", "")
    assert layout.roles == ("fixed", "", "moving")


@pytest.mark.parametrize(("suffix", "areas"), [(".exo", [2, 2]), (".e", [2, 2]), (".xdmf", [1, 1, 2])])
def test_element_blocks_of_exodus_are_blocks(tmp_path, monkeypatch, suffix, areas):
    mesh = meshio.Mesh(CORNERS, [("quad", QUADS[:2]), ("quad", QUADS[2:])])
    monkeypatch.setattr(meshio, "read", lambda path: mesh)
    (tmp_path / f"a{suffix}").write_text("CDF", encoding="utf-8")
    assert read(tmp_path / f"a{suffix}").areas == pytest.approx(areas)


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
    with pytest.raises(ValueError, match=r"cannot be read by meshio as \.inp: unknown element; export it again"):
        read(tmp_path / "a.inp")


def strip(tail, *, nodes_in="*NODE", cells_in="*ELEMENT, TYPE=S3"):
    """Four squares side by side, of the triangles 1 to 8, in an .inp file; its nodes are in two lists."""
    corners = [f"{2 * i + j + 1}, {i}., {j}., 0." for i in range(5) for j in range(2)]
    triangles = [three for a in (1, 3, 5, 7) for three in ((a, a + 2, a + 3), (a, a + 3, a + 1))]
    cells = [f"{k + 1}, {a}, {b}, {c}" for k, (a, b, c) in enumerate(triangles)]
    lines = ["*HEADING", "*NODE", *corners[:5], "** more", nodes_in, *corners[5:]]
    return "\n".join([*lines, cells_in, *cells[:3], "** more", *cells[3:], tail, ""])


STONES = """*ELSET, ELSET=fixed
1, 2
*ELSET, ELSET=a, GENERATE
3, 4, 1
*ELSET, ELSET=b
5,
6
*ELSET, ELSET=c, internal, generate
7, 8"""


@pytest.mark.parametrize(
    ("tail", "groups", "note"),
    [
        (STONES, ("", "", "", ""), "one block per value of the cell array"),
        (f"{STONES}\n*ELSET, ELSET=all\nfixed, a\nb, c", ("", "", "", ""), "one block per value of the cell array"),
        (
            f"{STONES}\n*ELSET, ELSET=section\na, b",
            ("", "section", "section", ""),
            "one block per value of the cell array",
        ),
        (f"{STONES}\n*ELSET, ELSET=moving\nc", ("", "", "", "moving"), "one block per value of the cell array"),
        (f"{STONES}\n*ELSET, ELSET=_loaded\n2, 4", ("", "", "", ""), "the cell sets '_loaded' were not used: they cut"),
    ],
)
def test_cell_sets_may_hold_each_other(tmp_path, tail, groups, note):
    (tmp_path / "a.inp").write_text(strip(tail), encoding="utf-8")
    drawing = read_layout(tmp_path / "a.inp")
    assert drawing.names == ("fixed", "a", "b", "c")
    assert drawing.groups == groups
    assert drawing.sizes == pytest.approx([1.0] * 4)
    assert any(note in said for said in drawing.notes)


def test_cell_sets_that_hold_no_cell_once_are_told(tmp_path):
    (tmp_path / "a.inp").write_text(strip("*ELSET, ELSET=fixed\n1, 2"), encoding="utf-8")
    with pytest.warns(UserWarning, match="the cell sets 'fixed' were not used: no choice of them holds every cell"):
        assert read(tmp_path / "a.inp").n_blocks == 1


def test_cell_sets_of_gmsh_are_its_surfaces_and_groups(tmp_path):
    text = strip(
        "*ELEMENT, TYPE=S4, ELSET=Surface2\n9, 9, 11, 12, 10\n*NODE\n11, 5., 0., 0.\n12, 5., 1., 0.\n"
        "*ELEMENT, TYPE=S3, ELSET=Surface2\n10, 11, 13, 12\n*NODE\n13, 6., 0., 0.\n*ELSET, ELSET=moving\n9, 10",
        cells_in="*ELEMENT, TYPE=S3, ELSET=Surface1",
    )
    (tmp_path / "a.inp").write_text(text, encoding="utf-8")
    drawing = read_layout(tmp_path / "a.inp")
    assert drawing.names == ("Surface1", "moving")
    assert read(tmp_path / "a.inp").areas == pytest.approx([4.0, 1.5])


@pytest.mark.parametrize(
    "text",
    [
        strip("", nodes_in="*End Part\n*Part, name=b\n*Node\n1, 7., 7., 7."),
        strip("*Assembly\n*Instance, name=a-1, part=a\n*End Instance\n*Instance, name=a-2, part=a"),
        strip("*Assembly\n*Instance, name=a-1, part=a\n 0., 0., 0.5\n*End Instance"),
    ],
)
def test_parts_and_instances_of_abaqus_are_refused(tmp_path, text):
    (tmp_path / "a.inp").write_text(text, encoding="utf-8")
    with pytest.raises(ValueError, match=r"a\.inp' is written in parts .*'Do not use parts and assemblies in input"):
        read(tmp_path / "a.inp")


def test_cells_that_are_there_twice_are_refused(tmp_path):
    points = [[x, y, z] for z in (0, 1) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))]
    meshio.write(tmp_path / "a.inp", meshio.Mesh(points, [("hexahedron", [list(range(8))] * 2)]))
    with pytest.raises(ValueError, match=r"a\.inp': body 'block' has no surface, as of cells that are there twice"):
        read(tmp_path / "a.inp")


@pytest.mark.parametrize(
    ("suffix", "key"), [(".bdf", "nastran:ref"), (".vol", "netgen:index"), (".avs", "avsucd:material")]
)
def test_references_number_the_blocks(tmp_path, suffix, key):
    points = np.array([[x, y, z] for x in range(3) for y, z in ((0, 0), (1, 0), (1, 1), (0, 1))], dtype=float)
    cells = [list(range(8)), list(range(4, 12))]
    meshio.write(tmp_path / f"a{suffix}", meshio.Mesh(points, [("hexahedron", cells)], cell_data={key: [[1, 2]]}))
    assert read_layout(tmp_path / f"a{suffix}").names == ("block 1", "block 2")


def test_nastran_without_its_first_line(tmp_path):
    meshio.write(tmp_path / "a.bdf", meshio.Mesh(POINTS[:6], [("quad", [[0, 1, 2, 3], [1, 4, 5, 2]])]))
    text = (tmp_path / "a.bdf").read_text(encoding="utf-8")
    # As gmsh writes it.
    (tmp_path / "b.bdf").write_text(text.replace("BEGIN BULK\n", ""), encoding="utf-8")
    assert read(tmp_path / "b.bdf").areas == pytest.approx([1, 1], rel=1e-6)


@pytest.mark.parametrize("ends", [b"\nEnd Nodes", b"\nEnd Elements"])
def test_kratos_file_without_its_ends_is_refused(tmp_path, ends):
    """For the end of a table meshio waited for ever."""
    quads = np.array([[0, 1, 2, 3], [1, 4, 5, 2]])
    meshio.write(tmp_path / "a.mdpa", meshio.Mesh(POINTS[:6], [("quad", quads)]))
    assert read(tmp_path / "a.mdpa").areas == pytest.approx([1, 1], rel=1e-6)
    data = (tmp_path / "a.mdpa").read_bytes()
    assert ends in data
    (tmp_path / "b.mdpa").write_bytes(data[: data.index(ends)])
    with pytest.raises(ValueError, match=r"cannot be read by meshio as \.mdpa"):
        read(tmp_path / "b.mdpa")


def test_nastran_without_a_card_is_refused(tmp_path):
    """For the first card meshio waited for ever."""
    (tmp_path / "a.bdf").write_text("$ Nastran file\nBEGIN BULK\n$ no more\n", encoding="utf-8")
    with pytest.raises(ValueError, match=r"cannot be read by meshio as \.bdf"):
        read(tmp_path / "a.bdf")


def test_small_and_capital_letters_of_set_names_are_the_same(tmp_path):
    path = tmp_path / "a.inp"
    stones = STONES.replace("ELSET=fixed", "ELSET=Stone1")
    path.write_text(strip(f"{stones}\n*ELSET, ELSET=fixed\nSTONE1"), encoding="utf-8")
    drawing = read_layout(path)
    assert drawing.names == ("Stone1", "a", "b", "c")
    assert read(path).roles.tolist() == ["fixed", "free", "free", "free"]
    path.write_text(strip(f"{stones}\n*ELSET, ELSET=fixed\nSTONE7"), encoding="utf-8")
    with pytest.warns(UserWarning, match="neither a cell nor a set before it: 1 'STONE7' in 'fixed'"):
        assert read(path).roles.tolist() == ["free"] * 4
    path.write_text(strip(f'{stones}\n*ELSET, ELSET=fixed\nPart-1-1."Stone1"'), encoding="utf-8")
    assert read(path).roles.tolist() == ["fixed", "free", "free", "free"]
