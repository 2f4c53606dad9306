"""How long a stranger waits: every example, every parametric layout and any drawings, run as they are.

    python benchmarks/many_drawings.py OUT.jsonl [DRAWING or FOLDER ...] [--seconds 60]
    python benchmarks/many_drawings.py OUT.jsonl --summary

A case is run, a layout written and then treated like a drawing: ``blockvis new`` proposes a case for it, which is run.
Films and the second run that tells the error of the steps are left out. Each is a process of its own that is ended
after so many seconds of the processor, and a line of OUT.jsonl; what is there already is not run again.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from blockvis.formats import FORMATS
from blockvis.generators import catalogue

ROOT = Path(__file__).parents[1]

#: What is shown of the distribution.
QUANTILES = (0.1, 0.25, 0.5, 0.75, 0.9, 1.0)

#: Exit codes of a run in words.
ENDINGS = {0: "done", 2: "refused", 3: "solver failed", 5: "does not stand"}


def asked_for(given: Sequence[Path], folder: Path) -> Iterator[tuple[str, Path]]:
    """Name and file of each: cases of the examples, drawings of layouts, and drawings in files and folders."""
    for case in sorted((ROOT / "examples").rglob("*.toml")):
        # A study or an explanation is many runs.
        if case.parent.name not in ("studies", "explain"):
            yield f"examples/{case.relative_to(ROOT / 'examples')}", case
    for name in sorted(catalogue.LAYOUTS):
        yield f"layout {name}", folder / f"{name.replace(' ', '_')}.json"
    for place in given:
        files = sorted(place.rglob("*")) if place.is_dir() else [place]
        for file in files:
            if file.suffix.lower() in FORMATS:
                yield f"{place.name}/{file.relative_to(place)}" if place.is_dir() else file.name, file.resolve()


def command(arguments: Sequence[str | Path], folder: Path, seconds: float) -> tuple[int, str, float, float]:
    """Carry out a command of blockvis: its exit code, what it printed, processor seconds and largest memory [MiB]."""

    def limited() -> None:
        resource.setrlimit(resource.RLIMIT_CPU, (int(seconds) + 1, int(seconds) + 5))

    with (folder / "said.txt").open("w+", encoding="utf-8") as said:
        process = subprocess.Popen(
            [sys.executable, "-m", "blockvis", *map(str, arguments)],
            cwd=folder,
            env={**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"},
            preexec_fn=limited,
            stdout=said,
            stderr=subprocess.STDOUT,
        )
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
        said.seek(0)
        words = said.read()
    return process.returncode, words, usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024.0


def run(name: str, file: Path, folder: Path, seconds: float) -> dict[str, Any]:
    """Run one: how it ended, its blocks, and its processor seconds, those of ``blockvis new`` among them."""
    case, spent = file, 0.0
    if name.startswith("layout "):
        code, said, _, _ = command(["layout", name.removeprefix("layout "), "-o", file], folder, seconds)
        if code:
            return {"name": name, "ending": "refused", "seconds": 0.0, "said": said.strip().splitlines()[-1]}
    if file.suffix != ".toml":
        case = folder / "case.toml"
        code, said, spent, _ = command(["new", file, "-o", case, "--force"], folder, seconds)
        if code:
            ending = ENDINGS.get(code, "given up" if code < 0 else f"exit code {code}")
            return {"name": name, "ending": ending, "seconds": spent, "said": (said.strip().splitlines() or [""])[-1]}
    out = folder / "out"
    code, said, running, memory = command(
        ["run", case, "-o", out, "--force", "--no-film", "--no-check-steps"], folder, seconds - spent
    )
    found = {"ending": ENDINGS.get(code, "given up" if code < 0 else f"exit code {code}"), "seconds": spent + running}
    lines = said.strip().splitlines() or [""]
    blocks = next((int(line.split(" block")[0].split()[-1]) for line in lines if " free), " in line), 0)
    return {"name": name, **found, "reading": spent, "blocks": blocks, "memory": round(memory), "said": lines[-1]}


def summary(rows: Sequence[dict[str, Any]]) -> str:
    """Endings, the distribution of seconds of those that were run, and the five that took longest."""
    ran = [row for row in rows if row["ending"] != "refused"]
    seconds = np.array([row["seconds"] for row in ran])
    endings = Counter(row["ending"] for row in rows)
    lines = [f"{len(rows)} structures: " + ", ".join(f"{n} {ending}" for ending, n in endings.most_common())]
    shown = "  ".join(f"{100 * q:.0f} %: {np.quantile(seconds, q):.1f} s" for q in QUANTILES)
    lines += [f"processor seconds of the {len(ran)} that were run: {shown}", "longest:"]
    for row in sorted(ran, key=lambda one: -one["seconds"])[:5]:
        lines.append(f"  {row['seconds']:6.1f} s  {row.get('blocks', 0):5d} blocks  {row['ending']}  {row['name']}")
    return "\n".join(lines)


def main() -> None:
    """Read the options, run what is not there yet, and print the distribution."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("file", type=Path)
    options.add_argument("drawings", nargs="*", type=Path)
    options.add_argument("--seconds", type=float, default=60.0, help="processor time of one, new and run together")
    options.add_argument("--only", default="", help="those whose names begin so")
    options.add_argument("--summary", action="store_true", help="only the distribution of what is there")
    given = options.parse_args()
    rows = {}
    if given.file.exists():
        for line in given.file.read_text(encoding="utf-8").splitlines():
            rows[json.loads(line)["name"]] = json.loads(line)
    with tempfile.TemporaryDirectory() as scratch:
        for name, file in () if given.summary else asked_for(given.drawings, Path(scratch)):
            if name in rows or not name.startswith(given.only):
                continue
            rows[name] = run(name, file, Path(scratch), given.seconds)
            with given.file.open("a", encoding="utf-8") as stream:
                stream.write(json.dumps(rows[name]) + "\n")
            print(f"{rows[name]['seconds']:6.1f} s  {rows[name]['ending']:14s} {name}", flush=True)
    print(summary(list(rows.values())))


if __name__ == "__main__":
    main()
