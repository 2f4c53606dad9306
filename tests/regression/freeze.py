"""Freezes the numbers of every example, so that whatever moves or is rewritten can show that it has changed nothing.

    python tests/regression/freeze.py                   # all, three to five minutes
    python tests/regression/freeze.py portal_frame ...  # these
    python tests/regression/freeze.py --list

It writes ``golden/NAME.json``, numbers with all their digits. Freeze again only where other results are wanted, and say
in the commit why they differ.

To show that a commit changes nothing at all, on any machine: freeze on the commit before it, then run
``BLOCKVIS_EXACT=1 python -m pytest tests/regression`` on the commit itself, and throw the frozen files away. The files
that are kept come from one machine (linear algebra by OpenBLAS, kernel SkylakeX); bit for bit they can be compared only
where kernel and libraries are the same.
"""

from __future__ import annotations

import argparse
import csv
import hashlib
import json
import tempfile
import tomllib
import warnings
from pathlib import Path
from typing import Any

import numpy as np

import blockvis

HERE = Path(__file__).resolve().parent
EXAMPLES = HERE.parent.parent / "examples"
GOLDEN = HERE / "golden"

#: Every example, and cases of our own for what no example does.
CASES = {path.stem: path for folder in (EXAMPLES, HERE) for path in sorted(folder.glob("*.toml"))}

#: Studies cut down to a few runs: what replaces the keys of their [study] table and of their parameters.
STUDIES: dict[str, dict[str, dict[str, Any]]] = {
    "arch_friction": {"study": {"runs": 6}},
    "panel_settlement_friction": {
        "parameters": {
            "geometry.parameters.settling[0]": {"values": [1.0]},
            "material.friction_coefficient": {"values": [0.4, 0.7]},
        },
    },
}

#: Rows of a table that are kept; of a longer one, as many at even distances, its ends among them. The digest is of all.
MOST_ROWS = 40

#: Numbers of the summary that rounding may change within a tolerance.
NUMBERS = (
    "collapse_displacement",
    "collapse_bracket",
    "initial_reaction",
    "collapse_reaction",
    "last_settlement",
    "last_reaction",
    "limit_load_multiplier",
    "limit_load_bounds",
    "largest_load_multiplier",
    "largest_load_multiplier_at",
    "total_weight",
)

#: What has to be the same in every comparison.
WORDS = ("status", "analysis", "parameter", "n_blocks")

#: How long the path is and what is on it; rounding decides there where joints slide.
COUNTS = ("n_contacts", "n_increments", "n_falling_frames")

#: What rounding may decide anywhere: of two equal minima, or of two ways to the same answer.
CHOICES = ("governing_position", "mechanism", "n_programs")

#: Columns of response.csv whose numbers are compared, and those that count.
COLUMNS = ("settlement", "reaction", "load_multiplier", "control_displacement", "load_position")
COUNT_COLUMNS = ("contacts_open", "contacts_sticking", "contacts_sliding", "contacts_hinging", "programs")

#: Tables of limit loads, and their numbers.
LIMIT_TABLES = ("envelope.csv", "capacity.csv")
LIMIT_COLUMNS = ("position", "settlement", "load_multiplier", "static", "kinematic")

#: Columns of a study's table.
STUDY_COLUMNS = ("collapse_displacement", "bracket_low", "bracket_high", "initial_reaction", "collapse_reaction")
STUDY_COUNTS = ("increments", "programs")

#: Residuals are rounding itself: what is kept is a bound, ten times what was measured, and not below this.
SMALLEST_BOUND = 1e-9

#: A duality gap above this is not rounding: its programs are accepted with the gap that follows, on any processor.
ROUNDED_GAP, ACCEPTED_GAP = 1e-10, 1e-7


def ran(name: str, folder: Path) -> Any:
    """The run of an example; nothing is drawn.

    Parameters
    ----------
    name : str
        A key of ``CASES``.
    folder : Path
        Where its results go.

    Returns
    -------
    Run
        As of :func:`blockvis.run_case`.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return blockvis.run_case(CASES[name], folder, outputs=())


def numbers_of(name: str, folder: Path) -> dict[str, Any]:
    """Runs a case and picks from its results folder what is to stay the same.

    Parameters
    ----------
    name : str
        A key of ``CASES`` or ``STUDIES``.
    folder : Path
        Where its results go.

    Returns
    -------
    dict
        As it is stored, but for residuals, of which bounds are; tables are mappings from column to list.
    """
    if name in STUDIES:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return _study_numbers(name, folder)
    return numbers_in(ran(name, folder))


def numbers_in(run: Any) -> dict[str, Any]:
    """What is to stay the same of a run, from its results folder; as :func:`numbers_of`."""
    folder = run.folder
    summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    limits = [folder / table for table in LIMIT_TABLES if (folder / table).is_file()]
    return {
        **{kind: {key: summary[key] for key in keys if key in summary} for kind, keys in _KINDS.items()},
        "residuals": summary["largest_residuals"],
        "response": _table(folder / "response.csv", COLUMNS),
        "response_counts": _table(folder / "response.csv", COUNT_COLUMNS),
        **{table.stem: _table(table, LIMIT_COLUMNS) for table in limits},
        "digest": _digest(run.response),
    }


_KINDS = {"words": WORDS, "numbers": NUMBERS, "counts": COUNTS, "choices": CHOICES}


def _study_numbers(name: str, folder: Path) -> dict[str, Any]:
    file = EXAMPLES / "studies" / f"{name}.toml"
    values = tomllib.loads(file.read_text(encoding="utf-8"))
    values["study"] |= {"case": str(file.parent / values["study"]["case"]), **STUDIES[name].get("study", {})}
    for parameter, changed in STUDIES[name].get("parameters", {}).items():
        values["parameters"][parameter] |= changed
    blockvis.study(values, folder, workers=1, progress=False)
    table = folder / "table.csv"
    parameters = tuple(p.get("name", path) for path, p in values["parameters"].items())
    return {
        "words": _table(table, ("status",)),
        "numbers": {},
        "counts": {},
        "choices": _table(table, ("mechanism_class",)),
        "response": _table(table, (*parameters, *STUDY_COLUMNS)),
        "response_counts": _table(table, STUDY_COUNTS),
    }


def _table(path: Path, columns: tuple[str, ...]) -> dict[str, list[Any]]:
    """Some columns of a table, of so many rows at most."""
    with path.open(encoding="utf-8", newline="") as lines:
        rows = list(csv.DictReader(lines))
    kept = np.unique(np.linspace(0, len(rows) - 1, min(MOST_ROWS, len(rows))).round().astype(int)) if rows else []
    return {column: [_value(rows[i][column]) for i in kept] for column in columns if rows and column in rows[0]}


def _value(text: str) -> Any:
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return text


def _bound(key: str, measured: float | None) -> float | None:
    if measured is None:
        return None
    least = ACCEPTED_GAP if key == "duality_gap" and measured > ROUNDED_GAP else SMALLEST_BOUND
    return max(float(f"{10.0 * measured:.0e}"), least)


def _digest(response: Any) -> str:
    """One number for all bits of all increments: where the blocks are, how they move, what the joints carry."""
    bits = hashlib.sha256()
    for increment in response.increments:
        scalars = (increment.settlement, increment.reaction, increment.load_multiplier)
        pose, contacts = increment.pose, increment.contacts
        arrays = (scalars, pose.positions, pose.rotations, contacts.points, increment.forces, increment.velocity)
        for array in arrays:
            bits.update(np.ascontiguousarray(array, dtype=float).tobytes())
    return bits.hexdigest()


def _text(golden: dict[str, Any]) -> str:
    """JSON with a line for each number or column."""
    parts = []
    for key, value in golden.items():
        if isinstance(value, dict) and value:
            lines = ",\n".join(f"  {json.dumps(k)}: {json.dumps(v, ensure_ascii=False)}" for k, v in value.items())
            parts.append(f" {json.dumps(key)}: {{\n{lines}\n }}")
        else:
            parts.append(f" {json.dumps(key)}: {json.dumps(value)}")
    return "{\n" + ",\n".join(parts) + "\n}\n"


def stored(name: str) -> dict[str, Any]:
    """The frozen numbers of a case."""
    golden: dict[str, Any] = json.loads((GOLDEN / f"{name}.json").read_text(encoding="utf-8"))
    return golden


def main() -> None:
    """Freezes the cases that are named, or all."""
    names = [*CASES, *STUDIES]
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", metavar="NAME", help="all by default")
    parser.add_argument("--list", action="store_true", help="tell the names")
    parser.add_argument("--into", type=Path, default=GOLDEN, metavar="FOLDER", help="where to, instead of golden/")
    given = parser.parse_args()
    if given.list:
        print(*names, sep="\n")
        return
    unknown = [name for name in given.names if name not in names]
    if unknown:
        parser.error(f"there is no example '{unknown[0]}'; choose from {', '.join(names)}")
    given.into.mkdir(parents=True, exist_ok=True)
    for name in given.names or names:
        with tempfile.TemporaryDirectory() as folder:
            golden = numbers_of(name, Path(folder) / "out")
        if "residuals" in golden:
            golden["residual_bounds"] = {key: _bound(key, value) for key, value in golden.pop("residuals").items()}
        (given.into / f"{name}.json").write_text(_text(golden), encoding="utf-8")
        print(name, *golden["words"].values(), flush=True)


if __name__ == "__main__":
    main()
