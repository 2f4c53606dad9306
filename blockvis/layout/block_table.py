"""The block table: name, group, role, material, thickness and density of each block as rows of plain values."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from blockvis.text import listed
from solver import mechanics

from .layout import Layout
from .notes import CHANGED, Note


def rows_of(layout: Layout) -> list[dict[str, Any]]:
    """Write the block table of a layout, one row per block.

    It has ``name``, and ``group``, ``role``, ``material``, ``thickness`` [m] and ``density`` [kg/m³] if the layout has
    them.
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


def with_rows(layout: Layout, rows: Sequence[Any], *, own: bool = False) -> Layout:
    """Put the values of a block table, one row per block, into a layout.

    Rows that our ``own`` writer put beside the geometry have thicknesses in metres: these stay when somebody scales the
    drawing, or says another unit. ValueError for a thickness or density that is no number, and for an unknown role.
    """
    entries: list[Mapping[str, Any]] = [row if isinstance(row, dict) else {} for row in rows]

    def words(key: str, default: Sequence[str]) -> tuple[str, ...]:
        return tuple(str(row.get(key, value)) for row, value in zip(entries, default, strict=True))

    def numbers(key: str) -> np.ndarray | None:
        if not any(key in row for row in entries):
            return None
        return np.array([_number(row.get(key, math.nan), key, name) for name, row in zip(names, entries, strict=True)])

    names = words("name", layout.names)
    return replace(
        layout,
        thickness=numbers("thickness") if layout.dimension == 2 else None,
        thickness_unit="m" if own else layout.thickness_unit,
        names=names,
        groups=words("group", [""] * layout.n_blocks),
        roles=words("role", [""] * layout.n_blocks),
        materials=words("material", [""] * layout.n_blocks),
        density=numbers("density"),
    )


def _number(value: Any, key: str, name: str) -> float:
    try:
        # A yes is no length.
        return float(str(value) if isinstance(value, bool) else value)
    except (TypeError, ValueError, OverflowError):
        raise ValueError(f"block '{name}' has {key} {value!r:.40}; give a number") from None


def layer_of(row: Mapping[str, Any]) -> tuple[str, str]:
    """Name the layer on which a block is drawn, and the key that says it: its group, role as a support, or material."""
    support = row.get("role") in (mechanics.FIXED, mechanics.MOVING)
    keys = (key for key in ("group", "role", "material") if row.get(key) and (key != "role" or support))
    return next(((str(row[key]), key) for key in keys), ("", ""))


def layers_of(layout: Layout, default: str) -> list[str]:
    """Name the layer of each block; see :func:`layer_of`."""
    return [layer_of(row)[0] or default for row in rows_of(layout)]


def on_layer(row: Mapping[str, Any], layer: str) -> dict[str, Any]:
    """Row of a block that somebody moved to another layer: what that layer says holds, and the rest of the row.

    A layer that is called as a role gives one, and what is taken from such a layer has none any more.
    """
    old, key = layer_of(row)
    was, is_now = (word.strip().lower() in mechanics.ROLES for word in (old, layer))
    gone = {"group": True, "role": was or is_now, "material": key == "material" and not is_now}
    return {**{key: value for key, value in row.items() if not gone.get(key)}, "group": layer}


def moved_notes(moved: Sequence[tuple[Mapping[str, Any], Mapping[str, Any]]]) -> list[str]:
    """Say which blocks lie on other layers than their rows say; ``moved`` has each row as written, and as it holds."""
    places = [f"'{row.get('name', '')}' on '{row['group']}'" for _, row in moved]
    supports = (mechanics.FIXED, mechanics.MOVING)
    held = [at for at, (_, row) in zip(places, moved, strict=True) if row.get("role") in supports]
    notes: list[str] = [f"moved to another layer since blockvis wrote the drawing: {listed(places)}"] if moved else []
    if held:
        says = "they are fixed or moving still, as blockvis wrote with them"
        notes.append(
            Note(CHANGED, f"layers of supports were changed ({listed(held)}): {says}; [roles] can say otherwise")
        )
    lost = [
        f"{at} was {old[key]}"
        for at, (old, row) in zip(places, moved, strict=True)
        for key in ("role", "material")
        if old.get(key) not in (None, "", row.get(key), mechanics.FREE)
    ]
    if lost:
        words = f"layers were changed, and with them roles or materials ({listed(lost)}); [roles] gives roles"
        notes.append(Note(CHANGED, words))
    return notes
