"""Layout: the blocks of a drawing before they become an assembly, whatever file they come from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

import solver

from .labels import LabelledBlocks
from .left_out import LeftOut
from .solid_layout import SolidLayout
from .solids import extruded


@dataclass(frozen=True)
class Layout(LabelledBlocks):
    """Outlines of blocks, with what else a drawing says of them.

    Attributes
    ----------
    outlines : tuple of (n, 2) arrays [m]
        Corners of each block in order, the first corner not repeated.
    names : tuple of str
        One per block; may repeat.
    thickness : (n_blocks,) array [m] or None
        Out of plane; NaN for a block of which the file says nothing.
    """

    outlines: tuple[np.ndarray, ...]
    names: tuple[str, ...]
    thickness: np.ndarray | None = field(default=None, kw_only=True)

    shapes_in = "outlines"
    dimension = 2

    def corners(self, block: int) -> np.ndarray:
        """(n, 2) array [m]: the corners of a block."""
        return self.outlines[block]

    def leaving_out(self, reasons: Mapping[int, LeftOut]) -> Layout:
        """Leave out these blocks, each for its reason."""
        if not reasons:
            return self
        named = [
            replace(item, name=self.names[i], layer=self.groups[i] or self.materials[i]) for i, item in reasons.items()
        ]
        others = self.chosen([i for i in range(self.n_blocks) if i not in reasons])
        return replace(others, left_out=(*self.left_out, *named))


#: A layout in the plane, or in space.
AnyLayout = Layout | SolidLayout


def layout_of(assembly: solver.Assembly, *, pose: solver.Pose | None = None) -> AnyLayout:
    """Make a layout of an assembly, with its blocks as drawn or as displaced in a pose."""
    vertices = assembly.vertices if pose is None else solver.moved_vertices(assembly, pose)
    roles = tuple(map(str, assembly.roles))
    if isinstance(assembly.shapes, solver.Polyhedra):
        shapes = assembly.shapes
        faces: list[list[list[int]]] = [[] for _ in assembly.names]
        rings = np.split(shapes.corners, shapes.face_offsets[1:-1])
        for block, ring in zip(shapes.block_of_face.tolist(), rings, strict=True):
            faces[block].append((ring - shapes.offsets[block]).tolist())
        return SolidLayout(
            solids=tuple(zip(np.split(vertices, shapes.offsets[1:-1]), faces, strict=True)),
            names=assembly.names,
            roles=roles,
            materials=assembly.materials,
            density=assembly.density,
        )
    return Layout(
        outlines=tuple(np.split(vertices, assembly.offsets[1:-1])),
        names=assembly.names,
        roles=roles,
        materials=assembly.materials,
        thickness=assembly.thickness,
        density=assembly.density,
    )


def standing(layout: Layout, thickness: float) -> SolidLayout:
    """Put a layout of the plane into space: upright, extruded along y by half of its thickness to each side.

    Parameters
    ----------
    layout : Layout
    thickness : float [m]
        Of blocks for which the layout has none.
    """
    depth = np.full(layout.n_blocks, np.nan) if layout.thickness is None else layout.thickness
    depth = np.where(np.isnan(depth), thickness, depth)
    return SolidLayout(
        solids=tuple(
            extruded(ring, -t / 2.0, t / 2.0) for ring, t in zip(layout.outlines, depth.tolist(), strict=True)
        ),
        names=layout.names,
        groups=layout.groups,
        roles=layout.roles,
        materials=layout.materials,
        density=layout.density,
        unit=layout.unit,
        notes=(*layout.notes, "the drawing in the plane was extruded along y by its thickness"),
        source=layout.source,
        left_out=layout.left_out,
    )
