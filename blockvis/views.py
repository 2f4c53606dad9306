"""What results offer of pictures, datasets and films, made here: the views that the solver finds by its entry point."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import solver

if TYPE_CHECKING:
    import pyvista as pv


@dataclass(frozen=True)
class Picture:
    """What a notebook shows as HTML."""

    written: str

    def _repr_html_(self) -> str:
        return self.written


def shown(value: Any, **options: Any) -> Any:
    """Show a response in a player, of limit loads, a structure or its blocks a picture."""
    if isinstance(value, solver.Response):
        from .report.notebook import show

        return show(value, **options)
    return Picture(html(value, **options))


def html(value: Any) -> str:
    """Write a response, limit loads, a collapse, a structure or its blocks as HTML."""
    from .report import notebook

    if isinstance(value, solver.LimitLoad):
        return notebook.limit_load_html(value)
    if isinstance(value, solver.Response | solver.Envelope):
        return notebook.response_html(value if isinstance(value, solver.Response) else value.response)
    if isinstance(value, solver.Collapse):
        return notebook.collapse_html(value)
    return notebook.assembly_html(value.assembly if isinstance(value, solver.Structure) else value)


def dataset(response: solver.Response, of: str, k: int, shape: str) -> pv.UnstructuredGrid:
    """Make a dataset of blocks, joints, contact points or ties of an increment, below 0 from the end of the path."""
    import pyvista as pv

    from .results.datasets import block_grid, contact_grid, joint_grid, tie_grid
    from .results.increments import numbered
    from .results.mechanism_arrays import as_shown

    assembly = response.assembly
    increment = numbered(response.increments, k)
    if response.path and k < 0:
        increment = numbered(response.path, k)
    increment, quantities, falls = as_shown(response, increment)
    if of == "blocks":
        grid = block_grid(assembly, increment, quantities, shape=shape, falls=falls)
    elif of == "members":
        grid = tie_grid(response.ties, assembly, increment, quantities, shape=shape)
    else:
        grid = (joint_grid if of == "joints" else contact_grid)(assembly, increment, quantities, shape=shape)
    return pv.UnstructuredGrid(grid)


def fall(response: solver.Response, time: float, shape: str) -> pv.UnstructuredGrid:
    """Make a dataset of the blocks at a time [s] of the fall, before it as at the last equilibrium.

    Raises ``ValueError`` where nothing falls.
    """
    import pyvista as pv

    from .dynamics.fall import NEVER_STOOD, STANDS, may_fall
    from .results.fall_files import fall_grid, known_fall
    from .results.mechanism_arrays import falling_in

    found = known_fall(response)
    if found is None:
        why = STANDS if may_fall(response) else f"nothing falls here ({response.stop})"
        why = NEVER_STOOD if response.collapse is not None and not response.path else why
        raise ValueError(f"{why}: fall(t) is of what falls; mesh(-1) is the last equilibrium")
    if math.isnan(time):
        raise ValueError(f"time is {time}; give the seconds since the last equilibrium")
    time = min(max(float(time), 0.0), float(found.times[-1]))
    return pv.UnstructuredGrid(fall_grid(response, found, time, shape, falling_in(response)))


def animate(response: solver.Response, path: str | os.PathLike[str], **options: Any) -> Path:
    """Write the film of a collapse."""
    from .pictures.render import animate as write

    return write(response, path, **options)
