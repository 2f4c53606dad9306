"""The command line through its entry point."""

import csv
import json
import os
import re
import shutil
import signal
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import pytest
from structures import run_command

from blockvis import cli, generators, read_case
from blockvis.cli import main
from blockvis.generators import LAYOUTS, parameters_of

ROOT = Path(__file__).parents[2]

CASE = (ROOT / "examples" / "semicircular_arch.toml").read_text(encoding="utf-8")

#: A case that names no file.
GENERATED = """
[geometry]
layout = "arch"
parameters = { voussoirs = 5 }
[settlement]
direction = [1, 0]
increment = 0.02
limit = 0.02
[output]
animation = false
"""

#: A support that lies in a voussoir, and an interface of a material that no block has.
PROP = '[[supports]]\nname = "prop"\noutline = [[-0.2, 0.9], [0.2, 0.9], [0.2, 1.0], [-0.2, 1.0]]\n'
UNKNOWN = '[[interfaces]]\nmaterials = ["stnoe", "stone"]\nfriction_coefficient = 0.1\n'


@pytest.fixture
def case(tmp_path):
    """The shipped case, in a folder of its own, with a quick animation."""
    shutil.copy(ROOT / "assets" / "semicircular_arch.msh", tmp_path / "arch.msh")
    text = CASE.replace("../assets/semicircular_arch.msh", "arch.msh").replace('"collapse.mp4"', "false")
    path = tmp_path / "case.toml"
    path.write_text(text, encoding="utf-8")
    return path


def _changed(case, old, new):
    text = case.read_text(encoding="utf-8")
    assert old in text
    case.write_text(text.replace(old, new), encoding="utf-8")
    return case


def _refused(case, capsys, *words):
    assert run_command(case, "-o", case.parent / "out") == 2
    message = capsys.readouterr().err
    for word in words:
        assert word in message, message
    assert not (case.parent / "out").exists(), "nothing may be written for bad input"


def test_run_writes_the_results_folder(case, capsys):
    out = case.parent / "out"
    assert run_command(case, "-o", out, "--set", "settlement.increment=0.05", "--set", "analysis.falling_frames=2") == 0
    assert "collapse displacement" in capsys.readouterr().out
    summary = json.loads((out / "summary.json").read_text(encoding="utf-8"))
    assert summary["status"] == "collapsed"
    assert summary["collapse_displacement"] == pytest.approx(0.14104982, rel=1e-3)
    low, high = summary["collapse_bracket"]
    assert low < summary["collapse_displacement"] < high <= low + 1.001e-4
    weight = summary["total_weight"]
    assert summary["initial_reaction"] / weight == pytest.approx(0.1771150, abs=1e-6)
    assert summary["collapse_reaction"] / weight == pytest.approx(0.2420193, rel=1e-3)
    assert summary["n_blocks"] == 14
    rows = list(csv.DictReader((out / "response.csv").read_text(encoding="utf-8").splitlines()))
    assert len(rows) == summary["n_increments"]
    assert float(rows[-1]["settlement"]) == pytest.approx(low)
    # At rest the arch holds its springers by more than the least that is needed.
    assert float(rows[0]["least_admissible"]) == summary["initial_reaction"]
    assert float(rows[0]["reaction"]) == summary["reaction_at_rest"] > summary["initial_reaction"]
    frames = summary["n_increments"] + summary["n_falling_frames"]
    assert len(list(out.glob("increments/blocks_*.vtu"))) == frames
    assert len(list(out.glob("increments/contacts_*.vtu"))) == frames
    for name in ("blocks.pvd", "contacts.pvd"):
        assert (out / name).read_text(encoding="utf-8").count("<DataSet ") == summary["n_increments"]


def test_console_script_and_exit_code():
    done = subprocess.run(
        [sys.executable, "-m", "blockvis", "run", "nowhere.toml"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 2
    assert "nowhere.toml" in done.stderr
    assert "Traceback" not in done.stderr


def test_a_layout_in_place_of_the_case_file_is_named(capsys):
    layout = Path(__file__).parents[2] / "assets" / "semicircular_arch.msh"
    assert run_command(layout) == 2
    said = capsys.readouterr().err
    assert "is a layout, not a case file" in said
    assert '[geometry] file = "semicircular_arch.msh"' in said


def test_a_folder_in_place_of_the_case_file_is_named_with_the_cases_in_it(tmp_path, capsys):
    (tmp_path / "wall.toml").write_text("", encoding="utf-8")
    assert run_command(tmp_path) == 2
    assert f"'{tmp_path}' is a folder, not a case file (.toml); in it are wall.toml" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("arch.msh", "arhc.msh", ("arhc.msh", "arch.msh")),
        ("friction_coefficient", "friction_coeficient", ("did you mean 'friction_coefficient'",)),
        ("[settlement]", "[setlement]", ("setlement", "did you mean 'settlement'")),
        ("density = 2000.0", "density = = 2000.0", ("line",)),
        ('"right springer"', '"right sprinter"', ("right sprinter", "right springer")),
        ('"right springer" = "moving"', '"right springer" = "fixed"', ("moving", "right springer")),
        ('= "moving"', '= "sliding"', ("sliding", "free, fixed, moving")),
        ("increment = 0.01", "increment = -0.01", ("increment", "above 0")),
        ("direction = [1.0, 0.0]", "direction = [0, 0]", ("direction",)),
        ("direction = [1.0, 0.0]", 'direction = "right"', ("direction", "two numbers")),
        ("density = 2000.0", 'density = "heavy"', ("density", "number")),
        ("friction_coefficient = 2.0", "friction_coefficient = -0.1", ("friction_coefficient", "at least 0")),
        ("friction_coefficient = 2.0", "friction_coefficient = nan", ("friction_coefficient", "number")),
        # It was ignored: a layout stayed in metres.
        ('file = "arch.msh"', 'layout = "arch"\nunit = "mm"', ("[geometry] unit is 'mm'", "a layout is in m")),
        ("[settlement]", f"{PROP}[settlement]", ("prop", "overlaps", "voussoir")),
        ("[settlement]", f"{UNKNOWN}[settlement]", ("[[interfaces]] material 'stnoe' is that of no block",)),
    ],
)
def test_faults_of_a_case_file_are_named(case, capsys, old, new, words):
    _refused(_changed(case, old, new), capsys, *words)


def _printed(capsys, *arguments):
    with pytest.raises(SystemExit) as ended:
        main(list(arguments))
    return ended.value.code, capsys.readouterr()


def test_version_names_the_program_and_its_version(capsys):
    code, printed = _printed(capsys, "--version")
    assert (code, printed.out) == (0, f"blockvis {version('blockvis')}\n")


@pytest.mark.parametrize("arguments", [["--help"], ["run", "--help"]])
def test_help_says_what_every_exit_code_means(arguments, capsys):
    code, printed = _printed(capsys, *arguments)
    assert code == 0
    listed = dict(re.findall(r"(?m)^  (\d+) +(\S.*)$", printed.out.partition("exit codes:")[2]))
    codes = {cli.BAD_INPUT, cli.SOLVER_FAILED, cli.NO_PICTURES, cli.NO_EQUILIBRIUM, cli.INTERRUPTED}
    assert set(map(int, listed)) == {0} | codes
    assert ("no initial equilibrium" in listed["5"], "interrupted" in listed["130"]) == (True, True)


@pytest.mark.parametrize(
    "words",
    [
        ["wall", "bricks=4", "courses=3", "-o"],
        ["wall", "-o", None, "bricks=4", "courses=3"],
        ["wall", "bricks=4", "-o", None, "courses=3"],
        ["-o", None, "wall", "bricks=4", "courses=3"],
    ],
)
def test_parameters_of_a_layout_stand_on_either_side_of_options(words, tmp_path, capsys):
    file = str(tmp_path / "wall.msh")
    given = [file if word is None else word for word in words] + ([file] if None not in words else [])
    assert main(["layout", *given]) == 0
    blocks = generators.build("wall", {"bricks": 4, "courses": 3}).n_blocks
    assert f"{blocks} blocks written" in capsys.readouterr().out


def test_what_a_verb_does_not_know_is_refused(capsys):
    code, printed = _printed(capsys, "layout", "wall", "--set", "bricks=4", "-o", "wall.msh")
    assert code == 2
    assert "--set bricks=4" in printed.err


@pytest.mark.parametrize("name", LAYOUTS)
def test_help_of_a_layout_lists_its_parameters_with_units_and_defaults(name, capsys):
    code, printed = _printed(capsys, "layout", name.replace(" ", "-"), "--help")
    assert code == 0
    listed = re.findall(r"^  (\w+)", printed.out.partition("\nparameters:\n")[2], re.MULTILINE)
    assert listed == list(parameters_of(name))
    for key, default in parameters_of(name).items():
        line = next(line for line in printed.out.splitlines() if re.match(rf"  {key}\b", line))
        if default is not None:
            assert f"{key} = {json.dumps(default)}" in line
        if isinstance(default, float) and not key.endswith(("_ratio", "_bricks", "_courses")):
            assert re.search(r"\[(m|kg/m³|degrees)\]", line), line
    assert "density = " in printed.out


def test_help_of_a_layout_that_does_not_exist_names_the_nearest(capsys):
    code, printed = _printed(capsys, "layout", "archh", "--help")
    assert code == 2
    assert "did you mean 'arch'" in printed.err
    code, printed = _printed(capsys, "layout", "--help")
    assert code == 0
    assert "segmental-arch" in printed.out


def test_bash_completes_verbs_options_and_layouts(tmp_path, capsys):
    assert main(["completion", "bash"]) == 0
    script = tmp_path / "blockvis.bash"
    script.write_text(capsys.readouterr().out, encoding="utf-8")
    ask = (
        f"source {script}; function said {{ COMP_WORDS=(blockvis $1 $2); COMP_CWORD=$(($# > 1 ? 2 : 1)); "
        '_shtab_blockvis; echo "${COMPREPLY[@]}"; }; said comp; said layout segm; said run --res'
    )
    done = subprocess.run(["bash", "--norc", "-c", ask], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines() == ["compare completion", "segmental-arch", "--resume"]


def test_zsh_gets_a_script_of_its_own(tmp_path, capsys):
    assert main(["completion", "zsh"]) == 0
    text = capsys.readouterr().out
    assert text.startswith("#compdef blockvis")
    assert "segmental-arch" in text
    if shutil.which("zsh"):
        (tmp_path / "_blockvis").write_text(text, encoding="utf-8")
        subprocess.run(["zsh", "-n", tmp_path / "_blockvis"], check=True)


def test_set_changes_the_case_for_one_run(case, capsys):
    out = case.parent / "out"
    before = case.read_text(encoding="utf-8")
    changes = ["--set", "settlement.limit=0.02", "--set", "settlement.increment=0.02", "--set", "material.density=1000"]
    assert run_command(case, "-o", out, *changes) == 0
    summary = json.loads((out / "summary.json").read_text(encoding="utf-8"))
    assert summary["last_settlement"] == pytest.approx(0.02)
    assert summary["total_weight"] == pytest.approx(9140.45 / 2, rel=1e-5)
    stored = summary["case"]
    assert "density = 1000" in stored
    assert "# no sliding: the arch hinges only" in stored, "comments stay"
    assert case.read_text(encoding="utf-8") == before
    assert run_command("--resume", out) == 0, "the results folder has the changed case"


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ("material.friction_coeficient=0.5", ["friction_coeficient", "did you mean 'friction_coefficient'"]),
        ("material.friction_coefficient=-1", ["[material] friction_coefficient is -1"]),
        ("settlement.direction.x=1", ["cannot set 'settlement.direction.x'"]),
        ("supports[3].role=fixed", ["cannot set 'supports[3].role'"]),
        ("material.density=1\nsettlement.limit=2", ["[material] density is '1\\nsettlement.limit=2'"]),
        ("material.density", ["'material.density' is no change of a case"]),
    ],
)
def test_set_names_the_key_it_cannot_change(case, capsys, change, words):
    assert run_command(case, "-o", case.parent / "out", "--set", change) == 2
    said = capsys.readouterr().err
    for word in words:
        assert word in said
    assert not (case.parent / "out").exists()


def test_set_makes_tables_and_takes_plain_words_and_lists(case):
    found = read_case(
        case, ["geometry.joint_thickness=auto", "settlement.direction=[0, -1]", "analysis.falling_frames=7"]
    )
    assert found.joint_thickness == "auto"
    assert found.settlements[0].direction == (0.0, -1.0)
    assert found.controls.falling_frames == 7


def test_set_completes_a_case_that_lacks_a_table(case):
    text = case.read_text(encoding="utf-8")
    case.write_text(text[: text.index("[settlement]")], encoding="utf-8")
    with pytest.raises(ValueError, match=r"\[settlement\] is missing"):
        read_case(case)
    found = read_case(case, ["settlement.direction=[0, -1]", "settlement.limit=.5"])
    assert found.settlements[0].limit == 0.5


def test_no_initial_equilibrium_has_its_own_exit_code(case, capsys):
    """A row of voussoirs whose springer is moving only: the other end has nothing to stand on."""
    _changed(case, '"left springer" = "fixed"', '"left springer" = "free"')
    assert run_command(case, "-o", case.parent / "out") == 5
    summary = json.loads((case.parent / "out" / "summary.json").read_text(encoding="utf-8"))
    assert summary["status"] == "no initial equilibrium"


@pytest.mark.slow
def test_a_pipe_closed_early_is_no_error(case):
    command = f"{sys.executable} -m blockvis info {case.parent / 'arch.msh'} | true"
    done = subprocess.run(
        ["bash", "-c", f"{command}; exit ${{PIPESTATUS[0]}}"], capture_output=True, text=True, check=False, cwd=ROOT
    )
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.slow
@pytest.mark.parametrize("streams", [">&- 2>&-", "2>/dev/full"])
@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no stream that is full")
def test_streams_that_take_nothing_end_no_run(case, streams):
    _changed(case, "limit = 0.5", "limit = 0.01")
    command = f"{sys.executable} -m blockvis run {case} -o {case.parent / 'out'} --no-pictures --no-check-steps"
    done = subprocess.run(["bash", "-c", f"{command} {streams}"], capture_output=True, text=True, check=False, cwd=ROOT)
    assert (done.returncode, done.stderr) == (0, "")
    assert (case.parent / "out" / "summary.json").is_file()
    assert (">&-" in streams.split()) != (f"results in {case.parent / 'out'}/" in done.stdout)


@pytest.mark.parametrize(
    ("words", "buffer"), [pytest.param("info {}", "", marks=pytest.mark.thorough), ("--help", ""), ("--help", "none")]
)
@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no stream that is full")
def test_an_output_that_is_full_is_named(case, words, buffer):
    command = [sys.executable, "-m", "blockvis", *words.format(case.parent / "arch.msh").split()]
    environment = os.environ | {"PYTHONUNBUFFERED": buffer}
    with open("/dev/full", "w", encoding="utf-8") as full:
        done = subprocess.run(
            command, stdout=full, stderr=subprocess.PIPE, text=True, check=False, cwd=ROOT, env=environment
        )
    said = "blockvis: the standard output cannot be written: No space left on device; send it elsewhere\n"
    assert (done.returncode, done.stderr) == (2, said)


@pytest.mark.thorough
@pytest.mark.skipif(sys.platform != "linux", reason="other systems have no such names, or no such pipes")
def test_a_case_that_comes_through_a_pipe_is_run_and_drawn(tmp_path, capsys):
    end, begin = os.pipe()
    os.write(begin, GENERATED.encode())
    os.close(begin)
    assert run_command(f"/dev/fd/{end}", "-o", tmp_path / "out", drawn=True) == 0
    os.close(end)
    assert capsys.readouterr().err == ""
    for name in ("summary.json", "curve.png", "mechanism.png", "report.html"):
        assert (tmp_path / "out" / name).stat().st_size > 500


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="other systems have no such names, or no such pipes")
def test_a_case_whose_name_is_in_another_encoding_is_drawn(tmp_path):
    case = tmp_path / os.fsdecode(b"br\xfccke.toml")
    case.write_text(GENERATED, encoding="utf-8")
    assert run_command(case, "-o", tmp_path / "out", drawn=True) == 0
    assert (tmp_path / "out" / "curve.png").is_file()
    assert r"br\udcfccke" in (tmp_path / "out" / "report.html").read_text(encoding="utf-8")


def test_no_results_are_written_where_their_folder_has_no_name(case, capsys, monkeypatch):
    monkeypatch.chdir(case.parent)
    assert run_command(case, "-o", "") == 2
    assert "-o is empty; name the folder of the results" in capsys.readouterr().err
    assert {path.name for path in case.parent.iterdir()} == {"arch.msh", "case.toml"}


@pytest.mark.parametrize("size", ["abc", "1280", "40x", "40x30", "-5x300"])
def test_sizes_of_pictures_are_checked_before_anything_is_drawn(arch_folder, capsys, size):
    assert main(["render", str(arch_folder), f"--size={size}"]) == 2
    assert f"--size is '{size}'; give width and height in pixels" in capsys.readouterr().err


@pytest.mark.slow
def test_a_note_is_printed_once(case, capsys):
    case.write_text(case.read_text(encoding="utf-8") + '[[loads]]\nkind = "live"\nforce = [0, -1]\n', encoding="utf-8")
    assert run_command(case, "-o", case.parent / "out") in (0, 4)
    assert capsys.readouterr().err.count("leaves the live loads out") == 1


@pytest.mark.skipif(sys.platform == "win32", reason="no process sends itself Ctrl-C there")
@pytest.mark.parametrize("told", ["cli.INTERRUPTED", "os.kill(os.getpid(), signal.SIGINT)"])
def test_a_second_ctrl_c_does_not_break_off_the_ending(told):
    """What ends with the process, as the workers of a study, is no traceback, and neither is one while it is told."""
    ending = (
        "import atexit, os, signal\nfrom blockvis import cli\n"
        # In the background of a shell it is ignored.
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        "atexit.register(os.kill, os.getpid(), signal.SIGINT)\n"
        f"cli.main = lambda: {told}\ncli.entry()\n"
    )
    done = subprocess.run([sys.executable, "-c", ending], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (cli.INTERRUPTED, "")


@pytest.mark.skipif(sys.platform == "win32", reason="a process that is ended there hears nothing")
def test_a_queue_that_ends_a_run_is_heard_as_ctrl_c_is():
    """Once, also where it asks again while the run ends."""
    stopped = (
        "import atexit, os, signal\nfrom blockvis import cli\n"
        "atexit.register(os.kill, os.getpid(), signal.SIGTERM)\n"
        "cli._options = lambda _: os.kill(os.getpid(), signal.SIGTERM)\ncli.entry()\n"
    )
    done = subprocess.run([sys.executable, "-c", stopped], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (cli.INTERRUPTED, "blockvis: interrupted\n")


def stopped_at(module, how):
    """Python text after which the import of a module is stopped."""
    return (
        "import sys\n"
        "class Stop:\n"
        "    @staticmethod\n"
        "    def find_spec(name, *_):\n"
        f"        if name == {module!r}: {how}\n"
        "sys.meta_path.insert(0, Stop)\n"
    )


@pytest.mark.parametrize("package", ["numpy", "scipy", "solver.mechanics"])
def test_ctrl_c_while_packages_are_loaded_ends_without_a_traceback(package, tmp_path):
    """Also where a package executes a text just then, after which Python alone would end by the signal."""
    stopped = stopped_at(package, "exec('raise KeyboardInterrupt')") + "from blockvis.cli import entry\nentry()\n"
    words = ["layout", "arch", "-o", str(tmp_path / "arch.json")]
    done = subprocess.run([sys.executable, "-c", stopped, *words], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (130, "blockvis: interrupted\n")


@pytest.mark.skipif(sys.platform == "win32", reason="no process sends itself Ctrl-C there")
def test_ctrl_c_before_the_command_line_is_loaded_ends_without_a_traceback():
    stopped = "import os, signal\nsignal.signal(signal.SIGINT, signal.default_int_handler)\n"
    stopped += stopped_at("blockvis.cli", "os.kill(os.getpid(), signal.SIGINT)")
    stopped += "from blockvis.__main__ import script\nscript()\n"
    done = subprocess.run([sys.executable, "-c", stopped, "--version"], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (-signal.SIGINT, "")
