"""SolidLayout: blocks in space before they become an assembly, whatever file they come from."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .labels import LabelledBlocks
from .solids import Solid, volume


@dataclass(frozen=True)
class SolidLayout(LabelledBlocks):
    """Blocks in space, with what else a drawing says of them; gravity acts along -z.

    Attributes
    ----------
    solids : tuple of (points, faces) [m]
        (n, 3) corners of each block, and the corners around each of its faces, counter-clockwise seen from outside.
    names : tuple of str
        One per block; may repeat.
    """

    solids: tuple[Solid, ...]
    names: tuple[str, ...]

    shapes_in = "solids"
    dimension = 3

    @property
    def thickness(self) -> None:
        """Blocks in space have no thickness out of a plane."""
        return None

    @property
    def volumes(self) -> np.ndarray:
        """(n_blocks,) array [m³]."""
        return np.array([volume(*solid) for solid in self.solids])

    @property
    def points(self) -> np.ndarray:
        """(n_points, 3) array [m]: the corners of all blocks."""
        return np.concatenate([points for points, _ in self.solids]) if self.solids else np.zeros((0, 3))

    def corners(self, block: int) -> np.ndarray:
        """(n, 3) array [m]: the corners of a block."""
        return self.solids[block][0]
