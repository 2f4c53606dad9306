"""The linear programs of Portioli & Cascini (2017): a settlement, one increment after another, in their simplest form.

F. Portioli, L. Cascini, Large displacement analysis of dry-jointed masonry structures subjected to settlements using
rigid block modelling, Engineering Structures 148 (2017) 485-496, https://doi.org/10.1016/j.engstruct.2017.06.073.

Free blocks have displacements u, two translations and a rotation each; those of the supports, ū, are given. Contact
point k opens by N_k and slips by T_k in them, (N, T) = Aᵀ (u, ū) with the wrench matrix A. Its gap function is g_k,
its friction coefficient μ; the loads on the free blocks are f.

**Kinematic form.** Of all displacements that the joints allow, blocks take those in which the loads do most work::

    minimise    - f · u
    subject to  N_k + g_k ≥ μ |T_k|                        for every contact point

Through its gap a point that is open may close; and the lift μ |T| which the associative flow rule gives to a point
that slides is the gap of the next program, which closes it again.

**Static form**, its dual, which is solved here. The multipliers λ ≥ 0 of the two rays of each friction cone make up
its force, c_k = λ⁻ (n - μ t) + λ⁺ (n + μ t) with the normal n and the tangent t of the joint::

    minimise    Σ_k g_k n · c_k  +  Σ_k (N_k(ū), T_k(ū)) · c_k
    subject to  A c + f = 0                                for every free block

The second sum is the work done on the supports: of all forces in equilibrium, those with the least reaction. The dual
variables of the equilibrium rows are the displacements -u; that of λ ≥ 0 is N + g ∓ μ T: a joint carries force where it
is closed, and shear up to friction where it slides.

**Increments.** A program is linear: after it the blocks are moved by exact rotations, and what it has left in the
joints is measured: gaps, and the drift d, slip that it did not ask for. Further programs with the supports standing,
N + g ≥ μ |T + d|, close both. A step is halved where they do not, and where no forces balance the loads. The mechanism
of a step is that at its start, so that the method is of the first order in the increment. Structures that hinge
converge to their exact path. Where joints slide, forces are those with the least reaction under an associative flow
rule, and of several mechanisms that would do the program takes any; Coulomb's law without dilatancy has other ones.
"""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
import scipy.sparse as sp

from solver.assembly import Assembly, find_contacts
from solver.equilibrium import friction_rays, with_slack, wrench_matrix
from solver.geometry.contacts import Contacts, matched_contacts
from solver.interfaces import Interfaces
from solver.kinematics import Pose, motion_size, moved, moved_vertices, point_velocities, relative_velocities
from solver.loads import Loads, Settlement
from solver.path.controls import Controls, Ending
from solver.path.reports import no_equilibrium
from solver.path.state import PathState, Place
from solver.programs.problem import LinearProgram, SolveError, Unbounded
from solver.programs.solve import solve_lp
from solver.results.certificate import Certificate, carrying_gap, friction_excess, largest_penetration
from solver.results.increment import Increment, State, Status, carries, used_up
from solver.results.mechanism import mechanism_of
from solver.results.response import Collapse
from solver.tolerances import (
    AT_LIMIT,
    BALANCE_TOLERANCE,
    CARRYING_FRACTION,
    COMPUTED_GAP,
    FALLING_FRACTION,
    FARTHEST_FALL,
    GEOMETRY_TOLERANCE,
    LEFT_WEDGED,
    OVERLAP,
    ROUNDING,
)

#: Programs that close a step; after them, gaps and drift up to this part of the increment are left to the next step.
LINEARISATIONS, GAP_LEFT = 10, 1e-2

#: Part of its lift that is taken off a sliding joint in advance: all of it could end in penetration.
LIFT_TAKEN_OFF = 0.999

#: Cost of unbalanced force where forces are read, in speeds of the supports: above the speed of any mechanism.
UNBALANCED_COST = 1e4

#: Shortest step, as a part of the tolerance of a collapse.
SHORTEST_STEP = 1.0 / 64.0


class Wedged(Exception):
    """Blocks are wedged between the supports: forces grow without limit."""


class _NotClosed(Exception):
    """The programs of a step have not closed its joints; those of a shorter step may."""


class _NoEquilibrium(Exception):
    """No forces balance the loads at a geometry: the solution tells which blocks fall."""

    def __init__(self, solution: Solution) -> None:
        super().__init__("no equilibrium")
        self.solution = solution


class Structure(NamedTuple):
    """Blocks, the laws of their joints, and the (n_blocks, 3) loads on them [N, N, N·m]."""

    assembly: Assembly
    interfaces: Interfaces
    load: np.ndarray


@dataclass(frozen=True)
class Solution:
    """Solution of a program.

    Attributes
    ----------
    state : State
        Forces, and as velocity the displacements in the program: of the supports as given, of the free blocks the dual
        variables of their equilibrium.
    touching : (n_contacts,) bool array
        Points with N + g = μ |T + d|, whether or not they carry force.
    balanced : bool
        Whether the forces are in equilibrium with the loads. If not, the displacements are those of a fall.
    certificate : Certificate
    """

    state: State
    touching: np.ndarray
    balanced: bool
    certificate: Certificate


def solve_program(
    structure: Structure, pose: Pose, contacts: Contacts, gaps: np.ndarray, supports: np.ndarray, trust: float
) -> Solution:
    """State the program of an increment at a geometry, and solve it.

    Parameters
    ----------
    structure : Structure
    pose : Pose
    contacts : Contacts
        At the pose.
    gaps : (n_contacts, 2) array [m]
        Gap function and drift of each point; one whose gap is infinite takes no part.
    supports : (n_blocks, 3) array [m, m, rad]
        Displacements of the supports, zero for free blocks; or rates.
    trust : float [m]
        Bound of the displacements of free blocks.

    Raises
    ------
    Wedged
        Where the static form has no minimum: no displacements of the blocks are compatible with those of the supports.
    SolveError
        If no method gives a solution that passes its check.

    Notes
    -----
    The static form above, and with unbalanced forces r⁺, r⁻ ≥ 0 on every free block: + ρ Σ (r⁺ + r⁻) in the cost and
    A c + f + r⁺ - r⁻ = 0. They are dual to the bound ρ of all displacements and cost too much to be used wherever the
    loads can be balanced. Equilibrium holds to a tolerance, lest a block without friction move sideways for nothing.
    """
    assembly, interfaces, load = structure
    length, free = assembly.block_size, assembly.free
    units = np.array([length, length, 1.0])
    force = float(np.hypot(*load[free, :2].T).mean())
    load = load / (force * length / units)
    total = float(np.abs(load[free, :2]).sum())
    friction = interfaces.friction(assembly, contacts.block_a, contacts.block_b)
    near = np.isfinite(gaps[:, 0])
    rays, wrench = friction_rays(friction)[:, np.repeat(near, 2)], wrench_matrix(contacts, pose, length)
    given = np.where(near[:, None] & (np.abs(gaps) >= ROUNDING * length), gaps, 0.0) / length
    distance = given.ravel() + wrench.T @ (supports / units).ravel()
    balance = sp.csc_array(sp.csr_array(wrench)[np.repeat(free, 3)] @ rays)
    rows, n = balance.shape
    program = LinearProgram(
        cost=np.concatenate([rays.T @ distance, np.full(2 * rows, trust / length)]),
        matrix=with_slack(balance),
        lower=-load[free].ravel() - BALANCE_TOLERANCE * total,
        upper=-load[free].ravel() + BALANCE_TOLERANCE * total,
        places=np.repeat(pose.positions[free], 3, axis=0),
    )
    try:
        found = solve_lp(program)
    except Unbounded as ray:
        pressed = carries((rays @ ray.x[:n]).reshape(-1, 2), CARRYING_FRACTION)
        blocks = np.unique(np.concatenate([contacts.block_a[pressed], contacts.block_b[pressed]]))
        names = [f"'{assembly.names[i]}'" for i in blocks if free[i]]
        shown = ", ".join(names[:6]) + (" ..." if len(names) > 6 else "")
        raise Wedged(f"the supports cannot move on: {len(names)} blocks are wedged ({shown})") from None
    forces = rays @ found.x[:n]
    resultant = (wrench @ forces).reshape(-1, 3)
    displacements = np.zeros_like(supports)
    displacements[free] = -found.row_dual.reshape(-1, 3)
    room = rays.T @ (distance + wrench.T @ displacements.ravel())
    touching = np.zeros(len(contacts), dtype=bool)
    touching[near] = room.reshape(-1, 2).min(axis=1) <= AT_LIMIT
    motion = supports + displacements * units
    on_supports = np.where(free[:, None], 0.0, resultant) * force * length / units
    relative = relative_velocities(contacts, pose, motion)
    state = State(pose, contacts, forces.reshape(-1, 2) * force, relative, friction, motion, on_supports)
    certificate = Certificate(
        equilibrium_residual=float(np.abs(resultant + load)[free].max(initial=0.0)) / total,
        friction_excess=friction_excess(state.forces / force, friction) / total,
        carrying_gap=carrying_gap(contacts, state.forces),
        largest_penetration=largest_penetration(contacts),
        duality_gap=found.gap,
        kinematic_violation=float(np.maximum(-room, 0.0).max(initial=0.0)),
    )
    balanced = bool(found.x[n:].max(initial=0.0) <= FALLING_FRACTION * total)
    return Solution(state, touching, balanced, certificate)


def left_open(contacts: Contacts, solution: Solution) -> tuple[float, np.ndarray]:
    """Measure what a program and the exact motion after it have left in the joints.

    Parameters
    ----------
    contacts : Contacts
        After the motion.
    solution : Solution
        Of the program.

    Returns
    -------
    left : float [m]
        Deepest penetration, largest gap of a point that carried force, or largest drift of one that stuck, too.
    gaps : (n_contacts, 2) array [m]
        Gap function and drift of each point, for the next program. Where slip leaves a part q of a gap g again, the
        gap function is g / (1 - q), which closes it at once. New points have no drift.
    """
    before, now = solution.state, contacts.gaps
    place, same = matched_contacts(contacts, before.contacts)
    drift = contacts.slip[:, 0] - before.contacts.slip[place, 0] - before.displacements[place, 1]
    carried = same & carries(before.forces, CARRYING_FRACTION)[place]
    stuck = carried & ~used_up(before.forces, before.friction)[place]
    left = max(np.abs(now[carried]).max(initial=0.0), np.abs(drift[stuck]).max(initial=0.0), -now.min(initial=0.0))
    earlier = before.contacts.gaps[place]
    again = same & solution.touching[place] & (now > 0.0) & (now < earlier)
    part = np.divide(now, earlier, out=np.zeros_like(now), where=again)
    return float(left), np.column_stack([now / (1.0 - LIFT_TAKEN_OFF * part), np.where(same, drift, 0.0)])


@dataclass(frozen=True)
class _Reached:
    """An equilibrium: settlement s [m or rad], pose, the program that reads its forces, reaction [N or N·m]."""

    s: float
    pose: Pose
    read: Solution
    reaction: float


class _Phase:
    """One settlement, phase ``number``, from the pose ``start``."""

    def __init__(self, structure: Structure, phase: Settlement, number: int, start: Pose) -> None:
        self.structure, self.assembly = structure, structure.assembly
        self.phase, self.number, self.start, self.programs = phase, number, start, 0
        points, block = moved_vertices(self.assembly, start), self.assembly.block_of_vertex
        #: Largest displacement of a support per unit of s: 1 m/m where it only travels.
        self.lever = float(np.hypot(*point_velocities(points, block, start, self.rate(0.0)).T).max())
        self.length, movement = self.assembly.block_size, self.lever * phase.increment
        #: Largest gap [m] that one program may close, largest displacement [m] in it, largest gap [m] that may be left.
        self.reach = max(min(4.0 * movement, self.length / 2.0), self.length / 4.0)
        self.trust = max(self.length, 10.0 * movement)
        self.gap_left = max(GAP_LEFT * movement, COMPUTED_GAP * self.length)
        self.tolerance = float(phase.tolerance or phase.increment / 100.0) * (1.0 + 1e-9)

    def contacts(self, pose: Pose) -> Contacts:
        """Find the contact points at a pose."""
        return find_contacts(self.assembly, moved_vertices(self.assembly, pose), self.reach)

    def size(self, motion: np.ndarray) -> float:
        """Give the largest movement [m] in an (n_blocks, 3) motion, rotations times the block size."""
        return float(motion_size(motion, self.length).max(initial=0.0))

    def solved(self, pose: Pose, contacts: Contacts, **given: Any) -> Solution:
        """Solve a program, by default of the gaps at the pose, with the supports standing."""
        self.programs += 1
        gaps = np.column_stack([contacts.gaps, np.zeros(len(contacts))])
        default: dict[str, Any] = {"gaps": gaps, "supports": np.zeros_like(self.structure.load), "trust": self.trust}
        given = default | given
        try:
            return solve_program(self.structure, pose, contacts, **given)
        except Wedged:
            # Drawings and programs are off by as much; blocks that are wedged cannot give way to it.
            given["gaps"] = np.where(np.abs(given["gaps"]) < LEFT_WEDGED * self.length, 0.0, given["gaps"])
            return solve_program(self.structure, pose, contacts, **given)

    def rate(self, s: float) -> np.ndarray:
        """Give the (n_blocks, 3) velocity of the supports per unit of s."""
        return self.phase.rate(self.assembly, self.start, s)

    def reached(self, s: float, pose: Pose) -> _Reached:
        """Read forces and velocities at a pose: the program of a vanishing step, of closed joints only."""
        contacts, rate = self.contacts(pose), self.rate(s)
        gaps = np.zeros((len(contacts), 2))
        gaps[contacts.gaps > self.gap_left, 0] = np.inf
        try:
            read = self.solved(pose, contacts, supports=rate, gaps=gaps, trust=UNBALANCED_COST * self.lever)
        except Wedged:
            # No finite reaction belongs to this state, but forces in equilibrium do.
            read = self.solved(pose, contacts, gaps=gaps)
        return _Reached(s, pose, read, float((read.state.support_forces * rate).sum()))

    def stepped(self, here: _Reached, s: float) -> _Reached:
        """Step from an equilibrium to the settlement s; raises Wedged and what ``closed`` raises."""
        free, supports = self.assembly.free[:, None], self.rate(here.s) * (s - here.s)
        solution = self.solved(here.pose, self.contacts(here.pose), supports=supports)
        pose = moved(here.pose, solution.state.velocity)
        given = self.phase.displaced(self.assembly, self.start, s)
        positions = np.where(free, pose.positions, given.positions)
        return self.closed(s, Pose(positions, np.where(free, pose.rotations, given.rotations)), solution)

    def closed(self, s: float, first: Pose, solution: Solution) -> _Reached:
        """Close what a program has left at the pose ``first``, with the supports standing, until forces balance there.

        Raises _NoEquilibrium, _NotClosed or SolveError.
        """
        pose = first
        for number in range(LINEARISATIONS + 1):
            far = self.size(first.movement_to(pose)) > FARTHEST_FALL * self.length
            if far or not solution.balanced:
                raise _NoEquilibrium(solution)
            contacts, last = self.contacts(pose), number == LINEARISATIONS
            left, gaps = left_open(contacts, solution)
            if left <= (self.gap_left if last else GEOMETRY_TOLERANCE * self.length):
                reached = self.reached(s, pose)
                if reached.read.balanced:
                    self.refuse_overlap(pose)
                    return reached
                if last:
                    raise _NoEquilibrium(reached.read)
            elif last:
                break
            try:
                solution = self.solved(pose, contacts, gaps=gaps)
            except Wedged as error:
                raise _NotClosed(str(error)) from None
            pose = moved(pose, solution.state.velocity)
        raise _NotClosed(
            f"after {LINEARISATIONS} programs a joint is still off by {left:.3g} m (accepted: {self.gap_left:.3g} m)"
        )

    def refuse_overlap(self, pose: Pose) -> None:
        """Raise _NotClosed where a free block has come into another, contact points or not."""
        assembly, deepest = self.assembly, OVERLAP * float(self.assembly.widths.min())
        for a, b, depth in zip(*assembly.shapes.overlaps(moved_vertices(assembly, pose), deepest), strict=True):
            if assembly.free[a] or assembly.free[b]:
                raise _NotClosed(f"block '{assembly.names[a]}' came {depth:.3g} m into block '{assembly.names[b]}'")

    def follow(
        self, here: _Reached, step: float, beyond: float, *, reported: bool
    ) -> Generator[Increment, None, tuple[Ending, Pose]]:
        """Follow the phase from an equilibrium, first with ``step``; return how and where it ended.

        No equilibrium is known at ``beyond``, which may be infinite. Of a fall its first motion is yielded.
        """
        phase, last = self.phase, here.s
        if not reported:
            yield self.increment(here, step, beyond)
        while here.s < phase.limit:
            target = self.next_report(here.s)
            enclosed = beyond - here.s <= self.tolerance
            to = beyond if enclosed else min(here.s + step, target, (here.s + beyond) / 2.0)
            to = target if target - to < 1e-9 * phase.increment else to
            length = to - here.s
            try:
                new = self.stepped(here, to)
            except _NoEquilibrium as found:
                beyond, step = to, length / 2.0
                if length <= self.tolerance and here.s <= last:
                    shown, collapse = self.collapsed(here, beyond, found.solution)
                    yield shown
                    return collapse, here.pose
                failed = length <= self.tolerance
            except (Wedged, _NotClosed, SolveError) as error:
                step, wedged = length / 2.0, isinstance(error, Wedged) and length <= self.tolerance
                failed = wedged or step < SHORTEST_STEP * self.tolerance
                if failed and here.s <= last:
                    stop = Status.LOCKED if wedged else Status.SOLVER_FAILED
                    return Ending(stop, f"at a settlement of {here.s:.6g} {phase.unit}: {error}"), here.pose
            else:
                step, here, failed = min(2.0 * length, phase.increment), new, False
                beyond = np.inf if here.s >= beyond else beyond
            if here.s > last and (failed or here.s == target):
                # The last equilibrium is reported, too, and the step from it repeated, as a resumed path does.
                yield self.increment(here, step, beyond)
                last = here.s
        reached = f"the settlement reached its limit of {phase.limit:g} {phase.unit}"
        return Ending(Status.LIMIT_REACHED, reached), here.pose

    def next_report(self, s: float) -> float:
        """Give the next settlement that is reported: a multiple of the increment, a stop, or the limit."""
        phase = self.phase
        multiple = (np.floor(s / phase.increment + 1e-9) + 1.0) * phase.increment
        target = min(multiple, s + phase.step_to_stop(s))
        return phase.limit if phase.limit - target < 1e-9 * phase.increment else float(target)

    def increment(self, here: _Reached, step: float, beyond: float) -> Increment:
        """Report an equilibrium, with the checkpoint from which the phase goes on."""
        place, ended = Place.unloaded(here.pose, here.s), here.s >= self.phase.limit
        checkpoint = PathState(self.number, self.start, place, step, beyond, ended=ended)
        found = self.reported(here.read, here.s, here.reaction, Status.EQUILIBRIUM)
        return replace(found, least=here.reaction, checkpoint=checkpoint)

    def reported(self, found: Solution, s: float, reaction: float, status: Status) -> Increment:
        """Report a program, and how many were solved since the last report."""
        programs, self.programs = self.programs, 0
        certificate, number = found.certificate, self.number
        return Increment(s, reaction, number, 0.0, reaction, certificate, status, programs, 0.0, found.state)

    def collapsed(self, here: _Reached, beyond: float, falls: Solution) -> tuple[Increment, Ending]:
        """Give the fall, and the collapse, from the program that found no equilibrium beyond the last one."""
        shown = self.reported(falls, beyond, 0.0, Status.FALLING)
        bracket, motion, words = (here.s, beyond), falls.state.velocity, str(mechanism_of(self.assembly, shown))
        mechanism, unit = motion / self.size(motion), self.phase.unit
        collapse = Collapse(sum(bracket) / 2.0, bracket, here.reaction, mechanism, unit, words)
        return shown, Ending(Status.COLLAPSED, str(collapse), collapse)


def linear_program_increments(
    assembly: Assembly,
    phases: Sequence[Settlement],
    interfaces: Interfaces,
    loads: Loads,
    controls: Controls,
    resume: PathState | None = None,
) -> Generator[Increment, None, Ending]:
    """Yield the increments of settlements by the paper's linear programs; return how they ended.

    Parameters
    ----------
    assembly : Assembly
        In the plane.
    phases : sequence of Settlement
    interfaces : Interfaces
    loads : Loads
    controls : Controls
        Not used: the method has nothing to choose.
    resume : PathState, optional
        Of an increment that such a loop has yielded, with the same other arguments: those after it follow bit for bit.

    Raises
    ------
    ValueError
        If no load acts on any free block.
    """
    load = loads.total()
    if not np.abs(load[assembly.free, :2]).any():
        raise ValueError("no load acts on any free block; give them a weight")
    first, pose = (0, Pose.initial(assembly)) if resume is None else (resume.phase, resume.start)
    ending = Ending(Status.LIMIT_REACHED)
    for number, phase in enumerate(phases[first:], start=first):
        path, goes_on = _Phase(Structure(assembly, interfaces, load), phase, number, pose), resume is not None
        step, beyond = phase.increment, np.inf
        try:
            if resume is not None:
                s, pose, step, beyond = resume.place.s, resume.place.pose, resume.step, resume.upper_bound
                here, resume, path.programs = path.reached(s, pose), None, 0
            else:
                # Gaps and overlaps of the drawing, or of larger increments, are closed before anything moves.
                here = path.closed(0.0, pose, path.solved(pose, path.contacts(pose)))
        except _NoEquilibrium as found:
            yield path.reported(found.solution, 0.0, 0.0, Status.FALLING)
            return Ending(Status.NO_INITIAL_EQUILIBRIUM, no_equilibrium(assembly, found.solution.state.velocity))
        except (Wedged, _NotClosed, SolveError) as error:
            return Ending(Status.SOLVER_FAILED, f"before any settlement: {error}")
        ending, pose = yield from path.follow(here, step, beyond, reported=goes_on)
        if ending.stop is not Status.LIMIT_REACHED:
            return ending
    return ending
