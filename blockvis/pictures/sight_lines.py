"""Sight lines: how much of each block in space is seen from where, behind the others."""

from __future__ import annotations

import numpy as np

import solver
from solver import mechanics

from .surface import triangles_of

#: Products of points and triangles that are looked at for a view.
MOST_PAIRS = 2_000_000

#: A point lies on the face it was taken from, and is hidden by what is nearer by more than this part of a block.
NEARER = 0.02


class SightLines:
    """Blocks at a pose, and middles of their faces that are looked for.

    The weights (n_blocks,) say what it is worth to see each block: where there are many, those that are worth little
    are not looked for.
    """

    def __init__(self, assembly: solver.Assembly, pose: solver.Pose, weights: np.ndarray) -> None:
        shapes = assembly.polyhedra
        triangles, self._block_of_triangle = triangles_of(shapes)
        corners = mechanics.moved_vertices(assembly, pose)
        self._triangles = corners[triangles]
        self._faces, self._areas = shapes.faces(corners), shapes.faces(shapes.vertices).areas
        self._owner = shapes.block_of_face
        self._near = NEARER * assembly.block_size
        #: Points that are looked for in a view, at most.
        self.most = max(20, MOST_PAIRS // max(len(triangles), 1))
        per_face = weights[self._owner] * self._areas
        self._chosen = np.sort(np.argsort(-per_face, kind="stable")[: self.most])

    def seen(self, axes: np.ndarray, n_blocks: int) -> np.ndarray:
        """(n_blocks,) array: part of what of each block faces the eye that nothing hides; 1 where nobody looked.

        The axes (3, 3) are to the right, up in the picture, and to the eye.
        """
        showing = self._areas * (self._faces.normals @ axes[2])
        faces = self._chosen[showing[self._chosen] > 0.0]
        free = ~self._hidden(self._faces.middles[faces] @ axes.T, self._triangles @ axes.T)
        owner, area = self._owner[faces], showing[faces]
        whole = np.bincount(owner, weights=area, minlength=n_blocks)
        part = np.bincount(owner, weights=area * free, minlength=n_blocks)
        return np.where(whole > 0.0, part / np.where(whole > 0.0, whole, 1.0), 1.0)

    def sees(
        self, points: np.ndarray, across: np.ndarray, axes: np.ndarray, without: np.ndarray | None = None
    ) -> np.ndarray:
        """(n,) bool array: which points (n, 3) [m] on edges of joints nothing hides.

        ``across`` (n, 3) are the normals of the joints: along one the eye would look between its blocks, through both
        of them. Blocks ``without``, (n_blocks,) bool, hide nothing; the axes are as of :meth:`seen`.
        """
        triangles = self._triangles if without is None else self._triangles[~without[self._block_of_triangle]]
        beside = self._near / 2.0 * across
        one, other = (~self._hidden(side @ axes.T, triangles @ axes.T) for side in (points - beside, points + beside))
        return np.asarray(one | other)

    def _hidden(self, points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
        """(n,) bool array: points (n, 3) behind one of the triangles (m, 3, 3), all to the right, up and to the eye."""
        first, u, v = triangles[:, 0], triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
        area = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
        upright = np.abs(area) < 1e-12 * np.abs(area).max(initial=1e-300)
        scale = np.where(upright, np.inf, area)
        x, y = (points[:, None, k] - first[None, :, k] for k in (0, 1))
        a = (x * v[:, 1] - y * v[:, 0]) / scale
        b = (y * u[:, 0] - x * u[:, 1]) / scale
        inside = (a > 0.0) & (b > 0.0) & (a + b < 1.0) & ~upright
        depth = first[:, 2] + a * u[:, 2] + b * v[:, 2]
        return np.asarray((inside & (depth > points[:, 2:] + self._near)).any(axis=1))
