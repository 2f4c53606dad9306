"""Fill over arches and vaults: the tables [[backfill]], and the loads that are made of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path

import numpy as np

import solver
from blockvis.text import nearest

from .extrados import SLIVER, extrados
from .key import NOT_NEGATIVE, NUMBER, POSITIVE, TEXTS, Key, Section
from .toml_table import Table

BACKFILL = Section(
    "backfill",
    "Loose fill over arches and vaults: its weight and pressure on what looks upwards and sees its surface",
    (
        Key("over", TEXTS, "Names of the blocks under it, or patterns of them, or materials", ["voussoir *"],
            required=True, remedy='name the blocks under the fill: over = ["voussoir *"]'),
        Key("surface", NUMBER, "Height of its top, which is level", 2.5, "m", required=True,
            remedy="give the height of the fill's top in m"),
        Key("unit_weight", POSITIVE, "Weight of a cubic metre of it", 18000.0, "N/m³", required=True,
            remedy="give the weight of a cubic metre in N, for instance 18000.0"),
        Key("pressure_coefficient", NOT_NEGATIVE, "Horizontal pressure as a part of the vertical one", 0.5,
            default=0.0),
    ),
    several=True,
)  # fmt: skip


@dataclass(frozen=True)
class BackfillCase:
    """A table [[backfill]].

    Attributes
    ----------
    over : tuple of str
        Names or materials of blocks, or patterns.
    surface : float [m]
    unit_weight : float [N/m³]
    pressure_coefficient : float
    where : str
        File and table, for messages.
    """

    over: tuple[str, ...]
    surface: float
    unit_weight: float
    pressure_coefficient: float = 0.0
    where: str = ""


def read_backfill(table: Table) -> BackfillCase:
    """Read a table [[backfill]]."""
    values = BACKFILL.read(table)
    if not values["over"]:
        raise table.error("over", 'is empty; name the blocks under the fill: over = ["voussoir *"]')
    return BackfillCase(**values, where=table.where)


def backfills(entries: Sequence[BackfillCase], assembly: solver.Assembly, source: Path) -> tuple[solver.Backfill, ...]:
    """Make the fills of a case.

    Parameters
    ----------
    entries : sequence of BackfillCase
    assembly : solver.Assembly
    source : Path
        The case file, for messages.

    Raises
    ------
    ValueError
        For a name that no free block has, a surface below the extrados of a block, blocks of which none sees it.
    """
    return tuple(_fill(entry, assembly, f"{source}: [{entry.where}]") for entry in entries)


def _fill(entry: BackfillCase, assembly: solver.Assembly, where: str) -> solver.Backfill:
    pieces, block = extrados(assembly, _chosen(entry, assembly, where), entry.surface)
    if not len(pieces):
        raise ValueError(
            f"{where} over: none of {_listed(entry.over)} looks up to the surface; name the topmost blocks"
        )
    heights = pieces[:, :, -1].max(axis=1)
    highest = int(heights.argmax())
    if heights[highest] > entry.surface + SLIVER * assembly.block_size:
        raise ValueError(
            f"{where} surface is {entry.surface:g} m, below the extrados of block '{assembly.names[block[highest]]}', "
            f"which reaches {heights[highest]:.6g} m; raise it, or leave the block out of over"
        )
    thickness = assembly.thickness[block] if assembly.dimension == 2 else None
    return solver.Backfill(pieces, block, entry.surface, entry.unit_weight, entry.pressure_coefficient, thickness)


def _chosen(entry: BackfillCase, assembly: solver.Assembly, where: str) -> np.ndarray:
    """(n_blocks,) bool array: the free blocks that the entry names."""
    names, chosen = assembly.names, np.zeros(assembly.n_blocks, dtype=bool)
    for pattern in entry.over:
        meant = [
            fnmatchcase(name, pattern) or (material != "" and fnmatchcase(material, pattern))
            for name, material in zip(names, assembly.materials, strict=True)
        ]
        if not any(meant):
            known = [*names, *sorted(set(assembly.materials) - {""})]
            raise ValueError(
                f"{where} over: no block and no material is named '{pattern}'{nearest(pattern, known)}; the blocks "
                f"are {', '.join(names[:12])}{' ...' if len(names) > 12 else ''}"
            )
        chosen |= meant
    if not (chosen & assembly.free).any():
        raise ValueError(f"{where} over: {_listed(entry.over)} are supports only; fill loads free blocks: name one")
    return chosen & assembly.free


def _listed(words: Sequence[str]) -> str:
    return ", ".join(f"'{word}'" for word in words[:6])
