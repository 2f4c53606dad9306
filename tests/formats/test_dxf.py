"""DXF as drawing programs write it, R12 to R2018."""

import itertools
import math

import ezdxf
import numpy as np
import pytest
import shapely
from structures import drawn

from blockvis import inspect, read, read_layout, write_layout
from blockvis.cli import main

SQUARE = [(0, 0), (1, 0), (1, 1), (0, 1)]


def saved(tmp_path, draw, version="R2010"):
    document = ezdxf.new(version)
    document.header["$INSUNITS"] = 6
    draw(document, document.modelspace())
    path = tmp_path / "a.dxf"
    document.saveas(path)
    return path


@pytest.mark.parametrize("version", ["R12", "R2000", "R2004", "R2007", "R2010", "R2013", "R2018"])
def test_versions(tmp_path, version):
    def draw(document, space):
        space.add_polyline2d(SQUARE, close=True, dxfattribs={"layer": "stone"})
        space.add_polyline2d([*((x + 2, y) for x, y in SQUARE), (2, 0)], dxfattribs={"layer": "fixed"})

    assembly = read(saved(tmp_path, draw, version))
    assert assembly.materials == ("stone", "fixed")
    assert assembly.roles.tolist() == ["free", "fixed"]
    assert assembly.areas.tolist() == [1.0, 1.0]


def test_a_binary_file_is_that_of_text(tmp_path):
    document = ezdxf.new("R2010", units=6)
    document.modelspace().add_lwpolyline([(0, 0), (1, 0), (1, 1)], close=True)
    document.saveas(tmp_path / "a.dxf", fmt="bin")
    assert read_layout(tmp_path / "a.dxf").n_blocks == 1
    (tmp_path / "a.dxf").write_bytes((tmp_path / "a.dxf").read_bytes()[:900])
    with pytest.raises(ValueError, match="is not a readable DXF file"):
        read_layout(tmp_path / "a.dxf")


def test_bulges_and_hatches_become_chords(tmp_path):
    def draw(document, space):
        space.add_lwpolyline([(0, 0), (1, 0, 0, 0, 1.0), (1, 1), (0, 1)], close=True)
        hatch = space.add_hatch()
        edge = hatch.paths.add_edge_path()
        edge.add_line((3, 0), (4, 0))
        edge.add_arc((3.5, 0), 0.5, 0, 180)
        space.add_circle((6, 0), 0.5)

    path = saved(tmp_path, draw)
    coarse, fine = (read(path, chord_tolerance=t) for t in (1e-2, 1e-5))
    exact = np.pi * np.array([1 / 8, 1 / 8, 1 / 4]) + [1, 0, 0]
    assert fine.areas[[0, 2]] == pytest.approx(exact[[0, 2]], rel=1e-4)
    assert fine.areas[1] == pytest.approx(exact[1], rel=1e-3)
    assert (np.abs(coarse.areas - exact) < 0.05).all()
    assert len(fine.vertices) > 3 * len(coarse.vertices)


def sector(begin, end, inner, outer):
    """Corners (x, y, bulge) of a voussoir, angles in degrees."""
    bulge = math.tan(math.radians(end - begin) / 4.0)
    places = ((inner, begin, 0.0), (outer, begin, bulge), (outer, end, 0.0), (inner, end, -bulge))
    return [(r * math.cos(math.radians(a)), r * math.sin(math.radians(a)), b) for r, a, b in places]


#: Cuts [degrees] of two rings of voussoirs.
CUTS = ((1.0, 1.3, range(0, 181, 20)), (1.3, 1.6, (0, 13, 29, 47, 61, 83, 104, 127, 150, 163, 180)))


def two_rings(document, space, **attributes):
    # A spandrel stone has a corner on the outer circle, and its border along it.
    corners = [(0, 1.6, -math.tan(math.radians(50) / 4.0)), (*sector(40, 90, 1.6, 2)[0][:2], 0), (2, 1.9), (0, 1.9)]
    space.add_lwpolyline(corners, format="xyb", close=True, dxfattribs=attributes)
    for inner, outer, cuts in CUTS:
        for begin, end in itertools.pairwise(cuts):
            space.add_lwpolyline(sector(begin, end, inner, outer), format="xyb", close=True, dxfattribs=attributes)


def turned_over(document, space):
    two_rings(document, space, extrusion=(0, 0, -1))


def upright(document, space):
    two_rings(document, space, extrusion=(0, -1, 0))


def hatched(document, space):
    for inner, outer, cuts in CUTS:
        for begin, end in itertools.pairwise(cuts):
            space.add_hatch().paths.add_polyline_path(sector(begin, end, inner, outer), is_closed=True)


def hatched_by_edges(document, space):
    """Boundaries of lines and arcs, which begin anywhere and of which some turn the other way."""
    for inner, outer, cuts in CUTS:
        for number, (begin, end) in enumerate(itertools.pairwise(cuts)):
            path = space.add_hatch().paths.add_edge_path()
            a, b, c, d = ((x, y) for x, y, _ in sector(begin, end, inner, outer))
            for k in range(number, number + 4):
                if k % 4 == 0:
                    path.add_line(a, b)
                elif k % 4 == 1:
                    path.add_arc((0, 0), outer, begin, end)
                elif k % 4 == 2:
                    path.add_line(*((c, d) if number % 2 else (d, c)))
                elif number % 3:
                    path.add_arc((0, 0), inner, begin, end, ccw=number % 2 == 0)
                else:
                    path.add_ellipse((0, 0), (0, inner), 1.0, begin - 90, end - 90)


def stretched(document, space):
    block = document.blocks.new("rings")
    two_rings(document, block)
    space.add_blockref("rings", (3.0, 1.0), dxfattribs={"xscale": 1.5, "rotation": 20.0})


@pytest.mark.parametrize("draw", [two_rings, turned_over, upright, hatched, hatched_by_edges, stretched])
@pytest.mark.parametrize("chord_tolerance", [None, pytest.param(1e-4, marks=pytest.mark.thorough)])
def test_outlines_cut_at_other_places_of_a_circle_share_its_chords(tmp_path, draw, chord_tolerance):
    layout = read_layout(saved(tmp_path, draw), chord_tolerance=chord_tolerance)
    shapes = [shapely.Polygon(ring) for ring in layout.outlines]
    union = shapely.union_all(shapes, grid_size=1e-12)
    # Without overlaps and gaps between the rings.
    assert union.area == pytest.approx(sum(shape.area for shape in shapes), abs=1e-11)
    assert not union.interiors
    cuts = 0.5 * math.pi * (1.6**2 - 1.0)
    if draw in (hatched, hatched_by_edges):
        assert union.area == pytest.approx(cuts, rel=2e-3 if chord_tolerance is None else 1e-4)


def test_a_circle_gets_the_corners_of_what_lies_against_it(tmp_path):
    def draw(document, space):
        space.add_circle((0, 0), 1.0)
        ring = [sector(a, a + 50, 1.0, 2.0)[0] for a in (203, 153)]
        space.add_lwpolyline([*ring, (-2, 2), (-2, -2)], format="xyb", close=True)
        space.add_lwpolyline([(1, -1), (2, -1), (2, 1), (1, 1)], close=True)
        space.add_line((-3, 0), (-3, 1))

    circle = read_layout(saved(tmp_path, draw)).outlines[0]
    at = np.radians([153, 203])
    wanted = np.stack([np.cos(at), np.sin(at)], axis=1)
    assert np.hypot(*(circle[:, None] - wanted).T).min(axis=1) == pytest.approx([0.0, 0.0], abs=1e-12)
    # All other chords are within a thousandth of the radius, and no corner stands beside another.
    assert np.hypot(*(circle - np.roll(circle, 1, axis=0)).T).max() < 0.09
    assert np.hypot(*circle.T) == pytest.approx(1.0)


def test_a_hatch_on_its_own_outline_is_one_block(tmp_path):
    def draw(document, space):
        space.add_lwpolyline(SQUARE, close=True)
        space.add_hatch().paths.add_polyline_path(SQUARE)

    assert read(saved(tmp_path, draw)).n_blocks == 1


def test_inserted_blocks(tmp_path):
    def draw(document, space):
        brick = document.blocks.new("brick")
        brick.add_lwpolyline(SQUARE, close=True, dxfattribs={"layer": "brick"})
        pair = document.blocks.new("pair")
        pair.add_blockref("brick", (0, 0))
        pair.add_blockref("brick", (1.5, 0), dxfattribs={"xscale": 2})
        space.add_blockref("pair", (0, 10), dxfattribs={"rotation": 90})
        space.add_blockref("brick", (20, 0), dxfattribs={"column_count": 3, "column_spacing": 2})

    assembly = read(saved(tmp_path, draw))
    assert sorted(assembly.areas) == pytest.approx([1, 1, 1, 1, 2])
    assert set(assembly.materials) == {"brick"}


def test_turned_blocks_in_a_stretched_one_are_sheared(tmp_path):
    def draw(document, space):
        document.blocks.new("stone").add_lwpolyline(SQUARE, close=True)
        document.blocks.new("disc").add_circle((0, 0), 1)
        group = document.blocks.new("group", base_point=(1, 1))
        group.add_blockref("stone", (1, 1), dxfattribs={"rotation": 45, "column_count": 2, "column_spacing": 3})
        group.add_blockref("stone", (5, 1), dxfattribs={"rotation": 90, "xscale": 2})
        group.add_blockref("disc", (9, 1), dxfattribs={"rotation": 30})
        space.add_blockref("group", (10, 0), dxfattribs={"xscale": 3, "yscale": 1})

    first, second, tall, round_ = read_layout(saved(tmp_path, draw)).outlines
    half = math.sqrt(0.5)
    corners = np.array([(10, 0), (10 + 3 * half, half), (10, 2 * half), (10 - 3 * half, half)])
    assert first == pytest.approx(corners)
    assert second == pytest.approx(corners + np.array([9 * half, 3 * half]))
    assert tall == pytest.approx(np.array([(22, 0), (22, 2), (19, 2), (19, 0)]))
    assert np.ptp(round_, axis=0) == pytest.approx([6, 2], rel=1e-2)


def test_loose_lines_enclose_blocks(tmp_path):
    def draw(document, space):
        for a, b in [((0, 0), (2, 0)), ((2, 0), (2, 1)), ((2, 1), (0, 1)), ((0, 1), (0, 0)), ((1, 0), (1, 1))]:
            space.add_line(a, b, dxfattribs={"layer": "stone"})
        space.add_line((5, 5), (6, 6))

    drawing = read_layout(saved(tmp_path, draw))
    assert drawing.groups == ("stone", "stone")
    assert any("2 blocks are faces between 6 loose lines" in note for note in drawing.notes)
    assert any("left out: 1 line that closes no outline on layer '0'" in note for note in drawing.notes)


def test_open_polyline_names_layer_handle_and_gap(tmp_path):
    def draw(document, space):
        space.add_lwpolyline([(0, 0), (1, 0), (1, 1), (0, 0.25)], dxfattribs={"layer": "stone", "handle": "AB"})

    with pytest.raises(
        ValueError,
        match=r"polyline AB on layer 'stone' is open: it starts at \(0, 0\) and ends at \(0, 0.25\), 0.25 apart",
    ):
        read(saved(tmp_path, draw))


def test_kinds_that_ezdxf_does_not_know_are_skipped_with_a_note(tmp_path):
    """Walls of AutoCAD Architecture are such: they ended in a traceback, as they have no layer for ezdxf."""

    def draw(document, space):
        space.add_lwpolyline(SQUARE, close=True)
        space.add_point((0, 0))

    path = saved(tmp_path, draw)
    text = path.read_text(encoding="utf-8")
    path.write_text(
        text.replace("\nPOINT\n", "\nAEC_WALL\n").replace("\nAcDbPoint\n", "\nAecDbWall\n"), encoding="utf-8"
    )
    drawing = read_layout(path)
    assert drawing.n_blocks == 1
    assert "skipped: 1 AEC_WALL" in drawing.notes


def test_hidden_layers_and_texts_are_skipped_with_a_note(tmp_path):
    def draw(document, space):
        document.layers.add("old").off()
        space.add_lwpolyline(SQUARE, close=True, dxfattribs={"layer": "old"})
        space.add_lwpolyline([(x + 3, y) for x, y in SQUARE], close=True)
        space.add_text("section A-A")

    drawing = read_layout(saved(tmp_path, draw))
    assert drawing.n_blocks == 1
    assert "skipped: 1 TEXT" in drawing.notes
    assert "skipped on layers that are off or frozen: 1 on 'old'" in drawing.notes


@pytest.mark.parametrize(
    ("points", "message"),
    [
        ([(0, 0), (1, 1), (1, 0), (0, 2)], "crosses itself"),
        ([(0, 0), (2e9, 0), (2e9, 2e9), (0, 1)], r"has a coordinate of 2e\+09 m"),
        ([(0, 0), (float("nan"), 0), (1, 1)], "coordinates must be finite"),
        ([(0, 0), (1, 0), (2, 0), (3, 0)], "is a line, not a block"),
    ],
)
def test_refused_outlines(tmp_path, points, message):
    path = saved(tmp_path, lambda document, space: space.add_lwpolyline(points, close=True))
    with pytest.raises(ValueError, match=message):
        read(path)


def test_a_hatch_with_an_island_is_a_hole(tmp_path):
    def draw(document, space):
        hatch = space.add_hatch()
        hatch.paths.add_polyline_path([(3 * x, 3 * y) for x, y in SQUARE])
        hatch.paths.add_polyline_path([(1 + x, 1 + y) for x, y in SQUARE])

    with pytest.raises(ValueError, match=r"HATCH \w+ on layer '0' has a hole around \(1.5, 1.5\)"):
        read(saved(tmp_path, draw))


@pytest.mark.thorough
def test_a_small_file_cannot_ask_for_a_million_blocks(tmp_path):
    def draw(document, space):
        document.blocks.new("b0").add_lwpolyline(SQUARE, close=True)
        for k in range(1, 9):
            block = document.blocks.new(f"b{k}")
            for _ in range(10):
                block.add_blockref(f"b{k - 1}", (0, 0))
        space.add_blockref("b8", (0, 0))

    path = saved(tmp_path, draw)
    with pytest.raises(ValueError, match=r"inserts more than \d+ entities, though it has \d+ bytes only"):
        read(path)


def test_no_outline(tmp_path):
    path = saved(tmp_path, lambda document, space: space.add_text("nothing"))
    with pytest.raises(ValueError, match=r"has no closed outline in its model space \(found: 1 TEXT\)"):
        read(path)


def test_inserts_with_a_z_scale_of_zero(tmp_path):
    """As QCAD writes them."""

    def draw(document, space):
        stone = document.blocks.new("stone")
        stone.add_lwpolyline(SQUARE, close=True)
        for k in range(2):
            space.add_blockref("stone", (2 * k, 0), dxfattribs={"xscale": 2, "yscale": 1, "zscale": 0})

    assembly = read(saved(tmp_path, draw))
    assert assembly.areas.tolist() == [2.0, 2.0]
    assert assembly.centroids.tolist() == [[1.0, 0.5], [3.0, 0.5]]


def test_a_drawing_that_stands_upright(tmp_path):
    def draw(document, space):
        for k in range(2):
            space.add_polyline3d([(x + k, 5, z) for x, z in SQUARE], close=True)

    path = saved(tmp_path, draw)
    layout = read_layout(path)
    assert any("stands upright: its (x, z) were read as (x, y)" in note for note in layout.notes)
    assert not any("elevations" in note for note in layout.notes)
    assert read(path, view="xz").areas == pytest.approx([1, 1])
    with pytest.raises(ValueError, match="lies in xz: seen as xy it has no area"):
        read(path, view="xy")


def test_an_upright_drawing_keeps_its_lengths_at_any_angle_and_with_relief(tmp_path):
    """A wall at 60° to x, and one traced on a scan, are no plans, nor are their widths those seen along an axis."""

    def turned(document, space):
        for x in (0, 1):
            corners = [(x, 0), (x + 1, 0), (x + 1, 2), (x, 2)]
            space.add_polyline3d([(450000 + 0.5 * u, 5400000 + 0.75**0.5 * u, z) for u, z in corners], close=True)

    def traced(document, space):
        off = iter(0.01 * np.random.default_rng(1).uniform(-1, 1, 8))
        for x in (0, 1):
            space.add_polyline3d([(x + u, next(off), z) for u, z in [(0, 0), (1, 0), (1, 2), (0, 2)]], close=True)

    def slanting(document, space):
        space.add_polyline3d([(0, 0, 0), (2, 0, 0.5), (2, 2, 1), (0, 2, 0.5)], close=True)

    for view in (None, "xz", "yz"):
        assert read(saved(tmp_path, turned), view=view).areas == pytest.approx([2, 2])
        assert read(saved(tmp_path, traced), view=view).areas == pytest.approx([2, 2])
    notes = " ".join(read_layout(saved(tmp_path, turned)).notes)
    assert "stands upright at 60° to x" in notes
    assert not {"relief", "elevations"} & set(notes.split())
    assert "its relief of 0.0" in " ".join(read_layout(saved(tmp_path, traced)).notes)
    layout = read_layout(saved(tmp_path, slanting), view="xz")
    assert any("elevations were ignored: the drawing was read as seen along y" in note for note in layout.notes)


@pytest.mark.parametrize("suffix", [".dxf", ".svg"])
def test_a_thickness_that_we_wrote_stays_when_the_drawing_is_scaled(tmp_path, suffix):
    """It is in metres beside the geometry, whatever unit somebody gives the drawing."""
    path = tmp_path / f"a{suffix}"
    write_layout(read_layout(drawn(tmp_path / "a.json", [np.array(SQUARE)], thickness=[0.5])), path)
    if suffix == ".dxf":
        document = ezdxf.readfile(path)
        for entity in document.modelspace():
            entity.scale_uniform(1000.0)
        document.header["$INSUNITS"] = 4
        document.saveas(path)
    again = read_layout(path, unit="mm")
    assert (again.unit, again.thickness.tolist()) == ("mm", [0.5])
    assert "thickness       0.5 m" in str(inspect(path, unit="mm"))


@pytest.mark.parametrize("suffix", [".dxf", ".svg"])
def test_pieces_of_a_stone_that_we_wrote_keep_what_we_wrote_of_it(tmp_path, suffix):
    path = tmp_path / f"a{suffix}"
    write_layout(read_layout(drawn(tmp_path / "a.json", [np.array(SQUARE)], role=["fixed"], group=["pier"])), path)
    if suffix == ".dxf":
        document = ezdxf.readfile(path)
        document.modelspace().add_line((0.5, 0.0), (0.5, 1.0))
        document.saveas(path)
    else:
        text = path.read_text(encoding="utf-8")
        line = '<line x1="0.5" y1="0" x2="0.5" y2="-1" stroke="black"/>'
        path.write_text(text.replace("</svg>", f"{line}</svg>"), encoding="utf-8")
    layout = read_layout(path)
    assert (layout.roles, layout.groups) == (("fixed",) * 2, ("pier",) * 2)


def test_level_outlines_are_a_plan_or_drawing_in_xy_wherever_one_of_them_lies(tmp_path):
    """A long course with a stray elevation is no upright drawing."""

    def draw(document, space):
        for k in range(20):
            corners = [(0.5 * k, 0), (0.5 * k + 0.5, 0), (0.5 * k + 0.5, 0.3), (0.5 * k, 0.3)]
            space.add_polyline3d([(x, y, 10.0 * (k == 3)) for x, y in corners], close=True)

    layout = read_layout(saved(tmp_path, draw))
    assert np.ptp(layout.points, axis=0) == pytest.approx([10.0, 0.3])
    assert any("elevations were ignored" in note for note in layout.notes)


@pytest.mark.parametrize("chosen", [{"only": "facade"}, {"ignore": "PLAN"}, {"ignore": ["PLAN", "#ff0000"]}])
def test_what_is_not_wanted_does_not_decide_how_a_drawing_lies(tmp_path, chosen):
    """A façade at 60° to x beside the plan of its house, an outline and a line: 1 m wide, and not half of it."""

    def draw(document, space):
        for low in (0.0, 0.5):
            corners = [(0, low), (1, low), (1, low + 0.5), (0, low + 0.5)]
            points = [(0.5 * u, 0.75**0.5 * u, z) for u, z in corners]
            space.add_polyline3d(points, close=True, dxfattribs={"layer": "facade"})
        plan = [(5 * x, 4 * y, 0) for x, y in SQUARE]
        space.add_polyline3d(plan, close=True, dxfattribs={"layer": "PLAN"})
        space.add_line((0, 2), (5, 2), dxfattribs={"layer": "PLAN"})
        space.add_line((0, 3), (5, 3), dxfattribs={"layer": "PLAN", "color": 1})

    layout = read_layout(saved(tmp_path, draw), **chosen)
    assert np.ptp(np.concatenate(layout.outlines), axis=0) == pytest.approx([1.0, 1.0])
    notes = " ".join(layout.notes)
    assert "stands upright at 60° to x" in notes
    assert "elevations" not in notes


@pytest.mark.parametrize("chosen", [{"only": "block *"}, {"ignore": "line *"}])
@pytest.mark.parametrize("level", [True, False])
def test_loose_lines_beside_outlines_that_are_asked_for_by_name_do_not_decide_how_a_drawing_lies(
    tmp_path, chosen, level
):
    """A façade at 60° to x beside the lines of a plan, or of a section along x."""

    def draw(document, space):
        for low in (0.0, 0.5):
            corners = [(0, low), (1, low), (1, low + 0.5), (0, low + 0.5)]
            space.add_polyline3d([(0.5 * u, 0.75**0.5 * u, z) for u, z in corners], close=True)
        ring = [(5 * x, 4 * y, 0) if level else (5 * x, 0, 4 * y) for x, y in SQUARE]
        for k in range(4):
            space.add_line(ring[k], ring[(k + 1) % 4])

    layout = read_layout(saved(tmp_path, draw), **chosen)
    assert np.ptp(np.concatenate(layout.outlines), axis=0) == pytest.approx([1.0, 1.0])
    assert layout.n_blocks == 2


def test_faults_of_a_file_are_noted_and_not_printed(tmp_path, capfd):
    def draw(document, space):
        space.add_lwpolyline(SQUARE, close=True)
        space.add_text("north", dxfattribs={"style": "not there"})

    layout = read_layout(saved(tmp_path, draw))
    assert layout.n_blocks == 1
    assert any("repaired or passed over: 1 fault of the file" in note for note in layout.notes)
    assert capfd.readouterr() == ("", "")


def test_what_a_block_draws_on_layer_0_lies_where_it_is_inserted(tmp_path):
    def draw(document, space):
        document.layers.add("gone").freeze()
        document.layers.add("dark").off()
        block = document.blocks.new("stone")
        block.add_lwpolyline(SQUARE, close=True)
        own = document.blocks.new("own")
        own.add_lwpolyline(SQUARE, close=True, dxfattribs={"layer": "granite"})
        nested = document.blocks.new("nested")
        nested.add_blockref("stone", (0, 0))
        for x, (name, layer) in enumerate(
            [
                ("stone", "brick"),
                ("own", "brick"),
                ("nested", "fixed"),
                ("stone", "gone"),
                ("own", "gone"),
                ("stone", "dark"),
            ]
        ):
            space.add_blockref(name, (2 * x, 0), dxfattribs={"layer": layer})

    path = saved(tmp_path, draw)
    assert "skipped on layers that are off or frozen: 2 on 'gone', 1 on 'dark'" in read_layout(path).notes
    with pytest.warns(UserWarning, match="skipped on layers that are off or frozen"):
        assembly = read(path)
    assert assembly.materials == ("brick", "granite", "fixed")
    assert assembly.roles.tolist() == ["free", "free", "fixed"]


def test_a_spline_of_degree_one_is_straight(tmp_path):
    def draw(document, space):
        space.add_open_spline([*((x, y, 0) for x, y in SQUARE), (0, 0, 0)], degree=1)

    assert read(saved(tmp_path, draw)).areas.tolist() == pytest.approx([1.0])
    assert len(read(saved(tmp_path, draw)).vertices) == 4


@pytest.mark.parametrize("degree", [2, pytest.param(3, marks=pytest.mark.thorough)])
@pytest.mark.parametrize("rational", [False, True])
def test_closed_splines_with_the_knots_of_a_period_are_those_drawn(tmp_path, degree, rational):
    oval = [(0, 0), (5, 0), (5.5, 2.5), (5, 5), (0, 5), (-0.5, 2.5)]
    weights = [1.0, 1.5, 1.0, 0.8, 1.0, 1.0]
    curve = ezdxf.math.closed_uniform_bspline(oval, order=degree + 1, weights=weights if rational else None)

    def draw(document, space):
        space.add_spline().apply_construction_tool(curve).dxf.flags = 11
        hatch = space.add_hatch(dxfattribs={"layer": "hatch"})
        edge = hatch.paths.add_edge_path().add_spline(
            control_points=[(p.x + 20, p.y) for p in curve.control_points], degree=degree, knot_values=curve.knots(),
            weights=curve.weights() or None, periodic=1,
        )  # fmt: skip
        assert edge.is_valid()

    exact = shapely.Polygon([(p.x, p.y) for p in curve.approximate(800)])
    layout = read_layout(saved(tmp_path, draw), chord_tolerance=1e-4)
    for outline, x in zip(layout.outlines, (0.0, 20.0), strict=True):
        read_as = shapely.Polygon(outline - [x, 0.0])
        assert shapely.symmetric_difference(read_as, exact).area < 1e-3 * exact.area


def test_convert_writes_what_is_drawn_twice_once(tmp_path, capsys):
    def draw(document, space):
        for x in (0, 1, 0):
            space.add_lwpolyline([(x + u, v) for u, v in SQUARE], close=True)

    path = saved(tmp_path, draw)
    assert main(["convert", str(path), str(tmp_path / "b.json")]) == 0
    out, err = capsys.readouterr()
    assert out.startswith("2 blocks written to")
    assert "note: 1 of 3 blocks is drawn twice and was dropped: 'block " in err
    assert read_layout(tmp_path / "b.json").n_blocks == 2
    assert main(["convert", str(path), str(tmp_path / "c.json"), "--ignore", "0"]) == 2


def test_faces_of_lines_are_noted_where_they_are_analysed(tmp_path):
    def draw(document, space):
        corners = [*SQUARE, SQUARE[0]]
        for start, end in itertools.pairwise(corners):
            space.add_line(start, end)

    with pytest.warns(UserWarning, match="1 block is a face between 4 loose lines; an opening enclosed by lines"):
        read(saved(tmp_path, draw))


def test_a_hatch_of_many_areas_loses_those_with_a_hole_alone(tmp_path):
    stone = [(0, 0), (1, 0), (1, 0.3), (0.5, 0.3), (0.5, 0.6), (0, 0.6)]
    in_its_notch = [(0.5, 0.3), (1, 0.3), (1, 0.6), (0.5, 0.6)]
    holed = [(2 + x, y) for x, y in SQUARE]

    def draw(document, space):
        hatch = space.add_hatch()
        for ring in (stone, in_its_notch, holed):
            hatch.paths.add_polyline_path(ring)
        # A hole, and in it a stone.
        for size in (0.8, 0.4):
            hatch.paths.add_polyline_path([(2.5 + size * (x - 0.5), 0.5 + size * (y - 0.5)) for x, y in SQUARE])

    layout = read_layout(saved(tmp_path, draw))
    areas = [shapely.Polygon(ring).area for ring in layout.outlines]
    assert areas == pytest.approx([0.45, 0.15, 0.16])
    assert [(item.kind, len(item.holes)) for item in layout.left_out] == [("hole", 1)]


@pytest.mark.parametrize(("code", "metres"), [(21, 0.3048), (15, 10.0), (9, 0.0254e-3), (6, 1.0)])
def test_every_unit_of_the_header_is_read(tmp_path, code, metres):
    def draw(document, space):
        document.header["$INSUNITS"] = code
        space.add_lwpolyline([(x / metres, y / metres) for x, y in SQUARE], close=True)

    layout = read_layout(saved(tmp_path, draw))
    assert layout.outlines[0].max(axis=0) == pytest.approx([1.0, 1.0])
    assert not any("does not say its unit" in note for note in layout.notes)


def test_a_unit_of_the_header_that_is_not_known_is_told_in_a_run(tmp_path):
    def draw(document, space):
        document.header["$INSUNITS"] = 30
        space.add_lwpolyline(SQUARE, close=True)

    with pytest.warns(UserWarning, match=r"the file states unit 30 \(\$INSUNITS\), which is not known"):
        read(saved(tmp_path, draw))


def test_what_is_invisible_or_in_another_file_is_counted(tmp_path):
    def draw(document, space):
        space.add_lwpolyline(SQUARE, close=True)
        space.add_lwpolyline([(x + 1, y) for x, y in SQUARE], close=True, dxfattribs={"invisible": 1})
        document.blocks.new("stone").add_lwpolyline([(x + 2, y) for x, y in SQUARE], close=True)
        space.add_blockref("stone", (0, 0), dxfattribs={"invisible": 1})
        document.add_xref_def("wall.dwg", "WALL")
        space.add_blockref("WALL", (3, 0))

    layout = read_layout(saved(tmp_path, draw))
    assert layout.n_blocks == 1
    left = "skipped: 1 invisible LWPOLYLINE, 1 invisible INSERT, 1 reference to another file ('WALL')"
    assert left in layout.notes
