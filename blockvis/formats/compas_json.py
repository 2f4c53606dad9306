"""Assemblies, block models and lists of meshes of COMPAS, .json, as its versions from 0.15 to 2 write them.

What holds blocks is found by its shape, not by the name of the class, which changed: a mesh is whatever has vertices
and faces, an assembly a graph whose nodes have blocks, a model a list of elements with a geometry (https://compas.dev).
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from blockvis.layout.block_table import rows_of
from blockvis.layout.layout import Layout
from blockvis.layout.left_out import passed_over
from blockvis.layout.outlines import is_flat
from blockvis.layout.solids import Solid, box
from solver import mechanics
from solver.mechanics import counted

from .bodies import Bodies
from .cells import Mesh, found_in_meshes, layout_of_cells
from .reading import DEEPEST, Reading

#: Keys of what lies between blocks, which may hold meshes of its own.
_BETWEEN = {"edge", "adjacency", "interfaces", "interface", "contacts", "interactions", "facedata", "edgedata"}


@dataclass(frozen=True)
class _Context:
    """What is known of a mesh from the objects around it; what is passed over is counted for the whole file."""

    name: str = ""
    group: str = ""
    support: bool = False
    material: Mapping[str, Any] = field(default_factory=dict)
    matrix: np.ndarray = field(default_factory=lambda: np.eye(4))
    depth: int = 0
    passed: Counter[str] = field(default_factory=Counter)


def read_content(content: Any, path: Path, reading: Reading) -> Layout | Bodies | None:
    """Read the blocks of a parsed .json file; None if it holds no mesh."""
    meshes: list[Mesh] = []
    context = _Context()
    try:
        meshes.extend(_meshes(content, context))
    except (LookupError, TypeError, AttributeError, OverflowError) as error:
        raise ValueError(
            f"it has a mesh of COMPAS that cannot be read, number {len(meshes) + 1} ({type(error).__name__} "
            f"{error}); export it again"
        ) from None
    if not meshes:
        return None
    found = _layout_of(meshes, reading)
    return replace(found, notes=(*found.notes, *passed_over(context.passed)))


def _layout_of(meshes: list[Mesh], reading: Reading) -> Layout | Bodies:
    """Make blocks of meshes: each is one, but of a single one in a plane each face."""
    if len({mesh.row["name"] for mesh in meshes}) < len(meshes):
        # COMPAS names a mesh after its class unless it is told otherwise.
        meshes = [replace(mesh, row={**mesh.row, "name": f"block {mesh.row['key']}"}) for mesh in meshes]
    if len(meshes) == 1 and is_flat(meshes[0].points):
        rings = [np.array(face) for face in meshes[0].faces]
        return layout_of_cells(meshes[0].points, rings, {"block_id": np.arange(len(rings))}, reading.view)
    found = found_in_meshes(meshes, reading)
    if isinstance(found, Layout):
        return found
    return replace(found, notes=(f"{counted(len(found.bodies), 'block')} of COMPAS", *found.notes))


def _meshes(value: Any, context: _Context) -> Iterator[Mesh]:
    """Yield the meshes of an object and of those within it."""
    if context.depth > DEEPEST:
        return
    context = replace(context, depth=context.depth + 1)
    data, name = _unwrapped(value)
    if isinstance(data, list):
        for k, item in enumerate(data):
            if isinstance(item, dict | list):
                yield from _meshes(item, replace(context, name=f"{context.name}.{k}" if context.name else str(k)))
        return
    if not isinstance(data, dict):
        return
    shape = _shape(data)
    if isinstance(data.get("elements"), dict | list) and "graph" in data:
        yield from _of_model(data, context)
    elif isinstance(data.get("assembly"), dict) and isinstance(data.get("blocks"), dict):
        yield from _of_old_assembly(data, context)
    elif isinstance(data.get("node"), dict):
        yield from _of_graph(data, context)
    elif shape is not None:
        yield _mesh(*shape, data, name, context)
    else:
        for key, item in data.items():
            if isinstance(item, dict | list) and key not in _BETWEEN:
                support = context.support or "support" in key.lower()
                named = key not in ("graph", "data", "model", "blocks")
                within = replace(context, support=support, group=key if named else context.group)
                yield from _meshes(item, within)


def _unwrapped(value: Any) -> tuple[Any, str]:
    """Take the data out of what COMPAS wraps around them, and the name that it gives."""
    name = ""
    for _ in range(4):
        if not isinstance(value, dict) or not ("dtype" in value or "datatype" in value) or "node" in value:
            break
        inner = value.get("data", value.get("value"))
        if inner is None:
            break
        name = str(value.get("name") or name)
        value = inner
    return value, name


def _of_graph(data: dict[str, Any], context: _Context) -> Iterator[Mesh]:
    default = data.get("default_node_attributes") or data.get("dna") or data.get("node_attributes") or {}
    for key, node in data["node"].items():
        attributes = {**default, **node}
        # A part of COMPAS has its geometry in place; its frame is a mark on it.
        part = _unwrapped(attributes.get("part"))[0]
        of_part = (part.get("attributes") if isinstance(part, dict) else None) or {}
        block = attributes.get("block") or of_part.get("geometry")
        if block is None:
            context.passed["nodes without a block"] += 1
            continue
        support = context.support or bool(attributes.get("is_support") or of_part.get("is_support"))
        for mesh in _meshes(block, replace(context, name=str(key), support=support)):
            own = of_part.get("name")
            yield replace(mesh, row={**mesh.row, "name": str(own)}) if own else mesh


def _of_old_assembly(data: dict[str, Any], context: _Context) -> Iterator[Mesh]:
    """Yield the blocks of an assembly that keeps them apart from its nodes, as of before 1.0."""
    graph, _ = _unwrapped(data["assembly"])
    default = graph.get("node_attributes") or graph.get("dva") or {}
    nodes = graph.get("node") or graph.get("vertex") or {}
    together = {key: {**(nodes.get(key) or {}), "block": block} for key, block in data["blocks"].items()}
    yield from _of_graph({"node": together, "node_attributes": default}, context)


def _of_model(data: dict[str, Any], context: _Context) -> Iterator[Mesh]:
    """Yield the elements of a model at their places."""
    elements = data["elements"]
    listed = list(elements.values()) if isinstance(elements, dict) else elements
    known = [(str(element.get("guid", k)), *_unwrapped(element)) for k, element in enumerate(listed)]
    materials = data.get("materials") or {}
    listed = list(materials.values()) if isinstance(materials, dict) else materials
    material_of = {str(material.get("guid", k)): _unwrapped(material)[0] for k, material in enumerate(listed)}
    whose = data.get("element_material") or {}
    matrices = _places(data, {guid: element for guid, element, _ in known}, context.matrix @ _matrix(data))
    for k, (guid, element, name) in enumerate(known):
        geometry = element.get("geometry") or element.get("shape")
        if geometry is None:
            context.passed["elements without geometry"] += 1
            continue
        within = replace(
            context,
            name=str(k),
            support=context.support or bool(element.get("is_support")),
            material=material_of.get(str(whose.get(guid) or element.get("material")), {}),
            matrix=matrices.get(guid, context.matrix),
        )
        found = list(_meshes(geometry, within))
        if not found:
            raise ValueError(
                f"element {k} ('{name or element.get('name')}') of the model has a geometry that is no mesh "
                f"({geometry.get('dtype', 'of another kind')}); export the blocks as meshes"
            )
        yield from found


def _places(data: dict[str, Any], elements: Mapping[str, Any], root: np.ndarray) -> dict[str, np.ndarray]:
    """Find the (4, 4) matrix of each element of a model: those of its parents in the tree, then its own."""
    places = {guid: root @ _matrix(element) for guid, element in elements.items()}
    tree = data.get("tree")
    top = _unwrapped(tree)[0].get("root") if isinstance(tree, dict) else None
    waiting = [(child, root) for child in (top or {}).get("children") or []]
    while waiting:
        node, matrix = waiting.pop()
        guid = str(node.get("element"))
        if guid in elements:
            matrix = matrix @ _matrix(elements[guid])
            places[guid] = matrix
        waiting += [(child, matrix) for child in node.get("children") or []]
    return places


def _matrix(data: Mapping[str, Any]) -> np.ndarray:
    """(4, 4) array: the transformation of an element or model, or that of its frame."""
    transformation = _unwrapped(data.get("transformation"))[0]
    if isinstance(transformation, dict):
        numbers = np.array(transformation["matrix"], dtype=float)
        if numbers.size != 16:
            called = data.get("name") or data.get("guid") or "without a name"
            raise ValueError(f"the transformation of '{called}' has {numbers.size} numbers, not 4 × 4; export it again")
        return numbers.reshape(4, 4)
    return _of_frame(_unwrapped(data.get("frame"))[0])


def _of_frame(frame: Any) -> np.ndarray:
    """(4, 4) array: from the coordinates of a frame to those around it."""
    matrix = np.eye(4)
    if isinstance(frame, dict):
        x, y = (np.array(_unwrapped(frame[key])[0], dtype=float) for key in ("xaxis", "yaxis"))
        x = x / np.linalg.norm(x)
        z = np.cross(x, y)
        z = z / np.linalg.norm(z)
        matrix[:3, :3] = np.column_stack([x, np.cross(z, x), z])
        matrix[:3, 3] = np.array(_unwrapped(frame["point"])[0], dtype=float)
    return matrix


def _shape(data: dict[str, Any]) -> Solid | None:
    """(n, 3) points and faces of a mesh, a polyhedron, a box or a polygon; None for anything else."""
    if data.get("vertex") and isinstance(data["vertex"], dict) and isinstance(data.get("face"), dict) and data["face"]:
        default = data.get("default_vertex_attributes") or data.get("dva") or {}
        number = {str(key): k for k, key in enumerate(data["vertex"])}
        points = [[float({**default, **v}.get(axis, 0.0)) for axis in "xyz"] for v in data["vertex"].values()]
        faces = [[number[str(key).strip("'\"")] for key in face] for face in data["face"].values() if face]
        # Some files hold each face twice.
        once = {frozenset(face): face for face in faces if len(face) > 2}
        return np.array(points).reshape(-1, 3), list(once.values())
    return _shape_of_lists(data)


def _shape_of_lists(data: dict[str, Any]) -> Solid | None:
    """Give points and faces of a polyhedron, a box or a polygon; None for anything else."""
    if data.get("vertices") and data.get("faces") and isinstance(data["vertices"], list):
        corners = np.array([_unwrapped(point)[0] for point in data["vertices"]], dtype=float).reshape(-1, 3)
        return corners, [[int(k) for k in face] for face in data["faces"]]
    if {"xsize", "ysize", "zsize"} <= set(data):
        half = np.array([float(data[key]) for key in ("xsize", "ysize", "zsize")]) / 2.0
        corners, faces = box(-half, half)
        matrix = _of_frame(_unwrapped(data.get("frame"))[0])
        return corners @ matrix[:3, :3].T + matrix[:3, 3], faces
    if isinstance(data.get("points"), list) and set(data) == {"points"} and len(data["points"]) > 2:
        corners = np.array([_unwrapped(point)[0] for point in data["points"]], dtype=float).reshape(-1, 3)
        corners = corners[:-1] if (corners[0] == corners[-1]).all() else corners
        return corners, [list(range(len(corners)))]
    return None


def _mesh(points: np.ndarray, faces: list[list[int]], data: dict[str, Any], name: str, context: _Context) -> Mesh:
    attributes = data.get("attributes") or {}
    support = context.support or bool(attributes.get("is_support"))
    row: dict[str, Any] = {
        "key": context.name or "0",
        "name": name or str(attributes.get("name") or f"block {context.name or 0}"),
    }
    if context.group:
        row["group"] = context.group
    if support:
        row["role"] = mechanics.FIXED
    # What our own writer says of a block, which COMPAS keeps and hands on.
    row |= {key: str(attributes[key]) for key in ("role", "material") if isinstance(attributes.get(key), str)}
    if context.material.get("name"):
        row["material"] = str(context.material["name"])
    density = context.material.get("density", attributes.get("density"))
    if density:
        row["density"] = density
    outside = [k for face in faces for k in face if not 0 <= k < len(points)]
    if outside:
        raise IndexError(f"a face uses point {outside[0]} of {len(points)}")
    matrix = context.matrix
    return Mesh(points @ matrix[:3, :3].T + matrix[:3, 3], faces, row)


def write(layout: Layout, path: Path) -> None:
    """Write the blocks of a layout in space as meshes of COMPAS 2: its ``json_load`` gives blocks and supports."""
    lists: dict[str, list[dict[str, Any]]] = {"blocks": [], "supports": []}
    for (points, faces), row in zip(layout.solids, rows_of(layout), strict=True):
        support = row.get("role") in (mechanics.FIXED, mechanics.MOVING)
        data = {
            "attributes": {**{key: value for key, value in row.items() if key != "name"}, "is_support": support},
            "default_vertex_attributes": {"x": 0.0, "y": 0.0, "z": 0.0},
            "default_edge_attributes": {},
            "default_face_attributes": {},
            "vertex": {str(k): dict(zip("xyz", map(float, point), strict=True)) for k, point in enumerate(points)},
            "face": {str(k): list(face) for k, face in enumerate(faces)},
            "facedata": {},
            "edgedata": {},
            "max_vertex": len(points) - 1,
            "max_face": len(faces) - 1,
        }
        mesh = {"dtype": "compas.datastructures/Mesh", "data": data, "name": str(row["name"])}
        lists["supports" if support else "blocks"].append(mesh)
    path.write_text(json.dumps(lists, ensure_ascii=False), encoding="utf-8")
