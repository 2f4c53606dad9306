"""Duplicates and overlaps."""

import numpy as np
import pytest
from structures import drawn

from blockvis import inspect, read

SQUARE = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], dtype=float)


def test_duplicates_in_any_order_of_corners_and_within_rounding(tmp_path):
    rings = [SQUARE, SQUARE[::-1], np.roll(SQUARE, 2, axis=0) + 1e-7, SQUARE + 1e-3, 1.1 * SQUARE]
    assert inspect(drawn(tmp_path / "a.json", rings)).twins == ((0, 1), (0, 2))


def test_of_many_copies_one_is_left(tmp_path):
    with pytest.warns(UserWarning, match="99 of 100 blocks are drawn twice"):
        assert read(drawn(tmp_path / "a.json", [SQUARE] * 100)).n_blocks == 1


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
