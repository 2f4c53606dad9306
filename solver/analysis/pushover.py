"""Pushover: the load multiplier against a control displacement, with large displacements, to its end."""

from __future__ import annotations

from collections.abc import Callable, Generator

from solver.assembly import Assembly, check_blocks
from solver.interfaces import InterfaceLaw, Interfaces
from solver.kinematics import Pose
from solver.loads import Loads
from solver.path.controls import LINEAR_PROGRAM, Controls, Ending
from solver.path.drivers import ControlDisplacement, ControlledLoad
from solver.path.path import Path
from solver.path.state import PathState
from solver.programs.problem import SolveError
from solver.results.increment import Increment, Status
from solver.results.quantities import CONTROL_DISPLACEMENT, LOAD_MULTIPLIER
from solver.results.response import Response

from .limit_load import checked_live
from .settlement import drained, model_of, timed


def pushover(
    assembly: Assembly,
    control: ControlDisplacement,
    *,
    loads: Loads,
    friction_coefficient: float = 0.6,
    interfaces: Interfaces | None = None,
    controls: Controls | None = None,
    pose: Pose | None = None,
    on_increment: Callable[[Increment], None] | None = None,
) -> Response:
    """Follows a structure under growing displacement from its limit load down to where it carries none.

    Parameters
    ----------
    assembly : Assembly
        Fixed and moving supports both stand still.
    control : ControlDisplacement
    loads : Loads
        Dead loads, and the live loads that the multiplier scales.
    friction_coefficient : float
        Of every interface, where ``interfaces`` is not given.
    interfaces : Interfaces, optional
    controls : Controls, optional
    pose : Pose, optional
        Where to start, for instance after a settlement; the drawing by default. Displacements count from there.
    on_increment : callable, optional
        Called with every :class:`Increment` as it is found.

    Returns
    -------
    Response
        ``settlement`` is the control displacement [m], ``load_multiplier`` is α and ``reaction`` the resultant of the
        live loads, α times its value at 1 [N]. The first increment has the limit load of the undeformed structure. The
        collapse is where α reaches zero, ``lost`` "capacity": beyond, the structure falls under its dead load alone; or
        where no equilibrium follows along the control at some α, ``lost`` "equilibrium".

    Raises
    ------
    ValueError
        For input that cannot be analysed: no live load, a control block that is a support, overlapping blocks.

    Notes
    -----
    The path is that of a settlement, see :mod:`solver.path.path`, with the multiplier as one more unknown and the
    control displacement as one more equation.
    """
    interfaces = interfaces or Interfaces(InterfaceLaw(friction_coefficient))
    steps = pushover_increments(assembly, control, loads=loads, interfaces=interfaces, controls=controls, pose=pose)
    increments, ending = drained(steps, on_increment)
    return Response(
        assembly=assembly,
        settlements=(),
        parameter=CONTROL_DISPLACEMENT,
        measured=LOAD_MULTIPLIER,
        control=control,
        interfaces=interfaces,
        loads=loads,
        increments=increments,
        stop=ending.stop,
        message=ending.message,
        collapse=ending.collapse,
        analysis="pushover",
    )


def pushover_increments(
    assembly: Assembly,
    control: ControlDisplacement,
    *,
    loads: Loads,
    interfaces: Interfaces,
    controls: Controls | None = None,
    pose: Pose | None = None,
    resume: PathState | None = None,
    on_step: Callable[[PathState], None] | None = None,
) -> Generator[Increment, None, Ending]:
    """The increment loop of :func:`pushover` as a generator: yields each Increment, returns the Ending.

    Parameters are those of :func:`pushover`.

    Parameters
    ----------
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
    interfaces.refuse_strength("a pushover")
    loads = checked_live(assembly, loads)
    if not assembly.free[assembly.index(control.block)]:
        raise ValueError(f"control block '{control.block}' is a support; name a free block")
    if resume is not None and len(resume.place.pose.rotations) != assembly.n_blocks:
        raise ValueError(
            f"the checkpoint has {len(resume.place.pose.rotations)} blocks, the assembly {assembly.n_blocks}: it "
            "belongs to another run"
        )
    return (yield from timed(_increments(assembly, control, loads, interfaces, controls, pose, resume, on_step)))


def _increments(
    assembly: Assembly,
    control: ControlDisplacement,
    loads: Loads,
    interfaces: Interfaces,
    controls: Controls,
    pose: Pose | None,
    resume: PathState | None,
    on_step: Callable[[PathState], None] | None,
) -> Generator[Increment, None, Ending]:
    start = Pose.initial(assembly) if pose is None else pose
    if resume is not None:
        start = resume.start
    model = model_of(assembly, loads, interfaces, controls, loads.live)
    path = Path(model, ControlledLoad(assembly, control, start), 0, controls, on_step)
    at = 0.0
    try:
        state = path.begin(start) if resume is None else resume
        at = state.place.s
        return (yield from path.follow(state, resume is not None))
    except SolveError as error:
        return Ending(Status.SOLVER_FAILED, f"at a control displacement of {at:.6g} m: {error}")
