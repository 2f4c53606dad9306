"""Names and materials of blocks that a case gives, where several blocks may be drawn with one name."""

from __future__ import annotations

from collections.abc import Sequence

import solver
from blockvis.text import listed, nearest

from .left_out import matches


def blocks_called(name: str, assembly: solver.Assembly) -> list[int]:
    """Numbers of the blocks that have a name, their own or the one with which they were drawn."""
    return [i for i, both in enumerate(zip(assembly.names, assembly.drawn_names, strict=True)) if name in both]


def blocks_matching(pattern: str, assembly: solver.Assembly, where: str) -> list[int]:
    """Numbers of the blocks that have a name; of none those whose name fits the pattern, else whose material does.

    ValueError, which begins with where the pattern stands, if there is none.
    """
    found = blocks_called(pattern, assembly) or named_like(pattern, assembly.names)
    found = found or [i for i in named_like(pattern, assembly.materials) if assembly.materials[i]]
    if not found:
        materials = [*dict.fromkeys(filter(None, assembly.materials))]
        known = f"the blocks are {listed(assembly.names, 12)}"
        known += f"; the materials are {listed(materials, 12)}" if materials else ""
        near = nearest(pattern, [*assembly.names, *materials])
        raise ValueError(f"{where}: no block and no material is named '{pattern}'{near}; {known}")
    return found


def named_like(pattern: str, names: Sequence[str]) -> list[int]:
    """Numbers of the names that fit a pattern."""
    return [i for i, name in enumerate(names) if matches([name], [pattern])]
