"""Several views of the same blocks in space, side by side, as one scene."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from PIL import Image

import solver

from . import palette
from .backfill import FillBodies
from .frame import write_words
from .marks import Marks
from .solid_scene import SolidScene
from .swing import Swing
from .ties import Strands

#: Height of the words below each view, in heights of the text.
WORDS = 1.6


class PairedScenes:
    """Scenes of the same blocks at one scale, from left to right; see :class:`blockvis.pictures.scene.Scene`.

    Parameters
    ----------
    scenes : sequence of SolidScene
    words : sequence of str
        What each shows.
    text : int
        Height of the words in pixels.
    """

    def __init__(self, scenes: Sequence[SolidScene], words: Sequence[str], text: int) -> None:
        self._scenes, self._words, self._text = tuple(scenes), tuple(words), text
        first = self._scenes[0]
        self.size = (sum(scene.size[0] for scene in self._scenes), first.size[1] + round(WORDS * text))
        self.frame, self.pixel = first.frame, first.pixel

    def pose(self, shown: solver.Pose, block_fill: np.ndarray | None = None) -> None:
        """Put the blocks where they are drawn."""
        for scene in self._scenes:
            scene.pose(shown, block_fill)

    def hide(self, gone: np.ndarray) -> None:
        """Leave blocks, (n_blocks,) bool array, out from the next pose on."""
        for scene in self._scenes:
            scene.hide(gone)

    def backfill(self, bodies: FillBodies) -> None:
        """Draw loose fill."""
        for scene in self._scenes:
            scene.backfill(bodies)

    def cracks(self, found: Marks, magnification: float, widest: float) -> None:
        """Draw open joints."""
        for scene in self._scenes:
            scene.cracks(found, magnification, widest)

    def sliding(self, found: Marks) -> None:
        """Draw sliding joints."""
        for scene in self._scenes:
            scene.sliding(found)

    def hinges(self, found: Marks) -> None:
        """Draw hinges."""
        for scene in self._scenes:
            scene.hinges(found)

    def forces(self, ends: np.ndarray, line: np.ndarray) -> None:
        """Draw forces."""
        for scene in self._scenes:
            scene.forces(ends, line)

    def ties(self, strands: Sequence[Strands]) -> None:
        """Draw ties, props and bars."""
        for scene in self._scenes:
            scene.ties(strands)

    def bearings(self, ends: np.ndarray) -> None:
        """Draw nothing: the blocks show it."""

    def arrows(self, layer: str, tails: np.ndarray, tips: np.ndarray, colour: tuple[int, int, int]) -> None:
        """Draw arrows."""
        for scene in self._scenes:
            scene.arrows(layer, tails, tips, colour)

    def show_motion(self, swing: Swing, tails: np.ndarray, tips: np.ndarray) -> solver.Pose:
        """Draw how a mechanism moves."""
        for scene in self._scenes:
            scene.show_motion(swing, tails, tips)
        return swing.displaced

    def clear(self, *layers: str) -> None:
        """Remove layers."""
        for scene in self._scenes:
            scene.clear(*layers)

    def holds(self, *layers: str) -> bool:
        """Whether anything is drawn in one of the layers."""
        return self._scenes[0].holds(*layers)

    def image(self) -> Image.Image:
        """Draw the views beside each other, each with its words."""
        page, left = Image.new("RGB", self.size, palette.PAPER), 0
        for scene, words in zip(self._scenes, self._words, strict=True):
            page.paste(scene.image(), (left, 0))
            write_words(page, (left + scene.size[0] / 2.0, self.size[1] - 0.7 * self._text), words, self._text)
            left += scene.size[0]
        return page

    def at_pixel(self, points: np.ndarray) -> np.ndarray:
        """(n, 2) array: pixel (column, row) of points (n, 3) [m] in the first view."""
        return self._scenes[0].at_pixel(points)
