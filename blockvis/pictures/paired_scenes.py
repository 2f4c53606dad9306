"""Several views of the same blocks in space, side by side, as one scene."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from PIL import Image

import solver

from . import palette
from .frame import write_words
from .scene import Scene
from .solid_scene import SolidScene
from .swing import Swing

#: Height of the words below each view, in heights of the text.
WORDS = 1.6


def _on_each(name: str) -> Callable[..., None]:
    """Make a method that each of the scenes has."""

    def call(self: PairedScenes, *given: Any) -> None:
        for scene in self._scenes:
            getattr(scene, name)(*given)

    return call


class PairedScenes(Scene):
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

    pose, hide, backfill, cracks, sliding, hinges, crushing, forces, ties, arrows, clear = map(
        _on_each,
        ("pose", "hide", "backfill", "cracks", "sliding", "hinges", "crushing", "forces", "ties", "arrows", "clear"),
    )

    def show_motion(self, swing: Swing, tails: np.ndarray, tips: np.ndarray) -> solver.Pose:
        """Draw how a mechanism moves."""
        for scene in self._scenes:
            scene.show_motion(swing, tails, tips)
        return swing.displaced

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
