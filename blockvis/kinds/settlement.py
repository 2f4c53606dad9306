"""Settlements: supports move until the structure loses equilibrium."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from typing import Any

import numpy as np

import solver
from blockvis.cases.contents import Case
from blockvis.cases.key import TRUE_OR_FALSE, Key
from blockvis.cases.toml_table import Table
from blockvis.formats.reading import naming
from blockvis.results.about import (
    Course,
    collapse_phase,
    in_phase,
    least_reaction,
    loss_of,
    mechanism_text,
    told_reaction,
    unit_and_phase,
    unit_in,
)
from blockvis.results.bearing import bearings
from blockvis.results.tables import changes_told
from blockvis.text import force_text, listed
from solver import mechanics
from solver.mechanics import counted

from .kind import AnalysisKind, AnalysisRun, RunInput, needs_no_crushing, without_increments

#: Difference of two reactions, in weights, of moments at a block's length, that is worth a line.
NOTABLE = 1e-3

#: What a reaction is where not every point of the supports moves by s.
WORK = "the work on the supports over s, which do not all move by it alone: what each bears is in supports.csv"


class SettlementKind(AnalysisKind):
    """Settlements, one after another, and the reaction of the supports."""

    name = "settlement"
    parameter = mechanics.SETTLEMENT
    measured = mechanics.REACTION
    checkpoint = mechanics.PathState
    has_phases = True
    keys = (
        Key("range", TRUE_OR_FALSE, "Whether blockvis run follows a settlement again with friction, compliance of the "
            "joints and imperfection varied, and gives the range of collapse and reaction", True, default=False),
    )  # fmt: skip

    def read(self, top: Table, analysis: Table) -> bool:
        """Read the key ``range``."""
        return bool(super().read(top, analysis)["range"])

    def refuse(self, settings: bool, case: Case) -> None:
        """Refuse a range of what follows no settlement."""
        if settings:
            raise ValueError(
                f'{case.source}: [analysis] range = true belongs to kind = "{self.name}"; a {case.analysis} has no '
                "range: leave it out"
            )

    def checked(self, case: Case) -> Case:
        """Check that the keys of a case fit together."""
        if not case.settlements:
            raise ValueError(
                f"{case.source}: [settlement] is missing; say how the moving supports move, direction = [1, 0], "
                "in space [1, 0, 0]"
            )
        if any(load.kind == "live" for load in case.loads):
            warnings.warn(
                f"{case.source}: a settlement analysis leaves the live loads out; give loads that act during it kind = "
                '"dead"',
                stacklevel=5,
            )
        needs_no_crushing(case)
        if case.settings and case.controls.increments == mechanics.LINEAR_PROGRAM:
            raise ValueError(
                f'{case.source}: [analysis] range = true belongs to increments = "{mechanics.COULOMB}"; a linear '
                "program knows no compliance and no imperfection"
            )
        return case

    def course(self, case: Case) -> Course:
        """Run over the settlements of a case."""
        return settlement_course(case.settlements)

    def start(self, given: RunInput, resume: Any, found: Sequence[solver.Increment]) -> AnalysisRun:
        """Prepare the settlements of a case under its dead loads."""
        return AnalysisRun(self.name, given, self.course(given.case), settlement_steps(given, resume))

    def summary(self, response: solver.Response) -> dict[str, Any]:
        """List the settlements, and by which method their increments were found."""
        return {
            "settlements": [asdict(settlement) for settlement in response.settlements],
            "increments_by": _method(response),
        }

    def restored(self, response: solver.Response, summary: Mapping[str, Any]) -> solver.Response:
        """Complete the response by the settlements of the summary."""
        course = settlement_course(stored_settlements(summary))
        response = super().restored(response, summary)
        return replace(response, settlements=course.settlements, parameter=course.parameter, measured=course.measured)

    def lines(self, response: solver.Response) -> list[str]:
        """Give the first and last reaction, and the settlement at collapse."""
        path, weight = response.path, response.total_weight

        def reaction(value: float, phase: int) -> str:
            moment = _is_moment(response, phase)
            value = told_reaction(value, response, moment)
            if moment:
                return f"{value:12.6g} N·m"
            return f"{value:12.6g} N   {value / weight:.6f} W"

        lines = list(map(": ".join, changes_told(response)))
        lines += [f"loss: {note}" for note in losses_of(response)]
        if _method(response) == mechanics.LINEAR_PROGRAM:
            lines.append("increments by linear program: reactions are the least that equilibrium allows")
        if path:
            first = least_reaction(path[0])
            lines.append(f"first reaction       {reaction(first, path[0].phase)}")
            if _rests_elsewhere(response):
                lines[-1] += "   the least that equilibrium allows"
                lines.append(
                    f"reaction at rest     {reaction(path[0].reaction, path[0].phase)}   before anything moves"
                )
            if path[0].reaction < -NOTABLE * _size(response, path[0].phase):
                lines[-1] += "   against the movement: by itself the structure would push these supports the other way"
            lines += [f"reactions are {WORK}"] if _is_work(response) else []
            lines += _held_down(response)
            if _is_idle(response):
                lines.append("no free block touches the supports that move: nothing follows them")
        if response.collapse is not None:
            low, high = response.collapse.bracket
            at = f"{response.collapse.displacement:12.6g} {_unit_and_phase(response)}"
            # Where the structure falls at once nothing has been in equilibrium, and there is no reaction.
            if path:
                value, where = _last_reaction(response)
                lines.append(f"last reaction        {reaction(value, path[-1].phase)}{where}")
            lines += [
                f"collapse displacement{at}   between {low:.6g} and {high:.6g}",
                f"mechanism: {mechanism_text(response)}",
            ]
            loss = loss_of(response)
            lines += [] if loss is None else [str(loss)]
        elif len(path) > 1:
            last = path[-1]
            lines.append(f"last reaction        {reaction(last.reaction, last.phase)}")
            lines.append(f"last settlement      {last.parameter:12.6g} {unit_and_phase(response, last.phase)}")
        return lines + [str(bearing) for bearing in (bearings(response, path[-1]) if path else [])]

    def title(self, response: solver.Response) -> str:
        """Say how it ended."""
        if response.collapse is not None:
            loss = loss_of(response)
            what = "Local loss" if loss is not None and loss.local else "Collapse"
            return f"{what} at a settlement of {response.collapse.displacement:.5g} {_unit_and_phase(response)}"
        if response.stop is solver.Status.LIMIT_REACHED and (losses := response.losses):
            first, lost = losses[0], sum(len(loss.blocks) for loss in losses)
            place = f"{first.settlement:.5g} {unit_and_phase(response, first.phase)}"
            when = f"at a settlement of {place}" if len(losses) == 1 else f"from a settlement of {place} on"
            return f"Part has fallen: {counted(lost, 'block')} {when}; the rest stands at the end"
        return {
            solver.Status.LIMIT_REACHED: "Standing at the end of the settlement",
            solver.Status.NO_INITIAL_EQUILIBRIUM: "No equilibrium before any settlement",
            solver.Status.SOLVER_FAILED: "The solver failed; the path up to there",
        }.get(response.stop, "Settling masonry")

    def rows(self, response: solver.Response) -> list[tuple[str, str]]:
        """Give the settlement at collapse, first and last reaction."""
        path, weight, c = response.path, response.total_weight, response.collapse

        def reaction(value: float, phase: int) -> str:
            moment = _is_moment(response, phase)
            value = told_reaction(value, response, moment)
            over = "" if moment or weight <= 0 else f" = {value / weight:.4f} W"
            return force_text(value, moment) + over

        rows = [*changes_told(response), *(("loss", note) for note in losses_of(response))]
        if c is not None:
            place = _unit_and_phase(response)
            rows.append(("collapse displacement", f"{c.displacement:.6g} {place}"))
            rows.append(("last equilibrium, first without", f"{c.bracket[0]:.6g}, {c.bracket[1]:.6g} {place}"))
        if path:
            rows.append(("first reaction", reaction(least_reaction(path[0]), path[0].phase)))
            if _rests_elsewhere(response):
                rows.append(("reaction at rest", reaction(path[0].reaction, path[0].phase)))
            rows.append(("last reaction", reaction(path[-1].reaction, path[-1].phase) + _last_reaction(response)[1]))
            rows += [("reactions", WORK)] if _is_work(response) else []
        return rows


def losses_of(response: solver.Response) -> list[str]:
    """Say where blocks left for good while the structure stood, which, and what they weigh."""
    said = []
    for loss in response.losses:
        weight = f"{force_text(loss.weight)}, {100.0 * loss.share:.2g} % of the weight"
        place = f"{loss.settlement:.6g} {unit_and_phase(response, loss.phase)}"
        said.append(f"{listed(loss.blocks, 4)} at {place}, {weight}; the structure stands without")
    return said


def _unit_and_phase(response: solver.Response) -> str:
    """Write the unit of the settlement at collapse, and in which of several settlements it is."""
    phase = collapse_phase(response)
    assert response.collapse is not None
    assert phase is not None
    return f"{response.collapse.unit}{in_phase(response, phase)}"


def _last_reaction(response: solver.Response) -> tuple[float, str]:
    """Give the reaction at the last equilibrium, and its phase where what falls as a phase begins had it before."""
    last, collapse = response.path[-1], response.collapse
    if collapse is not None and collapse.reaction is not None:
        return collapse.reaction, ""
    return last.reaction, "" if collapse is None else in_phase(response, last.phase)


def settlement_course(settlements: tuple[solver.Settlement, ...]) -> Course:
    """Run over settlements and measure the reaction to them, in their unit."""
    unit = settlements[0].unit if settlements else "m"
    return Course(mechanics.settlement_in(unit), mechanics.reaction_to(unit), settlements)


def stored_settlements(summary: Mapping[str, Any]) -> tuple[solver.Settlement, ...]:
    """Read the settlements of a stored summary."""
    motions = [dict(motion) for motion in summary.get("settlements", [])]
    for motion in motions:
        motion["blocks"] = None if motion["blocks"] is None else tuple(motion["blocks"])
    return tuple(solver.Settlement(**motion) for motion in motions)


def _rests_elsewhere(response: solver.Response) -> bool:
    """Whether the reaction at rest is notably above the least that equilibrium allows there."""
    first = response.path[0]
    return abs(first.reaction - least_reaction(first)) > NOTABLE * _size(response, first.phase)


def _held_down(response: solver.Response) -> list[str]:
    """Doubt supports that bear the structure at rest, and go straight down, where they could or do pull it down."""
    motion, path = response.settlements[0], response.path
    pulls = response.ties or not response.interfaces.dry
    if pulls or len(response.settlements) > 1 or motion.direction is None or motion.rotation:
        return []
    *level, rise = motion.direction
    notable = NOTABLE * _size(response, 0)
    least = min(least_reaction(path[0]), *(increment.reaction for increment in path))
    if rise >= 0.0 or any(level) or path[0].reaction < notable or least > -notable:
        return []
    doubt = "doubt faces of theirs that are steep or overhang"
    return [f"below 0 these supports, which sink, hold the structure down: {doubt}"]


def _is_work(response: solver.Response) -> bool:
    """Whether supports turn as they go, or do not all go as far, so that a reaction is no load on a foundation."""
    for motion in response.settlements:
        each = {tuple(one) for one in (motion.profile or {}).values()}
        turns = any(any(one[response.assembly.dimension :]) for one in each) or motion.rotation != 0.0
        if len(each) > 1 or (turns and motion.unit == "m"):
            return True
    return False


def _is_idle(response: solver.Response) -> bool:
    """Whether neither a free block nor a tie holds on to the supports that move, before they do."""
    contacts = response.path[0].contacts
    # Joints of given stiffness carry across gaps, too.
    carries = response.path[0].forces[:, 0] > 0.0
    touches = carries | (contacts.gaps < NOTABLE * response.assembly.block_size)
    pairs = np.stack([contacts.block_a, contacts.block_b])[:, touches]
    return not response.ties and not response.assembly.moving[pairs].any()


def _size(response: solver.Response, phase: int) -> float:
    """Weight of the structure [N], at a block's length [N·m] where what resists the supports is a moment."""
    return response.total_weight * (response.assembly.block_size if _is_moment(response, phase) else 1.0)


def _is_moment(response: solver.Response, phase: int) -> bool:
    """Whether the supports rotate in a phase: what resists them is a moment."""
    return unit_in(response, phase) == "rad"


def _method(response: solver.Response) -> str | None:
    """Name the method of the increments: only the path of Coulomb friction has bounds of its reactions."""
    if not response.path:
        return None
    bounds = [(increment.least, increment.largest) for increment in response.path]
    return mechanics.LINEAR_PROGRAM if np.isnan(bounds).all() else mechanics.COULOMB


def settlement_steps(
    given: RunInput, resume: mechanics.PathState | None = None, *, whole: bool = False
) -> mechanics.Increments:
    """Follow the settlements of a case under the dead load alone; without settlements there are no increments.

    The first loss of a block ends them where what comes after is asked of the ``whole`` structure.
    """
    case = given.case
    if not case.settlements:
        return without_increments()
    with naming(str(case.source)):
        return mechanics.settlement_increments(
            given.assembly,
            case.settlements,
            interfaces=given.interfaces,
            loads=given.loads,
            controls=replace(case.controls, local_loss=0.0) if whole else case.controls,
            changes=given.changes,
            ties=given.ties,
            resume=resume,
            on_step=given.step,
        )


def left_by(settlements: Sequence[solver.Settlement]) -> list[str]:
    """Say which settlements come before a live load that has a parameter of its own; nothing where there are none."""
    told = ", then ".join(f"{settlement.limit:.6g} {settlement.unit}" for settlement in settlements)
    return [f"the live load comes after a settlement of {told}"] if told else []


def not_reached(before: mechanics.Ending, what: str) -> mechanics.Ending:
    """Say how an analysis ends whose settlement did not reach its limit; ``what`` says what that means for it."""
    if before.stop is solver.Status.COLLAPSED:
        return mechanics.Ending(solver.Status.NO_INITIAL_EQUILIBRIUM, f"the settlement alone: {before.message}; {what}")
    return mechanics.Ending(before.stop, f"during the settlement: {before.message}")
