"""What of bodies in space is read: open ones can be ignored, plates and mortar are left out."""

import numpy as np
import pytest

from blockvis.cli import main

FACES = ((1, 4, 3, 2), (5, 6, 7, 8), (1, 2, 6, 5), (2, 3, 7, 6), (3, 4, 8, 7), (4, 1, 5, 8))


def modelled(path, **boxes):
    """Write boxes, each (low corner, size, faces), as objects."""
    lines, start = [], 0
    for name, (low, size, n_faces) in boxes.items():
        lines.append(f"o {name}")
        corners = [
            np.array(low) + np.array(size) * (x, y, z) for z in (0, 1) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))
        ]
        lines += ["v {} {} {}".format(*corner) for corner in corners]
        lines += ["f " + " ".join(str(k + start) for k in face) for face in FACES[:n_faces]]
        start += 8
    path.write_text("\n".join([*lines, ""]))


STONES = {"a": ((0, 0, 0), (1, 1, 1), 6), "b": ((1.1, 0.2, 0), (1, 1, 1.5), 6)}


@pytest.mark.parametrize(
    ("beside", "options", "says"),
    [
        ({"plate": ((-1, -1, 0), (4, 3, 0), 1)}, (), "'plate', a single face without volume; draw a support"),
        (
            {"open": ((-1, -1, -1), (4, 3, 1), 5)},
            ("--ignore", "open"),
            "left out: 'open', no closed body, as asked",
        ),
        ({"mortar": ((-0.1, -0.1, 0), (2.3, 1.5, 1.6), 6)}, (), "left out: 1 mortar surface, 'mortar'"),
    ],
)
def test_what_is_no_stone_is_left_out_with_a_note(tmp_path, capsys, beside, options, says):
    modelled(tmp_path / "wall.obj", **beside, **STONES)
    assert main(["info", str(tmp_path / "wall.obj"), *options]) == 0
    said = capsys.readouterr().out
    assert "outlines        2" in said
    assert says in said


def test_an_open_body_that_is_wanted_is_refused_with_its_name(tmp_path, capsys):
    modelled(tmp_path / "wall.obj", open=((-1, -1, -1), (4, 3, 1), 5), **STONES)
    assert main(["info", str(tmp_path / "wall.obj")]) != 0
    assert "body 'open' is not closed" in capsys.readouterr().err
