"""Known names similar to a given one, for messages: "did you mean"."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Sequence
from pathlib import Path


def nearest(word: str, known: Sequence[str]) -> str:
    """Write a hint at the known word most similar to the given one.

    Returns
    -------
    str
        Empty if no known word is similar.

    Examples
    --------
    >>> nearest("thikness", ["density", "thickness"])
    " (did you mean 'thickness'?)"
    >>> nearest("frction", ["cohesion", "friction_coefficient"])
    " (did you mean 'friction_coefficient'?)"
    """
    # A word of a longer name counts as much as the name: who writes "frction" means friction_coefficient.
    whole = {part: name for name in reversed(known) for part in name.split("_")} | {name: name for name in known}
    near = difflib.get_close_matches(word, list(whole), n=1, cutoff=0.5)
    return f" (did you mean '{whole[near[0]]}'?)" if near else ""


def by_similarity(word: str, known: Iterable[str]) -> list[str]:
    """Order known words by similarity to the given one, upper and lower case alike, the most similar first."""
    likeness = {name: difflib.SequenceMatcher(None, word.lower(), name.lower()).ratio() for name in known}
    return sorted(likeness, key=lambda name: -likeness[name])


def files_like(path: Path, pattern: str = "*", *, or_any: bool = False) -> list[str]:
    """Find up to three names similar to that of a missing file, among the files of its folder that fit a pattern.

    Parameters
    ----------
    path : Path
        Of the missing file.
    pattern : str
        As of ``Path.glob``.
    or_any : bool
        Whether less similar names, or any, are returned if none is similar.
    """
    beside = sorted(entry.name for entry in path.parent.glob(pattern)) if path.parent.is_dir() else []
    near = difflib.get_close_matches(path.name, beside, n=3, cutoff=0.4 if or_any else 0.6)
    return near or (beside[:3] if or_any else [])


def refuse_unknown(given: Iterable[str], known: Sequence[str], where: str) -> None:
    """Raise ``ValueError`` for the first given key that is not known."""
    for key in given:
        if key not in known:
            raise ValueError(f"{where} has no '{key}'{nearest(str(key), known)}; it has {', '.join(known)}")
