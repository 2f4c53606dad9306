"""Which blocks of a mechanism move together as one body."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import shapely

import solver

__all__ = ["part_outlines", "swung", "with_motion"]


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
