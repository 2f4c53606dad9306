"""Stills, the mechanism and the film, pixel by pixel."""

import os
import subprocess
import sys
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import imageio_ffmpeg
import numpy as np
import pytest
from PIL import Image, ImageDraw
from structures import (
    BENT,
    alike,
    arch_response,
    box,
    dropped_brick,
    film_frames,
    parted,
    partly_unbounded,
    pixels,
    rectangle,
    report_of,
    sunk_and_tilted,
    wall,
)

import blockvis
import solver
from blockvis import animate, draw_mechanism, draw_still, generators
from blockvis.cli import main
from blockvis.pictures import palette
from blockvis.pictures.curves import CurvePanel
from blockvis.pictures.drawer import Drawer, Look, magnified
from blockvis.pictures.film import film_of
from blockvis.pictures.flat_scene import FlatScene
from blockvis.pictures.frame import Frame, framed
from blockvis.pictures.swing import swing_of
from solver import mechanics

SMALL = (640, 360)


def test_what_is_where(tmp_path):
    """Cracks, hinges, blocks and supports stand at their places, in their colours."""
    response = arch_response()
    last, assembly = response.path[-1], response.assembly
    drawer = Drawer(response, Look(forces="none"), (1280, 720), (last,))
    picture = np.asarray(drawer.picture(last)).astype(int)
    left, top = drawer.sheet.inside[:2]

    def colour_at(point):
        x, y = drawer.scene.at_pixel(np.array([point]))[0].round().astype(int)
        return picture[top + y, left + x]

    corners = mechanics.moved_vertices(assembly, last.pose)
    hinges = last.contacts.points[mechanics.mechanism_of(assembly, last).hinge_points]
    crown = hinges[np.argmax(hinges[:, 1])]
    assert alike(colour_at(crown), palette.HINGE)
    assert alike(colour_at(crown - [0.0, 0.12]), palette.OPEN)
    fills = palette.block_colours(assembly.materials, assembly.free)
    for block in np.flatnonzero(assembly.free):
        assert alike(
            colour_at(corners[assembly.offsets[block] : assembly.offsets[block + 1]].mean(axis=0)), fills[block]
        )
    assert alike(colour_at(np.array([0.0, 0.3])), palette.PAPER)
    assert alike(colour_at(last.pose.positions[assembly.moving][0]), palette.SETTLEMENT)


@pytest.mark.parametrize(
    "foot", [pytest.param(0.0, marks=pytest.mark.thorough), -0.2], ids=["below its load", "at its centroid"]
)
def test_a_support_that_turns_has_an_arrow_at_both_ends(foot, tmp_path):
    """One arrow would show ground that tilts as pushed aside."""
    stones = [rectangle(-0.3, 0.4 * k, 0.3, 0.4 * k + 0.4) for k in range(8)]
    column = solver.Assembly.from_outlines([rectangle(-0.6, -0.4, 0.6, 0), *stones], roles=["moving", *["free"] * 8])
    tilts = solver.Settlement(rotation=1.0, rotation_centre=(0.0, foot), increment=0.01, limit=0.01)
    response = solver.Structure(column, friction_coefficient=0.7).settle(tilts)
    picture = pixels(draw_still(response, 0, tmp_path / "tilt.png", size=SMALL, forces="none"))
    columns = alike(picture, palette.SETTLEMENT, 30).any(axis=0)
    middle = SMALL[0] // 2
    assert not columns[middle]
    assert columns[:middle].sum() == pytest.approx(columns[middle:].sum(), abs=2)
    assert columns[middle:].sum() > 3


@pytest.mark.slow
def test_arrows_of_a_small_support_do_not_cover_it_nor_its_hinge(tmp_path):
    """Under a tower those of the two ends crossed, longer than the support, and hid where it turns."""
    tower = solver.Structure(generators.column(blocks=20, width=0.5, block_height=0.5), friction_coefficient=0.7)
    tilts = solver.Settlement(rotation=-1.0, rotation_centre=(0.0, 0.0), increment=0.02, limit=0.2)
    response = tower.settle(tilts)
    last, assembly = swing_of(response).increment, response.assembly
    drawer = Drawer(response, Look(forces="none"), (900, 1600), (last,))
    picture = np.asarray(drawer.picture(last)).astype(int)
    hinges = mechanics.mechanism_of(assembly, last).hinge_points
    x, y = drawer.scene.at_pixel(last.contacts.points[hinges])[0].round().astype(int) + drawer.sheet.inside[:2]
    assert alike(picture[y, x], palette.HINGE)
    arrows = alike(picture[: -drawer.sheet.footer], palette.SETTLEMENT, 30).any(axis=0)
    assert not arrows[drawer.scene.at_pixel(last.pose.positions[assembly.moving])[0, 0].round().astype(int)]
    width = np.ptp(assembly.outline(int(np.flatnonzero(assembly.moving)[0]))[:, 0])
    assert np.ptp(np.flatnonzero(arrows)) < 1.3 * width / drawer.scene.pixel


def test_the_arrows_of_a_support_turn_with_it(tmp_path):
    """One end of ground that tilts has sunk, and the other has risen."""
    stones = [rectangle(-0.6, -0.1, 0.6, 0.0), rectangle(-0.3, 0.0, 0.3, 0.2)]
    block = solver.Assembly.from_outlines(stones, roles=["moving", "free"])
    tilts = solver.Settlement(rotation=-1.0, rotation_centre=(0.0, -0.05), increment=0.3, limit=0.3)
    response = solver.Structure(block, friction_coefficient=0.7).settle(tilts)
    picture = pixels(draw_still(response, -1, tmp_path / "tilt.png", size=SMALL, forces="none"))
    rows, columns = np.nonzero(alike(picture, palette.SETTLEMENT, 30))
    right = columns > SMALL[0] // 2
    apart = columns[right].mean() - columns[~right].mean()
    assert rows[right].mean() - rows[~right].mean() == pytest.approx(apart * np.tan(0.3), rel=0.1)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("size", "sheet"), [((1, 30), (1080, 1920)), ((4, 4), None), ((4, 2), None), ((60, 1), (1920, 640))]
)
def test_the_sheet_of_a_still_follows_what_it_shows(size, sheet, tmp_path):
    """A tower of 1 × 30 m was 27 pixels wide in the middle of a wide sheet."""
    columns, courses = size
    stones = [rectangle(x, y, x + 1, y + 1) for y in range(courses) for x in range(columns)]
    stones.append(rectangle(0, -1, columns, 0))
    assembly = solver.Assembly.from_outlines(stones, roles=["free"] * columns * courses + ["moving"])
    sinks = solver.Settlement((0.0, -1.0), increment=0.01, limit=0.01)
    response = solver.Structure(assembly, friction_coefficient=0.7).settle(sinks)
    picture = pixels(draw_still(response, -1, tmp_path / "still.png", forces="none"))
    height, width = picture.shape[:2]
    assert (width, height) == sheet if sheet else width * height == pytest.approx(1920 * 1080, rel=1e-3)
    drawn = (picture[250 : height - 150] < 250).any(axis=2)
    extents = np.ptp(np.flatnonzero(drawn.any(axis=0))), np.ptp(np.flatnonzero(drawn.any(axis=1)))
    assert max(extents[0] / width, extents[1] / (height - 400)) > 0.85


@pytest.mark.parametrize(
    ("width", "curve", "size"),
    [
        (40, True, (1280, 426)),
        pytest.param(1, False, (720, 1280), marks=pytest.mark.slow),
        pytest.param(1, True, None, marks=pytest.mark.slow),
    ],
)
def test_the_sheet_of_a_film_follows_what_it_shows(width, curve, size, tmp_path):
    """Films, and stills with a curve, were 16 by 9 whatever they show."""
    stones = [rectangle(0, -1, width, 0), rectangle(0, 0, width, 5)]
    block = solver.Assembly.from_outlines(stones, roles=["moving", "free"])
    sinks = solver.Settlement((0.0, -1.0), increment=0.01, limit=0.01)
    response = solver.Structure(block, friction_coefficient=0.7).settle(sinks)
    film = animate(response, tmp_path / "frames", fps=2, seconds=1, curve=curve, joints=False, forces="none")
    drawn = pixels(film / "frame_00000.png").shape[1::-1]
    assert drawn == size if size else drawn[0] < drawn[1] and not any(np.mod(drawn, 2)), drawn


@pytest.mark.parametrize("space", [False, True], ids=["of shallow ground", "magnified in space"])
@pytest.mark.slow
def test_arrows_of_supports_are_drawn_whole(space, tmp_path):
    if space:
        solids = [box((-1, -1, -0.4), (1, 1, 0)), box((-0.6, -0.6, 0), (0.6, 0.6, 1))]
        column = solver.Assembly.from_solids(solids, roles=["moving", "free"])
    else:
        stones = [rectangle(-0.3, 0.4 * k, 0.3, 0.4 * k + 0.4) for k in range(30)]
        column = solver.Assembly.from_outlines(
            [rectangle(-0.6, -0.1, 0.6, 0), *stones], roles=["moving", *["free"] * 30]
        )
    motion = solver.Settlement((1, 0, 0) if space else (0, -1), increment=0.04, limit=0.04)
    response = solver.Structure(column, friction_coefficient=0.7).settle(motion)
    options = {"size": (500, 500), "magnification": 20.0, "view": "top"} if space else {"size": (1920, 1080)}
    picture = pixels(draw_still(response, -1, tmp_path / "still.png", forces="none", **options))
    lengths = np.ptp(np.argwhere(alike(picture, palette.SETTLEMENT)), axis=0)
    assert lengths.max() >= (35 if space else 42), lengths


@pytest.mark.slow
def test_supports_that_settle_under_a_live_load_have_arrows_whatever_the_colours(tmp_path):
    case = '[geometry]\nlayout = "arch"\nparameters = { voussoirs = 5 }\n[material]\nfriction_coefficient = 0.8\n'
    case += "[settlement]\ndirection = [1, 0]\nincrement = 0.002\nlimit = 0.004\n"
    case += '[analysis]\nkind = "limit load"\ndisplacement = 0\n[[loads]]\nkind = "live"\nweight_fraction = [0.1, 0]\n'
    (tmp_path / "case.toml").write_text(case, encoding="utf-8")
    response = blockvis.run_case(tmp_path / "case.toml", tmp_path / "out", outputs=()).response
    stills = [
        pixels(draw_still(response, 1, tmp_path / "still.png", size=SMALL, forces="none", colour_by=colours))
        for colours in ("material", "mechanism")
    ]
    one, other = (int(alike(picture, palette.SETTLEMENT, 30).sum()) for picture in stills)
    assert one == other > 20


@pytest.mark.parametrize(
    "acts", ["force = [0, -1000]", pytest.param("weight_fraction = [0, -0.1]", marks=pytest.mark.thorough), ""]
)
def test_dead_loads_beside_the_weight_have_arrows_where_they_act(tmp_path, acts):
    case = '[geometry]\nlayout = "portal"\n[settlement]\ndirection = [0, -1]\nlimit = 0.01\n'
    case += f'[[loads]]\nblocks = "lintel"\n{acts}\n' if acts else ""
    (tmp_path / "case.toml").write_text(case, encoding="utf-8")
    response = blockvis.run_case(tmp_path / "case.toml", tmp_path / "out", outputs=()).response
    picture = pixels(draw_still(response, -1, tmp_path / "still.png", size=(1280, 720), forces="none"))
    arrow = np.argwhere(alike(picture, palette.LOADS["dead"], 30)[:576])
    assert (len(arrow) > 20) == bool(acts)
    if acts:
        # Upright over the middle of the lintel, which is that of the picture.
        assert np.ptp(arrow[:, 0]) > 3 * np.ptp(arrow[:, 1])
        assert arrow[:, 1].mean() == pytest.approx(640.0, abs=3.0)


def test_bent_blocks_are_filled_without_triangle_lines():
    assembly = solver.Assembly.from_outlines(list(BENT.values()))
    frame = Frame(np.array([-1.0, -1.0]), np.array([15.0, 4.0]))
    fill = np.full((3, 3), 200, dtype=np.uint8)
    scene = FlatScene(assembly, frame, (800, 250), fill)
    picture = np.asarray(scene.image()).astype(int)

    def row(points):
        return np.array([picture[y, x] for x, y in scene.at_pixel(np.array(points)).round().astype(int)])

    notches = row([[1.5, 2.0], [5.5, 2.0], [10.5, 1.5], [12.5, 1.5]])
    assert alike(notches, palette.PAPER).all()
    # Along the body of each shape, away from its outline, one colour: no line of a triangle crosses it.
    for low, high, y in ((0.2, 1.8, 0.5), (4.2, 6.8, 0.5), (9.2, 13.8, 0.5)):
        assert alike(row([[x, y] for x in np.linspace(low, high, 60)]), (200, 200, 200), 2).all()


def test_nothing_leaves_the_picture_in_any_frame():
    response = arch_response()
    drawer = Drawer(response, Look(), SMALL, response.increments)
    left, top, right, bottom = drawer.sheet.inside
    for increment in response.increments[::4] + response.increments[-1:]:
        picture = np.asarray(drawer.picture(increment)).astype(int)[top:bottom, left:right]
        for edge in (picture[0], picture[-1], picture[:, 0], picture[:, -1]):
            assert alike(edge, palette.PAPER).all()


def test_frames_differ_and_the_fall_is_marked(tmp_path):
    response = arch_response()
    first = pixels(draw_still(response, 0, tmp_path / "first.png", size=SMALL))
    last = pixels(draw_still(response, len(response.path) - 1, tmp_path / "last.png", size=SMALL))
    fallen = pixels(draw_still(response, np.int64(-1), tmp_path / "fallen.png", size=SMALL))
    assert first.shape == (360, 640, 3)
    assert (np.abs(first - last).max(axis=2) > 30).sum() > 1000
    assert (alike(fallen[:40], palette.WARNING)).sum() > 500
    assert not alike(last[:40], palette.WARNING).any()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["fallen.png", "first.png", "last.png"]


def test_options_change_the_picture(tmp_path):
    response = arch_response()
    number = len(response.path) - 1
    drawn = {
        name: pixels(draw_still(response, number, tmp_path / f"{name}.png", size=SMALL, **options))
        for name, options in {
            "plain": {"forces": "none", "joints": False},
            "thrust": {},
            "points": {"forces": "points"},
            "displacement": {"colour_by": "displacement"},
            "curve": {"curve": True},
            "magnified": {"magnification": 2.0},
        }.items()
    }
    for name, picture in drawn.items():
        others = [other for key, other in drawn.items() if key != name]
        assert all((picture != other).any() for other in others), name
    assert not alike(drawn["plain"], palette.FORCE).any()
    assert not alike(drawn["plain"], palette.OPEN).any()
    assert alike(drawn["thrust"], palette.FORCE).sum() > 200
    scale = drawn["displacement"][:, 560:]
    assert all(alike(scale, colour).any() for colour in palette.RAMP[1:-1])


@pytest.mark.slow
def test_a_drawing_of_cracks_says_what_it_leaves_out(tmp_path, words):
    """The pier stands on ground that does not move: no joint of what stands is open."""
    out = blockvis.write(dropped_brick(0.05), tmp_path / "out")
    assert main(["render", str(out), "--cracks", "-1"]) == 0
    assert words[-1]["detail"].startswith("no joint of what stands is open   ·   1 block lost, not drawn")


def test_magnified_blocks_have_no_points_of_contact(tmp_path, words):
    """They would float in the air between blocks that are drawn apart."""
    response = arch_response()
    options = {"size": SMALL, "magnification": 2.0, "forces": "points"}
    picture = pixels(draw_still(response, len(response.path) - 1, tmp_path / "a.png", **options))
    assert not alike(picture, palette.FORCE).any()
    assert alike(picture, palette.OPEN).any()
    told = "hinges, sliding joints and forces are shown at true scale only"
    assert [key.text for key in words[0]["keys"]] == ["open joint", told]


def test_of_many_magnified_blocks_no_marks_are_promised_at_true_scale(tmp_path, monkeypatch, words):
    monkeypatch.setattr("blockvis.pictures.drawer.FEW_BLOCKS", 2)
    response = arch_response()
    draw_still(response, len(response.path) - 1, tmp_path / "a.png", size=SMALL, magnification=2.0)
    assert [key.text for key in words[0]["keys"]] == ["open joint", "hinges, sliding joints and forces not shown"]


@pytest.mark.thorough
def test_in_space_the_mechanism_is_said_to_be_drawn_moved_on(tmp_path, words):
    """Blocks stand off the equilibrium that the title gives; and nothing settles, so no support is."""
    solids = [box((-1, -1, -0.4), (1, 1, 0)), box((-0.2, -0.2, 0), (0.2, 0.2, 1))]
    column = solver.Assembly.from_solids(solids, roles=["moving", "free"])
    push = solver.Loads(solver.self_weight(column).dead, solver.weight_fraction(column, (1.0, 0.0, 0.0)))
    response = solver.limit_load(column, loads=push, friction_coefficient=0.9).response
    draw_mechanism(response, tmp_path / "a.png", size=SMALL)
    assert words[0]["badge"] == "MECHANISM · pseudo-motion"
    assert [key.text for key in words[0]["keys"]][-2:] == [
        "motion, blocks drawn after it (not to scale)",
        "at equilibrium",
    ]
    report = report_of(response).replace(" ", "")
    assert '"roles":[1,0]' in report
    assert '"loads":[["live","liveload\\u00b7\\u03b1",' in report


@pytest.mark.thorough
def test_what_does_not_stand_before_its_limit_load_is_told_as_that(tmp_path, words):
    solids = [box((-1, -1, -0.4), (1, 1, 0)), box((0.9, -0.2, 0), (1.3, 0.2, 1))]
    leaning = solver.Assembly.from_solids(solids, roles=["fixed", "free"])
    push = solver.Loads(solver.self_weight(leaning).dead, solver.weight_fraction(leaning, (0.0, 1.0, 0.0)))
    response = solver.limit_load(leaning, loads=push, friction_coefficient=0.9).response
    draw_mechanism(response, tmp_path / "a.png", size=SMALL)
    assert "no equilibrium under the dead load" in str(words[0])
    assert [key.text for key in words[0]["keys"]][-1] == "as drawn"


def test_mechanism_shows_parts_and_motion(tmp_path):
    picture = pixels(draw_mechanism(arch_response(), tmp_path / "mechanism.png", size=(1280, 720)))
    body = picture[100:600]
    tinted = palette.part_colours(palette.block_colours(("",), np.array([True])).repeat(4, 0), np.arange(4))
    for tint in tinted:
        assert alike(body, tint, 6).sum() > 2000
    assert alike(body, palette.SETTLEMENT).sum() > 500


@pytest.mark.thorough
def test_one_rattling_brick_does_not_hide_the_motion_of_a_wall(tmp_path):
    calm = parted(wall(24, 16), 2, 0)
    calm = replace(calm, collapse=None, stop=solver.Status.LIMIT_REACHED)
    last = calm.path[-1]
    velocity = last.velocity.copy()
    middle = np.argmin(np.hypot(*(calm.assembly.centroids - [4.8, 0.8]).T))
    assert velocity[middle, 1] < 0.0
    velocity[middle, 0] = 30.0
    rattling = replace(calm, increments=(*calm.increments[:-1], last.with_arrays(velocity=velocity)))
    one, other = (pixels(draw_mechanism(r, tmp_path / "mechanism.png", size=SMALL))[70:300] for r in (calm, rattling))
    assert alike(one, palette.SETTLEMENT).sum() > 50
    assert (np.abs(one - other).max(axis=2) > 30).mean() < 0.01


@pytest.mark.thorough
def test_mechanism_of_a_structure_that_never_stood(tmp_path):
    assembly = solver.Assembly.from_outlines(
        [[[0, 0], [1, 0], [1, 1], [0, 1]], [[0.9, 1], [3, 1], [3, 2], [0.9, 2]], [[-1, -1], [1, -1], [1, 0], [-1, 0]]],
        roles=["free", "free", "moving"],
    )
    response = solver.settle(assembly, solver.Settlement(direction=(0, -1)))
    assert response.stop == solver.Status.NO_INITIAL_EQUILIBRIUM
    picture = pixels(draw_mechanism(response, tmp_path / "mechanism.png", size=SMALL))
    assert alike(picture, palette.SETTLEMENT).sum() > 50
    thin = solver.settle(generators.arch(thickness_ratio=0.05), solver.Settlement((1, 0)), friction_coefficient=2.0)
    assert len(thin.increments) == 1
    with Image.open(animate(thin, tmp_path / "film.gif", size=(320, 180), fps=10)) as film:
        first = np.asarray(film.convert("RGB")).astype(int)
        film.seek(film.n_frames - 1)
        assert (np.abs(first - np.asarray(film.convert("RGB"))) > 30).sum() > 1000, "the mechanism swings out"


def test_films_have_their_frames(tmp_path, monkeypatch):
    monkeypatch.setattr("blockvis.pictures.render.fall_of", lambda response: None)
    response = parted(wall(6, 5), 4, 3)
    path = animate(response, tmp_path / "film.mp4", size=(320, 180), fps=10, seconds=1.0)
    # 10 on the path, the last of them held for 5, 3 of the fall, held for 8.
    frames, seconds = imageio_ffmpeg.count_frames_and_secs(str(path))
    assert frames == 26
    assert seconds == pytest.approx(2.6, abs=0.05)
    first, *_, last = film_frames(path)
    assert first.shape == (180, 320, 3)
    assert (np.abs(first.astype(int) - last) > 30).sum() > 2000
    assert [p.name for p in tmp_path.iterdir()] == [path.name]


@pytest.mark.slow
def test_a_gif_of_too_many_frames_per_second_has_fewer_and_lasts_as_long(tmp_path, monkeypatch):
    planned = []
    monkeypatch.setattr("blockvis.pictures.render.film_of", lambda drawer, fps, *rest: planned.append(fps))
    monkeypatch.setattr("blockvis.pictures.render.write_film", lambda frames, path, *, fps, **rest: planned.append(fps))
    for name in ("film.gif", "film.mp4"):
        animate(parted(wall(6, 5), 4, 3), tmp_path / name, size=SMALL, fps=100.0)
    assert planned == [50.0, 50.0, 100.0, 100.0]


@pytest.mark.slow
def test_the_scale_of_displacements_tells_that_a_fall_goes_further(tmp_path, monkeypatch):
    """The last tick has a sign beside its number."""
    words, told = [], []
    monkeypatch.setattr(ImageDraw.ImageDraw, "text", lambda draw, at, said, *look, **more: words.append(str(said)))
    for falls in (True, False):
        words.clear()
        if not falls:
            monkeypatch.setattr("blockvis.pictures.render.fall_of", lambda response: None)
        options = {"size": SMALL, "fps": 2, "seconds": 1.0, "colour_by": "displacement"}
        animate(arch_response(), tmp_path / f"{falls}", **options)
        told.append({word for word in words if word.startswith("≥ ")})
    assert len(told[0]) == 1
    assert not told[1]


@pytest.mark.slow
def test_films_that_cannot_be(tmp_path):
    with pytest.raises(ValueError, match=r"641 × 360.*even"):
        animate(arch_response(), tmp_path / "odd.mp4", size=(641, 360))
    with pytest.raises(ValueError, match=r"film\.avi.*\.mp4, \.gif, \.webp"):
        animate(arch_response(), tmp_path / "film.avi", size=SMALL)
    with pytest.raises(ValueError, match=r"pic' is no picture that blockvis draws; end its name in \.png"):
        draw_still(arch_response(), 0, tmp_path / "pic", size=SMALL)
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_wrong_options_are_named(tmp_path):
    with pytest.raises(ValueError, match="colour_by is 'weight'; choose from material, mechanism, displacement"):
        draw_still(arch_response(), 0, tmp_path / "a.png", colour_by="weight")
    with pytest.raises(ValueError, match="magnification is -1"):
        draw_still(arch_response(), 0, tmp_path / "a.png", magnification=-1.0)
    with pytest.raises(ValueError, match="size is 0 × 10 pixels, which leave the blocks none"):
        draw_still(arch_response(), 0, tmp_path / "a.png", size=(0, 10))
    with pytest.raises(ValueError, match=r"there is no increment 99; the response has \d+, 0 to"):
        draw_still(arch_response(), 99, tmp_path / "a.png")
    with pytest.raises(ValueError, match="fps is 0; it must be a positive number"):
        animate(arch_response(), tmp_path / "a.mp4", fps=0, size=SMALL)
    with pytest.raises(ValueError, match="seconds is -1; it must be a positive number"):
        animate(arch_response(), tmp_path / "a.mp4", seconds=-1, size=SMALL)


@pytest.mark.thorough
def test_a_support_that_turns_stays_in_the_frame():
    blocks = [
        rectangle(0, 0, 1, 0.5),
        rectangle(1.5, -2.5, 2, -2),
        rectangle(-3, -0.5, 1, 0),
        rectangle(0, -3, 3, -2.5),
    ]
    assembly = solver.Assembly.from_outlines(blocks, roles=["free", "free", "moving", "fixed"])
    turn = solver.Settlement(rotation_centre=(1.0, 0.0), rotation=-1.0, increment=0.25, limit=0.5)
    response = solver.settle(assembly, turn, friction_coefficient=2.0)
    drawer = Drawer(response, Look(forces="none"), SMALL, response.path)
    frame = drawer.frame.fitted(*drawer.sheet.inside_size)
    for increment in (response.path[0], response.path[-1]):
        corners = mechanics.moved_vertices(assembly, increment.pose)[assembly.block_of_vertex == 2]
        assert (corners > frame.low).all()
        assert (corners < frame.high).all()


def test_huge_supports_do_not_shrink_the_structure():
    assembly = wall(6, 5)
    wide = solver.Assembly.from_outlines(
        [*(assembly.outline(k) for k in range(assembly.n_blocks)), [[-900, -50], [900, -50], [900, -1], [-900, -1]]],
        roles=[*assembly.roles, "fixed"],
    )
    frame = framed(wide, [solver.Pose.initial(wide)])
    assert frame.size.max() < 3.0


def test_supports_that_end_just_outside_are_shown_whole():
    """The lower corner of a ground that slopes was cut off flat."""
    turn = np.array([[np.cos(0.2), np.sin(0.2)], [-np.sin(0.2), np.cos(0.2)]])
    outlines = [rectangle(-1, 0, 1, 2) @ turn, rectangle(-1.3, -0.2, 1.3, 0) @ turn]
    assembly = solver.Assembly.from_outlines(outlines, roles=["free", "fixed"])
    frame = framed(assembly, [solver.Pose.initial(assembly)], margin=0.0, supports=0.08)
    assert frame.low[1] == pytest.approx(outlines[1][:, 1].min())


def test_supports_are_shown_whole_where_there_is_room():
    outlines = [[[-0.5, 0], [0.5, 0], [0.5, 1], [-0.5, 1]], [[-0.8, -0.5], [0.8, -0.5], [0.8, 0], [-0.8, 0]]]
    block = solver.Assembly.from_outlines(outlines, roles=["free", "fixed"])
    pose = [solver.Pose.initial(block)]
    assert framed(block, pose, margin=0.0, supports=0.1).size.tolist() == pytest.approx([1.2, 1.1])
    assert framed(block, pose, margin=0.0, supports=0.1, whole=1.75).size.tolist() == pytest.approx([1.6, 1.5])
    assert framed(block, pose, margin=0.0, supports=0.1, whole=1.5).size.tolist() == pytest.approx([1.2, 1.1])


def test_magnified_keeps_blocks_rigid():
    response = arch_response()
    pose = magnified(response.assembly, response.path[-1].pose, 3.0)
    corners = mechanics.moved_vertices(response.assembly, pose)
    lengths = np.hypot(*(corners[response.assembly.polygons.next_vertex] - corners).T)
    np.testing.assert_allclose(lengths, response.assembly.polygons.edge_lengths, rtol=1e-12)
    moved = pose.displacements(response.assembly)
    np.testing.assert_allclose(moved, 3.0 * response.path[-1].pose.displacements(response.assembly), atol=1e-12)


def frames_of(response, **options):
    """Frames of a film of four seconds, and what the progress says."""
    told = []
    drawer = Drawer(response, Look(colour_by="mechanism"), SMALL, response.increments, **options)
    frames = [np.asarray(frame) for frame in film_of(drawer, 25.0, 4.0, lambda *counted: told.append(counted))]
    return frames, told


@pytest.mark.slow
def test_every_frame_of_the_path_is_new_and_nothing_stands_for_long():
    frames, told = frames_of(parted(wall(6, 5), 4, 3, settlement=0.05))
    # Four seconds of path, half a second before three frames of the fall, and the end.
    assert len(frames) == 100 + 12 + 3 + 20
    assert told == [(k + 1, len(frames)) for k in range(len(frames))]
    differs = [bool((a != b).any()) for a, b in pairwise(frames)]
    assert all(differs[:99])
    assert not any(differs[99:111])
    assert all(differs[111:114])
    assert not any(differs[114:])


@pytest.mark.slow
def test_the_caption_of_a_frame_is_of_the_frame(words):
    frames_of(parted(wall(6, 5), 4, 3, settlement=0.05))
    settlements = [float(said["title"].split()[1]) for said in words if "Reaction" in said["title"]]
    np.testing.assert_allclose(settlements, np.linspace(0.0, 50.0, 100), atol=0.006)


@pytest.mark.slow
def test_frames_of_the_fall_end_where_nothing_moves():
    falling = parted(wall(6, 5), 4, 3)
    resting = replace(falling, increments=(*falling.increments, *[falling.increments[-1]] * 9))
    assert frames_of(resting)[1] == frames_of(falling)[1]


@pytest.mark.thorough
def test_the_film_has_the_tints_and_dots_of_the_mechanism(tmp_path):
    response = arch_response()
    picture = pixels(draw_mechanism(response, tmp_path / "mechanism.png", size=(1280, 720)))
    drawer = Drawer(response, Look(colour_by="mechanism", forces="none"), (1280, 720), response.path)
    last = np.asarray(drawer.picture(response.path[-1])).astype(int)
    parts = mechanics.rigid_parts(response.assembly, swing_of(response).increment)
    tinted = palette.part_colours(palette.block_colours(("",), np.array([True])).repeat(4, 0), np.arange(4))
    assert parts.max() == 3
    for tint in tinted:
        assert alike(last[100:600], tint, 6).sum() > 2000
    # As many dots: they are of one size in both, up to the scale.
    ends = swing_of(response).increment
    hinges = ends.contacts.points[mechanics.mechanism_of(response.assembly, ends).hinge_points]
    left, top = drawer.sheet.inside[:2]
    for x, y in drawer.scene.at_pixel(hinges).round().astype(int):
        assert alike(last[top + y, left + x], palette.HINGE)
    assert alike(picture[100:600], palette.HINGE).any()


def test_the_tints_of_the_mechanism_do_not_flash():
    """Of three increments with one mechanism another lies between the first two: only the last two have its tints."""
    arch = arch_response()
    last, size = arch.path[-1], (640, 360)
    other = replace(last.with_arrays(velocity=np.zeros_like(last.velocity)), parameter=0.01)
    path = replace(last, parameter=0.0), other, replace(last, parameter=0.02), last
    response = replace(arch, increments=path, collapse=None)
    drawer = Drawer(response, Look(colour_by="mechanism", forces="none"), size, path)
    tints = {tuple(tint) for tint in drawer.tints[arch.assembly.free]}
    pictures = [np.asarray(drawer.picture(one))[60:300] for one in path]
    assert [all(alike(picture, tint, 6).any() for tint in tints) for picture in pictures] == [False, False, True, True]


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="asks Linux for the memory of a process")
@pytest.mark.thorough
def test_drawing_takes_little_memory_at_any_size(tmp_path):
    """In a process of its own: what the libraries of the pictures hold, Python does not see."""
    code = f"""
from structures import parted, wall
from blockvis import draw_still
draw_still(parted(wall(12, 9), 2, 0), 0, {str(tmp_path / "large.png")!r}, size=(5000, 3500))
# Not ru_maxrss, which begins with what the parent held when it started this process.
print(next(int(line.split()[1]) / 1024 for line in open("/proc/self/status") if line.startswith("VmHWM")))
"""
    path = os.pathsep.join([*sys.path])
    child = [sys.executable, "-c", code]
    told = subprocess.run(child, check=True, capture_output=True, text=True, env=os.environ | {"PYTHONPATH": path})
    assert float(told.stdout) < 400.0
    with Image.open(tmp_path / "large.png") as picture:
        assert picture.size == (5000, 3500)


def test_the_dot_moves_along_the_curve_beside_the_blocks():
    response = arch_response()
    panel = CurvePanel(response, (300, 200), 14)
    places = [np.nonzero(alike(panel.image(k), palette.SETTLEMENT, 20)) for k in (response.path[0], response.path[-1])]
    (start, end) = (np.mean(place, axis=1) for place in places)
    assert end[1] > start[1] + 100
    assert end[0] < start[0]


@pytest.mark.thorough
def test_the_curve_beside_the_blocks_has_no_dot_for_a_phase_that_is_not_on_it():
    response = sunk_and_tilted(0.1)
    panel = CurvePanel(response, (300, 200), 12)
    blank = panel.image(response.path[1])
    assert not alike(blank, palette.SETTLEMENT, 20).any()
    assert alike(panel.image(response.path[-1]), palette.SETTLEMENT, 20).any()


def test_the_dot_is_where_the_curve_is():
    response = partly_unbounded(5)
    panel = CurvePanel(response, (300, 200), 14)
    dots = [alike(panel.image(state), palette.SETTLEMENT, 20).any() for state in response.path]
    assert dots == [True, True, False, True, True]


def test_what_a_limit_load_is_without_is_not_drawn():
    outlines = [rectangle(x, y, x + 1.0, y + 1.0) for x, y in ((0.0, -1.0), (0.0, 0.0), (0.0, 1.0))]
    tower = solver.Assembly.from_outlines(outlines, roles=["fixed", "free", "free"])
    structure = solver.Structure(tower, friction_coefficient=0.6)
    limit = structure.limit_load(acceleration=(1, 0), fallen=np.arange(3) == 2)
    state = limit.response.path[0]
    drawer = Drawer(limit.response, Look(forces="none"), SMALL, (state,))
    column, row = drawer.scene.at_pixel(np.array([(0.5, 1.5)]))[0].astype(int) + drawer.sheet.inside[:2]
    assert alike(np.asarray(drawer.picture(state))[row, column], palette.PAPER)


def test_supports_stand_on_the_ground_of_a_fall():
    """One at rest hung in the air where the other had sunk by more than it is thick."""
    outlines = [rectangle(x, -0.4, x + 1.0, 0.0) for x in (0, 2)] + [rectangle(x, 0.0, x + 1.0, 1.0) for x in (0, 2)]
    assembly = solver.Assembly.from_outlines(outlines, roles=["fixed", "moving", "free", "free"])
    pose = solver.Pose.initial(assembly)
    pose.positions[[1, 3], 1] -= 0.8
    frame = Frame(np.array([-0.5, -2.0]), np.array([3.5, 2.0]))
    scene = FlatScene(assembly, frame, (400, 400), np.full((4, 3), 128, dtype=np.uint8))
    scene.show_ground(-1.0)
    scene.pose(pose)
    drawn = (np.asarray(scene.image()) < 240).any(axis=2)
    # Rows and columns below the one at rest, between both, and what is left below the other.
    below, between, left = drawn[245:295, 55:145], drawn[205:295, 155:245], drawn[245:295, 255:345]
    assert below.mean() > 0.05
    assert not between.any()
    assert left.all()
