"""A results folder reopened as the response it was written from, with the loads and interfaces of its case."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import solver
from blockvis.case_files.read import parse_case
from blockvis.cases.build import case_changes, case_interfaces, case_loads
from blockvis.cases.contents import Case
from blockvis.cases.loads import with_moving_load
from blockvis.cases.profiles import with_profiles
from blockvis.kinds.kinds import KINDS
from blockvis.results.folder import stored_response
from blockvis.results.given import with_given
from blockvis.results.record import RECORD, case_text, read_record


def case_of(folder: Path) -> Case | None:
    """Read the case of a results folder, which is named by the file it was run from; None for a run from Python."""
    text = case_text(folder)
    return parse_case(text, Path(read_record(folder).case_file or folder / RECORD)) if text else None


def open_results(folder: str | Path) -> solver.Response:
    """Reopen a results folder as the response it was written from, without solving.

    Its increments read their arrays from the folder when they are asked for. Laws and loads are those of the case file,
    or, of a case made or changed in Python, those that the folder holds; a warning names what it does not hold: the
    scatter of friction from joint to joint. ValueError if the folder holds no results.
    """
    folder = Path(folder)
    response, summary = stored_response(folder)
    case = case_of(folder)
    analysis = summary.get("analysis", case.analysis if case else response.analysis)
    kind = KINDS[analysis]
    response = kind.restored(replace(response, analysis=analysis), summary)
    if case is None:
        return with_given(folder, response)
    if "parameter" not in summary:
        # The run was stopped before it wrote a summary.
        settlements = with_profiles(case.settlements, case.profiles, response.assembly, case.source)
        course = kind.course(replace(case, settlements=settlements, profiles=()))
        response = replace(
            response,
            settlements=course.settlements,
            control=course.control,
            parameter=course.parameter,
            measured=course.measured,
        )
    loads = case_loads(case, response.assembly)
    return replace(
        response,
        interfaces=case_interfaces(case),
        changes=case_changes(case, response.assembly, response.ties),
        loads=with_moving_load(loads, case.loads, response.assembly, case.source, summary.get("governing_position")),
    )
