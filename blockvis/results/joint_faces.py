"""Joints in space: the polygons in which two blocks touch in the layout, and what becomes of them.

In the plane a joint is a line; see :mod:`blockvis.results.joints`.
"""

from __future__ import annotations

import csv
import io
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import shapely

import solver

from .joints import TOUCHING

#: Contact points of two blocks lie in one face where their normals are nearer than this cosine.
ALIKE = 0.98

#: A joint of the layout covers at least this part of the square of the block size; less is an edge or a corner.
SMALLEST_FACE = 1e-4


@dataclass(frozen=True)
class Rings:
    """Polygons in space as flat arrays.

    Attributes
    ----------
    points : (n_points, 3) array [m]
        Corners of all polygons, one after another; of two the ends of a line, of one a point.
    offsets : (n + 1,) int array
        Polygon ``i`` owns ``points[offsets[i]:offsets[i + 1]]``.
    """

    points: np.ndarray
    offsets: np.ndarray

    def __len__(self) -> int:
        """Count the polygons."""
        return len(self.offsets) - 1

    @cached_property
    def ring(self) -> np.ndarray:
        """(n_points,) int array: the polygon of each corner."""
        return np.repeat(np.arange(len(self)), np.diff(self.offsets))

    @cached_property
    def following(self) -> np.ndarray:
        """(n_points,) int array: the corner that comes next around its polygon."""
        following = np.arange(1, len(self.points) + 1)
        following[self.offsets[1:] - 1] = self.offsets[:-1]
        return following

    def areas(self) -> np.ndarray:
        """(n,) array [m²]."""
        if not len(self):
            return np.zeros(0)
        arms = self.points - self.points[self.offsets[:-1]][self.ring]
        cross = np.add.reduceat(np.cross(arms, arms[self.following]), self.offsets[:-1])
        return np.asarray(np.linalg.norm(cross, axis=1) / 2.0)

    def middles(self) -> np.ndarray:
        """(n, 3) array [m]: mean of the corners of each."""
        if not len(self):
            return np.zeros((0, 3))
        return np.add.reduceat(self.points, self.offsets[:-1]) / np.diff(self.offsets)[:, None]

    def at(self, points: np.ndarray) -> Rings:
        """Take the same polygons with their corners elsewhere, (n_points, 3) [m]."""
        return Rings(points, self.offsets)

    def joined(self, other: Rings) -> Rings:
        """Append other polygons."""
        return Rings(
            np.concatenate([self.points, other.points]),
            np.concatenate([self.offsets, other.offsets[1:] + self.offsets[-1]]),
        )

    def largest(self, values: np.ndarray) -> np.ndarray:
        """(n,) array: largest of the values, (n_points,), at the corners of each polygon."""
        return np.maximum.reduceat(values, self.offsets[:-1]) if len(self) else np.zeros(0)


@dataclass(frozen=True)
class JointFaces:
    """Faces in common of blocks that touch in the layout, in space.

    Attributes
    ----------
    block_a, block_b : (n_joints,) int arrays
    rings : Rings
        Where the layout has them, counter-clockwise seen from ``block_a``.
    normals : (n_joints, 3) array
        Unit normal in the layout, from ``block_b`` into ``block_a``.
    """

    block_a: np.ndarray
    block_b: np.ndarray
    rings: Rings
    normals: np.ndarray

    def __len__(self) -> int:
        """Count the joints."""
        return len(self.block_a)


def joint_faces(assembly: solver.Assembly) -> JointFaces:
    """Find the faces that touch in the layout; where they part later there is a crack.

    Parameters
    ----------
    assembly : solver.Assembly
        In space.

    Notes
    -----
    The contact points of two faces are the corners of the polygon they have in common, so the polygon is their convex
    hull. Blocks that are not convex may have several.
    """
    tolerance = TOUCHING * assembly.block_size
    contacts = solver.find_contacts(assembly, assembly.vertices, 2.0 * tolerance)
    contacts = contacts[np.abs(contacts.gaps) <= tolerance]
    found = _faces_of(contacts)
    large = found.rings.areas() > SMALLEST_FACE * assembly.block_size**2
    return _chosen(found, large)


def _chosen(faces: JointFaces, chosen: np.ndarray) -> JointFaces:
    counts = np.diff(faces.rings.offsets)[chosen]
    kept = chosen[faces.rings.ring]
    rings = Rings(faces.rings.points[kept], np.concatenate([[0], np.cumsum(counts)]))
    return JointFaces(faces.block_a[chosen], faces.block_b[chosen], rings, faces.normals[chosen])


def _faces_of(contacts: solver.Contacts) -> JointFaces:
    """Gather contact points of two blocks that lie in one plane, and take the convex hull of each group."""
    pairs, normals, group = _grouped(contacts)
    if not len(pairs):
        nothing = np.zeros(0, dtype=int)
        return JointFaces(nothing, nothing, Rings(np.zeros((0, 3)), np.zeros(1, dtype=int)), np.zeros((0, 3)))
    first, second = _tangents(normals)
    points = contacts.points
    counts = np.bincount(group, minlength=len(pairs))
    order = np.argsort(group, kind="stable")
    middles = np.stack([np.bincount(group, points[:, k], len(pairs)) for k in range(3)], axis=1) / counts[:, None]
    arms = points - middles[group]
    flat = np.stack([(arms * axis[group]).sum(axis=1) for axis in (first, second)], axis=1)
    several = shapely.multipoints(flat[order], indices=group[order])
    hulls = shapely.orient_polygons(shapely.convex_hull(several))
    corners, owner = shapely.get_coordinates(hulls, return_index=True)
    # A ring repeats its first corner at the end.
    last = np.concatenate([owner[1:] != owner[:-1], [True]]) & (shapely.get_type_id(hulls) == 3)[owner]
    corners, owner = corners[~last], owner[~last]
    height = (arms * normals[group]).sum(axis=1)
    level = np.bincount(group, height, len(pairs)) / counts
    back = (
        middles[owner]
        + corners[:, :1] * first[owner]
        + corners[:, 1:] * second[owner]
        + level[owner, None] * normals[owner]
    )
    rings = Rings(back, np.concatenate([[0], np.cumsum(np.bincount(owner, minlength=len(pairs)))]))
    return JointFaces(pairs[:, 0], pairs[:, 1], rings, normals)


def _grouped(contacts: solver.Contacts) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Pairs of blocks (n, 2) and normals (n, 3) of groups of contact points in one plane, and the group of each."""
    pairs, joint = contacts.joints()
    side = np.where(contacts.block_a == pairs[joint, 0], 1.0, -1.0) if len(contacts) else np.zeros(0)
    own = contacts.frames[:, 0] * side[:, None]
    group = np.full(len(contacts), -1)
    found_pairs: list[np.ndarray] = []
    found_normals: list[np.ndarray] = []
    count = 0
    left = np.arange(len(contacts))
    # Each round takes the first normal of each pair that is left; blocks that are convex have one face in common.
    while len(left):
        which, first = np.unique(joint[left], return_index=True)
        normal = own[left[first]]
        row = np.searchsorted(which, joint[left])
        here = (own[left] * normal[row]).sum(axis=1) > ALIKE
        group[left[here]] = count + row[here]
        count += len(which)
        found_pairs.append(pairs[which])
        found_normals.append(normal)
        left = left[~here]
    if not found_pairs:
        return np.zeros((0, 2), dtype=int), np.zeros((0, 3)), group
    return np.concatenate(found_pairs), np.concatenate(found_normals), group


def _tangents(normals: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Two unit vectors (n, 3) each that make a right-handed frame with the normals, the first level where it can be."""
    level = np.stack([-normals[:, 1], normals[:, 0], np.zeros(len(normals))], axis=1)
    upright = np.linalg.norm(level, axis=1) < 1e-6
    level[upright] = (1.0, 0.0, 0.0)
    first = level / np.linalg.norm(level, axis=1)[:, None]
    first -= (first * normals).sum(axis=1)[:, None] * normals
    first /= np.linalg.norm(first, axis=1)[:, None]
    return first, np.cross(normals, first)


@dataclass(frozen=True)
class Faces:
    """The two faces of each joint of the layout, carried to a pose.

    Attributes
    ----------
    on_a, on_b : (n_points, 3) arrays [m]
        Corners of the common polygons, riding on block a and on block b.
    gaps : (n_points,) array [m]
        Distance of the two faces at each corner, along the normal.
    along : (n_points, 3) array [m]
        Movement of block a along the face of block b there.
    normals : (n_joints, 3) array
        Unit normal from block b into block a, turned with block b.
    """

    on_a: np.ndarray
    on_b: np.ndarray
    gaps: np.ndarray
    along: np.ndarray
    normals: np.ndarray


def faces_in_space(assembly: solver.Assembly, joints: JointFaces, pose: solver.Pose) -> Faces:
    """Carry the faces of joints to a pose.

    Parameters
    ----------
    assembly : solver.Assembly
    joints : JointFaces
    pose : solver.Pose
    """
    initial, rings = solver.Pose.initial(assembly), joints.rings
    on_a, on_b = (
        solver.carried(rings.points, block[rings.ring], initial, pose) for block in (joints.block_a, joints.block_b)
    )
    normals = solver.turned(joints.normals, pose.rotations[joints.block_b])
    apart, normal = on_a - on_b, normals[rings.ring]
    gaps = (apart * normal).sum(axis=1)
    return Faces(on_a, on_b, gaps, apart - gaps[:, None] * normal, normals)


def openings_and_slips(joints: JointFaces, faces: Faces) -> tuple[np.ndarray, np.ndarray]:
    """Find opening (n_joints,) and slip (n_joints, 3) [m] of the joints of the layout, as in :class:`FaceStates`."""
    rings = joints.rings
    if not len(joints):
        return np.zeros(0), np.zeros((0, 3))
    order = np.lexsort((np.abs(faces.gaps), rings.ring))
    return rings.largest(faces.gaps), faces.along[order[rings.offsets[:-1]]]


@dataclass(frozen=True)
class FaceStates:
    """What joints in space do at one increment.

    Those of the layout come first, in their order; pairs of blocks that have come to touch since follow.

    Attributes
    ----------
    block_a, block_b : (n,) int arrays
    initial : (n,) bool array
        Whether the joint is one of the layout.
    rings : Rings
        Midway between the two faces, where they are now; of later joints, around their contact points.
    normals : (n, 3) array
        Unit normal from block b into block a.
    gaps : (n_points,) array [m]
        Distance of the two faces at each corner; 0 for later joints.
    opening : (n,) array [m]
        The largest of them.
    slip : (n, 3) array [m]
        Movement of block a along the face of block b, at the corner that is open least; 0 for later joints.
    force : (n, 3) array [N]
        Resultant on block a; 0 in frames of a fall, where there is no equilibrium.
    """

    block_a: np.ndarray
    block_b: np.ndarray
    initial: np.ndarray
    rings: Rings
    normals: np.ndarray
    gaps: np.ndarray
    opening: np.ndarray
    slip: np.ndarray
    force: np.ndarray

    @property
    def normal_force(self) -> np.ndarray:
        """(n,) array [N]: compression positive."""
        return np.asarray((self.force * self.normals).sum(axis=1))

    @property
    def shear_force(self) -> np.ndarray:
        """(n,) array [N]: size of the force along the face."""
        return np.asarray(np.linalg.norm(self.force - self.normal_force[:, None] * self.normals, axis=1))


def face_states(assembly: solver.Assembly, joints: JointFaces, increment: solver.Increment) -> FaceStates:
    """Work out opening, slip and forces of all joints of an increment in space.

    Parameters
    ----------
    assembly : solver.Assembly
    joints : JointFaces
    increment : solver.Increment
    """
    contacts = increment.contacts
    faces = faces_in_space(assembly, joints, increment.pose)
    rings = joints.rings.at((faces.on_a + faces.on_b) / 2.0)
    opening, slip = openings_and_slips(joints, faces)
    block_a, block_b, normals, gaps = joints.block_a, joints.block_b, faces.normals, faces.gaps
    joint = _joint_of(contacts, joints, normals, rings.middles())
    later = np.flatnonzero(joint < 0)
    if len(later):
        found = _faces_of(contacts[later])
        # Groups of contact points and their hulls are in the same order.
        joint[later] = len(joints) + _grouped(contacts[later])[2]
        block_a, block_b = np.concatenate([block_a, found.block_a]), np.concatenate([block_b, found.block_b])
        rings, normals = rings.joined(found.rings), np.concatenate([normals, found.normals])
        gaps = np.concatenate([gaps, np.zeros(len(found.rings.points))])
        opening = np.concatenate([opening, np.zeros(len(found))])
        slip = np.concatenate([slip, np.zeros((len(found), 3))])
    force = np.zeros((len(block_a), 3))
    if increment.status != solver.Status.FALLING and len(contacts):
        side = np.where(contacts.block_a == block_a[joint], 1.0, -1.0)
        np.add.at(force, joint, side[:, None] * np.einsum("ki,kij->kj", increment.forces, contacts.frames))
    return FaceStates(
        block_a=block_a,
        block_b=block_b,
        initial=np.arange(len(block_a)) < len(joints),
        rings=rings,
        normals=normals,
        gaps=gaps,
        opening=opening,
        slip=slip,
        force=force,
    )


def _joint_of(contacts: solver.Contacts, joints: JointFaces, normals: np.ndarray, middles: np.ndarray) -> np.ndarray:
    """(n_contacts,) int array: the joint between the same blocks whose plane is nearest to each point, or -1."""
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
    for k in range(int((last - first).max(initial=0))):
        some = np.flatnonzero(first + k < last)
        face = order[first[some] + k]
        away = np.abs(((contacts.points[some] - middles[face]) * normals[face]).sum(axis=1))
        # In a corner two faces are equally near: the point belongs to the one that has its normal.
        turned = 1.0 - np.abs((contacts.frames[some, 0] * normals[face]).sum(axis=1))
        away += turned * np.linalg.norm(contacts.points[some] - middles[face], axis=1)
        closer = away < least[some]
        joint[some[closer]], least[some[closer]] = face[closer], away[closer]
    return joint


class LargestMovementsInSpace:
    """The largest opening and slip of each joint over the increments in equilibrium so far: what joints.csv holds.

    Parameters
    ----------
    assembly : solver.Assembly
    parameter : solver.Quantity
        What the increments run over.
    """

    def __init__(self, assembly: solver.Assembly, parameter: solver.Quantity) -> None:
        self.assembly, self.parameter, self.joints = assembly, parameter, joint_faces(assembly)
        self._largest = np.zeros((len(self.joints), 2))
        self._at = np.zeros_like(self._largest)

    def add(self, increment: solver.Increment) -> None:
        """Take an increment in equilibrium into account."""
        opening, slip = openings_and_slips(self.joints, faces_in_space(self.assembly, self.joints, increment.pose))
        moved = np.stack([np.abs(opening), np.linalg.norm(slip, axis=1)], axis=1)
        larger = moved > self._largest
        self._largest[larger] = moved[larger]
        self._at[larger] = increment.parameter

    def table(self) -> str:
        """Write joints.csv: a row for each pair of blocks that touch in the layout, the widest opening first."""
        joints, names = self.joints, self.assembly.names
        areas, middles = joints.rings.areas(), joints.rings.middles()
        pairs, which = np.unique(np.stack([joints.block_a, joints.block_b], axis=1), axis=0, return_inverse=True)
        rows = []
        for k, (a, b) in enumerate(pairs):
            # Blocks that are not convex may touch along several faces: they are one joint.
            here = np.flatnonzero(which.ravel() == k)
            place = areas[here] @ middles[here] / areas[here].sum()
            widest = here[self._largest[here].argmax(axis=0)]
            largest, at = (values[widest, [0, 1]] for values in (self._largest, self._at))
            rows.append((f"{names[a]} | {names[b]}", *place, areas[here].sum(), largest[0], at[0], largest[1], at[1]))
        rows.sort(key=lambda row: -max(row[5], row[7]))
        text = io.StringIO()
        table = csv.writer(text, lineterminator="\n")
        what, unit = self.parameter.name, self.parameter.unit
        opening, slip = (f"{what} at largest {movement} [{unit}]" for movement in ("opening", "slip"))
        head = ("joint", "x [m]", "y [m]", "z [m]", "area [m²]")
        table.writerow((*head, "largest opening [m]", opening, "largest slip [m]", slip))
        # To the nanometre: what is smaller is rounding.
        table.writerows((name, *(f"{round(number, 9) + 0.0:.6g}" for number in numbers)) for name, *numbers in rows)
        return text.getvalue()
