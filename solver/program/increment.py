"""The linear program of one increment: stated at a geometry, solved, and read back in metres and newtons."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from solver.assembly import find_contacts
from solver.equilibrium import friction_rays, with_slack, wrench_matrix
from solver.geometry.contacts import Contacts
from solver.kinematics import Pose, moved_vertices, unit_lengths
from solver.lp.band import Iterate
from solver.lp.problem import LinearProgram, LPSolution, SolveError, Unbounded
from solver.lp.solve import solve_lp
from solver.results.certificate import Certificate
from solver.results.increment import carries, used_up
from solver.tolerances import AT_LIMIT, BALANCE_TOLERANCE, CARRYING_FRACTION, FALLING_FRACTION, LEFT_WEDGED, ROUNDING

from .light_blocks import light_blocks, with_light_blocks
from .macroblocks import MacroBlocks, free_blocks
from .model import Model


class Locked(Exception):
    """Blocks of infinite strength are wedged between the supports: forces grow without limit."""

    def __init__(self, blocks: tuple[str, ...]) -> None:
        shown = ", ".join(f"'{name}'" for name in blocks[:6]) + (" ..." if len(blocks) > 6 else "")
        super().__init__(f"the supports cannot move on: {len(blocks)} blocks are wedged ({shown})")
        self.blocks = blocks


@dataclass(frozen=True)
class Solved:
    """One solved program at one geometry.

    Attributes
    ----------
    pose : Pose
    contacts : Contacts
    friction : (n_contacts,) array
    forces : (n_contacts, 2) array [N]
    motion : (n_blocks, 3) array [m, m, rad]
        Of the supports as given, of the free blocks as found.
    opening, slip : (n_contacts,) arrays [m]
        Normal and tangential relative displacement of each contact point in that motion.
    sliding : (n_contacts,) array [m]
        Slip, drift not counted, of the points whose motion takes them to the edge of their friction cone; else 0.
    sticking : (n_contacts,) bool array
        Points that carry force and do not slide.
    falling : bool
        Whether blocks move by the whole trust region because no equilibrium holds them.
    certificate : Certificate
    support_forces : (n_blocks, 3) array [N, N, N·m]
    multiplier : float
        Of the model's live load; 0 where it has none.
    early : Iterate or None
        From which the next closing of the same gaps may start.
    """

    pose: Pose
    contacts: Contacts
    friction: np.ndarray
    forces: np.ndarray
    motion: np.ndarray
    opening: np.ndarray
    slip: np.ndarray
    sliding: np.ndarray
    sticking: np.ndarray
    falling: bool
    certificate: Certificate
    support_forces: np.ndarray
    multiplier: float = 0.0
    early: Iterate | None = None


def solve_program(
    model: Model,
    pose: Pose,
    support_motion: np.ndarray | None = None,
    contacts: Contacts | None = None,
    drift: np.ndarray | None = None,
    allowance: np.ndarray | None = None,
    work: float = 0.0,
) -> Solved:
    """States and solves the static program of one increment.

    Parameters
    ----------
    model : Model
    pose : Pose
    support_motion : (n_blocks, 3) array [m, m, rad], optional
        What the supports do in this program; they stand still by default.
    contacts : Contacts, optional
        Found at the pose by default.
    drift : (n_contacts,) array [m], optional
        Slip that has already happened without being asked for, and that friction takes back.
    allowance : (n_contacts,) array [m], optional
        Lift of the associative flow rule that is taken off in advance where a contact point slides.
    work : float [N·m]
        What the model's live load does at a multiplier of 1: it holds the motion, and the multiplier is its price.

    Raises
    ------
    Locked
        If the supports cannot move like that: blocks of infinite strength are wedged between them.
    SolveError
        If HiGHS gives no solution that passes its check.

    Notes
    -----
    Over the multipliers λ ≥ 0 of the rays n ∓ μ t of the friction cones and unbalanced forces r⁺, r⁻ ≥ 0:

        minimise  Σ (g_k n + relative support motion + drift) · ray λ  +  ρ (r⁺ + r⁻)
        subject to  |A λ + r⁺ - r⁻ + f| ≤ ε        for every free block

    the dual of the kinematic program N + g ≥ μ |T + drift| with all movements bounded by the trust region ρ, so
    that it is always feasible: unbalanced force at the optimum means that blocks move by the whole trust region.
    After Portioli & Cascini (2017), https://doi.org/10.1016/j.engstruct.2017.06.073, with the trust region, the
    drift and the tolerance ε added.

    With a live load l its multiplier α, of either sign, joins the unknowns: + α l in the balance and - α · work in the
    cost; in the kinematic program l · motion = work.
    """
    assembly = model.assembly
    if contacts is None:
        contacts = find_contacts(assembly, moved_vertices(assembly, pose), model.reach)
    if support_motion is None:
        support_motion = np.zeros((assembly.n_blocks, 3))
    model.tally.programs += 1
    friction = model.interfaces.friction(assembly, contacts.block_a, contacts.block_b)
    matrix = wrench_matrix(contacts, pose, model.length)
    given = matrix.T @ (support_motion / model.lengths).ravel()
    if allowance is not None:
        given[0::2] += allowance / model.length
    distance = given + distances_of(model, contacts, drift, ROUNDING)
    rays = friction_rays(friction)
    balance = sp.csc_array(sp.csr_array(matrix)[np.repeat(assembly.free, 3)] @ rays)
    rows = balance.shape[0]
    external = model.scaled_load[assembly.free].ravel()
    tolerance = BALANCE_TOLERANCE * model.total_load
    cost = [rays.T @ distance, np.full(2 * rows, model.trust / model.length)]
    columns = [balance]
    live, live_size = model.scaled_live
    if live_size > 0.0:
        column = sp.csc_array(live[assembly.free].reshape(-1, 1))
        columns += [column, -column]
        cost.append(np.array([-1.0, 1.0]) * work / (model.force * model.length * live_size))
    program = LinearProgram(
        cost=np.concatenate(cost),
        matrix=with_slack(*columns),
        lower=-external - tolerance,
        upper=-external + tolerance,
        places=places_of_rows(free_blocks(assembly), pose),
    )
    try:
        program, solution, distance = solved_or_left_wedged(
            program, rays, distance, given + distances_of(model, contacts, drift, LEFT_WEDGED)
        )
    except Unbounded as ray:
        forces = (rays @ ray.x[: 2 * len(contacts)]).reshape(-1, 2)
        squeezed = np.unique(contacts.block_a[carries(forces, CARRYING_FRACTION)])
        raise Locked(tuple(assembly.names[i] for i in squeezed)) from None
    falls = np.full(rows, FALLING_FRACTION * model.total_load)
    light = light_blocks(model)
    if light.any():
        solution, falls = with_light_blocks(model, program, solution, light, balance, falls)
    multipliers = solution.x[: 2 * len(contacts)]
    unbalanced = solution.x[2 * len(contacts) : 2 * (len(contacts) + rows)].reshape(2, -1)
    # What is out of balance moves by the whole trust region; of the lightest blocks the duals no longer say so.
    fall = (unbalanced > falls) & np.repeat(light, 3)
    dual = np.where(fall.any(axis=0), (fall[0] * 1.0 - fall[1]) * model.trust / model.length, solution.row_dual)
    motion = support_motion.copy()
    motion[assembly.free] = -dual.reshape(-1, 3) * model.lengths
    level = float(solution.x[-2] - solution.x[-1]) if live_size > 0.0 else 0.0
    scaled_forces = rays @ multipliers
    resultant = (matrix @ scaled_forces).reshape(-1, 3)
    relative = matrix.T @ (motion / model.lengths).ravel()
    approach = distance + matrix.T @ (np.where(assembly.free[:, None], motion, 0.0) / model.lengths).ravel()
    room = rays.T @ approach
    certificate = _certificate(model, contacts, resultant + level * live, multipliers, room, solution)
    at_limit = room.reshape(-1, 2).min(axis=1) <= AT_LIMIT
    forces = scaled_forces.reshape(-1, 2)
    slid = np.abs(approach[1::2])
    sliding = np.where(at_limit & (slid > AT_LIMIT), slid * model.length, 0.0)
    on_supports = np.where(assembly.free[:, None], 0.0, resultant)
    return Solved(
        pose=pose,
        contacts=contacts,
        friction=friction,
        forces=forces * model.force,
        motion=motion,
        opening=relative[0::2] * model.length,
        slip=relative[1::2] * model.length,
        sliding=sliding,
        sticking=(forces[:, 0] > 0.0) & ~(used_up(forces, friction) & (sliding > 0.0)),
        falling=bool((unbalanced > falls).any()),
        certificate=certificate,
        support_forces=on_supports * model.force * unit_lengths(3, model.length),
        multiplier=level / live_size if live_size > 0.0 else 0.0,
    )


def places_of_rows(parts: MacroBlocks, pose: Pose) -> np.ndarray:
    """(n_dof n_parts, dim) array [m]: where each part is, for each of its freedoms."""
    moving = parts.part >= 0
    part, places = parts.part[moving], pose.positions[moving]
    blocks = np.maximum(np.bincount(part, minlength=parts.n_parts), 1)
    mean = np.stack([np.bincount(part, place, parts.n_parts) for place in places.T], axis=1) / blocks[:, None]
    return np.repeat(mean, places.shape[1] + pose.rotations.shape[1], axis=0)


def solved_or_left_wedged(
    program: LinearProgram,
    rays: sp.csc_array,
    distance: np.ndarray,
    left: np.ndarray,
    routes: tuple[str, ...] | None = None,
) -> tuple[LinearProgram, LPSolution, np.ndarray]:
    """The program, its solution and its distances; with those that leave small penetration alone where it has none."""
    try:
        return program, solve_lp(program, routes), distance
    except (Unbounded, SolveError):
        if (left == distance).all():
            raise
        cost = np.concatenate([rays.T @ left, program.cost[rays.shape[1] :]])
        program = replace(program, cost=cost)
        return program, solve_lp(program, routes), left


def distances_of(model: Model, contacts: Contacts, drift: np.ndarray | None, left: float) -> np.ndarray:
    """(2 n_contacts,) array: gaps and drift in units of the program, without rounding and what is to be left."""
    distances = np.zeros(2 * len(contacts))
    gaps = contacts.gaps / model.length
    distances[0::2] = np.where((gaps > -left) & (gaps < ROUNDING), 0.0, gaps)
    if drift is not None:
        distances[1::2] = np.where(np.abs(drift / model.length) < left, 0.0, drift / model.length)
    return distances


def _certificate(
    model: Model,
    contacts: Contacts,
    resultant: np.ndarray,
    multipliers: np.ndarray,
    room: np.ndarray,
    solution: LPSolution,
) -> Certificate:
    """The measures by which the program proves itself, from its own solution and nothing HiGHS says.

    ``room`` is how far each contact point is from its friction cone's edges after the motion, per ray.
    """
    out_of_balance = (resultant + model.scaled_load)[model.assembly.free]
    return Certificate(
        equilibrium_residual=float(np.abs(out_of_balance).max(initial=0.0)) / model.total_load,
        largest_penetration=float(np.maximum(-contacts.gaps, 0.0).max(initial=0.0)),
        duality_gap=solution.gap,
        complementarity=float(np.abs(multipliers @ room)) / (1.0 + abs(solution.objective)),
        kinematic_violation=float(np.maximum(-room, 0.0).max(initial=0.0)),
    )
