"""Blocks share no volume at any increment of a path in space: manifold3d is the judge."""

import numpy as np
import pytest
from test_space_paths import leaning_plug

import solver
from blockvis.generators import dome, l_corner
from solver import mechanics

manifold = pytest.importorskip("manifold3d", reason="manifold3d, the judge of shared volumes, is not installed")

pytestmark = pytest.mark.path

#: Of the smaller of two blocks.
SHARED = 1e-6


def largest_shared_volume(assembly: solver.Assembly, vertices: np.ndarray) -> float:
    """Largest volume that two blocks share, over that of the smaller one; of all pairs whose boxes meet."""
    parts, volumes = assembly.shapes.parts, assembly.shapes.volumes
    corners = np.split(parts.placed(vertices).vertices, parts.solids.offsets[1:-1])
    low, high = (np.array([f(own, axis=0) for own in corners]) for f in (np.min, np.max))
    origin = vertices.mean(axis=0)
    bodies = [manifold.Manifold.hull_points(own - origin) for own in corners]
    shared = np.zeros((assembly.n_blocks, assembly.n_blocks))
    for i in range(len(bodies)):
        for j in np.flatnonzero((low[i] < high).all(axis=1) & (low < high[i]).all(axis=1)):
            a, b = sorted((parts.block_of_part[i], parts.block_of_part[j]))
            if a < b and i < j:
                shared[a, b] += (bodies[i] ^ bodies[j]).volume()
    return float((shared / np.minimum(volumes[:, None], volumes)).max())


def paths() -> dict[str, tuple[solver.Assembly, solver.Settlement, float]]:
    """Small structures, their settlements and friction: sliding, hinges, and both."""
    away = solver.Settlement(radial_from=(0.0, 0.0), increment=0.04, limit=0.08)
    spreading = solver.Settlement(radial_from=(0.0, 0.0), increment=0.02, limit=0.06)
    sinking = solver.Settlement(direction=(0, 0, -1), increment=0.01, limit=0.02)
    return {
        "plug": (leaning_plug(6), away, 0.3),
        "dome": (dome(lunes=6, courses=3, thickness_ratio=0.15, cap=20.0), spreading, 0.7),
        "corner": (l_corner(courses=2), sinking, 0.6),
    }


@pytest.mark.thorough
@pytest.mark.parametrize("name", ["plug", *(pytest.param(name, marks=pytest.mark.slow) for name in ("dome", "corner"))])
def test_blocks_share_no_volume_at_any_increment(name):
    assembly, settlement, friction = paths()[name]
    response = solver.settle(
        assembly, settlement, friction_coefficient=friction, controls=solver.Controls(falling_frames=0)
    )
    assert len(response.path) >= 3
    moved = np.abs(response.path[-1].pose.positions - assembly.centroids)[assembly.free]
    assert moved.max() > 0.5 * settlement.limit
    for increment in response.path:
        vertices = mechanics.moved_vertices(assembly, increment.pose)
        assert largest_shared_volume(assembly, vertices) < SHARED, increment.parameter


def test_the_judge_sees_what_two_blocks_share():
    """Boxes driven 1e-3 of their height into each other, so that the bound above can be broken."""
    assembly = leaning_plug(3)
    lowered = assembly.vertices - np.array([0.0, 0.0, 1e-3]) * (assembly.block_of_vertex == 0)[:, None]
    assert largest_shared_volume(assembly, assembly.vertices) < SHARED
    assert largest_shared_volume(assembly, lowered) > 100 * SHARED
