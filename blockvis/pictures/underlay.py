"""A photograph under the blocks of the plane, at the scale of the drawing."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from PIL import Image

from . import palette

#: How much of a photograph is paper, so that what is drawn on it stands out.
PALE = 0.4

#: How much of the colour of blocks covers it.
COVER = 0.45


@dataclass(frozen=True)
class Underlay:
    """A photograph and where it lies.

    Attributes
    ----------
    pixels : (height, width, 3) uint8 array
    matrix : (2, 3) array [m]
        From column and row, (0, 0) its upper left corner, and 1 to x and y.
    """

    pixels: np.ndarray
    matrix: np.ndarray

    def seen(self, low: np.ndarray, pixel: float, size: tuple[int, int]) -> np.ndarray:
        """(height, width, 3) uint8 array: what of it is in a picture, pale; paper around it.

        Parameters
        ----------
        low : (2,) array [m]
            Lower left corner of the picture.
        pixel : float [m]
            Size of a pixel of the picture.
        size : (int, int)
            Width and height of the picture in pixels.
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
        return np.asarray(Image.composite(Image.blend(shown, paper, PALE), paper, within))
