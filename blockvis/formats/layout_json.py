"""Our own layout file, .json: everything a layout holds, in plain lists.

{"format": "blockvis layout", "version": 1, "unit": "m",
 "blocks": [{"name": ..., "outline": [[x, y], ...], "group": ..., "role": ..., "material": ..., "thickness": ...,
             "density": ...}, ...]}

A block in space has, instead of an outline and a thickness, "points": [[x, y, z], ...] and "faces": [[0, 1, 2], ...],
the points around each face, counter-clockwise seen from outside; z is up.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from blockvis.layout.block_table import rows_of, with_rows
from blockvis.layout.layout import Layout
from blockvis.layout.left_out import passed_over
from blockvis.layout.solids import Solid
from blockvis.layout.surfaces import cleaned
from blockvis.text import nearest, refuse_unknown
from solver.mechanics import counted

from . import compas_json, geodata
from .annotations import program_of
from .annotations import read_content as read_annotations
from .bodies import Bodies, with_z_up
from .reading import Reading

FORMAT = "blockvis layout"

#: Likeness of a key to one that is known from which on it is a slip in that: others have keys of their own.
SLIP = 0.8

#: Keys of a file, and of each block beside those of its shape.
KEYS = ("format", "version", "unit", "blocks")
BLOCK_KEYS = ("name", "group", "role", "material", "density")

#: What reads the parsed JSON of other programs; each returns None for what it does not know.
KINDS: tuple[Callable[[Any, Path, Reading], Layout | Bodies | None], ...] = (
    read_annotations,
    geodata.read_content,
    compas_json.read_content,
)

#: In the name of a file for COMPAS, before its suffix.
COMPAS = ".compas."


def read(path: Path, reading: Reading) -> Layout | Bodies:
    """Read a .json layout, or what other programs write as JSON."""
    try:
        content = json.loads(path.read_text(encoding="utf-8-sig"))
    except (ValueError, RecursionError) as error:
        raise ValueError(f"it is not a JSON file: {error}; export it again") from None
    if not program_of(content):
        reading.refuse_image_keys()
    for read_content in () if _is_own(content) else KINDS:
        found = read_content(content, path, reading)
        if found is not None:
            return found
    if not isinstance(content, dict) or not isinstance(content.get("blocks"), list):
        raise ValueError(
            'it is JSON but no layout; it needs a list "blocks" of {name, outline}, annotations of COCO, '
            "LabelMe or VIA, features of GeoJSON, or meshes of COMPAS"
        )
    version = content.get("version", 1)
    if version != 1:
        raise ValueError(f"it is a layout of version {version!r}; version 1 is read: update blockvis")
    more = _not_read(content, KEYS, f"'{path}'")
    in_space = any(isinstance(block, dict) and "points" in block for block in content["blocks"])
    if not in_space:
        reading.refuse_view()
    of_block = (*BLOCK_KEYS, *(("points", "faces") if in_space else ("outline", "thickness")))
    shapes, names = [], []
    for k, block in enumerate(content["blocks"]):
        names.append(str(block.get("name", f"block {k}")) if isinstance(block, dict) else f"block {k}")
        called = f"block '{names[-1]}'"
        more += _not_read(block, of_block, called) if isinstance(block, dict) else []
        shapes.append(_solid(block, called) if in_space else _outline(block, called))
    layout = Layout(blocks=tuple(shapes), names=tuple(names), unit=str(content.get("unit", "")))
    layout = with_rows(layout, content["blocks"])
    if in_space and reading.view == "xy":
        layout = replace(layout, blocks=tuple((with_z_up(points), faces) for points, faces in layout.solids))
    notes = passed_over(Counter(more), "keys that are not known")
    return replace(layout, unit_by="layout" if layout.unit else "", notes=(*layout.notes, *notes))


def _not_read(given: Mapping[str, Any], known: Sequence[str], where: str) -> list[str]:
    """List keys that are not known; raises ``ValueError`` for one that is a slip in one of these."""
    more = [key for key in given if key not in known]
    refuse_unknown((key for key in more if nearest(key, known, SLIP)), known, where)
    return more


def _outline(block: Any, called: str) -> np.ndarray:
    """(n, 2) array: the outline of a block in the plane."""
    try:
        ring = np.array(block["outline"], dtype=float)
    except (KeyError, TypeError, ValueError, OverflowError):
        raise ValueError(f"{called} has no outline of numbers [[x, y], ...]; repair it") from None
    if ring.ndim != 2 or ring.shape[1] != 2 or len(ring) < 3:
        raise ValueError(f"{called} needs at least three corners [x, y]; its shape is {ring.shape}")
    return ring


def _solid(block: Any, called: str) -> Solid:
    """Points and faces of a block in space."""
    try:
        points = np.array(block["points"], dtype=float).reshape(-1, 3)
        faces = [[int(corner) for corner in face] for face in block["faces"]]
    except (KeyError, TypeError, ValueError, OverflowError):
        raise ValueError(
            f"{called} has no points [[x, y, z], ...] and faces [[0, 1, 2], ...]; give both, of each block, or in the "
            "plane an outline [[x, y], ...] instead"
        ) from None
    outside = [corner for face in faces for corner in face if not 0 <= corner < len(points)]
    if outside:
        raise ValueError(f"{called} is no closed block: a face uses point {outside[0]} of {len(points)}; repair it")
    if len(faces) < 4 or any(len(face) < 3 for face in faces):
        raise ValueError(f"{called} is no closed block: it has {counted(len(faces), 'face')}; repair it")
    if not np.isfinite(points).all():
        raise ValueError(f"{called} has a point that is not finite; repair it")
    return cleaned(points, faces)


def _is_own(content: Any) -> bool:
    """Whether a parsed file is a layout of our own."""
    if not isinstance(content, dict) or not isinstance(content.get("blocks"), list):
        return False
    blocks = content["blocks"]
    return content.get("format") == FORMAT or any(
        isinstance(block, dict) and ("outline" in block or "points" in block) for block in blocks
    )


def write(layout: Layout, path: Path) -> None:
    """Write a .json layout; of blocks in space to a name that ends in .compas.json meshes of COMPAS."""
    if path.suffix.lower() == ".geojson":
        geodata.write(layout, path)
        return
    if COMPAS in path.name.lower():
        if layout.dimension == 2:
            # The path is a temporary one, which tells nobody anything.
            raise ValueError(
                "a name that ends in .compas.json is for blocks in space; give --dimension 3 (dimension=3), or write "
                "to .json"
            )
        compas_json.write(layout, path)
        return
    shapes: list[dict[str, Any]]
    if layout.dimension == 3:
        shapes = [{"points": points.tolist(), "faces": faces} for points, faces in layout.solids]
    else:
        shapes = [{"outline": ring.tolist()} for ring in layout.outlines]
    blocks = [{**row, **shape} for row, shape in zip(rows_of(layout), shapes, strict=True)]
    lines = ",\n  ".join(json.dumps(block, ensure_ascii=False) for block in blocks)
    head = f'"format": "{FORMAT}", "version": 1, "unit": "m"'
    path.write_text(f'{{{head},\n "blocks": [\n  {lines}\n]}}\n', encoding="utf-8")
