"""Contact points between others, in faces of blocks that were cut into convex parts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .clipping import corner_areas
from .contacts import Contacts
from .convex_parts import ConvexParts
from .portions import alike
from .solids import taken

#: Points are on a line where the angle between others is this near to a half turn.
STRAIGHT = 1e-3


def without_points_of_cuts(
    parts: ConvexParts, contacts: Contacts, planes: np.ndarray, near: float
) -> tuple[Contacts, np.ndarray]:
    """Leave out points that lie between others in the same two faces, where one of these was cut.

    With the numbers that the remaining points had, (n_remaining,) int. Points up to ``near`` [m] apart are at one
    place; ``planes``, (n, 2) int, are those of the two faces between which each was found, -1 where it was not.

    Blocks are rigid and both faces plane: the gap at a point between others follows from theirs, and what it carries
    they can carry as well. The corners of what all points of two faces span share the area in which these touch,
    whichever way the faces were cut.
    """
    from scipy.spatial import cKDTree

    in_several = (np.bincount(parts.plane)[planes] > 1).any(axis=1)
    _, group = np.unique(planes, axis=0, return_inverse=True)
    chosen = np.flatnonzero(np.isin(group, group[in_several]) & (planes[:, 0] >= 0))
    chosen = chosen[np.argsort(group[chosen], kind="stable")]
    _, start, group_of, counts = np.unique(group[chosen], return_index=True, return_inverse=True, return_counts=True)
    pairs = cKDTree(contacts.points[chosen]).query_pairs(near, output_type="ndarray")
    pairs = pairs[group_of[pairs[:, 0]] == group_of[pairs[:, 1]]]
    # In the plane of the first point of each group, from there.
    origin, frame = contacts.points[chosen[start]][group_of], contacts.frames[chosen[start]][group_of]
    places = np.einsum("ni,nki->nk", contacts.points[chosen] - origin, frame[:, 1:])

    # The widest angle at each point without another point elsewhere.
    between = np.zeros(len(chosen), dtype=bool)
    for k, others in alike((np.append(start, len(chosen)), group_of), filled=True):
        arms = taken(places, others) - taken(places, k)[:, None]
        elsewhere, angles = np.abs(arms).max(axis=2) > near, np.arctan2(arms[..., 1], arms[..., 0])
        lowest = np.where(elsewhere, angles, np.pi).min(axis=1)[:, None]
        angles = np.sort(np.where(elsewhere, angles, lowest), axis=1)
        widest = np.diff(angles, append=lowest + 2.0 * np.pi, axis=1).max(axis=1)
        between[k] = widest <= np.pi + STRAIGHT

    # Each place once, though several parts have a corner there.
    spans = ~between
    spans[pairs[spans[pairs].all(axis=1)].max(axis=1)] = False
    shares, _ = corner_areas(group_of[spans], places[spans], len(counts))
    share_sum = np.bincount(group_of[spans], shares, minlength=len(counts))
    per_share = np.bincount(group_of, contacts.areas[chosen]) / np.maximum(share_sum, 1e-300)
    areas = contacts.areas.copy()
    areas[chosen] = 0.0
    areas[chosen[spans]] = shares * per_share[group_of[spans]]
    remaining = np.setdiff1d(np.arange(len(contacts)), chosen[between])
    return replace(contacts, areas=areas)[remaining], remaining
