"""The same input gives the same bytes, timings apart; the summary says what is needed to run it again."""

import hashlib
import json
import re
from pathlib import Path

import pytest
from structures import case_from, run_command, stored_bytes

from blockvis.cli import main

CASE = """
[geometry]
file = "arch.json"
[roles]
"left springer" = "fixed"
"right springer" = "moving"
[settlement]
direction = [1.0, 0.0]
increment = 0.03
limit = 0.5
[analysis]
falling_frames = 4
[output]
animation = "collapse.gif"
"""

#: Where two runs may differ, and what makes them the same again.
TIMINGS = {
    "response.csv": (rb",[^,\n]*\n", rb"\n"),
    "report.html": (rb"[\d.]+ s</|\d{4}-\d\d-\d\d \d\d:\d\d:\d\d UTC", rb"</"),
    "summary.json": (rb'"(seconds|finished)": [^\n]*', rb""),
}


def _without_timings(path: Path) -> bytes:
    if path.suffix == ".npz" and path.name.startswith("state"):
        return stored_bytes(path)
    data = path.read_bytes()
    return re.sub(*TIMINGS[path.name], data) if path.name in TIMINGS else data


@pytest.mark.slow
def test_two_runs_write_the_same_bytes_and_can_be_run_again(tmp_path):
    assert main(["layout", "arch", "voussoirs=8", "-o", str(tmp_path / "arch.json")]) == 0
    (tmp_path / "case.toml").write_text(CASE, encoding="utf-8")
    one, other = tmp_path / "one", tmp_path / "other"
    for folder in (one, other):
        assert run_command(tmp_path / "case.toml", "-o", folder, drawn=True) in (0, 4)
    names = sorted(str(p.relative_to(one)) for p in one.rglob("*") if p.is_file())
    assert names == sorted(str(p.relative_to(other)) for p in other.rglob("*") if p.is_file())
    assert len(names) > 30
    assert "collapse.gif" in names
    for name in names:
        assert _without_timings(one / name) == _without_timings(other / name), name

    summary = json.loads((one / "summary.json").read_text(encoding="utf-8"))
    assert summary["case"] == CASE
    assert case_from(summary["case"], tmp_path).settlements[0].limit == 0.5
    assert summary["inputs"] == {
        "case_file": "case.toml",
        "case_sha256": hashlib.sha256(CASE.encode()).hexdigest(),
        "layout_file": "arch.json",
        "layout_sha256": hashlib.sha256((tmp_path / "arch.json").read_bytes()).hexdigest(),
    }
    assert {"python", "platform", "blockvis", "numpy", "scipy", "highspy"} <= set(summary["versions"])
