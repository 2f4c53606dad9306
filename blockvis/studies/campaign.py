"""Campaign: the runs of a study on Dask, one run one task, whatever becomes of a run or of a worker."""

from __future__ import annotations

import logging
import multiprocessing
import queue
import sys
import time
import uuid
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import CancelledError
from contextlib import contextmanager, suppress
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

from blockvis.runs.progress import StudyProgress

from .run_one import failed_row, run_once
from .study_file import Study, read_study
from .study_folder import Ledger, has_failed

if TYPE_CHECKING:
    import pandas as pd
    from distributed import Client, Future

#: Runs given to the scheduler at a time: enough for a thousand workers, little for its memory.
WINDOW = 2000

#: Finished runs that are recorded together at most.
BATCH = 500

#: Seconds to wait for a scheduler to answer, for the first worker, and for one to come back when all are gone.
ANSWER, FIRST_WORKER, LAST_WORKER = 10.0, 60.0, 120.0

#: Seconds between two tables on the way.
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
    """Carries out a study, or what is left of it, and gives its table.

    Parameters
    ----------
    source : str, Path, mapping or Study
        The study file, or what would stand in it.
    folder : str or Path, optional
        Where rows, table and pictures go; the name of the study with "-study" in the working directory by default.
    scheduler : str, optional
        Address of a Dask scheduler, ``tcp://host:8786``; by default a cluster of this machine's own.
    workers : int, optional
        Processes of the cluster of this machine; one per core by default.
    force : bool
        Whether runs of another study in the folder may be thrown away.
    retry_failed : bool
        Whether runs that failed before are made again.
    progress : bool

    Returns
    -------
    pandas.DataFrame
        A row per run; see the README for its columns.

    Raises
    ------
    ValueError
        For bad input or a scheduler that does not answer, before anything is started.
    ConnectionError
        If the scheduler or all workers are lost; finished runs are kept, and the same call goes on.

    Notes
    -----
    In a script, call it under ``if __name__ == "__main__":``, because each worker of this machine imports the script.
    """
    return run_study(
        source,
        folder,
        scheduler=scheduler,
        workers=workers,
        force=force,
        retry_failed=retry_failed,
        progress=progress,
    ).write_table()


def run_study(
    source: str | Path | Mapping[str, Any] | Study,
    folder: str | Path | None = None,
    *,
    scheduler: str | None = None,
    workers: int | None = None,
    force: bool = False,
    retry_failed: bool = False,
    progress: bool = True,
    keep: Sequence[int] = (),
) -> Ledger:
    """As :func:`study`, but gives the ledger; ``keep`` adds to the runs whose results folder is written."""
    if "__mp_main__" in sys.modules and multiprocessing.parent_process() is not None:
        raise SystemExit('blockvis: in a script, call blockvis.study under: if __name__ == "__main__":')
    plan = source if isinstance(source, Study) else read_study(source)
    if workers is not None and workers < 1:
        raise ValueError(f"workers is {workers}; give at least 1")
    for run in keep:
        if not 0 <= run < plan.n_runs:
            raise ValueError(f"run {run} is to be kept, but runs are numbered from 0 to {plan.n_runs - 1}")
    folder = Path(f"{plan.source.stem}-study") if folder is None else Path(folder)
    if scheduler is None:
        ledger = Ledger(folder, plan, force=force)
        todo = ledger.missing(retry_failed=retry_failed)
        if todo:
            with local_cluster(min(workers or _cores(), len(todo))) as client:
                carry_out(ledger, todo, client, progress)
    else:
        # The scheduler answers before the folder is touched.
        with _existing_cluster(scheduler, plan) as client:
            ledger = Ledger(folder, plan, force=force)
            carry_out(ledger, ledger.missing(retry_failed=retry_failed), client, progress)
    _finish(ledger, sorted({*plan.keep, *keep}))
    return ledger


def _finish(ledger: Ledger, keep: Sequence[int]) -> None:
    from .pictures import draw_study
    from .summary import summary_of

    table = ledger.write_table()
    ledger.write_summary(summary_of(ledger.study, table))
    draw_study(ledger, table)
    for run in keep:
        _keep(ledger, run)


def _keep(ledger: Ledger, run: int) -> None:
    """The whole results folder of a run, made again on this machine from a case file that stands for itself."""
    import tomli_w

    from blockvis.cases.case import parse_case
    from blockvis.runs.run import run_case

    folder = ledger.folder / "results" / f"run_{run:06d}"
    if (folder / "summary.json").is_file():
        return
    values = ledger.study.values_of(run)
    source = ledger.study.case_source
    geometry = values.get("geometry", {})
    if "file" in geometry:
        geometry["file"] = str(source.parent / geometry["file"])
    folder.parent.mkdir(parents=True, exist_ok=True)
    case_file = folder.with_suffix(".toml")
    case_file.write_text(tomli_w.dumps(values), encoding="utf-8")
    run_case(parse_case(case_file.read_text(encoding="utf-8"), case_file), folder, overwrite=True)


def _cores() -> int:
    from dask.system import CPU_COUNT

    return int(CPU_COUNT)


@contextmanager
def local_cluster(workers: int) -> Iterator[Client]:
    """A cluster of this machine: processes of one thread each, restarted when they die."""
    import dask
    from distributed import Client, LocalCluster

    settings = {
        # A worker holds one run and no other waits there, so that a run that kills its worker takes no other along.
        "distributed.scheduler.worker-saturation": 1.0,
        "distributed.scheduler.allowed-failures": 1,
        # What nobody looks at here takes processor time from the runs.
        "distributed.worker.profile.enabled": False,
        "distributed.admin.system-monitor.interval": "5s",
        "distributed.admin.tick.interval": "1s",
        # Ten looks a second at the memory cost two per cent of a core each; runs grow slowly.
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
            client.register_plugin(_deaf_plugin())
            client.run(_probe, "")
            yield client


def _deaf_plugin() -> Any:
    """What keeps Ctrl-C in a terminal from the workers, which get it too: the study itself stops them."""
    import signal

    from distributed import WorkerPlugin

    class Deaf(WorkerPlugin):
        name = "blockvis-deaf"

        def setup(self, worker: Any) -> None:
            signal.signal(signal.SIGINT, signal.SIG_IGN)

    return Deaf()


@contextmanager
def _existing_cluster(address: str, plan: Study) -> Iterator[Client]:
    from distributed import Client

    from blockvis.cases.case import case_of

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
        file = case_of(plan.values, plan.case_source).file
        _check_workers(client, "" if file is None else str(file))
        yield client


def _check_workers(client: Client, file: str) -> None:
    """Refuses workers that have another blockvis, or do not see the layout file."""
    try:
        answers = client.run(_probe, file)
    except Exception as error:  # noqa: BLE001 - whatever a foreign worker raises, it cannot work for us
        raise ValueError(
            f"a worker cannot run blockvis ({error}); install blockvis {version('blockvis')} on all workers"
        ) from None
    for worker, (theirs, sees) in answers.items():
        if theirs != version("blockvis"):
            raise ValueError(f"worker {worker} has blockvis {theirs}, this is {version('blockvis')}; install the same")
        if not sees:
            raise ValueError(f"worker {worker} does not see '{file}'; put the case where all workers find it")


def _probe(file: str) -> tuple[str, bool]:
    """Version of a worker, and whether it sees a file; it has imported all that a run needs when it answers."""
    return version("blockvis"), not file or Path(file).is_file()


def carry_out(ledger: Ledger, todo: Sequence[int], client: Client, progress: bool) -> None:
    """Makes the runs; every row is on the disk before the next is taken."""
    bar = StudyProgress(ledger.study.n_runs, ledger.study.n_runs - len(todo), shown=None if progress else False)
    suspects: list[int] = []
    written = time.monotonic()
    try:
        window = max(WINDOW, 2 * sum(client.nthreads().values()))
        for batch in _batches(ledger.study, todo, client, window):
            suspects += [run for run, row, _ in batch if row is None]
            _record(ledger, bar, [(row, shape) for _, row, shape in batch if row is not None])
            if time.monotonic() - written > TABLE_EVERY:
                ledger.write_table()
                written = time.monotonic()
        # A worker that dies may take runs along that only waited there: those suspected get a last try, each alone.
        for batch in _batches(ledger.study, suspects, client, 1):
            rows = [(row or failed_row(ledger.study.order(run), KILLED), shape) for run, row, shape in batch]
            _record(ledger, bar, rows)
    except BaseException:
        ledger.write_table()
        raise
    finally:
        bar.done()


def _record(ledger: Ledger, bar: StudyProgress, rows: Sequence[tuple[dict[str, Any], bytes]]) -> None:
    ledger.add(rows)
    for row, _ in rows:
        bar.finished(failed=has_failed(row))


#: Why a run that no worker survives has no result.
KILLED = "every worker that took this run died, perhaps out of memory; make it alone with --keep to see why"

_Finished = tuple[int, dict[str, Any] | None, bytes]


def _batches(plan: Study, todo: Sequence[int], client: Client, window: int) -> Iterator[list[_Finished]]:
    """The runs as they finish: number, row, shape; without a row where the workers died."""
    finished: queue.SimpleQueue[tuple[int, Future]] = queue.SimpleQueue()
    token = uuid.uuid4().hex[:8]
    waiting = iter(todo)
    flying: dict[int, Future] = {}

    def tell(run: int) -> Callable[[Future], None]:
        return lambda future: finished.put((run, future))

    def fill() -> None:
        while len(flying) < window:
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
            flying[run] = future
            future.add_done_callback(tell(run))

    fill()
    last_worker = time.monotonic()
    while flying:
        try:
            done = [finished.get(timeout=1.0)]
        except queue.Empty:
            last_worker = _still_there(client, last_worker)
            continue
        # Those that have finished meanwhile come along: one message and one write for many short runs.
        while len(done) < BATCH and not finished.empty():
            done.append(finished.get())
        for run, _ in done:
            del flying[run]
        yield _gathered(plan, client, done)
        for _, future in done:
            future.release()
        fill()


def _gathered(plan: Study, client: Client, done: Sequence[tuple[int, Future]]) -> list[_Finished]:
    from distributed import KilledWorker

    if len(done) > 1 and all(future.status == "finished" for _, future in done):
        # Anything that goes wrong is looked at one by one.
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
        except Exception as error:  # noqa: BLE001 - what a worker could not even load or send is this run's result
            row, shape = failed_row(plan.order(run), f"{type(error).__name__}: {error}"), b""
        rows.append((run, row, shape))
    return rows


_GO_ON = "finished runs are kept, the same command goes on with the others"


def _still_there(client: Client, last_worker: float) -> float:
    """The time when a worker was last seen; raises ConnectionError when that is too long ago."""
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
