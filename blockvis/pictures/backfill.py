"""Fill over arches and vaults in pictures: between the extrados, where it is drawn, and its surface."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely

import solver

from .hatching import hatched

#: Width of a joint that parts no body, in space and in the plane, in extents of the fill.
GAPING, GAPING_IN_PLANE = 0.02, 0.05

#: Pieces this near to each other in plan, in extents of the fill, are one body.
SAME_BODY = 1e-6


@dataclass(frozen=True)
class FillBodies:
    """Columns of fill over pieces of the blocks.

    They stand on the corners ``feet`` (n, d, d) [m] of each piece where it is drawn, and reach up to ``tops`` (n,) [m].
    """

    feet: np.ndarray
    tops: np.ndarray

    @property
    def heads(self) -> np.ndarray:
        """(n, d, d) array [m]: corners of the columns in the surface."""
        heads = self.feet.copy()
        heads[:, :, -1] = self.tops[:, None]
        return heads

    @property
    def columns(self) -> np.ndarray:
        """(m, 4, 2) array [m]: in the plane, the outline of each column, and of those over joints that gape."""
        columns = np.concatenate([self.feet, self.heads[:, ::-1]], axis=1)
        # Pieces run from the right to the left.
        order = np.argsort(self.feet[:, 1, 0], kind="stable")
        left, right = order[:-1], order[1:]
        width = self.feet[right, 1, 0] - self.feet[left, 0, 0]
        over = (width > 0.0) & (width < GAPING_IN_PLANE * self._extent) & (self.tops[left] == self.tops[right])
        left, right = left[over], right[over]
        bridges = [self.feet[right, 1], self.feet[left, 0], self.heads[left, 0], self.heads[right, 1]]
        return np.concatenate([columns, np.stack(bridges, axis=1)])

    def hatch(self) -> np.ndarray:
        """(m, 2, 2) array [m]: in the plane, lines that fall to the right across the fill."""
        whole = shapely.union_all(shapely.polygons(self.columns), grid_size=SAME_BODY * self._extent)
        return hatched(whole, 0.02 * self._extent, -1.0)

    def rims(self) -> np.ndarray:
        """(m, 2, d) array [m]: edges of the bodies, in the surface and in space up to it from the extrados."""
        if self.feet.shape[2] == 2:
            return self.columns[:, 2:]
        lines = [np.zeros((0, 2, 3))]
        for top in np.unique(self.tops):
            feet = self.feet[self.tops == top]
            plans = shapely.polygons(feet[:, :, :2])
            whole = shapely.union_all(plans[shapely.area(plans) > 0.0], grid_size=SAME_BODY * self._extent)
            # Over a joint that gapes the fill is one body.
            reach = GAPING * self._extent
            whole = shapely.buffer(whole, reach, join_style="mitre")
            whole = shapely.buffer(whole, -reach, join_style="mitre").simplify(0.1 * reach)
            for polygon in shapely.get_parts(whole):
                for ring in (polygon.exterior, *polygon.interiors):
                    plan = np.array(ring.coords)
                    level = np.column_stack([plan, np.full(len(plan), top)])
                    lines.append(np.stack([level[:-1], level[1:]], axis=1))
                    lines.append(self._uprights(level[:-1], feet.reshape(-1, 3)))
        return np.concatenate(lines)

    def _uprights(self, heads: np.ndarray, feet: np.ndarray) -> np.ndarray:
        apart = np.linalg.norm(heads[:, None, :2] - feet[None, :, :2], axis=2)
        below = np.where(apart <= 1e-3 * self._extent, feet[None, :, 2], -np.inf).max(axis=1)
        low = heads.copy()
        low[:, 2] = below
        return np.stack([heads, low], axis=1)[np.isfinite(below)]

    @property
    def _extent(self) -> float:
        corners = self.feet.reshape(-1, self.feet.shape[2])
        # Where there is no fill it has none.
        across = corners.max(axis=0, initial=-np.inf) - corners.min(axis=0, initial=np.inf)
        return float(across.max(initial=1e-9))


def fill_bodies(response: solver.Response, shown: solver.Pose, gone: np.ndarray | None = None) -> FillBodies:
    """Find the columns of fill over the blocks where they are drawn, but those that have left, (n_blocks,) bool."""
    d = response.assembly.dimension
    feet, tops = [np.zeros((0, d, d))], [np.zeros(0)]
    for fill in response.loads.fills:
        kept = fill if gone is None else fill.without(gone)
        foot = kept.corners(response.assembly, shown)
        foot[:, :, -1] = np.maximum(foot[:, :, -1], kept.base)
        feet.append(foot)
        tops.append(np.full(len(kept.block), kept.surface))
    return FillBodies(np.concatenate(feet), np.concatenate(tops))
