"""Whether the path of a wall whose joints slide is a property of the wall: descriptions, BLAS kernels, increments.

    python benchmarks/sliding_walls.py OUT.jsonl [--walls window door] [--descriptions drawn mirrored] \
        [--kernels Haswell SkylakeX] [--parts 1 2 4] [--limit 0.02]
    python benchmarks/sliding_walls.py OUT.jsonl --summary

Every wall in eight equivalent descriptions, with the kernels of the linear algebra that OPENBLAS_CORETYPE chooses, and
with its increment whole, halved and quartered: reaction R(s) and capacity α(s) at given settlements, and the
displacement at collapse. Each run is a line of OUT.jsonl; runs that are there already are not repeated, so that it can
be measured in parts. The table has, per wall, the largest spread over descriptions and kernels at one increment, and
over increments in one description with one kernel: (largest - smallest) / mean.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
import tomllib
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

import solver
from blockvis.generators import catalogue

EXAMPLES = Path(__file__).parents[1] / "examples"
KERNELS = ("Haswell", "SkylakeX", "Prescott")
PARTS = (1, 2, 4)

#: One thread: sums must not depend on how many there are.
ALONE = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}


@dataclass(frozen=True)
class Wall:
    """A wall in one description, and what is done to it; lengths in metres.

    Attributes
    ----------
    assembly : solver.Assembly
    interfaces : solver.Interfaces
    loads : solver.Loads
        The live loads are those of the capacity.
    direction : (2,) array
        Of the settlement.
    increment, limit : float
    at : tuple of float
        Settlements at which R and α are compared.
    length, force : float
        What a length and a force of the drawing have become.
    """

    assembly: solver.Assembly
    interfaces: solver.Interfaces
    loads: solver.Loads
    direction: np.ndarray
    increment: float
    limit: float
    at: tuple[float, ...]
    length: float = 1.0
    force: float = 1.0


# Walls --------------------------------------------------------------------------------------------------------------


def sinking(
    assembly: solver.Assembly,
    friction: float | solver.Interfaces,
    increment: float,
    at: Sequence[float],
    direction: Sequence[float] = (0.0, -1.0),
    limit: float | None = None,
) -> Wall:
    """A wall whose ground settles, its live load its weight to the right."""
    interfaces = (
        friction if isinstance(friction, solver.Interfaces) else solver.Interfaces(solver.InterfaceLaw(friction))
    )
    live = solver.weight_fraction(assembly, (1.0, 0.0), assembly.free)
    loads = solver.Loads(solver.self_weight(assembly).dead, live)
    return Wall(assembly, interfaces, loads, np.asarray(direction), increment, limit or max(at), tuple(at))


def example(name: str, at: Sequence[float]) -> Wall:
    """A wall of ``examples/``."""
    case = tomllib.loads((EXAMPLES / f"{name}.toml").read_text(encoding="utf-8"))
    assembly = catalogue.build(case["geometry"]["layout"], case["geometry"]["parameters"])
    settlement = case["settlement"]
    return sinking(
        assembly,
        case["material"]["friction_coefficient"],
        settlement["increment"],
        at,
        settlement["direction"],
        settlement["limit"],
    )


def panel(bricks: int, courses: int, friction: float, at: Sequence[float]) -> Wall:
    """A panel in running bond, half of whose base sinks."""
    parameters = {"nb": bricks, "nc": courses, "block_height": 0.1}
    return sinking(catalogue.build("panel", parameters), friction, 0.004, at)


def door(friction: float = 0.5) -> Wall:
    """A wall with a door under a lintel, half of whose ground sinks."""
    hole = {"x": 0.8, "y": 0.0, "width": 0.8, "height": 1.0, "head": "lintel", "bearing": 0.2, "depth": 0.2}
    parameters = {"bricks": 6, "courses": 8, "brick_length": 0.4, "brick_height": 0.2, "depth": 0.4}
    assembly = catalogue.build("wall", {**parameters, "settling": [1.2, 2.4], "openings": [hole]})
    return sinking(assembly, friction, 0.01, (0.02, 0.05, 0.1, 0.15, 0.2))


def bay() -> Wall:
    """One bay of the façade of the examples: a window under a segmental arch of three dressed stones."""
    size = {"bricks": 10, "courses": 14, "storeys": 1, "windows": 1, "window_bricks": 4, "window_courses": 6}
    parameters = {**size, "sill_courses": 3, "voussoirs": 3, "rise_courses": 1.5}
    stone = solver.Interfaces(solver.InterfaceLaw(0.6), {("stone", "stone"): solver.InterfaceLaw(0.4)})
    return sinking(catalogue.build("facade", parameters), stone, 0.005, (0.005, 0.01, 0.02, 0.03))


WALLS: dict[str, Callable[[], Wall]] = {
    "window": lambda: example("wall_horizontal_after_settlement", (0.01, 0.02, 0.03, 0.04, 0.05, 0.06)),
    "panel 5x6": lambda: panel(5, 6, 0.3, (0.02, 0.04, 0.06, 0.08)),
    "panel 8x8": lambda: panel(8, 8, 0.5, (0.01, 0.02, 0.03, 0.04)),
    "door": door,
    "bay": bay,
    "arch": lambda: example("wall_with_arch", (0.02, 0.06, 0.1, 0.2, 0.3)),
}


# Descriptions -------------------------------------------------------------------------------------------------------


def redrawn(wall: Wall, rings: Sequence[np.ndarray], *, density: float = 1.0, **changes: Any) -> Wall:
    """The wall with other outlines, block by block, the density multiplied by a factor."""
    old = wall.assembly
    new = solver.Assembly.from_outlines(
        rings,
        names=old.names,
        roles=[str(role) for role in old.roles],
        density=old.density * density,
        thickness=old.thickness,
        materials=old.materials,
    )
    return replace(wall, assembly=new, **changes)


def outlines_of(wall: Wall) -> list[np.ndarray]:
    return [wall.assembly.outline(i) for i in range(wall.assembly.n_blocks)]


def carried_over(wall: Wall, matrix: Sequence[Sequence[float]], scale: float = 1.0) -> Wall:
    """Turned or mirrored by an orthogonal matrix and made larger; loads and settlement go along."""
    map_, sign = np.asarray(matrix, dtype=float), float(np.sign(np.linalg.det(matrix)))

    def load(given: np.ndarray) -> np.ndarray:
        return scale**2 * np.column_stack([given[:, :2] @ map_.T, sign * scale * given[:, 2]])

    return redrawn(
        wall,
        [scale * ring @ map_.T for ring in outlines_of(wall)],
        loads=solver.Loads(load(wall.loads.dead), load(wall.loads.live)),
        direction=map_ @ wall.direction,
        increment=scale * wall.increment,
        limit=scale * wall.limit,
        at=tuple(scale * s for s in wall.at),
        length=scale * wall.length,
        force=scale**2 * wall.force,
    )


def shuffled(wall: Wall, seed: int) -> Wall:
    """The same blocks in another order."""
    old = wall.assembly
    order = np.random.default_rng(seed).permutation(old.n_blocks)
    new = solver.Assembly.from_outlines(
        [old.outline(i) for i in order],
        names=[old.names[i] for i in order],
        roles=[str(old.roles[i]) for i in order],
        density=old.density[order],
        thickness=old.thickness[order],
        materials=[old.materials[i] for i in order],
    )
    return replace(wall, assembly=new, loads=solver.Loads(wall.loads.dead[order], wall.loads.live[order]))


def renumbered(wall: Wall, seed: int) -> Wall:
    """Every outline begins at another corner."""
    random = np.random.default_rng(seed)
    return redrawn(wall, [np.roll(ring, int(random.integers(len(ring))), axis=0) for ring in outlines_of(wall)])


def heavier(wall: Wall, factor: float) -> Wall:
    """Denser blocks, all loads with them."""
    loads = solver.Loads(factor * wall.loads.dead, factor * wall.loads.live)
    return redrawn(wall, outlines_of(wall), density=factor, loads=loads, force=factor * wall.force)


DESCRIPTIONS: dict[str, Callable[[Wall], Wall]] = {
    "drawn": lambda wall: wall,
    "mirrored": lambda wall: carried_over(wall, [[-1, 0], [0, 1]]),
    "turned": lambda wall: carried_over(wall, [[0, -1], [1, 0]]),
    "shuffled 1": lambda wall: shuffled(wall, 1),
    "shuffled 2": lambda wall: shuffled(wall, 2),
    "renumbered": lambda wall: renumbered(wall, 1),
    "ten times": lambda wall: carried_over(wall, np.eye(2).tolist(), scale=10.0),
    "heavier": lambda wall: heavier(wall, 3.0),
}


# Runs ---------------------------------------------------------------------------------------------------------------


def measured(wall: Wall, part: int, limit: float | None) -> dict[str, Any]:
    """One run: R over the weight and α at the settlements that are compared, and how it ended; lengths as drawn."""
    wanted = [s for s in wall.at if limit is None or s <= limit * wall.length * (1.0 + 1e-9)]
    settlement = solver.Settlement(
        direction=wall.direction,
        increment=wall.increment / part,
        limit=wall.limit if limit is None else limit * wall.length,
        tolerance=0.01 * wall.increment,
        stops=tuple(wanted),
    )
    weight = float(np.hypot(*wall.loads.dead[wall.assembly.free, :2].sum(axis=0)))
    started = time.process_time()
    response = solver.settle(
        wall.assembly,
        settlement,
        interfaces=wall.interfaces,
        loads=wall.loads,
        controls=solver.Controls(increments="coulomb", falling_frames=1),
    )
    seconds = time.process_time() - started
    reaction, capacity = {}, {}
    for s in wanted:
        found = [i for i in response.path if abs(i.settlement - s) < 1e-6 * wall.increment]
        if not found:
            continue
        key = f"{s / wall.length:.4f}"
        reaction[key] = found[0].reaction / weight
        capacity[key] = solver.limit_load(
            wall.assembly,
            loads=wall.loads,
            interfaces=wall.interfaces,
            pose=found[0].pose,
            displacement=0.001 * wall.length,
        ).multiplier
    return {
        "stop": str(response.stop),
        "message": response.message,
        "collapse": None if response.collapse is None else response.collapse.displacement / wall.length,
        "reached": float(response.settlement[-1]) / wall.length if response.path else 0.0,
        "reaction": reaction,
        "capacity": capacity,
        "certificate": max((i.certificate.equilibrium_residual for i in response.path), default=0.0),
        "penetration": max((i.certificate.largest_penetration for i in response.path), default=0.0) / wall.length,
        "programs": sum(i.programs for i in response.increments),
        "seconds": seconds,
    }


def run(out: Path, kernel: str, chosen: Iterable[tuple[str, int, str]], limit: float | None) -> None:
    """Runs of one kernel, in this process, each a line of the file as soon as it is done."""
    done = {(r["wall"], r["parts"], r["description"], r["kernel"], r["limit"]) for r in lines(out)}
    for name, part, description in chosen:
        if (name, part, description, kernel, limit) in done:
            continue
        row: dict[str, Any] = {"wall": name, "parts": part, "description": description}
        row |= {"kernel": kernel, "limit": limit}
        try:
            row |= measured(DESCRIPTIONS[description](WALLS[name]()), part, limit)
        except (ValueError, RuntimeError, ArithmeticError) as error:  # a finding, too
            row |= {"stop": f"raised {type(error).__name__}", "message": str(error), "collapse": None, "seconds": 0.0}
            row |= {"reaction": {}, "capacity": {}}
        with out.open("a") as file:
            file.write(json.dumps(row) + "\n")
        last = [f"{list(row[what].values())[-1]:.5f}" if row[what] else "-" for what in ("reaction", "capacity")]
        print(
            f"{name:10s} {description:11s} {kernel:9s} 1/{part}  {row['stop']:14s} R {last[0]}  α {last[1]}  "
            f"{row['seconds']:.1f} s",
            flush=True,
        )


def lines(out: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in out.read_text(encoding="utf-8").splitlines()] if out.exists() else []


def run_all(out: Path, chosen: argparse.Namespace) -> None:
    """Each kernel in a process of its own, one after another: the kernel is chosen when numpy is loaded."""
    for part in chosen.parts:
        for name in chosen.walls:
            for kernel in chosen.kernels:
                command = [sys.executable, __file__, str(out), "--here", kernel, "--walls", name, "--parts", str(part)]
                command += ["--descriptions", *chosen.descriptions]
                if chosen.limit is not None:
                    command += ["--limit", str(chosen.limit)]
                subprocess.run(command, env={**os.environ, **ALONE, "OPENBLAS_CORETYPE": kernel}, check=True)


# Table --------------------------------------------------------------------------------------------------------------


def spread(values: Sequence[float]) -> float:
    """(largest - smallest) / mean."""
    return (max(values) - min(values)) / abs(sum(values) / len(values)) if len(values) > 1 else float("nan")


def numbers_of(row: dict[str, Any]) -> dict[tuple[str, str], float]:
    found = {("R", s): value for s, value in row["reaction"].items()}
    found |= {("α", s): value for s, value in row["capacity"].items()}
    return found | ({("collapse", ""): row["collapse"]} if row["collapse"] is not None else {})


def largest(rows: Iterable[dict[str, Any]], what: str, together: Callable[[dict[str, Any]], Any]) -> tuple[float, str]:
    """Largest spread of R, α or collapse within rows that belong together, and the settlement where it is."""
    groups: dict[Any, list[float]] = defaultdict(list)
    for row in rows:
        for (kind, s), value in numbers_of(row).items():
            if kind == what:
                groups[together(row), s].append(value)
    found = [(spread(values), key[1]) for key, values in groups.items() if len(values) > 1]
    return max(found) if found else (float("nan"), "")


def summary(out: Path) -> None:
    """One table, one line per wall."""
    rows = lines(out)
    over = {
        "descriptions and kernels": lambda row: row["parts"],
        "increments": lambda row: (row["description"], row["kernel"]),
    }
    print("Largest spread in per cent, at (settlement in metres):")
    print(f"{'wall':10s} {'over':25s} {'R(s)':>18s} {'α(s)':>18s} {'collapse':>10s}   runs, endings, seconds")
    for name in dict.fromkeys(row["wall"] for row in rows):
        mine = [row for row in rows if row["wall"] == name]
        endings = ", ".join(f"{n} {stop}" for stop, n in Counter(row["stop"] for row in mine).items())
        how = [sorted({row[key] for row in mine}, key=str) for key in ("description", "kernel", "parts")]
        seconds = [row["seconds"] for row in mine]
        tail = [
            f"{len(mine)} runs of {len(how[0])} descriptions, {len(how[1])} kernels, parts {how[2]}",
            f"{endings}; {min(seconds):.0f} to {max(seconds):.0f} s",
        ]
        for (words, together), end in zip(over.items(), tail, strict=True):
            cells = []
            for what in ("R", "α", "collapse"):
                value, s = largest(mine, what, together)
                cells.append("-" if np.isnan(value) else f"{100.0 * value:.3f}" + (f" ({float(s):g})" if s else ""))
            print(f"{name:10s} {words:25s} {cells[0]:>18s} {cells[1]:>18s} {cells[2]:>10s}   {end}")
    print("\nR / W and α over all runs, smallest to largest:")
    for name in dict.fromkeys(row["wall"] for row in rows):
        values: dict[tuple[str, str], list[float]] = defaultdict(list)
        for row in rows:
            if row["wall"] == name:
                for key, value in numbers_of(row).items():
                    values[key].append(value)
        for (what, s), found in sorted(values.items()):
            where = f"at {s} m" if s else ""
            print(f"{name:10s} {what:8s} {where:12s} {min(found):.5f} to {max(found):.5f}  ({len(found)} runs)")


def main() -> None:
    """Read the options and run, or sum up."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path, help="JSON lines, appended to")
    parser.add_argument("--walls", nargs="+", choices=WALLS, default=list(WALLS))
    parser.add_argument("--descriptions", nargs="+", choices=DESCRIPTIONS, default=list(DESCRIPTIONS))
    parser.add_argument("--kernels", nargs="+", default=list(KERNELS), help="values of OPENBLAS_CORETYPE")
    parser.add_argument("--parts", nargs="+", type=int, default=list(PARTS), help="parts of the increment")
    parser.add_argument("--limit", type=float, help="end of the settlement in metres of the drawing")
    parser.add_argument("--summary", action="store_true", help="only the table of what is there")
    parser.add_argument("--here", help=argparse.SUPPRESS)
    chosen = parser.parse_args()
    if chosen.here:
        combinations = [(w, p, d) for p in chosen.parts for w in chosen.walls for d in chosen.descriptions]
        run(chosen.out, chosen.here, combinations, chosen.limit)
        return
    if not chosen.summary:
        run_all(chosen.out, chosen)
    summary(chosen.out)


if __name__ == "__main__":
    main()
