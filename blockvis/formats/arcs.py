"""Arcs and Bézier curves in drawings: corners of other outlines on a curve are its corners, too.

Two outlines that share a curve cut it at different places, as voussoirs do under spandrel stones. Chords from one cut
to the next are the same on both sides then: neither gaps nor overlaps are between them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import shapely
from scipy.spatial import cKDTree

from blockvis.layout.outlines import chords_of

#: Ends of lines that miss another line by up to this fraction of the size of the drawing meet it, and so do the ends of
#: an outline that misses itself by this fraction of its own size, and corners and the curves on which they lie: what
#: drawing by hand, or in single precision, leaves.
MEETS = 1e-4

#: Ellipses with half axes of a larger ratio are lines.
FLATTEST = 1e6

#: Most chords of one curve: finer than any drawing, and a bound on the memory that a small file can fill.
MOST_CHORDS = 512

#: Points of a Bézier curve among which the one next to a corner is looked for, and steps of Newton's method from there.
SAMPLES, STEPS = 33, 8


@dataclass(frozen=True)
class Arc:
    """Part of an outline that is an arc, drawn by chords that are equal on its circle.

    ``first`` is the number of the corner at which it starts. Its points are ``centre + axes @ (cos, sin)``, where axes
    (d, 2) are two radii of a circle or conjugate half axes of an ellipse, from the angle ``start`` over the signed
    opening ``sweep`` [rad].
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
        return self.radius * (1.0 - math.cos(self.sweep / self.chords / 2.0))

    @property
    def is_line(self) -> bool:
        """Whether it is none that is seen along z."""
        return not np.linalg.cond(self.axes[:2]) < FLATTEST

    def mapped(self, matrix: np.ndarray, origin: np.ndarray) -> Arc:
        """Map it linearly: ``matrix`` is (d, d), ``origin`` where the origin goes."""
        return replace(self, centre=matrix @ self.centre + origin, axes=matrix @ self.axes)

    def backwards(self, corners: int) -> Arc:
        """Where an outline of so many corners, the last one included, is drawn backwards."""
        first = corners - 1 - self.first - self.chords
        return replace(self, first=first, start=self.start + self.sweep, sweep=-self.sweep)

    def at(self, t: np.ndarray) -> np.ndarray:
        """(n, d) array: its points at parameters from 0 to 1."""
        own = self.start + self.sweep * t
        return self.centre + np.stack([np.cos(own), np.sin(own)], axis=1) @ self.axes.T

    def located(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Parameters, above 1 beyond its end, at which it is next to (n, 2) points, and how far away these are."""
        outward = points - self.centre[:2]
        x, y = np.linalg.solve(self.axes[:2], outward.T)
        along = (np.sign(self.sweep) * (np.arctan2(y, x) - self.start)) % (2.0 * np.pi)
        # Towards the centre, which of an ellipse is no less than the distance.
        beside = np.abs(1.0 - 1.0 / np.maximum(np.hypot(x, y), 1e-9)) * np.hypot(*outward.T)
        return along / abs(self.sweep), beside

    def chords_between(self, start: float, end: float, tolerance: float | None) -> int:
        """Count the chords of its part between two parameters."""
        return chords_of(self.sweep * (end - start), self.radius, tolerance)


@dataclass(frozen=True)
class Bezier:
    """Part of an outline that is a Bézier curve, drawn by chords of equal parts of its parameter.

    ``first`` is the number of the corner at which it starts, ``controls`` (n, d) are its control points with both ends.
    """

    first: int
    chords: int
    controls: np.ndarray

    @property
    def off(self) -> float:
        """Largest distance of its chords from it."""
        return _bend(self.controls) / self.chords**2

    @property
    def is_line(self) -> bool:
        """Whether it is none that is seen along z."""
        return not _bend(self.controls[:, :2]) > 0.0

    def mapped(self, matrix: np.ndarray, origin: np.ndarray) -> Bezier:
        """Map it linearly: ``matrix`` is (d, d), ``origin`` where the origin goes."""
        return replace(self, controls=self.controls @ matrix.T + origin)

    def at(self, t: np.ndarray) -> np.ndarray:
        """(n, d) array: its points at parameters from 0 to 1."""
        return _between(self.controls, [t] * (len(self.controls) - 1))

    def located(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Parameters at which it is next to (n, 2) points, and how far away these are."""
        flat = replace(self, controls=self.controls[:, :2])
        slope = (len(self.controls) - 1) * np.diff(flat.controls, axis=0)
        t = np.linspace(0.0, 1.0, SAMPLES)
        t = t[((points[:, None] - flat.at(t)) ** 2).sum(axis=2).argmin(axis=1)]
        for _ in range(STEPS):
            along = _between(slope, [t] * (len(slope) - 1))
            t = t + ((points - flat.at(t)) * along).sum(axis=1) / np.maximum((along**2).sum(axis=1), 1e-300)
            t = np.clip(t, 0.0, 1.0)
        return t, np.hypot(*(points - flat.at(t)).T)

    def chords_between(self, start: float, end: float, tolerance: float | None) -> int:
        """Count the chords of its part between two parameters."""
        degree = len(self.controls) - 1
        ends = ([np.array([start])] * (degree - i) + [np.array([end])] * i for i in range(degree + 1))
        return bezier_chords(np.concatenate([_between(self.controls, at) for at in ends]), tolerance)


#: A curve of an outline.
Curve = Arc | Bezier


def bezier_chords(controls: np.ndarray, tolerance: float | None) -> int:
    """Count the chords of a Bézier curve with control points (n, d) that stay within a tolerance of it.

    The tolerance is a thousandth of its size by default.
    """
    size, bend = float(np.ptp(controls, axis=0).max()), _bend(controls)
    allowed = 1e-3 * size if tolerance is None else max(tolerance, 1e-6 * size)
    # To a ninth digit, or two curves that share a part would have other numbers of chords there.
    return min(max(math.ceil(math.sqrt(bend / allowed) - 1e-9), 1), MOST_CHORDS) if bend > 0.0 else 1


def _bend(controls: np.ndarray) -> float:
    """Wang's bound: n chords of equal parts of a Bézier curve stay within this over n² of it."""
    degree = len(controls) - 1
    return degree * (degree - 1) / 8.0 * float(np.linalg.norm(np.diff(controls, 2, axis=0), axis=1).max(initial=0.0))


def _between(controls: np.ndarray, parameters: Sequence[np.ndarray]) -> np.ndarray:
    """(n, d) array: the polar form of a Bézier curve at as many parameters (n,) as its degree; its points at one."""
    found = np.repeat(controls[:, None], len(parameters[0]), axis=1)
    for t in parameters:
        found = found[:-1] + t[:, None] * np.diff(found, axis=0)
    return found[0]


def with_shared_corners(
    outlines: Sequence[np.ndarray], curves: Sequence[Sequence[Curve]], tolerance: float | None
) -> list[np.ndarray]:
    """Give curves a corner wherever a corner of a drawing lies on them.

    Outlines (n, 2) or (n, 3), closed or open, have the chords of their curves; in space they are as seen along z. The
    tolerance is as of :func:`blockvis.layout.outlines.chords_of`.
    """
    own = [(k, curve) for k, of_outline in enumerate(curves) for curve in of_outline if not curve.is_line]
    if not own:
        return list(outlines)
    seen = [outline[:, :2] for outline in outlines]
    meets = MEETS * float(np.median([np.ptp(seen[k], axis=0).max() for k, _ in own]))
    corners = _corners(seen, curves, meets)
    drawn = [
        np.take(seen[k], np.arange(curve.first, curve.first + curve.chords + 1), axis=0, mode="wrap")
        for k, curve in own
    ]
    reach = np.array([curve.off for _, curve in own]) + meets
    lines = [shapely.LineString(chords) for chords in drawn]
    which, near = shapely.STRtree(shapely.points(corners)).query(lines, "dwithin", reach)
    near = near[np.argsort(which, kind="stable")]
    ends = np.cumsum(np.bincount(which, minlength=len(own)))
    found = list(outlines)
    # From the last curve of an outline to the first: corners that come before keep their numbers.
    for n in range(len(own) - 1, -1, -1):
        k, curve = own[n]
        points = corners[near[ends[n - 1] if n else 0 : ends[n]]]
        apart = np.hypot(*(points[:, None] - drawn[n][[0, -1]]).T).min(axis=0)
        points = points[apart > meets]
        if not len(points):
            continue
        t, beside = curve.located(points)
        on = np.flatnonzero((beside <= meets) & (t > 0.0) & (t < 1.0))
        on = on[np.argsort(t[on])]
        if len(on):
            before, after = found[k][: curve.first + 1], found[k][curve.first + curve.chords :]
            found[k] = np.concatenate([before, _through(curve, points[on], t[on], tolerance), after])
    return found


def _through(curve: Curve, points: np.ndarray, t: np.ndarray, tolerance: float | None) -> np.ndarray:
    """(n, d) array: chords of a curve between its ends, through points on it at parameters that rise."""
    parts = list(pairwise([0.0, *t.tolist(), 1.0]))
    chords = [curve.chords_between(a, b, tolerance) for a, b in parts]
    ends_at = [np.linspace(a, b, m + 1)[1:] for (a, b), m in zip(parts, chords, strict=True)]
    inner = curve.at(np.concatenate(ends_at)[:-1])
    inner[np.cumsum(chords)[:-1] - 1, :2] = points
    return inner


def _corners(outlines: Sequence[np.ndarray], curves: Sequence[Sequence[Curve]], meets: float) -> np.ndarray:
    """(n, 2) array: the corners of outlines that are none of chords alone, of those that meet the first one."""
    kept = []
    for outline, of_outline in zip(outlines, curves, strict=True):
        inner = [np.arange(curve.first + 1, curve.first + curve.chords) for curve in of_outline]
        kept.append(np.delete(outline, np.concatenate(inner), axis=0) if inner else outline)
    corners = np.unique(np.concatenate(kept), axis=0)
    earlier, later = cKDTree(corners).query_pairs(meets, output_type="ndarray").T
    return np.delete(corners, np.maximum(earlier, later), axis=0)
