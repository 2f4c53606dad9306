"""VTK files that a viewer can open while a run still writes them."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path
from xml.sax.saxutils import quoteattr

from vtkmodules.vtkCommonDataModel import vtkUnstructuredGrid
from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridWriter

from .atomic_files import write_whole


def write_vtu(
    dataset: vtkUnstructuredGrid, path: str | os.PathLike[str], *, last: bool = True, durable: bool = True
) -> Path:
    """Write a dataset as VTU, whole or not at all.

    Parameters
    ----------
    dataset : vtkUnstructuredGrid
        As those of pyvista are.
    path : path
        Its folder is made if it does not exist.
    last, durable : bool
        As of :func:`blockvis.atomic_files.whole_file`.

    Returns
    -------
    pathlib.Path

    Notes
    -----
    The format is inline binary with zlib and 64-bit headers, which ParaView from 5.11 on, pyvista and meshio read.
    Appended raw data, VTK's default, fails in ParaView 5.11 above some 10 kB.
    """
    writer = vtkXMLUnstructuredGridWriter()
    writer.SetInputData(dataset)
    # Written into memory first: on a full disk VTK's own writer ends the process.
    writer.WriteToOutputStringOn()
    writer.SetDataModeToBinary()
    writer.SetCompressorTypeToZLib()
    writer.SetHeaderTypeToUInt64()
    if writer.Write() != 1:
        raise OSError(f"VTK could not write {path}")
    return write_whole(path, writer.GetOutputString(), last=last, durable=durable)


def write_pvd(
    path: str | os.PathLike[str],
    entries: Iterable[tuple[float, str | os.PathLike[str]]],
    *,
    last: bool = True,
    durable: bool = True,
) -> Path:
    """Write the list of files of a time series (PVD), whole or not at all.

    Parameters
    ----------
    path : path
    entries : iterable of (time, file)
        Files as given, relative to the folder of ``path``.
    last, durable : bool
        As of :func:`blockvis.atomic_files.whole_file`.

    Returns
    -------
    pathlib.Path
    """
    lines = [
        '<?xml version="1.0"?>',
        '<VTKFile type="Collection" version="0.1" byte_order="LittleEndian">',
        "  <Collection>",
        *(
            f'    <DataSet timestep="{time:.12g}" group="" part="0" file={quoteattr(Path(file).as_posix())}/>'
            for time, file in entries
        ),
        "  </Collection>",
        "</VTKFile>",
    ]
    return write_whole(path, "\n".join(lines) + "\n", last=last, durable=durable)


def is_whole(path: Path) -> bool:
    """Whether a VTK file is there to its last tag."""
    if not path.is_file():
        return False
    with path.open("rb") as file:
        file.seek(max(path.stat().st_size - 64, 0))
        return file.read().rstrip().endswith(b"</VTKFile>")
