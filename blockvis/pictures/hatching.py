"""Hatch lines, which fill supports and bodies of fill."""

from __future__ import annotations

import numpy as np
import shapely


def hatched(area: shapely.Geometry, spacing: float, rise: float) -> np.ndarray:
    """(n, 2, 2) array [m]: lines across an area, ``spacing`` [m] apart, that rise to the right by 1 or fall by -1.

    They lie at multiples of the spacing from the origin, the same in all areas.
    """
    if area.is_empty:
        return np.zeros((0, 2, 2))
    x0, y0, x1, y1 = area.bounds
    low, high = sorted((rise * y0, rise * y1))
    step = spacing * np.sqrt(2.0)
    levels = np.arange(np.ceil((x0 - high) / step), np.floor((x1 - low) / step) + 1) * step
    ends = np.stack([np.column_stack([levels + rise * y, np.full(len(levels), y)]) for y in (y0, y1)], axis=1)
    parts = shapely.get_parts(shapely.intersection(shapely.linestrings(ends), area))
    parts = parts[(shapely.get_type_id(parts) == 1) & (shapely.get_num_points(parts) == 2)]
    return np.asarray(shapely.get_coordinates(parts)).reshape(-1, 2, 2)
