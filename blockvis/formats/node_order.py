"""The order in which each family of mesh files numbers the nodes of a surface cell."""

from __future__ import annotations

import numpy as np

#: Nodes from corner to corner around a cell, the nodes of curved sides between them, nodes inside the cell left out.
QUADRATIC_TRIANGLE = (0, 3, 1, 4, 2, 5)
QUADRATIC_QUADRANGLE = (0, 4, 1, 5, 2, 6, 3, 7)
CUBIC_TRIANGLE = (0, 3, 4, 1, 5, 6, 2, 7, 8)
CUBIC_QUADRANGLE = (0, 4, 5, 1, 6, 7, 2, 8, 9, 3, 10, 11)

#: VTK numbers the corners of a pixel row by row.
PIXEL = (0, 1, 3, 2)

#: Cells whose nodes are in order around them already: straight sides, any number of corners.
STRAIGHT = None

#: By gmsh's element type.
GMSH = {
    2: STRAIGHT, 3: STRAIGHT, 9: QUADRATIC_TRIANGLE, 10: QUADRATIC_QUADRANGLE, 16: QUADRATIC_QUADRANGLE,
    21: CUBIC_TRIANGLE, 36: CUBIC_QUADRANGLE,
}  # fmt: skip

#: By meshio's name of the cell type.
MESHIO = {
    "triangle": STRAIGHT, "quad": STRAIGHT, "polygon": STRAIGHT, "triangle6": QUADRATIC_TRIANGLE,
    "triangle7": QUADRATIC_TRIANGLE, "quad8": QUADRATIC_QUADRANGLE, "quad9": QUADRATIC_QUADRANGLE,
}  # fmt: skip

#: By VTK's cell type.
VTK = {
    5: STRAIGHT, 7: STRAIGHT, 9: STRAIGHT, 8: PIXEL, 22: QUADRATIC_TRIANGLE, 34: QUADRATIC_TRIANGLE,
    23: QUADRATIC_QUADRANGLE, 28: QUADRATIC_QUADRANGLE,
}  # fmt: skip


def ring_of_nodes(nodes: np.ndarray, order: tuple[int, ...] | None) -> np.ndarray:
    """Put the nodes of cells of one type in order around each cell.

    Parameters
    ----------
    nodes : (n_nodes,) or (n_cells, n_nodes) int array
    order : tuple of int or None
        An entry of :data:`GMSH`, :data:`MESHIO` or :data:`VTK`.

    Returns
    -------
    (n_corners,) or (n_cells, n_corners) int array
    """
    return nodes if order is None else nodes[..., list(order)]
