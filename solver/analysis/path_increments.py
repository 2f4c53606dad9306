"""The increments of a settlement and of a pushover, checked before anything is solved."""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from solver.assembly import MOVING, Assembly, check_blocks
from solver.interfaces import Interfaces
from solver.kinematics import Pose
from solver.loads import ControlDisplacement, Loads, Settlement, checked_loads
from solver.paper_method import linear_program_increments
from solver.path.controls import LINEAR_PROGRAM, Controls, Ending
from solver.path.drivers import ControlledLoad, SupportMotion
from solver.path.local_origin import at_origin, in_global_coordinates, nearer, without_origin
from solver.path.path import Path
from solver.path.state import PathState
from solver.phases import PhaseChange, loads_in, removed_before
from solver.program.model import Model, mean_load
from solver.results.increment import Bonds, Increment, Status
from solver.ties import Tie, TieForces, check_ties
from solver.words import checked

from .increments import Increments
from .limit_load import checked_live, remaining


def settlement_increments(
    assembly: Assembly,
    phases: Sequence[Settlement],
    *,
    interfaces: Interfaces,
    loads: Loads,
    controls: Controls | None = None,
    ties: Sequence[Tie] = (),
    changes: Sequence[PhaseChange] = (),
    resume: PathState | None = None,
    on_step: Callable[[PathState], None] | None = None,
) -> Increments:
    """The increments of :meth:`solver.Structure.settle`, one by one as they are asked for, and then its ending.

    Everything found so far has been given whenever it is interrupted.

    Parameters
    ----------
    resume : PathState, optional
        Of an increment that such a loop has yielded, with the same other arguments: the increments after it follow, bit
        for bit as if the loop had not been interrupted.
    on_step : callable, optional
        Called with the :class:`PathState` after every step within an increment, and with the last one again at every
        step in time in which blocks come to rest or fall.
    """
    controls = checked(Controls() if controls is None else controls, Controls, "controls")
    check_settlement(assembly, phases, controls, changes, ties)
    interfaces.refuse_crushing("a settlement")
    by_program = controls.increments == LINEAR_PROGRAM
    if by_program:
        _refuse_by_program(assembly, interfaces, loads, ties, changes)
    check_ties(ties, assembly, len(phases))
    if resume is not None:
        resume.refuse_other(assembly.n_blocks, len(phases))
    origin = at_origin(assembly)
    near, loads, near_ties = without_origin(origin, assembly, loads, ties)
    local = tuple(nearer(phase, origin) for phase in phases) if origin.any() else tuple(phases)
    if resume is not None and resume.place.s > 0.0 and by_program != (resume.place.contacts is None):
        raise ValueError("the checkpoint is of increments found in another way: it belongs to another run")
    each = (loads_in(loads, changes, number) for number in range(len(local)))
    models = [model_of(near, of_phase, interfaces, controls, ties=near_ties) for of_phase in each]
    if by_program:
        steps = linear_program_increments(models[0], local, resume)
    else:
        steps = _increments(models, local, controls, resume, changes, on_step)
    return Increments(steps, partial(in_global_coordinates, origin=origin) if origin.any() else None)


def _refuse_by_program(
    assembly: Assembly, interfaces: Interfaces, loads: Loads, ties: Sequence[Tie], changes: Sequence[PhaseChange]
) -> None:
    """Refuses what the paper's linear programs do not know."""
    interfaces.refuse_mortar("increments = 'linear program'")
    if ties:
        raise ValueError(f"increments = 'linear program' knows no ties ('{ties[0].name}'); leave increments out")
    if assembly.dimension == 3:
        raise ValueError("increments = 'linear program' is for blocks in the plane; leave it out for blocks in space")
    if loads.fills or changes:
        raise ValueError(
            "increments = 'linear program' knows one structure under loads that stay as they are; leave it out, or "
            "fill and changes between phases"
        )


def _increments(
    models: Sequence[Model],
    phases: Sequence[Settlement],
    controls: Controls,
    resume: PathState | None,
    changes: Sequence[PhaseChange],
    on_step: Callable[[PathState], None] | None,
) -> Generator[Increment, None, Ending]:
    first, assembly = 0 if resume is None else resume.phase, models[0].assembly
    before: PathState | None = None
    for number, phase in enumerate(phases[first:], start=first):
        start = Pose.initial(assembly) if before is None else before.history[0].pose
        start = start if resume is None else resume.start
        # Numbers that pass from phase to phase are in the unit of the first.
        model = replace(models[number], force=models[0].force)
        path = Path(model, SupportMotion(assembly, phase, start), number, controls, on_step)
        begin, now = partial(path.begin, start, before), [change for change in changes if change.phase == number]
        if now or (number and any(tie.phase == number + 1 for tie in model.ties)):
            gone = {name for change in now for name in change.ties}
            begin = partial(path.changed, begin, removed_before(changes, number, assembly.n_blocks), gone)
        ending = yield from path.increments(begin, resume)
        if ending.stop is not Status.LIMIT_REACHED:
            return ending
        resume, before = None, path.state
    return ending


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


def model_of(
    assembly: Assembly,
    loads: Loads,
    interfaces: Interfaces,
    controls: Controls,
    has_live: bool = False,
    ties: tuple[Tie, ...] = (),
) -> Model:
    """The units and loads of a path."""
    force = mean_load(assembly, loads)
    if force == 0.0:
        raise ValueError("no load acts on any free block; give them a weight")
    units, none = (assembly.block_size, force), np.zeros(assembly.n_blocks, dtype=bool)
    factors = {"compliance": controls.compliance_factor, "imperfection": controls.imperfection_factor}
    return Model(assembly, interfaces, loads, *units, none, has_live=has_live, ties=ties, **factors)


def check_settlement(
    assembly: Assembly,
    phases: Sequence[Settlement],
    controls: Controls | None = None,
    changes: Sequence[PhaseChange] = (),
    ties: Sequence[Tie] = (),
) -> None:
    """Refuses what cannot be analysed, before anything is solved or written.

    Raises
    ------
    ValueError
        For no settlement, no free block, a phase that moves no support, none that is still there or a block with
        another role, a change before a phase that does not exist, blocks that overlap (both named, with depth).
    """
    controls = checked(Controls() if controls is None else controls, Controls, "controls")
    if not phases:
        raise ValueError("no settlement was given; give one Settlement, or several phases")
    for number, phase in enumerate(phases):
        phase.check_dimension(assembly)
        which = f"settlement phase {number + 1}" if len(phases) > 1 else "the settlement"
        for name in phase.profile or phase.blocks or ():
            role = assembly.roles[assembly.index(name)]
            if role != MOVING and (phase.profile is None or any(phase.profile[name])):
                raise ValueError(
                    f"{which} moves block '{name}', whose role is '{role}'; give it the role 'moving', or leave it out"
                )
        if not phase.taking_part(assembly).any():
            raise ValueError(
                f"{which} moves no support: give one of the blocks the role 'moving': "
                + ", ".join(f"'{name}'" for name in assembly.names[:6])
            )
    _check_changes(assembly, phases, changes, ties)
    check_blocks(assembly, controls.overlap_tolerance)


def _check_changes(
    assembly: Assembly, phases: Sequence[Settlement], changes: Sequence[PhaseChange], ties: Sequence[Tie]
) -> None:
    """Refuses changes before a phase, or of a tie, that is not there, and those that leave nothing to move."""
    for change in changes:
        if checked(change, PhaseChange, "one of the changes").phase not in range(len(phases)):
            raise ValueError(f"phase of a change is {change.phase}; give a whole number, 0 to {len(phases) - 1}")
        if change.dead is not None:
            beside = (change.dead_arms, None, change.dead_acceleration)
            checked_loads(assembly, Loads(change.dead, change.dead, (), *beside))
        if change.removed is not None:
            assembly.flags(change.removed, "removed")
        for name in change.ties:
            if name not in {tie.name for tie in ties if tie.phase <= change.phase}:
                raise ValueError(
                    f"no tie '{name}' is there to be taken away before settlement phase {change.phase + 1}"
                )
    gone = np.zeros(assembly.n_blocks, dtype=bool)
    for number, phase in enumerate(phases):
        gone |= removed_before(changes, number, assembly.n_blocks)
        if gone.any() and not (phase.taking_part(assembly) & ~gone).any():
            raise ValueError(f"settlement phase {number + 1} moves only supports that have been taken away; keep one")
        if gone.any() and not (assembly.free & ~gone).any():
            raise ValueError(f"before settlement phase {number + 1} all free blocks are taken away; keep one")
