"""Command files of 3DEC: bricks and prisms become blocks, what only 3DEC runs is refused by its line."""

import numpy as np
import pytest

import blockvis
from blockvis.cli import main
from blockvis.generators import arch

WALL = """; a pier, and a lintel that
; closes it
new
poly brick -0.5 1.5 0 0.3 -0.1 0 region 1
range name ground region 1
poly brick 0, 0.4 0, 0.3 0, 0.2 mat 2 region 2
poly region 2 prism &
a (0.0,0,0.2) (0.4,0,0.2) (0.4,0,0.4) ( 0.0, 0, 0.4 ) &  ; the face in front
b (0.0,0.3,0.2) (0.4,0.3,0.2) (0.4,0.3,0.4) (0.0,0.3,0.4)
block create brick 0.4 0.8 0 0.3 0 0.2 group 'right pier'
prop mat 1 dens 1800
fix region 1
gravity 0 0 -9.81
"""


def written(path, text):
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize("name", ["wall.3ddat", "wall.3dec", "wall.dat", "wall.TXT"])
def test_bricks_and_prisms_become_blocks(tmp_path, name):
    layout = blockvis.read_layout(written(tmp_path / name, WALL))
    assert layout.n_blocks == 4
    np.testing.assert_allclose(layout.sizes**2, [0.2, 0.08, 0.08, 0.08])
    np.testing.assert_allclose(layout.thickness, 0.3)
    assert layout.groups == ("ground", "region 2", "region 2", "right pier")
    assert layout.materials[1] == "mat 2"
    assert layout.roles == ("fixed", "", "", "")
    assert "fixed, as the file says: 1 of them" in layout.notes


def commands_of(assembly):
    """Write each voussoir of an arch in space as a prism between its faces in front and behind."""
    lines = []
    for corners in np.split(assembly.vertices, assembly.offsets[1:-1]):
        faces = [" ".join(f"({x!r},{y!r},{z!r})" for x, z in corners.tolist()) for y in (0.0, 0.5)]
        lines.append(f"poly prism a {faces[0]} b {faces[1]}")
    return "\n".join(lines)


def test_an_arch_comes_back_with_its_areas(tmp_path, capsys):
    drawn = arch(radius=1.5, thickness_ratio=0.2, voussoirs=9)
    path = written(tmp_path / "arch.3ddat", commands_of(drawn))
    flat = blockvis.read_layout(path)
    np.testing.assert_allclose(flat.sizes**2, drawn.areas, rtol=1e-12)
    solid = blockvis.read_layout(path, dimension=3)
    np.testing.assert_allclose(solid.volumes, drawn.areas * 0.5, rtol=1e-9)
    assert main(["convert", str(path), str(tmp_path / "arch.obj")]) == 0
    assert "blocks written" in capsys.readouterr().out


def faces_of_a_box(x0, x1, z0, z1):
    corners = [f"{x!r},{y},{z!r}" for z in (z0, z1) for y in (0, 0.5) for x in (x0, x1)]
    rings = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    return " ".join("face " + " ".join(corners[k] for k in ring) for ring in rings)


def test_a_main_file_of_compas_calls_its_geometry_fixes_its_supports_and_gives_densities(tmp_path):
    written(
        tmp_path / "supports.dat", f'block create group "Supports" poly {faces_of_a_box(-0.2, 1.2, -0.1, 0)}  r=0\n'
    )
    blocks = [
        f'block create group "Blocks" poly {faces_of_a_box(0.5 * k, 0.5 * k + 0.5, 0.0, 0.3)}  r={k}' for k in (0, 1)
    ]
    written(tmp_path / "blocks.dat", "\n".join(blocks))
    text = """
    model new
    program call 'supports.dat' 'blocks.dat'
    program call '../elsewhere.dat'
    block property density 2400 range group 'Supports'
    block property density 1800 range group 'Blocks'
    block fix range group 'Supports'
    fish define blocks_output
        loop foreach ib block.list
        endloop
    end
    model gravity 0 0 -9.806
    """
    layout = blockvis.read_layout(written(tmp_path / "main.dat", text))
    assert layout.groups == ("Supports", "Blocks", "Blocks")
    assert layout.roles == ("fixed", "", "")
    assert layout.density.tolist() == [2400, 1800, 1800]
    np.testing.assert_allclose(layout.sizes**2 * layout.thickness, [0.07, 0.075, 0.075])
    assert "commands that were passed over: 1 call '../elsewhere.dat'" in layout.notes


def test_files_that_call_themselves_end(tmp_path):
    path = written(tmp_path / "main.3ddat", "call main.3ddat\n")
    with pytest.raises(ValueError, match="and the files that it calls make no block"):
        blockvis.read_layout(path)


def test_gravity_says_which_way_is_up_and_groups_and_places_what_is_fixed(tmp_path):
    text = """
    block create brick 0 1 0 1 0 1 group "low"
    block create brick 0.2 0.7 1 2 0.1 0.8
    block create prism face-1 0 2 0 1 2 0 0 2 1 face-2 0 3 0 1.1 3 0 0 3 1 group 'high'
    block fix range group 'low'
    block fix range position-y 1.9 3.1 pos-x -1 2
    block apply vel-x 1 range group 'high'
    model gravity 0 -9.81 0
    """
    layout = blockvis.read_layout(written(tmp_path / "tower.3ddat", text))
    assert layout.roles == ("fixed", "", "fixed")
    assert layout.points[:, 2].max() == 3.0, "y of the file is up"
    np.testing.assert_allclose(layout.volumes[:2], [1.0, 0.35])


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("poly brick 0 1 0 1 0", "line 1: brick takes x0 x1 y0 y1 z0 z1; 5 numbers stand there"),
        ("\npoly prism a (0,0,0) (1,0,0) (0,1,0) b (0,0,1) (1,0,1)", "line 2: both faces of a prism take as many"),
        ("poly brick 0 1 0 1 0 1\njset dip 90 dd 0 spacing 0.2", "line 2 changes the blocks ('jset dip 90 dd 0"),
        ("poly brick 0 1 0 1 0 1\ndelete range x 0 1", "line 2 changes the blocks"),
        ("block create brick 0 1\nblock cut joint-set dip 3", "line 2 changes the blocks"),
        ("block create brick 0 1\nblock move 0 0 5 range group 'a'", "line 2 changes the blocks ('block move 0 0 5"),
        ("poly brick @x0 @x1 0 1 0 1", "line 1 makes blocks by FISH ('brick @x0 @x1"),
        (
            "def wall\nloop n (1,3)\ncommand\npoly brick 0 1 0 1 0 1\nendcommand\nendloop\nend",
            "line 4 makes blocks by FISH",
        ),
        ("poly face 0,0,0 1,0,0 0,1,0 face 0,0,0 1,0,0", "line 1 takes four faces or more of three corners"),
        ("block import filename 'a.stl'\npoly brick 0 1 0 1 0 1", "line 1 makes blocks ('block import filename"),
        ("block generate from-vrml 'a.wrl'\npoly brick 0 1 0 1 0 1", "line 1 makes blocks ('block generate from"),
        ("block create tunnel radius 1", "line 1 makes a block by 'tunnel', which is not read"),
        ("poly brick 0 1 0 1 0 nan", "line 1 has a corner that is not finite"),
        ("hist xdis 1 2 3", "makes no block by 3DEC's commands"),
    ],
)
def test_what_only_3dec_runs_is_refused_with_its_line(tmp_path, text, words):
    path = written(tmp_path / "wall.3ddat", text)
    with pytest.raises(ValueError) as caught:
        blockvis.read_layout(path)
    assert words in str(caught.value)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_table_of_tecplot_is_still_one_and_a_text_beside_stones_is_none(tmp_path):
    path = written(tmp_path / "mesh.dat", 'VARIABLES = "X"\nnothing\n')
    with pytest.raises(ValueError, match=r"cannot be read by meshio as \.dat"):
        blockvis.read_layout(path)
    written(tmp_path / "stones.3ddat", WALL)
    path.unlink()
    written(tmp_path / "readme.txt", "stones of the wall")
    assert blockvis.read_layout(tmp_path).n_blocks == 4


def test_what_is_said_of_blocks_is_followed_or_counted(tmp_path):
    text = """
    model new
    model large-strain on
    set gravity 0 0 -9.81
    poly brick 0 1 0 1 0 1
    poly brick 0 1 0 1 1 2
    poly brick 0 1 0 1 2 3
    block group 'base' range position-z 0 2
    block group 'low' slot 'part' range position-z 0 1
    block fix range group 'base'
    block free range position-z 1 2
    block property density 2600 range group 'base'
    block property density 1900 range group 'low'
    block property density 1000 range not group 'base'
    block property density [rho] range group 'low'
    block property kn 1e9
    fix range not z 0 1
    prop mat 1 dens 2600
    block hide range group 'base'
    block apply vel-x 1
    block history vel-x position 0 0 0
    @make_it_heavy
    [block.density(block.head) = 3000]
    model restore 'earlier.sav'
    model solve
    """
    layout = blockvis.read_layout(written(tmp_path / "wall.3ddat", text), dimension=3)
    assert layout.groups == ("low", "base", "")
    assert layout.roles == ("fixed", "", "")
    np.testing.assert_array_equal(layout.density, [1900, 2600, np.nan])
    counted = "3 block property, 1 fix, 1 prop, 1 block hide, 1 block apply, 2 FISH, 1 model restore"
    assert f"commands that were passed over: {counted}" in layout.notes


def test_what_is_said_of_no_range_holds_for_all_unless_some_are_hidden(tmp_path):
    bricks = "poly brick 0 1 0 1 0 1\npoly brick 0 1 0 1 1 2\n"
    said = "block property density 2600\nfix\nfree range z 1 2\n"
    layout = blockvis.read_layout(written(tmp_path / "wall.3ddat", bricks + said), dimension=3)
    assert layout.roles == ("fixed", "")
    assert layout.density.tolist() == [2600, 2600]
    layout = blockvis.read_layout(written(tmp_path / "wall.3ddat", f"{bricks}hide range z 1 2\n{said}"), dimension=3)
    assert layout.roles == ("", "")
    assert "commands that were passed over: 1 hide, 1 block property, 1 fix, 1 free" in layout.notes
