"""From the surface cells of any mesh, and their cell arrays, to a layout."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

import solver
from blockvis.layout.block_table import with_rows
from blockvis.layout.layout import Layout
from blockvis.layout.left_out import LeftOut
from blockvis.layout.outlines import flattened, outlines_of_cells

#: Names of the cell array that numbers the blocks, in order of preference.
BLOCK_ARRAYS = ("block_id", "BlockId", "block", "gmsh:geometrical", "CellEntityIds", "medit:ref", "cell_tags")


def components(rings: Sequence[np.ndarray], n_points: int) -> np.ndarray:
    """(n_cells,) int array: number of the connected piece of each cell; shared points connect cells."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    first = np.concatenate([ring for ring in rings])
    second = np.concatenate([np.full(len(ring), ring[0]) for ring in rings])
    graph = coo_matrix((np.ones(len(first)), (first, second)), shape=(n_points, n_points))
    piece = connected_components(graph, directed=False)[1]
    return np.unique(piece[[ring[0] for ring in rings]], return_inverse=True)[1]


def layout_of_cells(
    points: np.ndarray, rings: Sequence[np.ndarray], data: Mapping[str, np.ndarray], path: Path | str
) -> Layout:
    """Make a layout of surface cells.

    Parameters
    ----------
    points : (n_points, 2) or (n_points, 3) array
    rings : sequence of (n,) int arrays
        Points around each cell.
    data : mapping of str to (n_cells, ...) array
        Cell arrays. ``block_id`` says which cells form one block; without it every cell is a block if one has more
        than three corners, and triangles that share points form one. ``name``, ``role``, ``material``, ``group``,
        ``thickness`` and ``density`` are optional.
    path : Path or str
        Named in messages.

    Raises
    ------
    ValueError
        If there are no cells, a cell uses a point that does not exist, or a block has no outline.
    """
    if not rings:
        raise ValueError(f"'{path}' has no surface cells; mesh the surfaces, or save polygons")
    flat, note = flattened(points, f"'{path}'")
    used = np.unique(np.concatenate(list(rings)))
    if used.min() < 0 or used.max() >= len(points):
        raise ValueError(f"'{path}': a cell uses point {int(used.max())}, but there are {len(points)}; export it again")
    numbered = [name for name in BLOCK_ARRAYS if name in data and np.ndim(data[name]) == 1]
    # An array with one value everywhere, as some programs write by default, does not distinguish blocks.
    key = next((name for name in numbered if name == "block_id" or (data[name] != data[name][0]).any()), None)
    if key is not None:
        ids, owner = np.unique(np.asarray(data[key]), return_inverse=True)
        names = [f"block {value}" for value in ids.tolist()]
        how = f"{len(ids)} blocks, one per value of the cell array '{key}'"
    elif any(len(ring) > 3 for ring in rings):
        owner = np.arange(len(rings))
        names = [f"block {k}" for k in owner]
        how = f"{len(rings)} blocks, one per cell: no cell array 'block_id' says which cells are one block"
    else:
        owner = components(rings, len(points))
        names = [f"block {k}" for k in range(int(owner.max()) + 1)]
        how = f"{len(names)} blocks, one per connected piece: no cell array 'block_id' says which cells are one block"
    unusable: dict[int, LeftOut] = {}
    outlines = outlines_of_cells(flat, rings, owner, names, unusable)
    first = np.unique(owner, return_index=True)[1]
    notes = tuple(text for text in (how, note) if text)
    layout = Layout(outlines=tuple(outlines), names=tuple(names), unit="", notes=notes)
    layout = with_rows(layout, [row_of(data, int(cell), names[k]) for k, cell in enumerate(first)])
    return layout.leaving_out(unusable)


def row_of(data: Mapping[str, np.ndarray], cell: int, name: str) -> dict[str, Any]:
    """Read the row of the block table of a block from the cell arrays at one of its cells.

    Parameters
    ----------
    data : mapping of str to (n_cells, ...) array
    cell : int
    name : str
        Of the block, unless the arrays have another.
    """
    row: dict[str, Any] = {"name": name}
    for key in ("name", "group", "material", "role_name", "role"):
        if key not in data or len(data[key]) <= cell:
            continue
        value = data[key][cell]
        if isinstance(value, np.str_ | str | bytes | np.bytes_):
            word = value.decode("utf-8", "replace") if isinstance(value, bytes | np.bytes_) else str(value)
        elif key == "role" and np.ndim(value) == 0 and float(value) in (0.0, 1.0, 2.0):
            word = solver.ROLES[int(value)]
        else:
            continue
        field = "role" if key == "role_name" else key
        if word:
            row.setdefault(field, word) if field == "role" else row.update({field: word})
    for key in ("thickness", "density"):
        if key in data and len(data[key]) > cell and np.ndim(data[key][cell]) == 0:
            row[key] = float(data[key][cell])
    return row


def merged(layouts: Sequence[Layout], labels: Sequence[str], path: Path | str) -> Layout:
    """Join layouts to one; blocks without a name of their own are named after their part of the file.

    Parameters
    ----------
    layouts : sequence of Layout
    labels : sequence of str
        Names of the parts of the file, "" for none.
    path : Path or str
        Named in messages.
    """
    if not layouts:
        raise ValueError(f"'{path}' has no surface cells; mesh the surfaces, or save polygons")
    if len(layouts) == 1:
        return layouts[0]
    named = []
    for layout, label in zip(layouts, labels, strict=True):
        plain = all(name.startswith("block ") for name in layout.names)
        own = (label,) if layout.n_blocks == 1 else tuple(f"{label} {k + 1}" for k in range(layout.n_blocks))
        named.append(replace(layout, names=own if plain and label else layout.names))

    def joined(key: str) -> tuple[Any, ...]:
        return tuple(value for layout in named for value in getattr(layout, key))

    def numbers(key: str) -> np.ndarray | None:
        if all(getattr(layout, key) is None for layout in named):
            return None
        parts = (getattr(d, key) if getattr(d, key) is not None else np.full(d.n_blocks, np.nan) for d in named)
        return np.concatenate(list(parts))

    return Layout(
        outlines=joined("outlines"),
        names=joined("names"),
        groups=tuple(group or label for d, label in zip(named, labels, strict=True) for group in d.groups),
        roles=joined("roles"),
        materials=joined("materials"),
        thickness=numbers("thickness"),
        density=numbers("density"),
        unit=named[0].unit,
        notes=tuple(dict.fromkeys(joined("notes"))),
        left_out=joined("left_out"),
    )
