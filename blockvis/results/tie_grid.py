"""Ties, props and bars of an increment as a VTK grid of lines."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from vtkmodules.vtkCommonDataModel import VTK_LINE, vtkUnstructuredGrid

import solver
from blockvis.system.vtk_files import string_array

from .datasets import add_arrays, describe, give_shape, grid_of_cells, state_units
from .ties import STATE_WORDS, ties_at

if TYPE_CHECKING:
    import pyvista as pv


def tie_dataset(
    ties: Sequence[solver.Tie], assembly: solver.Assembly, increment: solver.Increment, *, shape: str = "moved"
) -> pv.UnstructuredGrid:
    """Make a dataset of the ties, props and bars of one increment: a line for each, from end to end.

    Parameters
    ----------
    ties : sequence of solver.Tie
    assembly : solver.Assembly
    increment : solver.Increment
    shape : {"moved", "undeformed"}
        As of :func:`blockvis.results.datasets.block_dataset`.

    Returns
    -------
    pyvista.UnstructuredGrid
        Cell arrays ``force`` [N], tension positive, ``elongation`` [m], ``state`` (number), ``name``, ``kind``; point
        and field arrays as those of the blocks, and ``state_names``.
    """
    import pyvista

    return pyvista.UnstructuredGrid(tie_grid(ties, assembly, increment, shape=shape))


def tie_grid(
    ties: Sequence[solver.Tie], assembly: solver.Assembly, increment: solver.Increment, *, shape: str = "moved"
) -> vtkUnstructuredGrid:
    """Make what :func:`tie_dataset` wraps."""
    found, d = ties_at(ties, assembly, increment), assembly.dimension
    grid = grid_of_cells(found.ends.reshape(-1, d), 2 * np.arange(len(ties) + 1), VTK_LINE)
    give_shape(grid, np.array([tie.points for tie in ties]).reshape(-1, d), shape, None)
    cells = {
        "force": found.forces,
        "elongation": found.elongations,
        "state": found.states.astype(np.int32),
    }
    add_arrays(grid.GetCellData(), cells)
    grid.GetCellData().SetActiveScalars("force")
    for name, words in (("name", [tie.name for tie in ties]), ("kind", [tie.kind for tie in ties])):
        grid.GetCellData().AddArray(string_array(name, words))
    grid.GetFieldData().AddArray(string_array("state_names", STATE_WORDS))
    describe(grid, increment)
    state_units(grid)
    return grid
