"""The analyses that a case can ask for: each a stream of increments that is checked before anything is written."""

from __future__ import annotations

import time
from collections.abc import Callable, Generator, Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

import solver

from .case import Case, case_interfaces, case_loads
from .loading import moving_loads, nearest_name
from .marks import carried
from .mechanism import swung
from .series import POSITION
from .stored_increments import StoredLimit

__all__ = ["Plan", "parameter_of", "planned"]

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
        last = self.limits[-1]
        numbers = ("multiplier", "bounds", "status", "flow", "live_force", "programs")
        self.limits[-1] = StoredLimit.of(increment, **{name: getattr(last, name) for name in numbers})

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


def planned(case: Case, assembly: solver.Assembly, resume: solver.Checkpoint | None = None) -> Plan:
    """The analysis of a case, its input checked.

    Parameters
    ----------
    case : Case
    assembly : solver.Assembly
    resume : solver.Checkpoint, optional
        Where a settlement goes on from; limit loads and pushovers keep none and start again.

    Raises
    ------
    ValueError
        For input that cannot be analysed. Limit loads and pushovers solve their first increment for that.
    """
    interfaces, loads = case_interfaces(case), case_loads(case, assembly)
    if case.settlements:
        solver.check_settlement(assembly, case.settlements, case.controls)
    if case.analysis == "settlement":
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
        steps = _pushover(case, control, assembly, interfaces, loads)
        over: tuple[solver.Settlement, ...] = (control,)  # type: ignore[assignment]  # stands in for a settlement
        return Plan(case.analysis, assembly, interfaces, loads, over, _started(steps))
    places, live = moving_loads(case.loads, assembly, case.source)
    # A load that moves is kept where it is told about: at the first place until the lowest is known.
    plan = Plan(case.analysis, assembly, interfaces, loads, () if len(places) else case.settlements, iter(()))  # type: ignore[arg-type]
    plan.steps = _started(_limit_loads(case, plan, places, live))
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
            f"{case.source}: [control] block '{control.block}' {what}{nearest_name(control.block, free)}; name a free "
            f"block, for instance {', '.join(free[:6])}"
        )
    return control


def _settled(case: Case, assembly: solver.Assembly, interfaces: solver.Interfaces, loads: solver.Loads) -> Steps:
    """The settlements of a case, told under the dead load alone; nothing where there are none."""
    if not case.settlements:
        return solver.Ending(solver.Status.LIMIT_REACHED)
    return (
        yield from solver.settlement_increments(
            assembly, case.settlements, interfaces=interfaces, loads=loads, controls=case.controls
        )
    )


def _pushover(
    case: Case,
    control: solver.ControlDisplacement,
    assembly: solver.Assembly,
    interfaces: solver.Interfaces,
    loads: solver.Loads,
) -> Steps:
    pose, steps = None, _settled(case, assembly, interfaces, loads)
    while True:
        try:
            increment = next(steps)
        except StopIteration as stop:
            before: solver.Ending = stop.value
            break
        if increment.status == solver.Status.FALLING:
            yield replace(increment, settlement=0.0, phase=0)
        pose = increment.pose
    if before.stop is not solver.Status.LIMIT_REACHED:
        return _not_reached(before, "nothing is left to push over")
    try:
        return (
            yield from solver.pushover_increments(
                assembly, control, loads=loads, interfaces=interfaces, controls=case.controls, pose=pose
            )
        )
    except ValueError as error:
        raise ValueError(f"{case.source}: {error}") from None


def _not_reached(before: solver.Ending, what: str) -> solver.Ending:
    """How an analysis ends whose settlement did not reach its limit."""
    if before.stop is solver.Status.COLLAPSED:
        return solver.Ending(solver.Status.NO_INITIAL_EQUILIBRIUM, f"the settlement alone: {before.message}; {what}")
    return solver.Ending(before.stop, f"during the settlement: {before.message}")


def _limit_loads(case: Case, plan: Plan, places: np.ndarray, live: Callable[[int], np.ndarray]) -> Steps:
    """Limit states: at each wanted settlement, or at the end of the settlements for each place of a moving load."""
    assembly, standing = plan.assembly, plan.loads
    pose, steps = None, _settled(case, assembly, plan.interfaces, standing)
    # Of all states the one whose mechanism is shown: the lowest of several places, else the last.
    chosen, shown, least = 0, None, np.inf
    programs = 0
    while True:
        try:
            increment = next(steps)
        except StopIteration as stop:
            ending: solver.Ending = stop.value
            break
        programs += increment.programs
        pose = increment.pose
        if increment.status == solver.Status.FALLING:
            yield increment
        elif len(places) == 0 and _wanted(case, increment):
            # In equilibrium under the dead load: the settlement has proved it.
            state = _limit_state(case, plan, standing, pose, increment, programs)
            shown, programs = replace(state, status=solver.Status.EQUILIBRIUM), 0
            yield shown
    if ending.stop is not solver.Status.LIMIT_REACHED:
        if ending.stop is solver.Status.COLLAPSED and shown is not None:
            return replace(ending, message=f"the settlement alone brings it down: {ending.message}")
        return _not_reached(ending, "it carries no live load")
    if not case.settlements and len(places) == 0:
        shown = _limit_state(case, plan, standing, None, None, 0)
        yield shown
    for number, x in enumerate(places):
        loads = replace(standing, live=standing.live + live(number))
        state = replace(_limit_state(case, plan, loads, pose, None, programs), settlement=float(x))
        programs = 0
        multiplier = float(np.nan_to_num(state.load_multiplier, nan=-np.inf, posinf=np.inf))
        if shown is None or multiplier < least:
            chosen, shown, least = number, state, multiplier
        yield state
        if plan.limits[-1].status is solver.LimitStatus.NO_EQUILIBRIUM:
            break
    if len(places):
        plan.loads = replace(standing, live=standing.live + live(chosen))
    else:
        chosen = len(plan.limits) - 1
    assert shown is not None
    yield from _swinging(assembly, shown)
    return _limit_ending(plan.limits[chosen])


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
    arms = corners - state.pose.positions[block]
    velocity = state.velocity[block, :2] + state.velocity[block, 2:] * np.stack([-arms[:, 1], arms[:, 0]], axis=1)
    fastest = float(np.hypot(*velocity.T)[free[block]].max(initial=0.0))
    if fastest == 0.0:
        return
    reach = SWING * float(np.ptp(corners[free[block]], axis=0).max())
    contacts = state.contacts
    for part in np.linspace(0.0, 1.0, SWINGING_FRAMES + 1)[1:]:
        pose = swung(state.pose, state.velocity * (part * reach / fastest))
        sides = [carried(contacts.points, k, state.pose, pose) for k in (contacts.block_a, contacts.block_b)]
        yield replace(
            state,
            pose=pose,
            contacts=replace(contacts, points=(sides[0] + sides[1]) / 2.0),
            status=solver.Status.FALLING,
            programs=0,
            seconds=0.0,
        )
