"""Conic programs of walls in space: processor seconds, and what the check of the solution says.

    python benchmarks/cones.py [BLOCKS ...]

The program is that of the least reaction as half of the base of a running-bond wall begins to sink: 6 rows per free
block, a round cone per contact point.
"""

from __future__ import annotations

import argparse
import time
from contextlib import suppress
from itertools import pairwise
from unittest.mock import patch

import numpy as np

import solver
from solver import mechanics
from solver.interfaces import InterfaceLaw, Interfaces
from solver.kinematics import Pose
from solver.program.model import Model
from solver.program.static_program import StaticProgram
from solver.program.strength import ForceLimits
from solver.programs import solve
from solver.programs.problem import ConicProgram, Solution
from solver.tolerances import COMPUTED_GAP

LENGTH, HEIGHT, THICKNESS, FRICTION = 0.25, 0.06, 0.12, 0.6


def box(low: list[float], high: list[float]) -> tuple[np.ndarray, list[list[int]]]:
    """Corners and faces."""
    corners = np.array([[x, y, z] for z in (low[2], high[2]) for y in (low[1], high[1]) for x in (low[0], high[0])])
    return corners, [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [1, 3, 7, 5], [3, 2, 6, 7], [2, 0, 4, 6]]


def wall(blocks: int) -> solver.Assembly:
    """About so many bricks in running bond, two as long as high, on two supports of which the right one moves."""
    courses = max(2, round(np.sqrt(2.0 * blocks)))
    per_course = max(2, round(blocks / courses))
    width, solids = per_course * LENGTH, []
    for course in range(courses):
        inner = LENGTH * (np.arange(1, per_course) if course % 2 == 0 else np.arange(per_course) + 0.5)
        ends = [0.0, *inner, width]
        low, high = course * HEIGHT, (course + 1) * HEIGHT
        solids += [box([a, 0.0, low], [b, THICKNESS, high]) for a, b in pairwise(ends)]
    free = len(solids)
    solids += [
        box([-LENGTH, -LENGTH, -HEIGHT], [width / 2, LENGTH, 0.0]),
        box([width / 2, -LENGTH, -HEIGHT], [width + LENGTH, LENGTH, 0.0]),
    ]
    return solver.Assembly.from_solids(solids, roles=["free"] * free + ["fixed", "moving"])


def program_of(assembly: solver.Assembly) -> tuple[ConicProgram, int]:
    """The program of the least reaction, and how many contact points it has."""
    loads, length = solver.self_weight(assembly), assembly.block_size
    force = float(np.abs(loads.dead[assembly.free, 2]).mean())
    model = Model(assembly, Interfaces(InterfaceLaw(FRICTION)), loads, length, force)
    contacts = mechanics.find_contacts(assembly, assembly.vertices, 1e-6 * length)
    sinks = np.zeros((assembly.n_blocks, 6))
    sinks[assembly.moving, 2] = -1.0
    stated: list[ConicProgram] = []

    def kept(program: ConicProgram, route: str) -> Solution:
        stated.append(program)
        raise StopIteration

    closed = contacts[contacts.gaps <= COMPUTED_GAP * length]
    friction, none = np.full(len(closed), FRICTION), np.zeros(len(closed))
    limits = ForceLimits(least=none, most=none + np.inf, cohesion=none)
    with patch.object(solve, "run_clarabel", kept), suppress(StopIteration):
        StaticProgram(model, Pose.initial(assembly), closed, friction, limits, none, rate=sinks).bounds()
    return stated[0], len(contacts)


def main() -> None:
    """Solve each wall's program."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("blocks", nargs="*", type=int, default=[40, 300, 1000])
    arguments = parser.parse_args()
    print(f"{'blocks':>7} {'points':>7} {'seconds':>8} {'violation':>9} {'gap':>8}")
    for blocks in arguments.blocks:
        assembly = wall(blocks)
        program, points = program_of(assembly)
        started = time.process_time()
        found, _ = solve.run_clarabel(program, "clarabel")
        seconds = time.process_time() - started
        print(
            f"{int(assembly.free.sum()):7} {points:7} {seconds:8.2f} "
            f"{found.violation:9.1e} {found.gap:8.1e}   {found.objective:.9g}"
        )


if __name__ == "__main__":
    main()
