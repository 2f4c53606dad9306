"""Settlements and pushovers along the path of Coulomb friction: where it starts, and how phases follow each other."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import replace

import numpy as np

from solver.assembly import Assembly
from solver.interfaces import Interfaces
from solver.kinematics import Pose
from solver.loads import Loads, Settlement
from solver.lp.problem import SolveError
from solver.program.coulomb import NotSolved
from solver.program.model import Model
from solver.results.increment import Increment, Status

from .controls import Controls, Ending
from .drivers import ControlDisplacement, ControlledLoad, SupportMotion
from .path import Falls, Path, Place


def settlement_path(
    assembly: Assembly, phases: Sequence[Settlement], interfaces: Interfaces, loads: Loads, controls: Controls
) -> Generator[Increment, None, Ending]:
    """Yield the increments of settlements one after another; joints remember what they carried."""
    place: Place | None = None
    ending = Ending(Status.LIMIT_REACHED, "the settlement has reached its limit")
    for number, phase in enumerate(phases):
        start = Pose.initial(assembly) if place is None else place.pose
        path = Path(_model(assembly, loads, interfaces), SupportMotion(assembly, phase, start), number)
        path.falling_frames = controls.falling_frames
        try:
            place = _rested(path, start) if place is None else place
            ending = yield from _without_checkpoints(path.follow(replace(place, s=0.0)))
        except SolveError as error:
            return Ending(Status.SOLVER_FAILED, f"at a settlement of {path.last.s:.6g} {phase.unit}: {error}")
        if ending.stop is not Status.LIMIT_REACHED:
            return ending
        place = path.last
    return ending


def pushover_path(
    assembly: Assembly,
    control: ControlDisplacement,
    loads: Loads,
    interfaces: Interfaces,
    controls: Controls,
    pose: Pose | None,
) -> Generator[Increment, None, Ending]:
    """Yield the increments of a pushover, from a pose or the drawing."""
    start = Pose.initial(assembly) if pose is None else pose
    model = _model(assembly, loads, interfaces, loads.live)
    path = Path(model, ControlledLoad(assembly, control, start), 0, controls.falling_frames)
    try:
        return (yield from _without_checkpoints(path.follow(_rested(path, start))))
    except SolveError as error:
        return Ending(Status.SOLVER_FAILED, f"at a control displacement of {path.last.s:.6g} m: {error}")


def _rested(path: Path, pose: Pose) -> Place:
    """Bring a pose to rest; one that does not hold by itself stays as it is, and the path says so."""
    path.last = path.at_start(pose)
    try:
        return path.rested(pose)
    except (NotSolved, Falls):
        return path.last


def _without_checkpoints(steps: Generator[Increment, None, Ending]) -> Generator[Increment, None, Ending]:
    """Take off what only the path itself could go on from."""
    while True:
        try:
            increment = next(steps)
        except StopIteration as stop:
            ending: Ending = stop.value
            return ending
        yield replace(increment, checkpoint=None)


def _model(assembly: Assembly, loads: Loads, interfaces: Interfaces, live: np.ndarray | None = None) -> Model:
    """The units and loads of a path."""
    force = float(np.hypot(*loads.dead[assembly.free, :2].T).mean())
    if force == 0.0:
        raise ValueError("no load acts on any free block; give them a weight")
    length = assembly.block_size
    return Model(assembly, interfaces, loads.dead, length, force, length, length / 4.0, live=live)
