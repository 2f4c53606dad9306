"""Studies on Dask: known distributions, failures, interruptions, and workers that die."""

import asyncio
import json
import os
import re
import signal
import subprocess
import sys
import time
from itertools import pairwise
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import shapely
from structures import rectangle, started_cluster

import blockvis
import solver
from blockvis.cli import main
from blockvis.studies import campaign
from blockvis.studies.fragility import fragility_of
from blockvis.studies.pictures import draw_mechanisms, draw_scatter
from blockvis.studies.run_one import run_once
from blockvis.studies.study_file import read_study
from blockvis.studies.study_folder import StudyFolder, finished_runs
from blockvis.studies.summary import in_words, summary_of
from solver import mechanics

#: A block 0.5 × 1 on a ground that tilts: it overturns at atan(0.5) or slides at atan(μ), whichever is first.
TILT = {
    "geometry": {"layout": "column", "parameters": {"blocks": 1, "width": 0.5, "block_height": 1.0}},
    "settlement": {
        "rotation_centre": [0.0, 0.0],
        "rotation": -1.0,
        "increment": 0.05,
        "limit": 0.44,
        "tolerance": 1e-4,
    },
    "output": {"animation": False},
}

ARCH = """
[geometry]
layout = "arch"
[geometry.parameters]
voussoirs = 8
[material]
friction_coefficient = 0.6
[settlement]
direction = [1, 0]
increment = 0.02
limit = 0.3
[output]
animation = false
"""

STUDY = """
[study]
case = "case.toml"
runs = 24
seed = 3
[parameters]
"material.friction_coefficient" = { name = "friction", distribution = "uniform", lower = 0.4, upper = 0.8 }
[[imperfections]]
kind = "vertices"
distribution = "normal"
deviation = 0.002
"""


@pytest.fixture
def arches(tmp_path):
    (tmp_path / "case.toml").write_text(ARCH, encoding="utf-8")
    path = tmp_path / "study.toml"
    path.write_text(STUDY, encoding="utf-8")
    return path


def _made_here(study, folder, runs, seconds=None):
    """Some runs of a study, without any cluster."""
    records = StudyFolder(folder, study)
    for run in runs:
        records.add([run_once(study.values, str(study.case_source), study.order(run), study.n_seeded, seconds)])
    records.close()
    return records


#: A block 0.5 × 1 that is pushed by a part of its weight: it overturns at 0.5 or slides at μ, whichever is less.
PUSHED = {
    "geometry": {"layout": "column", "parameters": {"blocks": 1, "width": 0.5, "block_height": 1.0}},
    "analysis": {"kind": "limit load"},
    "loads": [{"kind": "live", "weight_fraction": [1.0, 0.0]}],
}


def test_a_study_of_limit_loads_tells_load_multipliers(tmp_path):
    given = {
        "study": {"case": PUSHED, "method": "grid"},
        "parameters": {"material.friction_coefficient": [0.2, 0.4, 0.8]},
    }
    study = read_study(given)
    records = _made_here(study, tmp_path, range(3))
    table = records.table()
    np.testing.assert_allclose(table["load_multiplier"], [0.2, 0.4, 0.5], rtol=1e-6)
    assert (table["bracket_low"] - table["bracket_high"]).abs().max() < 1e-6
    assert table["collapse_displacement"].isna().all()
    summary = summary_of(study, table)
    assert (summary["capacity"], summary["unit"]) == ("load multiplier", "")
    words = "collapse by material.friction_coefficient, 0.2: 0.2; 0.4: 0.4; 0.8: 0.5"
    assert words in in_words(summary)
    assert "load multiplier at collapse" in draw_scatter(study, table, tmp_path / "scatter.svg").read_text("utf-8")


@pytest.mark.slow
def test_a_settlement_that_locks_before_the_load_acts_leaves_its_run_without_result(tmp_path):
    sides = [(-1.0, -1.0, 4.0, 0.0), (0.0, 0.0, 1.0, 0.5), (1.005, 0.0, 2.005, 0.5), (2.01, 0.0, 3.0, 0.5)]
    outlines = [rectangle(*ends) for ends in sides]
    jaws = solver.Assembly.from_outlines(outlines, roles=["fixed", "fixed", "free", "moving"])
    blockvis.save_layout(jaws, tmp_path / "jaws.json")
    case = PUSHED | {"geometry": {"file": str(tmp_path / "jaws.json")}}
    case |= {"settlement": {"direction": [-1.0, 0.0], "increment": 0.004}}
    limits = {"settlement.limit": [0.004, 0.02]}
    study = read_study({"study": {"case": case, "method": "grid"}, "parameters": limits})
    table = _made_here(study, tmp_path / "study", range(2)).table()
    assert table["status"].tolist() == ["collapsed", "failed"]
    summary = summary_of(study, table)
    assert (summary["n_stood"], summary["n_without_result"], summary["broken_off_at"]) == (0, 1, [0.0, 0.0])
    assert summary["furthest_load_multiplier"] == pytest.approx(0.6)
    assert "without result, 1 time: during the settlement: the supports cannot move on" in in_words(summary)


def test_where_no_load_brings_it_down_a_run_stands_beyond_all_others(tmp_path):
    down = {"kind": "live", "weight_fraction": [0.0, -1.0]}
    loads = [PUSHED["loads"], [down]]
    study = read_study({"study": {"case": PUSHED, "method": "grid"}, "parameters": {"loads": loads}})
    table = _made_here(study, tmp_path, range(2)).table()
    assert table["status"].tolist() == ["collapsed", "limit reached"]
    assert table["load_multiplier"].tolist() == [pytest.approx(0.5, rel=1e-6), np.inf]
    curve = fragility_of(table)
    assert (curve.n_stood, curve.probability.tolist()) == (1, [0.5])
    assert "no load multiplier" in in_words(summary_of(study, table.tail(1)) | {"line": []})


@pytest.mark.slow
def test_a_run_that_took_too_long_before_its_limit_load_carries_who_knows_what(tmp_path):
    settling = {"direction": [1.0, 0.0], "increment": 0.1, "limit": 0.2}
    case = PUSHED | {"settlement": settling}
    given = {"study": {"case": case, "method": "grid"}, "parameters": {"material.friction_coefficient": [0.2, 0.4]}}
    study = read_study(given)
    table = _made_here(study, tmp_path, range(2), seconds=0.0).table()
    assert table["status"].tolist() == ["interrupted"] * 2
    # That at the start of the settlement is another one.
    assert table["load_multiplier"].isna().all()
    assert table["bracket_low"].isna().all()
    assert fragility_of(table).probability.tolist() == [0.0]
    # How far it settled is no multiplier.
    table["last_settlement"] = 0.1
    assert summary_of(study, table)["broken_off_at"] == [0.0, 0.0]


@pytest.mark.slow
def test_a_study_of_pushovers_tells_where_the_capacity_is_lost(tmp_path):
    pushed = PUSHED | {
        "analysis": {"kind": "pushover"},
        "control": {"block": "block 1", "direction": [1.0, 0.0], "increment": 0.05, "limit": 0.4},
    }
    given = {"study": {"case": pushed, "method": "grid"}, "parameters": {"material.friction_coefficient": [0.6, 0.8]}}
    table = _made_here(read_study(given), tmp_path, range(2)).table()
    # Its weight stands over its corner where its centroid has moved by half of its width.
    np.testing.assert_allclose(table["collapse_displacement"], 0.25, rtol=1e-2)
    np.testing.assert_allclose(table["load_multiplier"], 0.5, rtol=1e-3)
    np.testing.assert_allclose(table["initial_reaction"], 0.5 * table["total_weight"], rtol=1e-3)
    assert table["unit"].tolist() == ["m", "m"]


@pytest.mark.thorough
def test_a_distribution_known_in_closed_form_from_inside_an_event_loop(tmp_path, scheduler):
    """As in a notebook, where a loop is running; runs that stood up to the limit are no collapse."""
    study = {
        "study": {"case": TILT, "method": "latin hypercube", "runs": 10, "seed": 5},
        "parameters": {
            "material.friction_coefficient": {"name": "mu", "distribution": "uniform", "lower": 0.2, "upper": 0.7}
        },
    }

    async def cell():
        return blockvis.study(study, tmp_path / "out", scheduler=scheduler)

    table = asyncio.run(cell())
    assert len(table) == 10
    limit, mu = 0.44, table["mu"].to_numpy(dtype=float)
    exact = np.arctan(np.minimum(mu, 0.5))
    falls = exact < limit
    assert (table["status"][falls] == "collapsed").all()
    assert (table["status"][~falls] == "limit reached").all()
    assert 3 < falls.sum() < 8
    np.testing.assert_allclose(table["collapse_displacement"][falls].astype(float), exact[falls], atol=1.1e-4)
    assert (table["bracket_high"] - table["bracket_low"])[falls].max() <= 1.001e-4
    assert table["collapse_displacement"][~falls].isna().all()
    np.testing.assert_allclose(table["last_settlement"][~falls].astype(float), limit)
    assert table["mechanism_class"][falls].unique().tolist() == ["sliding ground|block 1"]
    curve = fragility_of(table)
    assert curve.n_stood == (~falls).sum()
    # A run in each of 10 strata: at most one step off the distribution of atan(μ).
    at = np.linspace(0.21, 0.43, 12)
    found = [curve.probability[curve.settlement <= x].max(initial=0.0) for x in at]
    np.testing.assert_allclose(found, (np.tan(at) - 0.2) / 0.5, atol=1.001 / 10)
    out = tmp_path / "out"
    stored = pd.read_parquet(out / "table.parquet")
    pd.testing.assert_frame_equal(stored, table, check_dtype=False)
    assert len(pd.read_csv(out / "table.csv")) == 10
    manual = (Path(__file__).parents[2] / "docs" / "results.md").read_text(encoding="utf-8")
    assert [column for column in table if f"`{column}`" not in manual] == ["mu"], "the manual names all others"
    for name in ("fragility.png", "sensitivity.png", "scatter.png", "mechanisms.png", "summary.json"):
        assert (out / name).stat().st_size > 400


@pytest.mark.slow
def test_failed_runs_are_rows_with_their_reason(tmp_path, monkeypatch):
    """On a grid, in one process: a column of no block, and a time too short for any run, which says how far it came."""
    given = {
        "study": {"case": TILT, "method": "grid"},
        "parameters": {"geometry.parameters.blocks": [1, 0], "material.friction_coefficient": [0.3, 0.4]},
    }
    records = _made_here(read_study(given), tmp_path / "out", range(4))
    table = records.write_table()
    assert table["status"].tolist() == ["collapsed", "collapsed", "not built", "not built"]
    assert table["message"].str.contains("blocks is 0").tolist() == [False, False, True, True]
    assert records.missing() == []
    assert records.missing(retry_failed=True) == [2, 3]
    _made_here(read_study(given), tmp_path / "out", [2])
    assert finished_runs(tmp_path / "out") == 4, "a run that is made again is one"
    impatient = {**given, "study": {**given["study"], "seconds": 1e-9}}
    plan = read_study(impatient)
    row, shape = run_once(plan.values, "case", plan.order(0), 0, plan.seconds)
    assert row["status"] == "interrupted"
    assert row["message"] == "took longer than 1e-09 s: let [study] seconds be longer, with --retry-failed"
    assert (row["last_settlement"], row["increments"]) == (0.0, 1)
    assert row["last_reaction"] == pytest.approx(0.0)
    assert shape == b""
    following, calls = mechanics.Increments.__next__, iter(range(100))

    def fail_at_the_fourth(increments):
        if next(calls) == 3:
            raise MemoryError("no room")
        return following(increments)

    monkeypatch.setattr(mechanics.Increments, "__next__", fail_at_the_fourth)
    row, _ = run_once(plan.values, "case", plan.order(0), 0)
    assert (row["status"], row["message"]) == ("solver failed", "MemoryError: no room")
    assert (row["last_settlement"], row["increments"]) == (pytest.approx(0.1), 3)


@pytest.mark.slow
def test_blocks_in_space_are_studied_and_drawn(tmp_path):
    """An arch with a depth whose springer moves out; its tile shows the faces that are turned to the eye."""
    arch = {
        "geometry": {"layout": "extruded arch", "parameters": {"voussoirs": 4, "thickness_ratio": 0.12}},
        "settlement": {"direction": [1.0, 0.0, 0.0], "increment": 0.1, "limit": 1.0, "tolerance": 0.05},
    }
    friction = {"name": "friction", "values": [0.8, 1.0]}
    given = {
        "study": {"case": arch, "method": "grid"},
        "parameters": {"material.friction_coefficient": friction},
    }
    records = _made_here(read_study(given), tmp_path / "out", [1])
    table = records.table()
    assert (table["status"] == "collapsed").all(), table["message"].tolist()
    assert draw_mechanisms(records, table, tmp_path / "mechanisms.png").stat().st_size > 5_000
    with np.load(records.shape_file(table["mechanism_class"][0])) as shape:
        assert shape["vertices"].shape == shape["at_rest"].shape == (shape["offsets"][-1], 2)
        around = [shape["vertices"][first:last] for first, last in pairwise(shape["offsets"])]
        assert all(shapely.LinearRing(ring).is_ccw for ring in around)
        assert len(shape["parts"]) == len(shape["free"]) == len(around)


@pytest.mark.slow
def test_a_study_that_is_killed_and_interrupted_resumes(arches, tmp_path):
    """Killed without warning by SIGKILL, then by Ctrl-C, each time once it has made a run of its own."""
    runs = 20
    arches.write_text(STUDY.replace("runs = 24", f"runs = {runs}"), encoding="utf-8")
    out, command = tmp_path / "out", [sys.executable, "-m", "blockvis", "sweep", "study.toml", "-o", "out"]

    def stopped(by):
        # On a busy machine many runs are recorded at once: their number is not known beforehand.
        before = finished_runs(out)
        process = subprocess.Popen(
            [*command, "--workers", "1"],
            cwd=tmp_path,
            start_new_session=True,
            # Tests that a shell has started in the background ignore Ctrl-C, and so would this process.
            preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
            stderr=subprocess.PIPE,
            text=True,
        )
        deadline = time.monotonic() + 120
        while finished_runs(out) == before and process.poll() is None:
            assert time.monotonic() < deadline
            time.sleep(0.02)
        # As a terminal does: Ctrl-C reaches the workers too.
        (os.killpg if by == signal.SIGINT else os.kill)(process.pid, by)
        return process.wait(timeout=60), process.stderr.read()

    code, _ = stopped(signal.SIGKILL)
    assert code == -signal.SIGKILL
    killed = finished_runs(out)
    code, message = stopped(signal.SIGINT)
    assert code == 130
    assert re.fullmatch(rf"blockvis: interrupted; \d+ of {runs} runs are kept, .* goes on with the others\n", message)
    done = (out / "runs.jsonl").read_bytes()
    assert 0 < killed < done.count(b"\n") < runs
    assert len(pd.read_csv(out / "table.csv")) == done.count(b"\n"), "the table is there too"
    assert main(["sweep", str(arches), "-o", str(out), "--workers", "2"]) == 0
    rows = (out / "runs.jsonl").read_bytes()
    assert rows.startswith(done)
    assert rows.count(b"\n") == runs, "finished runs are not made again"


@pytest.mark.thorough
def test_a_resumed_study_has_the_rows_of_one_run_at_once(arches, tmp_path, capsys, scheduler):
    """A run kept as a folder is a run of the table."""
    out, study = tmp_path / "out", STUDY.replace("runs = 24", "runs = 8")
    arches.write_text(study, encoding="utf-8")
    (tmp_path / "case.toml").write_text(ARCH.replace("increment = 0.02", "increment = 0.05"), encoding="utf-8")
    _made_here(read_study(arches), out, range(3))
    done = (out / "runs.jsonl").read_bytes()
    assert main(["sweep", str(arches), "-o", str(out), "--scheduler", scheduler, "--keep", "5"]) == 0
    printed = capsys.readouterr().out
    assert "8 of 8 runs" in printed
    assert "probability of collapse: 5 %" in printed
    rows = (out / "runs.jsonl").read_bytes()
    assert rows.startswith(done)
    assert rows.count(b"\n") == 8, "finished runs are not made again"
    table = pd.read_parquet(out / "table.parquet")
    assert table["run"].tolist() == list(range(8))
    assert (table["status"] == "collapsed").all()
    again = _made_here(read_study(arches), tmp_path / "one go", [0, 7]).table()
    columns = ["friction", "collapse_displacement", "mechanism_class", "seed"]
    pd.testing.assert_frame_equal(
        again[columns].reset_index(drop=True), table.loc[[0, 7], columns].reset_index(drop=True), check_dtype=False
    )
    kept = json.loads((out / "results" / "run_000005" / "summary.json").read_text(encoding="utf-8"))
    assert kept["collapse_displacement"] == pytest.approx(table.loc[5, "collapse_displacement"], abs=1e-12)
    assert kept["mechanism"] == table.loc[5, "mechanism"], "one word for the mechanism in table and folder"
    response = blockvis.open_results(out / "results" / "run_000005")
    assert response.interfaces.default.friction_coefficient == pytest.approx(table.loc[5, "friction"])

    # Another study in the same folder is refused, and nothing is touched.
    arches.write_text(study.replace("upper = 0.8", "upper = 0.9"), encoding="utf-8")
    assert main(["sweep", str(arches), "-o", str(out)]) == 2
    message = capsys.readouterr().err
    assert "8 finished runs of another study: parameters has changed" in message
    assert "--force" in message
    assert finished_runs(out) == 8
    assert StudyFolder(out, read_study(arches), force=True).missing() == list(range(8))


@pytest.mark.thorough
def test_what_falls_as_a_later_settlement_begins_falls_after_those_before(arches, tmp_path):
    settlement = "[[settlement]]\ndirection = [1, 0]\nincrement = 0.01\nlimit = 0.01\n"
    removed = '[[remove]]\nphase = 2\nblocks = "voussoir 3"\n'
    (tmp_path / "case.toml").write_text(f'[geometry]\nlayout = "arch"\n{2 * settlement}{removed}', encoding="utf-8")
    arches.write_text(STUDY.partition("[[imperfections]]")[0], encoding="utf-8")
    (row,) = _made_here(read_study(arches), tmp_path / "out", [0]).table().to_dict("records")
    assert row["status"] == "collapsed"
    assert [row[name] for name in ("collapse_displacement", "bracket_high", "last_settlement")] == [0.01] * 3


def test_a_folder_that_is_no_study_is_refused(arches, tmp_path, capsys):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "thesis.tex").write_text("precious", encoding="utf-8")
    assert main(["sweep", str(arches), "-o", str(tmp_path / "out")]) == 2
    assert "holds something that is no study" in capsys.readouterr().err
    assert (tmp_path / "out" / "thesis.tex").read_text(encoding="utf-8") == "precious"


def test_a_study_holds_its_folder(arches, tmp_path, capsys):
    out = tmp_path / "out"
    records = StudyFolder(out, read_study(arches))
    for more in ([], ["--force"]):
        assert main(["sweep", str(arches), "-o", str(out), *more]) == 2
        assert f"another study is writing to '{out}'; wait for it" in capsys.readouterr().err
    records.close()
    assert len(StudyFolder(out, read_study(arches)).missing()) == 24


@pytest.mark.thorough
def test_a_row_half_written_is_made_again(arches, tmp_path):
    study = read_study(arches)
    _made_here(study, tmp_path / "out", [0, 1])
    file = tmp_path / "out" / "runs.jsonl"
    file.write_bytes(file.read_bytes()[:-40])
    records = StudyFolder(tmp_path / "out", study)
    assert records.missing() == list(range(1, 24))
    records.add([run_once(study.values, str(study.case_source), study.order(1), study.n_seeded)])
    records.close()
    assert StudyFolder(tmp_path / "out", study).missing() == list(range(2, 24)), "half a line spoils none after it"


def _deadly(values, source, order, n_seeded, seconds):
    """Run 3 kills every worker that takes it."""
    if order["run"] == 3:
        os.kill(os.getpid(), signal.SIGKILL)
    return run_once(values, source, order, n_seeded, seconds)


@pytest.mark.slow
def test_a_run_that_kills_its_workers_is_recorded_and_the_others_are_made(arches, tmp_path, monkeypatch):
    monkeypatch.setattr(campaign, "run_once", _deadly)
    arches.write_text(STUDY.replace("runs = 24", "runs = 8"), encoding="utf-8")
    table = blockvis.study(arches, tmp_path / "out", workers=2)
    assert table["run"].tolist() == list(range(8))
    assert table["status"].tolist() == ["collapsed"] * 3 + ["failed"] + ["collapsed"] * 4
    assert "every worker that took this run died" in table.loc[3, "message"]


@pytest.fixture
def cluster(tmp_path):
    """A scheduler and two workers that a test may kill."""
    with started_cluster(tmp_path) as started:
        yield started


def _begun(study, out, address):
    """The process of a study on a cluster, of which some runs have been made."""
    command = [sys.executable, "-m", "blockvis", "sweep", str(study), "-o", str(out), "--scheduler", address]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    deadline = time.monotonic() + 120
    while finished_runs(out) < 3 and process.poll() is None:
        assert time.monotonic() < deadline
        time.sleep(0.02)
    return process


@pytest.mark.slow
def test_a_worker_killed_during_the_study_costs_nothing(arches, tmp_path, cluster):
    address, _, workers = cluster
    out = tmp_path / "out"
    study = _begun(arches, out, address)
    workers[0].kill()
    at_the_kill = finished_runs(out)
    printed, complaint = study.communicate(timeout=120)
    assert study.returncode == 0, complaint
    assert at_the_kill < 24, "it was killed during the study"
    table = pd.read_parquet(out / "table.parquet")
    assert table["run"].tolist() == list(range(24))
    assert (table["status"] == "collapsed").all()
    assert "24 of 24 runs" in printed
    assert workers[1].poll() is None


@pytest.mark.slow
def test_a_scheduler_that_goes_away_leaves_the_finished_runs(arches, tmp_path, cluster):
    address, scheduler, _ = cluster
    out = tmp_path / "out"
    study = _begun(arches, out, address)
    scheduler.kill()
    _, complaint = study.communicate(timeout=120)
    assert study.returncode == 2
    last = complaint.strip().splitlines()[-1]
    assert re.match(r"blockvis: the scheduler .*finished runs are kept, the same command goes on", last), complaint
    assert len(pd.read_csv(out / "table.csv")) == finished_runs(out) >= 3
