"""Blocks in space: corners and faces, their volume and their planes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from .triangulation import triangles_of_ring

#: A block in space: (n, 3) corners, and the corners around each face, counter-clockwise seen from outside.
Solid = tuple[np.ndarray, list[list[int]]]


def volume(points: np.ndarray, faces: Sequence[Sequence[int]]) -> float:
    """Volume of a block; negative if its faces are seen clockwise from outside."""
    middle = points.mean(axis=0)
    total = 0.0
    for face in faces:
        fan = points[list(face)] - middle
        total += float(np.cross(fan[1:-1], fan[2:]).dot(fan[0]).sum())
    return total / 6.0


def centroid(points: np.ndarray, faces: Sequence[Sequence[int]]) -> np.ndarray:
    """(3,) array: centre of gravity of a block."""
    middle = points.mean(axis=0)
    total, moment = 0.0, np.zeros(3)
    for face in faces:
        fan = points[list(face)] - middle
        parts = np.cross(fan[1:-1], fan[2:]) @ fan[0]
        total += float(parts.sum())
        moment += parts @ (fan[0] + fan[1:-1] + fan[2:]) / 4.0
    return np.asarray(middle + moment / total)


def outward(points: np.ndarray, faces: list[list[int]]) -> Solid:
    """Turn all faces of a block so that they are seen counter-clockwise from outside.

    Examples
    --------
    >>> corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    >>> outward(corners, [[0, 1, 2], [0, 3, 1], [1, 3, 2], [0, 2, 3]])[1][0]
    [2, 1, 0]
    """
    return points, faces if volume(points, faces) > 0.0 else [face[::-1] for face in faces]


def area_vector(ring: np.ndarray) -> np.ndarray:
    """(3,) array: normal of a (n, 3) ring that is seen counter-clockwise, as long as its area is large."""
    fan = ring[1:] - ring[0]
    return np.asarray(np.cross(fan[:-1], fan[1:]).sum(axis=0) / 2.0)


def triangles_of(points: np.ndarray, faces: Sequence[Sequence[int]]) -> np.ndarray:
    """(n, 3) int array: the faces of a block cut into triangles, those with re-entrant corners included."""
    found = []
    for face in faces:
        if len(face) == 3:
            found.append(np.array([face]))
            continue
        ring = points[list(face)]
        across = int(np.abs(area_vector(ring)).argmax())
        found.append(np.array(face)[triangles_of_ring(np.delete(ring, across, axis=1))])
    return np.concatenate(found)


def size_of(points: np.ndarray) -> float:
    """Diagonal of the box around a block."""
    return float(np.linalg.norm(np.ptp(points, axis=0)))


def between(first: ArrayLike, second: ArrayLike) -> Solid:
    """Close the block between two faces with the same number of corners, in the same order.

    Parameters
    ----------
    first, second : (n, 3) arrays [m]
        Corners around both faces. Where two of them coincide, the side between them is a triangle or vanishes.

    Examples
    --------
    >>> len(between([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 0, 1], [1, 0, 1], [0, 1, 1]])[1])
    5
    """
    near, far = np.asarray(first, dtype=float), np.asarray(second, dtype=float)
    n = len(near)
    following = [(k + 1) % n for k in range(n)]
    faces = [list(range(n))[::-1], list(range(n, 2 * n))]
    faces += [[k, following[k], following[k] + n, k + n] for k in range(n)]
    return outward(*_without_copies(np.vstack([near, far]), faces))


def extruded(outline: ArrayLike, first: float, last: float) -> Solid:
    """Extrude an outline of the upright plane along y.

    Parameters
    ----------
    outline : (n, 2) array [m]
        Corners x, z.
    first, last : float [m]
        y at which the block begins and ends.
    """
    ring = np.asarray(outline, dtype=float)

    def at(y: float) -> np.ndarray:
        return np.column_stack([ring[:, 0], np.full(len(ring), y), ring[:, 1]])

    return between(at(first), at(last))


def prism(outline: ArrayLike, bottom: float, top: float) -> Solid:
    """Extrude an outline in plan upwards.

    Parameters
    ----------
    outline : (n, 2) array [m]
        Corners x, y.
    bottom, top : float [m]
        z at which the block begins and ends.
    """
    ring = np.asarray(outline, dtype=float)
    return between(*(np.column_stack([ring, np.full(len(ring), z)]) for z in (bottom, top)))


def box(low: Sequence[float], high: Sequence[float]) -> Solid:
    """Make a box of two opposite corners [m]."""
    (x0, y0, z0), (x1, y1, z1) = low, high
    return extruded([[x0, z0], [x1, z0], [x1, z1], [x0, z1]], y0, y1)


def _without_copies(points: np.ndarray, faces: list[list[int]]) -> Solid:
    """Merge corners that coincide, and drop the faces that have no area then."""
    near = 1e-12 * float(np.ptp(points, axis=0).max())
    first = [int(np.flatnonzero(np.abs(points - p).max(axis=1) <= near)[0]) for p in points]
    kept = sorted(set(first))
    number = {old: new for new, old in enumerate(kept)}
    rings = [list(dict.fromkeys(number[first[k]] for k in face)) for face in faces]
    return points[kept], [ring for ring in rings if len(ring) > 2]
