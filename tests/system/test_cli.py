"""The command line through its entry point."""

import csv
import json
import math
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from blockvis.cli import main
from blockvis.runs import progress

ROOT = Path(__file__).parents[2]

CASE = (ROOT / "examples" / "semicircular_arch.toml").read_text(encoding="utf-8")


@pytest.fixture
def case(tmp_path):
    """The shipped case, in a folder of its own, with a quick animation."""
    shutil.copy(ROOT / "assets" / "semicircular_arch.msh", tmp_path / "arch.msh")
    text = CASE.replace("../assets/semicircular_arch.msh", "arch.msh").replace('"collapse.mp4"', "false")
    path = tmp_path / "case.toml"
    path.write_text(text, encoding="utf-8")
    return path


def _changed(case, old, new):
    text = case.read_text(encoding="utf-8")
    assert old in text
    case.write_text(text.replace(old, new), encoding="utf-8")
    return case


def _refused(case, capsys, *words):
    assert main(["run", str(case), "-o", str(case.parent / "out")]) == 2
    message = capsys.readouterr().err
    for word in words:
        assert word in message, message
    assert not (case.parent / "out").exists(), "nothing may be written for bad input"


@pytest.mark.pictures
def test_run_writes_the_results_folder(case, capsys, monkeypatch):
    monkeypatch.setattr(progress, "LINES", math.inf)
    out = case.parent / "out"
    assert main(["run", str(case), "-o", str(out)]) == 0
    printed = capsys.readouterr()
    assert "collapse displacement" in printed.out
    assert printed.err == "", "a short run is quiet where stderr is no terminal"
    summary = json.loads((out / "summary.json").read_text(encoding="utf-8"))
    assert summary["status"] == "collapsed"
    assert summary["collapse_displacement"] == pytest.approx(0.14104982, rel=1e-3)
    low, high = summary["collapse_bracket"]
    assert low < summary["collapse_displacement"] < high <= low + 1.001e-4
    weight = summary["total_weight"]
    assert summary["initial_reaction"] / weight == pytest.approx(0.1771150, abs=1e-6)
    assert summary["collapse_reaction"] / weight == pytest.approx(0.2420193, rel=1e-3)
    assert summary["n_blocks"] == 14
    rows = list(csv.DictReader((out / "response.csv").read_text(encoding="utf-8").splitlines()))
    assert len(rows) == summary["n_increments"]
    assert float(rows[-1]["settlement"]) == pytest.approx(low)
    assert float(rows[0]["reaction"]) == pytest.approx(summary["initial_reaction"])
    frames = summary["n_increments"] + summary["n_falling_frames"]
    assert len(list(out.glob("increments/blocks_*.vtu"))) == frames
    assert len(list(out.glob("increments/contacts_*.vtu"))) == frames
    for name in ("blocks.pvd", "contacts.pvd", "curve.png", "mechanism.png"):
        assert (out / name).stat().st_size > 500


def test_results_are_not_overwritten_without_force(case, capsys):
    out = case.parent / "out"
    out.mkdir()
    (out / "summary.json").write_text("{}", encoding="utf-8")
    assert main(["run", str(case), "-o", str(out)]) == 2
    assert "--force" in capsys.readouterr().err
    assert (out / "summary.json").read_text(encoding="utf-8") == "{}"


def test_console_script_and_exit_code():
    done = subprocess.run(
        [sys.executable, "-m", "blockvis", "run", "nowhere.toml"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 2
    assert "nowhere.toml" in done.stderr
    assert "Traceback" not in done.stderr


def test_a_layout_in_place_of_the_case_file_says_so(capsys):
    layout = Path(__file__).parents[2] / "assets" / "semicircular_arch.msh"
    assert main(["run", str(layout)]) == 2
    said = capsys.readouterr().err
    assert "is a layout, not a case file" in said
    assert '[geometry] file = "semicircular_arch.msh"' in said


def test_missing_layout_names_file_and_neighbours(case, capsys):
    _refused(_changed(case, "arch.msh", "arhc.msh"), capsys, "arhc.msh", "arch.msh")


def test_unknown_key_names_the_nearest(case, capsys):
    _refused(
        _changed(case, "friction_coefficient", "friction_coeficient"), capsys, "did you mean 'friction_coefficient'"
    )


def test_unknown_section_names_the_nearest(case, capsys):
    _refused(_changed(case, "[settlement]", "[setlement]"), capsys, "setlement", "did you mean 'settlement'")


def test_broken_toml_names_the_line(case, capsys):
    _refused(_changed(case, "density = 2000.0", "density = = 2000.0"), capsys, "line")


def test_role_that_matches_nothing_lists_the_names(case, capsys):
    _refused(_changed(case, '"right springer"', '"right sprinter"'), capsys, "right sprinter", "right springer")


def test_no_moving_support(case, capsys):
    _refused(
        _changed(case, '"right springer" = "moving"', '"right springer" = "fixed"'), capsys, "moving", "right springer"
    )


def test_wrong_role(case, capsys):
    _refused(_changed(case, '= "moving"', '= "sliding"'), capsys, "sliding", "free, fixed, moving")


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("increment = 0.01", "increment = -0.01", ("increment", "positive")),
        ("direction = [1.0, 0.0]", "direction = [0, 0]", ("direction",)),
        ("direction = [1.0, 0.0]", 'direction = "right"', ("direction", "two numbers")),
        ("density = 2000.0", 'density = "heavy"', ("density", "number")),
        ("friction_coefficient = 2.0", "friction_coefficient = -0.1", ("friction_coefficient", "at least 0")),
        ("friction_coefficient = 2.0", "friction_coefficient = nan", ("friction_coefficient", "number")),
    ],
)
def test_bad_values(case, capsys, old, new, words):
    _refused(_changed(case, old, new), capsys, *words)


def test_overlapping_support_names_both_blocks_and_the_depth(case, capsys):
    with open(case, "a", encoding="utf-8") as file:
        file.write('\n[[supports]]\nname = "prop"\noutline = [[-0.2, 0.9], [0.2, 0.9], [0.2, 1.0], [-0.2, 1.0]]\n')
    _refused(case, capsys, "prop", "overlaps", "voussoir")


def test_no_initial_equilibrium_has_its_own_exit_code(case, capsys):
    """A row of voussoirs whose springer is moving only: the other end has nothing to stand on."""
    _changed(case, '"left springer" = "fixed"', '"left springer" = "free"')
    assert main(["run", str(case), "-o", str(case.parent / "out")]) == 5
    summary = json.loads((case.parent / "out" / "summary.json").read_text(encoding="utf-8"))
    assert summary["status"] == "no initial equilibrium"
    with pytest.raises(SystemExit):
        main(["--help"])
    assert "5 no initial equilibrium" in " ".join(capsys.readouterr().out.split())


def test_output_that_nobody_reads_to_its_end_is_no_error(case):
    command = f"{sys.executable} -m blockvis info {case.parent / 'arch.msh'} | true"
    done = subprocess.run(
        ["bash", "-c", f"{command}; exit ${{PIPESTATUS[0]}}"], capture_output=True, text=True, check=False, cwd=ROOT
    )
    assert (done.returncode, done.stderr) == (0, "")
