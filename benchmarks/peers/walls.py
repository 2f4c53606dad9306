"""Walls beside engines: the same settlement in blockvis, pymunk, MuJoCo and LMGC90, at a step and at half of it.

    python benchmarks/peers/walls.py OUT.jsonl [--walls arch door] [--engines pymunk mujoco] [--seconds 120]
    python benchmarks/peers/walls.py OUT.jsonl --table > docs/walls_beside_engines.md

Every run is a line of OUT.jsonl; runs that are there already are not repeated, so that it can be measured in parts.
Seconds are processor time, after which a run of an engine is given up.

Two questions. How far does a wall go? Engines move the support at a speed, and from nine tenths of our own collapse on
at a tenth of it; the wall has fallen once a block moves faster than ``FALLING`` √(g · block size), and what is found is
where the fastest block last moved at no more than twice its rate in our path and ``CREEPING`` of that speed. What does
the support carry on the way? Engines tremble: the mean over the last ``MEAN_OVER`` before each look.

Ground that turns stays in engines, and gravity turns the other way; compas_lmgc90 cannot turn gravity, and
has no blocks that are not convex.
"""

from __future__ import annotations

import argparse
import json
import os

os.environ["OMP_NUM_THREADS"] = "1"  # before numpy starts its threads, whose waiting would count as work
os.environ["OPENBLAS_NUM_THREADS"] = "1"

import importlib.metadata
import math
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from physics_engines import ENGINES, IN_SPACE, Drive, are_convex, in_a_process

import solver
from blockvis import generators

# Some walls are those of the benchmarks beside this folder.
sys.path.append(str(Path(__file__).parents[1]))
from sliding_walls import bay, door, example

#: Time steps of the engines [s].
STEPS = (1e-3, 5e-4)

#: Way over which a reaction of an engine is averaged, in parts of the settlement looked at.
MEAN_OVER = 0.05

#: Parts of √(g · block size): a block that falls, and one that trembles.
FALLING, CREEPING = 0.2, 0.002

#: Time over which the speed of a block is measured [s].
MEASURED_OVER = 0.1


@dataclass(frozen=True)
class Wall:
    """A wall, and what is done to it.

    Attributes
    ----------
    build : callable
        Gives the assembly.
    friction : float
    settlement : dict
        Of ``solver.Settlement``: direction, radial_from, or rotation about rotation_centre.
    increment, limit : float [m or rad]
    speed : float [m/s or rad/s]
        Of the support in engines.
    looks : tuple of float [m]
        Settlements at which the support's reaction is looked at; none where the collapse is.
    exact : float [m or rad], optional
        The collapse that a closed form or exact kinematics gives; of a source that ``source`` names.
    """

    build: Callable[[], solver.Assembly]
    friction: float
    settlement: dict[str, Any]
    increment: float
    limit: float
    speed: float
    looks: tuple[float, ...] = ()
    exact: float | None = None
    source: str = ""

    @property
    def turns(self) -> bool:
        return "rotation" in self.settlement


def on_turning_ground(assembly: solver.Assembly) -> solver.Assembly:
    """The same blocks on supports that all move."""
    outlines = [assembly.outline(i) for i in range(assembly.n_blocks)]
    roles = ["free" if free else "moving" for free in assembly.free]
    return solver.Assembly.from_outlines(outlines, names=assembly.names, roles=roles, density=assembly.density)


def flat_arch() -> solver.Assembly:
    """Two blocks 1 × 0.25 side by side between abutments."""

    def box(left: float, right: float) -> list[list[float]]:
        return [[left, 0.0], [right, 0.0], [right, 0.25], [left, 0.25]]

    boxes = [box(-1.0, 0.0), box(0.0, 1.0), box(-1.5, -1.0), box(1.0, 1.5)]
    return solver.Assembly.from_outlines(boxes, roles=["free", "free", "fixed", "moving"])


#: Of the examples.
WINDOW = "wall_horizontal_after_settlement"

SPREADS, SINKS, TILTS = (
    {"direction": (1.0, 0.0)},
    {"direction": (0.0, -1.0)},
    {"rotation_centre": (0.0, 0.0), "rotation": 1},
)

WALLS = {
    "arch, supports spread": Wall(generators.arch, 2.0, SPREADS, 0.02, 1.0, 0.01, exact=0.14104982),
    "arch, a support sinks": Wall(generators.arch, 2.0, SINKS, 0.02, 1.0, 0.04, exact=0.33003942),
    "flat arch of two blocks, supports spread": Wall(
        flat_arch, 2.0, SPREADS, 0.01, 0.2, 0.01, exact=2.0 * (math.sqrt(1.0 + 0.25**2) - 1.0)
    ),
    "pointed arch, supports spread": Wall(generators.pointed_arch, 0.7, SPREADS, 0.05, 2.0, 0.08),
    "portal, a pier moves out": Wall(generators.portal, 0.6, SPREADS, 0.02, 2.0, 0.2),
    "column of 5 blocks on ground that tilts": Wall(
        lambda: generators.column(width=0.5, block_height=0.25), 0.7, TILTS, 0.02, 1.0, 0.05, exact=math.atan(0.4)
    ),
    "arch of 25 voussoirs on ground that tilts": Wall(
        lambda: on_turning_ground(
            generators.arch(radius=0.34515, thickness_ratio=56.3 / 345.15, embrace=180.0 * 25 / 27, voussoirs=25)
        ),
        math.tan(math.radians(30.0)),
        TILTS,
        0.02,
        1.0,
        0.05,
        exact=math.radians(17.10),
        source="LACT3",
    ),
    "wall of 4 × 8 bricks on ground that tilts": Wall(
        lambda: on_turning_ground(generators.wall(bricks=4, courses=8)), 0.7, TILTS, 0.02, 1.0, 0.1
    ),
    "panel of 5 × 6 bricks, half of its base sinks": Wall(
        lambda: generators.panel(nb=5, nc=6), 0.3, SINKS, 0.02, 0.2, 0.04, looks=(0.1, 0.2)
    ),
    "wall with a door, half of its ground sinks": Wall(
        lambda: door().assembly, 0.5, SINKS, 0.01, 0.061, 0.02, looks=(0.03, 0.061)
    ),
    "wall with a window, half of its ground sinks": Wall(
        lambda: example(WINDOW, (0.03,)).assembly, 0.6, SINKS, 0.005, 0.03, 0.01, looks=(0.01, 0.03)
    ),
    "bay of a façade, half of its ground sinks": Wall(
        lambda: bay().assembly, 0.6, SINKS, 0.005, 0.02, 0.02, looks=(0.01, 0.02)
    ),
    "dome of 8 lunes, springers spread": Wall(
        lambda: generators.dome(cap=15.0), 0.7, {"radial_from": (0.0, 0.0)}, 0.04, 0.5, 0.02, exact=0.1721334
    ),
    "corner of 16 bricks, a support sinks": Wall(
        lambda: generators.l_corner(bricks=2, across=2, courses=4),
        0.6,
        {"direction": (0.0, 0.0, -1.0)},
        0.02,
        0.06,
        0.01,
        looks=(0.02, 0.06),
    ),
}  # fmt: skip


def ours(wall: Wall) -> dict[str, Any]:
    """The path of the wall in blockvis: what it finds, and the rate of its fastest block at the end."""
    assembly = wall.build()
    settlement = solver.Settlement(
        **wall.settlement, increment=wall.increment, limit=wall.limit, stops=wall.looks, tolerance=1e-4 * wall.increment
    )
    started = time.process_time()
    response = solver.settle(
        assembly, settlement, friction_coefficient=wall.friction, controls=solver.Controls(falling_frames=0)
    )
    found: dict[str, Any] = {"seconds": time.process_time() - started, "blocks": int(assembly.free.sum())}
    if wall.looks:
        ratio = response.reaction / response.total_weight
        return {**found, "found": [float(np.interp(s, response.settlement, ratio)) for s in wall.looks]}
    if response.collapse is None:
        return {**found, "found": [], "why": f"{response.stop}: {response.message}"}
    rate = 0.0
    if not wall.turns:
        before, last = response.path[-3], response.path[-1]
        moved = np.linalg.norm(last.pose.positions - before.pose.positions, axis=1)[assembly.free]
        rate = float(moved.max() / (last.settlement - before.settlement))
    return {**found, "found": [float(response.collapse.displacement)], "rate": rate}


def theirs(wall: Wall, engine: str, time_step: float, budget: float, our: dict[str, Any]) -> dict[str, Any]:
    """What an engine finds."""
    assembly = wall.build()
    weight = float(solver.mechanics.total_weight(assembly))
    settlement = solver.Settlement(**wall.settlement, increment=wall.increment, limit=wall.limit)
    if wall.turns:
        direction: Any = wall.settlement["rotation"]
    elif assembly.dimension == 2:
        direction = tuple(np.array(wall.settlement["direction"]) / np.linalg.norm(wall.settlement["direction"]))
    else:
        direction = settlement.rate(assembly, solver.Pose.initial(assembly), 0.0)[:, :3]
    slow_from = math.inf if wall.looks else 0.9 * our["found"][0]
    drive = Drive(direction, wall.speed, 0.1 * wall.speed, slow_from)
    end = max(wall.looks) if wall.looks else 1.3 * our["found"][0]
    fast = math.sqrt(solver.GRAVITY * assembly.block_size)
    way, force, speeds, kept, spent, fallen = [], [], [], [], 0.0, False
    path = in_a_process(engine, assembly, drive, time_step, wall.friction, budget=budget)
    for so_far, sample in path:
        spent = so_far
        kept = [*kept[-10:], (sample.time, sample.positions)]
        if sample.time < MEASURED_OVER:
            continue
        way.append(sample.displacement)
        force.append(float(sample.force @ direction) if np.ndim(direction) == 1 else float(sample.force[0]))
        moved = np.linalg.norm(kept[-1][1] - kept[0][1], axis=1)[assembly.free]
        speeds.append(float(moved.max()) / (kept[-1][0] - kept[0][0]))
        fallen = speeds[-1] > FALLING * fast
        if way[-1] >= end or (fallen and not wall.looks):
            break
    path.close()
    found: dict[str, Any] = {"seconds": spent}
    d = np.array(way)
    if wall.looks:
        ratio = np.array(force) / weight
        near = [ratio[(d > (1.0 - MEAN_OVER) * s) & (d <= s)] for s in wall.looks]
        if len(d) and d[-1] < end * (1.0 - 1e-6):
            found["why"] = f"given up at {d[-1]:.4g}"
        return {**found, "found": [float(part.mean()) if len(part) else math.nan for part in near]}
    if not fallen:
        verdict = "stands" if len(d) and d[-1] >= end else "given up"
        return {**found, "found": [], "why": f"{verdict} at {d[-1]:.4g}" if len(d) else "nothing"}
    at_speed = np.array([drive.speed if s < slow_from else drive.slow for s in way])
    calm = np.array(speeds) <= 2.0 * our["rate"] * at_speed + CREEPING * fast
    if not calm.any():
        return {**found, "found": [], "why": "falls at once"}
    return {**found, "found": [float(d[np.flatnonzero(calm)[-1]])]}


def table(runs: dict[tuple[str, str, float], dict[str, Any]]) -> str:
    """What was found, in Markdown: collapses, then reactions; a cell has the value at the step and at half of it."""
    lines = []
    engines = ("pymunk", "mujoco", "compas_lmgc90")
    for collapses in (True, False):
        what = "collapse" if collapses else "reaction over weight"
        lines += [f"| {what} | blocks | exact | blockvis | pymunk | MuJoCo | LMGC90 |", "|---" * 7 + "|"]
        for name, wall in WALLS.items():
            if bool(wall.looks) == collapses or (name, "blockvis", 0.0) not in runs:
                continue
            our = runs[name, "blockvis", 0.0]
            for k, look in enumerate(wall.looks or (None,)):
                at = f", at {1e3 * look:g} mm" if look else ""
                exact = (
                    ""
                    if wall.exact is None
                    else f"{_plain(wall, wall.exact)}{f' ({wall.source})' if wall.source else ''}"
                )
                cells = [_cell(wall, runs, name, engine, k, our) for engine in engines]
                mine = _plain(wall, our["found"][k])
                if wall.exact is not None:
                    mine += f" ({100.0 * (our['found'][k] / wall.exact - 1.0):+.2f} %)"
                lines.append(f"| {name}{at} | {our['blocks']} | {exact} | {mine} | {' | '.join(cells)} |")
        lines.append("")
    return "\n".join(lines)


def _plain(wall: Wall, value: float) -> str:
    return f"{math.degrees(value):.3f}°" if wall.turns else f"{value:.4f}" + ("" if wall.looks else " m")


def _cell(wall: Wall, runs: dict, name: str, engine: str, k: int, our: dict[str, Any]) -> str:
    """The values of an engine at its steps, and how far the last is from the exact one, or from ours."""
    shown, last = [], math.nan
    for step in STEPS:
        run = runs.get((name, engine, step))
        if run is None:
            shown.append("–")
        elif len(run["found"]) > k and not math.isnan(run["found"][k]):
            last = run["found"][k]
            shown.append(_plain(wall, last).removesuffix(" m"))
        else:
            shown.append(run.get("why", "–"))
    if shown == ["–"] * len(STEPS):
        return "–"
    reference = our["found"][k] if wall.exact is None else wall.exact
    apart = "" if math.isnan(last) else f" ({100.0 * (last / reference - 1.0):+.1f} %)"
    return ", ".join(shown) + apart


def main() -> None:
    """Read the options, run what is not there yet, or print the table."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("file", type=Path)
    options.add_argument("--walls", nargs="+", default=[""], help="those whose names begin so")
    options.add_argument("--engines", nargs="*", default=list(ENGINES), choices=tuple(ENGINES))
    options.add_argument("--seconds", type=float, default=120.0, help="processor time given to a run of an engine")
    options.add_argument("--table", action="store_true", help="print the table of the runs that are there")
    given = options.parse_args()
    runs = {}
    if given.file.exists():
        for line in given.file.read_text(encoding="utf-8").splitlines():
            run = json.loads(line)
            runs[run["wall"], run["tool"], run["step"]] = run
    if given.table:
        print(table(runs))
        return
    for name, wall in WALLS.items():
        if not name.startswith(tuple(given.walls)):
            continue
        assembly = wall.build()
        in_space = assembly.dimension == 3
        for tool, step in [("blockvis", 0.0), *product(given.engines, STEPS)]:
            if (name, tool, step) in runs:
                continue
            if in_space and tool not in (*IN_SPACE, "blockvis"):
                continue
            if tool == "compas_lmgc90" and (wall.turns or (not in_space and not are_convex(assembly))):
                continue
            found = (
                ours(wall)
                if tool == "blockvis"
                else theirs(wall, tool, step, given.seconds, runs[name, "blockvis", 0.0])
            )
            version = importlib.metadata.version(tool)
            run = {"wall": name, "tool": tool, "version": version, "step": step, **found}
            runs[name, tool, step] = run
            with given.file.open("a", encoding="utf-8") as stream:
                stream.write(json.dumps(run) + "\n")
            print(run, flush=True)


if __name__ == "__main__":
    main()
