"""Conic programs: solved, and the check that no solution gets around."""

import re
from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp
from hypothesis import given, settings
from hypothesis import strategies as st

import solver
from solver.programs.problem import ConicProgram, LinearProgram, Unbounded
from solver.programs.solve import solve_between, solve_cones, solve_lp


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


def pyramids(given, rays):
    """The linear program over so many rays of each cone of three numbers: its forces lie within the round ones."""
    angle = 2.0 * np.pi * np.arange(rays) / rays
    blocks = [np.stack([np.ones(rays), mu * np.cos(angle), mu * np.sin(angle)]) for mu in given.friction]
    columns = sp.block_diag([*blocks, np.eye(len(given.cost) - given.in_cones)], format="csc")
    return LinearProgram(columns.T @ given.cost, sp.csc_array(given.matrix @ columns), given.right, given.right)


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 10**6), st.integers(1, 6))
def test_pyramids_come_down_to_the_round_cones(seed, cones):
    given = program(seed, cones)
    found = solve_cones(given).objective
    few, many = (solve_lp(pyramids(given, rays)).objective for rays in (8, 512))
    assert found - 1e-6 * (1 + abs(found)) <= many <= few + 1e-6 * (1 + abs(few))
    # What they leave falls with the square of their rays, for a program that is not steep.
    assert many - found <= (few - found) / 100 + 1e-4 * (1 + abs(found))


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 10**6), st.integers(1, 6), st.sampled_from([2, 3, 4]))
def test_programs_with_a_solution_pass_the_check(seed, cones, size):
    assert solve_cones(program(seed, cones, size)).accepted


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
    assert not given.checked(x, y, "off", 0).accepted


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10**6), st.floats(1e-3, 1e3))
def test_the_check_does_not_know_units_of_force(seed, unit):
    """Forces and loads in other units: violations and gap stay relative."""
    given = program(seed)
    right = solve_cones(given)
    other = replace(given, right=unit * given.right).checked(unit * right.x, right.row_dual, "scaled", 0)
    assert other.objective == pytest.approx(unit * right.objective)
    assert other.accepted


def test_a_cone_is_round():
    """The force that costs least along each direction T = (cos, sin) lies on the circle, and its normal is |T| / μ."""
    angle = np.linspace(0.0, 6.0, 7)
    for t in np.stack([np.cos(angle), np.sin(angle)], axis=1):
        matrix = sp.csc_array(np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]))
        given = ConicProgram(np.array([1.0, 0.0, 0.0]), matrix, t, np.array([0.5]))
        np.testing.assert_allclose(solve_cones(given).x, [2.0, *t], atol=2e-6)


def test_no_friction_no_shear_force():
    matrix = sp.csc_array(np.hstack([np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]), np.eye(2), -np.eye(2)]))
    given = ConicProgram(np.array([0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0]), matrix, np.array([1.0, 0.3]), np.zeros(1))
    found = solve_cones(given)
    assert found.objective == pytest.approx(0.3, abs=1e-7)
    np.testing.assert_allclose(found.x[:3], [1.0, 0.0, 0.0], atol=1e-6)


def test_an_unlimited_objective_is_proved_by_a_ray():
    """Two points that press against each other, for a reward."""
    matrix = sp.csc_array(np.array([[1.0, 0.0, 0.0, -1.0, 0.0, 0.0]]))
    cost = np.array([-1.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    given = ConicProgram(cost, matrix, np.zeros(1), np.array([0.5, 0.5]))
    with pytest.raises(Unbounded) as found:
        solve_cones(given)
    assert np.abs(matrix @ found.value.x).max() < 1e-8
    assert cost @ found.value.x < 0.0
    # Neither a ray that does not balance, nor one outside of the cones, nor one that costs.
    for ray in ([1.0, 0, 0, 0, 0, 0], [1.0, 1.0, 0, 1.0, 0, 0], [-1.0, 0, 0, -1.0, 0, 0], [0, 0, 0, 0, 0, 0]):
        given.raise_if_unbounded(np.array(ray))


def test_a_failure_says_what_it_ended_with():
    """Nothing balances a pull."""
    given = ConicProgram(np.ones(3), sp.csc_array(np.array([[1.0, 0.0, 0.0]])), np.array([-1.0]), np.array([0.5]))
    with pytest.raises(
        solver.SolveError, match=re.escape("no solution of the conic program with 1 rows and 1 cones")
    ) as error:
        solve_cones(given)
    assert "clarabel: no x balances the rows" in str(error.value)


def test_bounds_of_rows_in_programs_with_and_without_cones():
    """Largest N with N ≤ 3 and N + T ≥ 1: what is left of a row to its bounds becomes columns."""
    cost, matrix = np.array([-1.0, 0.0, 0.0]), sp.csc_array(np.array([[0.0, 1.0, 0], [1.0, 0.0, 0], [1.0, 1.0, 0]]))
    lower, upper = np.array([0.5, 0.0, 1.0]), np.array([0.5, 3.0, 9.0])
    found = solve_between(cost, matrix, lower, upper, np.array([0.5]), 3)
    np.testing.assert_allclose(found.x[:2], [3.0, 0.5], atol=1e-7)
    alone = solve_between(cost, matrix, lower, upper, np.zeros(0), 3)
    np.testing.assert_allclose(alone.x[:2], [3.0, 0.5], atol=1e-7)
