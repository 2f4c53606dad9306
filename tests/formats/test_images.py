"""Pictures of stones and annotations, through the command line: masks, label images, scale, what is refused."""

import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image, ImageDraw, ImageFilter
from shapely import Polygon

from blockvis import generators, read, read_layout, save_layout
from blockvis.cli import main

WALL = (300, 160)


def drawn_wall(gap=4, value=lambda k: 255, mode="L", size=WALL):
    """Three courses of stones, 50 × 40 pixels with their joints, of which every second begins with a half."""
    image = Image.new(mode, size)
    draw, k = ImageDraw.Draw(image), 0
    for course in range(3):
        for column in range(6):
            left = max(25, 25 + 50 * column - 25 * (course % 2))
            right = min(275, 25 + 50 * (column + 1) - 25 * (course % 2))
            if right - left > 10:
                k += 1
                low, high = 20 + 40 * course, 60 + 40 * course
                draw.rectangle((left + gap // 2, low, right - gap // 2 - 1, high - gap - 1), fill=value(k))
    return image, k


def informed(capsys, *arguments):
    """Exit code, output and messages of ``blockvis info``."""
    code = main(["info", *map(str, arguments)])
    return code, *capsys.readouterr()


@pytest.mark.slow
def test_a_mask_becomes_a_run_that_ends_in_a_curve_over_its_photograph(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    image, n = drawn_wall()
    image.save("wall.png")
    photograph = Image.new("RGB", (600, 320), (20, 20, 250))
    # Beside and above a quarter of the wall whose corner lies at (1.5, 0.8) it is red; a world file says so.
    photograph.paste((250, 20, 20), (300, 0, 600, 160))
    photograph.save("photo.jpg")
    (tmp_path / "photo.jgw").write_text("0.005\n0\n0\n-0.005\n0.0025\n1.5975\n", encoding="utf-8")
    assert main(["info", "wall.png", "--width", "3", "--picture", "found.png"]) == 0
    out = capsys.readouterr().out
    assert f"outlines        {n}" in out
    assert f"sum {(np.asarray(image) > 0).sum() * 1e-4:.6g} m²" in out
    assert main(["new", "wall.png", "--width", "3"]) == 0
    assert "\nwidth = 3.0\n" in (tmp_path / "wall.toml").read_text(encoding="utf-8")
    run = ["run", "wall.toml", "--no-check-steps", "--no-film", "--set", "settlement.limit=0.01"]
    assert main([*run, "--set", "output.underlay=photo.jpg"]) == 0
    assert (tmp_path / "wall-results" / "curve.png").is_file()
    picture = np.asarray(Image.open("wall-results/mechanism.png").convert("RGB")).astype(int)
    red, blue = (np.argwhere(picture[..., k] - picture[..., 2 - k] > 60) for k in (0, 2))
    assert len(red) + len(blue) > 0.2 * picture.shape[0] * picture.shape[1]
    # All but hinges, which are red anywhere.
    low, left = np.percentile(red[:, 0], 98), np.percentile(red[:, 1], 2)
    within = [((found[:, 0] < low - 8) & (found[:, 1] > left + 8)).mean() for found in (red, blue)]
    assert within[0] > 0.9
    assert within[1] < 0.01


@pytest.mark.thorough
def test_a_photograph_of_another_shape_or_place_goes_under_nothing(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    drawn_wall()[0].save("wall.png")
    Image.new("RGB", (600, 400)).save("photo.jpg")
    assert main(["new", "wall.png", "--width", "3"]) == 0
    for name, says in (("photo.jpg", "has 600 × 400 pixels, the image of the blocks 300 × 160"), ("x.jpg", "no file")):
        capsys.readouterr()
        assert main(["run", "wall.toml", "--no-film", "--set", f"output.underlay={name}"]) == 2
        assert says in capsys.readouterr().err


def test_round_stones_keep_their_area_within_one_per_cent(tmp_path):
    y, x = np.mgrid[0:200, 0:400]
    mask = np.zeros((200, 400), dtype=np.uint8)
    for middle, radius in ((20, 8), (60, 20), (140, 45), (290, 80)):
        mask[(x - middle) ** 2 + (y - 100.3) ** 2 < radius**2] = 255
    Image.fromarray(mask).save(tmp_path / "round.png")
    areas = np.sort(read_layout(tmp_path / "round.png", pixel=1.0).sizes ** 2)
    assert areas == pytest.approx(np.pi * np.array([8, 20, 45, 80]) ** 2, rel=0.02)
    assert areas.sum() == pytest.approx((mask > 0).sum(), rel=0.01)


@pytest.mark.parametrize("turn", [0, 7])
def test_labels_that_share_borders_leave_no_gap(tmp_path, turn):
    import shapely

    image, n = drawn_wall(gap=0, value=lambda k: k)
    image.rotate(turn, expand=True).save(tmp_path / "wall.png")
    layout = read_layout(tmp_path / "wall.png", width=3.0)
    shapes = [shapely.Polygon(ring) for ring in layout.outlines]
    whole = shapely.union_all(shapes)
    assert layout.n_blocks == n
    assert whole.geom_type == "Polygon"
    assert sum(shapely.Polygon(hole).area for hole in whole.interiors) < 1e-12
    assert sum(shape.area for shape in shapes) == pytest.approx(whole.area, rel=1e-12)
    assert layout.names[0] == "label 1"


@pytest.mark.thorough
@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10**6), st.integers(2, 5), st.sampled_from([None, 0.0]))
def test_regions_of_any_labels_are_whole_outlines_side_by_side(tmp_path_factory, seed, most, tolerance):
    import shapely

    labels = np.random.default_rng(seed).integers(0, most, (6, 9)).astype(np.uint8)
    path = tmp_path_factory.mktemp("labels") / "a.png"
    Image.fromarray(np.kron(labels, np.ones((4, 4), dtype=np.uint8))).save(path)
    try:
        layout = read_layout(path, pixel=1.0, smallest=0.5, outline_tolerance=tolerance)
    except ValueError:
        # Of one region, of holes: refused with a word, as other tests say.
        return
    shapes = np.array([shapely.Polygon(ring) for ring in layout.outlines])
    assert shapely.is_valid(shapes).all()
    assert shapely.area(shapes).sum() == pytest.approx(shapely.union_all(shapes).area, rel=1e-9)


@pytest.mark.parametrize(
    "lossy",
    [
        "a.jpg",
        "noisy.jpg",
        pytest.param("small.png", marks=pytest.mark.thorough),
        pytest.param("turned.png", marks=pytest.mark.thorough),
    ],
)
def test_antialiased_and_lossy_labels_are_those_of_the_exact_image(tmp_path, lossy, capsys):
    colours = np.random.default_rng(4).integers(70, 255, (40, 3))
    image, n = drawn_wall(gap=6, value=lambda k: tuple(colours[k].tolist()), mode="RGB")
    area = (np.asarray(image).max(axis=2) > 0).sum()
    if lossy == "small.png":
        image, area = image.resize((225, 120), Image.Resampling.LANCZOS), area * 0.75**2
    if lossy == "turned.png":
        image = image.rotate(5, Image.Resampling.BICUBIC, expand=True)
    image.save(tmp_path / lossy, **({"quality": 40 if lossy[0] == "n" else 85} if "jpg" in lossy else {}))
    code, out, _ = informed(capsys, tmp_path / lossy, "--pixel", 1)
    assert code == 0
    assert f"outlines        {n}\n" in out
    total = float(out.split("sum ")[1].split()[0])
    assert total == pytest.approx(area, rel=0.02)
    assert "without a label's value, as at antialiased or lossy borders, went to" in out


@pytest.mark.parametrize(("stone", "joint"), [(255, 0), (0, 255), ("#a03020", "#f0e0d0")])
@pytest.mark.parametrize("gap", [9, 11, 14])
def test_borders_parallel_to_the_pixels_are_of_no_label_when_half_covered(tmp_path, stone, joint, gap):
    mode = "L" if isinstance(stone, int) else "RGB"
    drawn, n = drawn_wall()
    # Four times as fine, with joints of gap / 4 pixels, and averaged.
    large = Image.new(mode, (1200, 640), joint)
    draw = ImageDraw.Draw(large)
    for left, low, right, high in _boxes(drawn):
        draw.rectangle((4 * left - gap // 2, 4 * low, 4 * right + 8 - gap, 4 * high + 15 - gap), fill=stone)
    image = large.resize(drawn.size, Image.Resampling.BOX)
    image.save(tmp_path / "wall.png")
    layout = read_layout(tmp_path / "wall.png", width=3.0)
    assert layout.n_blocks == n
    assert "a mask of stones" in layout.notes[0]


def _boxes(image):
    from scipy import ndimage

    labels, _ = ndimage.label(np.asarray(image) > 0)
    return [(x.start, y.start, x.stop, y.stop) for y, x in ndimage.find_objects(labels)]


def test_lines_of_grey_between_stones_of_a_mask_stay_lines(tmp_path):
    image = Image.new("L", (120, 80), 0)
    draw = ImageDraw.Draw(image)
    draw.rectangle((20, 20, 99, 59), fill=255)
    for x in (40, 60, 80):
        draw.rectangle((x, 20, x + 1, 59), fill=128)
    image.save(tmp_path / "wall.png")
    assert read_layout(tmp_path / "wall.png", width=1.2, background=0).groups.count("label 255") == 4


@pytest.mark.parametrize(("values", "joint", "background"), [((1, 3), 2, None), ((1, 3), 2, 2), ((0, 255), 128, 128)])
def test_joints_a_pixel_wide_between_two_labels_are_no_half_covered_pixels(tmp_path, values, joint, background):
    """Numbers of stones do not mix as colours do, and a background that is given is one."""
    pixels = np.full((60, 120), joint, dtype=np.uint8)
    for k in range(18):
        row, column = divmod(k, 6)
        pixels[20 * row : 20 * row + 19, 20 * column : 20 * column + 19] = values[(row + column) % 2]
    Image.fromarray(pixels).save(tmp_path / "wall.png")
    layout = read_layout(tmp_path / "wall.png", width=1.2, background=background)
    assert [layout.groups.count(f"label {value}") for value in values] == [9, 9]


@pytest.mark.parametrize("ending", ["png", "tif"])
def test_a_noisy_mask_of_16_bits_is_that_of_8(tmp_path, ending):
    image, n = drawn_wall(gap=6)
    turned = np.asarray(image.rotate(3, Image.Resampling.BICUBIC, expand=True)).astype(float)
    values = 3000 + 200 * turned + np.random.default_rng(1).normal(0, 600, turned.shape)
    Image.fromarray(values.clip(0, 65535).astype(np.uint16)).save(tmp_path / f"wall.{ending}")
    layout = read_layout(tmp_path / f"wall.{ending}", pixel=0.01)
    assert layout.n_blocks == n
    assert float((layout.sizes**2).sum()) == pytest.approx((turned > 127).sum() * 1e-4, rel=0.02)


def test_a_tiff_on_its_side_is_turned(tmp_path):
    image, n = drawn_wall()
    turned = image.transpose(Image.Transpose.ROTATE_90)
    turned.save(tmp_path / "wall.tif", tiffinfo={274: 6})
    layout = read_layout(tmp_path / "wall.tif", width=3.0)
    assert layout.n_blocks == n
    assert float((layout.sizes**2).sum()) == pytest.approx((np.asarray(image) > 0).sum() * 1e-4)


def test_a_noisy_mask_is_that_of_the_exact_image(tmp_path):
    image, n = drawn_wall(gap=4)
    image.save(tmp_path / "wall.jpg", quality=50)
    layout = read_layout(tmp_path / "wall.jpg", width=3.0)
    assert layout.n_blocks == n
    assert float((layout.sizes**2).sum()) == pytest.approx((np.asarray(image) > 0).sum() * 1e-4, rel=0.01)


@pytest.mark.parametrize(
    "quality", [30, pytest.param(75, marks=pytest.mark.thorough), pytest.param(100, marks=pytest.mark.thorough)]
)
def test_joints_of_a_noisy_mask_may_be_narrow(tmp_path, quality):
    image, n = drawn_wall(gap=2)
    image = image.crop((25, 20, 275, 138)).resize((750, 354), Image.Resampling.NEAREST)
    image.save(tmp_path / "wall.jpg", quality=quality)
    layout = read_layout(tmp_path / "wall.jpg", width=7.5)
    assert layout.n_blocks == n
    assert float((layout.sizes**2).sum()) == pytest.approx((np.asarray(image) > 0).sum() * 1e-4, rel=0.01)


def test_the_scan_of_a_drawing_in_ink_is_no_mask_of_the_shades_of_its_paper(tmp_path, capsys):
    ink, n = drawn_wall(gap=2)
    paper = np.where(np.asarray(ink) > 0, 245.0, 30.0)
    paper[:18], paper[140:], paper[:, :24], paper[:, 276:] = 245.0, 245.0, 245.0, 245.0
    paper = paper.repeat(2, axis=0).repeat(2, axis=1)
    y, x = np.meshgrid(*(np.linspace(-1, 1, pixels) for pixels in paper.shape), indexing="ij")
    for shade in (0.08, 0.2):
        grey = paper * (1 - shade * (x**2 + y**2)) + np.random.default_rng(0).normal(0, 3, paper.shape)
        Image.fromarray(grey.clip(0, 255).astype("uint8")).save(tmp_path / f"scan{shade}.jpg", quality=70)
    code, out, err = informed(capsys, tmp_path / "scan0.2.jpg", "--width", 3)
    assert (code, out) == (2, "")
    assert "is a photograph: its colours are no labels" in err
    Image.fromarray((grey > 140).astype("uint8") * 255).save(tmp_path / "scan.png")
    for name in ("scan.png", "scan0.08.jpg"):
        assert read_layout(tmp_path / name, width=3.0).n_blocks == n


def lines_of(rings, size, ink, scale=8):
    """A drawing of lines as programs export them: lines a pixel wide, half-covered pixels and no white alike."""
    image = Image.new("RGB", (size[0] * scale, size[1] * scale), (255, 255, 255))
    for ring in rings:
        corners = [(x * scale, y * scale) for x, y in (*ring, ring[0])]
        ImageDraw.Draw(image).line(corners, fill=ink, width=scale)
    pixels = np.asarray(image.resize(size, Image.Resampling.LANCZOS)).astype(int)
    off = np.random.default_rng(1).integers(0, 3, pixels.shape) * (np.random.default_rng(2).random(pixels.shape) < 0.05)
    return Image.fromarray((pixels - off).clip(0, 255).astype("uint8"))


@pytest.mark.parametrize(
    "ink",
    [
        (0, 0, 0),
        pytest.param((150, 150, 150), marks=pytest.mark.thorough),
        pytest.param((200, 60, 60), marks=pytest.mark.thorough),
    ],
)
def test_thin_lines_on_white_are_joints(tmp_path, capsys, ink):
    wall = [
        [(x, y), (x + w, y), (x + w, y + 30.5), (x, y + 30.5)]
        for k in range(4)
        for y in [20.25 + 30.5 * k]
        for x, w in [(20.3 + 40.2 * i - 20.1 * (k % 2 and i > 0), 40.2 - 20.1 * (k % 2 and i == 0)) for i in range(6)]
    ]
    lines_of(wall, (300, 180), ink).save(tmp_path / "lines.png")
    code, out, _ = informed(capsys, tmp_path / "lines.png", "--width", 3)
    assert (code, f"outlines        {len(wall)}\n" in out) == (0, True), out
    assert "a drawing of lines in 300 × 180 pixels" in out
    layout = read_layout(tmp_path / "lines.png", width=3.0)
    drawn = sum(30.5 * (ring[1][0] - ring[0][0]) for ring in wall) * 1e-4
    areas = [Polygon(ring).area for ring in layout.outlines]
    assert 0.8 * drawn < sum(areas) < drawn


def test_outlines_of_stones_in_mortar_are_read_without_the_mortar(tmp_path):
    turns = np.linspace(0.0, 2.0 * np.pi, 30, endpoint=False)
    stones = [
        [(x + 18 * np.cos(t), y + 13 * np.sin(t)) for t in turns]
        for y in range(40, 170, 32)
        for x in range(40, 270, 42)
    ]
    wall = [(15, 15), (285, 15), (285, 180), (15, 180)]
    lines_of([wall, *stones], (300, 195), (120, 120, 120)).save(tmp_path / "rubble.png")
    layout = read_layout(tmp_path / "rubble.png", width=3.0)
    assert (layout.n_blocks, len(layout.left_out)) == (len(stones), 2)


@pytest.mark.parametrize("ink", [0, 200])
def test_what_is_transparent_around_lines_is_paper(tmp_path, ink):
    wall = [[(x, y), (x + 40, y), (x + 40, y + 30), (x, y + 30)] for y in (20, 50, 80) for x in range(20, 220, 40)]
    cover = 255 - np.asarray(lines_of(wall, (300, 130), (0, 0, 0)).convert("L"))
    pixels = np.dstack([np.full((*cover.shape, 3), ink, dtype=np.uint8), cover])
    Image.fromarray(pixels).save(tmp_path / "lines.png")
    assert read_layout(tmp_path / "lines.png", width=3.0).n_blocks == len(wall)


@pytest.mark.parametrize(
    "form",
    ["png", "jpg", pytest.param("webp", marks=pytest.mark.thorough), pytest.param("bmp", marks=pytest.mark.thorough)],
)
def test_thick_outlines_of_stones_in_mortar_are_lines_too(tmp_path, form):
    image = Image.new("L", (640, 410), 255)
    draw = ImageDraw.Draw(image)
    draw.rectangle((40, 40, 600, 370), outline=0, width=7)
    boxes = [(70 + 130 * i, 70 + 95 * j, 170 + 130 * i, 140 + 95 * j) for i in range(4) for j in range(3)]
    for box in boxes:
        draw.ellipse(box, outline=0, width=7)
    image.save(tmp_path / f"thick.{form}")
    layout = read_layout(tmp_path / f"thick.{form}", width=6.4)
    assert (layout.n_blocks, len(layout.left_out)) == (len(boxes), 2)
    assert any(note.startswith("a drawing of lines") for note in layout.notes)


@pytest.mark.parametrize("form", ["png", "jpg", "transparent"])
@pytest.mark.parametrize("stone", [255, 0])
@pytest.mark.slow
def test_stones_may_be_as_narrow_as_lines_are(tmp_path, form, stone):
    """A facade of many courses, or a slender arch, with a margin: what is around is in one piece, and wide."""
    wall, arch = (Image.new("L", (400, 400), 255 - stone) for _ in range(2))
    draw, n = ImageDraw.Draw(wall), 0
    for course, y in enumerate(range(30, 361, 9)):
        for x in range(30, 340, 20):
            hole = 100 < x < 200 and 100 < y < 200
            n += not hole
            draw.rectangle(
                (x + 9 * (course % 2), y, x + 9 * (course % 2) + 16, y + 6), fill=255 - stone if hole else stone
            )
    y, x = np.mgrid[:400, :400]
    ring, turn = np.abs(np.hypot(x - 200, y - 380) - 160.0) < 3.5, np.degrees(np.arctan2(380 - y, x - 200))
    arch.paste(stone, mask=Image.fromarray(ring & (turn > 0.0) & (turn % 10.0 > 1.0)))
    for image, stones in ((wall, n), (arch, 18)):
        if form == "transparent":
            image.putalpha(image.point(lambda value: 255 * (value == stone)))
        path = tmp_path / ("a.jpg" if form == "jpg" else "a.png")
        image.save(path)
        layout = read_layout(path, width=4.0)
        assert layout.n_blocks == stones
        assert not any("lines" in note for note in layout.notes)


def test_a_decimal_comma_of_an_option_is_told(tmp_path, capsys):
    for width, said in (
        ("5,8", "'5,8' is not a number; numbers have a point: 5.8"),
        ("wide", "'wide' is not a number\n"),
    ):
        with pytest.raises(SystemExit):
            main(["info", str(tmp_path / "wall.png"), "--width", width])
        assert said in capsys.readouterr().err


def test_specks_go_to_what_is_around_them_and_are_told(tmp_path, capsys):
    image, n = drawn_wall()
    draw = ImageDraw.Draw(image)
    draw.point([(5, 5), (290, 150)], 255)
    draw.rectangle((40, 30, 41, 31), fill=0)
    image.save(tmp_path / "wall.png")
    code, out, _ = informed(capsys, tmp_path / "wall.png", "--width", 3)
    assert (code, f"outlines        {n}\n" in out) == (0, True)
    assert "2 specks of 2 pixels in all" in out
    assert read_layout(tmp_path / "wall.png", width=3.0, smallest=0.3).n_blocks < n


def test_black_joints_on_white_and_white_joints_on_black_are_the_same_stones(tmp_path):
    image, n = drawn_wall()
    crop = image.crop((25, 20, 275, 136))
    for k, one in enumerate((crop, crop.point(lambda v: 255 - v))):
        one.save(tmp_path / f"{k}.png")
        assert read_layout(tmp_path / f"{k}.png", width=2.5).n_blocks == n


def test_a_world_file_says_where_the_pixels_are(tmp_path, capsys):
    image, _ = drawn_wall()
    image.save(tmp_path / "wall.png")
    (tmp_path / "wall.pgw").write_text("0.02\n0\n0\n-0.02\n100.01\n53.19\n", encoding="utf-8")
    layout = read_layout(tmp_path / "wall.png")
    assert layout.points.min(axis=0) == pytest.approx([100 + 27 * 0.02, 53.2 - 136 * 0.02])
    assert "world file wall.pgw" in layout.notes[0]
    assert read_layout(tmp_path / "wall.png", pixel=0.01).points.min(axis=0) == pytest.approx([0.27, 0.24])
    (tmp_path / "wall.pgw").write_text("0.02\n0\n", encoding="utf-8")
    assert "is no world file; it has six numbers" in informed(capsys, tmp_path / "wall.png")[2]


def test_a_photograph_that_nothing_places_goes_under_no_drawing(tmp_path, capsys):
    Image.new("RGB", (30, 20)).save(tmp_path / "photo.jpg")
    save_layout(generators.arch(voussoirs=4), tmp_path / "arch.json")
    case = tmp_path / "case.toml"
    text = '[geometry]\nfile = "arch.json"\n[settlement]\ndirection = [0, -1]\n[output]\nunderlay = "photo.jpg"\n'
    case.write_text(text, encoding="utf-8")
    assert main(["run", str(case)]) == 2
    assert "nothing says where 'photo.jpg' lies; put a world file beside it" in capsys.readouterr().err
    (tmp_path / "photo.jgw").write_text("0.01 abc", encoding="utf-8")
    assert main(["run", str(case)]) == 2
    assert "photo.jgw' is no world file; it has six numbers, one a line" in capsys.readouterr().err


def test_tags_of_a_geotiff_say_where_the_pixels_are(tmp_path, capsys):
    from PIL.TiffImagePlugin import ImageFileDirectory_v2

    image, _ = drawn_wall()
    tags = ImageFileDirectory_v2()
    for tag, values in ((33550, (0.01, 0.01, 0.0)), (33922, (0.0, 0.0, 0.0, 5.0, 7.0, 0.0))):
        tags.tagtype[tag] = 12
        tags[tag] = values
    image.save(tmp_path / "wall.tif", tiffinfo=tags)
    assert read_layout(tmp_path / "wall.tif").points.min(axis=0) == pytest.approx([5.27, 7 - 1.36])
    tags.tagtype[34735] = 3
    tags[34735] = (1, 1, 0, 1, 1024, 0, 1, 2)
    image.save(tmp_path / "wall.tif", tiffinfo=tags)
    assert "is georeferenced in degrees" in informed(capsys, tmp_path / "wall.tif")[2]


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ((), "has no scale; give the width of the 300 pixels in m, --width 1.2"),
        (("--width", 3, "--pixel", 0.02), "the size of a pixel is given twice: width = 3 makes it 10 mm, pixel = 0.02"),
        (("--width", 3, "--height", 3), "the size of a pixel is given twice"),
        (("--width", -3), "width is -3; give a length in m above 0"),
        (("--width", 3, "--unit", "mm"), "unit is mm, but width are in m"),
        (("--width", 3, "--background", "7"), "has no background 7; its values are 0, 255"),
        (("--width", 3, "--background", "sky"), "has no background 'sky'; give a value, or a colour"),
        (("--width", 3, "--smallest", 2), "shows no stone"),
    ],
)
def test_what_cannot_be_read_says_what_to_write(tmp_path, capsys, options, says):
    drawn_wall()[0].save(tmp_path / "wall.png")
    code, out, error = informed(capsys, tmp_path / "wall.png", *options)
    assert (code, out) == (2, "")
    assert says in error
    assert error.count("\n") == 1


def test_a_blob_an_empty_image_and_a_photograph_are_refused(tmp_path, capsys):
    blob = Image.new("L", WALL)
    ImageDraw.Draw(blob).rectangle((20, 20, 280, 140), fill=255)
    noise = np.random.default_rng(1).integers(0, 256, (80, 80, 3)).astype(np.uint8)
    images = {
        "in a mask stones that touch are one": blob,
        "shows no stone: all of it is background (9)": Image.new("L", WALL, 9),
        "is a photograph: its colours are no labels": Image.fromarray(noise).resize(WALL, Image.Resampling.BICUBIC),
        "has the value 0.5; labels are whole numbers": Image.fromarray(np.full((9, 9), 0.5, dtype=np.float32)),
    }
    for says, image in images.items():
        image.save(tmp_path / "wall.tif")
        code, _, error = informed(capsys, tmp_path / "wall.tif", "--width", 3)
        assert (code, says in error) == (2, True), error
    (tmp_path / "wall.tif").write_bytes(b"II*\0 and nothing more")
    assert "is no image that can be read" in informed(capsys, tmp_path / "wall.tif", "--width", 3)[2]
    (tmp_path / "wall.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", encoding="utf-8")
    assert "is no image: width is of images" in informed(capsys, tmp_path / "wall.obj", "--width", 3)[2]


@pytest.mark.parametrize("ending", ["png", "jpg"])
@pytest.mark.slow
def test_a_photograph_with_openings_painted_over_is_no_mask_of_them(tmp_path, capsys, ending):
    random = np.random.default_rng(3)
    drawn, n = drawn_wall()
    wall = np.asarray(drawn.resize((600, 320), Image.Resampling.NEAREST)).astype(float)[..., None]
    noise = random.normal(0.0, 8.0, (320, 600, 3))
    pixels = np.where(wall > 0.0, (150, 120, 95), (205, 200, 190)) + noise
    image = Image.fromarray(pixels.clip(0, 255).astype(np.uint8)).filter(ImageFilter.GaussianBlur(0.7))
    for left, low, right, high in ((100, 60, 180, 140), (400, 60, 480, 140), (250, 120, 330, 280)):
        ImageDraw.Draw(image).rectangle((left, low, right, high), fill=(40, 30, 25))
    image.save(tmp_path / f"a.{ending}", quality=85)
    code, _, said = informed(capsys, tmp_path / f"a.{ending}", "--width", "3")
    assert code != 0
    assert "is a photograph" in said
    # Stones cut out of a photograph, with what is around them painted over, are a mask.
    stones = Image.fromarray(np.where(wall > 0.0, pixels, 0.0).clip(0, 255).astype(np.uint8))
    stones.save(tmp_path / f"b.{ending}", quality=95)
    assert read_layout(tmp_path / f"b.{ending}", width=3.0, smallest=0.05).n_blocks == n


def test_charts_and_shaded_drawings_are_refused_unless_their_specks_are_said(tmp_path, capsys):
    (letters, n), (hatching, _), (page, _) = (drawn_wall(mode="RGB", value=lambda k: (250, 9 * k, 9)) for _ in range(3))
    draw = ImageDraw.Draw(letters)
    for k in range(40):
        draw.rectangle((7 * k + 4, 3, 7 * k + 7, 8), (9, 9, 250))
    pixels = np.array(hatching)
    pixels[::5, ::5] = (250, 9, 9)
    page.paste((255, 255, 255), (0, 0, 300, 160))
    page.paste((254, 254, 253), (20, 20, 280, 140))
    ImageDraw.Draw(page).line([(50, 50), (90, 50), (90, 90), (50, 90), (50, 60)], fill=(90, 80, 200))
    says = {
        "28 of its 56 regions hold": letters,
        "specks beside": Image.fromarray(pixels),
        "lines on paper enclose no stone of 0.109 m across or more (smallest); close them, or": page,
    }
    for word, image in says.items():
        image.save(tmp_path / "chart.png")
        code, _, error = informed(capsys, tmp_path / "chart.png", "--width", 3)
        assert (code, word in error, error.count("\n")) == (2, True, 1), error
    letters.save(tmp_path / "chart.png")
    assert read_layout(tmp_path / "chart.png", width=3.0, smallest=0.1).n_blocks == n
    ImageDraw.Draw(page).line([(50, 60), (50, 50)], fill=(90, 80, 200))
    page.save(tmp_path / "sheet.png")
    layout = read_layout(tmp_path / "sheet.png", width=3.0)
    assert (layout.n_blocks, len(layout.left_out)) == (1, 1)


@pytest.mark.parametrize("sill", [pytest.param(240, marks=pytest.mark.thorough), 180])
def test_of_a_drawing_of_lines_the_largest_regions_may_be_openings(tmp_path, sill):
    image = Image.new("L", (340, 260), 255)
    draw = ImageDraw.Draw(image)
    stones = [(20 + 30 * i, 20 + 20 * j, 50 + 30 * i, 40 + 20 * j) for i in range(10) for j in range(11)]
    door = (140, 120, 200, sill)
    for box in [door, *(box for box in stones if not (140 <= box[0] < 200 and 120 <= box[1] < sill))]:
        draw.rectangle(box, outline=0, width=2)
    image.save(tmp_path / "lines.png")
    layout = read_layout(tmp_path / "lines.png", pixel=0.01)
    areas = [Polygon(ring).area for ring in layout.outlines]
    opening = layout.names[int(np.argmax(areas))]
    (note,) = (note for note in layout.notes if "what lines enclose" in note)
    assert note.startswith("paper around lines, 'stone 1', was left out")
    assert f"the largest: '{opening}' around (1.705, {(520 - 120 - sill - 1) / 200.0:.4g})" in note
    assert note.endswith(f'leave out what is an opening: ignore = ["{opening}"]')
    with pytest.warns(UserWarning, match="paper around lines"):
        read(tmp_path / "lines.png", pixel=0.01)
    rest = read_layout(tmp_path / "lines.png", pixel=0.01, ignore=[opening])
    assert rest.n_blocks == layout.n_blocks - 1
    assert not any("what lines enclose" in note for note in rest.notes)
    # Without paper around, as in a mask, it is a remark only.
    image.crop((21, 21, 320, 240)).save(tmp_path / "cut.png")
    notes = read_layout(tmp_path / "cut.png", pixel=0.01).notes
    said = "regions far larger than others count as blocks; the largest: '"
    # Of six stones only, as rubble has them, it is none.
    assert any(note.startswith(said) for note in notes) == (sill == 240)


def test_paper_that_the_rim_closes_is_no_stone(tmp_path):
    # Above and below voussoirs between abutments, beside which they are as small as letters.
    image = Image.new("L", (540, 260), 255)
    draw = ImageDraw.Draw(image)
    for box in [(0, 80, 60, 200), (480, 80, 539, 200), *((60 + 20 * k, 100, 80 + 20 * k, 114) for k in range(21))]:
        draw.rectangle(box, outline=0, width=2)
    image.save(tmp_path / "arch.png")
    layout = read_layout(tmp_path / "arch.png", pixel=0.01)
    assert (layout.n_blocks, [item.kind for item in layout.left_out]) == (23, ["paper"] * 2)
    assert max(np.ptp(ring[:, 0]) for ring in layout.outlines) < 0.62


@pytest.mark.parametrize("rim", [(3, 3, 3, 3), (40, 2, 9, 1)])
def test_stones_that_run_into_a_rim_are_stones(tmp_path, capsys, rim):
    """A rim of the stones' value, as of a canvas, made one face with a hole of those along the border of the image."""
    wall = np.asarray(drawn_wall()[0])[20:136, 27:273]
    Image.fromarray(wall).save(tmp_path / "wall.png")
    bare = read_layout(tmp_path / "wall.png", pixel=0.01)
    left, top, right, low = rim
    Image.fromarray(np.pad(wall, ((top, low), (left, right)), constant_values=255)).save(tmp_path / "rim.png")
    code, out, _ = informed(capsys, tmp_path / "rim.png", "--pixel", 0.01)
    assert (code, bare.n_blocks) == (0, 16)
    assert f"rim along the border of the image, {max(rim)} pixels = {max(rim) / 100:g} m wide, was taken off" in out
    layout = read_layout(tmp_path / "rim.png", pixel=0.01)
    assert not layout.left_out
    for one, other in zip(layout.outlines, bare.outlines, strict=True):
        np.testing.assert_allclose(one - [0.01 * left, 0.01 * low], other, atol=1e-9)


@pytest.mark.parametrize("reader", [read, read_layout])
def test_an_option_that_is_misspelled_is_refused(tmp_path, reader):
    """Of an image it was passed over without a word."""
    drawn_wall()[0].save(tmp_path / "wall.png")
    with pytest.raises(TypeError, match=r"there is no option backgruond .*did you mean .*background"):
        reader(tmp_path / "wall.png", width=3.0, backgruond="white")


def test_a_pinhole_does_not_lose_its_stone(tmp_path):
    image, n = drawn_wall()
    ImageDraw.Draw(image).rectangle((40, 30, 43, 33), fill=0)
    image.save(tmp_path / "wall.png")
    layout = read_layout(tmp_path / "wall.png", width=3.0, smallest=0.03)
    assert (layout.n_blocks, len(layout.left_out)) == (n, 0)
    assert any(note.startswith("pinholes were filled") for note in layout.notes)


def test_noise_in_a_stone_does_not_lose_it(tmp_path):
    """Specks within specks, and specks that hang at the joint by their corners, as where grain is as dark as mortar."""
    image, n = drawn_wall()
    stones = 1e-4 * np.count_nonzero(np.asarray(image))
    draw = ImageDraw.Draw(image)
    for x in (40, 48):
        draw.rectangle((x, 30, x + 5, 35), fill=0)
        draw.rectangle((x + 1, 31, x + 4, 34), fill=255)
    for k in range(12):
        draw.rectangle((60 + 2 * (k % 2), 20 + 2 * k, 61 + 2 * (k % 2), 21 + 2 * k), fill=0)
    # A letter below has a hole, and is no wall to fill with bricks.
    draw.ellipse((100, 138, 122, 158), outline=255, width=3)
    image.save(tmp_path / "wall.png")
    layout = read_layout(tmp_path / "wall.png", width=3.0, smallest=0.08)
    assert (layout.n_blocks, [item.kind for item in layout.left_out]) == (n, ["hole"])
    assert not any("with a bond" in note for note in layout.notes)
    assert sum(Polygon(ring).area for ring in layout.blocks) == pytest.approx(stones, rel=1e-3)


def test_pictures_beside_files_of_stones_are_no_stones(tmp_path):
    for k in range(2):
        text = f"v {k} 0 0\nv {k + 1} 0 0\nv {k + 1} 1 0\nv {k} 1 0\nf 1 2 3 4\n"
        (tmp_path / f"stone {k}.obj").write_text(text, encoding="utf-8")
    drawn_wall()[0].save(tmp_path / "preview.png")
    assert read(tmp_path).n_blocks == 2


RINGS = {
    "brick": [[20, 20], [120, 20], [120, 100], [20, 100]],
    "stone": [[120, 20], [220, 20], [220, 100], [120, 100]],
}
RUNS = [200 * 230 + 20, *[80, 120] * 49, 80, 20 * 200 + 100]


def _coco(**changes):
    flat = [[float(x) for point in ring for x in point] for ring in RINGS.values()]
    shapes = [*([ring] for ring in flat), {"size": [200, 300], "counts": RUNS}]
    return {
        "images": [{"id": 7, "file_name": "w.jpg", "width": 300, "height": 200}],
        "categories": [{"id": 1, "name": "brick"}, {"id": 2, "name": "stone"}],
        "annotations": [
            {"id": k, "image_id": 7, "category_id": min(k + 1, 2), "segmentation": shape}
            for k, shape in enumerate(shapes)
        ],
    } | changes


def _labelme():
    shapes = [{"label": label, "points": ring, "shape_type": "polygon"} for label, ring in RINGS.items()]
    shapes.append({"label": "stone", "points": [[230, 20], [280, 100]], "shape_type": "rectangle"})
    shapes.append({"label": "crack", "points": [[0, 0], [9, 9]], "shape_type": "linestrip"})
    return {"shapes": shapes, "imagePath": "w.jpg", "imageWidth": 300, "imageHeight": 200}


def _via():
    regions = [
        {
            "shape_attributes": {"name": "polygon", "all_points_x": xs, "all_points_y": ys},
            "region_attributes": {"class": label},
        }
        for label, (xs, ys) in ((label, np.transpose(ring).tolist()) for label, ring in RINGS.items())
    ]
    box = {"name": "rect", "x": 230, "y": 20, "width": 50, "height": 80}
    regions.append({"shape_attributes": box, "region_attributes": {"class": "stone"}})
    return {"_via_img_metadata": {"w.jpg1": {"filename": "w.jpg", "size": 1, "regions": regions}}}


@pytest.mark.parametrize("content", [_coco(), _labelme(), _via()], ids=["COCO", "LabelMe", "VIA"])
def test_annotations_are_blocks_with_their_label_as_group(tmp_path, capsys, content):
    (tmp_path / "w.json").write_text(json.dumps(content), encoding="utf-8")
    Image.new("L", (300, 200)).save(tmp_path / "w.jpg")
    code, out, _ = informed(capsys, tmp_path / "w.json", "--width", 3)
    assert code == 0
    assert "size            2.6 m × 0.8 m, from (0.2, 1) m" in out
    assert "areas           0.4 to 0.8 m², median 0.8, sum 2 m²" in out
    assert "groups          'stone' 2, 'brick' 1" in out
    assert ("left out: 1 shapes of kind linestrip" in out) == ("shapes" in content)


def test_a_world_file_places_annotations_of_an_image_that_is_not_there(tmp_path):
    """Whatever it is called; without one the lowest of the shapes is at zero."""
    content = json.dumps(_via()).replace("w.jpg", "pixels.jpg")
    (tmp_path / "w.json").write_text(content, encoding="utf-8")
    assert read_layout(tmp_path / "w.json", pixel=0.01).points[:, 1].min() == 0.0
    (tmp_path / "pixels.jgw").write_text("0.01 0 0 -0.01 5.005 7.995", encoding="utf-8")
    np.testing.assert_allclose(read_layout(tmp_path / "w.json").points.min(axis=0), [5.2, 7.0])


def test_packed_runs_and_several_pieces_of_coco_are_read(tmp_path):
    packed = _coco()
    packed["annotations"] = packed["annotations"][:1]
    packed["annotations"][0]["segmentation"] = {"size": [8, 8], "counts": "b04400000>"}
    (tmp_path / "w.json").write_text(json.dumps(packed), encoding="utf-8")
    layout = read_layout(tmp_path / "w.json", pixel=1.0)
    assert (float(layout.sizes[0]) ** 2, layout.points.min(axis=0).tolist()) == (16.0, [2.0, 194.0])
    with pytest.raises(ValueError, match="draws no block"):
        read_layout(tmp_path / "w.json", pixel=1.0, smallest=5.0)
    packed["annotations"][0]["segmentation"] = {"size": [8, 8], "counts": "b0440000"}
    (tmp_path / "w.json").write_text(json.dumps(packed), encoding="utf-8")
    with pytest.raises(ValueError, match="runs make"):
        read_layout(tmp_path / "w.json", pixel=1.0)
    pieces = _coco()
    pieces["annotations"] = [
        {"image_id": 7, "category_id": 2, "segmentation": [[0, 0, 9, 0, 9, 9], [20, 0, 29, 0, 29, 9]]}
    ]
    (tmp_path / "w.json").write_text(json.dumps(pieces), encoding="utf-8")
    layout = read_layout(tmp_path / "w.json", pixel=1.0)
    assert layout.names == ("stone 1-1", "stone 1-2")
    assert "1 annotation is in several pieces" in layout.notes[1]


def test_annotations_that_cannot_be_read_say_why(tmp_path, capsys):
    two = _coco(images=[{"id": 7, "file_name": "a.jpg"}, {"id": 8, "file_name": "b.jpg"}])
    two["annotations"][0] = two["annotations"][0] | {"image_id": 8}
    boxes = _coco(annotations=[{"image_id": 7, "bbox": [0, 0, 5, 5], "segmentation": []}])
    cases = {
        "annotates 2 images (a.jpg, b.jpg); export one of them alone": two,
        "outlines no stone, it has 1 boxes without an outline": boxes,
        "does not say how many pixels its image has; give pixel": _via(),
        "w.json' has annotations of COCO that cannot be read": _coco(
            annotations=[{"image_id": 7, "category_id": 1, "segmentation": [[0, 0, 10, 0, 10, 10, 5]]}]
        ),
    }
    for says, content in cases.items():
        (tmp_path / "w.json").write_text(json.dumps(content), encoding="utf-8")
        code, _, error = informed(capsys, tmp_path / "w.json", "--width", 3)
        assert (code, says in error) == (2, True), error


def test_labels_that_cover_stones_are_proposed_to_be_left_out(tmp_path):
    """The annotations are read again at the same scale."""
    content = _labelme()
    shadow = [[60, 30], [180, 30], [180, 90], [60, 90]]
    content["shapes"].append({"label": "shadow", "points": shadow, "shape_type": "polygon"})
    content["shapes"][0]["label"] = "opening"
    (tmp_path / "w.json").write_text(json.dumps(content), encoding="utf-8")
    with pytest.raises(ValueError, match=r'overlaps .*; --ignore "shadow" leaves out 1 of 4 blocks'):
        read(tmp_path / "w.json", width=3.0)
    with pytest.warns(
        UserWarning, match=r"called 'opening' counts as a stone; .* leave it out: ignore = \[\"opening\"\]"
    ):
        found = read(tmp_path / "w.json", width=np.float32(3.0), ignore="shadow")
    assert found.areas.sum() == pytest.approx(2.0)
    with pytest.raises(ValueError, match=r"w\.json': width is '3'; give a length in m above 0"):
        read_layout(tmp_path / "w.json", width="3")


@pytest.mark.parametrize("step", [1, 10])
def test_small_numbers_in_one_channel_are_labels(tmp_path, step):
    pixels = np.zeros((60, 90, 3), dtype=np.uint8)
    for k in range(3):
        pixels[10:50, 5 + 28 * k : 28 + 28 * k, 0] = step * (k + 1)
    Image.fromarray(pixels).save(tmp_path / "ids.png")
    layout = read_layout(tmp_path / "ids.png", width=1.0)
    assert layout.names == tuple(f"#{step * k:02x}0000" for k in (1, 2, 3))


def test_stones_that_run_together_through_open_joints_are_told(tmp_path):
    # A grid of joints with a gap in each: either value has holes, and the other was told to be the background.
    pixels = np.full((200, 200), 255, dtype=np.uint8)
    for k in range(25, 200, 50):
        pixels[k - 2 : k + 2, 10:190] = pixels[10:190, k - 2 : k + 2] = 0
    for k in (50, 100, 150):
        pixels[:, k - 2 : k + 2] = pixels[k - 2 : k + 2] = 255
    Image.fromarray(pixels).save(tmp_path / "mask.png")
    with pytest.raises(ValueError, match=r"has holes; .* close the joints, through whose gaps they are one"):
        read_layout(tmp_path / "mask.png", width=1.0, background="black")
