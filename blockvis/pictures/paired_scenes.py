"""One or several views of the same blocks in space, side by side, as one scene."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from PIL import Image

import solver

from . import palette
from .frame import Frame, Sheet, write_words
from .solid_scene import SolidScene
from .solid_view import View, hiding_supports
from .swing import Swing

#: What stands below each of several views, and how high, in heights of the text.
WORDS, HEIGHT = ("from above", "from below"), 1.6


def _on_each(name: str) -> Callable[..., None]:
    """Make a method that each of the scenes has."""

    def call(self: PairedScenes, *given: Any) -> None:
        for scene in self.scenes:
            getattr(scene, name)(*given)

    return call


class PairedScenes:
    """Scenes of the same blocks at one scale, from left to right, as one :class:`SolidScene`.

    The frame has what is shown in the axes of each view in turn; the look is that of each scene.
    """

    def __init__(
        self,
        assembly: solver.Assembly,
        views: Sequence[View],
        frame: Frame,
        sheet: Sheet,
        block_fill: np.ndarray,
        **look: Any,
    ) -> None:
        (width, height), self._text = sheet.inside_size, sheet.text
        self._several = len(views) > 1
        size = width // len(views), height - round(HEIGHT * self._text) * self._several
        half = frame.size.reshape(-1, 2).max(axis=0) / 2.0
        self.scenes = [
            SolidScene(
                assembly,
                view,
                Frame(middle - half, middle + half),
                size,
                block_fill,
                outlined=hiding_supports(assembly, view),
                hidden_hinges=not self._several,
                **look,
            )
            for view, middle in zip(views, ((frame.low + frame.high) / 2.0).reshape(-1, 2), strict=True)
        ]
        self.size = (size[0] * len(views), height)
        first = self.scenes[0]
        self.frame, self.pixel, self.usual_height = first.frame, first.pixel, first.usual_height

    pose, hide, backfill, cracks, sliding, hinges, crushing, forces, ties, arrows, clear, lines, close = map(
        _on_each,
        (
            *("pose", "hide", "backfill", "cracks", "sliding", "hinges", "crushing", "forces", "ties", "arrows"),
            *("clear", "lines", "close"),
        ),
    )

    def show_ground(self, height: float) -> None:
        """Draw the ground of a fall; from below it would hide everything."""
        for scene in self.scenes:
            if scene.view.above >= 0.0:
                scene.show_ground(height)

    def show_motion(self, swing: Swing, tails: np.ndarray, tips: np.ndarray) -> solver.Pose:
        """Draw how a mechanism moves."""
        for scene in self.scenes:
            scene.show_motion(swing, tails, tips)
        return swing.displaced

    def holds(self, *layers: str) -> bool:
        """Whether any of the views shows something of one of the layers."""
        return any(scene.holds(*layers) for scene in self.scenes)

    def image(self) -> Image.Image:
        """Draw the views beside each other, each of several with its words."""
        page, left = Image.new("RGB", self.size, palette.PAPER), 0
        for scene, words in zip(self.scenes, WORDS, strict=False):
            page.paste(scene.image(), (left, 0))
            if self._several:
                write_words(page, (left + scene.size[0] / 2.0, self.size[1] - 0.7 * self._text), words, self._text)
            left += scene.size[0]
        return page

    def at_pixel(self, points: np.ndarray) -> np.ndarray:
        """(n, 2) array: pixel (column, row) of points (n, 3) [m] in the first view."""
        return self.scenes[0].at_pixel(points)
