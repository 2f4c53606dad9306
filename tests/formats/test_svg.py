"""SVG: shapes, paths, transforms, layers, units; and what is refused."""

import itertools
import math

import numpy as np
import pytest
import shapely

import solver
from blockvis import read, read_layout, save_layout


def saved(tmp_path, body, head='width="2000mm" height="1000mm" viewBox="0 0 2000 1000"'):
    path = tmp_path / "a.svg"
    path.write_text(f'<svg xmlns="http://www.w3.org/2000/svg" {head}>{body}</svg>', encoding="utf-8")
    return path


def test_shapes_layers_and_units(tmp_path):
    path = saved(
        tmp_path,
        """<g id="stone" transform="translate(100,0) scale(2)"><rect x="0" y="0" width="100" height="50"/>
        <g transform="rotate(90 600 0)"><polygon id="tri" points="600,0 650,0 650,50"/></g></g>
        <g id="fixed"><polyline points="0,500 100,500 100,600 0,600 0,500"/></g>
        <circle cx="500" cy="800" r="100"/>""",
    )
    drawing = read_layout(path)
    assert drawing.unit == "mm"
    assert drawing.groups == ("stone", "stone", "fixed", "")
    assembly = read(path, chord_tolerance=1e-5)
    assert assembly.names[1] == "tri"
    assert assembly.roles.tolist() == ["free", "free", "fixed", "free"]
    assert assembly.areas == pytest.approx([0.02, 0.005, 0.01, np.pi * 0.01], rel=1e-3)
    # y points up: the rectangle hangs below the line y = 0 of the page's top.
    assert assembly.outline(0)[:, 1].min() == pytest.approx(-0.1)
    assert assembly.centroids[2] == pytest.approx([0.05, -0.55])


@pytest.mark.parametrize(
    ("d", "area"),
    [
        ("M0 0 L100 0 L100 100 L0 100 Z", 1e4),
        ("m0,0 100,0 0,100 -100,0z", 1e4),
        ("M0 0H100V100H0Z", 1e4),
        ("M0 0h100v100h-100z", 1e4),
        ("M0 0 L100 0 L100 100 L0 100 L0 0", 1e4),
        ("M0,0 A50,50 0 0 1 100,0 Z", np.pi * 1250),
        ("M0,0 a50,50 0 0 0 100,0 z", np.pi * 1250),
        ("M0 0a50 50 0 00100 0z", np.pi * 1250),
        ("M0,0A50,50,0,01,1e2,0Z", np.pi * 1250),
        ("M0 0 Q50 100 100 0 Z", 1e4 / 3),
        ("M0 0 q25 50 50 50 t50 -50 Z", 1e4 / 3),
        ("M0 0 C0 100 100 100 100 0 Z", 6000.0),
        ("M-50 0 C-50 50 0 50 0 0 S50 -50 50 0 L50 -100 L-50 -100 Z", 1e4),
    ],
)
def test_paths(tmp_path, d, area):
    path = saved(tmp_path, f'<path d="{d}"/>', 'viewBox="0 0 1 1"')
    assert read(path, chord_tolerance=1e-3).areas[0] == pytest.approx(area, rel=1e-4)


@pytest.mark.parametrize(
    ("body", "message"),
    [
        (
            '<g id="wall"><path id="q" d="M0 0 L1 0 L1 1"/></g>',
            r"polyline q on layer 'wall' is open: .* \(1, 1\), 1.414 apart",
        ),
        ('<path d="M0 0 L3 0 L3 3 L0 3Z M1 1 L2 1 L2 2 L1 2Z"/>', r"has a hole around \(1.5, 1.5\)"),
        ('<path d="M0 0 L3 3 L3 0 L0 4Z"/>', "crosses itself"),
        ('<path d="M0 0 L3"/>', "too few numbers"),
        ('<polygon points="0 0 1 1 2"/>', "has 5 coordinates, an odd number"),
        ('<rect width="9em" height="1"/>', "has width='9em'; give a number in user units"),
        ('<svg width="9"><rect width="9" height="50%"/></svg>', "has height='50%'; give a number in user units"),
        (
            '<rect transform="spin(4) rotate()" width="1" height="1"/>',
            r"has a transform rotate\(\) that cannot be read",
        ),
        ('<polygon points="0 0 1e999 1 0 1"/>', "not a finite number"),
        ('<line x1="0" x2="1" y1="0" y2="0"/>', "has no closed shape"),
        ("<g>" * 300 + "</g>" * 300, "nests groups more than 200 deep"),
    ],
)
def test_refusals(tmp_path, body, message):
    with pytest.raises(ValueError, match=message):
        read(saved(tmp_path, body))


SHEET = """<style type="text/css"><![CDATA[ /* as drawing programs write it: .st1{display:none} */
    @font-face { font-family: x; src: url(x) }
    .st0, .st9 { fill: #D2B48C; stroke:#000000 } rect.st1 { FILL:none; stroke:#E30613 !important; }
    .st3{display:none;} #quiet{visibility:hidden} .st4{transform:translate(0px, 30px) rotate(0deg)}
    ]]></style>"""


def test_what_a_style_sheet_says_of_shapes_is_read(tmp_path):
    path = saved(
        tmp_path,
        f"""{SHEET}<g class="st3"><rect width="1" height="1"/></g><rect class="st0" width="10" height="10"/>
        <rect class="st0 st1" x="20" width="10" height="10"/><rect class="st4" x="40" width="10" height="10"/>
        <rect class="st1" style="stroke: blue" x="60" width="10" height="10"/>
        <g id="quiet"><rect x="80" width="10" height="10"/><rect x="100" visibility="visible" width="9" height="9"/></g>
        <rect style="visibility:hidden" width="7" height="7"/>""",
        'viewBox="0 0 200 100"',
    )
    layout = read_layout(path)
    colours = ["#d2b48c", "#e30613", "#000000", "#0000ff", "#000000"]
    assert layout.looks == tuple(("rect", colour) for colour in colours)
    assert [ring[:, 1].min() for ring in layout.outlines] == [-10, -10, -40, -10, -9]
    assert "skipped: 1 hidden <g>, 2 hidden <rect>" in layout.notes
    assert read_layout(path, ignore=["#E30613"]).n_blocks == 4


def test_what_nobody_sees_is_no_block(tmp_path):
    body = """<g style="fill:none"><rect width="9" height="9"/><rect y="10" width="9" height="9" stroke="red"/>
        <rect y="20" width="9" height="9" style="stroke:transparent"/></g><rect y="30" width="9" height="9"/>
        <g opacity="0.0"><rect y="40" width="9" height="9"/></g><path d="M0 50H9V59H0Z" style="opacity:0"/>
        <rect y="60" width="9" height="9" opacity="0.05"/><rect y="70" width="9" height="9" fill="none"/>"""
    layout = read_layout(saved(tmp_path, body, 'viewBox="0 0 200 100"'))
    assert [ring[:, 1].max() for ring in layout.outlines] == [-10, -30, -60]
    assert "skipped: 3 hidden <rect>, 1 hidden <g>, 1 hidden <path>" in layout.notes
    clear = """<g fill-opacity="0"><rect y="10" width="9" height="9"/><path d="M0 20H9V29H0Z" stroke="red"/></g>
        <rect y="30" width="9" height="9" style="fill:none;stroke:#000;stroke-width:0px"/>
        <g stroke-width="0.0"><rect y="40" width="9" height="9" style="fill:#00f;fill-opacity:0.0;stroke:black"/></g>
        <rect y="50" width="9" height="9" fill="none" stroke="black" stroke-opacity="0%"/>
        <rect y="60" width="9" height="9" fill="none" stroke="black" stroke-width="0.1"/>
        <rect y="70" width="9" height="9" fill="red" stroke="black" stroke-width="0"/>"""
    layout = read_layout(saved(tmp_path, clear, 'viewBox="0 0 200 100"'))
    assert sorted(ring[:, 1].max() for ring in layout.outlines) == pytest.approx([-70.0, -60.0, -40.0, -30.0, -20.0])
    assert "skipped: 2 hidden <rect>" in layout.notes
    with pytest.raises(ValueError, match=r"no closed shape \(found: 1 hidden <rect>\); draw each block"):
        read_layout(saved(tmp_path, '<rect width="9" height="9" opacity="0%"/>'))


def test_what_a_style_sheet_says_of_other_selectors_is_missed_in_a_note(tmp_path):
    sheet = (
        "<style>g > rect{display:none} @media print {.a{fill:red}} g text{font-size:2px} .a:hover{stroke:red}</style>"
    )
    notes = read_layout(saved(tmp_path, f'{sheet}<g><rect class="a" width="9" height="9"/></g>')).notes
    told = [note for note in notes if note.startswith("not read")]
    assert [note.split("'")[1] for note in told] == ["@media print", "g > rect", ".a:hover"]


@pytest.mark.parametrize(
    "said", ["translateX(3px)", "rotate(1rad)", "translate(50%, 0)", "scale(2); transform-origin:5px 0"]
)
def test_transforms_of_a_style_that_are_not_read_are_refused(tmp_path, said):
    with pytest.raises(ValueError, match=r"has a transform .* that cannot be read; apply it to the shapes"):
        read(saved(tmp_path, f'<rect style="transform:{said}" width="9" height="9"/>'))


def test_entities_are_refused_before_parsing(tmp_path):
    path = tmp_path / "a.svg"
    bombs = "".join(f'<!ENTITY l{k + 1} "{f"&l{k};" * 10}">' for k in range(9))
    path.write_text(f'<!DOCTYPE svg [<!ENTITY l0 "ha">{bombs}]><svg><title>&l9;</title></svg>', encoding="utf-8")
    with pytest.raises(ValueError, match="defines XML entities"):
        read(path)
    path.write_text("<html/>", encoding="utf-8")
    with pytest.raises(ValueError, match="root <html>, not <svg>"):
        read(path)


def rings_of_arcs(cut):
    """Path data of two rings of voussoirs around (0, 0), with corners rounded to ``cut`` digits."""

    def place(radius, angle):
        return f"{radius * math.cos(math.radians(angle)):.{cut}f} {-radius * math.sin(math.radians(angle)):.{cut}f}"

    for r, s, cuts in ((1000, 1300, range(0, 181, 12)), (1300, 1600, (0, 16, 33, 49, 65, 82, 98, 115, 131, 147, 180))):
        for a, b in itertools.pairwise(cuts):
            yield f"M{place(r, a)}L{place(s, a)}A{s} {s} 0 0 0 {place(s, b)}L{place(r, b)}A{r} {r} 0 0 1 {place(r, a)}Z"


@pytest.mark.parametrize("transform", ["", "scale(1.2 0.7)", "rotate(20) skewX(15)"])
@pytest.mark.parametrize("chord_tolerance", [None, 1e-4])
def test_outlines_cut_at_other_places_of_an_ellipse_share_its_chords(tmp_path, transform, chord_tolerance):
    body = "".join(f'<g transform="scale(2)"><path d="{d}" transform="scale(0.5)"/></g>' for d in rings_of_arcs(9))
    path = saved(tmp_path, f'<g transform="{transform}">{body}</g>')
    shapes = [shapely.Polygon(ring) for ring in read_layout(path, chord_tolerance=chord_tolerance).outlines]
    union = shapely.union_all(shapes, grid_size=1e-12)
    areas = [sum(shape.area for shape in shapes), shapely.Polygon(union.exterior).area]
    assert [union.area] * 2 == pytest.approx(areas, abs=1e-9)


def beziers_of_arcs():
    """Path data of two rings of voussoirs whose arcs are Bézier curves of their own, as "object to path" makes them."""

    def curve(radius, a, b):
        bend = 4.0 / 3.0 * math.tan(math.radians(b - a) / 4.0)
        ends = [(math.cos(math.radians(angle)), -math.sin(math.radians(angle))) for angle in (a, b)]
        (x, y), (u, v) = ends
        places = [(x, y), (x + bend * y, y - bend * x), (u - bend * v, v + bend * u), (u, v)]
        first, *others = (f"{radius * px:.6f} {radius * py:.6f}" for px, py in places)
        return first, f"C{' '.join(others)}"

    for r, s, cuts in ((1000, 1300, range(0, 181, 20)), (1300, 1600, (0, 16, 33, 49, 65, 82, 98, 115, 131, 147, 180))):
        for a, b in itertools.pairwise(cuts):
            (first, there), (last, back) = curve(s, a, b), curve(r, b, a)
            yield f"M{first}{there}L{last}{back}Z"


@pytest.mark.parametrize("transform", ["", "rotate(20) skewX(15) scale(3)"])
@pytest.mark.parametrize("chord_tolerance", [None, 1e-4])
def test_bezier_curves_share_their_chords(tmp_path, transform, chord_tolerance):
    body = "".join(f'<path d="{d}"/>' for d in beziers_of_arcs())
    path = saved(tmp_path, f'<g transform="{transform}">{body}</g>')
    shapes = np.array([shapely.Polygon(ring) for ring in read_layout(path, chord_tolerance=chord_tolerance).outlines])
    i, j = shapely.STRtree(shapes).query(shapes, "intersects")
    overlaps = shapely.area(shapely.intersection(shapes[i[i < j]], shapes[j[i < j]]))
    # Chords of their own overlap by up to 8e-4 of a stone, and leave as much open.
    assert overlaps.max() < 1e-5 * shapely.area(shapes).min()
    union = shapely.union_all(shapes)
    assert shapely.Polygon(union.exterior).area == pytest.approx(shapely.area(shapes).sum(), rel=1e-5)


def test_arcs_of_rounded_coordinates_share_their_corners(tmp_path):
    path = saved(tmp_path, "".join(f'<path d="{d}"/>' for d in rings_of_arcs(2)))
    shapes = [shapely.Polygon(ring) for ring in read_layout(path).outlines]
    # Rounded by 5 µm; chords of their own would overlap by up to 1.6 mm.
    i, j = shapely.STRtree(shapes).query(shapes, "intersects")
    overlaps = shapely.intersection(np.array(shapes)[i[i < j]], np.array(shapes)[j[i < j]])
    assert shapely.area(overlaps).max() < 4e-6


def test_one_curve_has_a_bounded_number_of_chords(tmp_path):
    path = saved(tmp_path, '<circle cx="0" cy="0" r="1"/>', 'viewBox="0 0 1 1"')
    assert len(read(path, chord_tolerance=1e-12).vertices) <= 512
    for tolerance in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(ValueError, match=f"chord_tolerance is {tolerance:g} m; it must be a length above 0"):
            read(path, chord_tolerance=tolerance)


def test_a_scale_of_width_and_view_box_that_is_no_unit_is_kept(tmp_path):
    body = '<rect width="100" height="50"/>'
    path = saved(tmp_path, body, 'width="5940mm" height="4200mm" viewBox="0 0 297 210"')
    layout = read_layout(path)
    assert layout.unit == "20 mm"
    assert layout.notes == ("1 unit of the drawing is 20 mm, by its width and its viewBox",)
    assert layout.outlines[0].max(axis=0) == pytest.approx([2.0, 0.0])
    # What a sheet at 1:20 does not say can be given.
    sheet = saved(tmp_path, body, 'width="297mm" height="210mm" viewBox="0 0 297 210"')
    assert read_layout(sheet, unit="20 mm").outlines[0].max(axis=0) == pytest.approx([2.0, 0.0])
    with pytest.raises(ValueError, match="unit '0 mm' is 0 m long; give a number above 0, as 20 mm"):
        read_layout(sheet, unit="0 mm")


@pytest.mark.parametrize(("ratio", "unit"), [("", "20 mm"), ("xMinYMin meet", "20 mm"), ("none", "")])
def test_a_drawing_is_as_large_as_fits_into_a_page_of_another_shape(tmp_path, ratio, unit):
    head = f'width="4000mm" height="2m" viewBox="0 0 100 100" preserveAspectRatio="{ratio}"'
    layout = read_layout(saved(tmp_path, '<rect width="50" height="20"/>', head))
    assert layout.unit == (unit or "m")
    assert any("another shape than the viewBox" in note for note in layout.notes) == (not unit)


@pytest.mark.parametrize(
    ("ratio", "low", "high"),
    [
        ("", [1.2, -1.1], [2.2, -0.7]),
        ('preserveAspectRatio="xMidYMax"', [1.2, -1.6], [2.2, -1.2]),
        ('preserveAspectRatio="none"', [1.2, -0.9], [2.2, -0.3]),
    ],
)
def test_an_inner_svg_is_placed_and_scaled_by_its_view_box(tmp_path, ratio, low, high):
    inner = f'<svg x="1" width="2" height="3" viewBox="0 0 100 100" {ratio}>'
    inner += '<rect x="10" y="10" width="50" height="20"/></svg>'
    layout = read_layout(saved(tmp_path, inner, 'width="4m" height="4m" viewBox="0 0 4 4"'))
    np.testing.assert_allclose([layout.outlines[0].min(axis=0), layout.outlines[0].max(axis=0)], [low, high])


def test_clones_are_read_where_they_show_their_original(tmp_path):
    inner = '<defs><rect id="a" width="1" height="2"/><mask id="m"/>'
    inner += '<symbol id="s"><rect width="9" height="3"/></symbol><symbol id="t" viewBox="1 1 9 3">'
    inner += '<rect x="1" y="1" width="9" height="3"/></symbol></defs>'
    inner += '<g id="b" transform="translate(10,0)"><use href="#a" x="3" transform="scale(-1,1)"/></g><use href="#m"/>'
    inner += '<use xmlns:l="http://www.w3.org/1999/xlink" l:href="#b" y="5"/><use href="other.svg#a"/><use/>'
    inner += '<use href="#s" x="20"/><use href="#t" x="30" y="1" width="18" height="6"/><use href="#t"/>'
    layout = read_layout(saved(tmp_path, inner), unit="m")
    lows = [ring.min(axis=0) for ring in layout.outlines]
    np.testing.assert_allclose(lows, [[6, -2], [6, -7], [20, -3], [30, -7]])
    np.testing.assert_allclose(np.ptp(layout.outlines[3], axis=0), [18, 6])
    assert any(note.startswith("skipped: 3 <use> (clones; unlink them") for note in layout.notes)
    assert any("<svg> 't' was skipped: it has no width, height" in note for note in layout.notes)


@pytest.mark.parametrize("head", ['viewBox="-2 0 8 6"', 'width="8" height="6"', 'width="8px" height="6"'])
def test_percentages_are_parts_of_what_the_sheet_shows(tmp_path, head):
    """As of the white background that programs put behind all, which is a frame around stones."""
    body = '<rect width="50%" height="50%"/><rect x="4" y="50%" width="1in" height="72pt"/>'
    body += '<circle cx="75%" cy="1" r="10%"/>'
    body += '<svg x="5" y="3" width="25%" height="50%" viewBox="0 0 1 1"><rect width="100%" height="100%"/></svg>'
    layout = read_layout(saved(tmp_path, body, head), unit="m")
    sizes = [np.ptp(ring, axis=0) for ring in layout.outlines]
    radius = 0.1 * np.hypot(8, 6) / np.sqrt(2)
    np.testing.assert_allclose(sizes, [[4, 3], [96, 96], [2 * radius] * 2, [2, 2]], rtol=1e-3)
    np.testing.assert_allclose(layout.outlines[1].max(axis=0), [100, -3])
    np.testing.assert_allclose(layout.outlines[2].mean(axis=0), [6, -1], atol=1e-3)


def test_an_inner_svg_without_size_is_missed_in_a_note(tmp_path):
    inner = '<svg id="a" width="50%" viewBox="0 0 9 9"><rect width="9" height="9"/></svg><rect width="9" height="9"/>'
    layout = read_layout(saved(tmp_path, inner))
    assert layout.n_blocks == 1
    assert any(
        "an inner <svg> 'a' was skipped: it has no width, height or viewBox above 0" in note for note in layout.notes
    )


def test_lines_of_patterns_that_fill_shapes_are_missed_in_a_note(tmp_path):
    path = tmp_path / "filled.svg"
    path.write_text(
        '<svg xmlns="http://www.w3.org/2000/svg" width="4m" viewBox="0 0 4 1"><style>.b{fill:url(#bond)}</style>'
        '<defs><pattern id="bond" width="1" height="1"><rect width="0.5" height="0.5"/></pattern>'
        '<pattern id="other"/><linearGradient id="shade"/></defs>'
        '<rect width="1" height="1" fill="url(#bond)"/>'
        "<rect x='1' width='1' height='1' style='fill: url( \"#bond\" )'/>"
        '<rect x="2" width="1" height="1" class="b"/><rect x="3" width="1" height="1" fill="url(#shade)"/></svg>',
        encoding="utf-8",
    )
    layout = read_layout(path)
    assert layout.n_blocks == 4
    told = [note for note in layout.notes if "pattern" in note]
    assert told == [
        "not read: the lines of the pattern 'bond', which fills 3 shapes; turn it into shapes (Inkscape: Object, "
        "Pattern, Pattern to Objects)"
    ]


def test_names_of_any_characters_are_written_and_read(tmp_path):
    names = ["<b>&amp;</b>]]>", "a\x01\x0b\x1b", "line\nand\ttab"]
    squares = [[[x, 0], [x + 1, 0], [x + 1, 1], [x, 1]] for x in (0, 2, 4)]
    save_layout(solver.Assembly.from_outlines(squares, names=names), tmp_path / "names.svg")
    assert read(tmp_path / "names.svg").names == tuple(names)


def test_only_the_parts_of_a_path_that_have_holes_are_left_out(tmp_path):
    parts = "M0,0 H10 V10 H0 Z M10,0 H20 V10 H10 Z M20,0 H30 V10 H20 Z M24,4 H26 V6 H24 Z"
    layout = read_layout(saved(tmp_path, f'<path id="stones" d="{parts}"/>'))
    assert layout.names == ("stones 1", "stones 2")
    assert [(item.kind, item.name, len(item.holes)) for item in layout.left_out] == [("hole", "stones 3", 1)]


@pytest.mark.parametrize(
    ("radii", "area"),
    [
        ('rx="40"', 10000 - (4 - np.pi) * 40**2),
        ('ry="40" rx="auto"', 10000 - (4 - np.pi) * 40**2),
        ('rx="20" ry="900"', 10000 - (4 - np.pi) * 20 * 50),
        ('rx="900"', np.pi * 50**2),
        ('rx="0" ry="9"', 10000),
    ],
)
def test_rounded_corners_of_rectangles_are_round(tmp_path, radii, area):
    path = saved(tmp_path, f'<rect width="100" height="100" {radii}/>', 'data-blockvis-unit="mm"')
    assert read(path, chord_tolerance=1e-3, unit="m").areas == pytest.approx([area], rel=1e-4)


def test_what_is_clipped_is_read_whole_with_a_note(tmp_path):
    clip = '<clipPath id="c"><rect width="5" height="10"/></clipPath>'
    body = f"""{clip}<rect width="10" height="10" clip-path="url(#c)"/>
        <g style="mask: url(#m)"><rect x="10" width="10" height="10" clip-path="none"/></g>"""
    layout = read_layout(saved(tmp_path, body))
    assert layout.n_blocks == 2
    assert "read whole, not clipped: 1 <rect> with a clip-path, 1 <g> with a mask" in layout.notes


def test_a_page_that_gives_no_scale_is_told_in_a_run(tmp_path):
    head = 'width="400mm" height="200mm" viewBox="0 0 4 1" preserveAspectRatio="xMidYMid slice"'
    with pytest.warns(UserWarning, match="another shape than the viewBox"):
        read(saved(tmp_path, '<rect width="1" height="1"/>', head))


INKSCAPE = 'xmlns:inkscape="http://www.inkscape.org/namespaces/inkscape" viewBox="0 0 4 4"'

#: Two stones, a joint of loose lines and a support; some are grouped within their layers.
GROUPED = """<g inkscape:groupmode="layer" id="layer1" inkscape:label="wall"><rect id="a" width="1" height="1"/>
<g id="g5"><rect id="b" x="1" width="1" height="1"/><path id="c" d="M2 0H3V1"/><path id="d" d="M3 1H2V0"/></g></g>
<g inkscape:groupmode="layer" id="layer2" inkscape:label="fixed"><g id="g7" {0}>
<rect id="s" y="1" width="4" height="1"/></g></g>"""


@pytest.mark.parametrize(("label", "groups"), [("", ("fixed",)), ('inkscape:label="pad"', ("pad",))])
def test_groups_within_a_layer_hide_neither_it_nor_its_role(tmp_path, label, groups):
    path = saved(tmp_path, GROUPED.format(label), INKSCAPE)
    drawing = read_layout(path)
    assert drawing.names == ("a", "b", "s", "face 0")
    assert drawing.groups == ("wall", "wall", *groups, "wall")
    assert drawing.materials[:2] == ("wall", "wall")
    assert read(path, supports=()).roles.tolist() == ["free", "free", "fixed", "free"]


def test_layers_around_a_layer_are_asked_for_with_it(tmp_path):
    path = saved(tmp_path, GROUPED.format('inkscape:label="pad"'), INKSCAPE)
    for asked in ({"only": "wall"}, {"ignore": "fixed"}):
        drawing = read_layout(path, **asked)
        assert drawing.names == ("a", "b", "face 0")
        assert "matches no" not in " ".join(drawing.notes)
        assert [(item.kind, item.layer) for item in drawing.left_out] == [("asked", "pad")]
    assert read_layout(path, only="fixed").names == ("s",)


def test_an_id_that_is_a_role_is_one_within_a_labelled_layer(tmp_path):
    path = saved(tmp_path, GROUPED.replace('id="g5"', 'id="Fixed"').format('inkscape:label="pad"'), INKSCAPE)
    assert read_layout(path).groups == ("wall", "Fixed", "pad", "Fixed")
    assert read(path, supports=()).roles.tolist() == ["free", "fixed", "fixed", "fixed"]


def test_ids_of_groups_are_layers_where_none_around_has_a_label(tmp_path):
    path = saved(tmp_path, '<g id="A"><g id="B"><rect width="1" height="1"/></g></g>', 'viewBox="0 0 4 4"')
    assert read_layout(path).groups == ("B",)
    assert read_layout(path, only="A").n_blocks == 1
