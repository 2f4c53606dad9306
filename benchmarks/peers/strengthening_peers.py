"""Ties beside MuJoCo, mortar beside LMGC90: one wall each, the same blocks and the same settlement.

    python benchmarks/peers/strengthening_peers.py [--ties none elastic iron] [--cohesions 0 2e4 6e4] [--seconds 600]

with ``mujoco`` and ``compas_lmgc90`` as ``peers.py`` says; what is not installed is left out.

Ties: the arch on two piers of ``examples/arch_with_tie.toml``, with a tie that gives (an elastic rod, whose force says
how far the piers have moved apart) and with the tie of iron that yields at 1 kN (the displacement at which the arch
falls says what it has resisted). MuJoCo's tie is a spatial tendon, slack below its length. Mortar: the panel of
``examples/wall_with_mortar.toml``, dry and with mortar, against LMGC90's brittle law of Mohr and Coulomb, in which a
contact has a tensile strength and a cohesion times its part of the face until it opens or slides. Both engines run with
a time step and with half of it, and move the support slowly; forces are means over ``WINDOW`` before the settlement.
"""

from __future__ import annotations

import argparse
import os

os.environ["OMP_NUM_THREADS"] = "1"  # before numpy starts its threads, whose waiting would count as work
os.environ["OPENBLAS_NUM_THREADS"] = "1"

import time
import tomllib
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import physics_engines
from peers import loaded

import solver
from blockvis.generators import catalogue
from solver import mechanics

EXAMPLES = Path(__file__).parents[2] / "examples"
FRICTION = 0.6

#: Time steps of the engines [s]; the second is half of the first.
STEPS = (1e-3, 5e-4)

#: Speed of the support that moves [m/s], time over which forces are averaged [s].
SPEED, WINDOW = {"mujoco": 0.02, "compas_lmgc90": 0.01}, 0.2

#: Speed of a block, in speeds of the support, from which on it falls for good.
FALLING = 10.0

TIES = ("none", "elastic", "iron")

#: Where the tie and the support are read [m], the stiffness of the elastic tie [N/m], the strength of the iron one [N].
ARCH_AT, ELASTIC, YIELDS = (0.05, 0.1, 0.2), 1e4, 1000.0

#: Where the wall is read [m], and cohesions; the tensile strength is half of them [Pa].
WALL_AT, COHESIONS = (0.002, 0.005, 0.01), (0.0, 6e4, 2e5)


def example(name: str) -> tuple[solver.Assembly, dict[str, Any]]:
    """The blocks of an example, and the rest of its case."""
    case = tomllib.loads((EXAMPLES / f"{name}.toml").read_text(encoding="utf-8"))
    return catalogue.build(case["geometry"]["layout"], case["geometry"]["parameters"]), case


def engine(
    name: str,
    assembly: solver.Assembly,
    direction: tuple[float, float],
    at: Sequence[float],
    time_step: float,
    budget: float,
    **options: Any,
) -> tuple[list[np.ndarray], float, float]:
    """Reads an engine: (reaction, forces of ties) [N] at settlements, the last one before a fall [m], and seconds."""
    found: list[np.ndarray] = []
    seen: list[physics_engines.Sample] = []
    within, seconds = round(WINDOW / physics_engines.SAMPLING), 0.0
    speed = SPEED[name]
    given = (name, assembly, physics_engines.Drive(direction, speed), time_step, FRICTION)
    for spent, sample in physics_engines.in_a_process(*given, budget=budget, **options):
        seconds = spent
        if sample.time < 0.0:
            continue
        seen.append(sample)
        if len(seen) <= within:
            continue
        moved = np.linalg.norm(sample.positions - seen[-1 - within].positions, axis=1).max()
        if moved > FALLING * speed * WINDOW:
            return found, seen[-1 - within].displacement, seconds
        if len(found) < len(at) and sample.displacement >= at[len(found)]:
            mean = np.mean([np.append(one.force @ direction, one.ties) for one in seen[-within:]], axis=0)
            found.append(mean)
            if len(found) == len(at) and at[-1] < min(ARCH_AT):
                break
    return found, float("nan"), seconds


def cell(values: Sequence[float], digits: int) -> str:
    return " / ".join(f"{value:.{digits}f}" for value in values)


def ties(chosen: Sequence[str], steps: Sequence[float], budget: float) -> None:
    """The arch with two kinds of tie."""
    assembly, case = example("arch_with_tie")
    ends = tuple(tuple(case["ties"][0][end]) for end in ("from", "to"))
    held = tuple(assembly.index(name) for name in ("left pier 4", "right pier 4"))
    iron = case["ties"][0]["area"] * case["ties"][0]["modulus"] / float(np.linalg.norm(np.subtract(*ends)))
    kinds = {
        "none": (),
        "elastic": (solver.Tie("rod", held, ends, ELASTIC),),
        "iron": (solver.Tie("iron", held, ends, iron, strength=YIELDS),),
    }
    print(f"\n| tie | by | R [N] at {' / '.join(map(str, ARCH_AT))} m | tie [N] | falls at [m] | seconds |")
    for kind in chosen:
        given = kinds[kind]
        started = time.process_time()
        settlement = solver.Settlement(direction=(1.0, 0.0), increment=0.01, limit=0.6, stops=ARCH_AT)
        structure = solver.Structure(assembly, solver.Interfaces(solver.InterfaceLaw(FRICTION)), ties=given)
        response = structure.settle(settlement, controls=solver.Controls(falling_frames=0))
        path = [min(response.path, key=lambda one, s=s: abs(one.settlement - s)) for s in ARCH_AT]
        falls = float("nan") if response.collapse is None else response.collapse.displacement
        pull = cell([float(one.state.ties.forces.sum()) for one in path], 0)
        print(
            f"| {kind} | blockvis | {cell([one.reaction for one in path], 0)} | {pull} | {falls:.4f} | "
            f"{time.process_time() - started:.1f} |",
            flush=True,
        )
        for time_step in steps if loaded("mujoco") else ():
            found, falls, seconds = engine("mujoco", assembly, (1.0, 0.0), ARCH_AT, time_step, budget, ties=given)
            reaction = cell([one[0] for one in found], 0)
            pull = cell([float(one[1:].sum()) for one in found], 0)
            print(
                f"| {kind} | MuJoCo {1e3 * time_step:g} ms | {reaction} | {pull} | {falls:.4f} | {seconds:.1f} |",
                flush=True,
            )


def mortar(cohesions: Sequence[float], steps: Sequence[float], budget: float) -> None:
    """The panel, by cohesion."""
    assembly, _ = example("wall_with_mortar")
    weight = mechanics.total_weight(assembly)
    print("\n| cohesion [kPa] | by | R / W at " + " / ".join(f"{1e3 * s:g}" for s in WALL_AT) + " mm | seconds |")
    for cohesion in cohesions:
        started = time.process_time()
        law = replace(solver.InterfaceLaw(FRICTION), cohesion=cohesion, tensile_strength=cohesion / 2.0)
        settlement = solver.Settlement(direction=(0.0, -1.0), increment=0.002, limit=max(WALL_AT), stops=WALL_AT)
        response = solver.Structure(assembly, solver.Interfaces(law)).settle(settlement)
        path = [min(response.path, key=lambda one, s=s: abs(one.settlement - s)) for s in WALL_AT]
        ours = cell([one.reaction / weight for one in path], 4)
        print(f"| {cohesion / 1e3:g} | blockvis | {ours} | {time.process_time() - started:.1f} |", flush=True)
        strength = (cohesion / 2.0, cohesion) if cohesion else None
        for time_step in steps if loaded("compas_lmgc90") else ():
            found, _, seconds = engine(
                "compas_lmgc90", assembly, (0.0, -1.0), WALL_AT, time_step, budget, strength=strength
            )
            theirs = cell([one[0] / weight for one in found], 4)
            print(f"| {cohesion / 1e3:g} | LMGC90 {1e3 * time_step:g} ms | {theirs} | {seconds:.1f} |", flush=True)


def main() -> None:
    """Print both tables, or the one that is asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--ties", nargs="*", default=list(TIES), choices=TIES)
    parser.add_argument("--cohesions", nargs="*", type=float, default=list(COHESIONS), help="[Pa]")
    parser.add_argument("--steps", nargs="+", type=float, default=list(STEPS), help="time steps of the engines [s]")
    parser.add_argument("--seconds", type=float, default=600.0, help="processor time of one run of an engine")
    chosen = parser.parse_args()
    if chosen.ties:
        ties(chosen.ties, chosen.steps, chosen.seconds)
    if chosen.cohesions:
        mortar(chosen.cohesions, chosen.steps, chosen.seconds)


if __name__ == "__main__":
    main()
