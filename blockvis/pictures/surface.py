"""The surface of blocks in space as it is drawn: triangles, and the edges between faces."""

from __future__ import annotations

import numpy as np
import shapely

import solver
from blockvis.layout import solids
from solver import mechanics

#: Edges between faces that differ by less than this cosine are not drawn: they are chords of one curved face, up to
#: 16 degrees as of a drum of 24 sides, and would hide the joints.
SMOOTH = 0.961

#: Distance from a plane, in sizes of the structure, at which a point lies in it: blocks that touch are as far apart.
IN_PLANE = 1e-7


def triangles_of(shapes: mechanics.Polyhedra) -> tuple[np.ndarray, np.ndarray]:
    """Cut all faces into triangles: vertices (n, 3) int, counter-clockwise from outside, and the block of each (n,)."""
    first, counts = shapes.face_offsets[:-1], np.diff(shapes.face_offsets)
    reentrant = _reentrant(shapes)
    fans = np.flatnonzero(~reentrant)
    face = np.repeat(fans, counts[fans] - 2)
    position = np.arange(len(face)) - np.repeat(np.cumsum(counts[fans] - 2) - (counts[fans] - 2), counts[fans] - 2)
    which = np.stack([first[face], first[face] + position + 1, first[face] + position + 2], axis=1)
    triangles, blocks = [shapes.corners[which]], [shapes.block_of_face[face]]
    # A fan would cover what a re-entrant corner leaves out.
    for number in np.flatnonzero(reentrant).tolist():
        ring = shapes.corners[shapes.face_offsets[number] : shapes.face_offsets[number + 1]]
        # A face that folds back on itself, as drawings have, is cut, too.
        cut = solids.triangles_of(shapes.vertices, [ring.tolist()])
        triangles.append(cut)
        blocks.append(np.full(len(cut), shapes.block_of_face[number]))
    return np.concatenate(triangles), np.concatenate(blocks)


def _reentrant(shapes: mechanics.Polyhedra) -> np.ndarray:
    """(n_faces,) bool array: which faces have a corner that bends the other way."""
    points = shapes.vertices[shapes.corners]
    along = points[shapes.next_corner] - points
    before = points - points[shapes.previous_corner]
    normals = shapes.faces(shapes.vertices).normals[shapes.face_of_corner]
    bends = (np.cross(before, along) * normals).sum(axis=1)
    scale = np.linalg.norm(before, axis=1) * np.linalg.norm(along, axis=1)
    found = np.zeros(len(shapes.face_offsets) - 1, dtype=bool)
    found[shapes.face_of_corner[bends < -1e-9 * scale]] = True
    return found


def sharp_edges(shapes: mechanics.Polyhedra) -> np.ndarray:
    """(n, 2) int array: vertices at both ends of each edge but those within one plane or curved face."""
    normals = shapes.faces(shapes.vertices).normals[shapes.face_of_corner]
    ends = np.sort(np.stack([shapes.corners, shapes.corners[shapes.next_corner]], axis=1), axis=1).astype(np.int64)
    # Surfaces that are refused are drawn, too: their edges may be of one face, or of more than two.
    _, once, edge, counts = np.unique(
        ends @ [len(shapes.vertices), 1], return_index=True, return_inverse=True, return_counts=True
    )
    total = np.stack([np.bincount(edge.ravel(), normal) for normal in normals.T], axis=1)
    # Of two unit vectors, half the square of their sum is one more than their product.
    smooth = (counts == 2) & (0.5 * (total**2).sum(axis=1) - 1.0 >= SMOOTH)
    return np.asarray(ends[once[~smooth]])


def left_blocks(assembly: solver.Assembly, heights: np.ndarray) -> np.ndarray:
    """(n_blocks,) bool array: blocks with corners, at heights (n_vertices,) [m] over a plane, above it.

    What ends in the plane has a face there and nothing above.
    """
    inside = heights > IN_PLANE * float(np.ptp(assembly.vertices, axis=0).max())
    return np.bincount(assembly.block_of_vertex, inside, assembly.n_blocks) > 0


def section_of(
    corners: np.ndarray, triangles: np.ndarray, blocks: np.ndarray, point: np.ndarray, normal: np.ndarray
) -> tuple[list[np.ndarray], np.ndarray]:
    """Cut blocks, by their triangles as of :func:`triangles_of`, through a point (3,) [m] across a unit normal (3,).

    Gives the outlines (k, 3) [m] of what lies in the plane, several of a block that is bent, and the block of each.
    """
    across = np.eye(3)[int(np.abs(normal).argmin())]
    u = np.cross(normal, across)
    u /= np.linalg.norm(u)
    v = np.cross(normal, u)
    height = (corners - point) @ normal
    # A corner that lies in the plane belongs to its lower side: every triangle has none or two edges
    # across, and a block above, which is kept, is closed where its face lies in the plane.
    near = IN_PLANE * float(np.ptp(corners, axis=0).max())
    height = np.where(np.abs(height) <= near, -near, height)
    ends = np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=2)
    # Both triangles at an edge cut it from the same end: their points are the same to the last digit.
    ends = np.sort(ends, axis=2)
    crosses = (height[ends] > 0.0).sum(axis=2) == 1
    cut = crosses.any(axis=1)
    first, last = np.moveaxis(ends[cut][crosses[cut]].reshape(-1, 2, 2), 2, 0)
    share = (height[first] / (height[first] - height[last]))[..., None]
    places = corners[first] + share * (corners[last] - corners[first])
    flat = np.stack([(places - point) @ u, (places - point) @ v], axis=2)
    outlines, owners = [], []
    owner = blocks[cut]
    for block in np.unique(owner).tolist():
        lines = shapely.linestrings(flat[owner == block])
        for piece in shapely.get_parts(shapely.polygonize(lines)):
            ring = shapely.get_coordinates(shapely.get_exterior_ring(piece))[:-1]
            outlines.append(point + ring[:, :1] * u + ring[:, 1:] * v)
            owners.append(block)
    return outlines, np.array(owners, dtype=int)
