"""The fall in the results folder: VTU files with the time as their parameter, and its poses for whoever draws again."""

from __future__ import annotations

import weakref
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

import solver
from blockvis.dynamics.fall import Fall, fall_of, falling_increment
from blockvis.system.atomic_files import make_folder, write_atomic

from .increments import folder_of
from .mechanism_arrays import falling_in
from .npz import packed, unpacked
from .viewer_files import MOVED, ViewerFormat

if TYPE_CHECKING:
    from vtkmodules.vtkCommonDataModel import vtkUnstructuredGrid

#: Lists of the VTU files of blocks and of ties, and the poses.
FALL_LIST, TIE_LIST, FALL_POSES = "fall.pvd", "fall_ties.pvd", "fall.npz"

#: Falls by the id of their response, as long as it lives: to work one out takes seconds.
_known: dict[int, Fall | None] = {}


def write_fall(fall: Fall, response: solver.Response, folder: Path, vtu: ViewerFormat = MOVED) -> None:
    """Write the VTU files of the fall of a response, the list of them, and its poses."""
    from blockvis.system.vtk_files import write_pvd, write_vtu

    make_folder(folder / "fall")
    falls, times = falling_in(response), fall.times.tolist()
    for listed, kind in ((FALL_LIST, "blocks"), *(((TIE_LIST, "ties"),) if response.ties else ())):
        files = [f"fall/{kind}_{k:05d}.vtu" for k in range(len(times))]
        for time, file in zip(times, files, strict=True):
            grid = fall_grid(response, fall, time, vtu.shape, falls if kind == "blocks" else None)
            write_vtu(grid, folder / file, strings=vtu.strings, durable=False)
        write_pvd(folder / listed, list(zip(times, files, strict=True)), last=False)
    write_atomic(folder / FALL_POSES, packed(fall))


def fall_grid(
    response: solver.Response, fall: Fall, time: float, shape: str, falls: np.ndarray | None
) -> vtkUnstructuredGrid:
    """Make a grid of the blocks, of which ``falls`` (n_blocks,) are taken, at a time [s]; without it of the ties."""
    from .datasets import add_arrays, block_grid, state_units, tie_grid

    state = falling_increment(response, fall, time)
    if falls is None:
        grid = tie_grid(response.ties, response.assembly, state, shape=shape)
    else:
        grid = block_grid(response.assembly, state, shape=shape, falls=falls)
    # There is no equilibrium here: numbers of the static path would mislead.
    for name in ("settlement", "load_multiplier", "reaction"):
        grid.GetFieldData().RemoveArray(name)
    add_arrays(grid.GetFieldData(), {"time": np.array([time])})
    state_units(grid, {})
    return grid


def known_fall(response: solver.Response) -> Fall | None:
    """Read the fall of a response from its folder, or work it out, once; None where nothing falls."""
    key = id(response)
    if key not in _known:
        folder = folder_of(response.path[-1]) if response.path else None
        found = None if folder is None else stored_fall(folder)
        _known[key] = fall_of(response) if found is None else found
        weakref.finalize(response, _known.pop, key, None)
    return _known[key]


def remove_fall(folder: Path) -> None:
    """Remove what :func:`write_fall` has written, the list of files first."""
    for name in (FALL_LIST, TIE_LIST, FALL_POSES):
        (folder / name).unlink(missing_ok=True)
    for old in (folder / "fall").glob("*_*.vtu"):
        old.unlink()
    if (folder / "fall").is_dir() and not any((folder / "fall").iterdir()):
        (folder / "fall").rmdir()


def stored_fall(folder: Path) -> Fall | None:
    """Read the fall of a results folder, None where there is none; raises ``ValueError`` where its file is damaged."""
    file = folder / FALL_POSES
    if not file.is_file():
        return None
    try:
        fall, _ = unpacked(file.read_bytes(), Fall)
        n, blocks, n_rot = fall.rotations.shape
        shapes = (fall.times.shape, fall.positions.shape)
        if n == 0 or shapes != ((n,), (n, blocks, 2 if n_rot == 1 else 3)) or not np.isfinite(fall.positions).all():
            raise ValueError(f"positions have the shape {fall.positions.shape}, rotations {fall.rotations.shape}")
        if fall.tie_forces.shape != fall.tie_rest.shape or len(fall.tie_rest) not in (0, n):
            raise ValueError(
                f"forces of ties have the shape {fall.tie_forces.shape}, their lengths {fall.tie_rest.shape}"
            )
    except ValueError as error:
        raise ValueError(f"'{file}' cannot be read ({error}); remove it and draw again") from None
    return fall
