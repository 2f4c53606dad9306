"""Pictures, datasets and films of structures and results, which are made by a package that draws: this one does not."""

from __future__ import annotations

import os
from functools import cache
from importlib.metadata import entry_points
from typing import Any, Protocol


class Views(Protocol):
    """What a package that draws offers."""

    def shown(self, value: Any, **options: Any) -> Any:
        """Give what a notebook shows of a value as the last line of a cell."""

    def html(self, value: Any) -> str:
        """Give the value as HTML."""

    def dataset(self, response: Any, of: str, k: int, shape: str) -> Any:
        """Give the "blocks", "joints", "contacts" or "members" of increment k as a dataset."""

    def fall(self, response: Any, time: float, shape: str) -> Any:
        """Give the blocks so many seconds after the last equilibrium as a dataset."""

    def animate(self, response: Any, path: str | os.PathLike[str], **options: Any) -> Any:
        """Write a film."""


@cache
def _views() -> Views | None:
    entries = tuple(entry_points(group="solver.views"))
    first: Views | None = entries[0].load() if entries else None
    return first


def views() -> Views:
    """Find the views of the package that draws.

    Raises
    ------
    ImportError
        Where none is installed.
    """
    found = _views()
    if found is None:
        raise ImportError("solver draws nothing; pictures and datasets are made by blockvis: pip install blockvis")
    return found


class Shown:
    """A value that notebooks show where a package that draws is installed."""

    def _repr_html_(self) -> str | None:
        found = _views()
        return None if found is None else found.html(self)

    def plot(self, **options: Any) -> Any:
        """Show it, as the last line of a notebook cell: a response in a player of ``height`` pixels, else pictured."""
        return views().shown(self, **options)
