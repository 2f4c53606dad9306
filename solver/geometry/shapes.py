"""Shapes: geometry of the blocks, in the plane or in space."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from .contacts import Contacts


class Shapes(Protocol):
    """The shapes of all blocks: their sizes, and their contact points.

    The number of dimensions d follows from the shape of the arrays. ``Contacts.features``, the corners, edges and faces
    that meet, have a meaning for the shapes that found them only.
    """

    @property
    def vertices(self) -> np.ndarray:
        """(n_vertices, d) array [m]: corners of all blocks as drawn."""

    @property
    def block_of_vertex(self) -> np.ndarray:
        """(n_vertices,) int array: the block each corner belongs to."""

    @property
    def volumes(self) -> np.ndarray:
        """(n_blocks,) array [m³]."""

    @property
    def centroids(self) -> np.ndarray:
        """(n_blocks, d) array [m] as drawn."""

    @property
    def widths(self) -> np.ndarray:
        """(n_blocks,) array [m]: how thick each block is where it is thin."""

    @property
    def sizes(self) -> np.ndarray:
        """(n_blocks,) array [m]: edge of the square or cube as large as each block."""

    @property
    def gyration(self) -> np.ndarray:
        """(n_blocks,) array [m²]: square of the radius of gyration of each block; in space the mean about all axes."""

    def size(self, chosen: np.ndarray) -> float:
        """Edge of the square or cube as large as the mean of the chosen blocks, (n_blocks,) bool, [m]."""

    def shifted(self, by: np.ndarray) -> Shapes:
        """Move the drawing by (d,) [m]."""

    def find(self, vertices: np.ndarray, reach: float, useful: np.ndarray) -> Contacts:
        """Find contact points with a gap up to ``reach`` [m], one of their blocks of the useful, (n_blocks,) bool."""

    def measure(self, vertices: np.ndarray, contacts: Contacts) -> Contacts:
        """Measure the contact points between the same features, with the corners (n_vertices, d) [m] elsewhere."""

    def overlaps(self, vertices: np.ndarray, tolerance: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Pairs of blocks that overlap by more than ``tolerance`` [m]: two (n_pairs,) int arrays, and the depths."""

    def entered(
        self, before: np.ndarray, after: np.ndarray, useful: np.ndarray, tolerance: float, contacts: Contacts
    ) -> Contacts:
        """Contact points beside those given that would have kept apart what a movement has put into each other.

        Measured before it, of corners (n_vertices, d) [m] before and after, of overlaps of more than ``tolerance`` [m]
        with useful blocks.
        """
