"""Without the packages of an extra: one line names the command that installs them, and the rest works."""

import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

import blockvis
from blockvis.cli import main

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]


def packages(lines):
    return [re.match(r"[\w-]+", line)[0] for line in lines]


#: What the extra for studies makes importable.
STUDIES = [name.replace("-", "_") for name in packages(PROJECT["optional-dependencies"]["studies"])]

STUDY = """
[study]
case = "case.toml"
runs = 2
seed = 1
[parameters]
"material.friction_coefficient" = { name = "friction", distribution = "uniform", lower = 0.4, upper = 0.8 }
"""

CASE = """
[geometry]
layout = "arch"
[settlement]
direction = [1, 0]
increment = 0.03
limit = 0.1
"""

#: Runs the command line as if these packages were not installed.
WITHOUT = """
import sys
sys.modules |= dict.fromkeys({hidden})
from blockvis.cli import main
sys.exit(main(sys.argv[1:]))
"""


@pytest.fixture
def study(tmp_path):
    (tmp_path / "case.toml").write_text(CASE, encoding="utf-8")
    path = tmp_path / "study.toml"
    path.write_text(STUDY, encoding="utf-8")
    return path


def without(hidden, *arguments):
    code = WITHOUT.format(hidden=hidden)
    command = [sys.executable, "-c", code, *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False, timeout=120)


@pytest.mark.slow
def test_sweep_without_its_packages_names_the_command(study, tmp_path):
    done = without(STUDIES, "sweep", study, "-o", tmp_path / "out")
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == (
        "blockvis: studies need dask, distributed, pandas, pyarrow, SALib, tomli_w, which this environment lacks; "
        "install with: pip install 'blockvis[studies]'\n"
    )
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
def test_all_but_studies_runs_without_their_packages(study, tmp_path):
    done = without(STUDIES, "run", tmp_path / "case.toml", "-o", tmp_path / "out", "--no-film")
    assert done.returncode in (0, 4), done.stderr
    assert {"summary.json", "curve.png", "report.html"} <= {p.name for p in (tmp_path / "out").iterdir()}


@pytest.mark.parametrize("name", STUDIES)
def test_each_package_of_studies_is_missed_by_name(name, study, tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(ImportError, match=rf"^studies need {name}, which .*pip install 'blockvis\[studies\]'$"):
        blockvis.study(study, tmp_path / "out")
    assert main(["sweep", str(study), "-o", str(tmp_path / "out")]) == 2
    assert f"studies need {name}," in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_reading_geometry_without_gmsh_names_the_command(tmp_path, monkeypatch, capsys):
    # gmsh is loaded in a process of its own: one that stands in for a missing one is found first.
    (tmp_path / "gmsh.py").write_text("raise ModuleNotFoundError(\"No module named 'gmsh'\")", encoding="utf-8")
    monkeypatch.syspath_prepend(str(tmp_path))
    assert main(["info", str(ROOT / "assets" / "semicircular_arch.geo")]) == 2
    said = capsys.readouterr().err
    assert "(No module named 'gmsh'); install with: pip install 'blockvis[cad]'" in said
    assert said.count("\n") == 1


def test_extras_are_beside_what_is_always_needed():
    extras = PROJECT["optional-dependencies"]
    for extra in ("studies", "cad", "geo", "dae"):
        assert not set(packages(extras[extra])) & set(packages(PROJECT["dependencies"]))
    assert "blockvis[studies]" in extras["test"], "the README's test command tests studies"
