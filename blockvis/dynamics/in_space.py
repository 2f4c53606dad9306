"""The fall of blocks in space: the convex step of a path with inertia in place of viscosity, on a ground.

Each step is the strictly convex program of the path, with M / dt² for the viscosity: implicit, without restitution, so
that energy never grows and blocks come to rest. Contact points, friction and exact rotations are those of the path.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

import solver
from solver import mechanics

#: Seconds of a step at most.
LONGEST_STEP = 0.01

#: How far a block moves in a step at most, and the shortest step, in block sizes and in √(block size / g).
STRIDE, SHORTEST = 0.15, 1e-5

#: Name of the slab that is the ground.
GROUND = "ground"


class Engine:
    """Blocks of a response, at its last equilibrium, above a ground.

    Parameters
    ----------
    response : solver.Response
    ground : float [m]
        Height of the ground.
    velocity : (n_blocks, 6) array [m/s, rad/s]
        At the start.
    """

    def __init__(self, response: solver.Response, ground: float, velocity: np.ndarray) -> None:
        last, gone = response.path[-1].pose, response.increments[-1].removed
        drawn = response.assembly.with_roles(np.where(gone, mechanics.FIXED, response.assembly.roles))
        self.n_blocks = drawn.n_blocks
        assembly = _on_ground(drawn, last, ground)
        dead = np.zeros((assembly.n_blocks, 6))
        dead[: self.n_blocks] = response.dead_at(response.increments[-1], last)
        controls = solver.Controls()
        law = replace(response.interfaces, scatter=None)
        model = mechanics.model_of(assembly, solver.Loads(dead, np.zeros_like(dead)), law, controls)
        if gone.any():
            model = model.without(np.append(gone, False))
        pose = solver.Pose(
            np.vstack([last.positions, assembly.centroids[self.n_blocks :]]),
            np.vstack([last.rotations, np.zeros((assembly.n_blocks - self.n_blocks, 3))]),
        )
        self.assembly, self.model = assembly, model
        self.unit = float(np.sqrt(model.length / solver.GRAVITY))
        self.stepper = mechanics.Stepper(model, _AtRest(pose, model.n_dof), damping=0.0)
        start = np.zeros((assembly.n_blocks, 6))
        start[: self.n_blocks] = velocity * self.unit * drawn.free[:, None]
        self.place = replace(mechanics.Place.unloaded(pose), velocity=start)
        #: Length of the next step, in units of √(block size / g).
        self.step = 0.2 * LONGEST_STEP / self.unit
        self.steps = 0

    def advance(self, seconds: float) -> None:
        """Follow the blocks for so many seconds."""
        left = seconds / self.unit
        while left > 1e-9:
            length = min(self.step, left)
            try:
                place, motion, _ = self.stepper.step(self.place, length, in_time=True)
            except mechanics.NotSolved:
                if length < SHORTEST:
                    raise
                self.step = length / 2.0
                continue
            moved = float(np.abs(motion[: self.n_blocks]).max())
            if moved > 2.0 * STRIDE and length > SHORTEST:
                self.step = length / 2.0
                continue
            self.place, self.steps = place, self.steps + 1
            left -= length
            fitting = length * min(1.5, STRIDE / max(moved, 1e-300))
            self.step = min(max(self.step if length < self.step else 0.0, fitting), LONGEST_STEP / self.unit)

    @property
    def pose(self) -> solver.Pose:
        """Of the blocks of the response."""
        pose = self.place.pose
        return solver.Pose(pose.positions[: self.n_blocks], pose.rotations[: self.n_blocks])

    @property
    def fastest(self) -> float:
        """Speed of the fastest block [m/s], turning included."""
        assert self.place.velocity is not None
        speed = np.abs(self.place.velocity[: self.n_blocks]) / self.model.lengths
        return float(speed.max()) * self.model.length / self.unit

    @property
    def energy(self) -> float:
        """Potential and kinetic energy of the free blocks [J]; rotary inertia is that of the step."""
        assert self.place.velocity is not None
        free, weights = self.assembly.free, self.stepper.weights
        height = float((weights[free, 0] * self.place.pose.positions[free, 2]).sum()) / self.model.length
        kinetic = 0.5 * float((weights * (self.place.velocity / self.model.lengths) ** 2)[free].sum())
        return (height + kinetic) * self.model.force * self.model.length


class _AtRest:
    """Supports that stand still: a driver of steps in time."""

    increment, limit, tolerance, lever = 1.0, 1.0, 1.0, 1.0
    unit, what = "s", "time"
    stops: tuple[float, ...] = ()

    def __init__(self, pose: solver.Pose, n_dof: int) -> None:
        self._pose, self._still = pose, np.zeros((len(pose.positions), n_dof))

    def supports(self, s: float) -> solver.Pose:
        """Where they stand."""
        return self._pose

    def rate(self, s: float) -> np.ndarray:
        """No velocity."""
        return self._still

    def control_displacement(self, pose: solver.Pose) -> float:
        """No control displacement."""
        return 0.0

    def control(self, pose: solver.Pose) -> None:
        """No control displacement."""

    def misdirected(self) -> str:
        """No multiplier."""
        return ""


def ground_below(assembly: solver.Assembly, pose: solver.Pose) -> float:
    """Height of the ground [m]: below the lowest corner of a free block and of a support.

    Parameters
    ----------
    assembly : solver.Assembly
    pose : solver.Pose
    """
    corners = mechanics.moved_vertices(assembly, pose)
    free = assembly.free[assembly.block_of_vertex]
    return float(corners[free, 2].min()) - 1e-3 * assembly.block_size


def _on_ground(assembly: solver.Assembly, pose: solver.Pose, ground: float) -> solver.Assembly:
    """Add a slab as wide as anything can get."""
    polyhedra = assembly.polyhedra
    solids = [polyhedra.surface(block) for block in range(assembly.n_blocks)]
    corners = mechanics.moved_vertices(assembly, pose)
    middle, size = corners.mean(axis=0), 4.0 * float(np.ptp(corners, axis=0).max())
    low = np.array([middle[0] - size, middle[1] - size, ground - 0.5 * assembly.block_size])
    high = np.array([middle[0] + size, middle[1] + size, ground])
    box = np.array([[(low, high)[k >> axis & 1][axis] for axis in range(3)] for k in range(8)])
    faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]]
    supports = np.flatnonzero(~assembly.free)
    material = assembly.materials[int(supports[0])] if len(supports) else ""
    return solver.Assembly.from_solids(
        [*solids, (box, faces)],
        names=[*assembly.names, GROUND],
        roles=[*(mechanics.FREE if free else mechanics.FIXED for free in assembly.free), mechanics.FIXED],
        density=np.append(assembly.density, 1.0),
        materials=[*assembly.materials, material],
    )
