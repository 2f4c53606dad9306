"""The files that a layout is read from: one file, or a folder or a pattern of one file per stone."""

from __future__ import annotations

import glob
import hashlib
import re
from pathlib import Path

from blockvis.text import files_like

from . import FORMATS

#: More files than this are taken for the wrong folder.
MOST_FILES = 20_000


class MissingFile(FileNotFoundError, ValueError):
    """There is no file of that name."""


def files_of(path: Path) -> list[Path]:
    """List the files that a name stands for: itself, those of a folder, or those that fit a pattern.

    Numbers in names are in the order of counting: stone 2 before stone 10.
    """
    if path.is_dir():
        found = [entry for entry in path.iterdir() if entry.is_file() and _readable(entry)]
        if not found:
            raise ValueError(f"'{path}' is a folder without a layout file; give a file, or a folder of one per stone")
    elif path.exists():
        return [path]
    elif not glob.has_magic(str(path)):
        near = files_like(path)
        hint = f"; did you mean {' or '.join(near)}?" if near else "; check the path"
        raise MissingFile(f"there is no file '{path}'{hint}")
    else:
        found = [Path(name) for name in glob.glob(str(path), recursive=True) if Path(name).is_file()]
        if not found:
            raise MissingFile(f"no file fits '{path}'; check the folder and the pattern")
    return _of_one_format(found, path)


def _of_one_format(found: list[Path], path: Path) -> list[Path]:
    """Order the files that a name stands for; refuse those of several formats, and too many."""
    suffixes = sorted({entry.suffix.lower() for entry in found})
    if len(suffixes) > 1:
        if (path / "summary.json").is_file():
            raise ValueError(f"'{path}' is a folder of results; give '{path / 'blocks.pvd'}', or one of its .vtu")
        counts = ", ".join(f"{sum(e.suffix.lower() == suffix for e in found)} {suffix}" for suffix in suffixes[:8])
        example = (path if path.is_dir() else path.parent) / f"*{suffixes[0]}"
        raise ValueError(f"'{path}' holds files of several formats ({counts}); choose one of them: '{example}'")
    if len(found) > MOST_FILES:
        raise ValueError(f"'{path}' stands for {len(found)} files, more than {MOST_FILES}; give one file per stone")
    return sorted(found, key=_counting)


def checksum_of_files(path: Path) -> str:
    """SHA-256 of the file that a name stands for; of several, of their names and their checksums."""
    files = files_of(path)
    sums = []
    for file in files:
        with file.open("rb") as stream:
            sums.append(hashlib.file_digest(stream, "sha256").hexdigest())
    if len(files) == 1 and files[0] == path:
        return sums[0]
    lines = [f"{name.name} {one}\n" for name, one in zip(files, sums, strict=True)]
    return hashlib.sha256("".join(lines).encode()).hexdigest()


def _readable(file: Path) -> bool:
    known = FORMATS.get(file.suffix.lower())
    return known is not None and not known.alone and not file.name.startswith(".")


def _counting(file: Path) -> list[tuple[int, int, str]]:
    return [(0, int(part), "") if part.isdecimal() else (1, 0, part) for part in re.split(r"(\d+)", str(file))]
