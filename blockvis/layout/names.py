"""Names of blocks that a case gives, where several blocks may be drawn with one name."""

from __future__ import annotations

from collections.abc import Sequence

from .left_out import matches


def drawn_names(names: Sequence[str]) -> list[str]:
    """Name each block as it was drawn: an assembly calls the second block with one name "pier #2".

    Examples
    --------
    >>> drawn_names(["pier", "pier #2", "stone #2"])
    ['pier', 'pier', 'stone #2']
    """
    known = set(names)
    parts = [name.rpartition(" #") for name in names]
    return [
        first if number.isdigit() and first in known else name
        for name, (first, _, number) in zip(names, parts, strict=True)
    ]


def blocks_called(name: str, names: Sequence[str]) -> list[int]:
    """Numbers of the blocks that have a name, their own or the one with which they were drawn."""
    return [i for i, both in enumerate(zip(names, drawn_names(names), strict=True)) if name in both]


def blocks_matching(pattern: str, names: Sequence[str]) -> list[int]:
    """Numbers of the blocks that have a name, or where there is none those whose name fits the pattern."""
    return blocks_called(pattern, names) or [i for i, name in enumerate(names) if matches([name], [pattern])]
