"""Pushover: the load multiplier against a control displacement, with large displacements, to zero capacity."""

from __future__ import annotations

import time
from collections.abc import Callable, Generator, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from .analysis import Controls, Ending
from .assembly import Assembly
from .contact import InterfaceLaw, Interfaces
from .correction import GEOMETRY_TOLERANCE, Falls, NotConverged, at_rest, corrected, solve_again
from .kinematics import Pose, moved, rotation_matrices
from .limit import check_blocks, checked_live
from .loads import Loads
from .lp import SolveError
from .program import Locked, Model, Solved, point_velocities, solve_program
from .response import Collapse, Increment, Response, Status

__all__ = ["ControlDisplacement", "pushover", "pushover_increments"]

#: The mechanism has changed within an increment when velocities per control displacement differ by this much of their
#: size, weighted by mass, as in a settlement.
EVENT_CHANGE = 0.05

#: Largest movement of a block in a program that only reads the multiplier, in block sizes.
PROBE = 1e-6

#: The control point follows the mechanism where it moves by at least this fraction of the fastest block.
SMALLEST_SHARE = 1e-4

#: Steps by which the end of an increment is brought to the wanted control displacement, and the accuracy wanted, in
#: block sizes.
AIMS, AIM_TOLERANCE = 6, 1e-10


@dataclass(frozen=True)
class ControlDisplacement:
    """The displacement that is made to grow in a pushover analysis.

    Attributes
    ----------
    block : str
        Name of a free block.
    direction : (2,) sequence
        Direction in which the displacement counts; only its direction matters.
    point : (2,) sequence, optional [m]
        A point of the block, in the drawing; its centroid by default.
    increment : float [m]
        Largest step.
    limit : float [m]
        Where to stop if capacity is left.
    tolerance : float, optional [m]
        Width of the bracket of the displacement at zero capacity; a hundredth of the increment by default.
    """

    block: str
    direction: Sequence[float] = (1.0, 0.0)
    point: Sequence[float] | None = None
    increment: float = 0.01
    limit: float = 1.0
    tolerance: float | None = None

    def __post_init__(self) -> None:
        for name in ("direction", "point"):
            value = getattr(self, name)
            if value is None:
                continue
            pair = np.asarray(value, dtype=float)
            if pair.shape != (2,) or not np.isfinite(pair).all():
                raise ValueError(f"control {name} is {value!r}; give two finite numbers [x, y]")
            object.__setattr__(self, name, (float(pair[0]), float(pair[1])))
        length = float(np.hypot(self.direction[0], self.direction[1]))
        if length == 0.0:
            raise ValueError("control direction is [0, 0]; give the direction in which the displacement counts")
        object.__setattr__(self, "direction", (self.direction[0] / length, self.direction[1] / length))
        if self.tolerance is None:
            object.__setattr__(self, "tolerance", self.increment / 100.0)
        for name in ("increment", "limit", "tolerance"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value > 0.0):
                raise ValueError(f"control {name} is {value:g}; it must be a positive number")

    @property
    def unit(self) -> str:
        """Unit of the control displacement."""
        return "m"

    def taking_part(self, assembly: Assembly) -> np.ndarray:
        """(n_blocks,) bool array: the supports that move, as of a settlement: none."""
        return np.zeros(assembly.n_blocks, dtype=bool)

    def rate(self, assembly: Assembly, start: Pose, s: float) -> np.ndarray:
        """(n_blocks, 3) array: velocity of the supports, as of a settlement: they stand still."""
        return np.zeros((assembly.n_blocks, 3))

    def displacement(self, assembly: Assembly, pose: Pose) -> float:
        """Control displacement at a pose [m]."""
        block, arm = self._place(assembly)
        turned = rotation_matrices(pose.rotations[[block]])[0] @ arm
        moved_by = pose.positions[block] + turned - assembly.centroids[block] - arm
        return float(moved_by @ np.asarray(self.direction))

    def speed(self, assembly: Assembly, pose: Pose, velocity: np.ndarray) -> float:
        """Rate of the control displacement in a velocity (n_blocks, 3) of the blocks."""
        block, arm = self._place(assembly)
        point = pose.positions[[block]] + arm @ rotation_matrices(pose.rotations[[block]])[0].T
        return float((point_velocities(point, np.array([block]), pose, velocity) @ np.asarray(self.direction))[0])

    def _place(self, assembly: Assembly) -> tuple[int, np.ndarray]:
        block = assembly.index(self.block)
        arm = np.zeros(2) if self.point is None else np.asarray(self.point) - assembly.centroids[block]
        return block, arm


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
        Where to start, for instance after a settlement; the drawing by default.
    on_increment : callable, optional
        Called with every :class:`Increment` as it is found.

    Returns
    -------
    Response
        ``settlement`` is the control displacement [m], ``load_multiplier`` is α and ``reaction`` the resultant of the
        live loads, α times its value at 1 [N]. The collapse is where α reaches zero: beyond, the structure falls
        under its dead load alone. ``settlements`` holds the control displacement.

    Raises
    ------
    ValueError
        For input that cannot be analysed: no live load, a control block that is a support or that the mechanism does
        not move in the control direction, overlapping blocks.

    Notes
    -----
    A program per increment, at the current geometry, over the multipliers λ ≥ 0 of the friction cones' rays and α:

        minimise  Σ g_k N_k - w α   subject to  A λ + dead + α live = 0  for every free block

    whose dual is the kinematic program: minimise - dead · q with N(q) + g ≥ μ |T(q)| and live · q = w. The work w of the
    live load is chosen so that the control point moves by one step; the blocks then move exactly, gaps are closed and
    friction does not dilate, as in a settlement, and the motion is scaled until the control displacement is met. At zero
    gaps w only scales the mechanism, and the program is that of the limit load. The rigid structure does not move
    before the limit load, so that the curve starts at it.
    """
    interfaces = interfaces or Interfaces(InterfaceLaw(friction_coefficient))
    steps = pushover_increments(assembly, control, loads=loads, interfaces=interfaces, controls=controls, pose=pose)
    increments = []
    while True:
        try:
            increment = next(steps)
        except StopIteration as stop:
            ending: Ending = stop.value
            break
        increments.append(increment)
        if on_increment is not None:
            on_increment(increment)
    return Response(
        assembly=assembly,
        settlements=(control,),
        interfaces=interfaces,
        loads=loads,
        increments=tuple(increments),
        stop=ending.stop,
        message=ending.message,
        collapse=ending.collapse,
    )


def pushover_increments(
    assembly: Assembly,
    control: ControlDisplacement,
    *,
    loads: Loads,
    interfaces: Interfaces,
    controls: Controls | None = None,
    pose: Pose | None = None,
) -> Generator[Increment, None, Ending]:
    """The increment loop of :func:`pushover` as a generator: yields each Increment, returns the Ending."""
    controls = controls or Controls()
    check_blocks(assembly, controls.overlap_tolerance)
    loads = checked_live(assembly, loads)
    if not assembly.free[assembly.index(control.block)]:
        raise ValueError(f"control block '{control.block}' is a support; name a free block")
    steps = _increments(_model(assembly, control, interfaces, loads, controls), control, controls, pose)
    while True:
        started = time.perf_counter()
        try:
            increment = next(steps)
        except StopIteration as stop:
            ending: Ending = stop.value
            return ending
        yield replace(increment, seconds=time.perf_counter() - started)


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
    model: Model, control: ControlDisplacement, controls: Controls, start: Pose | None
) -> Generator[Increment, None, Ending]:
    still = replace(model, live=None)
    pose = Pose.initial(model.assembly) if start is None else start
    try:
        pose = at_rest(still, pose, controls.correctors)
    except Falls as fall:
        yield _increment(still, fall.solved, 0.0, 1.0, Status.FALLING)
        return Ending(Status.NO_INITIAL_EQUILIBRIUM, "no equilibrium under the dead load alone")
    except (SolveError, NotConverged) as error:
        return Ending(Status.SOLVER_FAILED, f"before any live load: {error}")
    return (yield from _Path(model, control, controls, pose).follow())


@dataclass(frozen=True)
class _Place:
    """An equilibrium on the path, how it was reached, and the multiplier there once it has been read."""

    d: float
    pose: Pose
    step: float = 0.0
    velocity: np.ndarray | None = None
    multiplier: float = np.nan
    proved: bool = False


class _Lost(Exception):
    """The control point does not move on with the mechanism."""


class _Path:
    """The equilibrium path. A place is told when it is left, and left only if it holds and was reached finely enough."""

    def __init__(self, model: Model, control: ControlDisplacement, controls: Controls, start: Pose) -> None:
        assert control.tolerance is not None
        self.model, self.control, self.controls, self.start = model, control, controls, start
        self.offset = control.displacement(model.assembly, start)
        self.here = _Place(0.0, start)
        self.before: _Place | None = None
        self.first_without = np.inf
        self.told = -np.inf
        self.finest = control.increment / max(controls.event_refinement, 1)
        self.tolerance = float(control.tolerance)
        self.work = 0.0

    def follow(self) -> Generator[Increment, None, Ending]:
        """Yields the increments, each when it is left behind; returns how the path ended."""
        control = self.control
        step = control.increment
        while True:
            here = self.here
            at_limit = here.d >= control.limit * (1.0 - 1e-12)
            step = self._shortened(step)
            try:
                predictor = self._predict(here, self.control.increment if at_limit else step)
                reading = self._read(predictor)
            except Locked:
                yield from self._tell_last()
                where = f"at a control displacement of {here.d:.6g} m" if self.before else "from the start"
                return Ending(Status.LOCKED, f"{where} no live load of this pattern moves the structure")
            except _Lost:
                if self.before is None:
                    raise ValueError(
                        f"the mechanism does not move block '{control.block}' along {control.direction}; "
                        "choose another control block, point or direction"
                    ) from None
                yield from self._tell_last()
                return Ending(
                    Status.SOLVER_FAILED, f"at {here.d:.6g} m the mechanism moves on without the control displacement"
                )
            except SolveError as error:
                yield from self._tell_last()
                return Ending(Status.SOLVER_FAILED, f"at a control displacement of {here.d:.6g} m: {error}")
            self.here = here = replace(here, multiplier=reading.multiplier)
            if reading.falling or here.multiplier <= 0.0:
                self.first_without = min(self.first_without, here.d)
                if self.before is None:
                    yield _increment(self.model, reading, 0.0, self._length(predictor), Status.EQUILIBRIUM)
                    return Ending(Status.NO_INITIAL_EQUILIBRIUM, "no live load of this pattern is carried")
                if self.first_without - self.before.d <= self.tolerance * (1.0 + 1e-9):
                    return (yield from self._collapse(here))
                step = self._toward_zero(self.before, here)
                self.here, self.before = self.before, None
                continue
            if self._mechanism_changed(predictor) and here.step > 0.0:
                if here.step > self.finest * (1.0 + 1e-9) and self.before is not None:
                    step = here.step / 2.0
                    self.here, self.before = self.before, None
                    continue
                if not here.proved:
                    if self._prove():
                        continue
                    step = here.step / 2.0
                    if self.before is None or step < self.tolerance / 64.0:
                        return Ending(Status.SOLVER_FAILED, f"no equilibrium found near {here.d:.6g} m")
                    self.here, self.before = self.before, None
                    continue
            if here.d > self.told:
                yield _increment(self.model, reading, here.d, self._length(reading), Status.EQUILIBRIUM)
                self.told = here.d
            if at_limit:
                return Ending(
                    Status.LIMIT_REACHED, f"the control displacement reached its limit of {control.limit:g} m"
                )
            try:
                pose = self._moved_on(predictor, here.d + step)
            except (Falls, NotConverged, SolveError) as error:
                if isinstance(error, Falls):
                    self.first_without = min(self.first_without, here.d + step)
                if isinstance(error, Falls) and step <= self.tolerance:
                    return (yield from self._collapse(replace(here, d=here.d + step, pose=error.solved.pose)))
                step /= 2.0
                if step < self.tolerance / 64.0:
                    return Ending(Status.SOLVER_FAILED, f"at a control displacement of {here.d:.6g} m: {error}")
                continue
            self.before = here
            reached = self._displacement(pose)
            self.here = _Place(reached, pose, step, predictor.motion / step)
            step = min(2.0 * step, control.increment)

    def _shortened(self, step: float) -> float:
        """The step, not past the limit nor to where capacity is known to be lost."""
        rest = self.first_without - self.here.d
        if np.isfinite(rest) and step >= rest:
            step = rest / 2.0
        return min(step, max(self.control.limit - self.here.d, self.tolerance))

    def _toward_zero(self, before: _Place, here: _Place) -> float:
        """Step from the place before to just short of where a straight line puts zero capacity, or just past it."""
        rest = here.d - before.d
        if not before.multiplier > 0.0 or here.multiplier > 0.0:
            return rest / 2.0
        expected = rest * before.multiplier / (before.multiplier - here.multiplier)
        aside = 0.4 * self.tolerance
        ahead = expected - aside if expected > 2.0 * aside else expected + aside
        return float(np.clip(ahead, 0.01 * rest, 0.99 * rest))

    def _predict(self, place: _Place, step: float) -> Solved:
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
                raise _Lost
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
        live, size = self.model.scaled_live
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
        """The exact pose at the wanted control displacement, by scaling the motion of the program."""
        part, low = 1.0, 0.0
        low_d = self.here.d
        for _ in range(AIMS):
            pose = corrected(self.model, _scaled(predictor, part), self.start, self.controls.correctors)
            reached = self._displacement(pose)
            if abs(reached - target) <= AIM_TOLERANCE * self.model.length or reached == low_d:
                break
            slope = (part - low) / (reached - low_d)
            low, low_d = part, reached
            part = float(np.clip(part + slope * (target - reached), 0.2 * part, 2.0 * part))
        return pose

    def _prove(self) -> bool:
        """Lets a place where the mechanism changed find its equilibrium with the live load's work held."""
        try:
            pose = at_rest(self.model, self.here.pose, self.controls.correctors)
        except (Falls, NotConverged, SolveError):
            return False
        d = self._displacement(pose)
        if self.before is not None and d <= self.before.d:
            return False
        self.here = replace(self.here, d=d, pose=pose, proved=True)
        return True

    def _mechanism_changed(self, predictor: Solved) -> bool:
        if self.here.velocity is None:
            return False
        size = np.sqrt(self.model.assembly.masses)[:, None] * np.array([1.0, 1.0, self.model.length])
        new = predictor.motion / max(self._speed(predictor), 1e-300) * size
        old = self.here.velocity * size
        return bool(np.linalg.norm(new - old) > EVENT_CHANGE * np.linalg.norm(old))

    def _displacement(self, pose: Pose) -> float:
        return self.control.displacement(self.model.assembly, pose) - self.offset

    def _speed(self, solved: Solved) -> float:
        return self.control.speed(self.model.assembly, solved.pose, solved.motion)

    def _length(self, solved: Solved) -> float:
        """Largest movement of a block in the motion [m]."""
        return max(float(np.abs(solved.motion * [1.0, 1.0, self.model.length]).max(initial=0.0)), 1e-300)

    def _tell_last(self) -> Iterator[Increment]:
        if self.here.d > self.told:
            self.told = self.here.d
            solved = solve_program(self.model, self.here.pose)
            yield _increment(self.model, solved, self.here.d, 1.0, Status.EQUILIBRIUM)

    def _collapse(self, lost: _Place) -> Generator[Increment, None, Ending]:
        last = self.before if self.before is not None and self.before.d < lost.d else self.here
        if last.d > self.told:
            reading = self._read(self._predict(last, self.tolerance))
            yield _increment(self.model, reading, last.d, self._length(reading), Status.EQUILIBRIUM)
        still = replace(self.model, live=None, trust=self.model.length / 10.0)
        falling = solve_program(still, lost.pose)
        size = self._length(falling)
        live = self.model.live
        assert live is not None
        collapse = Collapse(
            displacement=(last.d + self.first_without) / 2.0,
            bracket=(last.d, self.first_without),
            reaction=last.multiplier * float(np.hypot(*live[:, :2].sum(axis=0))),
            mechanism=falling.motion / size,
            unit="m",
        )
        what = "no capacity is left" if lost.multiplier <= 0.0 else "equilibrium is lost"
        for _ in range(self.controls.falling_frames):
            yield _increment(still, falling, lost.d, 1.0, Status.FALLING)
            if not falling.falling and self._length(falling) < 1e-3 * still.trust:
                break
            try:
                falling = solve_again(still, moved(falling.pose, falling.motion), falling)
            except SolveError:
                break
        return Ending(Status.COLLAPSED, f"{what} at a control displacement of {collapse.displacement:.6g} m", collapse)


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
    a, b = (point_velocities(contacts.points, k, solved.pose, velocity) for k in (contacts.block_a, contacts.block_b))
    resultant = 0.0 if model.live is None else float(np.hypot(*model.live[:, :2].sum(axis=0)))
    return Increment(
        settlement=d,
        phase=0,
        load_multiplier=solved.multiplier,
        pose=solved.pose,
        contacts=contacts,
        forces=solved.forces,
        displacements=np.einsum("kij,kj->ki", contacts.frames, a - b),
        friction=solved.friction,
        velocity=velocity,
        reaction=solved.multiplier * resultant,
        support_forces=solved.support_forces,
        certificate=solved.certificate,
        status=status,
        programs=model.tally.take(),
        seconds=0.0,
    )
