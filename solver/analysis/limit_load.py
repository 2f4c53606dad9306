"""Limit load: the largest multiplier of the live loads that a structure carries at one geometry; its mechanism."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np
import scipy.sparse as sp

from solver.assembly import FIXED, Assembly, check_blocks, find_contacts
from solver.contact_step.balance import nearest_equilibrium
from solver.contact_step.problem import NotSolved
from solver.contact_step.stiffness import ContactRows
from solver.equilibrium import block_forces, wrench_matrix
from solver.geometry.contacts import Contacts, joined_contacts
from solver.interfaces import Interfaces
from solver.kinematics import Pose, moved_vertices, relative_velocities, unit_lengths
from solver.loads import Loads, checked_loads
from solver.path.stepping import Stepper
from solver.program.non_associative import NonAssociative, ProgramState
from solver.program.strength import Admissible, point_strength
from solver.program.torsion import POINTS, TORSIONS, UNIFORM, Faces, face_wrench_matrix, point_forces
from solver.programs.problem import Unbounded
from solver.programs.solve import solve_between
from solver.results.certificate import Certificate, carrying_gap, friction_excess, largest_penetration
from solver.results.increment import Bonds, State
from solver.results.response import LimitLoad, LimitStatus
from solver.ties import (
    ABSENT,
    BROKEN,
    Tie,
    TieForces,
    check_ties,
    held_ties,
    is_member,
    member_contacts,
    plastic_forces,
    present_members,
    slack,
    ties_as_drawn,
)
from solver.tolerances import COMPUTED_GAP, DRAWN_GAP, FALLING_FRACTION, USED_UP
from solver.words import checked, counted, plain

#: Largest gap, in block sizes, of a contact point that may close within a displacement.
REACH = 0.25


def find_limit_load(
    assembly: Assembly,
    interfaces: Interfaces,
    loads: Loads,
    *,
    pose: Pose | None = None,
    flow: str = "associative",
    closed_gap: float | None = None,
    displacement: float = 0.0,
    overlap_tolerance: float | None = None,
    torsion: str = POINTS,
    ties: Sequence[Tie] = (),
    ties_at: TieForces | None = None,
    bonds_at: Bonds | None = None,
    fallen: np.ndarray | None = None,
) -> LimitLoad:
    """The limit load of a structure; parameters as those of :meth:`solver.Structure.limit_load`.

    Notes
    -----
    Associative flow, over multipliers λ ≥ 0 of the rays n ∓ μ t of the friction cones and α ≥ 0:

        maximise α  subject to  A λ + dead + α live = 0  for every free block

    Its dual is the kinematic program: minimise - dead · q over mechanisms q with N(q) ≥ μ |T(q)| at every closed
    contact point and live · q = 1. Livesley (1978), https://doi.org/10.1002/nme.1620121207, for the static form; both
    bounds are recomputed from the forces and from the mechanism. In space the forces of a point are in its round cone
    |T| ≤ μ N, and the program is a conic one.

    Cohesion c and compressive strength σ of the interfaces, off by default, give each contact point its part A of the
    face between two blocks (half the distance to its neighbours, times the thickness): |T| ≤ μ N + c A and
    -τ A ≤ N ≤ σ A with the tensile strength τ. A face of two corners thus carries moments up to σ A b / 2 with all of
    its force at the ends: more than the stress block of a continuous face, so that crushing at a toe is found later
    than it comes. What crushes moves by the same flow rule.

    At the pose of an increment its bonds say what is closed: gaps count from those at which elastic joints have no
    force, and points with tension left hold at any gap, as in the bounds of a path. The give that the forces of the
    limit state would add is left out.

    With a displacement δ, points that are open by a gap g carry at a price: maximise α - Σ g N / w, where w is δ times
    the sum of the live forces; its dual has N(q) + g ≥ μ |T(q)| and live · q = w. That is the first program of a
    pushover with an increment δ. At closed joints it is the limit load, whatever δ is; the two values then enclose the
    optimum of this program.

    Under a uniform pressure the shear force T and the torsion M of a face, about the centroid of the polygon that its
    contact points span, are limited together: |(T, M / r)| ≤ μ N with N the sum over its points and r the mean distance
    of the polygon from its centroid, which is exact for T alone and for M alone. Forces are then reported at the points
    with the same resultants; single ones may be beyond friction.

    Non-associative flow is a sequence of such programs in the manner of Gilbert, Casapulla & Ahmed (2006),
    https://doi.org/10.1016/j.compstruc.2006.02.005: the friction cone of each point is replaced by |T| ≤ μ N⁰ with N⁰
    out of the normal forces of the programs before, and among equal multipliers the forces nearest to N⁰ are taken.
    Ours has no dilatancy from the first program on and begins with the structure at rest, its forces of least elastic
    energy under the dead load; what carries nothing there is asked last, so that a block that just fits between floor
    and ceiling slides at μ, without the prestress that makes its associative limit load unbounded. Where it converges
    (N = N⁰) the forces obey Coulomb friction and balance the loads, the mechanism does not lift where it slides, and
    the power of the loads is what friction takes: a complete solution for friction without dilatancy, never above the
    associative value. It is not proved to be the least: such a structure may have several limit loads, depending on how
    it was loaded, and may fall below this one. Its two values agree where it has converged, but are no bounds.
    Convergence is not proved either; "not converged" says so and gives the program that came nearest. Where it finds no
    limit, forces that a program adds are within friction and the associative program is unbounded, so is this one.
    """
    _check_options(assembly, flow, torsion, ties)
    check_blocks(assembly, overlap_tolerance)
    check_ties(ties, assembly, 0 if ties_at is None else np.inf)
    if pose is not None and bonds_at is None:
        interfaces.refuse_pose_alone()
    left = remaining(assembly, fallen)
    loads = checked_live(left, loads)
    if closed_gap is None:
        closed_gap = DRAWN_GAP * float(assembly.widths.min()) if pose is None else COMPUTED_GAP * assembly.block_size
    pose = Pose.initial(assembly) if pose is None else checked(pose, Pose, "pose")
    loads = replace(loads, dead=loads.dead_at(assembly, pose), live=loads.live_at(pose))
    for name, value in (("displacement", displacement), ("closed_gap", closed_gap)):
        if not 0.0 <= plain(value, "float", name) < np.inf:
            raise ValueError(f"{name} is {value:g} m; it must be a finite number of at least 0")
    gone = np.zeros(assembly.n_blocks, dtype=bool) if fallen is None else np.asarray(fallen)
    told = ties_as_drawn(ties, assembly, pose) if ties_at is None else ties_at
    states = np.where(held_ties(ties, gone), told.states, ABSENT)
    told = replace(told, rest=np.where(np.isin(states, (ABSENT, BROKEN)), np.nan, told.rest), states=states)
    problem = _Problem(
        left, interfaces, loads, pose, closed_gap, displacement, torsion, tuple(ties), told, bonds_at, gone
    )
    balanced, status = problem.balanced(with_live=False), LimitStatus.FOUND
    if balanced.falls:
        falling, status = balanced, LimitStatus.HELD
        balanced = problem.balanced(with_live=True)
        if balanced.falls:
            return problem.result(falling, LimitStatus.NO_EQUILIBRIUM, flow, 2)
    try:
        if flow == "associative":
            return problem.result(problem.associative(balanced), status, flow, 2)
        return problem.non_associative(balanced, status)
    except Unbounded:
        return problem.result(balanced, LimitStatus.UNBOUNDED, flow, 2)


def _check_options(assembly: Assembly, flow: str, torsion: str, ties: Sequence[Tie]) -> None:
    """Refuses unknown words, and what does not go together."""
    if flow not in ("associative", "non-associative"):
        raise ValueError(f"flow is '{flow}'; it is 'associative' or 'non-associative'")
    if torsion not in TORSIONS:
        raise ValueError(f"torsion is '{torsion}'; it is 'points' or 'uniform'")
    if torsion == UNIFORM and assembly.dimension == 2:
        raise ValueError("torsion is 'uniform', but faces of blocks in the plane have none; leave it out")
    if torsion == UNIFORM and ties:
        raise ValueError(f"torsion = 'uniform' knows no ties ('{ties[0].name}'); take torsion = 'points'")


class _Problem:
    """One geometry and its loads in units of block size and mean block load; rows of the free blocks.

    Normal forces are those beyond the largest tension: it is a load of the blocks, in ``dead``. Gaps are those beyond
    the give of joints, by which they are open or closed.
    """

    def __init__(
        self,
        assembly: Assembly,
        interfaces: Interfaces,
        loads: Loads,
        pose: Pose,
        closed_gap: float,
        displacement: float,
        torsion: str,
        ties: tuple[Tie, ...],
        ties_at: TieForces,
        bonds: Bonds | None,
        gone: np.ndarray,
    ) -> None:
        self.assembly, self.pose, self.ties, self.ties_at, self.gone = assembly, pose, ties, ties_at, gone
        self.length, free, d = assembly.block_size, assembly.free, assembly.dimension
        reach = max(closed_gap, REACH * self.length) if displacement > 0.0 else closed_gap
        dry = interfaces.dry and bonds is None
        # Open points, too, measure the faces of joints with strength.
        measured = reach if dry else max(reach, REACH * self.length)
        contacts = find_contacts(assembly, moved_vertices(assembly, pose), measured)
        contacts = contacts[~(gone[contacts.block_a] | gone[contacts.block_b])]
        gaps, is_open = contacts.gaps, contacts.gaps > closed_gap
        drawn = Bonds(contacts.features[:, :3], contacts.areas, (~is_open).astype(float), np.zeros(len(contacts)))
        bonded = drawn if bonds is None else bonds.of(contacts)
        cohesion, crushing, tension = point_strength(assembly, interfaces, contacts, bonded.areas * bonded.left)
        if not dry:
            gaps = _beyond_give(assembly, interfaces, contacts, gaps - bonded.rest, tension, bonded.areas)
            number, is_open = _carrying_points(gaps, tension, closed_gap, reach)
            contacts, gaps, cohesion, tension = contacts[number], gaps[number], cohesion[number], tension[number]
            crushing = np.where(is_open | (gaps <= closed_gap), crushing[number], 0.0)
        friction = interfaces.friction(assembly, contacts.block_a, contacts.block_b)
        if ties:
            members = member_contacts(ties, assembly, pose, ties_at.rest, present_members(ties, ties_at.rest))
            apart = slack(members, len(ties))
            members, apart = members[apart <= reach], apart[apart <= reach]
            contacts = joined_contacts([contacts, members])
            crushing = np.append(crushing, [ties[i].strength for i in members.features[:, 1]])
            none = np.zeros(len(members))
            cohesion, friction, tension = (np.append(of, none) for of in (cohesion, friction, tension))
            gaps, is_open = np.append(gaps, apart), np.append(is_open, apart > closed_gap)
        units = unit_lengths(loads.dead.shape[1], self.length)
        dead, live = loads.dead[free] / units, loads.live[free] / units
        size = float(np.abs(live).max())
        self.force = float(np.abs(dead).sum() / len(dead)) or size
        self.faces = Faces.of(contacts, self.length) if torsion == UNIFORM and len(contacts) else None
        matrix = wrench_matrix(contacts, pose, self.length)
        if self.faces is not None:
            self.faces.refuse_not_convex(contacts, assembly)
            matrix = face_wrench_matrix(contacts, self.faces, pose, self.length)
        self.matrix = sp.csr_array(matrix)[np.repeat(free, len(units))]
        self.contacts, self.gaps, self.friction = contacts, gaps, friction
        cohesion, tension = (np.where(is_open, 0.0, strength) for strength in (cohesion, tension))
        self.cohesion = np.maximum(cohesion - friction * tension, 0.0) / self.force
        self.crushing, self.tension = (crushing + tension) / self.force, tension / self.force
        self.dead = (dead / self.force).ravel()
        self.total = float(np.abs(self.dead).sum())
        if tension.any():
            self.dead = self.dead - self.matrix[:, :: self.size] @ self.tension
        self.live, self.live_size = (live / size).ravel(), size / self.force
        self.live_force = float(np.hypot.reduce(loads.live[free, :d].sum(axis=0)))
        # What a unit of normal force costs in multipliers of the scaled live load.
        self.price = np.zeros(len(contacts))
        if displacement > 0.0:
            total = float(np.linalg.norm(live[:, :d], axis=1).sum() + np.linalg.norm(live[:, d:], axis=1).sum())
            self.price = np.where(is_open, gaps, 0.0) / displacement * (size / total)

    @property
    def size(self) -> int:
        """Numbers of the force of a contact point: 2 in the plane, 3 in space, 4 with the torsion of its face."""
        return self.contacts.points.shape[1] + (self.faces is not None)

    def balanced(self, *, with_live: bool) -> ProgramState:
        """The least unbalanced force that the dead load leaves, and how the blocks move where it is not nothing."""
        rows = len(self.dead)
        identity = sp.identity(rows, format="csc")
        live = sp.csc_array(self.live[:, None] * float(with_live))
        cost = np.append(0.0, np.ones(2 * rows))
        found = self._carried(np.zeros(len(self.price)), [live, identity, -identity], cost, np.zeros(rows))
        multiplier = found.multiplier * with_live
        unbalanced = np.abs(self.matrix @ found.forces.ravel() + self.dead + multiplier * self.live)
        falls = float(unbalanced.max(initial=0.0)) > FALLING_FRACTION * self.total
        return replace(found, multiplier=multiplier, unbalanced=unbalanced, falls=falls)

    def associative(self, balanced: ProgramState) -> ProgramState:
        """The program of the limit load; what the dead load leaves unbalanced by rounding it may leave too.

        In space it balances everything: round cones have no vertices that rounding could take away.
        """
        left = balanced.unbalanced if self.size == 2 else np.zeros(len(self.dead))
        return self._carried(self.price, [sp.csc_array(self.live[:, None])], np.array([-1.0]), left)

    def _carried(
        self, price: np.ndarray, beside: list[sp.csc_array], cost: np.ndarray, left: np.ndarray
    ) -> ProgramState:
        """The associative program over forces that points can carry, at a price, and columns with a cost.

        The price is that of normal forces; the first of the columns is that of the multiplier; ``left`` is what rows
        may leave.
        """
        carried, rows = Admissible.of(self.friction, self.cohesion, self.crushing, self.size), len(self.dead)
        columns, limits = carried.columns, [carried.limits, *[None] * len(beside)]
        of_forces = columns.T @ (price[:, None] * np.eye(self.size)[0]).ravel()
        solution = solve_between(
            cost=np.append(of_forces, cost),
            matrix=sp.csc_array(sp.block_array([[self.matrix @ columns, *beside], limits], format="csc")),
            lower=np.append(-self.dead - left, np.zeros(len(carried.most))),
            upper=np.append(-self.dead + left, carried.most),
            friction=carried.friction,
            size=self.size,
        )
        n = columns.shape[1]
        forces = (columns @ solution.x[:n]).reshape(-1, self.size)
        return ProgramState(forces, float(solution.x[n]), -solution.row_dual[:rows], left, solution.gap)

    def at_rest(self, balanced: ProgramState) -> np.ndarray:
        """(n,) array: normal forces of the state of least elastic energy under the dead load, where there is one."""
        free, d = self.assembly.free, self.contacts.points.shape[1]
        matrix = wrench_matrix(self.contacts, self.pose, self.length)
        rows = ContactRows(matrix, free, self.assembly.centroids)
        load, near = self.dead + balanced.multiplier * self.live, np.zeros((len(self.contacts), d))
        near[:, 0] = self.tension
        try:
            compliance = Stepper.joint_compliance(self.contacts)
            forces = nearest_equilibrium(rows, near, compliance, self.friction, self.crushing, self.cohesion, load)
        except NotSolved:
            # In balance to rounding only: there is hardly a choice of forces.
            forces = balanced.forces
        return np.asarray(forces[:, 0])

    def non_associative(self, balanced: ProgramState, found: LimitStatus) -> LimitLoad:
        """The sequence of programs in which friction is that of the normal forces carried over."""
        points = self.friction, self.cohesion, self.crushing, self.tension, self.price
        equations = self.contacts, self.pose, self.matrix, self.dead, self.live
        flow = NonAssociative(*equations, *points, self.total, self.size)
        at_rest, associative = (balanced.forces, balanced.multiplier), partial(self.associative, balanced)
        state, converged, programs = flow.limit(self.at_rest(balanced), at_rest, associative)
        return self.result(state, found if converged else LimitStatus.NOT_CONVERGED, "non-associative", programs)

    def result(self, state: ProgramState, status: LimitStatus, flow: str, programs: int) -> LimitLoad:
        """The state in metres and newtons, its bounds and its certificate recomputed from it."""
        velocity, multiplier = state.velocity, state.multiplier
        if status is LimitStatus.UNBOUNDED:
            velocity = np.zeros_like(velocity)
        relative = (self.matrix.T @ velocity).reshape(-1, self.size)
        live_power = float(self.live @ velocity)
        # Points that are open may close by their gap in a motion whose live power is 1.
        relative[:, 0] += self.price * max(live_power, 0.0)
        drag = self.cohesion if state.drag is None else state.drag
        slope = self.friction if state.drag is None else np.zeros(len(relative))
        slip, brittle = np.linalg.norm(relative[:, 1:], axis=1), np.isfinite(self.crushing)
        # What crushes may come closer than what is rigid, at the price of its strength.
        closer = np.where(brittle, np.maximum(slope * slip - relative[:, 0], 0.0), 0.0)
        crushed = np.where(brittle, self.crushing, 0.0) * closer
        taken = float(drag @ slip + crushed.sum())
        kinematic = (taken - float(self.dead @ velocity)) / live_power if live_power > 0.0 else np.inf
        kinematic += float(self.price @ state.forces[:, 0])
        room = relative[:, 0] + closer - slope * slip
        balance = self.matrix @ state.forces.ravel() + self.dead + multiplier * self.live
        total = self.total or 1.0
        units = 1.0 / unit_lengths(self.pose.positions.shape[1] + self.pose.rotations.shape[1], self.length)
        mechanism = np.zeros((self.assembly.n_blocks, len(units)))
        size = float(np.abs(velocity).max(initial=0.0)) or 1.0
        mechanism[self.assembly.free] = velocity.reshape(-1, len(units)) / size * units
        found = status not in (LimitStatus.UNBOUNDED, LimitStatus.NO_EQUILIBRIUM)
        static = multiplier / self.live_size
        forces = state.forces if self.faces is None else point_forces(self.contacts, self.faces, state.forces)
        forces = forces - np.column_stack([self.tension, np.zeros((len(forces), forces.shape[1] - 1))])
        nothing = np.inf if status is LimitStatus.UNBOUNDED else np.nan
        in_place = replace(self.contacts, gaps=self.gaps)
        return LimitLoad(
            multiplier=static if found else nothing,
            bounds=(static, kinematic / self.live_size) if found else (nothing, nothing),
            certificate=Certificate(
                equilibrium_residual=float(np.abs(balance).max(initial=0.0)) / total,
                friction_excess=friction_excess(state.forces, self.friction, self.cohesion) / total,
                carrying_gap=carrying_gap(in_place, forces),
                largest_penetration=largest_penetration(in_place),
                duality_gap=abs(kinematic - multiplier) / (1.0 + abs(multiplier)) if found else state.gap,
                kinematic_violation=float(np.maximum(-room, 0.0).max(initial=0.0)) / size,
            ),
            status=status,
            flow=flow,
            live_force=self.live_force,
            programs=programs,
            torsion=POINTS if self.faces is None else UNIFORM,
            held=self._held(forces * self.force, mechanism, state.forces[:, 0] >= self.crushing * (1.0 - USED_UP)),
        )

    def _held(self, forces: np.ndarray, mechanism: np.ndarray, at_strength: np.ndarray) -> State:
        """The arrays of a limit load, from forces [N], and which points carry their compressive strength."""
        between, on_blocks = ~is_member(self.contacts), block_forces(self.contacts, self.pose, forces)
        contacts = self.contacts[between]
        return State(
            pose=self.pose,
            contacts=contacts,
            forces=forces[between],
            displacements=relative_velocities(contacts, self.pose, mechanism),
            friction=self.friction[between],
            velocity=mechanism,
            support_forces=np.where(self.assembly.free[:, None], 0.0, on_blocks),
            fell_at=np.where(self.gone, -np.inf, np.nan) if self.gone.any() else np.zeros(0),
            ties=plastic_forces(self.contacts, forces, self.ties, self.ties_at),
            crushing=at_strength[between] if np.isfinite(self.crushing[between]).any() else at_strength[:0],
        )


def _carrying_points(
    gaps: np.ndarray, tension: np.ndarray, closed_gap: float, reach: float
) -> tuple[np.ndarray, np.ndarray]:
    """Numbers of the contact points that carry, (m,) int array, and whether they do so only once they have closed.

    As along the path an open joint with a rest of its strength holds, and does not push. Where it may close it is there
    twice: as one that holds, and as an open one.
    """
    apart, holds = gaps > closed_gap, tension > 0.0
    once, closing = np.flatnonzero(~apart | holds), np.flatnonzero(apart & (gaps <= reach))
    return np.append(once, closing), np.repeat([False, True], [len(once), len(closing)])


def _beyond_give(
    assembly: Assembly,
    interfaces: Interfaces,
    contacts: Contacts,
    gaps: np.ndarray,
    tension: np.ndarray,
    areas: np.ndarray,
) -> np.ndarray:
    """(n,) array [m]: gaps, from those without force, beyond the give under the largest tension [N] over areas [m²]."""
    (stiffness,) = interfaces.values(assembly, contacts.block_a, contacts.block_b, "normal_stiffness")
    # Give of elastic joints is neither a gap nor a penetration.
    elastic = np.where(np.isfinite(stiffness), stiffness, 0.0)
    pulled = np.divide(tension, elastic * areas, out=np.zeros_like(gaps), where=elastic * areas > 0.0)
    return np.where(elastic > 0.0, np.maximum(gaps - pulled, 0.0), gaps)


def remaining(assembly: Assembly, fallen: np.ndarray | None) -> Assembly:
    """The assembly with blocks that have left, (n_blocks,) bool array, no longer free."""
    if fallen is None:
        return assembly
    if np.shape(fallen) != (assembly.n_blocks,) or np.asarray(fallen).dtype != bool:
        raise ValueError(f"fallen is {fallen!r}; give a bool for each of the {counted(assembly.n_blocks, 'block')}")
    return assembly.with_roles(np.where(fallen, FIXED, assembly.roles))


def checked_live(assembly: Assembly, loads: Loads) -> Loads:
    """The loads, checked, with live loads on at least one free block; those on supports are taken off."""
    loads = checked_loads(assembly, loads)
    live = np.where(assembly.free[:, None], loads.live, 0.0)
    if not live.any():
        raise ValueError("no live load acts on any free block; give an acceleration, or Loads whose 'live' is not zero")
    arms = None if loads.live_arms is None else np.where(assembly.free[:, None, None], loads.live_arms, 0.0)
    return replace(loads, live=live, live_arms=arms)
