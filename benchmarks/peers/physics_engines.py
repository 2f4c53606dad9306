"""Physics engines that push the supports of an assembly slowly: pymunk, MuJoCo and LMGC90.

Each is a generator of samples (displacement of the moving supports, centroids of all blocks, force of the structure on
the moving supports), so that whoever looks at them decides when to stop. The settings are those of somebody who knows
the engine and wants statics from it: exact outlines, contacts as stiff as the time step allows, no restitution,
converged contact solvers, and the supports at rest for ``REST`` before they move as a ``Drive`` says.
"""

from __future__ import annotations

import importlib
import multiprocessing
import multiprocessing.connection
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from math import cos, inf, sin
from typing import Any

import numpy as np
import shapely

import solver
from blockvis.layout.layout import layout_of

__all__ = ["ENGINES", "IN_SPACE", "Drive", "Sample", "are_convex", "convex_pieces", "in_a_process"]

#: Time at rest before the supports move, and between two samples [s]; forces are means between samples.
REST = 0.3
SAMPLING = 0.01

#: How LMGC90 calls a contact of its law of Mohr and Coulomb that has not broken, as far as compas_lmgc90 hands it on.
WHOLE = "Mst"


@dataclass(frozen=True)
class Drive:
    """How supports move.

    Attributes
    ----------
    direction : (2,), or in space (n_blocks, 3), array or sequence
        In space a row for each block. A single number, 1 or -1, stands for ground that turns, counter-clockwise or
        clockwise: it stays, and gravity turns the other way, so that blocks are seen from the ground.
    speed : float [m/s, or rad/s where the ground turns]
    slow, slow_from : float
        The speed from a displacement on: what falls takes time, in which fast supports go on.
    ramp : float [s]
        Time in which the speed is reached: a jolt breaks what is brittle.
    """

    direction: Any
    speed: float
    slow: float = 0.0
    slow_from: float = inf
    ramp: float = 0.0

    @property
    def slows_at(self) -> float:
        """When the slower speed begins [s]; a ramp ends before."""
        return self.slow_from / self.speed + self.ramp / 2.0

    def at(self, clock: float) -> tuple[float, float]:
        """Displacement and speed at a time since the supports began to move [s]."""
        if 0.0 <= clock < self.ramp:
            speed = self.speed * clock / self.ramp
            return speed * clock / 2.0, speed
        if clock < self.slows_at:
            return self.speed * max(clock - self.ramp / 2.0, 0.0), self.speed if clock > -1e-9 else 0.0
        return self.slow_from + self.slow * (clock - self.slows_at), self.slow

    @property
    def turns(self) -> bool:
        return np.ndim(self.direction) == 0

    def gravity(self, clock: float) -> tuple[float, float]:
        """Acceleration in the plane as the ground sees it [m/s²]."""
        angle = self.direction * self.at(clock)[0] if self.turns else 0.0
        return -solver.GRAVITY * sin(angle), -solver.GRAVITY * cos(angle)


@dataclass(frozen=True)
class Sample:
    """What an engine shows at one time.

    Attributes
    ----------
    time : float [s]
        Since the supports began to move; negative before.
    displacement : float [m, or rad]
        Of the moving supports.
    positions : (n_blocks, 2) array [m]
        Centroids.
    force : (2,) array [N]
        Of the structure on the moving supports, mean since the last sample.
    ties : (n_ties,) array [N]
        Their tension, mean since the last sample.
    whole : float
        Part of the contact points at rest whose mortar has not broken.
    """

    time: float
    displacement: float
    positions: np.ndarray
    force: np.ndarray
    ties: np.ndarray = field(default_factory=lambda: np.zeros(0))
    whole: float = 0.0


def convex_pieces(outline: np.ndarray) -> list[np.ndarray]:
    """An outline, (n, 2), in triangles where it is not convex: engines take the convex hull of a shape."""
    polygon = shapely.Polygon(outline)
    if np.isclose(polygon.area, polygon.convex_hull.area):
        return [outline]
    triangles = shapely.constrained_delaunay_triangles(polygon)
    return [np.array(triangle.exterior.coords)[:-1] for triangle in shapely.orient_polygons(triangles).geoms]


def are_convex(assembly: solver.Assembly) -> bool:
    """Whether all blocks of an assembly in the plane are convex."""
    return all(len(convex_pieces(assembly.outline(i))) == 1 for i in range(assembly.n_blocks))


def pymunk_path(
    assembly: solver.Assembly, drive: Drive, time_step: float, friction: float, sampling: float
) -> Iterator[Sample]:
    """Chipmunk: sequential impulses in two dimensions; polygons of zero radius."""
    import pymunk

    space = pymunk.Space()
    space.iterations = 200
    space.collision_slop = 1e-5 * assembly.block_size  # 0.1 by default, made for pixels
    bodies = []
    for i in range(assembly.n_blocks):
        outline = [tuple(map(float, p)) for p in assembly.outline(i) - assembly.centroids[i]]
        if assembly.free[i]:
            mass = float(assembly.masses[i])
            body = pymunk.Body(mass, pymunk.moment_for_poly(mass, outline))
        else:
            body = pymunk.Body(body_type=pymunk.Body.KINEMATIC)
        body.position = tuple(map(float, assembly.centroids[i]))
        space.add(body)
        bodies.append(body)
        for piece in convex_pieces(assembly.outline(i) - assembly.centroids[i]):
            shape = pymunk.Poly(body, piece.tolist(), radius=0.0)
            shape.friction = friction**0.5  # Chipmunk multiplies those of both shapes
            space.add(shape)
    moving = np.flatnonzero(assembly.moving)
    impulse = np.zeros(2)

    def gather(arbiter: pymunk.Arbiter, body: pymunk.Body) -> None:
        impulse[:] += np.array(arbiter.total_impulse)  # on the body by which the arbiter was asked for

    per_sample = max(1, round(sampling / time_step))
    start, along = assembly.centroids[moving[0]], np.zeros(2) if drive.turns else np.array(drive.direction)
    for sample in range(10**9):
        clock = sample * per_sample * time_step - REST
        for i in moving:
            bodies[i].velocity = tuple(map(float, drive.at(clock)[1] * along))
        impulse[:] = 0.0
        for step in range(per_sample):
            space.gravity = drive.gravity(clock + step * time_step)
            space.step(time_step)
            for i in moving:
                bodies[i].each_arbiter(gather, bodies[i])
        positions = np.array([tuple(body.position) for body in bodies])
        clock += per_sample * time_step
        displacement = drive.at(clock)[0] if drive.turns else float((positions[moving[0]] - start) @ along)
        yield Sample(clock, displacement, positions, impulse / (per_sample * time_step))


def mujoco_path(
    assembly: solver.Assembly,
    drive: Drive,
    time_step: float,
    friction: float,
    sampling: float,
    ties: Sequence[solver.Tie] = (),
) -> Iterator[Sample]:
    """MuJoCo: convex contact optimisation; prisms whose bodies have the three joints of plane motion.

    Ties are spatial tendons that pull only; what yields at its strength has its length without force moved on.
    """
    import mujoco

    meshes, bodies = [], []
    half = float(np.max(assembly.thickness)) / 2.0
    for i in range(assembly.n_blocks):
        pieces = convex_pieces(assembly.outline(i) - assembly.centroids[i])
        for k, piece in enumerate(pieces):
            corners = [(x, y, z) for z in (-half, half) for x, y in piece]
            places = " ".join(f"{c:.17g}" for p in corners for c in p)
            meshes.append(f'<mesh name="m{i}-{k}" inertia="exact" vertex="{places}"/>')
        x, y = assembly.centroids[i]
        joints = ""
        if assembly.free[i]:
            joints = (
                '<joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 1 0"/><joint type="hinge" axis="0 0 1"/>'
            )
        elif assembly.moving[i] and not drive.turns:
            # so heavy that contact forces do not slow it down; a mocap body would move without dragging anything along
            x_axis, y_axis = drive.direction
            joints = f'<joint name="drive{i}" type="slide" axis="{x_axis} {y_axis} 0" armature="1e8"/>'
        # supports meet blocks, not each other
        meets = 1 if assembly.free[i] else 0
        gravity = "" if assembly.free[i] else ' gravcomp="1"'
        geoms = "".join(
            f'<geom type="mesh" mesh="m{i}-{k}" contype="1" conaffinity="{meets}"/>' for k in range(len(pieces))
        )
        bodies.append(
            f'<body name="b{i}" pos="{x:.17g} {y:.17g} 0"{gravity}>{joints}{geoms}{_sites(assembly, ties, i)}</body>'
        )
    tendons = "".join(
        f'<spatial stiffness="{tie.stiffness:.17g}" springlength="0 {np.ptp(tie.points, axis=0) @ _along(tie):.17g}">'
        f'<site site="t{k}a"/><site site="t{k}b"/></spatial>'
        for k, tie in enumerate(ties)
    )
    model = _mujoco_model(assembly, meshes, bodies, f"0 {-solver.GRAVITY} 0", time_step, friction, tendons)
    data = mujoco.MjData(model)
    stiffness, strength = (np.array([getattr(tie, what) for tie in ties]) for what in ("stiffness", "strength"))
    pulled = np.zeros(len(ties))
    moving = np.flatnonzero(assembly.moving)
    drives = [] if drive.turns else [model.joint(f"drive{i}") for i in moving]
    ids = np.array([model.body(f"b{i}").id for i in range(assembly.n_blocks)])
    is_moving = np.zeros(model.nbody, dtype=bool)
    is_moving[ids[moving]] = True
    per_sample = max(1, round(sampling / time_step))
    wrench, force = np.zeros(6), np.zeros(2)
    for sample in range(10**9):
        clock = sample * per_sample * time_step - REST
        force[:], pulled[:] = 0.0, 0.0
        for step in range(per_sample):
            model.opt.gravity[:2] = drive.gravity(clock + step * time_step)
            for joint in drives:
                data.qpos[joint.qposadr[0]], data.qvel[joint.dofadr[0]] = drive.at(clock + step * time_step)
            mujoco.mj_step(model, data)
            if ties:
                rest = model.tendon_lengthspring[:, 1]
                pulled += np.clip(stiffness * (data.ten_length - rest), 0.0, strength)
                # Lengths are those at the start of the step.
                ends = data.ten_length + time_step * data.ten_velocity
                rest[:] = np.maximum(rest, ends - strength / stiffness)
            touching = is_moving[model.geom_bodyid[data.contact.geom]]
            for k in np.flatnonzero(touching.any(axis=1)):
                mujoco.mj_contactForce(model, data, k, wrench)
                # the frame's first axis points from the first geom to the second, on which the force acts
                on_second = data.contact.frame[k].reshape(3, 3).T @ wrench[:3]
                force += on_second[:2] if touching[k, 1] else -on_second[:2]
        clock += per_sample * time_step
        yield Sample(clock, drive.at(clock)[0], data.xpos[ids, :2].copy(), force / per_sample, pulled / per_sample)


def _along(tie: solver.Tie) -> np.ndarray:
    """(2,) array: absolute parts of the direction of a tie."""
    span = np.ptp(tie.points, axis=0)
    return np.asarray(span / np.linalg.norm(span))


def _sites(assembly: solver.Assembly, ties: Sequence[solver.Tie], block: int) -> str:
    """The ends of ties that a block holds."""
    held = ((k, e) for k, tie in enumerate(ties) for e in (0, 1) if tie.blocks[e] == block)
    at = ((f"t{k}{'ab'[e]}", np.asarray(ties[k].points[e]) - assembly.centroids[block]) for k, e in held)
    return "".join(f'<site name="{name}" pos="{x:.17g} {y:.17g} 0"/>' for name, (x, y) in at)


def _mujoco_model(
    assembly: solver.Assembly,
    meshes: list[str],
    bodies: list[str],
    gravity: str,
    time_step: float,
    friction: float,
    tendons: str = "",
) -> Any:
    import mujoco

    density = float(np.unique(assembly.density)[0])
    # hard friction keeps an arch from creeping (with 10 it falls 1 % early); a panel of bricks it throws apart
    impratio = 100 if assembly.n_blocks < 50 else 10
    model = mujoco.MjModel.from_xml_string(
        f"""<mujoco>
        <option timestep="{time_step}" gravity="{gravity}" cone="elliptic" impratio="{impratio}"
                solver="Newton" iterations="200" tolerance="1e-12" integrator="implicitfast">
          <flag nativeccd="enable"/></option>
        <default><geom condim="3" friction="{friction} 0 0" density="{density}"
                 solref="{2 * time_step} 1" solimp="0.99 0.9999 1e-5"/></default>
        <asset>{"".join(meshes)}</asset><worldbody>{"".join(bodies)}</worldbody>
        <tendon>{tendons}</tendon></mujoco>"""
    )
    # several contact points where faces meet: to be asked for up to some version, the default in later ones
    model.opt.enableflags |= int(getattr(mujoco.mjtEnableBit, "mjENBL_MULTICCD", 0))
    return model


def _strips(outline: np.ndarray, width: float, gap: float) -> list[np.ndarray]:
    """An upright rectangle cut into strips of about a width with gaps between; any other outline as it is."""
    (left, low), (right, high) = outline.min(axis=0), outline.max(axis=0)
    n = round(float(right - left) / width)
    area = np.sum(outline[:, 0] * np.roll(outline[:, 1], -1) - outline[:, 1] * np.roll(outline[:, 0], -1)) / 2.0
    if n < 2 or not np.isclose(area, (right - left) * (high - low)):
        return [outline]
    edges = np.linspace(left, right, n + 1)
    ends = [(a + gap / 2.0, b - gap / 2.0) for a, b in pairwise(edges)]
    return [np.array([[a, low], [b, low], [b, high], [a, high]]) for a, b in ends]


def _evolution(drive: Drive, part: float, time_step: float) -> np.ndarray:
    """Times and velocities of a component of the drive, between which LMGC90 interpolates."""
    fast, slow, change = drive.speed * part, drive.slow * part, REST + min(drive.slows_at, 1e5)
    times = [0.0, REST, REST + max(drive.ramp, time_step), change, change + time_step, 1e6]
    return np.array([times, [0.0, 0.0, fast, fast, slow, slow]])


def _lmgc90_law(friction: float, strength: tuple[float, float] | None) -> tuple[str, list[float]]:
    """Name and numbers of a contact law: tensile strength and cohesion [Pa], static and dynamic friction."""
    return ("IQS_CLB", [friction]) if strength is None else ("IQS_MOHR_DS_CLB", [*strength, friction, friction])


def lmgc90_path(
    assembly: solver.Assembly,
    drive: Drive,
    time_step: float,
    friction: float,
    sampling: float,
    strength: tuple[float, float] | None = None,
) -> Iterator[Sample]:
    """LMGC90: non-smooth contact dynamics; polyhedra that cannot move out of the plane.

    With a tensile strength and a cohesion [Pa] by its brittle law of Mohr and Coulomb.
    """
    from compas_lmgc90.solver import Solver

    # its search for neighbours ends the process where blocks are much longer than wide: a slice of the wall will do
    thickness = float(np.max(assembly.thickness))
    depth = min(thickness, assembly.block_size)
    engine = Solver(dt=time_step, theta=0.5, density=float(np.unique(assembly.density)[0]))
    reach = 0.02 * assembly.block_size
    blocks, owners = [], []
    for i in range(assembly.n_blocks):
        # and where a support is much longer than the blocks; pieces of supports must not touch each other
        pieces = [assembly.outline(i)]
        if not assembly.free[i]:
            pieces = _strips(pieces[0], 2.0 * assembly.block_size, 2.5 * reach)
        for outline in pieces:
            n = len(outline)
            vertices = [
                [float(x), y, float(z)] for y in (-depth / 2.0, depth / 2.0) for x, z in outline
            ]  # gravity is along -z
            sides = [[n + k, n + (k + 1) % n, (k + 1) % n, k] for k in range(n)]
            blocks.append({"vertices": vertices, "faces": [list(range(n)), list(range(n, 2 * n))[::-1], *sides]})
            owners.append(i)
    owner = np.array(owners)
    engine.geometry_from_v_f(blocks)
    engine.contact_law(*_lmgc90_law(friction, strength), alert=reach)
    for body, i in enumerate(owners):
        # rotations are about the principal axes of a block, in LMGC90's own order: those of free blocks are left alone
        held = ("Vy",) if assembly.free[i] else ("Vx", "Vy", "Vz", "Rx", "Ry", "Rz")
        for component in held:
            engine.apply_velocity(body, component, 0.0)
        if assembly.moving[i]:
            for component, part in zip(("Vx", "Vz"), drive.direction, strict=True):
                if part:
                    engine.apply_velocity(body, component, _evolution(drive, part, time_step))
    engine.preprocess()
    moving = np.flatnonzero(assembly.moving[owner])
    first_piece = np.searchsorted(owner, np.arange(assembly.n_blocks))
    start = np.array(engine.init_coor)[:, [0, 2]]  # centres of mass, which engine.centroids are not
    per_sample, bonded = max(1, round(sampling / time_step)), 0
    for sample in range(10**9):
        force = np.zeros(2)
        for _ in range(per_sample):
            state = engine.lmgc90.compute_one_step()  # run() would also move the meshes, which nobody looks at
            if len(state.interaction_bodies):
                pairs = np.array(state.interaction_bodies) - 1
                on_first = np.array(state.interaction_force_global)[:, [0, 2]]
                force += on_first[np.isin(pairs[:, 0], moving)].sum(axis=0)
                force -= on_first[np.isin(pairs[:, 1], moving)].sum(axis=0)
        moved = np.array(state.bodies)[:, [0, 2]] - start
        clock = (sample + 1) * per_sample * time_step - REST
        displacement = float(moved[moving[0]] @ drive.direction)
        whole = sum(status.startswith(WHOLE) for status in state.interaction_status)
        bonded = bonded or whole
        yield Sample(
            clock,
            displacement,
            assembly.centroids + moved[first_piece],
            force * thickness / (depth * per_sample),
            whole=whole / max(bonded, 1),
        )


def _report(
    pipe: multiprocessing.connection.Connection,
    name: str,
    given: tuple[Any, ...],
    sampling: float,
    options: dict[str, Any],
) -> None:
    """The child's work: sends (processor time, sample) until somebody ends it."""
    importlib.import_module(name)
    pipe.send((0.0, None))
    started = time.process_time()
    for sample in (ENGINES if given[0].dimension == 2 else IN_SPACE)[name](*given, sampling, **options):
        pipe.send((time.process_time() - started, sample))


def in_a_process(
    name: str,
    assembly: solver.Assembly,
    drive: Drive,
    time_step: float,
    friction: float,
    *,
    budget: float,
    sampling: float = SAMPLING,
    **options: Any,
) -> Iterator[tuple[float, Sample]]:
    """Runs an engine in a process of its own, since LMGC90 ends its process where something is wrong.

    Yields the processor time so far [s] and a sample; stops after a budget of processor time [s], after four times
    as long without a sample, or where the engine ends its process.
    """
    context = multiprocessing.get_context("spawn")
    here, there = context.Pipe(duplex=False)
    given = (assembly, drive, time_step, friction)
    child = context.Process(target=_report, args=(there, name, given, sampling, options), daemon=True)
    child.start()
    there.close()
    try:
        while here.poll(60.0 + 4.0 * budget):
            seconds, sample = here.recv()
            if sample is not None:
                yield seconds, sample
            if seconds > budget:
                return
    except EOFError:
        return
    finally:
        child.terminate()
        child.join()


def _corners(assembly: solver.Assembly, block: int) -> np.ndarray:
    first, last = assembly.polyhedra.offsets[block : block + 2]
    return assembly.vertices[first:last]


def mujoco_path_in_space(
    assembly: solver.Assembly, drive: Drive, time_step: float, friction: float, sampling: float
) -> Iterator[Sample]:
    """MuJoCo with free bodies, the convex hulls of the blocks; each support moves along its row of (n_blocks, 3)."""
    import mujoco

    meshes, bodies = [], []
    for i in range(assembly.n_blocks):
        corners = (_corners(assembly, i) - assembly.centroids[i]).ravel()
        meshes.append(f'<mesh name="m{i}" inertia="exact" vertex="{" ".join(f"{c:.17g}" for c in corners)}"/>')
        joints = "<freejoint/>" if assembly.free[i] else ""
        if assembly.moving[i]:
            axis = " ".join(f"{c:.17g}" for c in drive.direction[i])
            joints = f'<joint name="drive{i}" type="slide" axis="{axis}" armature="1e8"/>'
        place = " ".join(f"{c:.17g}" for c in assembly.centroids[i])
        gravity = "" if assembly.free[i] else ' gravcomp="1"'
        bodies.append(
            f'<body name="b{i}" pos="{place}"{gravity}>{joints}'
            f'<geom type="mesh" mesh="m{i}" contype="1" conaffinity="{1 if assembly.free[i] else 0}"/></body>'
        )
    model = _mujoco_model(assembly, meshes, bodies, f"0 0 {-solver.GRAVITY}", time_step, friction)
    data = mujoco.MjData(model)
    moving = np.flatnonzero(assembly.moving)
    drives = [model.joint(f"drive{i}") for i in moving]
    ids = np.array([model.body(f"b{i}").id for i in range(assembly.n_blocks)])
    ways = np.zeros((model.nbody, 3))
    ways[ids[moving]] = drive.direction[moving]
    per_sample, wrench = max(1, round(sampling / time_step)), np.zeros(6)
    for sample in range(10**9):
        clock = sample * per_sample * time_step - REST
        work = 0.0
        for step in range(per_sample):
            for joint in drives:
                data.qpos[joint.qposadr[0]], data.qvel[joint.dofadr[0]] = drive.at(clock + step * time_step)
            mujoco.mj_step(model, data)
            first, second = ways[model.geom_bodyid[data.contact.geom]].transpose(1, 0, 2)
            for k in np.flatnonzero((np.abs(first) + np.abs(second)).any(axis=1)):
                mujoco.mj_contactForce(model, data, k, wrench)
                work += float((second[k] - first[k]) @ (data.contact.frame[k].reshape(3, 3).T @ wrench[:3]))
        clock += per_sample * time_step
        yield Sample(clock, drive.at(clock)[0], data.xpos[ids].copy(), np.array([work / per_sample]))


def lmgc90_path_in_space(
    assembly: solver.Assembly, drive: Drive, time_step: float, friction: float, sampling: float
) -> Iterator[Sample]:
    """LMGC90 with free polyhedra; each support moves along its row of (n_blocks, 3)."""
    from compas_lmgc90.solver import Solver

    engine = Solver(dt=time_step, theta=0.5, density=float(np.unique(assembly.density)[0]))
    solids = [{"vertices": corners.tolist(), "faces": faces} for corners, faces in layout_of(assembly).solids]
    engine.geometry_from_v_f(solids)
    engine.contact_law("IQS_CLB", friction, alert=0.02 * assembly.block_size)
    for i in np.flatnonzero(~assembly.free):
        for component in ("Vx", "Vy", "Vz", "Rx", "Ry", "Rz"):
            engine.apply_velocity(int(i), component, 0.0)
        for component, part in zip(("Vx", "Vy", "Vz"), drive.direction[i], strict=True):
            if assembly.moving[i] and abs(part) > 1e-12:
                engine.apply_velocity(int(i), component, _evolution(drive, part, time_step))
    engine.preprocess()
    start, moving = np.array(engine.init_coor), np.flatnonzero(assembly.moving)
    ways = np.where(assembly.moving[:, None], drive.direction, 0.0)
    per_sample = max(1, round(sampling / time_step))
    for sample in range(10**9):
        work = 0.0
        for _ in range(per_sample):
            state = engine.lmgc90.compute_one_step()
            if len(state.interaction_bodies):
                first, second = (np.array(state.interaction_bodies) - 1).T
                forces = np.array(state.interaction_force_global)
                work += float((forces * (ways[first] - ways[second])).sum())
        moved = np.array(state.bodies) - start
        clock = (sample + 1) * per_sample * time_step - REST
        displacement = float(moved[moving[0]] @ drive.direction[moving[0]])
        yield Sample(clock, displacement, assembly.centroids + moved, np.array([work / per_sample]))


ENGINES = {"pymunk": pymunk_path, "mujoco": mujoco_path, "compas_lmgc90": lmgc90_path}

#: Those of blocks in space; their samples have positions (n_blocks, 3), and as force (1,) what the supports resist
#: along their movement.
IN_SPACE = {"mujoco": mujoco_path_in_space, "compas_lmgc90": lmgc90_path_in_space}
