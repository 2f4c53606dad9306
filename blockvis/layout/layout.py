"""Layout: the blocks of a drawing before they become an assembly, whatever file they come from."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

import solver

from .left_out import LeftOut

#: Surrogate halves of characters, which escaped JSON and bytes that are no text leave behind.
_HALVES = re.compile("[\ud800-\udfff]")


@dataclass(frozen=True)
class Layout:
    """Outlines of blocks, with their names, groups, roles, materials, thickness and density.

    Attributes
    ----------
    outlines : tuple of (n, 2) arrays [m]
        Corners of each block in order, the first corner not repeated.
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
        Unit of length in which the file was read; inside a format's reader the unit that the file states, "" for none.
    notes : tuple of str
        What the reader assumed or dropped.
    source : str
        The file, "" for a layout that was not read from a file.
    left_out : tuple of LeftOut
        What the file draws beside its blocks.
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
    left_out: tuple[LeftOut, ...] = ()

    def __post_init__(self) -> None:
        """Check that there is one entry per block, and replace broken characters."""
        n = len(self.outlines)
        for what in ("groups", "roles", "materials"):
            if not getattr(self, what):
                object.__setattr__(self, what, ("",) * n)
        for what in ("names", "groups", "roles", "materials"):
            if len(getattr(self, what)) != n:
                raise ValueError(f"{n} outlines but {len(getattr(self, what))} {what}; give one per block")
        # A file in another encoding than it states leaves halves of characters, which cannot be written to a file.
        note = "characters that the file's encoding does not have are shown as \ufffd"
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

    def chosen(self, blocks: Sequence[int] | np.ndarray) -> Layout:
        """Take only these blocks, in this order."""
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

    def leaving_out(self, reasons: Mapping[int, LeftOut]) -> Layout:
        """Leave out these blocks, each for its reason."""
        if not reasons:
            return self
        named = [
            replace(item, name=self.names[i], layer=self.groups[i] or self.materials[i]) for i, item in reasons.items()
        ]
        others = self.chosen([i for i in range(self.n_blocks) if i not in reasons])
        return replace(others, left_out=(*self.left_out, *named))


def layout_of(assembly: solver.Assembly, *, pose: solver.Pose | None = None) -> Layout:
    """Make a layout of an assembly, with its blocks as drawn or as displaced in a pose."""
    vertices = assembly.vertices if pose is None else solver.moved_vertices(assembly, pose)
    return Layout(
        outlines=tuple(np.split(vertices, assembly.offsets[1:-1])),
        names=assembly.names,
        roles=tuple(map(str, assembly.roles)),
        materials=assembly.materials,
        thickness=assembly.thickness,
        density=assembly.density,
    )
