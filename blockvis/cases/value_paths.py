"""Dotted paths into the values of a case file: parsed, and followed to put a value at their end."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

from blockvis.text import nearest
from solver.mechanics import counted

_STEP = re.compile(r'\.?(?:([A-Za-z0-9_-]+)|"([^"]*)"|\[(\d+)\])')


def parse_path(text: str) -> tuple[str | int, ...]:
    """Split a path, in dotted keys as of TOML, with ``[n]`` for the entries of a list, from 0, into keys and numbers.

    ValueError for a text that is no path.

    Examples
    --------
    >>> parse_path('supports[0].outline')
    ('supports', 0, 'outline')
    >>> parse_path('roles."right springer"')
    ('roles', 'right springer')
    """
    steps: list[str | int] = []
    at = 0
    while at < len(text):
        found = _STEP.match(text, at)
        dotted = text[at] == "."
        if found is None or (dotted and (not steps or found[3])) or (steps and not dotted and not found[3]):
            raise ValueError(
                f"'{text}' is not a path into a case file; write it like material.friction_coefficient, "
                'supports[0].outline or roles."right springer"'
            )
        steps.append(int(found[3]) if found[3] else found[1] if found[1] is not None else found[2])
        at = found.end()
    if not steps or isinstance(steps[0], int):
        raise ValueError(f"'{text}' is not a path into a case file; it starts with the name of a table")
    return tuple(steps)


def put(values: dict[str, Any], path: Sequence[str | int], value: Any) -> None:
    """Put a value at the end of a path into parsed TOML, in place; missing tables on the path are made.

    ValueError for a path to a missing entry of a list, or into something that is neither table nor list.

    Examples
    --------
    >>> case = {"settlement": {"direction": [1, 0]}}
    >>> put(case, ("settlement", "direction", 1), 0.5)
    >>> case
    {'settlement': {'direction': [1, 0.5]}}
    """
    here: Any = values
    for number, step in enumerate(path):
        last = number == len(path) - 1
        trail = _written(path[:number])
        if isinstance(step, int):
            # [settlement] and [[settlement]] mean the same if there is only one.
            if isinstance(here, dict) and step == 0 and not last:
                continue
            if not isinstance(here, list):
                raise ValueError(f"{trail} is no list, so that [{step}] leads nowhere")
            if step >= len(here):
                raise ValueError(
                    f"{trail} has {counted(len(here), 'entry', 'entries')}, counted from 0, so that [{step}] leads "
                    "nowhere"
                )
        elif isinstance(here, list):
            entry = f"{trail}[{step}]" if step.isdecimal() else f"{trail}[0].{step}"
            raise ValueError(f"{trail} is a list of {len(here)}; say which entry, for instance {entry}")
        elif not isinstance(here, dict):
            raise ValueError(f"{trail} is {here!r}, no table, so that it has no '{step}'")
        if last:
            here[step] = value
        elif isinstance(step, int):
            here = here[step]
        else:
            follows = path[number + 1]
            if step not in here and isinstance(follows, int):
                hint = nearest(step, list(map(str, here)))
                raise ValueError(f"there is no list '{_written(path[: number + 1])}'{hint}")
            here = here.setdefault(step, {})


def _written(path: Sequence[str | int]) -> str:
    text = ""
    for step in path:
        text += f"[{step}]" if isinstance(step, int) else f".{step}" if text else step
    return text or "the case"
