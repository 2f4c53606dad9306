"""Bodies in space or flat meshes, .stl .obj .ply .off .glb, through trimesh, and .dae."""

from __future__ import annotations

import json
import logging
import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from blockvis.layout.block_table import rows_of, with_rows
from blockvis.layout.layout import Layout, solids_of
from blockvis.layout.notes import CHANGED, LEFT_OUT, Note
from blockvis.layout.outlines import is_flat, spread_of
from blockvis.layout.solids import BASE_FRAME, Solid, area_vectors, fans, triangles_of
from blockvis.text import listed
from solver import mechanics
from solver.mechanics import counted

from . import dae
from .bodies import Bodies, Body, body_of_polygons, drawn_row, with_role
from .cells import layout_of_cells, merged
from .closed_surfaces import OpenSurface, enclosed
from .reading import Reading, json_object, parsing

#: Programs that write coordinates to .glb as they are, whichever of them is up, in small letters.
AS_THEY_ARE = ("trimesh",)

#: Corners this near to the lowest, in sizes of the whole, are in the face on which a body stands.
LEVEL = 1e-3

#: Of what is upright no more than this part of the bodies stands on the ground; of what lies on its side all may.
STANDING = 0.5

#: Words of an .obj file that name its objects, groups and materials.
_WORDS = ("o", "g", "usemtl")


def read(path: Path, reading: Reading) -> Layout | Bodies:
    """Read bodies or a flat mesh; .glb is in metres, .dae states its unit, the other formats state none."""
    suffix = path.suffix.lower()
    drawn = {".dae": dae.drawn_in, ".obj": _obj, ".off": _off}.get(suffix, _scene)(path)
    size = _checked_size(drawn.bodies)
    # A part that is no plane by its own size has to have a volume.
    if all(map(is_flat, [np.concatenate([part.points for part in drawn.bodies]), *(p.points for p in drawn.bodies)])):
        flat = _flat(drawn.bodies, path, reading.view)
        return replace(flat, unit=drawn.unit, notes=(*flat.notes, *drawn.notes))
    bodies, notes = _enclosed(drawn, size, path, reading)
    if suffix == ".glb":
        up, up_says = _up(path, bodies, size)
    else:
        # .dae states it, and we have z up where we write a row, with a name, for each block.
        stated = suffix == ".dae" or all("name" in part.said for part in drawn.bodies)
        up, up_says = drawn.up, drawn.up_says if stated else _stand_along_y(bodies, size)
    return replace(drawn, bodies=bodies, notes=(*notes, *drawn.notes), up=up, up_says=up_says)


def _enclosed(drawn: Bodies, size: float, path: Path, reading: Reading) -> tuple[list[Body], list[Note]]:
    from trimesh.util import append_faces

    try:
        return enclosed(drawn.bodies, size, reading)
    except OpenSurface as error:
        if not drawn.grouped:
            raise
        # Groups may be those of the faces of one stone.
        whole = Body(path.name, *append_faces(*zip(*((part.points, part.faces) for part in drawn.bodies), strict=True)))
        try:
            bodies, notes = enclosed([whole], size, reading)
        except ValueError:
            raise error from None
        groups = counted(len(drawn.bodies), "name of a group", "names of groups")
        said = f"{groups}, not closed by themselves; name blocks by 'o' lines"
        return bodies, [*notes, Note(LEFT_OUT, f"not read: {said}")]


@dataclass
class _Object:
    """Faces of an object of an .obj file, by the numbers of their points.

    ``words`` are those of their groups and materials by "g" and "usemtl", of which those in ``own`` are said for it.
    """

    faces: list[list[int]] = field(default_factory=list)
    words: dict[str, set[str]] = field(default_factory=lambda: {"g": set(), "usemtl": set()})
    own: set[str] = field(default_factory=set)

    def inherited(self, key: str) -> set[str]:
        """Words that hold still, as those said before other objects do in the format."""
        return set() if key in self.own else self.words[key] - {""}

    def roles(self, key: str) -> set[str]:
        """Words of others that are roles, which it does not take over: it would be fixed by its place in the file."""
        return {word for word in self.inherited(key) if with_role({"name": word}).get("role")}

    def row(self, name: str, named_by: str) -> dict[str, Any]:
        """Say its group, which it has if all its faces are in one, and does not name it; and its material."""
        groups, materials = (words - self.roles(key) for key, words in self.words.items())
        return drawn_row(name, [*groups] if len(groups) == 1 and named_by == "o" else (), materials)


def _obj(path: Path) -> Bodies:
    """Read the objects of an .obj file, or, where it has none, its groups, or else its materials, in their order."""
    text = _obj_text(path)
    there = re.findall(r"^[ \t]*(o|g|usemtl)[ \t]", text, re.MULTILINE)
    word = next((word for word in _WORDS if word in there), "o")
    # What is said once, before the first object, is said for all.
    of_all = {key for key in there[: there.index(word)] if there.count(key) == 1} if there else set[str]()
    points, objects = _obj_objects(text, word, of_all, path.name)
    parts = []
    for name, one in objects.items():
        outside = next((k for face in one.faces for k in face if not 0 <= k < len(points)), None)
        if outside is not None:
            raise ValueError(
                f"a face of '{name}' uses point {outside + 1}, but there are {len(points)}; export it again"
            )
        parts.append(body_of_polygons(name, points, one.faces, one.row(name, word)))
    parts = [part for part in parts if len(part.faces)]
    rows, notes = _own_rows(path), _inherited(objects)
    if word == "o" and rows:
        # Others may stand beside what we wrote, which is of the objects that still have its names.
        written = dict(zip(_distinct(rows), rows, strict=True))
        parts = [replace(part, said=written.get(part.name, part.said)) for part in parts]
        lost = [f"'{name}'" for name in written if name not in objects]
        told = f"not read: what blockvis wrote of {counted(len(lost), 'block')}, {listed(lost)}: no object"
        notes = [*notes, *[Note(LEFT_OUT, f"{told} is called so")] * bool(lost)]
    return Bodies(parts, grouped=word != "o", notes=notes)


def _obj_objects(text: str, word: str, of_all: set[str], unnamed: str) -> tuple[np.ndarray, dict[str, _Object]]:
    """(n, 3) array: the points of an .obj file; and its objects, which a word names, before the first ``unnamed``.

    Words that are ``of_all`` are said for each of them.
    """
    said, points, objects = dict.fromkeys(_WORDS, ""), list[list[float]](), dict[str, _Object]()
    since_name, since_face = set[str](), set[str]()
    for line in text.split("\n"):
        first, *rest = line.split() or [""]
        try:
            if first in _WORDS:
                if first == word:
                    # Some programs write group and material above the object.
                    since_name = of_all | since_face
                since_name.add(first)
                since_face.add(first)
                # SketchUp puts a number before the names of a group and of those around it, and "Model" behind.
                said[first] = re.sub(r"^Mesh\d+ (.+) Model$", r"\1", " ".join(rest))
            elif first == "v":
                x, y, z = rest[:3]
                points.append([float(x), float(y), float(z)])
            elif first == "f":
                numbers = [int(corner.split("/")[0]) for corner in rest]
                one = objects.setdefault(said[word] or unnamed, _Object())
                # Negative numbers count back from the last point before the line.
                one.faces.append([k - 1 if k > 0 else len(points) + k for k in numbers])
                one.own |= since_name
                for key, words in one.words.items():
                    words.add(said[key])
                since_face.clear()
        except ValueError:
            raise ValueError(f"it cannot be read as .obj ('{line.strip()[:60]}'); export it again") from None
    return np.array(points).reshape(-1, 3), objects


def _off(path: Path) -> Bodies:
    """Read an .off file, whose faces may have any number of corners; colours and normals are not taken."""
    data = path.read_bytes()
    # Binary ones, and those of coordinates that are divided by a fourth or of another number.
    if re.match(rb"\s*(ST|C|N)*((4n?|n)OFF|OFF[ \t]+BINARY)", data):
        return _scene(path)
    lines = [words for line in data.decode("latin-1").splitlines() if (words := line.partition("#")[0].split())]
    if lines and lines[0][0].upper().endswith("OFF"):
        # The counts may stand on the first line.
        lines[0] = lines[0][1:]
        lines = lines if lines[0] else lines[1:]
    with parsing(".off"):
        n, m = int(lines[0][0]), int(lines[0][1])
        points = np.array([words[:3] for words in lines[1 : n + 1]], dtype=float).reshape(-1, 3)
        rows = lines[n + 1 : n + m + 1]
        faces = [[int(k) for k in words[1 : int(words[0]) + 1]] for words in rows]
        if len(faces) < m:
            raise ValueError(f"it breaks off: {m} faces announced, {len(faces)} there")
        for k, (words, face) in enumerate(zip(rows, faces, strict=True), start=1):
            if len(face) < int(words[0]):
                raise ValueError(f"face {k} announces {words[0]} corners and has {len(face)}")
    return Bodies([Body(path.name, points, fans(faces))] if m else [])


def _inherited(objects: dict[str, _Object]) -> list[Any]:
    """Say which objects of an .obj file have the group or material that is said for another, or lack its role."""
    notes = list[Any]()
    for key, what in (("g", "group"), ("usemtl", "material")):
        inherit = {name: one for name, one in objects.items() if one.inherited(key)}
        free = [f"'{name}' ('{max(one.roles(key))}')" for name, one in inherit.items() if one.roles(key)]
        have = [f"'{name}' ('{max(one.inherited(key))}')" for name, one in inherit.items() if not one.roles(key)]
        said = f"of {counted(len(objects), 'object')} without a {what} of their own ({key})"
        if free:
            text = f"{len(free)} {said} have not the role that is said for one before: {listed(free)}"
            notes.append(Note(CHANGED, f"{text}; [roles] can say otherwise"))
        if have:
            notes.append(f"{len(have)} {said} have that of one before: {listed(have)}")
    return notes


def _obj_text(path: Path) -> str:
    """Read the lines of an .obj file, with those that are continued in one."""
    data = path.read_bytes()
    # A name may have any character.
    if b"\0" in data and not re.search(rb"^[ \t]*f[ \t]", data, re.MULTILINE):
        raise ValueError(f"it is no .obj file: it begins with {data[:16]!r}; give it the suffix that it has")
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = data.decode("latin-1")
    return re.sub(r"\\\r?\n", " ", text)


def _distinct(rows: Sequence[dict[str, Any]]) -> list[str]:
    """Names on one line each, with a number where one is empty or there already."""
    found = dict[str, None]()
    for number, row in enumerate(rows):
        name = " ".join(str(row.get("name", "")).split())
        while not name or name in found:
            name = f"{name} ({number})".strip()
        found[name] = None
    return list(found)


def _scene(path: Path) -> Bodies:
    import trimesh

    # What it would print of a missing texture is no fault of a stone.
    logging.getLogger("trimesh").setLevel(logging.CRITICAL + 1)
    suffix = path.suffix.lower()
    text = path.read_bytes() if suffix == ".stl" else b""
    begun, ended = (len(re.findall(rb"(?im)^\s*%s\b" % word, text)) for word in (b"solid", b"endsolid"))
    if begun > ended and re.search(rb"(?i)\bvertex\s", text):
        bodies = counted(begun, "body begins", "bodies begin")
        raise ValueError(f"it breaks off: {bodies} and {ended} end (endsolid); export it again")
    with parsing(suffix):
        if suffix == ".glb":
            return _nodes(path)
        scene = trimesh.load_scene(str(path), process=False)
        meshes = {str(name): mesh for name, mesh in scene.geometry.items() if hasattr(mesh, "faces")}
        parts = [_body(name, [mesh]) for name, mesh in meshes.items() if len(mesh.faces)]
        return _numbered(parts, scene, _own_rows(path)) if suffix == ".ply" else Bodies(parts)


def _body(name: str, meshes: Sequence[Any]) -> Body:
    from trimesh.util import append_faces

    points, faces = append_faces([mesh.vertices for mesh in meshes], [mesh.faces for mesh in meshes])
    return Body(name, np.asarray(points, dtype=float), np.asarray(faces, dtype=np.int64))


def _checked_size(parts: Sequence[Body]) -> float:
    """Return the size of all parts, whose points must be finite and there."""
    if not parts:
        raise ValueError("it has no surface cells; export the blocks as closed bodies or a flat mesh")
    spread = spread_of(np.concatenate([part.points for part in parts]))
    for part in parts:
        outside = part.faces[(part.faces < 0) | (part.faces >= len(part.points))]
        if len(outside):
            raise ValueError(
                f"a face of '{part.name}' uses point {int(outside[0])}, but there are {len(part.points)}; "
                "export it again"
            )
    return float(spread.max())


def _description(path: Path) -> dict[str, Any]:
    """Read what a .glb file says about itself; empty where it is no JSON."""
    with path.open("rb") as stream:
        head = stream.read(20)
        return json_object(stream.read(int.from_bytes(head[12:16], "little")))


def _up(path: Path, bodies: Sequence[Body], size: float) -> tuple[str, str]:
    """Find the coordinate that points up in a .glb file: y, as the format has it, unless its program does not care.

    Of a program that writes coordinates as they are, z, which is up in most of them; y where the bodies stand along it.
    """
    try:
        generator = str(_description(path).get("asset", {}).get("generator", ""))
    except AttributeError:
        generator = ""
    program = next((word for word in AS_THEY_ARE if word in generator.lower()), "")
    if not program:
        return "y", f"y is up in .glb files{f' ({generator})' if generator else ''}"
    writes, stand = f"{program} writes coordinates as they are", _stand_along_y(bodies, size)
    return ("y", f"{writes}, and {stand}") if stand else ("z", f"{writes}, z up in most files")


def _stand_along_y(bodies: Sequence[Body], size: float) -> str:
    """Say that bodies stand along y on level faces, fewer than along z: what lies on its side does with most; or ""."""
    along_y, along_z = (_standing(bodies, axis, size) for axis in (1, 2))
    if not along_y or along_y > STANDING * len(bodies) or 0 < along_z <= along_y:
        return ""
    stand = counted(along_y, "body stands", "bodies stand")
    return f"{stand} on a level if y is up, {along_z or 'none'} would if z is"


def _standing(bodies: Sequence[Body], axis: int, size: float) -> int:
    """Count the bodies with a face in the lowest level along an axis; 0 if the middle of all is not above them."""
    # The pieces of one mesh share its points.
    corners = [body.points[np.unique(body.faces)] for body in bodies]
    lowest = min(float(points[:, axis].min()) for points in corners)
    feet = [points[points[:, axis] <= lowest + LEVEL * size] for points in corners]
    feet = [foot for foot in feet if len(foot) > 2]
    if not feet:
        return 0
    plan = [k for k in range(3) if k != axis]
    middle = np.mean([points.mean(axis=0) for points in corners], axis=0)
    ground = shapely.MultiPoint(np.concatenate(feet)[:, plan]).convex_hull
    return len(feet) if ground.covers(shapely.Point(middle[plan])) else 0


def _nodes(path: Path) -> Bodies:
    """Read the meshes at the nodes of a .glb file, of which one may be at several, and have a part for each material.

    A node has the name of the stone, the nodes around it are its groups.
    """
    import trimesh

    described = _description(path)
    nodes, meshes = described.get("nodes", []), described.get("meshes", [])
    for k, node in enumerate(nodes):
        if "mesh" in node and not 0 <= node["mesh"] < len(meshes):
            raise ValueError(f"node {node.get('name', k)} has mesh {node['mesh']} of {len(meshes)}")
    # Called by their numbers: trimesh changes names that are there several times.
    called = {"nodes": [{**node, "name": str(k)} for k, node in enumerate(nodes)]} if nodes else {}
    scene = trimesh.load_scene(_with_description(path, described | called), file_type="glb", process=False)
    found = _shapes_at_nodes(scene)
    drawn = [(nodes[k], meshes[nodes[k]["mesh"]]) for k in found]
    names = [str(node.get("name") or mesh.get("name") or path.name) for node, mesh in drawn]
    parts = [_body(name, shapes) for name, shapes in zip(names, found.values(), strict=True)]
    rows = [row for _, mesh in drawn if isinstance(row := (mesh.get("extras") or {}).get("blockvis"), dict)]
    if len(rows) == len(parts):
        parts = [replace(part, said=row) for part, row in zip(parts, rows, strict=True)]
    else:
        materials = [_materials(mesh, described.get("materials", [])) for _, mesh in drawn]
        parts = dae.said_below(parts, _around([*found], nodes), materials)
    return Bodies(parts, "m", up="y")


def _shapes_at_nodes(scene: Any) -> dict[int, list[Any]]:
    """Meshes of a scene where they are placed, without textures, by the numbers after which nodes are called."""
    import trimesh

    order, placed = {name: k for k, name in enumerate(scene.geometry)}, []
    for frame in scene.graph.nodes_geometry:
        transform, name = scene.graph[frame]
        # Of a mesh in several parts each has a frame that is called after the node, and more.
        placed.append((order[name], int(frame.partition("_")[0]), name, transform))
    found = dict[int, list[Any]]()
    for _, node, name, transform in sorted(placed, key=lambda one: one[:2]):
        mesh = scene.geometry[name]
        if len(getattr(mesh, "faces", ())):
            shape = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).apply_transform(transform)
            found.setdefault(node, []).append(shape)
    return found


def _with_description(path: Path, described: dict[str, Any]) -> BytesIO:
    """Give the content of a .glb file with another description of it."""
    data, text = path.read_bytes(), json.dumps(described).encode()
    text += b" " * (-len(text) % 4)
    rest = data[20 + int.from_bytes(data[12:16], "little") :]
    sizes = [n.to_bytes(4, "little") for n in (20 + len(text) + len(rest), len(text))]
    return BytesIO(b"".join([data[:8], *sizes, data[16:20], text, rest]))


def _around(found: Sequence[int], nodes: Sequence[dict[str, Any]]) -> list[list[str]]:
    """Names of the nodes of a .glb file around each of some, the outermost first."""
    above = {below: k for k, node in enumerate(nodes) for below in node.get("children", [])}
    around = []
    for node in found:
        names = list[str]()
        while (node := above.get(node, -1)) >= 0 and len(names) < len(nodes):
            names.insert(0, str(nodes[node].get("name", "")))
        around.append(names)
    return around


def _materials(mesh: dict[str, Any], every: Sequence[dict[str, Any]]) -> list[str]:
    """Names of the materials of a mesh of a .glb file."""
    return [str(every[part["material"]].get("name", "")) for part in mesh["primitives"] if "material" in part]


def _numbered(parts: list[Body], scene: Any, rows: list[dict[str, Any]]) -> Bodies:
    """Split a .ply whose faces have a ``block_id`` into one part per number, to which its row belongs."""
    raw = next(iter(scene.geometry.values())).metadata.get("_ply_raw", {}) if parts else {}
    data = raw.get("face", {}).get("data")
    names = getattr(getattr(data, "dtype", None), "names", None) or (data if isinstance(data, dict) else ())
    if "block_id" not in names:
        lost = f"not read: what blockvis wrote of {counted(len(rows), 'block')}: faces have no block_id any more"
        return Bodies(parts, notes=[Note(LEFT_OUT, lost)] if rows else [])
    # trimesh puts the triangles of polygons in another order.
    polygons = data["vertex_indices" if "vertex_indices" in names else "vertex_index"]
    polygons = polygons if isinstance(data, dict) else polygons["f1"]
    points = np.column_stack([np.ravel(raw["vertex"]["data"][axis]) for axis in "xyz"]).astype(float)
    values, owners = np.unique(np.ravel(data["block_id"]), return_inverse=True)
    faces: list[list[list[int]]] = [[] for _ in values]
    for polygon, owner in zip(polygons, owners.tolist(), strict=True):
        faces[owner].append(polygon.tolist())
    known = all(value in range(len(rows)) for value in values.tolist())
    said = [rows[int(value)] if known else {} for value in values]
    numbered = zip(values.tolist(), faces, said, strict=True)
    return Bodies([Body(f"block {value}", points, fans(own), row) for value, own, row in numbered])


def _flat(parts: Sequence[Body], path: Path, view: str | None) -> Layout:
    if path.suffix.lower() == ".stl":
        # Each triangle has corners of its own there, by which it would be a piece of its own.
        same = [np.unique(part.points, axis=0, return_inverse=True) for part in parts]
        parts = [
            replace(part, points=own, faces=index.ravel()[part.faces])
            for part, (own, index) in zip(parts, same, strict=True)
        ]
    layouts = []
    for part in parts:
        found = layout_of_cells(part.points, list(part.faces), {}, view)
        assert isinstance(found, Layout)
        every = [{key: word for key, word in part.said.items() if key != "name"}] * found.n_blocks
        layouts.append(with_rows(found, every, own=True) if part.said else found)
    layout = merged(layouts, [part.name for part in parts])
    assert isinstance(layout, Layout)
    named = len(parts) == layout.n_blocks and all("name" in part.said for part in parts)
    return with_rows(layout, [part.said for part in parts], own=True) if named else layout


def _own_rows(path: Path) -> list[dict[str, Any]]:
    """Read the rows of the block table that our own writer puts into comments, one line of JSON per block."""
    if path.suffix.lower() not in (".obj", ".ply"):
        return []
    rows = []
    with path.open("rb") as stream:
        for line in stream:
            mark = line.find(b"blockvis {")
            if mark >= 0 and line[:1] in b"#c":
                rows.append(json_object(line[mark + 9 :]))
    return rows if all(rows) else []


def write(layout: Layout, path: Path) -> None:
    """Write .stl, .obj or .ply as text, or .glb: blocks in space, or outlines extruded by their thickness, else 1 m."""
    solids, in_space = solids_of(layout), layout.dimension == 3
    if path.suffix.lower() == ".glb":
        # y is up there, as it is in the plane.
        turned = [(points[:, [0, 2, 1]] * [1, 1, -1] if in_space else points, faces) for points, faces in solids]
        path.write_bytes(_glb(turned, rows_of(layout)))
        return
    what = "blocks in space, z is up, lengths in m" if in_space else "blocks extruded by their thickness, lengths in m"
    lines = {".stl": _stl_lines, ".obj": _obj_lines, ".ply": _ply_lines}[path.suffix.lower()]
    path.write_text("\n".join([*lines(solids, rows_of(layout), what), ""]), encoding="utf-8")


def _glb(solids: list[Solid], rows: list[dict[str, Any]]) -> bytes:
    """Write a node for each block, in single precision about the middle of all; its row stands in the extras."""
    import trimesh

    scene, every = trimesh.Scene(base_frame=BASE_FRAME), np.concatenate([points for points, _ in solids])
    # Whole metres: corners that are numbers of single precision stay what they are.
    origin = np.round((every.min(axis=0) + every.max(axis=0)) / 2.0)
    for (points, faces), row, name in zip(solids, rows, _distinct(rows), strict=True):
        about = points - origin
        mesh = trimesh.Trimesh(about, triangles_of(points, faces), process=False, metadata={"blockvis": row})
        scene.add_geometry(mesh, node_name=name, geom_name=name)
    if origin.any():
        scene.apply_translation(origin)

    def signed(tree: dict[str, Any]) -> None:
        tree["asset"]["generator"] = "blockvis"

    return bytes(scene.export(file_type="glb", tree_postprocessor=signed))


def _stl_lines(solids: list[Solid], rows: list[dict[str, Any]], _: str) -> list[str]:
    lines = []
    # A name is all that is kept of a block: readers number those that repeat, each in its own way.
    names = mechanics.unique_names([str(row["name"]) for row in rows])
    for (points, faces), name in zip(solids, names, strict=True):
        lines.append(f"solid {name}")
        for a, b, c in points[triangles_of(points, faces)]:
            normal = np.cross(b - a, c - a)
            normal = normal / max(float(np.linalg.norm(normal)), 1e-300)
            lines.append("facet normal " + " ".join(f"{x:.9g}" for x in normal))
            lines.append(" outer loop")
            lines += ["  vertex " + " ".join(repr(float(x)) for x in p) for p in (a, b, c)]
            lines += [" endloop", "endfacet"]
        lines.append(f"endsolid {name}")
    return lines


def _obj_lines(solids: list[Solid], rows: list[dict[str, Any]], what: str) -> list[str]:
    lines, start = [f"# {what}"], 1
    for (points, faces), row, name in zip(solids, rows, _distinct(rows), strict=True):
        lines += [f"# blockvis {json.dumps(row)}", f"o {name}"]
        lines += ["v " + " ".join(repr(float(x)) for x in p) for p in points]
        lines += ["f " + " ".join(str(int(k) + start) for k in face) for face in _whole_faces(points, faces)]
        start += len(points)
    return lines


def _ply_lines(solids: list[Solid], rows: list[dict[str, Any]], what: str) -> list[str]:
    # Triangles: polygons of several lengths keep their block_id in few readers.
    found = [triangles_of(points, faces).tolist() for points, faces in solids]
    lines = ["ply", "format ascii 1.0", f"comment {what}"]
    lines += [f"comment blockvis {json.dumps(row)}" for row in rows]
    lines += [f"element vertex {sum(len(points) for points, _ in solids)}"]
    lines += [f"property double {axis}" for axis in "xyz"]
    lines += [
        f"element face {sum(map(len, found))}",
        "property list uchar int vertex_indices",
        "property int block_id",
        "end_header",
    ]
    lines += [" ".join(repr(float(x)) for x in p) for points, _ in solids for p in points]
    start = 0
    for number, ((points, _), faces) in enumerate(zip(solids, found, strict=True)):
        lines += [f"{len(face)} " + " ".join(str(int(k) + start) for k in face) + f" {number}" for face in faces]
        start += len(points)
    return lines


def _whole_faces(points: np.ndarray, faces: list[list[int]]) -> list[list[int]]:
    """Faces as they are; those with re-entrant corners, which many programs cut in fans, as triangles."""
    whole: list[list[int]] = []
    for face in faces:
        ring = points[face]
        turns = np.cross(np.roll(ring, -1, axis=0) - ring, np.roll(ring, -2, axis=0) - np.roll(ring, -1, axis=0))
        convex = bool((turns @ area_vectors(points, [face])[0] >= 0.0).all())
        whole += [face] if convex else triangles_of(points, [face]).tolist()
    return whole
