"""Loads on the blocks, and the settlement of the moving supports."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from .assembly import Assembly
from .kinematics import Pose, rotation_matrices

#: Acceleration of gravity [m/s²], as structural codes round it.
GRAVITY = 9.81


@dataclass(frozen=True)
class Loads:
    """External loads at the centroids; they keep their direction when the blocks turn.

    Attributes
    ----------
    dead : (n_blocks, 3) array [N, N, N·m]
        Forces and counter-clockwise moment on each block, self-weight included.
    live : (n_blocks, 3) array [N, N, N·m]
        Loads that the load multiplier scales.
    """

    dead: np.ndarray
    live: np.ndarray

    def total(self, multiplier: float = 0.0) -> np.ndarray:
        """(n_blocks, 3) array: dead load + multiplier · live load."""
        return self.dead + multiplier * self.live


def self_weight(assembly: Assembly) -> Loads:
    """Self-weight of all blocks as dead load; no live load.

    Examples
    --------
    >>> import solver
    >>> block = solver.Assembly.from_outlines([[[0, 0], [1, 0], [1, 1], [0, 1]]], density=2000.0)
    >>> float(solver.self_weight(block).dead[0, 1])
    -19620.0
    """
    dead = np.zeros((assembly.n_blocks, 3))
    dead[:, 1] = -assembly.masses * GRAVITY
    return Loads(dead, np.zeros_like(dead))


@dataclass(frozen=True)
class Settlement:
    """One-parameter rigid motion of the moving supports.

    Attributes
    ----------
    direction : (2,) sequence, optional
        Direction of the translation; only its direction counts, the parameter s is the distance [m].
    rotation_centre : (2,) sequence [m], optional
        Point about which the supports turn; it travels with the translation.
    rotation : float
        Without a direction: 1 for counter-clockwise, -1 for clockwise, and s is the angle [rad].
        With one: angle per distance [rad/m].
    increment : float [m or rad]
        Largest step of s.
    limit : float [m or rad]
        Where to stop if nothing has collapsed.
    tolerance : float, optional [m or rad]
        Width of the collapse bracket; a hundredth of the increment by default.
    blocks : sequence of str, optional
        Names of the moving supports that take part; all by default, the others stand still in this phase.
    stops : sequence of float [m or rad]
        Settlements that no step goes across: the path has an increment at each of them that it reaches.
    profile : mapping of str to (float, float, float), optional [m, m, rad]
        Instead of one motion for all: how each support, by its name, moves and turns about its own centroid. Only the
        proportions count: s is the largest displacement of a centroid, or the largest angle where none moves.
    """

    direction: Sequence[float] | None = None
    rotation_centre: Sequence[float] | None = None
    rotation: float = 0.0
    increment: float = 0.01
    limit: float = 1.0
    tolerance: float | None = None
    blocks: tuple[str, ...] | None = None
    stops: tuple[float, ...] = ()
    profile: Mapping[str, Sequence[float]] | None = None

    def __post_init__(self) -> None:
        """Check the values; make the direction a unit vector, and the rotation without one a sign."""
        if self.profile is not None:
            self._check_profile()
        elif self.direction is None and self.rotation_centre is None:
            raise ValueError("a settlement needs a direction, or a rotation_centre and rotation")
        for name in ("direction", "rotation_centre"):
            if getattr(self, name) is not None:
                object.__setattr__(self, name, _pair(getattr(self, name), name))
        if self.direction is not None:
            length = float(np.hypot(self.direction[0], self.direction[1]))
            if length == 0.0:
                raise ValueError("settlement direction is [0, 0]; give the direction in which the support moves")
            object.__setattr__(self, "direction", (self.direction[0] / length, self.direction[1] / length))
        if self.rotation_centre is not None and not (np.isfinite(self.rotation) and self.rotation != 0.0):
            raise ValueError(f"settlement rotation is {self.rotation:g}; with a rotation_centre it must not be zero")
        if self.rotation_centre is None and self.rotation != 0.0:
            raise ValueError("settlement has a rotation but no rotation_centre")
        if self.rotation_centre is not None and self.direction is None:
            object.__setattr__(self, "rotation", float(np.sign(self.rotation)))
        self._check_steps()

    def _check_profile(self) -> None:
        """Scale the profile so that its largest displacement, or angle where nothing is displaced, is 1."""
        if self.direction is not None or self.rotation_centre is not None or self.blocks is not None:
            raise ValueError(
                "a settlement with a profile has its supports and motions; give no direction, centre or blocks"
            )
        motions = {name: np.asarray(motion, dtype=float) for name, motion in (self.profile or {}).items()}
        for name, motion in motions.items():
            if motion.shape != (3,) or not np.isfinite(motion).all():
                raise ValueError(f"settlement profile of '{name}' is {motion.tolist()}; give [dx, dy, rotation]")
        table = np.array(list(motions.values())).reshape(-1, 3)
        largest = float(np.hypot(table[:, 0], table[:, 1]).max(initial=0.0)) or float(
            np.abs(table[:, 2]).max(initial=0)
        )
        if largest == 0.0:
            raise ValueError("the settlement profile moves no support; give one of them a displacement or a rotation")
        # What is scaled already, as when it is read from a summary, keeps its last digits.
        largest = 1.0 if abs(largest - 1.0) < 1e-12 else largest
        scaled = {name: tuple((motion / largest).tolist()) for name, motion in motions.items()}
        object.__setattr__(self, "profile", scaled)

    def _check_steps(self) -> None:
        if self.tolerance is None:
            object.__setattr__(self, "tolerance", self.increment / 100.0)
        for name in ("increment", "limit", "tolerance"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value > 0.0):
                raise ValueError(f"settlement {name} is {value:g}; it must be a positive number")
        for stop in self.stops:
            if not 0.0 <= stop <= self.limit:
                raise ValueError(f"settlement stop {stop:g} is not between 0 and the limit of {self.limit:g}")
        object.__setattr__(self, "stops", tuple(sorted(float(stop) for stop in self.stops)))

    def step_to_stop(self, s: float) -> float:
        """Distance from s to the next stop, infinite after the last; 1e-9 increments before a stop count as on it."""
        return min((stop - s for stop in self.stops if stop - s > 1e-9 * self.increment), default=np.inf)

    @property
    def unit(self) -> str:
        """Unit of the parameter s: "m", or "rad" for a pure rotation."""
        if self.profile is not None:
            return "m" if any(motion[0] or motion[1] for motion in self.profile.values()) else "rad"
        return "rad" if self.direction is None else "m"

    def taking_part(self, assembly: Assembly) -> np.ndarray:
        """(n_blocks,) bool array: the supports that this settlement moves."""
        blocks = self.blocks if self.profile is None else tuple(self.profile)
        if blocks is None:
            return assembly.moving
        chosen = np.zeros(assembly.n_blocks, dtype=bool)
        chosen[[assembly.index(name) for name in blocks]] = True
        return chosen & assembly.moving

    def displaced(self, assembly: Assembly, start: Pose, s: float) -> Pose:
        """Displace the moving supports by s from where they are in ``start``.

        Rotations follow the true arc about the (travelling) centre.
        """
        part = self.taking_part(assembly)
        positions, rotations = start.positions.copy(), start.rotations.copy()
        if self.profile is not None:
            rate = self.rate(assembly, start, s)
            return Pose(positions + s * rate[:, :2], rotations + s * rate[:, 2:])
        travel, angle, centre = self._motion(s)
        turn = rotation_matrices(np.array([[angle]]))[0]
        positions[part] = centre + travel + (start.positions[part] - centre) @ turn.T
        rotations[part] += angle
        return Pose(positions, rotations)

    def rate(self, assembly: Assembly, start: Pose, s: float) -> np.ndarray:
        """(n_blocks, 3) array: velocity of each support per unit of s, at s; zero for other blocks."""
        part = self.taking_part(assembly)
        rate = np.zeros((assembly.n_blocks, 3))
        if self.profile is not None:
            for name, motion in self.profile.items():
                rate[assembly.index(name)] = motion
            return np.where(part[:, None], rate, 0.0)
        _, angle, centre = self._motion(s)
        direction = np.zeros(2) if self.direction is None else np.asarray(self.direction)
        rate[part, :2] = direction
        if self.rotation_centre is not None:
            turn = rotation_matrices(np.array([[angle]]))[0]
            arm = (start.positions[part] - centre) @ turn.T
            rate[part, 0] -= self.rotation * arm[:, 1]
            rate[part, 1] += self.rotation * arm[:, 0]
            rate[part, 2] = self.rotation
        return rate

    def _motion(self, s: float) -> tuple[np.ndarray, float, np.ndarray]:
        travel = np.zeros(2) if self.direction is None else s * np.asarray(self.direction)
        if self.rotation_centre is None:
            return travel, 0.0, np.zeros(2)
        return travel, self.rotation * s, np.asarray(self.rotation_centre)


def _pair(value: Sequence[float], name: str) -> tuple[float, float]:
    pair = np.asarray(value, dtype=float)
    if pair.shape != (2,) or not np.isfinite(pair).all():
        raise ValueError(f"settlement {name} is {value!r}; give two finite numbers [x, y]")
    return float(pair[0]), float(pair[1])


def weight_fraction(assembly: Assembly, fraction: Sequence[float], blocks: np.ndarray | None = None) -> np.ndarray:
    """Load each block with a fraction of its weight, as an earthquake's static stand-in.

    Parameters
    ----------
    assembly : Assembly
    fraction : (2,) sequence
        Of the weight, along x and y: (0.1, 0) pushes to the right with a tenth of the weight.
    blocks : (n,) int or (n_blocks,) bool array, optional
        The blocks it acts on; all by default.

    Returns
    -------
    (n_blocks, 3) array [N, N, N·m]
    """
    load = np.zeros((assembly.n_blocks, 3))
    chosen = slice(None) if blocks is None else blocks
    load[chosen, :2] = (assembly.masses * GRAVITY)[chosen, None] * np.asarray(fraction, dtype=float)
    return load


def point_load(
    assembly: Assembly,
    block: int,
    force: Sequence[float] = (0.0, 0.0),
    *,
    point: Sequence[float] | None = None,
    moment: float = 0.0,
) -> np.ndarray:
    """Load one block with a force at a point, and a moment.

    Parameters
    ----------
    assembly : Assembly
    block : int
    force : (2,) sequence [N]
    point : (2,) sequence [m], optional
        Where the force acts in the drawing; the centroid by default.
    moment : float [N·m]
        Counter-clockwise, besides that of the force.

    Returns
    -------
    (n_blocks, 3) array [N, N, N·m]
    """
    load = np.zeros((assembly.n_blocks, 3))
    arm = np.zeros(2) if point is None else np.asarray(point, dtype=float) - assembly.centroids[block]
    fx, fy = (float(component) for component in force)
    load[block] = fx, fy, moment + arm[0] * fy - arm[1] * fx
    return load


def checked_loads(assembly: Assembly, loads: Loads | None) -> Loads:
    """Check loads for shape and finite numbers; self-weight where none are given."""
    if loads is None:
        return self_weight(assembly)
    for name, given in (("dead", loads.dead), ("live", loads.live)):
        array = np.asarray(given)
        if array.shape != (assembly.n_blocks, 3):
            raise ValueError(f"{name} loads have shape {array.shape}; give ({assembly.n_blocks}, 3): fx, fy, moment")
        if not np.isfinite(array).all():
            block = int(np.flatnonzero(~np.isfinite(array).all(axis=1))[0])
            raise ValueError(f"{name} load on block '{assembly.names[block]}' is {array[block].tolist()}; not finite")
    return loads
