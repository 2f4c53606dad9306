"""Bodies in space: prisms become outlines with a thickness, everything else is refused."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest
import trimesh
from structures import box, fans, layout_of

from blockvis import generators, read, read_layout, write_layout

move = trimesh.transformations.translation_matrix


def bricks(n=3, gap=0.1):
    return [trimesh.creation.box((1, 0.5, 0.25), transform=move((k * (1 + gap), 0, 0.2 * k))) for k in range(n)]


@pytest.mark.parametrize("suffix", [".stl", ".off", ".ply", ".obj"])
def test_separate_bodies_of_a_facade_that_stands_upright(tmp_path, suffix):
    path = tmp_path / f"a{suffix}"
    trimesh.util.concatenate(bricks()).export(path)
    drawing = read_layout(path)
    assert drawing.n_blocks == 3
    assert drawing.thickness == pytest.approx([0.5] * 3, rel=1e-6)
    assert any("outlines in xz; their depth along y is the thickness" in note for note in drawing.notes)
    assert read(path).areas == pytest.approx([0.25] * 3, rel=1e-6)


def test_names_of_obj_objects_may_have_any_character(tmp_path):
    wall = layout_of(generators.arch(voussoirs=4))
    names = ("a\0", *wall.names[1:])
    write_layout(replace(wall, names=names), tmp_path / "a.obj")
    assert read_layout(tmp_path / "a.obj").names == names


def test_named_objects_may_touch(tmp_path):
    scene = trimesh.Scene()
    for k, body in enumerate(bricks(4, gap=0.0)):
        scene.add_geometry(body, node_name=f"brick {k}", geom_name=f"brick {k}")
    scene.export(tmp_path / "a.glb")
    assembly = read(tmp_path / "a.glb")
    assert assembly.names == tuple(f"brick {k}" for k in range(4))
    assert assembly.centroids[2] == pytest.approx([2, 0.4], abs=1e-6)


@pytest.mark.parametrize(
    ("name", "up", "says"),
    [
        pytest.param(
            "two-leaf wall",
            "y",
            r"2 bodies stand on a level if y is up, none would if z is: .* as \(x, -z, y\); .*\"xz\"",
            marks=pytest.mark.thorough,
        ),
        ("barrel vault", "y", r"2 bodies stand on a level if y is up, 14 would if z is: .*view = \"xz\" if z is up"),
        ("barrel vault", "z", r"writes coordinates as they are, z up in most files: z was .*view = \"xy\" if y is up"),
    ],
)
def test_where_a_program_may_write_either_axis_up_it_is_the_one_on_which_the_blocks_stand(tmp_path, name, up, says):
    layout = layout_of(generators.build(name))
    scene = trimesh.Scene()
    for stone, (points, faces) in zip(layout.names, layout.solids, strict=True):
        drawn = points if up == "z" else points[:, [0, 2, 1]] * [1, 1, -1]
        scene.add_geometry(trimesh.Trimesh(drawn, fans(faces), process=False), node_name=stone, geom_name=stone)
    scene.export(tmp_path / "a.glb")
    found = read_layout(tmp_path / "a.glb", dimension=3)
    np.testing.assert_allclose(np.ptp(found.points, axis=0), np.ptp(layout.points, axis=0), rtol=1e-6)
    assert any(re.search(says, note) for note in found.notes)


@pytest.mark.parametrize("suffix", ["obj", "stl", "ply", "off"])
@pytest.mark.parametrize("name", ["barrel vault", "dome"])
@pytest.mark.slow
def test_where_blocks_stand_along_y_that_is_told_of_files_that_do_not_say_what_is_up(tmp_path, name, suffix):
    layout = layout_of(generators.build(name))
    for up in "yz":
        turned = [points if up == "z" else points[:, [0, 2, 1]] * [1, 1, -1] for points, _ in layout.solids]
        meshes = [
            trimesh.Trimesh(own, fans(of[1]), process=False) for own, of in zip(turned, layout.solids, strict=True)
        ]
        path = tmp_path / f"{up}.{suffix}"
        trimesh.util.concatenate(meshes).export(path)
        told = [note for note in read_layout(path, dimension=3).notes if 'give view = "xy" if y is up' in note]
        assert len(told) == (up == "y")
        assert all(re.match(r"\d bodies stand on a level if y is up, (\d+|none) would if z is: z was", n) for n in told)
    if suffix in ("obj", "ply"):
        # We write that z is up.
        write_layout(replace(layout, blocks=tuple(zip(turned, (f for _, f in layout.solids), strict=True))), path)
        assert not any("is up" in note for note in read_layout(path, dimension=3).notes)


@pytest.mark.parametrize("suffix", ["stl", pytest.param("ply", marks=pytest.mark.thorough)])
@pytest.mark.parametrize(
    "name", ["T corner", *(pytest.param(name, marks=pytest.mark.thorough) for name in ("dome", "cross vault"))]
)
def test_stones_of_one_mesh_that_touch_are_separate_blocks(tmp_path, name, suffix):
    """The faces in any order, turned inside out or not: around each edge they go together by their insides."""
    layout = generators.build(name, {"courses": 3} if name == "T corner" else None)
    random = np.random.default_rng(3)
    stones = [trimesh.Trimesh(points, fans(faces), process=False) for points, faces in layout_of(layout).solids]
    mesh = trimesh.util.concatenate(stones)
    faces = mesh.faces[random.permutation(len(mesh.faces))]
    for drawn in (faces, faces[:, ::-1]):
        trimesh.Trimesh(mesh.vertices, drawn, process=False).export(tmp_path / f"a.{suffix}")
        found = read(tmp_path / f"a.{suffix}", dimension=3)
        assert found.n_blocks == layout.n_blocks
        np.testing.assert_allclose(np.sort(found.shapes.volumes), np.sort(layout.shapes.volumes), rtol=1e-4)


def test_touching_bodies_of_which_one_is_inside_out_or_drawn_twice_are_told_apart_by_their_own_points(tmp_path):
    pair = [trimesh.creation.box((1, 1, 1), transform=move((k, 0, 0))) for k in (0, 1)]
    pair[1].faces = pair[1].faces[:, ::-1]
    trimesh.util.concatenate(pair).export(tmp_path / "a.stl")
    with pytest.raises(ValueError, match=r"holds bodies that touch and cannot be told apart: 4 edges .* inside out"):
        read(tmp_path / "a.stl")
    trimesh.util.concatenate([*pair, pair[0]]).export(tmp_path / "a.ply")
    found = read(tmp_path / "a.ply", dimension=3)
    np.testing.assert_allclose(found.shapes.volumes, [1.0, 1.0])
    assert found.names == ("a.ply 1", "a.ply 2")


def glb(path, nodes, roots=None):
    """Write a box and nodes that place it."""
    data = trimesh.creation.box((1, 1, 1)).export(file_type="glb")
    length = int.from_bytes(data[12:16], "little")
    tree = json.loads(data[20 : 20 + length])
    tree |= {"nodes": nodes, "scenes": [{"nodes": roots or list(range(len(nodes)))}], "scene": 0}
    tree["meshes"][0].pop("name", None)
    text = json.dumps(tree).encode()
    text += b" " * (-len(text) % 4)
    rest = data[20 + length :]
    size = (20 + len(text) + len(rest)).to_bytes(4, "little")
    path.write_bytes(data[:8] + size + len(text).to_bytes(4, "little") + data[16:20] + text + rest)
    return path


def test_nodes_of_one_name_or_none_keep_it_and_their_roles(tmp_path):
    at = [[0, 0, 0], [4, 0, 0], [2, 0, 0]]
    names = [{"name": "fixed pier"}, {"name": "fixed pier"}, {}]
    nodes = [{**name, "mesh": 0, "translation": place} for name, place in zip(names, at, strict=True)]
    layout = read_layout(glb(tmp_path / "a.glb", nodes))
    assert layout.names == ("fixed pier", "fixed pier", "a.glb")
    assert layout.roles == ("fixed", "fixed", "")
    nodes[2]["mesh"] = 5
    with pytest.raises(ValueError, match="node 2 has mesh 5 of 1"):
        read_layout(glb(tmp_path / "a.glb", nodes))


def test_bodies_that_break_off_are_refused(tmp_path):
    text = "".join(body.export(file_type="stl_ascii") for body in bricks(2))
    (tmp_path / "a.stl").write_text(text[: 3 * len(text) // 4], encoding="utf-8")
    with pytest.raises(ValueError, match=r"2 bodies begin and 1 end \(endsolid\)"):
        read_layout(tmp_path / "a.stl")


def test_what_is_no_prism_is_refused(tmp_path):
    trimesh.creation.icosphere().export(tmp_path / "a.stl")
    with pytest.raises(ValueError, match=r"is not prismatic: body .* is no extrusion along x, y or z"):
        read(tmp_path / "a.stl", dimension=2)


def test_what_is_told_to_be_no_prism_is_none_along_any_axis(tmp_path):
    scene = trimesh.Scene()
    ell = trimesh.creation.extrude_triangulation([[0, 0], [1, 0], [0, 1]], [[0, 1, 2]], 1.0)
    for k, (name, turn) in enumerate({"along z": (0, 0, 1), "along x": (0, 1, 0)}.items()):
        tilted = ell.copy().apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, turn))
        scene.add_geometry(tilted.apply_translation((3 * k, 0, 0)), geom_name=name)
    scene.export(tmp_path / "a.obj")
    told = "body 'along x' is no extrusion along z; .*'along z' is no extrusion along y; .*'along z' is .* along x;"
    with pytest.raises(ValueError, match=rf"is not prismatic: {told}"):
        read(tmp_path / "a.obj", dimension=2)
    scene.add_geometry(trimesh.creation.icosphere(1).apply_translation((0, 9, 0)), geom_name="ball")
    scene.export(tmp_path / "a.obj")
    with pytest.raises(ValueError, match=r"is not prismatic: body 'ball' is no extrusion along x, y or z"):
        read(tmp_path / "a.obj", dimension=2)


def test_open_bodies_are_refused(tmp_path):
    body = bricks(1)[0]
    trimesh.Trimesh(body.vertices, body.faces[:-1]).export(tmp_path / "a.ply")
    with pytest.raises(ValueError, match="is not closed: 3 edges belong to one face only"):
        read(tmp_path / "a.ply")


def test_a_flat_mesh_is_a_layout(tmp_path):
    (tmp_path / "a.obj").write_text(
        "o left\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3\nf 1 3 4\no right\nv 1 0 0\nv 2 0 0\nv 2 1 0\nv 1 1 0\n"
        "f 5 6 7\nf 5 7 8\n",
        encoding="utf-8",
    )
    assembly = read(tmp_path / "a.obj")
    assert assembly.names == ("left", "right")
    assert assembly.areas.tolist() == [1, 1]


def test_the_triangles_of_a_flat_stl_that_share_edges_are_one_block(tmp_path):
    """There each triangle has corners of its own."""
    mesh = trimesh.Trimesh([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], [(0, 1, 2), (0, 2, 3)], process=False)
    mesh.export(tmp_path / "a.stl")
    assert read(tmp_path / "a.stl").areas.tolist() == [1]


def test_a_speck_with_a_volume_beside_flat_blocks_is_not_taken_for_flat(tmp_path):
    """Here all together lie in a plane but for a millionth, and the speck ended with a traceback."""
    (tmp_path / "a.obj").write_text(
        "o wall\nv 0 0 0\nv 1000 0 0\nv 1000 900 0\nf 1 2 3\n"
        "o speck\nv 0 -1 0\nv 1e-5 -1 0\nv 0 -1.00001 0\nv 0 -1 1e-5\nf 4 5 6\nf 4 6 7\nf 4 7 5\nf 5 7 6\n",
        encoding="utf-8",
    )
    with pytest.raises(ValueError, match="'wall' is not closed"):
        read(tmp_path / "a.obj")


BOX = ((1, 2, 4, 3), (5, 7, 8, 6), (1, 5, 6, 2), (3, 4, 8, 7), (1, 3, 7, 5), (2, 6, 8, 4))


def wavefront(path, *stones, relative=False, faces=BOX, per_face=()):
    """Write boxes, each the line that names it and its width, one above the other."""
    lines = []
    for k, (line, width) in enumerate(stones):
        lines += [line, *(f"v {x} {y} {k + z}" for z in (0, 1) for y in (0, 1) for x in (0, width))]
        for number, face in enumerate(faces):
            lines += [line for line in per_face[number : number + 1]]
            lines.append("f " + " ".join(f"{n - 9 if relative else n + 8 * k}/1/1" for n in face))
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def test_points_of_an_obj_file_may_be_counted_back_from_their_line(tmp_path):
    stones = ("o fixed base", 3), ("o\tpier", 2), ("o top", 1)
    for relative in (False, True):
        found = read_layout(wavefront(tmp_path / "a.obj", *stones, relative=relative), dimension=3)
        assert found.names == ("fixed base", "pier", "top")
        assert [np.ptp(points, axis=0).tolist() for points, _ in found.solids] == [[3, 1, 1], [2, 1, 1], [1, 1, 1]]


def test_what_we_wrote_of_objects_holds_beside_others(tmp_path):
    ours = '# blockvis {"name": "foot", "role": "moving"}\no foot', '# blockvis {"name": "gone"}\no renamed'
    found = read_layout(wavefront(tmp_path / "a.obj", *((words, 3) for words in (*ours, "o added"))), dimension=3)
    assert (found.names, found.roles) == (("foot", "renamed", "added"), ("moving", "", ""))
    assert any("what blockvis wrote of 1 block, 'gone': no object is called so" in note for note in found.notes)


def test_groups_name_the_stones_of_an_obj_file_without_objects(tmp_path):
    path = wavefront(tmp_path / "a.obj", ("g Mesh1 fixed_base1 Model", 3), ("g pier left", 2))
    found = read_layout(path, dimension=3)
    assert found.names == ("fixed_base1", "pier left")
    assert found.roles == ("fixed", "")
    wavefront(path, ("g stone", 3), per_face=[f"g face {k}" for k in range(len(BOX))])
    found = read_layout(path, dimension=3)
    assert found.names == ("a.obj",)
    assert any("not read: 6 names of groups, not closed by themselves" in note for note in found.notes)


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ("f 1 2 x", r"cannot be read as \.obj \('f 1 2 x'\); export it again"),
        ("v 1,5 0", r"cannot be read as \.obj \('v 1,5 0'\); export it again"),
        ("f 1 2 30", r"a face of 'a' uses point 30, but there are 8; export it again"),
    ],
)
def test_lines_of_an_obj_file_that_cannot_be_read_are_named(tmp_path, line, says):
    path = wavefront(tmp_path / "a.obj", ("o a", 1))
    path.write_text(f"{path.read_text(encoding='utf-8')}{line}\n", encoding="utf-8")
    with pytest.raises(ValueError, match=says):
        read_layout(path)


def test_not_finite(tmp_path):
    (tmp_path / "a.obj").write_text("v 0 0 0\nv nan 0 0\nv 1 1 0\nv 0 1 1\nf 1 2 3\nf 1 3 4\n", encoding="utf-8")
    with pytest.raises(ValueError, match="coordinates must be finite"):
        read(tmp_path / "a.obj")


def test_a_ring_of_many_copies_of_one_point_is_quick(tmp_path):
    body = bricks(1)[0]
    many = np.repeat(body.triangles, 1, axis=0)
    trimesh.Trimesh(*_soup(np.concatenate([many, np.zeros((20_000, 3, 3))]))).export(tmp_path / "a.stl")
    assert read(tmp_path / "a.stl").n_blocks == 1


def _soup(triangles):
    return triangles.reshape(-1, 3), np.arange(3 * len(triangles)).reshape(-1, 3)


@pytest.mark.parametrize("edges", [3, 4])
def test_small_holes_of_a_scanned_stone_are_closed_with_a_note(tmp_path, edges):
    stone = trimesh.creation.icosphere(subdivisions=2)
    missing = stone.face_adjacency[0][: edges - 2]
    trimesh.Trimesh(stone.vertices, np.delete(stone.faces, missing, axis=0)).export(tmp_path / "a.ply")
    layout = read_layout(tmp_path / "a.ply", dimension=3)
    assert layout.volumes[0] == pytest.approx(stone.volume, rel=5e-3)
    assert f"small holes in the surface of 'a.ply' ({edges} edges) were closed" in layout.notes


def polygons(path, vertices, faces, ids, comments=()):
    """Write a .ply of polygons with the number of the block of each, if there are any."""
    lines = ["ply", "format ascii 1.0", *(f"comment blockvis {json.dumps(row)}" for row in comments)]
    lines += [f"element vertex {len(vertices)}", *(f"property double {axis}" for axis in "xyz")]
    lines += [f"element face {len(faces)}", "property list uchar int vertex_indices"]
    lines += ["property int block_id"] * bool(ids) + ["end_header", *(" ".join(map(str, one)) for one in vertices)]
    lines += [" ".join(map(str, (len(face), *face, *ids[k : k + 1]))) for k, face in enumerate(faces)]
    path.write_text("\n".join([*lines, ""]), encoding="utf-8")
    return path


def test_polygons_of_a_ply_keep_their_block(tmp_path):
    corners = [(0, 0, 0), (1, 0, 0), (2, 0, 0), (0, 1, 0), (1, 1, 0), (2, 1, 0), (3, 1, 0)]
    faces = [(0, 1, 4, 3), (2, 6, 5), (1, 2, 5, 4)]
    layout = read_layout(polygons(tmp_path / "a.ply", corners, faces, [7, 3, 7]))
    assert layout.names == ("block 3", "block 7")
    assert [np.ptp(ring, axis=0).tolist() for ring in layout.outlines] == [[1, 1], [2, 1]]


@pytest.mark.parametrize("numbered", [True, False])
def test_rows_of_a_ply_belong_to_the_blocks_of_their_number_or_to_none(tmp_path, numbered):
    corners = [(x + a, y, z) for x in (0, 2, 4) for z in (0, 1) for y in (0, 1) for a in (0, 1)]
    faces = [tuple(n - 1 + 8 * k for n in face) for k in range(3) for face in BOX]
    rows = [{"name": "C"}, {"name": "B"}, {"name": "A", "role": "fixed"}]
    ids = [2 - k // 6 for k in range(18)] if numbered else []
    layout = read_layout(polygons(tmp_path / "a.ply", corners, faces, ids, rows))
    left = {name: ring[:, 0].min() for name, ring in zip(layout.names, layout.outlines, strict=True)}
    if numbered:
        assert left == {"A": 0, "B": 2, "C": 4}
        assert dict(zip(layout.names, layout.roles, strict=True))["A"] == "fixed"
    else:
        assert not {"A", "B", "C"} & set(left)
        assert "not read: what blockvis wrote of 3 blocks: faces have no block_id any more" in layout.notes


@pytest.mark.parametrize(
    ("lines", "names"),
    [
        (("g fixed\no a", "g wall\no b"), ("a", "b")),
        (("o a\nusemtl fixed\ng x", "o b\nusemtl brick\ng wall"), ("a", "b")),
        (("g fixed", "g b\nusemtl brick"), ("fixed", "b")),
        (("usemtl fixed", "usemtl brick"), ("fixed", "brick")),
    ],
)
def test_groups_and_materials_of_an_obj_file_say_roles(tmp_path, lines, names):
    found = read_layout(wavefront(tmp_path / "a.obj", (lines[0], 3), (lines[1], 2)), dimension=3)
    assert found.names == names
    assert found.roles == ("fixed", "")
    assert found.materials[1] == ("brick" if "brick" in lines[1] else "")
    assert found.groups[1] == ("wall" if "o b" in lines[1] else "")


@pytest.mark.parametrize("said", ["usemtl fixed", "g fixed"])
def test_an_object_has_no_role_of_the_one_before(tmp_path, said):
    """Blender writes none of what has none; fixed or free it was by the order of the objects."""
    lintel, pier = ("o lintel", 3), (f"o pier\n{said}", 2)
    for objects in ((lintel, pier), (pier, lintel)):
        found = read_layout(wavefront(tmp_path / "a.obj", *objects), dimension=3)
        assert dict(zip(found.names, found.roles, strict=True)) == {"pier": "fixed", "lintel": ""}
        assert found.groups[found.names.index("lintel")] == ""
        told = [note for note in found.notes if note.startswith("1 of 2 objects without a ")]
        assert len(told) == (objects[0] == pier)
        assert all(
            "have not the role that is said for one before: 'lintel' ('fixed'); [roles]" in note for note in told
        )


@pytest.mark.parametrize(("key", "what"), [("usemtl", "materials"), ("g", "groups")])
@pytest.mark.parametrize("last", ["", "wood"])
@pytest.mark.parametrize("line", ["{said}\no a", "o a\n{said}"])
def test_a_group_or_material_of_an_obj_file_holds_until_the_next(tmp_path, key, what, last, line):
    lines = (line.format(said=f"{key} stone"), "o b", f"o c\n{key} {last}" if last else "o c")
    found = read_layout(wavefront(tmp_path / "a.obj", *zip(lines, (3, 2, 1), strict=True)), dimension=3)
    assert getattr(found, what) == ("stone", "stone", last or "stone")
    # Said once above the first object it is of all.
    told = [
        note for note in found.notes if f"without a {what[:-1]} of their own ({key}) have that of one before" in note
    ]
    assert len(told) == (bool(last) or line.startswith("o a"))
    assert all("'b' ('stone')" in note for note in told)


def test_a_role_said_once_above_all_objects_of_an_obj_file_is_of_all(tmp_path):
    found = read_layout(wavefront(tmp_path / "a.obj", ("usemtl fixed\no a", 3), ("o b", 2)), dimension=3)
    assert (found.roles, [note for note in found.notes if "without" in note]) == (("fixed", "fixed"), [])


def test_groups_of_an_obj_file_are_asked_for_open_surfaces_too(tmp_path):
    path = wavefront(tmp_path / "a.obj", ("o a\ng wall", 3))
    path.write_text(path.read_text(encoding="utf-8") + "o b\ng dims\nf 1 2 4\n", encoding="utf-8")
    opened = path.read_text(encoding="utf-8").replace("f 1 2 4", "f 1 2 4\nf 1 2 5")
    path.write_text(opened, encoding="utf-8")
    assert read_layout(path, ignore="dims").names == ("a",)


def test_an_object_of_several_groups_has_none(tmp_path):
    path = wavefront(tmp_path / "a.obj", ("o a", 3), per_face=[f"g fixed {k}" for k in range(len(BOX))])
    assert (read_layout(path).groups, read_layout(path).roles) == (("",), ("",))


def test_nodes_around_those_of_stones_are_groups(tmp_path):
    names = ("world", "fixed", "wall", "deep", "a", "b")
    children = {0: [1, 2], 1: [3], 3: [4], 2: [5]}
    nodes = [{"name": name, **({"children": children[k]} if k in children else {})} for k, name in enumerate(names)]
    nodes[4] |= {"mesh": 0}
    nodes[5] |= {"mesh": 0, "translation": [2, 0, 0]}
    layout = read_layout(glb(tmp_path / "a.glb", nodes, [0]))
    assert (layout.names, layout.groups, layout.roles) == (("a", "b"), ("deep", "wall"), ("fixed", ""))


@pytest.mark.parametrize("head", ["OFF\n# two stones\n16 12 0\n", "OFF 16 12 0\n", "COFF\n\n16 12 24\n"])
def test_off_files_may_have_faces_of_any_number_of_corners(head, tmp_path):
    lines, faces = [], []
    for k, (points, rings) in enumerate((box((0, 0, 0), (1, 0.5, 0.4)), box((0, 0, 0.4), (0.6, 0.5, 0.8)))):
        lines += [" ".join(map(str, point)) + "  255 0 0" * head.startswith("COFF") for point in points]
        faces += [" ".join(str(v) for v in (len(ring), *(8 * k + i for i in ring))) + "  0.5 0.5 0.5" for ring in rings]
    path = tmp_path / "a.off"
    path.write_text(head + "\n".join([*lines, *faces]) + "\n", encoding="utf-8")
    assert sorted(read_layout(path, dimension=3).volumes) == pytest.approx([0.12, 0.2])
    path.write_text(head + "\n".join([*lines, *faces[:-1]]), encoding="utf-8")
    with pytest.raises(ValueError, match="12 faces"):
        read_layout(path)


def test_a_view_that_a_note_proposes_for_blocks_in_space_names_the_dimension_that_it_needs(tmp_path):
    """Alone it asks for the plane, and was refused."""
    stairs = [box((k, 0, 0.2 * k), (k + 1.5, 1, 0.2 * k + 0.2)) for k in range(3)]
    stairs += [box((0, 1, -0.2 - k), (0.5 + k, 2, 0)) for k in range(2)]
    scene = trimesh.Scene()
    for k, (points, faces) in enumerate(stairs):
        scene.add_geometry(trimesh.Trimesh(points, fans(faces), process=False), node_name=f"{k}", geom_name=f"{k}")
    scene.export(tmp_path / "a.glb")
    note = next(note for note in read_layout(tmp_path / "a.glb").notes if "coordinates as they are" in note)
    assert 'give view = "xy" and dimension = 3 if y is up' in note
    assert read_layout(tmp_path / "a.glb", view="xy", dimension=3).n_blocks == 5
    assert not any("and dimension" in note for note in read_layout(tmp_path / "a.glb", dimension=3).notes)
