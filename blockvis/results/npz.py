"""Dataclasses as files: whatever fields they have, numbers and arrays bit for bit, nothing that could run when read."""

from __future__ import annotations

import dataclasses
import io
import json
import math
import zipfile
import zlib
from collections.abc import Collection, Mapping
from pathlib import Path
from types import UnionType
from typing import IO, Any, TypeVar, Union, get_args, get_origin, get_type_hints

import numpy as np

T = TypeVar("T")

#: An .npz file of a run never comes near this many bytes unpacked; a bomb does.
MOST_BYTES = 1 << 30

#: Entry of the archive that holds everything but the arrays.
_TREE = "tree"


def packed(value: Any, **extra: int | float | str) -> bytes:
    """Pack a dataclass into the bytes of an .npz file.

    Parameters
    ----------
    value : dataclass
        Its fields hold numbers, texts, None, arrays, other dataclasses, and tuples of these.
    **extra
        Numbers and texts that go with it; :func:`unpacked` gives them back.
    """
    arrays: dict[str, np.ndarray] = {}
    tree = {"value": _plain(value, arrays), "extra": extra}
    buffer = io.BytesIO()
    np.savez(buffer, **{_TREE: np.array(json.dumps(tree))}, **arrays)  # type: ignore[arg-type]
    return buffer.getvalue()


def unpacked(data: bytes, kind: type[T]) -> tuple[T, dict[str, Any]]:
    """Unpack the bytes that :func:`packed` made of a dataclass of the given kind, and the extra values.

    Raises
    ------
    ValueError
        If the bytes are no such file, or hold a value of other fields (another version wrote them).
    """
    try:
        arrays = checked_arrays(io.BytesIO(data))
        tree = json.loads(str(arrays.pop(_TREE)))
        return _built(tree["value"], kind, arrays), dict(tree["extra"])
    except (KeyError, TypeError, AttributeError, RecursionError) as error:
        raise ValueError(f"no stored {kind.__name__}: {error}") from None


def flat(value: Any, without: Collection[str] = ()) -> dict[str, np.ndarray]:
    """Make arrays of the fields of a dataclass, by their names, and of the fields of dataclasses in it.

    Parameters
    ----------
    value : dataclass
        Its fields hold numbers, texts, tuples of texts, arrays and other dataclasses; no two have one name.
    without : collection of str
        Fields to leave out.
    """
    arrays: dict[str, np.ndarray] = {}
    for field in dataclasses.fields(value):
        if field.name in without:
            continue
        one = getattr(value, field.name)
        if dataclasses.is_dataclass(one):
            arrays |= flat(one)
        else:
            arrays[field.name] = np.array(one, dtype=str) if isinstance(one, tuple | str) else np.asarray(one)
    return arrays


def from_flat(arrays: Mapping[str, np.ndarray], kind: type[T], **given: Any) -> T:
    """Make the dataclass of the given kind whose fields :func:`flat` made arrays of.

    Parameters
    ----------
    arrays : mapping from name to array
    kind : type
    **given
        Fields that were left out.

    Raises
    ------
    KeyError
        If an array is missing.
    """
    hints = get_type_hints(kind)
    fields = dict(given)
    for field in dataclasses.fields(kind):  # type: ignore[arg-type]
        if field.name in given:
            continue
        if field.name not in arrays and field.default_factory is not dataclasses.MISSING:
            # Arrays that came later: files of before have none.
            continue
        one = hints[field.name]
        if dataclasses.is_dataclass(one):
            fields[field.name] = from_flat(arrays, one)  # type: ignore[arg-type]
        elif one is np.ndarray:
            fields[field.name] = arrays[field.name]
        elif get_origin(one) is tuple:
            fields[field.name] = tuple(map(str, arrays[field.name]))
        else:
            fields[field.name] = one(arrays[field.name].item())
    return kind(**fields)


def compressed(arrays: Mapping[str, np.ndarray]) -> bytes:
    """Pack arrays into the bytes of an .npz file."""
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **arrays)  # type: ignore[arg-type]
    return buffer.getvalue()


def checked_arrays(source: str | Path | io.BytesIO) -> dict[str, np.ndarray]:
    """Read all arrays of an .npz file; refuse one with anything in it that could run.

    Raises
    ------
    ValueError
        If it is no such file, or announces more than :data:`MOST_BYTES`.
    """
    try:
        with zipfile.ZipFile(source) as archive:
            size = sum(entry.file_size for entry in archive.infolist())
            if size > MOST_BYTES:
                raise ValueError(f"it unpacks to {size} bytes")
            for name in archive.namelist():
                with archive.open(name) as entry:
                    version = np.lib.format.read_magic(entry)
                    reader = np.lib.format.read_array_header_1_0 if version == (1, 0) else _header_2
                    shape, _, kind = reader(entry)
                    if math.prod(shape) * kind.itemsize > MOST_BYTES:
                        raise ValueError(f"it announces an array of shape {shape}")
        if isinstance(source, io.BytesIO):
            source.seek(0)
        with np.load(source, allow_pickle=False) as stored:
            return {name: stored[name] for name in stored.files}
    except (KeyError, TypeError, AttributeError, EOFError, SyntaxError, RuntimeError, NotImplementedError) as error:
        raise ValueError(f"it is not what a run wrote: {error}") from None
    except (zipfile.BadZipFile, zlib.error, OverflowError, MemoryError) as error:
        raise ValueError(f"it is damaged: {error}") from None


def _header_2(entry: IO[bytes]) -> tuple[tuple[int, ...], bool, np.dtype]:
    return np.lib.format.read_array_header_2_0(entry)


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
    if get_origin(kind) in (Union, UnionType):
        if stored is None:
            return None
        kind = next(part for part in get_args(kind) if part is not type(None))
    if dataclasses.is_dataclass(kind):
        hints = get_type_hints(kind)
        names = [field.name for field in dataclasses.fields(kind)]
        if sorted(stored) != sorted(names):
            raise TypeError(f"it has the fields {sorted(stored)}, not {sorted(names)}")
        return kind(**{name: _built(stored[name], hints[name], arrays) for name in names})  # type: ignore[operator]
    if kind is np.ndarray:
        return arrays[stored]
    if get_origin(kind) is tuple:
        kinds = get_args(kind)
        each = [kinds[0]] * len(stored) if len(kinds) == 2 and kinds[1] is Ellipsis else kinds
        return tuple(_built(item, one, arrays) for item, one in zip(stored, each, strict=True))
    return kind(stored)
