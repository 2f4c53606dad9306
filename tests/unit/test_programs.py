"""Programs, linear and conic: solved as scipy solves them, judged by our own check, refused with reasons."""

import hashlib
import os
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import scipy.sparse as sp
from hypothesis import example, given, reject, settings
from hypothesis import strategies as st
from scipy.optimize import linprog
from structures import wall
from threadpoolctl import threadpool_info, threadpool_limits

import solver
from blockvis import generators
from solver import paper_method
from solver.programs import band, problem, solve
from solver.programs.band import run_band
from solver.programs.highs import ROUTES, run_highs
from solver.programs.problem import ConicProgram, LinearProgram, Unbounded
from solver.programs.solve import BAND, LADDER, SIMPLEX_ROWS, solve_between, solve_lp
from solver.programs.threads import one_thread


def random_program(seed, rows=12, columns=30, equalities=6):
    """A feasible program with a minimum: a point that satisfies it and multipliers that bound it are known."""
    random = np.random.default_rng(seed)
    matrix = sp.random_array((rows, columns), density=0.4, rng=random, data_sampler=random.standard_normal)
    x = random.uniform(0, 1, columns) * (random.uniform(size=columns) < 0.5)
    activity = matrix @ x
    slack = np.where(np.arange(rows) < equalities, 0.0, random.uniform(0, 1, rows))
    cost = matrix.T @ random.standard_normal(rows) + random.uniform(0, 1, columns)
    return LinearProgram(cost, sp.csc_array(matrix), activity - slack, activity + slack)


def scipy_optimum(program):
    matrix = sp.vstack([program.matrix, -program.matrix])
    result = linprog(program.cost, A_ub=matrix, b_ub=np.concatenate([program.upper, -program.lower]), method="highs-ds")
    assert result.status == 0
    return result.fun


@pytest.mark.parametrize("seed", range(12))
def test_random_programs_have_the_optimum_that_scipy_finds(seed):
    program = random_program(seed)
    solution = solve_lp(program)
    assert solution.accepted
    assert solution.objective == pytest.approx(scipy_optimum(program), abs=1e-7)


@pytest.mark.parametrize("route", ROUTES)
def test_every_route_finds_it(route):
    program = random_program(99, rows=30, columns=80, equalities=20)
    solution = solve_lp(program, (route,))
    assert solution.route == route
    assert solution.objective == pytest.approx(scipy_optimum(program), abs=1e-7)


@pytest.mark.parametrize("seed", range(4))
def test_measures_are_what_they_say(seed):
    """Feasibility and the bound from the multipliers, worked out again from the program alone."""
    program = random_program(seed)
    solution = solve_lp(program)
    activity = program.matrix @ solution.x
    assert (solution.x >= 0).all()
    assert np.maximum(program.lower - activity, activity - program.upper).max() <= solution.primal_violation + 1e-15
    reduced = program.cost - program.matrix.T @ solution.row_dual
    assert -reduced.min() <= solution.dual_violation + 1e-15
    bound = np.where(solution.row_dual > 0, solution.row_dual * program.lower, solution.row_dual * program.upper)
    assert bound.sum() == pytest.approx(solution.objective, abs=1e-6)


@pytest.mark.parametrize("field", ["x", "row_dual"])
@pytest.mark.parametrize("error", [1e-3, -1e-3])
def test_a_wrong_solution_does_not_pass_the_check(field, error):
    program = random_program(1)
    right = solve_lp(program)
    x, y = right.x.copy(), right.row_dual.copy()
    (x if field == "x" else y)[np.argmax(np.abs(x if field == "x" else y))] += error
    assert program.checked(right.x, right.row_dual, "as found").accepted
    assert not program.checked(x, y, "made up").accepted


def test_a_feasible_point_that_is_not_the_optimum_does_not_pass():
    program = random_program(2)
    right, worse = solve_lp(program), solve_lp(replace(program, cost=np.ones(30)))
    assert program.checked(worse.x, right.row_dual, "made up").primal_violation < 1e-7
    assert not program.checked(worse.x, right.row_dual, "made up").accepted


def test_unbounded_program_is_proved_by_a_ray():
    matrix = sp.csc_array(np.array([[1.0, -1.0, 0.0], [0.0, 1.0, 1.0]]))
    program = LinearProgram(np.array([-1.0, 0.5, 0.0]), sp.csc_array(matrix[:1]), np.zeros(1), np.zeros(1))
    with pytest.raises(Unbounded) as raised:
        solve_lp(program)
    ray = raised.value.x
    assert (ray >= 0).all()
    assert np.abs(program.matrix @ ray).max() < 1e-9
    assert program.cost @ ray < 0


@pytest.fixture
def too_wide(monkeypatch):
    """A large program that the method for bands refuses."""
    monkeypatch.setattr(band, "OPERATIONS", 1.0)
    rows = SIMPLEX_ROWS + 10
    return random_program(5, rows=rows, columns=3 * rows, equalities=rows // 2)


@pytest.mark.slow
def test_what_is_no_narrow_band_is_left_to_hipo(too_wide):
    found, known = solve_lp(too_wide), solve_lp(too_wide, ("simplex",))
    assert found.route == "hipo"
    assert found.objective == pytest.approx(known.objective, abs=1e-6)


@pytest.mark.slow
def test_the_simplex_method_proves_by_a_ray_what_hipo_does_not(too_wide):
    columns = np.random.default_rng(5).standard_normal((len(too_wide.lower), 4))
    ray = sp.csc_array(np.column_stack([columns, -columns.sum(axis=1)]))
    program = replace(
        too_wide,
        cost=np.concatenate([np.full(5, -1.0), too_wide.cost]),
        matrix=sp.csc_array(sp.hstack([ray, too_wide.matrix])),
    )
    with pytest.raises(solver.SolveError):
        solve_lp(program, LADDER[:2])
    with pytest.raises(Unbounded):
        solve_lp(program)


def test_large_unknowns_at_small_entries_count():
    """A force of hundreds of blocks at an arm of 1e-9: HiGHS would leave the entry out and call the rest optimal."""
    entry, large = 8e-10, 1e3
    matrix = sp.csc_array(np.array([[1.0, 0.0], [entry, 1.0]]))
    sides = np.array([large, 1.0])
    solution = solve_lp(LinearProgram(np.array([0.0, 1.0]), matrix, sides, sides))
    assert solution.x == pytest.approx([large, 1.0 - entry * large], rel=1e-9)


def test_infeasible_program_is_an_error_that_lists_the_routes():
    program = LinearProgram(np.ones(2), sp.csc_array(np.array([[1.0, 1.0]])), np.array([-2.0]), np.array([-1.0]))
    with pytest.raises(solver.SolveError, match="1 rows and 2 columns") as raised:
        solve_lp(program)
    assert "simplex:" in str(raised.value)
    assert "hipo:" in str(raised.value)


def wrong(program, route, solution):
    return replace(solution, x=2 * solution.x, primal_violation=0.1, route=route), "Optimal"


def test_another_route_is_taken_where_the_first_gives_nothing(monkeypatch):
    run, taken = run_highs, []

    def fails_first(program, route):
        taken.append(route)
        return (None, "kSolveError") if len(taken) == 1 else run(program, route)

    monkeypatch.setattr(solve, "run_highs", fails_first)
    program = random_program(3)
    solution = solve_lp(program)
    assert len(taken) == 2
    assert solution.route == taken[1] != taken[0]
    assert solution.objective == pytest.approx(scipy_optimum(program), abs=1e-7)


def test_another_route_is_taken_where_the_first_calls_a_wrong_solution_optimal(monkeypatch):
    run = run_highs

    def lies_first(program, route):
        solution, status = run(program, route)
        return wrong(program, route, solution) if route == "simplex" else (solution, status)

    monkeypatch.setattr(solve, "run_highs", lies_first)
    assert solve_lp(random_program(3)).route == "simplex without presolve"


def test_no_route_left_is_an_error_with_the_measures(monkeypatch):
    run = run_highs
    monkeypatch.setattr(solve, "run_highs", lambda program, route: wrong(program, route, run(program, route)[0]))
    with pytest.raises(solver.SolveError, match=r"simplex: Optimal, violation 1\.0e-01"):
        solve_lp(random_program(3))


def test_solver_failure_is_not_collapse(monkeypatch):
    """HiGHS that gives nothing from some program on is told as such, with what was found before."""
    run, calls = run_highs, []

    def breaks(program, route):
        calls.append(route)
        return run(program, route) if len(calls) <= 8 else (None, "kSolveError")

    monkeypatch.setattr(solve, "run_highs", breaks)
    spread = solver.Settlement(direction=(1, 0), increment=0.02, limit=0.5)
    response = solver.settle(generators.arch(), spread, friction_coefficient=2.0)
    assert response.stop is solver.Status.SOLVER_FAILED
    assert "kSolveError" in response.message
    assert response.collapse is None
    assert len(response.path) > 0


def test_same_program_twice_gives_the_same_numbers():
    program = random_program(4)
    first, second = solve_lp(program), solve_lp(program)
    assert (first.x == second.x).all()
    assert (first.row_dual == second.row_dual).all()


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


def solved_by_cones(given):
    """Its solution by the route of programs whose rows are equations."""
    stated = LinearProgram(given.cost, given.matrix, given.right, given.right)
    return solve_between(stated, given.friction, given.size)


@pytest.mark.thorough
@settings(max_examples=15, deadline=None)
@given(st.integers(0, 10**6), st.integers(1, 6))
def test_pyramids_come_down_to_the_round_cones(seed, cones):
    given = program(seed, cones)
    found = solved_by_cones(given).objective
    few, many = (solve_lp(pyramids(given, rays)).objective for rays in (8, 512))
    assert found - 1e-6 * (1 + abs(found)) <= many <= few + 1e-6 * (1 + abs(few))
    # What they leave falls with the square of their rays, for a program that is not steep.
    assert many - found <= (few - found) / 100 + 1e-4 * (1 + abs(found))


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 10**6), st.integers(1, 6), st.sampled_from([2, 3, 4]))
def test_programs_with_a_solution_pass_the_check(seed, cones, size):
    assert solved_by_cones(program(seed, cones, size)).accepted


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10**6), st.floats(1e-4, 1.0), st.sampled_from(["forces", "motion", "both"]))
def test_the_check_refuses_what_is_off(seed, size, which):
    given = program(seed)
    right = solved_by_cones(given)
    random = np.random.default_rng(seed)
    x, y = right.x, right.row_dual
    if which != "motion":
        x = x + size * random.normal(size=len(x))
    if which != "forces":
        y = y + size * random.normal(size=len(y))
    assert not given.checked(x, y, "off").accepted


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10**6), st.floats(1e-3, 1e3))
def test_the_check_does_not_know_units_of_force(seed, unit):
    """Forces and loads in other units: violations and gap stay relative."""
    given = program(seed)
    right = solved_by_cones(given)
    other = replace(given, right=unit * given.right).checked(unit * right.x, right.row_dual, "scaled")
    assert other.objective == pytest.approx(unit * right.objective)
    assert other.accepted


def test_a_cone_is_round():
    """The force that costs least along each direction T = (cos, sin) lies on the circle, and its normal is |T| / μ."""
    angle = np.linspace(0.0, 6.0, 7)
    for t in np.stack([np.cos(angle), np.sin(angle)], axis=1):
        matrix = sp.csc_array(np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]))
        given = ConicProgram(np.array([1.0, 0.0, 0.0]), matrix, t, np.array([0.5]))
        np.testing.assert_allclose(solved_by_cones(given).x, [2.0, *t], atol=2e-6)


def test_no_friction_no_shear_force():
    matrix = sp.csc_array(np.hstack([np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]), np.eye(2), -np.eye(2)]))
    given = ConicProgram(np.array([0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0]), matrix, np.array([1.0, 0.3]), np.zeros(1))
    found = solved_by_cones(given)
    assert found.objective == pytest.approx(0.3, abs=1e-7)
    np.testing.assert_allclose(found.x[:3], [1.0, 0.0, 0.0], atol=1e-6)


def test_an_unlimited_objective_is_proved_by_a_ray():
    """Two points that press against each other, for a reward."""
    matrix = sp.csc_array(np.array([[1.0, 0.0, 0.0, -1.0, 0.0, 0.0]]))
    cost = np.array([-1.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    given = ConicProgram(cost, matrix, np.zeros(1), np.array([0.5, 0.5]))
    with pytest.raises(Unbounded) as found:
        solved_by_cones(given)
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
        solved_by_cones(given)
    assert "clarabel: no x balances the rows" in str(error.value)


def test_bounds_of_rows_in_programs_with_and_without_cones():
    """Largest N with N ≤ 3 and N + T ≥ 1: what is left of a row to its bounds becomes columns."""
    cost, matrix = np.array([-1.0, 0.0, 0.0]), sp.csc_array(np.array([[0.0, 1.0, 0], [1.0, 0.0, 0], [1.0, 1.0, 0]]))
    lower, upper = np.array([0.5, 0.0, 1.0]), np.array([0.5, 3.0, 9.0])
    program = LinearProgram(cost, matrix, lower, upper)
    found = solve_between(program, np.array([0.5]), 3)
    np.testing.assert_allclose(found.x[:2], [3.0, 0.5], atol=1e-7)
    alone = solve_between(program, np.zeros(0), 3)
    np.testing.assert_allclose(alone.x[:2], [3.0, 0.5], atol=1e-7)


def chain(seed, blocks, degenerate=False):
    """A program like a wall's: columns that join neighbours, slack of either sign in every row, a small tolerance."""
    random = np.random.default_rng(seed)
    rows, columns = 3 * blocks, 12 * blocks
    first = random.integers(0, blocks - 1, columns)
    row = 3 * first[:, None] + np.arange(6)
    values = random.standard_normal((columns, 6))
    if degenerate:
        # Contact points twice over.
        row, values = np.vstack([row, row]), np.vstack([values, values])
        columns *= 2
    joints = sp.csc_array((values.ravel(), row.ravel(), np.arange(0, 6 * columns + 1, 6)), shape=(rows, columns))
    carried = random.uniform(0.0, 1.0, columns) * (random.uniform(size=columns) < 0.3)
    middle = joints @ carried + np.where(random.uniform(size=rows) < 0.1, 1.0, 0.0)
    cost = random.uniform(0.0, 0.1, columns) * (random.uniform(size=columns) < 0.7)
    matrix = sp.csc_array(sp.hstack([joints, sp.eye_array(rows), -sp.eye_array(rows)]))
    return problem.LinearProgram(np.concatenate([cost, np.ones(2 * rows)]), matrix, middle - 1e-6, middle + 1e-6)


def solved(program):
    return run_band(program)[0]


EXACT = {"dual_feasibility_tolerance": 1e-10, "primal_feasibility_tolerance": 1e-10}


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10_000), st.integers(2, 40), st.booleans())
@example(273, 19, False)
@example(390, 33, True)
def test_finds_the_optimum_that_scipy_finds(seed, blocks, degenerate):
    program = chain(seed, blocks, degenerate)
    found = solved(program)
    if found is None:
        # One in a thousand: forces that cost next to nothing and grow to 1e5 loads.
        reject()
    assert found.accepted
    both = sp.vstack([program.matrix, -program.matrix])
    sides = np.concatenate([program.upper, -program.lower])
    known = linprog(program.cost, A_ub=both, b_ub=sides, method="highs-ds", options=EXACT)
    # Reduced costs that are negative by a rounding, of either, leave large forces of the other that much cheaper.
    off = found.dual_violation * float(np.abs(known.x).sum())
    off += float(-known.lower.marginals.min(initial=0.0)) * float(np.abs(found.x).sum())
    assert found.objective == pytest.approx(known.fun, abs=1e-7 * (1 + abs(known.fun)) + off)


@pytest.mark.thorough
def test_hardly_ever_gives_up():
    """Of 200 programs, half of them with every contact point twice over, all are solved."""
    found = [solved(chain(seed, 2 + seed % 40, seed % 2 == 1)) for seed in range(200)]
    assert all(solution.accepted for solution in found)


def programs_of(monkeypatch, assembly, **settlement):
    """The programs of a run, with the solutions it went on with."""
    kept = []

    def keeping(program, routes=None):
        kept.append((program, solve_lp(program, routes)))
        return kept[-1][1]

    monkeypatch.setattr(paper_method, "solve_lp", keeping)
    controls = solver.Controls(increments="linear program")
    solver.settle(assembly, solver.Settlement(**settlement), friction_coefficient=0.6, controls=controls)
    return kept


@pytest.mark.slow
def test_walls_take_it_and_it_agrees_with_highs(monkeypatch):
    """Every program of a wall of 140 bricks."""
    kept = programs_of(monkeypatch, wall(15, 9), direction=(0.0, -1.0), increment=2e-3, limit=2e-3)
    assert len(kept) > 4
    assert {solution.route for _, solution in kept} == {BAND}
    for program, solution in kept[1:]:
        known = solve_lp(program, ("hipo",))
        assert solution.objective == pytest.approx(known.objective, abs=1e-7 * (1 + abs(known.objective)))


def test_refuses_a_wide_band_before_it_fills_the_memory():
    """Columns that join 30,000 rows to any others would make 900 million entries of the normal equations."""
    rows = 30_000
    across = sp.random_array((rows, rows), density=2.0 / rows, rng=np.random.default_rng(1), format="csc")
    matrix = sp.csc_array(sp.hstack([across, sp.eye_array(rows), -sp.eye_array(rows)]))
    found, status = run_band(problem.LinearProgram(np.ones(3 * rows), matrix, np.zeros(rows), np.ones(rows)))
    assert found is None
    assert re.search(r"30000 rows in a band \d+ wide", status)


@pytest.mark.parametrize("blocks", [2, 30, 150])
@pytest.mark.parametrize("seed", range(3))
def test_a_load_on_every_block_and_equations_without_slack(seed, blocks):
    """Two columns with an entry in every row, as a live load has, and rows that are equations: as scipy finds."""
    random, given = np.random.default_rng(seed), chain(seed, blocks)
    rows, joints = 3 * blocks, given.matrix.shape[1] - 6 * blocks
    wide = sp.csc_array(random.standard_normal((rows, 2)))
    matrix = sp.csc_array(sp.hstack([wide, given.matrix[:, :joints]]))
    x = np.concatenate([[0.3, 0.0], random.uniform(0.5, 1.0, joints)])
    cost = np.concatenate([[-1.0, 0.5], random.uniform(0.1, 1.0, joints)])
    # The cost is that of prices that leave no column negative, lest there be no least.
    cost = np.maximum(cost, 0.0) + matrix.T @ random.standard_normal(rows)
    program = problem.LinearProgram(cost, matrix, matrix @ x, matrix @ x)
    known = linprog(cost, A_eq=matrix, b_eq=program.lower, method="highs-ds")
    found = solved(program)
    assert found.accepted
    assert found.objective == pytest.approx(known.fun, abs=2e-7 * (1 + abs(known.fun)))
    assert len(found.row_dual) == rows


def test_an_objective_that_falls_without_limit_is_proved_by_its_ray():
    """Two columns against each other that cost less than nothing."""
    program = chain(2, 10)
    ray = sp.csc_array(([1.0, -1.0], [0, 0], [0, 1, 2]), shape=(30, 2))
    program = problem.LinearProgram(
        np.concatenate([[-1.0, -1.0], program.cost]),
        sp.csc_array(sp.hstack([ray, program.matrix])),
        program.lower,
        program.upper,
    )
    with pytest.raises(problem.Unbounded) as proved:
        solve_lp(program, (BAND,))
    assert np.abs(program.matrix @ proved.value.x).max() < 1e-9
    assert program.cost @ proved.value.x < -0.1
    assert (proved.value.x >= 0.0).all()


def test_a_ray_that_does_not_prove_it_counts_for_nothing():
    program = chain(2, 10)
    program.raise_if_unbounded(np.ones(program.matrix.shape[1]))
    program.raise_if_unbounded(np.zeros(program.matrix.shape[1]))


@pytest.mark.slow
def test_a_wall_squeezed_between_its_supports_is_locked():
    """520 bricks that cannot give way: proved by our own ray, for which HiGHS takes ten times as long."""
    standing = wall(30, 17)
    width, height = 30 * 0.25, 17 * 0.1
    rings = np.split(standing.vertices, standing.offsets[1:-1])[:-2]
    press = [[[x, 0.0], [x + 1.0, 0.0], [x + 1.0, height], [x, height]] for x in (-1.0, width)]
    ground = [[-1.0, -1.0], [width + 1.0, -1.0], [width + 1.0, 0.0], [-1.0, 0.0]]
    roles = ["free"] * len(rings) + ["fixed", "moving", "fixed"]
    squeezed = solver.Assembly.from_outlines([*rings, *press, ground], roles=roles)
    inwards = solver.Settlement(direction=(-1.0, 0.0), increment=1e-3, limit=1e-2)
    response = solver.settle(squeezed, inwards, friction_coefficient=0.6)
    assert response.stop is solver.Status.LOCKED


WHILE_LIMITED = """
import hashlib, sys
from solver.programs.threads import linear_algebra, one_thread
threads = lambda: [library.num_threads for library in linear_algebra().lib_controllers]
before = threads()
with one_thread():
    during = threads()
try:
    with one_thread():
        raise KeyError
except KeyError:
    pass
after = threads()
print(before == after, before[0], during)
from test_programs import chain, digest, solved
print(digest(solved(chain(5, 200))))
"""


def digest(solution):
    return hashlib.sha256(solution.x.tobytes() + solution.row_dual.tobytes()).hexdigest()


@pytest.fixture(scope="module")
def with_two_threads():
    """What a process says that has two threads for the linear algebra; this one may have one."""
    environment = {name: value for name, value in os.environ.items() if not name.endswith("NUM_THREADS")}
    paths = os.pathsep.join([str(Path(__file__).parent), *sys.path])
    return subprocess.run(
        [sys.executable, "-c", WHILE_LIMITED],
        env=environment | {"OPENBLAS_NUM_THREADS": "2", "PYTHONPATH": paths},
        capture_output=True,
        text=True,
        check=True,
    ).stdout.splitlines()


@pytest.mark.slow
def test_threads_are_limited_and_given_back(with_two_threads):
    assert with_two_threads[0].split() == ["True", "2", "[1,", "1]"]


def test_threads_are_given_back_by_the_last_of_several_analyses_at_once():
    """The second saved the one thread of the first, and gave that back."""

    def threads():
        return [library["num_threads"] for library in threadpool_info() if library["user_api"] == "blas"]

    with threadpool_limits(2, user_api="blas"):
        before, first, second = threads(), one_thread(), one_thread()
        first.__enter__()
        second.__enter__()
        first.__exit__(None, None, None)
        assert set(threads()) == {1}
        second.__exit__(None, None, None)
        assert threads() == before
        assert max(before) == 2


@pytest.mark.slow
def test_same_bits_with_any_number_of_threads(with_two_threads):
    program = chain(5, 200)
    assert digest(solved(program)) == with_two_threads[1]
    with one_thread():
        assert digest(solved(program)) == with_two_threads[1]


def test_an_order_of_the_rows_makes_no_difference_but_the_width():
    """Rows in any order, told where they lie: the same optimum, in a band as narrow as in order."""
    program = chain(7, 40)
    order = np.random.default_rng(0).permutation(40)
    rows = (3 * order[:, None] + np.arange(3)).ravel()
    shuffled = problem.LinearProgram(
        program.cost,
        sp.csc_array(program.matrix[rows]),
        program.lower[rows],
        program.upper[rows],
        np.repeat(order, 3)[:, None],
    )
    first, second = solved(program), solve_lp(shuffled, (BAND,))
    assert second.objective == pytest.approx(first.objective, abs=1e-7 * (1 + abs(first.objective)))
    assert band._Band(shuffled.matrix, shuffled.places).width == 6


@pytest.mark.parametrize("seed", range(3))
def test_rows_of_one_column_bound_it_and_widen_no_band(seed):
    """As mortar does of many joints: some columns are bounded from both sides, or twice."""
    random, program = np.random.default_rng(seed), chain(seed, 30)
    columns = random.choice(program.matrix.shape[1] - 180, 40)
    bounds = sp.csr_array(
        (random.uniform(-2.0, 2.0, 40), (np.arange(40), columns)), shape=(40, program.matrix.shape[1])
    )
    bounded = LinearProgram(
        program.cost,
        sp.csc_array(sp.vstack([bounds[:20], program.matrix, bounds[20:]])),
        np.concatenate([np.full(20, -0.2), program.lower, np.full(20, -0.2)]),
        np.concatenate([np.full(20, 0.2), program.upper, np.full(20, 0.2)]),
    )
    assert len(np.unique(columns)) < 40
    assert solved(bounded).objective == pytest.approx(scipy_optimum(bounded), rel=1e-6)
    assert band._Band(bounded.matrix, None).width <= band._Band(program.matrix, None).width + 2


def test_a_program_of_bounds_alone_is_left_to_others():
    program = LinearProgram(np.ones(4), sp.csc_array(np.eye(4)), np.ones(4), np.full(4, 2.0))
    assert run_band(program) == (None, "every row bounds one column")
    assert solve_lp(program, (BAND, *ROUTES)).objective == pytest.approx(4.0)


def test_what_comes_no_nearer_is_taken_where_the_check_accepts_it(monkeypatch):
    """A tolerance below rounding is never reached; what was nearest passes the check."""
    monkeypatch.setattr(band, "INTERIOR_TOLERANCE", 1e-30)
    assert solved(chain(5, 60)).accepted
