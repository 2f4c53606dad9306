"""Bodies of .dxf drawings: polyface meshes, as CAD and BIM programs export them, meshes, and flat-faced solids."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from ezdxf.acis import api
from ezdxf.render import MeshBuilder

from blockvis.layout.layout import Layout
from blockvis.layout.solids import fans
from solver.mechanics import counted

from .bodies import Bodies, Body
from .cells import Mesh, found_in_meshes
from .closed_surfaces import closed_bodies
from .reading import Reading

#: Solids whose geometry is that of the ACIS kernel, of which ezdxf knows the flat faces.
SOLIDS = ("3DSOLID", "BODY")


def said_by_layer(layer: str) -> dict[str, Any]:
    """Say what a layer says of a block on it."""
    return {"group": layer, **({"material": layer} if layer != "0" else {})}


def is_mesh(entity: Any) -> bool:
    """Whether an entity is a mesh or a solid in space."""
    kind = entity.dxftype()
    return (
        kind in SOLIDS
        or kind == "MESH"
        or (kind == "POLYLINE" and (entity.is_poly_face_mesh or entity.is_polygon_mesh))
    )


def drawn_mesh(entity: Any, handle: str) -> Mesh:
    """Take the mesh of an entity, as placed by the blocks that insert it."""
    kind, layer = entity.dxftype(), str(entity.dxf.layer)
    curved = ""
    if kind in SOLIDS:
        meshes, curved = _flat_faces(entity)
    else:
        meshes = [MeshBuilder.from_mesh(entity) if kind == "MESH" else MeshBuilder.from_polyface(entity)]
    points, faces = [np.zeros((0, 3))], list[list[int]]()
    for mesh in meshes:
        start = sum(map(len, points))
        points.append(np.array([tuple(vertex) for vertex in mesh.vertices]).reshape(-1, 3))
        faces += [[start + int(k) for k in face] for face in mesh.faces if len(face) > 2]
    return Mesh(np.concatenate(points), faces, {"name": f"block {handle}", **said_by_layer(layer)}, curved)


def _flat_faces(entity: Any) -> tuple[list[Any], str]:
    """Meshes of the flat faces of a solid, and its kind if it has others."""
    try:
        bodies = list(api.load_dxf(entity))
        meshes = [mesh for body in bodies for mesh in api.mesh_from_body(body)]
        drawn = sum(1 for body in bodies for lump in body.lumps() for shell in lump.shells() for _ in shell.faces())
        matrix = entity.temporary_transformation().get_matrix()
    except (api.AcisException, ValueError, TypeError, LookupError, AttributeError, ArithmeticError):
        return [], entity.dxftype()
    if matrix is not None:
        for mesh in meshes:
            mesh.transform(matrix)
    whole = 0 < drawn == sum(len(mesh.faces) for mesh in meshes)
    return meshes, "" if whole else entity.dxftype()


def meshes_of_faces(drawn: Sequence[tuple[str, str, np.ndarray]]) -> list[Mesh]:
    """Join 3DFACEs, those of a layer and of an inserted block together; none where none of these encloses a body.

    Given are layer, name and (n, 3) corners of each.
    """
    together: dict[tuple[str, str], list[tuple[str, np.ndarray]]] = {}
    for layer, name, ring in drawn:
        together.setdefault((layer, name.rpartition(".")[0]), []).append((name, ring))
    meshes, closed = [], False
    for (layer, _), faces in together.items():
        rings = [ring for _, ring in faces]
        starts = np.cumsum([0, *map(len, rings)])
        numbers = [list(range(start, start + len(ring))) for start, ring in zip(starts.tolist(), rings, strict=False)]
        meshes.append(Mesh(np.concatenate(rings), numbers, {"name": faces[0][0], **said_by_layer(layer)}))
        try:
            size = float(np.ptp(meshes[-1].points, axis=0).max())
            closed = closed or bool(closed_bodies(Body("", meshes[-1].points, fans(numbers)), size))
        except ValueError:
            continue
    return meshes if closed else []


def layout_of_meshes(meshes: Sequence[Mesh], reading: Reading, unit: str, notes: Sequence[str]) -> Layout | Bodies:
    """Make bodies of the meshes of a drawing, or outlines where all of them are flat."""
    curved = [mesh for mesh in meshes if mesh.curved]
    if curved:
        first = curved[0]
        raise ValueError(
            f"{first.curved} '{first.row['name']}' on layer '{first.row['group']}' has faces of the ACIS "
            f"kernel that are not read ({len(curved)} of {counted(len(meshes), 'body', 'bodies')}): export the bodies "
            "as .stl (AutoCAD: STLOUT) or .step, or leave it out (ignore)"
        )
    found = found_in_meshes(meshes, reading)
    return replace(found, unit=unit, notes=(*found.notes, *notes))
