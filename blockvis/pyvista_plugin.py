"""Plugin for PyVista: layouts through ``pyvista.read`` and ``save``, and ``mesh.blockvis``.

    import pyvista, blockvis.pyvista_plugin
    mesh = pyvista.read("wall.dxf")
    response = mesh.blockvis.settle({"right": "moving", "left": "fixed"}, direction=(1, 0), friction_coefficient=0.6)

Importing this module registers everything. Suffixes that PyVista reads or writes itself stay with PyVista, and so do
``.msh`` files of anything but flat blocks.
"""

from __future__ import annotations

import contextlib
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pyvista as pv

import solver

from .formats.gmsh_mesh import holds_flat_blocks
from .formats.pyvista_files import dataset_of, layout_of_dataset
from .formats.read import read_layout, write_layout
from .layout.assemble import assemble
from .layout.layout import Layout
from .layout.selection import sorted_out


def _reader(path: str, **options: Any) -> pv.UnstructuredGrid:
    """Read a layout as a dataset of one polygon per block; the options are those of ``read_layout``."""
    return dataset_of(read_layout(path, **options))


def _mesh_reader(path: str, **options: Any) -> Any:
    """Read a .msh file of flat blocks as a layout; leave every other to PyVista."""
    try:
        if holds_flat_blocks(Path(path)):
            return _reader(path, **options)
    except ValueError as error:
        problem: ValueError | None = error
    else:
        problem = None
    try:
        return pv.read_meshio(path)
    except (SystemExit, Exception):
        # meshio ends the process for some files; what PyVista cannot read either is refused with our reason.
        if problem is not None:
            raise problem from None
        raise


def _writer(dataset: Any, path: str, **options: Any) -> None:
    """Write the blocks of a dataset to a layout file."""
    write_layout(BlockvisAccessor(dataset).layout(), path)


def _registered(register: Any, suffixes: Sequence[str], handler: Any) -> tuple[str, ...]:
    taken = []
    for suffix in suffixes:
        # PyVista refuses a suffix that it reads or writes itself.
        with contextlib.suppress(ValueError):
            register(suffix, handler)
            taken.append(suffix)
    return tuple(taken)


#: Suffixes that ``pyvista.read`` now reads through blockvis.
READS = (
    *_registered(pv.register_reader, (".dxf", ".json", ".svg"), _reader),
    *_registered(pv.register_reader, (".msh",), _mesh_reader),
)

#: Suffixes that ``dataset.save`` now writes through blockvis.
WRITES = _registered(pv.register_writer, (".dxf", ".json", ".msh", ".svg"), _writer)


class BlockvisAccessor:
    """The blocks of a polygon mesh: ``mesh.blockvis``.

    A cell array ``block_id`` says which cells form one block; without it every polygon is a block, and triangles that
    share points form one. The cell arrays ``name``, ``role``, ``material``, ``density`` and ``thickness`` are optional.
    """

    def __init__(self, mesh: Any) -> None:
        self._mesh = mesh

    def layout(self) -> Layout:
        """Read the blocks as a layout, lengths in m."""
        layout = layout_of_dataset(self._mesh)
        return sorted_out(replace(layout, unit=layout.unit or "m"))

    def assembly(self, roles: Mapping[str, str] | None = None, **options: Any) -> solver.Assembly:
        """Build an assembly of the blocks; the options are those of :func:`blockvis.layout.assemble.assemble`."""
        return assemble(self.layout(), roles=roles, **options)

    def settle(
        self,
        roles: Mapping[str, str] | None = None,
        *,
        direction: tuple[float, float] = (0.0, -1.0),
        increment: float = 0.01,
        limit: float = 0.5,
        friction_coefficient: float = solver.InterfaceLaw.friction_coefficient,
        **options: Any,
    ) -> solver.Response:
        """Move the moving supports until the structure collapses.

        Parameters
        ----------
        roles : mapping of str to {"free", "fixed", "moving"}, optional
        direction : (2,) tuple
            Of the settlement of the moving supports.
        increment, limit : float [m]
            Length of a step, and the settlement at which the analysis stops.
        friction_coefficient : float
        **options
            Those of :func:`blockvis.layout.assemble.assemble`: supports, joint_thickness, density ...

        Returns
        -------
        solver.Response
        """
        motion = solver.Settlement(direction=direction, increment=increment, limit=limit)
        return solver.settle(self.assembly(roles, **options), motion, friction_coefficient=friction_coefficient)


pv.register_dataset_accessor("blockvis", pv.DataSet)(BlockvisAccessor)
