"""Atomic file writes: a file appears complete under its name, or not at all, whatever ends the process."""

from __future__ import annotations

import errno
import os
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

#: Pattern of the temporary names under which files are written; those of a process that was killed may be removed.
PARTIAL = ".*.part*"

#: Windows flushes only what is open for writing, and moves nothing to a name that another program has open.
WINDOWS = os.name == "nt"

#: Seconds between attempts to move a file into its place on Windows: scanners for viruses open new files for a moment.
ATTEMPTS = (0.02, 0.05, 0.1, 0.2, 0.5)

#: What file systems answer that cannot flush a folder, such as those of a network.
CANNOT_FLUSH = (errno.EINVAL, errno.ENOTSUP, errno.EBADF, errno.ENOTTY)


@contextmanager
def atomic_file(path: str | os.PathLike[str], *, last: bool = True, durable: bool = True) -> Iterator[Path]:
    """Yield a temporary name to write a file under; move the file to its place at the end, or remove it on failure.

    Parameters
    ----------
    path : path
        For what is durable its folder is made if it does not exist. A link stays a link; a pipe or device is written
        to directly.
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
    if not path.name:
        raise ValueError(f"'{path}' names no file; give the name of the file that is to be written")
    if path.exists() and not path.is_file() and not path.is_dir():
        yield path
        return
    path = path.resolve() if path.is_symlink() else path
    if durable:
        make_folder(path.parent)
    partial = partial_of(path)
    try:
        yield partial
        if durable:
            flush(partial)
        _move(partial, path)
    except BaseException as error:
        if isinstance(error, OSError) and error.filename == str(partial):
            error.filename = str(path)
        remove(partial)
        raise
    if last and durable:
        flush(path.parent)


def write_atomic(
    path: str | os.PathLike[str], content: str | bytes, *, last: bool = True, durable: bool = True
) -> Path:
    """Write a text in UTF-8, or bytes, whole or not at all; see :func:`atomic_file`.

    What UTF-8 cannot hold, such as parts of a path in another encoding, is written with backslashes, as JSON reads it.
    """
    with atomic_file(path, last=last, durable=durable) as partial:
        partial.write_bytes(content.encode(errors="backslashreplace") if isinstance(content, str) else content)
    return Path(path)


def partial_of(path: Path) -> Path:
    """Name under which a file is written before it is whole."""
    return path.with_name(f".{path.stem}.part{path.suffix}")


def remove(partial: Path) -> None:
    """Remove a half-written file if it is there; one that another program has open on Windows stays."""
    try:
        partial.unlink(missing_ok=True)
    except PermissionError:
        if not WINDOWS:
            raise


def _move(partial: Path, path: Path) -> None:
    """Put a file in its place; on Windows wait a moment for a program that has one of the two open."""
    for wait in ATTEMPTS if WINDOWS else ():
        try:
            os.replace(partial, path)
            return
        except PermissionError:
            time.sleep(wait)
    try:
        os.replace(partial, path)
    except PermissionError as error:
        if not WINDOWS:
            raise
        raise PermissionError(
            error.errno, "another program has the file open, or it may not be replaced; close it there", str(path)
        ) from None


def make_folder(path: Path) -> None:
    """Make a folder and its missing parents, and flush them to the disk."""
    missing = [folder for folder in (path, *path.parents) if not folder.exists()]
    path.mkdir(parents=True, exist_ok=True)
    for folder in missing:
        flush(folder.parent)


def flush(path: Path) -> None:
    """Flush a file, or the list of names of a folder, to the disk."""
    folder = path.is_dir()
    if folder and WINDOWS:
        # Windows opens no folder, and keeps its list of names in a journal.
        return
    try:
        handle = os.open(path, os.O_RDWR if WINDOWS else os.O_RDONLY)
    except PermissionError:
        return
    try:
        _synchronise(handle)
    except OSError as error:
        if not (folder and error.errno in CANNOT_FLUSH):
            raise
    finally:
        os.close(handle)


def _synchronise(handle: int) -> None:
    """Flush to the disk itself: fsync of macOS leaves what is in the disk's own memory."""
    if sys.platform == "darwin":
        import fcntl

        try:
            fcntl.fcntl(handle, fcntl.F_FULLFSYNC)
            return
        except OSError as error:
            if error.errno not in CANNOT_FLUSH:
                raise
    os.fsync(handle)
