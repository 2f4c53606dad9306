"""Duplicates and overlaps."""

import time

import numpy as np
import pytest

import solver
from blockvis.layout.repair import duplicates, overlaps, repaired

SQUARE = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], dtype=float)


def test_duplicates_in_any_order_of_corners_and_within_rounding():
    rings = [SQUARE, SQUARE[::-1], np.roll(SQUARE, 2, axis=0) + 1e-7, SQUARE + 1e-3, 1.1 * SQUARE]
    assert duplicates(rings) == [(0, 1), (0, 2)]


def test_ten_thousand_copies_are_quick():
    start = time.perf_counter()
    assert len(duplicates([SQUARE] * 10_000)) == 9_999
    assert time.perf_counter() - start < 5


def test_supports_may_overlap_each_other_and_keep_their_place():
    rings = [SQUARE, SQUARE + np.array([0.5, 0.0]), SQUARE + np.array([0.2, 1.0])]
    assembly = solver.Assembly.from_outlines(rings)
    anchored = np.array([True, True, False])
    outlines, notes = repaired(assembly, joint_thickness=0.0, overlap_tolerance=None, anchored=anchored)
    assert all((a == b).all() for a, b in zip(outlines, rings, strict=True))
    assert notes == []
    assert [pair[:2] for pair in overlaps(assembly, 1e-6)] == [(0, 1)]


@pytest.mark.parametrize("tolerance", [-1.0, float("inf")])
def test_tolerance_is_checked(tolerance):
    assembly = solver.Assembly.from_outlines([SQUARE])
    with pytest.raises(ValueError, match="overlap_tolerance is"):
        repaired(assembly, joint_thickness=0.0, overlap_tolerance=tolerance, anchored=np.array([False]))
