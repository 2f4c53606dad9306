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

#: Points between others count as on the straight line between them up to this angle [rad].
STRAIGHT = 1e-3


def without_points_of_cuts(parts: ConvexParts, contacts: Contacts, planes: np.ndarray) -> tuple[Contacts, np.ndarray]:
    """Leave out points at cuts that lie between others in the same two faces.

    Parameters
    ----------
    parts : ConvexParts
    contacts : Contacts
    planes : (n, 2) int array
        The planes of the two faces in which each point was found; -1 where it was not found between faces.

    Returns
    -------
    contacts : Contacts
    kept : (n_left,) int array
        Their numbers before.

    Notes
    -----
    Blocks are rigid and both faces plane: the gap at a point between others follows from theirs, and what it carries
    they can carry as well. Its area goes to them.
    """
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
    group = group.ravel()
    at_cut = np.zeros(group.max(initial=-1) + 1, dtype=bool)
    at_cut[group[of_cut]] = True
    chosen = np.flatnonzero(at_cut[group])
    if len(chosen) == 0:
        return contacts, np.arange(len(contacts))
    chosen = chosen[np.argsort(group[chosen], kind="stable")]
    _, start, where = np.unique(group[chosen], return_index=True, return_inverse=True)
    where = where.ravel()
    # In the plane of the first point of each group, from there.
    origin, frame = contacts.points[chosen[start]][where], contacts.frames[chosen[start]][where]
    arms = contacts.points[chosen] - origin
    places = np.stack([dot(arms, frame[:, 1]), dot(arms, frame[:, 2])], axis=1)

    # The widest angle in which a point at a cut sees none of the others that are at no cut.
    asked = np.flatnonzero(of_cut[chosen])
    counts = np.bincount(where)
    owner, position = expand_ranges(counts[where[asked]])
    other = start[where[asked]][owner] + position
    owner, other = owner[~of_cut[chosen[other]]], other[~of_cut[chosen[other]]]
    ways = places[other] - places[asked[owner]]
    angles = np.arctan2(ways[:, 1], ways[:, 0])
    order = np.lexsort((angles, owner))
    owner, angles = owner[order], angles[order]
    lowest, highest = np.full(len(asked), np.pi), np.full(len(asked), -np.pi)
    np.minimum.at(lowest, owner, angles)
    np.maximum.at(highest, owner, angles)
    widest = lowest - highest + 2.0 * np.pi
    next_to = np.flatnonzero(np.diff(owner) == 0)
    np.maximum.at(widest, owner[next_to], np.diff(angles)[next_to])
    between = asked[widest <= np.pi + STRAIGHT]
    if len(between) == 0:
        return contacts, np.arange(len(contacts))

    total = np.bincount(where, contacts.areas[chosen])
    left = np.ones(len(chosen), dtype=bool)
    left[between] = False
    shares, _, _ = corner_areas(where[left], places[left], len(total))
    whole = np.bincount(where[left], shares, minlength=len(total))
    areas = contacts.areas.copy()
    areas[chosen[left]] = shares * (total / np.maximum(whole, 1e-300))[where[left]]
    kept = np.setdiff1d(np.arange(len(contacts)), chosen[between])
    return replace(contacts, areas=areas)[kept], kept
