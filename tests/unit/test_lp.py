"""Linear programs: solved as scipy solves them, judged by our own check, refused with reasons."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp
from scipy.optimize import linprog

import solver
from solver.programs import band, solve
from solver.programs.highs import ROUTES, run_highs
from solver.programs.problem import LinearProgram, Unbounded
from solver.programs.solve import LADDER, SIMPLEX_ROWS, solve_lp


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
    assert program.checked(right.x, right.row_dual, "as found", 0).accepted
    assert not program.checked(x, y, "made up", 0).accepted


def test_a_feasible_point_that_is_not_the_optimum_does_not_pass():
    program = random_program(2)
    right, worse = solve_lp(program), solve_lp(replace(program, cost=np.ones(30)))
    assert program.checked(worse.x, right.row_dual, "made up", 0).primal_violation < 1e-7
    assert not program.checked(worse.x, right.row_dual, "made up", 0).accepted


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
        solve_lp(program, LADDER[:-1])
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
    assert solve_lp(random_program(3)).route == "hipo"


def test_no_route_left_is_an_error_with_the_measures(monkeypatch):
    run = run_highs
    monkeypatch.setattr(solve, "run_highs", lambda program, route: wrong(program, route, run(program, route)[0]))
    with pytest.raises(solver.SolveError, match=r"simplex: Optimal, violation 1\.0e-01"):
        solve_lp(random_program(3))


def test_same_program_twice_gives_the_same_numbers():
    program = random_program(4)
    first, second = solve_lp(program), solve_lp(program)
    assert (first.x == second.x).all()
    assert (first.row_dual == second.row_dual).all()
