"""Outlines cut into triangles."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from blockvis.layout.outlines import ring_area
from blockvis.layout.triangulation import cells_of_ring, triangles_of_ring


@given(st.integers(3, 40), st.integers(0, 1000))
@settings(max_examples=60, deadline=None)
def test_triangles_fill_a_star_and_turn_as_it_does(n, seed):
    generator = np.random.default_rng(seed)
    angle = 2 * np.pi * np.arange(n) / n
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=1) * generator.uniform(0.2, 1.0, (n, 1))
    for sense in (ring, ring[::-1]):
        areas = [ring_area(sense[list(cell)]) for cell in triangles_of_ring(sense)]
        assert len(areas) == n - 2
        assert sum(areas) == pytest.approx(ring_area(sense), rel=1e-9)
        assert (np.sign(areas) == np.sign(ring_area(sense))).all()


def test_convex_quadrangles_stay_whole():
    assert cells_of_ring(np.array([[0, 0], [1, 0], [1, 1], [0, 1.0]])) == [(0, 1, 2, 3)]
    assert len(cells_of_ring(np.array([[0, 0], [2, 0], [0.5, 0.5], [0, 2.0]]))) == 2
