"""The fall in space: energy only falls, nothing ends in another block or in the air, and all comes to rest."""

from functools import cache

import numpy as np
import pytest
from structures import box

import blockvis
import solver
from blockvis.dynamics.engine import Engine
from blockvis.dynamics.fall import fall_of
from blockvis.dynamics.ground import ground_below, on_ground
from solver import mechanics


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
    whole, pose = on_ground(response.assembly, pose, ground_below(response.assembly, pose) - 1.0)
    return Engine(whole, loads, response.interfaces, pose, motion)


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
    sizes, energies = np.where(whole.free, whole.shapes.sizes, np.inf), [engine.energies.sum()]
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
