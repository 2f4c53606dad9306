"""The extrados under a fill: the pieces of edges and faces that look upwards and see the surface of the fill."""

from __future__ import annotations

import numpy as np
import shapely

import solver
from blockvis.layout.outlines import ring_of
from blockvis.layout.triangulation import triangles_of_ring

#: Pieces less than this across, in block sizes, are rounding of the drawing.
SLIVER = 1e-6

#: Faces whose normal rises by less than this stand upright.
UPRIGHT = 1e-9


def extrados(assembly: solver.Assembly, chosen: np.ndarray, surface: float) -> tuple[np.ndarray, np.ndarray]:
    """Find the pieces of chosen blocks that look upwards and see a level surface [m], and the block of each.

    They are (n, d, d) [m]: segments in the plane, triangles in space. What other blocks hide is left out; what stands
    above the surface hides nothing.
    """
    small = SLIVER * assembly.block_size
    pieces, block = (_segments if assembly.dimension == 2 else _triangles)(assembly, chosen, surface, small)
    d = assembly.dimension
    return np.array(pieces, dtype=float).reshape(-1, d, d), np.array(block, dtype=int)


def _segments(
    assembly: solver.Assembly, chosen: np.ndarray, surface: float, small: float
) -> tuple[list[np.ndarray], list[int]]:
    start, stop = assembly.vertices, assembly.vertices[assembly.next_vertex]
    owner = assembly.block_of_vertex
    edges = np.flatnonzero(chosen[owner] & (start[:, 0] - stop[:, 0] > small))
    outlines = np.array([shapely.Polygon(assembly.outline(k)) for k in range(assembly.n_blocks)])
    top = float(assembly.vertices[:, 1].max()) + assembly.block_size
    # What lies above each edge.
    columns = [[start[e], stop[e], (stop[e, 0], top), (start[e, 0], top)] for e in edges]
    above = shapely.polygons(np.array(columns, dtype=float).reshape(-1, 4, 2))
    tree = shapely.STRtree(outlines)
    edge, other = tree.query(above, predicate="intersects")
    low = shapely.bounds(outlines)[:, 1]
    hides = low[other] < surface
    edge, other = edge[hides], other[hides]
    covers = shapely.intersection(above[edge], outlines[other])
    pieces, block = [], []
    order = np.argsort(edge, kind="stable")
    ends = np.searchsorted(edge[order], np.arange(len(edges) + 1))
    for k, e in enumerate(edges.tolist()):
        hidden = []
        for cover in shapely.get_parts(covers[order[ends[k] : ends[k + 1]]]):
            left, _, right, _ = cover.bounds or (0.0, 0.0, 0.0, 0.0)
            if cover.area > small * max(right - left, small):
                hidden.append((left, right))
        at = float(stop[e, 0])
        seen = []
        for left, right in [*sorted(hidden), (float(start[e, 0]), np.inf)]:
            if left - at > small:
                seen.append((at, left))
            at = max(at, right)
        for left, right in seen:
            parts = (np.array([[right], [left]]) - start[e, 0]) / (stop[e, 0] - start[e, 0])
            pieces.append(start[e] + parts * (stop[e] - start[e]))
            block.append(int(owner[e]))
    return pieces, block


def _triangles(
    assembly: solver.Assembly, chosen: np.ndarray, surface: float, small: float
) -> tuple[list[np.ndarray], list[int]]:
    shapes, solids = assembly.polyhedra, assembly.polyhedra.parts.solids
    faces = shapes.faces(shapes.vertices)
    chosen_faces = np.flatnonzero(chosen[shapes.block_of_face] & (faces.normals[:, 2] > UPRIGHT))
    plans = [shapes.vertices[shapes.corners[slice(*shapes.face_offsets[f : f + 2])]] for f in chosen_faces]
    seen = np.array([shapely.Polygon(plan[:, :2]) for plan in plans])
    bodies = [solids.surface(k) for k in range(len(solids))]
    footprints = np.array([shapely.MultiPoint(points[:, :2]).convex_hull for points, _ in bodies])
    low = np.minimum.reduceat(solids.vertices[:, 2], solids.offsets[:-1])
    face, part = shapely.STRtree(footprints).query(seen, predicate="intersects")
    touching = shapely.area(shapely.intersection(seen[face], footprints[part])) > small * assembly.block_size
    pieces, block = [], []
    for k, f in enumerate(chosen_faces.tolist()):
        normal, middle = faces.normals[f], faces.middles[f]
        left = seen[k]
        for p in part[(face == k) & touching].tolist():
            if low[p] >= surface:
                continue
            cover = _above(bodies[p][0], bodies[p][1], normal, middle, small)
            if cover is not None:
                left = left.difference(cover)
        for polygon in shapely.get_parts(left):
            if polygon.area <= small * assembly.block_size:
                continue
            for triangle in _filling(polygon):
                rise = -((triangle - middle[:2]) @ normal[:2]) / normal[2]
                pieces.append(np.column_stack([triangle, middle[2] + rise]))
                block.append(int(shapes.block_of_face[f]))
    return pieces, block


def _above(
    points: np.ndarray, loops: list[list[int]], normal: np.ndarray, middle: np.ndarray, small: float
) -> shapely.Geometry | None:
    """Plan of the part of a convex body that lies above a plane; None where none does."""
    height = (points - middle) @ normal / normal[2]
    if height.max() <= small:
        return None
    edges = np.array([(a, b) for loop in loops for a, b in zip(loop, [*loop[1:], loop[0]], strict=True) if a < b])
    crossing = edges[(height[edges] > small).any(axis=1) & (height[edges] < -small).any(axis=1)]
    a, b = crossing.T
    share = height[a] / (height[a] - height[b])
    cut = points[a] + share[:, None] * (points[b] - points[a])
    return shapely.MultiPoint(np.vstack([points[height >= -small], cut])[:, :2]).convex_hull


def _filling(polygon: shapely.Polygon) -> list[np.ndarray]:
    """Counter-clockwise triangles that fill a polygon in plan, (3, 2) each."""
    if len(polygon.interiors):
        triangles = shapely.get_parts(shapely.constrained_delaunay_triangles(polygon))
        return [ring_of(one) for one in triangles]
    ring = ring_of(polygon)
    return [ring[corners] for corners in triangles_of_ring(ring)]
