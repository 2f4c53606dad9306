"""Dataclasses as files: whatever fields they have, numbers and arrays bit for bit, nothing that could run when read."""

from __future__ import annotations

import dataclasses
import io
import json
import zipfile
import zlib
from collections.abc import Mapping
from pathlib import Path
from types import UnionType
from typing import Any, TypeVar, Union, get_args, get_origin, get_type_hints

import numpy as np

T = TypeVar("T")

#: An .npz file of a run never comes near this many bytes unpacked; a bomb does.
MOST_BYTES = 1 << 30

#: Entry of the archive that holds everything but the arrays.
_TREE = "tree"


def packed(value: Any, *, compressed: bool = True, **extra: int | float | str) -> bytes:
    """Pack a dataclass, small or fast, into the bytes of an .npz file.

    Its fields hold numbers, texts, None, arrays, other dataclasses, and tuples of these. Extra numbers and texts go
    with it: :func:`unpacked` gives them back.
    """
    arrays: dict[str, np.ndarray] = {}
    tree = {"value": _plain(value, arrays), "extra": extra}
    buffer = io.BytesIO()
    save = np.savez_compressed if compressed else np.savez
    save(buffer, **{_TREE: np.array(json.dumps(tree))}, **arrays)  # type: ignore[arg-type]
    return buffer.getvalue()


def unpacked(data: bytes, kind: type[T]) -> tuple[T, dict[str, Any]]:
    """Unpack the bytes that :func:`packed` made of a dataclass of the given kind, and the extra values.

    Raises ``ValueError`` where they are no such file, or hold a value of other fields (another version wrote them).
    """
    try:
        arrays = _checked_arrays(data)
        tree = json.loads(str(arrays.pop(_TREE)))
        return _built(tree["value"], kind, arrays), dict(tree["extra"])
    except (KeyError, TypeError, AttributeError, RecursionError) as error:
        raise ValueError(f"no stored {kind.__name__}: {error}") from None


def read_stored(file: Path, kind: type[T]) -> T:
    """Read a dataclass of the given kind from its file; raises ``ValueError`` for one that no run has written."""
    try:
        return unpacked(file.read_bytes(), kind)[0]
    except ValueError as error:
        raise ValueError(f"'{file}' cannot be read ({error}); run the case again") from None


def size_of(value: Any) -> int:
    """Count the bytes of the arrays in a dataclass."""
    arrays: dict[str, np.ndarray] = {}
    _plain(value, arrays)
    return sum(array.nbytes for array in arrays.values())


def _checked_arrays(data: bytes) -> dict[str, np.ndarray]:
    """Read all arrays of an .npz file; refuse what could run, and more than :data:`MOST_BYTES`."""
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            size = sum(entry.file_size for entry in archive.infolist())
            if size > MOST_BYTES:
                raise ValueError(f"it unpacks to {size} bytes")
        with np.load(io.BytesIO(data), allow_pickle=False) as stored:
            return {name: stored[name] for name in stored.files}
    except (KeyError, TypeError, AttributeError, EOFError, SyntaxError, RuntimeError, NotImplementedError) as error:
        raise ValueError(f"it is not what a run wrote: {error}") from None
    except (zipfile.BadZipFile, zlib.error, OverflowError, MemoryError) as error:
        raise ValueError(f"it is damaged: {error}") from None


def _plain(value: Any, arrays: dict[str, np.ndarray]) -> Any:
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {field.name: _plain(getattr(value, field.name), arrays) for field in dataclasses.fields(value)}
    if isinstance(value, np.ndarray):
        name = f"array_{len(arrays)}"
        arrays[name] = value
        return name
    if isinstance(value, tuple):
        return [_plain(item, arrays) for item in value]
    if isinstance(value, np.generic):
        value = value.item()
    if value is None or isinstance(value, bool | int | float | str):
        # JSON as Python writes it keeps every double, infinities included.
        return value
    raise TypeError(f"a {type(value).__name__} cannot be stored; fields are numbers, texts, arrays and dataclasses")


def _built(stored: Any, kind: Any, arrays: Mapping[str, np.ndarray]) -> Any:
    """Build the value of the annotated kind; raises TypeError where the kind does not fit what is stored."""
    if kind is Any:
        return stored
    if get_origin(kind) in (Union, UnionType):
        if stored is None:
            return None
        parts = [part for part in get_args(kind) if part is not type(None)]
        kind = next((part for part in parts if _names(part) and _names(part) == sorted(stored)), parts[0])
    if dataclasses.is_dataclass(kind):
        hints, names = get_type_hints(kind), _names(kind)
        if sorted(stored) != names:
            raise TypeError(f"it has the fields {sorted(stored)}, not {names}")
        return kind(**{name: _built(stored[name], hints[name], arrays) for name in names})  # type: ignore[operator]
    if kind is np.ndarray:
        return arrays[stored]
    if get_origin(kind) is tuple:
        kinds = get_args(kind)
        each = [kinds[0]] * len(stored) if len(kinds) == 2 and kinds[1] is Ellipsis else kinds
        return tuple(_built(item, one, arrays) for item, one in zip(stored, each, strict=True))
    return kind(stored)


def _names(kind: Any) -> list[str]:
    """List the fields of a kind of dataclass; none of others."""
    return sorted(field.name for field in dataclasses.fields(kind)) if dataclasses.is_dataclass(kind) else []
