"""Forward runs: what each candidate does to the structure, for every amount of it."""

from __future__ import annotations

import signal
from collections.abc import Iterator, Sequence
from concurrent.futures import BrokenExecutor, Executor, ProcessPoolExecutor
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from multiprocessing import active_children, get_context
from typing import Any

import numpy as np

import solver
from blockvis.cases.build import case_interfaces, case_loads, case_ties
from blockvis.cases.contents import Case
from blockvis.cases.profiles import by_bearing
from blockvis.kinds.kind import RunInput
from blockvis.kinds.settlement import SettlementKind
from blockvis.layout.outlines import TOUCHING
from blockvis.results.joints import initial_joints, opening_and_slip
from blockvis.runs.path_range import Variation
from blockvis.runs.progress import RunsProgress
from blockvis.system.extras import require
from blockvis.system.processes import cores
from solver import mechanics

from .observations import Observations

#: Times the step_tolerance of the case that steps aim for, and the most: widths are compared within a quarter of them,
#: and of reactions nothing is told.
COARSER, COARSEST = 8.0, 0.5

#: A run stops where a joint is open by so many times the widest observed crack.
ENOUGH = 2.0

#: The largest displacement of a support where the case gives none: in widest cracks, for a springer goes down by ten
#: times the width of those that this opens, and in largest displacements that were observed.
FARTHEST, AS_FAR = 25.0, 3.0

#: What is drawn alike on both sides has several paths, and what is built has taken one: stones are heavier by up to
#: this fraction towards one side, and lighter towards the other. In friction two sides differ by more.
LEANING = 0.1

#: A collapse is found within this fraction of the largest amount.
COLLAPSE = 2e-3

#: With fewer runs than this, processes cost more than they save.
FEWEST_FOR_PROCESSES = 8


#: The kind of analysis that candidates are followed by.
FOLLOWED = SettlementKind()


@dataclass(frozen=True)
class Variant:
    """What a run assumes besides the movement of the supports."""

    friction: float  #: Coefficient of [material]; those of pairs of materials follow in proportion.
    #: {-1, 0, 1}: whether stones are a little heavier towards the left, nowhere, or towards the right.
    heavier_side: int = 0


@dataclass(frozen=True)
class Order:
    """One run: a structure, and how its supports move."""

    given: RunInput  #: The case has the one settlement of the supports that move, which have the role "moving".
    enough: float  #: [m] Opening at which the run may stop.

    @property
    def settlement(self) -> solver.Settlement:
        """How its supports move."""
        return self.given.case.settlements[0]


class OpenEnough(Exception):
    """A joint is open so wide that nothing more is asked of a run."""


@dataclass(frozen=True)
class Run:
    """What a candidate does, for every amount."""

    amounts: np.ndarray  #: (n,) array [m or rad]: of the steps of the path, from 0, or 0 alone.
    moved: np.ndarray  #: (n, n_blocks, n_dof) array [m and rad]: displacement and rotation of each block.
    fell: bool  #: Whether it ended in a collapse.

    def at(self, amounts: np.ndarray, values: np.ndarray) -> np.ndarray:
        """Interpolate values (n, ...) of the increments at amounts (m,): (m, ...) array."""
        rest, place = np.modf(np.interp(amounts, self.amounts, np.arange(len(self.amounts))))
        before, rest = values[place.astype(int)], rest.reshape(-1, *[1] * (values.ndim - 1))
        return np.asarray(before * (1.0 - rest) + values[np.ceil(place + rest.ravel()).astype(int)] * rest)


def reach_of(observations: Observations, limit: float | None) -> tuple[float, float]:
    """Say how far runs go: the largest displacement of a support, if limited, and the opening to stop at [m]."""

    def rounded(length: float) -> float:
        # Runs that go a little farther serve other observations of the same structure, too.
        return float(2.0 ** np.ceil(np.log2(length))) if length > 0.0 else 0.0

    widest = rounded(observations.widths.max(initial=0.0))
    moved = rounded(np.linalg.norm(observations.displacements, axis=1).max(initial=0.0))
    farthest = max(FARTHEST * widest, AS_FAR * moved) if limit is None else limit
    return farthest, ENOUGH * widest if widest > 0.0 else np.inf


def pose_of(assembly: solver.Assembly, moved: np.ndarray) -> solver.Pose:
    """Move blocks from the drawing by displacements and rotations (n_blocks, n_dof) [m and rad]."""
    d = assembly.dimension
    return solver.Pose(assembly.centroids + moved[:, :d], moved[:, d:])


def lever_of(assembly: solver.Assembly, settlement: solver.Settlement) -> float:
    """Largest movement of a support where it carries something, per unit of the settlement [m or m/rad]."""
    contacts = mechanics.find_contacts(assembly, assembly.vertices, 2.0 * TOUCHING * assembly.block_size)
    pose = solver.Pose.initial(assembly)
    rate = settlement.rate(assembly, pose, 0.0)
    speeds = [
        np.hypot.reduce(mechanics.point_velocities(contacts.points, block, pose, rate), axis=1)
        for block in (contacts.block_a, contacts.block_b)
    ]
    return float(np.max(speeds)) or 1.0


def ordered(case: Case, assembly: solver.Assembly, motions: Any, variant: Variant, reach: tuple[float, float]) -> Order:
    """State the run of a candidate, by its motions of supports that are all fixed, as far as :func:`reach_of` says."""
    roles = assembly.roles.astype("<U6").copy()
    roles[[assembly.index(name) for name in motions]] = mechanics.MOVING
    moving = assembly.with_roles(roles)
    profile = by_bearing(moving, motions)
    lever = lever_of(moving, solver.Settlement(**profile))
    farthest = reach[0] / lever
    settlement = solver.Settlement(**profile, increment=farthest, limit=farthest, tolerance=COLLAPSE * farthest)
    coarse = min(COARSER * case.controls.step_tolerance, COARSEST)
    friction = variant.friction
    factor = friction / case.friction_coefficient if case.friction_coefficient > 0.0 else 1.0
    varied = replace(
        Variation(friction_factor=factor).of(case),
        friction_coefficient=friction,
        settlements=(settlement,),
        controls=replace(case.controls, falling_frames=0, step_tolerance=coarse),
    )
    loads = case_loads(case, moving)
    # In space towards the left and, half as much, the front: one that is alike about both axes has its paths, too.
    x = moving.centroids[:, :-1] @ (1.0, 0.5)[: moving.dimension - 1]
    middle, half = (x.max() + x.min()) / 2.0, max(float(np.ptp(x)) / 2.0, 1e-300)
    heavier = 1.0 + LEANING * variant.heavier_side * (x - middle) / half
    arms = None if loads.dead_arms is None else loads.dead_arms * heavier[:, None, None]
    loads = replace(loads, dead=loads.dead * heavier[:, None], dead_arms=arms)
    given = RunInput(varied, moving, case_interfaces(varied), loads, ties=case_ties(case, moving))
    return Order(given, reach[1])


def followed(order: Order) -> Run:
    """Carry out a run; one that cannot be solved ends where it came to."""
    trace = _Trace(order)
    steps = FOLLOWED.start(replace(order.given, listeners=[trace.step]), None, ()).steps
    fell = False
    with suppress(solver.SolveError, OpenEnough):
        for increment in steps:
            if increment.status == solver.Status.EQUILIBRIUM:
                trace.add(increment.parameter, increment.pose.displacements(order.given.assembly))
        fell = steps.ending.collapse is not None
    return trace.run(fell)


class _Trace:
    """Where the steps of a run have led, and the increments that it reports: the start, and what ends it.

    More increments would tell nothing else, and cost more than the steps between them: each has its proof.
    """

    def __init__(self, order: Order) -> None:
        self.assembly, self.enough = order.given.assembly, order.enough
        self.joints = initial_joints(self.assembly)
        self.amounts: list[float] = []
        self.moved: list[np.ndarray] = []

    def add(self, amount: float, moved: np.ndarray) -> None:
        """Add a place [m or rad], (n_blocks, n_dof) [m and rad]; those from there on are no more on the path."""
        while self.amounts and self.amounts[-1] >= amount:
            self.amounts.pop()
            self.moved.pop()
        self.amounts.append(amount)
        self.moved.append(moved)

    def step(self, state: mechanics.PathState) -> None:
        """Hear of a step; raises :class:`OpenEnough` where nothing more is asked."""
        place, begun = state.place, state.start
        # Steps that are refused lead nowhere, and poses of a path may be about an origin of its own.
        if self.amounts and place.s == self.amounts[-1]:
            return
        self.add(place.s, np.concatenate([place.pose.positions - begun.positions, place.pose.rotations], axis=1))
        fallen = ~np.isnan(state.fell_at) if len(state.fell_at) else None
        pose = pose_of(self.assembly, self.moved[-1])
        opening = opening_and_slip(self.assembly, self.joints, pose, fallen)[:, 0]
        if opening.max(initial=0.0) > self.enough:
            raise OpenEnough

    def run(self, fell: bool) -> Run:
        """Return the run so far; nothing has moved where none of it was solved."""
        at_rest = solver.Pose.initial(self.assembly).displacements(self.assembly)
        return Run(np.array(self.amounts or [0.0]), np.array(self.moved or [at_rest]), fell)


@contextmanager
def workers_for(runs: int, workers: int | None, scheduler: str | None) -> Iterator[Executor | None]:
    """Start or find the processes of about so many runs; None where this process makes them.

    ``workers`` are processes of this machine, one per core where the runs are many; ``scheduler`` is the address of a
    Dask scheduler that exists.
    """
    if workers is not None and workers < 1:
        raise ValueError(f"workers is {workers}; give at least 1")
    if scheduler is not None:
        require("studies", "explain on a Dask cluster")
        from blockvis.studies import campaign

        with campaign.existing_cluster(scheduler, "") as client:
            yield client.get_executor(pure=False)
        return
    count = min(workers or cores(), runs)
    if count < 2 or (workers is None and runs < FEWEST_FOR_PROCESSES):
        yield None
        return
    # Processes that are forked would share the locks of this one's threads. This one alone answers Ctrl-C of their
    # terminal, and stops the others.
    deaf = (signal.SIGINT, signal.SIG_IGN)
    processes = ProcessPoolExecutor(count, mp_context=get_context("spawn"), initializer=signal.signal, initargs=deaf)
    before = active_children()
    try:
        yield processes
    except BaseException:
        # Whoever interrupts does not wait for the runs that are under way.
        processes.shutdown(wait=False, cancel_futures=True)
        for child in active_children():
            if child not in before:
                child.terminate()
        raise
    processes.shutdown()


def all_followed(orders: Sequence[Order], processes: Executor | None, progress: RunsProgress) -> list[Run]:
    """Carry out runs, in other processes or here; raises ``ValueError`` where these cannot be started, or are ended."""
    found = []
    try:
        for run in map(followed, orders) if processes is None else processes.map(followed, orders):
            found.append(run)
            progress.finished()
    except BrokenExecutor as error:
        raise ValueError(
            f"the processes of the runs have ended ({error}), perhaps for want of memory; ask for fewer with "
            '--workers 1, and call blockvis.explain in a script under if __name__ == "__main__":'
        ) from None
    return found
