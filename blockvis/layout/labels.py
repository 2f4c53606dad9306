"""What a drawing says of blocks beside their shapes, the same in the plane and in space."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, ClassVar, Self

import numpy as np

from .left_out import LeftOut

#: Surrogate halves of characters, which escaped JSON and bytes that are no text leave behind.
_HALVES = re.compile("[\ud800-\udfff]")


def check_labels(layout: Any, n: int, what: str) -> None:
    """Check that a layout being made has one label of each kind per block, and replace broken characters.

    Parameters
    ----------
    layout : Layout or SolidLayout
    n : int
        Number of blocks.
    what : str
        Outlines or solids, for the message.

    Raises
    ------
    ValueError
        For another number of labels.
    """
    for kind in ("groups", "roles", "materials"):
        if not getattr(layout, kind):
            object.__setattr__(layout, kind, ("",) * n)
    for kind in ("names", "groups", "roles", "materials"):
        if len(getattr(layout, kind)) != n:
            raise ValueError(f"{n} {what} but {len(getattr(layout, kind))} {kind}; give one per block")
    # A file in another encoding than it states leaves halves of characters, which cannot be written to a file.
    note = "characters that the file's encoding does not have are shown as \ufffd"
    for kind in ("names", "groups", "roles", "materials"):
        words = getattr(layout, kind)
        whole = tuple(_HALVES.sub("\ufffd", word) for word in words)
        if whole != tuple(words) and note not in layout.notes:
            object.__setattr__(layout, "notes", (*layout.notes, note))
        object.__setattr__(layout, kind, whole)


@dataclass(frozen=True, kw_only=True)
class LabelledBlocks:
    """Blocks of a drawing, with their names, groups, roles, materials and density.

    Attributes
    ----------
    groups : tuple of str
        Physical group, layer, object group or part of each block, "" for none.
    roles : tuple of str
        "free", "fixed", "moving", or "" where the file says nothing.
    materials : tuple of str
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

    groups: tuple[str, ...] = ()
    roles: tuple[str, ...] = ()
    materials: tuple[str, ...] = ()
    density: np.ndarray | None = None
    unit: str = "m"
    notes: tuple[str, ...] = ()
    source: str = ""
    left_out: tuple[LeftOut, ...] = ()

    #: What holds the shapes, and the number of coordinates.
    shapes_in: ClassVar[str]
    dimension: ClassVar[int]

    def __post_init__(self) -> None:
        """Check that there is one entry per block, and replace broken characters."""
        check_labels(self, self.n_blocks, self.shapes_in)

    @property
    def n_blocks(self) -> int:
        """Number of blocks."""
        return len(getattr(self, self.shapes_in))

    def chosen(self, blocks: Sequence[int] | np.ndarray) -> Self:
        """Take only these blocks, in this order."""
        keep = [int(i) for i in blocks]
        of_blocks = {self.shapes_in, "names", "groups", "roles", "materials", "thickness", "density"}
        taken: dict[str, Any] = {}
        for value in (field.name for field in fields(self) if field.name in of_blocks):
            of = getattr(self, value)
            taken[value] = tuple(of[i] for i in keep) if isinstance(of, tuple) else of if of is None else of[keep]
        return replace(self, **taken)
