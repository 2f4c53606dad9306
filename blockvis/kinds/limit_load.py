"""Limit loads: the largest multiplier of live loads, along a settlement or over the positions of a load that moves."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

import solver
from blockvis.cases.contents import Case
from blockvis.cases.key import NOT_NEGATIVE, NUMBERS, Key, one_of
from blockvis.cases.loads import moving_loads
from blockvis.cases.toml_table import Table
from blockvis.formats.reading import naming
from blockvis.results.about import (
    after_settlements,
    collapse_phase,
    governing_limit,
    in_phase,
    limit_states,
    phases_of,
    unit_and_phase,
)
from blockvis.results.mechanism_arrays import SWING, swing_factors, swung_increment
from blockvis.results.other_mechanisms import has_others
from blockvis.results.tables import csv_text, finite
from blockvis.text import force_text
from solver import mechanics

from .kind import (
    AnalysisKind,
    AnalysisRun,
    Course,
    RunInput,
    Steps,
    needs_live_load,
    needs_no_crushing,
    without_increments,
)
from .settlement import not_reached, settlement_course, settlement_steps, stored_settlements

#: Flow rules of the sliding joints of a limit load.
FLOWS = ("associative", "non-associative")

#: What faces of blocks in space resist when they turn in their own plane.
TORSIONS = ("points", "uniform")

#: Frames in which the mechanism of a limit load is swung.
SWINGING_FRAMES = 30

#: Displacement within which joints that a settlement has opened may close, in mean heights of the free blocks, which do
#: not depend on how deep these are. Without it the capacity of a wall of many bricks is that of its loosest brick.
CLOSING = 1e-3

#: Part of a multiplier by which that of joints that stay open has to differ to be told.
NOTABLE = 0.01

#: So many times the displacement by which open joints may close, a note tells the multiplier where it is another.
MORE = 10.0

#: Positions of a load that a note lists.
MOST_LISTED = 8


@dataclass(frozen=True)
class LimitLoadSettings:
    """Keys of the case file that limit loads have for themselves; see :attr:`LimitLoadKind.keys`."""

    flow: str = "associative"
    capacity_at: tuple[float, ...] | None = None
    displacement: float | None = None
    torsion: str = "points"


@dataclass(frozen=True)
class Standing:
    """Where blocks stand after a settlement, what ties do there and which mortar is left; as drawn by default."""

    pose: solver.Pose | None = None
    ties: mechanics.TieForces | None = None
    bonds: mechanics.Bonds | None = None

    @classmethod
    def at(cls, increment: solver.Increment) -> Standing:
        """Take them of an increment of the settlement."""
        return cls(increment.pose, increment.ties, increment.bonds)


@dataclass(frozen=True)
class LimitLoadCheckpoint:
    """Where limit loads go on from, after one of them, to the same bits."""

    limits: tuple[solver.LimitLoad, ...]  #: Found so far, in the order of their increments; numbers alone.
    settlement: mechanics.PathState | None = None  #: Where the settlement stands along which they are asked for.
    standing: Standing = Standing()  #: Where the settlement ended that comes before the places of a load.


class LimitLoadKind(AnalysisKind):
    """Limit loads: one as drawn, one at each settlement that is wanted, or one for each position of a load."""

    name = "limit load"
    parameter = mechanics.LOAD_POSITION
    measured = mechanics.LOAD_MULTIPLIER
    checkpoint = LimitLoadCheckpoint
    keys = (
        Key("flow", one_of(FLOWS), "Whether sliding joints of a limit load dilate (associative) or not", FLOWS[1],
            default=FLOWS[0]),
        Key("torsion", one_of(TORSIONS), "Torsion of faces in space: by their contact points, or at uniform pressure",
            TORSIONS[1], default=TORSIONS[0]),
        Key("capacity_at", NUMBERS, "Settlements at which limit loads are wanted, in each [[settlement]] that reaches "
            "them; of a rotation in rad", [0.0, 0.02], "m", otherwise="every increment"),
        Key("displacement", NOT_NEGATIVE, "Within which joints that a settlement has opened may close", 0.001, "m",
            otherwise=f"{CLOSING:g} mean heights of the blocks"),
    )  # fmt: skip

    def read(self, top: Table, analysis: Table) -> LimitLoadSettings:
        """Read the keys ``flow``, ``torsion``, ``capacity_at`` and ``displacement``."""
        return LimitLoadSettings(**super().read(top, analysis))

    def refuse(self, settings: LimitLoadSettings, case: Case) -> None:
        """Refuse keys of limit loads."""
        reasons = {
            "flow": "follows the geometry, in which friction never dilates",
            "torsion": "has the torsion of its contact points",
        }
        for key, reason in reasons.items():
            if (value := getattr(settings, key)) != getattr(LimitLoadSettings, key):
                raise ValueError(
                    f'{case.source}: [analysis] {key} "{value}" belongs to kind = "{self.name}"; a {case.analysis} '
                    f"{reason}"
                )
        if settings.displacement is not None:
            raise _displacement_without_settlement(case)
        if settings.capacity_at is not None:
            raise _capacity_at_without_settlement(case)

    def checked(self, case: Case) -> Case:
        """Check the keys, and let each settlement stop where limit loads are wanted."""
        needs_live_load(case)
        if case.settlements:
            needs_no_crushing(case, " after a settlement")
        elif case.controls.increments == mechanics.LINEAR_PROGRAM:
            raise ValueError(
                f'{case.source}: [analysis] increments = "{case.controls.increments}" is of settlements, and the case '
                "has none; leave it out"
            )
        settings: LimitLoadSettings = case.settings
        if settings.displacement is not None and not case.settlements:
            raise _displacement_without_settlement(case)
        if settings.capacity_at is None:
            return case
        if not case.settlements or any(load.positions for load in case.loads):
            raise _capacity_at_without_settlement(case)
        with naming(f"{case.source}: [analysis] capacity_at"):
            # Some settlement has to reach each of them.
            replace(max(case.settlements, key=lambda settlement: settlement.limit), stops=settings.capacity_at)
        reached = [[s for s in settings.capacity_at if s <= phase.limit] for phase in case.settlements]
        stopping = [replace(phase, stops=stops) for phase, stops in zip(case.settlements, reached, strict=True)]
        return replace(case, settlements=tuple(stopping))

    @property
    def capacity(self) -> mechanics.Quantity:
        """The load multiplier, also after settlements."""
        return self.measured

    def course(self, case: Case) -> Course:
        """Run over the positions of a load that moves, else over the settlements of a case."""
        if any(load.positions for load in case.loads) or not case.settlements:
            return Course(self.parameter, self.measured, case.settlements)
        return replace(settlement_course(case.settlements), measured=self.measured)

    def start(self, given: RunInput, resume: Any, found: Sequence[solver.Increment]) -> AnalysisRun:
        """Prepare limit loads along the settlements of a case or after them, and report a fall in these."""
        places, live = moving_loads(given.case.loads, given.assembly, given.case.source)
        run = AnalysisRun(self.name, given, self.course(given.case))
        if resume is not None:
            pairs = zip(resume.limits, found, strict=True)
            run.limits = [replace(limit, held=increment.held) for limit, increment in pairs]
        steps = _over_places(run, places, live, resume, found) if len(places) else _along_settlement(run, resume, found)
        run.steps = mechanics.Increments(steps).begin()
        return run

    def summary(self, response: solver.Response) -> dict[str, Any]:
        """List the limit loads; of the one that governs its bounds, flow and status, too."""
        chosen, states = response.governing, limit_states(response)
        limit = next((limit for limit, state in states if state is chosen), states[0][0] if states else None)
        governing = {} if limit is None else _stored(limit)
        summary: dict[str, Any] = {
            "settlements": [asdict(settlement) for settlement in response.settlements],
            **{f"limit_load_{key}": governing.get(key) for key in ("multiplier", "bounds", "flow", "status")},
            "live_load": governing.get("live_load"),
            "limit_loads": [
                {
                    "increment": number,
                    **_stored(limit),
                    "programs": limit.programs,
                    **({"torsion": limit.torsion} if limit.torsion != "points" else {}),
                    **({} if limit.staying_open is None else {"staying_open": finite(limit.staying_open)}),
                }
                for number, (limit, _) in enumerate(states)
            ],
        }
        if limit is not None and response.assembly.dimension == 3:
            summary["limit_load_torsion"] = limit.torsion
        if limit is not None and limit.caveat:
            summary["limit_load_caveat"] = limit.caveat
        if chosen is not None and response.collapse is None:
            mechanism = mechanics.mechanism_of(response.assembly, chosen) if chosen.velocity.any() else None
            summary["mechanism"] = None if mechanism is None else str(mechanism)
            if mechanism is not None:
                summary |= _effective_mass(response, chosen, mechanism, limit)
        if not response.parameter.is_path and len(response.limits) > 1:
            found = chosen is not None and np.isfinite(chosen.measured)
            summary["governing_position"] = chosen.parameter if chosen is not None and found else None
        return summary

    def restored(self, response: solver.Response, summary: Mapping[str, Any]) -> solver.Response:
        """Complete the response by the settlements and limit loads of the summary."""
        response = super().restored(response, summary)
        settlements = stored_settlements(summary)
        response = replace(response, settlements=settlements)
        if summary.get("parameter") == mechanics.SETTLEMENT.name:
            response = replace(response, parameter=settlement_course(settlements).parameter)
        return replace(response, limits=_stored_limits(summary, response.increments))

    def tables(self, response: solver.Response) -> dict[str, str]:
        """Make either envelope.csv, a row per position, or capacity.csv, a row per settlement."""
        over_settlement = response.parameter.is_path
        if not over_settlement and len(response.limits) < 2:
            return {}
        first = ["phase", "settlement"] if over_settlement else ["position"]
        known = any(limit.staying_open is not None for limit in response.limits)
        last = ["staying_open"] if known and not over_settlement else []
        header = [*first, "load_multiplier", "static", "kinematic", "status", "flow", "mechanism", *last]
        rows = []
        for limit, state in limit_states(response):
            place = [repr(float(state.parameter))]
            numbers = [repr(float(v)) for v in (limit.multiplier, *limit.bounds)]
            words = str(mechanics.mechanism_of(response.assembly, state)) if limit.mechanism.any() else ""
            where = [str(state.phase), *place] if over_settlement else place
            own = [repr(math.nan if limit.staying_open is None else float(limit.staying_open)) for _ in last]
            rows.append([*where, *numbers, str(limit.status), limit.flow, words, *own])
        return {"capacity.csv" if over_settlement else "envelope.csv": csv_text(header, rows)}

    def headline(self, response: solver.Response) -> str:
        """Count the limit loads."""
        return mechanics.counted(len(response.limits), "limit load")

    def covers_message(self, response: solver.Response) -> bool:
        """Whether there is a limit load, which :meth:`lines` describe."""
        return response.collapse is not None or response.stop is solver.Status.COLLAPSED

    def lines(self, response: solver.Response) -> list[str]:
        """Describe the limit load that governs, and where it is."""
        path, state, said = response.path, response.governing, self.summary(response)
        if state is None or said["limit_load_multiplier"] is None:
            return []
        converged = said["limit_load_status"] != solver.LimitStatus.NOT_CONVERGED
        low, high = said["limit_load_bounds"]
        kind = "bounds" if said["limit_load_flow"] == "associative" else "values, no bounds,"
        known = f", static and kinematic {kind} differ by {high - low:.1e}" if converged else ""
        lines = [f"load multiplier      {state.load_multiplier:12.6g}     {said['limit_load_flow']} friction{known}"]
        # Moments have no resultant.
        if state.reaction:
            share = state.reaction / response.total_weight
            lines.append(f"live load            {state.reaction:12.6g} N   {share:.6f} W")
        if said["limit_load_status"] != solver.LimitStatus.FOUND:
            worth = "" if converged else ": no limit load, but the value of the program that came nearest"
            if not converged and high is not None:
                worth += f', at most that of flow = "associative", {high:.6g}, a proved upper bound'
            lines.append(f"status: {said['limit_load_status']}{worth}")
        if "limit_load_torsion" in said:
            by = "friction at their points" if said["limit_load_torsion"] == "points" else "a uniform pressure"
            lines.append(f"torsion of the faces: that of {by}")
        if "limit_load_caveat" in said:
            lines.append(f"note: {said['limit_load_caveat']}")
        if not response.parameter.is_path and len(path) > 1:
            ends = {path[0].parameter: "the first", path[-1].parameter: "the last"}
            end = ends.get(state.parameter)
            beyond = f", {end} of them: it may be lower beyond" if end else ""
            lines.append(f"the lowest of {len(path)} positions: load at x = {state.parameter:.6g} m{beyond}")
        elif phases_of(response):
            before = _before(response)
            drawn = "" if before is None else f"   before it {before:.6g}"
            place = unit_and_phase(response, state.phase)
            lines.append(f"after a settlement of{state.parameter:12.6g} {place}{drawn}")
        lines += filter(None, [after_settlements(response)])
        lines += [f"note: {note}" for note in _notes_on_places(response)]
        lines.append(response.message if response.collapse is not None else f"mechanism: {said['mechanism']}")
        if (mass := said.get("effective_mass_share")) is not None:
            spectral = f"a spectral acceleration of {said['spectral_acceleration']:.6g} g"
            lines.append(f"effective mass       {mass:12.6g}     of what moves: {spectral}")
            if "effective_mass_note" in said:
                lines.append(f"note: {said['effective_mass_note']}")
        return lines

    def title(self, response: solver.Response) -> str:
        """Name the limit load that governs."""
        state = response.governing
        if state is None or not np.isfinite(state.load_multiplier):
            return response.message or f"Limit load: {response.stop}"
        where = ""
        if len(response.path) > 1:
            place = unit_and_phase(response, state.phase)
            where = f" at {response.parameter.name} {state.parameter:.5g} {place}"
        told = f"Limit load: α = {state.load_multiplier:.5g}{where}"
        return " ".join(filter(None, (told, after_settlements(response))))

    def rows(self, response: solver.Response) -> list[tuple[str, str]]:
        """Describe the limit load that governs: its values, and where it is."""
        rows, path, state, c = [], response.path, response.governing, response.collapse
        if c is not None:
            phase = collapse_phase(response)
            where = f"{c.unit}{in_phase(response, 0 if phase is None else phase)}"
            place = f"{c.displacement:.6g} {where}, between {c.bracket[0]:.6g} and {c.bracket[1]:.6g}"
            rows.append(("settlement alone: collapse at", place))
        if state is None or not np.isfinite(state.load_multiplier):
            return rows
        limit = governing_limit(response)
        rows.append(("load multiplier α", f"{state.load_multiplier:.6g}"))
        if limit is not None:
            unproved = limit.status is solver.LimitStatus.NOT_CONVERGED
            what = "value, associative upper bound" if unproved else "static, kinematic value"
            rows.append((what, f"{limit.bounds[0]:.7g}, {limit.bounds[1]:.7g}"))
            rows.append(("friction", limit.flow))
            if response.assembly.dimension == 3:
                rows.append(("torsion of the faces", limit.torsion))
            if limit.caveat:
                rows.append(("note", limit.caveat))
            if limit.live_force:
                rows.append(("live load at α = 1", force_text(limit.live_force)))
        if not response.parameter.is_path and len(path) > 1:
            rows.append(("lowest of", f"{len(path)} positions, at x = {state.parameter:.5g} m"))
        elif phases_of(response):
            rows.append(("after a settlement of", f"{state.parameter:.6g} {unit_and_phase(response, state.phase)}"))
            before = _before(response)
            if before is not None:
                rows.append(("before it", f"{before:.6g}"))
        rows += [("the structure", f"stands {after}")] if (after := after_settlements(response)) else []
        rows += [("note", note) for note in _notes_on_places(response)]
        return rows


def _before(response: solver.Response) -> float | None:
    """Give the multiplier before any settlement; None where it was not asked for."""
    first = response.path[0]
    return first.load_multiplier if first.phase == 0 and first.parameter == 0.0 else None


def _notes_on_places(response: solver.Response) -> list[str]:
    """Say at which of several positions of a load no limit load is known, and where joints that stay open lower it."""
    states = limit_states(response)
    if response.parameter.is_path or len(states) < 2:
        return []
    places = [state.parameter for limit, state in states if limit.status is solver.LimitStatus.NOT_CONVERGED]
    other = sorted(
        (limit.staying_open, limit.multiplier, state.parameter)
        for limit, state in states
        if limit.staying_open is not None and _differs(limit, limit.staying_open)
    )
    told = (f"{least:.6g} instead of {most:.6g} at x = {x:.6g} m" for least, most, x in other[:MOST_LISTED])
    listed = "; ".join(told) + "; ..." * (len(other) > MOST_LISTED)
    note = f"where open joints stay open α is less at {len(other)} of {len(states)} positions: {listed}"
    return [*filter(None, (_unconverged(places, len(states)), note if other else ""))]


def _unconverged(places: Sequence[float], number: int) -> str:
    if not places:
        return ""
    listed = ", ".join(f"{x:.6g}" for x in places[:MOST_LISTED]) + ", ..." * (len(places) > MOST_LISTED)
    return (
        f"{len(places)} of {number} positions did not converge: x = {listed} m; what is carried there may be less than "
        "the lowest that was found"
    )


def _displacement_without_settlement(case: Case) -> ValueError:
    return ValueError(
        f"{case.source}: [analysis] displacement is that of a limit load after a settlement, in which open joints may "
        "close"
    )


def _capacity_at_without_settlement(case: Case) -> ValueError:
    return ValueError(
        f'{case.source}: [analysis] capacity_at asks for limit loads (kind = "limit load") of loads that stand still, '
        "along a [settlement]"
    )


def _effective_mass(
    response: solver.Response, state: solver.Increment, mechanism: mechanics.Mechanism, limit: solver.LimitLoad | None
) -> dict[str, Any]:
    """Part e* of the mass of what moves that takes part in the mechanism, and α/e* in g, under one acceleration alone.

    e* = (Σ P δ)² / (Σ P Σ P δ²) over macro-blocks of weight P whose centroids move by δ along the acceleration: Italian
    Circolare 7/2019, C8.7.1.2.1. Where others than the mechanism that was found are as near, it is 1, which e* never
    exceeds, and with a note why.
    """
    loads, assembly, d = response.loads_at(state), response.assembly, response.assembly.dimension
    if loads.live_acceleration is None:
        return {}
    moves = mechanism.parts >= 0
    given = loads.live_acceleration[moves]
    fastest = given[np.linalg.norm(given, axis=1).argmax()]
    of_blocks = np.zeros_like(loads.live[moves])
    of_blocks[:, :d] = given * (assembly.masses[moves] * solver.GRAVITY)[:, None]
    is_one = (given == fastest).all(axis=1) | ~given.any(axis=1)
    size = float(np.linalg.norm(fastest))
    if not (is_one.all() and size > 0.0 and np.allclose(of_blocks, loads.live[moves])):
        return {}
    pushed = loads.live_at(assembly, state.pose)[moves, :d] @ fastest / size**2
    weights, travel = np.bincount(mechanism.parts[moves], pushed), mechanism.motions[:, :d] @ fastest
    spread = float(weights.sum() * (weights * travel**2).sum())
    if spread == 0.0:
        return {}
    share = float((weights * travel).sum() ** 2 / spread)
    found = {"effective_mass_share": share, "spectral_acceleration": state.load_multiplier * size / share}
    if share > 1.0 - 1e-9 or limit is None:
        return found
    live, associative = loads.live_at(assembly, state.pose), limit.flow == FLOWS[0]
    if limit.torsion != TORSIONS[0]:
        others = "whether other mechanisms have this multiplier is not known where torsion is uniform: that found"
    elif response.settlements and any(law.bonds for law in response.interfaces.laws):
        others = "whether other mechanisms have this multiplier is not known of mortar after a settlement: that found"
    elif has_others(assembly, response.interfaces, response.ties, state, live, fastest, associative=associative):
        others = "several mechanisms have this multiplier, and the one found"
    else:
        return found
    return {
        "effective_mass_share": 1.0,
        "spectral_acceleration": state.load_multiplier * size,
        "effective_mass_note": f"{others}, of effective mass {share:.6g}, need not be the least favourable; 1, which "
        "none exceeds, is on the safe side",
    }


def _stored(limit: solver.LimitLoad) -> dict[str, Any]:
    """List what summary.json says of a limit load."""
    return {
        "multiplier": finite(limit.multiplier),
        "bounds": [finite(bound) for bound in limit.bounds],
        "status": str(limit.status),
        "flow": limit.flow,
        "live_load": limit.live_force,
    }


def _stored_limits(summary: Mapping[str, Any], increments: Sequence[solver.Increment]) -> tuple[solver.LimitLoad, ...]:
    limits = []
    for stored in summary.get("limit_loads", []):
        state = increments[stored["increment"]]
        status = solver.LimitStatus(stored["status"])
        nothing = math.inf if status is solver.LimitStatus.UNBOUNDED else math.nan
        low, high = (nothing if bound is None else bound for bound in stored["bounds"])
        limits.append(
            solver.LimitLoad(
                multiplier=nothing if stored["multiplier"] is None else stored["multiplier"],
                bounds=(low, high),
                certificate=state.certificate,
                status=status,
                flow=stored["flow"],
                live_force=stored["live_load"],
                programs=stored["programs"],
                held=state.held,
                torsion=stored.get("torsion", "points"),
                staying_open=stored.get("staying_open"),
            )
        )
    return tuple(limits)


def _along_settlement(run: AnalysisRun, resume: LimitLoadCheckpoint | None, found: Sequence[solver.Increment]) -> Steps:
    """Limit states at each wanted settlement, or as drawn where there is none; then the last one's mechanism."""
    case = run.given.case
    shown = found[-1] if found else None
    if not case.settlements and shown is None:
        shown = _limit_state(run, run.given.loads, Standing(), 0)
        yield replace(shown, checkpoint=LimitLoadCheckpoint(_numbers(run)))
    before = None if resume is None else resume.settlement
    steps = settlement_steps(run.given, before, whole=True)
    programs = 0
    for increment in steps:
        programs += increment.programs
        if increment.status == solver.Status.FALLING:
            yield replace(increment, measured=increment.load_multiplier)
        elif _wanted(case, increment):
            # In equilibrium under the dead load: the settlement has proved it.
            state = _limit_state(run, run.given.loads, Standing.at(increment), programs)
            seconds = state.seconds + increment.seconds
            state = replace(state, parameter=increment.parameter, phase=increment.phase, seconds=seconds)
            if shown is None or _is_last_wanted(case, increment):
                state = replace(state, notes=(*state.notes, *_closing_note(run, increment, shown is None)))
            shown, programs = replace(state, status=solver.Status.EQUILIBRIUM), 0
            reached = increment.checkpoint
            yield replace(shown, checkpoint=None if reached is None else LimitLoadCheckpoint(_numbers(run), reached))
    ending = steps.ending
    if ending.stop is not solver.Status.LIMIT_REACHED:
        if ending.stop is solver.Status.COLLAPSED and shown is not None:
            return replace(ending, message=f"the settlement alone brings it down: {ending.message}")
        return not_reached(ending, "it carries no live load")
    assert shown is not None
    yield from _swinging(run.given.assembly, shown)
    return _limit_ending(run.limits[-1])


def _over_places(
    run: AnalysisRun,
    places: np.ndarray,
    live: Callable[[int], solver.PointForces],
    resume: LimitLoadCheckpoint | None,
    found: Sequence[solver.Increment],
) -> Steps:
    """Limit states for each place of a moving load at the end of the settlements; then the mechanism of the lowest."""
    dead, programs = run.given.loads, 0
    standing = Standing() if resume is None else resume.standing
    steps = settlement_steps(run.given, whole=True) if resume is None else without_increments()
    for increment in steps:
        programs += increment.programs
        standing = Standing.at(increment)
        if increment.status == solver.Status.FALLING:
            yield replace(increment, measured=increment.load_multiplier)
    if steps.ending.stop is not solver.Status.LIMIT_REACHED:
        return not_reached(steps.ending, "it carries no live load")
    chosen, shown = 0, None
    for number, x in enumerate(places):
        if number < len(found):
            state = found[number]
        elif run.limits and run.limits[-1].status is solver.LimitStatus.NO_EQUILIBRIUM:
            # The dead load alone has no equilibrium: nor has it with the live load elsewhere.
            break
        else:
            loads = dead.with_forces(run.given.assembly, live(number), "live")
            state = replace(_limit_state(run, loads, standing, programs), parameter=float(x))
            if (stays := _closing(run, loads, standing, 0.0)) is not None:
                run.limits[-1] = replace(run.limits[-1], staying_open=stays.multiplier)
                state = replace(state, programs=state.programs + stays.increment.programs)
            if number == 0 and (words := _closing_words(run)):
                state = replace(state, notes=(*state.notes, words))
            programs = 0
        if shown is None or mechanics.lowest([shown.load_multiplier, state.load_multiplier]):
            chosen, shown = number, state
        if number >= len(found):
            yield replace(state, checkpoint=LimitLoadCheckpoint(_numbers(run), standing=standing))
    # A load that moves is kept at the place that governs.
    run.given = replace(run.given, loads=dead.with_forces(run.given.assembly, live(chosen), "live"))
    assert shown is not None
    yield from _swinging(run.given.assembly, shown)
    ending = _limit_ending(run.limits[chosen])
    pairs = zip(places.tolist(), run.limits, strict=False)
    note = _unconverged([x for x, limit in pairs if limit.status is solver.LimitStatus.NOT_CONVERGED], len(places))
    return replace(ending, message="; ".join(filter(None, (ending.message, note))))


def _numbers(run: AnalysisRun) -> tuple[solver.LimitLoad, ...]:
    """Limit loads so far without their arrays."""
    return tuple(replace(limit, held=None, analysed=None) for limit in run.limits)


def _wanted(case: Case, increment: solver.Increment) -> bool:
    """Whether the capacity is asked for at an increment of the settlement."""
    phase = case.settlements[increment.phase]
    near = (abs(increment.parameter - s) <= 2e-9 * phase.increment for s in phase.stops)
    return case.settings.capacity_at is None or any(near)


def _is_last_wanted(case: Case, increment: solver.Increment) -> bool:
    """Whether no capacity is asked for beyond an increment of the settlement."""
    every = case.settings.capacity_at is None
    number, last = [one for one in enumerate(case.settlements) if every or one[1].stops][-1]
    end = last.limit if every else max(last.stops)
    return increment.phase == number and increment.parameter >= end - 2e-9 * last.increment


def _closing_words(run: AnalysisRun) -> str:
    """Say within which displacement joints that a settlement has opened may close; empty where they stay open."""
    within = _displacement(run.given.case, run.given.assembly)
    if within == 0.0:
        return ""
    return f"joints that are open may close by up to {within:.4g} m for the live load ([analysis] displacement)"


def _differs(limit: solver.LimitLoad, least: float) -> bool:
    """Whether the multiplier of joints that stay open is another, notably."""
    return math.isfinite(least) and not math.isclose(limit.multiplier, least, rel_tol=NOTABLE)


def _closing(run: AnalysisRun, loads: solver.Loads, at: Standing, times: float) -> solver.LimitLoad | None:
    """Find the last limit load where joints that are open close by so many times more; None where that is unknown."""
    # Without dilatancy it takes many programs, not one more.
    asked = _closing_words(run) and run.given.case.settings.flow == FLOWS[0]
    if not asked or math.isnan(run.limits[-1].multiplier):
        return None
    return _limit(run, loads, at, times * _displacement(run.given.case, run.given.assembly))


def _closing_note(run: AnalysisRun, at: solver.Increment, first: bool) -> list[str]:
    """Say within which displacement open joints may close, at the first state, and α where they close less or more."""
    words, limit = _closing_words(run), run.limits[-1]
    told = []
    for times, where in ((0.0, "without"), (MORE, f"where they close by {MORE:g} times as much")):
        other = _closing(run, run.given.loads, Standing.at(at), times)
        if other is not None and _differs(limit, other.multiplier):
            told.append(f"{other.multiplier:.6g} {where}")
    if told:
        place = f"{at.parameter:.6g} {run.given.case.settlements[at.phase].unit}"
        return [f"at a settlement of {place} α = {', '.join([f'{limit.multiplier:.6g}', *told])}: {words}"]
    return [words] if words and first else []


def _limit_state(run: AnalysisRun, loads: solver.Loads, at: Standing, programs: int) -> solver.Increment:
    started = time.perf_counter()
    limit = _limit(run, loads, at, _displacement(run.given.case, run.given.assembly))
    run.limits.append(limit)
    state = limit.increment
    seconds = time.perf_counter() - started
    return replace(state, parameter=0.0, phase=0, programs=state.programs + programs, seconds=seconds)


def _limit(run: AnalysisRun, loads: solver.Loads, at: Standing, displacement: float) -> solver.LimitLoad:
    """Find a limit load whose open joints may close within a displacement [m]."""
    case, assembly = run.given.case, run.given.assembly
    with naming(str(case.source)):
        return solver.Structure(assembly, run.given.interfaces, loads, ties=run.given.ties).limit_load(
            pose=at.pose,
            ties_at=at.ties,
            bonds_at=at.bonds,
            flow=case.settings.flow,
            torsion=case.settings.torsion,
            displacement=displacement,
            overlap_tolerance=case.controls.overlap_tolerance,
        )


def _displacement(case: Case, assembly: solver.Assembly) -> float:
    """Within which joints that a settlement has opened may close [m]."""
    if not case.settlements or case.settings.displacement is not None:
        return case.settings.displacement or 0.0
    upward = assembly.vertices[:, -1]
    high, low = (end.reduceat(upward, assembly.shapes.offsets[:-1]) for end in (np.maximum, np.minimum))
    return CLOSING * float((high - low)[assembly.free].mean())


def _limit_ending(limit: solver.LimitLoad) -> mechanics.Ending:
    stops = {
        solver.LimitStatus.UNBOUNDED: solver.Status.LIMIT_REACHED,
        solver.LimitStatus.NO_EQUILIBRIUM: solver.Status.NO_INITIAL_EQUILIBRIUM,
        solver.LimitStatus.NOT_CONVERGED: solver.Status.SOLVER_FAILED,
    }
    return mechanics.Ending(stops.get(limit.status, solver.Status.COLLAPSED), str(limit))


def _swinging(assembly: solver.Assembly, state: solver.Increment) -> Iterator[solver.Increment]:
    """Pseudo-motion: the mechanism of a limit state, followed to first order, out of scale."""
    factors = swing_factors(assembly, state, SWING, np.linspace(0.0, 1.0, SWINGING_FRAMES + 1)[1:])
    if factors.any():
        # What the state has to tell it tells itself.
        state = replace(state, notes=())
        yield from (swung_increment(state, state.velocity * factor) for factor in factors)
