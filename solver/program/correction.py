"""From the program's linear motion to an exact geometry: rigid update and correctors."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from solver.assembly import measure_contacts
from solver.geometry.contacts import matched_contacts
from solver.kinematics import Pose, moved, moved_vertices
from solver.lp.problem import SolveError
from solver.tolerances import FARTHEST_FALL, GEOMETRY_TOLERANCE, PENETRATION_LEFT, STILL, TOGETHER

from .closing import carrying_and_sticking, closed_points, closing_program, contacts_after, drift_and_allowance
from .increment import Solved, solve_program
from .macroblocks import MacroBlocks, macro_blocks
from .model import Model, largest_movement

#: Step of a descent, in block sizes.
DESCENT_STEP = 0.1

#: Programs that close gaps one after another before a full program is solved again.
CLOSINGS = 4

#: Where friction keeps many points on the edge of sliding, corrections converge slowly. After CLOSINGS programs gaps of
#: this part of the increment's movement may stay (the next program sees them, so they do not add up), and penetration
#: of PENETRATION_LEFT. In programs too large for vertex solutions, whose interior solutions say less clearly what
#: sticks, ten times as much of either.
GAP_LEFT, GAP_LEFT_LARGE = 1e-2, 1e-1

#: Exact geometries from which a program still moves on, before it is followed in small steps: friction at the edge of
#: its cone may lead it round in a circle.
RESTLESS = 8

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
        np.where(free[:, None], pose.positions, supports.positions),
        np.where(free[:, None], pose.rotations, supports.rotations),
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
    if largest_movement(model, solved.motion) <= STILL * model.length:
        return pose
    return _settled(model, _moved_freely(model, pose, solved), solved, correctors, nudge)


def _descended(model: Model, start: Pose, deepest: float) -> Pose:
    """Follows the blocks downhill by small steps until they rest, or have moved by more than a block size.

    Friction at the edge of its cone may keep a pose in a small cycle; that is rest, too.
    """
    slow = replace(model, trust=model.length * DESCENT_STEP)
    solved, pose = solve_program(slow, start), start
    for _ in range(round(2.0 / DESCENT_STEP)):
        if not solved.falling and largest_movement(model, solved.motion) <= STILL * model.length:
            break
        pose = moved(pose, solved.motion)
        solved = solve_again(slow, pose, solved)
    if solved.falling or np.abs(pose.positions - start.positions).max() > FARTHEST_FALL * model.length:
        raise Falls(solved)
    return _without_penetration(model, pose, solved, deepest)


def _without_penetration(model: Model, pose: Pose, solved: Solved, deepest: float) -> Pose:
    """The pose with what the last steps left of penetration closed."""
    for _ in range(2 * CLOSINGS):
        pose, contacts, _ = closed_points(model, pose, solved)
        if float(-contacts.gaps.min(initial=0.0)) <= deepest:
            return pose
        drift, _ = drift_and_allowance(model.assembly, contacts, solved)
        solved = closing_program(model, pose, contacts, drift, solved)
        pose = _moved_freely(model, pose, solved)
    pose, contacts, _ = closed_points(model, pose, solved)
    depth = float(-contacts.gaps.min(initial=0.0))
    if depth > 2.0 * deepest:
        raise NotConverged(f"where blocks came to rest they penetrate by {depth:.3g} m (accepted: {deepest:.3g} m)")
    return pose


def _settled(model: Model, pose: Pose, solved: Solved, correctors: int, nudge: np.ndarray | None) -> Pose:
    tolerance = exact = GEOMETRY_TOLERANCE * model.length
    enough = max(tolerance, (GAP_LEFT_LARGE if model.large else GAP_LEFT) * largest_movement(model, solved.motion))
    deepest = PENETRATION_LEFT * float(np.sqrt(model.assembly.areas.min())) * (10.0 if model.large else 1.0)
    if model.large:
        pose, solved, closed = _closed_up(model, pose, solved, deepest)
        if closed and nudge is None:
            return pose
    closings, exact_poses = 0, 0
    for attempt in range(correctors):
        pose, contacts, error = closed_points(model, pose, solved)
        shallow = float(-contacts.gaps.min(initial=0.0)) <= deepest
        tolerance = enough if attempt >= CLOSINGS and shallow else exact
        if error <= tolerance and nudge is None:
            return pose
        if error <= tolerance:
            exact_poses, exact_pose = exact_poses + 1, pose
            if exact_poses > RESTLESS:
                break
        drift, allowance = drift_and_allowance(model.assembly, contacts, solved)
        if error > tolerance and closings < CLOSINGS:
            closings += 1
            solved = closing_program(model, pose, contacts, drift, solved)
            pose = _moved_freely(model, pose, solved)
            continue
        closings = 0
        solved = solve_program(model, pose, nudge, contacts, drift, allowance)
        if solved.falling:
            raise Falls(solved)
        if error <= tolerance and largest_movement(model, solved.motion) <= STILL * model.length:
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
    movement = largest_movement(model, solved.motion)
    reaction = abs(float((solved.support_forces * solved.motion).sum()))
    work = WORK_LEFT * max(reaction, LEAST_REACTION * model.total_load * model.force * movement)
    contacts, found, closings = contacts_after(model, pose, solved), True, 0
    while True:
        carrying, _ = carrying_and_sticking(model.assembly, contacts, solved)
        place, _ = matched_contacts(contacts, solved.contacts)
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
            contacts, found = contacts_after(model, pose, solved), True
            continue
        drift, _ = drift_and_allowance(model.assembly, contacts, solved)
        try:
            solved = closing_program(model, pose, contacts, drift, solved, bodies)
        except SolveError:
            # A macro-block would have to come apart.
            return pose, solved, False
        pose = _moved_freely(model, pose, solved)
        # A closing moves blocks by a gap: the points are the same, and are measured in a tenth of the time.
        vertices = moved_vertices(model.assembly, pose)
        contacts = measure_contacts(model.assembly, vertices, contacts)
        found, closings = False, closings + 1


def _macro_blocks(model: Model, solved: Solved) -> MacroBlocks:
    """Blocks that a program moves together, or nearly so: their joints are left as they are."""
    apart = np.maximum(np.abs(solved.opening), np.abs(solved.slip))
    together = TOGETHER * largest_movement(model, solved.motion)
    return macro_blocks(
        model.assembly, solved.pose, solved.contacts, apart, solved.motion[:, 2:], model.length, together
    )


def _moved_freely(model: Model, pose: Pose, solved: Solved) -> Pose:
    """The free blocks moved; a nudge of the supports is not carried out."""
    return moved(pose, np.where(model.assembly.free[:, None], solved.motion, 0.0))


def solve_again(model: Model, pose: Pose, solved: Solved) -> Solved:
    """The program at a pose that another led to, supports at rest, its contacts and their drift carried over."""
    if len(solved.contacts) == 0:
        # Everything was in the air: there is nothing to carry over.
        return solve_program(model, pose)
    contacts = contacts_after(model, pose, solved)
    drift, _ = drift_and_allowance(model.assembly, contacts, solved)
    return solve_program(model, pose, contacts=contacts, drift=drift)
