"""From loose lines of a drawing to outlines: the faces between the lines."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

#: Ends of lines closer than this fraction of the size of the drawing meet.
MEETS = 1e-6


@dataclass(frozen=True)
class Line:
    """An open line of a drawing.

    Attributes
    ----------
    points : (n, 2) or (n, 3) array
    layer, handle : str
    must_close : bool
        Whether it is a polyline, and so part of an outline; a single line may also be a dimension or an axis.
    """

    points: np.ndarray
    layer: str
    handle: str
    must_close: bool


def faces_of_lines(lines: list[Line], path: Path) -> tuple[list[np.ndarray], list[str], int]:
    """Find the faces between lines.

    Parameters
    ----------
    lines : list of Line
    path : Path
        Named in messages.

    Returns
    -------
    faces : list of (n, 2) arrays
    layers : list of str
        The layer of most of the lines around each face.
    dangling : int
        Lines that enclose nothing.

    Raises
    ------
    ValueError
        For an open polyline, with its layer, handle and the ends of the gap; for a face with a hole.
    """
    import shapely

    flat = [line.points[:, :2] for line in lines]
    every = np.concatenate(flat)
    size = float(np.ptp(every, axis=0).max())
    segments = shapely.set_precision([shapely.LineString(points) for points in flat], MEETS * size)
    noded = shapely.union_all(segments, grid_size=MEETS * size)
    faces, cuts, dangles, _ = shapely.polygonize_full([noded])
    faces = list(faces.geoms)
    loose = shapely.union_all([dangles, cuts]).buffer(2 * MEETS * size)
    dangling = [k for k, segment in enumerate(segments) if shapely.covers(loose, segment)]
    for k in dangling:
        if lines[k].must_close:
            raise ValueError(_open_message(lines[k], path))
    tree = shapely.STRtree(segments)
    rings, layers = [], []
    for face in faces:
        if len(face.interiors):
            x, y = np.array(face.interiors[0].coords).mean(axis=0)
            raise ValueError(
                f"'{path}': the lines around ({x:.6g}, {y:.6g}) leave a face with a hole; cut the block in two, "
                "or draw the blocks as closed outlines"
            )
        ring = np.array(shapely.orient_polygons(face).exterior.coords)[:-1]
        middles = shapely.points((ring + np.roll(ring, -1, axis=0)) / 2.0)
        nearest = [lines[int(k)].layer for k in tree.nearest(middles)]
        rings.append(_sharpened(ring, every, MEETS * size))
        layers.append(max(sorted(set(nearest)), key=nearest.count))
    return rings, layers, len(dangling)


def _open_message(line: Line, path: Path) -> str:
    first, last = line.points[0], line.points[-1]
    gap = float(np.hypot(*(first - last)[:2]))
    return (
        f"'{path}': the polyline {line.handle} on layer '{line.layer}' is open: it starts at ({first[0]:.6g}, "
        f"{first[1]:.6g}) and ends at ({last[0]:.6g}, {last[1]:.6g}), {gap:.4g} apart; close it"
    )


def _sharpened(ring: np.ndarray, points: np.ndarray, reach: float) -> np.ndarray:
    """Move the corners from the grid on which lines were intersected back to the drawn points beside them."""
    from scipy.spatial import cKDTree

    distance, nearest = cKDTree(points).query(ring)
    return np.where((distance <= 2 * reach)[:, None], points[nearest], ring)
