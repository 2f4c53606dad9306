"""Bodies of .dxf drawings: polyface meshes, meshes and solids become blocks; what ezdxf cannot mesh is named."""

import ezdxf
import numpy as np
import pytest
from ezdxf.acis import api as acis
from ezdxf.render import MeshBuilder, forms

import blockvis


def brick(x, y, z, size=(0.4, 0.2, 0.1)):
    return forms.cube(center=False).scale(*size).translate(x, y, z)


def voussoir(low=0.0):
    """A body that is no prism along an axis: its faces lean."""
    mesh = MeshBuilder()
    mesh.vertices = [(0, 0, low), (1, 0, low), (1, 0.5, low), (0, 0.5, low)]
    mesh.vertices += [(0.1, 0.1, low + 0.4), (0.9, 0.1, low + 0.4), (0.9, 0.4, low + 0.4), (0.1, 0.4, low + 0.4)]
    mesh.faces = [(3, 2, 1, 0), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)]
    return mesh


def drawing(path, draw, **header):
    document = ezdxf.new("R2010")
    for key, value in header.items():
        document.header[key] = value
    draw(document.modelspace())
    document.saveas(path)
    return path


def render_polyface(mesh, space, **attributes):
    mesh.render_polyface(space, dxfattribs=attributes)


def render_mesh(mesh, space, **attributes):
    mesh.render_mesh(space, dxfattribs=attributes)


def render_solid(mesh, space, **attributes):
    acis.export_dxf(space.add_3dsolid(dxfattribs=attributes), [acis.body_from_mesh(mesh)])


def render_faces(mesh, space, **attributes):
    mesh.render_3dfaces(space, dxfattribs=attributes)


KINDS = pytest.mark.parametrize("render", [render_polyface, render_mesh, render_solid, render_faces])


@KINDS
def test_bricks_drawn_as_bodies_become_blocks(tmp_path, render):
    def draw(space):
        render(brick(0, 0, 0), space, layer="fixed")
        render(brick(0.4, 0, 0), space, layer="fixed")
        render(brick(0.2, 0, 0.1), space, layer="brick")

    path = drawing(tmp_path / "wall.dxf", draw)
    layout = blockvis.read_layout(path)
    np.testing.assert_allclose(layout.sizes**2, 0.04)
    np.testing.assert_allclose(layout.thickness, 0.2)
    assert layout.groups == ("fixed", "fixed", "brick")
    np.testing.assert_allclose(blockvis.read_layout(path, dimension=3).volumes, 0.008)
    assert blockvis.read_layout(path, only="brick").n_blocks == 1


@KINDS
def test_bodies_are_placed_by_the_blocks_that_insert_them(tmp_path, render):
    def draw(space):
        block = space.doc.blocks.new("STONE")
        render(voussoir(), block)
        for k in range(3):
            space.add_blockref("STONE", (0, 0, k * 400), dxfattribs={"layer": f"course {k}"}).set_scale(1000)

    layout = blockvis.read_layout(drawing(tmp_path / "tower.dxf", draw, **{"$INSUNITS": 4}))
    assert layout.dimension == 3
    assert layout.groups == ("course 0", "course 1", "course 2")
    expected = 0.4 * (0.5 + np.sqrt(0.5 * 0.24) + 0.24) / 3.0
    np.testing.assert_allclose(layout.volumes, expected, rtol=0.05)
    np.testing.assert_allclose(layout.points[:, 2].max(), 1.2)


def test_flat_meshes_become_outlines(tmp_path):
    def draw(space):
        for k in range(3):
            mesh = MeshBuilder()
            mesh.vertices = [(k, 0, 0), (k + 1, 0, 0), (k + 1, 0.5, 0), (k, 0.5, 0)]
            mesh.faces = [(0, 1, 2), (0, 2, 3)]
            render_polyface(mesh, space, layer="stone")

    layout = blockvis.read_layout(drawing(tmp_path / "course.dxf", draw))
    np.testing.assert_allclose(layout.sizes**2, 0.5)
    assert layout.groups == ("stone",) * 3


def test_outlines_go_before_bodies_beside_them_unless_one_layer_is_asked_for(tmp_path):
    def draw(space):
        space.add_lwpolyline([(0, 0), (1, 0), (1, 1), (0, 1)], close=True, dxfattribs={"layer": "plan"})
        render_polyface(voussoir(), space, layer="stone")

    path = drawing(tmp_path / "both.dxf", draw)
    layout = blockvis.read_layout(path)
    assert layout.dimension == 2
    assert "skipped: 1 body in space" in layout.notes
    layout = blockvis.read_layout(path, only="stone")
    assert (layout.dimension, layout.n_blocks) == (3, 1)
    assert "skipped: 1 outlines and lines beside bodies in space" in layout.notes


def test_faces_that_enclose_nothing_are_outlines(tmp_path):
    def draw(space):
        for k in range(3):
            space.add_3dface([(k, 0, 0.1 * k), (k + 1, 0, 0.1 * k), (k + 1, 1, 0.1 * k), (k, 1, 0.1 * k)])

    path = drawing(tmp_path / "relief.dxf", draw)
    layout = blockvis.read_layout(path)
    assert (layout.dimension, layout.n_blocks) == (2, 3)
    assert any("3DFACEs of a layer are read as bodies in space where they close one" in note for note in layout.notes)
    drawing(path, lambda space: [draw(space), render_faces(voussoir(1.0), space, layer="stone")])
    layout = blockvis.read_layout(path, only="stone")
    assert (layout.dimension, layout.n_blocks) == (3, 1)


def test_solids_with_curved_faces_are_refused_with_what_to_export(tmp_path):
    def draw(space):
        render_solid(brick(0, 0, 0), space)
        space.add_3dsolid(dxfattribs={"layer": "arch"}).sat = ["400 0 1 0", "torus-surface of the kernel #"]

    path = drawing(tmp_path / "arch.dxf", draw)
    words = r"3DSOLID '.*' on layer 'arch' has faces of the ACIS kernel .*\(1 of 2 bodies\): .*STLOUT.*ignore"
    with pytest.raises(ValueError, match=words):
        blockvis.read_layout(path)
    assert blockvis.read_layout(path, ignore="arch").n_blocks == 1


def test_an_open_mesh_is_refused_by_name(tmp_path):
    def draw(space):
        mesh = voussoir()
        mesh.faces = mesh.faces[1:]
        render_polyface(mesh, space)

    with pytest.raises(ValueError, match=r"body 'block \w+' is not closed: 4 edges"):
        blockvis.read_layout(drawing(tmp_path / "open.dxf", draw))
