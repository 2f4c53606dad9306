"""Openings in walls and their heads: lintels, flat, segmental and round arches."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from blockvis.layout.outlines import rectangle
from blockvis.text import refuse_unknown

from .arches import flat_joints, segmental_joints, voussoir_outlines
from .dimensions import above_zero, at_least_zero, choice, finite, whole

HEADS = ("lintel", "flat arch", "segmental arch", "round arch", "none")

#: Heads that a key belongs to.
_OF_HEADS = {
    "depth": ("lintel", "flat arch", "segmental arch", "round arch"),
    "bearing": ("lintel",),
    "rise": ("segmental arch", "round arch"),
    "skew": ("flat arch",),
    "voussoirs": ("flat arch", "segmental arch", "round arch"),
}


@dataclass(frozen=True)
class Opening:
    """A rectangular opening in a wall, and its head, one of :data:`HEADS`.

    Attributes
    ----------
    x, y : float [m]
        Lower left corner; y is the sill, 0 for a door.
    width, height : float [m]
        Of the rectangle; an arch springs at its top.
    depth : float [m]
        Height of a lintel or flat arch, thickness of an arch.
    bearing : float [m]
        Of a lintel, on either side.
    rise : float [m]
        Of an arch, at the intrados.
    skew : float [degrees]
        Lean of the skewbacks of a flat arch from the vertical.
    """

    x: float
    y: float
    width: float
    height: float
    head: str
    depth: float
    bearing: float
    rise: float
    skew: float
    voussoirs: int

    @property
    def top(self) -> float:
        """Level of the top of the rectangle [m]."""
        return self.y + self.height


def checked_opening(
    values: Mapping[str, Any], number: int, *, brick_length: float, brick_height: float, wall_height: float
) -> Opening:
    """Make an opening of its keys, with defaults from the size of the bricks [m].

    ``x``, ``y``, ``width`` and ``height`` are required; the head is a lintel by default, or none if the opening reaches
    the top of the wall. ValueError for impossible values; names the opening, the key and the remedy.
    """
    where = f"opening {number}"
    if not isinstance(values, Mapping):
        raise ValueError(f"{where} is {values!r}; give a table with x, y, width and height in m, and a head")
    refuse_unknown(values, [field.name for field in fields(Opening)], where)
    for key in ("x", "y", "width", "height"):
        if key not in values:
            raise ValueError(f"{where} has no {key}; give x, y, width and height in m")
    x, y = at_least_zero(f"{where}: x", values["x"]), at_least_zero(f"{where}: y", values["y"])
    width, height = above_zero(f"{where}: width", values["width"]), above_zero(f"{where}: height", values["height"])
    to_top = y + height >= wall_height * (1.0 - 1e-9)
    head = choice(f"{where}: head", values.get("head", "none" if to_top else "lintel"), HEADS)
    for key, heads in _OF_HEADS.items():
        if key in values and head not in heads:
            raise ValueError(f"{where}: {key} is that of a {' or '.join(heads)}; its head is '{head}': leave {key} out")
    courses = math.ceil(brick_length / brick_height - 1e-9)
    depths = {"lintel": 2 * brick_height, "flat arch": courses * brick_height}
    depth = above_zero(f"{where}: depth", values.get("depth", depths.get(head, brick_length)))
    rise = above_zero(f"{where}: rise", values.get("rise", width / 2.0 if head == "round arch" else width / 6.0))
    if head == "round arch" and rise != width / 2.0:
        raise ValueError(
            f"{where}: rise is {rise:g} m; that of a round arch is {width / 2.0:g} m: take a segmental arch"
        )
    if head == "segmental arch" and rise > width / 2.0:
        raise ValueError(
            f"{where}: rise is {rise:g} m, more than half of its width of {width:g} m; give at most that, or take a "
            "round arch"
        )
    skew = finite(f"{where}: skew", values.get("skew", 20.0), "degrees")
    if not 0.0 < skew < 60.0:
        raise ValueError(f"{where}: skew is {skew:g} degrees; give an angle above 0 and below 60")
    return Opening(
        x=x,
        y=y,
        width=width,
        height=height,
        head=head,
        depth=depth,
        bearing=above_zero(f"{where}: bearing", values.get("bearing", brick_length / 2.0)),
        rise=rise,
        skew=skew,
        voussoirs=whole(
            f"{where}: voussoirs",
            values.get("voussoirs", odd((math.pi / 2.0 if head == "round arch" else 1.0) * width / brick_height)),
            2,
        ),
    )


def odd(number: float) -> int:
    """Round to an odd number of at least three, so that an arch has a keystone."""
    return max(3, 2 * round((number - 1.0) / 2.0) + 1)


def head_joints_of(opening: Opening) -> np.ndarray | None:
    """(n + 1, 2, 2) array [m]: joints of the voussoirs of the head from left to right; None without voussoirs."""
    middle, n = opening.x + opening.width / 2.0, opening.voussoirs
    if opening.head in ("segmental arch", "round arch"):
        joints, _ = segmental_joints(opening.width, opening.rise, opening.depth, n)
        joints = joints + np.array([middle, opening.top])
        joints[0, 0], joints[-1, 0] = (opening.x, opening.top), (opening.x + opening.width, opening.top)
        return joints
    if opening.head == "flat arch":
        return flat_joints(opening.x, opening.x + opening.width, opening.top, opening.depth, opening.skew, n)
    return None


def head_outlines(opening: Opening, joints: np.ndarray | None) -> list[np.ndarray]:
    """(4, 2) arrays [m]: outlines of the lintel, or of the voussoirs from left to right; none without a head."""
    if joints is not None:
        return voussoir_outlines(joints)
    return [_lintel(opening)] if opening.head == "lintel" else []


def opening_ring(opening: Opening, joints: np.ndarray | None) -> np.ndarray:
    """(n, 2) array [m]: outline of the area without bricks: the rectangle, the head, and the area between them."""
    left, right = opening.x, opening.x + opening.width
    sides = [[left, opening.top], [left, opening.y], [right, opening.y], [right, opening.top]]
    if joints is not None:
        return np.concatenate([sides, joints[::-1, 1]])
    if opening.head == "lintel":
        return np.concatenate([sides, _lintel(opening)[[1, 2, 3, 0]]])
    return np.array(sides)


def _lintel(opening: Opening) -> np.ndarray:
    left, right = opening.x - opening.bearing, opening.x + opening.width + opening.bearing
    return rectangle(left, opening.top, right, opening.top + opening.depth)
