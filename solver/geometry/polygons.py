"""Polygons: the shapes of blocks in the plane, and their contact points: corners that face edges, frames and gaps."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from solver.tolerances import CORNER_TOLERANCE, GEOMETRY_TOLERANCE, PENETRATION_FRACTION
from solver.words import kept

from .broad_phase import box_pairs, boxes, expand_ranges
from .contacts import STEEPEST_LANDING, Contacts, are_known
from .outlines import Bodies, next_vertices, overlap_depths, polygon_integrals, turn
from .solids import dot, stacked, taken

#: Sine of the angle by which the flanks of a corner may tilt into the edge it faces, as those of an open joint.
LARGEST_TILT = 0.5

#: Cosine of the angle between two faces at a corner from which on they face each other: up to 78 degrees, as a hinge
#: may open, and less than the right angle between diagonal neighbours.
FACING_COSINE = 0.2

#: Kinds of contact in the plane, column 0 of the features. A corner on an edge: the corner (a vertex of ``block_a``),
#: the edge (of ``block_b``, named by the vertex it starts at), -1. A corner on a corner: both vertices, and the edge of
#: ``block_b`` that the first one faces.
ON_EDGE, ON_CORNER = 0, 1


@dataclass(frozen=True)
class Polygons(Bodies):
    """Blocks in the plane, polygons with a thickness, and what follows from their drawing.

    Corners have two coordinates and run counter-clockwise.
    """

    thickness: np.ndarray  #: (n,) [m], out of plane

    @kept
    def _integrals(self) -> tuple[np.ndarray, np.ndarray]:
        return polygon_integrals(self.vertices, self.offsets)

    @property
    def areas(self) -> np.ndarray:
        """(n,) array [m²]."""
        return self._integrals[0]

    @property
    def centroids(self) -> np.ndarray:
        """(n, 2) array [m], before any movement."""
        return self._integrals[1]

    @property
    def volumes(self) -> np.ndarray:
        """(n,) array [m³]."""
        return self.areas * self.thickness

    @kept
    def next_vertex(self) -> np.ndarray:
        """(n_vertices,) int array: the vertex that follows counter-clockwise; edge i runs from i to it."""
        return next_vertices(self.offsets)

    @kept
    def previous_vertex(self) -> np.ndarray:
        """(n_vertices,) int array: the vertex before."""
        return np.argsort(self.next_vertex)

    @kept
    def edge_lengths(self) -> np.ndarray:
        """(n_vertices,) array [m]: length of the edge that starts at each vertex."""
        return np.hypot(*(self.vertices[self.next_vertex] - self.vertices).T)

    @kept
    def convex_vertex(self) -> np.ndarray:
        """(n_vertices,) bool array: false at re-entrant corners and, to rounding, straight ones: no contact points."""
        along = PlacedPolygons(self, self.vertices).directions
        return turn(along[self.previous_vertex], along) > GEOMETRY_TOLERANCE

    @kept
    def side_of_edge(self) -> np.ndarray:
        """(n_vertices,) int array: first edge of the side that each edge is a part of.

        A straight or slightly re-entrant corner, which has no contact point of its own, does not end a side.
        """
        first, last = self.offsets[:-1], self.offsets[1:] - 1
        along = PlacedPolygons(self, self.vertices).directions
        before = along[self.previous_vertex]
        ends = self.convex_vertex | (turn(before, along) < -LARGEST_TILT) | (dot(before, along) < 0.0)
        number = np.arange(len(ends))
        side = np.maximum.accumulate(np.where(ends, number, first[self.block_of_vertex]))
        # The side at the first corner may begin before it.
        wraps = ~ends[side]
        return np.where(wraps, side[last][self.block_of_vertex], side)

    @kept
    def widths(self) -> np.ndarray:
        """(n,) array [m]: twice the area over the perimeter of each polygon, near b for a long a × b."""
        return 2.0 * self.areas / np.add.reduceat(self.edge_lengths, self.offsets[:-1])

    @property
    def gyration(self) -> np.ndarray:
        """(n_blocks,) array [m²]: square of the radius of gyration of each block about its centroid, as drawn."""
        corner = self.vertices - self.centroids[self.block_of_vertex]
        following, first = corner[self.next_vertex], self.offsets[:-1]
        cross = turn(corner, following)
        squares = (corner**2).sum(axis=1) + (corner * following).sum(axis=1) + (following**2).sum(axis=1)
        return np.asarray(np.add.reduceat(cross * squares, first) / (6.0 * np.add.reduceat(cross, first)))

    def size(self, chosen: np.ndarray) -> float:
        """Edge of the square as large as the mean of the chosen blocks, (n_blocks,) bool, [m]."""
        return float(np.sqrt(self.areas[chosen].mean()))

    def find(self, vertices: np.ndarray, reach: float, useful: np.ndarray) -> Contacts:
        """Find the points of :func:`~solver.mechanics.find_contacts`, of two blocks one ``useful``, (n_blocks,) bool.

        Candidates are all pairs of a convex corner and an edge of another block, not both of supports, with the
        corner in front of the edge (gap at most ``reach``), its block on the outward side and above the edge over
        some length. Near an end of the edge the corner there and the face that leaves it decide: where the two
        faces run the same way the pair is a corner on a corner, kept once; where they part, the blocks are
        diagonal neighbours and do not touch.
        """
        pairs = np.stack(box_pairs(vertices, self.offsets, reach))
        pairs, placed = pairs[:, useful[pairs].any(axis=0)], PlacedPolygons(self, vertices)
        pair_a, pair_b = np.hstack([pairs, pairs[::-1]])
        vertex, edge, corner = placed.classified_ends(*placed.candidates(pair_a, pair_b, reach))
        kept = placed.are_closest_faces(vertex, edge, corner)
        return placed.contacts(features_of(vertex[kept], edge[kept], corner[kept]))

    def measure(self, vertices: np.ndarray, contacts: Contacts) -> Contacts:
        """Measure the contact points between the same features, with the corners (n_vertices, 2) [m] elsewhere."""
        return PlacedPolygons(self, vertices).contacts(contacts.features, contacts.areas)

    def overlaps(self, vertices: np.ndarray, tolerance: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Pairs of blocks that overlap by more than ``tolerance`` [m]; see :func:`overlap_depths`."""
        return overlap_depths(vertices, self.offsets, tolerance)

    def entered(
        self, before: np.ndarray, after: np.ndarray, useful: np.ndarray, tolerance: float, contacts: Contacts
    ) -> Contacts:
        """Contact points beside those given that would have kept apart what a movement has put into each other.

        Measured before it, of corners (n_vertices, d) [m] before and after, of overlaps of more than ``tolerance`` [m]
        with useful blocks.
        """
        i, j, _ = overlap_depths(after, self.offsets, tolerance)
        chosen = useful[i] | useful[j]
        placed = PlacedPolygons(self, before)
        vertex, edge = placed.passed_edges(PlacedPolygons(self, after), i[chosen], j[chosen])
        points = placed.contacts(features_of(vertex, edge, np.full(len(edge), -1)))
        return points[~are_known(points, contacts)]

    def facing_edge(self, vertex: np.ndarray, edge: np.ndarray, corner: np.ndarray) -> np.ndarray:
        """Find the edge of the corner's block that lies over ``edge`` where ``vertex`` stands on ``corner``.

        Both outlines run counter-clockwise, so facing edges run against each other: where one starts the other ends.
        """
        return np.where(corner == edge, self.previous_vertex[vertex], vertex)

    def without_duplicates(self, vertex: np.ndarray, edge: np.ndarray, corner: np.ndarray) -> tuple[np.ndarray, ...]:
        """Keep each pair of corners once, seen from the lower numbered vertex, and sort all by vertex and edge."""
        swap, facing = (corner >= 0) & (vertex > corner), self.facing_edge(vertex, edge, corner)
        edge = np.where(swap, facing, edge)
        vertex, corner = np.where(swap, corner, vertex), np.where(swap, vertex, corner)
        # The pair may have been found from both sides, and two corners may meet along two pairs of faces.
        low = np.minimum(edge, self.next_vertex[edge])
        end = np.where(corner < 0, 0, np.where(corner == low, 1, 2))
        _, first = np.unique((vertex.astype(np.int64) * len(self.vertices) + edge) * 3 + end, return_index=True)
        return vertex[first], edge[first], corner[first]

    def end_zone(self, vertex: np.ndarray, edge: np.ndarray) -> np.ndarray:
        """(n,) array [m]: how near the end of the edge the corner counts as standing on the corner there."""
        shortest = np.minimum(self.edge_lengths, self.edge_lengths[self.previous_vertex])[vertex]
        return CORNER_TOLERANCE * np.minimum(shortest, self.edge_lengths[edge])


@dataclass(frozen=True)
class PlacedPolygons:
    """Polygons where their corners, (n_vertices, 2) [m], now are."""

    shapes: Polygons
    vertices: np.ndarray

    @kept
    def directions(self) -> np.ndarray:
        """(n_vertices, 2) array: unit vectors along the edges, counter-clockwise."""
        return _unit(self.vertices[self.shapes.next_vertex] - self.vertices)

    def contacts(self, features: np.ndarray, areas: np.ndarray | None = None) -> Contacts:
        """Frames and gaps of given pairs of features, (n, 4) int.

        Tributary areas, (n,) [m²], are measured where they are not given.

        A corner on an edge has the normal of the edge. A corner on a corner has the normal that halves the angle
        between the two faces that meet there, so that neither block is preferred, and the point half-way.
        """
        shapes, (vertex, edge, corner) = self.shapes, corners_and_edges(features)
        v, tangent, on_corner = self.vertices[vertex], self.directions[edge], corner >= 0
        facing = shapes.facing_edge(vertex[on_corner], edge[on_corner], corner[on_corner])
        tangent[on_corner] = _unit(tangent[on_corner] - self.directions[facing])
        base = self.vertices[np.where(on_corner, corner, edge)]
        # The edge runs counter-clockwise around block b: its outward normal is a quarter turn clockwise, and
        # the tangent a quarter turn counter-clockwise from that normal is the edge's own direction.
        normal = np.stack([tangent[:, 1], -tangent[:, 0]], axis=1)
        offset = v - base
        contacts = Contacts(
            features=features,
            block_a=shapes.block_of_vertex[vertex],
            block_b=shapes.block_of_vertex[edge],
            points=np.where(on_corner[:, None], (v + base) / 2.0, v),
            frames=np.stack([normal, tangent], axis=1),
            gaps=dot(offset, normal),
            slip=dot(offset, tangent)[:, None],
            areas=np.zeros(len(features)) if areas is None else areas,
        )
        return replace(contacts, areas=_areas(shapes, contacts)) if areas is None else contacts

    def candidates(self, pair_a: np.ndarray, pair_b: np.ndarray, reach: float) -> tuple[np.ndarray, np.ndarray]:
        """Corners of block a in front of edges of block b, by distance and direction alone."""
        shapes, vertices, offsets = self.shapes, self.vertices, self.shapes.offsets
        counts = np.diff(offsets)
        low, high = boxes(vertices, offsets)
        owner, position = expand_ranges(counts[pair_a])
        vertex, b = offsets[pair_a][owner] + position, pair_b[owner]
        place = taken(vertices, vertex)
        near = shapes.convex_vertex[vertex]
        near &= ((place >= taken(low - reach, b)) & (place <= taken(high + reach, b))).all(axis=1)
        vertex, b = vertex[near], b[near]

        owner, position = expand_ranges(counts[b])
        edge, vertex = offsets[b][owner] + position, vertex[owner]
        # The distance comes first, as most pairs are far from each other.
        length, width, tangents = shapes.edge_lengths, shapes.widths, self.directions
        normals = stacked([tangents[:, 1], -tangents[:, 0]])
        gap = dot(taken(vertices, vertex) - taken(vertices, edge), taken(normals, edge))
        near = np.flatnonzero((gap >= -PENETRATION_FRACTION * width.max()) & (gap <= reach))
        vertex, edge, gap = vertex[near], edge[near], gap[near]
        along = dot(taken(vertices, vertex) - taken(vertices, edge), taken(tangents, edge))
        deepest = PENETRATION_FRACTION * width[shapes.block_of_vertex[[vertex, edge]]].min(axis=0)
        end, ends = shapes.end_zone(vertex, edge), (edge, shapes.next_vertex[edge])
        # Past a re-entrant corner is still the block.
        before, behind = (np.where(shapes.convex_vertex[corner], end, deepest) for corner in ends)
        chosen = (gap >= -deepest) & (along >= -before) & (along <= length[edge] + behind)
        chosen[chosen] = self._is_behind_face(vertex[chosen], edge[chosen], gap[chosen], end[chosen])
        vertex, edge = vertex[chosen], edge[chosen]

        (to_next, to_previous), normal = self._flanks(vertex), taken(normals, edge)
        outside = (dot(to_next, normal) >= -LARGEST_TILT) & (dot(to_previous, normal) >= -LARGEST_TILT)
        outside &= dot(_inward(to_next, to_previous), normal) > 0.0
        return vertex[outside], edge[outside]

    def _is_behind_face(self, vertex: np.ndarray, edge: np.ndarray, gap: np.ndarray, end: np.ndarray) -> np.ndarray:
        """Whether a corner behind an edge penetrates that face, and not a neighbouring one, nearer or before it."""
        shapes, vertices, through = self.shapes, self.vertices, np.ones(len(vertex), dtype=bool)
        k = np.flatnonzero(gap < -end)
        following, previous = shapes.next_vertex, shapes.previous_vertex
        inward = _inward(*self._flanks(vertex[k]))
        for neighbour, shared in ((following[edge[k]], following[edge[k]]), (previous[edge[k]], edge[k])):
            tangent, (_, distance) = self.directions[neighbour], self.seen_from_edges(vertex[k], neighbour)
            # The block of a corner that came through the neighbouring face lies on that face's side.
            from_neighbour_side = shapes.convex_vertex[shared] & (turn(inward, tangent) > 0.0)
            through[k] &= ~(from_neighbour_side & (distance > gap[k] + end[k]))
        k = k[through[k]]
        # Nor one beyond another face of the block, as of a lip that it touches from below.
        b = shapes.block_of_vertex[edge[k]]
        owner, position = expand_ranges(np.diff(shapes.offsets)[b])
        k, other = k[owner], shapes.offsets[b][owner] + position
        tangent = self.directions[edge[k]]
        starts, ends = (vertices[corner] - vertices[vertex[k]] for corner in (other, following[other]))
        axes = (tangent, tangent @ [[0.0, -1.0], [1.0, 0.0]])
        along, across = ((dot(starts, axis), dot(ends, axis)) for axis in axes)
        part = np.clip(-along[0] / np.where(along[0] == along[1], 1.0, along[1] - along[0]), 0.0, 1.0)
        height = gap[k] + across[0] + part * (across[1] - across[0])
        crosses = (np.minimum(*along) <= end[k]) & (np.maximum(*along) >= -end[k])
        neighbour = (other == following[edge[k]]) & shapes.convex_vertex[other]
        neighbour |= (other == previous[edge[k]]) & shapes.convex_vertex[edge[k]]
        through[k[crosses & ~neighbour & (height < -end[k]) & (height >= 2.0 * gap[k])]] = False
        return through

    def seen_from_edges(self, vertex: np.ndarray, edge: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """How far corners are along and before edges, (n,) arrays [m]."""
        tangent, offset = taken(self.directions, edge), taken(self.vertices, vertex) - taken(self.vertices, edge)
        return dot(offset, tangent), turn(offset, tangent)

    def _flanks(self, vertex: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Give the unit vectors from corners to the next and to the previous corner, (n, 2) arrays."""
        return taken(self.directions, vertex), -taken(self.directions, self.shapes.previous_vertex[vertex])

    def classified_ends(self, vertex: np.ndarray, edge: np.ndarray) -> tuple[np.ndarray, ...]:
        """Drop corners past the end of their edge, and find those on the corner there."""
        shapes, vertices = self.shapes, self.vertices
        along, gap = self.seen_from_edges(vertex, edge)
        to_stop = shapes.edge_lengths[edge] - along
        at_start = along <= to_stop
        other = np.where(at_start, edge, shapes.next_vertex[edge])
        overlap, end = np.minimum(along, to_stop), shapes.end_zone(vertex, edge)
        # Directions from the nearer end: of the edge, and of the face over the edge.
        sense = np.where(at_start, 1.0, -1.0)[:, None]
        along_edge = sense * self.directions[edge]
        along_facing = -sense * self.directions[shapes.facing_edge(vertex, edge, other)]
        parallel = dot(along_edge, along_facing) > FACING_COSINE
        # At a re-entrant corner there is no corner to touch.
        at_end = (overlap <= end) & shapes.convex_vertex[other]
        # The corner of a face that opens slides past the end of the edge before it would touch it.
        chosen = parallel | ~shapes.convex_vertex[other] | ((overlap > end) & (gap <= STEEPEST_LANDING * overlap))
        # Both corners lie within the end zone of the other's face, along the bisector.
        halfway = _unit(along_edge + along_facing + 1e-300)
        distance = np.abs(dot(vertices[vertex] - vertices[other], halfway))
        corner = np.where(at_end & parallel & (distance <= end), other, -1)
        return shapes.without_duplicates(vertex[chosen], edge[chosen], corner[chosen])

    def are_closest_faces(self, vertex: np.ndarray, edge: np.ndarray, corner: np.ndarray) -> np.ndarray:
        """Whether to keep each pair: of two corners that meet along two pairs of faces, only where these are closest.

        Where three blocks meet, the faces that two of them turn to the third also face each other across its corner.
        Two corners are held apart by one pair of faces or the other; held by both they could not slide along the
        closed one.
        """
        kept = np.ones(len(vertex), dtype=bool)
        k = np.flatnonzero(corner >= 0)
        facing = self.shapes.facing_edge(vertex[k], edge[k], corner[k])
        closeness = -dot(self.directions[edge[k]], self.directions[facing])
        _, pair = np.unique(vertex[k] * np.int64(len(self.vertices)) + corner[k], return_inverse=True)
        closest = np.full(len(k), -np.inf)
        np.maximum.at(closest, pair, closeness)
        kept[k] = closeness >= closest[pair] - 1e-9
        return kept

    def passed_edges(self, after: PlacedPolygons, i: np.ndarray, j: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Corners of blocks that go through edges of others in a movement, and these edges, (n,) int arrays.

        Of blocks i and j, (n_pairs,) int, that overlap after it. Of several edges it is the one that the corner went
        through last, seen from the block that has the edge.
        """
        shapes, offsets, counts = self.shapes, self.shapes.offsets, np.diff(self.shapes.offsets)
        a, b = np.concatenate([i, j]), np.concatenate([j, i])
        owner, position = expand_ranges(counts[a] * counts[b])
        vertex, edge = offsets[a][owner] + position // counts[b][owner], offsets[b][owner] + position % counts[b][owner]
        places, heights = zip(*(placed.seen_from_edges(vertex, edge) for placed in (self, after)), strict=True)
        width = np.minimum(shapes.widths[a], shapes.widths[b])[owner]
        came = shapes.convex_vertex[vertex] & (heights[1] < 0.0) & (heights[0] > heights[1])
        came &= heights[0] >= -PENETRATION_FRACTION * width
        part = np.clip(heights[0] / np.where(came, heights[0] - heights[1], 1.0), 0.0, 1.0)
        along = places[0] + part * (places[1] - places[0])
        # Past a re-entrant corner is still the block.
        start, end = (
            np.where(shapes.convex_vertex[corner], CORNER_TOLERANCE, PENETRATION_FRACTION) * width
            for corner in (edge, shapes.next_vertex[edge])
        )
        k = np.flatnonzero(came & (along >= -start) & (along <= shapes.edge_lengths[edge] + end))
        # Those it was behind before come last.
        order = k[np.lexsort((np.minimum(heights[0][k], 0.0) / width[k] + part[k], vertex[k], owner[k]))]
        last = np.append((np.diff(owner[order]) != 0) | (np.diff(vertex[order]) != 0), True)[: len(order)]
        return vertex[order[last]], edge[order[last]]


def features_of(vertex: np.ndarray, edge: np.ndarray, corner: np.ndarray) -> np.ndarray:
    """(n, 4) int array: the features of contact points in the plane.

    A vertex of ``block_a``, the edge that it faces, of ``block_b``, named by the vertex it starts at, and where it
    stands on a corner the vertex of ``block_b`` there, else -1; (n,) int arrays.
    """
    on_corner = corner >= 0
    kind = np.where(on_corner, ON_CORNER, ON_EDGE)
    return np.stack([kind, vertex, np.where(on_corner, corner, edge), np.where(on_corner, edge, -1)], axis=1)


def corners_and_edges(features: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Vertex, edge and corner, (n,) int arrays, from which :func:`features_of` made the features."""
    kind, vertex, other, edge = features.T
    on_corner = kind == ON_CORNER
    return vertex, np.where(on_corner, edge, other), np.where(on_corner, other, -1)


def _areas(shapes: Polygons, contacts: Contacts) -> np.ndarray:
    """(n,) array [m²]: tributary area of each contact point of the faces between blocks.

    A face is where a side of one block lies over a side of another. Half the distance to the neighbours along it times
    the smaller thickness; a corner may end two faces. Open contact points count too: a face has its whole length
    however it has turned.
    """
    vertex, edge, corner = corners_and_edges(contacts.features)
    over, side = np.stack([vertex, shapes.previous_vertex[vertex]], axis=1), shapes.side_of_edge
    on_corner = corner >= 0
    over[on_corner] = shapes.facing_edge(vertex[on_corner], edge[on_corner], corner[on_corner])[:, None]
    low, high = np.sort([side[over], np.broadcast_to(side[edge][:, None], over.shape)], axis=0).astype(np.int64)
    _, face = np.unique((low * len(side) + high).ravel(), return_inverse=True)
    # Along the mean of its edges, whichever of the two blocks they are of and comes first.
    point = np.repeat(np.arange(len(contacts)), 2)
    tangent = np.where(side[edge][point] == low.ravel(), 1.0, -1.0)[:, None] * contacts.frames[point, 1]
    direction = np.stack([np.bincount(face, tangent[:, axis]) for axis in (0, 1)], axis=1)[face]
    along = dot(contacts.points[point], _unit(direction))
    order = np.lexsort((along, face))
    step = np.where(np.diff(face[order]) == 0, np.diff(along[order]), 0.0)
    length = np.zeros(len(point))
    length[order] = (np.append(step, 0.0) + np.append(0.0, step)) / 2.0
    # A corner at a bend of the side that it stands on has two points there; a corner on a corner has one.
    standing = np.where(on_corner, len(side) + np.arange(len(contacts)), vertex)[point]
    _, corner_of = np.unique(face * (len(side) + len(contacts)) + standing, return_inverse=True)
    length = (np.bincount(corner_of, length) / np.bincount(corner_of))[corner_of]
    thickness = np.minimum(shapes.thickness[contacts.block_a], shapes.thickness[contacts.block_b])
    return length.reshape(-1, 2).sum(axis=1) * thickness


def _inward(to_next: np.ndarray, to_previous: np.ndarray) -> np.ndarray:
    """(n, 2) array: from corners into their blocks, along the bisectors of their flanks."""
    return np.stack([to_previous[:, 1] - to_next[:, 1], to_next[:, 0] - to_previous[:, 0]], axis=1)


def _unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.hypot(vectors[:, 0], vectors[:, 1])[:, None]
