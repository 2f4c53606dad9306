"""Checks of the parameters of a layout; each returns the value or raises ``ValueError`` with its name."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from blockvis.text import refuse_magnitude

#: Most blocks in a layout, or along a side of it: more than can be solved.
MOST_BLOCKS = 100_000

#: Most voussoirs of an arch: the boxes around thin radial blocks overlap, so that memory grows with the square of their
#: number, 1.9 GB at 5,000.
MOST_VOUSSOIRS = 2_000


def finite(name: str, value: Any, unit: str = "m") -> float:
    """Return the value as a float if it is a finite number, and as small and large as something real can be."""
    try:
        number = float(value) if isinstance(value, (int, float)) and not isinstance(value, bool) else math.nan
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise ValueError(f"{name} is {str(value)[:60]!r}; give a finite number{f' in {unit}' if unit else ''}")
    if remedy := refuse_magnitude(number):
        raise ValueError(f"{name} is {number:g}{f' {unit}' if unit else ''}; {remedy}")
    return number


def above_zero(name: str, value: Any, unit: str = "m") -> float:
    """Return the value as a float if it is a finite number above zero."""
    number = finite(name, value, unit)
    if number <= 0.0:
        raise ValueError(f"{name} is {number:g}{f' {unit}' if unit else ''}; give a number above 0")
    return number


def at_least_zero(name: str, value: Any) -> float:
    """Return the value as a float if it is a finite number of at least zero."""
    number = finite(name, value)
    if number < 0.0:
        raise ValueError(f"{name} is {number:g} m; give a number of at least 0")
    return number


def whole(name: str, value: Any, least: int, most: int = MOST_BLOCKS) -> int:
    """Return the value as an int if it is a whole number from ``least`` to ``most``."""
    number = finite(name, value, "")
    if number != int(number) or number < least:
        raise ValueError(f"{name} is {number:g}; give a whole number of at least {least}")
    if number > most:
        raise ValueError(f"{name} is {number:g}; give a whole number of at most {most}")
    return int(number)


def true_or_false(name: str, value: Any) -> bool:
    """Return the value if it is true or false: words count as true in Python, "no" too."""
    if not isinstance(value, bool):
        raise ValueError(f"{name} is {value!r}; give true or false")
    return value


def pair(name: str, value: Any) -> tuple[float, float]:
    """Return the value as two floats if both are finite and the first is the smaller."""
    if isinstance(value, str) or not isinstance(value, Sequence) or len(value) != 2:
        raise ValueError(f"{name} is {value!r}; give two numbers [from, to] in m")
    first, last = finite(name, value[0]), finite(name, value[1])
    if first >= last:
        raise ValueError(f"{name} is [{first:g}, {last:g}] m; the first number must be the smaller")
    return first, last


def choice(name: str, value: Any, among: Sequence[str]) -> str:
    """Return the value if it is one of the words."""
    if value not in among:
        raise ValueError(f"{name} is {value!r}; choose from {', '.join(among)}")
    return str(value)
