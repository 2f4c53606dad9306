"""Gaps, penetration and drift that a linear motion leaves: closed by a program, or by Newton's method."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from solver.assembly import Assembly, find_contacts, measure_contacts
from solver.equilibrium import friction_rays, with_slack, wrench_matrix
from solver.geometry.contacts import Contacts, matched_contacts
from solver.geometry.planar_contacts import feature_pairs, measured_points, past_the_end
from solver.kinematics import Pose, moved, moved_vertices
from solver.lp.problem import LinearProgram, SolveError, Unbounded
from solver.lp.solve import INTERIOR_ROUTES
from solver.results.increment import carries
from solver.tolerances import (
    CARRYING_FRACTION,
    COORDINATE_ROUNDING,
    CORNER_TOLERANCE,
    GEOMETRY_TOLERANCE,
    INTERIOR_TOLERANCE,
    LARGEST_DRIFT,
    LEFT_WEDGED,
    ROUNDING,
)

from .increment import Solved, distances_of, places_of_rows, solved_or_left_wedged
from .macroblocks import MacroBlocks, free_blocks
from .model import Model, largest_movement

#: Resistance of every block to being moved by the closing of gaps, in mean block weights: without friction at the
#: points that slide, blocks could drift along their joints for nothing.
CLOSING_FRICTION = 1e-2

#: Newton's method is given up where it has not converged after so many iterations, or moves blocks by more than so
#: many times the error it is to correct: then the mechanism itself has to change, which takes a program.
NEWTON_ITERATIONS = 8
NEWTON_REACH = 100.0

#: Contact points of a face depend on each other; this much on the diagonal, against entries near 1, keeps their
#: equations solvable and their solution the smallest to ten digits.
REDUNDANCY = 1e-11

#: Part of the expected lift that is taken off: all of it could end in penetration, which a wedge locked by friction
#: cannot give back.
ALLOWED = 0.999

#: Largest slip per closing of a gap that is extrapolated; beyond, joints are nearly parallel to the motion.
STEEPEST_CLOSING = 30.0

#: Part of the gap left that the last program must have closed, lest rounding be extrapolated.
SMALLEST_CLOSING = 0.01


def closing_program(
    model: Model, pose: Pose, contacts: Contacts, drift: np.ndarray, before: Solved, bodies: MacroBlocks | None = None
) -> Solved:
    """Closes the gaps that sliding and finite rotation have left, without a lift of its own.

    Parameters
    ----------
    model : Model
    pose : Pose
    contacts : Contacts
        At the pose; they may contain others than ``before``.
    drift : (n_contacts,) array [m]
    before : Solved
        The last program; its forces say which points are to be closed, and how much each counts.
    bodies : MacroBlocks, optional
        What moves as one; every free block moves for itself by default.

    Returns
    -------
    Solved
        Supports at rest. Its forces are weights of the closing, not an equilibrium under the loads.

    Notes
    -----
    minimise Σ N⁰_k (N_k + g_k) over the movements of the free blocks, where N⁰ are the normal forces of the last
    program, subject to N_k + g_k ≥ 0 at every point and N_k + g_k ≥ μ |T_k + drift_k| where it stuck: points that slide
    do so without friction. In its static form it is a program of the same shape whose load is what the forces of
    the last program balance; these forces are admissible, so that it always has a solution.
    """
    assembly = model.assembly
    model.tally.programs += 1
    friction = model.interfaces.friction(assembly, contacts.block_a, contacts.block_b)
    place, same = matched_contacts(contacts, before.contacts)
    sticking = same & before.sticking[place]
    parts = bodies or free_blocks(assembly)
    # Points within a macro-block say nothing about its movement.
    across = parts.part[contacts.block_a] != parts.part[contacts.block_b]
    matrix = wrench_matrix(contacts, pose, model.length)
    columns = np.repeat(across, 2)
    columns[1::2] &= sticking
    rays = friction_rays(np.where(sticking, friction, 0.0))[:, columns]
    drift = np.where(sticking, drift, 0.0)
    distance = distances_of(model, contacts, drift, ROUNDING)
    if bodies is not None:
        # An interior solution is no more exact than that, and without it large blocks wedged against each other, by
        # less, leave no interior at all.
        distance[0::2] += INTERIOR_TOLERANCE
    weights = np.where(same[:, None], before.forces[place], 0.0) / model.force
    weights[:, 1] = np.where(sticking, weights[:, 1], 0.0)
    by_body = sp.csr_array(parts.motions.T @ matrix)
    balance = sp.csc_array(by_body @ rays)
    load = by_body @ np.where(across[:, None], weights, 0.0).ravel()
    rows = balance.shape[0]
    resistance = CLOSING_FRICTION * np.abs(parts.motions).sum(axis=0)
    program = LinearProgram(
        cost=np.concatenate([rays.T @ distance, np.full(2 * rows, model.trust / model.length)]),
        matrix=with_slack(balance),
        lower=load - resistance,
        upper=load + resistance,
        places=places_of_rows(parts, pose),
        start=before.early,
    )
    routes = None if bodies is None else INTERIOR_ROUTES
    try:
        _, solution, _ = solved_or_left_wedged(
            program, rays, distance, distances_of(model, contacts, drift, LEFT_WEDGED), routes
        )
    except Unbounded:
        # A corner that has gone in too deep, wedged between blocks that cannot give way: a smaller step may not.
        raise SolveError("gaps that an increment has left cannot be closed: blocks are wedged") from None
    motion = -(parts.motions @ solution.row_dual).reshape(-1, 3) * model.lengths
    forces = (rays @ solution.x[: rays.shape[1]]).reshape(-1, 2)
    forces = np.where(across[:, None], forces, weights)
    relative = matrix.T @ (motion / model.lengths).ravel() * model.length
    return replace(
        before,
        pose=pose,
        contacts=contacts,
        friction=friction,
        forces=forces * model.force,
        motion=motion,
        opening=relative[0::2],
        slip=relative[1::2],
        sliding=np.zeros(len(contacts)),
        sticking=sticking & (forces[:, 0] > 0.0),
        falling=False,
        # Blocks that each move for themselves may come to rest in another way than from nothing, and less well.
        early=None if bodies is None else solution.early,
    )


def closed_points(model: Model, pose: Pose, solved: Solved) -> tuple[Pose, Contacts, float]:
    """Closes the contact points that carry force, by Newton's method, where that is all there is to correct.

    Returns
    -------
    pose : Pose
        The best pose found; the given one where closing the points moves blocks far more than there is to correct.
    contacts : Contacts
        At that pose.
    error : float [m]
        Deepest penetration, or largest gap or drift at a contact point that carries force.

    Notes
    -----
    Points that carry force close their gap, and those that stick return to where they stuck: the smallest movement of
    the blocks that does this, from one sparse factorisation per iteration. Friction leaves no dilation behind. A
    program would cost a hundred times as much.
    """
    assembly = model.assembly
    contacts = contacts_after(model, pose, solved)
    error = _geometry_error(assembly, contacts, solved)
    best, allowed = (pose, contacts, error), NEWTON_REACH * error
    travelled = 0.0
    for _ in range(NEWTON_ITERATIONS):
        if best[2] <= GEOMETRY_TOLERANCE * model.length:
            break
        motion = _closing_motion(model, pose, contacts, solved)
        travelled += largest_movement(model, motion)
        if not travelled <= allowed:
            break
        pose = moved(pose, motion)
        contacts = contacts_after(model, pose, solved)
        error = _geometry_error(assembly, contacts, solved)
        if error > best[2] / 2.0:
            break
        best = (pose, contacts, error)
    return best


def _closing_motion(model: Model, pose: Pose, contacts: Contacts, solved: Solved) -> np.ndarray:
    """(n_blocks, 3) array: smallest movement of the free blocks that closes, to first order, what carries force."""
    assembly = model.assembly
    carrying, sticking = carrying_and_sticking(assembly, contacts, solved)
    drift, _ = drift_and_allowance(assembly, contacts, solved)
    wanted = np.zeros(2 * len(contacts))
    wanted[0::2], wanted[1::2] = -contacts.gaps / model.length, -drift / model.length
    rows = np.zeros(2 * len(contacts), dtype=bool)
    rows[0::2], rows[1::2] = carrying, sticking
    freedoms = np.repeat(assembly.free, 3)
    jacobian = sp.csr_array(wrench_matrix(contacts, pose, model.length).T)[rows][:, freedoms]
    gram = sp.csc_array(jacobian @ jacobian.T + REDUNDANCY * sp.identity(jacobian.shape[0]))
    motion = np.zeros((assembly.n_blocks, 3))
    motion[assembly.free] = (jacobian.T @ splu(gram).solve(wanted[rows])).reshape(-1, 3)
    return motion * model.lengths


def contacts_after(model: Model, pose: Pose, solved: Solved) -> Contacts:
    """Contacts found at the pose; those that carried force stay what they were, wherever on their line they are now.

    A hinge whose corner has come to lie a hair past the end of its edge, or outside the zone in which it counts as a
    corner on a corner, must neither vanish nor change its kind before its drift is corrected. Corners that have gone
    through the edge they faced stay too, however deep: found afresh they would seem to belong to a face behind.
    """
    assembly = model.assembly
    vertices = moved_vertices(assembly, pose)
    found = find_contacts(assembly, vertices, model.reach)
    before = solved.contacts
    carrying = np.flatnonzero(solved.forces[:, 0] > 0.0)
    carrying = carrying[~_slid_off(assembly, vertices, before, carrying, solved.sliding[carrying] > 0.0)]
    kept = np.union1d(carrying, _gone_through(assembly, vertices, before))
    own, reverse = feature_pairs(assembly.polygons, before)
    covered = np.concatenate([own[kept], reverse[kept]])
    own, reverse = feature_pairs(assembly.polygons, found)
    new = ~(np.isin(own, covered) | (np.isin(reverse, covered) & (reverse >= 0)))
    features = np.concatenate([before.features[kept], found.features[new]])
    return measured_points(assembly.polygons, vertices, features)


def _gone_through(assembly: Assembly, vertices: np.ndarray, before: Contacts) -> np.ndarray:
    """Numbers of the contact points whose corner was in front of its edge and is now behind it."""
    now = measure_contacts(assembly, vertices, before)
    past, _, on_corner = past_the_end(assembly.polygons, now)
    inside = (past <= 0.0) & ~on_corner
    rounding = COORDINATE_ROUNDING * assembly.block_size
    return np.flatnonzero(inside & (before.gaps >= -rounding) & (now.gaps < -rounding))


def _slid_off(
    assembly: Assembly, vertices: np.ndarray, before: Contacts, kept: np.ndarray, sliding: np.ndarray
) -> np.ndarray:
    """Whether corners that carried force have left their edge for good: by sliding, or by more than any drift."""
    past, zone, on_corner = past_the_end(assembly.polygons, measure_contacts(assembly, vertices, before[kept]))
    return (past > zone / CORNER_TOLERANCE * LARGEST_DRIFT) | (sliding & ~on_corner & (past > zone))


def drift_and_allowance(assembly: Assembly, contacts: Contacts, solved: Solved) -> tuple[np.ndarray, np.ndarray]:
    """What the last program leaves to the next at each contact point.

    Returns
    -------
    drift : (n_contacts,) array [m]
        How far each point is along its joint from where the last program put it.
    allowance : (n_contacts,) array [m]
        Lift to take off in advance. A gap that closes by sliding opens again by μ · slip in the same program, so that
        gaps would only shrink by a constant factor; a point that closed and slid in the last program is expected
        to do so again in the same proportion.
    """
    before, same = matched_contacts(contacts, solved.contacts)
    expected = solved.contacts.slip[before, 0] + solved.slip[before]
    drift = np.where(same, contacts.slip[:, 0] - expected, 0.0)
    closing, slip = -solved.opening[before], solved.sliding[before]
    again = same & (slip > 0.0) & (closing > SMALLEST_CLOSING * contacts.gaps) & (contacts.gaps > 0.0)
    ratio = np.minimum(np.divide(slip, closing, out=np.zeros_like(slip), where=again), STEEPEST_CLOSING)
    return drift, np.where(again, ALLOWED * solved.friction[before] * ratio * contacts.gaps, 0.0)


def carrying_and_sticking(assembly: Assembly, contacts: Contacts, solved: Solved) -> tuple[np.ndarray, np.ndarray]:
    """Points that carried force in the last program, and those of them that stuck: (n_contacts,) bool arrays."""
    place, same = matched_contacts(contacts, solved.contacts)
    carrying = same & carries(solved.forces[place], CARRYING_FRACTION)
    return carrying, carrying & solved.sticking[place]


def _geometry_error(assembly: Assembly, contacts: Contacts, solved: Solved) -> float:
    """Deepest penetration, largest gap at a contact point that carries force, or drift at one that sticks [m]."""
    carrying, sticking = carrying_and_sticking(assembly, contacts, solved)
    drift, _ = drift_and_allowance(assembly, contacts, solved)
    return max(
        float(np.maximum(-contacts.gaps, 0.0).max(initial=0.0)),
        float(np.abs(contacts.gaps[carrying]).max(initial=0.0)),
        float(np.abs(drift[sticking]).max(initial=0.0)),
    )
