"""What a picture marks on the blocks: open and sliding joints, hinges, resultants, parts. Geometry, no rendering."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely

import solver
from blockvis.results.joints import InitialJoints

#: A joint is shown open from this fraction of the block size on; on an ordinary brick it is a tenth of a millimetre.
SMALLEST_OPENING = 1e-3

#: What lies between faces is a crack up to this distance: on the path, in block sizes or lengths of the joint; in
#: the fall, where blocks tumble apart, in lengths of the joint only, and up to this angle [rad].
WIDEST_STANDING, WIDEST_FALLING, STEEPEST_FALLING = 1.5, 0.6, 1.0

#: What cracks and blocks enclose without covering it belongs to the cracks from this fraction of the block size squared
#: (what is smaller is rounding) up to that: where several cracks meet.
SMALLEST_POCKET, LARGEST_POCKET = 1e-5, 2.0

#: Resultants below this fraction of the largest are not drawn.
SMALLEST_RESULTANT = 2e-3

#: Blocks of one part are grown by this fraction of the block size, merged and shrunk back: between faces that touch,
#: the last digit leaves slivers otherwise.
SLIVER = 1e-3


def part_outlines(assembly: solver.Assembly, corners: np.ndarray, parts: np.ndarray) -> np.ndarray:
    """(n, 2, 2) array [m]: edges of the outline around each part, its blocks merged.

    Parameters
    ----------
    assembly : solver.Assembly
    corners : (n_vertices, 2) array [m]
    parts : (n_blocks,) int array
        As ``solver.rigid_parts`` gives them.
    """
    edges = [np.zeros((0, 2, 2))]
    margin = SLIVER * assembly.block_size
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
    """What is marked at one pose.

    Attributes
    ----------
    cracks : (n_cracks, 4, 2) array [m]
        Quadrilateral between the faces of each open joint: both ends on block a, then back along block b.
    openings : (n_cracks,) array [m]
        Largest distance of the two faces of each, unmagnified.
    pockets : tuple of (n, 2) arrays [m]
        Outlines of what is enclosed where cracks meet.
    sliding : (n_sliding, 2, 2) array [m]
        Ends of each sliding joint.
    hinges : (n_hinges, 2) array [m]
    """

    cracks: np.ndarray
    openings: np.ndarray
    pockets: tuple[np.ndarray, ...]
    sliding: np.ndarray
    hinges: np.ndarray


def marks_of(
    assembly: solver.Assembly, joints: InitialJoints, increment: solver.Increment, shown: solver.Pose
) -> Marks:
    """Cracks, sliding joints and hinges of an increment, on blocks shown at a pose.

    Parameters
    ----------
    assembly : solver.Assembly
    joints : InitialJoints
    increment : solver.Increment
        Its mechanism has the hinges and sliding joints.
    shown : solver.Pose
        Where the blocks are drawn: the increment's own pose, or a magnified one.
    """
    contacts, mechanism = increment.contacts, solver.mechanism_of(assembly, increment)
    points = solver.carried_between(contacts.points, contacts.block_a, contacts.block_b, increment.pose, shown)
    falling = increment.status == solver.Status.FALLING
    cracks, openings, cracked = _cracks(assembly, joints, increment.pose, shown, falling)
    return Marks(
        cracks=cracks,
        openings=openings,
        pockets=() if falling else _pockets(assembly, cracks, cracked, shown),
        sliding=_sliding(contacts, mechanism.sliding_points, points),
        hinges=points[mechanism.hinge_points],
    )


def resultants(increment: solver.Increment) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Resultant of the contact forces of each pair of blocks.

    Returns
    -------
    points : (n, 2) array [m]
        Where the resultant crosses the joint, at the increment's pose.
    forces : (n, 2) array [N]
        On ``blocks[:, 0]``.
    blocks : (n, 2) int array
    """
    contacts, carrying = increment.contacts, increment.forces[:, 0] > 0.0
    sense = np.where(contacts.block_a > contacts.block_b, -1.0, 1.0)
    force = np.einsum("ki,kij->kj", increment.forces, contacts.frames) * sense[:, None]
    pairs, which = contacts[carrying].joints()
    forces, points = np.zeros((len(pairs), 2)), np.zeros((len(pairs), 2))
    normal = increment.forces[carrying, 0]
    np.add.at(forces, which, force[carrying])
    np.add.at(points, which, normal[:, None] * contacts.points[carrying])
    weight = np.bincount(which, weights=normal, minlength=len(pairs))
    return points / weight[:, None], forces, pairs


def length_per_force(sizes: np.ndarray, largest: float, usual_length: float, extent: float) -> float:
    """Length per force [m/N] of resultants in a picture.

    Most are drawn up to the usual length: by the 0.9 quantile, not the largest, or one corner that carries everything
    would make all others too short to see. None is longer than 0.12 of the picture.

    Parameters
    ----------
    sizes : (n,) array [N]
        Of the resultants that are drawn.
    largest : float [N]
    usual_length : float [m]
    extent : float [m]
        Of the picture.
    """
    usual = float(np.quantile(sizes, 0.9)) if len(sizes) else largest
    return min(max(usual_length, 0.015 * extent) / usual, 0.12 * extent / largest)


def _cracks(
    assembly: solver.Assembly, joints: InitialJoints, pose: solver.Pose, shown: solver.Pose, falling: bool
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Quadrilaterals of the open joints, their openings [m], and the blocks beside them."""
    initial = solver.Pose.initial(assembly)

    def sides(at: solver.Pose) -> tuple[np.ndarray, np.ndarray]:
        on_a = np.stack([solver.carried(joints.ends[:, k], joints.block_a, initial, at) for k in (0, 1)], axis=1)
        on_b = np.stack([solver.carried(joints.ends[:, k], joints.block_b, initial, at) for k in (0, 1)], axis=1)
        return on_a, on_b

    on_a, on_b = sides(pose)
    normal = solver.turned(joints.normals, pose.rotations[joints.block_b])
    length = np.hypot(*(joints.ends[:, 1] - joints.ends[:, 0]).T)
    opening = np.einsum("nij,nj->ni", on_a - on_b, normal).max(axis=1)
    apart = np.hypot(*np.moveaxis(on_a - on_b, 2, 0)).min(axis=1)
    # Blocks that have parted altogether have no joint any more: what lies between them is air, not a crack.
    if falling:
        turn = np.abs(pose.rotations[joints.block_a] - pose.rotations[joints.block_b])[:, 0]
        together = (apart < WIDEST_FALLING * length) & (turn < STEEPEST_FALLING)
    else:
        together = apart < np.maximum(length, WIDEST_STANDING * assembly.block_size)
    is_open = (opening > SMALLEST_OPENING * assembly.block_size) & together
    on_a, on_b = sides(shown)
    beside = np.unique(np.concatenate([joints.block_a[is_open], joints.block_b[is_open]]))
    return np.concatenate([on_a, on_b[:, ::-1]], axis=1)[is_open], opening[is_open], beside


def _pockets(
    assembly: solver.Assembly, cracks: np.ndarray, cracked: np.ndarray, shown: solver.Pose
) -> tuple[np.ndarray, ...]:
    """Find what several cracks enclose that lies between no two faces: the corner that a brick has moved out of."""
    if len(cracks) < 2:
        return ()
    size = assembly.block_size
    corners = solver.moved_vertices(assembly, shown)
    blocks = [corners[assembly.offsets[b] : assembly.offsets[b + 1]] for b in range(assembly.n_blocks)]
    # A crack crosses itself where one end has closed up: its hull is taken. It is widened by the smallest opening, or a
    # joint that is not quite open would leave the pocket without a wall on that side.
    filled = shapely.buffer(
        shapely.convex_hull(shapely.multipoints(cracks)), SMALLEST_OPENING * size, join_style="mitre", quad_segs=1
    )
    near = [shapely.Polygon(blocks[b]) for b in cracked]
    covered = shapely.union_all([*shapely.buffer(near, 0.0), *filled])
    holes = [
        shapely.Polygon(ring)
        for part in shapely.get_parts(covered)
        for ring in part.interiors
        if SMALLEST_POCKET * size**2 < shapely.Polygon(ring).area < LARGEST_POCKET * size**2
    ]
    if not holes:
        return ()
    # Openings of the layout are no pockets, nor are places where blocks without a crack stand.
    tree = shapely.STRtree([shapely.Polygon(outline) for outline in blocks])
    laid_out = shapely.STRtree([shapely.Polygon(assembly.outline(b)) for b in range(assembly.n_blocks)])
    pockets = []
    for hole in holes:
        inside = hole.representative_point()
        if len(tree.query(inside, predicate="intersects")) == 0 and len(laid_out.query(inside, predicate="intersects")):
            pockets.append(shapely.get_coordinates(hole)[:-1])
    return tuple(pockets)


def joint_places(assembly: solver.Assembly, increment: solver.Increment) -> tuple[np.ndarray, np.ndarray]:
    """Where the hinges are, and the middles of the sliding joints: (n, 2) arrays [m], at the increment's pose."""
    mechanism, contacts = solver.mechanism_of(assembly, increment), increment.contacts
    stretches = _sliding(contacts, mechanism.sliding_points, contacts.points)
    return contacts.points[mechanism.hinge_points], stretches.mean(axis=1)


def _sliding(contacts: solver.Contacts, k: np.ndarray, points: np.ndarray) -> np.ndarray:
    """(n, 2, 2) array [m]: ends of the part of each sliding joint that slides.

    Parameters
    ----------
    contacts : Contacts
    k : (k,) int array
        Numbers of the contact points that slide.
    points : (n_contacts, 2) array [m]
        Where the contact points are drawn.
    """
    if len(k) == 0:
        return np.zeros((0, 2, 2))
    pairs, which = contacts[k].joints()
    n = len(pairs)
    first = np.zeros(n, dtype=int)
    first[which[::-1]] = k[::-1]
    tangent = contacts.frames[first, 1]
    place = ((points[k] - points[first][which]) * tangent[which]).sum(axis=1)
    lowest, highest = np.zeros(n), np.zeros(n)
    np.minimum.at(lowest, which, place)
    np.maximum.at(highest, which, place)
    # A joint that slides on one point only still needs a length to be seen.
    short = 0.15 * np.median(highest - lowest) if (highest > lowest).any() else 0.0
    lowest, highest = lowest - short, highest + short
    base = points[first]
    return np.stack([base + lowest[:, None] * tangent, base + highest[:, None] * tangent], axis=1)
