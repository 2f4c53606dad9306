"""Paths painted over a picture by Agg, with exact edges."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from matplotlib.backends.backend_agg import RendererAgg
from matplotlib.path import Path
from matplotlib.transforms import Affine2D
from PIL import Image


def painted(
    picture: Image.Image, paths: Iterable[tuple[tuple[int, int, int], float, float, Path]], place: Affine2D
) -> Image.Image:
    """Paint paths over a picture, back to front.

    Each has its colour, the width of its line [pixels], 0 where it is filled, and its opacity; ``place`` takes it to
    pixels from the lower left corner.
    """
    renderer = RendererAgg(*picture.size, 72.0)
    pixels = renderer.buffer_rgba()
    np.asarray(pixels)[..., :3] = picture
    np.asarray(pixels)[..., 3] = 255
    for colour, width, cover, path in paths:
        pen = renderer.new_gc()
        pen.set_alpha(cover)
        pen.set_snap(False)
        pen.set_linewidth(width)
        pen.set_joinstyle("miter")
        pen.set_capstyle("butt")
        rgb = tuple(c / 255.0 for c in colour)
        pen.set_foreground(rgb)
        renderer.draw_path(pen, path, place, None if width else rgb)
    # Nothing is transparent: the fourth byte of a pixel says nothing.
    return Image.frombytes("RGB", picture.size, pixels, "raw", "RGBX")
