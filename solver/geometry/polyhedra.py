"""Polyhedra: the shapes of blocks in space."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from solver.words import kept

from .contacts import Contacts
from .convex_parts import ConvexParts, convex_parts
from .entering import Movement
from .separations import overlap_depths_in_space
from .solids import Solids
from .spatial_contacts import entered_points, find_points, measured_points


@dataclass(frozen=True)
class Polyhedra(Solids):
    """Blocks in space: their corners have three coordinates."""

    def size(self, chosen: np.ndarray) -> float:
        """Edge of the cube as large as the mean of the chosen blocks, (n_blocks,) bool, [m]."""
        return float(np.cbrt(self.volumes[chosen].mean()))

    @kept
    def parts(self) -> ConvexParts:
        """Convex parts of the blocks: the blocks themselves where all are convex."""
        return convex_parts(self)

    @kept
    def gyration(self) -> np.ndarray:
        """(n_blocks,) array [m²]: square of the radius of gyration of each block, the mean about all axes."""
        return np.asarray(np.trace(self.inertia, axis1=1, axis2=2) / (3.0 * self.volumes))

    def find(self, vertices: np.ndarray, reach: float, useful: np.ndarray) -> Contacts:
        """Find contact points with a gap up to ``reach`` [m], one of their blocks of the useful, (n_blocks,) bool."""
        return find_points(self.parts.placed(vertices), reach, useful, self.widths)

    def measure(self, vertices: np.ndarray, contacts: Contacts) -> Contacts:
        """Measure the contact points between the same features, with the corners (n_vertices, 3) [m] elsewhere."""
        return measured_points(self.parts.placed(vertices), contacts.features, contacts.areas)

    def overlaps(self, vertices: np.ndarray, tolerance: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Pairs of blocks that overlap by more than ``tolerance`` [m]; see :func:`overlap_depths_in_space`."""
        return overlap_depths_in_space(self.parts.placed(vertices), tolerance)

    def entered(
        self, before: np.ndarray, after: np.ndarray, useful: np.ndarray, tolerance: float, contacts: Contacts
    ) -> Contacts:
        """Contact points that would have kept apart what a movement put into each other; see :func:`entered_points`."""
        movement = Movement(self.parts.placed(before), self.parts.placed(after))
        return entered_points(movement, self.widths, useful, tolerance, contacts)
