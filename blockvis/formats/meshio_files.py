"""Meshes with surface cells that meshio reads: Abaqus, Nastran, MED, Medit, XDMF, SU2 ..."""

from __future__ import annotations

import contextlib
import io
import re
from pathlib import Path
from typing import Any

import numpy as np

from blockvis.layout.layout import Layout
from solver.mechanics import counted

from .bodies import Bodies
from .cells import block_array, layout_of_cells, row_of
from .node_order import MESHIO, ring_of_nodes
from .reading import Reading
from .volumes import MESHIO_SOLIDS, Faces, bodies_of_cells


def read(path: Path, reading: Reading) -> Layout | Bodies:
    """Read a mesh through meshio; it states no unit."""
    import meshio

    _check_text(path)
    said = io.StringIO()
    try:
        # meshio prints to the terminal, and raises SystemExit for some files.
        with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
            if path.suffix.lower() in (".tec", ".dat"):
                mesh = meshio.read(_Ending(path.read_text(encoding="utf-8", errors="replace")), "tecplot")
            else:
                mesh = meshio.read(path)
    except (SystemExit, Exception) as error:  # noqa: BLE001
        if isinstance(error, ModuleNotFoundError):
            raise ValueError(f"'{path}' needs the package {error.name}: pip install {error.name}") from None
        reason = " ".join((str(error) or said.getvalue() or type(error).__name__).split())
        raise ValueError(
            f"'{path}' cannot be read by meshio as {path.suffix}: {reason[:300]}; export it again"
        ) from None
    if path.suffix.lower() == ".f3grid":
        mesh.cell_sets = _groups(mesh)
    points = np.asarray(mesh.points, dtype=float)
    solid = [(k, shape) for k, block in enumerate(mesh.cells) if (shape := _shape(block.type))]
    if solid:
        # Surface cells beside cells with a volume are their skin.
        chosen = [(k, len(mesh.cells[k].data)) for k, _ in solid]
        cells = [(shape, np.asarray(mesh.cells[k].data, dtype=np.int64)) for k, shape in solid]
        return _bodies(points, cells, _cell_data(mesh, chosen))
    rings: list[np.ndarray] = []
    chosen = []
    for k, block in enumerate(mesh.cells):
        kind = "polygon" if block.type.startswith("polygon") else block.type
        if kind not in MESHIO:
            continue
        rings += [ring_of_nodes(np.asarray(cell, dtype=np.int64), MESHIO[kind]) for cell in block.data]
        chosen.append((k, len(block.data)))
    return layout_of_cells(points, rings, _cell_data(mesh, chosen), path, reading.view)


def _groups(mesh: Any) -> dict[str, list[np.ndarray]]:
    """Take the groups of FLAC3D, which meshio calls "zone:NAME:SLOT", with numbers of cells in each block of cells."""
    # It numbers them through all blocks of cells.
    starts = np.cumsum([0, *(len(block.data) for block in mesh.cells)])
    return {
        re.sub(r"^(zone|face):(.*):[^:]*$", r"\2", name): [
            part - start for part, start in zip(parts, starts[:-1], strict=True)
        ]
        for name, parts in mesh.cell_sets.items()
    }


def _shape(kind: str) -> Faces | None:
    """Faces of meshio's type of cell; None for one without a volume."""
    return MESHIO_SOLIDS.get(kind.rstrip("0123456789"))


def _cell_data(mesh: Any, chosen: list[tuple[int, int]]) -> dict[str, np.ndarray]:
    """Cell arrays of the chosen blocks of cells, given by number and count."""
    data: dict[str, np.ndarray] = {}
    for key, arrays in mesh.cell_data.items():
        data[key] = np.concatenate([np.asarray(arrays[k]) for k, _ in chosen]) if chosen else np.zeros(0)
    if "block_id" not in data:
        data.update(_sets(mesh, chosen))
    return data


def _bodies(points: np.ndarray, cells: list[tuple[Faces, np.ndarray]], data: dict[str, np.ndarray]) -> Bodies:
    key = block_array(data)
    total = sum(len(nodes) for _, nodes in cells)
    values, owner = np.unique(data[key] if key else np.zeros(total, dtype=np.int64), return_inverse=True)
    names = [f"block {value}" for value in values.tolist()] if key else ["block"]
    bodies, owners = bodies_of_cells(points, cells, owner, names)
    first = np.unique(owner, return_index=True)[1]
    rows = [row_of(data, int(first[whose]), body.name) for body, whose in zip(bodies, owners.tolist(), strict=True)]
    how = f"one per value of the cell array '{key}'" if key else "one per piece that hangs together"
    return Bodies(tuple(bodies), tuple(rows), notes=(f"{counted(len(bodies), 'body', 'bodies')}, {how}",))


class _Ending(io.StringIO):
    """A text that raises an error if it is read far beyond its end, as meshio's reader of Tecplot files does."""

    ends = 0

    def readline(self, size: int | None = -1, /) -> str:  # type: ignore[override]
        """Read the next line."""
        line = super().readline(-1 if size is None else size)
        self.ends = 0 if line else self.ends + 1
        if self.ends > 100:
            raise EOFError("the file ends too early")
        return line


def _check_text(path: Path) -> None:
    """Refuse names of files outside the folder, and counts that the file is too short for."""
    suffix = path.suffix.lower()
    if suffix in (".inp", ".xdmf", ".xmf"):
        text = path.read_text(encoding="utf-8", errors="replace")
        named = re.findall(r"(?im)^\s*\*\s*include\s*,.*?input\s*=\s*([^,\r\n]+)", text)
        named += re.findall(r"(?i)<DataItem[^>]*Format\s*=\s*[\"'](?:HDF|Binary)[\"'][^>]*>\s*([^<:]+)", text)
        for name in (name.strip().strip("\"'") for name in named):
            if Path(name).is_absolute() or not (path.parent / name).resolve().is_relative_to(path.parent.resolve()):
                raise ValueError(f"'{path}' names '{name}', which is outside its folder; keep the files together")
    if suffix in (".tec", ".dat"):
        size = path.stat().st_size
        with path.open("rb") as stream:
            head = stream.read(1_000_000)
        for match in re.finditer(rb"(?i)\b(N|E|I|J|K|NODES|ELEMENTS)\s*=\s*(\d+)", head):
            if int(match[2][:18]) > size:
                raise ValueError(f"'{path}' announces {match[0].decode()} in {size} bytes; export it again")


def _sets(mesh: Any, chosen: list[tuple[int, int]]) -> dict[str, np.ndarray]:
    """Cell arrays of blocks from named cell sets (Abaqus ELSET, XDMF sets), if every surface cell is in one of them."""
    total = sum(n for _, n in chosen)
    start = (
        dict(zip((k for k, _ in chosen), np.cumsum([0] + [n for _, n in chosen[:-1]]), strict=True)) if chosen else {}
    )
    owner, names = np.full(total, -1), list[str]()
    for name, parts in mesh.cell_sets.items():
        members = [
            start[k] + np.asarray(part, dtype=np.int64)
            for k, part in enumerate(parts)
            if k in start and part is not None and len(part)
        ]
        if not members:
            continue
        index = np.concatenate(members)
        if (owner[index] >= 0).any():
            return {}
        owner[index] = len(names)
        names.append(str(name))
    if total == 0 or (owner < 0).any():
        return {}
    return {"block_id": owner, "name": np.array(names)[owner]}
