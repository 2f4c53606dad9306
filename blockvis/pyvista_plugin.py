"""Plugin for PyVista: layouts through ``pyvista.read`` and ``save``, and ``mesh.blockvis``.

    import pyvista, blockvis.pyvista_plugin
    mesh = pyvista.read("wall.dxf")
    response = mesh.blockvis.settle({"right": "moving", "left": "fixed"}, direction=(1, 0), friction_coefficient=0.6)

Importing this module registers everything. Suffixes that PyVista reads or writes itself stay with PyVista, and so do
``.msh`` files of anything but flat blocks.
"""

from __future__ import annotations

import contextlib
import inspect
import os
from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pyvista as pv

import solver
from solver.mechanics import counted

from .formats.gmsh_mesh import holds_flat_blocks
from .formats.pyvista_files import dataset_of, layout_of_dataset
from .formats.read import read_layout, write_layout
from .layout.assemble import assemble
from .layout.layout import Layout
from .layout.selection import sorted_out
from .pictures import palette
from .pictures.solid_scene import drawn_forward
from .pictures.solid_view import ABOVE, AROUND, View, showing_faces
from .results.datasets import block_grid
from .text import nearest


def _reader(path: str, **options: Any) -> pv.UnstructuredGrid:
    """Read a layout as a dataset of one polygon or polyhedron per block; the options are those of ``read_layout``."""
    return dataset_of(read_layout(path, **options))


def _mesh_reader(path: str, **options: Any) -> Any:
    """Read a .msh file of flat blocks as a layout; leave every other to PyVista."""
    problem: ValueError | None = None
    try:
        if holds_flat_blocks(Path(path)):
            return _reader(path, **options)
    except ValueError as error:
        problem = error
    try:
        return pv.read_meshio(path)
    except (SystemExit, Exception):
        # meshio ends the process for some files; what PyVista cannot read either is refused with our reason.
        if problem is not None:
            raise problem from None
        raise


def _writer(dataset: Any, path: str, **options: Any) -> None:
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
    """The blocks of a mesh of polygons or closed bodies, or of several in a MultiBlock: ``mesh.blockvis``.

    A cell array ``block_id`` says which cells form one block; without it every polygon is a block, and triangles that
    share points form one. The cell arrays ``name``, ``role``, ``material``, ``density`` and ``thickness`` are optional;
    a block of a MultiBlock that has no name takes that of its part. Bodies that are prisms side by side are blocks in
    the plane, others in space, where z is up; ``dimension`` decides otherwise.
    """

    def __init__(self, mesh: Any) -> None:
        self._mesh = mesh

    def __repr__(self) -> str:
        """One line: how many blocks there are, and what can be done with them."""
        blocks = counted(self.layout().n_blocks, "block")
        return f"<{blocks}: plot(), assembly(), structure(), settle(), limit_load(), save()>"

    def layout(self, dimension: int | None = None) -> Layout:
        """Read the blocks as a layout, lengths in m, in 2 or 3 dimensions; as they are drawn by default."""
        layout = layout_of_dataset(self._mesh, dimension=dimension)
        layout = replace(layout, unit=layout.unit or "m")
        return layout if layout.dimension == 3 else sorted_out(layout)

    def save(self, path: str | Path) -> Path:
        """Write the blocks to a layout file of any format that blockvis writes."""
        write_layout(self.layout(), path)
        return Path(path)

    def assembly(
        self,
        roles: Mapping[str, str] | None = None,
        *,
        supports: Sequence[Mapping[str, Any]] = (),
        density: float = 2000.0,
        thickness: float = 1.0,
        joint_thickness: float | str = 0.0,
        overlap_tolerance: float | None = None,
        dimension: int | None = None,
    ) -> solver.Assembly:
        """Build an assembly of the blocks.

        Parameters
        ----------
        roles, supports, density, thickness, joint_thickness, overlap_tolerance
            As of :func:`blockvis.assemble`.
        dimension : {2, 3}, optional
            As of :meth:`layout`.
        """
        return assemble(
            self.layout(dimension),
            roles=roles,
            supports=supports,
            density=density,
            thickness=thickness,
            joint_thickness=joint_thickness,
            overlap_tolerance=overlap_tolerance,
        )

    def structure(
        self,
        roles: Mapping[str, str] | None = None,
        *,
        friction_coefficient: float | None = None,
        interfaces: solver.Interfaces | None = None,
        loads: solver.Loads | None = None,
        **options: Any,
    ) -> solver.Structure:
        """Give the blocks joints and loads.

        Parameters
        ----------
        roles : mapping of str to {"free", "fixed", "moving"}, optional
        friction_coefficient : float, optional
            Of every interface, 0.6 where neither it nor ``interfaces`` is given.
        interfaces, loads : optional
            As of :class:`solver.Structure`.
        **options
            As of :meth:`assembly`.
        """
        _check_options(options)
        if interfaces is None and friction_coefficient is None:
            friction_coefficient = solver.InterfaceLaw.friction_coefficient
        assembly = self.assembly(roles, **options)
        return solver.Structure(assembly, interfaces, loads, friction_coefficient=friction_coefficient)

    def settle(
        self,
        roles: Mapping[str, str] | None = None,
        *,
        direction: Sequence[float] | None = None,
        increment: float = 0.01,
        limit: float = 0.5,
        tolerance: float | None = None,
        phases: Sequence[solver.Settlement] = (),
        controls: solver.Controls | None = None,
        dimension: int | None = None,
        **options: Any,
    ) -> solver.Response:
        """Move the moving supports until the structure collapses.

        Parameters
        ----------
        roles : mapping of str to {"free", "fixed", "moving"}, optional
        direction : (d,) sequence, optional
            Of the settlement of the moving supports; down by default. Three numbers are for blocks in space.
        increment, limit : float [m]
            Length of a step, and the settlement at which the analysis stops.
        tolerance : float, optional [m]
            Width of the collapse bracket; a hundredth of the increment by default.
        phases : sequence of solver.Settlement
            Settlements one after another, in place of ``direction``, ``increment``, ``limit`` and ``tolerance``.
        controls : solver.Controls, optional
        dimension : {2, 3}, optional
            As of :meth:`layout`.
        **options
            As of :meth:`structure`.
        """
        dimension = 3 if direction is not None and len(direction) == 3 else dimension
        structure = self.structure(roles, dimension=dimension, **options)
        down = [*[0.0] * (structure.assembly.dimension - 1), -1.0]
        one = solver.Settlement(
            direction=down if direction is None else direction, increment=increment, limit=limit, tolerance=tolerance
        )
        return structure.settle(tuple(phases) or one, controls=controls)

    def limit_load(
        self,
        roles: Mapping[str, str] | None = None,
        *,
        weight_fraction: Sequence[float] | None = None,
        loads: solver.Loads | None = None,
        flow: str = "associative",
        dimension: int | None = None,
        **options: Any,
    ) -> solver.LimitLoad:
        """Find the largest multiplier of live loads that the blocks carry as drawn; all supports stand still.

        Parameters
        ----------
        roles : mapping of str to {"free", "fixed", "moving"}, optional
        weight_fraction : (d,) sequence, optional
            Live load of each block as a fraction of its weight, along x and y, in space along z too; all of it along x
            by default.
        loads : solver.Loads, optional
            Dead and live loads, in place of the self-weight and ``weight_fraction``.
        flow : {"associative", "non-associative"}
            As of :meth:`solver.Structure.limit_load`.
        dimension : {2, 3}, optional
            As of :meth:`layout`.
        **options
            As of :meth:`structure`.
        """
        dimension = 3 if weight_fraction is not None and len(weight_fraction) == 3 else dimension
        structure = self.structure(roles, loads=loads, dimension=dimension, **options)
        if loads is not None:
            return structure.limit_load(flow=flow)
        along = [1.0, *[0.0] * (structure.assembly.dimension - 1)] if weight_fraction is None else weight_fraction
        return structure.limit_load(acceleration=along, flow=flow)

    def plot(
        self,
        roles: Mapping[str, str] | None = None,
        *,
        names: bool = True,
        dimension: int | None = None,
        off_screen: bool | None = None,
        screenshot: str | os.PathLike[str] | None = None,
        window_size: tuple[int, int] = (1280, 720),
    ) -> Any:
        """Show the blocks as they will be analysed: fixed and moving supports by their colour, each with its name.

        Parameters
        ----------
        roles : mapping of str to {"free", "fixed", "moving"}, optional
        names : bool
            Write the name of each block on it, and the role of supports.
        dimension : {2, 3}, optional
            As of :meth:`layout`.
        off_screen : bool, optional
            Draw without a window; as of :class:`pyvista.Plotter`.
        screenshot : path, optional
            Write the picture to this file.
        window_size : (int, int)
            Pixels.

        Returns
        -------
        As :meth:`pyvista.Plotter.show`: in a notebook a view.
        """
        assembly = self.assembly(roles, dimension=dimension)
        blocks = pv.UnstructuredGrid(block_grid(assembly))
        blocks.cell_data["colour"] = palette.role_colours(assembly)
        plotter = pv.Plotter(off_screen=off_screen, window_size=list(window_size))
        plotter.background_color = "white"
        if assembly.dimension == 2:
            # Triangulated first: VTK fills bent polygons wrongly.
            plotter.add_mesh(blocks.triangulate(), scalars="colour", rgb=True, lighting=False)
        else:
            plotter.add_mesh(blocks, scalars="colour", rgb=True, ambient=0.4, diffuse=0.6)
        edges = plotter.add_mesh(blocks.extract_all_edges(), color=palette.OUTLINE, line_width=1.5, lighting=False)
        drawn_forward(edges, 1.0)
        flat = assembly.dimension == 2
        view = View(AROUND[0], ABOVE)
        if names:
            if flat:
                places = np.column_stack([assembly.centroids, np.zeros(assembly.n_blocks)])
            else:
                places = showing_faces(assembly.polyhedra, view.axes[2])[0]
            labels = [
                name if free else f"{name} ({role})"
                for name, role, free in zip(assembly.names, assembly.roles, assembly.free, strict=True)
            ]
            plotter.add_point_labels(
                places, labels, shape=None, show_points=False, always_visible=flat, font_size=14,
                text_color=palette.INK, justification_horizontal="center", justification_vertical="center",
            )  # fmt: skip
        plotter.enable_parallel_projection()
        if flat:
            plotter.view_xy()
            width, height = np.ptp(assembly.vertices, axis=0)
        else:
            plotter.view_vector(view.axes[2], viewup=(0.0, 0.0, 1.0))
            low, high = assembly.vertices.min(axis=0), assembly.vertices.max(axis=0)
            # The camera looks at the middle of the box around the blocks.
            width, height = 2.0 * np.abs(view.projected(assembly.vertices - (low + high) / 2.0)).max(axis=0)
        plotter.camera.parallel_scale = 0.55 * max(height, width * window_size[1] / window_size[0])
        return plotter.show(screenshot=False if screenshot is None else str(screenshot))


def _check_options(options: Mapping[str, Any]) -> None:
    """Refuse what is no option of an assembly or a structure; what describes a settlement is told where it goes."""
    of = BlockvisAccessor
    known = {*inspect.signature(of.assembly).parameters, *inspect.signature(of.structure).parameters}
    known -= {"self", "roles", "options"}
    settlements = [field.name for field in fields(solver.Settlement)]
    for name in options:
        if name in settlements:
            raise TypeError(
                f"{name} is part of a solver.Settlement: give phases = [solver.Settlement({name}=..., ...)] to settle()"
            )
        if name not in known:
            raise TypeError(
                f"there is no option '{name}'{nearest(name, sorted(known))}; there are {', '.join(sorted(known))}"
            )


pv.register_dataset_accessor("blockvis", pv.DataObject)(BlockvisAccessor)
