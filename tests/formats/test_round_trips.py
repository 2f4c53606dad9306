"""Every format by round trip on a generated layout: blocks, names, roles, materials, thickness, density."""

import json
import re
from xml.etree import ElementTree

import ezdxf
import numpy as np
import pytest
from structures import suffixes_known

import solver
from blockvis import generators, read, read_layout, save_layout, write_layout

#: All but single precision, which test_space_round_trips looks at.
WRITTEN = [suffix for suffix in suffixes_known(save_layout, generators.arch()) if suffix != ".glb"]
#: What a file cannot say of a block.
SILENT = {".stl": ("roles", "materials", "density")}


@pytest.fixture(scope="module")
def layout():
    """Convex, non-convex and many-cornered blocks, a name with a quote, two thicknesses."""
    angle = 2 * np.pi * np.arange(11) / 11
    outlines = [
        [[0, 0], [2, 0], [2, 1], [0, 1]],
        [[2, 0], [4, 0], [4, 2], [3, 2], [3, 1], [2, 1]],
        [[0, 1], [2, 1], [1, 2.1234567890123]],
        np.stack([6 + np.cos(angle), 1 + np.sin(angle)], axis=1),
    ]
    return solver.Assembly.from_outlines(
        outlines,
        names=["left springer", "L-block", 'the "key" & <stone>', "Rundstück"],
        roles=["fixed", "moving", "free", "free"],
        materials=["stone", "stone", "brick", ""],
        density=[2000.0, 2000.0, 1800.0, 2600.0],
        thickness=[0.5, 0.5, 0.25, 0.5],
    )


@pytest.mark.parametrize("suffix", WRITTEN)
@pytest.mark.parametrize("turn", [1, -1], ids=["counter-clockwise", "clockwise"])
def test_the_first_corner_stays_the_first_from_which_edges_are_counted(suffix, turn, tmp_path):
    """Bent and convex outlines, whichever way they are drawn and in whatever triangles a file has them."""
    rings = [[[0, 0], [2, 0], [1.9, 1], [0.2, 1]], [[2, 0], [4, 0], [4, 2], [3, 2], [3, 1], [2, 1]]]
    drawn = [{"name": f"{k}", "outline": [ring[0], *ring[1:][::turn]]} for k, ring in enumerate(rings)]
    (tmp_path / "drawn.json").write_text(json.dumps({"unit": "m", "blocks": drawn}), encoding="utf-8")
    write_layout(read_layout(tmp_path / "drawn.json"), tmp_path / f"again{suffix}")
    again = read(tmp_path / f"again{suffix}")
    for ring in rings:
        (number,) = np.flatnonzero(np.isclose(again.areas, 1.85 if len(ring) == 4 else 3.0))
        np.testing.assert_allclose(again.outline(number), ring, atol=1e-12)


@pytest.mark.parametrize("suffix", WRITTEN)
def test_everything_comes_back(layout, suffix, tmp_path):
    path = tmp_path / f"layout{suffix}"
    save_layout(layout, path)
    again = read(path)
    assert again.n_blocks == layout.n_blocks
    for i in range(layout.n_blocks):
        ring, drawn = again.outline(i), layout.outline(i)
        distance = np.abs(ring[:, None] - drawn[None]).max(axis=2)
        assert len(ring) == len(drawn)
        assert distance.min(axis=0).max() < 1e-12
        assert distance.min(axis=1).max() < 1e-12
    assert np.allclose(again.areas, layout.areas, rtol=1e-12)
    assert again.names == layout.names
    assert np.allclose(again.thickness, layout.thickness, rtol=1e-12)
    silent = SILENT.get(suffix, ())
    if "roles" not in silent:
        assert (again.roles == layout.roles).all()
    if "materials" not in silent:
        assert again.materials == layout.materials
    if "density" not in silent:
        assert np.allclose(again.density, layout.density)


@pytest.mark.parametrize("suffix", WRITTEN)
def test_what_a_format_cannot_hold_is_said(layout, suffix, tmp_path, recwarn):
    """All of the layout in .stl: roles that no name says, materials and densities."""
    save_layout(layout, tmp_path / f"a{suffix}")
    said = [str(warning.message) for warning in recwarn]
    assert said == [
        f"'{tmp_path}/a.stl': .stl holds shapes and names alone, not the role of 2 blocks, density of 4 blocks, "
        "material of 3 blocks; write .obj or .json to keep them"
    ] * (suffix == ".stl")


def test_a_role_that_the_name_says_is_not_lost_in_an_stl_file(tmp_path, recwarn):
    base = solver.Assembly.from_outlines([[[0, 0], [1, 0], [0, 1]]], names=["fixed base"], roles=["fixed"])
    save_layout(base, tmp_path / "a.stl")
    assert "names alone, not the density of 1 block; write" in str(recwarn.pop().message)
    assert read_layout(tmp_path / "a.stl").roles == ("fixed",)


@pytest.mark.parametrize("suffix", WRITTEN)
def test_the_reader_says_what_it_assumed_of_the_unit(layout, suffix, tmp_path):
    path = tmp_path / f"layout{suffix}"
    save_layout(layout, path)
    drawing = read_layout(path)
    assert drawing.unit == "m"
    said = any("does not say its unit; m was assumed" in note for note in drawing.notes)
    assert said == (suffix not in (".json", ".dxf", ".svg"))


@pytest.mark.slow
def test_a_bigger_layout_survives_a_chain_of_formats(tmp_path):
    bricks = [
        [[x, y], [x + 0.25, y], [x + 0.25, y + 0.065], [x, y + 0.065]]
        for y in np.arange(12) * 0.065
        for x in np.arange(15) * 0.25 + (0.125 if round(y / 0.065) % 2 else 0.0)
    ]
    wall = solver.Assembly.from_outlines(bricks, materials=["brick"] * len(bricks))
    current = wall
    for suffix in (".dxf", ".svg", ".msh", ".vtu", ".obj", ".json", ".vtp"):
        path = tmp_path / f"wall{suffix}"
        save_layout(current, path)
        current = read(path)
    assert current.names == wall.names
    assert np.abs(np.sort(current.vertices, axis=0) - np.sort(wall.vertices, axis=0)).max() < 1e-12


def _moved_in_dxf(path, layer):
    document = ezdxf.readfile(path)
    next(iter(document.modelspace())).dxf.layer = layer
    document.saveas(path)


def _moved_in_svg(path, layer):
    name = "{http://www.inkscape.org/namespaces/inkscape}label"
    tree = ElementTree.parse(path)
    next(one for one in tree.getroot()).set(name, layer)
    tree.write(path)


@pytest.mark.parametrize(("suffix", "moved"), [(".dxf", _moved_in_dxf), (".svg", _moved_in_svg)])
@pytest.mark.parametrize(
    ("role", "material", "layer", "expected"),
    [
        ("free", "brick", "moving", "moving"),
        ("free", "brick", "lime", "free"),
        ("fixed", "brick", "Moving", "moving"),
        # Layer "fixed", from which the block was taken.
        ("fixed", "", "lime", "free"),
    ],
)
def test_a_block_on_another_layer_than_it_was_written_on_is_what_that_layer_says(
    suffix, moved, role, material, layer, expected, tmp_path
):
    squares = [[[x, 0], [x + 1, 0], [x + 1, 1], [x, 1]] for x in (0, 1)]
    written = solver.Assembly.from_outlines(
        squares, names=["a", "b"], roles=[role, "free"], materials=[material, "stone"]
    )
    path = tmp_path / f"wall{suffix}"
    save_layout(written, path)
    moved(path, layer)
    layout = read_layout(path)
    assert layout.groups[0] == layer
    assert layout.names == ("a", "b")
    assert "moved to another layer since blockvis wrote the drawing: 'a' on '" + layer + "'" in layout.notes
    assert read(path).roles.tolist() == [expected, "free"]


@pytest.mark.parametrize(("suffix", "moved"), [(".dxf", _moved_in_dxf), (".svg", _moved_in_svg)])
def test_a_support_on_another_layer_that_says_nothing_of_it_is_told(suffix, moved, tmp_path):
    path = tmp_path / f"wall{suffix}"
    features = [
        {
            "type": "Feature",
            "properties": {"name": name, "layer": layer, "role": role},
            "geometry": {"type": "Polygon", "coordinates": [[[x, 0], [x + 1, 0], [x + 1, 1], [x, 1], [x, 0]]]},
        }
        for x, name, layer, role in ((0, "a", "pier", "fixed"), (1, "b", "arch", "free"))
    ]
    drawn = tmp_path / "wall.geojson"
    drawn.write_text(json.dumps({"type": "FeatureCollection", "crs": None, "features": features}), encoding="utf-8")
    write_layout(read_layout(drawn), path)
    moved(path, "abutment")
    with pytest.warns(UserWarning, match=r"layers of supports were changed \('a' on 'abutment'\): they are fixed"):
        assert read(path).roles.tolist() == ["fixed", "free"]


def test_a_title_or_label_that_was_changed_names_the_block(layout, tmp_path):
    path = tmp_path / "a.svg"
    save_layout(layout, path)
    text = path.read_text(encoding="utf-8").replace("<title>L-block</title>", "<title>pier</title>")
    path.write_text(text.replace("<path ", '<path inkscape:label="first" ', 1), encoding="utf-8")
    assert read(path).names == ("first", "pier", *layout.names[2:])


def test_layers_whose_labels_a_program_dropped_are_those_that_were_written(layout, tmp_path):
    path = tmp_path / "a.svg"
    save_layout(layout, path)
    plain = re.sub(r'inkscape:groupmode="layer" inkscape:label="[^"]*"', 'id="g1"', path.read_text(encoding="utf-8"))
    path.write_text(plain, encoding="utf-8")
    again = read_layout(path)
    assert again.roles == ("fixed", "moving", "free", "free")
    assert again.notes == ()


def test_what_is_written_by_the_other_function_says_so(layout, tmp_path):
    with pytest.raises(TypeError, match="Assembly is no Layout, as read_layout gives; save_layout writes an Assembly"):
        write_layout(layout, tmp_path / "a.json")
    with pytest.raises(TypeError, match=r"str is no solver\.Assembly; write_layout writes a Layout"):
        save_layout("wall", tmp_path / "a.json")
