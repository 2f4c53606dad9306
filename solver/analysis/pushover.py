"""The increments of a pushover, checked before anything is solved."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from solver.assembly import Assembly, check_blocks
from solver.interfaces import Interfaces
from solver.kinematics import Pose
from solver.loads import ControlDisplacement, Loads
from solver.path.controls import LINEAR_PROGRAM, Controls
from solver.path.drivers import ControlledLoad
from solver.path.local_origin import at_origin, in_global_coordinates, without_origin
from solver.path.path import Path
from solver.path.state import PathState
from solver.results.increment import Bonds
from solver.ties import Tie, TieForces, check_ties
from solver.words import checked

from .increments import Increments
from .limit_load import checked_live, remaining
from .settlement import model_of


def pushover_increments(
    assembly: Assembly,
    control: ControlDisplacement,
    *,
    loads: Loads,
    interfaces: Interfaces,
    controls: Controls | None = None,
    pose: Pose | None = None,
    ties: Sequence[Tie] = (),
    ties_at: TieForces | None = None,
    bonds_at: Bonds | None = None,
    fallen: np.ndarray | None = None,
    resume: PathState | None = None,
    on_step: Callable[[PathState], None] | None = None,
) -> Increments:
    """The increments of :meth:`solver.Structure.pushover`, one by one as they are asked for, and then its ending.

    ``resume`` and ``on_step`` are those of :func:`settlement_increments`; resumed, ``pose`` is not looked at.
    """
    controls = checked(Controls() if controls is None else controls, Controls, "controls")
    if controls.increments == LINEAR_PROGRAM:
        raise ValueError("increments = 'linear program' is for settlements; leave it out for a pushover")
    checked(control, ControlDisplacement, "control").check_dimension(assembly)
    check_blocks(assembly, controls.overlap_tolerance)
    interfaces.refuse_crushing("a pushover")
    if pose is not None and bonds_at is None:
        interfaces.refuse_pose_alone()
        if any(law.bonds for law in interfaces.laws):
            raise ValueError(
                "joints have cohesion, of which a pose does not tell what is left; give bonds_at, the bonds of the "
                "increment that the pose is from"
            )
    left = remaining(assembly, fallen)
    loads = checked_live(left, loads)
    if not left.free[assembly.index(control.block)]:
        what = "has left the structure" if assembly.free[assembly.index(control.block)] else "is a support"
        raise ValueError(f"control block '{control.block}' {what}; name a free block")
    check_ties(ties, assembly, 0 if ties_at is None else np.inf)
    origin = at_origin(assembly)
    near, loads, ties = without_origin(origin, assembly, loads, ties)
    if origin.any() and control.point is not None:
        control = replace(control, point=(np.asarray(control.point) - origin).tolist())
    start = Pose.initial(near) if pose is None else Pose(checked(pose, Pose, "pose").positions - origin, pose.rotations)
    if resume is not None:
        resume.refuse_other(assembly.n_blocks, 1)
        start = resume.start
    model = model_of(near, loads, interfaces, controls, has_live=True, ties=ties)
    path = Path(model, ControlledLoad(near, control, start), 0, controls, on_step)
    steps = path.increments(partial(path.begin, start, None, ties_at, bonds_at, fallen), resume)
    return Increments(steps, partial(in_global_coordinates, origin=origin) if origin.any() else None)
