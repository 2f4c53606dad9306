"""Every format by round trip on a generated layout: blocks, names, roles, materials, thickness, density."""

import numpy as np
import pytest
from structures import suffixes_known

import solver
from blockvis import generators, read, read_layout, save_layout

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
