"""An object that is no single stone is told."""

import numpy as np

from blockvis import read_layout

CUBE = np.array([[x, y, z] for z in (0, 1) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))], dtype=float)
FACES = ((1, 4, 3, 2), (5, 6, 7, 8), (1, 2, 6, 5), (2, 3, 7, 6), (3, 4, 8, 7), (4, 1, 5, 8))


def beside(x):
    return CUBE + np.array([x, 0, 0])


def obj(path, *objects):
    """Write objects, each a name and the corners of cubes."""
    lines, n = [], 0
    for name, *cubes in objects:
        lines += [f"o {name}", *(f"v {x} {y} {z}" for cube in cubes for x, y, z in cube)]
        for _ in cubes:
            lines += ["f " + " ".join(str(n + corner) for corner in face) for face in FACES]
            n += 8
    path.write_text("\n".join(lines) + "\n")
    return path


def test_an_object_that_becomes_two_stones_is_told(tmp_path):
    two, one = ("pair", CUBE, beside(2)), ("one", beside(4))
    layout = read_layout(obj(tmp_path / "a.obj", two, one), unit="m", dimension=3)
    assert sorted(layout.names) == ["one", "pair 1", "pair 2"]
    assert any("became as many blocks: 'pair' (2 blocks)" in note for note in layout.notes)
    # All stones of a file in one object are meant so.
    assert read_layout(obj(tmp_path / "b.obj", two), unit="m", dimension=3).notes == ()
