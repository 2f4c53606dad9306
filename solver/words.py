"""Words of messages, values that are refused by their name, and values that stay as they are."""

from __future__ import annotations

import operator
from collections.abc import Callable
from dataclasses import fields
from functools import cached_property, wraps
from reprlib import repr as shortened
from typing import Any, TypeVar

import numpy as np

T = TypeVar("T")

#: What to look for where blocks do not stand as drawn.
REMEDY = (
    "look for gaps between blocks (joint_thickness), a missing support, too little friction, or blocks that overhang "
    "and tip, which need a tie that is stiff or has prestress, a prop or a support"
)


def counted(number: int, one: str, many: str = "") -> str:
    """Write a number of things: of one in the singular; ``many`` is ``one`` with an s unless it is given.

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
        kind, value = kind if kind in _PLAIN else kind.partition("[")[0], getattr(owner, part.name)
        if kind in _PLAIN and not (optional and value is None):
            object.__setattr__(owner, part.name, plain(value, kind, part.name))


def plain(value: Any, kind: str, what: str) -> Any:
    """Make plain a value of an annotation; raises ``ValueError``, or for texts ``TypeError``, that says what it is."""
    (wanted, make), text = _PLAIN[kind], isinstance(value, str)
    try:
        made = make(np.nan if text or np.iscomplexobj(value) else value)
    except (TypeError, ValueError):
        made = np.nan
    if np.any(made != made):
        message = f"{what} is {f'the text {value!r}' if text else value}; give {wanted}"
        raise TypeError(message) if text else ValueError(message)
    return made


def checked(value: Any, kind: type[T], what: str) -> T:
    """Return a value of this type; raises ``TypeError`` that says what another was to be."""
    if not isinstance(value, kind):
        raise TypeError(f"{what} is {shortened(value)}; give solver.{kind.__name__}")
    return value


def numbers_of(value: Any, what: str) -> np.ndarray:
    """Make an array of numbers, nan where they are masked; raises ``ValueError`` that says what others were to be."""
    try:
        if np.iscomplexobj(value):
            raise TypeError
        return np.array(np.ma.filled(value, np.nan), dtype=float)
    except (TypeError, ValueError):
        raise ValueError(f"{what} is {shortened(value)}; give numbers, as many in each row") from None


def read_only(value: T) -> T:
    """Return an array, or several, none of which can be written into any more."""
    for array in value if isinstance(value, tuple) else (value,):
        if isinstance(array, np.ndarray):
            array.setflags(write=False)
    return value


class Kept:
    """A value from which others follow that are kept: its arrays are its own, and cannot be written into."""

    def __post_init__(self) -> None:
        """Make own arrays of what is given."""
        make_plain(self)

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Keep arrays from being written into where copied or unpickled, which numpy does not."""
        self.__dict__.update({name: read_only(value) for name, value in state.items()})


class kept(cached_property[T]):
    """A property that is found once, as an array that cannot be written into."""

    def __init__(self, find: Callable[[Any], T]) -> None:
        super().__init__(wraps(find)(lambda owner: read_only(find(owner))))


#: What makes plain what the annotation of a field asks for.
_PLAIN: dict[str, tuple[str, Callable[[Any], Any]]] = {
    "float": ("a number", float),
    "int": ("a whole number", operator.index),
    "bool": ("True or False", lambda value: bool(value) if value in (False, True) else np.nan),
    "Sequence[str]": ("a sequence of names", lambda names: tuple(map(str, names))),
    "Sequence[float]": ("a sequence of numbers", lambda numbers: tuple(map(float, numbers))),
    "Mapping": ("a mapping, by names", dict),
    "np.ndarray": ("an array of numbers", lambda values: read_only(np.array(np.ma.filled(values, np.nan)))),
}
