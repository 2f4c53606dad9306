"""Mortar shared out to the nearest stone, for rubble, whose faces are not parallel.

Borders are edges of the Voronoi diagram of points along outlines; all are cut from one drawing of lines, and simplified
as one, so that neighbours share their edges to the last digit.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely
from scipy.spatial import Delaunay, Voronoi, cKDTree

from blockvis.layout.left_out import LeftOut
from blockvis.layout.linked import middles
from blockvis.layout.outlines import largest_piece, ring_of
from solver.mechanics import linked

from .facing_edges import common_width, edges_of

#: Points along the outlines are this fraction of the joint thickness apart.
SPACING = 0.2

#: At most this many points: their triangulation takes a few seconds.
MOST_POINTS = 200_000

#: Borders are drawn on a grid of this fraction of the size of the drawing.
GRID = 2e-9

#: Two points face each other across mortar if outward normals there are more than acos(-0.3) = 107 degrees apart: the
#: sides of a corner between two stones that touch do not.
FACING = -0.3

#: A corner of a border goes where the triangle with its neighbours has the area of a square of this fraction of the
#: size of a typical stone: the solver's contacts are at corners, and more of them than stones need slow it.
SIMPLER = 0.08

#: Borders shorter than this fraction of the size of a typical stone shrink to a point.
SHORTEST = 0.03

#: Gaps are looked for up to this fraction of the size of a typical stone; wider ones are openings.
REACH = 0.75

#: The joints of a wall are no wider over this share of their length, and up to WIDER times wider over the rest: what is
#: wider still are pockets, and the teeth at the end of a wall.
JOINTS, WIDER = 0.8, 1.5


@dataclass(frozen=True)
class Gaps:
    """Points along outlines, (n, 2) [m], and the Delaunay triangles between them with corners on two or three blocks.

    A point has an owner, its block, and stands for a length of outline, its weight [m]. The width of a triangle [m] is
    its longest side between two blocks, infinite where a side is between points that do not face each other.
    """

    points: np.ndarray
    owner: np.ndarray
    weights: np.ndarray
    triangles: np.ndarray
    widths: np.ndarray

    @property
    def local(self) -> np.ndarray:
        """(n,) array [m]: distance of each point from the nearest one of another block that it faces, or infinite."""
        found, across_gaps = np.full(len(self.points), np.inf), self.triangles[np.isfinite(self.widths)]
        for one, other in ((0, 1), (1, 2), (2, 0)):
            a, b = across_gaps[:, one], across_gaps[:, other]
            across = self.owner[a] != self.owner[b]
            length = np.hypot(*(self.points[a] - self.points[b]).T)
            for end in (a, b):
                np.minimum.at(found, end[across], length[across])
        # Of points at one place Delaunay keeps one, so that no triangle lies across a joint without width.
        close = GRID * float(np.ptp(self.points, axis=0).max())
        pairs = cKDTree(self.points).query_pairs(close, output_type="ndarray")
        found[pairs[self.owner[pairs[:, 0]] != self.owner[pairs[:, 1]]].ravel()] = 0.0
        return found


def share_out(
    outlines: Sequence[np.ndarray], thickness: float, anchored: np.ndarray, mortar: Sequence[LeftOut] = ()
) -> list[np.ndarray]:
    """Give mortar to the nearest stone that is not anchored: gaps up to a thickness [m], and pockets between such gaps.

    And surfaces of mortar as drawn, with the stones as their holes; holes without a stone are openings.
    """
    if anchored.all():
        return list(outlines)
    scale = float(np.ptp(np.concatenate(outlines), axis=0).max())
    # A power of ten, from a round origin: round coordinates stay what they are.
    grid = float(10.0 ** np.floor(np.log10(GRID * scale)))
    origin = np.round(np.concatenate(outlines).mean(axis=0) / (1e6 * grid)) * (1e6 * grid)
    shapes = np.array([largest_piece(shapely.Polygon(ring - origin).buffer(0)) for ring in outlines])
    growing = np.flatnonzero(~anchored)
    gaps = gaps_between(shapes, SPACING * thickness)
    masonry = _with_mortar(shapes, gaps, thickness, growing)
    masonry = shapely.union_all([masonry, *(_surface(item, origin, shapes) for item in mortar)])
    grown = np.isin(gaps.owner, growing)
    points, owner = gaps.points[grown], gaps.owner[grown]
    borders = _borders(points, owner, scale)
    lines = shapely.union_all([borders, *shapely.boundary(shapes), shapely.boundary(masonry)], grid_size=grid)
    faces = np.array(shapely.polygonize([*shapely.get_parts(lines)]).geoms)
    faces = faces[shapely.area(faces) > (10.0 * grid) ** 2]
    holder = _holders(faces, shapes, masonry, points, owner, anchored)
    cells = [_joined_faces(faces[holder == i], shapes[i], grid) for i in range(len(shapes))]
    size = float(np.median(np.sqrt(shapely.area(shapes[growing]))))
    simple = shapely.coverage_simplify(np.array(cells), SIMPLER * size)
    if anchored.any():
        simple = _along_anchored(simple, np.array(cells), np.flatnonzero(anchored), grid)
    rings = [ring_of(cell) for cell in simple]
    fixed = np.concatenate([np.zeros((0, 2)), *(rings[i] for i in np.flatnonzero(anchored))])
    found = [ring + origin for ring in without_short_edges(rings, SHORTEST * size, fixed)]
    return [np.asarray(outlines[i]) if anchored[i] else ring for i, ring in enumerate(found)]


def proposed_gap(outlines: Sequence[np.ndarray]) -> tuple[float, float]:
    """Propose the joint thickness [m] that closes the joints between stones of any shape, 0 without gaps.

    And say how far [m] was looked: a thickness near it is the limit of the search, not a measurement.
    """
    origin = np.concatenate(outlines).mean(axis=0)
    shapes = np.array([largest_piece(shapely.Polygon(ring - origin).buffer(0)) for ring in outlines])
    size = float(np.median(np.sqrt(shapely.area(shapes))))
    gaps = gaps_between(shapes, 0.03 * size)
    local = gaps.local
    near = local <= REACH * size
    if not near.any() or local[near].max() < 1e-6 * size:
        return 0.0, REACH * size
    common = common_width(local[near], gaps.weights[near], JOINTS)
    return float(local[local <= WIDER * common].max()), REACH * size


def gaps_between(shapes: np.ndarray, spacing: float) -> Gaps:
    """Triangulate the gaps between shapes from points along their outlines ``spacing`` [m] apart."""
    spacing = max(spacing, float(shapely.length(shapes).sum()) / MOST_POINTS)
    borders = shapely.segmentize(shapely.get_exterior_ring(shapely.orient_polygons(shapes)), spacing)
    edges = edges_of([shapely.get_coordinates(border)[:-1] for border in borders])
    every, block, after = edges.start, edges.block, edges.end - edges.start
    before = np.concatenate([np.roll(side, 1, axis=0) for side in np.split(after, edges.offsets[1:-1])])
    lengths = [np.hypot(*side.T) for side in (before, after)]
    normals = [side[:, ::-1] * [1.0, -1.0] / h[:, None] for side, h in zip((before, after), lengths, strict=True)]
    corners = Delaunay(every).simplices
    corners = corners[np.ptp(block[corners], axis=1) > 0]
    widths = np.zeros(len(corners))
    for one, other in ((0, 1), (1, 2), (2, 0)):
        a, b = corners[:, one], corners[:, other]
        across = block[a] != block[b]
        # At a corner of a stone the normal is one of two, whichever faces the other point more.
        cosine = np.min([(normals[i][a] * normals[j][b]).sum(axis=1) for i in (0, 1) for j in (0, 1)], axis=0)
        length = np.where(cosine < FACING, np.hypot(*(every[a] - every[b]).T), np.inf)
        widths = np.where(across, np.maximum(widths, length), widths)
    return Gaps(every, block, (lengths[0] + lengths[1]) / 2.0, corners, widths)


def _with_mortar(shapes: np.ndarray, gaps: Gaps, thickness: float, growing: np.ndarray) -> Any:
    """All stones with the gaps between them up to a width, and the pockets where such gaps meet."""
    # The sides of triangles across a gap run from point to point, not quite square to it.
    widest = 1.001 * float(np.hypot(thickness, SPACING * thickness))
    narrow = (gaps.widths <= widest) & np.isin(gaps.owner[gaps.triangles], growing).any(axis=1)
    corners = gaps.points[gaps.triangles[narrow]]
    mortar = shapely.polygons(corners) if len(corners) else np.array([], dtype=object)
    filled = shapely.union_all([*shapes, *mortar[shapely.area(mortar) > 0.0]])
    # A pocket between stones is wider than the joints that meet there, and wider still between blunt ones; an opening
    # holds a disc of the radius of a joint thickness.
    kept = []
    for part in shapely.get_parts(filled):
        holes = [ring for ring in part.interiors if not shapely.Polygon(ring).buffer(-thickness).is_empty]
        kept.append(shapely.Polygon(part.exterior, holes))
    return shapely.union_all(kept)


def _surface(mortar: LeftOut, origin: np.ndarray, shapes: np.ndarray) -> Any:
    """Fill the holes in a surface of mortar that hold a stone."""
    holes = [shapely.Polygon(ring - origin).buffer(0) for ring in mortar.holes]
    inside = shapely.STRtree(shapely.point_on_surface(shapes))
    openings = [hole for hole in holes if len(inside.query(hole, "contains")) == 0]
    return shapely.Polygon(mortar.points - origin).buffer(0).difference(shapely.union_all(openings))


def _borders(points: np.ndarray, owner: np.ndarray, scale: float) -> Any:
    """Lines between the cells of points of different blocks."""
    # Points far around the drawing make every border finite.
    angles = np.linspace(0.0, 2.0 * np.pi, 16, endpoint=False)
    far = points.mean(axis=0) + 4.0 * scale * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    diagram = Voronoi(np.vstack([points, far]))
    block = np.concatenate([owner, np.full(len(far), -1)])
    sides = np.array(diagram.ridge_points)
    ends = np.array([ridge if len(ridge) == 2 else (-1, -1) for ridge in diagram.ridge_vertices])
    keep = (block[sides[:, 0]] != block[sides[:, 1]]) & (ends >= 0).all(axis=1) & (block[sides] >= 0).all(axis=1)
    return shapely.multilinestrings(shapely.linestrings(diagram.vertices[ends[keep]]))


def _holders(
    faces: np.ndarray, shapes: np.ndarray, masonry: Any, points: np.ndarray, owner: np.ndarray, anchored: np.ndarray
) -> np.ndarray:
    """(n_faces,) int array: block of each face; -1 for none."""
    inside = shapely.point_on_surface(faces)
    places = shapely.get_coordinates(inside)
    nearest = owner[cKDTree(points).query(places)[1]]
    shapely.prepare(masonry)
    holder = np.where(shapely.contains(masonry, inside), nearest, -1)
    face, block = shapely.STRtree(shapes).query(inside, "within")
    # What is drawn as stone stays with its stone; where two overlap, with the nearer one, and first with a support.
    several = np.bincount(face, minlength=len(faces))
    single = (several[face] == 1) | anchored[block]
    holder[face[single]] = block[single]
    return holder


def _joined_faces(faces: np.ndarray, drawn: Any, grid: float) -> Any:
    """Join the faces of a block: the largest piece, without holes."""
    union = shapely.union_all(faces, grid_size=grid) if len(faces) else drawn
    piece = largest_piece(union)
    return drawn if piece.is_empty else piece


def _along_anchored(simple: np.ndarray, cells: np.ndarray, anchored: np.ndarray, grid: float) -> np.ndarray:
    """Take back what simplifying did to borders with blocks that keep their outline: others end where these begin."""
    kept, found = shapely.union_all(cells[anchored]), simple.copy()
    found[anchored] = cells[anchored]
    covered = shapely.union_all(found)
    for i in np.flatnonzero(shapely.distance(cells, kept) <= grid):
        if i in anchored:
            continue
        lost = shapely.get_parts(cells[i].difference(covered, grid_size=grid))
        lost = lost[shapely.distance(lost, kept) <= grid]
        own = shapely.difference(simple[i], kept, grid_size=grid)
        found[i] = _joined_faces(np.array([own, *lost]), cells[i], grid)
    return found


def without_short_edges(rings: list[np.ndarray], shortest: float, fixed: np.ndarray) -> list[np.ndarray]:
    """Let edges shorter than a length [m] shrink to a point, in all outlines that share them; ``fixed`` corners stay.

    Outlines that are neighbours share their corners to the last digit.
    """
    corners, which = np.unique(np.concatenate(rings), axis=0, return_inverse=True)
    around = np.split(which.ravel(), np.cumsum([len(ring) for ring in rings])[:-1])
    ends = np.concatenate([np.stack([w, np.roll(w, -1)], axis=1) for w in around])
    length = np.hypot(*(corners[ends[:, 0]] - corners[ends[:, 1]]).T)
    stays = {tuple(corner) for corner in fixed}
    staying = np.array([tuple(corner) in stays for corner in corners], dtype=bool)
    length[staying[ends].all(axis=1)] = np.inf
    limit = shortest
    # Where shrinking would fold an outline, less of it is done.
    for _ in range(4):
        a, b = ends[length < limit].T
        group = linked((a, b), len(corners))
        # Of two that stay, none may go to the other.
        torn = np.bincount(group, staying)[group] > 1
        group[torn] = group.max() + 1 + np.arange(np.count_nonzero(torn))
        count = np.bincount(group)
        place = middles(corners, group)
        for k, corner in enumerate(corners):
            if count[group[k]] == 1 or staying[k]:
                place[group[k]] = corner
        found = []
        for w in around:
            moved = group[w]
            found.append(place[moved[moved != np.roll(moved, 1)]])
        if all(len(ring) > 2 and shapely.Polygon(ring).is_valid for ring in found):
            return found
        limit /= 4.0
    return rings
