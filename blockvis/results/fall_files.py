"""The fall in the results folder: VTU files with the time as their parameter, and its poses for whoever draws again."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import solver
from blockvis.dynamics.fall import Fall, falling_increment
from blockvis.system.atomic_files import make_folder, write_atomic

from .npz import checked_arrays, compressed, flat, from_flat

#: List of the VTU files, and the poses.
FALL_LIST, FALL_POSES = "fall.pvd", "fall.npz"


def write_fall(fall: Fall, response: solver.Response, folder: Path) -> None:
    """Write the VTU files of a fall, the list of them, and its poses.

    Parameters
    ----------
    fall : Fall
    response : solver.Response
        Of which it is the fall.
    folder : Path
        Of the results.
    """
    from blockvis.system.vtk_files import write_pvd, write_vtu

    from .datasets import add_arrays, block_grid

    make_folder(folder / "fall")
    entries = []
    for k, time in enumerate(fall.times):
        grid = block_grid(response.assembly, falling_increment(response, fall.pose(k)))
        # There is no equilibrium here: numbers of the static path would mislead.
        for name in ("settlement", "load_multiplier", "reaction"):
            grid.GetFieldData().RemoveArray(name)
        add_arrays(grid.GetFieldData(), {"time": np.array([time])})
        entries.append((float(time), f"fall/blocks_{k:05d}.vtu"))
        write_vtu(grid, folder / entries[-1][1], durable=False)
    write_pvd(folder / FALL_LIST, entries, last=False)
    write_atomic(folder / FALL_POSES, compressed(flat(fall)))


def remove_fall(folder: Path) -> None:
    """Remove what :func:`write_fall` has written, the list of files first."""
    for name in (FALL_LIST, FALL_POSES):
        (folder / name).unlink(missing_ok=True)
    for old in (folder / "fall").glob("blocks_*.vtu"):
        old.unlink()
    if (folder / "fall").is_dir() and not any((folder / "fall").iterdir()):
        (folder / "fall").rmdir()


def stored_fall(folder: Path) -> Fall | None:
    """Read the fall of a results folder; None where there is none.

    Raises
    ------
    ValueError
        If its file is damaged; names it.
    """
    file = folder / FALL_POSES
    if not file.is_file():
        return None
    try:
        fall = from_flat(checked_arrays(file), Fall)
        n, blocks, *turns = fall.rotations.shape
        shapes = (fall.times.shape, fall.positions.shape)
        if n == 0 or shapes != ((n,), (n, blocks, 3 if turns else 2)) or not np.isfinite(fall.positions).all():
            raise ValueError(f"positions have the shape {fall.positions.shape}, rotations {fall.rotations.shape}")
    except (ValueError, KeyError, TypeError) as error:
        raise ValueError(f"'{file}' cannot be read ({error}); remove it and draw again") from None
    return fall
