"""From the program's linear motion to an exact geometry: rigid update and correctors."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from .assembly import Assembly
from .contact import CORNER_TOLERANCE, Contacts, end_zone, feature_pairs, find_contacts, measure_contacts
from .equilibrium import equilibrium_matrix
from .kinematics import Pose, moved, moved_vertices
from .lp import SolveError
from .macroblocks import MacroBlocks, macro_blocks
from .program import Model, Solved, closing_program, matched_contacts, solve_program

__all__ = ["Falls", "NotConverged", "at_rest", "corrected", "solve_again"]

#: A geometry is exact enough when contact points that carry force are closed, and those that stick have
#: not moved along the joint, to this fraction of the block size.
GEOMETRY_TOLERANCE = 1e-8

#: A pose is an equilibrium when a program at rest moves no block by more than this, in block sizes: friction leaves
#: a little freedom at the edge of its cone, a structure that has to find another equilibrium moves much further.
STILL = 1e-5

#: Step of a descent, and the farthest that blocks may fall in one, in block sizes.
DESCENT_STEP, FARTHEST_FALL = 0.1, 0.5

#: Contact points below this fraction of the largest normal force do not decide whether a geometry is exact.
CARRYING_FRACTION = 1e-6


#: Drift of a hinge within an increment, as a fraction of the shortest edge, before it is corrected: second order in
#: the rotation, which an increment keeps below a few hundredths.
LARGEST_DRIFT = 1e-2

#: Newton's method is given up where it has not converged after so many iterations, or moves blocks by more than so
#: many times the error it is to correct: then the mechanism itself has to change, which takes a program.
NEWTON_ITERATIONS = 8
NEWTON_REACH = 100.0

#: Contact points of a face depend on each other; this much on the diagonal, against entries near 1, keeps their
#: equations solvable and their solution the smallest to ten digits.
REDUNDANCY = 1e-11

#: Programs that close gaps one after another before a full program is solved again.
CLOSINGS = 4

#: Where friction keeps many points on the edge of sliding, corrections converge slowly. After CLOSINGS programs gaps of
#: this part of the increment's movement may stay (the next program sees them, so they do not add up), and penetration
#: of this part of the smallest block. In programs too large for vertex solutions, whose interior solutions say less
#: clearly what sticks, ten times as much of either.
GAP_LEFT, GAP_LEFT_LARGE, PENETRATION_LEFT = 1e-2, 1e-1, 5e-7

#: Exact geometries from which a program still moves on, before it is followed in small steps: friction at the edge of
#: its cone may lead it round in a circle.
RESTLESS = 8

#: Part of the expected lift that is taken off: all of it could end in penetration, which a wedge locked by friction
#: cannot give back.
ALLOWED = 0.999

#: Largest slip per closing of a gap that is extrapolated; beyond, joints are nearly parallel to the motion.
STEEPEST_CLOSING = 30.0

#: Part of the gap left that the last program must have closed, lest rounding be extrapolated.
SMALLEST_CLOSING = 0.01

#: Blocks whose joint moves by less than this part of the increment's movement are closed up as one.
TOGETHER = 1e-3

#: Large models are closed up, in so many programs over their macro-blocks, until the contact forces would do less than
#: this part of the reaction's work on the gaps that are left; the reaction counts as at least this part of the loads.
MACRO_CLOSINGS, WORK_LEFT, LEAST_REACTION = 12, 1e-2, 1e-2


class NotConverged(Exception):
    """The corrections of an increment did not come to rest; a smaller increment may do."""


class Falls(Exception):
    """No equilibrium at the geometry reached."""

    def __init__(self, solved: Solved) -> None:
        super().__init__("no equilibrium")
        self.solved = solved


def corrected(
    model: Model, predictor: Solved, supports: Pose, correctors: int, *, nudge: np.ndarray | None = None
) -> Pose:
    """Moves the blocks exactly and corrects the geometry with the supports at rest until it is exact.

    Parameters
    ----------
    model : Model
    predictor : Solved
        The program of the increment.
    supports : Pose
        Where the supports are at the end of the increment; free blocks are not looked at.
    correctors : int
        Largest number of programs.
    nudge : (n_blocks, 3) array [m, m, rad], optional
        A very small movement of the supports. Where given, the pose must be an equilibrium that a program with this
        movement confirms; otherwise the next increment may find out.

    Returns
    -------
    Pose

    Raises
    ------
    Falls
        If the geometry has no equilibrium.
    NotConverged
    SolveError

    Notes
    -----
    A program is linear: finite rotations leave gaps and slip of second order, and sliding lifts by μ · slip. The gaps
    enter the next program; so does the slip nobody asked for, as drift that friction takes back. Where each contact
    point should be along its joint is what the last program said: where it was, plus its slip in that program.
    """
    free = model.assembly.free
    pose = _moved_freely(model, predictor.pose, predictor)
    pose = Pose(
        np.where(free[:, None], pose.positions, supports.positions), np.where(free, pose.rotations, supports.rotations)
    )
    return _settled(model, pose, predictor, correctors, nudge)


def at_rest(model: Model, pose: Pose, correctors: int, nudge: np.ndarray | None = None) -> Pose:
    """The equilibrium that a pose settles into with the supports at rest or merely nudged, near or not.

    Raises
    ------
    Falls
        If blocks move by more than a block size without finding one.
    SolveError
    """
    if nudge is None:
        nudge = np.zeros((model.assembly.n_blocks, 3))
    solved = solve_program(model, pose, nudge)
    if solved.falling:
        raise Falls(solved)
    if _size(model, solved.motion) <= STILL * model.length:
        return pose
    return _settled(model, _moved_freely(model, pose, solved), solved, correctors, nudge)


def _descended(model: Model, start: Pose, deepest: float) -> Pose:
    """Follows the blocks downhill by small steps until they rest, or have moved by more than a block size.

    Friction at the edge of its cone may keep a pose in a small cycle; that is rest, too.
    """
    slow = replace(model, trust=model.length * DESCENT_STEP)
    solved, pose = solve_program(slow, start), start
    for _ in range(round(2.0 / DESCENT_STEP)):
        if not solved.falling and _size(model, solved.motion) <= STILL * model.length:
            break
        pose = moved(pose, solved.motion)
        solved = solve_again(slow, pose, solved)
    if solved.falling or np.abs(pose.positions - start.positions).max() > FARTHEST_FALL * model.length:
        raise Falls(solved)
    return _without_penetration(model, pose, solved, deepest)


def _without_penetration(model: Model, pose: Pose, solved: Solved, deepest: float) -> Pose:
    """The pose with what the last steps left of penetration closed."""
    for _ in range(2 * CLOSINGS):
        pose, contacts, _ = _closed(model, pose, solved)
        if float(-contacts.gaps.min(initial=0.0)) <= deepest:
            return pose
        drift, _ = _carried(model.assembly, contacts, solved)
        solved = closing_program(model, pose, contacts, drift, solved)
        pose = _moved_freely(model, pose, solved)
    pose, contacts, _ = _closed(model, pose, solved)
    depth = float(-contacts.gaps.min(initial=0.0))
    if depth > 2.0 * deepest:
        raise NotConverged(f"where blocks came to rest they penetrate by {depth:.3g} m (accepted: {deepest:.3g} m)")
    return pose


def _settled(model: Model, pose: Pose, solved: Solved, correctors: int, nudge: np.ndarray | None) -> Pose:
    tolerance = exact = GEOMETRY_TOLERANCE * model.length
    enough = max(tolerance, (GAP_LEFT_LARGE if model.large else GAP_LEFT) * _size(model, solved.motion))
    deepest = PENETRATION_LEFT * float(np.sqrt(model.assembly.areas.min())) * (10.0 if model.large else 1.0)
    if model.large:
        pose, solved, closed = _closed_up(model, pose, solved, deepest)
        if closed and nudge is None:
            return pose
    closings, exact_poses = 0, 0
    for attempt in range(correctors):
        pose, contacts, error = _closed(model, pose, solved)
        shallow = float(-contacts.gaps.min(initial=0.0)) <= deepest
        tolerance = enough if attempt >= CLOSINGS and shallow else exact
        if error <= tolerance and nudge is None:
            return pose
        if error <= tolerance:
            exact_poses, exact_pose = exact_poses + 1, pose
            if exact_poses > RESTLESS:
                break
        drift, allowance = _carried(model.assembly, contacts, solved)
        if error > tolerance and closings < CLOSINGS:
            closings += 1
            solved = closing_program(model, pose, contacts, drift, solved)
            pose = _moved_freely(model, pose, solved)
            continue
        closings = 0
        solved = solve_program(model, pose, nudge, contacts, drift, allowance)
        if solved.falling:
            raise Falls(solved)
        if error <= tolerance and _size(model, solved.motion) <= STILL * model.length:
            return pose
        pose = _moved_freely(model, pose, solved)
    if exact_poses > 0:
        return _descended(model, exact_pose, deepest)
    raise NotConverged(
        f"after {correctors} corrections a contact point is still off by {error:.3g} m (accepted: {tolerance:.3g} m)"
    )


def _closed_up(model: Model, pose: Pose, solved: Solved, deepest: float) -> tuple[Pose, Solved, bool]:
    """Closes a large model by programs over its macro-blocks; tells whether that was enough.

    What counts is the work that the contact forces would do on the gaps: where much force waits for a gap to close, the
    next program finds another mechanism, and its reaction is wrong by as much.
    """
    bodies = _macro_blocks(model, solved)
    movement = _size(model, solved.motion)
    reaction = abs(float((solved.support_forces * solved.motion).sum()))
    work = WORK_LEFT * max(reaction, LEAST_REACTION * model.total_load * model.force * movement)
    contacts, found, closings = _contacts_after(model, pose, solved), True, 0
    while True:
        carrying, _ = _carrying_and_sticking(model.assembly, contacts, solved)
        place, _ = matched_contacts(model.assembly, contacts, solved.contacts)
        normal = np.where(carrying, solved.forces[place, 0], 0.0)
        gap, depth = float(np.abs(contacts.gaps[carrying]).max(initial=0.0)), -float(contacts.gaps.min(initial=0.0))
        last = closings == MACRO_CLOSINGS
        enough = (
            gap <= GAP_LEFT_LARGE * movement and depth <= deepest and (last or normal @ np.abs(contacts.gaps) <= work)
        )
        if found and (enough or last):
            return pose, solved, enough
        if enough or last:
            # Corners may have come to an edge that they were not in front of.
            contacts, found = _contacts_after(model, pose, solved), True
            continue
        drift, _ = _carried(model.assembly, contacts, solved)
        try:
            solved = closing_program(model, pose, contacts, drift, solved, bodies)
        except SolveError:
            # A macro-block would have to come apart.
            return pose, solved, False
        pose = _moved_freely(model, pose, solved)
        # A closing moves blocks by a gap: the points are the same, and are measured in a tenth of the time.
        vertices = moved_vertices(model.assembly, pose)
        contacts = measure_contacts(model.assembly, vertices, contacts.vertex, contacts.edge, contacts.corner)
        found, closings = False, closings + 1


def _macro_blocks(model: Model, solved: Solved) -> MacroBlocks:
    """Blocks that a program moves together, or nearly so: their joints are left as they are."""
    apart = np.maximum(np.abs(solved.opening), np.abs(solved.slip))
    together = TOGETHER * _size(model, solved.motion)
    return macro_blocks(
        model.assembly, solved.pose, solved.contacts, apart, solved.motion[:, 2], model.length, together
    )


def _moved_freely(model: Model, pose: Pose, solved: Solved) -> Pose:
    """The free blocks moved; a nudge of the supports is not carried out."""
    return moved(pose, np.where(model.assembly.free[:, None], solved.motion, 0.0))


def _size(model: Model, motion: np.ndarray) -> float:
    return float(np.abs(motion * np.array([1.0, 1.0, model.length])).max(initial=0.0))


def _closed(model: Model, pose: Pose, solved: Solved) -> tuple[Pose, Contacts, float]:
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
    contacts = _contacts_after(model, pose, solved)
    error = _geometry_error(assembly, contacts, solved)
    best, allowed = (pose, contacts, error), NEWTON_REACH * error
    travelled = 0.0
    for _ in range(NEWTON_ITERATIONS):
        if best[2] <= GEOMETRY_TOLERANCE * model.length:
            break
        motion = _closing_motion(model, pose, contacts, solved)
        travelled += _size(model, motion)
        if not travelled <= allowed:
            break
        pose = moved(pose, motion)
        contacts = _contacts_after(model, pose, solved)
        error = _geometry_error(assembly, contacts, solved)
        if error > best[2] / 2.0:
            break
        best = (pose, contacts, error)
    return best


def _closing_motion(model: Model, pose: Pose, contacts: Contacts, solved: Solved) -> np.ndarray:
    """(n_blocks, 3) array: smallest movement of the free blocks that closes, to first order, what carries force."""
    assembly = model.assembly
    carrying, sticking = _carrying_and_sticking(assembly, contacts, solved)
    drift, _ = _carried(assembly, contacts, solved)
    wanted = np.zeros(2 * len(contacts))
    wanted[0::2], wanted[1::2] = -contacts.gaps / model.length, -drift / model.length
    rows = np.zeros(2 * len(contacts), dtype=bool)
    rows[0::2], rows[1::2] = carrying, sticking
    freedoms = np.repeat(assembly.free, 3)
    jacobian = sp.csr_array(equilibrium_matrix(contacts, pose, model.length).T)[rows][:, freedoms]
    gram = sp.csc_array(jacobian @ jacobian.T + REDUNDANCY * sp.identity(jacobian.shape[0]))
    motion = np.zeros((assembly.n_blocks, 3))
    motion[assembly.free] = (jacobian.T @ splu(gram).solve(wanted[rows])).reshape(-1, 3)
    return motion * model.lengths


def solve_again(model: Model, pose: Pose, solved: Solved) -> Solved:
    """The program at a pose that another led to, supports at rest, its contacts and their drift carried over."""
    if len(solved.contacts) == 0:
        # Everything was in the air: there is nothing to carry over.
        return solve_program(model, pose)
    contacts = _contacts_after(model, pose, solved)
    drift, _ = _carried(model.assembly, contacts, solved)
    return solve_program(model, pose, contacts=contacts, drift=drift)


def _contacts_after(model: Model, pose: Pose, solved: Solved) -> Contacts:
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
    own, reverse = feature_pairs(assembly, before)
    covered = np.concatenate([own[kept], reverse[kept]])
    own, reverse = feature_pairs(assembly, found)
    new = ~(np.isin(own, covered) | (np.isin(reverse, covered) & (reverse >= 0)))
    vertex, edge, corner = (
        np.concatenate([getattr(before, name)[kept], getattr(found, name)[new]])
        for name in ("vertex", "edge", "corner")
    )
    return measure_contacts(assembly, vertices, vertex, edge, corner)


def _gone_through(assembly: Assembly, vertices: np.ndarray, before: Contacts) -> np.ndarray:
    """Numbers of the contact points whose corner was in front of its edge and is now behind it."""
    now = measure_contacts(assembly, vertices, before.vertex, before.edge, before.corner)
    inside = (now.along >= 0.0) & (now.along <= assembly.edge_lengths[before.edge]) & (before.corner < 0)
    rounding = 1e-12 * assembly.block_size
    return np.flatnonzero(inside & (before.gaps >= -rounding) & (now.gaps < -rounding))


def _slid_off(
    assembly: Assembly, vertices: np.ndarray, before: Contacts, kept: np.ndarray, sliding: np.ndarray
) -> np.ndarray:
    """Whether corners that carried force have left their edge for good: by sliding, or by more than any drift."""
    vertex, edge, corner = before.vertex[kept], before.edge[kept], before.corner[kept]
    now = measure_contacts(assembly, vertices, vertex, edge, corner)
    far = np.where(corner >= 0, 0.0, assembly.edge_lengths[edge])
    past = np.maximum(-now.along, now.along - far)
    drifting = end_zone(assembly, vertex, edge) / CORNER_TOLERANCE * LARGEST_DRIFT
    return (past > drifting) | (sliding & (corner < 0) & (past > end_zone(assembly, vertex, edge)))


def _carried(assembly: Assembly, contacts: Contacts, solved: Solved) -> tuple[np.ndarray, np.ndarray]:
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
    before, same = matched_contacts(assembly, contacts, solved.contacts)
    expected = solved.contacts.along[before] + solved.slip[before]
    drift = np.where(same, contacts.along - expected, 0.0)
    closing, slip = -solved.opening[before], solved.sliding[before]
    again = same & (slip > 0.0) & (closing > SMALLEST_CLOSING * contacts.gaps) & (contacts.gaps > 0.0)
    ratio = np.minimum(np.divide(slip, closing, out=np.zeros_like(slip), where=again), STEEPEST_CLOSING)
    return drift, np.where(again, ALLOWED * solved.friction[before] * ratio * contacts.gaps, 0.0)


def _carrying_and_sticking(assembly: Assembly, contacts: Contacts, solved: Solved) -> tuple[np.ndarray, np.ndarray]:
    """Points that carried force in the last program, and those of them that stuck: (n_contacts,) bool arrays."""
    place, same = matched_contacts(assembly, contacts, solved.contacts)
    normal = solved.forces[place, 0]
    carrying = same & (normal > CARRYING_FRACTION * normal.max(initial=0.0))
    return carrying, carrying & solved.sticking[place]


def _geometry_error(assembly: Assembly, contacts: Contacts, solved: Solved) -> float:
    """Deepest penetration, largest gap at a contact point that carries force, or drift at one that sticks [m]."""
    carrying, sticking = _carrying_and_sticking(assembly, contacts, solved)
    drift, _ = _carried(assembly, contacts, solved)
    return max(
        float(np.maximum(-contacts.gaps, 0.0).max(initial=0.0)),
        float(np.abs(contacts.gaps[carrying]).max(initial=0.0)),
        float(np.abs(drift[sticking]).max(initial=0.0)),
    )
