"""A response as animated glTF (.glb): a node for each block that moves as it did, for browsers and slides."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

import solver
from blockvis.dynamics.fall import Fall
from blockvis.layout.block_table import rows_of
from blockvis.layout.layout import layout_of, solids_of
from blockvis.layout.solids import BASE_FRAME, triangles_of
from blockvis.system.atomic_files import write_atomic
from solver import mechanics

from . import palette
from .film import PATH_SECONDS, PAUSE
from .swing import shown_increments

#: Seconds of a frame of pseudo-time.
FRAME = 0.1

#: Rotation that turns z upwards into y upwards, as glTF has it.
UPRIGHT = Rotation.from_euler("x", -90, degrees=True)


def write_animated_glb(response: solver.Response, path: Path, fall: Fall | None = None) -> Path:
    """Write the path of a response and what follows it as an animation in a .glb file; ValueError without an increment.

    Without a fall in time the frames of the mechanism follow. The path takes six seconds in proportion to its
    parameter. Between two poses glTF turns each block about its centroid, and no corner takes a short cut. Blocks in
    the plane are extruded by their thickness. Ties are rods from end to end. What is gone has no size from then on: a
    block that was taken away or lost, a tie that is broken or not there yet.
    """
    if not response.increments:
        raise ValueError(f"there is no motion to write to '{path}': {response.message or response.stop}")
    times, poses, tied, stands = _played(response, fall)
    courses = _courses(response, poses, tied, stands)
    # Numbers in single precision are those about the first place of the first block.
    origin = courses["translation"][0, 0].copy()
    courses["translation"] -= origin
    names = [*response.assembly.names, *map(_rod_name, response.ties)]
    scene = _still(response.assembly, response.ties)

    def animated(buffer: dict[str, bytes], tree: dict[str, Any]) -> None:
        """Add the motion to what trimesh writes of the blocks at rest."""

        def added(values: np.ndarray, kind: str) -> int:
            data, number = np.ascontiguousarray(values, dtype="<f4"), len(tree["accessors"])
            least, most = (np.atleast_1d(of).astype(float).tolist() for of in (data.min(axis=0), data.max(axis=0)))
            # Components of type 5126 have single precision.
            tree["accessors"][f"motion {number}"] = {
                "bufferView": len(buffer), "componentType": 5126, "count": len(data), "type": kind,
                "min": least, "max": most,
            }  # fmt: skip
            buffer[f"motion {number}"] = data.tobytes()
            return number

        numbers = {node["name"]: number for number, node in enumerate(tree["nodes"]) if "mesh" in node}
        clock, samplers, channels = added(times, "SCALAR"), list[dict[str, Any]](), list[dict[str, Any]]()
        for what, course in courses.items():
            for name, values in zip(names, np.moveaxis(course, 1, 0), strict=True):
                tree["nodes"][numbers[name]][what] = values[0].tolist()
                if np.abs(values - values[0]).max() == 0.0:
                    continue
                output = added(values, "VEC4" if what == "rotation" else "VEC3")
                channels.append({"sampler": len(samplers), "target": {"node": numbers[name], "path": what}})
                # Blocks and rods come and go at once.
                how = "STEP" if what == "scale" else "LINEAR"
                samplers.append({"input": clock, "output": output, "interpolation": how})
        for node in tree["nodes"]:
            # What moves has no matrix of its own.
            node.pop("matrix", None)
        roots = tree["scenes"][tree["scene"]]
        tree["nodes"].append({"children": roots["nodes"], "translation": origin.tolist()})
        roots["nodes"] = [len(tree["nodes"]) - 1]
        tree["asset"]["generator"] = "blockvis"
        if channels:
            tree["animations"] = [{"name": response.analysis, "samplers": samplers, "channels": channels}]

    return write_atomic(path, bytes(scene.export(file_type="glb", buffer_postprocessor=animated)))


def _played(
    response: solver.Response, fall: Fall | None
) -> tuple[np.ndarray, list[solver.Pose], list[mechanics.TieForces], np.ndarray]:
    """Seconds, (n,), at which the blocks are at which poses, what ties do then, and which blocks, (n, n_blocks), stand.

    What has gone by the last equilibrium does not come back for what follows.
    """
    # Positions of a load may be negative, times may not.
    path, along = response.path, response.parameters - response.parameters[:1]
    reach = float(along[-1]) if path else 0.0
    times = PATH_SECONDS * along / reach if reach > 0.0 else FRAME * np.arange(len(path))
    moments = [(float(time), one.pose, one.ties) for time, one in zip(times, path, strict=True)]
    moments = moments or [(0.0, solver.Pose.initial(response.assembly), mechanics.TieForces())]
    start, last = moments[-1][0] + PAUSE, moments[-1][1:]
    if fall is not None:
        moments += [
            (start + time, fall.pose(k), fall.ties_at(time, response)) for k, time in enumerate(fall.times.tolist())
        ]
    elif frames := [i for i in shown_increments(response) if i.status == solver.Status.FALLING]:
        moments.append((start, *last))
        moments += [(start + FRAME * k, frame.pose, frame.ties) for k, frame in enumerate(frames, start=1)]
    moments.append((moments[-1][0] + PAUSE, *moments[-1][1:]))
    clock = np.array([time for time, _, _ in moments])
    # What changes between two settlements does so at one parameter; players want times that grow.
    clock += 1e-3 * np.cumsum(np.diff(clock, prepend=-1.0) <= 1e-6)
    stands = [~one.fallen for one in path] or [np.ones(response.assembly.n_blocks, dtype=bool)]
    stands += stands[-1:] * (len(moments) - len(stands))
    return clock, [pose for _, pose, _ in moments], [ties for *_, ties in moments], np.array(stands)


def _courses(
    response: solver.Response, poses: Sequence[solver.Pose], tied: Sequence[mechanics.TieForces], stands: np.ndarray
) -> dict[str, np.ndarray]:
    """Arrays (n, n_blocks + n_ties, 3 or 4) of what a node of glTF has; arguments as :func:`_played` gives them."""
    moves = [_as_gltf(pose, response.assembly.dimension) for pose in poses]
    places, turns = np.array([place for place, _ in moves]), np.array([turn for _, turn in moves])
    # Of the two quaternions of a rotation the one next to the last: players go the short way.
    for k in range(1, len(turns)):
        turns[k] *= np.where((turns[k] * turns[k - 1]).sum(axis=1, keepdims=True) < 0.0, -1.0, 1.0)
    sizes = np.repeat(stands[:, :, None].astype(float), 3, axis=2)
    both = zip((places, turns, sizes), _rods(response, poses, tied), strict=True)
    whole = [np.concatenate(of_blocks_and_rods, axis=1) for of_blocks_and_rods in both]
    return dict(zip(("translation", "rotation", "scale"), whole, strict=True))


def _rods(
    response: solver.Response, poses: Sequence[solver.Pose], tied: Sequence[mechanics.TieForces]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Places (n, n_ties, 3), quaternions (n, n_ties, 4) and scales (n, n_ties, 3) of rods along z.

    ``tied`` (n,) is what they do at the poses, or nothing.
    """
    assembly, ties = response.assembly, response.ties
    ends = np.array([mechanics.tie_ends(ties, assembly, pose) for pose in poses]).reshape(
        len(poses), len(ties), 2, assembly.dimension
    )
    if assembly.dimension == 2:
        ends = np.concatenate([ends, np.zeros((*ends.shape[:3], 1))], axis=3)
    else:
        ends = UPRIGHT.apply(ends.reshape(-1, 3)).reshape(ends.shape)
    along = ends[:, :, 1] - ends[:, :, 0]
    length = np.linalg.norm(along, axis=2, keepdims=True)
    # From z to a direction by half a turn about the line midway between the two.
    midway = along / length + np.array([0.0, 0.0, 1.0])
    midway[np.linalg.norm(midway, axis=2) < 1e-9] = [1.0, 0.0, 0.0]
    midway /= np.linalg.norm(midway, axis=2, keepdims=True)
    turns = np.concatenate([midway, np.zeros_like(length)], axis=2)
    there = np.zeros((len(poses), len(ties), 1))
    for k, found in enumerate(tied):
        if len(found.states) == len(ties):
            there[k, :, 0] = ~np.isin(found.states, (mechanics.ABSENT, mechanics.BROKEN))
    radius = np.full((*length.shape[:2], 2), 0.03 * assembly.block_size)
    return ends.mean(axis=2), turns, there * np.concatenate([radius, length], axis=2)


def _rod_name(tie: solver.Tie) -> str:
    return f"[ties] {tie.name}"


def _as_gltf(pose: solver.Pose, dimension: int) -> tuple[np.ndarray, np.ndarray]:
    """(n_blocks, 3) places and (n_blocks, 4) quaternions, with y upwards."""
    if dimension == 3:
        return UPRIGHT.apply(pose.positions), (UPRIGHT * Rotation.from_rotvec(pose.rotations)).as_quat()
    flat = np.zeros((len(pose.positions), 1))
    spins = np.hstack([flat, flat, pose.rotations.reshape(-1, 1)])
    return np.hstack([pose.positions, flat]), Rotation.from_rotvec(spins).as_quat()


def _still(assembly: solver.Assembly, ties: Sequence[solver.Tie]) -> Any:
    """Make a scene of the blocks about their centroids, each a node with its row in the extras, and rods for ties."""
    import trimesh

    layout = layout_of(assembly)
    scene = trimesh.Scene(base_frame=BASE_FRAME)

    def add(name: str, mesh: trimesh.Trimesh, colour: Sequence[int]) -> None:
        paint = trimesh.visual.material.PBRMaterial(
            baseColorFactor=[*colour, 255], metallicFactor=0.0, roughnessFactor=0.9
        )
        mesh.visual = trimesh.visual.TextureVisuals(material=paint)
        scene.add_geometry(mesh, node_name=name, geom_name=name)

    colours = palette.block_colours(assembly.materials, assembly.free).tolist()
    rows = zip(assembly.names, solids_of(layout), rows_of(layout), colours, strict=True)
    for number, (name, (points, faces), row, colour) in enumerate(rows):
        about = points.copy()
        about[:, : assembly.dimension] -= assembly.centroids[number]
        mesh = trimesh.Trimesh(about, triangles_of(points, faces), process=False, metadata={"blockvis": row})
        add(name, mesh, colour)
    for tie in ties:
        add(_rod_name(tie), trimesh.creation.cylinder(radius=1.0, height=1.0, sections=12), palette.TIE)
    return scene
