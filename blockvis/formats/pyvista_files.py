"""Files of VTK, .vtu .vtp .vtk .vtm .pvd, through pyvista; and datasets that are in memory already."""

from __future__ import annotations

import re
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from blockvis.drawing import Drawing
from blockvis.formats import Reading
from blockvis.formats.cells import drawing_of_cells, merged, row_of
from blockvis.formats.layout_json import rows_of

if TYPE_CHECKING:
    import pyvista

__all__ = ["dataset_of", "drawing_of_dataset", "read", "write"]

#: Points around a surface cell, by VTK's cell type; None: all of them in order.
RINGS: dict[int, tuple[int, ...] | None] = {
    5: None, 7: None, 9: None, 8: (0, 1, 3, 2), 22: (0, 3, 1, 4, 2, 5), 34: (0, 3, 1, 4, 2, 5),
    23: (0, 4, 1, 5, 2, 6, 3, 7), 28: (0, 4, 1, 5, 2, 6, 3, 7),
}  # fmt: skip

SOLID_CELLS = {10, 11, 12, 13, 14, 15, 16, 24, 25, 26, 27, 29, 41, 42, 71, 72}

#: zlib packs no better than 1032 to 1: a file that announces more than this many numbers per byte lies.
MOST_PER_BYTE = 1100


def read(path: Path, reading: Reading) -> Drawing:
    """Reads a file of VTK; it does not say its unit."""
    import pyvista
    from vtkmodules.vtkCommonCore import vtkObject

    _check_counts(path)
    try:
        # VTK writes every fault of a file to the terminal as well; the reason below is enough.
        with warnings.catch_warnings(), pyvista.vtk_verbosity("off"):
            warnings.simplefilter("ignore")
            vtkObject.GlobalWarningDisplayOff()
            if path.suffix.lower() == ".pvd":
                reader = pyvista.PVDReader(str(path))
                _check_parts(reader.datasets, path)
                data: Any = reader.read()
            else:
                data = pyvista.read(str(path))
    except (OSError, ValueError, RuntimeError, KeyError, TypeError, AttributeError, IndexError, SyntaxError) as error:
        raise ValueError(f"'{path}' cannot be read as {path.suffix} ({error}); export it again") from None
    finally:
        vtkObject.GlobalWarningDisplayOn()
    return drawing_of_dataset(data, path)


def _check_counts(path: Path) -> None:
    """Refuses counts that the file cannot hold, before VTK reserves memory for them and ends the process."""
    size = path.stat().st_size
    with path.open("rb") as stream:
        head = stream.read(4_000_000)
    legacy = path.suffix.lower() == ".vtk"
    if not head.lstrip().startswith(b"# vtk DataFile" if legacy else b"<"):
        raise ValueError(f"'{path}' is not a file of VTK: it starts with {head[:16]!r}; export it again")
    if re.search(rb"<!\s*(DOCTYPE|ENTITY)", head):
        raise ValueError(f"'{path}' has an XML document type; no VTK file needs one: export it again")
    counts = [m[1] for m in re.finditer(rb'(?:NumberOf\w+|NumberOfTuples)\s*=\s*"\s*(\d+)', head)]
    counts += [m[1] for m in re.finditer(rb"(?m)^(?:POINTS|CELLS|POLYGONS|CELL_TYPES|CELL_DATA)\s+(\d+)", head)]
    for match in re.finditer(rb'(?:DIMENSIONS|WholeExtent\s*=\s*")\s*([-\d ]+)', head):
        values = [abs(int(v)) + 1 for v in match[1].split() if len(v) < 12]
        counts.append(str(int(np.prod(np.array(values, dtype=float).clip(max=1e12)[-3:]))).encode() if values else b"0")
    for count in counts:
        if int(count[:18]) > MOST_PER_BYTE * size:
            raise ValueError(f"'{path}' announces {count.decode()} items in {size} bytes; export it again")


def _check_parts(parts: Any, path: Path) -> None:
    for part in parts:
        target = path.parent / str(part.path)
        if not target.exists():
            raise ValueError(f"'{path}' names '{part.path}', which does not exist; keep the files together")
        _check_counts(target)


def drawing_of_dataset(data: Any, path: Path | str = "dataset") -> Drawing:
    """The drawing of a pyvista dataset: a mesh, or a multiblock of meshes.

    Parameters
    ----------
    data : pyvista.DataSet or pyvista.MultiBlock
    path : Path or str
        Named in messages.
    """
    import pyvista

    if isinstance(data, pyvista.MultiBlock):
        parts, labels = [], []
        for k, part in enumerate(data):
            if part is None or (isinstance(part, pyvista.DataSet) and part.n_cells == 0):
                continue
            parts.append(drawing_of_dataset(part, path))
            name = data.get_block_name(k) or ""
            labels.append("" if re.fullmatch(r"Block-\d+", name) else name)
        return merged(parts, labels, path)
    grid = _as_cells(data, path)
    flat_types = np.asarray(grid.celltypes)
    if np.isin(flat_types, list(SOLID_CELLS)).any():
        return _drawing_of_solids(grid, path)
    offset, connectivity = np.asarray(grid.cell_offsets), np.asarray(grid.cell_connectivity)
    surface = np.flatnonzero(np.isin(flat_types, list(RINGS)))
    rings = []
    for cell in surface:
        nodes = connectivity[offset[cell] : offset[cell + 1]].astype(np.int64)
        order = RINGS[int(flat_types[cell])]
        rings.append(nodes if order is None else nodes[list(order)])
    cell_data = {str(key): np.asarray(grid.cell_data[key])[surface] for key in grid.cell_data}
    return drawing_of_cells(np.asarray(grid.points, dtype=float), rings, cell_data, path)


def _as_cells(data: Any, path: Path | str) -> pyvista.UnstructuredGrid:
    import pyvista

    if not isinstance(data, pyvista.DataSet) or data.n_cells == 0:
        raise ValueError(f"'{path}' has no cells; save the blocks as polygons or a meshed surface")
    if isinstance(data, pyvista.UnstructuredGrid):
        return data
    return data.cast_to_unstructured_grid()


def _drawing_of_solids(grid: Any, path: Path | str) -> Drawing:
    from blockvis.formats.solids import Body, drawing_of_bodies

    rows: list[dict[str, Any]] = []
    bodies = []
    ids = np.asarray(grid.cell_data["block_id"]) if "block_id" in grid.cell_data else None
    if ids is None:
        ids = np.asarray(grid.connectivity().cell_data["RegionId"])
    for value in np.unique(ids):
        cells = np.flatnonzero(ids == value)
        surface = grid.extract_cells(cells).extract_surface(algorithm="dataset_surface").triangulate()
        faces = np.asarray(surface.faces).reshape(-1, 4)[:, 1:]
        bodies.append(Body(f"block {value}", np.asarray(surface.points, dtype=float), faces))
        named = {key: np.asarray(grid.cell_data[key])[cells] for key in grid.cell_data}
        rows.append(row_of(named, 0, f"block {value}"))
    return drawing_of_bodies(bodies, path, rows)


def dataset_of(drawing: Drawing) -> pyvista.UnstructuredGrid:
    """A dataset of one polygon cell per block, with the arrays that the reader understands."""
    import pyvista

    counts = [len(ring) for ring in drawing.outlines]
    starts = np.concatenate([[0], np.cumsum(counts)])
    cells = np.concatenate([[n, *range(s, s + n)] for n, s in zip(counts, starts[:-1], strict=True)])
    flat = np.concatenate(drawing.outlines)
    points = np.column_stack([flat, np.zeros(len(flat))])
    grid = pyvista.UnstructuredGrid(cells, np.full(len(counts), 7, dtype=np.uint8), points)
    grid.cell_data["block_id"] = np.arange(len(counts), dtype=np.int32)
    rows = rows_of(drawing)
    for key in ("name", "group", "role", "material"):
        words = [str(row.get(key, "")) for row in rows]
        if any(words):
            _add_words(grid.GetCellData(), key, words)
    for key in ("thickness", "density"):
        if any(key in row for row in rows):
            grid.cell_data[key] = np.array([float(row.get(key, np.nan)) for row in rows])
    return grid


def _add_words(attributes: Any, name: str, words: list[str]) -> None:
    """A string array, filled by hand: pyvista refuses letters beyond ASCII, which VTK's files carry well."""
    from vtkmodules.vtkCommonCore import vtkStringArray

    array = vtkStringArray()
    array.SetName(name)
    array.SetNumberOfValues(len(words))
    for k, word in enumerate(words):
        array.SetValue(k, word)
    attributes.AddArray(array)


def write(drawing: Drawing, path: Path) -> None:
    """Writes .vtu, .vtp or .vtk: a polygon cell per block, double precision, lengths in m."""
    grid = dataset_of(drawing)
    if path.suffix.lower() == ".vtp":
        surface = _surface(grid)
        surface.save(str(path))
    else:
        if path.suffix.lower() == ".vtu":
            from blockvis.vtkxml import write_vtu

            write_vtu(grid, path)
            return
        grid.save(str(path))


def _surface(grid: Any) -> pyvista.PolyData:
    import pyvista

    surface = pyvista.PolyData(np.asarray(grid.points), faces=np.asarray(grid.cells))
    for key in grid.cell_data:
        surface.GetCellData().AddArray(grid.GetCellData().GetAbstractArray(key))
    return surface
