"""From the program's linear motion to an exact geometry: rigid update and correctors."""

from __future__ import annotations

import numpy as np

from .assembly import Assembly
from .contact import CORNER_TOLERANCE, Contacts, end_zone, feature_pairs, find_contacts, measure_contacts
from .kinematics import Pose, moved, moved_vertices
from .program import Model, Solved, solve_program

__all__ = ["Falls", "NotConverged", "corrected", "solve_again"]

#: A geometry is exact enough when contact points that carry force are closed, and those that stick have
#: not moved along the joint, to this fraction of the block size.
GEOMETRY_TOLERANCE = 1e-8

#: Contact points below this fraction of the largest normal force do not decide whether a geometry is exact.
CARRYING_FRACTION = 1e-6


#: Drift of a hinge within an increment, as a fraction of the shortest edge, before it is corrected: second order in
#: the rotation, which an increment keeps below a few hundredths.
LARGEST_DRIFT = 1e-2

#: Part of the expected lift that is taken off: all of it could end in penetration, which a wedge locked by friction
#: cannot give back.
ALLOWED = 0.999

#: Largest slip per closing of a gap that is extrapolated; beyond, joints are nearly parallel to the motion.
STEEPEST_CLOSING = 30.0

#: Part of the gap left that the last program must have closed, lest rounding be extrapolated.
SMALLEST_CLOSING = 0.01


class NotConverged(Exception):
    """The corrections of an increment did not come to rest; a smaller increment may do."""


class Falls(Exception):
    """No equilibrium at the geometry reached."""

    def __init__(self, solved: Solved) -> None:
        super().__init__("no equilibrium")
        self.solved = solved


def corrected(model: Model, predictor: Solved, supports: Pose, correctors: int) -> Pose:
    """Moves the blocks exactly and solves again with the supports at rest until the geometry is exact.

    Parameters
    ----------
    model : Model
    predictor : Solved
        The program of the increment.
    supports : Pose
        Where the supports are at the end of the increment; free blocks are not looked at.
    correctors : int
        Largest number of programs.

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
    assembly = model.assembly
    free = assembly.free
    pose = moved(predictor.pose, np.where(free[:, None], predictor.motion, 0.0))
    pose = Pose(
        np.where(free[:, None], pose.positions, supports.positions), np.where(free, pose.rotations, supports.rotations)
    )
    tolerance = GEOMETRY_TOLERANCE * model.length
    solved = predictor
    for _ in range(correctors):
        contacts = _contacts_after(model, pose, solved)
        drift, allowance = _carried(assembly, contacts, solved)
        error = _geometry_error(assembly, contacts, drift, solved)
        if error <= tolerance:
            return pose
        solved = solve_program(model, pose, contacts=contacts, drift=drift, allowance=allowance)
        if solved.falling:
            raise Falls(solved)
        pose = moved(pose, solved.motion)
    raise NotConverged(
        f"after {correctors} corrections a contact point is still off by {error:.3g} m (accepted: {tolerance:.3g} m)"
    )


def solve_again(model: Model, pose: Pose, solved: Solved) -> Solved:
    """The program at a pose that another led to, supports at rest, its contacts and their drift carried over."""
    contacts = _contacts_after(model, pose, solved)
    drift, _ = _carried(model.assembly, contacts, solved)
    return solve_program(model, pose, contacts=contacts, drift=drift)


def _contacts_after(model: Model, pose: Pose, solved: Solved) -> Contacts:
    """Contacts found at the pose; those that carried force stay what they were, wherever on their line they are now.

    A hinge whose corner has come to lie a hair past the end of its edge, or outside the zone in which it counts as a
    corner on a corner, must neither vanish nor change its kind before its drift is corrected.
    """
    assembly = model.assembly
    vertices = moved_vertices(assembly, pose)
    found = find_contacts(assembly, vertices, model.reach)
    before = solved.contacts
    kept = np.flatnonzero(solved.forces[:, 0] > 0.0)
    kept = kept[~_slid_off(assembly, vertices, before, kept, solved.sliding[kept] > 0.0)]
    own, reverse = feature_pairs(assembly, before)
    covered = np.concatenate([own[kept], reverse[kept]])
    own, reverse = feature_pairs(assembly, found)
    new = ~(np.isin(own, covered) | (np.isin(reverse, covered) & (reverse >= 0)))
    vertex, edge, corner = (
        np.concatenate([getattr(before, name)[kept], getattr(found, name)[new]])
        for name in ("vertex", "edge", "corner")
    )
    return measure_contacts(assembly, vertices, vertex, edge, corner)


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
    keys, known = contacts.keys(assembly), solved.contacts.keys(assembly)
    order = np.argsort(known, kind="stable")
    place = np.minimum(np.searchsorted(known[order], keys), len(known) - 1)
    before = order[place]
    same = known[before] == keys
    expected = solved.contacts.along[before] + solved.slip[before]
    drift = np.where(same, contacts.along - expected, 0.0)
    closing, slip = -solved.opening[before], solved.sliding[before]
    again = same & (slip > 0.0) & (closing > SMALLEST_CLOSING * contacts.gaps) & (contacts.gaps > 0.0)
    ratio = np.minimum(np.divide(slip, closing, out=np.zeros_like(slip), where=again), STEEPEST_CLOSING)
    return drift, np.where(again, ALLOWED * solved.friction[before] * ratio * contacts.gaps, 0.0)


def _geometry_error(assembly: Assembly, contacts: Contacts, drift: np.ndarray, solved: Solved) -> float:
    """Deepest penetration, or largest gap or drift at a contact point that carries force [m]."""
    penetration = float(np.maximum(-contacts.gaps, 0.0).max(initial=0.0))
    normal = solved.forces[:, 0]
    carrying = solved.contacts.keys(assembly)[normal > CARRYING_FRACTION * normal.max(initial=0.0)]
    now = np.isin(contacts.keys(assembly), carrying)
    return max(
        penetration, float(np.abs(contacts.gaps[now]).max(initial=0.0)), float(np.abs(drift[now]).max(initial=0.0))
    )
