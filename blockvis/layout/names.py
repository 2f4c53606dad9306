"""Names of blocks that a case gives, where several blocks may be drawn with one name."""

from __future__ import annotations

from collections.abc import Sequence

import solver

from .left_out import matches


def blocks_called(name: str, assembly: solver.Assembly) -> list[int]:
    """Numbers of the blocks that have a name, their own or the one with which they were drawn."""
    return [i for i, both in enumerate(zip(assembly.names, assembly.drawn_names, strict=True)) if name in both]


def blocks_matching(pattern: str, assembly: solver.Assembly) -> list[int]:
    """Numbers of the blocks that have a name, or where there is none those whose name fits the pattern."""
    return blocks_called(pattern, assembly) or named_like(pattern, assembly.names)


def named_like(pattern: str, names: Sequence[str]) -> list[int]:
    """Numbers of the names that fit a pattern."""
    return [i for i, name in enumerate(names) if matches([name], [pattern])]
