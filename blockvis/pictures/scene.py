"""What draws blocks and their marks: in the plane :class:`FlatScene` by Agg, in space :class:`SolidScene` by VTK."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from PIL import Image

import solver

from .backfill import FillBodies
from .frame import Frame
from .marks import Marks
from .swing import Swing
from .ties import Strands

#: Layers that hold what statics knows: a fall in time has none of them.
OF_STATICS = (
    *("crack", "crack edge", "sliding", "exposed", "hinge", "hinge rim", "hinge top", "hidden hinge"),
    *("crushing", "crushing top"),
    *("force", "force line", "ground", "backfill"),
    *("arrow rim", "arrow top", "live rim", "live top"),
)


class Scene(Protocol):
    """Blocks and their marks, drawn frame after frame; each call replaces what its layers held before.

    Attributes
    ----------
    size : (int, int)
        Width and height of the pictures in pixels.
    frame : Frame
        What is shown, the same in all frames.
    pixel : float [m]
        Size of a pixel in the world.
    """

    size: tuple[int, int]
    frame: Frame
    pixel: float
    _gone: np.ndarray

    @property
    def _thin(self) -> float:
        """Pixels; one where the picture is 1080 high."""
        return self.size[1] / 1080.0

    def pose(self, shown: solver.Pose, block_fill: np.ndarray | None = None) -> None:
        """Put the blocks where they are drawn, in new colours (n_blocks, 3) uint8 where these are given."""

    def hide(self, gone: np.ndarray) -> None:
        """Leave blocks, (n_blocks,) bool array, out from the next pose on."""
        self._gone = gone

    def backfill(self, bodies: FillBodies) -> None:
        """Draw loose fill over the blocks."""

    def cracks(self, found: Marks, magnification: float, widest: float) -> None:
        """Draw open joints, all in one colour, in pictures whose widest is ``widest`` [m]."""

    def sliding(self, found: Marks) -> None:
        """Draw sliding joints."""

    def hinges(self, found: Marks) -> None:
        """Draw hinges."""

    def crushing(self, found: Marks) -> None:
        """Draw contact points that crush."""

    def forces(self, ends: np.ndarray, line: np.ndarray) -> None:
        """Draw forces as bars with ends (n, 2, d) [m], and the line from joint to joint, (m, 2, d) [m]."""

    def ties(self, strands: Sequence[Strands]) -> None:
        """Draw ties, props and bars."""

    def bearings(self, ends: np.ndarray) -> None:
        """Draw where supports carry the structure, lines (n, 2, d) [m]; in space the blocks show it."""
        return

    def arrows(self, layer: str, tails: np.ndarray, tips: np.ndarray, colour: tuple[int, int, int]) -> None:
        """Draw arrows from tails (n, d) [m] to tips (n, d) [m]: "arrow" of supports or "live" of loads."""

    def show_motion(self, swing: Swing, tails: np.ndarray, tips: np.ndarray) -> solver.Pose:
        """Draw how a mechanism moves, with an arrow from each tail to its tip; returns where its blocks are drawn."""

    def clear(self, *layers: str) -> None:
        """Remove layers."""

    def holds(self, *layers: str) -> bool:
        """Whether anything is drawn in one of the layers."""

    def image(self) -> Image.Image:
        """Draw the picture."""

    def close(self) -> None:
        """Give back what the scene holds outside of memory."""
        return

    def at_pixel(self, points: np.ndarray) -> np.ndarray:
        """(n, 2) array: pixel (column, row) of points (n, d) [m]."""
