"""How time and memory grow with the number of blocks: running-bond walls whose right half settles.

    python benchmarks/growth.py [blocks ...]

By linear programs, whatever the size. Each size runs in a process of its own: the equilibrium at the start and the
first increment, and writing it. Seconds are processor time, split into finding contacts, linear programs, what else
the solver does, and output.
"""

from __future__ import annotations

import json
import math
import platform
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from importlib.metadata import version
from typing import Any

import numpy as np
import scipy

import blockvis
import solver
from blockvis import generators
from solver.path import stepping

SIZES = (50, 100, 200, 400, 800, 1600, 3200, 6400, 12800)
BRICK = 0.25, 0.125  # m
INCREMENT = 0.002  # m


def wall_of(blocks: int) -> solver.Assembly:
    """A running-bond wall of about so many bricks, five wide for every three courses."""
    courses = max(4, round(math.sqrt(0.6 * blocks)))
    bricks = max(4, 2 * round(blocks / courses / 2))
    width = bricks * BRICK[0]
    return generators.build(
        "wall",
        {
            "bricks": bricks,
            "courses": courses,
            "brick_length": BRICK[0],
            "brick_height": BRICK[1],
            "settling": [width / 2, width],
        },
    )


class Clock:
    """Processor time spent in functions that are wrapped."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self.calls: dict[str, int] = {}

    def timed(self, name: str, function: Callable[..., Any]) -> Callable[..., Any]:
        def wrapped(*arguments: Any, **options: Any) -> Any:
            started = time.process_time()
            try:
                return function(*arguments, **options)
            finally:
                self.seconds[name] = self.seconds.get(name, 0.0) + time.process_time() - started
                self.calls[name] = self.calls.get(name, 0) + 1

        return wrapped


def one_size(blocks: int, increments: int) -> dict[str, Any]:
    """Measures one wall."""
    clock = Clock()
    stepping.minimise = clock.timed("programs", stepping.minimise)
    stepping.find_contacts = clock.timed("contacts", stepping.find_contacts)
    assembly = wall_of(blocks)
    told = []

    def tell(increment: solver.Increment) -> None:
        told.append((time.process_time(), clock.calls["programs"], increment))

    started = time.process_time()
    settlement = solver.Settlement(direction=(0.0, -1.0), increment=INCREMENT, limit=increments * INCREMENT)
    response = solver.settle(assembly, settlement, friction_coefficient=0.6, on_increment=tell)
    solved = time.process_time() - started
    written = time.process_time()
    with tempfile.TemporaryDirectory() as folder:
        blockvis.write(response, folder, overwrite=True)
    written = time.process_time() - written
    certificate = [increment.certificate for increment in response.path]
    return {
        "blocks": assembly.n_blocks,
        "increments": increments,
        "contacts": len(response.path[-1].contacts),
        "programs": clock.calls["programs"],
        "solver s": solved,
        "contacts s": clock.seconds["contacts"],
        "programs s": clock.seconds["programs"],
        "rest s": solved - clock.seconds["contacts"] - clock.seconds["programs"],
        "output s": written / len(response.increments) * increments,
        "peak MiB": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
        "gap": max(c.duality_gap for c in certificate),
        "residual": max(c.equilibrium_residual for c in certificate),
        "status": str(response.stop),
    }


def main(sizes: list[int]) -> None:
    print(
        f"{platform.processor() or platform.machine()}, Python {platform.python_version()}, numpy {np.__version__}, "
        f"scipy {scipy.__version__}, highspy {version('highspy')}"
    )
    names = ("blocks", "contacts", "programs", "solver s", "contacts s", "programs s", "rest s", "output s", "peak MiB")
    print(" ".join(f"{name:>10}" for name in names), f"{'exponent':>9}")
    last = None
    for size in sizes:
        command = [sys.executable, __file__, "--one", str(size)]
        found = json.loads(subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout)
        row = " ".join(f"{found[name]:10d}" if name in names[:3] else f"{found[name]:10.2f}" for name in names)
        growth = ""
        if last is not None:
            ratio = math.log(found["solver s"] / last["solver s"]) / math.log(found["blocks"] / last["blocks"])
            growth = f"{ratio:9.2f}"
        print(row, growth, flush=True)
        last = found


if __name__ == "__main__":
    if sys.argv[1:2] == ["--one"]:
        print(json.dumps(one_size(int(sys.argv[2]), 1)))
    else:
        main([int(argument) for argument in sys.argv[1:]] or list(SIZES))
