"""Backfill: loose fill over an extrados, whose pressure follows the blocks as they move."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from .assembly import Assembly
from .kinematics import Pose, cross_rows, rotation_matrices
from .words import make_plain

#: Places in a triangle and in a segment at which quadratic functions are summed exactly, each with the same weight.
_PLACES = {3: (1.0 + 3.0 * np.eye(3)) / 6.0, 2: np.array([[1.0, -1.0], [-1.0, 1.0]]) / np.sqrt(12.0) + 0.5}


@dataclass(frozen=True, eq=False)
class Backfill:
    """Loose fill up to a level surface over pieces of the blocks, which looked upwards and saw it in the drawing.

    Attributes
    ----------
    pieces : (n, d, d) array [m]
        Corners of each piece in the drawing: of a segment of an edge in the plane, of a triangle of a face in space,
        counter-clockwise seen from outside the block.
    block : (n,) int array
        The block each belongs to.
    surface : float [m]
        Height of the fill's top.
    unit_weight : float [N/m³]
    pressure_coefficient : float
        Horizontal pressure as a part of the vertical one.
    thickness : (n,) array [m], optional
        In the plane, out of it.
    base : float [m]
        Where it lies on other fill, the surface of that.

    Notes
    -----
    At every pose a piece carries the column of fill between where it is then and the surface: on an area dA with the
    outward normal n, z below the surface, the force unit_weight · z · (-k n_horizontal, -n_vertical) dA with k the
    pressure coefficient. Where z or the upward part of n is negative there is none. Of the column what is below the
    base is left out.
    """

    pieces: np.ndarray
    block: np.ndarray
    surface: float
    unit_weight: float
    pressure_coefficient: float = 0.0
    thickness: np.ndarray | None = None
    base: float = -np.inf

    def __post_init__(self) -> None:
        """Make plain values of what is given."""
        make_plain(self)
        if (self.thickness is None) == (self.pieces.shape[-1] == 2):
            raise ValueError("a fill has the thickness of its pieces in the plane, and in space none")

    def corners(self, assembly: Assembly, pose: Pose) -> np.ndarray:
        """(n, d, d) array [m]: corners of the pieces at a pose."""
        arms = self.pieces - assembly.centroids[self.block][:, None]
        turned = np.einsum("nij,nkj->nki", rotation_matrices(pose.rotations)[self.block], arms)
        return pose.positions[self.block][:, None] + turned

    def load(self, assembly: Assembly, pose: Pose, acceleration: np.ndarray | None = None) -> np.ndarray:
        """(n_blocks, n_dof) array [N, N·m]: what the fill does to each block at a pose, moments about its centroid.

        With an acceleration of each block, (n_blocks, d) in units of gravity, what that does to the columns over it:
        their weight times it, in the middle of their height.
        """
        given, d = self.corners(assembly, pose), assembly.dimension
        load = np.zeros((assembly.n_blocks, d + pose.rotations.shape[1]))
        places = _PLACES[d]
        for level, unit_weight in ((self.surface, self.unit_weight), (self.base, -self.unit_weight)):
            corners, depth, piece = _below(level, given)
            block, first = self.block[piece], corners[:, 1] - corners[:, 0]
            if self.thickness is not None:
                areas = self.thickness[piece, None] * np.stack([first[:, 1], -first[:, 0]], axis=1)
            else:
                areas = np.cross(first, corners[:, 2] - corners[:, 0]) / 2.0
            along = -areas * np.where(np.arange(d) < d - 1, self.pressure_coefficient, 1.0)
            along[areas[:, -1] <= 0.0] = 0.0
            pressures = unit_weight * depth @ places.T / d
            points = np.einsum("pk,nkj->npj", places, corners)
            if acceleration is not None:
                along = -along[:, -1:] * acceleration[block]
                points[:, :, -1] = (points[:, :, -1] + level) / 2.0
            for place in range(d):
                force = pressures[:, place, None] * along
                arms = cross_rows(points[:, place] - pose.positions[block])
                np.add.at(load, block, np.hstack([force, np.einsum("nrd,nd->nr", arms, force)]))
        return load

    def weight(self, assembly: Assembly) -> float:
        """Weight of the columns over the blocks as drawn [N]."""
        return -float(self.load(assembly, Pose.initial(assembly))[:, assembly.dimension - 1].sum())

    def without(self, gone: np.ndarray) -> Backfill:
        """Return the fill over the other blocks once some, (n_blocks,) bool array, have left with theirs."""
        kept = ~gone[self.block]
        thickness = None if self.thickness is None else self.thickness[kept]
        return replace(self, pieces=self.pieces[kept], block=self.block[kept], thickness=thickness)

    def shifted(self, by: np.ndarray) -> Backfill:
        """Return the fill in a drawing moved by (d,) [m]."""
        up = float(by[-1])
        return replace(self, pieces=self.pieces + by, surface=self.surface + up, base=self.base + up)


def _below(level: float, corners: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Corners, depth at each and number of pieces that sum up to the given ones, (n, d, d) [m], below a level."""
    depth = level - corners[:, :, -1]
    below, least = depth > 0.0, depth.min(axis=1)
    # Of a triangle with one corner above, the depth of the whole is too small by that of the part at this corner.
    whole = (2 * below.sum(axis=1) > depth.shape[1]) | (least >= 0.0)
    cut = below.any(axis=1) & (least < 0.0)
    alone = below[cut] != whole[cut, None]
    apex, height = corners[cut][alone][:, None], depth[cut][alone][:, None]
    part = height / np.where(alone, height, height - depth[cut])
    tips = apex + part[:, :, None] * (corners[cut] - apex)
    depths = np.concatenate([depth[whole], alone * np.abs(height)])
    return np.concatenate([corners[whole], tips]), depths, np.append(*map(np.flatnonzero, (whole, cut)))
