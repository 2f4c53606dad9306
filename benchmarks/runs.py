"""Whole runs: the arch of twelve voussoirs to its collapse, and a wall of 1,500 bricks over fifty increments.

    python benchmarks/runs.py [--arch] [--wall [increments [blocks]]]

Seconds are those of the solver, certificates included, output not: wall-clock and processor time.
"""

from __future__ import annotations

import resource
import sys
import time
from pathlib import Path

import numpy as np
from growth import INCREMENT, Clock, wall_of

import blockvis
import solver
from solver import mechanics
from solver.path import stepping

ARCH = Path(__file__).parents[1] / "assets" / "semicircular_arch.msh"


def arch(repeats: int = 7) -> None:
    """The README's arch from its start to its collapse, several times in one process."""
    assembly = blockvis.read(ARCH, roles={"right springer": "moving", "left springer": "fixed"})
    spread = solver.Settlement(direction=(1.0, 0.0), increment=0.01, limit=0.5, tolerance=1e-4)
    for frames in (0, 40):
        seconds = []
        controls = solver.Controls(falling_frames=frames)
        for _ in range(repeats):
            started = time.perf_counter()
            response = solver.settle(assembly, spread, friction_coefficient=2.0, controls=controls)
            seconds.append(time.perf_counter() - started)
        programs = sum(increment.programs for increment in response.increments)
        assert response.collapse is not None
        print(
            f"arch of 12 voussoirs: collapse at {response.collapse.displacement:.6f} m, {frames} frames of the fall, "
            f"{programs} programs, {min(seconds):.3f} s (median {np.median(seconds):.3f} s, {repeats} runs)"
        )


def wall(increments: int, blocks: int) -> None:
    """A running-bond wall; where the seconds of an increment go."""
    clock = Clock()
    stepping.minimise = clock.timed("programs", stepping.minimise)
    assembly = wall_of(blocks)
    weight = mechanics.total_weight(assembly)
    last = [time.process_time(), 0.0, 0]

    def tell(increment: solver.Increment) -> None:
        now, programs, calls = time.process_time(), clock.seconds["programs"], clock.calls["programs"]
        print(
            f"{increment.settlement:8.4f} m  {increment.reaction / weight:.5f} W  {calls - last[2]:3d} programs  "
            f"{now - last[0]:6.2f} s, {programs - last[1]:6.2f} s of them in programs",
            flush=True,
        )
        last[:] = [now, programs, calls]

    started, processor = time.perf_counter(), time.process_time()
    settlement = solver.Settlement(direction=(0.0, -1.0), increment=INCREMENT, limit=increments * INCREMENT)
    response = solver.settle(assembly, settlement, friction_coefficient=0.6, on_increment=tell)
    certificates = [increment.certificate for increment in response.path]
    print(
        f"wall of {assembly.n_blocks} bricks: {response.stop} after {len(response.path)} increments, "
        f"{clock.calls['programs']} programs, {time.perf_counter() - started:.1f} s "
        f"({time.process_time() - processor:.1f} s of processor time, "
        f"{clock.seconds['programs']:.1f} s of it in programs), "
        f"residual {max(c.equilibrium_residual for c in certificates):.1e} W, "
        f"gap {max(c.duality_gap for c in certificates):.1e}, "
        f"penetration {max(c.largest_penetration for c in certificates):.1e} m, "
        f"at most {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024:.0f} MiB"
    )


if __name__ == "__main__":
    chosen = sys.argv[1:] or ["--arch", "--wall"]
    if "--arch" in chosen:
        arch()
    if "--wall" in chosen:
        numbers = [int(given) for given in chosen[chosen.index("--wall") + 1 :] if given.isdigit()]
        wall(*(numbers + [50, 1500][len(numbers) :]))
