"""Outlines finer than needed: simplified within a tolerance, edges shared as before."""

import numpy as np
import pytest
import shapely
from structures import drawn

from blockvis import read
from solver import mechanics


def split_square(n, amplitude=0.004, seed=1):
    """Two halves of a square, along a rough line of n points."""
    generator = np.random.default_rng(seed)
    line = np.stack([0.5 + generator.uniform(-amplitude, amplitude, n), np.linspace(0.0, 1.0, n)], axis=1)
    left = np.vstack([[[0.0, 0.0]], line, [[0.0, 1.0]]])
    right = np.vstack([line, [[1.0, 1.0], [1.0, 0.0]]])[::-1]
    return [left, right]


def simplified(folder, outlines, tolerance=None):
    """Outlines as they are read, and the corners that are left of them."""
    assembly = read(drawn(folder / "a.json", outlines), outline_tolerance=tolerance)
    return [assembly.outline(block) for block in range(assembly.n_blocks)], len(assembly.vertices)


def test_within_the_tolerance_and_shared(tmp_path):
    halves = split_square(200)
    with pytest.warns(UserWarning, match="404 corners of 2 blocks were simplified to 8 within 0.01 m"):
        found, _ = simplified(tmp_path, halves, 0.01)
    assert shapely.union_all([shapely.Polygon(ring) for ring in found]).area == pytest.approx(1.0, abs=1e-12)
    assert sum(shapely.Polygon(ring).area for ring in found) == pytest.approx(1.0, abs=1e-12)
    for rough, ring in zip(halves, found, strict=True):
        assert shapely.Polygon(ring).exterior.hausdorff_distance(shapely.Polygon(rough).exterior) <= 0.01


def test_a_corner_of_one_block_on_the_edge_of_another_stays_there(tmp_path):
    base = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [0.0, 1.0]])
    rough = [ring + np.array([0.0, 1.0]) for ring in split_square(100)]
    with pytest.warns(UserWarning, match="were simplified"):
        found, _ = simplified(tmp_path, [base, *rough], 0.01)
    assert len(mechanics.overlap_depths(np.concatenate(found), np.cumsum([0, *map(len, found)]), 1e-9)[0]) == 0
    assert min(found[1][:, 1]) == min(found[2][:, 1]) == 1.0


@pytest.mark.filterwarnings("ignore:outlines were finer")
@pytest.mark.parametrize(("first", "mirror"), [(1, 1), (70, 1), (150, -1)])
def test_the_first_corner_and_the_direction_say_nothing(tmp_path, first, mirror):
    t = np.linspace(0.0, np.pi, 200)
    ring = np.vstack([[[0.0, 0.0], [1.0, 0.0]], np.stack([0.5 + 0.5 * np.cos(t), 1.0 + 0.25 * np.sin(t)], axis=1)])
    (plain,), _ = simplified(tmp_path, [ring])
    (other,), _ = simplified(tmp_path, [np.roll(ring, first, axis=0)[::mirror]])
    assert len(plain) < 20
    assert sorted(map(tuple, other.round(9))) == sorted(map(tuple, plain.round(9)))


@pytest.mark.filterwarnings("error")
def test_a_few_corners_are_left_alone(tmp_path):
    assert simplified(tmp_path, split_square(12))[1] == 28


def test_many_corners_are_simplified_within_a_hundredth_of_a_block(tmp_path):
    with pytest.warns(UserWarning, match=r"corners of 2 blocks were simplified to \d+ within 0.00(6|7)\d* m"):
        assert simplified(tmp_path, split_square(60))[1] < 60


def test_corners_that_stay_too_many_are_told_with_what_leaves_fewer(tmp_path):
    rough = split_square(200, amplitude=0.012)
    with pytest.warns(UserWarning, match=r"a block are many still, .*: a larger outline_tolerance, 0.02, leaves fewer"):
        many = simplified(tmp_path, rough)[1]
    with pytest.warns(UserWarning, match=r"0 keeps every corner\)$"):
        assert simplified(tmp_path, rough, 0.02)[1] < 0.2 * many


def test_a_thin_block_is_not_folded(tmp_path):
    x = np.linspace(0.0, 1.0, 60)
    arch = np.vstack(
        [np.stack([x, 0.05 * np.sin(np.pi * x)], 1), np.stack([x, 0.05 * np.sin(np.pi * x) + 0.01], 1)[::-1]]
    )
    found, _ = simplified(tmp_path, [arch], 0.1)
    assert shapely.Polygon(found[0]).is_valid
    assert shapely.Polygon(found[0]).area > 0.8 * shapely.Polygon(arch).area


@pytest.mark.thorough
def test_where_nothing_can_be_simplified_that_is_said(tmp_path):
    def sector(inner, outer, begin, end):
        angles = np.radians(np.linspace(begin, end, 2 + int((end - begin) / 0.2)))
        on_circle = np.stack([np.cos(angles), np.sin(angles)], axis=1)
        return np.concatenate([outer * on_circle, inner * on_circle[::-1]])

    # Of chords that only nearly coincide each side would be simplified for itself, across the other one.
    rings = [sector(1.0, 1.3, 0, 20), sector(1.3, 1.6, 0, 9), sector(1.3, 1.6, 9, 20)]
    with pytest.warns(UserWarning, match=r"finer than needed, 412 corners of 3 blocks, and stay so: .* 3 blocks would"):
        assert simplified(tmp_path, rings)[1] >= 412
    apart = [*rings, sector(1.0, 1.6, 90, 120)]
    with pytest.warns(UserWarning, match=r"716 corners .* simplified to 426 .*; 3 blocks that would fold or overlap"):
        assert simplified(tmp_path, apart)[1] < 900


def test_assembling_notes_it_and_the_caller_decides(tmp_path):
    path = drawn(tmp_path / "a.json", split_square(200))
    with pytest.warns(
        UserWarning, match=r"outlines were finer than needed: 404 corners .* \(outline_tolerance; 0 keeps"
    ):
        few = read(path)
    assert len(few.vertices) < 60
    assert len(read(path, outline_tolerance=0.0).vertices) == 404
    with pytest.raises(ValueError, match="outline_tolerance is -1 m"):
        read(path, outline_tolerance=-1.0)
