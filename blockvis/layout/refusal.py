"""A drawing that is refused, with what it draws: a picture can show then why."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

from .layout import Layout


class Refused(ValueError):
    """A drawing that no blocks can be made of: one line on what is wrong, where, and what to do.

    Its layout is what was read, as far as that went: outlines may cross themselves, surfaces may be open, and there may
    be lines only. ``blocks`` are those at fault, where that is known; coordinates are in the ``unit``, m, or that of
    the file where it was refused as it was read.
    """

    def __init__(self, message: str, layout: Layout | None = None, blocks: Sequence[int] = ()) -> None:
        super().__init__(message)
        self.layout, self.blocks, self.unit = layout, tuple(blocks), "m"


@contextmanager
def carrying(drawn: Callable[[], Layout]) -> Iterator[None]:
    """Give what is refused within the layout that it is about; it is ``drawn`` where something is refused only."""
    try:
        yield
    except Refused as error:
        if error.layout is None:
            error.layout = drawn()
        raise
    except ValueError as error:
        raise Refused(str(error), drawn()) from error
