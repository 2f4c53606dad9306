"""Notes on what a file draws that is no plane-faced stone, and is accepted as some."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np

from blockvis.layout.notes import CHANGED, Note
from blockvis.text import listed
from solver.mechanics import counted

#: Cosine of the fold between two triangles up to which they are read as one bent face: 30 degrees.
BENT_FACE = 0.866


def bend_of(points: np.ndarray, faces: Sequence[Sequence[int]]) -> tuple[float, np.ndarray]:
    """Find how far a corner is out of the plane of a face of four corners that was cut into two triangles.

    (n, 3) points, and those around each face; gives 0 where no two triangles make such a face, else the distance in the
    unit of the points, and the farthest corner.
    """
    triangles = [list(ring) for ring in faces if len(ring) == 3]
    of_edge = {(ring[k - 1], ring[k]): (number, ring[k - 2]) for number, ring in enumerate(triangles) for k in range(3)}
    normals = [np.cross(points[b] - points[a], points[c] - points[a]) for a, b, c in triangles]
    worst, place = 0.0, points[0]
    for (a, b), (number, apex) in of_edge.items():
        beside, other = of_edge.get((b, a), (-1, -1))
        if beside < 0:
            continue
        one, two = normals[number], normals[beside]
        sizes = float(np.linalg.norm(one) * np.linalg.norm(two))
        if sizes <= 0.0 or float(one @ two) < BENT_FACE * sizes:
            continue
        bend = abs(float((points[other] - points[apex]) @ one)) / float(np.linalg.norm(one))
        if bend > worst:
            worst, place = bend, points[other]
    return worst, place


def bent_note(bent: Sequence[tuple[float, float, str, np.ndarray]], n_blocks: int) -> tuple[Note, ...]:
    """Say that bent faces were accepted, cut into triangles; given are bend, the block's width and name, and corner."""
    if not bent:
        return ()
    bend, width, name, corner = max(bent, key=lambda one: one[0] / one[1])
    place = ", ".join(f"{x:.6g}" for x in corner)
    return (
        Note(
            CHANGED,
            f"bent faces of {len(bent)} of {counted(n_blocks, 'block')} were cut into triangles: a corner up to "
            f"{bend:.3g} in the file's unit, {100.0 * bend / width:.2g} % of the block, out of the plane of the "
            f"others, of '{name}' at ({place}); draw plane faces if the stone has some",
        ),
    )


def pieces_note(objects: Sequence[str], n_others: int) -> tuple[Note, ...]:
    """Say which objects hold several closed bodies, each of which became a block.

    Given are the object's name of each body that is a piece of one, and the number of the other bodies: a file of a
    single object holds all blocks by intention.
    """
    counts = Counter(objects)
    if not counts or (len(counts) == 1 and n_others == 0):
        return ()
    shown = listed([f"'{name}' ({counted(n, 'block')})" for name, n in counts.items()])
    return (
        Note(
            CHANGED,
            f"objects of several closed bodies that do not share a face became as many blocks: {shown}; join "
            "them in the drawing if each is one stone",
        ),
    )
