"""Meshes with surface cells that meshio reads: Abaqus, Nastran, MED, Medit, XDMF, SU2 ..."""

from __future__ import annotations

import contextlib
import io
import re
from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from blockvis.layout.layout import Layout
from blockvis.layout.left_out import passed_over
from blockvis.layout.notes import LEFT_OUT, Note
from blockvis.text import listed

from .bodies import Bodies
from .cells import CELL_SET, flat_beside, layout_of_cells, owners, rows_of_cells
from .node_order import MESHIO, ring_of_nodes
from .reading import Reading
from .volumes import MESHIO_SOLIDS, Faces, bodies_of_cells


@dataclass(frozen=True)
class _Card:
    """A card of an .inp file."""

    word: str
    parameters: str
    data: str

    @property
    def set_name(self) -> str:
        """Name of its set of cells, "" for none."""
        found = re.search(r"(?i)\belset\s*=\s*\"?([^,\"]+)", self.parameters)
        return found[1].strip() if found else ""

    @property
    def rows(self) -> list[list[str]]:
        """Members of a set, line by line: "Part-1-1.Stone 1" names that of an instance."""
        lines = (line.split(",") for line in self.data.splitlines() if line.strip())
        rows = ([word.strip().rpartition(".")[2].strip('"').upper() for word in line] for line in lines)
        return [[word for word in row if word] for row in rows]


def read(path: Path, reading: Reading) -> Layout | Bodies:
    """Read a mesh through meshio; it states no unit."""
    _check_text(path)
    suffix = path.suffix.lower()
    cards = _abaqus_cards(path) if suffix == ".inp" else []
    strange = passed_over(_strange_members(cards), "members of sets that are neither a cell nor a set before it")
    mesh, sets = _read_mesh(path, suffix, cards)
    if suffix == ".f3grid":
        mesh.cell_sets = _groups(mesh)
    points = np.asarray(mesh.points, dtype=float)
    sets = sets or _sets_of_mesh(mesh) or (_element_blocks(mesh) if suffix in (".e", ".ex2", ".exo") else {})
    solid = [(k, shape) for k, block in enumerate(mesh.cells) if (shape := _shape(block.type))]
    if solid:
        chosen = [(k, len(mesh.cells[k].data)) for k, _ in solid]
        cells = [(shape, np.asarray(mesh.cells[k].data, dtype=np.int64)) for k, shape in solid]
        data, notes = _cell_data(mesh, chosen, sets)
        bodies = _bodies(points, cells, data)
        flat = [cell for block in mesh.cells if block.type in MESHIO for cell in block.data]
        notes += flat_beside([nodes for _, nodes in cells], flat)
        return replace(bodies, notes=(*bodies.notes, *notes, *strange))
    rings: list[np.ndarray] = []
    chosen = []
    for k, block in enumerate(mesh.cells):
        kind = "polygon" if block.type.startswith("polygon") else block.type
        if kind not in MESHIO:
            continue
        rings += [ring_of_nodes(np.asarray(cell, dtype=np.int64), MESHIO[kind]) for cell in block.data]
        chosen.append((k, len(block.data)))
    data, notes = _cell_data(mesh, chosen, sets)
    found = layout_of_cells(points, rings, data, reading.view)
    return replace(found, notes=(*found.notes, *notes, *strange))


def _read_mesh(path: Path, suffix: str, cards: Sequence[_Card]) -> tuple[Any, dict[str, np.ndarray]]:
    """Have meshio read a file, of an .inp what meshio does not mix up; gives the sets of cells of that, too."""
    import meshio

    said = io.StringIO()
    try:
        # meshio prints to the terminal, and raises SystemExit for some files.
        with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
            if suffix in (".tec", ".dat"):
                mesh = meshio.read(_EndingText(path.read_text(encoding="utf-8", errors="replace")), "tecplot")
            elif cards:
                mesh = meshio.read(io.StringIO(_mesh_alone(cards)), "abaqus")
            elif suffix == ".mdpa":
                with _EndingFile(io.FileIO(path)) as file:
                    mesh = meshio.read(file, "mdpa")
            elif suffix in (".bdf", ".fem", ".nas"):
                # gmsh leaves out the first line, for which meshio waits.
                text = path.read_text(errors="replace")
                first = "" if "BEGIN BULK" in text else "BEGIN BULK\n"
                mesh = meshio.read(_EndingText(f"{first}{text}"), "nastran")
            else:
                mesh = meshio.read(path)
            return mesh, _abaqus_sets(cards, mesh.cells) if cards else {}
    except (SystemExit, Exception) as error:  # noqa: BLE001
        if isinstance(error, ModuleNotFoundError):
            raise ValueError(f"it needs the package {error.name}: pip install {error.name}") from None
        words = said.getvalue() if isinstance(error, SystemExit) else str(error)
        name = type(error).__name__
        reason = " ".join((f"{name} {words}" if isinstance(error, LookupError) else words or name).split())
        raise ValueError(
            f"it cannot be read by meshio as {path.suffix}: {reason[:300]}; export it again, with straight cells "
            "(order 1), or as .msh or .vtu"
        ) from None


def _groups(mesh: Any) -> dict[str, list[np.ndarray]]:
    """Take the groups of FLAC3D, which meshio calls "zone:NAME:SLOT", with numbers of cells in each block of cells."""
    # It numbers them through all blocks of cells.
    starts = _starts(mesh.cells)
    return {
        re.sub(r"^(zone|face):(.*):[^:]*$", r"\2", name): [
            part - start for part, start in zip(parts, starts[:-1], strict=True)
        ]
        for name, parts in mesh.cell_sets.items()
    }


def _shape(kind: str) -> Faces | None:
    """Faces of meshio's type of cell; None for one without a volume."""
    return MESHIO_SOLIDS.get(kind.rstrip("0123456789"))


def _cell_data(
    mesh: Any, chosen: list[tuple[int, int]], sets: Mapping[str, np.ndarray]
) -> tuple[dict[str, np.ndarray], tuple[str, ...]]:
    """Cell arrays of the chosen blocks of cells, given by number and count, and notes on sets that are none of them."""
    data: dict[str, np.ndarray] = {}
    for key, arrays in mesh.cell_data.items():
        data[key] = np.concatenate([np.asarray(arrays[k]) for k, _ in chosen]) if chosen else np.zeros(0)
    if "block_id" in data:
        return data, ()
    starts, total = _starts(mesh.cells), sum(n for _, n in chosen)
    position, end = np.full(starts[-1], -1), 0
    for k, n in chosen:
        position[starts[k] : starts[k + 1]] = np.arange(end, end + n)
        end += n
    members = {name: np.unique(position[index]) for name, index in sets.items()}
    of_sets, notes = _arrays_of_sets({name: index[index >= 0] for name, index in members.items()}, total)
    return data | of_sets, notes


def _starts(cells: Sequence[Any]) -> np.ndarray:
    """(n + 1,) int array: number of the first cell of each block of cells, and of all cells."""
    return np.cumsum([0, *(len(block.data) for block in cells)])


def _bodies(points: np.ndarray, cells: list[tuple[Faces, np.ndarray]], data: dict[str, np.ndarray]) -> Bodies:
    key, numbered, owner = owners(data, sum(len(nodes) for _, nodes in cells))
    bodies = bodies_of_cells(points, cells, owner, rows_of_cells(data, owner, numbered))
    how = f"one block per value of the cell array '{key}'" if key else "one block per piece that hangs together"
    return Bodies(bodies, notes=(how,))


class _Ending:
    """Raises an error where a file is read far beyond its end, as meshio's readers do that wait for a line."""

    ends = 0

    def readline(self, size: int | None = -1, /) -> Any:
        """Read the next line."""
        line = super().readline(-1 if size is None else size)  # type: ignore[misc]
        self.ends = 0 if line else self.ends + 1
        if self.ends > 100:
            raise EOFError("the file ends too early")
        return line


class _EndingText(_Ending, io.StringIO):
    """A text that raises an error beyond its end."""


class _EndingFile(_Ending, io.BufferedReader):
    """A file that raises an error beyond its end."""


def _check_text(path: Path) -> None:
    """Refuse names of files outside the folder, and counts that the file is too short for."""
    suffix = path.suffix.lower()
    if suffix in (".inp", ".xdmf", ".xmf"):
        text = path.read_text(encoding="utf-8", errors="replace")
        named = re.findall(r"(?im)^\s*\*\s*include\s*,.*?input\s*=\s*([^,\r\n]+)", text)
        named += re.findall(r"(?i)<DataItem[^>]*Format\s*=\s*[\"'](?:HDF|Binary)[\"'][^>]*>\s*([^<:]+)", text)
        for name in (name.strip().strip("\"'") for name in named):
            if Path(name).is_absolute() or not (path.parent / name).resolve().is_relative_to(path.parent.resolve()):
                raise ValueError(f"it names '{name}', which is outside its folder; keep the files together")
    if suffix in (".tec", ".dat"):
        size = path.stat().st_size
        with path.open("rb") as stream:
            head = stream.read(1_000_000)
        for match in re.finditer(rb"(?i)\b(N|E|I|J|K|NODES|ELEMENTS)\s*=\s*(\d+)", head):
            if int(match[2][:18]) > size:
                raise ValueError(f"it announces {match[0].decode()} in {size} bytes; export it again")


def _sets_of_mesh(mesh: Any) -> dict[str, np.ndarray]:
    """Numbers of the cells of each named set, and group of MED, counted through all blocks of cells."""
    sets, starts = {}, _starts(mesh.cells)
    for name, parts in mesh.cell_sets.items():
        members = [starts[k] + np.asarray(part, dtype=np.int64) for k, part in enumerate(parts) if part is not None]
        sets[str(name)] = np.concatenate([np.zeros(0, dtype=np.int64), *members])
    families = getattr(mesh, "cell_tags", None) or {}
    if families and "cell_tags" in mesh.cell_data:
        own = np.concatenate(mesh.cell_data["cell_tags"])
        for name in dict.fromkeys(name for names in families.values() for name in names):
            sets[str(name)] = np.flatnonzero(np.isin(own, [tag for tag, names in families.items() if name in names]))
    return sets


def _element_blocks(mesh: Any) -> dict[str, np.ndarray]:
    """Numbers of the cells of each element block of Exodus; none where these tell kinds of cells apart, not stones."""
    kinds, starts = [block.type for block in mesh.cells], _starts(mesh.cells)
    several = len(set(kinds)) < len(kinds)
    return {f"block {k + 1}": np.arange(starts[k], starts[k + 1]) for k in range(len(kinds)) if several}


def _arrays_of_sets(sets: Mapping[str, np.ndarray], total: int) -> tuple[dict[str, np.ndarray], tuple[str, ...]]:
    """Cell arrays of blocks from named sets (Abaqus ELSET, XDMF sets), and a note on those that are not used.

    The smallest sets that hold every cell once are the blocks, and sets of several blocks their groups.
    """
    names_of: dict[bytes, list[str]] = {}
    for name, index in sets.items():
        if len(index):
            names_of.setdefault(index.tobytes(), []).append(name)
    distinct = [(names[0], sets[names[0]]) for names in names_of.values()]
    by_size = sorted(distinct, key=lambda one: len(one[1]))
    if not by_size:
        return {}, ()
    # Sets of cells at a loaded or supported face are parts of blocks: beside them the largest hold every cell once.
    blocks = _dividing(by_size, total) or _dividing(by_size[::-1], total)
    if not blocks:
        unused = f"the cell sets {listed(_names(by_size))} were not used: no choice of them holds every cell once"
        return {}, (Note(LEFT_OUT, unused),)
    names, indices = zip(*blocks, strict=True)
    owner = np.zeros(total, dtype=np.int64)
    for k, index in enumerate(indices):
        owner[index] = k
    groups, cutting = [(*names_of[index.tobytes()], "")[1] for index in indices], []
    for name, index in by_size:
        within, counts = np.unique(owner[index], return_counts=True)
        if (counts < np.bincount(owner)[within]).any():
            cutting.append((name, index))
        elif 1 < len(within) < len(blocks):
            groups = [group or (name if k in within else "") for k, group in enumerate(groups)]
    unused = f"the cell sets {listed(_names(cutting))} were not used: they cut blocks"
    notes = (Note(LEFT_OUT, unused),) if cutting else ()
    return {CELL_SET: owner, "name": np.array(names)[owner], "group": np.array(groups)[owner]}, notes


def _dividing(sets: Sequence[tuple[str, np.ndarray]], total: int) -> list[tuple[str, np.ndarray]]:
    """Take each set that shares no cell with those before; none unless they hold all cells."""
    free, taken = np.full(total, True), []
    for name, index in sets:
        if free[index].all():
            free[index] = False
            taken.append((name, index))
    return [] if free.any() else sorted(taken, key=lambda one: int(one[1][0]))


def _names(sets: Sequence[tuple[str, np.ndarray]]) -> list[str]:
    return [f"'{name}'" for name, _ in sets]


def _abaqus_cards(path: Path) -> list[_Card]:
    """Read the cards of an .inp file without comments; none where it includes others."""
    text = re.sub(r"(?m)^\*\*.*\n?", "", path.read_text(encoding="utf-8", errors="replace"))
    cards = []
    for card in re.split(r"(?m)^[ \t]*\*", text)[1:]:
        head, _, data = card.partition("\n")
        word, _, parameters = head.partition(",")
        cards.append(_Card(word.strip().upper(), parameters, data.rstrip()))
    nodes = [number for one in cards if one.word == "NODE" for number in re.findall(r"(?m)^\s*(\d+)", one.data)]
    words = [one.word for one in cards]
    moved = any(one.word in ("INSTANCE", "SYSTEM") and one.data for one in cards)
    if moved or words.count("INSTANCE") > 1 or len(set(nodes)) < len(nodes):
        raise ValueError(
            "it is written in parts with nodes of their own, or in a moved system; one list of nodes is read: "
            "in Abaqus/CAE Model, Edit Attributes, 'Do not use parts and assemblies in input files'"
        )
    return [] if "INCLUDE" in words else cards


def _strange_members(cards: Sequence[_Card]) -> Counter[str]:
    """Count members of sets of cells that are neither a cell nor a set before it."""
    known: set[str] = set()
    strange: Counter[str] = Counter()
    for card in cards:
        name = card.set_name
        if card.word == "ELSET":
            members = [one for one in chain(*card.rows) if not one.isdigit() and one not in known]
            strange.update(f"'{one}' in '{name}'" for one in members)
        if card.word in ("ELEMENT", "ELSET"):
            known.add(name.upper())
    return strange


def _mesh_alone(cards: Sequence[_Card]) -> str:
    """Text of the nodes and cells of an .inp file; of several lists of nodes meshio keeps the last."""
    nodes = [card.data for card in cards if card.word == "NODE"]
    cells = [f"*ELEMENT,{card.parameters}\n{card.data}" for card in cards if card.word == "ELEMENT"]
    return "\n".join(["*NODE", *nodes, *cells, ""])


def _abaqus_sets(cards: Sequence[_Card], blocks: Sequence[Any]) -> dict[str, np.ndarray]:
    """Numbers of the cells of each ELSET; meshio mixes up those of several blocks of cells and those of other sets.

    The name of ``*ELSET`` is that of the same cells: programs number those of ``*ELEMENT``. Small and capital letters
    are the same to Abaqus; the first writing of a name is kept.
    """
    named = [card for card in cards if card.word in ("ELEMENT", "ELSET")]
    written = {card.set_name.upper(): card.set_name for card in reversed(named)}
    elements, elsets = ([card for card in named if card.word == word] for word in ("ELEMENT", "ELSET"))
    numbers, parts = list[np.ndarray](), defaultdict[str, list[np.ndarray]](list)
    for card, block in zip(elements, blocks, strict=True):
        cells = np.fromstring(card.data.replace(",", " "), dtype=np.int64, sep=" ")
        numbers.append(cells[:: max(1, len(cells) // max(1, len(block.data)))])
        parts[card.set_name.upper()].append(numbers[-1])
    every = np.concatenate([*numbers, np.zeros(0, dtype=np.int64)])
    for card in elsets:
        parts[card.set_name.upper()] += _parts_of(card, every, parts)
    own = dict.fromkeys(card.set_name.upper() for card in elsets if card.set_name)
    keys = dict.fromkeys([*own, *filter(None, parts)])
    found = {key: np.flatnonzero(np.isin(every, np.concatenate(parts[key]))) for key in keys}
    named_twice = {found[key].tobytes() for key in own}
    return {written[key]: index for key, index in found.items() if key in own or index.tobytes() not in named_twice}


def _parts_of(card: _Card, every: np.ndarray, known: Mapping[str, list[np.ndarray]]) -> list[np.ndarray]:
    """Numbers of the cells of an ELSET, in parts: of ranges, by themselves, or those of sets that are known."""
    if re.search(r"(?i)\bgenerate\b", card.parameters):
        ranges = [(int(row[0]), int(row[1]), int(row[2]) if len(row) > 2 else 1) for row in card.rows]
        return [every[(every >= a) & (every <= b) & ((every - a) % step == 0)] for a, b, step in ranges]
    words = [*chain(*card.rows)]
    own = np.array([one for one in words if one.isdigit()], dtype=np.int64)
    return [own, *(part for one in words for part in known.get(one, ()))]
