"""Drivers of a path: supports that move, or a control displacement that grows under a live load."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from solver import tolerances
from solver.assembly import Assembly, find_contacts
from solver.kinematics import Pose, cross_rows, moved_vertices, point_velocities, rotation_matrices
from solver.loads import ControlDisplacement, Settlement
from solver.program.model import Model


class Driver:
    """The parameter of a path: what it moves, how far, and in which increments, from a pose."""

    #: Name of the parameter.
    what: str
    #: Message where the multiplier has to change its sign for the parameter to grow; none where supports drive.
    misdirected = ""
    #: Values that are reported, too.
    stops: Sequence[float] = ()
    #: Of a live load alone: control displacement [m] at a pose, and its gradient, (n_blocks, n_dof) array.
    control_displacement: Callable[[Pose], float]
    control: Callable[[Pose], np.ndarray]

    def __init__(self, assembly: Assembly, given: Any, start: Pose) -> None:
        self.assembly, self.start = assembly, start
        self.increment, self.limit, self.unit = float(given.increment), float(given.limit), str(given.unit)
        self.tolerance = float(given.tolerance)

    def next_stop(self, s: float) -> float:
        """Next parameter that is reported: a multiple of the increment, one of the stops, or the limit."""
        near = 1e-9 * self.increment
        multiple = float(np.floor(s / self.increment + 1e-9) + 1.0) * self.increment
        stop = min([multiple, *(stop for stop in self.stops if stop > s + near)])
        return self.limit if self.limit - stop < near else stop

    def supports(self, s: float) -> Pose:
        """Pose of the supports, by default as at the start; that of free blocks has no meaning."""
        return self.start

    def rate(self, s: float) -> np.ndarray:
        """(n_blocks, n_dof) array: velocity of the supports per unit of the parameter, by default zero."""
        return np.zeros((self.assembly.n_blocks, self.start.positions.shape[1] + self.start.rotations.shape[1]))

    def lever(self, model: Model) -> float:
        """Largest displacement that it prescribes, per unit of it."""
        return 1.0


class SupportMotion(Driver):
    """Supports that follow a settlement."""

    what = "settlement"

    def __init__(self, assembly: Assembly, phase: Settlement, start: Pose) -> None:
        super().__init__(assembly, phase, start)
        self.phase, self.stops = phase, phase.stops

    def lever(self, model: Model) -> float:
        """Of the supports, and of blocks that rest on such alone that move as one: the top of a tower goes far."""
        assembly, start, rate = model.assembly, self.start, self.rate(0.0)
        vertices, of, d = moved_vertices(assembly, start), assembly.block_of_vertex, assembly.dimension
        near = model.standing(find_contacts(assembly, vertices, model.length / 4.0))
        load = model.load[assembly.free, :d].sum(axis=0)
        upward = near.frames[:, 0] @ -load
        above, below = np.where(upward > 0.0, (near.block_a, near.block_b), (near.block_b, near.block_a))
        # Head joints of a drawing are upright to less than a tenth.
        rests = assembly.free[above] & (np.abs(upward) > 0.1 * np.linalg.norm(load))
        rests &= near.gaps < tolerances.CLOSED * model.length
        # Least and largest velocities, those at the origin, of all supports that a block rests on.
        origin = Pose(np.zeros_like(start.positions), start.rotations)
        twist = np.column_stack([point_velocities(origin.positions, np.arange(len(rate)), start, rate), rate[:, d:]])
        least = np.where(assembly.free[:, None], np.inf, np.column_stack([twist, -twist]))
        before = np.zeros_like(least)
        while not np.array_equal(before, least):
            before = least.copy()
            np.minimum.at(least, above[rests], before[below[rests]])
        twist, largest = least[:, : rate.shape[1]], -least[:, rate.shape[1] :]
        riding = (assembly.free & np.isclose(twist, largest).all(axis=1))[of]
        # Supports where blocks are near them: how deep they are drawn counts for nothing.
        moved = [point_velocities(near.points, side, start, rate) for side in (near.block_a, near.block_b)]
        moved.append(point_velocities(vertices[riding], of[riding], origin, twist))
        return float(np.linalg.norm(np.concatenate(moved), axis=1).max(initial=0.0)) or 1.0

    def supports(self, s: float) -> Pose:
        """Of the settlement."""
        return self.phase.displaced(self.assembly, self.start, s)

    def rate(self, s: float) -> np.ndarray:
        """Of the settlement."""
        return self.phase.rate(self.assembly, self.start, s)


class ControlledLoad(Driver):
    """A live load whose multiplier makes a control displacement grow; all supports are fixed."""

    what = "control displacement"

    def __init__(self, assembly: Assembly, chosen: ControlDisplacement, start: Pose) -> None:
        super().__init__(assembly, chosen, start)
        self.block, d = assembly.index(chosen.block), assembly.dimension
        self.along = np.eye(d)[0] if chosen.direction is None else np.asarray(chosen.direction)
        #: From the centroid of the block as drawn to the point.
        self.arm = np.zeros(d) if chosen.point is None else np.asarray(chosen.point) - assembly.centroids[self.block]
        self.begun = start.positions[self.block] + self._turned(start)
        self.misdirected = (
            f"the mechanism does not move block '{chosen.block}' along {chosen.direction or 'x'}; turn the "
            "direction round if it moves it the other way, or choose another control block, point or direction"
        )

    def control_displacement(self, pose: Pose) -> float:
        """Since the start [m]."""
        return float((pose.positions[self.block] + self._turned(pose) - self.begun) @ self.along)

    def control(self, pose: Pose) -> np.ndarray:
        """Gradient of the displacement of the control point."""
        weights = self.rate(0.0)
        weights[self.block] = np.concatenate([self.along, cross_rows(self._turned(pose)[None])[0] @ self.along])
        return weights

    def _turned(self, pose: Pose) -> np.ndarray:
        """(d,) array [m]: the arm at a pose."""
        return rotation_matrices(pose.rotations[[self.block]])[0] @ self.arm
