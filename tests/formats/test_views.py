"""Bodies in space: which view is taken, and what is known as three-dimensional."""

import numpy as np
import pytest
import trimesh
from structures import assembly_of

from blockvis import read, read_case, read_layout
from blockvis.cli import main


def box(at, size):
    """A box by its lower corner and its size."""
    middle = np.asarray(at, dtype=float) + np.asarray(size, dtype=float) / 2.0
    return trimesh.creation.box(size, transform=trimesh.transformations.translation_matrix(middle))


def written(bodies, path):
    scene = trimesh.Scene()
    for k, body in enumerate(bodies):
        scene.add_geometry(body, node_name=f"brick {k}", geom_name=f"brick {k}")
    scene.export(path)
    return path


def leaf(y, depth=0.2, courses=3):
    """A wall of bricks 0.5 long, 0.25 high and as deep as is said, in running bond."""
    return [
        box((0.5 * column + 0.25 * (course % 2), y, 0.25 * course), (0.5, depth, 0.25))
        for course in range(courses)
        for column in range(3)
    ]


def test_a_wall_is_seen_from_the_front_though_its_bricks_are_prisms_along_every_axis(tmp_path):
    path = written(leaf(0.0), tmp_path / "wall.glb")
    layout = read_layout(path)
    assert layout.thickness == pytest.approx([0.2] * 9)
    assert np.ptp(np.concatenate(layout.outlines), axis=0) == pytest.approx([1.75, 0.75])
    assert any("read as outlines in xz" in note for note in layout.notes)


def test_the_view_without_overlaps_is_preferred_to_bodies_between_the_same_planes(tmp_path):
    # Seen along z the bodies lie between the same two planes, but the second column lies behind the first.
    columns = [box((0, 0, 0), (1, 1, 1)), box((2, 0, 0), (1, 1, 1)), box((0.5, 1, 0), (1, 1, 1))]
    layout = read_layout(written(columns, tmp_path / "a.glb"))
    assert any("read as outlines in xy" in note for note in layout.notes)
    stacked = [box((0, 0, 0), (1, 1, 1)), box((0.6, 0.2, 1), (1, 0.8, 1))]
    layout = read_layout(written(stacked, tmp_path / "b.glb"))
    assert any("read as outlines in xz" in note for note in layout.notes)


def test_two_leaves_are_refused_as_three_dimensional(tmp_path):
    path = written(leaf(0.0) + leaf(0.2), tmp_path / "wall.glb")
    with pytest.raises(
        ValueError,
        match=r"is three-dimensional: .*seen along y, 'brick 9' lies behind 'brick 0'"
        r".*dimension = 3 reads them in space; in the plane leave out all but one leaf \(ignore\)",
    ):
        read(path, dimension=2)


def test_a_curved_wall_is_refused_as_three_dimensional(tmp_path):
    bodies = []
    for course in range(2):
        for k in range(5):
            angle = 0.3 * (k + 0.5 * course)
            turn = trimesh.transformations.rotation_matrix(angle, (0, 0, 1), (0, 0, 0))
            bodies.append(box((2.0, -0.3, 0.25 * course), (0.3, 0.6, 0.25)).apply_transform(turn))
    with pytest.raises(
        ValueError, match=r"three-dimensional: seen along z, 'brick 0' lies behind 'brick \d+'.*along y"
    ):
        read(written(bodies, tmp_path / "wall.glb"), dimension=2)


def test_bodies_that_no_plane_cuts_are_refused(tmp_path):
    apart = [box((0, 0, 0), (1, 0.2, 1)), box((1, 0.5, 0), (1, 0.2, 1))]
    with pytest.raises(ValueError, match=r"no plane across y cuts all bodies: 'brick 0' ends at 0.2, 'brick 1' begins"):
        read(written(apart, tmp_path / "a.glb"), view="xz")


def test_eccentric_bodies_are_read_with_a_note(tmp_path):
    bodies = [box((0, 0, 0), (1, 0.4, 1)), box((0.2, 0.1, 1), (1, 0.4, 1))]
    layout = read_layout(written(bodies, tmp_path / "a.glb"), view="xz")
    assert any("middle planes of the bodies along y differ by up to 0.1" in note for note in layout.notes)
    with pytest.warns(UserWarning, match="the middle planes of the bodies along y differ"):
        read(tmp_path / "a.glb", view="xz")
    wide = [box((0, 0, 0), (1, 0.4, 1)), box((0.2, 0.1, 1), (1, 0.2, 1))]
    layout = read_layout(written(wide, tmp_path / "b.glb"), view="xz")
    assert layout.thickness == pytest.approx([0.4, 0.2])
    assert not any("middle planes" in note for note in layout.notes)


def test_the_view_chooses(tmp_path, capsys):
    row = written([box((k, 0, 0), (1, 0.5, 0.25)) for k in range(3)], tmp_path / "row.glb")
    for view, area, thickness in (("xy", 0.5, 0.25), ("xz", 0.25, 0.5)):
        layout = read_layout(row, view=view)
        assert layout.thickness == pytest.approx([thickness] * 3)
        assert read(row, view=view).areas == pytest.approx([area] * 3)
        assert main(["info", str(row), "--view", view]) == 0
        assert f"size            3 m × {area:g} m" in capsys.readouterr().out
        assert main(["convert", str(row), str(tmp_path / f"{view}.json"), "--view", view]) == 0
        assert read(tmp_path / f"{view}.json").areas == pytest.approx([area] * 3)
    with pytest.raises(ValueError, match=r'cannot be seen as yz: .*lies behind.*view = "xy" shows them side by side'):
        read(row, view="yz")
    with pytest.raises(ValueError, match="view 'zx' is not known; the views are xy, xz, yz"):
        read(row, view="zx")


def test_the_view_of_a_case(tmp_path):
    written([box((k, 0, 0), (1, 0.5, 0.25)) for k in range(3)], tmp_path / "row.glb")
    case = tmp_path / "case.toml"
    rest = '[roles]\n"brick 0" = "moving"\n[settlement]\ndirection = [0.0, -1.0]\nincrement = 0.01\nlimit = 0.1\n'
    case.write_text('[geometry]\nfile = "row.glb"\nview = "xz"\n' + rest, encoding="utf-8")
    assert assembly_of(read_case(case)).areas == pytest.approx([0.25] * 3)
    case.write_text('[geometry]\nfile = "row.glb"\nview = "front"\n' + rest, encoding="utf-8")
    with pytest.raises(ValueError, match=r"\[geometry\] view is 'front'; choose from xy, xz, yz"):
        read_case(case)
    case.write_text('[geometry]\nlayout = "arch"\nview = "xz"\n' + rest, encoding="utf-8")
    with pytest.raises(ValueError, match=r"\[geometry\] view belongs to a file, not to a layout"):
        read_case(case)


def test_a_flat_drawing_has_the_view_of_its_plane_only(tmp_path):
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv 1 0 2\nv 0 0 2\nf 1 2 3\nf 1 3 4\n", encoding="utf-8")
    assert read(tmp_path / "a.obj", view="xz").areas == pytest.approx([2])
    with pytest.raises(ValueError, match="lies in xz: seen as xy it has no area"):
        read(tmp_path / "a.obj", view="xy")
    (tmp_path / "a.svg").write_text(
        '<svg xmlns="http://www.w3.org/2000/svg"><rect width="2" height="1"/></svg>', encoding="utf-8"
    )
    assert read(tmp_path / "a.svg", view="xy").n_blocks == 1
    with pytest.raises(ValueError, match="drawn in the plane xy; it has no view xz"):
        read(tmp_path / "a.svg", view="xz")


def test_a_leaf_can_be_left_out(tmp_path, capsys):
    path = written(leaf(0.0) + leaf(0.2), tmp_path / "wall.glb")
    behind = [f"brick {k}" for k in range(9, 18)]
    layout = read_layout(path, ignore=behind)
    assert layout.names == tuple(f"brick {k}" for k in range(9))
    assert len(layout.left_out) == 9
    assert not any("matches no" in note for note in layout.notes)
    assert read(path, only=[f"brick {k}" for k in range(9)]).n_blocks == 9
    assert main(["info", str(path), "--ignore", "brick 9", "--ignore", "brick 1?"]) == 0
    assert "left out: 9 outlines, as asked for" in capsys.readouterr().out
    with pytest.raises(ValueError, match=r"draws no block: all that it draws is left out as asked"):
        read(path, ignore="brick *")


def test_what_is_left_out_of_an_upright_drawing_is_turned_with_it(tmp_path):
    import ezdxf

    document = ezdxf.new("R2010")
    document.header["$INSUNITS"] = 6
    space = document.modelspace()

    def upright(x, z, size):
        return [(x, 0.0, z), (x + size, 0.0, z), (x + size, 0.0, z + size), (x, 0.0, z + size)]

    space.add_polyline3d(upright(0.0, 0.0, 0.5), close=True)
    hatch = space.add_hatch(dxfattribs={"layer": "mortar", "extrusion": (0, -1, 0)})
    # In the coordinates of an extrusion along -y, (x, z) are the first two.
    for low, size in ((1.0, 1.0), (1.2, 0.2)):
        hatch.paths.add_polyline_path([(x, z) for x, _, z in upright(low, low, size)])
    document.saveas(tmp_path / "a.dxf")
    drawing = read_layout(tmp_path / "a.dxf")
    (mortar,) = drawing.left_out
    assert np.ptp(mortar.points, axis=0) == pytest.approx([1.0, 1.0])
    assert np.ptp(mortar.holes[0], axis=0) == pytest.approx([0.2, 0.2])
