"""The folder of a study: a finished run is a line of a file that only grows, and is never lost."""

from __future__ import annotations

import json
import math
import os
import shutil
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

import solver
from blockvis.results.folder import locked
from blockvis.results.record import read_json, write_json
from blockvis.system.atomic_files import atomic_file, flush, make_folder, write_atomic
from solver.mechanics import counted

from .run_one import FAILED, NOT_BUILT
from .study_file import RESERVED, Study

if TYPE_CHECKING:
    import pandas as pd

#: The file of the rows, one JSON object per line.
RUNS = "runs.jsonl"

#: Status of a run without result.
NO_RESULT = (NOT_BUILT, FAILED, str(solver.Status.SOLVER_FAILED), str(solver.Status.INTERRUPTED))

_TEXTS = ("status", "unit", "mechanism_class", "mechanism", "message")
_COUNTS = ("run", "seed", "macro_blocks", "hinges", "sliding_joints", "increments", "programs")


class StudyExists(ValueError):
    """The folder holds another study, or something else."""


def has_failed(row: Mapping[str, Any]) -> bool:
    """Whether a run gave no result."""
    return row["status"] in NO_RESULT


def finished_runs(folder: str | Path) -> int:
    """Count the finished runs in the folder of a study; one that was made again has several lines."""
    return len(_rows(Path(folder) / RUNS)[0])


class StudyFolder:
    """The folder of a study, with the rows of its finished runs; ``force`` deletes those of another study.

    Raises :class:`StudyExists` if the folder holds rows of another study, or something that is no study, and
    :class:`ResultsExist` if another study is writing to it.
    """

    def __init__(self, folder: str | Path, study: Study, *, force: bool = False) -> None:
        self.folder, self.study = Path(folder), study
        self.rows: dict[int, dict[str, Any]] = {}
        # Number of the run whose shape represents each class of mechanism, by the file of the shape.
        self._first: dict[Path, int] = {}
        self._whole = True
        record, definition = self.folder / "study.json", study.definition()
        if self.folder.exists() and not self.folder.is_dir():
            raise StudyExists(f"'{self.folder}' is a file; choose another folder with -o")
        if record.is_file():
            # A damaged record is that of another study.
            stored: dict[str, Any] = {}
            with suppress(ValueError):
                stored = read_json(record).get("definition", {})
            changed = [k for k, v in definition.items() if stored.get(k) != v]
            if changed and not force:
                raise StudyExists(
                    f"'{self.folder}' holds {counted(len(self._stored()), 'finished run')} of another study: "
                    f"{', '.join(changed)} {'has' if len(changed) == 1 else 'have'} changed; choose another folder "
                    "with -o, or throw these runs away with --force"
                )
        elif self.folder.is_dir() and any(self.folder.iterdir()):
            raise StudyExists(f"'{self.folder}' holds something that is no study; choose another folder with -o")
        make_folder(self.folder / "mechanisms")
        # Lets another study write to the folder.
        self.close = locked(self, self.folder, "study")
        if force:
            self._clear()
        about = {
            "study": str(study.source),
            "case": str(study.case_source),
            # JSON has no dates.
            "values": json.loads(json.dumps(study.values, default=str)),
            "n_runs": study.n_runs,
            "method": study.method,
            "seed": study.seed,
            "definition": definition,
            "versions": {name: version(name) for name in ("blockvis", "numpy", "scipy", "highspy", "dask")},
        }
        write_json(record, about)
        self.rows |= self._stored()

    def missing(self, *, retry_failed: bool = False) -> list[int]:
        """List the runs that are not finished, in order."""
        done = {run for run, row in self.rows.items() if not (retry_failed and has_failed(row))}
        return [run for run in range(self.study.n_runs) if run not in done]

    def add(self, finished: Sequence[tuple[dict[str, Any], bytes]]) -> None:
        """Record finished runs by their rows, and the shape of a mechanism if no earlier run has one of its class."""
        # In memory before on the disk: an interruption between the two would leave a row out of the table that is kept.
        self.rows |= {row["run"]: row for row, _ in finished}
        for row, shape in finished:
            if shape:
                self._add_shape(row, shape)
        lines = "".join(json.dumps(row, ensure_ascii=False) + "\n" for row, _ in finished)
        with open(self.folder / RUNS, "ab") as stream:
            begun = stream.tell() > 0
            if begun and not self._whole:
                stream.write(b"\n")
            self._whole = True
            stream.write(lines.encode())
            stream.flush()
            os.fsync(stream.fileno())
        if not begun:
            flush(self.folder)

    def _add_shape(self, row: Mapping[str, Any], shape: bytes) -> None:
        file = self.shape_file(row["mechanism_class"])
        if file not in self._first and file.is_file():
            with np.load(file) as stored:
                self._first[file] = int(stored["run"])
        if row["run"] < self._first.get(file, math.inf):
            self._first[file] = row["run"]
            write_atomic(file, shape)

    def shape_file(self, mechanism_class: str) -> Path:
        """File of the shape of a class of mechanisms."""
        return self.folder / "mechanisms" / f"{sha256(mechanism_class.encode()).hexdigest()[:12]}.npz"

    def table(self) -> pd.DataFrame:
        """Make the table of the finished runs, one row per run, in order."""
        import pandas as pd

        names = [p.name for p in self.study.parameters]
        columns = ["run", "status", *names, *RESERVED[2:]]
        records = [
            {**{name: _plain(row["parameters"].get(name)) for name in names}, **row}
            for _, row in sorted(self.rows.items())
        ]
        table = pd.DataFrame.from_records(records, columns=columns)
        for column in RESERVED:
            if column in _COUNTS:
                table[column] = table[column].astype("Int64")
            elif column in _TEXTS:
                table[column] = table[column].astype("string").fillna("")
            else:
                table[column] = table[column].astype("float64")
        return table

    def write_table(self) -> pd.DataFrame:
        """Write table.csv and table.parquet, each whole or not at all, and return the table."""
        table = self.table()
        for name, save in (("table.csv", table.to_csv), ("table.parquet", table.to_parquet)):
            with atomic_file(self.folder / name) as partial:
                save(partial, index=False)
        return table

    def write_summary(self, summary: Mapping[str, Any]) -> None:
        """Write summary.json."""
        finished = {"finished": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime())}
        write_json(self.folder / "summary.json", {**summary, **finished})

    def _stored(self) -> dict[int, dict[str, Any]]:
        """Read the rows on the disk, of runs that the study has."""
        rows, self._whole = _rows(self.folder / RUNS)
        return {run: row for run, row in rows.items() if 0 <= run < self.study.n_runs}

    def _clear(self) -> None:
        """Remove the files that a study writes, and nothing else."""
        for file in (self.folder / "mechanisms").glob("*.npz"):
            file.unlink()
        for kept in (self.folder / "results").glob("run_*"):
            shutil.rmtree(kept) if kept.is_dir() else kept.unlink()
        for name in (RUNS, "table.csv", "table.parquet", "summary.json", *(f"{p}.png" for p in PICTURES)):
            (self.folder / name).unlink(missing_ok=True)


#: The pictures of a study.
PICTURES = ("fragility", "sensitivity", "scatter", "mechanisms")


def _rows(file: Path) -> tuple[dict[int, dict[str, Any]], bool]:
    """Read the last row of each run, and whether the last line is whole; a broken one is that of no run."""
    rows = {}
    lines = file.read_bytes().split(b"\n") if file.is_file() else [b""]
    for line in lines:
        try:
            row = json.loads(line)
        except ValueError:
            continue
        if isinstance(row, dict) and isinstance(row.get("run"), int):
            rows[row["run"]] = row
    # It ends with a line feed; a study killed while writing leaves part of a line.
    return rows, not lines[-1]


def _plain(value: Any) -> Any:
    """Turn a list or table into text, because a column holds numbers or texts."""
    return json.dumps(value) if isinstance(value, (list, dict)) else value
