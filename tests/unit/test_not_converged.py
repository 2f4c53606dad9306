"""A limit load that has not converged says what to do."""

import json
from dataclasses import replace

import numpy as np
import pytest

import blockvis
import solver
from blockvis import generators
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
    monkeypatch.setattr("solver.program.non_associative.PROGRAMS", 1)
    (tmp_path / "case.toml").write_text(CASE, encoding="utf-8")
    assert main(["run", str(tmp_path / "case.toml"), "-o", str(tmp_path / "out"), "--no-pictures"]) == 3
    (said,) = (line for line in capsys.readouterr().out.splitlines() if line.startswith("status"))
    assert "not converged: no limit load" in said
    bound = solver.limit_load(generators.build("arch", {"voussoirs": 5}), acceleration=(1, 0)).multiplier
    assert f'at most that of flow = "associative", {bound:.6g}, a proved upper bound' in said


@pytest.mark.parametrize(("push", "bounded"), [((0.5, 1.0), True), ((0.0, -1.0), False)])
def test_no_value_is_above_the_associative_one(push, bounded, monkeypatch):
    """The first program of this wall has 0.735 where its associative limit load is 0.545."""
    monkeypatch.setattr("solver.program.non_associative.PROGRAMS", 1)
    built = generators.build("wall", {"bricks": 3, "courses": 3}) if bounded else generators.build("arch", {})
    structure = solver.Structure(built, friction_coefficient=0.6)
    upper = structure.limit_load(acceleration=push).multiplier
    found = structure.limit_load(acceleration=push, flow="non-associative")
    assert found.status is solver.LimitStatus.NOT_CONVERGED
    assert found.bounds == (found.multiplier, pytest.approx(upper))
    assert found.multiplier <= found.bounds[1]
    assert ("at most" in str(found)) is bounded is bool(np.isfinite(upper))


@pytest.mark.slow
def test_positions_without_a_limit_load_are_told_and_the_certificate_is_of_the_one_that_governs(
    tmp_path, monkeypatch, capsys
):
    limit_load, found = solver.Structure.limit_load, []

    def second_fails(self, **options):
        found.append(limit_load(self, **options))
        if len(found) == 2:
            worse = replace(found[1].certificate, equilibrium_residual=0.5)
            return replace(found[1], status=solver.LimitStatus.NOT_CONVERGED, certificate=worse)
        return found[-1]

    monkeypatch.setattr(solver.Structure, "limit_load", second_fails)
    moving = CASE.replace("weight_fraction = [1, 0]", "force = [0, -1000]\npositions = [-0.5, 0.5, 3]")
    (tmp_path / "case.toml").write_text(moving, encoding="utf-8")
    assert main(["run", str(tmp_path / "case.toml"), "-o", str(tmp_path / "out")], outputs=()) == 0
    said, words = capsys.readouterr().out, "1 of 3 positions did not converge: x = 0 m"
    assert f"note: {words}" in said
    assert "certificate: equilibrium residual 5.0e-01" not in said
    summary = json.loads((tmp_path / "out" / "summary.json").read_text(encoding="utf-8"))
    assert words in summary["message"]
    response = blockvis.open_results(tmp_path / "out")
    assert "not converged" in blockvis.draw_curve(response, tmp_path / "curve.svg").read_text(encoding="utf-8")


@pytest.mark.slow
def test_a_cross_vault_whose_programs_go_in_circles_is_accelerated_to_a_limit_load():
    """A complete solution: in equilibrium, within friction, and the power of the loads is what friction takes."""
    vault = generators.cross_vault(span=4.0, rise=1.5, thickness=0.3, voussoirs=5, stone=3.0)
    # At 0.45 along the diagonal, rounding decides whether it converges.
    friction = 0.7
    live = solver.weight_fraction(vault, (1.0, 0.0, 0.0), np.flatnonzero(vault.free))
    loads = solver.Loads(solver.self_weight(vault).dead, live)
    associative = solver.limit_load(vault, loads=loads, friction_coefficient=friction)
    limit = solver.limit_load(vault, loads=loads, friction_coefficient=friction, flow="non-associative")
    assert limit.status is solver.LimitStatus.FOUND
    assert 0.5 * associative.multiplier < limit.multiplier < associative.multiplier
    assert abs(limit.gap) < 1e-5
    assert limit.certificate.friction_excess < 1e-7
    assert limit.certificate.equilibrium_residual < 1e-9
