"""COLLADA files, .dae, as SketchUp and Blender write them, through pycollada (extra ``dae``)."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from blockvis.layout.units import unit_of
from blockvis.system.extras import require

from .bodies import Bodies, Body, drawn_row
from .reading import DEEPEST, parsing

#: Coordinates in the order in which the last points up, by the file's word for it.
UP = {"X_UP": ([1, 2, 0], "z"), "Y_UP": ([0, 1, 2], "y"), "Z_UP": ([0, 1, 2], "z")}


def drawn_in(path: Path) -> Bodies:
    """Read the meshes of a file, each placed by the nodes above it and named after the innermost that has a name."""
    require("dae", f"COLLADA files ('{path}'; .obj and .glb are read without)")
    with parsing(".dae"):
        return _drawn_in(path)


def _drawn_in(path: Path) -> Bodies:
    import collada

    text = path.read_bytes()
    if re.search(rb"<!\s*(DOCTYPE|ENTITY)", text, re.IGNORECASE):
        raise ValueError("it defines XML entities")
    # Faults of materials and cameras are no matter here; of geometry they are.
    document = collada.Collada(str(path), ignore=[collada.common.DaeError])
    announced = len(re.findall(rb"<(?:\w+:)?geometry\s", text))
    if len(document.geometries) < announced:
        damaged = f"{announced - len(document.geometries)} of {announced} geometries are damaged"
        raise ValueError(f"{damaged}: {document.errors[-1]}" if document.errors else damaged)
    if any(map(_has_nan, document.geometries)):
        raise ValueError("it has NaN for a number; coordinates must be finite")
    broken = (error.msg for error in document.errors if isinstance(error, collada.common.DaeBrokenRefError))
    lost = next((words for words in broken if re.match("Geometry|Controller|Node", words)), None)
    if lost is not None:
        raise ValueError(f"it places what is not in it: {lost}")
    about = document.assetInfo
    order, up = UP.get(str(about.upaxis), UP["Y_UP"])
    metres = float(about.unitmeter or 1.0)
    parts, paths = list[Body](), list[list[str]]()
    for names, matrix, geometry in _placed(document.scene.nodes if document.scene else [], np.eye(4), (), 0):
        points, faces = _mesh(geometry)
        points = points @ matrix[:3, :3].T + matrix[:3, 3]
        if len(faces):
            *around, name = names or [str(geometry.name or geometry.id)]
            parts.append(Body(name, points[:, order], faces))
            paths.append(around)
    parts = said_below(parts, paths, [[]] * len(parts))
    says = "y is up, as the file says" if up == "y" else ""
    return Bodies(parts, unit_of(metres) or f"{metres!r} m", up=up, up_says=says)


def said_below(parts: Sequence[Body], paths: Sequence[Sequence[str]], materials: Sequence[Sequence[str]]) -> list[Body]:
    """Say of bodies what their materials and the nodes around say, but for those around all: these are the scene."""
    shared = min(map(len, paths), default=0)
    common = next((k for k in range(shared) if len({path[k] for path in paths}) > 1), shared)
    return [
        replace(part, said=drawn_row(part.name, path[common:], painted))
        for part, path, painted in zip(parts, paths, materials, strict=True)
    ]


def _placed(
    nodes: Any, matrix: np.ndarray, names: tuple[str, ...], depth: int
) -> Iterator[tuple[tuple[str, ...], np.ndarray, Any]]:
    """Yield the geometries below nodes, with the names of these, outside first, and the matrices that place them."""
    from collada.scene import GeometryNode, Node, NodeNode

    if depth > DEEPEST:
        raise ValueError(f"it nests nodes more than {DEEPEST} deep")
    for node in nodes:
        if isinstance(node, GeometryNode):
            yield names, matrix, node.geometry
        elif isinstance(node, NodeNode):
            yield from _placed([node.node], matrix, names, depth + 1)
        elif isinstance(node, Node):
            own = tuple(filter(None, [node.xmlnode.get("name") or node.xmlnode.get("id")]))
            placed = matrix @ np.asarray(node.matrix, dtype=float)
            yield from _placed(node.children, placed, (*names, *own), depth + 1)


def _has_nan(geometry: Any) -> bool:
    """Whether a point has NaN for a coordinate, which pycollada reads as 0; normals and textures are no matter here."""
    elements = [*geometry.xmlnode.iter()]
    places = {one.get("source", "")[1:] for one in elements if one.get("semantic") == "POSITION"}
    numbers = ("".join(one.itertext()) for one in elements if one.get("id") in places)
    return any(re.search(r"\bnan\b", text, re.IGNORECASE) for text in numbers)


def _mesh(geometry: Any) -> tuple[np.ndarray, np.ndarray]:
    """Points and triangles of a geometry: its primitives are one surface in several materials."""
    from trimesh.util import append_faces

    primitives = (one.triangleset() if hasattr(one, "triangleset") else one for one in geometry.primitives)
    parts = [one for one in primitives if np.ndim(one.vertex_index) == 2 and np.shape(one.vertex_index)[1] == 3]
    points, faces = append_faces([one.vertex for one in parts], [one.vertex_index for one in parts])
    return points.reshape(-1, 3).astype(float), faces.reshape(-1, 3).astype(np.int64)
