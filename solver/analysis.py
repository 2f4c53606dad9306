"""The increment loop: settle() and what it is made of."""

from __future__ import annotations

import time
from collections.abc import Callable, Generator, Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import scipy.sparse as sp

from .assembly import Assembly
from .contact import Contacts, InterfaceLaw, Interfaces, find_contacts, measure_contacts
from .equilibrium import cone_rays, equilibrium_matrix
from .kinematics import Pose, moved, moved_vertices
from .loads import Loads, Settlement, checked_loads
from .lp import LinearProgram, LPSolution, SolveError, solve_lp
from .polygons import overlap_depths
from .response import Certificate, Collapse, Increment, Response, Status

__all__ = ["Controls", "Ending", "settle", "settlement_increments"]

#: A free block out of balance by less than this fraction of the total load is in balance. Without it the program
#: may move a block without friction sideways, for nothing, as far as it is allowed to.
BALANCE_TOLERANCE = 1e-9

#: A geometry is exact enough when contact points that carry force are closed, and those that stick have
#: not moved along the joint, to this fraction of the block size.
GEOMETRY_TOLERANCE = 1e-8

#: Unbalanced force that counts as falling, as a fraction of the total load: well above BALANCE_TOLERANCE and
#: what HiGHS leaves, and within the residual that a certificate promises.
FALLING_FRACTION = 5e-9


@dataclass(frozen=True)
class Controls:
    """How the increment loop proceeds; the defaults suit everything we have tried.

    Attributes
    ----------
    trust_region : float, optional [m]
        Largest movement of a block in one program; a fifth of the block size, or ten increments of translation.
    overlap_tolerance : float, optional [m]
        Overlap of two blocks in the drawing that is accepted; a thousandth of the width of the thinner block.
    correctors : int
        Largest number of corrections within an increment.
    falling_frames : int
        Frames of the fall after collapse.
    """

    trust_region: float | None = None
    overlap_tolerance: float | None = None
    correctors: int = 25
    falling_frames: int = 40


@dataclass(frozen=True)
class Ending:
    """How an increment loop ended: the value its generator returns."""

    stop: Status
    message: str = ""
    collapse: Collapse | None = None


@dataclass(frozen=True)
class _Model:
    """What stays the same over all increments."""

    assembly: Assembly
    interfaces: Interfaces
    load: np.ndarray
    length: float
    force: float
    trust: float
    reach: float

    @property
    def balance(self) -> float:
        """Unbalanced force that is accepted, in units of the program."""
        return BALANCE_TOLERANCE * float(np.abs(self.load[self.assembly.free, :2]).sum()) / self.force


@dataclass(frozen=True)
class _Solved:
    """One solved program at one geometry."""

    contacts: Contacts
    friction: np.ndarray
    forces: np.ndarray
    motion: np.ndarray
    slip: np.ndarray
    unbalanced: float
    certificate: Certificate
    pose: Pose
    support_forces: np.ndarray


class _NotConverged(Exception):
    """The corrections of an increment did not come to rest; a smaller increment may do."""


class _Falls(Exception):
    """No equilibrium at the geometry reached."""

    def __init__(self, solved: _Solved) -> None:
        super().__init__("no equilibrium")
        self.solved = solved


class _TooFar(_Falls):
    """Blocks move by the whole trust region before the supports have moved by the step."""


@dataclass
class _Counter:
    programs: int = 0
    started: float = field(default_factory=time.perf_counter)

    def restart(self) -> tuple[int, float]:
        now = time.perf_counter()
        counted = self.programs, now - self.started
        self.programs, self.started = 0, now
        return counted


def settle(
    assembly: Assembly,
    settlement: Settlement | Sequence[Settlement],
    *,
    friction_coefficient: float = 0.6,
    interfaces: Interfaces | None = None,
    loads: Loads | None = None,
    controls: Controls | None = None,
    on_increment: Callable[[Increment], None] | None = None,
) -> Response:
    """Follows a structure from its drawing through the settlement of its supports to collapse.

    Parameters
    ----------
    assembly : Assembly
        With at least one moving support.
    settlement : Settlement or sequence of Settlement
        One phase, or several one after another.
    friction_coefficient : float
        Of every interface, where ``interfaces`` is not given.
    interfaces : Interfaces, optional
        Laws per pair of materials.
    loads : Loads, optional
        Self-weight by default.
    controls : Controls, optional
    on_increment : callable, optional
        Called with every :class:`Increment` as it is found.

    Returns
    -------
    Response

    Raises
    ------
    ValueError
        For input that cannot be analysed: no moving support, overlapping blocks, loads of the wrong shape.

    Notes
    -----
    Portioli & Cascini, Engineering Structures 148 (2017) 485-496, https://doi.org/10.1016/j.engstruct.2017.06.073:
    rigid blocks, no-tension frictional contact points, gap functions, a linear program per increment, the geometry
    updated after each, until no equilibrium exists.
    """
    phases = (settlement,) if isinstance(settlement, Settlement) else tuple(settlement)
    interfaces = interfaces or Interfaces(InterfaceLaw(friction_coefficient))
    loads = checked_loads(assembly, loads)
    steps = settlement_increments(assembly, phases, interfaces=interfaces, loads=loads, controls=controls)
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
        settlements=phases,
        interfaces=interfaces,
        loads=loads,
        increments=tuple(increments),
        stop=ending.stop,
        message=ending.message,
        collapse=ending.collapse,
    )


def settlement_increments(
    assembly: Assembly,
    phases: Sequence[Settlement],
    *,
    interfaces: Interfaces,
    loads: Loads,
    controls: Controls | None = None,
) -> Generator[Increment, None, Ending]:
    """The increment loop of :func:`settle` as a generator: yields each Increment, returns the Ending.

    Parameters are those of :func:`settle`. Everything found so far has been yielded whenever it is interrupted.
    """
    controls = controls or Controls()
    _check_input(assembly, phases, controls)
    model = _model(assembly, phases, interfaces, loads, controls)
    counter = _Counter()
    pose = Pose.initial(assembly)
    try:
        pose = _at_rest(model, pose, controls, counter)
    except _Falls as fall:
        still = phases[0].rate(assembly, pose, 0.0) * 0.0
        yield _increment(model, fall.solved, still, 1.0, 0.0, 0, Status.FALLING, counter)
        return Ending(Status.NO_INITIAL_EQUILIBRIUM, _no_equilibrium_message(assembly, fall.solved))
    except (SolveError, _NotConverged) as error:
        return Ending(Status.SOLVER_FAILED, f"before any settlement: {error}")
    for number, phase in enumerate(phases):
        path = _Path(model, phase, number, pose, controls, counter)
        ending = yield from path.follow()
        if ending.stop is not Status.LIMIT_REACHED:
            return ending
        pose = path.pose
    return ending


class _Path:
    """The equilibrium path of one settlement phase."""

    def __init__(
        self, model: _Model, phase: Settlement, number: int, start: Pose, controls: Controls, counter: _Counter
    ) -> None:
        self.model, self.phase, self.number, self.controls, self.counter = model, phase, number, controls, counter
        self.start = self.pose = start
        self.s = 0.0
        # Step by which reactions are read off where the structure stands on the verge of collapse.
        self.probe = 1e-6 * model.length / _lever(model.assembly, phase, start)

    def follow(self) -> Generator[Increment, None, Ending]:
        phase, tolerance = self.phase, float(self.phase.tolerance or 0.0)
        step, first_without = phase.increment, np.inf
        previous: tuple[float, Pose] | None = None
        checked, told = False, -np.inf
        while True:
            if self.s >= phase.limit * (1.0 - 1e-12):
                yield self._reading()
                return Ending(Status.LIMIT_REACHED, f"the settlement reached its limit of {phase.limit:g} {phase.unit}")
            step = min(step, phase.limit - self.s)
            if np.isfinite(first_without):
                rest = first_without - self.s
                step = rest if rest <= tolerance else min(step, rest / 2.0)
            try:
                solved, pose = self._advance(step)
                if np.isfinite(first_without):
                    self._verify(self.s + step, pose)
            except _TooFar as far:
                if not checked:
                    checked = True
                    try:
                        self._verify(self.s, self.pose)
                    except _Falls as fall:
                        if previous is None:
                            return (yield from self._never_stood(fall.solved))
                        # The last correction ended beyond the last equilibrium; only now has it been noticed.
                        first_without, (self.s, self.pose) = self.s, previous
                        step = (first_without - self.s) / 2.0
                        continue
                if step <= tolerance:
                    return (yield from self._collapse(self.s + step, far.solved, told))
                step /= 2.0
                continue
            except _Falls as fall:
                first_without = min(first_without, self.s + step)
                if first_without - self.s <= tolerance * (1.0 + 1e-9):
                    return (yield from self._collapse(first_without, fall.solved, told))
                step /= 2.0
                continue
            except (_NotConverged, SolveError) as error:
                step /= 2.0
                if step < tolerance / 64.0:
                    yield self._reading()
                    return Ending(Status.SOLVER_FAILED, f"at a settlement of {self.s:.6g} {phase.unit}: {error}")
                continue
            if self.s + step >= first_without:
                first_without = np.inf
            if self.s > told:
                yield self._increment(solved, step)
                told = self.s
            previous, checked = (self.s, self.pose), np.isfinite(first_without)
            self.s, self.pose = self.s + step, pose
            step = min(2.0 * step, phase.increment)

    def _advance(self, step: float) -> tuple[_Solved, Pose]:
        """Predictor and correctors of one increment: the solved predictor and the pose at s + step."""
        model, counter = self.model, self.counter
        rate = self.phase.rate(model.assembly, self.start, self.s)
        predictor = _solve(model, self.pose, rate * step, counter)
        if predictor.unbalanced > 0.0:
            raise _TooFar(predictor)
        target = self.phase.displaced(model.assembly, self.start, self.s + step)
        return predictor, _corrected(model, self.pose, predictor, target, self.controls, counter)

    def _verify(self, s: float, pose: Pose) -> None:
        """Raises ``_Falls`` where the pose is not in equilibrium: the corrections stop one program short of knowing."""
        rate = self.phase.rate(self.model.assembly, self.start, s)
        solved = _solve(self.model, pose, rate * self.probe, self.counter)
        if solved.unbalanced > 0.0:
            raise _Falls(solved)

    def _never_stood(self, falling: _Solved) -> Generator[Increment, None, Ending]:
        yield self._increment(falling, self.probe)
        return Ending(Status.NO_INITIAL_EQUILIBRIUM, _no_equilibrium_message(self.model.assembly, falling))

    def _reading(self) -> Increment:
        """The increment at the last equilibrium, its reaction read off by a very small step."""
        rate = self.phase.rate(self.model.assembly, self.start, self.s)
        solved = _solve(self.model, self.pose, rate * self.probe, self.counter)
        return self._increment(solved, self.probe)

    def _increment(self, solved: _Solved, step: float) -> Increment:
        rate = self.phase.rate(self.model.assembly, self.start, self.s)
        return _increment(self.model, solved, rate, step, self.s, self.number, Status.EQUILIBRIUM, self.counter)

    def _collapse(self, first_without: float, falling: _Solved, told: float) -> Generator[Increment, None, Ending]:
        last = self._reading()
        if self.s > told:
            yield last
        size = np.abs(falling.motion * [1.0, 1.0, self.model.length]).max()
        collapse = Collapse(
            displacement=(self.s + first_without) / 2.0,
            bracket=(self.s, first_without),
            reaction=last.reaction,
            mechanism=falling.motion / size,
            unit=self.phase.unit,
        )
        yield from self._fall(first_without, falling)
        return Ending(Status.COLLAPSED, str(collapse), collapse)

    def _fall(self, s: float, solved: _Solved) -> Iterator[Increment]:
        """Pseudo-time frames: the blocks move downhill by a trust region at a time until they rest."""
        model = replace(self.model, trust=self.model.length / 10.0)
        still = np.zeros((model.assembly.n_blocks, 3))
        for _ in range(self.controls.falling_frames):
            pose = moved(solved.pose, _limited(model, solved.motion))
            try:
                solved = _solve(model, pose, still, self.counter)
            except SolveError:
                return
            yield _increment(model, solved, still, 1.0, s, self.number, Status.FALLING, self.counter)
            if solved.unbalanced == 0.0 and np.abs(solved.motion).max() < 1e-4 * model.trust:
                return


def _limited(model: _Model, motion: np.ndarray) -> np.ndarray:
    """The motion scaled down to the trust region."""
    size = np.abs(motion * [1.0, 1.0, model.length]).max(initial=0.0)
    return motion * min(1.0, model.trust / size) if size > 0 else motion


def _check_input(assembly: Assembly, phases: Sequence[Settlement], controls: Controls) -> None:
    if not phases:
        raise ValueError("no settlement was given; give one Settlement, or several phases")
    if not assembly.free.any():
        raise ValueError(f"all {assembly.n_blocks} blocks are supports; at least one must be free")
    for number, phase in enumerate(phases):
        if not phase.taking_part(assembly).any():
            which = f"settlement phase {number + 1}" if len(phases) > 1 else "the settlement"
            raise ValueError(f"{which} moves no support: give at least one block the role 'moving'")
    widths = 2.0 * assembly.areas / np.add.reduceat(assembly.edge_lengths, assembly.offsets[:-1])
    tolerance = 1e-3 * float(widths.min()) if controls.overlap_tolerance is None else controls.overlap_tolerance
    i, j, depth = overlap_depths(assembly.vertices, assembly.offsets, tolerance)
    real = assembly.free[i] | assembly.free[j]
    if real.any():
        k = int(np.flatnonzero(real)[np.argmax(depth[real])])
        a, b = int(i[k]), int(j[k])
        more = f" ({int(real.sum()) - 1} more pairs overlap)" if real.sum() > 1 else ""
        raise ValueError(
            f"block {a} ('{assembly.names[a]}') overlaps block {b} ('{assembly.names[b]}') by {depth[k]:.3g} m{more}; "
            f"move them apart or raise overlap_tolerance ({tolerance:.3g} m)"
        )


def _lever(assembly: Assembly, phase: Settlement, start: Pose) -> float:
    """Largest displacement of a moving support per unit of s: 1 for a translation, a radius for a rotation."""
    rate = phase.rate(assembly, start, 0.0)
    vertices = moved_vertices(assembly, start)
    block = assembly.block_of_vertex
    arm = vertices - start.positions[block]
    velocity = rate[block, :2] + rate[block, 2:] * np.stack([-arm[:, 1], arm[:, 0]], axis=1)
    return float(np.hypot(*velocity.T).max())


def _model(
    assembly: Assembly, phases: Sequence[Settlement], interfaces: Interfaces, loads: Loads, controls: Controls
) -> _Model:
    load = loads.total()
    length = assembly.block_size
    magnitude = np.hypot(*load[assembly.free, :2].T)
    force = float(magnitude.mean())
    if force == 0.0:
        raise ValueError("no load acts on any free block; give them a weight")
    start = Pose.initial(assembly)
    movement = max(phase.increment * _lever(assembly, phase, start) for phase in phases)
    trust = max(length / 5.0, 10.0 * movement) if controls.trust_region is None else controls.trust_region
    reach = min(max(4.0 * movement, 0.02 * length), length / 2.0)
    return _Model(assembly, interfaces, load, length, force, trust, reach)


def _at_rest(model: _Model, pose: Pose, controls: Controls, counter: _Counter) -> Pose:
    """The pose in which the drawn blocks rest: gaps and overlaps within the drawing's accuracy closed."""
    solved = _solve(model, pose, np.zeros((model.assembly.n_blocks, 3)), counter)
    if solved.unbalanced > 0.0:
        raise _Falls(solved)
    return _corrected(model, pose, solved, pose, controls, counter)


def _corrected(
    model: _Model, before: Pose, predictor: _Solved, supports: Pose, controls: Controls, counter: _Counter
) -> Pose:
    """Moves the blocks exactly and solves again with the supports at rest until the geometry is exact.

    Slip that the programs did not ask for (the second-order effect of finite rotations) is taken back together
    with the gaps: contacts that stick return to where they stuck.
    """
    assembly = model.assembly
    free = assembly.free
    solved, pose = predictor, before
    tolerance = GEOMETRY_TOLERANCE * model.length
    origin, asked = _Memory(assembly, predictor.contacts), _Memory(assembly, predictor.contacts, predictor.slip)
    still = np.zeros((assembly.n_blocks, 3))
    largest = np.inf
    for attempt in range(controls.correctors + 1):
        pose = moved(pose, np.where(free[:, None], solved.motion, 0.0))
        if attempt == 0:
            pose = Pose(
                np.where(free[:, None], pose.positions, supports.positions),
                np.where(free, pose.rotations, supports.rotations),
            )
        vertices = moved_vertices(assembly, pose)
        contacts = _with_carrying(assembly, find_contacts(assembly, vertices, model.reach), vertices, solved)
        origin.add(contacts)
        asked.add(contacts, None)
        drift = contacts.along - origin.values(contacts) - asked.values(contacts)
        error = _geometry_error(contacts, solved, drift, assembly)
        if error <= tolerance:
            return pose
        largest = error
        solved = _solve(model, pose, still, counter, contacts, drift)
        if solved.unbalanced > 0.0:
            raise _Falls(solved)
        asked.increase(solved.contacts, solved.slip + drift)
    raise _NotConverged(
        f"after {controls.correctors} corrections a contact point is still off by {largest:.3g} m "
        f"(accepted: {tolerance:.3g} m)"
    )


class _Memory:
    """Values of contact points by their key, over the corrections of one increment."""

    def __init__(self, assembly: Assembly, contacts: Contacts, values: np.ndarray | None = None) -> None:
        self._assembly = assembly
        self._keys = contacts.keys(assembly)
        self._values = (contacts.along if values is None else values).copy()
        self._sort()

    def _sort(self) -> None:
        order = np.argsort(self._keys, kind="stable")
        self._keys, self._values = self._keys[order], self._values[order]

    def _places(self, contacts: Contacts) -> tuple[np.ndarray, np.ndarray]:
        keys = contacts.keys(self._assembly)
        place = np.searchsorted(self._keys, keys)
        place = np.minimum(place, max(len(self._keys) - 1, 0))
        known = self._keys[place] == keys if len(self._keys) else np.zeros(len(keys), dtype=bool)
        return place, known

    def add(self, contacts: Contacts, values: np.ndarray | None = ...) -> None:  # type: ignore[assignment]
        """Remembers contacts not seen before: where they are now, or zero."""
        _, known = self._places(contacts)
        new = ~known
        if new.any():
            added = np.zeros(int(new.sum())) if values is None else contacts.along[new]
            self._keys = np.concatenate([self._keys, contacts.keys(self._assembly)[new]])
            self._values = np.concatenate([self._values, added])
            self._sort()

    def values(self, contacts: Contacts) -> np.ndarray:
        return self._values[self._places(contacts)[0]]

    def increase(self, contacts: Contacts, values: np.ndarray) -> None:
        self._values[self._places(contacts)[0]] += values


def _with_carrying(assembly: Assembly, found: Contacts, vertices: np.ndarray, solved: _Solved) -> Contacts:
    """The contacts found, and those that carried force a moment ago, wherever on their edge's line they are now."""
    carrying = solved.forces[:, 0] > 0.0
    missing = carrying & ~np.isin(solved.contacts.keys(assembly), found.keys(assembly))
    if not missing.any():
        return found
    both = [
        np.concatenate([getattr(found, name), getattr(solved.contacts, name)[missing]])
        for name in ("vertex", "edge", "corner")
    ]
    return measure_contacts(assembly, vertices, *both)


def _geometry_error(contacts: Contacts, solved: _Solved, drift: np.ndarray, assembly: Assembly) -> float:
    """Deepest penetration, or largest gap or unasked slip at a contact point that carries force [m]."""
    error = float(np.maximum(-contacts.gaps, 0.0).max(initial=0.0))
    carrying = solved.forces[:, 0] > 1e-6 * solved.forces[:, 0].max(initial=0.0)
    now = np.isin(contacts.keys(assembly), solved.contacts.keys(assembly)[carrying])
    error = max(error, float(np.abs(contacts.gaps[now]).max(initial=0.0)))
    return max(error, float(np.abs(drift[now]).max(initial=0.0)))


def _solve(
    model: _Model,
    pose: Pose,
    support_motion: np.ndarray,
    counter: _Counter,
    contacts: Contacts | None = None,
    drift: np.ndarray | None = None,
) -> _Solved:
    """States and solves the static program of one increment.

    Notes
    -----
    Over the multipliers λ ≥ 0 of the rays n ∓ μ t of the friction cones and unbalanced forces r⁺, r⁻ ≥ 0:

        minimise  Σ (g_k n + relative support motion + drift) · ray λ  +  ρ (r⁺ + r⁻)
        subject to  |A λ + r⁺ - r⁻ + f| ≤ ε        for every free block

    which is the dual of the kinematic program with all movements bounded by the trust region ρ, so that it is
    always feasible: unbalanced force at the optimum means that blocks move by the whole trust region.
    """
    assembly = model.assembly
    if contacts is None:
        contacts = find_contacts(assembly, moved_vertices(assembly, pose), model.reach)
    counter.programs += 1
    n = len(contacts)
    friction = model.interfaces.friction(assembly, contacts.block_a, contacts.block_b)
    matrix = equilibrium_matrix(contacts, pose, model.length)
    scale = np.array([model.length, model.length, 1.0])
    free_rows = np.repeat(assembly.free, 3)
    distance = matrix.T @ (support_motion / scale).ravel()
    distance[0::2] += contacts.gaps / model.length
    if drift is not None:
        distance[1::2] += drift / model.length
    rays = cone_rays(friction)
    balance = sp.csc_array(sp.csr_array(matrix)[free_rows] @ rays)
    rows = balance.shape[0]
    identity = sp.identity(rows, format="csc")
    trust = model.trust / model.length
    external = (model.load / model.force / np.array([1.0, 1.0, model.length]))[assembly.free].ravel()
    program = LinearProgram(
        cost=np.concatenate([rays.T @ distance, np.full(2 * rows, trust)]),
        matrix=sp.csc_array(sp.hstack([balance, identity, -identity], format="csc")),
        lower=-external - model.balance,
        upper=-external + model.balance,
    )
    solution = solve_lp(program)
    return _interpret(model, pose, support_motion, contacts, friction, matrix, rays, distance, program, solution)


def _interpret(
    model: _Model,
    pose: Pose,
    support_motion: np.ndarray,
    contacts: Contacts,
    friction: np.ndarray,
    matrix: sp.csc_array,
    rays: sp.csc_array,
    distance: np.ndarray,
    program: LinearProgram,
    solution: LPSolution,
) -> _Solved:
    """Forces, motion and certificate of a solved program, back in m and N."""
    assembly = model.assembly
    columns = rays.shape[1]
    multipliers = solution.x[:columns]
    scaled_forces = rays @ multipliers
    unbalanced = float(solution.x[columns:].max(initial=0.0))
    total = max(float(np.abs(model.load[assembly.free, :2]).sum()) / model.force, 1e-300)
    motion = support_motion.copy()
    scale = np.array([model.length, model.length, 1.0])
    motion[assembly.free] = -solution.row_dual.reshape(-1, 3) * scale
    relative = matrix.T @ (motion / scale).ravel()
    resultant = (matrix @ scaled_forces).reshape(-1, 3)
    out_of_balance = resultant + model.load / model.force / np.array([1.0, 1.0, model.length])
    moved_by = (matrix.T @ (np.where(assembly.free[:, None], motion, 0.0) / scale).ravel()) + distance
    room = rays.T @ moved_by
    certificate = Certificate(
        equilibrium_residual=float(np.abs(out_of_balance[assembly.free]).max(initial=0.0)) / total,
        largest_penetration=float(np.maximum(-contacts.gaps, 0.0).max(initial=0.0)),
        duality_gap=solution.gap,
        complementarity=float(np.abs(multipliers @ room)) / (1.0 + abs(solution.objective)),
        kinematic_violation=float(np.maximum(-room, 0.0).max(initial=0.0)),
    )
    support_forces = np.where(assembly.free[:, None], 0.0, resultant) * model.force * np.array([1, 1, model.length])
    return _Solved(
        contacts=contacts,
        friction=friction,
        forces=scaled_forces.reshape(-1, 2) * model.force,
        motion=motion,
        slip=relative[1::2] * model.length,
        unbalanced=unbalanced if unbalanced > FALLING_FRACTION * total else 0.0,
        certificate=certificate,
        pose=pose,
        support_forces=support_forces,
    )


def _increment(
    model: _Model,
    solved: _Solved,
    rate: np.ndarray,
    step: float,
    s: float,
    phase: int,
    status: Status,
    counter: _Counter,
) -> Increment:
    programs, seconds = counter.restart()
    velocity = solved.motion / step
    arms = (
        solved.contacts.points - solved.pose.positions[b] for b in (solved.contacts.block_a, solved.contacts.block_b)
    )
    moving = [
        velocity[b, :2] + velocity[b, 2:] * np.stack([-arm[:, 1], arm[:, 0]], axis=1)
        for b, arm in zip((solved.contacts.block_a, solved.contacts.block_b), arms, strict=True)
    ]
    return Increment(
        settlement=s,
        phase=phase,
        load_multiplier=0.0,
        pose=solved.pose,
        contacts=solved.contacts,
        forces=solved.forces,
        displacements=np.einsum("kij,kj->ki", solved.contacts.frames, moving[0] - moving[1]),
        friction=solved.friction,
        velocity=velocity,
        reaction=float((solved.support_forces * rate).sum()),
        support_forces=solved.support_forces,
        certificate=solved.certificate,
        status=status,
        programs=programs,
        seconds=seconds,
    )


def _no_equilibrium_message(assembly: Assembly, solved: _Solved) -> str:
    size = np.abs(solved.motion[:, :2]).max(axis=1)
    falling = np.flatnonzero(assembly.free & (size > 0.5 * size.max()))
    shown = ", ".join(f"'{assembly.names[i]}'" for i in falling[:8])
    more = f" and {len(falling) - 8} more" if len(falling) > 8 else ""
    return (
        f"no equilibrium before any settlement: {len(falling)} of {int(assembly.free.sum())} blocks fall ({shown}{more}); "
        "look for gaps between blocks (joint_thickness), a missing support or too little friction"
    )
