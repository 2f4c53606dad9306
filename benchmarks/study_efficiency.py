"""How much of two cores a study uses, and what one run costs besides its own work.

    python benchmarks/study_efficiency.py [--workers 2] [--runs 64]

Runs of an arch, each with its own friction and voussoirs, first one after another in this process, then as a study on
Dask; every worker has imported what it needs before the clock starts. Printed are, for the study,

    efficiency = time of the same runs in one process / (workers × wall time of the study)

the same in processor time, which a busy machine does not change (one process / workers, scheduler and recording),
and the overhead per run: the rest of the workers' time, shared out among the runs. Use a machine that does nothing
else: the time in one process is processor time, which a busy machine does not lengthen, the wall time is what it is.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from blockvis.studies import campaign
from blockvis.studies.campaign import carry_out, local_cluster
from blockvis.studies.run_one import run_once
from blockvis.studies.study_file import read_study
from blockvis.studies.study_folder import StudyFolder

if TYPE_CHECKING:
    from distributed import Client


CASE = {"geometry": {"layout": "arch"}, "settlement": {"direction": [1, 0], "increment": 0.01, "limit": 0.5}}


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--workers", type=int, default=2)
    options.add_argument("--runs", type=int, default=64)
    given = options.parse_args()
    study = read_study(
        {
            "study": {
                "case": CASE,
                "runs": given.runs,
            },
            "parameters": {
                "material.friction_coefficient": {"distribution": "uniform", "lower": 0.6, "upper": 1.0},
            },
            "imperfections": [{"kind": "vertices", "distribution": "normal", "deviation": 0.003}],
        }
    )
    orders = [study.order(run) for run in range(study.n_runs)]
    arguments = (study.values, str(study.case_source))
    run_once(*arguments, orders[0], study.n_seeded)  # what is imported and compiled once
    started, work = time.perf_counter(), time.process_time()
    for order in orders:
        run_once(*arguments, order, study.n_seeded)
    work, alone = time.process_time() - work, time.perf_counter() - started
    with tempfile.TemporaryDirectory() as folder, local_cluster(given.workers) as client:
        records = StudyFolder(Path(folder) / "study", study)
        there = sum(client.run(time.process_time).values())
        started, here = time.perf_counter(), time.process_time()
        carry_out(records, range(study.n_runs), client, progress=False)
        wall, here = time.perf_counter() - started, time.process_time() - here
        there = sum(client.run(time.process_time).values()) - there
        inside = sum(row["seconds"] for row in records.rows.values())
        cost = per_empty_run(Path(folder), client)
    n = study.n_runs
    print(f"runs                                 {n:10d}")
    print(f"workers                              {given.workers:10d}")
    print(f"one process, processor time          {work:10.2f} s   {1e3 * work / n:8.1f} ms per run")
    print(f"one process, wall time               {alone:10.2f} s")
    print(f"study, wall time                     {wall:10.2f} s")
    print(f"study, time inside runs              {inside:10.2f} s   {1e3 * inside / n:8.1f} ms per run")
    print(f"scheduler and rows, processor time   {here:10.2f} s   {1e3 * here / n:8.1f} ms per run")
    print(f"workers, processor time              {there:10.2f} s   {1e3 * there / n:8.1f} ms per run")
    print(f"efficiency in processor time         {work / (there + here):10.3f}")
    print(f"efficiency                           {work / (given.workers * wall):10.3f}")
    print(f"overhead besides the runs            {1e3 * (given.workers * wall - inside) / n:10.2f} ms per run")
    print(f"scheduler and rows, empty runs       {1e3 * cost:10.2f} ms of processor time per run")


def per_empty_run(folder: Path, client: Client) -> float:
    """Processor time [s] that scheduler, client and study folder take for a run that does nothing."""
    study = read_study(
        {
            "study": {"case": CASE, "runs": 600, "method": "random"},
            "parameters": {"material.friction_coefficient": {"distribution": "uniform", "lower": 0.6, "upper": 1.0}},
        }
    )
    row, shape = run_once(study.values, str(study.case_source), study.order(0), study.n_seeded)
    original, campaign.run_once = campaign.run_once, partial(_nothing, row, shape)
    try:
        records = StudyFolder(folder / "empty", study)
        started = time.process_time()
        carry_out(records, range(study.n_runs), client, progress=False)
        return (time.process_time() - started) / study.n_runs
    finally:
        campaign.run_once = original


def _nothing(row: dict[str, Any], shape: bytes, values: Any, source: str, order: Any, *_: Any) -> Any:
    return {**row, "run": order["run"]}, shape


if __name__ == "__main__":
    main()
