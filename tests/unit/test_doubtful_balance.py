"""Programs that no route solves to its check may still prove that there is no equilibrium."""

from dataclasses import replace
from importlib import import_module

import pytest
from structures import box

import solver


@pytest.mark.parametrize(
    ("violation", "status"),
    [(1e-6, solver.Status.NO_INITIAL_EQUILIBRIUM), (1.0, solver.Status.SOLVER_FAILED)],
)
def test_a_dual_proves_forces_out_of_balance_beyond_its_own_violation(monkeypatch, violation, status):
    """A block whose centroid is 0.3 m beyond the edge it stands on, and solutions that violate as much as is said."""
    solve_between = import_module("solver.program.static_program").solve_between

    def doubtful(*program, **options):
        solution = replace(solve_between(*program, **options), primal_violation=violation, dual_violation=violation)
        raise solver.SolveError("no solution passed its check", solution)

    monkeypatch.setattr("solver.program.static_program.solve_between", doubtful)
    solids = [box((0.8, 0.0, 0.0), (1.8, 1.0, 1.0)), box((-1.0, 0.0, -1.0), (1.0, 1.0, 0.0))]
    assembly = solver.Assembly.from_solids(solids, roles=["free", "moving"])
    sinks = solver.Settlement(direction=(0, 0, -1), increment=0.01, limit=0.01)
    assert solver.settle(assembly, sinks, friction_coefficient=0.6).stop is status
