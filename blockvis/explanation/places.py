"""Places on the faces of joints, lines in the plane and polygons in space, and what the corners say of them."""

from __future__ import annotations

import numpy as np
import shapely

from blockvis.results.joint_faces import InitialJoints


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
