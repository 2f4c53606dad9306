"""A limit load that has not converged says what to do."""

import pytest
from structures import case_from

from blockvis import run_case
from blockvis.kinds.kinds import KINDS

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
def test_the_upper_bound_is_named(tmp_path, monkeypatch):
    monkeypatch.setattr("solver.analysis.limit_load.PROGRAMS", 1)
    run = run_case(case_from(CASE, tmp_path), tmp_path / "out", pictures=False, film=False, outputs=())
    said = [line for line in KINDS["limit load"].lines(run.response) if line.startswith("status")]
    assert len(said) == 1
    assert "not converged" in said[0]
    assert 'flow = "associative" gives a proved upper bound' in said[0]
