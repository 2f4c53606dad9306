"""Drawing: the blocks as a file draws them, before they become an assembly; and the way from one to the other."""

from __future__ import annotations

import difflib
import fnmatch
import re
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

import solver

from . import formats
from .outlines import without_collinear
from .repair import duplicates, mended
from .units import chosen_unit, metres_per

#: Coordinates beyond this [m] belong to no building on Earth; double precision leaves less than 0.1 mm there.
LARGEST_COORDINATE = 1e8

#: Corners of one block: more make checks quadratic in them expensive and are never meant.
MOST_CORNERS = 2000


class MissingFile(FileNotFoundError, ValueError):
    """There is no file of that name."""


#: Halves of characters, as they come from escaped JSON and from bytes that are no text.
_HALVES = re.compile("[\ud800-\udfff]")


@dataclass(frozen=True)
class Drawing:
    """Outlines of blocks with what the file says of each.

    Attributes
    ----------
    outlines : tuple of (n, 2) arrays [m]
        Corners of each block in order, first corner not repeated.
    names : tuple of str
        One per block; may repeat.
    groups : tuple of str
        Physical group or layer of each block, "" for none.
    roles : tuple of str
        "free", "fixed", "moving", or "" where the file says nothing.
    materials : tuple of str
    thickness : (n_blocks,) array [m] or None
        Out of plane; NaN for a block of which the file says nothing.
    density : (n_blocks,) array [kg/m³] or None
        NaN for a block of which the file says nothing.
    unit : str
        Unit of length the file was read in; inside a format's reader the unit the file states, "" for none.
    notes : tuple of str
        What the reader assumed or dropped.
    source : str
        Where the drawing came from.
    """

    outlines: tuple[np.ndarray, ...]
    names: tuple[str, ...]
    groups: tuple[str, ...] = ()
    roles: tuple[str, ...] = ()
    materials: tuple[str, ...] = ()
    thickness: np.ndarray | None = None
    density: np.ndarray | None = None
    unit: str = "m"
    notes: tuple[str, ...] = ()
    source: str = ""

    def __post_init__(self) -> None:
        n = len(self.outlines)
        for what in ("groups", "roles", "materials"):
            if not getattr(self, what):
                object.__setattr__(self, what, ("",) * n)
        for what in ("names", "groups", "roles", "materials"):
            if len(getattr(self, what)) != n:
                raise ValueError(f"{n} outlines but {len(getattr(self, what))} {what}; give one per block")
        # A file in another encoding than it says leaves halves of characters, which no other file can hold.
        note = "characters that are none in the file's encoding are shown as \ufffd"
        for what in ("names", "groups", "roles", "materials"):
            words = getattr(self, what)
            whole = tuple(_HALVES.sub("\ufffd", word) for word in words)
            if whole != tuple(words) and note not in self.notes:
                object.__setattr__(self, "notes", (*self.notes, note))
            object.__setattr__(self, what, whole)

    @property
    def n_blocks(self) -> int:
        """Number of outlines."""
        return len(self.outlines)

    def chosen(self, blocks: Sequence[int] | np.ndarray) -> Drawing:
        """The same drawing with only these blocks, in this order."""
        keep = [int(i) for i in blocks]
        return replace(
            self,
            outlines=tuple(self.outlines[i] for i in keep),
            names=tuple(self.names[i] for i in keep),
            groups=tuple(self.groups[i] for i in keep),
            roles=tuple(self.roles[i] for i in keep),
            materials=tuple(self.materials[i] for i in keep),
            thickness=None if self.thickness is None else self.thickness[keep],
            density=None if self.density is None else self.density[keep],
        )


def ring_areas(outlines: Sequence[np.ndarray]) -> np.ndarray:
    """(n,) array: area of each outline, positive counter-clockwise."""
    areas = np.zeros(len(outlines))
    for i, ring in enumerate(outlines):
        x, y = (ring - ring[0]).T
        areas[i] = (x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2.0
    return areas


def read_drawing(path: str | Path, *, unit: str | None = None, chord_tolerance: float | None = None) -> Drawing:
    """Reads the blocks that a file draws.

    Parameters
    ----------
    path : str or Path
        The suffix chooses the format; see :data:`blockvis.formats.FORMATS`.
    unit : str, optional
        Unit of the file's lengths; holds over what the file says.
    chord_tolerance : float, optional [m]
        Largest distance of an arc from the chords that replace it; a thousandth of its radius where not given.

    Raises
    ------
    ValueError
        With the reason and the remedy, for whatever is not a drawing of blocks.
    """
    path = Path(path)
    if not path.exists():
        near = difflib.get_close_matches(path.name, _names_in(path.parent), n=3)
        hint = f"; did you mean {' or '.join(near)}?" if near else "; check the path"
        raise MissingFile(f"there is no file '{path}'{hint}")
    if path.is_dir():
        raise ValueError(f"'{path}' is a folder; give a layout file")
    if path.stat().st_size == 0:
        raise ValueError(f"'{path}' is empty (0 bytes); export it again")
    if unit is not None:
        metres_per(unit)
    drawing = formats.read(path, formats.Reading(unit=unit, chord_tolerance=chord_tolerance))
    if drawing.n_blocks == 0:
        raise ValueError(f"'{path}' draws no block; draw each block as one closed outline or meshed surface")
    for i, ring in enumerate(drawing.outlines):
        if not np.isfinite(ring).all():
            bad = ring[~np.isfinite(ring).all(axis=1)][0]
            raise ValueError(
                f"'{path}': block '{drawing.names[i]}' has a corner at {bad.tolist()}; "
                "coordinates must be finite numbers: repair the file"
            )
    sizes = np.sqrt(np.abs(ring_areas(drawing.outlines)))
    chosen, note = chosen_unit(unit, drawing.unit, sizes)
    factor = metres_per(chosen)
    outlines = tuple(without_collinear(ring * factor) for ring in drawing.outlines)
    for name, ring in zip(drawing.names, outlines, strict=True):
        if len(ring) > MOST_CORNERS:
            raise ValueError(
                f"'{path}': block '{name}' has {len(ring)} corners, more than {MOST_CORNERS}; draw it with fewer"
            )
    largest = max(float(np.abs(ring).max()) for ring in outlines)
    if largest > LARGEST_COORDINATE:
        raise ValueError(
            f"'{path}' has a coordinate of {largest:.3g} m; corners must lie within {LARGEST_COORDINATE:.0e} m of the "
            "origin: check the unit or repair the file"
        )
    thickness = None if drawing.thickness is None else drawing.thickness * factor
    notes = drawing.notes + ((note,) if note else ())
    return replace(drawing, outlines=outlines, thickness=thickness, unit=chosen, notes=notes, source=str(path))


def write_drawing(drawing: Drawing, path: str | Path) -> None:
    """Writes a drawing to a layout file; the suffix chooses the format, lengths in m."""
    if drawing.n_blocks == 0:
        raise ValueError(f"there is no block to write to '{path}'")
    formats.write(drawing, Path(path))


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
) -> solver.Assembly:
    """Reads a layout file into an assembly; parameters of :func:`read_drawing` and :func:`assemble`."""
    drawing = read_drawing(path, unit=unit, chord_tolerance=chord_tolerance)
    return assemble(
        drawing,
        roles=roles,
        supports=supports,
        density=density,
        thickness=thickness,
        joint_thickness=joint_thickness,
        overlap_tolerance=overlap_tolerance,
    )


def save_layout(assembly: solver.Assembly, path: str | Path, *, pose: solver.Pose | None = None) -> None:
    """Writes an assembly to a layout file, as drawn or where a pose has its blocks."""
    write_drawing(drawing_of(assembly, pose=pose), path)


def assemble(
    drawing: Drawing,
    *,
    roles: Mapping[str, str] | None = None,
    supports: Sequence[Mapping[str, Any]] = (),
    density: float = 2000.0,
    thickness: float = 1.0,
    joint_thickness: float | str = 0.0,
    overlap_tolerance: float | None = None,
) -> solver.Assembly:
    """Makes an assembly of a drawing.

    Parameters
    ----------
    drawing : Drawing
    roles : mapping of str to {"free", "fixed", "moving"}, optional
        Keys are names of blocks, groups (layers) or materials, or patterns of them (``"springer *"``). A block's
        own name holds over its group, a name over a pattern, a later key over an earlier one.
    supports : sequence of mappings
        Support blocks that the file does not contain: ``name``, ``role`` and ``outline`` [m] of each, perhaps
        ``density``, ``thickness`` and ``material``.
    density : float [kg/m³]
        Where the drawing has none.
    thickness : float [m]
        Where the drawing has none.
    joint_thickness : float [m] or "auto"
        Gaps between facing edges up to this width are closed to their midline.
    overlap_tolerance : float, optional [m]
        Overlaps up to this depth are resolved to their midline, deeper ones are an error.

    Raises
    ------
    ValueError
        For a role that is none, or whose name matches nothing.
    """
    for note in drawing.notes:
        if note.startswith("unit clash"):
            warnings.warn(f"{drawing.source}: {note}", stacklevel=2)
    n_drawn = drawing.n_blocks
    twins = duplicates(drawing.outlines)
    if twins:
        later = {copy for _, copy in twins}
        listed = ", ".join(f"'{drawing.names[copy]}' = '{drawing.names[first]}'" for first, copy in twins[:20])
        more = f" and {len(twins) - 20} more" if len(twins) > 20 else ""
        warnings.warn(
            f"{len(twins)} of {n_drawn} blocks are drawn twice and were dropped: {listed}{more}", stacklevel=2
        )
        drawing = drawing.chosen([i for i in range(n_drawn) if i not in later])
        n_drawn = drawing.n_blocks
    drawing = _with_supports(drawing, supports)
    assembly = solver.Assembly.from_outlines(
        drawing.outlines,
        names=drawing.names,
        roles=_matched_roles(drawing, roles or {}),
        density=_filled(drawing.density, density, drawing.n_blocks),
        thickness=_filled(drawing.thickness, thickness, drawing.n_blocks),
        materials=drawing.materials,
    )
    outlines, _ = mended(
        assembly,
        joint_thickness=joint_thickness,
        overlap_tolerance=overlap_tolerance,
        anchored=np.arange(drawing.n_blocks) >= n_drawn,
    )
    return solver.Assembly.from_outlines(
        outlines,
        names=assembly.names,
        roles=list(map(str, assembly.roles)),
        density=assembly.density,
        thickness=assembly.thickness,
        materials=assembly.materials,
    )


def drawing_of(assembly: solver.Assembly, *, pose: solver.Pose | None = None) -> Drawing:
    """The drawing of an assembly, as drawn or where a pose has its blocks."""
    vertices = assembly.vertices if pose is None else solver.moved_vertices(assembly, pose)
    return Drawing(
        outlines=tuple(np.split(vertices, assembly.offsets[1:-1])),
        names=assembly.names,
        roles=tuple(map(str, assembly.roles)),
        materials=assembly.materials,
        thickness=assembly.thickness,
        density=assembly.density,
    )


def _names_in(folder: Path) -> list[str]:
    return [entry.name for entry in folder.iterdir()] if folder.is_dir() else []


def _filled(given: np.ndarray | None, default: float, n: int) -> np.ndarray:
    if given is None:
        return np.full(n, float(default))
    return np.where(np.isnan(given), float(default), given)


def _with_supports(drawing: Drawing, supports: Sequence[Mapping[str, Any]]) -> Drawing:
    if not supports:
        return drawing
    known = {"name", "role", "outline", "density", "thickness", "material"}
    added: dict[str, list[Any]] = {key: [] for key in known}
    for k, support in enumerate(supports):
        name = str(support.get("name", f"support {k}"))
        strange = sorted(set(support) - known)
        if strange:
            raise ValueError(f"support '{name}' has the key '{strange[0]}'; its keys are {', '.join(sorted(known))}")
        if "outline" not in support:
            raise ValueError(f"support '{name}' has no outline; give its corners [[x, y], ...] in m")
        try:
            outline = np.asarray(support["outline"], dtype=float)
        except (TypeError, ValueError) as error:
            raise ValueError(f"support '{name}': its outline must be corners [[x, y], ...] in m; {error}") from None
        if outline.ndim != 2 or outline.shape[1] != 2 or len(outline) < 3:
            raise ValueError(f"support '{name}' needs at least three corners [x, y]; its shape is {outline.shape}")
        added["name"].append(name)
        added["outline"].append(outline)
        added["role"].append(_checked_role(str(support.get("role", solver.FIXED)), f"support '{name}'"))
        added["material"].append(str(support.get("material", "")))
        added["density"].append(float(support.get("density", np.nan)))
        added["thickness"].append(float(support.get("thickness", np.nan)))
    nothing = np.full(drawing.n_blocks, np.nan)
    return replace(
        drawing,
        outlines=drawing.outlines + tuple(added["outline"]),
        names=drawing.names + tuple(added["name"]),
        groups=drawing.groups + ("",) * len(supports),
        roles=drawing.roles + tuple(added["role"]),
        materials=drawing.materials + tuple(added["material"]),
        density=np.append(nothing if drawing.density is None else drawing.density, added["density"]),
        thickness=np.append(nothing if drawing.thickness is None else drawing.thickness, added["thickness"]),
    )


def _checked_role(role: str, whose: str) -> str:
    if role not in solver.ROLES:
        raise ValueError(f"{whose} has role '{role}'; roles are {', '.join(solver.ROLES)}")
    return role


def _matched_roles(drawing: Drawing, roles: Mapping[str, str]) -> list[str]:
    """Role of every block: what the caller says, then what the file says, then its own name, else free."""
    found = []
    for name, group, role in zip(drawing.names, drawing.groups, drawing.roles, strict=True):
        said = (role, group.strip().lower(), name.strip().lower())
        found.append(next((word for word in said if word in solver.ROLES), solver.FREE))
    labels = {"name": drawing.names, "group": drawing.groups, "material": drawing.materials}
    by_name: list[tuple[list[int], str]] = []
    by_group: list[tuple[list[int], str]] = []
    by_pattern: list[tuple[list[int], str]] = []
    for key, role in roles.items():
        _checked_role(role, f"roles: '{key}'")
        for kind, values in labels.items():
            hits = [i for i, value in enumerate(values) if value == key]
            if hits:
                (by_name if kind == "name" else by_group).append((hits, role))
                break
        else:
            hits = [
                i
                for i in range(drawing.n_blocks)
                if any(values[i] and fnmatch.fnmatchcase(values[i], key) for values in labels.values())
            ]
            if not hits:
                raise ValueError(_unmatched(key, drawing))
            by_pattern.append((hits, role))
    for hits, role in by_pattern + by_group + by_name:
        for i in hits:
            found[i] = role
    return found


def _unmatched(key: str, drawing: Drawing) -> str:
    labels = [*dict.fromkeys(label for label in (*drawing.groups, *drawing.materials, *drawing.names) if label)]
    closeness = {label: difflib.SequenceMatcher(None, key.lower(), label.lower()).ratio() for label in labels[:2000]}
    nearest = sorted(closeness, key=lambda label: -closeness[label])
    listed = ", ".join(f"'{label}'" for label in nearest[:12])
    more = f" and {len(labels) - 12} more" if len(labels) > 12 else ""
    where = drawing.source or "the drawing"
    return f"roles: '{key}' matches no block, group or layer of {where}; it has {listed}{more}; correct the name"
