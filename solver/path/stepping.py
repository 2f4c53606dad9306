"""One step of a path: linearisations of one convex program, friction bounds that follow the normal forces.

The bound B of a contact point is given within a step. After it, it has followed μ times the normal force over a length
ℓ of movement of the supports, as in Prakash & Clifton (1993) and Cochard & Rice (2000),
https://doi.org/10.1029/2000JB900230::

    dB/ds = (μ N - B) / ℓ

Coulomb's law with the normal force of the same instant has several solutions where many joints slide; this has one, and
the limit of short steps exists.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from solver.assembly import find_contacts, measure_contacts
from solver.contact_step.minimise import minimise
from solver.contact_step.problem import ContactProblem, NotSolved
from solver.contact_step.stiffness import ContactRows
from solver.equilibrium import wrench_matrix
from solver.geometry.contacts import Contacts, joined_contacts, matched_contacts
from solver.kinematics import Pose, moved, moved_vertices
from solver.program.model import Model
from solver.tolerances import (
    COMPLIANCE,
    FRICTION_MEMORY,
    IMPERFECTION,
    SHEAR_COMPLIANCE,
    VELOCITY_MEMORY,
    VISCOSITY,
)

from .drivers import Driver
from .state import Place

#: Geometries at which a step is linearised, at most; normal force from which on a contact point carries, in block
#: weights; what a linearisation did not foresee of the gaps of carrying points, in block sizes, up to which it is not
#: repeated, where joints slide and where they only hinge; where a collapse is enclosed the last counts for gaps, too.
LINEARISATIONS, CARRIES, EXACT_SLIDING, EXACT = 6, 1e-3, 1e-6, 1e-8

#: Penetration, in block sizes, at which a step is refused.
UNSEEN = 1e-4

#: Contact points of two blocks no farther apart than this, in block sizes, are one, by whichever corner and edge; those
#: whose distances differ by less than the second are alike.
SAME_PLACE, ALIKE = 1e-2, 1e-6

#: As drawn, what is no farther apart than this, in block sizes, touches.
TOUCHES = 1e-4

#: A point slides from this part of its friction bound on.
SLIDES = 0.99

#: Part of the way to μ N that a friction bound follows in a step at most: more goes to and fro where the normal force
#: falls as the bound grows. And in a step in time.
AT_ONCE = 0.5
IN_TIME = 0.9

#: Gap, in block sizes, at which half the friction that a contact point remembers is lost in a step.
OPEN = 1e-6

#: Damping of steps in time, in units of mass · √(g / block size): critical for a block that rocks.
DAMPING = 2.0

#: Movement, in block sizes, that the program of a step in time is solved to a small part of.
SMALL = 1e-3

#: Least part of a joint that a contact point stands for.
LEAST_SHARE = 0.05

#: Least weight that resists a movement, as a part of a block's mass over the mean: what weighs nothing resists, too.
LEAST_WEIGHT = 1e-3


class Unseen(NotSolved):
    """Blocks came into each other where the step saw no contact point, in a movement of so many block sizes."""

    def __init__(self, moved: float) -> None:
        super().__init__("a corner comes into a block from the side")
        self.moved = moved


@dataclass(frozen=True)
class StepError:
    """What a step says of its length.

    Attributes
    ----------
    lag : float
        Change of the friction bounds of sliding points, in weights of the structure.
    turn : float
        Change of the movement against that of the steps before, in block sizes.
    moved : float
        Movement of the fastest block, in block sizes.
    pressed : float
        Deepest penetration at a contact point that carries, in block sizes.
    """

    lag: float
    turn: float
    moved: float
    pressed: float


def viscous_weights(model: Model) -> np.ndarray:
    """(n_blocks, n_dof) array: weights, and weights times a radius of gyration squared, in units of the program."""
    assembly, d = model.assembly, model.dimension
    weight = np.linalg.norm(model.load[:, :d], axis=1) / model.force
    mean = max(float(assembly.masses[assembly.free].mean()), 1e-300)
    weight = np.maximum(weight, LEAST_WEIGHT * assembly.masses / mean)
    turning = weight * assembly.shapes.gyration / model.length**2
    return np.column_stack([weight] * d + [turning] * (len(model.lengths) - d))


class Stepper:
    """Steps from one place to another under a driver.

    Parameters
    ----------
    model : Model
        Units, loads, interfaces.
    driver : Driver

    Attributes
    ----------
    programs : int
        Solved since the last increment.
    """

    def __init__(self, model: Model, driver: Driver) -> None:
        self.model, self.driver = model, driver
        self.free = model.assembly.free
        self.weights = viscous_weights(model)
        self.weight = float(np.linalg.norm(model.scaled_load[self.free, : model.dimension].sum(axis=0)))
        self.lever = driver.lever()
        self.unit = model.length / self.lever
        self.programs = 0
        self._seen: tuple[Pose, Contacts] | None = None
        d = model.dimension
        sideways = driver.rate(0.0)[model.assembly.moving, :d].sum(axis=0)
        size = float(np.linalg.norm(sideways))
        self.imperfection = np.zeros_like(model.load)
        if size > 0.0:
            imperfection = model.imperfection * IMPERFECTION
            self.imperfection[:, :d] = imperfection * self.weights[:, :1] * sideways / size

    def contacts(self, pose: Pose) -> Contacts:
        """Return the contact points at a pose; those at the last one asked for are remembered."""
        if self._seen is None or self._seen[0] is not pose:
            model = self.model
            found = find_contacts(model.assembly, moved_vertices(model.assembly, pose), model.reach)
            if model.fallen is not None:
                found = found[~(model.fallen[found.block_a] | model.fallen[found.block_b])]
            self._seen = pose, found
        return self._seen[1]

    def friction(self, contacts: Contacts) -> np.ndarray:
        """(n,) array: friction coefficients."""
        return self.model.interfaces.friction(self.model.assembly, contacts.block_a, contacts.block_b)

    @staticmethod
    def compliance(contacts: Contacts, factor: float = 1.0) -> np.ndarray:
        """(n, d) array: factor times the joint's, shared over its contact points by area, in units of the program."""
        n, d = contacts.points.shape
        pairs, joint = contacts.joints()
        whole = np.bincount(joint, contacts.areas, len(pairs))[joint]
        share = np.divide(contacts.areas, whole, out=np.full(n, 0.5), where=whole > 0.0)
        of_joint = factor * np.array([COMPLIANCE] + [SHEAR_COMPLIANCE] * (d - 1))
        return of_joint / np.clip(share, LEAST_SHARE, 1.0)[:, None]

    def remembered(self, place: Place, contacts: Contacts) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Forces, trial forces, followed normal forces, and which points are new, at these contact points.

        A corner that passes the end of an edge gives a contact point another name: the lost point hands its forces on
        to another one of the same two blocks at the same place, which may be new.
        """
        n, d = contacts.points.shape
        before = place.contacts
        if before is None or not n or not len(before):
            touches = np.where(contacts.gaps < TOUCHES * self.model.length, 1.0, -1.0)
            return np.zeros((n, d)), touches[:, None] * np.eye(d)[0], np.zeros(n), np.ones(n, dtype=bool)
        number, same = matched_contacts(contacts, before)
        forces, followed = (
            np.where(same[:, None], place.forces[number], 0.0),
            np.where(same, place.followed[number], 0.0),
        )
        trial = np.where(same[:, None], place.trial[number], -np.eye(d)[0])
        _, kept = matched_contacts(before, contacts)
        lost = np.flatnonzero(~kept & ((place.forces[:, 0] > 0.0) | (place.followed > 0.0)))
        fresh = ~same
        if len(lost):
            apart = np.linalg.norm(before.points[lost][:, None] - contacts.points[None], axis=2)
            one, other = (
                np.sort(np.stack([c.block_a[k], c.block_b[k]], axis=1), axis=1)
                for c, k in ((before, lost), (contacts, slice(None)))
            )
            apart = np.where((one[:, None] == other[None]).all(axis=2), apart, np.inf)
            least = apart.min(axis=1)
            near = (apart <= least[:, None] + ALIKE * self.model.length) & (apart < SAME_PLACE * self.model.length)
            # What lies at one place shares alike, lest the order of the points decide.
            row, heir = np.nonzero(near)
            part, lost = 1.0 / near.sum(axis=1)[row], lost[row]
            sense = np.where(before.block_a[lost] == contacts.block_a[heir], 1.0, -1.0)
            vectors = np.einsum("nji,nj->ni", before.frames[lost], place.forces[lost]) * sense[:, None]
            handed = np.einsum("nij,nj->ni", contacts.frames[heir], vectors)
            handed[:, 0] = np.maximum(handed[:, 0], 0.0)
            np.add.at(forces, heir, part[:, None] * handed)
            trial[heir] = forces[heir]
            np.add.at(followed, heir, part * place.followed[lost])
            fresh[heir] = False
        return forces, trial, followed, fresh

    def step(
        self,
        place: Place,
        length: float,
        *,
        in_time: bool = False,
        viscosity: float = 1.0,
        among: Contacts | None = None,
    ) -> tuple[Place, np.ndarray, StepError]:
        """Take one step of the driver, or one in time with the supports at rest.

        Parameters
        ----------
        place : Place
        length : float [m or rad]
            In time in units of √(block size / g).
        in_time : bool
            The driver stands still, and what is not in equilibrium moves against its inertia: M/h² for the viscosity.
        viscosity : float
            Times the model's; and the imperfection times the model's.
        among : Contacts, optional
            Contact points that the step has to see; by default those at the place.

        Returns
        -------
        place : Place
        motion : (n_blocks, n_dof) array
            In units of the program; supports included.
        error : StepError

        Raises
        ------
        NotSolved
        """
        model, assembly, driver, free = self.model, self.model.assembly, self.driver, self.free
        scales, n_dof = model.lengths, len(model.lengths)
        s, size = (place.s, SMALL) if in_time else (place.s + length, length / self.unit)
        supports = driver.supports(s)
        start = self.contacts(place.pose) if among is None else among
        forces, trial, followed, fresh = self.remembered(place, start)
        friction, compliance = self.friction(start), self.compliance(start, model.compliance)
        bound = friction * followed
        resisting, before = self._resistance(place, length, in_time, viscosity)
        load = (model.scaled_load + (0.0 if in_time else viscosity) * self.imperfection)[free].ravel()
        closed = np.inf if in_time or viscosity == 1.0 else EXACT
        live, live_size = model.scaled_live
        multiplier = place.multiplier * live_size
        motion_so_far, normal, shear = np.zeros_like(load), forces[:, 0], forces[:, 1:]
        pose = self._with_supports(place.pose, supports)
        contacts = measure_contacts(assembly, moved_vertices(assembly, pose), start)
        for number in range(LINEARISATIONS):
            rows = ContactRows(wrench_matrix(contacts, pose, model.length), free)
            control = driver.control(pose) if model.live is not None else None
            problem = ContactProblem(
                rows=rows,
                gap=contacts.gaps / model.length,
                slip=(contacts.slip - start.slip) / model.length,
                # Gaps are absolute, so that the give across a joint is taken back; slip counts from the step's start.
                forces=np.column_stack([normal, shear]),
                bound=bound,
                compliance=compliance,
                load=load + resisting * before,
                viscosity=resisting,
                motion_so_far=motion_so_far,
                size=size,
                live=live[free].ravel() if control is not None else None,
                control=None if control is None else (control * scales / model.length)[free].ravel(),
                wanted=0.0 if control is None else (s - driver.gone(pose)) / model.length,
            )
            self.programs += 1
            found = minimise(problem, trial, multiplier)
            forces, trial, multiplier = found.forces, found.trial, found.multiplier
            # A turn by the first linearisation makes blocks grow: what that presses is not remembered.
            normal = forces[:, 0] if number else normal
            motion_so_far = motion_so_far + found.motion
            full = np.zeros((assembly.n_blocks, n_dof))
            full[free] = motion_so_far.reshape(-1, n_dof) * scales
            pose = self._with_supports(moved(place.pose, full), supports)
            foreseen = problem.gap + rows.relative(found.motion)[:, 0]
            contacts = measure_contacts(assembly, moved_vertices(assembly, pose), start)
            gap, carries = contacts.gaps / model.length, forces[:, 0] > CARRIES
            slides = (np.linalg.norm(forces[:, 1:], axis=1) >= SLIDES * bound)[carries].any()
            exact = EXACT_SLIDING if slides else EXACT
            left = max(
                np.abs(gap)[carries].max(initial=0.0) / closed,
                np.abs(gap - foreseen)[carries].max(initial=0.0) / exact,
            )
            missed = 0.0 if control is None else abs(s - driver.gone(pose)) / model.length
            if left <= 1.0 and missed <= EXACT:
                break
        if not np.isfinite(motion_so_far).all():
            raise NotSolved("the movement is not finite")
        moved_by = float(np.abs(motion_so_far).max(initial=0.0))
        if moved_by > UNSEEN:
            unseen = self._unseen(start, place.pose, pose, moved_by)
            if len(unseen):
                among = joined_contacts([start, unseen])
                return self.step(place, length, in_time=in_time, viscosity=viscosity, among=among)
        share = IN_TIME if in_time else min(AT_ONCE, size / (size + min(FRICTION_MEMORY, s / self.unit)))
        lag, followed = self._follow(forces, np.maximum(gap, 0.0), friction, bound, followed, fresh, share)
        motion = np.where(free[:, None], full, place.pose.movement_to(pose))
        new = Place(
            s,
            pose,
            contacts,
            forces,
            trial,
            followed,
            multiplier / (live_size or 1.0),
            motion / length if in_time else self._velocity(place, motion, length),
        )
        # The first step of the supports has none before it to turn from.
        turn = (in_time or place.velocity is not None) * float(np.abs(motion_so_far - before).max(initial=0.0))
        return new, motion / scales, StepError(lag, turn, moved_by, float(-gap[carries].min(initial=0.0)))

    def _resistance(
        self, place: Place, length: float, in_time: bool, viscosity: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """(n_dof,) arrays: force per movement by viscosity or inertia, and the movement that meets none of it."""
        weights, kept = self.weights[self.free].ravel(), 1.0
        resisting = VISCOSITY * viscosity * self.unit / length * weights
        if in_time:
            resisting, kept = (1.0 / length**2 + DAMPING / length) * weights, 1.0 / (1.0 + DAMPING * length)
        if place.velocity is None:
            return resisting, np.zeros_like(resisting)
        return resisting, kept * (place.velocity / self.model.lengths * length)[self.free].ravel()

    def _follow(
        self,
        forces: np.ndarray,
        gap: np.ndarray,
        friction: np.ndarray,
        bound: np.ndarray,
        followed: np.ndarray,
        fresh: np.ndarray,
        share: float | np.ndarray,
    ) -> tuple[float, np.ndarray]:
        """Let the friction bounds follow a share of the way; how much those of sliding points change, and followed."""
        drag, push = np.linalg.norm(forces[:, 1:], axis=1), forces[:, 0]
        sliding = ((drag >= SLIDES * bound) | (drag > friction * push)) & ~fresh
        # Where a joint opens friction goes with the gap: the less a point can carry, the sooner.
        share = np.maximum(share, gap / (gap + OPEN))
        # What is new has all the friction of its normal force at once.
        after = np.where(fresh, push, followed + share * (push - followed))
        return float((friction * np.abs(after - followed))[sliding].sum()) / self.weight, after

    def _velocity(self, place: Place, motion: np.ndarray, length: float) -> np.ndarray:
        """(n_blocks, n_dof) array: velocity after a step, in it and in those before."""
        before = np.zeros_like(motion) if place.velocity is None else place.velocity
        return before + (motion - length * before) / (length + VELOCITY_MEMORY * self.unit)

    def _unseen(self, seen: Contacts, before: Pose, pose: Pose, moved_by: float) -> Contacts:
        """Contact points that a step has to see, too, where they were before it: at its end a corner is in a block.

        Raises
        ------
        Unseen
            Where that corner was behind the edge already, or the step has seen it.
        """
        end = self.contacts(pose)
        earlier, known = np.zeros(len(end)), np.zeros(len(end), dtype=bool)
        if len(end) and len(seen):
            number, known = matched_contacts(end, seen)
            earlier = np.where(known, np.minimum(seen.gaps[number], 0.0), 0.0)
        deepest = -UNSEEN * self.model.length
        deep = end.gaps - earlier < deepest
        found = measure_contacts(self.model.assembly, moved_vertices(self.model.assembly, before), end[deep])
        if known[deep].any() or (found.gaps < deepest).any():
            raise Unseen(moved_by)
        return found

    def _with_supports(self, pose: Pose, supports: Pose) -> Pose:
        free = self.free[:, None]
        return Pose(
            np.where(free, pose.positions, supports.positions), np.where(free, pose.rotations, supports.rotations)
        )
