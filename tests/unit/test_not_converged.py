"""A limit load that has not converged says what to do."""

import pytest

from blockvis.cli import main

CASE = """
[geometry]
layout = "arch"
[geometry.parameters]
voussoirs = 5
[analysis]
kind = "limit load"
flow = "non-associative"
[[loads]]
kind = "live"
weight_fraction = [1, 0]
"""


@pytest.mark.slow
def test_the_upper_bound_is_named(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("solver.analysis.limit_load.PROGRAMS", 1)
    (tmp_path / "case.toml").write_text(CASE, encoding="utf-8")
    assert main(["run", str(tmp_path / "case.toml"), "-o", str(tmp_path / "out"), "--no-pictures"]) == 3
    (said,) = (line for line in capsys.readouterr().out.splitlines() if line.startswith("status"))
    assert "not converged" in said
    assert 'flow = "associative" gives a proved upper bound' in said
