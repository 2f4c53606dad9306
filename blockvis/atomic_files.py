"""Files written whole or not at all: whatever ends the process or the machine, nobody finds half of one."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

#: Pattern of the names under which files are written before they are put in their place; what a process that was
#: killed has left of it may be removed.
PARTIAL = ".*.part*"


@contextmanager
def whole_file(path: str | os.PathLike[str], *, last: bool = True) -> Iterator[Path]:
    """A name to write a file under, which is put in its place when the block ends; taken away if it fails.

    Parameters
    ----------
    path : path
        Its folder is made where it does not exist. A link stays one; what is no file (a pipe) is written to directly.
    last : bool
        Whether no other file follows at once. If one does, the list of names of the folder is flushed with that.

    Yields
    ------
    pathlib.Path
        Beside it, so that replacing stays on one file system, with the same suffix.

    Notes
    -----
    The file is flushed to the disk before it takes the place of the one before, and its folder after: when the machine
    goes down, files are there in the order in which they were written, whole.
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
        flush(partial)
        os.replace(partial, path)
    except BaseException:
        partial.unlink(missing_ok=True)
        raise
    if last:
        flush(path.parent)


def write_whole(path: str | os.PathLike[str], content: str | bytes, *, last: bool = True) -> Path:
    """Writes a text, in UTF-8, or bytes, whole or not at all; see :func:`whole_file`.

    Parameters
    ----------
    path : path
    content : str or bytes
    last : bool

    Returns
    -------
    pathlib.Path
    """
    with whole_file(path, last=last) as partial:
        partial.write_bytes(content.encode() if isinstance(content, str) else content)
    return Path(path)


def make_folder(path: Path) -> None:
    """Makes a folder and those above it, where they do not exist, to stay when the machine goes down.

    Parameters
    ----------
    path : Path
    """
    missing = [folder for folder in (path, *path.parents) if not folder.exists()]
    path.mkdir(parents=True, exist_ok=True)
    for folder in missing:
        flush(folder.parent)


def flush(path: Path) -> None:
    """Has the system bring a file, or the list of names of a folder, to the disk.

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
