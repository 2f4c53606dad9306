"""Bonds: positions of the head joints of each course."""

from __future__ import annotations

import numpy as np

#: Bonds of rectangular walls.
BONDS = ("running", "stack", "english")

#: Bonds of brick that fill an outline.
BRICKWORK = (*BONDS, "flemish", "header")

#: A brick cut shorter than this fraction of its length is joined to its neighbour: a mason lays no piece shorter than a
#: closer, a quarter of a brick.
SHORTEST_BRICK = 0.2


def head_joints(bond: str, course: int, width: float, brick_length: float) -> np.ndarray:
    """Position the head joints of one course of a wall, (n,) array [m] from 0 to its width.

    Even courses, from 0 at the bottom, are whole bricks (stretchers); odd ones are shifted by half a brick in running
    bond, and in English bond are headers with a queen closer next to each end. In Flemish bond each course is a
    stretcher and a header in turn, each header over the middle of a stretcher, with a queen closer at the left of odd
    courses; in header bond all are headers, and odd courses begin with three quarters of a brick. A brick too short at
    either end is joined to its neighbour.

    Examples
    --------
    >>> head_joints("running", 1, 3.0, 1.0).tolist()
    [0.0, 0.5, 1.5, 2.5, 3.0]
    >>> head_joints("english", 1, 2.0, 1.0).tolist()
    [0.0, 0.5, 0.75, 1.25, 1.5, 2.0]
    """
    n = int(np.ceil(2.0 * width / brick_length)) + 2
    if bond == "flemish":
        ends = np.array([1.0, 1.5]) if course % 2 == 0 else np.array([0.75, 1.75])
        inside = (ends + 1.5 * np.arange(n)[:, None]).ravel() * brick_length
        # The first header of odd courses has a queen closer at its right.
        inside = np.append(0.5 * brick_length, inside) if course % 2 else inside
    elif bond == "header":
        inside = (0.5 + 0.25 * (course % 2) + 0.5 * np.arange(n)) * brick_length
        inside = inside if course % 2 == 0 else inside[inside < width - 0.5 * brick_length]
    elif course % 2 == 0 or bond == "stack":
        inside = np.arange(1, n) * brick_length
    elif bond == "running":
        inside = (np.arange(n) + 0.5) * brick_length
    else:
        headers = (0.75 + 0.5 * np.arange(n)) * brick_length
        last = width - 0.5 * brick_length
        headers = headers[headers < last - SHORTEST_BRICK * brick_length]
        inside = np.unique(np.concatenate([[0.5 * brick_length], headers, [last]]))
    shortest = SHORTEST_BRICK * brick_length
    inside = inside[(inside > shortest) & (inside < width - shortest)]
    return np.concatenate([[0.0], inside, [width]])
