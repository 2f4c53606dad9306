"""Outlines cut into triangles, for files and pictures that know nothing else."""

from __future__ import annotations

import numpy as np


def cells_of_ring(ring: np.ndarray) -> list[tuple[int, ...]]:
    """Cover a counter-clockwise ring with cells: the ring itself if it has three corners or four convex ones."""
    n = len(ring)
    if n == 3 or (n == 4 and (_turns(ring) > 0).all()):
        return [tuple(range(n))]
    return [tuple(map(int, triangle)) for triangle in triangles_of_ring(ring)]


def triangles_of_ring(ring: np.ndarray) -> np.ndarray:
    """(n - 2, 3) int array: triangles that fill a simple (n, 2) ring, and turn as it does, by cutting its ears off.

    Every simple polygon has two ears (Meisters 1975, doi:10.2307/2319703). Of the ears the one with the widest
    smallest angle goes first, so that slivers stay few.
    """
    x, y = (ring - ring[0]).T
    sign = 1.0 if x @ np.roll(y, -1) >= y @ np.roll(x, -1) else -1.0
    remaining = list(range(len(ring)))
    triangles = []
    while len(remaining) > 3:
        points = ring[remaining]
        turn = sign * _turns(points)
        before, after = np.roll(points, 1, axis=0), np.roll(points, -1, axis=0)
        longest = np.max(
            [((p - q) ** 2).sum(axis=1) for p, q in ((before, points), (points, after), (after, before))], 0
        )
        quality = turn / np.maximum(longest, 1e-300)
        ear = next((int(k) for k in np.argsort(-quality) if turn[k] > 0 and _is_ear(points, int(k), sign)), None)
        if ear is None:
            # No ear has an area: cut a corner that lies on the line of its neighbours; or the ring is not simple.
            ear = int(np.argmin(np.abs(turn)))
        triangles.append((remaining[ear - 1], remaining[ear], remaining[(ear + 1) % len(remaining)]))
        del remaining[ear]
    triangles.append((remaining[0], remaining[1], remaining[2]))
    return np.array(triangles)


def _turns(points: np.ndarray) -> np.ndarray:
    u, v = points - np.roll(points, 1, axis=0), np.roll(points, -1, axis=0) - points
    return u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]


def _is_ear(points: np.ndarray, k: int, sign: float) -> bool:
    a, b, c = points[k - 1], points[k], points[(k + 1) % len(points)]
    inside = np.ones(len(points), dtype=bool)
    for p, q in ((a, b), (b, c), (c, a)):
        inside &= sign * ((q[0] - p[0]) * (points[:, 1] - p[1]) - (q[1] - p[1]) * (points[:, 0] - p[0])) >= 0
    # A corner of the ear itself, or another one drawn at the same place, does not spoil it.
    for p in (a, b, c):
        inside &= (points != p).any(axis=1)
    return not inside.any()
