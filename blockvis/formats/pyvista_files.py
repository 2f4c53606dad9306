"""Files of VTK, .vtu .vtp .vtk .vtm .pvd, and datasets in memory, through pyvista."""

from __future__ import annotations

import logging
import math
import re
import warnings
import zlib
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree
from xml.sax.saxutils import unescape

import numpy as np
import pyvista
from vtkmodules.util.numpy_support import vtk_to_numpy

from blockvis.layout.block_table import rows_of
from blockvis.layout.layout import Layout
from blockvis.layout.notes import LEFT_OUT, Note
from blockvis.system.vtk_files import string_array, write_vtu
from solver.mechanics import counted

from .bodies import Bodies, Body, body_of_polygons, in_dimension
from .cells import flat_beside, layout_of_cells, merged, owners, rows_of_cells
from .node_order import VTK, ring_of_nodes
from .reading import DEEPEST, Reading, naming
from .volumes import VTK_SOLIDS, bodies_of_cells
from .vtk_arrays import announced_bytes, largest_number

#: VTK's type of cell with a volume that lists its faces, which do not follow from the type.
POLYHEDRON = pyvista.CellType.POLYHEDRON

#: VTK's types of cell with an area, of which some are read, and those with none, which draw no block.
FACES = tuple(kind for kind in pyvista.CellType if kind.dimension == 2)
LINES = tuple(kind for kind in pyvista.CellType if kind.dimension < 2)

#: The cell array by which files of an increment say which blocks have left for good.
GONE = "fallen"

#: zlib compresses at most 1032 to 1: a file cannot hold more than this many numbers per byte.
MOST_PER_BYTE = 1100

#: Numbers that all arrays of a file may hold together: 400 MB, a thousand times a large drawing.
MOST_NUMBERS = 50_000_000


def read(path: Path, reading: Reading) -> Layout | Bodies:
    """Read a file of VTK, which states no unit."""
    _check_counts(path)
    if path.suffix.lower() in (".pvd", ".vtm", ".vtmb"):
        _check_parts(path)
    faults = pyvista.VtkErrorCatcher(send_to_logging=False)
    data: Any = None
    failed: Exception | None = None
    # VTK would print every fault of a file to the terminal, and pyvista log it, as well.
    disabled = logging.root.manager.disable
    logging.disable(max(disabled, logging.ERROR))
    try:
        with warnings.catch_warnings(), pyvista.vtk_verbosity("off"), faults:
            warnings.simplefilter("ignore")
            # pyvista.read would take the errors of the reader itself from the catcher.
            data = pyvista.get_reader(str(path)).read()
    except (OSError, ValueError, RuntimeError, KeyError, TypeError, AttributeError, IndexError, SyntaxError) as error:
        failed = error
    finally:
        logging.disable(disabled)
    if faults.error_events:
        # At an array of a type that it does not know VTK leaves out all further ones and hands out the rest.
        reason = " ".join(faults.error_events[0].alert.split())[:200]
        remedy = "save it as .vtu" if path.suffix.lower() == ".vtk" else "export it again"
        raise ValueError(f"it cannot be read whole by VTK ({reason}); {remedy}")
    if failed is not None:
        raise ValueError(f"it cannot be read as {path.suffix} ({failed}); export it again") from None
    return found_in_dataset(data, reading.view)


def _check_counts(path: Path) -> None:
    """Refuse counts that the file is too short for, before VTK reserves memory for them and ends the process."""
    if path.suffix.lower() == ".vtk":
        _check_legacy(path)
    else:
        _check_xml(path)


def _check_legacy(path: Path) -> None:
    data = path.read_bytes()
    if not data.lstrip().startswith(b"# vtk DataFile"):
        raise _not_vtk(data)
    version = re.match(rb"\s*# vtk DataFile Version (\d{1,2})\.\d+[ \t]*\r?\n", data)
    offsets = re.search(rb"(?im)^[ \t]*OFFSETS[ \t]", data) is not None
    # Offsets VTK takes for numbers of corners in a version that has none, and ends the process.
    if version is None or (offsets and int(version[1]) < 5):
        named = data.lstrip().splitlines()[0][:40].decode(errors="replace")
        raise ValueError(f"its first line, '{named}', is not of the version of its cells; export it again")
    found = re.finditer(
        rb"(?im)^[ \t]*(?:POINTS|VERTICES|LINES|POLYGONS|TRIANGLE_STRIPS|CELLS|CELL_TYPES|CELL_DATA|POINT_DATA|METADATA"
        rb"|FIELD[ \t]+\S+|LOOKUP_TABLE[ \t]+\S+|[XYZ]_COORDINATES|OFFSETS|CONNECTIVITY)[ \t]+(-?\d+)"
        rb"(?:[ \t]+(-?\d+))?",
        data,
    )
    counts = [int(number[:18]) for match in found for number in match.groups() if number]
    # An array of a FIELD: name, components, tuples, type.
    for match in re.finditer(rb"(?im)^[ \t]*\S+[ \t]+(-?\d+)[ \t]+(-?\d+)[ \t]+[a-z_]+\d*[ \t]*\r?$", data):
        components, tuples = (int(number[:18]) for number in match.groups())
        counts += [components, tuples, components * tuples]
    for match in re.finditer(rb"(?im)^[ \t]*DIMENSIONS((?:[ \t]+-?\d+)+)", data):
        sizes = [int(number[:18]) for number in match[1].split()]
        counts += [min(sizes), math.prod(sizes)]
    _refuse(counts, len(data))
    _check_cells(data)


def _check_cells(data: bytes) -> None:
    """Refuse cells of a .vtk that do not add up to the numbers it announces: VTK reads beyond their end."""
    binary = re.search(rb"(?im)^[ \t]*BINARY[ \t]*\r?$", data) is not None
    # An array of a field has its type behind two numbers, too.
    kinds = rb"(?im)^[ \t]*(?:CELLS|POLYGONS|LINES|VERTICES|TRIANGLE_STRIPS)\s+(\d+)\s+(\d+)(?=\s)(?![ \t]+[a-z])"
    for match in re.finditer(kinds, data):
        cells, size = int(match[1]), int(match[2])
        offsets = re.compile(rb"\s*OFFSETS\s+(\w+)", re.IGNORECASE).match(data, match.end())
        read = _binary_numbers if binary else _written_numbers
        if offsets:
            long = offsets[1].lower() in (b"vtktypeint64", b"vtktypeuint64", b"long")
            fits = _rise_to(read(data, offsets.end(), cells, ">i8" if long else ">i4"), cells, size)
        else:
            fits = _run_through(read(data, match.end(), size, ">i4").tolist(), cells, size)
        if not fits:
            raise ValueError(
                f"its {cells} cells do not add up to the {size} numbers that it announces; export it again"
            )


def _binary_numbers(data: bytes, after: int, count: int, kind: str) -> np.ndarray:
    """Read up to so many numbers from the line below a place."""
    start, size = data.find(b"\n", after) + 1, np.dtype(kind).itemsize
    return np.frombuffer(data, kind, min(count, (len(data) - start) // size), start)


def _written_numbers(data: bytes, after: int, count: int, kind: str) -> np.ndarray:
    """Read up to so many numbers that are written out behind a place; -1 for other words."""
    words = data[after:].split(None, count)[:count]
    return np.array([int(word) if re.fullmatch(rb"\d{1,9}", word) else -1 for word in words], dtype=kind)


def _rise_to(offsets: np.ndarray, cells: int, size: int) -> bool:
    """Whether the offsets of cells, one more than there are, rise from 0 to the size."""
    if cells == 0 or len(offsets) != cells:
        return cells == 0
    return bool(offsets[0] == 0 and offsets[-1] == size and (np.diff(offsets) >= 0).all())


def _run_through(numbers: list[int], cells: int, size: int) -> bool:
    """Whether so many cells, the number of corners before those of each, fill the numbers of this size."""
    place = 0
    for _ in range(cells):
        if not place < len(numbers) or numbers[place] < 0:
            return False
        place += 1 + numbers[place]
    return place == size == len(numbers)


def _check_xml(path: Path) -> None:
    """Check document type, nesting and counts; appended data are no XML, and are looked up from the arrays."""
    data = path.read_bytes()
    if not data.lstrip().startswith(b"<"):
        raise _not_vtk(data)
    start = data.find(b"<AppendedData")
    markup, appended = (data, b"") if start < 0 else (data[:start], data[start:])
    if re.search(rb"<!\s*DOCTYPE", markup, re.IGNORECASE):
        raise ValueError("it has an XML document type; no VTK file needs one: export it again")
    parser: Any = ElementTree.XMLPullParser(("start", "end"))
    try:
        parser.feed(markup)
        if not appended:
            parser.close()
        events = [*parser.read_events()]
    except ElementTree.ParseError as error:
        raise ValueError(f"it cannot be read as {path.suffix} ({error}); export it again") from None
    file: dict[str, str] = {}
    depth = items = numbers = 0
    for event, element in events:
        depth += 1 if event == "start" else -1
        if depth > DEEPEST:
            raise ValueError(f"it nests elements more than {DEEPEST} deep; no VTK file does: export it again")
        is_array = element.tag in ("DataArray", "Array")
        if event == "end":
            if is_array:
                _check_array(element, appended, file, len(data))
            continue
        counts = _counts(element, len(data))
        if element.tag == "VTKFile":
            file = element.attrib
        elif element.tag == "Piece":
            items = max(counts.pop("NumberOfPoints", items), sum(counts.values()))
        elif is_array:
            numbers += counts.get("NumberOfComponents", 1) * counts.get("NumberOfTuples", items)
        items = counts.get("Extent", counts.get("WholeExtent", items))
        _refuse([items, numbers], len(data))


def _counts(element: ElementTree.Element, size: int) -> dict[str, int]:
    """Numbers of items that an element announces, those of an extent included, none of them more than a file holds."""
    counts = dict[str, int]()
    for key, value in element.items():
        if key in ("WholeExtent", "Extent"):
            ends = [int(end[:15]) for end in re.findall(r"-?\d+", value)]
            counts[key] = math.prod(abs(b - a) + 1 for a, b in zip(ends[::2], ends[1::2], strict=False))
        elif key.startswith("NumberOf") or key == "index":
            if not re.fullmatch(r"\s*\d{1,15}\s*", value):
                raise ValueError(f"it announces {value[:20]} items in {size} bytes ({key}); export it again")
            counts[key] = int(value)
    _refuse([*counts.values()], size)
    return counts


def _check_array(array: ElementTree.Element, appended: bytes, file: dict[str, str], size: int) -> None:
    """Check the size that a binary array announces, and the largest of its offsets: VTK reserves as much memory."""
    attributes, is_offsets = array.attrib, array.get("Name", "").endswith("offsets")
    content = (array.text or "").strip().encode()
    if attributes.get("format") == "appended":
        if not is_offsets:
            return
        raw = re.match(rb"""<AppendedData[^>]*\bencoding\s*=\s*["']raw""", appended)
        content = appended[appended.find(b"_") + 1 + int(attributes.get("offset", 0)) :]
        attributes = attributes | {"format": "raw" if raw else "binary"}
    try:
        numbers = announced_bytes(content, attributes, file) // 8 if attributes.get("format") == "binary" else 0
        largest = largest_number(content, attributes, file, 8 * MOST_NUMBERS) if is_offsets else 0
    except (ValueError, KeyError, OverflowError, zlib.error) as error:
        raise ValueError(
            f"it has an array '{array.get('Name', '')}' that cannot be read ({error}); export it again"
        ) from None
    _refuse([numbers, largest], size)


def _refuse(counts: Sequence[int], size: int) -> None:
    """Refuse more items than a file of so many bytes can hold, or than a drawing has."""
    wrong = [count for count in counts if not 0 <= count <= min(MOST_NUMBERS, MOST_PER_BYTE * size)]
    if wrong:
        raise ValueError(f"it announces {wrong[0]} items in {size} bytes; export it again")


def _not_vtk(data: bytes) -> ValueError:
    return ValueError(f"it is not a file of VTK: it starts with {data[:16]!r}; export it again")


def _check_parts(path: Path, seen: tuple[Path, ...] = ()) -> None:
    """Refuse lists of files (.pvd, .vtm) that name a missing file, one outside the folder, or one of no VTK format."""
    if path in seen:
        raise ValueError("it names itself; export it again")
    data = path.read_text(encoding="utf-8", errors="replace")
    for name in re.findall(r"""<DataSet\b[^>]*?\bfile\s*=\s*["']([^"']*)["']""", data):
        name = unescape(name, {"&quot;": '"', "&apos;": "'"})
        target = path.parent / name
        if Path(name).is_absolute() or not target.resolve().is_relative_to(path.parent.resolve()):
            raise ValueError(f"it names '{name}', which is outside its folder; keep the files together")
        if target.suffix.lower() not in (".vtu", ".vtp", ".vtk", ".vtm", ".vtmb"):
            raise ValueError(f"it names '{name}', which is no .vtu, .vtp, .vtk, .vtm or .vtmb; export it again")
        if not target.is_file():
            raise ValueError(f"it names '{name}', which does not exist; keep the files together")
        with naming(f"'{target}'"):
            _check_counts(target)
        if target.suffix.lower() in (".vtm", ".vtmb"):
            _check_parts(target, (*seen, path))


def layout_of_dataset(data: Any, dimension: int | None = None) -> Layout:
    """Make a layout of a pyvista dataset, a mesh or a multiblock of meshes, in 2 or 3 dimensions.

    By default it is in space where bodies are not prisms side by side.
    """
    with naming("'dataset'"):
        found = found_in_dataset(data, None)
        return in_dimension(found, Reading(dimension=dimension)) if isinstance(found, Bodies) else found


def found_in_dataset(data: Any, view: str | None) -> Layout | Bodies:
    """Read the blocks of a pyvista dataset, flat or in space."""
    if isinstance(data, pyvista.MultiBlock):
        return _found_in_parts(data, view)
    grid = _as_cells(data)
    types = np.asarray(grid.celltypes)
    gone = _gone(grid)
    if gone.all():
        raise ValueError(f"{counted(len(gone), 'block')}, all gone by the cell array '{GONE}'; give a file before that")
    note = (Note(LEFT_OUT, f"left out: {counted(int(gone.sum()), 'block')} taken away or lost (array '{GONE}')"),)
    notes: tuple[str, ...] = note if gone.any() else ()
    offset, connectivity = np.asarray(grid.cell_offsets), np.asarray(grid.cell_connectivity)
    solid = np.isin(types, [*VTK_SOLIDS, POLYHEDRON])
    if solid.any():
        found: Layout | Bodies = _bodies_of_solids(grid, ~gone)
        points_of = np.split(connectivity, offset[1:-1])
        faces = np.isin(types, FACES)
        flat = [points_of[k] for k in np.flatnonzero(faces & ~gone)]
        notes += flat_beside([points_of[k] for k in np.flatnonzero(solid)], flat)
        notes += _unread(types[~gone & ~solid & ~faces])
        return replace(found, notes=(*found.notes, *notes))
    surface = np.flatnonzero(np.isin(types, list(VTK)) & ~gone)
    rings = []
    for cell in surface:
        nodes = connectivity[offset[cell] : offset[cell + 1]].astype(np.int64)
        rings.append(ring_of_nodes(nodes, VTK[int(types[cell])]))
    cell_data = _cell_data(grid, surface)
    found = layout_of_cells(np.asarray(grid.points, dtype=float), rings, cell_data, view)
    notes += _unread(types[~gone & ~np.isin(types, list(VTK))])
    return replace(found, notes=(*found.notes, *notes))


def _unread(types: np.ndarray) -> tuple[str, ...]:
    """Count in a note the cells of types that are not read, but for lines and points, which draw no block."""
    names = {int(kind): kind.name.lower().replace("_", " ") for kind in pyvista.CellType}
    counts = Counter(names.get(kind, f"type {kind}") for kind in types.tolist() if kind not in LINES)
    if not counts:
        return ()
    listed = ", ".join(f"{n} {kind}" for kind, n in counts.items())
    text = f"left out: {counted(counts.total(), 'cell')} of kinds that are not read ({listed})"
    return (Note(LEFT_OUT, f"{text}; save them as polygons or polyhedra"),)


def _cell_data(grid: Any, cells: np.ndarray) -> dict[str, np.ndarray]:
    """Give the arrays of these cells, by their numbers or a mask, by their names."""
    if not all(isinstance(key, str) for key in grid.cell_data):
        raise ValueError("it has a cell array whose name cannot be read; give it another name")
    return {key: np.asarray(grid.cell_data[key])[cells] for key in grid.cell_data}


def _gone(grid: Any) -> np.ndarray:
    """(n_cells,) bool array: cells of blocks that had left for good at the increment whose file this is."""
    if GONE not in grid.cell_data or "falls" not in grid.cell_data:
        return np.zeros(grid.n_cells, dtype=bool)
    return np.asarray(grid.cell_data[GONE]).reshape(grid.n_cells, -1)[:, 0] == 1


def _found_in_parts(data: Any, view: str | None) -> Layout | Bodies:
    """Read the parts of a multiblock; those that hold no blocks, such as centres and contact points, are left out."""
    flat: list[tuple[Layout | Bodies, str]] = []
    solid: list[tuple[Layout | Bodies, str]] = []
    left_out = []
    for k, part in enumerate(data):
        if part is None or (isinstance(part, pyvista.DataSet) and part.n_cells == 0):
            continue
        name = data.get_block_name(k) or ""
        name = "" if re.fullmatch(r"Block-\d+", name) else name
        if not _has_blocks(part):
            left_out.append(f"'{name or k}'")
            continue
        found = found_in_dataset(part, view)
        (solid if isinstance(found, Bodies) else flat).append((found, name))
    if solid and flat:
        # Flat cells beside bodies are faces in contact, as LMGC90 writes them.
        left_out += [f"'{name or 'a flat part'}'" for _, name in flat]
    chosen = solid or flat
    joined = merged([found for found, _ in chosen], [name for _, name in chosen])
    note = (Note(LEFT_OUT, f"left out: {', '.join(left_out)}, which draw no blocks"),) if left_out else ()
    return replace(joined, notes=(*joined.notes, *note))


def _has_blocks(part: Any) -> bool:
    if isinstance(part, pyvista.MultiBlock):
        return any(one is not None and _has_blocks(one) for one in part)
    types = np.asarray(part.cast_to_unstructured_grid().celltypes) if part.n_cells else np.zeros(0)
    return bool(np.isin(types, [*VTK, *VTK_SOLIDS, POLYHEDRON]).any())


def _as_cells(data: Any) -> pyvista.UnstructuredGrid:
    if not isinstance(data, pyvista.DataSet) or data.n_cells == 0:
        raise ValueError("it has no cells; save the blocks as polygons or a meshed surface")
    if isinstance(data, pyvista.UnstructuredGrid):
        return data
    return data.cast_to_unstructured_grid()


def _bodies_of_solids(grid: Any, stands: np.ndarray) -> Bodies:
    """Read the bodies of the cells with a volume that stand."""
    types = np.asarray(grid.celltypes)
    solid = np.flatnonzero(np.isin(types, [*VTK_SOLIDS, POLYHEDRON]) & stands)
    data = _cell_data(grid, solid)
    key, names, owner = owners(data, len(solid))
    how = f"one block per value of the cell array '{key}'"
    if key is None:
        how = "one block per piece that hangs together: no cell array 'block_id' says which are one"
        if (types[solid] == POLYHEDRON).all():
            owner, names = np.arange(len(solid)), [f"block {k}" for k in range(len(solid))]
            how = "one block per cell: no cell array 'block_id' says which are one"
    faceted = types[solid] == POLYHEDRON
    if faceted.any() and not faceted.all():
        raise ValueError("it has polyhedra beside other cells with a volume; write all blocks as polyhedra")
    find = _faceted_bodies if faceted.any() else _bodies_by_shape
    rows = rows_of_cells(data, owner, names)
    try:
        bodies = find(grid, np.asarray(grid.points, dtype=float), solid, owner, rows)
    except IndexError as error:
        raise ValueError(f"it has a damaged cell ({error}); export it again") from None
    return Bodies(bodies, notes=(how,))


def _bodies_by_shape(
    grid: Any, points: np.ndarray, solid: np.ndarray, owner: np.ndarray, rows: list[dict[str, Any]]
) -> list[Body]:
    """Find the bodies of cells whose faces follow from their type."""
    types = np.asarray(grid.celltypes)
    offset, connectivity = np.asarray(grid.cell_offsets), np.asarray(grid.cell_connectivity)
    if not _within(connectivity, len(points)):
        raise IndexError("it uses a point that does not exist")
    cells, owners = [], []
    for kind in np.unique(types[solid]).tolist():
        chosen = np.flatnonzero(types[solid] == kind)
        corners = 1 + max(corner for face in VTK_SOLIDS[kind] for corner in face)
        nodes = connectivity[offset[solid[chosen]][:, None] + np.arange(corners)]
        cells.append((VTK_SOLIDS[kind], nodes.astype(np.int64)))
        owners.append(owner[chosen])
    return bodies_of_cells(points, cells, np.concatenate(owners), rows)


def _faceted_bodies(
    grid: Any, points: np.ndarray, solid: np.ndarray, owner: np.ndarray, rows: list[dict[str, Any]]
) -> list[Body]:
    """Find the bodies of polyhedra, which list their faces."""

    def lists(array: Any) -> tuple[np.ndarray, np.ndarray]:
        return vtk_to_numpy(array.GetOffsetsArray()), vtk_to_numpy(array.GetConnectivityArray())

    if grid.GetPolyhedronFaces() is None or grid.GetPolyhedronFaceLocations() is None:
        raise IndexError("a polyhedron has no faces")
    corner_of, corners = lists(grid.GetPolyhedronFaces())
    face_of, faces = lists(grid.GetPolyhedronFaceLocations())
    if not (_within(corners, len(points)) and _within(faces, len(corner_of) - 1)):
        raise IndexError("a face of a polyhedron uses a point that does not exist")
    outside: list[dict[tuple[int, ...], list[int]]] = [{} for _ in rows]
    for cell, whose in zip(solid.tolist(), owner.tolist(), strict=True):
        for face in faces[face_of[cell] : face_of[cell + 1]].tolist():
            ring = corners[corner_of[face] : corner_of[face + 1]].tolist()
            key = tuple(sorted(ring))
            # A face that two cells of one body share is inside it.
            if outside[whose].pop(key, None) is None:
                outside[whose][key] = ring
    faces_of = ([*mine.values()] for mine in outside)
    return [body_of_polygons(row["name"], points, own, row) for row, own in zip(rows, faces_of, strict=True)]


def _within(numbers: np.ndarray, end: int) -> bool:
    return len(numbers) == 0 or bool(numbers.min() >= 0 and numbers.max() < end)


def dataset_of(layout: Layout) -> pyvista.UnstructuredGrid:
    """Make a dataset of a cell per block, polygon or polyhedron, with the cell arrays that the reader understands."""
    cells, start = list[int](), 0
    for block in layout.blocks:
        points, faces = block if isinstance(block, tuple) else (block, [])
        rings = [k for face in faces for k in (len(face), *(start + corner for corner in face))]
        stream = [len(faces), *rings] if faces else range(start, start + len(points))
        cells += [len(stream), *stream]
        start += len(points)
    flat = layout.dimension == 2
    places = np.column_stack([layout.points, np.zeros(start)]) if flat else layout.points
    types = np.full(layout.n_blocks, pyvista.CellType.POLYGON if flat else POLYHEDRON, dtype=np.uint8)
    grid = pyvista.UnstructuredGrid(np.array(cells), types, places)
    grid.cell_data["block_id"] = np.arange(layout.n_blocks, dtype=np.int32)
    rows = rows_of(layout)
    for key in ("name", "group", "role", "material"):
        words = [str(row.get(key, "")) for row in rows]
        if any(words):
            grid.GetCellData().AddArray(string_array(key, words))
    for key in ("thickness", "density"):
        if any(key in row for row in rows):
            grid.cell_data[key] = np.array([float(row.get(key, np.nan)) for row in rows])
    return grid


def write(layout: Layout, path: Path) -> None:
    """Write .vtu, .vtp or .vtk: a cell per block, polygon or polyhedron, double precision, lengths in m."""
    grid = dataset_of(layout)
    if path.suffix.lower() == ".vtp":
        _surface(grid).save(str(path))
    elif path.suffix.lower() == ".vtu":
        write_vtu(grid, path)
    else:
        grid.save(str(path))


def _surface(grid: Any) -> pyvista.PolyData:
    surface = pyvista.PolyData(np.asarray(grid.points), faces=np.asarray(grid.cells))
    for key in grid.cell_data:
        surface.GetCellData().AddArray(grid.GetCellData().GetAbstractArray(key))
    return surface
