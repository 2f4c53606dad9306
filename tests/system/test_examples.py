"""The façade, which takes minutes, is built and runs small; the other examples run in tests/regression."""

from pathlib import Path

import numpy as np
import pytest
from structures import assembly_of

import solver
from blockvis import generators, read_case
from solver import mechanics

FACADE = Path(__file__).parents[2] / "examples" / "facade.toml"

pytestmark = pytest.mark.path


@pytest.mark.thorough
def test_the_facade_is_built():
    assembly = assembly_of(read_case(FACADE))
    assert assembly.n_blocks > 1400
    assert assembly.moving.any()


def key_sinks(assembly, pose, arch):
    """How far the key of an arch has slipped below its left and its right neighbour along their joints [m]."""
    number = sum(name.startswith(f"voussoir {arch}-") for name in assembly.names)
    left, key, right = (assembly.index(f"voussoir {arch}-{number // 2 + k}") for k in (0, 1, 2))
    corners = mechanics.moved_vertices(assembly, pose)
    sinks = []
    for neighbour in (left, right):
        beside, own = (np.arange(*assembly.offsets[block : block + 2]) for block in (neighbour, key))
        apart = np.linalg.norm(assembly.vertices[beside][:, None] - assembly.vertices[own], axis=2)
        # The two corners they share in the drawing: the one on the intrados, then the one on the extrados.
        shared = sorted(np.argwhere(apart < 1e-6).tolist(), key=lambda ij: assembly.vertices[beside[ij[0]], 1])
        (low, high), (key_low, key_high) = (
            corners[block[[ij[k] for ij in shared]]] for k, block in enumerate((beside, own))
        )
        up = (high - low) / np.hypot(*(high - low))
        sinks.append(float(((low - key_low) + (high - key_high)) @ up / 2.0))
    return sinks


@pytest.mark.thorough
def test_the_key_of_a_small_facade_with_the_friction_of_the_large_one_sinks():
    """One window over the edge of the settling ground: the key goes down with one haunch and slips along the other."""
    case = read_case(FACADE)
    assembly = generators.facade(
        bricks=12,
        courses=16,
        storeys=1,
        windows=1,
        window_bricks=4,
        window_courses=8,
        sill_courses=2,
        voussoirs=3,
        rise_courses=1.0,
        settling_from=1.5,
    )
    settlement = solver.Settlement(direction=(0, -1), increment=0.025, limit=0.1)
    interfaces = solver.Interfaces(solver.InterfaceLaw(case.friction_coefficient), case.interfaces)
    response = solver.settle(assembly, settlement, interfaces=interfaces)
    assert response.stop is solver.Status.LIMIT_REACHED
    assert key_sinks(assembly, response.path[0].pose, 1) == pytest.approx([0.0, 0.0], abs=1e-6)
    # Measured: 72 mm below one, level with the other. The wall stands in equilibrium, the key wedged lower down.
    assert np.mean(key_sinks(assembly, response.path[-1].pose, 1)) > 0.005
    assert response.path[-1].certificate.equilibrium_residual < 1e-8
