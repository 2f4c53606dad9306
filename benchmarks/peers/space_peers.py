"""Blocks in space beside other tools, in one run: the same stones, the same machine, one table.

    python benchmarks/peers/space_peers.py [--quick] [--questions 1 2 3] [--seconds 300] [--speeds 0.02]

Peers are whatever is installed of compas_cra, compas_lmgc90 and mujoco, as for ``peers.py``; seconds are processor
time.

1. Equilibrium. Do forces exist that carry the weight? Extruded arches, thick and too thin to stand, domes, likewise
   (a hemispherical dome thinner than 0.042 R has none), a corner of walls, a cross vault with stones that are not
   convex. Ours answers with a limit load. compas_cra's seconds are without those in which its joints are found, which
   are given beside.
2. Spreading supports of a dome of 8 lunes of 6 stones under a cap, t/R = 0.12, friction 0.7. The reference is exact:
   each lune is an arch. Engines move the supports slowly; the dome has fallen once its cap has dropped by half a
   thickness beyond the kinematic path, and the displacement found is where it last sank at no more than twice the
   kinematic rate. The first thrust is read off a polynomial through the path.
3. A corner of walls of 16 bricks of which one support sinks, friction 0.6. There is no exact reference: engines slip
   without lift, as ours does, and where joints slide the path depends on its history.
"""

from __future__ import annotations

import argparse
import os

os.environ["OMP_NUM_THREADS"] = "1"  # before numpy starts its threads, whose waiting would count as work
os.environ["OPENBLAS_NUM_THREADS"] = "1"

import math
import multiprocessing
import multiprocessing.connection
import time

import equilibrium_peers
import numpy as np
import physics_engines
from peers import FALLING_RATE, Drive, compared, installed, row

import solver
from blockvis import generators

#: Dome of 8 lunes: displacement of collapse over R, thrust over the weight at the start and at collapse.
COLLAPSE, FIRST, LAST = 0.1721334, 0.1661226, 0.369815
DOME_FRICTION, WALL_FRICTION = 0.7, 0.6

#: Time step of the engines [s], and speeds of the supports [m/s].
TIME_STEP, SPEEDS = 1e-3, (0.02, 0.005)

#: Settlements at which the corner is looked at [m], and how fast it gets there in engines [m/s].
LOOKS, SINKING_SPEED = (0.02, 0.06, 0.1), 0.01


def dome(thickness_ratio: float) -> solver.Assembly:
    return generators.dome(lunes=8, courses=6, thickness_ratio=thickness_ratio, cap=15.0)


def corner() -> solver.Assembly:
    return generators.l_corner(bricks=2, across=2, courses=4)


def _answer(
    pipe: multiprocessing.connection.Connection, ask: Drive, assembly: solver.Assembly, friction: float
) -> None:
    ask(corner(), WALL_FRICTION)  # what is imported and compiled once
    pipe.send(None)
    pipe.send(ask(assembly, friction))


def asked(ask: Drive, assembly: solver.Assembly, friction: float, budget: float) -> equilibrium_peers.Verdict | None:
    """What a tool says, in a process of its own; None after a budget of time [s], or where it ends without a word."""
    context = multiprocessing.get_context("spawn")
    here, there = context.Pipe(duplex=False)
    child = context.Process(target=_answer, args=(there, ask, assembly, friction), daemon=True)
    child.start()
    there.close()
    try:
        if not here.poll(120.0 + budget):
            return None
        here.recv()
        return here.recv() if here.poll(budget) else None
    except EOFError:
        return None
    finally:
        child.terminate()
        child.join()


def equilibrium(tools: dict[str, Drive], budget: float) -> None:
    """Asks every tool whether a structure carries its own weight."""
    cases = [
        ("extruded arch, t/R 0.15", generators.extruded_arch(voussoirs=12), 2.0, True),
        ("extruded arch, t/R 0.10", generators.extruded_arch(voussoirs=12, thickness_ratio=0.10), 2.0, False),
        ("dome, t/R 0.12", dome(0.12), DOME_FRICTION, True),
        ("dome, t/R 0.03", dome(0.03), DOME_FRICTION, False),
        ("corner of walls", corner(), WALL_FRICTION, True),
        ("cross vault", generators.cross_vault(voussoirs=5), DOME_FRICTION, True),
        ("corner of walls", generators.l_corner(), WALL_FRICTION, True),
    ]
    for name, assembly, friction, stands in cases:
        for tool, ask in tools.items():
            verdict, case = asked(ask, assembly, friction, budget), f"{name}, {int(assembly.free.sum())} blocks"
            if verdict is None:
                expected = "exists" if stands else "none"
                row(tool, case, "equilibrium", expected, "no answer", "–", f"> {budget:g}, or ended")
                continue
            expected, found = ("exists" if yes else "none" for yes in (stands, verdict.stands))
            if not math.isnan(verdict.residual) and verdict.stands:
                found += f", residual {verdict.residual:.0e} W"
            note = f" ({verdict.note})" if verdict.note else ""
            right = "right" if verdict.stands == stands else "WRONG"
            row(tool, case, "equilibrium", expected, found + note, right, f"{verdict.seconds:.3f}")


def spreading_dome(engines: list[str], speeds: list[float], budget: float) -> None:
    """Spreads the supports of the dome with every tool."""
    stones, radial = dome(0.12), {"radial_from": (0.0, 0.0)}
    started = time.process_time()
    spread = solver.Settlement(**radial, increment=0.04, limit=0.5, tolerance=2e-5)
    response = solver.settle(
        stones, spread, friction_coefficient=DOME_FRICTION, controls=solver.Controls(falling_frames=0)
    )
    seconds, weight = time.process_time() - started, response.total_weight
    assert response.collapse is not None, response.message
    found = response.collapse.displacement
    row("blockvis", "dome", "d_c/R", COLLAPSE, f"{found:.6f}", compared(found, COLLAPSE), f"{seconds:.1f}")
    for what, reference, value in (
        ("H/W start", FIRST, response.initial_reaction / weight),
        ("H/W largest", LAST, max(response.reaction) / weight),
    ):
        row("blockvis", "the same run", what, reference, f"{value:.6f}", compared(value, reference), "")
    cap = int(stones.centroids[:, 2].argmax())
    kinematic = np.array([[i.parameter, stones.centroids[cap, 2] - i.pose.positions[cap, 2]] for i in response.path])
    slope = float(np.diff(kinematic[-3:, 1])[0] / np.diff(kinematic[-3:, 0])[0])
    ways = spread.rate(stones, solver.Pose.initial(stones), 0.0)[:, :3]
    for name in engines:
        for speed in speeds:
            samples, spent, fallen = [], 0.0, False
            path = physics_engines.in_a_process(
                name, stones, physics_engines.Drive(ways, speed), TIME_STEP, DOME_FRICTION, budget=budget
            )
            for so_far, sample in path:
                spent, d = so_far, sample.displacement
                sunk = stones.centroids[cap, 2] - float(sample.positions[cap, 2])
                on_path = float(np.interp(d, *kinematic.T)) + slope * max(0.0, d - kinematic[-1, 0])
                if sample.time > 0.0:
                    samples.append((d, sunk, float(sample.force[0]) / weight))
                fallen = sunk - on_path > 0.06
                if fallen or d > 0.4:
                    break
            path.close()
            setting = f"dome, steps of {1e3 * TIME_STEP:g} ms, {1e3 * speed:g} mm/s"
            if not fallen:
                reached = f"given up at {samples[-1][0]:.4f}" if samples else "nothing"
                row(name, setting, "d_c/R", COLLAPSE, reached, "–", f"{spent:.1f}")
            d, sunk, thrust = np.array(samples).T
            if fallen:
                window = 10
                rate = (sunk[window:] - sunk[:-window]) / (d[window:] - d[:-window])
                last = int(np.flatnonzero(rate <= FALLING_RATE * slope)[-1])
                found = float(d[last : last + window + 1].mean())
                row(name, setting, "d_c/R", COLLAPSE, f"{found:.5f}", compared(found, COLLAPSE), f"{spent:.1f}")
            seen = (d > 0.005) & (d < 0.14)
            first = float(np.polynomial.Polynomial.fit(d[seen], thrust[seen], 5)(0.0)) if seen.sum() > 20 else math.nan
            row(name, "the same run", "H/W start", FIRST, f"{first:.5f}", compared(first, FIRST), "")


def sinking_corner(engines: list[str], budget: float) -> None:
    """One support of the corner sinks; what it carries on the way."""
    walls = corner()
    started = time.process_time()
    sink = solver.Settlement(direction=(0, 0, -1), increment=0.02, limit=max(LOOKS))
    response = solver.settle(
        walls, sink, friction_coefficient=WALL_FRICTION, controls=solver.Controls(falling_frames=0)
    )
    seconds, weight = time.process_time() - started, response.total_weight
    parameter = np.array([i.parameter for i in response.path])
    found = ", ".join(f"{np.interp(look, parameter, response.reaction) / weight:.4f}" for look in LOOKS)
    looked = "R/W at " + ", ".join(f"{1e3 * look:g}" for look in LOOKS) + " mm"
    case = f"corner of walls, {int(walls.free.sum())} blocks"
    row("blockvis", case, looked, "–", found, "–", f"{seconds:.1f}")
    ways = sink.rate(walls, solver.Pose.initial(walls), 0.0)[:, :3]
    for name in engines:
        samples, spent = [], 0.0
        path = physics_engines.in_a_process(
            name, walls, physics_engines.Drive(ways, SINKING_SPEED), TIME_STEP, WALL_FRICTION, budget=budget
        )
        for so_far, sample in path:
            spent = so_far
            samples.append((sample.displacement, float(sample.force[0]) / weight))
            if sample.displacement > max(LOOKS):
                break
        path.close()
        if not samples:
            row(name, case, looked, "–", "nothing: it ended its process", "–", f"{spent:.1f}")
            continue
        d, carried = np.array(samples).T
        near = [carried[np.abs(d - look) < 2e-3] for look in LOOKS]
        found = ", ".join(f"{values.mean():.4f}" if len(values) else "–" for values in near)
        row(name, case, looked, "–", found, "–", f"{spent:.1f}")


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--quick", action="store_true", help="blockvis alone")
    options.add_argument("--questions", type=int, nargs="+", choices=(1, 2, 3), default=(1, 2, 3))
    options.add_argument("--seconds", type=float, default=300.0, help="processor time given to a run of an engine")
    options.add_argument("--speeds", type=float, nargs="+", default=list(SPEEDS), help="of the dome's supports [m/s]")
    given = options.parse_args()
    engines, tools = installed(() if given.quick else (*physics_engines.IN_SPACE, "compas_cra"))
    if 1 in given.questions:
        equilibrium(tools, given.seconds)
    if 2 in given.questions:
        spreading_dome(engines, given.speeds, given.seconds)
    if 3 in given.questions:
        sinking_corner(engines, given.seconds)


if __name__ == "__main__":
    main()
