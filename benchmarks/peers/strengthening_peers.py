"""Ties beside MuJoCo, mortar beside LMGC90: one wall each, the same blocks and the same settlement.

    python benchmarks/peers/strengthening_peers.py [--ties none elastic iron] [--tensions 1e5] [--cohesions 0 6e4]
        [--push] [--seconds 600]

with ``mujoco`` and ``compas_lmgc90`` as ``peers.py`` says; what is not installed is left out.

Ties: the arch on two piers of ``examples/arch_with_tie.toml``, with a tie that gives (an elastic rod, whose force says
how far the piers have moved apart) and with the tie of iron that yields at 1 kN (the displacement at which the arch
falls says what it has resisted). MuJoCo's tie is a spatial tendon, slack below its length.

Mortar is brittle in LMGC90's law of Mohr and Coulomb: a contact has a tensile strength times its part of the face until
it opens or slides. While it is whole its coefficient of friction is cohesion over tensile strength, whatever is given
(``--push`` shows that), so that ours gets tensile strengths of cohesion over friction, with which both laws are one.
Two structures: an arch whose supports spread, in which three joints break, and the panel of
``examples/wall_with_mortar.toml``, dry and with mortar, in which many do. Supports start slowly, since the jolt of a
joint that breaks breaks others. Engines run with a time step and with half of it; forces are means over ``WINDOW``
before the settlement.
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
from blockvis import generators
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

#: Where the panel is read [m], its cohesions [Pa], speed of its support in LMGC90 [m/s], which it has after [s].
WALL_AT, COHESIONS, WALL_MOVES = (0.002, 0.005, 0.01), (1.8e4, 6e4, 2e5), (0.005, 0.1)

#: Of our own steps along it.
OUR_TOLERANCES = (0.005, 0.00125)

#: Tensile strengths of the arch of mortar [Pa], where it is read [m], speed and time likewise.
TENSIONS, CRACKED_AT, ARCH_MOVES = (5e4, 1e5), (0.0015, 0.01, 0.05), (0.02, 100.0)

#: Tensile strength and cohesion [Pa], and friction, of the brick that LMGC90 pushes off its bed.
PUSHED = ((1e4, 6e3, 0.6), (1e4, 6e3, 0.3), (6e3, 6e3, 0.6), (3e3, 6e3, 0.6))


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
    *,
    moves: tuple[float, float] | None = None,
    to_the_fall: bool = True,
    **options: Any,
) -> tuple[list[physics_engines.Sample], float, float]:
    """Reads an engine: samples with mean forces at settlements, the last one before a fall [m], and seconds."""
    found: list[physics_engines.Sample] = []
    seen: list[physics_engines.Sample] = []
    within, seconds = round(WINDOW / physics_engines.SAMPLING), 0.0
    speed, ramp = moves or (SPEED[name], 0.0)
    drive = physics_engines.Drive(direction, speed, ramp=ramp)
    for spent, sample in physics_engines.in_a_process(
        name, assembly, drive, time_step, FRICTION, budget=budget, **options
    ):
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
            force, pulled = (np.mean([getattr(one, of) for one in seen[-within:]], axis=0) for of in ("force", "ties"))
            found.append(replace(sample, force=force, ties=pulled))
            if len(found) == len(at) and not to_the_fall:
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
            reaction = cell([one.force[0] for one in found], 0)
            pull = cell([float(one.ties.sum()) for one in found], 0)
            print(
                f"| {kind} | MuJoCo {1e3 * time_step:g} ms | {reaction} | {pull} | {falls:.4f} | {seconds:.1f} |",
                flush=True,
            )


def of_mortar(cohesion: float, tension: float) -> solver.InterfaceLaw:
    return replace(solver.InterfaceLaw(FRICTION), cohesion=cohesion, tensile_strength=tension)


def whole(path: Sequence[solver.Increment], at_rest: solver.Increment) -> str:
    """Part of the contact points at rest whose mortar has not broken, of ours."""
    bonds = [one.bonds for one in (at_rest, *path)]
    first, *left = (np.nan if one is None else float(one.left.sum()) for one in bonds)
    return cell([part / first for part in left], 2)


def arch(tensions: Sequence[float], steps: Sequence[float], budget: float) -> None:
    """An arch of mortar, by tensile strength."""
    assembly = generators.arch()
    weight, looks = mechanics.total_weight(assembly), " / ".join(f"{1e3 * s:g}" for s in CRACKED_AT)
    print(f"\n| tensile strength [kPa] | by | R / W at {looks} mm | whole | falls at [m] | seconds |")
    for tension in tensions:
        started = time.process_time()
        settlement = solver.Settlement(direction=(1.0, 0.0), increment=0.01, limit=1.5, stops=CRACKED_AT)
        structure = solver.Structure(assembly, solver.Interfaces(of_mortar(FRICTION * tension, tension)))
        response = structure.settle(settlement, controls=solver.Controls(falling_frames=0))
        falls = float("nan") if response.collapse is None else response.collapse.displacement
        path = [min(response.path, key=lambda one, s=s: abs(one.settlement - s)) for s in CRACKED_AT if not s > falls]
        ours = cell([one.reaction / weight for one in path], 4)
        print(
            f"| {tension / 1e3:g} | blockvis | {ours} | {whole(path, response.path[0])} | {falls:.4f} | "
            f"{time.process_time() - started:.1f} |",
            flush=True,
        )
        strength = (tension, FRICTION * tension)
        for time_step in steps if loaded("compas_lmgc90") else ():
            found, _, seconds = engine(
                "compas_lmgc90",
                assembly,
                (1.0, 0.0),
                CRACKED_AT,
                time_step,
                budget,
                moves=ARCH_MOVES,
                to_the_fall=False,
                strength=strength,
            )
            theirs, left = cell([one.force[0] / weight for one in found], 4), cell([one.whole for one in found], 2)
            print(
                f"| {tension / 1e3:g} | LMGC90 {1e3 * time_step:g} ms | {theirs} | {left} | not run | {seconds:.1f} |",
                flush=True,
            )


def panel(cohesions: Sequence[float], steps: Sequence[float], budget: float) -> None:
    """The panel, by cohesion."""
    assembly, _ = example("wall_with_mortar")
    weight = mechanics.total_weight(assembly)
    print(
        "\n| cohesion [kPa] | by | R / W at " + " / ".join(f"{1e3 * s:g}" for s in WALL_AT) + " mm | whole | seconds |"
    )
    for cohesion in cohesions:
        law = of_mortar(cohesion, cohesion / FRICTION)
        for tolerance in OUR_TOLERANCES:
            started = time.process_time()
            settlement = solver.Settlement(direction=(0.0, -1.0), increment=0.002, limit=max(WALL_AT), stops=WALL_AT)
            controls = solver.Controls(falling_frames=0, step_tolerance=tolerance)
            response = solver.Structure(assembly, solver.Interfaces(law)).settle(settlement, controls=controls)
            path = [min(response.path, key=lambda one, s=s: abs(one.settlement - s)) for s in WALL_AT]
            ours, left = cell([one.reaction / weight for one in path], 4), whole(path, response.path[0])
            print(
                f"| {cohesion / 1e3:g} | blockvis, step_tolerance {tolerance:g} | {ours} | {left} | "
                f"{time.process_time() - started:.1f} |",
                flush=True,
            )
        strength = (cohesion / FRICTION, cohesion) if cohesion else None
        for time_step in steps if loaded("compas_lmgc90") else ():
            found, _, seconds = engine(
                "compas_lmgc90",
                assembly,
                (0.0, -1.0),
                WALL_AT,
                time_step,
                budget,
                moves=WALL_MOVES,
                to_the_fall=False,
                strength=strength,
            )
            theirs, left = cell([-one.force[1] / weight for one in found], 4), cell([one.whole for one in found], 2)
            print(
                f"| {cohesion / 1e3:g} | LMGC90 {1e3 * time_step:g} ms | {theirs} | {left} | {seconds:.1f} |",
                flush=True,
            )


def push(budget: float) -> None:
    """What a brick on its bed of mortar resists in LMGC90: cohesion, and friction of cohesion over tension."""
    boxes = ((0.0, 0.0, 0.4, 0.2), (0.0, -0.4, 1.4, 0.0), (-0.4, 0.02, 0.0, 0.024))
    outlines = [[[left, low], [right, low], [right, high], [left, high]] for left, low, right, high in boxes]
    assembly = solver.Assembly.from_outlines(outlines, roles=["free", "fixed", "moving"], thickness=0.25)
    weight, area = mechanics.total_weight(assembly), 0.4 * 0.25
    print("\n| tension, cohesion [Pa], friction | c A + (c / t) N [N] | LMGC90, whole | friction N | broken |")
    for tension, cohesion, friction in PUSHED if loaded("compas_lmgc90") else ():
        drive, forces = physics_engines.Drive((1.0, 0.0), 1e-4), []
        for _, sample in physics_engines.in_a_process(
            "compas_lmgc90", assembly, drive, 1e-3, friction, budget=budget, sampling=1e-3, strength=(tension, cohesion)
        ):
            forces.append(-float(sample.force[0]))
            if sample.time > 0.02:
                break
        expected = cohesion * area + cohesion / tension * weight
        print(
            f"| {tension:g}, {cohesion:g}, {friction:g} | {expected:.0f} | {max(forces):.0f} | "
            f"{friction * weight:.0f} | {forces[-1]:.0f} |",
            flush=True,
        )


def main() -> None:
    """Print all tables, or those that are asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--ties", nargs="*", default=list(TIES), choices=TIES)
    parser.add_argument("--tensions", nargs="*", type=float, default=list(TENSIONS), help="of the arch of mortar [Pa]")
    parser.add_argument("--cohesions", nargs="*", type=float, default=list(COHESIONS), help="of the panel [Pa]")
    parser.add_argument("--push", action="store_true", help="show LMGC90's law on a brick")
    parser.add_argument("--steps", nargs="+", type=float, default=list(STEPS), help="time steps of the engines [s]")
    parser.add_argument("--seconds", type=float, default=600.0, help="processor time of one run of an engine")
    chosen = parser.parse_args()
    if chosen.ties:
        ties(chosen.ties, chosen.steps, chosen.seconds)
    if chosen.push:
        push(chosen.seconds)
    if chosen.tensions:
        arch(chosen.tensions, chosen.steps, chosen.seconds)
    if chosen.cohesions:
        panel(chosen.cohesions, chosen.steps, chosen.seconds)


if __name__ == "__main__":
    main()
