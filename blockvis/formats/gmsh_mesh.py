"""Meshes of gmsh, .msh 2.2 and 4.1, ASCII and binary: one surface or volume entity is one block.

This reader replaces that of meshio, which keeps one of two physical groups of an entity, one of two groups of the same
name in different dimensions, and reserves whatever memory the file asks for. It follows the description of the format, https://gmsh.info/doc/texinfo/gmsh.html#MSH-file-format.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from blockvis.layout.block_table import layers_of, rows_of, with_rows
from blockvis.layout.layout import Layout
from blockvis.layout.left_out import LeftOut
from blockvis.layout.outlines import flattened, is_flat, outlines_of_cells
from blockvis.layout.triangulation import cells_of_ring
from blockvis.text import numbered
from solver.mechanics import counted

from .bodies import Bodies
from .closed_surfaces import bodies_of_surfaces
from .node_order import GMSH, ring_of_nodes
from .reading import Reading, json_object, naming
from .volumes import GMSH_SOLIDS, Faces, bodies_of_cells

#: Number of nodes of each element type.
N_NODES = {
    1: 2, 2: 3, 3: 4, 4: 4, 5: 8, 6: 6, 7: 5, 8: 3, 9: 6, 10: 9, 11: 10, 12: 27, 13: 18, 14: 14, 15: 1, 16: 8, 17: 20,
    18: 15, 19: 13, 20: 9, 21: 10, 22: 12, 23: 15, 24: 15, 25: 21, 26: 4, 27: 5, 28: 6, 29: 20, 30: 35, 31: 56, 36: 16,
    37: 25, 38: 36, 39: 12, 40: 16, 41: 20, 92: 64, 93: 125,
}  # fmt: skip

#: Our own section with the block table, which physical groups cannot hold; other programs skip it.
TABLE = "BlockvisBlocks"


@dataclass
class _Mesh:
    """Content of the sections of a file; of elements only those of surfaces and volumes.

    Numbers of nodes are in order, with their places among the coordinates. Groups are those of an entity by its
    dimension and number, parents the numbers of the entities that were partitioned by those of their parts. Cells of
    volumes are kept by their shape, with the number of the volume of each.
    """

    nodes: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    places: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    coordinates: np.ndarray = field(default_factory=lambda: np.zeros((0, 3)))
    group_names: dict[tuple[int, int], str] = field(default_factory=dict)
    groups: dict[tuple[int, int], list[int]] = field(default_factory=dict)
    parents: dict[tuple[int, int], int] = field(default_factory=dict)
    rings: list[np.ndarray] = field(default_factory=list)
    surfaces: list[np.ndarray] = field(default_factory=list)
    solids: list[tuple[Faces, np.ndarray]] = field(default_factory=list)
    volumes: list[np.ndarray] = field(default_factory=list)
    other_elements: int = 0


class _Numbers:
    """The numbers of a section, ASCII or binary, read one after another."""

    def __init__(self, body: bytes, section: str, binary: bool, order: str, wide: str) -> None:
        self.section, self.binary = section, binary
        self.types = {"int": np.dtype(f"{order}i4"), "size": np.dtype(wide), "double": np.dtype(f"{order}f8")}
        self.body: bytes | list[bytes] = body if binary else body.split()
        self.position = 0

    def take(self, kind: str, n: int) -> np.ndarray:
        """Read n numbers of kind "int", "size" or "double" as a (n,) array."""
        dtype = self.types[kind]
        width = dtype.itemsize if self.binary else 1
        # A count is checked against the length of the file before memory is reserved for it.
        if n < 0 or self.position + n * width > len(self.body):
            raise ValueError(
                f"it is cut off: its section ${self.section} announces {n} more numbers and holds "
                f"{max(0, (len(self.body) - self.position) // width)}; export it again"
            )
        part = self.body[self.position : self.position + n * width]
        self.position += n * width
        if isinstance(part, bytes):
            return np.frombuffer(part, dtype).astype(float if kind == "double" else np.int64)
        try:
            return np.array(part, dtype=float if kind == "double" else np.int64)
        except (ValueError, OverflowError):
            raise ValueError(
                f"its section ${self.section} holds something that is not a number near "
                f"{b' '.join(part[:8])!r}; export it again"
            ) from None

    def one(self, kind: str) -> int:
        """Read the next whole number."""
        return int(self.take(kind, 1)[0])

    def line(self) -> int:
        """Read the next whole number of a count that is text even in a binary section."""
        if not isinstance(self.body, bytes):
            return self.one("size")
        end = self.body.find(b"\n", self.position)
        text = self.body[self.position : end]
        if end < 0 or not text.strip().isdigit():
            raise ValueError(f"its section ${self.section} has no count; export it again")
        self.position = end + 1
        return int(text)


def read(path: Path, reading: Reading) -> Layout | Bodies:
    """Read a .msh file, which states no unit."""
    return layout_of_mesh(path.read_bytes(), reading)


def layout_of_mesh(data: bytes, reading: Reading) -> Layout | Bodies:
    """Read the content of a .msh file."""
    mesh, table = _sections(data)
    if mesh.solids:
        return _bodies(mesh)
    if not mesh.rings:
        rest = f" of its {mesh.other_elements} elements" if mesh.other_elements else ""
        raise ValueError(
            f"it has no surface cells: none{rest} is a triangle or quadrangle; "
            "mesh the surfaces (gmsh -2) and save them (a surface in no physical group is left out of the file)"
        )
    surface = np.concatenate(mesh.surfaces)
    tags, owner = np.unique(surface, return_inverse=True)
    rings = [ring for block in mesh.rings for ring in block]
    groups = _group_names(mesh, 2, tags)
    if not is_flat(mesh.coordinates):
        return _enclosed(mesh, rings, [groups[k] for k in owner], reading)
    names = _entity_names(groups, tags, "surface")
    flat, note = flattened(mesh.coordinates, reading.view)
    unusable: dict[int, LeftOut] = {}
    outlines = outlines_of_cells(flat, rings, owner, names, unusable)
    notes = _notes(groups, "surface") + ([note] if note else [])
    layout = Layout(tuple(outlines), tuple(names), tuple(groups), materials=tuple(groups), unit="", notes=tuple(notes))
    rows = [table.get(str(tag)) for tag in tags]
    if all(isinstance(row, dict) for row in rows):
        layout = with_rows(layout, rows, own=True)
    return layout.leaving_out(unusable)


def _enclosed(mesh: _Mesh, rings: list[np.ndarray], groups: list[str], reading: Reading) -> Bodies:
    """Find the bodies that surfaces in space enclose: those of each physical group, or else of all together."""
    named, owner = np.unique(groups, return_inverse=True)
    rows = [{"name": str(name) or "body", **(_said(str(name)) if len(named) > 1 else {})} for name in named]
    try:
        bodies, notes = bodies_of_surfaces(mesh.coordinates, rings, owner, rows, reading)
    except ValueError:
        bodies, notes = bodies_of_surfaces(mesh.coordinates, rings, np.zeros_like(owner), [{"name": "body"}])
    return Bodies(bodies, notes=("one block per closed surface", *notes))


def _said(group: str) -> dict[str, str]:
    """Say what a physical group, "" for none, says of a block."""
    return {"group": group, "material": group} if group else {}


def holds_flat_blocks(path: Path) -> bool:
    """Whether a .msh file has surface cells in a plane and none with a volume."""
    with naming(f"'{path}'"):
        mesh, _ = _sections(path.read_bytes())
    return bool(mesh.rings) and not mesh.solids and is_flat(mesh.coordinates)


def _bodies(mesh: _Mesh) -> Bodies:
    """Find the bodies of a mesh of volumes; surface cells beside them are their skin."""
    tags, owner = np.unique(np.concatenate(mesh.volumes), return_inverse=True)
    groups = _group_names(mesh, 3, tags)
    rows = [
        {"name": name, **_said(group)}
        for name, group in zip(_entity_names(groups, tags, "volume"), groups, strict=True)
    ]
    bodies = bodies_of_cells(mesh.coordinates, mesh.solids, owner, rows)
    notes = _notes(groups, "volume")
    if len(bodies) > len(tags):
        notes[0] = f"{len(bodies)} bodies, the pieces of {counted(len(tags), 'meshed volume')}"
    return Bodies(bodies, notes=notes)


def _notes(groups: list[str], kind: str) -> list[str]:
    """Say where blocks come from, and how many entities of a kind are in no physical group."""
    notes = [f"one block per meshed {kind}; a {kind} in no physical group may be missing from the file"]
    if "" in groups:
        notes.append(f"in no physical group: {groups.count('')} of {counted(len(groups), kind)}")
    return notes


def _group_names(mesh: _Mesh, dimension: int, tags: np.ndarray) -> list[str]:
    """Name the physical group of each entity, "" for none; one entity may be in one group only."""
    named = []
    for tag in tags.tolist():
        groups = sorted(set(mesh.groups.get((dimension, tag), [])))
        if len(groups) > 1:
            listed = " and ".join(f"'{mesh.group_names.get((dimension, g), str(g))}'" for g in groups)
            kind = "surface" if dimension == 2 else "volume"
            raise ValueError(f"{kind} {tag} is in {len(groups)} physical groups, {listed}; keep it in one of them")
        named.append(mesh.group_names.get((dimension, groups[0]), f"group {groups[0]}") if groups else "")
    return named


def _entity_names(groups: list[str], tags: np.ndarray, kind: str) -> list[str]:
    return [name if group else f"{kind} {tag}" for name, group, tag in zip(numbered(groups), groups, tags, strict=True)]


def _sections(data: bytes) -> tuple[_Mesh, dict[str, dict[str, object]]]:
    head, _, rest = (_section(data, "MeshFormat") or b"").partition(b"\n")
    words = head.split()
    if len(words) < 3:
        raise ValueError("it is not a gmsh mesh: it has no section $MeshFormat; export it as .msh 4.1 or 2.2")
    version, binary, width = words[0].decode("ascii", "replace"), words[1] == b"1", words[2]
    if version not in ("2", "2.1", "2.2", "4.1"):
        raise ValueError(
            f"it is version {version} of .msh; versions 2 and 4.1 are read: gmsh old.msh -save -format msh41 -o new.msh"
        )
    order = ">" if binary and rest[:4] != b"\x01\x00\x00\x00" else "<"
    # Sizes are read as signed numbers: no count of a real file reaches the sign bit, and a hostile one cannot wrap.
    wide = f"{order}i{8 if width == b'8' else 4}"
    mesh = _Mesh()

    def numbers(section: str) -> _Numbers | None:
        body = _section(data, section)
        return None if body is None else _Numbers(body, section, binary, order, wide)

    names = _section(data, "PhysicalNames")
    for line in (names or b"").decode("utf-8", "replace").splitlines():
        parts = line.strip().split(None, 2)
        if len(parts) == 3 and parts[0].isdigit() and parts[1].lstrip("-").isdigit():
            mesh.group_names[int(parts[0]), int(parts[1])] = parts[2].strip().strip('"')
    nodes, elements = numbers("Nodes"), numbers("Elements")
    if nodes is None or elements is None:
        missing = "Nodes" if nodes is None else "Elements"
        raise ValueError(f"it has no section ${missing}; mesh the surfaces (gmsh -2) and export again")
    if version == "4.1":
        for section in ("Entities", "PartitionedEntities"):
            _entities_41(numbers(section), mesh)
        _nodes_41(nodes, mesh)
        _elements_41(elements, mesh)
    else:
        _nodes_22(nodes, mesh)
        _elements_22(elements, mesh)
    return mesh, json_object(_section(data, TABLE) or b"")


def _section(data: bytes, name: str) -> bytes | None:
    start = data.find(f"${name}".encode())
    if start < 0:
        return None
    start = data.find(b"\n", start) + 1
    stop = data.find(f"$End{name}".encode(), start)
    return data[start : stop if stop >= 0 else len(data)]


def _entities_41(numbers: _Numbers | None, mesh: _Mesh) -> None:
    if numbers is None:
        return
    partitioned = numbers.section == "PartitionedEntities"
    if partitioned:
        # How many partitions there are, and cells that some of them have from others.
        numbers.one("size")
        numbers.take("int", 2 * numbers.one("size"))
    counts = numbers.take("size", 4)
    for dimension in range(4):
        for _ in range(counts[dimension]):
            tag = numbers.one("int")
            if partitioned:
                of, parent = numbers.take("int", 2).tolist()
                numbers.take("int", numbers.one("size"))
                if of == dimension:
                    mesh.parents[dimension, tag] = parent
            numbers.take("double", 3 if dimension == 0 else 6)
            groups = numbers.take("int", numbers.one("size"))
            if dimension:
                numbers.take("int", numbers.one("size"))
            whole = mesh.parents.get((dimension, tag), tag)
            mesh.groups[dimension, whole] = [int(abs(group)) for group in groups]


def _nodes_41(numbers: _Numbers, mesh: _Mesh) -> None:
    n_blocks = int(numbers.take("size", 4)[0])
    tags, parts = [mesh.nodes], [mesh.coordinates]
    for _ in range(n_blocks):
        dimension, _tag, parametric = numbers.take("int", 3)
        n = numbers.one("size")
        tags.append(numbers.take("size", n))
        width = 3 + (int(dimension) if parametric else 0)
        parts.append(numbers.take("double", n * width).reshape(n, width)[:, :3])
    _set_nodes(mesh, np.concatenate(tags), np.concatenate(parts))


def _nodes_22(numbers: _Numbers, mesh: _Mesh) -> None:
    n = numbers.line()
    if numbers.binary:
        record = np.dtype([("tag", numbers.types["int"]), ("x", numbers.types["double"], 3)])
        assert isinstance(numbers.body, bytes)
        if n * record.itemsize > len(numbers.body) - numbers.position:
            numbers.take("int", record.itemsize // 4 * n)
        found = np.frombuffer(numbers.body, record, n, numbers.position)
        _set_nodes(mesh, found["tag"].astype(np.int64), found["x"].astype(float))
    else:
        values = numbers.take("double", 4 * n).reshape(n, 4)
        _set_nodes(mesh, values[:, 0].astype(np.int64), values[:, 1:])


def _set_nodes(mesh: _Mesh, tags: np.ndarray, coordinates: np.ndarray) -> None:
    mesh.coordinates = coordinates
    mesh.nodes, mesh.places = np.unique(tags, return_index=True)
    if len(mesh.nodes) < len(tags):
        raise ValueError(f"it gives {len(tags)} nodes but {len(mesh.nodes)} different numbers to them; export it again")


def _elements_41(numbers: _Numbers, mesh: _Mesh) -> None:
    n_blocks = int(numbers.take("size", 4)[0])
    for _ in range(n_blocks):
        dimension, tag, kind = map(int, numbers.take("int", 3))
        tag = mesh.parents.get((dimension, tag), tag)
        n = numbers.one("size")
        width = _width(kind, numbers)
        values = numbers.take("size", n * (width + 1)).reshape(n, width + 1)[:, 1:]
        _add(mesh, dimension, kind, values, np.full(n, tag))


def _elements_22(numbers: _Numbers, mesh: _Mesh) -> None:
    n = numbers.line()
    remaining = n
    while remaining > 0:
        # As text each element has its number before its type; binary ones have it after the header of several.
        first, second, n_tags = map(int, numbers.take("int", 3))
        kind, follow = (first, second) if numbers.binary else (second, 1)
        if follow < 1 or n_tags < 0:
            raise ValueError(f"its section $Elements has a header of {follow} elements, {n_tags} tags; export it again")
        width = numbers.binary + n_tags + _width(kind, numbers)
        rows = numbers.take("int", follow * width).reshape(follow, width)[:, int(numbers.binary) :]
        remaining -= follow
        dimension = 2 if kind in GMSH else 3 if kind in GMSH_SOLIDS else 0
        if dimension == 0:
            mesh.other_elements += follow
            continue
        entity = rows[:, 1] if n_tags > 1 else np.zeros(follow, dtype=np.int64)
        for tag, group in zip(entity.tolist(), rows[:, 0].tolist() if n_tags else [0] * follow, strict=True):
            groups = mesh.groups.setdefault((dimension, tag), [])
            if group and group not in groups:
                groups.append(group)
        _add(mesh, dimension, kind, rows[:, n_tags:], entity)


def _width(kind: int, numbers: _Numbers) -> int:
    if kind not in N_NODES:
        raise ValueError(f"it has elements of gmsh's type {kind}, which is not known; mesh with order 2 at most")
    return N_NODES[kind]


def _add(mesh: _Mesh, dimension: int, kind: int, nodes: np.ndarray, tags: np.ndarray) -> None:
    if dimension == 2 and kind in GMSH:
        mesh.rings.append(_known(mesh, ring_of_nodes(nodes, GMSH[kind])))
        mesh.surfaces.append(tags)
    elif dimension == 3 and kind in GMSH_SOLIDS:
        mesh.solids.append((GMSH_SOLIDS[kind], _known(mesh, nodes)))
        mesh.volumes.append(tags)
    else:
        mesh.other_elements += len(nodes)


def _known(mesh: _Mesh, nodes: np.ndarray) -> np.ndarray:
    """Replace the numbers of nodes by their positions among the coordinates."""
    missing = nodes[~np.isin(nodes, mesh.nodes)]
    if len(missing):
        raise ValueError(f"an element uses node {missing[0]}, which the file lacks; export again")
    found: np.ndarray = mesh.places[np.searchsorted(mesh.nodes, nodes)]
    return found


def write(layout: Layout, path: Path) -> None:
    """Write .msh 4.1 ASCII: a surface per block, its corners as nodes, its group as physical group.

    The physical group of a block without a group is its role as a support, its material, or "blocks". A section of
    our own, which other programs skip, holds names, roles, materials, density and thickness.
    """
    groups = layers_of(layout, "blocks")
    number = {group: k + 1 for k, group in enumerate(dict.fromkeys(groups))}
    nodes, elements, entities = [], [], []
    n_nodes = n_elements = n_parts = 0
    for i, ring in enumerate(layout.outlines):
        low, high = ring.min(axis=0), ring.max(axis=0)
        box = " ".join(repr(float(x)) for x in (*low, 0.0, *high, 0.0))
        entities.append(f"{i + 1} {box} 1 {number[groups[i]]} 0")
        nodes.append(f"2 {i + 1} 0 {len(ring)}")
        nodes += [str(n_nodes + k + 1) for k in range(len(ring))]
        nodes += [f"{float(x)!r} {float(y)!r} 0" for x, y in ring]
        cells = cells_of_ring(ring)
        for kind, width in ((2, 3), (3, 4)):
            chosen = np.array([cell for cell in cells if len(cell) == width], dtype=int)
            if len(chosen):
                elements.append(f"2 {i + 1} {kind} {len(chosen)}")
                numbers = n_elements + 1 + np.arange(len(chosen))
                elements += [" ".join(map(str, row)) for row in np.column_stack([numbers, n_nodes + 1 + chosen])]
                n_parts, n_elements = n_parts + 1, n_elements + len(chosen)
        n_nodes += len(ring)
    lines = ["$MeshFormat", "4.1 0 8", "$EndMeshFormat"]
    lines += ["$PhysicalNames", str(len(number))]
    lines += [f'2 {k} "{group.replace(chr(34), chr(39))}"' for group, k in number.items()]
    lines += ["$EndPhysicalNames", "$Entities", f"0 0 {layout.n_blocks} 0", *entities, "$EndEntities"]
    lines += ["$Nodes", f"{layout.n_blocks} {n_nodes} 1 {n_nodes}", *nodes, "$EndNodes"]
    lines += ["$Elements", f"{n_parts} {n_elements} 1 {n_elements}", *elements, "$EndElements"]
    table = {str(i + 1): row for i, row in enumerate(rows_of(layout))}
    lines += [f"${TABLE}", json.dumps(table), f"$End{TABLE}", ""]
    path.write_text("\n".join(lines), encoding="utf-8")
