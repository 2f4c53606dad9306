"""Laws, loads and changes of a run in its results folder, where no case file tells them."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, replace
from pathlib import Path

import solver
from blockvis.system.atomic_files import write_atomic

from .npz import packed, read_stored

#: File of them, of a run whose case was made or changed in Python.
GIVEN = "laws_and_loads.npz"


@dataclass(frozen=True)
class _Given:
    """Laws, loads and changes as they are stored; the factors of a scatter are a function, which no file holds."""

    default: solver.InterfaceLaw
    pairs: tuple[tuple[str, str, solver.InterfaceLaw], ...]
    ground: tuple[tuple[str, float], ...]
    scatters: bool
    loads: solver.Loads
    changes: tuple[solver.PhaseChange, ...]


def write_given(folder: Path, response: solver.Response) -> None:
    """Write the laws, loads and changes of a response."""
    laws = response.interfaces
    pairs = tuple((first, second, law) for (first, second), law in laws.pairs.items())
    ground, scatters = tuple(laws.ground.items()), laws.scatter is not None
    given = _Given(laws.default, pairs, ground, scatters, response.loads, response.changes)
    write_atomic(folder / GIVEN, packed(given))


def with_given(folder: Path, response: solver.Response) -> solver.Response:
    """Give a response the laws, loads and changes of its folder, with a warning of what is not there.

    Raises ``ValueError`` for a file that no run has written.
    """
    file = folder / GIVEN
    if not file.is_file():
        missing = "laws, loads and changes; friction 0.6 and self-weight are taken for them"
        warnings.warn(f"'{folder}' was written from Python and does not hold its {missing}", stacklevel=3)
        return response
    given = read_stored(file, _Given)
    if given.scatters:
        missing = "scatter of friction from joint to joint; the friction of its laws is taken for all joints"
        warnings.warn(f"'{folder}' was written from Python and does not hold the {missing}", stacklevel=3)
    pairs = {(first, second): law for first, second, law in given.pairs}
    interfaces = solver.Interfaces(given.default, pairs, ground=dict(given.ground))
    return replace(response, interfaces=interfaces, loads=given.loads, changes=given.changes)
