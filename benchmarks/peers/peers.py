"""blockvis beside other tools, in one run: the same blocks, the same machine, one table.

    python benchmarks/peers/peers.py [--quick] [--questions 1 2 3] [--seconds 300]

Peers are whatever is installed of compas_cra, compas_lmgc90, mujoco and pymunk; the rest is printed as "not installed":

    python -m venv peers && peers/bin/pip install . compas_cra compas_lmgc90 "mujoco!=4.0.0" pymunk
    peers/bin/python benchmarks/peers/peers.py

(The notes of mujoco 4.0.1 name an error in the sparse solver of 4.0.0.) Seconds are processor time, imports left out;
compare them within one run only. ``--quick`` runs blockvis alone; ``--seconds`` is the processor time after which a run
of a physics engine is given up. Three questions:

1. Spreading supports. A semicircular arch of 12 voussoirs, t/R = 0.15, friction 2: how far can the right support move?
   The reference is exact (three-hinge kinematics with exact thrust lines). Physics engines move the support slowly;
   the arch has fallen once its crown has dropped by half a thickness beyond the kinematic path, and the displacement
   found is where the crown last sank at no more than twice the kinematic rate. What is left of the difference is
   mostly what the support moves while the fall begins: it shrinks with the speed. H/W at the start is read off a
   polynomial through the path, since in an engine the first millimetres depend on how the arch came to rest; the
   largest H/W is a mean over 0.2 s.
2. Equilibrium. Do forces exist that carry the weight? An arch, an arch too thin to stand (below t/R = 0.1075 none
   does), and panels of running bond. Ours answers with a limit load. compas_cra's seconds are without those in which
   its joints are found, which are given beside.
3. Many blocks. The base of a panel of 157, then of 1,004 bricks settles by 10 mm under its right half. There is no
   exact reference: engines slip by Coulomb's law without dilation, and what a wall carries depends on its history; look
   at the seconds.
"""

from __future__ import annotations

import argparse
import os

os.environ["OMP_NUM_THREADS"] = "1"  # before numpy starts its threads, whose waiting would count as work
os.environ["OPENBLAS_NUM_THREADS"] = "1"

import importlib
import importlib.metadata
import math
import platform
import time
from collections.abc import Callable
from itertools import product

import equilibrium_peers
import numpy as np
import physics_engines

import solver
from blockvis import generators

#: Spreading arch of 12 voussoirs: displacement of collapse over R, H/W at the start and at collapse.
COLLAPSE, FIRST, LAST = 0.14104982, 0.1771150, 0.2420193
ARCH_FRICTION = 2.0

#: Time step [s] and speed of the support [m/s] of the runs of an engine; R is 1 m.
RUNS = ((1e-3, 0.01), (1e-3, 0.002), (5e-4, 0.002))

#: The crown falls when it sinks at more than this many times the kinematic rate; displacement given up at [R].
FALLING_RATE, FURTHEST = 2.0, 0.3

#: Bricks along the settling panels, and courses.
PANELS = ((10, 15), (20, 49))

#: Their settlement [m], its speed [m/s] and the engines' time steps [s], between which what they find differs.
SETTLED, SETTLING_SPEED, SETTLING_STEPS = 0.01, 0.01, (1e-3, 2e-4)
PANEL_FRICTION = 0.6

#: Time over which the force at the end is averaged [s].
AVERAGED = 0.1

#: Blocks of a panel have flown apart when one has moved this many times as far as the base.
FLOWN = 20.0

Drive = Callable[..., object]


def row(tool: str, case: str, quantity: str, reference: object, found: object, difference: str, seconds: str) -> None:
    """Prints a line of the table as soon as it is known."""
    print(f"| {tool} | {case} | {quantity} | {reference} | {found} | {difference} | {seconds} |", flush=True)


def compared(found: float, reference: float) -> str:
    return "–" if math.isnan(found) else f"{100.0 * (found / reference - 1.0):+.3f} %"


def loaded(module: str) -> bool:
    """Whether a peer is there; importing it now keeps that out of its seconds."""
    try:
        importlib.import_module(module)
    except ImportError:
        return False
    return True


def installed(names: tuple[str, ...]) -> tuple[list[str], dict[str, Drive]]:
    """The engines, and with ours the tools for equilibrium that are there; prints versions and the table's head."""
    engines: list[str] = []
    tools: dict[str, Drive] = {"blockvis": equilibrium_peers.limit_load}
    for name in names:
        if not loaded(name):
            print(f"{name}: not installed")
            continue
        print(f"{name} {importlib.metadata.version(name)}")
        if name == "compas_cra":
            tools["compas_cra RBE"] = equilibrium_peers.rigid_block_equilibrium
            tools["compas_cra CRA"] = equilibrium_peers.coupled_analysis
        else:
            engines.append(name)
    print(f"blockvis {importlib.metadata.version('blockvis')}, Python {platform.python_version()}\n")
    row("tool", "case", "quantity", "reference", "found", "difference", "seconds")
    row("---", "---", "---", "---", "---", "---", "---")
    return engines, tools


def crown(assembly: solver.Assembly, positions: np.ndarray) -> float:
    """How far the two voussoirs at the crown have sunk [m]."""
    middle = int(assembly.free.sum()) // 2
    keys = [middle - 1, middle]
    return float((assembly.centroids - positions)[keys, 1].mean())


def our_arch(arch: solver.Assembly, increment: float) -> solver.Response:
    """Follows the arch to its collapse and prints what was found."""
    started = time.process_time()
    spread = solver.Settlement(direction=(1, 0), increment=increment, limit=1.0, tolerance=1e-3 * increment)
    controls = solver.Controls(falling_frames=0)
    response = solver.settle(arch, spread, friction_coefficient=ARCH_FRICTION, controls=controls)
    seconds = time.process_time() - started
    if response.collapse is None:
        raise SystemExit(f"the arch did not collapse: {response.message}")
    found = response.collapse.displacement
    setting = f"arch, increments of {increment:g} R"
    row("blockvis", setting, "d_c/R", COLLAPSE, f"{found:.6f}", compared(found, COLLAPSE), f"{seconds:.2f}")
    return response


def our_forces(response: solver.Response) -> None:
    thrust = response.reaction / response.total_weight
    first = response.initial_reaction / response.total_weight
    row("blockvis", "the same run", "H/W start", FIRST, f"{first:.6f}", compared(first, FIRST), "")
    row("blockvis", "the same run", "H/W largest", LAST, f"{max(thrust):.6f}", compared(max(thrust), LAST), "")


def engine_arch(name: str, response: solver.Response, time_step: float, speed: float, budget: float) -> None:
    """Pushes the support of the arch in a physics engine until it falls, and prints what was found."""
    arch, weight = response.assembly, response.total_weight
    kinematic = np.array([[inc.settlement, crown(arch, inc.pose.positions)] for inc in response.path])
    slope = float(np.diff(kinematic[-4::3, 1])[0] / np.diff(kinematic[-4::3, 0])[0])
    thickness = float(arch.widths[arch.free].min())
    samples, spent, fallen = [], 0.0, False
    path = physics_engines.in_a_process(
        name, arch, physics_engines.Drive((1.0, 0.0), speed), time_step, ARCH_FRICTION, budget=budget
    )
    for so_far, sample in path:
        spent = so_far
        d, sunk = sample.displacement, crown(arch, sample.positions)
        beyond = max(0.0, d - kinematic[-1, 0])
        on_path = float(np.interp(d, *kinematic.T)) + slope * beyond
        fallen = sunk - on_path > thickness / 2.0
        if sample.time > 0.0:
            samples.append((d, sunk, sample.force[0] / weight))
        if fallen or d > FURTHEST:
            break
    path.close()
    seconds = f"{spent:.1f}"
    setting = f"arch, steps of {1e3 * time_step:g} ms, {1e3 * speed:g} mm/s"
    if not fallen:
        reached = f"given up at {samples[-1][0]:.4f}" if samples else "nothing"
        row(name, setting, "d_c/R", COLLAPSE, reached, "–", seconds)
        return
    d, sunk, thrust = np.array(samples).T
    window = 10
    rate = (sunk[window:] - sunk[:-window]) / (d[window:] - d[:-window])
    last = int(np.flatnonzero(rate <= FALLING_RATE * slope)[-1])
    found = float(d[last : last + window + 1].mean())
    row(name, setting, "d_c/R", COLLAPSE, f"{found:.5f}", compared(found, COLLAPSE), seconds)
    if (time_step, speed) == RUNS[-1]:
        seen = (d > 0.005) & (d < 0.12)
        first = float(np.polynomial.Polynomial.fit(d[seen], thrust[seen], 5)(0.0))
        largest = float(np.convolve(thrust[2 * window :], np.full(20, 0.05), "valid").max())
        row(name, "the same run", "H/W start", FIRST, f"{first:.5f}", compared(first, FIRST), "")
        row(name, "the same run", "H/W largest", LAST, f"{largest:.5f}", compared(largest, LAST), "")


def spreading_arch(engines: list[str], budget: float) -> None:
    """Spreads the supports of the arch with every tool."""
    arch = generators.arch(voussoirs=12, thickness_ratio=0.15)
    _, fine = (our_arch(arch, increment) for increment in (0.02, 0.01))
    our_forces(fine)
    for name in engines:
        for time_step, speed in RUNS:
            engine_arch(name, fine, time_step, speed, budget)


def equilibrium(tools: dict[str, Drive], quick: bool) -> None:
    """Asks every tool whether a structure carries its own weight."""
    panel = generators.panel
    cases = [
        ("arch, t/R 0.15", generators.arch(), ARCH_FRICTION, True),
        ("arch, t/R 0.10", generators.arch(thickness_ratio=0.10), ARCH_FRICTION, False),
        ("panel", panel(nb=5, nc=6), PANEL_FRICTION, True),
    ]
    if not quick:
        cases.append(("panel", panel(nb=8, nc=9), PANEL_FRICTION, True))
    for ask in tools.values():
        ask(generators.arch(), ARCH_FRICTION)  # what is imported and compiled once
    for name, assembly, friction, stands in cases:
        for tool, ask in tools.items():
            verdict = ask(assembly, friction)
            expected, found = ("exists" if yes else "none" for yes in (stands, verdict.stands))
            if not math.isnan(verdict.residual) and verdict.stands:
                found += f", residual {verdict.residual:.0e} W"
            case = f"{name}, {int(assembly.free.sum())} blocks"
            right = "right" if verdict.stands == stands else "WRONG"
            note = f" ({verdict.note})" if verdict.note else ""
            row(tool, case, "equilibrium", expected, found + note, right, f"{verdict.seconds:.3f}")


def settling_panel(bricks: int, courses: int, engines: list[str], budget: float) -> None:
    """The base of a panel settles under its right half."""
    assembly = generators.panel(nb=bricks, nc=courses, x_s=0.1 * bricks, block_height=0.1)
    case = f"panel, {int(assembly.free.sum())} blocks, {1e3 * SETTLED:g} mm"
    quantity = "reaction/W"
    controls = solver.Controls(falling_frames=0)
    sink = solver.Settlement(direction=(0, -1), increment=SETTLED / 4, limit=SETTLED)
    started = time.process_time()
    response = solver.settle(assembly, sink, friction_coefficient=PANEL_FRICTION, controls=controls)
    seconds = time.process_time() - started
    weight = response.total_weight
    row("blockvis", case, quantity, "–", f"{response.reaction[-1] / weight:.4f}", "–", f"{seconds:.1f}")
    for name, time_step in product(engines, SETTLING_STEPS):
        spent, last, farthest, forces = 0.0, -math.inf, 0.0, []
        path = physics_engines.in_a_process(
            name,
            assembly,
            physics_engines.Drive((0.0, -1.0), SETTLING_SPEED),
            time_step,
            PANEL_FRICTION,
            budget=budget,
            sampling=time_step,
        )
        for so_far, sample in path:
            spent = so_far
            last = sample.time
            forces.append(-sample.force[1] / weight)
            farthest = float(np.abs(sample.positions - assembly.centroids).max())
            if sample.displacement >= SETTLED * (1.0 - 1e-6) or farthest > FLOWN * SETTLED:
                break
        path.close()
        length = SETTLED / SETTLING_SPEED
        found = "given up in the first step"
        if forces:
            found = f"{np.mean(forces[-round(AVERAGED / time_step) :]):.4f}"
            if farthest > FLOWN * SETTLED:
                found = f"blocks flew apart {last + physics_engines.REST:.3f} s after the start"
            elif last < length - time_step:
                found = f"given up after {last + physics_engines.REST:.3f} of {length + physics_engines.REST:g} s"
        with_steps = f"{case}, steps of {1e3 * time_step:g} ms"
        row(name, with_steps, quantity, "–", found, "–", f"{spent:.1f}" if forces else f"> {budget:g}")


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--quick", action="store_true", help="blockvis alone, in seconds")
    options.add_argument("--questions", type=int, nargs="+", choices=(1, 2, 3), default=(1, 2, 3))
    options.add_argument("--seconds", type=float, default=300.0, help="processor time given to a run of an engine")
    given = options.parse_args()
    engines, tools = installed(() if given.quick else (*physics_engines.ENGINES, "compas_cra"))
    if 1 in given.questions:
        spreading_arch(engines, given.seconds)
    if 2 in given.questions:
        equilibrium(tools, given.quick)
    if 3 in given.questions and not given.quick:
        for bricks, courses in PANELS:
            settling_panel(bricks, courses, engines, given.seconds)


if __name__ == "__main__":
    main()
