"""From where blocks in space are looked at, and by which plane they are cut open: how a user writes both."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from blockvis.text import LARGEST, nearest

#: Degrees above the level of a view from below: steep enough for supports at the rim not to hide the intrados.
BELOW = -50.0

#: Axes by which a section may be named.
AXES = ("x", "y", "z")


@dataclass(frozen=True)
class Sight:
    """From where blocks in space are looked at, in degrees, both chosen by default; or whether from below as well.

    The azimuth is that of the direction to the eye, counter-clockwise from x; the elevation is from -90, straight from
    below, to 90.
    """

    azimuth: float | None = None
    elevation: float | None = None
    both: bool = False


@dataclass(frozen=True)
class Cut:
    """A plane that cuts blocks open; what lies between it and the eye is left out.

    The normal is a unit vector of either sense, the point [m] by default the middle of the structure.
    """

    normal: tuple[float, float, float]
    point: tuple[float, float, float] | None = None


#: Views by a word.
SIGHTS = {
    "above": Sight(),
    "below": Sight(elevation=BELOW),
    "both": Sight(both=True),
    "front": Sight(-90.0, 0.0),
    "back": Sight(90.0, 0.0),
    "left": Sight(180.0, 0.0),
    "right": Sight(0.0, 0.0),
    "top": Sight(-90.0, 90.0),
    "bottom": Sight(-90.0, -90.0),
}

_VIEW_REMEDY = (
    f"choose from {', '.join(SIGHTS)}, or give {{ azimuth = 30, elevation = 20 }} in degrees, elevation from -90 to 90"
)
_SECTION_REMEDY = 'give "x", "y" or "z", "y = 1.2" in m, or { point = [x, y, z], normal = [x, y, z] }'


def read_sight(value: Any) -> Sight:
    """Read a view: a word of :data:`SIGHTS`, or azimuth and elevation [degrees].

    ValueError with what is wrong and the remedy; whoever reads it puts the name of the key before.

    Examples
    --------
    >>> read_sight({"azimuth": 30, "elevation": 20})
    Sight(azimuth=30.0, elevation=20.0, both=False)
    """
    if isinstance(value, Sight):
        return value
    if isinstance(value, str) and value in SIGHTS:
        return SIGHTS[value]
    if not isinstance(value, Mapping) or not value:
        guess = nearest(value, tuple(SIGHTS)) if isinstance(value, str) else ""
        raise ValueError(f"is {value!r}{guess}; {_VIEW_REMEDY}")
    for key in value:
        if key not in ("azimuth", "elevation"):
            raise ValueError(f"has '{key}'{nearest(key, ('azimuth', 'elevation'))}; {_VIEW_REMEDY}")
    angles = {key: _number(angle, f"has {key} = {angle!r}; {_VIEW_REMEDY}") for key, angle in value.items()}
    for key, most in (("azimuth", 360.0), ("elevation", 90.0)):
        if abs(angles.get(key, 0.0)) > most:
            raise ValueError(f"has {key} = {angles[key]:g}; give degrees from {-most:g} to {most:g}")
    return Sight(angles.get("azimuth"), angles.get("elevation"))


def read_cut(value: Any) -> Cut:
    """Read a section: an axis, a place on it, or a point [m] and a normal.

    ValueError as of :func:`read_sight`.

    Examples
    --------
    >>> read_cut("y = 1.2")
    Cut(normal=(0.0, 1.0, 0.0), point=(0.0, 1.2, 0.0))
    """
    if isinstance(value, Cut):
        return value
    problem = f"is {value!r}; {_SECTION_REMEDY}"
    if isinstance(value, str):
        axis, equals, place = (word.strip() for word in value.partition("="))
        try:
            at = _number(float(place if equals else 0.0), problem)
            normal = tuple(float(k == AXES.index(axis)) for k in range(3))
        except ValueError:
            raise ValueError(problem) from None
        point = tuple(at * along + 0.0 for along in normal) if equals else None
        return Cut(normal, point)  # type: ignore[arg-type]
    if not isinstance(value, Mapping) or "normal" not in value or not {"point", "normal"}.issuperset(value):
        raise ValueError(problem)
    normal = _triple(value["normal"], problem)
    length = math.hypot(*normal)
    if length == 0.0:
        raise ValueError(f"has a normal of length 0; {_SECTION_REMEDY}")
    unit = (normal[0] / length, normal[1] / length, normal[2] / length)
    return Cut(unit, _triple(value["point"], problem) if "point" in value else None)


def _number(value: Any, problem: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) <= LARGEST:
        raise ValueError(problem)
    return float(value)


def _triple(value: Any, problem: str) -> tuple[float, float, float]:
    if not isinstance(value, list | tuple) or len(value) != 3:
        raise ValueError(problem)
    x, y, z = (_number(number, problem) for number in value)
    return x, y, z
