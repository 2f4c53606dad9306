"""The block table: name, group, role, material, thickness and density of each block as rows of plain values."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from solver import mechanics

from .layout import Layout


def rows_of(layout: Layout) -> list[dict[str, Any]]:
    """Write the block table of a layout.

    Returns
    -------
    list of dict
        One row per block: ``name``, and ``group``, ``role``, ``material``, ``thickness`` [m] and ``density`` [kg/m³] if
        the layout has them.
    """
    rows = []
    for i in range(layout.n_blocks):
        row: dict[str, Any] = {"name": layout.names[i]}
        for key, values in (("group", layout.groups), ("role", layout.roles), ("material", layout.materials)):
            if values[i]:
                row[key] = values[i]
        for key, numbers in (("thickness", layout.thickness), ("density", layout.density)):
            if numbers is not None and math.isfinite(numbers[i]):
                row[key] = float(numbers[i])
        rows.append(row)
    return rows


def with_rows(layout: Layout, rows: Sequence[Any]) -> Layout:
    """Put the values of a block table, one row per block, into a layout.

    Raises
    ------
    ValueError
        For a thickness or density that is no number, and for an unknown role.
    """
    entries: list[Mapping[str, Any]] = [row if isinstance(row, dict) else {} for row in rows]

    def words(key: str, default: Sequence[str]) -> tuple[str, ...]:
        return tuple(str(row.get(key, value)) for row, value in zip(entries, default, strict=True))

    def numbers(key: str) -> np.ndarray | None:
        if not any(key in row for row in entries):
            return None
        return np.array([_number(row.get(key, math.nan), key, name) for name, row in zip(names, entries, strict=True)])

    names, roles = words("name", layout.names), words("role", [""] * layout.n_blocks)
    for name, role in zip(names, roles, strict=True):
        if role and role not in mechanics.ROLES:
            raise ValueError(f"block '{name}' has role '{role}' in the file; roles are {', '.join(mechanics.ROLES)}")
    return replace(
        layout,
        thickness=numbers("thickness") if layout.dimension == 2 else None,
        names=names,
        groups=words("group", [""] * layout.n_blocks),
        roles=roles,
        materials=words("material", [""] * layout.n_blocks),
        density=numbers("density"),
    )


def _number(value: Any, key: str, name: str) -> float:
    try:
        # A yes is no length.
        return float(str(value) if isinstance(value, bool) else value)
    except (TypeError, ValueError):
        raise ValueError(f"block '{name}' has {key} {value!r}; give a number") from None


def layers_of(layout: Layout, default: str) -> list[str]:
    """Name the layer of each block: its group, else its role as a support, else its material, else the default."""
    return [
        group or (role if role in (mechanics.FIXED, mechanics.MOVING) else "") or material or default
        for group, role, material in zip(layout.groups, layout.roles, layout.materials, strict=True)
    ]
