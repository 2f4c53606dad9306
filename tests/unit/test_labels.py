"""What pictures and films say: captions, legends and warnings that agree with what is drawn and with each other."""

import io
from dataclasses import replace
from functools import cache
from itertools import combinations

import numpy as np
import pytest
from PIL import Image, ImageDraw
from structures import arch_response, box, dropped_brick, parted, posed, rectangle, vault_response, wall

import solver
from blockvis import draw_mechanism, draw_still, generators
from blockvis.dynamics.fall import fall_of
from blockvis.pictures import drawer as drawing
from blockvis.pictures import palette
from blockvis.pictures.captions import FAILED_BADGE, FALL_BADGE
from blockvis.pictures.drawer import Drawer, Look
from blockvis.pictures.film import film_of
from blockvis.pictures.frame import Sheet, write_labels
from blockvis.studies import pictures
from blockvis.studies.run_one import _shape
from solver import mechanics

SMALL, LARGE = (320, 180), (960, 540)


def filmed(response, fps=4.0, seconds=4.0, size=SMALL):
    drawer = Drawer(response, Look(colour_by="mechanism"), size, response.increments)
    return list(film_of(drawer, fps, seconds))


@cache
def swinging():
    """A moving load on an arch: three positions, and the mechanism of the lowest."""
    arch = generators.arch()
    loads = [solver.self_weight(arch)] * 3
    path = []
    for k, x in enumerate((-0.5, 0.0, 0.5)):
        live = solver.point_load(arch, 3 + 2 * k, force=(0.0, -1.0))
        limit = solver.limit_load(arch, loads=replace(loads[k], live=live))
        path.append((limit, replace(limit.increment, parameter=x)))
    limits, states = zip(*path, strict=True)
    falling = replace(states[0], status=solver.Status.FALLING)
    return solver.Response(
        assembly=arch, settlements=(), interfaces=solver.Interfaces(), loads=loads[0],
        increments=(*states, falling), stop=solver.Status.COLLAPSED, analysis="limit load", limits=limits,
        parameter=mechanics.LOAD_POSITION, measured=mechanics.LOAD_MULTIPLIER,
    )  # fmt: skip


def test_a_load_that_moves_is_shown_at_its_positions_alone_and_its_mechanism_out_of_scale(words):
    filmed(swinging(), fps=10.0)
    shown = {said["title"] for said in words if "FALL" not in said["badge"]}
    alpha = {f"{state.parameter:.4f}": f"{state.measured:.5g}" for state in swinging().path}
    for title in shown:
        place = title.partition("x = ")[2].partition(" m")[0]
        assert f"α = {alpha[place]}" in title
    details = [said["detail"] for said in words]
    assert any("out of scale" in detail for detail in details)
    assert not [detail for detail in details if "out of scale" in detail and "true scale" in detail]
    assert any("true scale" in detail for detail in details)


@pytest.mark.slow
def test_a_frame_between_two_results_has_its_place_on_the_curve(words):
    response = replace(arch_response(), collapse=None, increments=arch_response().path[::4])
    filmed(response, fps=12.0)
    told = [said["title"] for said in words if "Reaction" in said["title"]]
    places = [float(title.partition("Settlement ")[2].partition(" m")[0]) for title in told]
    values = [float(title.rpartition("= ")[2].removesuffix(" W")) for title in told]
    assert len(set(places)) > 40
    expected = np.interp(places, response.parameters, response.values / response.total_weight)
    np.testing.assert_allclose(values, expected, atol=1e-4)


@pytest.mark.thorough
def test_every_picture_of_a_failed_run_has_a_badge(words):
    response = arch_response()
    failed = replace(response, stop=solver.Status.SOLVER_FAILED, collapse=None, increments=response.path)
    filmed(failed, fps=1.0)
    assert {said["badge"] for said in words} == {FAILED_BADGE}
    assert "before the solver failed" in words[-1]["detail"]
    words.clear()
    filmed(response, fps=1.0)
    assert FAILED_BADGE not in {said["badge"] for said in words}


def keys_of(response, **look):
    drawer = Drawer(response, Look(**look), SMALL, response.increments)
    return {key.text: key.kind for key in drawer.keys}


@pytest.mark.thorough
def test_the_legend_lists_what_is_drawn_and_what_is_too_much():
    few = keys_of(parted(wall(8, 6), 3, 0))
    assert {"open joint", "sliding joint"} <= set(few)
    assert not any("not shown" in text for text in few)
    many = keys_of(parted(wall(20, 18), 3, 0))
    assert "sliding joint" not in many
    assert many["sliding joints not shown"] == ""
    assert many["forces not shown"] == ""
    assert "hinge" not in keys_of(parted(wall(8, 6), 3, 0))
    glued = solver.Interfaces(solver.InterfaceLaw(0.6, cohesion=1e6, tensile_strength=1e6))
    sinks = solver.Settlement(direction=(0, -1), increment=0.01, limit=0.01)
    pulled = keys_of(solver.settle(generators.arch(voussoirs=6), sinks, interfaces=glued), forces="thrust")
    assert any(text.startswith("force of a joint") for text in pulled)
    # Who asks for none gets none, and no excuse.
    assert not any("forces" in text for text in keys_of(parted(wall(20, 18), 3, 0), forces="none"))


@pytest.mark.slow
def test_the_legend_of_the_fall_names_no_joints_and_no_forces(words):
    """Dynamics draws the blocks alone; hinges and forces are those of statics."""
    response = arch_response()
    fall = fall_of(response)
    drawer = Drawer(response, Look(colour_by="mechanism"), SMALL, response.path, fall=fall)
    drawer.picture(response.path[-1])
    drawer.falling_picture(0.5)
    standing, falling = ([key.text for key in said["keys"]] for said in words)
    assert words[1]["badge"] == FALL_BADGE
    assert falling == ["parts of the last mechanism"]
    assert {"hinge", "open joint", *falling} < set(standing)
    assert any(text.startswith("compression") for text in standing)


@pytest.mark.slow
def test_every_frame_names_what_it_draws_and_nothing_else(monkeypatch):
    """Statics, pseudo-time and fall: an entry stands in the legend where its colour is in the picture."""
    frames = []
    composed = Sheet.composed

    def noted(self, picture, **said):
        frames.append((said, np.asarray(picture).astype(np.int16)))
        return composed(self, picture, **said)

    monkeypatch.setattr(Sheet, "composed", noted)
    response = arch_response()
    filmed(response, fps=1.0, size=LARGE)
    fall = fall_of(response)
    Drawer(response, Look(colour_by="mechanism"), LARGE, response.path, fall=fall).falling_picture(1.0)
    filmed(parted(wall(6, 5), 4, 3), fps=1.0, size=LARGE)
    pseudo = [said for said, _ in frames if said["badge"] == "FALLING · pseudo-time"]
    assert len(frames) > len(pseudo) > 5
    for said, pixels in frames:
        texts = " ".join(key.text for key in said["keys"])
        for text, colour in (
            *(("compression", palette.FORCE), ("open joint", palette.OPEN)),
            *(("sliding joint", palette.SLIDING), ("hinge", palette.HINGE)),
        ):
            drawn = bool((np.abs(pixels - np.array(colour)) <= 12).all(axis=2).any())
            assert (text in texts) == drawn, (said["title"], text)
    assert not [said for said in pseudo if "compression" in " ".join(key.text for key in said["keys"])]


def test_widths_are_written_of_cracks_that_count(monkeypatch, tmp_path):
    written, response = [], arch_response()
    monkeypatch.setattr(drawing, "write_labels", lambda picture, places, words, *_: written.extend(words))
    widest = drawing.cracks_of(response.assembly, response.path[-1].pose)[0]
    cracks = [replace(widest, areas=part * widest.areas) for part in (1.0, 0.01, 0.0)]
    monkeypatch.setattr(drawing, "cracks_of", lambda *_: cracks)
    draw_mechanism(response, tmp_path / "mechanism.png", size=SMALL)
    assert written == 2 * [drawing.width_text(widest.width)]


def test_air_between_parted_blocks_makes_no_crack_a_main_one(monkeypatch, tmp_path):
    """Two stones that are lifted side by side, one by far, and a third for itself."""
    low = [rectangle(left, 0.0, left + 1.0, 1.0) for left in (0.0, 1.01, 4.0)]
    assembly = solver.Assembly.from_outlines([rectangle(0.0, -1.0, 6.0, 0.0), *low], roles=["fixed"] + 3 * ["free"])
    pose, written = solver.Pose.initial(assembly), []
    pose.positions[1:, 1] += [0.7, 0.02, 0.03]
    monkeypatch.setattr(drawing, "write_labels", lambda picture, places, words, *_: written.extend(words))
    draw_still(posed(assembly, pose), -1, tmp_path / "lifted.png", size=SMALL)
    assert written == ["20 mm", "30 mm"]


@pytest.mark.slow
def test_the_legend_names_lost_blocks_where_there_are_any(words):
    response = dropped_brick(0.05)
    lost, drawn = response.path[-1], response.path
    for increments, increment, named in ((drawn, drawn[0], False), (drawn, lost, True), (drawn[:1], drawn[0], False)):
        Drawer(response, Look(forces="none"), SMALL, increments).picture(increment)
        assert ("lost block" in [key.text for key in words[-1]["keys"]]) is named


def test_a_legend_has_no_gaps_and_what_stays_keeps_its_place():
    colours = (200, 0, 0), (0, 200, 0), (0, 0, 200)
    keys = [drawing.Key("area", word, colour) for word, colour in zip(("lost", "hinge", "force"), colours, strict=True)]
    sheet = Sheet((640, 360))
    page = Image.new("RGB", sheet.inside_size, "white")

    def swatches(*chosen):
        drawn = np.asarray(sheet.composed(page, title="", detail="", keys=[keys[k] for k in chosen], pixel=0.01))
        return [np.flatnonzero((drawn == colours[k]).all(axis=2).any(axis=0))[0] for k in chosen]

    lost, hinge, force = swatches(0, 1, 2)
    assert swatches(1, 2) == [hinge, force]
    assert swatches(2) == [force]
    beside, same = swatches(0, 2)
    assert same == force
    assert same - beside == pytest.approx(hinge - lost, abs=1), "as near as if nothing had been between"


@pytest.mark.thorough
def test_the_first_entry_of_a_legend_does_not_stand_alone_and_the_others_stay_as_it_comes_and_goes():
    colours = [(25 * k, 200, 0) for k in range(9)]
    keys = [drawing.Key("area", "an entry of it", colour) for colour in colours]
    sheet = Sheet((900, 506))
    page = Image.new("RGB", sheet.inside_size, "white")

    def rows(chosen):
        drawn = np.asarray(sheet.composed(page, title="", detail="", keys=chosen, pixel=0.01))
        return [np.argwhere((drawn == key.colour).all(axis=2))[0].tolist() for key in chosen]

    # As many as one row holds, and one more.
    n = max(k for k in range(1, 9) if len({y for y, _ in rows(keys[-k:])}) == 1)
    assert 3 <= n < 9
    one, more = rows(keys[-n:]), rows(keys[-n - 1 :])
    assert more[0][0] == more[1][0] < more[2][0]
    assert more[2:] == one[1:]


@pytest.mark.slow
@pytest.mark.parametrize("view", [None, "top"], ids=["from above and below", "from above"])
def test_the_legend_names_what_a_view_in_space_shows(view, words, tmp_path):
    """Every picture had the whole legend: at rest it named open joints, and from above hinges on the intrados."""
    response = vault_response()
    sight = None if view is None else drawing.Sight(-90.0, 90.0)
    drawer = Drawer(response, Look(sight=sight), SMALL, response.path, still=True)
    named = []
    for increment in (response.path[0], response.path[-1]):
        drawer.picture(increment)
        named.append({key.text.partition(",")[0] for key in words[-1]["keys"]})
    assert "open joint" not in named[0]
    assert "open joint" in named[1]
    assert "moving support" in named[1]
    assert ("hidden hinge" in named[1]) is (view is not None)
    under_the_crown = np.array([[[0.0, -0.1, 0.2], [0.0, 0.1, 0.2]]])
    drawer.scene.lines("hinge", under_the_crown, palette.HINGE, 3.0)
    drawer.scene.image()
    assert drawer.scene.holds("hinge") is (view is None)


@pytest.mark.slow
def test_the_legend_names_a_moving_support_where_it_is_seen(words):
    """From above its block hides it, and a section leaves it out; of what is cut the face in the plane is seen."""
    solids = [box((-0.4, -0.4, -0.4), (0.4, 0.4, 0)), box((-0.6, -0.6, 0), (0.6, 0.6, 1)), box((2, -1, 0), (3, 1, 1))]
    assembly = solver.Assembly.from_solids(solids, roles=["moving", "free", "fixed"])
    sinks = solver.Settlement((0, 0, -1), increment=0.01, limit=0.01)
    response = solver.Structure(assembly, friction_coefficient=0.7).settle(sinks)
    named = []
    for around, above, cut in (
        *((-90.0, 90.0, None), (-60.0, 24.0, None), (180.0, 0.0, drawing.Cut((1.0, 0.0, 0.0), (1.0, 0.0, 0.0)))),
        (180.0, 0.0, drawing.Cut((1.0, 0.0, 0.0), (0.0, 0.0, 0.0))),
    ):
        look = Look(sight=drawing.Sight(around, above), cut=cut)
        Drawer(response, look, SMALL, response.path).picture(response.path[-1])
        named.append("moving support" in [key.text for key in words[-1]["keys"]])
    assert named == [False, True, False, True]
    glass = Look(forces="thrust", sight=drawing.Sight(-90.0, 0.0))
    Drawer(response, glass, SMALL, response.path).picture(response.path[-1])
    assert "moving support" in [key.text for key in words[-1]["keys"]]


def test_the_legend_has_the_colours_of_the_parts_that_move(words, tmp_path):
    """Of an arch of four parts it had the first, another than blocks have; that of the mechanism had none."""
    response = arch_response()
    picture = np.asarray(Image.open(draw_mechanism(response, tmp_path / "mechanism.png", size=LARGE)))
    key = next(key for key in words[-1]["keys"] if key.text == "parts of the last mechanism")
    assert len(set(key.shades)) == 4
    for shade in key.shades:
        rows = np.flatnonzero((picture == shade).all(axis=2).any(axis=1))
        assert rows[0] < 0.8 * LARGE[1] < 0.9 * LARGE[1] < rows[-1], "on blocks, and in the legend"


def test_a_long_caption_is_broken_between_its_parts_and_keeps_its_size():
    """On upright sheets it was a third smaller than its title asked for."""
    sheet = Sheet((720, 1280))
    page, parts = Image.new("RGB", sheet.inside_size, "white"), ["limit reached: the motion that would follow"] * 2

    def drawn(*told):
        picture = sheet.composed(page, title="", detail="   ·   ".join(told), pixel=0.01)
        return np.asarray(picture)[: sheet.header].astype(int)

    both, one = drawn(*parts), drawn(parts[0])
    row = round(1.2 * sheet.text)
    assert (np.minimum(one, np.roll(one, row, axis=0)) == both).all()
    assert (drawn(*parts)[-2:] == 255).all(), "above the blocks"


@pytest.mark.parametrize("size", [(1920, 1080), (1920, 640), (1280, 428), (720, 1280)])
def test_the_smallest_letters_of_a_sheet_have_seven_points_at_the_width_of_a_page(size):
    sheet = Sheet(size)
    assert round(0.9 * sheet.text) / size[0] * 174.0 / 25.4 * 72.0 >= 7.0
    # Beside another one each has half of the page.
    assert Sheet(size, across=2).text == Sheet((2 * size[0], size[1])).text


@pytest.mark.parametrize(
    ("size", "title"),
    [
        ((720, 1280), "Settlement 0.1000 m   ·   Reaction 11.48 kN"),
        ((960, 956), "Settlement 60.00 mm   ·   Load multiplier α = 0.35718   ·   Live load 2.444 kN"),
    ],
)
def test_a_warning_leaves_the_title_of_a_sheet_its_size(size, title):
    """As a film began to fall, its title was made a third smaller; of a limit load half as large."""
    sheet = Sheet(size)
    page = Image.new("RGB", sheet.inside_size, "white")

    def drawn(badge):
        said = {"title": title, "detail": "fall   ·   true scale", "pixel": 0.01}
        return np.asarray(sheet.composed(page, badge=badge, **said))[: sheet.header].astype(int)

    calm, falling = drawn(""), drawn(FALL_BADGE)
    below = sheet.pad + 2 * sheet.text
    assert (calm[:below] == falling[:below]).all()
    red = (falling == palette.WARNING).all(axis=2).any(axis=1)
    assert red.any()
    assert not red[-1], "it is not cut off"


def test_in_a_fall_the_label_of_a_tie_says_what_its_colour_does(monkeypatch):
    assembly = solver.Assembly.from_outlines([rectangle(0, -1, 1, 0), rectangle(0, 0, 1, 1)], roles=["moving", "free"])
    iron = solver.Tie("iron", (1, None), ((0.5, 0.9), (0.5, 2.0)), stiffness=1e6)
    down = solver.Settlement((0, -1), increment=0.004, limit=0.004)
    response = solver.Structure(assembly, friction_coefficient=0.6, ties=[iron]).settle(down)
    written, last = [], response.path[-1]
    monkeypatch.setattr(drawing, "write_labels", lambda picture, places, words, *_: written.extend(words))
    drawer = Drawer(response, Look(), SMALL, (last,))
    for force, state in ((0.0, mechanics.SLACK), (900.0, mechanics.ELASTIC)):
        ties = replace(last.ties, forces=np.array([force]), states=np.array([state]))
        drawer.picture(replace(last, status=solver.Status.FALLING).with_arrays(ties=ties))
    assert written == ["iron slack", "iron in tension"]


@pytest.mark.slow
def test_lost_blocks_have_the_colour_of_their_legend_beside_the_tints_of_a_mechanism(words, tmp_path):
    blocks = [rectangle(-2.0, -1.0, 2.0, 0.0), rectangle(-0.5, 0.0, 0.5, 1.5), rectangle(0.4, 1.5, 0.5, 1.9)]
    materials = ["rock", "stone", "brick"]
    assembly = solver.Assembly.from_outlines(blocks, roles=["moving", "free", "free"], materials=materials)
    tilt = solver.Settlement(rotation_centre=(0.0, 0.0), rotation=-1.0, increment=0.05, limit=1.0)
    response = solver.settle(assembly, tilt, friction_coefficient=0.9)
    draw_mechanism(response, tmp_path / "mechanism.png", size=LARGE)
    (key,) = (key for key in words[-1]["keys"] if key.text == "lost block")
    with Image.open(tmp_path / "mechanism.png") as picture:
        above_the_legend = np.asarray(picture.convert("RGB"))[60:480]
    assert (above_the_legend == key.colour).all(axis=2).sum() > 300


@pytest.mark.slow
def test_a_section_leaves_the_labels_of_the_ties_that_it_leaves_at_the_middle_of_what_is_left(monkeypatch, tmp_path):
    piers = [box((x, 0, low), (x + 1, 1, high)) for low, high in ((0, 2), (-1, 0)) for x in (0, 3)]
    assembly = solver.Assembly.from_solids(piers, roles=["free", "free", "fixed", "moving"])
    ties = [
        solver.Tie("before", (0, 1), ((0.5, 0.1, 1.2), (3.5, 0.1, 1.2)), stiffness=1e7),
        solver.Tie("across", (0, 1), ((0.5, 0.1, 0.8), (3.5, 0.9, 0.8)), stiffness=1e7),
        solver.Tie("behind", (None, 1), ((2.0, 0.9, 0.4), (3.5, 0.9, 0.4)), stiffness=1e7),
    ]
    apart = solver.Settlement((1, 0, 0), increment=1e-6, limit=1e-6)
    response = solver.Structure(assembly, friction_coefficient=0.6, ties=ties).settle(apart)
    written = {}
    monkeypatch.setattr(
        drawing,
        "write_labels",
        lambda _, places, words, *__: written.update(zip((word.split()[0] for word in words), places, strict=True)),
    )
    draw_still(response, -1, tmp_path / "cut.png", size=SMALL, view="front", section="y")
    assert set(written) == {"across", "behind"}
    assert written["across"][0] == pytest.approx(written["behind"][0], abs=0.1)


def test_widths_leave_hinges_free_where_there_is_room():
    dot, place = np.array([[60.0, 50.0]]), np.array([[50.0, 50.0]])
    for dots, hidden in ((dot, False), (np.zeros((0, 2)), True)):
        picture = Image.new("RGB", (200, 100), "green")
        write_labels(picture, place, ["9 mm"], 10, dots)
        assert (picture.getpixel((60, 50)) != (0, 128, 0)) is hidden
        assert np.any(np.asarray(picture) != (0, 128, 0)), "it is written in any case"


def test_no_leader_crosses_an_arrow_where_there_is_room():
    """The label lay beyond the arrow, where it covers nothing."""
    place, arrow = np.array([[50.0, 50.0]]), np.array([[[60.0, 20.0], [60.0, 80.0]]])
    dots = np.array([[x, y] for x in (5.0, 20.0, 35.0, 50.0) for y in (30.0, 50.0, 70.0)])
    for arrows, crossed in ((arrow, False), (arrow[:0], True)):
        picture = Image.new("RGB", (200, 100), "green")
        write_labels(picture, place, ["9 mm"], 10, dots, lines=arrows)
        assert np.any(np.asarray(picture)[20:80, 60] != (0, 128, 0)) == crossed


def test_picture_film_and_page_count_the_last_equilibrium_alike(monkeypatch):
    marked = []
    found = drawing.marks_of

    def noted(assembly, joints, increment, shown):
        marks = found(assembly, joints, increment, shown)
        marked.append((increment.parameter, len(marks.hinges), len(marks.sliding)))
        return marks

    monkeypatch.setattr(drawing, "marks_of", noted)
    response = arch_response()
    filmed(response, fps=1.0)
    last = response.path[-1]
    counts = {(hinges, sliding) for at, hinges, sliding in marked if at == last.parameter}
    falling = mechanics.mechanism_of(response.assembly, mechanics.with_motion(last, response.collapse.mechanism))
    assert (len(falling.hinges), len(falling.sliding)) in counts
    assert (3, 0) not in counts, "three hinges are those of the settlement, not of the collapse"


def test_tiles_of_studies_hold_supports_and_their_arrow_and_fill():
    response = arch_response()
    crown = int(response.assembly.centroids[:, 1].argmax())
    piece, level = [response.assembly.outline(crown)[:2]], 1.0 + float(response.assembly.vertices[:, 1].max())
    fill = solver.Backfill(piece, np.array([crown]), level, 1e4, thickness=np.ones(1))
    response = replace(response, loads=replace(response.loads, fills=(fill,)))
    last = mechanics.with_motion(response.path[-1], response.collapse.mechanism)
    mechanism = mechanics.mechanism_of(response.assembly, last)
    with np.load(io.BytesIO(_shape(0, response, last, mechanism, response.settlements[0]))) as stored:
        shape = {name: stored[name] for name in stored.files}
    np.testing.assert_allclose(shape["arrows"][:, 1], [[1.0, 0.0]])
    # Coordinates of a national grid keep their digits, which single precision would round to 0.25 m.
    at_rest = mechanics.moved_vertices(response.assembly, last.pose)
    np.testing.assert_allclose(shape["at_rest"], at_rest, rtol=1e-14)
    moving = int(np.flatnonzero(response.assembly.moving)[0])
    support = at_rest[response.assembly.block_of_vertex == moving]
    place = shape["arrows"][0, 0]
    assert (support.min(axis=0) < place).all()
    assert (place < support.max(axis=0)).all()
    frame = pictures._frame([shape])
    assert shape["fill"][:, 2:, 1].tolist() == [[level, level]]
    assert (frame.low < shape["vertices"].min(axis=0)).all()
    assert (np.maximum(shape["vertices"].max(axis=0), level * np.array([0.0, 1.0])) < frame.high).all()


def test_labels_lie_apart_and_tell_by_leaders_where_they_belong():
    places = np.array([[100.0, 60.0]] * 4 + [[100.0, 72.0]])
    picture = Image.new("RGB", (300, 200), "green")
    colours = [(200, 10 * k, 0) for k in range(5)]
    write_labels(picture, places, ["12 mm"] * 5, 12, np.zeros((0, 2)), colours)
    pixels = np.asarray(picture)
    for colour in colours:
        assert (pixels == colour).all(axis=2).sum() > 50, "each label has its rim"
    assert (pixels == palette.PAPER).all(axis=2).sum() > 5 * 150
    rims = [np.argwhere((pixels == colour).all(axis=2)) for colour in colours]
    for one, other in combinations(rims, 2):
        beside = np.maximum(one.min(axis=0) - other.max(axis=0), other.min(axis=0) - one.max(axis=0)).max()
        assert beside > 3, "boxes that touch read as one"


def test_every_label_has_a_leader_to_the_place_that_it_names():
    picture = Image.new("RGB", (300, 200), "green")
    write_labels(picture, np.array([[100.0, 60.0]]), ["12 mm"], 12, np.zeros((0, 2)))
    assert (np.asarray(picture)[60, 100] == palette.FAINT).all()


def test_no_label_covers_the_gap_that_it_names(monkeypatch, tmp_path):
    seen = []
    monkeypatch.setattr(drawing, "write_labels", lambda *given: seen.append((given[1], given[4])))
    stones = [rectangle(-1.0, -1.0, 4.0, 0.0), rectangle(0.0, 0.0, 1.0, 1.0), rectangle(1.0, 0.0, 2.0, 1.0)]
    assembly = solver.Assembly.from_outlines(stones, roles=["fixed", "free", "free"])
    pose = solver.Pose.initial(assembly)
    pose.positions[2, 0] += 0.3
    draw_still(posed(assembly, pose), -1, tmp_path / "gap.png", size=SMALL)
    (((place, *_), taken),) = seen
    assert (np.abs(taken - place).max(axis=1) < 2.0).any(), "the middle of the gap is taken as its faces are"


@pytest.mark.slow
def test_what_lies_still_has_no_badge_of_falling(words):
    response = arch_response()
    fall = fall_of(response)
    drawer = Drawer(response, Look(colour_by="mechanism"), SMALL, response.path, fall=fall)
    *_, last = film_of(drawer, 4.0, 1.0)
    drawer.falling_picture(float(fall.times[-1]))
    badges = [said["badge"] for said in words if said["title"].startswith("Fall")]
    assert FALL_BADGE in badges
    assert badges[-2:] == ["", ""]
    # Where it is cut off it moves at its end.
    half = len(fall) // 2
    short = replace(fall, times=fall.times[:half], positions=fall.positions[:half], rotations=fall.rotations[:half])
    Drawer(response, Look(colour_by="mechanism"), SMALL, response.path, fall=short).falling_picture(99.0)
    assert words[-1]["badge"] == FALL_BADGE
    # So it does where it begins so slowly that nothing is seen to move in a moment.
    slow = replace(fall, times=100.0 * fall.times)
    Drawer(response, Look(colour_by="mechanism"), SMALL, response.path, fall=slow).falling_picture(0.0)
    assert words[-1]["badge"] == FALL_BADGE
    pixels = np.asarray(last).astype(int)
    assert not (np.abs(pixels - palette.WARNING) <= 8).all(axis=2).any()


@pytest.mark.slow
def test_a_mechanism_has_one_unit_of_length(words, tmp_path):
    """A collapse at some millimetres."""
    arch = generators.arch(voussoirs=5, radius=0.05)
    spread = solver.Settlement((1, 0), increment=2e-3, limit=0.05, tolerance=1e-5)
    response = solver.Structure(arch, friction_coefficient=0.7).settle(spread)
    low, high = (1e3 * end for end in response.collapse.bracket)
    draw_mechanism(response, tmp_path / "mechanism.png", size=SMALL)
    (told,) = words
    assert " mm" in told["title"]
    assert f"equilibrium at {low:.5g} mm, none at {high:.5g} mm" in told["detail"]


@pytest.mark.thorough
def test_the_mechanism_of_what_falls_as_a_stone_is_taken_away_names_stone_and_phase(words, tmp_path):
    structure = solver.Structure(generators.build("arch", {"voussoirs": 5}), friction_coefficient=0.8)
    phase = solver.Settlement([1.0, 0.0], increment=1e-3, limit=1e-3)
    change = solver.PhaseChange(1, np.isin(structure.assembly.names, ["voussoir 3"]))
    controls = solver.Controls(falling_frames=1)
    draw_mechanism(
        structure.settle([phase, phase], changes=[change], controls=controls), tmp_path / "m.png", size=SMALL
    )
    (said,) = words
    assert said["title"] == "Settlement 0.00 mm"
    assert (
        "   block 'voussoir 3' taken away, 1.73 kN   ·   falls before anything moves   ·   2 moving parts   "
        in said["detail"]
    )
    assert said["detail"].endswith("50 % of the weight fall   ·   phase 2 of 2")


def test_labels_keep_their_rim_off_the_edges_of_the_picture():
    """The rim of one that just had room was cut off."""
    labels = 0
    for k in range(60):
        picture = Image.new("RGB", (200, 60), "white")
        write_labels(picture, np.array([[70.0 + k, 30.0]]), ["110 mm"], 20, np.zeros((0, 2)))
        page = np.asarray(picture).copy()
        labels += bool((page < 255).any())
        page[2:-2, 2:-2] = 255
        assert (page == 255).all(), k
    assert 20 < labels < 60


@pytest.mark.parametrize(("pixel", "said"), [(1e-3, "0.1 m"), (1e-4, "10 mm"), (1e-2, "1 m")])
def test_scale_bars_below_a_tenth_of_a_metre_are_in_mm(monkeypatch, pixel, said):
    written = []
    monkeypatch.setattr(ImageDraw.ImageDraw, "text", lambda self, place, text, *rest, **more: written.append(text))
    sheet = Sheet((640, 360))
    sheet.composed(Image.new("RGB", sheet.inside_size), title="", detail="", pixel=pixel)
    assert said in written
