"""Arcs of circles and ellipses in drawings: corners of other outlines on an arc are its corners, too.

Two outlines that share an arc cut it at different places, as voussoirs do under spandrel stones. Chords from one cut to
the next are the same on both sides then: neither gaps nor overlaps are between them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from blockvis.layout.outlines import chords_of, sagitta

#: A corner lies on an arc within this fraction of the size of the median outline with arcs: less than the width of any
#: joint, more than what rounding of coordinates leaves.
ON_ARC = 1e-4

#: Ellipses with half axes of a larger ratio are lines.
FLATTEST = 1e6


@dataclass(frozen=True)
class Arc:
    """Part of an outline that is an arc, drawn by chords that are equal on its circle.

    Attributes
    ----------
    first, chords : int
        Number of the corner at which it starts, and of its chords.
    centre : (d,) array
    axes : (d, 2) array
        Its points are ``centre + axes @ (cos, sin)``: of a circle two radii, else conjugate half axes of an ellipse.
    start, sweep : float [rad]
        First angle and signed opening.
    """

    first: int
    chords: int
    centre: np.ndarray
    axes: np.ndarray
    start: float
    sweep: float

    @property
    def radius(self) -> float:
        """Radius of a circle, larger half axis of an ellipse."""
        return float(np.linalg.norm(self.axes, 2))

    @property
    def off(self) -> float:
        """Largest distance of its chords from it."""
        return sagitta(self.radius, self.sweep / self.chords)

    def mapped(self, matrix: np.ndarray, origin: np.ndarray) -> Arc:
        """Map it linearly: ``matrix`` is (d, d), ``origin`` where the origin goes."""
        return Arc(self.first, self.chords, matrix @ self.centre + origin, matrix @ self.axes, self.start, self.sweep)

    def at(self, angles: np.ndarray) -> np.ndarray:
        """(n, d) array: its points at angles [rad] from its start."""
        own = self.start + angles
        return self.centre + np.stack([np.cos(own), np.sin(own)], axis=1) @ self.axes.T


def with_shared_corners(
    curves: Sequence[np.ndarray], arcs: Sequence[Sequence[Arc]], tolerance: float | None
) -> list[np.ndarray]:
    """Give arcs a corner wherever a corner of a drawing lies on them.

    Parameters
    ----------
    curves : sequence of (n, 2) or (n, 3) arrays
        Outlines, closed or open, with the chords of their arcs; in space as seen along z.
    arcs : sequence of sequences of Arc
        Those of each outline in its order.
    tolerance : float or None
        Largest distance of an arc from its chords, as of :func:`blockvis.layout.outlines.chords_of`.

    Returns
    -------
    list of (n, 2) or (n, 3) arrays
    """
    import shapely

    own = [(k, arc) for k, of_curve in enumerate(arcs) for arc in of_curve if np.linalg.cond(arc.axes[:2]) < FLATTEST]
    if not own:
        return list(curves)
    seen = [curve[:, :2] for curve in curves]
    meets = ON_ARC * float(np.median([np.ptp(seen[k], axis=0).max() for k, _ in own]))
    corners = _corners(seen, arcs, meets)
    drawn = [
        shapely.LineString(np.take(seen[k], np.arange(arc.first, arc.first + arc.chords + 1), axis=0, mode="wrap"))
        for k, arc in own
    ]
    reach = np.array([arc.off for _, arc in own]) + meets
    which, corner = shapely.STRtree(shapely.points(corners)).query(drawn, "dwithin", reach)
    inverse = np.linalg.inv([arc.axes[:2] for _, arc in own])[which]
    outward = corners[corner] - np.array([arc.centre[:2] for _, arc in own])[which]
    x, y = np.einsum("nij,nj->ni", inverse, outward).T
    sweep = np.array([arc.sweep for _, arc in own])[which]
    along = (np.sign(sweep) * (np.arctan2(y, x) - np.array([arc.start for _, arc in own])[which])) % (2.0 * np.pi)
    ends = np.array([shapely.get_coordinates(line)[[0, -1]] for line in drawn])[which]
    apart = np.hypot(*np.moveaxis(corners[corner][:, None] - ends, -1, 0)).min(axis=1)
    # Towards the centre, which of an ellipse is no less than the distance.
    beside = np.abs(1.0 - 1.0 / np.maximum(np.hypot(x, y), 1e-9)) * np.hypot(*outward.T)
    on = np.flatnonzero((beside <= meets) & (along < np.abs(sweep)) & (apart > meets))
    on = on[np.lexsort((along[on], which[on]))]
    found = list(curves)
    # From the last arc of an outline to the first: corners that come before keep their numbers.
    for here in np.split(on, np.flatnonzero(np.diff(which[on])) + 1)[::-1] if len(on) else ():
        k, arc = own[which[here[0]]]
        cuts = np.sign(arc.sweep) * np.array([0.0, *along[here], abs(arc.sweep)])
        chords = [chords_of(angle, arc.radius, tolerance) for angle in np.diff(cuts)]
        angles = [np.linspace(cuts[i], cuts[i + 1], n + 1)[1:] for i, n in enumerate(chords)]
        points = arc.at(np.concatenate(angles)[:-1])
        points[np.cumsum(chords)[:-1] - 1, :2] = corners[corner[here]]
        found[k] = np.concatenate([found[k][: arc.first + 1], points, found[k][arc.first + arc.chords :]])
    return found


def _corners(curves: Sequence[np.ndarray], arcs: Sequence[Sequence[Arc]], meets: float) -> np.ndarray:
    """(n, 2) array: the corners of outlines that are none of chords alone, of those that meet the first one."""
    from scipy.spatial import cKDTree

    kept = []
    for curve, of_curve in zip(curves, arcs, strict=True):
        inner = [np.arange(arc.first + 1, arc.first + arc.chords) for arc in of_curve]
        kept.append(np.delete(curve, np.concatenate(inner), axis=0) if inner else curve)
    corners = np.unique(np.concatenate(kept), axis=0)
    earlier, later = cKDTree(corners).query_pairs(meets, output_type="ndarray").T
    return np.delete(corners, np.maximum(earlier, later), axis=0)
