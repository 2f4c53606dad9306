"""Contact points that are there only because a block was cut into convex parts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .broad_phase import expand_ranges
from .clipping import corner_areas
from .contacts import Contacts
from .convex_parts import ConvexParts
from .solids import dot
from .spatial_features import ACROSS, ON_FACE


def without_points_of_cuts(
    parts: ConvexParts, contacts: Contacts, planes: np.ndarray, near: float
) -> tuple[Contacts, np.ndarray]:
    """Leave out points at cuts that lie between others in the same two faces.

    With the numbers that the remaining points had, (n_remaining,) int. Points up to ``near`` [m] apart are at one
    place; ``planes``, (n, 2) int, are those of the two faces between which each was found, -1 where it was not.

    Blocks are rigid and both faces plane: the gap at a point between others follows from theirs, and what it carries
    they can carry as well. Its area goes to them.
    """
    from scipy.spatial import cKDTree

    solids, (kind, first, second, _) = parts.solids, contacts.features.T
    cut, made, corners = parts.cut_edges, parts.made, solids.corners
    edge = np.where(kind == ON_FACE, 0, first)
    of_cut = np.where(
        kind == ON_FACE,
        made[np.where(kind == ON_FACE, first, 0)],
        np.where(kind == ACROSS, cut[edge] | cut[second], made[corners[edge]] & made[corners[second]]),
    )
    of_cut &= planes[:, 0] >= 0
    _, group = np.unique(planes, axis=0, return_inverse=True)
    chosen = np.flatnonzero(np.isin(group, group[of_cut]))
    chosen = chosen[np.argsort(group[chosen], kind="stable")]
    _, start, group_of = np.unique(group[chosen], return_index=True, return_inverse=True)
    # A part that has a face of its block in the plane of the cut has no edge at it; the part beyond the cut has.
    pairs = cKDTree(contacts.points[chosen]).query_pairs(near, output_type="ndarray")
    pairs = pairs[group_of[pairs[:, 0]] == group_of[pairs[:, 1]]]
    beside = chosen[np.concatenate([pairs[of_cut[chosen[pairs[:, k]]], 1 - k] for k in (0, 1)])]
    of_cut[beside[kind[beside] == ACROSS]] = True
    # In the plane of the first point of each group, from there.
    origin, frame = contacts.points[chosen[start]][group_of], contacts.frames[chosen[start]][group_of]
    arms = contacts.points[chosen] - origin
    places = np.stack([dot(arms, frame[:, 1]), dot(arms, frame[:, 2])], axis=1)

    # The widest angle at a point of a cut without another point that is at no cut.
    at_cuts = np.flatnonzero(of_cut[chosen])
    counts = np.bincount(group_of)
    owner, position = expand_ranges(counts[group_of[at_cuts]])
    other = start[group_of[at_cuts]][owner] + position
    owner, other = owner[~of_cut[chosen[other]]], other[~of_cut[chosen[other]]]
    arms_to = places[other] - places[at_cuts[owner]]
    angles = np.arctan2(arms_to[:, 1], arms_to[:, 0])
    order = np.lexsort((angles, owner))
    owner, angles = owner[order], angles[order]
    lowest, highest = np.full(len(at_cuts), np.pi), np.full(len(at_cuts), -np.pi)
    np.minimum.at(lowest, owner, angles)
    np.maximum.at(highest, owner, angles)
    widest = lowest - highest + 2.0 * np.pi
    next_to = np.flatnonzero(np.diff(owner) == 0)
    np.maximum.at(widest, owner[next_to], np.diff(angles)[next_to])
    between = at_cuts[widest <= np.pi + 1e-3]
    if len(between) == 0:
        return contacts, np.arange(len(contacts))

    total = np.bincount(group_of, contacts.areas[chosen])
    remaining = np.ones(len(chosen), dtype=bool)
    remaining[between] = False
    shares, _, _ = corner_areas(group_of[remaining], places[remaining], len(total))
    share_sum = np.bincount(group_of[remaining], shares, minlength=len(total))
    areas = contacts.areas.copy()
    areas[chosen[remaining]] = shares * (total / np.maximum(share_sum, 1e-300))[group_of[remaining]]
    remaining_points = np.setdiff1d(np.arange(len(contacts)), chosen[between])
    return replace(contacts, areas=areas)[remaining_points], remaining_points
