"""How long it takes to find the contact points of bricks in space, and to measure them again.

    python benchmarks/contacts_in_space.py [blocks ...]

Seconds are processor time, the least of five; the wall is in running bond, one brick thick, on one support.
"""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable
from itertools import pairwise
from typing import Any

import solver
from solver import mechanics

SIZES = (100, 1000, 5000)
BRICK = 0.25, 0.12, 0.08  # m
REACH = 0.02  # m


def box(low: tuple[float, float, float], high: tuple[float, float, float]) -> tuple[list[list[float]], list[list[int]]]:
    """Corners and faces of a box."""
    (x, y, z), (u, v, w) = low, high
    corners = [[x, y, z], [u, y, z], [u, v, z], [x, v, z], [x, y, w], [u, y, w], [u, v, w], [x, v, w]]
    return corners, [[3, 2, 1, 0], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]]


def wall_of(blocks: int) -> solver.Assembly:
    """A running-bond wall of about so many bricks."""
    length, thickness, height = BRICK
    courses = max(2, round(math.sqrt(blocks)))
    bricks = max(2, round(blocks / courses))
    solids = [box((-1.0, -1.0, -height), (bricks * length + 1.0, thickness + 1.0, 0.0))]
    for course in range(courses):
        shift = 0.5 * (course % 2)
        joints = [0.0, *(length * (k + 1 - shift) for k in range(bricks - 1 + course % 2)), bricks * length]
        for left, right in pairwise(joints):
            solids.append(box((left, 0.0, course * height), (right, thickness, (course + 1) * height)))
    return solver.Assembly.from_solids(solids, roles=["fixed"] + ["free"] * (len(solids) - 1))


def seconds(work: Callable[[], Any]) -> float:
    """Least processor time of five runs."""
    times = []
    for _ in range(5):
        start = time.process_time()
        work()
        times.append(time.process_time() - start)
    return min(times)


def main() -> None:
    """Print one line per size."""
    print(f"{'blocks':>8} {'points':>8} {'build':>8} {'find':>8} {'measure':>8}  s")
    for size in map(int, sys.argv[1:] or SIZES):
        start = time.process_time()
        assembly = wall_of(size)
        built = time.process_time() - start
        vertices = assembly.vertices
        contacts = mechanics.find_contacts(assembly, vertices, REACH)
        find = seconds(lambda: mechanics.find_contacts(assembly, vertices, REACH))  # noqa: B023
        measure = seconds(lambda: assembly.shapes.measure(vertices, contacts))  # noqa: B023
        print(f"{assembly.n_blocks:8d} {len(contacts):8d} {built:8.3f} {find:8.3f} {measure:8.3f}")


if __name__ == "__main__":
    main()
