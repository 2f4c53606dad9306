"""Files for viewers in a results folder: a VTU file of each kind per increment, and the lists of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

import solver
from blockvis.system.vtk_files import is_complete, write_pvd, write_vtu

from .about import STATIC, Quantities
from .mechanism_arrays import as_shown
from .ties import TIES, stored_ties

#: The VTU files of an increment, and those of one with ties.
GRIDS, TIE_GRID = ("blocks", "contacts", "joints"), "ties"


@dataclass(frozen=True)
class ViewerFormat:
    """How the VTU files of a results folder are written, and what their numbers are."""

    shape: str = "moved"  #: {"moved", "undeformed"}: of the blocks; see :func:`blockvis.results.datasets.block_grid`.
    strings: bool = True
    quantities: tuple[Quantities, ...] = (STATIC,)  #: Of each phase; of later ones those of the last.


#: As viewers show them best.
MOVED = ViewerFormat()


def write_lists(folder: Path, increments: Sequence[solver.Increment], *, durable: bool = False) -> None:
    """Write the lists of the VTU files to the last equilibrium, for which the parameter is the time.

    Where nothing is in equilibrium, they name all there is.
    """
    path = [increment for increment in increments if increment.status == solver.Status.EQUILIBRIUM]
    times = output_times(path or increments)
    for kind in grids_in(folder):
        entries = [(t, f"increments/{kind}_{i:05d}.vtu") for i, t in enumerate(times)]
        write_pvd(folder / f"{kind}.pvd", entries, last=False, durable=durable)


def restore_grids(
    folder: Path, assembly: solver.Assembly, increments: Sequence[solver.Increment], vtu: ViewerFormat
) -> int:
    """Make the VTU files again that a power cut has left empty, or half there; counts increments that had lost some."""
    lost = 0
    for number, increment in enumerate(increments):
        if not all(is_complete(grid_file(folder, kind, number)) for kind in grids_in(folder)):
            write_grids(folder, number, assembly, increment, vtu)
            lost += 1
    return lost


def write_end(folder: Path, response: solver.Response, vtu: ViewerFormat) -> None:
    """Write the VTU files of the last equilibrium again, when the collapse that follows it is known."""
    if response.path and response.collapse is not None:
        last, own, falls = as_shown(response, response.path[-1])
        write_grids(folder, len(response.path) - 1, response.assembly, last, replace(vtu, quantities=(own,)), falls)


def write_grids(
    folder: Path,
    number: int,
    assembly: solver.Assembly,
    increment: solver.Increment,
    vtu: ViewerFormat,
    falls: np.ndarray | None = None,
) -> None:
    """Write the VTU files of an increment by its number; ``falls`` as of :func:`~.datasets.block_grid`."""
    # VTK is loaded where its files are written, not by whoever reads results.
    from .datasets import grids_of

    ties = stored_ties(folder)
    quantities = vtu.quantities[min(increment.phase, len(vtu.quantities) - 1)]
    for kind, grid in grids_of(assembly, increment, ties, quantities, shape=vtu.shape, falls=falls).items():
        write_vtu(grid, grid_file(folder, kind, number), strings=vtu.strings, durable=False)


def grids_in(folder: Path) -> tuple[str, ...]:
    """List the kinds of VTU files of a results folder."""
    return (*GRIDS, TIE_GRID) if (folder / TIES).is_file() else GRIDS


def grid_file(folder: Path, kind: str, number: int) -> Path:
    """Path of a VTU file of an increment."""
    return folder / "increments" / f"{kind}_{number:05d}.vtu"


def output_times(increments: Sequence[solver.Increment]) -> list[float]:
    """Strictly increasing times, one per increment, for readers that sort or merge by time.

    They are the parameter in equilibrium [m or rad], phases one after another. Frames of the fall share one parameter:
    their times grow by a hundredth of it each.
    """
    times: list[float] = []
    before, phase, last = 0.0, 0, 0.0
    for increment in increments:
        if increment.phase != phase:
            before, phase = last, increment.phase
        time = before + increment.parameter
        if times and time <= times[-1]:
            # Row 0 of a phase is at the end of the one before, and what tells them apart takes no time.
            step = 0.01 if increment.status == solver.Status.FALLING else 1e-9
            time = times[-1] + step * (abs(last) or 1.0)
        else:
            last = time
        times.append(float(time))
    return times
