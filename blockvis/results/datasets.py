"""Assemblies and increments as VTK grids: blocks, joints, contact points and ties.

In the plane blocks are polygons and joints lines, in space polyhedra and faces; contact points are vertices.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy
from vtkmodules.vtkCommonCore import vtkDataArray, vtkPoints
from vtkmodules.vtkCommonDataModel import (
    VTK_LINE,
    VTK_POLYGON,
    VTK_POLYHEDRON,
    VTK_VERTEX,
    vtkCellArray,
    vtkUnstructuredGrid,
)

import solver
from blockvis.system.vtk_files import arrays_of, string_array
from solver import mechanics

from .about import STATIC, Quantities
from .joint_faces import Rings, carried_between, initial_joints, lengths_of
from .joints import joint_states
from .mechanism_arrays import block_motion, next_places, part_of_friction
from .tables import own_columns
from .ties import STATE_WORDS, ties_at

#: Numbers of the roles in the cell array ``role``; their names are in the field array ``role_names``.
ROLE_NUMBERS = {role: number for number, role in enumerate(mechanics.ROLES)}


#: What the points of a dataset of blocks show: where the blocks are, or where the layout has them.
SHAPES = ("moved", "undeformed")

#: Units of the arrays that are alike in all results; those that are not here are names, numbers of blocks or states, or
#: have no unit.
UNITS = {
    "displacement": "m", "reference": "m", "to_reference": "m", "mechanism": "m", "translation": "m", "rotation": "rad",
    "force": "N", "normal_force": "N", "shear_force": "N", "shear": "N", "gap": "m", "opening": "m", "slip": "m",
    "length": "m", "area": "m²", "elongation": "m", "time": "s",
}  # fmt: skip


def block_grid(
    assembly: solver.Assembly,
    increment: solver.Increment | None = None,
    quantities: Quantities = STATIC,
    *,
    shape: str = "moved",
    falls: np.ndarray | None = None,
) -> vtkUnstructuredGrid:
    """Make a grid of the blocks of one increment, or as laid out: a polygon for each, in space a polyhedron.

    Its points are where the blocks are, "moved", or where the layout has them, "undeformed". The active vectors, by
    which a viewer warps first, lead from there on: those of the layout to where the blocks are, moved ones along the
    mechanism that follows. ``falls`` (n_blocks,) bool are the blocks that the collapse takes; by default those that
    have fallen, in frames of a fall those that move. `docs/results.md` lists the arrays of all grids.

    Examples
    --------
    >>> import solver
    >>> one = solver.Assembly.from_outlines([[[0, 0], [2, 0], [2, 1], [0, 1]]], names=["lintel"])
    >>> block_grid(one).GetCellData().GetAbstractArray("name").GetValue(0)
    'lintel'
    """
    pose = solver.Pose.initial(assembly) if increment is None else increment.pose
    corners = mechanics.moved_vertices(assembly, pose)
    if assembly.dimension == 2:
        grid = _grid_of_cells(corners, assembly.offsets, VTK_POLYGON)
    else:
        grid = _polyhedra(assembly.polyhedra, corners)
    materials = sorted(set(assembly.materials))
    number = {material: k for k, material in enumerate(materials)}
    cells = {
        "block_id": np.arange(assembly.n_blocks, dtype=np.int32),
        "role": np.array([ROLE_NUMBERS[str(role)] for role in assembly.roles], dtype=np.int32),
        "material_id": np.array([number[material] for material in assembly.materials], dtype=np.int32),
        "translation": _in_space(pose.positions - assembly.centroids),
        "rotation": pose.rotations[:, 0].copy() if assembly.dimension == 2 else pose.rotations.copy(),
        "name": assembly.names,
        "role_name": assembly.roles.tolist(),
        "material": assembly.materials,
    }
    add_arrays(grid.GetCellData(), cells)
    grid.GetCellData().SetActiveScalars("block_id")
    ahead = None if increment is None else next_places(assembly, increment, corners, assembly.block_of_vertex)
    _give_shape(grid, assembly.vertices, shape, ahead)
    add_arrays(grid.GetFieldData(), {"role_names": mechanics.ROLES, "material_names": materials})
    units: dict[str, str] = {}
    if increment is not None:
        fallen, motion = increment.fallen, block_motion(assembly, increment, falls)
        add_arrays(grid.GetCellData(), {"fallen": fallen.astype(np.int32), **motion})
        # Frames of a fall go by no unit of length or angle.
        if increment.status == solver.Status.EQUILIBRIUM:
            per = quantities.motion
            units = {"mechanism_velocity": f"m/{per}", "mechanism_rotation": f"rad/{per}"}
    return _described(grid, increment, quantities, units)


def joint_grid(
    assembly: solver.Assembly, increment: solver.Increment, quantities: Quantities = STATIC, *, shape: str = "moved"
) -> vtkUnstructuredGrid:
    """Make a grid of the joints of one increment: a line for each, in space a face, midway between its two faces."""
    states = joint_states(assembly, initial_joints(assembly), increment)
    rings, in_space = states.rings, assembly.dimension == 3
    # Lines or vertices also where blocks touch at an edge or a corner.
    kinds = np.array([VTK_VERTEX, VTK_LINE, VTK_POLYGON], dtype=np.uint8)
    kind = kinds[np.minimum(np.diff(rings.offsets), 3) - 1]
    blocks = states.block_a[rings.ring], states.block_b[rings.ring]
    grid = _grid_between(assembly, increment, rings, blocks, kind, shape)
    if in_space:
        add_arrays(grid.GetPointData(), {"gap": states.gaps})
    names = assembly.names
    add_arrays(
        grid.GetCellData(),
        {
            "opening": states.opening,
            "slip": states.slip,
            "normal_force": states.normal_force,
            "shear_force": states.shear_force,
            **(
                {"area": rings.areas(), "normal": states.normals, "force": states.force}
                if in_space
                else {"length": lengths_of(states.ends)}
            ),
            "block_a": states.block_a.astype(np.int32),
            "block_b": states.block_b.astype(np.int32),
            "initial": states.initial.astype(np.int32),
            "joint": [f"{names[a]} | {names[b]}" for a, b in zip(states.block_a, states.block_b, strict=True)],
        },
    )
    return _described(grid, increment, quantities)


def contact_grid(
    assembly: solver.Assembly, increment: solver.Increment, quantities: Quantities = STATIC, *, shape: str = "moved"
) -> vtkUnstructuredGrid:
    """Make a grid of the contact points of one increment, one vertex cell each; in a fall their forces are 0."""
    contacts, states = increment.contacts, increment.states
    blocks = (contacts.block_a, contacts.block_b)
    places = Rings(contacts.points, np.arange(len(contacts) + 1))
    grid = _grid_between(assembly, increment, places, blocks, VTK_VERTEX, shape)
    normal, tangent = contacts.frames[:, 0], contacts.frames[:, 1]
    balanced = increment.forces * (increment.status != solver.Status.FALLING)
    carries = (states != mechanics.ContactState.OPEN) & balanced.any(axis=1)
    shear = np.einsum("ki,kij->kj", balanced[:, 1:], contacts.frames[:, 1:])
    force = balanced[:, :1] * normal + shear
    in_space = assembly.dimension == 3
    points = {
        "normal": _in_space(normal),
        "tangent": _in_space(tangent),
        "force": _in_space(force),
        "normal_force": balanced[:, 0],
        "shear_force": np.linalg.norm(shear, axis=1) if in_space else balanced[:, 1],
        "gap": np.asarray(contacts.gaps, dtype=float),
        "friction": np.asarray(increment.friction, dtype=float),
        "utilisation": part_of_friction(balanced, increment.friction) * carries,
        "state": states.astype(np.int32),
        **({"intact": increment.state.intact} if len(increment.state.intact) else {}),
        "carries": carries.astype(np.int32),
        "block_a": contacts.block_a.astype(np.int32),
        "block_b": contacts.block_b.astype(np.int32),
    }
    if in_space:
        points |= {"shear": shear, "slip": _slip(assembly, increment)}
    add_arrays(grid.GetPointData(), points)
    add_arrays(grid.GetFieldData(), {"state_names": [state.name.lower() for state in mechanics.ContactState]})
    return _described(grid, increment, quantities)


def tie_grid(
    ties: Sequence[solver.Tie],
    assembly: solver.Assembly,
    increment: solver.Increment,
    quantities: Quantities = STATIC,
    *,
    shape: str = "moved",
) -> vtkUnstructuredGrid:
    """Make a grid of the ties, props and bars of one increment: a line for each, from end to end."""
    found, d = ties_at(ties, assembly, increment), assembly.dimension
    grid = _grid_of_cells(found.ends.reshape(-1, d), 2 * np.arange(len(ties) + 1), VTK_LINE)
    _give_shape(grid, np.array([tie.points for tie in ties]).reshape(-1, d), shape, None)
    cells: dict[str, np.ndarray | Iterable[str]] = {
        "force": found.forces,
        "elongation": found.elongations,
        "state": found.states.astype(np.int32),
        "name": [tie.name for tie in ties],
        "kind": [tie.kind for tie in ties],
    }
    add_arrays(grid.GetCellData(), cells)
    grid.GetCellData().SetActiveScalars("force")
    add_arrays(grid.GetFieldData(), {"state_names": STATE_WORDS})
    return _described(grid, increment, quantities)


def grids_of(
    assembly: solver.Assembly,
    increment: solver.Increment,
    ties: Sequence[solver.Tie],
    quantities: Quantities,
    *,
    shape: str = "moved",
    falls: np.ndarray | None = None,
) -> dict[str, vtkUnstructuredGrid]:
    """Make all grids of an increment by their kinds; that of ties where there are any."""
    grids = {
        "blocks": block_grid(assembly, increment, quantities, shape=shape, falls=falls),
        "contacts": contact_grid(assembly, increment, quantities, shape=shape),
        "joints": joint_grid(assembly, increment, quantities, shape=shape),
    }
    return grids | ({"ties": tie_grid(ties, assembly, increment, quantities, shape=shape)} if ties else {})


def _grid_of_cells(points: np.ndarray, offsets: np.ndarray, kind: int | np.ndarray) -> vtkUnstructuredGrid:
    """Make a grid of cells of their own points, (n, d) [m]: cell i of offsets[i] to offsets[i + 1]."""
    grid = _grid_of_points(points)
    kinds = np.broadcast_to(np.asarray(kind, dtype=np.uint8), len(offsets) - 1)
    grid.SetCells(numpy_to_vtk(np.ascontiguousarray(kinds), deep=True), _cells(offsets, np.arange(len(points))))
    return grid


def _polyhedra(shapes: mechanics.Polyhedra, corners: np.ndarray) -> vtkUnstructuredGrid:
    """Make a grid of one polyhedron per block, with the corners of all blocks, (n_vertices, 3) [m]."""
    grid = _grid_of_points(corners)
    grid.SetPolyhedralCells(
        numpy_to_vtk(np.full(len(shapes), VTK_POLYHEDRON, dtype=np.uint8), deep=True),
        _cells(shapes.offsets, np.arange(len(corners))),
        _cells(shapes.faces_of_block, np.arange(len(shapes.block_of_face))),
        _cells(shapes.face_offsets, shapes.corners),
    )
    return grid


def _grid_of_points(points: np.ndarray) -> vtkUnstructuredGrid:
    grid, nodes = vtkUnstructuredGrid(), vtkPoints()
    nodes.SetData(numpy_to_vtk(np.ascontiguousarray(_in_space(points)), deep=True))
    grid.SetPoints(nodes)
    return grid


def _cells(offsets: np.ndarray, members: np.ndarray) -> vtkCellArray:
    cells = vtkCellArray()
    cells.SetData(*(numpy_to_vtk(np.asarray(ids, dtype=np.int64), deep=True) for ids in (offsets, members)))
    return cells


def _slip(assembly: solver.Assembly, increment: solver.Increment) -> np.ndarray:
    """(n_contacts, 3) array [m]: how far block a has moved along block b at each contact point since the layout.

    It is measured half-way between both faces, as slips of joints are.
    """
    contacts, initial = increment.contacts, solver.Pose.initial(assembly)
    blocks, states = (contacts.block_a, contacts.block_b), joint_states(assembly, initial_joints(assembly), increment)
    drawn = carried_between(contacts.points, *blocks, increment.pose, initial)
    on_a, on_b = (mechanics.carried(drawn, block, initial, increment.pose) for block in blocks)
    moved, normal = on_a - on_b, states.normals[states.of_contact]
    return np.asarray(moved - (moved * normal).sum(axis=1)[:, None] * normal)


def _grid_between(
    assembly: solver.Assembly,
    increment: solver.Increment,
    rings: Rings,
    blocks: tuple[np.ndarray, np.ndarray],
    kind: int | np.ndarray,
    shape: str,
) -> vtkUnstructuredGrid:
    """Make a grid of cells whose points lie between two blocks each, (n_points,) int arrays."""
    grid = _grid_of_cells(rings.points, rings.offsets, kind)
    drawn = carried_between(rings.points, *blocks, increment.pose, solver.Pose.initial(assembly))
    _give_shape(grid, drawn, shape, next_places(assembly, increment, rings.points, *blocks))
    return grid


def _described(
    grid: vtkUnstructuredGrid,
    increment: solver.Increment | None,
    quantities: Quantities,
    units: Mapping[str, str] | None = None,
) -> vtkUnstructuredGrid:
    """Write the numbers of an increment, if any, into the field arrays of a grid, and the units of its arrays.

    ``units`` are those that depend on the increment, by the names of the arrays.
    """
    own = dict.fromkeys(("settlement", *own_columns(quantities.parameter)), quantities.parameter.unit)
    if increment is not None:
        numbers: dict[str, np.ndarray | Iterable[str]] = {
            **{name: np.array([increment.parameter]) for name in own},
            "phase": np.array([increment.phase]),
            "load_multiplier": np.array([increment.load_multiplier]),
            "reaction": np.array([increment.reaction]),
            "status": [str(increment.status)],
        }
        add_arrays(grid.GetFieldData(), numbers)
    state_units(grid, {**own, "reaction": quantities.reaction.unit, **(units or {})})
    return grid


def add_arrays(attributes: Any, arrays: Mapping[str, np.ndarray | Iterable[str]]) -> None:
    """Add arrays of numbers or words to the point, cell or field data of a VTK grid."""
    for name, array in arrays.items():
        if isinstance(array, np.ndarray):
            values = numpy_to_vtk(np.ascontiguousarray(array), deep=True)
            values.SetName(name)
        else:
            values = string_array(name, array)
        attributes.AddArray(values)


def _give_shape(grid: vtkUnstructuredGrid, reference: np.ndarray, shape: str, ahead: np.ndarray | None) -> None:
    """Let the points of a moved grid stay or go where the layout has them, (n, d) [m], and say how far they move.

    The active vectors are what Warp By Vector takes first: of the layout the displacement, of moved shapes what lies
    ahead, (n, d) [m], which neither undoes the displacement nor doubles it.
    """
    if shape not in SHAPES:
        raise ValueError(f"shape is '{shape}'; choose from {', '.join(SHAPES)}")
    drawn = _in_space(reference)
    moved = vtk_to_numpy(grid.GetPoints().GetData()) - drawn
    arrays = {"displacement": moved, "reference": drawn}
    if shape == "moved":
        arrays = {"mechanism": np.zeros_like(moved) if ahead is None else _in_space(ahead)} | arrays
        arrays["to_reference"] = -moved
    else:
        grid.GetPoints().SetData(numpy_to_vtk(np.ascontiguousarray(drawn), deep=True))
    add_arrays(grid.GetPointData(), arrays)
    grid.GetPointData().SetActiveVectors(next(iter(arrays)))


def state_units(grid: vtkUnstructuredGrid, own: Mapping[str, str]) -> None:
    """Write the unit of each array into its metadata and into the field array ``units``; ``own`` beside the common."""
    listed, units = [], {**UNITS, **own}
    for _, array in arrays_of(grid):
        if array.GetName() in units:
            array.GetInformation().Set(vtkDataArray.UNITS_LABEL(), units[array.GetName()])
            listed.append(f"{array.GetName()} [{units[array.GetName()]}]")
    add_arrays(grid.GetFieldData(), {"units": dict.fromkeys(listed)})


def _in_space(vectors: np.ndarray) -> np.ndarray:
    """(n, 2) or (n, 3) vectors with three components, as VTK wants them."""
    return vectors if vectors.shape[1] == 3 else np.column_stack([vectors, np.zeros(len(vectors))])
