"""Which blocks a case means: by their names and materials, or by a point of the drawing."""

from __future__ import annotations

import warnings
from collections.abc import Sequence

import numpy as np
import shapely
from numpy.typing import ArrayLike

import solver
from blockvis.layout.left_out import matches
from blockvis.layout.outlines import ROUNDING
from blockvis.text import listed, nearest, place_text


def blocks_called(name: str, assembly: solver.Assembly) -> list[int]:
    """Numbers of the blocks that have a name, their own or the one with which they were drawn."""
    return [i for i, both in enumerate(zip(assembly.names, assembly.drawn_names, strict=True)) if name in both]


def blocks_matching(pattern: str, assembly: solver.Assembly, where: str) -> list[int]:
    """Numbers of the blocks that have a name; of none those whose name fits the pattern, else whose material does.

    ValueError, which begins with where the pattern stands, if there is none.
    """
    found = blocks_called(pattern, assembly) or named_like(pattern, assembly.names)
    found = found or [i for i in named_like(pattern, assembly.materials) if assembly.materials[i]]
    if not found:
        materials = [*dict.fromkeys(filter(None, assembly.materials))]
        known = f"the blocks are {listed(assembly.names, 12)}"
        known += f"; the materials are {listed(materials, 12)}" if materials else ""
        near = nearest(pattern, [*assembly.names, *materials])
        raise ValueError(f"{where}: no block and no material is named '{pattern}'{near}; {known}")
    return found


def named_like(pattern: str, names: Sequence[str]) -> list[int]:
    """Numbers of the names that fit a pattern."""
    return [i for i, name in enumerate(names) if matches([name], [pattern])]


def distances_to(assembly: solver.Assembly, point: ArrayLike) -> np.ndarray:
    """(n_blocks,) array [m]: how far each block as drawn is from a point [m], zero for those that hold it."""
    if assembly.dimension == 2:
        outlines = np.array([shapely.Polygon(assembly.outline(block)) for block in range(assembly.n_blocks)])
        return np.asarray(shapely.distance(outlines, shapely.Point(point)))
    parts, point = assembly.polyhedra.parts, np.asarray(point)
    solids = parts.solids
    faces, corners = solids.faces(solids.vertices), solids.vertices[solids.corners]
    beyond = ((point - faces.middles) * faces.normals).sum(axis=1)
    along, reach = corners[solids.next_corner] - corners, point - corners
    shares = np.clip((reach * along).sum(axis=1) / (along * along).sum(axis=1), 0.0, 1.0)
    to_edges = np.linalg.norm(reach - shares[:, None] * along, axis=1)
    inward = (np.cross(faces.normals[solids.face_of_corner], along) * reach).sum(axis=1)
    first = solids.face_offsets[:-1]
    over = np.minimum.reduceat(inward, first) >= 0.0
    to_faces = np.where(over, np.abs(beyond), np.minimum.reduceat(to_edges, first))
    first = solids.faces_of_block[:-1]
    outside = np.maximum.reduceat(beyond, first) > 0.0
    found = np.full(assembly.n_blocks, np.inf)
    np.minimum.at(found, parts.block_of_part, np.where(outside, np.minimum.reduceat(to_faces, first), 0.0))
    return found


def note_outside(assembly: solver.Assembly, point: Sequence[float], block: int, where: str, role: str) -> None:
    """Warn of a point [m] further outside the block that goes with it than a block is large.

    ``role`` says what the block does, as "on which the force acts".
    """
    corners = assembly.vertices[assembly.block_of_vertex == block]
    apart = float(np.linalg.norm(point - np.clip(point, corners.min(axis=0), corners.max(axis=0))))
    if apart > assembly.block_size:
        warnings.warn(
            f"{where} {place_text(point, 6)} lies {apart:.3g} m outside block '{assembly.names[block]}', {role} all "
            "the same: is it in m?",
            stacklevel=3,
        )


def block_at(
    assembly: solver.Assembly,
    point: Sequence[float],
    chosen: np.ndarray,
    towards: Sequence[float],
    where: str,
    gone: np.ndarray,
) -> int:
    """Find the block, among those chosen, that holds a point [m]; what is ``gone`` holds nothing.

    Of several that meet there it is the one into which a direction leads, as of a force, then the one whose centroid is
    nearest, and a warning names it. ValueError if none of them that is left holds the point; names the nearest and how
    far it is.
    """
    apart = distances_to(assembly, point)
    holding = chosen[apart[chosen] <= ROUNDING * assembly.block_size]
    place = place_text(point, 6)
    if len(holding) == 0:
        nearest = int(chosen[apart[chosen].argmin()])
        other = int(apart.argmin())
        inside = ""
        if apart[other] <= ROUNDING * assembly.block_size:
            what = "support" if not assembly.free[other] else "block"
            inside = f"; it lies in the {what} '{assembly.names[other]}', which is not meant"
        raise ValueError(
            f"{where} {place} m lies in none of the blocks meant; the nearest is '{assembly.names[nearest]}', "
            f"{apart[nearest]:.3g} m away{inside}; give a point of a block"
        )
    if gone[holding].all():
        raise ValueError(
            f"{where} {place} m lies in '{assembly.names[holding[0]]}', which [[remove]] has taken away by then; give "
            "a point of a block that is left"
        )
    holding = holding[~gone[holding]]
    if len(holding) == 1:
        return int(holding[0])
    size = float(np.linalg.norm(towards))
    ahead = np.asarray(point, dtype=float) + 1e-3 * assembly.block_size * np.asarray(towards, dtype=float) / (
        size or 1.0
    )
    near = np.linalg.norm(assembly.centroids[holding] - np.asarray(point), axis=1)
    into = np.round(distances_to(assembly, ahead)[holding] / (ROUNDING * assembly.block_size))
    block, *others = holding[np.lexsort((*assembly.centroids[holding].T, near, into))].tolist()
    beside = listed([f"'{assembly.names[other]}'" for other in others])
    warnings.warn(
        f"{where} {place} m lies on a joint: '{assembly.names[block]}' is taken, not {beside}; for another move the "
        "point into it, or name it",
        stacklevel=3,
    )
    return int(block)
