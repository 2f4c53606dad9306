"""What mortar costs along a settlement: the same walls dry, and with joints that break.

    python benchmarks/mortar.py [--walls 68 232 facade] [--limit 0.008] [--seconds 1500]

Walls in running bond whose right half settles, of about so many bricks, and the façade of the examples: dry, with
brittle mortar, and with mortar that softens over half a millimetre. Seconds are processor time of the settlement, with
bounds and certificates, on one thread; programs are those of steps and of bounds. A run that takes longer than
``--seconds`` is given up at the increment it has reached.
"""

from __future__ import annotations

import argparse
import os

os.environ["OMP_NUM_THREADS"] = "1"  # before numpy starts its threads, whose waiting would count as work
os.environ["OPENBLAS_NUM_THREADS"] = "1"

import time
import tomllib
from dataclasses import replace
from pathlib import Path

from growth import INCREMENT, wall_of

import solver
from blockvis.generators import catalogue
from solver import mechanics

EXAMPLE = Path(__file__).parents[1] / "examples" / "facade.toml"

#: Of lime mortar [Pa], and the opening and slip over which it softens [m].
STRENGTH = {"cohesion": 2e4, "tensile_strength": 1e4}
SOFTENS = {"fracture_opening": 5e-4, "fracture_slip": 5e-4}
LAWS: dict[str, dict[str, float]] = {"dry": {}, "brittle": STRENGTH, "softening": STRENGTH | SOFTENS}


def wall(name: str) -> tuple[solver.Assembly, solver.Interfaces, float]:
    """Blocks, their dry interfaces, and the increment [m]."""
    if name != "facade":
        return wall_of(int(name)), solver.Interfaces(), INCREMENT
    case = tomllib.loads(EXAMPLE.read_text(encoding="utf-8"))
    assembly = catalogue.build(case["geometry"]["layout"], case["geometry"]["parameters"])
    pairs = {
        tuple(table["materials"]): solver.InterfaceLaw(table["friction_coefficient"])
        for table in case.get("interfaces", [])
    }
    law = solver.InterfaceLaw(case["material"]["friction_coefficient"])
    return assembly, solver.Interfaces(law, pairs), case["settlement"]["increment"]


def with_strength(interfaces: solver.Interfaces, strength: dict[str, float]) -> solver.Interfaces:
    """The interfaces with this strength in all joints."""
    pairs = {blocks: replace(law, **strength) for blocks, law in interfaces.pairs.items()}
    return replace(interfaces, default=replace(interfaces.default, **strength), pairs=pairs)


def main() -> None:
    """Print a line per wall and law."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--walls", nargs="+", default=["68", "232", "facade"])
    parser.add_argument("--laws", nargs="+", choices=LAWS, default=list(LAWS))
    parser.add_argument("--limit", type=float, default=0.008, help="settlement [m]")
    parser.add_argument("--seconds", type=float, default=1500.0)
    chosen = parser.parse_args()
    print("| blocks | joints | settled mm | R / W | programs | seconds | of the dry wall |")
    for name in chosen.walls:
        assembly, interfaces, increment = wall(name)
        dry = float("nan")
        for law in chosen.laws:
            settlement = solver.Settlement(direction=(0.0, -1.0), increment=increment, limit=chosen.limit)
            started, found = time.process_time(), []
            increments = mechanics.settlement_increments(
                assembly,
                (settlement,),
                interfaces=with_strength(interfaces, LAWS[law]),
                loads=solver.self_weight(assembly),
            )
            for one in increments:
                found.append(one)
                if time.process_time() - started > chosen.seconds:
                    break
            seconds, last = time.process_time() - started, found[-1]
            dry = seconds if law == "dry" else dry
            print(
                f"| {assembly.n_blocks} | {law} | {1e3 * last.settlement:g} | "
                f"{last.reaction / mechanics.total_weight(assembly):.4f} | {sum(one.programs for one in found)} | "
                f"{seconds:.1f} | {seconds / dry:.2f} |",
                flush=True,
            )


if __name__ == "__main__":
    main()
