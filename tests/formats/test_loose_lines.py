"""Outlines cut by joint lines, ends that miss by little, and what is said where nothing closes."""

import math
from contextlib import nullcontext

import ezdxf
import numpy as np
import pytest
import shapely
from ezdxf.math import BSpline

from blockvis import read, read_layout


def dxf(tmp_path, draw):
    document = ezdxf.new("R2010")
    document.header["$INSUNITS"] = 4
    draw(document.modelspace())
    document.saveas(tmp_path / "a.dxf")
    return tmp_path / "a.dxf"


def svg(tmp_path, body, box="0 0 1000 600"):
    (tmp_path / "a.svg").write_text(
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{box.split()[2]}mm" viewBox="{box}">{body}</svg>',
        encoding="utf-8",
    )
    return tmp_path / "a.svg"


#: Bed joints, and head joints between them.
LINES = [((0, 200), (1000, 200)), ((0, 400), (1000, 400))] + [
    ((x, y), (x, y + 200)) for y, xs in ((0, (300, 700)), (200, (500,)), (400, (300, 700))) for x in xs
]
AREAS = [0.06, 0.06, 0.06, 0.06, 0.08, 0.08, 0.1, 0.1]


def joints(space, miss=0.0):
    space.add_lwpolyline([(0, 0), (1000, 0), (1000, 600), (0, 600)], close=True, dxfattribs={"layer": "wall"})
    for (x, y), (u, v) in LINES:
        # Head joints end short of the bed joints, or beyond them.
        short = miss if x == u else 0.0
        space.add_line((x, y + short), (u, v - short), dxfattribs={"layer": "joint"})


@pytest.mark.parametrize("miss", [0.0, 0.05, -0.05])
def test_joint_lines_cut_an_outline(tmp_path, miss):
    drawing = read_layout(dxf(tmp_path, lambda space: joints(space, miss=miss)))
    areas = sorted(shapely.Polygon(ring).area for ring in drawing.outlines)
    assert areas == pytest.approx(AREAS, rel=1e-3)
    assert set(drawing.groups) == {"wall"}
    assert any(note.startswith("cut: 7 lines within an outline cut it into 8 blocks") for note in drawing.notes)
    assert any(note.startswith("joined:") for note in drawing.notes) == (miss != 0.0)
    # An end that reaches too far is one that misses. Neighbours meet: the wall has no gap and no overlap.
    assert shapely.union_all([shapely.Polygon(r) for r in drawing.outlines]).area == pytest.approx(0.6, rel=1e-6)


def test_strokes_cut_a_shape(tmp_path):
    strokes = "".join(f'<path d="M{x} {y}L{u} {v}"/>' for (x, y), (u, v) in LINES)
    path = svg(
        tmp_path, f'<g id="wall"><rect id="w" x="0" y="0" width="1000" height="600"/></g><g id="j">{strokes}</g>'
    )
    drawing = read_layout(path)
    assert sorted(shapely.Polygon(ring).area for ring in drawing.outlines) == pytest.approx(AREAS)
    assert set(drawing.groups) == {"wall"}
    assert len(read_layout(path, ignore="j").outlines) == 1


def test_strokes_alone_enclose_blocks(tmp_path):
    lines = [*LINES, ((0, 0), (1000, 0)), ((1000, 0), (1000, 600)), ((1000, 600), (0, 600)), ((0, 600), (0, 0))]
    strokes = "".join(f'<line x1="{x}" y1="{y}" x2="{u}" y2="{v}"/>' for (x, y), (u, v) in lines)
    drawing = read_layout(svg(tmp_path, f'<g id="wall">{strokes}</g>'))
    assert sorted(shapely.Polygon(ring).area for ring in drawing.outlines) == pytest.approx(AREAS)


def test_a_frame_around_loose_lines_is_not_cut(tmp_path):
    lines = [*LINES, ((0, 0), (1000, 0)), ((1000, 0), (1000, 600)), ((1000, 600), (0, 600)), ((0, 600), (0, 0))]

    def draw(space):
        space.add_lwpolyline([(-500, -500), (2000, -500), (2000, 1500), (-500, 1500)], close=True)
        for a, b in lines:
            space.add_line(a, b, dxfattribs={"layer": "joint"})

    drawing = read_layout(dxf(tmp_path, draw))
    assert drawing.n_blocks == 8
    assert any("1 frame or background around other blocks" in note for note in drawing.notes)


def test_ends_that_miss_by_a_ten_thousandth_meet_and_by_a_hundredth_do_not(tmp_path):
    def square(miss):
        return lambda space: [
            space.add_line(a, b)
            for a, b in (
                ((0, 0), (200, 0)),
                ((200, miss), (200, 100)),
                ((200, 100 + miss), (0, 100)),
                ((miss, 100), (0, miss)),
            )
        ]

    drawing = read_layout(dxf(tmp_path, square(0.015)))
    assert drawing.n_blocks == 1
    assert any(note.startswith("joined: ") and "up to 0.015" in note for note in drawing.notes)
    with pytest.raises(
        ValueError,
        match=r"found: 4 lines close nothing \(4 on layer '0'\); their ends are 2 to 2(\.\d+)? from the nearest",
    ):
        read(dxf(tmp_path, square(2.0)))


def arch(n, over, ring):
    """Radial lines of an arch of 1 to 1.2 m from 0° to 180°, which reach over both arcs; within a closed ring less."""
    angles = [math.pi * k / n for k in range(n + 1)][ring : n + (not ring)]
    return [[(r * math.cos(a) * 1000, r * math.sin(a) * 1000) for r in (1.0 - over, 1.2 + over)] for a in angles]


def arch_as_dxf(tmp_path, n, over, ring):
    def draw(space):
        if ring:
            corners = [(1000, 0, 0), (1200, 0, 1), (-1200, 0, 0), (-1000, 0, -1)]
            space.add_lwpolyline(corners, format="xyb", close=True)
        else:
            space.add_arc((0, 0), 1000, 0, 180)
            space.add_arc((0, 0), 1200, 0, 180)
        for a, b in arch(n, over, ring):
            space.add_line(a, b)

    return dxf(tmp_path, draw)


def arch_as_svg(tmp_path, n, over, ring):
    link = "L-1200 0" if ring else "M-1200 0"
    arcs = f'<path d="M1000 0A1000 1000 0 0 0 -1000 0{link}A1200 1200 0 0 1 1200 0{"Z" if ring else ""}"/>'
    lines = "".join(f'<line x1="{x}" y1="{-y}" x2="{u}" y2="{-v}"/>' for (x, y), (u, v) in arch(n, over, ring))
    return svg(tmp_path, arcs + lines, "-1300 -1300 2600 1300")


@pytest.mark.parametrize(
    ("over", "ring"), [(over, ring) for ring in (False, True) for over in (0.0, -1e-6, 1e-6, 1e-4)] + [(2e-3, False)]
)
@pytest.mark.parametrize("draw", [arch_as_dxf, arch_as_svg])
@pytest.mark.slow
def test_joints_that_end_on_an_arc_cut_it(tmp_path, draw, over, ring):
    for n in (5, 7, 15, 20, 25):
        drawing = read_layout(draw(tmp_path, n, over, ring))
        # The chords lie within a thousandth of the radius of the arcs.
        exact = math.pi / 2 * (1.2**2 - 1.0) / n
        areas = [shapely.Polygon(ring).area for ring in drawing.outlines]
        assert areas == pytest.approx([exact] * n, rel=5e-3)
        assert drawing.left_out == ()


def test_lines_between_two_circles_cut_the_ring(tmp_path):
    def draw(space):
        for radius in (1000, 1200):
            space.add_circle((0, 0), radius)
        for sign in (1, -1):
            for a, b in arch(9, 0.0, False)[:-1]:
                space.add_line((sign * a[0], sign * a[1]), (sign * b[0], sign * b[1]))

    path = dxf(tmp_path, draw)
    drawing = read_layout(path)
    assert drawing.n_blocks == 19
    assert any("18 blocks around 1 outline, a block too: ignore it by its name" in note for note in drawing.notes)
    areas = [shapely.Polygon(ring).area for ring in drawing.outlines]
    disc = drawing.names[areas.index(max(areas))]
    assert read_layout(path, ignore=[disc]).n_blocks == 18


@pytest.mark.parametrize("n", [7, 13, 23])
def test_joints_that_end_on_curves_of_coarse_chords_cut_them(tmp_path, n):
    def ellipses(space):
        for major in (3000, 3600):
            space.add_ellipse((0, 0), major_axis=(major, 0), ratio=0.6, start_param=0, end_param=math.pi)
        for a in (math.pi * k / n for k in range(n + 1)):
            space.add_line(*((r * math.cos(a), 0.6 * r * math.sin(a)) for r in (3000, 3600)))

    def wave(space):
        corners = [(0, 0), (1000, 2000), (3000, 3000), (5000, -1000), (8000, 1000)]
        for up in (0, 1500):
            space.add_open_spline([(x, y + up) for x, y in corners])
        for t in np.linspace(0, 1, n + 1):
            x, y, _ = BSpline(corners).point(t * BSpline(corners).max_t)
            space.add_line((x, y), (x, y + 1500))

    assert read_layout(dxf(tmp_path, ellipses), chord_tolerance=0.3).n_blocks == n
    assert read_layout(dxf(tmp_path, wave), chord_tolerance=0.1).n_blocks == n


@pytest.mark.parametrize(("below", "n", "start"), [(12, 7, 2.5), (20, 20, 0)])
@pytest.mark.parametrize("bed", [6, 10])
def test_rings_with_a_bed_of_mortar_between_them_do_not_touch(tmp_path, bed, below, n, start):
    def draw(space):
        rings = [(4500, 5000, below, 0), (5000 + bed, 5500, n, start)]
        for inner, outer, stones, first in rings:
            for radius in (inner, outer):
                space.add_arc((0, 0), radius, first, 180 - first)
            for k in range(stones + 1):
                a = math.radians(first + (180 - 2 * first) * k / stones)
                space.add_line(*((r * math.cos(a), r * math.sin(a)) for r in (inner, outer)))

    drawing = read_layout(dxf(tmp_path, draw))
    assert drawing.n_blocks == below + n
    part = math.radians(180 - 2 * start)
    mortar = part / 2 * ((5.0 + bed / 1000) ** 2 - 5.0**2)
    drawn = sum(shapely.Polygon(ring).area for ring in drawing.outlines)
    assert drawn == pytest.approx(math.pi / 2 * (5**2 - 4.5**2) + part / 2 * (5.5**2 - 5.0**2) - mortar, abs=0.02)


WINDOW = [((0, 300), (400, 300)), ((600, 300), (1000, 300)), ((500, 0), (500, 200)), ((500, 400), (500, 600))]


def windows(space, lines):
    for layer, box in (("wall", (0, 0, 1000, 600)), ("open", (400, 200, 600, 400)), ("open", (-9e4, -9e4, 9e4, 9e4))):
        x, y, u, v = box
        space.add_lwpolyline([(x, y), (u, y), (u, v), (x, v)], close=True, dxfattribs={"layer": layer})
    for a, b in lines:
        space.add_line(a, b, dxfattribs={"layer": "joints"})


def test_joints_that_end_on_an_ignored_opening_cut_what_is_around_it(tmp_path):
    # A line within the opening, as of its bars, is no joint.
    path = dxf(tmp_path, lambda space: windows(space, [*WINDOW, ((400, 200), (600, 400))]))
    shapes = '<rect id="wall" width="1000" height="600"/><rect id="open" x="400" y="200" width="200" height="200"/>'
    strokes = "".join(f'<path d="M{x} {y}L{u} {v}"/>' for (x, y), (u, v) in WINDOW)
    for drawing in (read_layout(path, ignore=["open"]), read_layout(svg(tmp_path, shapes + strokes), ignore=["open"])):
        assert [shapely.Polygon(ring).area for ring in drawing.outlines] == pytest.approx([0.14] * 4)
        assert "4 blocks; if they are no joints" in next(note for note in drawing.notes if note.startswith("cut:"))


def test_ignored_outlines_that_joints_cross_are_as_if_they_were_not_there(tmp_path):
    joints = [((0, 300), (1000, 300)), ((500, 0), (500, 600))]
    drawing = read_layout(dxf(tmp_path, lambda space: windows(space, joints)), ignore=["open"])
    assert [shapely.Polygon(ring).area for ring in drawing.outlines] == pytest.approx([0.15] * 4)


def test_joints_that_end_on_slanted_beds_cut_them(tmp_path):
    # Exact ends and beds, which a grid rounds apart.
    def at(x, y):
        return 1000 * x - 313 * y, 347 * x + 1000 * y

    cuts = [0, 0.137, 0.171, 0.3, 0.371, 0.42, 0.511, 0.6, 0.667, 0.7, 0.831, 0.88, 0.9, 1]
    lines = [(at(0, y), at(1, y)) for y in (0, 0.2)] + [(at(x, 0), at(x, 0.2)) for x in cuts]
    drawing = read_layout(dxf(tmp_path, lambda space: [space.add_line(a, b) for a, b in lines]))
    assert drawing.n_blocks == len(cuts) - 1
    assert not any("joined" in note for note in drawing.notes)


def test_stones_drawn_by_lines_close_beside_outlines(tmp_path):
    # A bed that misses the corner of a quoin is moved to it, and the head joints that end on it with it. A door that a
    # ground line alone closes is none.
    def draw(space):
        for y, right, miss in ((0, 900, 0.0), (200, 800, 0.08), (400, 900, 0.0)):
            quoin = [(right + miss / 2, y + miss), (900, y), (1000, y), (1000, y + 200), (right + miss / 2, y + 200)]
            space.add_lwpolyline(quoin, close=True)
            space.add_lwpolyline([(1900, y), (2200, y), (2200, y + 200), (1900, y + 200)], close=True)
            space.add_line((0, y), (800 if y else 2200, y))
            for x in (0, right - 500):
                space.add_line((x, y), (x, y + 200))
        space.add_line((0, 600), (900, 600))
        space.add_lwpolyline([(900, 600), (2200, 600), (2200, 800), (900, 800)], close=True)

    drawing = read_layout(dxf(tmp_path, draw))
    areas = [shapely.Polygon(ring).area for ring in drawing.outlines if np.max(ring[:, 0]) < 0.95]
    assert areas == pytest.approx([0.08, 0.06, 0.08] + [0.1] * 3, rel=1e-3)
    assert drawing.n_blocks == 6 + 7
    says = "6 blocks are faces between 10 loose lines, 3 of them beside outlines"
    assert any(note.startswith(says) for note in drawing.notes)
    assert not any("left out" in note for note in drawing.notes)
    # Where a second line closes the door it counts as a block, which the note names.
    shut = read_layout(dxf(tmp_path, lambda space: [draw(space), space.add_line((1000, 0), (1000, 600))]))
    door = shut.names[int(np.argmax([shapely.Polygon(ring).area for ring in shut.outlines]))]
    (note,) = (note for note in shut.notes if note.startswith(f"'{door}' around "))
    assert note.endswith(f'counts as a stone; leave out what is an opening: ignore = ["{door}"]')


def test_a_stone_beside_an_arc_is_on_the_layer_of_its_joints(tmp_path):
    # Most of its edges are chords of the extrados, most of its border is not.
    def draw(space):
        space.add_arc((0, 0), 500, 0, 90, dxfattribs={"layer": "RING"})
        for start, end in (((500, 0), (2000, 0)), ((2000, 0), (2000, 500)), ((2000, 500), (0, 500))):
            space.add_line(start, end, dxfattribs={"layer": "JOINTS"})

    drawing = read_layout(dxf(tmp_path, draw))
    assert len(drawing.outlines[0]) > 12
    assert drawing.groups == ("JOINTS",)


def pairs_of_lines(space, half, framed):
    """A wall of 6 courses with joints of twice ``half``; without a frame the beds are open at their ends."""
    if framed:
        space.add_lwpolyline([(0, 0), (3200, 0), (3200, 1200), (0, 1200)], close=True)
    else:
        for y in (0, 1200):
            space.add_line((0, y), (3200, y))
    sides = sorted({-half, half})
    for c in range(6):
        low, high = 200 * c + (half if c else 0), 200 * c + 200 - (half if c < 5 else 0)
        for x in range(200 if c % 2 else 400, 3200, 400):
            for side in sides:
                space.add_line((x + side, low), (x + side, high))
        for side in sides if c else ():
            space.add_line((0, 200 * c + side), (3200, 200 * c + side))
        if not framed:
            for x in (0, 3200):
                space.add_line((x, low), (x, high))


@pytest.mark.parametrize("framed", [True, False])
@pytest.mark.parametrize("half", [0, 5, 10])
@pytest.mark.slow
def test_mortar_drawn_as_pairs_of_lines_is_no_block(tmp_path, framed, half):
    path = dxf(tmp_path, lambda space: pairs_of_lines(space, half, framed))
    drawing = read_layout(path)
    assert drawing.n_blocks == 51
    mortar = [note for note in drawing.notes if note.startswith("mortar:")]
    strips = 50 if framed else 45
    assert [note[:34] for note in mortar] == [f"mortar: {strips} strips {2 * half} units wide be"[:34]] * (half > 0)
    assert [item.kind for item in drawing.left_out] == ["mortar"] * strips * (half > 0)
    with pytest.warns(UserWarning, match="mortar: ") if half else nullcontext():
        assembly = read(path, joint_thickness="auto")
    # The outermost courses are half a joint thicker where no frame closes the ends of the beds.
    assert assembly.areas.sum() == pytest.approx(3.84, rel=1e-3)
    if half:
        for only, n in (("*", 51 + strips), ("0", 51)):
            assert read_layout(path, only=only).n_blocks == n


def test_few_strips_between_lines_stay_blocks_and_are_told(tmp_path):
    levels = (0, 200, 400, 410, 610)
    lines = [((0, y), (1000, y)) for y in levels] + [((x, 0), (x, 610)) for x in (0, 1000)]
    lines += [((500, y), (500, y + 200)) for y in (0, 200, 410)]
    drawing = read_layout(dxf(tmp_path, lambda space: [space.add_line(a, b) for a, b in lines]))
    assert drawing.n_blocks == 7
    assert any(
        "mortar: 1 strip 10 units wide between larger faces, the first around (500, 405)" in note
        for note in drawing.notes
    )


def test_courses_of_tiles_between_stones_that_touch_stay_blocks_and_are_told(tmp_path):
    """Lines are single here: a course of tiles is as thin as mortar, but no stone is parted by it from its course."""
    lines, low = [((0, 0), (3000, 0))], 0
    for course in range(5):
        high, step = (40, 300) if course % 2 else (300, 500)
        lines += [((x, low), (x, low + high)) for x in range(0, 3001, step)]
        low += high
        lines.append(((0, low), (3000, low)))
    drawing = read_layout(dxf(tmp_path, lambda space: [space.add_line(a, b) for a, b in lines]))
    assert drawing.n_blocks == 3 * 6 + 2 * 10
    assert any("mortar: 20 strips 40 units wide" in note and "count as blocks" in note for note in drawing.notes)


def test_an_outline_whose_ends_miss_by_little_is_closed_with_a_note(tmp_path):
    ring = [(0, 0), (240, 0), (240, 65), (0, 65), (0, 0.01)]
    drawing = read_layout(dxf(tmp_path, lambda space: space.add_lwpolyline(ring)))
    assert drawing.n_blocks == 1
    assert any("joined: the ends of 1 outline, up to 0.01" in n for n in drawing.notes)


def test_where_nothing_closes_the_message_says_what_there_is(tmp_path):
    path = svg(tmp_path, '<g id="a"><path d="M0 0L100 0"/><path d="M103 0L200 50"/></g>')
    with pytest.raises(
        ValueError, match=r"no closed shape \(found: 2 lines close nothing \(2 on layer 'a'\); their ends are 3 to"
    ):
        read(path)


@pytest.mark.slow
def test_thousands_of_lines_close_their_cells(tmp_path):
    n = 25
    across = [((x, y), (x + 1, y)) for x in range(n) for y in range(n + 1)]
    lines = "".join(f"M{x} {y}L{u} {v}M{y} {x}L{v} {u}" for (x, y), (u, v) in across)
    assert read_layout(svg(tmp_path, f'<path d="{lines}"/>', f"0 0 {n} {n}")).n_blocks == n * n


def across(space, **of_axes):
    """Six stones in three courses, drawn by lines, and an upright axis across them on a layer of its own."""
    document = space.doc
    document.layers.add("axes", linetype=of_axes.pop("of_layer", "Continuous"))
    for y in (0, 200, 400, 600):
        space.add_line((0, y), (1000, y), {"layer": "wall"})
    for x, low, high in ((0, 0, 600), (1000, 0, 600), (500, 0, 200), (400, 200, 400), (500, 400, 600)):
        space.add_line((x, low), (x, high), {"layer": "wall"})
    space.add_line((250, -100), (250, 700), {"layer": "axes", **of_axes})


@pytest.mark.parametrize(
    "of_axes",
    [{"linetype": "CENTER"}, {"linetype": "DASHDOT2"}, {"of_layer": "PHANTOM"}, {"linetype": "TRATTO E PUNTO"}],
)
def test_lines_in_line_types_of_axes_are_no_joints(tmp_path, of_axes):
    document = ezdxf.new("R2010", setup=True)
    document.linetypes.add("TRATTO E PUNTO", [3.0, 2.0, -0.5, 0.0, -0.5])
    across(document.modelspace(), **of_axes)
    document.saveas(tmp_path / "a.dxf")
    drawing = read_layout(tmp_path / "a.dxf")
    assert drawing.n_blocks == 6
    assert any(n.startswith("left out: 1 line in the line type of an axis on layer 'axes'") for n in drawing.notes)
    # Who asks for its layer has it cut.
    assert read_layout(tmp_path / "a.dxf", only=["wall", "axes"]).n_blocks == 9


@pytest.mark.parametrize("linetype", ["Continuous", "DASHED"])
def test_layers_whose_lines_run_across_those_of_others_are_told(tmp_path, linetype):
    document = ezdxf.new("R2010", setup=True)
    across(document.modelspace(), linetype=linetype)
    document.saveas(tmp_path / "a.dxf")
    drawing = read_layout(tmp_path / "a.dxf")
    assert drawing.n_blocks == 9
    kind = " (DASHED)" if linetype == "DASHED" else ""
    says = (
        f"lines run across those of other layers: 1 line on layer 'axes'{kind} around 6 faces; leave them out (ignore)"
    )
    assert any(note.startswith(says) for note in drawing.notes)
    assert not any("run across" in note for note in read_layout(tmp_path / "a.dxf", ignore="axes").notes)


def test_axes_of_inserted_blocks_are_no_joints_either(tmp_path):
    document = ezdxf.new("R2010", setup=True)
    across(document.blocks.new("wall"), linetype="BYBLOCK")
    document.modelspace().add_blockref("wall", (0, 0), dxfattribs={"linetype": "CENTER"})
    document.saveas(tmp_path / "a.dxf")
    assert read_layout(tmp_path / "a.dxf").n_blocks == 6


def test_strokes_of_dashes_and_dots_are_no_joints(tmp_path):
    frame = '<path d="M0 0H1000M1000 0V600M1000 600H0M0 600V0" stroke="red"/>'
    for dashes, n in (("8 2 0 2", 1), ("8 2", 2), ("none", 2)):
        axis = f'<g stroke-dasharray="{dashes}" id="axes"><path d="M250 -9V700" stroke="red"/></g>'
        assert read_layout(svg(tmp_path, frame + axis)).n_blocks == n


def test_an_outline_that_is_asked_for_by_its_name_is_not_cut_unless_a_piece_is_asked_for_too(tmp_path):
    def draw(space):
        for x in (0, 3000):
            space.add_lwpolyline([(x, 0), (x + 2000, 0), (x + 2000, 1000), (x, 1000)], close=True)
        space.add_line((1000, 0), (1000, 1000))

    path = dxf(tmp_path, draw)
    whole, left, right = read_layout(path).names
    cut = left.removesuffix(".0")
    assert right == f"{cut}.1"
    for only in ([cut], [whole], [whole, left]):
        assert sorted(read_layout(path, only=only).names) == sorted(only)
