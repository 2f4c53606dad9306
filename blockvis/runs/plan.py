"""A case as an analysis that is ready to run: its input checked before anything is written."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import solver
from blockvis.cases.build import case_changes, case_controls, case_interfaces, case_loads, case_ties
from blockvis.cases.contents import Case
from blockvis.cases.profiles import with_profiles
from blockvis.kinds.kind import AnalysisRun, RunInput
from blockvis.kinds.kinds import KINDS
from blockvis.text import beginning
from solver import mechanics


def planned(
    case: Case,
    assembly: solver.Assembly,
    resume: Any = None,
    found: Sequence[solver.Increment] = (),
    ties: Sequence[solver.Tie] | None = None,
) -> AnalysisRun:
    """Prepare the analysis of a case, its input checked.

    It may go on from the checkpoint of an increment, of the type that its kind of analysis has, after those found up to
    there; ties are those of the case by default. Raises ``ValueError`` for input that cannot be analysed: limit loads
    and pushovers solve their first increment for that.
    """
    kind = KINDS[case.analysis]
    if not isinstance(resume, kind.checkpoint | None):
        raise ValueError(f"a {case.analysis} cannot go on from a {type(resume).__name__}")
    case = replace(
        case,
        settlements=with_profiles(case.settlements, case.profiles, assembly, case.source),
        profiles=(),
        controls=case_controls(case, assembly),
    )
    refuse_ties(case)
    members = case_ties(case, assembly) if ties is None else tuple(ties)
    changes = case_changes(case, assembly, members)
    if changes and not kind.has_phases:
        what = "[[remove]]" if case.removals else "[[loads]] phase"
        which = " or ".join(f'"{name}"' for name, other in KINDS.items() if other.has_phases)
        raise ValueError(
            f"{case.source}: {what} belongs to [analysis] kind = {which}; a {case.analysis} has the blocks and loads "
            "of the drawing: leave it out"
        )
    given = RunInput(case, assembly, case_interfaces(case), case_loads(case, assembly), changes, members)
    if case.settlements or kind.has_phases:
        with beginning(f"{case.source}:"):
            mechanics.check_settlement(assembly, case.settlements, case.controls, changes, members)
    return kind.start(given, resume, found)


def refuse_ties(case: Case) -> None:
    """Raise ValueError for ties that an analysis does not know, or before a settlement that there is not."""
    for tie in case.ties:
        who = f"{tie.where} '{tie.name}'"
        if case.controls.increments == mechanics.LINEAR_PROGRAM:
            raise ValueError(
                f'{who}: increments = "{case.controls.increments}" knows no ties; leave increments out, or [[ties]]'
            )
        count = len(case.settlements)
        if tie.phase > max(count, 1):
            there = "is one settlement" if count == 1 else f"are {count} settlements"
            raise ValueError(
                f"{who}: phase is {tie.phase}, and there {there}; give the settlement, counted from 1, before which it "
                "is installed"
            )
