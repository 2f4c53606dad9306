"""Closed surfaces of triangles: the bodies that they enclose."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from blockvis.layout.notes import LEFT_OUT, Note
from blockvis.layout.outlines import ROUNDING, flattened, loops_of
from blockvis.layout.refusal import Refused, carrying
from blockvis.layout.solids import area_vectors, fans, sides_of
from blockvis.layout.surfaces import same_points, turned_faces
from blockvis.text import listed, place_text
from solver.mechanics import counted, linked

from .bodies import Bodies, Body, as_drawn
from .reading import Reading

#: Faces around an edge whose angles differ by less than this [rad] coincide.
SAME_ANGLE = 1e-4


#: Holes of up to so many edges, that are up to this part of the surface, are what a scanner has missed.
HOLE_EDGES, HOLE_AREA = 16, 0.02


class OpenSurface(Refused):
    """A surface that encloses nothing."""


def _with_points_merged(points: np.ndarray, faces: np.ndarray, size: float) -> tuple[np.ndarray, np.ndarray]:
    """Merge points that coincide, in the order of their coordinates, and drop the faces that have no area then."""
    same = same_points(points, ROUNDING * size)
    kept = np.unique(same)
    kept = kept[np.lexsort(points[kept].T[::-1])]
    number = np.empty(len(points), dtype=np.int64)
    number[kept] = np.arange(len(kept))
    faces = number[same][faces]
    return points[kept], faces[(faces != np.roll(faces, 1, axis=1)).all(axis=1)]


def closed_bodies(part: Body, size: float) -> list[Body]:
    """Split a mesh of triangles, of which the name is for messages, into the closed bodies that it holds.

    ``size`` is that of the drawing, in the unit of the points. ``OpenSurface`` is raised for a mesh that is not
    closed, ``ValueError`` for bodies that touch along an edge.
    """
    name = part.name
    points, every = _with_points_merged(part.points, part.faces, size)
    # Some files hold each face twice.
    faces = every[np.sort(np.unique(np.sort(every, axis=1), axis=0, return_index=True)[1])]
    if len(faces) == 0:
        raise OpenSurface(f"body '{name}' has no face with an area; export closed bodies")
    unique, inverse, counts = np.unique(sides_of(faces), axis=0, return_inverse=True, return_counts=True)
    if (counts != 2).any():
        piece = _touching_bodies(points, every)
        if piece is not None:
            return _pieces(part, points, every, piece)
        # One that is drawn twice, or turned inside out, is closed by its own points all the same.
        apart = _pieces(part, part.points, part.faces, _connected(part))
        if len(apart) > 1 and all(
            (np.unique(sides_of(of.faces), axis=0, return_counts=True)[1] == 2).all() for of in apart
        ):
            return [body for of in apart for body in closed_bodies(of, size)]
    holes = unique[counts == 1]
    closed = _with_holes_closed(points, faces, holes) if len(holes) and counts.max() == 2 else None
    if closed is not None:
        points, faces = closed
        unique, inverse, counts = np.unique(sides_of(faces), axis=0, return_inverse=True, return_counts=True)
    if (counts == 1).any():
        at = place_text(points[unique[counts == 1][0]].mean(axis=0), 6)
        raise OpenSurface(
            f"body '{name}' is not closed: "
            f"{counted(int((counts == 1).sum()), 'edge belongs', 'edges belong')} to one face only, "
            f"one around {at}; export closed bodies, or leave it out (ignore)"
        )
    if (counts > 2).any():
        at = place_text(points[unique[counts > 2][0]].mean(axis=0), 6)
        raise ValueError(
            f"body '{name}' holds bodies that touch and cannot be told apart: {int((counts > 2).sum())} "
            f"edges belong to more than two faces, one around {at}; "
            "export one file or one named object per block (.obj, .glb, .step), none of them twice or inside out"
        )
    # Pieces are connected by edges, not by points: blocks that touch at a corner remain two.
    edge = inverse.ravel().reshape(-1, 3)
    piece = linked((edge[:, [0, 0]].ravel(), edge[:, [1, 2]].ravel()), len(unique))[edge[:, 0]]
    return _pieces(part, points, _seen_from_outside(points, faces, edge, piece), piece, holes)


def _connected(part: Body) -> np.ndarray:
    """(m,) int array: the piece of each face, of those that share points of the file."""
    faces = part.faces
    of_points = linked((faces[:, [0, 0]].ravel(), faces[:, [1, 2]].ravel()), len(part.points))
    return np.unique(of_points[faces[:, 0]], return_inverse=True)[1].ravel()


def _with_holes_closed(
    points: np.ndarray, faces: np.ndarray, open_edges: np.ndarray
) -> tuple[np.ndarray, np.ndarray] | None:
    """Points and faces, with those that close its holes; None where a hole is large, or holes touch."""
    rings, crossing = loops_of(open_edges.tolist())
    if crossing is not None or max(map(len, rings)) > HOLE_EDGES:
        return None
    # Around a point in the middle: a diagonal may be an edge of the surface already.
    sides = [np.column_stack([np.roll(ring, 1), ring, np.full(len(ring), n)]) for n, ring in enumerate(rings)]
    patch = np.add(np.concatenate(sides), [0, 0, len(points)])
    points = np.vstack([points, [points[ring].mean(axis=0) for ring in rings]])
    areas = [float(np.linalg.norm(area_vectors(points, some), axis=1).sum()) for some in (patch, faces)]
    return (points, np.concatenate([faces, patch])) if areas[0] <= HOLE_AREA * areas[1] else None


def _pieces(
    part: Body, points: np.ndarray, faces: np.ndarray, piece: np.ndarray, holes: np.ndarray | None = None
) -> list[Body]:
    n = int(piece.max()) + 1
    bodies = []
    for k in range(n):
        own = faces[piece == k]
        n_hole_edges = 0 if holes is None else int(np.isin(holes, own).all(axis=1).sum())
        body = part if n == 1 else replace(part.piece(k + 1), piece_of=part.name)
        bodies.append(replace(body, points=points, faces=own, n_hole_edges=n_hole_edges))
    return bodies


def _seen_from_outside(points: np.ndarray, faces: np.ndarray, edge: np.ndarray, piece: np.ndarray) -> np.ndarray:
    """(m, 3) int array: the faces of closed pieces, all seen counter-clockwise from outside whatever the file has."""
    edges = np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2)
    turned = turned_faces(edges, edge.ravel(), np.repeat(np.arange(len(faces)), 3))
    faces = np.where(turned[:, None], faces[:, ::-1], faces)
    inside_out = np.bincount(piece, _volumes(points, faces)) < 0.0
    return np.where(inside_out[piece][:, None], faces[:, ::-1], faces)


def _touching_bodies(points: np.ndarray, faces: np.ndarray) -> np.ndarray | None:
    """(m,) int array: the body of each face, where bodies share edges or faces; None where they cannot be told apart.

    Faces are seen counter-clockwise from outside. Around an edge of several bodies, the face with the inside of its
    body behind it, counter-clockwise, goes with the next that has the inside before it.
    """
    if _volumes(points, faces).sum() < 0.0:
        faces = faces[:, ::-1]
    start, end = faces[:, [0, 1, 2]].ravel(), faces[:, [1, 2, 0]].ravel()
    apex, owner = points[faces[:, [2, 0, 1]].ravel()], np.repeat(np.arange(len(faces)), 3)
    forward = start < end
    low, high = np.minimum(start, end), np.maximum(start, end)
    along = points[high] - points[low]
    along = along / np.linalg.norm(along, axis=1)[:, None]
    _, edge = np.unique(low * np.int64(len(points)) + high, return_inverse=True)
    edge = edge.ravel()
    # Axes across each edge, the same for all its faces.
    helper = np.eye(3)[np.abs(along).argmin(axis=1)]
    first = np.cross(along, helper)
    first = first / np.linalg.norm(first, axis=1)[:, None]
    arms = apex - points[low]
    angle = np.arctan2((arms * np.cross(along, first)).sum(axis=1), (arms * first).sum(axis=1))
    # A face that runs along its edge from low to high has its inside before it, counter-clockwise.
    order = np.lexsort((angle, edge))
    partner = np.empty(len(edge), dtype=np.int64)
    for k in np.split(order, np.flatnonzero(np.diff(edge[order])) + 1):
        if len(k) % 2 or 2 * np.count_nonzero(forward[k]) != len(k):
            return None
        turn = angle[k] - angle[k][0]
        # Faces that coincide: the one that ends a body comes before that which begins one.
        steps = np.round(turn / SAME_ANGLE).astype(np.int64)
        k = k[np.lexsort((~forward[k], steps))]
        begins = ~forward[k]
        shift = int(np.flatnonzero(begins & ~np.roll(begins, 1))[0])
        k = np.roll(k, -shift)
        if not (~forward[k][::2]).all() or not forward[k][1::2].all():
            return None
        partner[k[::2]], partner[k[1::2]] = k[1::2], k[::2]
    piece = linked((owner, owner[partner]), len(faces))
    return piece if (np.bincount(piece, _volumes(points, faces)) > 0.0).all() else None


def _volumes(points: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """(m,) array: of the tetrahedra over faces, from the middle of all points."""
    a, b, c = (points - points.mean(axis=0))[faces].transpose(1, 0, 2)
    return np.asarray((a * np.cross(b, c)).sum(axis=1) / 6.0)


def enclosed(parts: Sequence[Body], size: float, reading: Reading | None = None) -> tuple[list[Body], list[Note]]:
    """Find the closed bodies of meshes; plane ones, and open ones that nobody wants, are left out, with notes.

    ``size`` is that of the drawing, in the unit of the points. Raises ``OpenSurface`` for a part that is wanted and
    neither closed nor plane, and where none is closed.
    """
    bodies: list[Body] = []
    plane, unwanted = [], []
    first: OpenSurface | None = None
    with carrying(lambda: as_drawn(Bodies(parts))):
        for part in parts:
            try:
                bodies += closed_bodies(part, size)
            except ValueError as error:
                if reading is not None and not reading.wants(part.labels):
                    unwanted.append(f"'{part.name}'")
                elif isinstance(error, OpenSurface) and _is_plane(part.points[np.unique(part.faces)], size):
                    plane.append(f"'{part.name}'" + " (a support)" * ("role" in part.said))
                else:
                    raise
                first = first or (error if isinstance(error, OpenSurface) else None)
        if not bodies and first is not None:
            raise first
    said = {
        "a single face without volume; draw a support that it stands for by [[supports]]": plane,
        "no closed body, as asked for": unwanted,
    }
    return bodies, [Note(LEFT_OUT, f"left out: {listed(names)}, {why}") for why, names in said.items() if names]


def _is_plane(points: np.ndarray, size: float) -> bool:
    """Whether points lie in a plane, within what is nothing in a drawing of this size."""
    spread = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    return bool(spread[-1] <= ROUNDING * size * np.sqrt(len(points)))


def bodies_of_surfaces(
    points: np.ndarray,
    rings: Sequence[np.ndarray],
    owner: np.ndarray,
    rows: Sequence[dict[str, Any]],
    reading: Reading | None = None,
) -> tuple[list[Body], list[Note]]:
    """Find the bodies that surface cells enclose, of each owner by itself; returned as by :func:`enclosed`.

    (n_points, 3) points, those around each cell, and the number of each cell's owner, of which each has a row.
    """
    parts = [
        Body(row["name"], points, fans([rings[k].tolist() for k in np.flatnonzero(owner == whose).tolist()]), row)
        for whose, row in enumerate(rows)
    ]
    try:
        return enclosed(parts, float(np.ptp(points, axis=0).max()), reading)
    except OpenSurface:
        # A drawing that is meant to be flat: the error says how far it is not.
        flattened(points)
        raise
