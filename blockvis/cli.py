"""The command line: a function for each verb, which calls the public ones and prints what came out."""

from __future__ import annotations

import argparse
import contextlib
import gc
import glob
import io
import json
import math
import os
import signal
import sys
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from importlib.metadata import PackageNotFoundError, version
from mmap import mmap
from pathlib import Path
from typing import TYPE_CHECKING, Any

import solver

from .layout.sights import SIGHTS
from .layout.views import VIEWS
from .system.extras import MissingExtra
from .system.processes import is_broken_pipe
from .text import nearest, resume_command

if TYPE_CHECKING:
    from .cases.contents import Case
    from .layout.inspect import Inspection
    from .runs.outputs import Drawing
    from .runs.run import Run
    from .runs.step_check import StepChecking

#: Exit codes: bad input or a missing extra, a solver failure, everything written but the pictures, no equilibrium to
#: start from, Ctrl-C.
BAD_INPUT, SOLVER_FAILED, NO_PICTURES, NO_EQUILIBRIUM, INTERRUPTED = 2, 3, 4, 5, 130

#: What errors of the standard output have for the name of a file.
OUTPUT = "standard output"

#: What libraries of linear algebra take as they are loaded [bytes]; what Linux says where there is no memory, of
#: libraries and of threads, too.
LEAST_MEMORY = 6 << 27
NO_MEMORY = ("Cannot allocate memory", "failed to map segment", "can't start new thread")

#: What the exit codes mean, for ``--help``.
EXIT_CODES = f"""exit codes:
  0    done, also when the structure collapses
  {BAD_INPUT}    bad input, or a package that is not installed
  {SOLVER_FAILED}    the solver failed; what it had found is written
  {NO_PICTURES}    everything is written but the pictures
  {NO_EQUILIBRIUM}    no initial equilibrium: the structure does not stand as drawn
  {INTERRUPTED}  interrupted by Ctrl-C, SIGTERM or increment_seconds; blockvis run --resume OUT goes on"""

#: How long a run waits for the path in shorter steps: so many times what it took itself, and at least so many seconds.
PATIENCE, LEAST_PATIENCE = 3.0, 60.0

#: Seconds that each run of a range takes beside its solver time, to start a process above all.
PROCESS_SECONDS = 2.0

#: Pixels below which a picture has no room for its words.
SMALLEST_PICTURE = 160

#: What ``blockvis completion`` writes for, and where it goes.
SHELLS = {
    "bash": "blockvis completion bash > ~/.local/share/bash-completion/completions/blockvis",
    "zsh": "blockvis completion zsh > a folder of $fpath, as _blockvis",
}


def main(arguments: Sequence[str] | None = None, *, outputs: Sequence[Drawing] | None = None) -> int:
    """Run the command line and return its exit code.

    Parameters
    ----------
    arguments : sequence of str, optional
        Those of the process by default.
    outputs : sequence of Drawing, optional
        What runs make beside their numbers, in place of what the arguments say; a new case is drawn without them only.
    """
    warnings.showwarning = _notes_without_repeats()
    try:
        options = _options(arguments)
        options.outputs = outputs
        # A library that is loaded with HiGHS asks for 256 MiB until it gets them, for ever.
        mmap(-1, LEAST_MEMORY).close()
        code: int = options.verb(options)
    except (ValueError, OSError, MissingExtra) as error:
        if isinstance(error, OSError) and (is_broken_pipe(error) or error.filename == OUTPUT):
            raise
        if _lacks_memory(error):
            return BAD_INPUT
        print(f"blockvis: {_in_plain_words(error)}", file=sys.stderr)
        return BAD_INPUT
    except KeyboardInterrupt as stop:
        print(f"blockvis: {stop}" if str(stop) else "blockvis: interrupted", file=sys.stderr)
        return INTERRUPTED
    except Exception as error:
        if _lacks_memory(error):
            return BAD_INPUT
        # Not in the clause, where the end of a help would load the mechanics to look whether it is one.
        if not isinstance(error, solver.SolveError):
            raise
        print(f"blockvis: the linear program could not be solved: {error}", file=sys.stderr)
        return SOLVER_FAILED
    return code


def _lacks_memory(error: Exception) -> bool:
    """Whether an error is of memory that there is not, which is said then."""
    lacks = isinstance(error, MemoryError) or any(words in str(error) for words in NO_MEMORY)
    if lacks:
        said = f"blockvis: there is not enough memory for what is asked for: {error}".removesuffix(": ")
        print(f"{said}; raise its limit (ulimit -v), or ask for less", file=sys.stderr)
    return lacks


def _in_plain_words(error: Exception) -> str:
    """Write what a user is told of an error: of one of the system its words without a number, and a remedy."""
    if not isinstance(error, OSError) or error.filename is None or error.strerror is None:
        return str(error)
    remedy = "; change the rights of file or folder, or choose another" if isinstance(error, PermissionError) else ""
    return f"'{error.filename}': {error.strerror}{remedy}"


class _Told(io.TextIOWrapper):
    """What is told beside the output: no run ends as a log of it is full."""

    def write(self, text: str) -> int:
        """Write what there is room for."""
        with contextlib.suppress(OSError):
            super().write(text)
        return len(text)

    def flush(self) -> None:
        """Write what there is room for."""
        with contextlib.suppress(OSError):
            super().flush()


class _Output(io.TextIOWrapper):
    """The standard output, whose errors name it: those of a file that is written have another remedy."""

    def write(self, text: str) -> int:
        """Write a text."""
        with _of_output():
            return super().write(text)

    def flush(self) -> None:
        """Write what is left."""
        with _of_output():
            super().flush()


@contextlib.contextmanager
def _of_output() -> Iterator[None]:
    try:
        yield
    except OSError as error:
        error.filename = OUTPUT
        raise


class _Ended(KeyboardInterrupt):
    """The system asks the run to end, not a user to leave what it is at."""


def _end(*_: object) -> None:
    """End as after Ctrl-C, what is found written: so queues and shutdowns ask for it, and some ask again meanwhile."""
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    raise _Ended


def entry() -> None:
    """Console script."""
    # Streams that were closed beforehand are None.
    sys.stdout, sys.stderr = (
        stream or os.fdopen(os.open(os.devnull, os.O_WRONLY), "w") for stream in (sys.stdout, sys.stderr)
    )
    # Names of blocks may have characters that a console, or what the output goes to, cannot show.
    if isinstance(out := sys.__stdout__, io.TextIOWrapper):
        sys.stdout = _Output(
            out.buffer,
            out.encoding,
            "backslashreplace",
            line_buffering=out.line_buffering,
            write_through=out.write_through,
        )
    if isinstance(sys.__stderr__, io.TextIOWrapper):
        sys.stderr = _Told(sys.__stderr__.buffer, sys.__stderr__.encoding, "backslashreplace", line_buffering=True)
    signal.signal(signal.SIGTERM, _end)
    try:
        try:
            code = main()
        except SystemExit as ended:
            # A help ends so; what it said may not have gone out yet.
            code = int(ended.code or 0)
        sys.stdout.flush()
    except KeyboardInterrupt:
        # A second one, while the first is told.
        code = INTERRUPTED
    except OSError as error:
        if not (is_broken_pipe(error) or error.filename == OUTPUT):
            raise
        # Python would complain again as it ends.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        # Whatever reads the output, such as head, has enough of it.
        code = 0
        if not is_broken_pipe(error):
            print(f"blockvis: the {OUTPUT} cannot be written: {error.strerror}; send it elsewhere", file=sys.stderr)
            code = BAD_INPUT
    # Python looks through all that is left as it ends, for a quarter of a second; nothing of it needs that.
    gc.freeze()
    if code == INTERRUPTED:
        # Workers of a study end with the process; a second Ctrl-C would break off their ending, with a traceback.
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        # Where it went through a text that was executed, as scipy does while it is loaded, Python would end by the
        # signal all the same; the next such text takes that back.
        exec("")
    sys.exit(code)


class _Parser(argparse.ArgumentParser):
    """A parser whose words for a verb that does not exist name the nearest one."""

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        # Python before 3.12 has no other place for a hint.
        if isinstance(action, argparse._SubParsersAction) and value not in action.choices:
            verbs = list(action.choices)
            raise argparse.ArgumentError(
                None, f"there is no verb '{value}'{nearest(str(value), verbs)}; there are {', '.join(verbs)}"
            )
        super()._check_value(action, value)

    def _print_message(self, message: str, file: Any = None) -> None:
        # That of argparse keeps it to itself that an output is full.
        (file or sys.stderr).write(message or "")


def _options(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = _parser()
    options, left = parser.parse_known_args(arguments)
    if options.verb in (_layout, _bond) and not any(word.startswith("-") for word in left):
        # Parameters on either side of an option.
        options.parameters += left
    elif left:
        of_patterns = next((flag for flag in ("ignore", "only") if getattr(options, flag, None)), "")
        remedy = f"; give each pattern its own --{of_patterns}" if of_patterns else ""
        parser.error(f"unrecognized arguments: {' '.join(left)}{remedy}")
    return options


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="blockvis",
        description="How dry-jointed masonry cracks on settling supports, and how far it can go.",
        epilog=EXIT_CODES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"blockvis {_version()}")
    verbs = parser.add_subparsers(required=True, metavar="VERB")
    run = _verb(
        verbs,
        _run,
        help="solve a case, write everything, draw",
        epilog=EXIT_CODES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    run.add_argument("case", metavar="CASE.toml", nargs="?")
    run.add_argument("-o", "--output", metavar="OUT", help="results folder (default: <case>-results)")
    run.add_argument("--force", action="store_true", help="replace results that are there already")
    run.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        help="change a value of the case for this run, as material.friction_coefficient=0.5 or "
        "'settlement.direction=[1, 0]'; may be given again",
    )
    run.add_argument(
        "--resume", metavar="OUT", help="go on with the run in this results folder, however it was stopped"
    )
    run.add_argument(
        "--increment-seconds",
        metavar="S",
        help="what an increment of a path may take; a run that needs more says what it was doing and ends, --resume "
        "goes on (default: [analysis] increment_seconds; with --resume no limit)",
    )
    run.add_argument("--no-film", action="store_true", help="draw all but the film")
    run.add_argument(
        "--no-pictures", action="store_true", help="draw nothing and write no report; blockvis render OUT does later"
    )
    run.add_argument(
        "--check-steps",
        action=argparse.BooleanOptionalAction,
        help="follow the path a second time, with a quarter of the step tolerance, and say the error that follows "
        f"(default: in a process of its own, given up after {PATIENCE:g} times what the run took, at least "
        f"{LEAST_PATIENCE:g} s; --check-steps waits to its end)",
    )
    run.add_argument(
        "--range",
        action="store_true",
        help="follow a settlement eight times more, with friction, compliance of the joints and imperfection varied, "
        "and give the range of collapse and reaction; as [analysis] range = true",
    )
    info = _verb(verbs, _info, help="blocks, names, roles, unit, areas, overlaps and mortar joints of a layout")
    info.add_argument("file", metavar="FILE", help="or a folder or a pattern of files, one per stone")
    _add_reading(info)
    info.add_argument("--picture", metavar="PNG", help="draw what was found, or why it is refused")
    convert = _verb(
        verbs, _convert, help="any layout file to any other; results to one file, a .vtkhdf, .glb or layout"
    )
    convert.add_argument(
        "source", metavar="IN", help="or a folder or a pattern of files, one per stone; or a results folder"
    )
    convert.add_argument(
        "target",
        metavar="OUT",
        help="of the format that its suffix says, as .json, .dxf or .obj (a wrong one lists all); of results .vtkhdf "
        "for the path in time, .glb for an animation, else the blocks at the end",
    )
    _add_reading(convert)
    convert.add_argument(
        "--joint-thickness", default="0", metavar="M", help='close mortar joints up to this, or "auto"'
    )
    convert.add_argument("--force", action="store_true", help="replace OUT if it is there already")
    layout = _verb(verbs, _layout, help="a parametric layout as a file", add_help=False)
    layout.add_argument("-h", "--help", action=_LayoutHelp, help="show this help, or the parameters of NAME")
    layout.add_argument("name", metavar="NAME")
    layout.add_argument(
        "parameters", nargs="*", metavar="key=value", help="parameters of the layout, values as in TOML"
    )
    layout.add_argument("-o", "--output", required=True, metavar="FILE")
    layout.add_argument("--force", action="store_true", help="replace FILE if it is there already")
    added = (
        *(_add_render, _add_bond, _add_compare, _add_report, _add_explain, _add_sweep, _add_new, _add_schema),
        *(_add_example, _add_completion),
    )
    for add in added:
        add(verbs)
    return parser


def _verb(verbs: Any, carry_out: Callable[[argparse.Namespace], int], **options: Any) -> argparse.ArgumentParser:
    """Add the verb that a function carries out, which has its name."""
    verb: argparse.ArgumentParser = verbs.add_parser(carry_out.__name__.removeprefix("_"), **options)
    verb.set_defaults(verb=carry_out)
    return verb


def _add_completion(verbs: Any) -> None:
    completion = _verb(
        verbs,
        _completion,
        help="a script that completes verbs and options in a shell",
        epilog="; ".join(f"{shell}: {command}" for shell, command in SHELLS.items()),
    )
    completion.add_argument("shell", choices=tuple(SHELLS))


class _LayoutHelp(argparse.Action):
    """``blockvis layout NAME --help``: the parameters of that layout."""

    def __init__(self, option_strings: Sequence[str], dest: str, help: str | None = None) -> None:
        super().__init__(option_strings, dest, nargs=0, default=argparse.SUPPRESS, help=help)

    def __call__(self, parser: argparse.ArgumentParser, namespace: argparse.Namespace, *_: object) -> None:
        """Print the help and end."""
        from .generators import help_text

        name = getattr(namespace, "name", None)
        if name is None:
            names = ", ".join(_layout_names())
            parser.epilog = f"layouts: {names}; blockvis layout NAME --help lists the parameters of one"
            parser.print_help()
            parser.exit()
        try:
            text = help_text(name)
        except ValueError as error:
            parser.exit(BAD_INPUT, f"blockvis: {error}\n")
        print(f"usage: blockvis layout {name} [key=value ...] -o FILE\n\n{text}")
        parser.exit()


def _layout_names() -> list[str]:
    from .generators import LAYOUTS

    return [name.replace(" ", "-") for name in LAYOUTS]


def _version() -> str:
    try:
        return version("blockvis")
    except PackageNotFoundError:
        return "(not installed)"


def _add_render(verbs: Any) -> None:
    render = _verb(verbs, _render, help="draw again from a results folder, without solving")
    render.add_argument("results", metavar="OUT")
    render.add_argument(
        "--animation", default="collapse.mp4", help="in OUT: .mp4, .gif, .webp, a folder such as frames/, or none"
    )
    render.add_argument("--no-film", dest="animation", action="store_const", const="none", help="as --animation none")
    render.add_argument(
        "--magnification", type=_number, default=1.0, help="of displacements; without forces and hinges"
    )
    render.add_argument("--colour-by", choices=("material", "mechanism", "displacement"), default="mechanism")
    render.add_argument("--forces", choices=("auto", "thrust", "points", "none"), default="auto")
    render.add_argument("--curve", action="store_true", help="the reaction curve beside the blocks")
    render.add_argument("--size", metavar="WxH", help="of stills and film, in pixels (default: as what they show)")
    render.add_argument(
        "--cracks", type=int, metavar="N", help="nothing but cracks.png, of increment N (-1: the last equilibrium)"
    )
    _add_sight(render)


def _add_sight(verb: argparse.ArgumentParser) -> None:
    verb.add_argument(
        "--view",
        metavar="VIEW",
        help=f"of blocks in space: {', '.join(SIGHTS)}, or AZIMUTH,ELEVATION in degrees (default: that of the case, "
        "else where the motion is seen best, of vaults from below as well)",
    )
    verb.add_argument(
        "--section",
        metavar="PLANE",
        help='that cuts blocks in space open: x, "y = 1.2" (m), or {point = [x, y, z], normal = [x, y, z]}',
    )


def _add_reading(verb: argparse.ArgumentParser, *, in_space: bool = True) -> None:
    """Add the options that say how a layout file is read, and what of it."""
    verb.add_argument("--unit", help="of the file's lengths, where the file does not say or is wrong")
    if in_space:
        verb.add_argument(
            "--dimension",
            choices=("2", "3", "auto"),
            default="auto",
            help="read blocks in the plane or in space (default: in space where bodies are not prisms side by side)",
        )
    verb.add_argument("--view", choices=tuple(VIEWS), help="coordinates to take, of a drawing in space")
    for flag, what in (("--ignore", "leave out"), ("--only", "read nothing but")):
        verb.add_argument(
            flag,
            action="append",
            default=[],
            metavar="PATTERN",
            help=f"{what} this layer, group or name, kind of entity (circle) or colour (#rrggbb); may be given again",
        )
    verb.add_argument(
        "--window",
        nargs=4,
        type=_number,
        metavar=("X0", "Y0", "X1", "Y1"),
        help="read what lies within this rectangle of the plane, in m, as info prints coordinates",
    )
    of_image = "of an image, or of that of annotations"
    for flag in ("--width", "--height"):
        verb.add_argument(flag, type=_number, metavar="M", help=f"{flag[2:]} {of_image}, in m")
    verb.add_argument("--pixel", type=_number, metavar="M", help=f"size of a pixel {of_image}, in m, instead")
    verb.add_argument("--background", metavar="VALUE", help='value, or colour such as "white", of what is no stone')
    verb.add_argument("--smallest", type=_number, metavar="M", help="less of an image than this across is a speck")


def _add_bond(verbs: Any) -> None:
    bond = _verb(
        verbs,
        _bond,
        help="fill outlines with openings with the stones of a bond, and write them as a file",
        epilog="keys as of [[bond]] in a case: blockvis bond facade.dxf -o bricks.dxf walls='A-WALL*' bond=flemish",
    )
    bond.add_argument("drawing", metavar="DRAWING")
    bond.add_argument(
        "parameters", nargs="*", metavar="key=value", help="walls, openings, bond, brick, joint, heads ..., as in TOML"
    )
    bond.add_argument("-o", "--output", required=True, metavar="OUT")
    _add_reading(bond, in_space=False)
    bond.add_argument("--force", action="store_true", help="replace OUT if it is there already")


def _add_compare(verbs: Any) -> None:
    compare = _verb(verbs, _compare, help="two runs side by side: numbers, curves, cracks, pictures, a film in step")
    compare.add_argument("one", metavar="OUT1", help="results folder of one run")
    compare.add_argument("other", metavar="OUT2", help="and of the other")
    compare.add_argument("-o", "--output", metavar="OUT", help="folder of the comparison (default: <OUT1>-<OUT2>)")
    compare.add_argument(
        "--animation", default="compare.mp4", help=".mp4, .gif, .webp, a folder such as frames/, or none"
    )
    compare.add_argument("--no-film", dest="animation", action="store_const", const="none", help="as --animation none")
    compare.add_argument("--force", action="store_true", help="replace a comparison that is there already")


def _add_report(verbs: Any) -> None:
    report = _verb(verbs, _report, help="the report of a results folder again, as a page or on paper")
    report.add_argument("results", metavar="OUT")
    report.add_argument("--pdf", action="store_true", help="write report.pdf, A4, as well")
    _add_sight(report)


def _add_explain(verbs: Any) -> None:
    explain = _verb(
        verbs,
        _explain,
        help="which movements of the supports may have caused observed cracks",
        epilog='observations: a table with joint ("A | B") or x and y, width [mm] and perhaps uncertainty [mm]; '
        "or with block, dx [mm] and dy [mm]; or a drawing of the damaged state",
    )
    explain.add_argument("case", metavar="CASE.toml", help="of the undamaged structure; it needs no settlement")
    explain.add_argument("--observed", metavar="FILE", required=True, help="cracks.csv, or a drawing")
    explain.add_argument("-o", "--output", metavar="OUT", help="folder of page and numbers (default: <case>-explain)")
    explain.add_argument("--force", action="store_true", help="replace an explanation that is there already")
    explain.add_argument("--scheduler", metavar="ADDRESS", help="of a Dask cluster that exists, tcp://host:8786")
    explain.add_argument("--workers", type=int, metavar="N", help="processes on this machine (default: one per core)")


def _add_sweep(verbs: Any) -> None:
    sweep = _verb(verbs, _sweep, help="many runs of one case, on this machine or a Dask cluster")
    sweep.add_argument("study", metavar="STUDY.toml")
    sweep.add_argument("-o", "--output", metavar="OUT", help="folder of the study (default: <study>-study)")
    sweep.add_argument("--scheduler", metavar="ADDRESS", help="of a Dask cluster that exists, tcp://host:8786")
    sweep.add_argument("--workers", type=int, metavar="N", help="processes on this machine (default: one per core)")
    sweep.add_argument("--retry-failed", action="store_true", help="make runs again that had no result")
    sweep.add_argument("--keep", metavar="RUNS", default="", help="runs whose results folder is wanted, as 0,17,42")
    sweep.add_argument("--force", action="store_true", help="throw away the runs of another study in OUT")


def _add_new(verbs: Any) -> None:
    new = _verb(verbs, _new, help="a case file for a drawing, with a comment on every key")
    new.add_argument("drawing", metavar="DRAWING", help="or a folder or a pattern of files, one per stone")
    new.add_argument("-o", "--output", metavar="CASE.toml", help="(default: <drawing>.toml)")
    _add_reading(new)
    new.add_argument("--force", action="store_true", help="replace CASE.toml if it is there already")


def _add_schema(verbs: Any) -> None:
    schema = _verb(
        verbs,
        _schema,
        help="JSON schema of the case or study file, for editors of TOML",
        epilog="blockvis schema > case.schema.json; then #:schema ./case.schema.json is the first line of a case",
    )
    schema.add_argument("file", nargs="?", choices=("case", "study"), default="case")


def _add_example(verbs: Any) -> None:
    example = _verb(verbs, _example, help="copy a shipped case and its drawing into this folder, or list all")
    example.add_argument("example", metavar="NAME", nargs="?", help="without it all are listed")
    example.add_argument("--force", action="store_true", help="replace files that are there already")


def _completion(options: argparse.Namespace) -> int:
    import shtab

    parser = _parser()
    # Choices here, not in the parser: a name that does not exist gets a better message than argparse has.
    choices: dict[str, Any] = {"name": _layout_names()}
    files = {
        *("case", "drawing", "output", "resume", "file", "source", "target"),
        *("results", "study", "picture", "observed", "one", "other"),
    }
    for action in parser._actions:
        for verb in (action.choices or {}).values() if isinstance(action.choices, dict) else ():
            for argument in verb._actions:
                if argument.dest in choices:
                    argument.choices = choices[argument.dest]
                elif argument.dest in files:
                    argument.complete = shtab.FILE
    print(shtab.complete(parser, options.shell))
    return 0


def _compare(options: argparse.Namespace) -> int:
    from .comparison.write import compare
    from .runs.progress import DrawingProgress

    folder = Path(options.output or f"{Path(options.one).name}-{Path(options.other).name}")
    film = None if options.animation == "none" else options.animation
    with DrawingProgress() as progress:
        written = compare(
            options.one, options.other, folder, film=film, overwrite=options.force, progress=progress.frame
        )
    print(f"compared in {folder}/: {', '.join(written)}")
    return 0


def _explain(options: argparse.Namespace) -> int:
    from .explanation.explain import explain

    folder = Path(options.output or f"{Path(options.case).stem}-explain")
    found = explain(
        options.case,
        options.observed,
        folder,
        overwrite=options.force,
        workers=options.workers,
        scheduler=options.scheduler,
        progress=True,
    )
    print(found)
    print(f"explain.html, explain.json and explain.png in {folder}/")
    return 0 if found.stands else NO_EQUILIBRIUM


def _sweep(options: argparse.Namespace) -> int:
    from .results.record import read_json
    from .studies.campaign import study as carried_out
    from .studies.study_file import read_study
    from .studies.study_folder import finished_runs
    from .studies.summary import in_words

    study = read_study(options.study)
    folder = Path(options.output or f"{study.source.stem}-study")
    try:
        carried_out(
            replace(study, keep=(*study.keep, *_run_numbers(options.keep))),
            folder,
            scheduler=options.scheduler,
            workers=options.workers,
            force=options.force,
            retry_failed=options.retry_failed,
        )
    except KeyboardInterrupt:
        print(
            f"blockvis: interrupted; {finished_runs(folder)} of {study.n_runs} runs are kept, "
            "the same command goes on with the others",
            file=sys.stderr,
        )
        return INTERRUPTED
    print(in_words(read_json(folder / "summary.json")))
    pictures = " and pictures" if any(folder.glob("*.png")) else ""
    print(f"table{pictures} in {folder}/")
    return 0


def _new(options: argparse.Namespace) -> int:
    from solver.mechanics import counted

    from .case_files.new_case import case_text, relative_to, unit_instead
    from .formats.read import inspect
    from .layout.ground import ground_of
    from .layout.units import metres_per
    from .runs.progress import Waiting
    from .system.atomic_files import write_atomic

    drawing = Path(options.drawing)
    stem = drawing.parent.name if glob.has_magic(drawing.name) else drawing.resolve().stem
    target = _new_file(options.output or f"{stem}.toml", options.force)
    choice = _choice(options)
    with Waiting(f"reading {drawing.name}"):
        filled = _filled_walls(options, choice)
        found, walls = filled or (inspect(drawing, unit=options.unit, dimension=_dimension(options), **choice), ())
    unit, unit_says = ("", "") if walls else unit_instead(found)
    if unit:
        if choice["window"]:
            # It is in metres of the drawing as it was read.
            factor = metres_per(unit) / metres_per(found.layout.unit or "m")
            choice["window"] = [x * factor for x in choice["window"]]
        found = inspect(drawing, unit=unit, dimension=_dimension(options), **choice)
    if unit_says:
        print(f"blockvis: note: {unit_says}", file=sys.stderr)
    text = case_text(found, relative_to(target.parent, drawing), unit_says=unit_says, walls=walls, **choice)
    write_atomic(target, text)
    print(f"{target} written for {counted(len(found.kept), 'block')}; run it: blockvis run {target}")
    if found.layout.dimension == 2 and found.layout.thickness is None:
        print("the drawing does not say how deep it is: 1 m, unless [geometry] thickness says more")
    ground = ground_of(found)
    if ground.doubt:
        print(f"blockvis: note: {ground.doubt}", file=sys.stderr)
    _try_new(text, target, ground.remark, drawing=options.outputs is None)
    return 0


def _try_new(text: str, target: Path, remark: str, *, drawing: bool) -> None:
    """Say whether what a new case describes stands, and draw it with its ground and a remark on that."""
    from .case_files.read import parse_case
    from .cases.build import case_assembly
    from .layout.inspect import inspected
    from .layout.joints.facing_edges import Facing
    from .layout.layout import layout_of
    from .pictures.inspection import draw_inspection
    from .runs.first_equilibrium import first_equilibrium
    from .runs.progress import Waiting

    try:
        with Waiting(f"looking whether {target.name} stands"):
            case = parse_case(text, target)
            assembly = case_assembly(case)
            found = first_equilibrium(case, assembly)
    except (ValueError, solver.SolveError) as error:
        print(f"blockvis: note: as it is, blockvis run refuses it: {error}", file=sys.stderr)
        return
    if found.stands:
        print(found.says)
    else:
        print(f"blockvis: note: {found.says}", file=sys.stderr)
    if drawing:
        layout = replace(layout_of(assembly), source=str(target), unit=case.unit or "m")
        try:
            # Its joints are closed: what is wider now is a place between arch and wall, and no mortar.
            shown = replace(inspected(layout), joints=Facing.none())
            drawn = draw_inspection(shown, target.with_suffix(".supports.png"), falling=found.falling, remark=remark)
            print(f"drawn with its supports in {drawn}")
        except MissingExtra as missing:
            print(f"blockvis: note: not drawn: {missing}", file=sys.stderr)


def _filled_walls(options: argparse.Namespace, choice: dict[str, Any]) -> tuple[Inspection, tuple[str, ...]] | None:
    """Fill the walls that a drawing has as outlines with openings, with bricks; None where it has none."""
    from .cases.bonds import Bonding, bonded
    from .formats.read import read_outlines
    from .generators.fill import Pattern
    from .layout.inspect import inspected
    from .layout.regions import Choice
    from .layout.unfilled import walls_to_fill

    outlines = read_outlines(options.drawing, unit=options.unit, **choice)
    walls = tuple(walls_to_fill(outlines, pages=False))
    if not walls:
        return None
    return inspected(bonded(outlines, [Bonding(Choice(walls), Pattern())], options.drawing, mortar=False)), walls


def _schema(options: argparse.Namespace) -> int:
    from .case_files.schema import case_schema
    from .studies.study_keys import study_schema

    # ASCII, so that it is valid JSON in whatever encoding a shell writes it to a file.
    schema = study_schema() if options.file == "study" else case_schema()
    print(json.dumps(schema, indent=2))
    return 0


def _example(options: argparse.Namespace) -> int:
    from .case_files.shipped_cases import copy_case, first_sentence, shipped_cases

    if options.example is None:
        cases = shipped_cases()
        width = max(map(len, cases))
        print("\n".join(f"{name:<{width}}  {first_sentence(case)}" for name, case in cases.items()))
        return 0
    case, *others = copy_case(options.example, overwrite=options.force)
    tables = [path for path in others if path.suffix == ".csv"]
    command = f"explain {case} --observed {tables[0]} finds the cause" if tables else f"run {case} solves it"
    print(f"copied {', '.join(str(path) for path in (case, *others))}; blockvis {command}")
    return 0


def _run_numbers(text: str) -> tuple[int, ...]:
    parts = [part.strip() for part in text.split(",") if part.strip()]
    for part in parts:
        if not part.isdecimal():
            raise ValueError(f"--keep names '{part}', no number of a run; write them like 0,17,42")
    return tuple(int(part) for part in parts)


def _run(options: argparse.Namespace) -> int:
    from .case_files.read import read_case
    from .runs.outputs import Drawing
    from .runs.run import resume_run, run_case

    outputs = options.outputs
    if outputs is None:
        outputs = (Drawing(film=not options.no_film, pictures=not options.no_pictures),)
    started, seconds = time.perf_counter(), options.increment_seconds
    if seconds is not None:
        seconds = _number(seconds)
        if not seconds > 0.0:
            raise ValueError(f"--increment-seconds is {seconds:g}; give seconds above 0")
    if options.resume is not None:
        if options.case is not None or options.output is not None or options.force or options.set:
            raise ValueError("--resume takes the results folder alone; the case is stored in it")
        with _checking(options, None) as checking:
            run = resume_run(options.resume, outputs=outputs, increment_seconds=seconds)
            if run.had_finished:
                print(
                    f"blockvis: this run had finished ({run.response.stop}); nothing was left to solve", file=sys.stderr
                )
            return _report_ending(options, run, checking, started)
    if options.case is None:
        raise ValueError("name a case file: blockvis run CASE.toml, or go on with a run: blockvis run --resume OUT")
    case = read_case(options.case, [*options.set, *(["analysis.range=true"] if options.range else [])])
    with _checking(options, case) as checking:
        run = run_case(case, options.output, overwrite=options.force, outputs=outputs, increment_seconds=seconds)
        return _report_ending(options, run, checking, started)


@contextlib.contextmanager
def _checking(options: argparse.Namespace, case: Case | None) -> Iterator[StepChecking | None]:
    """Follow a path in shorter steps meanwhile, unless it is not wanted."""
    from .runs.once_more import takes_steps
    from .runs.step_check import STEP_CHECK, StepChecking, stored_case

    folder, checking = None, None
    if case is None:
        folder = Path(options.resume)
        # What is wrong with the folder is told by what reads it to go on.
        with contextlib.suppress(ValueError, OSError):
            case = stored_case(folder)
    known = folder is not None and (folder / STEP_CHECK).is_file()
    wanted = not known if options.check_steps is None else options.check_steps
    if case is not None and wanted and takes_steps(case):
        checking = StepChecking(case, folder)
    try:
        yield checking
    finally:
        if checking is not None:
            checking.close()


def _report_ending(options: argparse.Namespace, run: Run, checking: StepChecking | None, started: float) -> int:
    """Say what a run came to, and how exact it is; gives the exit code."""
    print(_in_words(run.response, run.folder), flush=True)
    for problem in run.missing:
        print(f"blockvis: everything but the pictures is written: {problem}", file=sys.stderr)
    stop = run.response.stop
    if stop is solver.Status.INTERRUPTED:
        print(f"blockvis: go on with it by {resume_command(run.folder)}", file=sys.stderr)
        return INTERRUPTED
    _say_error(options, run, checking, max(PATIENCE * (time.perf_counter() - started), LEAST_PATIENCE))
    _say_range(options, run)
    if stop is solver.Status.SOLVER_FAILED:
        return SOLVER_FAILED
    if stop is solver.Status.NO_INITIAL_EQUILIBRIUM:
        return NO_EQUILIBRIUM
    return NO_PICTURES if run.missing else 0


def _say_error(options: argparse.Namespace, run: Run, checking: StepChecking | None, patience: float) -> None:
    """Say how far the path is from that in shorter steps, if it is asked for or known soon enough."""
    from .runs.step_check import STEP_CHECK, check_steps

    if run.had_finished and not options.check_steps and (run.folder / STEP_CHECK).is_file():
        return
    check, unknown, interrupted = None, "", False
    if checking is not None and run.response.path:
        try:
            most = None if options.check_steps else patience
            check = checking.compared(run.folder, run.response, most, lambda: _say_waiting(most))
            unknown = "" if check else "the same path in shorter steps came to nothing"
        except TimeoutError as late:
            unknown = f"{late}; --check-steps waits for it, --no-check-steps does without"
        except _Ended:
            raise KeyboardInterrupt("error not known: interrupted; everything else is written") from None
        except KeyboardInterrupt:
            unknown, interrupted = "interrupted; everything else is written", True
    if check is None and options.check_steps and not interrupted:
        check = check_steps(run.folder)
    if check is None and unknown:
        print(f"blockvis: error not known: {unknown}", file=sys.stderr)
    if check is None:
        return
    print(check)
    if (run.folder / "report.html").is_file():
        from .report.page import add_error

        add_error(run.folder / "report.html", str(check))
    if check.warning:
        warnings.warn(check.warning, stacklevel=2)


def _say_waiting(patience: float | None) -> None:
    most = "" if patience is None else f", for {patience:.0f} s at most"
    print(f"blockvis: waiting for the same path in shorter steps{most}; Ctrl-C leaves it", file=sys.stderr)


def _say_range(options: argparse.Namespace, run: Run) -> None:
    """Find and say the range of a path where it is asked for and not known."""
    from .results.fall_files import known_fall
    from .results.folder import RANGE
    from .runs.outputs import draw_curves, write_report_of
    from .runs.path_range import UNFINISHED, find_range
    from .runs.step_check import stored_case

    # What has no path has no range, and says why.
    failed = run.response.stop in (solver.Status.NO_INITIAL_EQUILIBRIUM, *UNFINISHED)
    stopped = failed or not run.response.path
    asked = options.range or stored_case(run.folder).settings is True
    if stopped or not asked or (run.had_finished and not options.range and (run.folder / RANGE).is_file()):
        return
    seconds = sum(increment.seconds for increment in run.response.increments)

    def waiting(runs: int, at_once: int) -> None:
        about = math.ceil(runs / at_once) * (seconds + PROCESS_SECONDS)
        print(
            f"blockvis: range: {runs} more runs, {at_once} at a time, about {about:.0f} s; Ctrl-C leaves them, "
            f"{resume_command(run.folder)} --range makes them later",
            file=sys.stderr,
        )

    try:
        print(find_range(run.folder, waiting))
    except KeyboardInterrupt:
        raise KeyboardInterrupt("range not known: interrupted; everything else is written") from None
    draw_curves(run.response, run.folder, [n for n in ("curve.png", "curve.svg") if (run.folder / n).is_file()])
    if (run.folder / "report.html").is_file():
        write_report_of(run.response, run.folder, known_fall(run.response))


def _info(options: argparse.Namespace) -> int:
    from .formats.read import inspect
    from .layout.assemble import supports_of
    from .layout.ground import ground_of
    from .layout.refusal import Refused
    from .layout.roles import roles_of
    from .pictures.inspection import draw_inspection, draw_refusal
    from .runs.progress import Waiting

    choice = _choice(options)
    try:
        with Waiting(f"reading {options.file}"):
            found = inspect(options.file, unit=options.unit, dimension=_dimension(options), **choice)
    except Refused as refused:
        if options.picture:
            # Why there is no picture does not replace why there are no blocks.
            try:
                drawn = draw_refusal(refused, options.picture)
                print("nothing was read that could be drawn" if drawn is None else f"drawn in {drawn}")
            except (ValueError, OSError) as error:
                print(f"blockvis: no picture: {error}", file=sys.stderr)
        raise
    print(found)
    if options.picture:
        # As blockvis new would have it: supports by their names, and a ground below.
        ground = ground_of(found)
        found = replace(found, roles=tuple(roles_of(found.layout, ground.roles)))
        laid = supports_of(ground.supports, found.layout.dimension)
        print(f"drawn in {draw_inspection(found, options.picture, ground=laid, remark=ground.remark)}")
    return 0


def _convert(options: argparse.Namespace) -> int:
    from .formats.read import read_layout, write_layout
    from .layout.assemble import assemble
    from .layout.layout import layout_of
    from .layout.roles import without_twins
    from .runs.progress import Waiting

    target = _new_file(options.target, options.force)
    if (Path(options.source) / "assembly.npz").is_file():
        return _convert_results(options, target)
    choice = _choice(options)
    with Waiting(f"reading {options.source}"):
        layout = read_layout(options.source, unit=options.unit, dimension=_dimension(options), **choice)
    layout, twins = without_twins(layout, {})
    for note in (*layout.notes, *([twins] if twins else [])):
        print(f"blockvis: note: {note}", file=sys.stderr)
    joint = options.joint_thickness if options.joint_thickness == "auto" else _number(options.joint_thickness)
    if joint:
        # An assembly says of every block what the drawing may leave open: thickness, density and role.
        layout = replace(layout, blocks=layout_of(assemble(layout, joint_thickness=joint)).blocks)
    write_layout(layout, target)
    return _say_written(layout.n_blocks, target)


def _say_written(n_blocks: int, target: Path) -> int:
    from solver.mechanics import counted

    print(f"{counted(n_blocks, 'block')} written to {target}")
    return 0


def _convert_results(options: argparse.Namespace, target: Path) -> int:
    """Write a results folder as one file: a series, an animation, or the blocks where they are at the end."""
    import numpy as np

    from solver import mechanics
    from solver.mechanics import counted

    from .pictures.captions import loss_words
    from .results.about import in_phase, unit_in
    from .results.fall_files import known_fall
    from .runs.reopen import open_results

    bare = vars(_options(["convert", options.source, options.target]))
    given = [name for name, default in bare.items() if name != "force" and getattr(options, name) != default]
    suffix = target.suffix.lower()
    # As files of bodies want them, blocks of the plane may be put into space.
    into_space = options.dimension == "3" and suffix not in (".vtkhdf", ".glb")
    if given != ["dimension"] * into_space:
        raise ValueError(
            f"--{given[0].replace('_', '-')} is of layout files; '{options.source}' holds results: leave it out"
        )
    response = open_results(options.source)
    gone = loss_words(response.path[-1]) if response.path else []
    if suffix == ".vtkhdf":
        from .results.vtkhdf import write_vtkhdf

        write_vtkhdf(response, target)
        increments, blocks = counted(len(response.path), "increment"), counted(response.assembly.n_blocks, "block")
        print(f"{increments} of {blocks} written to {target}")
        return 0
    if suffix == ".glb":
        from .pictures.animated_glb import write_animated_glb

        write_animated_glb(response, target, known_fall(response))
        vanishing = f"; vanishing on the way: {', '.join(gone)}" if gone else ""
        print(f"{counted(response.assembly.n_blocks, 'block')} that move written to {target}{vanishing}")
        return 0
    from .formats.read import write_layout
    from .layout.layout import layout_of, standing

    if not response.path:
        raise ValueError(f"there is no deformed layout: {response.message or response.stop}")
    last = response.path[-1]
    layout = layout_of(response.assembly, pose=last.pose).chosen(np.flatnonzero(~last.fallen))
    if into_space and layout.dimension == 2:
        layout = standing(layout, 1.0)
    write_layout(layout, target)
    unit, phase = unit_in(response, last.phase), in_phase(response, last.phase)
    where = f"{response.parameter.name} {last.parameter:.6g} {unit}".rstrip() + phase
    # Layouts are blocks alone.
    tied = int((last.ties.states != mechanics.ABSENT).sum())
    gone += [counted(tied, "tie")] if tied else []
    left_out = f"; left out: {', '.join(gone)}" if gone else ""
    print(f"{counted(layout.n_blocks, 'block')} written to {target}, as they are at {where}{left_out}")
    return 0


def _bond(options: argparse.Namespace) -> int:
    from .cases.bonds import bonded, read_bond
    from .cases.toml_table import Table
    from .formats.read import read_outlines, write_layout
    from .layout.unfilled import walls_to_fill
    from .runs.progress import Waiting

    target = _new_file(options.output, options.force)
    given = dict(_parameter(word) for word in options.parameters)
    # Layers may be called 0 or 1.5.
    words: dict[str, Any] = {
        key: str(of) for key, of in given.items() if key in ("walls", "openings") and isinstance(of, int | float)
    }
    with Waiting(f"reading {options.drawing}"):
        outlines = read_outlines(options.drawing, unit=options.unit, **_choice(options))
    if "walls" not in given and (found := list(walls_to_fill(outlines, pages=False))):
        words["walls"] = found
        print(f"blockvis: note: walls = {json.dumps(found)}: outlines with openings in them", file=sys.stderr)
    table = Table(given | words, "bond", Path(options.drawing))
    layout = bonded(outlines, [read_bond(table)], str(options.drawing), mortar=True)
    for note in layout.notes:
        print(f"blockvis: note: {note}", file=sys.stderr)
    write_layout(layout, target)
    return _say_written(layout.n_blocks, target)


def _layout(options: argparse.Namespace) -> int:
    from .formats.read import save_layout
    from .generators import build

    target = _new_file(options.output, options.force)
    assembly = build(options.name, dict(_parameter(given) for given in options.parameters))
    save_layout(assembly, target)
    return _say_written(assembly.n_blocks, target)


def _render(options: argparse.Namespace) -> int:
    from .pictures.crack_drawing import draw_cracks
    from .pictures.render import animate, draw_mechanism, draw_still
    from .results.fall_files import known_fall
    from .runs.outputs import draw_curves, write_report_of
    from .runs.progress import DrawingProgress
    from .runs.reopen import open_results
    from .runs.underlay import stored_underlay

    folder = Path(options.results)
    response = open_results(folder)
    size = None if options.size is None else _size(options.size)
    seen_from = _seen_from(options, folder, response)
    if options.cracks is not None:
        draw_cracks(response, options.cracks, folder / "cracks.png", size=size, **seen_from)
        print(f"drawn in {folder}/: cracks.png")
        return 0
    underlay = stored_underlay(folder)
    fall = known_fall(response)
    write_report_of(response, folder, fall)
    drawn = ["report.html"]
    if response.path:
        curves = ["curve.png", "curve.svg"]
        draw_curves(response, folder, curves)
        drawn += curves
    look = {
        "magnification": options.magnification,
        "colour_by": options.colour_by,
        "forces": options.forces,
        "curve": options.curve,
        "underlay": underlay,
    }
    last = response.path[-1] if response.path else response.increments[-1]
    draw_still(response, last, folder / "last.png", size=size, **look, **seen_from)
    draw_mechanism(response, folder / "mechanism.png", size=size, underlay=underlay, **seen_from)
    drawn += ["last.png", "mechanism.png"]
    if response.parameter.is_path:
        draw_cracks(response, -1, folder / "cracks.png", size=size, **seen_from)
        drawn.append("cracks.png")
    if options.animation != "none":
        look |= seen_from | {"poster": folder / "poster.png"}
        with DrawingProgress() as progress:
            film = folder / options.animation
            animate(response, film, size=size, fall=fall, progress=progress.frame, **look)
        drawn += [options.animation, "poster.png"]
    print(f"drawn in {folder}/: {', '.join(drawn)}")
    return 0


def _report(options: argparse.Namespace) -> int:
    from .results.fall_files import known_fall
    from .runs.outputs import write_report_of
    from .runs.reopen import open_results

    folder = Path(options.results)
    if not options.pdf and (options.view or options.section):
        raise ValueError("--view and --section are of the report on paper, report.html turns; add --pdf")
    response = open_results(folder)
    fall = known_fall(response)
    write_report_of(response, folder, fall)
    written = ["report.html"]
    if options.pdf:
        from .report.pdf import write_pdf
        from .results.reaction_range import stored_range
        from .results.record import case_text
        from .runs.step_check import stored_check
        from .runs.underlay import stored_underlay

        write_pdf(
            response,
            folder / "report.pdf",
            case_text(folder),
            fall=fall,
            error=str(stored_check(folder) or ""),
            band=stored_range(folder),
            underlay=stored_underlay(folder),
            **_seen_from(options, folder, response),
        )
        written.append("report.pdf")
    print(f"written in {folder}/: {', '.join(written)}")
    return 0


def _seen_from(options: argparse.Namespace, folder: Path, response: solver.Response) -> dict[str, Any]:
    """Take view and section from the command line, or from the case of a results folder."""
    from .cases.toml_table import toml_value
    from .runs.outputs import seen_from
    from .runs.reopen import case_of

    case = case_of(folder)
    found = {} if case is None else seen_from(case, response)
    if options.view is not None:
        angles = [] if "{" in options.view else [toml_value(angle) for angle in options.view.split(",")]
        two = len(angles) == 2
        found["view"] = dict(zip(("azimuth", "elevation"), angles, strict=True)) if two else toml_value(options.view)
    if options.section is not None:
        found["section"] = toml_value(options.section)
    return found


def _choice(options: argparse.Namespace) -> dict[str, Any]:
    """Take what is read of a drawing, and the scale of an image."""
    keys = ("view", "ignore", "only", "window", "width", "height", "pixel", "smallest")
    background = options.background
    given = int(background) if background is not None and background.isdecimal() else background
    return {key: getattr(options, key) for key in keys} | {"background": given}


def _new_file(path: str, force: bool) -> Path:
    target = Path(path)
    if target.exists() and not force:
        raise ValueError(f"'{target}' is there already; choose another name or add --force")
    return target


def _dimension(options: argparse.Namespace) -> int | str:
    return "auto" if options.dimension == "auto" else int(options.dimension)


def _size(text: str) -> tuple[int, int]:
    """Read the size of pictures in pixels, as in 1280x720."""
    width, _, height = text.partition("x")
    if not (width.isdecimal() and height.isdecimal() and min(int(width), int(height)) >= SMALLEST_PICTURE):
        raise ValueError(
            f"--size is '{text}'; give width and height in pixels, as in 1280x720, at least {SMALLEST_PICTURE} each"
        )
    return int(width), int(height)


class _NoNumber(argparse.ArgumentTypeError, ValueError):
    """A word of the command line is no number, in the words of a parser too."""


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        whole, comma, part = text.partition(",")
        digits = whole.lstrip("-").isdigit() and part.isdigit()
        remedy = f"; numbers have a point: {whole}.{part}" if comma and digits else ""
        raise _NoNumber(f"'{text}' is not a number{remedy}") from None


def _parameter(given: str) -> tuple[str, Any]:
    """Read a parameter "key=value" of the command line; the value as TOML writes it, or a plain word."""
    from .cases.toml_table import toml_value

    key, equals, value = given.partition("=")
    if not equals:
        raise ValueError(f"'{given}' is not a parameter; write key=value, for instance voussoirs=12")
    return key.strip(), toml_value(value)


def _levels(fill: solver.Backfill) -> str:
    low = f"from {fill.base:g} m " if math.isfinite(fill.base) else ""
    return f"{low}up to {fill.surface:g} m"


def _in_words(response: solver.Response, folder: Path) -> str:
    import numpy as np

    from solver.mechanics import counted, worst_of

    from .kinds.kinds import KINDS
    from .results.about import certified
    from .results.ties import tie_courses, tie_texts

    kind = KINDS[response.analysis]
    assembly, weight = response.assembly, response.total_weight
    size = np.ptp(assembly.vertices[assembly.free[assembly.block_of_vertex]], axis=0).tolist()
    block = int(np.argmax(np.where(assembly.free, assembly.shapes.volumes, 0.0)))
    largest = assembly.vertices[assembly.block_of_vertex == block]
    across = float(np.linalg.norm(largest[:, None, :] - largest[None, :, :], axis=2).max())
    deep = f"{size[1]:.4g} m deep, " if assembly.dimension == 3 else ""
    lines = [
        f"{counted(assembly.n_blocks, 'block')}{' in space' if deep else ''} ({int(assembly.free.sum())} free), "
        f"{size[0]:.4g} m wide, {deep}{size[-1]:.4g} m high, weight {weight:.6g} N, "
        f"largest block {across:.3g} m across",
        *(f"fill {_levels(fill)}, weight {fill.weight(assembly):.6g} N" for fill in response.loads.fills),
        f"{kind.headline(response)}, {sum(i.programs for i in response.increments)} "
        f"programs, {sum(i.seconds for i in response.increments):.2f} s of solver time",
    ]
    if response.message and not kind.covers_message(response):
        lines.append(response.message)
    lines += kind.lines(response)
    lines += [": ".join(filter(None, tie_texts(course, response))) for course in tie_courses(response)]
    worst = worst_of(i.certificate for i in certified(response))
    if worst is not None:
        measures = {
            "equilibrium residual {:.1e} W": worst.equilibrium_residual,
            "friction exceeded by {:.1e} W": worst.friction_excess,
            "duality gap {:.1e}": worst.duality_gap,
            "penetration {:.1e} m": worst.largest_penetration,
        }
        lines.append(f"certificate: {', '.join(t.format(v) for t, v in measures.items() if np.isfinite(v))}")
    lines.append(f"results in {folder}/")
    return "\n".join(lines)


def _notes_without_repeats() -> Callable[..., None]:
    """Make what shows warnings as notes, each once: a case may be checked more than once."""
    said: set[str] = set()

    def show(message: Warning | str, *_: object, **__: object) -> None:
        if str(message) not in said:
            said.add(str(message))
            # On a terminal a line of what takes long may stand there.
            clear = "\r\x1b[K" if sys.stderr.isatty() else ""
            print(f"{clear}blockvis: note: {message}", file=sys.stderr)

    return show
