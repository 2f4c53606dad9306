"""Values as TOML writes them."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any


def toml_value(value: Any) -> str:
    r"""Write a value as TOML has it; lengths with twelve digits, which leaves out the rounding of their conversion.

    Examples
    --------
    >>> toml_value({"x": 0.1 + 0.2, "names": ["a", 'b "c"'], "film": False})
    '{ x = 0.3, names = ["a", "b \\"c\\""], film = false }'
    """
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{toml_key(key)} = {toml_value(one)}" for key, one in value.items()) + " }"
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(toml_value, value))}]"
    if isinstance(value, float):
        text = f"{value:.12g}"
        return text if any(c in text for c in ".en") or not math.isfinite(value) else f"{text}.0"
    # The strings of JSON are basic strings of TOML, but for one control character.
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")


def toml_key(key: str) -> str:
    """Write a key as TOML has it, in quotes where it needs them.

    Examples
    --------
    >>> toml_key("limit"), toml_key("left springer")
    ('limit', '"left springer"')
    """
    plain = key.isascii() and key.replace("_", "").replace("-", "").isalnum()
    return key if plain else toml_value(key)
