"""The cases that come with blockvis are copied with their drawings, and the wheel has them all."""

import tomllib
from pathlib import Path

import pytest

from blockvis import read_case
from blockvis.cli import main

ROOT = Path(__file__).parents[2]

EXAMPLES = ROOT / "examples"
CASES = [
    path.relative_to(EXAMPLES).with_suffix("").as_posix()
    for pattern in ("*.toml", "explain/*.toml")
    for path in sorted(EXAMPLES.glob(pattern))
]


def test_a_copied_case_is_read_where_it_lies(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["example", "semicircular_arch"]) == 0
    assert {path.name for path in tmp_path.iterdir()} == {"semicircular_arch.toml", "semicircular_arch.msh"}
    read_case("semicircular_arch.toml")
    (tmp_path / "semicircular_arch.toml").unlink()
    (tmp_path / "semicircular_arch.msh").write_text("mine")
    assert main(["example", "semicircular_arch"]) == 2
    assert "semicircular_arch.msh is there already; --force replaces it" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["semicircular_arch.msh"], "nothing is written"
    assert main(["example", "semicircular_arch.toml", "--force"]) == 0


@pytest.mark.parametrize(("name", "table"), [("arch", "cracks.csv"), ("vault", "vault_cracks.csv")])
def test_a_case_to_explain_comes_with_its_cracks(tmp_path, monkeypatch, capsys, name, table):
    monkeypatch.chdir(tmp_path)
    assert main(["example", f"explain/{name}"]) == 0
    assert {path.name for path in tmp_path.iterdir()} == {f"{name}.toml", table}
    command = f"blockvis explain {name}.toml --observed {table}"
    assert command in capsys.readouterr().out
    assert command in (tmp_path / f"{name}.toml").read_text(encoding="utf-8")


def test_the_list_has_a_line_for_each_case(capsys):
    assert main(["example"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines] == CASES
    assert all(len(line.split()) > 3 for line in lines)


def test_an_unknown_example_names_the_nearest(capsys):
    assert main(["example", "semicircular_arc"]) == 2
    assert "did you mean 'semicircular_arch'?" in capsys.readouterr().err


def test_the_wheel_takes_every_case_and_the_drawings_that_they_name():
    build = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["hatch"]["build"]
    wanted = {f"examples/explain/{path.name}" for path in (EXAMPLES / "explain").iterdir()}
    for case in EXAMPLES.glob("*.toml"):
        drawings = (word for word in case.read_text(encoding="utf-8").split('"')[1::2] if word.startswith("../"))
        wanted |= {f"examples/{case.name}", *(drawing.removeprefix("../") for drawing in drawings)}
    included = build["targets"]["wheel"]["force-include"]
    assert included == {name: f"blockvis/shipped/{name}" for name in wanted}


@pytest.mark.parametrize("name", CASES)
def test_drawings_of_a_case_lie_where_copying_looks_for_them(name):
    text = (EXAMPLES / f"{name}.toml").read_text(encoding="utf-8")
    words = [word for word in text.split('"')[1::2] if "/" in word and not word.startswith("../assets/")]
    assert words == []
