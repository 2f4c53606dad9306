"""What the caller asks of a reader."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Reading:
    """What the caller asks of a reader.

    Attributes
    ----------
    unit : str or None
        Unit of the file's lengths, where the caller knows it.
    chord_tolerance : float or None [m]
        Largest distance of an arc from its chords.
    """

    unit: str | None = None
    chord_tolerance: float | None = None
