"""Where in a structure in the plane something is, in the words of a survey: its edges, the ground, its openings."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import shapely

import solver

#: Blocks leave no slit between them wider than this, in block sizes.
SLIT = 1e-3

#: A place is at what is no farther off than this, in block sizes: less than the course between two bed joints.
AT = 0.25

#: It has the name of an edge or a corner that is no farther off than this, in block sizes.
NEAR = 0.75

#: A wall fills its box by this share at least; an arch has no edges to the left and right.
FILLED = 0.4

#: A hole narrower than this, in block sizes, is no opening.
SMALLEST = 0.5

#: What lies in the outer parts of an opening, of this share of its width or height, is at its side.
SIDE = 0.25


class Places:
    """Edges and openings of a layout in the plane."""

    def __init__(self, assembly: solver.Assembly) -> None:
        outlines = np.array([shapely.Polygon(assembly.outline(block)) for block in range(assembly.n_blocks)])
        self._at, self._near, slit = (part * assembly.block_size for part in (AT, NEAR, SLIT))
        free = assembly.free
        stones = shapely.buffer(outlines, slit, join_style="mitre")
        supports = sorted(shapely.get_parts(shapely.union_all(stones[~free])), key=lambda one: float(one.centroid.x))
        # Between supports an opening is open at its foot: the ground closes it.
        ground = [shapely.shortest_line(one, other) for one, other in pairwise(supports)]
        whole = shapely.union_all([*stones, *shapely.buffer(ground, slit)])
        self._outer = shapely.union_all([part.exterior for part in shapely.get_parts(whole)])
        holes = [shapely.Polygon(ring) for part in shapely.get_parts(whole) for ring in part.interiors]
        holes = [hole for hole in holes if hole.area > (SMALLEST * assembly.block_size) ** 2]
        self._openings = sorted(holes, key=lambda hole: (round(hole.centroid.x / assembly.block_size), hole.centroid.y))
        self._ground = shapely.union_all(outlines[~free]) if (~free).any() else None
        drawn = shapely.union_all(outlines[free]) if free.any() else whole
        self._box = shapely.bounds(drawn)
        self._edges = drawn.area > FILLED * shapely.box(*self._box).area

    def name(self, point: np.ndarray) -> str:
        """Say where a point (2,) [m] is."""
        place = shapely.Point(point)
        left, low, right, top = self._box
        edges = [(float(top - point[1]), "the top"), (float(point[1] - low), "the underside")]
        if self._edges:
            edges += [(float(point[0] - left), "the left edge"), (float(right - point[0]), "the right edge")]
        off, edge = min(edges)
        found = [(place.distance(self._outer), edge if off <= self._near else "the outer face")]
        if self._ground is not None:
            found.append((place.distance(self._ground), "the ground"))
        for number, opening in enumerate(self._openings, start=1):
            which = f"opening {number}" if len(self._openings) > 1 else "the opening"
            found.append((place.distance(opening), f"the {self._side(point, opening)} of {which}"))
        distance, words = min(found)
        return words if distance <= self._at else "inside"

    def _side(self, point: np.ndarray, opening: shapely.Polygon) -> str:
        """Name the part of an opening that is nearest to a point."""
        box = np.array(shapely.bounds(opening))
        along = (point - box[:2]) / (box[2:] - box[:2])
        level = "" if SIDE < along[0] < 1.0 - SIDE else "left" if along[0] <= SIDE else "right"
        height = "" if SIDE < along[1] < 1.0 - SIDE else "foot" if along[1] <= SIDE else "head"
        if level and height:
            corner = shapely.Point(box[[0 if level == "left" else 2, 1 if height == "foot" else 3]])
            if opening.distance(corner) > self._near:
                return f"{level} haunch"
            return f"{'upper' if height == 'head' else 'lower'} {level} corner"
        return f"{level} side" if level else height or "edge"
