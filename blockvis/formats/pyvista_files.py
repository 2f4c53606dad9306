"""Files of VTK, .vtu .vtp .vtk .vtm .pvd, and datasets in memory, through pyvista."""

from __future__ import annotations

import math
import re
import warnings
import zlib
from pathlib import Path
from typing import TYPE_CHECKING, Any
from xml.parsers import expat
from xml.sax.saxutils import unescape

import numpy as np

from blockvis.layout.block_table import rows_of
from blockvis.layout.layout import Layout
from blockvis.layout.outlines import FLAT

from .cells import layout_of_cells, merged, row_of
from .node_order import VTK, ring_of_nodes
from .reading import Reading
from .vtk_arrays import largest_number

if TYPE_CHECKING:
    import pyvista

#: VTK's types of cells with a volume.
SOLID_CELLS = {10, 11, 12, 13, 14, 15, 16, 24, 25, 26, 27, 29, 41, 42, 71, 72}

#: zlib compresses at most 1032 to 1: a file cannot hold more than this many numbers per byte.
MOST_PER_BYTE = 1100

#: Numbers that all arrays of a file may hold together: 400 MB, a thousand times a large drawing.
MOST_NUMBERS = 50_000_000

#: XML elements nested deeper than this are refused; VTK nests a handful.
DEEPEST = 64


def read(path: Path, reading: Reading) -> Layout:
    """Read a file of VTK, which states no unit."""
    import pyvista
    from vtkmodules.vtkCommonCore import vtkObject

    _check_counts(path)
    if path.suffix.lower() in (".pvd", ".vtm"):
        _check_parts(path)
    try:
        # VTK would print every fault of a file to the terminal as well; the message below has the reason.
        with warnings.catch_warnings(), pyvista.vtk_verbosity("off"):
            warnings.simplefilter("ignore")
            vtkObject.GlobalWarningDisplayOff()
            if path.suffix.lower() == ".pvd":
                data: Any = pyvista.PVDReader(str(path)).read()
            else:
                data = pyvista.read(str(path))
    except (OSError, ValueError, RuntimeError, KeyError, TypeError, AttributeError, IndexError, SyntaxError) as error:
        raise ValueError(f"'{path}' cannot be read as {path.suffix} ({error}); export it again") from None
    finally:
        vtkObject.GlobalWarningDisplayOn()
    return layout_of_dataset(data, path)


def _check_counts(path: Path) -> None:
    """Refuse counts that the file is too short for, before VTK reserves memory for them and ends the process."""
    if path.suffix.lower() == ".vtk":
        _check_legacy(path)
    else:
        _check_xml(path)


def _check_legacy(path: Path) -> None:
    data = path.read_bytes()
    if not data.lstrip().startswith(b"# vtk DataFile"):
        raise _not_vtk(path, data)
    found = re.finditer(
        rb"(?im)^[ \t]*(?:POINTS|VERTICES|LINES|POLYGONS|TRIANGLE_STRIPS|CELLS|CELL_TYPES|CELL_DATA|POINT_DATA|METADATA"
        rb"|FIELD[ \t]+\S+|LOOKUP_TABLE[ \t]+\S+|[XYZ]_COORDINATES|OFFSETS|CONNECTIVITY)[ \t]+(-?\d+)"
        rb"(?:[ \t]+(-?\d+))?",
        data,
    )
    counts = [int(number[:18]) for match in found for number in match.groups() if number]
    # An array of a FIELD: name, components, tuples, type.
    for match in re.finditer(rb"(?im)^[ \t]*\S+[ \t]+(-?\d+)[ \t]+(-?\d+)[ \t]+[a-z_]+[ \t]*\r?$", data):
        components, tuples = (int(number[:18]) for number in match.groups())
        counts += [components, tuples, components * tuples]
    for match in re.finditer(rb"(?im)^[ \t]*DIMENSIONS((?:[ \t]+-?\d+)+)", data):
        sizes = [int(number[:18]) for number in match[1].split()]
        counts += [min(sizes), math.prod(sizes)]
    _refuse(path, [count for count in counts if not 0 <= count <= MOST_PER_BYTE * len(data)], len(data))
    _refuse(path, [count for count in counts if count > MOST_NUMBERS], len(data))


def _check_xml(path: Path) -> None:
    """Check document type, nesting and counts in one pass of a parser that keeps nothing."""
    data = path.read_bytes()
    if not data.lstrip().startswith(b"<"):
        raise _not_vtk(path, data)
    parser = expat.ParserCreate()
    held = _Held(path, len(data))

    def doctype(*_: object) -> None:
        raise ValueError(f"'{path}' has an XML document type; no VTK file needs one: export it again")

    parser.StartDoctypeDeclHandler = doctype
    parser.StartElementHandler, parser.EndElementHandler = held.start, held.end
    parser.CharacterDataHandler = held.text
    try:
        # In pieces, so that parsing stops at appended raw data, which are no XML.
        for first in range(0, len(data), 1 << 20):
            if not held.appended:
                parser.Parse(data[first : first + (1 << 20)], False)
        if not held.appended:
            parser.Parse(b"", True)
    except expat.ExpatError as error:
        if not held.appended:
            raise ValueError(f"'{path}' cannot be read as {path.suffix} ({error}); export it again") from None
    if held.appended and held.later:
        start = data.index(b"_", data.index(b"<AppendedData")) + 1
        for attributes in held.later:
            way = "raw" if held.appended == "raw" else "binary"
            held.check_offsets(data[start + int(attributes.get("offset", 0)) :], attributes | {"format": way})


class _Held:
    """Numbers of points, cells and values that an XML file announces, added up element by element."""

    def __init__(self, path: Path, size: int) -> None:
        self.path, self.size = path, size
        self.points = self.cells = self.numbers = self.depth = 0
        self.file: dict[str, str] = {}
        self.appended = ""
        self.later: list[dict[str, str]] = []
        self.offsets: dict[str, str] | None = None
        self.content: list[str] = []

    def start(self, tag: str, attributes: dict[str, str]) -> None:
        """Check the counts of an element when it begins."""
        self.depth += 1
        if self.depth > DEEPEST:
            raise ValueError(
                f"'{self.path}' nests elements more than {DEEPEST} deep; no VTK file does: export it again"
            )
        counts = {key: value for key, value in attributes.items() if key.startswith("NumberOf")}
        for key, value in counts.items():
            if not re.fullmatch(r"\s*\d{1,15}\s*", value) or int(value) > MOST_PER_BYTE * self.size:
                raise ValueError(
                    f"'{self.path}' announces {value[:20]} items in {self.size} bytes ({key}); export it again"
                )
        for key in ("WholeExtent", "Extent"):
            ends = [int(end[:15]) for end in re.findall(r"-?\d+", attributes.get(key, ""))]
            if ends:
                self.points = math.prod(abs(b - a) + 1 for a, b in zip(ends[::2], ends[1::2], strict=False))
                self._bound(self.points)
        if tag == "VTKFile":
            self.file = attributes
        elif tag == "Piece":
            self.points = int(counts.pop("NumberOfPoints", self.points))
            self.cells = sum(int(value) for value in counts.values())
        elif tag in ("DataArray", "Array"):
            components = int(counts.get("NumberOfComponents", 1))
            self.numbers += components * int(counts.get("NumberOfTuples", max(self.points, self.cells)))
            self._bound(self.numbers)
            if attributes.get("Name") == "offsets":
                if attributes.get("format") == "appended":
                    self.later.append(attributes)
                else:
                    self.offsets, self.content = attributes, []
        elif tag == "AppendedData":
            self.appended = attributes.get("encoding", "base64")

    def end(self, tag: str) -> None:
        """Check the offsets of cells when their element ends."""
        self.depth -= 1
        if self.offsets is not None:
            self.check_offsets("".join(self.content).strip().encode(), self.offsets)
            self.offsets = None

    def text(self, data: str) -> None:
        """Collect the text of an element of offsets."""
        if self.offsets is not None:
            self.content.append(data)

    def check_offsets(self, content: bytes, attributes: dict[str, str]) -> None:
        """Check the last offset: VTK reserves memory for so many numbers."""
        try:
            largest = largest_number(content, attributes, self.file, 8 * MOST_NUMBERS)
        except (ValueError, KeyError, OverflowError, zlib.error) as error:
            raise ValueError(
                f"'{self.path}' has cells whose offsets cannot be read ({error}); export it again"
            ) from None
        self._bound(largest)
        if largest > MOST_PER_BYTE * self.size:
            _refuse(self.path, [largest], self.size)

    def _bound(self, count: int) -> None:
        _refuse(self.path, [count] if count > MOST_NUMBERS else [], self.size)


def _refuse(path: Path, counts: list[int], size: int) -> None:
    if counts:
        raise ValueError(f"'{path}' announces {counts[0]} items in {size} bytes; export it again")


def _not_vtk(path: Path, data: bytes) -> ValueError:
    return ValueError(f"'{path}' is not a file of VTK: it starts with {data[:16]!r}; export it again")


def _check_parts(path: Path, seen: tuple[Path, ...] = ()) -> None:
    """Refuse lists of files (.pvd, .vtm) that name a missing file, one outside the folder, or one of no VTK format."""
    if path in seen:
        raise ValueError(f"'{path}' names itself; export it again")
    data = path.read_text(encoding="utf-8", errors="replace")
    for name in re.findall(r"""<DataSet\b[^>]*?\bfile\s*=\s*["']([^"']*)["']""", data):
        name = unescape(name, {"&quot;": '"', "&apos;": "'"})
        target = path.parent / name
        if Path(name).is_absolute() or not target.resolve().is_relative_to(path.parent.resolve()):
            raise ValueError(f"'{path}' names '{name}', which is outside its folder; keep the files together")
        if target.suffix.lower() not in (".vtu", ".vtp", ".vtk", ".vtm"):
            raise ValueError(f"'{path}' names '{name}', which is no .vtu, .vtp, .vtk or .vtm; export it again")
        if not target.is_file():
            raise ValueError(f"'{path}' names '{name}', which does not exist; keep the files together")
        _check_counts(target)
        if target.suffix.lower() == ".vtm":
            _check_parts(target, (*seen, path))


def layout_of_dataset(data: Any, path: Path | str = "dataset") -> Layout:
    """Make a layout of a pyvista dataset: a mesh, or a multiblock of meshes.

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
            parts.append(part)
            name = data.get_block_name(k) or ""
            labels.append("" if re.fullmatch(r"Block-\d+", name) else name)
        if parts and all(_is_solid(part) for part in parts):
            return _layout_of_solids(_one_grid(parts, labels), path)
        return merged([layout_of_dataset(part, path) for part in parts], labels, path)
    grid = _as_cells(data, path)
    types = np.asarray(grid.celltypes)
    if _is_solid(grid):
        return _layout_of_solids(grid, path)
    offset, connectivity = np.asarray(grid.cell_offsets), np.asarray(grid.cell_connectivity)
    surface = np.flatnonzero(np.isin(types, list(VTK)))
    rings = []
    for cell in surface:
        nodes = connectivity[offset[cell] : offset[cell + 1]].astype(np.int64)
        rings.append(ring_of_nodes(nodes, VTK[int(types[cell])]))
    cell_data = {str(key): np.asarray(grid.cell_data[key])[surface] for key in grid.cell_data}
    return layout_of_cells(np.asarray(grid.points, dtype=float), rings, cell_data, path)


def _is_solid(data: Any) -> bool:
    """Whether a mesh has cells with a volume, or closed surfaces around some."""
    import pyvista

    if not isinstance(data, pyvista.DataSet) or data.n_cells == 0:
        return False
    grid = _as_cells(data, "")
    if np.isin(np.asarray(grid.celltypes), list(SOLID_CELLS)).any():
        return True
    spread = np.ptp(np.asarray(grid.points, dtype=float), axis=0)
    if spread.min() <= FLAT * spread.max():
        return False
    return bool(grid.extract_surface(algorithm="dataset_surface").n_open_edges == 0)


def _one_grid(parts: list[Any], labels: list[str]) -> Any:
    """Put solid parts into one grid: together they say in which direction the structure is extruded."""
    import pyvista

    grids, n = [], 0
    for part, label in zip(parts, labels, strict=True):
        grid = _as_cells(part, "").copy()
        given = "block_id" in grid.cell_data
        ids = grid.cell_data["block_id"] if given else grid.connectivity().cell_data["RegionId"]
        _, ids = np.unique(np.asarray(ids), return_inverse=True)
        if "name" not in grid.cell_data:
            several = ids.max() > 0
            names = [f"{label or 'block'} {n + i}" if several or not label else label for i in ids]
            grid.cell_data["name"] = np.array(names)
        grid.cell_data["block_id"] = ids + n
        n += int(ids.max()) + 1
        grids.append(grid)
    return pyvista.merge(grids, merge_points=False)


def _as_cells(data: Any, path: Path | str) -> pyvista.UnstructuredGrid:
    import pyvista

    if not isinstance(data, pyvista.DataSet) or data.n_cells == 0:
        raise ValueError(f"'{path}' has no cells; save the blocks as polygons or a meshed surface")
    if isinstance(data, pyvista.UnstructuredGrid):
        return data
    return data.cast_to_unstructured_grid()


def _layout_of_solids(grid: Any, path: Path | str) -> Layout:
    from .solids import Body, layout_of_bodies

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
    return layout_of_bodies(bodies, path, rows)


def dataset_of(layout: Layout) -> pyvista.UnstructuredGrid:
    """Make a dataset of a polygon cell per block, with the cell arrays that the reader understands."""
    import pyvista

    counts = [len(ring) for ring in layout.outlines]
    starts = np.concatenate([[0], np.cumsum(counts)])
    cells = np.concatenate([[n, *range(s, s + n)] for n, s in zip(counts, starts[:-1], strict=True)])
    flat = np.concatenate(layout.outlines)
    points = np.column_stack([flat, np.zeros(len(flat))])
    grid = pyvista.UnstructuredGrid(cells, np.full(len(counts), 7, dtype=np.uint8), points)
    grid.cell_data["block_id"] = np.arange(len(counts), dtype=np.int32)
    rows = rows_of(layout)
    for key in ("name", "group", "role", "material"):
        words = [str(row.get(key, "")) for row in rows]
        if any(words):
            _add_words(grid.GetCellData(), key, words)
    for key in ("thickness", "density"):
        if any(key in row for row in rows):
            grid.cell_data[key] = np.array([float(row.get(key, np.nan)) for row in rows])
    return grid


def _add_words(attributes: Any, name: str, words: list[str]) -> None:
    """Add a string array without pyvista, which refuses letters beyond ASCII although VTK writes them."""
    from vtkmodules.vtkCommonCore import vtkStringArray

    array = vtkStringArray()
    array.SetName(name)
    array.SetNumberOfValues(len(words))
    for k, word in enumerate(words):
        array.SetValue(k, word)
    attributes.AddArray(array)


def write(layout: Layout, path: Path) -> None:
    """Write .vtu, .vtp or .vtk: a polygon cell per block, double precision, lengths in m."""
    grid = dataset_of(layout)
    if path.suffix.lower() == ".vtp":
        surface = _surface(grid)
        surface.save(str(path))
    else:
        if path.suffix.lower() == ".vtu":
            from blockvis.vtk_files import write_vtu

            write_vtu(grid, path)
            return
        grid.save(str(path))


def _surface(grid: Any) -> pyvista.PolyData:
    import pyvista

    surface = pyvista.PolyData(np.asarray(grid.points), faces=np.asarray(grid.cells))
    for key in grid.cell_data:
        surface.GetCellData().AddArray(grid.GetCellData().GetAbstractArray(key))
    return surface
