"""Increments in the files of a results folder: their numbers at hand, their arrays read when they are asked for.

A run or a folder that is reopened keeps a few numbers of each increment in memory. What grows with the blocks is read
from the increment's file and forgotten again, so that memory does not grow with the number of increments.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path

import numpy as np

import solver
from solver import mechanics

from .npz import packed, size_of, unpacked

#: Bytes of arrays that are kept of the increments read last, and how many of them are kept whatever their size: frames
#: of a film lie between two.
CACHED, AT_LEAST = 8 << 20, 2


@dataclass(frozen=True)
class StateInFile:
    """The state of an increment in a file, read whenever it is asked for."""

    files: StoredIncrements
    number: int  #: Of the increment.
    numbers: tuple[float, ...]  #: Of the increment, by which a file that was replaced is noticed.

    def read(self) -> mechanics.State:
        """Read the state; raises ``ValueError`` where the file is missing, damaged or of another increment."""
        found = self.files.read(self.number)
        if not np.array_equal(_numbers(found), self.numbers, equal_nan=True):
            file = self.files.file(self.number)
            raise ValueError(f"'{file}' is not what it was when it was opened; open the results again")
        return found.state


class StoredIncrements:
    """The files of the increments of one results folder; the few read last are kept in memory."""

    def __init__(self, folder: Path) -> None:
        # What is read later is read from there, wherever the process stands then.
        self.folder = folder.absolute()
        self._last: OrderedDict[int, solver.Increment] = OrderedDict()
        self._bytes = 0

    def file(self, number: int) -> Path:
        """Path of the file of an increment."""
        return self.folder / "increments" / f"state_{number:05d}.npz"

    def __len__(self) -> int:
        """Count the files."""
        return len(list((self.folder / "increments").glob("state_*.npz")))

    def without_arrays(self, number: int, increment: solver.Increment) -> solver.Increment:
        """Drop the arrays of an increment that has been written: they are in its file, or among those kept last."""
        self._keep(number, replace(increment, checkpoint=None))
        return replace(increment, held=StateInFile(self, number, _numbers(increment)), checkpoint=None)

    def opened(self, number: int) -> solver.Increment:
        """Open an increment; its file is read once, whole: raises ``ValueError`` where it is missing or damaged."""
        return self.without_arrays(number, self._read(number))

    def read(self, number: int) -> solver.Increment:
        """Read an increment with its arrays, from its file, as :meth:`opened` does, or from memory."""
        if number in self._last:
            self._last.move_to_end(number)
        else:
            self._keep(number, self._read(number))
        return self._last[number]

    def _keep(self, number: int, increment: solver.Increment) -> None:
        """Keep an increment with its arrays, and forget those used longest ago."""
        if number in self._last:
            self._bytes -= size_of(self._last.pop(number).state)
        self._last[number] = increment
        self._bytes += size_of(increment.state)
        while len(self._last) > AT_LEAST and self._bytes > CACHED:
            self._bytes -= size_of(self._last.popitem(last=False)[1].state)

    def _read(self, number: int) -> solver.Increment:
        try:
            found, _ = unpacked(self.file(number).read_bytes(), solver.Increment)
            state = found.state
            (n, d), k = state.pose.positions.shape, len(state.contacts)
            shapes = (
                ("rotations", state.pose.rotations, (n, 2 * d - 3)),
                ("velocity", state.velocity, (n, 3 * d - 3)),
                ("points", state.contacts.points, (k, d)),
                ("forces", state.forces, (k, d)),
            )
            for name, array, shape in shapes:
                if array.shape != shape:
                    raise ValueError(f"{name} has shape {array.shape}, not {shape}")
            return found
        except (ValueError, FileNotFoundError) as error:
            raise ValueError(f"'{self.file(number)}' cannot be read ({error}); run the case again") from None


def folder_of(increment: solver.Increment) -> Path | None:
    """Find the results folder whose files hold the arrays of an increment; None where they are in memory."""
    return increment.held.files.folder if isinstance(increment.held, StateInFile) else None


def packed_increment(increment: solver.Increment) -> bytes:
    """Pack an increment with its arrays into the bytes of its file."""
    return packed(replace(increment, held=increment.state, checkpoint=None))


def numbered(increments: Sequence[solver.Increment], k: int) -> solver.Increment:
    """Choose an increment by its number, below 0 from the end; raises ``ValueError`` where there is none."""
    n = len(increments)
    if not isinstance(k, (int, np.integer)):
        raise TypeError(f"the increment is {k!r}; give its number, 0 to {n - 1}, or -1 for the last")
    if not -n <= k < n:
        raise ValueError(f"there is no increment {k}; the response has {n}, 0 to {n - 1}, or -1 for the last")
    return increments[k]


def _numbers(increment: solver.Increment) -> tuple[float, ...]:
    values = (getattr(increment, field.name) for field in fields(increment))
    return tuple(value for value in values if isinstance(value, int | float))
