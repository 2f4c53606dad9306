"""What is not read, and how to get from there to what is: which program exports what."""

from __future__ import annotations

_CAD = "save it as .dxf in the program that drew it (SAVEAS), or turn it by the ODA File Converter, free of charge"
_REVIT = "in Revit: File, Export, CAD Formats, DXF, of an elevation; of a 3D view with solids as polymesh"
_SOLIDS = "export its bodies as STEP (.step, read with the extra 'cad') in the program that drew it, or in FreeCAD"
_MODEL = "export it as .obj or .glb, one object per block, from the program that made it, or from Blender"
_VECTORS = "open it in Inkscape, or the program that drew it, and save it as plain SVG (.svg)"
_CLOUD = (
    "points are no stones: outline each as a polygon over its image (QGIS: .gpkg, CAD: .dxf), or give closed meshes"
)
_MAP = "export the layer of stones from QGIS as GeoPackage (.gpkg), in metres"
_TABLE = 'a table has no outlines; write .json: {"blocks": [{"name": "a", "outline": [[0, 0], [1, 0], [1, 1]]}]}'

#: By suffix.
ELSEWHERE = {
    ".3dm": "in Rhino: Export Selected, of closed solids as .obj (one object per block), of outlines as .dxf",
    ".gh": "in Rhino: bake the blocks, then Export Selected, of closed solids as .obj, of outlines as .dxf",
    ".skp": "in SketchUp: make each block a solid group, then File, Export, 3D Model: .obj, or .dae (extra 'dae')",
    ".ifc": "in Blender with Bonsai, or FreeCAD: export the blocks as .obj, one object each; most IFC models hold "
    "walls, no blocks, of which an elevation as .dxf or .svg gives the outline",
    ".pdf": "open it in Inkscape (File, Import), delete what is no stone, and save it as plain SVG (.svg)",
    ".blend": "in Blender: File, Export, Wavefront (.obj), one object per block",
    ".unv": "in gmsh: File, Open, then File, Export as .msh (gmsh a.unv -save -o a.msh)",
    ".toml": "it is a case or a study; give the drawing that it names under [geometry] file",
    **dict.fromkeys((".dbf", ".shx", ".prj"), "give the .shp beside it"),
    **dict.fromkeys((".rvt", ".rfa"), _REVIT),
    **dict.fromkeys((".dwg", ".dgn", ".pln"), _CAD),
    **dict.fromkeys(
        (".iges", ".igs", ".sat", ".x_t", ".x_b", ".fcstd", ".ipt", ".iam", ".f3d", ".sldprt", ".sldasm", ".catpart"),
        _SOLIDS,
    ),
    **dict.fromkeys((".fbx", ".3ds", ".max", ".gltf", ".usd", ".usdz", ".wrl", ".3mf", ".x3d"), _MODEL),
    **dict.fromkeys((".ai", ".eps", ".ps", ".cdr", ".emf"), _VECTORS),
    **dict.fromkeys((".kml", ".kmz", ".gml", ".tab", ".mif", ".qgz", ".qgs"), _MAP),
    **dict.fromkeys((".las", ".laz", ".e57", ".pts", ".ptx", ".rcp"), _CLOUD),
    **dict.fromkeys((".csv", ".xlsx", ".xls", ".ods"), _TABLE),
    ".vtkhdf": "it holds a path in time; give the results folder, or of an increment increments/blocks_*.vtu in it",
}

#: What is read, in a line.
FAMILIES = (
    "drawings .dxf .svg, outlines .geojson .gpkg .shp, bodies .obj .stl .ply .glb .dae .step, meshes .msh .vtu .inp, "
    "COMPAS .json, 3DEC .3ddat; docs/formats.md has all"
)


def cannot_read(suffix: str) -> str:
    """Say in words that files of a suffix, "" for none, are not read, and what to do.

    Examples
    --------
    >>> cannot_read(".dbf")
    "'.dbf' is not read: give the .shp beside it"
    """
    if suffix in ELSEWHERE:
        return f"'{suffix}' is not read: {ELSEWHERE[suffix]}"
    called = f"'{suffix}'" if suffix else "a file without suffix"
    return f"{called} is not read; give {FAMILIES}"
