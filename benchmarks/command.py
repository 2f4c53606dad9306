"""The whole command: wall-clock seconds and memory of ``blockvis run``, split into its parts.

    python benchmarks/command.py [CASE.toml ...] [--repeat N]

Of N runs the fastest is shown. "start" is what Python and the imports take before the case is read, "write" has no VTU
files and "curve" is nothing where the process that draws the film makes them, "fall" and "film" are the wait for it and
the files of the fall, "rest" what belongs to no part. Memory is the most of the first process, and of the
largest of the others (the film's, its encoder); both in MiB. The second line has the processor seconds of the first
process in each part, and of the first and the others in all: they tell a slow command from a busy machine.
"""

from __future__ import annotations

import gc
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import ClassVar

EXAMPLES = Path(__file__).parents[1] / "examples"
PARTS = ("start", "read", "solve", "write", "fall", "report", "curve", "mechanism", "film", "rest")


def one_run(case: str, begun: float) -> None:
    """What the child does: the command, as the console script runs it, and the seconds of its parts as JSON."""
    import blockvis.cli
    import blockvis.runs.run as run

    started, loaded, kept = time.time(), time.process_time(), []

    class _Clock(run.Clock):
        """That also counts processor seconds."""

        processor: ClassVar[dict[str, float]] = {}

        @contextmanager
        def counting(self, part: str) -> Iterator[None]:
            before = time.process_time()
            with super().counting(part):
                yield
            self.processor[part] = self.processor.get(part, 0.0) + time.process_time() - before

    run_case = run.run_case

    def watched(*arguments: object, **options: object) -> run.Run:
        kept.append(run_case(*arguments, **options))  # type: ignore[arg-type]
        return kept[-1]

    run.run_case, run.Clock = watched, _Clock
    with tempfile.TemporaryDirectory() as folder:
        code = blockvis.cli.main(["run", case, "-o", f"{folder}/out"])
    seconds = {"start": started - begun} | kept[0].stages
    shares = {"start": loaded} | _Clock.processor
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    processor = [one.ru_utime + one.ru_stime for one in used]
    memory = [one.ru_maxrss / 1024 for one in used]
    found = {"code": code, "seconds": seconds, "memory": memory, "processor": processor, "shares": shares}
    print("\n" + json.dumps(found))
    # As the console script ends.
    gc.freeze()


def measured(case: Path) -> dict[str, object]:
    """One run in a process of its own."""
    begun = time.time()
    child = subprocess.run(
        [sys.executable, __file__, "--one", str(case), repr(begun)], check=True, stdout=subprocess.PIPE, text=True
    )
    total = time.time() - begun
    found: dict[str, object] = json.loads(child.stdout.splitlines()[-1])
    seconds: dict[str, float] = found["seconds"]  # type: ignore[assignment]
    return found | {"total": total, "seconds": seconds | {"rest": total - sum(seconds.values())}}


def main(cases: list[Path], repeat: int) -> None:
    print(f"{os.cpu_count()} cores; seconds, MiB")
    print(f"{'case':28} {'total':>6} " + " ".join(f"{part:>9}" for part in PARTS) + "   memory  others")
    for case in cases:
        best = min((measured(case) for _ in range(repeat)), key=lambda found: found["total"])  # type: ignore[arg-type]
        seconds, (own, others) = best["seconds"], best["memory"]  # type: ignore[misc]
        parts = " ".join(f"{seconds.get(part, 0.0):9.2f}" for part in PARTS)  # type: ignore[attr-defined]
        print(f"{case.stem:28} {best['total']:6.2f} {parts}  {own:7.0f} {others:7.0f}", flush=True)
        first, rest = best["processor"]  # type: ignore[misc]
        shares: dict[str, float] = best["shares"]  # type: ignore[assignment]
        shares["rest"] = first - sum(shares.values())
        parts = " ".join(f"{shares.get(part, 0.0):9.2f}" for part in PARTS)
        print(f"{'  processor':28} {first + rest:6.2f} {parts}   {first:.2f} + {rest:.2f}", flush=True)


if __name__ == "__main__":
    if sys.argv[1:2] == ["--one"]:
        one_run(sys.argv[2], float(sys.argv[3]))
    else:
        given = sys.argv[1:]
        repeat = int(given.pop(given.index("--repeat") + 1)) if "--repeat" in given else 3
        main([Path(name) for name in given if name != "--repeat"] or [EXAMPLES / "semicircular_arch.toml"], repeat)
