"""Conic programs: each way to a solution, and the check that none of them gets around."""

import re
from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp
from hypothesis import given, settings
from hypothesis import strategies as st

from solver.cones.clarabel import run_clarabel
from solver.cones.cuts import run_cuts
from solver.cones.interior import run_interior
from solver.cones.problem import ConicProgram, checked, raise_if_proved
from solver.cones.solve import LADDER, OWN, solve_between, solve_cones
from solver.lp.problem import SolveError, Unbounded


def program(seed, cones=4, size=3, rows=5):
    """A random program with points inside its cones and their duals: it has a solution."""
    random = np.random.default_rng(seed)
    friction = random.uniform(0.1, 1.5, cones)
    matrix = sp.csc_array(np.hstack([random.normal(size=(rows, size * cones)), np.eye(rows), -np.eye(rows)]))
    given = ConicProgram(np.zeros(matrix.shape[1]), matrix, np.zeros(rows), friction, size)
    x, s = inside(given, random), inside(given, random)
    return replace(given, cost=matrix.T @ random.normal(size=rows) + s / given.scale**2, right=matrix @ x)


def inside(given, random):
    """A point inside the cones; over the square of their scale it is one inside their duals."""
    point = random.uniform(0.1, 1.0, len(given.cost))
    cones = point[: given.in_cones].reshape(-1, given.size)
    direction = random.normal(size=(len(cones), given.size - 1))
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    cones[:, 1:] = direction * (given.friction * cones[:, 0] * random.uniform(0.0, 0.9, len(cones)))[:, None]
    return point


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 10**6), st.integers(1, 6), st.sampled_from([3, 4]))
def test_every_way_finds_the_same_and_passes_the_check(seed, cones, size):
    given = program(seed, cones, size)
    found = [run_clarabel(given, "clarabel")[0], run_interior(given)[0], run_cuts(given)[0]]
    assert all(solution.accepted for solution in found)
    for other in found[1:]:
        assert other.objective == pytest.approx(found[0].objective, rel=1e-6, abs=1e-6)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10**6), st.floats(1e-4, 1.0), st.sampled_from(["forces", "motion", "both"]))
def test_the_check_refuses_what_is_off(seed, size, which):
    given = program(seed)
    right = solve_cones(given)
    random = np.random.default_rng(seed)
    x, y = right.x, right.row_dual
    if which != "motion":
        x = x + size * random.normal(size=len(x))
    if which != "forces":
        y = y + size * random.normal(size=len(y))
    assert not checked(given, x, y, "off", 0, 0.0).accepted


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10**6), st.floats(1e-3, 1e3))
def test_the_check_does_not_know_units_of_force(seed, unit):
    """Forces and loads in other units: violations and gap stay relative."""
    given = program(seed)
    right = solve_cones(given)
    other = checked(replace(given, right=unit * given.right), unit * right.x, right.row_dual, "scaled", 0, 0.0)
    assert other.objective == pytest.approx(unit * right.objective)
    assert other.accepted


def test_a_cone_is_round():
    """The force that costs least along each direction T = (cos, sin) lies on the circle, and its normal is |T| / μ."""
    angle = np.linspace(0.0, 6.0, 7)
    for t in np.stack([np.cos(angle), np.sin(angle)], axis=1):
        matrix = sp.csc_array(np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]))
        given = ConicProgram(np.array([1.0, 0.0, 0.0]), matrix, t, np.array([0.5]))
        for route in ("clarabel", OWN, "cuts"):
            found = solve_cones(given, (route,))
            np.testing.assert_allclose(found.x, [2.0, *t], atol=2e-6)


def test_no_friction_no_shear_force():
    matrix = sp.csc_array(np.hstack([np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]), np.eye(2), -np.eye(2)]))
    given = ConicProgram(np.array([0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0]), matrix, np.array([1.0, 0.3]), np.zeros(1))
    for route in ("clarabel", OWN, "cuts"):
        found = solve_cones(given, (route,))
        assert found.objective == pytest.approx(0.3, abs=1e-7)
        np.testing.assert_allclose(found.x[:3], [1.0, 0.0, 0.0], atol=1e-6)


def test_an_unlimited_objective_is_proved_by_a_ray():
    """Two points that press against each other, for a reward."""
    matrix = sp.csc_array(np.array([[1.0, 0.0, 0.0, -1.0, 0.0, 0.0]]))
    cost = np.array([-1.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    given = ConicProgram(cost, matrix, np.zeros(1), np.array([0.5, 0.5]))
    for run in (lambda: run_clarabel(given, "clarabel"), lambda: run_cuts(given), lambda: solve_cones(given)):
        with pytest.raises(Unbounded) as found:
            run()
        assert np.abs(matrix @ found.value.x).max() < 1e-8
        assert cost @ found.value.x < 0.0
    # Neither a ray that does not balance, nor one outside of the cones, nor one that costs.
    for ray in ([1.0, 0, 0, 0, 0, 0], [1.0, 1.0, 0, 1.0, 0, 0], [-1.0, 0, 0, -1.0, 0, 0], [0, 0, 0, 0, 0, 0]):
        raise_if_proved(given, np.array(ray))


def test_a_failure_says_what_every_way_ended_with():
    """Nothing balances a pull: an error, with a line for each way."""
    given = ConicProgram(np.ones(3), sp.csc_array(np.array([[1.0, 0.0, 0.0]])), np.array([-1.0]), np.array([0.5]))
    with pytest.raises(
        SolveError, match=re.escape("no solution of the conic program with 1 rows and 1 cones")
    ) as error:
        solve_cones(given, (OWN, *LADDER))
    assert all(f"{route}: " in str(error.value) for route in (OWN, *LADDER))
    assert "no x balances the rows" in str(error.value)


def test_bounds_of_rows_in_programs_with_and_without_cones():
    """Largest N with N ≤ 3 and N + T ≥ 1: what is left of a row to its bounds becomes columns."""
    cost, matrix = np.array([-1.0, 0.0, 0.0]), sp.csc_array(np.array([[0.0, 1.0, 0], [1.0, 0.0, 0], [1.0, 1.0, 0]]))
    lower, upper = np.array([0.5, 0.0, 1.0]), np.array([0.5, 3.0, 9.0])
    found = solve_between(cost, matrix, lower, upper, np.array([0.5]), 3)
    np.testing.assert_allclose(found.x[:2], [3.0, 0.5], atol=1e-7)
    alone = solve_between(cost, matrix, lower, upper, np.zeros(0), 3)
    np.testing.assert_allclose(alone.x[:2], [3.0, 0.5], atol=1e-7)


def test_the_band_refuses_a_load_on_every_block():
    given = program(3)
    matrix = sp.csc_array(sp.hstack([given.matrix, sp.csc_array(np.ones((5, 1)))]))
    found, status = run_interior(replace(given, cost=np.append(given.cost, 1.0), matrix=matrix))
    assert found is None
    assert "several rows" in status
