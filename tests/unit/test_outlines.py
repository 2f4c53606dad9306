"""Cells to outlines, outlines to triangles: what the rings are, and what is refused."""

import math
import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from blockvis.layout.outlines import arc_points, flattened, outlines_of_cells, ring_area, without_collinear
from blockvis.layout.triangulation import cells_of_ring, triangles_of_ring

SQUARES = np.array([[x, y] for y in range(4) for x in range(4)], dtype=float)


def cell(x: int, y: int) -> list[int]:
    return [x + 4 * y, x + 1 + 4 * y, x + 1 + 4 * (y + 1), x + 4 * (y + 1)]


def test_outline_is_the_edges_used_once():
    cells = [cell(0, 0), cell(1, 0)[::-1], cell(0, 1)]
    (ring,) = outlines_of_cells(SQUARES, cells, np.zeros(3, int), ["L"])
    assert ring_area(ring) == pytest.approx(3.0)
    assert {tuple(p) for p in ring} == {(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)}


def test_cells_of_several_blocks_are_kept_apart():
    rings = outlines_of_cells(SQUARES, [cell(0, 0), cell(1, 0), cell(2, 0)], np.array([1, 1, 0]), ["a", "b"])
    assert [ring_area(ring) for ring in rings] == [1.0, 2.0]
    assert all(len(ring) == 4 for ring in rings)


def test_hole_names_the_block_and_the_place():
    cells = [cell(x, y) for x in range(3) for y in range(3) if (x, y) != (1, 1)]
    with pytest.raises(ValueError, match=r"block 'pier' has a hole around \(1.5, 1.5\); cut the block in two"):
        outlines_of_cells(SQUARES, cells, np.zeros(8, int), ["pier"])


def test_separate_pieces_are_refused():
    with pytest.raises(ValueError, match="block 'b' is in 2 separate pieces"):
        outlines_of_cells(SQUARES, [cell(0, 0), cell(2, 2)], np.zeros(2, int), ["b"])


def test_pieces_that_meet_in_a_corner_are_refused():
    with pytest.raises(ValueError, match=r"meets itself at \(1, 1\), where 4 of its edges end"):
        outlines_of_cells(SQUARES, [cell(0, 0), cell(1, 1)], np.zeros(2, int), ["b"])


def test_doubled_cells_are_refused():
    with pytest.raises(ValueError, match="its cells are in the file twice"):
        outlines_of_cells(SQUARES, [cell(0, 0), cell(0, 0)], np.zeros(2, int), ["b"])


def test_collinear_points_merge_and_arcs_stay():
    arc = arc_points(np.zeros(2), 1.0, 0.0, math.pi, 1e-3)
    ring = np.vstack([arc, np.column_stack([np.linspace(-1, 1, 9)[1:-1], np.zeros(7)])])
    assert len(without_collinear(ring)) == len(arc)


def test_a_long_row_of_collinear_points_takes_no_squared_time():
    n = 50_000
    ring = np.vstack([np.column_stack([np.linspace(0, 1, n), np.zeros(n)]), [[1, 1], [0, 1]]])
    start = time.perf_counter()
    assert len(without_collinear(ring)) == 4
    assert time.perf_counter() - start < 5.0


@pytest.mark.parametrize("tolerance", [1e-2, 1e-3, 1e-4])
def test_chords_stay_within_the_tolerance(tolerance):
    points = arc_points(np.array([3.0, 4.0]), 2.0, 0.3, 2.0, tolerance)
    middles = (points[1:] + points[:-1]) / 2 - [3.0, 4.0]
    sagitta = 2.0 - np.hypot(*middles.T).min()
    assert 0 < sagitta <= tolerance * (1 + 1e-9)
    fewer = arc_points(np.array([3.0, 4.0]), 2.0, 0.3, 2.0, 16 * tolerance)
    assert len(fewer) < len(points)


def test_an_upright_drawing_is_read_as_seen_from_the_front():
    flat, note = flattened(np.array([[0, 5, 0], [2, 5, 0], [2, 5, 3.0]]), "'wall'")
    assert flat.tolist() == [[0, 0], [2, 0], [2, 3]]
    assert "(x, z)" in note
    with pytest.raises(ValueError, match="'wall' is not flat"):
        flattened(np.eye(3), "'wall'")


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
