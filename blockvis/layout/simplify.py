"""Outlines finer than needed, simplified within a tolerance, neighbours along the same edges."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .joints.trimming import with_corners_on_edges

#: Outlines of more corners than this in the mean are finer than needed: every corner at a joint is a contact.
FINE = 24

#: Corners go within this fraction of the size of the median block (the root of its area).
TOLERANCE = 0.01


def default_tolerance(outlines: Sequence[np.ndarray]) -> float:
    """Find the tolerance [m] within which outlines are simplified by default; 0 where they are not fine."""
    if sum(map(len, outlines)) <= FINE * len(outlines):
        return 0.0
    import shapely

    return TOLERANCE * float(np.sqrt(np.median(shapely.area(np.array([shapely.Polygon(ring) for ring in outlines])))))


def simplified(outlines: Sequence[np.ndarray], tolerance: float) -> tuple[list[np.ndarray], str]:
    """Drop corners of outlines; edges that blocks share stay shared.

    Parameters
    ----------
    outlines : sequence of (n, 2) arrays [m]
        Counter-clockwise.
    tolerance : float [m]
        Farthest that a dropped corner may lie from the outline that is left.

    Returns
    -------
    outlines : list of (n, 2) arrays [m]
    note : str
        What was dropped; "" for nothing.
    """
    import shapely
    from scipy.spatial import cKDTree

    before = sum(map(len, outlines))
    if tolerance <= 0.0:
        return list(outlines), ""
    points = np.concatenate(outlines)
    origin = points.mean(axis=0)
    index, size = cKDTree(points - origin), float(np.ptp(points, axis=0).max())
    # Neighbours share an edge only between corners that both have.
    rings = [with_corners_on_edges(ring - origin, points - origin, index, 1e-9 * size) for ring in outlines]
    drawn = np.array([shapely.Polygon(ring) for ring in rings])
    step, moved = tolerance, np.inf
    # The simplification drops corners by the area of triangles; how far that moves outlines is measured.
    for _ in range(12):
        simple = shapely.coverage_simplify(drawn, step)
        whole = shapely.is_valid(simple) & ~shapely.is_empty(simple) & (shapely.get_type_id(simple) == 3)
        simple = np.where(whole, simple, drawn)
        moved = float(shapely.hausdorff_distance(simple.tolist(), drawn.tolist()).max())
        if moved <= tolerance:
            break
        step /= 1.5
    else:
        return list(outlines), ""
    found = [np.array(shapely.orient_polygons(shape).exterior.coords)[:-1] + origin for shape in simple]
    after = sum(map(len, found))
    if after >= before:
        return list(outlines), ""
    return found, (
        f"outlines were finer than needed: {before} corners of {len(outlines)} blocks were simplified to {after} "
        f"within {tolerance:.2g} m (outline_tolerance; 0 keeps every corner)"
    )
