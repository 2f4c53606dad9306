"""Record: what a run was made from, kept in its results folder from the start, which is then enough to go on."""

from __future__ import annotations

import hashlib
import json
import platform
from collections.abc import Callable
from dataclasses import dataclass, field
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from blockvis.system.atomic_files import write_atomic

#: Name of the file in the results folder.
RECORD = "run.json"

#: Packages whose version may change the last digits of a result.
_DECIDING = ("python", "platform", "blockvis", "numpy", "scipy", "highspy", "clarabel")


@dataclass(frozen=True)
class Record:
    """What a run was made from."""

    case: str = ""  #: Text of the case file; empty where the run came from Python.
    #: Files are absolute paths; empty where there is none.
    case_file: str = ""
    case_sha256: str = ""
    layout_file: str = ""
    layout_sha256: str = ""
    versions: dict[str, str] = field(default_factory=dict)  #: Of Python and of the packages, and the platform.

    def inputs(self) -> dict[str, str | None]:
        """Names and checksums of the files that were read, for summary.json."""
        return {
            "case_file": Path(self.case_file).name or None,
            "case_sha256": self.case_sha256 or None,
            "layout_file": Path(self.layout_file).name or None,
            "layout_sha256": self.layout_sha256 or None,
        }

    def changes(self, sum_of_layout: Callable[[Path], str]) -> list[str]:
        """Say which files and versions have changed since the run began; a layout may be of several files."""
        notes = []
        for what, file, checksum, sum_of in (
            ("case", self.case_file, self.case_sha256, checksum_of),
            ("layout", self.layout_file, self.layout_sha256, sum_of_layout),
        ):
            if not file:
                continue
            try:
                changed = sum_of(Path(file)) != checksum
            except (OSError, ValueError):
                notes.append(f"the {what} file '{file}' is gone; the run goes on with what it read from it")
                continue
            if changed:
                notes.append(f"the {what} file '{file}' has changed; the run goes on with what it read from it")
        now = versions()
        both = [(name, self.versions.get(name), now[name]) for name in _DECIDING]
        newer = [f"{name} {before} → {after}" for name, before, after in both if before != after]
        if newer:
            notes.append(f"not what the run began with: {', '.join(newer)}; the last digits may differ")
        return notes


def read_record(folder: Path) -> Record:
    """Read the record of a results folder.

    Raises ``ValueError`` where it has none: it holds no run, or one that was stopped before it began.
    """
    path = folder / RECORD
    if not path.is_file():
        what = f"'{folder}' holds no run (no {RECORD} in it, which says what was run)"
        what = what if folder.is_dir() else f"there is no folder '{folder}'"
        raise ValueError(f"{what}; start a run with blockvis run CASE.toml -o {folder}")
    try:
        return Record(**read_json(path))
    except TypeError as error:
        raise damaged(path, error) from None


def case_text(folder: Path) -> str:
    """Read the text of the case of a results folder: empty for a run from Python, and where no record is left."""
    return read_record(folder).case if (folder / RECORD).is_file() else ""


def read_json(path: Path) -> Any:
    """Read a file of JSON that a run has written; raises ``ValueError`` with its name where it is damaged."""
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except ValueError as error:
        raise damaged(path, error) from None


def write_json(path: Path, value: Any) -> None:
    """Write a file of JSON of a run."""
    write_atomic(path, json.dumps(value, indent=2, ensure_ascii=False) + "\n")


def damaged(path: Path, why: object) -> ValueError:
    """Say that a file of a results folder cannot be read, and why."""
    return ValueError(f"'{path}' is not what a run wrote ({why}); run the case again with --force")


def versions() -> dict[str, str]:
    """Versions of Python, of the packages that a result depends on, and the platform."""
    found = {"python": platform.python_version(), "platform": platform.platform()}
    for name in ("blockvis", "numpy", "scipy", "highspy", "clarabel", "pyvista", "vtk", "meshio"):
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "not installed"
    return found


def checksum_of(path: Path) -> str:
    """SHA-256 of a file, in hexadecimal."""
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
