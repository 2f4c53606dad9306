"""What a new user gets wrong is named with its place and its remedy."""

import pytest

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


@pytest.mark.parametrize(("name", "said"), [("voussoir 1", "are no moving supports"), ("nobody", "no block is named")])
def test_blocks_that_a_settlement_cannot_move_are_named(tmp_path, name, said):
    case = written(tmp_path, ARCH + f'blocks = ["{name}"]\n')
    with pytest.raises(ValueError, match=rf"case\.toml: \[settlement\] blocks.*{said}.*right springer"):
        blockvis.run_case(case, tmp_path / "out", outputs=())


def test_a_verb_that_does_not_exist_names_the_nearest(capsys):
    with pytest.raises(SystemExit) as ended:
        main(["rnu", "case.toml"])
    assert ended.value.code == 2
    assert "there is no verb 'rnu' (did you mean 'run'?)" in capsys.readouterr().err


def test_options_of_an_accessor_are_named():
    blocks = pyvista_plugin.block_dataset(generators.arch()).blockvis
    with pytest.raises(TypeError, match=r"rotation_centre is part of a solver\.Settlement: give phases"):
        blocks.settle(rotation_centre=(0, 0))
    with pytest.raises(TypeError, match=r"no option 'densty'.*did you mean 'density'"):
        blocks.settle(densty=1)
