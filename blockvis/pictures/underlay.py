"""A photograph under the blocks of the plane, at the scale of the drawing; they carry their part of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from PIL import Image, ImageDraw

import solver
from solver import mechanics

from . import palette

#: How much of their colour covers what blocks carry of it.
COVER = 0.3


@dataclass(frozen=True)
class Underlay:
    """A photograph and where it lies."""

    pixels: np.ndarray  #: (height, width, 3) uint8 array.
    matrix: np.ndarray  #: (2, 3) array [m]: from column and row, (0, 0) its upper left corner, and 1 to x and y.

    def seen(self, low: np.ndarray, pixel: float, size: tuple[int, int]) -> np.ndarray:
        """(height, width, 3) uint8 array: what of it is in a picture, paper around it.

        The picture begins at ``low`` (2,) [m], its lower left corner, and has so many pixels of a size [m].
        """
        to_world = np.array([[pixel, 0.0, low[0]], [0.0, -pixel, low[1] + pixel * size[1]]])
        back = np.linalg.inv(self.matrix[:, :2])
        place = np.column_stack([back @ to_world[:, :2], back @ (to_world[:, 2] - self.matrix[:, 2])])
        photograph = Image.fromarray(self.pixels)
        finer = max(1, int(np.sqrt(abs(np.linalg.det(place[:, :2])))))
        photograph = photograph.reduce(finer)
        place = place / finer
        mask = Image.new("L", photograph.size, 255)
        within = mask.transform(size, Image.Transform.AFFINE, tuple(place.ravel()), fillcolor=0)
        shown = photograph.transform(size, Image.Transform.AFFINE, tuple(place.ravel()), Image.Resampling.BICUBIC)
        paper = Image.new("RGB", size, palette.PAPER)
        return np.asarray(Image.composite(shown, paper, within))


class CarriedPhotograph:
    """A photograph of which each block carries its part to where it moves; pale where they were.

    The picture is as of :meth:`Underlay.seen`.
    """

    def __init__(
        self, underlay: Underlay, assembly: solver.Assembly, low: np.ndarray, pixel: float, size: tuple[int, int]
    ) -> None:
        self._assembly, self._pixel = assembly, pixel
        seen = Image.fromarray(underlay.seen(low, pixel, size))
        paper = Image.new("RGB", size, palette.PAPER)
        # Paler around the blocks, so that they stand out.
        self._around, self._own = (Image.blend(seen, paper, pale) for pale in (0.7, 0.15))
        self._turn = np.diag([pixel, -pixel])
        self._corner = np.array([low[0], low[1] + pixel * size[1]])

    def picture(self, pose: solver.Pose, gone: np.ndarray) -> Image.Image:
        """Draw the photograph where its blocks are in a pose, but (n_blocks,) bool ones."""
        assembly, picture = self._assembly, self._around.copy()
        moved = mechanics.moved_vertices(assembly, pose)
        far = np.linalg.norm(moved - assembly.vertices, axis=1)
        rings = np.split((moved - self._corner) @ np.linalg.inv(self._turn), assembly.offsets[1:-1])
        moves = np.maximum.reduceat(far, assembly.offsets[:-1]) > 0.5 * self._pixel
        standing = Image.new("L", picture.size)
        draw = ImageDraw.Draw(standing)
        for block in np.flatnonzero(~moves & ~gone):
            draw.polygon([tuple(corner) for corner in rings[block].tolist()], fill=255)
        picture.paste(self._own, (0, 0), standing)
        for block in np.flatnonzero(moves & ~gone):
            self._paste(picture, rings[block], int(block), pose)
        return picture

    def _paste(self, picture: Image.Image, ring: np.ndarray, block: int, pose: solver.Pose) -> None:
        """Paste what a block carries, whose corners (n, 2) are now at these pixels."""
        low = np.maximum(np.floor(ring.min(axis=0)), 0).astype(int)
        high = np.minimum(np.ceil(ring.max(axis=0)) + 1, picture.size).astype(int)
        if (high <= low).any():
            return
        width, height = (high - low).tolist()
        back = np.linalg.inv(self._turn) @ mechanics.rotation_matrices(pose.rotations[[block]])[0].T
        start = self._assembly.centroids[block] - self._corner
        shift = self._turn @ low + self._corner - pose.positions[block]
        place = np.column_stack([back @ self._turn, back @ shift + np.linalg.inv(self._turn) @ start])
        part = self._own.transform(
            (width, height),
            Image.Transform.AFFINE,
            tuple(place.ravel()),
            Image.Resampling.BILINEAR,
            fillcolor=palette.PAPER,
        )
        mask = Image.new("L", (width, height))
        ImageDraw.Draw(mask).polygon([tuple(corner) for corner in (ring - low).tolist()], fill=255)
        picture.paste(part, tuple(low.tolist()), mask)
