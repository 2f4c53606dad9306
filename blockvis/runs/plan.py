"""The analyses that a case can ask for: each a stream of increments that is checked before anything is written."""

from __future__ import annotations

import time
from collections.abc import Callable, Generator, Iterator, Sequence
from dataclasses import dataclass, field, fields, replace

import numpy as np

import solver
from blockvis.cases.build import case_interfaces, case_loads
from blockvis.cases.case import Case
from blockvis.cases.loads import moving_loads
from blockvis.results.increments import StoredLimit
from blockvis.results.quantities import POSITION
from blockvis.suggestions import nearest

#: Frames in which the mechanism of a limit load is swung, and how far its fastest block gets, in extents of the
#: structure.
SWINGING_FRAMES, SWING = 30, 0.05

#: Displacement within which joints that a settlement has opened may close, in block sizes. An arch whose hinges have
#: opened does not notice it; a wall of many bricks needs more, lest its capacity be that of its loosest brick.
CLOSING = 1e-3

Steps = Generator[solver.Increment, None, solver.Ending]


@dataclass
class Plan:
    """An analysis that is ready to run.

    Attributes
    ----------
    analysis : str
    assembly : solver.Assembly
    interfaces : solver.Interfaces
    loads : solver.Loads
    settlements : tuple
        What the parameter of the increments runs over: settlements, the control displacement, or nothing.
    steps : generator of solver.Increment
        Returns a solver.Ending.
    limits : list of solver.LimitLoad
        Filled as the steps of a limit load analysis go.
    """

    analysis: str
    assembly: solver.Assembly
    interfaces: solver.Interfaces
    loads: solver.Loads
    settlements: tuple[solver.Settlement, ...]
    steps: Steps
    limits: list[solver.LimitLoad] = field(default_factory=list)

    def told(self, increment: solver.Increment) -> None:
        """Forgets the arrays of the last limit load: those of the increment that tells it are kept.

        Parameters
        ----------
        increment : solver.Increment
            As it is kept.
        """
        self.limits[-1] = LimitNumbers.of(self.limits[-1]).told_by(increment)

    def response(self, increments: Sequence[solver.Increment], ending: solver.Ending) -> solver.Response:
        """The increments so far and how they ended."""
        return solver.Response(
            assembly=self.assembly,
            settlements=self.settlements,
            interfaces=self.interfaces,
            loads=self.loads,
            increments=tuple(increments),
            stop=ending.stop,
            message=ending.message,
            collapse=ending.collapse,
            analysis=self.analysis,
            limits=tuple(self.limits),
        )


def parameter_of(case: Case) -> str:
    """What the increments of a case run over: the parameter_word of its response."""
    if case.analysis == "pushover":
        return "control displacement"
    moving = any(load.positions for load in case.loads)
    return POSITION if case.analysis == "limit load" and (moving or not case.settlements) else "settlement"


@dataclass(frozen=True)
class LimitNumbers:
    """What a limit load is beside the arrays of the increment that tells it; as of :class:`solver.LimitLoad`."""

    multiplier: float
    bounds: tuple[float, float]
    status: solver.LimitStatus
    flow: str
    live_force: float
    programs: int

    @classmethod
    def of(cls, limit: solver.LimitLoad) -> LimitNumbers:
        """Those of a limit load."""
        return cls(**{field.name: getattr(limit, field.name) for field in fields(cls)})

    def told_by(self, state: solver.Increment) -> StoredLimit:
        """The limit load again, with the arrays of an increment."""
        return StoredLimit.of(state, **{field.name: getattr(self, field.name) for field in fields(self)})


@dataclass(frozen=True)
class SeriesCheckpoint:
    """Where limit loads go on from, after one of them, to the same bits.

    Attributes
    ----------
    limits : tuple of LimitNumbers
        Found so far, in the order of the increments that tell them.
    settlement : solver.Checkpoint, optional
        Where the settlement stands along which they are asked for.
    pose : solver.Pose, optional
        Where the settlement ended that comes before the places of a load.
    """

    limits: tuple[LimitNumbers, ...]
    settlement: solver.Checkpoint | None = None
    pose: solver.Pose | None = None


AnyCheckpoint = solver.Checkpoint | solver.PushoverCheckpoint | SeriesCheckpoint


def checkpoint_kind(case: Case) -> type[AnyCheckpoint]:
    """The kind of checkpoint that the analysis of a case goes on from."""
    kinds: dict[str, type[AnyCheckpoint]] = {
        "settlement": solver.Checkpoint,
        "pushover": solver.PushoverCheckpoint,
        "limit load": SeriesCheckpoint,
    }
    return kinds[case.analysis]


def planned(
    case: Case,
    assembly: solver.Assembly,
    resume: AnyCheckpoint | None = None,
    told: Sequence[solver.Increment] = (),
) -> Plan:
    """The analysis of a case, its input checked.

    Parameters
    ----------
    case : Case
    assembly : solver.Assembly
    resume : solver.Checkpoint, solver.PushoverCheckpoint or SeriesCheckpoint, optional
        Where it goes on from; of the :func:`checkpoint_kind` of the case.
    told : sequence of solver.Increment
        What was found up to there.

    Raises
    ------
    ValueError
        For input that cannot be analysed. Limit loads and pushovers solve their first increment for that.
    """
    if not isinstance(resume, checkpoint_kind(case) | None):
        raise ValueError(f"a {case.analysis} cannot go on from a {type(resume).__name__}")
    interfaces, loads = case_interfaces(case), case_loads(case, assembly)
    if case.settlements:
        solver.check_settlement(assembly, case.settlements, case.controls)
    if case.analysis == "settlement":
        assert not isinstance(resume, solver.PushoverCheckpoint | SeriesCheckpoint)
        steps = solver.settlement_increments(
            assembly,
            case.settlements,
            interfaces=interfaces,
            loads=loads,
            controls=case.controls,
            resume=resume,
        )
        return Plan(case.analysis, assembly, interfaces, loads, case.settlements, steps)
    if case.analysis == "pushover":
        control = _checked_control(case, assembly)
        assert not isinstance(resume, solver.Checkpoint | SeriesCheckpoint)
        steps = _pushover(case, control, assembly, interfaces, loads, resume)
        over: tuple[solver.Settlement, ...] = (control,)  # type: ignore[assignment]  # stands in for a settlement
        return Plan(case.analysis, assembly, interfaces, loads, over, _started(steps))
    places, live = moving_loads(case.loads, assembly, case.source)
    # A load that moves is kept where it is told about: at the first place until the lowest is known.
    plan = Plan(case.analysis, assembly, interfaces, loads, () if len(places) else case.settlements, iter(()))  # type: ignore[arg-type]
    assert not isinstance(resume, solver.Checkpoint | solver.PushoverCheckpoint)
    if resume is not None:
        plan.limits = [limit.told_by(state) for limit, state in zip(resume.limits, told, strict=True)]
    if len(places):
        plan.steps = _started(_over_places(case, plan, places, live, resume, told))
    else:
        plan.steps = _started(_along_settlement(case, plan, resume, told))
    return plan


def _started(steps: Steps) -> Steps:
    """The same steps, the first of them taken at once: what it refuses is refused before anything is written."""
    try:
        first = next(steps)
    except StopIteration as stop:
        return _ended(stop.value)
    return _following(first, steps)


def _ended(ending: solver.Ending) -> Steps:
    return ending
    yield


def _following(first: solver.Increment, steps: Steps) -> Steps:
    yield first
    return (yield from steps)


def _checked_control(case: Case, assembly: solver.Assembly) -> solver.ControlDisplacement:
    control = case.control
    assert control is not None
    free = [name for name, is_free in zip(assembly.names, assembly.free, strict=True) if is_free]
    if control.block not in free:
        what = "is a support" if control.block in assembly.names else "is no block of the layout"
        raise ValueError(
            f"{case.source}: [control] block '{control.block}' {what}{nearest(control.block, free)}; name a free "
            f"block, for instance {', '.join(free[:6])}"
        )
    return control


def _settled(
    case: Case,
    assembly: solver.Assembly,
    interfaces: solver.Interfaces,
    loads: solver.Loads,
    resume: solver.Checkpoint | None = None,
) -> Steps:
    """The settlements of a case, told under the dead load alone; nothing where there are none."""
    if not case.settlements:
        return solver.Ending(solver.Status.LIMIT_REACHED)
    return (
        yield from solver.settlement_increments(
            assembly, case.settlements, interfaces=interfaces, loads=loads, controls=case.controls, resume=resume
        )
    )


def _pushover(
    case: Case,
    control: solver.ControlDisplacement,
    assembly: solver.Assembly,
    interfaces: solver.Interfaces,
    loads: solver.Loads,
    resume: solver.PushoverCheckpoint | None,
) -> Steps:
    pose, steps = None, _settled(case, assembly, interfaces, loads)
    # A pushover that has begun has its settlement behind it.
    before = solver.Ending(solver.Status.LIMIT_REACHED)
    while resume is None:
        try:
            increment = next(steps)
        except StopIteration as stop:
            before = stop.value
            break
        if increment.status == solver.Status.FALLING:
            yield replace(increment, settlement=0.0, phase=0)
        pose = increment.pose
    if before.stop is not solver.Status.LIMIT_REACHED:
        return _not_reached(before, "nothing is left to push over")
    try:
        return (
            yield from solver.pushover_increments(
                assembly, control, loads=loads, interfaces=interfaces, controls=case.controls, pose=pose, resume=resume
            )
        )
    except ValueError as error:
        raise ValueError(f"{case.source}: {error}") from None


def _not_reached(before: solver.Ending, what: str) -> solver.Ending:
    """How an analysis ends whose settlement did not reach its limit."""
    if before.stop is solver.Status.COLLAPSED:
        return solver.Ending(solver.Status.NO_INITIAL_EQUILIBRIUM, f"the settlement alone: {before.message}; {what}")
    return solver.Ending(before.stop, f"during the settlement: {before.message}")


def _along_settlement(
    case: Case, plan: Plan, resume: SeriesCheckpoint | None, told: Sequence[solver.Increment]
) -> Steps:
    """Limit states at each wanted settlement, or as drawn where there is none; then the last one's mechanism."""
    shown = told[-1] if told else None
    if not case.settlements and shown is None:
        shown = _limit_state(case, plan, plan.loads, None, None, 0)
        yield replace(shown, checkpoint=_checkpoint(plan))
    before = None if resume is None else resume.settlement
    steps = _settled(case, plan.assembly, plan.interfaces, plan.loads, before)
    programs = 0
    while True:
        try:
            increment = next(steps)
        except StopIteration as stop:
            ending: solver.Ending = stop.value
            break
        programs += increment.programs
        if increment.status == solver.Status.FALLING:
            yield increment
        elif _wanted(case, increment):
            # In equilibrium under the dead load: the settlement has proved it.
            state = _limit_state(case, plan, plan.loads, increment.pose, increment, programs)
            shown, programs = replace(state, status=solver.Status.EQUILIBRIUM), 0
            reached = increment.checkpoint
            yield replace(shown, checkpoint=None if reached is None else _checkpoint(plan, settlement=reached))
    if ending.stop is not solver.Status.LIMIT_REACHED:
        if ending.stop is solver.Status.COLLAPSED and shown is not None:
            return replace(ending, message=f"the settlement alone brings it down: {ending.message}")
        return _not_reached(ending, "it carries no live load")
    assert shown is not None
    yield from _swinging(plan.assembly, shown)
    return _limit_ending(plan.limits[-1])


def _over_places(
    case: Case,
    plan: Plan,
    places: np.ndarray,
    live: Callable[[int], np.ndarray],
    resume: SeriesCheckpoint | None,
    told: Sequence[solver.Increment],
) -> Steps:
    """Limit states for each place of a moving load at the end of the settlements; then the mechanism of the lowest."""
    standing, programs = plan.loads, 0
    pose = None if resume is None else resume.pose
    steps = _settled(case, plan.assembly, plan.interfaces, standing)
    while resume is None:
        try:
            increment = next(steps)
        except StopIteration as stop:
            if stop.value.stop is not solver.Status.LIMIT_REACHED:
                return _not_reached(stop.value, "it carries no live load")
            break
        programs += increment.programs
        pose = increment.pose
        if increment.status == solver.Status.FALLING:
            yield increment
    chosen, shown, least = 0, None, np.inf
    for number, x in enumerate(places):
        if number < len(told):
            state = told[number]
        elif plan.limits and plan.limits[-1].status is solver.LimitStatus.NO_EQUILIBRIUM:
            # Nor is there one with the load elsewhere.
            break
        else:
            loads = replace(standing, live=standing.live + live(number))
            state = replace(_limit_state(case, plan, loads, pose, None, programs), settlement=float(x))
            programs = 0
        multiplier = float(np.nan_to_num(state.load_multiplier, nan=-np.inf, posinf=np.inf))
        if shown is None or multiplier < least:
            chosen, shown, least = number, state, multiplier
        if number >= len(told):
            yield replace(state, checkpoint=_checkpoint(plan, pose=pose))
    plan.loads = replace(standing, live=standing.live + live(chosen))
    assert shown is not None
    yield from _swinging(plan.assembly, shown)
    return _limit_ending(plan.limits[chosen])


def _checkpoint(
    plan: Plan, *, settlement: solver.Checkpoint | None = None, pose: solver.Pose | None = None
) -> SeriesCheckpoint:
    return SeriesCheckpoint(tuple(map(LimitNumbers.of, plan.limits)), settlement, pose)


def _wanted(case: Case, increment: solver.Increment) -> bool:
    """Whether the capacity is asked for at an increment of the settlement."""
    last = len(case.settlements) - 1
    if case.capacity_at is None:
        return True
    reach = 2e-9 * case.settlements[last].increment
    return increment.phase == last and any(abs(increment.settlement - s) <= reach for s in case.capacity_at)


def _limit_state(
    case: Case,
    plan: Plan,
    loads: solver.Loads,
    pose: solver.Pose | None,
    at: solver.Increment | None,
    programs: int,
) -> solver.Increment:
    started = time.perf_counter()
    try:
        limit = solver.limit_load(
            plan.assembly,
            loads=loads,
            interfaces=plan.interfaces,
            pose=pose,
            flow=case.flow,
            displacement=_displacement(case, plan.assembly),
            overlap_tolerance=case.controls.overlap_tolerance,
        )
    except ValueError as error:
        raise ValueError(f"{case.source}: {error}") from None
    plan.limits.append(limit)
    state = limit.increment
    return replace(
        state,
        settlement=0.0 if at is None else at.settlement,
        phase=0 if at is None else at.phase,
        programs=state.programs + programs,
        seconds=time.perf_counter() - started + (0.0 if at is None else at.seconds),
    )


def _displacement(case: Case, assembly: solver.Assembly) -> float:
    """Within which joints that a settlement has opened may close [m]."""
    if not case.settlements:
        return 0.0
    return CLOSING * assembly.block_size if case.displacement is None else case.displacement


def _limit_ending(limit: solver.LimitLoad) -> solver.Ending:
    stops = {
        solver.LimitStatus.UNBOUNDED: solver.Status.LIMIT_REACHED,
        solver.LimitStatus.NO_EQUILIBRIUM: solver.Status.NO_INITIAL_EQUILIBRIUM,
        solver.LimitStatus.NOT_CONVERGED: solver.Status.SOLVER_FAILED,
    }
    return solver.Ending(stops.get(limit.status, solver.Status.COLLAPSED), str(limit))


def _swinging(assembly: solver.Assembly, state: solver.Increment) -> Iterator[solver.Increment]:
    """Pseudo-motion: the mechanism of a limit state, followed to first order, out of scale."""
    block, free = assembly.block_of_vertex, assembly.free
    corners = solver.moved_vertices(assembly, state.pose)
    velocity = solver.point_velocities(corners, block, state.pose, state.velocity)
    fastest = float(np.hypot(*velocity.T)[free[block]].max(initial=0.0))
    if fastest == 0.0:
        return
    reach = SWING * float(np.ptp(corners[free[block]], axis=0).max())
    contacts = state.contacts
    for part in np.linspace(0.0, 1.0, SWINGING_FRAMES + 1)[1:]:
        pose = solver.swung(state.pose, state.velocity * (part * reach / fastest))
        sides = [solver.carried(contacts.points, k, state.pose, pose) for k in (contacts.block_a, contacts.block_b)]
        yield replace(
            state,
            pose=pose,
            contacts=replace(contacts, points=(sides[0] + sides[1]) / 2.0),
            status=solver.Status.FALLING,
            programs=0,
            seconds=0.0,
            checkpoint=None,
        )
