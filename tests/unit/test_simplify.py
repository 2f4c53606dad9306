"""Outlines finer than needed: simplified within a tolerance, edges shared as before."""

import numpy as np
import pytest
import shapely

from blockvis.layout.assemble import assemble
from blockvis.layout.layout import Layout
from blockvis.layout.simplify import default_tolerance, simplified
from solver import mechanics


def split_square(n, amplitude=0.004, seed=1):
    """Two halves of a square, along a rough line of n points."""
    generator = np.random.default_rng(seed)
    line = np.stack([0.5 + generator.uniform(-amplitude, amplitude, n), np.linspace(0.0, 1.0, n)], axis=1)
    left = np.vstack([[[0.0, 0.0]], line, [[0.0, 1.0]]])
    right = np.vstack([line, [[1.0, 1.0], [1.0, 0.0]]])[::-1]
    return [left, right]


def test_within_the_tolerance_and_shared():
    halves = split_square(200)
    found, note = simplified(halves, 0.01)
    assert "404 corners of 2 blocks were simplified to 8 within 0.01 m" in note
    assert shapely.union_all([shapely.Polygon(ring) for ring in found]).area == pytest.approx(1.0, abs=1e-12)
    assert sum(shapely.Polygon(ring).area for ring in found) == pytest.approx(1.0, abs=1e-12)
    for drawn, ring in zip(halves, found, strict=True):
        assert shapely.Polygon(ring).exterior.hausdorff_distance(shapely.Polygon(drawn).exterior) <= 0.01


def test_a_corner_of_one_block_on_the_edge_of_another_stays_there():
    base = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [0.0, 1.0]])
    rough = [ring + np.array([0.0, 1.0]) for ring in split_square(100)]
    found, note = simplified([base, *rough], 0.01)
    assert note
    assert len(mechanics.overlap_depths(np.concatenate(found), np.cumsum([0, *map(len, found)]), 1e-9)[0]) == 0
    assert min(found[1][:, 1]) == min(found[2][:, 1]) == 1.0


def test_a_few_corners_are_left_alone_and_many_are_not():
    halves = split_square(12)
    assert default_tolerance(halves) == 0.0
    assert simplified(halves, 0.0) == (halves, "")
    assert default_tolerance(split_square(60)) == pytest.approx(0.01 * np.sqrt(0.5), rel=0.05)


def test_a_thin_block_is_not_folded():
    x = np.linspace(0.0, 1.0, 60)
    arch = np.vstack(
        [np.stack([x, 0.05 * np.sin(np.pi * x)], 1), np.stack([x, 0.05 * np.sin(np.pi * x) + 0.01], 1)[::-1]]
    )
    found, _ = simplified([arch], 0.1)
    assert shapely.Polygon(found[0]).is_valid
    assert shapely.Polygon(found[0]).area > 0.8 * shapely.Polygon(arch).area


def test_assembling_notes_it_and_the_caller_decides():
    layout = Layout(tuple(split_square(200)), ("left", "right"))
    with pytest.warns(
        UserWarning, match=r"outlines were finer than needed: 404 corners .* \(outline_tolerance; 0 keeps"
    ):
        few = assemble(layout)
    assert len(few.vertices) < 60
    assert len(assemble(layout, outline_tolerance=0.0).vertices) == 404
    with pytest.raises(ValueError, match="outline_tolerance is -1 m"):
        assemble(layout, outline_tolerance=-1.0)
