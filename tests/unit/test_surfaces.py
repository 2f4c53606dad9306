"""Surfaces of blocks in space as files have them, made clean, and what the solver refuses of them."""

import numpy as np
import pytest
from structures import drawn

import solver
from blockvis import read

CORNERS = [[0, 0, 0], [2, 0, 0], [2, 1, 0], [0, 1, 0], [0, 0, 3], [2, 0, 3], [2, 1, 3], [0, 1, 3]]
FACES = [[3, 2, 1, 0], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]]
TRIANGLES = [[face[0], face[k], face[k + 1]] for face in FACES for k in (1, 2)]


def shapes_read(corners, faces, folder):
    return read(drawn(folder / "a.json", [(corners, faces)]), dimension=3).shapes


def shapes_of(corners, faces):
    return solver.Assembly.from_solids([(corners, faces)], names=["A3"]).shapes


def loose(corners, faces):
    """Each face with corners of its own, as STL has them."""
    numbers = np.concatenate(faces)
    return np.asarray(corners, dtype=float)[numbers], np.split(
        np.arange(len(numbers)), np.cumsum([len(face) for face in faces])[:-1]
    )


@pytest.mark.parametrize("sense", [1, -1])
@pytest.mark.parametrize(
    "surface",
    [
        (CORNERS, FACES),
        (CORNERS, TRIANGLES),
        loose(CORNERS, TRIANGLES),
        (CORNERS, [face[:: (-1) ** k] for k, face in enumerate(FACES)]),
        ([*CORNERS, [9, 9, 9]], FACES),
        ([*CORNERS, [1, 0, 3]], [[4, 8, 5, 6, 7], [0, 1, 5, 8, 4], *FACES[:1], *FACES[3:]]),
        ([*CORNERS, [1, 0, 3]], [*FACES[:1], [4, 8, 7], [8, 5, 6, 7], [0, 1, 5, 8, 4], *FACES[3:]]),
    ],
    ids=["box", "triangles", "loose triangles", "mixed senses", "spare corner", "corner in an edge", "cut face"],
)
def test_every_way_to_draw_a_box_is_the_same_box(surface, sense, tmp_path):
    corners, faces = surface
    shapes = shapes_read(corners, [list(face)[::sense] for face in faces], tmp_path)
    assert len(shapes.vertices) == 8
    assert np.diff(shapes.face_offsets).tolist() == [4] * 6
    assert shapes.volumes[0] == pytest.approx(6.0, rel=1e-12)
    np.testing.assert_allclose(shapes.centroids[0], [1.0, 0.5, 1.5])


def test_single_precision_far_away_is_welded_and_flat(tmp_path):
    corners = (np.asarray(CORNERS) * 0.1 + [40.0, 50.0, 6.0]).astype(np.float32)
    corners, faces = loose(corners, TRIANGLES)
    shapes = shapes_read(corners, faces, tmp_path)
    assert np.diff(shapes.face_offsets).tolist() == [4] * 6


def test_facets_of_a_curved_face_stay():
    angles = np.linspace(0.0, np.pi, 13)
    arc = np.stack([np.cos(angles), np.zeros(13), np.sin(angles)], axis=1)
    corners = np.concatenate([arc, arc + np.array([0, 1, 0])])
    sides = [[(k + 1) % 13, k, k + 13, (k + 1) % 13 + 13] for k in range(13)]
    shapes = shapes_of(corners, [list(range(13)), list(range(25, 12, -1)), *sides])
    assert len(shapes.face_offsets) - 1 == 15


@pytest.mark.parametrize(
    ("corners", "faces", "words"),
    [
        (CORNERS, FACES[:-1], r"not closed; only one face meets the edge from \(0, 0, 0\) to \(0, 1, 0\)"),
        (CORNERS, [*FACES, [0, 2, 4]], "3 faces meet the edge"),
        (CORNERS, [*FACES, [0, 1, 9]], "face 6 has the corner 9; there are corners 0 to 7"),
        (CORNERS, [*FACES, [0, 1]], "face 6 has 2 corners"),
        ([[0, np.nan, 0], *CORNERS[1:]], FACES, r"corner 0 is \[0.0, nan, 0.0\]; coordinates must be finite"),
        (np.multiply(CORNERS, [1, 1, 1e-13]), FACES, "it is a sheet, not a block"),
        (CORNERS, [FACES[0][::-1], *FACES[1:]], "faces 0 and . run the same way along the edge from"),
        (*loose(CORNERS, FACES), "not closed; only one face meets .*corners at the same place must be one"),
        (np.multiply(CORNERS, [1, 1, 1e-5]), [*FACES], None),
        ([[0, 0, 0.1], *CORNERS[1:]], FACES, r"face 0 is not plane: its corner .* is 0.025 m out of it"),
        (
            [*CORNERS, *np.add(CORNERS, 9)],
            [*FACES, *np.add(FACES, 8).tolist()],
            "consists of 2 separate surfaces",
        ),
        (CORNERS[:3], FACES, r"at least four .* corners and four faces; the shape of its corners is \(3, 3\)"),
        ("stone", FACES, "needs .* corners and the numbers of the corners around each face"),
    ],
)
def test_messages_name_the_block_and_the_place(corners, faces, words):
    if words is None:
        assert shapes_of(corners, faces).volumes[0] == pytest.approx(6e-5)
        return
    with pytest.raises(ValueError, match=f"A3.*({words})"):
        shapes_of(corners, faces)


def test_a_sheet_is_no_block():
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 1e-10]])
    with pytest.raises(ValueError, match=r"A3.* has a volume of 1.67e-11 m³ .*it is a sheet, not a block"):
        shapes_of(corners, [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])
