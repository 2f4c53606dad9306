"""Words of messages."""

from __future__ import annotations


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
