"""The cases that come with blockvis: from the wheel, or from the folder ``examples`` of a clone."""

from __future__ import annotations

import itertools
import re
from pathlib import Path, PurePosixPath

from blockvis.system.atomic_files import write_atomic
from blockvis.text import nearest

_PACKAGE = Path(__file__).parents[1]

#: What lies before the name of a drawing in a shipped case.
_DRAWINGS = "../assets/"


def shipped_cases() -> dict[str, Path]:
    """Return the case files that come with blockvis by their names; those to explain begin with ``explain/``.

    FileNotFoundError where the installation has none.
    """
    # The wheel has them inside the package; a clone, also one installed for editing, beside it.
    for root in (_PACKAGE / "shipped", _PACKAGE.parent):
        examples = root / "examples"
        found = [*sorted(examples.glob("*.toml")), *sorted(examples.glob("explain/*.toml"))]
        if found:
            return {path.relative_to(examples).with_suffix("").as_posix(): path for path in found}
    raise FileNotFoundError(f"{_PACKAGE}: this installation has no shipped cases; install blockvis again")


def first_sentence(case: Path) -> str:
    """Return what a shipped case says of itself in the first sentence of its remarks."""
    lines = itertools.takewhile(lambda line: line.startswith("#"), case.read_text(encoding="utf-8").splitlines())
    remarks = " ".join(line.lstrip("# ") for line in lines)
    return re.split(r"(?<=\.)\s", remarks, maxsplit=1)[0]


def copy_case(name: str, *, overwrite: bool = False) -> list[Path]:
    """Copy a shipped case, and the drawing or the table of cracks that it names, into the working directory.

    The name is with or without ``.toml``; the case comes first. ValueError where there is no such case,
    FileExistsError, before anything is written, where a file is there that may not be replaced (``overwrite``).
    """
    cases = shipped_cases()
    stem = name.removesuffix(".toml")
    if stem not in cases:
        raise ValueError(f"there is no example '{name}'{nearest(stem, list(cases))}; there are {', '.join(cases)}")
    source = cases[stem]
    text = source.read_text(encoding="utf-8")
    here = re.sub(r"(examples/)?explain/(?=\w)", "", text.replace(_DRAWINGS, ""))
    contents: dict[str, str | bytes] = {source.name: here}
    for table in sorted(source.parent.glob("*.csv")):
        if re.search(rf"(?<!\w){re.escape(table.name)}", text):
            contents[table.name] = table.read_bytes()
    for quoted in text.split('"')[1::2]:
        if quoted.startswith(_DRAWINGS):
            contents[PurePosixPath(quoted).name] = (source.parent / quoted).read_bytes()
    targets = {Path(file): content for file, content in contents.items()}
    for target in targets:
        if target.exists() and not overwrite:
            raise FileExistsError(f"{target} is there already; --force replaces it")
    return [write_atomic(target, content) for target, content in targets.items()]
