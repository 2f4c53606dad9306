"""The drawing of the cracks: each main crack in its colour, as thick as it is open, with its width."""

from dataclasses import replace

import numpy as np
import pytest
from PIL import Image
from structures import arch_response

from blockvis import generators
from blockvis.pictures import crack_drawing, palette
from blockvis.pictures.crack_drawing import draw_cracks
from blockvis.pictures.drawer import Drawer, Look
from blockvis.results.cracks import cracks_of, main_cracks
from blockvis.text import width_text

SIZE = (640, 360)


def pixels(path):
    return np.asarray(Image.open(path).convert("RGB")).astype(int)


def covered(picture, colour):
    """Pixels of the blocks' picture, without caption and legend, in a colour."""
    return int((np.abs(picture[50:310] - colour) <= 6).all(axis=2).sum())


def test_each_main_crack_has_its_colour_and_its_width(tmp_path, monkeypatch):
    response, written = arch_response(), []
    monkeypatch.setattr(crack_drawing, "write_labels", lambda picture, places, words, *_: written.extend(words))
    picture = pixels(draw_cracks(response, -1, tmp_path / "cracks.png", size=SIZE))
    main = main_cracks(cracks_of(response.assembly, response.path[-1].pose))
    assert written == [width_text(crack.width) for crack in main]
    assert len(main) >= 3
    for colour in palette.SURVEYED[: len(main)]:
        assert covered(picture, colour) > 10
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
    with pytest.raises(ValueError, match="these lie in space"):
        draw_cracks(replace(response, assembly=generators.dome()), 0, tmp_path / "none.png")
    with pytest.raises(ValueError, match=f"no increment 999: choose one from 0 to {len(response.path) - 1}"):
        draw_cracks(response, 999, tmp_path / "none.png")


def test_labels_stand_at_the_widest_point_of_a_joint(monkeypatch):
    """A joint that opens at one end has its label there, not at its middle."""
    seen = []
    from blockvis.pictures import drawer as drawing

    monkeypatch.setattr(drawing, "write_labels", lambda picture, places, *_: seen.extend(places))
    response = arch_response()
    last = response.path[-1]
    drawer = Drawer(response, Look(), SIZE, (last,))
    drawer.picture(last, widths=True)
    found = main_cracks(cracks_of(response.assembly, last.pose))
    joints = drawer.joints
    on_a, on_b, _ = drawing.faces_at(response.assembly, joints, last.pose)
    for crack, place in zip(found, seen, strict=True):
        gap = np.linalg.norm((on_a - on_b)[crack.joints[0]], axis=1)
        widest = (on_a + on_b)[crack.joints[0], gap.argmax()] / 2.0
        np.testing.assert_allclose(place, drawer.scene.at_pixel(widest[None])[0], atol=0.01)
