"""Contacts: the contact points at one geometry, and the same ones at another."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from solver.assembly import Assembly


@dataclass(frozen=True)
class Contacts:
    """Contact points at one geometry, contact on axis 0.

    Attributes
    ----------
    vertex : (n,) int array
        The corner, of ``block_a``.
    edge : (n,) int array
        The edge it faces, of ``block_b``, named by the vertex it starts at.
    corner : (n,) int array
        Where a corner stands on a corner: the vertex of ``block_b``; -1 elsewhere.
    block_a, block_b : (n,) int arrays
    points : (n, 2) array [m]
    frames : (n, 2, 2) array
        Row 0: unit normal from ``block_b`` into ``block_a``; row 1: tangent, a quarter turn counter-clockwise.
    gaps : (n,) array [m]
        Positive where open.
    along : (n,) array [m]
        Position of the corner along the tangent, from the end of the edge or from the other corner.
    """

    vertex: np.ndarray
    edge: np.ndarray
    corner: np.ndarray
    block_a: np.ndarray
    block_b: np.ndarray
    points: np.ndarray
    frames: np.ndarray
    gaps: np.ndarray
    along: np.ndarray

    def __len__(self) -> int:
        return len(self.vertex)

    def keys(self, assembly: Assembly) -> np.ndarray:
        """(n,) int array: a number for each contact that stays the same from one geometry to the next."""
        n = len(assembly.vertices)
        return np.where(self.corner >= 0, self.corner + n, self.edge) + 2 * n * self.vertex.astype(np.int64)


def matched_contacts(assembly: Assembly, contacts: Contacts, before: Contacts) -> tuple[np.ndarray, np.ndarray]:
    """For each contact, its number among those before, and whether it was there."""
    keys, known = contacts.keys(assembly), before.keys(assembly)
    order = np.argsort(known, kind="stable")
    place = order[np.minimum(np.searchsorted(known[order], keys), len(known) - 1)]
    return place, known[place] == keys
