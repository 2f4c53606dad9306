"""Loads on the blocks, and the settlement of the moving supports."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from .assembly import Assembly
from .backfill import Backfill
from .kinematics import Pose, composed_rotations, cross_rows, dimension_of, rotation_count, turned, turned_moments
from .words import Kept, checked, make_plain, numbers_of, plain

#: Acceleration of gravity [m/s²], as structural codes round it.
GRAVITY = 9.81


@dataclass(frozen=True, eq=False)
class Loads:
    """External loads; they keep their direction when the blocks turn.

    Attributes
    ----------
    dead : (n_blocks, n_dof) array [N, N·m]
        Forces and moments about the centroid on each block as drawn, self-weight included: in the plane fx, fy and the
        counter-clockwise moment, in space fx, fy, fz, mx, my, mz.
    live : (n_blocks, n_dof) array [N, N·m]
        Loads that the load multiplier scales; a settlement leaves them out.
    fills : tuple of Backfill
        Fill over the blocks, whose load follows them. It has mass in accelerations of :meth:`with_acceleration` alone.
    dead_arms, live_arms : (n_blocks, d, d) array, optional [N·m]
        Sums of arm ⊗ force over the forces whose points turn with their block, as :meth:`with_forces` adds them. All
        other moments stay as they are.
    dead_acceleration, live_acceleration : (n_blocks, d) array, optional
        Of the fill over each block, in units of gravity, as :meth:`with_acceleration` adds them.
    """

    dead: np.ndarray
    live: np.ndarray
    fills: tuple[Backfill, ...] = ()
    dead_arms: np.ndarray | None = None
    live_arms: np.ndarray | None = None
    dead_acceleration: np.ndarray | None = None
    live_acceleration: np.ndarray | None = None

    def dead_at(self, assembly: Assembly, pose: Pose) -> np.ndarray:
        """(n_blocks, n_dof) array: dead load where the blocks are, with that of the fill."""
        return sum((fill.load(assembly, pose) for fill in self.fills), self._at("dead", assembly, pose))

    def live_at(self, assembly: Assembly, pose: Pose) -> np.ndarray:
        """(n_blocks, n_dof) array: live load where the blocks are, with what an acceleration does to the fill."""
        return self._at("live", assembly, pose)

    def _at(self, kind: str, assembly: Assembly, pose: Pose) -> np.ndarray:
        load, arms, acceleration = (getattr(self, kind + of) for of in ("", "_arms", "_acceleration"))
        load = load if arms is None else load + turned_moments(arms, pose)
        if acceleration is None:
            return np.asarray(load)
        return sum((fill.load(assembly, pose, acceleration) for fill in self.fills), load)

    def without(self, fallen: np.ndarray) -> Loads:
        """Return the loads once blocks, (n_blocks,) bool array, have left with their dead load and fill."""
        arms = None if self.dead_arms is None else np.where(fallen[:, None, None], 0.0, self.dead_arms)
        fills = tuple(fill.without(fallen) for fill in self.fills)
        return replace(self, dead=np.where(fallen[:, None], 0.0, self.dead), dead_arms=arms, fills=fills)

    def with_forces(self, assembly: Assembly, forces: PointForces, kind: str = "dead") -> Loads:
        """Add forces at points that go with their blocks to the dead or, by ``kind``, the live loads."""
        load = checked(forces, PointForces, "forces").load(assembly)
        return self._plus(kind, load, "arms", forces.arms(assembly))

    def with_acceleration(
        self, assembly: Assembly, fraction: Sequence[float], kind: str = "live", blocks: ArrayLike | None = None
    ) -> Loads:
        """Add :func:`weight_fraction` of the blocks, and of the fill over them, to the dead or live loads."""
        load, of_fill = weight_fraction(assembly, fraction, blocks), np.zeros_like(assembly.centroids)
        of_fill[chosen_blocks(assembly, blocks)] = fraction
        return self._plus(kind, load, "acceleration", of_fill)

    def _plus(self, kind: str, load: np.ndarray, beside: str, more: np.ndarray) -> Loads:
        if kind not in ("dead", "live"):
            raise ValueError(f"kind of the load is {kind!r}; it is 'dead' or 'live'")
        name = f"{kind}_{beside}"
        return replace(self, **{kind: getattr(self, kind) + load, name: added(getattr(self, name), more)})

    def note_on_mass(self, assembly: Assembly) -> str:
        """Say how large dead loads are, downwards, on blocks whose only live load is an acceleration; else nothing."""
        weights, down = assembly.masses * GRAVITY, assembly.dimension - 1
        none = np.zeros_like(assembly.centroids)
        pushed, heavier = (
            none if given is None else given for given in (self.live_acceleration, self.dead_acceleration)
        )
        alone = np.isclose(self.live[:, : assembly.dimension], weights[:, None] * pushed).all(axis=1)
        beyond = -self.dead[:, down] - weights * (1.0 - heavier[:, down])
        large = (beyond * (alone & pushed[:, :down].any(axis=1) & assembly.free)).clip(0.0).sum()
        if large <= 1e-9 * weights.sum():
            return ""
        return (
            f"the acceleration acts on the blocks and the fill over them; {large:.6g} N of other dead loads on them "
            "have no mass: where they have, give them as live loads, too"
        )


def self_weight(assembly: Assembly) -> Loads:
    """Self-weight of all blocks as dead load, along -y in the plane and -z in space; no live load.

    Examples
    --------
    >>> import solver
    >>> block = solver.Assembly.from_outlines([[[0, 0], [1, 0], [1, 1], [0, 1]]], density=2000.0)
    >>> float(solver.self_weight(block).dead[0, 1])
    -19620.0
    """
    dead = _no_load(assembly)
    dead[:, assembly.dimension - 1] = -assembly.masses * GRAVITY
    return Loads(dead, np.zeros_like(dead))


@dataclass(frozen=True, eq=False)
class PointForces(Kept):
    """Forces at points of blocks, which go with them.

    Attributes
    ----------
    block : (n,) int array
    force : (n, d) array [N]
    point : (n, d) array [m]
        In the drawing.
    """

    block: np.ndarray
    force: np.ndarray
    point: np.ndarray

    @classmethod
    def at(cls, block: int, force: Sequence[float] | np.ndarray, point: Sequence[float] | np.ndarray) -> PointForces:
        """Return one force."""
        return cls(np.array([plain(block, "int", "block")]), numbers_of([force], "force"), numbers_of([point], "point"))

    def arms(self, assembly: Assembly) -> np.ndarray:
        """(n_blocks, d, d) array [N·m]: sums of arm from the centroid ⊗ force."""
        arms = np.zeros((assembly.n_blocks, assembly.dimension, assembly.dimension))
        from_centroid = self.point - assembly.centroids[self.block]
        np.add.at(arms, self.block, from_centroid[:, :, None] * self.force[:, None, :])
        return arms

    def load(self, assembly: Assembly) -> np.ndarray:
        """(n_blocks, n_dof) array [N, N·m]: of the blocks as drawn."""
        load, d = _no_load(assembly), assembly.dimension
        chosen_blocks(assembly, self.block)
        for name, given in (("force", self.force), ("point", self.point)):
            if given.shape != (self.block.size, d):
                raise ValueError(f"a {name} is {np.squeeze(given).tolist()}; give {d} numbers per block, one per axis")
        arms = cross_rows(self.point - assembly.centroids[self.block])
        np.add.at(load, self.block, np.hstack([self.force, np.einsum("nrd,nd->nr", arms, self.force)]))
        return load


def added(one: np.ndarray | None, other: np.ndarray | None) -> np.ndarray | None:
    """Add what may not be there."""
    return other if one is None else one if other is None else one + other


@dataclass(frozen=True)
class Settlement:
    """One-parameter rigid motion of the moving supports.

    Attributes
    ----------
    direction : (d,) sequence, optional
        Direction of the translation; only its direction counts, the parameter s is the distance [m].
    rotation_centre : (d,) sequence [m], optional
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
    rotation_axis : (3,) sequence, optional
        In space, the axis about which the supports turn, counter-clockwise seen from its tip.
    radial_from : (2,) sequence [m], optional
        In space, instead of a direction: x and y of a vertical axis from which each support moves away, level.
    profile : mapping of str to (n_dof,) sequence, optional [m and rad]
        Instead of one motion for all: how each support, by its name, moves and turns about its own centroid, or
        where its arm ends. Only the proportions count: s is the largest displacement of such a point, or the largest
        angle where none moves, unless ``profile_depth`` says which displacement it is.
    profile_arms : mapping of str to (d,) sequence, optional [m]
        From the centroid of a support, as drawn, to the point that moves by the profile, and about which it turns.
    profile_depth : float, optional
        Displacement in the proportions of the profile that is s.

    Raises
    ------
    ValueError
        For what does not make up one motion, or has numbers that are not finite.
    """

    direction: Sequence[float] | None = None
    rotation_centre: Sequence[float] | None = None
    rotation: float = 0.0
    increment: float = 0.01
    limit: float = 1.0
    tolerance: float | None = None
    blocks: Sequence[str] | None = None
    stops: Sequence[float] = ()
    rotation_axis: Sequence[float] | None = None
    radial_from: Sequence[float] | None = None
    profile: Mapping[str, Sequence[float]] | None = None
    profile_arms: Mapping[str, Sequence[float]] | None = None
    profile_depth: float | None = None

    def __post_init__(self) -> None:
        """Check the values; make the direction a unit vector, and the rotation without one a sign."""
        make_plain(self)
        if self.profile is not None or self.profile_arms is not None:
            self._check_profile()
        elif self.direction is None and self.rotation_centre is None and self.radial_from is None:
            raise ValueError("a settlement needs a direction, or a rotation_centre and rotation")
        counts = {"direction": (2, 3), "rotation_centre": (2, 3), "rotation_axis": (3,), "radial_from": (2,)}
        units = {"direction": "direction in which the support moves", "rotation_axis": "axis about which it turns"}
        set_vectors(self, "settlement", counts, units)
        if self.radial_from is not None and (self.direction is not None or self.rotation_centre is not None):
            raise ValueError("a settlement with radial_from has neither direction nor rotation_centre; leave them out")
        turns_in_space = self.rotation_centre is not None and len(self.rotation_centre) == 3
        if turns_in_space != (self.rotation_axis is not None):
            raise ValueError(
                "in space a rotation needs rotation_centre = [x, y, z] and rotation_axis = [x, y, z], the axis about "
                "which the supports turn; in the plane only rotation_centre = [x, y]"
            )
        if self.rotation_centre is not None and not (np.isfinite(self.rotation) and self.rotation != 0.0):
            raise ValueError(f"settlement rotation is {self.rotation:g}; with a rotation_centre it must not be zero")
        if self.rotation_centre is None and self.rotation != 0.0:
            raise ValueError("settlement has a rotation but no rotation_centre")
        if self.rotation_centre is not None and self.direction is None:
            object.__setattr__(self, "rotation", float(np.sign(self.rotation)))
        check_steps(self, "settlement")
        for stop in self.stops:
            if not 0.0 <= stop <= self.limit:
                raise ValueError(f"settlement stop {stop:g} is not between 0 and the limit of {self.limit:g}")
        object.__setattr__(self, "stops", tuple(sorted(self.stops)))

    def _check_profile(self) -> None:
        """Scale the profile so that its largest displacement, or angle where nothing is displaced, is 1."""
        if any(given is not None for given in (self.direction, self.rotation_centre, self.radial_from, self.blocks)):
            raise ValueError(
                "a settlement with a profile has its supports and motions; give no direction, centre or blocks"
            )
        motions = self._profile_motions()
        table = np.abs(list(motions.values())).reshape(len(motions), -1 if motions else 3)
        d = dimension_of(table.shape[1])
        travel, turn = (np.hypot.reduce(part, axis=1) for part in (table[:, :d], table[:, d:]))
        largest = float(travel.max(initial=0.0)) or float(turn.max(initial=0.0))
        if largest == 0.0:
            raise ValueError("the settlement profile moves no support; give one of them a displacement or a rotation")
        if self.profile_depth is not None:
            if not (np.isfinite(self.profile_depth) and self.profile_depth > 0.0):
                raise ValueError(f"settlement profile_depth is {self.profile_depth:g}; it must be a positive number")
            largest = self.profile_depth
            object.__setattr__(self, "profile_depth", 1.0)
        scaled = {name: tuple((motion / _scale(largest)).tolist()) for name, motion in motions.items()}
        object.__setattr__(self, "profile", scaled)
        arms = {name: numbers_of(arm, f"profile_arms of '{name}'") for name, arm in (self.profile_arms or {}).items()}
        for name, arm in arms.items():
            if name not in scaled or arm.shape != (d,) or not np.isfinite(arm).all():
                raise ValueError(f"profile_arms of '{name}' are {arm.tolist()}; give {d} numbers, of a moving support")
        object.__setattr__(self, "profile_arms", {name: tuple(arm.tolist()) for name, arm in arms.items()} or None)

    def _profile_motions(self) -> dict[str, np.ndarray]:
        """Read the motion of each support in the profile, (3,) or (6,) alike; raises ``ValueError`` otherwise."""
        given = (self.profile or {}).items()
        motions = {name: numbers_of(motion, f"settlement profile of '{name}'") for name, motion in given}
        shapes = [motion.shape for motion in motions.values()]
        for name, motion in motions.items():
            if motion.shape not in ((3,), (6,)) or motion.shape != shapes[0] or not np.isfinite(motion).all():
                wanted = "[dx, dy, rotation], in space [dx, dy, dz, rx, ry, rz]"
                raise ValueError(f"settlement profile of '{name}' is {motion.tolist()}; give {wanted}")
        return motions

    @property
    def unit(self) -> str:
        """Unit of the parameter s: "m", or "rad" for a pure rotation."""
        if self.profile is not None:
            travels = (motion[: dimension_of(len(motion))] for motion in self.profile.values())
            return "m" if any(map(any, travels)) else "rad"
        return "rad" if self.direction is None and self.radial_from is None else "m"

    def taking_part(self, assembly: Assembly) -> np.ndarray:
        """(n_blocks,) bool array: the supports that this settlement moves."""
        blocks = self.blocks if self.profile is None else tuple(self.profile)
        if blocks is None:
            return assembly.moving
        return chosen_blocks(assembly, [assembly.index(name) for name in blocks]) & assembly.moving

    def displaced(self, assembly: Assembly, start: Pose, s: float) -> Pose:
        """Displace the moving supports by s from where they are in ``start``.

        Rotations follow the true arc about the (travelling) centre.
        """
        part = self.taking_part(assembly)
        positions, rotations = start.positions.copy(), start.rotations.copy()
        travel, angle, centre = self._motion(assembly, start, part, s)
        turn = np.broadcast_to(angle, rotations[part].shape)
        positions[part] = centre + travel + turned(start.positions[part] - centre, turn)
        rotations[part] = composed_rotations(start.rotations[part], turn)
        return Pose(positions, rotations)

    def rate(self, assembly: Assembly, start: Pose, s: float) -> np.ndarray:
        """(n_blocks, n_dof) array: velocity of each support per unit of s, at s; zero for other blocks."""
        part, d = self.taking_part(assembly), assembly.dimension
        rate = _no_load(assembly)
        _, angle, centre = self._motion(assembly, start, part, s)
        rate[part, :d], rate[part, d:], _ = self._motion(assembly, start, part, 1.0)
        arm = turned(start.positions[part] - centre, np.broadcast_to(angle, rate[part, d:].shape))
        rate[part, :d] += np.einsum("nrd,nr->nd", cross_rows(arm), rate[part, d:])
        return rate

    def check_dimension(self, assembly: Assembly) -> None:
        """Raise ``ValueError`` where the numbers are for the plane and the blocks in space, or the other way round."""
        if self.radial_from is not None and assembly.dimension == 2:
            raise ValueError("settlement has radial_from, and the blocks are in the plane: give a direction [x, y]")
        given = {"direction": self.direction, "rotation_centre": self.rotation_centre}
        check_fits(assembly, "settlement", given)
        motions = {f"profile of '{name}'": motion for name, motion in (self.profile or {}).items()}
        check_fits(assembly, "settlement", motions, ("[dx, dy, rotation]", "[dx, dy, dz, rx, ry, rz]"))

    def _motion(
        self, assembly: Assembly, start: Pose, part: np.ndarray, s: float
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Give the translation, the rotation vector and its centre at s, each one or a row for each of the supports."""
        d = assembly.dimension
        if self.profile is not None:
            names, arms = [assembly.names[k] for k in np.flatnonzero(part)], self.profile_arms or {}
            motion = s * np.reshape([self.profile[name] for name in names], (len(names), d + rotation_count(d)))
            arm = np.reshape([arms.get(name, (0.0,) * d) for name in names], (len(names), d))
            return motion[:, :d], motion[:, d:], start.positions[part] + turned(arm, start.rotations[part])
        travel, angle = np.zeros(d), np.zeros(rotation_count(d))
        if self.direction is not None:
            travel = s * np.asarray(self.direction)
        if self.radial_from is not None:
            away = start.positions[part].copy()
            away[:, :2] -= self.radial_from
            away[:, 2] = 0.0
            far = np.linalg.norm(away, axis=1)
            for block in np.flatnonzero(part)[far < 1e-9 * assembly.block_size]:
                raise ValueError(
                    f"support '{assembly.names[block]}' stands on the axis of radial_from, from which it is to move "
                    "away; leave it out of the settlement's blocks"
                )
            travel = s * away / far[:, None]
        if self.rotation_centre is None:
            return travel, angle, np.zeros(d)
        axis = np.ones(1) if self.rotation_axis is None else np.asarray(self.rotation_axis)
        return travel, self.rotation * s * axis, np.asarray(self.rotation_centre)


@dataclass(frozen=True)
class ControlDisplacement:
    """The control displacement of a pushover analysis.

    Attributes
    ----------
    block : str
        Name of a free block.
    direction : (d,) sequence, optional
        Direction in which the displacement counts; only its direction matters. Along x by default.
    point : (d,) sequence, optional [m]
        A point of the block, in the drawing; its centroid by default.
    increment : float [m]
        Largest step.
    limit : float [m]
        Largest control displacement.
    tolerance : float, optional [m]
        Width of the bracket of the displacement at the end; a hundredth of the increment by default.
    """

    block: str
    direction: Sequence[float] | None = None
    point: Sequence[float] | None = None
    increment: float = 0.01
    limit: float = 1.0
    tolerance: float | None = None
    #: Of the control displacement.
    unit: ClassVar[str] = "m"

    def __post_init__(self) -> None:
        """Check the numbers; the direction becomes a unit vector."""
        make_plain(self)
        units = {"direction": "direction in which the displacement counts"}
        set_vectors(self, "control", {"direction": (2, 3), "point": (2, 3)}, units)
        check_steps(self, "control")

    def check_dimension(self, assembly: Assembly) -> None:
        """Raise ``ValueError`` where the numbers are for the plane and the blocks in space, or the other way round."""
        check_fits(assembly, "control", {"direction": self.direction, "point": self.point})


def check_steps(path: Any, what: str) -> None:
    """Check the increment, limit and tolerance of what drives a path; a tolerance not given is made from the first."""
    if path.tolerance is None:
        object.__setattr__(path, "tolerance", path.increment / 100.0)
    for name in ("increment", "limit", "tolerance"):
        value = getattr(path, name)
        if not (np.isfinite(value) and value > 0.0):
            raise ValueError(f"{what} {name} is {value:g}; it must be a positive number")
    # Paths take parameters that differ by no more for the same; none has the increments to come where the default does.
    if path.tolerance < (least := min(1e-12 * path.limit, path.increment / 100.0)):
        part = f"less than 1e-12 of its limit of {path.limit:g}"
        raise ValueError(f"{what} tolerance is {path.tolerance:g}, {part}; give at least {1.1 * least:.2g}")


def _scale(length: float) -> float:
    """Give 1 for what is scaled already, as when it is read from a summary: it keeps its last digits."""
    return 1.0 if abs(length - 1.0) < 1e-12 else length


def set_vectors(owner: Any, what: str, counts: Mapping[str, tuple[int, ...]], units: Mapping[str, str]) -> None:
    """Make tuples of numbers of the vectors of a dataclass, by how many they may be, and unit vectors of directions."""
    for name, count in counts.items():
        value = getattr(owner, name)
        if value is None:
            continue
        vector = numbers_of(value, f"{what} {name}")
        if vector.ndim != 1 or len(vector) not in count or not np.isfinite(vector).all():
            wanted = "two finite numbers [x, y]" if count[0] == 2 else "three finite numbers [x, y, z]"
            more = ", or in space three, [x, y, z]" if count == (2, 3) else ""
            raise ValueError(f"{what} {name} is {value!r}; give {wanted}{more}")
        if name in units:
            length = float(np.hypot(*vector)) if len(vector) == 2 else float(np.linalg.norm(vector))
            if length == 0.0:
                raise ValueError(f"{what} {name} is {[0] * len(vector)}; give the {units[name]}")
            vector = vector / _scale(length)
        object.__setattr__(owner, name, tuple(vector.tolist()))


def check_fits(
    assembly: Assembly,
    what: str,
    given: Mapping[str, Sequence[float] | None],
    wanted: tuple[str, str] = ("[x, y]", "[x, y, z]"),
) -> None:
    """Refuse vectors, by their names, that are for the plane where the blocks are in space, or the other way round."""
    fitting = wanted[assembly.dimension - 2]
    for name, vector in given.items():
        if vector is not None and len(vector) != fitting.count(",") + 1:
            where = "in the plane" if assembly.dimension == 2 else "in space"
            raise ValueError(f"{what} {name} is {list(vector)}, and the blocks are {where}: give {fitting}")


def _no_load(assembly: Assembly) -> np.ndarray:
    """(n_blocks, n_dof) array of zeros."""
    return np.zeros((assembly.n_blocks, assembly.dimension + rotation_count(assembly.dimension)))


def chosen_blocks(assembly: Assembly, blocks: Any) -> np.ndarray:
    """(n_blocks,) bool array: blocks that are given by their numbers, or as such an array; all by None."""
    chosen = np.zeros(assembly.n_blocks, dtype=bool)
    try:
        chosen[list(blocks) if isinstance(blocks, tuple) else blocks] = True
    except IndexError:
        last = assembly.n_blocks - 1
        raise ValueError(
            f"there are no blocks {blocks}; give numbers from 0 to {last}, assembly.index finds them"
        ) from None
    return chosen


def weight_fraction(assembly: Assembly, fraction: Sequence[float], blocks: ArrayLike | None = None) -> np.ndarray:
    """Load each block with a fraction of its weight, as an earthquake's static stand-in.

    Parameters
    ----------
    assembly : Assembly
    fraction : (d,) sequence
        Of the weight, along x, y and in space z: (0.1, 0) pushes to the right with a tenth of the weight.
    blocks : (n,) int or (n_blocks,) bool array, optional
        The blocks it acts on; all by default.

    Returns
    -------
    (n_blocks, n_dof) array [N, N·m]
        Of the blocks; fill over them has its part by :meth:`Loads.with_acceleration`.
    """
    load, parts, d = _no_load(assembly), numbers_of(fraction, "a fraction of the weight"), assembly.dimension
    if parts.shape != (d,):
        raise ValueError(f"a fraction of the weight is {parts.tolist()}; give {d} numbers, one per axis")
    load[:, :d] = (assembly.masses * GRAVITY * chosen_blocks(assembly, blocks))[:, None] * parts
    return load


def point_load(
    assembly: Assembly,
    block: int,
    force: Sequence[float] | None = None,
    *,
    point: Sequence[float] | None = None,
    moment: float | Sequence[float] = 0.0,
) -> np.ndarray:
    """Load one block with a force at a point, and a moment.

    Parameters
    ----------
    assembly : Assembly
    block : int
    force : (d,) sequence [N], optional
    point : (d,) sequence [m], optional
        Where the force acts in the drawing; the centroid by default.
    moment : float or, in space, (3,) sequence [N·m]
        Counter-clockwise, besides that of the force.

    Returns
    -------
    (n_blocks, n_dof) array [N, N·m]
        Of the block as drawn: with :meth:`Loads.with_forces` the point goes with its block.
    """
    load, d = _no_load(assembly), assembly.dimension
    chosen_blocks(assembly, block)
    turn = numbers_of(moment, "moment")
    fits = turn.shape == (rotation_count(d),) or (turn.ndim == 0 and (d == 2 or turn == 0.0))
    if not (fits and np.isfinite(turn).all()):
        where, wanted = ("in the plane", "one number") if d == 2 else ("in space", "three numbers, about x, y and z")
        raise ValueError(f"a moment {where} is {moment!r}; give {wanted}")
    load[block, d:] = turn
    acts, at = np.zeros(d) if force is None else force, assembly.centroids[block] if point is None else point
    return load + PointForces.at(block, acts, at).load(assembly)


def checked_loads(assembly: Assembly, loads: Loads | None) -> Loads:
    """Check loads for shape and finite numbers; self-weight where none are given."""
    if loads is None:
        return self_weight(assembly)
    shape, loads = _no_load(assembly).shape, checked(loads, Loads, "loads")
    components = "fx, fy, moment" if assembly.dimension == 2 else "fx, fy, fz, mx, my, mz"
    of_arms = (*assembly.centroids.shape, assembly.dimension), "arm ⊗ force"
    of_fill = assembly.centroids.shape, "one number per axis, in units of gravity"
    wanted = {"": (shape, components), "_arms": of_arms, "_acceleration": of_fill}
    arrays: dict[str, Any] = {}
    for name, (size, words) in ((kind + of, values) for of, values in wanted.items() for kind in ("dead", "live")):
        if (given := getattr(loads, name)) is None and "_" in name:
            continue
        arrays[name] = array = numbers_of(given, f"{name} loads")
        if array.shape != size:
            are = "are None" if given is None else f"have shape {array.shape}"
            raise ValueError(f"{name} loads {are}; give {size}: {words}")
        if not (finite := np.isfinite(array.reshape(len(array), -1)).all(axis=1)).all():
            block = int(finite.argmin())
            raise ValueError(f"{name} load on block '{assembly.names[block]}' is {array[block].tolist()}; not finite")
    for fill in loads.fills:
        chosen_blocks(assembly, checked(fill, Backfill, "one of the fills").block)
    return replace(loads, **arrays)
