"""What a new user gets wrong is named with its place and its remedy."""

import errno
import os
import re
import warnings

import pytest
from structures import assembly_of, brick, case_from, drawn

import blockvis
from blockvis import generators, pyvista_plugin
from blockvis.cli import main

ARCH = '[geometry]\nlayout = "arch"\n[settlement]\ndirection = [1, 0]\n'


def written(tmp_path, text):
    (tmp_path / "case.toml").write_text(text)
    return tmp_path / "case.toml"


def test_a_decimal_comma_is_named(tmp_path):
    with pytest.raises(ValueError, match=r"line 5: increment = 0,01 has a decimal comma.* increment = 0\.01$"):
        blockvis.read_case(written(tmp_path, ARCH + "increment = 0,01  # m\n"))


@pytest.mark.parametrize(
    ("lines", "said"),
    [
        ("limit = 1e-320\n", r"\[settlement\] limit is 1e-320; give a number of 1e-30 to 1e\+30"),
        ("[[loads]]\nforce = [0.0, -1e300]\n", r"\[loads\] force holds -1e\+300; give a number of 1e-30 to 1e\+30"),
        (
            'profile = { supports = { "right springer" = [0.0, -1e300] } }\n',
            r"\[settlement\.profile\.supports\] right springer holds -1e\+300",
        ),
        ("[geometry.parameters]\ndensity = 1e308\n", r"\[geometry\] layout: density is 1e\+308 kg/m³; give a number"),
    ],
)
def test_numbers_too_small_or_too_large_for_anything_real_are_refused_by_their_key(tmp_path, capsys, lines, said):
    assert main(["run", str(written(tmp_path, ARCH + lines)), "-o", str(tmp_path / "out")]) == 2
    assert re.search(said, capsys.readouterr().err)


@pytest.mark.parametrize(("name", "said"), [("voussoir 1", "are no moving supports"), ("nobody", "no block is named")])
def test_blocks_that_a_settlement_cannot_move_are_named(tmp_path, name, said):
    case = written(tmp_path, ARCH + f'blocks = ["{name}"]\n')
    with pytest.raises(ValueError, match=rf"case\.toml: \[settlement\] blocks.*{said}.*right springer"):
        blockvis.run_case(case, tmp_path / "out", outputs=())


@pytest.mark.parametrize("acts", ["pressure = 1000", "weight_fraction = [0.1, 0]"])
def test_a_point_of_what_acts_all_over_is_refused(tmp_path, capsys, acts):
    case = written(tmp_path, ARCH + f"[[loads]]\n{acts}\npoint = [0, 1.0]\n")
    assert main(["run", str(case), "-o", str(tmp_path / "out")]) == 2
    assert "case.toml: [loads] point is that of a force or moment; pressure and weight" in capsys.readouterr().err


def test_positions_of_a_live_load_without_a_force_say_what_is_missing(tmp_path, capsys):
    for kind, missing in (("live", "give force"), ("dead", 'give kind = "live" and force')):
        fraction = f'[[loads]]\nkind = "{kind}"\nweight_fraction = [1, 0, 0]\npositions = [-0.5, 0.5, 3]\ny = 0.0\n'
        assert main(["run", str(written(tmp_path, ARCH + fraction))]) == 2
        assert f"{missing} = [fx, fy], in space [fx, fy, fz]" in capsys.readouterr().err


def test_more_positions_than_a_run_takes_are_refused(tmp_path, capsys):
    """Their list alone would need more memory than there is."""
    case = written(tmp_path, ARCH + "[[loads]]\nforce = [0, -1000]\npositions = [0, 1, 1e12]\n")
    assert main(["run", str(case), "-o", str(tmp_path / "out")]) == 2
    assert re.search(r"case\.toml: \[loads\] positions is .* from 2 to 1000000 places", capsys.readouterr().err)


def test_a_support_without_area_is_named_with_its_file(tmp_path, capsys):
    under = '[[supports]]\nname = "ground"\noutline = [[5, 0], [6, 0], [7, 0]]\n'
    assert main(["run", str(written(tmp_path, ARCH + under)), "-o", str(tmp_path / "out")]) == 2
    says = r"case\.toml: \[\[supports\]\] support 'ground': outline: .* has an area of 0 m² .*: remove it or redraw it"
    assert re.search(says, capsys.readouterr().err)


@pytest.mark.parametrize("name", ["", 'name = "springer"\n', 'name = "voussoir 1"\n'])
def test_a_support_that_is_called_as_something_else_is_refused(tmp_path, capsys, name):
    """By its name it has its stiffness, which another had."""
    under = "".join(
        f"[[supports]]\n{name}outline = [[{x}, -1], [{x + 1}, -1], [{x + 1}, 0], [{x}, 0]]\nstiffness = 1e7\n"
        for x in (5, 7)
    )
    assert main(["run", str(written(tmp_path, ARCH + under)), "-o", str(tmp_path / "out")]) == 2
    assert re.search(r"case\.toml: \[supports\] name: '.*' is the name of another support", capsys.readouterr().err)


@pytest.mark.parametrize("pairs", [['"a", "b"', '"b", "a"'], ['"a", "a"', '"a", "a"']])
def test_two_laws_of_the_same_materials_are_refused(tmp_path, capsys, pairs):
    laws = "".join(f"[[interfaces]]\nmaterials = [{pair}]\nfriction_coefficient = 0.3\n" for pair in pairs)
    assert main(["run", str(written(tmp_path, ARCH + laws)), "-o", str(tmp_path / "out")]) == 2
    assert re.search(r"case\.toml: \[interfaces 2\] materials .* are there twice; give each", capsys.readouterr().err)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (
            "friction_coefficient=20",
            "is 20; [materials] has a table for each material: write [material] friction_coeff",
        ),
        ("brick=1800", "is 1800; [materials] has a table for each material: write [materials.brick] density"),
    ],
)
def test_a_key_of_all_blocks_among_those_of_one_material_is_led_to_its_table(tmp_path, capsys, change, said):
    case = written(tmp_path, ARCH)
    assert main(["run", str(case), "-o", str(tmp_path / "out"), "--set", f"materials.{change}"]) == 2
    assert f"case.toml: [materials] {change.partition('=')[0]} {said}" in capsys.readouterr().err


def test_a_verb_that_does_not_exist_names_the_nearest(capsys):
    with pytest.raises(SystemExit) as ended:
        main(["rnu", "case.toml"])
    assert ended.value.code == 2
    assert "there is no verb 'rnu' (did you mean 'run'?)" in capsys.readouterr().err


def test_options_of_an_accessor_are_named():
    blocks = pyvista_plugin.pv.UnstructuredGrid(pyvista_plugin.block_grid(generators.arch())).blockvis
    with pytest.raises(TypeError, match=r"rotation_centre is part of a solver\.Settlement: give phases"):
        blocks.settle(rotation_centre=(0, 0))
    with pytest.raises(TypeError, match=r"no option 'densty'.*did you mean 'density'"):
        blocks.settle(densty=1)


def test_a_direction_of_no_length_is_told_without_a_word_twice(tmp_path, capsys):
    case = written(tmp_path, ARCH.replace("[1, 0]", "[0, 0]"))
    assert main(["run", str(case), "-o", str(tmp_path / "out")]) == 2
    assert "case.toml: [settlement] direction is [0, 0]; give the direction" in capsys.readouterr().err


def test_there_is_nothing_to_go_on_with_where_there_is_no_folder(tmp_path, capsys):
    """And no advice to overwrite what a mistyped name may stand for."""
    for folder, said in ((tmp_path / "nowhere", "there is no folder"), (tmp_path, "holds no run")):
        assert main(["run", "--resume", str(folder)]) == 2
        told = capsys.readouterr().err
        assert said in told
        assert "--force" not in told


def test_what_may_not_be_written_is_told_in_plain_words(tmp_path, monkeypatch, capsys):
    def refused(partial, _):
        raise PermissionError(errno.EACCES, "Permission denied", str(partial))

    monkeypatch.setattr(os, "replace", refused)
    target = tmp_path / "arch.dxf"
    assert main(["layout", "arch", "-o", str(target)]) == 2
    told = f"blockvis: '{target}': Permission denied; change the rights of file or folder, or choose another\n"
    assert capsys.readouterr().err == told


@pytest.mark.parametrize("density", [1e4, 1e6])
def test_blocks_too_light_for_the_balance_of_the_others_are_named(tmp_path, density):
    """An arch beside a block a million times as dense fell at 0.117 m for 0.141, its reaction less than half."""
    blocks = [brick(0, -1, 9, 1), brick(1, 0, 1, 1), brick(4, 0, 4, 4)]
    drawn(tmp_path / "blocks.json", blocks, ["ground", "brick", "tower"], density=[None, None, 1000.0 * density])
    text = '[geometry]\nfile = "blocks.json"\n[roles]\nground = "moving"\n[material]\ndensity = 1000.0\n'
    case = case_from(f"{text}[settlement]\ndirection = [1, 0]\n", tmp_path)
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        assembly_of(case)
    assert any("1 block weighs less than 1e-07 of the whole ('brick')" in str(w.message) for w in told) == (
        density > 1e5
    )
