"""Options of a reader."""

from __future__ import annotations

from dataclasses import dataclass


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
    """

    unit: str | None = None
    chord_tolerance: float | None = None
    view: str | None = None
