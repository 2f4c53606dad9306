"""Equilibrium of blocks in space against closed forms of elementary statics.

Limit loads, reactions and whether a structure stands: of a prism on a tilted plane, a tetrahedron, a prism in a groove,
a bar on two edges, a cube that is turned, a plug between faces and a stack with the largest overhang.
"""

from dataclasses import replace

import numpy as np
import pytest
from structures import box, prism, upright

import solver
from blockvis import generators
from solver import mechanics

EXACT = 1e-6


def along_x(outline, low, high):
    """Extrude an outline in y and z from x = low to x = high."""
    corners, faces = prism(outline, low, high)
    return corners[:, [2, 0, 1]], faces


def on_ground(solids, extent=5.0):
    ground = box((-extent, -extent, -1.0), (extent, extent, 0.0))
    return solver.Assembly.from_solids([*solids, ground], roles=["free"] * len(solids) + ["fixed"])


def limit(assembly, live, friction, flow="associative", **options):
    """The limit load, proved by its certificate."""
    loads = solver.Loads(solver.self_weight(assembly).dead, live)
    found = solver.limit_load(assembly, loads=loads, friction_coefficient=friction, flow=flow, **options)
    assert found.certificate.equilibrium_residual < 1e-8
    assert found.certificate.friction_excess < 1e-8
    assert found.certificate.kinematic_violation < 1e-8
    assert found.gap < 1e-8
    return found


def push(assembly, azimuth):
    """A force on block 0 as large as its weight, horizontal, at its centroid."""
    a = np.radians(azimuth)
    return solver.weight_fraction(assembly, (np.cos(a), np.sin(a), 0.0), np.array([0]))


def at_rest(assembly, friction, rates):
    """The increment before the supports move at these rates, under the self-weight."""
    moves = solver.Settlement(profile={assembly.names[k]: rates[k] for k in np.flatnonzero(assembly.moving)})
    law, loads = solver.Interfaces(solver.InterfaceLaw(friction)), solver.self_weight(assembly)
    return next(mechanics.settlement_increments(assembly, [moves], interfaces=law, loads=loads))


def stands(assembly, friction, turned_by=0.0, azimuth=0.0):
    """Whether equilibrium exists under the self-weight, on ground that is tilted."""
    a = np.radians(azimuth)
    down = np.array([np.sin(turned_by) * np.cos(a), np.sin(turned_by) * np.sin(a), -np.cos(turned_by)])
    loads = solver.Loads(solver.weight_fraction(assembly, down), push(assembly, azimuth))
    found = solver.limit_load(assembly, loads=loads, friction_coefficient=friction)
    return found.status not in (solver.LimitStatus.HELD, solver.LimitStatus.NO_EQUILIBRIUM)


PRISM = [[-0.5, -0.3], [0.5, -0.3], [0.5, 0.3], [-0.5, 0.3]]


@pytest.mark.parametrize(
    ("azimuth", "topples", "flow"),
    [
        (0.0, 0.463648, "associative"),
        (20.0, 0.488988, "associative"),
        (45.0, 0.401247, "associative"),
        (45.0, 0.401247, "non-associative"),
    ],
)
def test_a_prism_on_a_tilted_plane(azimuth, topples, flow):
    """1 × 0.6 × 2: about an edge of its base where friction holds it, else down the plane at any azimuth."""
    assembly = on_ground([prism(PRISM, 0.0, 2.0)])
    a = np.radians(azimuth)
    exact = min(0.5 / abs(np.cos(a)), 0.3 / max(abs(np.sin(a)), 1e-9))
    assert np.arctan(exact) == pytest.approx(topples, abs=1e-6)
    assert limit(assembly, push(assembly, azimuth), 0.9, flow).multiplier == pytest.approx(exact, rel=EXACT)
    assert limit(assembly, push(assembly, azimuth), 0.2, flow).multiplier == pytest.approx(0.2, rel=EXACT)


@pytest.mark.parametrize("azimuth", [0.0, 20.0, 45.0])
@pytest.mark.parametrize("friction", [0.9, 0.2])
def test_a_prism_stands_up_to_its_angle_and_not_beyond(azimuth, friction):
    assembly = on_ground([prism(PRISM, 0.0, 2.0)])
    a = np.radians(azimuth)
    angle = np.arctan(min(0.5 / np.cos(a), 0.3 / max(np.sin(a), 1e-9), friction))
    assert stands(assembly, friction, turned_by=angle * (1.0 - EXACT), azimuth=azimuth)
    assert not stands(assembly, friction, turned_by=angle * (1.0 + EXACT), azimuth=azimuth)


@pytest.mark.parametrize(("azimuth", "exact"), [(0.0, 1.414214), (20.0, 1.504975)])
def test_a_regular_tetrahedron_turns_about_an_edge(azimuth, exact):
    """The inscribed radius of the base over the height of the centroid, √2, over the cosine to the edge's normal."""
    corners = np.array([[np.cos(t), np.sin(t), 0.0] for t in np.radians([60.0, 180.0, 300.0])]) / np.sqrt(3.0)
    corners = np.vstack([corners, [0.0, 0.0, np.sqrt(2.0 / 3.0)]])
    assembly = on_ground([(corners, [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])])
    assert np.sqrt(2.0) / np.cos(np.radians(azimuth)) == pytest.approx(exact, abs=1e-6)
    found = limit(assembly, push(assembly, azimuth), 5.0)
    assert found.multiplier == pytest.approx(np.sqrt(2.0) / np.cos(np.radians(azimuth)), rel=EXACT)


def groove(half_angle):
    """A triangular prism, edge down, in a groove of its own angle; along x."""
    width = np.tan(half_angle)
    wedge = [[width, 1.0], [-width, 1.0], [0.0, 0.0]]
    right = [[0.0, -1.0], [width, -1.0], [width, 1.0], [0.0, 0.0]]
    left = [[0.0, 0.0], [-width, 1.0], [-width, -1.0], [0.0, -1.0]]
    solids = [along_x(wedge, -3.0, 3.0), along_x(right, -4.0, 4.0), along_x(left, -4.0, 4.0)]
    return solver.Assembly.from_solids(solids, roles=["free", "fixed", "fixed"])


@pytest.mark.parametrize(
    ("half_angle", "friction"),
    [
        (45.0, 0.5),
        pytest.param(30.0, 0.3, marks=pytest.mark.thorough),
        pytest.param(60.0, 0.4, marks=pytest.mark.thorough),
    ],
)
def test_a_prism_pushed_along_a_groove(half_angle, friction):
    """Without lift it slides at μ / sin β; associative friction lifts it, and carries more."""
    beta = np.radians(half_angle)
    assembly = groove(beta)
    lifting = friction / (np.sin(beta) * np.sqrt(1.0 - (friction / np.tan(beta)) ** 2))
    found = limit(assembly, push(assembly, 0.0), friction)
    assert found.multiplier == pytest.approx(lifting, rel=EXACT)
    assert "grooves and wedges" in found.caveat
    assert found.caveat in str(found)
    sliding = limit(assembly, push(assembly, 0.0), friction, "non-associative")
    assert sliding.status is solver.LimitStatus.FOUND
    assert sliding.multiplier == pytest.approx(friction / np.sin(beta), rel=EXACT)
    assert sliding.caveat == ""
    # It does not lift.
    np.testing.assert_allclose(sliding.mechanism[0], [1.0, 0.0, 0.0, 0.0, 0.0, 0.0], atol=1e-5)


def test_a_turned_cube():
    """Its corners have the friction: μ N a / √2."""
    assembly = on_ground([box((-0.5, -0.5, 0.0), (0.5, 0.5, 1.0))])
    live = np.zeros((2, 6))
    live[0, 5] = assembly.masses[0] * solver.GRAVITY
    assert limit(assembly, live, 0.5).multiplier == pytest.approx(0.353553390593, rel=EXACT)


@pytest.mark.parametrize("friction", [0.1, 0.7])
def test_a_bar_across_two_bars_slides_on_their_edges(friction):
    """Edge on edge, pushed along its own edge and there: at μ."""
    upper = along_x([[0.0, 0.0], [0.3, 0.5], [-0.3, 0.5]], -2.0, 2.0)
    edges = [[[-0.3 + x, -0.5], [0.3 + x, -0.5], [x, 0.0]] for x in (-1.2, 1.0)]
    lower = [upright(edge, -1.0, 1.0) for edge in edges]
    assembly = solver.Assembly.from_solids([upper, *lower], roles=["free", "fixed", "fixed"])
    weight = assembly.masses[0] * solver.GRAVITY
    live = solver.point_load(assembly, 0, (weight, 0.0, 0.0), point=(0.0, 0.0, 0.0))
    assert limit(assembly, live, friction).multiplier == pytest.approx(friction, rel=EXACT)


@pytest.mark.parametrize("count", [3, 6])
def test_a_plug_between_faces_that_give_way(count):
    """A pyramid, tip down, between supports that move out: their reaction at the least, W / tan(β + φ)."""
    beta, friction = np.radians(20.0), 0.3
    low, high = 0.5, 0.5 + np.tan(beta)
    angles = 2.0 * np.pi * np.arange(count) / count
    ring = np.stack([np.cos(angles), np.sin(angles)], axis=1) / np.cos(np.pi / count)

    def frustum(inner, outer, z0, z1):
        corners = np.concatenate([np.c_[inner, np.full(len(inner), z0)], np.c_[outer, np.full(len(outer), z1)]])
        return corners, prism(inner, z0, z1)[1]

    solids, out = [frustum(low * ring, high * ring, 0.0, 1.0)], np.zeros((count + 1, 6))
    for k in range(count):
        sides = ring[[k, (k + 1) % count]]
        # Quadrilaterals from the plug's face outwards.
        at = [np.array([r * sides[0], 2.0 * sides[0], 2.0 * sides[1], r * sides[1]]) for r in (low, high)]
        solids.append(frustum(at[0], at[1], 0.0, 1.0))
        out[k + 1, :2] = sides.mean(axis=0) / np.linalg.norm(sides.mean(axis=0))
    assembly = solver.Assembly.from_solids(solids, roles=["free"] + ["moving"] * count)
    found = at_rest(assembly, friction, out)
    weight = assembly.masses[0] * solver.GRAVITY
    assert found.status is solver.Status.EQUILIBRIUM
    assert 1.0 / np.tan(beta + np.arctan(friction)) == pytest.approx(1.3416399, abs=1e-7)
    assert found.least / weight == pytest.approx(1.3416399, rel=EXACT)


@pytest.mark.parametrize("overhang", [0.999, 1.001])
def test_a_harmonic_stack_of_eight_along_the_diagonal(overhang):
    """Each block as far out over the one below as those above it allow: 1 / 2k of its side, along x and along y."""
    solids, at = [], 0.0
    for level in range(8):
        solids.append(box((at, at, 0.2 * level), (at + 1.0, at + 1.0, 0.2 * (level + 1))))
        at += overhang / (2.0 * (7 - level)) if level < 7 else 0.0
    assembly = on_ground(solids)
    assert stands(assembly, 0.6) is (overhang < 1.0)


TURNED = (np.sqrt(2.0) + np.arcsinh(1.0)) / 6.0


@pytest.mark.parametrize("flow", ["associative", "non-associative"])
def test_a_turned_cube_under_a_uniform_pressure(flow):
    """μ N a (√2 + asinh 1) / 6, a little more than half of what its corners resist; says which law was used."""
    assembly = on_ground([box((-0.5, -0.5, 0.0), (0.5, 0.5, 1.0))])
    live = np.zeros((2, 6))
    live[0, 5] = assembly.masses[0] * solver.GRAVITY
    found = limit(assembly, live, 0.5, flow, torsion="uniform")
    assert pytest.approx(0.191299, abs=1e-6) == 0.5 * TURNED
    assert found.multiplier == pytest.approx(0.5 * TURNED, rel=EXACT)
    assert found.torsion == "uniform"
    assert "uniform torsion" in str(found)
    # The forces at the points are those of the face, and each within friction.
    on_block = mechanics.block_forces(found.contacts, found.pose, found.forces)[0]
    np.testing.assert_allclose(
        on_block, np.array([0, 0, 1, 0, 0, -found.multiplier]) * live[0, 5], atol=1e-6 * live[0, 5]
    )


@pytest.mark.parametrize("eccentricity", [0.0, 0.2, 1.0])
def test_a_cube_pushed_beside_its_middle_under_a_uniform_pressure(eccentricity):
    """Shear and torsion together: α √(1 + (e / r)²) = μ."""
    assembly = on_ground([box((-0.5, -0.5, 0.0), (0.5, 0.5, 1.0))])
    weight = assembly.masses[0] * solver.GRAVITY
    live = solver.point_load(assembly, 0, (weight, 0.0, 0.0), point=(0.0, eccentricity, 0.0))
    found = limit(assembly, live, 0.4, torsion="uniform")
    assert found.multiplier == pytest.approx(0.4 / np.hypot(1.0, eccentricity / TURNED), rel=EXACT)


@pytest.mark.parametrize("flow", ["associative", "non-associative"])
def test_cohesion_adds_to_the_torsion_of_a_uniform_pressure(flow):
    assembly = on_ground([box((-0.5, -0.5, 0.0), (0.5, 0.5, 1.0))])
    weight = assembly.masses[0] * solver.GRAVITY
    loads = replace(solver.self_weight(assembly), live=np.eye(6)[[5, 5]] * [[weight], [0.0]])
    law = solver.InterfaceLaw(
        0.5, cohesion=0.3 * weight, tensile_strength=0.2 * weight, compressive_strength=3 * weight
    )
    found = solver.limit_load(assembly, loads=loads, interfaces=solver.Interfaces(law), torsion="uniform", flow=flow)
    assert found.multiplier == pytest.approx(0.8 * TURNED, rel=EXACT)
    assert found.certificate.kinematic_violation < EXACT


@pytest.mark.parametrize(
    ("eccentricity", "height", "least"),
    [
        (0.25, 0.5, 0.6 / np.hypot(1.0, 0.25 / TURNED)),
        (0.25, 1.0, None),
        pytest.param(0.5, 1.5, None, marks=pytest.mark.thorough),
        pytest.param(0.0, 2.0, 0.25, marks=pytest.mark.thorough),
    ],
)
def test_where_a_block_stands_on_an_edge_a_uniform_pressure_carries_no_more_than_its_points(
    eccentricity, height, least
):
    """Twice as high as wide: the face is not pressed all over, and its points limit what the whole of it would carry.

    Where it is pressed all over α √(1 + (e / r)²) = μ, and it overturns without torsion at 1 / 2 z.
    """
    assembly = on_ground([box((-0.5, -0.5, 0.0), (0.5, 0.5, 2.0))])
    weight = assembly.masses[0] * solver.GRAVITY
    live = solver.point_load(assembly, 0, (weight, 0.0, 0.0), point=(0.0, eccentricity, height))
    points, uniform = (limit(assembly, live, 0.6, torsion=torsion) for torsion in ("points", "uniform"))
    assert uniform.multiplier == pytest.approx(points.multiplier if least is None else least, rel=EXACT)
    sliding = limit(assembly, live, 0.6, "non-associative", torsion="uniform").multiplier
    assert sliding <= uniform.multiplier * (1.0 + EXACT) <= points.multiplier * (1.0 + 2.0 * EXACT)


def test_a_turned_triangle_and_a_turned_plate():
    """Far from the origin of the drawing: μ N times the mean distance from the centroid, here by integration."""
    outlines = [
        np.array([[np.cos(t), np.sin(t)] for t in np.radians([90.0, 210.0, 330.0])]),
        np.array([[-1.5, -0.25], [1.5, -0.25], [1.5, 0.25], [-1.5, 0.25]]),
    ]
    for outline in outlines:
        assembly = on_ground([prism((outline + np.array([0.7, 0.3])).tolist(), 0.0, 0.5)])
        live = np.zeros((2, 6))
        live[0, 5] = assembly.masses[0] * solver.GRAVITY
        found = limit(assembly, live, 0.5, torsion="uniform")
        assert found.multiplier == pytest.approx(0.5 * mean_distance(outline), rel=1e-5)


def mean_distance(outline, cells=400):
    """Mean distance of a polygon's points from the origin, its centroid, from the middles of many small triangles."""
    total = area = 0.0
    s = (np.arange(cells) + 0.5) / cells
    for a, b in zip(outline, np.roll(outline, -1, axis=0), strict=True):
        across = a + s[:, None] * (b - a)
        # Along a ray the mean of r with weight r is two thirds of its length.
        part = abs(a[0] * b[1] - a[1] * b[0]) / 2.0
        total += part * 2.0 / 3.0 * np.linalg.norm(across, axis=1).mean()
        area += part
    return total / area


@pytest.mark.parametrize("flow", ["associative", "non-associative"])
def test_cohesion_and_crushing_of_a_face(flow):
    """Pushed at its base it slides at μ + c A / W; overturns with a toe that crushes at b / h (σ A / W - 1)."""
    assembly = on_ground([prism(PRISM, 0.0, 2.0)])
    weight, area = assembly.masses[0] * solver.GRAVITY, 0.6
    dead = solver.self_weight(assembly).dead
    at_base = solver.point_load(assembly, 0, (0.6 * weight, 0.8 * weight, 0.0), point=(0.0, 0.0, 0.0))
    sticky = solver.Interfaces(solver.InterfaceLaw(0.3, cohesion=0.2 * weight / area))
    found = solver.limit_load(assembly, loads=solver.Loads(dead, at_base), interfaces=sticky, flow=flow)
    assert found.multiplier == pytest.approx(0.5, rel=EXACT)
    brittle = solver.Interfaces(solver.InterfaceLaw(2.0, compressive_strength=1.5 * weight / area))
    found = solver.limit_load(assembly, loads=solver.Loads(dead, push(assembly, 0.0)), interfaces=brittle, flow=flow)
    assert found.multiplier == pytest.approx(0.5 * (1.5 - 1.0), rel=EXACT)


@pytest.mark.parametrize(
    "stone",
    [
        prism([(0, 0), (2, 0), (2, 0.4), (0.4, 0.4), (0.4, 2), (0, 2)]),
        upright([(-1, 0), (-0.8, 0), (-0.8, 0.8), (0.8, 0.8), (0.8, 0), (1, 0), (1, 1), (-1, 1)], -0.25, 0.25),
    ],
    ids=["L", "on two legs"],
)
def test_torsion_of_a_face_that_is_not_convex_is_refused(stone):
    """Its corners do not tell what touches: their hull had 0.66 for 0.78, and 0.53 for 0.91, of μ W."""
    assembly = solver.Assembly.from_solids([box((-3, -3, -1), (3, 3, 0)), stone], roles=["fixed", "free"])
    loads = replace(solver.self_weight(assembly), live=np.eye(6)[[0, 5]] * [[0.0], [1.0]])
    with pytest.raises(ValueError, match="'block 1' and 'block 0' do not touch on all of a convex face"):
        solver.limit_load(assembly, loads=loads, torsion="uniform")


@pytest.mark.parametrize("corners", [4, pytest.param(32, marks=pytest.mark.thorough), 128])
def test_how_many_corners_a_support_has_changes_nothing_at_rest(corners):
    """A beam on three supports of one area, in the middle a drum: each carries a third."""

    def support(at, n):
        radius, around = np.sqrt(0.5 / (n * np.sin(2.0 * np.pi / n))), 2.0 * np.pi * (np.arange(n) + 0.5) / n
        return prism(np.column_stack([at + radius * np.cos(around), radius * np.sin(around)]), -1.0, 0.0)

    solids = [support(-2.0, 4), support(0.0, corners), support(2.0, 4), box((-2.6, -0.6, 0.0), (2.6, 0.6, 0.5))]
    assembly = solver.Assembly.from_solids(solids, roles=["fixed", "moving", "fixed", "free"])
    sinks = solver.Settlement(direction=(0.0, 0.0, -1.0), increment=1e-4, limit=1e-4)
    first = solver.Structure(assembly, friction_coefficient=0.6).settle(sinks).increments[0]
    carried = -first.support_forces[:3, 2] / mechanics.total_weight(assembly)
    np.testing.assert_allclose(carried, 1.0 / 3.0, rtol=1e-3)


@pytest.mark.thorough
def test_a_drum_carries_a_quarter_on_each_of_four_pads_wherever_outlines_begin():
    """An octagon, of whose middle course the stones lie around its corners and are not convex."""
    angles, reach = np.arange(16) * np.pi / 8, np.tile([1.0, np.cos(np.pi / 8)], 8)
    inner, outer = (r * np.column_stack([reach * np.cos(angles), reach * np.sin(angles)]) for r in (1.2, 1.5))

    def course(level, first, through):
        around = [(2 * k + first + np.array(through)) % 16 for k in range(8)]
        rings = [np.concatenate([inner[k[::-1]], outer[k]]) for k in around]
        return [prism(np.roll(ring, 4 * (k > 4), axis=0), level, level + 0.4) for k, ring in enumerate(rings)]

    pads = [box((x, y, -0.5), (x + 2, y + 2, 0.0)) for x in (-2, 0) for y in (-2, 0)]
    solids = [*course(0.0, 0, (0, 2)), *course(0.4, 1, (0, 1, 2)), *course(0.8, 0, (0, 2)), *pads]
    assembly = solver.Assembly.from_solids(solids, roles=[*["free"] * 24, "moving", *["fixed"] * 3])
    assert len(assembly.shapes.parts.block_of_part) == 36
    sinks = solver.Settlement(direction=(0.0, 0.0, -1.0), increment=1e-6, limit=1e-6)
    first = solver.Structure(assembly, friction_coefficient=0.6).settle(sinks).increments[0]
    np.testing.assert_allclose(-first.support_forces[-4:, 2] / mechanics.total_weight(assembly), 0.25, rtol=EXACT)


def test_torsion_of_faces_is_for_blocks_in_space():
    assembly = on_ground([box((-0.5, -0.5, 0.0), (0.5, 0.5, 1.0))])
    loads = solver.Loads(solver.self_weight(assembly).dead, push(assembly, 0.0))
    with pytest.raises(ValueError, match="torsion is 'exact'; it is 'points' or 'uniform'"):
        solver.limit_load(assembly, loads=loads, torsion="exact")
    square = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]
    flat = solver.Assembly.from_outlines([square])
    with pytest.raises(ValueError, match="blocks in the plane have none"):
        solver.limit_load(flat, loads=solver.Loads(np.zeros((1, 3)), np.ones((1, 3))), torsion="uniform")


@pytest.mark.slow
def test_a_prism_pushed_over():
    """0.2 × 0.3 × 1, geometry updated: α = tan(atan 0.2 - asin d) at the displacement d of its top above the edge."""
    assembly = on_ground([box((0.0, 0.0, 0.0), (0.2, 0.3, 1.0))])
    loads = solver.Loads(solver.self_weight(assembly).dead, push(assembly, 0.0))
    control = solver.ControlDisplacement(
        "block 0", (1.0, 0.0, 0.0), point=(0.2, 0.15, 1.0), increment=0.08, limit=0.3, tolerance=1e-3
    )
    response = solver.pushover(assembly, control, loads=loads, friction_coefficient=0.7)
    assert response.stop is solver.Status.COLLAPSED
    multiplier = np.array([increment.load_multiplier for increment in response.path])
    assert multiplier == pytest.approx(np.tan(np.arctan(0.2) - np.arcsin(response.settlement)), abs=EXACT)
    assert response.collapse.displacement == pytest.approx(np.sin(np.arctan(0.2)), abs=1e-3)


@pytest.mark.slow
def test_a_cube_pushed_along_its_diagonal_slides_and_does_not_lift():
    assembly = on_ground([box((0.0, 0.0, 0.0), (0.5, 0.5, 0.4))])
    loads = solver.Loads(solver.self_weight(assembly).dead, push(assembly, 45.0))
    control = solver.ControlDisplacement("block 0", (1.0, 1.0, 0.0), increment=0.1, limit=0.2)
    response = solver.pushover(assembly, control, loads=loads, friction_coefficient=0.3)
    assert response.stop is solver.Status.LIMIT_REACHED
    assert [increment.load_multiplier for increment in response.path] == pytest.approx(
        [0.3] * len(response.path), abs=EXACT
    )
    last = response.path[-1].pose.displacements(assembly)[0]
    assert last == pytest.approx([0.2 / np.sqrt(2.0), 0.2 / np.sqrt(2.0), 0.0, 0.0, 0.0, 0.0], abs=1e-7)


def test_what_a_limit_load_in_space_can_be():
    """Pressed onto the ground without limit; leaning over and held by its live load; leaning, and not held."""
    assembly = on_ground([prism(PRISM, 0.0, 2.0)])
    dead, weight = solver.self_weight(assembly).dead, assembly.masses[0] * solver.GRAVITY
    down = solver.weight_fraction(assembly, (0.0, 0.1, -1.0), np.array([0]))
    found = solver.limit_load(assembly, loads=solver.Loads(dead, down))
    assert found.status is solver.LimitStatus.UNBOUNDED
    assert found.multiplier == np.inf
    leaning = dead + solver.point_load(assembly, 0, moment=(0.0, 0.6 * weight, 0.0))
    back = solver.point_load(assembly, 0, moment=(0.0, -weight, 0.0))
    found = solver.limit_load(assembly, loads=solver.Loads(leaning, back), friction_coefficient=0.5)
    assert found.status is solver.LimitStatus.HELD
    assert found.multiplier == pytest.approx(1.1, rel=EXACT)
    found = solver.limit_load(assembly, loads=solver.Loads(leaning, push(assembly, 90.0)), friction_coefficient=0.5)
    assert found.status is solver.LimitStatus.NO_EQUILIBRIUM
    # It turns over the edge in its way, which is along y.
    assert found.mechanism[0, 4] > 0.5 * np.abs(found.mechanism[0]).max()


def test_blocks_between_a_support_that_presses_and_one_that_does_not_give_way():
    """Friction and the thrust of a flat arch bound the reaction from below; from above nothing does."""
    for count in (1, 10):
        row = [box((k, 0.0, 0.0), (k + 1.0, 1.0, 1.0)) for k in range(count)]
        sides = [box((-1.0, -1.0, -1.0), (0.0, 2.0, 2.0)), box((count, -1.0, -1.0), (count + 1.0, 2.0, 2.0))]
        roles = ["free"] * count + ["fixed", "moving"]
        assembly = solver.Assembly.from_solids([*row, *sides], roles=roles)
        presses = np.zeros((count + 2, 6))
        presses[-1, 0] = -1.0
        found = at_rest(assembly, 0.6, presses)
        weight = count * assembly.masses[0] * solver.GRAVITY
        assert found.status is solver.Status.EQUILIBRIUM
        # Friction at both ends takes W = 2 μ R; a flat arch of n cubes thrusts with W n / 8.
        assert -found.largest == pytest.approx(max(weight / 1.2, weight * count / 8.0), rel=EXACT)
        assert found.least == -np.inf


def test_the_thrust_of_a_dome_whose_springers_begin_to_move_out():
    """A cap of 15° on 8 lunes of 6 stones, t / R 0.12: H / W = 0.1661226, from the statics of a lune."""
    stones = generators.dome(lunes=8, courses=6, thickness_ratio=0.12, cap=15.0)
    out = np.zeros((stones.n_blocks, 6))
    out[stones.moving, :2] = stones.centroids[stones.moving, :2]
    out[stones.moving] /= np.linalg.norm(out[stones.moving], axis=1)[:, None]
    weight = stones.masses[stones.free].sum() * solver.GRAVITY
    assert at_rest(stones, 0.7, out).least / weight == pytest.approx(0.1661226, rel=EXACT)


@pytest.mark.parametrize("bend", [-0.75, 0.75])
@pytest.mark.parametrize("first", [0, 2, *(pytest.param(k, marks=pytest.mark.thorough) for k in (1, 3, 4))])
def test_a_bed_that_bends_by_less_than_a_degree_bears_on_both_faces(bend, first):
    rise = np.tan(np.radians(bend))
    bed = np.roll([(-1.0, -1.0), (1.0, -1.0), (1.0, 0.0), (0.0, 0.0), (-1.0, rise)], first, axis=0)
    stone = np.roll([(-1.0, rise), (0.0, 0.0), (1.0, 0.0), (1.0, 0.5), (-1.0, 0.5)], first, axis=0)
    plane = solver.Assembly.from_outlines([stone, bed], roles=["free", "fixed"])
    space = solver.Assembly.from_solids([upright(stone, 0.0, 1.0), upright(bed, 0.0, 1.0)], roles=["free", "fixed"])
    live = solver.weight_fraction(plane, (1.0, 0.0), np.array([0]))
    multiplier = limit(plane, live, 0.1).multiplier
    assert limit(space, push(space, 0.0), 0.1).multiplier == pytest.approx(multiplier, rel=EXACT)
    if rise > 0.0:
        assert multiplier == pytest.approx(0.1, rel=EXACT)


@pytest.mark.parametrize("ends", [(0.0, 1.0), (0.2, 0.8), (-0.2, 1.2), (-0.2, 0.5)])
def test_a_slab_on_a_slope_is_held_by_the_ledge_at_its_foot(ends):
    """Of one block, cut where they meet; the foot is as long as the ledge, shorter or longer, as in the plane."""
    c, s = np.cos(np.radians(40.0)), np.sin(np.radians(40.0))
    base = [(-1.0, 0.0), (2.0 * c, 0.0), (2.0 * c, 1.0 + 2.0 * s), (0.0, 1.0), (-1.0, 1.0)]
    slab = [
        (0.0, 1.0),
        (1.5 * c, 1.0 + 1.5 * s),
        (1.5 * c - 0.3 * s, 1.0 + 1.5 * s + 0.3 * c),
        (-0.3 * s, 1.0 + 0.3 * c),
    ]
    plane = solver.Assembly.from_outlines([base, slab], roles=["fixed", "free"])
    solids = [upright(base, 0.0, 1.0), upright(slab, *ends)]
    space = solver.Assembly.from_solids(solids, roles=["fixed", "free"])
    for sense in (1.0, -1.0):
        expected = solver.Structure(plane, friction_coefficient=0.3).limit_load(acceleration=(sense, 0.0))
        found = solver.Structure(space, friction_coefficient=0.3).limit_load(acceleration=(sense, 0.0, 0.0))
        assert found.multiplier == pytest.approx(expected.multiplier, rel=1e-6)
