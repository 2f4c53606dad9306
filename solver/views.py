"""Pictures, datasets and films of structures and results, which are made by a package that draws: this one does not."""

from __future__ import annotations

from functools import cache
from importlib.metadata import entry_points
from typing import Any


@cache
def _views() -> Any:
    return next((entry.load() for entry in entry_points(group="solver.views")), None)


def views() -> Any:
    """Find the views of the package that draws; raises ``ImportError`` where none is installed."""
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
