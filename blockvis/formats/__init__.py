"""Layout files: which module reads and writes which suffix.

A reader takes the path and a :class:`Reading` and returns a ``Drawing`` in the file's own unit of length, which it
names in ``Drawing.unit`` ("" where the file does not say). A writer takes a ``Drawing`` in m and the path.
"""

from __future__ import annotations

import importlib
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from blockvis.whole_files import whole_file

if TYPE_CHECKING:
    from blockvis.drawing import Drawing

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


_CAD = Format("gmsh_cad")
_PYVISTA = Format("pyvista_files")
_SOLID = Format("solids", writes=True)
_MESHIO = Format("meshio_files")

#: By suffix. Every other suffix that meshio knows goes to meshio.
FORMATS = {
    ".msh": Format("gmsh_mesh", writes=True),
    ".json": Format("layout_json", writes=True),
    ".dxf": Format("dxf", writes=True),
    ".svg": Format("svg", writes=True),
    ".vtu": Format("pyvista_files", writes=True),
    ".vtp": Format("pyvista_files", writes=True),
    ".vtk": Format("pyvista_files", writes=True),
    ".vtm": _PYVISTA,
    ".pvd": _PYVISTA,
    ".stl": _SOLID,
    ".obj": _SOLID,
    ".ply": _SOLID,
    ".off": Format("solids"),
    ".glb": Format("solids"),
    ".geo": _CAD,
    ".geo_unrolled": _CAD,
    ".step": _CAD,
    ".stp": _CAD,
    ".brep": _CAD,
    ".inp": _MESHIO,
    ".bdf": _MESHIO,
    ".fem": _MESHIO,
    ".nas": _MESHIO,
    ".med": _MESHIO,
    ".mesh": _MESHIO,
    ".meshb": _MESHIO,
    ".su2": _MESHIO,
    ".ugrid": _MESHIO,
    ".unv": _MESHIO,
    ".vol": _MESHIO,
    ".xdmf": _MESHIO,
    ".xmf": _MESHIO,
    ".mdpa": _MESHIO,
    ".avs": _MESHIO,
    ".cgns": _MESHIO,
    ".exo": _MESHIO,
    ".f3grid": _MESHIO,
    ".tec": _MESHIO,
    ".dat": _MESHIO,
    ".wkt": _MESHIO,
    ".h5m": _MESHIO,
    ".xml": _MESHIO,
    ".post": _MESHIO,
    ".dato": _MESHIO,
    ".hmf": _MESHIO,
}


def read(path: Path, reading: Reading) -> Drawing:
    """Reads a file through the module that its suffix names."""
    return importlib.import_module(f".{_format(path, 'read').module}", __name__).read(path, reading)


def write(drawing: Drawing, path: Path) -> None:
    """Writes a file, whole or not at all, through the module that its suffix names."""
    module = importlib.import_module(f".{_format(path, 'write').module}", __name__)
    with whole_file(path) as partial:
        module.write(drawing, partial)


def _format(path: Path, verb: str) -> Format:
    suffix = path.suffix.lower()
    known = FORMATS.get(suffix)
    if known is None or not (known.reads if verb == "read" else known.writes):
        able = sorted(key for key, value in FORMATS.items() if (value.reads if verb == "read" else value.writes))
        raise ValueError(f"'{path}': cannot {verb} '{suffix or 'a file without suffix'}'; use one of {' '.join(able)}")
    return known
