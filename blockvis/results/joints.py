"""Joints: the faces of two blocks that touch in the layout, and what becomes of them: opening, slip, forces."""

from __future__ import annotations

import csv
import io
from dataclasses import dataclass

import numpy as np

import solver

#: Faces count as one initial joint when they are apart by at most this fraction of the block size.
TOUCHING = 2e-3

#: Faces count as parallel up to this sine.
PARALLEL = 0.05


@dataclass(frozen=True)
class InitialJoints:
    """Pairs of faces that touch in the layout.

    Attributes
    ----------
    block_a, block_b : (n_joints,) int arrays
    ends : (n_joints, 2, 2) array [m]
        Both ends of the common length, where the layout has them.
    normals : (n_joints, 2) array
        Unit normal in the layout, from ``block_b`` into ``block_a``.
    """

    block_a: np.ndarray
    block_b: np.ndarray
    ends: np.ndarray
    normals: np.ndarray


def initial_joints(assembly: solver.Assembly) -> InitialJoints:
    """Find the faces that touch in the layout; where they part later there is a crack."""
    tolerance = TOUCHING * assembly.block_size
    contacts = solver.find_contacts(assembly, assembly.vertices, 2.0 * tolerance)
    touching = np.abs(contacts.gaps) <= tolerance
    vertex, edge_b, _ = solver.corners_and_edges(contacts.features[touching])
    # The corner belongs to two faces of block a; either may lie on the edge of block b.
    edge_a = np.concatenate([vertex, assembly.previous_vertex[vertex]])
    edge_b = np.concatenate([edge_b, edge_b])
    pairs = np.unique(np.stack([np.minimum(edge_a, edge_b), np.maximum(edge_a, edge_b)], axis=1), axis=0)
    a, b = pairs[:, 0], pairs[:, 1]
    start, stop = assembly.vertices[b], assembly.vertices[assembly.next_vertex[b]]
    length = assembly.edge_lengths[b]
    tangent = (stop - start) / length[:, None]
    normal = np.stack([tangent[:, 1], -tangent[:, 0]], axis=1)
    ends_a = np.stack([assembly.vertices[a], assembly.vertices[assembly.next_vertex[a]]], axis=1) - start[:, None]
    along = np.einsum("nij,nj->ni", ends_a, tangent)
    across = np.abs(np.einsum("nij,nj->ni", ends_a, normal))
    lean = np.abs(across[:, 1] - across[:, 0]) / assembly.edge_lengths[a]
    low = np.maximum(0.0, along.min(axis=1))
    high = np.minimum(length, along.max(axis=1))
    keep = (high - low > 10.0 * tolerance) | (high - low > 0.5 * np.minimum(length, assembly.edge_lengths[a]))
    keep &= (lean < PARALLEL) & (across.min(axis=1) <= 2.0 * tolerance) & (along[:, 0] > along[:, 1])
    ends = np.stack([start + low[:, None] * tangent, start + high[:, None] * tangent], axis=1)
    owner = assembly.block_of_vertex
    return InitialJoints(owner[a][keep], owner[b][keep], ends[keep], normal[keep])


@dataclass(frozen=True)
class JointStates:
    """What joints do at one increment.

    Those of the layout come first, in their order; pairs of blocks that have come to touch since follow.

    Attributes
    ----------
    block_a, block_b : (n,) int arrays
    initial : (n,) bool array
        Whether the joint is one of the layout.
    ends : (n, 2, 2) array [m]
        Middle line between the two faces, where they are now; of later joints, between their outermost contact points.
    opening : (n,) array [m]
        Largest distance of the faces at their ends, along the normal; 0 for later joints.
    slip : (n,) array [m]
        Of block a along the tangent of block b, a quarter turn counter-clockwise from the normal into block a, at the
        end that is open least; 0 for later joints.
    normal_force, shear_force : (n,) arrays [N]
        Resultant on block a, compression positive, and along the tangent; 0 in frames of a fall, where there is no
        equilibrium.
    """

    block_a: np.ndarray
    block_b: np.ndarray
    initial: np.ndarray
    ends: np.ndarray
    opening: np.ndarray
    slip: np.ndarray
    normal_force: np.ndarray
    shear_force: np.ndarray


def faces_at(
    assembly: solver.Assembly, joints: InitialJoints, pose: solver.Pose
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Carry the faces of joints to a pose.

    Returns
    -------
    on_a, on_b : (n_joints, 2, 2) arrays [m]
        Both ends of the common length, riding on block a and on block b.
    normals : (n_joints, 2) array
        Unit normal from block b into block a, turned with block b.
    """
    initial = solver.Pose.initial(assembly)
    on_a, on_b = (
        np.stack([solver.carried(joints.ends[:, k], block, initial, pose) for k in (0, 1)], axis=1)
        for block in (joints.block_a, joints.block_b)
    )
    return on_a, on_b, solver.turned(joints.normals, pose.rotations[joints.block_b])


def opening_and_slip(assembly: solver.Assembly, joints: InitialJoints, pose: solver.Pose) -> np.ndarray:
    """(n_joints, 2) array [m]: opening and slip of the joints of the layout, as in :class:`JointStates`."""
    on_a, on_b, normals = faces_at(assembly, joints, pose)
    apart = on_a - on_b
    across, along = (np.einsum("nij,nj->ni", apart, axis) for axis in (normals, _tangents(normals)))
    closer = np.abs(across).argmin(axis=1)[:, None]
    return np.stack([across.max(axis=1), np.take_along_axis(along, closer, axis=1)[:, 0]], axis=1)


def end_openings(assembly: solver.Assembly, joints: InitialJoints, pose: solver.Pose) -> np.ndarray:
    """(n_joints, 2) array [m]: distance of the faces of the joints of the layout at their ends, along the normal."""
    on_a, on_b, normals = faces_at(assembly, joints, pose)
    return np.asarray(np.einsum("nij,nj->ni", on_a - on_b, normals))


def joint_states(assembly: solver.Assembly, joints: InitialJoints, increment: solver.Increment) -> JointStates:
    """Work out opening, slip and forces of all joints of an increment.

    Parameters
    ----------
    assembly : solver.Assembly
    joints : InitialJoints
    increment : solver.Increment
    """
    contacts, pose = increment.contacts, increment.pose
    on_a, on_b, normals = faces_at(assembly, joints, pose)
    ends, block_a, block_b = (on_a + on_b) / 2.0, joints.block_a, joints.block_b
    joint = _nearest_face(contacts, joints, ends, normals)
    later = np.flatnonzero(joint < 0)
    if len(later):
        pairs, which = contacts[later].joints()
        joint[later] = len(ends) + which
        spans, across = _later_joints(contacts[later], pairs, which)
        ends, normals = np.concatenate([ends, spans]), np.concatenate([normals, across])
        block_a, block_b = (np.concatenate([of, pairs[:, k]]) for k, of in enumerate((block_a, block_b)))
    force = np.zeros((len(ends), 2))
    if increment.status != solver.Status.FALLING and len(contacts):
        side = np.where(contacts.block_a == block_a[joint], 1.0, -1.0)
        np.add.at(force, joint, side[:, None] * np.einsum("ki,kij->kj", increment.forces, contacts.frames))
    moved = np.zeros((len(ends), 2))
    moved[: len(on_a)] = opening_and_slip(assembly, joints, pose)
    return JointStates(
        block_a=block_a,
        block_b=block_b,
        initial=np.arange(len(ends)) < len(on_a),
        ends=ends,
        opening=moved[:, 0],
        slip=moved[:, 1],
        normal_force=(force * normals).sum(axis=1),
        shear_force=(force * _tangents(normals)).sum(axis=1),
    )


def _tangents(normals: np.ndarray) -> np.ndarray:
    return np.stack([-normals[:, 1], normals[:, 0]], axis=1)


def _nearest_face(
    contacts: solver.Contacts, joints: InitialJoints, ends: np.ndarray, normals: np.ndarray
) -> np.ndarray:
    """(n_contacts,) int array: the joint between the same blocks that is nearest to each contact point, or -1."""
    count = 1 + max(
        int(block.max(initial=0)) for block in (contacts.block_a, contacts.block_b, joints.block_a, joints.block_b)
    )
    known, key = (
        np.minimum(of.block_a, of.block_b).astype(np.int64) * count + np.maximum(of.block_a, of.block_b)
        for of in (joints, contacts)
    )
    order = np.argsort(known, kind="stable")
    first, last = (np.searchsorted(known[order], key, side=side) for side in ("left", "right"))
    joint, least = np.full(len(contacts), -1), np.full(len(contacts), np.inf)
    # A pair has one face in common; blocks that are not convex have a few.
    for k in range(int((last - first).max(initial=0))):
        some = np.flatnonzero(first + k < last)
        face = order[first[some] + k]
        start, along = ends[face, 0], ends[face, 1] - ends[face, 0]
        squared = np.maximum((along**2).sum(axis=1), 1e-300)
        place = np.clip(((contacts.points[some] - start) * along).sum(axis=1) / squared, 0.0, 1.0)
        away = np.hypot(*(contacts.points[some] - start - place[:, None] * along).T)
        # In a corner two faces are equally near: the point belongs to the one that has its normal.
        turned = 1.0 - np.abs((contacts.frames[some, 0] * normals[face]).sum(axis=1))
        away += turned * np.sqrt(squared)
        closer = away < least[some]
        joint[some[closer]], least[some[closer]] = face[closer], away[closer]
    return joint


def _later_joints(contacts: solver.Contacts, pairs: np.ndarray, which: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Find ends (n, 2, 2) [m] and normals (n, 2), into the first block, of pairs that touch at contact points."""
    ends, normals = np.zeros((len(pairs), 2, 2)), np.zeros((len(pairs), 2))
    for k, (first, _) in enumerate(pairs):
        here = np.flatnonzero(which == k)
        normal, tangent = contacts.frames[here[0]]
        normals[k] = normal if contacts.block_a[here[0]] == first else -normal
        place = contacts.points[here] @ tangent
        ends[k] = contacts.points[here[[place.argmin(), place.argmax()]]]
    return ends, normals


class LargestMovements:
    """The largest opening and slip of each joint over the increments in equilibrium so far: what joints.csv holds.

    Parameters
    ----------
    assembly : solver.Assembly
    parameter : solver.Quantity
        What the increments run over.
    """

    def __init__(self, assembly: solver.Assembly, parameter: solver.Quantity) -> None:
        self.assembly, self.parameter, self.joints = assembly, parameter, initial_joints(assembly)
        self._largest = np.zeros((len(self.joints.block_a), 2))
        self._at = np.zeros_like(self._largest)

    def add(self, increment: solver.Increment) -> None:
        """Take an increment in equilibrium into account."""
        moved = np.abs(opening_and_slip(self.assembly, self.joints, increment.pose))
        larger = moved > self._largest
        self._largest[larger] = moved[larger]
        self._at[larger] = increment.parameter

    def table(self) -> str:
        """Write joints.csv: a row for each pair of blocks that touch in the layout, the widest opening first."""
        joints, names = self.joints, self.assembly.names
        rows, unit = [], f" [{self.parameter.unit}]"
        length = np.hypot(*(joints.ends[:, 1] - joints.ends[:, 0]).T)
        low, high = np.minimum(joints.block_a, joints.block_b), np.maximum(joints.block_a, joints.block_b)
        pairs, which = np.unique(np.stack([low, high], axis=1), axis=0, return_inverse=True)
        for k, (a, b) in enumerate(pairs):
            # Blocks that are not convex may touch along several faces: they are one joint.
            here = np.flatnonzero(which.ravel() == k)
            place = length[here] @ joints.ends[here].mean(axis=1) / length[here].sum()
            widest = here[self._largest[here].argmax(axis=0)]
            largest, at = (values[widest, [0, 1]] for values in (self._largest, self._at))
            rows.append((f"{names[a]} | {names[b]}", *place, length[here].sum(), largest[0], at[0], largest[1], at[1]))
        rows.sort(key=lambda row: -max(row[4], row[6]))
        text = io.StringIO()
        table = csv.writer(text, lineterminator="\n")
        opening, slip = (f"{self.parameter.name} at largest {what}{unit}" for what in ("opening", "slip"))
        table.writerow(
            ("joint", "x [m]", "y [m]", "length [m]", "largest opening [m]", opening, "largest slip [m]", slip)
        )
        # To the nanometre: what is smaller is rounding.
        table.writerows((name, *(f"{round(number, 9) + 0.0:.6g}" for number in numbers)) for name, *numbers in rows)
        return text.getvalue()
