"""Portions: what has as many members is worked on at once, in arrays that fit into memory; groups that pairs link."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from math import prod

import numpy as np

#: Arrays of no more than so many numbers are worked on at a time.
PORTION = 100_000


def alike(*groups: tuple[np.ndarray, np.ndarray], filled: bool = False) -> Iterator[tuple[np.ndarray, ...]]:
    """Numbers of the items whose owners have as many members each, in portions, and these members.

    Or of those which have no more than twice as many as others, ``filled`` up with the last member of each.

    Of each group owner ``i`` has the members from entry ``i`` to entry ``i + 1`` of the first, (n_owners + 1,) int, and
    item ``k`` the owner in entry ``k`` of the second, (n,) int. Yields items, (m,) int, and for each group their
    members, (m, n_members) int. An item's array has the product of the numbers of its members as its size.
    """
    counts = [np.diff(offsets)[owner] for offsets, owner in groups]
    keys = np.zeros(len(counts[0]), dtype=np.int64)
    for count in counts:
        keys = keys * (int(count.max(initial=0)) + 1) + (np.frexp(count)[1] if filled else count)
    order = np.argsort(keys, kind="stable")
    changes = np.flatnonzero(np.diff(keys[order], append=-1)) + 1
    for first, end in pairwise([0, *changes.tolist()]):
        sizes = [int(count[order[first:end]].max()) for count in counts]
        portion = max(1, PORTION // max(1, prod(sizes)))
        for start in range(first, end, portion):
            items = order[start : min(start + portion, end)]
            # Items come next to each other in memory: numpy is fast along the longest axis alone.
            members = (
                (offsets[owner[items]] + np.minimum(np.arange(size)[:, None], count[items] - 1)).T
                for (offsets, owner), size, count in zip(groups, sizes, counts, strict=True)
            )
            yield items, *members


def at_largest(values: np.ndarray, *others: np.ndarray) -> list[np.ndarray]:
    """Find the largest value, (n, m), of each row, the first of equal ones, and what others have there, (n,) arrays."""
    there = np.arange(len(values)), values.argmax(axis=1)
    return [given[there] for given in (values, *others)]


def linked(pairs: np.ndarray | tuple[np.ndarray, np.ndarray], n: int) -> np.ndarray:
    """(n,) int array: group of each of n items that pairs, (2, n_pairs) int, link; numbered by their first members."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    links = coo_array((np.ones(len(pairs[0])), tuple(pairs)), shape=(n, n))
    return np.asarray(connected_components(links, directed=False)[1])
