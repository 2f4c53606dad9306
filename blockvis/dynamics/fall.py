"""The fall after the last equilibrium, by rigid-body dynamics: an engine that others keep, set up for masonry.

Statics ends with the collapse mechanism. What follows is dynamics without restitution, of the same blocks, masses and
friction; it says nothing about the settlement at collapse and nothing of the static path depends on it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

import solver
from blockvis.layout.triangulation import cells_of_ring
from blockvis.system.extras import is_installed
from solver import mechanics

from .in_space import Engine, ground_below

if TYPE_CHECKING:
    import pymunk

#: What films, files and pages call it.
CAPTION = "fall: rigid-body dynamics, restitution 0"

#: Poses kept per second, and seconds after which the fall is cut off.
RATE, LONGEST = 25, 4.0

#: Size of a block in the engine, whose own tolerances are made for pixels.
SIZE = 100.0

#: Overlap that the engine leaves between blocks at rest, and how far a block moves in a step at most, both in widths of
#: the thinnest block.
SLOP, STRIDE = 2e-4, 1e-2

#: Steps per second at least and at most (a sliver would ask for any number), sweeps over the contacts in each, and the
#: part of an overlap that is left after a second.
SLOWEST, FASTEST, SWEEPS, BIAS = 1000, 12_000, 30, 1e-12

#: The first push: speed of the fastest block, in sqrt(g × block size). Where everything stands after it, it is doubled,
#: up to so many times.
PUSH, DOUBLINGS = 0.05, 5

#: Blocks rest that are slower than this, in sqrt(g × block size), for this time [s].
STILL, RESTING = 4e-3, 0.2

#: Something has fallen where a block has moved by more than this part of the block size.
FALLEN = 0.25

#: In space so much of the mass that the mechanism takes has to have fallen: by a small push a dome jams again.
MOST = 0.5

#: Faces of supports steeper than 1 in this are walls, not places to lie on; the ground lies no deeper below the
#: structure than this part of its height, however far supports reach down.
STEEP, DEEPEST = 0.3, 0.25

#: Clearance between the ground and the lowest corner, in block sizes: what stands on a support stands on that alone.
CLEARANCE = 1e-3


@dataclass(frozen=True)
class Fall:
    """A fall in time.

    Attributes
    ----------
    times : (n,) array [s]
        Since the last equilibrium.
    positions : (n, n_blocks, d) array [m]
    rotations : (n, n_blocks) array, in space (n, n_blocks, 3) [rad]
    ground : float [m]
        Height of the ground line.
    """

    times: np.ndarray
    positions: np.ndarray
    rotations: np.ndarray
    ground: float

    def __len__(self) -> int:
        """Count the poses."""
        return len(self.times)

    def pose(self, number: int) -> solver.Pose:
        """Return one of the poses."""
        turns = self.rotations[number]
        return solver.Pose(self.positions[number], turns.reshape(len(turns), -1))

    def at(self, time: float) -> solver.Pose:
        """Return the pose at a time [s], in between those kept."""
        k = int(np.clip(np.searchsorted(self.times, time, side="right") - 1, 0, len(self) - 2)) if len(self) > 1 else 0
        if len(self) == 1 or time >= self.times[-1]:
            return self.pose(len(self) - 1)
        t = (time - self.times[k]) / (self.times[k + 1] - self.times[k])
        before, after = self.pose(k), self.pose(k + 1)
        turn = before.movement_to(after)
        turn[:, : before.positions.shape[1]] = 0.0
        places = before.positions + t * (after.positions - before.positions)
        return solver.Pose(places, mechanics.swung(before, t * turn).rotations)


def engine_installed() -> bool:
    """Whether the engine is there: where pymunk has no wheel, blockvis does without."""
    return is_installed("pymunk")


def fall_of(response: solver.Response, progress: Callable[[float], None] | None = None) -> Fall | None:
    """Let a collapsed structure fall from its last equilibrium until all blocks rest.

    Parameters
    ----------
    response : solver.Response
    progress : callable, optional
        Called with the seconds [s] of the fall that are worked out.

    Returns
    -------
    Fall or None
        None where nothing collapses along a path (limit loads, "limit reached"), where nothing falls, and in the plane
        without the engine.
    """
    path, collapse = response.path, response.collapse
    collapsed = response.stop == solver.Status.COLLAPSED and response.parameter.is_path and not response.limits
    if not collapsed or collapse is None or not path or not collapse.mechanism.any():
        return None
    in_space = response.assembly.dimension == 3
    if not in_space and not engine_installed():
        return None
    push = PUSH * np.sqrt(solver.GRAVITY * response.assembly.block_size)
    for _ in range(DOUBLINGS + 1):
        fall = _in_space(response, push, progress) if in_space else _Engine(response, push).run(progress)
        fallen = np.linalg.norm(fall.positions[-1] - fall.positions[0], axis=1) > FALLEN * response.assembly.block_size
        if fallen.any() and (not in_space or response.assembly.masses[fallen].sum() > MOST * _falling_mass(response)):
            return fall
        push *= 2.0
    return None


def _falling_mass(response: solver.Response) -> float:
    """Mass of the blocks that the collapse mechanism takes with it [kg]."""
    assert response.collapse is not None
    falling = mechanics.with_motion(response.path[-1], response.collapse.mechanism)
    takes = mechanics.rigid_parts(response.assembly, falling) >= 0
    return float(response.assembly.masses[takes & response.assembly.free].sum())


def _in_space(response: solver.Response, push: float, progress: Callable[[float], None] | None) -> Fall:
    """Follow blocks in space until all rest or the time is over."""
    assert response.collapse is not None
    assembly, last = response.assembly, response.path[-1]
    ground = ground_below(assembly, last.pose)
    engine = Engine(response, ground, push * response.collapse.mechanism)
    poses, calm, still = [engine.pose], 0, STILL * float(np.sqrt(solver.GRAVITY * assembly.block_size))
    for number in range(1, round(LONGEST * RATE) + 1):
        engine.advance(1.0 / RATE)
        poses.append(engine.pose)
        if progress is not None:
            progress(number / RATE)
        calm = calm + 1 if engine.fastest < still else 0
        if calm >= RESTING * RATE:
            break
    times = np.arange(len(poses)) / RATE
    return Fall(
        times, np.stack([pose.positions for pose in poses]), np.stack([pose.rotations for pose in poses]), ground
    )


def falling_increment(response: solver.Response, pose: solver.Pose) -> solver.Increment:
    """Make what pictures, pages and files show of a fall at one pose: blocks alone, no joints and no forces.

    Parameters
    ----------
    response : solver.Response
    pose : solver.Pose
    """
    last = response.path[-1]
    nothing = np.zeros((0, last.forces.shape[1]))
    return replace(last, status=solver.Status.FALLING, checkpoint=None).with_arrays(
        pose=pose,
        contacts=last.contacts[np.zeros(0, dtype=int)],
        forces=nothing,
        displacements=nothing,
        friction=np.zeros(0),
        velocity=np.zeros_like(last.velocity),
        support_forces=np.zeros_like(last.support_forces),
        fell_at=response.increments[-1].state.fell_at,
    )


def _ground(assembly: solver.Assembly, pose: solver.Pose) -> float:
    """Height of the ground line [m]: of the lowest place on which something stands or may slide down to."""
    corners, free = mechanics.moved_vertices(assembly, pose), assembly.free[assembly.block_of_vertex]
    following = corners[assembly.next_vertex]
    # The outward normal of an edge points up where the edge runs to the left.
    upward = ~free & (corners[:, 0] - following[:, 0] > STEEP * np.abs(following[:, 1] - corners[:, 1]))
    low, high = corners[free, 1].min(), corners[free, 1].max()
    faces = np.minimum(corners[upward, 1], following[upward, 1])
    ground = max(faces.min(initial=low), low - DEEPEST * (high - low))
    return float(min(ground, low) - CLEARANCE * assembly.block_size)


class _Engine:
    """The last equilibrium of a response as bodies of the engine, lengths scaled, the ground at height 0.

    Parameters
    ----------
    response : solver.Response
    push : float [m/s]
        Speed of the fastest block at the start.
    """

    def __init__(self, response: solver.Response, push: float) -> None:
        import pymunk

        last, self._gone = response.path[-1], response.increments[-1].removed
        # Blocks that were taken away stay behind, and nothing meets them.
        assembly = response.assembly.with_roles(np.where(self._gone, mechanics.FIXED, response.assembly.roles))
        self.assembly, self.pose = assembly, last.pose
        self.scale = SIZE / assembly.block_size
        self.origin = np.array([self.pose.positions[assembly.free, 0].mean(), _ground(assembly, self.pose)])
        self.speed = float(np.sqrt(solver.GRAVITY * assembly.block_size))
        self.thinnest = float(assembly.widths[assembly.free].min())
        self.space = pymunk.Space()
        self.space.gravity = (0.0, -solver.GRAVITY * self.scale)
        self.space.iterations = SWEEPS
        self.space.collision_slop = SLOP * self.thinnest * self.scale
        self.space.collision_bias = BIAS
        self.space.sleep_time_threshold = RESTING
        self.space.idle_speed_threshold = STILL * self.speed * self.scale
        mass = assembly.masses / assembly.masses[assembly.free].mean()
        self.bodies = [self._body(pymunk, block, float(mass[block])) for block in range(assembly.n_blocks)]
        for block in np.flatnonzero(assembly.free):
            *velocity, spin = map(float, push * response.collapse.mechanism[block])  # type: ignore[union-attr]
            self.bodies[block].velocity = (velocity[0] * self.scale, velocity[1] * self.scale)
            self.bodies[block].angular_velocity = spin
        self._lay_ground(pymunk)
        self._set_friction(response)
        # Loads beside gravity act on as they did.
        own = solver.self_weight(assembly).dead
        per_force = self.scale / assembly.masses[assembly.free].mean()
        extra = (response.dead_at(response.increments[-1], self.pose) - own) * assembly.free[:, None] * per_force
        extra[np.abs(extra) < 1e-9 * np.abs(own).max()] = 0.0
        self.loaded = [(self.bodies[k], tuple(map(float, extra[k]))) for k in np.flatnonzero(extra.any(axis=1))]

    def run(self, progress: Callable[[float], None] | None = None) -> Fall:
        """Follow the bodies until all rest or the time is over."""
        free = [self.bodies[block] for block in np.flatnonzero(self.assembly.free)]
        samples, calm = [self._sample()], 0
        for _ in range(round(LONGEST * RATE)):
            fastest = self._fastest()
            speed = fastest + solver.GRAVITY / RATE
            steps = int(np.ceil(np.clip(speed / (STRIDE * self.thinnest), SLOWEST, FASTEST) / RATE))
            for _ in range(steps):
                for body, (x, y, moment) in self.loaded:
                    body.apply_force_at_world_point((x, y), body.position)
                    body.torque += moment * self.scale
                self.space.step(1.0 / RATE / steps)
            samples.append(self._sample())
            if progress is not None:
                progress((len(samples) - 1) / RATE)
            still = all(body.is_sleeping for body in free) or self._fastest() < STILL * self.speed
            calm = calm + 1 if still else 0
            if calm >= RESTING * RATE:
                break
        positions, rotations = (np.stack(of) for of in zip(*samples, strict=True))
        return Fall(np.arange(len(samples)) / RATE, positions, rotations, float(self.origin[1]))

    def _body(self, engine: pymunk, block: int, mass: float) -> pymunk.Body:
        assembly = self.assembly
        outline = (assembly.outline(block) - assembly.centroids[block]) * self.scale
        ring = [tuple(map(float, corner)) for corner in outline]
        if assembly.free[block]:
            body = engine.Body(mass, engine.moment_for_poly(mass, ring))
        else:
            body = engine.Body(body_type=engine.Body.STATIC)
        body.position = tuple(map(float, (self.pose.positions[block] - self.origin) * self.scale))
        body.angle = float(self.pose.rotations[block, 0])
        # A convex block in one piece, or edges inside it would catch the corners of others.
        convex = bool(assembly.convex_vertex[assembly.offsets[block] : assembly.offsets[block + 1]].all())
        cells = [tuple(range(len(ring)))] if convex else cells_of_ring(outline)
        parts = [engine.Poly(body, [ring[k] for k in cell]) for cell in cells]
        for part in parts:
            part.elasticity = 0.0
            part.collision_type = block + 1
        self.space.add(body, *([] if self._gone[block] else parts))
        return body

    def _lay_ground(self, engine: pymunk) -> None:
        """Lay a slab, so that nothing falls through it, as wide as anything can get."""
        width = 100.0 * self.scale * float(np.ptp(self.assembly.vertices, axis=0).max())
        deep = 10.0 * SIZE
        ground = engine.Poly(self.space.static_body, [(-width, -deep), (width, -deep), (width, 0.0), (-width, 0.0)])
        ground.elasticity = 0.0
        self.space.add(ground)
        self.ground = ground

    def _set_friction(self, response: solver.Response) -> None:
        """Set the friction of each pair of blocks; the ground has that of the supports.

        The engine multiplies the coefficients of two shapes: where all joints are alike, each has the root. Elsewhere
        the pairs that may meet are many, and each is asked for when it does.
        """
        law, assembly = response.interfaces, self.assembly
        joints = response.path[-1].friction
        alike = law.scatter is None and not law.pairs
        usual = float(law.default.friction_coefficient if alike else np.median(joints))
        for shape in self.space.shapes:
            shape.friction = usual**0.5
        if alike:
            return
        known: dict[tuple[int, int], float] = {}

        def of_pair(arbiter: pymunk.Arbiter, space: pymunk.Space, data: object) -> None:
            a, b = sorted(shape.collision_type - 1 for shape in arbiter.shapes)
            if a < 0:
                return
            if (a, b) not in known:
                known[a, b] = float(law.friction(assembly, np.array([a]), np.array([b]))[0])
            arbiter.friction = known[a, b]

        self.space.on_collision(None, None, pre_solve=of_pair)

    def _fastest(self) -> float:
        """Speed of the fastest block [m/s], turning included."""
        reach = 0.5 * self.assembly.block_size
        return max(
            (
                body.velocity.length / self.scale + abs(body.angular_velocity) * reach
                for body, free in zip(self.bodies, self.assembly.free, strict=True)
                if free and not body.is_sleeping
            ),
            default=0.0,
        )

    def _sample(self) -> tuple[np.ndarray, np.ndarray]:
        places = np.array([tuple(body.position) for body in self.bodies]) / self.scale + self.origin
        return places, np.array([body.angle for body in self.bodies])
