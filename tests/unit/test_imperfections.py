"""Imperfections: joints stay closed, faces plane, and the same seed gives the same structure."""

import numpy as np
import pytest
import shapely
import tomli_w
from structures import assembly_of, case_from

import blockvis
import solver
from blockvis import generators
from solver import mechanics

WINDOW = {"x": 1.0, "y": 0.6, "width": 1.0, "height": 0.6, "head": "segmental arch", "voussoirs": 9}

STRUCTURES = {
    "arch": ("arch", {}, 0.005),
    "running bond": ("panel", {"nb": 20, "nc": 6}, 0.02),
    "english bond": ("wall", {"bond": "english", "settling": [1.0, 2.0]}, 0.002),
    "cut bricks round an arch": ("wall", {"openings": [WINDOW], "settling": [1.5, 3.0]}, 0.003),
    "battered buttresses": ("buttressed arch", {}, 0.01),
}


def imperfect(layout, deviation, seed=1, **parameters):
    """A layout whose corners are off by a normal distribution."""
    case = {
        "geometry": {"layout": layout, "parameters": parameters},
        "settlement": {"direction": [0, -1], "increment": 0.001, "limit": 0.001},
        "imperfections": {"kind": "vertices", "distribution": "normal", "deviation": deviation, "seed": seed},
    }
    return assembly_of(case_from(tomli_w.dumps(case)))


def _touching(assembly):
    """Length over which each pair of blocks touches, to within a hair."""
    low = shapely.polygons([shapely.linearrings(assembly.outline(i)) for i in range(assembly.n_blocks)])
    i, j = shapely.STRtree(low).query(low, predicate="dwithin", distance=1e-9)
    i, j = i[i < j], j[i < j]
    # The part of one outline within a hair of the other.
    shared = shapely.intersection(shapely.boundary(low[i]), shapely.buffer(low[j], 1e-9, quad_segs=1))
    length = shapely.length(shared)
    return {(a, b): x for a, b, x in zip(i.tolist(), j.tolist(), length.tolist(), strict=True) if x > 1e-6}


@pytest.mark.parametrize("name", STRUCTURES)
def test_joints_stay_closed_and_nothing_overlaps(name):
    layout, parameters, deviation = STRUCTURES[name]
    drawn = generators.build(layout, parameters)
    moved = imperfect(layout, deviation, **parameters)
    assert mechanics.overlap_depths(moved.vertices, moved.offsets, 0.0)[2].max(initial=0.0) < 1e-12
    before, after = _touching(drawn), _touching(moved)
    assert before.keys() == after.keys(), "the same blocks touch"
    for pair, length in before.items():
        assert after[pair] == pytest.approx(length, abs=12 * deviation), [drawn.names[k] for k in pair]
    assert len(moved.vertices) == len(drawn.vertices), "faces stay plane"
    steps = np.hypot(*(moved.vertices - drawn.vertices)[drawn.free[drawn.block_of_vertex]].T)
    assert 0.3 * deviation < np.sqrt((steps**2).mean() / 2.0) < 1.5 * deviation


def test_a_whole_wall_covers_the_same_ground_without_a_gap():
    moved = imperfect("panel", 0.03, nb=6, nc=5)
    blocks = [shapely.Polygon(moved.outline(i)).buffer(1e-9) for i in range(moved.n_blocks)]
    union = shapely.unary_union(blocks)
    assert union.geom_type == "Polygon"
    assert len(union.interiors) == 0


def test_outer_corners_of_supports_stay():
    drawn = generators.arch()
    moved = imperfect("arch", 0.01)
    for block in np.flatnonzero(~drawn.free).tolist():
        np.testing.assert_allclose(moved.outline(block), drawn.outline(block), atol=1e-15)


def test_too_large_displacements_are_refused():
    with pytest.raises(ValueError, match=r"by more than a quarter of the distance to the next corner.*smaller"):
        imperfect("arch", 0.5)


def test_the_seed_decides():
    first, again, other = (imperfect("arch", 0.005, seed).vertices for seed in (4, 4, 5))
    np.testing.assert_array_equal(first, again)
    assert np.abs(first - other).max() > 1e-4


CASE = """
[geometry]
layout = "arch"
[material]
friction_coefficient = 0.7
[settlement]
direction = [1, 0]
increment = 0.001
limit = 0.001
[[imperfections]]
kind = "friction"
distribution = "lognormal"
deviation = 0.2
seed = 3
[[imperfections]]
kind = "density"
distribution = "uniform"
lower = 0.8
upper = 1.2
seed = 3
"""


def test_a_case_scatters_friction_per_joint_and_density_per_block(tmp_path):
    case = case_from(CASE, tmp_path)
    plain = case_from(CASE[: CASE.index("[[imperfections]]")], tmp_path)
    response = blockvis.run_case(case, tmp_path / "out", outputs=()).response
    assembly, interfaces = response.assembly, response.interfaces
    ratio = assembly.density / assembly_of(plain).density
    assert ((ratio >= 0.8) & (ratio <= 1.2)).all()
    assert ratio[assembly.free].std() > 0.05
    assert (ratio[~assembly.free] == 1.0).all(), "supports carry no weight"
    a, b = np.arange(11), np.arange(1, 12)
    friction = interfaces.friction(assembly, a, b)
    assert len(np.unique(friction)) == 11
    np.testing.assert_array_equal(friction, interfaces.friction(assembly, b, a))
    np.testing.assert_array_equal(friction[3:5], interfaces.friction(assembly, a[3:5], b[3:5]))


def test_factors_of_joints_follow_their_distribution():
    scatter = solver.JointScatter(11, lambda p: p)
    a, b = (x.ravel() for x in np.meshgrid(np.arange(200), np.arange(200, 400)))
    factors = np.sort(scatter.factors(a, b))
    # Kolmogorov-Smirnov at one in a million.
    assert np.abs(factors - (np.arange(len(factors)) + 0.5) / len(factors)).max() < 2.7 / np.sqrt(len(factors))
    other = solver.JointScatter(12, lambda p: p).factors(a, b)
    assert abs(np.corrcoef(scatter.factors(a, b), other)[0, 1]) < 0.025


@pytest.mark.thorough
def test_friction_of_a_joint_is_kept_while_contact_points_come_and_go():
    """A block on a tilting support slides when the angle reaches the friction of its own joint."""
    block, ground = [[0, 0], [2, 0], [2, 1], [0, 1]], [[-5, -1], [7, -1], [7, 0], [-5, 0]]
    assembly = solver.Assembly.from_outlines([block, ground], roles=["free", "moving"])
    scatter = solver.JointScatter(5, lambda p: 0.5 + p)
    interfaces = solver.Interfaces(solver.InterfaceLaw(0.4), scatter=scatter)
    mu = interfaces.friction(assembly, np.array([0]), np.array([1]))[0]
    assert mu != pytest.approx(0.4, rel=0.02)
    tilt = solver.Settlement(rotation_centre=(0, 0), rotation=-1.0, increment=0.02, limit=1.0, tolerance=1e-5)
    response = solver.settle(assembly, tilt, interfaces=interfaces)
    assert response.collapse.displacement == pytest.approx(np.arctan(mu), abs=2e-5)


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ({"kind": "vertex"}, ("vertex", "did you mean 'vertices'")),
        ({"kind": "friction", "distribution": "normal", "deviation": 0.1}, ("may become negative", "lower")),
        ({"kind": "density", "distribution": "uniform", "lower": 0, "upper": 1}, ("blocks have a weight",)),
        ({"kind": "vertices", "distribution": "normal", "deviation": 0.1, "seed": -1}, ("seed is -1",)),
    ],
)
def test_bad_imperfections_are_refused(table, words):
    plain = CASE[: CASE.index("[[imperfections]]")]
    with pytest.raises(ValueError) as error:
        case_from(plain + tomli_w.dumps({"imperfections": table}))
    for word in ("case.toml: [imperfections", *words):
        assert word in str(error.value)


def test_an_imperfection_given_twice_is_refused():
    with pytest.raises(ValueError, match=r"imperfections 3\] kind 'friction' is there twice"):
        case_from(CASE + '[[imperfections]]\nkind = "friction"\ndistribution = "lognormal"\ndeviation = 0.1\n')
