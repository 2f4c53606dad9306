"""Files and pictures for the mechanics in ``solver``: from a drawing of masonry to its collapse.

    import blockvis, solver
    arch = blockvis.read("arch.msh", roles={"right springer": "moving", "left springer": "fixed"})
    response = solver.Structure(arch, friction_coefficient=0.6).settle((1, 0))
    blockvis.write(response, "out/")
    response.animate("out/collapse.mp4")

Lengths are in m, forces in N, angles in rad; see ``solver`` for the signs.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .case_files.read import read_case as read_case
    from .cases.backfill import lay_backfill as lay_backfill
    from .cases.contents import Case as Case
    from .explanation.explain import explain as explain
    from .formats.read import from_compas as from_compas
    from .formats.read import inspect as inspect
    from .formats.read import read as read
    from .formats.read import read_layout as read_layout
    from .formats.read import save_layout as save_layout
    from .formats.read import write_layout as write_layout
    from .layout.assemble import assemble as assemble
    from .pictures.curves import draw_curve as draw_curve
    from .pictures.render import animate as animate
    from .pictures.render import draw_mechanism as draw_mechanism
    from .pictures.render import draw_still as draw_still
    from .report.notebook import show as show
    from .report.page import write_report as write_report
    from .runs.reopen import open_results as open_results
    from .runs.run import resume_run as resume_run
    from .runs.run import run_case as run_case
    from .runs.write import write as write
    from .studies.campaign import study as study

#: Public names and where they live; loaded when first used, because VTK takes seconds to import.
_HOMES = {
    "Case": "cases.contents",
    "animate": "pictures.render",
    "assemble": "layout.assemble",
    "draw_curve": "pictures.curves",
    "draw_mechanism": "pictures.render",
    "draw_still": "pictures.render",
    "explain": "explanation.explain",
    "from_compas": "formats.read",
    "inspect": "formats.read",
    "lay_backfill": "cases.backfill",
    "open_results": "runs.reopen",
    "read": "formats.read",
    "read_case": "case_files.read",
    "read_layout": "formats.read",
    "resume_run": "runs.run",
    "run_case": "runs.run",
    "save_layout": "formats.read",
    "show": "report.notebook",
    "study": "studies.campaign",
    "write": "runs.write",
    "write_layout": "formats.read",
    "write_report": "report.page",
}

__all__ = sorted(_HOMES)


def __getattr__(name: str) -> Any:
    if name == "generators":
        return import_module(".generators", __name__)
    if name in _HOMES:
        return getattr(import_module(f".{_HOMES[name]}", __name__), name)
    raise AttributeError(f"module 'blockvis' has no attribute '{name}'")


def __dir__() -> list[str]:
    return [*__all__, "generators", *(name for name in globals() if name.startswith("__"))]
