"""The drawing of the cracks: each main crack in its colour, as thick as it is open, with its width."""

import numpy as np
import pytest
from structures import arch_response, box, in_either, pixels, posed, rectangle

import solver
from blockvis.pictures import crack_drawing, palette
from blockvis.pictures.crack_drawing import draw_cracks
from blockvis.pictures.cracks_in_space import class_limits
from blockvis.pictures.drawer import Drawer, Look
from blockvis.results.cracks import cracks_of, main_cracks
from blockvis.text import width_text
from solver import mechanics

SIZE = (640, 360)


def covered(picture, colour, tolerance=6):
    """Pixels of the blocks' picture, without caption and legend, in a colour."""
    return int((np.abs(picture[50:310] - colour) <= tolerance).all(axis=2).sum())


def details(words):
    """The second lines of the drawings."""
    return [said["detail"] for said in words]


def test_each_main_crack_has_its_colour_and_its_width(tmp_path, monkeypatch):
    response, written = arch_response(), []
    monkeypatch.setattr(crack_drawing, "write_labels", lambda picture, places, words, *_: written.extend(words))
    picture = pixels(draw_cracks(response, -1, tmp_path / "cracks.png", size=SIZE))
    cracks = cracks_of(response.assembly, response.path[-1].pose)
    main = main_cracks(cracks)
    numbers = [number for number, crack in enumerate(cracks, start=1) if any(crack is one for one in main)]
    assert written == [f"{n}: {width_text(cracks[n - 1].width)}" for n in numbers]
    assert len(main) >= 3
    for colour in palette.SURVEYED[: len(main)]:
        assert covered(picture, colour) > 10
    assert covered(picture, palette.SETTLEMENT) > 10
    # The widest are the thickest, and nothing of statics is drawn.
    assert covered(picture, palette.SURVEYED[0]) > covered(picture, palette.SURVEYED[len(main) - 1])
    assert not covered(picture, palette.OPEN)
    assert not covered(picture, palette.HINGE)


def test_any_increment_is_drawn_on_demand(tmp_path):
    response = arch_response()
    at_rest = pixels(draw_cracks(response, 0, tmp_path / "rest.png", size=SIZE))
    assert not any(covered(at_rest, colour) for colour in palette.SURVEYED)
    last = draw_cracks(response, len(response.path) - 1, tmp_path / "last.png", size=SIZE)
    assert last.read_bytes() == draw_cracks(response, -1, tmp_path / "same.png", size=SIZE).read_bytes()
    with pytest.raises(ValueError, match="these lie in the plane: leave both out"):
        draw_cracks(response, 0, tmp_path / "none.png", view="front")
    with pytest.raises(ValueError, match=f"no increment 999; the response has {len(response.path)}, 0 to"):
        draw_cracks(response, 999, tmp_path / "none.png")


def test_a_crack_may_be_as_long_as_a_wall():
    n = 1200
    stones = [rectangle(k, 0.0, k + 1.0, 0.5) for k in range(n)]
    row = solver.Assembly.from_outlines([rectangle(-1.0, -1.0, n + 1.0, 0.0), *stones], roles=["fixed", *n * ["free"]])
    drawn = solver.Pose.initial(row)
    lifted = solver.Pose(drawn.positions + 0.01 * np.outer(row.free, (0.0, 1.0)), drawn.rotations)
    (crack,) = cracks_of(row, lifted)
    assert len(crack.joints) == n


@pytest.mark.slow
def test_cracks_in_space_are_darker_where_they_are_wider(tmp_path, monkeypatch):
    """Two boxes whose joint opens like a wedge by up to 80 mm: four classes, and the label of the only crack."""
    assembly = solver.Assembly.from_solids([box((-1, 0, 0), (0, 1, 1)), box((0, 0, 0), (1, 1, 1))])
    response = posed(assembly, solver.Pose.initial(assembly))
    at_rest = pixels(draw_cracks(response, 0, tmp_path / "rest.png", size=SIZE))
    pose = solver.Pose.initial(assembly)
    pose.positions[1] += 0.04, 0.0, 0.0
    pose.rotations[1] = 0.0, 0.08, 0.0
    written = []
    monkeypatch.setattr(
        "blockvis.pictures.cracks_in_space.write_labels", lambda picture, places, words, *_: written.extend(words)
    )
    picture = pixels(draw_cracks(posed(assembly, pose), -1, tmp_path / "cracks.png", size=SIZE))
    width = cracks_of(assembly, pose)[0].width
    assert written == [f"1: {width_text(width)}"]
    assert class_limits(width) == [0.01, 0.02, 0.05]
    narrow, *_, wide = (covered(picture, colour, 30) for colour in palette.crack_colours(4))
    assert wide > 50
    assert wide > narrow
    assert not any(covered(at_rest, colour) for colour in palette.crack_colours(4))


@pytest.mark.slow
def test_cracks_that_a_section_cuts_away_are_not_shown(tmp_path, words):
    """Three boxes in a row, of two joints the one that is open by 20 mm is cut away, or one lies in the section."""
    assembly = solver.Assembly.from_solids([box((x, 0, 0), (x + 1, 1, 1)) for x in (0, 1, 2)])
    pose = solver.Pose.initial(assembly)
    pose.positions[:, 0] += -0.005, 0.0, 0.02
    for section, view in (
        ("x = 1.5", "left"),
        ("x = 1.5", "right"),
        ("y = 0.5", "front"),
        ("x = 0.5", "right"),
        ("x = 1", "left"),
    ):
        draw_cracks(posed(assembly, pose), -1, tmp_path / "cracks.png", size=SIZE, section=section, view=view)
    assert ["   ·   ".join(detail.split("   ·   ")[:2]) for detail in details(words)] == [
        "2 cracks, of which the section shows 1   ·   the widest 20 mm",
        "2 cracks, of which the section shows 1   ·   the widest 5 mm",
        "2 cracks   ·   the widest 20 mm",
        "2 cracks, of which the section shows none   ·   drawn on the layout",
        "2 cracks, of which the section shows 1   ·   the widest 20 mm",
    ]
    assert [detail.split("   ·   ")[-1] for detail in details(words)] == [
        f"section {plane} m" for plane in ("x = 1.5", "x = 1.5", "y = 0.5", "x = 0.5", "x = 1")
    ]


def test_labels_stand_at_the_widest_point_of_a_joint(monkeypatch):
    """A joint that opens at one end has its label there, not at its middle."""
    seen = []
    monkeypatch.setattr("blockvis.pictures.drawer.write_labels", lambda picture, places, *_: seen.extend(places))
    response = arch_response()
    last = response.path[-1]
    drawer = Drawer(response, Look(), SIZE, (last,))
    drawer.picture(last, widths=True)
    found = main_cracks(cracks_of(response.assembly, last.pose))
    joints = drawer.joints
    start, ends = solver.Pose.initial(response.assembly), joints.rings
    on_a, on_b = (
        mechanics.carried(ends.points, block[ends.ring], start, last.pose).reshape(-1, 2, 2)
        for block in (joints.block_a, joints.block_b)
    )
    for crack, place in zip(found, seen, strict=True):
        gap = np.linalg.norm((on_a - on_b)[crack.joints[0]], axis=1)
        widest = (on_a + on_b)[crack.joints[0], gap.argmax()] / 2.0
        np.testing.assert_allclose(place, drawer.scene.at_pixel(widest[None])[0], atol=0.01)


ROW = [(-1, -1, 9, 0), (0, 0, 2, 1), (2, 0, 4, 1), (4, 0, 6, 1)]
COURSES = [(-1, -1, 9, 0), (0, 0, 2, 1), (2, 0, 4, 1), (0, 1, 2, 2), (2, 1, 4, 2)]


@pytest.mark.parametrize(
    ("places", "along", "told"), [(ROW, {1: -0.06, 3: 1.6}, "60"), (COURSES, {2: 0.5, 4: 1.6}, "500")]
)
def test_cracks_are_labelled_where_they_are_drawn(monkeypatch, places, along, told):
    """Between two blocks that have parted by most of a block is air, and no crack."""
    written = []
    monkeypatch.setattr(
        "blockvis.pictures.drawer.write_labels", lambda picture, places, words, *_: written.extend(words)
    )
    roles = ["fixed"] + (len(places) - 1) * ["free"]
    assembly = solver.Assembly.from_outlines([rectangle(*place) for place in places], roles=roles)
    shift = np.array([[along.get(k, 0.0), 0.0] for k in range(len(places))])
    response = posed(assembly, solver.Pose(assembly.centroids + shift, np.zeros((len(places), 1))))
    (only,) = response.increments
    Drawer(response, Look(), SIZE, (only,)).picture(only, widths=True)
    assert written == [f"{told} mm"]


@pytest.mark.slow
def test_a_crack_behind_a_wall_is_looked_at_from_behind(tmp_path, words):
    """Two boxes that part by 20 mm behind a screen; what is asked for holds, and says that it shows none of it."""
    boxes = [box((0, 0, 0), (1, 1, 1)), box((1, 0, 0), (2, 1, 1)), box((-4, -2, -1), (6, -1, 4))]
    assembly = solver.Assembly.from_solids(boxes, roles=["free", "free", "fixed"])
    pose = solver.Pose.initial(assembly)
    pose.positions[1, 0] += 0.02
    for view in (None, "above", {"azimuth": -60, "elevation": 24}, "back"):
        picture = pixels(draw_cracks(posed(assembly, pose), -1, tmp_path / "cracks.png", size=SIZE, view=view))
        hidden = view is not None and "azimuth" in view
        assert bool(covered(picture, palette.crack_colours(4)[-1], 30)) is not hidden
    assert details(words) == [
        *2 * ["1 crack   ·   the widest 20 mm   ·   drawn on the layout"],
        "1 crack, in no view   ·   the widest 20 mm   ·   drawn on the layout",
        "1 crack   ·   the widest 20 mm   ·   drawn on the layout",
    ]


@pytest.mark.slow
def test_a_step_between_blocks_in_space_is_drawn_though_no_joint_is_open(tmp_path, words):
    assembly = solver.Assembly.from_solids([box((-1, 0, 0), (0, 1, 1)), box((0, 0, 0), (1, 1, 1))])
    pose = solver.Pose.initial(assembly)
    pose.positions[1, 2] -= 0.25
    picture = pixels(draw_cracks(posed(assembly, pose), -1, tmp_path / "cracks.png", size=SIZE))
    assert details(words) == ["no joint is open   ·   joints slide by up to 250 mm   ·   drawn on the layout"]
    assert covered(picture, palette.SLIDING, 30) > 100
    # Beside a crack that is ten times as wide as they slide they are no step.
    pose.positions[1] += 3.0, 0.0, 0.0
    draw_cracks(posed(assembly, pose), -1, tmp_path / "cracks.png", size=SIZE)
    assert details(words)[1:] == ["1 crack   ·   the widest 3000 mm   ·   drawn on the layout"]


@pytest.mark.slow
def test_the_legend_of_cracks_in_space_names_a_moving_support_that_is_seen(tmp_path):
    """It is pale green, and nothing said why."""
    solids = [box((-0.4, -0.4, -0.4), (0.4, 0.4, 0)), box((-0.6, -0.6, 0), (0.6, 0.6, 1))]
    assembly = solver.Assembly.from_solids(solids, roles=["moving", "free"])
    sinks = solver.Settlement((0, 0, -1), increment=0.01, limit=0.01)
    response = solver.Structure(assembly, friction_coefficient=0.7).settle(sinks)
    named = palette.pale(np.array([palette.MOVING]), np.array([True]), palette.SURVEY)
    for view in ("top", "front"):
        picture = pixels(draw_cracks(response, -1, tmp_path / "cracks.png", view=view, size=SIZE))
        assert (picture[320:] == named).all(axis=2).any() == (view == "front")


def test_a_step_in_the_plane_is_said(tmp_path, words):
    """A joint that slides and belongs to no crack; through those that do a stepped crack runs."""
    rings = [rectangle(x, 0.0, x + 1.0, 1.0) for x in (0.0, 1.0, 2.0)]
    assembly = solver.Assembly.from_outlines(rings)
    pose = solver.Pose.initial(assembly)
    pose.positions[1:, 1] -= 0.25
    pose.positions[2, 0] += 0.03
    draw_cracks(posed(assembly, pose), -1, tmp_path / "cracks.png", size=SIZE)
    counts = "1 crack   ·   lines as thick as they are open, the thickest 30 mm"
    assert details(words) == [f"{counts}   ·   joints slide by up to 250 mm, not drawn   ·   drawn on the layout"]


@pytest.mark.parametrize("dimension", [2, pytest.param(3, marks=pytest.mark.slow)])
def test_a_step_is_said_though_it_is_part_of_a_crack(tmp_path, words, dimension):
    """Two blocks past each other by 250 mm and open by 5 are a crack of 5 mm, in the plane as in space."""
    assembly = in_either(dimension, [rectangle(-1, 0, 0, 1), rectangle(0, 0, 1, 1)])
    pose = solver.Pose.initial(assembly)
    pose.positions[1, [0, -1]] += 0.005, -0.25
    draw_cracks(posed(assembly, pose), -1, tmp_path / "cracks.png", size=SIZE)
    assert details(words)[0].endswith(" 5 mm   ·   joints slide by up to 250 mm   ·   drawn on the layout")
