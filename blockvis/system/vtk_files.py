"""VTK files that a viewer can open while a run still writes them."""

from __future__ import annotations

import base64
import html
import os
import re
import zlib
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .atomic_files import write_atomic

if TYPE_CHECKING:
    # VTK is loaded where its files are written: lists of files need none.
    from vtkmodules.vtkCommonCore import vtkStringArray
    from vtkmodules.vtkCommonDataModel import vtkUnstructuredGrid

#: Arrays of polyhedra as VTK 9.4 and later write them.
_FACES = re.compile(r'<DataArray [^>]*Name="face_connectivity".*Name="polyhedron_offsets"[^>]*>.*?</DataArray>', re.S)


def write_vtu(
    dataset: vtkUnstructuredGrid, path: str | os.PathLike[str], *, strings: bool = True, durable: bool = True
) -> Path:
    """Write a dataset as VTU, whole or not at all.

    Parameters
    ----------
    dataset : vtkUnstructuredGrid
        As those of pyvista are.
    path : path
        Its folder is made if it does not exist.
    strings : bool
        Whether arrays of strings are written as such, which meshio does not read; otherwise each is a field array of
        bytes, its strings in UTF-8 with a line feed after each, and polyhedra are in the order of their numbers of
        corners: meshio gives their data to others otherwise.

    Notes
    -----
    The format is inline binary with zlib and 64-bit headers, which ParaView from 5.11 on, pyvista and meshio read.
    Appended raw data, VTK's default, fails in ParaView 5.11 above some 10 kB. Faces of polyhedra stand in the arrays
    ``faces`` and ``faceoffsets`` of version 1.0: those that VTK writes since 9.4 older ParaViews do not know.
    """
    from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridWriter

    if not strings:
        dataset = _by_corners(_with_bytes(dataset))
    writer = vtkXMLUnstructuredGridWriter()
    writer.SetInputData(dataset)
    # Written into memory first: on a full disk VTK's own writer ends the process.
    writer.WriteToOutputStringOn()
    writer.SetDataModeToBinary()
    writer.SetCompressorTypeToZLib()
    writer.SetHeaderTypeToUInt64()
    if writer.Write() != 1:
        raise OSError(f"VTK could not write {path}")
    text = writer.GetOutputString()
    if dataset.GetPolyhedronFaces() is not None:
        text = _FACES.sub(lambda _: _face_arrays(dataset), text, count=1)
        text = text.replace('version="2.3"', 'version="1.0"', 1)
    return write_atomic(path, text, durable=durable)


def string_array(name: str, words: Iterable[str]) -> vtkStringArray:
    """Make a VTK array of strings; pyvista's own conversion refuses anything but ASCII."""
    from vtkmodules.vtkCommonCore import vtkStringArray

    array = vtkStringArray()
    array.SetName(name)
    for word in words:
        array.InsertNextValue(str(word))
    return array


def arrays_of(dataset: vtkUnstructuredGrid) -> list[tuple[Any, Any]]:
    """List the arrays of points, cells and the whole dataset, each after the data that it belongs to."""
    every = (dataset.GetPointData(), dataset.GetCellData(), dataset.GetFieldData())
    return [(data, data.GetAbstractArray(k)) for data in every for k in range(data.GetNumberOfArrays())]


def _with_bytes(dataset: vtkUnstructuredGrid) -> vtkUnstructuredGrid:
    """Make a copy of a dataset with bytes among the field data in place of arrays of strings."""
    from vtkmodules.util.numpy_support import numpy_to_vtk
    from vtkmodules.vtkCommonCore import vtkStringArray

    copy = dataset.NewInstance()
    copy.ShallowCopy(dataset)
    for attributes, array in arrays_of(copy):
        if isinstance(array, vtkStringArray):
            text = "".join(f"{array.GetValue(k)}\n" for k in range(array.GetNumberOfValues()))
            written = numpy_to_vtk(np.frombuffer(text.encode(), dtype=np.uint8), deep=True)
            written.SetName(array.GetName())
            attributes.RemoveArray(array.GetName())
            copy.GetFieldData().AddArray(written)
    return copy


def _by_corners(dataset: vtkUnstructuredGrid) -> vtkUnstructuredGrid:
    """Make a copy of a dataset with polyhedra in the order of their numbers of corners; others are left."""
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkCommonCore import vtkIdList
    from vtkmodules.vtkCommonDataModel import VTK_POLYHEDRON

    if dataset.GetPolyhedronFaces() is None:
        return dataset
    order = np.argsort(np.diff(vtk_to_numpy(dataset.GetCells().GetOffsetsArray())), kind="stable")
    copy, faces = dataset.NewInstance(), vtkIdList()
    copy.SetPoints(dataset.GetPoints())
    copy.Allocate(len(order))
    copy.GetPointData().ShallowCopy(dataset.GetPointData())
    copy.GetCellData().CopyAllocate(dataset.GetCellData())
    copy.SetFieldData(dataset.GetFieldData())
    for place, cell in enumerate(order.tolist()):
        dataset.GetFaceStream(cell, faces)
        copy.InsertNextCell(VTK_POLYHEDRON, faces)
        copy.GetCellData().CopyData(dataset.GetCellData(), cell, place)
    return copy


def _face_arrays(dataset: vtkUnstructuredGrid) -> str:
    """Write the faces of polyhedra as streams: of each the number of its faces, of each face its points."""
    from vtkmodules.util.numpy_support import vtk_to_numpy

    points, starts, _, cells = (
        vtk_to_numpy(array).astype(np.int64)
        for of in (dataset.GetPolyhedronFaces(), dataset.GetPolyhedronFaceLocations())
        for array in (of.GetConnectivityArray(), of.GetOffsetsArray())
    )
    with_sizes = np.insert(points, starts[:-1], np.diff(starts))
    # Where each cell begins among the sizes and points, and where it ends with the count of its faces before it.
    begin = starts[cells] + cells
    stream = np.insert(with_sizes, begin[:-1], np.diff(cells))
    ends = begin[1:] + np.arange(1, len(cells))
    return "\n        ".join(
        f'<DataArray type="Int64" Name="{name}" format="binary">{_encoded(values)}</DataArray>'
        for name, values in (("faces", stream), ("faceoffsets", ends))
    )


def _encoded(values: np.ndarray) -> str:
    """Write 64-bit integers as VTK does: sizes, and one block of zlib, both in base 64."""
    data = values.astype("<i8").tobytes()
    packed = zlib.compress(data)
    sizes = np.array([1, len(data), 0, len(packed)], dtype="<u8").tobytes()
    return base64.b64encode(sizes).decode("ascii") + base64.b64encode(packed).decode("ascii")


def write_pvd(
    path: str | os.PathLike[str],
    entries: Iterable[tuple[float, str | os.PathLike[str]]],
    *,
    last: bool = True,
    durable: bool = True,
) -> Path:
    """Write the list of files of a time series (PVD), relative to its folder, whole or not at all."""
    lines = [
        '<?xml version="1.0"?>',
        '<VTKFile type="Collection" version="0.1" byte_order="LittleEndian">',
        "  <Collection>",
        *(
            f'    <DataSet timestep="{time:.12g}" group="" part="0" file="{html.escape(Path(file).as_posix())}"/>'
            for time, file in entries
        ),
        "  </Collection>",
        "</VTKFile>",
    ]
    return write_atomic(path, "\n".join(lines) + "\n", last=last, durable=durable)


def is_complete(path: Path) -> bool:
    """Whether a VTK file is there to its last tag."""
    if not path.is_file():
        return False
    with path.open("rb") as file:
        file.seek(max(path.stat().st_size - 64, 0))
        return file.read().rstrip().endswith(b"</VTKFile>")
