"""Names, groups, roles and materials of the blocks of a layout."""

from __future__ import annotations

import re
from typing import Any

#: Surrogate halves of characters, which escaped JSON and bytes that are no text leave behind.
_HALVES = re.compile("[\ud800-\udfff]")


def check_labels(layout: Any, n: int, what: str) -> None:
    """Check that a layout being made has one label of each kind per block, and replace broken characters.

    Parameters
    ----------
    layout : Layout or SolidLayout
    n : int
        Number of blocks.
    what : str
        Outlines or solids, for the message.

    Raises
    ------
    ValueError
        For another number of labels.
    """
    for kind in ("groups", "roles", "materials"):
        if not getattr(layout, kind):
            object.__setattr__(layout, kind, ("",) * n)
    for kind in ("names", "groups", "roles", "materials"):
        if len(getattr(layout, kind)) != n:
            raise ValueError(f"{n} {what} but {len(getattr(layout, kind))} {kind}; give one per block")
    # A file in another encoding than it states leaves halves of characters, which cannot be written to a file.
    note = "characters that the file's encoding does not have are shown as \ufffd"
    for kind in ("names", "groups", "roles", "materials"):
        words = getattr(layout, kind)
        whole = tuple(_HALVES.sub("\ufffd", word) for word in words)
        if whole != tuple(words) and note not in layout.notes:
            object.__setattr__(layout, "notes", (*layout.notes, note))
        object.__setattr__(layout, kind, whole)
