"""The table [explain]: which causes are looked at, and how far the observations and the model are trusted."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from .key import (
    FRACTION,
    NOT_NEGATIVE,
    NUMBERS,
    POSITIVE,
    TEXTS,
    TRUE_OR_FALSE,
    Key,
    Section,
    ValueKind,
    pair_of,
    read_by,
)
from .toml_table import Table, shortened

_RANGE = pair_of("[least, largest]")

#: Directions in which a support may have moved, as the case file names them.
DIRECTIONS = ("down", "up", "left", "right", "rotation", "front", "back", "outward", "inward")


@dataclass(frozen=True)
class ExplainSettings:
    """What ``blockvis explain`` looks for, by the keys of :data:`EXPLAIN`.

    Supports that moved as one stand in one tuple; without ``directions`` those count that are usual in the plane or in
    space.
    """

    supports: tuple[tuple[str, ...], ...] = ()
    directions: tuple[str, ...] = ()
    trough: bool | None = None
    centres: tuple[float, ...] = ()
    inflections: tuple[float, ...] = ()
    friction: tuple[float, float] | None = None
    limit: float | None = None
    model_uncertainty: float = 0.25
    place_uncertainty: float | None = None
    outliers: float = 0.05


_EXPLAIN = ExplainSettings()


def _directions(words: tuple[str, ...]) -> tuple[str, ...]:
    if not words or not set(words).issubset(DIRECTIONS):
        raise ValueError(f"is {shortened(list(words))}; choose from {', '.join(DIRECTIONS)}")
    return words


def _groups(given: Any) -> tuple[tuple[str, ...], ...]:
    entries, groups = [given] if isinstance(given, str) else given, []
    for entry in entries if isinstance(entries, list | tuple) else [None]:
        names = [entry] if isinstance(entry, str) else entry
        if not isinstance(names, list | tuple) or not names or not all(isinstance(name, str) for name in names):
            raise ValueError(f'is {shortened(given)}; give names, ["left", ["middle", "right"]]')
        groups.append(tuple(names))
    return tuple(groups)


_GROUPS = ValueKind(
    "list of names, or of lists of names",
    {"anyOf": [{"type": "string"}, {"type": "array", "items": TEXTS.schema}]},
    read_by(_groups),
)

EXPLAIN = Section(
    "explain",
    "What blockvis explain looks for; every key has a default",
    (
        Key("supports", _GROUPS, "Supports that may have moved, or groups that moved as one",
            ["pier", ["left", "right"]],
            otherwise="each support of the drawing"),
        Key("directions", ValueKind("list of texts", {"type": "array", "items": {"enum": list(DIRECTIONS)}},
            read_by(_directions, Table.texts)),
            "Ways in which they may have moved", ["down", "rotation"],
            otherwise="down, left, right and rotation; in space outward, front and back, too, or, of more than four "
            "supports, down and outward"),
        Key("trough", TRUE_OR_FALSE, "Whether troughs and slopes of the ground are candidates", True,
            otherwise="where the structure stands on three places or more"),
        Key("centres", NUMBERS, "Places x at which a trough may be deepest", [1.0, 2.0], "m",
            otherwise="five over the width of the structure"),
        Key("inflections", NUMBERS, "Distances from there to where a trough may be steepest", [0.5, 1.0], "m",
            otherwise="a sixth and a third of the width"),
        Key("friction", _RANGE, "Range of the friction coefficient of [material]; others follow in proportion",
            [0.4, 0.7],
            otherwise="from 0.8 to 1.25 times that of the case"),
        Key("limit", POSITIVE, "Largest displacement of a support", 0.1, "m",
            otherwise="25 times the widest crack, or three times the largest displacement"),
        Key("model_uncertainty", POSITIVE, "Standard deviation of computed widths, as a fraction of those seen", 0.3,
            default=_EXPLAIN.model_uncertainty),
        Key("place_uncertainty", NOT_NEGATIVE, "Within which a crack at x, y may be another joint of the model",
            0.1, "m",
            otherwise="half the block size"),
        Key("outliers", FRACTION, "Probability that an observation has another cause", 0.1, default=_EXPLAIN.outliers),
    ),
)  # fmt: skip


def read_explain(table: Table) -> ExplainSettings:
    """Read the table [explain]."""
    values: dict[str, Any] = EXPLAIN.read(table)
    inflections, friction = values["inflections"], values["friction"]
    if any(value <= 0.0 for value in inflections or ()):
        raise table.error("inflections", f"is {list(inflections)}; give lengths above 0, in m")
    if friction is not None and not 0.0 <= friction[0] <= friction[1]:
        raise table.error("friction", f"is {list(friction)}; give the smallest and the largest coefficient")
    # What is not given is as the class has it.
    return ExplainSettings(**{key: value for key, value in values.items() if value is not None})
