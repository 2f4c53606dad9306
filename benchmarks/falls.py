"""What falls cost, and how far stones end in each other or in the air.

    python benchmarks/falls.py [arch portal wall corner barrel "cross vault" dome "dome of 281"]

Each structure is followed to its collapse and falls from its last equilibrium, in a process of its own on one thread.
Seconds are processor time of the fall, of all pushes that are tried. Overlaps and gaps are in sizes of the smaller
stone: the edge of the cube, in the plane of the square, as large as it. The gap is that of the stone at rest which is
farthest from all others, to the nearest of them. "Energy grows" is the most that it does from one of 25 poses a second
to the next, as a part of what is lost in the fall.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from first_increments import row

import blockvis
import solver
from blockvis import generators
from blockvis.cases.build import case_assembly, case_interfaces, case_loads
from blockvis.dynamics.engine import Engine
from blockvis.dynamics.fall import RATE, fall_of
from solver import mechanics

EXAMPLES = Path(__file__).parents[1] / "examples"

#: Libraries are held to one thread.
ONE_THREAD = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1")

#: Gaps up to so much are looked for, in block sizes.
NEAR = 0.05

#: Dynamics follows the fall: of the path a frame is enough.
SHORT = solver.Controls(falling_frames=1)


def example(name: str) -> solver.Response:
    """Follow an example to its collapse."""
    case = blockvis.read_case(EXAMPLES / f"{name}.toml")
    assembly = case_assembly(case)
    settlements = [replace(given, tolerance=1e-3, limit=max(given.limit, 0.6)) for given in case.settlements]
    return solver.settle(
        assembly, settlements, interfaces=case_interfaces(case), loads=case_loads(case, assembly), controls=SHORT
    )


def dome(lunes: int, courses: int) -> solver.Response:
    """Spread the supports of a dome as in ``examples/dome_spreading.toml`` until it falls."""
    assembly = generators.dome(thickness_ratio=0.12, lunes=lunes, courses=courses, cap=15.0)
    spread = solver.Settlement(radial_from=(0.0, 0.0), increment=0.05, limit=0.5, tolerance=1e-3)
    return solver.settle(assembly, spread, friction_coefficient=0.7, controls=SHORT)


def barrel() -> solver.Response:
    """Move one side of a barrel vault outwards until it falls."""
    side = solver.Settlement((1.0, 0.0, 0.0), increment=0.05, limit=0.5, tolerance=1e-3)
    return solver.settle(generators.barrel_vault(), side, friction_coefficient=0.7, controls=SHORT)


STRUCTURES: dict[str, Callable[[], solver.Response]] = {
    "arch": lambda: example("semicircular_arch"),
    "portal": lambda: example("portal_frame"),
    "wall": lambda: example("wall_with_arch"),
    "corner": lambda: example("corner_of_walls"),
    "barrel": barrel,
    "dome": lambda: dome(8, 6),
    "dome of 281": lambda: dome(20, 14),
}


class Watch:
    """What is measured while a structure falls, from its last push on."""

    def __init__(self) -> None:
        self.engine: Engine | None = None
        self.energies: list[float] = []
        self.overlaps: list[float] = []

    def __call__(self, engine: Engine) -> None:
        """Measure."""
        if engine is not self.engine:
            self.engine, self.energies, self.overlaps = engine, [], []
        self.energies.append(float(engine.energies.sum()))
        self.overlaps.append(largest_overlap(engine))


def sizes(assembly: solver.Assembly) -> np.ndarray:
    """(n_blocks,) array [m]: infinite for supports, so that those of free blocks count."""
    each = [assembly.shapes.size(block) for block in np.eye(assembly.n_blocks, dtype=bool)]
    return np.where(assembly.free, each, np.inf)


def largest_overlap(engine: Engine) -> float:
    """Largest overlap of a free block with another that is not taken away, in sizes of the smaller."""
    assembly, size = engine.assembly, sizes(engine.assembly)
    i, j, depth = assembly.shapes.overlaps(engine.corners, 1e-9 * assembly.block_size)
    met = (assembly.free[i] | assembly.free[j]) & ~(engine.removed[i] | engine.removed[j])
    return float((depth[met] / np.minimum(size[i], size[j])[met]).max(initial=0.0))


def largest_gap(engine: Engine) -> float:
    """Largest of the free blocks' gaps to what is nearest, in their sizes; infinite where nothing is near."""
    assembly = engine.assembly
    contacts = mechanics.find_contacts(assembly, engine.corners, NEAR * assembly.block_size)
    met = ~(engine.removed[contacts.block_a] | engine.removed[contacts.block_b])
    nearest = np.full(assembly.n_blocks, np.inf)
    for block in (contacts.block_a, contacts.block_b):
        np.minimum.at(nearest, block[met], np.maximum(contacts.gaps[met], 0.0))
    return float((nearest / sizes(assembly))[assembly.free].max())


def one(name: str) -> dict[str, Any]:
    """Let one structure fall, in this process."""
    response = STRUCTURES[name]()
    watch = Watch()
    start = time.process_time()
    fall = fall_of(response, watch=watch)
    seconds = time.process_time() - start
    if fall is None or watch.engine is None:
        raise SystemExit(f"'{name}' does not fall: {response.stop}")
    energies = np.array(watch.energies)
    lost = energies[0] - energies[-1]
    return {
        "stones": int(response.assembly.free.sum()),
        "seconds": seconds,
        "fallen": (len(energies) - 1) / RATE,
        "steps": watch.engine.steps,
        "programs": watch.engine.programs,
        "end": watch.overlaps[-1],
        "worst": max(watch.overlaps),
        "gap": largest_gap(watch.engine),
        "grows": max(float(np.diff(energies).max()), 0.0) / lost,
        "fastest": watch.engine.fastest,
    }


def main() -> None:
    """Read the options and measure."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("structures", nargs="*", default=list(STRUCTURES), help="names of structures")
    parser.add_argument("--one", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.one:
        print(json.dumps(one(given.one)))
        return
    row(
        "fall",
        "stones",
        "s",
        "s of fall",
        "steps",
        "programs",
        "overlap at the end",
        "at any time",
        "gap",
        "energy grows",
    )
    row(*["---"] * 10)
    for name in given.structures:
        command = [sys.executable, __file__, "--one", name]
        done = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True, env=os.environ | ONE_THREAD)
        found = json.loads(done.stdout.splitlines()[-1])
        row(
            name,
            found["stones"],
            f"{found['seconds']:.1f}",
            f"{found['fallen']:.2f}",
            found["steps"],
            found["programs"],
            *(f"{found[key]:.0e}" for key in ("end", "worst", "gap", "grows")),
        )


if __name__ == "__main__":
    main()
