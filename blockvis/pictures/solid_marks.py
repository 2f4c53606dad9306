"""What a picture marks on blocks in space: cracks, hinges, sliding faces, arrows. Geometry, no rendering."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

import solver
from blockvis.results.joint_faces import TOUCHING, InitialJoints
from blockvis.results.joints import carried_faces

from .annotations import SMALLEST_OPENING, STEEPEST, WIDEST

#: Contact points turn about a hinge where they open slower than this part of the turning times the block size.
ON_HINGE = 0.05

#: Settlement arrows of at most so many supports; of more, evenly chosen ones stand for all.
MOST_ARROWS = 24


@dataclass(frozen=True)
class SolidMarks:
    """What is marked at one pose.

    Attributes
    ----------
    cracks : (n, 4, 3) array [m]
        Quadrilaterals between the edges of the two faces of open joints, where they are open: along the one on block a,
        back along the one on block b.
    openings : (n, 2) array [m]
        Distance of the faces at both ends of each, unmagnified.
    gapes : (n,) bool array
        Where the joint is open so wide that there is air in it, not a crack.
    sliding : (n, 2, 3) array [m]
        Edges around the faces that slide.
    exposed : list of (k, 3) arrays [m]
        Faces that slide, of both blocks.
    hinges : (n, 2, 3) array [m]
        Ends of the line about which each hinge turns; the same twice for a point.
    """

    cracks: np.ndarray
    openings: np.ndarray
    gapes: np.ndarray
    sliding: np.ndarray
    exposed: list[np.ndarray]
    hinges: np.ndarray


def solid_marks(
    assembly: solver.Assembly, joints: InitialJoints, increment: solver.Increment, shown: solver.Pose
) -> SolidMarks:
    """Cracks, sliding faces and hinges of an increment, on blocks shown at a pose.

    Parameters
    ----------
    assembly : solver.Assembly
    joints : InitialJoints
    increment : solver.Increment
        Its mechanism has the hinges and sliding joints.
    shown : solver.Pose
        Where the blocks are drawn: the increment's own pose, a magnified one, or a later one.
    """
    size = assembly.block_size
    now, drawn = carried_faces(assembly, joints, increment.pose), carried_faces(assembly, joints, shown)
    rings = joints.rings
    start, end = np.arange(len(rings.points)), rings.following
    gaps = np.stack([now.gaps[start], now.gaps[end]], axis=1)
    least = SMALLEST_OPENING * size
    is_open = gaps.max(axis=1) > least
    start, end, gaps = start[is_open], end[is_open], gaps[is_open]
    # The faces are plane: the gap grows evenly along an edge, and the crack ends where it is small.
    step = np.where(np.abs(gaps[:, 1] - gaps[:, 0]) > 0.0, gaps[:, 1] - gaps[:, 0], 1.0)
    cut = (least - gaps[:, 0]) / step
    first = np.where(gaps[:, 0] < least, cut, 0.0)
    last = np.where(gaps[:, 1] < least, cut, 1.0)

    def between(points: np.ndarray, share: np.ndarray) -> np.ndarray:
        return points[start] + share[:, None] * (points[end] - points[start])

    cracks = np.stack(
        [between(drawn.on_a, first), between(drawn.on_a, last), between(drawn.on_b, last), between(drawn.on_b, first)],
        axis=1,
    )
    openings = np.stack([gaps[:, 0] + share * (gaps[:, 1] - gaps[:, 0]) for share in (first, last)], axis=1)
    joint = rings.ring[start]
    extent = np.sqrt(np.maximum(rings.areas(), 1e-300))
    turn = np.linalg.norm(increment.pose.rotations[joints.block_a] - increment.pose.rotations[joints.block_b], axis=1)
    nearest = -rings.largest(-now.gaps)
    gapes = (turn > STEEPEST) | (nearest > np.minimum(WIDEST * size, extent))
    mechanism = solver.mechanism_of(assembly, increment)
    edges, exposed = _sliding_faces(joints, mechanism, drawn.on_a, drawn.on_b)
    hinges = hinge_lines(assembly, increment, mechanism)
    contacts = increment.contacts
    ends = [
        solver.carried_between(
            contacts.points[hinges[:, k]],
            contacts.block_a[hinges[:, 0]],
            contacts.block_b[hinges[:, 0]],
            increment.pose,
            shown,
        )
        for k in (0, 1)
    ]
    return SolidMarks(cracks, openings, gapes[joint], edges, exposed, np.stack(ends, axis=1))


def hinge_lines(assembly: solver.Assembly, increment: solver.Increment, mechanism: solver.Mechanism) -> np.ndarray:
    """(n, 2) int array: of each hinge the two contact points farthest from each other that do not open.

    Parameters
    ----------
    assembly : solver.Assembly
    increment : solver.Increment
    mechanism : solver.Mechanism
    """
    contacts = increment.contacts
    pairs, joint = contacts.joints()
    count = assembly.n_blocks
    known = pairs[:, 0] * count + pairs[:, 1]
    spins = increment.velocity[:, 3:]
    turning = np.linalg.norm(spins[contacts.block_a] - spins[contacts.block_b], axis=1) * assembly.block_size
    stays = np.abs(increment.displacements[:, 0]) <= ON_HINGE * turning
    stays &= contacts.gaps <= TOUCHING * assembly.block_size
    ends = np.zeros((len(mechanism.hinges), 2), dtype=int)
    for k, ((a, b), point) in enumerate(zip(mechanism.hinges, mechanism.hinge_points, strict=True)):
        here = np.flatnonzero(stays & (joint == np.searchsorted(known, a * count + b)))
        here = np.union1d(here, [point])
        places = contacts.points[here]
        apart = np.linalg.norm(places[:, None] - places[None], axis=2)
        ends[k] = here[list(np.unravel_index(int(apart.argmax()), apart.shape))]
    return ends


def _sliding_faces(
    joints: InitialJoints, mechanism: solver.Mechanism, on_a: np.ndarray, on_b: np.ndarray
) -> tuple[np.ndarray, list[np.ndarray]]:
    """Edges (n, 2, 3) around the faces that slide, and the faces themselves, of both blocks."""
    count = 1 + int(max(joints.block_b.max(initial=0), mechanism.sliding.max(initial=0)))
    slides = np.isin(joints.block_a * count + joints.block_b, mechanism.sliding[:, 0] * count + mechanism.sliding[:, 1])
    rings = joints.rings
    chosen = np.flatnonzero(slides[rings.ring])
    middle = (on_a + on_b) / 2.0
    edges = np.stack([middle[chosen], middle[rings.following[chosen]]], axis=1)
    faces = [
        side[rings.offsets[k] : rings.offsets[k + 1]] for k in np.flatnonzero(slides).tolist() for side in (on_a, on_b)
    ]
    return edges, faces


def settlement_arrows_in_space(
    assembly: solver.Assembly, settlement: solver.Settlement, pose: solver.Pose
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Find where arrows show how supports move in a settlement.

    Parameters
    ----------
    assembly : solver.Assembly
    settlement : solver.Settlement
    pose : solver.Pose

    Returns
    -------
    blocks : (n,) int array
    places : (n, 3) array [m]
        Where the arrow leaves the support.
    directions : (n, 3) array
        Unit vectors.
    """
    part = np.flatnonzero(settlement.taking_part(assembly))
    rate = settlement.rate(assembly, solver.Pose.initial(assembly), 0.0)
    speeds = solver.point_velocities(pose.positions[part], part, pose, rate)
    sizes = np.linalg.norm(speeds, axis=1)
    part, speeds, sizes = part[sizes > 0.0], speeds[sizes > 0.0], sizes[sizes > 0.0]
    if len(part) > MOST_ARROWS:
        some = np.linspace(0, len(part) - 1, MOST_ARROWS).round().astype(int)
        part, speeds, sizes = part[some], speeds[some], sizes[some]
    directions = speeds / sizes[:, None]
    return part, _leaving(assembly, pose, part, directions), directions


def live_arrows(
    assembly: solver.Assembly, loads: solver.Loads, multiplier: float, pose: solver.Pose
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Find where arrows show the live loads: they end where they meet the blocks.

    Parameters
    ----------
    assembly : solver.Assembly
    loads : solver.Loads
    multiplier : float
        Of the live loads; where it is negative they point the other way.
    pose : solver.Pose

    Returns
    -------
    tips : (n, 3) array [m]
    directions : (n, 3) array
        Unit vectors.
    sizes : (n,) array [N]
    """
    forces = loads.live[:, :3] * multiplier
    sizes = np.linalg.norm(forces, axis=1)
    blocks = np.flatnonzero((sizes > 1e-3 * sizes.max(initial=0.0)) & assembly.free)
    if len(blocks) > MOST_ARROWS:
        blocks = blocks[np.linspace(0, len(blocks) - 1, MOST_ARROWS).round().astype(int)]
    directions = forces[blocks] / sizes[blocks, None]
    return _leaving(assembly, pose, blocks, -directions), directions, sizes[blocks]


def _leaving(assembly: solver.Assembly, pose: solver.Pose, blocks: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """(n, 3) array [m]: as far from the centroids of blocks along directions (n, 3) as their corners lie."""
    corners, offsets = solver.moved_vertices(assembly, pose), assembly.polyhedra.offsets
    places = pose.positions[blocks].copy()
    for k, block in enumerate(blocks.tolist()):
        reach = (corners[offsets[block] : offsets[block + 1]] - places[k]) @ directions[k]
        places[k] += max(float(reach.max()), 0.0) * directions[k]
    return places
