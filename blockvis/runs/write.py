"""A response written to a results folder."""

from __future__ import annotations

from pathlib import Path

import solver
from blockvis.kinds.kinds import KINDS
from blockvis.pictures.paraview import write_paraview_macro
from blockvis.results.about import Result, quantities_of, response_of
from blockvis.results.folder import ResultsFolder
from blockvis.results.increments import folder_of
from blockvis.results.viewer_files import ViewerFormat


def write(response: Result, folder: str | Path, *, overwrite: bool = False) -> Path:
    """Write the results folder of a response: VTU per increment, PVD, CSV and summary.json.

    Parameters
    ----------
    response : solver.Response, solver.LimitLoad or solver.Envelope
    folder : str or Path
    overwrite : bool
        Whether results that are there already may be replaced.

    Raises
    ------
    ResultsExist
    ValueError
        If the response is read from that very folder.
    """
    response = response_of(response)
    sources = {folder_of(increment) for increment in response.increments} - {None}
    if any(source is not None and source.resolve() == Path(folder).resolve() for source in sources):
        raise ValueError(f"the response is read from '{folder}' itself; write it to another folder")
    results = ResultsFolder(
        folder,
        response.assembly,
        overwrite=overwrite,
        parameter=response.parameter,
        vtu=ViewerFormat(quantities=quantities_of(response)),
        ties=response.ties,
    )
    for increment in response.increments:
        results.add(increment)
    finish(results, response)
    results.flush()
    return results.path


def finish(results: ResultsFolder, response: solver.Response) -> dict[str, object]:
    """Write and return the summary of a response whose increments are in the folder, and the tables of its kind."""
    kind = KINDS[response.analysis]
    seconds = sum(i.seconds for i in response.increments)
    write_paraview_macro(results.path)
    return results.finish(response, seconds, own=kind.summary(response), tables=kind.tables(response))
