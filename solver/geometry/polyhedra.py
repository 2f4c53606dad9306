"""Polyhedra: the shapes of blocks in space, and their contact points, where convex parts face each other."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from solver.tolerances import CORNER_TOLERANCE, PENETRATION_FRACTION
from solver.words import kept

from .broad_phase import expand_ranges
from .clipping import clipped_faces
from .contacts import STEEPEST_LANDING, Contacts, are_known, joined_contacts, matched_contacts
from .convex_parts import ENDS, GOES_ON, ConvexParts, PlacedParts, convex_parts
from .cut_points import without_points_of_cuts
from .entering import across, entered
from .facing import FacingParts, edge_separations, facing_parts, overlapping_parts
from .portions import alike, linked
from .solids import ROUNDING, Solids, cross, dot, taken, unit
from .spatial_features import ACROSS, BEFORE_EDGE, ON_FACE, feature_rows, places_of, read_places

#: Difference of separations, in widths, that is more than rounding.
SAME_PLACE = 1e-4

#: Width of a sliver at a cut, as a part of both faces, and its area, as a part of that in which the two blocks touch.
SLIVER = 0.005


@dataclass(frozen=True)
class Polyhedra(Solids):
    """Blocks in space: their corners have three coordinates."""

    def size(self, chosen: np.ndarray) -> float:
        """Edge of the cube as large as the mean of the chosen blocks, (n_blocks,) bool, [m]."""
        return float(np.cbrt(self.volumes[chosen].mean()))

    @kept
    def parts(self) -> ConvexParts:
        """Convex parts of the blocks: the blocks themselves where all are convex."""
        return convex_parts(self)

    @kept
    def gyration(self) -> np.ndarray:
        """(n_blocks,) array [m²]: square of the radius of gyration of each block, the mean about all axes."""
        return np.asarray(np.trace(self.inertia, axis1=1, axis2=2) / (3.0 * self.volumes))

    def find(self, vertices: np.ndarray, reach: float, useful: np.ndarray) -> Contacts:
        """Find the points of :func:`~solver.mechanics.find_contacts`, of two blocks one ``useful``, (n_blocks,) bool.

        Of two near parts, the face from which the other part is farthest leads, and the face of the other that opposes
        it best answers. Both are projected into the plane half-way between and clipped. A corner of the clipped polygon
        is a corner of one part in the face of the other, or an edge across an edge. Where they do not cover each other,
        the next best answer. Where they do not come as near as their parts are, a tip stands on a face, or an edge lies
        across an edge.
        """
        widths, placed = self.widths, self.parts.placed(vertices)
        parts, solids, block_of_part = placed.parts, placed.solids, placed.parts.block_of_part
        pairs = facing_parts(placed, reach, useful)

        def near(contacts: Contacts) -> np.ndarray:
            deepest = PENETRATION_FRACTION * np.minimum(widths[contacts.block_a], widths[contacts.block_b])
            return (contacts.gaps <= reach) & (contacts.gaps >= -deepest)

        shallow = pairs.apart >= -PENETRATION_FRACTION * pairs.width
        # Flanks of steep tips hardly face each other.
        numbers = np.flatnonzero(shallow & (dot(*placed.faces.normals[pairs.faces]) <= -0.05))
        facing, nearest = pairs[numbers], np.full(len(pairs.part), np.inf)
        # With each point the planes of both faces, and whether it is near.
        found: list[Contacts] = []
        labels: list[np.ndarray] = []
        at_cut = np.bincount(solids.face_of_corner, parts.goes_on) > 0
        resolved, largest = np.zeros(len(numbers), dtype=bool), np.zeros(len(numbers))
        # What lies along an edge of a cut stands on the face that goes on there, and no other answers.
        goes_on = (parts.pieces[..., 2] == GOES_ON).any(axis=1)
        on_cut = np.logical_or.reduceat(goes_on, solids.face_offsets[:-1])[facing.leading]
        on_cut[on_cut] = _edges_over(placed, facing[on_cut], reach)[1] if on_cut.any() else False
        _, joint = np.unique(block_of_part[facing.parts].T @ [len(widths), 1], return_inverse=True)
        # Other faces are tried where those that oppose each other best do not cover each other.
        for pair, faces in facing.faces_in_turn(placed, resolved):
            corners = clipped_faces(placed, *faces)
            contacts = _measured(placed, corners.features, corners.areas)
            lowest = np.full(len(pair), np.inf)
            np.minimum.at(lowest, corners.owner, contacts.gaps)
            nearest[numbers[pair]] = np.minimum(nearest[numbers[pair]], lowest)
            strip = corners.widths / solids.face_widths[faces].min(axis=0)[corners.owner]
            # What overlaps on a strip at a large gap slides past before it would touch.
            slides_past = (strip < 0.5) & (lowest[corners.owner] > STEEPEST_LANDING * corners.widths)
            area = np.bincount(corners.owner, corners.areas, minlength=len(pair))
            np.maximum.at(largest, joint[pair], area)
            small = (area < SLIVER * largest[joint[pair]]) & at_cut[faces].any(axis=0)
            sliver = small[corners.owner] & (strip < SLIVER)
            # Edges that cross behind a plane that separates their parts do not touch.
            owner = pair[corners.owner]
            kept = ~slides_past & ~sliver & (contacts.gaps >= facing.apart[owner] - 1e-3 * facing.width[owner])
            inside = near(contacts)
            # What touches along a line alone has no area.
            contacts = replace(contacts, areas=(np.bincount(corners.owner, inside) > 2)[corners.owner] * contacts.areas)
            resolved |= on_cut | (np.bincount(owner[kept & inside], minlength=len(numbers)) > 0)
            kept = np.flatnonzero(kept if not parts.whole else kept & inside)
            found.append(contacts[kept])
            labels.append(np.stack([*parts.plane[faces[:, corners.owner[kept]]], inside[kept]], axis=1))
        # Where a plane separates parts and points of both are as near as that, no tips or edges touch.
        others = (pairs.apart < -SAME_PLACE * pairs.width) | (nearest > pairs.apart + SAME_PLACE * pairs.width)
        beside, resting = shallow & others, np.flatnonzero(shallow & ~others)
        beside[resting] = _rests_on_more(placed, pairs[resting])
        over, crossed = _edges_over(placed, pairs[beside], reach)[0], _crossed_edges(placed, pairs[others], reach)
        single = _measured(placed, np.unique(np.vstack([over, crossed]), axis=0))
        beyond = [placed.kinds_at(edge, single.points) != ENDS for edge in single.features.T[1:3]]
        single = single[near(single) & ~((single.features[:, 0] == ACROSS) & np.any(beyond, axis=0))]
        contacts = joined_contacts([*found, single])
        label = np.concatenate([*labels, np.tile([-1, -1, 1], (len(single), 1))])
        at_one_place = CORNER_TOLERANCE * float(widths.min())
        if not parts.whole:
            contacts, kept = without_points_of_cuts(parts, contacts, label[:, :2], at_one_place)
            contacts = contacts[label[kept, 2] > 0]
        contacts = contacts[np.lexsort(contacts.features.T[[2, 1, 0]])]
        # Parts of one block may have a point in common, and tips and edges across each other a corner of a polygon.
        return _without_duplicates(contacts, at_one_place)

    def measure(self, vertices: np.ndarray, contacts: Contacts) -> Contacts:
        """Measure the contact points between the same features, with the corners (n_vertices, 3) [m] elsewhere."""
        return _measured(self.parts.placed(vertices), contacts.features, contacts.areas)

    def overlaps(self, vertices: np.ndarray, tolerance: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Pairs of blocks that overlap by more than a tolerance [m], (n,) int, the lower first, and their depths [m].

        A depth is the smallest movement that separates their deepest two parts.
        """
        every = np.ones(len(self), dtype=bool)
        i, j, _, of_parts = overlapping_parts(self.parts.placed(vertices), tolerance, every)
        blocks = self.parts.block_of_part[np.stack([i, j], axis=1)]
        pairs, pair_of = np.unique(blocks, axis=0, return_inverse=True)
        depth = np.zeros(len(pairs))
        np.maximum.at(depth, pair_of.ravel(), of_parts)
        return pairs[:, 0], pairs[:, 1], depth

    def entered(
        self, before: np.ndarray, after: np.ndarray, useful: np.ndarray, tolerance: float, contacts: Contacts
    ) -> Contacts:
        """Find the points of ``Polygons.entered`` in space.

        Edges touch where they cross; where that is known and does not help, as one turns, corners are to stay before
        the plane that separated the two.
        """
        placed, placed_after = self.parts.placed(before), self.parts.placed(after)
        i, j, width, _ = overlapping_parts(placed_after, tolerance, useful)
        deepest = PENETRATION_FRACTION * width
        face_corner, face, own, other, pair, corner = entered((placed, placed_after), i, j, deepest)
        on_face = _measured(placed, feature_rows(ON_FACE, face_corner, face, -1))
        crossings = places_of(*_crossings(placed_after, own, other))
        crossed = _measured(placed, feature_rows(ACROSS, own, other, crossings))
        _, known = matched_contacts(crossed, contacts)
        corner, pair = corner[known[pair]], pair[known[pair]]
        own, other = own[pair], other[pair]
        normals, along = across(placed, own, other), unit(placed.along(other))
        apart = placed.vertices[corner] - placed.starts(other)
        planes = Contacts(
            features=feature_rows(BEFORE_EDGE, corner, other, -1),
            block_a=placed.parts.block_of_part[placed.solids.block_of_vertex[corner]],
            block_b=crossed.block_b[pair],
            points=placed.vertices[corner],
            frames=np.stack([normals, along, cross(normals, along)], axis=1),
            gaps=dot(apart, normals),
            slip=np.stack([dot(apart, along), dot(apart, cross(normals, along))], axis=1),
            areas=np.zeros(len(corner)),
        )
        points = joined_contacts([on_face, crossed[~known], planes])
        return points[~are_known(points, contacts)]


def _measured(placed: PlacedParts, features: np.ndarray, areas: np.ndarray | None = None) -> Contacts:
    """Frames, gaps and slips of given pairs of features, (n, 4) int, where the corners now are.

    A corner inside a face has the normal of the face. On the boundary of a face its normal is half-way between that of
    the face and that of the edges that cross there, so that the normal of a corner that enters the face changes in two
    equal steps. A corner on a corner, and edges that are nearly parallel, have the normal half-way between the two
    faces. An edge across an edge has the normal to both. Areas, (n,) [m²], are carried on, or zero.

    The gap is the distance along the normal of two material points. Tangents ride on the face of ``block_b``: swung
    about the edge there where the normal is not the face's. The slip is the place of the point of ``block_a`` along
    them, so that its change is the slip between the blocks to first order.
    """
    solids, faces, block_of_part = placed.solids, placed.faces, placed.parts.block_of_part
    kind, first, second, rest = features.T
    corners, face_of, on_face = solids.corners, solids.face_of_corner, kind == ON_FACE
    face_b = np.where(on_face, second, face_of[np.where(on_face, 0, second)])
    vertex_a = np.where(on_face, first, corners[np.where(on_face, 0, first)])
    x_a, x_b = taken(placed.vertices, vertex_a), taken(faces.middles, face_b)
    face_normals, face_tangents = taken(faces.normals, face_b), taken(faces.tangents, face_b)
    normals, tangents = face_normals.copy("K"), face_tangents
    along = np.zeros_like(normals)

    # A corner on a corner, or edges that are nearly parallel.
    k = np.flatnonzero(~on_face)
    x_b[k] = placed.starts(second[k])
    normals[k] = unit(taken(face_normals, k) - taken(faces.normals, face_of[first[k]]))

    # A corner on the boundary of a face.
    k = np.flatnonzero(on_face & (rest >= 0))
    own, other = rest[k] % len(corners), rest[k] // len(corners)
    x_b[k], along[k] = placed.starts(other), unit(placed.along(other))
    crossing = unit(cross(placed.along(own), along[k]))
    sense = np.sign(dot(crossing, placed.outward(other) - placed.outward(own)))
    normals[k] = unit(face_normals[k] + sense[:, None] * crossing)

    # An edge across an edge.
    k = np.flatnonzero(kind == ACROSS)
    on_a, on_b, parallel = read_places(rest[k])
    own, other = first[k], second[k]
    edge_a, edge_b = placed.along(own), placed.along(other)
    x_a[k] = placed.starts(own) + on_a[:, None] * edge_a
    x_b[k] = placed.starts(other) + on_b[:, None] * edge_b
    crossing = unit(cross(edge_a, edge_b))
    sense = np.sign(dot(crossing, placed.outward(other) - placed.outward(own)))
    normals[k] = np.where(parallel[:, None], normals[k], sense[:, None] * crossing)
    along[k] = np.where(parallel[:, None], 0.0, unit(edge_b))

    # Rotated about the edge; where there is none, projected onto the plane of the contact.
    has_edge = dot(along, along) > 0.0
    across = cross(face_normals, along)
    rotated = dot(tangents, along)[:, None] * along + dot(tangents, across)[:, None] * cross(normals, along)
    projected = tangents - dot(tangents, normals)[:, None] * normals
    tangents = unit(np.where(has_edge[:, None], rotated, projected))
    frames = np.empty((len(kind), 3, 3))
    frames[:, 0], frames[:, 1], frames[:, 2] = normals, tangents, cross(normals, tangents)

    # From the middle of the face to the fixed point of block b, then to that of block a.
    fixed, apart = x_b - taken(faces.middles, face_b), x_a - x_b
    place = np.stack([dot(fixed, face_tangents), dot(fixed, cross(face_normals, face_tangents))], axis=1)
    slip = place + np.stack([dot(apart, tangents), dot(apart, frames[:, 2])], axis=1)
    return Contacts(
        features=features,
        block_a=block_of_part[solids.block_of_vertex[vertex_a]],
        block_b=block_of_part[solids.block_of_face[face_b]],
        points=np.ascontiguousarray(np.where(on_face[:, None], x_a, (x_a + x_b) / 2.0)),
        frames=frames,
        gaps=dot(apart, normals),
        slip=slip,
        areas=np.zeros(len(features)) if areas is None else areas,
    )


def _without_duplicates(contacts: Contacts, near: float) -> Contacts:
    """Keep one of several points of two blocks at one place with one normal."""
    from scipy.spatial import cKDTree

    first, second = cKDTree(contacts.points).query_pairs(near, output_type="ndarray").T
    pairs = contacts.pair_keys()
    sense = np.where(contacts.block_a[first] == contacts.block_a[second], 1.0, -1.0)
    same = pairs[first] == pairs[second]
    same &= sense * dot(contacts.frames[first, 0], contacts.frames[second, 0]) > 1.0 - ROUNDING
    group = linked(np.stack([first[same], second[same]]), len(contacts))
    areas = np.bincount(group, contacts.areas)
    return replace(contacts, areas=areas[group])[np.sort(np.unique(group, return_index=True)[1])]


def _rests_on_more(placed: PlacedParts, pairs: FacingParts) -> np.ndarray:
    """(n,) bool array: where a part has corners as near to the leading face as any that its answering face lacks."""
    offsets, faces, tolerance = placed.solids.offsets, placed.faces, SAME_PLACE * pairs.width
    owner, position = expand_ranges(np.diff(offsets)[pairs.part])
    corner = taken(placed.vertices, offsets[pairs.part][owner] + position)
    both = (pairs.leading[owner], pairs.answering[owner])
    before, behind = (dot(corner - taken(faces.middles, face), taken(faces.normals, face)) for face in both)
    more = (before <= (pairs.apart + tolerance)[owner]) & (behind < -tolerance[owner])
    return np.bincount(owner, more, minlength=len(pairs.part)) > 0


def _edges_over(placed: PlacedParts, pairs: FacingParts, reach: float) -> tuple[np.ndarray, np.ndarray]:
    """Features of both ends of what edges of a part have over the leading face: a ridge or a steep tip on a plane.

    And of which pairs an edge lies along a boundary beyond which the face of the block goes on, (n,) bool.
    """
    solids, faces, (once, first) = placed.solids, placed.faces, placed.solids.whole_edges
    may_stand = np.zeros(len(pairs.part), dtype=bool)
    for k, corner, vertex in alike((solids.face_offsets, pairs.leading), (solids.offsets, pairs.part), filled=True):
        face, normals = pairs.leading[k], taken(faces.normals, pairs.leading[k])[:, None]
        inward = cross(normals, unit(placed.along(corner)))
        inside = dot(taken(placed.vertices, vertex)[:, None] - placed.starts(corner)[:, :, None], inward[:, :, None])
        arms = taken(placed.vertices, vertex) - taken(faces.middles, face)[:, None]
        gaps, smallest = dot(arms, normals), CORNER_TOLERANCE * solids.shortest_edges[face, None]
        over = (inside.min(axis=1) > smallest) & (gaps <= reach)
        # An edge that lands inside a boundary is, at its middle and so at one of its ends, half as far inside, less
        # what its gap asks for twice over.
        lands = (inside - gaps[:, None] / (2.0 * STEEPEST_LANDING)).max(axis=2) > smallest / 2.0
        goes_on = (placed.parts.pieces[corner, :, 2] == GOES_ON).any(axis=2)
        may_stand[k] = (lands | goes_on).all(axis=1) | over.any(axis=1)
    number, part = np.flatnonzero(may_stand), pairs.part[may_stand]
    owner, position = expand_ranges(np.diff(first)[part])
    edge, face, owner = once[first[part][owner] + position], pairs.leading[number[owner]], number[owner]
    ends = np.stack([edge, solids.next_corner[edge]])
    gaps = dot(placed.starts(ends) - taken(faces.middles, face), taken(faces.normals, face))
    near = gaps.min(axis=0) <= reach
    pair, edge, face, ends, gaps = owner[near], edge[near], face[near], ends[:, near], gaps[:, near]
    owner, position = expand_ranges(np.diff(solids.face_offsets)[face])
    corner, starts = solids.face_offsets[face][owner] + position, np.flatnonzero(position == 0)
    inward = cross(taken(faces.normals, face[owner]), unit(placed.along(corner)))
    inside = dot(placed.starts(ends[:, owner]) - placed.starts(corner), inward)
    smallest = CORNER_TOLERANCE * solids.shortest_edges[face]
    on_boundary = np.abs(inside).max(axis=0) <= smallest[owner]
    slope = np.where(on_boundary, 0.0, inside[1] - inside[0])
    # Along the edge; of what runs along a boundary, nowhere.
    at = np.divide(-inside[0], slope, out=np.full(len(slope), -1.0), where=slope != 0.0)
    low = np.maximum.reduceat(np.where(slope > 0.0, at, 0.0), starts).clip(0.0)
    high = np.minimum.reduceat(np.where(slope < 0.0, at, 1.0), starts).clip(None, 1.0)
    # What meets a boundary only, as a stone beyond the joint of its neighbour, does not stand on the face; where the
    # face of the block goes on there is none.
    middle = (low + high) / 2.0
    points = placed.starts(edge) + middle[:, None] * placed.along(edge)
    goes_on = on_boundary & (placed.kinds_at(corner, points[owner]) == GOES_ON)
    depth = np.minimum.reduceat(np.where(goes_on, np.inf, inside[0] + middle[owner] * slope), starts)
    along_face, farthest = depth > smallest, np.minimum(reach, STEEPEST_LANDING * depth)
    for place in (low, high):
        along_face &= (1.0 - place) * gaps[0] + place * gaps[1] <= farthest
    at_end = np.array([low <= CORNER_TOLERANCE, high >= 1.0 - CORNER_TOLERANCE])
    on_face = (gaps <= reach) & (along_face & at_end | (np.minimum.reduceat(inside, starts, axis=1) > smallest))
    end, here = np.nonzero(on_face)
    stands = feature_rows(ON_FACE, solids.corners[ends[end, here]], face[here], -1)
    crosses = along_face[owner] & (at == np.where(slope > 0.0, low[owner], high[owner]))
    crosses &= (at > CORNER_TOLERANCE) & (at < 1.0 - CORNER_TOLERANCE)
    own, other = edge[owner[crosses]], corner[crosses]
    meets = feature_rows(ACROSS, own, other, places_of(*_crossings(placed, own, other)))
    on_cut = np.bincount(pair, along_face & np.logical_or.reduceat(goes_on, starts), minlength=len(pairs.part)) > 0
    return np.concatenate([stands, meets]), on_cut


def _crossed_edges(placed: PlacedParts, pairs: FacingParts, reach: float) -> np.ndarray:
    """Features of edges that separate two parts better than any of their faces: one point for a pair."""
    offsets, nearest = placed.solids.offsets, np.empty(len(pairs.part))
    for k, one, other in alike(*((offsets, part) for part in pairs.parts), filled=True):
        arms = taken(placed.vertices, one)[:, :, None] - taken(placed.vertices, other)[:, None]
        nearest[k] = np.sqrt(dot(arms, arms).min(axis=(1, 2)))
    # No plane separates parts farther than two of their corners are apart; half of it is left to rounding.
    pairs = pairs[nearest > pairs.apart + SAME_PLACE / 2.0 * pairs.width]
    apart, own, other = edge_separations(placed, *pairs.parts)
    k = np.flatnonzero((apart > pairs.apart + SAME_PLACE * pairs.width) & (apart <= reach))
    own, other = own[k], other[k]
    on_a, on_b = _crossings(placed, own, other)
    inside = (np.abs(np.stack([on_a, on_b]) - 0.5) < 0.5 - CORNER_TOLERANCE).all(axis=0)
    return feature_rows(ACROSS, own[inside], other[inside], places_of(on_a[inside], on_b[inside]))


def _crossings(placed: PlacedParts, own: np.ndarray, other: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where along two edges, as parts of them, their lines are nearest to each other, two (n,) arrays."""
    apart, along_a, along_b = placed.starts(other) - placed.starts(own), placed.along(own), placed.along(other)
    area = cross(along_a, along_b)
    on_a, on_b = (dot(cross(apart, along), area) / dot(area, area) for along in (along_b, along_a))
    return on_a, on_b
