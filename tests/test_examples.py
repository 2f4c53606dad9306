"""Every shipped case runs from its file to its results; the façade, which takes a quarter of an hour, is only built."""

from dataclasses import replace
from pathlib import Path

import pytest

import blockvis
import solver
from blockvis.case import case_assembly, read_case

EXAMPLES = sorted((Path(__file__).parent.parent / "examples").glob("*.toml"))
LONG = {"facade"}

#: How each ends, and the first reaction over the weight of the free blocks, as measured; they guard against change.
ENDS = {
    "semicircular_arch": (solver.Status.COLLAPSED, 0.177115),
    "portal_frame": (solver.Status.COLLAPSED, 0.461538),
    "panel_with_opening": (solver.Status.LIMIT_REACHED, 0.4203),
    "wall_self_weight": (solver.Status.LIMIT_REACHED, 0.2069),
    "wall_loaded": (solver.Status.LIMIT_REACHED, 0.2215),
    "wall_with_arch": (solver.Status.COLLAPSED, None),
    "arch_moving_load": (solver.Status.COLLAPSED, None),
    "wall_horizontal_acceleration": (solver.Status.COLLAPSED, 0.509956),
    "wall_horizontal_after_settlement": (solver.Status.COLLAPSED, 0.509956),
}


@pytest.mark.parametrize("path", [p for p in EXAMPLES if p.stem not in LONG], ids=lambda p: p.stem)
def test_example_runs_and_every_increment_proves_itself(path, tmp_path):
    case = replace(read_case(path), animation=None)
    run = blockvis.run_case(case, tmp_path / "out")
    response, (ending, first) = run.response, ENDS[path.stem]
    assert response.stop is ending, response.message
    assert run.missing == ()
    if first is not None:
        assert response.reaction[0] / response.total_weight == pytest.approx(first, abs=1e-4)
    smallest = response.assembly.areas.min() ** 0.5
    for increment in response.path:
        certificate = increment.certificate
        assert certificate.equilibrium_residual < 1e-8
        assert certificate.duality_gap < 1e-7
        assert certificate.largest_penetration < 1e-6 * smallest
    if ending is solver.Status.COLLAPSED:
        assert "macro-block" in run.summary["mechanism"]


def test_the_facade_is_built():
    assembly = case_assembly(read_case(EXAMPLES[0].parent / "facade.toml"))
    assert assembly.n_blocks > 1400
    assert assembly.moving.any()
