"""Forces at points of blocks, which go with them: a wall on ground that tilts, against its moments about the toe."""

import numpy as np
import pytest
from structures import box

import blockvis
import solver

B, H = 0.4, 2.0
ROUGH = 2.0


def wall(dimension=2):
    """A wall on ground, and its weight."""
    if dimension == 2:
        outlines = [[[-2, -1], [2, -1], [2, 0], [-2, 0]], [[-B / 2, 0], [B / 2, 0], [B / 2, H], [-B / 2, H]]]
        assembly = solver.Assembly.from_outlines(outlines, roles=["moving", "free"], names=["ground", "wall"])
    else:
        boxes = [((-2, -2, -1), (2, 2, 0)), ((-B / 2, -0.5, 0), (B / 2, 0.5, H))]
        assembly = solver.Assembly.from_solids([box(*one) for one in boxes], roles=["moving", "free"])
    return assembly, assembly.masses[1] * solver.GRAVITY


def tilt(dimension, limit, increment=0.05):
    """Ground that tilts about the middle of the wall's foot, clockwise in the plane."""
    if dimension == 2:
        return solver.Settlement(rotation_centre=(0, 0), rotation=-1.0, increment=increment, limit=limit)
    axis = {"rotation_centre": (0, 0, 0), "rotation_axis": (0, 1, 0)}
    return solver.Settlement(rotation=1.0, increment=increment, limit=limit, **axis)


@pytest.mark.parametrize("dimension", [2, pytest.param(3, marks=pytest.mark.slow)])
@pytest.mark.slow
def test_a_load_on_the_top_of_a_wall_leans_with_it(dimension):
    """3 W on the top, W at half the height: b/2 cos 4 W = sin (W h/2 + 3 W h). At the centroid it would be atan b/h."""
    assembly, weight = wall(dimension)
    down = np.eye(dimension)[-1] * -3.0 * weight
    forces = solver.PointForces.at(1, down, np.eye(dimension)[-1] * H)
    loads = solver.self_weight(assembly).with_forces(assembly, forces)
    response = solver.settle(assembly, [tilt(dimension, 0.2)], friction_coefficient=ROUGH, loads=loads)
    by_hand = np.arctan(2.0 * B / (3.5 * H))
    low, high = response.collapse.bracket
    assert low - 1e-5 <= by_hand <= high + 1e-5


def test_the_paper_s_programs_follow_it_too():
    assembly, weight = wall()
    loads = solver.self_weight(assembly).with_forces(assembly, solver.PointForces.at(1, (0, -3.0 * weight), (0, H)))
    programs = solver.Controls(increments="linear program")
    structure = solver.Structure(assembly, friction_coefficient=ROUGH, loads=loads)
    low, high = structure.settle(tilt(2, 0.2), controls=programs).collapse.bracket
    assert low - 1e-5 <= np.arctan(2.0 * B / (3.5 * H)) <= high + 1e-5


@pytest.mark.slow
def test_a_pressure_of_a_case_leans_with_its_wall(tmp_path):
    """The same as a pressure of 3 W on the top, in a case file."""
    corners = {"ground": "[[-2, -1], [2, -1], [2, 0], [-2, 0]]", "wall": "[[-0.2, 0], [0.2, 0], [0.2, 2], [-0.2, 2]]"}
    roles = {"ground": "moving", "wall": "free"}
    blocks = [f'{{"name": "{k}", "role": "{roles[k]}", "outline": {v}}}' for k, v in corners.items()]
    (tmp_path / "wall.json").write_text(f'{{"blocks": [{", ".join(blocks)}]}}')
    text = """[geometry]
file = "wall.json"
[material]
density = 2000
friction_coefficient = 2.0
[[loads]]
blocks = "wall"
pressure = 117720
[settlement]
rotation_centre = [0, 0]
rotation = -1
increment = 0.02
limit = 0.2
"""
    (tmp_path / "case.toml").write_text(text)
    low, high = blockvis.run_case(tmp_path / "case.toml", tmp_path / "out", outputs=()).response.collapse.bracket
    assert low - 1e-5 <= np.arctan(2.0 * B / (3.5 * H)) <= high + 1e-5


@pytest.mark.slow
def test_a_pushover_follows_the_point_of_its_live_load():
    """A level force at the top: α F y(top) = W x(centroid), from the toe about which the wall turns."""
    assembly, weight = wall()
    live = solver.PointForces.at(1, (1000.0, 0.0), (-B / 2, H))
    loads = solver.self_weight(assembly).with_forces(assembly, live, "live")
    control = solver.ControlDisplacement(block="wall", direction=(1, 0), increment=0.05, limit=0.15)
    response = solver.pushover(assembly, control, friction_coefficient=ROUGH, loads=loads)
    for increment in response.path:
        pose, toe = increment.pose, np.array([B / 2, 0.0])
        centroid = pose.positions[1] - toe
        c, s = np.cos(pose.rotations[1, 0]), np.sin(pose.rotations[1, 0])
        top = centroid + np.array([[c, -s], [s, c]]) @ np.array([-B / 2, H / 2])
        assert increment.load_multiplier == pytest.approx(-weight * centroid[0] / (1000.0 * top[1]), rel=2e-5)
        assert increment.certificate.equilibrium_residual < 1e-8


def test_the_capacity_after_a_tilt_is_that_of_the_point_where_it_is():
    """A vertical force near the edge of the top, with the wall and its ground tilted by 0.1."""
    assembly, weight = wall()
    live = solver.PointForces.at(1, (0.0, -weight), (0.15, H))
    loads = solver.self_weight(assembly).with_forces(assembly, live, "live")
    structure = solver.Structure(assembly, friction_coefficient=ROUGH, loads=loads)
    response = structure.settle(tilt(2, 0.1, 0.1))
    found = structure.limit_load(pose=response.path[-1].pose)
    c, s = np.cos(0.1), np.sin(0.1)
    toe, centroid, point = (x * c + y * s for x, y in ((B / 2, 0.0), (0.0, H / 2), (0.15, H)))
    assert found.multiplier == pytest.approx((toe - centroid) / (point - toe), rel=1e-5)


@pytest.mark.slow
def test_a_load_that_is_added_later_goes_with_its_block():
    assembly, weight = wall()
    forces = solver.PointForces.at(1, (0.0, -3.0 * weight), (0.0, H))
    added = solver.PhaseChange(1, dead=forces.load(assembly), dead_arms=forces.arms(assembly))
    phases = [tilt(2, 0.02, 0.02), tilt(2, 0.2)]
    response = solver.Structure(assembly, friction_coefficient=ROUGH).settle(phases, changes=[added])
    by_hand = np.arctan(2.0 * B / (3.5 * H)) - 0.02
    low, high = response.collapse.bracket
    assert low - 1e-5 <= by_hand <= high + 1e-5


def test_forces_of_a_surface_are_its_load_as_drawn():
    assembly, _ = wall()
    for forces, load in (
        (solver.surface_forces(assembly, 1e3), solver.surface_pressure(assembly, 1e3)),
        (solver.edge_force(assembly, 1, 2, 1e3), solver.edge_pressure(assembly, 1, 2, 1e3)),
        (solver.force_on_top(assembly, 0.1), solver.load_on_top(assembly, 0.1)),
    ):
        assert np.array_equal(forces.load(assembly), load)
        loads = solver.self_weight(assembly).with_forces(assembly, forces)
        drawn = solver.Pose.initial(assembly)
        assert np.array_equal(loads.dead_at(assembly, drawn), loads.dead)
