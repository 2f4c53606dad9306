"""Numbers of others: least-thickness arches at decreasing friction, and walls on a tilting table.

Cocchetti & Rizzi (2020), Frattura ed Integrità Strutturale 51, 356-375, doi 10.3221/IGF-ESIS.51.26: semicircular
arches of radial joints whose weight lies on the centreline, by thrust lines; numbers of pages 364 and 370. Hua,
Buzzetti, Pingaro, da Silva & Milani (2025), LACT3 v1.0, github.com/GabrieleMilani/LACT3_v1.0: collapse angles to 0.01°
of associative limit analysis, static and kinematic, for the drawings in ``sample``, in ``LACT3_SolverTest.m``.
"""

from itertools import pairwise

import numpy as np
import pytest

import solver
from blockvis import generators

#: Joints are few beside a continuum of them, where hinges and slips choose their place.
VOUSSOIRS = [54, pytest.param(108, marks=pytest.mark.slow)]


def on_the_centreline(voussoirs, thickness_ratio):
    """A semicircular arch, R = 1, and its weight, moved from the centroids to the arcs of the centreline."""
    arch = generators.arch(voussoirs=voussoirs, thickness_ratio=thickness_ratio)
    dead, free, half = solver.self_weight(arch).dead.copy(), arch.free, np.pi / (2 * voussoirs)
    angle = np.arctan2(arch.centroids[free, 1], arch.centroids[free, 0])
    dead[free, 1] = dead[free, 1].mean()
    dead[free, 2] = dead[free, 1] * (np.sin(half) / half * np.cos(angle) - arch.centroids[free, 0])
    return arch, solver.Loads(dead, solver.weight_fraction(arch, (1.0, 0.0), free))


def stands(voussoirs, thickness_ratio, friction_coefficient):
    arch, loads = on_the_centreline(voussoirs, thickness_ratio)
    limit = solver.limit_load(arch, loads=loads, friction_coefficient=friction_coefficient)
    return not np.isnan(limit.multiplier)


def least(holds, low, high, steps):
    """The smallest value between two at which something holds, by halving."""
    assert holds(high)
    assert not holds(low)
    for _ in range(steps):
        middle = (low + high) / 2
        low, high = (low, middle) if holds(middle) else (middle, high)
    return high


@pytest.mark.parametrize("voussoirs", VOUSSOIRS)
@pytest.mark.parametrize("thickness_ratio", [0.200637, pytest.param(0.3, marks=pytest.mark.thorough)])
def test_least_friction_of_a_semicircular_arch(voussoirs, thickness_ratio):
    """It slides at its springers and near 30° from the crown, however thick; at t/R = 0.200637 it hinges as well."""
    friction = least(lambda mu: stands(voussoirs, thickness_ratio, mu), 0.305, 0.315, 8)
    assert friction == pytest.approx(0.309215, abs=4e-4)


@pytest.mark.parametrize(
    ("friction_coefficient", "low", "thrust"),
    [
        pytest.param(0.5, 0.106, 0.621772, id="hinges"),
        pytest.param(0.3094, 0.198, 0.485714, id="slides and hinges", marks=pytest.mark.thorough),
    ],
)
def test_thrust_at_the_least_thickness(friction_coefficient, low, thrust):
    """H / (w R) where but one thrust line is left, w the weight per length of the centreline."""
    thickness = least(lambda ratio: stands(54, ratio, friction_coefficient), low, low + 0.004, 9)
    arch, loads = on_the_centreline(54, thickness)
    limit = solver.limit_load(arch, loads=loads, friction_coefficient=friction_coefficient)
    between = np.sort([limit.contacts.block_a, limit.contacts.block_b], axis=0)
    at_crown = limit.forces[(between[0] == 26) & (between[1] == 27), 0].sum()
    weight_per_length = -loads.dead[arch.free, 1].sum() / np.pi
    assert at_crown / weight_per_length == pytest.approx(thrust, abs=1e-3)


def tilting_angle(assembly, friction_angle):
    """Angle [°] at which blocks fall from a table that turns counter-clockwise, by the associative limit load."""
    live = solver.weight_fraction(assembly, (1.0, 0.0), assembly.free)
    loads = solver.Loads(solver.self_weight(assembly).dead, live)
    friction_coefficient = np.tan(np.radians(friction_angle))
    return np.degrees(
        np.arctan(solver.limit_load(assembly, loads=loads, friction_coefficient=friction_coefficient).multiplier)
    )


def tilting_arch():
    """``arch_1.dxf``: 27 voussoirs between radii of 317 and 373.3 mm, the lowest two one with the ground."""
    return generators.arch(radius=0.34515, thickness_ratio=56.3 / 345.15, embrace=180 * 25 / 27, voussoirs=25)


def test_arch_on_a_tilting_table():
    assert tilting_angle(tilting_arch(), 30) == pytest.approx(17.10, abs=0.01)


@pytest.mark.slow
def test_arch_that_is_tilted():
    """The same along a path of its own, on ground that turns: it only hinges, so that flow does not matter."""
    arch = tilting_arch()
    outlines = [arch.outline(i) for i in range(arch.n_blocks)]
    arch = solver.Assembly.from_outlines(outlines, roles=["free" if free else "moving" for free in arch.free])
    turn = solver.Settlement(rotation_centre=(0, 0), rotation=1, increment=0.05, limit=1, tolerance=1e-5)
    response = solver.settle(arch, turn, friction_coefficient=np.tan(np.radians(30)))
    assert np.degrees(response.collapse.displacement) == pytest.approx(17.10, abs=0.01)


def competition_wall():
    """``wall.dxf``: 8 × 27 bricks of 250 × 55.6 mm, a slit and an opening under a lintel of three bricks."""
    length, height, courses = 0.25, 1.5 / 27, 27
    outlines = []
    for course in range(courses):
        joints = np.array([0, *np.arange(0.5, 8, 1), 8] if course % 2 else np.arange(9.0))
        slit = [(1.0, 2.0)] if 1 <= course <= 24 else []
        opening = [(3.5, 5.5)] if 2 <= course <= 23 else []
        lintel = [(3.0, 6.0)] if course == 24 else []
        for left, right in pairwise(joints):
            pieces = [(left, right)]
            for start, end in slit + opening + lintel:
                pieces = [
                    part for a, b in pieces for part in ((a, min(b, start)), (max(a, end), b)) if part[1] > part[0]
                ]
            outlines += [(a, b, course) for a, b in pieces]
        outlines += [(*span, course) for span in lintel]
    boxes = [
        [
            [a * length, c * height],
            [b * length, c * height],
            [b * length, (c + 1) * height],
            [a * length, (c + 1) * height],
        ]
        for a, b, c in outlines
    ]
    ground = [[-1, -1], [3, -1], [3, 0], [-1, 0]]
    return solver.Assembly.from_outlines([*boxes, ground], roles=["free"] * len(boxes) + ["fixed"])


def test_wall_on_a_tilting_table():
    """Of the 10th International Masonry Conference's competition, 8 bricks long and 27 courses high; 26°."""
    wall = competition_wall()
    assert wall.free.sum() == 182
    assert tilting_angle(wall, 26) == pytest.approx(16.73, abs=0.01)
