"""Every column of a table of observations; :mod:`blockvis.explanation.observations` reads the rows by them."""

from __future__ import annotations

from blockvis.cases.key import NOT_NEGATIVE, NUMBER, POSITIVE, TEXT, Key, Section, ValueKind
from blockvis.cases.toml_table import Table


def _width(table: Table, key: Key) -> float | None:
    given = table.take(key.name)
    if isinstance(given, str) and given.lower() == "closed":
        return 0.0
    width: float | None = table.number(key.name)
    if width is not None and width < 0.0:
        raise table.error(key.name, f'is {width:g}; give a width of at least 0, or "closed"')
    return width


_WIDTH = ValueKind(
    "number of at least 0, or closed",
    {"anyOf": [dict(NOT_NEGATIVE.schema), {"type": "string", "pattern": "^[cC][lL][oO][sS][eE][dD]$"}]},
    _width,
)
_PLACE = "the joint says where"

OBSERVATION = Section(
    "observations",
    "A crack, or a displaced point, in each row",
    (
        Key("joint", TEXT, "The two blocks beside the crack", "voussoir 3 | voussoir 4",
            otherwise="block_a and block_b, or x and y, say where"),
        Key("block_a", TEXT, "One of the two blocks, instead", "voussoir 3", otherwise=_PLACE),
        Key("block_b", TEXT, "The other one", "voussoir 4", otherwise=_PLACE),
        Key("block", TEXT, "The block that has moved", "voussoir 3", otherwise="the block at x and y"),
        Key("x", NUMBER, "Where the crack or the point is in the drawing", 0.85, "m", otherwise="the largest width of "
            "the joint, or the centroid of the block"),
        Key("y", NUMBER, "Where the crack or the point is in the drawing", 0.5, "m", otherwise="as for x"),
        Key("z", NUMBER, "Where the crack or the point is in the drawing, in space", 2.5, "m", otherwise="as for x"),
        Key("width", _WIDTH, "Width of the crack; closed is an observation, too", 0.0045, "m",
            otherwise="the row has a displacement"),
        Key("uncertainty", POSITIVE, "Standard deviation of the width, or of each coordinate", 0.0005, "m",
            otherwise="a fifth of the width, at least 0.2 mm; 1 mm of a displacement"),
        Key("dx", NUMBER, "How far the block or point has moved", 0.001, "m", otherwise="the row has a width"),
        Key("dy", NUMBER, "How far the block or point has moved", -0.005, "m", otherwise="the row has a width"),
        Key("dz", NUMBER, "How far the block or point has moved, in space", -0.005, "m",
            otherwise="the row has a width"),
        Key("displaced_x", NUMBER, "Where it is now, instead of dx", 0.851, "m", otherwise="dx says how far it moved"),
        Key("displaced_y", NUMBER, "Where it is now, instead of dy", 0.495, "m", otherwise="dy says how far it moved"),
        Key("displaced_z", NUMBER, "Where it is now, instead of dz", 2.495, "m", otherwise="dz says how far it moved"),
    ),
)  # fmt: skip

#: Other words that tables have for columns.
ALSO_CALLED = {"opening": "width", "crack_width": "width", "sigma": "uncertainty", "error": "uncertainty"}

#: Columns, by the words that tables have for them.
COLUMNS = {key.name: key.name for key in OBSERVATION.keys} | ALSO_CALLED

#: Columns that hold lengths.
LENGTHS = tuple(key.name for key in OBSERVATION.keys if key.unit == "m")
