"""Did you mean: the nearest known name to one that is not known."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Sequence


def nearest(word: str, known: Sequence[str]) -> str:
    """A hint at the known word most like this one; empty where none is."""
    near = difflib.get_close_matches(word, list(known), n=1, cutoff=0.5)
    return f" (did you mean '{near[0]}'?)" if near else ""


def refuse_unknown(given: Iterable[str], known: Sequence[str], where: str) -> None:
    """Raises ``ValueError`` for the first given key that is not known."""
    for key in given:
        if key not in known:
            raise ValueError(f"{where} has no '{key}'{nearest(str(key), known)}; it has {', '.join(known)}")
