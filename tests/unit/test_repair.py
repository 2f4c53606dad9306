"""Duplicates and overlaps."""

import itertools
import math
from types import SimpleNamespace

import numpy as np
import pytest
from structures import drawn, rectangle

import blockvis
from blockvis import generators, inspect, read

SQUARE = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], dtype=float)


def test_duplicates_in_any_order_of_corners_and_within_rounding(tmp_path):
    rings = [SQUARE, SQUARE[::-1], np.roll(SQUARE, 2, axis=0) + 1e-7, SQUARE + 3e-3, 1.1 * SQUARE]
    assert inspect(drawn(tmp_path / "a.json", rings)).twins == ((0, 1), (0, 2))


def test_of_many_copies_one_is_left(tmp_path):
    with pytest.warns(UserWarning, match="99 of 100 blocks are drawn twice"):
        assert read(drawn(tmp_path / "a.json", [SQUARE] * 100)).n_blocks == 1


def test_a_block_drawn_again_in_rounded_coordinates_is_drawn_twice(tmp_path):
    """A hatch over its outline has other digits; two stones do not share all of their corners."""
    ring = np.array([[1 / 3, 1 / 7], [4 / 3, 1 / 7], [4 / 3, 5 / 7], [1 / 3, 5 / 7]])
    with pytest.warns(UserWarning, match="1 of 2 blocks is drawn twice"):
        assert read(drawn(tmp_path / "a.json", [ring, np.round(ring, 4)])).n_blocks == 1
    with pytest.raises(ValueError, match=r"overlaps block 1 .* by 0.01"):
        read(drawn(tmp_path / "b.json", [ring, np.add(ring, [0.99, 0.0])]), overlap_tolerance=1e-3)


def test_supports_may_overlap_each_other_and_keep_their_place(tmp_path):
    rings = [SQUARE, SQUARE + np.array([0.5, 0.0]), SQUARE + np.array([0.2, 1.0])]
    supports = [{"outline": ring.tolist(), "role": "fixed"} for ring in rings[:2]]
    assembly = read(drawn(tmp_path / "a.json", rings[2:]), supports=supports)
    assert all((assembly.outline(i) == ring).all() for i, ring in zip((1, 2, 0), rings, strict=True))
    assert [pair[:2] for pair in inspect(drawn(tmp_path / "a.json", rings)).overlapping] == [(0, 1)]


@pytest.mark.parametrize("tolerance", [-1.0, float("inf")])
def test_tolerance_is_checked(tmp_path, tolerance):
    with pytest.raises(ValueError, match="overlap_tolerance is"):
        read(drawn(tmp_path / "a.json", [SQUARE]), overlap_tolerance=tolerance)


def ring_of_chords(inner, outer, cuts):
    """Voussoirs between two circles, each arc in chords of its own."""
    for a, b in itertools.pairwise(cuts):
        angles = np.radians(np.linspace(a, b, math.ceil((b - a) / 5.1257) + 1))
        on_circle = np.stack([np.cos(angles), np.sin(angles)], axis=1)
        yield np.concatenate([outer * on_circle, inner * on_circle[::-1]])


def test_chords_of_one_circle_that_cross_each_other_are_parted(tmp_path):
    # The edges of two chords that cross face each other nowhere for half of their length.
    outer = [0, 13, 29, 47, 61, 83, 104, 127, 150, 163, 180]
    rings = [*ring_of_chords(1.0, 1.3, np.linspace(0, 180, 10)), *ring_of_chords(1.3, 1.6, outer)]
    with pytest.warns(UserWarning, match=r"18 overlaps of up to 0\.00105 m were cut away"):
        assembly = read(drawn(tmp_path / "a.json", rings))
    width = float(np.median(assembly.widths))
    assert not len(assembly.shapes.overlaps(assembly.vertices, 1e-7 * width)[0])


def test_overlaps_that_stay_are_not_said_to_be_cut(tmp_path, monkeypatch):
    monkeypatch.setattr(
        "blockvis.layout.repair.close_joints", lambda outlines, *_, **__: SimpleNamespace(outlines=outlines)
    )
    with pytest.warns(UserWarning, match=r"1 overlap of up to 0\.01 m could not be cut away"):
        read(drawn(tmp_path / "a.json", [SQUARE, SQUARE + np.array([0.99, 0.0])]))


def test_a_plate_that_overlaps_would_fold_is_refused(tmp_path):
    outlines = [rectangle(0.0, low, 1.0, high) for low, high in ((0.0, 0.5), (0.496, 0.506), (0.502, 1.0))]
    path = drawn(tmp_path / "plate.json", outlines)
    with pytest.raises(ValueError, match=r"block 1 .* folds its outline; redraw what overlaps it, or .* overlap_tol"):
        read(path, overlap_tolerance=0.02)


@pytest.mark.thorough
def test_a_joint_thickness_that_closes_nothing_says_so(tmp_path):
    # Another overlap than none: a millimetre that is cut away.
    for number, over in enumerate((0.0, 1e-3)):
        path = drawn(tmp_path / f"{number}.json", [rectangle(0.0, 0.0, 1.0 + over, 1.0), rectangle(1.0, 0.0, 2.0, 1.0)])
        for closing in ("auto", "voronoi"):
            with pytest.warns(UserWarning, match="nothing was closed|was cut away") as told:
                read(path, joint_thickness=0.01, closing=closing)
            assert str(told[-1].message).endswith(
                "no gaps of up to joint_thickness 0.01 m lie between blocks: nothing was closed"
            )
    blockvis.save_layout(generators.barrel_vault(voussoirs=3, stones=1), tmp_path / "vault.json")
    with pytest.warns(UserWarning, match="nothing was closed"):
        read(tmp_path / "vault.json", joint_thickness=0.01)


def test_mortar_that_is_asked_to_go_to_the_nearest_stone_goes_there_for_no_other_reason(tmp_path):
    path = drawn(tmp_path / "a.json", [rectangle(0.0, 0.0, 1.0, 1.0), rectangle(1.01, 0.0, 2.0, 1.0)])
    with pytest.warns(UserWarning, match=r"to the nearest stone; [\d.]+ corners a block"):
        read(path, joint_thickness=0.02, closing="voronoi")
