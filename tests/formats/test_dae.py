"""COLLADA files: placed nodes become blocks in the unit and upright of the file."""

import sys

import numpy as np
import pytest

import blockvis

collada = pytest.importorskip("collada")
from collada import geometry, scene, source  # noqa: E402

BOX = np.array([[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1)], dtype=float)
FACES = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
SHEAR = np.array([[1, 0, 0.2], [0, 1, 0.1], [0, 0, 1]])


def document(path, places, *, points=BOX, up="Z_UP", unit=0.0254, parts=1):
    """Write one shape at several places: (names of nodes, outside first, matrix); its faces in several primitives."""
    found = collada.Collada()
    found.assetInfo.upaxis, found.assetInfo.unitname, found.assetInfo.unitmeter = up, "unit", unit
    corners = source.FloatSource("corners", points.ravel(), ("X", "Y", "Z"))
    shape = geometry.Geometry(found, "shape", "stone", [corners])
    inputs = source.InputList()
    inputs.addInput(0, "VERTEX", "#corners")
    for k in range(parts):
        faces = FACES[k::parts]
        numbers, counts = np.concatenate(faces), np.full(len(faces), 4)
        shape.primitives.append(shape.createPolylist(numbers, counts, inputs, f"material {k}"))
    found.geometries.append(shape)
    nodes = []
    for name, matrix in places:
        inner = scene.Node("", children=[scene.GeometryNode(shape)])
        *around, own = name.split("/")
        nodes.append(scene.Node(own, children=[inner], transforms=[scene.MatrixTransform(matrix.ravel())]))
        for outer in reversed(around):
            nodes[-1] = scene.Node(outer, children=[nodes[-1]])
    found.scenes.append(scene.Scene("scene", nodes))
    found.scene = found.scenes[0]
    found.write(str(path))
    return path


def at(x, y, z, size=(16.0, 8.0, 4.0)):
    matrix = np.diag([*size, 1.0])
    matrix[:3, 3] = x, y, z
    return matrix


def test_nodes_are_placed_and_named_in_the_unit_of_the_file(tmp_path):
    places = [("fixed", at(0, 0, 0)), ("B", at(16, 0, 0)), ("C", at(8, 0, 4))]
    path = document(tmp_path / "wall.dae", places, parts=2)
    layout = blockvis.read_layout(path)
    assert (layout.names, layout.unit) == (("fixed", "B", "C"), "in")
    assert layout.roles[0] == "fixed"
    np.testing.assert_allclose(layout.sizes**2, 16 * 4 * 0.0254**2, rtol=1e-6)
    np.testing.assert_allclose(layout.thickness, 8 * 0.0254, rtol=1e-6)
    np.testing.assert_allclose(blockvis.read_layout(path, dimension=3).volumes, 512 * 0.0254**3, rtol=1e-6)


def test_nodes_around_those_of_stones_are_groups_but_for_those_around_all(tmp_path):
    places = [("all/fixed/A", at(0, 0, 0)), ("all/wall/B", at(16, 0, 0)), ("all/C", at(8, 0, 4))]
    layout = blockvis.read_layout(document(tmp_path / "wall.dae", places))
    assert (layout.names, layout.groups, layout.roles) == (("A", "B", "C"), ("fixed", "wall", ""), ("fixed", "", ""))


@pytest.mark.parametrize(("up", "turn"), [("Z_UP", [0, 1, 2]), ("Y_UP", [0, 2, 1]), ("X_UP", [2, 0, 1])])
def test_the_axis_that_points_up_is_that_of_the_file(tmp_path, up, turn):
    leaning = (BOX @ SHEAR.T)[:, turn]
    layout = blockvis.read_layout(document(tmp_path / "a.dae", [("a", np.eye(4))], points=leaning, up=up, unit=2.5))
    assert (layout.dimension, layout.unit) == (3, "2.5 m")
    np.testing.assert_allclose(layout.volumes, 2.5**3, rtol=1e-5)
    np.testing.assert_allclose(np.ptp(layout.points[:, 2]), 2.5, rtol=1e-5)
    np.testing.assert_allclose(sorted(np.ptp(layout.points, axis=0)), 2.5 * np.array([1.0, 1.1, 1.2]), rtol=1e-5)


def test_damaged_files_are_refused(tmp_path):
    path = document(tmp_path / "wall.dae", [("a", np.eye(4))])
    text = path.read_text(encoding="utf-8")
    for broken, words in (
        (text[: len(text) // 2], "cannot be read as .dae"),
        (text.replace("#corners", "#nothing"), "1 of 1 geometries are damaged"),
        (text.replace('url="#shape"', 'url="#none"'), "Geometry #none not found"),
        (text.replace(">0 0 0 ", ">NaN 0 0 "), "it has NaN for a number"),
        ("<!DOCTYPE x [<!ENTITY a 'b'>]>" + text, "defines XML entities"),
    ):
        assert broken != text
        path.write_text(broken, encoding="utf-8")
        with pytest.raises(ValueError) as caught:
            blockvis.read_layout(path)
        assert words in str(caught.value)
        assert "\n" not in str(caught.value)


def test_normals_of_faces_without_area_may_be_nan(tmp_path):
    path = document(tmp_path / "wall.dae", [("a", np.eye(4))])
    text = path.read_text(encoding="utf-8")
    corners = text[text.index("<source ") : text.index("</source>")] + "</source>"
    normals = corners.replace("corners", "normals").replace(">0 0 0 ", ">NaN 0 0 ")
    assert normals.count("NaN") == 1
    path.write_text(text.replace(corners, normals + corners), encoding="utf-8")
    np.testing.assert_allclose(blockvis.read_layout(path, dimension=3).volumes, 0.0254**3, rtol=1e-6)


def test_without_its_package_the_command_is_named(tmp_path, monkeypatch):
    path = document(tmp_path / "wall.dae", [("a", np.eye(4))])
    monkeypatch.setitem(sys.modules, "collada", None)
    with pytest.raises(ImportError, match=r"need pycollada, which .*pip install 'blockvis\[dae\]'$"):
        blockvis.read_layout(path)
