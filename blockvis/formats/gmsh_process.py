"""Gmsh in a process of its own.

A geometry script can loop for ever, fill the memory or crash the library; in its own process it harms nothing else.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from blockvis.system.worker import Say, end_with_caller, serve

#: Points of a curve at which its direction is looked at.
SAMPLES = 129

#: Faces that are bent both ways are within such a part of the mean depth of their body (volume by surface) of it.
SAGITTA = 0.03

#: Chords of one curve: finer than any drawing.
MOST_CHORDS = 4096


def main() -> None:
    """Mesh the geometry file that comes in, and say its bodies, or the mesh file of what has surfaces only."""
    serve(_answer)


def _answer(say: Say, word: str, about: Any) -> bool:
    end_with_caller()
    say(*_meshed(*about))
    return True


def _meshed(source: str, target: str, chords: int, memory: int, most: int) -> tuple[str, Any]:
    """Mesh a geometry file with so many chords of a full circle, and so many bytes of memory.

    Faces that are bent both ways have at most so many triangles of equal sides, of which plane faces are joined.

    Gives "bodies" and these, of triangles, if it has volumes; else "mesh", which is then in the target (.msh).
    Raises ``ImportError`` if the library cannot be loaded, and ``Exception`` as gmsh does.
    """
    try:
        import gmsh
    except OSError as error:
        raise ImportError(str(error)) from None
    gmsh.initialize(["gmsh", "-nopopup"], readConfigFiles=False, interruptible=False)
    _limit_memory(memory)
    try:
        options = {
            "General.Terminal": 0,
            "General.NumThreads": 1,
            "Mesh.MshFileVersion": 4.1,
            "Mesh.Binary": 0,
            # No points within a face: on a curved one triangles between such points lie across each other.
            "Mesh.Algorithm": 8,
        }
        for name, value in options.items():
            gmsh.option.setNumber(name, value)
        # The numbers of a STEP file come in mm, whatever its unit; a BREP file states none.
        gmsh.option.setString("Geometry.OCCTargetUnit", "MM")
        gmsh.open(source)
        volumes = [tag for _, tag in gmsh.model.getEntities(3)]
        _only_outlines(gmsh, chords)
        _points_within(gmsh, most)
        gmsh.model.mesh.generate(2)
        if volumes:
            return "bodies", [_body(gmsh, tag) for tag in volumes]
        gmsh.write(target)
        return "mesh", None
    finally:
        gmsh.finalize()


def _limit_memory(most: int) -> None:
    """Limit the memory [bytes] that this process may take from now on, where the platform can.

    What it has mapped already is not counted: libraries, and the stacks and arenas of threads, of which the linear
    algebra starts one per processor, so that the same file would need more of the limit on a larger machine.
    """
    try:
        import resource
    except ImportError:  # Windows has no such limits
        return
    try:
        with open("/proc/self/statm", encoding="ascii") as pages:
            most += int(pages.read().split()[0]) * resource.getpagesize()
    except OSError:  # only Linux has it
        pass
    _, hard = resource.getrlimit(resource.RLIMIT_AS)
    most = most if hard == resource.RLIM_INFINITY else min(most, hard)
    try:
        resource.setrlimit(resource.RLIMIT_AS, (most, hard))
    except (ValueError, OSError):  # macOS refuses some
        return


def _only_outlines(gmsh, chords: int) -> None:  # type: ignore[no-untyped-def]
    """Have curves meshed by as many chords as their bends ask for, and nothing finer than them within the surfaces.

    Sizes from the curvature, which gmsh would compute itself, take its built-in kernel a minute for a quarter circle.
    """
    low = np.reshape([gmsh.model.getBoundingBox(*entity)[:3] for entity in gmsh.model.getEntities(2)], (-1, 3))
    high = np.reshape([gmsh.model.getBoundingBox(*entity)[3:] for entity in gmsh.model.getEntities(2)], (-1, 3))
    size = float(np.linalg.norm(high.max(axis=0) - low.min(axis=0))) if len(low) else 1.0
    gmsh.model.mesh.removeConstraints()
    for name in ("FromPoints", "FromCurvature", "ExtendFromBoundary", "FromParametricPoints"):
        gmsh.option.setNumber(f"Mesh.MeshSize{name}", 0)
    gmsh.option.setNumber("Mesh.MeshSizeMin", size)
    gmsh.option.setNumber("Mesh.MeshSizeMax", 1e3 * size)
    for _, tag in gmsh.model.getEntities(1):
        gmsh.model.mesh.setTransfiniteCurve(tag, 1 + _chords(gmsh, tag, 2.0 * math.pi / chords))


def _points_within(gmsh, most: int) -> None:  # type: ignore[no-untyped-def]
    """Have the faces that are bent both ways meshed with points within: their outlines say nothing of their bulge."""
    size: dict[int, float] = {}
    # The built-in kernel of .geo tells no volumes.
    for _, volume in gmsh.model.occ.getEntities(3):
        faces = [tag for _, tag in gmsh.model.getBoundary([(3, volume)], oriented=False)]
        bends = {face: bend for face in faces if (bend := _bend_both_ways(gmsh, face)) > 0.0}
        if bends:
            area = {face: gmsh.model.occ.getMass(2, face) for face in faces}
            off = SAGITTA * gmsh.model.occ.getMass(3, volume) / sum(area.values())
            # A triangle of the side h has an area of 0.43 h², and is off a face of the curvature k by k h² / 8.
            off = max(off, sum(area[face] * bend for face, bend in bends.items()) / (0.43 * 8.0 * most))
            size |= {face: math.sqrt(8.0 * off / bend) for face, bend in bends.items()}
    if not size:
        return
    coarse = gmsh.option.getNumber("Mesh.MeshSizeMax")
    gmsh.option.setNumber("Mesh.MeshSizeMin", 0)
    gmsh.model.mesh.setSizeCallback(lambda dim, tag, x, y, z, lc: size.get(tag, coarse) if dim == 2 else coarse)
    for face in size:
        gmsh.model.mesh.setAlgorithm(2, face, 5)


def _bend_both_ways(gmsh, face: int) -> float:  # type: ignore[no-untyped-def]
    """Mean of the larger curvature of a face; 0 for what is plane, or straight one way as a cylinder or cone."""
    if gmsh.model.getType(2, face) in ("Plane", "Cylinder", "Cone"):
        return 0.0
    low, high = gmsh.model.getParametrizationBounds(2, face)
    grid = np.meshgrid(*(np.linspace(a, b, 9)[1:-1] for a, b in zip(low, high, strict=True)))
    found = gmsh.model.getPrincipalCurvatures(face, np.stack(grid, axis=-1).ravel())[:2]
    less, more = np.sort(np.abs(found), axis=0)
    return float(more.mean()) if less.max() > 1e-6 * more.max() else 0.0


def _chords(gmsh, curve: int, widest: float) -> int:  # type: ignore[no-untyped-def]
    """Count the equal chords of a curve: none may turn by more than the widest angle [rad]."""
    first, last = (float(end[0]) for end in gmsh.model.getParametrizationBounds(1, curve))
    along = np.reshape(gmsh.model.getDerivative(1, curve, np.linspace(first, last, SAMPLES)), (-1, 3))
    speed = np.linalg.norm(along, axis=1)
    direction = along[speed > 0] / speed[speed > 0][:, None]
    length = (speed[1:] + speed[:-1])[: max(len(direction) - 1, 0)] / 2.0
    turn = np.arccos(np.clip((direction[1:] * direction[:-1]).sum(axis=1), -1.0, 1.0))
    if not len(turn) or turn.sum() < 1e-9:
        return 1
    even = float(turn.sum()) / widest
    # Chords are of equal length: where a curve bends more than elsewhere, more of them are needed.
    sharpest = float((turn / np.maximum(length, 1e-300)).max() * length.sum()) / widest
    return min(math.ceil(min(sharpest, 4.0 * even) - 1e-6), MOST_CHORDS)


def _body(gmsh, tag: int) -> dict[str, object]:  # type: ignore[no-untyped-def]
    groups = gmsh.model.getPhysicalGroupsForEntity(3, tag)
    group = gmsh.model.getPhysicalName(3, groups[0]) if len(groups) else ""
    name = gmsh.model.getEntityName(3, tag).rsplit("/", 1)[-1]
    number: dict[int, int] = {}
    points: list[list[float]] = []
    faces: list[list[int]] = []
    for _, surface in gmsh.model.getBoundary([(3, tag)], oriented=False):
        nodes, coordinates, _ = gmsh.model.mesh.getNodes(2, surface, includeBoundary=True)
        place = {int(node): coordinates[3 * k : 3 * k + 3].tolist() for k, node in enumerate(nodes)}
        kinds, _, connected = gmsh.model.mesh.getElements(2, surface)
        for kind, ring in zip(kinds, connected, strict=True):
            for face in _triangles(int(kind), ring):
                for node in face:
                    if int(node) not in number:
                        number[int(node)] = len(points)
                        points.append(place[int(node)])
                faces.append([number[int(node)] for node in face])
    # Where a STEP file names no solid, gmsh gives the name of the translator.
    name = "" if name.startswith("Open CASCADE STEP translator") else name
    found = {"name": name or f"volume {tag}", "group": group, "groups": len(groups), "points": points, "faces": faces}
    return found | ({"volume": gmsh.model.occ.getMass(3, tag)} if (3, tag) in gmsh.model.occ.getEntities(3) else {})


def _triangles(kind: int, nodes: np.ndarray) -> np.ndarray:
    """(n, 3) int array: elements of triangles, and of quadrangles that extruded or recombined surfaces have."""
    if kind == 2:
        return nodes.reshape(-1, 3)
    if kind == 3:
        return nodes.reshape(-1, 4)[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3)
    return np.zeros((0, 3), dtype=np.int64)
