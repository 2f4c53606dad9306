"""Blocks in space: corners and faces, their volume and their planes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely
from numpy.typing import ArrayLike

from .triangulation import triangles_of_ring

#: A block in space: (n, 3) corners, and the corners around each face, counter-clockwise seen from outside.
Solid = tuple[np.ndarray, list[list[int]]]

#: Name of the frame of trimesh in which all nodes of a .glb lie: one that no block has, which would hold the others.
BASE_FRAME = "\0world"


def cross(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """(n, 3) array: cross products, several times as fast as ``np.cross`` for the few faces of a block."""
    found = np.empty_like(first)
    found[:, 0] = first[:, 1] * second[:, 2] - first[:, 2] * second[:, 1]
    found[:, 1] = first[:, 2] * second[:, 0] - first[:, 0] * second[:, 2]
    found[:, 2] = first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]
    return found


def fans(faces: Sequence[Sequence[int]] | np.ndarray) -> np.ndarray:
    """(m, 3) int array: faces cut into triangles from their first corner, which keeps the edges around each."""
    if isinstance(faces, np.ndarray):
        return faces
    triangles = [(face[0], face[k], face[k + 1]) for face in faces for k in range(1, len(face) - 1)]
    return np.array(triangles, dtype=np.int64).reshape(-1, 3)


def sides_of(triangles: np.ndarray) -> np.ndarray:
    """(3 m, 2) int array: the sides of triangles, one triangle after another, the lower corner of each first."""
    return np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)


def volume(points: np.ndarray, faces: Sequence[Sequence[int]] | np.ndarray) -> float:
    """Volume of a block; negative if its faces are seen clockwise from outside."""
    a, b, c = (points - points.mean(axis=0))[fans(faces).T]
    return float((cross(b, c) * a).sum()) / 6.0


def area_vectors(points: np.ndarray, faces: Sequence[Sequence[int]] | np.ndarray) -> np.ndarray:
    """(n_faces, 3) array: normals of faces that are seen counter-clockwise, as long as their areas are large."""
    counts = [1] * len(faces) if isinstance(faces, np.ndarray) else [len(face) - 2 for face in faces]
    a, b, c = points[fans(faces).T]
    return np.asarray(np.add.reduceat(cross(b - a, c - a), np.cumsum([0, *counts[:-1]]), axis=0) / 2.0)


def width_of(points: np.ndarray, faces: Sequence[Sequence[int]] | np.ndarray) -> float:
    """Six volumes over the surface: the edge of a cube, three times the thickness of a slab."""
    surface = float(np.linalg.norm(area_vectors(points, faces), axis=1).sum())
    return 6.0 * abs(volume(points, faces)) / surface if surface else 0.0


def planes_of(points: np.ndarray, faces: Sequence[Sequence[int]]) -> np.ndarray:
    """(n_faces, 4) array: unit normals of faces, and the distances of their planes from the origin."""
    normals = area_vectors(points, faces)
    normals = normals / np.maximum(np.linalg.norm(normals, axis=1), 1e-300)[:, None]
    counts = np.array([len(face) for face in faces])
    corners = points[np.concatenate(faces)]
    starts = np.cumsum(counts) - counts
    middles = np.add.reduceat(corners, starts, axis=0) / counts[:, None]
    return np.column_stack([normals, (middles * normals).sum(axis=1)])


def off_planes(points: np.ndarray, faces: Sequence[Sequence[int]], planes: np.ndarray) -> np.ndarray:
    """(n_faces,) array: how far the corner of each face that is farthest from its plane is from it."""
    counts = np.array([len(face) for face in faces])
    whose = np.repeat(np.arange(len(faces)), counts)
    away = np.abs((points[np.concatenate(faces)] * planes[whose, :3]).sum(axis=1) - planes[whose, 3])
    return np.asarray(np.maximum.reduceat(away, np.cumsum(counts) - counts))


def outward(points: np.ndarray, faces: list[list[int]]) -> Solid:
    """Turn all faces of a block so that they are seen counter-clockwise from outside."""
    return points, faces if volume(points, faces) > 0.0 else [face[::-1] for face in faces]


def triangles_of(points: np.ndarray, faces: Sequence[Sequence[int]]) -> np.ndarray:
    """(n, 3) int array: the faces of a block cut into triangles, those with re-entrant corners included."""
    found = []
    for face in faces:
        if len(face) == 3:
            found.append(np.array([face]))
            continue
        ring = points[list(face)]
        across = int(np.abs(area_vectors(ring, [range(len(ring))])[0]).argmax())
        found.append(np.array(face)[triangles_of_ring(np.delete(ring, across, axis=1))])
    return np.concatenate(found)


def plan_beyond(points: np.ndarray, height: np.ndarray, small: float = 0.0) -> shapely.Geometry:
    """Hull in plan of what of the hull of (n, 3) points has heights (n,) [m] of at least 0, but for ``small`` [m]."""
    up, down = height > small, height < -small
    share = (height[up, None] / (height[up, None] - height[down]))[..., None]
    cut = (1.0 - share) * points[up, None] + share * points[down]
    return shapely.MultiPoint(np.vstack([points[height >= -small], cut.reshape(-1, 3)])[:, :2]).convex_hull


def size_of(points: np.ndarray) -> float:
    """Diagonal of the box around a block."""
    return float(np.linalg.norm(np.ptp(points, axis=0)))


def between(first: ArrayLike, second: ArrayLike) -> Solid:
    """Close the block between two faces, (n, 3) arrays [m], with as many corners, in the same order.

    Where two of these coincide, the side between them is a triangle or vanishes.
    """
    near, far = np.asarray(first, dtype=float), np.asarray(second, dtype=float)
    n = len(near)
    following = [(k + 1) % n for k in range(n)]
    faces = [list(range(n))[::-1], list(range(n, 2 * n))]
    faces += [[k, following[k], following[k] + n, k + n] for k in range(n)]
    return outward(*_without_copies(np.vstack([near, far]), faces))


def extruded(outline: ArrayLike, first: float, last: float) -> Solid:
    """Extrude an outline of the upright plane, (n, 2) array of x, z [m], along y between two places [m]."""
    ring = np.asarray(outline, dtype=float)
    return between(*(np.insert(ring, 1, y, axis=1) for y in (first, last)))


def prism(outline: ArrayLike, bottom: float, top: float) -> Solid:
    """Extrude an outline in plan, (n, 2) array of x, y [m], upwards between two levels [m]."""
    ring = np.asarray(outline, dtype=float)
    return between(*(np.insert(ring, 2, z, axis=1) for z in (bottom, top)))


def box(low: Sequence[float] | np.ndarray, high: Sequence[float] | np.ndarray) -> Solid:
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
