"""Limit load: the largest multiplier of the live loads that a structure carries at one geometry; its mechanism."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np

from solver.assembly import FIXED, Assembly, check_blocks, find_contacts
from solver.contact_step.problem import NotSolved
from solver.equilibrium import block_forces
from solver.interfaces import Interfaces
from solver.kinematics import Pose, moved_vertices, relative_velocities, unit_lengths
from solver.loads import Loads, checked_loads
from solver.path.members import Members
from solver.path.mortar import Mortar
from solver.path.state import Place
from solver.path.stepping import Stepper
from solver.program.model import Model, mean_load
from solver.program.non_associative import non_associative_limit
from solver.program.static_program import ProgramState, StaticProgram
from solver.program.strength import ForceLimits
from solver.program.torsion import POINTS, TORSIONS, UNIFORM, Faces
from solver.programs.problem import SolveError, Unbounded
from solver.results.certificate import Certificate, carrying_gap, largest_penetration
from solver.results.increment import Bonds, State
from solver.results.response import LimitLoad, LimitStatus
from solver.ties import Tie, TieForces, check_ties, is_member, plastic_forces, slack, ties_as_drawn
from solver.tolerances import COMPUTED_GAP, DRAWN_GAP, FALLING_FRACTION, USED_UP
from solver.words import checked, plain


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

    Cohesion c and compressive strength σ, off by default, give each contact point its part A of the face that touches
    there (half the distance to its neighbours, times the thickness): |T| ≤ μ N + c A and -τ A ≤ N ≤ σ A with the
    tensile strength τ. With all of its force at its ends a face carries larger moments than the stress block of a
    continuous one, so that crushing at a toe is found later than it comes. What crushes moves by the same flow rule.

    At the pose of an increment its bonds say what is closed: gaps count from those at which elastic joints have no
    force, and points with tension left hold at any gap, as in the bounds of a path. The give that the forces of the
    limit state would add is left out.

    With a displacement δ, points that are open by a gap g carry at a price: maximise α - Σ g N / w, where w is δ times
    the sum of the live forces; its dual has N(q) + g ≥ μ |T(q)| and live · q = w. That is the first program of a
    pushover with an increment δ, and at closed joints the limit load, whatever δ is.

    Under a uniform pressure |(T, M / r)| ≤ μ N, too, of the resultants of a face about the centroid of the polygon that
    its points span, r their mean distance from it: exact for the shear force T alone and for the torsion M alone.

    Non-associative flow is a sequence of such programs in the manner of Gilbert, Casapulla & Ahmed (2006),
    https://doi.org/10.1016/j.compstruc.2006.02.005: the friction cone of each point is replaced by |T| ≤ μ N⁰ with N⁰
    out of the normal forces of the programs before, and among equal multipliers the forces nearest to N⁰ are taken.
    Ours has no dilatancy from the first program on and begins with the forces of least elastic energy under the dead
    load; what carries nothing there is asked last, so that a block that just fits between floor and ceiling slides at
    μ, without the prestress that makes its associative limit load unbounded. Where it converges (N = N⁰) it is a
    complete solution for friction without dilatancy, the power of the loads what friction takes, and never above the
    associative value. It is not proved to be the least, and its two values are no bounds. Not converged, the program
    that came nearest is given, or associative flow where that carries less, whose value is then the upper bound. Where
    forces that a program adds are within friction and the associative program is unbounded, so is this one.
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
    displacement, closed_gap = plain(displacement, "float", "displacement"), plain(closed_gap, "float", "closed_gap")
    for name, value in (("displacement", displacement), ("closed_gap", closed_gap)):
        if not 0.0 <= value < np.inf:
            raise ValueError(f"{name} is {value:g} m; it must be a finite number of at least 0")
    gone = np.zeros(assembly.n_blocks, dtype=bool) if fallen is None else np.asarray(fallen)
    told = (ties_as_drawn(ties, assembly, pose) if ties_at is None else ties_at).held(ties, gone)
    force = mean_load(left, loads) or float(np.abs(loads.live[left.free]).max())
    model = Model(left, interfaces, loads, left.block_size, force, gone, has_live=True, ties=tuple(ties))
    program = _AtPose(model.without(gone), pose, closed_gap, displacement, torsion, told, bonds_at)
    status = LimitStatus.FOUND
    balanced, unbalanced = program.most_balanced(with_live=False)
    if unbalanced > FALLING_FRACTION:
        falling, status = balanced, LimitStatus.HELD
        balanced, unbalanced = program.most_balanced()
        if unbalanced > FALLING_FRACTION:
            return program.result(falling, LimitStatus.NO_EQUILIBRIUM, flow)
    try:
        if flow == "associative":
            return program.result(program.bound(-1.0, balanced), status, flow)
        state, converged = non_associative_limit(program, program.at_rest(balanced), balanced)
    except Unbounded:
        return program.result(balanced, LimitStatus.UNBOUNDED, flow)
    if converged:
        return program.result(state, status, flow)
    most = np.inf
    with suppress(SolveError, Unbounded):
        associative = program.bound(-1.0, balanced)
        most, state = associative.multiplier * program.unit, min(state, associative, key=lambda of: of.multiplier)
    nearest = program.result(state, LimitStatus.NOT_CONVERGED, flow)
    return replace(nearest, bounds=(nearest.multiplier, most))


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


class _AtPose(StaticProgram):
    """The static program of one geometry, with gaps beyond the give of joints, by which they are open or closed."""

    def __init__(
        self,
        model: Model,
        pose: Pose,
        closed_gap: float,
        displacement: float,
        torsion: str,
        ties_at: TieForces,
        bonds: Bonds | None,
    ) -> None:
        assembly, interfaces, members, d = model.assembly, model.interfaces, Members(model), model.dimension
        # Open points close within a displacement, and hold with what is left of their strength.
        reach = max(closed_gap, model.length / 4.0) if displacement > 0.0 or bonds is not None else closed_gap
        contacts = model.standing(find_contacts(assembly, moved_vertices(assembly, pose), reach))
        mortar, place = Mortar(model), members.installed(Place.unloaded(pose), 0, ties_at)
        place = mortar.cast(place, contacts, closed_gap) if bonds is None else replace(place, bonds=bonds)
        contacts = members.beside(contacts, pose, place.tie_lengths)
        joints, tied = mortar.points(place, contacts), is_member(contacts)
        # Give of elastic joints is neither a gap nor a penetration.
        gaps = joints.beyond_give(contacts.gaps, -joints.tension)
        gaps = np.where(joints.give[:, 0] > 0.0, np.maximum(gaps, 0.0), gaps)
        gaps[tied] = slack(contacts[tied], len(model.ties))
        (strength,) = interfaces.values(assembly, contacts.block_a, contacts.block_b, "compressive_strength")
        whole = place.bonds.of(contacts)
        # What touches alone crushes at once.
        areas = np.where((bonds is None) & (contacts.gaps <= closed_gap), whole.left, 1.0) * whole.areas
        crushing = np.multiply(strength, areas, out=np.full(len(gaps), np.inf), where=np.isfinite(strength))
        crushing /= model.force
        # Members are plastic.
        crushing[tied] = members.strength[contacts.features[tied, 1]]
        # As along the path an open joint with a rest of its strength holds, and does not push. Where it may close it is
        # there twice: as one that holds, and as an open one.
        apart = gaps > closed_gap
        closes = apart & (gaps <= reach) & (displacement > 0.0)
        once, closing = np.flatnonzero(~apart | (joints.tension > 0.0)), np.flatnonzero(closes)
        number, is_open = np.append(once, closing), np.repeat([False, True], [len(once), len(closing)])
        contacts, gaps = contacts[number], gaps[number]
        crushing = np.where(is_open | (gaps <= closed_gap), crushing[number], 0.0)
        cohesion, tension = (np.where(is_open, 0.0, of[number]) for of in (joints.cohesion, joints.tension))
        friction = np.where(is_member(contacts), 0.0, interfaces.friction(assembly, contacts.block_a, contacts.block_b))
        faces = Faces.of(contacts, model.length, friction) if torsion == UNIFORM and len(contacts) else None
        if faces is not None:
            faces.refuse_not_convex(contacts, assembly)
        limits = ForceLimits(-tension, crushing, np.maximum(cohesion - friction * tension, 0.0))
        price = np.zeros(len(contacts))
        if displacement > 0.0:
            # In multipliers of the scaled live load; of forces their points count, not what they turn about centroids.
            live, _ = model.scaled_live(pose)
            total = np.linalg.norm(live[:, :d], axis=1).sum() or np.linalg.norm(live[:, d:], axis=1).sum()
            price = np.where(is_open, gaps, 0.0) / displacement / total
        super().__init__(model, pose, contacts, friction, limits, price, senses=(1.0,), faces=faces, exact=True)
        self.gaps, self.ties_at = gaps, ties_at

    def at_rest(self, balanced: ProgramState) -> np.ndarray:
        """(n,) array: normal forces of the state of least elastic energy under the dead load, where there is one."""
        none, compliance = np.zeros_like(self.contacts.points), Stepper.joint_compliance(self.contacts)
        try:
            forces = self.nearest(none, compliance, balanced.multiplier) - self.least
        except NotSolved:
            # In balance to rounding only: there is hardly a choice of forces.
            forces = balanced.forces
        return np.asarray(forces[:, 0])

    def result(self, state: ProgramState, status: LimitStatus, flow: str) -> LimitLoad:
        """The state in metres and newtons, its bounds and its certificate recomputed from it."""
        model, multiplier = self.model, state.multiplier
        if status is LimitStatus.UNBOUNDED:
            state = replace(state, velocity=np.zeros_like(state.velocity), face_rates=0.0)
        velocity, (kinematic, violation) = state.velocity, self.kinematic(state)
        balance = self.matrix @ state.forces.ravel() + self.dead + multiplier * self.live
        total, crushing = model.total_load or 1.0, self.limits.beyond_least
        size, mechanism = float(np.abs(velocity).max(initial=0.0)) or 1.0, np.zeros_like(model.load)
        mechanism[model.assembly.free] = velocity.reshape(-1, model.n_dof) / size
        mechanism /= unit_lengths(model.n_dof, model.length)
        found = status not in (LimitStatus.UNBOUNDED, LimitStatus.NO_EQUILIBRIUM)
        static = multiplier * self.unit
        forces = state.forces + self.least
        nothing = np.inf if status is LimitStatus.UNBOUNDED else np.nan
        in_place = replace(self.contacts, gaps=self.gaps)
        return LimitLoad(
            multiplier=static if found else nothing,
            bounds=(static, kinematic * self.unit) if found else (nothing, nothing),
            certificate=Certificate(
                equilibrium_residual=float(np.abs(balance).max(initial=0.0)) / total,
                friction_excess=self.friction_excess(state.forces, self.limits.cohesion) / total,
                carrying_gap=carrying_gap(in_place, forces),
                largest_penetration=largest_penetration(in_place),
                duality_gap=abs(kinematic - multiplier) / (1.0 + abs(multiplier)) if found else state.gap,
                kinematic_violation=violation / size,
            ),
            status=status,
            flow=flow,
            live_force=model.live_force,
            programs=self.programs,
            torsion=POINTS if self.faces is None else UNIFORM,
            held_by=model.held_by(-balance.reshape(-1, model.n_dof)) if status is LimitStatus.NO_EQUILIBRIUM else "",
            held=self._held(forces * model.force, mechanism, state.forces[:, 0] >= crushing * (1.0 - USED_UP)),
        )

    def _held(self, forces: np.ndarray, mechanism: np.ndarray, at_strength: np.ndarray) -> State:
        """The arrays of a limit load, from forces [N], and which points carry their compressive strength."""
        model = self.model
        between, on_blocks = ~is_member(self.contacts), block_forces(self.contacts, self.pose, forces)
        contacts = self.contacts[between]
        return State(
            pose=self.pose,
            contacts=contacts,
            forces=forces[between],
            displacements=relative_velocities(contacts, self.pose, mechanism),
            friction=self.friction[between],
            velocity=mechanism,
            support_forces=np.where(model.assembly.free[:, None], 0.0, on_blocks),
            fell_at=np.where(model.fallen, -np.inf, np.nan) if model.fallen.any() else np.zeros(0),
            ties=plastic_forces(self.contacts, forces, model.ties, self.ties_at),
            crushing=at_strength[between] if np.isfinite(self.limits.most[between]).any() else at_strength[:0],
        )


def remaining(assembly: Assembly, fallen: np.ndarray | None) -> Assembly:
    """The assembly with blocks that have left, (n_blocks,) bool array, no longer free."""
    if fallen is None:
        return assembly
    return assembly.with_roles(np.where(assembly.flags(fallen, "fallen"), FIXED, assembly.roles))


def checked_live(assembly: Assembly, loads: Loads) -> Loads:
    """The loads, checked, with live loads on at least one free block; those on supports are taken off."""
    loads = checked_loads(assembly, loads)
    free = assembly.free[:, None]
    if not (loads.live_at(assembly, Pose.initial(assembly)) * free).any():
        raise ValueError("no live load acts on any free block; give an acceleration, or Loads whose 'live' is not zero")
    of = {"live": free, "live_arms": free[:, :, None], "live_acceleration": free}
    live = {name: kept * given for name, kept in of.items() if (given := getattr(loads, name)) is not None}
    return replace(loads, **live)
