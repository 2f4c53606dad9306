"""Units of length of drawings."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

import numpy as np

from .notes import UNIT, UNIT_CLASH, UNIT_TAKEN, Note

#: Metres per unit.
UNITS = {
    "m": 1.0, "mm": 1e-3, "cm": 1e-2, "dm": 1e-1, "km": 1e3, "in": 0.0254, "ft": 0.3048, "yd": 0.9144,
    "pt": 0.0254 / 72.0, "px": 0.0254 / 96.0,
}  # fmt: skip

_OTHER_NAMES = {
    "metre": "m", "meter": "m", "metres": "m", "meters": "m", "millimetre": "mm", "millimeter": "mm",
    "millimetres": "mm", "millimeters": "mm", "centimetre": "cm", "centimeter": "cm", "centimetres": "cm",
    "centimeters": "cm", "decimeters": "dm", "decimetres": "dm", "kilometers": "km", "kilometres": "km",
    "inch": "in", "inches": "in", "foot": "ft", "feet": "ft", "yard": "yd", "yards": "yd", "point": "pt", "pixel": "px",
}  # fmt: skip

#: A number of units of length, and the name of the unit.
_NUMBER_OF = re.compile(r"\s*(\d+\.?\d*(?:e[-+]?\d+)?|\.\d+(?:e[-+]?\d+)?)?\s*(.*?)\s*", re.DOTALL | re.IGNORECASE)

#: Median size (root of the area) of a masonry block [m]: from a mosaic-sized chip to a megalith.
PLAUSIBLE_SIZE = (0.02, 20.0)

#: Median size of a block [m] from which on, or below which, the unit is doubted.
DOUBTED = (0.02, 10.0)

#: Median size of the blocks of common masonry [m], from a split brick to an ashlar.
COMMON = (0.04, 3.0)

#: Size of a stone between bricks and ashlars [m]: of units that make common masonry the one nearest to it is likely.
USUAL = 0.25

#: Units that templates state whose drawings are metric, those in which these are drawn, and others that are tried last.
IMPERIAL, METRIC, RARE = ("in", "ft", "yd"), ("mm", "cm", "m"), ("dm", "in", "ft")

#: 1 : these are the scales of drawings of masonry, the commonest first.
SCALES = (50, 20, 100, 10, 25, 200, 500, 1000)


def metres_per(unit: str) -> float:
    """Metres per unit of length, or of a number of them, as a drawing at a scale has it.

    ValueError for an unknown unit, and a number of them that is not above 0.

    Examples
    --------
    >>> metres_per("inches"), metres_per("20 mm")
    (0.0254, 0.02)
    """
    number, name = _NUMBER_OF.fullmatch(unit).groups()  # type: ignore[union-attr]
    name = _OTHER_NAMES.get(name.lower(), name if name in UNITS else name.lower())
    if name not in UNITS:
        raise ValueError(
            f"unit '{unit}' is not known; the units of length are {', '.join(UNITS)}, or a number of one: 20 mm"
        )
    metres = float(number or 1.0) * UNITS[name]
    if not 0.0 < metres < np.inf:
        raise ValueError(f"unit '{unit}' is {metres:g} m long; give a number above 0, as 20 mm")
    return metres


def unit_of(metres: float, near: float = 1e-3) -> str:
    """Name the unit that is so long, to a fraction of it; "" for none.

    Examples
    --------
    >>> unit_of(0.0254), unit_of(0.02)
    ('in', '')
    """
    return next((unit for unit, size in UNITS.items() if math.isclose(metres, size, rel_tol=near)), "")


def chosen_unit(given: str | None, stated: str, sizes: np.ndarray) -> tuple[str, str]:
    """Choose the unit in which a file is read, and say why; "" if the stated unit is taken.

    The unit that is ``given`` by the caller, or by a page, always holds; ``stated`` is that of the file, "" for none;
    ``sizes`` are roots of the areas of the blocks, in the unit of the file.
    """
    median = float(np.median(sizes)) if len(sizes) else 1.0
    if given is not None:
        clash = bool(stated) and metres_per(stated) != metres_per(given)
        note = f"the file says its unit is {stated}; it was read in {given} because that was asked for" if clash else ""
        # Who gives the unit that the file states has settled the doubt.
        doubted = "" if given == stated else doubt_of_given(given, median * metres_per(given))
        said = "; ".join(filter(None, (note, doubted)))
        return given, Note(UNIT_TAKEN if note else UNIT, said) if said else ""
    if not stated:
        return "m", Note(UNIT_TAKEN, "the file does not say its unit; m was assumed")
    low, high = PLAUSIBLE_SIZE
    in_stated, in_metres = median * metres_per(stated), median
    if low <= in_stated <= high:
        return stated, _doubt_of_template(stated, median)
    # Most drawings whose unit is wrong are in m; blocks of several m are rather bricks in another.
    likely = ["m"] if COMMON[0] <= in_metres <= COMMON[1] else _masonry_units(median)
    likely = likely or (["m"] if low <= in_metres <= high else [])
    if not likely:
        return stated, ""
    return likely[0], Note(
        UNIT_CLASH,
        f"unit clash: the file says its unit is {stated}, which makes the median block {in_stated:.3g} m in size; "
        f"{_would_make(likely, median)}: {likely[0]} was assumed; give unit=... to settle it",
    )


def _doubt_of_template(stated: str, size: float) -> str:
    """Doubt inches, feet or yards that make blocks too large for common masonry, as a metric unit would not."""
    large = size * UNITS.get(stated, 1.0)
    metric = _masonry_units(size, ()) if stated in IMPERIAL and COMMON[1] < large <= DOUBTED[1] else []
    if not metric:
        return ""
    return Note(
        UNIT,
        f"unit {stated} in doubt, which the file states, perhaps from a template: it makes the median block "
        f"{large:.3g} m across; {_would_make(metric, size)}: say so under [geometry] "
        f'unit = "{metric[0]}", or by --unit {metric[0]}',
    )


def _masonry_units(size: float, rare: Sequence[str] = RARE) -> list[str]:
    """List the units in which blocks of a size, a number of the file, are masonry, the likeliest first."""
    made = {unit: size * UNITS[unit] for unit in (*METRIC, *rare)}
    common = [unit for unit in made if COMMON[0] <= made[unit] <= COMMON[1]]
    return sorted(common, key=lambda unit: (unit not in METRIC, abs(np.log(made[unit] / USUAL))))


def _would_make(units: Sequence[str], size: float, rare: Sequence[str] = RARE) -> str:
    """Say how large the likeliest of some units makes blocks of a size, and others, not rare, that are as possible."""
    first, *others = units
    said = [f"{first} would make it {size * metres_per(first):.3g} m"]
    return ", ".join(said + [f"{unit} {size * metres_per(unit):.3g} m" for unit in others if unit not in (*rare, "km")])


def units_instead(unit: str, size: float, *, page: bool = False) -> list[str]:
    """List the units that make blocks masonry whose unit is doubted, the likeliest first; none without doubt.

    The size [m] is the root of the area of the median block, as read in the unit. What is too small on a ``page``,
    whose unit is that of the paper, is drawn at a scale, and one is always found.

    Examples
    --------
    >>> units_instead("m", 130.0)
    ['mm', 'cm']
    >>> units_instead("pt", 0.0076, page=True)
    ['50 pt', '20 pt', '25 pt', '100 pt', '10 pt', '200 pt']
    """
    if size <= 0.0 or DOUBTED[0] <= size <= DOUBTED[1]:
        return []
    if page and size < DOUBTED[0]:
        number, name = _NUMBER_OF.fullmatch(unit).groups()  # type: ignore[union-attr]
        common = [scale for scale in SCALES if COMMON[0] <= scale * size <= COMMON[1]]
        # Of scales that are as likely but for a factor of two the commonest is first; a map has none of these.
        common.sort(key=lambda scale: int(abs(np.log2(scale * size / USUAL))))
        common = common or [10 ** round(np.log10(USUAL / size))]
        return [f"{scale * float(number or 1.0):.9g} {name}" for scale in common]
    return _masonry_units(size / metres_per(unit), (*RARE, "km"))


def doubt_of_given(unit: str, size: float) -> str:
    """Doubt a unit that was asked for and makes blocks of no common size [m], as a metric one would not.

    A number of units is a scale that was thought of; "" if there is nothing to doubt.

    Examples
    --------
    >>> doubt_of_given("mm", 0.026)
    'unit mm in doubt, in which it is read as asked: it makes the median block 0.026 m across; cm would make it 0.26 m'
    """
    if unit not in UNITS or size <= 0.0 or COMMON[0] <= size <= COMMON[1]:
        return ""
    others = _masonry_units(size / metres_per(unit), ())
    said = f"unit {unit} in doubt, in which it is read as asked: it makes the median block {size:.3g} m across"
    return f"{said}; {_would_make(others, size / metres_per(unit))}" if others else ""


def doubt(
    unit: str,
    size: float,
    *,
    page: bool = False,
    remedy: str = 'give the one it is drawn in, as [geometry] unit = "{0}", or --unit {1}',
) -> str:
    """Doubt the unit of a drawing whose blocks are far larger or smaller than those of masonry.

    The arguments are those of :func:`units_instead`, and how to give another unit; "" if there is nothing to doubt.

    Examples
    --------
    >>> doubt("m", 130.0, remedy="unit = '{}'")
    "unit m in doubt: it makes the median block 130 m across; mm would make it 0.13 m, cm 1.3 m: unit = 'mm'"
    """
    if DOUBTED[0] <= size <= DOUBTED[1] or size <= 0.0:
        return ""
    doubted = f"unit {unit} in doubt: it makes the median block {size:.3g} m across"
    others = units_instead(unit, size, page=page)
    if not others:
        return f"{doubted}; no other unit makes it masonry"
    quoted = f'"{others[0]}"' if " " in others[0] else others[0]
    scaled = f"; is it drawn at a scale, as at 1:{SCALES[0]}?" if page and size < DOUBTED[0] else ";"
    # Inches are as likely where a file says no unit.
    made = _would_make(others, size / metres_per(unit), ("dm", "ft"))
    return f"{doubted}{scaled} {made}: {remedy.format(others[0], quoted)}"
