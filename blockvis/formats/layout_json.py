"""Our own layout file, .json: everything a drawing holds, in plain lists.

{"format": "blockvis layout", "version": 1, "unit": "m",
 "blocks": [{"name": ..., "outline": [[x, y], ...], "group": ..., "role": ..., "material": ..., "thickness": ...,
             "density": ...}, ...]}
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

import solver
from blockvis.drawing import Drawing
from blockvis.formats import Reading

FORMAT = "blockvis layout"


def read(path: Path, reading: Reading) -> Drawing:
    """Reads a .json layout."""
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except (ValueError, RecursionError) as error:
        raise ValueError(f"'{path}' is not a JSON file: {error}; export it again") from None
    if not isinstance(content, dict) or not isinstance(content.get("blocks"), list):
        raise ValueError(f"'{path}' is JSON but no layout; it needs a list \"blocks\" of {{name, outline}}")
    version = content.get("version", 1)
    if version != 1:
        raise ValueError(f"'{path}' is a layout of version {version!r}; version 1 is read: update blockvis")
    outlines, names = [], []
    for k, block in enumerate(content["blocks"]):
        name = str(block.get("name", f"block {k}")) if isinstance(block, dict) else f"block {k}"
        try:
            ring = np.array(block["outline"], dtype=float)
        except (KeyError, TypeError, ValueError):
            raise ValueError(f"'{path}': block '{name}' has no outline of numbers [[x, y], ...]; repair it") from None
        if ring.ndim != 2 or ring.shape[1] != 2 or len(ring) < 3:
            raise ValueError(f"'{path}': block '{name}' needs at least three corners [x, y]; its shape is {ring.shape}")
        outlines.append(ring)
        names.append(name)
    drawing = Drawing(outlines=tuple(outlines), names=tuple(names), unit=str(content.get("unit", "")))
    return with_rows(drawing, content["blocks"])


def write(drawing: Drawing, path: Path) -> None:
    """Writes a .json layout."""
    blocks = [{**row, "outline": ring.tolist()} for row, ring in zip(rows_of(drawing), drawing.outlines, strict=True)]
    lines = ",\n  ".join(json.dumps(block, ensure_ascii=False) for block in blocks)
    head = f'"format": "{FORMAT}", "version": 1, "unit": "m"'
    path.write_text(f'{{{head},\n "blocks": [\n  {lines}\n]}}\n', encoding="utf-8")


def rows_of(drawing: Drawing) -> list[dict[str, Any]]:
    """What a drawing says of each block beside its outline; what it does not say is left out."""
    rows = []
    for i in range(drawing.n_blocks):
        row: dict[str, Any] = {"name": drawing.names[i]}
        for key, values in (("group", drawing.groups), ("role", drawing.roles), ("material", drawing.materials)):
            if values[i]:
                row[key] = values[i]
        for key, numbers in (("thickness", drawing.thickness), ("density", drawing.density)):
            if numbers is not None and math.isfinite(numbers[i]):
                row[key] = float(numbers[i])
        rows.append(row)
    return rows


def with_rows(drawing: Drawing, rows: Sequence[Any]) -> Drawing:
    """The drawing with what the rows, one per block, say of its blocks."""
    entries: list[Mapping[str, Any]] = [row if isinstance(row, dict) else {} for row in rows]

    def words(key: str, default: Sequence[str]) -> tuple[str, ...]:
        return tuple(str(row.get(key, value)) for row, value in zip(entries, default, strict=True))

    def numbers(key: str) -> np.ndarray | None:
        if not any(key in row for row in entries):
            return None
        try:
            return np.array([float(row.get(key, math.nan)) for row in entries])
        except (TypeError, ValueError):
            bad = next(row[key] for row in entries if key in row and not isinstance(row[key], int | float))
            raise ValueError(f"a block has {key} {bad!r}; give a number") from None

    roles = words("role", [""] * drawing.n_blocks)
    for name, role in zip(words("name", drawing.names), roles, strict=True):
        if role and role not in solver.ROLES:
            raise ValueError(f"block '{name}' has role '{role}' in the file; roles are {', '.join(solver.ROLES)}")
    return replace(
        drawing,
        names=words("name", drawing.names),
        groups=words("group", [""] * drawing.n_blocks),
        roles=roles,
        materials=words("material", [""] * drawing.n_blocks),
        thickness=numbers("thickness"),
        density=numbers("density"),
    )
