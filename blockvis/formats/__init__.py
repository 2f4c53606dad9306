"""Layout files: which module reads and writes which suffix.

A reader takes the path and a :class:`Reading` and returns a ``Drawing`` in the file's own unit of length, which it
names in ``Drawing.unit`` ("" where the file does not say). A writer takes a ``Drawing`` in m and the path.
"""

from __future__ import annotations

import importlib
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from blockvis.drawing import Drawing

__all__ = ["FORMATS", "Format", "Reading", "read", "write"]


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


@dataclass(frozen=True)
class Format:
    """One family of files: the module that knows it and what it can do."""

    module: str
    reads: bool = True
    writes: bool = False


FORMATS = {
    ".msh": Format("gmsh_mesh", writes=True),
    ".json": Format("layout_json", writes=True),
}


def read(path: Path, reading: Reading) -> Drawing:
    """Reads a file through the module that its suffix names."""
    return importlib.import_module(f".{_format(path, 'read').module}", __name__).read(path, reading)


def write(drawing: Drawing, path: Path) -> None:
    """Writes a file through the module that its suffix names."""
    importlib.import_module(f".{_format(path, 'write').module}", __name__).write(drawing, path)


def _format(path: Path, verb: str) -> Format:
    suffix = path.suffix.lower()
    known = FORMATS.get(suffix)
    if known is None or not (known.reads if verb == "read" else known.writes):
        able = sorted(key for key, value in FORMATS.items() if (value.reads if verb == "read" else value.writes))
        raise ValueError(f"'{path}': cannot {verb} '{suffix or 'a file without suffix'}'; use one of {' '.join(able)}")
    return known
