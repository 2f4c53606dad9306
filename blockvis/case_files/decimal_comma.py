"""Numbers with a decimal comma, which TOML does not know, told with the point they want."""

from __future__ import annotations

import re

#: Line and column where a parser of TOML stopped.
STOPPED = re.compile(r"\(at line (\d+), column (\d+)\)")

#: A number with a decimal comma at the end of a line, a comment apart.
COMMA = re.compile(r"^\s*([\w.\"'-]+)\s*=\s*([+-]?\d+),(\d+(?:[eE][+-]?\d+)?)\s*(#.*)?$")


def decimal_comma(text: str, error: str) -> str:
    """Write how a number is to be written where a parser of TOML stopped at its decimal comma, by its message; else "".

    Examples
    --------
    >>> decimal_comma("limit = 0,5", "Expected newline (at line 1, column 10)")
    'line 1: limit = 0,5 has a decimal comma; numbers have a point: limit = 0.5'
    """
    place = STOPPED.search(error)
    lines = text.splitlines()
    line = lines[int(place[1]) - 1] if place and int(place[1]) <= len(lines) else ""
    found = COMMA.match(line)
    if found is None:
        return ""
    key, whole, part, _ = found.groups()
    where = f"line {place[1] if place else 1}: {key} = {whole},{part}"
    return f"{where} has a decimal comma; numbers have a point: {key} = {whole}.{part}"
