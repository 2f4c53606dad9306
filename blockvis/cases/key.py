"""What a key of a TOML file is: its kind of value, unit, default, meaning and an example.

The tables of keys are made of these: :data:`blockvis.case_files.case_keys.SECTIONS`, the keys of a kind of analysis in
:attr:`blockvis.kinds.kind.AnalysisKind.keys`, and :data:`blockvis.studies.study_keys.SECTIONS`. The JSON schema, the
reference pages and the comments of new case files are written from them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True)
class ValueKind:
    """A kind of value.

    Attributes
    ----------
    words : str
        For people.
    schema : mapping
        For programs, as JSON schema has it.
    """

    words: str
    schema: Mapping[str, Any]


def _list_of(item: Mapping[str, Any], least: int = 0, most: int | None = None) -> dict[str, Any]:
    return {"type": "array", "items": item, "minItems": least} | ({} if most is None else {"maxItems": most})


NUMBER = ValueKind("number", {"type": "number"})
POSITIVE = ValueKind("number above 0", {"type": "number", "exclusiveMinimum": 0})
FRACTION = ValueKind("number above 0 and below 1", {"type": "number", "exclusiveMinimum": 0, "exclusiveMaximum": 1})
SHARE = ValueKind("number from 0 to 1", {"type": "number", "minimum": 0, "maximum": 1})
NOT_NEGATIVE = ValueKind("number of at least 0", {"type": "number", "minimum": 0})
TRUE_OR_FALSE = ValueKind("true or false", {"type": "boolean"})
TEXT = ValueKind("text", {"type": "string"})
TEXTS = ValueKind(
    "text, or list of texts", {"anyOf": [{"type": "string"}, {"type": "array", "items": {"type": "string"}}]}
)
PAIR = ValueKind("two numbers", _list_of({"type": "number"}, 2, 2))
VECTOR = ValueKind("two numbers, in space three", _list_of({"type": "number"}, 2, 3))
TRIPLE = ValueKind("three numbers", _list_of({"type": "number"}, 3, 3))
NUMBERS = ValueKind("list of numbers", _list_of({"type": "number"}, 1))
OUTLINE = ValueKind("list of at least three corners", _list_of(_list_of({"type": "number"}, 2, 2), 3))


def whole(least: int, most: int | None = None) -> ValueKind:
    """Make the kind of whole numbers of at least ``least``, and at most ``most``."""
    limit = {} if most is None else {"maximum": most}
    return ValueKind(f"whole number of at least {least}", {"type": "integer", "minimum": least} | limit)


def one_of(choices: Sequence[str]) -> ValueKind:
    """Make the kind of texts that are one of ``choices``."""
    return ValueKind("text", {"enum": list(choices)})


@dataclass(frozen=True)
class Key:
    """A key of a TOML file.

    Attributes
    ----------
    name : str
    kind : ValueKind
    meaning : str
        In words of the field, beginning with a capital letter, without a full stop at its end.
    example : Any
        A value as Python has it.
    unit : str
        "" for none.
    default : Any
        The value that holds where the key is missing; None where there is none.
    otherwise : str
        What holds where the key is missing, in words, if that is no value.
    required : bool
        Whether the key must be there.
    """

    name: str
    kind: ValueKind
    meaning: str
    example: Any
    unit: str = ""
    default: Any = None
    otherwise: str = ""
    required: bool = False

    @property
    def choices(self) -> tuple[str, ...]:
        """The texts among which the value must be; empty for other keys."""
        return tuple(self.kind.schema.get("enum", ()))


@dataclass(frozen=True)
class Section:
    """A table of a TOML file.

    Attributes
    ----------
    name : str
        With dots, as its header has it; "*" for a name that the user chooses.
    meaning : str
    keys : tuple of Key
    several : bool
        Whether there may be several, ``[[name]]``.
    names : ValueKind, optional
        Of the values, where the user chooses the names of the keys.
    required : bool
        Whether the table must be there.
    example : mapping
        Keys of the user's choice, where there are such.
    """

    name: str
    meaning: str
    keys: tuple[Key, ...] = ()
    several: bool = False
    names: ValueKind | None = None
    required: bool = False
    example: Mapping[str, Any] = field(default_factory=dict)

    @property
    def header(self) -> str:
        """The line that begins the table."""
        return f"[[{self.name}]]" if self.several else f"[{self.name}]"

    def key(self, name: str) -> Key:
        """Find the key of this name."""
        return next(key for key in self.keys if key.name == name)
