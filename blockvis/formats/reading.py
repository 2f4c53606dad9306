"""Options of a reader."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from blockvis.layout.left_out import matches


@dataclass(frozen=True)
class Reading:
    """Options of a reader.

    Attributes
    ----------
    unit : str or None
        Unit of the file's lengths, if the caller gives it.
    chord_tolerance : float or None [m]
        Largest distance of an arc from its chords.
    view : {"xy", "xz", "yz"} or None
        Coordinates that become x and y; None for those that fit the drawing.
    ignore, only : tuple of str
        Layers, groups, materials and names, or patterns of them, that are left out, and beside which all others are.
        Readers of drawings ask :meth:`wants` for loose lines, which later are no lines any more; of outlines it is
        asked when all are read.
    """

    unit: str | None = None
    chord_tolerance: float | None = None
    view: str | None = None
    ignore: tuple[str, ...] = ()
    only: tuple[str, ...] = ()

    def wants(self, labels: Iterable[str]) -> bool:
        """Whether what has these labels is wanted."""
        labels = [label for label in labels if label]
        return not matches(labels, self.ignore) and (not self.only or matches(labels, self.only))
