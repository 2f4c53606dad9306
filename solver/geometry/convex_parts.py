"""Convex parts of stones that are not convex: cut through their re-entrant edges, exactly."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from solver.tolerances import DRAWN_GAP

from .flat_faces import ONE_WAY, merged_faces
from .outlines import next_vertices
from .portions import alike
from .solids import Solids, dot

if TYPE_CHECKING:
    from scipy.spatial import ConvexHull

#: An edge is re-entrant where the outward normals of its faces turn against each other by more than this sine.
REENTRANT = 1e-4

#: Points nearer to a plane than this fraction of the diagonal of their block are on it.
ON_PLANE = 1e-9

#: Corners of parts farther than this fraction of that diagonal from all corners of their block are made by a cut.
ON_CORNER = 1e-7

#: Parts whose volumes do not add up to that of their block within this fraction of it are no parts of it.
VOLUME_LEFT = 0.01

#: Re-entrant edges and third corners through which cuts are tried: more cost time and find no better one.
EDGES_TRIED, CORNERS_TRIED = 6, 24

#: A stone with more parts than this was drawn by a scanner.
MOST_PARTS = 500


@dataclass(frozen=True)
class ConvexParts:
    """Convex parts of blocks, as drawn, and how their corners ride on those of the blocks.

    Attributes
    ----------
    solids : Solids
        The parts.
    block_of_part : (n_parts,) int array
        Ascending.
    source : (n_corners, 4) int array
        Four corners of the block from which each corner of the parts follows.
    weights : (n_corners, 4) array
        With these weights.
    inner : (n_faces,) bool array
        Faces of the parts inside their block, where it was cut.
    plane : (n_faces,) int array
        The plane of each face of a block: the same for faces into which one face was cut.
    made : (n_corners,) bool array
        Corners that the cuts have made: none of the block.
    """

    solids: Solids
    block_of_part: np.ndarray
    source: np.ndarray
    weights: np.ndarray
    inner: np.ndarray
    plane: np.ndarray
    made: np.ndarray

    @cached_property
    def cut_edges(self) -> np.ndarray:
        """(n_corners,) bool array: edges at a face inside the block, which are none of the block, or not as sharp."""
        face = self.solids.face_of_corner
        return self.inner[face] | self.inner[face[self.solids.twins]]

    @property
    def whole(self) -> bool:
        """Whether every block is convex: then the parts are the blocks."""
        return len(self.source) == 0

    def placed(self, vertices: np.ndarray) -> np.ndarray:
        """(n_corners, 3) array [m]: corners of the parts, with those of the blocks at ``vertices``."""
        if self.whole:
            return vertices
        first = vertices[self.source[:, 0]]
        others = (vertices[self.source[:, k]] - first for k in (1, 2, 3))
        return first + sum(self.weights[:, k + 1, None] * arm for k, arm in enumerate(others))


class NoParts(ValueError):
    """A block cannot be cut into convex parts: its number, and why."""

    def __init__(self, block: int, why: str) -> None:
        super().__init__(f"block {block} {why}")
        self.block, self.why = block, why


def convex_parts(solids: Solids) -> ConvexParts:
    """Cut solids that are not convex into convex parts.

    Raises
    ------
    NoParts
        For a surface that crosses itself, or has more parts than stones have.

    Notes
    -----
    A solid is convex where no corner is in front of any of its faces by more than a thousandth of its width. Others are
    cut through a re-entrant edge and the third corner that leave two pieces whose convex hulls hold the least volume,
    until each piece is convex.
    """
    bent = np.flatnonzero(_out_of_faces(solids) > DRAWN_GAP * solids.widths)
    if len(bent) == 0:
        none = np.zeros((0, 4))
        n_faces, n_corners = len(solids.block_of_face), len(solids.vertices)
        inner, made = np.zeros(n_faces, dtype=bool), np.zeros(n_corners, dtype=bool)
        return ConvexParts(solids, np.arange(len(solids)), none.astype(np.int64), none, inner, np.arange(n_faces), made)
    surfaces, sources, weights, block_of_part, inner_faces, made_corners = [], [], [], [], [], []
    is_bent = np.zeros(len(solids), dtype=bool)
    is_bent[bent] = True
    for block in range(len(solids)):
        own, loops = solids.surface(block)
        start = int(solids.offsets[block])
        frame = _spread_corners(own)
        parts = _parts_of(solids, block, own, loops) if is_bent[block] else [(own, loops, [False] * len(loops))]
        for corners, around, inside in parts:
            inner_faces += inside
            surfaces.append((corners, around))
            block_of_part.append(block)
            far = ON_CORNER * float(np.linalg.norm(np.ptp(own, axis=0)))
            made_corners.append(
                (np.abs(corners[:, None] - own).max(axis=2).min(axis=1) > far)
                if is_bent[block]
                else np.zeros(len(corners), dtype=bool)
            )
            if is_bent[block]:
                arms = np.linalg.solve((own[frame[1:]] - own[frame[0]]).T, (corners - own[frame[0]]).T).T
                sources.append(np.tile(start + frame, (len(corners), 1)))
                weights.append(np.column_stack([1.0 - arms.sum(axis=1), arms]))
            else:
                number = start + np.arange(len(corners))
                sources.append(np.tile(number[:, None], (1, 4)))
                weights.append(np.tile([1.0, 0.0, 0.0, 0.0], (len(corners), 1)))
    cut = Solids.of_surfaces(surfaces)
    return ConvexParts(
        cut,
        np.array(block_of_part),
        np.concatenate(sources),
        np.concatenate(weights),
        np.array(inner_faces),
        _planes(cut, np.array(block_of_part), is_bent, solids.widths),
        np.concatenate(made_corners),
    )


def _planes(parts: Solids, block_of_part: np.ndarray, is_bent: np.ndarray, widths: np.ndarray) -> np.ndarray:
    """(n_faces,) int array: the first face of the same block in the plane of each."""
    faces = parts.faces(parts.vertices)
    block = block_of_part[parts.block_of_face]
    plane = np.arange(len(block))
    for k in np.split(plane, np.flatnonzero(np.diff(block)) + 1):
        if is_bent[block[k[0]]]:
            same = faces.normals[k] @ faces.normals[k].T > ONE_WAY
            off = np.einsum("fi,gfi->gf", faces.normals[k], faces.middles[k][:, None] - faces.middles[k])
            plane[k] = k[(same & (np.abs(off) <= 2.0 * DRAWN_GAP * widths[block[k[0]]])).argmax(axis=1)]
    return plane


def _out_of_faces(solids: Solids) -> np.ndarray:
    """(n,) array [m]: how far a corner of each solid is in front of one of its own faces."""
    faces = solids.faces(solids.vertices)
    n_faces, n_vertices = np.diff(solids.faces_of_block), np.diff(solids.offsets)
    out = np.zeros(len(solids))
    for k in alike(n_faces, n_vertices):
        face = solids.faces_of_block[k][:, None] + np.arange(n_faces[k[0]])
        corner = solids.vertices[solids.offsets[k][:, None] + np.arange(n_vertices[k[0]])]
        distance = dot(faces.normals[face][:, :, None], corner[:, None] - faces.middles[face][:, :, None])
        out[k] = distance.max(axis=(1, 2))
    return out


def _spread_corners(vertices: np.ndarray) -> np.ndarray:
    """(4,) int array: four corners far from a common plane."""
    first = int(np.linalg.norm(vertices - vertices.mean(axis=0), axis=1).argmax())
    arms = vertices - vertices[first]
    second = int(np.linalg.norm(arms, axis=1).argmax())
    area = np.cross(arms, arms[second])
    third = int(np.linalg.norm(area, axis=1).argmax())
    fourth = int(np.abs(arms @ area[third]).argmax())
    return np.array([first, second, third, fourth])


@dataclass
class _Piece:
    """What is left of a surface on one side of the cuts so far, without the faces that the cuts have made.

    Attributes
    ----------
    polygons : list of (k, 3) arrays [m]
        Convex.
    normals : list of (3,) arrays
        Outward.
    edges : list of (2, 3) arrays [m]
        What is left of the re-entrant edges.
    """

    polygons: list[np.ndarray]
    normals: list[np.ndarray]
    edges: list[np.ndarray]

    @property
    def points(self) -> np.ndarray:
        """(n, 3) array [m]: all corners, several times each."""
        return np.concatenate(self.polygons)


def _parts_of(
    solids: Solids, block: int, vertices: np.ndarray, faces: list[list[int]]
) -> list[tuple[np.ndarray, list[list[int]], list[bool]]]:
    """Corners and faces of each part of a block, and which of the faces are inside the block."""
    origin = vertices[0]
    own = vertices - origin
    width, volume = float(solids.widths[block]), float(solids.volumes[block])
    near = ON_PLANE * float(np.linalg.norm(np.ptp(own, axis=0)))
    flatness = DRAWN_GAP * width
    queue, hulls = [_piece_of(own, faces)], []
    while queue:
        piece = queue.pop()
        cut = None if _is_convex(piece, flatness) else _best_cut(piece, near)
        if cut is None:
            hull = _hull(piece.points)
            if hull is not None and hull.volume > SMALLEST_PART * volume:
                hulls.append((hull, piece))
        else:
            for side in _cut(piece, *cut, near):
                queue += _separate(side, *cut, near)
        if len(queue) + len(hulls) > MOST_PARTS:
            raise NoParts(block, f"has more than {MOST_PARTS} convex parts; simplify its surface")
    total = sum(hull.volume for hull, _ in hulls)
    if abs(total - volume) > VOLUME_LEFT * volume:
        raise NoParts(
            block,
            f"of {volume:.6g} m³ falls into convex parts of {total:.6g} m³ in all; its surface crosses itself: "
            "redraw it, or draw it as several blocks",
        )
    parts = []
    for hull, piece in hulls:
        corners, loops = merged_faces(_surface_of_hull(hull), flatness)
        parts.append((corners + origin, loops, [_is_inner(corners[loop], piece, flatness) for loop in loops]))
    return parts


def _is_inner(face: np.ndarray, piece: _Piece, flatness: float) -> bool:
    """Whether nothing of the surface of the block lies in a face of a part."""
    arms = face - face[0]
    area = np.cross(arms[1:-1], arms[2:]).sum(axis=0)
    normal, middle = area / np.linalg.norm(area), face.mean(axis=0)
    return not any(
        outward @ normal > ONE_WAY and np.abs((polygon - middle) @ normal).max() <= 2.0 * flatness
        for polygon, outward in zip(piece.polygons, piece.normals, strict=True)
    )


#: A part with less than this fraction of the volume of its block is what rounding has left at a cut.
SMALLEST_PART = 1e-7


def _piece_of(vertices: np.ndarray, faces: list[list[int]]) -> _Piece:
    polygons, normals = [], []
    outward, owner = [], {}
    for k, face in enumerate(faces):
        points = vertices[face]
        arms = points - points[0]
        area = np.cross(arms[1:-1], arms[2:]).sum(axis=0)
        normal = area / np.linalg.norm(area)
        outward.append(normal)
        for a, b in zip(face, face[1:] + face[:1], strict=True):
            owner[a, b] = k
        for triangle in _convex_pieces(points, normal):
            polygons.append(triangle)
            normals.append(normal)
    edges = [
        vertices[[a, b]]
        for (a, b), k in owner.items()
        if a < b
        and np.cross(outward[k], outward[owner[b, a]]) @ (vertices[b] - vertices[a])
        < -REENTRANT * np.linalg.norm(vertices[b] - vertices[a])
    ]
    return _Piece(polygons, normals, edges)


def _convex_pieces(points: np.ndarray, normal: np.ndarray) -> Iterator[np.ndarray]:
    """Give the polygon itself where it is convex, else triangles: its ears are cut off one by one."""
    if (_turns(points, normal) >= 0.0).all():
        yield points
        return
    left = list(range(len(points)))
    while len(left) > 3:
        turn = _turns(points[left], normal)
        for k in np.argsort(-turn, kind="stable"):
            a, b, c = (points[left[(k + step) % len(left)]] for step in (-1, 0, 1))
            others = points[
                [
                    left[m]
                    for m in range(len(left))
                    if m not in (k - 1, k, (k + 1) % len(left)) and m - len(left) != k - 1
                ]
            ]
            inside = np.ones(len(others), dtype=bool)
            for p, q in ((a, b), (b, c), (c, a)):
                inside &= np.cross(q - p, others - p) @ normal >= 0.0
            if not inside.any():
                break
        yield np.stack([a, b, c])
        del left[int(k)]
    yield points[left]


def _turns(points: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """(n,) array: sine of the turn at each corner times the edges there, positive at convex corners."""
    before, after = points - np.roll(points, 1, axis=0), np.roll(points, -1, axis=0) - points
    return np.asarray(np.cross(before, after) @ normal)


def _is_convex(piece: _Piece, flatness: float) -> bool:
    points = piece.points
    return all(
        ((points - polygon[0]) @ normal).max() <= flatness
        for polygon, normal in zip(piece.polygons, piece.normals, strict=True)
    )


def _hull(points: np.ndarray) -> ConvexHull | None:
    """Convex hull; None of points in a plane."""
    # Loaded where it is used: blocks in the plane need none, and it takes a tenth of all imports.
    from scipy.spatial import ConvexHull, QhullError

    try:
        return ConvexHull(points)
    except (QhullError, ValueError):
        return None


def _best_cut(piece: _Piece, near: float) -> tuple[np.ndarray, np.ndarray] | None:
    """Find the plane (normal, point) that leaves two pieces with the smallest hulls; None without a re-entrant edge."""
    edges = sorted(piece.edges, key=lambda edge: -float(np.linalg.norm(edge[1] - edge[0])))[:EDGES_TRIED]
    points = piece.points
    points = points[np.unique(np.round(points / (1e3 * near)), axis=0, return_index=True)[1]]
    starts = np.concatenate(piece.polygons)
    ends = np.concatenate([np.roll(polygon, -1, axis=0) for polygon in piece.polygons])
    outward = np.array(piece.normals)
    counts = np.array([len(polygon) for polygon in piece.polygons])
    owner, first = np.repeat(np.arange(len(counts)), counts), np.cumsum(counts) - counts
    best, smallest = None, np.inf
    for edge in edges:
        along = (edge[1] - edge[0]) / np.linalg.norm(edge[1] - edge[0])
        arms = points - edge[0]
        arms = arms - (arms @ along)[:, None] * along
        far = np.linalg.norm(arms, axis=1)
        normals = np.cross(along, arms[far > 1e4 * near] / far[far > 1e4 * near, None])
        normals = normals * np.where(normals @ [1.0, 1e-3, 1e-6] < 0.0, -1.0, 1.0)[:, None]
        _, once = np.unique(np.round(normals, 6), axis=0, return_index=True)
        for normal in normals[np.sort(once)][:CORNERS_TRIED]:
            level, beyond = (starts - edge[0]) @ normal, (ends - edge[0]) @ normal
            through = (np.minimum(level, beyond) < -near) & (np.maximum(level, beyond) > near)
            part = (level[through] / (level[through] - beyond[through]))[:, None]
            on = starts[through] + part * (ends[through] - starts[through])
            hulls = []
            for sense in (1.0, -1.0):
                # Corners in the plane belong to the side on which their face is; a face in the plane bounds a side.
                reaches = np.maximum.reduceat(sense * level, first) > near
                lies = (np.maximum.reduceat(np.abs(level), first) <= near) & (sense * (outward @ normal) < 0.0)
                here = (sense * level >= -near) & (reaches | lies)[owner]
                hulls.append(_hull(np.concatenate([starts[here], on])))
            if hulls[0] is None or hulls[1] is None:
                continue
            size = hulls[0].volume + hulls[1].volume
            if size < smallest * (1.0 - 1e-9):
                best, smallest = (normal, edge[0]), size
    return best


def _cut(piece: _Piece, normal: np.ndarray, origin: np.ndarray, near: float) -> tuple[_Piece, _Piece]:
    """Cut a piece into what is behind a plane and what is in front of it."""
    sides = _Piece([], [], []), _Piece([], [], [])
    for polygon, outward in zip(piece.polygons, piece.normals, strict=True):
        level = (polygon - origin) @ normal
        level[np.abs(level) <= near] = 0.0
        if not level.any():
            # A face in the plane bounds what is behind it; a triangle without an area, across it, bounds nothing.
            if abs(outward @ normal) < 0.5:
                continue
            side = sides[0] if outward @ normal > 0.0 else sides[1]
            side.polygons.append(polygon)
            side.normals.append(outward)
            continue
        for side, sense in zip(sides, (-1.0, 1.0), strict=True):
            kept = _half(polygon, sense * level)
            if len(kept) > 2:
                side.polygons.append(kept)
                side.normals.append(outward)
    for edge in piece.edges:
        level = (edge - origin) @ normal
        level[np.abs(level) <= near] = 0.0
        for side, sense in zip(sides, (-1.0, 1.0), strict=True):
            a, b = sense * level
            if max(a, b) <= 0.0:
                continue
            ends = edge.copy()
            if min(a, b) < 0.0:
                ends[0 if a < 0.0 else 1] = edge[0] + a / (a - b) * (edge[1] - edge[0])
            side.edges.append(ends)
    return sides


def _half(polygon: np.ndarray, level: np.ndarray) -> np.ndarray:
    """Cut off of a convex polygon what has a negative level; nothing is left of one that only touches the plane."""
    if level.max() <= 0.0:
        return polygon[:0]
    corners = []
    for k in range(len(polygon)):
        before = k - 1
        if level[before] * level[k] < 0.0:
            part = level[before] / (level[before] - level[k])
            corners.append(polygon[before] + part * (polygon[k] - polygon[before]))
        if level[k] >= 0.0:
            corners.append(polygon[k])
    return np.array(corners)


def _separate(piece: _Piece, normal: np.ndarray, origin: np.ndarray, near: float) -> list[_Piece]:
    """Tell apart the bodies in which a cut may have left a piece.

    Polygons with an edge in common belong together; where a hole runs through the cut, all do.
    """
    if not piece.polygons:
        return []
    points = piece.points
    _, which = np.unique(np.round(points / (1e3 * near)).astype(np.int64), axis=0, return_inverse=True)
    which = which.ravel()
    owner = np.repeat(np.arange(len(piece.polygons)), [len(polygon) for polygon in piece.polygons])
    following = which[_following(owner)]
    keys = np.minimum(which, following) * np.int64(len(points)) + np.maximum(which, following)
    # Two bodies that the cut has left may still meet along the edge through which it went.
    on_plane = np.abs((points - origin) @ normal) <= near
    in_cut = on_plane & on_plane[_following(owner)]
    order = np.flatnonzero(~in_cut)[np.argsort(keys[~in_cut], kind="stable")]
    same = np.flatnonzero(np.diff(keys[order]) == 0)
    first, second = owner[order[same]].tolist(), owner[order[same + 1]].tolist()
    # A face in the plane belongs to the body that it bounds: that whose other faces turn away from it.
    flat = np.logical_and.reduceat(on_plane, np.searchsorted(owner, np.arange(len(piece.polygons))))
    for face in np.flatnonzero(flat).tolist():
        middle = piece.polygons[face].mean(axis=0)
        for k in np.flatnonzero(np.isin(keys, keys[owner == face]) & (owner != face)).tolist():
            if (middle - points[k]) @ piece.normals[owner[k]] <= near:
                first.append(face)
                second.append(int(owner[k]))
    links = (np.ones(len(first)), (first, second))
    n = len(piece.polygons)
    count, body = connected_components(coo_array(links, shape=(n, n)), directed=False)
    if count == 1:
        return [piece]
    bodies = []
    for number in range(count):
        polygons = [piece.polygons[k] for k in np.flatnonzero(body == number)]
        normals = [piece.normals[k] for k in np.flatnonzero(body == number)]
        own = np.concatenate(polygons)
        edges = [
            edge
            for edge in piece.edges
            if np.abs(own - edge.mean(axis=0)).max() > 0.0 and _touches(polygons, edge, near)
        ]
        bodies.append(_Piece(polygons, normals, edges))
    return [piece] if any(_is_hole(one, normal, origin, near) for one in bodies) else bodies


def _following(owner: np.ndarray) -> np.ndarray:
    """(n,) int array: the corner that follows each around its polygon, of which ``owner`` gives the number."""
    return next_vertices(np.append(np.searchsorted(owner, np.unique(owner)), len(owner)))


def _touches(polygons: list[np.ndarray], edge: np.ndarray, near: float) -> bool:
    """Whether an edge is one of those of some polygons."""
    middle, along = edge.mean(axis=0), (edge[1] - edge[0]) / np.linalg.norm(edge[1] - edge[0])
    for polygon in polygons:
        arms = middle - polygon
        across = arms - (arms @ along)[:, None] * along
        on_line = np.linalg.norm(across, axis=1) <= 1e4 * near
        place = arms[on_line] @ along
        if on_line.sum() > 1 and place.min() < 0.0 < place.max():
            return True
    return False


def _is_hole(piece: _Piece, normal: np.ndarray, origin: np.ndarray, near: float) -> bool:
    """Whether a body is the wall of a hole: its outline in the plane of the cut runs the other way round."""
    in_front = ((piece.points - origin) @ normal).max() > near
    area = 0.0
    for polygon in piece.polygons:
        ends = np.roll(polygon, -1, axis=0)
        on = (np.abs((polygon - origin) @ normal) <= near) & (np.abs((ends - origin) @ normal) <= near)
        if on.all():
            continue
        area += float(np.sum(np.cross(polygon[on] - origin, ends[on] - origin) @ normal))
    return area * (1.0 if in_front else -1.0) < 0.0


def _surface_of_hull(hull: ConvexHull) -> tuple[np.ndarray, list[list[int]]]:
    faces = []
    for corners, plane in zip(hull.simplices, hull.equations, strict=True):
        a, b, c = hull.points[corners]
        faces.append((corners if np.cross(b - a, c - a) @ plane[:3] > 0.0 else corners[::-1]).tolist())
    return hull.points, faces
