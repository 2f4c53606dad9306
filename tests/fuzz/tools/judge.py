"""One random structure through the solver and before the oracle: what came out, and whether it is true."""

from __future__ import annotations

import signal
import time
import traceback
from collections import deque
from dataclasses import dataclass, field

import numpy as np
from oracle import GRAVITY, Touching, judged, moved_on, support_velocities, touching
from rubble import Trial, trial

import solver
from solver import mechanics

#: Distance at which corners touch, in block sizes: above what the solver leaves open, below every real gap.
NEAR = 1e-5

#: Distance up to which a corner outside, or beyond the end of an edge, touches where a collapse is judged, in block
#: sizes: what has just slipped off an edge falls, and it is enclosed in steps that leave no more.
APART_AT_COLLAPSE = 1e-7

#: Part of an increment's movement that may stay open at a joint that carries force: twice what the solver aims at.
LEFT = 0.02

#: Work that gravity does for nothing, over the weight: above it blocks fall, below it they stand; between, the two
#: programs may differ by their tolerances.
STANDS, FALLS = 1e-9, 1e-6

#: Difference of reactions, over the weight, that is no difference: at the start, where the drawing is exact, and later,
#: where gaps that an increment has left enter.
SAME, SAME_LATER = 1e-5, 1e-3

#: Reaction that drives supports on, over the weight: beyond it blocks are wedged for all that matters.
LOCKED = 1e3

#: Seconds of processor time after which a trial counts as hanging.
LONGEST = 240


@dataclass
class Finding:
    """What became of a trial.

    Attributes
    ----------
    outcome : str
        How the solver ended, or "refused", "traceback", "hang".
    wrong : list of str
        What the oracle contradicts.
    checks : dict of str to int
        How often each kind of check was made.
    """

    kind: str
    seed: int
    outcome: str = ""
    message: str = ""
    wrong: list[str] = field(default_factory=list)
    checks: dict[str, int] = field(default_factory=dict)
    seconds: float = 0.0
    increments: int = 0
    blocks: int = 0

    def counted(self, what: str) -> None:
        """Counts a check."""
        self.checks[what] = self.checks.get(what, 0) + 1


class _TooLong(BaseException):
    pass


def tried(kind: str, seed: int) -> Finding:
    """Runs one trial and judges it; never raises."""
    finding = Finding(kind, seed)

    def stop(*_: object) -> None:
        raise _TooLong

    started = time.process_time()
    signal.signal(signal.SIGPROF, stop)
    signal.setitimer(signal.ITIMER_PROF, LONGEST)
    try:
        _try(trial(kind, seed), finding)
    except _TooLong:
        finding.outcome = "hang"
        finding.wrong.append(f"not done after {LONGEST} s")
    except ArithmeticError as error:
        finding.counted(f"not judged: {error}")
    except Exception:
        finding.outcome = "traceback"
        finding.wrong.append(traceback.format_exc())
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
    finding.seconds = time.process_time() - started
    return finding


def _try(given: Trial, finding: Finding) -> None:
    assembly, settlement = given.assembly, given.settlement
    finding.blocks = assembly.n_blocks
    try:
        response = solver.settle(
            assembly,
            settlement,
            friction_coefficient=given.friction,
            controls=solver.Controls(falling_frames=1),
        )
    except ValueError as error:
        finding.outcome, finding.message = "refused", str(error)
        return
    finding.outcome, finding.message = str(response.stop), response.message
    finding.increments = len(response.path)
    _judge(given, response, finding)


def _judge(given: Trial, response: solver.Response, finding: Finding) -> None:
    assembly = given.assembly
    drawn = _rings(assembly, solver.Pose.initial(assembly))
    weights = assembly.masses * GRAVITY
    near = NEAR * assembly.block_size + 8 * np.spacing(np.abs(assembly.vertices).max())
    loose, tight = (
        judged(drawn, assembly.free, weights, touching(drawn, assembly.free, near, generous=g), given.friction)
        for g in (True, False)
    )
    failed = response.stop is solver.Status.SOLVER_FAILED and not response.path
    # A chip that weighs less than rounding of the whole may fall.
    lightest = float(weights[assembly.free].min()) / float(weights[assembly.free].sum())
    if not failed:
        nothing = response.stop is solver.Status.NO_INITIAL_EQUILIBRIUM
        if loose.falls > FALLS:
            finding.counted("no equilibrium at the start")
            came_to_rest = response.path and np.abs(response.path[0].pose.displacements(assembly)[:, :2]).max()
            if not nothing and came_to_rest > 0.002 * assembly.block_size:
                # The blocks found an equilibrium a little further, and blockvis run says so.
                finding.counted("fell to an equilibrium less than half a block away")
            elif not nothing:
                finding.wrong.append(f"stands at the start, but falls by the oracle ({loose.falls:.2e})")
        elif tight.falls < min(STANDS, 0.01 * lightest):
            finding.counted("equilibrium at the start")
            if nothing:
                finding.wrong.append(f"falls at the start, but stands by the oracle ({tight.falls:.2e})")
        else:
            finding.counted("start not decided by the oracle")
    # Forces of a locked state, or of one from where the solver failed, may be those of the supports at rest.
    told = len(response.path) - (response.stop in (solver.Status.LOCKED, solver.Status.SOLVER_FAILED))
    chosen = {0, told // 2, told - 1} if told > 0 else set()
    if response.stop is solver.Status.LOCKED:
        _judge_locked(given, response, weights, finding)
    for k in sorted(chosen):
        try:
            _judge_increment(given, response.path, k, weights, finding)
        except ArithmeticError as error:
            finding.counted(f"increment not judged: {error}")
    if response.stop is solver.Status.COLLAPSED:
        _judge_collapse(given, response, weights, finding)


def _judge_increment(
    given: Trial, path: tuple[solver.Increment, ...], k: int, weights: np.ndarray, finding: Finding
) -> None:
    assembly, settlement, increment = given.assembly, given.settlement, path[k]
    rings = _rings(assembly, increment.pose)
    total = float(weights[assembly.free].sum())
    length = assembly.block_size
    near = _near(assembly, path, k)
    if not _judge_forces(given, increment, k, near, weights, finding):
        finding.counted("later increment with a force across an open gap: not judged")
        return
    if increment.fallen.any():
        finding.counted("bounds without blocks that have left: not judged")
        return
    start = _rings(assembly, solver.Pose.initial(assembly))
    velocity = support_velocities(
        start if settlement.unit == "m" else rings,
        assembly.moving,
        settlement.direction,
        settlement.rotation_centre,
        settlement.rotation,
    )
    arm = max(float(np.hypot(*velocity[assembly.moving, :2].T).max()), 1e-300)
    same = (SAME if k == 0 else SAME_LATER) * total * max(arm, length if settlement.unit == "rad" else 0.0)
    values = []
    for gap in (1e-8 * length, 1e-6 * length, NEAR * length, near / 4, near):
        closed = increment.contacts.gaps <= gap
        own = Touching(
            increment.contacts.block_a[closed],
            increment.contacts.block_b[closed],
            increment.contacts.points[closed],
            increment.contacts.frames[closed, 0],
        )
        value = judged(rings, assembly.free, weights, own, given.friction, velocity).reaction
        values.append(np.inf if value is None else value)
    if all(np.isinf(values)) and k > 0:
        finding.counted("later increment whose closed contacts alone hold nothing: not judged")
        return
    finding.counted("reaction, other form of the program")
    if np.isfinite(increment.least) and not min(values) - same <= increment.least <= max(values) + same:
        finding.wrong.append(f"increment {k}: least reaction {increment.least!r}, by the oracle {values}, W {total!r}")
    # A bound that is not a number was not found, and contradicts nothing; a reaction has to be one.
    low, high = np.fmax(increment.least, -np.inf), np.fmin(increment.largest, np.inf)
    if not low - same <= increment.reaction <= high + same:
        finding.wrong.append(
            f"increment {k}: reaction {increment.reaction!r}, not within {increment.least!r} to {increment.largest!r}"
        )
    bounds = [
        judged(
            rings, assembly.free, weights, touching(rings, assembly.free, near, generous=g), given.friction, velocity
        )
        for g in (True, False)
    ]
    finding.counted("reaction, other contacts")
    low, high = (bound.reaction for bound in bounds)
    if low is not None and increment.reaction < low - same:
        finding.wrong.append(f"increment {k}: reaction {increment.reaction!r} below the oracle's bound {low!r}")
    # At rest a reaction may be anything that equilibrium allows: it is the least that the oracle knows. Blocks wedged by
    # rounding alone may move within it.
    if k == 0 and high is not None and -np.inf < high < increment.least - same:
        finding.wrong.append(f"increment {k}: least reaction {increment.least!r} above the oracle's bound {high!r}")


def _judge_forces(
    given: Trial, increment: solver.Increment, k: int, near: float, weights: np.ndarray, finding: Finding
) -> bool:
    """The forces balance the weights, stay within friction, and act where blocks touch; no block is in another."""
    assembly, contacts = given.assembly, increment.contacts
    total, length = float(weights[assembly.free].sum()), assembly.block_size
    rest = np.zeros((assembly.n_blocks, 3))
    rest[:, 1] -= np.where(increment.fallen, 0.0, weights)
    for n, (normal, shear) in enumerate(increment.forces):
        force = normal * contacts.frames[n, 0] + shear * contacts.frames[n, 1]
        for block, sign in ((contacts.block_a[n], 1.0), (contacts.block_b[n], -1.0)):
            arm = contacts.points[n] - increment.pose.positions[block]
            rest[block] += sign * np.array([*force, arm[0] * force[1] - arm[1] * force[0]])
    finding.counted("balance, friction and place of all forces")
    off = float(np.abs(rest[assembly.free] / [1.0, 1.0, length]).max())
    # Forces of a thousand weights have moments about places that are rounded.
    rounding = float(np.spacing(np.abs(assembly.vertices).max()) * np.abs(increment.forces).sum()) / length
    if off > 1e-7 * total + rounding:
        finding.wrong.append(f"increment {k}: out of balance by {off / total:.2e} W")
    excess = float((np.abs(increment.forces[:, 1]) - given.friction * increment.forces[:, 0]).max(initial=0.0))
    if excess > 1e-7 * total or float(increment.forces[:, 0].min(initial=0.0)) < -1e-9 * total:
        finding.wrong.append(f"increment {k}: friction exceeded by {excess / total:.2e} W")
    bearing = increment.forces[:, 0] > 1e-6 * total
    widest = float(np.abs(contacts.gaps[bearing]).max(initial=0.0))
    if widest > near and k == 0:
        finding.wrong.append(f"increment {k}: a force acts across a gap of {widest / length:.2e} block sizes")
    return widest <= NEAR * length


def _judge_locked(given: Trial, response: solver.Response, weights: np.ndarray, finding: Finding) -> None:
    """Where the supports are said to be unable to move on, no movement of the blocks goes with theirs."""
    assembly, settlement, interfaces = given.assembly, given.settlement, response.interfaces
    # The last increment is told where the supports could still move.
    last: deque[mechanics.PathState] = deque(maxlen=1)
    followed = {"interfaces": interfaces, "loads": response.loads, "on_step": last.append}
    mechanics.settlement_increments(assembly, [settlement], **followed).all()
    state = last.pop()
    motion = state.start.movement_to(state.place.pose)
    rings = _rings(assembly, mechanics.moved(solver.Pose.initial(assembly), motion))
    near = NEAR * assembly.block_size + 8 * np.spacing(np.abs(assembly.vertices).max())
    contacts = touching(rings, assembly.free, near, generous=True)
    velocity = support_velocities(
        rings, assembly.moving, settlement.direction, settlement.rotation_centre, settlement.rotation
    )
    reaction = judged(rings, assembly.free, weights, contacts, given.friction, velocity).reaction
    arm = max(float(np.hypot(*velocity[assembly.moving, :2].T).max()), 1e-300)
    if reaction is not None and reaction < -LOCKED * float(weights[assembly.free].sum()) * arm:
        finding.counted("locked confirmed")
    else:
        finding.counted("locked not confirmed")
        finding.wrong.append(f"locked at {state.place.s:.6g}: could move by the oracle")


def _judge_collapse(given: Trial, response: solver.Response, weights: np.ndarray, finding: Finding) -> None:
    """Where the structure is said to fall, it falls with every contact that could be there."""
    assembly = given.assembly
    fall = next(i for i in response.increments if i.status == solver.Status.FALLING)
    if fall.fallen.any():
        finding.counted("collapse without blocks that have left: not judged")
        return
    rings = _rings(assembly, fall.pose)
    rounding = 8 * np.spacing(np.abs(assembly.vertices).max())
    near, apart = (part * assembly.block_size + rounding for part in (NEAR, APART_AT_COLLAPSE))
    contacts = touching(rings, assembly.free, near, generous=True, apart=apart)
    falls = judged(rings, assembly.free, weights, contacts, given.friction).falls
    if falls <= STANDS:
        falls = _falls_on(given, rings, weights, response.collapse.bracket)
    if falls > STANDS:
        finding.counted("collapse confirmed")
    elif response.collapse.lost == "stable equilibrium":
        finding.counted("collapse past an equilibrium to which no motion leads, as told")
    else:
        finding.counted("collapse not confirmed")
        finding.wrong.append(f"collapse at {response.collapse.bracket}: stands by the oracle ({falls:.2e})")


def _falls_on(given: Trial, rings: list[np.ndarray], weights: np.ndarray, bracket: tuple[float, float]) -> float:
    """How the blocks fall once the supports have moved on by the bracket, the blocks with them as they then would.

    On the verge itself they may stand as long as nothing moves.
    """
    assembly, settlement = given.assembly, given.settlement
    near = NEAR * assembly.block_size + 8 * np.spacing(np.abs(assembly.vertices).max())
    velocity = support_velocities(
        rings, assembly.moving, settlement.direction, settlement.rotation_centre, settlement.rotation
    )
    contacts = touching(rings, assembly.free, near, generous=True)
    verdict = judged(rings, assembly.free, weights, contacts, given.friction, velocity)
    if verdict.motion is None:
        return 0.0 if verdict.reaction == -np.inf else np.inf
    step = bracket[1] - bracket[0]
    on = moved_on(rings, verdict.motion * step)
    near += step * step / assembly.block_size
    contacts = touching(on, assembly.free, near, generous=True)
    return judged(on, assembly.free, weights, contacts, given.friction).falls


def _near(assembly: solver.Assembly, path: tuple[solver.Increment, ...], k: int) -> float:
    """Distance at which corners touch in an increment [m].

    Where friction keeps corrections from converging, the solver leaves gaps of a hundredth of the increment's movement.
    """
    near = NEAR * assembly.block_size + 8 * np.spacing(np.abs(assembly.vertices).max())
    if k == 0:
        return float(near)
    moved = path[k].pose.displacements(assembly) - path[k - 1].pose.displacements(assembly)
    return float(near + LEFT * np.abs(moved * [1.0, 1.0, assembly.block_size]).max())


def _rings(assembly: solver.Assembly, pose: solver.Pose) -> list[np.ndarray]:
    return np.split(mechanics.moved_vertices(assembly, pose), assembly.offsets[1:-1])
