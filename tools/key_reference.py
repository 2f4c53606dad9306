"""Write the reference of what case, study and observation files hold: python tools/key_reference.py docs/keys."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from blockvis.case_files import case_keys
from blockvis.cases.key import Forms, Key, Section
from blockvis.explanation.observation_keys import ALSO_CALLED, OBSERVATION
from blockvis.generators import LAYOUTS, parameters_of
from blockvis.generators.catalogue import described
from blockvis.studies import study_keys
from blockvis.system.atomic_files import write_atomic
from blockvis.text import as_key, as_toml

_HEAD = "| key | value | unit | default | meaning | example |\n|---|---|---|---|---|---|"

_CASE_INTRODUCTION = """\
A case file is TOML in UTF-8. Lengths are in m, forces in N, angles in rad; compression is positive, moments are
counter-clockwise. Paths are relative to the case file. A key that is not in these tables is refused.
`blockvis new DRAWING` writes a case with a comment on every key. `blockvis schema > case.schema.json` writes the same
tables as a JSON schema; with `#:schema ./case.schema.json` as the first line of a case, editors such as Visual Studio
Code with Even Better TOML complete and check its keys.
"""

_STUDY_INTRODUCTION = """\
A study file is TOML in UTF-8 and names a [case](case_keys.md), what varies in it, and how often. A key that is not in
these tables is refused. `blockvis schema study` prints the same tables as a JSON schema for editors.
"""


_OBSERVATION_INTRODUCTION = """\
An observation file, for [`blockvis explain`](../explain.md), is a table in CSV: a crack or a displaced point in each
row. Lengths are in the unit that stands behind the name of their column, `width [mm]`, `[cm]` or `[m]`; without one in
m. Other columns are left out with a note; a line that begins with `#` is a remark.
"""


def case_page() -> str:
    """Write the page of the case file: Markdown with a table of keys, and an example, for every table of the file."""
    parts = ["# Keys of the case file", _CASE_INTRODUCTION]
    for section in case_keys.SECTIONS:
        parts += _section(section)
        if section is case_keys.PARAMETERS:
            parts += [_layout(name) for name in LAYOUTS]
    return "\n\n".join(part.strip("\n") for part in parts) + "\n"


def study_page() -> str:
    """Write the page of the study file, as :func:`case_page` that of the case file."""
    parts = ["# Keys of the study file", _STUDY_INTRODUCTION]
    for section in study_keys.SECTIONS:
        parts += _section(section)
    return "\n\n".join(part.strip("\n") for part in parts) + "\n"


def observation_page() -> str:
    """Write the page of the observation file: Markdown with a table of its columns."""
    head = "| column | value | unit | if empty | meaning | example |\n|---|---|---|---|---|---|"
    rows = []
    for key in OBSERVATION.keys:
        names = [key.name, *(word for word, name in ALSO_CALLED.items() if name == key.name)]
        shown = ", ".join(f"`{name}`" for name in names)
        rows.append(_cells(shown, key.kind.words, key.unit, key.otherwise, f"{key.meaning}.", f"`{key.example}`"))
    return (
        "\n\n".join(["# Columns of the observation file", _OBSERVATION_INTRODUCTION.strip(), "\n".join([head, *rows])])
        + "\n"
    )


#: Every page by the name of its file.
PAGES = {"case_keys.md": case_page, "study_keys.md": study_page, "observation_keys.md": observation_page}


def write_pages(folder: str | Path) -> list[Path]:
    """Write the pages into a folder, which is made if it is missing.

    Parameters
    ----------
    folder : str or Path

    Returns
    -------
    list of Path
        The files.
    """
    return [write_atomic(Path(folder) / name, page()) for name, page in PAGES.items()]


def _section(section: Section) -> list[str]:
    shown = section.header.replace("*", "NAME")
    parts = [f"## `{shown}`", f"{section.meaning}."]
    if section.names is not None:
        lines = [shown, *(f"{as_key(key)} = {as_toml(value)}" for key, value in section.example.items())]
        choices = ", ".join(f"`{word}`" for word in section.names.schema.get("enum", ()))
        parts += [f"Values: {choices or section.names.words}.", _code(lines)]
    rows = [_row(key) for key in section.keys]
    if rows:
        parts.append("\n".join([_HEAD, *rows]))
    return parts if section.forms is None else [*parts, _forms(section.forms)]


def _row(key: Key) -> str:
    default = "required" if key.required else key.otherwise if key.default is None else f"`{as_toml(key.default)}`"
    kind = ", ".join(f'`"{word}"`' for word in key.choices) or key.kind.words
    return _cells(f"`{key.name}`", kind, key.unit, default, f"{key.meaning}.", f"`{key.name} = {as_toml(key.example)}`")


def _cells(*cells: str) -> str:
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def _code(lines: Sequence[str]) -> str:
    return "\n".join(["```toml", *lines, "```"])


def _layout(name: str) -> str:
    words, rows = described(name), []
    for key, default in parameters_of(name).items():
        kind, meaning = words.get(key, ("", ""))
        rows.append(_cells(f"`{key}`", kind, _default(default), meaning))
    first = (LAYOUTS[name].__doc__ or "").splitlines()[0]
    head = "| parameter | value | default | meaning |\n|---|---|---|---|"
    return "\n".join([f"### `{name}`", "", first, "", head, *rows])


def _default(value: Any) -> str:
    return "" if value is None else f"`{as_toml(value)}`"


def _forms(forms: Forms) -> str:
    rows = []
    for form, needed in forms.needed.items():
        possible = [f"`{name}`" for name in forms.possible.get(form, ())]
        also = f", perhaps {', '.join(possible)}" if possible else ""
        rows.append(_cells(f"`{form}`", ", ".join(f"`{name}`" for name in needed) + also))
    return "\n".join([f"### Its keys, by `{forms.by}`", "", f"| {forms.by} | keys |", "|---|---|", *rows])


def main(arguments: list[str]) -> int:
    """Write the pages into the folder of the command line."""
    if len(arguments) != 1:
        print("give one folder: python tools/key_reference.py docs/reference", file=sys.stderr)
        return 2
    for path in write_pages(arguments[0]):
        print(path)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
