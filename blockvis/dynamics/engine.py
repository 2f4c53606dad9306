"""Blocks that fall, in the plane and in space: the convex program of the path's step, with inertia for the viscosity.

A step of time h minimises over the movement v of all blocks, with their movement u in free flight::

    1/2 (v - u)ᵀ M/h² (v - u) + what contact points ask for (mechanics.ContactProblem)

It is implicit and without restitution. Rotations are counted about the principal axes of each block, in which its
inertia is diagonal. A contact point is a point of one block before a plane that rides on the other. Where a step ends
with a block in another, what has come behind a plane that was between the two is added, and the program solved again.
Ties, props and bars are contact points without friction, as along the path: elastic up to their strength.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

import solver
from solver import mechanics

from .spin import free_spin, principal_inertia

#: Longest and shortest step, in √(block size / g), and how far a corner moves in a step at most, in block sizes.
LONGEST_STEP, SHORTEST_STEP, STRIDE = 0.17, 1e-3, 0.3

#: Give of a contact point, normal and tangential: block sizes under the mean weight of a block.
GIVE, SHEAR_GIVE = 1e-6, 5e-6

#: Part of an overlap that a step pushes out: all of it at once would throw the blocks.
PUSHED_OUT = 0.2

#: Overlap above which the contact points that would have prevented it are added, in block sizes.
DEEP = 2e-4

#: Force from which on a contact point counts, in block weights.
FORCE = 1e-3

#: Error of predicted gaps above which a step is linearised again, in block sizes, and linearisations at most; where
#: the last one leaves blocks in each other, the step is halved.
EXACT, LINEARISATIONS = 1e-4, 6

#: Change of a normal force, as part of it and a block weight, above which a step is solved again: a program bounds
#: friction by the normal force of the one before, and a blow lasts for one step.
LAG = 0.25

#: Change of the acceleration of a block from step to step, in its weight, up to which nothing has struck it.
SMOOTH = 0.1

#: Part of that error that the length of a tie may have: nothing pushes it out later, and stiff ones store energy by it.
EXACT_TIES = 1e-2


class Engine:
    """Blocks that move by inertia, loads and contact; supports stand still.

    Parameters
    ----------
    assembly : solver.Assembly
        With the ground.
    loads : (n_blocks, n_dof) array [N, N·m]
        At the pose.
    velocity : (n_blocks, n_dof) array [m/s, rad/s]
        At the start.
    removed : (n_blocks,) bool array, optional
        Supports that nothing meets: blocks that were taken away before.
    ties : sequence of solver.Tie
        Ties, props and bars; the last block of the assembly stands for the ground that holds their ends.
    rest : (n_ties,) array, optional [m]
        Their lengths without force; nan for those that are absent or broken.
    tensions : (n_ties,) array, optional [N]
        Their forces at the start, which are only told; by default zero.
    arms : (n_blocks, d, d) array, optional [N·m]
        Of the loads that are forces at points, as in :class:`solver.Loads`.

    Attributes
    ----------
    velocity : (n_blocks, n_dof) array
        In block sizes, radians and √(block size / g).
    rest : (n_ties,) array [m]
        Changed by what yields, nan from where a tie breaks.
    tensions : (n_ties,) array [N]
        Forces of the ties in the last step.
    steps, programs : int
        Taken and solved.
    """

    def __init__(
        self,
        assembly: solver.Assembly,
        loads: np.ndarray,
        interfaces: solver.Interfaces,
        pose: solver.Pose,
        velocity: np.ndarray,
        removed: np.ndarray | None = None,
        ties: Sequence[solver.Tie] = (),
        rest: np.ndarray | None = None,
        tensions: np.ndarray | None = None,
        arms: np.ndarray | None = None,
    ) -> None:
        self.removed = np.zeros(assembly.n_blocks, dtype=bool) if removed is None else removed
        self.assembly, self.interfaces, self.pose = assembly, interfaces, pose
        self.d, self.free, self.length = assembly.dimension, assembly.free, assembly.block_size
        self.mass = float(assembly.masses[self.free].mean())
        self.unit = float(np.sqrt(self.length / solver.GRAVITY))
        is_place = np.arange(loads.shape[1]) < self.d
        self.scales = np.where(is_place, self.length, 1.0)
        self.loads = loads / (self.mass * solver.GRAVITY * np.where(is_place, 1.0, self.length))
        self.arms = np.zeros((len(loads), self.d, self.d))
        if arms is not None:
            self.arms[: len(arms)] = arms / (self.mass * solver.GRAVITY * self.length)
            self.loads = self.loads - mechanics.turned_moments(self.arms, pose)
        # Moments that stay have no potential in space; those of forces at points, as drawn, are a part of one.
        one, other = ([0], [1]) if self.d == 2 else ([1, 2, 0], [2, 0, 1])
        self.lasting = self.loads[:, self.d :] - self.arms[:, one, other] + self.arms[:, other, one]
        self.velocity = np.where(self.free[:, None], velocity * self.unit / self.scales, 0.0)
        moments, self.drawn_axes = principal_inertia(assembly)
        masses = np.repeat(assembly.masses[:, None], self.d, axis=1)
        force = self.mass * solver.GRAVITY
        self.ties, self.rest = tuple(ties), np.zeros(0) if rest is None else rest
        self.tensions = np.zeros(len(self.ties)) if tensions is None else tensions
        self.strength = np.array([tie.strength for tie in self.ties]) / force
        # No stiffer than contact points, which the length of a step is made for.
        self.give = np.array([max(force / (tie.stiffness * self.length), GIVE) for tie in self.ties])
        self.weights = np.concatenate([masses, moments / self.length**2], axis=1) / self.mass
        arms = assembly.vertices - assembly.centroids[assembly.block_of_vertex]
        self.radii = np.zeros(assembly.n_blocks)
        np.maximum.at(self.radii, assembly.block_of_vertex, np.linalg.norm(arms, axis=1) / self.length)
        self.contacts: mechanics.Contacts | None = None
        self.forces = self.trial = np.zeros((0, self.d))
        self.corners = mechanics.moved_vertices(assembly, pose)
        self.acceleration = np.zeros_like(self.velocity)
        self.is_smooth = self.was_calm = np.zeros(assembly.n_blocks, dtype=bool)
        #: Length of the last step. The first are short, so that they follow the push: implicit steps fall too far.
        self.step_length = 0.05 * LONGEST_STEP
        self.steps = self.programs = 0

    @property
    def speeds(self) -> np.ndarray:
        """(n_blocks,) array: of the fastest corner at most, in √(g × block size)."""
        forward, spin = self.velocity[:, : self.d], self.velocity[:, self.d :]
        return np.linalg.norm(forward, axis=1) + self.radii * np.linalg.norm(spin, axis=1)

    @property
    def fastest(self) -> float:
        """Speed of the fastest free block [m/s], turning included."""
        return float(self.speeds[self.free].max()) * self.length / self.unit

    @property
    def energies(self) -> np.ndarray:
        """(n_blocks,) array [J]: potential and kinetic energy of the free blocks, and of what holds on to them."""
        height = (self.loads[:, : self.d] * self.pose.positions).sum(axis=1) / self.length
        height += np.trace(mechanics.rotation_matrices(self.pose.rotations) @ self.arms, axis1=1, axis2=2)
        energies = self._kinetic - height
        if self.ties:
            members = self._members(self.pose)
            stored = 0.5 * np.minimum(members.gaps / self.length, 0.0) ** 2 / self.give[members.features[:, 1]]
            # Of a tie from a support all is its block's.
            for one, other in ((members.block_a, members.block_b), (members.block_b, members.block_a)):
                np.add.at(energies, one, np.where(self.free[other], 0.5, 1.0) * stored)
        return np.where(self.free, energies, 0.0) * self.mass * solver.GRAVITY * self.length

    def advance(self, seconds: float) -> None:
        """Follow the blocks for so many seconds; raises ``NotSolved`` where the shortest step cannot be solved."""
        left = seconds / self.unit
        while left > 1e-9:
            fastest = float(self.speeds[self.free].max()) + 0.5 * LONGEST_STEP
            h = left / np.ceil(left / min(LONGEST_STEP, STRIDE / fastest, 2.0 * self.step_length) - 1e-9)
            while not self._step(h):
                h /= 2.0
            self.step_length, left = h, left - h

    def _step(self, h: float) -> bool:
        """Take a step; false where it has to be shorter."""
        flight, velocity = self._flight(h)
        contacts = self._near(h)
        before, trial = self._transferred(contacts)
        axes = self._axes
        motion = flight
        for left in range(LINEARISATIONS, 0, -1):
            pose = mechanics.moved(self.pose, motion * self.scales)
            measured = self._carried(contacts, pose)
            problem = self._problem(h, contacts, measured, before, pose, motion - flight, axes)
            try:
                solution = mechanics.minimise(problem, trial)
            except mechanics.NotSolved:
                if h < SHORTEST_STEP:
                    raise
                return False
            self.programs += 1
            forces, trial = solution.forces, solution.trial
            predicted = measured.gaps + problem.rows.relative(solution.motion)[:, 0] * self.length
            change = np.zeros_like(motion)
            change[self.free] = solution.motion.reshape(-1, motion.shape[1])
            motion = motion + self._along(change, axes)
            pose = mechanics.moved(self.pose, motion * self.scales)
            corners = mechanics.moved_vertices(self.assembly, pose)
            gaps = self._carried(contacts, pose).gaps
            members = mechanics.is_member(contacts)
            counts = (forces[:, 0] > FORCE) | (gaps < -DEEP * self.length)
            entered = self._entered(corners, contacts)
            error = np.abs(gaps - predicted) / np.where(members, EXACT_TIES, 1.0)
            lag = ~members & (np.abs(forces[:, 0] - before[:, 0]) > LAG * (1.0 + before[:, 0]))
            before[:, 0] = forces[:, 0]
            if error[counts].max(initial=0.0) < EXACT * self.length and len(entered) == 0 and not lag.any():
                break
            if left > 1 and len(entered):
                contacts = mechanics.joined_contacts([contacts, entered])
                before = np.concatenate([before, np.zeros((len(entered), self.d))])
                # As if closed: open ones would be found in each other by forces too large for Newton's method.
                trial = np.concatenate([trial, np.tile(np.eye(self.d)[0], (len(entered), 1))])
        deeper = ~members & (gaps < np.minimum(contacts.gaps, 0.0) - DEEP * self.length)
        # What a tie carries that comes taut late in a step would act for all of it.
        late = members & (contacts.gaps > 0.0) & (forces[:, 0] > FORCE)
        if (len(entered) or deeper.any() or late.any()) and h > SHORTEST_STEP:
            return False
        gained = (self.lasting * motion[:, self.d :]).sum(axis=1)
        energies = self.energies + gained * self.mass * solver.GRAVITY * self.length
        self.contacts, self.forces, self.trial = contacts, forces, trial
        self.velocity = np.where(self.free[:, None], velocity + (motion - flight) / h, 0.0)
        self.pose, self.corners = pose, corners
        before_it, self.acceleration = self.acceleration, (motion - flight) / h**2
        jump = (self.weights * (self.acceleration - before_it) ** 2).sum(axis=1)
        # A blow may take two steps, of much the same acceleration.
        calm = self.free & (jump <= SMOOTH**2 * (self.loads**2 / self.weights).sum(axis=1))
        self.is_smooth, self.was_calm = calm & self.was_calm, calm
        self._yield()
        self._lose(energies)
        self.steps += 1
        return True

    def _entered(self, corners: np.ndarray, contacts: mechanics.Contacts) -> mechanics.Contacts:
        """Contact points, as they are before a step, beside those given that it has passed."""
        found = self.assembly.shapes.entered(self.corners, corners, self.free, DEEP * self.length, contacts)
        return found[~(self.removed[found.block_a] | self.removed[found.block_b])]

    def _flight(self, h: float) -> tuple[np.ndarray, np.ndarray]:
        """Movement and velocity after a step without loads and contact, (n_blocks, n_dof) arrays."""
        motion, velocity = h * self.velocity, self.velocity.copy()
        spinning = np.flatnonzero((self.velocity[:, self.d :] != 0.0).any(axis=1))
        if self.d == 3 and len(spinning):
            axes = self._axes[spinning]
            spin = np.einsum("nji,nj->ni", axes, self.velocity[spinning, 3:])
            turn, after = free_spin(self.weights[spinning, 3:], spin, h)
            motion[spinning, 3:] = np.einsum("nij,nj->ni", axes, turn)
            # The axes have turned, too.
            velocity[spinning, 3:] = mechanics.turned(np.einsum("nij,nj->ni", axes, after), motion[spinning, 3:])
        # Implicit steps move as if the acceleration at their end were that of all of them.
        return motion - 0.5 * h * h * np.where(self.is_smooth[:, None], self.acceleration, 0.0), velocity

    def _near(self, h: float) -> mechanics.Contacts:
        """Contact points that may close within a step."""
        way = self.speeds * h + np.where(self.free, 2.0 * h * h, 0.0)
        reach = float(2.0 * way.max()) + 1e-3
        found = mechanics.find_contacts(self.assembly, self.corners, reach * self.length)
        met = ~(self.removed[found.block_a] | self.removed[found.block_b])
        found = found[met & (found.gaps <= (way[found.block_a] + way[found.block_b] + 1e-4) * self.length)]
        return mechanics.joined_contacts([self._members(self.pose), found]) if self.ties else found

    def _members(self, pose: solver.Pose, features: np.ndarray | None = None) -> mechanics.Contacts:
        """Contact points of the ties that are there, or of those with these features, at a pose."""
        if features is None:
            features = mechanics.present_members(self.ties, self.rest)
        return mechanics.member_contacts(self.ties, self.assembly, pose, self.rest, features)

    def _carried(self, contacts: mechanics.Contacts, pose: solver.Pose) -> mechanics.Contacts:
        """Measure the same contact points at another pose."""
        if (members := mechanics.is_member(contacts)).any():
            # They come first.
            bound = self._members(pose, contacts.features[members])
            return mechanics.joined_contacts([bound, self._carried(contacts[~members], pose)])
        a, b = contacts.block_a, contacts.block_b
        on_plane = contacts.points - contacts.gaps[:, None] * contacts.frames[:, 0]
        point = mechanics.carried(contacts.points, a, self.pose, pose)
        turn = self.pose.movement_to(pose)[b, self.d :]
        frames = np.stack([mechanics.turned(contacts.frames[:, k], turn) for k in range(self.d)], axis=1)
        apart = np.einsum("nij,nj->ni", frames, point - mechanics.carried(on_plane, b, self.pose, pose))
        return replace(contacts, points=point, frames=frames, gaps=apart[:, 0], slip=apart[:, 1:])

    def _transferred(self, contacts: mechanics.Contacts) -> tuple[np.ndarray, np.ndarray]:
        """Hand on forces and trial forces of the step before to these contact points, (n, d) arrays."""
        forces, trial = np.zeros((len(contacts), self.d)), np.tile(-np.eye(self.d)[0], (len(contacts), 1))
        if self.contacts is not None and len(self.contacts) and len(contacts):
            number, same = mechanics.matched_contacts(contacts, self.contacts)
            forces[same], trial[same] = self.forces[number[same]], self.trial[number[same]]
        return forces, trial

    def _problem(
        self,
        h: float,
        start: mechanics.Contacts,
        measured: mechanics.Contacts,
        before: np.ndarray,
        pose: solver.Pose,
        beside_flight: np.ndarray,
        axes: np.ndarray,
    ) -> mechanics.ContactProblem:
        """State the program of a step, linearised where contact points are measured."""
        matrix = mechanics.wrench_matrix(measured, pose, self.length)
        loads = self.loads + mechanics.turned_moments(self.arms, pose)
        if self.d == 3:
            each = matrix.data.reshape(len(start), 3, 12)
            for block, first in ((start.block_a, 3), (start.block_b, 9)):
                each[:, :, first : first + 3] = each[:, :, first : first + 3] @ axes[block]
            loads, beside_flight = (self._along(of, axes.transpose(0, 2, 1)) for of in (loads, beside_flight))
        members = mechanics.is_member(start)
        # What has come into another block is pushed out over some steps.
        gaps = measured.gaps - (1.0 - PUSHED_OUT) * np.where(members, 0.0, np.minimum(start.gaps, 0.0))
        friction = np.where(members, 0.0, self.interfaces.friction(self.assembly, start.block_a, start.block_b))
        compliance, most = np.tile([GIVE] + [SHEAR_GIVE] * (self.d - 1), (len(start), 1)), np.full(len(start), np.inf)
        number = start.features[members, 1]
        compliance[members, 0], most[members] = self.give[number], self.strength[number]
        return mechanics.ContactProblem(
            rows=mechanics.ContactRows(matrix, self.free, self.assembly.centroids),
            gap=gaps / self.length,
            slip=measured.slip / self.length,
            # Gaps are absolute, slip counts from the start of the step.
            forces=np.column_stack([np.zeros(len(start)), before[:, 1:]]),
            bound=friction * before[:, 0],
            compliance=compliance,
            most=most,
            load=loads[self.free].ravel(),
            viscosity=(self.weights / h**2)[self.free].ravel(),
            motion_so_far=beside_flight[self.free].ravel(),
            size=1.0,
        )

    def _yield(self) -> None:
        """Give the ties that are stretched beyond their strength another length without force, or none."""
        assert self.contacts is not None
        if not self.ties:
            return
        members = self._members(self.pose)
        number, pushes = members.features[:, 1], members.features[:, 2] == 1
        beyond = np.maximum(-members.gaps - (self.strength * self.give)[number] * self.length, 0.0)
        self.rest = self.rest.copy()
        # Of a bar one of two contact points at most is stretched.
        np.add.at(self.rest, number, np.where(pushes, -1.0, 1.0) * beyond)
        brittle = np.array([tie.brittle for tie in self.ties], dtype=bool)
        self.rest[number[(beyond > 0.0) & brittle[number]]] = np.nan
        tensions = mechanics.member_forces(self.contacts, self.forces, len(self.ties)) * self.mass * solver.GRAVITY
        self.tensions = np.where(np.isnan(self.rest), 0.0, tensions)

    def _along(self, motion: np.ndarray, axes: np.ndarray) -> np.ndarray:
        """(n_blocks, n_dof) array: in space rotations times axes."""
        if self.d == 2:
            return motion
        return np.concatenate([motion[:, :3], np.einsum("nij,nj->ni", axes, motion[:, 3:])], axis=1)

    @property
    def _axes(self) -> np.ndarray:
        """(n_blocks, d, d) array: principal axes of the blocks, as columns."""
        turned = [mechanics.turned(self.drawn_axes[:, :, k], self.pose.rotations) for k in range(self.d)]
        return np.stack(turned, axis=2)

    @property
    def _kinetic(self) -> np.ndarray:
        """(n_blocks,) array: kinetic energy, in the units of the engine."""
        turned = self._along(self.velocity, self._axes.transpose(0, 2, 1))
        return np.asarray(0.5 * (self.weights * turned**2).sum(axis=1))

    def _lose(self, before: np.ndarray) -> None:
        """Slow the blocks that touch each other where their energy has grown: by rotations within the step."""
        assert self.contacts is not None
        n, carries = len(self.free), (self.forces[:, 0] > FORCE) | mechanics.is_member(self.contacts)
        a, b = self.contacts.block_a[carries], self.contacts.block_b[carries]
        both = self.free[a] & self.free[b]
        links = sp.coo_array((np.ones(int(both.sum())), (a[both], b[both])), shape=(n, n))
        count, group = connected_components(links, directed=False)
        grown = np.bincount(group, (self.energies - before), count) / (self.mass * solver.GRAVITY * self.length)
        kinetic = np.bincount(group, self._kinetic, count)
        part = np.clip(1.0 - np.maximum(grown, 0.0) / np.maximum(kinetic, 1e-300), 0.0, 1.0)
        self.velocity = self.velocity * np.sqrt(part)[group][:, None]
