"""Convex parts of stones that are not convex: cut through their re-entrant edges, exactly."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from itertools import count

import numpy as np
from scipy.linalg import qr

from solver.tolerances import CORNER_TOLERANCE, DRAWN_GAP
from solver.words import Kept, kept

from .contacts import frames_of
from .flat_faces import ONE_WAY, merged_faces
from .portions import alike, linked
from .solids import ROUNDING, Faces, Solids, cross, dot, taken, unit

#: An edge is re-entrant where the outward normals of its faces turn against each other by more than this sine.
REENTRANT = 1e-4

#: Points nearer to a plane than this fraction of the diagonal of their block are on it.
ON_PLANE = 1e-6

#: Points nearer than this fraction of that diagonal to an edge or a face of their block are on it.
ON_CORNER = 5e-6

#: Parts whose volumes do not add up to that of their block within this fraction of it are no parts of it.
VOLUME_LEFT = 0.01

#: Re-entrant edges and third corners through which cuts are tried: more cost time and find no better one.
EDGES_TRIED, CORNERS_TRIED = 6, 24

#: A plane with corners in it cuts this far beside them, less than manifold3d tells apart and more than its rounding.
BESIDE_PLANE = 1e-13

#: How much an edge that a cut runs through, and makes a corner of, outweighs of the edges along which it runs.
THROUGH_EDGE = 1e-3

#: A part with less than this fraction of the cube over the diagonal of its block is what rounding has left at a cut.
SMALLEST_PART = 1e-10

#: Kinds of a piece of an edge of a face of a part: there the face is inside the block, ends at its edge, or goes on.
INSIDE, ENDS, GOES_ON = 0.0, 1.0, 2.0

#: Whether a face goes on beyond an edge is asked this part of the way from there to its middle.
A_LITTLE = 1e-3

#: Blocks whose parts are kept: an assembly is made anew with each change of roles, imperfections or joints.
MOST_KEPT = 2000

#: A stone with more parts than this was drawn by a scanner.
MOST_PARTS = 500


@dataclass(frozen=True)
class ConvexParts(Kept):
    """Convex parts of blocks, as drawn, and how their corners ride on those of the blocks."""

    solids: Solids  #: the parts
    block_of_part: np.ndarray  #: (n_parts,) int, ascending
    widths: np.ndarray  #: (n_blocks,) [m]
    source: np.ndarray  #: (n_corners, 4) int: four corners of the block from which each corner of the parts follows
    weights: np.ndarray  #: (n_corners, 3): with these parts of the ways from the first to the others
    inner: np.ndarray  #: (n_faces,) bool: faces of the parts inside their block, where it was cut
    plane: np.ndarray  #: (n_faces,) int: the same for faces into which one face of a block was cut
    pieces: np.ndarray  #: (n_corners, n_pieces, 3): of each edge from corner to corner of the block: first, last, kind

    @kept
    def goes_on(self) -> np.ndarray:
        """(n_corners,) bool array: corners of faces beyond which the face of the block goes on."""
        kind = self.pieces[..., 2] == GOES_ON
        return kind[:, 0] | kind[self.solids.previous_corner, -1]

    @property
    def whole(self) -> bool:
        """Whether every block is convex: then the parts are the blocks."""
        return len(self.source) == 0

    def placed(self, vertices: np.ndarray) -> PlacedParts:
        """Put the parts where the corners of their blocks now are, (n_vertices, 3) [m]."""
        if self.whole:
            return PlacedParts(self, vertices)
        first, *others = (vertices[corner] for corner in self.source.T)
        ways = (weight[:, None] * (other - first) for weight, other in zip(self.weights.T, others, strict=True))
        return PlacedParts(self, first + sum(ways))


@dataclass(frozen=True)
class PlacedParts:
    """Convex parts of blocks where their corners, (n_corners, 3) [m], now are."""

    parts: ConvexParts
    vertices: np.ndarray

    @property
    def solids(self) -> Solids:
        """The parts as drawn."""
        return self.parts.solids

    @kept
    def faces(self) -> Faces:
        """Planes of their faces."""
        return self.solids.faces(self.vertices)

    def starts(self, edges: np.ndarray) -> np.ndarray:
        """(..., 3) array [m]: corners at which edges start."""
        return taken(self.vertices, self.solids.corners[edges])

    def along(self, edges: np.ndarray) -> np.ndarray:
        """(..., 3) array [m]: from the starts of edges to their ends."""
        return self.starts(self.solids.next_corner[edges]) - self.starts(edges)

    def before_faces(self, face: np.ndarray, corner: np.ndarray) -> np.ndarray:
        """(n, n_faces) array [m]: how far corners, (n, n_corners) int, are at least before faces, (n, n_faces) int."""
        # From a corner near by, for the digits of coordinates far from the origin.
        origin = self.vertices[self.solids.offsets[self.solids.block_of_face[face[:, :1]]]]
        normals, corners = taken(self.faces.normals, face), taken(self.vertices, corner) - origin
        heights = dot(normals[:, :, None], corners[:, None]).min(axis=2)
        return heights - dot(normals, taken(self.faces.middles, face) - origin)

    def kinds_at(self, edges: np.ndarray, points: np.ndarray) -> np.ndarray:
        """(n,) array: kinds of edges where points (n, 3) [m] are along them, the larger at the end of two pieces."""
        along = self.along(edges)
        place = dot(points - self.starts(edges), along) / dot(along, along)
        place = np.clip(place, 2.0 * CORNER_TOLERANCE, 1.0 - 2.0 * CORNER_TOLERANCE)[:, None]
        first, last, kind = np.moveaxis(self.parts.pieces.take(edges, axis=0), -1, 0)
        here = (first - CORNER_TOLERANCE <= place) & (place <= last + CORNER_TOLERANCE)
        return np.where(here, kind, INSIDE).max(axis=1)

    def outward(self, edges: np.ndarray) -> np.ndarray:
        """(..., 3) array: sum of the outward normals of the two faces at each edge."""
        face = self.solids.face_of_corner
        return taken(self.faces.normals, face[edges]) + taken(self.faces.normals, face[self.solids.twins[edges]])


class NoParts(ValueError):
    """A block cannot be cut into convex parts: its number, and why."""


def convex_parts(solids: Solids) -> ConvexParts:
    """Cut solids that are not convex into convex parts; raises :class:`NoParts`.

    A solid is convex where no corner is in front of any of its faces by more than a thousandth of its width. Others are
    cut through a re-entrant edge and the third corner that leave two pieces whose convex hulls hold the least volume,
    until each piece is convex.
    """
    bent = _out_of_faces(solids) > DRAWN_GAP * solids.widths
    if not bent.any():
        none, n_faces, ends = np.zeros((0, 4), dtype=np.int64), len(solids.block_of_face), np.array([0.0, 1.0, ENDS])
        of_faces = np.zeros(n_faces, dtype=bool), np.arange(n_faces), np.tile(ends, (len(solids.corners), 1, 1))
        return ConvexParts(solids, np.arange(len(solids)), solids.widths, none, np.zeros((0, 3)), *of_faces)
    found, drawn_faces = [], []
    pieces: list[np.ndarray] = []
    for block in range(len(solids)):
        own, loops = solids.surface(block)
        # Four corners far from a common plane.
        first = int(np.linalg.norm(own - own.mean(axis=0), axis=1).argmax())
        frame = np.append(first, qr((own - own[first]).T, mode="r", pivoting=True)[1][:3])
        parts = [(own, loops, [(k, np.tile([0.0, 1.0, ENDS], (len(loop), 1, 1))) for k, loop in enumerate(loops)])]
        if bent[block]:
            try:
                parts = _parts_of(own.tobytes(), tuple(map(tuple, loops)))
            except ValueError as error:
                raise NoParts(block, str(error)) from None
        for corners, around, faces in parts:
            drawn_faces += [(block, number) for number, _ in faces]
            pieces += [of_edges for _, of_edges in faces]
            arms = np.linalg.solve((own[frame[1:]] - own[frame[0]]).T, (corners - own[frame[0]]).T).T
            source = np.tile(int(solids.offsets[block]) + frame, (len(corners), 1))
            found.append((block, (corners, around), source, arms))
    block_of_part, surfaces, sources, weights = zip(*found, strict=True)
    drawn_face, n = np.array(drawn_faces), max(k.shape[1] for k in pieces)
    return ConvexParts(
        Solids.of_surfaces(surfaces),
        np.array(block_of_part),
        solids.widths,
        np.concatenate(sources),
        np.concatenate(weights),
        drawn_face[:, 1] < 0,
        np.unique(drawn_face, axis=0, return_inverse=True)[1].ravel(),
        np.concatenate([k.take(np.minimum(np.arange(n), k.shape[1] - 1), axis=1) for k in pieces]),
    )


def _out_of_faces(solids: Solids) -> np.ndarray:
    """(n,) array [m]: how far a corner of each solid is in front of one of its own faces."""
    faces = solids.faces(solids.vertices)
    every, out = np.arange(len(solids)), np.zeros(len(solids))
    for k, face, vertex in alike((solids.faces_of_block, every), (solids.offsets, every), filled=True):
        corner = solids.vertices[vertex]
        distance = dot(faces.normals[face][:, :, None], corner[:, None] - faces.middles[face][:, :, None])
        out[k] = distance.max(axis=(1, 2))
    return out


@dataclass(frozen=True)
class _Piece:
    """What is left of a block on one side of the cuts so far: the triangles around it, in diagonals of the block."""

    points: np.ndarray  #: (n, 3)
    triangles: np.ndarray  #: (m, 3) int
    face: np.ndarray  #: (m,) int: the face of the block in which each lies; numbers beyond those of faces are of cuts

    @kept
    def normals(self) -> np.ndarray:
        """(m, 3) array: unit normals; zero of triangles without an area, whose direction is rounding."""
        corners = self.points[self.triangles]
        arms = np.roll(corners, -1, axis=1) - corners
        area = cross(arms[:, 0], arms[:, 1])
        length, longest = np.sqrt(dot(area, area)), np.sqrt(dot(arms, arms)).max(axis=1)
        return np.where((length > ON_PLANE * longest)[:, None], unit(area), 0.0)

    @kept
    def corners(self) -> np.ndarray:
        """(k, 3) array: points of triangles with an area."""
        return self.points[np.unique(self.triangles[self.normals.any(axis=1)])]

    @kept
    def edges(self) -> np.ndarray:
        """(3 m, 2) int array: first and last point of the edges around all triangles."""
        return self.triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)

    @kept
    def twins(self) -> np.ndarray:
        """(3 m,) int array: each edge as the triangle beyond it has it."""
        number = np.array([len(self.points), 1])
        order = np.argsort(self.edges @ number)
        return order[np.searchsorted(self.edges @ number, self.edges[:, ::-1] @ number, sorter=order)]

    def separated(self, normal: np.ndarray, origin: np.ndarray) -> list[_Piece]:
        """Cut along a plane, and tell apart the bodies in which that leaves the piece."""
        # Loaded where it is used: most blocks are convex.
        from manifold3d import Manifold, Mesh64

        # Corners in the plane are so to the last digit; cuts run beside it, or faces there would stay with both sides.
        frame = frames_of(normal[None])[0]
        level = (self.points - origin) @ frame.T
        level[np.abs(level[:, 0]) <= ON_PLANE, 0] = 0.0
        numbers, found, cut = np.arange(len(self.triangles), dtype=np.uint64), [], int(self.face.max()) + 1
        body = Manifold(Mesh64(level, self.triangles.astype(np.uint64), face_id=numbers))
        sides = (body.trim_by_plane((sense, 0.0, 0.0), BESIDE_PLANE) for sense in (1.0, -1.0))
        for part in (part for side in sides for part in side.decompose()):
            if part.volume() > SMALLEST_PART:
                mesh = part.to_mesh64()
                # The triangles of the body come first, then those of the plane.
                face, n = np.full(len(mesh.tri_verts), cut), mesh.run_index[1] // 3
                face[:n] = self.face[mesh.face_id[:n]]
                points, triangles = mesh.vert_properties @ frame + origin, mesh.tri_verts.astype(np.int64)
                found.append(_Piece(points, triangles, face))
        return found


@lru_cache(maxsize=MOST_KEPT)
def _parts_of(
    points: bytes, faces: tuple[tuple[int, ...], ...]
) -> list[tuple[np.ndarray, list[list[int]], list[tuple[int, np.ndarray]]]]:
    """Corners and faces of each part of a block; for each its face there, below 0 inside, and pieces of the edges."""
    vertices, loops = np.frombuffer(points).reshape(-1, 3), [list(face) for face in faces]
    origin, size = vertices[0], float(np.linalg.norm(np.ptp(vertices, axis=0)))
    drawn = Solids.of_surfaces([((vertices - origin) / size, loops)])
    planes, flatness = drawn.faces(drawn.vertices), DRAWN_GAP * float(drawn.widths[0])
    whole = _whole(drawn.vertices, loops, planes.normals)
    edges = whole.points[_bent_edges(whole, planes.normals, 1.0)]
    queue, parts, total, number, inside = [whole], [], 0.0, _flat_faces(whole), count(1)
    while queue:
        piece = queue.pop()
        cut = _best_cut(piece, planes, flatness)
        if cut is not None:
            queue += piece.separated(*cut)
        else:
            # Corners of the block as they were drawn, and of several at one place the first.
            known = np.vstack([drawn.vertices, piece.corners])
            same = np.abs(piece.corners[:, None] - known).max(axis=2) <= 2.0 * ON_PLANE
            corners, rings, volume = _hull(known[same.argmax(axis=1)], flatness)
            total += volume
            drawn_in = [_drawn_face(corners[ring], whole, number, edges, flatness) for ring in rings]
            drawn_in = [(k if k >= 0 else -next(inside), pieces) for k, pieces in drawn_in]
            parts.append((corners * size + origin, rings, drawn_in))
        if len(queue) + len(parts) > MOST_PARTS:
            raise ValueError(f"has more than {MOST_PARTS} convex parts; simplify its surface")
    volume = drawn.volumes[0]
    if abs(total - volume) > VOLUME_LEFT * volume:
        raise ValueError(_why(whole, total, volume, size, origin))
    return parts


def _whole(points: np.ndarray, faces: list[list[int]], normals: np.ndarray) -> _Piece:
    """Cut the faces of a block into triangles."""
    from manifold3d import triangulate

    triangles, face = [], []
    for k, (loop, frame) in enumerate(zip(faces, frames_of(normals), strict=True)):
        flat = points[loop] @ frame[1:].T
        # The fast way through convex outlines leaves triangles without an area, which manifold3d clears with corners.
        triangles.append(np.array(loop)[triangulate([flat], allow_convex=False)])
        face.append(np.full(len(triangles[-1]), k))
    return _Piece(points, np.concatenate(triangles), np.concatenate(face))


def _why(whole: _Piece, total: float, volume: float, size: float, origin: np.ndarray) -> str:
    """Say why the parts of a block do not fill it."""
    crossing = _crossing(whole)
    if crossing is not None:
        place = "({:.6g}, {:.6g}, {:.6g})".format(*(crossing * size + origin))
        return (
            f"cannot be cut into convex parts: its surface crosses itself near {place}; "
            "redraw it, or draw it as several blocks"
        )
    n_holes = 1 - (len(whole.points) - len(whole.triangles) // 2) // 2
    holes = f"; {n_holes} holes run through it" if n_holes else ""
    return (
        f"could not be cut into convex parts (parts hold {total * size**3:.6g} of {volume * size**3:.6g} m³)"
        f"{holes}: draw it as several blocks"
    )


def _crossing(piece: _Piece) -> np.ndarray | None:
    """(3,) array: where an edge of a surface passes through one of its triangles; None where none does."""
    corners = piece.points[piece.triangles]
    edges = np.unique(np.sort(piece.edges, axis=1), axis=0)
    start, end = piece.points[edges[:, 0]], piece.points[edges[:, 1]]
    for (a, b, c), normal, own in zip(corners, piece.normals, piece.triangles, strict=True):
        before, after = (start - a) @ normal, (end - a) @ normal
        k = np.flatnonzero((before * after < 0.0) & (np.minimum(np.abs(before), np.abs(after)) > ON_CORNER))
        k = k[~np.isin(edges[k], own).any(axis=1)]
        at = start[k] + (before[k] / (before[k] - after[k]))[:, None] * (end[k] - start[k])
        around = ((a, b), (b, c), (c, a))
        inside = np.all([cross((q - p)[None], at - p) @ normal > -ON_CORNER for p, q in around], axis=0)
        if inside.any():
            return np.asarray(at[inside][0])
    return None


def _flat_faces(whole: _Piece) -> np.ndarray:
    """(m,) int array: one number for triangles of a block that are joined and in a plane, as halves around a hole."""
    n, beyond = len(whole.triangles), whole.twins // 3
    own = np.repeat(np.arange(n), 3)
    flat = dot(whole.normals[own], whole.normals[beyond]) >= 1.0 - REENTRANT**2 / 2.0
    k = np.flatnonzero(flat | (whole.face[own] == whole.face[beyond]))
    return linked(np.stack([own[k], beyond[k]]), n)


def _drawn_face(
    face: np.ndarray, whole: _Piece, number: np.ndarray, edges: np.ndarray, flatness: float
) -> tuple[int, np.ndarray]:
    """Find the number, of those of all triangles of a block, of what lies in a face of a part; -1 inside the block.

    And the pieces of its edges, (n_corners, n_pieces, 3); the convex edges of the block are (n, 2, 3).
    """
    arms = face - face[0]
    normal = unit(cross(arms[1:-1], arms[2:]).sum(axis=0))
    middle, triangles = face.mean(axis=0), whole.points[whole.triangles]
    same = (np.abs((triangles - middle) @ normal) <= 2.0 * flatness).all(axis=1)
    same &= whole.normals @ normal > ONE_WAY
    own = triangles[same]
    # They lie apart where an edge of one of them has the other on its outer side.
    apart = np.zeros(len(own), dtype=bool)
    for ring, other in ((np.broadcast_to(face, (len(own), *face.shape)), own), (own, face[None])):
        outward = unit(cross(np.roll(ring, -1, axis=1) - ring, normal))
        inside = dot(ring[:, :, None] - other[:, None], outward[:, :, None]).max(axis=2)
        apart |= (inside <= ON_PLANE).any(axis=1)
    # Pieces of edges go from corner to corner of the block.
    start, along = face[:, None], (np.roll(face, -1, axis=0) - face)[:, None]
    arms = whole.points - start
    place = dot(arms, along) / dot(along, along)
    between = np.abs(arms - place[..., None] * along).max(axis=2) <= ON_CORNER
    between &= np.abs(place - 0.5) < 0.5 - CORNER_TOLERANCE
    ends = np.sort(np.where(between, place, 1.0), axis=1)[:, : between.sum(axis=1).max()]
    ones = np.ones((len(face), 1))
    first, last = np.hstack([0.0 * ones, ends]), np.hstack([ends, ones])
    halfway = start + (first + last)[..., None] / 2.0 * along
    beside = halfway + A_LITTLE * (middle - halfway)
    drawn = (dot(beside[:, :, None, None] - own, outward).max(axis=3) <= ON_PLANE).any(axis=2)
    arms, along = halfway[:, :, None] - edges[:, 0], edges[:, 1] - edges[:, 0]
    nearest = np.clip(dot(arms, along) / dot(along, along), 0.0, 1.0)[..., None] * along
    on_edge = (np.abs(arms - nearest).max(axis=3) <= ON_CORNER).any(axis=2)
    kind = np.where(drawn, np.where(on_edge, ENDS, GOES_ON), INSIDE)
    return int(number[same][~apart][0]) if not apart.all() else -1, np.dstack([first, last, kind])


def _hull(points: np.ndarray, flatness: float) -> tuple[np.ndarray, list[list[int]], float]:
    """Corners, faces and volume of the convex hull of points."""
    # Loaded where they are used: blocks in the plane need neither, and they take a tenth of all imports.
    from manifold3d import Manifold
    from scipy.spatial import ConvexHull, QhullError

    try:
        hull = ConvexHull(np.unique(points, axis=0))
        a, b, c = np.moveaxis(hull.points[hull.simplices], 1, 0)
        outward = dot(cross(b - a, c - a), hull.equations[:, :3]) > 0.0
        triangles = np.where(outward[:, None], hull.simplices, hull.simplices[:, ::-1])
        return *merged_faces((hull.points, triangles.tolist()), flatness), float(hull.volume)
    except (QhullError, KeyError):
        # Of parts about as thin as rounding; its hull is closed whatever the points.
        body = Manifold.hull_points(points)
        mesh = body.to_mesh64()
        triangles = mesh.tri_verts.astype(np.int64)
        return *merged_faces((mesh.vert_properties, triangles.tolist()), flatness), body.volume()


def _best_cut(piece: _Piece, planes: Faces, flatness: float) -> tuple[np.ndarray, np.ndarray] | None:
    """Find the plane (normal, point) that leaves two pieces with the smallest hulls; None of a convex piece."""
    from manifold3d import Manifold

    points, faces = piece.corners, np.unique(piece.face[piece.normals.any(axis=1)])
    faces = faces[faces < len(planes.normals)]
    normals, middles = planes.normals[faces], planes.middles[faces]
    if (points @ normals.T - dot(normals, middles)).max(initial=0.0) <= flatness:
        return None
    bent = _bent_edges(piece, planes.normals, -1.0)
    edges = piece.points[bent[:EDGES_TRIED]]
    tried = [(edge[0], normal) for edge in edges for normal in _normals_through(edge, points)]
    if not tried:
        return None
    origins, normals = np.array(tried).swapaxes(0, 1)
    # Of all planes at once; which edges of triangles run through them, seen from one side of each.
    heights, (start, end) = dot(piece.points - origins[:, None], normals[:, None]), piece.edges.T
    at_start, at_end = heights[:, start], heights[:, end]
    through = (np.minimum(at_start, at_end) < -ON_PLANE) & (np.maximum(at_start, at_end) > ON_PLANE)
    preference = _preference(piece, bent, heights, through)
    through &= start < end
    part = (at_start / np.where(through, at_start - at_end, 1.0))[..., None]
    crossings = piece.points[start] + part * (piece.points[end] - piece.points[start])
    sides = [_on_side(piece, sense * heights, sense * normals) for sense in (1.0, -1.0)]
    best, smallest, most = None, np.inf, 0.0
    for k, normal in enumerate(normals):
        corners = (np.concatenate([piece.points[here[k]], crossings[k, through[k]]]) for here in sides)
        hulls = [Manifold.hull_points(side).volume() for side in corners]
        size = sum(hulls) if min(hulls) > SMALLEST_PART else np.inf
        equal = abs(size - smallest) <= ROUNDING * smallest
        if size < np.inf and (preference[k] > most + ON_PLANE if equal else size < smallest):
            best, smallest, most = (normal, origins[k]), size, preference[k]
    return best


def _on_side(piece: _Piece, heights: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """(n_planes, n_points) bool array: corners, at heights like these, of what a piece has above planes."""
    level = heights[:, piece.triangles]
    # Corners in the plane belong to the side on which their face is; a face in the plane bounds a side.
    lies = (np.abs(level).max(axis=2) <= ON_PLANE) & (normals @ piece.normals.T < -0.5)
    faces = lies | (level.max(axis=2) > ON_PLANE)
    corner = piece.triangles.ravel()[:, None] == np.arange(len(piece.points))
    return np.asarray(((level >= -ON_PLANE) & faces[..., None]).reshape(len(level), -1) @ corner)


def _preference(piece: _Piece, bent: np.ndarray, heights: np.ndarray, through: np.ndarray) -> np.ndarray:
    """(n_planes,) array: of cuts that are as good, the one along more re-entrant edges and faces, and through fewer.

    The heights of its points are (n_planes, n_points); ``through``, (n_planes, 3 m), is of the edges of its triangles.
    """
    (start, end), third, twins = piece.edges.T, np.roll(piece.triangles, 1, axis=1).ravel(), piece.twins
    off, length = heights[:, bent], np.linalg.norm(np.diff(piece.points[bent], axis=1)[:, 0], axis=1)
    in_plane, beside = np.abs(off).max(axis=2) <= ON_PLANE, off.min(axis=2) * off.max(axis=2) >= -(ON_PLANE**2)
    sharp = np.repeat(piece.face, 3) != piece.face[twins // 3]
    along = (1.0 * in_plane + beside) @ length - THROUGH_EDGE * np.count_nonzero(through & sharp, axis=1)
    # A corner that is cut in two meets its neighbours with faces that end in it.
    opposite = piece.points[third[twins]] - piece.points[start]
    split = np.abs(heights[:, [start, end]]).max(axis=1) <= ON_PLANE
    split &= heights[:, third] * heights[:, third[twins]] < -(ON_PLANE**2)
    split &= dot(opposite, piece.normals.repeat(3, axis=0)) < -ON_PLANE
    return along - split @ np.linalg.norm(piece.points[end] - piece.points[start], axis=1) / 4.0


def _bent_edges(piece: _Piece, normals: np.ndarray, sense: float) -> np.ndarray:
    """(n, 2) int array: edges, longest first, where faces with these normals turn outwards; -1.0 for inwards."""
    edges, face, twin = piece.edges, np.repeat(piece.face, 3), piece.twins
    k = np.flatnonzero((edges[:, 0] < edges[:, 1]) & (face < len(normals)) & (face[twin] < len(normals)))
    ends = piece.points[edges[k]]
    along = ends[:, 1] - ends[:, 0]
    length = np.sqrt(dot(along, along))
    turn = dot(cross(normals[face[k]], normals[face[twin[k]]]), along)
    bent = np.flatnonzero(sense * turn > REENTRANT * length)
    return edges[k[bent[np.argsort(-length[bent], kind="stable")]]]


def _normals_through(edge: np.ndarray, points: np.ndarray) -> np.ndarray:
    """(n, 3) array: normals of planes through an edge and another point."""
    along = unit(edge[1] - edge[0])
    arms = points - edge[0]
    arms = arms - (arms @ along)[:, None] * along
    far = np.sqrt(dot(arms, arms))
    normals = cross(along[None], arms[far > 10.0 * ON_PLANE] / far[far > 10.0 * ON_PLANE, None])
    normals = normals * np.where(normals @ [1.0, 1e-3, 1e-6] < 0.0, -1.0, 1.0)[:, None]
    _, once = np.unique(np.round(normals, 6), axis=0, return_index=True)
    return normals[np.sort(once)][:CORNERS_TRIED]
