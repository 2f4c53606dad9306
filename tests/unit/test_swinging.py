"""Pseudo-motion of a mechanism: how far its blocks swing, in the plane and in space."""

import numpy as np
import pytest
from structures import arch_response, vault_response

import solver
from blockvis.results.swinging import corner_speeds, swing_factors, swung_increment
from solver import mechanics


@pytest.mark.parametrize("response_of", [arch_response, vault_response], ids=["plane", "space"])
def test_a_mechanism_that_rises_swings_as_far_as_it_is_to(response_of):
    response = response_of()
    assembly, last = response.assembly, response.path[-1]
    up = np.zeros_like(last.velocity)
    up[assembly.free, assembly.dimension - 1] = 3.0
    state = mechanics.with_motion(last, up)
    np.testing.assert_allclose(corner_speeds(assembly, last.pose, up), np.where(assembly.free, 3.0, 0.0))
    free = assembly.free[assembly.block_of_vertex]
    extent = np.ptp(mechanics.moved_vertices(assembly, last.pose)[free], axis=0).max()
    for share, factor in zip((0.5, 1.0), swing_factors(assembly, state, 0.1, np.array([0.5, 1.0])), strict=True):
        frame = swung_increment(state, factor * state.velocity)
        rise = (frame.pose.positions - last.pose.positions)[assembly.free]
        np.testing.assert_allclose(rise[:, -1], 0.1 * share * extent)
        np.testing.assert_allclose(rise[:, :-1], 0.0, atol=1e-12)
        assert frame.status == solver.Status.FALLING
    at_rest = mechanics.with_motion(last, np.zeros_like(up))
    assert swing_factors(assembly, at_rest, 0.1, np.ones(1)).tolist() == [0.0]
