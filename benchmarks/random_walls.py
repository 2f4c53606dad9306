"""Random brick walls: settlement and pushover, how they end, and the seeds of those that fail.

    python benchmarks/random_walls.py [--walls 300] [--first 0] [--most-blocks 300] [--seconds 60] [--out OUT.jsonl]
    python benchmarks/random_walls.py --seed 17 [--analysis pushover]

Walls of 3 to 12 bricks and 4 to 20 courses, with and without openings, friction 0.3 to 0.8, increments from a hundredth
to a tenth of a brick. A seed makes one wall, always the same. An analysis fails that ends in "solver failed", raises,
or takes more processor time than it is given; such a line ends with the command that repeats it.
"""

from __future__ import annotations

import argparse
import json
import signal
import time
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from types import FrameType
from typing import Any

import numpy as np

import solver
from blockvis.generators import catalogue

BRICK = (0.25, 0.1)
ANALYSES = ("settlement", "pushover")
HEADS = ("lintel", "flat arch", "segmental arch", "round arch")

#: Increments of an analysis.
INCREMENTS = 20


@dataclass(frozen=True)
class RandomWall:
    """What a seed draws; lengths in metres."""

    seed: int
    parameters: dict[str, Any]
    friction: float
    increment: float
    direction: tuple[float, float]

    def assembly(self, *, settles: bool) -> solver.Assembly:
        """The wall, on a ground part of which moves, or on a fixed one."""
        given = self.parameters if settles else {k: v for k, v in self.parameters.items() if k != "settling"}
        return catalogue.build("wall", given)

    def __str__(self) -> str:
        given = self.parameters
        head = next((opening["head"] for opening in given["openings"]), "no opening")
        return (
            f"seed {self.seed}: {given['bricks']} × {given['courses']} bricks, {head}, settling {given['settling']}, "
            f"direction {self.direction}, μ {self.friction:g}, increment {self.increment:g} m"
        )


def drawn(seed: int) -> RandomWall:
    """The wall of a seed; an opening for which there is no room is drawn again."""
    random = np.random.default_rng(seed)
    length, height = BRICK
    bricks, courses = int(random.integers(3, 13)), int(random.integers(4, 21))
    friction = round(float(random.uniform(0.3, 0.8)), 2)
    increment = float(f"{length * 10.0 ** random.uniform(-2.0, -1.0):.2g}")
    first = int(random.integers(1, 2 * bricks))
    last = 2 * bricks if random.random() < 0.7 else int(random.integers(first + 1, 2 * bricks + 1))
    direction = ((0.0, -1.0), (1.0, 0.0), (0.5, -1.0))[int(random.choice(3, p=[0.6, 0.2, 0.2]))]
    parameters: dict[str, Any] = {
        "bricks": bricks,
        "courses": courses,
        "settling": [0.5 * length * first, 0.5 * length * last],
        "openings": [],
    }
    if random.random() < 0.6:
        for _ in range(20):
            opening = {
                "x": 0.5 * length * int(random.integers(1, 2 * bricks)),
                "y": height * int(random.choice([0, random.integers(1, courses)])),
                "width": 0.5 * length * int(random.integers(2, max(3, bricks))),
                "height": height * int(random.integers(2, max(3, courses - 2))),
                "head": str(random.choice(HEADS)),
            }
            try:
                catalogue.build("wall", {**parameters, "openings": [opening]})
            except ValueError:
                continue
            parameters["openings"] = [opening]
            break
    return RandomWall(seed, parameters, friction, increment, direction)


def analysed(wall: RandomWall, analysis: str, *, parts: int = 1) -> solver.Response:
    """The settlement of a part of the ground, or a push to the right, where the limit load's mechanism moves most."""
    assembly = wall.assembly(settles=analysis == "settlement")
    limit, controls = INCREMENTS * wall.increment, solver.Controls(increments="coulomb", falling_frames=1)
    increment = wall.increment / parts
    if analysis == "settlement":
        settlement = solver.Settlement(direction=wall.direction, increment=increment, limit=limit)
        return solver.settle(assembly, settlement, friction_coefficient=wall.friction, controls=controls)
    live = solver.weight_fraction(assembly, (1.0, 0.0), assembly.free)
    loads = solver.Loads(solver.self_weight(assembly).dead, live)
    begins = solver.limit_load(assembly, loads=loads, friction_coefficient=wall.friction).mechanism[:, 0].round(9)
    control = assembly.names[int(begins.argmax())]
    return solver.pushover(
        assembly,
        solver.ControlDisplacement(control, (1.0, 0.0), increment=increment, limit=limit),
        loads=loads,
        friction_coefficient=wall.friction,
        controls=controls,
    )


class TooLong(Exception):
    """An analysis has used up the processor time it is given."""


def tried(wall: RandomWall, analysis: str, seconds: float, parts: int) -> dict[str, Any]:
    """One analysis, whatever it ends in."""

    def stop(signum: int, frame: FrameType | None) -> None:
        raise TooLong

    row: dict[str, Any] = {"seed": wall.seed, "analysis": analysis, "wall": str(wall)}
    row |= {"blocks": len(wall.assembly(settles=True).names), "collapse": None, "message": ""}
    started = time.process_time()
    signal.signal(signal.SIGPROF, stop)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        response = analysed(wall, analysis, parts=parts)
    except TooLong:
        row |= {"ending": f"longer than {seconds:g} s"}
    except Exception as error:  # noqa: BLE001 (whatever is raised is what is counted)
        row |= {"ending": f"raised {type(error).__name__}", "message": str(error)}
    else:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        certificates = [increment.certificate for increment in response.path]
        row |= {
            "ending": str(response.stop),
            "message": response.message,
            "collapse": None if response.collapse is None else response.collapse.displacement,
            "increments": len(certificates),
            "programs": sum(increment.programs for increment in response.increments),
            "residual": max((c.equilibrium_residual for c in certificates), default=0.0),
            "penetration": max((c.largest_penetration for c in certificates), default=0.0),
            "measured": [float(v) for v in response.values],
        }
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
    return row | {"seconds": time.process_time() - started}


def failed(row: dict[str, Any]) -> bool:
    return row["ending"] == str(solver.Status.SOLVER_FAILED) or row["ending"].startswith(("raised", "longer"))


def told(row: dict[str, Any]) -> str:
    repeat = f"\n    python benchmarks/random_walls.py --seed {row['seed']} --analysis {row['analysis']}"
    return (
        f"{row['wall']}: {row['analysis']} of {row['blocks']} blocks, {row['ending']}, {row['seconds']:.1f} s"
        + (f": {row['message']}" if row["message"] else "")
        + (repeat if failed(row) else "")
    )


def main() -> None:
    """Read the options, analyse, count."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--walls", type=int, default=300, help="how many seeds")
    parser.add_argument("--first", type=int, default=0, help="first seed")
    parser.add_argument("--seed", type=int, help="only this one")
    parser.add_argument("--analysis", nargs="+", choices=ANALYSES, default=list(ANALYSES))
    parser.add_argument("--parts", type=int, default=1, help="of an increment")
    parser.add_argument("--most-blocks", type=int, default=300, help="larger walls are left out")
    parser.add_argument("--seconds", type=float, default=60.0, help="of processor time, per analysis")
    parser.add_argument("--out", type=Path, help="JSON lines, appended to")
    chosen = parser.parse_args()
    seeds = range(chosen.first, chosen.first + chosen.walls) if chosen.seed is None else [chosen.seed]
    rows, left_out = [], 0
    for wall in map(drawn, seeds):
        if len(wall.assembly(settles=True).names) > chosen.most_blocks:
            left_out += 1
            continue
        for analysis in chosen.analysis:
            row = tried(wall, analysis, chosen.seconds, chosen.parts)
            rows.append(row)
            print(told(row), flush=True)
            if chosen.out:
                with chosen.out.open("a") as file:
                    file.write(json.dumps(row) + "\n")
    for analysis in chosen.analysis:
        mine = [row for row in rows if row["analysis"] == analysis]
        if not mine:
            continue
        endings = ", ".join(f"{n} {ending}" for ending, n in Counter(row["ending"] for row in mine).most_common())
        seconds = [row["seconds"] for row in mine]
        print(
            f"{analysis}: {len(mine)} walls of {min(row['blocks'] for row in mine)} to "
            f"{max(row['blocks'] for row in mine)} blocks: {endings}; {sum(seconds):.0f} s, the longest "
            f"{max(seconds):.1f} s; residual up to {max(row.get('residual', 0.0) for row in mine):.1e} W, penetration "
            f"up to {max(row.get('penetration', 0.0) for row in mine):.1e} m"
        )
    if left_out:
        print(f"{left_out} larger walls left out")


if __name__ == "__main__":
    main()
