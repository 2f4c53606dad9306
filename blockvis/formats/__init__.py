"""The table of layout formats: which module reads and writes which suffix.

A reader takes the path and a :class:`~blockvis.formats.reading.Reading` and returns a ``Layout``, or the ``Bodies`` of
a file that draws them in space, in the file's own unit of length, which it names in ``unit`` ("" if the file does not
state it); what it cannot read is a ``ValueError`` with the remedy, in which "it" is the file. A writer takes a
``Layout`` in m and the path.
"""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["FORMATS", "Format"]


@dataclass(frozen=True)
class Format:
    """One family of files: the module of this room, and whether it writes them, also blocks in space.

    ``shapes_only`` are files that hold no more of a block than its shape and name. ``alone`` are those of all blocks:
    in a folder of one file per stone such a file is something else, as a picture.
    """

    module: str
    writes: bool = False
    writes_space: bool = False
    shapes_only: bool = False
    alone: bool = False


#: By suffix.
FORMATS = {
    ".msh": Format("gmsh_mesh", writes=True),
    ".json": Format("layout_json", writes=True, writes_space=True),
    ".geojson": Format("layout_json", writes=True),
    ".dxf": Format("dxf", writes=True),
    ".svg": Format("svg", writes=True),
    ".vtu": Format("pyvista_files", writes=True, writes_space=True),
    ".vtp": Format("pyvista_files", writes=True),
    ".vtk": Format("pyvista_files", writes=True, writes_space=True),
    ".txt": Format("threedec", alone=True),
    **dict.fromkeys((".vtm", ".vtmb", ".pvd"), Format("pyvista_files")),
    **dict.fromkeys((".gpkg", ".shp"), Format("geodata")),
    ".stl": Format("solids", writes=True, writes_space=True, shapes_only=True),
    **dict.fromkeys((".obj", ".ply", ".glb"), Format("solids", writes=True, writes_space=True)),
    **dict.fromkeys((".off", ".dae"), Format("solids")),
    **dict.fromkeys((".3ddat", ".3dec", ".dat"), Format("threedec")),
    **dict.fromkeys((".geo", ".geo_unrolled", ".step", ".stp", ".brep"), Format("gmsh_cad")),
    **dict.fromkeys((".png", ".tif", ".tiff", ".jpg", ".jpeg", ".webp", ".bmp"), Format("images", alone=True)),
    **dict.fromkeys((
        ".inp", ".bdf", ".fem", ".nas", ".med", ".mesh", ".meshb", ".su2", ".ugrid", ".vol", ".xdmf", ".xmf",
        ".mdpa", ".avs", ".cgns", ".exo", ".f3grid", ".tec", ".wkt", ".h5m", ".xml", ".post", ".dato", ".hmf",
        ".e", ".ex2",
    ), Format("meshio_files")),
}  # fmt: skip
