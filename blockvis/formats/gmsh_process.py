"""Gmsh in a process of its own: ``python -m blockvis.formats.gmsh_process IN OUT CHORDS``.

A geometry script can loop for ever, fill the memory or crash the library; in its own process it harms nothing else.
OUT is a mesh (.msh) if the file has surfaces only, or bodies of triangles (.json) if it has volumes; the last line on
standard output says which. CHORDS is the number of chords of a full circle.
"""

from __future__ import annotations

import json
import sys

#: Exit code for a library that cannot be loaded.
NO_LIBRARY = 3


def main(source: str, target: str, chords: str) -> int:
    """Mesh a geometry file and write its surfaces or bodies; return the exit code, 0 on success."""
    try:
        import gmsh
    except (ImportError, OSError) as error:
        sys.stderr.write(str(error))
        return NO_LIBRARY
    gmsh.initialize(["gmsh", "-nopopup"], readConfigFiles=False, interruptible=False)
    try:
        options = {
            "General.Terminal": 0,
            "General.NumThreads": 1,
            "Mesh.MeshSizeFromCurvature": float(chords),
            "Mesh.MeshSizeExtendFromBoundary": 1,
            "Mesh.MshFileVersion": 4.1,
            "Mesh.Binary": 0,
        }
        for name, value in options.items():
            gmsh.option.setNumber(name, value)
        gmsh.option.setString("Geometry.OCCTargetUnit", "M")
        gmsh.open(source)
        volumes = [tag for _, tag in gmsh.model.getEntities(3)]
        gmsh.model.mesh.generate(2)
        if volumes:
            with open(target + ".json", "w", encoding="utf-8") as stream:
                json.dump([_body(gmsh, tag) for tag in volumes], stream)
        else:
            gmsh.write(target + ".msh")
    except Exception as error:  # noqa: BLE001
        # gmsh raises a bare Exception with the last line of its log.
        sys.stderr.write(str(error))
        return 1
    finally:
        gmsh.finalize()
    sys.stdout.write("json" if volumes else "msh")
    return 0


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
            for face in ring.reshape(-1, 3) if kind == 2 else []:
                for node in face:
                    if int(node) not in number:
                        number[int(node)] = len(points)
                        points.append(place[int(node)])
                faces.append([number[int(node)] for node in face])
    return {"name": name or f"volume {tag}", "group": group, "groups": len(groups), "points": points, "faces": faces}


if __name__ == "__main__":
    raise SystemExit(main(*sys.argv[1:4]))
