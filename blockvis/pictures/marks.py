"""What a picture marks on blocks of the plane or of space: cracks, hinges, forces, arrows. Geometry, no rendering."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely

import solver
from blockvis.results.cracks import SMALLEST_OPENING
from blockvis.results.joint_faces import TOUCHING, InitialJoints, carried_between
from blockvis.results.joints import carried_faces
from solver import mechanics

from .frame import Frame, place_in

#: What lies between faces is a crack until they are apart by this many block sizes, or by their own extent: then the
#: blocks have parted, and it is air. Of faces that are turned against each other by more than this angle [rad] only the
#: edges have the colour of a crack: the wedge between them is open to the room.
WIDEST, STEEPEST = 0.5, 0.5

#: A sliding joint is marked over this length at least, in block sizes; no further than the thinner block is thick, or
#: the mark of a brick beside a large stone would lie outside both.
SHORTEST = 0.3

#: Resultants, and arrows of a support, below this fraction of the largest are not drawn.
SMALLEST_RESULTANT = 2e-3

#: Distance of a resultant from the middle of its joint, in those of the joint's ends, beyond which it is drawn at the
#: middle: where mortar is bent or sheared, it crosses the line of the joint far off, or nowhere.
BESIDE = 2.0

#: Joints open by less than this fraction of the block size are drawn half as wide.
FINE_CRACK = 0.01

#: Joints open by more than this fraction need no line: the middle of a wide crack may lie on a third block.
WIDE_CRACK = 0.2

#: Contact points turn about a hinge where they open slower than this part of the turning times the block size.
ON_HINGE = 0.05

#: Arrows of at most so many supports or blocks in space, and of supports in the plane; of more, evenly chosen ones
#: stand for all, as they need not move alike.
MOST_ARROWS, MOST_IN_PLANE = 24, 8

#: Arrows shorter than so many times what their shafts are thick would be blobs.
SHORTEST_ARROW = 2.0

#: A support that turns has two arrows, so far from its middle as a part of its extent.
END = 0.35

#: Length of the arrows at supports in the plane, as a part of the larger side of what is drawn; none is longer than its
#: support, to a third.
ARROW = 0.055


def part_outlines(assembly: solver.Assembly, corners: np.ndarray, parts: np.ndarray) -> np.ndarray:
    """(n, 2, 2) array [m]: edges of the outline around each part, its blocks merged.

    The corners (n_vertices, 2) are where they are drawn; parts (n_blocks,) as ``solver.mechanics.rigid_parts`` gives
    them.
    """
    edges = [np.zeros((0, 2, 2))]
    # Grown, merged and shrunk back: between faces that touch, the last digit leaves slivers otherwise.
    margin = 0.01 * assembly.block_size
    for part in range(int(parts.max(initial=-1)) + 1):
        blocks = np.flatnonzero(parts == part)
        outlines = [shapely.Polygon(corners[assembly.offsets[b] : assembly.offsets[b + 1]]) for b in blocks]
        merged = shapely.union_all(shapely.buffer(outlines, margin, join_style="mitre"))
        merged = shapely.buffer(merged, -margin, join_style="mitre").simplify(0.1 * margin)
        for polygon in shapely.get_parts(merged):
            for ring in shapely.get_rings(polygon):
                points = shapely.get_coordinates(ring)
                edges.append(np.stack([points[:-1], points[1:]], axis=1))
    return np.concatenate(edges)


@dataclass(frozen=True)
class Marks:
    """What is marked at one pose."""

    #: (n, 4, d) array [m]: quadrilateral between the two faces of each open joint, in space between the edges of the
    #: faces, where they are open: along the one on block a, then back along block b.
    cracks: np.ndarray
    openings: np.ndarray  #: (n, 2) array [m]: distance of the faces at both ends of each, unmagnified.
    #: (n,) bool array: which are open so wide that there is air between the faces, which alone are marked.
    gapes: np.ndarray
    joints: np.ndarray  #: (n,) int array, ascending: the joint of each.
    sliding: np.ndarray  #: (n, 2, d) array [m]: ends of each sliding joint, in space of the edges around it.
    exposed: list[np.ndarray]  #: (k, 3) arrays [m]: faces in space that slide, of both blocks.
    #: (n, 2, d) array [m]: ends of the line about which each hinge turns; the same twice for a point, as in the plane.
    hinges: np.ndarray
    crushing: np.ndarray  #: (n, d) array [m]: contact points that crush.

    @property
    def middles(self) -> np.ndarray:
        """(n, 2, d) array [m]: the line midway between the two faces of each crack."""
        return np.asarray((self.cracks[:, [0, 1]] + self.cracks[:, [3, 2]]) / 2.0)

    @property
    def gaping_faces(self) -> np.ndarray:
        """(m, 2, d) array [m]: the edges on block a, then those on block b, of what gapes."""
        wide = self.cracks[self.gapes]
        return np.concatenate([wide[:, [0, 1]], wide[:, [3, 2]]])


def marks_of(
    assembly: solver.Assembly, joints: InitialJoints, increment: solver.Increment, shown: solver.Pose
) -> Marks:
    """Cracks, and what hinges, slides and crushes in the mechanism of an increment, on blocks shown at a pose.

    That is the increment's own pose, a magnified one, or a later one.
    """
    contacts, mechanism = increment.contacts, mechanics.mechanism_of(assembly, increment)
    points = carried_between(contacts.points, contacts.block_a, contacts.block_b, increment.pose, shown)
    turning = points[hinge_ends(assembly, increment, mechanism)], points[mechanism.crushing_points]
    cracks = cracks_between(assembly, joints, increment.pose, shown, increment.fallen)
    if assembly.dimension == 2:
        return Marks(*cracks, sliding_lines(assembly, contacts, mechanism.sliding_points, points), [], *turning)
    return Marks(*cracks, *_sliding_faces(assembly, joints, mechanism, shown), *turning)


def cracks_between(
    assembly: solver.Assembly, joints: InitialJoints, pose: solver.Pose, shown: solver.Pose, fallen: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Cracks at a pose, where it is shown, their openings, which gape and their joints, as :class:`Marks` has them.

    Joints of blocks that have fallen (n_blocks,) are no cracks.
    """
    size, least, rings = assembly.block_size, SMALLEST_OPENING * assembly.block_size, joints.rings
    now, drawn = carried_faces(assembly, joints, pose, fallen), carried_faces(assembly, joints, shown)
    turn = np.linalg.norm(pose.rotations[joints.block_a] - pose.rotations[joints.block_b], axis=1)
    extent = joints.sizes ** (1.0 / (assembly.dimension - 1))
    # Faces that have slid far over each other still have a crack between them.
    nearest = -rings.largest(-now.gaps)
    parted = nearest >= np.minimum(extent, WIDEST * size)
    # A line in the plane has one edge, a polygon in space as many as corners.
    start = rings.offsets[:-1] if assembly.dimension == 2 else np.arange(len(rings.points))
    end, joint = rings.following[start], rings.ring[start]
    gaps = np.stack([now.gaps[start], now.gaps[end]], axis=1)
    is_open = gaps.max(axis=1) > least
    if assembly.dimension == 2:
        is_open &= ~parted[joint]
    start, end, gaps, joint = start[is_open], end[is_open], gaps[is_open], joint[is_open]
    # The faces are plane: the gap grows evenly along an edge, and the crack ends where it is small; in the plane, where
    # it tapers off as it is filled, where blocks that crush lie in each other.
    end_of_crack = least if assembly.dimension == 3 else 0.0
    cut = (end_of_crack - gaps[:, 0]) / np.where(gaps[:, 0] == gaps[:, 1], 1.0, gaps[:, 1] - gaps[:, 0])
    shares = np.where(gaps[:, 0] < end_of_crack, cut, 0.0), np.where(gaps[:, 1] < end_of_crack, cut, 1.0)
    first, last = (
        [of[start] + part[:, None] * (of[end] - of[start]) for of in (drawn.on_a, drawn.on_b)] for part in shares
    )
    openings = np.stack([gaps[:, 0] + part * (gaps[:, 1] - gaps[:, 0]) for part in shares], axis=1)
    gapes = turn[joint] > STEEPEST
    if assembly.dimension == 3:
        gapes |= parted[joint]
    return np.stack([first[0], last[0], last[1], first[1]], axis=1), openings, gapes, joint


def resultants(increment: solver.Increment) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Resultant of the contact forces of each pair of blocks, pressed or pulled.

    Gives the points (n, d) [m] where they cross the joints, at the increment's pose, by mortar maybe beside them, the
    forces (n, d) [N] on the first block of each pair, and the pairs (n, 2).
    """
    contacts, carrying = increment.contacts, np.flatnonzero(increment.forces.any(axis=1))
    sense = np.where(contacts.block_a > contacts.block_b, -1.0, 1.0)
    force = np.einsum("ki,kij->kj", increment.forces, contacts.frames) * sense[:, None]
    pairs, which = contacts[carrying].joints()
    forces, points, middles = np.zeros((3, len(pairs), contacts.points.shape[1]))
    normal, places = increment.forces[carrying, 0], contacts.points[carrying]
    np.add.at(forces, which, force[carrying])
    np.add.at(points, which, normal[:, None] * places)
    np.add.at(middles, which, places)
    middles /= np.bincount(which, minlength=len(pairs))[:, None]
    weight = np.bincount(which, weights=normal, minlength=len(pairs))
    reach = np.zeros(len(pairs))
    np.maximum.at(reach, which, np.linalg.norm(places - middles[which], axis=1))
    arms = points - weight[:, None] * middles
    crosses = (weight != 0.0) & (np.linalg.norm(arms, axis=1) <= BESIDE * reach * np.abs(weight))
    middles[crosses] += arms[crosses] / weight[crosses, None]
    return middles, forces, pairs


def joint_forces(increment: solver.Increment, kind: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Find points (n, d) [m], forces (n, d) [N] and blocks (n, 2) of the resultants, or by "points" of all contacts."""
    if kind == "thrust":
        return resultants(increment)
    contacts, carrying = increment.contacts, np.flatnonzero(increment.forces.any(axis=1))
    force = np.einsum("ki,kij->kj", increment.forces, contacts.frames)
    blocks = np.stack([contacts.block_a, contacts.block_b], axis=1)
    return contacts.points[carrying], force[carrying], blocks[carrying]


def thrust_line(points: np.ndarray, blocks: np.ndarray, assembly: solver.Assembly) -> np.ndarray:
    """(n, 2, d) array [m]: the line from joint to joint, where every block has two at most: an arch, a column."""
    owner = np.concatenate([blocks[:, 0], blocks[:, 1]])
    which = np.concatenate([np.arange(len(blocks))] * 2)
    counts = np.bincount(owner, minlength=assembly.n_blocks)
    if counts[assembly.free].max(initial=0) > 2:
        return np.zeros((0, 2, points.shape[1]))
    order = np.argsort(owner, kind="stable")
    owner, which = owner[order], which[order]
    pairs = (owner[1:] == owner[:-1]) & assembly.free[owner[1:]]
    return np.stack([points[which[:-1][pairs]], points[which[1:][pairs]]], axis=1)


def length_per_force(sizes: np.ndarray, largest: float, usual_length: float, extent: float) -> float:
    """Length per force [m/N] of resultants of some sizes (n,) [N] in a picture of an extent [m].

    Most are drawn up to the usual length: by the 0.9 quantile, not the largest, or one corner that carries everything
    would make all others too short to see. None is longer than 0.12 of the picture.
    """
    usual = float(np.quantile(sizes, 0.9)) if len(sizes) else largest
    return min(max(usual_length, 0.015 * extent) / usual, 0.12 * extent / largest)


def hinge_ends(assembly: solver.Assembly, increment: solver.Increment, mechanism: mechanics.Mechanism) -> np.ndarray:
    """(n, 2) int array: of each hinge the two contact points farthest from each other that do not open.

    In the plane it is one, twice.
    """
    contacts = increment.contacts
    if assembly.dimension == 2:
        return np.stack([mechanism.hinge_points, mechanism.hinge_points], axis=1)
    _, joint = contacts.joints()
    spins = increment.velocity[:, 3:]
    turning = np.linalg.norm(spins[contacts.block_a] - spins[contacts.block_b], axis=1) * assembly.block_size
    stays = np.abs(increment.displacements[:, 0]) <= ON_HINGE * turning
    stays &= contacts.gaps <= TOUCHING * assembly.block_size
    ends = np.zeros((len(mechanism.hinges), 2), dtype=int)
    for k, point in enumerate(mechanism.hinge_points):
        here = np.union1d(np.flatnonzero(stays & (joint == joint[point])), [point])
        places = contacts.points[here]
        apart = np.linalg.norm(places[:, None] - places[None], axis=2)
        ends[k] = here[list(np.unravel_index(int(apart.argmax()), apart.shape))]
    return ends


def _sliding_faces(
    assembly: solver.Assembly, joints: InitialJoints, mechanism: mechanics.Mechanism, shown: solver.Pose
) -> tuple[np.ndarray, list[np.ndarray]]:
    """Edges (n, 2, 3) around the faces that slide, and the faces themselves, of both blocks."""
    count = 1 + int(max(joints.block_b.max(initial=0), mechanism.sliding.max(initial=0)))
    slides = np.isin(joints.block_a * count + joints.block_b, mechanism.sliding[:, 0] * count + mechanism.sliding[:, 1])
    rings, faces = joints.rings, carried_faces(assembly, joints, shown)
    chosen = np.flatnonzero(slides[rings.ring])
    middle = (faces.on_a + faces.on_b) / 2.0
    edges = np.stack([middle[chosen], middle[rings.following[chosen]]], axis=1)
    exposed = [
        side[rings.offsets[k] : rings.offsets[k + 1]]
        for k in np.flatnonzero(slides).tolist()
        for side in (faces.on_a, faces.on_b)
    ]
    return edges, exposed


def settlement_arrows(
    assembly: solver.Assembly, settlement: solver.Settlement, pose: solver.Pose, seen: Frame | None = None
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Find where arrows show how supports move in a settlement, of which a picture in the plane shows what is ``seen``.

    Gives the supports (n,), one or a few of many for all, twice where they turn, the places (n, d) [m], in the plane
    inside the part of each that is seen, in space where the arrow leaves it, and the directions (n, d), to one scale:
    the longest is a unit vector.
    """
    d, rate = assembly.dimension, settlement.rate(assembly, solver.Pose.initial(assembly), 0.0)
    blocks = np.flatnonzero(settlement.taking_part(assembly) & rate.any(axis=1))
    if d == 2:
        blocks, places, extents = _seen_places(assembly, blocks, pose, seen)
    else:
        blocks = evenly(blocks, MOST_ARROWS)
        places = pose.positions[blocks]
        corners = [assembly.free[assembly.block_of_vertex], *(assembly.block_of_vertex == b for b in blocks)]
        extents = np.array([np.ptp(assembly.vertices[chosen], axis=0) for chosen in corners])
        # Of a slab that goes on beyond the structure nobody sees the ends.
        extents = np.minimum(extents[1:], extents[0].max())
    blocks, places = _with_ends(blocks, places, extents, rate[:, d:], pose)
    speeds = mechanics.point_velocities(places, blocks, pose, rate)
    sizes = np.linalg.norm(speeds, axis=1)
    largest = sizes.max(initial=0.0)
    moves = sizes > SMALLEST_RESULTANT * largest
    blocks, places, speeds, sizes = blocks[moves], places[moves], speeds[moves], sizes[moves]
    if d == 3:
        places = leaving(assembly, pose, blocks, places, speeds / sizes[:, None])
    return blocks, places, speeds / largest


def arrows_on_supports(
    assembly: solver.Assembly, settlement: solver.Settlement, pose: solver.Pose, seen: Frame | None, usual: float
) -> tuple[np.ndarray, np.ndarray]:
    """Tails and tips (n, 2) [m] of the arrows on supports in the plane, mostly of a usual length [m]."""
    blocks, places, directions = settlement_arrows(assembly, settlement, pose, seen)
    # Beside a wide structure one as long as usual would cover its support, and of one that turns both would cross.
    extents = np.array([np.ptp(assembly.outline(block), axis=0).max() for block in blocks.tolist()])
    longest = np.where(np.bincount(blocks)[blocks] > 1, 2.0 * END, 1.0) * extents
    half = 0.5 * np.clip(longest, usual / 3.0, usual)[:, None] * directions
    return places - half, places + half


def _with_ends(
    blocks: np.ndarray, places: np.ndarray, extents: np.ndarray, spins: np.ndarray, pose: solver.Pose
) -> tuple[np.ndarray, np.ndarray]:
    """Blocks and places with the two ends of each support that turns: one arrow would show it as pushed.

    They lie apart along the axis on which the speeds differ most, of those that turn with the support.
    """
    turning = spins[blocks].any(axis=1)
    axes, spin = _own_axes(pose, blocks[turning]), spins[blocks[turning]]
    differ = np.abs(spin) if extents.shape[1] == 2 else np.linalg.norm(np.cross(spin[:, None], axes), axis=2)
    differ = differ * extents[turning]
    # As many digits as do not tell the sides of a square apart, which turns.
    axis = np.round(differ / differ.max(axis=1, keepdims=True), 2).argmax(axis=1)
    row = np.arange(len(axis))
    end = END * extents[turning][row, axis, None] * axes[row, axis]
    twice = [blocks[~turning], blocks[turning], blocks[turning]]
    return np.concatenate(twice), np.concatenate([places[~turning], places[turning] - end, places[turning] + end])


def _own_axes(pose: solver.Pose, blocks: np.ndarray) -> np.ndarray:
    """(n, d, d) array: unit vectors that were the axes of the layout, row by row, and have turned with blocks."""
    return mechanics.rotation_matrices(pose.rotations[blocks]).transpose(0, 2, 1)


def _seen_places(
    assembly: solver.Assembly, blocks: np.ndarray, pose: solver.Pose, seen: Frame | None
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Blocks of the plane that are seen, of many evenly chosen ones; place inside and extent (n, 2) [m] of that.

    Extents are along the axes of the layout that turn with the block.
    """
    corners = mechanics.moved_vertices(assembly, pose)
    outlines = [shapely.Polygon(corners[assembly.offsets[b] : assembly.offsets[b + 1]]) for b in blocks]
    shown = outlines if seen is None else shapely.intersection(outlines, shapely.box(*seen.low, *seen.high))
    rows = evenly(np.flatnonzero(~shapely.is_empty(shown)), MOST_IN_PLANE)
    (places, extents), axes = np.zeros((2, len(rows), 2)), _own_axes(pose, blocks[rows])
    for row, k in enumerate(rows):
        extents[row] = np.ptp(shapely.get_coordinates(shown[k]) @ axes[row].T, axis=0)
        places[row] = place_in(shown[k])
    return blocks[rows], places, extents


def evenly(numbers: np.ndarray, most: int) -> np.ndarray:
    """(m,) array: at most so many of some numbers (n,), evenly chosen."""
    if len(numbers) <= most:
        return numbers
    return np.asarray(numbers[np.linspace(0, len(numbers) - 1, most).round().astype(int)])


def leaving(
    assembly: solver.Assembly, pose: solver.Pose, blocks: np.ndarray, places: np.ndarray, directions: np.ndarray
) -> np.ndarray:
    """(n, 3) array [m]: where lines through places (n, 3) [m] along unit vectors (n, 3) leave the blocks at most.

    Of a line that passes beside the box around its block the nearest of that.
    """
    corners, offsets = mechanics.moved_vertices(assembly, pose), assembly.polyhedra.offsets
    places = places.copy()
    for k, block in enumerate(blocks.tolist()):
        own, direction = corners[offsets[block] : offsets[block + 1]], directions[k]
        around = own - places[k]
        # Of a wide slab that tilts the corners are far off, the sides of the box around it are not.
        along = direction != 0.0
        box = (np.where(direction > 0.0, around.max(axis=0), around.min(axis=0))[along] / direction[along]).min()
        end = places[k] + min(float((around @ direction).max()), float(box)) * direction
        places[k] = np.clip(end, own.min(axis=0), own.max(axis=0))
    return places


def sliding_lines(
    assembly: solver.Assembly, contacts: mechanics.Contacts, k: np.ndarray, points: np.ndarray
) -> np.ndarray:
    """(n, 2, 2) array [m]: ends of the part of each sliding joint in the plane that slides.

    ``k`` are the numbers of the contact points that slide, ``points`` (n_contacts, 2) [m] where all of them are drawn.
    """
    pairs, which = contacts.joints()
    touching = np.split(np.argsort(which, kind="stable"), np.cumsum(np.bincount(which, minlength=len(pairs)))[:-1])
    found = []
    for joint in np.unique(which[k]).tolist():
        own = k[which[k] == joint]
        base, tangent = points[own[0]], contacts.frames[own[0], 1]
        # A joint that slides on one point only still needs a length to be seen, towards the others that it touches at.
        least = min(SHORTEST * assembly.block_size, float(assembly.widths[pairs[joint]].min()))
        low, high = _extent(points[own] - base, tangent)
        first, last = _extent(points[touching[joint]] - base, tangent)
        short = max(least - (high - low), 0.0)
        if last - first < short:
            low, high = low - short / 2.0, high + short / 2.0
        else:
            low, high = max(low - short, first), min(high + short, last)
        found.append(base + np.array([[low], [high]]) * tangent)
    return np.array(found).reshape(-1, 2, 2)


def _extent(arms: np.ndarray, tangent: np.ndarray) -> tuple[float, float]:
    """Lowest and highest of arms (n, 2) [m] along a tangent."""
    along = (arms * tangent).sum(axis=1)
    return float(along.min()), float(along.max())


def arrow_shapes(tails: np.ndarray, tips: np.ndarray, thick: float, grown: float) -> tuple[np.ndarray, np.ndarray]:
    """Shafts (n, 4, 2) and heads (n, 3, 2) of arrows, a margin ``grown`` larger all around [m]."""
    along = tips - tails
    length = np.hypot(*along.T)
    kept = length > SHORTEST_ARROW * thick
    tails, tips, along, length = tails[kept], tips[kept], along[kept], length[kept]
    unit = along / length[:, None]
    side = np.stack([-unit[:, 1], unit[:, 0]], axis=1)
    head = np.minimum(2.6 * thick, 0.6 * length)[:, None]
    neck = tips - head * unit
    half = thick / 2.0 + grown
    start = tails - grown * unit
    shafts = np.stack([start - half * side, neck - half * side, neck + half * side, start + half * side], axis=1)
    wing = 0.55 * head + 1.6 * grown
    back, tip = neck - grown * unit, tips + 2.0 * grown * unit
    heads = np.stack([back - wing * side, tip, back + wing * side], axis=1)
    return shafts, heads
