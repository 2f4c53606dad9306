"""Loads on surfaces: pressure on an edge or on all that a direction meets, and a load that moves over the structure."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from .assembly import Assembly
from .loads import PointForces, chosen_blocks
from .tolerances import COMPUTED_GAP
from .words import numbers_of, plain


def edge_pressure(assembly: Assembly, block: int, edge: int, pressure: float) -> np.ndarray:
    """Load one edge of a block with a uniform pressure perpendicular to it: :func:`edge_force` as drawn.

    Parameters
    ----------
    assembly : Assembly
    block : int
    edge : int
        Number of the edge within the block: it runs from corner ``edge`` to the next, counter-clockwise from the
        first corner that was given.
    pressure : float [Pa]
        Positive into the block.

    Returns
    -------
    (n_blocks, 3) array [N, N, N·m]
    """
    return edge_force(assembly, block, edge, pressure).load(assembly)


def edge_force(assembly: Assembly, block: int, edge: int, pressure: float) -> PointForces:
    """Find the resultant of a uniform pressure on an edge, which keeps its direction; as :func:`edge_pressure`."""
    chosen_blocks(assembly, block)
    ring, edge = assembly.outline(block), plain(edge, "int", "edge")
    if not 0 <= edge < len(ring):
        raise ValueError(f"block '{assembly.names[block]}' has {len(ring)} edges; edge {edge} is none of them")
    start, stop = ring[edge], ring[(edge + 1) % len(ring)]
    inward = np.array([start[1] - stop[1], stop[0] - start[0]])
    force = plain(pressure, "float", "pressure") * float(assembly.thickness[block]) * inward
    return PointForces.at(block, force, (start + stop) / 2.0)


def surface_pressure(
    assembly: Assembly, pressure: float, direction: Sequence[float] = (0.0, -1.0), *, blocks: ArrayLike | None = None
) -> np.ndarray:
    """Load the faces that a direction meets first with a uniform pressure: :func:`surface_forces` as drawn.

    Parameters
    ----------
    assembly : Assembly
    pressure : float [Pa]
        Per area perpendicular to the direction, as snow is given per area in plan.
    direction : (2,) sequence
        Where the pressure pushes: downwards by default.
    blocks : (n,) int or (n_blocks,) bool array, optional
        The blocks that it acts on; by default all free ones. Blocks in front of others shield them in any case.

    Returns
    -------
    (n_blocks, 3) array [N, N, N·m]
    """
    return surface_forces(assembly, pressure, direction, blocks=blocks).load(assembly)


def surface_forces(
    assembly: Assembly,
    pressure: float,
    direction: Sequence[float] = (0.0, -1.0),
    *,
    blocks: ArrayLike | None = None,
    removed: np.ndarray | None = None,
) -> PointForces:
    """Find the forces of a uniform pressure on what a direction meets first: snow on a top, wind on a flank.

    As :func:`surface_pressure`; each acts where it meets its block, and goes with it. Blocks of ``removed``, an
    (n_blocks,) bool array, have been taken away and shield nothing.
    """
    push = numbers_of(direction, "pressure direction")
    if push.shape != (2,) or not 0.0 < (size := float(np.hypot(*push))) < np.inf:
        raise ValueError(f"pressure direction is {push.tolist()}; give the direction in which it pushes, two numbers")
    push, pressure = push / size, plain(pressure, "float", "pressure")
    across = np.array([-push[1], push[0]])
    chosen = assembly.free if blocks is None else chosen_blocks(assembly, blocks)
    strips, depth, edge = _first_met(assembly, push, across, removed)
    centre, block = (strips[:-1] + strips[1:]) / 2.0, assembly.block_of_vertex[edge]
    loaded = (edge >= 0) & chosen[block]
    points, owner = centre[loaded, None] * across + depth[loaded, None] * push, block[loaded]
    forces = (pressure * np.diff(strips)[loaded] * assembly.thickness[owner])[:, None] * push
    return PointForces(owner, forces, points)


def load_on_top(assembly: Assembly, x: float, force: Sequence[float] = (0.0, -1.0)) -> np.ndarray:
    """Load the topmost surface at a place with a force: one position of a load that moves along an arch or a wall.

    Parameters
    ----------
    assembly : Assembly
    x : float [m]
        Where two blocks meet, seen from above, the higher one carries it, of level ones that to the left.
    force : (2,) sequence [N]

    Returns
    -------
    (n_blocks, 3) array [N, N, N·m]

    Raises
    ------
    ValueError
        Where nothing is below, or a support.
    """
    return force_on_top(assembly, x, force).load(assembly)


def force_on_top(assembly: Assembly, x: float, force: Sequence[float] = (0.0, -1.0)) -> PointForces:
    """Put a force on the topmost surface at a place, which goes with its block; as :func:`load_on_top`."""
    x = plain(x, "float", "x")
    strips, _, edges = _first_met(assembly, np.array([0.0, -1.0]), np.array([1.0, 0.0]))
    near = COMPUTED_GAP * assembly.block_size
    met = np.pad(edges, 1, constant_values=-1)[np.searchsorted(strips, [x - near, x + near])]
    if len(met := met[met >= 0]) == 0:
        raise ValueError(
            f"nothing is below a load at x = {x:g} m; the structure reaches from {strips[0]:g} to {strips[-1]:g} m"
        )
    (x0, y0), (x1, y1) = assembly.vertices[met].T, assembly.vertices[assembly.polygons.next_vertex[met]].T
    tops = y0 + (x - x0) / (x1 - x0) * (y1 - y0)
    first = int(np.argmax(tops >= tops.max() - near))
    if not assembly.free[owner := int(assembly.block_of_vertex[met[first]])]:
        raise ValueError(f"the load at x = {x:g} m stands on the support '{assembly.names[owner]}'")
    return PointForces.at(owner, force, (x, float(tops[first])))


def _first_met(
    assembly: Assembly, push: np.ndarray, across: np.ndarray, removed: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Divide the structure into strips along a direction, between all corners, and find what each meets first.

    Gives the ends of the strips, (n + 1,) [m] across, the depth in the middle of each, infinite where there is no
    block, and the edge there, by the vertex it starts at, -1 where there is none.
    """
    start, stop = assembly.vertices, assembly.vertices[assembly.polygons.next_vertex]
    a, b = start @ across, stop @ across
    strips = np.unique(np.concatenate([a, b]))
    # Narrower ones are rounding of the drawing.
    strips = strips[np.append(True, np.diff(strips) > 1e-12 * (strips[-1] - strips[0]))]
    centre = (strips[:-1] + strips[1:]) / 2.0
    depth, met = np.full(len(centre), np.inf), np.full(len(centre), -1)
    first, last = np.searchsorted(centre, np.minimum(a, b)), np.searchsorted(centre, np.maximum(a, b))
    there = True if removed is None else ~removed[assembly.block_of_vertex]
    for edge in np.flatnonzero((last > first) & there).tolist():
        under = slice(int(first[edge]), int(last[edge]))
        part = (centre[under] - a[edge]) / (b[edge] - a[edge])
        at = start[edge] @ push + part * float((stop[edge] - start[edge]) @ push)
        nearer = at < depth[under]
        depth[under] = np.where(nearer, at, depth[under])
        met[under] = np.where(nearer, edge, met[under])
    return strips, depth, met
