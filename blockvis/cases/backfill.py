"""Fill over arches and vaults: the tables [[backfill]], and the loads that are made of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

import solver
from blockvis.layout.left_out import matches
from blockvis.text import listed, nearest

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


def read_backfill(table: Table) -> dict[str, Any]:
    """Read a table [[backfill]]: what :func:`lay_backfill` takes beside an assembly."""
    values = BACKFILL.read(table)
    if not values["over"]:
        raise table.error("over", 'is empty; name the blocks under the fill: over = ["voussoir *"]')
    return values | {"where": f"{table.source}: [{table.where}]"}


def backfills(entries: Sequence[Mapping[str, Any]], assembly: solver.Assembly) -> tuple[solver.Backfill, ...]:
    """Make the fills of a case, as :func:`read_backfill` reads them; several over a block lie one on another.

    ValueError for a name that no free block has, a surface below the extrados of a block, blocks of which none sees it,
    and two fills over a block up to the same surface.
    """
    laid = [lay_backfill(assembly, **entry) for entry in entries]
    for number, fill in enumerate(laid):
        for other in range(number):
            same = np.intersect1d(fill.block, laid[other].block)
            if len(same) and fill.surface == laid[other].surface:
                raise ValueError(
                    f"{entries[other]['where']} and {entries[number]['where'].rpartition(': ')[2]} both fill up to "
                    f"{fill.surface:g} m over block '{assembly.names[same[0]]}'; leave the block out of one, or give "
                    "another surface"
                )
    return tuple(part for fill in laid for part in _on_lower(fill, laid))


def _on_lower(fill: solver.Backfill, laid: Sequence[solver.Backfill]) -> list[solver.Backfill]:
    """Cut a fill into the part that lies on the blocks and those that lie on lower fills, each above their surface.

    What lies on another fill presses sideways as that which touches the block does.
    """
    base = np.full(len(fill.block), -np.inf)
    coefficient = np.full(len(fill.block), fill.pressure_coefficient)
    for other in sorted(laid, key=lambda other: -other.surface):
        under = np.isin(fill.block, other.block) & (other.surface < fill.surface)
        base[under] = np.maximum(base[under], other.surface)
        coefficient[under] = other.pressure_coefficient
    parts = []
    for level, k in np.unique(np.column_stack([base, coefficient]), axis=0).tolist():
        own = (base == level) & (coefficient == k)
        thickness = None if fill.thickness is None else fill.thickness[own]
        part = replace(fill, pieces=fill.pieces[own], block=fill.block[own], thickness=thickness)
        parts.append(replace(part, base=level, pressure_coefficient=k))
    return parts


def lay_backfill(
    assembly: solver.Assembly,
    over: str | Sequence[str],
    surface: float,
    unit_weight: float,
    pressure_coefficient: float = 0.0,
    *,
    where: str = "backfill",
) -> solver.Backfill:
    """Lay loose fill over blocks, on what of them looks upwards and sees its level surface.

    Parameters
    ----------
    assembly : solver.Assembly
    over : str or sequence of str
        Names or materials of the blocks under it, or patterns; supports among them carry none.
    surface : float [m]
        Height of its top.
    unit_weight : float [N/m³]
    pressure_coefficient : float
        Horizontal pressure as a part of the vertical one.
    where : str
        What messages begin with.

    Returns
    -------
    solver.Backfill
        For ``solver.Loads(dead, live, fills=(...,))``.

    Raises
    ------
    ValueError
        For a name that no free block has, a surface below the extrados of a block, blocks of which none sees it, a
        unit weight that is not positive, a negative coefficient.
    """
    names = (over,) if isinstance(over, str) else tuple(over)
    for key, value, least in (("unit_weight", unit_weight, 1e-300), ("pressure_coefficient", pressure_coefficient, 0)):
        if not least <= value < np.inf:
            raise ValueError(f"{where} {key} is {value:g}; give a number {'of at least' if least == 0 else 'above'} 0")
    if not np.isfinite(surface):
        raise ValueError(f"{where} surface is {surface:g} m; give the height of its top, a finite number")
    pieces, block = extrados(assembly, _chosen(names, assembly, where), surface)
    if not len(pieces):
        raise ValueError(f"{where} over: none of '{listed(names)}' looks up to the surface; name the topmost blocks")
    heights = pieces[:, :, -1].max(axis=1)
    highest = int(heights.argmax())
    if heights[highest] > surface + SLIVER * assembly.block_size:
        raise ValueError(
            f"{where} surface is {surface:g} m, below the extrados of block '{assembly.names[block[highest]]}', which "
            f"reaches {heights[highest]:.6g} m; raise it, or leave the block out of over"
        )
    thickness = assembly.thickness[block] if assembly.dimension == 2 else None
    return solver.Backfill(pieces, block, surface, unit_weight, pressure_coefficient, thickness)


def _chosen(over: Sequence[str], assembly: solver.Assembly, where: str) -> np.ndarray:
    """(n_blocks,) bool array: the free blocks of these names or materials."""
    names, chosen = assembly.names, np.zeros(assembly.n_blocks, dtype=bool)
    for pattern in over:
        meant = [
            matches(filter(None, labels), [pattern])
            for labels in zip(names, assembly.drawn_names, assembly.materials, strict=True)
        ]
        if not any(meant):
            known = [*names, *sorted(set(assembly.materials) - {""})]
            raise ValueError(
                f"{where} over: no block and no material is named '{pattern}'{nearest(pattern, known)}; the blocks "
                f"are {listed(names, 12)}"
            )
        chosen |= meant
    if not (chosen & assembly.free).any():
        raise ValueError(f"{where} over: '{listed(over)}' are supports only; fill loads free blocks: name one")
    return chosen & assembly.free
