"""Our own layout file, .json: everything a layout holds, in plain lists.

{"format": "blockvis layout", "version": 1, "unit": "m",
 "blocks": [{"name": ..., "outline": [[x, y], ...], "group": ..., "role": ..., "material": ..., "thickness": ...,
             "density": ...}, ...]}
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from blockvis.layout.block_table import rows_of, with_rows
from blockvis.layout.layout import Layout

from . import compas_json
from .bodies import Bodies
from .reading import Reading

FORMAT = "blockvis layout"


def read(path: Path, reading: Reading) -> Layout | Bodies:
    """Read a .json layout, or the blocks of a file of COMPAS."""
    try:
        content = json.loads(path.read_text(encoding="utf-8-sig"))
    except (ValueError, RecursionError) as error:
        raise ValueError(f"'{path}' is not a JSON file: {error}; export it again") from None
    if not _is_own(content):
        found = compas_json.read_content(content, path, reading.view)
        if found is not None:
            return found
    if not isinstance(content, dict) or not isinstance(content.get("blocks"), list):
        raise ValueError(
            f"'{path}' is JSON but no layout; it needs a list \"blocks\" of {{name, outline}}, or meshes of COMPAS"
        )
    if reading.view not in (None, "xy"):
        raise ValueError(f"'{path}' is drawn in the plane xy; it has no view {reading.view}")
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
    layout = Layout(outlines=tuple(outlines), names=tuple(names), unit=str(content.get("unit", "")))
    return with_rows(layout, content["blocks"])


def _is_own(content: Any) -> bool:
    """Whether a parsed file is a layout of our own."""
    if not isinstance(content, dict) or not isinstance(content.get("blocks"), list):
        return False
    blocks = content["blocks"]
    return content.get("format") == FORMAT or any(isinstance(block, dict) and "outline" in block for block in blocks)


def write(layout: Layout, path: Path) -> None:
    """Write a .json layout."""
    blocks = [{**row, "outline": ring.tolist()} for row, ring in zip(rows_of(layout), layout.outlines, strict=True)]
    lines = ",\n  ".join(json.dumps(block, ensure_ascii=False) for block in blocks)
    head = f'"format": "{FORMAT}", "version": 1, "unit": "m"'
    path.write_text(f'{{{head},\n "blocks": [\n  {lines}\n]}}\n', encoding="utf-8")
