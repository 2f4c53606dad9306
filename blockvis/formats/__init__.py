"""The table of layout formats: which module reads and writes which suffix.

A reader takes the path and a :class:`~blockvis.formats.reading.Reading` and returns a ``Layout``, or the ``Bodies`` of
a file that draws them in space, in the file's own unit of length, which it names in ``unit`` ("" if the file does not
state it). A writer takes a ``Layout`` in m and the path.
"""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["FORMATS", "Format"]


@dataclass(frozen=True)
class Format:
    """One family of files.

    Attributes
    ----------
    module : str
        In this room.
    reads, writes, writes_space : bool
        Whether it reads and writes them, also blocks in space.
    alone : bool
        Whether a file holds all blocks: in a folder of one file per stone it is something else, such as a picture.
    """

    module: str
    reads: bool = True
    writes: bool = False
    writes_space: bool = False
    alone: bool = False


_CAD = Format("gmsh_cad")
_PYVISTA = Format("pyvista_files")
_SOLID = Format("solids", writes=True, writes_space=True)
_MESHIO = Format("meshio_files")
_IMAGE = Format("images", alone=True)

#: By suffix. Every other suffix that meshio knows goes to meshio.
FORMATS = {
    ".msh": Format("gmsh_mesh", writes=True),
    ".json": Format("layout_json", writes=True, writes_space=True),
    ".geojson": Format("layout_json", writes=True),
    ".gpkg": Format("geodata"),
    ".shp": Format("geodata"),
    ".dxf": Format("dxf", writes=True),
    ".svg": Format("svg", writes=True),
    ".vtu": Format("pyvista_files", writes=True, writes_space=True),
    ".vtp": Format("pyvista_files", writes=True),
    ".vtk": Format("pyvista_files", writes=True, writes_space=True),
    ".vtm": _PYVISTA,
    ".vtmb": _PYVISTA,
    ".pvd": _PYVISTA,
    ".stl": _SOLID,
    ".obj": _SOLID,
    ".ply": _SOLID,
    ".off": Format("solids"),
    ".dae": Format("solids"),
    ".glb": _SOLID,
    ".3ddat": Format("threedec"),
    ".3dec": Format("threedec"),
    ".txt": Format("threedec", alone=True),
    ".geo": _CAD,
    ".geo_unrolled": _CAD,
    ".step": _CAD,
    ".stp": _CAD,
    ".brep": _CAD,
    ".png": _IMAGE,
    ".tif": _IMAGE,
    ".tiff": _IMAGE,
    ".jpg": _IMAGE,
    ".jpeg": _IMAGE,
    ".inp": _MESHIO,
    ".bdf": _MESHIO,
    ".fem": _MESHIO,
    ".nas": _MESHIO,
    ".med": _MESHIO,
    ".mesh": _MESHIO,
    ".meshb": _MESHIO,
    ".su2": _MESHIO,
    ".ugrid": _MESHIO,
    ".vol": _MESHIO,
    ".xdmf": _MESHIO,
    ".xmf": _MESHIO,
    ".mdpa": _MESHIO,
    ".avs": _MESHIO,
    ".cgns": _MESHIO,
    ".exo": _MESHIO,
    ".f3grid": _MESHIO,
    ".tec": _MESHIO,
    ".dat": Format("threedec"),
    ".wkt": _MESHIO,
    ".h5m": _MESHIO,
    ".xml": _MESHIO,
    ".post": _MESHIO,
    ".dato": _MESHIO,
    ".hmf": _MESHIO,
}
