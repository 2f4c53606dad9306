"""Outlines of the parts of a mechanism, for pictures."""

from __future__ import annotations

import numpy as np
import shapely

import solver


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
