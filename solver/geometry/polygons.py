"""Polygons: the shapes of blocks in the plane."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from solver.tolerances import PENETRATION_FRACTION

from .contacts import Contacts, are_known
from .entering import Movement, Place, entered
from .outlines import Outlines, overlap_depths
from .planar_contacts import features_of, find_points, measured_points


@dataclass(frozen=True)
class Polygons(Outlines):
    """Blocks in the plane: :class:`Shapes` whose corners have two coordinates."""

    @property
    def sizes(self) -> np.ndarray:
        """(n_blocks,) array [m]: edge of the square as large as each block."""
        return np.sqrt(self.areas)

    @property
    def gyration(self) -> np.ndarray:
        """(n_blocks,) array [m²]: square of the radius of gyration of each block about its centroid, as drawn."""
        corner = self.vertices - self.centroids[self.block_of_vertex]
        following = corner[self.next_vertex]
        cross = corner[:, 0] * following[:, 1] - following[:, 0] * corner[:, 1]
        squares = (corner**2).sum(axis=1) + (corner * following).sum(axis=1) + (following**2).sum(axis=1)
        first = self.offsets[:-1]
        return np.asarray(np.add.reduceat(cross * squares, first) / (6.0 * np.add.reduceat(cross, first)))

    def size(self, chosen: np.ndarray) -> float:
        """Edge of the square as large as the mean of the chosen blocks, (n_blocks,) bool, [m]."""
        return float(np.sqrt(self.areas[chosen].mean()))

    def shifted(self, by: np.ndarray) -> Polygons:
        """Move the drawing by (2,) [m]."""
        return replace(self, vertices=self.vertices + by)

    def find(self, vertices: np.ndarray, reach: float, useful: np.ndarray) -> Contacts:
        """Find contact points with a gap up to ``reach`` [m], one of their blocks of the useful, (n_blocks,) bool."""
        return find_points(self, vertices, reach, useful)

    def measure(self, vertices: np.ndarray, contacts: Contacts) -> Contacts:
        """Measure the contact points between the same features, with the corners (n_vertices, 2) [m] elsewhere."""
        return measured_points(self, vertices, contacts.features)

    def overlaps(self, vertices: np.ndarray, tolerance: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Pairs of blocks that overlap by more than ``tolerance`` [m]; see :func:`overlap_depths`."""
        return overlap_depths(vertices, self.offsets, tolerance)

    def entered(
        self, before: np.ndarray, after: np.ndarray, useful: np.ndarray, tolerance: float, contacts: Contacts
    ) -> Contacts:
        """Contact points that would have kept blocks apart: see :class:`Shapes`."""
        i, j, _ = overlap_depths(after, self.offsets, tolerance)
        chosen = useful[i] | useful[j]
        i, j = i[chosen], j[chosen]
        places = []
        for corners in (before, after):
            along = corners[self.next_vertex] - corners
            normals = np.stack([along[:, 1], -along[:, 0]], axis=1) / self.edge_lengths[:, None]
            places.append(Place(corners, normals, corners))
        no_edges, none = np.zeros(len(self) + 1, dtype=np.int64), np.zeros((0, 2), dtype=np.int64)
        deepest = PENETRATION_FRACTION * np.minimum(self.widths[i], self.widths[j])
        movement = Movement(*places, self.offsets, self.offsets, no_edges, none, none)
        found = entered(movement, i, j, tolerance, deepest)
        points = measured_points(self, before, features_of(found.corner, found.face, np.full(len(found.face), -1)))
        return points[~are_known(points, contacts)]
