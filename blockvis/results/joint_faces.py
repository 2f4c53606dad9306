"""The faces that two blocks have in common: lines in the plane, polygons in space."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from weakref import WeakKeyDictionary

import numpy as np
import shapely

import solver
from blockvis.layout.outlines import TOUCHING
from solver import mechanics

#: Faces of the plane count as parallel up to this sine.
PARALLEL = 0.05

#: Contact points of two blocks lie in one face where their normals are nearer than this cosine.
ALIKE = 0.98

#: A joint of the layout covers at least this part of the square of the block size; less is an edge or a corner.
SMALLEST_FACE = 1e-4


def carried_between(
    points: np.ndarray, block_a: np.ndarray, block_b: np.ndarray, before: solver.Pose, after: solver.Pose
) -> np.ndarray:
    """(n, d) array [m]: contact points at another pose, half-way between those that move with either block."""
    on_a, on_b = (mechanics.carried(points, block, before, after) for block in (block_a, block_b))
    return (on_a + on_b) / 2.0


@dataclass(frozen=True)
class Rings:
    """Polygons in space, or lines in the plane, as flat arrays."""

    #: (n_points, d) array [m]: corners of all polygons, one after another; of two the ends of a line, of one a point.
    points: np.ndarray
    offsets: np.ndarray  #: (n + 1,) int array: polygon ``i`` owns ``points[offsets[i]:offsets[i + 1]]``.

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
        arms = self.points - self.points[self.offsets[:-1]][self.ring]
        cross = np.add.reduceat(np.cross(arms, arms[self.following]), self.offsets[:-1])
        return np.asarray(np.linalg.norm(cross, axis=1) / 2.0)

    def middles(self) -> np.ndarray:
        """(n, d) array [m]: mean of the corners of each."""
        return np.add.reduceat(self.points, self.offsets[:-1]) / np.diff(self.offsets)[:, None]

    def at(self, points: np.ndarray) -> Rings:
        """Take the same polygons with their corners elsewhere, (n_points, d) [m]."""
        return Rings(points, self.offsets)

    def joined(self, other: Rings) -> Rings:
        """Append other polygons."""
        return Rings(
            np.concatenate([self.points, other.points]),
            np.concatenate([self.offsets, other.offsets[1:] + self.offsets[-1]]),
        )

    def largest(self, values: np.ndarray) -> np.ndarray:
        """(n,) array: largest of the values, (n_points,), at the corners of each polygon."""
        return np.asarray(np.maximum.reduceat(values, self.offsets[:-1]))


@dataclass(frozen=True)
class InitialJoints:
    """Pairs of faces that touch in the layout."""

    #: (n_joints,) int arrays.
    block_a: np.ndarray
    block_b: np.ndarray
    #: What they have in common where the layout has it: in the plane both ends, in space a polygon, counter-clockwise
    #: seen from ``block_a``.
    rings: Rings
    normals: np.ndarray  #: (n_joints, d) array: unit normal in the layout, from ``block_b`` into ``block_a``.

    def __len__(self) -> int:
        """Count the joints."""
        return len(self.block_a)

    @property
    def ends(self) -> np.ndarray:
        """(n_joints, 2, 2) array [m]: both ends of each, in the plane."""
        return self.rings.points.reshape(-1, 2, 2)

    @cached_property
    def sizes(self) -> np.ndarray:
        """(n_joints,) array: lengths [m] in the plane, areas [m²] in space."""
        return lengths_of(self.ends) if self.rings.points.shape[1] == 2 else self.rings.areas()


def lines(ends: np.ndarray) -> Rings:
    """Make rings of lines of which the ends are given, (n, 2, d) [m]."""
    return Rings(ends.reshape(-1, ends.shape[2]), 2 * np.arange(len(ends) + 1))


def lengths_of(ends: np.ndarray) -> np.ndarray:
    """(n,) array [m]: lengths of lines in the plane, (n, 2, 2) [m]."""
    return np.asarray(np.hypot(*(ends[:, 1] - ends[:, 0]).T))


#: Joints by their assembly, as long as it lives: who needs them asks again and again.
_known: WeakKeyDictionary[solver.Assembly, InitialJoints] = WeakKeyDictionary()


def initial_joints(assembly: solver.Assembly) -> InitialJoints:
    """Find the faces that touch in the layout, once; where they part later there is a crack."""
    if assembly not in _known:
        _known[assembly] = _touching_faces(assembly)
    return _known[assembly]


def _touching_faces(assembly: solver.Assembly) -> InitialJoints:
    """Find the faces that touch in the layout.

    In space the contact points of two faces are the corners of the polygon they have in common, so the polygon is their
    convex hull. Blocks that are not convex may have several.
    """
    tolerance = TOUCHING * assembly.block_size
    contacts = mechanics.find_contacts(assembly, assembly.vertices, 2.0 * tolerance)
    contacts = contacts[np.abs(contacts.gaps) <= tolerance]
    if assembly.dimension == 2:
        return _joints_in_plane(assembly, contacts, tolerance)
    found = faces_of(contacts)
    return _chosen(found, found.rings.areas() > SMALLEST_FACE * assembly.block_size**2)


def _joints_in_plane(assembly: solver.Assembly, contacts: mechanics.Contacts, tolerance: float) -> InitialJoints:
    shapes = assembly.polygons
    vertex, edge_b, _ = mechanics.corners_and_edges(contacts.features)
    # The corner belongs to two faces of block a; either may lie on the edge of block b.
    edge_a = np.concatenate([vertex, shapes.previous_vertex[vertex]])
    edge_b = np.concatenate([edge_b, edge_b])
    pairs = np.unique(np.stack([np.minimum(edge_a, edge_b), np.maximum(edge_a, edge_b)], axis=1), axis=0)
    a, b = pairs[:, 0], pairs[:, 1]
    start, stop = assembly.vertices[b], assembly.vertices[shapes.next_vertex[b]]
    length = shapes.edge_lengths[b]
    tangent = (stop - start) / length[:, None]
    normal = np.stack([tangent[:, 1], -tangent[:, 0]], axis=1)
    ends_a = np.stack([assembly.vertices[a], assembly.vertices[shapes.next_vertex[a]]], axis=1) - start[:, None]
    along = np.einsum("nij,nj->ni", ends_a, tangent)
    across = np.abs(np.einsum("nij,nj->ni", ends_a, normal))
    lean = np.abs(across[:, 1] - across[:, 0]) / shapes.edge_lengths[a]
    low = np.maximum(0.0, along.min(axis=1))
    high = np.minimum(length, along.max(axis=1))
    keep = (high - low > 2.0 * tolerance) | (high - low > 0.5 * np.minimum(length, shapes.edge_lengths[a]))
    keep &= (lean < PARALLEL) & (across.min(axis=1) <= 2.0 * tolerance) & (along[:, 0] > along[:, 1])
    ends = np.stack([start + low[:, None] * tangent, start + high[:, None] * tangent], axis=1)
    owner = assembly.block_of_vertex
    return InitialJoints(owner[a][keep], owner[b][keep], lines(ends[keep]), normal[keep])


def _chosen(faces: InitialJoints, chosen: np.ndarray) -> InitialJoints:
    counts = np.diff(faces.rings.offsets)[chosen]
    kept = chosen[faces.rings.ring]
    rings = Rings(faces.rings.points[kept], np.concatenate([[0], np.cumsum(counts)]))
    return InitialJoints(faces.block_a[chosen], faces.block_b[chosen], rings, faces.normals[chosen])


def faces_of(contacts: mechanics.Contacts) -> InitialJoints:
    """Gather contact points of two blocks that lie in one plane, and take the convex hull of each group."""
    pairs, normals, group = grouped_by_face(contacts)
    if not len(pairs):
        nothing = np.zeros(0, dtype=int)
        return InitialJoints(nothing, nothing, Rings(np.zeros((0, 3)), np.zeros(1, dtype=int)), np.zeros((0, 3)))
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
    return InitialJoints(pairs[:, 0], pairs[:, 1], rings, normals)


def grouped_by_face(contacts: mechanics.Contacts) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Pairs of blocks (n, 2) and normals (n, 3) of groups of contact points in one plane, and the group of each."""
    pairs, joint = contacts.joints()
    side = np.where(contacts.block_a == pairs[joint, 0], 1.0, -1.0)
    own = contacts.frames[:, 0] * side[:, None]
    group = np.full(len(contacts), -1)
    found_pairs, found_normals, count = [pairs[:0]], [own[:0]], 0
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


def corners_of(joints: InitialJoints) -> np.ndarray:
    """(n_joints, k) int array: corners of each face, in ``joints.rings``; where it has fewer than k its first again."""
    first, counts = joints.rings.offsets[:-1], np.diff(joints.rings.offsets)
    number = np.arange(counts.max(initial=2))
    return np.asarray(first[:, None] + np.where(number < counts[:, None], number, 0))


def on_faces(points: np.ndarray, joints: InitialJoints) -> tuple[np.ndarray, np.ndarray]:
    """Find the place on each face that is nearest to each of points (n, d) [m].

    Gives the distances (n, n_joints) [m], and weights (n, n_joints, k), with sum 1, for the corners of
    :func:`corners_of`: what is linear over a face, its corners or the gap between two plane faces, has there the mean
    of its values at the corners with these weights.
    """
    if joints.rings.points.shape[1] == 2:
        return _on_lines(points, joints.ends)
    corners = corners_of(joints)
    away, weights = np.zeros((len(points), len(joints))), np.zeros((len(points), *corners.shape))
    for joint, (first, stop) in enumerate(zip(joints.rings.offsets[:-1], joints.rings.offsets[1:], strict=True)):
        ring = joints.rings.points[first:stop]
        middle = ring.mean(axis=0)
        # Rows along the face, and across it.
        axes = np.linalg.svd(ring - middle)[2]
        flat, own = (ring - middle) @ axes[:2].T, (points - middle) @ axes.T
        near = shapely.get_coordinates(shapely.shortest_line(shapely.Polygon(flat), shapely.points(own[:, :2])))[::2]
        away[:, joint] = np.hypot(np.linalg.norm(own[:, :2] - near, axis=1), own[:, 2])
        known, there = (np.column_stack([np.ones(len(some)), some]) for some in (flat, near))
        weights[:, joint, : stop - first] = there @ np.linalg.pinv(known)
    return away, weights


def _on_lines(points: np.ndarray, ends: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    start, line = ends[:, 0], ends[:, 1] - ends[:, 0]
    squared = np.maximum((line**2).sum(axis=1), 1e-300)
    along = np.clip(((points[:, None] - start) * line).sum(axis=2) / squared, 0.0, 1.0)
    apart = points[:, None] - (start + along[..., None] * line)
    return np.hypot(apart[..., 0], apart[..., 1]), np.stack([1.0 - along, along], axis=2)
