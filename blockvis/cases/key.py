"""What a key of a TOML file is: its kind of value, unit, default, meaning and an example.

Files are read by it, and the JSON schema, the reference pages and the comments of new case files are written from it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from .toml_table import Table, is_number, shortened


@dataclass(frozen=True)
class ValueKind:
    """A kind of value: in words for people, as JSON schema has it, and the function that reads and checks one."""

    words: str
    schema: Mapping[str, Any]
    read: Callable[[Table, Key], Any] = lambda table, key: table.take(key.name)


def list_of(item: Mapping[str, Any], least: int, most: int | None = None) -> dict[str, Any]:
    """Say, as JSON schema has it, that a value is a list of so many items."""
    return {"type": "array", "items": item, "minItems": least} | ({} if most is None else {"maxItems": most})


def table_of(properties: Mapping[str, Any], required: Sequence[str] = ()) -> dict[str, Any]:
    """Say, as JSON schema has it, that a value is a table with these keys and no others."""
    needed = {"required": list(required)} if required else {}
    return {"type": "object", "properties": properties} | needed | {"additionalProperties": False}


#: What numbers that cannot be negative are, by their unit.
_QUANTITIES = {"m": "length in m", "Pa": "stress in Pa"}


def read_by(read: Callable[[Any], Any], take: Callable[[Table, str], Any] = Table.take) -> Callable[[Table, Key], Any]:
    """Make the reader of values that ``read`` checks, with a ValueError of what is wrong and the remedy."""

    def checked(table: Table, key: Key) -> Any:
        value = take(table, key.name)
        try:
            return None if value is None else read(value)
        except ValueError as error:
            raise table.error(key.name, str(error).removeprefix(f"{key.name} ")) from None

    return checked


def _outline(corners: Any) -> list[Any]:
    if not isinstance(corners, list) or len(corners) < 3:
        raise ValueError(f"is {shortened(corners)}; give at least three corners [[x, y], ...]")
    for corner in corners:
        if not isinstance(corner, (list, tuple)) or len(corner) != 2 or not all(map(is_number, corner)):
            raise ValueError(f"has the corner {shortened(corner)}; give two numbers [x, y]")
    return corners


def _number(words: str, schema: Mapping[str, Any], fits: Callable[[float], bool]) -> ValueKind:
    """Make a kind of numbers with limits."""

    def read(table: Table, key: Key) -> float | None:
        value: float | None = table.number(key.name)
        if value is not None and not fits(value):
            quantity = words.replace("number of", f"{_QUANTITIES.get(key.unit, 'number')} of")
            raise table.error(key.name, f"is {value:g}; give a {quantity}")
        return value

    return ValueKind(words, {"type": "number"} | dict(schema), read)


def pair_of(words: str) -> ValueKind:
    """Make the kind of two numbers; ``words`` says in the error what they are."""
    numbers = list_of({"type": "number"}, 2, 2)
    return ValueKind("two numbers", numbers, lambda table, key: table.vector(key.name, (2,), f"two numbers {words}"))


NUMBER = _number("number", {}, lambda value: True)
POSITIVE = _number("number above 0", {"exclusiveMinimum": 0}, lambda value: value > 0.0)
FRACTION = _number(
    "number above 0 and below 1", {"exclusiveMinimum": 0, "exclusiveMaximum": 1}, lambda value: 0.0 < value < 1.0
)
SHARE = _number("number from 0 to 1", {"minimum": 0, "maximum": 1}, lambda value: 0.0 <= value <= 1.0)
NOT_NEGATIVE = _number("number of at least 0", {"minimum": 0}, lambda value: value >= 0.0)
TRUE_OR_FALSE = ValueKind("true or false", {"type": "boolean"}, lambda table, key: table.boolean(key.name))
TEXT = ValueKind("text", {"type": "string"}, lambda table, key: table.text(key.name))
TEXTS = ValueKind(
    "text, or list of texts",
    {"anyOf": [{"type": "string"}, {"type": "array", "items": {"type": "string"}}]},
    lambda table, key: table.texts(key.name),
)
PAIR = pair_of("[x, y]")
VECTOR = ValueKind(
    "two numbers, in space three", list_of({"type": "number"}, 2, 3), lambda table, key: table.vector(key.name)
)
TRIPLE = ValueKind(
    "three numbers",
    list_of({"type": "number"}, 3, 3),
    lambda table, key: table.vector(key.name, (3,), "three numbers [x, y, z]"),
)
NUMBERS = ValueKind("list of numbers", list_of({"type": "number"}, 1), lambda table, key: table.numbers(key.name))
OUTLINE = ValueKind("list of at least three corners", list_of(list_of({"type": "number"}, 2, 2), 3), read_by(_outline))


def whole(least: int, most: int | None = None) -> ValueKind:
    """Make the kind of whole numbers of at least ``least``, and at most ``most``."""
    limit = {} if most is None else {"maximum": most}
    return ValueKind(
        f"whole number of at least {least}",
        {"type": "integer", "minimum": least} | limit,
        lambda table, key: table.whole(key.name, least, most),
    )


def one_of(choices: Sequence[str]) -> ValueKind:
    """Make the kind of texts that are one of ``choices``."""
    return ValueKind("text", {"enum": list(choices)}, lambda table, key: table.text(key.name, among=tuple(choices)))


@dataclass(frozen=True)
class Key:
    """A key of a TOML file, required or not."""

    name: str
    kind: ValueKind
    meaning: str  #: In words of the field, beginning with a capital letter, without a full stop at its end.
    example: Any  #: A value as Python has it.
    unit: str = ""
    default: Any = None  #: The value that holds where the key is missing; None where there is none.
    otherwise: str = ""  #: What holds where the key is missing, in words, if that is no value.
    required: bool = False
    #: Whether the value may stand elsewhere, as in the layout file: a missing key is read as None, and the default
    #: holds where nothing says otherwise.
    elsewhere: bool = False
    remedy: str = ""  #: What to do where a required key is missing.

    def read(self, table: Table) -> Any:
        """Read and check its value; where it is missing the default, or None where it may stand elsewhere."""
        value = self.kind.read(table, self)
        if value is None and self.required:
            remedy = self.remedy or (f"choose from {', '.join(self.choices)}" if self.choices else "")
            raise table.error(self.name, f"is missing{f'; {remedy}' if remedy else ''}")
        return self.default if value is None and not self.elsewhere else value

    @property
    def schema(self) -> dict[str, Any]:
        """What its value may be, as JSON schema has it."""
        unit = f" [{self.unit}]" if self.unit else ""
        missing = f". If missing: {self.otherwise}" if self.otherwise else ""
        value = dict(self.kind.schema) | {"description": f"{self.meaning}{unit}{missing}", "examples": [self.example]}
        if self.default is not None:
            value["default"] = list(self.default) if isinstance(self.default, tuple) else self.default
        return value

    @property
    def choices(self) -> tuple[str, ...]:
        """The texts among which the value must be; empty for other keys."""
        return tuple(choice for choice in self.kind.schema.get("enum", ()) if isinstance(choice, str))


@dataclass(frozen=True)
class Forms:
    """The forms of a table, by their names: which keys it must have, and may, beside those that every form has.

    The key ``by`` names the form; where it is missing and not required, the keys that are there tell.
    """

    by: str
    needed: Mapping[str, tuple[str, ...]]
    possible: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    def keys(self, form: str) -> tuple[str, ...]:
        """Names of the keys that are those of a form."""
        return (*self.needed[form], *self.possible.get(form, ()))

    def with_default(self, name: str) -> Forms:
        """Make the forms in which a key may be missing."""
        needed = {form: tuple(key for key in keys if key != name) for form, keys in self.needed.items()}
        possible = {form: tuple(key for key in self.keys(form) if key not in needed[form]) for form in needed}
        return Forms(self.by, needed, possible)

    @property
    def every(self) -> tuple[str, ...]:
        """Names of the keys that not every table has."""
        return tuple(dict.fromkeys(name for form in self.needed for name in self.keys(form)))

    def form_of(self, table: Table, named: str | None) -> str:
        """Find the form of a table, the one that is named or the first whose keys are there; refuse keys of others."""
        given = [form for form in self.needed if any(name in table.values for name in self.keys(form))]
        form = named or (given or list(self.needed))[0]
        for name in table.values:
            if name in self.every and name not in self.keys(form):
                others = " or ".join(f"'{other}'" for other in self.needed if name in self.keys(other))
                raise table.error(
                    name, f"is of {self.by} {others}, and '{form}' has {', '.join(self.keys(form))}; give one {self.by}"
                )
        return form

    def as_of(self, form: str, key: Key) -> Key:
        """Make the key as a table of this form has it: required where the form needs it."""
        if key.name not in self.needed[form]:
            return key
        return replace(
            key, required=True, remedy=key.remedy or f"{self.by} '{form}' needs {' and '.join(self.needed[form])}"
        )

    def schemas(self, names: Sequence[str]) -> list[dict[str, Any]]:
        """Say, as JSON schema has it, which of the keys of a table with these ``names`` go with each form."""
        return [
            {
                "if": {"properties": {self.by: {"const": form}}, "required": [self.by]},
                "then": {
                    "propertyNames": {
                        "enum": [name for name in names if name in self.keys(form) or name not in self.every]
                    }
                },
            }
            for form in self.needed
        ]


@dataclass(frozen=True)
class Section:
    """A table of a TOML file, required or not; there may be ``several``, ``[[name]]``."""

    name: str  #: With dots, as its header has it; "*" for a name that the user chooses.
    meaning: str
    keys: tuple[Key, ...] = ()
    several: bool = False
    #: Of the values, where the user chooses the names of the keys; ``example`` holds such keys.
    names: ValueKind | None = None
    required: bool = False
    forms: Forms | None = None  #: Which of the keys a table has, where this depends on one of them.
    example: Mapping[str, Any] = field(default_factory=dict)

    @property
    def header(self) -> str:
        """The line that begins the table."""
        return f"[[{self.name}]]" if self.several else f"[{self.name}]"

    def key(self, name: str) -> Key:
        """Find the key of this name."""
        return next(key for key in self.keys if key.name == name)

    @property
    def schema(self) -> dict[str, Any]:
        """What one table may hold, as JSON schema has it."""
        table: dict[str, Any] = {"type": "object", "description": self.meaning}
        if self.keys or self.names is None:
            table["properties"] = {key.name: key.schema for key in self.keys}
        table["additionalProperties"] = False if self.names is None else dict(self.names.schema)
        required = [key.name for key in self.keys if key.required]
        if required:
            table["required"] = required
        if self.forms is not None:
            table["allOf"] = self.forms.schemas([key.name for key in self.keys])
        return table

    def read(self, table: Table) -> dict[str, Any]:
        """Read and check the values of its keys, each at its default where it is missing; refuse other keys.

        Of a table that has forms, the values of the keys of its form.
        """
        # A misspelt key is named before the one that it was to be is missing.
        table.finish([key.name for key in self.keys])
        if self.forms is None:
            return read_keys(self.keys, table)
        values = read_keys([key for key in self.keys if key.name not in self.forms.every], table)
        form = self.forms.form_of(table, values[self.forms.by])
        own = [self.forms.as_of(form, key) for key in self.keys if key.name in self.forms.keys(form)]
        return values | read_keys(own, table)


def read_keys(keys: Iterable[Key], table: Table) -> dict[str, Any]:
    """Read and check the values of keys, each at its default where it is missing."""
    return {key.name: key.read(table) for key in keys}
