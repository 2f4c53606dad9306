"""Assemblies and increments as pyvista datasets: one polygon cell per block, one vertex cell per contact point."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
import pyvista as pv
from vtkmodules.util.numpy_support import numpy_to_vtk
from vtkmodules.vtkCommonCore import vtkStringArray

import solver

#: Numbers of the roles in the cell array ``role``; their names are in the field array ``role_names``.
ROLE_NUMBERS = {role: number for number, role in enumerate(solver.ROLES)}


def block_dataset(assembly: solver.Assembly, increment: solver.Increment | None = None) -> pv.UnstructuredGrid:
    """Make a dataset of the blocks of one increment, one polygon cell per block, non-convex outlines too.

    Parameters
    ----------
    assembly : solver.Assembly
    increment : solver.Increment, optional
        The blocks as laid out by default.

    Returns
    -------
    pyvista.UnstructuredGrid
        Cell arrays ``block_id``, ``name``, ``role`` (number), ``role_name``, ``material_id``, ``material``,
        ``displacement`` (n_blocks, 3) of the centroids [m] and ``rotation`` [rad]; point array ``displacement``
        (n_vertices, 3) [m]; field arrays ``settlement`` (the parameter: of a pushover the control displacement, of a
        load that moves its position), ``phase``, ``load_multiplier``,
        ``reaction`` [N or N·m], ``status``, ``role_names`` and ``material_names``.

    Examples
    --------
    >>> import solver
    >>> one = solver.Assembly.from_outlines([[[0, 0], [2, 0], [2, 1], [0, 1]]], names=["lintel"])
    >>> str(block_dataset(one).cell_data["name"][0])
    'lintel'
    """
    pose = solver.Pose.initial(assembly) if increment is None else increment.pose
    corners = solver.moved_vertices(assembly, pose)
    grid = pv.UnstructuredGrid(_polygon_cells(assembly.offsets), _cell_types(assembly), _in_space(corners))
    materials = sorted(set(assembly.materials))
    number = {material: k for k, material in enumerate(materials)}
    moved = pose.displacements(assembly)
    cells = {
        "block_id": np.arange(assembly.n_blocks, dtype=np.int32),
        "role": np.array([ROLE_NUMBERS[str(role)] for role in assembly.roles], dtype=np.int32),
        "material_id": np.array([number[material] for material in assembly.materials], dtype=np.int32),
        "displacement": _in_space(moved[:, :2]),
        "rotation": moved[:, 2].copy(),
    }
    for name, array in cells.items():
        grid.cell_data[name] = array
    for name, words in (("name", assembly.names), ("role_name", assembly.roles), ("material", assembly.materials)):
        grid.GetCellData().AddArray(_strings(name, words))
    grid.point_data["displacement"] = _in_space(corners - assembly.vertices)
    grid.GetFieldData().AddArray(_strings("role_names", solver.ROLES))
    grid.GetFieldData().AddArray(_strings("material_names", materials))
    if increment is not None:
        _describe(grid, increment)
    return grid


def contact_dataset(assembly: solver.Assembly, increment: solver.Increment) -> pv.UnstructuredGrid:
    """Make a dataset of the contact points of one increment, one vertex cell each.

    Parameters
    ----------
    assembly : solver.Assembly
    increment : solver.Increment

    Returns
    -------
    pyvista.UnstructuredGrid
        Point arrays ``normal`` and ``tangent`` (n_contacts, 3), ``force`` (n_contacts, 3) on ``block_a`` [N],
        ``normal_force`` (compression positive) and ``shear_force`` [N], ``gap`` [m], ``friction``, ``state``
        (number of :class:`solver.ContactState`), ``block_a`` and ``block_b``; field arrays as those of
        :func:`block_dataset`, and ``state_names``.
    """
    contacts = increment.contacts
    n = len(contacts.points)
    vertices = np.column_stack([np.ones(n, dtype=np.int64), np.arange(n)]).ravel()
    grid = pv.UnstructuredGrid(vertices, np.full(n, int(pv.CellType.VERTEX), np.uint8), _in_space(contacts.points))
    normal, tangent = contacts.frames[:, 0], contacts.frames[:, 1]
    force = increment.forces[:, :1] * normal + increment.forces[:, 1:] * tangent
    points = {
        "normal": _in_space(normal),
        "tangent": _in_space(tangent),
        "force": _in_space(force),
        "normal_force": increment.forces[:, 0].copy(),
        "shear_force": increment.forces[:, 1].copy(),
        "gap": np.asarray(contacts.gaps, dtype=float),
        "friction": np.asarray(increment.friction, dtype=float),
        "state": increment.states.astype(np.int32),
        "block_a": contacts.block_a.astype(np.int32),
        "block_b": contacts.block_b.astype(np.int32),
    }
    for name, array in points.items():
        # Blocks in the air have no contact point; pyvista refuses empty arrays, VTK and ParaView do not.
        values = numpy_to_vtk(np.ascontiguousarray(array), deep=True)
        values.SetName(name)
        grid.GetPointData().AddArray(values)
    grid.GetFieldData().AddArray(_strings("state_names", [state.name.lower() for state in solver.ContactState]))
    _describe(grid, increment)
    return grid


def output_times(increments: Sequence[solver.Increment]) -> list[float]:
    """Strictly increasing times, one per increment, for readers that sort or merge by time.

    Parameters
    ----------
    increments : sequence of solver.Increment

    Returns
    -------
    list of float [m or rad]
        The parameter in equilibrium, phases one after another. Frames of the fall share one parameter: their times
        grow by a hundredth of it each.
    """
    times: list[float] = []
    before, phase, last = 0.0, 0, 0.0
    for increment in increments:
        if increment.phase != phase:
            before, phase = last, increment.phase
        time = before + increment.parameter
        if (times and time <= times[-1]) or increment.status == solver.Status.FALLING:
            time = last + 0.01 * (abs(last) or 1.0) if not times else times[-1] + 0.01 * (abs(last) or 1.0)
        else:
            last = time
        times.append(float(time))
    return times


def _describe(grid: pv.UnstructuredGrid, increment: solver.Increment) -> None:
    grid.field_data["settlement"] = np.array([increment.parameter])
    grid.field_data["phase"] = np.array([increment.phase])
    grid.field_data["load_multiplier"] = np.array([increment.load_multiplier])
    grid.field_data["reaction"] = np.array([increment.reaction])
    grid.GetFieldData().AddArray(_strings("status", [str(increment.status)]))


def _strings(name: str, words: Iterable[str]) -> vtkStringArray:
    """Make a VTK array of strings; pyvista's own conversion refuses anything but ASCII."""
    array = vtkStringArray()
    array.SetName(name)
    for word in words:
        array.InsertNextValue(str(word))
    return array


def _polygon_cells(offsets: np.ndarray) -> np.ndarray:
    counts = np.diff(offsets)
    return np.insert(np.arange(offsets[-1]), offsets[:-1], counts)


def _cell_types(assembly: solver.Assembly) -> np.ndarray:
    return np.full(assembly.n_blocks, int(pv.CellType.POLYGON), dtype=np.uint8)


def _in_space(vectors: np.ndarray) -> np.ndarray:
    """(n, 2) vectors with a zero third component, as VTK wants them."""
    return np.column_stack([vectors, np.zeros(len(vectors))])
