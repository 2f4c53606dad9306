"""Assembly: what it works out about its blocks, with shapely as the measure, and what it refuses."""

import copy
import pickle
from dataclasses import replace

import numpy as np
import pytest
import shapely
from structures import arch_response

import solver

SQUARE = [[0, 0], [1, 0], [1, 1], [0, 1]]
U_BLOCK = [[4, 0], [7, 0], [7, 3], [6, 3], [6, 1], [5, 1], [5, 3], [4, 3]]


def random_outlines(n=12, seed=5):
    """Star-shaped outlines of 3 to 9 corners, about half of them clockwise."""
    random = np.random.default_rng(seed)
    outlines = []
    for k in range(n):
        corners = 3 + k % 7
        angles = (np.arange(corners) + random.uniform(0, 0.9, corners)) * 2 * np.pi / corners
        angles = angles[:: random.choice([-1, 1])]
        radius = random.uniform(0.5, 2.0, len(angles))
        outlines.append(np.stack([5 * k + radius * np.cos(angles), radius * np.sin(angles)], axis=1))
    return outlines


def test_areas_and_centroids_are_those_of_shapely():
    outlines = [*random_outlines(), np.array(U_BLOCK) - [20, 0]]
    assembly = solver.Assembly.from_outlines(outlines)
    polygons = [shapely.Polygon(outline) for outline in outlines]
    assert assembly.areas == pytest.approx([p.area for p in polygons], rel=1e-12)
    centroids = np.array([[p.centroid.x, p.centroid.y] for p in polygons])
    assert np.abs(assembly.centroids - centroids).max() < 1e-11
    assert assembly.widths == pytest.approx([2 * p.area / p.length for p in polygons], rel=1e-12)


def test_outlines_become_counter_clockwise():
    assembly = solver.Assembly.from_outlines([SQUARE, SQUARE[::-1], *random_outlines()])
    for block in range(assembly.n_blocks):
        assert shapely.LinearRing(assembly.outline(block)).is_ccw


def test_masses():
    assembly = solver.Assembly.from_outlines([SQUARE, U_BLOCK], density=[1800, 2500], thickness=[0.3, 2])
    assert assembly.masses.tolist() == pytest.approx([1800 * 0.3, 2500 * 2 * 7])


def test_far_from_the_origin_centroids_keep_their_digits():
    shift = np.array([5e5, 5e6])
    near = solver.Assembly.from_outlines(random_outlines())
    far = solver.Assembly.from_outlines([outline + shift for outline in random_outlines()])
    assert np.abs(far.centroids - shift - near.centroids).max() < 1e-8
    assert far.areas == pytest.approx(near.areas, rel=1e-7)


def test_neighbouring_vertices():
    assembly = solver.Assembly.from_outlines([SQUARE, U_BLOCK])
    assert (assembly.polygons.previous_vertex[assembly.polygons.next_vertex] == np.arange(12)).all()
    assert (assembly.block_of_vertex[assembly.polygons.next_vertex] == assembly.block_of_vertex).all()
    assert assembly.polygons.edge_lengths.tolist() == [1, 1, 1, 1, 3, 3, 1, 2, 1, 2, 1, 3]
    assert np.flatnonzero(~assembly.polygons.convex_vertex).tolist() == [8, 9]


def test_roles():
    assembly = solver.Assembly.from_outlines([SQUARE, U_BLOCK], roles=["free", "moving"])
    assert assembly.free.tolist() == [True, False]
    fixed = assembly.with_roles(["fixed", "free"])
    assert fixed.free.tolist() == [False, True]
    assert assembly.moving.tolist() == [False, True]
    with pytest.raises(ValueError, match="block 'block 1' has role 'hanging'; roles are free, fixed, moving"):
        assembly.with_roles(["fixed", "hanging"])
    with pytest.raises(ValueError, match="2 blocks but 1 roles; give one per block"):
        assembly.with_roles(["fixed"])


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"density": -1.0}, r"block 0 \('block 0'\) has density -1 kg/m³"),
        ({"density": [1.0]}, r"density has shape \(1,\); give one number or 2"),
        ({"roles": ["free", "hanging"]}, "block 'block 1' has role 'hanging'"),
        ({"names": ["a"]}, "2 blocks but 1 names"),
        ({"materials": ("brick",)}, "2 blocks but 1 materials"),
    ],
)
def test_what_is_replaced_is_checked(changed, message):
    """Blocks of a negative density weighed less than nothing, and those of an unknown role were none."""
    assembly = solver.Assembly.from_outlines([SQUARE, U_BLOCK])
    with pytest.raises(ValueError, match=message):
        replace(assembly, **changed)


def test_one_density_is_that_of_every_block():
    """It was an array without blocks."""
    assembly = replace(solver.Assembly.from_outlines([SQUARE, U_BLOCK], names=["sill", "pier"]), density=1800)
    assert assembly.density.tolist() == [1800.0, 1800.0]
    with pytest.raises(ValueError, match=r"no block is named 'Pier' \(did you mean 'pier'\?\); the assembly has 2"):
        assembly.index("Pier")


def test_names():
    assembly = solver.Assembly.from_outlines([SQUARE, U_BLOCK], names=["key", "pier"])
    assert assembly.index("pier") == 1
    with pytest.raises(ValueError, match="'spandrel'"):
        assembly.index("spandrel")


@pytest.mark.parametrize("names", [["a", "a", "a"], ["a", "a", "a #2"], ["a #2", "a", "a"], ["", "", "a"]])
def test_names_used_twice_get_a_number(names):
    unique = solver.Assembly.from_outlines([SQUARE, U_BLOCK, [[9, 0], [10, 0], [9, 1]]], names=names).names
    assert len(set(unique)) == 3
    assert unique[0] == names[0]
    assert all(new.startswith(old) for new, old in zip(unique, names, strict=True))


def test_repeated_corners_are_dropped():
    assembly = solver.Assembly.from_outlines([[[0, 0], [1, 0], [1, 0], [1, 1], [0, 1], [0, 0]]])
    assert len(assembly.vertices) == 4


REFUSED = {
    "no block": ([], {}, "at least one block"),
    "two corners": ([[[0, 0], [1, 0]]], {}, "at least three"),
    "three coordinates": ([[[0, 0, 0], [1, 0, 0], [1, 1, 0]]], {}, r"shape is \(3, 3\)"),
    "not a number": ([SQUARE, [[0, 0], [1, 0], [np.nan, 1]]], {}, "'block 1': corner 2"),
    "infinite": ([[[0, 0], [np.inf, 0], [1, 1]]], {}, "corner 1"),
    "a line": ([SQUARE, [[0, 0], [1, 0], [2, 0]]], {}, "'block 1'.*not a block"),
    "a bow tie": ([[[0, 0], [2, 1], [2, 0], [0, 2]]], {}, "'block 0'.*crosses itself"),
    "a bow through a corner": (
        [[[0, 0], [1, 0], [1, 1], [0.5, 1], [0.2, 1.3], [0.8, 1.3], [0.5, 1], [0, 1]]],
        {},
        r"'block 0'.*crosses itself",
    ),
    "a loop by a corner": ([[[0, 0], [1, 1], [1.5, 1.5], [1.5, 0.5], [1, 1], [0, 2]]], {}, "crosses itself"),
    "a spike along an edge": (
        [[[0, 0], [3, 0], [1, 0], [1, 1], [0, 1]]],
        {},
        r"doubles back: .* \(0, 0\) and \(1, 0\)",
    ),
    "an edge to and fro": ([[[0, 0], [2, 0], [1, 0], [3, 0], [3, 1], [0, 1]]], {}, "doubles back"),
    "a corner on an edge": ([[[0, 0], [2, 0], [2, 1], [1, 0], [0, 1]]], {}, "crosses itself"),
    "ragged": (
        [SQUARE, [[0, 0], [1], [1, 1]]],
        {},
        r"outline of block 'block 1' is \[\[0, 0\], \[1\], .*; give numbers",
    ),
    "heavy": ([SQUARE], {"density": "heavy"}, "density is 'heavy'; give numbers"),
    "role": ([SQUARE], {"roles": ["loose"]}, "'loose'"),
    "too few roles": ([SQUARE, U_BLOCK], {"roles": ["free"]}, "2 outlines but 1 roles"),
    "too many names": ([SQUARE], {"names": ["a", "b"]}, "1 outlines but 2 names"),
    "density": ([SQUARE, U_BLOCK], {"density": [2000, -1]}, "'block 1'.*density -1"),
    "no density": ([SQUARE], {"density": 0}, "density 0"),
    "thickness": ([SQUARE], {"thickness": np.nan}, "thickness nan"),
    "densities": ([SQUARE], {"density": [1, 2]}, "give one number or 1"),
    "masked": ([SQUARE, U_BLOCK], {"density": np.ma.array([2e3, 1e4], mask=[0, 1])}, "'block 1'.*density nan"),
}


@pytest.mark.parametrize("what", REFUSED)
def test_refused(what):
    outlines, given, message = REFUSED[what]
    with pytest.raises(ValueError, match=message):
        solver.Assembly.from_outlines(outlines, **given)


@pytest.mark.slow
def test_results_show_themselves_in_one_line():
    """A wall of a thousand blocks at a prompt or in a notebook: no screens of numbers."""
    response = arch_response()
    assert repr(response.assembly) == "<Assembly of 14 blocks: 12 free, 1 fixed, 1 moving>"
    assert repr(response).startswith("<Response of 14 blocks: settlement, ")
    assert repr(response).endswith("increments, collapsed>")
    assert repr(response.path[0]).startswith("<Increment equilibrium at 0, reaction ")
    assert max(len(repr(shown)) for shown in (response, response.assembly, response.path[0])) < 120


def test_halves_of_characters_are_refused():
    square = [[0, 0], [1, 0], [1, 1], [0, 1]]
    with pytest.raises(ValueError, match=r"block 1: its name 'a\\ud800' holds half of a character at place 1"):
        solver.Assembly.from_outlines([square, [[x + 1, y] for x, y in square]], names=["b", "a\ud800"])
    with pytest.raises(ValueError, match=r"block 0: its material '\\udfff' holds half of a character at place 0"):
        solver.Assembly.from_outlines([square], materials=["\udfff"])
    with pytest.raises(ValueError, match=r"block 0: its name 'a\\x00' holds a NUL at place 1, which no file can hold"):
        solver.Assembly.from_outlines([square], names=["a\0"])


@pytest.mark.parametrize("made", [replace, copy.copy, copy.deepcopy, lambda one: pickle.loads(pickle.dumps(one))])
def test_arrays_that_others_follow_from_cannot_be_written_into(made):
    """Of ``density[:] = 1000`` masses that had been read knew nothing: the limit load doubled, in silence."""
    blocks = solver.Assembly.from_outlines([SQUARE])
    assert blocks.masses.tolist() == [2000.0]
    blocks = made(blocks)
    for name in ("density", "roles", "vertices", "offsets", "thickness", "masses", "free", "centroids", "widths"):
        with pytest.raises(ValueError, match="read-only"):
            getattr(blocks, name)[:] = 1
    density = np.array([1000.0])
    assert replace(blocks, density=density).masses.tolist() == [1000.0]
    density[:] = 3000.0
