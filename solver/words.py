"""Words of messages."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

#: What to look for where blocks do not stand as drawn.
REMEDY = (
    "look for gaps between blocks (joint_thickness), a missing support, too little friction, or blocks that overhang "
    "and tip, which need a tie, a prop or a support"
)


def counted(number: int, one: str, many: str = "") -> str:
    """Write a number of things: of one in the singular.

    Parameters
    ----------
    number : int
    one, many : str
        What there is of them; ``many`` is ``one`` with an s unless it is given.

    Examples
    --------
    >>> counted(1, "block"), counted(2, "block"), counted(0, "body falls", "bodies fall")
    ('1 block', '2 blocks', '0 bodies fall')
    """
    return f"{number} {one if number == 1 else many or one + 's'}"


def refuse_text(owner: Any) -> None:
    """Raise ``TypeError`` for a text where a dataclass has a number, which would fail later without the name."""
    for part in fields(owner):
        value = getattr(owner, part.name)
        if isinstance(value, str) and "float" in str(part.type):
            raise TypeError(f"{part.name} is the text '{value}'; give a number, without quotation marks")
