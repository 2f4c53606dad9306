"""The increments of a pushover, checked before anything is solved."""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence

from solver.assembly import Assembly, check_blocks
from solver.interfaces import Interfaces
from solver.kinematics import Pose
from solver.loads import Loads
from solver.path.controls import LINEAR_PROGRAM, Controls, Ending
from solver.path.drivers import ControlDisplacement, ControlledLoad
from solver.path.path import Path
from solver.path.state import PathState
from solver.programs.problem import SolveError
from solver.results.increment import Bonds, Increment, Status
from solver.ties import Tie, TieForces, check_ties
from solver.words import counted

from .increments import Increments, TimedIncrements
from .limit_load import checked_live
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
    resume: PathState | None = None,
    on_step: Callable[[PathState], None] | None = None,
) -> Increments:
    """The increments of :meth:`solver.Structure.pushover`, one by one as they are asked for, and then its ending.

    Parameters
    ----------
    ties_at : TieForces, optional
        Of the increment that the pose is from; new ones by default.
    bonds_at : Bonds, optional
        Of that increment: the strength that joints have left; joints that have some need it.
    resume : PathState, optional
        Of an increment that such a loop has yielded, with the same other arguments: the increments after it follow, bit
        for bit as if the loop had not been interrupted. ``pose`` is not looked at then.
    on_step : callable, optional
        Called with the :class:`PathState` after every step within an increment.
    """
    controls = controls or Controls()
    if controls.increments == LINEAR_PROGRAM:
        raise ValueError("increments = 'linear program' is for settlements; leave it out for a pushover")
    control.check_dimension(assembly)
    check_blocks(assembly, controls.overlap_tolerance)
    interfaces.refuse_crushing("a pushover")
    if pose is not None and bonds_at is None:
        interfaces.refuse_pose_alone()
        if any(law.bonds for law in interfaces.laws):
            raise ValueError(
                "joints have cohesion, of which a pose does not tell what is left; give bonds_at, the bonds of the "
                "increment that the pose is from"
            )
    loads = checked_live(assembly, loads)
    if not assembly.free[assembly.index(control.block)]:
        raise ValueError(f"control block '{control.block}' is a support; name a free block")
    if resume is not None and len(resume.place.pose.rotations) != assembly.n_blocks:
        raise ValueError(
            f"the checkpoint has {counted(len(resume.place.pose.rotations), 'block')}, the assembly "
            f"{assembly.n_blocks}: it belongs to another run"
        )
    check_ties(ties, assembly, max([1, *(tie.phase for tie in ties)]))
    model = model_of(assembly, loads, interfaces, controls, loads.live, tuple(ties))
    start = Pose.initial(assembly) if pose is None else pose
    if resume is not None:
        start = resume.start
    path = Path(model, ControlledLoad(assembly, control, start), 0, controls, on_step)
    return TimedIncrements(_increments(path, start, ties_at, bonds_at, resume))


def _increments(
    path: Path, start: Pose, ties_at: TieForces | None, bonds_at: Bonds | None, resume: PathState | None
) -> Generator[Increment, None, Ending]:
    at = 0.0
    try:
        state = path.begin(start, ties_at=ties_at, bonds_at=bonds_at) if resume is None else resume
        at = state.place.s
        return (yield from path.follow(state, resume is not None))
    except SolveError as error:
        return Ending(Status.SOLVER_FAILED, f"at a control displacement of {at:.6g} m: {error}")
