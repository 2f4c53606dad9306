"""Increments in the files of a results folder: their numbers at hand, their arrays read when they are asked for.

A run or a folder that is reopened keeps a few numbers of each increment in memory. What grows with the blocks is read
from the increment's file and forgotten again, so that memory does not grow with the number of increments.
"""

from __future__ import annotations

import dataclasses
import io
import math
from collections import OrderedDict
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

import solver

from .npz import checked_arrays

#: Bytes of arrays that are kept of the increments read last, and how many of them are kept whatever their size: frames
#: of a film lie between two.
CACHED, AT_LEAST = 8 << 20, 2

_CONTACT_ARRAYS = ("block_a", "block_b", "points", "frames", "gaps", "areas")
_ARRAYS = ("forces", "displacements", "friction", "velocity", "support_forces")
_NUMBERS = ("settlement", "phase", "load_multiplier", "reaction", "programs", "seconds")
_CERTIFICATE = (
    "equilibrium_residual",
    "largest_penetration",
    "duality_gap",
    "complementarity",
    "kinematic_violation",
)

#: What is kept of an increment, and what is read.
_KEPT = (*_NUMBERS, "certificate", "status", "notes")
_READ = ("pose", "contacts", *_ARRAYS)


class StoredIncrement(solver.Increment):
    """An increment in a file: an :class:`solver.Increment` whose arrays are read whenever they are asked for.

    :func:`dataclasses.replace` gives one that is in memory.
    """

    def __getattr__(self, name: str) -> Any:
        if name in _READ and "_files" in self.__dict__:
            return getattr(self.__dict__["_files"].read(self.__dict__["_number"], self), name)
        raise AttributeError(f"an increment has no {name}")

    @property
    def folder(self) -> Path | None:
        """The results folder whose files are read; None of an increment that is in memory."""
        files = self.__dict__.get("_files")
        return None if files is None else files.folder


class StoredLimit(solver.LimitLoad):
    """A limit load whose arrays are those of the increment that tells it."""

    def __getattr__(self, name: str) -> Any:
        if name in ("contacts", "forces", "pose", "friction", "mechanism") and "_state" in self.__dict__:
            return getattr(self.__dict__["_state"], "velocity" if name == "mechanism" else name)
        raise AttributeError(f"a limit load has no {name}")

    @classmethod
    def of(cls, state: solver.Increment, **numbers: Any) -> StoredLimit:
        """The limit load of a state.

        Parameters
        ----------
        state : solver.Increment
        **numbers
            The fields that the state does not tell: multiplier, bounds, status, flow, live_force, programs.
        """
        limit = object.__new__(cls)
        limit.__dict__.update(numbers, certificate=state.certificate, _state=state)
        return limit


class StoredIncrements:
    """The files of the increments of one results folder; the few read last are kept.

    Parameters
    ----------
    folder : Path
        The results folder.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._last: OrderedDict[int, solver.Increment] = OrderedDict()
        self._bytes = 0

    def file(self, number: int) -> Path:
        """The file of an increment."""
        return self.folder / "increments" / f"state_{number:05d}.npz"

    def __len__(self) -> int:
        return len(list((self.folder / "increments").glob("state_*.npz")))

    def told(self, number: int, increment: solver.Increment) -> StoredIncrement:
        """An increment that has been written, without its arrays.

        Parameters
        ----------
        number : int
        increment : solver.Increment
        """
        told = object.__new__(StoredIncrement)
        told.__dict__.update({name: getattr(increment, name) for name in _KEPT}, _files=self, _number=number)
        return told

    def opened(self, number: int) -> StoredIncrement:
        """An increment of which nothing is known yet; its file is read once, whole, so that what is damaged is found.

        Raises
        ------
        ValueError
            If the file is missing or damaged; names it.
        """
        return self.told(number, self._read(number))

    def read(self, number: int, told: solver.Increment | None = None) -> solver.Increment:
        """The increment with its arrays, from its file or from memory.

        Parameters
        ----------
        number : int
        told : solver.Increment, optional
            What is known of it.

        Raises
        ------
        ValueError
            If the file is missing, damaged, or no longer that of the increment told; names it.
        """
        if number in self._last:
            self._last.move_to_end(number)
        else:
            found = self._read(number)
            self._last[number] = found
            self._bytes += _bytes_of(found)
            while len(self._last) > AT_LEAST and self._bytes > CACHED:
                self._bytes -= _bytes_of(self._last.popitem(last=False)[1])
        found = self._last[number]
        if told is not None and not all(_same(getattr(found, name), getattr(told, name)) for name in _NUMBERS):
            raise ValueError(f"'{self.file(number)}' is not what it was when it was opened; open the results again")
        return found

    def _read(self, number: int) -> solver.Increment:
        try:
            arrays = checked_arrays(self.file(number))
            n, k = len(arrays["rotations"]), len(arrays["gaps"])
            for name, shape in (("positions", (n, 2)), ("velocity", (n, 3)), ("points", (k, 2)), ("forces", (k, 2))):
                if arrays[name].shape != shape:
                    raise ValueError(f"{name} has shape {arrays[name].shape}, not {shape}")
            return _increment_of(arrays)
        except (ValueError, KeyError, TypeError, IndexError, FileNotFoundError) as error:
            raise ValueError(f"'{self.file(number)}' cannot be read ({error}); run the case again") from None


def packed_increment(increment: solver.Increment) -> bytes:
    """An increment as the bytes of its file."""
    arrays: dict[str, Any] = {name: getattr(increment.contacts, name) for name in _CONTACT_ARRAYS}
    arrays.update({name: getattr(increment, name) for name in (*_ARRAYS, *_NUMBERS)})
    arrays.update({name: getattr(increment.certificate, name) for name in _CERTIFICATE})
    vertex, edge, corner = solver.corners_and_edges(increment.contacts.features)
    arrays.update(vertex=vertex, edge=edge, corner=corner, along=increment.contacts.slip[:, 0])
    positions, rotations = increment.pose.positions, increment.pose.rotations[:, 0]
    arrays.update(positions=positions, rotations=rotations, status=np.array(str(increment.status)))
    arrays["notes"] = np.array(increment.notes, dtype=str)
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **arrays)
    return buffer.getvalue()


def _increment_of(arrays: Mapping[str, np.ndarray]) -> solver.Increment:
    features = solver.features_of(arrays["vertex"], arrays["edge"], arrays["corner"])
    contacts = {name: arrays[name] for name in _CONTACT_ARRAYS}
    fields: dict[str, Any] = {name: arrays[name] for name in _ARRAYS}
    fields.update({name: arrays[name].item() for name in _NUMBERS})
    return solver.Increment(
        pose=solver.Pose(arrays["positions"], arrays["rotations"][:, None]),
        contacts=solver.Contacts(features=features, slip=arrays["along"][:, None], **contacts),
        certificate=solver.Certificate(**{name: arrays[name].item() for name in _CERTIFICATE}),
        status=solver.Status(str(arrays["status"])),
        notes=tuple(map(str, arrays.get("notes", ()))),
        **fields,
    )


def _same(one: float, other: float) -> bool:
    return one == other or (math.isnan(one) and math.isnan(other))


def _bytes_of(increment: solver.Increment) -> int:
    parts = (increment, increment.pose, increment.contacts)
    values = [getattr(part, field.name) for part in parts for field in dataclasses.fields(part)]
    return sum(value.nbytes for value in values if isinstance(value, np.ndarray))
