"""One case from its file to its results folder."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import solver

from .case import Case, case_assembly, case_interfaces, case_loads, read_case
from .progress import Progress
from .results import ResultsFolder

__all__ = ["Run", "draw_results", "run_case"]


@dataclass(frozen=True)
class Run:
    """A finished run.

    Attributes
    ----------
    response : solver.Response
    folder : Path
    summary : dict
        What summary.json holds.
    missing : tuple of str
        What could not be drawn, and why.
    """

    response: solver.Response
    folder: Path
    summary: dict[str, Any]
    missing: tuple[str, ...] = field(default=())


def run_case(case: Case | str | Path, folder: str | Path | None = None, *, overwrite: bool = False) -> Run:
    """Solves a case and writes everything: VTU, PVD, CSV, summary, pictures.

    Parameters
    ----------
    case : Case, or path of a case file
    folder : str or Path, optional
        Results folder; the name of the case with "-results" in the working directory by default.
    overwrite : bool
        Whether results that are there already may be replaced.

    Returns
    -------
    Run
        Also after an interruption by Ctrl-C: what was finished is written, with status "interrupted".

    Raises
    ------
    ValueError
        For bad input, before anything is written.
    """
    if not isinstance(case, Case):
        case = read_case(case)
    folder = Path(f"{case.source.stem}-results") if folder is None else Path(folder)
    assembly = case_assembly(case)
    interfaces, loads = case_interfaces(case), case_loads(case, assembly)
    steps = solver.settlement_increments(
        assembly, case.settlements, interfaces=interfaces, loads=loads, controls=case.controls
    )
    solver.check_settlement(assembly, case.settlements, case.controls)
    results = ResultsFolder(folder, assembly, case_text=case.text, overwrite=overwrite)
    progress = Progress(case.settlements)
    ending = solver.Ending(solver.Status.INTERRUPTED, "interrupted by the user")
    try:
        while True:
            try:
                increment = next(steps)
            except StopIteration as stop:
                ending = stop.value
                break
            results.add(increment)
            progress.increment(increment)
    except KeyboardInterrupt:
        steps.close()
    finally:
        progress.done()
    response = solver.Response(
        assembly=assembly,
        settlements=case.settlements,
        interfaces=interfaces,
        loads=loads,
        increments=tuple(results.increments),
        stop=ending.stop,
        message=ending.message,
        collapse=ending.collapse,
    )
    summary = results.finish(response, sum(i.seconds for i in response.increments))
    missing: tuple[str, ...] = ()
    if ending.stop is not solver.Status.INTERRUPTED:
        missing = draw_results(response, folder, animation=case.animation, case_text=case.text)
    return Run(response, folder, summary, missing)


def draw_results(
    response: solver.Response,
    folder: Path,
    *,
    animation: str | None = "collapse.mp4",
    case_text: str = "",
) -> tuple[str, ...]:
    """Draws the pictures of a results folder.

    Parameters
    ----------
    response : solver.Response
    folder : Path
    animation : str or None
        File name in the folder; the suffix chooses mp4, gif or webp.
    case_text : str
        Shown in the report.

    Returns
    -------
    tuple of str
        What could not be drawn, and why; empty where all is there.
    """
    from .curves import draw_curve
    from .paraview_macro import write_paraview_macro
    from .render import RenderingUnavailable, animate, draw_mechanism, rendering_available
    from .report import write_report

    if not response.increments:
        return ()
    write_paraview_macro(folder)
    write_report(response, folder / "report.html", case_text)
    if response.path:
        draw_curve(response, folder / "curve.png")
    problem = rendering_available()
    if problem is not None:
        return (problem,)
    try:
        draw_mechanism(response, folder / "mechanism.png")
        if animation is not None:
            animate(response, folder / animation)
    except RenderingUnavailable as error:
        return (str(error),)
    return ()
