"""The order in which each family of mesh files numbers the nodes of a surface cell."""

from __future__ import annotations

import numpy as np


def _around(corners: int, order: int) -> tuple[int, ...]:
    """List the nodes from corner to corner, those of curved sides between them; nodes inside the cell are left out."""
    sides = [range(corners + k * (order - 1), corners + (k + 1) * (order - 1)) for k in range(corners)]
    return tuple(node for k, side in enumerate(sides) for node in (k, *side))


QUADRATIC_TRIANGLE, QUADRATIC_QUADRANGLE = _around(3, 2), _around(4, 2)

#: VTK numbers the corners of a pixel row by row.
PIXEL = (0, 1, 3, 2)

#: Cells whose nodes are in order around them already: straight sides, any number of corners.
STRAIGHT = None

#: By gmsh's element type.
GMSH = {
    2: STRAIGHT, 3: STRAIGHT, 9: QUADRATIC_TRIANGLE, 10: QUADRATIC_QUADRANGLE, 16: QUADRATIC_QUADRANGLE,
    20: _around(3, 3), 21: _around(3, 3), 22: _around(3, 4), 23: _around(3, 4), 24: _around(3, 5), 25: _around(3, 5),
    36: _around(4, 3), 39: _around(4, 3), 37: _around(4, 4), 40: _around(4, 4), 38: _around(4, 5), 41: _around(4, 5),
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
    """Put the nodes (..., n_nodes) of cells of one type in order around each: an entry of a table above."""
    return nodes if order is None else nodes[..., list(order)]
