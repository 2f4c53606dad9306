"""What was observed: widths of cracks at places, displaced points, or a drawing of the damaged state."""

from __future__ import annotations

import csv
import io
import re
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from scipy.optimize import linear_sum_assignment

import solver
from blockvis.cases.block_at import blocks_called, distances_to
from blockvis.cases.profiles import pieces_named, uncut_names
from blockvis.cases.toml_table import Table, shortened
from blockvis.formats import FORMATS
from blockvis.formats.read import read_layout
from blockvis.results.joint_faces import corners_of, on_faces
from blockvis.results.joints import InitialJoints, initial_joints, opening_and_slip
from blockvis.text import files_like, listed, nearest, place_text
from solver.mechanics import counted

from .observation_keys import COLUMNS, LENGTHS, OBSERVATION

#: Uncertainty of a width, as a fraction of it, and the least [m], where the observations give none.
WIDTH_UNCERTAINTY, LEAST_UNCERTAINTY = 0.2, 2e-4

#: Uncertainty of a displaced point [m] where the observations give none.
POINT_UNCERTAINTY = 1e-3

#: A place farther than this from its joint or block, in block sizes, is a mistake in its coordinates or their unit, and
#: so is an uncertainty of more than this, in largest widths or displacements.
FARTHEST = 2.0

#: A point that is displaced by more than this fraction of the structure is a mistake in its unit.
FARTHEST_POINT = 0.3

#: A width [m] below this nobody can measure.
LEAST_WIDTH = 5e-5

#: Metres per unit of a column.
UNITS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3}

#: Distance from the middle of a joint, as a part of its length, within which a width is given at the middle.
NEAR_MIDDLE = 0.1

#: Rows of :class:`Observations`: place, named, whole, width, uncertainty and label; point, block, displacement and
#: uncertainty.
_Width = tuple[np.ndarray, bool, bool, float, float, str]
_Point = tuple[np.ndarray, str, np.ndarray, float]


@dataclass(frozen=True)
class Observations:
    """Widths of cracks, and displacements of points, where and how certain they are."""

    places: np.ndarray  #: (n, d) array [m]: of the widths, in the drawing.
    named: np.ndarray  #: (n,) bool array: whether the joint itself is known, not only a place.
    whole: np.ndarray  #: (n,) bool array: whether the width is the largest of a joint, not that at a place along it.
    #: (n,) arrays [m]; a width of 0 is a closed joint.
    widths: np.ndarray
    uncertainties: np.ndarray
    labels: tuple[str, ...]  #: Of the widths, in words.
    points: np.ndarray  #: (m, d) array [m]: of the displacements, in the drawing.
    blocks: tuple[str, ...]  #: On which the points lie.
    displacements: np.ndarray  #: (m, d) array [m].
    point_uncertainties: np.ndarray  #: (m,) array [m]: of each coordinate.
    source: str = ""

    @property
    def largest(self) -> float:
        """The largest width or displacement [m]."""
        moved = np.linalg.norm(self.displacements, axis=1)
        return float(max(self.widths.max(initial=0.0), moved.max(initial=0.0)))


def read_observations(
    source: str | Path | Sequence[Mapping[str, Any]], assembly: solver.Assembly, drawn: solver.Assembly | None = None
) -> Observations:
    """Read a table (.csv), its rows, or a drawing of the damaged state in any layout format.

    Where the ground of an assembly is cut, a name of a whole support is that of all its pieces, and a drawing of the
    damaged state is beside what was ``drawn``. Raises ``ValueError`` for a file, row or column that cannot be used;
    names the file, the line, the column and the remedy.
    """
    if not isinstance(source, str | Path):
        rows = [{str(key): value for key, value in row.items()} for row in source]
        header = list(dict.fromkeys(key for row in rows for key in row))
        return _of_rows(enumerate(rows, start=1), header, assembly, "observations", "row")
    path = Path(source)
    if not path.is_file():
        near = files_like(path, "*.csv", or_any=True)
        problem = f"'{path}' is a folder, no table" if path.is_dir() else f"there are no observations '{path}'"
        raise ValueError(
            problem + (f"; beside it are {', '.join(near)}" if near else "; give a table (.csv) or a drawing")
        )
    known = FORMATS.get(path.suffix.lower())
    if known is not None and not known.alone:
        return _of_drawing(path, assembly if drawn is None else drawn)
    text = _table_text(path)
    # Tables of some countries have a semicolon between columns, and a comma in their numbers.
    mark = max(",;\t", key=next(line for line in text.splitlines() if line.strip()).count)
    table = csv.reader(io.StringIO(text), delimiter=mark)
    header = [cell.strip() for cell in next(table)]
    return _of_rows(_numbered(table, header, path), header, assembly, str(path), "line")


def _table_text(path: Path) -> str:
    try:
        text = path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        raise ValueError(
            f"{path}: is no table in UTF-8 ({error.reason} at byte {error.start}), and '{path.suffix}' is no layout "
            "format; save it as CSV in UTF-8"
        ) from None
    if not text.strip():
        raise ValueError(f"{path}: is empty; its first line names the columns, for instance: joint,width [mm]")
    return text


def _numbered(table: Any, header: Sequence[str], path: Path) -> Iterator[tuple[int, dict[str, Any]]]:
    """Read the rows of a table with their lines, but empty ones and remarks."""
    for cells in table:
        if not any(cell.strip() for cell in cells) or cells[0].lstrip().startswith("#"):
            continue
        if table.dialect.delimiter != ",":
            cells = [re.sub(r"^(\s*[-+]?\d*),(\d+\s*)$", r"\1.\2", cell) for cell in cells]
        if any(cell.strip() for cell in cells[len(header) :]):
            raise ValueError(
                f"{path}, line {table.line_num}: has {counted(len(cells), 'cell')}, and the first line {len(header)}; "
                "where numbers have a decimal comma, put semicolons between the columns"
            )
        yield table.line_num, dict(zip(header, cells, strict=False))


@dataclass(frozen=True)
class _Column:
    """A column of the table: its name there, and metres per unit of what it holds."""

    name: str
    factor: float


def _columns(header: Sequence[str], where: str, axes: str) -> dict[str, _Column]:
    found: dict[str, _Column] = {}
    unused = []
    for name in header:
        match = re.match(r"^\s*(.*?)\s*(?:[\[(]\s*(\w+)\s*[\])])?\s*$", name)
        words, unit = (match.group(1), match.group(2)) if match else (name, None)
        key = re.sub(r"[\s-]+", "_", words.strip().lower())
        if key not in COLUMNS and unit is None and key.rpartition("_")[2] in UNITS:
            key, _, unit = key.rpartition("_")
        known = COLUMNS.get(key)
        if known is None:
            hint = nearest(key, list(COLUMNS))
            if hint:
                raise ValueError(f"{where}: column '{name}' is not known{hint}; rename or remove it")
            unused.append(name)
            continue
        if known in ("z", "dz", "displaced_z") and "z" not in axes:
            raise ValueError(f"{where}: column '{name}' is of structures in space, this one is in the plane; remove it")
        if known in found:
            raise ValueError(f"{where}: columns '{found[known].name}' and '{name}' hold the same; remove one")
        if unit is not None and (unit.lower() not in UNITS or known not in LENGTHS):
            raise ValueError(f"{where}: column '{name}' has the unit '{unit}'; lengths are in {', '.join(UNITS)}")
        found[known] = _Column(name, UNITS[unit.lower()] if unit else 1.0)
    if unused:
        warnings.warn(f"{where}: columns left out: {', '.join(unused)}", stacklevel=4)
    _check_columns(found, header, where, axes)
    return found


def _check_columns(found: Mapping[str, _Column], header: Sequence[str], where: str, axes: str) -> None:
    """Refuse a table in which a width or displacement, or its place, has no column."""
    where_given = "joint" in found or {"block_a", "block_b"} <= set(found) or set(axes) <= set(found)
    moved = any({f"{of}{axis}" for axis in axes} <= set(found) for of in ("d", "displaced_"))
    if not moved and "width" not in found:
        missing = "width"
    elif not moved and not where_given:
        missing = next((f"block_{k}" for k in "ab" if f"block_{'ba'[k == 'b']}" in found), "joint")
        if any(axis in found for axis in axes):
            missing = next(axis for axis in axes if axis not in found)
    elif not where_given and "block" not in found:
        missing = "block"
    else:
        return
    there = shortened(", ".join(header)) if any(header) else "none"
    raise ValueError(
        f"{where}: has no column '{missing}'; its columns are {there}. Give width and joint "
        f'("A | B"), block_a and block_b, or {_listed(axes)}; or block and {", ".join(f"d{axis}" for axis in axes)}; '
        "with units as in: width [mm]"
    )


def _listed(words: Sequence[str]) -> str:
    return f"{', '.join(words[:-1])} and {words[-1]}"


def _of_rows(
    rows: Iterator[tuple[int, dict[str, Any]]] | Any,
    header: Sequence[str],
    assembly: solver.Assembly,
    where: str,
    counted: str,
) -> Observations:
    columns = _columns(header, where, "xyz"[: assembly.dimension])
    joints = initial_joints(assembly)
    widths, points, given = list[_Width](), list[_Point](), list[_Cells]()
    first = dict[tuple[Any, ...], _Cells]()
    for number, row in rows:
        given.append(cells := _Cells(row, columns, f"{where}, {counted} {number}"))
        width = cells.length("width")
        if width is not None:
            place, joint, whole, label = _place(cells, assembly, joints)
            # Joints may meet at a place.
            _refuse_again(first, (joint, *place.tolist()), cells, "width", label, "width for each place")
            if width > assembly.block_size:
                raise cells.error(
                    "width",
                    f"is {width:g} m, more than a block is wide ({assembly.block_size:.3g} m); is it in mm? name the "
                    "column width [mm]",
                )
            uncertainty = cells.length("uncertainty")
            usual = max(WIDTH_UNCERTAINTY * width, LEAST_UNCERTAINTY)
            widths.append(
                (place, joint is not None, whole, width, usual if uncertainty is None else uncertainty, label)
            )
        moved = _displacement(cells, assembly)
        if moved is not None:
            point, block = moved[:2]
            key = "dx" if cells.length("displaced_x") is None else "displaced_x"
            label = f"'{block}' at {place_text(point)} m"
            _refuse_again(first, (block, *point.tolist()), cells, key, label, "displacement for each point")
            points.append(moved)
        if width is None and moved is None:
            raise cells.error("width", 'is missing; give a width, 0 or "closed", or a displacement')
    if not widths and not points:
        raise ValueError(f"{where}: has no observation; give a row for each crack or displaced point")
    found = _observations(widths, points, where, assembly.dimension)
    for cells in given:
        if (cells.length("uncertainty") or 0.0) > FARTHEST * found.largest:
            raise cells.error(
                "uncertainty",
                f"is {cells.length('uncertainty'):g} m, and the largest width or displacement {found.largest:.3g} m: "
                "that leaves nothing certain; is it in mm? name the column uncertainty [mm]",
            )
    _note_middles(found, joints)
    return found


def _refuse_again(
    first: dict[tuple[Any, ...], _Cells], of: tuple[Any, ...], cells: _Cells, key: str, label: str, what: str
) -> None:
    """Refuse a second reading of one place: readings share what the model errs by there, and no column tells dates."""
    before = first.setdefault(of, cells)
    if before is not cells:
        row = before.where.rpartition(", ")[2]
        raise cells.error(key, f"is of {label}, as that of {row} is; give one {what}, of one date")


def _observations(widths: Sequence[_Width], points: Sequence[_Point], where: str, d: int) -> Observations:
    places, named, whole, sizes, uncertainties, labels = zip(*widths, strict=True) if widths else ((),) * 6
    at, blocks, moved, point_uncertainties = zip(*points, strict=True) if points else ((),) * 4
    found = Observations(
        places=np.array(places, dtype=float).reshape(-1, d),
        named=np.array(named, dtype=bool),
        whole=np.array(whole, dtype=bool),
        widths=np.array(sizes, dtype=float),
        uncertainties=np.array(uncertainties, dtype=float),
        labels=labels,
        points=np.array(at, dtype=float).reshape(-1, d),
        blocks=blocks,
        displacements=np.array(moved, dtype=float).reshape(-1, d),
        point_uncertainties=np.array(point_uncertainties, dtype=float),
        source=where,
    )
    if found.largest == 0.0:
        raise ValueError(f"{where}: nothing has opened or moved; there is nothing to explain")
    return found


def _note_middles(found: Observations, joints: InitialJoints) -> None:
    """Warn of widths at the middles of joints: joints.csv has the largest ones, of the edge, beside the middle."""
    placed = np.flatnonzero(~found.whole & (found.widths > 0.0))
    if not len(placed):
        return
    places = found.places[placed]
    own = on_faces(places, joints)[0].argmin(axis=1)
    extent = joints.sizes[own] ** (1.0 / (places.shape[1] - 1))
    from_middle = np.linalg.norm(places - joints.rings.middles()[own], axis=1)
    n = int((from_middle < NEAR_MIDDLE * extent).sum())
    if n > 1 and 2 * n >= len(placed):
        warnings.warn(
            f"{found.source}: {n} of {len(placed)} widths are given at the middle of a joint and are taken as those "
            "there, half of what a joint that gapes to one side has at its edge; where they are the largest ones, name "
            "the joint instead (columns joint, width) or give the place of the edge",
            stacklevel=5,
        )


class _Cells(Table):
    """The cells of a row that are filled, checked by the table of columns."""

    def __init__(self, row: Mapping[str, Any], columns: Mapping[str, _Column], where: str) -> None:
        self.columns = columns
        given = {key: row.get(column.name) for key, column in columns.items()}
        # Tables that programs make have nan where a cell is empty.
        texts = {key: str(value).strip() for key, value in given.items() if value is not None and value == value}
        cells: dict[str, Any] = {key: text for key, text in texts.items() if text}
        for key in cells.keys() & set(LENGTHS):
            # What is no number is refused by its name.
            with suppress(ValueError):
                cells[key] = float(cells[key])
        super().__init__(cells, where, Path())
        self.checked = OBSERVATION.read(self)

    def error(self, key: str, problem: str) -> ValueError:
        """Make an error that names the file, the line and the column."""
        name = self.columns[key].name if key in self.columns else key
        return ValueError(f"{self.where}: {name} {problem}")

    def word(self, key: str) -> str:
        """Text of a cell; empty where there is none."""
        return self.checked[key] or ""

    def length(self, key: str) -> float | None:
        """Length [m] in a cell; None where it is empty."""
        value: float | None = self.checked[key]
        return None if value is None else value * self.columns[key].factor


def _between(
    names: Sequence[str], keys: Sequence[str], cells: _Cells, assembly: solver.Assembly, joints: InitialJoints
) -> np.ndarray:
    """(n_joints,) bool array: the joints between two blocks, which must touch."""
    one, other = (_blocks(name, key, cells, assembly) for name, key in zip(names, keys, strict=True))
    first_a, first_b = np.isin(joints.block_a, one), np.isin(joints.block_b, one)
    between = (first_a & np.isin(joints.block_b, other)) | (first_b & np.isin(joints.block_a, other))
    if not between.any():
        beside = np.unique(np.concatenate([joints.block_b[first_a], joints.block_a[first_b]]))
        others = ", ".join(f"'{assembly.names[k]}'" for k in beside) or "no block"
        raise cells.error(
            keys[1], f"names '{names[0]}' and '{names[1]}', which do not touch; '{names[0]}' touches {others}"
        )
    return between


def _place(cells: _Cells, assembly: solver.Assembly, joints: InitialJoints) -> tuple[np.ndarray, int | None, bool, str]:
    """Find the place (d,) [m] of a width: somewhere in the joint between two blocks, or at its coordinates.

    The joint if it is known, whether the place along it is not, and a label go with it.
    """
    axes = "xyz"[: assembly.dimension]
    if cells.word("joint"):
        names = [name.strip() for name in re.split(r"\s*\|\s*", cells.word("joint"))]
        if len(names) != 2:
            raise cells.error("joint", f"is '{cells.word('joint')}'; name two blocks as \"A | B\"")
        keys = ["joint", "joint"]
    else:
        names, keys = [cells.word("block_a"), cells.word("block_b")], ["block_a", "block_b"]
    if names[0] or names[1]:
        between = _between(names, keys, cells, assembly, joints)
        label = f"{names[0]} | {names[1]}"
        if all(cells.length(axis) is not None for axis in axes):
            place = np.array([cells.length(axis) for axis in axes], dtype=float)
            away, weights = on_faces(place[None], joints)
            joint = int(np.argmin(np.where(between, away[0], np.inf)))
            _check_place(place, float(away[0, joint]), f"'{label}'", cells, assembly)
            nearest_place = weights[0, joint] @ joints.rings.points[corners_of(joints)[joint]]
            return nearest_place, joint, False, f"{label} at {place_text(place)}"
        sizes = joints.sizes[between]
        middle = sizes @ joints.rings.middles()[between] / sizes.sum()
        return middle, int(np.flatnonzero(between)[0]), True, label
    missing = next((axis for axis in axes if cells.length(axis) is None), None)
    if missing is not None:
        raise cells.error(missing, "is missing; give the place of the crack, or the joint")
    place = np.array([cells.length(axis) for axis in axes], dtype=float)
    _check_place(place, float(on_faces(place[None], joints)[0].min(initial=np.inf)), "any joint", cells, assembly)
    return place, None, False, place_text(place)


def _check_place(place: np.ndarray, away: float, what: str, cells: _Cells, assembly: solver.Assembly) -> None:
    """Refuse a place that is so far away [m] from what it is of that it is a mistake."""
    if away > FARTHEST * assembly.block_size:
        low, high = assembly.vertices.min(axis=0), assembly.vertices.max(axis=0)
        raise cells.error(
            "x",
            f"and {' and '.join('yz'[: len(place) - 1])} are {place_text(place, 6)} m, {away:.3g} m from {what}; the "
            f"blocks lie between {place_text(low)} and {place_text(high)} m: check the unit",
        )


def _blocks(name: str, key: str, cells: _Cells, assembly: solver.Assembly) -> list[int]:
    """Find the block of a name, or the pieces of a support that was cut."""
    uncut = uncut_names(assembly)
    meant = {uncut[i] for i in blocks_called(name, assembly)}
    if len(meant) > 1:
        raise cells.error(
            key, f"'{name}' is the name of {len(meant)} blocks; leave it out and give the place, x and y, in space z"
        )
    names = pieces_named((name,), assembly)
    if not set(names) <= set(assembly.names):
        problem = f"'{name}' is no block{nearest(name, assembly.names)}" if name else "names no block"
        raise cells.error(key, f"{problem}; blockvis info lists the names")
    return [assembly.index(one) for one in names]


def _displacement(cells: _Cells, assembly: solver.Assembly) -> _Point | None:
    """Read the displacement of a point."""
    axes = "xyz"[: assembly.dimension]
    there = [cells.length(f"displaced_{axis}") for axis in axes]
    moved = [cells.length(f"d{axis}") for axis in axes]
    if all(value is None for value in (*moved, *there)):
        return None
    place, name = [cells.length(axis) for axis in axes], cells.word("block")
    if not name and None in place:
        raise cells.error("block", f"is missing; give the block, or {_listed(axes)}, of the displaced point")
    blocks = _blocks(name, "block", cells, assembly) if name else list(range(assembly.n_blocks))
    if None in place:
        # Supports are cut in the plane alone.
        weights = assembly.areas[blocks] if len(blocks) > 1 else None
        point = np.average(assembly.centroids[blocks], axis=0, weights=weights)
    else:
        point = np.array(place, dtype=float)
    away = distances_to(assembly, point)
    block = blocks[int(np.argmin(away[blocks]))]
    if None not in place:
        _check_place(point, float(away[block]), f"'{name}'" if name else "any block", cells, assembly)
    if None not in there:
        displaced = np.array(there, dtype=float) - point
    elif None not in moved:
        displaced = np.array(moved, dtype=float)
    else:
        missing = f"d{axes[moved.index(None)]}"
        raise cells.error(missing, f"is missing; give {'both' if len(axes) == 2 else 'all three'} coordinates")
    extent, far = float(np.ptp(assembly.vertices, axis=0).max()), float(np.linalg.norm(displaced))
    if far > FARTHEST_POINT * extent:
        raise cells.error(
            "displaced_x" if None not in there else "dx",
            f"puts '{assembly.names[block]}' {far:.3g} m from where it is drawn, in a structure of "
            f"{extent:.3g} m; is it in mm? name the column so, as in: dx [mm]",
        )
    uncertainty = cells.length("uncertainty")
    return point, assembly.names[block], displaced, POINT_UNCERTAINTY if uncertainty is None else uncertainty


def _of_drawing(path: Path, assembly: solver.Assembly) -> Observations:
    """Compare a drawing of the damaged state with the undamaged one, block by block."""
    if assembly.dimension == 3:
        raise ValueError(f"{path}: a drawing of the damaged state is read in the plane; in space give a table (.csv)")
    layout = read_layout(path)
    if layout.dimension == 3:
        raise ValueError(f"{path}: draws blocks in space; give a drawing in the plane, as the case is")
    partner = _partners(layout.names, layout.outlines, assembly)
    if not partner:
        raise ValueError(
            f"{path}: of its {counted(layout.n_blocks, 'block')} none is one of the case, by its name or its shape"
        )
    pose = solver.Pose.initial(assembly)
    for block, drawn in partner.items():
        pose.positions[block], pose.rotations[block] = _moved(assembly, block, np.asarray(layout.outlines[drawn]))
    _check_moved(pose.positions - assembly.centroids, sorted(partner), assembly, path)
    lost = [f"'{name}'" for i, name in enumerate(assembly.names) if i not in partner and assembly.free[i]]
    if lost:
        missing = counted(
            len(lost), "block of the case is not in it and says", "blocks of the case are not in it and say"
        )
        others = [f"'{name}'" for k, name in enumerate(layout.names) if k not in partner.values()]
        other = f"; {len(others)} of its blocks fit none, or lie too far away ({listed(others)})" * bool(others)
        warnings.warn(f"{path}: {missing} nothing ({listed(lost)}){other}", stacklevel=4)
    joints = initial_joints(assembly)
    opening = opening_and_slip(assembly, joints, pose)[:, 0]
    # Joints that are closed but for the rounding of the drawing's numbers would be told and drawn as cracks.
    opening[opening < LEAST_WIDTH] = 0.0
    known = np.zeros(assembly.n_blocks, dtype=bool)
    known[list(partner)] = True
    sigma = POINT_UNCERTAINTY
    widths = [
        (
            joints.ends[k].mean(axis=0),
            True,
            True,
            float(opening[k]),
            float(np.hypot(sigma, WIDTH_UNCERTAINTY * opening[k])),
            f"{assembly.names[joints.block_a[k]]} | {assembly.names[joints.block_b[k]]}",
        )
        for k in np.flatnonzero(known[joints.block_a] & known[joints.block_b]).tolist()
    ]
    points = [
        (assembly.centroids[i], assembly.names[i], pose.positions[i] - assembly.centroids[i], sigma)
        for i in sorted(partner)
    ]
    return _observations(widths, points, str(path), 2)


def _check_moved(moved: np.ndarray, known: list[int], assembly: solver.Assembly, path: Path) -> None:
    """Refuse a drawing with another origin, or with blocks that are not those of their names."""
    far, shift = np.linalg.norm(moved, axis=1), moved[known].mean(axis=0)
    apart = np.linalg.norm(moved[known] - shift, axis=1).max()
    # Without all of its supports, a drawing of a part may have moved nearly as one.
    supported = set(np.flatnonzero(~assembly.free)) <= set(known)
    if supported and far[known].min() > max(apart, POINT_UNCERTAINTY):
        raise ValueError(
            f"{path}: its blocks, supports too, lie about {place_text(shift, 3)} m beside those of the case, and what "
            "all have in common opens no joint; move it: a support that stands still lies where the case draws it"
        )
    most = FARTHEST_POINT * float(np.ptp(assembly.vertices, axis=0).max())
    lost = [f"'{assembly.names[k]}' {far[k]:.3g} m" for k in known if far[k] > most]
    if lost:
        raise ValueError(
            f"{path}: puts {listed(lost)} from where the case draws it; check names that are swapped, the origin and "
            "the unit"
        )
    # Blocks that still stand have moved by the shortest ways to where they lie; those with swapped names have not.
    places = assembly.centroids[known]
    owners = linear_sum_assignment(((places[:, None] + moved[known][:, None] - places) ** 2).sum(axis=2))[1]
    names = [assembly.names[k] for k in known]
    swapped = [f"'{names[k]}' where '{names[own]}' lies" for k, own in enumerate(owners.tolist()) if k != own]
    if swapped:
        raise ValueError(f"{path}: puts {listed(swapped)} in the case; check names that are swapped")


def _partners(names: Sequence[str], outlines: Sequence[np.ndarray], assembly: solver.Assembly) -> dict[int, int]:
    """Pair the blocks of the case with those of a drawing, by their names where these fit, else by their shapes."""
    numbers = {name: i for i, name in enumerate(assembly.names)}
    if len(set(names)) == len(names) and sum(name in numbers for name in names) > 0.5 * len(names):
        return {numbers[name]: k for k, name in enumerate(names) if name in numbers}
    polygons = [shapely.Polygon(ring) for ring in outlines]
    centres = np.array([polygon.centroid.coords[0] for polygon in polygons])
    areas = np.array([polygon.area for polygon in polygons])
    apart = np.hypot(*np.moveaxis(assembly.centroids[:, None] - centres[None], 2, 0)) / assembly.block_size
    # Two blocks of unlike size are not the same stone, however near they lie.
    cost = apart + np.abs(np.log(assembly.areas[:, None] / areas[None]))
    rows, columns = linear_sum_assignment(cost)
    # What has moved by more than a block is another one.
    return {int(i): int(k) for i, k in zip(rows, columns, strict=True) if cost[i, k] < 1.0}


def _moved(assembly: solver.Assembly, block: int, ring: np.ndarray) -> tuple[np.ndarray, float]:
    """Find the rigid motion of a block that brings its corners nearest to an outline; its centroid then, and angle."""
    own = assembly.outline(block)
    polygon = shapely.Polygon(ring)
    centre = np.array(polygon.centroid.coords[0])
    ring = ring if polygon.exterior.is_ccw else ring[::-1]
    if len(ring) != len(own):
        return centre, 0.0
    arms, best = own - assembly.centroids[block], (np.inf, 0.0)
    for shift in range(len(ring)):
        there = np.roll(ring, shift, axis=0) - centre
        cosine, sine = (arms * there).sum(), (arms[:, 0] * there[:, 1] - arms[:, 1] * there[:, 0]).sum()
        angle = float(np.arctan2(sine, cosine))
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        # A brick fits upside down as well; stones that still stand have turned little.
        misfit = float(np.hypot(*(arms @ turn.T - there).T).sum()) + 1e-3 * abs(angle)
        best = min(best, (misfit, angle))
    return centre, best[1]
