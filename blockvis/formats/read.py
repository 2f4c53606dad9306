"""Layout files read and written: the suffix chooses the format."""

from __future__ import annotations

import importlib
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Unpack

import numpy as np

import solver
from blockvis.formats import FORMATS, Format
from blockvis.layout.assemble import assemble
from blockvis.layout.block_table import rows_of
from blockvis.layout.inspect import Inspection, inspected
from blockvis.layout.layout import Layout, layout_of, standing
from blockvis.layout.notes import CHANGED, Note
from blockvis.layout.outlines import without_collinear
from blockvis.layout.refusal import Refused, carrying
from blockvis.layout.remedies import proposed_ignore
from blockvis.layout.repair import DeepOverlap
from blockvis.layout.selection import checked_window, noted, sorted_out, within_window, without_ignored
from blockvis.layout.unfilled import walls_to_fill
from blockvis.layout.units import chosen_unit, metres_per
from blockvis.layout.views import checked_dimension, checked_view
from blockvis.system.atomic_files import atomic_file, write_atomic
from blockvis.text import nearest
from solver import mechanics

from .bodies import Bodies, as_drawn, in_dimension, with_role
from .cells import of_files
from .elsewhere import cannot_read
from .files import MissingFile as MissingFile
from .files import files_of
from .image_scale import ImageKeys
from .reading import Reading, naming

#: Largest coordinate [m], larger than the Earth; double precision resolves 1e-8 m there.
LARGEST_COORDINATE = 1e8

#: Spacing of coordinates in single precision, as a fraction of a block, that is said.
COARSE = 1e-3

#: Modules whose files may be images, or annotations of one.
HOLD_IMAGES = ("images", "layout_json")

#: Most corners of one block: more indicate a bad export, and some checks take the square of their number.
MOST_CORNERS = 2000


def read_layout(
    path: str | Path,
    *,
    unit: str | None = None,
    chord_tolerance: float | None = None,
    view: str | None = None,
    ignore: str | Sequence[str] = (),
    only: str | Sequence[str] = (),
    window: Sequence[float] | None = None,
    dimension: int | str = "auto",
    thickness: float = 1.0,
    **image: Unpack[ImageKeys],
) -> Layout:
    """Read the blocks of a layout file.

    Parameters
    ----------
    path : str or Path
        The suffix chooses the format; see :data:`blockvis.formats.FORMATS`. A folder, or a pattern such as
        ``"stones/*.stl"``, stands for files of one format, as of one stone each.
    unit : str, optional
        Unit of the file's lengths; it replaces the one that the file states.
    chord_tolerance : float, optional [m]
        Largest distance of an arc from the chords that replace it; by default a thousandth of its radius.
    view : {"xy", "xz", "yz"}, optional
        Coordinates that become x and y, of drawings in space; by default those in which the blocks lie side by side.
    ignore, only : str or sequence of str, optional
        Layers, groups, materials and names, or patterns of them (``"dim*"``), that are left out, and beside which all
        others are left out. What ``only`` names is not left out for looking like a frame, a title block or mortar, but
        strips between pairs of lines stay for ``"*"`` alone. Of drawings also kinds of entities (``"circle"``,
        ``"hatch"``) and colours (``"#ff0000"``; of .dxf also a number of AutoCAD's), where no layer or name is called
        so.
    window : sequence of float, optional [m]
        x0, y0, x1, y1 of what is read of a drawing in the plane, in the coordinates of the layout. What crosses its
        edge is left out.
    dimension : {"auto", 2, 3}
        Whether blocks are read in the plane or in space; "auto" takes space where bodies are not prisms side by side.
        In space a drawing in the plane stands upright, extruded along y by its thickness.
    thickness : float [m]
        For that, of blocks for which the file has none.
    **image
        ``width``, ``height`` or ``pixel`` [m], ``background``, ``smallest`` and ``outline_tolerance`` [m] of an image;
        see :class:`blockvis.formats.image_scale.ImageKeys`.

    Returns
    -------
    Layout
        Its ``blocks``, ``names``, ``groups``, ``roles``, ``materials``, ``density`` and ``thickness`` have one of each
        per block; ``dataclasses.replace`` changes them, ``chosen`` takes some of the blocks, and
        :func:`blockvis.assemble` makes an assembly of what comes out. Lengths in m, outlines without collinear points,
        plane faces. What the drawing holds beside its blocks is in ``left_out``, and in a note per kind and layer.

    Raises
    ------
    ValueError
        With the reason and the remedy, for a file that is missing, damaged or no layout.
    """
    reading = _reading(unit, chord_tolerance, view, ignore, only, dimension, image)
    try:
        layout = _blocks(Path(path), reading, checked_window(window))
    except Refused as error:
        if error.layout is not None and not error.layout.source:
            # Readers name places in the unit of the file, and so does the picture beside what they say.
            error.unit = unit or error.layout.unit or "unit of the file"
            error.layout = replace(error.layout, source=str(path))
        raise
    return standing(layout, thickness) if dimension == 3 and layout.dimension == 2 else layout


def _reading(
    unit: str | None,
    chord_tolerance: float | None,
    view: str | None,
    ignore: str | Sequence[str],
    only: str | Sequence[str],
    dimension: int | str,
    image: ImageKeys,
) -> Reading:
    strange = next((key for key in image if key not in ImageKeys.__annotations__), None)
    if strange is not None:
        known = [*(read.__kwdefaults__ or ()), *ImageKeys.__annotations__]
        raise TypeError(f"there is no option {strange}{nearest(strange, known)}; blockvis.read lists them")
    if unit is not None:
        metres_per(unit)
    if chord_tolerance is not None and not 0.0 < chord_tolerance < np.inf:
        raise ValueError(f"chord_tolerance is {chord_tolerance:g} m; it must be a length above 0")
    ignore, only = ((words,) if isinstance(words, str) else tuple(words) for words in (ignore, only))
    return Reading(unit, chord_tolerance, checked_view(view), ignore, only, checked_dimension(dimension), {**image})


def _blocks(path: Path, reading: Reading, corners: tuple[float, ...]) -> Layout:
    """Read what a file draws, in metres, without what is no block."""
    drawn = _outlines(path, reading)
    if drawn.dimension == 3:
        if corners:
            raise ValueError(f"'{path}' was read in space, and window is of the plane; choose blocks by ignore or only")
        return noted(drawn)
    with carrying(lambda: drawn):
        layout = sorted_out(drawn, reading.ignore, reading.only, corners)
    for k, (name, ring) in enumerate(zip(layout.names, layout.outlines, strict=True)):
        if len(ring) > MOST_CORNERS:
            raise Refused(
                f"'{path}': block '{name}' has {len(ring)} corners, more than {MOST_CORNERS}; draw it with fewer",
                layout,
                [k],
            )
    return layout


def read_outlines(
    path: str | Path,
    *,
    unit: str | None = None,
    view: str | None = None,
    ignore: str | Sequence[str] = (),
    only: str | Sequence[str] = (),
    window: Sequence[float] | None = None,
    **image: Unpack[ImageKeys],
) -> Layout:
    """Read all closed outlines of a drawing, those around others and those with holes too.

    Parameters
    ----------
    path, unit, view, ignore, only, window, **image
        As of :func:`read_layout`.

    Returns
    -------
    Layout
        Outlines with holes are in ``left_out``; none is taken for a frame, a background or debris.
    """
    reading = _reading(unit, None, view, ignore, only, "auto", image)
    layout = _outlines(Path(path), reading)
    return within_window(without_ignored(layout, reading.ignore, reading.only), checked_window(window))


def _outlines(path: Path, reading: Reading) -> Layout:
    """Read what a file draws, in metres and checked, before what is no block is left out."""
    # Who gives the size of an image leaves no doubt about its unit.
    sized = any(reading.image.get(key) for key in ("width", "height", "pixel"))
    unit = reading.unit or ("m" if sized else None)
    files = files_of(path)
    found = [_read_by_suffix(file, reading) for file in files]
    with naming(f"'{path}'"):
        content = found[0] if files == [path] else of_files(found, files)
        with carrying(lambda: as_drawn(content)):
            if isinstance(content, Layout) and content.dimension == 3 and reading.dimension == 2:
                raise ValueError("it draws its blocks in space; leave out dimension = 2")
            layout = content if isinstance(content, Layout) else in_dimension(content, reading)
    layout = replace(layout, source=str(path), notes=layout.notes + _rounded_note(content, layout))
    if layout.dimension == 3:
        return _in_metres(layout, unit)
    if layout.n_blocks == 0 and not layout.left_out:
        raise ValueError(f"'{path}' draws no block; draw each block as one closed outline or meshed surface")
    for i, ring in enumerate(layout.outlines):
        if not np.isfinite(ring).all():
            bad = ring[~np.isfinite(ring).all(axis=1)][0]
            raise ValueError(
                f"'{path}': block '{layout.names[i]}' has a corner at {bad.tolist()}; "
                "coordinates must be finite numbers: repair the file"
            )
    return _in_metres(layout, unit)


def _in_metres(layout: Layout, unit: str | None) -> Layout:
    """Choose the unit of a layout, and check its coordinates."""
    stated = unit or layout.unit or "m"
    by = "user" if unit else layout.unit_by
    chosen, note = chosen_unit(stated if by else None, layout.unit, layout.sizes) if layout.n_blocks else (stated, "")
    factor = metres_per(chosen)
    layout = replace(
        layout,
        blocks=tuple((points * factor, faces) for points, faces in layout.solids)
        if layout.dimension == 3
        else tuple(without_collinear(ring * factor) for ring in layout.outlines),
        thickness=None if layout.thickness is None else layout.thickness * metres_per(layout.thickness_unit or chosen),
        unit=chosen,
        unit_by=by,
        notes=layout.notes + ((note,) if note else ()),
        left_out=tuple(item.mapped(factor) for item in layout.left_out),
    )
    largest = float(np.abs(layout.points).max(initial=0.0))
    if largest > LARGEST_COORDINATE:
        raise ValueError(
            f"'{layout.source}' has a coordinate of {largest:.3g} m; corners must lie within "
            f"{LARGEST_COORDINATE:.0e} m of the origin: check the unit or repair the file"
        )
    return layout


def _rounded_note(content: Layout | Bodies, layout: Layout) -> tuple[str, ...]:
    """Say that coordinates far from the origin are as coarse as single precision is there, if they look like it.

    Planes that were fitted to faces, and what else makes a layout of bodies, hide it.
    """
    corners = content.every_corner if isinstance(content, Layout) else [body.points for body in content.bodies]
    with np.errstate(over="ignore", invalid="ignore"):
        if not layout.n_blocks or not all((points == points.astype(np.float32)).all() for points in corners):
            return ()
    largest = max(float(np.abs(points).max(initial=0.0)) for points in corners)
    coarse = float(np.spacing(np.float32(largest)))
    # Whole numbers are exact: what was rounded uses the last digit that there is.
    rounded = any((points / coarse % 2.0 == 1.0).any() for points in corners)
    if not rounded or coarse <= COARSE * float(np.median(layout.sizes)):
        return ()
    return (
        Note(
            CHANGED,
            f"all coordinates are numbers of single precision, {coarse:.3g} units apart at {largest:.4g}: stones may "
            "have lost their shape; export nearer to the origin, or in double precision",
        ),
    )


def write_layout(layout: Layout, path: str | Path) -> None:
    """Write a layout to a file; the suffix chooses the format, lengths in m.

    What the layout says of its blocks and the format cannot hold is a ``UserWarning``.
    """
    if not isinstance(layout, Layout):
        raise TypeError(f"{type(layout).__name__} is no Layout, as read_layout gives; save_layout writes an Assembly")
    if layout.n_blocks == 0:
        raise ValueError(f"there is no block to write to '{path}'")
    path = Path(path)
    known, module = _format(path, "write")
    if layout.dimension == 3 and not known.writes_space:
        able = " ".join(sorted(suffix for suffix, other in FORMATS.items() if other.writes_space))
        raise ValueError(f"'{path}': {path.suffix} holds no blocks in space; use one of {able}")
    # Whole or not at all.
    with atomic_file(path) as partial:
        module.write(layout, partial)
    lost = _beside_shapes(layout) if known.shapes_only else ""
    if lost:
        alone = f"{path.suffix.lower()} holds shapes and names alone, not the {lost}"
        warnings.warn(f"'{path}': {alone}; write .obj or .json to keep them", stacklevel=2)


def _beside_shapes(layout: Layout) -> str:
    """Count what a layout says of its blocks beside their shapes and names; a role that the name says is not lost."""
    rows = [row for row in rows_of(layout) if row.get("role", mechanics.FREE) != mechanics.FREE]
    roles = sum(with_role({"name": row["name"]}).get("role") != row["role"] for row in rows)
    density = 0 if layout.density is None else int(np.isfinite(layout.density).sum())
    found = [("role", roles), ("density", density)]
    found += [("group", sum(map(bool, layout.groups))), ("material", sum(map(bool, layout.materials)))]
    return ", ".join(f"{what} of {mechanics.counted(n, 'block')}" for what, n in found if n)


def read(
    path: str | Path,
    *,
    roles: Mapping[str, str] | None = None,
    supports: Sequence[Mapping[str, Any]] = (),
    density: float = 2000.0,
    thickness: float = 1.0,
    unit: str | None = None,
    joint_thickness: float | str = 0.0,
    overlap_tolerance: float | None = None,
    chord_tolerance: float | None = None,
    view: str | None = None,
    ignore: str | Sequence[str] = (),
    only: str | Sequence[str] = (),
    window: Sequence[float] | None = None,
    closing: str = "auto",
    dimension: int | str = "auto",
    **image: Unpack[ImageKeys],
) -> solver.Assembly:
    """Read a layout file into an assembly.

    Parameters
    ----------
    path : str or Path
    roles, supports, density, thickness, joint_thickness, overlap_tolerance, closing
        As of :func:`blockvis.assemble`, as is ``outline_tolerance``.
    unit, chord_tolerance, view, ignore, only, window, dimension, **image
        As of :func:`read_layout`.
    """
    chosen: dict[str, Any] = {"chord_tolerance": chord_tolerance, "view": view, "only": only, "window": window}
    chosen |= {"dimension": dimension, "thickness": thickness, **image}
    layout = read_layout(path, unit=unit, ignore=ignore, **chosen)
    outline_tolerance = image.get("outline_tolerance")
    if chord_tolerance is not None and outline_tolerance is None:
        # Who says how fine arcs are wants their chords.
        outline_tolerance = 0.0
    try:
        return assemble(
            layout,
            roles=roles,
            supports=supports,
            density=density,
            thickness=thickness,
            joint_thickness=joint_thickness,
            overlap_tolerance=overlap_tolerance,
            closing=closing,
            outline_tolerance=outline_tolerance,
        )
    except DeepOverlap as error:
        remedy = overlap_remedy(layout, ignore, **chosen)
        raise ValueError(f"'{path}': {error}{remedy and f'; {remedy}'}") from None


def from_compas(model: Any, **options: Any) -> solver.Assembly:
    """Make an assembly of a model, an assembly or meshes of COMPAS in memory.

    Parameters
    ----------
    model : object of COMPAS, or sequence of such
        A block model, an assembly or a list of meshes; whatever has ``to_jsonstring``. Its supports stand still unless
        ``roles`` says otherwise.
    **options
        As of :func:`read`.

    Raises
    ------
    TypeError
        For what COMPAS does not write.
    """
    parts = model if isinstance(model, Sequence) else [model]
    if isinstance(model, str):
        raise TypeError(f"'{model}' is no object of COMPAS; of a file use blockvis.read, of a model give the object")
    strange = [type(part).__name__ for part in parts if not hasattr(part, "to_jsonstring")]
    if strange or not parts:
        what = strange[0] if strange else "an empty list"
        raise TypeError(f"{what} is no object of COMPAS; give a model, an assembly or meshes")
    texts = [part.to_jsonstring() for part in parts]
    text = f"[{','.join(texts)}]" if isinstance(model, Sequence) else texts[0]
    # Messages name the model, not the file by which it comes.
    with TemporaryDirectory() as folder, warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always", UserWarning)
        path = write_atomic(Path(folder) / "model.json", text, durable=False)
        try:
            assembly = read(path, **options)
        except ValueError as error:
            error.args = (str(error).replace(str(path), "the model"), *error.args[1:])
            raise
    for note in told:
        warnings.warn(str(note.message).replace(str(path), "the model"), note.category, stacklevel=2)
    return assembly


def save_layout(assembly: solver.Assembly, path: str | Path, *, pose: solver.Pose | None = None) -> None:
    """Write an assembly to a layout file, its blocks as drawn or as displaced in a pose."""
    if not isinstance(assembly, solver.Assembly):
        raise TypeError(f"{type(assembly).__name__} is no solver.Assembly; write_layout writes a Layout")
    write_layout(layout_of(assembly, pose=pose), path)


def inspect(
    path: str | Path,
    *,
    unit: str | None = None,
    view: str | None = None,
    ignore: str | Sequence[str] = (),
    only: str | Sequence[str] = (),
    window: Sequence[float] | None = None,
    dimension: int | str = "auto",
    **image: Unpack[ImageKeys],
) -> Inspection:
    """Read a layout file and measure it.

    Parameters
    ----------
    path, unit, view, ignore, only, window, dimension, **image
        As of :func:`read_layout`.
    """
    chosen: dict[str, Any] = {"unit": unit, "view": view, "only": only, "window": window, "dimension": dimension}
    chosen |= image
    layout = read_layout(path, ignore=ignore, **chosen)
    found = inspected(layout)
    return replace(found, remedy=overlap_remedy(layout, ignore, found.deep, **chosen)) if found.deep else found


def overlap_remedy(
    layout: Layout, ignore: str | Sequence[str], deep: Sequence[tuple[int, int]] | None = None, **chosen: Any
) -> str:
    """Propose what to leave out so that no blocks overlap, having tried it; "" for walls and openings, to be filled.

    ``deep`` are the pairs that do, where they are known; the options are those with which the layout was read.
    """
    if walls_to_fill(layout):
        return ""
    before = (ignore,) if isinstance(ignore, str) else tuple(ignore)
    chosen, deep = {**chosen, "unit": layout.unit}, inspected(layout).deep if deep is None else deep
    return proposed_ignore(layout, deep, lambda more: read_layout(layout.source, ignore=(*before, *more), **chosen))


def _read_by_suffix(path: Path, reading: Reading) -> Layout | Bodies:
    if path.stat().st_size == 0:
        raise ValueError(f"'{path}' is empty (0 bytes); export it again")
    known, module = _format(path, "read")
    with naming(f"'{path}'"):
        if known.module not in HOLD_IMAGES:
            reading.refuse_image_keys()
        found: Layout | Bodies = module.read(path, reading)
    return found


def _format(path: Path, verb: str) -> tuple[Format, Any]:
    """Find the format of a file by its suffix, and the module that reads and writes it."""
    suffix = path.suffix.lower()
    known = FORMATS.get(suffix)
    if known is None or (verb == "write" and not known.writes):
        if verb == "read":
            raise ValueError(f"'{path}': {cannot_read(suffix)}")
        able = " ".join(sorted(key for key, value in FORMATS.items() if value.writes))
        raise ValueError(
            f"'{path}': cannot write '{suffix or 'a file without suffix'}'; use one of {able}; .vtkhdf is for results"
        )
    return known, importlib.import_module(f"blockvis.formats.{known.module}")
