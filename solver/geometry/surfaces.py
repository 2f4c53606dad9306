"""Closed surfaces of blocks in space: checked, and made into polyhedra with one face in each plane."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from solver.tolerances import DRAWN_GAP
from solver.words import numbers_of

from .convex_parts import NoParts
from .flat_faces import ONE_WAY, SLIVER, edges_of, merged_faces, renumbered
from .polyhedra import Polyhedra
from .portions import linked
from .solids import Solids, dot

#: A block with less volume than this fraction of its surface to the power 3/2 is a sheet, one with less area than this
#: fraction of its perimeter squared a line: double precision leaves about six digits of its centroid.
SMALLEST_SHAPE_FACTOR = 1e-9

#: What a block is in a file: its corners, and the corners around each of its faces.
Surface = tuple[ArrayLike, Sequence[Sequence[int]]]


def polyhedra_of(solids: Sequence[Surface], names: Sequence[str]) -> Polyhedra:
    """Make polyhedra of the closed surfaces of blocks, with one face in each plane; raises as ``from_solids`` says."""
    surfaces = [_checked(solid, name) for solid, name in zip(solids, names, strict=True)]
    joined = Polyhedra.of_surfaces(surfaces)
    # An edge of a closed surface is run through once in each sense.
    n, start, end = np.int64(len(joined.vertices)), joined.corners, joined.corners[joined.next_corner]
    _, number, counts = np.unique(start * n + end, return_inverse=True, return_counts=True)
    closed = np.isin(end * n + start, start * n + end) & (counts[number] == 1)
    for block in map(int, np.unique(joined.block_of_face[joined.face_of_corner[~closed]])):
        _refuse_open(*surfaces[block], names[block])
    _refuse_pieces(joined, names)
    volumes = joined.volumes
    for i in np.flatnonzero(np.abs(volumes) <= SMALLEST_SHAPE_FACTOR * joined.surfaces**1.5).tolist():
        raise ValueError(
            f"block {i} ('{names[i]}') has a volume of {abs(volumes[i]):.3g} m³ for a surface of "
            f"{joined.surfaces[i]:.3g} m²; it is a sheet, not a block: remove it or redraw it"
        )
    inside_out = np.flatnonzero(volumes < 0.0).tolist()
    for block in inside_out:
        vertices, faces = surfaces[block]
        surfaces[block] = vertices, [face[::-1] for face in faces]
    if inside_out:
        joined = Polyhedra.of_surfaces(surfaces)
    _refuse_warped(joined, names)
    flatness = DRAWN_GAP * joined.widths
    in_an_edge = np.flatnonzero(np.bincount(joined.corners) == 2)
    split = np.union1d(joined.block_of_face[_coplanar_faces(joined, flatness)], joined.block_of_vertex[in_an_edge])
    for block in split.tolist():
        surfaces[block] = merged_faces(surfaces[block], float(flatness[block]))
    shapes = Polyhedra.of_surfaces(surfaces) if len(split) else joined
    try:
        _ = shapes.parts
    except NoParts as error:
        block, why = error.args
        raise ValueError(f"block {block} ('{names[block]}') {why}") from None
    return shapes


def _checked(solid: Surface, name: str) -> tuple[np.ndarray, list[list[int]]]:
    try:
        corners, loops = solid
        vertices = numbers_of(corners, "what is given for corners")
        faces = [[int(corner) for corner in loop] for loop in loops]
    except (TypeError, ValueError) as error:
        raise ValueError(
            f"block '{name}' needs (x, y, z) corners and the numbers of the corners around each face: {error}"
        ) from None
    if vertices.ndim != 2 or vertices.shape[1] != 3 or len(vertices) < 4 or len(faces) < 4:
        raise ValueError(
            f"block '{name}' needs at least four (x, y, z) corners and four faces; the shape of its corners is "
            f"{vertices.shape}, and it has {len(faces)} faces"
        )
    refuse_infinite(vertices, name)
    for k, face in enumerate(faces):
        if len(face) > 1 and face[0] == face[-1]:
            face.pop()
        wrong = [corner for corner in face if not 0 <= corner < len(vertices)]
        if wrong:
            raise ValueError(
                f"block '{name}': face {k} has the corner {wrong[0]}; there are corners 0 to {len(vertices) - 1}"
            )
        if len(face) < 3:
            raise ValueError(f"block '{name}': face {k} has {len(face)} corners; a face needs at least three")
    return renumbered(vertices, faces)


def refuse_infinite(vertices: np.ndarray, name: str) -> None:
    """Raise ``ValueError`` for the first corner of a block that is nowhere."""
    for corner in np.flatnonzero(~np.isfinite(vertices).all(axis=1)).tolist():
        raise ValueError(
            f"block '{name}': corner {corner} is {vertices[corner].tolist()}; coordinates must be finite numbers"
        )


def _refuse_open(vertices: np.ndarray, faces: list[list[int]], name: str) -> None:
    """Say where a surface is not run through once in each sense along each edge."""
    owners: dict[tuple[int, int], list[int]] = {}
    for k, face in enumerate(faces):
        if len(set(face)) < len(face):
            twice = next(corner for corner in face if face.count(corner) > 1)
            raise ValueError(
                f"block '{name}': face {k} passes {_place(vertices[twice])} twice; split it into faces without holes"
            )
        for a, b in edges_of(face):
            owners.setdefault((min(a, b), max(a, b)), []).append(k)
    for (a, b), those in owners.items():
        edge = f"the edge from {_place(vertices[a])} to {_place(vertices[b])}"
        if len(those) != 2:
            many = "only one face meets" if len(those) == 1 else f"{len(those)} faces meet"
            raise ValueError(
                f"block '{name}': the surface is not closed; {many} {edge}, where two should; corners at the same "
                "place must be one"
            )
        if ((a, b) in edges_of(faces[those[0]])) == ((a, b) in edges_of(faces[those[1]])):
            raise ValueError(
                f"block '{name}': faces {those[0]} and {those[1]} run the same way along {edge}; turn one of them "
                "round: all must run counter-clockwise seen from outside"
            )


def _place(point: np.ndarray) -> str:
    return "({:.6g}, {:.6g}, {:.6g})".format(*point)


def _refuse_pieces(solids: Solids, names: Sequence[str]) -> None:
    which = linked(np.stack([solids.corners, solids.corners[solids.next_corner]]), len(solids.vertices))
    pieces = np.bincount(solids.block_of_vertex[np.unique(which, return_index=True)[1]], minlength=len(solids))
    i = int(pieces.argmax())
    if pieces[i] > 1:
        raise ValueError(
            f"block {i} ('{names[i]}') consists of {pieces[i]} separate surfaces; give each its own "
            "block, and fill cavities"
        )


def _refuse_warped(solids: Solids, names: Sequence[str]) -> None:
    faces, face = solids.faces(solids.vertices), solids.face_of_corner
    out = np.abs(dot(solids.vertices[solids.corners] - faces.middles[face], faces.normals[face]))
    block = solids.block_of_face[face]
    allowed = DRAWN_GAP * solids.widths[block]
    if (out > allowed).any():
        k = int((out / allowed).argmax())
        number = int(face[k] - solids.faces_of_block[block[k]])
        raise ValueError(
            f"block {block[k]} ('{names[block[k]]}'): face {number} is not plane: its corner "
            f"{_place(solids.vertices[solids.corners[k]])} is {out[k]:.3g} m out of it, more than {allowed[k]:.3g} m, "
            "a thousandth of the width of the block; flatten the face or split it into triangles"
        )


def _coplanar_faces(solids: Solids, flatness: np.ndarray) -> np.ndarray:
    """Faces that lie in the plane of a neighbour, as far as their corners at the ends of the common edge tell."""
    faces, face = solids.faces(solids.vertices), solids.face_of_corner
    beyond = solids.vertices[solids.corners[solids.next_corner[solids.next_corner[solids.twins]]]]
    out = np.abs(dot(beyond - faces.middles[face], faces.normals[face]))
    same = out <= flatness[solids.block_of_face[face]]
    same &= dot(faces.normals[face], faces.normals[face[solids.twins]]) > ONE_WAY
    largest = np.maximum.reduceat(faces.areas, solids.faces_of_block[:-1])
    return np.unique(np.append(face[same], np.flatnonzero(faces.areas <= SLIVER * largest[solids.block_of_face])))
