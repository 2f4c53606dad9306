"""Joints: the faces of two blocks that touch in the layout, and what becomes of them: opening, slip, forces."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

import solver
from solver import mechanics

from .about import EXACT
from .joint_faces import InitialJoints, Rings, faces_of, grouped_by_face, initial_joints, lines
from .tables import csv_text


@dataclass(frozen=True)
class Faces:
    """The two faces of each joint of the layout, carried to a pose."""

    #: (n_points, d) arrays [m]: corners of what they have in common, riding on block a and on block b.
    on_a: np.ndarray
    on_b: np.ndarray
    gaps: np.ndarray  #: (n_points,) array [m]: distance of the two faces at each corner, along the normal.
    apart: np.ndarray  #: (n_points, d) array [m]: movement of block a against block b there.
    normals: np.ndarray  #: (n_joints, d) array: unit normal from block b into block a, half-way between both faces.


def carried_faces(
    assembly: solver.Assembly, joints: InitialJoints, pose: solver.Pose, fallen: np.ndarray | None = None
) -> Faces:
    """Carry the faces of joints to a pose.

    Joints of blocks (n_blocks,) that have fallen or were taken away by then are no more: neither gap nor slip.
    """
    initial, rings = solver.Pose.initial(assembly), joints.rings
    on_a, on_b = (
        mechanics.carried(rings.points, block[rings.ring], initial, pose) for block in (joints.block_a, joints.block_b)
    )
    # Half-way, so that it is the same joint whichever block comes first.
    normals = sum(mechanics.turned(joints.normals, pose.rotations[block]) for block in (joints.block_a, joints.block_b))
    normals = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    apart, normal = on_a - on_b, normals[rings.ring]
    if fallen is not None:
        apart[(fallen[joints.block_a] | fallen[joints.block_b])[rings.ring]] = 0.0
    return Faces(on_a, on_b, (apart * normal).sum(axis=1), apart, normals)


def opening_and_slip(
    assembly: solver.Assembly, joints: InitialJoints, pose: solver.Pose, fallen: np.ndarray | None = None
) -> np.ndarray:
    """(n_joints, 2) array [m]: opening and slip of the joints of the layout; arguments as of :func:`carried_faces`."""
    return _openings_and_slips(joints, carried_faces(assembly, joints, pose, fallen))


def _openings_and_slips(joints: InitialJoints, faces: Faces) -> np.ndarray:
    """Find the largest opening and slip of each joint, (n_joints, 2) [m]; in the plane both ends slip alike."""
    slips = _along(faces.apart, faces.normals[joints.rings.ring])
    return np.stack([joints.rings.largest(faces.gaps), joints.rings.largest(slips)], axis=1)


def _along(vectors: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """(n,) array: parts of vectors (n, d) along the tangents of the plane; in space the sizes of those along faces."""
    if vectors.shape[1] == 3:
        return np.asarray(np.linalg.norm(vectors - (vectors * normals).sum(axis=1)[:, None] * normals, axis=1))
    return vectors[:, 1] * normals[:, 0] - vectors[:, 0] * normals[:, 1]


@dataclass(frozen=True)
class JointStates:
    """What joints do at one increment.

    Those of the layout come first, in their order; pairs of blocks that have come to touch since follow. Joints of
    blocks that have fallen or were taken away have no gap, slip or force.
    """

    #: (n,) int arrays.
    block_a: np.ndarray
    block_b: np.ndarray
    initial: np.ndarray  #: (n,) bool array: whether the joint is one of the layout.
    rings: Rings  #: Midway between the two faces, where they are now; of later joints, around their contact points.
    normals: np.ndarray  #: (n, d) array: unit normal from block b into block a.
    #: (n_points,) array [m]: distance of the two faces at each corner, along the normal; 0 for later joints.
    gaps: np.ndarray
    opening: np.ndarray  #: (n,) array [m]: the largest of them.
    #: (n,) array [m]: along the tangent of the faces, a quarter turn from the normal; in space the largest size at a
    #: corner; 0 for later joints.
    slip: np.ndarray
    of_contact: np.ndarray  #: (n_contacts,) int array: the joint that each contact point of the increment belongs to.
    force: np.ndarray  #: (n, d) array [N]: resultant on block a; 0 in frames of a fall, where there is no equilibrium.

    @property
    def ends(self) -> np.ndarray:
        """(n, 2, 2) array [m]: of the joints in the plane, where they are now."""
        return self.rings.points.reshape(-1, 2, 2)

    @property
    def normal_force(self) -> np.ndarray:
        """(n,) array [N]: compression positive."""
        return np.asarray((self.force * self.normals).sum(axis=1))

    @property
    def shear_force(self) -> np.ndarray:
        """(n,) array [N]: along the tangent; in space the size of the force along the face."""
        return _along(self.force, self.normals)


def joint_states(assembly: solver.Assembly, joints: InitialJoints, increment: solver.Increment) -> JointStates:
    """Work out opening, slip and forces of all joints of an increment."""
    contacts = increment.contacts
    faces = carried_faces(assembly, joints, increment.pose, increment.fallen)
    rings = joints.rings.at((faces.on_a + faces.on_b) / 2.0)
    moved = _openings_and_slips(joints, faces)
    block_a, block_b, normals, gaps = joints.block_a, joints.block_b, faces.normals, faces.gaps
    joint = _nearest_face(contacts, joints, rings, normals)
    later = np.flatnonzero(joint < 0)
    if len(later):
        found, which = _later_joints(contacts[later])
        joint[later] = len(joints) + which
        block_a, block_b = np.concatenate([block_a, found.block_a]), np.concatenate([block_b, found.block_b])
        rings, normals = rings.joined(found.rings), np.concatenate([normals, found.normals])
        gaps = np.concatenate([gaps, np.zeros(len(found.rings.points))])
        moved = np.concatenate([moved, np.zeros((len(found), 2))])
    force = np.zeros((len(block_a), assembly.dimension))
    if increment.status != solver.Status.FALLING and len(contacts):
        side = np.where(contacts.block_a == block_a[joint], 1.0, -1.0)
        np.add.at(force, joint, side[:, None] * np.einsum("ki,kij->kj", increment.forces, contacts.frames))
    return JointStates(
        block_a=block_a,
        block_b=block_b,
        initial=np.arange(len(block_a)) < len(joints),
        rings=rings,
        normals=normals,
        gaps=gaps,
        opening=moved[:, 0],
        slip=moved[:, 1],
        of_contact=joint,
        force=force,
    )


def _nearest_face(contacts: mechanics.Contacts, joints: InitialJoints, rings: Rings, normals: np.ndarray) -> np.ndarray:
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
    middles = rings.middles()
    # A pair has one face in common; blocks that are not convex have a few.
    for k in range(int((last - first).max(initial=0))):
        some = np.flatnonzero(first + k < last)
        face = order[first[some] + k]
        arms = contacts.points[some] - middles[face]
        if contacts.points.shape[1] == 3:
            away, extent = np.abs((arms * normals[face]).sum(axis=1)), np.linalg.norm(arms, axis=1)
        else:
            half = rings.points[2 * face + 1] - middles[face]
            squared = np.maximum((half**2).sum(axis=1), 1e-300)
            place = np.clip((arms * half).sum(axis=1) / squared, -1.0, 1.0)
            away, extent = np.hypot(*(arms - place[:, None] * half).T), 2.0 * np.sqrt(squared)
        # In a corner two faces are equally near: the point belongs to the one that has its normal.
        away += (1.0 - np.abs((contacts.frames[some, 0] * normals[face]).sum(axis=1))) * extent
        closer = away < least[some]
        joint[some[closer]], least[some[closer]] = face[closer], away[closer]
    return joint


def _later_joints(contacts: mechanics.Contacts) -> tuple[InitialJoints, np.ndarray]:
    """Make joints of contact points of blocks that did not touch in the layout, and give the joint of each."""
    if contacts.points.shape[1] == 3:
        # Groups of contact points and their hulls are in the same order.
        return faces_of(contacts), grouped_by_face(contacts)[2]
    pairs, which = contacts.joints()
    ends, normals = np.zeros((len(pairs), 2, 2)), np.zeros((len(pairs), 2))
    for k, (first, _) in enumerate(pairs):
        here = np.flatnonzero(which == k)
        normal, tangent = contacts.frames[here[0]]
        normals[k] = normal if contacts.block_a[here[0]] == first else -normal
        place = contacts.points[here] @ tangent
        ends[k] = contacts.points[here[[place.argmin(), place.argmax()]]]
    return InitialJoints(pairs[:, 0], pairs[:, 1], lines(ends), normals), which


class LargestMovements:
    """The largest opening and slip of each joint over the increments in equilibrium so far: what joints.csv holds."""

    def __init__(self, assembly: solver.Assembly, parameter: mechanics.Quantity) -> None:
        self.assembly, self.parameter, self.joints = assembly, parameter, initial_joints(assembly)
        self._largest = np.zeros((len(self.joints), 2))
        self._at, self._phases = np.zeros_like(self._largest), np.zeros_like(self._largest)

    def add(self, increment: solver.Increment) -> None:
        """Take an increment in equilibrium into account."""
        moved = opening_and_slip(self.assembly, self.joints, increment.pose, increment.fallen)
        moved[:, 1] = np.abs(moved[:, 1])
        larger = moved > self._largest
        self._largest[larger] = moved[larger]
        self._at[larger], self._phases[larger] = increment.parameter, increment.phase

    def table(self, settlements: Sequence[solver.Settlement]) -> str:
        """Write joints.csv: a row for each pair of blocks that touch in the layout, the widest opening first."""
        joints, names = self.joints, self.assembly.names
        # Several settlements have phases to tell, and no unit in common where some move and some turn.
        phases = len(settlements) > 1
        unit = f" [{self.parameter.unit}]" if len({settlement.unit for settlement in settlements}) < 2 else ""
        sizes, middles, d = joints.sizes, joints.rings.middles(), self.assembly.dimension
        low, high = np.minimum(joints.block_a, joints.block_b), np.maximum(joints.block_a, joints.block_b)
        pairs, which = np.unique(np.stack([low, high], axis=1), axis=0, return_inverse=True)
        rows = []
        for k, (a, b) in enumerate(pairs):
            # Blocks that are not convex may touch along several faces: they are one joint.
            here = np.flatnonzero(which.ravel() == k)
            place = sizes[here] @ middles[here] / sizes[here].sum()
            widest = here[self._largest[here].argmax(axis=0)]
            largest, at, phase = (values[widest, [0, 1]] for values in (self._largest, self._at, self._phases))
            seen = largest > EXACT * self.assembly.block_size
            largest, at, phase = (np.where(seen, found, 0.0) for found in (largest, at, phase))
            measured = (largest[0], at[0], largest[1], at[1], *(phase if phases else ()))
            rows.append((f"{names[a]} | {names[b]}", *place, sizes[here].sum(), *measured))
        rows.sort(key=lambda row: (-row[d + 2], -row[d + 4]))
        opening, slip = (f"{self.parameter.name} at largest {what}{unit}" for what in ("opening", "slip"))
        head = ("joint", *(f"{axis} [m]" for axis in "xyz"[:d]), "length [m]" if d == 2 else "area [m²]")
        within = ("phase at largest opening", "phase at largest slip") if phases else ()
        header = (*head, "largest opening [m]", opening, "largest slip [m]", slip, *within)
        return csv_text(header, ((name, *(f"{number + 0.0:.6g}" for number in numbers)) for name, *numbers in rows))
