"""Bodies by their corners, and outlines: areas, centroids, edges, crossings, overlaps; every loop runs in numpy."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from solver.words import Kept, kept

from .broad_phase import box_pairs, boxes, expand_ranges
from .portions import alike


def turn(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(...) array: cross products of vectors in the plane, (..., 2), positive where b points to the left of a."""
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


def next_vertices(offsets: np.ndarray) -> np.ndarray:
    """(n_vertices,) int array: the vertex that follows each around its polygon; edge i runs from i to it."""
    following = np.arange(1, offsets[-1] + 1)
    following[offsets[1:] - 1] = offsets[:-1]
    return following


@dataclass(frozen=True)
class Bodies(Kept):
    """Polygons or solids by their corners, one after another."""

    vertices: np.ndarray  #: (n_vertices, d) [m]
    offsets: np.ndarray  #: (n + 1,) int: body ``i`` owns ``vertices[offsets[i]:offsets[i + 1]]``

    def __len__(self) -> int:
        """Count the bodies."""
        return len(self.offsets) - 1

    @kept
    def block_of_vertex(self) -> np.ndarray:
        """(n_vertices,) int array: the body each vertex belongs to."""
        return np.repeat(np.arange(len(self)), np.diff(self.offsets))

    def shifted(self, by: np.ndarray) -> Self:
        """Move the drawing by (d,) [m]."""
        return replace(self, vertices=self.vertices + by)


def polygon_integrals(vertices: np.ndarray, offsets: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Areas (n,) [m²], positive where corners run counter-clockwise, and centroids (n, 2) [m] of polygons."""
    starts = offsets[:-1]
    # From the first corner of each, so that coordinates far from the origin (UTM) lose no digits.
    origin = vertices[starts]
    x = vertices - np.repeat(origin, np.diff(offsets), axis=0)
    y = x[next_vertices(offsets)]
    cross = turn(x, y)
    areas = np.add.reduceat(cross, starts) / 2.0
    with np.errstate(divide="ignore", invalid="ignore"):
        local = np.add.reduceat((x + y) * cross[:, None], starts) / (6.0 * areas[:, None])
    return areas, origin + local


def self_crossings(vertices: np.ndarray, offsets: np.ndarray) -> dict[int, tuple[int, int]]:
    """First pair of edges of each polygon that crosses or touches itself: {polygon: (edge, edge)}."""
    crossings: dict[int, tuple[int, int]] = {}
    every = np.arange(len(offsets) - 1)
    # Twice, as there are as many pairs of edges as the square of their number.
    for chosen, corners, _ in alike((offsets, every), (offsets, every)):
        n = corners.shape[1]
        first, second = np.triu_indices(n, k=2)
        apart = ~((first == 0) & (second == n - 1))
        first, second = first[apart], second[apart]
        ring = vertices[corners]
        end = np.roll(ring, -1, axis=1)
        a0, a1, b0, b1 = ring[:, first], end[:, first], ring[:, second], end[:, second]
        # Each separates the ends of the other, or holds one; on one line all sides are 0, and boxes tell.
        hit = (_side(a0, a1, b0) * _side(a0, a1, b1) <= 0) & (_side(b0, b1, a0) * _side(b0, b1, a1) <= 0)
        hit &= ((np.minimum(a0, a1) <= np.maximum(b0, b1)) & (np.minimum(b0, b1) <= np.maximum(a0, a1))).all(axis=-1)
        for row in np.flatnonzero(hit.any(axis=1)):
            k = int(np.flatnonzero(hit[row])[0])
            crossings[int(chosen[row])] = int(first[k]), int(second[k])
    return crossings


def _side(p: np.ndarray, q: np.ndarray, r: np.ndarray) -> np.ndarray:
    return turn(q - p, r - p)


def overlap_depths(
    vertices: np.ndarray, offsets: np.ndarray, tolerance: float | np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Pairs of polygons that overlap by more than a tolerance [m], (n_pairs,) int, and their depths, (n_pairs,) [m].

    Their vertices, (n_vertices, 2) [m], run counter-clockwise. A depth is a lower bound of the distance one has to be
    moved out of the other.

    A pair overlaps where a corner, the middle of an edge or an interior point of one lies inside the other
    (depth: its distance to the outline), or where two edges cross (depth: the shortest of the four distances
    of their ends from the other edge).
    """
    i, j = box_pairs(vertices, offsets, -tolerance)
    of_points = _inside_depth(vertices, offsets, np.append(i, j), np.append(j, i)).reshape(2, -1)
    depth = np.maximum(of_points.max(axis=0), _crossing_depth(vertices, offsets, i, j))
    deep = depth > tolerance
    return i[deep], j[deep], depth[deep]


def interior_points(vertices: np.ndarray, offsets: np.ndarray) -> np.ndarray:
    """(n, 2) array: a point well inside each polygon: the centroid, or for a bent one a point near an edge."""
    areas, centroids = polygon_integrals(vertices, offsets)
    n = np.arange(len(areas))
    inside = _signed_distance(centroids, n, vertices, offsets) > 0
    if inside.all():
        return centroids
    along = vertices[next_vertices(offsets)] - vertices
    length = np.hypot(*along.T)
    owner = np.repeat(n, np.diff(offsets))
    # A fifth of the mean width inwards from the middle of the edge from which that leads deepest inside.
    width = areas / np.add.reduceat(length, offsets[:-1])
    inward = np.stack([-along[:, 1], along[:, 0]], axis=1) / length[:, None]
    candidate = vertices + along / 2.0 + inward * (0.2 * width[owner])[:, None]
    distance = _signed_distance(candidate, owner, vertices, offsets)
    order = np.lexsort((distance, owner))
    best = candidate[order[offsets[1:] - 1]]
    return np.where(inside[:, None], centroids, best)


def _signed_distance(points: np.ndarray, block: np.ndarray, vertices: np.ndarray, offsets: np.ndarray) -> np.ndarray:
    """Distance of each point to the outline of its polygon, positive inside, negative outside."""
    counts = np.diff(offsets)[block]
    owner, position = expand_ranges(counts)
    start = offsets[block][owner] + position
    p, a, b = points[owner], vertices[start], vertices[next_vertices(offsets)[start]]
    along = b - a
    rest = p - a
    t = np.clip((rest * along).sum(axis=1) / np.maximum((along**2).sum(axis=1), 1e-300), 0.0, 1.0)
    distance = np.hypot(*(rest - t[:, None] * along).T)
    firsts = np.cumsum(counts) - counts
    nearest = np.minimum.reduceat(distance, firsts)
    above = (a[:, 1] > p[:, 1]) != (b[:, 1] > p[:, 1])
    with np.errstate(divide="ignore", invalid="ignore"):
        x = a[:, 0] + (p[:, 1] - a[:, 1]) * along[:, 0] / along[:, 1]
    crossings = np.add.reduceat((above & (p[:, 0] < x)).astype(int), firsts)
    return np.where(crossings % 2 == 1, nearest, -nearest)


def _inside_depth(vertices: np.ndarray, offsets: np.ndarray, i: np.ndarray, j: np.ndarray) -> np.ndarray:
    """For each pair, how deep the deepest corner, edge middle or interior point of i lies inside j."""
    middles, inner = (vertices + vertices[next_vertices(offsets)]) / 2.0, interior_points(vertices, offsets)
    low, high = boxes(vertices, offsets)
    depth = np.zeros(len(i))
    owner, position = expand_ranges(np.diff(offsets)[i])
    index = offsets[i][owner] + position
    points = np.concatenate([vertices[index], middles[index], inner[i]])
    pair = np.concatenate([owner, owner, np.arange(len(i))])
    near = ((points >= low[j[pair]]) & (points <= high[j[pair]])).all(axis=1)
    np.maximum.at(depth, pair[near], _signed_distance(points[near], j[pair[near]], vertices, offsets))
    return depth


def _crossing_depth(vertices: np.ndarray, offsets: np.ndarray, i: np.ndarray, j: np.ndarray) -> np.ndarray:
    """For each pair, the deepest of the crossings of an edge of i with an edge of j."""
    following = next_vertices(offsets)
    ni, nj = np.diff(offsets)[i], np.diff(offsets)[j]
    pair, position = expand_ranges(ni * nj)
    a = offsets[i][pair] + position // nj[pair]
    b = offsets[j][pair] + position % nj[pair]
    a0, a1, b0, b1 = vertices[a], vertices[following[a]], vertices[b], vertices[following[b]]
    la, lb = np.hypot(*(a1 - a0).T), np.hypot(*(b1 - b0).T)
    sides = [_side(a0, a1, b0) / la, _side(a0, a1, b1) / la, _side(b0, b1, a0) / lb, _side(b0, b1, a1) / lb]
    crossing = (sides[0] * sides[1] < 0) & (sides[2] * sides[3] < 0)
    reach = np.where(crossing, np.min(np.abs(sides), axis=0), 0.0)
    depth = np.zeros(len(i))
    np.maximum.at(depth, pair, reach)
    return depth
