"""Our own layout file: what it needs, and what is said where that is missing."""

import json
import math

import numpy as np
import pytest
from structures import box, drawn

from blockvis import read, read_layout

RING = [[0, 0], [1, 0], [1, 1]]
STAR = [[(1 + k % 2) * math.cos(k * math.pi / 1250), (1 + k % 2) * math.sin(k * math.pi / 1250)] for k in range(2500)]


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("[" * 200_000, "is not a JSON file"),
        ({"walls": []}, 'is JSON but no layout; it needs a list "blocks"'),
        ({"blocks": []}, "draws no block"),
        ({"version": 9, "blocks": []}, "is a layout of version 9; version 1 is read"),
        ({"blocks": [{"outline": "abc"}]}, "block 'block 0' has no outline of numbers"),
        ({"blocks": [{"name": "a", "outline": RING[:2]}]}, r"block 'a' needs at least three corners .*\(2, 2\)"),
        ({"blocks": [{"name": "a", "outline": [[0, 0], [1, float("nan")], [1, 1]]}]}, "'a' has a corner at .*nan"),
        ({"blocks": [{"name": "a", "outline": RING, "role": "loose"}]}, "block 'a' has role 'loose'"),
        (
            {"blocks": [{"name": "a", "outline": RING, "thickness": "thick"}]},
            r"a\.json': block 'a' has thickness 'thick'; give",
        ),
        ({"blocks": [{"name": "a", "outline": RING, "density": -1}]}, "'a'\\) has density -1"),
        (
            {"blocks": [{"name": "a", "outline": RING, "thicknes": 0.2}]},
            r"a\.json': block 'a' has no 'thicknes' \(did you mean 'thickness'\?\); it has name, group",
        ),
        ({"units": "mm", "blocks": [{"outline": RING}]}, r"a\.json' has no 'units' \(did you mean 'unit'\?\)"),
        ({"blocks": [{"name": "a", "outline": [*RING[:2], [10**400, 1]]}]}, "block 'a' has no outline of numbers"),
        ({"blocks": [{"name": "a", "outline": RING, "density": 10**400}]}, r"block 'a' has density 1000\d+; give"),
        ({"unit": "parsec", "blocks": [{"outline": RING}]}, "unit 'parsec' is not known"),
        ({"blocks": [{"name": "a", "outline": STAR}]}, "has 2500 corners, more than 2000"),
    ],
)
def test_refusals(tmp_path, content, message):
    path = tmp_path / "a.json"
    path.write_text(content if isinstance(content, str) else json.dumps(content), encoding="utf-8")
    with pytest.raises(ValueError, match=message):
        read(path)


def test_keys_of_others_are_told(tmp_path):
    path = tmp_path / "a.json"
    content = {"author": "M. Cascini", "blocks": [{"outline": RING, "colour": "red"}, {"outline": RING}]}
    path.write_text(json.dumps(content), encoding="utf-8")
    assert "keys that are not known: 1 author, 1 colour" in read_layout(path).notes


def test_the_view_says_what_is_up_in_space_as_of_other_bodies(tmp_path):
    """The higher box is the thinner one, along z."""
    boxes = [box((0, 0, 0), (2, 1, 1)), box((0, 0, 1), (1, 1, 3))]
    path = drawn(tmp_path / "a.json", boxes)
    heights = {view: [np.ptp(points[:, 2]) for points, _ in read_layout(path, view=view, dimension=3).solids]
               for view in (None, "xz", "xy")}  # fmt: skip
    assert heights == {None: [1.0, 2.0], "xz": [1.0, 2.0], "xy": [1.0, 1.0]}
    turned = read_layout(path, view="xy", dimension=3)
    assert turned.volumes == pytest.approx([2.0, 2.0])
    assert turned.solids[1][0][:, 1].min() == -3.0
    flat = drawn(tmp_path / "b.json", [np.array(RING)])
    with pytest.raises(ValueError, match="is drawn in the plane xy; it has no view xz"):
        read_layout(flat, view="xz")
