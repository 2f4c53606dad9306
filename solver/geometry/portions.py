"""Portions: what has as many members each is worked on at once, in arrays that fit into memory."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

#: Arrays of no more than so many numbers are worked on at a time.
PORTION = 2_000_000


def alike(*counts: np.ndarray) -> Iterator[np.ndarray]:
    """Numbers of the items that have the same counts, in portions.

    Parameters
    ----------
    *counts : (n,) int arrays
        An item's array has the product of these as its size.
    """
    keys = np.zeros(len(counts[0]), dtype=np.int64)
    for count in counts:
        keys = keys * (int(count.max(initial=0)) + 1) + count
    order = np.argsort(keys, kind="stable")
    for group in np.split(order, np.flatnonzero(np.diff(keys[order])) + 1):
        if len(group):
            portion = max(1, PORTION // max(1, int(np.prod([count[group[0]] for count in counts]))))
            yield from np.split(group, np.arange(portion, len(group), portion))
