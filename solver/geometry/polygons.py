"""Polygons: the shapes of blocks in the plane."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .contacts import Contacts, are_known
from .outlines import Outlines, overlap_depths
from .planar_contacts import features_of, find_points, measured_points, passed_edges


@dataclass(frozen=True)
class Polygons(Outlines):
    """Blocks in the plane: their corners have two coordinates."""

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

    def find(self, vertices: np.ndarray, reach: float, useful: np.ndarray) -> Contacts:
        """Find contact points with a gap up to ``reach`` [m], one of their blocks of the useful, (n_blocks,) bool."""
        return find_points(self, vertices, reach, useful)

    def measure(self, vertices: np.ndarray, contacts: Contacts) -> Contacts:
        """Measure the contact points between the same features, with the corners (n_vertices, 2) [m] elsewhere."""
        return measured_points(self, vertices, contacts.features, contacts.areas)

    def overlaps(self, vertices: np.ndarray, tolerance: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Pairs of blocks that overlap by more than ``tolerance`` [m]; see :func:`overlap_depths`."""
        return overlap_depths(vertices, self.offsets, tolerance)

    def entered(
        self, before: np.ndarray, after: np.ndarray, useful: np.ndarray, tolerance: float, contacts: Contacts
    ) -> Contacts:
        """Contact points beside those given that would have kept apart what a movement has put into each other.

        Measured before it, of corners (n_vertices, d) [m] before and after, of overlaps of more than ``tolerance`` [m]
        with useful blocks.
        """
        i, j, _ = overlap_depths(after, self.offsets, tolerance)
        chosen = useful[i] | useful[j]
        vertex, edge = passed_edges(self, before, after, i[chosen], j[chosen])
        points = measured_points(self, before, features_of(vertex, edge, np.full(len(edge), -1)))
        return points[~are_known(points, contacts)]
