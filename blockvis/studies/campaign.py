"""Campaign: the runs of a study on Dask, one task per run; failures of runs and workers are recorded."""

from __future__ import annotations

import glob
import logging
import multiprocessing
import queue
import sys
import time
import uuid
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import CancelledError
from contextlib import ExitStack, closing, contextmanager, suppress
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

from blockvis.results.record import read_json
from blockvis.runs.progress import StudyProgress
from blockvis.system.extras import require
from blockvis.system.processes import cores

from .run_one import failed_row, run_once
from .study_file import Study, read_study
from .study_folder import StudyFolder, has_failed

if TYPE_CHECKING:
    import pandas as pd
    from distributed import Client, Future

#: Runs that the scheduler holds at a time: enough for a thousand workers, and few for its memory.
WINDOW = 2000

#: Most finished runs that are recorded together.
BATCH = 500

#: Seconds to wait for a scheduler to answer, for the first worker, and for a worker to return when all are lost.
ANSWER, FIRST_WORKER, LAST_WORKER = 10.0, 60.0, 120.0

#: Seconds between two tables that are written during a study.
TABLE_EVERY = 60.0


def study(
    source: str | Path | Mapping[str, Any] | Study,
    folder: str | Path | None = None,
    *,
    scheduler: str | None = None,
    workers: int | None = None,
    force: bool = False,
    retry_failed: bool = False,
    progress: bool = True,
) -> pd.DataFrame:
    """Carry out a study, or the rest of one that was interrupted, and return its table.

    Parameters
    ----------
    source : str, Path, mapping or Study
        The study file, or its content.
    folder : str or Path, optional
        Folder of rows, table and pictures; the name of the study with "-study" in the working directory by default.
    scheduler : str, optional
        Address of a Dask scheduler, ``tcp://host:8786``; by default a cluster on this machine is started.
    workers : int, optional
        Processes of the cluster of this machine; one per core by default.
    force : bool
        Whether runs of another study in the folder are deleted.
    retry_failed : bool
        Whether runs that failed before are repeated.
    progress : bool

    Returns
    -------
    pandas.DataFrame
        A row per run; `docs/results.md` names its columns.

    Raises
    ------
    ValueError
        For bad input or a scheduler that does not answer, before anything is started.
    ConnectionError
        If the scheduler or all workers are lost; finished runs are kept, and the same call continues.
    MissingExtra
        If the packages of the extra ``studies`` are not installed, before anything is started.

    Notes
    -----
    In a script, call it under ``if __name__ == "__main__":``, because each worker of this machine imports the script.
    """
    if "__mp_main__" in sys.modules and multiprocessing.parent_process() is not None:
        raise SystemExit('blockvis: in a script, call blockvis.study under: if __name__ == "__main__":')
    require("studies", "studies")
    plan = source if isinstance(source, Study) else read_study(source)
    if workers is not None and workers < 1:
        raise ValueError(f"workers is {workers}; give at least 1")
    for run in plan.keep:
        if not 0 <= run < plan.n_runs:
            raise ValueError(f"keep names run {run}; runs of {plan.source} are numbered from 0 to {plan.n_runs - 1}")
    folder = Path(f"{plan.source.stem}-study") if folder is None else Path(folder)
    with ExitStack() as ends:
        if scheduler is None:
            records = ends.enter_context(closing(StudyFolder(folder, plan, force=force)))
            todo = records.missing(retry_failed=retry_failed)
            if todo:
                with local_cluster(min(workers or cores(), len(todo))) as client:
                    carry_out(records, todo, client, progress)
        else:
            from blockvis.case_files.read import case_of

            # The folder is not changed unless the scheduler answers.
            file = case_of(plan.values, plan.case_source).file
            with existing_cluster(scheduler, "" if file is None else str(file)) as client:
                records = ends.enter_context(closing(StudyFolder(folder, plan, force=force)))
                carry_out(records, records.missing(retry_failed=retry_failed), client, progress)
        return _finish(records)


def _finish(records: StudyFolder) -> pd.DataFrame:
    from .pictures import draw_study
    from .summary import summary_of

    table = records.write_table()
    records.write_summary(summary_of(records.study, table))
    draw_study(records, table)
    for run in sorted({*records.study.keep}):
        _keep(records, run)
    return table


def _keep(records: StudyFolder, run: int) -> None:
    """Write the results folder of a run, repeated on this machine from a case file with the values of the run."""
    import tomli_w

    from blockvis.case_files.read import parse_case
    from blockvis.runs.run import run_case

    folder = records.folder / "results" / f"run_{run:06d}"
    summary = folder / "summary.json"
    if summary.is_file() and not has_failed(read_json(summary)):
        return
    values = records.study.values_of(run)
    source = records.study.case_source
    for table, key in (("geometry", "file"), ("output", "underlay")):
        if key in values.get(table, {}):
            values[table][key] = str(source.parent / values[table][key])
    folder.parent.mkdir(parents=True, exist_ok=True)
    case_file = folder.with_suffix(".toml")
    case_file.write_text(tomli_w.dumps(values), encoding="utf-8")
    run_case(parse_case(case_file.read_text(encoding="utf-8"), case_file), folder, overwrite=True)


@contextmanager
def local_cluster(workers: int) -> Iterator[Client]:
    """Start a cluster on this machine: processes of one thread each, restarted when they die."""
    import dask
    from distributed import Client, LocalCluster

    settings = {
        # No runs wait on a worker, so that a run that kills its worker loses no other run.
        "distributed.scheduler.worker-saturation": 1.0,
        "distributed.scheduler.allowed-failures": 1,
        # Monitors that are not used here would take processor time from the runs.
        "distributed.worker.profile.enabled": False,
        "distributed.admin.system-monitor.interval": "5s",
        "distributed.admin.tick.interval": "1s",
        # Checking memory ten times a second costs two per cent of a core per worker; runs grow slowly.
        "distributed.worker.memory.monitor-interval": "1s",
        "distributed.scheduler.active-memory-manager.start": False,
    }
    with dask.config.set(settings):
        try:
            cluster = LocalCluster(
                n_workers=workers,
                threads_per_worker=1,
                processes=True,
                dashboard_address="127.0.0.1:0",
                silence_logs=logging.CRITICAL,
            )
        except RuntimeError as error:
            raise ValueError(
                f"the workers could not be started ({error}); in a script, call blockvis.study under "
                'if __name__ == "__main__":'
            ) from None
        with cluster, Client(cluster) as client:
            client.register_plugin(_ignore_interrupts())
            client.run(_probe, "")
            yield client


def _ignore_interrupts() -> Any:
    """Make a plugin with which workers ignore Ctrl-C of their terminal: the study itself stops them."""
    import signal

    from distributed import WorkerPlugin

    class IgnoreInterrupts(WorkerPlugin):
        name = "blockvis-ignore-interrupts"

        def setup(self, worker: Any) -> None:
            signal.signal(signal.SIGINT, signal.SIG_IGN)

    return IgnoreInterrupts()


@contextmanager
def existing_cluster(address: str, file: str) -> Iterator[Client]:
    """Find a cluster by the address of its scheduler, and check that its workers can do the runs and see a layout."""
    from distributed import Client

    try:
        client = Client(address, timeout=ANSWER)
    except (OSError, ValueError) as error:
        raise ValueError(
            f"no Dask scheduler answers at '{address}' ({error}); start one with: dask scheduler, and workers with: "
            f"dask worker {address} --nthreads 1"
        ) from None
    with client:
        try:
            client.wait_for_workers(1, timeout=FIRST_WORKER)
        except TimeoutError:
            raise ValueError(
                f"the scheduler at '{address}' has no workers; start some with: dask worker {address} --nthreads 1"
            ) from None
        _check_workers(client, file)
        yield client


def _check_workers(client: Client, file: str) -> None:
    """Refuse workers that have another version of blockvis, or cannot read the layout file."""
    try:
        answers = client.run(_probe, file)
    except Exception as error:  # noqa: BLE001 - whatever it raises, this worker cannot run blockvis
        raise ValueError(
            f"a worker cannot run blockvis ({error}); install blockvis {version('blockvis')} on all workers"
        ) from None
    for worker, (theirs, sees) in answers.items():
        if theirs != version("blockvis"):
            raise ValueError(f"worker {worker} has blockvis {theirs}, this is {version('blockvis')}; install the same")
        if not sees:
            raise ValueError(f"worker {worker} does not see '{file}'; put the case where all workers find it")


def _probe(file: str) -> tuple[str, bool]:
    """Version of blockvis on a worker, and whether it sees a file; this module imports all that a run needs."""
    return version("blockvis"), not file or Path(file).exists() or bool(glob.glob(file, recursive=True))


def carry_out(records: StudyFolder, todo: Sequence[int], client: Client, progress: bool) -> None:
    """Make the runs and record each row on the disk before the next is taken."""
    bar = StudyProgress(records.study.n_runs, records.study.n_runs - len(todo), shown=progress)
    suspects: list[int] = []
    written = time.monotonic()
    try:
        window = max(WINDOW, 2 * sum(client.nthreads().values()))
        for batch in _batches(records.study, todo, client, window):
            suspects += [run for run, row, _ in batch if row is None]
            _record(records, bar, [(row, shape) for _, row, shape in batch if row is not None])
            if time.monotonic() - written > TABLE_EVERY:
                records.write_table()
                written = time.monotonic()
        # Runs whose workers died may not be the cause: each is tried once more, alone.
        for batch in _batches(records.study, suspects, client, 1):
            rows = [(row or failed_row(records.study.order(run), KILLED), shape) for run, row, shape in batch]
            _record(records, bar, rows)
    except BaseException:
        records.write_table()
        raise
    finally:
        bar.done()


def _record(records: StudyFolder, bar: StudyProgress, rows: Sequence[tuple[dict[str, Any], bytes]]) -> None:
    records.add(rows)
    for row, _ in rows:
        bar.finished(failed=has_failed(row))


#: Message of a run that no worker survives.
KILLED = "every worker that took this run died, perhaps out of memory; make it alone with --keep to see why"

_Finished = tuple[int, dict[str, Any] | None, bytes]


def _batches(plan: Study, todo: Sequence[int], client: Client, window: int) -> Iterator[list[_Finished]]:
    """Yield runs as they finish: number, row, shape of the mechanism; without a row if the workers died."""
    finished: queue.SimpleQueue[tuple[int, Future]] = queue.SimpleQueue()
    token = uuid.uuid4().hex[:8]
    waiting = iter(todo)
    submitted: dict[int, Future] = {}

    def fill() -> None:
        while len(submitted) < window:
            run = next(waiting, None)
            if run is None:
                return
            future = client.submit(
                run_once,
                plan.values,
                str(plan.case_source),
                plan.order(run),
                plan.n_seeded,
                plan.seconds,
                key=f"blockvis-{token}-{run}",
                pure=False,
            )
            submitted[run] = future
            future.add_done_callback(lambda future, run=run: finished.put((run, future)))

    fill()
    last_worker = time.monotonic()
    while submitted:
        try:
            done = [finished.get(timeout=1.0)]
        except queue.Empty:
            last_worker = _last_worker_seen(client, last_worker)
            continue
        # Runs that have finished meanwhile are taken with it: one message and one write for many short runs.
        while len(done) < BATCH and not finished.empty():
            done.append(finished.get())
        for run, _ in done:
            del submitted[run]
        yield _gathered(plan, client, done)
        for _, future in done:
            future.release()
        fill()


def _gathered(plan: Study, client: Client, done: Sequence[tuple[int, Future]]) -> list[_Finished]:
    from distributed import KilledWorker

    if len(done) > 1 and all(future.status == "finished" for _, future in done):
        # If gathering fails, the runs are taken one by one.
        with suppress(Exception):
            found = client.gather([future for _, future in done])
            return [(run, *result) for (run, _), result in zip(done, found, strict=True)]
    rows: list[_Finished] = []
    for run, future in done:
        try:
            row, shape = future.result()
        except KilledWorker:
            row, shape = None, b""
        except (CancelledError, OSError):
            raise ConnectionError(f"the scheduler does not answer any more; {_GO_ON}") from None
        except Exception as error:  # noqa: BLE001 - an error of loading or sending is this run's result
            row, shape = failed_row(plan.order(run), f"{type(error).__name__}: {error}"), b""
        rows.append((run, row, shape))
    return rows


_GO_ON = "finished runs are kept, the same command goes on with the others"


def _last_worker_seen(client: Client, last_worker: float) -> float:
    """Return the time when a worker was last seen; raise ``ConnectionError`` if that is too long ago."""
    try:
        workers = client.nthreads() if client.status == "running" else None
    except OSError:
        workers = None
    if workers is None:
        raise ConnectionError(f"the scheduler does not answer any more; {_GO_ON}")
    if workers:
        return time.monotonic()
    if time.monotonic() - last_worker > LAST_WORKER:
        raise ConnectionError(f"all workers are gone; {_GO_ON}")
    return last_worker
