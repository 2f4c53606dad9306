"""Polygons: the shapes of blocks in the plane."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .contacts import Contacts
from .outlines import Outlines, overlap_depths
from .planar_contacts import find_points, measured_points


@dataclass(frozen=True)
class Polygons(Outlines):
    """Blocks in the plane: :class:`Shapes` whose corners have two coordinates."""

    @property
    def sizes(self) -> np.ndarray:
        """(n_blocks,) array [m]: edge of the square as large as each block."""
        return np.sqrt(self.areas)

    def size(self, chosen: np.ndarray) -> float:
        """Edge of the square as large as the mean of the chosen blocks, (n_blocks,) bool, [m]."""
        return float(np.sqrt(self.areas[chosen].mean()))

    def find(self, vertices: np.ndarray, reach: float, useful: np.ndarray) -> Contacts:
        """Contact points within a gap of ``reach`` [m] between blocks one of which is useful, (n_blocks,) bool."""
        return find_points(self, vertices, reach, useful)

    def measure(self, vertices: np.ndarray, contacts: Contacts) -> Contacts:
        """The contact points between the same features, with the corners (n_vertices, 2) [m] elsewhere."""
        return measured_points(self, vertices, contacts.features)

    def overlaps(self, vertices: np.ndarray, tolerance: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Pairs of blocks that overlap by more than ``tolerance`` [m]; see :func:`overlap_depths`."""
        return overlap_depths(vertices, self.offsets, tolerance)
