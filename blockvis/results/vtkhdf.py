"""All increments in one file: VTKHDF with time, for ParaView from 5.12 on and PyVista."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from vtkmodules.util.vtkAlgorithm import VTKPythonAlgorithmBase
from vtkmodules.vtkCommonCore import vtkStringArray
from vtkmodules.vtkCommonDataModel import vtkCompositeDataSet, vtkMultiBlockDataSet
from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline
from vtkmodules.vtkIOHDF import vtkHDFWriter

import solver
from blockvis.system.atomic_files import atomic_file
from blockvis.system.vtk_files import arrays_of

from .datasets import grids_of
from .mechanism_arrays import as_shown
from .viewer_files import output_times


def write_vtkhdf(response: solver.Response, path: Path) -> Path:
    """Write the path of a response as one .vtkhdf file: blocks, contact points, joints and ties, time is the parameter.

    VTK knows no strings in series: names are left out, ``block_id`` counts the blocks. Raises ``ValueError`` where
    nothing is in equilibrium, ``OSError`` where VTK cannot write the file.
    """
    if not response.path:
        raise ValueError(f"there is no path to write to '{path}': {response.message or response.stop}")
    source = _Series(response)
    writer = vtkHDFWriter()
    writer.SetInputConnection(source.GetOutputPort())
    writer.SetWriteAllTimeSteps(True)
    # As many values as a step has: longer pieces leave most of each empty.
    writer.SetChunkSize(max(len(response.assembly.vertices), 100))
    writer.SetCompressionLevel(4)
    with atomic_file(path) as partial:
        writer.SetFileName(str(partial))
        if writer.Write() != 1:
            raise OSError(f"VTK could not write '{path}'")
    return path


class _Series(VTKPythonAlgorithmBase):
    """The increments of a path as a pipeline of VTK asks for them, by their times."""

    def __init__(self, response: solver.Response) -> None:
        super().__init__(nInputPorts=0, nOutputPorts=1, outputType="vtkMultiBlockDataSet")
        self._response, self._times = response, output_times(response.path)

    def RequestInformation(self, _request: Any, _inputs: Any, outputs: Any) -> int:
        """Say which times there are."""
        about, known = outputs.GetInformationObject(0), vtkStreamingDemandDrivenPipeline
        about.Set(known.TIME_STEPS(), self._times, len(self._times))
        about.Set(known.TIME_RANGE(), [self._times[0], self._times[-1]], 2)
        return 1

    def RequestData(self, _request: Any, _inputs: Any, outputs: Any) -> int:
        """Give the datasets at a time."""
        about, asked = outputs.GetInformationObject(0), vtkStreamingDemandDrivenPipeline.UPDATE_TIME_STEP()
        time = about.Get(asked) if about.Has(asked) else self._times[0]
        number = int(np.abs(np.array(self._times) - time).argmin())
        together = vtkMultiBlockDataSet.GetData(about)
        increment, quantities, falls = as_shown(self._response, self._response.path[number])
        grids = grids_of(self._response.assembly, increment, self._response.ties, quantities, falls=falls)
        for k, (name, grid) in enumerate(grids.items()):
            for attributes, array in arrays_of(grid):
                if isinstance(array, vtkStringArray):
                    attributes.RemoveArray(array.GetName())
            together.SetBlock(k, grid)
            together.GetMetaData(k).Set(vtkCompositeDataSet.NAME(), name)
        return 1
