"""From volume cells of any mesh to bodies: the skin of each, the cells of one body kept together."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from blockvis.layout.linked import equal_rows
from solver.mechanics import linked

from .bodies import Body

#: Faces of a cell by its corners, in the numbering that gmsh, VTK and meshio share.
TETRAHEDRON = ((0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2))
HEXAHEDRON = ((0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7))
WEDGE = ((0, 2, 1), (3, 4, 5), (0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5))
PYRAMID = ((0, 3, 2, 1), (0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4))

Faces = tuple[tuple[int, ...], ...]

#: By gmsh's element type; cells of higher order have their corners first.
GMSH_SOLIDS: dict[int, Faces] = {
    4: TETRAHEDRON, 11: TETRAHEDRON, 29: TETRAHEDRON, 30: TETRAHEDRON, 31: TETRAHEDRON,
    5: HEXAHEDRON, 12: HEXAHEDRON, 17: HEXAHEDRON, 92: HEXAHEDRON, 93: HEXAHEDRON,
    6: WEDGE, 13: WEDGE, 18: WEDGE, 7: PYRAMID, 14: PYRAMID, 19: PYRAMID,
}  # fmt: skip

#: By VTK's cell type. VTK numbers the corners of a voxel row by row.
VTK_SOLIDS: dict[int, Faces] = {
    10: TETRAHEDRON, 24: TETRAHEDRON, 71: TETRAHEDRON,
    12: HEXAHEDRON, 25: HEXAHEDRON, 29: HEXAHEDRON, 72: HEXAHEDRON,
    11: ((0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (1, 3, 7, 5), (3, 2, 6, 7), (2, 0, 4, 6)),
    13: WEDGE, 26: WEDGE, 73: WEDGE, 14: PYRAMID, 27: PYRAMID, 74: PYRAMID,
}  # fmt: skip

#: By the beginning of meshio's name of the cell type.
MESHIO_SOLIDS: dict[str, Faces] = {"tetra": TETRAHEDRON, "hexahedron": HEXAHEDRON, "wedge": WEDGE, "pyramid": PYRAMID}


def bodies_of_cells(
    points: np.ndarray, cells: Sequence[tuple[Faces, np.ndarray]], owner: np.ndarray, rows: Sequence[dict[str, Any]]
) -> list[Body]:
    """Find the skin of each body: the faces that belong to one of its cells only.

    Cells of one shape each are the corners of its faces, and (n, n_nodes) nodes; ``owner`` is the row of each cell, in
    their order. Cells of one owner that do not hang together by faces are bodies of their own.
    """
    faces, cell_of_face, start = [], [], 0
    for shape, nodes in cells:
        for corners in shape:
            missing = np.full((len(nodes), 4 - len(corners)), -1)
            faces.append(np.column_stack([nodes[:, list(corners)], missing]))
            cell_of_face.append(np.arange(start, start + len(nodes)))
        start += len(nodes)
    face, cell = np.concatenate(faces), np.concatenate(cell_of_face)
    key = np.sort(face, axis=1)
    piece = _pieces(key, cell, owner)
    _, index, counts = np.unique(np.column_stack([piece[cell], key]), axis=0, return_index=True, return_counts=True)
    skin = index[counts == 1]
    skin = skin[np.argsort(piece[cell[skin]], kind="stable")]
    owners = owner[np.unique(piece, return_index=True)[1]]
    sizes = np.bincount(piece[cell[skin]], minlength=len(owners))
    several = np.bincount(owners, minlength=len(rows)) > 1
    seen = np.zeros(len(rows), dtype=np.int64)
    bodies = []
    for own, whose in zip(np.split(skin, np.cumsum(sizes)[:-1]), owners.tolist(), strict=True):
        seen[whose] += 1
        used, triangles = np.unique(_triangles(face[own]), return_inverse=True)
        body = Body(rows[whose]["name"], points[used], triangles.reshape(-1, 3), rows[whose])
        bodies.append(body.piece(int(seen[whose])) if several[whose] else body)
    return bodies


def _pieces(faces: np.ndarray, cell_of_face: np.ndarray, owner: np.ndarray) -> np.ndarray:
    """(n_cells,) int array: number of the piece of each cell, those of one owner one after another."""
    one, other = (cell_of_face[face] for face in equal_rows(faces))
    kept = owner[one] == owner[other]
    one, other = one[kept], other[kept]
    piece = linked((one, other), len(owner))
    return np.unique(np.column_stack([owner, piece]), axis=0, return_inverse=True)[1].ravel()


def _triangles(faces: np.ndarray) -> np.ndarray:
    """(m, 3) int array: faces of four points cut in two, those of three as they are."""
    square = faces[faces[:, 3] >= 0]
    return np.concatenate([faces[faces[:, 3] < 0][:, :3], square[:, [0, 1, 2]], square[:, [0, 2, 3]]])
