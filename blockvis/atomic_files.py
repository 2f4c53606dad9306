"""Atomic file writes: a file appears complete under its name, or not at all, whatever ends the process."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

#: Pattern of the temporary names under which files are written; those of a process that was killed may be removed.
PARTIAL = ".*.part*"


@contextmanager
def whole_file(path: str | os.PathLike[str], *, last: bool = True, durable: bool = True) -> Iterator[Path]:
    """Yield a temporary name to write a file under; move the file to its place at the end, or remove it on failure.

    Parameters
    ----------
    path : path
        Its folder is made if it does not exist. A link stays a link; a pipe or device is written to directly.
    last : bool
        Whether this is the last of several files written together: only then the folder's list of names is flushed.
    durable : bool
        False for what can be made again from other files: it is whole, too, but nothing waits for the disk.

    Yields
    ------
    pathlib.Path
        In the folder of ``path``, so that the move stays on one file system, with the same suffix.

    Notes
    -----
    The file is flushed to the disk before it replaces an older one, and its folder after: if the machine goes down,
    the files on the disk are complete and were written in this order.
    """
    path = Path(path)
    if path.exists() and not path.is_file() and not path.is_dir():
        yield path
        return
    path = path.resolve() if path.is_symlink() else path
    make_folder(path.parent)
    partial = path.with_name(f".{path.stem}.part{path.suffix}")
    try:
        yield partial
        if durable:
            flush(partial)
        os.replace(partial, path)
    except BaseException:
        partial.unlink(missing_ok=True)
        raise
    if last and durable:
        flush(path.parent)


def write_whole(path: str | os.PathLike[str], content: str | bytes, *, last: bool = True, durable: bool = True) -> Path:
    """Write a text in UTF-8, or bytes, whole or not at all; see :func:`whole_file`.

    Parameters
    ----------
    path : path
    content : str or bytes
    last, durable : bool

    Returns
    -------
    pathlib.Path
    """
    with whole_file(path, last=last, durable=durable) as partial:
        partial.write_bytes(content.encode() if isinstance(content, str) else content)
    return Path(path)


def make_folder(path: Path) -> None:
    """Make a folder and its missing parents, and flush them to the disk.

    Parameters
    ----------
    path : Path
    """
    missing = [folder for folder in (path, *path.parents) if not folder.exists()]
    path.mkdir(parents=True, exist_ok=True)
    for folder in missing:
        flush(folder.parent)


def flush(path: Path) -> None:
    """Flush a file, or the list of names of a folder, to the disk.

    Parameters
    ----------
    path : Path
    """
    try:
        handle = os.open(path, os.O_RDONLY)
    except PermissionError:
        # Windows opens no folder.
        return
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
