"""A light piece that snaps: the fall of a few small blocks, followed downhill to where others catch them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from solver.assembly import FIXED, FREE, Assembly, measure_contacts
from solver.kinematics import Pose, motion_size, moved, moved_vertices
from solver.lp.problem import SolveError
from solver.program.correction import Falls, NotConverged, at_rest, solve_again
from solver.program.increment import Locked, Solved, solve_program
from solver.program.model import Model
from solver.results.increment import carries
from solver.tolerances import FARTHEST_FALL, HOLDS, STILL

#: Largest weight of what may snap, as a fraction of that of the free blocks. Falling by half a block size at most, it
#: strikes the rest with an energy that would lift all of it by 5e-3 block sizes at most: a knock that statics may pass
#: over. After the fall of more, such as a voussoir of an arch or the lintel of a portal, statics says nothing.
LIGHT = 1e-2

#: Blocks move with a fall where they move by more than this part of the fastest.
MOVES = 1e-3

#: Step of a fall, as a fraction of the smallest block that falls, and the number of steps after which it is given up.
STEP, STEPS = 0.05, 400

#: Steps over which a fall has to do work, and the work as a fraction of weight times size: less is the small cycle in
#: which friction may keep a block that rests.
CYCLE, CYCLE_WORK = 20, 1e-5

#: Blocks are reported to have fallen where they moved by this part of the farthest; so many blocks are named.
NOTICED, NAMED = 0.05, 4

#: How often blocks that the fall of others has set free may join them.
JOINS = 3


@dataclass(frozen=True)
class Snap:
    """A fall that others ended.

    Attributes
    ----------
    pose : Pose
        Where everything is in equilibrium again.
    blocks : (n,) int array
        That fell.
    fall : float [m]
        Largest movement of a corner of theirs.
    onto : (m,) int array
        What caught them.
    """

    pose: Pose
    blocks: np.ndarray
    fall: float
    onto: np.ndarray

    def words(self, assembly: Assembly) -> str:
        """What happened, in words."""
        caught = f"until {_named(assembly, self.onto)} caught" if len(self.onto) else "and came to rest again:"
        it = "it" if len(self.blocks) == 1 else "them"
        return f"{_named(assembly, self.blocks)} fell {self.fall:.2g} m {caught} {it}"


def snapped(model: Model, pose: Pose, motion: np.ndarray, correctors: int, nudge: np.ndarray) -> Snap | None:
    """Follows the fall of a light piece to the equilibrium it falls into, everything else standing still.

    Parameters
    ----------
    model : Model
    pose : Pose
        Without equilibrium.
    motion : (n_blocks, 3) array [m, m, rad]
        Of the fall: what moves in it is the piece.
    correctors : int
        Largest number of programs that close the geometry at the end.
    nudge : (n_blocks, 3) array [m, m, rad]
        A very small movement of the supports with which the equilibrium found must hold.

    Returns
    -------
    Snap or None
        None where the piece is not light, falls by more than half a block size, or does not come to rest.

    Notes
    -----
    Each step is the program of a rest with a trust region that is small against the smallest block of the piece: the
    movement that does the most work of the loads. Whatever a program of the whole structure does not hold afterwards
    falls on.
    """
    piece = _moving(model, motion)
    if not np.abs(model.load[piece, :2]).any():
        return None
    end = pose
    for _ in range(JOINS):
        if not _light(model.assembly, piece):
            return None
        try:
            end, solved = _fallen(model, end, piece)
            end = at_rest(model, end, correctors, nudge)
        except Falls as fall:
            # The piece itself falls on, or others have lost what held them.
            joined = piece | _moving(model, fall.solved.motion)
            if (joined == piece).all():
                return None
            piece = joined
            continue
        except (Locked, NotConverged, SolveError):
            return None
        return _told(model, pose, end, piece, solved)
    return None


def _fallen(model: Model, start: Pose, piece: np.ndarray) -> tuple[Pose, Solved]:
    """Where a piece comes to rest while all else stands still, and the program that says so.

    Raises
    ------
    Falls
        If it does not within half a block size.
    """
    alone = _alone(model, piece)
    load = model.load * piece[:, None]
    work, done = np.zeros(STEPS + 1), float(np.hypot(*load[:, :2].T).sum()) * alone.length * CYCLE_WORK
    solved, pose = solve_program(alone, start), start
    for step in range(1, STEPS + 1):
        if not solved.falling and float(motion_size(solved.motion, alone.length).max()) <= STILL * alone.length:
            return pose, solved
        pose = moved(pose, solved.motion)
        work[step] = work[step - 1] + float((load * solved.motion).sum())
        if step >= CYCLE and not solved.falling and work[step] - work[step - CYCLE] <= done:
            return pose, solved
        if np.abs(pose.positions - start.positions).max() > FARTHEST_FALL * model.length:
            break
        solved = solve_again(alone, pose, solved)
    raise Falls(solved)


def _alone(model: Model, piece: np.ndarray) -> Model:
    """The model in which nothing but a piece is free to move, in units that suit the piece."""
    assembly = replace(model.assembly, roles=np.where(piece, FREE, FIXED))
    size = np.sqrt(assembly.areas[piece])
    trust = STEP * float(size.min())
    length = float(size.mean())
    force = float(np.hypot(*model.load[piece, :2].T).mean())
    return replace(model, assembly=assembly, length=length, force=force, trust=trust, reach=length / 4.0)


def _told(model: Model, start: Pose, end: Pose, piece: np.ndarray, solved: Solved) -> Snap | None:
    """The snap from one pose to another; None where more has moved than may."""
    assembly = model.assembly
    way = _ways(assembly, start, end)
    fell = way > NOTICED * way.max()
    load = model.load * assembly.free[:, None]
    lower = float(
        (load[:, :2] * (end.positions - start.positions)).sum() + load[:, 2] @ (end.rotations - start.rotations)[:, 0]
    )
    farthest = float(
        np.abs(end.positions - start.positions).max(axis=1, where=assembly.free[:, None], initial=0.0).max()
    )
    stood = lower <= 0.0 or way.max() <= STILL * model.length
    if stood or not _light(assembly, fell | piece) or farthest > FARTHEST_FALL * model.length:
        return None
    contacts, holds = solved.contacts, carries(solved.forces, HOLDS)
    holds &= fell[contacts.block_a] != fell[contacts.block_b]
    before = measure_contacts(assembly, moved_vertices(assembly, start), contacts).gaps
    caught = holds & (before > NOTICED * way.max())
    chosen = caught if caught.any() else holds
    onto = np.where(fell[contacts.block_a], contacts.block_b, contacts.block_a)[chosen]
    return Snap(end, np.flatnonzero(fell), float(way.max()), np.unique(onto))


def jump_words(model: Model, start: Pose, end: Pose) -> str:
    """What to say where blocks have found an equilibrium away from where they were, and it was no snap."""
    way = _ways(model.assembly, start, end)
    moved_on = np.flatnonzero(way > NOTICED * way.max())
    return (
        f"{_named(model.assembly, moved_on)} moved by up to {way.max():.2g} m at once to the next equilibrium; what "
        "such a fall knocks loose is not followed"
    )


def _ways(assembly: Assembly, start: Pose, end: Pose) -> np.ndarray:
    """(n_blocks,) array [m]: largest movement of a corner of each free block."""
    corners = np.hypot(*(moved_vertices(assembly, end) - moved_vertices(assembly, start)).T)
    return np.where(assembly.free, np.maximum.reduceat(corners, assembly.offsets[:-1]), 0.0)


def _light(assembly: Assembly, piece: np.ndarray) -> bool:
    weight = assembly.masses * assembly.free
    return bool(weight[piece].sum() <= LIGHT * weight.sum())


def _moving(model: Model, motion: np.ndarray) -> np.ndarray:
    """(n_blocks,) bool array: the free blocks that move with the fastest."""
    size = np.where(model.assembly.free, motion_size(motion, model.length), 0.0)
    return size > MOVES * float(size.max())


def _named(assembly: Assembly, blocks: np.ndarray) -> str:
    shown = ", ".join(f"'{assembly.names[i]}'" for i in blocks[:NAMED])
    more = f" and {len(blocks) - NAMED} more" if len(blocks) > NAMED else ""
    return f"block{'' if len(blocks) == 1 else 's'} {shown}{more}"
