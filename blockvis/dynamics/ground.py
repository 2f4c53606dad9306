"""The ground on which what falls comes to lie."""

from __future__ import annotations

import numpy as np

import solver
from solver import mechanics

#: Name of the slab that is the ground.
GROUND = "ground"

#: Faces of supports steeper than 1 in this are walls, not places to lie on; the ground lies no deeper below the
#: structure than this part of its height, however far supports reach down that are wider than tall.
STEEP, DEEPEST = 0.3, 0.25

#: Clearance between the ground and the lowest corner, in block sizes: what stands on a support stands on that alone.
CLEARANCE = 1e-3


def ground_below(assembly: solver.Assembly, pose: solver.Pose) -> float:
    """Height of the ground [m]: below the lowest corner, in the plane of the lowest place where something may lie.

    Supports that are taller than wide are piers, and stand on the ground; others are the ground.
    """
    corners, free = mechanics.moved_vertices(assembly, pose), assembly.free[assembly.block_of_vertex]
    low, high = corners[free, -1].min(), corners[free, -1].max()
    ground = low
    if assembly.dimension == 2:
        following = corners[assembly.next_vertex]
        # The outward normal of an edge points up where the edge runs to the left.
        upward = ~free & (corners[:, 0] - following[:, 0] > STEEP * np.abs(following[:, 1] - corners[:, 1]))
        faces = np.minimum(corners[upward, 1], following[upward, 1])
        ground = min(max(faces.min(initial=low), low - DEEPEST * (high - low)), low)
    drawn = [assembly.vertices[assembly.block_of_vertex == block] for block in np.flatnonzero(~assembly.free)]
    feet = [corners[:, -1].min() for corners in drawn if (np.ptp(corners, axis=0)[:-1] < np.ptp(corners[:, -1])).all()]
    return float(min([ground, *feet])) - CLEARANCE * assembly.block_size


def on_ground(assembly: solver.Assembly, pose: solver.Pose, ground: float) -> tuple[solver.Assembly, solver.Pose]:
    """Add a slab as wide as anything can get, as the last block.

    Parameters
    ----------
    assembly : solver.Assembly
    pose : solver.Pose
    ground : float [m]
        Height of its upper face.
    """
    corners, d = mechanics.moved_vertices(assembly, pose), assembly.dimension
    middle, size = corners.mean(axis=0), 4.0 * float(np.ptp(corners, axis=0).max())
    low = np.append(middle[:-1] - size, ground - 0.5 * assembly.block_size)
    high = np.append(middle[:-1] + size, ground)
    slab = np.array([[(low, high)[k >> axis & 1][axis] for axis in range(d)] for k in range(2**d)])
    supports = np.flatnonzero(~assembly.free)
    names = [*assembly.names, GROUND]
    roles = [*(mechanics.FREE if free else mechanics.FIXED for free in assembly.free), mechanics.FIXED]
    materials = [*assembly.materials, assembly.materials[int(supports[0])] if len(supports) else ""]
    density = np.append(assembly.density, 1.0)
    if d == 2:
        outlines = [*(assembly.outline(block) for block in range(assembly.n_blocks)), slab[[0, 1, 3, 2]]]
        thickness = np.append(assembly.thickness, assembly.thickness.max())
        whole = solver.Assembly.from_outlines(
            outlines, names=names, roles=roles, density=density, thickness=thickness, materials=materials
        )
    else:
        faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]]
        solids = [*(assembly.polyhedra.surface(block) for block in range(assembly.n_blocks)), (slab, faces)]
        whole = solver.Assembly.from_solids(solids, names=names, roles=roles, density=density, materials=materials)
    turns = np.append(pose.rotations, np.zeros((1, pose.rotations.shape[1])), axis=0)
    return whole, solver.Pose(np.vstack([pose.positions, whole.centroids[-1:]]), turns)
