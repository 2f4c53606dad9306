"""Words of messages, and values that are refused by their name."""

from __future__ import annotations

import operator
from collections.abc import Callable
from dataclasses import fields
from typing import Any

import numpy as np

#: What to look for where blocks do not stand as drawn.
REMEDY = (
    "look for gaps between blocks (joint_thickness), a missing support, too little friction, or blocks that overhang "
    "and tip, which need a tie, a prop or a support"
)


def counted(number: int, one: str, many: str = "") -> str:
    """Write a number of things: of one in the singular.

    Parameters
    ----------
    number : int
    one, many : str
        What there is of them; ``many`` is ``one`` with an s unless it is given.

    Examples
    --------
    >>> counted(1, "block"), counted(2, "block"), counted(0, "body falls", "bodies fall")
    ('1 block', '2 blocks', '0 bodies fall')
    """
    return f"{number} {one if number == 1 else many or one + 's'}"


def make_plain(owner: Any) -> None:
    """Make plain what a dataclass is given, as JSON takes it; refuse by its name what is none, or not a number."""
    for part in fields(owner):
        kind, _, optional = str(part.type).partition(" | ")
        value = getattr(owner, part.name)
        if kind not in _PLAIN or (optional and value is None):
            continue
        (wanted, make), text = _PLAIN[kind], isinstance(value, str)
        try:
            made = make(np.nan if text else value)
        except (TypeError, ValueError):
            made = np.nan
        if np.any(made != made):
            what = f"{part.name} is {f'the text {value!r}' if text else value}; give {wanted}"
            raise TypeError(what) if text else ValueError(what)
        object.__setattr__(owner, part.name, made)


def numbers_of(value: Any, what: str) -> np.ndarray:
    """Make an array of numbers; raises ``ValueError`` that says what it was to be where there are others."""
    try:
        return np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        raise ValueError(f"{what} is {value!r}; give numbers, as many in each row") from None


#: What makes plain what the annotation of a field asks for.
_PLAIN: dict[str, tuple[str, Callable[[Any], Any]]] = {
    "float": ("a number", float),
    "int": ("a whole number", operator.index),
    "tuple[str, ...]": ("a sequence of names", lambda names: tuple(map(str, names))),
    "np.ndarray": ("an array of numbers", np.asarray),
}
