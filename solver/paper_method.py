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
joints is measured: gaps, and the drift d, slip beyond that of the program. Further programs, the supports fixed,
N + g ≥ μ |T + d|, close both. A step is halved where they do not, and where no forces balance the loads. The mechanism
of a step is that at its start, so that the method is of the first order in the increment. Structures that hinge
converge to their exact path. Where joints slide, forces are those with the least reaction under an associative flow
rule, and of several mechanisms that would do the program takes any; Coulomb's law without dilatancy has other ones.
"""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy.sparse as sp

from solver import tolerances
from solver.assembly import find_contacts
from solver.equilibrium import friction_rays, wrench_matrix
from solver.geometry.contacts import Contacts, matched_contacts
from solver.kinematics import Pose, motion_size, moved, moved_vertices, put_together, relative_velocities
from solver.loads import Settlement
from solver.path.controls import Ending
from solver.path.drivers import SupportMotion
from solver.path.reports import no_equilibrium, wedged
from solver.path.state import PathState, Place
from solver.program.model import Model
from solver.programs.problem import LinearProgram, SolveError, Unbounded
from solver.programs.solve import solve_lp
from solver.results.certificate import Certificate, carrying_gap, friction_excess, largest_penetration
from solver.results.increment import Increment, State, Status, carries, used_up
from solver.results.mechanism import mechanism_of, with_motion
from solver.results.response import Collapse

#: Programs that close the joints after a step.
LINEARISATIONS = 10

#: Cost of unbalanced force beside the reaction: above the speed of any block per speed of the supports.
UNBALANCED_COST = 1e4


class SupportsLocked(Exception):
    """Blocks are wedged between the supports: the reaction has no bound."""


class _JointsOpen(Exception):
    """The programs of a step have not closed its joints."""


class _NoEquilibrium(Exception):
    """No forces balance the loads at a geometry; the solution has the motion of the blocks that fall."""

    def __init__(self, solution: ProgramSolution) -> None:
        self.solution = solution


@dataclass(frozen=True)
class ProgramSolution:
    """Solution of a program; the velocity of its state are the displacements."""

    state: State
    touching: np.ndarray  #: (n_contacts,) bool: points with N + g = μ |T + d|, with or without force
    balanced: bool  #: whether forces balance the loads; otherwise the displacements are those of a fall
    certificate: Certificate


def solve_program(
    model: Model, pose: Pose, contacts: Contacts, gaps: np.ndarray, supports: np.ndarray, trust: float
) -> ProgramSolution:
    """State the program of an increment at a geometry, and solve it.

    Of gap function and drift of each point, (n_contacts, 2) [m], one whose gap is infinite takes no part; displacements
    of the supports, or rates, (n_blocks, 3) [m, m, rad], zero for free blocks; and a bound of those of free blocks [m].
    Raises ``SupportsLocked`` where no displacements of the blocks are compatible with those of the supports.

    The static form above, and with unbalanced forces r⁺, r⁻ ≥ 0 on every free block: + ρ Σ (r⁺ + r⁻) in the cost and
    A c + f + r⁺ - r⁻ = 0. They are dual to the bound ρ of all displacements and cost too much to be used wherever the
    loads can be balanced.
    """
    assembly, length, units, free = model.assembly, model.length, model.lengths, model.assembly.free
    load = model.loads.dead_at(assembly, pose)
    force = float(np.hypot(*load[free, :2].T).mean())
    load = load / (force * length / units)
    total = float(np.abs(load[free, :2]).sum())
    friction = model.interfaces.friction(assembly, contacts.block_a, contacts.block_b)
    takes_part = np.isfinite(gaps[:, 0])
    rays, wrench = friction_rays(friction)[:, np.repeat(takes_part, 2)], wrench_matrix(contacts, pose, length)
    wide = takes_part[:, None] & (np.abs(gaps) >= tolerances.FEASIBILITY_TOLERANCE * length)
    distance = np.where(wide, gaps, 0.0).ravel() / length + wrench.T @ (supports / units).ravel()
    balance = sp.csc_array(sp.csr_array(wrench)[np.repeat(free, 3)] @ rays)
    rows, n = balance.shape
    program = LinearProgram(
        cost=np.concatenate([rays.T @ distance, np.full(2 * rows, trust / length)]),
        matrix=sp.hstack([balance, sp.eye_array(rows), -sp.eye_array(rows)], format="csc"),
        lower=-load[free].ravel() - tolerances.BALANCE_TOLERANCE * total,
        upper=-load[free].ravel() + tolerances.BALANCE_TOLERANCE * total,
        places=np.repeat(pose.positions[free], 3, axis=0),
    )
    try:
        solution = solve_lp(program)
    except Unbounded as ray:
        carrying = carries((rays @ ray.x[:n]).reshape(-1, 2), tolerances.CARRYING_FRACTION)
        raise SupportsLocked(wedged(assembly, contacts[carrying])) from None
    forces = rays @ solution.x[:n]
    resultant = (wrench @ forces).reshape(-1, 3)
    displacements = np.zeros_like(supports)
    displacements[free] = -solution.row_dual.reshape(-1, 3)
    slack = rays.T @ (distance + wrench.T @ displacements.ravel())
    touching = np.zeros(len(contacts), dtype=bool)
    touching[takes_part] = slack.reshape(-1, 2).min(axis=1) <= tolerances.AT_LIMIT
    motion = supports + displacements * units
    on_supports = np.where(free[:, None], 0.0, resultant) * force * length / units
    relative = relative_velocities(contacts, pose, motion)
    state = State(pose, contacts, forces.reshape(-1, 2) * force, relative, friction, motion, on_supports)
    certificate = Certificate(
        equilibrium_residual=float(np.abs(resultant + load)[free].max(initial=0.0)) / total,
        friction_excess=friction_excess(state.forces / force, friction) / total,
        carrying_gap=carrying_gap(contacts, state.forces),
        largest_penetration=largest_penetration(contacts),
        duality_gap=solution.gap,
        kinematic_violation=float(np.maximum(-slack, 0.0).max(initial=0.0)),
    )
    balanced = bool(solution.x[n:].max(initial=0.0) <= tolerances.FALLING_FRACTION * total)
    return ProgramSolution(state, touching, balanced, certificate)


def joint_errors(contacts: Contacts, solution: ProgramSolution) -> tuple[float, np.ndarray]:
    """Measure gaps and drift of the joints at their contacts after the exact motion that follows a program.

    Gives the largest penetration, gap of a point that carried force, or drift of one that stuck, too [m]; and both,
    (n_contacts, 2) [m], for the next program: where slip leaves a part q of a gap g again, the gap is g / (1 - q).
    """
    before, gap = solution.state, contacts.gaps
    place, same = matched_contacts(contacts, before.contacts)
    drift = contacts.slip[:, 0] - before.contacts.slip[place, 0] - before.displacements[place, 1]
    carried = same & carries(before.forces, tolerances.CARRYING_FRACTION)[place]
    sticking = carried & ~used_up(before.forces, before.friction)[place]
    errors = np.concatenate([np.abs(gap[carried]), np.abs(drift[sticking]), -gap])
    earlier = before.contacts.gaps[place]
    repeated = same & solution.touching[place] & (gap > 0.0) & (gap < earlier)
    part = np.divide(gap, earlier, out=np.zeros_like(gap), where=repeated)
    return float(errors.max(initial=0.0)), np.column_stack([gap / (1.0 - 0.999 * part), np.where(same, drift, 0.0)])


@dataclass(frozen=True)
class _Equilibrium:
    """An equilibrium: settlement s [m or rad], pose, the program that reads its forces, reaction [N or N·m]."""

    s: float
    pose: Pose
    solution: ProgramSolution
    reaction: float


class _Phase:
    """One settlement, phase ``number``, from the pose ``start``."""

    def __init__(self, model: Model, phase: Settlement, number: int, start: Pose) -> None:
        self.model, self.assembly, self.phase, self.number = model, model.assembly, phase, number
        self.driver, self.start, self.programs = SupportMotion(model.assembly, phase, start), start, 0
        self.length, self.lever = model.length, self.driver.lever(model)
        movement = self.lever * phase.increment
        #: Largest gap [m] that one program may close, largest displacement [m] in it, largest gap [m] that may be left.
        self.reach = max(min(4.0 * movement, self.length / 2.0), self.length / 4.0)
        self.trust = max(self.length, 10.0 * movement)
        self.gap_left = max(1e-2 * movement, tolerances.COMPUTED_GAP * self.length)
        self.tolerance = self.driver.tolerance * (1.0 + 1e-9)

    def contacts(self, pose: Pose) -> Contacts:
        return find_contacts(self.assembly, moved_vertices(self.assembly, pose), self.reach)

    def solve(self, pose: Pose, contacts: Contacts, **arguments: Any) -> ProgramSolution:
        """Solve a program, by default of the gaps at the pose, with the supports fixed."""
        self.programs += 1
        gaps = np.column_stack([contacts.gaps, np.zeros(len(contacts))])
        default: dict[str, Any] = {"gaps": gaps, "supports": np.zeros_like(self.model.load), "trust": self.trust}
        arguments = default | arguments
        try:
            return solve_program(self.model, pose, contacts, **arguments)
        except SupportsLocked:
            # Drawings and programs are off by as much; blocks that are wedged cannot give way to it.
            is_small = np.abs(arguments["gaps"]) < tolerances.ACCEPTED_ERROR * self.length
            arguments["gaps"] = np.where(is_small, 0.0, arguments["gaps"])
        return solve_program(self.model, pose, contacts, **arguments)

    def evaluate(self, s: float, pose: Pose) -> _Equilibrium:
        """Read forces and velocities at a pose: the program of a vanishing step, of closed joints only."""
        contacts, rate = self.contacts(pose), self.driver.rate(s)
        gaps = np.column_stack([np.where(contacts.gaps > self.gap_left, np.inf, 0.0), np.zeros(len(contacts))])
        try:
            solution = self.solve(pose, contacts, supports=rate, gaps=gaps, trust=UNBALANCED_COST * self.lever)
        except SupportsLocked:
            # No finite reaction belongs to this state, but forces in equilibrium do.
            solution = self.solve(pose, contacts, gaps=gaps)
        return _Equilibrium(s, pose, solution, float((solution.state.support_forces * rate).sum()))

    def step_to(self, current: _Equilibrium, s: float) -> _Equilibrium:
        """Step from an equilibrium to the settlement s; raises what stops it there."""
        supports = self.driver.rate(current.s) * (s - current.s)
        solution = self.solve(current.pose, self.contacts(current.pose), supports=supports)
        pose = moved(current.pose, solution.state.velocity)
        return self.close_joints(s, put_together(self.assembly.free, pose, self.driver.supports(s)), solution)

    def close_joints(self, s: float, first: Pose, solution: ProgramSolution) -> _Equilibrium:
        """Close what a program has left at the pose ``first``, with the supports fixed, until forces balance there."""
        pose = first
        for number in range(LINEARISATIONS + 1):
            far = motion_size(first.movement_to(pose), self.length).max() > tolerances.FARTHEST_FALL * self.length
            if far or not solution.balanced:
                raise _NoEquilibrium(solution)
            contacts, last = self.contacts(pose), number == LINEARISATIONS
            largest, gaps = joint_errors(contacts, solution)
            if largest <= (self.gap_left if last else tolerances.GEOMETRY_TOLERANCE * self.length):
                equilibrium = self.evaluate(s, pose)
                if equilibrium.solution.balanced:
                    self.refuse_overlap(pose)
                    return equilibrium
                if last:
                    raise _NoEquilibrium(equilibrium.solution)
            elif last:
                break
            try:
                solution = self.solve(pose, contacts, gaps=gaps)
            except SupportsLocked as error:
                raise _JointsOpen(str(error)) from None
            pose = moved(pose, solution.state.velocity)
        raise _JointsOpen(
            f"after {LINEARISATIONS} programs a joint is still off by {largest:.3g} m (accepted: {self.gap_left:.3g} m)"
        )

    def refuse_overlap(self, pose: Pose) -> None:
        """Raise _JointsOpen where a free block has come into another, contact points or not."""
        assembly, deepest = self.assembly, tolerances.OVERLAP * float(self.assembly.widths.min())
        for a, b, depth in zip(*assembly.shapes.overlaps(moved_vertices(assembly, pose), deepest), strict=True):
            if assembly.free[a] or assembly.free[b]:
                raise _JointsOpen(f"block '{assembly.names[a]}' came {depth:.3g} m into block '{assembly.names[b]}'")

    def follow(
        self, current: _Equilibrium, step: float, upper_bound: float, *, reported: bool
    ) -> Generator[Increment, None, tuple[Ending, Pose]]:
        """Follow the phase from an equilibrium, first with ``step``; return how and where it ended.

        No equilibrium is known at ``upper_bound``, which may be infinite. Of a fall its first motion is yielded.
        """
        phase, last = self.phase, current.s
        if not reported:
            yield self.increment(current, step, upper_bound)
        while current.s < phase.limit:
            target = self.driver.next_stop(current.s)
            enclosed = upper_bound - current.s <= self.tolerance
            to = upper_bound if enclosed else min(current.s + step, target, (current.s + upper_bound) / 2.0)
            to = target if target - to < 1e-9 * phase.increment else to
            length = to - current.s
            try:
                new = self.step_to(current, to)
            except _NoEquilibrium as error:
                upper_bound, step = to, length / 2.0
                if length <= self.tolerance and current.s <= last:
                    fall, collapse = self.collapse(current, upper_bound, error.solution)
                    yield fall
                    return collapse, current.pose
                failed = length <= self.tolerance
            except (SupportsLocked, _JointsOpen, SolveError) as error:
                step, locked = length / 2.0, isinstance(error, SupportsLocked) and length <= self.tolerance
                failed = locked or step < self.tolerance / 64.0
                if failed and current.s <= last:
                    stop = Status.LOCKED if locked else Status.SOLVER_FAILED
                    return Ending(stop, f"at a settlement of {current.s:.6g} {phase.unit}: {error}"), current.pose
            else:
                step, current, failed = min(2.0 * length, phase.increment), new, False
                upper_bound = np.inf if current.s >= upper_bound else upper_bound
            if current.s > last and (failed or current.s == target):
                # The last equilibrium is reported, too, and the step from it repeated, as a resumed path does.
                yield self.increment(current, step, upper_bound)
                last = current.s
        words = f"the settlement reached its limit of {phase.limit:g} {phase.unit}"
        return Ending(Status.LIMIT_REACHED, words), current.pose

    def increment(self, current: _Equilibrium, step: float, upper_bound: float) -> Increment:
        place = Place.unloaded(current.pose, current.s)
        checkpoint = PathState(self.number, self.start, place, step, upper_bound, reported=current.s)
        solution = self.reported(current.solution, current.s, current.reaction, Status.EQUILIBRIUM)
        return replace(solution, least=current.reaction, checkpoint=checkpoint)

    def reported(self, solution: ProgramSolution, s: float, reaction: float, status: Status) -> Increment:
        """Report a program, and how many were solved since the last report."""
        n, self.programs, proof = self.programs, 0, solution.certificate
        return Increment(s, reaction, self.number, 0.0, reaction, proof, status, n, 0.0, solution.state)

    def collapse(self, current: _Equilibrium, bound: float, solution: ProgramSolution) -> tuple[Increment, Ending]:
        """Give the fall and the collapse, from the program without equilibrium beyond the last one."""
        fall = self.reported(solution, bound, 0.0, Status.FALLING)
        bracket, motion = (current.s, bound), solution.state.velocity
        mechanism = motion / motion_size(motion, self.length).max()
        # Its joints are those of the last equilibrium, whose forces say what slides.
        at_last = with_motion(replace(fall, held=current.solution.state), mechanism)
        words = str(mechanism_of(self.assembly, at_last))
        collapse = Collapse(sum(bracket) / 2.0, bracket, current.reaction, mechanism, self.phase.unit, words)
        return fall, Ending(Status.COLLAPSED, str(collapse), collapse)


def linear_program_increments(
    model: Model, phases: Sequence[Settlement], resume: PathState | None
) -> Generator[Increment, None, Ending]:
    """Yield the increments of settlements in the plane by the paper's linear programs; return how they ended."""
    first, pose = (0, Pose.initial(model.assembly)) if resume is None else (resume.phase, resume.start)
    for number, phase in enumerate(phases[first:], start=first):
        path, reported = _Phase(model, phase, number, pose), resume is not None
        step, upper_bound = phase.increment, np.inf
        try:
            if resume is not None:
                s, pose, step, upper_bound = resume.place.s, resume.place.pose, resume.step, resume.upper_bound
                current, resume, path.programs = path.evaluate(s, pose), None, 0
            else:
                # Gaps and overlaps of the drawing, or of larger increments, are closed before anything moves.
                current = path.close_joints(0.0, pose, path.solve(pose, path.contacts(pose)))
        except _NoEquilibrium as error:
            yield path.reported(error.solution, 0.0, 0.0, Status.FALLING)
            return Ending(Status.NO_INITIAL_EQUILIBRIUM, no_equilibrium(model.assembly, error.solution.state.velocity))
        except (SupportsLocked, _JointsOpen, SolveError) as error:
            return Ending(Status.SOLVER_FAILED, f"before any settlement: {error}")
        ending, pose = yield from path.follow(current, step, upper_bound, reported=reported)
        if ending.stop is not Status.LIMIT_REACHED:
            return ending
    return ending
