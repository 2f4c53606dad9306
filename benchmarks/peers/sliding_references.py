"""Reactions and capacities where joints slide, beside closed forms and physics engines.

    python benchmarks/peers/sliding_references.py [--only column door window panel pushover] [--parts 1 2] \
        [--engines pymunk compas_lmgc90 [--speed 0.01] [--time-step 0.0005 0.0001]]

Values of the engines are those of LMGC90 0.1.11 and pymunk 7.3.1 with supports at 5 to 20 mm/s, settings as in
``physics_engines.py``; ``--engines`` runs them beside, in the same run. The column is elementary statics: nothing
presses it against the wall, so that the wall carries nothing. The pushover is wall 1 of Ferris & Tin-Loi, Int. J. Mech.
Sci. 43 (2001) 209-224, pushed over with its weight; nobody has published where its capacity ends, so that descriptions
and increments stand beside each other.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence
from itertools import product
from pathlib import Path

import numpy as np
from physics_engines import ENGINES, SAMPLING, Drive

import solver
from blockvis.generators import catalogue

# The walls are those of the benchmarks beside this folder.
sys.path.append(str(Path(__file__).parents[1]))
from sliding_walls import DESCRIPTIONS, WALLS, Wall, door, sinking, spread

#: Settlement [m], then R / W: of the column elementary statics, LMGC90, pymunk; of the window, the smallest and largest
#: of LMGC90 between 10 and 30 mm, pymunk; of the others LMGC90, pymunk.
COLUMN = ((0.02, 1.0, 0.997, 1.0), (0.1, 1.0, 0.997, 1.0), (0.2, 1.0, 0.997, 1.0))
DOOR = ((0.061, 0.4394, 0.440), (0.164, 0.4510, 0.451))
WINDOW = ((0.01, 0.411, 0.415, 0.410), (0.02, 0.411, 0.415, 0.410), (0.03, 0.411, 0.415, 0.410))
PANEL = ((0.2, 0.180, 0.1805), (0.38, 0.1866, 0.188))

#: Way over which a reaction of an engine, which trembles, is averaged [m].
MEAN_OVER = 0.002

COURSES = ((0.5, 1, 1, 1, 1, 0.5), (1, 1, 1, 1, 1))


def box(left: float, low: float, right: float, high: float) -> list[list[float]]:
    return [[left, low], [right, low], [right, high], [left, high]]


def column() -> Wall:
    """Two blocks beside a wall, on ground that sinks."""
    outlines = [box(0, 0, 1, 1), box(0, 1, 1, 2), box(-2, -1, 0, 3), box(0, -1, 3, 0)]
    assembly = solver.Assembly.from_outlines(outlines, roles=["free", "free", "fixed", "moving"])
    return sinking(assembly, 0.6, 0.02, (0.02, 0.1, 0.2))


def ferris_wall(courses: int = 6) -> Wall:
    """Bricks 0.4 × 0.175 m; its settlement stands for the way in which it is pushed."""
    outlines = []
    for course in range(courses):
        x = 0.0
        for length in COURSES[course % 2]:
            outlines.append(box(x, 0.175 * course, x + 0.4 * length, 0.175 * (course + 1)))
            x += 0.4 * length
    roles = ["free"] * len(outlines) + ["fixed"]
    assembly = solver.Assembly.from_outlines([*outlines, box(0.0, -0.5, 2.0, 0.0)], roles=roles)
    return sinking(assembly, 0.65, 0.01, (1.0,), (1.0, 0.0))


def compared(name: str, wall: Wall, references: Sequence[tuple[float, ...]], parts: Sequence[int]) -> None:
    """R / W at settlements, the smallest and largest admissible where they are told, beside the references."""
    weight = float(np.hypot(*wall.loads.dead[wall.assembly.free, :2].sum(axis=0)))
    for part in parts:
        started = time.process_time()
        settlement = solver.Settlement(
            direction=wall.direction,
            increment=wall.increment / part,
            limit=max(s for s, *_ in references),
            stops=tuple(s for s, *_ in references),
        )
        response = solver.settle(
            wall.assembly,
            settlement,
            interfaces=wall.interfaces,
            loads=wall.loads,
            controls=solver.Controls(increments="coulomb", falling_frames=1),
        )
        seconds = time.process_time() - started
        for s, *others in references:
            found = [i for i in response.path if abs(i.settlement - s) < 1e-6 * wall.increment]
            if not found:
                print(f"{name:12s} s = {s:<6g} increment/{part}: not reached, {response.stop}: {response.message}")
                continue
            reaction = found[0].reaction / weight
            beside = ", ".join(f"{value:.4f} ({100.0 * (reaction / value - 1.0):+.2f} %)" for value in others)
            print(
                f"{name:12s} s = {s:<6g} increment/{part}: R = {reaction:.5f} W; {beside}; {seconds:.1f} s", flush=True
            )


def beside(name: str, wall: Wall, references: Sequence[tuple[float, ...]], chosen: argparse.Namespace) -> None:
    """R / W of the engines, run here, at the same settlements: means over the last of the way to each."""
    weight = float(np.hypot(*wall.loads.dead[wall.assembly.free, :2].sum(axis=0)))
    friction = wall.interfaces.default.friction_coefficient
    direction = wall.direction / np.linalg.norm(wall.direction)
    for engine, time_step in product(chosen.engines, chosen.time_step):
        given = (wall.assembly, Drive(tuple(direction), chosen.speed), time_step, friction)
        started = time.process_time()
        seen: list[tuple[float, float]] = []
        for sample in ENGINES[engine](*given, SAMPLING):
            seen.append((sample.displacement, float(sample.force @ direction) / weight))
            if sample.displacement > max(s for s, *_ in references):
                break
        way, reaction = np.array(seen).T
        for s, *_ in references:
            there = (way > s - MEAN_OVER) & (way <= s)
            print(
                f"{name:12s} s = {s:<6g} {engine} {chosen.speed:g} m/s, {time_step:g} s: R = "
                f"{reaction[there].mean():.5f} ± {reaction[there].std():.5f} W; "
                f"{time.process_time() - started:.0f} s",
                flush=True,
            )


def pushed_over(descriptions: Sequence[str], parts: Sequence[int], limit: float) -> None:
    """Limit load, α on the way, and zero capacity of the wall of Ferris & Tin-Loi."""
    ends = []
    top = ferris_wall().assembly.names[-2]
    for description in descriptions:
        wall = DESCRIPTIONS[description](ferris_wall())
        for part in parts:
            increment = wall.increment / part
            control = solver.ControlDisplacement(top, wall.direction, increment=increment, limit=limit * wall.length)
            started = time.process_time()
            try:
                response = solver.pushover(
                    wall.assembly,
                    control,
                    loads=wall.loads,
                    interfaces=wall.interfaces,
                    controls=solver.Controls(increments="coulomb", falling_frames=1),
                )
            except ValueError as error:
                print(f"pushover     {description:11s} increment/{part}: {error}")
                continue
            way, alpha = response.settlement / wall.length, response.load_multiplier
            end = None if response.collapse is None else response.collapse.displacement / wall.length
            ends += [] if end is None else [end]
            at = ", ".join(f"{np.interp(d, way, alpha):.5f}" if d <= way[-1] else "-" for d in (0.0, 0.05, 0.15, 0.2))
            print(
                f"pushover     {description:11s} increment/{part}: α at 0, 0.05, 0.15, 0.2 m {at}; zero capacity at "
                f"{'-' if end is None else f'{end:.5f} m'}; {response.stop}: {response.message}; "
                f"{time.process_time() - started:.1f} s",
                flush=True,
            )
    if len(ends) > 1:
        print(f"pushover     zero capacity: {len(ends)} values, spread {100.0 * spread(ends):.3f} %")


def main() -> None:
    """Read the options and compare."""
    what = ("column", "door", "window", "panel", "pushover")
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", nargs="+", choices=what, default=list(what))
    parser.add_argument("--parts", nargs="+", type=int, default=[1, 2], help="parts of the increment")
    parser.add_argument("--descriptions", nargs="+", choices=DESCRIPTIONS, default=["drawn", "mirrored", "renumbered"])
    parser.add_argument("--limit", type=float, default=1.0, help="end of the pushover in metres of the drawing")
    parser.add_argument("--engines", nargs="+", choices=ENGINES, default=[], help="run these beside")
    parser.add_argument("--speed", type=float, default=0.01, help="of the supports in the engines [m/s]")
    parser.add_argument("--time-step", type=float, nargs="+", default=[5e-4, 1e-4], help="of the engines [s]")
    chosen = parser.parse_args()
    panel = {"nb": 5, "nc": 6}
    walls: dict[str, tuple[Wall, Sequence[tuple[float, ...]]]] = {
        "column": (column(), COLUMN),
        "door": (door(), DOOR),
        "window": (WALLS["window"](), WINDOW),
        "panel": (sinking(catalogue.build("panel", panel), 0.3, 0.02, (0.2, 0.38)), PANEL),
    }
    for name, (wall, references) in walls.items():
        if name in chosen.only:
            compared(name, wall, references, chosen.parts)
            beside(name, wall, references, chosen)
    if "pushover" in chosen.only:
        pushed_over(chosen.descriptions, chosen.parts, chosen.limit)


if __name__ == "__main__":
    main()
