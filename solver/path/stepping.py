"""One step of a path: linearisations of one convex program, friction bounds that follow the normal forces.

The bound B of a contact point is given within a step. After it, it has followed μ times the normal force over a length
ℓ of movement of the supports, as in Prakash & Clifton (1993) and Cochard & Rice (2000),
https://doi.org/10.1029/2000JB900230::

    dB/ds = (μ N - B) / ℓ

Within a step the bound is that at its end were the normal forces to stay, so that what it is wrong by is of second
order in the length of the step. Coulomb's law with the normal force of the same instant has several solutions where
many joints slide; this has one, and the limit of short steps exists.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from solver import tolerances
from solver.assembly import find_contacts
from solver.contact_step.minimise import minimise
from solver.contact_step.problem import ContactProblem, NotSolved
from solver.contact_step.stiffness import ContactRows
from solver.equilibrium import wrench_matrix
from solver.geometry.contacts import Contacts, joined_contacts, matched_contacts, successors
from solver.kinematics import Pose, moved, moved_vertices, point_velocities, put_together
from solver.program.model import Model
from solver.program.strength import ForceLimits
from solver.results.increment import Bonds
from solver.ties import TieForces, is_member

from .drivers import Driver
from .members import Members
from .mortar import JointPoints, Mortar
from .state import Place

#: Linearisations of a step at most.
LINEARISATIONS = 6

#: Error of the gaps that a linearisation predicts, in block sizes, up to which it is not repeated: where joints slide,
#: and where they only hinge.
EXACT_SLIDING, EXACT = 1e-6, 1e-8

#: Change of the load of a fill that has followed the blocks, in block weights, up to which a step is not repeated.
SAME_LOAD = 1e-5

#: Penetration, in block sizes, from which on a step is repeated with the points that it missed, and gap up to which
#: blocks touch as drawn.
LARGEST_PENETRATION = 1e-4

#: Part of its friction bound from which on a contact point slides.
SLIDES = 0.99

#: Normal force, in block weights, from which on a contact point carries.
CARRIES = 1e-3

#: Gap, in block sizes, at which half of the friction of a contact point is lost in a step.
OPEN = 1e-6

#: Times, in units of √(block size / g), in which what viscosity retards comes to rest at once, and in which what falls
#: hardly moves; movement, in block sizes, in which it has come to rest, and part by which one that creeps changes at
#: most; and steps after which it does not.
STANDSTILL, SHORT, STANDING, STEADY, STANDSTILLS = 1e3, 1e-3, 1e-7, 1e-4, 300

#: Lean [rad] from which blocks come back on joints and ground that carry them.
LEAN = 1e-5

#: Movement of the supports, in block sizes, in which their joints have given at the start of a settlement.
GIVEN = 1e-4

#: Damping of steps in time, in units of mass · √(g / block size): critical for a block that rocks.
DAMPING = 2.0


@dataclass(frozen=True)
class StepError:
    """Measures of the error of a step: the work in units of the program, all else in block sizes."""

    work: float  #: of friction by which bounds at the end of the step were not what was expected
    taken: float  #: work of friction, and of members, by the forces at the end of the step
    turn: float  #: change of the movement against that of the steps before
    moved: float  #: movement of the fastest block
    penetration: float  #: deepest at a contact point that carries
    is_linearised: bool  #: whether the last linearisation is as exact as is accepted


def viscous_weights(model: Model) -> np.ndarray:
    """(n_blocks, n_dof) array: weights, and weights times a radius of gyration squared, in units of the program."""
    assembly, d = model.assembly, model.dimension
    weight = np.linalg.norm(model.load[:, :d], axis=1) / model.force
    mean = max(float(assembly.masses[assembly.free].mean()), 1e-300)
    # Blocks without weight resist, too.
    weight = np.maximum(weight, 1e-3 * assembly.masses / mean)
    turning = weight * assembly.shapes.gyration / model.length**2
    return np.column_stack([weight] * d + [turning] * (len(model.lengths) - d))


@dataclass(frozen=True)
class _StepPoints:
    """The n contact points of a step, in units of the program."""

    start: Contacts  #: at the start of the step
    forces: np.ndarray  #: (n, d)
    trial: np.ndarray  #: (n, d)
    followed: np.ndarray  #: (n,)
    expected: np.ndarray  #: (n,): normal forces of the friction bounds at the end, were all normal forces to stay
    is_new: np.ndarray  #: (n,) bool
    friction: np.ndarray  #: (n,)
    compliance: np.ndarray  #: (n, d)
    joints: JointPoints
    kept: np.ndarray  #: (n,): part of the give under the normal force that the next linearisation takes back

    @property
    def bound(self) -> np.ndarray:
        """(n,) array: largest shear forces; lost strength takes with it the tension that friction still followed."""
        followed = np.maximum(self.expected, -self.joints.tension)
        return np.asarray(np.maximum(self.friction * followed + self.joints.cohesion, 0.0))

    @property
    def pulled(self) -> np.ndarray:
        """(n, d) array: the tension; the program is that of the normal forces beyond it."""
        return self.joints.tension[:, None] * np.eye(self.forces.shape[1])[0]

    def moved(self, trial: np.ndarray) -> np.ndarray:
        """(n, 2) array: opening beyond the largest tension and slip beyond the bound that trial forces say."""
        beyond = np.column_stack([-trial[:, 0], np.linalg.norm(trial[:, 1:], axis=1) - self.bound])
        return np.maximum(beyond * self.compliance[:, :2], 0.0)


class Stepper:
    """Steps from one place to another under a driver; counts the programs solved since the last increment."""

    def __init__(self, model: Model, driver: Driver) -> None:
        self.model, self.driver, self.members = model, driver, Members(model)
        self.mortar = Mortar(model)
        self.free = model.assembly.free
        self.weights = viscous_weights(model)
        # What turns moves its corners against each other by its own width at most, however large the others are.
        assembly, d = model.assembly, model.dimension
        arms = np.linalg.norm(assembly.vertices - assembly.centroids[assembly.block_of_vertex], axis=1)
        across = 2.0 * np.maximum.reduceat(arms, assembly.shapes.offsets[:-1])
        turning = np.minimum(across[self.free] / model.length, 1.0)
        self._shares = np.column_stack([np.ones_like(turning)] * d + [turning] * (model.n_dof - d)).ravel()
        self.unit = model.length / driver.lever(model)
        self.programs = 0
        # Contact points with a larger gap are not looked at.
        reach = model.length / 4.0
        # Of blocks at the last two poses: a step goes on from one or is taken anew.
        self.contacts: Callable[[Pose], Contacts] = lru_cache(2)(
            lambda pose: model.standing(find_contacts(assembly, moved_vertices(assembly, pose), reach))
        )
        support_motion = driver.rate(0.0)[assembly.moving, :d]
        # Of motions that cancel, rounding would choose a direction of the sum.
        sense = support_motion.sum(axis=0) / max(float(np.linalg.norm(support_motion, axis=1).sum()), 1e-300)
        self.imperfection = np.zeros_like(model.load)
        self.imperfection[:, :d] = model.imperfection * tolerances.IMPERFECTION * self.weights[:, :1] * sense
        self.imperfection[model.fallen] = 0.0

    def unloaded(
        self, pose: Pose, phase: int, ties_at: TieForces | None = None, bonds_at: Bonds | None = None
    ) -> Place:
        """Return the place of a pose without forces, with the members of a phase, from 0, and all joints whole."""
        place = self.members.installed(Place.unloaded(pose), phase, ties_at)
        if bonds_at is None:
            return self.mortar.cast(place, self.contacts(pose))
        return self.mortar.kept(place, self.contacts_at(place), bonds_at)

    def contacts_at(self, place: Place) -> Contacts:
        """Return the contact points at a place, those of members last."""
        found, before = self.contacts(place.pose), place.contacts
        if self.model.interfaces.elastic and before is not None and len(before):
            # A corner that is pressed into what gives is deeper behind the edge than blocks are otherwise.
            pressed = before[(place.forces[:, 0] > 0.0) & ~is_member(before)]
            pressed = self.measured(pressed[~matched_contacts(pressed, found)[1]], place.pose, place.tie_lengths)
            thinner = self.model.assembly.widths[[pressed.block_a, pressed.block_b]].min(axis=0)
            found = joined_contacts([found, pressed[pressed.gaps < -tolerances.PENETRATION_FRACTION * thinner]])
        return self.members.beside(found, place.pose, place.tie_lengths)

    def measured(self, contacts: Contacts, pose: Pose, tie_lengths: np.ndarray) -> Contacts:
        """Return the same contact points at another pose, with ties of these lengths."""
        vertices, members = moved_vertices(self.model.assembly, pose), is_member(contacts)
        if not members.any():
            return self.model.assembly.shapes.measure(vertices, contacts)
        of_blocks = self.model.assembly.shapes.measure(vertices, contacts[~members])
        return joined_contacts([of_blocks, self.members.measured(contacts[members], pose, tie_lengths)])

    def friction(self, contacts: Contacts) -> np.ndarray:
        """(n,) array: friction coefficients."""
        friction = self.model.interfaces.friction(self.model.assembly, contacts.block_a, contacts.block_b)
        return np.where(is_member(contacts), 0.0, friction)

    def compliance(self, contacts: Contacts, joints: JointPoints) -> np.ndarray:
        """(n, d) array: that of joints and members, in units of the program."""
        members = is_member(contacts)
        compliance = self.joint_compliance(contacts, self.model.compliance) + joints.give
        compliance[members, 0] = self.members.compliance[contacts.features[members, 1]]
        return compliance

    def force_limits(self, place: Place, contacts: Contacts, gap: float) -> tuple[np.ndarray, ForceLimits]:
        """Which contact points at its pose may carry, (n,) bool array, and the limits of their forces.

        Those between blocks do up to a gap, in block sizes, beyond the give of their joints.
        """
        gaps, least, cohesion = self.joint_limits(place, contacts)
        members, is_open = is_member(contacts), gaps > gap * self.model.length
        # An open joint with a rest of its strength holds, and does not push.
        most = np.where((least < 0.0) & is_open, 0.0, np.inf)
        least[members], most[members] = self.members.force_range(contacts[members], gap)
        carries = ~is_open | (least != 0.0) | np.isfinite(most)
        return carries, ForceLimits(least, most, cohesion)

    def joint_limits(
        self, place: Place, contacts: Contacts, forces: np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Gaps [m] beyond the give of joints under forces, or without, and least normal forces and their cohesion."""
        joints, friction = self.mortar.points(place, contacts), self.friction(contacts)
        gaps = joints.beyond_give(contacts.gaps, 0.0 if forces is None else forces[:, 0])
        return gaps, -joints.tension, np.maximum(joints.cohesion - friction * joints.tension, 0.0)

    @staticmethod
    def joint_compliance(contacts: Contacts, factor: float = 1.0) -> np.ndarray:
        """(n, d) array: factor times the joint's, shared over its contact points by area, in units of the program."""
        n, d = contacts.points.shape
        pairs, joint = contacts.joints()
        joint_area = np.bincount(joint, contacts.areas, len(pairs))[joint]
        share = np.divide(contacts.areas, joint_area, out=np.full(n, 0.5), where=joint_area > 0.0)
        of_joint = factor * np.array([tolerances.COMPLIANCE] + [tolerances.SHEAR_COMPLIANCE] * (d - 1))
        # Points of tiny tributary areas keep a finite compliance, however many share the joint.
        least = np.minimum(0.05, 1.0 / np.bincount(joint)[joint])
        return of_joint / np.maximum(share, least)[:, None]

    def transferred(self, place: Place, contacts: Contacts) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Forces, trial forces and followed normal forces of a place at these contact points, and which are new.

        A corner that passes the end of an edge makes another contact point: the one that vanishes passes its forces to
        the nearest one of the same two blocks.
        """
        n, d = contacts.points.shape
        before = place.contacts
        if before is None or not n or not len(before):
            touches = np.where(contacts.gaps < LARGEST_PENETRATION * self.model.length, 1.0, -1.0)
            return np.zeros((n, d)), touches[:, None] * np.eye(d)[0], np.zeros(n), np.ones(n, dtype=bool)
        number, same = matched_contacts(contacts, before)
        forces = np.where(same[:, None], place.forces[number], 0.0)
        followed = np.where(same, place.followed[number], 0.0)
        trial = np.where(same[:, None], place.trial[number], -np.eye(d)[0])
        _, kept = matched_contacts(before, contacts)
        vanished = np.flatnonzero(~kept & ~is_member(before) & ((place.forces[:, 0] != 0.0) | (place.followed > 0.0)))
        is_new = ~same
        if len(vanished):
            vanished, successor, part = successors(before, vanished, contacts, self.model.length)
            sense = np.where(before.block_a[vanished] == contacts.block_a[successor], 1.0, -1.0)
            vectors = np.einsum("nji,nj->ni", before.frames[vanished], place.forces[vanished]) * sense[:, None]
            passed = np.einsum("nij,nj->ni", contacts.frames[successor], vectors)
            passed[:, 0] = np.maximum(passed[:, 0], np.minimum(place.forces[vanished, 0], 0.0) * self.mortar.present)
            np.add.at(forces, successor, part[:, None] * passed)
            trial[successor] = forces[successor]
            np.add.at(followed, successor, part * place.followed[vanished])
            is_new[successor] = False
        return forces, trial, followed, is_new

    def step(
        self,
        place: Place,
        length: float,
        *,
        in_time: bool = False,
        viscosity: float = 1.0,
        exact: bool = False,
        candidates: Contacts | None = None,
    ) -> tuple[Place, np.ndarray, StepError]:
        """Take one step of the driver, or one in time with the supports at rest; raises ``NotSolved``.

        Gives the place, the motion, (n_blocks, n_dof) in units of the program with that of the supports, and the error.

        Parameters
        ----------
        length : float [m or rad]
            In time in units of √(block size / g).
        in_time : bool
            The supports are fixed, and blocks out of balance move against their inertia: M/h² for the viscosity.
        viscosity : float
            Times the model's; and the imperfection times the model's.
        exact : bool
            Where nothing slides, all that joints give is taken back in this step, and nothing of it left to the next.
        candidates : Contacts, optional
            Contact points of the step; by default those at the place.
        """
        model, free = self.model, self.free
        # A step in time is solved to a small part of such a movement.
        s, size = (place.s, 1e-3) if in_time else (place.s + length, length / self.unit)
        place = self.members.without_broken(place)
        start = self.contacts_at(place) if candidates is None else candidates
        place = self.mortar.renamed(place, start)
        # A larger share alternates where the normal force falls as the bound grows.
        memory = min(tolerances.FRICTION_MEMORY, max(s / self.unit, size))
        share = 0.9 if in_time else min(0.5, size / (size + memory))
        points = self._points(place, start, share)
        joints, loads = points.joints, 0.0 if in_time else viscosity
        resisting, before = self._resistance(place, length, in_time, viscosity)
        where_sliding = np.inf if in_time or viscosity == 1.0 else EXACT_SLIDING
        closed = (where_sliding, EXACT if exact else np.inf)
        solved = self._solved(place, points, s, size, loads, resisting, before, closed)
        new, points, left, movement, is_linearised = solved
        movement_size = self._largest(movement * self._shares)
        all_points = self._with_missed(start, place, new.pose, movement_size)
        if len(all_points) > len(start):
            return self.step(place, length, in_time=in_time, viscosity=viscosity, exact=exact, candidates=all_points)
        motion = np.where(free[:, None], self._of_blocks(movement), place.pose.movement_to(new.pose))
        velocity = motion / length if in_time else self._velocity(place, motion, length)
        new = self._arrived(place, replace(new, velocity=velocity, works=place.works), points, left, share)
        memory = tolerances.FRICTION_MEMORY if model.has_live else memory
        works = self._works(points, new, joints.cohesion - left.cohesion, size, memory)
        # The first step has no earlier movement to compare with.
        turn = (in_time or place.velocity is not None) * self._largest((movement - before) * self._shares)
        penetration = self._penetration(points, new)
        return new, motion / model.lengths, StepError(*works, turn, movement_size, penetration, is_linearised)

    def gives(self, place: Place) -> bool:
        """Whether joints of given stiffness carry at a place: they move where their forces change."""
        elastic = self.model.interfaces.elastic
        return elastic and bool((self.mortar.points(place, self.contacts_at(place)).give > tolerances.COMPLIANCE).any())

    def standing(self, place: Place) -> Place | None:
        """The place once the supports have stood still, as joints of given stiffness give; None where it moves away."""
        if not self.gives(place):
            return place
        still, time, so_far, before = place, STANDSTILL, 0.0, 0.0
        for _ in range(STANDSTILLS):
            try:
                still, _, error = self.step(replace(still, velocity=None), time, in_time=True, exact=True)
            except NotSolved:
                time /= 10.0
                if time < SHORT:
                    break
                continue
            # What leans on them moves by a part of the movement before in each step, or by more, and falls.
            so_far += error.moved
            # What creeps by as much each time is out of balance by what programs are solved to.
            creeps = error.moved < tolerances.CLOSING_GAP and abs(error.moved - before) < STEADY * before
            if time == STANDSTILL and (error.moved < STANDING or creeps):
                return replace(still, velocity=place.velocity)
            before = error.moved
            if so_far > tolerances.FARTHEST_FALL:
                break
            time = min(10.0 * time, STANDSTILL)
        return None

    def is_stable(self, place: Place) -> bool:
        """Whether blocks that lean a little about their supports come to rest nearby where joints or ground give."""
        if not self.gives(place):
            return True
        positions, n, d = place.pose.positions, len(self.free), self.model.dimension
        lean = np.append(np.zeros(d), np.full(self.model.n_dof - d, LEAN))[None]
        about = Pose(positions[~self.free].mean(axis=0)[None], lean[:, d:])
        turning = point_velocities(positions, np.zeros(n, dtype=np.int64), about, lean)
        motion = np.column_stack([turning, np.repeat(lean[:, d:], n, axis=0)])
        leaning = put_together(self.free & ~self.model.fallen, moved(place.pose, motion), place.pose)
        still = self.standing(replace(place, pose=leaning))
        # Friction that the lean has taken from joints lets them shift.
        return (
            still is not None
            and self._largest(place.pose.movement_to(still.pose) / self.model.lengths) < tolerances.JUMP
        )

    def _solved(
        self,
        place: Place,
        points: _StepPoints,
        s: float,
        size: float,
        loads: float,
        resisting: np.ndarray,
        before: np.ndarray,
        closed: tuple[float, float],
    ) -> tuple[Place, _StepPoints, JointPoints, np.ndarray, bool]:
        """The place at the end of a step, before joints and members have given, and the movement (n_dof,) to it.

        Also its contact points with the joints by which it is solved, these joints after it, and whether the last
        linearisation is as exact as is accepted.
        """
        model, driver, free, start, joints = self.model, self.driver, self.free, points.start, points.joints
        forces, supports = points.forces, driver.supports(s)
        guess: np.ndarray | None = points.trial
        before_step = np.column_stack([points.kept * forces[:, 0], forces[:, 1:]])
        # Linearised where blocks come to that go on as before: what that is wrong by, not all they move, is squared.
        # In time, what lands would be behind what it lands on.
        motion_so_far = before if loads > 0.0 else np.zeros_like(before)
        pose = put_together(free, moved(place.pose, self._of_blocks(motion_so_far)), supports)
        contacts = self.measured(start, pose, place.tie_lengths)
        load, (live, live_size) = self._load(pose, loads), model.scaled_live(pose)
        multiplier, number, members = place.multiplier * live_size, 0, is_member(start)
        while True:
            rows = ContactRows(wrench_matrix(contacts, pose, model.length), free, model.assembly.centroids)
            control = driver.control(pose) if model.has_live else None
            bound, compliance = self.members.across(
                contacts, place.tie_lengths, forces, points.bound, points.compliance
            )
            problem = ContactProblem(
                rows=rows,
                gap=joints.beyond_give(contacts.gaps) / model.length,
                slip=(contacts.slip - start.slip) / model.length,
                # Gaps are absolute, so that the give across a joint is taken back; slip counts from the step's start.
                forces=before_step + points.pulled,
                bound=bound,
                compliance=compliance,
                most=self.members.largest_forces(start),
                load=load + resisting * before - rows.resultant(points.pulled),
                viscosity=resisting,
                motion_so_far=motion_so_far,
                size=size,
                live=live[free].ravel() if control is not None else None,
                control=None if control is None else (control * model.lengths / model.length)[free].ravel(),
                control_target=0.0 if control is None else (s - driver.control_displacement(pose)) / model.length,
            )
            self.programs += 1
            solution = minimise(problem, guess, multiplier)
            forces, multiplier = solution.forces - points.pulled, solution.multiplier
            guess = trial = solution.trial
            # Where they have turned to, members have forces along them only.
            forces[members, 1:] = trial[members, 1:] = 0.0
            # A linearised rotation makes blocks grow: the first linearisation's forces are not kept.
            if number:
                before_step[:, 0] = points.kept * forces[:, 0]
            motion_so_far = motion_so_far + solution.motion
            pose = put_together(free, moved(place.pose, self._of_blocks(motion_so_far)), supports)
            predicted = problem.gap + rows.relative(solution.motion)[:, 0]
            contacts = self.measured(start, pose, place.tie_lengths)
            acting = load + multiplier * live[free].ravel()
            load, (live, _) = self._load(pose, loads), model.scaled_live(pose)
            residual = max(
                self._linearisation_error(contacts, predicted, forces, points, closed),
                self._largest(load + multiplier * live[free].ravel() - acting) / SAME_LOAD,
                0.0 if control is None else abs(s - driver.control_displacement(pose)) / model.length / EXACT,
            )
            number += 1
            if number < LINEARISATIONS and residual > 1.0:
                continue
            # What breaks hands its forces to the others in the same step, from where they are.
            left = points.joints.after(points.moved(trial), joints)
            if not ((left.left == 0.0) & (points.joints.left > 0.0)).any():
                new = Place(s, pose, contacts, forces, trial, points.followed, multiplier / (live_size or 1.0))
                return new, points, left, motion_so_far, residual <= 1.0
            points, guess, number = replace(points, joints=left), None, 0

    def _of_blocks(self, motion: np.ndarray) -> np.ndarray:
        """(n_blocks, n_dof) array [m or rad]: a movement (n_dof,) of the free blocks in units of the program."""
        full = np.zeros_like(self.model.load)
        full[self.free] = motion.reshape(-1, full.shape[1]) * self.model.lengths
        return full

    def _arrived(self, place: Place, new: Place, points: _StepPoints, left: JointPoints, share: float) -> Place:
        """The new place with what its points, joints and members have become."""
        contacts, normal, followed = new.contacts, new.forces[:, 0], points.followed
        assert contacts is not None
        # In a joint that opens friction vanishes sooner.
        gap = np.maximum(left.beyond_give(contacts.gaps, normal), 0.0)
        shares = np.maximum(share, gap / (gap + OPEN * self.model.length))
        # New contact points have the friction of their normal force at once.
        after = np.where(points.is_new, normal, followed + shares * (normal - followed))
        lengths = self.members.after(contacts, new.trial, place.tie_lengths)
        bonds = self.mortar.bonds(place, points.start, left.left)
        return replace(new, followed=after, tie_lengths=lengths, bonds=bonds)

    def _works(
        self, points: _StepPoints, new: Place, lost: np.ndarray, size: float, memory: float
    ) -> tuple[float, float]:
        """Works of friction bounds that are not what was expected, and of lost cohesion (n,); and of friction."""
        assert new.contacts is not None
        slip, closed = new.contacts.slip - points.start.slip, new.contacts.gaps - points.start.gaps
        taken = (new.forces[:, 1:] * (slip / self.model.length)).sum()
        taken += (new.forces[:, 0] * (closed / self.model.length))[is_member(points.start)].sum()
        # What slips faster than the supports move does so however short the step is.
        slid = np.minimum(np.linalg.norm(slip, axis=1) / self.model.length, size)
        change = np.where(points.is_new, 0.0, points.friction * (new.followed - points.expected)) - lost
        # What the points of one joint hand to each other does not change its friction.
        works = np.bincount(new.contacts.joints()[1], change * slid)
        # Differences of friction grow while bounds follow, by e in a step as long as the memory; longer ones miss that.
        # What errs to one side counts whole, but for friction of the limit load that pushovers begin with and lose at
        # once; of the rest, half, as bounds depart in the course of the step, and half of that cancels.
        one_sided = 0.0 if self.model.has_live else abs(float(works.sum()))
        in_error = (1.0 + size / memory) ** 3 * max(0.25 * float(np.abs(works).sum()), one_sided)
        return in_error, -float(taken)

    def _penetration(self, points: _StepPoints, new: Place) -> float:
        """Deepest penetration where blocks carry, in block sizes, from gaps without the give that stays."""
        assert new.contacts is not None
        gap = points.joints.beyond_give(new.contacts.gaps, new.forces[:, 0])
        touches = (new.forces[:, 0] > CARRIES) & ~is_member(new.contacts)
        return -float(gap[touches].min(initial=0.0)) / self.model.length

    def _points(self, place: Place, start: Contacts, share: float) -> _StepPoints:
        """The contact points of a step from a place."""
        forces, trial, followed, is_new = self.transferred(place, start)
        joints, friction = self.mortar.points(place, start), self.friction(start)
        compliance = self.compliance(start, joints)
        # The give of elastic joints and members stays.
        kept = np.where(is_member(start), 0.0, 1.0 - joints.give[:, 0] / compliance[:, 0])
        # Not all of it in long steps, which would alternate sooner.
        expected = followed + max(0.0, 1.0 - 2.0 * share) * share * (forces[:, 0] - followed)
        return _StepPoints(start, forces, trial, followed, expected, is_new, friction, compliance, joints, kept)

    @staticmethod
    def _largest(values: np.ndarray) -> float:
        return float(np.abs(values).max(initial=0.0))

    def _linearisation_error(
        self,
        contacts: Contacts,
        predicted: np.ndarray,
        forces: np.ndarray,
        points: _StepPoints,
        closed: tuple[float, float],
    ) -> float:
        """Errors of the gaps of contact points that carry, and of what was predicted of them, over what is accepted."""
        gap = points.joints.beyond_give(contacts.gaps) / self.model.length
        carries = np.abs(forces[:, 0]) > CARRIES
        touches = carries & ~is_member(contacts)
        slides = touches & (forces[:, 0] > 0.0) & (np.linalg.norm(forces[:, 1:], axis=1) >= SLIDES * points.bound)
        exact, most = (EXACT_SLIDING, closed[0]) if slides.any() else (EXACT, closed[1])
        apart = (gap + points.joints.give[:, 0] * forces[:, 0])[touches]
        return max(self._largest(apart) / most, self._largest((gap - predicted)[carries]) / exact)

    def _load(self, pose: Pose, imperfection: float) -> np.ndarray:
        """(n_free n_dof,) array: loads on the free blocks at a pose, with so many times the imperfection."""
        return (self.model.scaled_load_at(pose) + imperfection * self.imperfection)[self.free].ravel()

    def _resistance(
        self, place: Place, length: float, in_time: bool, viscosity: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """(n_dof,) arrays: force per movement by viscosity or inertia, and the movement that has none of it."""
        weights, kept = self.weights[self.free].ravel(), 1.0
        # It is beyond the velocity that blocks had.
        resisting = tolerances.VISCOSITY * viscosity * self.unit / length * weights
        if in_time:
            resisting, kept = (1.0 / length**2 + DAMPING / length) * weights, 1.0 / (1.0 + DAMPING * length)
        if place.velocity is None:
            return resisting, np.zeros_like(resisting)
        return resisting, kept * (place.velocity / self.model.lengths * length)[self.free].ravel()

    def _velocity(self, place: Place, motion: np.ndarray, length: float) -> np.ndarray:
        """(n_blocks, n_dof) array: velocity after a step, averaged with those before."""
        before = np.zeros_like(motion) if place.velocity is None else place.velocity
        # What joints give at first is no velocity, and a pushover begins with the mechanism of its limit load.
        begun = place.s >= GIVEN * self.unit and not self.model.has_live
        memory = min(tolerances.VELOCITY_MEMORY * self.unit, place.s if begun else np.inf)
        return before + (motion - length * before) / (length + memory)

    def _with_missed(self, stepped: Contacts, before: Place, pose: Pose, movement_size: float) -> Contacts:
        """Contact points of a step with those that it has missed, where they were: at its end a corner is in a block.

        Raises ``NotSolved`` where that corner was behind the edge already, or the step had its contact point.
        """
        if movement_size <= LARGEST_PENETRATION:
            return stepped
        end = self.contacts(pose)
        earlier, is_stepped = np.zeros(len(end)), np.zeros(len(end), dtype=bool)
        if len(end) and len(stepped):
            number, is_stepped = matched_contacts(end, stepped)
            earlier = np.where(is_stepped, np.minimum(stepped.gaps[number], 0.0), 0.0)
        deepest = -LARGEST_PENETRATION * self.model.length
        deep = end.gaps - earlier < deepest
        if self.model.interfaces.elastic:
            # In an elastic joint corners come closer as its force grows.
            deep &= self.mortar.points(before, end).give[:, 0] == 0.0
        found = self.model.assembly.shapes.measure(moved_vertices(self.model.assembly, before.pose), end[deep])
        if is_stepped[deep].any() or (found.gaps < deepest).any():
            failure = NotSolved("a corner comes into a block from the side")
            failure.moved = movement_size
            raise failure
        if not len(found):
            return stepped
        members = is_member(stepped)
        return joined_contacts([stepped[~members], found, stepped[members]])
