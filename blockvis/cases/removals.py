"""What is taken away between the settlements of a case: the tables [[remove]]."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

import solver
from blockvis.text import listed, nearest

from .block_at import blocks_matching, named_like
from .key import TEXTS, Key, Section, whole
from .toml_table import Table

REMOVE = Section(
    "remove",
    "Blocks or ties that are taken away before a settlement; what stands comes to rest without them first",
    (
        Key("phase", whole(1), "Number of the [[settlement]] before which they are taken away", 2, required=True,
            remedy="give the number of the [[settlement]] before which they are taken away, from 1"),
        Key("blocks", TEXTS, "Names of the blocks, or patterns of them, or materials, of drawings layers",
            ["prop", "brick 4-*"], otherwise="none", default=()),
        Key("ties", TEXTS, "Names of the ties, or patterns of them", ["tie 1"], otherwise="none", default=()),
    ),
    several=True,
)  # fmt: skip


@dataclass(frozen=True)
class Removal:
    """A table [[remove]], by its keys; ``where`` are file and table, for messages."""

    phase: int
    blocks: tuple[str, ...] = ()
    ties: tuple[str, ...] = ()
    where: str = ""


def read_removal(table: Table) -> Removal:
    """Read a table [[remove]]."""
    values = REMOVE.read(table)
    if not values["blocks"] and not values["ties"]:
        raise table.error("blocks", 'is missing; name what is taken away: blocks = ["prop"]')
    return Removal(**values, where=f"{table.source}: [{table.where}]")


def removed_blocks(removal: Removal, assembly: solver.Assembly) -> np.ndarray:
    """(n_blocks,) bool array: blocks that a table takes away; ValueError for a name that no block has."""
    gone = np.zeros(assembly.n_blocks, dtype=bool)
    for pattern in removal.blocks:
        gone[blocks_matching(pattern, assembly, f"{removal.where} blocks")] = True
    return gone


def gone_in(removals: Sequence[Removal], assembly: solver.Assembly, phase: int) -> np.ndarray:
    """(n_blocks,) bool array: blocks that have been taken away before a settlement, counted from 1, or earlier."""
    gone = [removed_blocks(one, assembly) for one in removals if one.phase <= phase]
    return np.any([np.zeros(assembly.n_blocks, dtype=bool), *gone], axis=0)


def removed_ties(removal: Removal, ties: Sequence[solver.Tie]) -> tuple[str, ...]:
    """Names of the ties that a table takes away.

    ValueError for a name that no tie has, and a tie that is installed later.
    """
    names, chosen = [tie.name for tie in ties], list[str]()
    for pattern in removal.ties:
        numbers = named_like(pattern, names)
        if not numbers:
            known = f"the ties are {listed(names, 12)}" if names else "the case has no ties"
            raise ValueError(f"{removal.where} ties: no tie is named '{pattern}'{nearest(pattern, names)}; {known}")
        chosen += [names[i] for i in numbers]
    late = next((tie for tie in ties if tie.name in chosen and tie.phase >= removal.phase), None)
    if late is not None:
        raise ValueError(
            f"{removal.where} ties: '{late.name}' is installed before settlement {late.phase}, and taken away before "
            f"settlement {removal.phase}; give phase = {late.phase + 1} or later, or leave it out"
        )
    return tuple(chosen)
