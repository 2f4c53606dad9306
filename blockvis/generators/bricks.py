"""Bricks laid course by course, cut around openings, slivers joined to their neighbours."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import shapely

from blockvis.layout.outlines import without_collinear

from .bonds import SHORTEST_BRICK, head_joints
from .slivers import without_slivers

#: All corners lie on a grid of this fraction of the brick height, so that cuts leave no slivers of rounding errors.
GRID = 1e-10

#: A piece lower than this fraction of a course is joined to a neighbour.
LOWEST_BRICK = 0.3

#: So is a piece into which no circle of this fraction of the brick height in diameter fits: the end of a wedge.
NARROWEST = 0.25


@dataclass(frozen=True)
class Bond:
    """Bond of a wall and size of its bricks.

    Attributes
    ----------
    kind : {"running", "stack", "english"}
    brick_length, brick_height : float [m]
    """

    kind: str
    brick_length: float
    brick_height: float

    @property
    def grid(self) -> float:
        """Spacing of the grid on which all corners lie [m]."""
        return GRID * self.brick_height


@dataclass(frozen=True)
class Brick:
    """A brick, or a part of one that an opening cuts.

    Attributes
    ----------
    course : int
        From 0 at the bottom.
    shape : shapely.Polygon [m]
    """

    course: int
    shape: shapely.Polygon


def lay_bricks(bond: Bond, width: float, courses: int) -> list[Brick]:
    """Lay the bricks of a wall without openings.

    Parameters
    ----------
    bond : Bond
    width : float [m]
    courses : int

    Returns
    -------
    list of Brick
        Course by course from the left; the lower left corner of the wall is (0, 0).
    """
    bricks = []
    levels = bond.brick_height * np.arange(courses + 1)
    for course in range(courses):
        joints = head_joints(bond.kind, course, width, bond.brick_length)
        for left, right in pairwise(joints):
            bricks.append(Brick(course, shapely.box(left, levels[course], right, levels[course + 1])))
    shapes = shapely.set_precision([brick.shape for brick in bricks], bond.grid)
    return [replace(brick, shape=shape) for brick, shape in zip(bricks, shapes, strict=True)]


def cut_bricks(bond: Bond, bricks: Sequence[Brick], rings: Sequence[np.ndarray]) -> list[Brick]:
    """Cut bricks along rings and drop the parts inside.

    Parameters
    ----------
    bond : Bond
    bricks : sequence of Brick
    rings : sequence of (n, 2) arrays [m]

    Returns
    -------
    list of Brick
        Each in one piece; a sliver is joined to the neighbour with which it makes the most convex block.
    """
    kept = list(bricks)
    for ring in rings:
        hole = shapely.Polygon(ring)
        shapely.prepare(hole)
        pieces: list[Brick] = []
        for brick in kept:
            if not hole.intersects(brick.shape):
                pieces.append(brick)
                continue
            rest = shapely.set_precision(brick.shape.difference(hole), bond.grid)
            parts = shapely.get_parts(rest)
            pieces += [Brick(brick.course, part) for part in parts if part.area > 0.0]
        kept = pieces
    whole = without_slivers(
        [brick.shape for brick in kept], lambda shape, _: _is_sliver(bond, shape), bond.brick_height, bond.grid
    )
    return [Brick(kept[piece].course, shape) for shape, piece in whole]


def brick_outline(brick: Brick) -> np.ndarray:
    """(n, 2) array [m]: corners of a brick, without collinear points."""
    return without_collinear(shapely.get_coordinates(brick.shape)[:-1], 1e-9)


def _is_sliver(bond: Bond, shape: shapely.Polygon) -> bool:
    left, low, right, high = shape.bounds
    if right - left < SHORTEST_BRICK * bond.brick_length * (1.0 - 1e-9):
        return True
    if high - low < LOWEST_BRICK * bond.brick_height:
        return True
    if len(shape.exterior.coords) == 5 and shape.area > 0.999 * (right - left) * (high - low):
        return False
    return bool(shape.buffer(-NARROWEST / 2.0 * bond.brick_height).is_empty)
