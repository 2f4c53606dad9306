"""Layouts: dimensions, no overlaps, no gaps, and that they stand."""

import math
from itertools import pairwise

import numpy as np
import pytest
import shapely
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from structures import small_layout

import solver
from blockvis import generators

#: Layouts in the plane; those in space have tests of their own.
PLANE = [name for name in generators.LAYOUTS if generators.dimension_of(name) == 2]

#: The façade at a size at which a program takes a fraction of a second.
SMALL = {"bricks": 14, "courses": 24, "storeys": 1, "windows": 1}


def _shapes(assembly: solver.Assembly) -> list[shapely.Polygon]:
    return [shapely.Polygon(assembly.outline(i)) for i in range(assembly.n_blocks) if assembly.free[i]]


def _assert_no_overlap(assembly: solver.Assembly) -> None:
    i, j, depth = assembly.shapes.overlaps(assembly.vertices, 1e-9)
    assert not len(i), [(assembly.names[a], assembly.names[b], d) for a, b, d in zip(i, j, depth, strict=True)]


def _block(assembly: solver.Assembly, name: str) -> np.ndarray:
    return assembly.outline(assembly.index(name))


@pytest.mark.parametrize("name", PLANE)
def test_no_block_overlaps_another_and_all_hang_together(name):
    assembly = small_layout(name)
    _assert_no_overlap(assembly)
    shapes = _shapes(assembly)
    whole = shapely.union_all(shapes, grid_size=1e-9)
    assert whole.geom_type == "Polygon"
    assert whole.area == pytest.approx(sum(shape.area for shape in shapes), rel=1e-8)


@pytest.mark.parametrize("name", generators.LAYOUTS)
def test_every_layout_has_named_blocks_a_material_and_a_ground(name):
    assembly = small_layout(name)
    assert (assembly.roles != "free").any()
    for kind, role in zip(assembly.materials, assembly.roles, strict=True):
        assert (kind == "ground") == (role != "free")
        assert kind in ("brick", "stone", "ground")
    assert not any(label.startswith("block ") for label in assembly.names) or name == "column"
    assert len(set(assembly.names)) == assembly.n_blocks
    assert assembly.moving.any() or assembly.dimension == 2


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.thorough] if name == "facade" else []) for name in PLANE]
)
def test_every_layout_stands(name):
    wall = {"bricks": 6, "courses": 12, "settling": [0.75, 1.5]}
    assembly = generators.build("wall", wall) if name == "wall" else small_layout(name)
    down = solver.Settlement(direction=(0, -1), increment=1e-7, limit=1e-7)
    response = solver.settle(assembly, down, friction_coefficient=0.6)
    assert response.stop == solver.Status.LIMIT_REACHED, response.message
    weight = -response.path[0].support_forces[:, 1].sum()
    assert weight == pytest.approx(response.total_weight, rel=1e-7)


def test_the_circular_arch_is_what_the_reference_values_are_for():
    arch = generators.arch(embrace=120.0, thickness_ratio=0.1, voussoirs=12)
    radii = np.hypot(*np.array([_block(arch, f"voussoir {i}") for i in range(1, 13)]).reshape(-1, 2).T)
    assert np.unique(np.round(radii, 12)).tolist() == [0.95, 1.05]
    angles = np.degrees(np.arctan2(*_block(arch, "voussoir 1").T[::-1]))
    assert sorted(set(np.round(angles, 9))) == [140.0, 150.0]
    assert arch.names[-2:] == ("left springer", "right springer")
    assert arch.roles[-2:].tolist() == ["fixed", "moving"]
    joint = _block(arch, "right springer")
    assert min(np.hypot(*(a - b)) for a, b in pairwise(joint)) == pytest.approx(0.2)


@pytest.mark.parametrize(
    ("name", "parameters"),
    [
        ("segmental arch", {"span": 3.0, "rise": 0.4, "thickness": 0.3, "voussoirs": 9}),
        ("segmental arch", {"span": 3.0, "rise": 1.5, "thickness": 0.3, "voussoirs": 9}),
        ("pointed arch", {"span": 2.0, "rise": 1.8, "thickness": 0.3, "voussoirs": 12}),
        ("pointed arch", {"span": 2.0, "rise": 1.8, "thickness": 0.3, "voussoirs": 11}),
        ("basket-handle arch", {"span": 5.0, "rise": 1.4, "thickness": 0.4, "voussoirs": 16}),
    ],
)
def test_arches_have_the_span_rise_thickness_and_voussoirs_asked_for(name, parameters):
    arch = generators.build(name, parameters)
    n, span, rise = parameters["voussoirs"], parameters["span"], parameters["rise"]
    stones = [_block(arch, f"voussoir {i}") for i in range(1, n + 1)]
    corners = np.concatenate(stones)
    for x in (-span / 2.0, span / 2.0):
        assert np.hypot(*(corners - [x, 0.0]).T).min() < 1e-12
    between = np.abs(corners[:, 0]) < span / 2.0 - 1e-9
    if n % 2 == 0 or name == "pointed arch":
        assert np.hypot(*(corners[between] - [0.0, rise]).T).min() < 1e-12
    # Joints are as long as the arch is thick, but for the upright one at the apex of a pointed arch, which is longer.
    shared = [shapely.Polygon(a).boundary.intersection(shapely.Polygon(b).boundary).length for a, b in pairwise(stones)]
    upright = shared.pop(n // 2 - 1) if name == "pointed arch" and n % 2 == 0 else math.inf
    assert shared == pytest.approx([parameters["thickness"]] * len(shared), rel=1e-6)
    assert upright > 1.05 * parameters["thickness"]
    assert sorted(corners[:, 0]) == pytest.approx(sorted(-corners[:, 0]), abs=1e-12)


def test_a_basket_handle_arch_turns_without_a_kink():
    n = 30
    arch = generators.basket_handle_arch(span=3.0, rise=1.0, thickness=0.3, voussoirs=n)
    stones = [shapely.Polygon(_block(arch, f"voussoir {i}")) for i in range(1, n + 1)]
    joints = [shapely.shared_paths(a.boundary, b.boundary) for a, b in pairwise(stones)]
    leans = []
    for joint in joints:
        (x0, y0), (x1, y1) = shapely.get_coordinates(joint)[:2]
        leans.append(math.atan2(y1 - y0, x1 - x0) % math.pi)
    steps = np.abs(np.diff(np.unwrap(leans, period=math.pi)))
    # From springing to springing half a turn, haunches faster than the crown, and a joint astride two arcs in between.
    assert steps.sum() + 2.0 * steps[0] == pytest.approx(math.pi)
    assert steps[0] > 1.5 * steps[n // 2 - 1]
    assert ((steps < steps[0] + 1e-9) & (steps > steps[n // 2 - 1] - 1e-9)).all()


def test_wall_of_each_bond_has_the_bricks_of_that_bond():
    counts = {"stack": 4 * 6, "running": 2 * 6 + 2 * 7, "english": 2 * 6 + 2 * (12 + 1)}
    for bond, expected in counts.items():
        wall = generators.wall(bricks=6, courses=4, bond=bond)
        assert int(wall.free.sum()) == expected, bond
    assert wall.roles.tolist().count("fixed") == 1


@pytest.mark.parametrize(("bond", "lap"), [("running", 0.5), ("english", 0.25)])
def test_head_joints_of_neighbouring_courses_keep_their_lap(bond, lap):
    wall = generators.wall(bricks=6, courses=4, brick_length=1.0, brick_height=0.3, bond=bond)
    joints = [
        {
            round(float(x), 9)
            for i, name in enumerate(wall.names)
            if name.startswith(f"brick {c}-")
            for x in wall.outline(i)[:, 0]
        }
        - {0.0, 6.0}
        for c in range(1, 5)
    ]
    for below, above in pairwise(joints):
        assert min(abs(a - b) for a in above for b in below) == pytest.approx(lap)


def test_panel_of_the_reference_values_holds_the_reaction_at_onset():
    panel = generators.panel(nb=3, nc=4, x_s=3.0)
    assert int(panel.free.sum()) == 3 + 4 + 3 + 4
    response = solver.settle(
        panel, solver.Settlement(direction=(0, -1), increment=1e-4, limit=1e-4), friction_coefficient=0.6
    )
    assert response.initial_reaction / response.total_weight == pytest.approx(25 / 272, abs=1e-6)


@pytest.mark.parametrize(
    ("settling", "expected"),
    [
        (None, {"ground": "fixed"}),
        ([2.0, 3.0], {"ground left": "fixed", "ground right": "moving"}),
        ([-1.0, 1.0], {"ground left": "moving", "ground right": "fixed"}),
        ([1.0, 2.0], {"ground left": "fixed", "ground middle": "moving", "ground right": "fixed"}),
        ([0.0, 3.0], {"ground": "moving"}),
    ],
)
def test_ground_is_split_where_it_settles(settling, expected):
    wall = generators.wall(bricks=12, courses=2, settling=settling)
    found = {name: str(role) for name, role in zip(wall.names, wall.roles, strict=True) if role != "free"}
    assert found == expected
    if len(expected) == 2:
        assert _block(wall, "ground left")[:, 0].max() == max(x for x in settling if 0.0 < x < 3.0)


def test_sill_and_jambs_are_straight_and_a_lintel_bears_on_both_sides():
    window = {"x": 0.8, "y": 0.53, "width": 0.9, "height": 0.61, "head": "lintel", "bearing": 0.2, "depth": 0.2}
    wall = generators.wall(bricks=10, courses=16, openings=[window])
    assert shapely.union_all(_shapes(wall), grid_size=1e-9).interiors[0].bounds == pytest.approx((0.8, 0.53, 1.7, 1.14))
    lintel = _block(wall, "lintel 1")
    assert lintel.min(axis=0) == pytest.approx([0.6, 1.14])
    assert lintel.max(axis=0) == pytest.approx([1.9, 1.34])


def test_openings_to_the_top_and_to_the_ground_need_no_head():
    wall = generators.wall(
        bricks=12, courses=10, openings=[{"x": 0.5, "y": 0.5, "width": 0.5, "height": 0.5},
                                         {"x": 1.5, "y": 0.0, "width": 0.5, "height": 0.5, "head": "none"}]
    )  # fmt: skip
    assert not any("lintel" in name for name in wall.names)
    assert sum(shape.area for shape in _shapes(wall)) == pytest.approx(3.0 - 0.5)


HEADS = ("lintel", "flat arch", "segmental arch", "round arch", "none")


@st.composite
def walls(draw):
    """Parameters of a wall with up to two openings side by side, anywhere off the bond's grid, with room for heads."""
    bricks, courses = draw(st.integers(16, 20)), draw(st.integers(16, 22))
    length, height = bricks * 0.25, courses * 0.1
    openings = []
    for k in range(draw(st.integers(1, 2))):
        width = draw(st.floats(0.3, 0.9))
        x = k * length / 2 + draw(st.floats(0.45, length / 2 - 0.45 - width))
        y = draw(st.one_of(st.just(0.0), st.just(0.3), st.floats(0.03, 0.4)))
        opening = {
            "x": x,
            "y": y,
            "width": width,
            "height": draw(st.floats(0.2, 0.35)),
            "head": draw(st.sampled_from(HEADS)),
        }
        openings.append(opening)
    bond = draw(st.sampled_from(("running", "stack", "english")))
    return {"bricks": bricks, "courses": courses, "bond": bond, "openings": openings}, length, height


#: An arch whose extrados passes 0.5 mm below the corner of a brick: what is left there is smaller than any edge of it.
CORNER = {"x": 0.5, "y": 0.18, "width": 0.703125, "height": 0.237644994565117, "head": "round arch"}


def _open_area(wall: solver.Assembly, number: int, opening: dict) -> float:
    """Rectangle of an opening and what is between its top and the chords of its intrados [m²]."""
    width, rectangle = opening["width"], opening["width"] * opening["height"]
    if opening["head"] not in ("segmental arch", "round arch"):
        return rectangle
    n = sum(name.startswith(f"voussoir {number}-") for name in wall.names)
    assert n >= 3
    rise = width / (2.0 if opening["head"] == "round arch" else 6.0)
    radius = (width**2 / 4.0 + rise**2) / (2.0 * rise)
    angle = 2.0 * math.atan2(width / 2.0, radius - rise)
    return rectangle + radius**2 / 2.0 * (n * math.sin(angle / n) - math.sin(angle))


@settings(deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow], max_examples=10)
@given(walls())
@example(({"bricks": 16, "courses": 16, "bond": "running", "openings": [CORNER]}, 4.0, 1.6))
@pytest.mark.slow
def test_bricks_fill_any_wall_around_its_openings_without_overlap(sample):
    parameters, length, height = sample
    wall = generators.build("wall", parameters)
    _assert_no_overlap(wall)
    shapes = _shapes(wall)
    assert len(set(wall.names)) == wall.n_blocks
    whole = shapely.union_all(shapes, grid_size=1e-8)
    assert whole.area == pytest.approx(sum(shape.area for shape in shapes), abs=1e-6)
    # The wall lacks its openings and no more.
    missing = shapely.box(0, 0, length, height).difference(whole)
    expected = sum(_open_area(wall, number, opening) for number, opening in enumerate(parameters["openings"], start=1))
    assert missing.area == pytest.approx(expected, abs=1e-6)
    # No slivers: a piece too low or too short has been joined to a neighbour.
    bricks = [shape for shape, kind in zip(shapes, wall.materials, strict=False) if kind == "brick"]
    assert min(shape.area for shape in bricks) > 0.02 * 0.25 * 0.1


@pytest.mark.thorough
def test_facade_has_about_1500_bricks_in_regular_courses():
    facade = generators.facade()
    bricks = [i for i, kind in enumerate(facade.materials) if kind == "brick"]
    assert 1400 <= len(bricks) <= 1600
    assert {name.split("-")[0] for name in facade.names if name.startswith("voussoir")} == {
        f"voussoir {window}" for window in range(1, 5)
    }
    _assert_no_overlap(facade)
    levels = {
        round(float(y) / 0.125, 6) for i in bricks for y in facade.outline(i)[:, 1] if len(facade.outline(i)) == 4
    }
    assert {y for y in levels if y == round(y)} == set(range(49))
    assert _block(facade, "ground right")[:, 0].min() == pytest.approx(20 / 3)
    assert facade.roles[facade.index("ground right")] == "moving"


def test_facade_arches_rise_by_the_courses_asked_for():
    facade = generators.facade(**SMALL, voussoirs=3, rise_courses=1.5)
    key = _block(facade, "voussoir 1-2")
    # Of three equal voussoirs the key's intrados is a chord about the crown, below it by its sagitta.
    radius = (1.0**2 + 0.1875**2) / (2 * 0.1875)
    sixth = np.arctan2(1.0, radius - 0.1875) / 3
    assert key[:, 1].min() == pytest.approx((5 + 12) * 0.125 + 0.1875 - radius * (1 - np.cos(sixth)))


def test_layouts_are_found_by_name_however_it_is_written():
    assert generators.build("Basket_handle arch", {"voussoirs": 7.0}).n_blocks == 9
    assert generators.build("façade", SMALL).n_blocks == generators.facade(**SMALL).n_blocks


WALL = {"bricks": 12, "courses": 12}


@pytest.mark.parametrize(
    ("name", "parameters", "message"),
    [
        ("wal", {}, "there is no layout 'wal' .did you mean 'wall'"),
        ("portal", {"spam": 1}, "layout 'portal' has no 'spam' .did you mean 'span'"),
        ("portal", {"span": "wide"}, "span is 'wide'; give a finite number in m"),
        ("facade", {"storeys": 3}, "courses is 48, too few for 3 storeys of 21.49 courses .*; give at least 66"),
        ("portal", {"span": -2}, "span is -2 m; give a number above 0"),
        ("column", {"blocks": 2.5}, "blocks is 2.5; give a whole number of at least 1"),
        ("arch", {"embrace": 200}, "embrace is 200 degrees"),
        (
            "segmental arch",
            {"span": 2, "rise": 1.5},
            "rise is 1.5 m for a span of 2 m; a segmental arch rises at most 1 m",
        ),
        (
            "pointed arch",
            {"span": 2, "rise": 0.5},
            "rise is 0.5 m for a span of 2 m; a pointed arch rises at least 1 m",
        ),
        ("basket-handle arch", {"span": 3, "rise": 0.2}, "rises between 0.4019 and 1.5 m: take a segmental arch"),
        ("basket-handle arch", {"span": 3, "rise": 2}, "take a pointed arch"),
        ("arch on piers", {"pier_width": 0.2}, "pier_width is 0.2 m, narrower .* give at least 0.25 m"),
        ("buttressed arch", {"buttress_height": 9}, "buttress_height is 9 m, above the pier_height of 3 m"),
        ("buttressed arch", {"buttress_top": 2}, "buttress_top is 2 m, more than the buttress_width of 1.2 m"),
        ("panel", {"nb": 3, "x_s": 7}, "x_s is 7 m; give an x inside the panel, between 0 and 6 m"),
        ("wall", {"bond": "flemish"}, "bond is 'flemish'; choose from running, stack, english"),
        ("wall", {"width": 2, "bricks": 8}, "width and bricks are both given, 2 m and 8"),
        ("wall", {"height": 1.25}, "height is 1.25 m, 12.5 courses of 0.1 m; give 1.2 or 1.3 m"),
        ("wall", {"settling": [4, 5]}, "settling is .4, 5. m, beside the wall"),
        ("wall", {"settling": 2}, "settling is 2; give two numbers"),
        ("wall", {"openings": {"x": 1}}, "give a list of tables"),
        ("facade", {"window_bricks": 1, "rise_courses": 5}, "rise_courses is 5, 0.625 m over windows of 0.25 m"),
        ("facade", {"settling_from": 20}, "settling_from is 20 m; give an x left of the end of the façade at 10 m"),
        ("facade", {"window_bricks": 9.6, "rise_courses": 4.75}, "rise_courses is 4.75, .* give at most 4.726"),
        ("facade", {"voussoirs": 1}, "^voussoirs is 1"),
        ("facade", {"bricks": 16}, "bricks is 16, too few for 2 windows of 8 bricks .* give at least 19"),
    ],
)
def test_bad_parameters_are_named_with_their_value_and_a_remedy(name, parameters, message):
    with pytest.raises(ValueError, match=message):
        generators.build(name, parameters)


#: Places, which may lie on either side of the origin, and a gap that may be none.
NO_LENGTHS = ("settling_from", "cavity")


@pytest.mark.parametrize("bad", [-1.0, 0.0, math.nan, math.inf, 1e200, 1e-200, "wide"])
@pytest.mark.parametrize("name", generators.LAYOUTS)
@pytest.mark.slow
def test_every_length_of_every_layout_is_refused_by_its_name_unless_it_is_one(name, bad):
    quantities = [key for key, value in generators.parameters_of(name).items() if isinstance(value, float)]
    for key in set(quantities).difference(NO_LENGTHS):
        with pytest.raises(ValueError, match=rf"^{key} is .*; give "):
            generators.build(name, (SMALL if name == "facade" else {}) | {key: bad})


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"height": None}, "opening 1 has no height"),
        ({"haed": "none"}, "opening 1 has no 'haed' .did you mean 'head'"),
        ({"head": "beam"}, "opening 1: head is 'beam'; choose from lintel"),
        ({"head": "round arch", "rise": 0.1}, "rise is 0.1 m; that of a round arch is 0.25 m"),
        ({"head": "segmental arch", "rise": 0.3}, "opening 1: rise is 0.3 m, more than half of its width of 0.5 m"),
        ({"rise": 0.1}, "rise is that of a segmental arch or round arch; its head is 'lintel': leave rise out"),
        ({"head": "none", "depth": 0.3}, "depth is that of a .*; its head is 'none'"),
        ({"head": "flat arch", "skew": 80}, "opening 1: skew is 80 degrees; give an angle above 0 and below 60"),
        ({"width": "wide"}, "opening 1: width is 'wide'; give a finite number in m"),
        ({"x": 2.8}, "opening 1 ends at x = 3.3 m, outside the wall of 3 m"),
        ({"y": 1.0}, "opening 1 ends at y = 1.3 m, above the wall of 1.2 m"),
        ({"x": 0.02}, "opening 1 leaves 0.02 m of wall on its left; leave at least 0.05 m"),
        ({"y": 0.01}, "opening 1 leaves 0.01 m of wall under its sill; leave at least 0.03 m, or nothing"),
        ({"y": 0.69}, "opening 1 leaves 0.01 m of wall above it; leave at least 0.03 m"),
        ({"y": 0.75}, "opening 1 with its head reaches .* up to y = 1.25 m"),
    ],
)
def test_a_bad_opening_is_named_with_its_value_and_a_remedy(changes, message):
    opening = {"x": 1.0, "y": 0.1, "width": 0.5, "height": 0.3} | changes
    opening = {key: value for key, value in opening.items() if value is not None}
    with pytest.raises(ValueError, match=message):
        generators.wall(**WALL, openings=[opening])


def test_openings_that_overlap_with_their_heads_are_both_named():
    openings = [{"x": x, "y": 0.1, "width": 0.5, "height": 0.3} for x in (1.0, 1.6)]
    with pytest.raises(ValueError, match=r"opening 1 and opening 2 overlap by 0\.03 m², heads included; move them"):
        generators.wall(**WALL, openings=openings)


@pytest.mark.parametrize(("place", "least"), [((1.501, 0.1), "0.05"), ((1.0, 0.401), "0.03")])
def test_openings_that_leave_a_needle_between_them_are_refused(place, least):
    openings = [{"x": x, "y": y, "width": 0.5, "height": 0.3, "head": "none"} for x, y in ((1.0, 0.1), place)]
    with pytest.raises(ValueError, match=rf"1 and opening 2 leave 0.001 m of wall .*; leave at least {least} m"):
        generators.wall(**WALL, openings=openings)
    openings[1] |= {"x": round(place[0], 1), "y": round(place[1], 1)}
    assert generators.wall(**WALL, openings=openings).n_blocks > 50
