"""What is no plane-faced stone, or no single one, is told where it is accepted."""

import numpy as np
import pytest

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


@pytest.mark.parametrize("raised", [0.0, 0.12])
def test_a_corner_out_of_its_plane_is_told(tmp_path, raised):
    bent = CUBE.copy()
    bent[6, 2] += raised
    layout = read_layout(obj(tmp_path / "a.obj", ("a", bent), ("b", beside(2))), unit="m", dimension=3)
    told = [note for note in layout.notes if "bent faces of 1 of 2 blocks" in note]
    assert bool(told) == bool(raised)
    assert all("12 % of the block" in note and "of 'a' at" in note for note in told)


def test_an_object_that_becomes_two_stones_is_told(tmp_path):
    two, one = ("pair", CUBE, beside(2)), ("one", beside(4))
    layout = read_layout(obj(tmp_path / "a.obj", two, one), unit="m", dimension=3)
    assert sorted(layout.names) == ["one", "pair 1", "pair 2"]
    assert any("became as many blocks: 'pair' (2 blocks)" in note for note in layout.notes)
    # All stones of a file in one object are meant so.
    assert read_layout(obj(tmp_path / "b.obj", two), unit="m", dimension=3).notes == ()
