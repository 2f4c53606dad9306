"""What is not read, and how to get from there to what is: which program exports what."""

from __future__ import annotations

_CAD = "save it as .dxf in the program that drew it (SAVEAS), or turn it by the ODA File Converter, free of charge"
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
    ".dwg": _CAD,
    ".dgn": _CAD,
    ".pln": _CAD,
    ".rvt": "in Revit: File, Export, CAD Formats, DXF, of an elevation; of a 3D view with solids as polymesh",
    ".rfa": "in Revit: File, Export, CAD Formats, DXF, of an elevation; of a 3D view with solids as polymesh",
    ".3dm": "in Rhino: Export Selected, of closed solids as .obj (one object per block), of outlines as .dxf",
    ".gh": "in Rhino: bake the blocks, then Export Selected, of closed solids as .obj, of outlines as .dxf",
    ".skp": "in SketchUp: make each block a solid group, then File, Export, 3D Model: .obj, or .dae (extra 'dae')",
    ".ifc": "in Blender with Bonsai, or FreeCAD: export the blocks as .obj, one object each; most IFC models hold "
    "walls, no blocks, of which an elevation as .dxf or .svg gives the outline",
    ".pdf": "open it in Inkscape (File, Import), delete what is no stone, and save it as plain SVG (.svg)",
    ".blend": "in Blender: File, Export, Wavefront (.obj), one object per block",
    ".iges": _SOLIDS,
    ".igs": _SOLIDS,
    ".sat": _SOLIDS,
    ".x_t": _SOLIDS,
    ".x_b": _SOLIDS,
    ".fcstd": _SOLIDS,
    ".ipt": _SOLIDS,
    ".iam": _SOLIDS,
    ".f3d": _SOLIDS,
    ".sldprt": _SOLIDS,
    ".sldasm": _SOLIDS,
    ".catpart": _SOLIDS,
    ".fbx": _MODEL,
    ".3ds": _MODEL,
    ".max": _MODEL,
    ".gltf": _MODEL,
    ".usd": _MODEL,
    ".usdz": _MODEL,
    ".wrl": _MODEL,
    ".3mf": _MODEL,
    ".x3d": _MODEL,
    ".ai": _VECTORS,
    ".eps": _VECTORS,
    ".ps": _VECTORS,
    ".cdr": _VECTORS,
    ".emf": _VECTORS,
    ".kml": _MAP,
    ".kmz": _MAP,
    ".gml": _MAP,
    ".tab": _MAP,
    ".mif": _MAP,
    ".qgz": _MAP,
    ".qgs": _MAP,
    ".dbf": "give the .shp beside it",
    ".shx": "give the .shp beside it",
    ".prj": "give the .shp beside it",
    ".las": _CLOUD,
    ".laz": _CLOUD,
    ".e57": _CLOUD,
    ".pts": _CLOUD,
    ".ptx": _CLOUD,
    ".rcp": _CLOUD,
    ".unv": "in gmsh: File, Open, then File, Export as .msh (gmsh a.unv -save -o a.msh)",
    ".csv": _TABLE,
    ".xlsx": _TABLE,
    ".xls": _TABLE,
    ".ods": _TABLE,
    ".toml": "it is a case or a study; give the drawing that it names under [geometry] file",
}

#: What is read, in a line.
FAMILIES = (
    "drawings .dxf .svg, outlines .geojson .gpkg .shp, bodies .obj .stl .ply .glb .dae .step, meshes .msh .vtu .inp, "
    "COMPAS .json, 3DEC .3ddat; docs/formats.md has all"
)


def cannot_read(suffix: str) -> str:
    """Say in words that files of a suffix are not read, and what to do.

    Parameters
    ----------
    suffix : str
        With its dot, in small letters; "" for none.

    Examples
    --------
    >>> cannot_read(".dbf")
    "'.dbf' is not read: give the .shp beside it"
    """
    if suffix in ELSEWHERE:
        return f"'{suffix}' is not read: {ELSEWHERE[suffix]}"
    called = f"'{suffix}'" if suffix else "a file without suffix"
    return f"{called} is not read; give {FAMILIES}"
