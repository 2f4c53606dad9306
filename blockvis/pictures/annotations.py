"""What a picture marks on the blocks: open and sliding joints, hinges, resultants, parts. Geometry, no rendering."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely

import solver
from blockvis.results.cracks import SMALLEST_OPENING
from blockvis.results.joints import InitialJoints, faces_at

#: What lies between faces is a crack until they are apart by this many block sizes, or by their own length: then the
#: blocks have parted, and it is air. Of faces that are turned against each other by more than this angle [rad] only the
#: edges have the colour of a crack: the wedge between them is open to the room.
WIDEST, STEEPEST = 0.5, 0.5

#: A sliding joint is marked over this length at least, in block sizes; no further than the thinner block is thick, or
#: the mark of a brick beside a large stone would lie outside both.
SHORTEST = 0.3

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
    faces : (n_faces, 2, 2) array [m]
        Ends of the faces of joints that gape too wide to be filled, two of each.
    sliding : (n_sliding, 2, 2) array [m]
        Ends of each sliding joint.
    hinges : (n_hinges, 2) array [m]
    """

    cracks: np.ndarray
    openings: np.ndarray
    faces: np.ndarray
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
    cracks, openings, faces = _cracks(assembly, joints, increment.pose, shown, increment.fallen)
    return Marks(
        cracks=cracks,
        openings=openings,
        faces=faces,
        sliding=_sliding(contacts, mechanism.sliding_points, points, assembly),
        hinges=points[mechanism.hinge_points],
    )


def resultants(increment: solver.Increment) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Resultant of the contact forces of each pair of blocks.

    Returns
    -------
    points : (n, d) array [m]
        Where the resultant crosses the joint, at the increment's pose.
    forces : (n, d) array [N]
        On ``blocks[:, 0]``.
    blocks : (n, 2) int array
    """
    contacts, carrying = increment.contacts, increment.forces[:, 0] > 0.0
    sense = np.where(contacts.block_a > contacts.block_b, -1.0, 1.0)
    force = np.einsum("ki,kij->kj", increment.forces, contacts.frames) * sense[:, None]
    pairs, which = contacts[carrying].joints()
    forces, points = np.zeros((2, len(pairs), contacts.points.shape[1]))
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
    assembly: solver.Assembly, joints: InitialJoints, pose: solver.Pose, shown: solver.Pose, fallen: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Quadrilaterals of the open joints, their openings [m], and the faces of those that gape too wide."""
    on_a, on_b, normal = faces_at(assembly, joints, pose)
    length = np.hypot(*(joints.ends[:, 1] - joints.ends[:, 0]).T)
    opening = np.einsum("nij,nj->ni", on_a - on_b, normal).max(axis=1)
    apart = np.hypot(*np.moveaxis(on_a - on_b, 2, 0)).min(axis=1)
    turn = np.abs(pose.rotations[joints.block_a] - pose.rotations[joints.block_b])[:, 0]
    is_open = opening > SMALLEST_OPENING * assembly.block_size
    is_open &= ~(fallen[joints.block_a] | fallen[joints.block_b])
    is_open &= apart < np.minimum(length, WIDEST * assembly.block_size)
    narrow, wide = is_open & (turn <= STEEPEST), is_open & (turn > STEEPEST)
    on_a, on_b, _ = faces_at(assembly, joints, shown)
    filled = np.concatenate([on_a, on_b[:, ::-1]], axis=1)[narrow]
    return filled, opening[narrow], np.concatenate([on_a[wide], on_b[wide]])


def joint_marks(assembly: solver.Assembly, increment: solver.Increment) -> tuple[np.ndarray, np.ndarray]:
    """Where the hinges are, (n, 2) [m], and the ends of the sliding joints, (n, 2, 2) [m], at the increment's pose."""
    mechanism, contacts = solver.mechanism_of(assembly, increment), increment.contacts
    return contacts.points[mechanism.hinge_points], _sliding(
        contacts, mechanism.sliding_points, contacts.points, assembly
    )


def settlement_arrows(
    assembly: solver.Assembly, settlement: solver.Settlement, pose: solver.Pose, low: np.ndarray, high: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Find where arrows show how supports move in a settlement.

    Parameters
    ----------
    assembly : solver.Assembly
    settlement : solver.Settlement
    pose : solver.Pose
    low, high : (2,) arrays [m]
        Corners of what the picture shows.

    Returns
    -------
    blocks : (n,) int array
        The supports; of more than four, the one in the middle stands for all.
    places : (n, 2) array [m]
        Inside the part of each that the picture shows.
    directions : (n, 2) array
        Unit vectors; zero where a support turns about that place.
    """
    part = np.flatnonzero(settlement.taking_part(assembly))
    rate = settlement.rate(assembly, solver.Pose.initial(assembly), 0.0)
    corners = solver.moved_vertices(assembly, pose)
    outlines = [shapely.Polygon(corners[assembly.offsets[b] : assembly.offsets[b + 1]]) for b in part]
    shown = shapely.intersection(outlines, shapely.box(*low, *high))
    seen = [k for k, outline in enumerate(shown) if not outline.is_empty]
    if len(seen) > 4:
        seen = [seen[len(seen) // 2]]
    places = np.zeros((len(seen), 2))
    for row, k in enumerate(seen):
        # A bent support may have its centroid outside.
        inside = shown[k].centroid if shown[k].contains(shown[k].centroid) else shown[k].point_on_surface()
        places[row] = inside.coords[0]
    blocks = part[seen]
    speeds = solver.point_velocities(places, blocks, pose, rate)
    sizes = np.hypot(*speeds.T)[:, None]
    return blocks, places, np.divide(speeds, sizes, out=np.zeros_like(speeds), where=sizes > 0.0)


def _sliding(contacts: solver.Contacts, k: np.ndarray, points: np.ndarray, assembly: solver.Assembly) -> np.ndarray:
    """(n, 2, 2) array [m]: ends of the part of each sliding joint that slides.

    Parameters
    ----------
    contacts : Contacts
    k : (k,) int array
        Numbers of the contact points that slide.
    points : (n_contacts, 2) array [m]
        Where the contact points are drawn.
    assembly : solver.Assembly
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
    # A joint that slides on one point only still needs a length to be seen, towards the others that it touches at.
    least = np.minimum(SHORTEST * assembly.block_size, assembly.widths[pairs].min(axis=1))
    short = np.maximum(least - (highest - lowest), 0.0)
    face_low, face_high = _extents(contacts, points, pairs, points[first], tangent)
    alone = face_high - face_low < short
    lowest = np.where(alone, lowest - short / 2.0, np.maximum(lowest - short, np.minimum(face_low, lowest)))
    highest = np.where(alone, highest + short / 2.0, np.minimum(highest + short, np.maximum(face_high, highest)))
    base = points[first]
    return np.stack([base + lowest[:, None] * tangent, base + highest[:, None] * tangent], axis=1)


def _extents(
    contacts: solver.Contacts, points: np.ndarray, pairs: np.ndarray, base: np.ndarray, tangent: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Lowest and highest place, (n,) [m], of all contact points of pairs of blocks along their tangents."""
    every, which = contacts.joints()
    count = int(every.max(initial=0)) + 1
    row = np.searchsorted(every[:, 0] * count + every[:, 1], pairs[:, 0] * count + pairs[:, 1])
    number = np.full(len(every), -1)
    number[row] = np.arange(len(pairs))
    k = number[which]
    here = k >= 0
    place = ((points[here] - base[k[here]]) * tangent[k[here]]).sum(axis=1)
    low, high = np.full(len(pairs), np.inf), np.full(len(pairs), -np.inf)
    np.minimum.at(low, k[here], place)
    np.maximum.at(high, k[here], place)
    return low, high
