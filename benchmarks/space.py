"""What the increments of vaults cost: domes whose stones hinge, and cross vaults whose stones slide, of growing size.

    python benchmarks/space.py [--hinging 8,6 24,11 36,27 80,60] [--sliding 9,0.9 15,0.5 21,0.36 31,0.25] \
        [--cases CASE.toml ...] [--increments 3]

Domes as in ``examples/dome_spreading.toml``, of so many lunes and courses, spread by 0.02 of their radius an increment;
of cross vaults of so many voussoirs, of stones so long [m], one of four supports sinks by 2 mm an increment. Case files
are followed for as many of their own increments. Each runs in a process of its own, on one thread; seconds are
processor time, in all with the bracket of a collapse. "Rest" is the equilibrium of the drawing. Exponents are those of
the number of blocks, fitted.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from first_increments import exponent, followed, row

import blockvis
import solver
from blockvis import generators
from blockvis.cases.build import case_assembly, case_interfaces, case_loads

HINGING = ("8,6", "24,11", "36,27", "80,60")
SLIDING = ("9,0.9", "15,0.5", "21,0.36", "31,0.25")

#: Libraries are held to one thread.
ONE_THREAD = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1")


def one(kind: str, size: str, increments: int) -> dict[str, Any]:
    """Measure one structure, in this process."""
    interfaces, loads = solver.Interfaces(solver.InterfaceLaw(0.7 if kind == "hinging" else 0.6)), None
    if kind == "cases":
        case = blockvis.read_case(size)
        assembly = case_assembly(case)
        interfaces, loads = case_interfaces(case), case_loads(case, assembly)
        settlements = [
            replace(given, limit=min(given.limit, increments * given.increment)) for given in case.settlements
        ]
    elif kind == "hinging":
        lunes, courses = map(int, size.split(","))
        assembly = generators.dome(thickness_ratio=0.12, lunes=lunes, courses=courses, cap=15.0)
        settlements = [
            solver.Settlement(radial_from=(0.0, 0.0), increment=0.02, limit=0.02 * increments, tolerance=1e-4)
        ]
    else:
        voussoirs, stone = size.split(",")
        assembly = generators.cross_vault(voussoirs=int(voussoirs), stone=float(stone))
        settlements = [solver.Settlement(direction=(0.0, 0.0, -1.0), increment=0.002, limit=0.002 * increments)]
    started = time.process_time()
    costs = followed(assembly, settlements, interfaces, loads)
    total, response = time.process_time() - started, costs.response
    return {
        "blocks": assembly.n_blocks,
        "seconds": costs.seconds,
        "total": total,
        "programs": costs.programs,
        "share": float(response.reaction[len(response.path) - 1] / response.total_weight),
        "ending": f"{response.stop} at {response.settlement[-1]:.4g} m",
        "MiB": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
    }


def table(kind: str, sizes: Sequence[str], increments: int) -> None:
    """Print the lines of a kind of structure, each as it is measured, and their exponents."""
    later = [f"{k} s" for k in range(2, increments + 1)]
    row(kind, "blocks", "rest s", "first s", *later, "all s", "programs", "R/W last", "MiB", "ending")
    row(*["---"] * (8 + increments))
    blocks, starts, others = [], [], []
    for size in sizes:
        command = [sys.executable, __file__, "--one", kind, size, str(increments)]
        done = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True, env=os.environ | ONE_THREAD)
        found = json.loads(done.stdout)
        seconds = [f"{s:.2f}" for s in found["seconds"][: increments + 1]]
        blocks.append(found["blocks"])
        starts.append(sum(found["seconds"][:2]))
        others.append(sum(found["seconds"][2 : increments + 1]) / max(1, increments - 1))
        row(
            Path(size).stem if kind == "cases" else size,
            found["blocks"],
            *seconds,
            *[""] * (increments + 1 - len(seconds)),
            f"{found['total']:.1f}",
            " + ".join(map(str, found["programs"])),
            f"{found['share']:.4f}",
            f"{found['MiB']:.0f}",
            found["ending"],
        )
    if kind != "cases":
        print(f"\n{kind}: rest and first increment blocks^{exponent(blocks, starts)}", end="")
        print(f", those after it blocks^{exponent(blocks, others)}\n" if increments > 1 else "\n", flush=True)


def main() -> None:
    """Read the options and measure."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--hinging", nargs="*", default=list(HINGING), help="lunes,courses of domes")
    parser.add_argument("--sliding", nargs="*", default=list(SLIDING), help="voussoirs,stone of cross vaults")
    parser.add_argument("--cases", nargs="*", default=[], help="case files")
    parser.add_argument("--increments", type=int, default=3)
    parser.add_argument("--one", nargs=3, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.one:
        kind, size, increments = given.one
        print(json.dumps(one(kind, size, int(increments))))
        return
    for kind in ("hinging", "sliding", "cases"):
        if getattr(given, kind):
            table(kind, getattr(given, kind), given.increments)


if __name__ == "__main__":
    main()
