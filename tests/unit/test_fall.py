"""The fall after the last equilibrium: where blocks come to rest, in the plane and in space, and what it changes."""

import re
from dataclasses import replace
from functools import cache
from itertools import permutations
from pathlib import Path

import numpy as np
import pytest
import pyvista as pv
import shapely
from scipy.integrate import solve_ivp
from structures import arch_response, box, in_either, parted, pixels, rectangle, report_of, wall

import blockvis
import solver
from blockvis.cli import main
from blockvis.dynamics import fall as fall_module
from blockvis.dynamics.engine import Engine
from blockvis.dynamics.fall import CAPTION, Fall, fall_of
from blockvis.dynamics.ground import ground_below, on_ground
from blockvis.results.fall_files import stored_fall, write_fall
from solver import mechanics

#: Weight of the block [N].
WEIGHT = 2000.0 * solver.GRAVITY

ARCH = Path(__file__).parents[2] / "assets" / "semicircular_arch.msh"


@cache
def shipped_arch():
    arch = blockvis.read(ARCH, roles={"right springer": "moving", "left springer": "fixed"})
    spread = solver.Settlement(direction=(1.0, 0.0), increment=0.02, limit=0.5)
    return solver.settle(arch, spread, friction_coefficient=2.0, controls=solver.Controls(falling_frames=1))


@cache
def fallen():
    return fall_of(shipped_arch())


def outlines(assembly, pose):
    corners = mechanics.moved_vertices(assembly, pose)
    return np.array([shapely.Polygon(ring) for ring in np.split(corners, assembly.offsets[1:-1])])


@pytest.mark.slow
def test_what_is_pulled_off_its_bearing_falls():
    """A lintel that has left its pier by a hair: at the last equilibrium a push would turn it back onto it."""
    outlines = [rectangle(0, 0, 2, 0.3), rectangle(-1, -6, 0.3, 0), rectangle(1.7, -6, 2.4, 0)]
    roles = ["free", "fixed", "moving"]
    assembly = solver.Assembly.from_outlines(outlines, roles=roles)
    response = solver.settle(assembly, solver.Settlement((1, 0), increment=0.05), friction_coefficient=0.4)
    assert response.collapse.displacement == pytest.approx(0.3, abs=1e-3)
    fall = fall_of(response)
    assert fall.positions[-1, 0, 1] < -5.0


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("width", [2.9, 3.1])
def test_a_lintel_falls_to_the_floor_whether_its_abutments_are_taller_or_wider(width, dimension):
    rectangles = [(0, 0, 2, 0.4), (0.2 - width, -3, 0.2, 0), (1.8, -3, 1.8 + width, 0), (-4, -3.5, 6, -3)]
    rectangles += [(0.9, -9, 1.1, -3.5)]
    roles, removed = ["free", "fixed", "moving", "fixed", "fixed"], np.arange(5) == 4
    assembly = in_either(dimension, [rectangle(*at) for at in rectangles], roles=roles)
    height, _ = ground_below(assembly, solver.Pose.initial(assembly), removed)
    assert height == pytest.approx(-3.0, abs=2e-3)


@pytest.mark.parametrize("order", list(permutations(range(4))))
def test_the_ground_is_of_the_support_that_gave_its_height_and_not_of_what_was_taken_away(order):
    """A block on a slab of stone, beside it as high a pad, and a prop that has gone, in any order."""
    given = [
        (rectangle(0.0, 0.0, 0.6, 1.2), "free", "brick"),
        (rectangle(-1.0, -0.4, 0.6, 0.0), "moving", "stone"),
        (rectangle(-6.0, -0.4, -5.5, 0.0), "fixed", "teflon"),
        (rectangle(-2.0, -2.0, -1.8, -1.5), "fixed", "timber"),
    ]
    outlines, roles, materials = zip(*(given[k] for k in order), strict=True)
    assembly = solver.Assembly.from_outlines(outlines, roles=roles, materials=materials)
    removed = np.array([material == "timber" for material in materials])
    assert ground_below(assembly, solver.Pose.initial(assembly), removed) == (pytest.approx(-1e-3, abs=1e-3), "stone")
    nothing = np.array([role != "free" for role in roles])
    assert ground_below(assembly, solver.Pose.initial(assembly), nothing)[1] == ""


@pytest.mark.parametrize("start", [0.0, 0.1, 3.3, 1000.3])
def test_the_ground_of_two_supports_as_wide_goes_by_their_names_wherever_they_are_drawn(start):
    drawn = [rectangle(start + x, -0.3, start + x + 0.7, 0.0) for x in (0.0, 2.0)]
    outlines, roles = [*drawn, rectangle(start, 0.0, start + 0.7, 1.0)], ["fixed", "fixed", "free"]
    assembly = solver.Assembly.from_outlines(outlines, roles=roles, materials=["brick", "timber", "stone"])
    assert ground_below(assembly, solver.Pose.initial(assembly), np.zeros(3, dtype=bool))[1] == "timber"


def overturned(outlines, changes=(), materials=None, **laws):
    """Blocks on a support that tilts about its right corner at 0, 0, until they fall over it."""
    tilt = solver.Settlement(rotation_centre=(0.0, 0.0), rotation=-1.0, increment=0.2, limit=1.5, tolerance=1e-2)
    roles = ["free"] * (len(outlines) - 1) + ["moving"]
    assembly = solver.Assembly.from_outlines(outlines, roles=roles, materials=materials)
    controls = solver.Controls(falling_frames=1)
    return solver.Structure(assembly, **laws).settle(tilt, changes=changes, controls=controls)


@pytest.mark.slow
def test_what_falls_rests_on_ground_of_the_support_whatever_was_taken_away_before():
    """The prop of teflon comes first, and is taken away before anything moves."""
    outlines = [rectangle(-1.0, 0, -0.8, 0.3), rectangle(-0.6, 0.0, 0.0, 1.2), rectangle(-1.8, -0.4, 0.0, 0.0)]
    laws = solver.Interfaces(solver.InterfaceLaw(0.6), {("teflon", "stone"): solver.InterfaceLaw(0.02)})
    change = solver.PhaseChange(0, np.array([True, False, False]))
    response = overturned(outlines, [change], ["teflon", "stone", "stone"], interfaces=laws)
    assert response.stop is solver.Status.COLLAPSED
    fall = fall_of(response)
    assert not len(fall_module.still_moving(response.assembly, fall))
    assert fall.positions[-1, 1, 0] < 0.8


@pytest.mark.slow
def test_a_tower_is_followed_until_it_lies():
    """As long as its height takes to fall: 4 s after the last equilibrium one of 32 m has begun to."""
    response = overturned([rectangle(-5.0, 0.0, 0.0, 32.0), rectangle(-6.0, -1.0, 0.0, 0.0)], friction_coefficient=0.6)
    fall = fall_of(response)
    assert fall.times[-1] > 4.0
    assert not len(fall_module.still_moving(response.assembly, fall))
    assert fall.positions[-1, 0, 1] < 3.0


def pulled_apart(outlines, friction):
    """Blocks on a fixed and a moving support, which leaves them."""
    roles = ["free"] * (len(outlines) - 2) + ["fixed", "moving"]
    apart = solver.Settlement((1, 0), increment=0.1, tolerance=1e-3)
    assembly = solver.Assembly.from_outlines([rectangle(*at) for at in outlines], roles=roles)
    return solver.settle(assembly, apart, friction_coefficient=friction, controls=solver.Controls(falling_frames=1))


@pytest.mark.slow
def test_a_stone_that_turns_and_wedges_in_a_gap_has_fallen():
    """Its centroid sinks by less than a quarter of it."""
    fall = fall_of(pulled_apart([(0, 0, 1, 1), (-1, -6, 0.3, 0), (0.7, -6, 1.4, 0)], 0.1))
    assert np.linalg.norm(fall.positions[-1, 0] - fall.positions[0, 0]) < 0.25
    assert abs(fall.rotations[-1, 0, 0]) == pytest.approx(np.pi / 4.0, abs=0.05)


@pytest.mark.slow
def test_what_collapses_onto_the_ground_at_once_is_said_to_rest():
    response = pulled_apart([(0, 0, 2, 0.4), (-2.9, -3, 0.2, 0), (1.8, -3, 4.9, 0)], 0.6)
    assert response.stop is solver.Status.COLLAPSED
    with pytest.raises(ValueError, match=r"no corner moves by more than 0\.25 of a block"):
        response.fall(0.5)


@pytest.mark.slow
def test_blocks_never_overlap_by_a_hundredth():
    response, fall = shipped_arch(), fallen()
    assembly = response.assembly
    for k in range(len(fall)):
        blocks = outlines(assembly, fall.pose(k))
        one, other = shapely.STRtree(blocks).query(blocks)
        pairs = (one < other) & (assembly.free[one] | assembly.free[other])
        shared = shapely.area(shapely.intersection(blocks[one[pairs]], blocks[other[pairs]]))
        assert (shared < 0.01 * np.minimum(assembly.areas[one], assembly.areas[other])[pairs]).all(), fall.times[k]
        deep = fall.ground - shapely.bounds(blocks)[assembly.free, 1]
        assert (deep < 0.01 * assembly.block_size).all(), fall.times[k]


@pytest.mark.slow
def test_blocks_come_to_rest_on_something():
    response, fall = shipped_arch(), fallen()
    assembly = response.assembly
    assert not len(fall_module.still_moving(assembly, fall))
    np.testing.assert_allclose(fall.positions[-1], fall.positions[-2], atol=1e-3 * assembly.block_size)
    blocks = outlines(assembly, fall.pose(len(fall) - 1))
    for k in np.flatnonzero(assembly.free):
        to_ground = shapely.bounds(blocks[k])[1] - fall.ground
        assert min(shapely.distance(blocks[k], np.delete(blocks, k)).min(), to_ground) < 2e-3 * assembly.block_size
    # It has fallen: what was highest lies low, and no support has moved.
    last = response.path[-1].pose
    assert fall.positions[-1][assembly.free, 1].mean() < last.positions[assembly.free, 1].mean() - 0.1
    np.testing.assert_array_equal(fall.positions[-1][~assembly.free], fall.positions[0][~assembly.free])
    np.testing.assert_allclose(fall.positions[0][assembly.free], last.positions[assembly.free], atol=1e-12)


@pytest.mark.slow
def test_the_first_push_is_that_of_the_mechanism():
    response, fall = shipped_arch(), fallen()
    moved = (fall.positions[1] - fall.positions[0])[response.assembly.free]
    pushed = response.collapse.mechanism[response.assembly.free, :2]
    assert (moved * pushed).sum() > 0.9 * np.linalg.norm(moved) * np.linalg.norm(pushed)


def test_a_free_fall_is_that_of_gravity():
    """A block above nothing: what the time of the frames means."""
    block = solver.Assembly.from_outlines([[[0, 9], [1, 9], [1, 10], [0, 10]]], roles=["free"])
    ground = on_ground(block, solver.Pose.initial(block), 0.0)
    weight = np.append(solver.self_weight(block).dead, np.zeros((1, 3)), axis=0)
    engine = Engine(ground[0], weight, solver.Interfaces(solver.InterfaceLaw(0.5)), ground[1], np.zeros((2, 3)))
    engine.advance(0.5)
    # The first step falls by twice as much.
    assert 9.5 - engine.pose.positions[0, 1] == pytest.approx(solver.GRAVITY * 0.5**2 / 2.0, rel=0.01)


def test_what_tips_turns_as_the_equation_of_motion_says():
    """A block of 0.4 × 2 m, from 0.03 rad beyond the angle at which its centroid is above the edge it turns about."""
    blocks = [rectangle(-3.0, -0.5, 3.0, 0.0), rectangle(-0.2, 0.0, 0.2, 2.0)]
    assembly = solver.Assembly.from_outlines(blocks, roles=["fixed", "free"])
    radius, start = np.hypot(0.2, 1.0), np.arctan2(0.2, 1.0) + 0.03
    centroid = np.array([0.2 + radius * np.sin(0.03), radius * np.cos(0.03)])
    pose = solver.Pose(np.array([assembly.centroids[0], centroid]), np.array([[0.0], [-start]]))
    law = solver.Interfaces(solver.InterfaceLaw(2.0))
    engine = Engine(assembly, solver.self_weight(assembly).dead, law, pose, np.zeros((2, 3)))
    beyond = []
    for _ in range(30):
        engine.advance(0.04)
        beyond.append(-engine.pose.rotations[1, 0] - np.arctan2(0.2, 1.0))
    times = 0.04 * np.arange(1, 31)
    inertia = radius**2 + (0.4**2 + 2.0**2) / 12.0
    exact = solve_ivp(
        lambda t, y: (y[1], solver.GRAVITY * radius * np.sin(y[0]) / inertia), (0.0, 1.2), (0.03, 0.0), t_eval=times
    ).y[0]
    # Steps that move by the acceleration at their end alone are ahead by more.
    np.testing.assert_allclose(beyond, exact, rtol=0.05)


@pytest.mark.parametrize(
    "dimension", [pytest.param(2, marks=pytest.mark.slow), pytest.param(3, marks=pytest.mark.thorough)]
)
def test_a_block_in_flight_turns_ever_faster_by_its_moment_and_falls_no_slower(dimension):
    """It slides off a ledge that is drawn away below it, and keeps a moment of 200 N·m."""
    drawn = [(0.0, 0.0, 1.0, 0.4), (-1.0, -0.5, 0.55, 0.0), (-0.5, 0.05, 0.0, 0.4), (-9.0, -20.0, 9.0, -19.0)]
    roles, moment = ["free", "moving", "fixed", "fixed"], -200.0 if dimension == 2 else 200.0
    assembly = in_either(dimension, [rectangle(*at) for at in drawn], roles=roles)
    loads = solver.self_weight(assembly)
    loads.dead[0, 2 * dimension - 2] = moment
    away = solver.Settlement(direction=(-1, *[0] * (dimension - 1)), increment=0.02, limit=0.5, tolerance=1e-3)
    fall = fall_of(solver.settle(assembly, away, friction_coefficient=0.15, loads=loads))
    flight = slice(27, 37)
    speeds, spins = (np.diff(of[flight, 0], axis=0) / 0.04 for of in (fall.positions, fall.rotations))
    np.testing.assert_allclose(np.diff(speeds[:, -1]) / 0.04, -solver.GRAVITY, rtol=1e-4)
    inertia = 0.4 * 2000.0 * (1.0**2 + 0.4**2) / 12.0
    np.testing.assert_allclose(np.diff(spins[:, dimension - 2]) / 0.04, moment / inertia, rtol=5e-3)


@pytest.mark.parametrize("dimension", [2, 3])
def test_a_force_at_a_corner_gives_a_block_in_flight_no_more_than_its_work(dimension):
    if dimension == 2:
        block = solver.Assembly.from_outlines([rectangle(0.0, 9.0, 1.0, 9.5)], roles=["free"])
    else:
        block = solver.Assembly.from_solids([box((0.0, 0.0, 9.0), (1.0, 0.7, 9.5))], roles=["free"])
    force = np.array([4000.0, 900.0, -2000.0])[[0, 2] if dimension == 2 else [0, 1, 2]]
    pushed = solver.PointForces.at(0, force, block.vertices.max(axis=0))
    loads = solver.self_weight(block).with_forces(block, pushed)
    whole, pose = on_ground(block, solver.Pose.initial(block), 0.0)
    dead = np.append(loads.dead, np.zeros((1, 3 * dimension - 3)), axis=0)
    law, still = solver.Interfaces(solver.InterfaceLaw(0.5)), np.zeros_like(dead)
    engine = Engine(whole, dead, law, pose, still, arms=loads.dead_arms)
    energies, heights = [engine.energies.sum()], [engine.pose.positions[0, -1]]
    for _ in range(12):
        engine.advance(0.04)
        energies.append(engine.energies.sum())
        heights.append(engine.pose.positions[0, -1])
    assert np.linalg.norm(engine.pose.rotations[0]) > 0.5
    given = block.masses[0] * solver.GRAVITY * (heights[0] - heights[-1])
    assert (np.diff(energies) <= 1e-9 * given).all()
    assert energies[0] - energies[-1] < 0.05 * given


@pytest.mark.parametrize(
    "height", [0.5, pytest.param(0.87, marks=pytest.mark.thorough), pytest.param(2.3, marks=pytest.mark.thorough)]
)
def test_a_blow_takes_the_speed_along_that_friction_has_by_its_impulse(height):
    """A stone lands with 8 m/s along: by the normal force of the step before it lost up to half as much again."""
    outlines = [rectangle(-50.0, -1.0, 50.0, 0.0), rectangle(0.0, height, 1.0, height + 0.2)]
    assembly = solver.Assembly.from_outlines(outlines, roles=["fixed", "free"])
    weight, law = solver.self_weight(assembly).dead, solver.Interfaces(solver.InterfaceLaw(0.6))
    velocity = np.array([[0.0, 0.0, 0.0], [8.0, 0.0, 0.0]])
    engine = Engine(assembly, weight, law, solver.Pose.initial(assembly), velocity)
    steps = int(np.ceil(np.sqrt(2.0 * height / solver.GRAVITY) / 0.04)) + 3
    for _ in range(steps):
        engine.advance(0.04)
    lost = 8.0 - engine.velocity[1, 0] * engine.length / engine.unit
    # Before and after it has landed all that weight gives to the ground is its impulse m g t.
    assert lost == pytest.approx(0.6 * solver.GRAVITY * 0.04 * steps, rel=0.01)


def test_what_rests_at_nine_tenths_of_its_friction_does_not_creep():
    base, stone = rectangle(-5.0, -1.0, 5.0, 0.0), rectangle(0.0, 0.0, 1.0, 0.5)
    turn, other = np.arctan(0.54), rectangle(20.0, 0.0, 21.0, 1.0)
    about = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    assembly = solver.Assembly.from_outlines(
        [np.array(base) @ about, np.array(stone) @ about, other], roles=["fixed", "free", "free"]
    )
    weight, law = solver.self_weight(assembly).dead, solver.Interfaces(solver.InterfaceLaw(0.6))
    engine = Engine(assembly, weight, law, solver.Pose.initial(assembly), np.zeros((3, 3)))
    start = engine.pose.positions[1].copy()
    for _ in range(10):
        engine.advance(0.04)
    np.testing.assert_allclose(engine.pose.positions[1], start, atol=1e-4)


@pytest.mark.parametrize("gap", [0.1, 0.23, 0.31])
def test_a_block_that_strikes_another_goes_on_with_it_at_half_its_speed(gap):
    """On a floor without friction: no restitution, and all of the momentum."""
    blocks = [rectangle(0.0, 0.0, 1.0, 0.4), rectangle(1.0 + gap, 0.0, 2.0 + gap, 0.4), rectangle(-3.0, -0.5, 9.0, 0.0)]
    assembly = solver.Assembly.from_outlines(blocks, roles=["free", "free", "fixed"])
    velocity = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    laws, pose = solver.Interfaces(solver.InterfaceLaw(0.0)), solver.Pose.initial(assembly)
    engine = Engine(assembly, solver.self_weight(assembly).dead, laws, pose, velocity)
    start = engine.velocity[0, 0]
    while engine.velocity[1, 0] == pytest.approx(0.0, abs=1e-6):
        engine.advance(0.04)
    engine.advance(0.12)
    assert engine.velocity[:2, 0] == pytest.approx(engine.velocity[:2, 0].mean(), rel=0.02)
    assert engine.velocity[:2, 0].sum() == pytest.approx(start, rel=1e-4)


@pytest.mark.slow
def test_a_lintel_falls_between_its_piers_to_their_feet():
    blocks = [rectangle(0.0, 0.0, 0.5, 1.0), rectangle(1.5, 0.0, 2.0, 1.0), rectangle(0.3, 1.0, 1.7, 1.3)]
    assembly = solver.Assembly.from_outlines(blocks, roles=["fixed", "moving", "free"])
    apart = solver.Settlement(direction=(1.0, 0.0), increment=0.02, limit=0.5)
    response = solver.settle(assembly, apart, friction_coefficient=0.6)
    assert response.stop is solver.Status.COLLAPSED
    fall = fall_of(response)
    assert fall.ground == pytest.approx(0.0, abs=0.01)
    corners = mechanics.moved_vertices(assembly, fall.pose(len(fall) - 1))[assembly.block_of_vertex == 2]
    assert corners[:, 1].min() == pytest.approx(fall.ground, abs=1e-3)


@pytest.mark.slow
def test_the_push_grows_until_what_still_stands_falls_whatever_was_lost_before():
    blocks = [rectangle(-2.0, -1.0, 2.0, 0.0), rectangle(-0.5, 0.0, 0.5, 1.5), rectangle(0.4, 1.5, 0.5, 1.9)]
    assembly = solver.Assembly.from_outlines(blocks, roles=["moving", "free", "free"])
    tilt = solver.Settlement(rotation_centre=(0.0, 0.0), rotation=-1.0, increment=0.05, limit=1.0)
    response = solver.settle(assembly, tilt, friction_coefficient=0.9)
    (loss,) = response.losses
    assert loss.blocks == (assembly.names[2],)
    # From an equilibrium well before the collapse the first push does not turn the pier over.
    early = tuple(increment for increment in response.path if increment.parameter < 0.53)
    fall = fall_of(replace(response, increments=early))
    assert np.linalg.norm(fall.positions[-1] - fall.positions[0], axis=1)[1] > 1.0


@pytest.mark.slow
def test_the_same_bytes_twice(tmp_path):
    response = shipped_arch()
    for name, fall in (("one", fallen()), ("two", fall_of(response))):
        write_fall(fall, response, tmp_path / name)
    files = sorted(path.relative_to(tmp_path / "one") for path in (tmp_path / "one").rglob("*") if path.is_file())
    assert len(files) == len(fallen()) + 2
    for file in files:
        assert (tmp_path / "one" / file).read_bytes() == (tmp_path / "two" / file).read_bytes(), file


@pytest.mark.slow
def test_files_have_the_time_as_their_parameter(tmp_path):
    response, fall = shipped_arch(), fallen()
    write_fall(fall, response, tmp_path)
    reader = pv.PVDReader(tmp_path / "fall.pvd")
    assert reader.time_values == pytest.approx(list(fall.times))
    reader.set_active_time_value(reader.time_values[-1])
    (mesh,) = reader.read()
    corners = mechanics.moved_vertices(response.assembly, fall.pose(len(fall) - 1))
    np.testing.assert_allclose(mesh.points[:, :2], corners, atol=1e-12)
    assert mesh.field_data["time"] == pytest.approx(fall.times[-1])
    assert not {"reaction", "settlement", "load_multiplier"} & set(mesh.field_data.keys())
    again = stored_fall(tmp_path)
    np.testing.assert_array_equal(again.positions, fall.positions)
    assert again.ground == fall.ground


def test_a_damaged_fall_is_named(tmp_path):
    assert stored_fall(tmp_path) is None
    (tmp_path / "fall.npz").write_bytes(b"no archive")
    with pytest.raises(ValueError, match=r"fall\.npz' cannot be read .*; remove it and draw again"):
        stored_fall(tmp_path)


def test_poses_between_those_kept():
    fall = Fall(np.array([0.0, 0.1]), np.array([[[0.0, 0.0]], [[1.0, 2.0]]]), np.array([[[0.0]], [[0.4]]]), 0.0)
    pose = fall.at(0.025)
    np.testing.assert_allclose((*pose.positions[0], pose.rotations[0, 0]), (0.25, 0.5, 0.1))
    np.testing.assert_array_equal(fall.at(7.0).positions, [[1.0, 2.0]])


def test_what_does_not_collapse_along_a_path_does_not_fall():
    response = arch_response()
    assert fall_of(replace(response, stop=solver.Status.LIMIT_REACHED, collapse=None)) is None
    limits = solver.LimitLoad
    assert fall_of(replace(response, limits=(limits,))) is None
    assert fall_of(replace(response, parameter=mechanics.Quantity("position", "x", "m", is_path=False))) is None


@pytest.mark.slow
def test_blocks_smaller_than_any_stone_have_no_fall_that_would_never_end():
    arch = blockvis.generators.arch(radius=1e-12, voussoirs=5)
    spread = solver.Settlement(direction=(1.0, 0.0), increment=1e-12, limit=2e-12, tolerance=1e-13)
    response = solver.settle(arch, spread, friction_coefficient=2.0, controls=solver.Controls(falling_frames=1))
    assert response.stop is solver.Status.COLLAPSED
    assert fall_of(response) is None


@pytest.mark.slow
def test_friction_of_each_pair_of_materials():
    """A brick on a slope of 22°: by the friction of its pair it stays or slides."""
    turn = np.array([[np.cos(0.384), -np.sin(0.384)], [np.sin(0.384), np.cos(0.384)]])
    slope = [[-3.0, -1.0], [3.0, -1.0], [3.0, 0.0], [-3.0, 0.0]]
    brick = [[0.0, 0.0], [0.4, 0.0], [0.4, 0.2], [0.0, 0.2]]
    assembly = solver.Assembly.from_outlines(
        [np.array(ring) @ turn.T for ring in (slope, brick)], roles=["moving", "free"], materials=["rock", "brick"]
    )
    base = parted(wall(3, 2), 2, 0)
    pose = solver.Pose.initial(assembly)
    contacts = mechanics.find_contacts(assembly, assembly.vertices, 1e-3)
    zeros = np.zeros((len(contacts), 2))
    last = base.path[-1].with_arrays(
        pose=pose, contacts=contacts, forces=zeros, displacements=zeros, friction=np.full(len(contacts), 0.3),
        velocity=np.zeros((2, 3)), support_forces=np.zeros((2, 3)),
    )  # fmt: skip
    mechanism = np.array([[0.0, 0.0, 0.0], [*(turn @ [-1.0, 0.0]), 0.0]])
    for friction, slides in ((0.3, True), (0.6, False)):
        law = solver.InterfaceLaw(friction)
        response = replace(
            base, assembly=assembly, increments=(last,), loads=solver.self_weight(assembly),
            interfaces=solver.Interfaces(solver.InterfaceLaw(0.9), {("rock", "brick"): law}),
            collapse=replace(base.collapse, mechanism=mechanism),
        )  # fmt: skip
        fall = fall_of(response)
        way = np.hypot(*(fall.positions[-1] - fall.positions[0])[1])
        assert (way > 0.3) == slides, (friction, way)


@pytest.mark.slow
def test_the_page_plays_the_fall_in_real_time():
    response, fall = shipped_arch(), fallen()
    page = report_of(response, fall=fall)
    assert page.count(CAPTION) == len(fall) - 1
    assert CAPTION not in report_of(response)


@pytest.mark.slow
def test_a_run_writes_the_fall_and_nothing_else_knows_of_it(tmp_path, monkeypatch):
    case = tmp_path / "case.toml"
    case.write_text(
        '[geometry]\nlayout = "arch"\n[settlement]\ndirection = [1, 0]\nincrement = 0.05\nlimit = 0.5\n'
        "[material]\nfriction_coefficient = 0.7\n[analysis]\nfalling_frames = 2\n",
        encoding="utf-8",
    )
    assert main(["run", str(case), "-o", str(tmp_path / "with"), "--no-check-steps"]) == 0
    monkeypatch.setattr("blockvis.runs.outputs.fall_of", lambda *given: None)
    assert main(["run", str(case), "-o", str(tmp_path / "without"), "--no-film", "--no-check-steps"]) == 0
    for folder, there in ((tmp_path / "with", True), (tmp_path / "without", False)):
        assert (folder / "fall.pvd").is_file() == there
        assert (CAPTION in (folder / "report.html").read_text(encoding="utf-8")) == there
        assert (folder / "collapse.mp4").is_file() == there
    rows = [(tmp_path / one / "blocks.pvd").read_bytes() for one in ("with", "without")]
    assert rows[0] == rows[1]
    summaries = [(tmp_path / one / "summary.json").read_text(encoding="utf-8") for one in ("with", "without")]
    assert len(summaries[0].splitlines()) == len(summaries[1].splitlines())
    assert main(["run", str(case), "-o", str(tmp_path / "with"), "--force", "--no-pictures", "--no-check-steps"]) == 0
    assert not (tmp_path / "with" / "fall.pvd").exists()
    assert not (tmp_path / "with" / "report.html").exists()


@pytest.mark.slow
def test_a_run_says_which_blocks_still_move_where_their_fall_is_cut_off(tmp_path, monkeypatch, capsys):
    case = tmp_path / "case.toml"
    case.write_text(
        '[geometry]\nlayout = "column"\nparameters = { blocks = 1, width = 0.4 }\n[material]\n'
        "friction_coefficient = 0.6\n[settlement]\nrotation_centre = [0.2, 0.0]\nrotation = -1.0\nincrement = 0.1\n"
        "limit = 1.5\n",
        encoding="utf-8",
    )
    monkeypatch.setattr(fall_module, "LONGEST", 1.0)
    assert main(["run", str(case), "-o", str(tmp_path / "out"), "--no-pictures", "--no-check-steps"]) == 0
    told = capsys.readouterr().err
    assert re.search(r"note: the fall is followed for 0\.\d+ s, at whose end 'block 1' still moves\n", told), told


def test_bent_blocks_fall_in_one_piece():
    """An L that stands on its short leg next to nothing tips over and lies on its long one."""
    shape = [[0.0, 0.0], [0.3, 0.0], [0.3, 1.0], [1.2, 1.0], [1.2, 1.3], [0.0, 1.3]]
    assembly = solver.Assembly.from_outlines(
        [shape, [[-0.5, -0.3], [0.6, -0.3], [0.6, 0.0], [-0.5, 0.0]]], roles=["free", "moving"]
    )
    base = parted(wall(3, 2), 2, 0)
    contacts = mechanics.find_contacts(assembly, assembly.vertices, 1e-3)
    zeros = np.zeros((len(contacts), 2))
    last = base.path[-1].with_arrays(
        pose=solver.Pose.initial(assembly), contacts=contacts, forces=zeros, displacements=zeros,
        friction=np.full(len(contacts), 0.6), velocity=np.zeros((2, 3)), support_forces=np.zeros((2, 3)),
    )  # fmt: skip
    response = replace(
        base, assembly=assembly, increments=(last,), loads=solver.self_weight(assembly),
        collapse=replace(base.collapse, mechanism=np.array([[0.0, 0.0, -1.0], [0.0, 0.0, 0.0]])),
    )  # fmt: skip
    fall = fall_of(response)
    assert fall.rotations[-1, 0, 0] < -0.5
    end = outlines(assembly, fall.pose(len(fall) - 1))
    assert shapely.bounds(end[0])[1] == pytest.approx(fall.ground, abs=0.01)


def hung(tie, rest, at=(0.0, 5.0)):
    """A block of 1 m, its middle at a place [m], on a tie, above a ground far below."""
    corners = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]]) + at
    assembly = solver.Assembly.from_outlines([corners], roles=["free"], density=2000.0)
    whole, pose = on_ground(assembly, solver.Pose.initial(assembly), -20.0)
    loads = np.append(solver.self_weight(assembly).dead, np.zeros((1, 3)), axis=0)
    laws = solver.Interfaces(solver.InterfaceLaw(0.5))
    return Engine(whole, loads, laws, pose, np.zeros((2, 3)), ties=[tie], rest=np.array([rest]))


def tie_of(points, **values):
    return solver.Tie("iron", (None, 0), points, **{"stiffness": 1e7, **values})


def length_of(engine):
    return float(mechanics.tie_lengths(mechanics.tie_ends(engine.ties, engine.assembly, engine.pose))[0])


def test_a_block_hangs_on_a_tie_by_its_weight():
    engine = hung(tie_of(((0.0, 8.0), (0.0, 5.0))), 3.0)
    engine.advance(1.0)
    assert length_of(engine) == pytest.approx(3.0 + WEIGHT / 1e7, abs=1e-5)
    assert engine.tensions[0] == pytest.approx(WEIGHT, rel=1e-3)
    assert engine.fastest < 1e-3


@pytest.mark.parametrize(("brittle", "slower"), [(True, 0.0), (False, 0.6)])
def test_a_block_falls_freely_from_a_tie_that_breaks_and_slower_from_one_that_yields(brittle, slower):
    """With a strength of 0.6 of the weight the rest accelerates the block, by 0.4 g."""
    engine = hung(tie_of(((0.0, 8.0), (0.0, 5.0)), strength=0.6 * WEIGHT, brittle=brittle), 3.0)
    engine.advance(0.2)
    before, fallen = engine.velocity[0, 1] / engine.unit * engine.length, length_of(engine)
    engine.advance(0.2)
    after = engine.velocity[0, 1] / engine.unit * engine.length
    assert (after - before) / 0.2 == pytest.approx(-(1.0 - slower) * solver.GRAVITY, rel=1e-6)
    if brittle:
        assert np.isnan(engine.rest[0])
        assert engine.tensions[0] == 0.0
    else:
        # What it has given is its length without force from then on.
        assert engine.rest[0] == pytest.approx(length_of(engine) - 0.6 * WEIGHT / 1e7, abs=1e-9)
        assert engine.rest[0] > fallen
        assert engine.tensions[0] == pytest.approx(0.6 * WEIGHT, rel=1e-9)


@pytest.mark.thorough
def test_a_tie_that_yields_stops_a_block_by_its_work():
    """It comes taut after a fall of 1 m: by hand it gives (its elastic stretch aside) W · 1 m / (S - W)."""
    engine = hung(tie_of(((0.0, 8.0), (0.0, 5.0)), strength=3.0 * WEIGHT), 4.0)
    engine.advance(2.0)
    assert engine.rest[0] - 4.0 == pytest.approx(0.5, rel=0.02)


@pytest.mark.thorough
def test_a_block_on_a_stiff_tie_swings_at_its_length_and_energy_only_falls():
    """Half a period of the pendulum takes it to the other side: 0.59 of that of small swings longer at 90°."""
    engine = hung(tie_of(((3.0, 5.0), (0.0, 5.0)), stiffness=1e9), 3.0)
    energies, lengths, places = [engine.energies.sum()], [], []
    for _ in range(25):
        engine.advance(0.08)
        energies.append(engine.energies.sum())
        lengths.append(length_of(engine))
        places.append(engine.pose.positions[0, 0])
    np.testing.assert_allclose(lengths, 3.0, rtol=1e-3)
    assert (np.diff(energies) <= 0.0).all()
    assert max(places) > 5.0


@pytest.mark.thorough
def test_what_a_soft_tie_has_stored_comes_back_and_no_more():
    """A block that falls into a tie of 0.1 m give by its weight, 1 m below where it is taut."""
    engine = hung(tie_of(((0.0, 8.0), (0.0, 6.0)), stiffness=10.0 * WEIGHT), 3.0, at=(0.0, 6.0))
    energies, heights = [], []
    for _ in range(60):
        engine.advance(0.04)
        energies.append(engine.energies.sum())
        heights.append(engine.pose.positions[0, 1])
    lowest = int(np.argmin(heights))
    # By energy 0.6 m below where the tie is taut, less what implicit steps lose.
    assert 4.3 < heights[lowest] < 4.9
    assert max(heights[lowest:]) > heights[lowest] + 0.2
    assert (np.diff(energies) <= 1e-9 * WEIGHT).all()


def test_a_bar_holds_a_block_up_and_a_tie_does_not():
    """Upright below it, from the ground: pushed aside it falls over on the bar, in a circle."""
    bar, tie = (hung(tie_of(((0.0, 2.0), (0.0, 5.0)), kind=kind, stiffness=1e9), 3.0) for kind in ("bar", "tie"))
    for engine in (bar, tie):
        engine.advance(0.5)
    assert length_of(bar) == pytest.approx(3.0, rel=1e-3)
    assert bar.tensions[0] == pytest.approx(-WEIGHT, rel=1e-2)
    assert length_of(tie) < 2.0


@pytest.mark.slow
def test_piers_stay_joined_by_their_tie_when_the_arch_between_them_falls():
    arch = blockvis.generators.arch_on_piers(voussoirs=7, pier_width=0.5, pier_blocks=1)
    piers = arch.names.index("left pier 1"), arch.names.index("right pier 1")
    tie = solver.Tie("iron", piers, ((-1.3, 1.95), (1.3, 1.95)), stiffness=4e7, strength=3000.0)
    structure = solver.Structure(arch, friction_coefficient=0.6, ties=[tie])
    spread = solver.Settlement((1.0, 0.0), increment=0.05, limit=0.6)
    response = structure.settle(spread, controls=solver.Controls(falling_frames=1))
    energies = []
    fall = fall_of(response, watch=lambda engine: energies.append(engine.energies.sum()))
    assert np.diff(energies).max() < 1e-6 * (energies[0] - energies[-1])
    told = [fall.ties_at(time, response) for time in fall.times]
    lengths, rest = (
        np.array([values[0] for values in of])
        for of in zip(*((mechanics.tie_lengths(one.ends), one.rest) for one in told), strict=True)
    )
    assert (lengths < rest + 3000.0 / 4e7 + 1e-6).all()
    # It gives a little more: the piers stand and the arch lies between them.
    assert (np.diff(rest) >= 0.0).all()
    assert rest[-1] - rest[0] < 0.01
    # Without it they are pushed apart.
    alone = fall_of(replace(response, ties=()))
    apart = [mechanics.tie_lengths(mechanics.tie_ends([tie], arch, alone.pose(k)))[0] for k in range(len(alone))]
    assert max(apart) - apart[0] > 0.03


@cache
def leaning():
    """A brick on a support that goes away sideways until the brick falls off, and a brick on the fixed support."""
    solids = [
        box((0, 0, 0), (1, 1, 1)),
        box((1, 0, 0), (2, 1, 1)),
        box((0.2, 0, 1), (1.2, 1, 1.6)),
        box((0.1, 0.1, 1.6), (0.9, 0.9, 2.2)),
    ]
    assembly = solver.Assembly.from_solids(solids, roles=["fixed", "moving", "free", "free"])
    structure = solver.Structure(assembly, friction_coefficient=0.5)
    return structure.settle(solver.Settlement((0, 0, -1), increment=0.1, limit=0.1))


def deepest_overlap(assembly, corners):
    """Of a free block with any other [m]: supports may reach into the ground."""
    one, other, deep = assembly.polyhedra.overlaps(corners, 0.0)
    return deep[assembly.free[one] | assembly.free[other]].max(initial=0.0)


def engine_of(velocity, shift=(0.0, 0.0, 0.0)):
    response = leaning()
    last = response.path[-1]
    pose = solver.Pose(last.pose.positions.copy(), last.pose.rotations.copy())
    pose.positions[3] += shift
    motion, loads = np.zeros((5, 6)), np.zeros((5, 6))
    motion[3], loads[:4] = velocity, response.loads.dead
    below, _ = ground_below(response.assembly, pose, np.zeros(4, dtype=bool))
    whole, pose = on_ground(response.assembly, pose, below - 1.0)
    return Engine(whole, loads, response.interfaces, pose, motion)


@pytest.mark.thorough
def test_a_block_in_the_air_falls_as_free_bodies_do():
    engine = engine_of((0.0, 2.0, 0.0, 0.0, 0.0, 0.0), shift=(0.0, 0.5, 0.5))
    start = engine.pose.positions[3].copy()
    for _ in range(5):
        engine.advance(0.04)
    fell = engine.pose.positions[3] - start
    assert fell[1] == pytest.approx(0.4, rel=1e-6)
    # The first step falls by twice as much.
    assert fell[2] == pytest.approx(-solver.GRAVITY * 0.2**2 / 2.0, rel=0.01)
    assert fell[0] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.slow
def test_energy_only_falls_and_all_comes_to_rest_without_overlap():
    engine = engine_of((1.0, 3.0, 0.5, 0.0, 2.0, 1.0))
    energies = [engine.energies.sum()]
    for _ in range(80):
        engine.advance(0.04)
        energies.append(engine.energies.sum())
        if engine.fastest < 1e-3:
            break
    # But for the push out of an overlap of rounding at rest.
    assert (np.diff(energies) <= 1e-7 * (energies[0] - energies[-1])).all()
    assert engine.fastest < 1e-3
    corners = mechanics.moved_vertices(engine.assembly, engine.pose)
    assert deepest_overlap(engine.assembly, corners) < 1e-3 * engine.assembly.block_size
    thrown = corners[engine.assembly.block_of_vertex == 3]
    assert thrown[:, 2].min() == pytest.approx(
        float(corners[engine.assembly.block_of_vertex == 4][:, 2].max()), abs=1e-3
    )


@pytest.mark.slow
def test_a_box_that_spins_freely_flips_about_its_middle_axis_and_keeps_angular_momentum_and_energy():
    assembly = solver.Assembly.from_solids([box((-0.5, -1.0, -2.0), (0.5, 1.0, 2.0))], roles=["free"])
    law, still = solver.Interfaces(solver.InterfaceLaw(0.5)), np.zeros((1, 6))
    spin = np.array([[0.0, 0.0, 0.0, 0.2, 3.0, 0.0]])
    engine = Engine(assembly, still, law, solver.Pose.initial(assembly), spin)
    inertia = assembly.density[0] * assembly.shapes.inertia[0]
    momenta, energies, middle = [], [], []
    for _ in range(40):
        axes = np.array([mechanics.turned(axis[None], engine.pose.rotations)[0] for axis in np.eye(3)])
        momenta.append(axes.T @ inertia @ axes @ (engine.velocity[0, 3:] / engine.unit))
        energies.append(engine.energies[0])
        middle.append(axes[1, 1])
        engine.advance(0.1)
    np.testing.assert_allclose(momenta, np.tile(momenta[0], (40, 1)), atol=1e-9 * np.linalg.norm(momenta[0]))
    np.testing.assert_allclose(energies, energies[0], rtol=1e-9)
    assert min(middle) < -0.9


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_a_heap_of_thrown_stones_comes_to_rest_without_overlaps_and_loses_energy_only(seed):
    rng = np.random.default_rng(seed)
    stones = [box(-s / 2.0, s / 2.0) for s in rng.uniform(0.2, 0.6, (8, 3))]
    assembly = solver.Assembly.from_solids(stones, roles=["free"] * 8)
    places = np.column_stack([rng.uniform(-0.3, 0.3, (8, 2)), 0.5 + 0.8 * np.arange(8)])
    whole, pose = on_ground(assembly, solver.Pose(places, rng.uniform(-2.0, 2.0, (8, 3))), 0.0)
    weight = np.append(solver.self_weight(assembly).dead, np.zeros((1, 6)), axis=0)
    velocity = np.append(rng.uniform(-2.0, 2.0, (8, 6)), np.zeros((1, 6)), axis=0)
    engine = Engine(whole, weight, solver.Interfaces(solver.InterfaceLaw(0.6)), pose, velocity)
    sizes, energies = np.where(whole.free, np.cbrt(whole.shapes.volumes), np.inf), [engine.energies.sum()]
    for _ in range(100):
        engine.advance(0.04)
        energies.append(engine.energies.sum())
        i, j, depth = whole.shapes.overlaps(engine.corners, 0.0)
        assert (depth < 1e-3 * np.minimum(sizes[i], sizes[j])).all()
        if engine.fastest < 1e-3:
            break
    assert engine.fastest < 1e-3
    assert (np.diff(energies) < 1e-6 * (energies[0] - energies[-1])).all()
    contacts = mechanics.find_contacts(whole, engine.corners, 1e-3)
    touches = np.bincount(np.concatenate([contacts.block_a, contacts.block_b]), minlength=9)
    assert (touches[whole.free] > 0).all()


@pytest.mark.slow
def test_a_corner_of_walls_falls_and_its_fall_is_stored(tmp_path):
    case = "examples/corner_of_walls.toml"
    root = blockvis.__file__.rpartition("blockvis")[0]
    run = blockvis.run_case(blockvis.read_case(f"{root}{case}", changes=["output.animation=false"]), tmp_path / "out")
    fall = fall_of(run.response)
    assert fall is not None
    assembly = run.response.assembly
    end = mechanics.moved_vertices(assembly, fall.pose(len(fall) - 1))
    lowest = np.array([end[assembly.block_of_vertex == block][:, 2].min() for block in range(assembly.n_blocks)])
    fallen = np.linalg.norm(fall.positions[-1] - fall.positions[0], axis=1) > assembly.block_size
    assert fallen.any()
    assert (lowest[assembly.free] > fall.ground - 1e-3 * assembly.block_size).all()
    assert deepest_overlap(assembly, end) < 1e-3 * assembly.block_size
    lines = (tmp_path / "out" / "fall.pvd").read_text(encoding="utf-8")
    assert lines.count("<DataSet") == len(fall)


def test_a_block_in_space_swings_on_a_tie():
    """Held beside its middle, so that it turns, too."""
    assembly = solver.Assembly.from_solids([box((-0.5, -0.5, 4.5), (0.5, 0.5, 5.5))], roles=["free"])
    whole, pose = on_ground(assembly, solver.Pose.initial(assembly), -20.0)
    loads = np.append(solver.self_weight(assembly).dead, np.zeros((1, 6)), axis=0)
    tie = solver.Tie("rope", (None, 0), ((3.0, 0.0, 5.5), (0.0, 0.2, 5.5)), stiffness=1e9)
    rest = mechanics.tie_lengths(mechanics.tie_ends([tie], whole, pose))
    laws = solver.Interfaces(solver.InterfaceLaw(0.5))
    engine = Engine(whole, loads, laws, pose, np.zeros((2, 6)), ties=[tie], rest=rest)
    energies = [engine.energies.sum()]
    for _ in range(5):
        engine.advance(0.08)
        energies.append(engine.energies.sum())
        assert mechanics.tie_lengths(mechanics.tie_ends([tie], whole, engine.pose)) < 1.001 * rest
    assert (np.diff(energies) <= 0.0).all()
    assert np.linalg.norm(engine.pose.rotations[0]) > 0.1


@pytest.mark.slow
def test_results_that_replace_those_of_a_collapse_have_no_fall(tmp_path):
    response = shipped_arch()
    folder = blockvis.write(response, tmp_path / "out")
    write_fall(fallen(), response, folder)
    stands = replace(response, increments=response.path, stop=solver.Status.LIMIT_REACHED, collapse=None)
    blockvis.write(stands, folder, overwrite=True)
    assert not list(folder.glob("fall*"))
    with pytest.raises(ValueError, match="nothing falls here"):
        blockvis.open_results(folder).fall(1.0)


def test_a_stone_slides_as_far_as_the_scattered_friction_of_its_joint_lets_it():
    assembly = solver.Assembly.from_outlines(
        [rectangle(0.0, 0.0, 1.0, 0.2), rectangle(-3.0, -0.5, 9.0, 0.0)], roles=["free", "fixed"]
    )
    half = solver.JointScatter(1, lambda p: np.full(len(p), 0.5))
    laws, pose = solver.Interfaces(solver.InterfaceLaw(0.2), scatter=half), solver.Pose.initial(assembly)
    velocity = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    engine = Engine(assembly, solver.self_weight(assembly).dead, laws, pose, velocity)
    engine.advance(1.2)
    far = engine.pose.positions[0, 0] - assembly.centroids[0, 0]
    # By its friction alone: v² / (2 μ g).
    assert far == pytest.approx(1.0 / (2.0 * 0.1 * solver.GRAVITY), rel=0.05)


@pytest.mark.slow
def test_supports_in_space_end_in_the_ground_of_a_fall(tmp_path):
    """One that had sunk into it was seen below where the ground faded, of what is tall."""
    slabs = [box((x, -1, -2), (x + 3, 1, 0)) for x in (0, 3)]
    piers = [box((x, -0.5, 0), (x + 1, 0.5, 6)) for x in (1, 4)]
    assembly = solver.Assembly.from_solids([*slabs, *piers], roles=["fixed", "moving", "free", "free"])
    down = solver.Settlement(direction=(0, 0, -1), increment=0.5, limit=1.0)
    response = solver.settle(assembly, down, friction_coefficient=0.6)
    last = response.path[-1].pose
    fall = Fall(np.array([0.0, 0.1]), np.stack([last.positions] * 2), np.stack([last.rotations] * 2), -1.0)
    seen = {"view": {"azimuth": -90, "elevation": 20}, "size": (270, 480), "fps": 2, "seconds": 1.0}
    frames = blockvis.animate(response, tmp_path / "frames", fall=fall, **seen)
    dark = (pixels(max(frames.iterdir()))[64:420] < 205).any(axis=2)
    columns = np.flatnonzero(dark.any(axis=0))
    feet = [np.flatnonzero(dark[:, column]).max() for column in (columns.min() + 5, columns.max() - 5)]
    assert feet[0] == pytest.approx(feet[1], abs=1)
