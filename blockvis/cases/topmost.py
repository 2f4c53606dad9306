"""What is topmost below a place, for a load that moves over blocks in space."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

import solver

from .block_at import ON_EDGE


def force_on_top_in_space(assembly: solver.Assembly, x: float, y: float, force: Sequence[float]) -> solver.PointForces:
    """Put a force, (3,) [N], on the topmost surface at a place in plan [m].

    Of blocks that meet there at one height the one with the smallest x carries it. ValueError where nothing is
    below, or a support.
    """
    parts = assembly.polyhedra.parts
    faces, starts = parts.solids.faces(parts.solids.vertices), parts.solids.faces_of_block[:-1]
    near = ON_EDGE * assembly.block_size
    normals, rise = faces.normals, faces.normals[:, 2]
    beyond = ((np.array([x, y]) - faces.middles[:, :2]) * normals[:, :2]).sum(axis=1)
    # A convex part is where the vertical line is behind all of its faces.
    steep = np.abs(rise) <= 1e-9
    level = faces.middles[:, 2] - beyond / np.where(steep, 1.0, rise)
    top = np.minimum.reduceat(np.where(~steep & (rise > 0.0), level, np.inf), starts)
    bottom = np.maximum.reduceat(np.where(~steep & (rise < 0.0), level, -np.inf), starts)
    outside = np.maximum.reduceat(np.where(steep, beyond, -np.inf), starts)
    height = np.where((outside <= near) & (bottom <= top + near), top, -np.inf)
    highest = float(height.max())
    if not np.isfinite(highest):
        low, high = assembly.vertices.min(axis=0), assembly.vertices.max(axis=0)
        raise ValueError(
            f"nothing is below a load at x = {x:g}, y = {y:g} m; the structure reaches from x = {low[0]:g} to "
            f"{high[0]:g} m and from y = {low[1]:g} to {high[1]:g} m"
        )
    meeting = np.unique(parts.block_of_part[height >= highest - near])
    owner = int(meeting[np.lexsort(assembly.centroids[meeting].T[::-1])[0]])
    if not assembly.free[owner]:
        raise ValueError(f"the load at x = {x:g}, y = {y:g} m stands on the support '{assembly.names[owner]}'")
    return solver.PointForces.at(owner, force, (x, y, highest))
