"""What the increments of a settlement cost: brick walls of growing size, and examples to their ends.

    python benchmarks/first_increments.py [--blocks 102 205 399 805 1629] [--increments 5] [--examples facade ...]

Running-bond walls, five wide for every three courses, whose right half sinks by 2 mm an increment (``growth.py``); the
blocks are told with the two of the ground. The exponents are those of the number of blocks, fitted to all walls.
"Rest" is the equilibrium of the drawing, and belongs to no increment. The façade sinks by ten increments of 10 mm, the
other examples move until they fall. Seconds are processor time; after every wall its line is printed.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from growth import INCREMENT, wall_of

import blockvis
import solver
from blockvis.cases.build import case_assembly, case_interfaces, case_loads

EXAMPLES = Path(__file__).parents[1] / "examples"
SIZES = (102, 205, 399, 805, 1629)
FRICTION = 0.6

#: Examples and how far they go [m]; to the limit of the case where nothing is told.
ENDS = {"facade": 0.1, "wall_with_arch": None, "semicircular_arch": None}


@dataclass(frozen=True)
class Costs:
    """Processor seconds and programs of the rest and of every increment after it, and how it ended."""

    seconds: tuple[float, ...]
    programs: tuple[int, ...]
    response: solver.Response


def followed(
    assembly: solver.Assembly,
    settlements: Sequence[solver.Settlement],
    interfaces: solver.Interfaces,
    loads: solver.Loads | None = None,
) -> Costs:
    """Follow a settlement; the time between two increments that are told is that of the second."""
    told = [time.process_time()]
    response = solver.settle(
        assembly,
        settlements,
        interfaces=interfaces,
        loads=loads,
        controls=solver.Controls(falling_frames=0),
        on_increment=lambda _: told.append(time.process_time()),
    )
    # What comes after the last increment, the bracket of a collapse, belongs to none.
    return Costs(tuple(np.diff(told).tolist()), tuple(i.programs for i in response.increments), response)


def wall(blocks: int, increments: int) -> Costs:
    sinks = solver.Settlement(direction=(0.0, -1.0), increment=INCREMENT, limit=increments * INCREMENT)
    return followed(wall_of(blocks), [sinks], solver.Interfaces(solver.InterfaceLaw(FRICTION)))


def example(name: str, limit: float | None) -> tuple[Costs, float]:
    """An example as its case file has it, and the processor seconds of all of it."""
    case = blockvis.read_case(EXAMPLES / f"{name}.toml")
    assembly = case_assembly(case)
    settlements = case.settlements
    if limit is not None:
        settlements = tuple(replace(given, limit=limit) for given in settlements)
    interfaces, loads = case_interfaces(case), case_loads(case, assembly)
    started = time.process_time()
    costs = followed(assembly, settlements, interfaces, loads)
    return costs, time.process_time() - started


def row(*cells: object) -> None:
    print("| " + " | ".join(str(cell) for cell in cells) + " |", flush=True)


def exponent(blocks: Sequence[int], seconds: Sequence[float]) -> str:
    """Of seconds = constant · blocks^exponent, least squares of the logarithms."""
    if len(blocks) < 2:
        return ""
    return f"{np.polyfit(np.log(blocks), np.log(np.maximum(seconds, 1e-6)), 1)[0]:.2f}"


def walls(sizes: Sequence[int], increments: int) -> None:
    """The table of the brick walls."""
    later = [f"{k}" for k in range(2, increments + 1)]
    head = ("blocks", "rest s", "first s", *(f"{k} s" for k in later), "programs", "R/W first", "R/W last", "ending")
    row(*head)
    row(*["---"] * len(head))
    blocks, table = [], []
    wall(50, 1)  # what is imported and compiled once
    for size in sizes:
        costs = wall(size, increments)
        response = costs.response
        blocks.append(response.assembly.n_blocks)
        table.append([*costs.seconds[: increments + 1], *[np.nan] * (increments + 1 - len(costs.seconds))])
        share = [*(response.reaction / response.total_weight), np.nan, np.nan]
        row(
            blocks[-1],
            *(f"{s:.2f}" for s in table[-1]),
            " + ".join(str(programs) for programs in costs.programs),
            f"{share[1]:.4f}",
            f"{share[len(response.path) - 1]:.4f}",
            response.stop,
        )
    fitted = [exponent(blocks, column) for column in np.array(table).T]
    row("exponent", *fitted, "", "", "", "")
    mean = np.array(table)[:, 2:].mean(axis=1)
    print(f"\nrest and first increment: blocks^{exponent(blocks, np.array(table)[:, :2].sum(axis=1))}", end="")
    print(f", those after it: blocks^{exponent(blocks, mean)}")


def examples(names: Sequence[str]) -> None:
    """The table of the examples."""
    print()
    head = (
        "example",
        "blocks",
        "increments",
        "rest s",
        "first s",
        "median of the others s",
        "all s",
        "programs",
        "end",
    )
    row(*head)
    row(*["---"] * len(head))
    for name in names:
        costs, total = example(name, ENDS[name])
        response, (rest, first, *others) = costs.response, (*costs.seconds, np.nan, np.nan)
        end = f"{response.stop} at {response.settlement[-1]:.6g} m"
        if response.collapse is not None:
            low, high = response.collapse.bracket
            end = f"collapse at {response.collapse.displacement:.7g} m, bracket {low:.7g} to {high:.7g} m"
        row(
            name,
            response.assembly.n_blocks,
            len(response.path) - 1,
            f"{rest:.2f}",
            f"{first:.2f}",
            f"{np.nanmedian(others):.2f}",
            f"{total:.1f}",
            sum(costs.programs),
            end,
        )


def main() -> None:
    """Read the options and measure."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--blocks", type=int, nargs="*", default=list(SIZES), help="sizes of the brick walls")
    parser.add_argument("--increments", type=int, default=5, help="of the brick walls")
    parser.add_argument("--examples", nargs="*", choices=ENDS, default=list(ENDS))
    given = parser.parse_args()
    if given.blocks:
        walls(given.blocks, given.increments)
    if given.examples:
        examples(given.examples)


if __name__ == "__main__":
    main()
