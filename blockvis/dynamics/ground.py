"""The ground on which what falls comes to lie."""

from __future__ import annotations

import numpy as np

import solver
from blockvis.layout.layout import assembly_of, layout_of
from blockvis.layout.outlines import rectangle
from blockvis.layout.solids import box
from solver import mechanics

#: Name of the slab that is the ground.
GROUND = "ground"

#: Faces of supports steeper than 1 in this are walls, not places to lie on.
STEEP = 0.3

#: Clearance between the ground and the lowest corner, in block sizes: what stands on a support stands on that alone.
CLEARANCE = 1e-3


def ground_below(assembly: solver.Assembly, pose: solver.Pose, removed: np.ndarray) -> tuple[float, str]:
    """Height of the ground [m]: of the lowest place where something may lie, and below what is free; and its material.

    Places are upward faces of supports, and the feet of supports that are taller than wide: piers stand on the ground.
    The material is that of the support with the lowest place, of several as low the widest; empty without supports.
    Blocks of ``removed``, an (n_blocks,) bool array, are not there.
    """
    corners, drawn, offsets = mechanics.moved_vertices(assembly, pose), assembly.vertices, assembly.shapes.offsets[:-1]
    supports, free = ~assembly.free & ~removed, assembly.free & ~removed
    lowest = np.minimum.reduceat(drawn, offsets)
    extents = np.maximum.reduceat(drawn, offsets) - lowest
    piers = supports & (extents[:, :-1] < extents[:, -1:]).all(axis=1)
    if assembly.dimension == 2:
        following, owner = corners[assembly.polygons.next_vertex], assembly.block_of_vertex
        # The outward normal of an edge points up where the edge runs to the left.
        normals = (following - corners)[:, ::-1] * [1.0, -1.0]
        heights = np.minimum(corners[:, 1], following[:, 1])
    else:
        solids = assembly.polyhedra
        normals, owner = solids.faces(corners).normals, solids.block_of_face
        heights = np.minimum.reduceat(corners[solids.corners, 2], solids.face_offsets[:-1])
    upward = supports[owner] & (normals[:, -1] > STEEP * np.linalg.norm(normals[:, :-1], axis=1))
    places, clearance = np.where(piers, lowest[:, -1], np.inf), CLEARANCE * assembly.block_size
    np.minimum.at(places, owner[upward], heights[upward])
    widest = np.where(supports & (places <= places.min() + clearance), extents[:, :-1].prod(axis=1), -1.0)
    # Of two as wide the name decides: the order of blocks says nothing.
    wide = widest >= widest.max() - CLEARANCE * abs(widest.max())
    material = max(np.array(assembly.materials)[wide]) if supports.any() else ""
    return float(min(places.min(), corners[free[assembly.block_of_vertex], -1].min())) - clearance, str(material)


def on_ground(
    assembly: solver.Assembly, pose: solver.Pose, ground: float, material: str = ""
) -> tuple[solver.Assembly, solver.Pose]:
    """Add a slab as wide as anything can get, its upper face at the height of the ground [m], as the last block."""
    corners = mechanics.moved_vertices(assembly, pose)
    middle, size = corners.mean(axis=0), 4.0 * float(np.ptp(corners, axis=0).max())
    low = np.append(middle[:-1] - size, ground - 0.5 * assembly.block_size)
    high = np.append(middle[:-1] + size, ground)
    drawn = layout_of(assembly)
    whole = assembly_of(
        [*drawn.blocks, box(low, high) if assembly.dimension == 3 else rectangle(*low, *high)],
        None if drawn.thickness is None else np.append(drawn.thickness, drawn.thickness.max()),
        names=[*assembly.names, GROUND],
        roles=[*(mechanics.FREE if free else mechanics.FIXED for free in assembly.free), mechanics.FIXED],
        density=np.append(assembly.density, 1.0),
        materials=[*assembly.materials, material],
    )
    turns = np.append(pose.rotations, np.zeros((1, pose.rotations.shape[1])), axis=0)
    return whole, solver.Pose(np.vstack([pose.positions, whole.centroids[-1:]]), turns)
