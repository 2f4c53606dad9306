"""Contacts: the contact points at one geometry, and the same ones at another."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Protocol

import numpy as np

from .broad_phase import expand_ranges
from .solids import ROUNDING, unit

#: Faces that cover each other on a strip may touch if its gap is at most this part of its width; others slide past.
STEEPEST_LANDING = 0.25

#: Distance, in block sizes, up to which a point takes over from one that has vanished, twice the longest step, and for
#: which a normal turned by 1 counts beside it.
FAR_SUCCESSOR = 0.1


@dataclass(frozen=True)
class Contacts:
    """Contact points at one geometry, in the plane or in space, contact on axis 0."""

    #: (n, 4) int: kind of contact, feature of ``block_a``, feature of ``block_b``, and what else the geometry needs to
    #: measure it again. The first three name the contact point; their meaning is that of the geometry.
    features: np.ndarray
    block_a: np.ndarray  #: (n,) int; -1 for the ground, which holds ends of ties
    block_b: np.ndarray  #: (n,) int, likewise
    points: np.ndarray  #: (n, d) [m]
    #: (n, d, d), row 0: unit normal from ``block_b`` into ``block_a``; then the tangents, in the plane one, a quarter
    #: turn counter-clockwise.
    frames: np.ndarray
    gaps: np.ndarray  #: (n,) [m], positive where open
    #: (n, d - 1) [m]: position of the feature of ``block_a`` along the tangents, from a place fixed on ``block_b``.
    slip: np.ndarray
    areas: np.ndarray  #: (n,) [m²]: tributary area of each contact point; zero for a corner alone

    def __len__(self) -> int:
        """Count the contact points."""
        return len(self.features)

    def __getitem__(self, chosen: np.ndarray) -> Contacts:
        """Choose some of the contact points, by a mask or their numbers."""
        return Contacts(**{field.name: getattr(self, field.name)[chosen] for field in fields(self)})

    def joints(self) -> tuple[np.ndarray, np.ndarray]:
        """Pairs of blocks, (n_joints, 2) int, ascending and the lower first, and that of each contact point, (n,)."""
        keys, joint = np.unique(self.pair_keys(), return_inverse=True)
        return np.stack([keys >> 32, keys & 0xFFFFFFFF], axis=1), joint.ravel()

    def pair_keys(self) -> np.ndarray:
        """(n,) int array: a number for each pair of blocks, that of the lower one first."""
        return np.minimum(self.block_a, self.block_b).astype(np.int64) << 32 | np.maximum(self.block_a, self.block_b)


def frames_of(normals: np.ndarray) -> np.ndarray:
    """(n, d, d) array: frames with these unit normals (n, d); in space the tangents are any two."""
    if normals.shape[1] == 2:
        return np.stack([normals, np.stack([-normals[:, 1], normals[:, 0]], axis=1)], axis=1)
    first = unit(np.cross(normals, np.eye(3)[np.argmin(np.abs(normals), axis=1)]))
    return np.stack([normals, first, np.cross(normals, first)], axis=1)


def joined_contacts(groups: Sequence[Contacts]) -> Contacts:
    """Put groups of contact points, at least one, into one."""
    return Contacts(*(np.concatenate([getattr(g, field.name) for g in groups]) for field in fields(Contacts)))


class Named(Protocol):
    """What has features that name contact points."""

    @property
    def features(self) -> np.ndarray:
        """(n, 3) or (n, 4) int array."""


def matched_contacts(contacts: Named, before: Named) -> tuple[np.ndarray, np.ndarray]:
    """Find contact points among those before: numbers, (n,) int, and whether they were there, (n,) bool; else any."""
    if not len(before.features):
        return np.zeros(len(contacts.features), dtype=np.int64), np.zeros(len(contacts.features), dtype=bool)
    features, old = contacts.features[:, :3].astype(np.int64), before.features[:, :3].astype(np.int64)
    kinds, _, count = np.maximum(features.max(axis=0, initial=0), old.max(axis=0, initial=0)) + 1
    keys, earlier_keys = ((f[:, 1] * kinds + f[:, 0]) * count + f[:, 2] for f in (features, old))
    order = np.argsort(earlier_keys, kind="stable")
    place = order[np.minimum(np.searchsorted(earlier_keys[order], keys), len(earlier_keys) - 1)]
    return place, earlier_keys[place] == keys


def are_known(contacts: Contacts, known: Contacts) -> np.ndarray:
    """(n,) bool array: whether contact points are among those known, by their names and normals."""
    number, same = matched_contacts(contacts, known)
    k = np.flatnonzero(same)
    same[k] = np.einsum("ni,ni->n", contacts.frames[k, 0], known.frames[number[k], 0]) > 1.0 - ROUNDING
    return same


def successors(
    before: Contacts, vanished: np.ndarray, contacts: Contacts, size: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Find the contact points that stand where others of the same two blocks have vanished, with the nearest normals.

    A force that went over to another face of the two blocks would lose there what that one's friction does not hold.
    Of the ``vanished``, (k,) int, those (m,) are given that have any, with the successor of each, (m,) int, and its
    share, (m,): equally near ones, by the size of blocks [m], share what one passes, so that their order is no matter.
    """
    old, new = before.pair_keys()[vanished], contacts.pair_keys()
    order = np.argsort(new, kind="stable")
    first, last = (np.searchsorted(new[order], old, side) for side in ("left", "right"))
    row, position = expand_ranges(last - first)
    successor, earlier = order[first[row] + position], vanished[row]
    sense = np.where(before.block_a[earlier] == contacts.block_a[successor], 1.0, -1.0)[:, None]
    apart = np.linalg.norm(before.points[earlier] - contacts.points[successor], axis=1)
    turned = np.linalg.norm(sense * before.frames[earlier, 0] - contacts.frames[successor, 0], axis=1)
    near, least = apart < FAR_SUCCESSOR * size, np.full(len(vanished), np.inf)
    measure = apart + FAR_SUCCESSOR * size * turned
    np.minimum.at(least, row[near], measure[near])
    chosen = (measure <= least[row] + ROUNDING * size) & near
    row = row[chosen]
    return vanished[row], successor[chosen], 1.0 / np.bincount(row)[row]
