"""What results offer of pictures, datasets and films, made here: the views that the solver finds by its entry point."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

import solver

if TYPE_CHECKING:
    import pyvista as pv


@dataclass(frozen=True)
class Picture:
    """What a notebook shows as HTML.

    Attributes
    ----------
    written : str
    """

    written: str

    def _repr_html_(self) -> str:
        return self.written


def shown(value: Any, **options: Any) -> Any:
    """Show a response in a player, of a limit load, a structure or its blocks a picture."""
    if isinstance(value, solver.Response):
        from .report.notebook import show

        return show(value, **options)
    return Picture(html(value, **options))


def html(value: Any) -> str:
    """Write a response, a limit load, a collapse, a structure or its blocks as HTML."""
    from .report import notebook

    if isinstance(value, solver.LimitLoad):
        return notebook.limit_load_html(value)
    if isinstance(value, solver.Response):
        return notebook.response_html(value)
    if isinstance(value, solver.Collapse):
        return notebook.collapse_html(value)
    return notebook.assembly_html(value.assembly if isinstance(value, solver.Structure) else value)


def blocks(response: solver.Response, k: int, shape: str) -> pv.UnstructuredGrid:
    """Make a dataset of the blocks of increment k."""
    from .results.datasets import block_dataset

    return block_dataset(response.assembly, _increment(response, k), shape=shape)


def joints(response: solver.Response, k: int, shape: str) -> pv.UnstructuredGrid:
    """Make a dataset of the joints of increment k."""
    from .results.datasets import joint_dataset

    return joint_dataset(response.assembly, _increment(response, k), shape=shape)


def contacts(response: solver.Response, k: int, shape: str) -> pv.UnstructuredGrid:
    """Make a dataset of the contact points of increment k."""
    from .results.datasets import contact_dataset

    return contact_dataset(response.assembly, _increment(response, k), shape=shape)


def _increment(response: solver.Response, k: int) -> solver.Increment:
    n = len(response.increments)
    if not isinstance(k, (int, np.integer)):
        raise TypeError(f"k is {k!r}; it is the number of an increment, 0 to {n - 1}, or -1 for the last")
    if not -n <= k < n:
        raise IndexError(f"there is no increment {k}; the response has {n}, 0 to {n - 1}, or -1 for the last")
    return response.increments[k]


def animate(response: solver.Response, path: str | os.PathLike[str], **options: Any) -> Path:
    """Write the film of a collapse."""
    from .pictures.render import animate as write

    return write(response, path, **options)
