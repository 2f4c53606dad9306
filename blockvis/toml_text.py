"""Values as TOML writes them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import tomlkit


def as_toml(value: Any) -> str:
    r"""Write a value as TOML has it; numbers with twelve digits, which leaves out the rounding of converted lengths.

    Examples
    --------
    >>> print(as_toml({"x": 0.1 + 0.2, "names": ["a", 'b "c"'], "film": False}))
    {x = 0.3, names = ["a", "b \"c\""], film = false}
    """
    return tomlkit.item(_inline(value)).as_string()


def as_key(key: str) -> str:
    """Write a key as TOML has it, in quotes where it needs them.

    Examples
    --------
    >>> as_key("limit"), as_key("left springer")
    ('limit', '"left springer"')
    """
    return tomlkit.key(key).as_string()


def _inline(value: Any) -> Any:
    if isinstance(value, Mapping):
        table = tomlkit.inline_table()
        table.update({key: _inline(one) for key, one in value.items()})
        return table
    if isinstance(value, list | tuple):
        return [_inline(one) for one in value]
    return float(f"{value:.12g}") if isinstance(value, float) else value
