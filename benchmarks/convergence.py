"""Whether the path of a settlement converges: smaller tolerances of its steps, shorter increments, other descriptions.

    python benchmarks/convergence.py [--only NAME ...] [--walls N] [--random N] [--tolerance 0.005] [--refinement 8] \
        [--told] [--variants tolerance,increment,description] [--seconds 900] [--json OUT.jsonl]

Sixteen walls and twenty random ones (``convergence_walls.py``), each as it is and

- "tolerance": with an eighth of the tolerance of a step; with --told also with a quarter of it, as ``blockvis run``
  does, and it is counted how often the error is below twice what that tells of it;
- "increment": with the increment halved and quartered;
- "description": mirrored, and with its blocks in another order.

Every line beside the first of a wall compares two runs at the settlements that are told: reactions, over that of the
finer run there, or over a tenth of its largest where that is more; positions of centroids, the worst block's difference
over the way of the support; how they end, and where they collapse. A told settlement that one of the two does not reach
is outside every limit. Seconds are processor time.
"""

from __future__ import annotations

import argparse
import json
import signal
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import FrameType
from typing import Any

import numpy as np
from convergence_walls import DESCRIPTIONS, WALLS, Wall, random_walls

import solver
from blockvis.runs.step_check import ERROR_OVER_DIFFERENCE, FINER, SMALLEST
from solver import mechanics

VARIANTS = ("tolerance", "increment", "description")

#: What counts as the same: reactions and collapses, and positions over the way of the support.
SAME, SAME_PLACE = 0.01, 0.05

#: How a run ends that is not given up.
ENDINGS = tuple(str(status) for status in solver.Status if status != solver.Status.SOLVER_FAILED)

#: A told settlement is reached where an increment is as near, in increments.
NEAR = 1e-6

HEAD = ("wall", "run", "R median %", "R max %", "place %", "ending", "collapse", "off %", "programs", "s")


class TooLong(Exception):
    """A run has used up the processor time it is given."""


@dataclass
class Run:
    """What a run has told; positions and reactions by the number of the settlement they are told at.

    Attributes
    ----------
    reactions : dict of int to float [N or N·m]
    positions : dict of int to (n_blocks, 2) array [m]
        As drawn: mirrored back, blocks in the order of their names.
    ways : dict of int to float [m]
        How far the corners of the moving supports have come at most.
    bracket : float
        Half of that of the collapse, as a part of it.
    """

    reactions: dict[int, float] = field(default_factory=dict)
    positions: dict[int, np.ndarray] = field(default_factory=dict)
    ways: dict[int, float] = field(default_factory=dict)
    ending: str = ""
    message: str = ""
    collapse: float | None = None
    bracket: float = 0.0
    programs: int = 0
    seconds: float = 0.0


@dataclass(frozen=True)
class Difference:
    """Two runs of one wall: a number per told settlement, infinite where one of them does not get there."""

    reactions: np.ndarray
    positions: np.ndarray
    same_ending: bool
    collapse: float | None

    def numbers(self) -> dict[str, Any]:
        return {
            "reactions": self.reactions.tolist(),
            "positions": self.positions.tolist(),
            "same_ending": self.same_ending,
            "collapse_difference": self.collapse,
        }


def told_by(wall: Wall, tolerance: float, seconds: float) -> Run:
    """Follow a wall, whatever it ends in."""
    run, assembly = Run(), wall.assembly
    order = sorted(range(assembly.n_blocks), key=lambda i: assembly.names[i])
    of_support = assembly.moving[assembly.block_of_vertex]
    flip = np.array([-1.0 if wall.mirrored else 1.0, 1.0])

    def tell(increment: solver.Increment) -> None:
        run.programs += increment.programs
        for number, s in enumerate(wall.told):
            at = abs(increment.settlement - s) < NEAR * wall.settlement.increment
            if at and increment.status == solver.Status.EQUILIBRIUM:
                moved = mechanics.moved_vertices(assembly, increment.pose) - assembly.vertices
                run.reactions[number] = increment.reaction
                run.positions[number] = increment.pose.positions[order] * flip
                run.ways[number] = float(np.linalg.norm(moved[of_support], axis=1).max())

    def stop(signum: int, frame: FrameType | None) -> None:
        raise TooLong

    controls = solver.Controls(step_tolerance=tolerance, falling_frames=0)
    started = time.process_time()
    signal.signal(signal.SIGPROF, stop)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        response = solver.settle(
            assembly,
            wall.settlement,
            friction_coefficient=wall.friction,
            loads=wall.loads,
            controls=controls,
            on_increment=tell,
        )
    except TooLong:
        run.ending = f"longer than {seconds:g} s"
    except Exception as error:  # noqa: BLE001 (whatever is raised is a finding)
        run.ending, run.message = f"raised {type(error).__name__}", str(error)
    else:
        run.ending, run.message = str(response.stop), response.message
        if response.collapse is not None:
            low, high = response.collapse.bracket
            run.collapse = response.collapse.displacement
            run.bracket = 0.5 * (high - low) / run.collapse
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
    run.seconds = time.process_time() - started
    return run


def difference(run: Run, reference: Run) -> Difference:
    """Of a run from a finer one; settlements that neither reaches are left out."""
    least = 0.1 * max((abs(r) for r in reference.reactions.values()), default=0.0)
    reactions, positions = [], []
    for number in sorted(run.reactions.keys() | reference.reactions.keys()):
        if number not in run.reactions or number not in reference.reactions:
            reactions.append(np.inf)
            positions.append(np.inf)
            continue
        finer = reference.reactions[number]
        reactions.append(abs(run.reactions[number] - finer) / max(abs(finer), least, np.finfo(float).tiny))
        apart = np.linalg.norm(run.positions[number] - reference.positions[number], axis=1)
        positions.append(float(apart.max()) / reference.ways[number])
    ends = run.collapse, reference.collapse
    collapse = None
    if ends != (None, None):
        collapse = np.inf if None in ends else abs(ends[0] / ends[1] - 1.0)  # type: ignore[operator]
    same = run.ending == reference.ending and run.ending in ENDINGS
    return Difference(np.array(reactions), np.array(positions), same, collapse)


Follow = Callable[[Wall, float], Run]


def compared(
    wall: Wall, whole: Run, variant: str, given: argparse.Namespace, follow: Follow
) -> list[tuple[str, Run, Difference]]:
    """The runs of one variant, each with its difference from the wall as it is."""
    found = []
    if variant == "tolerance":
        for factor in ([1.0 / FINER] if given.told else []) + [given.refinement]:
            finer = follow(wall, given.tolerance / factor)
            found.append((f"tolerance/{factor:g}", finer, difference(whole, finer)))
    elif variant == "increment":
        for parts in (2, 4):
            finer = follow(wall.parted(parts), given.tolerance)
            found.append((f"increment/{parts}", finer, difference(whole, finer)))
    else:
        for name, described in DESCRIPTIONS.items():
            other = follow(described(wall), given.tolerance)
            found.append((name, other, difference(whole, other)))
    return found


# Output -------------------------------------------------------------------------------------------------------------


def per_cent(value: float | None) -> str:
    if value is None:
        return ""
    return "-" if np.isinf(value) else f"{100.0 * value:.2f}"


def row(*cells: object) -> None:
    print("| " + " | ".join(str(cell) for cell in cells) + " |", flush=True)


def line(wall: str, name: str, run: Run, off: Difference | None) -> None:
    """A line of the table: of a run alone, or beside the wall as it is."""
    numbers: list[float | None] = [None, None, None]
    if off is not None and len(off.reactions):
        numbers = [float(np.median(off.reactions)), float(off.reactions.max()), float(off.positions.max())]
    ending = run.ending if off is None or off.same_ending else f"{run.ending} (!)"
    collapse = "" if run.collapse is None else f"{run.collapse:.5g}"
    away = None if off is None else off.collapse
    row(wall, name, *map(per_cent, numbers), ending, collapse, per_cent(away), run.programs, f"{run.seconds:.1f}")


def summary(name: str, differences: Sequence[Difference]) -> None:
    """Shares over all walls."""
    reactions = np.concatenate([one.reactions for one in differences])
    positions = np.concatenate([one.positions for one in differences])
    # A brick that slips a little later in one run parts the two until it has.
    again = [np.minimum(one.reactions, np.append(one.reactions[1:], np.inf)) for one in differences]
    if not len(reactions):
        print(f"{name}: no settlement told")
        return
    collapses = [one.collapse for one in differences if one.collapse is not None]
    print(
        f"{name}: {len(differences)} walls, {len(reactions)} told settlements: R within 1 % at "
        f"{100.0 * np.mean(reactions <= SAME):.1f} %, there or at the next one told at "
        f"{100.0 * np.mean(np.concatenate(again) <= SAME):.1f} %, median {per_cent(float(np.median(reactions)))} %, "
        f"largest {per_cent(float(reactions.max()))} %; positions within 5 % at "
        f"{100.0 * np.mean(positions <= SAME_PLACE):.1f} %; endings the same "
        f"{sum(one.same_ending for one in differences)} of {len(differences)}; collapse within 1 % "
        f"{sum(one <= SAME for one in collapses)} of {len(collapses)}"
    )


def told_beside_true(whole: Run, quarter: Difference, fine: Difference) -> list[tuple[str, float, float]]:
    """What a run tells of its errors by the first difference, what they are by the second; of each kind, in parts."""
    reaction, place = (
        ERROR_OVER_DIFFERENCE * float(of.max(initial=0.0)) for of in (quarter.reactions, quarter.positions)
    )
    found = [("reaction at a settlement", reaction, float(off)) for off in fine.reactions]
    found += [("largest reaction", reaction, float(fine.reactions.max(initial=0.0)))]
    found += [("position of the worst block", place, float(fine.positions.max(initial=0.0)))]
    if fine.collapse is not None:
        # A collapse is told with its bracket.
        told = max(ERROR_OVER_DIFFERENCE * (quarter.collapse or 0.0), whole.bracket)
        found.append(("collapse", told, fine.collapse))
    return found


def shares_told(found: Sequence[tuple[str, float, float]]) -> None:
    """How often an error is below twice what is told, or too small to be."""
    for kind in dict.fromkeys(kind for kind, _, _ in found):
        good = [true <= max(2.0 * told, SMALLEST) for other, told, true in found if other == kind]
        print(f"{kind}: below twice what is told {sum(good)} of {len(good)}")


def record(wall: str, name: str, run: Run, off: Difference | None) -> dict[str, Any]:
    found: dict[str, Any] = {} if off is None else off.numbers()
    return found | {
        "wall": wall,
        "run": name,
        "told": {str(number): value for number, value in run.reactions.items()},
        "ending": run.ending,
        "message": run.message,
        "collapse": run.collapse,
        "programs": run.programs,
        "seconds": run.seconds,
    }


def variants(text: str) -> tuple[str, ...]:
    """Split those given with commas between them."""
    given = tuple(text.split(","))
    if not set(given) <= set(VARIANTS):
        raise argparse.ArgumentTypeError(f"'{text}'; choose from {','.join(VARIANTS)}")
    return given


def chosen_walls(given: argparse.Namespace) -> dict[str, Callable[[], Wall]]:
    """Those named, or the first of the sixteen and of the random ones."""
    if given.only:
        seeds = [int(name.split()[-1]) + 1 for name in given.only if name.split()[-2:-1] == ["seed"]]
        known = {**WALLS, **random_walls(max(seeds, default=0))}
        unknown = [name for name in given.only if name not in known]
        if unknown:
            raise SystemExit(f"no wall '{unknown[0]}'; there are {', '.join(WALLS)}, and those like 'bricks seed 0'")
        return {name: known[name] for name in given.only}
    first = list(WALLS)[: given.walls]
    return {**{name: WALLS[name] for name in first}, **random_walls(given.random)}


def main() -> None:
    """Read the options, follow the walls, compare."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", nargs="+", metavar="NAME", help="these walls")
    parser.add_argument("--walls", type=int, default=len(WALLS), metavar="N", help="the first of the sixteen")
    parser.add_argument("--random", type=int, default=20, metavar="N", help="how many random ones")
    parser.add_argument("--variants", type=variants, default=VARIANTS[:1], help=",".join(VARIANTS))
    parser.add_argument("--tolerance", type=float, default=0.005, help="of a step")
    parser.add_argument("--refinement", type=float, default=8.0, help="parts of the tolerance of the finer run")
    parser.add_argument("--told", action="store_true", help="count how often errors are below twice what is told")
    parser.add_argument("--seconds", type=float, default=900.0, help="of processor time that a run is given")
    parser.add_argument("--json", type=Path, help="a line per run, appended to")
    given = parser.parse_args()
    found: dict[str, list[Difference]] = {}

    def follow(wall: Wall, tolerance: float) -> Run:
        return told_by(wall, tolerance, given.seconds)

    def keep(wall: str, name: str, run: Run, off: Difference | None) -> None:
        line(wall, name, run, off)
        if given.json:
            with given.json.open("a") as file:
                file.write(json.dumps(record(wall, name, run, off)) + "\n")

    told: list[tuple[str, float, float]] = []
    row(*HEAD)
    row(*["---"] * len(HEAD))
    for name, make in chosen_walls(given).items():
        wall = make()
        whole = follow(wall, given.tolerance)
        keep(name, str(wall), whole, None)
        for variant in given.variants:
            for changed, run, off in compared(wall, whole, variant, given, follow):
                keep(name, changed, run, off)
                found.setdefault(changed, []).append(off)
        if given.told and "tolerance" in given.variants:
            told += told_beside_true(whole, *(of[-1] for name, of in found.items() if name.startswith("tolerance")))
    print()
    for changed, differences in found.items():
        summary(changed, differences)
    shares_told(told)


if __name__ == "__main__":
    main()
