"""Structures and responses that several tests look at."""

import ast
import json
import os
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import astuple, fields, is_dataclass, replace
from functools import cache
from itertools import pairwise, product
from pathlib import Path
from unittest import mock

import imageio_ffmpeg
import numpy as np
from PIL import Image, ImageSequence
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

import blockvis
import solver
from blockvis import generators
from blockvis.cli import main
from solver import mechanics

#: Bent outlines that VTK would fill wrongly: an L, a U, a comb.
BENT = {
    "L": [[0, 0], [2, 0], [2, 1], [1, 1], [1, 3], [0, 3]],
    "U": [[4, 0], [7, 0], [7, 3], [6, 3], [6, 1], [5, 1], [5, 3], [4, 3]],
    "comb": [[9, 0], [14, 0], [14, 2], [13, 2], [13, 1], [12, 1], [12, 2], [11, 2], [11, 1], [10, 1], [10, 2], [9, 2]],
}


def rectangle(left: float, low: float, right: float, high: float) -> np.ndarray:
    """Outline of a rectangle, counter-clockwise from its lower left corner."""
    return np.array([[left, low], [right, low], [right, high], [left, high]], dtype=float)


def brick(x: float, y: float, width: float, height: float) -> np.ndarray:
    """Outline of a rectangle by its lower left corner and its size."""
    return rectangle(x, y, x + width, y + height)


def prism(outline, low: float = 0.0, high: float = 1.0) -> tuple[np.ndarray, list[list[int]]]:
    """Extrude an outline in x and y, counter-clockwise seen from above, from z = low to z = high."""
    n = len(outline)
    corners = np.array([[*point, z] for z in (low, high) for point in outline], dtype=float)
    sides = [[k, (k + 1) % n, n + (k + 1) % n, n + k] for k in range(n)]
    return corners, [list(range(n))[::-1], list(range(n, 2 * n)), *sides]


def box(low, high) -> tuple[np.ndarray, list[list[int]]]:
    """Vertices and faces of a box between two corners."""
    return prism(rectangle(*low[:2], *high[:2]), low[2], high[2])


def of_cubes(places) -> tuple[np.ndarray, list[list[int]]]:
    """Surface of what cubes of 1 m fill, by their least corners: a square where no other cube is beside one."""
    number: dict[tuple[int, ...], int] = {}
    faces = []
    for place, axis, side in product(map(tuple, places), range(3), (0, 1)):
        step = np.roll([1, 0, 0], axis)
        if tuple((np.array(place) + (2 * side - 1) * step).tolist()) not in set(map(tuple, places)):
            ring = np.roll([(side, 0, 0), (side, 1, 0), (side, 1, 1), (side, 0, 1)], axis, axis=1) + place
            face = [number.setdefault(tuple(corner), len(number)) for corner in ring.tolist()]
            faces.append(face if side else face[::-1])
    return np.array(list(number), dtype=float), faces


def hull_of(points) -> tuple[np.ndarray, list[list[int]]]:
    """Closed surface of the convex hull of points, in triangles."""
    hull = ConvexHull(points)
    faces = []
    for corners, plane in zip(hull.simplices, hull.equations, strict=True):
        a, b, c = hull.points[corners]
        faces.append((corners if np.cross(b - a, c - a) @ plane[:3] > 0.0 else corners[::-1]).tolist())
    return hull.points, faces


def upright(outline, first: float, last: float) -> tuple[np.ndarray, list[list[int]]]:
    """Extrude an outline in x and z, counter-clockwise seen against y, from y = first to y = last."""
    corners, faces = prism(outline, first, last)
    return corners[:, [0, 2, 1]], [face[::-1] for face in faces]


def in_either(dimension: int, outlines, solid=upright, **given) -> solver.Assembly:
    """Blocks of these outlines in the plane, a metre thick, or in space, from y or z = 0 to 1 m."""
    if dimension == 2:
        return solver.Assembly.from_outlines(outlines, **given)
    return solver.Assembly.from_solids([solid(outline, 0.0, 1.0) for outline in outlines], **given)


def with_hole(outer, inner) -> tuple[np.ndarray, list[list[int]]]:
    """Extrude what lies between two outlines of four corners by 1 m upwards; its faces with the hole are two each."""
    plan = np.array([*outer, *inner], dtype=float)
    low, high = (np.column_stack([plan, np.full(8, z)]) for z in (0.0, 1.0))
    halves = [[0, 1, 2, 6, 5, 4], [2, 3, 0, 4, 7, 6]]
    faces = [face[::-1] for face in halves] + [[8 + k for k in face] for face in halves]
    faces += [[k, (k + 1) % 4, (k + 1) % 4 + 8, k + 8] for k in range(4)]
    faces += [[4 + (k + 1) % 4, 4 + k, 12 + k, 12 + (k + 1) % 4] for k in range(4)]
    return np.concatenate([low, high]), faces


def fans(faces) -> np.ndarray:
    """Convex faces cut into triangles from their first corners."""
    return np.array([[face[0], face[k], face[k + 1]] for face in faces for k in range(1, len(face) - 1)])


def turn_by(rotation) -> np.ndarray:
    """Matrix of a rotation by a vector [rad]."""
    return Rotation.from_rotvec(rotation).as_matrix()


def pixels(path) -> np.ndarray:
    """(height, width, 3) array of the colours of a picture."""
    return np.asarray(Image.open(path).convert("RGB")).astype(int)


def film_frames(path) -> list[np.ndarray]:
    """(height, width, 3) uint8 array of each frame of a film."""
    if Path(path).suffix == ".mp4":
        reader = imageio_ffmpeg.read_frames(str(path))
        width, height = next(reader)["size"]
        return [np.frombuffer(frame, np.uint8).reshape(height, width, 3) for frame in reader]
    with Image.open(path) as film:
        return [np.asarray(frame.convert("RGB")) for frame in ImageSequence.Iterator(film)]


def alike(colours, wanted, tolerance: int = 12) -> np.ndarray:
    """Whether colours are a wanted one, but for what drawing blurs."""
    return (np.abs(np.asarray(colours, dtype=int) - np.array(wanted)) <= tolerance).all(axis=-1)


def sideways(assembly: solver.Assembly, fraction: float = 1.0) -> solver.Loads:
    """Self-weight, and of the free blocks a part of it as a live load along x."""
    live = solver.weight_fraction(assembly, (fraction, 0.0), np.flatnonzero(assembly.free))
    return solver.Loads(solver.self_weight(assembly).dead, live)


def stacked(shift=(0.0, 0.0), turn: float = 0.0) -> tuple[solver.Assembly, solver.Pose]:
    """A block of 1 m on another, and the pose with the upper one moved."""
    assembly = solver.Assembly.from_outlines([rectangle(0, 0, 1, 1), rectangle(0, 1, 1, 2)], roles=["fixed", "free"])
    return assembly, solver.Pose(assembly.centroids + np.array([(0.0, 0.0), shift]), np.array([[0.0], [turn]]))


def two_cubes(order=(0, 1)) -> solver.Assembly:
    """A cube of 1 m that is free, on one that is fixed, in either order."""
    solids, roles = [box((0, 0, 0), (1, 1, 1)), box((0, 0, 1), (1, 1, 2))], ["fixed", "free"]
    return solver.Assembly.from_solids([solids[k] for k in order], roles=[roles[k] for k in order])


def twisted(order, corner, angle) -> tuple[solver.Assembly, solver.Pose]:
    """Two cubes, and the pose with the upper one turned by an angle [rad] about the vertical through (x, y) [m]."""
    assembly, turn, foot = two_cubes(order), np.array([0.0, 0.0, angle]), np.array([*corner, 1.0])
    free, turned = assembly.free[:, None], mechanics.rotation_matrices(np.array([turn]))[0]
    places = np.where(free, (assembly.centroids - foot) @ turned.T + foot, assembly.centroids)
    return assembly, solver.Pose(places, free * turn)


def sunk_and_tilted(limit: float) -> solver.Response:
    """A block on a support that sinks by so much [m], then tilts."""
    assembly = solver.Assembly.from_outlines(
        [[(-2, -1), (2, -1), (2, 0), (-2, 0)], [(-0.25, 0), (0.25, 0), (0.25, 1), (-0.25, 1)]], roles=["moving", "free"]
    )
    sinks = solver.Settlement(direction=(0.0, -1.0), increment=0.05, limit=limit)
    tilts = solver.Settlement(rotation_centre=(0.0, 0.0), rotation=-1.0, increment=0.1, limit=0.1)
    return solver.settle(assembly, (sinks, tilts), friction_coefficient=0.8)


@cache
def moved_and_turned() -> solver.Response:
    """An arch whose springer moves by a millimetre, in the first settlement, and turns by a milliradian."""
    turns = solver.Settlement(rotation=1.0, rotation_centre=(1.0, 0.0), increment=1e-3, limit=1e-3)
    moves = solver.Settlement((1, 0), increment=1e-3, limit=1e-3)
    return solver.Structure(generators.arch(voussoirs=5), friction_coefficient=2.0).settle([moves, turns])


@cache
def arch_response() -> solver.Response:
    """A semicircular arch of 12 voussoirs whose right springer spreads until it collapses."""
    spread = solver.Settlement(direction=(1, 0), increment=0.02, limit=0.5)
    controls = solver.Controls(falling_frames=12)
    return solver.settle(generators.arch(), spread, friction_coefficient=0.6, controls=controls)


def drawn(path: Path, shapes, names=None, **words) -> Path:
    """Write a layout file of outlines, or of (points, faces) in space, as somebody draws them: nothing is checked.

    What else the file says of each block, a group, role, material, density or thickness, has a value per block,
    None for nothing.
    """
    blocks = []
    for k, shape in enumerate(shapes):
        if isinstance(shape, tuple):
            block = {"points": np.asarray(shape[0]).tolist(), "faces": [np.asarray(face).tolist() for face in shape[1]]}
        else:
            block = {"outline": np.asarray(shape).tolist()}
        block["name"] = f"block {k}" if names is None else names[k]
        blocks.append(block | {word: said[k] for word, said in words.items() if said[k] is not None})
    content = {"format": "blockvis layout", "version": 1, "unit": "m", "blocks": blocks}
    path.write_text(json.dumps(content), encoding="utf-8")
    return path


def case_from(text: str, folder: Path | None = None) -> blockvis.Case:
    """The case in a file with this text, in a folder or where nothing else is."""
    with tempfile.TemporaryDirectory() as elsewhere:
        path = Path(folder or elsewhere) / "case.toml"
        path.write_text(text, encoding="utf-8")
        return blockvis.read_case(path)


class _Begun(Exception):
    """A run has its assembly, and is stopped."""


def _at_the_beginning(case: blockvis.Case | str | Path, read):
    """What is read from the results folder of a case when its run begins."""
    folders = sys.modules[blockvis.run_case.__module__].ResultsFolder
    tell = folders.tell

    def told(results, response):
        tell(results, response)
        raise _Begun(read(results))

    with tempfile.TemporaryDirectory() as folder, mock.patch.object(folders, "tell", told):
        try:
            blockvis.run_case(case, Path(folder) / "out", outputs=[])
        except _Begun as begun:
            return begun.args[0]
    raise AssertionError("the run ended before it began")


def assembly_of(case: blockvis.Case | str | Path) -> solver.Assembly:
    """The assembly with which the run of a case begins."""
    return _at_the_beginning(case, lambda results: results.assembly)


def begun(case: blockvis.Case | str | Path) -> solver.Response:
    """The response of a run of a case before its first increment: its assembly, laws, loads and ties."""
    return _at_the_beginning(case, lambda results: blockvis.open_results(results.path))


def layout_of(assembly: solver.Assembly):
    """The blocks of an assembly as a layout file holds them."""
    with tempfile.TemporaryDirectory() as folder:
        blockvis.save_layout(assembly, Path(folder) / "layout.json")
        return blockvis.read_layout(Path(folder) / "layout.json")


def suffixes_known(use, *first) -> list[str]:
    """The suffixes that are named where a file of no known one is to be written."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a.nothing"
        path.touch()
        try:
            use(*first, path)
        except ValueError as error:
            return re.findall(r"\.\w+", str(error).rpartition("use one of ")[2].partition(";")[0])
    raise AssertionError("a file of no known suffix was taken")


def report_of(response: solver.Response, case_text: str = "", **options) -> str:
    """The report of a response as text."""
    with tempfile.TemporaryDirectory() as folder:
        return blockvis.write_report(response, Path(folder) / "report.html", case_text, **options).read_text(
            encoding="utf-8"
        )


#: Sizes at which layouts take a fraction of a second.
_SMALL = {
    "facade": {"bricks": 14, "courses": 24, "storeys": 1, "windows": 1},
    "cross vault": {"voussoirs": 5},
    "pavilion vault": {"voussoirs": 5},
    "church bay": {"voussoirs": 5, "pier_stones": 1},
    "L corner": {"courses": 3},
    "T corner": {"courses": 3},
    "two-leaf wall": {"courses": 4},
}


@cache
def small_layout(name: str) -> solver.Assembly:
    """A layout by its name, small where its own size takes long."""
    return generators.build(name, _SMALL.get(name))


def posed(assembly: solver.Assembly, pose: solver.Pose, force=None) -> solver.Response:
    """A made-up response of one increment in which blocks are at a pose.

    Forces at its contact points are what a function of the contacts says, by default none.
    """
    contacts = mechanics.find_contacts(assembly, mechanics.moved_vertices(assembly, pose), 1e-3)
    forces = np.zeros((len(contacts), assembly.dimension)) if force is None else force(contacts)
    first = arch_response().path[0]
    still = np.zeros((assembly.n_blocks, 3 * assembly.dimension - 3))
    points = {"friction": np.full(len(contacts), 0.6), "displacements": np.zeros_like(contacts.points)}
    held = replace(first.state, pose=pose, contacts=contacts, forces=forces, velocity=still, **points)
    return replace(
        arch_response(),
        assembly=assembly,
        loads=solver.self_weight(assembly),
        increments=(replace(first, held=held),),
        collapse=None,
    )


@cache
def portal_response() -> solver.Response:
    """A portal frame whose moving support sinks until it collapses."""
    sinks = solver.Settlement(direction=(0, -1), increment=0.05, limit=2.5, tolerance=5e-3)
    return solver.settle(generators.portal(), sinks, friction_coefficient=0.6)


@cache
def dropped_brick(local_loss=0.0):
    """A heavy block that stands, and beside it a brick over a gap that opens under it."""
    outlines = [
        [[0, 0], [4, 0], [4, 2], [0, 2]],
        [[4.9, 0], [5.4, 0], [5.4, 0.2], [4.9, 0.2]],
        [[-1, -1], [5, -1], [5, 0], [-1, 0]],
        [[5.2, -1], [6, -1], [6, 0], [5.2, 0]],
    ]
    assembly = solver.Assembly.from_outlines(
        outlines, names=["pier", "brick", "ground", "footing"], roles=["free", "free", "fixed", "moving"]
    )
    away = solver.Settlement(direction=(1, 0), increment=0.05, limit=1.0)
    return solver.settle(assembly, away, friction_coefficient=0.6, controls=solver.Controls(local_loss=local_loss))


@cache
def vault_response() -> solver.Response:
    """An arch of 6 voussoirs in space, 0.5 m deep, whose right springer spreads until it collapses."""
    spread = solver.Settlement(direction=(1, 0, 0), increment=0.1, limit=0.8, tolerance=0.05)
    arch = generators.extruded_arch(voussoirs=6, thickness_ratio=0.2)
    return solver.settle(arch, spread, friction_coefficient=1.0, controls=solver.Controls(falling_frames=3))


def wall(columns: int, courses: int) -> solver.Assembly:
    """Bricks of 0.25 m × 0.1 m in running bond on two footings, the right one moving."""
    length, height = 0.25, 0.1
    outlines, names = [], []
    for course in range(courses):
        joints = [0.0, *((np.arange(columns) + (0.5 if course % 2 else 1.0)) * length), columns * length]
        joints = [x for k, x in enumerate(joints) if k == 0 or x > joints[k - 1] + 1e-9]
        for left, right in pairwise(joints):
            low, high = course * height, (course + 1) * height
            outlines.append([[left, low], [right, low], [right, high], [left, high]])
            names.append(f"brick {course}-{len(outlines)}")
    split, end = round(0.66 * columns) * length, columns * length
    outlines.append([[-2, -1], [split, -1], [split, 0], [-2, 0]])
    outlines.append([[split, -1], [end + 2, -1], [end + 2, 0], [split, 0]])
    bricks = len(names)
    return solver.Assembly.from_outlines(
        outlines,
        roles=["free"] * bricks + ["fixed", "moving"],
        names=[*names, "footing left", "footing right"],
        materials=["brick"] * bricks + ["concrete"] * 2,
    )


def same(one, other) -> bool:
    """Whether two values have the same types, fields and arrays, bit for bit."""
    if is_dataclass(one):
        return type(one) is type(other) and all(same(getattr(one, f.name), getattr(other, f.name)) for f in fields(one))
    if isinstance(one, tuple):
        return len(one) == len(other) and all(map(same, one, other))
    if isinstance(one, np.ndarray):
        return one.dtype == other.dtype and one.shape == other.shape and one.tobytes() == other.tobytes()
    if isinstance(one, float) and np.isnan(one):
        return isinstance(other, float) and np.isnan(other)
    return type(one) is type(other) and one == other


def equal_certificates(one: solver.Certificate, other: solver.Certificate) -> bool:
    """Whether the measures of two certificates are the same, those that do not apply included."""
    return np.array_equal(astuple(one), astuple(other), equal_nan=True)


def partly_unbounded(positions, without=None):
    """Give an envelope of which one position, by default the middle one, has no limit."""
    arch = generators.arch()
    limit = solver.limit_load(arch, loads=replace(solver.self_weight(arch), live=solver.point_load(arch, 3, (0, -1))))
    values = np.where(
        np.arange(positions) == (positions // 2 if without is None else without), np.inf, limit.multiplier
    )
    states = [replace(limit.increment, parameter=float(x), measured=values[x]) for x in range(positions)]
    return solver.Response(
        assembly=arch, settlements=(), interfaces=solver.Interfaces(), loads=limit.response.loads,
        increments=tuple(states), stop=solver.Status.COLLAPSED, analysis="limit load", limits=(limit,) * positions,
        parameter=mechanics.LOAD_POSITION, measured=mechanics.LOAD_MULTIPLIER,
    )  # fmt: skip


def parted(assembly: solver.Assembly, path: int, fall: int, settlement: float = 0.1) -> solver.Response:
    """A made-up response, no mechanics in it: the right part of a wall sinks as one body, then drops.

    Forces are made up too, so that there are as many of them as in a real wall.
    """
    edge = assembly.vertices[assembly.free[assembly.block_of_vertex]].max(axis=0)
    right = (assembly.centroids[:, 0] > 0.66 * edge[0] - 0.35 * assembly.centroids[:, 1]) & assembly.free
    random = np.random.default_rng(7)
    velocity = np.zeros((assembly.n_blocks, 3))
    velocity[right | assembly.moving, 1] = -1.0
    certificate = solver.Certificate(equilibrium_residual=1e-12, largest_penetration=1e-9, duality_gap=1e-10)
    increments = []
    for k in range(path + fall):
        s = settlement * min(k, path - 1) / (path - 1)
        positions = assembly.centroids.copy()
        positions[right | assembly.moving, 1] -= s
        positions[right] += max(0, k - path + 1) * np.array([0.02, -0.01])
        pose = solver.Pose(positions, np.zeros((assembly.n_blocks, 1)))
        contacts = mechanics.find_contacts(assembly, mechanics.moved_vertices(assembly, pose), 0.002)
        normal = np.where(np.abs(contacts.gaps) < 1e-3, (edge[1] - contacts.points[:, 1] + 0.1) * 1e3, 0.0)
        normal *= random.random(len(normal))
        forces = np.stack([normal, 0.4 * normal], axis=1)
        apart = velocity[contacts.block_a, :2] - velocity[contacts.block_b, :2]
        increments.append(
            solver.Increment(
                parameter=s,
                measured=2000.0 - 3000.0 * s,
                phase=0,
                load_multiplier=0.0,
                reaction=2000.0 - 3000.0 * s,
                held=mechanics.State(
                    pose=pose,
                    contacts=contacts,
                    forces=forces,
                    displacements=np.einsum("kij,kj->ki", contacts.frames, apart),
                    friction=np.full(len(normal), 0.6),
                    velocity=velocity,
                    support_forces=np.zeros((assembly.n_blocks, 3)),
                ),
                certificate=certificate,
                status=solver.Status.EQUILIBRIUM if k < path else solver.Status.FALLING,
                programs=1,
                seconds=0.0,
            )
        )
    return solver.Response(
        assembly=assembly,
        settlements=(solver.Settlement(direction=(0, -1), increment=settlement / path, limit=1.0),),
        interfaces=solver.Interfaces(),
        loads=solver.self_weight(assembly),
        increments=tuple(increments),
        stop=solver.Status.COLLAPSED,
        message="made up",
        collapse=solver.Collapse(settlement, (settlement, settlement + 1e-3), 1700.0, velocity),
    )


@contextmanager
def started_cluster(folder: Path) -> Iterator[tuple[str, subprocess.Popen, list[subprocess.Popen]]]:
    """A Dask scheduler and two workers as a user starts them, without anybody who restarts what dies.

    Yields the scheduler's address, the scheduler and its workers.
    """
    file = folder / "scheduler.json"
    common = {
        "env": {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
        "cwd": folder,
        "stdout": subprocess.DEVNULL,
        "stderr": subprocess.DEVNULL,
    }
    dask = [sys.executable, "-m", "dask"]
    local = ["--host", "127.0.0.1", "--port", "0", "--scheduler-file", str(file), "--no-dashboard"]
    scheduler = subprocess.Popen([*dask, "scheduler", *local], **common)
    join = ["worker", "--scheduler-file", str(file), "--nthreads", "1", "--no-nanny", "--no-dashboard"]
    workers = [subprocess.Popen([*dask, *join], **common) for _ in range(2)]
    try:
        deadline = time.monotonic() + 60
        # A file that is there may not be written yet.
        while not (file.exists() and file.read_text(encoding="utf-8").rstrip().endswith("}")):
            assert time.monotonic() < deadline
            time.sleep(0.05)
        yield json.loads(file.read_text(encoding="utf-8"))["address"], scheduler, workers
    finally:
        for process in [*workers, scheduler]:
            process.kill()
            process.wait(timeout=20)


def run_command(*arguments, drawn=False):
    """The exit code of ``blockvis run``, which follows no second path in shorter steps, and draws where it is to."""
    return main(["run", "--no-check-steps", *map(str, arguments)], outputs=None if drawn else ())


def stored_bytes(path: Path) -> bytes:
    """Content of an .npz file of a run but for the seconds it took."""
    with np.load(path) as stored:
        arrays = {name: stored[name] for name in stored.files}
    tree = re.sub(r'"seconds": [^,]*,', "", str(arrays.pop("tree", "")))
    return tree.encode() + b"".join(array.tobytes() for array in arrays.values())


def imports_of(path: Path) -> list[ast.stmt]:
    """Statements of a Python file that import, anywhere, in scripts that it holds as text as well.

    To parse them alone takes a tenth of the time that the whole file does.
    """
    found = re.findall(
        r"^[ \t]*((?:from [\w.]+ )?import (?:\([^)]*\)|[^\n]+))", path.read_text(encoding="utf-8"), re.MULTILINE
    )
    return ast.parse("\n".join(found)).body
