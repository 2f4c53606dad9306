"""The commands of the page for those who have a model of COMPAS or 3DEC, on small models of our own."""

import re
import shlex
from pathlib import Path

import numpy as np
import pytest

from blockvis import save_layout
from blockvis.cli import main
from blockvis.generators import arch, extruded_arch

PAGE = Path(__file__).parents[2] / "docs" / "starting" / "models.md"
LINES = [
    line.split("#")[0].strip()
    for block in re.findall(r"```sh\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    for line in block.splitlines()
]


@pytest.fixture
def models(tmp_path, monkeypatch):
    """The files that the page names, in the working folder."""
    monkeypatch.chdir(tmp_path)
    drawn = arch(voussoirs=7)
    lines = ["model new", "program call 'geometry.dat'", "block fix range group 'Supports'"]
    Path("main.dat").write_text("\n".join(lines), encoding="utf-8")
    rings = np.split(drawn.vertices, drawn.offsets[1:-1])
    groups = ["Blocks" if role == "free" else "Supports" for role in drawn.roles]
    made = [
        f"poly prism a {at(ring, 0.0)} b {at(ring, 0.5)} group '{g}'" for ring, g in zip(rings, groups, strict=True)
    ]
    Path("geometry.dat").write_text("\n".join(made), encoding="utf-8")
    save_layout(extruded_arch(voussoirs=7), "model.compas.json")
    Path("model.compas.json").rename("model.json")


def at(ring, y):
    return " ".join(f"({x!r},{y},{z!r})" for x, z in ring.tolist())


def test_the_commands_of_the_page_read_both_models(models, capsys):
    for line in LINES:
        if not line.startswith("blockvis run"):
            assert main(shlex.split(line)[1:]) == 0, line
    said = capsys.readouterr().out
    assert "roles           'free' 7, 'fixed' 2" in said
    assert "blocks in space 9" in said or "outlines        9" in said
    assert len(LINES) == 6


@pytest.mark.slow
def test_the_case_made_of_a_model_of_3dec_runs(models):
    assert main(["new", "main.dat", "-o", "arch.toml"]) == 0
    assert main(["run", "arch.toml", "--no-film"]) in (0, 4)
