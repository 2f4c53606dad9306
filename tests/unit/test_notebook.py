"""What a notebook shows of a response."""

import blockvis
import solver
from blockvis import generators


def test_response_plots_itself_once_blockvis_is_imported():
    spread = solver.Settlement(direction=(1, 0), increment=0.05, limit=0.05)
    response = solver.settle(generators.arch(voussoirs=5), spread)
    shown = response.plot()._repr_html_()
    assert shown == blockvis.show(response)._repr_html_()
    assert "iframe" in shown
    assert "voussoir 1" not in shown.split("srcdoc")[0]
