"""Tables of TOML files, read with checks."""

from __future__ import annotations

import math
import re
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from blockvis.text import nearest, refuse_magnitude


class Table:
    """A table of a TOML file; it keeps the keys that were read, so that the others can be refused.

    ``where`` is its name in messages, "" for the whole file. Every method raises ValueError for a value of the wrong
    kind, which names the file, the table, the key and the remedy.
    """

    def __init__(self, values: Mapping[str, Any], where: str, source: Path) -> None:
        if not isinstance(values, Mapping):
            raise ValueError(f"{source}: [{where}] must be a table of keys, not {values!r}")
        self.values, self.where, self.source = values, where, source
        self.known: list[str] = []

    def take(self, key: str, default: Any = None) -> Any:
        """Read a value of any kind, in which no number is smaller or larger than something real can be."""
        self.known.append(key)
        value = self.values.get(key, default)
        for number in _numbers_in(value):
            if remedy := refuse_magnitude(number):
                raise self.error(key, f"{'is' if number is value else 'holds'} {shortened(number)}; {remedy}")
        return value

    def number(self, key: str) -> Any:
        """Read a finite number as a float; None if it is missing."""
        value = self.take(key)
        if value is None:
            return None
        if not is_number(value):
            raise self.error(key, f"is {shortened(value)}; give a {'finite ' * isinstance(value, float)}number")
        return float(value)

    def vector(
        self, key: str, lengths: Sequence[int] = (2, 3), words: str = "two numbers [x, y], or in space three [x, y, z]"
    ) -> Any:
        """Read as many finite numbers as are in ``lengths``, or any; ``words`` says in the error what they are."""
        value = self.take(key)
        if value is None:
            return None
        numbers = value if isinstance(value, (list, tuple)) else ()
        if not numbers or (lengths and len(numbers) not in lengths) or not all(map(is_number, numbers)):
            raise self.error(key, f"is {shortened(value)}; give {words}")
        return tuple(map(float, numbers))

    def text(self, key: str, default: str | None = None, *, among: Sequence[str] = ()) -> Any:
        """Read a text, one of ``among`` if there are any."""
        value = self.take(key, default)
        if value is None:
            return None
        if not isinstance(value, str):
            raise self.error(key, f"is {value!r}; give a text in quotes")
        if among and value not in among:
            raise self.error(key, f"is '{value}'{nearest(value, among)}; choose from {', '.join(among)}")
        return value

    def boolean(self, key: str) -> bool | None:
        """Read true or false; None if it is missing."""
        value = self.take(key)
        if value is not None and not isinstance(value, bool):
            raise self.error(key, f"is {shortened(value)}; give true or false")
        return value

    def numbers(self, key: str) -> tuple[float, ...] | None:
        """Read a list of finite numbers."""
        found: tuple[float, ...] | None = self.vector(key, (), "a list of numbers")
        return found

    def texts(self, key: str) -> tuple[str, ...] | None:
        """Read a text, or a list of texts; None if it is missing."""
        value = self.take(key)
        if value is None:
            return None
        words = [value] if isinstance(value, str) else value
        if not isinstance(words, list | tuple) or not all(isinstance(word, str) for word in words):
            raise self.error(key, f'is {shortened(value)}; give texts in quotes, ["first", "second *"]')
        return tuple(words)

    def whole(self, key: str, least: int, most: int | None = None) -> int | None:
        """Read a whole number of at least ``least``, and at most ``most``."""
        value = self.take(key)
        if value is None:
            return None
        if not is_number(value) or value != int(value) or value < least or (most is not None and value > most):
            limits = f"of at least {least}" if most is None else f"from {least} to {most}"
            raise self.error(key, f"is {shortened(value)}; give a whole number {limits}")
        return int(value)

    def table(self, key: str) -> Table:
        """Read a table; a missing one is empty."""
        return Table(self.take(key, {}), f"{self.where}.{key}" if self.where else key, self.source)

    def tables(self, key: str) -> list[Table]:
        """Read a list of tables, or a single one."""
        value = self.take(key, [])
        entries = [value] if isinstance(value, Mapping) else value
        if not isinstance(entries, list):
            raise self.error(key, f"must be [[{key}]] tables, not {value!r}")
        where = f"{self.where}.{key}" if self.where else key
        several = len(entries) > 1
        return [Table(entry, f"{where} {i + 1}" if several else where, self.source) for i, entry in enumerate(entries)]

    def error(self, key: str, problem: str) -> ValueError:
        """Make an error that names the file, the table and the key."""
        where = f"[{self.where}] {key}" if self.where else f"[{key}]"
        return ValueError(f"{self.source}: {where} {problem}")

    def finish(self, known: Sequence[str] = ()) -> None:
        """Refuse keys that were not read and are not known, naming the most similar one of these."""
        self.known += known
        for key in self.values:
            if key not in self.known:
                keys = ", ".join(dict.fromkeys(self.known))
                raise self.error(key, f"is not a key here{nearest(key, self.known)}; keys are {keys}")


def _numbers_in(value: object) -> Iterator[float]:
    """List the numbers of a value and of lists in it; those of tables are found where these are read."""
    if isinstance(value, list | tuple):
        for one in value:
            yield from _numbers_in(one)
    elif isinstance(value, int | float) and not isinstance(value, bool):
        yield value


def toml_value(text: str) -> Any:
    """Read a value as TOML writes it, or a plain word.

    Examples
    --------
    >>> toml_value("0.5"), toml_value(".5"), toml_value("[1, 0]"), toml_value("auto")
    (0.5, 0.5, [1, 0], 'auto')
    """
    try:
        # Lines that follow would be keys of their own.
        (value,) = tomllib.loads(f"value = {text}").values()
        return value
    except ValueError:
        plain = text.strip()
        # Numbers to everybody but TOML.
        return float(plain) if re.fullmatch(r"[+-]?(\d+\.|\.\d+)", plain) else plain


def is_number(value: object) -> bool:
    """Whether a value is a number that fits a double; TOML has whole numbers of any size."""
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return False
    try:
        return math.isfinite(value)
    except OverflowError:
        return False


def shortened(value: object) -> str:
    """Write a value for an error message, shortened."""
    if isinstance(value, int) and not isinstance(value, bool) and abs(value) >= 10**30:
        return "a number too large for any length or force"
    words = repr(value)
    return words if len(words) <= 120 else f"{words[:100]} ..."
