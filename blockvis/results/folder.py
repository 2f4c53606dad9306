"""The results folder: written during the run, reopened without solving."""

from __future__ import annotations

import errno
import importlib
import os
import weakref
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

import solver
from blockvis.layout.layout import assembly_of, layout_of
from blockvis.system.atomic_files import PARTIAL, WINDOWS, flush, make_folder, remove, write_atomic
from blockvis.text import resume_command
from solver import mechanics

from .about import phases_of
from .cracks import MOST_LISTED, last_cracks
from .fall_files import remove_fall
from .given import GIVEN, write_given
from .increments import StoredIncrements, packed_increment
from .joints import LargestMovements
from .mechanism_arrays import at_last_equilibrium
from .npz import packed, unpacked
from .record import RECORD, Record, read_json, read_record, versions, write_json
from .tables import (
    COLUMNS,
    FORCES,
    LIMIT_TABLES,
    SUPPORT_COLUMNS,
    csv_text,
    in_place,
    own_columns,
    row_of_increment,
    rows_of_supports,
    summary_of,
)
from .ties import COLUMNS as TIE_COLUMNS
from .ties import TIES, TieCourses, stored_ties, tie_courses, tie_rows, write_ties
from .viewer_files import MOVED, ViewerFormat, restore_grids, write_end, write_grids, write_lists

#: Where a run can go on from, beside the increments it belongs to.
CHECKPOINT = "checkpoint.npz"

#: What a run holds locked on Windows.
LOCK = ".lock"

#: What a run adds to the name of its case, if it is told no other folder.
RESULTS = "-results"

#: Endings of the films that blockvis writes.
VIDEO_SUFFIXES = (".mp4", ".gif", ".webp")

#: Folders in it.
FOLDERS = ("increments", "fall")

#: Files that list or sum up others; what a run starts with; pictures of the results.
STEP_CHECK, RANGE = "step_check.json", "range.csv"
_LISTS = (
    *("summary.json", STEP_CHECK, RANGE, "response.csv", "joints.csv", "blocks.pvd", "contacts.pvd", "joints.pvd"),
    *("supports.csv", "ties.csv", "ties.pvd"),
    *LIMIT_TABLES,
)
_STARTED = (RECORD, CHECKPOINT, "assembly.npz", TIES, GIVEN)
_PICTURES = (
    *("report.html", "report.pdf", "curve.png", "curve.svg", "mechanism.png", "cracks.png", "last.png", "poster.png"),
    "paraview_colours.py",
    *(f"collapse{suffix}" for suffix in VIDEO_SUFFIXES),
)
RUN_FILES = ("increments", *_LISTS, *_STARTED, *_PICTURES)

C = TypeVar("C")


#: What to do where files of another run stand.
CHOOSE = "choose another folder with -o or add --force (in Python overwrite=True)"


class ResultsExist(ValueError):
    """The results folder holds a run already."""


def refuse_results(path: str | Path, overwrite: bool = False) -> None:
    """Raise :class:`ResultsExist` if a folder holds results that may not be replaced."""
    if path == "":
        raise ValueError("the folder is '': -o is empty; name the folder of the results")
    path = Path(path)
    unfinished = not (path / "summary.json").exists() and (path / RECORD).exists()
    if unfinished and not overwrite:
        # Another run may be about to finish it.
        locked(ResultsFolder, path)()
    go_on = f"go on with it by {resume_command(path)}, " if unfinished else ""
    refuse_files(path, RUN_FILES, "results", overwrite, go_on + CHOOSE)


def refuse_files(folder: Path, names: Iterable[str], what: str, overwrite: bool, remedy: str = CHOOSE) -> None:
    """Raise :class:`ResultsExist` if a folder holds one of these files, which may not be replaced."""
    if folder.exists() and not folder.is_dir():
        raise ResultsExist(f"'{folder}' is a file; choose a folder with -o")
    there = next((name for name in names if (folder / name).exists()), None)
    if there is not None and not overwrite:
        raise ResultsExist(f"'{folder}' holds {what} already ({there}); {remedy}")


class ResultsFolder:
    """A results folder that grows with the run: readable at every moment, whatever ends it.

    The increments run over a parameter, the structure has ties, and the VTU files a format. Results that are there
    already may be replaced, or :class:`ResultsExist` is raised, as where another run is writing to the folder.

    The checkpoint is the last file of an increment to be written: files of later increments, which a killed run may
    have left, are removed when the run goes on. Each increment waits for the disk with its state and the checkpoint;
    lists are flushed at the end, and VTU files by :meth:`flush`, which a run calls while it draws: both can be made
    again from the states.
    """

    def __init__(
        self,
        path: str | Path,
        assembly: solver.Assembly,
        *,
        record: Record | None = None,
        overwrite: bool = False,
        parameter: mechanics.Quantity = mechanics.SETTLEMENT,
        vtu: ViewerFormat = MOVED,
        ties: Sequence[solver.Tie] = (),
    ) -> None:
        self.parameter, self.vtu, self.ties = parameter, vtu, tuple(ties)
        self.path, self.assembly, self.record = Path(path), assembly, record or Record(versions=versions())
        self.increments: list[solver.Increment] = []
        self._files = StoredIncrements(self.path)
        refuse_results(path, overwrite)
        make_folder(self.path / "increments")
        self.release = locked(self, self.path)
        # Lists of files go first, so that none ever names a file that is gone.
        for name in (*_LISTS, *_PICTURES, *_STARTED):
            (self.path / name).unlink(missing_ok=True)
        remove_fall(self.path)
        self._remove_from(0)
        write_atomic(self.path / "assembly.npz", packed(assembly))
        write_ties(self.path, self.ties)
        write_json(self.path / RECORD, asdict(self.record))
        self._start_table()

    @classmethod
    def reopened(
        cls, path: str | Path, parameter: mechanics.Quantity, kind: type[C], vtu: ViewerFormat = MOVED
    ) -> tuple[ResultsFolder, C | None]:
        """Reopen the folder of a run that was stopped, as it was after its last checkpoint, and give that, of a kind.

        Raises ``ValueError`` where the folder holds no run.
        """
        results = cls.__new__(cls)
        results.path, results.parameter, results.vtu = Path(path), parameter, vtu
        results.record = read_record(results.path)
        results.assembly = stored_assembly(results.path)
        results.release = locked(results, results.path)
        results._files = StoredIncrements(results.path)
        results.increments, checkpoint, count = [], None, 0
        stored = results.path / CHECKPOINT
        if stored.is_file():
            try:
                checkpoint, extra = unpacked(stored.read_bytes(), kind)
                count = int(extra["increments"])
                results.increments = [results._files.opened(k) for k in range(count)]
            except (ValueError, KeyError, OSError) as error:
                raise ValueError(f"'{results.path}' cannot go on ({error}); run the case again with --force") from None
        results.ties = stored_ties(results.path, results.increments)
        (results.path / "summary.json").unlink(missing_ok=True)
        remove_fall(results.path)
        results._start_table()
        for number, increment in enumerate(results.increments):
            results._add_row(number, increment)
        restore_grids(results.path, results.assembly, results.increments, vtu)
        results._write_table()
        write_lists(results.path, results.increments)
        results._remove_from(count)
        return results, checkpoint

    def add(self, increment: solver.Increment) -> None:
        """Write one increment: its state, its row, what viewers open, and the checkpoint.

        Afterwards the folder keeps the numbers of the increment, not its arrays; see
        :mod:`blockvis.results.increments`.
        """
        self._refuse_gone()
        number = len(self.increments)
        write_atomic(self._files.file(number), packed_increment(increment))
        self.increments.append(self._files.without_arrays(number, increment))
        self._add_row(number, increment)
        write_grids(self.path, number, self.assembly, self.increments[-1], self.vtu)
        write_lists(self.path, self.increments)
        self._write_table()
        if increment.checkpoint is not None:
            write_atomic(self.path / CHECKPOINT, packed(increment.checkpoint, compressed=False, increments=number + 1))

    def finish(
        self,
        response: solver.Response,
        seconds: float,
        *,
        own: Mapping[str, Any] | None = None,
        tables: Mapping[str, str] | None = None,
    ) -> dict[str, Any]:
        """Write the tables of the kind of analysis, by their files, and the summary with what it adds; returns that."""
        self._refuse_gone()
        self.tell(response)
        if response.path and response.collapse is not None:
            # What follows the last equilibrium is known by now, and with it the states of its joints.
            write_end(self.path, response, self.vtu)
            last = at_last_equilibrium(response)
            row = row_of_increment(last, self.assembly)
            self._rows[-1:] = in_place(len(response.path) - 1, last, self.parameter, row)
            if len(response.path) == len(self.increments):
                # There is no frame of the fall that has the mechanism.
                write_atomic(self._files.file(len(response.path) - 1), packed_increment(last))
        self._write_table(durable=True)
        write_lists(self.path, self.increments, durable=True)
        write_atomic(self.path / "joints.csv", self._movements.table(phases_of(response)))
        for name, text in (tables or {}).items():
            write_atomic(self.path / name, text)
        listed = {"cracks": [crack.values() for crack in last_cracks(response)[:MOST_LISTED]]}
        if self.ties:
            courses = self._courses.courses if response.parameter.is_path else tie_courses(response)
            listed["ties"] = [asdict(course) for course in courses]
        summary = summary_of(response, seconds=seconds, record=self.record, own={**listed, **(own or {})})
        write_json(self.path / "summary.json", summary)
        self.release()
        return summary

    def tell(self, response: solver.Response) -> None:
        """Write the laws and loads of a response where no case file tells them."""
        if not self.record.case:
            write_given(self.path, response)

    def _start_table(self) -> None:
        self._rows, self._support_rows, self._tie_rows = (list[Sequence[Any]]() for _ in range(3))
        self._courses = TieCourses(self.ties)
        self._movements = LargestMovements(self.assembly, self.parameter)

    def _add_row(self, number: int, increment: solver.Increment) -> None:
        if increment.status == solver.Status.EQUILIBRIUM:
            placed = partial(in_place, number, increment, self.parameter)
            self._rows += placed(row_of_increment(increment, self.assembly))
            self._support_rows += placed(*rows_of_supports(increment, self.assembly))
            self._movements.add(increment)
            if self.ties:
                self._tie_rows += placed(*tie_rows(self.ties, increment))
                self._courses.add(increment)

    def _write_table(self, *, durable: bool = False) -> None:
        tables = [
            ("response.csv", COLUMNS, self._rows),
            ("supports.csv", (*SUPPORT_COLUMNS, *FORCES[self.assembly.dimension]), self._support_rows),
            *([("ties.csv", TIE_COLUMNS, self._tie_rows)] * bool(self.ties)),
        ]
        for name, columns, rows in tables:
            text = csv_text((*columns, *own_columns(self.parameter)), rows)
            write_atomic(self.path / name, text, last=False, durable=durable)

    def _refuse_gone(self) -> None:
        """Raise ``OSError`` where the folder was moved during the run: made again, it would hold half of the run."""
        if not self.path.is_dir():
            raise FileNotFoundError(errno.ENOENT, "it was moved or removed during the run", str(self.path))

    def flush(self) -> None:
        """Flush the VTU files to the disk: each increment waits for its state only, of which they are made."""
        for file in sorted((self.path / "increments").glob("*.vtu")):
            flush(file)
        flush(self.path / "increments")

    def _remove_from(self, count: int) -> None:
        """Remove the files of increments from a number on, and files that a killed run has left half written."""
        folder = self.path / "increments"
        for old in [*folder.glob("*.vtu"), *folder.glob("*.npz")]:
            number = old.stem.rpartition("_")[2]
            if not old.name.startswith(".") and number.isdigit() and int(number) >= count:
                old.unlink()
        for half in (*self.path.glob(PARTIAL), *folder.glob(PARTIAL)):
            remove(half)


def locked(owner: object, folder: Path, what: str = "run") -> Callable[[], None]:
    """Lock the folder for one run or study, until the returned function is called or the process ends in any way."""
    handle = None
    # Windows opens no folder, but a file that goes with its user.
    file = (folder / LOCK, os.O_RDWR | os.O_CREAT | getattr(os, "O_TEMPORARY", 0)) if WINDOWS else (folder, os.O_RDONLY)
    try:
        handle = os.open(*file)
        _lock(handle)
    except (BlockingIOError, PermissionError):
        if handle is not None:
            os.close(handle)
        raise ResultsExist(
            f"another {what} is writing to '{folder}'; wait for it, end it, or choose another folder with -o"
        ) from None
    except OSError:
        # A file system without locks: two runs into one folder are not noticed.
        if handle is None:
            return lambda: None
    return weakref.finalize(owner, os.close, handle)


def _lock(handle: int) -> None:
    """Lock what is open, without waiting; BlockingIOError or PermissionError where another process has it."""
    if WINDOWS:
        msvcrt = importlib.import_module("msvcrt")
        msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)
        return
    import fcntl

    fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)


def stored_assembly(folder: Path) -> solver.Assembly:
    """Read the assembly of a results folder; raises ``ValueError`` where there is none, or its file is damaged."""
    if not (folder / "assembly.npz").is_file():
        raise ValueError(f"'{folder}' holds no results (no assembly.npz in it); give the folder that a run wrote")
    try:
        stored, _ = unpacked((folder / "assembly.npz").read_bytes(), solver.Assembly)
        # Checked like a layout: the file may come from anywhere.
        drawn = layout_of(stored)
        labels: dict[str, Any] = {"names": stored.names, "roles": stored.roles, "materials": stored.materials}
        assembly = assembly_of(drawn.blocks, drawn.thickness, density=stored.density, **labels)
        return replace(assembly, drawn_names=stored.drawn_names)
    except (ValueError, TypeError, IndexError) as error:
        raise ValueError(f"'{folder / 'assembly.npz'}' cannot be read ({error}); run the case again") from None


def add_to_summary(folder: Path, **found: Any) -> None:
    """Add to summary.json, by the names of the keys, what becomes known after it is written."""
    file = folder / "summary.json"
    write_json(file, {**read_json(file), **found})


def stored_response(folder: Path) -> tuple[solver.Response, dict[str, Any]]:
    """Read the response of a results folder, without what its kind of analysis adds, and its summary, empty if stopped.

    Increments read their arrays from the folder when they are asked for; loads and interfaces are defaults. Raises
    ``ValueError`` where the folder holds no results.
    """
    assembly = stored_assembly(folder)
    files = StoredIncrements(folder)
    nothing = f"the run in '{folder}' has found nothing yet; go on with it by {resume_command(folder)}"
    summary: dict[str, Any] = {}
    if (folder / "summary.json").is_file():
        summary = read_json(folder / "summary.json")
    # A copy that broke off has fewer files than the run wrote, whose path would seem to end there.
    count = max(len(files), summary.get("n_increments", 0) + summary.get("n_falling_frames", 0))
    increments = [files.opened(k) for k in range(count)]
    response = solver.Response(
        assembly=assembly,
        settlements=(),
        interfaces=solver.Interfaces(),
        loads=solver.self_weight(assembly),
        increments=tuple(increments),
        stop=solver.Status(summary.get("status", solver.Status.INTERRUPTED)),
        message=summary.get("message", "" if increments else nothing),
        collapse=_collapse_of(summary, increments, assembly),
        ties=stored_ties(folder, increments),
    )
    return response, summary


def _collapse_of(
    summary: Mapping[str, Any], increments: Sequence[solver.Increment], assembly: solver.Assembly
) -> solver.Collapse | None:
    if summary.get("collapse_bracket") is None:
        return None
    mechanism = np.zeros((assembly.n_blocks, 3 * assembly.dimension - 3))
    falling = [i for i in increments if i.status == solver.Status.FALLING]
    moving = [*falling, *increments[-1:]]
    if moving:
        motion = moving[0].velocity
        mechanism = motion / max(mechanics.motion_size(motion, assembly.block_size).max(), 1e-300)
    return solver.Collapse(
        displacement=summary["collapse_displacement"],
        bracket=(summary["collapse_bracket"][0], summary["collapse_bracket"][1]),
        reaction=summary["collapse_reaction"],
        mechanism=mechanism,
        unit=summary["settlement_unit"],
        words=summary.get("mechanism") or "",
        lost=summary.get("collapse_lost", "equilibrium"),
    )
