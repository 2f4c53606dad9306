"""The interior point method for bands: the optimum that scipy finds, at every size, or a reason why not."""

import hashlib
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import scipy.sparse as sp
from hypothesis import example, given, reject, settings
from hypothesis import strategies as st
from scipy.optimize import linprog
from structures import wall

import solver
from solver import paper_method
from solver.programs import band, problem
from solver.programs.band import narrowest, run_band
from solver.programs.solve import BAND, solve_lp
from solver.programs.threads import one_thread


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
    """Of 200 programs, half of them with every contact point twice over, all are solved, in 10 to 20 iterations."""
    found = [solved(chain(seed, 2 + seed % 40, seed % 2 == 1)) for seed in range(200)]
    assert all(solution.accepted for solution in found)
    assert np.mean([solution.iterations for solution in found]) < 20


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
from solver.programs.threads import _libraries, one_thread
before = [get() for get, _ in _libraries()]
with one_thread():
    during = [get() for get, _ in _libraries()]
try:
    with one_thread():
        raise KeyError
except KeyError:
    pass
after = [get() for get, _ in _libraries()]
print(before == after, during)
from test_band import chain, digest, solved
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


def test_threads_are_limited_and_given_back(with_two_threads):
    assert with_two_threads[0].split() == ["True", "[1,", "1]"]


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
    whole = sp.csc_array(sp.hstack([shuffled.matrix, sp.eye_array(120)]))
    assert narrowest(whole, shuffled.places)[1] == 6


def test_what_comes_no_nearer_is_taken_where_the_check_accepts_it(monkeypatch):
    """A tolerance below rounding is never reached; what was nearest passes the check."""
    monkeypatch.setattr(band, "TOLERANCE", 1e-30)
    found = solved(chain(5, 60))
    assert found.accepted
    assert found.iterations < 60
