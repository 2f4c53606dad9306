"""What fills the outlines of supports: hatch lines."""

from __future__ import annotations

import numpy as np
import shapely

import solver


def hatch_lines(
    assembly: solver.Assembly, supports: np.ndarray, low: np.ndarray, high: np.ndarray, spacing: float
) -> tuple[np.ndarray, np.ndarray]:
    """Hatch the supports.

    Parameters
    ----------
    assembly : solver.Assembly
    supports : (n_supports,) int array
    low, high : (2,) arrays [m]
        Corners of the box beyond which nothing is hatched.
    spacing : float [m]
        Between two lines.

    Returns
    -------
    ends : (2 n, 2) array [m]
        Both ends of each line, as laid out.
    blocks : (2 n,) int array
        The support of each end.
    """
    box = shapely.box(*low, *high)
    points, blocks = [np.zeros((0, 2))], [np.zeros(0, dtype=int)]
    for block in supports:
        area = shapely.intersection(shapely.Polygon(assembly.outline(int(block))), box)
        if area.is_empty:
            continue
        x0, y0, x1, y1 = area.bounds
        # Lines x - y = constant at multiples of the spacing, the same over all supports.
        step = spacing * np.sqrt(2.0)
        levels = np.arange(np.ceil((x0 - y1) / step), np.floor((x1 - y0) / step) + 1) * step
        if len(levels) == 0:
            continue
        reach = np.array([[y0, y1]])
        ends = np.stack([levels[:, None] + reach, np.broadcast_to(reach, (len(levels), 2))], axis=2)
        parts = shapely.get_parts(shapely.intersection(shapely.linestrings(ends), area))
        parts = parts[shapely.get_type_id(parts) == 1]
        parts = parts[shapely.get_num_points(parts) == 2]
        coordinates = shapely.get_coordinates(parts)
        points.append(coordinates)
        blocks.append(np.full(len(coordinates), block))
    return np.concatenate(points), np.concatenate(blocks)
