"""Joints with cohesion and compressive strength: closed forms of what the point model computes."""

import re

import numpy as np
import pytest
from structures import alike, box, case_from, drawn, in_either, pixels, prism, rectangle, run_command

import blockvis
import solver
from blockvis import generators
from solver import mechanics

WIDTH, HEIGHT, THICKNESS = 0.8, 0.5, 0.3
AREA = WIDTH * THICKNESS


def block(height=HEIGHT, **law):
    assembly = solver.Assembly.from_outlines(
        [[[0, 0], [WIDTH, 0], [WIDTH, height], [0, height]], [[-1, -1], [2, -1], [2, 0], [-1, 0]]],
        roles=["free", "fixed"],
        names=["block", "ground"],
        thickness=THICKNESS,
    )
    return assembly, solver.Interfaces(solver.InterfaceLaw(**law)), mechanics.total_weight(assembly)


def limit(assembly, interfaces, live, **options):
    loads = solver.Loads(solver.self_weight(assembly).dead, live)
    found = solver.limit_load(assembly, loads=loads, interfaces=interfaces, **options)
    if options.get("flow", "associative") == "associative":
        assert found.certificate.duality_gap < 1e-9
        assert found.certificate.friction_excess < 1e-9
        assert found.certificate.kinematic_violation < 1e-9
    return found


@pytest.mark.parametrize("flow", ["associative", "non-associative"])
@pytest.mark.parametrize("cohesion", [0.0, 2e3, 5e3])
def test_a_block_slides_at_friction_and_cohesion(flow, cohesion):
    """Pushed at its base: α W = μ W + c A."""
    assembly, interfaces, weight = block(friction_coefficient=0.3, cohesion=cohesion)
    live = solver.point_load(assembly, 0, (weight, 0.0), point=(0.0, 0.0))
    found = limit(assembly, interfaces, live, flow=flow)
    assert found.multiplier == pytest.approx(0.3 + cohesion * AREA / weight, rel=1e-6)
    lifts = found.mechanism[0, 1] / found.mechanism[0, 0]
    assert lifts == pytest.approx(0.3 if flow == "associative" else 0.0, abs=1e-6)


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize(
    "more", [{}, {"tensile_strength": 1e4}, {"tensile_strength": 1e4, "compressive_strength": 1e6}]
)
def test_a_block_glued_between_two_walls_slips_at_its_cohesion(dimension, more):
    """Its mortar holds it without pressing, so that friction adds nothing: α = 2 c A / W - 1."""
    cohesion, shapes = 2e4, [rectangle(*at) for at in ((0, 0, 1, 0.5), (-1, -1, 0, 2), (1, -1, 2, 2))]
    roles = ["free", "fixed", "fixed"]
    if dimension == 3:
        assembly = solver.Assembly.from_solids([prism(shape, 0.0, THICKNESS) for shape in shapes], roles=roles)
    else:
        assembly = solver.Assembly.from_outlines(shapes, roles=roles, thickness=THICKNESS)
    weight = mechanics.total_weight(assembly)
    dead = solver.weight_fraction(assembly, (0.0, -1.0, 0.0)[:dimension], np.array([0]))
    interfaces = solver.Interfaces(solver.InterfaceLaw(0.6, cohesion, **more))
    found = solver.limit_load(assembly, loads=solver.Loads(dead, dead), interfaces=interfaces, flow="non-associative")
    assert found.status is solver.LimitStatus.FOUND
    assert found.multiplier == pytest.approx(2.0 * cohesion * 0.5 * THICKNESS / weight - 1.0, rel=2e-5)
    assert found.forces[:, 0] == pytest.approx(0.0, abs=1e-5 * weight)


@pytest.mark.parametrize("dimension", [2, pytest.param(3, marks=pytest.mark.thorough)])
@pytest.mark.parametrize(("tension", "strength"), [(3e3, 1e5), (1e4, 1e6)])
def test_a_block_glued_between_two_walls_that_is_pushed_at_one_of_them_locks_until_it_crushes(
    dimension, tension, strength
):
    """What the push presses adds more friction than it needs; off the other wall alone it pulled, and slipped."""
    shapes = [rectangle(*at) for at in ((0, 0, 1, 0.5), (-1, -1, 0, 2), (1, -1, 2, 2))]
    roles, down, push = ["free", "fixed", "fixed"], (0.0, -1.0, 0.0)[:dimension], (1.0, -0.3, 0.0)[:dimension]
    assembly = in_either(dimension, shapes, prism, roles=roles)
    loads = solver.Loads(*(solver.weight_fraction(assembly, of, [0]) for of in (down, push)))
    law = solver.InterfaceLaw(1.0, 1e4, strength, tensile_strength=tension)
    structure = solver.Structure(assembly, solver.Interfaces(law), loads)
    found = structure.limit_load(flow="non-associative")
    assert found.status is solver.LimitStatus.FOUND
    assert 0.65 < found.multiplier / structure.limit_load().multiplier < 0.75


def test_a_flat_arch_whose_corners_have_cohesion_and_crush_begins_with_its_forces_at_rest():
    """Three blocks of weight w between walls, P = σ A / 2 at each corner: associative α = P h / (w l) - 1.

    At rest they stand with corners that crush and slip; told by one vertex of the program of equilibrium, α was 0.
    """
    strength, height = 1e5, 0.5
    shapes = [*(rectangle(i, 0, i + 1, height) for i in range(3)), rectangle(-1, -1, 0, 2), rectangle(3, -1, 4, 2)]
    assembly = solver.Assembly.from_outlines(shapes, roles=["free"] * 3 + ["fixed"] * 2, thickness=THICKNESS)
    dead = solver.weight_fraction(assembly, (0.0, -1.0))
    law = solver.InterfaceLaw(0.6, 1e3, compressive_strength=strength)
    structure = solver.Structure(assembly, solver.Interfaces(law), solver.Loads(dead, dead))
    most = strength * height * THICKNESS / 2.0 * height / (mechanics.total_weight(assembly) / 3.0) - 1.0
    assert structure.limit_load().multiplier <= most + 1e-9
    assert 0.05 < structure.limit_load(flow="non-associative").multiplier < most


@pytest.mark.parametrize("flow", ["associative", "non-associative"])
@pytest.mark.parametrize("strength_over_weight", [1.2, 1.5, 1.9, 2.0, 5.0])
def test_a_block_overturns_where_its_toe_crushes(flow, strength_over_weight):
    """Each corner carries P = σ A / 2; the toe has W/2 + α W h/(2 b), so that α = (b/h) (2 min(P, W)/W - 1)."""
    height = 2.0
    _, _, weight = block(height)
    strength = strength_over_weight * weight / AREA
    assembly, interfaces, weight = block(height, friction_coefficient=2.0, compressive_strength=strength)
    live = solver.weight_fraction(assembly, (1.0, 0.0), np.array([0]))
    found = limit(assembly, interfaces, live, flow=flow)
    toe = min(strength_over_weight / 2.0, 1.0)
    assert found.multiplier == pytest.approx(WIDTH / height * (2.0 * toe - 1.0), rel=1e-6)
    assert found.forces[:, 0].max() == pytest.approx(toe * weight, rel=1e-6)


def test_a_block_heavier_than_its_joint_is_not_carried():
    _, _, weight = block()
    assembly, interfaces, _ = block(compressive_strength=0.9 * weight / AREA)
    found = limit(assembly, interfaces, solver.weight_fraction(assembly, (1.0, 0.0), np.array([0])))
    assert found.status is solver.LimitStatus.NO_EQUILIBRIUM


@pytest.mark.parametrize("in_space", [False, True])
@pytest.mark.slow
def test_what_crushes_is_told_and_marked_where_it_presses(in_space, tmp_path):
    """The block turns about its heel, which keeps its place: a dot there would put the force on the wrong side."""
    _, _, weight = block(2.0)
    assembly, interfaces, _ = block(2.0, friction_coefficient=2.0, compressive_strength=1.5 * weight / AREA)
    if in_space:
        solids = [box((0, 0, 0), (WIDTH, THICKNESS, 2)), box((-1, -1, -1), (2, 1, 0))]
        assembly = solver.Assembly.from_solids(solids, roles=["free", "fixed"], names=["block", "ground"])
    live = solver.weight_fraction(assembly, np.eye(assembly.dimension)[0], np.array([0]))
    found = limit(assembly, interfaces, live)
    blockvis.write(found.response, tmp_path / "out")
    response = blockvis.open_results(tmp_path / "out")
    mechanism = mechanics.mechanism_of(assembly, response.path[0])
    assert str(mechanism) == "1 macro-block; crushing at block | ground"
    np.testing.assert_allclose(response.path[0].contacts.points[mechanism.crushing_points, 0], WIDTH)
    assert f'"{mechanism}"' in (tmp_path / "out" / "summary.json").read_text(encoding="utf-8")
    picture = pixels(blockvis.draw_mechanism(response, tmp_path / "mechanism.png", size=(640, 360)))
    rows, columns = alike(picture[60:300], (255, 193, 7)).nonzero()
    assert len(rows) > 10
    if not in_space:
        assert np.ptp(columns) < 20
    assert "1 moving part, 1 crushing joint" in blockvis.write_report(response, tmp_path / "r.html").read_text()


@pytest.mark.slow
def test_two_glued_blocks_that_tip_as_one_are_one_macro_block():
    """The joint between them closes by what it gives, at 1e-3 of the fastest corner; it does not part them."""
    outlines = [rectangle(0, 0, 1, 0.5), rectangle(1, 0, 1.6, 0.5), rectangle(-3, -0.5, 1, 0)]
    names, materials = ["inner", "outer", "ledge"], ["s", "s", "rock"]
    assembly = solver.Assembly.from_outlines(
        outlines, roles=["free", "free", "moving"], names=names, materials=materials
    )
    glue = solver.InterfaceLaw(0.6, 2e6, tensile_strength=1e6)
    interfaces = solver.Interfaces(solver.InterfaceLaw(2.0), {("s", "s"): glue})
    tilt = solver.Settlement(rotation_centre=(1.0, 0.0), rotation=-1.0, increment=0.3, limit=1.0, tolerance=1e-3)
    controls = solver.Controls(falling_frames=1)
    response = solver.settle(assembly, tilt, interfaces=interfaces, controls=controls)
    assert response.collapse.displacement == pytest.approx(np.arctan(0.2 / 0.25), rel=1e-3)
    falling = mechanics.with_motion(response.path[-1], response.collapse.mechanism)
    assert str(mechanics.mechanism_of(assembly, falling)) == "1 macro-block; hinge at inner | ledge"


def test_a_press_crushes_at_the_strength_of_the_joint():
    """A downward force, unbounded for rigid joints: W + α F = σ A."""
    assembly, interfaces, weight = block(compressive_strength=1e6)
    found = limit(assembly, interfaces, solver.point_load(assembly, 0, (0.0, -1000.0)))
    assert found.multiplier == pytest.approx((1e6 * AREA - weight) / 1000.0, rel=1e-9)
    # The block sinks into its joint.
    assert found.mechanism[0] == pytest.approx([0.0, -1.0, 0.0], abs=1e-9)


def test_cohesion_does_not_hold_a_joint_together():
    """Without tension a tall block overturns at b/h whatever its cohesion."""
    assembly, interfaces, _ = block(2.0, friction_coefficient=0.2, cohesion=1e6)
    found = limit(assembly, interfaces, solver.weight_fraction(assembly, (1.0, 0.0), np.array([0])))
    assert found.multiplier == pytest.approx(WIDTH / 2.0, rel=1e-9)


def test_faces_are_shared_out_among_their_contact_points():
    """A brick on two: each interface has its own length, and the parts of all points make up the whole face."""
    wall = generators.build("wall", {"bricks": 4, "courses": 3, "depth": 0.2})
    contacts = mechanics.find_contacts(wall, wall.vertices, 1e-6)
    areas = contacts.areas
    for course, bearing in ((0, 4 * 0.25), (1, 4 * 0.25), (2, 4 * 0.25)):
        flat = np.abs(contacts.frames[:, 0, 1]) > 0.5
        at = flat & (np.abs(contacts.points[:, 1] - 0.1 * course) < 1e-9)
        assert areas[at].sum() == pytest.approx(bearing * 0.2, rel=1e-9)
    half = solver.Interfaces(solver.InterfaceLaw(), {("brick", "ground"): solver.InterfaceLaw(0.6, 1e3, 1e6)})
    cohesion, strength = half.values(wall, contacts.block_a, contacts.block_b, "cohesion", "compressive_strength")
    on_ground = contacts.points[:, 1] < 1e-9
    assert set(cohesion[on_ground & flat]) == {1e3}
    assert set(strength[~on_ground]) == {np.inf}


#: Stones that are not convex, fixed, and what touches them: a lintel on the feet of a U, a tenon in a socket.
TOUCHING = {
    "U": ([[0, 0], [2, 0], [2, 1], [1.8, 1], [1.8, 0.5], [0.2, 0.5], [0.2, 1], [0, 1]], rectangle(0, 1, 2, 1.5)),
    "socket": ([[0, 0], [3, 0], [3, 2], [2, 2], [2, 1], [1, 1], [1, 2], [0, 2]], rectangle(1, 1, 2, 3)),
}


@pytest.mark.parametrize(("name", "along", "area"), [("U", 0, 0.4), ("socket", 1, 2.0)])
@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("in_space", [False, True])
def test_cohesion_acts_where_stones_that_are_not_convex_touch(name, along, area, mirrored, in_space):
    """Without friction, pushed along its faces: α W = c A, and out of a socket c A beside its own weight."""
    outlines = [np.array(outline, dtype=float) for outline in TOUCHING[name]]
    if mirrored:
        outlines = [(outline * [-1.0, 1.0])[::-1] for outline in outlines]
    roles, direction = ["fixed", "free"], np.zeros(3 if in_space else 2)
    if in_space:
        solids = [(corners[:, [0, 2, 1]] * [1, -1, 1], faces) for corners, faces in map(prism, outlines)]
        assembly = solver.Assembly.from_solids(solids, roles=roles)
    else:
        assembly = solver.Assembly.from_outlines(outlines, roles=roles)
    interfaces = solver.Interfaces(solver.InterfaceLaw(friction_coefficient=0.0, cohesion=1e4))
    direction[-1 if along else 0] = 1.0
    found = solver.Structure(assembly, interfaces).limit_load(acceleration=direction)
    assert found.multiplier == pytest.approx(along + 1e4 * area / mechanics.total_weight(assembly), rel=1e-6)


@pytest.mark.filterwarnings("error::RuntimeWarning")
def test_a_stone_that_is_not_convex_is_pulled_off_without_a_warning_of_numpy():
    """Its re-entrant corner has no part of the area: a joint that does not give asked for infinity times that."""
    outlines = [[(0, 0), (3, 0), (3, 1), (1, 1), (1, 3), (0, 3)], [(-1, -1), (4, -1), (4, 4), (-1, 4)]]
    solids = [prism(outline, low, low + 1.0) for outline, low in zip(outlines, (0.0, -1.0), strict=True)]
    assembly = solver.Assembly.from_solids(solids, roles=["free", "fixed"], density=1.0)
    interfaces = solver.Interfaces(solver.InterfaceLaw(tensile_strength=1e3, cohesion=1e3))
    found = solver.Structure(assembly, interfaces).limit_load(acceleration=[0.0, 0.0, 1.0])
    assert 0.8 < (found.multiplier - 1.0) * mechanics.total_weight(assembly) / 5e3 <= 1.0 + 1e-6


@pytest.mark.parametrize("middle", [0.0, -0.05], ids=["straight", "slightly re-entrant"])
def test_a_face_with_a_corner_that_is_none_is_shared_out_whole(middle):
    under = [[0, -1], [2, -1], [2, 0], [1, middle], [0, 0]]
    assembly = solver.Assembly.from_outlines([rectangle(0, 0, 2, 1), under], roles=["free", "fixed"])
    areas = mechanics.find_contacts(assembly, assembly.vertices, 1e-6).areas
    np.testing.assert_allclose(areas, 1.0, rtol=1e-3)


@pytest.mark.parametrize("degrees", range(0, 80, 10))
def test_a_straight_corner_is_no_contact_point_however_it_is_rounded(degrees):
    """It was one at 30 and 60 degrees, which shared out the face in other parts: limit loads were 14 to 39 % lower."""
    angle = np.radians(degrees)
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    stone = np.array([[0.0, 0.0], [0.3, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    outlines = [stone @ turn, rectangle(-1.0, -1.0, 2.0, 0.0) @ turn]
    assembly = solver.Assembly.from_outlines(outlines, roles=["free", "fixed"])
    contacts = mechanics.find_contacts(assembly, assembly.vertices, 1e-6)
    assert contacts.areas == pytest.approx([0.5, 0.5], rel=1e-9)


def test_a_bent_face_is_shared_out_alike_in_any_order():
    """A corner in the bend of the face above it has a contact point on either side of the bend."""
    over, under = [[-1, 0], [0, 0], [2, -0.8], [2, 1], [-1, 1]], [[0, 0], [0, -2], [2, -2], [2, -0.8]]
    areas = []
    for order in ([0, 1], [1, 0]):
        for first in range(4):
            outlines = [over, np.roll(under, first, axis=0)]
            assembly = solver.Assembly.from_outlines([outlines[k] for k in order], roles=["fixed", "free"])
            contacts = mechanics.find_contacts(assembly, assembly.vertices, 1e-6)
            vertical = np.abs(contacts.frames[:, 0, 1])
            areas.append(contacts.areas[np.lexsort((vertical, contacts.points[:, 0].round(6)))])
    # Half the length of the face at either end, seen along the mean of its edges.
    np.testing.assert_allclose(areas[0], np.hypot(2.0, 0.8) / np.array([4, 4, 2]), rtol=0.01)
    np.testing.assert_allclose(areas, [areas[0]] * len(areas), rtol=1e-12)


#: A stone 1 m wide on a bed; the faces beside it part by 10 degrees, 0.4 m long on either side.
PART = 0.4 * np.tan(np.radians(10.0))


def stone_on_a_bed(width, dimension, up, **law):
    """Limit load [100 kN], besides its weight, of what lifts or presses the stone, with or without a bed."""
    x, y = np.array([-0.5, -0.1, 0.1, 0.5]), np.array([PART, 0.0, 0.0, PART])
    if not width:
        x, y = x[[0, 1, 3]], y[[0, 1, 3]]
    outlines = [[*np.column_stack([x, y]), (0.5, 1.0), (-0.5, 1.0)], rectangle(-2.0, -0.5, 2.0, 0.0)]
    assembly = in_either(dimension, outlines, prism, roles=["free", "fixed"])
    live = np.zeros_like(solver.weight_fraction(assembly, np.zeros(dimension)))
    live[0, 1] = 1e5 if up else -1e5
    # Above the corner or the middle of the bed.
    at = [0.0 if width else -0.1, assembly.centroids[0, 1], *assembly.centroids[0, 2:]]
    live = solver.point_load(assembly, 0, live[0, :dimension], point=at)
    return solver.limit_load(
        assembly, loads=solver.Loads(0.0 * live, live), interfaces=solver.Interfaces(solver.InterfaceLaw(0.6, **law))
    ).multiplier


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("width", [0.2, 0.0], ids=["a bed", "an edge"])
def test_joints_have_the_strength_of_what_touches(dimension, width):
    """Faces that part beside a bed of 0.2 m had their halves of it, too, in the plane: 3 times the strength.

    What touches along an edge alone has none.
    """
    glued = stone_on_a_bed(width, dimension, True, cohesion=1e5, tensile_strength=1e5)
    assert glued == pytest.approx(width, rel=1e-6, abs=1e-9)
    assert stone_on_a_bed(width, dimension, False, compressive_strength=1e5) == pytest.approx(width, rel=1e-6, abs=1e-9)


def test_a_hinge_crushes_at_its_half_of_the_face_that_is_drawn():
    """Of a block that has tilted one corner touches: it carries P = σ A / 2."""
    assembly, interfaces, _ = block(compressive_strength=1e5)
    tilt, drawn_at = 0.01, solver.Pose.initial(assembly)
    turn = np.array([[np.cos(tilt), -np.sin(tilt)], [np.sin(tilt), np.cos(tilt)]])
    positions, rotations = drawn_at.positions.copy(), drawn_at.rotations.copy()
    positions[0], rotations[0] = turn @ positions[0], tilt
    # Above the corner, seen from the centroid.
    live = solver.point_load(assembly, 0, (0.0, -1.0), point=assembly.centroids[0] - positions[0])
    turned = solver.Pose(positions, rotations)
    found = solver.limit_load(assembly, loads=solver.Loads(0.0 * live, live), interfaces=interfaces, pose=turned)
    assert found.multiplier == pytest.approx(1e5 * AREA / 2.0, rel=1e-6)


def test_a_strong_joint_is_a_dry_joint():
    wall = generators.build("wall", {"bricks": 4, "courses": 5})
    live = solver.weight_fraction(wall, (1.0, 0.0), np.flatnonzero(wall.free))

    def multiplier(*law):
        return limit(wall, solver.Interfaces(solver.InterfaceLaw(*law)), live).multiplier

    # It rocks with much friction and slides with little.
    rocking, sliding = multiplier(5.0), multiplier(0.3)
    assert multiplier(5.0, 0.0, 1e7) == pytest.approx(rocking, rel=1e-6)
    assert multiplier(5.0, 0.0, 3e4) < 0.95 * rocking
    assert multiplier(0.3, 1e3) > 1.05 * sliding


CASE = """
[geometry]
layout = "column"
[geometry.parameters]
blocks = 1
width = 0.8
block_height = 0.5
[material]
friction_coefficient = 0.3
cohesion = 2000.0
{}
[analysis]
kind = "limit load"
[[loads]]
kind = "live"
force = [1000.0, 0.0]
point = [0.0, 0.0]
[output]
animation = false
"""


@pytest.mark.slow
def test_strength_from_the_case_file(tmp_path, capsys):
    path = tmp_path / "case.toml"
    path.write_text(CASE.format(""), encoding="utf-8")
    assert run_command(path, "-o", tmp_path / "out") == 0
    weight = 0.8 * 0.5 * 2000.0 * solver.GRAVITY
    assert f"{(0.3 * weight + 2000.0 * 0.8) / 1000.0:12.6g}" in capsys.readouterr().out
    for text, words in (
        (
            CASE.format("compressive_strength = 1e6\n").replace('"limit load"', '"settlement"')
            + "[settlement]\ndirection = [0, -1]\n",
            "crushing along the path of a settlement is not followed",
        ),
        (CASE.format("tensile_strength = 1e5"), "[material] tensile_strength is 100000 Pa, above cohesion / friction"),
        (CASE.format("normal_stiffness = -1.0"), "[material] normal_stiffness is -1; give a number above 0"),
        (CASE.format("compressive_strength = 0.0"), "[material] compressive_strength is 0; give a number above 0"),
        (CASE.format("").replace("2000.0", "-1.0"), "[material] cohesion is -1; give a stress in Pa of at least 0"),
    ):
        with pytest.raises(ValueError, match=re.escape(words)):
            case_from(text, path.parent)


def test_what_follows_the_geometry_refuses_strength():
    assembly, interfaces, _ = block(compressive_strength=1e6)
    moving = assembly.with_roles(["free", "moving"])
    with pytest.raises(ValueError, match="crushing along the path of a settlement is not followed"):
        solver.settle(moving, solver.Settlement(direction=(0, -1)), interfaces=interfaces)
    live = solver.weight_fraction(assembly, (1.0, 0.0), np.array([0]))
    loads = solver.Loads(solver.self_weight(assembly).dead, live)
    with pytest.raises(ValueError, match="crushing along the path of a pushover is not followed"):
        solver.pushover(assembly, solver.ControlDisplacement("block"), loads=loads, interfaces=interfaces)
    with pytest.raises(ValueError, match="cohesion is -1 Pa"):
        solver.InterfaceLaw(cohesion=-1.0)
    with pytest.raises(ValueError, match="compressive_strength is 0 Pa; it must be positive"):
        solver.InterfaceLaw(compressive_strength=0.0)


GROUND = """
[geometry]
file = "beam.json"
[[supports]]
name = "left"
outline = [[-1.05, -0.3], [-0.95, -0.3], [-0.95, 0.0], [-1.05, 0.0]]
stiffness = 2e6
[[supports]]
name = "right"
role = "moving"
outline = [[0.95, -0.3], [1.05, -0.3], [1.05, 0.0], [0.95, 0.0]]
stiffness = 2e6
[settlement]
direction = [0.0, -1.0]
increment = 0.01
limit = 0.01
[output]
animation = false
"""


GLUED = """
[geometry]
file = "pair.json"
[settlement]
rotation_centre = [1.0, 0.0]
rotation = -1
increment = 0.3
limit = 1.0
[material]
friction_coefficient = 2.0
[[interfaces]]
materials = ["s", "s"]
friction_coefficient = 0.6
cohesion = 2e6
tensile_strength = 1e6
[output]
animation = false
"""


@pytest.mark.slow
def test_a_run_says_that_its_fall_leaves_mortar_out(tmp_path, capsys):
    shapes = [rectangle(0, 0, 1, 0.5), rectangle(1, 0, 1.6, 0.5), rectangle(-3, -0.5, 1, 0)]
    roles, materials = ["free", "free", "moving"], ["s", "s", "rock"]
    drawn(tmp_path / "pair.json", shapes, names=["inner", "outer", "ledge"], role=roles, material=materials)
    (tmp_path / "case.toml").write_text(GLUED, encoding="utf-8")
    assert run_command(tmp_path / "case.toml", "-o", tmp_path / "out", drawn=True) == 0
    assert "note: the fall leaves mortar out" in capsys.readouterr().err


@pytest.mark.slow
def test_the_summary_tells_what_the_ground_carries(tmp_path, capsys):
    """A beam on two footings: half of its weight on each, and the tilt of their settlement."""
    drawn(tmp_path / "beam.json", [rectangle(-1.2, 0.0, 1.2, 0.4)], names=["beam"])
    (tmp_path / "case.toml").write_text(GROUND, encoding="utf-8")
    assert run_command(tmp_path / "case.toml", "-o", tmp_path / "out") == 0
    said = re.findall(
        r"ground '(\w+)': (\S+) N, pressure (\S+) Pa in the mean .* turned by (\S+) rad", capsys.readouterr().out
    )
    assert [name for name, *_ in said] == ["left", "right"]
    for _, force, pressure, tilt in said:
        assert float(force) == pytest.approx(2.4 * 0.4 * 2000.0 * solver.GRAVITY / 2.0, rel=1e-2)
        assert float(pressure) == pytest.approx(float(force) / 0.1, rel=1e-3)
        assert float(tilt) == pytest.approx(0.005, rel=0.03)


@pytest.mark.thorough
def test_the_corner_that_slid_over_the_joint_of_two_grounds_has_the_area_of_its_brick(tmp_path, capsys):
    """Its force is shared by two points, of which one has an area of some mm²."""
    bricks = [rectangle(-1.0, 0.0, 0.0, 0.5), rectangle(0.0, 0.0, 1.0, 0.5), rectangle(-1.0, 0.5, 1.0, 1.0)]
    drawn(tmp_path / "beam.json", bricks, names=["one", "other", "beam"])
    text = GROUND.replace("2e6", "1e6").replace("-1.05, ", "-1.2, ").replace("-0.95, ", "0.0, ")
    text = text.replace("[0.95, ", "[0.0, ").replace("[1.05, ", "[1.2, ")
    (tmp_path / "case.toml").write_text(text, encoding="utf-8")
    assert run_command(tmp_path / "case.toml", "-o", tmp_path / "out") == 0
    said = re.findall(
        r": (\S+) N, pressure \S+ Pa in the mean and (\S+) Pa at most.* by (\S+) rad", capsys.readouterr().out
    )
    assert len(said) == 2
    for force, most, tilt in said:
        # On 1 m², and at the lower end of a brick of 1 m that has turned.
        assert float(most) == pytest.approx(float(force) + 1e6 * float(tilt) / 2.0, rel=5e-3)


def test_ground_gives_under_the_support_of_its_name_alone():
    """One that is numbered beside it is rigid, pieces into which a support was cut are not."""
    outlines = [rectangle(-1.0, -1.0, 0.5, 0.0), rectangle(0.5, -1.0, 2.0, 0.0), rectangle(0.0, 0.0, 1.0, 1.0)]
    roles = ["fixed", "fixed", "free"]
    beside = solver.Assembly.from_outlines(outlines, names=["ground", "ground 2", "ground 3"], roles=roles)
    pieces = solver.Assembly.from_outlines(outlines, names=["ground 1", "ground 2", "ground 3"], roles=roles)
    soft = solver.Interfaces(ground={"ground": 1e5})
    assert np.nan_to_num(soft.ground_stiffness(beside)).tolist() == [1e5, 0.0, 0.0]
    assert np.nan_to_num(soft.ground_stiffness(pieces)).tolist() == [1e5, 1e5, 0.0]
