"""Layout: the blocks of a drawing before they become an assembly, whatever file they come from."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from numbers import Real
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike

import solver
from solver import mechanics

from .left_out import LeftOut
from .notes import CHANGED, Note
from .outlines import ring_area
from .solids import Solid, extruded, prism, volume

#: A block in the plane: (n, 2) corners in order [m], the first not repeated.
Outline = np.ndarray

#: Surrogate halves of characters, which escaped JSON and bytes that are no text leave behind.
_HALVES = re.compile("[\ud800-\udfff]")

#: What is known of every block beside its name, and what stands where nothing is.
_UNSAID: dict[str, Any] = {"groups": "", "roles": "", "materials": "", "looks": (), "within": (), "laid": False}


@dataclass(frozen=True)
class Layout:
    """Blocks of a drawing in the plane or in space, with what else the drawing says of them.

    Attributes
    ----------
    blocks : tuple of (n, 2) arrays, or of (points, faces) [m]
        In the plane the corners of each block in order, the first corner not repeated; gravity acts along -y. In space
        the (n, 3) corners of each block, and the corners around each of its faces, counter-clockwise seen from outside;
        gravity acts along -z.
    names : tuple of str
        One per block; may repeat.
    groups : tuple of str
        Physical group, layer, object group or part of each block, "" for none.
    roles : tuple of str
        "free", "fixed", "moving", or "" where the file says nothing.
    materials : tuple of str
    density : (n_blocks,) array [kg/m³] or None
        NaN for a block of which the file says nothing.
    thickness : (n_blocks,) array [m] or None
        Out of plane; NaN for a block of which the file says nothing. Blocks in space have none.
    thickness_unit : str
        In which the file has it: "m" of a thickness that is no length of the drawing, "" of one in its unit.
    unit : str
        Unit of length in which the file was read; inside a format's reader the unit that the file states, "" for none.
    unit_by : {"", "page", "layout", "user"}
        Whose word the unit is: the size of the blocks casts no doubt on a user's, and a note on that of a layout of
        our own; that of a page, of a drawing at a scale, asks for the user's; any other it may overrule.
    notes : tuple of str
        What the reader assumed or dropped; see :class:`blockvis.layout.notes.Note`.
    source : str
        The file, "" for a layout that was not read from a file.
    left_out : tuple of LeftOut
        What the file draws beside its blocks.
    looks : tuple of tuples of str
        Kind of entity and colour of each block in a drawing, by which it can be left out.
    within : tuple of tuples of str
        Layers around that of each block, by which it can be asked for, too.
    laid : tuple of bool
        Whether a bond laid the block: two of them touch or stand apart as they are, and have no mortar between them.
    """

    blocks: tuple[Outline | Solid, ...]
    names: tuple[str, ...]
    groups: tuple[str, ...] = ()
    roles: tuple[str, ...] = ()
    materials: tuple[str, ...] = ()
    density: np.ndarray | None = None
    thickness: np.ndarray | None = None
    thickness_unit: str = ""
    unit: str = "m"
    unit_by: str = ""
    notes: tuple[str, ...] = ()
    source: str = ""
    left_out: tuple[LeftOut, ...] = ()
    looks: tuple[tuple[str, ...], ...] = ()
    within: tuple[tuple[str, ...], ...] = ()
    laid: tuple[bool, ...] = ()

    def __post_init__(self) -> None:
        """Check that there is one of each kind per block, and replace broken characters."""
        self._count()
        for name, role in zip(self.names, self.roles, strict=True):
            if role and role not in mechanics.ROLES:
                raise ValueError(f"block '{name}' has role '{role}'; roles are {', '.join(mechanics.ROLES)}")
        # A file in another encoding than it states leaves halves of characters, which cannot be written to a file.
        note = "characters that the file's encoding does not have are shown as \ufffd"
        for kind in ("names", "groups", "roles", "materials"):
            words = tuple(map(str, getattr(self, kind)))
            whole = tuple(_HALVES.sub("\ufffd", word) for word in words)
            if whole != words and note not in self.notes:
                object.__setattr__(self, "notes", (*self.notes, note))
            object.__setattr__(self, kind, whole)

    def __repr__(self) -> str:
        """One line: how many blocks, and from which file."""
        source = f" of '{self.source}'" if self.source else ""
        return f"<Layout of {mechanics.counted(self.n_blocks, 'block')}{source}>"

    def _count(self) -> None:
        """Put there what nothing is said of, and refuse what is not one per block."""
        n, blocks = self.n_blocks, mechanics.counted(self.n_blocks, "block")
        for kind in ("names", *_UNSAID):
            given = tuple(getattr(self, kind)) or (_UNSAID.get(kind),) * (n if kind in _UNSAID else 0)
            if len(given) != n:
                raise ValueError(f"{blocks} but {len(given)} {kind}; give one per block")
            object.__setattr__(self, kind, given)
        for kind in ("density", "thickness"):
            if getattr(self, kind) is not None:
                numbers = np.array(getattr(self, kind), dtype=float)
                if numbers.shape != (n,):
                    raise ValueError(f"{blocks} but {kind} of shape {numbers.shape}; give one number per block")
                object.__setattr__(self, kind, numbers)

    @property
    def n_blocks(self) -> int:
        """Number of blocks."""
        return len(self.blocks)

    @property
    def dimension(self) -> int:
        """2 of blocks in the plane, and where there is none; 3 of blocks in space."""
        return 3 if self.blocks and isinstance(self.blocks[0], tuple) else 2

    @property
    def outlines(self) -> tuple[Outline, ...]:
        """The blocks of a layout in the plane."""
        return cast(tuple[Outline, ...], self.blocks)

    @property
    def solids(self) -> tuple[Solid, ...]:
        """The blocks of a layout in space."""
        return cast(tuple[Solid, ...], self.blocks)

    @property
    def volumes(self) -> np.ndarray:
        """(n_blocks,) array [m³]: of blocks in space."""
        return np.array([volume(*solid) for solid in self.solids])

    @property
    def sizes(self) -> np.ndarray:
        """(n_blocks,) array [m]: edge of the square, in space of the cube, as large as each block."""
        if self.dimension == 3:
            return np.cbrt(self.volumes)
        return np.sqrt([abs(ring_area(ring)) for ring in self.outlines])

    def corners(self, block: int) -> np.ndarray:
        """(n, d) array [m]: the corners of a block."""
        shape = self.blocks[block]
        return shape[0] if isinstance(shape, tuple) else shape

    @property
    def every_corner(self) -> list[np.ndarray]:
        """(n, d) arrays [m]: the corners of all blocks."""
        return [self.corners(i) for i in range(self.n_blocks)]

    @property
    def points(self) -> np.ndarray:
        """(n_points, d) array [m]: the corners of all blocks, one block after another."""
        return np.concatenate(self.every_corner) if self.blocks else np.zeros((0, 2))

    def chosen(self, blocks: Sequence[int] | np.ndarray) -> Layout:
        """Take only these blocks, (n,) int in this order or (n_blocks,) bool; ``ValueError`` for others."""
        try:
            keep = np.arange(self.n_blocks)[list(blocks)].tolist()
        except IndexError:
            last = self.n_blocks - 1
            raise ValueError(f"there are no blocks {blocks}; give numbers from 0 to {last}, or a bool each") from None
        taken: dict[str, Any] = {}
        for kind in ("blocks", "names", *_UNSAID, "thickness", "density"):
            of = getattr(self, kind)
            taken[kind] = tuple(of[i] for i in keep) if isinstance(of, tuple) else of if of is None else of[keep]
        return replace(self, **taken)

    def with_more(self, blocks: Sequence[Outline | Solid], **of_blocks: Sequence[Any]) -> Layout:
        """Add blocks, with what is known of them: names, roles, materials, density, thickness, laid."""
        taken: dict[str, Any] = {"blocks": self.blocks + tuple(blocks), "names": (*self.names, *of_blocks["names"])}
        for kind, nothing in _UNSAID.items():
            taken[kind] = getattr(self, kind) + tuple(of_blocks.get(kind, (nothing,) * len(blocks)))
        for kind in ("density",) if self.dimension == 3 else ("density", "thickness"):
            known, more = getattr(self, kind), of_blocks.get(kind)
            if known is not None or more is not None:
                own = np.full(self.n_blocks, np.nan) if known is None else known
                taken[kind] = np.append(own, np.full(len(blocks), np.nan) if more is None else more)
        return replace(self, **taken)

    def leaving_out(self, reasons: Mapping[int, LeftOut]) -> Layout:
        """Leave out these blocks, each for its reason."""
        if not reasons:
            return self
        named = [
            replace(item, name=self.names[i], layer=self.groups[i] or self.materials[i], looks=self.looks[i])
            for i, item in reasons.items()
        ]
        others = self.chosen([i for i in range(self.n_blocks) if i not in reasons])
        return replace(others, left_out=(*self.left_out, *named))


def layout_of(assembly: solver.Assembly, *, pose: solver.Pose | None = None) -> Layout:
    """Make a layout of an assembly, with its blocks as drawn or as displaced in a pose."""
    vertices = assembly.vertices if pose is None else mechanics.moved_vertices(assembly, pose)
    # A file with the names as drawn is read with the same ones again, unless blocks were cut or left out.
    as_drawn = mechanics.unique_names(assembly.drawn_names) == assembly.names
    shared: dict[str, Any] = {
        "names": assembly.drawn_names if as_drawn else assembly.names,
        "roles": tuple(map(str, assembly.roles)),
        "materials": assembly.materials,
        "density": assembly.density,
    }
    if isinstance(assembly.shapes, mechanics.Polyhedra):
        shapes = assembly.shapes
        corners = np.split(vertices, shapes.offsets[1:-1])
        return Layout(blocks=tuple((own, shapes.surface(i)[1]) for i, own in enumerate(corners)), **shared)
    return Layout(blocks=tuple(np.split(vertices, assembly.offsets[1:-1])), thickness=assembly.thickness, **shared)


def assembly_of(
    blocks: Sequence[Outline | Solid], thickness: ArrayLike | None = 1.0, **of_blocks: Any
) -> solver.Assembly:
    """Make an assembly of blocks as a layout has them: only outlines have a thickness [m]."""
    if isinstance(blocks[0], tuple):
        return solver.Assembly.from_solids(cast(Any, blocks), **of_blocks)
    return solver.Assembly.from_outlines(cast(Any, blocks), thickness=cast(Any, thickness), **of_blocks)


def standing(layout: Layout, thickness: float) -> Layout:
    """Put a layout of the plane into space: upright, extruded along y by half of its thickness to each side.

    Blocks for which the layout has none get the given thickness [m].
    """
    if not isinstance(thickness, Real):
        raise ValueError(f"thickness is {thickness!r}; give a length in m above 0")
    depth = np.full(layout.n_blocks, np.nan) if layout.thickness is None else layout.thickness
    depth = np.where(np.isnan(depth), thickness, depth)
    for k in np.flatnonzero(~((depth > 0.0) & (depth < np.inf))).tolist():
        raise ValueError(f"block '{layout.names[k]}' has thickness {depth[k]:g} m; give a length above 0")
    return replace(
        layout,
        blocks=tuple(
            extruded(ring, -t / 2.0, t / 2.0) for ring, t in zip(layout.outlines, depth.tolist(), strict=True)
        ),
        thickness=None,
        notes=(
            *layout.notes,
            Note(CHANGED, f"the drawing in the plane was extruded along y by {_depths(layout, thickness)}"),
        ),
    )


def solids_of(layout: Layout) -> list[Solid]:
    """List blocks in space; of outlines prisms as thick as these are, else 1 m, in front of the plane and behind it."""
    if layout.dimension == 3:
        return list(layout.solids)
    depth = np.ones(layout.n_blocks) if layout.thickness is None else np.nan_to_num(layout.thickness, nan=1.0)
    return [prism(ring, -t / 2.0, t / 2.0) for ring, t in zip(layout.outlines, depth.tolist(), strict=True)]


def _depths(layout: Layout, thickness: float) -> str:
    """Say which thickness [m] blocks of the plane have in space: their own, or else this one."""
    own = np.zeros(0) if layout.thickness is None else layout.thickness[np.isfinite(layout.thickness)]
    if not len(own):
        return f"{thickness:g} m"
    low, high = f"{own.min():g}", f"{own.max():g}"
    said = f"the thickness that {len(own)} of {mechanics.counted(layout.n_blocks, 'block')} have of their own, "
    return said + (low if low == high else f"{low} to {high}") + f" m; {thickness:g} m is that of blocks without"
