"""One case from its file to its results folder."""

from __future__ import annotations

import time
import warnings
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import solver
from blockvis.case_files.read import parse_case, read_case, refuse_increment_seconds
from blockvis.cases.build import case_assembly
from blockvis.cases.contents import Case
from blockvis.formats.files import checksum_of_files
from blockvis.kinds.kind import AnalysisRun
from blockvis.kinds.kinds import KINDS
from blockvis.results.about import phases_of
from blockvis.results.folder import RESULTS, ResultsFolder, refuse_results
from blockvis.results.record import Record, checksum_of, read_json, read_record, versions
from blockvis.results.viewer_files import restore_grids, write_end
from blockvis.system.atomic_files import PARTIAL
from blockvis.text import resume_command
from solver import mechanics

from .outputs import Clock, Drawing, viewer_format
from .plan import planned
from .progress import Progress, Waiting
from .reopen import open_results
from .step_check import stored_case
from .write import finish


def record_of(case: Case) -> Record:
    """Make the record of a case; without its text where it was changed in Python and is not what the text says."""
    return Record(
        case=case.text if case.text and parse_case(case.text, case.source) == case else "",
        case_file=str(case.source.resolve()) if case.source.is_file() else "",
        case_sha256=checksum_of(case.source) if case.source.is_file() else "",
        layout_file="" if case.file is None else str(case.file.resolve()),
        layout_sha256="" if case.file is None else checksum_of_files(case.file),
        versions=versions(),
    )


@dataclass(frozen=True)
class Run:
    """A finished run.

    Attributes
    ----------
    response : solver.Response
        Whose increments read their arrays from the folder when they are asked for.
    summary : dict
        What summary.json holds.
    missing : tuple of str
        What could not be drawn, and why.
    had_finished : bool
        Whether there was nothing left to solve when it was asked to go on.
    stages : dict from str to float [s]
        Wall-clock seconds of each part: read, solve, write, fall, report, curve, mechanism, film. What another process
        draws meanwhile, the film, counts as the wait for it only.
    """

    response: solver.Response
    folder: Path
    summary: dict[str, Any]
    missing: tuple[str, ...] = field(default=())
    had_finished: bool = False
    stages: dict[str, float] = field(default_factory=dict)


class IncrementTooLong(Exception):
    """An increment has taken longer than it may; the message says what it was doing."""


class RunInterrupted(KeyboardInterrupt):
    """Ctrl-C beside the increments, which are all in the folder; the message says which command makes the rest."""


def run_case(
    case: Case | str | Path,
    folder: str | Path | None = None,
    *,
    overwrite: bool = False,
    film: bool = True,
    pictures: bool = True,
    outputs: Sequence[Drawing] | None = None,
    increment_seconds: float | None = None,
) -> Run:
    """Solve a case and write everything: VTU, PVD, CSV, summary, pictures.

    Parameters
    ----------
    case : Case, or path of a case file
    folder : str or Path, optional
        Results folder; the name of the case with "-results" in the working directory by default.
    overwrite : bool
        Whether results that are there already may be replaced.
    film, pictures : bool
        Draw the film of the case; draw anything at all, the report included.
    outputs : sequence of Drawing, optional
        What is made beside the numbers, in place of what ``film`` and ``pictures`` say: () for the numbers alone.
    increment_seconds : float, optional [s]
        What an increment may take, in place of what the case says.

    Returns
    -------
    Run
        Also after an interruption by Ctrl-C, or by an increment that takes longer than it may: what was finished is
        written, with status "interrupted", and :func:`resume_run` goes on.

    Raises
    ------
    ValueError
        For bad input, before anything is written.
    """
    clock = Clock()
    if not isinstance(case, Case):
        case = read_case(case)
    refuse_increment_seconds(case, increment_seconds)
    folder = f"{case.source.stem}{RESULTS}" if folder is None else folder
    refuse_results(folder, overwrite)
    outputs = (Drawing(film=film, pictures=pictures),) if outputs is None else outputs
    with _begun(case, outputs):
        with clock.counting("read"), Waiting(f"reading the blocks of {case.source.name}"):
            assembly = case_assembly(case)
        with clock.counting("solve"):
            run = planned(case, assembly)
        try:
            results = ResultsFolder(
                folder,
                assembly,
                record=record_of(case),
                overwrite=overwrite,
                parameter=run.course.parameter,
                vtu=viewer_format(case),
                ties=run.given.ties,
            )
            results.tell(run.response((), mechanics.Ending(solver.Status.INTERRUPTED)))
        except OSError as error:
            raise OSError(f"cannot write to '{folder}': {_reason(error)}; choose another folder with -o") from None
        limit = case.increment_seconds if increment_seconds is None else increment_seconds
        with _writing(results, outputs):
            return _followed(case, results, run, outputs, clock, limit)


def resume_run(
    folder: str | Path, *, outputs: Sequence[Drawing] | None = None, increment_seconds: float | None = None
) -> Run:
    """Go on with a run that was stopped, from its results folder alone, to the result it would have had.

    A settlement and a pushover go on from their last equilibrium, limit loads behind the last that was found; a
    settlement that comes before them and had not ended starts again. Files of the case that have changed are named in a
    warning, and not read again. Of a run that has finished, what is not drawn yet is drawn.

    Parameters
    ----------
    folder : str or Path
    outputs : sequence of Drawing, optional
        As in :func:`run_case`; everything by default.
    increment_seconds : float, optional [s]
        What an increment may take, by default what it takes, whatever the case says.

    Returns
    -------
    Run

    Raises
    ------
    ValueError
        If the folder holds no run, or one that was made from Python and cannot be followed again.
    """
    folder = Path(folder)
    record, case = read_record(folder), stored_case(folder)
    outputs = (Drawing(),) if outputs is None else outputs
    finished = _finished(folder)
    if finished is not None:
        with _resumable(folder):
            response = open_results(folder)
            if restore_grids(folder, response.assembly, response.increments, viewer_format(case)):
                write_end(folder, response, viewer_format(case))
            absent = [output for output in outputs if not output.is_written(case, folder)]
            missing = _made(absent, case, response, folder, Clock())
        return Run(response, folder, finished, missing, had_finished=True)
    for note in record.changes(checksum_of_files):
        warnings.warn(note, stacklevel=2)
    kind = KINDS[case.analysis]
    with _begun(case, outputs):
        parameter, vtu = kind.course(case).parameter, viewer_format(case)
        try:
            results, checkpoint = ResultsFolder.reopened(folder, parameter, kind.checkpoint, vtu)
        except OSError as error:
            raise _write_error(folder, error) from None
        run = planned(case, results.assembly, checkpoint, tuple(results.increments), results.ties)
        with _writing(results, outputs):
            return _followed(case, results, run, outputs, Clock(), increment_seconds)


def _finished(folder: Path) -> dict[str, Any] | None:
    """Read the summary of a run that came to its end; None where it was stopped."""
    if not (folder / "summary.json").is_file():
        return None
    summary: dict[str, Any] = read_json(folder / "summary.json")
    return None if summary["status"] == solver.Status.INTERRUPTED else summary


def _made(
    outputs: Sequence[Drawing], case: Case, response: solver.Response, folder: Path, clock: Clock
) -> tuple[str, ...]:
    """Make what is wanted beside the numbers."""
    return tuple(missing for output in outputs for missing in output.finish(case, response, folder, clock))


@contextmanager
def _resumable(folder: Path) -> Iterator[None]:
    """Say to whoever interrupts what is not written or drawn yet by which command it is."""
    try:
        yield
    except KeyboardInterrupt:
        raise RunInterrupted(
            f"interrupted; what is not solved, written or drawn yet is by: {resume_command(folder)}"
        ) from None


@contextmanager
def _begun(case: Case, outputs: Sequence[Drawing]) -> Iterator[None]:
    """Have the outputs of a case begin, and end with it."""
    for output in outputs:
        if not isinstance(output, Drawing):
            raise TypeError(f"one of the outputs is {output!r}; give film or pictures, or outputs=() for numbers alone")
    try:
        for output in outputs:
            output.begin(case)
        yield
    finally:
        for output in outputs:
            output.close()


@contextmanager
def _writing(results: ResultsFolder, outputs: Sequence[Drawing]) -> Iterator[None]:
    """Say what to do where writing to a results folder is interrupted, or that is full or gone."""
    try:
        with _resumable(results.path):
            yield
    except OSError as error:
        for output in outputs:
            # They may have half-written files, too.
            output.close()
        raise _write_error(results.path, error) from None
    finally:
        # The frames of an error may hold the results for long.
        results.release()


def _followed(
    case: Case,
    results: ResultsFolder,
    run: AnalysisRun,
    outputs: Sequence[Drawing],
    clock: Clock,
    increment_seconds: float | None,
) -> Run:
    """Follow the increments to their end or to Ctrl-C, write each, and draw what came out."""
    folder = results.path
    progress = Progress(run.course, assembly=results.assembly, count=len(results.increments))
    began = time.perf_counter()

    def in_time(state: mechanics.PathState) -> None:
        if increment_seconds is not None and time.perf_counter() - began > increment_seconds:
            what = f"an increment took more than {increment_seconds:g} s (increment_seconds)"
            raise IncrementTooLong(f"{what}: {progress.doing(state)}")

    run.given.listeners.extend([progress.step, in_time])
    ending = mechanics.Ending(solver.Status.INTERRUPTED, "interrupted by the user")
    progress.watch()
    try:
        for increment in clock.each("solve", run.steps):
            with clock.counting("write"):
                results.add(increment)
            run.recorded(results.increments)
            phase = f"phase {increment.phase + 1}, " if len(phases_of(run.course)) > 1 else ""
            for note in increment.notes:
                warnings.warn(f"{phase}{note}", stacklevel=2)
            progress.increment(increment)
            began = time.perf_counter()
        ending = run.steps.ending
    except KeyboardInterrupt:
        run.steps.close()
    except IncrementTooLong as reason:
        ending = mechanics.Ending(solver.Status.INTERRUPTED, str(reason))
    finally:
        progress.done()
    response = run.response(results.increments, ending)
    missing: tuple[str, ...] = ()
    with clock.counting("write"):
        summary = finish(results, response)
    # Waiting for the disk takes no processor: it goes on while the pictures are drawn.
    with ThreadPoolExecutor(1) as waiting:
        flushed = waiting.submit(results.flush)
        if ending.stop is not solver.Status.INTERRUPTED:
            missing = _made(outputs, case, response, folder, clock)
        flushed.result()
    return Run(response, folder, summary, missing, stages=dict(clock.seconds))


def _write_error(folder: Path, error: OSError) -> OSError:
    """Remove half-written files when the disk is full or gone in the middle of a run; returns the error to raise."""
    if not folder.is_dir():
        return OSError(
            f"'{folder}' was moved or removed during the run; go on with it where it is now by blockvis run --resume "
            "FOLDER, or run the case again"
        )
    for half in folder.rglob(PARTIAL):
        half.unlink(missing_ok=True)
    return OSError(
        f"could not write to '{folder}': {_reason(error)}; what is there stays as it is: make room and go on with "
        f"{resume_command(folder)}"
    )


def _reason(error: OSError) -> str:
    return error.strerror or str(error).strip().partition("\n")[0]
