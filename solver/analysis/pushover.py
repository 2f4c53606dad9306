"""Pushover: the load multiplier against a control displacement, with large displacements, to zero capacity."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator
from dataclasses import replace

import numpy as np

from solver.assembly import Assembly, check_blocks
from solver.interfaces import InterfaceLaw, Interfaces
from solver.kinematics import (
    Pose,
    motion_size,
    moved,
    relative_velocities,
    unit_lengths,
)
from solver.loads import Loads
from solver.lp.problem import SolveError
from solver.program.closing import GEOMETRY_TOLERANCE
from solver.program.correction import Falls, NotConverged, at_rest, corrected, solve_again
from solver.program.increment import Locked, Solved, solve_program
from solver.program.model import Model
from solver.results.increment import Increment, State, Status
from solver.results.mechanism import mechanism_of
from solver.results.quantities import CONTROL_DISPLACEMENT, LOAD_MULTIPLIER
from solver.results.response import Collapse, Response

from .checkpoint import PushoverCheckpoint, PushoverPlace
from .controls import COULOMB, Controls, Ending
from .coulomb_path import pushover_path
from .drivers import ControlDisplacement
from .limit_load import checked_live
from .settlement import drained, timed

#: The mechanism has changed within an increment when its velocities, weighted by mass and taken as a unit vector,
#: differ by this much. With 0.05 the curve of a wall of 33 bricks that rocks depended on the increment by 0.2 %, with
#: this by 0.02 %.
EVENT_CHANGE = 0.02

#: Largest movement of a block in a program that only reads the multiplier, in block sizes.
PROBE = 1e-6

#: The control point follows the mechanism where it moves by at least this fraction of the fastest block.
SMALLEST_SHARE = 1e-4

#: Places in a row at which the control displacement may lie behind what it was before a jump.
LONGEST_RETREAT = 100

#: Steps by which the end of an increment is brought to the wanted control displacement, and the accuracy wanted, in
#: block sizes.
AIMS, AIM_TOLERANCE = 6, 1e-10


def pushover(
    assembly: Assembly,
    control: ControlDisplacement,
    *,
    loads: Loads,
    friction_coefficient: float = 0.6,
    interfaces: Interfaces | None = None,
    controls: Controls | None = None,
    pose: Pose | None = None,
    on_increment: Callable[[Increment], None] | None = None,
) -> Response:
    """Follows a structure under growing displacement from its limit load down to zero capacity.

    Parameters
    ----------
    assembly : Assembly
        Fixed and moving supports both stand still.
    control : ControlDisplacement
    loads : Loads
        Dead loads, and the live loads that the multiplier scales.
    friction_coefficient : float
        Of every interface, where ``interfaces`` is not given.
    interfaces : Interfaces, optional
    controls : Controls, optional
    pose : Pose, optional
        Where to start, for instance after a settlement; the drawing by default. Displacements count from there.
    on_increment : callable, optional
        Called with every :class:`Increment` as it is found.

    Returns
    -------
    Response
        ``settlement`` is the control displacement [m], ``load_multiplier`` is α and ``reaction`` the resultant of the
        live loads, α times its value at 1 [N]. The collapse is where α reaches zero: beyond, the structure falls
        under its dead load alone.

    Raises
    ------
    ValueError
        For input that cannot be analysed: no live load, a control block that is a support or that the mechanism does
        not move in the control direction, overlapping blocks.

    Notes
    -----
    A program per increment, at the current geometry, over the multipliers λ ≥ 0 of the friction cones' rays and α:

        minimise  Σ g_k N_k - w α   subject to  A λ + dead + α live = 0  for every free block

    whose dual is the kinematic program: minimise - dead · q with N(q) + g ≥ μ |T(q)| and live · q = w. The work w of
    the live load is chosen so that the control point moves by one step; the blocks then move exactly, gaps are closed
    and friction does not dilate, as in a settlement, and the motion is scaled until the control displacement is met
    (where closing takes programs, it comes out near the one wanted; what is reported is always measured).
    At zero gaps w only scales the mechanism, and the program is that of the limit load. The rigid structure does not
    move before the limit load, so that the curve starts at it.

    Where a hinge has to jump, the structure settles into its next equilibrium with the work of the live load held; the
    multiplier may drop there, and what the loads then do more than they gain goes into the jump. Where the control
    displacement recedes in it, the curve goes on when it has come back. Curves of structures that rock depend on the
    increment by parts of a thousand. Where joints slide, what a structure settles into after a jump is not unique, and
    the curve beyond may differ between increments: repeat it with a smaller one before relying on it.
    """
    interfaces = interfaces or Interfaces(InterfaceLaw(friction_coefficient))
    steps = pushover_increments(assembly, control, loads=loads, interfaces=interfaces, controls=controls, pose=pose)
    increments, ending = drained(steps, on_increment)
    return Response(
        assembly=assembly,
        settlements=(),
        interfaces=interfaces,
        loads=loads,
        increments=increments,
        stop=ending.stop,
        message=ending.message,
        collapse=ending.collapse,
        analysis="pushover",
        parameter=CONTROL_DISPLACEMENT,
        measured=LOAD_MULTIPLIER,
        control=control,
    )


def pushover_increments(
    assembly: Assembly,
    control: ControlDisplacement,
    *,
    loads: Loads,
    interfaces: Interfaces,
    controls: Controls | None = None,
    pose: Pose | None = None,
    resume: PushoverCheckpoint | None = None,
) -> Generator[Increment, None, Ending]:
    """The increment loop of :func:`pushover` as a generator: yields each Increment, returns the Ending.

    Parameters are those of :func:`pushover`.

    Parameters
    ----------
    resume : PushoverCheckpoint, optional
        Of an increment that such a loop has yielded, with the same other arguments: the increments after it follow, bit
        for bit as if the loop had not been interrupted. ``pose`` is not looked at then.
    """
    controls = controls or Controls()
    check_blocks(assembly, controls.overlap_tolerance)
    interfaces.refuse_strength("a pushover")
    loads = checked_live(assembly, loads)
    if not assembly.free[assembly.index(control.block)]:
        raise ValueError(f"control block '{control.block}' is a support; name a free block")
    if resume is not None and len(resume.here.pose.rotations) != assembly.n_blocks:
        raise ValueError(
            f"the checkpoint has {len(resume.here.pose.rotations)} blocks, the assembly {assembly.n_blocks}: it "
            "belongs to another run"
        )
    if controls.increments == COULOMB:
        if resume is not None:
            raise ValueError("increments = 'coulomb' cannot go on from a checkpoint; start the analysis again")
        return (yield from timed(pushover_path(assembly, control, loads, interfaces, controls, pose)))
    model = _model(assembly, control, interfaces, loads, controls)
    return (yield from timed(_increments(model, control, controls, pose, resume)))


def _model(
    assembly: Assembly, control: ControlDisplacement, interfaces: Interfaces, loads: Loads, controls: Controls
) -> Model:
    force = float(np.hypot(*loads.dead[assembly.free, :2].T).mean())
    if force == 0.0:
        raise ValueError("no dead load acts on any free block; give them a weight")
    length = assembly.block_size
    trust = max(length, 10.0 * control.increment) if controls.trust_region is None else controls.trust_region
    reach = max(min(4.0 * control.increment, length / 2.0), length / 4.0)
    return Model(assembly, interfaces, loads.dead, length, force, trust, reach, live=loads.live)


def _increments(
    model: Model,
    control: ControlDisplacement,
    controls: Controls,
    start: Pose | None,
    resume: PushoverCheckpoint | None,
) -> Generator[Increment, None, Ending]:
    if resume is not None:
        return (yield from _Path(model, control, controls, resume.start, resume).follow())
    still = replace(model, live=None)
    try:
        # Gaps and overlaps within the accuracy of the drawing are closed; a pose that is given stays as it is, since
        # without its live load it may not be in equilibrium.
        pose = at_rest(still, Pose.initial(model.assembly), controls.correctors) if start is None else start
    except Falls as fall:
        yield _increment(still, fall.solved, 0.0, 1.0, Status.FALLING)
        return Ending(Status.NO_INITIAL_EQUILIBRIUM, "no equilibrium under the dead load alone")
    except (Locked, SolveError, NotConverged) as error:
        return Ending(Status.SOLVER_FAILED, f"before any live load: {error}")
    return (yield from _Path(model, control, controls, pose).follow())


class _Lost(Exception):
    """The control displacement does not grow with the mechanism."""


class _Path:
    """The equilibrium path. A place is told when it is left, and left only if it was reached finely enough."""

    def __init__(
        self,
        model: Model,
        control: ControlDisplacement,
        controls: Controls,
        start: Pose,
        resume: PushoverCheckpoint | None = None,
    ) -> None:
        assert control.tolerance is not None
        self.model, self.control, self.controls, self.start = model, control, controls, start
        self.offset = control.displacement(model.assembly, start)
        self.here = PushoverPlace(0.0, start)
        self.before: PushoverPlace | None = None
        self.first_without = np.inf
        self.told = -np.inf
        self.silent = 0
        self.finest = control.increment / max(controls.event_refinement, 1)
        self.tolerance = float(control.tolerance)
        self.work = 0.0
        self.step = control.increment
        #: Told already: the program that is solved there again is not counted again.
        self.resumed = resume is not None
        if resume is not None:
            self.here, self.before, self.step = resume.here, resume.before, resume.step
            self.first_without, self.work, self.told = resume.first_without, resume.work, resume.here.d

    def follow(self) -> Generator[Increment, None, Ending]:
        """Yields the increments, each when it is left behind; returns how the path ended."""
        step = self.step
        while True:
            # What is told here has to be worked out again from this very state when it goes on from there.
            state = PushoverCheckpoint(self.start, self.here, self.before, step, self.first_without, self.work)
            at_limit = self.here.d >= self.control.limit * (1.0 - 1e-12)
            step = self.control.increment if at_limit else self._shortened(step)
            try:
                predictor = self._predict(self.here, step)
                reading = self._read(predictor)
                self.here = replace(self.here, multiplier=reading.multiplier)
                verdict, fall = self._judged(predictor, reading)
                if verdict == "leave":
                    if self.resumed:
                        self.model.tally.take()
                        self.resumed = False
                    if self.here.d > self.told:
                        left = _increment(self.model, reading, self.here.d, self._length(reading), Status.EQUILIBRIUM)
                        yield replace(left, checkpoint=state)
                        self.told, self.silent = self.here.d, 0
                    self.silent += 1
                    if self.silent > LONGEST_RETREAT:
                        raise _Lost
                    if at_limit:
                        message = f"the control displacement reached its limit of {self.control.limit:g} m"
                        return Ending(Status.LIMIT_REACHED, message)
                    self._go_on(predictor, step)
                    step = min(2.0 * step, self.control.increment)
                    continue
            except Falls as error:
                self.first_without = min(self.first_without, self.here.d + step)
                if step <= self.tolerance:
                    return (yield from self._collapse(self.here, self.here, error.solved))
                step /= 2.0
                continue
            except NotConverged as error:
                step /= 2.0
                if step < self.tolerance / 64.0:
                    return Ending(Status.SOLVER_FAILED, f"at a control displacement of {self.here.d:.6g} m: {error}")
                continue
            except (Locked, _Lost, SolveError) as error:
                ending = self._stopped(error)
                yield from self._tell_last()
                return ending
            if verdict == "stay":
                continue
            if verdict == "lost":
                if self.before is None and self.told < 0.0:
                    yield _increment(self.model, reading, 0.0, self._length(reading), Status.FALLING)
                    return Ending(Status.NO_INITIAL_EQUILIBRIUM, "no live load of this pattern is carried")
                if self.before is None:
                    # It held when it was reached, and fails only in a program that goes this far.
                    self.first_without = min(self.first_without, self.here.d + step)
                    if step <= self.tolerance:
                        return (yield from self._collapse(self.here, self.here, fall))
                    step /= 2.0
                    continue
                # What has settled after a jump may lie behind the place before it.
                reached = max(self.here.d, self.before.d + self.here.step)
                self.first_without = min(self.first_without, reached)
                if self.first_without - self.before.d <= self.tolerance * (1.0 + 1e-9):
                    return (yield from self._collapse(self.before, self.here, fall))
                step = self._toward_zero(self.before, self.here)
            else:
                step = self.here.step / 2.0
            assert self.before is not None
            self.here, self.before = self.before, None

    def _judged(self, predictor: Solved, reading: Solved) -> tuple[str, Solved | None]:
        """What to do at this place: "leave" it, "refine" the step to it, "stay" where it settled, or it is "lost".

        With a place that is lost for want of any equilibrium comes the program that says so.
        """
        here = self.here
        changed = here.step > 0.0 and not reading.falling and self._mechanism_changed(predictor)
        if changed and here.step > self.finest * (1.0 + 1e-9) and self.before is not None:
            return "refine", None
        if reading.falling:
            return "lost", reading
        if here.multiplier <= 0.0:
            return "lost", None
        if changed and not here.proved:
            try:
                self._prove()
            except Falls as fall:
                return "lost", fall.solved
            except NotConverged:
                if self.before is None:
                    raise
                return "refine", None
            return "stay", None
        return "leave", None

    def _stopped(self, error: Exception) -> Ending:
        where = f"at a control displacement of {self.here.d:.6g} m"
        if isinstance(error, Locked):
            return Ending(Status.LOCKED, f"{where} no live load of this pattern moves the structure")
        if isinstance(error, _Lost):
            if self.before is None and self.here.d == 0.0:
                raise ValueError(
                    f"the mechanism does not move block '{self.control.block}' along {self.control.direction}; "
                    "choose another control block, point or direction"
                ) from None
            return Ending(Status.SOLVER_FAILED, f"{where} the control displacement no longer grows; choose another")
        return Ending(Status.SOLVER_FAILED, f"{where}: {error}")

    def _go_on(self, predictor: Solved, step: float) -> None:
        pose = self._moved_on(predictor, self.here.d + step)
        self.before = self.here
        self.here = PushoverPlace(self._displacement(pose), pose, step, predictor.motion / step)

    def _shortened(self, step: float) -> float:
        """The step, not past the limit nor to where capacity is known to be lost."""
        rest = self.first_without - self.here.d
        if np.isfinite(rest) and step >= rest:
            step = rest / 2.0
        return min(step, max(self.control.limit - self.here.d, self.tolerance))

    def _toward_zero(self, before: PushoverPlace, here: PushoverPlace) -> float:
        """Step from the place before to just short of where a straight line puts zero capacity, or just past it."""
        rest = here.d - before.d
        if not before.multiplier > 0.0 or here.multiplier > 0.0:
            return rest / 2.0
        expected = rest * before.multiplier / (before.multiplier - here.multiplier)
        aside = 0.4 * self.tolerance
        ahead = expected - aside if expected > 2.0 * aside else expected + aside
        return float(np.clip(ahead, 0.01 * rest, 0.99 * rest))

    def _predict(self, place: PushoverPlace, step: float) -> Solved:
        """The program whose motion moves the control point by one step."""
        if self.work == 0.0:
            self.work = self._first_work()
        rate = self.work
        for _ in range(4):
            solved = solve_program(self.model, place.pose, work=rate * step)
            if solved.falling:
                return solved
            moves = self._speed(solved) / step
            if moves * step <= SMALLEST_SHARE * self._length(solved):
                return _scaled(solved, min(1.0, step / self._length(solved)))
            closes = ((solved.forces[:, 0] > 0.0) & (solved.contacts.gaps > self._exact)).any()
            rate /= moves
            if abs(moves - 1.0) < 1e-2 or not closes:
                break
        self.work = rate
        return _scaled(solved, 1.0 / moves)

    @property
    def _exact(self) -> float:
        return 100.0 * GEOMETRY_TOLERANCE * self.model.length

    def _first_work(self) -> float:
        """Work of the live load per control displacement in the first mechanism, from a program that barely moves."""
        _, size = self.model.scaled_live
        unit = size * self.model.force * self.model.length
        work = PROBE * unit
        solved = solve_program(self.model, self.here.pose, work=work)
        if solved.falling:
            return unit / self.model.length
        speed = self._speed(solved)
        if speed <= SMALLEST_SHARE * self._length(solved):
            raise _Lost
        return work / speed

    def _read(self, predictor: Solved) -> Solved:
        """The state at the place itself: that of the predictor, unless joints close on the way."""
        carrying = predictor.forces[:, 0] > 0.0
        if predictor.falling or not (carrying & (predictor.contacts.gaps > self._exact)).any():
            return predictor
        part = PROBE * self.model.length / self._length(predictor)
        live = self.model.live
        assert live is not None
        return solve_program(self.model, predictor.pose, work=part * float((live * predictor.motion).sum()))

    def _moved_on(self, predictor: Solved, target: float) -> Pose:
        """The exact pose at the wanted control displacement, by scaling the program's motion; near it in slides."""
        part, low = 1.0, 0.0
        low_d = self.here.d
        if self._speed(predictor) <= SMALLEST_SHARE * self._length(predictor):
            return corrected(self.model, predictor, self.start, self.controls.correctors)
        for _ in range(AIMS):
            programs = self.model.tally.programs
            pose = corrected(self.model, _scaled(predictor, part), self.start, self.controls.correctors)
            reached = self._displacement(pose)
            if abs(reached - target) <= AIM_TOLERANCE * self.model.length or reached == low_d:
                break
            if self.model.tally.programs > programs:
                # Closing what slid took programs: dear, and not smooth enough to aim with.
                break
            slope = (part - low) / (reached - low_d)
            low, low_d = part, reached
            part = float(np.clip(part + slope * (target - reached), 0.2 * part, 2.0 * part))
        return pose

    def _prove(self) -> None:
        """Lets a place where the mechanism changed find its equilibrium with the live load's work held."""
        pose = at_rest(self.model, self.here.pose, self.controls.correctors)
        self.here = replace(self.here, d=self._displacement(pose), pose=pose, proved=True)

    def _mechanism_changed(self, predictor: Solved) -> bool:
        if self.here.velocity is None:
            return False
        size = np.sqrt(self.model.assembly.masses)[:, None] * unit_lengths(3, self.model.length)
        new, old = predictor.motion * size, self.here.velocity * size
        new, old = new / (np.linalg.norm(new) or 1.0), old / (np.linalg.norm(old) or 1.0)
        return bool(np.linalg.norm(new - old) > EVENT_CHANGE)

    def _displacement(self, pose: Pose) -> float:
        return self.control.displacement(self.model.assembly, pose) - self.offset

    def _speed(self, solved: Solved) -> float:
        return self.control.speed(self.model.assembly, solved.pose, solved.motion)

    def _length(self, solved: Solved) -> float:
        """Largest movement of a block in the motion [m]."""
        return max(float(motion_size(solved.motion, self.model.length).max(initial=0.0)), 1e-300)

    def _tell_last(self) -> Iterator[Increment]:
        if self.here.d > self.told:
            self.told = self.here.d
            solved = solve_program(self.model, self.here.pose)
            yield _increment(self.model, solved, self.here.d, 1.0, Status.EQUILIBRIUM)

    def _collapse(
        self, last: PushoverPlace, lost: PushoverPlace, fall: Solved | None
    ) -> Generator[Increment, None, Ending]:
        """Tells the last equilibrium and the fall: with the live load's work held where no multiplier balances."""
        if last.d > self.told:
            reading = self._read(self._predict(last, self.tolerance))
            yield _increment(self.model, reading, last.d, self._length(reading), Status.EQUILIBRIUM)
        falling_model = replace(self.model, trust=self.model.length / 10.0)
        if fall is None:
            falling_model = replace(falling_model, live=None)
            fall = solve_program(falling_model, lost.pose)
        part = 0.5
        what = "equilibrium is lost"
        if lost.multiplier <= 0.0:
            part = last.multiplier / (last.multiplier - lost.multiplier)
            what = "no capacity is left"
        assert self.model.live is not None
        falls = _increment(falling_model, fall, self.first_without, 1.0, Status.FALLING)
        collapse = Collapse(
            displacement=last.d + part * (self.first_without - last.d),
            bracket=(last.d, self.first_without),
            reaction=last.multiplier * float(np.hypot(*self.model.live[:, :2].sum(axis=0))),
            mechanism=fall.motion / self._length(fall),
            unit="m",
            words=str(mechanism_of(self.model.assembly, falls)),
            lost="capacity",
        )
        yield from self._fall(falling_model, fall)
        return Ending(Status.COLLAPSED, f"{what} at a control displacement of {collapse.displacement:.6g} m", collapse)

    def _fall(self, model: Model, fall: Solved) -> Iterator[Increment]:
        """Pseudo-time frames: the blocks move downhill by a trust region at a time until they rest."""
        for _ in range(self.controls.falling_frames):
            fall = _scaled(fall, min(1.0, model.trust / self._length(fall)))
            yield _increment(model, fall, self.first_without, 1.0, Status.FALLING)
            try:
                fall = solve_again(model, moved(fall.pose, fall.motion), fall)
            except (SolveError, Locked):
                return
            if not fall.falling and self._length(fall) < 1e-3 * model.trust:
                return


def _scaled(solved: Solved, part: float) -> Solved:
    """The program's motion taken by a part or a multiple, its forces as they are."""
    return replace(
        solved,
        motion=solved.motion * part,
        opening=solved.opening * part,
        slip=solved.slip * part,
        sliding=solved.sliding * part,
    )


def _increment(model: Model, solved: Solved, d: float, step: float, status: Status) -> Increment:
    contacts, velocity = solved.contacts, solved.motion / step
    resultant = 0.0 if model.live is None else float(np.hypot(*model.live[:, :2].sum(axis=0)))
    return Increment(
        parameter=d,
        measured=solved.multiplier,
        phase=0,
        load_multiplier=solved.multiplier,
        reaction=solved.multiplier * resultant,
        certificate=solved.certificate,
        status=status,
        programs=model.tally.take(),
        seconds=0.0,
        held=State(
            pose=solved.pose,
            contacts=contacts,
            forces=solved.forces,
            displacements=relative_velocities(contacts, solved.pose, velocity),
            friction=solved.friction,
            velocity=velocity,
            support_forces=solved.support_forces,
        ),
    )
