"""What is wrong with the shapes of a drawing, and where: outlines that cross themselves, open surfaces, open lines."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import shapely

from .crossings import crossings_of
from .layout import Layout, Outline, assembly_of
from .outlines import ROUNDING, ends_of
from .solids import Solid
from .surfaces import same_points


@dataclass(frozen=True)
class Faults:
    """Places to look at in a drawing that is refused, and blocks that are none by themselves.

    Outlines cross themselves at (n, 2) crossings [m]; at (n, 2) ends of lines [m] no other begins; (n, 2, 3) edges of
    surfaces [m] do not belong to two faces.
    """

    blocks: tuple[int, ...] = ()
    crossings: np.ndarray = field(default_factory=lambda: np.zeros((0, 2)))
    ends: np.ndarray = field(default_factory=lambda: np.zeros((0, 2)))
    edges: np.ndarray = field(default_factory=lambda: np.zeros((0, 2, 3)))


def faults_of(layout: Layout, known: Sequence[int] = ()) -> Faults:
    """Find what is wrong with the shapes of a drawing as read, and blocks ``known`` to be at fault otherwise."""
    if layout.dimension == 3:
        open_edges = [_open_edges(*solid) for solid in layout.solids]
        blocks = {k for k, edges in enumerate(open_edges) if len(edges)} | set(known)
        return Faults(tuple(sorted(blocks)), edges=np.concatenate([np.zeros((0, 2, 3)), *open_edges]))
    # Debris has no area, and is no reason to refuse anything: what crosses itself is.
    crossings = {k: crossings_of(layout.outlines[k]) for k in no_blocks(layout.outlines)}
    blocks = {k for k, places in crossings.items() if len(places)} | set(known)
    return Faults(
        tuple(sorted(blocks)),
        crossings=np.concatenate([*crossings.values(), crossings_left_out(layout)]),
        ends=np.zeros((0, 2)) if blocks else _open_ends(layout),
    )


def no_blocks(shapes: Sequence[Outline | Solid]) -> list[int]:
    """Numbers of the outlines or solids that the solver refuses each by itself."""
    refused = []
    for k, shape in enumerate(shapes):
        try:
            assembly_of([shape])
        except ValueError:
            refused.append(k)
    return refused


def crossings_left_out(layout: Layout) -> np.ndarray:
    """(n, 2) array [m]: where outlines cross themselves that were left out unasked."""
    # A line that is drawn there and back is no crossing.
    other = ("asked", "no area", "sliver")
    rings = [item.points for item in layout.left_out if item.closed and item.kind not in other]
    return np.concatenate([np.zeros((0, 2)), *map(crossings_of, rings)])


def _open_ends(layout: Layout) -> np.ndarray:
    """(n, 2) array [m]: ends of lines that close nothing, where no other line is near."""
    lines = [item.points for item in layout.left_out if item.kind == "open" and len(item.points) > 1]
    if not lines:
        return np.zeros((0, 2))
    near = ROUNDING * float(np.ptp(np.concatenate(lines), axis=0).max())
    tree = shapely.STRtree([shapely.LineString(points) for points in lines])
    ends = ends_of(lines)
    end, other = tree.query(shapely.points(ends), "dwithin", near)
    met = np.zeros(len(ends), dtype=bool)
    met[end[other != end // 2]] = True
    closed = [bool(np.linalg.norm(points[0] - points[-1]) <= near) for points in lines]
    return np.asarray(ends[~met & ~np.repeat(closed, 2)])


def _open_edges(points: np.ndarray, faces: Sequence[Sequence[int]]) -> np.ndarray:
    """(n, 2, 3) array: edges of a surface that are those of one face, or of more than two."""
    if not np.isfinite(points).all():
        return np.zeros((0, 2, 3))
    same = same_points(points, ROUNDING * float(np.ptp(points, axis=0).max()))
    pairs = np.array([(face[k - 1], face[k]) for face in faces for k in range(len(face))])
    edges = np.sort(same[pairs], axis=1)
    edges = edges[edges[:, 0] != edges[:, 1]]
    unique, counts = np.unique(edges, axis=0, return_counts=True)
    return np.asarray(points[unique[counts != 2]])
