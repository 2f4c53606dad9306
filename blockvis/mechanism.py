"""Which blocks of a mechanism move together as one body."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.sparse as sp
import shapely
from scipy.sparse.csgraph import connected_components

import solver

__all__ = ["part_outlines", "rigid_parts", "swung", "with_motion"]

#: Blocks belong together where their contact points move apart by less than this fraction of the fastest block.
TOGETHER = 1e-3


def with_motion(increment: solver.Increment, motion: np.ndarray) -> solver.Increment:
    """The increment with its hinges and sliding joints those of another motion.

    Parameters
    ----------
    increment : solver.Increment
    motion : (n_blocks, 3) array
        Velocity of each centroid and angular velocity, in any scale.
    """
    contacts, pose = increment.contacts, increment.pose

    def velocity(block: np.ndarray) -> np.ndarray:
        arm = contacts.points - pose.positions[block]
        return motion[block, :2] + motion[block, 2:] * np.stack([-arm[:, 1], arm[:, 0]], axis=1)

    relative = velocity(contacts.block_a) - velocity(contacts.block_b)
    return replace(increment, velocity=motion, displacements=np.einsum("kij,kj->ki", contacts.frames, relative))


def swung(pose: solver.Pose, motion: np.ndarray) -> solver.Pose:
    """The pose after each block turned about its own pole, so that blocks that move together stay together.

    Parameters
    ----------
    pose : solver.Pose
    motion : (n_blocks, 3) array
        Translation of the centroid [m] and rotation [rad], as a linear program has them.
    """
    angle = motion[:, 2]
    turns = np.abs(angle) > 1e-9
    safe = np.where(turns, angle, 1.0)
    arm = np.stack([motion[:, 1] / safe, -motion[:, 0] / safe], axis=1)
    c, s = np.cos(angle) - 1.0, np.sin(angle)
    arc = np.stack([c * arm[:, 0] - s * arm[:, 1], s * arm[:, 0] + c * arm[:, 1]], axis=1)
    return solver.Pose(pose.positions + np.where(turns[:, None], arc, motion[:, :2]), pose.rotations + angle)


def rigid_parts(assembly: solver.Assembly, increment: solver.Increment) -> np.ndarray:
    """(n_blocks,) int array: the part each block moves with in the motion that follows an increment.

    Part -1 stands still. The others are numbered from 0, the largest area first.
    """
    contacts = increment.contacts
    fastest = float(np.abs(increment.velocity[:, :2]).max(initial=0.0))
    if fastest == 0.0:
        return np.full(assembly.n_blocks, -1)
    low, high = np.minimum(contacts.block_a, contacts.block_b), np.maximum(contacts.block_a, contacts.block_b)
    pair, which = np.unique(low.astype(np.int64) * assembly.n_blocks + high, return_inverse=True)
    apart = np.zeros(len(pair))
    np.maximum.at(apart, which.ravel(), np.abs(increment.displacements).max(axis=1))
    spin = np.abs(increment.velocity[pair // assembly.n_blocks, 2] - increment.velocity[pair % assembly.n_blocks, 2])
    together = (apart < TOGETHER * fastest) & (spin * assembly.block_size < TOGETHER * fastest)
    a, b = (pair // assembly.n_blocks)[together], (pair % assembly.n_blocks)[together]
    graph = sp.coo_array((np.ones(len(a)), (a, b)), shape=(assembly.n_blocks, assembly.n_blocks))
    _, part = connected_components(graph, directed=False)
    # Corners, not centroids: a block may turn about its own centroid.
    reach = np.abs(increment.velocity[:, 2]) * assembly.block_size
    moves = np.maximum(np.abs(increment.velocity[:, :2]).max(axis=1), reach) > 10.0 * TOGETHER * fastest
    moves &= assembly.free
    area = np.bincount(part, weights=assembly.areas * moves, minlength=int(part.max()) + 1)
    rank = np.empty(len(area), dtype=int)
    rank[np.argsort(-area, kind="stable")] = np.arange(len(area))
    return np.where(moves, rank[part], -1)


def part_outlines(assembly: solver.Assembly, corners: np.ndarray, parts: np.ndarray) -> np.ndarray:
    """(n, 2, 2) array [m]: edges of the outline around each part, its blocks merged.

    Parameters
    ----------
    assembly : solver.Assembly
    corners : (n_vertices, 2) array [m]
    parts : (n_blocks,) int array
        As :func:`rigid_parts` gives them.
    """
    edges = [np.zeros((0, 2, 2))]
    # Faces that touch leave slivers where the last digit differs: grown together, then shrunk back.
    seam = 1e-3 * assembly.block_size
    for part in range(int(parts.max(initial=-1)) + 1):
        blocks = np.flatnonzero(parts == part)
        outlines = [shapely.Polygon(corners[assembly.offsets[b] : assembly.offsets[b + 1]]) for b in blocks]
        merged = shapely.union_all(shapely.buffer(outlines, seam, join_style="mitre"))
        merged = shapely.buffer(merged, -seam, join_style="mitre").simplify(0.1 * seam)
        for polygon in shapely.get_parts(merged):
            for ring in shapely.get_rings(polygon):
                points = shapely.get_coordinates(ring)
                edges.append(np.stack([points[:-1], points[1:]], axis=1))
    return np.concatenate(edges)
