"""The increment loop: how it starts, what it follows, how it ends, and how its results prove themselves."""

from dataclasses import replace
from functools import cache
from itertools import combinations, pairwise

import numpy as np
import pytest
import shapely
from scipy.optimize import linprog
from structures import arch_response, rectangle

import solver
from blockvis import generators
from solver import mechanics

pytestmark = pytest.mark.path

NO_FALL = solver.Controls(falling_frames=0)
DOWN = solver.Settlement(direction=(0, -1), increment=0.01, limit=0.02)


def two_bricks(**roles_and_names):
    return solver.Assembly.from_outlines(
        [rectangle(0, 0, 2, 1), rectangle(0, 1, 2, 2), rectangle(-1, -1, 3, 0)],
        names=["lower", "upper", "base"],
        **{"roles": ["free", "free", "moving"], **roles_and_names},
    )


def random_wall(seed):
    """Courses of bricks of random lengths on a base in two parts that meet somewhere under the wall."""
    random = np.random.default_rng(seed)
    length, outlines, low = 4.0, [], 0.0
    for _ in range(random.integers(2, 5)):
        height = random.uniform(0.4, 1.2)
        inner = np.sort(random.uniform(0.3, length - 0.3, random.integers(1, 4)))
        for left, right in pairwise([0.0, *inner.tolist(), length]):
            outlines.append(rectangle(left, low, right, low + height))
        low += height
    split = random.uniform(0.3, 0.7) * length
    outlines += [rectangle(-1, -1, split, 0), rectangle(split, -1, length + 1, 0)]
    roles = ["free"] * (len(outlines) - 2) + ["fixed", "moving"]
    return solver.Assembly.from_outlines(outlines, roles=roles, density=random.uniform(1500, 2500, len(outlines)))


# --- input that cannot be analysed -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("roles", "settlements", "words"),
    [
        (["free", "free", "fixed"], DOWN, "moves no support"),
        (["fixed", "fixed", "moving"], DOWN, "3 blocks, all supports"),
        (["free", "free", "moving"], [], "no settlement"),
    ],
)
def test_what_neither_moves_nor_is_free_is_refused(roles, settlements, words):
    with pytest.raises(ValueError, match=words):
        solver.settle(two_bricks(roles=roles), settlements)


@pytest.mark.parametrize(
    "named",
    [
        {"direction": (1, 0), "blocks": ("base", "lower")},
        {"profile": {"base": (0.0, -0.1, 0.0), "lower": (0.0, -1.0, 0.0)}},
    ],
    ids=["blocks", "profile"],
)
def test_a_block_that_does_not_move_is_refused_by_its_phase_and_name(named):
    words = "settlement phase 2 moves block 'lower', whose role is 'free'; give it the role 'moving', or leave it out"
    with pytest.raises(ValueError, match=words):
        solver.settle(two_bricks(), [DOWN, solver.Settlement(**named)])


def test_a_profile_may_name_a_support_that_it_leaves_where_it_is():
    profile = {"base": (0.0, -1.0, 0.0), "lower": (0.0, 0.0, 0.0)}
    response = solver.settle(two_bricks(), solver.Settlement(profile=profile, increment=0.01, limit=0.01))
    assert response.stop is solver.Status.LIMIT_REACHED


def test_overlapping_blocks_are_named_with_their_depth():
    outlines = [rectangle(0, 0, 2, 1), rectangle(0, 0.9, 2, 1.9), rectangle(-1, -1, 3, 0)]
    assembly = solver.Assembly.from_outlines(
        outlines, names=["lower", "upper", "base"], roles=["free", "free", "moving"]
    )
    with pytest.raises(ValueError, match=r"'lower'\) overlaps block 1 \('upper'\) by 0\.1 m"):
        solver.settle(assembly, DOWN)
    # Deeper than a tenth of their width 2 A / P they have no contact points, whatever is accepted.
    with pytest.raises(ValueError, match=r"by 0\.1 m; move them apart: they touch no deeper than 0\.0667 m"):
        solver.settle(assembly, DOWN, controls=solver.Controls(overlap_tolerance=0.2))


def test_overlapping_supports_are_accepted():
    outlines = [rectangle(0, 0, 2, 1), rectangle(-1, -1, 3, 0), rectangle(2, -1, 5, 0)]
    assembly = solver.Assembly.from_outlines(outlines, roles=["free", "moving", "fixed"])
    assert solver.settle(assembly, DOWN, controls=NO_FALL).stop is solver.Status.LIMIT_REACHED


@pytest.mark.parametrize("value", [np.nan, np.inf])
@pytest.mark.parametrize("kind", ["dead", "live"])
def test_loads_that_are_not_finite_are_refused_by_the_block(value, kind):
    loads = solver.self_weight(two_bricks())
    getattr(loads, kind)[1, 0] = value
    with pytest.raises(ValueError, match=f"{kind} load on block 'upper'"):
        solver.settle(two_bricks(), DOWN, loads=loads)


@pytest.mark.parametrize(("numbers", "words"), [(2, r"give \(3, 3\)"), (3, "no load")])
def test_loads_of_the_wrong_shape_and_none_are_refused(numbers, words):
    with pytest.raises(ValueError, match=words):
        solver.settle(two_bricks(), DOWN, loads=solver.Loads(np.zeros((3, numbers)), np.zeros((3, 3))))


# --- how it starts -----------------------------------------------------------------------------------------------


def test_no_initial_equilibrium_names_the_blocks_that_fall():
    assembly = solver.Assembly.from_outlines(
        [rectangle(0, 0, 1, 1), rectangle(5, 3, 6, 4), rectangle(-1, -1, 9, 0)],
        names=["seated", "hovering", "base"],
        roles=["free", "free", "moving"],
    )
    response = solver.settle(assembly, DOWN)
    assert response.stop is solver.Status.NO_INITIAL_EQUILIBRIUM
    assert "'hovering'" in response.message
    assert "'seated'" not in response.message
    assert response.path == ()
    assert response.collapse is None


@pytest.mark.thorough
def test_a_stone_in_the_air_makes_no_sound_arch_fall():
    arch = generators.arch_on_piers()
    outlines = [*np.split(arch.vertices, arch.offsets[1:-1]), rectangle(0.0, 8.0, 0.3, 8.3)]
    roles = [*arch.roles, "free"]
    assembly = solver.Assembly.from_outlines(outlines, names=[*arch.names, "in the air"], roles=roles)
    response = solver.settle(assembly, DOWN, friction_coefficient=0.7)
    assert response.stop is solver.Status.NO_INITIAL_EQUILIBRIUM
    held = ", and would stand with 1766 N along y at 'in the air'; look for"
    assert f"1 of {assembly.free.sum()} blocks fall ('in the air'){held}" in response.message


@pytest.mark.parametrize(("overhang", "stands"), [(0.99, True), (1.01, False)])
def test_overhanging_brick_stands_while_its_centroid_is_over_its_bearing(overhang, stands):
    outlines = [rectangle(overhang, 1, 2 + overhang, 2), rectangle(0, 0, 2, 1)]
    assembly = solver.Assembly.from_outlines(outlines, roles=["free", "moving"])
    response = solver.settle(assembly, DOWN, controls=NO_FALL)
    assert (response.stop is solver.Status.LIMIT_REACHED) == stands
    assert (response.stop is solver.Status.NO_INITIAL_EQUILIBRIUM) != stands
    remedy = "blocks that overhang and tip, which need a tie that is stiff or has prestress, a prop or a support"
    assert (remedy in response.message) != stands


def test_added_load_shows_in_the_reaction():
    assembly = two_bricks()
    loads = solver.self_weight(assembly)
    extra = solver.point_load(assembly, 1, (0, -5000), point=(1.5, 2))
    response = solver.settle(assembly, DOWN, loads=solver.Loads(loads.dead + extra, loads.live), controls=NO_FALL)
    assert response.reaction == pytest.approx(np.full(len(response.path), response.total_weight + 5000), rel=1e-7)


# --- the oracle --------------------------------------------------------------------------------------------------


def kinematic_reaction(assembly, settlement, friction_coefficient):
    """Reaction at the onset from the kinematic program, joints from shapely: independent of the solver's contacts.

    minimise -fᵀq subject to N(q) ≥ μ |T(q)| at both ends of every joint, the supports moving by a unit.
    """
    rate = settlement.rate(assembly, solver.Pose.initial(assembly), 0.0)
    force = np.zeros((assembly.n_blocks, 3))
    force[:, 1] = -assembly.masses * solver.GRAVITY
    polygons = [shapely.Polygon(assembly.outline(i)) for i in range(assembly.n_blocks)]
    rows = []
    for a, b in combinations(range(assembly.n_blocks), 2):
        joint = polygons[a].intersection(polygons[b])
        if joint.geom_type != "LineString" or not (assembly.free[a] or assembly.free[b]):
            continue
        ends = np.asarray(joint.coords)
        tangent = (ends[1] - ends[0]) / joint.length
        normal = np.array([-tangent[1], tangent[0]])
        if normal @ (assembly.centroids[a] - ends[0]) < 0:
            normal = -normal
        for p in ends:
            relative = np.zeros((2, assembly.n_blocks, 3))
            for block, sign in ((a, 1.0), (b, -1.0)):
                arm = p - assembly.centroids[block]
                for k, axis in enumerate((normal, tangent)):
                    relative[k, block] = sign * np.array([*axis, arm[0] * axis[1] - arm[1] * axis[0]])
            rows += [relative[0] + sign * friction_coefficient * relative[1] for sign in (-1, 1)]
    constraints = np.array(rows)
    free = assembly.free
    result = linprog(
        -force[free].ravel(),
        A_ub=-constraints[:, free].reshape(len(rows), -1),
        b_ub=(constraints[:, ~free].reshape(len(rows), -1) @ rate[~free].ravel()),
        bounds=(None, None),
    )
    assert result.status == 0, result.message
    return -result.fun


MOTIONS = {
    "down": {"direction": (0, -1)},
    "out": {"direction": (1, 0)},
    "out and down": {"direction": (0.4, -1)},
    "turning": {"rotation_centre": (4, -1), "rotation": -1},
}


@pytest.mark.parametrize("seed", [*range(4), pytest.param(4, marks=pytest.mark.thorough)])
@pytest.mark.parametrize("motion", MOTIONS)
@pytest.mark.slow
def test_static_program_meets_the_kinematic_oracle(seed, motion):
    wall, mu = random_wall(seed), (0.3, 0.5, 0.7, 0.9, 0.0)[seed]
    settlement = solver.Settlement(**MOTIONS[motion], increment=1e-4, limit=1e-4)
    response = solver.settle(wall, settlement, friction_coefficient=mu, controls=NO_FALL)
    weight = response.total_weight
    assert response.initial_reaction / weight == pytest.approx(
        kinematic_reaction(wall, settlement, mu) / weight, abs=1e-6
    )


# --- the path ----------------------------------------------------------------------------------------------------


def test_limit_reached():
    settlement = solver.Settlement(direction=(0, -1), increment=0.03, limit=0.1)
    response = solver.settle(two_bricks(), settlement, controls=NO_FALL)
    assert response.stop is solver.Status.LIMIT_REACHED
    assert response.collapse is None
    assert response.settlement[0] == 0
    assert response.settlement[-1] == pytest.approx(0.1, rel=1e-12)
    assert np.diff(response.settlement).max() <= 0.03 * (1 + 1e-12)
    assert np.diff(response.settlement).min() > 0


@pytest.mark.slow
@pytest.mark.parametrize("tolerance", [1e-2, 1e-4, pytest.param(1e-5, marks=pytest.mark.thorough)])
def test_bracket_is_as_narrow_as_asked(tolerance):
    settlement = solver.Settlement(direction=(1, 0), increment=0.02, limit=1, tolerance=tolerance)
    response = solver.settle(generators.arch(), settlement, friction_coefficient=2.0, controls=NO_FALL)
    low, high = response.collapse.bracket
    assert 0 < high - low <= tolerance * (1 + 1e-9)
    # Table A of the reference values.
    assert low - 1e-5 <= 0.14104982 <= high + 1e-5
    assert low <= response.collapse.displacement <= high
    assert response.settlement[-1] == low


@pytest.mark.slow
def test_long_steps_towards_a_collapse_are_no_jumps():
    settlement = solver.Settlement(
        direction=(1, 0), increment=0.3, limit=1.2, tolerance=1.2e-3, stops=(0.15, 0.3, 0.6, 0.9)
    )
    controls = replace(NO_FALL, step_tolerance=6.25e-4)
    portal = generators.build("portal", {"column_blocks": 8})
    response = solver.settle(portal, settlement, friction_coefficient=0.6, controls=controls)
    assert response.collapse.displacement == pytest.approx(1.1133, rel=1e-3)
    # 3,712 where a step that supports make as long as a jump counted as one, and the path began again from six of them.
    assert sum(increment.programs for increment in response.increments) < 1500


@pytest.mark.thorough
def test_support_that_moves_away_from_what_it_carried_takes_few_steps():
    wall = generators.wall(bricks=4, courses=4, settling=(0.375, 0.625))
    settlement = solver.Settlement(direction=(0.5, -1.0), increment=0.008, limit=0.024)
    response = solver.settle(wall, settlement, friction_coefficient=0.79, controls=NO_FALL)
    assert response.stop is solver.Status.LIMIT_REACHED
    assert np.abs(response.reaction[1:]).max() < 1e-4 * response.reaction[0]
    # 203 in the first increment where the error of a step was measured by a reaction of next to nothing.
    assert max(increment.programs for increment in response.increments) < 60


@pytest.mark.slow
def test_a_speck_that_tumbles_between_large_stones_makes_no_step_short():
    stones = [rectangle(0, 0, 4, 3), rectangle(4, 0, 8, 3), rectangle(8, 0, 12, 3)]
    lintels = [rectangle(1, 3, 5.9, 4), rectangle(5.9005, 3, 11, 4)]
    outlines = [rectangle(-1, -0.5, 6, 0), rectangle(6, -0.5, 12, 0), *stones, *lintels]
    speck, roles = rectangle(5.9, 3, 5.9005, 3.0005), ["moving", "fixed", *["free"] * 5]
    down = solver.Settlement(direction=(0, -1), increment=0.02, limit=0.2)
    with_it, without = (
        solver.settle(
            solver.Assembly.from_outlines(given, roles=[*roles, *["free"] * (len(given) - 7)]),
            down, friction_coefficient=0.6, controls=NO_FALL,
        )
        for given in ([*outlines, speck], outlines)
    )  # fmt: skip
    # Rounding decides where it comes to lie between the lintels.
    assert with_it.reaction[-1] == pytest.approx(without.reaction[-1], rel=0.02)
    assert sum(increment.programs for increment in with_it.increments) < 1500, "13,012 by its rotation times their size"


def test_a_settlement_made_anew_keeps_its_last_digits():
    for direction, axis in np.random.default_rng(0).normal(size=(20, 2, 3)):
        settlement = solver.Settlement(direction, rotation_centre=(0, 0, 0), rotation=0.3, rotation_axis=axis)
        assert replace(settlement) == settlement


def test_rotation_about_a_point_moves_the_support_on_the_arc():
    centre = np.array([2.0, 7.0])
    settlement = solver.Settlement(rotation_centre=centre, rotation=1, increment=0.05, limit=0.2)
    response = solver.settle(two_bricks(), settlement, friction_coefficient=0.6, controls=NO_FALL)
    assert response.stop is solver.Status.LIMIT_REACHED
    for increment in response.path:
        arm = (increment.pose.positions[2] - centre) @ [1, 1j]
        start = (response.assembly.centroids[2] - centre) @ [1, 1j]
        assert arm == pytest.approx(start * np.exp(1j * increment.settlement), abs=1e-12)
        # What stands on it turns with it; its first increment may creep, see the closed forms.
        assert increment.pose.rotations[:, 0] == pytest.approx(np.full(3, increment.settlement), abs=1e-8)
        block = increment.pose.positions[0] - increment.pose.positions[2]
        drawn = response.assembly.centroids[0] - response.assembly.centroids[2]
        assert np.hypot(*block) == pytest.approx(np.hypot(*drawn), abs=2e-3)


@pytest.mark.thorough
def test_several_phases():
    """20 mm down, then spreading from there until it collapses."""
    arch = generators.arch()
    phases = [DOWN, solver.Settlement(direction=(1, 0), increment=0.02, limit=0.5)]
    response = solver.settle(arch, phases, friction_coefficient=2.0, controls=NO_FALL)
    assert response.stop is solver.Status.COLLAPSED
    number = np.array([i.phase for i in response.path])
    assert number.tolist() == sorted(number)
    assert set(number.tolist()) == {0, 1}
    assert response.settlement[number == 0][-1] == pytest.approx(0.02)
    assert response.settlement[number == 1][0] == 0
    springer = arch.index("right springer")
    for increment in response.path:
        moved = increment.pose.displacements(arch)[springer]
        s = increment.settlement
        expected = [0, -s, 0] if increment.phase == 0 else [s, -0.02, 0]
        assert moved == pytest.approx(expected, abs=1e-12)
    # The reaction is the force along the motion of its own phase: first down, then outwards.
    for increment in response.path:
        force = increment.support_forces[springer]
        along = -force[1] if increment.phase == 0 else force[0]
        # Where equilibrium leaves one reaction, forces have it to within its bounds.
        assert increment.reaction == pytest.approx(along, rel=1e-7)
    # Having sunk, it does not spread as far as from its drawing (table A: 0.14104982).
    assert response.collapse.displacement < 0.1405


@pytest.mark.thorough
def test_direction_and_rotation_together():
    arch = generators.arch()
    springer = arch.index("right springer")
    settlement = solver.Settlement(direction=(0, -1), rotation_centre=(1, 0), rotation=0.3, increment=0.02, limit=0.1)
    response = solver.settle(arch, settlement, friction_coefficient=2.0, controls=NO_FALL)
    assert response.stop is solver.Status.LIMIT_REACHED
    last = response.path[-1]
    drawn = (arch.centroids[springer] - [1, 0]) @ [1, 1j]
    here = (last.pose.positions[springer] - [1, -0.1]) @ [1, 1j]
    assert here == pytest.approx(drawn * np.exp(0.03j), abs=1e-12)
    # Reaction per unit of s: the force down and 0.3 times the moment about the travelling centre.
    fx, fy, moment = last.support_forces[springer]
    arm = np.array([here.real, here.imag])
    expected = -fy + 0.3 * (moment + arm[0] * fy - arm[1] * fx)
    assert last.reaction == pytest.approx(expected, rel=1e-7)


# --- results that prove themselves -------------------------------------------------------------------------------


@cache
def wall_response():
    sink = solver.Settlement(direction=(0, -1), increment=0.02, limit=0.1)
    return solver.settle(random_wall(3), sink, friction_coefficient=0.5)


@cache
def sliding_response():
    """An arch of so little friction that it slides."""
    spread = solver.Settlement(direction=(1, 0), increment=0.02, limit=0.5)
    return solver.settle(generators.arch(thickness_ratio=0.3, voussoirs=8), spread, friction_coefficient=0.35)


RESPONSES = {"arch": arch_response, "wall": wall_response, "sliding arch": sliding_response}

#: An arch that slides takes as long as both others.
EACH_RESPONSE = pytest.mark.parametrize(
    "name", ["arch", "wall", pytest.param("sliding arch", marks=pytest.mark.thorough)]
)


@pytest.mark.slow
@pytest.mark.parametrize("name", RESPONSES)
def test_certificates(name):
    response = RESPONSES[name]()
    smallest = response.assembly.widths.min()
    assert len(response.path) > 3
    for increment in response.path:
        proof = increment.certificate
        assert proof.equilibrium_residual <= 1e-8
        assert proof.friction_excess <= 1e-8
        assert proof.duality_gap <= 1e-7
        assert proof.largest_penetration <= 1e-6 * smallest


@EACH_RESPONSE
def test_forces_are_in_equilibrium_and_in_their_cones(name):
    """Worked out again from the increment alone, not read from its certificate."""
    response = RESPONSES[name]()
    assembly, weight = response.assembly, response.total_weight
    for increment in response.path:
        resultant = mechanics.block_forces(increment.contacts, increment.pose, increment.forces) + response.loads.dead
        unbalanced = resultant[assembly.free] / (weight * np.array([1, 1, assembly.block_size]))
        assert np.abs(unbalanced).max() < 1e-8
        normal, shear = increment.forces.T
        assert normal.min() >= -1e-9 * weight
        assert (np.abs(shear) - increment.friction * normal).max() <= 1e-9 * weight
        # What carries force is closed.
        assert np.abs(increment.contacts.gaps[normal > 1e-3 * weight]).max() < 1e-6 * assembly.block_size
        assert increment.support_forces[:, :2].sum(axis=0) == pytest.approx([0, -weight], abs=1e-6 * weight)


@EACH_RESPONSE
def test_blocks_do_not_overlap(name):
    """On the path and in the fall, as shapely sees it."""
    response = RESPONSES[name]()
    assembly = response.assembly
    smallest = assembly.widths.min()
    for increment in response.increments[:: 1 if len(response.increments) < 20 else 3]:
        corners = mechanics.moved_vertices(assembly, increment.pose)
        blocks = [shapely.Polygon(c) for c in np.split(corners, assembly.offsets[1:-1])]
        for i, j in zip(*shapely.STRtree(blocks).query(blocks), strict=True):
            if i < j and (assembly.free[i] or assembly.free[j]):
                shared = blocks[i].intersection(blocks[j])
                width = 2 * shared.area / shared.length if shared.area > 0 else 0.0
                assert width < 1e-3 * smallest, (increment.settlement, assembly.names[i], assembly.names[j])


@pytest.mark.thorough
def test_brick_that_rises_past_its_neighbour_does_not_turn_into_it():
    """Two bricks of equal height; one has risen by 5 mm when it starts to lean on the other's corner."""
    wall = random_wall(108)
    sink = solver.Settlement(direction=(0, -1), increment=0.05, limit=0.1)
    response = solver.settle(wall, sink, friction_coefficient=0.9, controls=NO_FALL)
    for increment in response.path:
        corners = mechanics.moved_vertices(wall, increment.pose)
        _, _, depth = mechanics.overlap_depths(corners, wall.offsets, 1e-9)
        assert depth.max(initial=0.0) < 1e-3 * wall.widths.min(), increment.settlement


@pytest.mark.thorough
def test_equilibrium_lost_on_the_way_is_not_called_initial():
    """A wall of five blocks that has been followed for 50 mm."""
    sink = solver.Settlement(direction=(0, -1), increment=0.05, limit=0.5)
    response = solver.settle(random_wall(112), sink, friction_coefficient=0.7, controls=NO_FALL)
    assert len(response.path) > 1
    assert response.stop is not solver.Status.NO_INITIAL_EQUILIBRIUM


def test_reaction_does_the_work_that_gravity_loses():
    """Hinges dissipate nothing: the reaction over the path adds up to the drop of the potential energy."""
    response = arch_response()
    weights = response.assembly.masses * solver.GRAVITY * response.assembly.free
    energy = np.array([weights @ i.pose.positions[:, 1] for i in response.path])
    # The reaction at rest is left at once.
    reaction = np.concatenate([[response.initial_reaction], response.reaction[1:]])
    work = np.concatenate([[0], np.cumsum(np.diff(response.settlement) * (reaction[1:] + reaction[:-1]) / 2)])
    assert np.abs(work - (energy[0] - energy)).max() < 1e-3 * work[-1]


@pytest.mark.thorough
def test_sliding_costs_energy():
    """With friction the reaction does less work than gravity loses."""
    response = sliding_response()
    assert any((i.states == mechanics.ContactState.SLIDING).any() for i in response.path)
    weights = response.assembly.masses * solver.GRAVITY * response.assembly.free
    energy = [weights @ i.pose.positions[:, 1] for i in (response.path[0], response.path[-1])]
    assert np.trapezoid(response.reaction, response.settlement) < 0.99 * (energy[0] - energy[1])


def test_falling_frames_follow_the_path_and_go_down():
    response = arch_response()
    status = [i.status for i in response.increments]
    n = len(response.path)
    assert set(status[:n]) == {solver.Status.EQUILIBRIUM}
    assert set(status[n:]) == {solver.Status.FALLING}
    assert 5 < len(status) - n <= 12
    weights = response.assembly.masses * response.assembly.free
    height = [weights @ i.pose.positions[:, 1] for i in response.increments[n:]]
    assert (np.diff(height) < 1e-9 * weights.sum()).all()
    assert height[-1] < height[0]
    # Frames are as far apart as one can see.
    way = np.linalg.norm(np.diff([i.pose.positions for i in response.increments[n + 2 :]], axis=0), axis=2).max(axis=1)
    assert (way > 0.05 * response.assembly.block_size).all()
    assert all(i.settlement == response.increments[n].settlement for i in response.increments[n:])


def test_mechanism_at_collapse():
    response = arch_response()
    mechanism = response.collapse.mechanism
    # The supports rest but for the nudge, a ten-millionth of the block size, that proves the place.
    assert np.abs(mechanism[~response.assembly.free]).max() < 1e-6
    size = np.abs(mechanism * [1, 1, response.assembly.block_size]).max()
    assert size == pytest.approx(1.0)
    assert (response.loads.dead * mechanism).sum() > 0


def test_increments_are_yielded_as_they_are_found():
    told = []
    response = solver.settle(two_bricks(), DOWN, controls=NO_FALL, on_increment=told.append)
    assert tuple(told) == response.increments


@pytest.mark.thorough
def test_no_brick_falls_into_another_where_little_drag_holds_it():
    """A wall over a flat arch whose ground moves aside: a brick fell by a third of its size in one careful step."""
    opening = {"x": 0.375, "y": 0.0, "width": 0.375, "height": 0.5, "head": "flat arch"}
    wall = generators.wall(bricks=4, courses=9, settling=(0.375, 1.0), openings=[opening])
    sideways = solver.Settlement((1.0, 0.0), increment=0.0058, limit=0.116)
    response = solver.settle(wall, sideways, friction_coefficient=0.72)
    assert response.stop in (solver.Status.COLLAPSED, solver.Status.LIMIT_REACHED), response.message
    for increment in response.path:
        moved = np.split(mechanics.moved_vertices(wall, increment.pose), wall.shapes.offsets[1:-1])
        shapes = [shapely.Polygon(corners) for corners in moved]
        shared = [a.intersection(b).area for a, b in combinations(shapes, 2) if a.intersects(b)]
        assert max(shared, default=0.0) < 1e-6 * max(shape.area for shape in shapes)


@pytest.mark.parametrize(("gap", "told"), [(4e-4, 0), (5e-3, 1)])
def test_blocks_that_do_not_stand_as_drawn_are_told(gap, told):
    outlines = [[[-5, -1], [5, -1], [5, 0], [-5, 0]], [[0, gap], [1, gap], [1, 1 + gap], [0, 1 + gap]]]
    assembly = solver.Assembly.from_outlines(outlines, names=["ground", "block"], roles=["moving", "free"])
    response = solver.settle(assembly, solver.Settlement(direction=(0, -1), increment=0.01, limit=0.01))
    assert len(response.notes) == told
    assert all("'block' moved by up to 0.005 m at once" in note and "as drawn" in note for note in response.notes)


@pytest.mark.slow
def test_blocks_that_are_wedged_as_drawn_end_the_path_with_what_to_do():
    """Their forces grew by what they are in each other, with each program, in steps of 1e-5 of a block."""
    ground = [rectangle(-1, -1, 4, 0), rectangle(-1, 0, 0, 1), rectangle(3, 0, 4, 1), rectangle(5, -1, 7, 0)]
    stones = [*(rectangle(k, 0, k + 1.0002, 1) for k in range(3)), rectangle(5.2, 0, 6.2, 1)]
    roles = ["fixed", "fixed", "fixed", "moving", *["free"] * 4]
    assembly = solver.Assembly.from_outlines([*ground, *stones], roles=roles)
    sinks = solver.Settlement((0, -1), increment=0.1, limit=0.2)
    controls = replace(NO_FALL, overlap_tolerance=1e-3)
    response = solver.settle(assembly, sinks, friction_coefficient=0.6, controls=controls)
    assert response.stop is solver.Status.LOCKED
    assert "as drawn they have no room: make their faces plane, or trim them" in response.message


def test_forces_have_the_reaction_they_are_told_with_where_friction_bounds_it_to_neither_side():
    """Three blocks that two walls hold between them, one of which sinks."""
    outlines = [rectangle(k, 0.0, k + 1.0, 1.0) for k in range(5)]
    roles = ["fixed", "free", "free", "free", "moving"]
    structure = solver.Structure(solver.Assembly.from_outlines(outlines, roles=roles), friction_coefficient=0.8)
    response = structure.settle(solver.Settlement((0.0, -1.0), increment=0.002, limit=0.004))
    for increment in response.path:
        assert (increment.least, increment.largest) == (-np.inf, np.inf)
        assert -increment.support_forces[4, 1] == pytest.approx(increment.reaction, rel=1e-9)
