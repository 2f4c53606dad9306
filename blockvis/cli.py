"""The command line: one verb, one public function."""

from __future__ import annotations

import argparse
import sys
import warnings
from collections.abc import Sequence
from pathlib import Path

import numpy as np

import solver

__all__ = ["entry", "main"]

#: Exit codes: bad input, a solver failure, everything written but the pictures, Ctrl-C.
BAD_INPUT, SOLVER_FAILED, NO_PICTURES, INTERRUPTED = 2, 3, 4, 130


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the command line and returns its exit code.

    Parameters
    ----------
    arguments : sequence of str, optional
        Those of the process by default.
    """
    options = _parser().parse_args(arguments)
    warnings.showwarning = _show_warning
    try:
        code: int = options.verb(options)
    except (ValueError, OSError) as error:
        print(f"blockvis: {error}", file=sys.stderr)
        return BAD_INPUT
    except solver.SolveError as error:
        print(f"blockvis: the linear program could not be solved: {error}", file=sys.stderr)
        return SOLVER_FAILED
    except KeyboardInterrupt:
        print("blockvis: interrupted", file=sys.stderr)
        return INTERRUPTED
    return code


def entry() -> None:
    """Console script."""
    sys.exit(main())


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="blockvis", description="How dry-jointed masonry cracks on settling supports, and how far it can go."
    )
    verbs = parser.add_subparsers(required=True, metavar="VERB")
    run = verbs.add_parser("run", help="solve a case, write everything, draw")
    run.add_argument("case", metavar="CASE.toml")
    run.add_argument("-o", "--output", metavar="OUT", help="results folder (default: <case>-results)")
    run.add_argument("--force", action="store_true", help="replace results that are there already")
    run.set_defaults(verb=_run)
    return parser


def _run(options: argparse.Namespace) -> int:
    from .run import run_case

    run = run_case(options.case, options.output, overwrite=options.force)
    print(_in_words(run.response, run.folder))
    for problem in run.missing:
        print(f"blockvis: everything but the pictures is written: {problem}", file=sys.stderr)
    stop = run.response.stop
    if stop is solver.Status.INTERRUPTED:
        return INTERRUPTED
    if stop is solver.Status.SOLVER_FAILED:
        return SOLVER_FAILED
    return NO_PICTURES if run.missing else 0


def _in_words(response: solver.Response, folder: Path) -> str:
    """The summary of a run for a reader."""
    path, unit = response.path, response.settlements[-1].unit
    width, height = np.ptp(
        response.assembly.vertices[response.assembly.free[response.assembly.block_of_vertex]], axis=0
    )
    weight = response.total_weight
    lines = [
        f"{response.assembly.n_blocks} blocks ({int(response.assembly.free.sum())} free), "
        f"{width:.4g} m wide, {height:.4g} m high, weight {weight:.6g} N",
        f"{response.stop} after {len(path)} increments, {sum(i.programs for i in response.increments)} linear "
        f"programs, {sum(i.seconds for i in response.increments):.2f} s of solver time",
    ]
    if response.collapse is None and response.message:
        lines.append(response.message)
    if path:
        lines.append(f"first reaction       {path[0].reaction:12.6g} N   {path[0].reaction / weight:.6f} W")
    if response.collapse is not None:
        low, high = response.collapse.bracket
        last = response.collapse.reaction
        lines += [
            f"last reaction        {last:12.6g} N   {last / weight:.6f} W",
            f"collapse displacement{response.collapse.displacement:12.6g} {unit}   between {low:.6g} and {high:.6g}",
        ]
    elif len(path) > 1:
        lines.append(f"last reaction        {path[-1].reaction:12.6g} N   {path[-1].reaction / weight:.6f} W")
        lines.append(f"last settlement      {path[-1].settlement:12.6g} {unit}")
    if path:
        residual = max(i.certificate.equilibrium_residual for i in path)
        gap = max(i.certificate.duality_gap for i in path)
        penetration = max(i.certificate.largest_penetration for i in path)
        lines.append(
            f"certificate: equilibrium residual {residual:.1e} W, duality gap {gap:.1e}, "
            f"penetration {penetration:.1e} m"
        )
    lines.append(f"results in {folder}/")
    return "\n".join(lines)


def _show_warning(message: Warning | str, category: type[Warning], *_: object, **__: object) -> None:
    print(f"blockvis: note: {message}", file=sys.stderr)
