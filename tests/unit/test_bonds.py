"""Outlines with openings become the stones of a bond: what they fill, how they stand, and what is refused."""

import math
import re
import tomllib

import ezdxf
import numpy as np
import pytest
import shapely
import structures
from hypothesis import given, settings
from hypothesis import strategies as st

import blockvis
import solver
from blockvis import generators
from blockvis.cli import main
from solver import mechanics

BONDS = ("running", "stack", "english", "flemish", "header", "ashlar", "rubble")


def arched(left, low, width, springing, rise, n=16):
    """An opening under a segmental head."""
    radius = (width**2 / 4 + rise**2) / (2 * rise)
    half = math.asin(min(1.0, width / 2 / radius))
    turn = np.linspace(half, -half, n)
    x = left + width / 2 + radius * np.sin(turn)
    y = low + springing - (radius - rise) + radius * np.cos(turn)
    return shapely.Polygon([(left, low), (left + width, low), *np.column_stack([x, y])])


WALL = shapely.box(0, 0, 5.2, 3.0)
OPENINGS = [shapely.box(0.8, 0, 1.6, 1.8), arched(2.2, 0.8, 0.8, 0.9, 0.15), shapely.box(3.7, 0.8, 4.4, 1.9)]
#: Where maps put their walls.
FAR = np.array([4e5, 5e6])

LAYERS = ("A-DOOR", "A-WIN", "A-WIN")


def shapes_of(layout):
    return [shapely.Polygon(ring) for ring in layout.outlines]


def checked(layout, area, rel=1e-9):
    """Stones that are simple, lie side by side and fill an area."""
    shapes = shapes_of(layout)
    assert all(shape.is_valid for shape in shapes)
    assert sum(shape.area for shape in shapes) == pytest.approx(area, rel=rel)
    assert shapely.union_all(shapes).area == pytest.approx(area, rel=rel)
    return shapes


def first_status(layout, friction=0.6):
    """Whether a wall stands, on a ground of which nothing has moved yet."""
    left, low, right, _ = shapely.MultiPoint(layout.points).bounds
    ring = [[left - 1, low - 1], [right + 1, low - 1], [right + 1, low], [left - 1, low]]
    outlines = [*layout.blocks, np.array(ring)]
    assembly = solver.Assembly.from_outlines(outlines, roles=[*["free"] * layout.n_blocks, "moving"])
    found = mechanics.settlement_increments(
        assembly,
        [solver.Settlement(direction=(0, -1), limit=0.01)],
        interfaces=solver.Interfaces(solver.InterfaceLaw(friction)),
        loads=solver.Structure(assembly, friction_coefficient=friction).loads,
        controls=solver.Controls(),
    )
    return next(found).status


@pytest.mark.path
@pytest.mark.parametrize(
    "bond",
    [pytest.param(bond, marks=[pytest.mark.thorough] * (bond in ("stack", "english", "header"))) for bond in BONDS],
)
def test_each_bond_fills_the_wall_and_stands_over_a_door_and_two_windows(bond):
    size = {"stone": 0.5} if bond == "rubble" else {"brick": (0.5, 0.25)}
    layout = generators.bond(WALL, OPENINGS, bond=bond, **size)
    checked(layout, WALL.area - shapely.union_all(OPENINGS).area)
    heads = {name for name in layout.names if name.startswith(("lintel", "voussoir"))}
    assert {"lintel 1", "voussoir 2-1", "lintel 3"} <= heads
    assert not layout.notes
    assert first_status(layout) is solver.Status.EQUILIBRIUM


@pytest.mark.thorough
@pytest.mark.path
@pytest.mark.parametrize("heads", [pytest.param("lintel", marks=pytest.mark.thorough), "flat arch", "arch"])
def test_other_heads_stand_too(heads):
    layout = generators.bond(WALL, OPENINGS, brick=(0.5, 0.25), heads=heads)
    checked(layout, WALL.area - shapely.union_all(OPENINGS).area)
    assert ("lintel 1" in layout.names) == (heads == "lintel")
    assert ("voussoir 1-3" in layout.names) == (heads != "lintel")
    assert first_status(layout) is solver.Status.EQUILIBRIUM


def test_a_head_that_reaches_the_rim_by_less_than_rounding_is_cut_there():
    """A flat arch that stuck out of the wall by 0.09 mm was laid, and its wall refused."""
    layout = generators.bond(shapely.box(0, 0, 2, 1.5), [shapely.box(0.1, 0.0, 1.9, 1.0)], heads="flat arch")
    checked(layout, 3.0 - 1.8)
    assert not layout.notes


@pytest.mark.slow
def test_an_oculus_has_its_ring_above_a_door_on_the_ground():
    """Edges that were left of stones on a grid, as lines, ended this with a traceback, and rings of others."""
    gable = shapely.Polygon([(0, 0), (7, 0), (7, 4), (3.5, 7.5), (0, 4)])
    angle = np.pi * np.arange(48) / 24
    arch = 0.75 * np.column_stack([np.cos(angle[:17] * 1.5), np.sin(angle[:17] * 1.5)]) + [3.5, 2.2]
    door = shapely.Polygon([(2.75, 0), (4.25, 0), *arch])
    oculus = shapely.Polygon(0.6 * np.column_stack([np.cos(angle), np.sin(angle)]) + [3.5, 4.9])
    layout = generators.bond(gable, [door, oculus])
    checked(layout, gable.difference(door).difference(oculus).area)
    assert {"voussoir 1-1", "voussoir 2-1"} <= set(layout.names)
    assert not layout.notes


def test_other_heads_than_those_that_are_asked_for_are_told():
    wall, opening = shapely.box(0, 0, 2, 1.5), shapely.box(0.1, 0.0, 1.9, 1.1)
    said = "bond: 1 opening has no room for the head that is asked for and got "
    layout = generators.bond(wall, [opening], heads="arch")
    assert layout.names[-1] == "lintel 1"
    assert layout.notes == (f"{said}a lintel instead of an arch, the first around (1, 0.55)",)
    (note,) = generators.bond(wall, [opening], heads="lintel").notes
    assert note.startswith(f"{said}a shallower one, or one with less bearing")


@pytest.mark.thorough
def test_without_heads_stones_of_a_stack_bond_fall_out_over_an_opening():
    layout = generators.bond(WALL, OPENINGS[:1], bond="stack", brick=(0.4, 0.2), heads="none")
    assert first_status(layout, friction=0.3) is not solver.Status.EQUILIBRIUM


def test_holes_notches_and_openings_at_the_rim_get_heads():
    notched = WALL.difference(OPENINGS[0]).difference(OPENINGS[1])
    layout = generators.bond(notched, brick=(0.5, 0.25))
    checked(layout, notched.area)
    assert {"voussoir 1-1", "lintel 2"} <= set(layout.names)


def test_the_height_of_a_brick_is_not_that_of_rubble():
    said = (
        "bond: stones of rubble are 0.5 m long and 0.312 m high in the mean, by flatness; the height of brick, 0.2 m, "
    )
    said += "is not used: give stone = 0.5 and flatness = 2.5 for this height"
    assert generators.bond(WALL, bond="rubble", brick=(0.5, 0.2)).notes == (said,)
    assert not generators.bond(WALL, bond="rubble", stone=0.5, flatness=2.5).notes


def test_no_closer_is_shorter_than_three_tenths_of_a_brick():
    layout = generators.bond(WALL, OPENINGS, brick=(0.25, 0.125))
    bricks = [shape for name, shape in zip(layout.names, shapes_of(layout), strict=True) if name.startswith("brick")]
    assert min(shape.area for shape in bricks) > 0.3 * 0.25 * 0.125 * (1 - 1e-9)


@given(
    wall=st.tuples(st.floats(1.5, 6), st.floats(1.2, 4), st.floats(0, 0.8)),
    openings=st.lists(
        st.tuples(*[st.floats(0, 1)] * 2, st.floats(0.1, 0.4), st.floats(0.1, 0.6), st.booleans()), max_size=4
    ),
    bond=st.sampled_from(BONDS),
    heads=st.sampled_from(("auto", "lintel", "flat arch", "arch", "none")),
    seed=st.integers(0, 99),
)
@settings(max_examples=10, deadline=None)
@pytest.mark.thorough
def test_any_wall_is_filled_whatever_its_openings_are(wall, openings, bond, heads, seed):
    width, high, gable = wall
    outline = shapely.Polygon([(0, 0), (width, 0), (width, high), (width / 2, high + gable), (0, high)])
    holes = [
        arched(x * 0.9 * width, y * 0.9 * high, w * width, h * high, 0.3 * w * width) if curved
        else shapely.box(x * 0.9 * width, y * 0.9 * high, (x * 0.9 + w) * width, (y * 0.9 + h) * high)
        for x, y, w, h, curved in openings
    ]  # fmt: skip
    size = {"stone": 0.4} if bond == "rubble" else {"brick": (0.5, 0.25)}
    layout = generators.bond(outline, holes, bond=bond, heads=heads, seed=seed, **size)
    # What openings that overlap enclose would hang in the air: it is of the opening.
    opened = [shapely.Polygon(part.exterior) for part in shapely.get_parts(shapely.union_all(holes))]
    checked(layout, outline.difference(shapely.union_all(opened)).area)


def test_a_seed_that_is_too_large_is_refused_as_a_number():
    with pytest.raises(ValueError, match=r"seed is 3e.09; give a whole number of at most 2147483648"):
        generators.bond(shapely.box(0, 0, 2, 1), bond="rubble", stone=0.5, seed=3_000_000_000)


def test_random_stones_come_back_with_their_seed():
    def stones(seed):
        return generators.bond(shapely.box(0, 0, 2, 1), bond="rubble", stone=0.5, seed=seed).points

    assert np.array_equal(stones(1), stones(1))
    assert not np.array_equal(stones(1), stones(2))


def test_far_from_the_origin_a_wall_is_filled_as_exactly():
    def far(shape):
        return shapely.transform(shape, lambda xy: xy + FAR)

    here = generators.bond(WALL, OPENINGS, brick=(0.5, 0.25))
    there = generators.bond(far(WALL), [far(opening) for opening in OPENINGS], brick=(0.5, 0.25))
    assert there.n_blocks == here.n_blocks
    assert np.abs(there.points - here.points - FAR).max() < 1e-8
    assert all(shape.is_valid for shape in shapes_of(there)), "no corner is there twice"


def test_quoins_are_long_and_short_in_turn():
    layout = generators.bond(WALL, OPENINGS, brick=(0.25, 0.125), quoins=(0.5, 0.25))
    checked(layout, WALL.area - shapely.union_all(OPENINGS).area)
    lengths = [np.ptp(ring[:, 0]) for name, ring in zip(layout.names, layout.outlines, strict=True) if "quoin" in name]
    assert len(lengths) == 24
    assert sorted(set(np.round(lengths, 6))) == [0.25, 0.5]


def test_ends_of_a_wall_that_are_traced_have_quoins_too():
    traced = shapely.Polygon([(0, 0), (4, 0), (3.999, 2), (0.001, 2)])
    layout = generators.bond(traced, quoins=(0.5, 0.3))
    checked(layout, traced.area)
    assert sum("quoin" in name for name in layout.names) == 12
    assert not layout.notes


@pytest.mark.parametrize("outline", [[(0, 0), (4, 0), (3.9, 2), (0.1, 2)], [(0, 0), (4, 0), (4, 0.5), (0, 0.5)]])
def test_a_wall_that_has_no_room_for_quoins_tells(outline):
    (said,) = generators.bond(outline, quoins=(0.5, 0.3)).notes
    assert "has no quoins: no end is upright, to 1 mm in a metre, 0.6 m high" in said


def test_mortar_is_left_open_between_stones_and_not_along_the_rim():
    layout = generators.bond(WALL, brick=(0.5, 0.25), joint=0.01)
    stone = next(ring for name, ring in zip(layout.names, layout.outlines, strict=True) if name == "brick 1-2")
    assert stone.min(axis=0) == pytest.approx([0.505, 0.0])
    assert stone.max(axis=0) == pytest.approx([0.995, 0.245])
    assert shapely.union_all(shapes_of(layout)).bounds == pytest.approx(WALL.bounds)


@pytest.mark.parametrize(
    ("bond", "heads"), [("ashlar", "auto"), pytest.param("flemish", "arch", marks=pytest.mark.thorough)]
)
def test_mortar_is_left_open_between_stones_and_voussoirs(bond, heads):
    # A round head, whose voussoirs have oblique faces that no stone beside them meets to the last digit.
    turn = np.linspace(0.0, np.pi, 25)
    head = np.column_stack([2.0 + 0.5 * np.cos(turn), 1.6 + 0.5 * np.sin(turn)])
    window = shapely.Polygon([(1.5, 0.8), (2.5, 0.8), *head])
    quoins, brick = ((0.6, 0.3), (0.5, 0.3)) if bond == "ashlar" else (None, (0.25, 0.075))
    layout = generators.bond(
        shapely.box(0, 0, 4, 3), [window], bond=bond, heads=heads, brick=brick, quoins=quoins, joint=0.008
    )
    shapes = shapes_of(layout)
    pairs = shapely.STRtree(shapes).query(shapes, "dwithin", 0.02).T
    # Where corners of three stones meet they may be nearer than their faces.
    assert min(shapes[i].distance(shapes[j]) for i, j in pairs if i < j) > 0.7 * 0.008


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"brick": (8.0, 0.25)}, "brick is 8 m long, the wall 5.2 m wide; give a smaller brick, or the unit"),
        ({"brick": (0.001, 0.001)}, "makes .* blocks .* give a larger brick"),
        ({"brick": (0.25,)}, "brick is .*; give its length and height"),
        ({"bond": "rubbel"}, "choose from running"),
        ({"stone": 0.9}, "stone is that of bond rubble; bond is 'running': leave stone out"),
        ({"bond": "ashlar", "flatness": 4.0}, "flatness is that of bond rubble; bond is 'ashlar'"),
        ({"heads": "none", "bearing": 0.1}, "bearing is that of heads auto or .*; heads is 'none': leave bearing out"),
        ({"bond": "rubble", "stone": 0.3, "brick": (0.5, 0.05)}, "brick and stone are both given; .*: leave brick out"),
        ({"joint": 0.06}, "joint is 0.06 m, more than half of a course of 0.075 m"),
        ({"quoins": (3.0, 0.3)}, "quoins are 3 m long, the wall 5.2 m wide; give at most half"),
        ({"openings": [shapely.box(8, 0, 9, 1)]}, r"opening 1 around \(8.5, 0.5\) lies outside its wall"),
        ({"openings": [WALL]}, "openings and holes leave nothing of the wall; leave them out"),
        ({"openings": [[[0, 0], [1, 1], [1, 0], [0, 1]]]}, "opening 1 is no simple polygon: .*; redraw it"),
    ],
)
def test_what_cannot_be_laid_is_refused_with_a_remedy(values, message):
    with pytest.raises(ValueError, match=message):
        generators.bond(WALL, **{"openings": [], **values})


def drawn(path, *shapes, close=True, unit=6):
    """A drawing of outlines on layers."""
    document = ezdxf.new("R2010")
    document.header["$INSUNITS"] = unit
    for layer, shape in shapes:
        corners = list(shape.exterior.coords)[:-1] if hasattr(shape, "exterior") else shape
        closes = close or layer != "A-WALL"
        document.modelspace().add_lwpolyline(corners, close=closes, dxfattribs={"layer": layer})
    document.saveas(path)
    return path


@pytest.fixture
def facade(tmp_path):
    return drawn(tmp_path / "facade.dxf", ("A-WALL", WALL), *zip(LAYERS, OPENINGS, strict=True))


def bonded(drawing, *words, code=0):
    out = drawing.with_name("bricks.dxf")
    assert main(["bond", str(drawing), "-o", str(out), "--force", "brick=[0.5, 0.25]", *words]) == code
    return blockvis.read_layout(out) if code == 0 else None


def test_the_command_writes_the_stones_of_a_drawing(facade, capsys):
    layout = bonded(facade, "walls=A-WALL*", "bond=flemish", 'openings=["A-WIN", "A-DOOR"]')
    checked(layout, WALL.area - shapely.union_all(OPENINGS).area)
    assert set(layout.groups) == {"A-WALL"}
    assert "an outline of 15.6 m² on layer 'A-WALL' with 3 openings was filled" in capsys.readouterr().err
    # The wall is found where none is named, as by `blockvis new`.
    assert bonded(facade, "bond=flemish", 'openings=["A-WIN", "A-DOOR"]').groups == layout.groups
    assert 'note: walls = ["A-WALL"]: outlines with openings in them' in capsys.readouterr().err


@pytest.mark.thorough
def test_a_hatch_with_holes_and_faces_between_lines_are_walls_too(tmp_path):
    rest = WALL.area - OPENINGS[1].area
    hatched, lined = ezdxf.new("R2010"), ezdxf.new("R2010")
    rings = [list(shape.exterior.coords)[:-1] for shape in (WALL, OPENINGS[1])]
    hatch = hatched.modelspace().add_hatch(dxfattribs={"layer": "A-WALL"})
    for ring in rings:
        hatch.paths.add_polyline_path(ring, is_closed=True)
        for k in range(len(ring)):
            lined.modelspace().add_line(ring[k - 1], ring[k], dxfattribs={"layer": "A-WALL"})
    for document, name in ((hatched, "hatched.dxf"), (lined, "lined.dxf")):
        document.header["$INSUNITS"] = 6
        document.saveas(tmp_path / name)
        checked(bonded(tmp_path / name, "walls=A-WALL"), rest, rel=1e-6)


CASE = """
[geometry]
file = "{file}"
thickness = 0.25
[[supports]]
name = "ground"
role = "moving"
outline = [[-1, -1], [6, -1], [6, 0], [-1, 0]]
[settlement]
direction = [0, -1]
[[bond]]
walls = ["A-WALL"]
brick = [0.5, 0.25]
joint = 0.01
"""


def assembly_of(text, drawing):
    text = text.replace("{file}", drawing.name)
    with pytest.warns(UserWarning, match="was filled with"):
        return structures.assembly_of(structures.case_from(text, drawing.parent))


def test_a_case_fills_the_wall_and_closes_its_joints(facade):
    assembly = assembly_of(CASE + 'thickness = 0.4\nopenings = ["A-*[NR]"]', facade)
    free = assembly.free
    assert assembly.areas[free].sum() == pytest.approx(WALL.area - shapely.union_all(OPENINGS).area, rel=1e-9)
    assert set(assembly.thickness[free]) == {0.4}
    assert {"lintel 1", "ground"} <= set(assembly.names)


@pytest.mark.thorough
def test_a_gap_between_stones_of_a_bond_is_no_joint_and_one_between_drawn_stones_is(tmp_path):
    window = arched(0.8, 0.4, 1.2, 0.9, 0.6, n=8)
    pier = [("pier", shapely.box(6, low, 6.5, low + 0.5)) for low in (0.0, 0.51)]
    drawing = drawn(tmp_path / "arch.dxf", ("A-WALL", WALL), ("A-WIN", window), *pier)
    case = CASE + 'openings = ["A-WIN"]\n'
    drawn_open, closed = (
        assembly_of(case.replace("[[supports]]", f"joint_thickness = {width}\n[[supports]]"), drawing)
        for width in (0.0, 0.15)
    )
    wall = drawn_open.centroids[drawn_open.block_of_vertex, 0] < 6
    np.testing.assert_allclose(closed.vertices[wall], drawn_open.vertices[wall], atol=1e-9)
    assert closed.areas[closed.centroids[:, 0] > 6].sum() == pytest.approx(0.505, rel=1e-9)


def test_walls_side_by_side_have_bonds_of_their_own(tmp_path):
    jambs = [shapely.box(2.0, 0.8, 2.2, 1.7), shapely.box(3.0, 0.8, 3.2, 1.7)]
    drawing = drawn(
        tmp_path / "jambs.dxf", ("A-WALL", WALL), ("A-WIN", OPENINGS[1]), *(("jamb", jamb) for jamb in jambs)
    )
    table = '[[bond]]\nwalls = "jamb"\nbond = "stack"\nbrick = [0.2, 0.1]\n'
    assembly = assembly_of(CASE + table, drawing)
    inside = [name for name in assembly.names if name.startswith(("wall 2 brick", "wall 3 brick"))]
    assert len(inside) == 18
    assert assembly.areas[assembly.free].sum() == pytest.approx(WALL.area - OPENINGS[1].area, rel=1e-9)


def test_drawn_blocks_that_are_no_openings_stay_and_the_bond_is_laid_around_them(tmp_path):
    stone = shapely.box(4.0, 2.2, 4.6, 2.6)
    drawing = drawn(tmp_path / "stone.dxf", ("A-WALL", WALL), ("A-WIN", OPENINGS[1]), ("carved", stone))
    layout = bonded(drawing, "walls=A-WALL", "openings=A-WIN")
    checked(layout, WALL.area - OPENINGS[1].area)
    assert layout.groups.count("carved") == 1


@pytest.mark.thorough
def test_the_unit_of_the_drawing_holds(tmp_path):
    large = [(layer, shapely.transform(shape, lambda xy: 1000 * xy)) for layer, shape in (("A-WALL", WALL),)]
    layout = bonded(drawn(tmp_path / "mm.dxf", *large, unit=4), "walls=A-WALL")
    checked(layout, WALL.area)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["walls=WALL"], r"walls = 'WALL' matches no closed outline; the drawing has .*'A-WALL' \(1\)"),
        (["walls=A-WALL", "brick=[6, 0.25]"], "the wall 'block .*' on layer 'A-WALL': brick is 6 m long"),
        (["walls=A-WALL", "bond=flemisch"], r"\[bond\] bond is 'flemisch' \(did you mean 'flemish'\?\)"),
        (
            ["walls=A-WALL", "openings=A-WNI"],
            r"openings = 'A-WNI' matches no closed outline; the drawing has 'A-WIN' \(2\)",
        ),
        (["walls=A-WALL", "brik=1"], r"\[bond\] brik is not a key here \(did you mean 'brick'\?\)"),
    ],
)
def test_the_command_refuses_in_one_line(facade, words, message, capsys):
    bonded(facade, *words, code=2)
    said = capsys.readouterr().err.strip().splitlines()
    assert len(said) == 1
    assert re.search(message, said[0])


def test_walls_without_openings_are_asked_for(tmp_path, capsys):
    bonded(drawn(tmp_path / "two.dxf", ("A", shapely.box(0, 0, 2, 1)), ("A", shapely.box(0, 1, 2, 2))), code=2)
    assert re.search(r"\[bond\] walls is missing; name layers of the drawing", capsys.readouterr().err)


def test_an_opening_outside_and_an_open_outline_are_named_with_their_place(tmp_path, capsys):
    far = drawn(tmp_path / "far.dxf", ("A-WALL", WALL), ("A-WIN", shapely.box(8, 1, 9, 2)))
    bonded(far, "walls=A-WALL", "openings=A-WIN", code=2)
    assert re.search(r"the opening .* on layer 'A-WIN' around \(8.5, 1.5\) lies outside", capsys.readouterr().err)
    ends = [*list(WALL.exterior.coords)[:-1], (5.197, 0)]
    gap = drawn(tmp_path / "gap.dxf", ("A-WALL", ends), ("A-WIN", OPENINGS[1]), close=False)
    bonded(gap, "walls=A-WALL", code=2)
    assert "the outline on layer 'A-WALL' is open by 0.003 m" in capsys.readouterr().err


def test_info_and_run_say_that_the_wall_wants_a_bond(facade, capsys):
    assert main(["info", str(facade)]) == 0
    said = (
        "an outline of 15.6 m² on layer 'A-WALL' with 3 openings, 12.59 m² of wall: fill it with a bond: blockvis bond"
    )
    assert said in capsys.readouterr().out
    with pytest.warns(UserWarning, match="fill it with a bond"):
        blockvis.read(facade)


@pytest.mark.slow
def test_a_hatch_of_two_points_is_no_wall(tmp_path):
    document = ezdxf.new()
    space = document.modelspace()
    for x in range(2):
        space.add_lwpolyline([(x, 0), (x + 1, 0), (x + 1, 1), (x, 1)], close=True)
    space.add_hatch().paths.add_polyline_path([(3, 0), (4, 0)], is_closed=True)
    document.saveas(tmp_path / "a.dxf")
    assert main(["new", str(tmp_path / "a.dxf"), "-o", str(tmp_path / "a.toml")]) == 0


@pytest.mark.slow
def test_new_writes_the_bond_into_the_case(tmp_path):
    window = arched(0.4, 0.2, 0.6, 0.2, 0.3, n=8)
    drawing = drawn(tmp_path / "small.dxf", ("A-WALL", shapely.box(0, 0, 1.5, 0.9)), ("A-WIN", window))
    case = tmp_path / "new.toml"
    assert main(["new", str(drawing), "-o", str(case)]) == 0
    values = tomllib.loads(case.read_text(encoding="utf-8"))
    assert values["bond"] == [{"walls": ["A-WALL"], "bond": "running", "brick": [0.25, 0.075]}]
    assert "joint_thickness" not in values["geometry"]
    assert [support["role"] for support in values["supports"]] == ["fixed", "moving"]


def test_a_layout_by_name_has_no_outlines_to_fill(tmp_path):
    with pytest.raises(ValueError, match=r"\[bond\] walls are outlines of a drawing"):
        structures.case_from('[geometry]\nlayout = "arch"\n[[bond]]\nwalls = "*"', tmp_path)
