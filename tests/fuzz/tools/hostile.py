"""Files made to harm: entity and zip bombs, absurd counts, endless nesting, paths that lead out of the folder."""

from __future__ import annotations

import base64
import io
import struct
import zipfile
import zlib
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np

LAUGHS = (
    '<!DOCTYPE lolz [<!ENTITY a "haha">'
    + "".join(f'<!ENTITY {chr(98 + k)} "{f"&{chr(97 + k)};" * 10}">' for k in range(9))
    + "]>"
)
OUTSIDE = '<!DOCTYPE x [<!ENTITY a SYSTEM "file:///etc/passwd">]>'

SVG = '<svg xmlns="http://www.w3.org/2000/svg" width="9" height="9" viewBox="0 0 9 9">{}</svg>'
BOX = '<path d="M0 0H1V1H0Z"/>'

VTU = (
    '<VTKFile type="UnstructuredGrid" version="1.0" byte_order="LittleEndian" header_type="UInt64"{more}>'
    '<UnstructuredGrid><Piece NumberOfPoints="{points}" NumberOfCells="{cells}">{content}</Piece></UnstructuredGrid>{tail}'
    "</VTKFile>"
)
TRIANGLE = (
    '<Points><DataArray type="Float64" NumberOfComponents="3" format="ascii">0 0 0 1 0 0 0 1 0</DataArray></Points>'
    '<Cells><DataArray type="Int64" Name="connectivity" format="ascii">0 1 2</DataArray>'
    '<DataArray type="Int64" Name="offsets" format="ascii">3</DataArray>'
    '<DataArray type="UInt8" Name="types" format="ascii">5</DataArray></Cells>'
)


def _vtu(head: str = "", text: str = "", **given: object) -> str:
    values: dict[str, object] = {"points": 3, "cells": 1, "content": TRIANGLE + text, "tail": "", "more": ""}
    return head + VTU.format(**(values | given))


def _compressed(size: int) -> bytes:
    """An array of zeros as VTK packs it: number of chunks, their size, the last one's, and what each packs to."""
    chunk = 1 << 20
    packed = zlib.compress(bytes(chunk), 9)
    count = size // chunk
    head = struct.pack(f"<{3 + count}Q", count, chunk, 0, *([len(packed)] * count))
    return base64.b64encode(head) + base64.b64encode(packed * count)


def vtu_zip_bomb() -> bytes:
    """Half a megabyte that unpacks to 24 GB: a hundred arrays that share one place in the file."""
    points = 10_000_000
    data = _compressed(points * 24).decode()
    arrays = "".join(
        f'<DataArray type="Float64" Name="a{k}" NumberOfComponents="3" format="appended" offset="0"/>'
        for k in range(100)
    )
    content = f'<PointData>{arrays}</PointData><Points><DataArray type="Float64" NumberOfComponents="3" format="appended" offset="0"/></Points>'
    content += TRIANGLE[TRIANGLE.index("<Cells>") :]
    tail = f'<AppendedData encoding="base64">_{data}</AppendedData>'
    return _vtu(points=points, content=content, tail=tail, more=' compressor="vtkZLibDataCompressor"').encode()


@cache
def npz_bomb() -> bytes:
    """A megabyte that unpacks to a gigabyte and a half."""
    buffer = io.BytesIO()
    with (
        zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as archive,
        archive.open("vertices.npy", "w") as file,
    ):
        head = io.BytesIO()
        np.lib.format.write_array_header_1_0(head, {"descr": "<f8", "fortran_order": False, "shape": (200_000_000,)})
        file.write(head.getvalue())
        for _ in range(1600):
            file.write(bytes(1_000_000))
    return buffer.getvalue()


def npz_absurd(shape: tuple[int, ...] = (1 << 50,)) -> bytes:
    """An array that announces a petabyte and holds nothing."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name in ("vertices", "offsets", "names", "tree"):
            head = io.BytesIO()
            np.lib.format.write_array_header_1_0(head, {"descr": "<f8", "fortran_order": False, "shape": shape})
            archive.writestr(f"{name}.npy", head.getvalue())
    return buffer.getvalue()


def _glb(count: int, length: int | None = None) -> bytes:
    import json

    tree = json.dumps(
        {
            "asset": {"version": "2.0"},
            "scenes": [{"nodes": [0]}],
            "nodes": [{"mesh": 0}],
            "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 0}]}],
            "accessors": [{"componentType": 5126, "count": count, "type": "VEC3"}],
            "bufferViews": [],
            "buffers": [{"byteLength": count, "uri": "../../../../etc/passwd"}],
        }
    ).encode()
    tree += b" " * (-len(tree) % 4)
    return struct.pack("<4sIIII", b"glTF", 2, 20 + len(tree), length or len(tree), 0x4E4F534A) + tree


def _dxf(entities: str, blocks: str = "") -> str:
    header = "0\nSECTION\n2\nHEADER\n9\n$ACADVER\n1\nAC1009\n0\nENDSEC\n"
    return f"{header}0\nSECTION\n2\nBLOCKS\n{blocks}0\nENDSEC\n0\nSECTION\n2\nENTITIES\n{entities}0\nENDSEC\n0\nEOF\n"


def _dxf_block(name: str, content: str) -> str:
    return f"0\nBLOCK\n8\n0\n2\n{name}\n70\n0\n10\n0\n20\n0\n30\n0\n3\n{name}\n{content}0\nENDBLK\n8\n0\n"


def _dxf_insert(name: str, x: int = 0, more: str = "") -> str:
    return f"0\nINSERT\n8\n0\n2\n{name}\n10\n{x}\n20\n0\n30\n0\n{more}"


DXF_SQUARE = (
    "0\nPOLYLINE\n8\n0\n66\n1\n70\n1\n10\n0\n20\n0\n30\n0\n"
    + "".join(f"0\nVERTEX\n8\n0\n10\n{x}\n20\n{y}\n30\n0\n" for x, y in ((0, 0), (1, 0), (1, 1), (0, 1)))
    + "0\nSEQEND\n8\n0\n"
)


def _dxf_inserts(depth: int = 9) -> str:
    """Blocks that insert each other ten times each: a billion squares."""
    blocks = _dxf_block("B0", DXF_SQUARE)
    for k in range(1, depth + 1):
        blocks += _dxf_block(f"B{k}", "".join(_dxf_insert(f"B{k - 1}", 2 * n) for n in range(10)))
    return _dxf(_dxf_insert(f"B{depth}"), blocks)


def _dxf_array() -> str:
    """One insert with thirty thousand rows of thirty thousand."""
    return _dxf(_dxf_insert("B0", 0, "70\n30000\n71\n30000\n44\n2\n45\n2\n"), _dxf_block("B0", DXF_SQUARE))


def _ply(header: str, data: bytes = b"") -> bytes:
    return f"ply\nformat binary_little_endian 1.0\n{header}end_header\n".encode() + data


_PLY_VERTEX = "element vertex {}\nproperty float x\nproperty float y\nproperty float z\n"
_PLY_FACE = "element face {}\nproperty list {} int vertex_indices\n"


def _pvd(file: str) -> str:
    return f'<VTKFile type="Collection" version="0.1"><Collection><DataSet timestep="0" part="0" file="{file}"/></Collection></VTKFile>'


def _vtm(file: str) -> str:
    return (
        '<VTKFile type="vtkMultiBlockDataSet" version="1.0"><vtkMultiBlockDataSet>'
        f'<DataSet index="0" file="{file}"/></vtkMultiBlockDataSet></VTKFile>'
    )


MSH = b"$MeshFormat\n4.1 1 8\n" + struct.pack("<i", 1) + b"\n$EndMeshFormat\n"

#: Layout files by name; the suffix says which reader gets them. Nothing in them may be read as a drawing.
FILES: dict[str, Callable[[], str | bytes]] = {
    "laughs.svg": lambda: LAUGHS + SVG.format(f"<title>&j;</title>{BOX}"),
    "laughs-utf16.svg": lambda: (LAUGHS + SVG.format(f"<title>&j;</title>{BOX}")).encode("utf-16"),
    "outside.svg": lambda: OUTSIDE + SVG.format(f"<title>&a;</title>{BOX}"),
    "nested.svg": lambda: SVG.format("<g>" * 200_000 + BOX + "</g>" * 200_000),
    "uses.svg": lambda: SVG.format(
        "".join(f'<g id="g{k}">' + f'<use href="#g{k - 1}"/>' * 10 + "</g>" for k in range(1, 10))
        + f'<g id="g0">{BOX}</g><use href="#g9"/>'
    ),
    "numbers.svg": lambda: SVG.format(f'<path d="M{"9" * 2_000_000} 0H1V1Z"/>'),
    "spaces.svg": lambda: SVG.format(f'<path d="M0 0 L{" " * 200_000}x" transform="matrix({"1," * 200_000}"/>'),
    "arcs.svg": lambda: SVG.format('<path d="M0 0' + "A1e-300 1e300 0 1 1 1 1" * 20_000 + 'Z"/>'),
    "laughs.vtu": lambda: _vtu(LAUGHS, "<FieldData>&j;</FieldData>"),
    "laughs-utf16.vtu": lambda: _vtu(LAUGHS, "<FieldData>&j;</FieldData>").encode("utf-16"),
    "laughs-late.vtu": lambda: f"<!--{' ' * 5_000_000}-->" + _vtu(LAUGHS, "<FieldData>&j;</FieldData>"),
    "outside.vtu": lambda: _vtu(OUTSIDE, "<FieldData>&a;</FieldData>"),
    "points.vtu": lambda: _vtu(points=10**15),
    "points-late.vtu": lambda: f"<!--{' ' * 5_000_000}-->" + _vtu(points=4 * 10**9),
    "points-quoted.vtu": lambda: _vtu(points=10**12).replace('"', "'"),
    "cells.vtu": lambda: _vtu(cells=10**14),
    "negative.vtu": lambda: _vtu(points=-5, cells=-7),
    "components.vtu": lambda: _vtu().replace('NumberOfComponents="3"', 'NumberOfComponents="2000000000"'),
    "connectivity.vtu": lambda: _vtu().replace(">0 1 2<", ">0 1 999999999999<"),
    "zip-bomb.vtu": vtu_zip_bomb,
    "offsets.vtu": lambda: _vtu().replace(">3</", ">999999999999</"),
    "offsets-back.vtu": lambda: _vtu().replace(">3</", ">-3</"),
    "connectivity-back.vtu": lambda: _vtu().replace(">0 1 2<", ">0 1 -9<"),
    "extent.vtk": lambda: (
        "# vtk DataFile Version 3.0\nx\nASCII\nDATASET STRUCTURED_GRID\nDIMENSIONS -9 -9 -9\nPOINTS 1 double\n0 0 0\n"
    ),
    "nested.vtu": lambda: "<a>" * 300_000,
    "tuples.vtu": lambda: _vtu(
        text='<FieldData><DataArray type="Float64" Name="a" NumberOfTuples="99999999999" format="ascii">1</DataArray></FieldData>'
    ),
    "laughs.vtp": lambda: _vtu(LAUGHS, "<FieldData>&j;</FieldData>").replace("UnstructuredGrid", "PolyData"),
    "points.vtk": lambda: "# vtk DataFile Version 3.0\nx\nASCII\nDATASET POLYDATA\nPOINTS 99999999999 double\n0 0 0\n",
    "polygons.vtk": lambda: (
        "# vtk DataFile Version 3.0\nx\nASCII\nDATASET POLYDATA\nPOINTS 3 double\n0 0 0 1 0 0 0 1 0\nPOLYGONS 99999999 99999999999\n3 0 1 2\n"
    ),
    "indices.vtk": lambda: (
        "# vtk DataFile Version 3.0\nx\nASCII\nDATASET POLYDATA\nPOINTS 3 double\n0 0 0 1 0 0 0 1 0\nPOLYGONS 1 4\n3 0 1 99999999\n"
    ),
    "grid.vtk": lambda: (
        "# vtk DataFile Version 3.0\nx\nBINARY\nDATASET STRUCTURED_POINTS\nDIMENSIONS 99999 99999 99999\nORIGIN 0 0 0\nSPACING 1 1 1\n"
    ),
    "lower.vtk": lambda: "# vtk DataFile Version 3.0\nx\nASCII\ndataset polydata\npoints 9999999999 double\n0 0 0\n",
    "array.vtk": lambda: (
        "# vtk DataFile Version 3.0\nx\nASCII\nDATASET POLYDATA\nPOINTS 3 double\n0 0 0 1 0 0 0 1 0\nPOLYGONS 1 4\n3 0 1 2\nFIELD f 1\na 99999 9999999 double\n1\n"
    ),
    "outside.pvd": lambda: _pvd("../outside.vtu"),
    "absolute.pvd": lambda: _pvd("/etc/hostname"),
    "laughs.pvd": lambda: LAUGHS + _pvd("&j;"),
    "itself.pvd": lambda: _pvd("itself.pvd"),
    "outside.vtm": lambda: _vtm("../outside.vtu"),
    "absolute.vtm": lambda: _vtm("/etc/hostname"),
    "itself.vtm": lambda: _vtm("itself.vtm"),
    "count.stl": lambda: bytes(80) + struct.pack("<I", 0xFFFFFFFF) + bytes(100),
    "nan.stl": lambda: bytes(80) + struct.pack("<I", 4) + struct.pack("<12fH", *([float("nan")] * 12), 0) * 4,
    "vertices.ply": lambda: _ply(_PLY_VERTEX.format(10**13) + _PLY_FACE.format(1, "uchar")),
    "faces.ply": lambda: _ply(_PLY_VERTEX.format(3) + _PLY_FACE.format(4 * 10**9, "uchar"), bytes(40)),
    "list.ply": lambda: _ply(_PLY_VERTEX.format(3) + _PLY_FACE.format(1, "uint"), bytes(36) + b"\xff\xff\xff\x7f"),
    "count.off": lambda: "OFF\n99999999999 99999999999 0\n0 0 0\n",
    "face.off": lambda: "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n999999999 0 1 2\n",
    "index.obj": lambda: "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 99999999999\n",
    "outside.obj": lambda: "mtllib ../../../../etc/passwd\nusemtl root\nv 0 0 0\nv 1 0 0\nf 1 2 2\n",
    "count.glb": lambda: _glb(4 * 10**9),
    "length.glb": lambda: _glb(3, 0xFFFFFFF0),
    "nodes.msh": lambda: MSH + b"$Nodes\n" + struct.pack("<4Q", 1, 1 << 60, 1, 1 << 60),
    "block.msh": lambda: MSH + b"$Nodes\n" + struct.pack("<4Q", 1, 4, 1, 4) + struct.pack("<3iQ", 2, 1, 0, 1 << 61),
    "entities.msh": lambda: MSH + b"$Entities\n" + struct.pack("<4Q", 1 << 60, 1 << 60, 1 << 60, 0),
    "elements.msh": lambda: MSH + b"$Elements\n" + struct.pack("<4Q", 1 << 62, 1 << 62, 1, 1),
    "ascii.msh": lambda: "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n99999999999\n1 0 0 0\n",
    "nested.json": lambda: "[" * 1_000_000,
    "nested-blocks.json": lambda: '{"blocks": ' + '[{"outline": ' * 100_000,
    "digits.json": lambda: '{"blocks": [{"name": "a", "outline": [[' + "9" * 100_000 + ", 0], [1, 0], [1, 1]]}]}",
    "infinite.json": lambda: '{"blocks": [{"name": "a", "outline": [[Infinity, 0], [1, 0], [NaN, 1]]}]}',
    "inserts.dxf": _dxf_inserts,
    "array.dxf": _dxf_array,
    "itself.dxf": lambda: _dxf(_dxf_insert("B0"), _dxf_block("B0", _dxf_insert("B0"))),
    "circle.dxf": lambda: _dxf("0\nCIRCLE\n10\n0\n20\n0\n40\n1e300\n0\nCIRCLE\n10\n0\n20\n0\n40\n-1\n"),
    "include.inp": lambda: "*NODE\n1, 0, 0, 0\n*INCLUDE, INPUT=../outside.inp\n",
    "itself.inp": lambda: "*NODE\n1, 0, 0, 0\n*INCLUDE, INPUT=itself.inp\n",
    "laughs.xdmf": lambda: f'{LAUGHS}<Xdmf Version="3.0"><Domain><Grid Name="&j;"/></Domain></Xdmf>',
    "count.xdmf": lambda: (
        '<Xdmf Version="3.0"><Domain><Grid><Geometry GeometryType="XYZ"><DataItem DataType="Float" Dimensions="99999999999 3" Format="XML">0 0 0</DataItem></Geometry></Grid></Domain></Xdmf>'
    ),
    "outside.xdmf": lambda: (
        '<Xdmf Version="3.0"><Domain><Grid><Geometry GeometryType="XYZ"><DataItem DataType="Float" Dimensions="3 3" Format="Binary">/etc/passwd</DataItem></Geometry></Grid></Domain></Xdmf>'
    ),
    "laughs.xml": lambda: f'{LAUGHS}<dolfin><mesh celltype="triangle" dim="2">&j;</mesh></dolfin>',
    "count.mesh": lambda: "MeshVersionFormatted 2\nDimension 2\nVertices\n99999999999\n0 0 0\n",
    "count.meshb": lambda: struct.pack("<9i", 1, 2, 3, 20, 2, 4, 0x7FFFFFFF, 0x7FFFFFF0, 0x7FFFFFF0),
    "count.su2": lambda: "NDIME= 2\nNELEM= 99999999999\n5 0 1 2 0\nNPOIN= 99999999999\n0 0 0\n",
    "count.ugrid": lambda: "99999999 99999999 99999999 0 0 0 0\n0 0 0\n",
    "count.avs": lambda: "99999999999 99999999999 0 0 0\n1 0 0 0\n",
    "count.vol": lambda: "mesh3d\ndimension\n2\npoints\n99999999999\n0 0 0\n",
    "count.tec": lambda: 'VARIABLES="X","Y"\nZONE N=99999999999, E=99999999999, F=FEPOINT, ET=TRIANGLE\n0 0\n',
    "count.wkt": lambda: "TIN (((" + "0 0 0, " * 10,
    "call.geo": lambda: 'Point(1) = {0, 0, 0}; SystemCall "touch harmed";',
    "merge.geo": lambda: 'Merge "/etc/passwd";',
}


def written(folder: Path) -> list[Path]:
    """Writes all the files into a folder beside one that they may not reach; gives their paths."""
    inside = folder / "inside"
    inside.mkdir()
    (folder / "outside.vtu").write_text(_vtu(), encoding="utf-8")
    (folder / "outside.inp").write_text(
        "*NODE\n1, 0, 0, 0\n2, 1, 0, 0\n3, 0, 1, 0\n*ELEMENT, TYPE=CPS3\n1, 1, 2, 3\n", encoding="utf-8"
    )
    paths = []
    for name, content in FILES.items():
        data = content()
        path = inside / name
        path.write_bytes(data.encode() if isinstance(data, str) else data)
        paths.append(path)
    return paths
