"""The mechanism that follows the last equilibrium, as pictures and films show it: its parts, and where they go."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

import solver
from blockvis.dynamics.fall import falls_from
from blockvis.results.mechanism_arrays import SWING, corner_speeds, swung, swung_increment
from solver import mechanics

from . import palette
from .frame import framed

#: A fall of so many frames needs no others; how many a mechanism has that swings out, and how far it goes, in motions
#: whose fastest corner goes ``SWING``: what moves in a film is to be seen, and so its hinges may part.
ENOUGH_FRAMES, SWING_FRAMES, SWING_REACH = 8, 15, 1.2

#: The fastest corner of a mechanism goes less far than ``SWING``, in sizes of the picture, where hinges would part by
#: more than this beyond what they do to first order: a hinge is closed, however far its sides turn.
TEAR = 0.002

#: Up to this many parts of a mechanism are tinted one by one: each has a colour of its own.
MOST_PARTS = len(palette.PARTS)

#: Of more, the fastest block has the colour of this part of the scale of displacements.
FASTEST = 0.75


@dataclass(frozen=True)
class Swing:
    """A mechanism and where it takes the blocks, out of scale."""

    increment: solver.Increment  #: The state it begins at, with the motion that follows.
    begins: solver.Increment  #: That state as the response has it.
    displaced: solver.Pose  #: After the motion; at the increment's own pose where nothing moves.
    parts: np.ndarray  #: (n_blocks,) int array: as ``solver.mechanics.rigid_parts`` gives them.
    moves: bool  #: Whether anything moves.
    motion: np.ndarray  #: (n_blocks, n_dof) array: from the increment's pose to the displaced one.
    share: float  #: How much this is of the motion whose fastest corner goes ``SWING`` of the picture.

    @property
    def n_parts(self) -> int:
        """Number of parts that move as one."""
        return int(self.parts.max(initial=-1)) + 1


def swing_of(response: solver.Response) -> Swing:
    """Find the mechanism that follows the last equilibrium, the state that governs, or what is taken away at once.

    The response has an increment at least.
    """
    begins = (falls_from(response) if response.collapse is not None else response.governing) or response.increments[0]
    motion = begins.velocity if response.collapse is None else response.collapse.mechanism
    last = mechanics.with_motion(begins, motion)
    assembly = response.assembly
    speeds = corner_speeds(assembly, last.pose, motion)
    fastest = float(speeds.max(initial=0.0))
    if response.collapse is None and fastest > 0.0:
        # Without collapse a single loose brick may be the fastest: it would make the motion of the whole invisible.
        fastest = _exceeded_by(0.01, speeds, assembly.shapes.volumes) or fastest
        motion = motion * np.minimum(1.0, fastest / np.maximum(speeds, fastest))[:, None]
    size = float(framed(assembly, [last.pose]).size.max())
    motion = motion * (SWING * size / fastest if fastest > 0 else 0.0)
    share = min(1.0, float(np.sqrt(TEAR * size / max(_torn(assembly, last, motion), 1e-300))))
    displaced = swung(last.pose, share * motion)
    return Swing(last, begins, displaced, mechanics.rigid_parts(assembly, last), fastest > 0.0, share * motion, share)


def shown_increments(response: solver.Response) -> tuple[solver.Increment, ...]:
    """Increments that films and pages show: those of a response, and enough frames of a fall.

    In space blocks that fall soon meet others, and the analysis ends there, as it does at once where nothing ever
    stood; the mechanism then swings out instead, ever faster, as it begins at the last equilibrium.
    """
    path = response.path
    stood = bool(path) and (response.assembly.dimension == 2 or response.collapse is None)
    if stood or not response.increments or len(response.increments) - len(path) >= ENOUGH_FRAMES:
        return response.increments
    swing = swing_of(response)
    if not swing.moves:
        return response.increments
    reaches = (SWING_REACH * (k / SWING_FRAMES) ** 2 for k in range(1 if path else 0, SWING_FRAMES + 1))
    return (*path, *(swung_increment(swing.increment, reach / swing.share * swing.motion) for reach in reaches))


def mechanism_colours(assembly: solver.Assembly, fill: np.ndarray, swing: Swing) -> np.ndarray:
    """(n_blocks, 3) uint8 array: fills with the parts of a mechanism tinted, or darker where they are faster.

    The fills are as :func:`blockvis.pictures.palette.block_colours` gives them; what stands still is pale.
    """
    if swing.n_parts <= MOST_PARTS:
        still = palette.pale(fill, assembly.free & (swing.parts < 0), palette.STILL)
        return palette.part_colours(still, swing.parts)
    travel = np.linalg.norm(swing.displaced.positions - swing.increment.pose.positions, axis=1)
    tints = palette.displacement_colours(FASTEST * travel / travel[assembly.free].max())
    return np.where(assembly.free[:, None], tints, fill)


def _torn(assembly: solver.Assembly, increment: solver.Increment, motion: np.ndarray) -> float:
    """Find by how much [m] hinges of blocks on their arcs part at most, beyond first order.

    It grows with the square of the motion, (n_blocks, n_dof) from the increment on.
    """
    # Not those of its forces: where nothing ever stood there are none.
    hinges = increment.contacts[mechanics.mechanism_of(assembly, increment).hinge_points]
    before, after, points = increment.pose, swung(increment.pose, motion), hinges.points
    of_a, of_b = (
        mechanics.carried(points, block, before, after) - mechanics.point_velocities(points, block, before, motion)
        for block in (hinges.block_a, hinges.block_b)
    )
    return float(np.linalg.norm(of_a - of_b, axis=1).max(initial=0.0))


def _exceeded_by(share: float, speeds: np.ndarray, volumes: np.ndarray) -> float:
    """Speed that blocks of this share of the moving volume reach or exceed."""
    order = np.argsort(speeds)[::-1]
    moving = np.where(speeds[order] > 0.0, volumes[order], 0.0).cumsum()
    return float(speeds[order[np.searchsorted(moving, share * moving[-1])]])
