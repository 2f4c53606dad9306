"""Sizes, weights and places far apart: the answer is that of the same structure in ordinary numbers."""

import json
from dataclasses import replace

import numpy as np
import pytest
from structures import assembly_of

import solver
from blockvis import generators, read_case
from solver import mechanics

#: A national grid: coordinates of five thousand kilometres are rounded to a nanometre.
GRID = np.array([5e5, 5e6])


def _arch(scale=1.0, place=(0.0, 0.0)):
    arch = generators.arch(voussoirs=12)
    shapes = replace(arch.polygons, vertices=arch.vertices * scale + np.asarray(place))
    return replace(arch, shapes=shapes)


def _spread(scale=1.0, **more):
    return solver.Settlement(
        direction=(1, 0), increment=0.02 * scale, limit=0.5 * scale, tolerance=2e-4 * scale, **more
    )


def _brackets_meet(one, other, scale):
    """Rounding may enclose a collapse in other steps; both brackets hold it."""
    (low, high), (start, end) = np.array(one.collapse.bracket) / scale, other.collapse.bracket
    return low <= end and start <= high


@pytest.fixture(scope="module")
def ordinary():
    return solver.settle(_arch(), _spread(), friction_coefficient=0.7, controls=solver.Controls(falling_frames=1))


@pytest.mark.slow
@pytest.mark.parametrize(
    "scale", [1e-5, 1e-3, *(pytest.param(scale, marks=pytest.mark.thorough) for scale in (1e-6, 1e-2, 100.0))]
)
def test_any_size(ordinary, scale):
    found = solver.settle(
        _arch(scale), _spread(scale), friction_coefficient=0.7, controls=solver.Controls(falling_frames=1)
    )
    assert _brackets_meet(found, ordinary, scale)
    assert found.initial_reaction / found.total_weight == pytest.approx(
        ordinary.initial_reaction / ordinary.total_weight, rel=1e-6
    )
    # The last is at the foot of the bracket.
    np.testing.assert_allclose(
        found.reaction[:-1] / found.total_weight, ordinary.reaction[:-1] / ordinary.total_weight, rtol=1e-6
    )


@pytest.mark.thorough
@pytest.mark.parametrize("scale", [1.0, pytest.param(100.0, marks=pytest.mark.thorough)])
def test_any_place(ordinary, scale):
    """Corners on a grid are rounded to a nanometre: the same collapse, within its bracket, and the same reactions."""
    found = solver.settle(
        _arch(scale, GRID), _spread(scale), friction_coefficient=0.7, controls=solver.Controls(falling_frames=1)
    )
    assert found.stop is solver.Status.COLLAPSED
    assert _brackets_meet(found, ordinary, scale)
    assert found.initial_reaction / found.total_weight == pytest.approx(
        ordinary.initial_reaction / ordinary.total_weight, rel=1e-6
    )
    last = found.path[-1]
    assert np.abs(last.pose.positions - GRID).max() < 10 * scale, "poses are told where the drawing is"
    assert np.abs(last.contacts.points - GRID).max() < 10 * scale


@pytest.mark.slow
def test_a_support_that_turns_about_a_point_of_the_grid():
    """The centre of rotation moves with the local origin: a block on a tilting slab overturns at atan(b / h)."""
    slab = np.array([[-1, -1], [2, -1], [2, 0], [-1, 0]]) + GRID
    block = np.array([[0, 0], [1, 0], [1, 2], [0, 2]]) + GRID
    assembly = solver.Assembly.from_outlines([block, slab], roles=["free", "moving"])
    tilt = solver.Settlement(rotation_centre=GRID, rotation=1.0, increment=0.05, limit=1.0, tolerance=1e-5)
    response = solver.settle(assembly, tilt, friction_coefficient=0.9)
    assert response.collapse.displacement == pytest.approx(np.arctan(0.5), abs=2e-5)


@pytest.mark.thorough
def test_a_run_on_the_grid_resumes_where_it_was_stopped():
    arch = _arch(place=GRID)
    setting = {"interfaces": solver.Interfaces(solver.InterfaceLaw(0.7)), "loads": solver.self_weight(arch)}
    spread = (replace(_spread(), limit=0.1),)
    told = list(mechanics.settlement_increments(arch, spread, **setting))
    again = list(mechanics.settlement_increments(arch, spread, resume=told[2].checkpoint, **setting))
    assert len(again) == len(told) - 3
    for one, other in zip(again, told[3:], strict=True):
        assert one.reaction == other.reaction
        assert one.pose.positions.tobytes() == other.pose.positions.tobytes()


@pytest.mark.thorough
def test_blocks_of_a_millimetre_and_of_a_hundred_metres_in_one_stack():
    """Cubes of 100 m, 10 m ... 1 mm on each other, of 1 to 1e5 kg/m³: the ground carries all of them as it sinks."""
    sizes = 10.0 ** np.arange(2.0, -4.0, -1.0)
    feet = np.concatenate([[0.0], np.cumsum(sizes)[:-1]])
    cubes = [[[-s / 2, y], [s / 2, y], [s / 2, y + s], [-s / 2, y + s]] for s, y in zip(sizes, feet, strict=True)]
    ground = [[-60, -10], [60, -10], [60, 0], [-60, 0]]
    assembly = solver.Assembly.from_outlines(
        [*cubes, ground], roles=["free"] * 6 + ["moving"], density=[*(10.0 ** np.arange(6.0)), 2000.0]
    )
    sink = solver.Settlement(direction=(0, -1), increment=0.01, limit=0.05)
    response = solver.settle(assembly, sink, friction_coefficient=0.5)
    assert response.stop is solver.Status.LIMIT_REACHED
    np.testing.assert_allclose(response.reaction / response.total_weight, 1.0, rtol=1e-8)
    down = response.path[-1].pose.displacements(assembly)
    # Each has come down with what it stands on, to a millionth of its size.
    assert (np.abs(np.diff([-0.05, *down[:6, 1]])) < 1e-6 * sizes).all()
    np.testing.assert_allclose(down[:, 2], 0.0, atol=1e-9)


@pytest.mark.parametrize(
    ("scale", "density", "words"),
    [(1.0, 1e-13, "'crumb'"), (1e-3, 1.0, r"unit m in doubt: .*as \[geometry\] unit")],
)
def test_numbers_beyond_what_is_solved_are_named(tmp_path, scale, density, words):
    blocks = [
        {"name": "block", "outline": [[0, 0], [1, 0], [1, 1], [0, 1]], "density": 2000.0},
        {"name": "crumb", "outline": [[0, 1], [0.1, 1], [0.1, 1.1], [0, 1.1]], "density": 2000.0 * density},
        {"name": "ground", "outline": [[0, -1], [1, -1], [1, 0], [0, 0]], "role": "moving", "density": 2000.0},
    ]
    for block in blocks:
        block["outline"] = (np.array(block["outline"]) * scale).tolist()
    (tmp_path / "a.json").write_text(json.dumps({"format": "blockvis layout", "blocks": blocks}), encoding="utf-8")
    (tmp_path / "case.toml").write_text(
        '[geometry]\nfile = "a.json"\n[settlement]\ndirection = [0, -1]\n', encoding="utf-8"
    )
    told = pytest.warns(UserWarning, match=words) if scale == 1.0 else pytest.raises(ValueError, match=words)
    with told:
        assembly_of(read_case(tmp_path / "case.toml"))


CRUMB = np.array([[0, 0], [0.1, 0], [0.1, 0.1], [0, 0.1]])


@pytest.mark.parametrize(
    "share",
    [1e-6, pytest.param(1e-4, marks=pytest.mark.thorough)],
)
@pytest.mark.parametrize(
    ("place", "stands"),
    [
        ((0.2, 1.1), True),
        ((0.96, 1.1), False),
        pytest.param((1.5, 2.0), False, marks=pytest.mark.thorough),
        pytest.param(None, True, marks=pytest.mark.thorough),
    ],
)
def test_a_crumb_stands_or_falls_at_any_share_of_the_weight(share, place, stands):
    """On a block, over its edge by more than half its width, in the air; two more carry the block, of its weight."""
    block, ground = [[0, 0.1], [1, 0.1], [1, 1.1], [0, 1.1]], [[0, -1], [1, -1], [1, 0], [0, 0]]
    crumbs = [CRUMB, CRUMB + np.array([0.9, 0.0])] + ([] if place is None else [CRUMB + place])
    assembly = solver.Assembly.from_outlines(
        [block, ground, *crumbs],
        roles=["free", "moving"] + ["free"] * len(crumbs),
        density=[2000.0, 2000.0] + [2000.0 * share * 100] * len(crumbs),
    )
    sink = solver.Settlement(direction=(0, -1), increment=0.01, limit=0.02)
    response = solver.settle(assembly, sink, friction_coefficient=0.6, controls=solver.Controls(falling_frames=1))
    if stands:
        assert response.stop is solver.Status.LIMIT_REACHED
        np.testing.assert_allclose(response.path[-1].pose.displacements(assembly)[2:, 1], -0.02, atol=1e-9)
    else:
        assert response.stop is solver.Status.NO_INITIAL_EQUILIBRIUM
        assert "1 of 4 blocks fall ('block 4')" in response.message
