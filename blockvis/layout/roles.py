"""Roles of the blocks of a layout: what the caller says, else what the file says."""

from __future__ import annotations

import itertools
from collections.abc import Mapping

import numpy as np

from blockvis.text import by_similarity, listed
from solver import mechanics

from .layout import Layout
from .left_out import matches
from .repair import duplicates


def checked_role(role: str, whose: str) -> str:
    """Return the role if it is one; ``whose`` is named in the error."""
    if role not in mechanics.ROLES:
        raise ValueError(f"{whose} has role '{role}'; roles are {', '.join(mechanics.ROLES)}")
    return role


def roles_of(layout: Layout, roles: Mapping[str, str], *, all_match: bool = True) -> list[str]:
    """Role of every block: the caller's, else the file's, else its group or name if that is a role, else free.

    Keys that match no block are refused, or left out where some blocks are still to come.
    """
    found = [_drawn_role(layout, i) for i in range(layout.n_blocks)]
    own = mechanics.unique_names(layout.names)
    labels = list(zip(layout.names, layout.groups, layout.materials, strict=True))
    # Of keys that hold for one block a pattern has the first word, and the block's own name the last.
    ranked: tuple[list[tuple[list[int], str]], ...] = [], [], [], []
    for key, role in roles.items():
        checked_role(role, f"roles: '{key}'")
        hits = [
            [],
            [i for i, (_, group, material) in enumerate(labels) if key in (group, material)],
            [i for i, name in enumerate(layout.names) if name == key],
            [i for i, name in enumerate(own) if name == key],
        ]
        if not any(hits):
            hits[0] = [i for i, words in enumerate(labels) if matches(filter(None, words), [key])]
        if not any(hits) and all_match:
            raise ValueError(_unmatched(key, layout))
        for rank, blocks in zip(ranked, hits, strict=True):
            rank.append((blocks, role))
    for blocks, role in itertools.chain(*ranked):
        for i in blocks:
            found[i] = role
    return found


def _drawn_role(layout: Layout, block: int) -> str:
    said = (layout.roles[block], layout.groups[block].strip().lower(), layout.names[block].strip().lower())
    return next((word for word in said if word in mechanics.ROLES), mechanics.FREE)


def told_apart(layout: Layout, roles: Mapping[str, str]) -> tuple[list[tuple[int, int]], np.ndarray]:
    """Find pairs of blocks drawn in one place, first and later copy, and the (n,) blocks that stay.

    The copy goes, or the first where only the copy holds.
    """
    twins = duplicates(layout.every_corner)
    said = roles_of(layout, roles, all_match=False) if twins else []
    dropped = [first if said[first] == mechanics.FREE != said[copy] else copy for first, copy in twins]
    return twins, np.setdiff1d(np.arange(layout.n_blocks), dropped)


def without_twins(layout: Layout, roles: Mapping[str, str]) -> tuple[Layout, str]:
    """Drop blocks that are drawn in the place of another, and say which, in favour of which; "" for none."""
    twins, kept = told_apart(layout, roles)
    if not twins:
        return layout, ""
    stays = set(kept.tolist())
    pairs = [(first, copy) if copy in stays else (copy, first) for first, copy in twins]
    names = [f"'{layout.names[gone]}' = '{layout.names[other]}'" for gone, other in pairs]
    said = "is drawn twice and was dropped" if len(twins) == 1 else "are drawn twice and were dropped"
    return layout.chosen(kept), f"{len(twins)} of {layout.n_blocks} blocks {said}: {listed(names, 20)}"


def _unmatched(key: str, layout: Layout) -> str:
    groups = [*dict.fromkeys(label for label in (*layout.groups, *layout.materials) if label)]
    labels = [*dict.fromkeys((*groups, *(name for name in layout.names if name)))]
    # Layers are few, and names of blocks that no one gave would hide them.
    nearest_ones = by_similarity(key, labels[:2000])
    shown = [*dict.fromkeys((*nearest_ones[:1], *by_similarity(key, groups[:2000])[:6], *nearest_ones))][:12]
    labelled = ", ".join(f"'{label}'" for label in shown)
    more = f" and {len(labels) - 12} more" if len(labels) > 12 else ""
    where = layout.source or "the drawing"
    return f"roles: '{key}' matches no block, group or layer of {where}; it has {labelled}{more}; correct the name"
