"""Drawing as a run does it: the film's process, what may be left out, what Ctrl-C leaves, and what progress says."""

import io
import json
import os
import signal
import subprocess
import sys

import pytest
from structures import arch_response, parted, wall

import blockvis
from blockvis.cli import main
from blockvis.pictures import film_process
from blockvis.pictures.film_process import FilmFailed, FilmProcess
from blockvis.runs import progress
from blockvis.runs.progress import DrawingProgress

CASE = """
[geometry]
layout = "arch"
[material]
friction_coefficient = 0.7
[settlement]
direction = [1, 0]
increment = 0.05
limit = 0.5
[analysis]
falling_frames = 2
"""

RUN = sys.modules[blockvis.run_case.__module__]


@pytest.fixture
def case(tmp_path):
    path = tmp_path / "case.toml"
    path.write_text(CASE, encoding="utf-8")
    return path


@pytest.mark.slow
def test_another_process_draws_the_same_film(tmp_path):
    response = parted(wall(4, 3), 3, 2)
    process, told = FilmProcess(), []
    process.draw(response, tmp_path / "other.mp4", None, {})
    process.wait(lambda *count: told.append(count))
    blockvis.animate(response, tmp_path / "own.mp4")
    assert (tmp_path / "other.mp4").read_bytes() == (tmp_path / "own.mp4").read_bytes()
    assert told[-1][0] == told[-1][1] == len(told)


@pytest.mark.slow
def test_what_fails_in_the_process_is_raised_here(tmp_path):
    process = FilmProcess()
    process.draw(arch_response(), tmp_path / "film.avi", None, {})
    with pytest.raises(ValueError, match=r"film\.avi.*\.mp4, \.gif, \.webp"):
        process.wait(lambda *_: None)


@pytest.mark.skipif(os.name == "nt", reason="Windows sends no signal to one process")
@pytest.mark.slow
def test_ctrl_c_is_for_the_first_process_even_before_the_other_has_loaded(tmp_path, capfd):
    process = FilmProcess()
    process._worker._process.send_signal(signal.SIGINT)
    process.draw(arch_response(), tmp_path / "film.avi", None, {})
    # It answers.
    with pytest.raises(ValueError, match=r"film\.avi"):
        process.wait(lambda *_: None)
    assert "KeyboardInterrupt" not in capfd.readouterr().err


@pytest.mark.slow
def test_a_process_that_is_ended_leaves_all_but_the_film(case, tmp_path, monkeypatch, capsys):
    def killed():
        process = FilmProcess()
        process._worker._process.kill()
        process._worker._process.wait()
        return process

    with pytest.raises(FilmFailed, match=r"ended with code -9; draw it by blockvis render"):
        killed().wait(lambda *_: None)
    monkeypatch.setattr(film_process, "FilmProcess", killed)
    assert main(["run", str(case), "-o", str(tmp_path / "out"), "--no-check-steps"]) == 4
    assert "everything but the pictures is written: the film was not drawn" in capsys.readouterr().err
    names = {path.name for path in (tmp_path / "out").iterdir()}
    assert {"summary.json", "report.html", "curve.png", "mechanism.png", "fall.pvd"} <= names
    assert "collapse.mp4" not in names


@pytest.mark.slow
def test_film_and_pictures_may_be_left_out(case, tmp_path):
    film = {path.name for path in blockvis.run_case(case, tmp_path / "film", pictures=False).folder.iterdir()}
    assert not film & {"report.html", "curve.png", "mechanism.png", "collapse.mp4"}
    assert {"summary.json", "blocks.pvd", "fall.pvd"} <= film
    run = RUN.resume_run(tmp_path / "film", outputs=(RUN.Drawing(film=False),))
    there = {path.name for path in run.folder.iterdir()}
    assert {"report.html", "curve.png", "mechanism.png", "cracks.png"} <= there
    assert "collapse.mp4" not in there
    last = (run.folder / "cracks.png").read_bytes()
    assert main(["render", str(run.folder), "--cracks", "-1"]) == 0
    assert (run.folder / "cracks.png").read_bytes() == last
    assert main(["render", str(run.folder), "--cracks", "0", "--size", "1920x1080"]) == 0
    assert (run.folder / "cracks.png").read_bytes() != last
    assert main(["render", str(run.folder), "--cracks", "99"]) == 2


@pytest.mark.slow
def test_ctrl_c_while_drawing_names_the_command_that_resumes(case, tmp_path):
    """A real Ctrl-C, to all processes of the group as a terminal sends it."""
    out = tmp_path / "out"
    code = """
import sys, time, blockvis.pictures.render as render
import blockvis.cli
picture = render.draw_mechanism
render.draw_mechanism = lambda *a, **k: (print("drawing", flush=True), time.sleep(60), picture(*a, **k))
sys.exit(blockvis.cli.main(sys.argv[1:]))
"""
    run = subprocess.Popen(
        [sys.executable, "-c", code, "run", str(case), "-o", str(out)],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True,
        env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)},
        # Where the tests run in the background the shell has Ctrl-C ignored.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )  # fmt: skip
    assert run.stdout.readline() == "drawing\n"
    os.killpg(run.pid, signal.SIGINT)
    _, said = run.communicate(timeout=60)
    assert run.returncode == 130
    assert said.splitlines()[-1].endswith(f"by: blockvis run --resume {out}")
    assert "Traceback" not in said
    assert json.loads((out / "summary.json").read_text(encoding="utf-8"))["status"] == "collapsed"
    assert not [path for path in out.rglob("*") if ".part" in path.name]
    again = subprocess.run(
        [sys.executable, "-m", "blockvis", "run", "--resume", str(out)], check=True, capture_output=True, text=True,
        env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)},
    )  # fmt: skip
    assert "nothing was left to solve" in again.stderr
    assert (out / "mechanism.png").is_file()
    assert (out / "collapse.mp4").is_file()


class Terminal(io.StringIO):
    def isatty(self):
        return True


def test_a_bar_on_a_terminal_lines_elsewhere(monkeypatch):
    watched, piped = Terminal(), io.StringIO()
    for stream in (watched, piped):
        monkeypatch.setattr("sys.stderr", stream)
        with DrawingProgress() as bar:
            for k in range(8):
                bar.frame(k + 1, 8)
    assert "[########################] frame 8 of 8" in watched.getvalue()
    assert watched.getvalue().endswith("\r\x1b[K")
    assert piped.getvalue() == ""
    monkeypatch.setattr(progress, "LINES", 0.0)
    with DrawingProgress() as bar:
        bar.frame(3, 8)
        bar.frame(4, 8)
    assert [line.rpartition(",")[0] for line in piped.getvalue().splitlines()] == [
        "blockvis: frame 3 of 8",
        "blockvis: frame 4 of 8",
    ]


@pytest.mark.slow
def test_the_seconds_of_each_part_are_counted(case, tmp_path):
    run = blockvis.run_case(case, tmp_path / "out", outputs=())
    assert set(run.stages) >= {"read", "solve", "write"}
    assert run.stages["solve"] == pytest.approx(run.summary["seconds"], abs=0.5)
