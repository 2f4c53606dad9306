"""From the surface cells of any mesh, and their cell arrays, to a layout."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.sparse import coo_array

from blockvis.layout.block_table import rows_of, with_rows
from blockvis.layout.layout import Layout
from blockvis.layout.left_out import LeftOut
from blockvis.layout.notes import LEFT_OUT, UPRIGHT, Note, kind_of
from blockvis.layout.outlines import flattened, is_flat, outlines_of_cells, spread_of
from blockvis.layout.solids import fans
from blockvis.text import numbered
from solver import mechanics
from solver.mechanics import counted, linked

from .bodies import Bodies, Body, with_role
from .closed_surfaces import bodies_of_surfaces, enclosed
from .reading import Reading

#: Our name of the number of the named set of each cell.
CELL_SET = "cell set"

#: Names of the cell array that numbers the blocks, in order of preference.
BLOCK_ARRAYS = (
    "block_id", "BlockId", "block", CELL_SET, "gmsh:geometrical", "CellEntityIds", "medit:ref", "cell_tags",
    "nastran:ref", "netgen:index", "avsucd:material", "ugrid:ref",
)  # fmt: skip

#: Those that number blocks; the others number parts of a model, of which one may be many blocks.
OF_BLOCKS = BLOCK_ARRAYS[:3]

#: Names of the cell arrays that say what a block is.
TABLE_ARRAYS = ("name", "group", "material", "role_name", "role", "thickness", "density")


def owners(data: Mapping[str, np.ndarray], n_cells: int) -> tuple[str | None, list[str], np.ndarray]:
    """Name of the cell array that numbers the blocks, None for none, their names, and (n_cells,) numbers of these."""
    numbered = [name for name in BLOCK_ARRAYS if name in data and np.ndim(data[name]) == 1]
    # An array with one value everywhere, as some programs write by default, does not distinguish blocks.
    named = (BLOCK_ARRAYS[0], CELL_SET)
    key = next((name for name in numbered if name in named or (data[name] != data[name][0]).any()), None)
    if key is None:
        return None, ["block"], np.zeros(n_cells, dtype=np.int64)
    values, owner = np.unique(data[key], return_inverse=True)
    return key, [f"block {value}" for value in values.tolist()], owner


def layout_of_cells(
    points: np.ndarray, rings: Sequence[np.ndarray], data: Mapping[str, np.ndarray], view: str | None = None
) -> Layout | Bodies:
    """Make a layout of surface cells; if they do not lie in a plane, find the bodies that they enclose.

    Given are (n_points, 2) or (n_points, 3) points, those around each cell, and cell arrays (n_cells, ...). Of these
    ``block_id`` says which cells form one block; without it every cell is a block if one has more than three corners,
    and triangles that share sides form one; :data:`TABLE_ARRAYS` are optional.
    """
    if not rings:
        raise ValueError("it has no surface cells; mesh the surfaces, or save polygons")
    used = np.unique(np.concatenate(list(rings)))
    if used.min() < 0 or used.max() >= len(points):
        raise ValueError(f"a cell uses point {int(used.max())}, but there are {len(points)}; export it again")
    if not is_flat(points):
        return _enclosed(points, rings, data)
    flat, note = flattened(points, view)
    key, names, owner = owners(data, len(rings))
    if key is not None:
        n, how = len(names), f"one block per value of the cell array '{key}'"
        if key not in OF_BLOCKS:
            pieces, piece = np.unique(np.column_stack([owner, _pieces(rings, owner)]), axis=0, return_inverse=True)
            # Numbered where a part has several.
            names, owner = numbered([names[part] for part in pieces[:, 0]]), piece.ravel()
            how = f"one block per connected piece of a value of the cell array '{key}'" if len(names) > n else how
    else:
        whole = any(len(ring) > 3 for ring in rings)
        owner = np.arange(len(rings)) if whole else _pieces(rings, owner)
        names = [f"block {k}" for k in range(int(owner.max()) + 1)]
        how = f"one block per {'cell' if whole else 'connected piece'}: no cell array 'block_id' says which are one"
    unusable: dict[int, LeftOut] = {}
    outlines = outlines_of_cells(flat, rings, owner, names, unusable)
    notes = tuple(text for text in (how, note) if text)
    layout = Layout(blocks=tuple(outlines), names=tuple(names), unit="", notes=notes)
    layout = with_rows(layout, [with_role(row) for row in rows_of_cells(data, owner, names)])
    return layout.leaving_out(unusable)


def _pieces(rings: Sequence[np.ndarray], owner: np.ndarray) -> np.ndarray:
    """(n_cells,) int array: the connected piece of each cell, by its sides; a common corner connects none.

    Two corners do: cells with more sides may lie between them, which is no drawing of several blocks.
    """
    cell, start = np.repeat(np.arange(len(rings)), [len(ring) for ring in rings]), np.concatenate(list(rings))
    sides = np.sort(np.column_stack([start, np.concatenate([np.roll(ring, -1) for ring in rings])]), axis=1)
    _, side = np.unique(np.column_stack([owner[cell], sides]), axis=0, return_inverse=True)
    _, corner = np.unique(np.column_stack([owner[cell], start]), axis=0, return_inverse=True)
    n = len(rings)
    piece = linked((cell, n + side.ravel()), n + int(side.max()) + 1)[:n]
    at = np.unique(np.column_stack([piece[cell], corner.ravel()]), axis=0).T
    shared = coo_array((np.ones(at.shape[1]), at)).tocsr()
    one, other = (shared @ shared.T > 1.0).nonzero()
    return linked((one, other), int(piece.max()) + 1)[piece]


def _enclosed(points: np.ndarray, rings: Sequence[np.ndarray], data: Mapping[str, np.ndarray]) -> Bodies:
    """Find the bodies that surface cells in space enclose, one per value of a cell array, or one per piece."""
    key, names, owner = owners(data, len(rings))
    bodies, notes = bodies_of_surfaces(points, rings, owner, rows_of_cells(data, owner, names))
    how = f"one block per value of the cell array '{key}'" if key else "one block per closed surface"
    return Bodies(bodies, notes=(how, *notes))


def rows_of_cells(data: Mapping[str, np.ndarray], owner: np.ndarray, names: Sequence[str]) -> list[dict[str, Any]]:
    """Read the block table from cell arrays, (n_cells, ...), given the number of the block of each cell.

    Names hold where no array has them.
    """
    for key in TABLE_ARRAYS:
        values = np.asarray(data.get(key, ()))
        # Numbers of groups or materials of other programs are not read.
        if values.shape != owner.shape or (key in TABLE_ARRAYS[:4] and values.dtype.kind not in "SUO"):
            continue
        if values.dtype.kind == "f":
            # Rounding of a program that writes them with seven digits.
            values = np.array([float(f"{value:.6g}") for value in values.tolist()])
        known, number = np.unique(values, return_inverse=True)
        pairs = np.unique([owner, number], axis=1)
        several = np.flatnonzero(np.bincount(pairs[0]) > 1)
        if len(several):
            block = int(several[0])
            listed = " and ".join(str(value) for value in known[pairs[1][pairs[0] == block]][:2])
            raise ValueError(
                f"cells of the block '{names[block]}' differ in the cell array '{key}', as {listed}; give "
                "them one value, or number the blocks in a cell array 'block_id'"
            )
    first = np.unique(owner, return_index=True)[1].tolist()
    return [{"name": name, **_row(data, cell)} for name, cell in zip(names, first, strict=True)]


def _row(data: Mapping[str, np.ndarray], cell: int) -> dict[str, Any]:
    """Read the row of the block table of a block from the cell arrays at one of its cells."""
    row: dict[str, Any] = {}
    for key in TABLE_ARRAYS[:5]:
        if key not in data or len(data[key]) <= cell:
            continue
        value = data[key][cell]
        if isinstance(value, np.str_ | str | bytes | np.bytes_):
            word = value.decode("utf-8", "replace") if isinstance(value, bytes | np.bytes_) else str(value)
        elif key == "role" and np.ndim(value) == 0:
            # A number that is no role is refused as a word that is none.
            word = mechanics.ROLES[int(value)] if float(value) in (0.0, 1.0, 2.0) else f"{value:g}"
        else:
            continue
        if word:
            row.setdefault("role" if key == "role_name" else key, word)
    for key in TABLE_ARRAYS[5:]:
        if key in data and len(data[key]) > cell and np.ndim(data[key][cell]) == 0:
            row[key] = float(data[key][cell])
    return row


@dataclass(frozen=True)
class Mesh:
    """A block of a drawing: (n, 3) points, those around each face, and its row of the block table.

    ``curved`` is the kind of a solid of which faces are missing, as they are not flat.
    """

    points: np.ndarray
    faces: list[list[int]]
    row: dict[str, Any]
    curved: str = ""


def found_in_meshes(meshes: Sequence[Mesh], reading: Reading) -> Layout | Bodies:
    """Make outlines of meshes in a plane, and of others the bodies that they enclose."""
    every = np.concatenate([mesh.points for mesh in meshes])
    size = float(spread_of(every).max())
    if is_flat(every):
        return _layout_of_meshes(meshes, reading.view)
    parts = [Body(str(mesh.row["name"]), mesh.points, fans(mesh.faces), mesh.row) for mesh in meshes]
    bodies, notes = enclosed(parts, size, reading)
    return Bodies(bodies, notes=notes)


def _layout_of_meshes(meshes: Sequence[Mesh], view: str | None) -> Layout | Bodies:
    # Some repeat the corners of each face.
    points, number = np.unique(np.concatenate([mesh.points for mesh in meshes]), axis=0, return_inverse=True)
    starts = np.cumsum([0, *(len(mesh.points) for mesh in meshes)])
    rings = [number.ravel()[np.add(face, k)] for k, mesh in zip(starts, meshes, strict=False) for face in mesh.faces]
    counts = [len(mesh.faces) for mesh in meshes]
    data = {"block_id": np.repeat(np.arange(len(meshes)), counts)}
    for key in ("name", "group", "role", "material"):
        data[key] = np.repeat([str(mesh.row.get(key, "")) for mesh in meshes], counts)
    return layout_of_cells(points, rings, data, view)


def flat_beside(bodies: Sequence[np.ndarray], flat: Sequence[np.ndarray]) -> tuple[str, ...]:
    """Count in a note the flat cells that are no skin of those with a volume; given are the points of each cell."""
    flat = [nodes for nodes in flat if len(nodes)]
    if not flat:
        return ()
    lost = ~np.isin(np.concatenate(flat), np.concatenate([np.ravel(one) for one in bodies]))
    n = int(np.logical_or.reduceat(lost, np.cumsum([0, *map(len, flat)])[:-1]).sum())
    return (Note(LEFT_OUT, f"left out: {counted(n, 'flat cell')} beside bodies"),) if n else ()


def merged(found: Sequence[Layout | Bodies], labels: Sequence[str]) -> Layout | Bodies:
    """Join the parts of a file to one; blocks without a name of their own are named after their part, "" for none."""
    if not found:
        raise ValueError("it has no surface cells; mesh the surfaces, or save polygons")
    joined = _joined(found, labels)
    if isinstance(joined, Bodies):
        return joined
    return with_rows(joined, [with_role(row) for row in rows_of(joined)])


def _joined(found: Sequence[Layout | Bodies], labels: Sequence[str]) -> Layout | Bodies:
    if len(found) == 1:
        return found[0]
    flat = [(part, label) for part, label in zip(found, labels, strict=True) if isinstance(part, Layout)]
    solid = [(part, label) for part, label in zip(found, labels, strict=True) if isinstance(part, Bodies)]
    if flat and solid:
        raise ValueError(
            f"it has flat blocks ('{flat[0][1] or 'the first'}') and bodies in space "
            f"('{solid[0][1] or 'the first'}'); give one kind"
        )
    return _merged_bodies(solid) if solid else _merged_layouts(flat)


def _own_names(names: Sequence[str], label: str) -> tuple[str, ...]:
    """Name the blocks of a part after it, unless they have names of their own."""
    if not label or not all(f"{name} ".startswith("block ") for name in names):
        return tuple(names)
    return tuple(numbered([label] * len(names)))


def _merged_bodies(parts: Sequence[tuple[Bodies, str]]) -> Bodies:
    bodies: list[Body] = []
    for part, label in parts:
        names = _own_names([str(body.row["name"]) for body in part.bodies], label)
        group = {"group": label} if label else {}
        bodies += [
            replace(body, name=name, said={**group, **body.said, "name": name})
            for body, name in zip(part.bodies, names, strict=True)
        ]
    first, ups = parts[0][0], {part.up for part, _ in parts}
    notes = tuple(dict.fromkeys(note for part, _ in parts for note in part.notes))
    return replace(first, bodies=bodies, notes=notes, up=first.up if len(ups) == 1 else "")


def _merged_layouts(parts: Sequence[tuple[Layout, str]]) -> Layout:
    if len({tuple(note for note in part.notes if kind_of(note) == UPRIGHT) for part, _ in parts}) > 1:
        raise ValueError("it has flat parts that lie in different planes; draw them in one")
    named = [replace(part, names=_own_names(part.names, label)) for part, label in parts]

    def joined(key: str) -> tuple[Any, ...]:
        return tuple(value for layout in named for value in getattr(layout, key))

    layout = Layout(
        blocks=joined("blocks"),
        names=joined("names"),
        unit=named[0].unit,
        unit_by=named[0].unit_by,
        thickness_unit=named[0].thickness_unit,
        notes=tuple(dict.fromkeys(joined("notes"))),
        left_out=joined("left_out"),
        looks=joined("looks"),
        within=joined("within"),
    )
    groups = [{"group": label} if label else {} for part, label in parts for _ in range(part.n_blocks)]
    rows = [row for part in named for row in rows_of(part)]
    return with_rows(layout, [group | row for group, row in zip(groups, rows, strict=True)])


def of_files(found: Sequence[Layout | Bodies], files: Sequence[Path]) -> Layout | Bodies:
    """Join what several files hold; the block of a file that holds one is named after it.

    Layouts in space are no files of one stone each: they hold all blocks.
    """
    if any(isinstance(part, Layout) and part.dimension == 3 for part in found):
        raise ValueError("it stands for layouts of blocks in space; give one of them")
    units = {part.unit: file for part, file in zip(found, files, strict=True)}
    if len(units) > 1:
        listed = ", ".join(f"'{file.name}' {unit or 'none'}" for unit, file in units.items())
        raise ValueError(f"its files state different units ({listed}); export them in one")
    parts, labels = [], []
    for part, file in zip(found, files, strict=True):
        if isinstance(part, Bodies):
            alone = len(part.bodies) == 1
            if alone:
                (body,) = part.bodies
                part = replace(part, bodies=[replace(body, name=file.stem, said={**body.said, "name": file.stem})])
        else:
            alone = part.n_blocks == 1
            part = replace(part, names=(file.stem,)) if alone else part
        parts.append(part)
        labels.append("" if alone else file.stem)
    # Bodies have their roles by how names begin; outlines by the rules of their own format, which may not.
    return _joined(parts, labels)
