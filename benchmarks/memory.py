"""Memory of a run against the number of its increments: a wall whose right half settles, solved, written and drawn.

    python benchmarks/memory.py [blocks [increments ...]]

Each run has a process of its own. Resident: the most the process held when all was solved and written, and when all
was drawn, libraries and HiGHS included. Traced: the most that Python and numpy held at once, of another process.
"""

from __future__ import annotations

import json
import resource
import subprocess
import sys
import tempfile
import tracemalloc
from pathlib import Path
from typing import Any

from growth import BRICK, INCREMENT, wall_of

import blockvis
from blockvis.case_files.read import parse_case
from blockvis.results.folder import ResultsFolder

CASE = """
[geometry]
file = "wall.json"
[material]
friction_coefficient = 0.6
[settlement]
direction = [0.0, -1.0]
increment = {increment}
limit = {limit}
[output]
animation = "collapse.mp4"
"""


def peak() -> float:
    """Most memory the process has held so far [MiB]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def one_run(blocks: int, increments: int, traced: bool) -> dict[str, Any]:
    """Solves, writes and draws one wall."""
    solved: list[float] = []
    finish = ResultsFolder.finish

    def finished(*arguments: Any, **options: Any) -> Any:
        solved.append(tracemalloc.get_traced_memory()[1] / 2**20 if traced else peak())
        return finish(*arguments, **options)

    ResultsFolder.finish = finished  # type: ignore[method-assign]
    with tempfile.TemporaryDirectory() as name:
        folder, wall = Path(name), wall_of(blocks)
        blockvis.save_layout(wall, folder / "wall.json")
        if traced:
            tracemalloc.start()
        text = CASE.format(increment=INCREMENT, limit=increments * INCREMENT)
        run = blockvis.run_case(parse_case(text, folder / "case.toml"), folder / "out")
        drawn = tracemalloc.get_traced_memory()[1] / 2**20 if traced else peak()
        stored = (folder / "out" / "increments" / "state_00001.npz").stat().st_size / 1024
    assert not run.missing, run.missing
    return {
        "blocks": wall.n_blocks,
        "increments": run.summary["n_increments"],
        "status": run.summary["status"],
        "solved": solved[0],
        "drawn": drawn,
        "stored": stored,
    }


def main(blocks: int, sizes: list[int]) -> None:
    print(f"bricks of {BRICK[0]} m x {BRICK[1]} m, increments of {INCREMENT} m; MiB")
    print("blocks  increments  resident: solved  drawn   traced: solved  drawn")
    for increments in sizes:
        resident, traced = (
            json.loads(
                subprocess.run(
                    [sys.executable, __file__, "--one", str(blocks), str(increments), kind],
                    check=True,
                    stdout=subprocess.PIPE,
                    text=True,
                ).stdout
            )
            for kind in ("resident", "traced")
        )
        print(
            f"{resident['blocks']:6d}  {resident['increments']:10d}  {resident['solved']:16.0f} "
            f"{resident['drawn']:6.0f} {traced['solved']:16.1f} {traced['drawn']:6.1f}   {resident['status']}",
            flush=True,
        )


if __name__ == "__main__":
    if sys.argv[1:2] == ["--one"]:
        print(json.dumps(one_run(int(sys.argv[2]), int(sys.argv[3]), sys.argv[4] == "traced")))
    else:
        numbers = [int(given) for given in sys.argv[1:]] or [320]
        main(numbers[0], numbers[1:] or [12, 48])
