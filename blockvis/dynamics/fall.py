"""The fall after the last equilibrium, by rigid-body dynamics.

Statics ends with the collapse mechanism. What follows is dynamics without restitution, of the same blocks, masses and
friction; it says nothing about the settlement at collapse and nothing of the static path depends on it.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

import solver
from solver import mechanics

from .engine import Engine
from .ground import ground_below, on_ground

#: What films, files and pages call it.
CAPTION = "fall: rigid-body dynamics, restitution 0"

#: Poses kept per second, and where the fall is cut off, in the time in which the topmost corner falls to the ground.
RATE, LONGEST = 25, 10.0

#: Blocks whose √(size / g) is shorter than this part of a pose, of less than 2 μm, have fallen before the first.
BRIEFEST = 0.01

#: The first push: speed of the fastest block, in sqrt(g × block size). Where everything stands after it, it is doubled,
#: up to so many times.
PUSH, DOUBLINGS = 0.05, 5

#: Blocks rest that are slower than this, in sqrt(g × block size), for this time [s].
STILL, RESTING = 4e-3, 0.2

#: Blocks have fallen of which a corner has moved by more than this part of the block size; and what is said of none.
FALLEN = 0.25
STANDS = f"after the collapse no corner moves by more than {FALLEN:g} of a block before all rest"
#: What is said of what falls as the first settlement begins, as something is taken away.
NEVER_STOOD = "a fall in time begins at an equilibrium, and none is told: before the removal put a settlement of 1e-6 m"

#: So much of the mass that the mechanism takes has to have fallen: by a small push a dome jams again.
MOST = 0.5


@dataclass(frozen=True)
class Fall:
    """A fall in time."""

    times: np.ndarray  #: (n,) array [s]: since the last equilibrium.
    positions: np.ndarray  #: (n, n_blocks, d) array [m].
    rotations: np.ndarray  #: (n, n_blocks, n_rot) array [rad].
    ground: float  #: [m] Height of the ground line.
    #: (n, n_ties) array [N]: of ties, props and bars, tension positive.
    tie_forces: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))
    #: (n, n_ties) array [m]: their lengths without force; nan for those that are absent or broken.
    tie_rest: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))

    def __len__(self) -> int:
        """Count the poses."""
        return len(self.times)

    def pose(self, number: int) -> solver.Pose:
        """Return one of the poses."""
        return solver.Pose(self.positions[number], self.rotations[number])

    def at(self, time: float) -> solver.Pose:
        """Return the pose at a time [s], in between those kept."""
        k = self._before(time)
        if k == len(self) - 1:
            return self.pose(k)
        t = (time - self.times[k]) / (self.times[k + 1] - self.times[k])
        before, after = self.pose(k), self.pose(k + 1)
        turn = before.movement_to(after)
        turn[:, : before.positions.shape[1]] = 0.0
        places = before.positions + t * (after.positions - before.positions)
        return solver.Pose(places, mechanics.moved(before, t * turn).rotations)

    def ties_at(self, time: float, response: solver.Response) -> mechanics.TieForces:
        """Return what ties, props and bars of its response do at a time [s], as at the pose that is kept before it."""
        ties, last = response.ties, response.path[-1].ties
        if not self.tie_rest.size:
            return mechanics.TieForces()
        k = self._before(time)
        forces, rest = self.tie_forces[k], self.tie_rest[k]
        ends = mechanics.tie_ends(ties, response.assembly, self.at(time))
        strength = np.array([tie.strength for tie in ties])
        states = mechanics.member_states(np.abs(forces), strength, response.total_weight)
        states = np.where(np.isnan(rest), mechanics.BROKEN, states)
        states = np.where(last.states == mechanics.ABSENT, mechanics.ABSENT, states)
        stretched = mechanics.tie_lengths(ends) - (mechanics.tie_lengths(last.ends) - last.elongations)
        return mechanics.TieForces(forces, stretched, rest, states, ends)

    def _before(self, time: float) -> int:
        """Return the number of the last pose that is kept until a time [s]."""
        return max(int(np.searchsorted(self.times, time, side="right")) - 1, 0)


def fall_of(
    response: solver.Response,
    progress: Callable[[float, float], None] | None = None,
    watch: Callable[[Engine], None] | None = None,
) -> Fall | None:
    """Let a collapsed structure fall from its last equilibrium until all blocks rest, or for :data:`LONGEST`.

    Parameters
    ----------
    progress : callable, optional
        Called with the seconds [s] of the fall that are worked out, and those after which it is cut off.
    watch : callable, optional
        Called with the engine at the start and at each pose that is kept, anew for each push that is tried.

    Returns
    -------
    Fall or None
        None where nothing collapses along a path (limit loads, "limit reached"), and where nothing falls.
    """
    if not may_fall(response):
        return None
    assembly = response.assembly
    push = PUSH * np.sqrt(solver.GRAVITY * assembly.block_size)
    enough = MOST * _falling_mass(response)
    best, most = None, 0.0
    for _ in range(DOUBLINGS + 1):
        fall = _followed(response, push, progress, watch)
        start, end = (mechanics.moved_vertices(assembly, fall.pose(number)) for number in (0, -1))
        far = np.linalg.norm(end - start, axis=1) > FALLEN * assembly.block_size
        fallen = np.logical_or.reduceat(far, assembly.shapes.offsets[:-1])
        # What was lost before falls in any case.
        mass = float(assembly.masses[fallen & ~response.path[-1].fallen].sum())
        # No more falls by a larger push: the mechanism takes blocks with it that come to rest.
        if best is not None and mass <= most:
            break
        if mass > most:
            best, most = fall, mass
        if most > enough:
            break
        push *= 2.0
    return best


def still_moving(assembly: solver.Assembly, fall: Fall) -> np.ndarray:
    """Numbers of the blocks that move at the end of a fall, which is cut off there, (n,) array."""
    before, end = (mechanics.moved_vertices(assembly, fall.pose(k)) for k in (max(len(fall) - 2, 0), -1))
    speeds = np.maximum.reduceat(np.linalg.norm(end - before, axis=1), assembly.shapes.offsets[:-1]) * RATE
    return np.flatnonzero(speeds > STILL * np.sqrt(solver.GRAVITY * assembly.block_size))


def may_fall(response: solver.Response) -> bool:
    """Whether a structure has collapsed along a path, so that its fall can be followed."""
    collapse = response.collapse
    if np.sqrt(response.assembly.block_size / solver.GRAVITY) < BRIEFEST / RATE:
        return False
    collapsed = response.stop == solver.Status.COLLAPSED and response.parameter.is_path and not response.limits
    return collapsed and collapse is not None and bool(response.path) and bool(collapse.mechanism.any())


def falls_from(response: solver.Response) -> solver.Increment | None:
    """Give the increment at which the collapse mechanism begins, as the response has it; None where nothing stood.

    It is the last equilibrium, and where a phase begins with the fall its first frame.
    """
    last, falls = response.path[-1:], [i for i in response.increments if i.status == solver.Status.FALLING][:1]
    at_once = response.collapse is not None and response.collapse.reaction is None
    return next(iter((*falls, *last) if at_once else (*last, *falls)), None)


def with_mechanism(response: solver.Response) -> solver.Increment | None:
    """Give the increment at which the collapse mechanism begins with that as its motion; None where none collapses."""
    collapse, begins = response.collapse, falls_from(response)
    if collapse is None or begins is None or not collapse.mechanism.any():
        return None
    return mechanics.with_motion(begins, collapse.mechanism)


def _falling_mass(response: solver.Response) -> float:
    """Mass of the blocks that the collapse mechanism takes with it [kg]."""
    falling = with_mechanism(response)
    assert falling is not None
    takes = mechanics.rigid_parts(response.assembly, falling) >= 0
    return float(response.assembly.masses[takes & response.assembly.free].sum())


def _followed(
    response: solver.Response,
    push: float,
    progress: Callable[[float, float], None] | None,
    watch: Callable[[Engine], None] | None,
) -> Fall:
    """Follow the blocks until all rest or the time is over."""
    engine, ground = engine_of(response, push)
    height = float(engine.corners[engine.free[engine.assembly.block_of_vertex], -1].max()) - ground
    longest = LONGEST * float(np.sqrt(2.0 * height / solver.GRAVITY)) + RESTING
    poses, tied = [engine.pose], [(engine.tensions, engine.rest)]
    calm, still = 0, STILL * float(np.sqrt(solver.GRAVITY * response.assembly.block_size))
    if watch is not None:
        watch(engine)
    for number in range(1, round(longest * RATE) + 1):
        try:
            engine.advance(1.0 / RATE)
        except mechanics.NotSolved as failure:
            warnings.warn(f"the fall is followed for {(number - 1) / RATE:g} s only: {failure}", stacklevel=2)
            break
        poses.append(engine.pose)
        tied.append((engine.tensions, engine.rest))
        if progress is not None:
            progress(number / RATE, longest)
        if watch is not None:
            watch(engine)
        calm = calm + 1 if engine.fastest < still else 0
        if calm >= RESTING * RATE:
            break
    n = response.assembly.n_blocks
    return Fall(
        np.arange(len(poses)) / RATE,
        np.stack([pose.positions[:n] for pose in poses]),
        np.stack([pose.rotations[:n] for pose in poses]),
        ground,
        np.stack([forces for forces, _ in tied]),
        np.stack([rest for _, rest in tied]),
    )


def engine_of(response: solver.Response, push: float) -> tuple[Engine, float]:
    """Put the last equilibrium of a response above a ground, and give the height of that [m].

    The push is the speed [m/s] of the fastest block of the mechanism at the start. The supports are where no
    equilibrium is any more: at the last one a push would leave blocks on the last of their bearing.
    """
    assert response.collapse is not None
    last, end = response.path[-1].pose, response.increments[-1]
    assembly = response.assembly.with_roles(np.where(end.removed, mechanics.FIXED, response.assembly.roles))
    ground, material = ground_below(assembly, last, end.removed)
    beyond = response.increments[min(len(response.path), len(response.increments) - 1)].pose
    places, turns = (
        np.where(response.assembly.free[:, None], here, there)
        for here, there in ((last.positions, beyond.positions), (last.rotations, beyond.rotations))
    )
    whole, pose = on_ground(assembly, solver.Pose(places, turns), ground, material)
    still = np.zeros((1, response.loads.dead.shape[1]))
    loads = np.append(response.dead_at(end, last), still, axis=0)
    velocity = np.append(push * response.collapse.mechanism, still, axis=0)
    removed, tied = np.append(end.removed, False), response.path[-1].ties
    gone = np.isin(tied.states, (mechanics.ABSENT, mechanics.BROKEN))
    rest, ties = np.where(gone, np.nan, tied.rest), response.ties
    arms = response.loads_at(end).dead_arms
    return Engine(whole, loads, response.interfaces, pose, velocity, removed, ties, rest, tied.forces, arms), ground


def falling_increment(response: solver.Response, fall: Fall, time: float) -> solver.Increment:
    """Make what pictures, pages and files show of a fall at a time [s]: blocks and ties, no joints and no forces."""
    last, pose = response.path[-1], fall.at(time)
    nothing = np.zeros((0, last.forces.shape[1]))
    return replace(last, status=solver.Status.FALLING, checkpoint=None).with_arrays(
        pose=pose,
        contacts=last.contacts[np.zeros(0, dtype=int)],
        forces=nothing,
        displacements=nothing,
        friction=np.zeros(0),
        velocity=np.zeros_like(last.velocity),
        support_forces=np.zeros_like(last.support_forces),
        fell_at=response.increments[-1].state.fell_at,
        ties=fall.ties_at(time, response),
    )
