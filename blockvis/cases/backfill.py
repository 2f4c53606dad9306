"""Fill over arches and vaults: the tables [[backfill]], and the loads that are made of them."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import chain
from typing import Any

import numpy as np
import shapely

import solver
from blockvis.layout.outlines import ROUNDING, ring_of, uncovered
from blockvis.layout.solids import plan_beyond
from blockvis.text import listed

from .block_at import blocks_matching
from .key import NOT_NEGATIVE, NUMBER, POSITIVE, TEXTS, Key, Section
from .toml_table import Table

BACKFILL = Section(
    "backfill",
    "Loose fill over arches and vaults: its weight and pressure on what looks upwards and sees its surface",
    (
        Key("over", TEXTS, "Names of the blocks under it, or patterns of them, or materials", ["voussoir *"],
            required=True, remedy='name the blocks under the fill: over = ["voussoir *"]'),
        Key("surface", NUMBER, "Height of its top, which is level", 2.5, "m", required=True,
            remedy="give the height of the fill's top in m"),
        Key("unit_weight", POSITIVE, "Weight of a cubic metre of it", 18000.0, "N/m³", required=True,
            remedy="give the weight of a cubic metre in N, for instance 18000.0"),
        Key("pressure_coefficient", NOT_NEGATIVE, "Horizontal pressure as a part of the vertical one", 0.5,
            default=0.0),
    ),
    several=True,
)  # fmt: skip


def read_backfill(table: Table) -> dict[str, Any]:
    """Read a table [[backfill]]: what :func:`lay_backfill` takes beside an assembly."""
    values = BACKFILL.read(table)
    if not values["over"]:
        raise table.error("over", 'is empty; name the blocks under the fill: over = ["voussoir *"]')
    return values | {"where": f"{table.source}: [{table.where}]"}


def backfills(entries: Sequence[Mapping[str, Any]], assembly: solver.Assembly) -> tuple[solver.Backfill, ...]:
    """Make the fills of a case, as :func:`read_backfill` reads them; several over a block lie one on another.

    ValueError for a name that no free block has, a surface below the extrados of a block, blocks of which none sees it,
    and two fills over a block up to the same surface.
    """
    laid = [lay_backfill(assembly, **entry) for entry in entries]
    for number, fill in enumerate(laid):
        for other in range(number):
            same = np.intersect1d(fill.block, laid[other].block)
            if len(same) and fill.surface == laid[other].surface:
                raise ValueError(
                    f"{entries[other]['where']} and {entries[number]['where'].rpartition(': ')[2]} both fill up to "
                    f"{fill.surface:g} m over block '{assembly.names[same[0]]}'; leave the block out of one, or give "
                    "another surface"
                )
    return tuple(part for fill in laid for part in _on_lower(fill, laid))


def _on_lower(fill: solver.Backfill, laid: Sequence[solver.Backfill]) -> list[solver.Backfill]:
    """Cut a fill into the part that lies on the blocks and those that lie on lower fills, each above their surface.

    What lies on another fill presses sideways as that which touches the block does.
    """
    base = np.full(len(fill.block), -np.inf)
    coefficient = np.full(len(fill.block), fill.pressure_coefficient)
    for other in sorted(laid, key=lambda other: -other.surface):
        under = np.isin(fill.block, other.block) & (other.surface < fill.surface)
        base[under] = np.maximum(base[under], other.surface)
        coefficient[under] = other.pressure_coefficient
    parts = []
    for level, k in np.unique(np.column_stack([base, coefficient]), axis=0).tolist():
        own = (base == level) & (coefficient == k)
        thickness = None if fill.thickness is None else fill.thickness[own]
        part = replace(fill, pieces=fill.pieces[own], block=fill.block[own], thickness=thickness)
        parts.append(replace(part, base=level, pressure_coefficient=k))
    return parts


def lay_backfill(
    assembly: solver.Assembly,
    over: str | Sequence[str],
    surface: float,
    unit_weight: float,
    pressure_coefficient: float = 0.0,
    *,
    where: str = "backfill",
) -> solver.Backfill:
    """Lay loose fill over blocks, on what of them looks upwards and sees its level surface.

    Parameters
    ----------
    assembly : solver.Assembly
    over : str or sequence of str
        Names or materials of the blocks under it, or patterns; supports among them carry none.
    surface : float [m]
        Height of its top.
    unit_weight : float [N/m³]
    pressure_coefficient : float
        Horizontal pressure as a part of the vertical one.
    where : str
        What messages begin with.

    Returns
    -------
    solver.Backfill
        For ``solver.Loads(dead, live, fills=(...,))``.

    Raises
    ------
    ValueError
        For a name that no free block has, a surface below the extrados of a block, blocks of which none sees it, a
        unit weight that is not positive, a negative coefficient.
    """
    names = (over,) if isinstance(over, str) else tuple(over)
    for key, value, least in (("unit_weight", unit_weight, 1e-300), ("pressure_coefficient", pressure_coefficient, 0)):
        if not least <= value < np.inf:
            raise ValueError(f"{where} {key} is {value:g}; give a number {'of at least' if least == 0 else 'above'} 0")
    if not np.isfinite(surface):
        raise ValueError(f"{where} surface is {surface:g} m; give the height of its top, a finite number")
    named = [blocks_matching(name, assembly, f"{where} over") for name in names]
    chosen = assembly.free & np.isin(np.arange(assembly.n_blocks), [*chain(*named)])
    if not chosen.any():
        raise ValueError(f"{where} over: '{listed(names)}' are supports only; fill loads free blocks: name one")
    d, small = assembly.dimension, ROUNDING * assembly.block_size
    seen, owners = (_segments if d == 2 else _triangles)(assembly, chosen, surface, small)
    pieces, block = np.array(seen, dtype=float).reshape(-1, d, d), np.array(owners, dtype=int)
    if not len(pieces):
        raise ValueError(f"{where} over: none of '{listed(names)}' looks up to the surface; name the topmost blocks")
    bare = [f"'{name}'" for name, own in zip(names, named, strict=True) if not np.isin(own, block).any()]
    if bare:
        words = f"no fill lies on {listed(bare)}: no free block of that name looks up to the surface"
        warnings.warn(f"{where} over: {words}; name the topmost blocks", stacklevel=2)
    heights = pieces[:, :, -1].max(axis=1)
    highest = int(heights.argmax())
    if heights[highest] > surface + small:
        raise ValueError(
            f"{where} surface is {surface:g} m, below the extrados of block '{assembly.names[block[highest]]}', which "
            f"reaches {heights[highest]:.6g} m; raise it, or leave the block out of over"
        )
    thickness = assembly.thickness[block] if d == 2 else None
    return solver.Backfill(pieces, block, surface, unit_weight, pressure_coefficient, thickness)


def _segments(
    assembly: solver.Assembly, chosen: np.ndarray, surface: float, small: float
) -> tuple[list[np.ndarray], list[int]]:
    """Find the segments (2, 2) [m] of chosen blocks that look upwards and see a level surface [m], and their blocks.

    What other blocks hide is left out; what stands above the surface hides nothing.
    """
    start, stop = assembly.vertices, assembly.vertices[assembly.polygons.next_vertex]
    owner = assembly.block_of_vertex
    edges = np.flatnonzero(chosen[owner] & (start[:, 0] - stop[:, 0] > small))
    outlines = np.array([shapely.Polygon(assembly.outline(k)) for k in range(assembly.n_blocks)])
    top = float(assembly.vertices[:, 1].max()) + assembly.block_size
    # What lies above each edge.
    columns = [[start[e], stop[e], (stop[e, 0], top), (start[e, 0], top)] for e in edges]
    above = shapely.polygons(np.array(columns, dtype=float).reshape(-1, 4, 2))
    tree = shapely.STRtree(outlines)
    edge, other = tree.query(above, predicate="intersects")
    low = shapely.bounds(outlines)[:, 1]
    hides = low[other] < surface
    edge, other = edge[hides], other[hides]
    covers = shapely.intersection(above[edge], outlines[other])
    pieces, block = [], []
    order = np.argsort(edge, kind="stable")
    ends = np.searchsorted(edge[order], np.arange(len(edges) + 1))
    for k, e in enumerate(edges.tolist()):
        hidden = []
        for cover in shapely.get_parts(covers[order[ends[k] : ends[k + 1]]]):
            left, _, right, _ = cover.bounds or (0.0, 0.0, 0.0, 0.0)
            if cover.area > small * max(right - left, small):
                hidden.append((left, right))
        for left, right in uncovered(float(stop[e, 0]), float(start[e, 0]), hidden):
            if right - left <= small:
                continue
            parts = (np.array([[right], [left]]) - start[e, 0]) / (stop[e, 0] - start[e, 0])
            pieces.append(start[e] + parts * (stop[e] - start[e]))
            block.append(int(owner[e]))
    return pieces, block


def _triangles(
    assembly: solver.Assembly, chosen: np.ndarray, surface: float, small: float
) -> tuple[list[np.ndarray], list[int]]:
    """Find triangles (3, 3) [m] in space, as :func:`_segments` finds segments in the plane."""
    shapes, solids = assembly.polyhedra, assembly.polyhedra.parts.solids
    faces = shapes.faces(shapes.vertices)
    chosen_faces = np.flatnonzero(chosen[shapes.block_of_face] & (faces.normals[:, 2] > ROUNDING))
    plans = [shapes.vertices[shapes.corners[slice(*shapes.face_offsets[f : f + 2])]] for f in chosen_faces]
    seen = np.array([shapely.Polygon(plan[:, :2]) for plan in plans])
    bodies = [solids.surface(k)[0] for k in range(len(solids))]
    footprints = np.array([shapely.MultiPoint(points[:, :2]).convex_hull for points in bodies])
    low = np.minimum.reduceat(solids.vertices[:, 2], solids.offsets[:-1])
    face, part = shapely.STRtree(footprints).query(seen, predicate="intersects")
    touching = shapely.area(shapely.intersection(seen[face], footprints[part])) > small * assembly.block_size
    pieces, block = [], []
    for k, f in enumerate(chosen_faces.tolist()):
        normal, middle = faces.normals[f], faces.middles[f]
        left = seen[k]
        for p in part[(face == k) & touching].tolist():
            if low[p] >= surface:
                continue
            height = (bodies[p] - middle) @ normal / normal[2]
            if height.max() > small:
                left = left.difference(plan_beyond(bodies[p], height, small))
        for polygon in shapely.get_parts(left):
            if polygon.area <= small * assembly.block_size:
                continue
            for triangle in map(ring_of, shapely.get_parts(shapely.constrained_delaunay_triangles(polygon))):
                rise = -((triangle - middle[:2]) @ normal[:2]) / normal[2]
                pieces.append(np.column_stack([triangle, middle[2] + rise]))
                block.append(int(shapes.block_of_face[f]))
    return pieces, block
