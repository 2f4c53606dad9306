"""The numbers a layout is described by, checked where they enter."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

#: Blocks in a layout, or along a side of it: beyond anything that could be solved.
MOST_BLOCKS = 100_000

#: Voussoirs are radial, and the boxes around thin ones overlap by the hundred: memory grows with their number squared,
#: 1.9 GB at 5,000.
MOST_VOUSSOIRS = 2_000


def finite(name: str, value: Any, unit: str = "m") -> float:
    """The value as a float; raises ``ValueError`` unless it is a finite number."""
    try:
        number = float(value) if isinstance(value, (int, float)) and not isinstance(value, bool) else math.nan
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise ValueError(f"{name} is {str(value)[:60]!r}; give a finite number{f' in {unit}' if unit else ''}")
    return number


def above_zero(name: str, value: Any, unit: str = "m") -> float:
    """The value as a float; raises ``ValueError`` unless it is a finite number above zero."""
    number = finite(name, value, unit)
    if number <= 0.0:
        raise ValueError(f"{name} is {number:g}{f' {unit}' if unit else ''}; give a number above 0")
    return number


def at_least_zero(name: str, value: Any, unit: str = "m") -> float:
    """The value as a float; raises ``ValueError`` unless it is a finite number of at least zero."""
    number = finite(name, value, unit)
    if number < 0.0:
        raise ValueError(f"{name} is {number:g}{f' {unit}' if unit else ''}; give a number of at least 0")
    return number


def whole(name: str, value: Any, least: int, most: int = MOST_BLOCKS) -> int:
    """The value as an int; raises ``ValueError`` unless it is a whole number from ``least`` to ``most``."""
    number = finite(name, value, "")
    if number != int(number) or number < least:
        raise ValueError(f"{name} is {number:g}; give a whole number of at least {least}")
    if number > most:
        where = "layout" if most == MOST_BLOCKS else "ring"
        raise ValueError(f"{name} is {number:g}; a {where} has at most {most} blocks")
    return int(number)


def pair(name: str, value: Any, unit: str = "m") -> tuple[float, float]:
    """The value as two floats; raises ``ValueError`` unless they are finite and the first is the smaller."""
    if isinstance(value, str) or not isinstance(value, Sequence) or len(value) != 2:
        raise ValueError(f"{name} is {value!r}; give two numbers [from, to] in {unit}")
    first, last = finite(name, value[0], unit), finite(name, value[1], unit)
    if first >= last:
        raise ValueError(f"{name} is [{first:g}, {last:g}] {unit}; the first number must be the smaller")
    return first, last


def choice(name: str, value: Any, among: Sequence[str]) -> str:
    """The value; raises ``ValueError`` unless it is one of the words."""
    if value not in among:
        raise ValueError(f"{name} is {value!r}; choose from {', '.join(among)}")
    return str(value)
