"""What scenes have in common: in the plane :class:`FlatScene` is drawn by Agg, in space :class:`SolidScene` by VTK."""

from __future__ import annotations

import numpy as np

import solver

from .frame import Frame

#: Layers that hold what statics knows: a fall in time has none of them.
OF_STATICS = (
    *("crack", "crack edge", "sliding", "exposed", "hinge", "hinge rim", "hinge top", "hidden hinge"),
    *("crushing", "crushing top"),
    *("force", "force line", "ground", "backfill"),
    *("arrow rim", "arrow top", "live rim", "live top", "dead rim", "dead top"),
)

#: Pictures lower than this part of their width have lines as thick as if they were so high.
FLAT = 0.45


class Scene:
    """Blocks and their marks in layers, drawn frame after frame; each call replaces what its layers held before.

    A picture has so many pixels, and shows the same part of the world in all frames.
    """

    def __init__(self, assembly: solver.Assembly, frame: Frame, size: tuple[int, int]) -> None:
        self.assembly, self.size, self.frame = assembly, size, frame.fitted(*size)
        #: Size of a pixel in the world [m].
        self.pixel = float(self.frame.size[0]) / size[0]
        #: Pixels, by which lines are thick: the height, in upright and in flat pictures what is usual for their width.
        self.usual_height = min(size[0], max(size[1], FLAT * size[0]))
        self._gone = np.zeros(assembly.n_blocks, dtype=bool)

    @property
    def _thin(self) -> float:
        """Pixels; one where the picture is 1080 high."""
        return self.usual_height / 1080.0

    @property
    def _ground(self) -> np.ndarray:
        """(n_blocks,) bool array: supports that reach below all free blocks, as ground does."""
        assembly = self.assembly
        lowest = np.full(assembly.n_blocks, np.inf)
        np.minimum.at(lowest, assembly.block_of_vertex, assembly.vertices[:, -1])
        return ~assembly.free & (lowest < lowest[assembly.free].min(initial=np.inf))

    def hide(self, gone: np.ndarray) -> None:
        """Leave blocks, (n_blocks,) bool array, out from the next pose on."""
        self._gone = gone

    def at_pixel(self, points: np.ndarray) -> np.ndarray:
        """(n, 2) array: pixel (column, row) of points (n, 2) [m] of the plane of the picture."""
        place = (points - self.frame.low) / self.pixel
        return np.column_stack([place[:, 0], self.size[1] - place[:, 1]])

    def close(self) -> None:
        """Give back what the scene holds outside of memory."""
